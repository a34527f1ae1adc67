"""Smooth shapes of a lattice: products of polynomials, and the slow undamped modes within them.

A fine lattice moves almost like a continuum, so that its slow modes are found in a few smooth
shapes f_i(x) g_j(z), without a factorisation (Ritz's method). A sum over bonds is then a product of
sums over columns and over rows. Shapes are kept as their factors: they take next to no memory, and
sums of them are products of small matrices.

Source: W. Ritz, J. reine angew. Math. 135, 1 (1909); for the number of modes H. Weyl, Math. Ann.
71, 441 (1912).
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh, solve

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["Smooth", "slowest"]

_BONDS = ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5))
"""Bonds from a block to others by (columns, rows), and their stiffness in units of k."""
DENSE, MORE = 0.5, 4
"""Polynomials along a side: this many for each radian of the fastest shear wave, and more."""

VISCOUS = 0.5
"""Share of the modes, the slowest, to which K^-1 C phi is added."""


def slowest(scene: Scene, modes: float) -> float:
    """Return the frequency below which a slider has this many modes, in rad/s.

    Their number is L H omega^2 (1/c_s^2 + 1/c_l^2)/(4 pi), with c_l^2 = 3 c_s^2 (Weyl's law).
    """
    slider = scene.slider
    c_s2 = slider.l**2 * slider.k / (2 * scene.m)
    return math.sqrt(3 * math.pi * modes * c_s2 / (slider.L * slider.H))


class Smooth:
    """The slowest undamped modes of a slider whose blocks all stick, in smooth shapes.

    Args:
        scene: the scene, with free side walls, in linear geometry.
        count: number of modes.

    Attributes:
        omega: frequencies of the modes, ascending, shape (n,), in rad/s.
        M, C, K: mass, damping and stiffness between the shapes that are kept, the modes of unit
            mass first, shape (m, m).
    """

    def __init__(self, scene: Scene, count: int) -> None:
        self.scene, slider, N_z = scene, scene.slider, scene.N_z
        q = slowest(scene, count) / (slider.l * math.sqrt(slider.k / (2 * scene.m)))
        p_x, most = (math.ceil(DENSE * q * side) + MORE for side in (slider.L, slider.H))
        up = np.arange(N_z) / (N_z - 1)
        down = 1 - up if scene.rigid else np.ones(N_z)
        self._f = _polynomials(p_x, np.ones(scene.N_x))
        self._g = [_polynomials(most, edge) for edge in (up * down, down)]
        self._at = [_few(self._f.shape[1], g.shape[1]) for g in self._g]
        if scene.rigid:  # under the rod's X, Z and phi a ramp
            self._at = [
                (np.append(i, rod), np.append(j, [g.shape[1]] * len(rod)))
                for (i, j), g, rod in zip(self._at, self._g, ([0], [0, 1]), strict=True)
            ]
            self._g = [np.column_stack([g, up]) for g in self._g]
        self._n_x = len(self._at[0][0])
        self._size = self._n_x + len(self._at[1][0])
        K, C, M = self._matrices()
        some = {"subset_by_index": (0, min(count, self._size) - 1)}
        squares, modes = eigh(K, M, **some)
        self.omega = np.sqrt(squares)
        # The damping of modes makes shapes that are not among them.
        more = solve(K, C @ modes[:, : int(VISCOUS * len(squares))], assume_a="pos")
        more /= np.sqrt(np.sum(more * (M @ more), axis=0))
        self._Y = np.hstack([modes, more]) if scene.eta > 0 else modes
        self.M, self.C, self.K = (self._Y.T @ A @ self._Y for A in (M, C, K))

    def _part(self, c: int) -> slice:
        """The shapes along x (c = 0) or z (c = 1)."""
        return slice(0, self._n_x) if c == 0 else slice(self._n_x, self._size)

    def _matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stiffness, damping and mass between all shapes."""
        scene, slider, size = self.scene, self.scene.slider, self._size
        K, C, M = (np.zeros((size, size)) for _ in range(3))
        for dx, dz, stiff in _BONDS:
            n = np.array([dx, dz]) / math.hypot(dx, dz)
            for a, b in ((0, 0), (0, 1), (1, 1)):
                both, share = (self._part(a), self._part(b)), n[a] * n[b]
                if share or a == b:
                    S = self._over_bonds(a, b, dx, dz)
                    K[both] += stiff * slider.k * share * S
                    C[both] += scene.eta * (share if slider.dashpots == "along" else a == b) * S
        for A in (K, C):
            A[self._part(1), self._part(0)] = A[self._part(0), self._part(1)].T
        for c in (0, 1):
            gram = self._f.T @ self._f, self._g[c].T @ self._g[c]
            M[self._part(c), self._part(c)] = scene.m * self._products(c, c, *gram)
        bottom = self.row(0)[1]
        K += bottom.T @ (np.broadcast_to(scene.k_f, scene.N_x)[:, None] * bottom)
        driven = self.row(scene.j_h)[0][scene.i_h]
        K += scene.driver.K * np.outer(driven, driven)
        if scene.rigid:
            rod, heavy = self.rod, scene.M_rod * np.array([1.0, 1.0, slider.L**2 / 12])
            M += rod.T @ (heavy[:, None] * rod)
            K += scene.kappa * np.outer(rod[2], rod[2])
        return K, C, M

    def _over_bonds(self, a: int, b: int, dx: int, dz: int) -> np.ndarray:
        """Return sums over bonds of a family of products of differences along a and b."""
        total, f = 0.0, (self._f[: len(self._f) - dx], self._f[dx:])
        ends = slice(max(-dz, 0), self.scene.N_z - max(dz, 0))
        beyond = slice(max(dz, 0), self.scene.N_z - max(-dz, 0))
        for one in (0, 1):
            for two in (0, 1):
                g_a, g_b = self._g[a][(ends, beyond)[one]], self._g[b][(ends, beyond)[two]]
                sign = 1.0 if one == two else -1.0
                total += sign * self._products(a, b, f[one].T @ f[two], g_a.T @ g_b)
        return total

    def _products(self, a: int, b: int, along: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Return products of sums over columns and over rows, for the shapes along a and b."""
        (i, j), (k, n) = self._at[a], self._at[b]
        return along[np.ix_(i, k)] * up[np.ix_(j, n)]

    def row(self, j: int) -> tuple[np.ndarray, np.ndarray]:
        """Return u_x and u_z of all shapes in row j of blocks, each of shape (N_x, shapes)."""
        found = []
        for c in (0, 1):
            part = np.zeros((self.scene.N_x, self._size))
            i, n = self._at[c]
            part[:, self._part(c)] = self._f[:, i] * self._g[c][j, n]
            found.append(part)
        return tuple(found)

    @functools.cached_property
    def rod(self) -> np.ndarray:
        """X (m), Z (m) and phi (rad) of all shapes, shape (3, shapes)."""
        (X, Z), x = self.row(self.scene.N_z - 1), self.scene.x
        phi = (Z[-1] - Z[0]) / (x[-1] - x[0])
        return np.array([X[0], Z[0] - x[0] * phi, phi])

    def spread(self, y: np.ndarray) -> np.ndarray:
        """Return the coordinates q, shape (n_q, ...), of amplitudes y of the modes, (n, ...)."""
        if y.ndim > 1:
            return np.column_stack([self.spread(one) for one in y.T])
        scene, shares = self.scene, self._Y @ y
        u = np.empty((scene.N_z, 2, scene.N_x))
        for c in (0, 1):
            table = np.zeros((self._g[c].shape[1], self._f.shape[1]))
            table[self._at[c][::-1]] = shares[self._part(c)]
            u[:, c] = self._g[c] @ (table @ self._f.T)
        if not scene.rigid:
            return u.ravel()
        return np.concatenate([u[:-1].ravel(), self.rod @ shares])

    def gather(self, q: np.ndarray) -> np.ndarray:
        """Return the products of the modes with vectors over coordinates: `spread`'s transpose."""
        if q.ndim > 1:
            return np.array([self.gather(one) for one in q])
        scene, found = self.scene, np.empty(self._size)
        rows = scene.N_z - 1 if scene.rigid else scene.N_z
        u = q[: 2 * scene.N_x * rows].reshape(rows, 2, scene.N_x)
        for c in (0, 1):
            table = self._g[c][:rows].T @ (u[:, c] @ self._f)
            found[self._part(c)] = table[self._at[c][::-1]]
        if scene.rigid:
            found += q[-3:] @ self.rod
        return found @ self._Y

    def at(self, index: np.ndarray) -> np.ndarray:
        """Return coordinates `index` of all modes, shape (len(index), n)."""
        scene = self.scene
        rows = scene.N_z - 1 if scene.rigid else scene.N_z
        found = np.zeros((len(index), self._size))
        row, i = np.divmod(index, scene.N_x)
        for c in (0, 1):
            here = (row < 2 * rows) & (row % 2 == c)
            k, n = self._at[c]
            found[here, self._part(c)] = self._f[i[here]][:, k] * self._g[c][row[here] // 2][:, n]
        on_rod = index >= 2 * scene.N_x * rows
        if on_rod.any():
            found[on_rod] = self.rod[index[on_rod] - 2 * scene.N_x * rows]
        return found @ self._Y


def _polynomials(count: int, edge: np.ndarray) -> np.ndarray:
    """Return polynomials times a factor, orthonormal, shape (n, count); fewer on few points."""
    count = min(count, np.count_nonzero(edge))
    table = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(edge)), max(count - 1, 0))
    return np.linalg.qr(table[:, :count] * edge[:, None])[0] * (edge != 0)[:, None]


def _few(p_x: int, p_z: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the degrees along x and z that are not both high."""
    i, j = np.indices((p_x, p_z)).reshape(2, -1)
    low = (i / p_x) ** 2 + (j / max(p_z, 1)) ** 2 <= 1
    return i[low], j[low]
