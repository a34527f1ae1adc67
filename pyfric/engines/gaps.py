"""Gap functions of the slider at fixed contact states, in N: positive while no state changes.

A stuck block has mu_s p + f and mu_s p - f, with the normal force p and the friction force f. A
block in contact without friction has p. An open block has k_f z at its height z = u_z + gap. Blocks
that never touch the foundation have no gap functions.

The part of a motion outside the space of slow shapes has an energy E, which cannot grow. By the
Cauchy-Schwarz inequality, E bounds the change of contact forces by this part at any later time.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from pyfric.statics import ends

if TYPE_CHECKING:
    from pyfric.engines.space import Space


class GapFunctions:
    """Gap functions of stuck and open blocks.

    Args:
        space: the slider at these contact states.

    Attributes:
        open: indices of open blocks that may touch the foundation.
    """

    def __init__(self, space: Space) -> None:
        scene = space.solver.scene
        self.space, self.law, held = space, scene.law.static, space.held
        self.open = up = space.open[scene.touches[space.open]]
        k_f, mu_s = (np.broadcast_to(a, scene.N_x) for a in (scene.k_f, self.law.hold(1.0)))
        self._mu_s, self._k_f = mu_s[held], k_f[held]
        self._lifting = np.where(space.solver.pressed, -k_f, k_f)[up]

    def of(self, q: np.ndarray, f: np.ndarray, v: np.ndarray | float = 0.0) -> np.ndarray:
        """Return gap functions for a gap of 0, or changes of gap functions, (n_c, ...), in N.

        Args:
            q: coordinates, shape (n_q, ...), in m.
            f: friction force on the blocks that stick, shape (n_stuck, ...), in N.
            v: rates of the coordinates, which only slipping blocks need, shape (n_q, ...), in m/s.
        """
        u_z = q[ends(len(self.space.stuck)).u_z]
        strength = (self._mu_s * (-self._k_f * u_z[self.space.held].T)).T
        lifted = (self._lifting * u_z[self.open].T).T
        return np.concatenate([strength + f, strength - f, lifted])

    def at(self, q: np.ndarray, forces: np.ndarray, v: np.ndarray | float = 0.0) -> np.ndarray:
        """Return changes of gap functions (N) by q, (n_q,), and by `forces`, shape (n_stuck,)."""
        return self.of(q, -forces, v)

    def whole(self, q: np.ndarray, forces: np.ndarray, v: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the gap functions (N) at q, (n_q,), with `forces` on stuck blocks, (n_stuck,)."""
        return self.at(q, forces, v) + self.unmoved

    @functools.cached_property
    def unmoved(self) -> np.ndarray:
        """Gap functions at q = 0 without forces, shape (n_c,), in N."""
        space = self.space
        q = np.zeros(space.n_q)
        q[ends(len(space.stuck)).u_z] = space.solver.scene.gap
        return self.of(q, np.zeros(len(space.held)))

    @functools.cached_property
    def steady(self) -> tuple[np.ndarray, np.ndarray]:
        """Gap functions of `Space.drift` (N/m) and of `Space.lag` (N s/m), shape (n_c,) each."""
        space = self.space
        pull = space.solver.push, -(space.C @ space.drift)
        return tuple(
            self.at(x, space.on_held(x, force))
            for x, force in zip((space.drift, space.lag), pull, strict=True)
        )

    @functools.cached_property
    def bound(self) -> np.ndarray:
        """Largest change of each gap function by a truncated part of 1 J, shape (n_c,), in N.

        A force K_i w is at most sqrt(2 E K_ii). Bonds between held blocks do not contribute.
        """
        space = self.space
        held, free = space.held, space.free
        C = space.C[held][:, free]
        stiff = self._mu_s**2 * self._k_f + space.K[held][:, held].sum(axis=1)
        stiff = stiff + C.multiply(C) @ (1 / space.M[free])
        lifted, force = np.zeros(len(self.open)), np.zeros(space.n_q)
        for n, block in enumerate(self.open + len(space.stuck)):
            force[block] = 1.0
            lifted[n] = self._lifting[n] ** 2 * space.answer(force)[block]
            force[block] = 0.0
        return np.sqrt(2 * np.concatenate([stiff, stiff, lifted]))

    def strengthened(self, age: np.ndarray, *rows: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return gap functions, or parts of them, of blocks that have been stuck for `age`.

        Strength grows with contact time, so that a block is never weaker than now. The sum of the
        two gap functions of a block, mu_s p + f and mu_s p - f, gives p.

        Args:
            age: time since each block stuck, shape (N_x,), in s.
            rows: gap functions at age 0, shape (n_c, ...).
        """
        if self.law.tables.hold is None:
            return rows
        stuck, n = self.space.stuck, len(self.space.held)
        law = self.law.at(stuck)
        young = np.broadcast_to(law.hold(1.0), n)
        gain = law.hold(1.0, age[stuck]) - young
        share, found = np.divide(gain, 2 * young, out=np.zeros(n), where=young > 0), []
        for row in rows:
            more = (share * (row[:n] + row[n : 2 * n]).T).T
            found.append(np.concatenate([row[:n] + more, row[n : 2 * n] + more, row[2 * n :]]))
        return tuple(found)
