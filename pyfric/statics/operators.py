"""The lattice as matrices: bonds, generalised coordinates, mass, stiffness, damping, step limit.

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
import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from pyfric.scene import Driver, Geometry, PrescribedLoad, Rod, Scene, Slider, check_geometry

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

__all__ = [
    "METHODS",
    "Bonds",
    "Operators",
    "bonds",
    "coordinates",
    "damping",
    "dispersion",
    "driven_dof",
    "mass",
    "operators",
    "rk4_radius",
    "spring_forces",
    "spring_stiffness",
    "spring_tangents",
    "stability_limit",
    "stepped",
    "stiffness",
]

METHODS = ("rk4", "verlet", "symplectic_euler", "adaptive")
"""Names of the steppers; see `pyfric.simulate`."""
_RK4 = ("rk4", "adaptive")
ROUNDED = 1e-7
"""Growth in one step that rounding explains: eigenvalues on the unit circle can be double."""

# Bonds lead from each block to its neighbour by (columns, rows); stiffness in units of k.
_FAMILIES = ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5))


@dataclass(frozen=True)
class Bonds:
    """All bonds of the lattice, each once.

    Attributes:
        a, b: flat indices j N_x + i of the two blocks, shape (n,), int.
        d: reference vector from a to b, shape (n, 2), in m.
        l: reference length |d|, shape (n,), in m.
        k: stiffness, shape (n,), in N/m: k, or k/2 on the diagonals.
        shape: (N_z, N_x).
    """

    a: np.ndarray
    b: np.ndarray
    d: np.ndarray
    l: np.ndarray
    k: np.ndarray
    shape: tuple[int, int]

    @functools.cached_property
    def difference(self) -> tuple[sp.csr_array, sp.csr_array]:
        """D_x, D_z with D_c u_full = u_c(b) - u_c(a), each of shape (n, 2 N_x N_z)."""
        N_x = self.shape[1]
        n = len(self.a)
        rows = np.tile(np.arange(n), 2)
        signs = np.repeat([-1.0, 1.0], n)
        block = np.concatenate([self.a, self.b])
        x = block // N_x * 2 * N_x + block % N_x
        size = (n, 2 * self.shape[0] * N_x)
        return tuple(sp.csr_array((signs, (rows, x + c * N_x)), shape=size) for c in (0, 1))

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
    a, b, d, length, k = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Bonds(a, b, d, length, k, (N_z, N_x))


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


def coordinates(scene: Scene) -> sp.csr_array:
    """Return T with u_full = T q, shape (2 N_x N_z, n_q).

    Under a rod n_q = 2 N_x (N_z - 1) + 3 and the last coordinates are X (m), Z (m), phi (rad);
    otherwise T is the identity.
    """
    N_x, n = scene.N_x, 2 * scene.N_x * scene.N_z
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
    M_rod L^2/12 + sum m x_i^2 in kg m^2.
    """
    N_x, m = scene.N_x, scene.m
    if not scene.rigid:
        return np.full(2 * N_x * scene.N_z, m)
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

    Every bond carries eta (v_j - v_i), the full relative velocity; the bonds within a rigid top
    row resist its rotation.
    """
    T = coordinates(scene)
    C = sum(D.T @ D for D in bonds(scene).difference)
    return (scene.eta * (T.T @ C @ T)).tocsr()


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
        omega, shape (..., 2), ascending, in rad/s; gamma, shape (...), in 1/s.
    """
    l, k, m = scene.slider.l, scene.slider.k, scene.m
    D = np.zeros((*wave_vectors.shape[:-1], 2, 2))
    gamma = np.zeros(wave_vectors.shape[:-1])
    for dx, dz, factor in _FAMILIES:
        if abs(dz) >= scene.N_z:
            continue
        d = np.array([dx, dz], dtype=float)
        s = 4 * np.sin(wave_vectors @ (d * l / 2)) ** 2
        D += (factor * s)[..., None, None] * np.outer(d, d) / (d @ d)
        gamma += s
    D += np.diag(ground) / k
    omega = np.sqrt(k / m) * np.sqrt(np.maximum(np.linalg.eigvalsh(D), 0.0))
    return omega, gamma * (scene.eta / m)


def rk4_radius(theta: np.ndarray) -> np.ndarray:
    """Return the largest |z| with |R(z)| <= 1 on the ray of angle theta, for RK4.

    R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24; the stable part of each ray of the left half plane is
    connected, so bisection finds its end.

    Args:
        theta: angle of z, any shape, in [pi/2, pi] (rad).
    """
    ray = np.exp(1j * np.asarray(theta))
    low, high = np.full(ray.shape, 2.0), np.full(ray.shape, 4.0)
    for _ in range(52):
        middle = (low + high) / 2
        z = middle * ray
        stable = np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))) <= 1
        low, high = np.where(stable, middle, low), np.where(stable, high, middle)
    return low


def _step_limits(eigenvalues: np.ndarray) -> np.ndarray:
    """Return the RK4 limit for each eigenvalue; rounding into the right half plane is removed."""
    z = np.minimum(eigenvalues.real, 0.0) + 1j * np.abs(eigenvalues.imag)
    limits = np.full(z.shape, np.inf)
    moving = z != 0
    limits[moving] = rk4_radius(np.angle(z[moving])) / np.abs(z[moving])
    return limits


def stepped(
    method: str, force: Callable[[Any, Any], Any], u: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return u and p = h v (m) after one step of "symplectic_euler" or "verlet".

    Args:
        method: the stepper.
        force: h^2 M^-1 F (m) as a function of u and p.
        u, p: displacement and h times velocity before the step, in m.
    """
    a = force(u, p)
    if method == "symplectic_euler":
        p = p + a
        return u + p, p
    u, guess = u + (p + a / 2), p + a
    return u, (p + guess + force(u, guess)) / 2


def _pair_limits(method: str, omega: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Return the limit for motions with u'' + gamma u' + omega^2 u = 0, in s."""
    if method in _RK4:
        half = gamma / 2
        return _step_limits(-half - np.sqrt((half**2 - omega**2).astype(complex)))
    # Both steppers are unstable beyond 2/omega without damping, beyond 2/gamma without stiffness.
    with np.errstate(divide="ignore"):
        high = 4 / np.maximum(omega, gamma)
    low, moving = np.zeros(high.shape), np.isfinite(high)
    high[~moving] = 0.0
    one, nil = np.ones(high.shape), np.zeros(high.shape)
    for _ in range(52):
        h = (low + high) / 2
        W, g = (h * omega) ** 2, h * gamma
        (uu, pu), (up, pp) = (
            stepped(method, lambda u, p, W=W, g=g: -W * u - g * p, *start)
            for start in ((one, nil), (nil, one))
        )
        trace, det = uu + pp, uu * pp - up * pu
        stable = (np.abs(trace) <= 1 + det) & (det <= 1)
        stable |= (np.abs(trace) <= 1 + det + ROUNDED) & (det <= 1 + ROUNDED) & (gamma == 0)
        low, high = np.where(stable, h, low), np.where(stable, high, h)
    low[~moving] = np.inf
    return low


def _bulk_limit(scene: Scene, method: str) -> tuple[float, complex, np.ndarray]:
    """Return the smallest limit over the Brillouin zone, its eigenvalue and its q l.

    All blocks of a chain are on the foundation (or open) and held by k_top, so its waves are too.
    """
    grounds = [(0.0, 0.0)]
    if scene.N_z == 1:
        grounds = [(scene.k_top, scene.k_f), (scene.k_top, 0.0)]
    found = (_waves_limit(scene, ground, method) for ground in grounds)
    return min(found, key=lambda one: one[0])


def _waves_limit(
    scene: Scene, ground: tuple[float, float], method: str
) -> tuple[float, complex, np.ndarray]:
    """Return `_bulk_limit` for blocks held by `ground` (`dispersion`).

    The stiffness is even in q_x and q_z, so q l in [0, pi]^2 is enough; the grid is refined
    around its best point.
    """
    centre, width, best = np.full(2, np.pi / 2), np.pi / 2, (np.inf, 0j, np.zeros(2))
    for _ in range(5):
        axes = [np.clip(c + np.linspace(-width, width, 33), 0, np.pi) for c in centre]
        ql = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        omega, gamma = dispersion(scene, ql / scene.slider.l, ground)
        gamma = np.broadcast_to(gamma[:, None], omega.shape)
        limits = _pair_limits(method, omega, gamma)
        i, branch = np.unravel_index(np.argmin(limits), limits.shape)
        if limits[i, branch] < best[0]:
            half = gamma[i, branch] / 2
            eigenvalue = -half - np.sqrt(complex(half**2 - omega[i, branch] ** 2))
            best = (float(limits[i, branch]), eigenvalue, ql[i])
        centre, width = best[2], width / 16
    return best


_REDUCED = (8, 5)
"""Largest N_x, N_z of the lattice whose eigenvalues are computed densely."""


def _row_mass(m: float, n: int) -> float:
    """Return 12/L^2 times the moment of inertia m sum x_i^2 of a row of n blocks, in kg."""
    return m * n * (n + 1) / (n - 1)


def _reduced(scene: Scene) -> Scene:
    """Return a small scene with the same local properties, or the scene if it is small.

    l, k, m, eta, k_f are kept, and K where it acts on one block. The mass of the rod, and K where
    it acts on the rod, are scaled with N_x, like the bonds that hold the rod, and the mattress with
    the moment of inertia: frequencies of the rod keep their size.
    """
    n_x, n_z = (min(n, most) for n, most in zip((scene.N_x, scene.N_z), _REDUCED, strict=True))
    if (n_x, n_z) == (scene.N_x, scene.N_z):
        return scene
    below, above = scene.j_h, scene.N_z - 1 - scene.j_h
    j_h = below if below <= n_z // 2 else max(n_z - 1 - above, n_z // 2)
    share = n_x / scene.N_x
    on_rod = scene.rigid and above == 0
    l, top = scene.slider.l, scene.top
    if scene.rigid:
        # kappa over the moment of inertia, 12/L^2 left out, is kept.
        rod = top.mass * share
        tilt = (rod + _row_mass(scene.m, n_x)) / (top.mass + _row_mass(scene.m, scene.N_x))
        top = Rod(F_N=top.F_N, mass=rod, mattress=top.mattress * tilt)
    elif n_z == 1:
        top = PrescribedLoad(p=scene.F_N / scene.N_x, k_top=scene.k_top)
    return Scene(
        slider=Slider(
            L=(n_x - 1) * l,
            H=(n_z - 1) * l,
            l=l,
            k=scene.slider.k,
            M=scene.m * n_x * n_z,
            eta=scene.eta,
        ),
        top=top,
        driver=Driver(K=scene.driver.K * (share if on_rod else 1.0), V=0.0, h=j_h * l),
        interface=scene.interface,
    )


def _matrices(scene: Scene) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield M^-1/2 K M^-1/2 and M^-1/2 C M^-1/2, in units of k/m and sqrt(k/m).

    Bottom row closed or open, its u_x free or held.
    """
    unit = np.sqrt(scene.slider.k / scene.m)
    M, K_closed, C = operators(scene)
    K_open = stiffness(scene, closed=np.zeros(scene.N_x, dtype=bool))
    root = np.sqrt(M)
    for K in (K_closed, K_open):
        for first in (0, scene.N_x):  # bottom u_x, the first N_x coordinates: free or held
            scale = np.outer(root[first:], root[first:])
            stiff = K.toarray()[first:, first:] / (scale * unit**2)
            yield stiff, C.toarray()[first:, first:] / (scale * unit)


def _small_limit(scene: Scene, method: str, enough: float) -> tuple[float, complex]:
    """Return the limit of a small lattice in s and the eigenvalue (1/s) that sets it.

    A limit above `enough` (s) need not be exact.
    """
    unit = np.sqrt(scene.slider.k / scene.m)
    best, eigenvalue = np.inf, 0j
    for K, C in _matrices(scene):
        n = len(K)
        if method in _RK4:
            A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
            found = np.linalg.eigvals(A)
            limits = _step_limits(found)
            i = int(np.argmin(limits))
            if limits[i] < best:
                best, eigenvalue = float(limits[i]), complex(found[i])
        else:
            limit, one = _map_limit(method, K, C, min(best, enough * unit))
            if limit < best:
                best, eigenvalue = limit, one
    return best / unit, eigenvalue * unit


def _map_limit(method: str, K: np.ndarray, C: np.ndarray, enough: float) -> tuple[float, complex]:
    """Return the limit of u'' = -K u - C u' and its eigenvalue; inf where it is above `enough`.

    The eigenvalue is that of the motion in the shape that becomes unstable.
    """
    n = len(K)
    one, nil = np.eye(n), np.zeros((n, n))

    def modes(h: float) -> tuple[np.ndarray, np.ndarray]:
        u, p = stepped(
            method,
            lambda u, p: -(h * h) * (K @ u) - h * (C @ p),
            np.hstack([one, nil]),
            np.hstack([nil, one]),
        )
        return np.linalg.eig(np.vstack([u, p]))

    def stable(h: float) -> bool:
        return bool(np.abs(modes(h)[0]).max() <= 1 + ROUNDED)

    low, high = 0.0, enough if math.isfinite(enough) else 4 / math.sqrt(np.linalg.norm(K, 2))
    if stable(high):
        return np.inf, 0j
    for _ in range(26):
        h = (low + high) / 2
        low, high = (h, high) if stable(h) else (low, h)
    values, shapes = modes(high)
    x = shapes[:n, np.argmax(np.abs(values))]
    x = x / np.linalg.norm(x)
    half, omega2 = ((x.conj() @ A @ x).real for A in (C / 2, K))
    return low, -half - np.sqrt(complex(half**2 - omega2))


@functools.lru_cache(maxsize=64)
def stability_limit(scene: Scene, method: str = "rk4") -> tuple[float, Mapping[str, Any]]:
    """Return the largest stable time step of the linear, damped lattice.

    For "rk4", all eigenvalues lambda of [[0, I], [-M^-1 K, -M^-1 C]] must keep |R(lambda dt)| <= 1.
    "adaptive" makes the steps of RK4: this is where its error control cannot let sub-steps grow
    beyond, not a limit of dt. The other steppers treat u and v differently, so that their whole
    step, a matrix, must have no eigenvalue outside the unit circle. For a plane wave of frequency
    omega and damping rate gamma this is (omega dt)^2 + 2 gamma dt <= 4 for "symplectic_euler", and
    for "verlet" a polynomial condition that ends at omega dt = 2 without damping and at
    gamma dt = 2 without stiffness.

    The limit is local, so it is the smaller one of two: plane waves of the infinite lattice, and
    all modes of a lattice of at most 8 x 5 blocks with the boundaries of the scene (foundation,
    driver, rod; bottom row closed or open, held or free). A scene of at most that size is computed
    exactly, without the plane waves.

    Args:
        scene: the scene.
        method: "rk4", "symplectic_euler", "verlet" or "adaptive".

    Returns:
        dt_max in s, and a mapping: `dt_bulk` (plane waves, s), `dt_boundary` (small lattice, s; inf
        for some steppers where it is above `dt_bulk`),
        `eigenvalue` (the one that sets the limit, 1/s), `wave_vector` (q l of the plane wave,
        rad), `shape` ((N_z, N_x) of the small lattice), `exact` (the small lattice is the scene).

    Raises:
        ValueError: unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: expected {' or '.join(map(repr, METHODS))}")
    small = _reduced(scene)
    exact = small is scene
    dt_bulk, bulk, ql = _bulk_limit(scene, method)
    dt_boundary, boundary = _small_limit(small, method, np.inf if exact else dt_bulk)
    set_inside = dt_bulk < dt_boundary and not exact
    info = {
        "dt_bulk": dt_bulk,
        "dt_boundary": dt_boundary,
        "eigenvalue": bulk if set_inside else boundary,
        "wave_vector": (float(ql[0]), float(ql[1])),
        "shape": (small.N_z, small.N_x),
        "exact": exact,
    }
    return (dt_bulk if set_inside else dt_boundary), MappingProxyType(info)
