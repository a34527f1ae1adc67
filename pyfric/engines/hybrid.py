"""Hybrid engine: dynamics where the interface slips, closed forms where it waits.

Events are integrated like in full dynamics, by the same core and on the same steps in time. Once
nothing slips any more, the slider rings down: `ringdown` follows its slow modes in closed
form and bounds the rest. The run jumps to the last step before a contact state can change, and
goes on there, with the modes that are left. What the jump drops is smaller than `REMAINDER`.

Where a protocol has a corner, jumps end and the static state is found anew. Between corners the
driver's speed and the loads are straight over time, so that the static state moves along a parabola
and the slider lags behind it by an amount that is straight over time, which are followed exactly.

Where a jump is not safe, steps are made: a slider that never comes to rest is integrated in full,
and the record says so.

Source: PRL 107, 074301 (2011) for the model.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines.creeping import Creeping
from pyfric.engines.crossing import first_crossing
from pyfric.engines.dynamic import Run, just_after, last_step
from pyfric.engines.fine import is_fine
from pyfric.engines.guard import LINEAR, largest_strain
from pyfric.engines.ringdown import STRAINED, Course, Frozen, Held, Rest
from pyfric.statics import LARGE, EquilibriumError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.scene import Piece
    from pyfric.statics import Equilibrium, StaticSolver

__all__ = ["REMAINDER", "HybridRun"]

REMAINDER = 1e-3
"""What a jump may neglect: its bound of the change of any contact force, over F_N/N_x."""
LOOK = 24
"""Steps between two looks whether a jump is possible; grows while it is not."""
LONGEST, PATIENT = 64, 8
"""Longest time between two looks, over `LOOK`; on lattices of more than `LARGE` unknowns, where a
look costs as much as a few dozen steps."""
SHORTEST = 64
"""Shortest jump worth its cost, in steps."""
CALMING = 10
"""Decay of what modes leave out soon after slip, over its bound: what says when to look again."""
MOSTLY = 0.5
"""A larger share of time that is integrated is noted in the record."""
ENOUGH = 2e-10
"""Residual forces of static states in finite geometry, over F_N/N_x. Which residual is left depends
on rounding: with this one, runs on other OpenBLAS kernels or threads keep forces to 1e-12 F_N, with
2e-7 to 2e-9 F_N, at the price of one step of Newton's method in two states."""
FIRST = 1e-8
"""The same where a jump begins: what is wrong there rings down with the modes."""
NEAR, CLOSE = 3e-5, 3e-4
"""In finite geometry, static states differ by tangents while the driver moves by this share of
F_N/K: by a tangent nearby, over a few dozen steps of the paper's scenes, and by their own."""
ALIKE = 0.4
"""In finite geometry, rates, drift and lag where the last jump ended hold where the next begins if
stiffnesses have changed by less than this share of `strained`. That leaves modes of 1e-9 F_N in the
paper's scenes, which ring down: where the jump ends, all three are found anew."""
TRIES = 8
"""Most static states that are found to see where a jump ends."""
FAR = 0.02
"""In finite geometry, F_T over t is followed by the slope at the end up to this change over F_N."""
STRAINED_ERROR = 1e-4
"""Start and arrest forces at strains of 0.1 to 0.2 in finite geometry, against full dynamics, over
F_N: measured 4e-5 at 0.13 and 9e-5 at 0.19."""
EXCHANGES = 20
"""Most changes of the blocks that touch; few are needed."""
KEPT = 8
"""Contact states whose modes are kept."""


class _Outside(NamedTuple):
    """What is outside the slider: way of the driver (m); F_N and T (N) where they change."""

    drive: float
    load: tuple[float, float] | None = None

    def far(self, other: _Outside, K: float) -> float:
        """Return how far both are apart, in N."""
        loads = zip(self.load or (), other.load or (), strict=False)
        return K * abs(self.drive - other.drive) + sum(abs(a - b) for a, b in loads)


class _Statics:
    """Static states, remembered, and the slider with fixed contact states that goes with each."""

    def __init__(self, known: StaticSolver, dt: float) -> None:
        self.known, self.dt = known, dt
        self._frozen: dict[bytes, Frozen] = {}
        self._held: dict[bytes, Held] = {}
        self._found: dict[tuple[bytes, bytes], dict[_Outside, Rest | Equilibrium]] = {}
        self._moved: dict[tuple[bytes, bytes, _Outside], Rest] = {}
        self._last: Equilibrium | None = None

    def frozen(self, stuck: np.ndarray) -> Frozen:
        """Return the slider with these blocks held and all others open."""
        key = stuck.tobytes()
        if key not in self._frozen:
            while len(self._frozen) >= self._room():
                del self._frozen[next(k for k in self._frozen if 0 in k)]
            self._frozen[key] = Frozen(self.known, stuck, self.dt, self._closed(stuck))
            self._held.pop(key, None)
        return self._frozen[key]

    def held(self, stuck: np.ndarray) -> Held:
        """Return the same without modes, which take most of the time and memory."""
        key = stuck.tobytes()
        if key in self._frozen:
            return self._frozen[key]
        if key not in self._held:
            while len(self._held) >= self._room():
                del self._held[next(iter(self._held))]
            self._held[key] = Held(self.known, stuck, self._closed(stuck))
        return self._held[key]

    def _room(self) -> int:
        """Return how many sliders are kept: few where each has its own tangent."""
        few = self.known.geometry == "finite" and len(self.known.load) > LARGE
        return 2 if few else KEPT

    def _closed(self, stuck: np.ndarray) -> Frozen | None:
        """Return the slider with all blocks held, from which lattices with fine modes open some."""
        if not is_fine(self.known.scene, self.known.geometry) or stuck.all():
            return None
        return self.frozen(np.ones_like(stuck))

    def tangent_at(
        self, frozen: Frozen, q: np.ndarray, strained: float
    ) -> tuple[Frozen, np.ndarray]:
        """Return the slider with these contact states and a tangent near q, and the rest to q's."""
        found, stiffer = frozen.tangent_at(q, strained)
        self._frozen[frozen.stuck.tobytes()] = found
        return found, stiffer

    def rest(
        self,
        u_x: np.ndarray,
        at: _Outside,
        open_: np.ndarray,
        start: np.ndarray | None = None,
        *,
        imagined: bool = False,
    ) -> Rest | None:
        """Return the static state, None if it has not exactly these open blocks.

        It may be `imagined` in linear geometry: motions about it are followed while they keep the
        contacts as they are, whether or not it would.

        In finite geometry the search starts from coordinates `start`, and residual forces up to
        `ENOUGH` F_N/N_x stay; or else from the last state, and up to `FIRST` F_N/N_x stay.
        """
        if open_.all():  # nothing carries F_N
            return None
        if self.known.geometry == "linear":
            held = self.held(~open_)
            rest = held.rest(u_x, *at)
            if not held.fits(rest):
                return rest if imagined else None
        else:
            left = FIRST if start is None else ENOUGH
            left *= self.known.scene.F_N / self.known.scene.N_x
            begin = self._last
            if start is not None and begin is not None:
                u, rod = self.known.displacements(start)
                begin = dataclasses.replace(begin, u=u, rod=rod)
            how = {"free": open_, "start": begin, "enough": left, "load": at.load}
            try:
                here = self._frozen.get((~open_).tobytes())
                how["factor"] = here and here.factor
                state = self.known.solve(u_x, at.drive, **how)
            except EquilibriumError:
                return None
            if (state.open != open_).any():
                return None
            self._last = state
            q = self.known.coordinates(state.u, state.rod)
            rest = Rest(q, state.f, state.tau, state.p, state.u[0, 1], state.F_T)
        if rest is not None:
            self.keep(u_x, at, open_, rest)
        return rest

    def keep(self, u_x: np.ndarray, at: _Outside, open_: np.ndarray, rest: Rest) -> None:
        """Remember a static state."""
        self._states(u_x, open_)[at] = rest._replace(q=None)

    def near(self, here: _Outside, there: _Outside, share: float = NEAR) -> bool:
        """Whether two static states of one interface differ by tangents."""
        scene = self.known.scene
        few = share * scene.F_N
        return self.known.geometry == "linear" or here.far(there, scene.driver.K) <= few

    def solve(
        self,
        u_x: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
    ) -> Rest | Equilibrium:
        """Return the static state, for the catalogue."""
        states, here = self._states(u_x, free), _Outside(float(drive), load)
        key = u_x.tobytes(), free.tobytes(), here
        alike = [one for one in states if one.load == load]
        at = min(alike, key=lambda one: abs(one.drive - here.drive), default=None)
        if at not in (None, here) and key not in self._moved and self.near(at, here):
            moved = self.held(~free).driven(states[at], at.drive, here.drive)
            if moved is not None:
                self._moved[key] = moved
        if key in self._moved:
            return self._moved[key]
        if here not in states and self.rest(u_x, here, free) is None:
            state = self._settled(u_x, here, free)
            states[here] = state or self.known.solve(u_x, here.drive, free=free, load=load)
        return states[here]

    def _settled(self, u_x: np.ndarray, at: _Outside, free: np.ndarray) -> Rest | None:
        """Return a state of a large lattice in which free blocks touch, None if others lift off."""
        closed, carries = self._closed(~free), ~free
        if closed is None:
            return None
        for _ in range(EXCHANGES):
            held = Held(self.known, ~free, closed, carries=carries)
            rest = held.rest(u_x, *at)
            wrong = held.wrong(rest)
            if not wrong.any():
                return rest._replace(q=None)
            if (wrong & ~free).any():
                return None
            carries = carries ^ wrong
        return None

    def _states(self, u_x: np.ndarray, open_: np.ndarray) -> dict[_Outside, Rest | Equilibrium]:
        """Return the static states found with this interface, by what is outside."""
        return self._found.setdefault((u_x.tobytes(), open_.tobytes()), {})


class _Quiet(NamedTuple):
    """A static state about which the slider rings, its time, its open blocks, where it goes.

    In finite geometry `stiffer` is how much the bonds are stiffer than in `frozen`.
    """

    t: float
    open: np.ndarray
    frozen: Frozen
    growth: np.ndarray
    rest: Rest
    margins: np.ndarray
    course: Course
    pieces: Sequence[Piece]
    stiffer: np.ndarray | None


class HybridRun(Run):
    """A run that steps through events and jumps between them."""

    name = "hybrid"
    keeps_budget = False
    steppers = ("rk4",)
    remainder, strained = REMAINDER, STRAINED

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        _, quiet = core.room_of_step(self.scene.N_x, self.method.switching)
        self.log = core.Log(self.scene.N_x, quiet=quiet)
        self.solver = _Statics(self.solver.known, self.method.dt)
        self.jumps, self.jumped, self.wait, self.calm = 0, 0, LOOK, 0
        self.longest = LONGEST * LOOK if len(self.solver.known.load) <= LARGE else PATIENT * LOOK
        self.look_at = self.state.step
        self.quiet_key: tuple[bytes, float] | None = None
        self.quiet_now: _Quiet | None = None
        self.ended: _Quiet | None = None  # where the last jump ended
        self.slid = False
        self._creepings: dict[float, Creeping] = {}
        fastest = self.scene.driver.fastest
        self.creeps = Creeping.possible(self.scene, self.method.geometry, fastest)

    def _slips(self) -> np.ndarray:
        return np.abs(self.state.mode) == 1

    def _outside(self, t: float) -> _Outside:
        """Return what is outside the slider at t (s)."""
        return _Outside(self.scene.drive(t), self.scene.load_at(t))

    @property
    def creeping(self) -> Creeping | None:
        """Jumps over stable slip, None where stable slip is not followed."""
        scene, known, t = self.scene, self.solver.known, just_after(self.state)
        if not self.creeps:
            return None
        V, *loads = (scene.piece(what, t) for what in ("V", "F_N", "T"))
        first = scene.load_at(0.0)
        steady = V.slope == 0 and all(one.slope == 0 for one in loads)
        steady &= first is None or (*first,) == tuple(one.value for one in loads)
        if not (steady and Creeping.possible(scene, self.method.geometry, V.value)):
            return None
        if V.value not in self._creepings:
            self._creepings[V.value] = Creeping(scene, known, self.remainder, V.value)
        return self._creepings[V.value]

    def _piece_ends(self, last: int) -> int:
        """Return the last step that a jump may end with: `last`, or the last before a corner."""
        state, t = self.state, just_after(self.state)
        corner = next((one for one in self.scene.corners if one > t), math.inf)
        if math.isinf(corner):
            return last
        return min(last, last_step(state.t0, state.dt, corner) - 1)

    def call_length(self) -> int:
        """Return how many steps may be made before the next look."""
        slips = self._slips()
        if slips.any() and self.creeping is None:
            # the core returns when the last block stops, corner slip aside
            return LOOK if self.state.corner[slips].all() else 2**30
        return max(1, self.look_at - self.state.step)

    def before_call(self, last: int) -> None:
        """Jump if nothing slips and it is safe."""
        state, slips = self.state, bool(self._slips().any())
        if slips != self.slid or (slips and self.creeping is None):
            self.look_at, self.wait, self.slid = state.step, LOOK, slips
        if slips and self.creeping is None:
            return
        if state.step >= self.look_at:
            self.calm = 0
            moved = self.slide(last) if slips else self.jump(last)
            self.look_at = state.step + max(self.wait, self.calm)
            self.wait = LOOK if moved else min(2 * self.wait, self.longest)

    def counts(self) -> dict[str, int]:
        """Return steps, block evaluations, jumps and the steps they spared."""
        made = super().counts()
        old = self.before.counts if self.before else {}
        return made | {
            "jumps": self.jumps + old.get("jumps", 0),
            "steps_spared": self.jumped + old.get("steps_spared", 0),
        }

    def notes(self) -> tuple[str, ...]:
        """Say so where strains are large or the slider hardly ever came to rest."""
        notes, done = super().notes(), self.counts()
        F_T = max(abs(row[1]) for row in self.rows)
        strain = largest_strain(self.scene, F_T, self.state.t)
        if self.method.geometry == "finite" and strain > LINEAR and self.jumps:
            notes += (
                f"hybrid: strains reach about {strain:.2g}, above {LINEAR:g}: jumps follow modes "
                f"of small motions, which leaves up to {STRAINED_ERROR:g} F_N in forces of events",
            )
        share = done["steps"] / max(done["steps"] + done["steps_spared"], 1)
        if share <= MOSTLY or done["steps"] < 1000:
            return notes
        return (
            *notes,
            f"hybrid: {100 * share:.0f} % of the time was integrated like in full dynamics (more "
            f"than {100 * MOSTLY:.0f} %), because the slider was hardly ever at rest",
        )

    def jump(self, last: int) -> bool:
        """Go to the last step before a contact state can change; False if that is too near."""
        state, scene = self.state, self.scene
        dt, most = state.dt, self._piece_ends(last) - state.step
        quiet = self._now_quiet() if most > 0 else None
        if quiet is None:
            return False
        frozen, rest, known, course = quiet.frozen, quiet.rest, self.solver.known, quiet.course
        since = state.t - quiet.t
        w = known.coordinates(state.y[:, :2], state.rod[:3])
        w -= rest.q + course.path(since)
        v = known.coordinates(state.y[:, 2:], state.rod[3:]) - course.speed(since)
        motion = frozen.split(w, v)
        unit = scene.F_N / scene.N_x
        bound = frozen.bounds(motion)
        rate, bend = course.margin_rate, course.margin_bend
        modal = np.column_stack([frozen.modal * (frozen.weight * motion.a), -bound])
        finite = self.method.geometry == "finite"
        if finite and frozen.bend(motion.a) > self.remainder * unit:
            return False
        rates = np.append(quiet.growth, -frozen.decay)
        end = quiet
        for _ in range(TRIES):
            c = quiet.margins + (rate + (0.5 * since) * bend) * since
            c += course.margin_lag + since * course.margin_lag_rate
            slope = rate + since * bend + course.margin_lag_rate
            c, slope, bent, waves = frozen.aged(state.t - state.t_0, c, slope, bend, modal)
            self.calm = self._until_calm(frozen.decay, c, waves)
            if self.calm:
                return False
            s = first_crossing(c, slope, waves, rates, most * dt, dt, bent)
            n = min(math.floor(s / dt), most)
            left = frozen.left(motion, n * dt)
            if left > self.remainder * unit or n < min(most, SHORTEST):
                return False
            t = state.t0 + (state.step + n) * dt
            fresh = end is not quiet or self.ended is None or course is not self.ended.course
            if fresh and self.solver.near(self._outside(t), self._outside(end.t), CLOSE):
                break
            end = self._ahead(quiet, end, t)
            if end is None:
                return False
            rates[:-1] = end.growth
            to, there = end.t - quiet.t, end.course.margin_rate
            mean = (end.margins - quiet.margins) / to
            rate, bend = 2 * mean - there, (2 / to) * (there - mean)  # a parabola
        else:
            return False
        rest = frozen.moved(end.rest, end.course, t - end.t)
        if finite:
            self.solver.keep(state.y[0, 0], self._outside(t), quiet.open, rest)
        if end is not quiet:
            self.ended, self.quiet_key = end, None  # a jump from there has the tangent of there
        margins = c + (slope + (0.5 * n * dt) * bent) * (n * dt)
        margins += (waves[:, :-1] @ np.exp(end.growth * (n * dt))).real
        self._sample_jump(quiet, end, rest.F_T, motion.a, n)
        self._land(rest.q, end, motion.a, n)
        state.margin[:] = frozen.margin(margins)
        return True

    def _until_calm(self, decay: float, c: np.ndarray, waves: np.ndarray) -> int:
        """Return after how many steps, roughly, what modes leave out is below the margins."""
        left, most = c + waves[:, :-1].sum(axis=1).real, -waves[:, -1].real
        low = left <= most
        if not low.any() or (left[low] <= 0).any():
            return 0
        loud, rate = float(np.max(most[low] / left[low])), CALMING * decay * self.state.dt
        return math.ceil(min(math.log(loud), 4 * self.wait * rate) / rate) if rate else self.wait

    def _ahead(self, quiet: _Quiet, near: _Quiet, t: float) -> _Quiet | None:
        """Return the static state at t (s), found from one nearby; growth is the mean until then.

        Finite geometry.
        """
        frozen, start = quiet.frozen, near.rest.q + near.course.way(t - near.t)
        rest = self.solver.rest(self.state.y[0, 0], self._outside(t), quiet.open, start)
        if rest is None:
            return None
        stiffer = frozen.stiffer(rest.q)
        growth = frozen.growth_with((quiet.stiffer + stiffer) / 2)
        margins, course = frozen.margins(rest), self._course(frozen, quiet.pieces, t, stiffer)
        return _Quiet(t, quiet.open, frozen, growth, rest, margins, course, quiet.pieces, stiffer)

    def slide(self, last: int) -> bool:
        """Go to the last step before a contact state changes while blocks slip stably."""
        state, scene = self.state, self.scene
        last = self._piece_ends(last)
        if last <= state.step:
            return False
        landing = self.creeping.land(state, lambda: self.solver.frozen(state.mode != OPEN), last)
        if landing is None or landing.n < min(last - state.step, SHORTEST):
            return False
        n, every = landing.n, self.method.sample
        steps = np.arange((state.step // every + 1) * every, state.step + n + 1, every)
        F_T = landing.F_T((steps - state.step) * state.dt)
        self.rows += np.column_stack([state.t0 + steps * state.dt, F_T]).tolist()
        point = landing.point
        self._put(landing.q, landing.v, point.u_x, n)
        state.margin[:] = np.where(state.mode == OPEN, 0.0, scene.law.margin(point.p, point.f))
        return True

    def _now_quiet(self) -> _Quiet | None:
        """Return the static state about which the slider rings, None if there is none."""
        state = self.state
        open_ = state.mode == OPEN
        scene, t = self.scene, just_after(state)
        pieces = [scene.piece(what, t) for what in ("V", "F_N", "T")]
        begin = max(one.t for one in pieces)
        key = state.y[0, 0, ~open_].tobytes() + open_.tobytes(), begin
        if self.quiet_now is None or self.quiet_key != key:
            self.quiet_key, self.quiet_now = key, None
            rest = self.solver.rest(state.y[0, 0], self._outside(state.t), open_, imagined=True)
            if rest is not None:
                frozen, stiffer = self.solver.frozen(~open_), None
                if self.method.geometry == "finite":
                    frozen, stiffer = self.solver.tangent_at(frozen, rest.q, self.strained)
                margins, last = frozen.margins(rest), self.ended
                if self._like_last(frozen, pieces, stiffer):
                    growth, course = last.growth, last.course
                else:
                    growth = frozen.growth if stiffer is None else frozen.growth_with(stiffer)
                    course = self._course(frozen, pieces, state.t, stiffer)
                self.quiet_now = _Quiet(
                    state.t, open_, frozen, growth, rest, margins, course, pieces, stiffer
                )
        return self.quiet_now

    def _like_last(
        self, frozen: Frozen, pieces: Sequence[Piece], stiffer: np.ndarray | None
    ) -> bool:
        """Whether the slider goes on as it did where the last jump ended; see `ALIKE`."""
        last = self.ended
        if last is None or stiffer is None or last.frozen is not frozen or last.pieces != pieces:
            return False
        changed = float(np.abs(stiffer - last.stiffer).max())
        alike = changed <= ALIKE * self.strained * self.scene.slider.k
        return alike and all(one.slope == 0 for one in pieces)

    def _course(
        self, frozen: Frozen, pieces: Sequence[Piece], t: float, stiffer: np.ndarray | None
    ) -> Course:
        """Return where a static state goes on from t (s) on these pieces of V, F_N and T."""
        V, F_N, T = pieces
        more, known = None, self.solver.known
        if F_N.slope or T.slope:  # what loads gain in a second
            more = known.under((F_N.slope, T.slope)).load
        return frozen.course(V.at(t), V.slope, more, stiffer)

    def _sample_jump(self, quiet: _Quiet, end: _Quiet, force: float, a: np.ndarray, n: int) -> None:
        """Add the points of the loading curve in a jump of n steps that ends at a static force."""
        state, every, frozen, course = self.state, self.method.sample, quiet.frozen, quiet.course
        steps = np.arange((state.step // every + 1) * every, state.step + n + 1, every)
        t, s = state.t0 + steps * state.dt, (steps - state.step) * state.dt
        t_end, gain = state.t + n * state.dt, force - quiet.rest.F_T
        x, whole = (t - quiet.t) / (t_end - quiet.t), t_end - quiet.t
        slope = end.course.force_rate + (t_end - end.t) * end.course.force_bend
        over = gain - slope * whole  # a parabola
        if len(t) and abs(gain) > FAR * self.scene.F_N and self.method.geometry == "finite":
            at = self._outside((quiet.t + t_end) / 2)
            middle = self.solver.rest(state.y[0, 0], at, quiet.open)
            if middle is not None:
                over = 4 * (middle.F_T - quiet.rest.F_T) - 2 * gain
        F_T = quiet.rest.F_T + gain * x + over * x * (1 - x)
        modes = frozen.force_modal * (frozen.weight * a)
        F_T += course.force_lag + (t - quiet.t) * course.force_lag_rate
        F_T += (modes @ np.exp(np.outer(end.growth, s))).real
        self.rows += np.column_stack([t, F_T]).tolist()

    def _land(self, q: np.ndarray, quiet: _Quiet, a: np.ndarray, n: int) -> None:
        """Put the state n steps later, where the static state is q."""
        state, course = self.state, quiet.course
        s = state.t - quiet.t + n * state.dt
        w, v = quiet.frozen.deviation(a, n * state.dt, quiet.growth)
        v += course.speed(s)
        self._put(q + course.lag + s * course.lag_rate + w, v, state.y[0, 0].copy(), n)

    def _put(self, q: np.ndarray, v: np.ndarray, u_x: np.ndarray, n: int) -> None:
        """Put coordinates q and their rates v n steps later; stuck blocks are at u_x."""
        state, known = self.state, self.solver.known
        state.y[:, :2], state.rod[:3] = known.displacements(q)
        state.y[:, 2:], state.rod[3:] = known.displacements(v)
        held = state.mode == STUCK
        state.y[0, 0, held], state.y[0, 2, held] = u_x[held], 0.0
        state.step += n
        self.good = None
        self.jumps, self.jumped = self.jumps + 1, self.jumped + n
