"""Jumps of the hybrid engine over slip, compared with full dynamics."""

import numpy as np
import pytest

import pyfric
from pyfric.core import OPEN
from pyfric.engines import stable_slip
from pyfric.engines.cost import work, work_of_step
from pyfric.engines.jump import Jump, Wait
from pyfric.engines.path import Outside, path_from, rest
from pyfric.engines.rests import RestStates
from pyfric.engines.schedule import SPENT
from pyfric.scene import setup1, setup2
from pyfric.scene.laws import Ageing, ExponentialWeakening, SpeedDependent
from pyfric.statics import StaticSolver, Weakening, damping, mass

FORCE = 1e-4
"""Tolerance of start and arrest forces, over F_N; measured 3e-8 and 5e-6."""


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-3, "d_c": 5e-6} | changes)


def run(scene, t_end, fidelity, **how):
    how = {"geometry": "linear", "progress": False, "threads": 1} | how
    return pyfric.simulate(scene, t_end, fidelity=fidelity, **how)


FASTER = [(0.0, 2e-3), (0.02, 2e-3), (0.03, 4e-3)]
BACK = [(0.0, 2e-3), (0.0325, 2e-3), (0.048, -2e-3)]
SLIPS = {
    "linear": ({"side": "right"}, {"geometry": "linear"}),
    "finite": ({"side": "right"}, {"geometry": "finite"}),
    "viscous slip": ({"alpha": 2.0}, {"geometry": "finite"}),
    "strength grows": ({"law": Ageing(B=0.01, t_c=1e-3)}, {"geometry": "finite"}),
    "in pieces": ({"law": ExponentialWeakening()}, {"geometry": "linear"}),
    "driver speeds up": ({"driver.protocol": FASTER}, {"geometry": "finite"}),
    "gaps": ({"gap": np.where(np.arange(9) % 3 == 1, 2e-7, 0.0)}, {"geometry": "finite"}),
    "a block without contact": ({"contact": np.arange(9) != 2}, {"geometry": "linear"}),
    "driver turns back": ({"driver.protocol": BACK}, {"accuracy": 1e-6}),
}


@pytest.mark.usefixtures("cheap_attempts")
@pytest.mark.parametrize("name", SLIPS)
def test_stable_slip_is_full_dynamics(name):
    """Two parts of the interface slip stably for 4 ms, then in an event, then stably again."""
    changes, how = SLIPS[name]
    scene, t_end = rod().replace(changes), 0.048
    a = run(scene, t_end, "dynamic", energies=False, **how)
    b = run(scene, t_end, "hybrid", **how)
    assert b.counts["slides"] > 1
    assert len(a.events) == len(b.events) > 0
    for name in ("first_block", "last_block", "nucleation_block", "n_blocks", "L_p_over_L"):
        np.testing.assert_array_equal(b.events[name], a.events[name], err_msg=name)
    for name in ("F_T_start", "F_T_arrest"):
        limit = FORCE * scene.F_N
        np.testing.assert_allclose(b.events[name], a.events[name], rtol=0, atol=limit, err_msg=name)
    for name in ("block", "old", "new"):
        np.testing.assert_array_equal(b.switches[name], a.switches[name])
    np.testing.assert_allclose(b.switches["t"], a.switches["t"], rtol=0, atol=1e-6)
    error = (b.curve["F_T"] - a.curve["F_T"]) / scene.F_N
    assert np.quantile(np.abs(error), 0.98) < 1e-5
    assert b.counts["steps"] < 0.5 * a.counts["steps"]
    assert b.counts["steps"] + b.counts["steps_spared"] == b.final_state.step


@pytest.mark.usefixtures("free_attempts")
def test_stable_slip_takes_hardly_any_steps():
    """At a tenth of the speed it takes 1/50 of the steps, if attempts cost at most six steps."""
    b = run(rod(V=2e-4), 0.36, "hybrid")
    assert b.final_state.step - b.switches["step"][0] > 10_000
    assert b.counts["steps"] < 0.02 * b.final_state.step


@pytest.mark.parametrize(("speed", "slip"), [(0.01, 3e-4), (0.3, 3e-3)])
def test_attempts_take_a_part_of_the_work_of_full_dynamics(speed, slip):
    """Stable slip is tried, and an event that comes before a jump is possible."""
    b = run(rod(V=speed, d_c=5e-6 if speed < 0.1 else 0.0), slip / speed, "hybrid")
    counts = b.counts
    assert counts["attempts"] >= 2
    attempts = {name: counts[name] for name in ("landings", "slides", "modal_bases")}
    full = b.final_state.step * work_of_step(b.scene, "linear", b.method.stepper)
    last = max(work(b.scene, "linear", {name: 1}) for name in attempts)
    assert work(b.scene, "linear", attempts) <= SPENT * full + 2 * last
    assert counts["steps"] + counts["steps_spared"] == b.final_state.step


def test_few_jumps_are_tried_where_none_is_possible():
    """In an overdamped slider on a fast driver every jump is refused."""
    scene = setup2(L=0.01, H=0.006, eta=300.0, theta=-0.833, V=0.2, h=1e-3, side="right")
    record = run(scene, 3e-4, "hybrid", geometry="finite")
    assert record.counts["jumps"] == 0
    assert record.counts["attempts"] < 0.01 * record.counts["steps"]


def test_stable_slip_goes_on_from_a_record():
    scene = rod()
    one = run(scene, 0.037, "hybrid")
    half = run(scene, 0.0325, "hybrid")
    assert (np.abs(half.final_state.mode) == 1).any()
    two = run(scene, 0.037, "hybrid", initial=half)
    assert len(one.events) == len(two.events)
    np.testing.assert_array_equal(two.switches["block"], one.switches["block"])
    np.testing.assert_allclose(two.switches["t"], one.switches["t"], rtol=0, atol=1e-6)


def slipping_now(scene, state, known, rests):
    """Return the modes of slipping blocks, the static state, and the outer forces."""
    way = np.where(np.abs(state.mode) == 1, state.mode, 0)
    assert way.any()
    weakening = Weakening(scene.law, way, state.s_0, state.y[0, 0])
    q = known.coordinates(state.y[:, :2], state.rod[:3])
    modes, outside = rests.slipping(state.mode != OPEN, weakening, q), Outside(known, state.t)
    return modes, rest(modes, q, outside.drive, None, 1e-9)[:2], outside


def slow_rod(**changes):
    """Return a rod that slips stably, its last state, static states, and modes."""
    scene = rod(**changes)
    state = run(scene, 0.0325, "hybrid").final_state
    known = StaticSolver(scene)
    rests = RestStates(known, state.dt, "rk4", {"modal_bases": 0})
    return scene, state, known, rests


def test_a_refused_attempt_waits_until_what_was_too_large_has_decayed():
    """Rows move against each other, unlike slow shapes; a larger motion waits longer."""
    scene, state, known, rests = slow_rod()
    modes, start, outside = slipping_now(scene, state, known, rests)
    path = path_from(modes, outside, *start)
    rough = np.zeros((scene.N_z, 2, scene.N_x))
    rough[1:-1, 0] = (-1.0) ** np.arange(1, scene.N_z - 1)[:, None]
    v, waits = known.coordinates(rough, np.zeros(3)), []
    for speed in (1e-2, 1e-1):
        motion = modes.split(np.zeros_like(v), speed * v)
        motion = motion._replace(a=np.zeros_like(motion.a))  # no part in slow shapes
        how = {"dt": state.dt / 1000, "accuracy": 1e-6, "least": 1, "wait": 1}
        found = Jump(modes, outside, path, motion, state.t - state.t_0, **how).land(10**6)
        assert isinstance(found, Wait)
        waits.append(found.steps)
    decay = v @ (damping(scene) @ v) / (2 * v @ (mass(scene) * v))
    assert waits[1] - waits[0] == pytest.approx(np.log(10) / (decay * state.dt / 1000), rel=0.1)


def test_slow_modes_of_a_slider_that_slips_are_those_of_dense_matrices():
    """Weakening slows a mode, and friction makes left and right shapes differ."""
    scene, state, known, rests = slow_rod(alpha=50.0)
    modes, _, _ = slipping_now(scene, state, known, rests)
    q = known.coordinates(state.y[:, :2], state.rod[:3])
    space, n = modes.space, modes.space.n_q
    free, u_x = space.free, q[: scene.N_x]
    K = space.near.K.toarray()
    for i in space.slips:
        mu = scene.law.mu_s - scene.law.drop * (state.s_0[i] + state.mode[i] * u_x[i]) / 5e-6
        K[i, i] -= scene.law.drop / 5e-6 * -scene.k_f * q[i + scene.N_x]
        K[i, i + scene.N_x] -= state.mode[i] * mu * scene.k_f
    C = damping(scene).toarray()
    C[space.slips, space.slips] += 50.0
    K, C, M = K[np.ix_(free, free)], C[np.ix_(free, free)], mass(scene)[free][:, None]
    none = np.zeros_like(K)
    exact = np.linalg.eigvals(np.block([[none, np.eye(len(free))], [-K / M, -C / M]]))
    for mode in modes.corrected(np.arange(6)):
        assert np.abs(exact - mode.rate).min() < 1e-5 * abs(mode.rate)
    rng = np.random.default_rng(1)
    force = rng.normal(size=n)
    np.testing.assert_allclose(K @ space.answer(force)[free], force[free], rtol=0, atol=1e-7)


def test_no_jump_over_slip_that_goes_on_without_the_driver():
    """The rod is about to slip as a whole, with friction that falls more steeply."""
    scene, state, known, rests = slow_rod()
    modes, _, _ = slipping_now(scene, state, known, rests)
    assert modes.grows == 0.0
    steep = scene.replace({"d_c": 5e-8})
    way = np.where(np.abs(state.mode) == 1, state.mode, 0)
    weakening = Weakening(steep.law, way, state.s_0, state.y[0, 0])
    weakening.cell[:] = 0
    q = known.coordinates(state.y[:, :2], state.rod[:3])
    assert rests.slipping(state.mode != OPEN, weakening, q).grows > 0


def test_where_slip_is_left_to_dynamics():
    scene = rod()
    change = scene.replace
    assert scene.law.slides
    assert change({"alpha": 0.1}).law.slides
    assert change({"d_c": 0.0}).law.slides
    assert not change({"law": SpeedDependent(v=(0.0, 0.1), factor=(1.0, 0.8))}).law.slides
    by_time = pyfric.laws.TabulatedLaw(age_time=(0.0, 1e-3), age_factor=(1.0, 0.9))
    assert not change({"law": by_time}).law.slides
    assert not pyfric.preset("slow").law.slides
    assert not pyfric.preset("rate_and_state").law.slides


@pytest.mark.usefixtures("cheap_attempts")
@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_blocks_that_are_drawn_along_are_jumped_over(geometry, monkeypatch):
    """With mu_k from the first slip on, the driver draws three blocks; all others stick."""
    drawn = np.arange(9) < 3
    scene = rod(d_c=0.0, mu_s=np.where(drawn, 0.3, 5.0), mu_k=np.where(drawn, 0.29, 4.9))
    known = run(scene, 0.04, "dynamic", energies=False, geometry=geometry)
    made = run(scene, 0.04, "hybrid", geometry=geometry)
    assert (np.abs(known.final_state.mode) == 1).any()
    assert made.counts["slides"] > 0
    assert made.counts["steps"] < 0.5 * known.counts["steps"]
    for name in ("block", "old", "new"):
        np.testing.assert_array_equal(made.switches[name], known.switches[name])
    np.testing.assert_allclose(made.final_state.y[:, :2], known.final_state.y[:, :2], atol=1e-11)
    monkeypatch.setattr(stable_slip, "FAST", 0.0)
    assert run(scene, 0.04, "hybrid", geometry=geometry).counts["slides"] == 0


@pytest.mark.usefixtures("cheap_attempts")
def test_a_plate_that_moves_on_the_top_draws_slip():
    """The driver rests, and the plate's speed defines slow slip."""
    size = {"L": 0.02, "H": 0.012, "l": 1e-3, "h": 3e-3, "F_N": 400.0, "d_c": 5e-6}
    scene = setup2(**size, V=0.0, k_top=5e5, V_top=2e-3)
    known = run(scene, 0.03, "dynamic", energies=False)
    made = run(scene, 0.03, "hybrid")
    assert len(known.switches["t"])
    assert made.counts["slides"] > 0
    assert made.counts["steps"] < 0.25 * known.counts["steps"]
    np.testing.assert_array_equal(made.switches["block"], known.switches["block"])
    np.testing.assert_allclose(made.switches["t"], known.switches["t"], rtol=0, atol=1e-6)
