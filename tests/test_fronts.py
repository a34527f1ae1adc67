"""The study of fronts: a crack and fracture mechanics, cost plans, stored runs, the figure."""

import cracks
import fronts
import fronts_found
import numpy as np
import pandas as pd
import pytest

from pyfric.record.zones import zone_at_rest
from pyfric.scene import preset


def test_a_crack_follows_fracture_mechanics():
    """With four blocks in X_c0 the front stays below c_R, within 1 %; no zone is resolved."""
    which = cracks.Crack(blocks=4.0, a_end=6e3)
    table, record = cracks.crack(which)
    scene = record.scene
    assert zone_at_rest(scene, scene.p_prescribed) == pytest.approx(4.0)
    late = table[table["a"] < 5.3e3]  # the absorbing wall is at 6 km
    assert len(late) == 5
    assert (table["v"] < which.material.c_R).all()
    assert (np.abs(late["v"] / late["v_theory"] - 1) < 0.01).all()
    assert record.events["share_X_c0"].iloc[0] == 0
    assert any("100 % of blocks have X_c0/l below 6" in note for note in record.notes)


def test_half_the_lattice_constant_is_planned_at_eight_times():
    class Made:
        scene = preset("fig1", l=5e-3)
        counts = {"block_evaluations": 10.0}  # noqa: RUF012

    planned = fronts.planned(preset("fig1"), 0.1, Made)
    assert planned == pytest.approx((80.0, 80.0 * fronts.PACE))
    assert fronts.planned(Made.scene, 0.2, None)[0] > 1e6


@pytest.mark.usefixtures("free_attempts")
@pytest.mark.slow
def test_runs_are_kept_and_shown(tmp_path):
    table, said = cracks.Crack(blocks=2.0), []
    a = np.arange(3e3, 12e3, 1e3)
    frame = pd.DataFrame({"a": a, "v": 0.97 * table.speed(a), "v_theory": table.speed(a)})
    made = pd.DataFrame({"evaluations": 1.0, "seconds": 1.0}, index=frame.index)
    for name in ("2_0.001_along", "4_0.001_along"):
        frame.join(made).to_csv(tmp_path / f"crack_{name}.csv", index=False)
    how = {"blocks": (2.0, 4.0), "spacings": (5e-3,), "t_end": 0.3, "say": said.append}
    first = fronts.study(tmp_path, finer=(2.5e-3,), **how)
    assert "l = 2.5 mm, from event" in said[-1]
    assert "planned" in said[-1]
    begun = f"fig1_2.5_1_from_{said[-1].split('event ')[1].split()[0]}.nc"
    kept = sorted(one.name for one in tmp_path.glob("*.nc*"))
    assert kept == [begun, "fig1_5_0.nc", "fig1_5_1.nc"]
    written = {one: one.stat().st_mtime_ns for one in tmp_path.iterdir()}
    kept = fronts._runs_of("fig1", tmp_path, how["spacings"], how["t_end"], said.append)
    fronts._begun_runs("fig1", tmp_path, kept, (2.5e-3,), 1, said.append)
    assert written == {one: one.stat().st_mtime_ns for one in tmp_path.iterdir()}
    fig = fronts_found.figure(first)
    numbers = fig.tables["summary"].set_index(["what", "case"])["value"]
    mean = numbers[
        "crack: mean of v/v_theory - 1, 3 to 12 km", "2 blocks in X_c0, eta^2 = 0.001 k m, along"
    ]
    assert mean == pytest.approx(-0.03)
    rows = first["fronts"]["begun"] > 0
    assert set(first["fronts"].loc[rows, "l"]) == {2.5e-3}
    assert 0 < first["cost"]["evaluations"].iloc[-1] < first["cost"]["planned_evaluations"].iloc[-1]
    assert numbers.notna().all()
