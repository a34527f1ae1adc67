"""Loading protocols: their files, their pieces, and runs that follow them."""

import dataclasses
import functools
import itertools

import numpy as np
import pandas as pd
import pytest
from helpers import bits, budget_error, refused, same_run, small
from scipy.integrate import solve_ivp

import pyfric
from pyfric import core
from pyfric.engines.grid import just_after
from pyfric.engines.guarded import GuardedSteps
from pyfric.scene import Scene, chain, setup1, setup2

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", switching="located")

STEPS = ((1e-4, 0.3), (1e-4, 0.0), (2.3e-4, 0.0), (3e-4, -0.4), (4.1e-4, -0.4), (4.1e-4, 0.2))
"""A ramp, a jump to a hold, a ramp to a reversal, and a jump back, off the grid of steps."""


def driven(scene, protocol, **changes):
    driver = dataclasses.replace(scene.driver, protocol=protocol, **changes)
    return dataclasses.replace(scene, driver=driver)


def loaded(scene, **changes):
    return dataclasses.replace(scene, top=dataclasses.replace(scene.top, **changes))


# --- measured protocols --------------------------------------------------------------------------


@pytest.mark.parametrize("error", [1e-7, 1e-6, 1e-5])
def test_a_measured_speed_is_thinned_within_an_error(error):
    rng, t = np.random.default_rng(0), np.linspace(0.0, 3.0, 3000)
    v = 1e-4 * (1 + np.sin(2 * t) + (t > 1.3)) + 1e-8 * rng.standard_normal(t.size)
    kept = np.array(pyfric.thinned(np.column_stack([t, v]), error))
    assert np.abs(np.interp(t, *kept.T) - v).max() <= error
    assert {tuple(pair) for pair in kept} <= set(zip(t.tolist(), v.tolist(), strict=True))
    assert 4 <= len(kept) < 300
    fewer = len(pyfric.thinned(kept, 2 * error))
    assert fewer < len(kept)
    assert pyfric.thinned(kept, f"{error * 1e6:g} um/s") == pyfric.thinned(kept, error)


def test_jumps_are_kept_as_they_are():
    pairs = [(0, 1e-3), (0.5, 1e-3), (1, 1e-3), (1, 0), (2, 0), (3, 0), (3, 2e-3), (4, 2e-3)]
    assert pyfric.thinned(pairs, 1e-9) == (
        *((0.0, 1e-3), (1.0, 1e-3), (1.0, 0.0), (3.0, 0.0), (3.0, 2e-3), (4.0, 2e-3)),
    )


def test_too_many_breakpoints_are_refused_with_what_thins_them():
    t = np.linspace(0.0, 1.0, 3000)
    pairs = np.column_stack([t, 0.1 * np.abs(np.sin(t))])
    said = "3000: too many; allowed: at most 1000 pairs; pyfric.thinned(pairs, error)"
    refused(lambda: small().replace({"driver.protocol": pairs}), "driver.protocol", said)
    run = small().replace({"driver.protocol": pyfric.thinned(pairs, 1e-4)})
    assert run.drive(1.0) == pytest.approx(0.1 * (1 - np.cos(1.0)), abs=1e-4)
    assert pyfric.thinned(pairs, "2 mN") == pyfric.thinned(pairs, 2e-3)
    refused(lambda: pyfric.thinned(pairs, 0.0), "error")
    refused(lambda: pyfric.thinned(pairs, "1 um"), "error", "for a speed, or N for a load")
    refused(lambda: pyfric.thinned(pairs[::-1], 1.0), "corners", "in order of time")
    refused(lambda: pyfric.thinned([(0, "a")], 1.0), "corners", "list")
    refused(lambda: pyfric.thinned([], 1.0), "corners")
    refused(lambda: small().replace({"top.push": [(1, 1.0)] * 1001}), "top.push", "at most 1000")


# --- going on under another protocol -------------------------------------------------------------

V, T = 0.2, 4e-3
"""Speed, and end of the first part. The second part has the same length."""
AS_FAR = 4.0
"""Path of the driver, over that in the quasi-static sequence."""
OTHERS = {
    "a tenth": {"driver.V": 0.1 * V},
    "twice": {"driver.V": 2 * V},
    "held": {"driver.V": 0.0},
    "back": {"driver.protocol": ((0.0, V), (0.0, -V))},
    "later faster": {"driver.protocol": ((2.2 * T, V), (2.2 * T, 2 * V))},
    "less load": {"top.F_N": 300.0},
    "a ramp": {"top.protocol": ((T, 400.0), (2 * T, 350.0))},
}


@functools.cache
def first_part(fidelity):
    """Return a run up to T: fast or, for the sequence, slow and a quarter as far."""
    slow = 1e4 if fidelity == "quasistatic" else 1
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=V / (AS_FAR * slow if slow > 1 else 1))
    how = {} if slow > 1 else {"geometry": "linear"}
    if fidelity == "hybrid":  # the two runs jump at different steps, with the accuracy of jumps
        how["accuracy"] = 1e-9
    return slow, pyfric.simulate(scene, T * slow, fidelity=fidelity, progress=False, **how)


def slowed(change, slow):
    """Return a change of the protocol for a run that takes `slow` times as long."""
    name, value = change
    speed = AS_FAR * slow if slow > 1 else 1
    if name == "driver.V":
        return {name: value / speed}
    if isinstance(value, tuple):
        return {name: tuple((t * slow, y / speed if "driver" in name else y) for t, y in value)}
    return {name: value}


def at_once(scene, new, t):
    """Return by hand the scene that changes into another one."""
    V, F_N = new.piece("V", t).at(t), new.piece("F_N", t).at(t)
    top, driver = ([one for one in p.protocol if one[0] > t] for p in (new.top, new.driver))
    old = scene.driver.V, scene.F_N
    speeds = () if (V, driver) == (old[0], []) else ((t, old[0]), (t, V), *driver)
    loads = () if (F_N, top) == (old[1], []) else ((t, old[1]), (t, F_N), *top)
    return scene.replace({"driver.protocol": speeds, "top.protocol": loads})


RUNS = [*(("hybrid", what) for what in OTHERS), ("dynamic", "back"), ("dynamic", "a ramp")]


@pytest.mark.usefixtures("coarse_curves")
@pytest.mark.parametrize(
    ("fidelity", "what"), [*RUNS, *(("quasistatic", one) for one in ("twice", "back", "a ramp"))]
)
def test_a_record_that_goes_on_is_one_run_with_both_protocols(fidelity, what):
    slow, before = first_part(fidelity)
    scene, t = before.scene, float(before.curve["t"].iloc[-1])
    new = scene.replace(slowed(*OTHERS[what].items(), slow))
    goes_on = pyfric.simulate(new, 2 * T * slow, initial=before, progress=False)
    how = {"sample": before.method.sample * before.method.dt} if slow == 1 else {}
    how |= {"fidelity": fidelity, "geometry": "linear", "progress": False}
    how |= {"accuracy": before.method.accuracy} if fidelity == "hybrid" else {}
    one = pyfric.simulate(at_once(scene, new, t), 2 * T * slow, **how)
    assert goes_on.scene == one.scene
    assert len(one.events) > len(before.events) or what != "twice"
    starts = goes_on.events["t_start"], one.events["t_start"]
    np.testing.assert_allclose(*starts, rtol=1e-9, atol=0)
    np.testing.assert_allclose(goes_on.curve["t"], one.curve["t"], rtol=1e-12, atol=0)
    np.testing.assert_allclose(goes_on.curve["F_T"], one.curve["F_T"], atol=1e-9 * 400.0, rtol=0)
    if fidelity != "quasistatic":
        n = len(before.curve)
        pd.testing.assert_frame_equal(goes_on.curve[: n - 1], before.curve[: n - 1])
    if what != "later faster":
        assert any("goes on from t = " in note for note in goes_on.notes)
    again = pyfric.simulate(new, 2.1 * T * slow, initial=goes_on, progress=False)
    assert again.scene == goes_on.scene


def test_a_later_protocol_is_not_noted_as_another_speed():
    scene = small(V=1e-2)
    how = {"fidelity": "quasistatic", "progress": False}
    before = pyfric.simulate(scene, 1e-3, **how)
    new = scene.replace({"driver.protocol": ((2e-3, 1e-2), (2e-3, 0.0))})
    notes = pyfric.simulate(new, 3e-3, initial=before, **how).notes
    assert "goes on from t = 0.001 s with another driver.protocol" in notes


@pytest.mark.parametrize(("fidelity", "what"), [run for run in RUNS if "load" not in run[1]])
def test_a_state_keeps_the_place_of_its_driver(fidelity, what, tmp_path):
    _, before = first_part(fidelity)
    new = before.scene.replace(OTHERS[what])
    how = {"fidelity": fidelity, "geometry": "linear", "progress": False}
    how |= {"accuracy": before.method.accuracy} if fidelity == "hybrid" else {}
    record = pyfric.simulate(new, 2 * T, initial=before, progress=False)
    before.final_state.save(tmp_path / "state.npz")
    state = pyfric.State.load(tmp_path / "state.npz")
    from_state = pyfric.simulate(new, 2 * T, initial=state, **how)
    F_T = [run.curve["F_T"].to_numpy() for run in (before, from_state, record)]
    assert abs(F_T[1][0] - F_T[0][-1]) <= 1e-9 * 400.0
    assert abs(F_T[1][-1] - F_T[2][-1]) <= 1e-9 * 400.0
    further = pyfric.simulate(
        before.scene, 2.01 * T, initial=from_state.final_state.with_dt(1e-7), **how
    )
    assert abs(further.curve["F_T"].iloc[0] - F_T[1][-1]) <= 1e-9 * 400.0


def test_the_core_moves_the_driver():
    scene = driven(small(), STEPS)
    state = pyfric.statics.loaded_state(scene).state(scene, 1e-7)
    log, far = pyfric.core.Log(scene.N_x), []
    for _ in range(50):  # corners are at whole calls
        model = pyfric.core.model(scene, "linear", state.u_drv0, state.t + 1e-12)
        pyfric.core.advance(model, state, log, 100)
        assert state.drive == pytest.approx(scene.drive(state.t), rel=1e-14, abs=1e-20)
        far.append(state.drive)
    assert max(far) > 2e-5


def test_only_protocols_may_be_others():
    _, before = first_part("dynamic")
    for name, value in {"mu_k": 0.1, "driver.K": 3e6, "mass": 0.1, "eta": 1.0}.items():
        with pytest.raises(pyfric.StateError, match="another scene"):
            pyfric.simulate(before.scene.replace({name: value}), 2 * T, initial=before)
    named = pyfric.simulate(
        before.scene.replace(name="so"), 1.1 * T, initial=before, progress=False
    )
    assert named.scene == before.scene.replace(name="so")
    assert not any("goes on" in note for note in named.notes)


# --- scenes --------------------------------------------------------------------------------------


def test_files_hold_corners_with_units():
    scene = loaded(
        driven(setup2(), STEPS),
        protocol=((0.1, 500.0),),
        T=3.0,
        T_protocol=((0.0, 1.0), (1.0, 2.0)),
    )
    text = scene.to_toml()
    assert '"0.0001 s"' in text
    assert Scene.from_toml(text) == scene
    assert Scene.from_toml(text.replace('"0.0001 s"', '"100 us"')) == scene
    assert "protocol" not in setup2().to_toml()


@pytest.mark.parametrize(
    ("protocol", "texts"),
    [
        (((2.0, 1.0), (1.0, 1.0)), ["corner 2: out of order", ">= 2.0 s, the time of corner 1"]),
        (((-1.0, 1.0),), ["corner 1: too small", "-1.0 s"]),
        (((1.0, np.inf),), ["corner 1", "m/s"]),
        (((1.0, 1.0),) * 3, ["corner 3: two corners are at this time already"]),
        (((1.0, 1.0, 1.0),), ["corner 1: not a pair"]),
        (7.0, ["not a list of pairs"]),
        (((1.0, 1.0),) * 1001, ["1001: too many", "at most 1000"]),
    ],
)
def test_refused_protocols(protocol, texts):
    refused(lambda: driven(setup2(), protocol), "driver.protocol", *texts)


def test_forces_stay_positive_and_static_states_go_straight():
    refused(lambda: loaded(setup2(), protocol=((1.0, 0.0),)), "top.protocol", "corner 1", "> 0 N")
    both = loaded(driven(setup2(), ((1.0, 1e-3),)), protocol=((0.5, 500.0),))
    for fidelity in ("quasistatic", "equilibrium"):
        refused(
            lambda f=fidelity: pyfric.simulate(both, 1e-3, fidelity=f),
            "driver.protocol",
            "from 0 s on speed and load change",
        )
    refused(lambda: pyfric.prediction_curve(both), "driver.protocol")


def test_plans_follow_protocols():
    scene = loaded(setup1(L=0.02, H=0.0125, F_N=400.0, V=4e-5), protocol=((0.8, 300.0),))
    assert pyfric.plan(scene, tolerance=0.5, t_end=2.0).alone.engine == "quasistatic"
    both = pyfric.plan(driven(scene, ((0.5, 8e-5),)), tolerance=0.5, t_end=2.0)
    assert both.alone.engine == "hybrid"
    assert "speed and load change" in both.levels[0].cannot


def test_the_driver_is_where_the_integral_of_its_speed_is():
    scene = driven(setup2(V=0.1), STEPS)
    times = np.linspace(0, 6e-4, 60_001)
    corners = [(0.0, 0.1), *STEPS, (1.0, 0.2)]
    speed = np.zeros_like(times)
    for (t_0, v_0), (t_1, v_1) in itertools.pairwise(corners):
        here = (times >= t_0) & (times < t_1)
        speed[here] = v_0 + (v_1 - v_0) * (times[here] - t_0) / max(t_1 - t_0, 1e-30)
    steps = np.diff(times)
    expected = np.concatenate([[0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * steps)])
    found = [scene.drive(t) for t in times]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * 0.4)
    assert setup2(V=0.1).drive(0.3) == 0.1 * 0.3


# --- runs ----------------------------------------------------------------------------------------


def one_block(protocol, V=0.5):
    """Return a chain whose first block alone can slip: k and eta to a wall, K to the driver."""
    scene = chain(
        L=5e-3, p=(50.0, 1e9, 1e9), k=2e6, M=3e-3, K=4e6, V=V, eta=3.0, mu_s=0.7, mu_k=0.45
    )
    return driven(scene, protocol)


def by_solve_ivp(scene, t_end):
    """Return switch times of the block, and its final position, by DOP853 with events."""
    m, k, K, eta = scene.m, scene.slider.k, scene.driver.K, scene.eta
    hold, slide = 0.7 * 50.0, 0.45 * 50.0
    grid = [0.0, *sorted({t for t, _ in scene.driver.protocol if t < t_end}), t_end]
    u, v, mode, found = 0.0, 0.0, 0, []
    corners = [(0.0, scene.driver.V), *scene.driver.protocol]

    def rest(t, u, v):
        return K * (drive(t) - u) - k * u - eta * v

    def drive(t):
        last = max(j for j, (t_j, _) in enumerate(corners) if t_j <= t)
        X = sum(
            0.5 * (a[1] + b[1]) * (b[0] - a[0]) for a, b in itertools.pairwise(corners[: last + 1])
        )
        (t_0, V_0), after = corners[last], corners[last + 1 : last + 2]
        a = (after[0][1] - V_0) / (after[0][0] - t_0) if after else 0.0
        return X + V_0 * (t - t_0) + 0.5 * a * (t - t_0) ** 2

    for begin, end in itertools.pairwise(grid):
        t = begin
        while t < end - 1e-15:

            def slope(t, y, mode=mode):
                return [y[1], (rest(t, *y) - mode * slide) / m] if mode else [0.0, 0.0]

            def over(t, y, mode=mode):
                return mode * y[1] if mode else hold - abs(rest(t, y[0], 0.0))

            over.terminal, over.direction = True, -1
            done = solve_ivp(
                slope, (t, end), [u, v], "DOP853", events=over, rtol=1e-12, atol=1e-16,
                max_step=2e-6, first_step=1e-8,
            )  # fmt: skip
            t, (u, v) = done.t[-1], done.y[:, -1]
            if done.status != 1:
                break
            force = rest(t, u, 0.0)
            mode = 0 if mode and abs(force) <= hold else int(np.sign(force))
            v = 0.0
            found.append(t)
    return np.array(found), u


def test_one_block_moves_as_solve_ivp_says():
    scene = one_block(STEPS)
    record = simulate(scene, 6e-4, dt=2e-7)
    times, u = by_solve_ivp(scene, 6e-4)
    assert times.size >= 6
    np.testing.assert_allclose(record.switches["t"], times, rtol=0, atol=1e-12)
    assert record.final_state.y[0, 0, 0] == pytest.approx(u, rel=1e-7)


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_energy_closes_with_every_protocol(kind):
    scene = driven(small(kind, V=0.3), ((3e-4, 0.9), (3.003e-4, -0.3), (6e-4, 0.5), (6e-4, 0.8)))
    scene = loaded(scene, protocol=((2e-4, 1.3 * scene.F_N), (5e-4, 0.8 * scene.F_N)))
    if kind == "free":
        scene = loaded(scene, T=5.0, T_protocol=((4e-4, 60.0),))
    coarse, fine = (simulate(scene, 8e-4, dt=dt) for dt in (4e-7, 2e-7))
    went_through = fine.curve["work_driver"].abs().max()
    assert budget_error(fine) < 1e-6 * went_through
    assert budget_error(fine) < budget_error(coarse) / 4


@pytest.mark.parametrize("fidelity", ["dynamic", "hybrid"])
@pytest.mark.parametrize("conditions", [{}, {"stop_when": "precursors = 99"}])
def test_the_curve_has_points_at_corners(fidelity, conditions):
    push = ((1.003e-3, 0.0), (1.003e-3, 2.0), (1.0231e-3, 2.0), (1.0231e-3, -1.0), (1.9e-3, -1.0))
    scene, how = driven(small(V=0.0), push), {"fidelity": fidelity, "progress": False} | conditions
    record = pyfric.simulate(scene, 2e-3, sample=2e-4, **how)
    t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    assert (np.diff(t) > 1e-7).all()
    assert all(np.abs(t - corner).min() < 1e-12 for corner in scene.corners)
    each = pyfric.simulate(scene, 2e-3, sample=record.method.dt, **how).curve["F_T"]
    assert F_T.max() == pytest.approx(each.max(), rel=1e-3)
    half = pyfric.simulate(scene, 1.0231e-3, sample=2e-4, **how)
    again = pyfric.simulate(scene, 2e-3, initial=half, progress=False)
    np.testing.assert_allclose(again.curve["t"], t, rtol=1e-12)


def test_split_runs_and_the_whole_give_the_same_bits():
    scene = driven(small("free", V=0.3), ((2.0004e-4, 0.9), (3e-4, 0.9), (3e-4, -0.7)))
    whole = simulate(scene, 8e-4)
    first = simulate(scene, 2.5e-4, threads=2)
    again = simulate(scene, 8e-4, initial=first)
    assert whole.final_state.t >= 8e-4 * (1 - 1e-12)
    assert bits(whole.final_state) == bits(again.final_state)
    assert same_run(whole, again, counts={}, method=whole.method, curve=whole.curve)


def test_checks_of_the_energy_follow_the_protocol_over_jumps(monkeypatch):
    """The first state of a check has the energy for the present motion of the driver."""
    off, check = [], GuardedSteps._check

    def checked(steps, due):
        state, geometry = steps.good.state, steps.method.geometry
        now = core.model(steps.scene, geometry, state.u_drv0, just_after(state))
        found = (core.energies(one, state, state.t) for one in (steps.good.model, now))
        off.append(abs(np.subtract(*(sum(one.values()) for one in found))) / steps.guard.rounding)
        check(steps, due)

    monkeypatch.setattr(GuardedSteps, "_check", checked)
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3)
    stop, start = 0.047, 0.09
    scene = driven(scene, ((stop, 2e-3), (stop, 0.0), (start, 0.0), (start, 8e-3)))
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    assert pyfric.simulate(scene, 0.1, **how).counts["jumps"] > 10
    assert max(off) < 10


def test_hysteresis_loops_hold_the_work_that_is_lost():
    """The second cycle is closed: the area of F_T over X is heat and damping."""
    V, T = 0.05, 4e-3
    corners = [(T, V)]
    for n in range(1, 5):
        corners += [((2 * n - 1) * T, (-1) ** n * V), ((2 * n + 1) * T, (-1) ** n * V)]
    scene = driven(
        chain(L=0.02, p=40.0, k=2e6, K=4e6, V=V, mu_s=0.5, mu_k=0.5, M=0.01), tuple(corners[1:])
    )
    record = simulate(scene, 9 * T, sample=1e-5)
    curve, t = record.curve, record.curve["t"].to_numpy()
    cycle = (t >= 5 * T - 1e-9) & (t <= 9 * T + 1e-9)
    X, F_T = np.array([scene.drive(one) for one in t[cycle]]), curve["F_T"].to_numpy()[cycle]
    area = np.sum(0.5 * (F_T[1:] + F_T[:-1]) * np.diff(X))
    lost = sum(
        np.ptp(curve[name].to_numpy()[cycle])
        for name in ("friction_heat", "dissipated_bonds", "switching_loss")
    )
    assert record.switches["new"].min() == -1  # blocks slip back
    assert abs(X[-1] - X[0]) < 1e-12
    assert area == pytest.approx(lost, rel=2e-3)
    assert lost == pytest.approx(
        4 * 0.5 * 9 * 40.0 * np.abs(record.final_state.y[0, 0]).max(), rel=1
    )


def test_a_held_driver_holds_its_force_and_a_load_arrives():
    """After all changes the slider rests: F_T, sum p and sum tau have their final values."""
    scene = driven(setup2(L=0.02, H=0.006, V=0.02, eta=120.0), ((3e-4, 0.0),))
    scene = loaded(scene, protocol=((2e-4, 500.0),), T=2.0, T_protocol=((2e-4, 30.0),))
    record = simulate(scene, 2e-3, energies=False, sample=4e-6)
    state, k_f = record.final_state, scene.k_f
    assert record.curve["F_T"].iloc[-1] == pytest.approx(record.curve["F_T"].iloc[-100], rel=1e-4)
    p = -k_f * state.y[0, 1]
    assert p.sum() == pytest.approx(500.0, rel=1e-4)
    model = pyfric.core.model(scene, "finite", state.u_drv0, state.t)
    forces = pyfric.core.evaluate(model, state, state.t)
    assert -forces.f.sum() == pytest.approx(forces.F_T + 30.0, rel=1e-3)
    u_x, t, solver = state.y[0, 0], state.t, pyfric.StaticSolver(scene, "finite")
    rest = solver.solve(u_x, scene.drive(t), load=scene.load_at(t))
    assert np.isfinite(record.events["F_T_start"]).all()
    assert rest.p.sum() == pytest.approx(500.0, rel=1e-9)
    assert rest.tau.sum() == pytest.approx(rest.F_T + 30.0, rel=1e-9)


def test_a_rod_is_pushed_at_any_height():
    """Pushed at the rod or below, the stuck slider bears K X minus the effect of its compliance."""
    for h in (2.5e-3, 12.5e-3):
        scene = driven(small("rod", h=h, V=0.05, eta=120.0), ((2e-4, 0.0),))
        state = simulate(scene, 4e-3, energies=False).final_state
        rest = pyfric.StaticSolver(scene, "finite").solve(state.y[0, 0], scene.drive(4e-3))
        assert rest.F_T > 10
        u_h = state.y[scene.j_h, 0, scene.i_h]
        F_T = scene.driver_force(scene.drive(4e-3), u_h, state.u_drv0)
        assert F_T == pytest.approx(rest.F_T, rel=1e-3)


# --- static states -------------------------------------------------------------------------------


def test_static_slip_back_and_forth_follows_masings_rule():
    """With mu_s = mu_k the reverse path is the first loading, twice as large in force and path.

    Source: G. Masing, Proc. 2nd Int. Congr. Appl. Mech., 332 (1926).
    """
    V, T = 0.05, 1e-3
    scene = chain(L=0.02, p=40.0, k=2e6, K=4e6, V=V, mu_s=0.5, mu_k=0.5, M=0.01)
    there_and_back = driven(scene, ((T, V), (T, 0.0), (2 * T, 0.0), (2 * T, -V), (4 * T, -V)))
    curve = pyfric.simulate(there_and_back, 4 * T, fidelity="quasistatic").curve
    first = pyfric.simulate(scene, T, fidelity="quasistatic").curve
    most = first["F_T"].iloc[-1]
    held = curve["F_T"][curve["t"].between(T, 2 * T)]
    np.testing.assert_allclose(held, most, rtol=1e-12)
    back = curve[curve["t"] >= 2 * T]
    x = V * (back["t"] - 2 * T)
    expected = most - 2 * np.interp(x / 2, V * first["t"], first["F_T"])
    assert len(back) >= 6
    np.testing.assert_allclose(back["F_T"], expected, rtol=0, atol=1e-11 * most)
    path = pyfric.prediction_curve(there_and_back).curve
    there = path[np.isclose(path["t"], 4 * T, rtol=1e-12)].iloc[0]
    np.testing.assert_allclose([there["drive"], there["F_T"]], [-V * T, -most], rtol=1e-11)


@pytest.mark.parametrize("fidelity", ["quasistatic", "equilibrium"])
def test_the_curve_of_static_states_bends_while_the_driver_accelerates(fidelity):
    """From rest F_T grows as t^2, because it is linear in the position of the driver."""
    T = 20e-3
    scene = driven(setup1(L=0.02, H=0.0125, F_N=400.0), ((T, 1e-3),), V=0.0)
    record = pyfric.simulate(scene, T, fidelity=fidelity, progress=False)
    assert not len(record.events)
    curve = record.curve
    t, most = np.linspace(0, T, 200), curve["F_T"].iloc[-1]
    assert most > 0
    np.testing.assert_allclose(
        np.interp(t, curve["t"], curve["F_T"]), most * (t / T) ** 2, atol=most / 32**2 / 4 * 1.01
    )
    np.testing.assert_allclose(curve["F_T"], most * (curve["t"] / T) ** 2, atol=1e-12 * most)


def test_the_ladder_climbs_and_descends_as_full_dynamics_does():
    """Forces agree within 0.02 F_N, between -0.2 and 0.5 F_N."""
    V, T = 4e-3, 20e-3
    back = ((T, V), (T, 0.0), (1.2 * T, 0.0), (1.2 * T, -V), (4 * T, -V))
    scene = driven(setup1(L=0.02, H=0.0125, F_N=400.0), back, V=V)
    how = {"sample": 1e-4, "energies": False}
    ladder = pyfric.simulate(scene, 2.5 * T, fidelity="quasistatic")
    run = simulate(scene, 2.5 * T, geometry="linear", **how)
    t = np.linspace(0, 2.5 * T, 300)
    a, b = (np.interp(t, one.curve["t"], one.curve["F_T"]) / 400.0 for one in (ladder, run))
    np.testing.assert_allclose(a, b, rtol=0, atol=0.02)
    assert a.max() > 0.48
    assert a.min() < -0.15
    assert (ladder.switches["new"] == -1).any()  # blocks slip back


def varied(kind):
    """Return a scene whose driver and loads change, and its end (s)."""
    a, b, c, t_end = 3e-3 * np.array([1.0, 2.0, 3.0, 4.0])
    V, F_N = (25e-3, 400.0) if kind == "rod" else (12e-3, 100.0)
    corners = (0.7 * a, 2 * V), (a, 0.0), (1.5 * a, 0.0), (1.5 * a, V), (c, V), (c, -V)
    load = {"protocol": ((a, F_N), (b, 0.8 * F_N), (b, 0.85 * F_N), (t_end, 1.1 * F_N))}
    if kind == "free":
        scene = setup2(L=0.02, H=0.006, F_N=F_N, V=V)
        load |= {"T": 2.0, "T_protocol": ((c, 2.0), (c, 30.0))}
    else:
        scene = setup1(L=0.02, H=0.0125, F_N=F_N, V=V, d_c=2e-6)
    return loaded(driven(scene, corners), **load), t_end


@pytest.mark.parametrize(("kind", "price"), [("rod", "cheap"), ("free", "free")])
def test_jumps_follow_speed_and_loads_as_full_dynamics_does(kind, price, request):
    """Differences are 2e-7 F_N. "free" needs 0.53 of all steps, because of errors of rates."""
    request.getfixturevalue(f"{price}_attempts")
    scene, t_end = varied(kind)
    how = {"geometry": "linear", "energies": False, "dt": pyfric.step_size(scene)}
    a = pyfric.simulate(scene, t_end, fidelity="hybrid", accuracy=1e-6, **how)
    b = pyfric.simulate(scene, t_end, fidelity="dynamic", **how)
    assert len(a.events) == len(b.events) > 1
    np.testing.assert_array_equal(a.switches["block"], b.switches["block"])
    for name in ("F_T_start", "F_T_arrest"):
        limit = 1e-6 * scene.F_N
        np.testing.assert_allclose(a.events[name], b.events[name], rtol=0, atol=limit)
    np.testing.assert_allclose(a.curve["F_T"], b.curve["F_T"], rtol=0, atol=1e-4 * scene.F_N)
    assert a.counts["steps"] < 0.55 * b.counts["steps"]


@pytest.mark.usefixtures("cheap_attempts")
def test_jumps_follow_speed_and_loads_in_finite_geometry():
    """The accuracy is the requested one."""
    T, V = 8e-3, 10e-3
    scene = driven(setup1(L=0.02, H=0.0125, F_N=400.0, V=V), ((0.8 * T, 2 * V), (T, 0.0)))
    scene = loaded(scene, protocol=((0.4 * T, 400.0), (1.1 * T, 300.0), (1.6 * T, 450.0)))
    how = {"geometry": "finite", "energies": False}
    a = pyfric.simulate(scene, 2 * T, fidelity="hybrid", accuracy=1e-3, **how)
    b = pyfric.simulate(scene, 2 * T, fidelity="dynamic", **how)
    for name in ("F_T_start", "F_T_arrest", "n_blocks"):
        np.testing.assert_allclose(a.events[name], b.events[name], rtol=0, atol=1e-4 * scene.F_N)
    assert a.counts["steps"] < 0.3 * b.counts["steps"]


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_the_ladder_follows_loads_as_dynamics_does(kind):
    """While F_N or T change, forces agree within 0.02 F_N; p and tau sum to the loads."""
    T = 8e-3
    if kind == "rod":
        scene = driven(setup1(L=0.02, H=0.0125, F_N=400.0, V=8e-3), ((T, 8e-3), (T, 0.0)))
        load = {"protocol": ((T, 400.0), (1.5 * T, 330.0), (1.5 * T, 340.0), (2 * T, 380.0))}
    else:
        scene = driven(setup2(L=0.02, H=0.006, F_N=100.0, V=5e-3), ((T, 5e-3), (T, 0.0)))
        load = {"protocol": ((T, 100.0), (2 * T, 120.0)), "T": 2.0, "T_protocol": ((T, 2.0),)}
        load["T_protocol"] += ((2 * T, 20.0),)
    scene = loaded(scene, **load)
    ladder = pyfric.simulate(scene, 2.2 * T, fidelity="quasistatic")
    run = pyfric.simulate(scene, 2.2 * T, fidelity="hybrid", geometry="linear")
    t = np.linspace(0, 2.2 * T, 300)
    a, b = (np.interp(t, one.curve["t"], one.curve["F_T"]) for one in (ladder, run))
    np.testing.assert_allclose(a, b, rtol=0, atol=0.02 * scene.F_N)
    events = ladder.events[ladder.events["t_start"] > T]
    assert len(events) > 2
    F_N, shear = np.array([scene.load_at(t) for t in events["t_start"]]).T
    p, tau = (one[events.index - 1].sum(axis=1) for one in (ladder.p_before, ladder.tau_before))
    np.testing.assert_allclose(p, F_N, rtol=1e-12)
    np.testing.assert_allclose(tau, events["F_T_start"] + shear, rtol=0, atol=1e-11 * scene.F_N)


def test_a_jump_of_the_load_is_a_short_ramp():
    T, ends = 8e-3, []
    scene = driven(setup1(L=0.02, H=0.0125, F_N=400.0, V=8e-3), ((T, 8e-3), (T, 0.0)))
    for ramp in (0.0, 1e-5):
        load = ((1.2 * T, 400.0), (1.2 * T + ramp, 250.0), (2 * T, 250.0))
        run = pyfric.simulate(loaded(scene, protocol=load), 2 * T, fidelity="quasistatic")
        ends.append(run.curve["F_T"].iloc[-1])
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-11)
    assert ends[0] < 0.8 * run.curve["F_T"].max()


def test_a_load_that_stays_changes_nothing():
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=0.02)
    how = {"fidelity": "quasistatic", "t_gap": 1e-7}
    events = pyfric.simulate(scene, 5e-3, **how).events
    same = pyfric.simulate(loaded(scene, protocol=((1e-3, 400.0), (3e-3, 400.0))), 5e-3, **how)
    assert len(events) > 3
    np.testing.assert_allclose(same.events["F_T_start"], events["F_T_start"], rtol=1e-11)


def test_holds_and_ramps_only_move_events_in_time():
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=0.02)
    how = {"fidelity": "quasistatic", "t_gap": 1e-7}
    steady = pyfric.simulate(scene, 5e-3, **how)
    corners = ((1e-3, 0.02), (1e-3, 0.0), (3e-3, 0.0), (3e-3, 0.02), (4e-3, 0.06), (5e-3, 0.06))
    held = driven(scene, corners)
    events = pyfric.simulate(held, 5e-3, **how).events.iloc[: len(steady.events)]
    assert len(events) > 3
    np.testing.assert_allclose(events["F_T_start"], steady.events["F_T_start"], rtol=1e-11)
    drive = [held.drive(t) for t in events["t_start"]]
    np.testing.assert_allclose(drive, 0.02 * steady.events["t_start"], rtol=1e-11)


@pytest.mark.parametrize("made", [np.array, pd.DataFrame, list])
def test_arrays_are_lists_of_rows(made):
    """Arrays may be from NumPy or pandas; the number of a block may be 2.0."""
    loads, pushes = made([[0.1, 410.0], [0.2, 420.0]]), made([[2, 0.25], [3, 0.5]])
    scene = setup1({"top.protocol": loads, "top.push": pushes})
    assert scene.top.protocol == ((0.1, 410.0), (0.2, 420.0))
    assert [(one.block, one.force) for one in scene.top.push] == [(2, 0.25), (3, 0.5)]
    assert setup1(mu_s=pd.Series([0.7] * 57)).interface.mu_s == (0.7,) * 57
    refused(lambda: setup1(push=made([[2.5, 0.25]])), "top.push", value=2.5, within=(0, 1000000000))


def test_a_state_of_another_lattice_is_refused():
    scene = setup1(L=0.04, H=0.01, l=0.0025)
    state = pyfric.loaded_state(scene).state(scene, 1e-7)
    with pytest.raises(pyfric.StateError, match=r"of 17 x 5 blocks; needed: 25 x 5"):
        simulate(setup1(L=0.06, H=0.01, l=0.0025), 1e-5, initial=state, progress=False)
