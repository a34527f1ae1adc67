"""The contact solver: contact states on the condensed interface, by pivots of a table.

`ContactProblem` holds the condensed slider of one scene. A `Contact` gives u_x, f, u_z and F_T as
affine functions of the held u_x and of the driver, in a table. When a block is released or held, a
column and a row of the table are exchanged. The exchange is a rank-one change that takes
microseconds.

`Contact.exchange` changes the state of the block that violates a condition most, until all
conditions are met. Loading, events, growing slip and static states differ only in the conditions.

Source: tables with exchanged columns are the pivots of linear complementarity (R. W. Cottle, J.-S.
Pang, R. E. Stone, The Linear Complementarity Problem, 1992).
"""

from __future__ import annotations

import copy
import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from pyfric.core import OPEN, STUCK
from pyfric.scene import FRICTIONLESS, of
from pyfric.statics.condensation import condense
from pyfric.statics.contact import (
    States,
    Unmet,
    Values,
    definiteness,
    rounding,
    with_free,
)
from pyfric.statics.memory import Memory
from pyfric.statics.rest import EquilibriumError, check_rests
from pyfric.statics.rows import ends, table_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.scene import CoulombLaw, OnDriven, Scene

RATE_TOL = 1e-11
"""Largest rate of a force that counts as rounding, over stiffness times rate of displacement."""
LEAST = 1e-6
"""Normal force, over F_N/N_x, below which a block does not stick."""
LOST = 1e-3
"""Rounding error of the conditions, over F_N/N_x, beyond which the slider counts as unsupported."""
UNHELD = "the slider is not held by the blocks that stick"
BASES = 64
"""Number of stored tables with all blocks held. Each set of open blocks has its own table."""
CHANGES = 10
"""Largest number of exchanges for one static state, over N_x; about 1.5 are needed. In the second
half of the exchanges, the first block that violates a condition changes, instead of the block with
the largest violation. This rule ends cycles.
"""


class Route(NamedTuple):
    """A straight path of driver and loads with the parameter s, in m.

    The driver is at drive + way s (m). Loads (F_N and T, in N) are load + gain s.
    """

    drive: float
    way: float
    load: tuple[float, float]
    gain: tuple[float, float] = (0.0, 0.0)


class Static(NamedTuple):
    """A static state of the interface; arrays of shape (N_x,), in N."""

    F_T: float
    tau: np.ndarray
    p: np.ndarray


class ContactProblem:
    """The condensed slider of one scene and its contact with the substrate (linear geometry).

    Args:
        scene: the scene.
        u_drv0: u_x of the driven blocks at F_T = 0, in m, as `Scene.u_driven` returns it. Only
            differences of u_drv0 between the blocks of a plate matter. None means u_x in the loaded
            state.

    Raises:
        SceneError: the scene has no static states.
        EquilibriumError: a part of the slider is not supported.
    """

    def __init__(self, scene: Scene, u_drv0: OnDriven | None = None) -> None:
        check_rests(scene)
        self.scene, self.unit = scene, scene.F_N / scene.N_x
        self._undriven = self.slider = condense(scene)
        begin = scene.F_N, scene.top.T
        self._look(Route(0.0, 1.0, begin))
        if u_drv0 is None and scene.n_driven > 1:
            now, moved = self._applied.values(), self.slider
            v, w = np.concatenate([now.u_x, now.u_z]), np.array([0.0, 1.0, *begin])
            u_drv0 = moved.P.T @ v + moved.D @ w
        self.slider = self._undriven.driven(scene, 0.0 if u_drv0 is None else u_drv0)
        self._look(self._route)

    def _look(self, route: Route) -> None:
        """Set driver position and loads as functions of the parameter s of a route."""
        self._route, (F_N, T), (F_N_gain, T_gain) = route, route.load, route.gain
        w = np.array([[route.way, route.drive], [0.0, 1.0], [F_N_gain, F_N], [T_gain, T]])
        self._loads, self._F_T = self.slider.G @ w, self.slider.c @ w
        self._bases: Memory[np.ndarray] = Memory(BASES)

    @property
    def loads(self) -> tuple[np.ndarray, np.ndarray]:
        """Loads on the interface, shape (2 N_x, 2), and F_T at u = 0, shape (2,).

        The two columns are the derivative by drive (N/m) and the value at drive = 0 (N).
        """
        return self._loads, self._F_T

    def along(self, route: Route) -> ContactProblem:
        """Return the problem in which "drive" means the parameter s of a route."""
        other = copy.copy(self)
        other._look(route)
        return other

    def undriven(self) -> ContactProblem:
        """Return the problem without the driver, so that F_T = 0 for all displacements."""
        other = copy.copy(self)
        other.slider = self._undriven
        other._look(self._route)
        return other

    def corrected(self, now: Values, drive: float) -> ContactProblem:
        """Return the problem with corrected loads, so that the state `now` is in equilibrium.

        The problem is then linearised about this state instead of u = 0.
        """
        other, v = copy.copy(self), np.concatenate([now.u_x, now.u_z])
        other._loads, other._bases = self._loads.copy(), Memory(BASES)
        needed = self.slider.S @ v - self._loads @ [drive, 1.0]
        other._loads[:, 1] += needed - np.concatenate([now.f, now.p])
        return other

    def base(self, closed: np.ndarray) -> np.ndarray:
        """Return the table with all u_x held: rows u_x, f, u_z, F_T; columns u_x, drive, 1."""
        return self._bases.made(closed.tobytes(), lambda: self._base(closed))

    def _base(self, closed: np.ndarray) -> np.ndarray:
        S, drive, N_x = self.slider.S, self.slider.G[:, 0], self.scene.N_x
        x, z, *_ = ends(N_x)
        at = table_rows(N_x)
        A = S[z, z].copy()
        A[np.diag_indices(N_x)] += self.scene.k_f * closed
        table = np.zeros(at.shape)
        table[at.u_x, at.u_x] = np.eye(N_x)
        loads = self._loads[z].copy()
        loads[:, 1] -= self.scene.k_f * closed * self.scene.gap
        _, u_z, failed = dposv(A, np.column_stack([-S[z, x], loads]))
        if failed:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0)
        table[at.u_z] = u_z
        f = table[at.f]
        f[:] = S[x, z] @ u_z
        f[:, at.u_x] += S[x, x]
        f[:, at.given] -= self._loads[x]
        table[at.F_T] = -drive[z] @ u_z
        table[at.F_T, at.u_x] -= drive[x]
        table[at.F_T, at.given] += self._F_T
        return table

    @functools.cached_property
    def _applied(self) -> Contact:
        """Contact states of the slider under F_N without its driver."""
        home, none = self.scene.home, np.zeros(self.scene.N_x, dtype=bool)
        applied = Contact(self.undriven(), home, 0.0, np.zeros(len(home)), driven=False)
        if self.scene.interface.slip is None:
            applied.load(home)
        else:
            applied.hold_at(home, none)
        return applied

    def applied(self) -> Contact | None:
        """Return the slider under F_N without its driver, None if blocks slip in this state."""
        return None if self._applied.slip.any() else self._applied

    @functools.cached_property
    def _loaded(self) -> tuple[np.ndarray, float, np.ndarray]:
        """Loaded state: u_x (m), position of the driver at F_T = 0 (m), contact states."""
        applied = self._applied
        u_x, mode = applied.values().u_x, np.where(applied.closed, STUCK, OPEN)
        contact = Contact(self, u_x, 0.0, mode)
        return u_x, -contact.values().F_T / contact.rates().F_T, mode

    def loaded(self) -> Contact:
        """Return the loaded state with F_T = 0; all blocks in contact are held.

        Raises:
            EquilibriumError: the scene has no loaded equilibrium.
        """
        return Contact(self, *self._loaded)

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
    ) -> Static:
        """Return the equilibrium with the interface held: see `pyfric.StaticSolver.solve`."""
        problem = self if load is None else self.along(Route(0.0, 1.0, load))
        mode = with_free(self.scene, np.ones_like(free), free)
        u_x = np.where(free, 0.0, u_x_bottom)
        contact = Contact(problem, u_x, self._loaded[1] + drive, mode, law=FRICTIONLESS)
        now = contact.hold_at(u_x, free)
        return Static(now.F_T, -self.scene.d * now.f, now.p)


class Contact(States):
    """Contact states of all blocks, and their table; see `States`.

    Args:
        problem: the condensed slider.
        u_x: positions at which stuck blocks are held, shape (N_x,), in m.
        drive: position of the driver, in m.
        mode: contact states, shape (N_x,).
        law: the friction law; None means the law of the scene.
        driven: whether the driver's spring holds the slider.

    Attributes:
        way: +1 if the driver moves forward, -1 if it moves back. Rates are derivatives by the path
            length of the driver.
        free: blocks that slip or are open in the table, shape (N_x,), bool.
    """

    def __init__(
        self,
        problem: ContactProblem,
        u_x: np.ndarray,
        drive: float,
        mode: np.ndarray,
        *,
        law: CoulombLaw | None = None,
        driven: bool = True,
    ) -> None:
        scene = problem.scene
        super().__init__(scene, mode, law or scene.law.static, driven=driven)
        self.problem, self.K, self.least = problem, scene.driver.K, LEAST * problem.unit
        self.way, self._now = 1, None
        self.at, self._lifts = table_rows(self.N_x), np.zeros(self.N_x, dtype=int)
        self.column = np.concatenate([u_x, [drive, 1.0]])
        self.renew()

    @property
    def drive(self) -> float:
        """Position of the driver, in m."""
        return float(self.column[-2])

    @drive.setter
    def drive(self, value: float) -> None:
        self.column[-2], self._now = value, None

    def along(self, problem: ContactProblem, s: float) -> None:
        """Continue on another route from its parameter s (m), without a jump of drive or loads."""
        self.problem, self.drive = problem, s
        self.renew()

    # --- static states ---------------------------------------------------------------------------

    def exchange(self, unmet: Callable[[Values], Unmet | None]) -> Iterator[Values]:
        """Change contact states until all conditions are met; yield the values before each change.

        Blocks whose violations are equal within rounding change together, so that symmetric scenes
        stay symmetric.

        Args:
            unmet: function that returns the violated conditions, or None if all are met.

        Raises:
            EquilibriumError: the iteration does not end, or no block supports the slider.
        """
        n_max = CHANGES * self.N_x
        for n in range(n_max):
            now = self.values()
            found = unmet(now)
            if found is None:
                return
            worst = found.by >= max(found.by.max() - found.least, found.least)
            which = np.flatnonzero(worst if n < n_max // 2 else found.by > found.least)
            which = which if n < n_max // 2 else which[:1]
            self._lifts[which] += found.mode[which] == OPEN
            self.put(which, found.mode[which], found.u_x[which])
            yield now
        raise EquilibriumError("contact states do not settle", np.nan, self.tol, n_max)

    def hold_at(self, u_x: np.ndarray, free: np.ndarray) -> Values:
        """Find the state in which blocks in contact are held at u_x (m).

        Free blocks have no friction. A block that lifts off a second time becomes free.
        """
        self._lifts = np.where(free, 2, 0)
        for _ in self.exchange(
            lambda now: self.misplaced(now, np.where(self._lifts > 1, 1, STUCK), u_x)
        ):
            pass
        return self.values()

    def load(self, home: np.ndarray) -> Values:
        """Find the state after proportional loading; see `States.unmet_in_loading`.

        A block with very small p may lift off if it is held, and penetrate if it is free. A block
        that lifts off a second time lands as a slipping block, at its present position.
        """
        self._lifts[:] = 0

        def unmet(now: Values) -> Unmet | None:
            landed = np.where(self._lifts > 1, np.sign(now.u_x - home), STUCK)
            return self.unmet_in_loading(now, home, landed.astype(np.int8))

        for _ in self.exchange(unmet):
            pass
        return self.values()

    def follow(self, home: np.ndarray) -> Iterator[Values]:
        """Change contact states as in an event; yield the values before each change.

        Blocks that land stick at their present position. Blocks that would move back stick at their
        position at the last release, which is `home` (m) at first.
        """

        def unmet(now: Values) -> Unmet | None:
            nonlocal home
            found = self.misplaced(now, STUCK, now.u_x) or self.turned(now, home)
            if found is None:
                home, found = now.u_x, self.overloaded(now, now.u_x)
            return found

        return self.exchange(unmet)

    # --- the path of the driver ------------------------------------------------------------------

    def next_change(self, *, reload: bool = True) -> tuple[float, int, int]:
        """Return the next change of contact state as the driver moves.

        Rates within rounding are ignored.

        Args:
            reload: whether a slipping block with negligible p sticks once p grows again. Otherwise
                it continues to slip.

        Returns:
            drive (inf or -inf if nothing changes), the block, and its new state.
        """
        now, rate, stuck = self.values(), self.rates(), self.stuck
        closed, small = self.closed, self.small_rate(rate)
        best = np.inf, 0, STUCK
        margins, rates = self.law.margins(now.p, now.f), self.law.margins(rate.p, rate.f)
        light = (self.slip != 0) & (now.p <= 2 * self.least) & reload
        height = self.k * (now.u_z + self.gap)
        for mode, margin, slope, which in (
            (+1, margins[0], rates[0], stuck),
            (-1, margins[1], rates[1], stuck),
            (OPEN, now.p, rate.p, closed),
            (STUCK, height, self.k * rate.u_z, ~closed & self.scene.touches),
            (STUCK, 2 * self.least - now.p, -rate.p, light),
        ):
            falls = which & (slope < -small)
            if falls.any():
                ahead = np.full(self.N_x, np.inf)
                np.divide(np.maximum(margin, 0.0), -slope, out=ahead, where=falls)
                i = int(np.argmin(ahead))
                reached = self.way * self.drive + float(ahead[i])
                if reached < best[0]:
                    best = reached, i, mode
        return self.way * best[0], best[1], best[2]

    def small_rate(self, rate: Values) -> float:
        """Return the largest rate of a force that rounding can cause, in N/m."""
        moves = float(np.abs(rate.u_x).max())
        return RATE_TOL * (self.k * moves + min(self.k, self.K))

    def settle_rates(self) -> Iterator[Values]:
        """Find which blocks at their threshold slip as the driver moves on; see `exchange`.

        A slipping block that would move back sticks. A stuck block at its threshold slips if its
        friction force would exceed the threshold. If a block has just landed, f is zero within
        rounding, and the sign of its rate gives the direction of slip.
        """

        def unmet(now: Values) -> Unmet | None:
            rate, slip = self.rates(), self.slip
            back = -slip * rate.u_x * self.k
            at = self.stuck & (self.law.remaining(now.p, now.f) <= self.tol)
            way = np.sign(np.where(np.abs(now.f) > self.tol, now.f, rate.f))
            over = np.where(at, way * rate.f - self.law.hold(rate.p), 0.0)
            worst, small = np.maximum(back, over), self.small_rate(rate)
            mode = np.where(slip != 0, STUCK, -way).astype(np.int8)
            return Unmet(worst, small, mode, now.u_x) if worst.max() > small else None

        return self.exchange(unmet)

    # --- uniqueness of a state -------------------------------------------------------------------

    def slip_operator(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces against slip per displacement, with and without friction, in N/m.

        Args:
            slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,).

        Returns:
            W and F, shape (n, n), for the n blocks that slip; open blocks move freely.
        """
        at, i, open_ = self.at, np.flatnonzero(slip), np.flatnonzero(~self.closed)
        base = self.problem.base(self.closed)
        F, u_z = base[at.f, at.u_x], base[at.u_z, at.u_x]
        W = F - (self.law.slide(self.k_f) * slip)[:, None] * u_z
        if not open_.size:
            return W[np.ix_(i, i)], F[np.ix_(i, i)]
        follow = np.linalg.solve(F[np.ix_(open_, open_)], F[np.ix_(open_, i)])
        return tuple(A[np.ix_(i, i)] - A[np.ix_(i, open_)] @ follow for A in (W, F))

    def definiteness(self) -> float:
        """Return the definiteness of the slip operator, which decides whether slip is unique."""
        return definiteness(*self.slip_operator(self.slip))

    def definiteness_of_sliding(self) -> float:
        """Return the definiteness of the slip operator for slip of all blocks in one direction.

        The smaller of the values for the two directions is returned. Definiteness is larger if
        fewer blocks slip.
        """
        one_way = self.closed.astype(np.int8)
        return min(definiteness(*self.slip_operator(way)) for way in (one_way, -one_way))

    # --- pivots ----------------------------------------------------------------------------------

    def change(self, i: int, mode: int) -> None:
        """Change the state of one block, at its present position."""
        self.put(np.array([i]), np.array([mode]), self.values().u_x[[i]])

    def put(self, which: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> None:
        """Set the states of n blocks, shape (n,); stuck blocks are held at u_x (m), (n,)."""
        mode = self.possible(which, mode)
        opens = (self.mode[which] == OPEN) | (mode == OPEN)
        if opens.any():
            self.column[self.at.u_x] = self.table[self.at.u_x] @ self.column
            self.enter(which, mode)
            self.column[which] = u_x
            self.renew()
            return
        for n in np.argsort(mode != STUCK, kind="stable"):  # stuck blocks first
            if self.free[which[n]] == (mode[n] == STUCK):
                self._exchange(which[n], mode[n], u_x[n])

    def _exchange(self, i: int, mode: int, u_x: float) -> None:
        """Exchange column and row of a block, which is released, or held at u_x (m)."""
        table, at, sticks = self.table, self.at, mode == STUCK
        row = table[i].copy()
        if not sticks:
            friction = mode * of(self.law.slide(self.k_f), i)
            row = table[at.f][i] - friction * table[at.u_z][i]
            row[-1] -= friction * of(self.gap, i)
        pivot = row[i]
        row /= -pivot
        row[i] = 1.0 / pivot
        factor = table[:, i].copy()
        table[:, i] = 0.0
        table += np.multiply.outer(factor, row)
        self.column[i], self.free[i], self._now = u_x if sticks else 0.0, not sticks, None
        self.enter(i, mode)

    def hold_all(self) -> None:
        """Hold all slipping blocks at their present positions, and compute the table anew.

        Blocks with negligible p continue to slip. Otherwise they would slip and stick in ever
        smaller steps, without end, before they lift off.
        """
        now = self.values()
        self.column[self.at.u_x] = now.u_x
        self.enter(self.closed & (now.p > self.least), STUCK)
        self.renew()

    def renew(self) -> None:
        """Compute the table anew: start with all blocks held, then free all that are not stuck."""
        u_x = self.column[self.at.u_x]
        largest = max(self.k * np.abs(u_x).max(), min(self.k, self.K) * abs(self.drive))
        self.tol = rounding(self.scene, float(largest))
        if self.tol > LOST * self.problem.unit:
            raise EquilibriumError(UNHELD, np.nan, self.tol, 0)
        self.table, self._now = self.problem.base(self.closed).copy(), None
        table = self.table
        self.free = ~self.stuck
        free = np.flatnonzero(self.free)
        if not free.size:
            return
        friction = (self.slip[free] * of(self.law.slide(self.k_f), free))[:, None]
        held = table[self.at.f][free] - friction * table[self.at.u_z][free]
        held[:, -1] -= friction[:, 0] * of(self.gap, free)
        try:
            inverse = np.linalg.inv(held[:, free])
        except np.linalg.LinAlgError:
            raise EquilibriumError(UNHELD, np.nan, self.tol, 0) from None
        held = -(inverse @ held)
        held[:, free] = inverse
        factor = table[:, free].copy()
        table[:, free] = 0.0
        table += factor @ held
        self.column[free] = 0.0

    def values(self) -> Values:
        """Return the values of the interface at the present position of the driver."""
        if self._now is None:
            self._now = self._values_of(self.table @ self.column, self.gap)
        return self._now

    def rates(self) -> Values:
        """Return the derivatives of `values` by the path length of the driver."""
        return self._values_of(self.way * self.table[:, self.at.drive])

    def _values_of(self, v: np.ndarray, gap: float | np.ndarray = 0.0) -> Values:
        at, u_z = self.at, v[self.at.u_z]
        p = np.where(self.closed, -self.k_f * (u_z + gap), 0.0)
        f = np.where(self.free, -self.slip * self.law.slide(p), v[at.f])
        return Values(v[at.u_x], f, u_z, p, float(v[at.F_T]))
