"""A jump: one step of an adaptive integrator, from an event to just before the next one.

While no contact state changes, the slider follows its quasi-static path with a viscous lag and
oscillates about it (`modes`). Let s be the time since the jump began, K the tangent stiffness, and
b the forces on the coordinates. Between two breakpoints of a protocol, b is linear or quadratic in
s:

    q(s) = q_0 + q_1 s + q_2 s^2/2 + l_0 + l_1 s + w(s) ,
    K q_1 = b' ,   K q_2 = b'' - R ,   K l_1 = -C q_2 ,   K l_0 = -C (q_1 + l_1) - M q_2 .

In finite geometry R is the second derivative of the spring forces along q_1. In linear geometry it
is zero, and the path is exact except for what the modes leave. In finite geometry it is a
prediction. The residual of the equation of motion at the end of the jump,

    D = forces(q) - C q' - M q'' ,

corresponds to a displacement K^-1 D. A quadratic term that adds this displacement corrects the
path, and the tangent at the end refines it once. The jump ends just before a gap function, minus
the bound of the truncated part, reaches zero.

The estimated error of a jump is a change of gap functions with three causes: what the correction
leaves, the truncated part at the end of the jump, and what the modes leave during the jump: in
finite geometry their residual, in linear geometry the errors of their rates. A refined correction
leaves the square of the contraction of a chord iteration. Because the path has no cubic term, it
also leaves velocities that are off by about K^-1 D/s, which excite modes. The correction is
repeated until it leaves little of the accuracy. If it does not converge, the jump is halved.

Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), for
control of the defect.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.engines.crossing import first_crossing
from pyfric.engines.ringing import Ringing

if TYPE_CHECKING:
    from pyfric.engines.modes import Modes, Motion
    from pyfric.statics import StaticSolver

LONGEST = 2**30
"""Longest wait, in steps: the most that one call of the core makes."""
ROUNDS = 8
"""Most corrections of one path. Each one gains more digits than the one before, or they diverge."""
CORRECTED = 0.1
"""What corrections may leave, over the accuracy: it hardly adds to the error of a jump."""
SAMPLED = (0.01, 0.25)
"""Times at which the residual of modes is looked at, over the length of a jump."""


class Outside:
    """Driver and loads from a time on, up to the next breakpoint of a protocol.

    Args:
        solver: static states of the scene in its geometry.
        t: time at which s = 0, in s.
        after: a time that selects the piece of the protocol, in s; None means t.
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
        """Whether forces change at a constant rate."""
        return self.a == 0

    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return b' (N/s) and b'' (N/s^2), shape (n_q,)."""
        more = self.solver.under(self.gain).load if any(self.gain) else 0.0
        return self.V * self.solver.push + more, self.a * self.solver.push

    def drive_at(self, s: float | np.ndarray) -> float | np.ndarray:
        """Return the position of the driver at s (s), in m."""
        return self.drive + s * (self.V + (0.5 * s) * self.a)

    def load_at(self, s: float) -> tuple[float, float] | None:
        """Return F_N and T at s (s), in N; None if they never change."""
        if self.load is None:
            return None
        return self.load[0] + s * self.gain[0], self.load[1] + s * self.gain[1]


class Path(NamedTuple):
    """The quasi-static path of the slider, and its lag, as polynomials in s.

    Each polynomial is given by its value, first and second derivative at s = 0.

    Attributes:
        q: static coordinates, shape (3, n_q).
        lag: lag of the coordinates, shape (3, n_q).
        gaps: gap functions including the lag, shape (3, n_c), in N.
        stiffer: change of bond stiffness at s = 0, shape (3, n_bonds), in N/m; None if linear.
    """

    q: np.ndarray
    lag: np.ndarray
    gaps: np.ndarray
    stiffer: np.ndarray | None

    def bent(self, shift: np.ndarray, gaps: np.ndarray, s: float) -> Path:
        """Return the path with the same start, moved by shift (m) and gaps (N) at s (s)."""
        q, of_gaps = self.q.copy(), self.gaps.copy()
        q[2] += 2 / s**2 * shift
        of_gaps[2] += 2 / s**2 * gaps
        return self._replace(q=q, gaps=of_gaps)


def at(polynomial: np.ndarray, s: float) -> np.ndarray:
    """Return the value of a polynomial of `Path` at s (s)."""
    return polynomial[0] + s * (polynomial[1] + (0.5 * s) * polynomial[2])


class Landing(NamedTuple):
    """End of a jump.

    Attributes:
        n: number of steps.
        q, v: coordinates (m) and their rates (m/s), shape (n_q,).
        gaps: gap functions, shape (n_c,), in N.
        error: estimated error of contact forces, in N.
        jump: the jump that ends here.
    """

    n: int
    q: np.ndarray
    v: np.ndarray
    gaps: np.ndarray
    error: float
    jump: Jump


class Wait(NamedTuple):
    """No jump is possible now; `steps` are made before the next attempt."""

    steps: int


def steps_to_fall(times: float, decay: float, longest: float = LONGEST) -> int:
    """Return in how many steps, at most `longest`, a motion falls by a factor `times`.

    Args:
        times: the factor; infinite if there is none.
        decay: decay in one step.
        longest: largest number of steps.
    """
    steps = math.log(times) / decay if decay > 0 and times < math.inf else 0.0
    return math.ceil(min(steps, longest))


class Stale(NamedTuple):
    """No jump is possible with this linearisation.

    If a new linearisation does not help, `steps` are made before the next attempt.
    """

    steps: int


def rest(
    modes: Modes,
    q: np.ndarray,
    drive: float,
    load: tuple[float, float] | None,
    enough: float,
    contraction: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return the static state at fixed contact states, the forces there, and the contraction.

    Args:
        modes: the slider at these contact states.
        q: start of the iteration, with stuck blocks at their positions, shape (n_q,), in m.
        drive: displacement of the driver since t = 0, in m.
        load: F_N and T, in N; None means those at t = 0.
        enough: accepted error of gap functions, in N.
        contraction: expected factor by which an iteration reduces the error.

    Returns:
        q (m) and forces (N), shape (n_q,), and the contraction that was observed last; None if the
        iteration does not converge fast.
    """
    space, K, before = modes.space, modes.tangent.K, math.inf
    contraction = 0.0 if space.linear else contraction
    for _ in range(ROUNDS):
        force = space.forces(q, drive, load)
        left = force.copy()
        left[space.held] = 0.0
        if np.abs(left).sum() <= enough:  # contact forces can change by no more
            return q, force, contraction
        shift = space.answer(left)
        change = K @ shift
        error = float(np.abs(modes.gap_functions.at(shift, -change[space.held])).max())
        q, force = q + shift, force - change
        if math.isfinite(before):
            contraction = error / before if before > 0 else 0.0
        if not contraction <= 1.0:
            return None
        if error * contraction <= enough:
            return q, force, contraction
        before = error
    return None


def path_from(
    modes: Modes,
    outside: Outside,
    q: np.ndarray,
    forces: np.ndarray,
    drift: np.ndarray | None = None,
) -> Path:
    """Return the path from a static state.

    Args:
        modes: the slider at its contact states.
        outside: driver and loads.
        q, forces: the static state (m) and the forces on it (N), shape (n_q,).
        drift: start of the search for dq/d(drive), shape (n_q,); None: that of the factorised
            tangent.
    """
    space, gap_functions = modes.space, modes.gap_functions
    stiffer, held, zero = space.stiffer(q), space.held, np.zeros_like(q)
    b_1, b_2 = outside.rates()
    steady, plain = outside.steady and not len(space.slips), not any(outside.gain)
    if stiffer is None and steady and plain:
        V, of_drift, of_lag = outside.V, *gap_functions.steady
        begin = gap_functions.whole(q, forces[held])
        gaps = begin + V * of_lag, V * of_drift, np.zeros_like(of_lag)
        lag = np.array([V * space.lag, zero, zero])
        return Path(np.array([q, V * space.drift, zero]), lag, np.array(gaps), stiffer)
    guess = outside.V * (space.drift if drift is None else drift) if plain else space.answer(b_1)
    q_1, left_1, _ = space.refined(guess, b_1, stiffer)
    b_2 = b_2 - space.bends(q, q_1)
    guess = outside.a * space.drift if stiffer is None else space.answer(b_2)
    q_2, left_2, _ = space.refined(guess, b_2, None if steady else stiffer)
    C = space.damping(q)
    l_1 = zero if steady else space.answer(-(C @ q_2))
    drag = -(C @ (q_1 + l_1))
    pull = drag - space.M * q_2
    guess = outside.V * space.lag if steady and plain else space.answer(pull)
    l_0, left_0, _ = space.refined(guess, pull, stiffer)
    bottom = zip((q, q_1, q_2), (forces[held], left_1, left_2), (q_1 + l_1, q_2, zero), strict=True)
    of = gap_functions.whole, gap_functions.at, gap_functions.at
    gaps = np.array([gap(*parts) for gap, parts in zip(of, bottom, strict=True)])
    gaps[0] += gap_functions.at(l_0, left_0 + (drag - pull)[held])
    if not steady:
        left = -(C @ q_2) - space.restoring(l_1, stiffer)
        gaps[1] += gap_functions.at(l_1, left[held])
    return Path(np.array([q, q_1, q_2]), np.array([l_0, l_1, zero]), gaps, stiffer)


class Jump:
    """A jump that begins now.

    Args:
        modes: the slider at its contact states.
        outside: driver and loads.
        path: the quasi-static path.
        motion: deviation from the path.
        age: time since each block stuck, shape (N_x,), in s.
        dt: step, in s.
        accuracy: largest estimated error of contact forces, in N.
        least: smallest number of steps of a jump and of a wait.

    Attributes:
        predicted: number of landings that were predicted.
    """

    def __init__(
        self,
        modes: Modes,
        outside: Outside,
        path: Path,
        motion: Motion,
        age: np.ndarray,
        *,
        dt: float,
        accuracy: float,
        least: int,
    ) -> None:
        self.modes, self.outside, self.path, self.motion = modes, outside, path, motion
        self.space, self.gap_functions = modes.space, modes.gap_functions
        self.age, self.dt, self.accuracy, self.least = age, dt, accuracy, least
        self.ringing = Ringing(modes, motion.a)
        self.bound = self.gap_functions.bound * math.sqrt(motion.energy)
        self.bend, self.predicted = path.q[2], 0

    def land(self, n_max: int) -> Landing | Wait | Stale:
        """Return the end of the jump after at most `n_max` steps, or how long to wait."""
        linear, first, n, before = self.space.linear, self.path, n_max, math.inf
        for round_ in range(ROUNDS):
            self.predicted += 1
            n = self._longest(n_max)
            if isinstance(n, Wait):
                return n
            s = n * self.dt
            left = self._left(s) + self._driven(s)
            if left > self.accuracy:
                return self._wait(left / self.accuracy, self.motion.decay, n)
            alive = self.ringing.alive(s, CORRECTED * self.accuracy)
            self.ringing.correct(self._inexact(s, alive))
            if not round_:
                end = self.space.stiffer(at(self.path.q, s))
                follows = self.ringing.alive(s, len(self.motion.a) * self.accuracy)
                if follows.size and not (linear or len(self.space.slips)):
                    self.ringing.follow(self.path.stiffer, end, s, follows)
            q, v, gaps, shift, contraction = self._landed(s, alive, end)
            wrong = gaps - at(self.path.gaps, s) - (self.modes.gaps @ self.ringing.at(s)[0]).real
            error, bent = 0.0, self.path.bent(shift, wrong, s)
            if not linear:
                size = float(np.abs(wrong).max())
                error = size * contraction**2 + self._rung(shift / s)
                self.path = bent
            then, least = (
                self.gap_functions.strengthened(self.age + later, gaps)[0] for later in (s, 0.0)
            )
            if error <= CORRECTED * self.accuracy and (least > 0).all():
                defect, decay = 0.0, 0.0
                if alive.size:
                    defect, decay = self._late(s, alive) if linear else self._defect(s, alive)
                    if len(self.space.slips):
                        defect += self._late(s, alive)[0]
                if defect > self.accuracy:
                    wait = self._wait(defect / self.accuracy, decay, n)
                    return wait if linear else Stale(wait.steps)
                return Landing(n, q, v, then, left + error + defect, self)
            if error > max(before, CORRECTED * self.accuracy):
                break
            self.path, before = bent, error
        self.path = first  # the corrections do not converge over so long a path
        return self.land(n // 2) if n // 2 > self.least else Wait(self.least)

    def _longest(self, n_max: int) -> int | Wait:
        """Return the number of steps until just before a gap function may reach zero."""
        ringing = self.ringing
        rows = *self.path.gaps, ringing.gaps
        *polynomial, waves = self.gap_functions.strengthened(self.age, *rows)
        now = polynomial[0] + waves.sum(axis=1).real
        with np.errstate(divide="ignore", invalid="ignore"):
            loud = float(np.max(np.where(now > 0, self.bound / now, np.inf)))
        if loud >= 1:
            return self._wait(loud, self.motion.decay)
        rates, (c, slope, bend) = ringing.growth, polynomial
        if self.space.decay:
            waves, rates = (
                np.column_stack([waves, -self.bound]),
                np.append(rates, -self.space.decay),
            )
        else:
            c = c - self.bound
        s = first_crossing(c, slope, waves, rates, n_max * self.dt, self.dt, bend)
        n = min(math.floor(s / self.dt), n_max)
        return Wait(max(n + 1, self.least)) if n < min(n_max, self.least) else n

    def _left(self, s: float) -> float:
        """Return the expected change of the gap functions by the truncated part at s (s), in N.

        Its decay rates range from `fade` upwards. Their mean, weighted with energy, is `decay` at
        s = 0. If the energy is distributed as exp(-(rate - fade)/(decay - fade)) over the rates,
        amplitudes decay as exp(-fade s)/sqrt(1 + 2 (decay - fade) s).
        """
        fade = self.modes.fade
        spread = 1 + 2 * max(self.motion.decay - fade, 0.0) * s
        return float(np.abs(self.motion.gaps).max()) * math.exp(-fade * s) / math.sqrt(spread)

    def _wait(self, times: float, decay: float, longest: float = LONGEST) -> Wait:
        """Return the wait until a motion has fallen by a factor `times` at the rate `decay` (1/s).

        The wait is at most `longest` steps, the length of the refused jump. At its end another jump
        may be possible.
        """
        return Wait(max(steps_to_fall(times, decay * self.dt, longest), self.least))

    def _driven(self, s: float) -> float:
        """Return the change of gap functions at s (s) by what the truncated part drives, in N."""
        a = self.motion.driven * np.exp(self.ringing.growth.real * s)
        return float((np.abs(self.modes.gaps) @ a).max(initial=0.0))

    def _inexact(self, s: float, alive: np.ndarray) -> np.ndarray:
        """Return the indices of modes that are to be corrected, of those that are alive at s (s).

        Modes with slipping blocks serve one jump only. Few of their rates count so much.
        """
        if not len(self.space.slips):
            return alive
        wrong = self.ringing.late(s, alive).max(axis=0, initial=0.0)
        return alive[wrong * len(alive) > CORRECTED * self.accuracy]

    def _late(self, s: float, alive: np.ndarray) -> tuple[float, float]:
        """Return the change of the gap functions at s (s) by errors of rates, in N.

        Also return its decay rate if the jump begins later, in 1/s.
        """
        growth, wrong = self.ringing.growth[alive], self.ringing.late(s, alive)
        parts = wrong[wrong.sum(axis=1).argmax()]
        change = float(parts.sum())
        return change, float(-growth.real @ parts) / change if change else 0.0

    def _defect(self, s: float, alive: np.ndarray) -> tuple[float, float]:
        """Return the change of the gap functions by the residual of the modes until s (s), in N.

        Also return its decay rate if the jump begins later, in 1/s: twice that of the slowest mode
        that counts, because a residual of large motions is quadratic in them.

        In finite geometry the tangent changes along the path, and large motions are not linear. The
        residual at the times `SAMPLED` excites modes, which decay until s. Its part that is odd in
        the motion oscillates at the frequencies of the present modes. A mode with a rate lambda
        near one of these responds |lambda| over the difference times as much as to a constant
        force, but at most |lambda| s times as much. The even part oscillates at sums and
        differences of frequencies.
        """
        modes, space, outside, found = self.modes, self.space, self.outside, 0.0
        near = np.maximum(self.ringing.distances(), 1 / s)
        resonance = np.maximum(np.abs(self.ringing.rates) / near, 1.0)
        for then in np.multiply(SAMPLED, s):
            q, drive, load = at(self.path.q, then), outside.drive_at(then), outside.load_at(then)
            w, w_v, w_a = modes.motion_of(*self.ringing.at(then))
            rest = space.forces(q, drive, load)
            gain = space.forces(q + w, drive, load) - rest
            left = gain - space.damping(q) @ w_v - space.M * w_a
            change = self._excited(left, s - then) @ resonance
            if change.max() > self.accuracy:
                even = 0.5 * (gain + space.forces(q - w, drive, load) - rest)
                change = self._excited(left - even, s - then) @ resonance
                change += self._excited(even, s - then).sum(axis=1)
            found = max(found, float(change.max()))
        return found, -2.0 * float(self.ringing.growth[alive].real.max())

    def _excited(self, force: np.ndarray, s: float) -> np.ndarray:
        """Return changes of gap functions (N), (n_c, n), by modes s (s) after a force (N) began."""
        a = self.modes.pushed(force)
        return np.abs(self.modes.gaps * a) * np.exp(self.ringing.growth.real * s)

    def _rung(self, v: np.ndarray) -> float:
        """Return how far an error v (m/s) of velocities moves a gap function later, in N."""
        a = np.abs(self.modes.excited(v))
        return float((np.abs(self.modes.gaps) @ a).max(initial=0.0))

    def _landed(
        self, s: float, alive: np.ndarray, stiffer: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        """Return the state at s (s), corrected by a shift.

        Args:
            s: time, in s.
            alive: indices of the modes that have not decayed, shape (m,).
            stiffer: change of bond stiffness to that state, (3, n_bonds); None if linear.

        Returns:
            q (m) and q' (m/s), shape (n_q,); gap functions, shape (n_c,), in N; the shift of q, in
            m; and the factor by which its refinement reduces the error, in the norm of elastic
            energy.
        """
        space, path = self.space, self.path
        w, w_v, w_a = self.ringing.motion_at(s, alive)
        q = at(path.q, s) + at(path.lag, s) + w
        v = path.q[1] + path.lag[1] + s * path.q[2] + w_v
        outside = self.outside.drive_at(s), self.outside.load_at(s)
        forces = space.forces(q, *outside) - space.damping(q) @ v
        left = forces - space.M * (path.q[2] + w_a)
        left[space.held] = 0.0
        shift, after, contraction = np.zeros_like(q), 0.0, 0.0
        if np.abs(left).sum() > CORRECTED * self.accuracy:  # contact forces change by no more
            first = space.answer(left)
            shift, after, change = space.refined(first, left, stiffer)
            changed = change @ space.elastic(change, space.K @ change)
            contraction = math.sqrt(changed / (first @ space.elastic(first, left)))
            q, v = q + shift, v + 2 / s * shift
        gaps = self.gap_functions.whole(q, forces[space.held] + after, v)
        return q, v, gaps, shift, contraction

    def drift_at(self, s: float) -> np.ndarray | None:
        """Return dq/d(drive) at s (s), shape (n_q,), or None if not only the driver moves."""
        V = self.outside.V + s * self.outside.a
        if not V or any(self.outside.gain):
            return None
        return (self.path.q[1] + s * self.bend) / V

    def u_h(self, s: np.ndarray) -> np.ndarray:
        """Return mean u_x of the driven blocks at times s (s), evenly spaced, (n,), in m."""
        path = (self.path.q + self.path.lag) @ self.space.solver.driven_row
        near, far = s[: math.isqrt(len(s)) + 1], s[:: math.isqrt(len(s)) + 1]  # each s is a sum
        shares = (self.modes.u_h * self.ringing.a)[:, None]
        begin = shares * np.exp(np.outer(self.ringing.growth, far))
        waves = begin.T @ np.exp(np.outer(self.ringing.growth, near - s[:1]))
        return at(path, s) + waves.real.ravel()[: len(s)]
