"""Jumps over stable slip in the hybrid engine, in linear geometry.

If friction weakens over a slip length, blocks near the driver slip stably long before an event,
more slowly than the driver. The run jumps along static states with slip (`pyfric.statics.creep`) to
the last step before a contact state can change. There it continues with velocity V dq/d(drive).

The slider also oscillates about this path. The deviation w from the path obeys

    M w'' + C w' + K w = 0 ,

where K contains the friction and the weakening of the slipping blocks and is unsymmetric.

The slow modes are computed in a space spanned by the shapes of `space`, with all blocks in contact
held, and the static responses to the slips. The truncated part must be smaller than the accuracy
divided by N_x. No block may reverse during the jump, because a block that stops has its full
strength again. Therefore each slip speed minus the amplitudes of all modes must stay positive. If
no block reverses, friction depends on the slip alone, and the deviation has no lasting effect.

Viscosity makes the slider lag behind the path; the lag is included. The inertia of a curved path is
of order sqrt(k m) v at a slip speed v. The path is left when this force exceeds `INERTIA` times the
accuracy divided by N_x, which happens just before slip becomes unstable.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.engines.crossing import first_crossing
from pyfric.engines.jump import Wait, steps_to_fall
from pyfric.statics import ContactProblem, Creep, creeps, ends, extended

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core import State
    from pyfric.engines.modes import Modes
    from pyfric.scene import Scene
    from pyfric.statics import Point, StaticSolver

INERTIA = 200.0
"""Largest sqrt(k m) v at a slip speed v, over the accuracy of forces divided by N_x. Fitted: with
500, and ten times the truncated part, forces of a slider of 9 x 6 blocks are off by 1.2e-4 F_N
after a system-size event, which amplifies differences."""
APART = 16
"""Steps between the two states of the path whose difference gives its acceleration."""
KEPT = 3
"""Sets of slipping blocks whose shapes are kept. Each needs as much memory as a linearised
slider."""


class Landing(NamedTuple):
    """End of a jump, and its loading curve.

    Attributes:
        n: number of steps.
        q, v: coordinates (m) and their rates (m/s), shape (n_q,).
        point: the static state there.
        times, forces: times since the jump began (s), and F_T along the path (N).
        modal, growth: amplitudes of the modes in F_T (N), and their rates (1/s).
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
    """

    def __init__(self, scene: Scene, known: StaticSolver, accuracy: float) -> None:
        self.scene, self.known, self.force = scene, known, accuracy / scene.N_x
        self._spaces: list[_SlipSpace] = []

    @functools.cached_property
    def problem(self) -> ContactProblem:
        """The condensed slider."""
        return ContactProblem(self.scene, self.known.u_drv0)

    @property
    def home(self) -> float:
        """Position of the driver of `problem` at drive = 0, in m."""
        return self.scene.d * float(np.mean(self.known.u_drv0))

    @staticmethod
    def possible(scene: Scene, geometry: str) -> bool:
        """Whether jumps are possible: in linear geometry, with friction that falls with slip."""
        return geometry == "linear" and creeps(scene.law)

    def speed(self, t: float) -> float:
        """Return the speed (m/s) of the driver, or 0 if no jump is possible from t (s) on.

        The driver has to move forward at a constant speed under the loads at t = 0.
        """
        V, F_N, T = (self.scene.piece(what, t) for what in ("V", "F_N", "T"))
        steady = V.slope == F_N.slope == T.slope == 0
        same = self.scene.load_at(0.0) in (None, (F_N.value, T.value))
        return max(V.value, 0.0) if steady and same else 0.0

    def land(self, state: State, V: float, held: Callable[[], Modes], last: int) -> Landing | Wait:
        """Return the end of a jump over stable slip, or how long to wait.

        If the truncated part is too large, it has to decay, at the rate at which it now does. No
        wait is known where slip is about to become unstable.

        Args:
            state: the present state.
            V: speed of the driver, in m/s, > 0.
            held: function that returns the modes with all blocks in contact held.
            last: number of the last step that the jump may reach.
        """
        kink, dt = self.force / (math.sqrt(self.scene.slider.k * self.scene.m) * V), state.dt
        fastest = INERTIA * kink
        drive = self.scene.drive(state.t) + self.home
        way = np.where(np.abs(state.mode) == 1, state.mode, 0)
        creep = Creep(self.problem, state.y[0, 0], way, state.mode != OPEN, state.s_0)
        begin = creep.at(drive)
        if begin is None or creep.wrong(begin, fastest) is not None:
            return Wait(0)
        space = self._space(held(), np.flatnonzero(way))
        modes = _Modes(self.scene, space, creep, begin)
        q, v = self._path(modes, begin, V, dt)
        w = self.known.coordinates(state.y[:, :2], state.rod[:3]) - q
        a, left, decay = modes.split(w, self.known.coordinates(state.y[:, 2:], state.rod[3:]) - v)
        times = math.sqrt(2 * self.scene.slider.k * left) / self.force
        if times > 1:
            return Wait(steps_to_fall(times, decay * dt))
        end = drive + (last - state.step) * V * dt
        path, _ = creep.follow(begin, end, fastest, kink)
        n = math.floor(modes.safe(path, V, a, left, dt) / dt)
        point = creep.on(path, drive + n * V * dt)
        if n < 1 or point is None:
            return Wait(0)
        after = _Modes(self.scene, space, creep, point)
        q, v = self._path(after, point, V, dt)
        w, w_v = modes.deviation(a, n * dt)
        times = np.array([(point.drive - drive) / V for point in path])
        forces = np.array([point.F_T for point in path])
        pull = [-self.known.push @ modes.lag(V * space.carried(at.rate))
                for modes, at in ((modes, begin), (after, point))]  # fmt: skip
        forces += np.interp(times, [0.0, n * dt], pull)
        return Landing(n, q + w, v + w_v, point, times, forces, modes.force(a), modes.growth)

    def _space(self, held: Modes, slips: np.ndarray) -> _SlipSpace:
        """Return the shapes for these slipping blocks; the last `KEPT` sets are kept."""
        for space in self._spaces:
            if space.held is held and np.array_equal(space.slips, slips):
                return space
        self._spaces = [*self._spaces[1 - KEPT :], _SlipSpace(held, slips)]
        return self._spaces[-1]

    def _path(
        self, modes: _Modes, point: Point, V: float, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates (m) and rates (m/s) on the path, with the lag due to C and M."""
        space, by = modes.space, APART * dt
        system = space.system
        drive = point.drive - self.home
        v, bend = V * space.carried(point.rate), np.zeros(system.n_q)
        before = modes.creep.at(point.drive - V * by, point)
        if before is not None:
            bend = V * (space.carried(point.rate) - space.carried(before.rate)) / by
        lag = modes.lag(v, bend)
        q = np.zeros(system.n_q)
        q[system.held] = point.u_x[system.held]
        return q + system.answer(system.forces(q, drive)) + lag, v + modes.lag(bend)


class _SlipSpace:
    """Shapes in which the slider moves while the same blocks slip.

    Attributes:
        held: the modes with all blocks in contact held.
        system: static solutions of the slider with these blocks held.
        slips: the blocks that slip, shape (n,).
        shapes: static responses to unit slips of these blocks, shape (n_q, n).
        rows: rows of the stiffness matrix for these blocks, shape (n, n_q), in N/m.
        on_shapes: `rows` times `shapes`, shape (n, n), in N/m.
    """

    def __init__(self, held: Modes, slips: np.ndarray) -> None:
        self.held, self.system, self.slips = held, held.space, slips
        self.shapes = self.system.moved(slips)
        self.rows = self.system.K[slips]
        self.on_shapes = self.rows @ self.shapes

    def carried(self, rate: np.ndarray) -> np.ndarray:
        """Return dq/d(drive), shape (n_q,), if blocks slip at these rates per drive."""
        return self.system.drift + self.shapes @ rate[self.slips]

    @functools.cached_property
    def basis(self) -> np.ndarray:
        """Basis of the shapes with blocks held and the static responses, shape (n_q, r)."""
        return extended(self.system.B, self.shapes, self.system.M)

    @functools.cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness without the rows of slipping blocks, and damping, in the basis, (r, r)."""
        basis, force = self.basis, self.system.K @ self.basis
        force[self.slips] = 0.0
        return basis.T @ force, basis.T @ (self.system.C @ basis)


class _Modes:
    """Slow modes about a static state in which blocks slip.

    They are Galerkin approximations in the basis of `_SlipSpace`. Friction makes the stiffness
    unsymmetric.
    """

    def __init__(self, scene: Scene, space: _SlipSpace, creep: Creep, point: Point) -> None:
        self.scene, self.space, self.system, self.creep = scene, space, space.system, creep
        self.M, self.C, self.K = self.system.M, self.system.C, self.system.K
        self.slips = space.slips
        mu, slope = creep.friction(point.u_x)
        self.weakens = (slope * point.p)[self.slips]
        self.rubs = (creep.way * mu * creep.k_f)[self.slips]

    def friction(self, w: np.ndarray) -> np.ndarray:
        """Return the force against slip that friction adds, (n, ...), in N, at w, (n_q, ...)."""
        at, above = w[self.slips], w[self.slips + self.scene.N_x]
        return (self.weakens * at.T - self.rubs * above.T).T

    def lag(self, v: np.ndarray, a: float | np.ndarray = 0.0) -> np.ndarray:
        """Return the lag due to velocity v (m/s) and acceleration a (m/s^2), (n_q,), in m."""
        system, space, force = self.system, self.space, -(self.C @ v + self.M * a)
        w = system.answer(force)
        left = force[self.slips] - space.rows @ w - self.friction(w)
        against = space.on_shapes + self.friction(space.shapes)
        return w + space.shapes @ np.linalg.solve(against, left)

    def split(self, w: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Find the modes; split a deviation w (m) with rate v (m/s), shape (n_q,).

        Return the amplitudes of modes, the truncated energy (J), and the decay rate of the
        truncated amplitudes (1/s). The modes `right`, (2 r, 2 r), are in the basis of the space,
        (n_q, r); their rates `growth`
        are in 1/s.
        """
        self.basis = basis = self.space.basis
        K, C = self.space.matrices
        K = K + basis[self.slips].T @ (self.space.rows @ basis + self.friction(basis))
        r = basis.shape[1]
        both = np.block([[np.zeros((r, r)), np.eye(r)], [-K, -C]])
        rates, self.right = np.linalg.eig(both)
        self.growth = self.space.held.stepped(rates)
        y, u = (basis.T @ (self.M * part) for part in (w, v))
        a = np.linalg.solve(self.right, np.concatenate([y, u]))
        w, v = w - basis @ y, v - basis @ u
        kinetic = float(v @ (self.M * v))
        decay = float(v @ (self.C @ v)) / (2 * kinetic) if kinetic > 0 else 0.0
        return a, max(kinetic + float(w @ (self.K @ w)), 0.0) / 2, decay

    def deviation(self, a: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return w (m) and w' (m/s), shape (n_q,), after a time s (s), from amplitudes a."""
        y = (self.right @ (a * np.exp(self.growth * s))).real
        r = self.basis.shape[1]
        return self.basis @ y[:r], self.basis @ y[r:]

    def force(self, a: np.ndarray) -> np.ndarray:
        """Return the contribution to F_T of each mode with amplitudes a, in N."""
        r = self.basis.shape[1]
        return -(self.system.solver.push @ self.basis) @ self.right[:r] * a

    def safe(self, path: list[Point], V: float, a: np.ndarray, left: float, dt: float) -> float:
        """Return the time (s) for which no contact state can change along a path.

        Args:
            path: static states.
            V: speed of the driver, in m/s.
            a: amplitudes of the modes at the start of the path.
            left: energy of the truncated part, in J.
            dt: resolution, in s.
        """
        unit = np.array([1.0, 1.0, V, 1.0])[:, None]
        way = np.array([point.drive - path[0].drive for point in path])
        if not way[-1] > 0:
            return 0.0
        margins = np.array([(point.margins[:4] * unit).ravel() for point in path])
        watched = np.isfinite(margins[0])
        margins = margins[:, watched] - self._bounds()[watched] * math.sqrt(left)
        lags = [self._lagging(point, V)[watched] for point in (path[0], path[-1])]
        margins += lags[0] + np.outer(way / way[-1], lags[1] - lags[0])
        none = np.zeros_like(self.basis)
        modal = np.hstack([self._on_margins(self.basis, none), self._on_margins(none, self.basis)])
        modal = (modal[watched] @ self.right) * a
        for n, (begin, length) in enumerate(zip(way / V, np.diff(way) / V, strict=False)):
            if length <= 0:
                continue
            rate = (margins[n + 1] - margins[n]) / length
            waves = modal * np.exp(self.growth * begin)
            s = first_crossing(margins[n], rate, waves, self.growth, length, dt)
            if s < length:
                return begin + s
        return way[-1] / V

    def _lagging(self, point: Point, V: float) -> np.ndarray:
        """Return the change of the gap functions by the viscous lag at a point, (4 N_x,)."""
        v = V * self.space.carried(point.rate)
        added = self._on_margins(self.lag(v), v)
        added[2 * self.scene.N_x : 3 * self.scene.N_x] = 0.0  # the path has its slip speeds
        return added

    def _on_margins(self, w: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the change of the gap functions by w (m) and w' = v (m/s), (n_q, ...).

        The fifth group of gap functions, for knots of the friction law, is left out.
        """
        bottom, up = ends(self.scene.N_x), (slice(None), *(w.ndim - 1) * [None])
        lift = self.creep.k_f[up] * w[bottom.u_z]
        strength = (self.scene.law.hold(-1.0) * lift.T).T
        force = self.K[bottom.u_x] @ w + self.C[bottom.u_x] @ v
        speed = self.creep.way[up] * v[bottom.u_x]
        gap = np.where(self.creep.closed[up], -lift, lift)
        return np.concatenate([strength + force, strength - force, speed, gap])

    def _bounds(self) -> np.ndarray:
        """Return the largest change of those gap functions by energy E, over sqrt(E)."""
        N_x, k_f, hold = self.scene.N_x, self.creep.k_f, self.scene.law.hold(1.0)
        C = self.C[:N_x]
        stiff = hold**2 * k_f + self.K.diagonal()[:N_x] + C.multiply(C) @ (1 / self.M)
        return np.sqrt(2 * np.concatenate([stiff, stiff, 1 / self.M[:N_x], k_f]))
