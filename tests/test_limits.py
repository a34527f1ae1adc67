"""Limits of friction that change with time: forced ruptures, triggers, histories of mu."""

import math

import numpy as np
import pytest
from helpers import dynamic, first_slips, mirrored_scene, refused, small_rod
from scipy.integrate import solve_ivp

import pyfric
from pyfric.scene import NO_LIMIT, chain

P, TAU = 10.0, 5.0
FALLS = ((1e-4, 0.8), (3e-4, 0.2))
"""A limit that falls from 0.8 to 0.2. The limit passes tau/p of the chain, 0.5, at 2e-4 s."""
BINDS = 2e-4


def resting(**changes):
    """Return a chain at rest under a uniform load, without a driver; all blocks move alike."""
    return chain(**{"L": 0.0125, "p": P, "tau": TAU, "K": 0.0, "V": 0.0, "eta": 0.0} | changes)


def limited(scene, limit, limit_from=None):
    return scene.replace({"interface.limit": limit, "interface.limit_from": limit_from})


# --- the law ------------------------------------------------------------------------------------


def test_a_block_slips_when_its_limit_falls_to_the_stress():
    """The time is exact, also if the limit of one block begins later than that of others."""
    scene = resting()
    later = [0.0] + [math.inf] * (scene.N_x - 1)
    record = dynamic(limited(scene, FALLS, later), 2.2e-4)
    times = first_slips(record)
    assert times[0] == pytest.approx(BINDS, rel=1e-12)
    record = dynamic(limited(scene, FALLS, [7e-5, *later[1:]]), 3e-4)
    assert first_slips(record)[0] == pytest.approx(BINDS + 7e-5, rel=1e-12)


@pytest.mark.parametrize("stepper", ["rk4", "adaptive"])
def test_mu_of_t_moves_blocks_as_newton_says(stepper):
    """m u'' = tau - mu(t) p has a cubic solution while the limit falls, and then a parabola."""
    scene, t_end = limited(resting(mu_s=0.8, mu_k=0.8), FALLS), 4e-4
    record = dynamic(scene, t_end, stepper=stepper)
    state, m, slope = record.final_state, scene.m, 0.6 / 2e-4
    fallen, after, a = 3e-4 - BINDS, state.t - 3e-4, TAU - 0.2 * P
    v = (P * slope * fallen**2 / 2 + a * after) / m
    u = (P * slope * (fallen**3 / 6 + fallen**2 / 2 * after) + a * after**2 / 2) / m
    np.testing.assert_allclose(state.y[0, 2], v, rtol=1e-11)
    np.testing.assert_allclose(state.y[0, 0], u, rtol=1e-11)


def test_friction_weakens_over_slip_or_time_whichever_is_sooner():
    """SciPy solves SCEC's forced rupture, mu = mu_s - (mu_s - mu_k) max(s/d_c, t/t_0)."""
    mu_s, mu_k, t_0, d_c = 0.7, 0.4, 4e-4, 2e-6
    scene = limited(resting(mu_s=mu_s, mu_k=mu_k, d_c=d_c), ((0.0, mu_s), (t_0, mu_k)))
    binds, m = (mu_s - TAU / P) / (mu_s - mu_k) * t_0, scene.m

    def moves(t, y):
        share = min(max(y[0] / d_c, t / t_0), 1.0)
        return y[1], (TAU - (mu_s - (mu_s - mu_k) * share) * P) / m

    state = dynamic(scene, 1.15 * t_0).final_state
    t_end = state.t
    exact = solve_ivp(moves, (binds, t_end), [0.0, 0.0], rtol=1e-11, atol=1e-16, max_step=1e-6)
    u, v = exact.y
    share = u / d_c - exact.t / t_0
    assert share[exact.t < t_0].min() < 0 < share[exact.t < t_0].max()  # both rules act
    # a step in which the other rule takes over is not divided at that time
    np.testing.assert_allclose(state.y[0, 0], u[-1], rtol=1e-5)
    np.testing.assert_allclose(state.y[0, 2], v[-1], rtol=1e-5)


def test_a_limit_above_friction_changes_nothing():
    scene = small_rod(V=0.5)
    one, other = (dynamic(s, 2e-3) for s in (scene, limited(scene, ((0.0, 0.7),))))
    assert len(one.switches["t"])
    assert one.final_state == other.final_state
    assert one.curve.equals(other.curve)


def test_a_chain_mirrors_and_goes_on_over_breakpoints():
    scene = limited(small_rod(V=0.0, mu_s=0.7), ((1e-5, 0.7), (4e-5, 0.1)), 1e-5)
    starts = [2e-6 * n for n in range(scene.N_x)]
    scene = scene.replace({"interface.limit_from": starts})
    whole = dynamic(scene, 1.2e-4)
    assert np.isfinite(first_slips(whole)).sum() >= 3
    part = dynamic(scene, 3.3e-5)
    assert dynamic(scene, 1.2e-4, initial=part).final_state == whole.final_state
    other = dynamic(mirrored_scene(scene), 1.2e-4)
    np.testing.assert_allclose(first_slips(other), first_slips(whole), rtol=1e-13)


# --- forced ruptures -----------------------------------------------------------------------------


def test_a_forced_rupture_runs_at_its_speed_and_ends_where_it_should():
    """At a low prestress only the forced part slips, each block soon after its limit begins."""
    speed, over = 300.0, 2e-5
    scene = pyfric.chain(L=0.1, p=P, tau=2.0, K=0.0, V=0.0)
    forced = pyfric.weakened(scene, x=0.0, length=0.1, speed=speed, over=over, mu=0.19)
    record = dynamic(forced, 3e-4)
    times, blocks = first_slips(record), np.arange(scene.N_x)
    n = round(0.05 / scene.slider.l)
    assert np.isfinite(times[: n + 1]).all()
    assert np.isnan(times[n + 3 :]).all()
    after = times[: n + 1] - blocks[: n + 1] * scene.slider.l / speed
    assert (after > 0).all()
    assert (after < over).all()
    at_once = pyfric.weakened(scene, x=0.0, length=0.1, speed=speed, mu=0.19)
    times = first_slips(dynamic(at_once, 3e-4))[: n + 1]
    np.testing.assert_allclose(times[1:], blocks[1 : n + 1] * scene.slider.l / speed, rtol=1e-12)


def test_weakened_patches_have_no_speed():
    scene = pyfric.weakened("setup2", x="50 mm", length="4 mm", mu=0.1, begin="2 ms")
    times = np.array(scene.interface.limit_from)
    assert np.flatnonzero(times == 2e-3).tolist() == [48, 49, 50, 51, 52]
    assert np.isinf(times).sum() == scene.N_x - 5
    assert scene.interface.limit == ((0.0, 0.1),)
    assert pyfric.Scene.from_toml(scene.to_toml()) == scene


def test_limits_are_those_of_their_pieces():
    scene = limited(
        small_rod(), ((1.0, 0.5), (1.0, 0.4), (3.0, 0.2)), [float(n) for n in range(13)]
    )
    early, late = scene.limit_at(2.5), scene.limit_at(2.5, 2.0)
    np.testing.assert_allclose(early[0, :3], [0.25, 0.35, NO_LIMIT])
    np.testing.assert_allclose(early[1, :3], [-0.1, -0.1, 0.0])
    np.testing.assert_allclose(late[0, :2], [0.3, 0.4])
    assert scene.limit_at(1.0)[0, 0] == 0.4  # at a jump, the second value
    assert scene.corners == tuple(float(n) for n in range(1, 16))


# --- jumps ---------------------------------------------------------------------------------------


def test_jumps_follow_constant_limits():
    """With a trigger in the middle and a lasting weak patch, events are those of full dynamics."""
    scene = small_rod(V=0.02)
    middle = [math.inf] * scene.N_x
    middle[4:7] = [4e-3, 4e-3, 5e-3]
    scene = limited(scene, ((0.0, 0.7), (1e-3, 0.3)), middle)
    runs = [dynamic(scene, 0.03, fidelity=f) for f in ("dynamic", "hybrid")]
    exact, jumped = runs
    assert jumped.counts["jumps"] >= 2
    assert jumped.counts["steps_spared"] > 0.5 * jumped.counts["steps"]
    assert len(exact.events) == len(jumped.events) >= 2
    np.testing.assert_allclose(jumped.events["t_start"], exact.events["t_start"], atol=2e-5)
    F_N = scene.F_N
    np.testing.assert_allclose(
        jumped.events["F_T_start"], exact.events["F_T_start"], atol=1e-3 * F_N
    )
    free = dynamic(small_rod(V=0.02), 0.03, fidelity="hybrid")
    assert len(free.events) != len(jumped.events) or not np.allclose(
        free.events["F_T_start"], jumped.events["F_T_start"], atol=5e-3 * F_N
    )


def test_long_chains_know_their_limits():
    """Limits hold from t = 0 on, without breakpoints: a weak patch slips while another moves."""
    p = [1.007 * P if n in (70, 71) else P for n in range(81)]
    scene = chain(L=0.2, p=p, K=1e6, V=0.2, side="top", mu_s=0.7, mu_k=0.05)
    weak = [0.0 if n in (3, 4, 5, 70, 71) else math.inf for n in range(scene.N_x)]
    scene = limited(scene, ((0.0, 0.1),), weak)
    exact, jumped = (dynamic(scene, 6e-4, fidelity=f) for f in ("dynamic", "hybrid"))
    times, ends = first_slips(exact), exact.episodes.groupby("n")["t_stop"].max()
    np.testing.assert_allclose(first_slips(jumped), times, rtol=1e-6)
    assert times[3] < times[70] < ends[4]


# --- refused -------------------------------------------------------------------------------------


def test_limits_are_refused_where_nothing_follows_them():
    scene = limited(small_rod(), FALLS)
    refused(lambda: pyfric.simulate(scene, 1.0, fidelity="quasistatic"), "interface.limit", "time")
    refused(lambda: pyfric.prediction_curve(scene), "interface.limit", "static states")
    slow = pyfric.preset("slow")
    refused(lambda: limited(slow, FALLS), "interface.limit", "rest")
    refused(lambda: limited(small_rod(), (), 1.0), "interface.limit", "limit_from")
    refused(lambda: limited(small_rod(), ((1.0, -0.1),)), "interface.limit", "corner 1")
    refused(lambda: limited(small_rod(), FALLS, -1.0), "interface.limit_from", ">= 0 s")
    refused(lambda: limited(small_rod(), FALLS, math.nan), "interface.limit_from", "finite")
    refused(lambda: limited(small_rod(), FALLS, [0.0]), "interface.limit_from", "1 numbers")
    refused(lambda: pyfric.weakened(scene, x=0.0, length=0.01), "interface.limit", "given")
    refused(lambda: pyfric.weakened(small_rod(), x=0.0, length=0.01, mu=0.9), "mu", "at most")
