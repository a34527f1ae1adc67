"""The planner: every number it states, every level it takes, and that it never takes long."""

import dataclasses
import functools
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyfric.engines.ringdown import N_VALUES
from scipy import linalg

import pyfric
from pyfric.core import OPEN
from pyfric.engines import cost, decay_times, plan, planner, scout, simulate, step_size
from pyfric.engines.planner import STRAIN, largest_strain
from pyfric.engines.quasistatic import QuasistaticRun
from pyfric.engines.scout import coarser
from pyfric.record import build_catalogue
from pyfric.scene import SceneError, chain, preset, setup1, setup2
from pyfric.statics import StaticSolver, damping, mass, stability_limit

WANTS = ("loading_curve", "precursors", "stress", "front_speed", "motion")
WAITS = "slowest decay over time between main events"
RESTS = "decay of fast modes over time between main events"


def small(**changes):
    """A scene with 10 main events in its first 1.5 s."""
    return setup1(**{"L": 0.03, "H": 0.015} | changes)


@functools.cache
def ladder(scene, t_end):
    """Return the run of the ladder to t_end and its record."""
    run = QuasistaticRun(scene)
    run.advance(t_end, lambda: False, lambda *_: None)
    return run, run.record("complete")


def interval(record):
    """Return the median time between main events that are not merged."""
    logs = record.switches, record.quiet, record.scene
    events = build_catalogue(*logs, t_gap=0.0).events
    return np.median(np.diff(events["t_start"][events["is_main"]]))


def value(found, name):
    (one,) = [one for one in found.assumptions if one.name == name]
    assert one.holds
    return one.value


# --- levels --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "expected"),
    [
        (0.1, ("quasistatic", "linear", None, None)),
        (0.08, ("hybrid", "linear", "located", 7.8e-7)),
        (0.06, ("hybrid", "finite", "located", 7.8e-7)),
        (0.01, ("hybrid", "finite", "located", 7.8e-7)),
        (4e-4, ("hybrid", "finite", "located", 7.8e-7)),
        (1e-4, ("dynamic", "finite", "located", 7.8e-7)),
        (1e-6, ("dynamic", "finite", "located", 2.7e-7)),
    ],
)
def test_levels_of_the_fig1_scene(tolerance, expected):
    found = plan(preset("fig1"), "loading_curve", tolerance, t_end=0.9)
    assert (found.fidelity, found.geometry, found.switching, found.dt) == expected
    assert found.error <= tolerance
    assert all(one.holds for one in found.assumptions)
    assert len(found.reasons) == {"quasistatic": 0, "hybrid": 1, "dynamic": 2}[found.fidelity] + (
        found.geometry == "finite"
    )


def test_what_is_wanted():
    scene = small()
    how = {want: plan(scene, want, 0.1, t_end=0.7) for want in WANTS}
    for want in ("loading_curve", "precursors", "stress"):
        assert how[want].fidelity == "quasistatic"
    front, motion = how["front_speed"], how["motion"]
    assert (front.fidelity, motion.fidelity) == ("hybrid", "dynamic")
    assert "quasistatic: it has no front speed" in front.reasons
    assert "quasistatic: it has no motion" in motion.reasons
    assert any("fast motion" in reason for reason in motion.reasons)
    assert front.dt == motion.dt == step_size(scene)
    assert front.switching == motion.switching == "located"


def test_steps_follow_from_the_orders_of_the_methods():
    """Switches are located, so that errors are of the order of the stepper, four."""
    scene = small()
    found = {tol: plan(scene, "stress", tol, t_end=0.7) for tol in (1e-2, 1e-3, 1e-5, 1e-9)}
    assert {one.switching for one in found.values()} == {"located"}
    auto = step_size(scene)
    assert found[1e-2].dt == found[1e-3].dt == auto
    error = planner.step_error(scene, "stress", auto, 0.7)
    for tolerance in (1e-5, 1e-9):  # rounded down to two digits
        steps = (2 * error / tolerance) ** 0.25
        assert 0.9 * auto / steps < found[tolerance].dt <= auto / steps
    speeds = [plan(scene, "front_speed", tol, t_end=0.7).dt for tol in (1e-3, 1e-3 / 16)]
    assert speeds[1] == pytest.approx(speeds[0] / 2, rel=0.1)


@settings(max_examples=20)
@given(
    want=st.sampled_from(WANTS),
    tolerance=st.floats(1e-6, 1.0),
    t_end=st.sampled_from([0.0, 1e-30, 1e30]) | st.floats(1e-9, 5.0),
)
def test_any_question(want, tolerance, t_end):
    found = plan(setup2(L=0.012, H=0.004), want, tolerance, t_end=t_end)
    assert all(one.holds for one in found.assumptions)
    assert 0 < found.error <= tolerance
    assert np.isfinite([found.evaluations, found.seconds]).all()
    assert found.evaluations >= 0
    if found.dt is not None:
        assert 0 < found.dt <= step_size(setup2(L=0.012, H=0.004))
    assert "nan" not in str(found)
    if found.fidelity != "quasistatic":
        assert any(reason.startswith("quasistatic: ") for reason in found.reasons)
    if found.fidelity == "dynamic":
        assert any(reason.startswith("hybrid: ") for reason in found.reasons)


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


# --- numbers -------------------------------------------------------------------------------------


def spectrum(scene):
    """Return all eigenvalues of the stuck slider from dense matrices."""
    K, _, free = StaticSolver(scene, "linear").tangent(np.ones(scene.N_x, dtype=bool))
    K, C = K[free][:, free].toarray(), damping(scene)[free][:, free].toarray()
    M, n = mass(scene)[free], len(free)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / M[:, None], -C / M[:, None]]])
    return linalg.eigvals(A)


@pytest.mark.parametrize("scene", [small(), small(eta=1e-3), setup2(L=0.012, H=0.004)])
def test_decay_times_are_those_of_the_full_spectrum(scene):
    rates = spectrum(scene)
    times = decay_times(scene)
    assert 1 / times.slow == pytest.approx(np.min(-rates.real), rel=1e-3)
    # What is not followed decays at least as stated.
    order = np.sort(np.abs(rates))
    rest = rates[np.abs(rates) > order[N_VALUES - 1] * (1 + 1e-9)]
    assert times.fast >= 1 / np.min(-rest.real) * (1 - 1e-6)


def test_decay_times_without_viscosity():
    assert decay_times(small(eta=0.0)) == (math.inf, math.inf)
    assert decay_times(chain(eta=0.0)) == (0.0, 0.0)  # blocks that stick do not move


@pytest.mark.parametrize("eta", [1e-6, 1e-3])
def test_hardly_damped_modes_are_found_quickly(eta):
    start = time.process_time()
    slow = decay_times(preset("fig1", eta=eta)).slow
    assert time.process_time() - start < 10  # 0.3 s on a machine that does nothing else
    assert slow * eta == pytest.approx(decay_times(preset("fig1", eta=0.1)).slow * 0.1, rel=0.01)


def test_quasistatic_statements():
    scene, t_end = small(), 1.5
    found = plan(scene, tolerance=0.1, t_end=t_end)
    run, record = ladder(scene, t_end)
    assert found.fidelity == "quasistatic"
    expected = decay_times(scene).slow / interval(record)
    assert value(found, WAITS) == pytest.approx(expected, rel=1e-12)
    assert value(found, "open blocks") == (record.quiet["mode"] == OPEN).sum(axis=1).max()
    assert value(found, "eta/sqrt(k m)") == pytest.approx(math.sqrt(0.1))
    F_max = max(F for _, F in run.rows)
    assert value(found, STRAIN) == largest_strain(scene, F_max)
    events = record.events
    whole = events[events["is_main"] & (events["n_blocks"] == scene.N_x)]
    drop = (whole["F_T_start"] - whole["F_T_arrest"]).max() / scene.F_N
    assert drop > planner.ERROR_QUASISTATIC
    assert found.error == pytest.approx(drop + value(found, STRAIN), rel=1e-12)


def test_hybrid_statements():
    scene = small()
    found = plan(scene, t_end=1.5)
    assert found.fidelity == "hybrid"
    expected = decay_times(scene).fast / interval(ladder(scene, 1.5)[1])
    assert value(found, RESTS) == pytest.approx(expected, rel=1e-12)
    limit = stability_limit(scene)[0]
    assert value(found, "dt over the stability limit") == step_size(scene) / limit
    strain = largest_strain(scene, max(F for _, F in ladder(scene, 1.5)[0].rows))
    assert any(f"largest strain: {strain:.3g} >  0.005" in reason for reason in found.reasons)
    steps = planner.step_error(scene, "precursors", found.dt, interval(ladder(scene, 1.5)[1]))
    assert found.error == pytest.approx(steps + planner.ERROR_JUMPS)


def test_errors_of_steps_are_those_of_one_block():
    """Phase of RK4: per step (omega dt)^5/120; the force of one block; half a period, undamped."""
    scene = chain(L=0.03, eta=0.0, k_top=3e6, mu_s=0.6, mu_k=0.4)
    omega = math.sqrt((2 * scene.slider.k + 3e6 + scene.driver.K) / scene.m)
    dt, lasts = 0.3 / omega, math.pi / omega
    z = 0.3j
    grown = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    phase = abs(np.angle(grown) - 0.3) * lasts / dt
    assert planner.step_error(scene, "front_speed", dt, lasts) == pytest.approx(phase, rel=0.1)
    force = planner.step_error(scene, "stress", dt, lasts)
    assert force == pytest.approx(0.2 * phase / scene.N_x, rel=0.1)
    damped = dataclasses.replace(scene, slider=dataclasses.replace(scene.slider, eta=1e5))
    assert planner.step_error(damped, "stress", dt, lasts) < 0.1 * force


@pytest.mark.parametrize("scene", [preset("fig1"), setup2(), small()])
def test_largest_strain_is_that_of_the_bonds(scene):
    F_T = 0.4 * scene.F_N
    solver = StaticSolver(scene, "linear")
    held = solver.loaded.u[0, 0]
    first = solver.solve(held, 0.0).F_T
    rate = solver.solve(held, 1e-3).F_T - first
    u = solver.solve(held, 1e-3 * F_T / rate).u - solver.loaded.u
    l = scene.slider.l
    diagonal = [
        ((u[1:, 0, 1:] - u[:-1, 0, :-1]) + (u[1:, 1, 1:] - u[:-1, 1, :-1])) / (2 * l),
        ((u[1:, 0, :-1] - u[:-1, 0, 1:]) - (u[1:, 1, :-1] - u[:-1, 1, 1:])) / (2 * l),
    ]
    strains = [np.diff(u[:, 0], axis=1) / l, np.diff(u[:, 1], axis=0) / l, *diagonal]
    measured = max(np.abs(one).max() for one in strains)
    assert measured == pytest.approx(largest_strain(scene, F_T), rel=0.35)


def test_load_alone_strains_too():
    assert largest_strain(small(), 0.0) == pytest.approx(3500 / 13 / (13.5e6 * 2.5e-3))


def test_loads_that_grow_strain_by_the_most_they_reach():
    scene, free = small(), setup2(L=0.02, H=0.006)
    grows = dataclasses.replace(scene.top, protocol=((1.0, 3 * scene.F_N), (2.0, scene.F_N)))
    grows = dataclasses.replace(scene, top=grows)
    alone = largest_strain(scene, 0.0)
    for t_end, times in ((0.0, 1), (0.5, 2), (1.0, 3), (3.0, 3)):
        assert largest_strain(grows, 0.0, t_end) == pytest.approx(times * alone)
    sheared = dataclasses.replace(free.top, T_protocol=((1.0, -2 * free.F_N),))
    sheared = dataclasses.replace(free, top=sheared)
    assert largest_strain(sheared, 0.0) == pytest.approx(2 * largest_strain(free, 0.0))
    limit = 1.5 * alone  # between what the load comes to at 0.1 s and at 1 s
    short, long = (plan(grows, tolerance=2 * limit, t_end=t_end) for t_end in (0.1, 1.0))
    assert short.geometry == "linear"
    assert long.geometry == "finite"


@pytest.mark.parametrize(
    ("scene", "t_end", "tolerance", "geometry"),
    [
        (preset("fig1"), 0.45, 0.01, "finite"),
        (setup2(), 0.5, 0.05, "linear"),
        (chain(), 0.3, 0.01, "linear"),
        (setup1(l=5e-3, h=5e-3, eta=7.4), 0.66, 0.05, "linear"),  # half of its default
    ],
)
def test_expected_cost(scene, t_end, tolerance, geometry):
    found = plan(scene, tolerance=tolerance, t_end=t_end)
    assert (found.fidelity, found.geometry) == ("hybrid", geometry)
    how = {"geometry": geometry, "switching": found.switching}
    record = pyfric.simulate(scene, t_end, fidelity="hybrid", **how)
    assert 1 / 2 < found.evaluations / record.counts["block_evaluations"] < 2


def test_expected_cost_of_dynamics():
    found = plan(small(), "motion", t_end=2e-3)
    record = pyfric.simulate(small(), 2e-3, fidelity="dynamic", geometry="linear")
    assert found.evaluations == pytest.approx(record.counts["block_evaluations"], rel=1e-3)


# --- levels that are passed over -----------------------------------------------------------------


def passed_over(level, found):
    return " ".join(reason for reason in found.reasons if reason.startswith(level))


def test_high_speed():
    """The plan passes over levels as V shortens the time between events below the ring-down."""
    waits = [plan(small(V=V), tolerance=0.1, t_end=0.8e-3 / V) for V in (1e-3, 0.02, 0.1, 10.0)]
    assert [one.fidelity for one in waits] == ["quasistatic", "hybrid", "hybrid", "dynamic"]
    for one in waits[1:]:
        assert WAITS in passed_over("quasistatic", one)
    assert RESTS in passed_over("hybrid", waits[-1])


def test_events_closer_than_t_gap_count():
    """At high V all events are one in the catalogue, which is not a long time between events."""
    scene, t_end = small(V=0.1), 0.02
    _, record = ladder(scene, t_end)
    assert record.events["is_main"].sum() < 3
    assert WAITS in passed_over("quasistatic", plan(scene, tolerance=0.1, t_end=t_end))


def test_open_blocks():
    found = plan(setup2(theta=0.833), tolerance=0.2, t_end=0.5)
    assert found.fidelity == "hybrid"
    assert "open blocks: " in passed_over("quasistatic", found)
    early = plan(setup2(theta=0.833), tolerance=0.2, t_end=0.05)
    assert value(early, "open blocks") == 0


def test_little_viscosity():
    for eta in (0.0, 1e-6):
        found = plan(small(eta=eta), tolerance=0.1, t_end=1.5)
        assert found.fidelity == "dynamic"
        assert WAITS in passed_over("quasistatic", found)
        assert RESTS in passed_over("hybrid", found)


def test_too_much_viscosity():
    found = plan(small(eta=40.0), tolerance=0.1, t_end=1.5)
    assert found.fidelity == "hybrid"
    assert "eta/sqrt(k m): 0.816 >  0.433" in passed_over("quasistatic", found)


def test_large_strains():
    for F_N, geometry in ((350.0, "linear"), (3500.0, "finite")):
        scene = small(F_N=F_N, V=0.7875e-3 * F_N / 3500)  # similar in linear geometry
        assert plan(scene, tolerance=0.02, t_end=0.7).geometry == geometry
    found = plan(small(F_N=35e3), tolerance=0.1, t_end=7.0)
    assert (found.fidelity, found.geometry) == ("hybrid", "finite")
    assert STRAIN in passed_over("linear geometry", found)


def test_very_many_events():
    found = plan(chain(p=tuple(np.linspace(0.01, 100, 57))), tolerance=0.5, t_end=1.0)
    assert found.fidelity == "hybrid"
    assert "events up to t_end" in passed_over("quasistatic", found)


def test_nothing_happens():
    for scene, t_end in ((small(), 0.0), (small(V=0.0), 1.0), (small(K=1.0), 1.0)):
        found = plan(scene, tolerance=0.1, t_end=t_end)
        assert (found.fidelity, value(found, WAITS)) == ("quasistatic", 0.0)


# --- large lattices ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene", [setup1(l=0.25e-3), setup1(l=0.5e-3, side="right", h=0.01, eta=2.0), setup2(l=0.2e-3)]
)
def test_coarser_keeps_the_slider(scene):
    less = coarser(scene)
    assert less.N_x * less.N_z <= scout.SCOUT_BLOCKS
    for name in ("L", "H", "M", "k"):
        assert getattr(less.slider, name) == getattr(scene.slider, name)
    assert less.eta == scene.eta
    assert (less.driver, less.interface, less.top) == (scene.driver, scene.interface, scene.top)
    assert coarser(less) is less


def test_coarser_takes_the_least_whole_factor_that_will_do():
    assert coarser(setup1(l=1.25e-3)).slider.l == 2.5e-3


def test_coarser_where_no_blocks_fit():
    scene = setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4)  # 1009 and 199 are primes
    less = coarser(scene)
    assert less.N_x * less.N_z <= scout.SCOUT_BLOCKS
    assert (less.slider.L, less.eta) == (scene.slider.L, scene.eta)
    assert less.slider.H == pytest.approx(scene.slider.H, abs=less.slider.l)
    assert less.driver.h == pytest.approx(scene.driver.h, abs=less.slider.l)


@pytest.mark.parametrize("side", ["left", "right"])
def test_coarser_chain_is_the_same_rod(side):
    n = 2001
    p = tuple(np.linspace(0.5, 2.5, n))
    tau = tuple(0.7 * np.array(p) * np.linspace(-1, 1, n))
    scene = chain(L=0.2, l=1e-4, p=p, tau=tau, k_top=1e3, side=side)
    less = coarser(scene)
    assert less.N_x == scout.SCOUT_COLUMNS
    assert less.slider.L == scene.slider.L
    for make in (
        lambda s: s.slider.k * s.slider.l,
        lambda s: s.eta * s.slider.l,
        lambda s: s.top.k_top / s.slider.l,
        lambda s: s.F_N,
        lambda s: s.shear.sum(),
    ):
        assert make(less) == pytest.approx(make(scene), rel=0.01)
    assert np.sign(less.load[0] - less.load[-1]) == np.sign(scene.load[0] - scene.load[-1])


@pytest.mark.parametrize(
    "scene",
    [setup1(l=0.25e-3), setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4), chain(L=1.0, l=1e-4)],
    ids=["fits", "primes", "chain"],
)
def test_planning_is_quick_on_large_lattices(scene):
    start = time.process_time()
    found = plan(scene, t_end=0.5)
    assert time.process_time() - start < 20  # 1 to 3 s
    assert found.dt <= stability_limit(scene)[0]


# --- text ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "want", "left_out"),
    [
        (0.1, "stress", "inertia, waves, ring-down; rotation of bonds"),
        (0.075, "stress", "what ring-down leaves of fast modes; rotation of bonds"),
        (0.01, "stress", "what ring-down leaves of fast modes"),
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
        assert str(one).startswith(f"{one.name}: {one.value:.3g} <= {one.limit:.3g}")
    for reason in found.reasons:
        assert f"not less: {reason}" in lines
    assert f"expected error: {found.error:.2g}" in lines
    assert lines[-2].startswith(f"expected cost: {found.evaluations:.2g} block evaluations")
    assert lines[-1].startswith(f"verification: about {found.price:.2g} s more")


def test_a_chain_has_no_rotation_to_leave_out():
    assert "rotation" not in str(plan(chain(), tolerance=0.1, t_end=0.1))


def test_a_plan_is_checked_against_its_record():
    found = plan(small(), tolerance=0.1, t_end=1.0)
    record = pyfric.simulate(small(), 1.0, fidelity="quasistatic")
    assert found.check(record) == []
    narrow = dataclasses.replace(found, tolerance=1e-3)
    (failed,) = narrow.check(record)
    assert failed.name == STRAIN
    assert failed.value == largest_strain(small(), record.curve["F_T"].abs().max())


# --- size ----------------------------------------------------------------------------------------

MEASURED = {2.5e-3: 0.17, 1.25e-3: 0.49, 0.625e-3: 1.9, 0.5e-3: 4.0}
"""l (m) -> processor time of a hybrid run in linear geometry that has no event yet, s, measured at
`pace() == 1`."""


@pytest.mark.parametrize("l", MEASURED)
def test_what_comes_before_the_first_step(l, monkeypatch):
    monkeypatch.setattr(cost, "pace", lambda: 1.0)
    found = cost.set_up(preset("fig1", l=l), "hybrid", "linear").seconds
    assert MEASURED[l] / 2 < found < 2 * MEASURED[l]


def test_more_memory_than_there_is_is_refused_with_both_numbers(monkeypatch):
    monkeypatch.setattr(cost, "available", lambda: 2e9)
    monkeypatch.setattr(StaticSolver, "__init__", None)  # refused before anything is factorised
    for how in ({"fidelity": "hybrid"}, {"fidelity": "dynamic"}):
        with pytest.raises(SceneError, match=r"there is, 2 GB") as refused:
            simulate(preset("fig1", l=0.1e-3, h=5e-3), 0.1, progress=False, **how)
        assert refused.value.field == "slider.l"
        assert "GB are needed (1401 x 751 blocks" in str(refused.value)


def test_more_than_ten_minutes_is_said_with_the_cheaper_way(monkeypatch, capsys):
    monkeypatch.setattr(planner, "LONG", 1e-3)
    scene = small()
    record = simulate(scene, 1e-3, fidelity="dynamic", geometry="finite", progress=False)
    assert "minutes on one core; the hybrid engine in linear geometry takes" in record.notes[-1]
    assert capsys.readouterr().err == ""
    record = simulate(scene, 1e-3, fidelity="hybrid", geometry="linear")
    assert "larger blocks take less" in record.notes[-1]
    assert record.notes[-1] in capsys.readouterr().err
    monkeypatch.setattr(planner, "LONG", 600.0)
    assert not simulate(scene, 1e-4, fidelity="dynamic", progress=False).notes
