"""The lattice as matrices: bonds, generalised coordinates, mass, stiffness, damping, waves.

Displacements of all blocks are one vector u_full with index (2 j + c) N_x + i (row j, component
c = 0 for x and 1 for z, column i): the order of an array u[j, c, i]. Under a rod the top row moves
rigidly, u_x = X and u_z = Z + phi x_i, so the generalised coordinates q are the rows below it,
then X, Z, phi, and u_full = T q with a sparse T. Without a rod q = u_full. The equation of motion
of the linear geometry, without friction, is

    M q'' + C q' + K q = forces.

Source: PRL 107, 074301 (2011), model section.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from pyfric.scene import Geometry, Scene, check_geometry

__all__ = [
    "Assembly",
    "Bonds",
    "Operators",
    "bonds",
    "coordinates",
    "damping",
    "dispersion",
    "driven_dof",
    "mass",
    "operators",
    "spring_forces",
    "spring_stiffness",
    "spring_tangents",
    "stiffness",
]

# Bonds lead from each block to its neighbour by (columns, rows); stiffness in units of k.
_FAMILIES = ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5))


@dataclass(frozen=True)
class Bonds:
    """All bonds of the lattice, each once.

    Bonds over a mirrored side or top lead to an image, which has the u_x of block b and the
    opposite of its u_z. Two of them are alike, so one stands for both, and of a bond that is its
    own image one half counts.

    Attributes:
        a, b: flat indices j N_x + i of the two blocks, shape (n,), int.
        d: reference vector from a to b, shape (n, 2), in m.
        l: reference length |d|, shape (n,), in m.
        k: stiffness, shape (n,), in N/m: k, or k/2 on the diagonals.
        shape: (N_z, N_x).
        image: bonds that lead to an image, shape (n,), bool.
        share: what of each dashpot counts, shape (n,): 1, or 1/2, or 1/4.
    """

    a: np.ndarray
    b: np.ndarray
    d: np.ndarray
    l: np.ndarray
    k: np.ndarray
    shape: tuple[int, int]
    image: np.ndarray
    share: np.ndarray

    @functools.cached_property
    def difference(self) -> tuple[sp.csr_array, sp.csr_array]:
        """D_x, D_z with D_c u_full = u_c(b) - u_c(a), each of shape (n, 2 N_x N_z).

        For an image D_z u_full = -u_z(b) - u_z(a).
        """
        N_x = self.shape[1]
        n = len(self.a)
        rows = np.tile(np.arange(n), 2)
        away = -np.ones(n)
        shown = np.ones(n), np.where(self.image, -1.0, 1.0)
        block = np.concatenate([self.a, self.b])
        x = block // N_x * 2 * N_x + block % N_x
        size = (n, 2 * self.shape[0] * N_x)
        return tuple(
            sp.csr_array((np.concatenate([away, shown[c]]), (rows, x + c * N_x)), shape=size)
            for c in (0, 1)
        )

    @functools.cached_property
    def _gather(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Transposes of `difference`: bond forces to forces on the blocks, with the sign of a."""
        return tuple((-D.T).tocsr() for D in self.difference)


def bonds(scene: Scene) -> Bonds:
    """Return the bonds of the lattice: four neighbours at l, four at sqrt(2) l.

    Source: PRL 107, 074301 (2011); springs on the edges have full stiffness.
    """
    N_x, N_z, l = scene.N_x, scene.N_z, scene.slider.l
    index = np.arange(N_x * N_z).reshape(N_z, N_x)
    parts = []
    for dx, dz, factor in _FAMILIES:
        a = index[max(-dz, 0) : N_z - max(dz, 0), : N_x - dx].ravel()
        b = index[max(dz, 0) : N_z - max(-dz, 0), dx:].ravel()
        d = np.tile([dx * l, dz * l], (len(a), 1))
        length = np.full(len(a), l * np.hypot(dx, dz))
        parts.append((a, b, d, length, np.full(len(a), factor * scene.slider.k)))
    n = sum(len(part[0]) for part in parts)
    parts += _over_walls(scene, index)
    a, b, d, length, k = (np.concatenate(part) for part in zip(*parts, strict=True))
    image = np.arange(len(a)) >= n
    share = np.where(image & (a == b), 0.5, 1.0)
    if scene.prescribed:  # half blocks
        share[(a < N_x) & (b < N_x) & (d[:, 1] == 0)] /= 2
    return Bonds(a, b, d, length, k * share, (N_z, N_x), image, share)


def _over_walls(scene: Scene, index: np.ndarray) -> list[tuple[np.ndarray, ...]]:
    """Return a, b, d, l and k of the bonds over mirrored sides and top."""
    l, k, walls = scene.slider.l, scene.slider.k, scene.walls
    sides = {"left": (index[:, 0], (-1, 0)), "right": (index[:, -1], (1, 0))}
    sides["top"] = index[-1], (0, 1)
    found = []
    for name, (row, normal) in sides.items():
        if getattr(walls, name) != "mirrored":
            continue
        along = np.array([normal[1], normal[0] ** 2])
        for a, b, d, factor in (
            (row, row, np.array(normal), 1.0),
            (row[:-1], row[1:], normal + along, 0.5),
        ):
            length = l * np.hypot(*d)
            vectors = np.tile(l * d, (len(a), 1))
            found.append((a, b, vectors, np.full(len(a), length), np.full(len(a), factor * k)))
    return found


def _stretch(lattice: Bonds, u_full: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return D = d + du as (D_x, D_z), r = |D| and r - l = (2 d.du + |du|^2)/(r + l)."""
    D_x, D_z = lattice.difference
    du_x, du_z = D_x @ u_full, D_z @ u_full
    d_x, d_z = lattice.d.T
    X, Z = d_x + du_x, d_z + du_z
    r = np.sqrt(X * X + Z * Z)
    e = (du_x * (d_x + X) + du_z * (d_z + Z)) / (r + lattice.l)
    return X, Z, r, e


def spring_forces(lattice: Bonds, u: np.ndarray, geometry: Geometry = "linear") -> np.ndarray:
    """Return the forces of all springs on the blocks.

    Args:
        lattice: from `bonds`.
        u: displacements, shape (N_z, 2, N_x) or flat, in m.
        geometry: "linear", k n (n.du), or "finite", k (r - l) D/r with D = d + du, r = |D|.

    Returns:
        Forces in N, in the shape of u.

    Raises:
        ValueError: unknown geometry.

    Source: PRL 107, 074301 (2011), force k_ij (r_ij - l_ij) dx_ij / r_ij.
    """
    check_geometry(geometry)
    flat = u.reshape(-1)
    if geometry == "linear":
        D_x, D_z = lattice.difference
        X, Z = lattice.d.T
        tension = lattice.k * (X * (D_x @ flat) + Z * (D_z @ flat)) / lattice.l**2
    else:
        X, Z, r, e = _stretch(lattice, flat)
        tension = lattice.k * e / r
    gather_x, gather_z = lattice._gather
    return (gather_x @ (tension * X) + gather_z @ (tension * Z)).reshape(u.shape)


def spring_tangents(
    lattice: Bonds, u: np.ndarray | None = None, geometry: Geometry = "linear"
) -> np.ndarray:
    """Return the entries xx, xz and zz of the stiffness of each bond, shape (3, n_bonds), in N/m.

    Arguments and source are those of `spring_stiffness`.
    """
    check_geometry(geometry)
    X, Z = lattice.d.T
    r, isotropic = lattice.l, 0.0
    if geometry == "finite" and u is not None:
        X, Z, r, e = _stretch(lattice, u.reshape(-1))
        isotropic = lattice.k * e / r
    along = lattice.k * lattice.l / r**3
    return np.array([along * X * X + isotropic, along * X * Z, along * Z * Z + isotropic])


def spring_stiffness(
    lattice: Bonds, u: np.ndarray | None = None, geometry: Geometry = "linear"
) -> sp.csr_array:
    """Return the derivative of minus `spring_forces` with respect to u_full.

    Args:
        lattice: from `bonds`.
        u: displacements at which the finite geometry is linearised, in m; None means 0.
        geometry: "linear" or "finite". Per bond: k n n^T, or k ((r-l)/r I + l D D^T / r^3).

    Returns:
        Symmetric sparse matrix, shape (2 N_x N_z, 2 N_x N_z), in N/m.

    Raises:
        ValueError: unknown geometry.
    """
    along_xx, along_xz, along_zz = spring_tangents(lattice, u, geometry)
    D_x, D_z = lattice.difference
    xz = D_x.T @ sp.diags_array(along_xz) @ D_z
    xx = D_x.T @ sp.diags_array(along_xx) @ D_x
    zz = D_z.T @ sp.diags_array(along_zz) @ D_z
    return (xx + zz + xz + xz.T).tocsr()


class Assembly:
    """The stiffness of all bonds in coordinates as a sparse matrix times their tangents.

    The places of its entries are found once, which takes longer than `spring_stiffness` does.

    Args:
        lattice: from `bonds`.
        T: from `coordinates`.
    """

    def __init__(self, lattice: Bonds, T: sp.csr_array) -> None:
        x, z = ((D @ T).tocsr() for D in lattice.difference)
        n, n_bonds = T.shape[1], len(lattice.a)
        parts = _products(x, x), _products(x, z), _products(z, x), _products(z, z)
        tangent = np.concatenate(
            [bond + n_bonds * c for (bond, *_), c in zip(parts, (0, 1, 1, 2), strict=True)]
        )
        i, j, share = (np.concatenate(part) for part in list(zip(*parts, strict=True))[1:])
        place = i * n + j
        order = np.argsort(place, kind="stable")  # several times faster than np.unique
        first = np.diff(place[order], prepend=-1) > 0
        entry = np.empty(len(place), dtype=int)
        entry[order], place = np.cumsum(first) - 1, place[order][first]
        self._shares = sp.csr_array((share, (entry, tangent)), shape=(len(place), 3 * n_bonds))
        self._indices = (place % n).astype(np.int32)
        self._indptr = np.searchsorted(place // n, np.arange(n + 1)).astype(np.int32)
        self._shape = n, n
        self._diagonal = np.searchsorted(place, np.arange(n) * (n + 1))

    def stiffness(self, tangents: np.ndarray, diagonal: np.ndarray) -> sp.csr_array:
        """Return the stiffness, shape (n_q, n_q), for `spring_tangents` and more springs, in N/m.

        Args:
            tangents: of the bonds, shape (3, n_bonds), in N/m.
            diagonal: stiffness that holds each coordinate, shape (n_q,), in N/m.
        """
        entries = self._shares @ tangents.ravel()
        entries[self._diagonal] += diagonal
        return sp.csr_array((entries, self._indices, self._indptr), shape=self._shape)


def _products(P: sp.csr_array, Q: sp.csr_array) -> tuple[np.ndarray, ...]:
    """Return rows and, for each pair of entries in one row of P and Q, columns and product."""
    n_P, n_Q = np.diff(P.indptr), np.diff(Q.indptr)
    row = np.repeat(np.arange(P.shape[0]), n_P * n_Q)
    k = np.arange(len(row)) - np.repeat(np.cumsum(n_P * n_Q) - n_P * n_Q, n_P * n_Q)
    p, q = P.indptr[row] + k // n_Q[row], Q.indptr[row] + k % n_Q[row]
    return row, P.indices[p].astype(np.int64), Q.indices[q], P.data[p] * Q.data[q]


def coordinates(scene: Scene) -> sp.csr_array:
    """Return T with u_full = T q, shape (2 N_x N_z, n_q).

    Under a rod n_q = 2 N_x (N_z - 1) + 3 and the last coordinates are X (m), Z (m), phi (rad);
    otherwise T is the identity, without the top row where that is held.
    """
    N_x, n = scene.N_x, 2 * scene.N_x * scene.N_z
    if scene.walls.top == "held":
        return sp.eye_array(n, n - 2 * N_x, format="csr")
    if not scene.rigid:
        return sp.eye_array(n, format="csr")
    below = n - 2 * N_x
    one = np.ones(N_x)
    top = one[:, None], np.column_stack([one, scene.x])
    return sp.block_diag([sp.eye_array(below), *top]).tocsr()


def driven_dof(scene: Scene) -> int:
    """Return the index in u_full of u_x of the driven block."""
    return 2 * scene.j_h * scene.N_x + scene.i_h


def mass(scene: Scene) -> np.ndarray:
    """Return the diagonal mass matrix in generalised coordinates, shape (n_q,), in kg.

    Under a rod the last entries are M_rod + N_x m (twice) and the moment of inertia
    M_rod L^2/12 + sum m x_i^2 in kg m^2. On a prescribed interface the first row has half blocks.
    """
    N_x, m = scene.N_x, scene.m
    if not scene.rigid:
        M = np.full(2 * N_x * (scene.N_z - (scene.walls.top == "held")), m)
        M[: 2 * N_x] = scene.m_interface
        return M
    total = scene.M_rod + N_x * m
    inertia = scene.M_rod * scene.slider.L**2 / 12 + m * np.sum(scene.x**2)
    return np.concatenate([np.full(2 * N_x * (scene.N_z - 1), m), [total, total, inertia]])


def stiffness(
    scene: Scene,
    *,
    closed: np.ndarray | None = None,
    driver: bool = True,
    lattice: Bonds | None = None,
    u: np.ndarray | None = None,
    geometry: Geometry = "linear",
) -> sp.csr_array:
    """Return the tangent stiffness in generalised coordinates, shape (n_q, n_q), in N/m.

    It holds the bonds, the foundation under the closed blocks, the mattress, k_top on the top row
    and the driver spring.

    Args:
        scene: the scene.
        closed: bottom blocks that touch the foundation, shape (N_x,), bool; None means all.
        driver: whether the driver spring is attached.
        lattice: the bonds of the scene, if they are at hand.
        u: displacements at which the finite geometry is linearised, in m; None means 0.
        geometry: "linear" or "finite".

    Raises:
        ValueError: unknown geometry.
    """
    N_x, n = scene.N_x, 2 * scene.N_x * scene.N_z
    diagonal = np.zeros(n)
    diagonal[N_x : 2 * N_x] = scene.k_f if closed is None else scene.k_f * closed
    diagonal[n - 2 * N_x : n - N_x] += scene.k_top
    if driver:
        diagonal[driven_dof(scene)] += scene.driver.K
    T = coordinates(scene)
    full = spring_stiffness(lattice or bonds(scene), u, geometry) + sp.diags_array(diagonal)
    K = T.T @ full @ T
    if scene.rigid:
        mattress = np.zeros(T.shape[1])
        mattress[-1] = scene.kappa
        K = K + sp.diags_array(mattress)
    return K.tocsr()


def damping(scene: Scene) -> sp.csr_array:
    """Return the damping matrix in generalised coordinates, shape (n_q, n_q), in N s/m.

    It holds the bonds and the absorbing walls.

    Every bond carries eta (v_j - v_i), the full relative velocity, and the bonds within a rigid top
    row resist its rotation; or only the part along the bond (`Slider.dashpots`).
    """
    T = coordinates(scene)
    lattice = bonds(scene)
    parts = lattice.difference
    if scene.slider.dashpots == "along":
        n = (lattice.d / lattice.l[:, None]).T
        parts = [sum(sp.diags_array(c) @ D for c, D in zip(n, parts, strict=True))]
    C = scene.eta * sum(D.T @ sp.diags_array(lattice.share) @ D for D in parts)
    return (T.T @ (C + sp.diags_array(_absorbing(scene))) @ T).tocsr()


def _absorbing(scene: Scene) -> np.ndarray:
    """Return the dashpots of absorbing walls on each displacement, shape (2 N_x N_z,), in N s/m."""
    z_p, z_s = np.sqrt(scene.slider.k * scene.m * np.array([1.5, 0.5]))
    c, walls = np.zeros((scene.N_z, 2, scene.N_x)), scene.walls
    if walls.left == "absorbing":
        c[:, :, 0] += z_p, z_s
    if walls.right == "absorbing":
        c[:, :, -1] += z_p, z_s
    c[0] /= 2  # half blocks
    if walls.top == "absorbing":
        c[-1] += np.array([[z_s], [z_p]])
    return c.ravel()


class Operators(NamedTuple):
    """Mass (diagonal, shape (n_q,)), stiffness and damping (sparse, shape (n_q, n_q))."""

    M: np.ndarray
    K: sp.csr_array
    C: sp.csr_array


def operators(scene: Scene, closed: np.ndarray | None = None) -> Operators:
    """Return M, K, C of the linear geometry, without friction.

    Args:
        scene: the scene.
        closed: bottom blocks that touch the foundation, shape (N_x,), bool; None means all.
    """
    return Operators(mass(scene), stiffness(scene, closed=closed), damping(scene))


def dispersion(
    scene: Scene, wave_vectors: np.ndarray, ground: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and damping rates of plane waves in the infinite lattice or chain.

    A wave exp(i q.r + lambda t) has lambda^2 + gamma lambda + omega^2 = 0: its stiffness is a
    2 x 2 matrix with eigenvalues m omega^2, its damping m gamma is a number.

    Args:
        scene: the scene (l, k, m, eta are used; N_z = 1 is a chain).
        wave_vectors: q, shape (..., 2), in rad/m.
        ground: stiffness that holds every block along x and z, in N/m.

    Returns:
        omega, shape (..., 2), ascending, in rad/s; gamma, shape (...), in 1/s. With dashpots along
        the bonds damping is a matrix too: gamma has shape (..., 2), what each undamped wave loses,
        without the coupling of the two.
    """
    l, k, m = scene.slider.l, scene.slider.k, scene.m
    D = np.zeros((*wave_vectors.shape[:-1], 2, 2))
    C = np.zeros_like(D)
    gamma = np.zeros(wave_vectors.shape[:-1])
    for dx, dz, factor in _FAMILIES:
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
    omega = np.sqrt(k / m) * np.sqrt(np.maximum(values, 0.0))
    return omega, gamma * (scene.eta / m)
