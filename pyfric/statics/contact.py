"""Contact states of the interface, and the one loop that finds them.

A block of the bottom row is in exactly one state (sigma is the direction in which it slips):

    stuck   u_x held,                 |f| <= mu_s p,  p >= 0
    slip    f = -sigma mu_k p,        sigma du_x >= 0, p >= 0
    open    p = f = 0,                u_z >= 0

`Interface.exchange` solves for the states that blocks have, lets the one that violates its
conditions most go to another state, and solves again until all are met. In this order: blocks on
the wrong side of the foundation open or land; those that moved along their friction force stick
again; the one with the largest |f| - mu_s p is released. With p coupled to slip there can be
several solutions, among which this order chooses.

A subclass adds how to solve: `complementarity.Contact` on the condensed interface, where a change
is a pivot of a table, `equilibrium.Lattice` by Newton's method on all blocks.

Forces are compared relative to F_N/N_x, displacements relative to others, never absolutely: in
linear geometry, doubling F_N and all displacements doubles every result bit for bit.

Source: PRL 107, 074301 (2011), friction law; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
Complementarity Problem (1992), for the exchange.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN, STUCK
from pyfric.statics.rest import EquilibriumError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.scene import Law, Scene

__all__ = ["CONTACT_TOL", "ROUNDING", "Interface", "Unmet", "Values", "with_free"]

CONTACT_TOL = 1e-11
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""
ROUNDING = 2.0**-48
"""Errors of forces, over stiffness times displacement: 16 roundings."""
CHANGES = 10
"""Most exchanges for one state of rest, over N_x: a cap, where 1.5 are needed. In their second half
the first block that violates a condition changes, not the worst one, which ends cycles."""


class Values(NamedTuple):
    """The interface at rest, in m and N; arrays have shape (N_x,)."""

    u_x: np.ndarray
    f: np.ndarray
    u_z: np.ndarray
    p: np.ndarray
    F_T: float


class Unmet(NamedTuple):
    """Conditions that are not met; arrays have shape (N_x,).

    By how much each block violates its own, up to what that is rounding, the state that it then
    goes to, and where it is held if that is STUCK, in m.
    """

    by: np.ndarray
    least: float
    mode: np.ndarray
    u_x: np.ndarray


class Interface:
    """Contact states of all blocks.

    Attributes:
        mode: contact states as in the core: STUCK, +1 or -1 (slip), OPEN, shape (N_x,), int8.
        closed: blocks that touch the foundation, shape (N_x,), bool.
        stuck: blocks that are closed and held, shape (N_x,), bool.
        slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,), int8.
        law: the friction law; slipping blocks have left weakening behind.
        driven: whether the driver's spring holds the slider. Without it F_T = 0.
    """

    def __init__(self, scene: Scene, mode: np.ndarray, law: Law, *, driven: bool = True) -> None:
        self.scene, self.law, self.driven = scene, law, driven
        self.N_x, self.k, self.k_f = scene.N_x, scene.slider.k, scene.k_f
        self._gap_k = -np.minimum(self.k, self.k_f)
        self.unit = scene.F_N / scene.N_x
        self.mode, self._lifts = np.zeros(self.N_x, dtype=np.int8), np.zeros(self.N_x, dtype=int)
        self.enter(slice(None), mode)

    def enter(self, which: np.ndarray | slice | int, mode: np.ndarray | int) -> None:
        """Note that blocks have gone into other states."""
        self.mode[which] = mode
        self.closed, self.stuck = self.mode != OPEN, self.mode == STUCK
        self.slip = self.mode * self.closed

    @property
    def tol(self) -> float:
        """Violations of conditions below it are rounding, in N."""
        raise NotImplementedError

    def values(self) -> Values:
        """Return the interface at rest in these contact states."""
        raise NotImplementedError

    def put(self, which: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> None:
        """Put blocks into states, each of shape (n,); those that stick are held at u_x (m)."""
        raise NotImplementedError

    def change(self, i: int, mode: int, u_x: float | None = None) -> None:
        """Put one block into another state, where it is or at u_x (m)."""
        at = self.values().u_x[i] if u_x is None else u_x
        self.put(np.array([i]), np.array([mode]), np.array([at]))

    def exchange(self, unmet: Callable[[Values], Unmet | None]) -> Iterator[Values]:
        """Change contact states until all conditions are met; yield the values before each change.

        Blocks whose violations differ by rounding change together: symmetric scenes stay so.

        Args:
            unmet: returns what is not met, None where all is.

        Raises:
            EquilibriumError: the states do not settle, or no block carries the slider.
        """
        most = CHANGES * self.N_x
        for n in range(most):
            now = self.values()
            found = unmet(now)
            if found is None:
                return
            worst = found.by >= max(found.by.max() - found.least, found.least)
            which = np.flatnonzero(worst if n < most // 2 else found.by > found.least)
            which = which if n < most // 2 else which[:1]
            self._lifts[which] += found.mode[which] == OPEN
            self.put(which, found.mode[which], found.u_x[which])
            yield now
        raise EquilibriumError("contact states do not settle", np.nan, self.tol, most)

    # --- problems --------------------------------------------------------------------------------

    def hold_at(self, u_x: np.ndarray, free: np.ndarray) -> Values:
        """Find the state in which blocks are held at u_x (m) wherever they touch.

        Free blocks have no friction; a block that lifts off a second time is one from then on.
        """
        self._lifts = np.where(free, 2, 0)

        def unmet(now: Values) -> Unmet | None:
            return self._misplaced(now, np.where(self._lifts > 1, 1, STUCK), u_x)

        for _ in self.exchange(unmet):
            pass
        return self.values()

    def load(self, home: np.ndarray) -> Values:
        """Find the state that proportional loading leads to: all that counts is where it ends.

        A block that slips at all does so from the first newton on, in one direction from home (m),
        which is where it sticks.
        """

        def unmet(now: Values) -> Unmet | None:
            found = self._misplaced(now, self.slip & 0, home) or self._turned(now, home)
            return found or self._overloaded(now, home)

        for _ in self.exchange(unmet):
            pass
        return self.values()

    def follow(self, home: np.ndarray) -> Iterator[Values]:
        """Change contact states as an event does; yield the values before each change.

        Each state follows the one before: blocks land where they are, and stick where the last
        release found them, at home (m) to begin with.
        """

        def unmet(now: Values) -> Unmet | None:
            nonlocal home
            found = self._misplaced(now, self.slip & 0, now.u_x) or self._turned(now, home)
            if found is None:
                home, found = now.u_x, self._overloaded(now, now.u_x)
            return found

        return self.exchange(unmet)

    # --- conditions ------------------------------------------------------------------------------

    def _unmet(self, by: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> Unmet | None:
        return Unmet(by, self.tol, mode, u_x) if by.max() > self.tol else None

    def _misplaced(self, now: Values, landed: np.ndarray, u_x: np.ndarray) -> Unmet | None:
        """Closed blocks above the foundation, open ones in it: they open, or land at u_x (m)."""
        depth = np.where(self.closed, self.k_f, self._gap_k) * now.u_z
        if not depth.max() > self.tol:
            return None
        return Unmet(depth, self.tol, np.where(self.closed, OPEN, landed), u_x)

    def _turned(self, now: Values, home: np.ndarray) -> Unmet | None:
        """Blocks that have moved from home (m) along their friction force: they stick there."""
        return self._unmet(-self.slip * (now.u_x - home) * self.k, np.zeros_like(self.mode), home)

    def _overloaded(self, now: Values, home: np.ndarray) -> Unmet | None:
        """Blocks that carry more than their strength: they slip.

        Where nothing else holds the slider, it moves until a block is back at home (m).
        """
        stuck, mode = self.stuck, -np.sign(now.f).astype(np.int8)
        by = np.where(stuck, -self.law.margin(now.p, now.f), 0.0)
        worst = float(by.max())
        if not self.driven and worst > self.tol and (by[stuck] >= worst - self.tol).all():
            back = np.where(stuck, mode, self.slip) == -mode[np.argmax(by)]
            if not back.any():
                raise EquilibriumError("the slider slides away", np.nan, self.tol, 0)
            i = np.argmin(np.where(back, np.abs(now.u_x - home), np.inf))
            by[i], mode[i] = worst, STUCK
        return self._unmet(by, mode, home)


def with_free(scene: Scene, closed: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return contact states to begin with, shape (N_x,), where free blocks have no friction.

    They are open if enough others touch for the slider to stand on; a block of a chain stands on
    its own.
    """
    stands = scene.N_z > 1 and np.sum(closed & ~free) >= 2
    return np.where(~closed | (free & stands), OPEN, np.where(free, 1, STUCK)).astype(np.int8)
