"""The largest stable time step of the linear, damped lattice."""

from __future__ import annotations

import dataclasses
import functools
import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import STEPPERS
from pyfric.scene import DistributedLoad, Driver, Interface, PrescribedLoad, Rod, Scene, as_scene
from pyfric.statics.operators import damping, dispersion, mass, stiffness
from pyfric.statics.rows import ends
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pyfric.core import Stepper
    from pyfric.scene import SceneLike

ROUNDED = 1e-7
"""Growth in one step that rounding can cause. Rounding splits double eigenvalues on the unit circle
by the square root of the rounding error, 1.5e-8. The step matrix can enlarge this split."""
GROWN = 2.0**-40
"""Growth of a Runge-Kutta step that counts as stable: 1e8 steps grow by 1e-4."""
BITS = 52
"""Number of bisections to full precision. Half this number leaves 1.5e-8 of the interval."""


def _least_end(
    stable: Callable[[np.ndarray, np.ndarray], np.ndarray],
    low: np.ndarray,
    high: np.ndarray,
    size: np.ndarray | float = 1.0,
) -> tuple[float, int]:
    """Return the smallest end of a stable interval over `size`, and its index; inf, 0 if none.

    Each interval is bisected until another interval surely has a smaller end.

    Args:
        stable: function of positions and indices of their intervals, both of shape (m,), that
            returns whether the positions are stable.
        low, high: a stable and an unstable position in each interval, shape (n,).
        size: shape (n,) or a number.
    """
    if not len(low):
        return np.inf, 0
    which, size = np.arange(len(low)), np.broadcast_to(size, low.shape)
    for _ in range(BITS):
        middle = (low + high) / 2
        fine = stable(middle, which)
        low, high = np.where(fine, middle, low), np.where(fine, high, middle)
        near = low / size <= (high / size).min()
        which, size, low, high = which[near], size[near], low[near], high[near]
    found = int(np.argmin(low / size))
    return float(low[found] / size[found]), int(which[found])


def least_limit(stepper: Stepper, eigenvalues: np.ndarray) -> tuple[float, int]:
    """Return the smallest stable step of eigenvalues, shape (n,), and the index of its eigenvalue.

    The stable step of lambda is |z|/|lambda| with the largest |z| up to 4 at which |R(z)| <= 1 +
    `GROWN` for z in the direction of lambda. The stable part of each ray in the left half plane is
    connected, so that bisection finds its end. Positive real parts are due to rounding and set to
    0.

    Args:
        stepper: a stepper with R(z) (`Stepper.growth`).
        eigenvalues: eigenvalues, in 1/s for a step in s. The step has the inverse of their unit.
    """
    z = np.minimum(eigenvalues.real, 0.0) + 1j * np.abs(eigenvalues.imag)
    moving = np.flatnonzero(z)
    size, ray = np.abs(z[moving]), np.exp(1j * np.angle(z[moving]))

    *others, last = stepper.growth.coef.tolist()

    def stable(s: np.ndarray, which: np.ndarray) -> np.ndarray:
        z = s * ray[which]
        R = np.full(z.shape, complex(last))
        for term in reversed(others):  # Horner's rule
            R = term + R * z
        return np.abs(R) <= 1 + GROWN

    low = np.where(stable(np.full(ray.shape, 2.0), np.arange(len(ray))), 2.0, 0.0)
    limit, found = _least_end(stable, low, np.full(ray.shape, 4.0), size)
    return limit, int(moving[found]) if len(moving) else 0


def _least_pair(stepper: Stepper, omega: np.ndarray, gamma: np.ndarray) -> tuple[float, int]:
    """Return the smallest stable step (s) of u'' + gamma u' + omega^2 u = 0, and its index."""
    if stepper.growth is not None:
        half = gamma / 2
        return least_limit(stepper, -half - np.sqrt((half**2 - omega**2).astype(complex)))

    def stable(h: np.ndarray, which: np.ndarray) -> np.ndarray:
        W, g, unit, zero = (h * omega[which]) ** 2, h * gamma[which], np.ones(h.shape), 0.0 * h
        (uu, pu), (up, pp) = (
            stepper.step(lambda u, p: -W * u - g * p, *start)
            for start in ((unit, zero), (zero, unit))
        )
        trace, det = uu + pp, uu * pp - up * pu
        fine = (np.abs(trace) <= 1 + det) & (det <= 1)
        rounded = (np.abs(trace) <= 1 + det + ROUNDED) & (det <= 1 + ROUNDED)
        return fine | rounded & (gamma[which] == 0)

    # These steppers are unstable above 2/omega without damping and above 2/gamma without stiffness.
    fastest = np.maximum(omega, gamma)
    moving = np.flatnonzero(fastest)
    omega, gamma, high = omega[moving], gamma[moving], 4 / fastest[moving]
    limit, found = _least_end(stable, np.zeros(high.shape), high)
    return limit, int(moving[found]) if len(moving) else 0


@functools.lru_cache(maxsize=256)
def _bulk_limit(scene: Scene, stepper: str, on: float) -> float:
    """Return the smallest stable step of waves in the Brillouin zone, in s.

    In a chain every block has springs to the foundation (unless it is open), k_top and `on` (N/m).
    These springs enter the waves of the chain.
    """
    grounds, drags = [(0.0, 0.0)], [0.0]
    if scene.N_z == 1:
        hold = scene.k_top + on
        grounds = [(hold, float(np.max(scene.k_f))), (hold, 0.0)]
        drags = sorted({0.0, float(np.max(scene.law.alpha)) / scene.m})
    return min(_waves_limit(scene, ground, drag, stepper) for ground in grounds for drag in drags)


def _waves_limit(scene: Scene, ground: tuple[float, float], drag: float, stepper: str) -> float:
    """Return `_bulk_limit` with springs `ground` (`dispersion`) and a force -m drag v on blocks.

    The stiffness is even in q_x and q_z, so that q l in [0, pi]^2 suffices. The grid is refined
    16-fold around its best point, five times, to a resolution of 1.5e-6.
    """
    centre, width, best = np.full(2, np.pi / 2), np.pi / 2, np.inf
    for _ in range(5):
        axes = [np.clip(c + np.linspace(-width, width, 33), 0, np.pi) for c in centre]
        ql = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        omega, gamma = dispersion(scene, ql / scene.slider.l, ground)
        gamma = np.broadcast_to(gamma.reshape(len(gamma), -1), omega.shape) + drag
        limit, found = _least_pair(STEPPERS[stepper], omega.ravel(), gamma.ravel())
        if limit < best:
            best, centre = limit, ql[found // omega.shape[1]]
        width = width / 16
    return best


_REDUCED = (8, 5)
"""Largest N_x, N_z of a lattice whose eigenvalues are computed densely. The motion that limits the
step is local, so that larger lattices have the same largest step within 5 %
(`tests/test_operators.py`).
"""


def _unloaded_top(
    scene: Scene, mass: float, mattress: float
) -> Rod | DistributedLoad | PrescribedLoad:
    """Return the top of a scene under a load of 1 N; `mass` (kg) and `mattress` (N/m) of a rod."""
    if scene.rigid:
        return Rod(F_N=1.0, mass=mass, mattress=mattress)
    if isinstance(scene.top, PrescribedLoad):
        return PrescribedLoad(p=1.0, k_top=scene.k_top)
    return DistributedLoad(F_N=1.0, k_top=scene.k_top)


def _unloaded(scene: Scene) -> Scene:
    """Return a scene with the same matrices, under a load of 1 N, at rest, without friction."""
    interface = scene.interface
    return Scene(
        slider=scene.slider,
        top=_unloaded_top(scene, scene.top.mass, scene.top.mattress),
        driver=dataclasses.replace(scene.driver, V=0.0, protocol=()),
        interface=Interface(mu_s=0.0, mu_k=0.0, k_f=interface.k_f, alpha=interface.alpha),
        walls=scene.walls,
    )


@functools.lru_cache(maxsize=256)
def _reduced(scene: Scene) -> Scene:
    """Return a scene of at most `_REDUCED` blocks with the same local properties.

    l, k, m, eta, k_f and K on each driven block are unchanged. The mass of the rod is scaled with
    N_x, like the bonds that hold it. K is scaled in the same way if it acts only on the rod. The
    mattress is scaled with the moment of inertia. Frequencies of the rod then keep their size.
    Loads, speeds and friction do not affect the limit. Scenes that differ only in loads, speeds and
    friction have the same small scene.
    """
    n_x, n_z = np.minimum((scene.N_x, scene.N_z), _REDUCED).tolist()
    if (n_x, n_z) == (scene.N_x, scene.N_z):
        return _unloaded(scene)
    j_h, j_h_top = (
        j if j <= n_z // 2 else max(n_z - scene.N_z + j, n_z // 2)
        for j in (scene.j_h, scene.j_h_top)
    )
    share = n_x / scene.N_x
    on_rod = scene.rigid and scene.j_h == scene.N_z - 1
    side, driven = scene.driver.side, j_h_top - j_h + 1
    h_top = j_h_top * scene.slider.l
    if side == "top":
        on_rod, driven, h_top = False, n_x, None
    K = scene.driver.K / scene.n_driven * driven
    l, m, half, rod = scene.slider.l, scene.m, scene.slider.edges == "half", (0.0, 0.0)
    if scene.rigid:
        # kappa over the moment of inertia is unchanged. The factor 12/L^2 cancels: times 12/L^2,
        # m sum x_i^2 of a row of n blocks is m n (n + 1)/(n - 1), and half of
        # m ((n - 1) + 2/(n - 1)) with half blocks.
        rest = scene.top.mass * share
        inertia, whole = (
            mass + m * (0.5 * (n - 1 + 2 / (n - 1)) if half else n * (n + 1) / (n - 1))
            for mass, n in ((rest, n_x), (scene.top.mass, scene.N_x))
        )
        rod = rest, scene.top.mattress * (inertia / whole)
    blocks = (n_x - 1) * max(n_z - 1, 1) if half else n_x * n_z
    lengths = {"L": (n_x - 1) * l, "H": (n_z - 1) * l, "M": m * blocks}
    return Scene(
        slider=dataclasses.replace(scene.slider, **lengths, eta=scene.eta, damping=None),
        top=_unloaded_top(scene, *rod),
        driver=Driver(K=K * (share if on_rod else 1.0), V=0.0, h=j_h * l, h_top=h_top, side=side),
        interface=Interface(
            mu_s=0.0,
            mu_k=0.0,
            k_f=float(np.max(scene.k_f)) or None,
            alpha=float(np.max(scene.law.alpha)),
        ),
        walls=scene.walls,
    )


def _matrices(scene: Scene, on: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield M^-1/2 K M^-1/2 and M^-1/2 C M^-1/2, in units of k/m and sqrt(k/m).

    The bottom row is closed or open. Its u_x is free, held, free with viscosity alpha, or on
    springs `on` (N/m).
    """
    unit = np.sqrt(scene.slider.k / scene.m)
    M, C = mass(scene), damping(scene).toarray()
    root, bottom = np.sqrt(M), ends(scene.N_x).u_x
    for closed in (True, False):
        K = stiffness(scene, closed=np.full(scene.N_x, closed)).toarray()
        for first in (0, scene.N_x):  # bottom u_x, the first N_x coordinates: free or held
            scale = np.outer(root[first:], root[first:])
            stiff = K[first:, first:] / (scale * unit**2)
            damped = C[first:, first:] / (scale * unit)
            yield stiff, damped
            if first == 0 and on:
                springs = np.zeros(len(M))
                springs[bottom] = on / M[bottom] / unit**2
                yield stiff + np.diag(springs), damped
            if first == 0 and np.any(scene.law.alpha):
                drag = np.zeros(len(M))
                drag[bottom] = scene.law.alpha / M[bottom] / unit
                yield stiff, damped + np.diag(drag)


def _on_springs(scene: Scene) -> float:
    """Return the stiffness of junctions under a block with twice the mean load, in N/m.

    The stiffness is 0 without junctions. Torque and friction make p vary along the interface, but p
    stays below twice the mean until a side lifts off.
    """
    loads = [scene.F_N, *(F_N for _, F_N in scene.top.protocol)]
    p = max(2 * max(loads) / scene.N_x, float(scene.p_prescribed.max()))
    return float(np.max(scene.law.stiffness(p)))


@functools.lru_cache(maxsize=256)
def _small_limit(scene: Scene, stepper: Stepper, enough: float, on: float) -> float:
    """Return the largest stable step of a small lattice, in s.

    A step above `enough` (s) need not be exact. Bottom blocks may be on springs `on` (N/m).
    """
    unit = np.sqrt(scene.slider.k / scene.m)
    if stepper.growth is not None:
        return min(least_limit(stepper, found)[0] for found in _eigenvalues(scene, on)) / unit
    best = np.inf
    for K, C in _matrices(scene, on):
        best = min(best, _map_limit(stepper, K, C, min(best, enough * unit)))
    return best / unit


@functools.lru_cache(maxsize=256)
def _eigenvalues(scene: Scene, on: float) -> tuple[np.ndarray, ...]:
    """Return the eigenvalues of motion with each of the `_matrices`, in units of sqrt(k/m)."""
    found = []
    for K, C in _matrices(scene, on):
        zero, unit = np.zeros(K.shape), np.eye(len(K))
        found.append(np.linalg.eigvals(np.block([[zero, unit], [-K, -C]])))
    return tuple(found)


def _map_limit(stepper: Stepper, K: np.ndarray, C: np.ndarray, enough: float) -> float:
    """Return the largest stable step for u'' = -K u - C u', inf if above `enough`."""
    n = len(K)
    unit, zero = np.eye(n), np.zeros((n, n))

    def stable(h: float) -> bool:
        u, p = stepper.step(
            lambda u, p: -(h * h) * (K @ u) - h * (C @ p),
            np.hstack([unit, zero]),
            np.hstack([zero, unit]),
        )
        return bool(np.abs(np.linalg.eigvals(np.vstack([u, p]))).max() <= 1 + ROUNDED)

    low, high = 0.0, enough if math.isfinite(enough) else 4 / math.sqrt(np.linalg.norm(K, 2))
    if stable(high):
        return np.inf
    for _ in range(BITS // 2):
        h = (low + high) / 2
        low, high = (h, high) if stable(h) else (low, h)
    return low


def stability_limit(scene: SceneLike, stepper: str = "rk4") -> tuple[float, Mapping[str, Any]]:
    """Return the largest stable time step of the linear, damped lattice.

    For Runge-Kutta methods, all eigenvalues lambda of [[0, I], [-M^-1 K, -M^-1 C]] must have
    |R(lambda dt)| <= 1; a growth of 1e-12 counts as stable (`GROWN`). "adaptive" makes steps of
    RK4. For this stepper the value is the largest sub-step that the error control can allow.
    "symplectic_euler" and "verlet" treat u and v differently; the matrix of their whole step must
    have no eigenvalue outside the unit circle. For a plane wave of frequency omega and damping rate
    gamma this means (omega dt)^2 + 2 gamma dt <= 4 for "symplectic_euler". For "verlet" the
    condition is a polynomial inequality, which is omega dt <= 2 without damping and gamma dt <= 2
    without stiffness.

    The motion that sets the limit is local. The result is therefore the smaller of two limits: the
    limit of plane waves in the infinite lattice, and the limit of all modes of a small lattice with
    the boundaries of the scene. The small lattice has at most 8 x 5 blocks, with foundation, driver
    and rod. Its bottom row is closed or open, held, free or on junctions. A scene of at most this
    size is computed exactly, without plane waves.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        stepper: its name.

    Returns:
        dt_max in s, and a mapping: `shape` ((N_z, N_x) of the small lattice), `exact` (whether the
        small lattice is the scene).

    Raises:
        SceneError: unknown stepper, or not a scene.
    """
    if not isinstance(stepper, str) or stepper not in STEPPERS:
        raise SceneError("stepper", stepper, "", " or ".join(map(repr, STEPPERS)))
    scene = as_scene(scene)
    small, on = _reduced(scene), _on_springs(scene)
    exact = (small.N_x, small.N_z) == (scene.N_x, scene.N_z)
    bulk = math.inf if exact else _bulk_limit(small, stepper, on)
    of_modes = _small_limit(small, STEPPERS[stepper], bulk, on)
    info = MappingProxyType({"shape": (small.N_z, small.N_x), "exact": exact})
    return min(bulk, of_modes), info
