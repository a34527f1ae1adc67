"""Reduced ring-down: against stepping, dense eigenvalues, static states."""

import dataclasses

import numpy as np
import pytest
from scipy.sparse.linalg import ArpackNoConvergence

from pyfric import core
from pyfric.core import OPEN
from pyfric.engines import ringdown
from pyfric.engines.ringdown import Frozen, Rest
from pyfric.scene import chain, setup1, setup2
from pyfric.statics import EquilibriumError, StaticSolver, damping, mass

DT_SHARE = 0.5


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 1e-4, "mu_s": 50.0} | changes)


def free(**changes):
    return setup2(**{"L": 0.012, "H": 0.005, "F_N": 50.0, "V": 1e-4, "mu_s": 50.0} | changes)


SCENES = {"rod": rod(), "free": free(theta=0.3), "right": free(side="right", h=4e-3)}
OPENED = {"rod, open": (rod(h=0.01), 1e-4), "free, open": (free(h=5e-3), 3e-5)}
"""Scenes with much friction, and displacements of the driver that lift blocks off."""


class Slider:
    """A scene, a state of rest, its frozen slider and the forces of the core."""

    def __init__(self, scene, geometry="linear", drive=0.0, dt=None):
        self.scene, self.geometry = scene, geometry
        self.solver = StaticSolver(scene, geometry)
        u_x = self.solver.loaded.u[0, 0]
        self.rest = self.solver.solve(u_x, drive)
        self.stuck = ~self.rest.open
        self.dt = 4e-7 if dt is None else dt
        self.frozen = Frozen(self.solver, self.stuck, self.dt)
        self.q = self.solver.coordinates(self.rest.u, self.rest.rod)
        self.model = core.model(scene, geometry, self.solver.loaded.u_drv0)
        self.t0 = drive / scene.driver.V

    def state(self, w, v):
        """Return the state that deviates from the drifting one by w and v."""
        frozen, V = self.frozen, self.scene.driver.V
        state = self.rest.state(self.scene, self.dt, self.t0)
        held = state.y[0, 0].copy()
        where = self.solver.displacements
        state.y[:, :2], state.rod[:3] = where(self.q + frozen.lag + w)
        state.y[:, 2:], state.rod[3:] = where(V * frozen.drift + v)
        state.y[0, 0, self.stuck], state.y[0, 2, self.stuck] = held[self.stuck], 0.0
        state.u_drv0 = self.solver.loaded.u_drv0
        return state

    def deviation(self, state):
        """Return w and v of a state."""
        frozen, V, since = self.frozen, self.scene.driver.V, state.t - self.t0
        w = self.solver.coordinates(state.y[:, :2], state.rod[:3])
        v = self.solver.coordinates(state.y[:, 2:], state.rod[3:])
        w -= self.q + V * since * frozen.drift + frozen.lag
        return w, v - V * frozen.drift

    def margins(self, state):
        """Return the margins that the core's forces leave."""
        forces, stuck = core.evaluate(self.model, state, state.t), self.stuck
        load, f = self.scene.interface.mu_s * forces.p[stuck], forces.f[stuck]
        return np.concatenate([load + f, load - f, self.scene.k_f * state.y[0, 1, ~stuck]])

    def expected_margins(self, a, s):
        frozen, V = self.frozen, self.scene.driver.V
        still = frozen.margins(self.rest) + frozen.margin_lag + V * s * frozen.margin_rate
        return still + (frozen.modal @ (frozen.weight * a * np.exp(frozen.growth * s))).real

    def smooth(self, seed=0, size=1e-9):
        """Return a smooth random deviation and rate, and one that is rough."""
        rng = np.random.default_rng(seed)
        _, factor, unknown = self.solver.tangent(self.stuck)
        w, v = (np.zeros(len(self.q)) for _ in range(2))
        w[unknown] = factor.solve(rng.standard_normal(len(unknown)))
        v[unknown] = factor.solve(rng.standard_normal(len(unknown)))
        rough = np.zeros(len(self.q))
        rough[unknown] = rng.standard_normal(len(unknown))
        scale = size / np.abs(w).max()
        v *= size * 1e5 / np.abs(v).max()
        return w * scale + 0.02 * size * rough, v


def step(slider, state, n):
    log = core.Log(slider.scene.N_x)
    assert core.advance(slider.model, state, log, n) == core.Status.DONE
    assert log.n_switch == 0
    return state


def sliders():
    cases = {name: (scene, 0.0) for name, scene in SCENES.items()} | OPENED
    return pytest.mark.parametrize(("scene", "drive"), cases.values(), ids=cases)


# --- against stepping ----------------------------------------------------------------------------


@sliders()
def test_ring_down_is_that_of_the_steps(scene, drive):
    """Amplitudes to rounding; the remainder stays within its bound and decays as promised."""
    slider = Slider(scene, drive=drive)
    frozen = slider.frozen
    assert slider.rest.open.any() == (drive > 0)
    state = slider.state(*slider.smooth())
    begin = frozen.split(*slider.deviation(state))
    assert begin.remainder > 0
    bound = frozen.bound * np.sqrt(begin.remainder)
    rounding = 1e-9 * scene.F_N / scene.N_x
    worst = 0.0
    for n in (1, 3, 10, 30, 100, 300, 1000):
        step(slider, state, n)
        s = state.t - slider.t0
        now = frozen.split(*slider.deviation(state))
        expected = begin.a * np.exp(frozen.growth * s)
        np.testing.assert_allclose(now.a, expected, rtol=0, atol=1e-8 * np.abs(begin.a).max())
        fades = np.exp(-frozen.decay * s)
        assert now.remainder <= begin.remainder * fades**2 * (1 + 1e-9) + 1e-24
        rest = slider.margins(state) - slider.expected_margins(begin.a, s)
        assert (np.abs(rest) <= bound * fades + rounding).all()
        worst = max(worst, np.max(np.abs(rest) / bound))
    assert worst > 1e-3  # or the bound says nothing


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_ring_down_in_finite_geometry(scene):
    """Good to the strains, a few 1e-3, also at a state that is not the loaded one."""
    slider = Slider(scene, "finite", drive=1e-6)
    frozen = slider.frozen
    state = slider.state(*slider.smooth())
    begin = frozen.split(*slider.deviation(state))
    same, stiffer = frozen.tangent_at(slider.solver.coordinates(slider.rest.u, slider.rest.rod))
    assert same is frozen
    growth = frozen.growth_with(stiffer)
    bound = frozen.bound * np.sqrt(begin.remainder)
    size = np.abs(frozen.modal * begin.a).sum(axis=1)
    for n in (1, 10, 100, 1000):
        step(slider, state, n)
        s = state.t - slider.t0
        now = frozen.split(*slider.deviation(state))
        expected = begin.a * np.exp(growth * s)
        np.testing.assert_allclose(now.a, expected, rtol=0, atol=0.02 * np.abs(begin.a).max())
        assert now.remainder <= 1.1 * begin.remainder
        rest = slider.margins(state) - slider.expected_margins(begin.a, s)
        assert (np.abs(rest) <= 1.1 * bound + 0.02 * size.max()).all()


def test_stiffness_of_the_state_corrects_the_rates():
    """The first-order change of the rates against the modes of the changed stiffness."""
    scene = rod()
    one, other = Slider(scene, "finite"), Slider(scene, "finite", drive=2e-5)
    solver = other.solver
    q = solver.coordinates(other.rest.u, other.rest.rod)
    corrected = other.frozen.growth_with(other.frozen.stiffer(q))
    solver.linearise(other.q)  # as if this were the loaded state
    exact = Frozen(solver, other.stuck, other.dt).growth
    slow = np.argsort(np.abs(one.frozen.rates))[:6]
    for k in slow:
        error = np.min(np.abs(exact - corrected[k]))
        change = np.min(np.abs(exact - one.frozen.growth[k]))
        assert change > 1e-5 * np.abs(exact).min()
        assert error < 0.05 * change


def test_slow_modes_follow_the_stiffness_of_the_state():
    slider = Slider(rod(), "finite", drive=2e-5)
    old, n = slider.frozen, ringdown.RENEWED
    q = slider.solver.coordinates(slider.rest.u, slider.rest.rod)
    found = Frozen(slider.solver, slider.stuck, slider.dt, at=q, near=old)
    exact = Frozen(slider.solver, slider.stuck, slider.dt, at=q)
    np.testing.assert_array_equal(found.rates[n:], old.rates[n:])
    change = np.abs(exact.rates - old.rates)[:n]
    assert (np.abs(found.rates - exact.rates)[:n] < 1e-3 * change).all()
    motions = [exact.deviation(a, 0.0) for a in np.eye(n, len(exact.rates))]
    before, after = (
        np.array([one.split(*motion).remainder for motion in motions]) for one in (old, found)
    )
    assert (after < 0.05 * before).all()
    assert after[0] < 1e-6 * before[0]


def test_a_course_leads_to_the_states_nearby():
    """Along the tangent of the state, not of the loaded one: what is left falls with the square."""
    slider = Slider(rod(), "finite", drive=1e-5)
    frozen, solver, V = slider.frozen, slider.solver, slider.scene.driver.V
    rest = Rest(slider.q, *(getattr(slider.rest, name) for name in ("f", "tau", "p", "u_z", "F_T")))
    left = []
    for stiffer in (None, frozen.stiffer(slider.q)):
        course = frozen.course(V, stiffer=stiffer)
        for by in (2e-8, 4e-8):
            found = frozen.moved(rest, course, by / V)
            exact = solver.solve(slider.rest.u[0, 0], slider.rest.drive + by, start=slider.rest)
            left.append([np.abs(found.f - exact.f).max(), np.abs(found.p - exact.p).max()])
            left[-1].append(abs(found.F_T - exact.F_T))
    loaded, _, own, twice = np.array(left)
    assert (own < 0.05 * loaded).all()
    assert (twice < 5 * own + 1e-9).all()


# --- parts ---------------------------------------------------------------------------------------


@sliders()
def test_the_parts_make_the_whole(scene, drive):
    slider = Slider(scene, drive=drive)
    frozen = slider.frozen
    w, v = slider.smooth(seed=1)
    motion = frozen.split(w, v)
    w_modes, v_modes = frozen.deviation(motion.a, 0.0)
    modes = frozen.split(w_modes, v_modes)
    np.testing.assert_allclose(modes.a, motion.a, rtol=0, atol=1e-6 * np.abs(motion.a).max())
    rest = frozen.split(w - w_modes, v - v_modes)
    assert np.abs(rest.a).max() < 1e-6 * np.abs(motion.a).max()
    assert rest.remainder == pytest.approx(motion.remainder, rel=1e-9)
    assert modes.remainder < 1e-12 * motion.remainder


@sliders()
def test_energy_is_that_of_the_core(scene, drive, monkeypatch):
    """Without modes, all energy is in the remainder: that of the core, loads aside."""

    def fail(*_, **__):
        raise ArpackNoConvergence("nothing converged", np.zeros(0), np.zeros((0, 0)))

    monkeypatch.setattr(ringdown, "eigs", fail)
    slider = Slider(scene, drive=drive)
    assert slider.frozen.rates.shape == (0,)
    assert slider.frozen.decay == 0
    w, v = slider.smooth(seed=2, size=1e-7)
    slider.frozen.lag[:], slider.frozen.drift[:] = 0, 0
    values = []
    for sign in (1, -1, 0):  # the loads' part of the energy is odd in w
        state = slider.state(sign * w, sign * v)
        values.append(sum(core.energies(slider.model, state, slider.t0).values()))
    energy = (values[0] + values[1]) / 2 - values[2]
    assert slider.frozen.split(w, v).remainder == pytest.approx(energy, rel=1e-5)


@sliders()
def test_rates_of_the_margins_are_those_of_static_states(scene, drive):
    slider = Slider(scene, drive=drive)
    frozen, solver = slider.frozen, slider.solver
    more = 1e-7
    there = solver.solve(slider.rest.u[0, 0], drive + more, free=slider.rest.open)
    change = (frozen.margins(there) - frozen.margins(slider.rest)) / more
    scale = np.abs(change).max()
    np.testing.assert_allclose(frozen.margin_rate, change, rtol=0, atol=1e-6 * scale)
    assert frozen.force_rate == pytest.approx((there.F_T - slider.rest.F_T) / more, rel=1e-6)


@sliders()
def test_the_drifting_state_drifts(scene, drive):
    """Nothing accelerates in it, and its margins and force differ by the lag."""
    scene = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, V=0.01))
    slider = Slider(scene, drive=drive)
    frozen = slider.frozen
    state = slider.state(np.zeros(len(slider.q)), np.zeros(len(slider.q)))
    forces = core.evaluate(slider.model, state, slider.t0)
    acceleration = forces.a.copy()
    acceleration[0, 0, slider.stuck] = 0
    assert np.abs(acceleration).max() * scene.m < 1e-8 * scene.F_N / scene.N_x
    lag = slider.margins(state) - frozen.margins(slider.rest)
    np.testing.assert_allclose(frozen.margin_lag, lag, rtol=0, atol=1e-8 * scene.F_N)
    assert np.abs(frozen.margin_lag).max() > 1e-6 * scene.F_N
    F_T = forces.F_T - slider.rest.F_T
    assert frozen.force_lag == pytest.approx(F_T, rel=1e-6, abs=1e-9 * scene.F_N)


@pytest.mark.parametrize("eta", [None, 1e3])
@sliders()
def test_bound_is_above_the_worst_remainder(scene, drive, eta):
    """Of all w and v of energy E, in a dense solution; and it is not far above."""
    scene = dataclasses.replace(scene, slider=dataclasses.replace(scene.slider, eta=eta))
    slider = Slider(scene, drive=drive, dt=1e-9)
    frozen, stuck, N_x = slider.frozen, slider.stuck, scene.N_x
    K, _, unknown = slider.solver.tangent(stuck)
    K, C = K.toarray(), damping(scene).toarray()
    held, lifted = np.flatnonzero(stuck), np.flatnonzero(~stuck)
    p = np.zeros((len(held), len(K)))
    p[np.arange(len(held)), held + N_x] = -scene.interface.mu_s * scene.k_f
    up = np.zeros((len(lifted), len(K)))
    up[np.arange(len(lifted)), lifted + N_x] = scene.k_f
    rows = np.concatenate([p + K[held], p - K[held], up])[:, unknown]
    rows_v = np.concatenate([C[held], -C[held], 0 * up])[:, unknown]
    inside = K[np.ix_(unknown, unknown)]
    stiff = np.sum(rows * np.linalg.solve(inside, rows.T).T, axis=1)
    worst = np.sqrt(2 * (stiff + np.sum(rows_v**2 / mass(scene)[unknown], axis=1)))
    assert (frozen.bound >= worst * (1 - 1e-9)).all()
    assert (frozen.bound <= 3 * worst).all()


def test_margin_is_the_smaller_margin():
    slider = Slider(*OPENED["rod, open"][:1], drive=OPENED["rod, open"][1])
    margin = slider.frozen.margin(slider.frozen.margins(slider.rest))
    rest = slider.rest
    expected = slider.scene.interface.mu_s * rest.p - np.abs(rest.f)
    np.testing.assert_allclose(margin, np.where(rest.open, 0, expected), rtol=1e-12)


# --- eigenvalues ---------------------------------------------------------------------------------

ODD = {
    "rod": rod(),
    "free": free(),
    "little viscosity": rod(eta=1e-3),
    "no viscosity": free(eta=0.0),
    "much viscosity": rod(eta=1e3),
    "very much": free(eta=1e5),
    "hard foundation": free(k_f=1e10),
    "soft foundation": rod(k_f=1e4),
    "stiff driver": rod(K=1e10),
    "heavy rod": rod(mass=1e3),
    "light rod": rod(mass=1e-6, mattress=0.0),
    "smallest": free(L=2e-3, H=1e-3, h=1e-3),
    "smallest under a rod": rod(L=5e-3, H=2.5e-3, h=2.5e-3),
}


@pytest.mark.parametrize("scene", ODD.values(), ids=ODD)
def test_eigenvalues_are_the_slow_ones_of_a_dense_solution(scene):
    """And those left out decay at least at `decay`."""
    solver = StaticSolver(scene)
    stuck = np.ones(scene.N_x, dtype=bool)
    frozen = Frozen(solver, stuck)
    K, _, unknown = solver.tangent(stuck)
    K, C = (A.toarray()[np.ix_(unknown, unknown)] for A in (K, damping(scene)))
    M, n = mass(scene)[unknown], len(unknown)
    unit = np.sqrt(scene.slider.k / scene.m)
    A = np.block([[np.zeros((n, n)), unit * np.eye(n)], [-K / M[:, None] / unit, -C / M[:, None]]])
    exact = np.linalg.eigvals(A)
    found = np.concatenate([frozen.rates, frozen.rates[frozen.rates.imag > 0].conj()])
    left = list(exact)
    for rate in found:
        nearest = int(np.argmin(np.abs(np.array(left) - rate)))
        # A double eigenvalue is known to the root of the rounding only.
        assert abs(left[nearest] - rate) < 1e-6 * abs(rate) + 1e-9 * np.abs(exact).max()
        del left[nearest]
    left = np.array(left)
    assert np.abs(left).min() >= np.abs(found).max() * (1 - 1e-6)
    assert -left.real.max() >= frozen.decay * (1 - 1e-6) - 1e-9 * np.abs(exact).max()
    assert (frozen.rates.real <= 0).all()


def test_a_stuck_chain_has_no_modes():
    frozen = Frozen(StaticSolver(chain(L=0.02, k_top=1e6)), np.ones(9, dtype=bool))
    assert frozen.rates.shape == (0,)
    assert frozen.decay == 0


# --- open blocks ----------------------------------------------------------------------------------


def test_open_blocks_are_watched():
    """The margins end with those of open blocks, positive while they are open."""
    scene, drive = OPENED["free, open"]
    slider = Slider(scene, drive=drive)
    n_open = int(slider.rest.open.sum())
    margins = slider.frozen.margins(slider.rest)
    assert margins.shape == (2 * scene.N_x - n_open,)
    assert n_open > 0
    assert (margins > 0).all()
    state = slider.state(*slider.smooth())
    assert (state.mode == OPEN).sum() == n_open


def test_nothing_rings_where_all_blocks_are_open():
    scene = setup1(L=5e-3, H=2.5e-3, h=2.5e-3)
    with pytest.raises(EquilibriumError, match="not supported"):
        Frozen(StaticSolver(scene), np.zeros(3, dtype=bool))


@pytest.mark.parametrize(
    "scene", [setup1(), setup2(), setup1(l=5e-3)], ids=["rod", "free", "coarse"]
)
def test_decay_of_what_the_modes_leave_out_is_about_that_of_weyl_s_law(scene):
    frozen = Frozen(StaticSolver(scene, "finite"), np.ones(scene.N_x, dtype=bool))
    assert frozen.decay < ringdown.remainder_decay(scene, "finite") < 1.6 * frozen.decay
