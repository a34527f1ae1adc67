"""Levels of a scene: their differences, omitted levels, and their cost."""

import dataclasses
import itertools
import re
import time
import types
from pathlib import Path

import numpy as np
import pytest
from helpers import small_rod
from hypothesis import given, settings
from hypothesis import strategies as st

import pyfric
from pyfric import core
from pyfric.engines import ACCURACY, Options, cost, default_stepper, step_size
from pyfric.engines.cost import (
    CALL,
    JUNCTION,
    finer_counts,
    full_counts,
    full_work,
    machine_speed,
    work,
    work_so_far,
)
from pyfric.planning import expected_cost, plan, plans, simulate, simulation
from pyfric.planning.levels import (
    ALONE,
    LOOSE,
    SHORTER,
    STEP_ERROR,
    alone,
    first_step,
    levels,
    of_named,
    rotation,
)
from pyfric.scene import chain, laws, preset, setup1, setup2, slab
from pyfric.statics import stability_limit
from pyfric.values import SceneError

ROOT = Path(__file__).parents[1]
WANTS = ("loading_curve", "precursors", "stress", "front_speed", "motion")


def of(scene, **options):
    """Return the levels of a scene that can run."""
    return [level for level in every(scene, **options) if not level.cannot]


def every(scene, **options):
    return levels(scene, Options(**options).on(scene))


def left_out(scene, engine, **options):
    (reason,) = [level.cannot for level in every(scene, **options) if level.engine == engine]
    return reason


# --- what levels differ in -----------------------------------------------------------------------


def test_levels_of_the_fig1_scene():
    """The levels are those of the table in the module."""
    scene = preset("fig1")
    h = 0.47 * stability_limit(scene, "rk46")[0]
    for tolerance, first, steps in (
        (LOOSE, ("quasistatic", "linear"), [1, 2 / 3, 4 / 9]),
        (0.99 * LOOSE, ("hybrid", "linear"), [2 / 3, 4 / 9, 8 / 27]),
    ):
        found = of(scene, tolerance=tolerance)
        kinds = [(one.engine, one.geometry) for one in found]
        assert kinds == [first, *[("hybrid", "finite")] * 3]
        assert [one.dt / h for one in found[1:]] == pytest.approx(steps, rel=0.01)
        stepped = [one for one in found if one.dt]
        assert [one.accuracy for one in stepped] == pytest.approx(
            10.0 ** -np.arange(4, 4 + len(stepped))
        )
        assert {one.stepper for one in stepped} == {"rk46"}
        assert all(one.answers for one in found)


@settings(max_examples=40)
@given(
    scene=st.sampled_from(
        [preset("fig1"), setup2(), chain(), small_rod(eta=0.5), small_rod(eta=0.0), preset("slow")]
    ),
    tolerance=st.floats(1e-6, 1.0),
    want=st.sampled_from(WANTS),
    given_options=st.sampled_from(
        [{}, {"dt": 1e-7}, {"geometry": "linear"}, {"switching": "step_end"}, {"stepper": "verlet"}]
    ),
)
def test_levels_differ_in_what_the_answer_hangs_on(scene, tolerance, want, given_options):
    found = [one for one in of(scene, tolerance=tolerance, want=want, **given_options) if one.dt]
    assert len(found) >= 2
    for a, b in itertools.pairwise(found):
        assert (a.geometry, a.dt) != (b.geometry, b.dt)
        assert b.dt <= SHORTER * a.dt * (1 + 1e-12)
        assert a.dt == pytest.approx(2 * b.dt) or a.stepper == "rk46"
        assert b.accuracy is None or b.accuracy < a.accuracy or b.accuracy == 1e-9
    for one in found:
        assert one.dt <= stability_limit(scene, one.stepper)[0]
        named = Options(dt=one.dt, fidelity=one.engine, stepper=one.stepper)
        assert one.options(Options()).dt == named.dt


def test_options_that_were_given_hold_for_what_is_returned():
    scene = preset("fig1")
    for name, value in (
        ("dt", 1e-6),
        ("geometry", "finite"),
        ("switching", "step_end"),
        ("accuracy", 1e-4),
        ("stepper", "rk4"),
        ("stepper", "verlet"),
        ("energies", True),
    ):
        found = [one for one in of(scene, tolerance=0.1, **{name: value}) if one.answers]
        for one in found if name != "geometry" else found[-2:]:
            got = getattr(one.options(Options(**{name: value})), name)
            assert got == value
    measures = of(scene, dt=1e-6)[-1]
    assert not measures.answers
    assert measures.dt == 0.5e-6


def test_first_steps_leave_the_same_error():
    """Both steppers leave the same error; other methods begin at half of their limit."""
    for scene in (preset("fig1"), preset("fig1", eta=0.0), chain()):
        stepper = default_stepper(scene)
        error, order = {"rk46": (1e-6, 6), "rk46_waves": (1e-5, 4)}[stepper]
        share = 0.5 * (STEP_ERROR / error) ** (1 / order)
        first = first_step(scene, Options())
        assert first == pytest.approx(share * stability_limit(scene, stepper)[0], rel=0.01)
        for how in ({"stepper": "rk4"}, {"switching": "step_end"}):
            first = first_step(scene, Options(**how))
            assert first == pytest.approx(0.5 * stability_limit(scene, "rk4")[0], rel=0.01)


def test_a_named_run_is_followed_by_half_and_a_quarter_of_its_step():
    scene = preset("fig1")
    for how in ({"dt": 1e-6}, {"geometry": "linear"}, {"stepper": "verlet"}, {"method": "paper"}):
        engine = "dynamic" if how.keys() & {"stepper", "method"} else "hybrid"
        options = Options(fidelity=engine, **how).on(scene)
        named, half, quarter = of_named(scene, options)
        assert named.dt == options.steps_on(scene)[0]
        assert (half.dt, quarter.dt) == pytest.approx((named.dt / 2, named.dt / 4))
        assert named.geometry == how.get("geometry", "finite")
        assert half.geometry == quarter.geometry == "finite"
        assert [one.answers for one in (named, half, quarter)] == [True, False, False]


def test_jumps_of_a_named_run_have_the_accuracy_that_was_given():
    scene = preset("fig1")
    for given_accuracy, known in ((None, ACCURACY), (1e-4, 1e-4)):
        options = Options(fidelity="hybrid", accuracy=given_accuracy).on(scene)
        assert of_named(scene, options)[0].accuracy == known


# --- what is left out ----------------------------------------------------------------------------


def test_levels_that_cannot_run_say_why():
    scene = preset("fig1")
    speeds = {"want": "front_speed", "tolerance": 0.1}
    assert left_out(scene, "quasistatic", **speeds) == "it has no front speed"
    assert [level.engine for level in every(scene, tolerance=0.99 * LOOSE)] == ["hybrid"] * 4
    soft = preset("fig1", d_c=1e-6)
    assert "friction falls too slowly" in left_out(soft, "quasistatic", tolerance=0.1)
    for one, why in (
        (preset("slow"), "junctions"),
        (small_rod(push=((1, 1.0),)), "pushed"),
        (slab(p=[1.0] * 5, tau=[0.1] * 5, L=0.01, H=0.005, l=2.5e-3), "prescribed"),
    ):
        assert why in left_out(one, "hybrid")
        assert [level.engine for level in of(one)] == ["dynamic"] * 3
    assert "motion" in left_out(scene, "hybrid", want="motion")
    assert "'verlet'" in left_out(scene, "hybrid", stepper="verlet")


def test_linear_geometry_is_left_out_under_loads_that_bend_too_much():
    """The error of linear geometry is of the order of strains, which grow with the load."""
    errors = [rotation(preset("fig1", F_N=F_N)) for F_N in (350.0, 3500.0)]
    assert errors[1] == pytest.approx(10 * errors[0], rel=1e-6)
    for tolerance, geometry in ((0.9 * errors[1], "finite"), (1.1 * errors[1], "linear")):
        first = next(one for one in of(preset("fig1"), tolerance=tolerance) if one.dt)
        assert first.geometry == geometry


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "t_end"),
    [("fig1", {}, 0.9), ("fig1", {"F_N": 7e3}, 0.9), ("setup2", {}, 0.5), ("run4", {}, 0.6)],
)
def test_orders_of_magnitude_are_those_of_runs(name, changes, t_end):
    """Expected errors without inertia and without rotation are right within a factor of 4."""
    scene, how = preset(name, **changes), {"progress": False}
    static = simulate(scene, t_end, fidelity="quasistatic", **how)
    linear, finite = (
        simulate(scene, t_end, fidelity="hybrid", geometry=one, **how)
        for one in ("linear", "finite")
    )
    off = [pyfric.record.differences(a, finite).errors()["start"] for a in (static, linear)]
    assert LOOSE / 20 < off[0] < LOOSE
    assert rotation(scene) / 4 < off[1] < 4 * rotation(scene)


def test_which_level_is_made_alone():
    scene = preset("fig1")
    kinds = {0: ("quasistatic", "linear"), 1: ("hybrid", "linear"), 2: ("hybrid", "finite")}
    for tolerance, kind in ((1.0, 0), (0.1, 0), (0.049, 1), (0.02, 1), (0.019, 2), (1e-6, 2)):
        single = alone(every(scene, tolerance=tolerance), tolerance)
        assert (single.engine, single.geometry) == kinds[kind]
    assert [number for _, number in ALONE] == [0, 1, 2]
    fronts = every(scene, tolerance=0.1, want="front_speed")
    assert alone(fronts, 0.1).geometry == "linear"


# --- steps ---------------------------------------------------------------------------------------


def test_steps_resolve_weakening_if_those_of_a_quarter_can():
    """A factor that falls to 0.9 over a speed v gives the growth rate mu_s p 0.1/(v m)."""
    scene = setup1(L=0.025, H=0.0125, h=5e-3, F_N=1290.0)
    auto, free = step_size(scene), first_step(scene, Options())
    for wanted in (2 * free, 0.9 * free, 0.3 * free, 0.24 * free):
        v = 0.1 * 0.7 * scene.F_N / scene.N_x * wanted / scene.m
        law = laws.SpeedDependent(v=(0.0, v), factor=(1.0, 0.9))
        weak = scene.replace({"interface.law": law})
        for first, longest in ((first_step(weak, Options()), free), (step_size(weak), auto)):
            resolves = min(wanted, longest) if wanted > longest / 4 else longest
            assert first == pytest.approx(resolves, rel=0.01)
            assert first <= resolves * (1 + 1e-9)


# --- plans ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("want", "tolerance"), [("stress", 0.1), ("front_speed", 0.05)])
def test_a_plan_says_what_is_made(want, tolerance):
    found = plan(small_rod(), want, tolerance, t_end=0.7)
    lines = str(found).splitlines()
    assert lines[0].startswith(f"for {want} within {tolerance:g}, to about 0.7 s: levels are made")
    for level, seconds in zip(found.levels, found.seconds, strict=True):
        if level.cannot:
            assert f"-  {level.engine}: left out ({level.cannot})" in lines
        else:
            assert any(f"{level}: about {seconds:.2g} s" in line for line in lines)
    assert f"without errors (verify = 'none'): {found.alone}" in lines
    assert "rotation of bonds" in str(found)
    assert "rotation" not in str(plan(chain(), want, tolerance, t_end=0.1))


def test_a_plan_tells_where_the_run_ends():
    scene, how = small_rod(), {"stop_when": "main_events = 2"}
    found = plan(scene, tolerance=0.05, t_end=2.0, **how)
    record = simulate(scene, 2.0, tolerance=0.05, **how, progress=False)
    assert found.t_end == pytest.approx(record.curve["t"].iloc[-1], rel=0.05)
    assert plan(scene, tolerance=0.05, t_end=0.3).t_end == 0.3


@settings(max_examples=12)
@given(
    want=st.sampled_from(WANTS),
    tolerance=st.floats(1e-6, 1.0),
    t_end=st.sampled_from([0.0, 1e-30, 1e5]) | st.floats(1e-9, 5.0),
)
def test_any_question(want, tolerance, t_end):
    found = plan(setup2(L=0.012, H=0.004), want, tolerance, t_end=t_end)
    assert np.isfinite(found.seconds).all()
    assert "nan" not in str(found)
    assert found.alone in found.levels


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
        plan(small_rod(), **arguments)
    assert refusal.value.field == name
    allowed = {"want": "'front_speed'", "tolerance": "> 0 and <= 1", "t_end": ">= 0 s"}
    assert allowed[name] in str(refusal.value)


@pytest.mark.parametrize(
    "scene",
    [setup1(l=0.25e-3), setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4), chain(L=1.0, l=1e-4)],
    ids=["fits", "primes", "chain"],
)
def test_planning_is_quick_on_large_lattices(scene):
    start = time.process_time()
    found = plan(scene, "motion", t_end=0.5)
    assert time.process_time() - start < 20
    assert all(one.dt <= stability_limit(scene)[0] for one in found.levels if one.dt)


def test_front_speeds_that_need_a_finer_lattice():
    coarse = preset("fig1", d_c=1e-6)
    assert "times smaller" in plan(coarse, "front_speed", 0.05, t_end=0.3).lattice
    assert "no l resolves" in plan(preset("fig1"), "front_speed", 0.05, t_end=0.3).lattice
    assert plan(coarse, "precursors", 0.05, t_end=0.3).lattice == ""


# --- cost ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "t_end", "tolerance"),
    [
        (preset("fig1"), 0.45, 0.01),
        pytest.param(setup2(), 0.5, 0.01, marks=pytest.mark.slow),
        (small_rod(), 0.8, 0.01),
        (chain(), 0.2, 0.01),
    ],
)
def test_expected_work_is_that_of_runs(scene, t_end, tolerance):
    """The work of the hybrid engine, expected from a sequence, is right within a factor of 3."""
    found = plan(scene, tolerance=tolerance, t_end=t_end)
    options = Options(tolerance=tolerance).on(scene)
    for level, seconds in zip(found.levels[1:3], found.seconds[1:3], strict=True):
        how = dataclasses.replace(level.options(options), tolerance=Options.tolerance)
        record = simulate(scene, t_end, how, progress=False)
        assert 1 / 3 < seconds / (work_so_far(record) * machine_speed()) < 3


def test_operations_with_shorter_steps():
    """Numbers of switches, points of the curve and attempts to jump do not change."""
    scene = small_rod()
    blocks = scene.N_x * scene.N_z
    counts = {"steps": 100, "block_evaluations": 500 * blocks, "calls": 7, "landings": 3}
    found = finer_counts(scene, counts, 4, "rk4", "rk4")
    assert found == counts | {"steps": 400, "block_evaluations": 1700 * blocks}
    record = simulate(scene, 0.005, fidelity="dynamic", progress=False, verify="none")
    finer = simulate(scene, 0.005, fidelity="dynamic", dt=record.method.dt / 4, progress=False)
    expected = finer_counts(scene, record.counts, 4, "rk46", "rk46")
    assert work(scene, "finite", expected) == pytest.approx(work_so_far(finer), rel=0.1)


def test_work_of_dynamics():
    scene = small_rod()
    dt = step_size(scene)
    run = {"fidelity": "dynamic", "dt": dt, "sample": 2e-3 / 500}
    record = simulate(scene, 2e-3, progress=False, **run)
    made, none = (full_work(scene, "finite", *how, "rk46") for how in ((dt, 2e-3), (1, 0)))
    made -= none
    assert work_so_far(record) == pytest.approx(made, rel=0.1)


def test_calls_of_the_core_for_motion_on_junctions_are_counted(monkeypatch):
    scene = preset("slow", L=0.02, H=0.0125)
    calls, advance, dt = [], core.advance, step_size(scene)
    monkeypatch.setattr(core, "advance", lambda *a, **how: calls.append(a) or advance(*a, **how))
    record = simulate(scene, 1e-3, fidelity="dynamic", dt=dt, progress=False, verify="none")
    expected = full_counts(scene, dt, 1e-3, "rk46", calls=Options().calls_on(scene))
    assert expected["calls"] == pytest.approx(len(calls), rel=0.2)
    assert work(scene, "finite", expected) > 2 * len(calls) * CALL
    assert work_so_far(record) > record.counts["steps"] * 4 * JUNCTION * 100 * scene.N_x


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


def test_cost_of_the_papers_method_counts_its_steps():
    """The step is 0.09 us in setup 2 for any name of the engine; other methods have longer ones."""
    costs = [
        expected_cost(preset("setup2"), 0.01, Options(method="paper", fidelity=engine))[0]
        for engine in ("auto", "dynamic")
    ]
    usual = expected_cost(preset("setup2"), 0.01, Options(fidelity="dynamic"))[0]
    assert costs[0] >= costs[1] > 1.5 * usual


def test_cost_of_a_sweep_counts_two_levels():
    scene = small_rod()
    two, one = (
        expected_cost(scene, 0.8, Options(tolerance=0.01, verify=verify))[0]
        for verify in (None, "none")
    )
    assert 1.1 * one < two < 4 * one


def test_more_than_ten_minutes_is_said_with_the_cheaper_way(monkeypatch, capsys):
    monkeypatch.setattr(simulation, "LONG", 1e-3)
    scene = small_rod()
    record = simulate(scene, 1e-3, fidelity="dynamic", geometry="finite", progress=False)
    assert any("minutes on one core; fidelity = 'hybrid' often" in one for one in record.notes)
    assert capsys.readouterr().err == ""
    record = simulate(scene, 1e-3, fidelity="dynamic", geometry="linear")
    assert "larger blocks take less" in capsys.readouterr().err
    record = simulate("fig1", 0.05, tolerance=0.01)
    assert record.method.engine == "hybrid"
    assert any(note.startswith("hybrid: this run takes about") for note in record.notes)
    assert "hybrid: this run takes about" in capsys.readouterr().err
    monkeypatch.setattr(simulation, "LONG", 600.0)
    notes = simulate(scene, 1e-4, fidelity="dynamic", progress=False).notes
    assert not any("minutes" in note for note in notes)


def test_viscosity_which_shortens_steps_makes_events_cost_more():
    """There are seven main events; steps are 12 times shorter than without viscosity."""
    scene = setup1(L="30 mm", H="15 mm", V=0.05)
    scene = scene.replace({"slider.eta": 10 * scene.eta})
    levels = plan(scene, t_end=0.03).levels
    level = next(level for level in levels if level.engine == "hybrid")
    how = {"fidelity": "hybrid", "geometry": level.geometry, "stepper": level.stepper}
    made = simulate(scene, 0.03, dt=level.dt, progress=False, **how)
    before = simulate(scene, 0.03, fidelity="quasistatic", progress=False)
    expected = plans.expected_work(scene, level, 0.03, before)
    assert 1 / 3 < expected / plans.work_done(made) < 3
