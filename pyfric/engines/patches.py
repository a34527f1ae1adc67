"""What a motion can do to one block at most: bounds from the patch of the lattice around it.

A margin is r.w + s.w' (`ringdown`). Let w move freely, M w'' + C w' + K w = 0, with energy E, and
let E_1 be the energy of w', with w'' in the place of velocities. Neither grows. Any shape g gives

    r.w + s.w' = -g.M w'' + h.w' + e.w ,   h = s - C g ,   e = r - K g ,

    |r.w + s.w'| <= sqrt(2 E_1 (g.M g + h.K^-1 h)) + sqrt(2 E e.K^-1 e) .

Here g answers r in a patch of blocks around the one with the margin and is 0 outside, so that h and
e are 0 beyond one more ring of blocks. There K^-1 is at most that of the patch cut out of the
lattice: bonds only add to w.K w. With g = 0 the bound is that of E alone, which holds all of E to
be at that block. A motion that is slow compared with a single block has not enough E_1 for that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["FEWEST_ROWS", "Patches"]

REACH, SHORT, SHARE = 24, 8, 12
"""Blocks from the one with the margin to the edge of its patch, at most; fewer where every patch
differs; and N_x over what is worth its time on smaller lattices."""
FEWEST_ROWS = 6
"""Rows of blocks below which there is no patch."""


class Patches:
    """Bounds for the margins of single blocks; those of patches that are alike are found once.

    Args:
        scene: the scene, in linear geometry.
        M, C: mass, shape (n_q,), and damping, shape (n_q, n_q).
    """

    def __init__(self, scene: Scene, M: np.ndarray, C: sp.csr_array) -> None:
        self._scene, self._M, self._C = scene, M, C
        self._fields = [np.asarray(field) for field in (scene.k_f, scene.law.hold(1.0))]
        most = SHORT if any(field.ndim for field in self._fields) else REACH
        self._reach = min(most, max(scene.N_x // SHARE, 4))
        self._rows = min(self._reach, scene.N_z - 3)  # the rod has no part in it
        row = np.arange(len(M)) // scene.N_x
        self._shifts = np.column_stack([row % 2 == 0, row % 2 == 1]).astype(float)
        self._known: dict[tuple, np.ndarray] = {}

    def bounds(
        self, i: int, stuck: np.ndarray, K: sp.csr_array, rows: list[sp.csr_array]
    ) -> np.ndarray:
        """Return bounds of the margins of a bottom block, over sqrt(E), sqrt(E_1) and sqrt(E).

        Args:
            i: the block.
            stuck: blocks that are held, shape (N_x,), bool.
            K: stiffness, shape (n_q, n_q), in N/m.
            rows: r (N/m) and s (N s/m) of its margins, both of shape (n, n_q).

        Returns:
            Shape (3, n): the bound by E alone; then those by E_1 and by E, to be added.
        """
        columns = slice(max(i - self._reach, 0), i + self._reach + 1)
        key = self._key(i, columns, stuck)
        if key not in self._known:
            self._known[key] = self._found(columns, stuck, K, rows)
        return self._known[key]

    def _key(self, i: int, columns: slice, stuck: np.ndarray) -> tuple:
        """Return what makes a patch: its edges, its blocks and where the driver is."""
        scene, here = self._scene, stuck[columns]
        fields = [np.broadcast_to(one, len(stuck))[columns].tobytes() for one in self._fields]
        driven = columns.start <= scene.i_h < columns.stop and scene.j_h <= self._rows
        edges = i - columns.start, len(here), columns.stop >= len(stuck), stuck[i]
        return *edges, here.tobytes(), *fields, scene.i_h - i if driven else None

    def _found(
        self, columns: slice, stuck: np.ndarray, K: sp.csr_array, rows: list[sp.csr_array]
    ) -> np.ndarray:
        p, inside = self._patch(columns)
        free = np.ones(len(p), dtype=bool)
        free[: len(stuck[columns])] = ~stuck[columns]
        cut, whole = self._cut(K[p], p), K[p][:, p]
        r, s = (free[:, None] * one[:, p].toarray().T for one in rows)
        g, inner = np.zeros_like(r), np.flatnonzero(inside & free)
        g[inner] = splu(whole[inner][:, inner].tocsc()).solve(r[inner])
        e, h = r - whole @ g, s - self._C[p][:, p] @ g
        solve = splu(cut[free][:, free].tocsc()).solve
        by_r, by_e, by_h = (np.sum(b[free] * solve(b[free]), axis=0) for b in (r, e, h))
        mass = self._M[p][:, None]
        squares = [by_r + np.sum(s**2 / mass, axis=0), np.sum(mass * g**2, axis=0) + by_h, by_e]
        return np.sqrt(2 * np.array(squares))

    def _patch(self, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates of a patch, u_x first, and which are not in its outer ring."""
        N_x, top = self._scene.N_x, self._rows
        first, last = columns.start, min(columns.stop, N_x) - 1
        row, i = np.indices((top + 1, last - first + 1)).reshape(2, -1)
        i += first
        inside = (row < top) & ((i > first) | (i == 0)) & ((i < last) | (i == N_x - 1))
        u_x = 2 * N_x * row + i
        return np.concatenate([u_x, u_x + N_x]), np.tile(inside, 2)

    def _cut(self, K: sp.csr_array, p: np.ndarray) -> sp.csr_array:
        """Return the stiffness of a patch whose bonds to others are gone, from its rows of K."""
        part, n = K[:, p], len(p) // 2
        lost = (K @ self._shifts - part @ self._shifts[p]).reshape(2, n, 2)
        return (part + sp.block_array([[sp.diags_array(a) for a in b.T] for b in lost])).tocsr()
