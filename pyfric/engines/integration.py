"""A run with time steps, from its set-up to its end: steps, and skips between them.

    recorder   data of the run (`pyfric.engines.recorder`)
    steps      full dynamics, checked (`pyfric.engines.guarded`)
    skip       solutions that replace steps (`pyfric.engines.skip`); full dynamics has none

Each call of the core makes a limited number of steps, so that a run can show progress and stop.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pyfric import core
from pyfric.core import State
from pyfric.display import Progress, run_bar
from pyfric.engines.cost import work
from pyfric.engines.engine import ENGINES, Counted
from pyfric.engines.grid import just_after, last_of_run
from pyfric.engines.guarded import Failure, GuardedSteps
from pyfric.engines.loaded import loaded_solver
from pyfric.engines.recorder import Recorder
from pyfric.engines.stopping import stopping_of
from pyfric.engines.strains import strain_notes
from pyfric.record import Record
from pyfric.scene import law_notes
from pyfric.signals import answered
from pyfric.statics import one_thread
from pyfric.values import check_number

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.engines.skip import Skip, Span
    from pyfric.scene import Scene

STATIC_SECONDS, STATIC_SHARE = 1.0, 0.1
"""Least work between two computations of static forces of new events: in s, and over the work so
far. Computations during a run shorten its end."""
SHOWN = 0.1
"""Shortest time between two reports of progress, in s."""
OPEN_BUDGET = 1e-3
"""Relative error of the energy budget above which the record has a note."""

SkipOf = Callable[[GuardedSteps], "Skip"]
"""Function that returns the skip of a run, from its steps."""


class RunError(RuntimeError):
    """A run could not go on. The attribute `record` holds the valid part of the run."""

    def __init__(self, message: str, record: Record) -> None:
        super().__init__(message)
        self.record = record

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, self.record), vars(self)


def integrate(
    engine: str,
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    skip_of: SkipOf | None = None,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    enough: Callable[[Counted], bool] | None = None,
) -> Record:
    """Run a scene with an engine that makes time steps; see `pyfric.simulate`.

    The run ends with status "interrupted" as soon as `enough` returns true.

    Args:
        engine: name of the engine.
        scene: the scene.
        t_end: end of the run, in s.
        options: the options of the run.
        skip_of: function that returns the skip; None for no skip.
        initial: state or record that the run continues.
        progress: as in `pyfric.simulate`.
        enough: function of the run that returns whether to end it.
    """
    before = initial if isinstance(initial, Record) else None
    if before is not None:
        initial = before.final_state
    if initial is not None:
        initial = initial if before is not None else initial.under(scene)
        initial.check_physics(scene)
    t_begin = 0.0 if initial is None else initial.t
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if before is not None and t_begin - initial.dt < t_end < t_begin:
        t_end = t_begin  # a run ends with the step that reaches t_end
    t_end = check_number("t_end", t_end, "s", ge=t_begin)
    method = ENGINES[engine].settled(scene, options, t_begin, t_end)

    # One BLAS thread from here on: more threads slow down banded matrices and small products.
    with run_bar(progress, scene.name, t_begin, t_end) as show, one_thread():
        start = time.perf_counter()
        solver = loaded_solver(scene, method.geometry, None if initial is None else initial.u_drv0)
        dt = method.dt
        state = solver.loaded.state(scene, dt) if initial is None else initial.with_dt(dt)
        stopping = stopping_of(options.stop_when, scene, method.t_gap, before, t_end)
        if stopping is not None and before is None:
            stopping.begin(state)
        model = core.model(scene, method.geometry, state.u_drv0, just_after(state))
        recorder = Recorder(scene, method, solver, state, before, stopping)
        run = Run(GuardedSteps(recorder, state, model), skip_of)
        recorder.timings["set-up"] = time.perf_counter() - start
        last = last_of_run(scene, state, t_end)
        with answered() as stop:
            run.advance(last, lambda: stop() or (enough is not None and enough(run)), show, options)
            done = "complete" if run.steps.state.step >= last else "interrupted"
            return run.record(recorder.ending or done, late=enough is None)


class Run:
    """A run in progress.

    Args:
        steps: its steps, which hold its state and its recorder.
        skip_of: function that returns the skip; None for no skip.
    """

    def __init__(self, steps: GuardedSteps, skip_of: SkipOf | None = None) -> None:
        self.steps, self.recorder = steps, steps.recorder
        self.scene, self.method = steps.scene, steps.method
        if self.recorder.before is None:
            steps.sample()
        self.skip = None if skip_of is None else skip_of(steps)

    @property
    def counts(self) -> dict[str, int]:
        """Counts of steps, of evaluated forces on blocks, and of skips."""
        return self.recorder.counts

    def advance(
        self,
        last: int,
        stop: Callable[[], bool],
        show: Callable[[Progress], None],
        options: Options,
    ) -> None:
        """Go on to step number `last`, or until Ctrl-C or a condition ends the run.

        Raises:
            RunError: a step could not be finished, or its state fails a check.
        """
        start = time.perf_counter()
        try:
            self._advance(last, stop, show, options)
            self.steps.end()
        except Failure as failure:
            raise RunError(str(failure), self.record(f"failed: {failure}")) from None
        self.recorder.timings["stepping"] = time.perf_counter() - start

    def _advance(
        self,
        last: int,
        stop: Callable[[], bool],
        show: Callable[[Progress], None],
        options: Options,
    ) -> None:
        state, recorder = self.steps.state, self.recorder
        saved = shown = time.perf_counter()
        solve_at = STATIC_SECONDS
        while state.step < last and not recorder.ending and not stop():
            n_steps = self._skip(last)
            if state.step < last and not recorder.ending:
                self._step(min(n_steps, last - state.step))
            now = time.perf_counter()
            if now - shown > SHOWN or state.step >= last or recorder.ending:
                shown = now
                show(self._progress(last))
            done = work(self.scene, self.method.geometry, recorder.counts)
            if done > solve_at:  # by work and not by the clock, because skips use these states
                with warnings.catch_warnings(action="ignore"):
                    recorder.catalogue(state)
                solve_at = done + max(STATIC_SECONDS, STATIC_SHARE * done)
            if options.checkpoint is not None and now - saved > options.checkpoint_every:
                recorder.save(options.checkpoint, lambda: self.record("interrupted"))
                saved = time.perf_counter()

    def _skip(self, last: int) -> int:
        """Try to leave out steps; return the number of steps before the next attempt."""
        if self.skip is None:
            return self.steps.longest
        state = self.steps.state
        wait = self.skip.wait(state)
        if not wait:
            span = self.skip.span(state, last)
            if span is not None:
                self._take(span)
            wait = self.skip.wait(state)
        return min(max(wait, 1), self.steps.longest)

    def _take(self, span: Span) -> None:
        """Record a span, and set the state to its end or make steps to this end."""
        steps, recorder, state = self.steps, self.recorder, self.steps.state
        end = state.step + span.n
        recorder.add_span(span, state)
        if span.put is not None:
            span.put(state)
            steps.skipped(span)
            if self.method.budget and recorder.history.last[0] == state.t:  # energies are known
                recorder.history.cut(recorder.history.n - 1)
                steps.sample()
        while state.step < end:
            steps.call(end - state.step)
        recorder.ending = span.ending

    def _step(self, n_steps: int) -> None:
        """Make up to `n_steps` time steps.

        Sample the curve and check conditions, unless the core samples.
        """
        steps, recorder, every = self.steps, self.recorder, self.method.sample
        if recorder.every:
            steps.call(n_steps)
            return
        steps.call(min(n_steps, every - steps.state.step % every))
        if steps.state.step % every == 0:
            steps.sample()
            recorder.look(steps.state, steps.model)

    def _progress(self, last: int) -> Progress:
        """Return the progress of the run towards step number `last`."""
        state, recorder = self.steps.state, self.recorder
        force, begin = recorder.history.last[1] / self.scene.F_N, recorder.history.begin
        rate = recorder.made["steps"] / recorder.seconds if recorder.seconds else 0.0
        end = state.t0 + last * state.dt
        return Progress(state.t, begin, end, force, recorder.events, rate)

    def record(self, status: str, *, late: bool = True) -> Record:
        """Return the record of the run so far; `late` adds event columns that take much time."""
        return self.recorder.record(
            status, self.steps.state, self.steps.follow(), self._notes, late=late
        )

    def _notes(self) -> tuple[str, ...]:
        """Return the notes for the record."""
        scene, method, state = self.scene, self.method, self.steps.state
        curve, engine, notes, more = self.recorder.history.curve(), method.engine, (), []
        if method.geometry == "linear":
            notes = strain_notes(scene, engine, curve["F_T"].abs().max(), state.t)
        missing = self.steps.guard.missing(curve) if method.budget else 0.0
        if missing > OPEN_BUDGET:
            more.append(
                f"the energy budget misses {missing:.2g} of what went through it "
                f"(limit {OPEN_BUDGET:g}): steps of {method.dt:.3g} s damp fast motion; take a "
                "smaller " + ("rtol" if method.rtol else "dt"),
            )
        more += law_notes(scene, state.t, method.dt)
        if scene.law.junctions and method.switching == "step_end":
            late = "junctions break at step ends, which changes single events"
            more.append(f"{late}: switching = 'located'")
        more += core.fork_notes(scene.N_x * scene.N_z)
        if self.skip is not None:
            more += self.skip.notes(self.counts)
        return (*notes, *(f"{engine}: {note}" for note in more))
