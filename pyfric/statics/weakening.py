"""Friction that depends on slip alone; each slipping block is on one linear piece of the law.

A block that has slipped by s carries mu(s) p, where mu is linear in s between the knots of the law.
While it slips in direction sigma, s = s_0 + sigma u_x.

Source: PRL 107, 074301 (2011), remark on slip weakening.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pyfric.scene import CoulombLaw


class Weakening:
    """Friction of blocks that slip.

    Args:
        law: the law.
        way: direction of blocks that slip, 0 elsewhere, shape (N_x,).
        clock: s_0 = s - sigma u_x, shape (N_x,), in m.
        u_x: positions at which the pieces are selected, shape (N_x,), in m.

    Attributes:
        cell: index of the piece of each block, shape (N_x,).
    """

    def __init__(
        self, law: CoulombLaw, way: np.ndarray, clock: np.ndarray, u_x: np.ndarray
    ) -> None:
        self.law, self.N_x = law, len(way)
        self.way, self.clock = way.astype(float), clock.copy()
        self.d_c = np.broadcast_to(np.asarray(law.d_c, float), self.N_x)
        table = law.tables.slide
        if table is None:  # friction falls at once
            self._x, self._y, self._slopes = np.zeros((3, 1))
        else:
            self._x, self._y = np.array(table.x), np.array(table.y)
            self._slopes = np.append(table.slopes, 0.0)
        self.look(u_x)

    def look(self, u_x: np.ndarray) -> None:
        """Select the linear piece of the law for each block at u_x (m), by the last passed knot."""
        path = self.clock + self.way * u_x
        share = np.divide(path, self.d_c, out=np.full(self.N_x, math.inf), where=self.d_c > 0)
        self.cell = np.clip(np.searchsorted(self._x, share, side="right") - 1, 0, None)

    @property
    def weakens(self) -> np.ndarray:
        """Blocks that have not passed the last knot, shape (N_x,), bool."""
        return self.cell < len(self._x) - 1

    def friction(self, u_x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mu of each block on its linear piece of the law, and dmu/ds (1/m)."""
        law, d_c, c = self.law, self.d_c, self.cell
        slope = np.divide(self._slopes[c], d_c, out=np.zeros(self.N_x), where=d_c > 0)
        left = self._y[c] + slope * (self.clock + self.way * u_x - self._x[c] * d_c)
        left = np.where(self.weakens, left, self._y[-1])
        return law.mu_k + law.drop * left, law.drop * slope

    def knot(self) -> np.ndarray:
        """Return the slip at the next knot, shape (N_x,), in m; inf beyond the last."""
        following = np.append(self._x, math.inf)[self.cell + 1]
        return following * np.where(self.d_c == 0, 1.0, self.d_c)
