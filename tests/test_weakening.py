"""Slip weakening, mu(s) = mu_s - (mu_s - mu_k) min(s/d_c, 1), compared with exact solutions."""

import dataclasses
import math

import numpy as np
import pytest
from helpers import budget_error, operators, refused, small_rod
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from tolerances import FORCE, FORCE_FINITE

import pyfric
from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines.step_sizes import AUTO_SHARE
from pyfric.record import Record
from pyfric.scene import Scene, chain, preset, setup1
from pyfric.statics import loaded_state, stability_limit
from pyfric.values import SceneError

P, MU_S, MU_K, D_C = 60.0, 0.7, 0.45, 2e-6
SLOPE = (MU_S - MU_K) * P / D_C
"""The negative stiffness of weakening, N/m."""


def rigid(k_top=0.0, K=1e-30, V=0.0):
    """Return three blocks at their threshold, which move as one under equal forces."""
    return chain(L=5e-3, p=P, tau=MU_S * P, k_top=k_top, K=K, V=V, d_c=D_C, mu_s=MU_S, mu_k=MU_K)


def sliding(scene, dt, v=0.0):
    """Return the loaded state in which all blocks begin to slip at a speed v (m/s)."""
    state = loaded_state(scene).state(scene, dt)
    state.mode[:] = 1
    state.y[0, 2] = v
    return state


def stepped(scene, state, t):
    """Return u_x of the blocks at time t (s)."""
    n = round(t / state.dt)
    assert n * state.dt == pytest.approx(t, rel=1e-12)
    model = core.model(scene, "linear", state.u_drv0)
    core.advance(model, state, core.Log(scene.N_x), n)
    return state.y[0, 0]


def slip_of_one_block(k_top, m, v, t):
    """Return u (m) at t (s) of a block that starts at u = 0 with v (m/s), at its threshold.

    m u'' = (SLOPE - k_top) u up to u = d_c, then m u'' = (mu_s - mu_k) p - k_top u.
    """
    a = (SLOPE - k_top) / m
    rate = math.sqrt(abs(a))
    if a > 0:
        first = math.asinh(D_C * rate / v) / rate
        u, v_c = v / rate * math.sinh(rate * t), math.hypot(v, D_C * rate)
    elif a < 0:
        first = math.asin(D_C * rate / v) / rate
        u, v_c = v / rate * math.sin(rate * t), math.sqrt(v**2 - (D_C * rate) ** 2)
    else:
        first, u, v_c = D_C / v, v * t, v
    if t <= first:
        return u
    s, pull = t - first, (MU_S - MU_K) * P
    if k_top == 0:
        return D_C + v_c * s + pull / m * s**2 / 2
    omega, u_0 = math.sqrt(k_top / m), pull / k_top
    return u_0 + (D_C - u_0) * math.cos(omega * s) + v_c / omega * math.sin(omega * s)


CASES = {"unstable": 0.0, "held": 0.3 * SLOPE, "neutral": SLOPE, "stable": 1.1 * SLOPE}


@pytest.mark.parametrize("name", CASES)
def test_a_block_slips_as_the_formula_says(name):
    """Errors have the order of the stepper before d_c; beyond its corner they are second order."""
    scene = rigid(CASES[name])
    v = 1.2 * D_C * math.sqrt(SLOPE / scene.m)
    t_c = D_C / v
    for t, order, least in ((0.6 * t_c, 3.9, 1e-11), (2.5 * t_c, 1.5, 3e-6)):
        exact = slip_of_one_block(scene.k_top, scene.m, v, t)
        errors = []
        for n in (8, 32, 128):
            u = stepped(scene, sliding(scene, t / n, v), t)
            np.testing.assert_array_equal(u, u[0])
            errors.append(abs(u[0] / exact - 1))
        assert exact > (0.5 if t < t_c else 1.9) * D_C
        assert errors[-1] < least
        if name != "neutral" or t > t_c:  # constant speed is exact
            assert errors[0] > 4 ** (2 * order) * errors[-1] or errors[0] < 1e-13


def test_slip_at_the_pace_of_the_driver():
    """A driven chain stiffer than the weakening slips stably, in linear motion."""
    scene = rigid(K=4 * SLOPE, V=1e-3)
    _, K, C = (np.asarray(a.todense()) if hasattr(a, "todense") else a for a in operators(scene))
    K, C = K[:3, :3] - SLOPE * np.eye(3), C[:3, :3]
    assert (np.linalg.eigvalsh(K) > 0).all()
    A = np.zeros((8, 8))  # u, v, and the driver's X and V
    A[:3, 3:6] = np.eye(3)
    A[3:6, :3], A[3:6, 3:6] = -K / scene.m, -C / scene.m
    A[3, 6], A[6, 7] = scene.driver.K / scene.m, 1.0
    t = 4e-4
    exact = (expm(A * t) @ [0, 0, 0, 0, 0, 0, 0, scene.driver.V])[:3]
    u = stepped(scene, sliding(scene, 1e-7), t)
    np.testing.assert_allclose(u, exact, rtol=1e-7)
    assert 0.3 * D_C < exact[0] < D_C


def test_the_limit_of_no_length_is_amontons_coulomb():
    ends = []
    for d_c in (0.0, 1e-30, 1e-12, 1e-3):
        scene = dataclasses.replace(
            rigid(), interface=dataclasses.replace(rigid().interface, d_c=d_c)
        )
        ends.append(stepped(scene, sliding(scene, 1e-7, 0.1), 1e-4)[0])
    assert ends[1] == pytest.approx(ends[0], rel=1e-3)
    assert ends[2] == pytest.approx(ends[0], rel=1e-3)
    assert ends[3] < 0.6 * ends[0]


def test_without_difference_of_coefficients_nothing_weakens():
    scene = chain(L=5e-3, mu_s=0.5, mu_k=0.5, d_c=1e-6)
    assert not scene.law.weakens
    assert pyfric.simulate(scene, 1e-3, fidelity="quasistatic").status == "complete"


# --- slip, stick, reversal, opening --------------------------------------------------------------


def one_step(mode, v, u=0.0, tau=0.0, s=0.0):
    """Return the state one short step after a uniform chain had slipped by s, at displacement u."""
    scene = chain(L=5e-3, p=P, d_c=D_C, k_top=1e7, K=1e-30)
    state = loaded_state(scene).state(scene, 1e-10)
    state.mode[:], state.y[0, 0], state.y[0, 2] = mode, u, v
    state.s_0[:] = s - (mode * u if abs(mode) == 1 else 0.0)
    np.testing.assert_allclose(state.slip, s, atol=1e-20)
    stepped(scene, state, 1e-10)
    return state


def test_sticking_ends_a_slip():
    state = one_step(1, -1e-3, s=1e-6)
    assert (state.mode == STUCK).all()
    assert not state.slip.any()


@pytest.mark.parametrize("side", [1, -1])
def test_a_reversal_goes_on_with_the_slip(side):
    state = one_step(side, -side * 1e-3, u=side * 1e-5, s=1e-6)  # k_top u = 100 N > mu_s p
    assert (state.mode == -side).all()
    np.testing.assert_allclose(state.slip, 1e-6, atol=1e-12)
    assert state.copy().slip.tolist() == state.slip.tolist()


def test_open_blocks_keep_their_slip():
    scene = setup1(L=0.01, H=0.005, h=2.5e-3, d_c=D_C)
    state = loaded_state(scene, "linear").state(scene, 1e-8)
    state.mode[:], state.s_0[:] = 1, 1e-6 - state.y[0, 0]
    state.y[:, 3], state.rod[4] = 100.0, 100.0  # upwards
    state.y[0, 2] = 1.0
    model = core.model(scene, "linear", state.u_drv0)
    core.advance(model, state, core.Log(scene.N_x), 200)
    kept, up = state.slip.copy(), state.mode == OPEN
    assert up.sum() > 2
    assert ((kept > 1e-6) & (kept < 4e-6)).all()
    core.advance(model, state, core.Log(scene.N_x), 50)
    assert (state.mode[up] == OPEN).all()
    np.testing.assert_array_equal(state.slip[up], kept[up])


# --- runs ----------------------------------------------------------------------------------------


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-3, "d_c": 2e-7} | changes)


def links(**changes):
    return chain(**{"L": 0.02, "V": 2e-3, "d_c": 1e-6} | changes)


def test_energy_budget_closes():
    errors = []
    for share in (0.4, 0.2, 0.1):
        scene = rod(V=0.05)
        dt = share * stability_limit(scene)[0]
        record = pyfric.simulate(scene, 2e-3, dt=dt, fidelity="dynamic", progress=False)
        errors.append(budget_error(record) / record.curve["friction_heat"].iloc[-1])
    assert errors[-1] < 1e-7
    assert errors[-1] < errors[0] / 10


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_a_run_in_parts_is_the_whole_run(geometry, tmp_path):
    scene, how = rod(V=0.05), {"fidelity": "dynamic", "geometry": geometry, "progress": False}
    whole = pyfric.simulate(scene, 2e-3, sample=1e-5, **how)
    assert len(whole.events)
    slips = whole.episodes
    middle = float((slips["t_start"] + slips["t_stop"]).iloc[0] / 2)
    part = pyfric.simulate(scene, middle, sample=1e-5, **how)
    part = Record.load(part.save(tmp_path / "part.nc"))
    assert part.final_state.slip.max() > 0
    rest = pyfric.simulate(scene, 2e-3, initial=part, progress=False)
    assert dataclasses.replace(rest, timings=whole.timings, counts=whole.counts) == whole


@pytest.mark.parametrize(
    ("scene", "t_end", "geometry"),
    [(rod(), 0.05, "linear"), (rod(side="right"), 0.05, "finite"), (links(V=8e-3), 0.06, "linear")],
)  # fmt: skip
def test_jumps_give_the_events_of_full_dynamics(scene, t_end, geometry):
    how = {"geometry": geometry, "progress": False}
    a = pyfric.simulate(scene, t_end, fidelity="dynamic", energies=False, **how)
    b = pyfric.simulate(scene, t_end, fidelity="hybrid", accuracy=1e-8, **how)  # slip grows
    assert len(a.events) > 1
    assert b.counts["steps_spared"] > 0.1 * a.counts["steps"]
    assert len(b.events) == len(a.events)
    for name in ("first_block", "last_block", "nucleation_block", "L_p_over_L"):
        np.testing.assert_array_equal(b.events[name], a.events[name], err_msg=name)
    force = (FORCE if geometry == "linear" else FORCE_FINITE) * scene.F_N
    for name in ("F_T_start", "F_T_arrest"):
        np.testing.assert_allclose(b.events[name], a.events[name], rtol=0, atol=force)


def test_the_automatic_step_is_stable_with_weakening():
    """If growth is resolved, all decaying modes are stable at the automatic step."""
    scene = setup1(L=0.015, H=0.01, h=2.5e-3)
    M, K, C = operators(scene)
    dt = AUTO_SHARE * stability_limit(scene)[0]
    grows = []
    root = np.sqrt(M)
    for growth in (0.1, 0.3, 1.0):  # dt sqrt((mu_s - mu_k) p/(m d_c))
        stiff = K.toarray()
        stiff[np.arange(scene.N_x), np.arange(scene.N_x)] -= scene.m * (growth / dt) ** 2
        n = len(M)
        A = np.block(
            [[np.zeros((n, n)), np.eye(n)],
             [-stiff / np.outer(root, root), -C.toarray() / np.outer(root, root)]]
        )  # fmt: skip
        z = np.linalg.eigvals(A) * dt
        grows.append(z.real.max())
        z = z[z.real < 0]
        assert np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max() < 1
    assert 0.1 < grows[-1] < 1


# --- scenes, plans, refusals ---------------------------------------------------------------------


def test_scene_files_give_the_length_with_its_unit():
    scene = preset("fig1", d_c=1e-6)
    text = scene.to_toml()
    assert Scene.from_toml(text) == scene
    assert Scene.from_toml(text.replace('"1e-06 m"', '"1 um"')) == scene
    assert Scene.from_toml(text.replace('d_c = "1e-06 m"', "")) == preset("fig1")


@pytest.mark.parametrize("d_c", [-1e-6, math.nan, math.inf, "1 kg", True, None])
def test_refused_lengths(d_c):
    with pytest.raises(SceneError) as caught:
        preset("fig1", d_c=d_c)
    assert caught.value.field == "interface.d_c"
    assert caught.value.unit == "m"


def test_the_plan_moves_up():
    question = {"want": "loading_curve", "tolerance": 0.2, "t_end": 0.2}
    assert pyfric.plan(preset("fig1"), **question).alone.engine == "quasistatic"
    plan = pyfric.plan(preset("fig1", d_c=2e-6), **question)
    assert plan.alone.engine == "hybrid"
    assert "its steepest fall is 1.76, more than 0.05" in plan.levels[0].cannot
    question = {"want": "loading_curve", "tolerance": 0.2, "progress": False}
    record = pyfric.simulate(preset("fig1", d_c=2e-6), 0.03, **question)
    assert record.method.engine == "hybrid"


def test_the_prediction_curve_does_not_depend_on_it():
    a, b = (pyfric.prediction_curve(rod(d_c=d_c)) for d_c in (0.0, 1e-6))
    np.testing.assert_array_equal(a.curve, b.curve)


def test_unresolved_weakening_is_noted():
    fine, coarse = (
        pyfric.simulate(rod(d_c=d_c), 1e-4, fidelity="hybrid", progress=False)
        for d_c in (1e-6, 1e-9)
    )
    assert not any("weakening" in note for note in fine.notes)
    assert any("do not resolve weakening over 1 nm" in note for note in coarse.notes)


def test_unresolved_weakening_is_not_measured():
    """In both runs friction drops at once, so that their agreement has no meaning."""
    scene, how = rod(d_c=1e-9, V=1.0), {"tolerance": 0.05, "want": "precursors", "progress": False}
    record = pyfric.simulate(scene, 1e-3, **how)
    assert record.errors.holds is None
    assert record.errors.measured() is None
    assert any("do not resolve weakening, which needs" in note for note in record.notes)
    resolved = pyfric.simulate(scene.replace({"interface.d_c": 1e-6}), 1e-3, **how)
    assert resolved.errors.holds


@pytest.mark.parametrize("since", ["stick", "start"])
def test_slip_of_the_law_may_go_on_over_sticks(since):
    """Two pushes of a rigid chain, each until it stops, agree with SciPy for both options."""
    p, mu_s, mu_k, d_c, force = 10.0, 0.7, 0.3, 1e-4, 8.0
    pushes = [(n, force, t, t + 2e-4) for n in range(1, 7) for t in (0.0, 1e-3)]
    own = {"L": 0.0125, "p": p, "tau": 0.0, "K": 0.0, "V": 0.0, "eta": 0.0, "push": pushes}
    law = {"mu_s": mu_s, "mu_k": mu_k, "d_c": d_c, "slip_since": since}
    scene = pyfric.chain(**own, **law)
    record = pyfric.simulate(scene, 1.8e-3, fidelity="dynamic", progress=False)

    def slides(u, s, t, t_end, pushed):
        """Return u, s and v after a slide from rest under a push and then to a stop."""

        def moves(t, y):
            mu = mu_s - (mu_s - mu_k) * min(y[2] / d_c, 1.0)
            return y[1], (pushed * (t < t_end) - mu * p) / scene.m, y[1]

        how = {"rtol": 1e-11, "atol": 1e-16, "max_step": 2e-6}
        on = solve_ivp(moves, (t, t_end - 1e-15), [u, 0.0, s], **how).y[:, -1]
        stops = lambda t, y: y[1]  # noqa: E731
        stops.terminal, stops.direction = True, -1
        return solve_ivp(moves, (t_end, t_end + 1.0), on, events=stops, **how).y[[0, 2], -1]

    u, s = slides(0.0, 0.0, 0.0, 2e-4, force)
    assert 0.1 * d_c < s < 0.9 * d_c
    u, s = slides(u, s if since == "start" else 0.0, 1e-3, 1.2e-3, force)
    state = record.final_state
    assert len(record.episodes.query("n == 1")) == 2
    np.testing.assert_allclose(state.y[0, 0], u, rtol=1e-5)
    np.testing.assert_allclose(state.slip, s if since == "start" else 0.0, rtol=1e-5)


def test_hybrid_runs_run_in_too_and_others_refuse():
    scene = small_rod(V=0.05, d_c=1e-6, slip_since="start")
    how = {"progress": False, "geometry": "linear"}
    exact, jumped = (pyfric.simulate(scene, 0.03, fidelity=f, **how) for f in ("dynamic", "hybrid"))
    assert jumped.counts["jumps"] >= 2
    assert len(exact.events) == len(jumped.events) >= 2
    forces = [record.events["F_T_start"] for record in (exact, jumped)]
    np.testing.assert_allclose(*forces, atol=2e-3 * scene.F_N)
    refused(lambda: pyfric.simulate(scene, 1.0, fidelity="quasistatic"), "interface.slip_since")
    refused(lambda: small_rod(slip_since="start"), "interface.slip_since", "d_c > 0")
    refused(lambda: pyfric.preset("slow", slip_since="start"), "interface.slip_since")
