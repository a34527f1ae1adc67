"""A jump: one step of an adaptive integrator, from an event to just before the next one.

While no contact state changes, the slider follows its quasi-static path, behind which it lags, and
rings about it (`modes`). With s the time since the jump began, b the forces on the coordinates,
which are straight or parabolic over s between two corners of a protocol, and K the tangent,

    q(s) = q_0 + q_1 s + q_2 s^2/2 + l_0 + l_1 s + w(s) ,
    K q_1 = b' ,   K q_2 = b'' ,   K l_1 = -C q_2 ,   K l_0 = -C (q_1 + l_1) - M q_2 .

That is exact in linear geometry, but for what the modes truncate. In finite geometry it is a
prediction. What it leaves of the equation of motion where the jump lands,

    D = forces(q) - C q' - M q'' ,

moves the slider by K^-1 D. The path is bent so that it passes there, until that moves the gap
functions by less than the accuracy. The jump ends just before gap functions, less the bound of the
truncated part, reach zero.

The estimate of the error of a jump is what the last such correction does to the gap functions at
landing, what the truncated part still does to them there, and what the modes leave of the equation
of motion on the way.

Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), for
control of the defect.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.engines.crossing import first_crossing
from pyfric.engines.modes import Ringing

if TYPE_CHECKING:
    from pyfric.engines.modes import Linearised, Motion
    from pyfric.statics import StaticSolver

__all__ = ["TRY", "Jump", "Landing", "Outside", "Path", "Stale", "Wait", "at", "path_from", "rest"]

TRY = 12
"""Steps that take about as long as a try: no jump is shorter, and no wait for the next one."""
LONGEST = 2**30
"""Longest wait, in steps: the core takes no more in one call."""
ROUNDS = 8
"""Most corrections of one path; each gains more digits than the one before."""


class Outside:
    """What acts on the slider from a time on, up to the next corner of a protocol.

    Args:
        solver: static states of the scene in its geometry.
        t: time, in s; s counts from here.
        after: a time on the piece of the protocol that is meant, in s.
    """

    def __init__(self, solver: StaticSolver, t: float, after: float | None = None) -> None:
        self.solver, self.t = solver, t
        scene = solver.scene
        V, F_N, T = (scene.piece(what, t if after is None else after) for what in ("V", "F_N", "T"))
        self.drive, self.V, self.a = V.integral_at(t), V.at(t), V.slope
        self.load = None if scene.load_at(t) is None else (F_N.at(t), T.at(t))
        self.gain = (F_N.slope, T.slope)

    @property
    def steady(self) -> bool:
        """Whether forces change at one rate."""
        return self.a == 0

    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return b' (N/s) and b'' (N/s^2), shape (n_q,)."""
        more = self.solver.under(self.gain).load if any(self.gain) else 0.0
        return self.V * self.solver.push + more, self.a * self.solver.push

    def drive_at(self, s: float | np.ndarray) -> float | np.ndarray:
        """Return the position of the driver at s (s), in m."""
        return self.drive + s * (self.V + (0.5 * s) * self.a)

    def load_at(self, s: float) -> tuple[float, float] | None:
        """Return F_N and T at s (s), in N; None where they never change."""
        if self.load is None:
            return None
        return self.load[0] + s * self.gain[0], self.load[1] + s * self.gain[1]


class Path(NamedTuple):
    """The quasi-static path of the slider, and how far it lags behind, as polynomials in s.

    Each is given by its value, rate and bend at s = 0.

    Attributes:
        q: coordinates at rest, shape (3, n_q).
        lag: of the coordinates, shape (3, n_q).
        gaps: gap functions, lag included, shape (3, n_c), in N.
    """

    q: np.ndarray
    lag: np.ndarray
    gaps: np.ndarray

    def bent(self, shift: np.ndarray, gaps: np.ndarray, s: float) -> Path:
        """Return the path with the same start that has moved by shift (m) and gaps (N) at s (s)."""
        q, of_gaps = self.q.copy(), self.gaps.copy()
        q[2] += 2 / s**2 * shift
        of_gaps[2] += 2 / s**2 * gaps
        return self._replace(q=q, gaps=of_gaps)

    def remember(self, system: Linearised, outside: Outside) -> None:
        """Let the next path begin with the bend of this one."""
        if outside.steady and outside.V and not any(outside.gain):
            system.bend = [part[2] / outside.V**2 for part in (self.q, self.gaps)]

    def as_before(self, system: Linearised, outside: Outside) -> Path:
        """Return the path with the bend of the last one, where only the driver moves."""
        if system.bend is None or not outside.steady or any(outside.gain):
            return self
        q, gaps = self.q.copy(), self.gaps.copy()
        for part, bend in zip((q, gaps), system.bend, strict=True):
            part[2] += outside.V**2 * bend
        return self._replace(q=q, gaps=gaps)


def at(polynomial: np.ndarray, s: float) -> np.ndarray:
    """Return a polynomial of `Path` at s (s)."""
    return polynomial[0] + s * (polynomial[1] + (0.5 * s) * polynomial[2])


class Landing(NamedTuple):
    """Where a jump ends: after n steps, coordinates (m), their rates (m/s), gap functions (N).

    `error` is the estimate of the error of contact forces, in N; `jump` led there.
    """

    n: int
    q: np.ndarray
    v: np.ndarray
    gaps: np.ndarray
    error: float
    jump: Jump


class Wait(NamedTuple):
    """No jump now: steps until the next try."""

    steps: int


class Stale(NamedTuple):
    """No jump with this linearisation; with one no better, steps until the next try."""

    steps: int


def rest(
    system: Linearised,
    q: np.ndarray,
    drive: float,
    load: tuple[float, float] | None,
    enough: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the static state at fixed contact states, and the forces that act there.

    Args:
        system: the slider at these contact states.
        q: where the search starts, with the blocks that stick in their places, shape (n_q,), in m.
        drive: displacement of the driver since t = 0, in m.
        load: F_N and T, in N; None means those at t = 0.
        enough: error of gap functions, in N.

    Returns:
        q (m) and forces (N), shape (n_q,); None where the iteration does not converge fast.
    """
    before = math.inf
    for _ in range(ROUNDS):
        force = system.forces(q, drive, load)
        left = force.copy()
        left[system.held] = 0.0
        shift = system.answer(left)
        change = system.K @ shift
        error = float(np.abs(system.gaps_of(shift, -change)).max())
        q, force = q + shift, force - change
        if math.isfinite(before):
            system.contraction = error / before if before > 0 else 0.0
        if not system.contraction <= 1.0:
            system.contraction = 1.0
            return None
        if error * system.contraction <= enough:
            return q, force
        before = error
    return None


def path_from(system: Linearised, outside: Outside, q: np.ndarray, forces: np.ndarray) -> Path:
    """Return the path from a static state q (m) with forces (N) on it, both of shape (n_q,)."""
    stiffer, zero = system.stiffer(q), np.zeros_like(q)

    def answer(force: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what a force makes of the slider, from a guess x, and the force that is left."""
        if stiffer is not None:
            x = x + system.answer(force - system.restoring(x, stiffer))
        return x, force - system.restoring(x, stiffer)

    b_1, b_2 = outside.rates()
    steady, plain = outside.steady, not any(outside.gain)
    q_1, left_1 = answer(b_1, outside.V * system.drift if plain else system.answer(b_1))
    q_2, left_2, l_1 = zero, zero, zero
    if not steady:
        q_2, left_2 = answer(b_2, outside.a * system.drift)
        l_1 = outside.a * system.lag
    drag = -(system.C @ (q_1 + l_1))
    pull = drag - system.M * q_2
    l_0, left_0 = answer(pull, outside.V * system.lag if steady and plain else system.answer(pull))
    bottom = zip((q, q_1, q_2), (forces, left_1, left_2), strict=True)
    gaps = np.array([system.gaps_of(x, f) for x, f in bottom])
    gaps[0] += system.gaps_of(l_0, left_0 + drag - pull)
    if not steady:
        gaps[1] += system.gaps_of(l_1, -(system.C @ q_2) - system.restoring(l_1, stiffer))
    path = Path(np.array([q, q_1, q_2]), np.array([l_0, l_1, zero]), gaps)
    return path.as_before(system, outside)


class Jump:
    """A jump that begins now.

    Args:
        system: the slider at its contact states.
        outside: what acts on it.
        path: its quasi-static path.
        motion: how it deviates from that.
        dt: step, in s.
        accuracy: largest estimated error of contact forces, in N.
        age: time since each block stuck, shape (N_x,), in s.
    """

    def __init__(
        self,
        system: Linearised,
        outside: Outside,
        path: Path,
        motion: Motion,
        *,
        dt: float,
        accuracy: float,
        age: np.ndarray,
    ) -> None:
        self.system, self.outside, self.path, self.motion = system, outside, path, motion
        self.dt, self.accuracy, self.age = dt, accuracy, age
        self.ringing = Ringing(system, motion.a)
        self.bound = system.bound * math.sqrt(motion.energy)

    def land(self, most: int) -> Landing | Wait | Stale:
        """Return where the jump lands after at most so many steps, or how long to wait for it."""
        finite, known = self.system.solver.geometry == "finite", False
        for round_ in range(ROUNDS):
            n = self._longest(most)
            if isinstance(n, Wait):
                return n
            s = n * self.dt
            left = self._left(s)
            if left > self.accuracy:
                return self._wait(left / self.accuracy, self.motion.decay, n)
            alive = np.flatnonzero(self.ringing.levels(s) > self.accuracy)
            if finite and not round_ and alive.size:
                ends = (self.system.stiffer(at(self.path.q, one)) for one in (0.0, s))
                self.ringing.follow(*ends, s, alive)
            q, v, gaps, shift = self._landed(s)
            wrong = gaps - self._gaps(s)
            error = 0.0
            if finite:
                error = float(np.abs(wrong).max())
                known = known or error > self.accuracy
                self.path = self.path.bent(shift, wrong, s)
            then, least = (self.system.strengthened(self.age + one, gaps)[0] for one in (s, 0.0))
            if error <= self.accuracy and (least > 0).all():
                defect = self._defect(s) if finite and alive.size else 0.0
                if defect > self.accuracy:
                    slowest = float(-self.ringing.growth[alive].real.max())
                    return Stale(self._wait(defect / self.accuracy, slowest, n).steps)
                if known:  # else the bend is of the size of what it may be off by
                    self.path.remember(self.system, self.outside)
                return Landing(n, q, v, then, left + error + defect, self)
        return Wait(TRY)

    def _longest(self, most: int) -> int | Wait:
        """Return the number of steps to just before a gap function may reach zero."""
        ringing = self.ringing
        *polynomial, waves = self.system.strengthened(self.age, *self.path.gaps, ringing.gaps)
        now = polynomial[0] + waves.sum(axis=1).real
        with np.errstate(divide="ignore", invalid="ignore"):
            loud = float(np.max(np.where(now > 0, self.bound / now, np.inf)))
        if loud >= 1:
            return self._wait(loud, self.motion.decay)
        waves = np.column_stack([waves, -self.bound])
        rates = np.append(ringing.growth, -self.system.decay)
        c, slope, bend = polynomial
        s = first_crossing(c, slope, waves, rates, most * self.dt, self.dt, bend)
        n = min(math.floor(s / self.dt), most)
        return Wait(max(n + 1, TRY)) if n < min(most, TRY) else n

    def _left(self, s: float) -> float:
        """Return what the truncated part is expected to do to the gap functions at s (s), in N.

        Its rates of decay go up from `fade`. Where their mean, weighed with energy, is `decay` now,
        and the energy falls off as exp(-rate/(decay - fade)), amplitudes fall as
        exp(-fade s)/sqrt(1 + 2 (decay - fade) s).
        """
        fade = self.system.fade
        spread = 1 + 2 * max(self.motion.decay - fade, 0.0) * s
        return float(np.abs(self.motion.gaps).max()) * math.exp(-fade * s) / math.sqrt(spread)

    def _wait(self, times: float, decay: float, most: float = LONGEST) -> Wait:
        """Return when a motion that decays at a rate (1/s) is so many times smaller.

        After `most` steps, where the jump would have ended, another one may be possible.
        """
        steps = math.log(times) / (decay * self.dt) if decay > 0 and times < math.inf else 0.0
        return Wait(math.ceil(max(min(steps, most), TRY)))

    def _defect(self, s: float) -> float:
        """Return what the modes leave of the equation of motion, as it moves the gap functions.

        In finite geometry tangents change along the path, and large motions are not linear. What
        that leaves at a quarter and at half of it excites modes, which decay until s (s), in N. It
        rings with the modes that are there: one with a frequency nearby answers |lambda| over the
        difference times as much as to a constant force, and |lambda| s times at most.
        """
        system, outside, found = self.system, self.outside, 0.0
        near = np.maximum(self.ringing.distances(), 1 / s)
        resonance = np.maximum(np.abs(system.rates) / near, 1.0)
        for then in (0.25 * s, 0.5 * s):
            q, there = at(self.path.q, then), (outside.drive_at(then), outside.load_at(then))
            w, w_v, w_a = system.deviation(*self.ringing.at(then))
            gain = system.forces(q + w, *there) - system.forces(q, *there)
            left = gain - system.C @ w_v - system.M * w_a
            left[system.held] = 0.0
            excited = Ringing(system, system.excited(system.answer(left)))
            left = np.abs(excited.gaps) @ (resonance * np.exp(excited.growth.real * (s - then)))
            found = max(found, float(left.max()))
        return found

    def _landed(self, s: float) -> tuple[np.ndarray, ...]:
        """Return q, q' and gap functions at s (s), corrected by the defect, and its shift."""
        system, path = self.system, self.path
        w, w_v, w_a = system.deviation(*self.ringing.at(s))
        q = at(path.q, s) + at(path.lag, s) + w
        v = path.q[1] + path.lag[1] + s * path.q[2] + w_v
        outside = self.outside.drive_at(s), self.outside.load_at(s)
        forces = system.forces(q, *outside) - system.C @ v
        left = forces - system.M * (path.q[2] + w_a)
        left[system.held] = 0.0
        stiffer, shift = system.stiffer(q), system.answer(left)
        if stiffer is not None:
            shift = system.refined(shift, left, stiffer)
        q, v = q + shift, v + 2 / s * shift
        return q, v, system.gaps_of(q, forces - system.restoring(shift, stiffer)), shift

    def _gaps(self, s: float) -> np.ndarray:
        """Return the predicted gap functions at s (s), shape (n_c,), in N."""
        a, _ = self.ringing.at(s)
        return at(self.path.gaps, s) + (self.system.gaps @ a).real

    def u_h(self, s: np.ndarray) -> np.ndarray:
        """Return mean u_x of the driven blocks at times s (s), evenly spaced, (n,), in m."""
        path = (self.path.q + self.path.lag) @ self.system.solver.driven_row
        near, far = s[: math.isqrt(len(s)) + 1], s[:: math.isqrt(len(s)) + 1]  # each s is a sum
        shares = (self.system.u_h * self.ringing.a)[:, None]
        begin = shares * np.exp(np.outer(self.ringing.growth, far))
        waves = begin.T @ np.exp(np.outer(self.ringing.growth, near - s[:1]))
        return at(path, s) + waves.real.ravel()[: len(s)]
