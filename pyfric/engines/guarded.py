"""Checked time steps: a run that fails a check returns to the last state that passed."""

from __future__ import annotations

import bisect
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import State, Status
from pyfric.engines.cost import work
from pyfric.engines.grid import at_corner, just_after, last_step, next_corner
from pyfric.engines.guard import STEPS, Guard
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core import Log, Model
    from pyfric.engines.recorder import Recorder
    from pyfric.engines.skip import Span
    from pyfric.record import Method
    from pyfric.scene import Scene

CALL_SECONDS = 0.02
"""Work of one call of the core, in s. Ctrl-C and limits of the run are checked between calls."""
UNFINISHED = (Status.ENDLESS, Status.TOO_SHORT)
"""Status codes of the core for a step that it could not finish."""


class Failure(RuntimeError):
    """A step could not be finished, or its state failed a check; the run ends before this step."""


class Good(NamedTuple):
    """A state that passed the checks of `Guard`, its model, and the result of `Recorder.mark`."""

    state: State
    model: Model
    recorded: tuple[Any, ...]


class GuardedSteps:
    """The checked time steps of one run.

    Args:
        recorder: recorder of the run.
        state: the present state, which steps change in place.
        model: the scene in the form that the core takes.

    Attributes:
        good: the state to which a failed run returns; None means the present state.
        longest: largest number of steps of one call.
        in_core: function of model, state, log and number of steps that makes steps in the core.
    """

    def __init__(self, recorder: Recorder, state: State, model: Model) -> None:
        self.scene, self.method, self.recorder = recorder.scene, recorder.method, recorder
        self.state, self.model = state, model
        self._piece: int | None = None  # piece of the protocols in the model
        scene, stages = self.scene, core.STEPPERS[self.method.stepper].evaluations
        self._per_step = stages * scene.N_x * scene.N_z
        # The length of a call decides when a skip is tried and when a pilot run ends. It follows
        # from counted work, so that it is the same on every machine.
        each = work(scene, self.method.geometry, {"block_evaluations": self._per_step})
        self.longest = min(max(int(CALL_SECONDS / each), 1), STEPS)
        self.guard = Guard(scene, model, self.method.geometry, recorder.known.loaded)
        self.good: Good | None = None
        self.in_core: Callable[[Model, State, Log, int], Status] = self._whole

    def _whole(self, model: Model, state: State, log: Log, n_steps: int) -> Status:
        """Make up to n_steps of the whole lattice; return the status of the core."""
        return core.advance(
            model,
            state,
            log,
            n_steps,
            stepper=self.method.stepper,
            switching=self.method.switching,
            rtol=self.method.rtol or 1.0,
            budget=self.method.budget,
            threads=self.method.threads,
        )

    # --- the model, which follows the protocols --------------------------------------------------

    def follow(self, state: State | None = None) -> Model:
        """Return the model for the piece of the protocols just after a state."""
        state = self.state if state is None else state
        if self.scene.corners:
            t = just_after(state)
            piece = bisect.bisect_right(self.scene.corners, t)
            if piece != self._piece:
                self._piece = piece
                self.model = core.model(self.scene, self.method.geometry, state.u_drv0, t)
                self.guard.model = self.model
        return self.model

    def sample(self) -> None:
        """Add the present state to the curve."""
        self.recorder.sample(self.state, self.follow())

    # --- steps -----------------------------------------------------------------------------------

    def call(self, n_steps: int) -> None:
        """Make up to n_steps and check the state.

        Raises:
            Failure: the core could not finish a step, or the state fails a check.
        """
        if self.good is None:  # a skip may have passed a breakpoint
            self.good = Good(self.state.copy(), self.follow(), self.recorder.mark())
        strained = self._make(n_steps) == Status.STRAINED
        self._check(strained or self.state.step - self.good.state.step >= STEPS)

    def end(self) -> None:
        """Check the state, if steps were made since the last check."""
        if self.good is not None:
            self._check(due=True)

    def skipped(self, span: Span) -> None:
        """Count the steps of a span, at whose end the state already is."""
        made, self.good = self.recorder.made, None
        self.state.step += span.n
        made["jumps"] += 1
        made["steps_spared"] += span.n - span.done

    def make_steps(self, state: State, n_steps: int) -> Status:
        """Make up to n_steps; the state changes in place, and the log is filled.

        A step is shortened or lengthened to end at each breakpoint of a protocol.
        """
        model, log = self.follow(state), self.recorder.log
        corner = next_corner(self.scene, state)
        if not corner < state.t0 + (state.step + n_steps) * state.dt:
            return self.in_core(model, state, log, n_steps)
        last = last_step(state.t0, state.dt, corner)
        if state.step < last - 1:
            return self.in_core(model, state, log, last - 1 - state.step)
        dt, length = state.dt, corner - state.t
        state.t0, state.dt = state.t - state.step * length, length
        status = self.in_core(model, state, log, 1)
        state.t0, state.dt = corner - state.step * dt, dt
        return status

    def _make(self, n_steps: int) -> Status:
        """Make up to n_steps in the core, and record these steps; return the status of the core."""
        state, recorder, step = self.state, self.recorder, self.state.step
        start = time.perf_counter()
        status = self.make_steps(state, n_steps)
        seconds = time.perf_counter() - start
        recorder.made["block_evaluations"] += round(recorder.log.tried * self._per_step)
        if status in UNFINISHED:
            message = unfinished(self.scene, self.method, recorder.log, status)
            self._back_to(step)
            raise Failure(message)
        recorder.made["steps"] += state.step - step
        recorder.seconds += seconds
        recorder.take(state, step)
        if state.step % self.method.sample and at_corner(self.scene, state):
            self.sample()
        return status

    # --- failure ---------------------------------------------------------------------------------

    def _check(self, due: bool) -> None:
        """Raise Failure if the state fails a check; energy and lattice are checked if due."""
        good = self.good
        base = self.guard.energy(good.state, good.model) if due else None
        if self.guard.trouble(good.state, self.state, base) is not None:
            self._fail()
        if due:
            self.good = None

    def _fail(self) -> None:
        """Return to the last step that passes all checks; raise Failure for the step after it."""
        recorder, after, trouble = self.recorder, self.good.state.copy(), None
        base = self.guard.energy(after, self.good.model)
        log, recorder.log = recorder.log, core.Log(self.scene.N_x)
        while trouble is None:
            before = after.copy()
            self.make_steps(after, 1)
            trouble = self.guard.trouble(before, after, base)
        recorder.log = log
        self._back_to(before.step)
        v = np.hypot(before.y[:, 2], before.y[:, 3])
        limit, _ = stability_limit(self.scene, self.method.stepper)
        raise Failure(
            f"{trouble.what} at step {after.step}, t = {after.t:.9g} s, at the block in column "
            f"{trouble.i + 1} from the left, row {trouble.j + 1} from the bottom; one step before, "
            f"speeds reach {v.max():.3g} m/s. dt = {after.dt:g} s is below the limit {limit:.4g} s "
            "of small motions: the strains have left the range of the model; reduce dt, F_N or V"
            + self._located_hint()
        )

    def _located_hint(self) -> str:
        method = self.method
        if method.switching != "located" or core.STEPPERS[method.stepper].growth is not None:
            return ""
        return ", or take switching = 'step_end', because steps of different length can feed energy"

    def _back_to(self, step: int) -> None:
        """Return to the good state, and repeat the steps up to number `step`."""
        self.recorder.back(self.good.recorded)
        self.state, every = self.good.state.copy(), self.method.sample
        while self.state.step < step:
            end = step
            if not self.recorder.every:
                end = min(step, (self.state.step // every + 1) * every)
            self._make(end - self.state.step)
            if self.state.step % every == 0 and not self.recorder.every:
                self.sample()


def unfinished(scene: Scene, method: Method, log: Log, status: Status) -> str:
    """Return the message of a step that the core could not finish."""
    if status == Status.TOO_SHORT:
        return (
            f"the error of an adaptive sub-step stays above rtol = {method.rtol:g} at "
            f"t = {log.t:.9g} s, however short it is; increase rtol"
        )
    return (
        f"contacts switch without end inside one step of dt = {method.dt:g} s: block "
        f"{scene.n_of_i[log.block]} (1 at the trailing edge) between stick, slip and gap at "
        f"t = {log.t:.12g} s, more often than {len(scene.x) * 2 + 100} times are allowed; "
        "switching = 'step_end' or a smaller dt goes on"
    )
