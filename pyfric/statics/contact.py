"""Contact states of the interface, and their conditions.

A block of the bottom row is in exactly one state (sigma is its direction of slip, z = u_z + gap its
height over the foundation, p = -k_f z while it touches it):

    stuck   u_x held,                 |f| <= mu_s p,  p >= 0
    slip    f = -sigma mu_k p,        sigma du_x >= 0, p >= 0
    bare    f = 0,                    p >= 0
    open    p = f = 0,                z >= 0

Blocks without friction are bare or open, and blocks without contact are always open.

Conditions are checked in this order. First, blocks on the wrong side of the foundation open or
land. Second, blocks that moved along their friction force stick again. Third, the block with the
largest |f| - mu_s p is released. Because p is coupled to slip, there can be several solutions, and
this order selects one solution.

There are no absolute tolerances: forces are compared with F_N/N_x, displacements with other
displacements. In linear geometry, doubling F_N and all displacements therefore doubles every result
bit for bit.

Source: PRL 107, 074301 (2011), friction law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import eigh

from pyfric.core import OPEN, STUCK
from pyfric.statics.rest import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import CoulombLaw, Scene


class Values(NamedTuple):
    """Values of the interface in a static state, in m and N; arrays have shape (N_x,)."""

    u_x: np.ndarray
    f: np.ndarray
    u_z: np.ndarray
    p: np.ndarray
    F_T: float


class Unmet(NamedTuple):
    """Conditions that are not met; arrays have shape (N_x,).

    Attributes:
        by: violation of the condition of each block, in N.
        least: largest violation that counts as rounding, in N.
        mode: the new state of each block that violates its condition.
        u_x: position at which the block is held if its new state is STUCK, in m.
    """

    by: np.ndarray
    least: float
    mode: np.ndarray
    u_x: np.ndarray


class States:
    """Contact states of all blocks.

    Args:
        scene: the scene.
        mode: contact states as in the core: STUCK, +1 or -1 (slip), OPEN, or BARE, shape (N_x,).
        law: the friction law; slipping blocks have their final friction, mu_k.
        driven: whether the driver's spring is attached. Without this spring F_T = 0.

    Attributes:
        gap: height of the blocks over the foundation at u_z = 0, a number or (N_x,), in m.
        closed: blocks that touch the foundation, shape (N_x,), bool.
        stuck: blocks that are closed and held, shape (N_x,), bool.
        slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,), int8.
        tol: largest violation of conditions that counts as rounding, in N.
    """

    def __init__(
        self, scene: Scene, mode: np.ndarray, law: CoulombLaw, *, driven: bool = True
    ) -> None:
        self.scene, self.law, self.driven, self.tol = scene, law, driven, 0.0
        self.N_x, self.k, self.k_f = scene.N_x, scene.slider.k, scene.k_f
        self.gap, self._gap_k = scene.gap, -np.minimum(self.k, self.k_f)
        self._all_rub = bool((scene.touches & ~scene.bare).all())
        self.mode = np.zeros(self.N_x, dtype=np.int8)
        self.enter(slice(None), mode)

    def enter(self, which: np.ndarray | slice | int, mode: np.ndarray | int) -> None:
        """Put blocks into states; blocks without friction or contact stay bare or open."""
        self.mode[which] = self.possible(which, mode)
        self.closed, self.stuck = self.mode != OPEN, self.mode == STUCK
        self.slip = self.mode * (np.abs(self.mode) == 1)

    def possible(self, which: np.ndarray | slice | int, mode: np.ndarray | int) -> np.ndarray | int:
        """Return `mode`, with bare or open for blocks that lack friction or contact."""
        if self._all_rub:
            return mode
        mode = np.where(self.scene.bare[which] & (np.asarray(mode) != OPEN), BARE, mode)
        return np.where(self.scene.touches[which], mode, OPEN)

    @property
    def logged(self) -> np.ndarray:
        """The contact states as in the core, shape (N_x,), int32."""
        mode = self.mode if self._all_rub else np.where(self.mode == BARE, OPEN, self.mode)
        return mode.astype(np.int32)

    def misplaced(self, now: Values, landed: np.ndarray | int, u_x: np.ndarray) -> Unmet | None:
        """Return closed blocks with z > 0, which open, and open blocks with z < 0, which land.

        Blocks that land get the state `landed`; blocks that stick are held at `u_x` (m).
        """
        depth = np.where(self.closed, self.k_f, self._gap_k) * (now.u_z + self.gap)
        if not depth.max() > self.tol:
            return None
        return Unmet(depth, self.tol, np.where(self.closed, OPEN, landed), u_x)

    def turned(self, now: Values, home: np.ndarray) -> Unmet | None:
        """Return blocks that moved from `home` (m) along their friction force; they stick there."""
        by = -self.slip * (now.u_x - home) * self.k
        return Unmet(by, self.tol, np.zeros_like(self.mode), home) if by.max() > self.tol else None

    def overloaded(self, now: Values, home: np.ndarray) -> Unmet | None:
        """Return blocks whose friction force exceeds their strength; they slip.

        Without a driver, the last stuck blocks cannot all be released, because nothing else holds
        the slider. If all stuck blocks would be released at once, a slipping block sticks again, at
        `home` (m).
        """
        stuck, mode = self.stuck, -np.sign(now.f).astype(np.int8)
        by = np.where(stuck, -self.law.remaining(now.p, now.f), 0.0)
        worst = float(by.max())
        if not worst > self.tol:
            return None
        if not self.driven and (by[stuck] >= worst - self.tol).all():
            back = np.where(stuck, mode, self.slip) == -mode[np.argmax(by)]
            if not back.any():
                raise EquilibriumError("the slider slides away", np.nan, self.tol, 0)
            i = np.argmin(np.where(back, np.abs(now.u_x - home), np.inf))
            by[i], mode[i] = worst, STUCK
        return Unmet(by, self.tol, mode, home)

    def unmet_in_loading(
        self, now: Values, home: np.ndarray, landed: np.ndarray | int = STUCK
    ) -> Unmet | None:
        """Return the conditions that the final state of proportional loading violates.

        A block that slips during proportional loading does so from the smallest load on, in one
        direction. A block that sticks is at `home` (m). Blocks that land get the state `landed`.
        """
        found = self.misplaced(now, landed, home) or self.turned(now, home)
        return found or self.overloaded(now, home)


def with_free(scene: Scene, closed: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return initial contact states, shape (N_x,), in which free blocks have no friction.

    Free blocks are open if at least two other blocks support the slider. In a chain free blocks
    stay closed, because each block carries its own p.
    """
    free = free & ~scene.bare
    stands = scene.N_z > 1 and np.sum(closed & ~free) >= 2
    return np.where(~closed | (free & stands), OPEN, np.where(free, 1, STUCK)).astype(np.int8)


def rounding(scene: Scene, force: float) -> float:
    """Return the violation of contact or friction conditions that rounding may cause, in N.

    Args:
        scene: the scene.
        force: largest stiffness times displacement of the coordinates, in N.
    """
    return CONTACT_TOL * scene.F_N / scene.N_x + 16 * 2.0**-52 * force


CONTACT_TOL = 1e-11
"""Violation of conditions, over F_N/N_x, that counts as rounding at any displacement."""
BARE = 3
"""Contact state, absent in the core, of a block that touches the foundation without friction."""
LEAST_DEFINITENESS = 0.01
"""Definiteness below which a state may not be unique."""


def definiteness(W: np.ndarray, F: np.ndarray) -> float:
    """Return the definiteness of a slip operator, which decides on uniqueness; 1 if n = 0.

    The slip operator W gives the forces that resist slip per displacement of the slipping blocks.
    The slider on its foundation contributes a symmetric, positive definite matrix F. Friction adds
    a term, because p changes when blocks move: W = F + sigma mu_k dp/du_x, which is not symmetric.
    If the symmetric part of W is positive definite, forces and driver determine the slip uniquely.
    The definiteness is the smallest delta with

        (W + W')/2 x = delta F x .

    The definiteness is 1 without friction and falls linearly as mu_k grows. A definiteness of 0
    means that friction supplies the whole work of some slip. Below `LEAST_DEFINITENESS`, a solution
    may not be unique. The definiteness is accurate to about 1e-12, so that rounding does not
    decide.

    Args:
        W: slip operator, shape (n, n), in N/m.
        F: slip operator without friction, (n, n), in N/m.

    Source: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic
    contact problems with friction, Ingenieur-Archiv 60, 529 (1990), for the phenomenon.
    """
    if not len(W):
        return 1.0
    if not np.isfinite(W).all():
        return -np.inf
    values = eigh(W + W.T, F + F.T, eigvals_only=True, subset_by_index=[0, 0])
    return float(values[0])
