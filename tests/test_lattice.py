"""The lattice: bonds, forces of springs and their tangents, elasticity."""

import functools
import math

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from pyfric import core
from pyfric.scene import Scene, setup1, setup2
from pyfric.statics import StaticSolver, bonds, spring_stiffness
from pyfric.statics.lattice import Bonds, assembled, spring_forces, spring_tangents
from pyfric.statics.operators import coordinates

STEP = (-1e-3, 0.0, 1e-3)
"""Positions on a line for differences."""


def small_scene(**changes) -> Scene:
    """Return setup 2 with 7 x 5 blocks."""
    return setup2(**{"L": 6e-3, "H": 4e-3} | changes)


def small_rod(**changes) -> Scene:
    """Return setup 1 with 7 x 5 blocks."""
    return setup1(**{"L": 0.015, "H": 0.01} | changes)


def displacements(scene: Scene, size: float, seed: int = 1) -> np.ndarray:
    shape = (scene.N_z, 2, scene.N_x)
    return size * scene.slider.l * np.random.default_rng(seed).standard_normal(shape)


def forces_of(scene: Scene, geometry: str):
    """Return the function of statics from displacements to forces of springs."""
    if geometry == "finite":
        return core.bond_forces(scene, geometry)
    return functools.partial(spring_forces, bonds(scene))


def finite_forces(lattice: Bonds, u: np.ndarray) -> np.ndarray:
    """Return forces of springs of any lattice in finite geometry; the core has the square one."""
    du, d = np.array([D @ u.ravel() for D in lattice.difference]), lattice.d.T
    r = np.hypot(*(d + du))
    pull = lattice.k * np.sum(du * (2 * d + du), axis=0) / (r + lattice.l) * (d + du) / r
    return -sum(D.T @ one for D, one in zip(lattice.difference, pull, strict=True)).reshape(u.shape)


def tangent(lattice: Bonds, u: np.ndarray, geometry: str) -> sp.csr_array:
    """Return the derivative of minus the forces of the springs."""
    if geometry == "linear":
        return spring_stiffness(lattice)
    du = [D @ u.ravel() for D in lattice.difference]
    return assembled(sp.vstack(lattice.difference).tocsr(), spring_tangents(lattice, du))


def neighbours(scene: Scene):
    """Yield each pair of connected blocks once: (j, i), (j', i'), stiffness."""
    k = scene.slider.k
    for j in range(scene.N_z):
        for i in range(scene.N_x):
            for dj, di, stiff in ((0, 1, k), (1, 0, k), (1, 1, k / 2), (1, -1, k / 2)):
                if j + dj < scene.N_z and 0 <= i + di < scene.N_x:
                    yield (j, i), (j + dj, i + di), stiff


def twin_forces(scene: Scene, u: np.ndarray, geometry: str) -> np.ndarray:
    """Return spring forces by the paper's formula, bond by bond."""
    F, l = np.zeros_like(u), scene.slider.l
    for (j, i), (J, I), k in neighbours(scene):
        d = np.array([(I - i) * l, (J - j) * l])
        du = u[J, :, I] - u[j, :, i]
        l_ij = math.hypot(*d)
        if geometry == "linear":
            n = d / l_ij
            pull = k * n * (n @ du)
        else:
            r = math.hypot(*(d + du))
            pull = k * (r - l_ij) * (d + du) / r
        F[j, :, i] += pull
        F[J, :, I] -= pull
    return F


# --- bonds and spring forces ---------------------------------------------------------------------


def test_every_pair_of_neighbours_has_one_bond():
    scene = small_scene()
    lattice = bonds(scene)
    N_x = scene.N_x
    expected = {(j * N_x + i, J * N_x + I): k for (j, i), (J, I), k in neighbours(scene)}
    found = {}
    for a, b, d, l, k in zip(*(getattr(lattice, n) for n in "abdlk"), strict=True):
        (J, I), (j, i) = divmod(int(b), N_x), divmod(int(a), N_x)
        np.testing.assert_allclose(d, [(I - i) * scene.slider.l, (J - j) * scene.slider.l])
        assert l == pytest.approx(math.hypot(*d), rel=1e-15)
        pair = (int(a), int(b)) if (int(a), int(b)) in expected else (int(b), int(a))
        assert pair not in found
        found[pair] = k
    assert found == expected


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("scene", [small_scene(), setup2(L=2e-3, H=1e-3, h=1e-3)])
def test_spring_forces_are_those_of_the_paper(scene, geometry):
    u = displacements(scene, 0.1)
    F = forces_of(scene, geometry)(u)
    expected = twin_forces(scene, u, geometry)
    np.testing.assert_allclose(F, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    assert np.abs(F.sum(axis=(0, 2))).max() < 1e-13 * np.abs(F).max()


def test_finite_forces_keep_their_digits_at_tiny_strain():
    """The difference from linear geometry falls with the square of the displacements."""
    scene = small_scene()
    u, difference = displacements(scene, 1.0), []
    for size in (1e-3, 1e-6):
        linear, finite = (forces_of(scene, g)(size * u) for g in ("linear", "finite"))
        difference.append(np.abs(finite - linear).max() / size**2)
    assert difference[1] == pytest.approx(difference[0], rel=0.01)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_stiffness_is_the_derivative_of_the_forces(geometry):
    scene = small_scene()
    u, du = displacements(scene, 0.05), displacements(scene, 1e-5, seed=2)
    K, forces = tangent(bonds(scene), u, geometry), forces_of(scene, geometry)
    change = forces(u + du) - forces(u - du)
    np.testing.assert_allclose(-(K @ du.ravel()) * 2, change.ravel(), atol=2e-9 * abs(change).max())
    assert abs(K - K.T).max() <= 1e-15 * abs(K).max()


@pytest.mark.parametrize("scene", [small_scene(), small_rod()])
def test_forces_bend_along_a_line_as_finite_forces_do(scene):
    """The second derivative along a line agrees with differences of forces of the core."""
    solver = StaticSolver(scene, "finite")
    T, l = coordinates(scene), scene.slider.l
    q, rate = 1e-2 * l * np.random.default_rng(3).standard_normal((2, T.shape[1]))
    if scene.rigid:
        q[-1], rate[-1] = 1e-2, -2e-2  # rad
    force = core.bond_forces(scene, "finite")
    shape = (scene.N_z, 2, scene.N_x)
    before, now, after = (T.T @ force((T @ (q + s * rate)).reshape(shape)).ravel() for s in STEP)
    expected = -(before - 2 * now + after) / STEP[2] ** 2
    found = solver.bends(q, rate)
    limit = 1e-5 * np.abs(found).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=limit)
    assert not StaticSolver(scene, "linear").bends(q, rate).any()


@pytest.mark.parametrize("scene", [small_rod(), small_scene()], ids=["rod", "free"])
def test_assembled_matrices_are_sums_over_the_bonds(scene):
    """The matrices in coordinates agree with plain loops over bonds and springs to the ground."""
    lattice, T = bonds(scene), coordinates(scene)
    of_bonds = np.random.default_rng(0).standard_normal((3, len(lattice.a)))
    held = np.arange(1.0, T.shape[1] + 1)
    expected = np.zeros((2 * scene.N_z * scene.N_x,) * 2)
    for a, b, (xx, xz, zz) in zip(lattice.a, lattice.b, of_bonds.T, strict=True):
        at = [block // scene.N_x * 2 * scene.N_x + block % scene.N_x for block in (a, b)]
        for one, here in zip((-1, 1), at, strict=True):
            for other, there in zip((-1, 1), at, strict=True):
                block = np.ix_([here, here + scene.N_x], [there, there + scene.N_x])
                expected[block] += one * other * np.array([[xx, xz], [xz, zz]])
    E = sp.vstack([D @ T for D in lattice.difference]).tocsr()
    K = assembled(E, of_bonds, held)
    T = T.toarray()
    np.testing.assert_allclose(K.toarray(), T.T @ expected @ T + np.diag(held), atol=1e-13)


def test_finite_bonds_ignore_a_rigid_rotation():
    scene = small_scene()
    z, x = np.mgrid[: scene.N_z, : scene.N_x] * scene.slider.l
    c, s = math.cos(0.3), math.sin(0.3)
    u = np.stack([c * x - s * z - x, s * x + c * z - z], axis=1)
    scale = scene.slider.k * scene.slider.l
    linear, finite = (forces_of(scene, geometry) for geometry in ("linear", "finite"))
    assert np.abs(finite(u)).max() < 1e-14 * scale
    assert np.abs(linear(u)).max() > 1e-3 * scale
    assert np.abs(linear(np.stack([-z, x], axis=1))).max() < 1e-14 * scale


# --- elasticity ----------------------------------------------------------------------------------


def test_affine_strain_gives_isotropic_plane_stress():
    """The bonds of one cell give the stress of plane stress with nu = 1/3, E B = 4k/3."""
    scene = small_scene()
    lattice, l, k = bonds(scene), scene.slider.l, scene.slider.k
    centre = 2 * scene.N_x + 3  # an inner block; its 8 bonds share their work with a neighbour
    mine = (lattice.a == centre) | (lattice.b == centre)
    assert mine.sum() == 8

    def stress(strain: np.ndarray) -> np.ndarray:
        n = lattice.d / lattice.l[:, None]
        tension = lattice.k * lattice.l * np.einsum("bi,ij,bj->b", n, strain, n)
        work = tension[:, None, None] * n[:, :, None] * lattice.d[:, None, :]
        return work[mine].sum(axis=0) / 2 / l**2

    EB, nu = 4 * k / 3, 1 / 3
    for strain in (np.diag([1.0, 0.0]), np.array([[0.3, 0.7], [0.7, -0.2]])):
        expected = EB / (1 - nu**2) * ((1 - nu) * strain + nu * np.trace(strain) * np.eye(2))
        np.testing.assert_allclose(stress(strain), expected, rtol=1e-13, atol=1e-13 * k)


def test_pulled_strip_has_the_modulus_and_the_poisson_ratio():
    """A strip between rollers has nu = 1/3 and force = strain (4k/3 (N_x-1) l + k l).

    Springs on the edges have full stiffness, twice the share of a lattice cell. Each of the two
    edges adds k/2 per bond, and the lateral strain is uniform.
    """
    scene = setup2(L=8e-3, H=64e-3)
    N_x, N_z, l, k = scene.N_x, scene.N_z, scene.slider.l, scene.slider.k
    dof = np.arange(2 * N_x * N_z).reshape(N_z, 2, N_x)
    u = np.zeros(dof.shape)
    u[-1, 1] = 1e-3 * l
    given = np.zeros(dof.shape, dtype=bool)
    given[0, 1] = given[-1, 1] = given[0, 0, N_x // 2] = True
    K = spring_stiffness(bonds(scene)).tocsc()
    inner, outer = dof[~given], dof[given]
    flat = u.reshape(-1)
    flat[inner] = spsolve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ flat[outer])
    middle = N_z // 2
    along = (u[middle + 1, 1] - u[middle - 1, 1]) / (2 * l)
    across = (u[middle, 0, 1:] - u[middle, 0, :-1]) / l
    np.testing.assert_allclose(across, -along.mean() / 3, rtol=1e-5)
    np.testing.assert_allclose(along, along.mean(), rtol=1e-5)
    force = (K @ flat)[dof[-1, 1]].sum()
    assert force == pytest.approx(along.mean() * (4 * k / 3 * (N_x - 1) * l + k * l), rel=1e-5)


# --- another lattice -----------------------------------------------------------------------------


def triangular(N_x: int, N_z: int, l: float, k: float) -> tuple[Bonds, np.ndarray]:
    """Return the bonds of a triangular lattice, and its block positions, shape (N_z, 2, N_x)."""
    j, i = np.mgrid[:N_z, :N_x]
    at = np.stack([i + (j % 2) / 2, j * math.sqrt(0.75)], axis=1) * l
    found = []
    for row in range(N_z):
        for column in range(N_x):
            ends = [(row, column + 1), (row + 1, column + row % 2 - 1), (row + 1, column + row % 2)]
            found += [
                (row * N_x + column, other * N_x + beside)
                for other, beside in ends
                if other < N_z and 0 <= beside < N_x
            ]
    a, b = np.array(found).T
    x, z = at[:, 0].ravel(), at[:, 1].ravel()
    d = np.column_stack([x[b] - x[a], z[b] - z[a]])
    n, no = len(a), np.zeros(len(a), dtype=bool)
    length, one = np.full(n, l), np.ones(n)
    return Bonds(a, b, d, length, k * one, (N_z, N_x), no, one), at


def test_another_lattice_is_another_list_of_bonds():
    """A triangular lattice has nu = 1/3, E B = 2 k/sqrt(3); only rigid motions need no energy."""
    l, k = 2e-3, 1e7
    lattice, at = triangular(7, 6, l, k)
    K = spring_stiffness(lattice).toarray()
    values = np.linalg.eigvalsh(K)
    assert (np.abs(values[:3]) < 1e-12 * k).all()
    assert values[3] > 1e-3 * k
    turned = np.stack([-at[:, 1], at[:, 0]], axis=1).ravel()
    assert np.abs(K @ turned).max() < 1e-12 * k * np.abs(turned).max()
    strain = np.array([[0.3, 0.7], [0.7, -0.2]])
    u = np.einsum("ab,jbi->jai", strain, at).ravel()
    inside = (K @ u).reshape(6, 2, 7)[1:-1, :, 1:-1]
    assert np.abs(inside).max() < 1e-12 * np.abs(K @ u).max()
    EB, nu = 2 * k / math.sqrt(3), 1 / 3
    energy = EB / (1 + nu) * (np.sum(strain**2) + nu / (1 - nu) * np.trace(strain) ** 2) / 2
    centre = 2 * 7 + 3  # an inner block; its 6 bonds share their work with a neighbour
    mine = (lattice.a == centre) | (lattice.b == centre)
    assert mine.sum() == 6
    stretched = np.einsum("bi,ij,bj->b", lattice.d, strain, lattice.d)[mine] / l
    assert np.sum(k * stretched**2) / 4 == pytest.approx(energy * math.sqrt(0.75) * l**2, rel=1e-12)


def test_another_lattice_turns_without_force_in_finite_geometry():
    lattice, at = triangular(5, 4, 2e-3, 1e7)
    c, s = math.cos(0.3), math.sin(0.3)
    u = np.einsum("ab,jbi->jai", np.array([[c - 1, -s], [s, c - 1]]), at)
    scale = lattice.k[0] * lattice.l[0]
    assert np.abs(finite_forces(lattice, u)).max() < 1e-14 * scale
    shaken = u + 1e-5 * np.random.default_rng(1).standard_normal(u.shape)
    du = 1e-9 * np.random.default_rng(2).standard_normal(u.shape)
    K = tangent(lattice, shaken, "finite")
    change = finite_forces(lattice, shaken + du) - finite_forces(lattice, shaken - du)
    expected = -(K @ du.ravel()) * 2
    np.testing.assert_allclose(change.ravel(), expected, atol=1e-6 * np.abs(change).max())
