"""Hybrid engine: full dynamics in events, closed forms while all blocks stick or slip slowly.

Events are integrated as in full dynamics, by the same core and with the same time steps. When
nothing slips any more, or slip is slow, the run jumps to the last step before a contact state can
change (`jump`). It continues there with the remaining oscillation. Jumps end at the breakpoints of
a protocol.

If no jump is possible, the engine makes steps. A slider that never comes to rest is integrated in
full, and a note in the record says so.

Source: PRL 107, 074301 (2011) for the model.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines.cost import work, work_of_step
from pyfric.engines.dynamic import Run
from pyfric.engines.engine import Engine
from pyfric.engines.integration import integrate, just_after
from pyfric.engines.jump import LONGEST, Jump, Landing, Stale, Wait
from pyfric.engines.limits import Limits
from pyfric.engines.moving import ASIDE, has_parts, steps_of_parts
from pyfric.engines.options import Options, owned
from pyfric.engines.path import Outside, path_from, rest
from pyfric.engines.rests import RestStates
from pyfric.engines.slipping import slides
from pyfric.engines.slow_slip import RateHybridRun, mostly_stepped
from pyfric.engines.works import add_jump
from pyfric.statics import (
    EquilibriumError,
    RememberedStates,
    Weakening,
    check_rests,
    check_sticks,
)
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.engines.modes import Modes
    from pyfric.engines.space import Space
    from pyfric.record import Record
    from pyfric.scene import Scene

AMPLIFIED = 250.0
"""Factor by which events amplify errors of jumps. The error of forces in later events was at most
this many times the largest estimated error of a jump, in 27 sets of off-box scenes."""
FAST = 10.0
"""Slip speed over that of the driver above which no jump over slip is tried: a static path has such
speeds just before slip becomes unstable only."""
SPENT = 1 / 4
"""Largest work of all attempts to jump, over that of full dynamics up to the same time. An attempt
waits for it, so that no run takes much longer than full dynamics."""


class HybridRun(Run):
    """A run that steps through events and jumps between them."""

    name = "hybrid"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        _, quiet = core.room_of_step(self.scene.N_x, self.method.switching)
        self.log = self.new_log(quiet)
        self.accuracy = self.method.accuracy * self.scene.F_N / AMPLIFIED  # of one jump, N
        counted = "jumps", "steps_spared", "attempts", "landings", "slides", "modal_bases"
        self.made |= dict.fromkeys(counted, 0)
        self.rests = RestStates(self.known, self.method.dt, self.method.stepper, self.made)
        self.solver = RememberedStates(self.rests)
        # Neither a jump nor a wait takes less work in full dynamics than an attempt, or a refusal.
        self.wait = math.ceil(self._as_steps({"attempts": 1}))
        self.least = math.ceil(self._as_steps({"attempts": 1, "landings": 1}))
        self.least_slide = math.ceil(self._as_steps({"slides": 1}))
        self.worth = self.state.step
        self.begun = self.worth - self.counts["steps"] - self.counts["steps_spared"]
        self.slides = slides(self.scene.law) and not self.method.budget
        self.limits = Limits(self.known)
        self.parts = has_parts(self.scene) and not (self.method.budget or self.method.threshold)

    def _in_core(self, state: State, n_steps: int) -> core.Status:
        if not self.parts:
            return super()._in_core(state, n_steps)
        how = self.method.stepper, self.method.switching
        return steps_of_parts(self.rests.of_loaded, self.model, state, self.log, n_steps, *how)

    def _way(self) -> np.ndarray:
        """Return the direction of blocks that slip, 0 elsewhere, shape (N_x,)."""
        mode = self.state.mode
        return np.where(np.abs(mode) == 1, mode, 0)

    def _waits(self) -> int:
        """Return for how many steps no jump over slip is tried.

        Slip has to be slow, and to go on unchanged for as many steps as an attempt costs.
        """
        state, slips = self.state, self._way() != 0
        if not slips.any():
            return 0
        if not self.slides:  # the core returns when the last block stops, apart from corner slip
            return self.wait if state.corner[slips].all() else LONGEST
        V = self.scene.piece("V", just_after(state)).at(state.t), self.scene.V_top
        if np.abs(state.y[0, 2, slips]).max() > FAST * np.abs(V).max():
            return self.least_slide
        lasts = (state.t - state.t_0[slips].max()) / state.dt
        return max(self.least_slide - math.floor(lasts), 0)

    def call_length(self) -> int:
        """Return how many steps may be made before the next attempt to jump."""
        length = self._waits() or max(1, self.worth - self.state.step)
        return min(length, ASIDE) if self.parts else length

    def before_call(self, last: int) -> None:
        """Jump, if an attempt is worth its work."""
        state = self.state
        if self._waits():
            self.worth = self._paid_off()  # an event ends what the last attempt waits for
        elif state.step >= self.worth:
            wait = self.jump(last)
            self.worth = max(state.step + wait, self._paid_off())

    def _paid_off(self) -> int:
        """Return the step by which all attempts so far take a share `SPENT` of the work."""
        return self.begun + math.ceil(self._spent() / SPENT)

    def _spent(self) -> float:
        """Return the number of steps that take as long as all attempts to jump so far.

        Those of the run that it continues are included.
        """
        names, counts = ("attempts", "landings", "slides", "modal_bases"), self.counts
        return self._as_steps({name: counts[name] for name in names})

    def _as_steps(self, counts: dict[str, int]) -> float:
        """Return the number of steps that take as long as counted operations."""
        scene, geometry = self.scene, self.method.geometry
        return work(scene, geometry, counts) / work_of_step(scene, geometry, self.method.stepper)

    def notes(self) -> tuple[str, ...]:
        """Return the notes, with one more if jumps spared little."""
        notes = super().notes()
        if self.method.geometry == "finite" and self.scene.slider.dashpots == "along":
            notes += ("hybrid: jumps leave out how dashpots along bonds turn during a jump",)
        return notes + mostly_stepped(
            self.counts,
            "the slider slipped, its ring-down was too large for jumps with an accuracy of "
            f"{self.method.accuracy:g} F_N, or events came too soon",
        )

    def jump(self, last: int) -> int:
        """Jump to the last step before a contact state can change.

        Return the number of steps until the next attempt.
        """
        state = self.state
        closed, way, n_max = state.mode != OPEN, self._way(), self.piece_ends(last) - state.step
        if n_max <= 0:
            return 1
        if self.method.budget and way.any():  # its heat would not be known
            return self.wait
        wait = self.least_slide if way.any() else self.wait
        touches = state.y[0, 1] + self.scene.gap < 0
        if not closed.any() or (self.scene.bare & (touches != self.known.pressed)).any():
            return wait
        known = self.limits.solver(just_after(state), state.t, way.any())
        if known is None:
            return n_max
        if known is not self.rests.known:
            self.rests = RestStates(known, state.dt, self.method.stepper, self.made)
        self.made["attempts"] += 1
        outside = Outside(self.known, state.t, just_after(state))
        found = (
            self._slipping(closed, way, outside) if way.any() else self._resting(closed, outside)
        )
        if found is None:
            return wait
        modes, start = found
        landing = self._landing(modes, outside, start, n_max)
        if isinstance(landing, Stale) and not way.any():
            modes = self.rests.renew(closed, start[0])
            landing = self._landing(modes, outside, start, n_max)
        if not isinstance(landing, Landing):
            return max(landing.steps, wait)
        self._sample_jump(landing, outside)
        full = landing.n == n_max
        n = self._ends_after(landing.n)
        end = state.step + n
        if n:
            landing = self._landing(modes, outside, start, n)
        if isinstance(landing, Landing):
            self._land(landing, modes.space)
        while state.step < end:
            self.call(end - state.step)
        return 1 if full else self.wait

    def _resting(
        self, stuck: np.ndarray, outside: Outside
    ) -> tuple[Modes, tuple[np.ndarray, np.ndarray]] | None:
        """Return the modes and the static state, if nothing slips, or None if none is found."""
        where = self.state.y[0, 0], stuck, outside.drive, outside.load
        start = self.rests.at(*where, self.accuracy, self._coordinates()[0])
        return None if start is None else (self.rests.modes(stuck), start)

    def _slipping(
        self, closed: np.ndarray, way: np.ndarray, outside: Outside
    ) -> tuple[Modes, tuple[np.ndarray, np.ndarray]] | None:
        """Return the modes and the static state, if blocks slip, or None if none is stable."""
        state, q = self.state, self._coordinates()[0]
        self.made["slides"] += 1
        weakening = Weakening(self.scene.law, way, state.s_0, state.y[0, 0])
        try:
            modes = self.rests.slipping(closed, weakening, q)
        except EquilibriumError:
            return None
        if modes.grows:
            return None
        found = rest(modes, q, outside.drive, outside.load, self.accuracy)
        return None if found is None else (modes, found[:2])

    def _ends_after(self, n: int) -> int:
        """Return after how many of a jump's n steps a condition ends the run, or 0 if none does.

        The loading curve is cut there.
        """
        if self.stopping is None:
            return 0
        self.look()
        t, _ = self._samples(n)
        due, text = self.stopping.due()
        last = int(np.searchsorted(t, due))
        if last == len(t):
            return 0
        self.history.cut(self.history.n - len(t) + last + 1)
        self.ending = self.stopping.named(text)
        every = self.method.sample
        return (self.state.step // every + 1 + last) * every - self.state.step

    def _coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the present coordinates (m) and their rates (m/s), shape (n_q,)."""
        state, known = self.state, self.known
        q = known.coordinates(state.y[:, :2], state.rod[:3])
        return q, known.coordinates(state.y[:, 2:], state.rod[3:])

    def _landing(
        self,
        modes: Modes,
        outside: Outside,
        start: tuple[np.ndarray, np.ndarray],
        n_max: int,
    ) -> Landing | Wait | Stale:
        """Return the end of a jump from the present state, or a reason to wait."""
        state, slips = self.state, len(modes.space.slips)
        drift = None if slips else self.rests.start(modes.space.stuck).drift
        path = path_from(modes, outside, *start, drift)
        q, v = self._coordinates()
        behind, slower = path.q[0] + path.lag[0], path.q[1] + path.lag[1]
        motion = modes.split(q - behind, v - slower)
        how = {"dt": state.dt, "accuracy": self.accuracy, "least": self.least}
        how |= {"wait": self.wait, "loose": self.method.accuracy * self.scene.F_N}
        jump = Jump(modes, outside, path, motion, state.t - state.t_0, **how)
        landing = jump.land(n_max, self.piece_ends(state.step + LONGEST) - state.step)
        self.made["landings"] += jump.predicted
        return landing

    def _samples(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the sample times in a jump of n steps: since t = 0, and since now, in s."""
        state, every = self.state, self.method.sample
        steps = np.arange((state.step // every + 1) * every, state.step + n + 1, every)
        return state.t0 + steps * state.dt, (steps - state.step) * state.dt

    def _sample_jump(self, landing: Landing, outside: Outside) -> None:
        """Add the samples of a jump to the loading curve."""
        (t, s), scene = self._samples(landing.n), self.scene
        moved = landing.jump.u_h(s) - np.mean(self.state.u_drv0)
        stretch = outside.drive_at(s) - scene.d * moved
        unknown = np.full((len(t), len(self.history.names) - 2), np.nan)
        self.history.add(np.column_stack([t, scene.driver.K * stretch, unknown]))
        self._sample_motion(s, landing)

    def _sample_motion(self, s: np.ndarray, landing: Landing) -> None:
        """Add the motion at times s (s) in a jump, linear between its ends; f is not known."""
        if not self.moving:
            return
        begin, lasts = self.state.y[0, 0].copy(), landing.n * self.state.dt
        moves, end = self.state.mode != STUCK, self.known.displacements(landing.q)[0][0, 0]
        v = np.where(moves, end - begin, 0.0) / lasts if len(s) else begin
        for after in s:
            unknown = np.full(len(begin), np.nan)
            self.add_motion({"u_x": begin + v * after, "v_x": v, "f": unknown})

    def _land(self, landing: Landing, space: Space) -> None:
        """Set the state to the end of a jump."""
        state, n = self.state, len(space.held)
        if self.method.budget:
            add_jump(self.known, self.model, state, landing, self._coordinates()[0])
        if not len(space.slips):
            self.rests.keep(state.y[0, 0], space.stuck, landing)
        self._put(landing.q, landing.v, state.y[0, 0].copy(), landing.n)
        state.margin[:] = 0.0
        state.margin[space.held] = np.minimum(landing.gaps[:n], landing.gaps[n : 2 * n])
        if self.method.budget and self.history.last[0] == state.t:  # energies here are known
            self.history.cut(self.history.n - 1)
            self.sample()

    def _put(self, q: np.ndarray, v: np.ndarray, u_x: np.ndarray, n: int) -> None:
        """Set coordinates q and rates v, n steps later; stuck blocks stay at u_x."""
        state, known, held = self.state, self.known, self.state.mode == STUCK
        state.y[:, :2], state.rod[:3] = known.displacements(q)
        state.y[:, 2:], state.rod[3:] = known.displacements(v)
        state.y[0, 0, held], state.y[0, 2, held] = u_x[held], 0.0
        state.step += n
        self.log.speeds[:-1] = state.y[0, 2]
        self.good = None
        self.made["jumps"] += 1
        self.made["steps_spared"] += n


def check_scene(scene: Scene) -> None:
    """Raise SceneError for a scene without rests, or slow slip, to jump over."""
    check_rests(scene)
    if not scene.law.flows:
        check_sticks(scene)
    elif np.any(scene.gap):
        reason = "steps without inertia between events leave gaps out"
        gap, allowed = float(np.max(scene.gap)), "0 m, or fidelity = 'dynamic'"
        raise SceneError("interface.gap", gap, "m", allowed, reason)


def follow(scene: Scene, t_end: float, options: Options, **how: Any) -> Record:
    """Run a scene; between events of rate-and-state friction inertia is left out."""
    return integrate(RateHybridRun if scene.law.flows else HybridRun, scene, t_end, options, **how)


HYBRID = Engine(
    name=HybridRun.name,
    models="dynamics inside events, closed forms or slip without inertia between them",
    leaves_out=("fast modes, once they have nearly decayed",),
    options=owned("run", "events", "steps", "energies"),
    jumps=True,
    steppers=("rk4", "rk46", "rk46_waves", "imex"),
    check=check_scene,
    follow=follow,
)
