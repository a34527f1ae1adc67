"""Contact of the interface as one complementarity problem: stuck, slip +, slip -, open.

A block is in exactly one of these states (d is the slider's, sigma a block's direction):

    stuck   u_x held,                 |f| <= mu_s p,  p >= 0
    slip    f = -sigma mu_k p,        sigma du_x >= 0, p >= 0
    open    p = f = 0,                u_z >= 0

`ContactProblem` holds the condensed slider of one scene. A `Contact` gives u_x, f, u_z and F_T as
affine functions of the held u_x and of the driver, in a table whose columns are exchanged when a
block is released or held. That is a rank-one change: following an event costs microseconds each.

Source: PRL 107, 074301 (2011), friction law; tables with exchanged columns are the pivots of linear
complementarity (R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992).
"""

from __future__ import annotations

import copy
import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from pyfric.scene import FRICTIONLESS, of
from pyfric.statics.condensation import condense
from pyfric.statics.equilibrium import loaded_state
from pyfric.statics.rest import EquilibriumError, check_rests
from pyfric.statics.uniqueness import definiteness, is_definite

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["Contact", "ContactProblem", "Route", "Statics", "Values"]

CONTACT_TOL = 1e-11
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""
ROUNDING = 2.0**-48
"""Errors of forces, over stiffness times displacement."""
RATE_TOL = 1e-11
"""Rates of forces below this share of stiffness times rate of displacement are rounding."""
LEAST = 1e-6
"""A block with less load than this many F_N/N_x does not stick."""


class Values(NamedTuple):
    """The interface at one position of the driver; arrays have shape (N_x,)."""

    u_x: np.ndarray
    f: np.ndarray
    u_z: np.ndarray
    p: np.ndarray
    F_T: float


class Route(NamedTuple):
    """A straight path of what is outside the slider, over s in m.

    The driver is at drive + way s (m), loads (F_N and T, in N) are load + gain s.
    """

    drive: float
    way: float
    load: tuple[float, float]
    gain: tuple[float, float] = (0.0, 0.0)


class ContactProblem:
    """The condensed slider of one scene and its contact with the substrate (linear geometry)."""

    def __init__(self, scene: Scene) -> None:
        check_rests(scene)
        self.scene = scene
        self.slider = condense(scene)
        self.unit = scene.F_N / scene.N_x
        self._bases: dict[bytes, np.ndarray] = {}
        s = self.slider
        self._columns, self._F_T = np.column_stack([s.g_1, s.g_0]), (s.c_2, s.c_1)

    @functools.cached_property
    def _of_loads(self) -> tuple[np.ndarray, np.ndarray]:
        """What F_N = 1 N and T = 1 N do: forces on the interface, (2 N_x, 2), and F_T, (2,)."""
        ones = [condense(self.scene, load) for load in ((1.0, 0.0), (0.0, 1.0))]
        return np.column_stack([one.g_0 for one in ones]), np.array([one.c_1 for one in ones])

    def along(self, route: Route) -> ContactProblem:
        """Return the problem whose "drive" is s on a route."""
        s, (forces, F_T), other = self.slider, self._of_loads, copy.copy(self)
        load, gain = np.array(route.load), np.array(route.gain)
        other._bases = {}
        other._columns = np.column_stack(
            [route.way * s.g_1 + forces @ gain, route.drive * s.g_1 + forces @ load]
        )
        other._F_T = route.way * s.c_2 + F_T @ gain, route.drive * s.c_2 + F_T @ load
        return other

    def base(self, closed: np.ndarray) -> np.ndarray:
        """Return the table with all u_x held: rows u_x, f, u_z, F_T; columns u_x, drive, 1."""
        key = closed.tobytes()
        if key not in self._bases:
            while len(self._bases) >= 64:
                del self._bases[next(iter(self._bases))]
            self._bases[key] = self._new_base(closed)
        return self._bases[key]

    def _new_base(self, closed: np.ndarray) -> np.ndarray:
        s, N_x = self.slider, self.scene.N_x
        x, z = slice(0, N_x), slice(N_x, 2 * N_x)
        A = s.S[z, z].copy()
        A[np.diag_indices(N_x)] += self.scene.k_f * closed
        load = self._columns
        table = np.zeros((3 * N_x + 1, N_x + 2))
        table[:N_x, :N_x] = np.eye(N_x)
        _, u_z, failed = dposv(A, np.column_stack([-s.S[z, x], load[z]]))
        if failed:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0)
        table[2 * N_x : 3 * N_x] = u_z
        f = table[N_x : 2 * N_x]
        f[:] = s.S[x, z] @ u_z
        f[:, :N_x] += s.S[x, x]
        f[:, N_x:] -= load[x]
        table[-1] = -s.g_1[z] @ u_z
        table[-1, :N_x] -= s.g_1[x]
        table[-1, N_x:] += self._F_T
        return table

    def loaded(self) -> Contact:
        """Return the loaded state with F_T = 0: all blocks are held where they are.

        Raises:
            EquilibriumError: the scene has no loaded equilibrium.
        """
        scene = self.scene
        contact = Contact(self, np.zeros(scene.N_x), 0.0, np.ones(scene.N_x, dtype=bool))
        contact.drive = -contact.values().F_T / contact.rates().F_T
        now = contact.values()
        if (contact.law.margin(now.p, now.f) >= 0).all():
            return contact
        # Blocks slip or lift off while F_N is applied.
        rest = loaded_state(scene)
        return Contact(self, rest.u[0, 0], scene.d * rest.u_drv0, ~rest.open)

    def solver(self, drive_0: float) -> Statics:
        """Return static states for `pyfric.record.catalogue`; the driver counts from drive_0."""
        return Statics(self, drive_0)


class Static(NamedTuple):
    """A static state of the interface; arrays of shape (N_x,), in N."""

    F_T: float
    tau: np.ndarray
    p: np.ndarray


class Statics:
    """Static states with the interface held, as `pyfric.StaticSolver` gives them."""

    def __init__(self, problem: ContactProblem, drive_0: float) -> None:
        self.problem, self.drive_0 = problem, drive_0

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
    ) -> Static:
        """Return the equilibrium with u_x held except where free (open).

        `load` is F_N and T (N) where they are not those at t = 0.

        Free blocks that touch the foundation have no friction. Held ones that lift off are freed;
        where they come down again, they are held again, unless they lift off a second time.

        Raises:
            EquilibriumError: the set of open blocks does not settle.
        """
        given = np.where(free, 0.0, u_x_bottom)
        problem = self.problem if load is None else self.problem.along(Route(0.0, 1.0, load))
        contact = Contact(problem, given, self.drive_0 + drive, ~free)
        contact.law = FRICTIONLESS
        loose, lifted = free.copy(), np.zeros_like(free)
        for _ in range(8 * contact.N_x + 20):
            now = contact.values()
            i = contact.wrong_side(now)
            if i is None:
                return Static(now.F_T, -self.problem.scene.d * now.f, now.p)
            closed = contact.closed.copy()
            closed[i] ^= True
            if not closed[i] and not loose[i]:
                loose[i], lifted[i] = lifted[i], True
            contact.closed, contact.slip = closed, (closed & loose).astype(np.int8)
            contact.column[:-2] = given
            contact.renew()
        raise EquilibriumError("the set of open blocks does not settle", np.nan, contact.tol, 0)


class Contact:
    """Contact states of all blocks, and the table that goes with them.

    Attributes:
        slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,), int8.
        closed: blocks that touch the foundation, shape (N_x,), bool.
        drive: position of the driver, in m.
        way: +1 where the driver goes on, -1 where it goes back; rates are per path of it.
        law: the friction law; slipping blocks have left weakening behind.
        tol: violations of contact or friction conditions below it are rounding, in N.
    """

    def __init__(
        self, problem: ContactProblem, u_x: np.ndarray, drive: float, closed: np.ndarray
    ) -> None:
        self.problem, scene = problem, problem.scene
        self.N_x, self.k_f = scene.N_x, scene.k_f
        self.law = scene.law
        self.k, self.K, self.least = scene.slider.k, scene.driver.K, LEAST * problem.unit
        self.way = 1
        self.slip = np.zeros(self.N_x, dtype=np.int8)
        self.closed = np.array(closed, dtype=bool)
        self.free = np.zeros(self.N_x, dtype=bool)
        self.column = np.concatenate([u_x, [drive, 1.0]])
        self.renew()

    @property
    def drive(self) -> float:
        return float(self.column[-2])

    @drive.setter
    def drive(self, value: float) -> None:
        self.column[-2] = value

    def along(self, problem: ContactProblem, s: float) -> None:
        """Go on along another route, from s (m) on, where the same is outside as here."""
        self.problem, self.drive = problem, s
        self.renew()

    @property
    def stuck(self) -> np.ndarray:
        """Blocks that are closed and held, shape (N_x,), bool."""
        return ~self.free

    def wrong_side(self, now: Values) -> int | None:
        """Return the block that is deepest on the wrong side of the foundation, None for none."""
        depth = np.where(self.closed, self.k_f * now.u_z, -np.minimum(self.k, self.k_f) * now.u_z)
        i = int(np.argmax(depth))
        return i if depth[i] > self.tol else None

    def next_change(self, *, reload: bool = True) -> tuple[float, int, int]:
        """Return where the next contact state changes as the driver goes its way.

        A rate that may be nothing but rounding changes nothing.

        Args:
            reload: whether a slipping block that carries next to nothing sticks once it has load
                again. Without it, it slips on as others do.

        Returns:
            drive (inf or -inf for nowhere), the block, and what it does: +1 or -1 slips that way,
            0 opens or closes, 2 has load again and sticks.
        """
        now, rate, stuck = self.values(), self.rates(), self.stuck
        closed, small = self.closed, self.small_rate(rate)
        best = np.inf, 0, 0
        margins, rates = self.law.margins(now.p, now.f), self.law.margins(rate.p, rate.f)
        light = closed & ~stuck & (now.p <= 2 * self.least) & reload
        for what, margin, slope, which in (
            (+1, margins[0], rates[0], stuck),
            (-1, margins[1], rates[1], stuck),
            (0, now.p, rate.p, closed),
            (0, self.k * now.u_z, self.k * rate.u_z, ~closed),
            (2, 2 * self.least - now.p, -rate.p, light),
        ):
            falls = which & (slope < -small)
            if falls.any():
                ahead = np.full(self.N_x, np.inf)
                np.divide(np.maximum(margin, 0.0), -slope, out=ahead, where=falls)
                i = int(np.argmin(ahead))
                there = self.way * self.drive + float(ahead[i])
                if there < best[0]:
                    best = there, i, what
        return self.way * best[0], best[1], best[2]

    def small_rate(self, rate: Values) -> float:
        """Return the rate of a force that may be nothing but rounding, in N/m."""
        moves = float(np.abs(rate.u_x).max())
        return RATE_TOL * (self.k * moves + min(self.k, self.K))

    def slip_operator(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces against slip per displacement: with friction, and without it, in N/m.

        Args:
            slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,).

        Returns:
            W and F, shape (n, n), for the n blocks that slip; open blocks follow.
        """
        N_x, i, open_ = self.N_x, np.flatnonzero(slip), np.flatnonzero(~self.closed)
        base = self.problem.base(self.closed)
        F, u_z = base[N_x : 2 * N_x, :N_x], base[2 * N_x : 3 * N_x, :N_x]
        W = F - (self.law.slide(self.k_f) * slip)[:, None] * u_z
        if not open_.size:
            return W[np.ix_(i, i)], F[np.ix_(i, i)]
        follow = np.linalg.solve(F[np.ix_(open_, open_)], F[np.ix_(open_, i)])
        return tuple(A[np.ix_(i, i)] - A[np.ix_(i, open_)] @ follow for A in (W, F))

    def definite(self) -> bool:
        """Return whether the slip operator is positive definite: the solution is then unique."""
        return is_definite(*self.slip_operator(self.slip))

    def definiteness_of_sliding(self) -> float:
        """Return how definite the slip operator is where all closed blocks slip one way.

        It is the smaller value of both ways. Fewer slipping blocks make it larger.
        """
        one_way = self.closed.astype(np.int8)
        return min(definiteness(*self.slip_operator(way)) for way in (one_way, -one_way))

    def _exchange(self, i: int) -> None:
        """Free a held block, on which the force is then given, or hold a free one where it is."""
        table, column, N_x = self.table, self.column, self.N_x
        if self.free[i]:
            row = table[i].copy()
            value = row @ column
        else:
            friction = self.slip[i] * of(self.law.slide(self.k_f), i)
            row = table[N_x + i] - friction * table[2 * N_x + i]
            value = 0.0
        pivot = row[i]
        row /= -pivot
        row[i] = 1.0 / pivot
        factor = table[:, i].copy()
        table[:, i] = 0.0
        table += np.outer(factor, row)
        column[i] = value
        self.free[i] = not self.free[i]

    def release(self, i: int, direction: int) -> None:
        """Let a stuck block slip."""
        self.slip[i] = direction
        self._exchange(i)

    def hold(self, i: int, u_x: float | None = None) -> None:
        """Hold a slipping block, where it is or at u_x."""
        self._exchange(i)
        self.slip[i] = 0
        if u_x is not None:
            self.column[i] = u_x

    def hold_all(self) -> None:
        """Hold all slipping blocks where they are; the table starts afresh.

        Blocks that carry next to nothing go on slipping. Before they lift off they would otherwise
        slip and stick without end, by less each time.
        """
        now = self.values()
        self.column[: self.N_x] = now.u_x
        self.slip[now.p > self.least] = 0
        self.renew()

    def set_closed(self, closed: np.ndarray) -> None:
        """Open and close blocks; blocks that close are held where they are, others stay."""
        u_x = self.table[: self.N_x] @ self.column
        self.closed = closed.copy()
        self.slip[~closed] = 0
        self.column[: self.N_x] = u_x
        self.renew()

    def flip(self, i: int) -> None:
        """Open a closed block or close an open one."""
        closed = self.closed.copy()
        closed[i] ^= True
        self.set_closed(closed)

    def renew(self) -> None:
        """Start from the table with all blocks held, and free those that are not stuck at once."""
        N_x = self.N_x
        largest = max(
            self.k * np.abs(self.column[:N_x]).max(), min(self.k, self.K) * abs(self.drive)
        )
        self.tol = CONTACT_TOL * self.problem.unit + ROUNDING * float(largest)
        self.table = table = self.problem.base(self.closed).copy()
        self.free = (self.slip != 0) | ~self.closed
        free = np.flatnonzero(self.free)
        if not free.size:
            return
        friction = (self.slip[free] * of(self.law.slide(self.k_f), free))[:, None]
        rows = table[N_x + free] - friction * table[2 * N_x + free]
        try:
            inverse = np.linalg.inv(rows[:, free])
        except np.linalg.LinAlgError:
            what = "the slider is not held by the blocks that stick"
            raise EquilibriumError(what, np.nan, self.tol, 0) from None
        rows = -(inverse @ rows)
        rows[:, free] = inverse
        factor = table[:, free].copy()
        table[:, free] = 0.0
        table += factor @ rows
        self.column[free] = 0.0

    def values(self) -> Values:
        """Return the interface at the present position of the driver."""
        return self._values_of(self.table @ self.column)

    def rates(self) -> Values:
        """Return the derivatives of `values` by the path of the driver."""
        return self._values_of(self.way * self.table[:, -2])

    def _values_of(self, v: np.ndarray) -> Values:
        N_x = self.N_x
        u_z = v[2 * N_x : 3 * N_x]
        p = np.where(self.closed, -self.k_f * u_z, 0.0)
        f = np.where(self.free, -self.slip * self.law.slide(p), v[N_x : 2 * N_x])
        return Values(v[:N_x], f, u_z, p, float(v[-1]))
