"""Stable slip: friction that weakens while the slider stays in equilibrium (linear geometry).

Blocks that have slipped by s carry mu(s) p, where mu is linear in s between the knots of the law.
Let x be the u_x of the blocks of the condensed slider that slip (direction sigma) or are open:

    R(x, drive) = f(x, drive) + sigma mu(s) p(x, drive) = 0 ,   ds = sigma dx ,
    J = dR/dx = df/dx + sigma mu dp/dx + mu' p .

Weakening, mu' < 0, acts as a negative stiffness mu' p of each slipping block; the change of p adds
a further term. As the driver moves, dx/d(drive) = -J^-1 dR/d(drive), and the state follows a smooth
path until one of these changes:

    a stuck block reaches its strength, a slipping block reverses, a block opens or lands;
    a slip reaches a knot of the law, where the path has a kink;
    an eigenvalue of J becomes zero, so that slip continues without the driver.

The friction force is a product of two linear functions, mu and p. Newton's method finds the states.
Changes are the zeros of gap functions, located to rounding.

Source: J. R. Rice and A. L. Ruina, J. Appl. Mech. 50, 343 (1983), stability against a stiffness;
K. Uenishi and J. R. Rice, J. Geophys. Res. 108, 2042 (2003), for weakening with slip alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.scene import of
from pyfric.statics.rows import table_rows
from pyfric.statics.weakening import Weakening

if TYPE_CHECKING:
    from pyfric.statics.complementarity import ContactProblem

ENOUGH = 1e-10
"""Largest accepted residual force of static states, over F_N/N_x."""
ROUNDED = 10 * ENOUGH
"""Largest violation of gap functions by residual forces, over F_N/N_x."""
RATE = 1e-7
"""Slip per displacement of the driver below which a block counts as not slipping."""
PART = 0.25
"""Largest slip in one step along a path, over the slip at the first knot of the law."""
PAST = 1.01
"""Step length over the extrapolated distance to the next change, so that a step passes the
change."""
NEWTON, LOOKS, STEPS = 12, 200, 10_000
"""Largest numbers of Newton steps, of states computed to find one change, of steps of a path."""


class Point(NamedTuple):
    """A static state with slip; arrays have shape (N_x,), except margins, (5, N_x).

    The margins are gap functions, positive while no contact state changes: remaining strength of
    stuck blocks against slip in +x and in -x (N); slip per drive of slipping blocks; p of closed or
    k_f u_z of open blocks (N); remaining slip to the next knot (m). Margins of other blocks are
    inf.
    """

    drive: float
    u_x: np.ndarray
    rate: np.ndarray
    f: np.ndarray
    p: np.ndarray
    F_T: float
    margins: np.ndarray


class Change(NamedTuple):
    """The reason why a path ends: "end", "unstable", or an entry of `WHAT` and a block."""

    what: str
    block: int = -1


WHAT = ("slip +", "slip -", "stick", "gap", "knot")


class Creep(Weakening):
    """Paths of static states in which blocks slip as the driver moves.

    Args:
        problem: the condensed slider.
        u_x: positions of the blocks at the start, shape (N_x,), in m.
        way: direction of blocks that slip, 0 elsewhere, shape (N_x,).
        closed: blocks that touch the foundation, shape (N_x,), bool.
        clock: s - way u_x of blocks that slip, shape (N_x,), in m.
    """

    def __init__(
        self,
        problem: ContactProblem,
        u_x: np.ndarray,
        way: np.ndarray,
        closed: np.ndarray,
        clock: np.ndarray,
    ) -> None:
        self.problem, scene = problem, problem.scene
        super().__init__(scene.law.static, way, clock, u_x)
        self.k_f = np.broadcast_to(np.asarray(scene.k_f, float), self.N_x)
        self.closed, self.u_x = closed.copy(), u_x.copy()
        force = ROUNDED * problem.unit
        self.small = np.array([force, force, RATE, force, force / scene.slider.k])  # see `wrong`

    @property
    def free(self) -> np.ndarray:
        """Blocks with free u_x, which slip or are open, shape (N_x,), bool."""
        return (self.way != 0) | ~self.closed

    # --- states ----------------------------------------------------------------------------------

    def at(self, drive: float, begin: Point | None = None) -> Point | None:
        """Return the static state at a driver position, on the present linear pieces of the law.

        Args:
            drive: position of the driver, in m.
            begin: a nearby state; the search begins on its tangent.

        Returns:
            The state, or None if there is no stable state.
        """
        row, table = table_rows(self.N_x), self.problem.base(self.closed)
        a = np.flatnonzero(self.free)
        fs, zs = table[row.f], table[row.u_z]
        u_x = self.u_x.copy()
        if begin is not None:
            u_x = begin.u_x + begin.rate * (drive - begin.drive)
        for _ in range(NEWTON):
            v = table @ np.concatenate([u_x, [drive, 1.0]])
            f, u_z = v[row.f], v[row.u_z]
            p = np.where(self.closed, -self.k_f * u_z, 0.0)
            mu, slope = self.friction(u_x)
            rub = (self.way * mu * self.k_f)[a]
            J = fs[np.ix_(a, a)] - rub[:, None] * zs[np.ix_(a, a)] + np.diag((slope * p)[a])
            left = (f + self.way * mu * p)[a]
            if not np.isfinite(J).all():
                return None
            if np.abs(left).max(initial=0.0) <= ENOUGH * self.problem.unit:
                break
            try:
                u_x[a] -= np.linalg.solve(J, left)
            except np.linalg.LinAlgError:
                return None
        else:
            return None
        if not (np.linalg.eigvals(J).real > 0).all():  # slip continues without the driver
            return None
        rate = np.zeros(self.N_x)
        rate[a] = -np.linalg.solve(J, fs[a, row.drive] - rub * zs[a, row.drive])
        margins = self._margins(u_x, rate, f, p, u_z)
        return Point(drive, u_x, rate, f, p, float(v[row.F_T]), margins)

    def _margins(
        self, u_x: np.ndarray, rate: np.ndarray, f: np.ndarray, p: np.ndarray, u_z: np.ndarray
    ) -> np.ndarray:
        slips, stuck = self.way != 0, ~self.free
        plus, minus = self.law.margins(p, f)
        rows = (
            np.where(stuck, plus, math.inf),
            np.where(stuck, minus, math.inf),
            np.where(slips, self.way * rate, math.inf),
            np.where(self.closed, p, self.k_f * u_z),
            np.where(slips, self.knot() - (self.clock + self.way * u_x), math.inf),
        )
        return np.array(rows)

    # --- the path --------------------------------------------------------------------------------

    def follow(self, begin: Point, drive_end: float) -> tuple[list[Point], Change]:
        """Follow the path until a contact state changes; knots of the law are passed.

        Args:
            begin: state at the start, from `at`.
            drive_end: position of the driver at the end, in m.

        Returns:
            States along the path, of which the last is just before the change, and the change.
        """
        path = [begin]
        for _ in range(STEPS):
            if path[-1].drive >= drive_end:
                return path, Change("end")
            change = self._stretch(path, drive_end)
            if change is None:
                continue
            if change.what != "knot":
                return path, change
            self.cell[change.block] += 1
            after = self.at(path[-1].drive, path[-1])
            wrong = self.wrong(after)
            if wrong is not None:
                return path, wrong
            path.append(after)
        return path, Change("unstable")

    def after(self, change: Change, point: Point) -> Point | None:
        """Apply a change from `follow` to the state before it, and return the state after it.

        A block that starts to slip has zero slip. A block that lands sticks at its position. None
        is returned if no static state is nearby, or if friction jumps.
        """
        i, way = change.block, {"slip +": 1.0, "slip -": -1.0}.get(change.what, 0.0)
        if change.what == "gap":
            self.closed[i] ^= True
        self.u_x = point.u_x.copy()
        self.way[i], self.clock[i] = way, -way * point.u_x[i]
        self.cell[i] = len(self._x) - 1 if self.d_c[i] == 0 else 0
        strongest = of(self.law.mu_s, i)
        if way and strongest - self.friction(point.u_x)[0][i] > ENOUGH * strongest:
            return None
        return self.at(point.drive, point)

    def nucleate(self, drive: float, drive_end: float) -> tuple[list[Point], list[Change]]:
        """Follow slip through all changes of contact state until slip becomes unstable.

        Args:
            drive: position of the driver at the start, in m.
            drive_end: position of the driver at the end, in m.

        Returns:
            Static states, and the changes; the last change is "unstable" or "end".
        """
        path, changes = [], []
        begin = self.at(drive)
        for _ in range(10 * self.N_x):
            if begin is None:
                return path, [*changes, Change("unstable")]
            found, change = self.follow(begin, drive_end)
            path += found
            changes.append(change)
            if change.block < 0:
                break
            begin = self.after(change, path[-1])
        return path, changes

    def _stretch(self, path: list[Point], drive_end: float) -> Change | None:
        """Make one step along a path, or end the path just before a change, which is returned."""
        low, unit = path[-1], self.problem.unit
        close = ROUNDED * unit / self.problem.scene.slider.k
        close = max(close, 8 * float(np.spacing(abs(low.drive))))
        high = min(low.drive + max(self._step(low), 2 * close), drive_end)
        at = self.at(high, low)
        change = self.wrong(at)
        for n in range(LOOKS):
            if change is None or high - low.drive <= close:
                break
            middle = (low.drive + high) / 2
            if change.block >= 0 and n % 4 < 3:  # every fourth step is a bisection
                row = WHAT.index(change.what)
                begin, end = (
                    point.margins[row, change.block] + self.small[row] for point in (low, at)
                )
                if begin > end:  # otherwise the start violates the gap function, too
                    middle = low.drive + max(begin, 0.0) / (begin - end) * (high - low.drive)
            middle = min(max(middle, low.drive + close), max(high - close, low.drive + close / 2))
            found = self.at(middle, low)
            wrong = self.wrong(found)
            if wrong is None:
                low = found
            else:
                high, at, change = middle, found, wrong
        if change is None:
            low = at
        if low is not path[-1]:
            path.append(low)
        return change

    def _step(self, now: Point) -> float:
        """Return the next step of the drive (m).

        The step gives weakening blocks a slip of a fraction of d_c, or ends just past the next
        change by linear extrapolation.
        """
        row, table = table_rows(self.N_x), self.problem.base(self.closed)
        v = table[:, row.u_x] @ now.rate + table[:, row.drive]
        f, u_z = v[row.f], v[row.u_z]
        p = np.where(self.closed, -self.k_f * u_z, 0.0)
        gap, none = np.where(self.closed, p, self.k_f * u_z), np.zeros(self.N_x)
        slopes = np.array([*self.law.margins(p, f), none, gap, -self.way * now.rate])
        falls = np.isfinite(now.margins) & (slopes < 0)
        left, never = now.margins + self.small[:, None], np.full(falls.shape, math.inf)
        ahead = np.divide(-left, slopes, out=never, where=falls)
        speed = np.abs(now.rate[self.weakens]).max(initial=0.0)
        far = PART * self._x[1] * float(np.max(self.d_c))
        return min(far / speed if speed > 0 else math.inf, PAST * max(float(ahead.min()), 0.0))

    def wrong(self, point: Point | None) -> Change | None:
        """Return the largest violation at a state as a change; None if nothing is violated."""
        if point is None:
            return Change("unstable")
        over = -point.margins / self.small[:, None]
        if over.max() > 1:
            row, block = np.unravel_index(int(np.argmax(over)), over.shape)
            return Change(WHAT[row], int(block))
        return None
