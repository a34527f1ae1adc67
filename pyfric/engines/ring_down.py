"""Ring-down as a skip: closed forms from the end of an event to just before the next event.

While nothing slips, the run jumps to the last step before a contact state can change (`jump`). The
run then goes on with the remaining oscillation. Jumps end at the breakpoints of a protocol.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines.grid import just_after, piece_ends
from pyfric.engines.jump import LONGEST, Jump, Landing, Stale, Wait
from pyfric.engines.limits import Limits
from pyfric.engines.path import Outside, path_from
from pyfric.engines.rests import RestStates
from pyfric.engines.schedule import Schedule
from pyfric.engines.skip import Span, mostly_stepped
from pyfric.engines.works import add_jump
from pyfric.statics import RememberedStates, check_sticks

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.core import State
    from pyfric.engines.guarded import GuardedSteps
    from pyfric.engines.modes import Modes
    from pyfric.engines.space import Space
    from pyfric.scene import Scene
    from pyfric.statics import StaticSolver

AMPLIFIED = 250.0
"""Factor by which events amplify errors of jumps. In 27 sets of scenes
(`reference_data/off_box.py`), errors of forces in later events were at most this factor times the
largest estimated error of a jump."""


class RingDown:
    """The skip over times in which no block slips.

    Args:
        steps: steps of the run.
    """

    check = staticmethod(check_sticks)

    def __init__(self, steps: GuardedSteps) -> None:
        self.steps, self.recorder = steps, steps.recorder
        self.scene, self.method, self.known = steps.scene, steps.method, self.recorder.known
        _, quiet = core.room_of_step(self.scene.N_x, self.method.switching)
        self.recorder.log = self.recorder.new_log(steps.state, quiet)
        self.accuracy = self.method.accuracy * self.scene.F_N / AMPLIFIED  # of one jump, in N
        self.schedule = Schedule(self.recorder, steps.state.step)
        self.rests = self._rests_of(self.known)
        self.recorder.solver = RememberedStates(self.rests)
        self.limits = Limits(self.known)

    def _rests_of(self, known: StaticSolver) -> RestStates:
        """Return the static states of a solver, for jumps."""
        return RestStates(known, self.method.dt, self.method.stepper, self.recorder.made)

    @staticmethod
    def fits(scene: Scene) -> bool:
        """Return whether blocks of a scene rest between events."""
        return scene.law.rests

    def notes(self, counts: Mapping[str, int]) -> tuple[str, ...]:
        """Return a note on dashpots that turn, and a note if jumps saved little work."""
        notes = ()
        if self.method.geometry == "finite" and self.scene.slider.dashpots == "along":
            notes += ("jumps leave out how dashpots along bonds turn during a jump",)
        return notes + mostly_stepped(
            counts,
            "the slider slipped, its ring-down was too large for jumps with an accuracy of "
            f"{self.method.accuracy:g} F_N, or events came too soon",
        )

    # --- times of attempts -----------------------------------------------------------------------

    def wait(self, state: State) -> int:
        """Return the number of steps before the next attempt to jump."""
        if not (steps := self._slips_for(state)):
            return self.schedule.left(state.step)
        self.schedule.forget(state.step)
        return steps

    def _slips_for(self, state: State) -> int:
        """Return the number of steps during which slip prevents a jump."""
        slips = np.abs(state.mode) == 1
        if not slips.any():
            return 0
        # The core returns when the last block stops, apart from corner slip.
        return self.schedule.attempt if state.corner[slips].all() else LONGEST

    # --- a jump ----------------------------------------------------------------------------------

    def span(self, state: State, last: int) -> Span | None:
        """Return a jump to the last step before a contact state can change."""
        span, wait = self._tried(state, piece_ends(self.scene, state, last) - state.step)
        self.schedule.put_off(state.step + (span.n if span else 0), wait)
        return span

    def _tried(self, state: State, n_max: int) -> tuple[Span | None, int]:
        """Return a jump of n_max steps at most, or None, and the number of steps to wait then."""
        wait, closed = self._shortest_wait(state), state.mode != OPEN
        if n_max <= 0:
            return None, 1
        touches = state.y[0, 1] + self.scene.gap < 0
        if not closed.any() or (self.scene.bare & (touches != self.known.pressed)).any():
            return None, wait
        slips = np.abs(state.mode) == 1
        known = self.limits.solver(just_after(state), state.t, slips.any())
        if known is None:
            return None, n_max
        if known is not self.rests.known:
            self.rests = self._rests_of(known)
        self.recorder.made["attempts"] += 1
        outside = Outside(self.known, state.t, just_after(state))
        if (found := self._begin(state, closed, outside)) is None:
            return None, wait
        modes, start = found
        landing = self._landing(state, modes, outside, start, n_max)
        if isinstance(landing, Stale) and not slips.any():
            modes = self.rests.renew(closed, start[0])
            landing = self._landing(state, modes, outside, start, n_max)
        if not isinstance(landing, Landing):
            return None, max(landing.steps, wait)
        return (
            self._jump(state, modes, outside, start, landing),
            1 if landing.n == n_max else self.schedule.attempt,
        )

    def _shortest_wait(self, state: State) -> int:
        """Return the least number of steps to wait after an attempt."""
        return self.schedule.attempt

    def _begin(
        self, state: State, closed: np.ndarray, outside: Outside
    ) -> tuple[Modes, tuple[np.ndarray, np.ndarray]] | None:
        """Return the modes and the static state, or None if no static state is found."""
        where = state.y[0, 0], closed, outside.drive, outside.load
        start = self.rests.at(*where, self.accuracy, self._coordinates(state)[0])
        return None if start is None else (self.rests.modes(closed), start)

    def _coordinates(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (m) of a state and their rates (m/s), shape (n_q,)."""
        known = self.known
        q = known.coordinates(state.y[:, :2], state.rod[:3])
        return q, known.coordinates(state.y[:, 2:], state.rod[3:])

    def _landing(
        self,
        state: State,
        modes: Modes,
        outside: Outside,
        start: tuple[np.ndarray, np.ndarray],
        n_max: int,
    ) -> Landing | Wait | Stale:
        """Return the end of a jump from a state, or the wait before the next attempt."""
        slips = len(modes.space.slips)
        drift = None if slips else self.rests.start(modes.space.stuck).drift
        path = path_from(modes, outside, *start, drift)
        q, v = self._coordinates(state)
        behind, slower = path.q[0] + path.lag[0], path.q[1] + path.lag[1]
        motion = modes.split(q - behind, v - slower)
        how = {"dt": state.dt, "accuracy": self.accuracy, "least": self.schedule.shortest}
        how |= {"wait": self.schedule.attempt, "loose": self.method.accuracy * self.scene.F_N}
        jump = Jump(modes, outside, path, motion, state.t - state.t_0, **how)
        landing = jump.land(n_max, piece_ends(self.scene, state, state.step + LONGEST) - state.step)
        self.recorder.made["landings"] += jump.predicted
        return landing

    def _jump(
        self,
        state: State,
        modes: Modes,
        outside: Outside,
        start: tuple[np.ndarray, np.ndarray],
        landing: Landing,
    ) -> Span:
        """Return a jump to its landing, or to an earlier step at which a condition ends the run."""
        whole = landing
        end, ending = self.recorder.due(state, self.steps.model, state.step + whole.n)
        if ending:
            landing = self._landing(state, modes, outside, start, end - state.step)

        def F_T(s: np.ndarray) -> np.ndarray:
            moved = whole.jump.u_h(s) - np.mean(state.u_drv0)
            return self.scene.driver.K * (outside.drive_at(s) - self.scene.d * moved)

        def motion(s: np.ndarray) -> dict[str, np.ndarray]:
            """Return a motion that is linear between the ends of the jump; f is NaN."""
            begin, lasts = state.y[0, 0], whole.n * state.dt
            moves, end_x = state.mode != STUCK, self.known.displacements(whole.q)[0][0, 0]
            v = np.where(moves, end_x - begin, 0.0) / lasts
            u_x = begin + v * s[:, None]
            return {"u_x": u_x, "v_x": np.tile(v, (len(s), 1)), "f": np.full(u_x.shape, np.nan)}

        def put(state: State) -> None:
            self._land(state, landing, modes.space)

        known = put if isinstance(landing, Landing) else None
        return Span(end - state.step, F_T, motion, known, reach=whole.n, ending=ending)

    def _land(self, state: State, landing: Landing, space: Space) -> None:
        """Set a state to the end of a jump."""
        known, n, stuck = self.known, len(space.held), state.mode == STUCK
        if self.method.budget:
            add_jump(known, self.steps.model, state, landing, self._coordinates(state)[0])
        if not len(space.slips):
            self.rests.keep(state.y[0, 0], space.stuck, landing)
        u_x = state.y[0, 0, stuck].copy()
        state.y[:, :2], state.rod[:3] = known.displacements(landing.q)
        state.y[:, 2:], state.rod[3:] = known.displacements(landing.v)
        state.y[0, 0, stuck], state.y[0, 2, stuck] = u_x, 0.0
        self.recorder.log.speeds[:-1] = state.y[0, 2]
        state.margin[:] = 0.0
        state.margin[space.held] = np.minimum(landing.gaps[:n], landing.gaps[n : 2 * n])
