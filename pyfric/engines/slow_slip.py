"""Rate-and-state friction between ruptures: quasi-static elasticity, without inertia.

Elasticity is linear, and the slider is condensed onto its interface (`pyfric.statics`). Friction
then gives the speed of each block from the load on it and from its state:

    p_i(u, v, t) a asinh( v_i/(2V*) exp((f* + b psi_i)/a) ) + alpha v_i = tau_i(u, v, t) ,
    du_i/dt = v_i ,   d(ln theta_i)/dt by the evolution law ,

2 N_x equations. An implicit method of order 5 advances them, for seconds or years alike
(pyfric_slow_slip in Fortran). In finite geometry they are those of linear geometry, with the static
state in which a phase begins. The viscosity of bonds acts to first order (`viscosity`).

`RateHybridRun` hands over to full dynamics where inertia is no longer small: where the sum over
columns of M/N_x |dv_i/dt| reaches the accuracy times F_N. It returns when the sum of |m a| over all
blocks is below that again. Both directions keep u, v and theta of the interface. The rest of the
slider is then in its static state for these u, or moves with its rates.

Source of the equations: J. R. Rice, J. Geophys. Res. 98, 9885 (1993), without radiation damping.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines.dynamic import Run
from pyfric.engines.integration import just_after
from pyfric.statics import ContactProblem, Route, Values, ends, table_rows

if TYPE_CHECKING:
    from pyfric.scene import Scene
    from pyfric.statics import StaticSolver

LOOK = 200
"""Steps of full dynamics between two looks at inertia."""
SLOW_STEPS, SLOW_POINTS, SLOW_WORK = 1000, 1000, 4e8
"""Most slow steps, points of the curve, and steps times N_x^3 between two looks at Ctrl-C."""
OF_STEP = 0.01
"""Error of a slow step over the accuracy, as some hundred steps lead to an event."""
COLUMNS = 64
"""Columns of a solution with many right sides, for memory."""
MOVED = 5e-3
"""Displacement over which velocities of the slider are differences, over D_c (rounding)."""


class Interface(NamedTuple):
    """The condensed slider with the time s since a state, in s, whose blocks in contact are held.

    Attributes:
        load: load on each block along +x, in N: its value, its rate and the rate of that, shape
            (N_x, 3), and its matrix over the displacements since that state, shape (N_x, N_x).
        p: the same for the normal force; for a block that lifted off -k_f u_z, which is negative.
        F_T: the same for the force of the driver, shapes (3,) and (N_x,).
        u: the same for u_x of all blocks, in m; blocks without contact move with the others.
    """

    load: tuple[np.ndarray, np.ndarray]
    p: tuple[np.ndarray, np.ndarray]
    F_T: tuple[np.ndarray, np.ndarray]
    u: tuple[np.ndarray, np.ndarray]

    def at(self, s: float, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Return loads, normal forces and F_T (N) at s (s) after displacements (m)."""
        powers = np.array([1.0, s, s * s / 2])
        load, p, F_T = (part[0] @ powers + part[1] @ moved for part in self[:3])
        return load, p, float(F_T)

    def moving(self, s: float, moved: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u_x (m) and v_x (m/s) of all blocks, from those of the blocks in contact."""
        values, over = self.u
        u_x = values @ np.array([1.0, s, s * s / 2]) + over @ moved
        return u_x, values @ np.array([0.0, 1.0, s]) + over @ v


def interface_at(
    scene: Scene, known: StaticSolver, u_x: np.ndarray, closed: np.ndarray, t: float
) -> Interface:
    """Return the condensed slider about its static state at u_x (m) and t (s)."""
    V, F_N, T = (scene.piece(what, t) for what in ("V", "F_N", "T"))
    drive, load = scene.drive(t), (F_N.at(t), T.at(t))
    at = known.solve(u_x, drive, free=~closed, load=load if scene.load_at(t) else None)
    now = Values(at.u[0, 0], at.f, at.u[0, 1], at.p, at.F_T)
    home = scene.d * float(np.mean(known.u_drv0))
    k_f = np.broadcast_to(scene.k_f, closed.shape) * scene.touches
    rows = table_rows(scene.N_x)
    ways = ((V.at(t), (F_N.slope, T.slope)), (V.slope, (0.0, 0.0)))  # of driver and loads, in time
    rates = []
    for way, gain in ways:
        route = Route(drive + home, way, load, gain)
        table = ContactProblem(scene, known.u_drv0).along(route).corrected(now, 0.0).base(closed)
        table = free_to_move(table, ~closed)
        rates.append(table[:, rows.given.start])
    held, rate = table[:, rows.u_x], np.column_stack(rates)
    p = np.where(closed, at.p, -k_f * at.u[0, 1])
    return Interface(
        (np.column_stack([-at.f, -rate[rows.f]]), -held[rows.f]),
        (
            np.column_stack([p, -k_f[:, None] * rate[rows.u_z]]),
            -k_f[:, None] * held[rows.u_z],
        ),
        (np.array([at.F_T, *rate[rows.F_T]]), held[rows.F_T]),
        (np.column_stack([at.u[0, 0], rate[rows.u_x]]), held[rows.u_x]),
    )


def free_to_move(table: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return a table (`ContactProblem.base`) in which free blocks move as f = 0 lets them."""
    columns, rows = np.flatnonzero(free), table_rows(len(free))
    if not columns.size:
        return table
    f = table[rows.f][columns]
    moved = -np.linalg.solve(f[:, columns], f)
    moved[:, columns] = 0.0
    other = table.copy()
    other[:, columns] = 0.0
    other += table[:, columns] @ moved
    other[rows.f][columns] = 0.0
    return other


def viscosity(known: StaticSolver, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of load and normal force over velocities, (N_x, N_x), in N s/m.

    The slider moves as static states do, q = G u. Its bonds then take the forces C G v, from which
    its inner coordinates w differ by -K_ww^-1 (C G v)_w. To first order in eta, the load changes by
    -G' C G v.
    """
    mode = np.where(closed, STUCK, OPEN)
    inside, at, N_x = known.unknown(mode), np.flatnonzero(closed), len(closed)
    at_load = known.coordinates(known.loaded.u, known.loaded.rod)
    K, C = known.tangents(mode), known.damping(at_load)
    inner = known.factor(mode, driven=True)
    load, p = np.zeros((N_x, N_x)), np.zeros((N_x, N_x))
    outward = K[at][:, inside]
    k_f = np.broadcast_to(known.scene.k_f, N_x) * closed
    for part in np.array_split(at, -(-len(at) // COLUMNS)):
        q = np.zeros((K.shape[0], len(part)))
        q[part, range(len(part))] = 1.0
        q[inside] = -inner.solve(K[inside][:, part].toarray())
        taken = C @ q
        q[inside] = inner.solve(taken[inside])
        load[np.ix_(at, part)] = outward @ q[inside] - taken[at]
        p[:, part] = k_f[:, None] * q[ends(N_x).u_z]
    return load, p


def is_bursting(fast: np.ndarray) -> bool:
    """Return whether a block is fast that became so with contact; see `core.Log`."""
    return bool(((fast[0] != 0) & (fast[1] == 0)).any())


class RateHybridRun(Run):
    """A run that steps through ruptures, and leaves out inertia between them."""

    name = "hybrid"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.made |= {"jumps": 0, "steps_spared": 0, "slow_steps": 0}
        self.worth = self.state.step  # the step at which inertia is looked at next
        if not (self.state.sub or self.state.since):
            self.worth += -self.worth % LOOK
        self.viscous: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        self.limit = self.method.accuracy * self.scene.F_N

    def call_length(self) -> int:
        """Return how many steps may be made before the next look at inertia."""
        return max(1, self.worth - self.state.step)

    def before_call(self, last: int) -> None:
        """Leave out inertia while it is small."""
        state = self.state
        while state.step < last and state.step >= self.worth and not self.ending:
            begin = state.step
            again = not (np.abs(state.mode) == 1).any() and self.inertia() < self.limit
            if not ((state.since or again) and self.slip(last)):
                state.sub = 0.0
                self.worth = state.step + LOOK - state.step % LOOK
            if state.step > begin:
                return

    def inertia(self) -> float:
        """Return the sum of |m a| over blocks and rod, in N."""
        found = core.evaluate(self.model, self.state, self.state.t)
        rows, columns = self.scene.shares
        force = self.scene.m * float(np.abs(rows[:, None, None] * columns * found.a).sum())
        return force + self.scene.M_rod * float(np.abs(found.a_rod[:2]).sum())

    def slip(self, last: int) -> bool:
        """Leave out inertia up to step `last` at most; return whether that may go on.

        No slow step is shortened to end at `last`. A run that goes on from there repeats the slow
        steps of this phase, so that it has the bits of the whole run.
        """
        state, scene, law, N_x = self.state, self.scene, self.scene.law, self.scene.N_x
        every, closed, cut = self.method.sample, state.mode != OPEN, self._moving()
        done, phase = state.since, state.phase
        state.out_of_phase()
        last, text = self._due(self.piece_ends(last))
        if last <= state.step:
            return False
        if done:
            self._put_back(state.step - done, phase)
        first = every - state.step % every
        n_end = min(first + (SLOW_POINTS - 1) * every, self.piece_ends(sys.maxsize) - state.step)
        n_last = min(last - state.step, n_end)
        points = np.arange(first, n_last + 1, every)
        interface = interface_at(scene, self.known, state.y[0, 0], closed, just_after(state))
        tolerance, unit = OF_STEP * self.method.accuracy, scene.F_N / N_x
        of_column = (scene.M_rod + scene.slider.M) / N_x  # kg
        limits = core.SlowLimits(
            end=n_end * state.dt,
            dt=state.dt,
            relative=tolerance,
            u=tolerance * unit / float(np.abs(np.diag(interface.load[1])).max()),
            log_theta=tolerance / float(np.max(law.b + law.a)),
            inertia=self.limit / of_column,
            speed=law.kind.v_slip,
            last=n_last * state.dt,
            steps=int(min(max(SLOW_WORK / N_x**3, 10), SLOW_STEPS)),
        )
        self._follow(just_after(state))
        found = core.slow_slip(
            self.model,
            *interface[:2],
            np.log(state.theta),
            limits,
            viscous=self.viscosity(closed),
            closed=closed,
            times=points * state.dt,
            h=state.sub,
            threshold=self.method.threshold or 0.0,
            fast=self.log.fast[0],
        )
        self.made["slow_steps"] += found.steps
        n = round(found.t / state.dt)
        if n < done:  # on a processor that rounds in another way
            self._put_back(state.step + done, cut)
            return self.slip(last)
        self._sample_slip(interface, points, found.points, done)
        if n:
            if self.method.threshold:
                self._log_passages(interface, found, n, done)
            begin = self._moving()
            self._put(found, closed, n)
            self.made["steps_spared"] -= done
            if found.goes_on and n == n_last < n_end:
                state.phase, state.since = begin, n
            else:
                state.sub = found.h
        if text and state.step == last:
            self.ending = self.stopping.named(text)
        return found.goes_on and n > 0

    def viscosity(self, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what `viscosity` returns, which is kept."""
        key = closed.tobytes()
        if key not in self.viscous:
            self.viscous = {key: viscosity(self.known, closed)}
        return self.viscous[key]

    def _moving(self) -> np.ndarray:
        """Return u_x (m), theta (s) and v_x (m/s) of the interface, shape (3, N_x)."""
        return np.array([self.state.y[0, 0], self.state.theta, self.state.y[0, 2]])

    def _put_back(self, step: int, moving: np.ndarray) -> None:
        """Set the interface to what `_moving` returned at this step."""
        self.state.step = step
        self.state.y[0, 0], self.state.theta[:], self.state.y[0, 2] = moving
        if self.method.threshold:
            self.log = self.new_log()

    def _due(self, last: int) -> tuple[int, str]:
        """Return the step at which a condition ends the run if none slips, and its text.

        The run ends at a point of the curve. If that is beyond step `last`, it and "" are returned.
        """
        if self.stopping is None:
            return last, ""
        self.look()
        state, every = self.state, self.method.sample
        due, text = self.stopping.due()
        if due > state.t0 + last * state.dt:
            return last, ""
        points = max(state.step // every + 1, math.ceil((due - state.t0) / state.dt / every))
        return (points * every, text) if points * every <= last else (last, "")

    def _sample_slip(
        self, interface: Interface, steps: np.ndarray, points: np.ndarray, done: int
    ) -> None:
        """Add points of the curve after these numbers of steps of a phase, beyond `done`."""
        state, known = self.state, np.count_nonzero(steps <= done)
        for n, (moved, log_theta, v) in zip(steps[known:].tolist(), points[known:], strict=False):
            load, _, F_T = interface.at(n * state.dt, moved)
            self.history.add(np.array([[state.t0 + (state.step + n) * state.dt, F_T]]))
            u_x, v_x = interface.moving(n * state.dt, moved, v)
            self.add_motion({"theta": np.exp(log_theta), "u_x": u_x, "v_x": v_x, "f": -load})

    def _log_passages(self, interface: Interface, found: core.SlowSlip, n: int, done: int) -> None:
        """Log passages through the threshold in steps of a phase, and fast slip, up to step n.

        Those of the first `done` steps are in the logs.
        """
        state, N_x = self.state, self.scene.N_x
        fast, peak, last = self.log.fast, self.log.speeds[-1], 0.0
        ends = np.array([done, n]) * state.dt
        known, count = np.searchsorted(found.passed_at[:, 0], ends, side="right")
        log = core.Log(N_x, max(count, 1), max(count, 1), 0, self.method.threshold)

        def largest(begin: float, end: float) -> float:
            t, sums = found.sums.T
            return float(sums[(begin <= t) & (t <= end)].max(initial=0.0))

        bursting = is_bursting(fast)
        for number in range(count):
            (i, new), (s, p, *moved) = found.passed[number], found.passed_at[number]
            u_x, old = interface.moving(s, np.array(moved), np.zeros(N_x))[0], fast[0, i]
            step, t, fast[0, i] = state.step + math.ceil(s / state.dt), state.t + s, new
            if old == 0:
                fast[1, i] = p < core.CORNER_SHARE * self.scene.F_N / N_x
            if number >= known:
                log.crossing_i[:, log.n_crossing] = i, old, new, fast[1, i]
                log.crossing_r[:, log.n_crossing] = step, t, u_x[i], p
                log.n_crossing += 1
            if bursting:
                peak, last = max(peak, largest(last, s)), s
            if is_bursting(fast) != bursting:
                bursting, last = not bursting, s
                F_T = interface.at(s, np.array(moved))[2]
                row = log.burst_r[:, log.n_burst]
                row[:3], row[-1] = (step, t, F_T), 0.0 if bursting else peak
                row[2 + core.POINT : -1] = u_x
                log.burst_i[:, log.n_burst] = 1 if bursting else -1, *state.mode
                log.n_burst, peak = log.n_burst + (number >= known), 0.0
        self.log.speeds[N_x] = max(peak, largest(last, n * state.dt)) if bursting else peak
        if count > known:
            self._add_logs({"crossings": log.crossings(), "bursts": log.bursts()})

    def _put(self, found: core.SlowSlip, closed: np.ndarray, n: int) -> None:
        """Set the state to that after n steps of a phase."""
        state, scene, v = self.state, self.scene, found.v
        u_x = state.y[0, 0] + found.u
        state.theta[:] = np.exp(found.log_theta)
        state.step += n
        t, fastest = just_after(state), float(np.abs(v).max())
        fastest = max(fastest, scene.driver.fastest)
        tau = MOVED * float(np.min(scene.law.D_c)) / fastest if fastest else state.dt
        now = self._at(u_x, t, ~closed, 0.0, v)
        ahead = self._at(u_x, t, ~closed, tau, v)
        state.y[:, :2], state.rod[:3] = now
        state.y[:, 2:], state.rod[3:] = (ahead[0] - now[0]) / tau, (ahead[1] - now[1]) / tau
        if scene.rigid:
            X, Z, phi = state.rod[3:]
            state.y[-1, 2], state.y[-1, 3] = X, Z + phi * scene.x
        state.y[0, 0, closed], state.y[0, 2, closed] = u_x[closed], v[closed]
        state.margin[:] = scene.law.kind.v_slip - np.abs(v)
        self.log.speeds[: scene.N_x] = v
        self.good = None
        self.made["jumps"] += 1
        self.made["steps_spared"] += n

    def _at(
        self, u_x: np.ndarray, t: float, free: np.ndarray, s: float, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return displacements and rod (m) of the static state s (s) after t (s)."""
        scene = self.scene
        drive, load = scene.drive(t) + scene.piece("V", t).at(t) * s, scene.load_at(t)
        found = self.known.solve(u_x + v * s, drive, free=free, load=load)
        return found.u, found.rod
