"""The hybrid engine compared with full dynamics, on small scenes of every kind."""

import dataclasses
import functools
import itertools
import os
import signal
import time
import warnings

import numpy as np
import pytest
from helpers import GEOMETRIES
from tolerances import CURVE, FORCE, FORCE_FINITE, FORCE_STRAINED, REPRODUCED, SPLIT

import pyfric
from pyfric import core
from pyfric.core import OPEN
from pyfric.engines import ACCURACY
from pyfric.engines.ring_down import RingDown
from pyfric.record import Record
from pyfric.scene import chain, preset, setup1, setup2
from pyfric.statics import (
    EquilibriumError,
    loaded_state,
    solve_static,
)
from pyfric.values import SceneError


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-3} | changes)


def free(**changes):
    return setup2(**{"L": 0.012, "H": 0.005, "F_N": 50.0, "V": 2e-3} | changes)


def links(**changes):
    return chain(**{"L": 0.02, "V": 2e-3} | changes)


run = functools.partial(pyfric.simulate, progress=False, threads=1)
STEPS = {"switching": "step_end"}  # equal evaluations in all steps
jump = functools.partial(run, fidelity="hybrid", **STEPS)
step = functools.partial(run, fidelity="dynamic", energies=False, **STEPS)


def both(scene, t_end, geometry, **options):
    """Return the records of both engines, with 100 points of the curve."""
    options |= {"geometry": geometry, "sample": t_end / 100}
    exact = {name: option for name, option in options.items() if name != "accuracy"}
    records = [step(scene, t_end, **exact), jump(scene, t_end, **options)]
    for record in records:
        assert record.status == "complete"
    return records


def check_same_events(a, b, force):
    """Check that events have the same blocks, and forces within `force` times F_N."""
    assert len(a.events) == len(b.events)
    for name in ("first_block", "last_block", "nucleation_block", "L_p_over_L", "n_episodes"):
        np.testing.assert_array_equal(b.events[name], a.events[name], err_msg=name)
    for name in ("F_T_start", "F_T_arrest"):
        limit = force * a.scene.F_N
        np.testing.assert_allclose(b.events[name], a.events[name], rtol=0, atol=limit, err_msg=name)
    np.testing.assert_array_equal(b.region, a.region)


def check_same_curve(a, b, force):
    """Check that curves have the same points, and the same F_T where nothing slips."""
    t = a.curve["t"].to_numpy()
    np.testing.assert_array_equal(b.curve["t"], t)
    assert (np.diff(t) > 0).all()
    still = np.ones(len(t), dtype=bool)
    for start, stop in zip(a.events["t_start"], a.events["t_stop"], strict=True):
        still &= ~((t > start - 1e-5) & ~(t > stop + 2e-4))
    assert still.sum() > 0.2 * len(t)
    error = (b.curve["F_T"] - a.curve["F_T"]).to_numpy()[still] / a.scene.F_N
    np.testing.assert_allclose(error, 0, atol=force)


def check_counts(record):
    counts = record.counts
    assert counts["steps"] + counts["steps_spared"] == record.final_state.step
    blocks = record.scene.N_x * record.scene.N_z
    stages = core.STEPPERS[record.method.stepper].evaluations
    assert counts["block_evaluations"] == stages * blocks * counts["steps"]


# --- against full dynamics -----------------------------------------------------------------------

SCENES = {
    "rod": (rod(), 0.06),
    "rod, high driver": (rod(h=0.0075), 0.06),
    "rod, top driver": (rod(h=0.0125), 0.06),
    "free": (free(), 0.03),
    "free, right": (free(side="right", theta=0.5), 0.03),
    "free, light edge": (free(theta=0.833), 0.0195),
    "free, top driver": (free(h=5e-3), 0.04),
    "rod, plate": (rod(h=2.5e-3).replace(h_top=7.5e-3), 0.06),
    "rod, plate up to the rod": (rod(h=5e-3, side="right").replace(h_top=0.0125), 0.06),
    "free, plate": (free(h=1e-3).replace(h_top=5e-3), 0.0185),
    "no kinetic friction": (free(mu_k=0.0), 0.04),
    "little friction": (rod(mu_s=0.2, mu_k=0.02), 0.03),
}


@functools.cache
def linear(name):
    return both(*SCENES[name], "linear", **STEPS.get(name, {}))


STEPS = {"rod, top driver": {"dt": 1.6e-6}}
"""Steps with which a block reverses its slip."""


ASKING = {"free, light edge", "free, plate"}
"""Scenes in which jumps that pay leave more than half of the steps."""


@pytest.mark.parametrize("name", SCENES)
def test_linear_geometry_is_full_dynamics(name, request):
    if name in ASKING:
        request.getfixturevalue("cheap_attempts")
    a, b = linear(name)
    assert len(a.events) > 1
    check_same_events(a, b, FORCE)
    np.testing.assert_allclose(b.events["t_start"], a.events["t_start"], rtol=0, atol=1e-8)
    check_same_curve(a, b, CURVE)
    check_counts(b)
    assert b.counts["steps"] < 0.5 * a.counts["steps"]
    assert b.counts["jumps"] > 0


@pytest.mark.parametrize(
    ("scene", "t_end"),
    [
        (rod(V=5e-4), 0.15),
        (rod(V=5e-4, h=2.5e-3).replace(h_top=0.01), 0.122),
        (free(V=1e-3), 0.04),
        (free(V=1e-3, theta=0.833, h=3e-3), 0.024),
    ],
    ids=["rod", "rod, plate", "free", "free, light edge"],
)
def test_finite_geometry_is_full_dynamics(scene, t_end):
    a, b = both(scene, t_end, "finite")
    assert len(a.events) > 1
    check_same_events(a, b, FORCE_FINITE)
    check_same_curve(a, b, 10 * CURVE)
    check_counts(b)
    assert b.counts["steps"] < 0.5 * a.counts["steps"]


@pytest.mark.usefixtures("cheap_attempts")
def test_a_stiff_driver_in_finite_geometry_is_full_dynamics():
    """The driver moves by 1e-2 F_N/K in a step; every switch is the same."""
    a, b = both(rod(K=1e9, h=0.0125), 0.02, "finite", accuracy=1e-4)
    assert b.counts["jumps"] > 10
    assert len(a.switches["t"]) > 60
    for name in ("block", "old", "new"):
        np.testing.assert_array_equal(b.switches[name], a.switches[name])
    check_same_events(a, b, FORCE_STRAINED)


def test_large_strains_are_full_dynamics():
    """At a strain of 0.13 jumps are rare, except at an accuracy of 1e-3 F_N."""
    scene = rod(F_N=12e3, V=0.06)
    a, b = both(scene, 0.037, "finite")
    assert len(a.events) >= 5
    check_same_events(a, b, FORCE_FINITE)
    b = jump(scene, 0.037, geometry="finite", accuracy=1e-3, sample=0.05 / 400)
    assert b.counts["jumps"] >= 5
    check_same_events(a, b, 1e-3)


@pytest.mark.usefixtures("cheap_attempts")
def test_a_jump_in_finite_geometry_lands_where_steps_do():
    """The tangent changes while the driver moves; the initial tangent leaves 5e-7 and 2e-7."""
    scene = rod(V=0.05, K=5e5, F_N=1500.0)
    a, b = both(scene, 5e-3, "finite")
    assert b.counts["jumps"] > 0
    a, b = a.final_state.y, b.final_state.y
    unit, m = scene.F_N / scene.slider.k, scene.m / scene.slider.k
    np.testing.assert_allclose(b[:, :2], a[:, :2], rtol=0, atol=1e-7 * unit)
    np.testing.assert_allclose(b[:, 2:], a[:, 2:], rtol=0, atol=1e-8 * unit / np.sqrt(m))


def test_static_forces_of_fast_runs_are_those_of_fresh_solves():
    """20 steps move the driver by 0.03 F_N/K; paths have the accuracy of jumps."""
    scene = rod(V=0.1)
    record = jump(scene, 0.01, geometry="finite", accuracy=1e-2)
    assert record.counts["jumps"] > 0
    event = record.events.iloc[0]
    row, drive = event["quiet_start"], scene.driver.V * event["t_start"]
    free = record.quiet["mode"][row] == OPEN
    fresh = solve_static(scene, record.quiet["u_x"][row], drive, geometry="finite", free=free)
    assert event["F_T_start"] == pytest.approx(fresh.F_T, abs=1e-6 * scene.F_N)


def test_a_chain_is_full_dynamics():
    for scene in (links(V=1e-2), links(V=5e-3, tau=np.linspace(10, 250, 9), k_top=1e6)):
        a, b = both(scene, 0.03, "linear")
        assert len(a.events) > 2
        check_same_events(a, b, FORCE)
        check_same_curve(a, b, CURVE)


@pytest.mark.usefixtures("cheap_attempts")
def test_the_scenes_cover_what_they_are_for():
    """The scenes have slip in both directions, open blocks, and several system-size events."""
    light, stick_slip, high = (
        linear(name)[1] for name in ("free, light edge", "free, top driver", "rod, top driver")
    )
    assert (light.switches["new"] == OPEN).any()
    whole = stick_slip.events["L_p_over_L"] == 1
    assert (whole & stick_slip.events["is_main"]).sum() >= 3
    assert set(high.episodes["direction"]) == {-1, 1}
    assert high.episodes["reversals"].any()


@pytest.mark.usefixtures("cheap_attempts")
def test_modes_that_do_not_fit_into_memory_are_found_again(monkeypatch):
    """With memory for only one set of contact states, events and forces are the same."""
    scene, t_end = SCENES["free, plate"]
    kept = linear("free, plate")[1]
    monkeypatch.setattr("pyfric.core.available", lambda: 0.0)
    again = jump(scene, t_end, geometry="linear", sample=t_end / 100)
    assert again.counts["modal_bases"] > kept.counts["modal_bases"] > 1
    check_same_events(kept, again, 1e-12)


def test_an_event_that_nucleates_during_ring_down_is_caught():
    """After the event of Fig. 1 at 0.5474 s, the next one begins during the ring-down."""
    scene, how = preset("fig1"), {"dt": 7.8e-7}
    first = jump(scene, 0.546, geometry="linear", **how)
    options = {"initial": first.final_state, "geometry": "linear", "t_gap": 1e-5, **how}
    a, b = (engine(scene, 0.549, **options) for engine in (step, jump))
    pause = a.events["t_start"].to_numpy()[1:] - a.events["t_stop"].to_numpy()[:-1]
    assert (pause < 2e-4).any()
    check_same_events(a, b, FORCE)
    assert b.counts["steps_spared"] > 0


# --- threads, variants, parts --------------------------------------------------------------------


def check_equal(a, b, tolerance=REPRODUCED):
    """Check for the same events, forces to `tolerance` F_N, and the same samples of the curve."""
    check_same_events(a, b, tolerance)
    np.testing.assert_allclose(b.events["t_start"], a.events["t_start"], rtol=0, atol=1e-10)
    np.testing.assert_array_equal(b.switches["block"], a.switches["block"])
    np.testing.assert_array_equal(b.switches["step"], a.switches["step"])
    limit = tolerance * a.scene.F_N
    np.testing.assert_allclose(b.curve, a.curve, rtol=0, atol=limit)


@pytest.mark.portable
@pytest.mark.parametrize(
    ("geometry", "scene", "t_end"),
    [("linear", free(), 0.015), ("finite", free(), 0.015), ("finite", rod(), 0.034)],
    ids=["linear", "finite", "finite, rod"],
)
def test_threads_and_variants_make_no_difference(geometry, scene, t_end, monkeypatch):
    """Differences on six OpenBLAS kernels are below 1e-12 F_N."""
    options = {"geometry": geometry, "sample": 1e-3}
    one = jump(scene, t_end, **options)
    assert len(one.events) > 0
    monkeypatch.setattr(core, "useful_threads", lambda blocks, threads: 2)
    two = jump(scene, t_end, **options)
    assert two.method.threads == 2
    check_equal(one, two, 1e-11)
    for variant, runs in core.variants().items():
        if runs:
            with monkeypatch.context() as patch:
                patch.setattr(core, "advance", functools.partial(core.advance, variant=variant))
                check_equal(one, jump(scene, t_end, **options), 1e-11)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_slider_in_the_air_is_stepped_until_it_lands(geometry):
    """All blocks are open: there is no static state, and no warning of NumPy."""
    scene = setup1(L=5e-3, H=2.5e-3, h=2.5e-3)
    state = loaded_state(scene, geometry).state(scene, 1e-7)
    state.y[:, 1] -= state.y[0, 1].min() - 1e-7
    state.rod[1] = state.y[-1, 1].mean()
    state.y[-1, 1] = state.rod[1] + state.rod[2] * scene.x
    state.mode[:] = OPEN
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        record = jump(scene, 2e-5, initial=state, geometry=geometry, dt=state.dt)
    assert (record.switches["old"] == OPEN).any()
    assert record.counts["steps"] > record.switches["step"][-1]


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize(("scene", "t_end"), [(rod(), 0.034), (free(), 0.014)], ids=["rod", "free"])
def test_a_run_in_parts_is_the_whole_run(scene, t_end, geometry, tmp_path):
    """The run is cut in a long pause, in an event, and in the ring-down; also through a file."""
    options = {"geometry": geometry, "sample": 2e-4}
    whole = jump(scene, t_end, **options)
    start, stop = (whole.events[name].iloc[0] for name in ("t_start", "t_stop"))
    part = None
    for cut in (0.3 * start, (start + stop) / 2, stop + 2e-4, t_end):
        part = jump(scene, cut, initial=part, **({} if part else options))
        assert part.curve["t"].iloc[-1] == pytest.approx(cut, abs=2 * part.method.dt)
        check_counts(part)
        if cut < start and geometry == "finite":
            part = Record.load(part.save(tmp_path / "part.nc"))
    check_same_events(whole, part, FORCE_FINITE if geometry == "finite" else 1e-7)
    np.testing.assert_array_equal(part.curve["t"], whole.curve["t"])
    still_cut = jump(scene, 0.9 * start, initial=jump(scene, 0.2 * start, **options))
    whole_cut = jump(scene, 0.9 * start, **options)
    check_equal(whole_cut, still_cut, 1e-7 if geometry == "finite" else SPLIT)


def test_a_run_may_end_in_ring_down():
    """After the last jump forces are as accurate as in events; continued runs agree."""
    scene, t_end = preset("fig1", l=5e-3, V=5e-3), 0.06
    whole = jump(scene, t_end, geometry="finite")
    cut = float(whole.events["t_stop"][whole.events["is_main"]].iloc[0]) + 8e-4
    part, full = (engine(scene, cut, geometry="finite") for engine in (jump, step))
    assert part.counts["steps"] < 0.5 * whole.counts["steps"]
    model = core.model(scene, "finite", part.final_state.u_drv0)
    a, b = (core.evaluate(model, one.final_state, cut).f for one in (part, full))
    assert np.abs(a - b).max() < 0.1 * ACCURACY * scene.F_N
    check_same_events(whole, jump(scene, t_end, initial=part), FORCE)


def test_ctrl_c_leaves_a_record_that_goes_on(monkeypatch):
    scene = rod()
    options = {"geometry": "linear", "sample": 1e-4}
    whole = jump(scene, 0.04, **options)
    jumps, original = [], RingDown.span

    def press(self, state, last):
        jumps.append(state.step)
        if len(jumps) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return original(self, state, last)

    with monkeypatch.context() as patch:
        patch.setattr(RingDown, "span", press)
        cut = jump(scene, 0.04, **options)
    assert cut.status == "interrupted"
    assert 0 < cut.final_state.t < 0.04
    rest = jump(scene, 0.04, initial=cut)
    assert rest.status == "complete"
    check_equal(whole, rest)
    check_counts(rest)
    assert rest.counts["jumps"] >= whole.counts["jumps"]


def test_checkpoints_can_be_continued(tmp_path):
    scene, path = rod(), tmp_path / "c.nc"
    often = {"checkpoint": path, "checkpoint_every": 1e-2}
    whole = jump(scene, 0.04, geometry="linear", sample=1e-4, **often)
    saved = Record.load(path)
    assert saved.status == "interrupted"
    assert saved.method.engine == "hybrid"
    check_equal(whole, jump(scene, 0.04, initial=saved), SPLIT)


def test_a_state_after_a_jump_starts_runs():
    """Such a state starts runs of either engine."""
    scene = rod()
    first = jump(scene, 0.01, geometry="linear")
    assert first.counts["jumps"] > 0
    a, b = (
        engine(scene, 0.04, initial=first.final_state, geometry="linear") for engine in (step, jump)
    )
    check_same_events(a, b, FORCE)


def test_the_end_may_lie_anywhere():
    """The end may be in a jump, on a sample, or at the start; no point comes twice."""
    scene = rod()
    dt = pyfric.step_size(scene, switching="step_end")
    for steps, every in ((10_000, 1000), (10_001, 1000), (64, 1), (1, 1), (0, 1)):
        record = jump(scene, steps * dt, geometry="linear", sample=every * dt)
        t = record.curve["t"].to_numpy()
        assert record.final_state.step == steps
        assert t[-1] == record.final_state.t
        assert (np.diff(t) > 0).all()
        assert len(t) == 1 + -(-steps // every)
        check_counts(record)


def test_without_driving_nothing_happens():
    for geometry in GEOMETRIES:
        record = jump(free(V=0.0), 1.0, geometry=geometry)
        assert record.counts["steps"] == 0
        assert record.events.empty
        np.testing.assert_allclose(record.curve["F_T"], 0, atol=1e-9)


# --- symmetries ----------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("make", [rod, free])
def test_a_mirrored_scene_gives_the_mirror_image(make, geometry):
    scenes = (make(side=side, V=1e-3) for side in ("left", "right"))
    left, right = (jump(scene, 0.07, geometry=geometry) for scene in scenes)
    assert len(left.events) > 0
    for name in ("first_block", "last_block", "nucleation_block", "n_episodes", "n_blocks"):
        np.testing.assert_array_equal(right.events[name], left.events[name])
    F_N = left.scene.F_N
    limit = 1e-9 * F_N
    for name in ("F_T_start", "F_T_arrest"):
        np.testing.assert_allclose(right.events[name], left.events[name], rtol=0, atol=limit)
    np.testing.assert_array_equal(right.region, left.region[:, ::-1])
    # Slow shapes come from vectors without symmetry, and the curve lacks all other shapes.
    np.testing.assert_allclose(right.curve["F_T"], left.curve["F_T"], rtol=0, atol=CURVE * F_N)
    np.testing.assert_allclose(right.tau_after, left.tau_after[:, ::-1], rtol=0, atol=limit)


def test_mirror_images_of_a_pull_differ_by_rounding():
    """Pulling amplifies rounding, to below 1e-6 F_N up to the first system-size event."""
    both, size = [], {"L": 0.1, "H": 0.05, "F_N": 2500.0}
    for side in ("pull left", "pull right"):
        scene = pyfric.preset("fig1", l="5 mm", side=side, **size)
        how = {"stop_when": "system_size", "verify": "none"}
        record = pyfric.simulate(scene, 1.0, fidelity="hybrid", **how)
        both.append(record.events)
    left, right = both
    names = ["n_blocks", "first_block", "last_block"]
    np.testing.assert_array_equal(left[names], right[names])
    np.testing.assert_allclose(left["F_T_start"], right["F_T_start"], atol=1e-6 * 2500.0)
    assert (left["is_main"] & left["is_precursor"]).sum() == 9
    assert left["F_T_start"].iloc[0] < 0.07 * 2500.0  # pushed: 0.149


def test_doubling_load_and_speed_doubles_a_whole_run():
    one, two = (jump(rod(F_N=400.0 * n, V=2e-3 * n), 0.06, geometry="linear") for n in (1, 2))
    assert one.events["finished"].sum() > 2
    for name in ("t_start", "t_stop", "L_p_over_L", "first_block", "last_block", "n_episodes"):
        np.testing.assert_allclose(two.events[name], one.events[name], rtol=1e-9, err_msg=name)
    for name in ("F_T_start", "F_T_arrest"):
        np.testing.assert_allclose(two.events[name], 2 * one.events[name], rtol=1e-9)
    np.testing.assert_allclose(two.curve["F_T"], 2 * one.curve["F_T"], rtol=0, atol=1e-9 * 800)
    assert two.counts["jumps"] == one.counts["jumps"]


# --- hard scenes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "t_end", "eta"),
    [(rod, 0.04, 0.0), (rod, 0.04, 1e-2), (free, 0.015, 1e-6), (free, 0.015, 1e-3)],
)
def test_without_viscosity_the_run_is_stepped(make, t_end, eta):
    """Without viscosity jumps are rare, and events are those of full dynamics."""
    scene = make(eta=eta)
    a, b = both(scene, t_end, "linear")
    check_same_events(a, b, 10 * FORCE)  # dropped motion does not decay


ODD = {
    "smallest": (free(L=2e-3, H=1e-3, h=1e-3, F_N=20.0), 0.02),
    "smallest under a rod": (rod(L=5e-3, H=2.5e-3, h=2.5e-3, F_N=200.0), 0.02),
    "no friction": (rod(mu_s=0.0, mu_k=0.0), 0.003),
    "mu_s = mu_k": (rod(mu_s=0.45, mu_k=0.45), 0.03),
    "strong friction": (rod(mu_s=2.0, mu_k=0.9), 0.05),
    "huge speed": (free(V=5.0), 0.001),
    "theta = 1": (free(theta=1.0), 0.02),
    "theta = -1": (free(theta=-1.0), 0.03),
    "hard foundation": (free(k_f=9.4e8), 0.01),
    "soft foundation": (free(k_f=9.4e4), 0.02),
    "much viscosity": (rod(eta=1e3), 1e-4),
    "stiff driver": (rod(K=4e9), 0.01),
    "soft driver": (rod(K=4e3, V=0.5), 0.1),
    "heavy rod": (rod(mass=100.0), 0.03),
    "light rod": (rod(mass=1e-6, mattress=0.0), 0.03),
    "tiny load": (rod(F_N=4e-6, V=2e-11), 0.03),
    "huge load": (rod(F_N=4e6, V=20.0), 0.03),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_scenes_are_full_dynamics_too(name):
    scene, t_end = ODD[name]
    a, b = both(scene, t_end, "linear")
    check_same_events(a, b, FORCE)
    assert np.isfinite(b.curve["F_T"]).all()
    done = b.events["finished"].to_numpy()
    assert np.isfinite(b.events[["F_T_start", "F_T_arrest"]].to_numpy()[done]).all()
    check_counts(b)


@pytest.mark.parametrize("name", ODD)
def test_odd_scenes_run_in_finite_geometry(name):
    """The runs end with finite numbers, or with a documented error."""
    scene, t_end = ODD[name]
    try:
        record = jump(scene, t_end / 3, geometry="finite")
    except (EquilibriumError, SceneError, pyfric.RunError):
        return
    assert np.isfinite(record.curve["F_T"]).all()
    check_counts(record)


# --- the record ----------------------------------------------------------------------------------


def test_the_record_says_how_it_was_made():
    record = jump(rod(), 0.04, geometry="linear")
    assert record.method.engine == "hybrid"
    assert not record.method.budget
    assert list(record.curve) == ["t", "F_T"]
    assert ["density" in note for note in record.notes] == [False, True]
    assert "set by the lattice" in record.notes[0]
    a = dataclasses.replace(record, timings={})
    b = dataclasses.replace(jump(rod(), 0.04, geometry="linear"), timings={})
    assert a == b


def test_a_slider_that_never_rests_is_noted():
    record = jump(free(V=5.0), 0.004, geometry="linear")
    assert "slipped, its ring-down was too large for jumps with an accuracy" in record.notes[0]


def test_fig1_takes_few_steps():
    """The Fig. 1 scene takes less than half a percent of the steps."""
    record = jump(preset("fig1"), 0.9, geometry="linear")
    assert record.counts["steps_spared"] > 200 * record.counts["steps"]
    assert record.events["is_main"].sum() == 13
    check_counts(record)


def test_a_slow_clock_changes_nothing(monkeypatch):
    """The ends of calls of the core, and so of jumps, do not depend on the clock."""
    quick = pyfric.simulate(rod(V=5e-3), 0.0135, fidelity="hybrid", progress=False)
    assert min(len(quick.events), quick.counts["jumps"]) > 0
    clock = itertools.count(0.0, 10.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    slow = pyfric.simulate(rod(V=5e-3), 0.0135, fidelity="hybrid", progress=False)
    assert slow.counts == quick.counts
    assert slow.curve.equals(quick.curve)
    assert slow.events.equals(quick.events)
