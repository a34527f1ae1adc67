"""Full dynamics: the reference engine, and the base class of engines with time steps.

The whole lattice is integrated with a uniform step. The paper's method is classical RK4 with
contact states that switch at the end of a step. Other steppers, and switches located inside the
step, are options. Each call of the core makes a limited number of steps, so that a run can show
progress, stop and go on.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import bisect
import functools
import math
import os
import time
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import State
from pyfric.display import Progress
from pyfric.engines.cost import work, work_so_far
from pyfric.engines.engine import ENGINES, Engine
from pyfric.engines.integration import (
    ON_GRID,
    STEPS,
    Guard,
    contact_notes,
    integrate,
    just_after,
    last_step,
    strain_notes,
    unfinished,
)
from pyfric.engines.options import owned
from pyfric.record import (
    History,
    LastSlip,
    Method,
    Record,
    build_catalogue,
    chain_notes,
    held_in,
    parts,
    versions,
    zone_notes,
)
from pyfric.scene import law_notes
from pyfric.statics import RememberedStates, StaticSolver, stability_limit

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.engines.stopping import Stopping
    from pyfric.record import Catalogue
    from pyfric.scene import Scene

CALL_SECONDS = 0.02
"""Work of one call of the core, in s, after which limits and Ctrl-C are looked at."""
MAX_CALL = 2**30
"""Most steps of one call of the core."""
STATIC_SECONDS, STATIC_SHARE = 1.0, 0.1
"""Work between two searches for the static forces of new events, at least: in s, and over the work
so far. Little is then left to do at the end of a run."""
SHOWN = 0.1
"""Shortest time between two reports of progress, in s."""
OPEN_BUDGET = 1e-3
"""Relative error of the energy budget above which the record carries a note."""
UNFINISHED = (core.Status.ENDLESS, core.Status.TOO_SHORT)
"""Status codes of the core for a step that it could not finish."""


class RunError(RuntimeError):
    """A run had to stop. Its attribute `record` holds the valid part of the run."""

    def __init__(self, message: str, record: Record) -> None:
        super().__init__(message)
        self.record = record

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, self.record), vars(self)


def kept_notes(before: Record | None) -> tuple[str, ...]:
    """Return the notes that a continued run keeps: all except those of its engine."""
    if before is None:
        return ()
    return tuple(note for note in before.notes if not note.startswith(f"{before.method.engine}: "))


class _Good(NamedTuple):
    """A state that passed the checks of `Guard`, its model and counts, a mark in the history, and
    what the log knows of speeds."""

    state: State
    model: core.Model
    made: dict[str, int]
    recorded: tuple[Any, ...]
    fast: tuple[np.ndarray, np.ndarray]


class Run:
    """A run of full dynamics in progress: the state, and the logs so far."""

    name = "dynamic"

    def __init__(
        self,
        scene: Scene,
        method: Method,
        solver: StaticSolver,
        state: State,
        before: Record | None,
        stopping: Stopping | None = None,
    ) -> None:
        self.scene, self.method, self.state = scene, method, state
        self.stopping, self.ending, self.unsaved = stopping, "", False
        self.known, self.solver = solver, RememberedStates(solver)
        self.model = core.model(scene, method.geometry, state.u_drv0, just_after(state))
        self.piece: int | None = None  # of the protocols, that the model follows
        step = {
            "block_evaluations": core.STEPPERS[method.stepper].evaluations * scene.N_x * scene.N_z
        }
        # Where a call ends decides when a jump is tried, and when a pilot run ends. It therefore
        # follows from counted work, not from the clock.
        steps = int(CALL_SECONDS / work(scene, method.geometry, step))
        self.most_steps = min(max(steps, 1), STEPS)
        self.guard = Guard(scene, self.model, method.geometry, solver.loaded)
        # The core samples the curve; motion and conditions need a call for each point.
        self.moving = bool(method.threshold or scene.law.in_motion(state.memory))
        alone = stopping is None and not self.moving
        self.every = method.sample if alone and method.sample <= MAX_CALL else 0
        self.before = before
        self.log = self.new_log()
        self.t_begin = state.t
        self.history = History(self._columns())
        self.timings: dict[str, float] = {}
        self.events, self.last_slip = 0, -math.inf
        self.made = {"steps": 0, "block_evaluations": 0}  # counts of this run
        self.seconds, self.rate = 0.0, 0.0
        self.good: _Good | None = None  # a run that fails returns to it
        if before is None:
            self.sample()
        else:
            self.t_begin = before.curve["t"].iloc[0]
            self._add_logs({name: getattr(before, name) for name in self.logged})
            self.history.take(before, last=state.step % method.sample == 0 or self._at_corner())

    @classmethod
    def engine(cls) -> Engine:
        """Return the engine that makes such runs."""
        return ENGINES[cls.name]

    def before_call(self, last: int) -> None:
        """Do what an engine does instead of steps, up to step number `last`."""

    def call_length(self) -> int:
        """Return the largest number of steps of the next call."""
        return MAX_CALL

    @property
    def counts(self) -> dict[str, int]:
        """Counts of steps, of force evaluations times blocks, and of jumps."""
        old = self.before.counts if self.before else {}
        return {name: value + old.get(name, 0) for name, value in self.made.items()}

    def notes(self) -> tuple[str, ...]:
        """Return the notes for the record."""
        scene, dt = self.scene, self.method.dt
        notes = ()
        if self.method.geometry == "linear":
            F_T = self.history.curve()["F_T"].abs().max()
            notes = strain_notes(scene, self.name, F_T, self.state.t)
        missing = self.guard.missing(self.history.curve()) if self.method.budget else 0.0
        if missing > OPEN_BUDGET:
            notes += (
                f"{self.name}: the energy budget misses {missing:.2g} of what went through it "
                f"(limit {OPEN_BUDGET:g}): steps of {dt:.3g} s damp fast motion; take a smaller "
                + ("rtol" if self.method.rtol else "dt"),
            )
        late = ("junctions break at step ends, which changes single events: switching = 'located'",)
        late *= bool(scene.law.junctions) and self.method.switching == "step_end"
        others = *law_notes(scene, self.state.t, dt), *late, *core.fork_notes(scene.N_x * scene.N_z)
        return (*notes, *(f"{self.name}: {note}" for note in others))

    def _columns(self) -> list[str]:
        """Return the names of the columns of the curve."""
        names = ["t", "F_T"]
        if self.method.budget:
            names += [*core.energies(self.model, self.state, self.state.t)]
            names += ["work_driver", "work_load", "dissipated_bonds", *self.scene.law.budget()]
            names += ["radiated"] * self.scene.walls.absorb
        return names

    @property
    def logged(self) -> tuple[str, ...]:
        """Names of the logs: those of contact, and of slip faster than a threshold."""
        return ("switches", "quiet", *["crossings", "bursts"][: 2 * bool(self.method.threshold)])

    def new_log(self, quiet: int | None = None) -> core.Log:
        """Return empty logs of the core, with room for some starts and ends of slip."""
        room = {} if quiet is None else {"quiet": quiet}
        threshold, N_x = self.method.threshold or 0.0, self.scene.N_x
        log = core.Log(N_x, every=self.every, threshold=threshold, **room)
        if threshold:
            v, closed = self.state.y[0, 2], self.state.mode != core.OPEN
            log.speeds[:N_x] = v
            log.fast[0] = np.where(closed & (np.abs(v) > threshold), np.sign(v), 0)
            if self.before is not None and len(self.before.crossings):
                known = self.before.crossings
                past = known["step"] <= self.state.step
                log.fast[1, known["block"][past]] = known["corner"][past]  # the last one counts
                begun = self.before.bursts["t"][self.before.bursts["kind"] > 0].max(initial=0.0)
                sums = self.before.motion["v_x"][self.before.curve["t"] >= begun].sum(axis=1)
                log.speeds[N_x] = np.abs(sums).max(initial=0.0) * log.fast[0].any()
        return log

    def sample(self) -> None:
        """Add the present state to the loading curve."""
        state, scene = self.state, self.scene
        self._follow(just_after(state))
        point = core.curve_point(self.model, state, state.t, self.method.budget)
        self._add_points(state.t, point[:, None])
        if self.moving:
            f = core.evaluate(self.model, state, state.t).f
            motion = {"u_x": state.y[0, 0].copy(), "v_x": state.y[0, 2], "f": f}
            self.add_motion(scene.law.in_motion(state.memory) | motion)

    def add_motion(self, motion: Mapping[str, np.ndarray]) -> None:
        """Add quantities of the interface in motion at the last point of the curve, (N_x,) each."""
        types = held_in("motion")
        self.history.motion.append({k: v.astype(types[k].dtype) for k, v in motion.items()})

    def _add_points(self, t: float | np.ndarray, points: np.ndarray) -> None:
        """Add n points of the loading curve of the core, shape (16, n), at times t (s)."""
        columns = np.broadcast_to(t, points.shape[1]), points[0], *self._budget_columns(points)
        self.history.add(np.column_stack(columns))

    def _budget_columns(self, points: np.ndarray) -> list[np.ndarray]:
        """Return the columns of the energy budget from points of the core, shape (16, n)."""
        if not self.method.budget:
            return []
        energies = points[1 : 7 + self.model.on_junctions]
        *before, heat, loss, above, viscous, radiated = points[8:]
        interface = self.scene.law.budget(heat, loss, (above, viscous))
        columns = [*energies, *before, *interface.values()]
        return [*columns, radiated] if self.scene.walls.absorb else columns

    def advance(
        self,
        last: int,
        stop: Callable[[], bool],
        show: Callable[[Progress], None],
        options: Options,
    ) -> None:
        """Make the steps up to number `last`, unless Ctrl-C or a condition ends the run before."""
        state, every = self.state, self.method.sample
        start = saved = shown = time.perf_counter()
        solve_at = STATIC_SECONDS
        while state.step < last and not self.ending and not stop():
            self.before_call(last)
            if state.step < last and not self.ending:
                n_steps = min(self.most_steps, last - state.step, self.call_length())
                self.call(n_steps if self.every else min(n_steps, every - state.step % every))
                if state.step % every == 0 and not self.every:
                    self.sample()
                    self.ending = self.ended()
            now = time.perf_counter()
            if now - shown > SHOWN or state.step >= last or self.ending:
                shown = now
                force = self.history.last[1] / self.scene.F_N
                begin, end = self.history.begin, state.t0 + last * state.dt
                show(Progress(state.t, begin, end, force, self.events, self.rate))
            if (done := work_so_far(self)) > solve_at:  # not by the clock: jumps use what is found
                with warnings.catch_warnings(action="ignore"):
                    self.catalogue()
                solve_at = done + max(STATIC_SECONDS, STATIC_SHARE * done)
            if options.checkpoint is not None and now - saved > options.checkpoint_every:
                self.save(options.checkpoint)
                saved = time.perf_counter()
        if self.good is not None:
            self._look(due=True)
        self.timings["stepping"] = time.perf_counter() - start

    def ended(self) -> str:
        """Return the status of a run that a condition ends now, or "" if none does."""
        if self.stopping is None:
            return ""
        self.look()
        return self.stopping.status()

    def look(self) -> None:
        """Pass the present state to the conditions."""
        state = self.state
        forces = functools.partial(core.evaluate, self.model, state, state.t)
        self.stopping.look_at(state, forces)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save the run so far; if that fails, warn and go on."""
        try:
            self.record("interrupted").save(path, overwrite=True)
        except OSError as error:
            if not self.unsaved:
                said = f"checkpoint {path} was not written: {error}"
                warnings.warn(said, RuntimeWarning, stacklevel=4)
            self.unsaved = True

    def make_steps(self, state: State, n_steps: int) -> core.Status:
        """Make up to n_steps; the state changes in place, and the log is filled.

        A step is shortened or lengthened to end at each breakpoint of a protocol. The next step
        belongs to the next piece.
        """
        scene, t = self.scene, just_after(state)
        if not scene.corners:
            return self._in_core(state, n_steps)
        self._follow(t)
        corner = next((corner for corner in scene.corners if corner > t), math.inf)
        if not corner < state.t0 + (state.step + n_steps) * state.dt:
            return self._in_core(state, n_steps)
        last = last_step(state.t0, state.dt, corner)
        if state.step < last - 1:
            return self._in_core(state, last - 1 - state.step)
        dt, length = state.dt, corner - state.t
        state.t0, state.dt = state.t - state.step * length, length
        status = self._in_core(state, 1)
        state.t0, state.dt = corner - state.step * dt, dt
        return status

    def piece_ends(self, last: int) -> int:
        """Return the last step that a jump may reach, at most `last`, before any breakpoint."""
        state, t = self.state, just_after(self.state)
        corner = next((corner for corner in self.scene.corners if corner > t), math.inf)
        if math.isinf(corner):
            return last
        return min(last, last_step(state.t0, state.dt, corner) - 1)

    def _follow(self, t: float) -> None:
        """Let the model follow the protocols at t (s)."""
        piece = bisect.bisect_right(self.scene.corners, t)
        if piece != self.piece and self.scene.corners:
            self.piece = piece
            self.model = core.model(self.scene, self.method.geometry, self.state.u_drv0, t)
            self.guard.model = self.model

    def _at_corner(self) -> bool:
        """Return whether the present step ends at a breakpoint of a protocol."""
        near = ON_GRID * self.state.dt
        return any(abs(corner - self.state.t) <= near for corner in self.scene.corners)

    def _in_core(self, state: State, n_steps: int) -> core.Status:
        return core.advance(
            self.model,
            state,
            self.log,
            n_steps,
            stepper=self.method.stepper,
            switching=self.method.switching,
            rtol=self.method.rtol or 1.0,
            budget=self.method.budget,
            threads=self.method.threads,
        )

    def call(self, n_steps: int) -> None:
        """Make up to n_steps and check the state.

        Raises:
            RunError: the core could not finish a step, or the state fails a check.
        """
        if self.good is None:
            self._follow(just_after(self.state))  # a jump may have passed a breakpoint
            mark, fast = self.history.mark(), (self.log.fast.copy(), self.log.speeds.copy())
            self.good = _Good(self.state.copy(), self.model, self.made.copy(), mark, fast)
        strained = self._make(n_steps) == core.Status.STRAINED
        self._look(strained or self.state.step - self.good.state.step >= STEPS)

    def _make(self, n_steps: int) -> core.Status:
        """Let the core make up to n_steps and take over its log; return why it ended."""
        state, step = self.state, self.state.step
        start = time.perf_counter()
        status = self.make_steps(state, n_steps)
        seconds = time.perf_counter() - start
        per_step = core.STEPPERS[self.method.stepper].evaluations * self.scene.N_x * self.scene.N_z
        self.made["block_evaluations"] += round(self.log.tried * per_step)
        if status in UNFINISHED:
            message = unfinished(self.scene, self.method, self.log, status)
            self._back_to(step)
            raise RunError(message, self.record(f"failed: {message}"))
        self.made["steps"] += state.step - step
        self.seconds += seconds
        self.rate = self.made["steps"] / self.seconds
        if self.log.n_point:
            numbers = step // self.every + 1 + np.arange(self.log.n_point)
            times = state.t0 + numbers * self.every * state.dt
            self._add_points(times, self.log.points[:, : self.log.n_point])
        if state.step % self.method.sample and self._at_corner():
            self.sample()
        log = self.log
        if log.n_switch or log.n_quiet or log.n_crossing:
            logs = {name: getattr(log, name)() for name in self.logged}
            for name in self.logged[1::2]:
                spent = self._budget_columns(log.points_of(name))
                logs[name] |= dict(zip(self.history.names[2:], spent, strict=True))
            self._add_logs(logs)
        return status

    def _look(self, due: bool) -> None:
        """Raise RunError if the state fails a check; energy and lattice are checked if due."""
        good = self.good
        base = self.guard.energy(good.state, good.model) if due else None
        if self.guard.trouble(good.state, self.state, base) is not None:
            self._fail()
        if due:
            self.good = None

    def _add_logs(self, logs: Mapping[str, Mapping[str, np.ndarray]]) -> None:
        self.history.log(**logs)
        switches, quiet = (logs[name] for name in self.logged[-2:])
        if self.stopping is not None:
            self.stopping.take(switches, quiet)
        for t, kind in zip(quiet["t"], quiet["kind"], strict=True):
            self.events += kind > 0 and parts(t - self.last_slip, self.method.t_gap)
            self.last_slip = t

    def _fail(self) -> None:
        """Return to the last step that passes all checks and raise RunError for the next one."""
        after, trouble = self.good.state.copy(), None
        base = self.guard.energy(after, self.good.model)
        log, self.log = self.log, core.Log(self.scene.N_x)
        while trouble is None:
            before = after.copy()
            self.make_steps(after, 1)
            trouble = self.guard.trouble(before, after, base)
        self.log = log
        self._back_to(before.step)
        v = np.hypot(before.y[:, 2], before.y[:, 3])
        limit, _ = stability_limit(self.scene, self.method.stepper)
        message = (
            f"{trouble.what} at step {after.step}, t = {after.t:.9g} s, at the block in column "
            f"{trouble.i + 1} from the left, row {trouble.j + 1} from the bottom; one step before, "
            f"speeds reach {v.max():.3g} m/s. dt = {after.dt:g} s is below the limit {limit:.4g} s "
            "of small motions: the strains have left the range of the model; reduce dt, F_N or V"
            + self._located_hint()
        )
        raise RunError(message, self.record(f"failed: {message}"))

    def _located_hint(self) -> str:
        method = self.method
        if method.switching != "located" or core.STEPPERS[method.stepper].growth is not None:
            return ""
        return ", or take switching = 'step_end', because steps of different length can feed energy"

    def _back_to(self, step: int) -> None:
        """Restore the last good state and logs, and repeat the steps up to number `step`."""
        self.history.back(self.good.recorded)
        self.made.update(self.good.made)
        self.log.fast[:], self.log.speeds[:] = self.good.fast
        self.state, every = self.good.state.copy(), self.method.sample
        while self.state.step < step:
            end = step if self.every else min(step, (self.state.step // every + 1) * every)
            self._make(end - self.state.step)
            if self.state.step % every == 0 and not self.every:
                self.sample()

    def catalogue(self) -> tuple[Catalogue, dict[str, dict[str, np.ndarray]]]:
        """Return the catalogue of events so far, and the logs."""
        logs = self.history.logs(self.scene.N_x, *self.logged[2:])
        switches, quiet = (logs[name] for name in self.logged[-2:])
        catalogue = build_catalogue(
            switches,
            quiet,
            self.scene,
            t_gap=self.method.t_gap,
            t_begin=self.t_begin,
            t_end=self.state.t,
            last=LastSlip(*self.log.fast) if self.method.threshold else self.state,
            solver=self.solver if self.scene.has_rests else None,
        )
        return catalogue, logs

    def record(self, status: str, *, late: bool = True) -> Record:
        """Return the record of the run so far; `late` adds columns of events that take long."""
        state, scene, method = self.state, self.scene, self.method
        start = time.perf_counter()
        catalogue, logs = self.catalogue()
        history, n = self.history, self.history.n
        if history.last[0] != state.t:
            self.sample()
        state.drive = scene.drive(state.t)
        curve, notes = history.curve(), self.notes() + zone_notes(scene, self.name, catalogue)
        notes += chain_notes(scene, self.name, catalogue)
        notes += contact_notes(scene, self.name, logs["switches"], state.mode)
        motion = history.arrays()
        history.cut(n)
        timings = self.timings | {"catalogue": time.perf_counter() - start}
        if self.before is not None:
            timings = {k: v + self.before.timings.get(k, 0.0) for k, v in timings.items()}
        if steps := self.made["steps"]:
            timings["per_block_and_step"] = self.seconds / steps / (scene.N_x * scene.N_z)
        return Record.from_catalogue(
            catalogue,
            late=late,
            scene=scene,
            method=method,
            curve=curve,
            tau_initial=self.known.loaded.tau,
            p_initial=self.known.loaded.p,
            **logs,
            motion=motion,
            versions=versions(),
            timings=timings,
            counts=self.counts,
            notes=(*kept_notes(self.before), *notes),
            status=status,
            final_state=state,
        )


DYNAMIC = Engine(
    name=Run.name,
    models="dynamics throughout",
    options=owned("run", "events", "steps", "energies"),
    steppers=tuple(core.STEPPERS),
    follow=functools.partial(integrate, Run),
)
