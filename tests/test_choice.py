"""What is chosen, and why: every number a plan states, and every model that it rejects."""

import dataclasses
import itertools
import math
import re
import time
import types
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyfric
from pyfric import core
from pyfric.engines import Options, cost, relaxation_time, step_size
from pyfric.engines.cost import (
    CALL,
    JUNCTION,
    RUN,
    finer_counts,
    full_counts,
    full_work,
    located,
    machine_speed,
    work,
    work_so_far,
)
from pyfric.planning import choice, expected_cost, pilot, plan, simulate, simulation
from pyfric.planning.choice import (
    LINEAR,
    LONGEST,
    RING_SHARE,
    SHARE,
    SPARES,
    step_error,
)
from pyfric.planning.pilot import (
    Pilot,
    counted,
    interval,
    linear_error,
    pilot_run,
    quasistatic_work,
)
from pyfric.planning.price import (
    CHEAP,
    Runs,
    affordable,
    budget,
    verification_work,
)
from pyfric.scene import SceneError, chain, laws, preset, setup1, setup2
from pyfric.statics import stability_limit

ROOT = Path(__file__).parents[1]
WANTS = ("loading_curve", "precursors", "stress", "front_speed", "motion")
RELAXES = "relaxation time over time between main events"


def small(**changes):
    """A scene with 10 main events in its first 1.5 s."""
    return setup1(**{"L": 0.03, "H": 0.015} | changes)


def value(found, name):
    (one,) = [one for one in found.assumptions if one.name == name]
    assert one.holds
    return one.value


def rejected(level, found):
    return " ".join(reason for reason in found.reasons if reason.startswith(level))


# --- models --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    [
        (0.1, ("quasistatic", "linear")),
        (0.04, ("hybrid", "linear")),
        (0.01, ("hybrid", "finite")),
        (1e-4, ("hybrid", "finite")),
    ],
)
def test_models_of_the_fig1_scene(tolerance, expected):
    found = plan(preset("fig1"), "loading_curve", tolerance, t_end=0.9)
    assert (found.fidelity, found.geometry) == expected
    assert found.error <= tolerance
    assert all(one.holds for one in found.assumptions)
    if found.fidelity == "hybrid":
        assert found.accuracy == SHARE * tolerance or found.accuracy == 1e-3
        assert found.switching == "located"


def test_what_is_wanted():
    scene = small()
    how = {want: plan(scene, want, 0.1, t_end=0.7) for want in WANTS}
    for want in ("loading_curve", "precursors", "stress"):
        assert how[want].fidelity == "quasistatic"
    front, motion = how["front_speed"], how["motion"]
    assert (front.fidelity, motion.fidelity) == ("hybrid", "dynamic")
    assert "quasi-static (it has no front speed)" in front.reasons
    assert "motion between events" in rejected("hybrid", motion)
    assert motion.geometry == "finite"


def test_full_dynamics_is_taken_where_it_is_cheap():
    found = plan(small(), tolerance=0.1, t_end=2e-3)
    assert (found.fidelity, found.geometry) == ("dynamic", "finite")
    assert found.work == full_work(small(), "finite", found.dt, 2e-3) < CHEAP
    assert "full dynamics takes about" in rejected("hybrid", found)


def test_steps_follow_from_the_order_of_rk4():
    scene = small()
    found = {tol: plan(scene, "motion", tol, t_end=0.7) for tol in (1e-2, 1e-3, 1e-5, 1e-9)}
    auto, error = step_size(scene), step_error(scene, "motion", step_size(scene))
    longest = LONGEST * stability_limit(scene)[0]
    assert 0.9 * longest < found[1e-2].dt <= longest
    assert found[1e-2].error == step_error(scene, "motion", found[1e-2].dt) > 4 * error
    for tolerance in (1e-5, 1e-9):  # rounded down to two digits
        steps = (error / (SHARE * tolerance)) ** 0.25
        assert 0.9 * auto / steps < found[tolerance].dt <= auto / steps
    speeds = [plan(scene, "front_speed", tol, t_end=1e-3).dt for tol in (1e-3, 1e-3 / 16)]
    assert speeds[1] == pytest.approx(speeds[0] / 2, rel=0.1)


def test_steps_resolve_weakening_as_far_as_those_of_reference_runs_can():
    """A factor that falls to 0.9 over a speed v gives the growth rate mu_s p 0.1/(v m)."""
    scene = setup1(L=0.025, H=0.0125, h=5e-3, F_N=1290.0)
    auto = step_size(scene)
    free = LONGEST * stability_limit(scene)[0] / auto
    cases = (2, free), (0.5, 0.5), (0.3, 0.3), (0.2, 0.4), (0.12, free)
    for wanted, expected in cases:  # over auto
        v = 0.1 * 0.7 * scene.F_N / scene.N_x * wanted * auto / scene.m
        law = laws.SpeedDependent(v=(0.0, v), factor=(1.0, 0.9))
        found = plan(scene.replace({"interface.law": law}), tolerance=0.1, t_end=1e-3)
        assert found.dt == pytest.approx(expected * auto, rel=0.1), wanted
        assert found.dt <= expected * auto * (1 + 1e-9)


@settings(max_examples=12)
@given(
    want=st.sampled_from(WANTS),
    tolerance=st.floats(1e-6, 1.0),
    t_end=st.sampled_from([0.0, 1e-30, 1e5]) | st.floats(1e-9, 5.0),
)
def test_any_question(want, tolerance, t_end):
    scene = setup2(L=0.012, H=0.004)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pilot, "LONGEST", pilot.LONGEST / 20)
        found = plan(scene, want, tolerance, t_end=t_end)
    assert all(one.holds for one in found.assumptions)
    assert 0 <= found.error <= tolerance
    assert np.isfinite([found.work, found.seconds, found.price]).all()
    if found.dt is not None:
        assert 0 < found.dt <= LONGEST * stability_limit(scene)[0]
    assert "nan" not in str(found)
    if found.fidelity == "dynamic":
        assert rejected("hybrid", found)
    if found.fidelity == "hybrid":
        assert rejected("quasi-static", found)


numbers = st.floats() | st.integers() | st.none() | st.booleans() | st.text(max_size=3)


@settings(max_examples=60)
@given(
    st.sampled_from(["want", "tolerance", "t_end"]), numbers | st.lists(st.integers(), max_size=2)
)
def test_refused_questions(name, given_value):
    real = isinstance(given_value, int | float) and not isinstance(given_value, bool)
    if name == "tolerance" and real and 1e-30 <= given_value <= 1:
        return
    if name == "t_end" and real and (given_value == 0 or 1e-30 <= given_value <= 1e30):
        return
    arguments = {"want": "precursors", "tolerance": 0.1, "t_end": 0.0} | {name: given_value}
    with pytest.raises(SceneError) as refusal:
        plan(small(), **arguments)
    assert refusal.value.field == name
    allowed = {"want": "'front_speed'", "tolerance": "> 0 and <= 1", "t_end": ">= 0 s"}
    assert allowed[name] in str(refusal.value)


# --- the quasi-static engine ---------------------------------------------------------------------


def test_quasistatic_statements():
    scene, t_end = small(), 1.5
    found = plan(scene, tolerance=0.1, t_end=t_end)
    record = simulate(scene, t_end, fidelity="quasistatic")
    assert found.fidelity == "quasistatic"
    assert value(found, RELAXES) == pytest.approx(relaxation_time(scene) / interval(record))
    assert value(found, "open blocks") == 0
    assert value(found, "eta/sqrt(k m)") == pytest.approx(math.sqrt(0.1))
    events = record.events
    whole = events[events["is_main"] & (events["n_blocks"] == scene.N_x)]
    drop = (whole["F_T_start"] - whole["F_T_arrest"]).max() / scene.F_N
    assert drop > choice.ERROR_QUASISTATIC
    assert found.error == pytest.approx(drop)
    assert found.check(record) == []
    slow = record.replace(scene=small(eta=1e-3))  # the same events of a slider that rings on
    assert [one.name for one in found.check(slow)] == [RELAXES]


def test_high_speed():
    """The plan rejects models as V shortens the time between events below the relaxation time."""
    for V in (0.02, 0.1):
        found = plan(small(V=V), tolerance=0.1, t_end=1.6 / V * 1e-3)
        assert RELAXES in rejected("quasi-static", found) or found.fidelity == "dynamic"
    slow = plan(small(V=1e-3), tolerance=0.1, t_end=0.8)
    assert value(slow, RELAXES) < RING_SHARE


def test_open_blocks():
    found = plan(setup2(theta=0.833), tolerance=0.2, t_end=0.5)
    assert found.fidelity == "hybrid"
    assert "open blocks: " in rejected("quasi-static", found)


def test_little_viscosity():
    found = plan(small(eta=0.0, V=8e-3), tolerance=0.1, t_end=0.15)
    assert found.fidelity == "dynamic"
    assert RELAXES in rejected("quasi-static", found)
    assert "spares too little" in rejected("hybrid", found)


def test_too_much_viscosity():
    found = plan(small(eta=40.0), tolerance=0.1, t_end=0.7)
    assert "eta/sqrt(k m): 0.816 > 0.433" in rejected("quasi-static", found)


def test_options_that_a_model_lacks_rule_it_out():
    scene = small()
    for name, given_value in (("dt", 1e-6), ("geometry", "finite"), ("switching", "step_end")):
        options = pyfric.Options(tolerance=0.1, **{name: given_value})
        found = choice.choose(scene, options, 0.7)
        assert found.fidelity == "hybrid"
        assert getattr(found, name) == given_value
    for more in ({"accuracy": 1e-4}, {"sample": 1e-3}):
        assert choice.choose(scene, pyfric.Options(tolerance=0.1, **more), 0.7).fidelity == "hybrid"
    stepped = choice.choose(scene, pyfric.Options(tolerance=0.1, stepper="verlet"), 0.7)
    assert stepped.fidelity == "dynamic"


def test_a_reference_run_in_another_geometry_is_priced_by_the_budget():
    """How far it could jump was not counted."""
    found = plan(small(), "front_speed", 0.1, t_end=0.7)
    assert (found.fidelity, found.geometry) == ("hybrid", "linear")
    assert found.price / found.seconds == pytest.approx(budget(found.work) / found.work)
    options = pyfric.Options(want="front_speed", tolerance=0.1, geometry="linear")
    same = choice.choose(small(), options, 0.7)
    assert same.price / same.seconds < 0.9 * budget(same.work) / same.work


# --- geometry ------------------------------------------------------------------------------------


def test_geometry_is_chosen_by_static_states_in_both():
    """Similar scenes in linear geometry: the weaker load bends less, in proportion."""
    errors = []
    for F_N in (350.0, 3500.0):
        scene = small(F_N=F_N, V=0.7875e-3 * F_N / 3500)
        errors.append(linear_error(pilot_run(scene, 0.7)))
    assert errors[1] == pytest.approx(10 * errors[0], rel=0.1)
    for tolerance, geometry in ((3.9 * errors[1], "finite"), (4.1 * errors[1], "linear")):
        found = plan(small(), "front_speed", tolerance, t_end=0.7)
        assert found.geometry == geometry
        if geometry == "linear":
            assert value(found, LINEAR) == errors[1]


@pytest.mark.slow
def test_the_error_of_linear_geometry_is_that_of_runs():
    """Of start forces, within a factor of 3, in the scene where a strain said 100 times as much."""
    scene, t_end = preset("fig1", F_N=350.0), 0.07
    predicted = linear_error(pilot_run(scene, t_end))
    how = {"fidelity": "hybrid", "progress": False}
    a, b = (simulate(scene, t_end, geometry=one, **how) for one in ("linear", "finite"))
    real = pyfric.record.differences(a, b).errors()["start"]
    assert predicted < 1.5 * real
    assert real < 15 * predicted


# --- price ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "t_end", "tolerance"),
    [
        (preset("fig1"), 0.45, 0.01),
        pytest.param(setup2(), 0.5, 0.05, marks=pytest.mark.slow),
        (small(), 0.8, 0.01),
        (small(V=0.02), 0.04, 0.01),  # the first modes take as long as a tenth of full dynamics
    ],
)
def test_work_is_counted(scene, t_end, tolerance):
    """Over the first quarter of the run, within a factor of two of what the run counts."""
    found = plan(scene, "front_speed", tolerance, t_end=t_end)
    how = {name: getattr(found, name) for name in ("fidelity", "geometry", "dt", "accuracy")}
    record = simulate(scene, t_end, progress=False, **how)
    assert 1 / 2 < found.work / work_so_far(record) < 2
    assert found.seconds == pytest.approx(found.work * machine_speed())
    assert 0 < found.price <= (2 * found.work + 0.5) * (1 + 1e-9) * machine_speed()


@pytest.mark.parametrize(
    ("made", "full", "first", "second"),
    [
        (0.02, 0.02, ("dynamic", "rk4_opposite", 4.0), ("dynamic", "rk4", 4.0)),
        (0.1, 0.1, ("dynamic", "rk4_opposite", 4.0), None),
        (0.3, 0.3, ("dynamic", "rk4_opposite", 2.5), None),
        (0.6, 0.6, ("dynamic", "rk4_opposite", 2.0), None),
        (1.5, 1.5, ("dynamic", "rk4", 2.0), None),
        (10.0, 10.0, ("dynamic", "rk4", 2.0), None),
        (0.1, 1.0, ("hybrid", "rk4_opposite", 4.0), None),  # full dynamics is beyond the budget
        (10.0, 30.0, ("hybrid", "rk4", 2.0), None),
    ],
)
def test_work_of_verification(made, full, first, second):
    """The work of full dynamics and of the hybrid engine is that of their steps alone."""
    scene = setup1(L=0.8, H=0.2)
    one = work(scene, "finite", full_counts(scene, 1e-6, 1e-3))
    counts = {
        engine: full_counts(scene, 1e-6, 1e-3 * seconds / one)
        for engine, seconds in (("dynamic", full), ("hybrid", made))
    }
    runs, found, left = Runs(scene, "finite", counts, "rk4", 1e-6, "located"), [], budget(made)
    for expected in (first, second):
        if expected is None:
            assert affordable(runs.references(), left) is None
            found.append(left)
            break
        engine, stepper, ratio = expected
        level = affordable(runs.references(), left)
        assert (level.engine, level.stepper) == (engine, stepper)
        assert level.dt == pytest.approx(runs.dt / ratio)
        stages = 1.0 if stepper == "rk4" else 5 / 4
        steps = work(scene, "finite", runs.counts[engine])
        if runs.stepper == "rk4":
            assert level.work == pytest.approx(RUN + stages * ratio * steps, rel=0.02)
        found.append(level.work)
        runs, left = runs.like(level.stepper, level.dt), left - level.work
    assert verification_work(made, Runs(scene, "finite", counts, "rk4", 1e-6, "located")) == (
        pytest.approx(found)
    )


def test_operations_with_shorter_steps():
    """Located transitions, points of the curve and attempts to jump stay as many."""
    scene = small()
    blocks = scene.N_x * scene.N_z
    counts = {"steps": 100, "block_evaluations": 500 * blocks, "calls": 7, "landings": 3}
    found = finer_counts(scene, counts, 4)
    assert found == counts | {"steps": 400, "block_evaluations": 1700 * blocks}
    record = simulate(scene, 0.005, fidelity="dynamic", progress=False, verify="none")
    finer = simulate(scene, 0.005, fidelity="dynamic", dt=record.method.dt / 4, progress=False)
    expected = finer_counts(scene, record.counts, 4)
    assert work(scene, "finite", expected) == pytest.approx(work_so_far(finer), rel=0.1)


def test_work_of_dynamics():
    scene = small()
    found = plan(scene, "motion", t_end=2e-3)
    how = {"fidelity": "dynamic", "dt": found.dt, "energies": False, "sample": 2e-3 / 500}
    record = simulate(scene, 2e-3, progress=False, **how)
    made = full_work(scene, "finite", found.dt, 2e-3) - full_work(scene, "finite", 1, 0)
    assert work_so_far(record) == pytest.approx(made, rel=0.1)


def test_calls_of_the_core_for_motion_on_junctions_are_counted(monkeypatch):
    scene = preset("slow", L=0.02, H=0.0125)
    found = plan(scene, t_end=1e-3)
    calls, advance = [], core.advance
    monkeypatch.setattr(core, "advance", lambda *a, **how: calls.append(a) or advance(*a, **how))
    record = simulate(scene, 1e-3, fidelity="dynamic", dt=found.dt, progress=False, verify="none")
    expected = full_counts(scene, found.dt, 1e-3, calls=pyfric.Options().calls_on(scene))
    assert expected["calls"] == pytest.approx(len(calls), rel=0.2)
    assert found.work > 2 * len(calls) * CALL
    assert work_so_far(record) > record.counts["steps"] * 4 * JUNCTION * 100 * scene.N_x


def test_a_pilot_run_that_spares_nothing_ends_early():
    scene = small(eta=1e-4)
    options = pyfric.Options(geometry="linear", dt=step_size(scene))
    start = time.process_time()
    made = work(scene, "linear", counted(scene, 1.5, options, pilot_run(scene, 1.5)))
    assert made > SPARES * full_work(scene, "linear", options.dt, 1.5)
    assert time.process_time() - start < 5


def test_a_machine_that_takes_three_times_the_work_is_three_times_as_slow(monkeypatch):
    scene = preset("fig1")
    step = {"block_evaluations": 4 * scene.N_x * scene.N_z}
    expected = cost.TIMED * work(scene, "finite", step)
    clock = itertools.count(step=3 * expected)
    monkeypatch.setattr(cost, "time", types.SimpleNamespace(thread_time=lambda: next(clock)))
    assert machine_speed.__wrapped__() == pytest.approx(3.0)


def test_bonds_beyond_their_series_cost_more():
    made = {"block_evaluations": 1e6}
    light, heavy = (preset("fig1", F_N=F_N) for F_N in (2e3, 4e4))
    assert work(heavy, "linear", made) == work(light, "linear", made)
    more = work(heavy, "finite", made) - work(light, "finite", made)
    assert more == pytest.approx(1e6 * cost.CLOSED)
    (limit,) = re.findall(
        r"S_SERIES = 2.0_dp\*\*\((-\d+)\)", (ROOT / "fortran" / "model.f90").read_text()
    )
    assert cost.BEYOND == 2.0 ** int(limit) / 2


def test_choices_do_not_depend_on_the_machine(monkeypatch):
    found = []
    for speed in (1.0, 10.0):
        monkeypatch.setattr(choice, "machine_speed", lambda speed=speed: speed)
        found.append(plan(small(), t_end=0.7))
    assert found[1].seconds == pytest.approx(10 * found[0].seconds)
    same = {"seconds": 0.0, "price": 0.0, "refinement": 0.0}
    assert dataclasses.replace(found[0], **same) == dataclasses.replace(found[1], **same)


def test_more_than_ten_minutes_is_said_with_the_cheaper_way(monkeypatch, capsys):
    monkeypatch.setattr(simulation, "LONG", 1e-3)
    scene = small()
    record = simulate(scene, 1e-3, fidelity="dynamic", geometry="finite", progress=False)
    assert any("minutes on one core; fidelity = 'hybrid' often" in one for one in record.notes)
    assert capsys.readouterr().err == ""
    record = simulate(scene, 1e-3, fidelity="dynamic", geometry="linear")
    assert "larger blocks take less" in capsys.readouterr().err
    monkeypatch.setattr(simulation, "LONG", 600.0)
    notes = simulate(scene, 1e-4, fidelity="dynamic", progress=False).notes
    assert not any("minutes" in note for note in notes)


def test_planned_runs_that_take_long_say_so(monkeypatch, capsys):
    monkeypatch.setattr(simulation, "LONG", 1e-3)
    record = simulate("fig1", 0.05, tolerance=0.01)
    assert record.method.engine == "hybrid"
    assert any(note.startswith("hybrid: this run takes about") for note in record.notes)
    assert "hybrid: this run takes about" in capsys.readouterr().err


@pytest.mark.parametrize(
    "scene",
    [setup1(l=0.25e-3), setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4), chain(L=1.0, l=1e-4)],
    ids=["fits", "primes", "chain"],
)
def test_choosing_is_quick_on_large_lattices(scene):
    start = time.process_time()
    found = plan(scene, "motion", t_end=0.5)
    assert time.process_time() - start < 20
    assert found.dt <= stability_limit(scene)[0]


# --- numbers -------------------------------------------------------------------------------------


def test_errors_of_steps_are_those_of_one_block():
    """Phase of RK4: per step (omega dt)^5/120; the force of one block; a radian, undamped."""
    scene = chain(L=0.03, eta=0.0, k_top=3e6, mu_s=0.6, mu_k=0.4)
    omega = math.sqrt((2 * scene.slider.k + 3e6 + scene.driver.K) / scene.m)
    dt, z = 0.3 / omega, 0.3j
    grown = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    phase = abs(np.angle(grown) - 0.3) / 0.3
    assert step_error(scene, "front_speed", dt) == pytest.approx(phase, rel=0.1)
    assert step_error(scene, "stress", dt) == pytest.approx(0.2 * phase / scene.N_x, rel=0.1)
    damped = dataclasses.replace(scene, slider=dataclasses.replace(scene.slider, eta=1e5))
    assert step_error(damped, "stress", dt) < 0.1 * phase


# --- text ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "want", "left_out"),
    [
        (0.1, "stress", "inertia, waves, ring-down; rotation of bonds"),
        (0.1, "front_speed", "fast modes, once they have nearly decayed; rotation of bonds"),
        (0.01, "stress", "fast modes, once they have nearly decayed"),
        (0.01, "motion", "nothing"),
    ],
)
def test_text(tolerance, want, left_out):
    found = plan(small(), want, tolerance, t_end=0.7)
    lines = str(found).splitlines()
    assert lines[0].startswith(f"for {want} within {tolerance:g}: {found.fidelity}, ")
    assert f"left out: {left_out}" in lines
    for one in found.assumptions:
        assert f"because {one}" in lines
    for reason in found.reasons:
        assert f"rejected: {reason}" in lines
    assert f"expected error: {found.error:.2g}" in lines
    cost = f"verification: about {found.price:.2g} s more"
    if found.fidelity != "quasistatic":  # dynamics would replace it
        cost += f", and {found.refinement:.2g} s if the run has to be refined"
    assert cost in lines


def test_a_chain_has_no_rotation_to_leave_out():
    assert "rotation" not in str(plan(chain(), "front_speed", tolerance=0.1, t_end=0.1))


def test_cost_of_the_papers_method_counts_its_steps():
    """0.2 us in setup 2, however the engine is named; other methods take longer ones."""
    costs = [
        expected_cost(preset("setup2"), 0.01, Options(method="paper", fidelity=engine))[0]
        for engine in ("auto", "dynamic")
    ]
    assert costs[0] == costs[1]
    usual = expected_cost(preset("setup2"), 0.01, Options(fidelity="dynamic"))[0]
    assert costs[0] > 1.5 * usual


def test_a_phase_error_ends_at_one():
    least = plan(preset("fig1").replace({"eta": 1.0}), "precursors", 0.01, t_end=0.01).dt / 20
    for eta in (1e-9, 1e-4):
        scene = preset("fig1").replace({"eta": eta})
        assert step_error(scene, "front_speed", step_size(scene)) <= 1.0
        assert plan(scene, "precursors", 0.01, t_end=0.01).dt > least


def test_set_up_of_the_quasistatic_engine_is_counted():
    scene = preset("fig1", l=0.5e-3)
    run = Pilot(None, np.zeros((0, 2)), 1.0, "")
    assert quasistatic_work(scene, run) > 1.0


def test_full_dynamics_locates_the_transitions_of_the_pilot_run(monkeypatch):
    """A law of 33 knots: more work than that of steps. (The run makes 1.8 times what is found.)"""
    weakening = {"interface.law": laws.ExponentialWeakening(), "d_c": 1e-6}
    scene, t_end = setup1(weakening, L=0.03, H=0.015, V=0.1), 0.12
    pilots = []
    monkeypatch.setattr(choice, "counted", lambda *how: pilots.append(counted(*how)) or pilots[0])
    found = plan(scene, "precursors", t_end=t_end, tolerance=1e-3)
    steps = full_counts(scene, found.dt, t_end)
    more = {"block_evaluations": steps["block_evaluations"] + located(scene, pilots[0])}
    assert found.fidelity == "dynamic"
    assert found.work == pytest.approx(RUN + work(scene, found.geometry, more))
    assert found.work > 2 * full_work(scene, found.geometry, found.dt, t_end)


def test_transitions_of_cheap_dynamics_are_counted():
    law = {"interface.law": laws.ExponentialWeakening(), "d_c": 1e-6}  # 33 knots
    scene, t_end = setup1(law, L=0.02, H=0.0125, V=0.5), 3e-3
    found = plan(scene, tolerance=0.05, t_end=t_end)
    steps = full_work(scene, "finite", found.dt, t_end)
    record = simulate(scene, t_end, tolerance=0.05, verify="none", progress=False)
    assert found.fidelity == record.method.engine == "dynamic"
    assert 1.2 * steps < found.work < CHEAP
    assert found.work == pytest.approx(RUN + work_so_far(record), rel=0.01)


def test_a_run_may_cost_what_its_plan_announced(monkeypatch):
    """The hybrid engine; cheap dynamics was made for its price, so that the run itself tells it."""
    seen = []
    monkeypatch.setattr(simulation, "verified", lambda record, made: seen.append(made) or record)
    for scene, t_end in ((small(), 0.7), (small(V=0.5), 3e-3)):
        simulate(scene, t_end, want="front_speed", progress=False)
    found = plan(small(), "front_speed", t_end=0.7)
    assert found.fidelity == "hybrid"
    announced = (found.seconds + found.price) / machine_speed()
    assert seen[0].whole == pytest.approx(announced)
    assert seen[0].refinement == pytest.approx(found.refinement / machine_speed())
    assert found.refinement > 0
    assert seen[1].whole == math.inf


def test_cheap_dynamics_is_counted_up_to_its_end():
    scene = setup1(L=0.02, H=0.0125, V=0.5)
    plans = [plan(scene, t_end=t, stop_when="main_events = 1") for t in (0.01, 0.02)]
    record = simulate(scene, 0.02, stop_when="main_events = 1", verify="none", progress=False)
    assert record.curve["t"].iloc[-1] < 0.01
    assert {one.fidelity for one in plans} == {"dynamic"}
    assert plans[1].work < 1.1 * plans[0].work
