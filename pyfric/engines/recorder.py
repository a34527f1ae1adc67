"""The data that a run collects for its record: curve, motion, logs and counts.

A run that continues a record begins with the data of that record.
"""

from __future__ import annotations

import functools
import math
import os
import time
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric import core
from pyfric.engines.grid import at_corner
from pyfric.engines.strains import contact_notes
from pyfric.record import (
    History,
    LastSlip,
    Record,
    build_catalogue,
    chain_notes,
    held_in,
    parts,
    versions,
    zone_notes,
)
from pyfric.scene import Sums
from pyfric.statics import RememberedStates

if TYPE_CHECKING:
    from pyfric.core import Model, State
    from pyfric.engines.skip import Span
    from pyfric.engines.stopping import Stopping
    from pyfric.record import Catalogue, Method
    from pyfric.scene import Scene
    from pyfric.statics import StaticSolver

MAX_EVERY = 2**30
"""Largest number of steps between two points of the curve if the core samples the curve."""


def kept_notes(before: Record | None) -> tuple[str, ...]:
    """Return the notes that a continued run keeps: all except notes of the engine."""
    if before is None:
        return ()
    return tuple(note for note in before.notes if not note.startswith(f"{before.method.engine}: "))


class Recorder:
    """The data that a run has collected so far.

    Args:
        scene: the scene.
        method: the method of the run.
        known: static states of the scene in its geometry.
        state: its state at the beginning.
        before: record that the run continues.
        stopping: conditions that end the run.

    Attributes:
        history: the curve, motion at its points, and the logs.
        log: buffers of the core, whose contents `take` adds to the logs.
        every: steps between two points of the curve that the core samples; 0: it samples no points.
        moving: whether motion of the interface is recorded at the points of the curve.
        made: counts of this run, without the run that it continues.
        ending: status of a run that a condition ended, or "".
        events, last_slip: number of events, and time of the last start or end of slip, in s.
        solver: static states for the catalogue.
        seconds: computing time of steps, in s.
    """

    def __init__(
        self,
        scene: Scene,
        method: Method,
        known: StaticSolver,
        state: State,
        before: Record | None,
        stopping: Stopping | None,
    ) -> None:
        self.scene, self.method, self.known, self.before = scene, method, known, before
        self.solver = RememberedStates(known)
        self.stopping, self.ending, self.unsaved = stopping, "", False
        # The core samples the curve; motion and conditions need a call for each point.
        self.moving = bool(method.threshold or scene.law.in_motion(state.memory))
        alone = stopping is None and not self.moving
        self.every = method.sample if alone and method.sample <= MAX_EVERY else 0
        self.timings: dict[str, float] = {}
        self.seconds = 0.0
        self.made = {"steps": 0, "block_evaluations": 0}
        self.events, self.last_slip = 0, -math.inf
        self.t_begin = state.t
        self.history = History(self._columns())
        self.log = self.new_log(state)
        if before is not None:
            self.t_begin = before.curve["t"].iloc[0]
            self.add_logs({name: getattr(before, name) for name in self.logged})
            on_curve = state.step % method.sample == 0 or at_corner(scene, state)
            self.history.take(before, last=on_curve)

    @property
    def counts(self) -> dict[str, int]:
        """Counts of steps, of evaluated forces on blocks, and of skips."""
        old = self.before.counts if self.before else {}
        return {name: value + old.get(name, 0) for name, value in self.made.items()}

    @property
    def logged(self) -> tuple[str, ...]:
        """Names of the logs: of contact, and with a threshold also of fast slip."""
        return ("switches", "quiet", *["crossings", "bursts"][: 2 * bool(self.method.threshold)])

    # --- the curve, and motion at its points -----------------------------------------------------

    def _columns(self) -> list[str]:
        """Return the names of the columns of the curve."""
        names = ["t", "F_T"]
        if self.method.budget:
            names += [*core.ENERGIES, "work_driver", "work_load", "dissipated_bonds"]
            names += self.scene.law.budget()
            names += ["radiated"] * self.scene.walls.absorb
        return names

    def sample(self, state: State, model: Model) -> None:
        """Add a state to the curve."""
        point = core.curve_point(model, state, state.t, self.method.budget)
        self._add_points(state.t, point[:, None])
        if self.moving:
            f = core.evaluate(model, state, state.t).f
            motion = {"u_x": state.y[0, 0], "v_x": state.y[0, 2], "f": f}
            motion = self.scene.law.in_motion(state.memory) | motion
            self.add_motion({name: values[None] for name, values in motion.items()})

    def add_motion(self, motion: Mapping[str, np.ndarray]) -> None:
        """Add arrays of the interface, (n, N_x), at the last n points of the curve."""
        types = held_in("motion")
        kept = [values.astype(types[name].dtype) for name, values in motion.items()]
        self.history.motion += [
            dict(zip(motion, point, strict=True)) for point in zip(*kept, strict=True)
        ]

    def _add_points(self, t: float | np.ndarray, points: np.ndarray) -> None:
        """Add n points of the loading curve from the core, shape (16, n), at times t (s)."""
        columns = np.broadcast_to(t, points.shape[1]), points[0], *self._budget_columns(points)
        self.history.add(np.column_stack(columns))

    def _budget_columns(self, points: np.ndarray) -> list[np.ndarray]:
        """Return the columns of the energy budget from points of the core, shape (16, n)."""
        if not self.method.budget:
            return []
        _, *energies, elastic, driver, load, bonds = points[:11]
        *of_interface, radiated = points[11:]
        interface = self.scene.law.budget(Sums(elastic, *of_interface))
        columns = [*energies, driver, load, bonds, *interface.values()]
        return [*columns, radiated] if self.scene.walls.absorb else columns

    def add_span(self, span: Span, state: State) -> None:
        """Add the points of the curve in a span that begins in `state`. Energies are NaN."""
        begin, every = state.step, self.method.sample
        reach = span.n if span.reach is None else span.reach
        first = ((begin + span.done) // every + 1) * every
        steps = np.arange(first, begin + reach + 1, every)
        s, n = (steps - begin) * state.dt, np.count_nonzero(steps <= begin + span.n)
        F_T = span.F_T(s)[:n]
        t = state.t0 + steps[: len(F_T)] * state.dt
        unknown = np.full((len(t), len(self.history.names) - 2), np.nan)
        self.history.add(np.column_stack([t, F_T, unknown]))
        if self.moving:
            self.add_motion(span.motion(s[: len(F_T)]))

    # --- the logs --------------------------------------------------------------------------------

    def new_log(self, state: State, quiet: int | None = None) -> core.Log:
        """Return empty logs of the core; `quiet` is their room for starts and ends of slip."""
        room = {} if quiet is None else {"quiet": quiet}
        threshold, N_x = self.method.threshold or 0.0, self.scene.N_x
        log = core.Log(N_x, every=self.every, threshold=threshold, **room)
        if threshold:
            v, closed = state.y[0, 2], state.mode != core.OPEN
            log.speeds[:N_x] = v
            log.fast[0] = np.where(closed & (np.abs(v) > threshold), np.sign(v), 0)
            if self.before is not None and len(self.before.crossings):
                known = self.before.crossings
                past = known["step"] <= state.step
                log.fast[1, known["block"][past]] = known["corner"][past]  # the latest remains
                begun = self.before.bursts["t"][self.before.bursts["kind"] > 0].max(initial=0.0)
                sums = self.before.motion["v_x"][self.before.curve["t"] >= begun].sum(axis=1)
                log.speeds[N_x] = np.abs(sums).max(initial=0.0) * log.fast[0].any()
        return log

    def take(self, state: State, begin: int) -> None:
        """Add the log of the core for steps from number `begin` up to a state."""
        log = self.log
        if log.n_point:
            numbers = begin // self.every + 1 + np.arange(log.n_point)
            times = state.t0 + numbers * self.every * state.dt
            self._add_points(times, log.points[:, : log.n_point])
        if log.n_switch or log.n_quiet or log.n_crossing:
            self.take_logs()

    def take_logs(self) -> None:
        """Add the contents of the core's buffers to the logs."""
        logs = {name: getattr(self.log, name)() for name in self.logged}
        for name in self.logged[1::2]:
            spent = self._budget_columns(self.log.points_of(name))
            logs[name] |= dict(zip(self.history.names[2:], spent, strict=True))
        self.add_logs(logs)

    def add_logs(self, logs: Mapping[str, Mapping[str, np.ndarray]]) -> None:
        """Add entries to the logs: name of a log -> name of a column -> values."""
        self.history.log(**logs)
        switches, quiet = (logs[name] for name in self.logged[-2:])
        if self.stopping is not None:
            self.stopping.take(switches, quiet)
        for t, kind in zip(quiet["t"], quiet["kind"], strict=True):
            self.events += kind > 0 and parts(t - self.last_slip, self.method.t_gap)
            self.last_slip = t

    # --- going back ------------------------------------------------------------------------------

    def mark(self) -> tuple[Any, ...]:
        """Return the amount of collected data, for a later call of `back`."""
        return self.history.mark(), self.made.copy(), self.log.fast.copy(), self.log.speeds.copy()

    def back(self, mark: tuple[Any, ...]) -> None:
        """Discard the data collected since the call of `mark` that returned `mark`."""
        recorded, made, fast, speeds = mark
        self.history.back(recorded)
        self.made.update(made)
        self.log.fast[:], self.log.speeds[:] = fast, speeds

    # --- conditions ------------------------------------------------------------------------------

    def look(self, state: State, model: Model) -> None:
        """Set `ending` if a condition holds in a state at a point of the curve."""
        if self.stopping is not None:
            self._show(state, model)
            self.ending = self.stopping.status()

    def due(self, state: State, model: Model, last: int) -> tuple[int, str]:
        """Return the step at which a condition ends the run if nothing slips, and the run's status.

        The step is at a point of the curve after `state`. If no condition ends the run up to step
        `last`, return `last` and "".
        """
        if self.stopping is None:
            return last, ""
        self._show(state, model)
        (due, text), every, dt = self.stopping.due(), self.method.sample, state.dt
        if due > state.t0 + last * dt:
            return last, ""
        number = max(state.step // every + 1, math.ceil((due - state.t0) / dt / every))
        while (number - 1) * every > state.step and state.t0 + (number - 1) * every * dt >= due:
            number -= 1  # corrects rounding
        while state.t0 + number * every * dt < due:
            number += 1
        end = number * every
        return (end, self.stopping.named(text)) if end <= last else (last, "")

    def _show(self, state: State, model: Model) -> None:
        """Pass a state to the conditions."""
        forces = functools.partial(core.evaluate, model, state, state.t)
        self.stopping.look_at(state, forces)

    # --- the record ------------------------------------------------------------------------------

    def catalogue(self, state: State) -> tuple[Catalogue, dict[str, dict[str, np.ndarray]]]:
        """Return the catalogue of events up to a state, and the logs."""
        logs = self.history.logs(self.scene.N_x, *self.logged[2:])
        switches, quiet = (logs[name] for name in self.logged[-2:])
        catalogue = build_catalogue(
            switches,
            quiet,
            self.scene,
            t_gap=self.method.t_gap,
            t_begin=self.t_begin,
            t_end=state.t,
            last=LastSlip(*self.log.fast) if self.method.threshold else state,
            solver=self.solver if self.scene.has_rests else None,
        )
        return catalogue, logs

    def record(
        self,
        status: str,
        state: State,
        model: Model,
        notes: Callable[[], tuple[str, ...]],
        *,
        late: bool = True,
    ) -> Record:
        """Return the record of the run up to a state.

        Args:
            status: how the run ended.
            state: the state.
            model: the scene at the time of the state, in the form that the core takes.
            notes: function that returns notes on the run, once the curve is complete.
            late: whether to compute columns of the event table that take long.
        """
        scene, method, engine = self.scene, self.method, self.method.engine
        start = time.perf_counter()
        catalogue, logs = self.catalogue(state)
        history, n = self.history, self.history.n
        if history.last[0] != state.t:
            self.sample(state, model)
        state.drive = scene.drive(state.t)
        curve, told = history.curve(), notes() + zone_notes(scene, engine, catalogue)
        told += chain_notes(scene, engine, catalogue)
        told += contact_notes(scene, engine, logs["switches"], state.mode)
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
            notes=(*kept_notes(self.before), *told),
            status=status,
            final_state=state,
        )

    def save(self, path: str | os.PathLike[str], made: Callable[[], Record]) -> None:
        """Save the record that `made` returns; if saving fails, warn and go on."""
        try:
            made().save(path, overwrite=True)
        except OSError as error:
            if not self.unsaved:
                said = f"checkpoint {path} was not written: {error}"
                warnings.warn(said, RuntimeWarning, stacklevel=5)
            self.unsaved = True
