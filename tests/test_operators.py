"""Matrices of the slider: coordinates, waves, damping and the step limit of RK4."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.sparse as sp
from helpers import operators
from scipy.sparse.linalg import eigs
from test_lattice import neighbours, small_rod, small_scene, twin_forces

from pyfric import core
from pyfric.core import STEPPERS
from pyfric.scene import Driver, Scene, setup1, setup2
from pyfric.statics import (
    StaticSolver,
    System,
    damping,
    dispersion,
    loaded_state,
    mass,
    stability_limit,
    stiffness,
)
from pyfric.statics.operators import coordinates, extended
from pyfric.statics.stability import GROWN, _bulk_limit, _small_limit, least_limit

# --- generalised coordinates ---------------------------------------------------------------------


def test_rod_moves_the_top_row_rigidly():
    scene = small_rod()
    T = coordinates(scene)
    q = np.random.default_rng(1).standard_normal(T.shape[1])
    u = (T @ q).reshape(scene.N_z, 2, scene.N_x)
    np.testing.assert_array_equal(u[:-1].ravel(), q[:-3])
    np.testing.assert_array_equal(u[-1, 0], q[-3])
    np.testing.assert_allclose(u[-1, 1], q[-2] + q[-1] * scene.x, rtol=1e-15)
    free = small_scene()
    assert abs(coordinates(free) - sp.eye_array(2 * 7 * 5)).max() == 0


@pytest.mark.parametrize("scene", [small_rod(), small_scene()])
def test_states_have_the_displacements_of_their_coordinates(scene):
    solver, T = StaticSolver(scene), coordinates(scene)
    q = np.random.default_rng(4).standard_normal(T.shape[1])
    u, _ = solver.displacements(q)
    np.testing.assert_allclose(u.ravel(), T @ q, rtol=1e-15, atol=0)


def test_mass_of_rod_and_blocks():
    scene = small_rod(mass=0.01)
    m, N_x = scene.m, scene.N_x
    inertia = 0.01 * 0.015**2 / 12 + m * sum(x * x for x in scene.x)
    np.testing.assert_allclose(mass(scene)[-3:], [0.01 + N_x * m] * 2 + [inertia], rtol=1e-14)
    assert (mass(scene)[:-3] == m).all()
    # The kinetic energy of blocks does not depend on the coordinates.
    T, q = coordinates(scene), np.random.default_rng(2).standard_normal(len(mass(scene)))
    rod = 0.01 * (q[-3] ** 2 + q[-2] ** 2) + 0.01 * 0.015**2 / 12 * q[-1] ** 2
    assert np.sum(mass(scene) * q**2) == pytest.approx(m * np.sum((T @ q) ** 2) + rod, rel=1e-13)


@pytest.mark.parametrize("scene", [small_rod(side="right"), small_rod(h=0.01), small_scene()])
def test_stiffness_is_the_curvature_of_the_energy(scene):
    """The energy sums bonds, foundation of closed blocks, driver spring and mattress one by one."""
    closed = np.arange(scene.N_x) % 3 > 0
    K = stiffness(scene, closed=closed)
    T = coordinates(scene)
    q = np.random.default_rng(3).standard_normal(T.shape[1])
    u = (T @ q).reshape(scene.N_z, 2, scene.N_x)
    energy = -np.sum(u * twin_forces(scene, u, "linear"))
    energy += scene.k_f * np.sum(u[0, 1, closed] ** 2)
    energy += scene.driver.K * u[scene.j_h, 0, scene.i_h] ** 2
    energy += scene.kappa * q[-1] ** 2 if scene.rigid else 0.0
    assert q @ (K @ q) == pytest.approx(energy, rel=1e-13)


@pytest.mark.parametrize("scene", [small_rod(), small_scene()])
def test_damping_dissipates_eta_times_relative_velocity_squared(scene):
    C, T = damping(scene), coordinates(scene)
    q = np.random.default_rng(4).standard_normal(T.shape[1])
    v = (T @ q).reshape(scene.N_z, 2, scene.N_x)
    power = sum(np.sum((v[J, :, I] - v[j, :, i]) ** 2) for (j, i), (J, I), _ in neighbours(scene))
    assert q @ (C @ q) == pytest.approx(scene.eta * power, rel=1e-13)
    assert abs(C - C.T).max() <= 1e-15 * abs(C).max()
    uniform = np.zeros_like(v)
    uniform[:, 0] = 1.0
    if not scene.rigid:
        assert np.abs(C @ uniform.ravel()).max() < 1e-14 * scene.eta


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("dashpots", ["full", "along"])
def test_dashpots_turn_with_bonds_as_in_the_core(geometry, dashpots):
    """The dissipated power of a deformed, moving slider agrees with the core."""
    scene = small_scene().replace({"slider.dashpots": dashpots})
    state, random = loaded_state(scene, geometry).state(scene, 1e-7), np.random.default_rng(6)
    state.y[:, :2] += 0.1 * scene.slider.l * random.uniform(-1, 1, state.y[:, :2].shape)
    state.y[:, 2:] = random.uniform(-1, 1, state.y[:, 2:].shape)
    system = System(scene, geometry)
    q, v = (system.coordinates(part, np.zeros(3)) for part in (state.y[:, :2], state.y[:, 2:]))
    found = core.evaluate(core.model(scene, geometry, state.u_drv0), state, 0.0)
    assert v @ (system.damping(q) @ v) == pytest.approx(found.dissipated.sum(), rel=1e-12)


def test_a_space_takes_what_shapes_add_and_leaves_out_rounding():
    """Shapes that differ from the basis by 1e-7 are new; combinations of the basis are not."""
    random = np.random.default_rng(5)
    M = random.uniform(0.5, 2.0, 40)
    basis = np.linalg.qr(random.standard_normal((40, 6)))[0] / np.sqrt(M)[:, None]
    near = basis[:, :2] + 1e-7 * random.standard_normal((40, 2))
    shapes = np.column_stack([near, basis @ random.standard_normal((6, 3)), 1e9 * near[:, :1]])
    B = extended(basis, shapes, M)
    assert B.shape == (40, 8)
    np.testing.assert_allclose(B.T @ (M[:, None] * B), np.eye(8), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(B[:, :6] * np.sqrt(M)[:, None], basis * np.sqrt(M)[:, None])
    left = near - B @ (B.T @ (M[:, None] * near))
    assert np.abs(left).max() < 1e-15


# --- waves ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.2, math.pi / 8, math.pi / 4, 1.2])
def test_long_waves_are_isotropic(angle):
    scene = setup1()
    ql = 1e-3
    q = ql / scene.slider.l * np.array([math.cos(angle), math.sin(angle)])
    omega, gamma = dispersion(scene, q)
    speed = omega / np.hypot(*q) / (scene.slider.l * math.sqrt(scene.slider.k / scene.m))
    np.testing.assert_allclose(speed, [math.sqrt(0.5), math.sqrt(1.5)], rtol=1e-6)
    assert gamma == pytest.approx(3 * ql**2 * scene.eta / scene.m, rel=1e-6)


def test_wave_speeds_of_setup_1():
    """Waves have 1677 and 968 m/s with M/(L H) as mass per area, 1720 and 993 m/s with m = M/N."""
    scene = setup1()
    slider = scene.slider
    q = np.array([1e-3 / slider.l, 0.0])
    shear, long = dispersion(scene, q)[0] / q[0]
    assert (round(long), round(shear)) == (1720, 993)
    continuum = math.sqrt(scene.m / (slider.M * slider.l**2 / (slider.L * slider.H)))
    assert (round(long * continuum), round(shear * continuum)) == (1677, 968)


@pytest.mark.parametrize("ql", [(0.3, 0.0), (1.1, -0.7), (math.pi, 0.0), (2.0, 2.5)])
def test_operators_carry_plane_waves(ql):
    """K and C on a plane wave, inside the lattice, give m omega^2 and m gamma of `dispersion`."""
    scene = small_scene()
    M, K, C = operators(scene)
    z, x = np.mgrid[: scene.N_z, : scene.N_x]
    phase = np.exp(1j * (ql[0] * x + ql[1] * z))
    omega, gamma = dispersion(scene, np.array(ql) / scene.slider.l)
    D = np.empty((2, 2), dtype=complex)
    for c in range(2):
        wave = np.zeros((scene.N_z, 2, scene.N_x), dtype=complex)
        wave[:, c] = phase
        D[:, c] = (K @ wave.ravel() / M).reshape(wave.shape)[2, :, 3] / phase[2, 3]
        slow = (C @ wave.ravel() / M).reshape(wave.shape)[2, c, 3] / phase[2, 3]
        assert slow == pytest.approx(gamma, rel=1e-12)
    np.testing.assert_allclose(np.linalg.eigvalsh(D), omega**2, rtol=1e-11, atol=1e-11 * 1e13)


def test_slow_modes_of_the_stuck_slider():
    """Decay times are 3.9, 4.7, 1.9 and 0.28 ms, as with another program (model.md)."""
    M, K, C = operators(setup1())
    N_x = setup1().N_x
    root = sp.diags_array(1 / np.sqrt(M[N_x:]))  # bottom u_x, the first N_x coordinates, held
    stiff, viscous = (root @ A[N_x:, N_x:] @ root for A in (K, C))
    n = viscous.shape[0]
    A = sp.block_array([[None, sp.eye_array(n)], [-stiff, -viscous]]).tocsc()
    slowest = eigs(A, k=30, sigma=-1.0, return_eigenvectors=False, v0=np.ones(2 * n))
    decay = np.sort(-1 / slowest.real[slowest.imag > 0])[::-1] * 1e3
    np.testing.assert_allclose(decay[:4], [4.662, 3.906, 1.886, 0.284], rtol=1e-3)


# --- step limit ----------------------------------------------------------------------------------


def rk4_factor(z):
    return 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24


def ends_of_rays(stepper, theta):
    return np.array([least_limit(stepper, np.exp([1j * one]))[0] for one in theta])


@pytest.mark.parametrize("name", ["rk46", "rk46_waves"])
def test_stable_part_of_rays_of_six_stages(name):
    """A ray is stable up to the found end, and not just beyond it; undamped motion grows slowly."""
    stepper, theta = STEPPERS[name], np.linspace(np.pi / 2, np.pi, 91)
    ends, most = ends_of_rays(stepper, theta), 1 + GROWN
    ray = np.exp(1j * theta)
    shares = np.linspace(0.01, 1 - 1e-9, 100)[:, None]
    assert (np.abs(stepper.growth(shares * ends * ray)) <= most).all()
    beyond = np.abs(stepper.growth(1.001 * ends * ray)) > most
    assert (beyond | (ends > 3.99)).all()  # steps are no longer than 4/|lambda|
    expected = (5760 * GROWN) ** (1 / 8) if name == "rk46" else 3.81
    assert ends[0] == pytest.approx(expected, rel=0.01)


def test_each_ray_leaves_the_rk4_region_once():
    theta = np.linspace(math.pi / 2, math.pi, 181)
    ends = ends_of_rays(STEPPERS["rk4"], theta)
    assert ends[0] == pytest.approx(2 * math.sqrt(2), rel=1e-12)
    assert ends[-1] == pytest.approx(2.785293563405282, rel=1e-12)
    ray = np.exp(1j * theta)
    for share in np.linspace(0.02, 0.9999, 60):
        assert (np.abs(rk4_factor(share * ends * ray)) <= 1 + 1e-15).all()
    for share in np.linspace(1.0001, 2, 60):
        assert (np.abs(rk4_factor(share * ends * ray)) > 1).all()


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (setup1(), 1.57e-6),
        (setup2(), 0.68e-6),
        (setup1(eta=0.0), 2.06e-6),
        (setup2(eta=0.0), 0.90e-6),
    ],
)
def test_limits_of_the_two_setups(scene, expected):
    """The limits are those of model.md, damped and undamped."""
    assert stability_limit(scene)[0] == pytest.approx(expected, rel=0.01)


def test_limits_in_closed_form():
    """The undamped limit is sqrt(8 m/(6 k)); an overdamped shear wave sets the damped one."""
    scene = setup1(eta=0.0)
    assert stability_limit(scene)[0] == pytest.approx(
        math.sqrt(8 * scene.m / (6 * scene.slider.k)), rel=1e-9
    )
    scene = setup1()
    omega_0 = math.sqrt(scene.slider.k / scene.m)
    half = 6 * math.sqrt(0.1)  # gamma = 12 eta/m, omega^2 = 2 k/m
    expected = 2.785293563405282 / (half + math.sqrt(half**2 - 2)) / omega_0
    assert stability_limit(scene)[0] == pytest.approx(expected, rel=1e-9)


def full_limit(scene: Scene) -> float:
    """Return the limit by all eigenvalues of the whole lattice: |R| <= 1, by bisection."""
    M, K, C = operators(scene)
    n = len(M)
    A = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-K.toarray() / M[:, None], -C.toarray() / M[:, None]]]
    )
    unit = math.sqrt(scene.slider.k / scene.m)
    A[:n, n:] *= unit
    A[n:, :n] /= unit
    eigenvalues = np.linalg.eigvals(A)
    low, high = 0.0, 1e-4
    for _ in range(50):
        middle = (low + high) / 2
        stable = (np.abs(rk4_factor(eigenvalues * middle)) <= 1 + 1e-9).all()
        low, high = (middle, high) if stable else (low, middle)
    return low


@pytest.mark.parametrize(
    "scene",
    [
        setup2(L=14e-3, H=7e-3),
        setup2(L=14e-3, H=7e-3, eta=0.0),
        setup2(L=14e-3, H=7e-3, k_f=1e9),
        setup2(L=14e-3, H=7e-3, K=1e9, h=5e-3, side="right"),
        setup1(L=0.035, H=0.0175, K=1e10, h=0.0175),
        setup1(L=0.035, H=0.0175, mattress=1e11),
        setup1(L=0.035, H=0.0175, mass=0.0, k_f=1e8),
    ],
)
def test_limit_of_a_larger_lattice_comes_from_the_small_one(scene):
    """The local limit is at most 5 % below that of the whole lattice and never above it."""
    limit, info = stability_limit(scene)
    assert not info["exact"]
    assert 0.95 < limit / full_limit(scene) < 1 + 1e-6


@pytest.mark.parametrize("scene", [small_rod(), small_scene(eta=0.0), small_scene(k_f=1e8)])
def test_rk4_blows_up_just_above_the_limit(scene):
    limit, info = stability_limit(scene)
    assert info["exact"]
    found = {}
    for share in (0.99, 1.01):
        growth = 0.0
        for closed in (True, False):
            for first in (0, scene.N_x):
                M, K, C = operators(scene, np.full(scene.N_x, closed))
                A = _first_order(M[first:], K[first:, first:], C[first:, first:])
                y = np.random.default_rng(5).standard_normal(A.shape[0])
                y /= np.concatenate([np.ones(len(y) // 2), np.full(len(y) // 2, 1e-6)])
                energy = []
                for _ in range(1500):
                    y = _rk4_step(A, y, share * limit)
                    energy.append(np.linalg.norm(y[len(y) // 2 :]))
                growth = max(growth, energy[-1] / max(energy[:50]))
        found[share] = growth
    assert found[0.99] < 1.5
    assert found[1.01] > 1e3


def _first_order(M: np.ndarray, K: sp.csr_array, C: sp.csr_array) -> np.ndarray:
    n = len(M)
    lower = [-K.toarray() / M[:, None], -C.toarray() / M[:, None]]
    return np.block([[np.zeros((n, n)), np.eye(n)], lower])


def _rk4_step(A: np.ndarray, y: np.ndarray, dt: float) -> np.ndarray:
    a = A @ y
    b = A @ (y + dt / 2 * a)
    c = A @ (y + dt / 2 * b)
    d = A @ (y + dt * c)
    return y + dt / 6 * (a + 2 * b + 2 * c + d)


def test_limit_of_millions_of_blocks_does_not_depend_on_their_number():
    scene = setup2(l=2e-5)
    assert scene.N_x * scene.N_z > 5_000_000
    limit, info = stability_limit(scene)
    assert info["shape"] == (5, 8)
    assert limit == pytest.approx(
        2.785293563405282 / 3.1623 * math.sqrt(scene.m / 9.375e6), rel=1e-3
    )


def test_limit_does_not_depend_on_the_load():
    scene = setup2(F_N=400.0)
    heavy = dataclasses.replace(setup2(F_N=8e5), driver=Driver(K=0.8e6, V=9.0, h=2e-3))
    assert stability_limit(scene)[0] == stability_limit(heavy)[0]


def test_limit_is_computed_once_for_all_speeds_and_friction():
    scene = setup1()
    faster = scene.replace({"driver.V": 0.1, "mu_s": 0.9, "d_c": 1e-6, "name": "faster"})
    faster = faster.replace({"top.F_N": 2 * scene.F_N, "top.protocol": ((1.0, 5.0),)})
    limit, _ = stability_limit(scene)
    made = _small_limit.cache_info().misses
    assert stability_limit(faster)[0] == limit
    assert _small_limit.cache_info().misses == made
    sheared = setup2(L=0.02, H=0.006, T=5.0, T_protocol=((1.0, 20.0),))
    assert stability_limit(sheared) == stability_limit(setup2(L=0.02, H=0.006))
    for decides in ({"k_f": 1e9}, {"alpha": 1e3}, {"driver.K": 1e9}, {"eta": 40.0}):
        assert stability_limit(scene.replace(decides))[0] < 0.99 * limit


def test_other_integrators_are_refused():
    with pytest.raises(ValueError, match="rk4"):
        stability_limit(setup1(), "euler")


def test_scenes_that_differ_in_loads_share_their_limit():
    for size in ({}, {"L": 0.015, "H": 0.01, "h": 0.005}):
        scene = setup1(eta=1.25, **size)
        limit = stability_limit(scene)
        assert limit[1]["exact"] == bool(size)
        known = [limit.cache_info().misses for limit in (_bulk_limit, _small_limit)]
        for changes in ({"F_N": 10.0}, {"V": 1.0}, {"mu_s": 0.9}):
            assert stability_limit(scene.replace(changes)) == limit
        assert [limit.cache_info().misses for limit in (_bulk_limit, _small_limit)] == known
