"""The ladder with weakening: against minimisers of the energy, and the hybrid engine."""

import numpy as np
import pytest
from test_creep import D_C, SLOPE, links, settled, stiffness
from test_creeping import rod

import pyfric
from pyfric.record import analysis
from pyfric.scene import SceneError


def test_six_blocks_go_to_the_next_minimum_of_energy():
    """Several events; each ends where blocks that only slip forward come to rest."""
    K = 5e6
    scene = links(5, K=K, V=1e-3)
    record = pyfric.simulate(scene, 0.12, fidelity="quasistatic", progress=False)
    stops = np.flatnonzero(record.quiet["kind"] == -1)[:2]
    assert len(stops) == 2
    A, start = stiffness(scene), np.zeros(6)
    for t, u_x in zip(record.quiet["t"][stops], record.quiet["u_x"][stops], strict=True):
        push = np.zeros(6)
        u = start
        for share in np.linspace(0.8, 1.0, 6):
            push[0] = K * scene.driver.V * t * share
            u = settled(A, push, u.copy(), start)
        np.testing.assert_allclose(u_x, u, rtol=0, atol=2e-9)
        start = u_x


def test_events_start_like_those_of_the_hybrid_engine():
    """Up to the first event, slip is stable and inertia does not matter."""
    scene, t_end = rod(), 0.037
    a = pyfric.simulate(scene, t_end, fidelity="hybrid", geometry="linear", progress=False)
    b = pyfric.simulate(scene, t_end, fidelity="quasistatic", progress=False)
    first, n = (one.events[one.events["is_main"]].iloc[0] for one in (a, b)), 4
    one, two = first
    assert two["F_T_start"] == pytest.approx(one["F_T_start"], abs=1e-4 * scene.F_N)
    np.testing.assert_array_equal(a.switches["block"][:n], b.switches["block"][:n])
    np.testing.assert_allclose(a.switches["t"][:n], b.switches["t"][:n], rtol=0, atol=3e-4)


def test_nucleation_is_where_the_slipping_part_is_no_longer_stable():
    """An eigenvalue of springs less weakening, by NumPy, passes zero within one more block."""
    scene = links(5, K=5e6, V=1e-3)
    record = pyfric.simulate(scene, 0.09, fidelity="quasistatic", progress=False)
    table = analysis.nucleations(record)
    one = table.iloc[0]
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


def test_stable_slip_rests_while_the_driver_holds():
    """Against the hybrid engine: what slipped sticks, and is as strong as before; 6e-4 F_N."""
    t, V = 17.5e-3, 4e-3
    corners = ((t, V), (t, 0.0), (1.5 * t, 0.0), (1.5 * t, V), (1.55 * t, 1.5 * V))
    scene = rod(V=V).replace({"driver.protocol": corners})
    a = pyfric.simulate(scene, 1.56 * t, fidelity="hybrid", geometry="linear", progress=False)
    b = pyfric.simulate(scene, 1.56 * t, fidelity="quasistatic", progress=False)
    slips = [one.switches["block"][one.switches["new"] == 1] for one in (a, b)]
    assert [list(one[:3]) for one in slips] == 2 * [[0, 1, 2]]
    assert len(slips[0]) == len(slips[1]) > 6
    when = np.linspace(0, 1.56 * t, 400)
    F_T = (np.interp(when, one.curve["t"], one.curve["F_T"]) for one in (a, b))
    np.testing.assert_allclose(*F_T, rtol=0, atol=1e-3 * scene.F_N)
    back = scene.replace({"driver.protocol": ((t, V), (t, -V))})
    with pytest.raises(SceneError, match="while the driver goes on"):
        pyfric.simulate(back, t, fidelity="quasistatic")


def test_events_name_their_length_of_nucleation(tmp_path):
    """In records of two engines, kept in files; none where the driver holds."""
    scene = rod(V=1e-2)
    how = {"geometry": "linear", "progress": False}
    ladder = pyfric.simulate(scene, 8.2e-3, fidelity="quasistatic", progress=False)
    record = pyfric.simulate(scene, 8.2e-3, fidelity="hybrid", **how)
    for one in (record, ladder):
        found, table = one.events["nucleation_length"], analysis.nucleations(one)
        np.testing.assert_array_equal(found[table["event"]], table["length"])
        assert found.iloc[0] == ladder.events["nucleation_length"].iloc[0] >= scene.slider.l
    record.save(tmp_path / "run.nc")
    assert pyfric.Record.load(tmp_path / "run.nc") == record
    t = float(record.events["t_start"].iloc[0])
    held = scene.replace({"driver.protocol": ((t + 1e-5, 1e-2), (t + 1e-5, 0.0))})
    held = pyfric.simulate(held, t + 2e-4, fidelity="hybrid", **how)
    assert np.isnan(held.events["nucleation_length"]).all()
    sharp = pyfric.simulate(scene.replace(d_c=0.0), 5e-3, fidelity="quasistatic")
    assert "nucleation_length" not in sharp.events


def test_nucleation_is_refused_without_weakening():
    record = pyfric.simulate(links(5, d_c=0.0), 1e-4, fidelity="quasistatic", progress=False)
    with pytest.raises(SceneError, match=r"interface\.d_c"):
        analysis.nucleations(record)


def test_a_driver_at_rest():
    scene = rod(V=0.0)
    record = pyfric.simulate(scene, 0.5, fidelity="quasistatic", progress=False)
    assert record.curve["t"].tolist() == [0.0, 0.5]
    assert len(record.events) == 0


def test_the_ladder_is_mirrored_and_doubles():
    one, other = (
        pyfric.simulate(scene, 0.045, fidelity="quasistatic", progress=False)
        for scene in (rod(), rod(side="right"))
    )
    np.testing.assert_allclose(other.events["F_T_start"], one.events["F_T_start"], rtol=1e-7)
    np.testing.assert_array_equal(other.region[:, ::-1], one.region)
    twice = rod(F_N=800.0, V=4e-3, d_c=1e-5)
    twice = pyfric.simulate(twice, 0.045, fidelity="quasistatic", progress=False)
    np.testing.assert_allclose(twice.events["F_T_start"], 2 * one.events["F_T_start"], rtol=1e-7)
