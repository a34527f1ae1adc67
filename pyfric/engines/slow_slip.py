"""Rate-and-state friction between ruptures: quasi-static elasticity, without inertia.

Elasticity is linear, and the slider is condensed onto its interface (`pyfric.statics`). Friction
then gives the speed of each block from the load on it and from its state:

    p_i(u, t) a asinh( v_i/(2V*) exp((f* + b psi_i)/a) ) + alpha v_i = tau_i(u, t) ,
    du_i/dt = v_i ,   d(ln theta_i)/dt by the evolution law ,

2 N_x equations, which an embedded Runge-Kutta pair of orders 5 and 4 (SciPy's RK45) advances, for
seconds or years alike. In finite geometry they are those of linear geometry, with the static state
in which a phase begins.

`RateHybridRun` hands over to full dynamics where inertia is no longer small: where the sum over
columns of M/N_x |dv_i/dt| exceeds the accuracy times F_N. It returns when the sum of |m a| over all
blocks is below that again. Both directions keep u, v and theta of the interface. The rest of the
slider is then in its static state for these u, or moves with its rates.

Source of the equations: J. R. Rice, J. Geophys. Res. 98, 9885 (1993), without radiation damping.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import OPEN
from pyfric.engines.dynamic import Run
from pyfric.engines.integration import just_after
from pyfric.statics import ContactProblem, Route, Values, table_rows

if TYPE_CHECKING:
    from pyfric.scene import RateStateLaw, Scene
    from pyfric.statics import StaticSolver

LOOK = 200
"""Steps of full dynamics between two looks at inertia."""
PAIRS = 200
"""Steps of the Runge-Kutta pair between two looks at Ctrl-C and checkpoints."""
OF_STEP = 0.01
"""Error of a step of the pair over the accuracy, as some hundred steps lead to an event: forces of
events in the preset `rate_and_state` are then within 1e-4 F_N, and not with 1."""
MOVED = 5e-3
"""Displacement over which velocities of the slider are differences, over D_c (rounding)."""


class Interface(NamedTuple):
    """The condensed slider with the time s since a state, in s; all blocks in contact stick to it.

    Attributes:
        load: load on each block along +x, in N: its value, its rate, and its matrix over the
            displacements since that state, shapes (N_x,), (N_x,), (N_x, N_x).
        p: the same for the normal force.
        F_T: the same for the force of the driver, shapes (), (), (N_x,).
    """

    load: tuple[np.ndarray, np.ndarray, np.ndarray]
    p: tuple[np.ndarray, np.ndarray, np.ndarray]
    F_T: tuple[float, float, np.ndarray]

    def loads(self, moved: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return loads and normal forces (N) after displacements (m) at s (s)."""
        load, p = (part[0] + part[1] * s + part[2] @ moved for part in (self.load, self.p))
        return load, p


def interface_at(
    scene: Scene, known: StaticSolver, u_x: np.ndarray, closed: np.ndarray, t: float
) -> Interface:
    """Return the condensed slider about its static state at u_x (m) and t (s)."""
    V, F_N, T = (scene.piece(what, t) for what in ("V", "F_N", "T"))
    drive, load = scene.drive(t), (F_N.at(t), T.at(t))
    way, gain = V.at(t), (F_N.slope, T.slope)
    at = known.solve(u_x, drive, free=~closed, load=load if scene.load_at(t) else None)
    now = Values(u_x, at.f, at.u[0, 1], at.p, at.F_T)
    home = scene.d * float(np.mean(known.u_drv0))
    problem = ContactProblem(scene, known.u_drv0).along(Route(drive + home, way, load, gain))
    rows = table_rows(scene.N_x)
    table = problem.corrected(now, 0.0).base(closed)
    held, rate = table[:, rows.u_x], table[:, rows.given.start]
    k_f = np.broadcast_to(scene.k_f, closed.shape) * closed
    return Interface(
        (-at.f, -rate[rows.f], -held[rows.f]),
        (at.p, -k_f * rate[rows.u_z], -k_f[:, None] * held[rows.u_z]),
        (at.F_T, float(rate[rows.F_T]), held[rows.F_T]),
    )


class Phase:
    """Slip without inertia from a state on.

    Args:
        law: the law.
        interface: the condensed slider about that state.
        theta: state variables, shape (N_x,), in s.
        closed: blocks in contact, shape (N_x,), bool.
    """

    def __init__(
        self, law: RateStateLaw, interface: Interface, theta: np.ndarray, closed: np.ndarray
    ) -> None:
        self.law, self.interface, self.closed = law, interface, closed
        self.N_x = len(theta)
        self.unit = np.log(law.D_c / law.kind.V_star)
        self.begin = np.concatenate([np.zeros(self.N_x), np.log(theta) - self.unit])

    def log_theta(self, y: np.ndarray) -> np.ndarray:
        """Return ln of the state variables (s) from the unknowns, which are over D_c/V*."""
        return y[self.N_x :] + self.unit

    def speeds(self, s: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return velocities (m/s) and normal forces (N) at s (s); blocks without contact stay."""
        load, p = self.interface.loads(y[: self.N_x], s)
        v = self.law.speed(load, np.where(p > 0, p, np.nan), self.log_theta(y))
        return np.where(self.closed, np.nan_to_num(v), 0.0), p

    def rates(self, s: float, y: np.ndarray) -> np.ndarray:
        """Return the rates of displacements (m/s) and of ln theta (1/s)."""
        v, _ = self.speeds(s, y)
        return np.concatenate([v, self.law.log_rate(v, self.log_theta(y))])


class Passages:
    """Passages of blocks through a threshold of slip rate in a phase; see `pyfric.record.rates`.

    Args:
        phase: the phase.
        threshold: slip rate, in m/s; None looks for nothing.
        log: what the core knows of fast blocks; it is brought up to date.
    """

    def __init__(self, phase: Phase, threshold: float | None, log: core.Log) -> None:
        self.phase, self.threshold, self.log = phase, threshold or math.inf, log
        self.fast = log.fast[0].copy()
        self.found: list[tuple[float, int, int, np.ndarray]] = []
        self.sums: list[tuple[float, float]] = []

    def look(self, v: np.ndarray, begin: float, end: float, inside: Any) -> None:
        """Find the passages in a step of the pair, after which blocks move at v (m/s).

        Args:
            begin, end: times since the phase began, in s.
            inside: function of such a time that returns displacements and ln of states.
        """
        from scipy.optimize import brentq  # slow to import

        def above(s: float, i: int) -> float:
            return abs(self.phase.speeds(s, inside(s))[0][i]) - self.threshold

        now = np.where(np.abs(v) > self.threshold, np.sign(v), 0).astype(np.int32)
        self.sums.append((end, abs(float(v.sum()))))
        passed = []
        for i in np.flatnonzero(now != self.fast):
            differ = above(begin, i) * above(end, i) < 0
            s = brentq(above, begin, end, (i,)) if differ else begin
            passed.append((s, int(i), int(now[i]), inside(s)))
        self.found += sorted(passed, key=lambda passage: passage[:2])
        self.fast = now

    def logs(self, state: core.State, scene: Scene, n: int) -> dict[str, dict[str, np.ndarray]]:
        """Return crossings and bursts in the first n steps after a state; {} if there are none."""
        N_x, fast, peak = self.phase.N_x, self.log.fast, self.log.speeds[-1]
        found = [passage for passage in self.found if passage[0] <= n * state.dt]
        log = core.Log(N_x, len(found), len(found), 0, self.threshold)
        bursting, last = self._bursting(fast), 0.0
        for s, i, new, y in found:
            step, t = state.step + math.ceil(s / state.dt), state.t + s
            p, u_x = self.phase.speeds(s, y)[1], state.y[0, 0] + y[:N_x]
            F_T = self.phase.interface.F_T
            force = F_T[0] + F_T[1] * s + F_T[2] @ y[:N_x]
            old, fast[0, i] = fast[0, i], new
            if old == 0:
                fast[1, i] = p[i] < core.CORNER_SHARE * scene.F_N / N_x
            log.crossing_i[:, log.n_crossing] = i, old, new, fast[1, i]
            log.crossing_r[:, log.n_crossing] = step, t, u_x[i], p[i]
            log.n_crossing += 1
            if bursting:
                peak = max([peak, *(of for at, of in self.sums if last <= at <= s)])
            if self._bursting(fast) != bursting:
                bursting, last = not bursting, s
                row = log.burst_r[:, log.n_burst]
                row[:3], row[-1] = (step, t, force), 0.0 if bursting else peak
                row[2 + core.POINT : -1] = u_x
                log.burst_i[:, log.n_burst] = 1 if bursting else -1, *state.mode
                log.n_burst, peak = log.n_burst + 1, 0.0
        if bursting:
            peak = max([peak, *(of for at, of in self.sums if last <= at <= n * state.dt)])
        self.log.speeds[N_x] = peak
        return {"crossings": log.crossings(), "bursts": log.bursts()} if found else {}

    @staticmethod
    def _bursting(fast: np.ndarray) -> bool:
        return bool(((fast[0] != 0) & (fast[1] == 0)).any())


class RateHybridRun(Run):
    """A run that steps through ruptures, and leaves out inertia between them."""

    name = "hybrid"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.made |= {"jumps": 0, "steps_spared": 0, "slow_steps": 0}
        self.worth = self.state.step
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
            again = again and self.slip(last)
            if not again:
                self.worth = state.step + LOOK
            if state.step > begin:
                return

    def inertia(self) -> float:
        """Return the sum of |m a| over blocks and rod, in N."""
        found = core.evaluate(self.model, self.state, self.state.t)
        rows, columns = self.scene.shares
        force = self.scene.m * float(np.abs(rows[:, None, None] * columns * found.a).sum())
        return force + self.scene.M_rod * float(np.abs(found.a_rod[:2]).sum())

    def slip(self, last: int) -> bool:
        """Leave out inertia up to step `last` at most; return whether that may go on."""
        from scipy.integrate import RK45  # slow to import

        state, scene, law = self.state, self.scene, self.scene.law
        n_max, closed = self.piece_ends(last) - state.step, state.mode != OPEN
        if n_max <= 0:
            return False
        n_max, text = self._due(n_max)
        interface = interface_at(scene, self.known, state.y[0, 0], closed, just_after(state))
        phase = Phase(law, interface, state.theta, closed)
        tolerance, unit = OF_STEP * self.method.accuracy, scene.F_N / scene.N_x
        stiff = float(np.abs(np.diag(interface.load[2])).max())
        atol = np.repeat(
            [tolerance * unit / stiff, tolerance / float(np.max(law.b + law.a))], scene.N_x
        )
        end = n_max * state.dt
        how = {"rtol": tolerance, "atol": atol, "first_step": state.dt}  # SciPy's own is in seconds
        pair = RK45(phase.rates, 0.0, phase.begin, end, **how)
        v, n, y, goes_on = phase.speeds(0.0, phase.begin)[0], 0, phase.begin, True
        of_column = (scene.M_rod + scene.slider.M) / scene.N_x  # kg
        passages = Passages(phase, self.method.threshold, self.log)
        for _ in range(PAIRS):
            before = pair.t
            with np.errstate(over="ignore", invalid="ignore"):  # a step that is too long fails
                pair.step()
            if pair.status == "failed":
                goes_on = False
                break
            self.made["slow_steps"] += 1
            (now, p), inside = phase.speeds(pair.t, pair.y), pair.dense_output()
            passages.look(now, before, pair.t, inside)
            push = of_column * float(np.abs(now - v).sum()) / (pair.t - before)
            reached = n_max if pair.status == "finished" else int(pair.t / state.dt)
            self._sample_slip(phase, inside, n, reached)
            if reached > n:
                n, y = reached, inside(min(reached * state.dt, pair.t))
            slow = push <= self.limit and float(np.abs(now).max()) < law.kind.v_slip
            goes_on = slow and bool((p > 0)[closed].all())
            v = now
            if not goes_on or pair.status == "finished":
                break
        if n:
            if logs := passages.logs(state, scene, n):
                self._add_logs(logs)
            self._put(phase, y, n)
        if text and n == n_max:
            self.ending = self.stopping.named(text)
        return goes_on and n > 0

    def _due(self, n_max: int) -> tuple[int, str]:
        """Return after how many steps a condition ends the run if none slips, and its text.

        The run ends at a point of the curve. If that is beyond n_max steps, n_max and "" are
        returned.
        """
        if self.stopping is None:
            return n_max, ""
        self.look()
        state, every = self.state, self.method.sample
        due, text = self.stopping.due()
        points = state.step // every + 1  # number of the next point
        if due > state.t0 + (state.step + n_max) * state.dt:
            return n_max, ""
        points = max(points, math.ceil((due - state.t0) / state.dt / every))
        n = points * every - state.step
        return (n, text) if n <= n_max else (n_max, "")

    def _sample_slip(self, phase: Phase, inside: Any, n: int, reached: int) -> None:
        """Add the points of the curve after n up to `reached` steps since the phase began."""
        state, every, N_x = self.state, self.method.sample, self.scene.N_x
        first = ((state.step + n) // every + 1) * every
        for step in range(first, state.step + reached + 1, every):
            s = (step - state.step) * state.dt
            y = inside(s)
            (v, _), (load, _) = phase.speeds(s, y), phase.interface.loads(y[:N_x], s)
            F_T = phase.interface.F_T
            force = F_T[0] + F_T[1] * s + F_T[2] @ y[:N_x]
            self.history.add(np.array([[state.t0 + step * state.dt, force]]))
            u_x, theta = state.y[0, 0] + y[:N_x], np.exp(phase.log_theta(y))
            self.add_motion({"theta": theta, "u_x": u_x, "v_x": v, "f": -load})

    def _put(self, phase: Phase, y: np.ndarray, n: int) -> None:
        """Set the state to that after n steps of a phase."""
        state, scene, N_x = self.state, self.scene, self.scene.N_x
        v, _ = phase.speeds(n * state.dt, y)
        u_x = state.y[0, 0] + y[:N_x]
        state.theta[:] = np.exp(phase.log_theta(y))
        state.step += n
        t, fastest = just_after(state), float(np.abs(v).max())
        fastest = max(fastest, scene.driver.fastest)
        tau = MOVED * float(np.min(scene.law.D_c)) / fastest if fastest else state.dt
        now = self._at(u_x, t, ~phase.closed, 0.0, v)
        ahead = self._at(u_x, t, ~phase.closed, tau, v)
        state.y[:, :2], state.rod[:3] = now
        state.y[:, 2:], state.rod[3:] = (ahead[0] - now[0]) / tau, (ahead[1] - now[1]) / tau
        if scene.rigid:
            X, Z, phi = state.rod[3:]
            state.y[-1, 2], state.y[-1, 3] = X, Z + phi * scene.x
        state.y[0, 0, phase.closed], state.y[0, 2, phase.closed] = (
            u_x[phase.closed],
            v[phase.closed],
        )
        state.margin[:] = scene.law.kind.v_slip - np.abs(v)
        self.log.speeds[:N_x] = v
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
