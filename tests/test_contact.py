"""Contact states of tiny sliders, compared with all possible states and with minima of energy.

The oracle is the lattice as one dense matrix, summed bond by bond in plain loops.
"""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from test_lattice import neighbours

from pyfric.core import OPEN, STUCK
from pyfric.scene import setup1, setup2
from pyfric.statics import ContactProblem, EquilibriumError, StaticSolver, loaded_state

ROUNDED = 1e-9
"""Tolerance of conditions, over F_N/N_x. The error of the oracle is up to 1e-11."""


@st.composite
def sliders(draw, **friction):
    """Return scenes of 3 or 4 columns and 2 or 3 rows, under a rod or a load of any size."""
    n_x, n_z = draw(st.integers(2, 3)), draw(st.integers(1, 2))
    soft, side = draw(st.sampled_from([1e-2, 1.0, 10.0])), draw(st.sampled_from(["left", "right"]))
    F_N = draw(st.sampled_from([1.0, 100.0, 4e3]))
    h = draw(st.integers(1, n_z))
    if draw(st.booleans()):
        size = {"L": n_x * 2.5e-3, "H": n_z * 2.5e-3, "h": h * 2.5e-3, "k_f": soft * 13.5e6}
        return setup1(**size, F_N=F_N, side=side, **friction)
    theta = draw(st.sampled_from([-1.0, -0.5, 0.0, 0.3, 0.833, 1.0]))
    size = {"L": n_x * 1e-3, "H": n_z * 1e-3, "h": h * 1e-3, "k_f": soft * 9.375e6}
    return setup2(**size, F_N=F_N, theta=theta, side=side, **friction)


class Dense:
    """The lattice in coordinates as a dense matrix, without foundation and driver."""

    def __init__(self, scene):
        self.scene, N_x, N_z = scene, scene.N_x, scene.N_z
        n = 2 * N_x * N_z

        def at(j, i, c):
            return (2 * j + c) * N_x + i

        K, load = np.zeros((n, n)), np.zeros(n)
        for (j, i), (J, I), k in neighbours(scene):
            e = np.array([I - i, J - j]) / np.hypot(I - i, J - j)
            for a, b in itertools.product((0, 1), repeat=2):
                for (p, q), sign in zip(
                    itertools.product(((j, i), (J, I)), repeat=2), (1, -1, -1, 1), strict=True
                ):
                    K[at(*p, a), at(*q, b)] += sign * k * e[a] * e[b]
        if scene.rigid:
            T = np.zeros((n, n - 2 * N_x + 3))
            T[: n - 2 * N_x, : n - 2 * N_x] = np.eye(n - 2 * N_x)
            for i in range(N_x):
                T[at(N_z - 1, i, 0), -3] = T[at(N_z - 1, i, 1), -2] = 1.0
                T[at(N_z - 1, i, 1), -1] = scene.x[i]
        else:
            T = np.eye(n)
            for i in range(N_x):
                load[at(N_z - 1, i, 1)] = -scene.load[i]
        self.K, self.load, self.T = T.T @ K @ T, T.T @ load, T
        if scene.rigid:
            self.K[-1, -1] += scene.kappa
            self.load[-2] = -scene.F_N
        self.driven = T[at(scene.j_h, scene.i_h, 0)]

    def rest(self, mode, u_x, mu_k, drive=None):
        """Return u_x, u_z, f, p and q in these contact states; None without support.

        `drive` is the position of the driver's end, None without a driver; stuck blocks are at u_x.
        """
        scene, N, K, load = self.scene, self.scene.N_x, self.K.copy(), self.load.copy()
        if drive is not None:
            K += scene.driver.K * np.outer(self.driven, self.driven)
            load += scene.driver.K * scene.d * drive * self.driven
        bare, given_load = K.copy(), load.copy()
        for i in range(N):
            if mode[i] != OPEN:
                K[N + i, N + i] += scene.k_f
                K[i, N + i] -= mode[i] * mu_k * scene.k_f  # f = -mode mu_k p, p = -k_f u_z
        q = np.zeros(len(K))
        q[:N] = np.where(mode == STUCK, u_x, 0.0)
        free = np.ones(len(K), dtype=bool)
        free[:N] = mode != STUCK
        A = K[np.ix_(free, free)] / scene.slider.k
        if np.linalg.cond(A) > 1e11:
            return None
        q[free] = np.linalg.solve(A, (load - K @ q)[free] / scene.slider.k)
        p = np.where(mode == OPEN, 0.0, -scene.k_f * q[N : 2 * N])
        f = np.where(mode == STUCK, (bare @ q - given_load)[:N], -mode * mu_k * p * (mode != OPEN))
        return q[:N], q[N : 2 * N], f, p, q


def same_forces(state, found, scene):
    """Check that the forces on the interface are those of the oracle."""
    unit = scene.F_N / scene.N_x
    return max(np.abs(state.f - found[2]).max(), np.abs(state.p - found[3]).max()) < 1e-7 * unit


def same(state, found, scene):
    """Check that forces and displacements are those of the oracle."""
    apart, size = np.abs(state.u[0, 0] - found[0]).max(), np.abs(np.stack(found[:2])).max()
    return same_forces(state, found, scene) and apart < 1e-7 * size


def all_loaded(scene):
    """Return all states that meet the conditions of loading."""
    dense, law, unit = Dense(scene), scene.interface, scene.F_N / scene.N_x
    tol, found = ROUNDED * unit, []
    for mode in itertools.product((STUCK, 1, -1, OPEN), repeat=scene.N_x):
        mode = np.array(mode)
        state = dense.rest(mode, np.zeros(scene.N_x), law.mu_k)
        if state is None:
            continue
        u_x, u_z, f, p, _ = state
        right = np.where(mode == OPEN, scene.slider.k * u_z >= -tol, p >= -tol)
        right &= np.where(mode == STUCK, np.abs(f) <= law.mu_s * p + tol, True)
        right &= np.where(np.abs(mode) == 1, mode * u_x * scene.slider.k >= -tol, True)
        if right.all():
            found.append(state)
    return found


@settings(max_examples=25)
@given(data=st.data(), mu=st.sampled_from([0.01, 0.1, 0.2, 0.3, 0.7]))
def test_the_loaded_state_is_the_only_one_that_meets_its_conditions(data, mu):
    """Its forces are unique; if all blocks slip, their common displacement is not."""
    scene = data.draw(sliders(mu_s=mu, mu_k=mu))
    found, state = all_loaded(scene), loaded_state(scene)
    assert any(same(state, one, scene) for one in found)
    assert all(same_forces(state, one, scene) for one in found)
    contact = ContactProblem(scene).loaded()
    np.testing.assert_array_equal(contact.closed, ~state.open)


@settings(max_examples=25)
@given(
    data=st.data(),
    mu_s=st.sampled_from([0.05, 0.15, 0.25]),
    share=st.sampled_from([0.0, 0.3, 0.7, 0.95]),
)
def test_the_loaded_state_is_one_of_those_that_meet_their_conditions(data, mu_s, share):
    """With mu_s > mu_k there can be several such states."""
    scene = data.draw(sliders(mu_s=mu_s, mu_k=share * mu_s))
    state = loaded_state(scene)
    assert any(same(state, one, scene) for one in all_loaded(scene))


@settings(max_examples=30)
@given(
    data=st.data(),
    push=st.floats(-2.0, 2.0),
    shape=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
    mask=st.integers(0, 15),
)
def test_held_blocks_touch_where_no_other_set_would_do(data, push, shape, mask):
    """Both static solvers are compared with all sets of open blocks; free blocks lack friction."""
    scene = data.draw(sliders())
    N, unit, dense = scene.N_x, scene.F_N / scene.N_x, Dense(scene)
    free = (mask >> np.arange(N)) % 2 == 1
    assume(not free.all())
    solver = StaticSolver(scene)
    u_x = np.array(shape[:N]) * unit / scene.slider.k
    drive = push * scene.F_N / scene.driver.K
    try:
        state = solver.solve(u_x, drive, free=free)
    except EquilibriumError:
        return  # the slider tips over
    tol, found = ROUNDED * max(unit, abs(state.F_T)), []
    for closed in itertools.product((True, False), repeat=N):
        mode = np.where(closed, np.where(free, 1, STUCK), OPEN)
        rest = dense.rest(mode, u_x, 0.0, drive + scene.d * solver.u_drv0)
        if rest is None:
            continue
        if (np.where(closed, rest[3], scene.slider.k * rest[1]) >= -tol).all():
            found.append(rest)
    loose = ~state.open & ~free & (state.u[0, 0] != u_x)
    assert loose.any() or any(same(state, one, scene) for one in found)
    assert not loose.any() or not found
    assert (state.f[loose] == 0).all()
    table = ContactProblem(scene).solve(u_x, drive, free=free)
    if len(found) == 1:
        scale = 1e-7 * max(unit, abs(state.F_T))
        np.testing.assert_allclose(table.p, state.p, rtol=0, atol=scale)
        np.testing.assert_allclose(table.tau, state.tau, rtol=0, atol=scale)
        assert table.F_T == pytest.approx(state.F_T, rel=0, abs=scale)


@settings(max_examples=20)
@given(data=st.data(), push=st.floats(-0.5, 0.5))
def test_without_friction_energy_is_least(data, push):
    """SciPy minimises the energy of lattice, foundation and driver, without contact states."""
    scene = data.draw(sliders(mu_s=0.0, mu_k=0.0))
    N, dense, unit = scene.N_x, Dense(scene), scene.F_N / scene.N_x
    solver = StaticSolver(scene)
    drive = push * unit / scene.driver.K
    X = drive + scene.d * solver.u_drv0
    k, length = scene.slider.k, unit / scene.slider.k

    def energy(q):
        q = q * length
        depth, stretch = np.minimum(q[N : 2 * N], 0.0), X - scene.d * (dense.driven @ q)
        E = q @ dense.K @ q / 2 + scene.k_f * (depth @ depth) / 2 - dense.load @ q
        E += scene.driver.K * stretch**2 / 2
        g = dense.K @ q - dense.load - scene.driver.K * scene.d * stretch * dense.driven
        g[N : 2 * N] += scene.k_f * depth
        return E / (k * length**2), g / (k * length)

    try:
        state = solver.solve(np.zeros(N), drive, free=np.ones(N, dtype=bool))
    except EquilibriumError:
        return
    q = solver.coordinates(state.u, state.rod) / length
    least, slope = energy(q)
    arm = np.ones(len(q))
    arm[-1] = scene.slider.L / 2 if scene.rigid else 1.0
    assert np.abs(slope / arm).max() < 1e-8
    shaken = q + np.random.default_rng(0).standard_normal((200, len(q))) * np.abs(q).max() * 0.1
    assert min(energy(one)[0] for one in shaken) > least
    found = minimize(energy, q * 0.0, jac=True, method="L-BFGS-B", options={"maxiter": 20_000})
    assert found.fun >= least - 1e-9 * abs(least)


@settings(max_examples=40)
@given(
    data=st.data(),
    push=st.floats(-0.4, 0.4),
    seed=st.integers(0, 1000),
    geometry=st.sampled_from(["linear", "finite"]),
)
def test_states_of_rest_are_in_balance(data, push, seed, geometry):
    """Forces balance; in linear geometry also sum p x = sum load x + d F_T h + kappa phi."""
    scene, rng = data.draw(sliders()), np.random.default_rng(seed)
    try:
        solver = StaticSolver(scene, geometry)
    except EquilibriumError:  # a slider on soft ground that topples under a load on one side
        linear = StaticSolver(scene, "linear").loaded.u
        assert geometry == "finite"
        assert np.abs(linear).max() > 0.1 * scene.slider.l
        return
    u_x = solver.loaded.u[0, 0] + 0.3 * scene.F_N / scene.slider.k * rng.standard_normal()
    free = rng.random(scene.N_x) < 0.3
    try:
        state = solver.solve(u_x, push * scene.F_N / scene.driver.K, free=free)
    except EquilibriumError:
        return
    scale = max(scene.F_N, abs(state.F_T))
    assert state.p.sum() == pytest.approx(scene.F_N, rel=0, abs=1e-9 * scale)
    assert state.tau.sum() == pytest.approx(state.F_T, rel=0, abs=1e-9 * scale)
    assert (state.p >= 0).all()
    assert (state.p[state.open] == 0).all()
    assert (state.f[state.open] == 0).all()
    if geometry == "linear":
        torque = np.sum((state.p - scene.load) * scene.x) - scene.kappa * state.rod[2]
        arm = scene.d * state.F_T * scene.driver.h
        assert torque == pytest.approx(arm, rel=0, abs=1e-9 * scale * scene.slider.L)
