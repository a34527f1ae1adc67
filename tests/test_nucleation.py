"""Place and length of loss of stability before the events of a record."""

import numpy as np
import pytest
from test_creep import D_C, SLOPE, links, settled, stiffness
from test_slipping import rod, run

import pyfric
from pyfric.record import analysis
from pyfric.values import SceneError


def test_nucleation_is_where_the_slipping_part_is_no_longer_stable():
    """With one more block an eigenvalue of stiffness minus weakening, by NumPy, passes zero."""
    scene = links(5, K=5e6, V=1e-2)
    record = run(scene, 9e-3, "hybrid")
    one = analysis.nucleations(record).iloc[0]
    assert one["length"] == pytest.approx(one["n_blocks"] * scene.slider.l)
    first = record.switches["t"] <= record.events["t_stop"].iloc[0]
    slips = int(one["n_blocks"])
    order = list(record.switches["block"][first][:slips])
    assert order == list(range(slips))
    A, start = stiffness(scene), np.zeros(6)
    push = np.zeros(6)
    push[0] = scene.driver.K * scene.driver.V * one["t"] * (1 - 1e-6)
    u = settled(A, push, np.zeros(6), start)
    A -= SLOPE * np.diag((u < D_C) * 1.0)
    assert np.linalg.eigvalsh(A[: slips - 1, : slips - 1])[0] > 0
    assert np.linalg.eigvalsh(A[:slips, :slips])[0] < 1e-3 * SLOPE


def test_events_name_their_length_of_nucleation(tmp_path):
    """Files keep lengths of nucleation; no length exists while the driver holds."""
    scene = rod(V=1e-2)
    record = run(scene, 8.2e-3, "hybrid")
    found, table = record.events["nucleation_length"], analysis.nucleations(record)
    np.testing.assert_array_equal(found[table["event"]], table["length"])
    assert found.iloc[0] >= scene.slider.l
    record.save(tmp_path / "run.nc")
    assert pyfric.Record.load(tmp_path / "run.nc") == record
    t = float(record.events["t_start"].iloc[0])
    held = scene.replace({"driver.protocol": ((t + 1e-5, 1e-2), (t + 1e-5, 0.0))})
    held = run(held, t + 2e-4, "hybrid")
    assert np.isnan(held.events["nucleation_length"]).all()
    sharp = pyfric.simulate(scene.replace(d_c=0.0), 5e-3, fidelity="quasistatic")
    assert "nucleation_length" not in sharp.events


def test_nucleation_is_refused_without_weakening():
    record = pyfric.simulate(links(5, d_c=0.0), 1e-4, fidelity="quasistatic", progress=False)
    with pytest.raises(SceneError, match=r"interface\.d_c"):
        analysis.nucleations(record)


@pytest.mark.parametrize("K", [0.0, 4e6])
def test_a_pushed_slider_with_weakening_has_a_record(K):
    """Such a slider has no static states for the search of nucleation."""
    scene = pyfric.chain(L=0.025, d_c="1 um", push=((1, 250.0),), K=K)
    record = pyfric.simulate(scene, 2e-4, fidelity="dynamic", progress=False)
    assert record.done
    assert len(record.events)
    assert "nucleation_length" not in record.events


def test_no_nucleation_is_claimed_over_gaps():
    record = run(rod(contact=np.arange(9) != 2), 0.04, "hybrid")
    assert len(record.events)
    assert "nucleation_length" not in record.events
    with pytest.raises(SceneError, match=r"interface\.gap"):
        pyfric.analysis.nucleations(record)
