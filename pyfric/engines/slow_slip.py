"""Slow slip as a skip: rate-and-state friction between ruptures, without inertia.

Elasticity is linear about a static state, and the slider is condensed onto its interface
(`Linearised`). Friction then gives the speed of each block from its load and its state:

    p_i(u, v, t) a asinh( v_i/(2V*) exp((f* + b psi_i)/a) ) + alpha v_i = tau_i(u, v, t) ,
    du_i/dt = v_i ,   d(ln theta_i)/dt by the evolution law .

An implicit method of order 5 advances these 2 N_x equations over seconds or years
(pyfric_slow_slip in Fortran). Viscosity of bonds and inertia act to first order. In finite geometry
a phase ends where its loads differ from those of static states. The next phase is linear about its
own beginning.

`SlowSlip` hands over to full dynamics where loads due to inertia are no longer small. It takes over
again after a rupture, when the slip due to remaining waves is known and its effect on loads is
small (`Waves.effect`). Both transitions keep u, v and theta of the interface. After a phase, the
rest of the slider is in its static state for these u, with the lag by viscosity and inertia.

Source of the equations: J. R. Rice, J. Geophys. Res. 98, 9885 (1993), without radiation damping.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from pyfric import core
from pyfric.core import OPEN
from pyfric.engines.grid import just_after, piece_ends
from pyfric.engines.linearised import Interface, Linearised, after
from pyfric.engines.path import Outside
from pyfric.engines.skip import Prices, Span, mostly_stepped
from pyfric.scene import RateStateLaw
from pyfric.statics import Memory, Values
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.core import State
    from pyfric.engines.guarded import GuardedSteps
    from pyfric.scene import Scene
    from pyfric.statics import Equilibrium

SPENT = 1 / 4
"""Work of a check for waves, over the work of full dynamics up to the next check."""
KEPT = 4
"""Number of sets of contact states whose linearised slider is stored."""
SLOW_STEPS, SLOW_POINTS, SLOW_WORK = 1000, 1000, 4e8
"""Largest numbers between two checks for Ctrl-C: of slow steps, of points of the curve, and of
steps times N_x^3."""
OF_STEP = 0.01
"""Error of a slow step over the accuracy. An event comes after about a hundred slow steps."""
SLIPPED, WAVES, INERTIA, BENT = 0.5, 0.05, 0.1, 0.02
"""Largest errors of loads over the accuracy: due to slip by neglected waves; due to the load of
waves when an event begins; due to inertia during slow slip; and, in finite geometry, the difference
from static states at the end of a phase. These shares are small, because the time at which a
creeping block reaches `v_slip` is sensitive to its load."""


class Phase(NamedTuple):
    """Slip without inertia that begins in a static state.

    Attributes:
        about: the slider, linear about the static state.
        interface: the condensed slider.
        at: the static state.
        found: solution of the core.
        points: number of steps from the beginning to each point of the curve.
        n_last: number of steps up to the requested end of the solution.
        n_end: number of steps up to the end of the phase.
    """

    about: Linearised
    interface: Interface
    at: Equilibrium
    found: core.SlowSlip
    points: np.ndarray
    n_last: int
    n_end: int


def values_of(at: Equilibrium) -> Values:
    """Return the interface in a static state."""
    return Values(at.u[0, 0], at.f, at.u[0, 1], at.p, at.F_T)


def is_bursting(fast: np.ndarray) -> bool:
    """Return whether a block is fast without corner slip; `fast` is `core.Log.fast`."""
    return bool(((fast[0] != 0) & (fast[1] == 0)).any())


class SlowSlip:
    """The skip over slow slip.

    Args:
        steps: steps of the run.
    """

    def __init__(self, steps: GuardedSteps) -> None:
        self.steps, self.recorder = steps, steps.recorder
        self.scene, self.method, self.known = steps.scene, steps.method, self.recorder.known
        self.law = cast(RateStateLaw, self.scene.law)
        self.recorder.made |= {"jumps": 0, "steps_spared": 0, "slow_steps": 0}
        self.limit = self.method.accuracy * self.scene.F_N
        prices, state = Prices(self.scene, self.method), steps.state
        look = prices.in_steps({"attempts": 1, "landings": 1})
        self.look_every = math.ceil(look / SPENT)
        self.shortest = 2 * self.look_every  # smallest number of steps in finite geometry
        self.least = prices.in_steps({"slow_steps": 1}) * state.dt
        self.pays = self.look_every * state.dt
        self.look_at = state.step  # step of the next check for waves
        if not (state.sub or state.since):
            self.look_at += -self.look_at % self.look_every
        self.kept: Memory[Linearised] = Memory(KEPT)

    @staticmethod
    def fits(scene: Scene) -> bool:
        """Return whether friction of a scene is a function of speed and state."""
        return isinstance(scene.law, RateStateLaw)

    @staticmethod
    def check(scene: Scene) -> None:
        """Raise SceneError for a scene with gaps, in which slow slip is not computed."""
        if np.any(scene.gap):
            reason = "steps without inertia between events leave gaps out"
            gap, allowed = float(np.max(scene.gap)), "0 m, or fidelity = 'dynamic'"
            raise SceneError("interface.gap", gap, "m", allowed, reason)

    def notes(self, counts: Mapping[str, int]) -> tuple[str, ...]:
        """Return a note if slow slip saved little work."""
        return mostly_stepped(
            counts,
            "slip was fast, its waves or its inertia were too large for an accuracy of "
            f"{self.method.accuracy:g} F_N, or slow steps would have taken longer",
        )

    def wait(self, state: State) -> int:
        """Return the number of steps until the next check for waves."""
        return max(self.look_at - state.step, 0)

    def span(self, state: State, last: int) -> Span | None:
        """Return a span of slip without inertia, or None if inertia or waves are too large."""
        moved = np.zeros((2, self.scene.N_x)) if state.since else self.calm()
        span = None if moved is None else self.slip(last, moved)
        if span is None:
            self._put_off(state, state.step)
        return span

    def _put_off(self, state: State, step: int) -> None:
        """Put off the next check for waves after slow slip that ended at a step."""
        state.sub = 0.0
        self.look_at = step + self.look_every - step % self.look_every

    @property
    def state(self) -> State:
        """The present state of the run."""
        return self.steps.state

    def outside(self) -> Outside:
        """Return driver and loads from the present time on."""
        return Outside(self.known, self.state.t, just_after(self.state))

    def about(self, closed: np.ndarray) -> Linearised:
        """Return the slider linearised about its loaded state, with the blocks `closed` held."""
        return self.kept.made(closed.tobytes(), lambda: Linearised(self.known, closed))

    def calm(self) -> np.ndarray | None:
        """Return the total change of the interface by waves, or None if it is not accurate.

        The change is accurate if two conditions hold. Effects of higher order on loads are below
        the accuracy. Slip stays slow until the load of waves has decayed to the accuracy.

        Returns:
            Changes of u_x (m) and ln theta, shape (2, N_x).
        """
        state, known, closed = self.state, self.known, self.state.mode != OPEN
        if (np.abs(state.mode) == 1).any() or not closed.any():
            return None
        about, outside, v = self.about(closed), self.outside(), np.abs(state.y[0, 2])
        if self.straight(about, outside) < self.shortest:
            return None
        at = known.coordinates(state.y[:, :2], state.rod[:3])
        rates = known.coordinates(state.y[:, 2:], state.rod[3:])
        p = core.evaluate(self.steps.model, state, state.t).p
        waves = about.waves(at, rates, outside, p, self.law)
        left, allowed = waves.largest / (WAVES * self.limit), SLIPPED * self.limit
        if not waves.effect(v) <= allowed or (left > 1 and not waves.decay > 0):
            return None
        lasts = max(self.pays, 2 * math.log(left) / waves.decay if left > 1 else 0.0)
        interface = about.interface(waves.rest, outside)
        limits = self.limits(interface, lasts)
        if left > 1 and self.method.threshold:  # no event may begin or end while waves last
            limits = limits._replace(speed=min(limits.speed, self.method.threshold))
        times = np.array([0.0, min(1 / waves.frequency, lasts)])
        found = self.slow(interface, closed, limits, times=times)
        if not (found.goes_on and found.t == lasts):
            return None
        first, second = found.points[:, 2]
        faster = np.maximum(np.abs(found.v), np.abs(first))
        if not waves.effect(faster, second - first) <= allowed:
            return None
        slip, weakens = waves.slip(np.abs(first)), self.law.weakening(first, state.theta)
        return np.array([slip, -slip * np.sign(first) * weakens])

    def slip(self, last: int, moved: np.ndarray) -> Span | None:
        """Return a span of slip without inertia, up to step `last` at most.

        No slow step is shortened to end at `last`. A run that continues from `last` repeats the
        slow steps of this phase, and so has the same bits as a run without interruption.
        """
        state, cut = self.state, self._moving()
        done, begin, closed = state.since, state.phase, state.mode != OPEN
        state.out_of_phase()
        ends = piece_ends(self.scene, state, last)
        end, ending = self.recorder.due(state, self.steps.model, ends)
        if end <= state.step:
            return None
        if done:
            self._put_back(state.step - done, begin)
        before = self._moving()
        state.y[0, 0] += moved[0]
        state.theta[:] *= np.exp(moved[1])
        outside = self.outside()
        phase = self.phase(closed, outside, end)
        n = 0 if phase is None else round(phase.found.t / state.dt)
        if n < done:  # another processor rounded differently
            self._put_back(state.step + done, cut)
            return self.slip(last, moved)
        if phase is None or not n:
            state.y[0, 0], state.theta[:], _ = before
            return None
        return self._span(phase, outside, n, done, ending if state.step + n == end else "")

    def _span(self, phase: Phase, outside: Outside, n: int, done: int, ending: str) -> Span:
        """Return the first n steps of a phase, of which an earlier run has recorded `done`."""
        interface, points, state = phase.interface, phase.found.points, self.state
        points = points[np.count_nonzero(phase.points <= done) :]
        by_v, _ = self.about(state.mode != OPEN).by_v

        def F_T(s: np.ndarray) -> np.ndarray:
            n = min(len(s), len(points))
            return after(interface.F_T, s[:n], points[:n, 0])

        def motion(s: np.ndarray) -> dict[str, np.ndarray]:
            u, log_theta, v = points[: len(s)].swapaxes(0, 1)
            load, (u_x, v_x) = after(interface.load, s, u), interface.moving(s, u, v)
            f = -load - (by_v @ v[..., None])[..., 0]
            return {"theta": np.exp(log_theta), "u_x": u_x, "v_x": v_x, "f": f}

        def put(state: State) -> None:
            if self.method.threshold:
                self._log_passages(interface, phase.found, n, done)
            begin = self._moving()
            self._put(phase, outside, n)
            if not phase.found.goes_on:
                self._put_off(state, state.step + n)
            elif n == phase.n_last < phase.n_end:
                state.phase, state.since = begin, n
            else:
                state.sub = phase.found.h

        return Span(n, F_T, motion, put, done=done, ending=ending)

    def phase(self, closed: np.ndarray, outside: Outside, last: int) -> Phase | None:
        """Return slip without inertia up to step `last` at most; None if it saves no work.

        The end of the phase does not depend on `last`. In finite geometry the phase is shortened
        until its loads agree with static states.
        """
        state, every = self.state, self.method.sample
        first = every - state.step % every
        whole = piece_ends(self.scene, state, sys.maxsize) - state.step
        n_end = min(first + (SLOW_POINTS - 1) * every, whole)
        known, about, bends = self.known, self.about(closed), 0.0
        at = known.solve(state.y[0, 0], outside.drive, free=~closed, load=outside.load)
        finite = known.geometry == "finite"
        if finite:
            n_end = min(n_end, self.straight(about, outside))
            q = known.coordinates(at.u, at.rod)
            about = Linearised(known, closed, q)
            bends = known.bends(q, about.answer(outside.rates()[0]))
        interface = about.interface(values_of(at), outside, bends)
        self.steps.follow()

        def made(n_last: int) -> Phase:
            points = np.arange(first, n_last + 1, every)
            found = self.slow(
                interface,
                closed,
                self.limits(interface, n_end * state.dt, n_last * state.dt),
                times=points * state.dt,
                h=state.sub,
                threshold=self.method.threshold or 0.0,
                fast=self.recorder.log.fast[0],
            )
            self.recorder.made["slow_steps"] += found.steps
            return Phase(about, interface, at, found, points, n_last, n_end)

        while finite and self.bent(phase := made(n_end), outside):
            n_end = min(n_end, round(phase.found.t / state.dt)) // 2
            if n_end < self.shortest:
                return None
        n_last = min(last - state.step, n_end)
        return phase if finite and n_last == n_end else made(n_last)

    def straight(self, about: Linearised, outside: Outside) -> int:
        """Return the number of steps during which loads are nearly linear, with held interface.

        After these steps, the second derivative of spring forces in the loaded state has changed
        loads by the share `BENT` of the accuracy.
        """
        known = self.known
        q = known.coordinates(known.loaded.u, known.loaded.rod)
        bends = known.bends(q, about.answer(outside.rates()[0]))
        bent = float(np.abs(about.loads(about.answer(-bends), -bends)[0]).sum())
        lasts = math.sqrt(2 * BENT * self.limit / bent) if bent else math.inf
        return math.ceil(min(lasts / self.state.dt, sys.maxsize))

    def bent(self, phase: Phase, outside: Outside) -> bool:
        """Return whether loads at the end of a phase differ too much from loads of a static state.

        The static state has the slip of the interface, the driver and the loads at this end.
        """
        interface, at, found = phase.interface, phase.at, phase.found
        s, u_x, free = found.t, self.state.y[0, 0] + found.u, self.state.mode == OPEN
        drive, loads = outside.drive_at(s), outside.load_at(s)
        end = self.known.solve(u_x, drive, free=free, load=loads, near=at)
        load, p, _ = interface.at(s, found.u)
        off = load - interface.load[0][:, 0] + (end.f - at.f)
        pressed = np.where(free, 0.0, p - interface.p[0][:, 0] - (end.p - at.p))
        error = np.abs(off) + self.law.mu_s * np.abs(pressed)
        return float(error.sum()) > BENT * self.limit

    def limits(self, interface: Interface, end: float, last: float = math.inf) -> core.SlowLimits:
        """Return limits that end slow slip, and allowed errors; see `core.SlowLimits`."""
        scene, law, N_x = self.scene, self.law, self.scene.N_x
        tolerance, unit = OF_STEP * self.method.accuracy, scene.F_N / N_x
        return core.SlowLimits(
            end=end,
            dt=self.state.dt,
            relative=tolerance,
            u=tolerance * unit / float(np.abs(np.diag(interface.load[1])).max()),
            log_theta=tolerance / float(np.max(law.b + law.a)),
            inertia=INERTIA * self.limit,
            speed=law.v_slip,
            least=self.least,
            last=last,
            steps=int(min(max(SLOW_WORK / N_x**3, 10), SLOW_STEPS)),
        )

    def slow(
        self, interface: Interface, closed: np.ndarray, limits: core.SlowLimits, **how: Any
    ) -> core.SlowSlip:
        """Return slip without inertia that begins in the present state."""
        about = self.about(closed)
        how |= {"viscous": about.by_v, "inertial": about.by_a, "closed": closed}
        start, how["v"] = np.log(self.state.theta), self.state.y[0, 2]
        return core.slow_slip(self.steps.model, interface.load, interface.p, start, limits, **how)

    def _moving(self) -> np.ndarray:
        """Return u_x (m), theta (s) and v_x (m/s) of the interface, shape (3, N_x)."""
        return np.array([self.state.y[0, 0], self.state.theta, self.state.y[0, 2]])

    def _put_back(self, step: int, moving: np.ndarray) -> None:
        """Set the step number, and the interface to an array that `_moving` returned."""
        self.state.step = step
        self.state.y[0, 0], self.state.theta[:], self.state.y[0, 2] = moving
        if self.method.threshold:
            self.recorder.log = self.recorder.new_log(self.state)

    def _log_passages(self, interface: Interface, found: core.SlowSlip, n: int, done: int) -> None:
        """Log passages through the threshold, and starts and ends of fast slip, up to step n.

        The first `done` steps are already in the logs.
        """
        state, N_x = self.state, self.scene.N_x
        buffers = self.recorder.log
        fast, peak, last = buffers.fast, buffers.speeds[-1], 0.0
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
        buffers.speeds[N_x] = max(peak, largest(last, n * state.dt)) if bursting else peak
        if count > known:
            self.recorder.add_logs({"crossings": log.crossings(), "bursts": log.bursts()})

    def _put(self, phase: Phase, outside: Outside, n: int) -> None:
        """Set the state to the static state with viscous lag after n steps of a phase."""
        about, found = phase.about, phase.found
        state, known, closed, v = self.state, self.known, about.closed, found.v
        s, u_x = n * state.dt, state.y[0, 0] + found.u
        drive, load = outside.drive_at(s), outside.load_at(s)
        at = known.solve(u_x, drive, free=~closed, load=load, near=phase.at)
        force, gain = outside.rates()
        rates = about.moving(v, force + s * gain)
        resists = about.resistance(rates, about.moving(found.a, gain))
        q = known.coordinates(at.u, at.rod) + about.answer(resists)
        state.y[:, :2], state.rod[:3] = known.displacements(q)
        state.y[:, 2:], state.rod[3:] = known.displacements(rates)
        state.y[0, 0, closed], state.y[0, 2, closed] = u_x[closed], v[closed]
        state.theta[:] = np.exp(found.log_theta)
        state.margin[:] = self.law.v_slip - np.abs(v)
        self.recorder.log.speeds[: self.scene.N_x] = v
