"""Energies of hybrid runs are those of full dynamics, also over jumps."""

import numpy as np
import pytest
from helpers import refused

import pyfric
from pyfric.engines.jump import Outside
from pyfric.record import analysis
from pyfric.scene import setup1
from pyfric.statics import StaticSolver

PARTS = ["elastic", "kinetic", "friction_heat", "switching_loss", "damped", "radiated"]
TOTALS = ["work_driver", "work_load", "dissipated_bonds", "friction_heat"]
PROTOCOL = {
    "top.protocol": [("2 ms", 400.0), ("25 ms", 500.0)],
    "driver.protocol": [("5 ms", 1e-2), ("25 ms", 2e-2)],
}
"""Load and speed change at constant rates."""
FIG1 = pyfric.preset("fig1", l="5 mm", V="20 mm/s")
SCENES = {
    "linear": (FIG1, 0.012, "linear"),
    "finite": (FIG1, 0.012, "finite"),
    "loads": (pyfric.preset("setup2", l=4e-3, h=4e-3, V=1e-2).replace(PROTOCOL), 0.03, "linear"),
}


@pytest.fixture(scope="module", params=SCENES)
def runs(request):
    scene, t_end, geometry = SCENES[request.param]
    return [
        pyfric.simulate(scene, t_end, fidelity=fidelity, geometry=geometry, energies=True)
        for fidelity in ("dynamic", "hybrid")
    ]


def test_events_and_totals_are_those_of_full_dynamics(runs):
    full, jumps = runs
    assert len(full.events) == len(jumps.events) >= 1
    assert jumps.counts["jumps"] >= 2
    size = full.events["elastic"].abs().max()
    for name in ("work", *PARTS):
        np.testing.assert_allclose(jumps.events[name], full.events[name], rtol=0, atol=2e-5 * size)
    ends = [run.curve[TOTALS].iloc[-1] for run in runs]
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=2e-6 * ends[0]["work_driver"])


def test_the_budget_closes(runs):
    """In events the error is that of steps; in jumps dashpots take the difference."""
    full, jumps = runs
    left = jumps.events["work"] - jumps.events[PARTS].sum(axis=1)
    missed = analysis.budget_left(full.curve).abs().max()
    assert np.abs(left).max() <= 2 * missed
    assert analysis.budget_left(jumps.curve).abs().max() <= 2 * missed


def test_energies_inside_jumps_are_not_known(runs):
    curve, spared = runs[1].curve, runs[1].counts["steps_spared"]
    inside = curve["work_driver"].isna()
    assert 0.5 * len(curve) * spared / (spared + runs[1].counts["steps"]) < inside.sum()
    assert curve["F_T"].notna().all()
    others = curve.columns.difference(["t", "F_T"])
    assert (curve[others].isna().all(axis=1) == inside).all()


def test_a_run_that_goes_on_keeps_its_budget():
    scene, t_end, geometry = SCENES["linear"]
    how = {"fidelity": "hybrid", "geometry": geometry, "energies": True}
    whole, half = (pyfric.simulate(scene, t, **how) for t in (t_end, 0.6 * t_end))
    parts = pyfric.simulate(scene, t_end, initial=half, **how)
    ends = [run.curve[TOTALS].iloc[-1] for run in (parts, whole)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=2e-6 * ends[0]["work_driver"])


@pytest.mark.usefixtures("cheap_attempts")
def test_no_jump_over_slip_with_energies():
    """The heat of stable slip can only follow from steps."""
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3, d_c=5e-6)
    how = {"geometry": "linear", "sample": 1e-3}
    plain = pyfric.simulate(scene, 0.04, fidelity="hybrid", **how)
    kept, full = (
        pyfric.simulate(scene, 0.04, fidelity=fidelity, energies=True, **how)
        for fidelity in ("hybrid", "dynamic")
    )
    assert plain.counts["slides"] > 0 == kept.counts["slides"]
    assert "work_driver" not in plain.curve
    heat = [run.curve["friction_heat"].iloc[-1] for run in (kept, full)]
    assert 0 < heat[0] == pytest.approx(heat[1], rel=1e-5)


def test_rate_and_state_is_refused():
    how = {"fidelity": "hybrid", "energies": True}
    refused(lambda: pyfric.simulate("rate_and_state", 1e-3, **how), "energies", "dynamic")


@pytest.mark.parametrize("kind", ["setup1", "setup2"])
def test_weights_are_no_rate_of_loads(kind):
    scene = pyfric.preset(kind, L=0.02, H=0.0125, l=2.5e-3, h=2.5e-3, g=1e4)
    scene = scene.replace({"top.protocol": [("0 s", scene.F_N), ("1 s", 1.5 * scene.F_N)]})
    outside = Outside(StaticSolver(scene, "linear"), 0.2)
    ends = [outside.solver.under(outside.load_at(s)).load for s in (0.0, 0.5)]
    np.testing.assert_allclose(outside.load_rate, (ends[1] - ends[0]) / 0.5, rtol=1e-9, atol=1e-9)
