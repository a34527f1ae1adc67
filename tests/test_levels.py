"""Levels of a scene: what each differs in, what is left out, and what they cost."""

import dataclasses
import itertools
import math
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
from pyfric.engines import Options, cost, step_size
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
    LONGEST,
    SHARE,
    STATIC,
    alone,
    levels,
    of_named,
    rotation,
    step_error,
)
from pyfric.scene import SceneError, chain, laws, preset, setup1, setup2, slab
from pyfric.statics import stability_limit

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
    """The table of the module."""
    found = of(preset("fig1"), tolerance=0.01)
    h = LONGEST * stability_limit(preset("fig1"))[0]
    assert [(one.engine, one.geometry, one.stepper) for one in found] == [
        ("quasistatic", "linear", ""),
        ("hybrid", "linear", "rk4_opposite"),
        ("hybrid", "finite", "rk4"),
        ("hybrid", "finite", "rk4_opposite"),
        ("hybrid", "finite", "rk4"),
    ]
    assert found[2].dt == pytest.approx(h, rel=0.1)
    assert [one.dt / found[2].dt for one in found[3:]] == [0.5, 0.25]
    assert [one.accuracy for one in found[1:]] == pytest.approx([1e-3, 1e-4, 1e-5, 1e-6])
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
        assert a.stepper != b.stepper or a.dt == 2 * b.dt or "dt" in given_options
        assert b.accuracy is None or b.accuracy < a.accuracy or b.accuracy == 1e-9
        if a.geometry == b.geometry:
            assert b.dt <= 0.5 * a.dt * (1 + 1e-12)
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
        ("stepper", "rk4_opposite"),
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


def test_the_opposite_stepper_is_used_where_it_is_stable():
    for scene in (preset("fig1"), preset("fig1", eta=30.0), small_rod(eta=0.0)):
        steppers = [one.stepper for one in of(scene) if one.dt]
        limits = [stability_limit(scene, name)[0] for name in ("rk4", "rk4_opposite")]
        if limits[1] > limits[0] / 8:
            assert all(a != b for a, b in itertools.pairwise(steppers))
    assert {one.stepper for one in of(preset("fig1"), switching="step_end") if one.dt} == {"rk4"}


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


# --- what is left out ----------------------------------------------------------------------------


def test_levels_that_cannot_run_say_why():
    scene = preset("fig1")
    assert left_out(scene, "quasistatic", want="front_speed") == "it has no front speed"
    assert "of the order of 0.01 F_N" in left_out(scene, "quasistatic", tolerance=0.009)
    soft = preset("fig1", d_c=1e-6)
    assert "friction falls too slowly" in left_out(soft, "quasistatic")
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
    """Its error is of the order of strains, which grow with the load."""
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
    """Without inertia and without rotation, within a factor of 4."""
    scene, how = preset(name, **changes), {"progress": False}
    static = simulate(scene, t_end, fidelity="quasistatic", **how)
    linear, finite = (
        simulate(scene, t_end, fidelity="hybrid", geometry=one, **how)
        for one in ("linear", "finite")
    )
    off = [pyfric.record.differences(a, finite).errors()["start"] for a in (static, linear)]
    assert STATIC / 4 < off[0] < 4 * STATIC
    assert rotation(scene) / 4 < off[1] < 4 * rotation(scene)


def test_which_level_is_made_alone():
    scene = preset("fig1")
    for tolerance, number in ((1.0, 0), (0.1, 0), (0.099, 1), (0.02, 1), (0.019, 2), (1e-6, 2)):
        found = every(scene, tolerance=tolerance)
        single = alone(found, tolerance)
        kinds = [("quasistatic", "linear"), ("hybrid", "linear"), ("hybrid", "finite")]
        assert (single.engine, single.geometry) == kinds[number]
    assert [number for _, number in ALONE] == [0, 1, 2]
    fronts = every(scene, tolerance=0.1, want="front_speed")
    assert alone(fronts, 0.1).geometry == "linear"


# --- steps ---------------------------------------------------------------------------------------


def first_step(scene, want, tolerance):
    return max(one.dt for one in of(scene, want=want, tolerance=tolerance) if one.dt)


def test_steps_follow_from_the_order_of_rk4():
    scene = small_rod()
    auto, error = step_size(scene), step_error(scene, "loading_curve", step_size(scene))
    longest = LONGEST * stability_limit(scene)[0]
    assert 0.9 * longest < first_step(scene, "loading_curve", 0.05) <= longest
    for tolerance in (1e-5, 1e-9):  # rounded down
        steps = (error / (SHARE * tolerance)) ** 0.25
        assert 0.9 * auto / steps < first_step(scene, "loading_curve", tolerance) <= auto / steps
    speeds = [first_step(scene, "front_speed", tolerance) for tolerance in (1e-3, 1e-3 / 16)]
    assert speeds[1] == pytest.approx(speeds[0] / 2, rel=0.1)


def test_steps_resolve_weakening_as_far_as_those_of_the_last_level_can():
    """A factor that falls to 0.9 over a speed v gives the growth rate mu_s p 0.1/(v m)."""
    scene = setup1(L=0.025, H=0.0125, h=5e-3, F_N=1290.0)
    auto = step_size(scene)
    free = LONGEST * stability_limit(scene)[0] / auto
    for wanted, expected in ((2, free), (0.5, 0.5), (0.46, 0.46), (0.12, free)):  # over auto
        v = 0.1 * 0.7 * scene.F_N / scene.N_x * wanted * auto / scene.m
        law = laws.SpeedDependent(v=(0.0, v), factor=(1.0, 0.9))
        found = first_step(scene.replace({"interface.law": law}), "precursors", 0.1)
        assert found == pytest.approx(expected * auto, rel=0.1), wanted
        assert found <= expected * auto * (1 + 1e-9)


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
    for eta in (1e-9, 1e-4):
        little = preset("fig1", eta=eta)
        assert step_error(little, "front_speed", step_size(little)) <= 1.0  # out of phase


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
    """Of the hybrid engine, from events of a quasi-static sequence, within a factor of three."""
    found = plan(scene, tolerance=tolerance, t_end=t_end)
    options = Options(tolerance=tolerance).on(scene)
    for level, seconds in zip(found.levels[1:3], found.seconds[1:3], strict=True):
        how = dataclasses.replace(level.options(options), tolerance=Options.tolerance)
        record = simulate(scene, t_end, how, progress=False)
        assert 1 / 3 < seconds / (work_so_far(record) * machine_speed()) < 3


def test_operations_with_shorter_steps():
    """Located transitions, points of the curve and attempts to jump stay as many."""
    scene = small_rod()
    blocks = scene.N_x * scene.N_z
    counts = {"steps": 100, "block_evaluations": 500 * blocks, "calls": 7, "landings": 3}
    found = finer_counts(scene, counts, 4)
    assert found == counts | {"steps": 400, "block_evaluations": 1700 * blocks}
    record = simulate(scene, 0.005, fidelity="dynamic", progress=False, verify="none")
    finer = simulate(scene, 0.005, fidelity="dynamic", dt=record.method.dt / 4, progress=False)
    expected = finer_counts(scene, record.counts, 4)
    assert work(scene, "finite", expected) == pytest.approx(work_so_far(finer), rel=0.1)


def test_work_of_dynamics():
    scene = small_rod()
    dt = step_size(scene)
    how = {"fidelity": "dynamic", "dt": dt, "sample": 2e-3 / 500}
    record = simulate(scene, 2e-3, progress=False, **how)
    made = full_work(scene, "finite", dt, 2e-3) - full_work(scene, "finite", 1, 0)
    assert work_so_far(record) == pytest.approx(made, rel=0.1)


def test_calls_of_the_core_for_motion_on_junctions_are_counted(monkeypatch):
    scene = preset("slow", L=0.02, H=0.0125)
    calls, advance, dt = [], core.advance, step_size(scene)
    monkeypatch.setattr(core, "advance", lambda *a, **how: calls.append(a) or advance(*a, **how))
    record = simulate(scene, 1e-3, fidelity="dynamic", dt=dt, progress=False, verify="none")
    expected = full_counts(scene, dt, 1e-3, calls=Options().calls_on(scene))
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
    """0.09 us in setup 2, however the engine is named; other methods take longer ones."""
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
    """Seven main events; steps are 12 times shorter than without viscosity."""
    scene = setup1(L="30 mm", H="15 mm", V=0.05)
    scene = scene.replace({"slider.eta": 10 * scene.eta})
    levels = plan(scene, t_end=0.03).levels
    level = next(level for level in levels if level.engine == "hybrid")
    how = {"fidelity": "hybrid", "geometry": level.geometry, "stepper": level.stepper}
    made = simulate(scene, 0.03, dt=level.dt, progress=False, **how)
    before = simulate(scene, 0.03, fidelity="quasistatic", progress=False)
    expected = plans.expected_work(scene, level, 0.03, before)
    assert 1 / 3 < expected / plans.work_done(made) < 3
