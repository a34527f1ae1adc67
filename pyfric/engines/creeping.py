"""Jumps over stable slip in the hybrid engine, in linear geometry.

With friction that weakens over a length, blocks near the driver slip stably long before an event,
at a part of its speed. The run jumps along static states with slip (`pyfric.statics.creep`) to the
last step before a contact state can change, and goes on there with the speed V dq/d(drive).

The slider also moves about that path. With w the deviation from it, K with the friction and the
weakening of the blocks that slip, which make it unsymmetric,

    M w'' + C w' + K w = 0 .

Its slow modes are sought among the shapes of the slider with all closed blocks held (`modes`) and
the static shapes of the slips. The truncated part must be smaller than the accuracy, shared among
the blocks. No block may turn back meanwhile: the speed of slip less all amplitudes has to stay
positive, because a block that stops is as strong as before. While none does, slip has no memory but
its own length, so that the deviation leaves no trace.

Viscosity holds the path back by a lag, which is kept. Inertia of a path that bends is of order
sqrt(k m) v at a speed of slip v: the path is left where that exceeds `INERTIA` times the accuracy,
shared among the blocks, which is just before slip becomes unstable.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.engines.crossing import first_crossing
from pyfric.engines.modes import orthonormal
from pyfric.statics import ContactProblem, Creep, creeps, damping, mass

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core import State
    from pyfric.engines.modes import Linearised
    from pyfric.scene import Scene
    from pyfric.statics import Point, StaticSolver

__all__ = ["Creeping", "Landing"]

INERTIA = 200.0
"""Largest sqrt(k m) v at a speed of slip v, over the accuracy of forces, shared among the blocks.
Fitted: with 500 times, and ten times the truncated part, a slider of 9 x 6 blocks is off by
1.2e-4 F_N after it has slid as a whole, which amplifies differences."""
APART = 16
"""Steps between the two states of the path whose difference gives its acceleration."""
KEPT = 3
"""Sets of slipping blocks whose shapes are kept: as much memory as a linearised slider each."""


class Landing(NamedTuple):
    """Where a jump ends: steps; coordinates (m) and their rates (m/s); the static state.

    `times` (s) since the jump began, `forces`, F_T there (N), amplitudes of modes in it (N) and
    their rates (1/s) make up the loading curve of the jump.
    """

    n: int
    q: np.ndarray
    v: np.ndarray
    point: Point
    times: np.ndarray
    forces: np.ndarray
    modal: np.ndarray
    growth: np.ndarray

    def F_T(self, s: np.ndarray) -> np.ndarray:
        """Return F_T (N) at times s (s) since the jump began, shape (n,)."""
        moves = (self.modal @ np.exp(np.outer(self.growth, s))).real
        return np.interp(s, self.times, self.forces) + moves


class Creeping:
    """Stable slip of one scene, for jumps of the hybrid engine.

    Args:
        scene: the scene.
        known: its static states, in linear geometry.
        accuracy: largest error of contact forces, in N.
        V: speed of the driver, in m/s, > 0.
    """

    def __init__(self, scene: Scene, known: StaticSolver, accuracy: float, V: float) -> None:
        self.scene, self.known, self.V = scene, known, V
        self.mass, self.C = mass(scene), damping(scene)
        self._spaces: list[_Space] = []
        self.force = accuracy / scene.N_x
        self.kink = self.force / (math.sqrt(scene.slider.k * scene.m) * V)
        self.fastest = INERTIA * self.kink

    @functools.cached_property
    def problem(self) -> ContactProblem:
        """The condensed slider."""
        return ContactProblem(self.scene, self.known.u_drv0)

    @property
    def home(self) -> float:
        """Where the driver of the problem is at drive = 0, in m."""
        return self.scene.d * float(np.mean(self.known.u_drv0))

    @staticmethod
    def possible(scene: Scene, geometry: str, V: float) -> bool:
        """Whether stable slip is followed: linear geometry, friction of slip alone, V (m/s) > 0."""
        return geometry == "linear" and creeps(scene.law) and V > 0

    def land(self, state: State, held: Callable[[], Linearised], last: int) -> Landing | None:
        """Return where a jump over stable slip may end, None if there is none.

        Args:
            state: the present.
            held: returns the slider with all blocks held that are not open.
            last: number of the last step.
        """
        V, dt = self.V, state.dt
        drive = self.scene.drive(state.t) + self.home
        way = np.where(np.abs(state.mode) == 1, state.mode, 0)
        creep = Creep(self.problem, state.y[0, 0], way, state.mode != OPEN, state.s_0)
        begin = creep.at(drive)
        if begin is None or creep.wrong(begin, self.fastest) is not None:
            return None
        space = self._space(held(), np.flatnonzero(way))
        modes = _Modes(self.scene, space, creep, begin)
        a, left = self._motion(state, modes, begin)
        if math.sqrt(2 * self.scene.slider.k * left) > self.force:
            return None
        end = drive + (last - state.step) * V * dt
        path, _ = creep.follow(begin, end, self.fastest, self.kink)
        n = math.floor(modes.safe(path, V, a, left, dt) / dt)
        point = creep.on(path, drive + n * V * dt)
        if n < 1 or point is None:
            return None
        after = _Modes(self.scene, space, creep, point)
        q, v = self._path(after, point, dt)
        w, w_v = modes.deviation(a, n * dt)
        times = np.array([(one.drive - drive) / V for one in path])
        forces = np.array([one.F_T for one in path])
        pull = [-self.known.push @ one.lag(V * space.carried(at.rate))
                for one, at in ((modes, begin), (after, point))]  # fmt: skip
        forces += np.interp(times, [0.0, n * dt], pull)
        return Landing(n, q + w, v + w_v, point, times, forces, modes.force(a), modes.growth)

    def _space(self, system: Linearised, slips: np.ndarray) -> _Space:
        """Return shapes for these slipping blocks, from the few that are kept."""
        for one in self._spaces:
            if one.system is system and np.array_equal(one.slips, slips):
                return one
        self._spaces = [*self._spaces[1 - KEPT :], _Space(self, system, slips)]
        return self._spaces[-1]

    def _path(self, modes: _Modes, point: Point, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates (m) and their rates (m/s) on the path, held back by C and M."""
        space, V, by = modes.space, self.V, APART * dt
        system = space.system
        drive = point.drive - self.home
        v, bend = V * space.carried(point.rate), np.zeros(system.n_q)
        before = modes.creep.at(point.drive - V * by, point)
        if before is not None:
            bend = V * (space.carried(point.rate) - space.carried(before.rate)) / by
        lag = modes.lag(v, bend)
        return self._static(system, point.u_x, drive) + lag, v + modes.lag(bend)

    def _static(self, system: Linearised, u_x: np.ndarray, drive: float) -> np.ndarray:
        """Return the static state with blocks at u_x (m) and the driver at `drive` (m)."""
        q = np.zeros(system.n_q)
        q[system.held] = u_x[system.held]
        return q + system.answer(system.forces(q, drive))

    def _motion(self, state: State, modes: _Modes, point: Point) -> tuple[np.ndarray, float]:
        """Return the amplitudes of the modes, and the energy of what is left, J."""
        q, v = self._path(modes, point, state.dt)
        w = self.known.coordinates(state.y[:, :2], state.rod[:3]) - q
        return modes.split(w, self.known.coordinates(state.y[:, 2:], state.rod[3:]) - v)


class _Space:
    """What motions of the slider are made of while the same blocks slip, wherever they are.

    Attributes:
        system: the slider with all blocks held that are not open.
        slips: the blocks that slip, shape (n,).
        shapes: static shapes of their slips, shape (n_q, n).
        rows: stiffness of these blocks, shape (n, n_q), and with the shapes, (n, n), in N/m.
    """

    def __init__(self, what: Creeping, system: Linearised, slips: np.ndarray) -> None:
        self.M, self.C, self.system, self.slips = what.mass, what.C, system, slips
        self.shapes = system.moved(slips)
        self.rows = system.K[slips]
        self.on_shapes = self.rows @ self.shapes

    def carried(self, rate: np.ndarray) -> np.ndarray:
        """Return dq/d(drive), shape (n_q,), where blocks slip at these rates."""
        return self.system.drift + self.shapes @ rate[self.slips]

    @functools.cached_property
    def basis(self) -> np.ndarray:
        """Shapes with all blocks held and static shapes of slips, shape (n_q, r)."""
        return orthonormal(np.hstack([self.system.B, self.shapes]), self.M)

    @functools.cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness without that of blocks that slip, and damping, in the basis, (r, r)."""
        basis, force = self.basis, self.system.K @ self.basis
        force[self.slips] = 0.0
        return basis.T @ force, basis.T @ (self.C @ basis)


class _Modes:
    """Slow motions about a static state in which blocks slip.

    They are sought among the modes of the slider with all blocks held and the static shapes of the
    slips (Galerkin's way); friction makes the stiffness unsymmetric.
    """

    def __init__(self, scene: Scene, space: _Space, creep: Creep, point: Point) -> None:
        self.scene, self.space, self.system, self.creep = scene, space, space.system, creep
        self.M, self.C, self.K, self.slips = space.M, space.C, space.system.K, space.slips
        mu, slope = creep.friction(point.u_x)
        self.weakens = (slope * point.p)[self.slips]
        self.rubs = (creep.way * mu * creep.k_f)[self.slips]

    def friction(self, w: np.ndarray) -> np.ndarray:
        """Return what friction adds to forces against slip, (n, ...), in N, where w, (n_q, ...)."""
        at, above = w[self.slips], w[self.slips + self.scene.N_x]
        return (self.weakens * at.T - self.rubs * above.T).T

    def lag(self, v: np.ndarray, a: float | np.ndarray = 0.0) -> np.ndarray:
        """Return how far a motion at v (m/s) and a (m/s^2) is held back, shape (n_q,), in m."""
        system, space, force = self.system, self.space, -(self.C @ v + self.M * a)
        w = system.answer(force)
        left = force[self.slips] - space.rows @ w - self.friction(w)
        against = space.on_shapes + self.friction(space.shapes)
        return w + space.shapes @ np.linalg.solve(against, left)

    def split(self, w: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the amplitudes of the modes in a deviation, and the energy of what is left, J."""
        self._find()
        y, u = (self.basis.T @ (self.M * one) for one in (w, v))
        a = np.linalg.solve(self.right, np.concatenate([y, u]))
        w, v = w - self.basis @ y, v - self.basis @ u
        return a, max(float(v @ (self.M * v) + w @ (self.K @ w)) / 2, 0.0)

    def _find(self) -> None:
        """Find rates (1/s) and modes (2 r, 2 r) in the basis, (n_q, r), of the space."""
        self.basis = basis = self.space.basis
        K, C = self.space.matrices
        K = K + basis[self.slips].T @ (self.space.rows @ basis + self.friction(basis))
        r = basis.shape[1]
        both = np.block([[np.zeros((r, r)), np.eye(r)], [-K, -C]])
        self.rates, self.right = np.linalg.eig(both)
        self.growth = self.system.stepped(self.rates)

    def deviation(self, a: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return w (m) and w' (m/s) of modes of amplitude a a time s (s) later, shape (n_q,)."""
        y = (self.right @ (a * np.exp(self.growth * s))).real
        r = self.basis.shape[1]
        return self.basis @ y[:r], self.basis @ y[r:]

    def force(self, a: np.ndarray) -> np.ndarray:
        """Return what modes of amplitude a add to F_T, each, in N."""
        r = self.basis.shape[1]
        return -(self.system.solver.push @ self.basis) @ self.right[:r] * a

    def safe(self, path: list[Point], V: float, a: np.ndarray, left: float, dt: float) -> float:
        """Return how long (s) no contact state can change along a path.

        Args:
            path: static states.
            V: speed of the driver, in m/s.
            a: amplitudes of the modes at its start.
            left: energy of what the modes leave out, in J.
            dt: resolution, in s.
        """
        unit = np.array([1.0, 1.0, V, 1.0])[:, None]
        way = np.array([one.drive - path[0].drive for one in path])
        if not way[-1] > 0:
            return 0.0
        margins = np.array([(one.margins[:4] * unit).ravel() for one in path])
        some = np.isfinite(margins[0])
        margins = margins[:, some] - self._bounds()[some] * math.sqrt(left)
        lags = [self._lagging(one, V)[some] for one in (path[0], path[-1])]
        margins += lags[0] + np.outer(way / way[-1], lags[1] - lags[0])
        none = np.zeros_like(self.basis)
        modal = np.hstack([self._on_margins(self.basis, none), self._on_margins(none, self.basis)])
        modal = (modal[some] @ self.right) * a
        for n, (begin, length) in enumerate(zip(way / V, np.diff(way) / V, strict=False)):
            if length <= 0:
                continue
            rate = (margins[n + 1] - margins[n]) / length
            here = modal * np.exp(self.growth * begin)
            s = first_crossing(margins[n], rate, here, self.growth, length, dt)
            if s < length:
                return begin + s
        return way[-1] / V

    def _lagging(self, point: Point, V: float) -> np.ndarray:
        """Return what viscosity adds to the margins where the path is at a point, (4 N_x,)."""
        v = V * self.space.carried(point.rate)
        added = self._on_margins(self.lag(v), v)
        added[2 * self.scene.N_x : 3 * self.scene.N_x] = 0.0  # the path knows its speeds of slip
        return added

    def _on_margins(self, w: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return what w (m) and w' = v (m/s), (n_q, ...), add to margins, knots aside."""
        N_x, up = self.scene.N_x, (slice(None), *(w.ndim - 1) * [None])
        lift = self.creep.k_f[up] * w[N_x : 2 * N_x]
        strength = (self.scene.law.hold(-1.0) * lift.T).T
        force = self.K[:N_x] @ w + self.C[:N_x] @ v
        speed = self.creep.way[up] * v[:N_x]
        gap = np.where(self.creep.closed[up], -lift, lift)
        return np.concatenate([strength + force, strength - force, speed, gap])

    def _bounds(self) -> np.ndarray:
        """Return what a motion of energy E does to those margins at most, over sqrt(E)."""
        N_x, k_f, hold = self.scene.N_x, self.creep.k_f, self.scene.law.hold(1.0)
        C = self.C[:N_x]
        stiff = hold**2 * k_f + self.K.diagonal()[:N_x] + C.multiply(C) @ (1 / self.M)
        return np.sqrt(2 * np.concatenate([stiff, stiff, 1 / self.M[:N_x], k_f]))
