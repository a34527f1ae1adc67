"""One function for all engines: plans, fallbacks, and continued runs."""

import dataclasses
import functools

import numpy as np
import pandas as pd
import pytest
import threadpoolctl
from helpers import bits, same_run
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import SPLIT

import pyfric
from pyfric.core import State, StateError
from pyfric.engines import ENGINES, Run, RunError, quasistatic, step_size
from pyfric.planning import plan, simulation
from pyfric.record import Record, budget_error
from pyfric.scene import chain, setup1, setup2
from pyfric.statics import EquilibriumError, loaded_state
from pyfric.sweeps import Sweep
from pyfric.values import SceneError

simulate = functools.partial(pyfric.simulate, progress=False, verify="none")
"""Runs without measured errors, which would take a second run; see test_measured_errors."""


def small(**changes):
    """Return a scene whose first event of more than one block comes after 61 ms."""
    return setup1(**{"L": 0.03, "H": 0.015, "V": 7.875e-3} | changes)


def slow(**changes):
    """Return a scene with expensive full dynamics, up to its first main events."""
    return setup1(**{"L": 0.03, "H": 0.015} | changes)


def follows(monkeypatch, name, follow):
    """Replace the function of an engine that runs scenes."""
    monkeypatch.setitem(ENGINES, name, dataclasses.replace(ENGINES[name], follow=follow))


def same_events(one, other, *, force, rows=None):
    """Check that events agree: same blocks, start forces within `force` times F_N."""
    a, b = one.events[:rows], other.events[:rows]
    for name in ("n_blocks", "first_block", "last_block", "nucleation_block", "L_p_over_L"):
        np.testing.assert_array_equal(a[name], b[name])
    np.testing.assert_allclose(a["F_T_start"], b["F_T_start"], rtol=0, atol=force * one.scene.F_N)
    return len(a)


# --- levels --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "t_end", "tolerance"),
    [(slow(), 0.7, 0.1), (slow(), 0.7, 0.01), (small(), 1e-3, 0.01)],
)
def test_without_verification_the_plan_says_which_level_is_made(scene, t_end, tolerance):
    found = pyfric.plan(scene, "stress", tolerance, t_end=t_end).alone
    record = simulate(scene, t_end, want="stress", tolerance=tolerance)
    method = record.method
    assert (method.engine, method.geometry) == (found.engine, found.geometry)
    assert (method.dt, method.accuracy) == (found.dt, found.accuracy)
    assert any(one.startswith(f"for stress within {tolerance:g}: {found}") for one in record.notes)
    assert record.errors is None
    assert not method.budget


@pytest.mark.parametrize("fidelity", ["quasistatic", "hybrid", "dynamic"])
def test_a_named_engine_has_no_plan(fidelity, monkeypatch):
    monkeypatch.setattr(simulation, "levels", None)
    record = simulate(small(), 1e-3, fidelity=fidelity)
    assert record.method.engine == fidelity
    assert record.method.geometry == ("linear" if fidelity == "quasistatic" else "finite")
    assert record.method.budget == (fidelity == "dynamic")
    assert all("density" in note for note in record.notes)
    assert "errors not measured (a planned run" in record.summary()


@pytest.mark.parametrize(
    ("options", "engine"),
    [
        ({}, "dynamic"),
        ({"geometry": "linear"}, "dynamic"),
        ({"threads": 1, "sample": 1e-4}, "dynamic"),
        ({"energies": True}, "dynamic"),
        ({"dt": 1e-6}, "hybrid"),
        ({"initial": State}, "dynamic"),
    ],
    ids=str,
)
def test_options_of_a_plan_are_kept(options, engine):
    scene = small()
    if options.get("initial") is State:
        options = {"initial": simulate(scene, 1e-4, fidelity="dynamic").final_state}
    method = simulate(scene, 5e-4, tolerance=0.01, **options).method
    assert method.engine == engine
    assert method.geometry == options.get("geometry", "finite")
    assert method.budget == bool(options.get("energies"))
    assert method.dt == options.get("dt", method.dt)


def test_a_time_step_may_have_a_unit():
    scene = small()
    assert step_size(scene, "0.2 us") == 0.2e-6
    method = simulate(scene, 1e-4, fidelity="dynamic", dt="0.2 us", progress=False).method
    assert method.dt == 0.2e-6


def test_a_state_to_go_on_from_rules_out_the_ladder():
    state = simulate(slow(), 1e-3, fidelity="dynamic", geometry="linear").final_state
    record = simulate(slow(), 0.7, tolerance=0.1, initial=state, geometry="linear")
    assert record.method.engine == "hybrid"


def test_step_and_switching_of_a_level():
    record = simulate(small(), 1e-4, want="front_speed", tolerance=1e-3)
    planned = pyfric.plan(small(), "front_speed", 1e-3, t_end=1e-4).alone
    assert record.method.dt == planned.dt < step_size(small())
    assert record.method.switching == planned.switching == "located"
    record = simulate(small(), 1e-4, want="front_speed", switching="step_end")
    assert record.method.switching == "step_end"


# --- the paper's method --------------------------------------------------------------------------


def test_switches_are_located_unless_the_paper_s_method_is_asked_for():
    for fidelity in ("hybrid", "dynamic"):
        how = {"fidelity": fidelity, "geometry": "linear"}
        assert simulate(small(), 1e-5, **how).method.switching == "located"
        method = simulate(small(), 1e-5, **how, method="paper").method
        assert (method.engine, method.geometry) == (fidelity, "linear")
        assert (method.stepper, method.switching, method.dt) == ("rk4", "step_end", 0.2e-6)
        assert "transitions at step ends" in str(method)


@pytest.mark.parametrize(
    ("scene", "dt"),
    [(setup1(L=0.02, H=0.0125, V=0.5), 0.2e-6), (setup2(L=0.012, H=0.005, V=0.5), 0.09e-6)],
    ids=["rod", "free"],
)
def test_the_paper_s_method_by_one_word(scene, dt):
    asked = simulate(scene, 1.2e-3, method="paper")
    how = {"fidelity": "dynamic", "geometry": "finite", "stepper": "rk4", "switching": "step_end"}
    made = simulate(scene, 1.2e-3, **how, dt=dt)
    assert len(made.switches["t"])
    assert same_run(asked, made)
    assert str(asked.method) == (
        f"dynamic engine, finite geometry, rk4, dt = {dt * 1e6:g} us, "
        "stick-slip transitions at step ends, as in the paper"
    )
    on = simulate(scene, 1.3e-3, method="paper", initial=asked).method
    assert (on.dt, on.switching) == (dt, "step_end")


@pytest.mark.parametrize(
    ("scene", "options", "field"),
    [
        (small(), {"switching": "located"}, "switching"),
        (small(), {"stepper": "verlet"}, "stepper"),
        (small(), {"dt": 0.2e-6}, "dt"),
        (small(), {"fidelity": "quasistatic"}, "method"),
        (small(), {"method": "papers"}, "method"),
        (small(M=2e-5), {}, "dt"),
        (chain(), {}, "method"),
    ],
    ids=str,
)
def test_the_paper_s_method_is_refused_where_it_is_another(scene, options, field):
    with pytest.raises(SceneError) as refusal:
        simulate(scene, 1e-4, **{"method": "paper"} | options)
    assert refusal.value.field == field


# --- fallbacks -----------------------------------------------------------------------------------


def test_a_ladder_that_does_not_settle(monkeypatch):
    """The quasi-static sequence is left out, with or without a verification."""

    def fails(*arguments, **options):
        raise EquilibriumError("the event at t = 1 s does not settle", np.nan, 0.0, 1)

    ladder = dataclasses.replace(ENGINES["quasistatic"], follow=fails)
    monkeypatch.setitem(ENGINES, "quasistatic", ladder)
    for verify in ("none", "sample"):
        record = simulate(slow(), 0.7, tolerance=0.1, verify=verify)
        assert record.method.engine == "hybrid"
        assert any("left out: quasistatic" in one and "settle" in one for one in record.notes)
    with pytest.raises(EquilibriumError):
        simulate(small(), 0.07, fidelity="quasistatic")


@pytest.mark.parametrize("make", [small, lambda **k: setup2(L=0.02, H=0.005, **k), chain])
def test_creep(make):
    """With mu_s = mu_k slip grows continuously; dynamics has the same force."""
    scene = make(mu_s=0.1, mu_k=0.1, V=0.02)
    creep = simulate(scene, 0.015, fidelity="quasistatic")
    dynamic = simulate(scene, 0.015, fidelity="dynamic", geometry="linear", energies=False)
    F_T = np.interp(dynamic.curve["t"], creep.curve["t"], creep.curve["F_T"])
    assert np.abs(F_T - dynamic.curve["F_T"]).max() < 0.01 * scene.F_N


def test_a_ladder_that_does_not_get_on(monkeypatch):
    """Endless changes of contact state at one position of the driver are given up."""
    monkeypatch.setattr(quasistatic, "IDLE", -1)
    with pytest.raises(EquilibriumError, match="without end"):
        simulate(small(), 0.07, fidelity="quasistatic")
    record = simulate(slow(), 0.71, tolerance=0.1, verify="sample")
    assert record.errors.holds
    assert any("without end" in note for note in record.notes)


def test_a_ladder_that_takes_longer_than_dynamics_ends(monkeypatch):
    monkeypatch.setattr(simulation, "STATIC_SHARE", 0.0)
    record = simulate(slow(), 0.7, tolerance=0.1, verify="sample")
    assert str(record.errors.by[0]).startswith("hybrid, finite geometry")
    assert any("left out: quasistatic" in note and "too long" in note for note in record.notes)


def test_a_slider_that_never_rests():
    """Without viscosity plan and hybrid engine use full dynamics."""
    scene, t_end = small(eta=0.0, V=0.02), 0.05
    hybrid, dynamic = (
        simulate(scene, t_end, fidelity=name, geometry="linear", switching="step_end", t_gap=2e-4)
        for name in ("hybrid", "dynamic")
    )
    assert "of the time was integrated like in full dynamics" in hybrid.notes[0]
    assert same_events(hybrid, dynamic, force=1e-3) >= 3


def test_a_failed_run_says_what_was_left_out(monkeypatch):
    def fails(*arguments, **options):
        record = real(*arguments, **options)
        raise RunError("the motion is not finite", record)

    real = ENGINES["dynamic"].follow
    follows(monkeypatch, "dynamic", fails)
    with pytest.raises(RunError) as failure:
        simulate(small(), 1e-4)
    assert failure.value.record.notes[0].startswith("left out: dynamic, finite geometry")


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize("fidelity", ["auto", "quasistatic", "hybrid", "dynamic"])
@pytest.mark.parametrize(
    ("name", "given_value", "allowed"),
    [
        ("want", "speed", "'front_speed'"),
        ("want", None, "'precursors'"),
        ("tolerance", 0.0, "> 0"),
        ("tolerance", 1.5, "<= 1"),
        ("tolerance", "1 m", "a pure number"),
        ("geometry", "round", "'linear' or 'finite'"),
        ("stepper", "euler", "'rk4'"),
        ("energies", "yes", "True, False or None"),
        ("budget", True, "energies = True keeps the energy budget"),
        ("budget", False, "energies = True keeps the energy budget"),
        ("sample", 0.0, "> 0 s"),
        ("threads", 0, "1 to 4096"),
        ("checkpoint_every", -1.0, "> 0 s"),
        ("t_gap", -1.0, ">= 0 s"),
        ("t_end", -1.0, ">= 0 s"),
    ],
)
def test_refused_options(fidelity, name, given_value, allowed):
    options = {"t_end": 1e-4, "tolerance": 0.5} | {name: given_value}
    with pytest.raises(SceneError) as refusal:
        simulate(small(), fidelity=fidelity, **options)
    assert refusal.value.field == name
    assert allowed in str(refusal.value)


@pytest.mark.parametrize("fidelity", ["fast", "", None, 3, ["hybrid"], "prediction"])
def test_refused_fidelity(fidelity):
    with pytest.raises(SceneError, match="'auto' or 'equilibrium' or 'quasistatic' or"):
        simulate(small(), 1e-3, fidelity=fidelity)


@pytest.mark.parametrize(
    ("fidelity", "name", "given_value", "text"),
    [
        ("quasistatic", "energies", True, "quasistatic"),
        ("quasistatic", "dt", 1e-6, "makes no time steps; allowed: 'auto', or"),
        ("quasistatic", "geometry", "finite", "no geometry 'finite'; allowed: 'linear', or"),
    ],
)
def test_options_an_engine_lacks(fidelity, name, given_value, text):
    with pytest.raises(SceneError, match=text) as refusal:
        simulate(small(), 1e-3, fidelity=fidelity, **{name: given_value})
    assert refusal.value.field == name


@settings(max_examples=50)
@given(
    st.sampled_from(["fidelity", "want", "tolerance", "t_end", "energies", "initial"]),
    st.floats(max_value=-1e-6) | st.text(max_size=3) | st.lists(st.none()) | st.just(np.nan),
)
def test_broken_arguments(name, given_value):
    arguments = {"t_end": 1e-4} | {name: given_value}
    with pytest.raises((SceneError, StateError)) as refusal:
        simulate(small(), **arguments)
    assert name in str(refusal.value)


# --- going on ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def halves():
    """Return runs of each engine to 65 ms."""
    how = {"quasistatic": {}, "hybrid": {"sample": 1e-4}, "dynamic": {"sample": 1e-4}}
    return {name: simulate(small(), 0.065, fidelity=name, **more) for name, more in how.items()}


@pytest.mark.parametrize("fidelity", ["quasistatic", "hybrid", "dynamic"])
def test_a_record_goes_on_with_its_engine(fidelity, halves):
    half = halves[fidelity]
    record = simulate(small(), 0.07, initial=half)
    assert record.method == half.method
    assert record.curve["t"].iloc[-1] == pytest.approx(0.07, abs=2e-6)
    assert len(record.events) > len(half.events) >= 2
    for other in {"quasistatic", "hybrid", "dynamic"} - {fidelity}:
        with pytest.raises(StateError, match=f"is from the {fidelity} engine, not from {other}"):
            simulate(small(), 0.07, initial=half, fidelity=other)
    with pytest.raises(StateError, match="another scene"):
        simulate(small(mu_k=0.4), 0.07, initial=half)


@pytest.mark.parametrize(
    "option",
    [
        {"want": "stress"},
        {"tolerance": 0.01},
        {"verify": "full"},
        {"geometry": "linear"},
        {"stepper": "verlet"},
        {"dt": "0.2 us"},
        {"sample": 1e-3},
        {"t_gap": 1.0},
        {"options": pyfric.Options(tolerance=0.1)},
        {"options": pyfric.Options(switching="step_end")},
    ],
    ids=str,
)
def test_a_record_goes_on_with_no_option_that_has_no_effect(option, halves):
    half = halves["dynamic"]
    with pytest.raises(SceneError, match=r"cannot change|has no effect.*goes on keeps"):
        simulate(small(), 0.07, initial=half, **option)
    kept = {"geometry": "finite", "sample": "0.1 ms", "dt": half.method.dt, "fidelity": "auto"}
    assert simulate(small(), 0.0651, initial=half, **kept, threads=1).method == half.method


@pytest.mark.parametrize("option", [{"want": "stress"}, {"tolerance": 0.1}])
def test_a_named_engine_has_no_tolerance(option):
    for how in ({"fidelity": "hybrid"}, {"method": "paper"}, {"fidelity": "quasistatic"}):
        with pytest.raises(SceneError, match=r"has no effect; allowed: none with fid") as refusal:
            simulate(small(), 1e-4, **how, **option)
        assert refusal.value.field == next(iter(option))
    over = {"t_end": [1e-4, 2e-4]}
    jobs = Sweep(scene=small(), t_end=1.0, over=over, options={"fidelity": "hybrid"} | option).jobs
    assert all(isinstance(job, SceneError) for job in jobs)
    how = {"fidelity": "dynamic", "verify": "sample"} | option
    errors = pyfric.simulate(small(), 1e-3, **how, progress=False).errors
    assert option.items() <= {"want": errors.want, "tolerance": errors.tolerance}.items()


@pytest.mark.parametrize("option", [{}, {"stop_when": "main_events = 1"}, {"want": "front_speed"}])
def test_a_run_that_is_too_long_is_refused_before_any_work(option, monkeypatch):
    state = loaded_state(small()).state(small(), 1e-6)
    for name in ENGINES:
        follows(monkeypatch, name, None)
    for call in (functools.partial(simulate, verify="sample"), plan):
        with pytest.raises(SceneError, match=r"^t_end = 1000000000.0 s: .*at most .*1e\+14 steps"):
            call(small(), t_end=1e9, **option)
    with pytest.raises(SceneError, match=r"^t_end = 1000000000.0 s"):
        simulate(small(), 1e9, initial=state, tolerance=0.1)


def test_there_is_no_error_to_measure_up_to_the_first_slip():
    with pytest.raises(SceneError, match=r"verify = 'sample'.*no event.*allowed: 'none', or"):
        simulate(small(), 1e-4, fidelity="equilibrium", verify="sample")


def test_a_static_sequence_is_not_sampled():
    with pytest.raises(SceneError, match=r"sample = 1e-05 s: .*no time steps; allowed: None, or"):
        simulate(small(), 1e-4, fidelity="quasistatic", sample=1e-5)


def test_a_prediction_does_not_go_on():
    record = pyfric.prediction_curve(small())
    with pytest.raises(StateError, match="prediction"):
        simulate(small(), 1.0, initial=record)


def test_notes_go_on():
    half = simulate(small(), 0.065, tolerance=0.01)
    assert sorted(simulate(small(), 0.07, initial=half).notes) == sorted(half.notes)
    assert len(half.notes) == 3
    half = simulate(small(), 0.065, fidelity="quasistatic")
    rested = dataclasses.replace(half, notes=("quasistatic: of the first half", "kept"))
    notes = simulate(small(), 0.07, initial=rested).notes
    assert notes[0] == "kept"
    assert all(note.startswith("quasistatic: d_c = 0") for note in notes[1:])


@functools.cache
def hybrid(t_end, geometry):
    how = {"geometry": geometry, "sample": 1e-4, "accuracy": 1e-6}
    return simulate(small(), t_end, fidelity="hybrid", **how)


def in_two(t_half, geometry, folder):
    """Return a run and the same run in two halves."""
    whole = hybrid(0.07, geometry)
    half = hybrid(t_half, geometry).save(folder / "half.nc")
    split = simulate(small(), 0.07, initial=Record.load(half))
    exact = whole.events.select_dtypes(exclude="float").drop(columns=["quiet_start", "quiet_stop"])
    pd.testing.assert_frame_equal(split.events[exact.columns], exact)
    np.testing.assert_array_equal(split.curve["t"], whole.curve["t"])
    a, b = split.final_state, whole.final_state
    assert (a.step, a.t) == (b.step, b.t)
    np.testing.assert_array_equal(a.mode, b.mode)
    assert split.counts["steps"] + split.counts["steps_spared"] == whole.final_state.step
    assert len(whole.events) >= 4
    return whole, split


@pytest.mark.parametrize("t_half", [0.0605, 0.0614, 0.0652])
def test_a_hybrid_run_in_two_halves(t_half, tmp_path):
    """Split in a pause, in ring-down or in slip, a run differs far less than the accuracy."""
    whole, split = in_two(t_half, "linear", tmp_path)
    t_end = whole.curve["t"].iloc[-1]
    pd.testing.assert_frame_equal(split.events, whole.events, rtol=SPLIT, atol=SPLIT * t_end)
    F_T = whole.curve["F_T"]
    np.testing.assert_allclose(split.curve["F_T"], F_T, rtol=0, atol=SPLIT * F_T.max())
    a, b = split.final_state.y, whole.final_state.y
    assert np.abs(a[:, :2] - b[:, :2]).max() <= SPLIT * np.abs(b[:, :2]).max()


@pytest.mark.parametrize("t_half", [0.0605, 0.0614, 0.0652])
def test_a_hybrid_run_in_two_halves_in_finite_geometry(t_half, tmp_path):
    """Jumps follow tangents in finite geometry: events agree to a share of their error."""
    whole, split = in_two(t_half, "finite", tmp_path)
    same_events(split, whole, force=1e-6)
    dt = whole.method.dt
    np.testing.assert_allclose(split.events["t_start"], whole.events["t_start"], atol=2 * dt)


# --- chains --------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [{}, {"side": "right"}, {"eta": 0.0}, {"k_top": 1e6}], ids=str)
def test_chains(changes):
    scene, t_end = chain(L=0.03, V=7.875e-3, **changes), 0.035
    runs = {
        name: simulate(scene, t_end, fidelity=name, energies=False)
        for name in ("quasistatic", "hybrid", "dynamic")
    }
    assert same_events(runs["hybrid"], runs["dynamic"], force=1e-4) >= 5
    assert runs["hybrid"].counts["steps"] < 0.3 * runs["dynamic"].counts["steps"]
    times = runs["dynamic"].curve["t"]
    F_T = np.interp(times, *runs["quasistatic"].curve[["t", "F_T"]].to_numpy().T)
    np.testing.assert_allclose(F_T, runs["dynamic"].curve["F_T"], atol=0.03 * scene.F_N)


# --- odd scenes ----------------------------------------------------------------------------------

ODD = {
    "3 x 2 blocks": setup1(L=0.005, H=0.0025, h=2.5e-3, V=0.1),
    "3 x 2 blocks, free": setup2(L=0.002, H=0.001, h=1e-3, V=0.1),
    "3 blocks": chain(L=0.005, V=0.1),
    "driven from the right": small(side="right", V=0.2),
    "driven at the top": small(h=0.015, V=0.2),
    "driven at the top, free": setup2(L=0.012, H=0.004, h=0.004, V=0.1),
    "at rest": small(V=0.0),
    "fast": small(V=10.0),
    "creep": small(mu_s=0.45, V=0.2),
    "slippery": small(mu_k=0.0, V=0.2),
    "no friction": small(mu_s=0.0, mu_k=0.0),
    "sticky": small(mu_s=2.0, mu_k=1.0, V=0.2),
    "unloaded corner": setup2(L=0.012, H=0.004, theta=1.0, V=0.1),
    "unloaded edge": setup2(L=0.012, H=0.004, theta=-1.0, V=0.1),
    "soft driver": small(K=1.0, V=0.2),
    "stiff driver": small(K=1e9, V=0.02),
    "no viscosity": small(eta=0.0, V=0.2),
    "soft foundation": small(k_f=1e4),
    "no mattress": small(mattress=0.0, V=0.2),
    "hardly loaded": chain(L=0.03, p=1e-6),
}


@pytest.mark.parametrize("scene", ODD.values(), ids=ODD)
def test_odd_scenes(scene):
    for t_end, tolerance, verify in (
        (0.0, 0.5, "none"),
        (1.5e-3, 0.01, "sample"),
    ):
        record = simulate(scene, t_end, tolerance=tolerance, verify=verify)
        assert record.status == "complete"
        assert np.isfinite(record.curve.to_numpy()).all()
        assert record.curve["t"].iloc[-1] >= t_end


# --- options that do not go together -------------------------------------------------------------


@pytest.mark.parametrize("stepper", ["verlet", "symplectic_euler"])
def test_without_viscosity_steps_that_conserve_energy_have_to_be_equal(stepper):
    """Steps that end at a switch have other lengths, with which the energy would grow."""
    how = {"fidelity": "dynamic", "geometry": "linear", "stepper": stepper}
    with pytest.raises(SceneError, match="or eta > 0") as refusal:
        simulate(small(eta=0.0), 1e-4, **how)
    assert refusal.value.field == "switching"
    assert simulate(small(eta=0.0), 1e-4, switching="step_end", **how).status == "complete"
    assert simulate(small(), 1e-4, **how).status == "complete"


def test_long_adaptive_steps_have_no_room_for_located_switches():
    scene = small()
    dt = 31 * pyfric.stability_limit(scene)[0]
    how = {"fidelity": "dynamic", "geometry": "linear", "stepper": "adaptive", "dt": dt}
    with pytest.raises(SceneError, match="too long") as refusal:
        simulate(scene, 2 * dt, **how)
    assert refusal.value.field == "dt"
    assert simulate(scene, 2 * dt, switching="step_end", **how).status == "complete"


def test_a_record_goes_on_with_its_own_method():
    how = {"stepper": "adaptive", "rtol": 1e-4, "switching": "located", "geometry": "linear"}
    first = simulate(small(), 1e-4, fidelity="dynamic", **how)
    with pytest.raises(SceneError, match="rtol = 1e-09: cannot change"):
        simulate(small(), 2e-4, initial=first, rtol=1e-9)
    for given_rtol in (None, 1e-4):
        whole = simulate(small(), 2e-4, initial=first, rtol=given_rtol)
        assert whole.method.stepper == "adaptive"
        assert whole.method.switching == "located"
        assert whole.method.rtol == 1e-4


def test_nothing_is_missing_from_the_budget_of_a_slider_at_rest():
    """The error of the budget is not compared with exchanged energy that is rounding, too."""
    record = simulate(small(V=0.0), 1e-4, fidelity="dynamic", geometry="linear")
    assert not any("budget" in note for note in record.notes)
    assert budget_error(record.curve) < 1e-6


def test_steps_and_jumps_use_one_thread_of_blas(monkeypatch):
    """Two threads take five times as long to factorise the band of a large lattice."""
    scene, found = setup1(L=0.01, H=0.005, h=2.5e-3), []

    def looking(*_):
        pools = threadpoolctl.threadpool_info()
        found.extend(one["num_threads"] for one in pools if one["user_api"] == "blas")

    monkeypatch.setattr(Run, "advance", looking)
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        simulate(scene, 0.0, fidelity="hybrid", geometry="linear")
    assert found
    assert set(found) == {1}


def test_numpy_settings_of_the_caller_change_nothing():
    """Decayed motions underflow, with any settings."""
    runs = []
    for wanted in ("ignore", "raise"):
        with np.errstate(all=wanted):
            how = {"fidelity": "hybrid", "geometry": "linear"}
            runs.append(simulate("fig1", "0.12 s", **how))
    assert bits(runs[0].final_state) == bits(runs[1].final_state)


@pytest.mark.parametrize("fidelity", ["auto", "hybrid"])
def test_viscosity_that_makes_events_long_is_told_before_the_start(fidelity, monkeypatch, capsys):
    def started(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(simulation, "leveled", started)
    monkeypatch.setattr(simulation, "_run", started)
    scene = pyfric.preset("fig1")
    for eta, told in ((100 * scene.eta, True), (scene.eta, False), (0.0, False)):
        with pytest.raises(KeyboardInterrupt):
            pyfric.simulate(scene.replace({"slider.eta": eta}), 9.0, fidelity=fidelity)
        said = capsys.readouterr().err.splitlines()
        assert len(said) == told, said
        if told:
            times = float(said[0].split("viscosity makes steps ")[1].split()[0])
            assert 30 < times < 1000
    with pytest.raises(KeyboardInterrupt):
        pyfric.simulate(scene.replace({"slider.eta": 100 * scene.eta}), 1e-3, fidelity=fidelity)
    assert not capsys.readouterr().err


def test_a_short_run_costs_no_more_than_a_longer_one():
    runs = [pyfric.simulate("fig1", t_end, progress=False) for t_end in ("10 ms", "30 ms", "0.3 s")]
    made = [record.counts["block_evaluations"] for record in runs]
    assert max(made[:2]) <= made[2]
    assert made[0] < 100 * 57 * 31 * 4, "fewer than a hundred steps"


@pytest.mark.parametrize("options", [{}, {"fidelity": "quasistatic"}, {"verify": "none"}])
def test_the_logger_gets_what_the_notes_say(options, caplog):
    with caplog.at_level("INFO", logger="pyfric"):
        record = simulate(small(), 2e-3, progress=False, **options)
    said = [one.getMessage() for one in caplog.records if one.name == "pyfric"]
    assert said[0].endswith(record.status)
    assert tuple(said[1:]) == record.notes
    assert record.notes or options
