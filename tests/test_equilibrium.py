"""States of rest: loading, held interfaces, open blocks, both geometries."""

import dataclasses
import math
import warnings

import numpy as np
import pytest
import scipy.sparse as sp
import twin
from helpers import mirrored_scene, scaled, small_free, small_rod
from scipy.sparse.linalg import spsolve

from pyfric import core
from pyfric.scene import CoulombLaw, Scene, preset, setup1, setup2
from pyfric.statics import (
    ContactProblem,
    EquilibriumError,
    RememberedStates,
    StaticSolver,
    loaded_state,
    solve_static,
)
from pyfric.statics.equilibrium import _warn_if_ambiguous
from pyfric.values import SceneError

ARRAYS = ("u", "rod", "f", "tau", "p")


def direct(scene, held, closed, u_x, push, K_driver):
    """Return the linear equilibrium by one matrix with Lagrange multipliers for constraints.

    The unknowns are u of all blocks, X, Z, phi, and one force for each constraint (rod, held
    blocks). `push` is K times the position of the driver's end. Held blocks have the given u_x.

    Returns u (N_z, 2, N_x), phi, f (N_x,).
    """
    N_x, N_z, k = scene.N_x, scene.N_z, scene.slider.k
    n = 2 * N_x * N_z

    def at(j, i, c):
        return (j * N_x + i) * 2 + c

    K, load = sp.lil_array((n + 3, n + 3)), np.zeros(n + 3)
    for j in range(N_z):
        for i in range(N_x):
            for J, I, stiff in (
                (j, i + 1, k),
                (j + 1, i, k),
                (j + 1, i + 1, k / 2),
                (j + 1, i - 1, k / 2),
            ):
                if J < N_z and 0 <= I < N_x:
                    e = np.array([I - i, J - j]) / math.hypot(I - i, J - j)
                    for a in (0, 1):
                        for b in (0, 1):
                            w = stiff * e[a] * e[b]
                            K[at(j, i, a), at(j, i, b)] += w
                            K[at(J, I, a), at(J, I, b)] += w
                            K[at(j, i, a), at(J, I, b)] -= w
                            K[at(J, I, a), at(j, i, b)] -= w
    for i in np.flatnonzero(closed):
        K[at(0, i, 1), at(0, i, 1)] += scene.k_f
    driven = at(scene.j_h, scene.i_h, 0)
    K[driven, driven] += K_driver
    load[driven] += push
    conditions, values = [], []
    for i in np.flatnonzero(held):
        conditions.append({at(0, i, 0): 1.0})
        values.append(u_x[i])
    if scene.rigid:
        load[n + 1] = -scene.F_N
        K[n + 2, n + 2] = scene.kappa
        for i in range(N_x):
            conditions.append({at(N_z - 1, i, 0): 1.0, n: -1.0})
            conditions.append({at(N_z - 1, i, 1): 1.0, n + 1: -1.0, n + 2: -scene.x[i]})
            values += [0.0, 0.0]
    else:
        for i in range(N_x):
            load[at(N_z - 1, i, 1)] = -scene.load[i]
        for c in range(3):
            conditions.append({n + c: 1.0})
            values.append(0.0)
    A = sp.lil_array((len(conditions), n + 3))
    for row, condition in enumerate(conditions):
        for column, value in condition.items():
            A[row, column] = value
    # Conditions are scaled to the size of K, for the accuracy of the factorisation.
    system = sp.block_array([[K, k * A.T], [k * A, None]]).tocsc()
    solution = spsolve(system, np.concatenate([load, k * np.array(values)]))
    f = np.zeros(N_x)
    f[held] = -k * solution[n + 3 : n + 3 + int(np.sum(held))]
    u = solution[:n].reshape(N_z, N_x, 2).transpose(0, 2, 1)
    return u, solution[n + 2], f


def assert_matches_direct(state, scene, held, closed, u_x, driven):
    push = scene.driver.K * (scene.d * state.drive + state.u_drv0) if driven else 0.0
    K_driver = scene.driver.K if driven else 0.0
    u, phi, f = direct(scene, held, closed, u_x, push, K_driver)
    np.testing.assert_allclose(state.u, u, rtol=0, atol=1e-11 * np.abs(u).max())
    assert state.rod[2] == pytest.approx(phi, abs=1e-11 * np.abs(u).max() / scene.slider.L)
    np.testing.assert_allclose(state.f, f, rtol=0, atol=1e-11 * scene.F_N)
    p = np.where(closed, -scene.k_f * u[0, 1], 0.0)
    np.testing.assert_allclose(state.p, p, rtol=0, atol=1e-11 * scene.F_N)


def moment_error(state, scene):
    """Return sum p x - sum load x - d F_T h - kappa phi, over F_N L."""
    moment = np.sum((state.p - scene.load) * scene.x)
    moment -= scene.d * state.F_T * scene.driver.h + scene.kappa * state.rod[2]
    return abs(moment) / (scene.F_N * scene.slider.L)


def assert_same(one, two):
    for name in (*ARRAYS, "open", "slipped"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.F_T == two.F_T


# --- the loaded state ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene", [setup1(), small_free(theta=0.833), small_rod(side="right", h=0.015, k_f=3e6)]
)
def test_loaded_state_is_that_of_a_direct_solve(scene):
    state = loaded_state(scene)
    everywhere = np.ones(scene.N_x, dtype=bool)
    assert not state.slipped.any()
    assert not state.open.any()
    assert_matches_direct(state, scene, everywhere, everywhere, np.zeros(scene.N_x), driven=False)
    assert state.u_drv0 == state.u[scene.j_h, 0, scene.i_h]


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize(
    "scene",
    [setup1(), setup1(side="right"), setup2(), preset("setup2+"), setup2(theta=0.4, side="right")],
)
def test_loaded_state_is_in_balance(scene, geometry):
    state = loaded_state(scene, geometry)
    assert state.F_T == 0.0
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-12)
    assert abs(state.tau.sum()) < 1e-12 * scene.F_N
    assert (state.u[0, 0] == 0).all()
    if geometry == "linear":
        assert moment_error(state, scene) < 1e-12


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [setup1(), setup2()])
def test_p_is_symmetric_and_tau_antisymmetric(scene, geometry):
    state = loaded_state(scene, geometry)
    unit = scene.F_N / scene.N_x
    np.testing.assert_allclose(state.p, state.p[::-1], rtol=0, atol=1e-11 * unit)
    np.testing.assert_allclose(state.tau, -state.tau[::-1], rtol=0, atol=1e-11 * unit)
    assert np.abs(state.tau).max() > 0.1 * unit


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize(
    ("scene", "expected"),
    [(setup1(), 0.25), (setup2(), 0.25), (preset("setup2+"), 0.375), (preset("setup2-"), 0.375)],
)
def test_frustrated_expansion_is_that_of_the_paper_scenes(scene, expected, geometry):
    """max |tau|/p agrees with another program (model.md)."""
    state = loaded_state(scene, geometry)
    assert np.max(np.abs(state.tau) / state.p) == pytest.approx(expected, rel=0.015)


def test_states_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        loaded_state(setup2()).u[0, 0, 0] = 1.0


# --- held interfaces -----------------------------------------------------------------------------


def a_held_interface(scene, seed=1):
    """Return an interface with 1 um slip at the trailing edge, noise, and F_T near 0.3 F_N."""
    n, N_x = scene.n_of_i, scene.N_x
    noise = np.random.default_rng(seed).uniform(0.9, 1.1, N_x)
    u_x = scene.d * noise * 0.05 * scene.F_N / scene.driver.K * np.exp(-4 * n / N_x)
    return u_x, 0.3 * scene.F_N / scene.driver.K


@pytest.mark.parametrize("scene", [small_rod(), small_rod(side="right", h=0.015), small_free()])
def test_held_interface_is_that_of_a_direct_solve(scene):
    u_x, drive = a_held_interface(scene)
    state = solve_static(scene, u_x, drive)
    held = ~state.open
    assert state.F_T > 0.1 * scene.F_N
    assert_matches_direct(state, scene, held, held, u_x, driven=True)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize(
    "scene",
    [setup1(), setup1(side="right"), preset("setup2-"), setup2(theta=0.4, side="right")],
)
def test_held_interface_is_in_balance(scene, geometry):
    """Forces balance and, in linear geometry, sum p x = sum load x + d F_T h + kappa phi."""
    u_x, drive = a_held_interface(scene)
    state = solve_static(scene, u_x, drive, geometry=geometry)
    assert state.F_T > 0.1 * scene.F_N
    assert state.tau.sum() == pytest.approx(state.F_T, rel=1e-12)
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-12)
    np.testing.assert_array_equal(state.u[0, 0], u_x)
    u_h = state.u[scene.j_h, 0, scene.i_h]
    stretch = drive - scene.d * (u_h - loaded_state(scene, geometry).u_drv0)
    assert state.F_T == pytest.approx(scene.driver.K * stretch, rel=1e-12)
    if geometry == "linear":
        assert moment_error(state, scene) < 1e-12
        assert abs(state.rod[2]) > 1e-6 or not scene.rigid


@pytest.mark.parametrize("side", ["left", "right"])
def test_finite_state_is_in_balance_about_any_point(side):
    """Moments of all outer forces are taken at the present positions of the blocks."""
    scene = setup2(theta=0.4, side=side)
    u_x, drive = a_held_interface(scene)
    state = solve_static(scene, u_x, drive, geometry="finite")
    z, x = np.mgrid[: scene.N_z, : scene.N_x] * scene.slider.l
    x, z = x + state.u[:, 0] - scene.slider.L / 2, z + state.u[:, 1]
    driven = scene.j_h, scene.i_h
    moment = np.sum(x[0] * state.p - z[0] * state.f) - np.sum(x[-1] * scene.load)
    moment -= z[driven] * scene.d * state.F_T
    assert abs(moment) < 1e-12 * scene.F_N * scene.slider.L
    shift = np.sum(state.u[0, 0] * state.p - state.u[0, 1] * state.f)
    assert abs(shift) > 1e-6 * scene.F_N * scene.slider.L


def test_without_drive_and_slip_the_loaded_state_returns():
    for geometry in ("linear", "finite"):
        scene = small_rod()
        loaded = loaded_state(scene, geometry)
        state = solve_static(scene, np.zeros(scene.N_x), 0.0, geometry=geometry)
        np.testing.assert_allclose(state.u, loaded.u, rtol=0, atol=1e-12 * np.abs(loaded.u).max())
        assert abs(state.F_T) < 1e-11 * scene.F_N


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [small_rod(), small_rod(side="right"), small_free()])
def test_a_run_starts_at_rest(scene, geometry):
    loaded = loaded_state(scene, geometry)
    state = loaded.state(scene, 1e-7)
    now = core.evaluate(core.model(scene, geometry, state.u_drv0), state, 0.0)
    moves = np.abs(now.a).max() * scene.m, np.abs(now.a_rod[:2]).max() * scene.slider.M
    assert max(moves) < 1e-8 * scene.F_N / scene.N_x
    np.testing.assert_allclose(now.f, loaded.f, rtol=0, atol=1e-8 * scene.F_N / scene.N_x)


@pytest.mark.parametrize("scene", [small_rod(), small_free()])
def test_finite_state_is_at_rest_in_absolute_coordinates(scene):
    """Forces are the paper's k_ij (r_ij - l_ij) dx_ij / r_ij, from positions, bond by bond."""
    u_x, drive = a_held_interface(scene)
    state = solve_static(scene, u_x, drive, geometry="finite")
    l, k, N_x, N_z = scene.slider.l, scene.slider.k, scene.N_x, scene.N_z
    z, x = np.mgrid[:N_z, :N_x] * l
    X = np.stack([x + state.u[:, 0], z + state.u[:, 1]], axis=1)
    F = np.zeros_like(X)
    for j in range(N_z):
        for i in range(N_x):
            for dj in (-1, 0, 1):
                for di in (-1, 0, 1):
                    J, I = j + dj, i + di
                    if (dj or di) and 0 <= J < N_z and 0 <= I < N_x:
                        D, l_ij = X[J, :, I] - X[j, :, i], l * math.hypot(di, dj)
                        r = math.hypot(*D)
                        F[j, :, i] += (k if l_ij == l else k / 2) * (r - l_ij) * D / r
    F[0, 0] += state.f
    F[0, 1] += state.p
    F[scene.j_h, 0, scene.i_h] += scene.d * state.F_T
    if scene.rigid:
        top, F = F[-1], F[:-1]
        assert abs(top[0].sum()) < 1e-8 * scene.F_N
        assert top[1].sum() == pytest.approx(scene.F_N, rel=1e-8)
        torque = np.sum(scene.x * top[1])
        assert torque == pytest.approx(scene.kappa * state.rod[2], abs=1e-9 * scene.F_N * 0.03)
        assert abs(torque) > 1e-6 * scene.F_N * 0.03
    else:
        F[-1, 1] -= scene.load
    assert np.abs(F).max() < 1e-8 * scene.F_N / N_x


@pytest.mark.parametrize("scene", [small_rod(), small_free(theta=0.3)])
def test_finite_geometry_becomes_linear_at_small_loads(scene):
    """Halving the loads divides the difference by four."""
    difference = []
    for factor in (1.0, 0.5, 0.25, 0.125):
        one = scaled(scene, factor)
        u_x, drive = a_held_interface(one)
        states = [solve_static(one, u_x, drive, geometry=g) for g in ("linear", "finite")]
        difference.append(np.abs(states[1].f - states[0].f).max())
    ratios = np.divide(difference[:-1], difference[1:])
    np.testing.assert_allclose(ratios, 4.0, rtol=0.05)
    assert abs(ratios[-1] - 4) < abs(ratios[0] - 4)
    assert difference[0] > 1e-6 * scene.F_N / scene.N_x


def test_result_does_not_depend_on_what_was_solved_before():
    scene = setup1(h=15e-3)
    drives = np.array([0.1, 0.8, 0.3]) * scene.F_N / scene.driver.K
    for geometry in ("linear", "finite"):
        used = StaticSolver(scene, geometry)
        after = [used.solve(np.zeros(scene.N_x), drive) for drive in drives]
        alone = StaticSolver(scene, geometry).solve(np.zeros(scene.N_x), drives[-1])
        assert_same(after[-1], alone)


def test_zero_of_the_driver_can_be_given():
    scene = small_rod()
    moved = StaticSolver(scene, u_drv0=1e-6)
    usual = StaticSolver(scene)
    u_x = np.zeros(scene.N_x)
    one = moved.solve(u_x, 2e-5)
    two = usual.solve(u_x, 2e-5 + scene.d * (1e-6 - usual.loaded.u_drv0))
    assert one.F_T == pytest.approx(two.F_T, rel=1e-11)


# --- symmetries ----------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize(
    "scene",
    [
        setup1(),
        setup1(h=15e-3),
        preset("setup2+"),
        small_free(theta=0.5, mu_s=0.1, mu_k=0.1),
        small_free(theta=0.5, mu_s=0.2, mu_k=0.1),
    ],
)
def test_mirrored_scene_gives_the_mirrored_state(scene, geometry):
    u_x, _ = a_held_interface(scene)
    other = mirrored_scene(scene)
    for drive in (0.0, 0.4 * scene.F_N / scene.driver.K):
        one = solve_static(scene, u_x, drive, geometry=geometry)
        two = solve_static(other, -u_x[::-1], drive, geometry=geometry)
        sign = np.array([-1.0, 1.0])[:, None]
        tolerance = 1e-11 * np.abs(one.u).max()
        np.testing.assert_allclose(two.u[:, :, ::-1] * sign, one.u, rtol=0, atol=tolerance)
        np.testing.assert_allclose(two.tau[::-1], one.tau, rtol=0, atol=1e-11 * scene.F_N)
        np.testing.assert_allclose(two.p[::-1], one.p, rtol=0, atol=1e-11 * scene.F_N)
        np.testing.assert_array_equal(two.open[::-1], one.open)
        assert two.F_T == pytest.approx(one.F_T, abs=1e-11 * scene.F_N)
    slipped = [loaded_state(s, geometry).slipped for s in (scene, other)]
    np.testing.assert_array_equal(slipped[1][::-1], slipped[0])


@pytest.mark.parametrize("factor", [2.0, 0.25, 2.0**40])
@pytest.mark.parametrize(
    "scene",
    [
        setup1(),
        setup1(h=15e-3),
        setup1(mu_s=0.2, mu_k=0.2),
        small_free(theta=0.833, mu_s=0.2, mu_k=0.1),
    ],
)
def test_doubled_loads_double_the_linear_state_bit_for_bit(scene, factor):
    other = scaled(scene, factor)
    u_x, _ = a_held_interface(scene)
    drive = 0.8 * scene.F_N / scene.driver.K
    pairs = [
        (loaded_state(scene), loaded_state(other)),
        (solve_static(scene, u_x, drive), solve_static(other, factor * u_x, factor * drive)),
    ]
    for one, two in pairs:
        for name in ARRAYS:
            np.testing.assert_array_equal(factor * getattr(one, name), getattr(two, name))
        np.testing.assert_array_equal(one.open, two.open)
        np.testing.assert_array_equal(one.slipped, two.slipped)
        assert factor * one.F_T == two.F_T
        assert factor * one.u_drv0 == two.u_drv0


# --- open blocks ---------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [setup1(h=15e-3), setup1(h=15e-3, side="right")])
def test_trailing_edge_lifts_off(scene, geometry):
    u_x, drive = np.zeros(scene.N_x), 0.8 * scene.F_N / scene.driver.K
    state = solve_static(scene, u_x, drive, geometry=geometry)
    assert (state.open == (scene.n_of_i <= 3)).all()
    assert (state.u[0, 1, state.open] > 0).all()
    assert (state.u[0, 1, ~state.open] < 0).all()
    assert (state.p[state.open] == 0).all()
    assert (state.f[state.open] == 0).all()
    assert (state.u[0, 0, state.open] != 0).all()
    assert (state.u[0, 0, ~state.open] == 0).all()
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-12)
    assert state.tau.sum() == pytest.approx(state.F_T, rel=1e-12)
    if geometry == "linear":
        assert moment_error(state, scene) < 1e-12
        assert_matches_direct(state, scene, ~state.open, ~state.open, u_x, driven=True)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_interior_gap_opens(geometry):
    """In setup 2 with little load on the trailing edge, a gap opens away from the edge."""
    scene = setup2(theta=0.833, h=5e-3)
    drive = 0.4 * scene.F_N / scene.driver.K
    state = solve_static(scene, np.zeros(scene.N_x), drive, geometry=geometry)
    assert state.open[13:30].all()
    assert not state.open[1:13].any()
    assert (state.u[0, 1, state.open] > 0).all()
    assert (state.f[state.open] == 0).all()
    assert state.tau.sum() == pytest.approx(state.F_T, rel=1e-11)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [setup1(h=15e-3), setup1(h=15e-3, side="right")])
def test_open_blocks_given_as_free_change_nothing(scene, geometry):
    """Static values of events are found in this way, because the log has the open blocks."""
    u_x = scene.d * 1e-6 * np.exp(-scene.n_of_i / 20)
    drive = 0.8 * scene.F_N / scene.driver.K
    found = solve_static(scene, u_x, drive, geometry=geometry)
    assert found.open.any()
    unknown = np.where(found.open, np.nan, u_x)
    given = solve_static(scene, unknown, drive, geometry=geometry, free=found.open)
    np.testing.assert_allclose(given.u, found.u, rtol=0, atol=1e-12 * np.abs(found.u).max())
    np.testing.assert_array_equal(given.open, found.open)
    assert given.F_T == pytest.approx(found.F_T, rel=1e-11)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("make_scene", [small_rod, small_free])
def test_states_with_open_and_free_blocks_are_at_rest_for_the_twin(make_scene, side, geometry):
    """With the modes of the state, no block accelerates in the independent right-hand side."""
    scene = make_scene(side=side, h=make_scene().slider.H)
    n, unit = scene.n_of_i, scene.F_N / scene.N_x
    solver = StaticSolver(scene, geometry)
    u_x = scene.d * 0.02 * scene.F_N / scene.driver.K * np.exp(-n / 5)
    drive = 0.7 * scene.slider.L / scene.slider.H * scene.F_N / scene.driver.K
    for free in (None, n <= 2, n >= scene.N_x - 1):
        state = solver.solve(u_x, drive, free=free)
        assert state.open.any()
        mode = np.where(state.open, twin.OPEN, twin.STUCK)
        if free is not None:
            mode[free] = twin.OPEN
            assert (state.p[free] > 0).all() == (not free[n == 1].any())
        y = np.concatenate([state.u, np.zeros_like(state.u)], axis=1)
        rod = np.concatenate([state.rod, np.zeros(3)])
        t = drive / scene.driver.V
        there = twin.right_hand_side(scene, geometry, t, y, rod, mode, state.u_drv0)
        assert scene.m * np.abs(there.dydt[:, 2:]).max() < 1e-11 * unit
        if scene.rigid:
            mass, inertia = twin.rod_inertia(scene)
            assert mass * np.abs(there.drod[3:5]).max() < 1e-11 * unit
            assert inertia * abs(there.drod[5]) < 1e-11 * unit * scene.slider.L
        np.testing.assert_allclose(state.f, there.f, rtol=0, atol=1e-11 * unit)
        np.testing.assert_allclose(state.p, there.p, rtol=0, atol=1e-11 * unit)
        assert state.F_T == pytest.approx(there.F_T, rel=1e-11)


def test_free_blocks_that_touch_carry_p_and_no_friction():
    scene = small_rod()
    free = scene.n_of_i <= 2
    u_x = np.zeros(scene.N_x)
    state = solve_static(scene, u_x, 0.0, free=free)
    assert (state.p[free] > 0).all()
    assert (state.f[free] == 0).all()
    assert not state.open.any()
    assert_matches_direct(state, scene, ~free, np.ones(scene.N_x, dtype=bool), u_x, driven=True)


def test_all_blocks_may_be_free():
    """Without any friction only the driver spring fixes the position, where F_T = 0."""
    scene = small_rod()
    state = solve_static(scene, np.zeros(scene.N_x), 1e-5, free=np.ones(scene.N_x, dtype=bool))
    assert abs(state.F_T) < 1e-10 * scene.F_N
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-11)


# --- slip during loading -------------------------------------------------------------------------


def assert_loading_conditions(state, scene):
    mu_s, mu_k = scene.interface.mu_s, scene.interface.mu_k
    unit, slip = scene.F_N / scene.N_x, state.slipped
    assert (np.abs(state.f) <= mu_s * state.p + 1e-10 * unit)[~slip].all()
    assert (state.u[0, 0, ~slip & ~state.open] == 0).all()
    against = -np.sign(state.u[0, 0, slip]) * mu_k * state.p[slip]
    np.testing.assert_allclose(state.f[slip], against, rtol=0, atol=1e-12 * unit)
    assert abs(state.f.sum()) < 1e-11 * scene.F_N
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-11)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize(
    "scene",
    [
        setup1(mu_s=0.2, mu_k=0.2),
        setup1(mu_s=0.2, mu_k=0.1),
        setup2(theta=0.5, mu_s=0.1, mu_k=0.1),
        small_free(theta=0.5, mu_s=0.02, mu_k=0.02),
        small_free(L=0.019, mu_s=0.05, mu_k=0.02),
        small_rod(mu_s=0.01, mu_k=0.01),
    ],
)
def test_loading_with_slip_meets_its_conditions(scene, geometry):
    state = loaded_state(scene, geometry)
    assert state.slipped.any()
    assert_loading_conditions(state, scene)
    if scene.rigid or scene.top.theta == 0:
        tolerance = 1e-10 * scene.F_N
        np.testing.assert_allclose(state.tau, -state.tau[::-1], rtol=0, atol=tolerance)


def test_friction_just_sufficient_prevents_slip():
    held = loaded_state(setup1())
    needed = np.max(np.abs(held.tau) / held.p)
    above, below = (setup1(mu_s=c * needed, mu_k=c * needed) for c in (1 + 1e-6, 1 - 1e-6))
    assert not loaded_state(above).slipped.any()
    state = loaded_state(below)
    np.testing.assert_array_equal(np.flatnonzero(state.slipped), [0, 56])
    np.testing.assert_allclose(state.u, held.u, rtol=0, atol=1e-5 * np.abs(held.u).max())


@pytest.mark.parametrize("mu", [0.02, 0.2])
def test_proportional_loading_agrees_with_small_load_steps(mu):
    """With mu_s = mu_k, F_N is applied in 40 steps, with friction iterated block by block.

    The increments follow the friction law and its history, without the final complementarity
    problem. In each step a block either stays in place or slips until |f| = mu p, so that
    overshoots of an iteration are undone.
    """
    scene = small_rod(mu_s=mu, mu_k=mu)
    N_x = scene.N_x
    everything = np.ones(N_x, dtype=bool)
    # Response of f and p to each u_x and to the load, from direct solves.
    unit_u = 1e-6
    base_u, _, base_f = direct(scene, everything, everything, np.zeros(N_x), 0.0, 0.0)
    A, B = np.zeros((N_x, N_x)), np.zeros((N_x, N_x))
    for i in range(N_x):
        u_x = np.zeros(N_x)
        u_x[i] = unit_u
        u, _, f = direct(scene, everything, everything, u_x, 0.0, 0.0)
        A[:, i] = (f - base_f) / unit_u
        B[:, i] = -scene.k_f * (u - base_u)[0, 1] / unit_u
    base_p = -scene.k_f * base_u[0, 1]
    u_x = np.zeros(N_x)
    for share in np.linspace(0, 1, 41)[1:]:
        begin, change = u_x.copy(), np.inf
        while change > 1e-9 * np.abs(u_x).max():
            change = 0.0
            for i in range(N_x):
                f = share * base_f[i] + A[i] @ u_x - A[i, i] * (u_x[i] - begin[i])
                limit = mu * (share * base_p[i] + B[i] @ u_x)
                moved = begin[i] + (min(max(f, -limit), limit) - f) / A[i, i]
                change = max(change, abs(moved - u_x[i]))
                u_x[i] = moved
    np.testing.assert_allclose(u_x, -u_x[::-1], rtol=0, atol=1e-6 * np.abs(u_x).max())
    state = loaded_state(scene)
    assert 0 < state.slipped.sum() < N_x
    np.testing.assert_allclose(state.u[0, 0], u_x, rtol=0, atol=1e-6 * np.abs(u_x).max())
    np.testing.assert_allclose(state.f, base_f + A @ u_x, rtol=0, atol=1e-6 * np.abs(base_f).max())


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [small_rod(), small_free(theta=0.4), small_free(L=0.019)])
def test_loading_without_friction(scene, geometry):
    interface = dataclasses.replace(scene.interface, mu_s=0.0, mu_k=0.0)
    state = loaded_state(dataclasses.replace(scene, interface=interface), geometry)
    assert np.abs(state.f).max() < 1e-10 * scene.F_N
    assert state.u[0, 0, -1] - state.u[0, 0, 0] > 0
    assert state.p.sum() == pytest.approx(scene.F_N, rel=1e-11)


def test_strong_friction_warns_where_the_slip_operator_is_indefinite():
    """The operator belongs to the slipping blocks and their directions of slip."""
    scene = small_rod()
    contact = ContactProblem(scene).loaded()
    alternating = np.where(scene.n_of_i % 2, 1, -1)
    alternating[0] = 0
    few = np.where(scene.n_of_i == scene.N_x, alternating, 0)

    def check(mu, slip):
        contact.law = CoulombLaw(mu, mu)
        contact.enter(slice(None), slip)
        _warn_if_ambiguous(contact)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(0.7, alternating)
        check(5.0, few)
    with pytest.warns(RuntimeWarning, match="may not be the only one"):
        check(5.0, alternating)


# --- refusals ------------------------------------------------------------------------------------


def tall_scene(side: str) -> Scene:
    """Return 11 x 11 almost rigid blocks, pushed by a soft spring high up."""
    return setup2(L=0.01, H=0.01, h=8e-3, F_N=50.0, K=1250.0, side=side)


def tipping_drive(scene: Scene) -> float:
    """Return the drive at which F_T h = F_N L/2, if only the driver's spring yields."""
    return scene.F_N * scene.slider.L / (2 * scene.driver.h * scene.driver.K)


@pytest.mark.parametrize(
    "scene",
    [tall_scene("left"), tall_scene("right"), setup1(mattress=0.0, L=0.06, H=0.06, h=0.05, K=4e4)],
)
def test_linear_geometry_stands_on_its_far_corner(scene):
    """The slider turns about this corner until the driver's spring relaxes to F_T h = F_N L/2."""
    far = scene.n_of_i == scene.N_x
    for share in (2.0, 5.0):
        state = solve_static(scene, np.zeros(scene.N_x), share * tipping_drive(scene))
        np.testing.assert_array_equal(state.open, ~far)
        assert state.p[far] == pytest.approx(scene.F_N, rel=1e-12)
        assert state.tau[far] == pytest.approx(state.F_T, rel=1e-12)
        assert state.F_T * scene.driver.h == pytest.approx(
            scene.F_N * scene.slider.L / 2, rel=1e-11
        )
        assert moment_error(state, scene) < 1e-12


@pytest.mark.parametrize("side", ["left", "right"])
def test_no_equilibrium_is_an_error_that_names_its_figures(side):
    """In finite geometry a strong push tips the slider over.

    When the slider turns about its far corner, the lever arm of F_N falls from L/2 faster than the
    soft spring relaxes. Nothing then balances the push.
    """
    scene = tall_scene(side)
    F_N, L, H, h, K = scene.F_N, scene.slider.L, scene.slider.H, scene.driver.h, scene.driver.K
    angle = np.linspace(0, np.pi / 2, 1000)
    advance = L * (1 - np.cos(angle)) + h * np.sin(angle)
    push = K * (1.05 * tipping_drive(scene) - advance) * (h * np.cos(angle) + L * np.sin(angle))
    assert (push > F_N * (L / 2 * np.cos(angle) - H * np.sin(angle))).all()

    solver, held = StaticSolver(scene, "finite"), np.zeros(scene.N_x)
    standing = solver.solve(held, 0.9 * tipping_drive(scene))
    assert standing.F_T * h == pytest.approx(0.9 * F_N * L / 2, rel=0.01)
    for share in (1.05, 4.0):
        with pytest.raises(EquilibriumError, match=r"residual .* N, limit .* N, \d+ it") as caught:
            solver.solve(held, share * tipping_drive(scene))
        assert 0 < caught.value.limit < 1e-8 * F_N / scene.N_x
        assert caught.value.iterations > 0
    assert_same(solver.solve(held, 0.9 * tipping_drive(scene)), standing)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"u_x_bottom": np.zeros(3)}, "u_x_bottom"),
        ({"u_x_bottom": np.full(13, np.nan)}, "finite"),
        ({"drive": math.inf}, "finite"),
        ({"free": np.zeros(4, dtype=bool)}, "free"),
        ({"geometry": "cubic"}, "geometry"),
    ],
)
def test_wrong_arguments_are_refused(arguments, word):
    with pytest.raises(SceneError, match=word):
        solve_static(small_rod(), **{"u_x_bottom": np.zeros(13), "drive": 0.0} | arguments)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [small_rod(), small_free(theta=0.4)])
def test_a_slider_that_has_gone_far_is_the_same_slider(scene, geometry):
    """After 40 l of sliding the same interface and load give the same forces."""
    solver = StaticSolver(scene, geometry)
    u_x = solver.loaded.u[0, 0] + 1e-7 * np.sin(np.arange(scene.N_x))
    drive = 0.1 * scene.F_N / scene.driver.K
    near = solver.solve(u_x, drive)
    far = 40 * scene.slider.l
    gone = solver.solve(u_x + scene.d * far, drive + far)
    assert gone.F_T == pytest.approx(near.F_T, rel=1e-7)
    np.testing.assert_allclose(gone.tau, near.tau, rtol=0, atol=1e-7 * scene.F_N / scene.N_x)
    np.testing.assert_allclose(gone.p, near.p, rtol=0, atol=1e-7 * scene.F_N / scene.N_x)


def test_what_is_not_known_of_a_failure_is_not_said():
    error = EquilibriumError("it moves", math.nan, 2e-9, 120)
    assert str(error) == "no equilibrium: it moves (120 iterations)"
    assert str(EquilibriumError("it moves", math.nan, 2e-9, 0)) == "no equilibrium: it moves"
    known = "(residual 0.1 N, limit 2e-09 N, 7 iterations)"
    assert str(EquilibriumError("it moves", 0.1, 2e-9, 7)).endswith(known)


def test_a_search_that_starts_near_ends_at_the_same_state():
    """Under a large load a near start needs fewer Newton steps than the loaded state."""
    scene = small_free(F_N=2e3)
    solver = StaticSolver(scene, "finite")
    free = np.zeros(scene.N_x, bool)
    u_x, drive = solver.loaded.u[0, 0].copy(), 0.6 * scene.F_N / scene.driver.K
    states = [solver.solve(u_x, drive * share, free=free) for share in (0.98, 1.0)]
    again = solver.solve(u_x, drive, free=free, near=states[0])
    assert again.iterations < states[1].iterations
    for name in ARRAYS:
        expected = getattr(states[1], name)
        assert getattr(again, name) == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
    remembered = RememberedStates(solver)
    for share in (0.98, 1.0):
        remembered.solve(u_x, drive * share, free=free)
    assert remembered.latest.iterations == again.iterations


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_a_shear_force_under_which_nothing_rests_is_named(geometry):
    with pytest.raises(EquilibriumError, match=r"under top\.T = 600 N; take a smaller one"):
        StaticSolver(setup2(F_N=1000.0, T=600.0), geometry)
