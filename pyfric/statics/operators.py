"""The slider as matrices: generalised coordinates, mass, stiffness, damping, waves.

Under a rod the top row moves rigidly, u_x = X and u_z = Z + phi x_i. The generalised coordinates q
are then the rows below it, followed by X, Z, phi, and u_full = T q with a sparse T. Without a rod
q = u_full. The equation of motion in linear geometry, without friction, is

    M q'' + C q' + K q = forces.

Source: PRL 107, 074301 (2011), model section.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.sparse as sp

from pyfric.scene import Scene
from pyfric.statics.lattice import DIRECTIONS, Bonds, assembled, bonds, spring_tangents
from pyfric.statics.rows import ends

INDEPENDENT = 1e-10
"""Largest norm, or eigenvalue, that counts as rounding for parts of unit vectors outside a
basis."""


def coordinates(scene: Scene) -> sp.csr_array:
    """Return T with u_full = T q, shape (2 N_x N_z, n_q).

    Under a rod n_q = 2 N_x (N_z - 1) + 3 and the last coordinates are X (m), Z (m), phi (rad).
    Otherwise T is the identity, without the columns of the top row if the top row is held.
    """
    N_x, n = scene.N_x, 2 * scene.N_x * scene.N_z
    if scene.walls.top == "held":
        return sp.eye_array(n, n - 2 * N_x, format="csr")
    if not scene.rigid:
        return sp.eye_array(n, format="csr")
    below = n - 2 * N_x
    ones = np.ones(N_x)
    top = ones[:, None], np.column_stack([ones, scene.x])
    return sp.block_diag([sp.eye_array(below), *top]).tocsr()


def differences(lattice: Bonds, T: sp.csr_array) -> sp.csr_array:
    """Return the derivatives of du_x, then du_z, over each bond by q, shape (2 n_bonds, n_q)."""
    return sp.vstack([D @ T for D in lattice.difference]).tocsr()


def driven_dofs(scene: Scene) -> np.ndarray:
    """Return the indices in u_full of u_x of driven blocks, row by row, (n_driven,), int."""
    of_blocks = np.arange(2 * scene.N_x * scene.N_z).reshape(scene.N_z, 2, scene.N_x)
    return of_blocks[scene.driven].ravel()


def mass(scene: Scene) -> np.ndarray:
    """Return the diagonal mass matrix in generalised coordinates, shape (n_q,), in kg.

    Under a rod the last entries are M_rod + N_x m (twice) and the moment of inertia
    M_rod L^2/12 + sum m x_i^2 in kg m^2. Blocks on a plane of symmetry count as half or quarter
    blocks (`Scene.shares`).
    """
    m = scene.m
    if not scene.rigid:
        rows, columns = scene.shares
        moving = scene.N_z - (scene.walls.top == "held")
        return m * np.outer(np.repeat(rows[:moving], 2), columns).ravel()
    top, below = scene.top_shares, np.outer(np.repeat(scene.shares[0][:-1], 2), scene.shares[1])
    total = scene.M_rod + m * np.sum(top)
    inertia = scene.M_rod * scene.slider.L**2 / 12 + m * np.sum(top * scene.x**2)
    return np.concatenate([m * below.ravel(), [total, total, inertia]])


def ground(scene: Scene, T: sp.csr_array, closed: np.ndarray, *, driver: bool = True) -> np.ndarray:
    """Return the stiffness from each coordinate to the ground, shape (n_q,), in N/m.

    The parts are the foundation under the closed blocks, the mattress, k_top on the top row and,
    with `driver`, the driver spring. T is from `coordinates`.
    """
    at, springs = ends(scene.N_x), np.zeros(2 * scene.N_x * scene.N_z)
    springs[at.u_z] = scene.k_f * closed
    springs[at.top_x] += scene.k_top
    if driver:
        springs[driven_dofs(scene)] += scene.driver.K / scene.n_driven
    held = T.T @ springs  # no spring acts on u_z of a rigid row
    if scene.rigid:
        held[-1] = scene.kappa
    return held


def stiffness(
    scene: Scene, *, closed: np.ndarray | None = None, driver: bool = True
) -> sp.csr_array:
    """Return the stiffness of the linear geometry in coordinates, shape (n_q, n_q), in N/m.

    Args:
        scene: the scene.
        closed: bottom blocks that touch the foundation, shape (N_x,), bool; None means all.
        driver: whether the driver spring is attached.
    """
    closed, T = np.ones(scene.N_x, bool) if closed is None else closed, coordinates(scene)
    lattice, springs = bonds(scene), ground(scene, T, closed, driver=driver)
    return assembled(differences(lattice, T), spring_tangents(lattice), springs)


def bond_stiffness(scene: Scene) -> sp.csr_array:
    """Return the stiffness of bonds and k_top in coordinates, over k, shape (n_q, n_q).

    The result does not depend on k, to which all bond stiffnesses are proportional.
    """
    lattice, T = bonds(scene), coordinates(scene)
    springs = np.zeros(2 * scene.N_x * scene.N_z)
    springs[ends(scene.N_x).top_x] = scene.k_top / scene.slider.k
    lattice = dataclasses.replace(lattice, k=lattice.k / scene.slider.k)
    return assembled(differences(lattice, T), spring_tangents(lattice), T.T @ springs)


def damping(scene: Scene, du: list[np.ndarray] | None = None) -> sp.csr_array:
    """Return the damping matrix in generalised coordinates, shape (n_q, n_q), in N s/m.

    The matrix contains the bonds and the absorbing walls. Every bond carries eta (v_j - v_i), with
    the full relative velocity, so that bonds within a rigid top row resist its rotation.
    With `Slider.dashpots` "along" only the component along the bond counts.

    Args:
        scene: the scene.
        du: du_x and du_z over each bond, shape (n_bonds,), in m, which set the directions of
            dashpots; None means undeformed bonds.
    """
    lattice, T = bonds(scene), coordinates(scene)
    d = lattice.d.T if du is None else lattice.d.T + du
    x, z = d / np.hypot(*d)
    along = scene.slider.dashpots == "along"
    of_bonds = np.array([x * x, x * z, z * z] if along else [x * x + z * z, 0 * x, x * x + z * z])
    of_bonds *= scene.eta * lattice.share
    return assembled(differences(lattice, T), of_bonds, T.T @ _absorbing(scene))


def _absorbing(scene: Scene) -> np.ndarray:
    """Return the dashpots of absorbing walls on each displacement, shape (2 N_x N_z,), in N s/m."""
    z_p, z_s = np.sqrt(scene.slider.k * scene.m * np.array([1.5, 0.5]))
    c, walls, (rows, columns) = np.zeros((scene.N_z, 2, scene.N_x)), scene.walls, scene.shares
    top = walls.top == "absorbing"
    for name, i in (("left", 0), ("right", -1)):
        if getattr(walls, name) == "absorbing":
            c[:, :, i] += np.outer(rows, [z_p, z_s])
            c[-1, 1, i] *= not top  # in corners only normal dashpots act
    if top:
        c[-1] += np.outer([z_s, z_p], columns)
        for name, i in (("left", 0), ("right", -1)):
            c[-1, 0, i] -= z_s / 2 * (getattr(walls, name) == "absorbing")
    return c.ravel()


def extended(basis: np.ndarray, shapes: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Return a basis with B'M B = 1 of the space that a basis and further vectors span.

    Args:
        basis: the basis, shape (n, m), with B'M B = 1.
        shapes: vectors to add to the span, shape (n, k).
        M: diagonal mass matrix, shape (n,), in kg.
    """
    known, rows = basis.T * np.sqrt(M), shapes.T * np.sqrt(M)
    for _ in range(2):  # twice, because rounding scales with the part that is subtracted
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        rows -= (rows @ known.T) @ known
        rows = rows[np.linalg.norm(rows, axis=1) > INDEPENDENT]
    inertia, axes = np.linalg.eigh(rows @ rows.T)
    independent = inertia > INDEPENDENT
    axes = axes[:, independent] / np.sqrt(inertia[independent])
    return (np.vstack([known, axes.T @ rows]) / np.sqrt(M)).T


def dispersion(
    scene: Scene, wave_vectors: np.ndarray, ground: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and damping rates of plane waves in the infinite lattice or chain.

    A wave exp(i q.r + lambda t) has lambda^2 + gamma lambda + omega^2 = 0. Its stiffness is a
    2 x 2 matrix with eigenvalues m omega^2. Its damping m gamma is a scalar.

    Args:
        scene: the scene (l, k, m, eta are used; N_z = 1 is a chain).
        wave_vectors: q, shape (..., 2), in rad/m.
        ground: stiffness from every block to the ground along x and z, in N/m.

    Returns:
        omega, shape (..., 2), ascending, in rad/s; gamma, shape (...), in 1/s. With dashpots along
        the bonds damping is a matrix, too. Then gamma has shape (..., 2): the damping of each
        undamped wave, without the coupling of the two waves.
    """
    l, k = scene.slider.l, scene.slider.k
    D = np.zeros((*wave_vectors.shape[:-1], 2, 2))
    C = np.zeros_like(D)
    gamma = np.zeros(wave_vectors.shape[:-1])
    for dx, dz, factor in DIRECTIONS:
        if abs(dz) >= scene.N_z:
            continue
        d = np.array([dx, dz], dtype=float)
        s = 4 * np.sin(wave_vectors @ (d * l / 2)) ** 2
        D += (factor * s)[..., None, None] * np.outer(d, d) / (d @ d)
        C += s[..., None, None] * np.outer(d, d) / (d @ d)
        gamma += s
    D += np.diag(ground) / k
    if scene.slider.dashpots == "along":
        values, shapes = np.linalg.eigh(D)
        gamma = np.einsum("...ik,...ij,...jk->...k", shapes, C, shapes)
    else:
        values = np.linalg.eigvalsh(D)
    omega = np.sqrt(k / scene.m) * np.sqrt(np.maximum(values, 0.0))
    return omega, gamma * (scene.eta / scene.m)
