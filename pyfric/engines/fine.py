"""Modes of fine lattices: found in smooth shapes, the slowest corrected by static solutions.

On a fine lattice what few modes leave out of a ring-down decays slowly, and exact modes are dear.
Smooth shapes (`smooth`) hold many modes, up to an error in the corners of the slider, where stress
is singular. The slowest ones, which last longest, are corrected by static solutions K^-1 M phi and
K^-1 C phi, which have the right stress in the corners and around the driven block. Blocks that open
add their static shapes.

In that space W, M, C and K are small matrices. A motion is projected so that the energy of what is
left out is the least one,

    W'K W y = W'K w,   W'M W y' = W'M w' ,

which for an exact mode within W gives its exact amplitude. The errors of the modes are part of what
is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric.engines.smooth import Smooth

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import scipy.sparse as sp

    from pyfric.scene import Geometry, Scene

__all__ = ["FineModes", "Space", "closed_space", "is_fine", "modes"]

FINE = 3000
"""On lattices of more unknowns than these, smooth shapes cost no more than exact modes: the same on
scenes of the paper with 3500 to 4200."""
BLOCKS, FEWEST, MOST = 250, 48, 240
"""One smooth mode for this many blocks, but not fewer or more than these: on ever finer lattices
of one slider a ring-down then takes the same number of steps."""
CORRECTED = 12
"""Modes that are corrected."""
LEAST = 0.75
"""Decay of what the modes leave out, over that of the least viscous mode of its frequency."""
CHUNK = 8
"""Shapes that are multiplied by a matrix together, which saves memory."""
TWICE = 5
"""Modes that are corrected twice: they last until the next event, and take on a share of what is
left out when a jump begins that is as large as their error."""
FAST_ERROR, SLOW_ERROR = 0.12, 1.5e-3
"""Root of the share of energy that a mode lacks: these times r^5 and the root of r, where r is its
frequency over the largest. Measured on the Fig. 1 scene at l = 0.625 and 0.25 mm, with none and
three blocks open: 0.05 to 0.9 of that."""
APART = 1e-12
"""Shapes are left out where this share of their energy, or less, is not in the others. Their mass
would leave out those of corners, which slow modes need."""
OVERDAMPED = 6
"""Overdamped shear waves, which creep back, have a rate of k/eta over this."""


def is_fine(scene: Scene, geometry: Geometry) -> bool:
    """Whether modes are found here: in linear geometry, where shapes have two dimensions."""
    return geometry == "linear" and scene.N_z > 1 and 2 * scene.N_x * scene.N_z > FINE


def modes(scene: Scene) -> int:
    """Return how many modes of a fine lattice are followed."""
    return min(max(scene.N_x * scene.N_z // BLOCKS, FEWEST), MOST)


class Space:
    """Shapes of a slider, and its matrices between them.

    Args:
        base: smooth shapes, or another space.
        parts: more shapes, coordinates q of each, shapes (n_q, n); they are not copied.
        M, C, K: mass, shape (n_q,), damping and stiffness, both of shape (n_q, n_q).
        lower: stiffness that was in the matrices of `base` and is not in K: coordinates, and N/m.
    """

    def __init__(
        self,
        base: Smooth | Space,
        parts: Sequence[np.ndarray],
        M: np.ndarray,
        C: sp.csr_array,
        K: sp.csr_array,
        lower: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        self.base, self._parts, self._n = base, parts, len(base.M)
        less = 0.0
        if lower is not None:
            at = base.at(lower[0])
            less = at.T @ (lower[1][:, None] * at)
        pairs = (M, base.M), (C, base.C), (K, base.K - less)
        self.M, self.C, self.K = (self._between(*pair) for pair in pairs)
        self.smooth: Smooth = getattr(base, "smooth", base)

    def _between(self, whole: np.ndarray | sp.csr_array, known: np.ndarray) -> np.ndarray:
        """Return a matrix between all shapes, known between those of the base."""
        n = k = self._n
        A = np.zeros((n + sum(part.shape[1] for part in self._parts),) * 2)
        A[:n, :n] = known
        for part in self._parts:
            for some in np.array_split(part, -(-part.shape[1] // CHUNK), axis=1):
                image = whole[:, None] * some if isinstance(whole, np.ndarray) else whole @ some
                A[:, k : k + some.shape[1]] = self.gather(image.T).T
                k += some.shape[1]
        A[n:, :n] = A[:n, n:].T
        return (A + A.T) / 2

    def gather(self, q: np.ndarray) -> np.ndarray:
        """Return the products of all shapes with vectors over coordinates, shape (..., n_q)."""
        return np.concatenate([self.base.gather(q), *(q @ part for part in self._parts)], axis=-1)

    def spread(self, y: np.ndarray) -> np.ndarray:
        """Return the coordinates of amplitudes of the shapes, shape (shapes, ...)."""
        q, n = self.base.spread(y[: self._n]), self._n
        for part in self._parts:
            q += part @ y[n : n + part.shape[1]]
            n += part.shape[1]
        return q

    def slow(self) -> np.ndarray:
        """Return the corrected modes and their corrections, and all other shapes, (n_q, n)."""
        if isinstance(self.base, Space):
            return np.hstack([self.base.slow(), *self._parts])
        one = np.eye(CORRECTED, len(self.base.M))
        modes = [self.base.spread(y) for y in one]
        return np.column_stack([*modes, *self._parts])

    def at(self, index: np.ndarray) -> np.ndarray:
        """Return some coordinates of all shapes."""
        return np.hstack([self.base.at(index), *(part[index] for part in self._parts)])


def closed_space(
    scene: Scene,
    solve: Callable[[np.ndarray], np.ndarray],
    M: np.ndarray,
    C: sp.csr_array,
    K: sp.csr_array,
    pulled: np.ndarray,
) -> Space:
    """Return the space of the slider with all blocks stuck.

    Args:
        scene: the scene, in linear geometry.
        solve: forces on coordinates to displacements, both of shape (n_q, n).
        M, C, K: mass, shape (n_q,), damping and stiffness, both of shape (n_q, n_q).
        pulled: answers to the driver, which pulls at one block, shape (n_q, n).
    """
    smooth = Smooth(scene, modes(scene))
    slow = np.eye(min(CORRECTED, len(smooth.omega)), len(smooth.M))
    slow = np.column_stack([smooth.spread(y) for y in slow])

    def answers(q: np.ndarray) -> list[np.ndarray]:
        return [solve(M[:, None] * q), *([solve(C @ q)] if scene.eta > 0 else [])]

    found = answers(slow)
    found[0] = smooth.omega[:CORRECTED] ** 2 * found[0] - slow
    twice = [one for q in found for one in answers(q[:, :TWICE])]
    shapes = np.hstack([pulled, *found, *twice])
    shapes /= np.sqrt(M @ shapes**2)
    return Space(smooth, [shapes], M, C, K)


class FineModes:
    """The modes of a space that are slower than the smooth shapes reach.

    Attributes:
        rates: one of each conjugate pair, shape (n,), in 1/s.
        weight: 2 for pairs, 1 for real ones, shape (n,).
        decay: rate at which what the modes leave out decays, in 1/s.
        fast: the same without the errors of modes, in 1/s.
        errors: root of the energy that each mode lacks, over its amplitude, shape (n,), in sqrt(J).
    """

    def __init__(self, space: Space) -> None:
        self._space, scene, omega = space, space.smooth.scene, space.smooth.omega
        slow, cut = omega[-1], omega[min(CORRECTED, len(omega) - 1)]
        length = 1 / np.sqrt(np.diag(space.K))
        size, axes = np.linalg.eigh(length[:, None] * space.K * length)
        apart = size > APART * size[-1]
        self._axes = axes = length[:, None] * axes[:, apart] / np.sqrt(size[apart])  # K is 1
        M, C = axes.T @ space.M @ axes, axes.T @ space.C @ axes
        n = len(M)
        found, vectors = np.linalg.eig(
            np.block([[-slow * C, -(slow**2) * M], [np.eye(n), np.zeros((n, n))]])
        )
        kept = (np.abs(found) >= 1) & (found.imag <= 0)
        self.rates, self._x = slow / found[kept], vectors[n:, kept]
        self.weight = np.where(self.rates.imag > 0, 2.0, 1.0)
        self._norm = np.sum(self._x * (C @ self._x + 2 * self.rates * (M @ self._x)), axis=0)
        self._C, self._M = C, M
        viscous = np.min(-self.rates.real / np.abs(self.rates) ** 2, initial=np.inf)
        creep = scene.slider.k / (OVERDAMPED * scene.eta) if scene.eta > 0 else np.inf
        self.decay, self.fast = (min(LEAST * viscous * a**2, a, creep) for a in (cut, slow))
        whole = np.sum(np.abs(self._x) ** 2, axis=0)
        r = np.abs(self.rates) / slow
        share = FAST_ERROR * r**5 + SLOW_ERROR * np.sqrt(r)
        self.errors = share * self.weight * np.sqrt(whole / 2)

    def amplitudes(self, force: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return the amplitudes of the modes in a motion, given K w (N) and M w' (N s)."""
        y, p = self._space.gather(np.array([force, momentum])) @ self._axes
        damped, x = self._C @ y + p, self._x.T
        return (x @ damped + self.rates * (x @ (self._M @ y))) / self._norm

    def spread(self, a: np.ndarray) -> np.ndarray:
        """Return the real part of sums of modes, shape (n_q, ...)."""
        return self._space.spread(self._axes @ (self._x @ a).real)

    def on(self, rows: sp.csr_array) -> np.ndarray:
        """Return the products of sparse rows over coordinates with the modes."""
        index = np.unique(rows.indices)
        return (rows[:, index] @ (self._space.at(index) @ self._axes)) @ self._x
