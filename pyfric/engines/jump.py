"""A jump: one step of an adaptive integrator, from an event to just before the next event.

While no contact state changes, the slider follows its quasi-static path with a viscous lag and
oscillates about it (`path`, `modes`):

    q(s) = q_0 + q_1 s + q_2 s^2/2 + l_0 + l_1 s + w(s) .

In linear geometry q(s) is exact except for errors of the modes. In finite geometry q(s) is a
prediction. The residual of the equation of motion at the end of the jump,

    D = forces(q) - C q' - M q'' ,

corresponds to a displacement K^-1 D, which is added to the path as a quadratic term. This
correction is refined once, with the tangent at the end of the jump. The jump ends just before a gap
function reaches zero. The truncated part is the motion outside the modes. Until it has decayed, its
expected change of gap functions is subtracted from them.

The estimated error of a jump is a change of gap functions with three causes:

- the error after the correction. A refined correction reduces it by the square of the contraction
  of a chord iteration. Because the path has no cubic term, velocities are also off by about
  K^-1 D/s, which excites modes. The correction is repeated until its error is a small part of the
  accuracy. If it does not converge, the jump is halved;
- the truncated part at the end of the jump;
- errors of the modes during the jump: of their rates in linear geometry, their residual in finite
  geometry.

Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993), for
control of the defect.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.engines.crossing import first_crossing
from pyfric.engines.path import ROUNDS, Outside, Path, at
from pyfric.engines.ringing import Ringing

if TYPE_CHECKING:
    from pyfric.engines.modes import Modes, Motion

LONGEST = 2**30
"""Longest wait, in steps: the largest number of steps in one call of the core."""
TRUNCATED = 0.1
"""Expected change of gap functions by the truncated part, over the largest change that its energy
allows. In attempts on fine lattices the largest ratio was 0.02 to 0.33."""
CORRECTED = 0.1
"""Largest error after corrections, over the accuracy: a small part of the error of a jump."""
SAMPLED = (0.01, 0.25)
"""Times at which the residual of modes is computed, over the length of a jump."""


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
    """Return the number of steps, at most `longest`, in which a motion decays by a factor `times`.

    Args:
        times: the factor; inf gives 0 steps.
        decay: negative logarithm of the factor in one step.
        longest: largest number of steps.
    """
    steps = math.log(times) / decay if decay > 0 and times < math.inf else 0.0
    return math.ceil(min(steps, longest))


class Stale(NamedTuple):
    """No jump is possible with this linearisation.

    If a new linearisation does not help, `steps` are made before the next attempt.
    """

    steps: int


class Jump:
    """A jump that begins now.

    Args:
        modes: the slider at its contact states.
        outside: driver and loads.
        path: the quasi-static path.
        motion: deviation from the path.
        age: time since each block stuck, shape (N_x,), in s.
        dt: time step, in s.
        accuracy: largest estimated error of contact forces, in N.
        least: smallest number of steps of a jump.
        wait: smallest number of steps of a wait.
        loose: accuracy of a jump that ends with the run, in N; None means `accuracy`.

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
        wait: int,
        loose: float | None = None,
    ) -> None:
        self.modes, self.outside, self.path, self.motion = modes, outside, path, motion
        self.space, self.gap_functions = modes.space, modes.gap_functions
        self.age, self.dt, self.accuracy = age, dt, accuracy
        self.least, self.wait = least, wait
        self.share = accuracy / (loose or accuracy)
        self.ringing = Ringing(modes, motion.a)
        self.lowered = TRUNCATED * self.gap_functions.bound * math.sqrt(motion.energy)
        self.bend, self.predicted = path.q[2], 0

    def land(self, n_max: int, n_far: int = 0) -> Landing | Wait | Stale:
        """Return the end of the jump, or the time to wait.

        Args:
            n_max: number of steps after which the run or a piece of a protocol ends.
            n_far: number of steps after which a piece of a protocol ends.
        """
        linear, first, n, before = self.space.linear, self.path, n_max, math.inf
        for round_ in range(ROUNDS):
            self.predicted += 1
            n = self._longest(n_max)
            if isinstance(n, Wait):
                return n
            s = n * self.dt
            due = self._due(n, n_far) if n == n_max else s
            left = max(self._lost(due), self.share * self._lost(s))
            if left > self.accuracy:
                return self._wait(left / self.accuracy, self.motion.decay, n)
            alive = self.ringing.alive(s, CORRECTED * self.accuracy)
            if self._inexact(s, alive):
                self.ringing.correct(alive)  # all at once, which is faster
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
                    left_by = self._late if linear else self._defect
                    defect, decay = left_by(s, due, alive)
                    if len(self.space.slips):
                        defect += self._late(s, due, alive)[0]
                if defect > self.accuracy:
                    wait = self._wait(defect / self.accuracy, decay, n)
                    return wait if linear else Stale(wait.steps)
                return Landing(n, q, v, then, left + error + defect, self)
            if error > max(before, CORRECTED * self.accuracy):
                break
            self.path, before = bent, error
        self.path = first  # corrections do not converge over this length
        return self.land(n // 2) if n // 2 > self.least else Wait(self.wait)

    def _due(self, n: int, n_far: int) -> float:
        """Return the time at which errors count if the run ends at step n, in s.

        The ring-down goes on after the run, until an event begins or a piece of a protocol ends.
        Errors count at this later time.
        """
        later = self._longest(n_far) if n_far > n else n
        return self.dt * (n if isinstance(later, Wait) else max(n, later))

    def _counted(self, s: float, due: float) -> np.ndarray:
        """Return the weights of errors of amplitudes at s (s), shape (n,).

        A weight is the part of the error that is left at the time `due`, but at least `share`. The
        state at the end of a run thus has the accuracy `loose`.
        """
        return np.maximum(np.exp(self.ringing.growth.real * (due - s)), self.share)

    def _longest(self, n_max: int) -> int | Wait:
        """Return the number of steps until just before a gap function may reach zero.

        The truncated part lowers gap functions until its expected change is below the accuracy.
        """
        ringing, n, faded = self.ringing, 0, self._faded(n_max)
        *gaps, waves = self.gap_functions.strengthened(self.age, *self.path.gaps, ringing.gaps)
        if faded:
            now = gaps[0] + waves.sum(axis=1).real
            with np.errstate(divide="ignore", invalid="ignore"):
                loud = float(np.max(np.where(now > 0, self.lowered / now, np.inf)))
            if loud >= 1:
                return self._wait(loud, self.motion.decay)
            bounded = [gaps[0] - self.lowered, *gaps[1:]], waves, ringing.growth
            if self.space.decay:
                rates = np.append(ringing.growth, -self.space.decay)
                bounded = gaps, np.column_stack([waves, -self.lowered]), rates
            n = self._until(0, faded, *bounded)
        if n < n_max and self._lost(n * self.dt) <= self.accuracy:
            n = self._until(n, n_max, gaps, waves, ringing.growth)
        return Wait(max(n + 1, self.wait)) if n < min(n_max, self.least) else n

    def _faded(self, n_max: int) -> int:
        """Return the number of steps, at most n_max, after which the truncated part has decayed.

        The number is 0, or `least` times a power of two.
        """
        n = 0
        while n < n_max and self._lost(n * self.dt) > self.accuracy:
            n = min(max(2 * n, self.least), n_max)
        return n

    def _until(
        self, n: int, n_max: int, gaps: list[np.ndarray], waves: np.ndarray, rates: np.ndarray
    ) -> int:
        """Return the number of steps, from n to n_max, until just before gap functions reach zero.

        Args:
            n, n_max: smallest and largest result.
            gaps: polynomials of the gap functions, see `Path`, shape (3, n_c).
            waves: amplitudes at s = 0, shape (n_c, n), complex, in N.
            rates: rates of the amplitudes, shape (n,), in 1/s.
        """
        s, (_, slope, bend) = n * self.dt, gaps
        later = at(gaps, s), slope + s * bend, waves * np.exp(rates * s), rates
        found = first_crossing(*later, (n_max - n) * self.dt, self.dt, bend)
        return min(n + math.floor(found / self.dt), n_max)

    def _lost(self, s: float) -> float:
        """Return the error (N) of gap functions at s (s) if the truncated part is left out."""
        return self._left(s) + self._driven(s)

    def _left(self, s: float) -> float:
        """Return the expected change of the gap functions by the truncated part at s (s), in N.

        Decay rates of this part range from `fade` upwards. Their mean, weighted with energy, is
        `decay` at s = 0. The energy is assumed to be distributed over the rates as
        exp(-(rate - fade)/(decay - fade)). Amplitudes then decay as
        exp(-fade s)/sqrt(1 + 2 (decay - fade) s).
        """
        fade = self.modes.fade
        spread = 1 + 2 * max(self.motion.decay - fade, 0.0) * s
        return float(np.abs(self.motion.gaps).max()) * math.exp(-fade * s) / math.sqrt(spread)

    def _wait(self, times: float, decay: float, longest: float = LONGEST) -> Wait:
        """Return the wait until a motion has decayed by a factor `times` at the rate `decay` (1/s).

        The wait is at most `longest` steps, the length of the refused jump.
        """
        return Wait(max(steps_to_fall(times, decay * self.dt, longest), self.wait))

    def _driven(self, s: float) -> float:
        """Return the change (N) of gap functions at s (s) by modes driven by the truncated part."""
        a = self.motion.driven * np.exp(self.ringing.growth.real * s)
        return float((np.abs(self.modes.gaps) @ a).max(initial=0.0))

    def _inexact(self, s: float, alive: np.ndarray) -> bool:
        """Return whether errors of rates of the modes `alive` exceed their limit at s (s)."""
        wrong = self.ringing.late(s, alive).max(axis=0, initial=0.0)
        return bool((wrong * math.sqrt(len(alive)) > CORRECTED * self.accuracy).any())

    def _late(self, s: float, due: float, alive: np.ndarray) -> tuple[float, float]:
        """Return the change of gap functions at s (s) by errors of rates, in N.

        Also return the rate (1/s) at which this change decreases if the jump begins later.
        """
        growth = self.ringing.growth[alive]
        squares = (self.ringing.late(s, alive) * self._counted(s, due)[alive]) ** 2
        parts = squares[squares.sum(axis=1).argmax()]
        square = float(parts.sum())  # errors of modes are independent
        return math.sqrt(square), float(-growth.real @ parts) / square if square else 0.0

    def _defect(self, s: float, due: float, alive: np.ndarray) -> tuple[float, float]:
        """Return the change of gap functions by the residual of the modes until s (s), in N.

        Also return the rate (1/s) at which this change decreases if the jump begins later. It is
        twice the decay rate of the slowest mode in `alive`, because the residual is quadratic in
        large motions.

        In finite geometry the tangent changes along the path, and large motions are not linear. The
        residual at the times `SAMPLED` excites modes, which decay until s. The part of the residual
        that is odd in the motion oscillates at the frequencies of the present modes. A mode of rate
        lambda responds to such an oscillation more than to a constant force. The factor is |lambda|
        over the difference of the two rates, and at most |lambda| s. The even part oscillates at
        sums and differences of frequencies.
        """
        modes, space, outside, found = self.modes, self.space, self.outside, 0.0
        near = np.maximum(self.ringing.distances(), 1 / s)
        resonance = np.maximum(np.abs(self.ringing.rates) / near, 1.0)
        counted = self._counted(s, due)
        for then in np.multiply(SAMPLED, s):
            q, drive, load = at(self.path.q, then), outside.drive_at(then), outside.load_at(then)
            w, w_v, w_a = modes.motion_of(*self.ringing.at(then))
            rest = space.forces(q, drive, load)
            gain = space.forces(q + w, drive, load) - rest
            left = gain - space.damping(q) @ w_v - space.M * w_a
            change = self._excited(left, s - then) @ (counted * resonance)
            if change.max() > self.accuracy:
                even = 0.5 * (gain + space.forces(q - w, drive, load) - rest)
                change = self._excited(left - even, s - then) @ (counted * resonance)
                change += self._excited(even, s - then) @ counted
            found = max(found, float(change.max()))
        return found, -2.0 * float(self.ringing.growth[alive].real.max())

    def _excited(self, force: np.ndarray, s: float) -> np.ndarray:
        """Return changes (N) of gap functions by modes s (s) after a force (N) began, (n_c, n)."""
        a = self.modes.pushed(force)
        return np.abs(self.modes.gaps * a) * np.exp(self.ringing.growth.real * s)

    def _rung(self, v: np.ndarray) -> float:
        """Return the largest later change (N) of a gap function by an error v (m/s) of velocity."""
        a = np.abs(self.modes.excited(v))
        return float((np.abs(self.modes.gaps) @ a).max(initial=0.0))

    def _landed(
        self, s: float, alive: np.ndarray, stiffer: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        """Return the state at s (s), corrected by a shift.

        Args:
            s: time, in s.
            alive: indices of the modes that have not decayed, shape (m,).
            stiffer: change of bond stiffness at s, shape (3, n_bonds), in N/m; None if linear.

        Returns:
            q (m) and q' (m/s), shape (n_q,); gap functions, shape (n_c,), in N; the shift of q, in
            m; and the factor by which refinement of the shift reduces the error, in the norm of
            elastic energy.
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
        if np.linalg.norm(left) > CORRECTED * self.accuracy:
            first = space.answer(left)
            shift, after, change = space.refined(first, left, stiffer)
            changed = change @ space.elastic(change, space.K @ change)
            contraction = math.sqrt(changed / (first @ space.elastic(first, left)))
            q, v = q + shift, v + 2 / s * shift
        gaps = self.gap_functions.whole(q, forces[space.held] + after, v)
        return q, v, gaps, shift, contraction

    def drift_at(self, s: float) -> np.ndarray | None:
        """Return dq/d(drive) at s (s), shape (n_q,); None if loads change or the driver rests."""
        V = self.outside.V + s * self.outside.a
        if not V or any(self.outside.gain):
            return None
        return (self.path.q[1] + s * self.bend) / V

    def integral(self, row: np.ndarray, s: float, weight: tuple[float, float]) -> float:
        """Return the integral of (w_0 + w_1 s) row.q(s) from 0 to s (s), for weights w_0 and w_1.

        Args:
            row: shape (n_q,). The result has the unit of row times m times w_0 s.
            s: length of the jump, in s.
            weight: w_0 and w_1.
        """
        x, of_x = np.polynomial.legendre.leggauss(3)  # exact for polynomials of degree 5
        times, (w_0, w_1), growth = s * (x + 1) / 2, weight, self.ringing.growth
        path = (self.path.q + self.path.lag) @ row
        smooth = s / 2 * float(of_x @ ((w_0 + w_1 * times) * at(path, times)))
        end, shares = np.exp(growth * s), (row @ self.space.B) @ self.modes.x * self.ringing.a
        once = (end - 1) / growth
        return smooth + float((shares @ (w_0 * once + w_1 * (s * end - once) / growth)).real)

    def u_h(self, s: np.ndarray) -> np.ndarray:
        """Return mean u_x of the driven blocks at times s (s), evenly spaced, (n,), in m."""
        path = (self.path.q + self.path.lag) @ self.space.solver.driven_row
        near, far = s[: math.isqrt(len(s)) + 1], s[:: math.isqrt(len(s)) + 1]  # each s is a sum
        shares = (self.modes.u_h * self.ringing.a)[:, None]
        begin = shares * np.exp(np.outer(self.ringing.growth, far))
        waves = begin.T @ np.exp(np.outer(self.ringing.growth, near - s[:1]))
        return at(path, s) + waves.real.ravel()[: len(s)]
