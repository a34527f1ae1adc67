"""Errors of a run, measured by comparison with a reference run that leaves out less.

The reference run is in finite geometry, with shorter steps. Its jumps are as accurate as those of a
run without a plan, at least ten times as accurate as those of the run, or it makes none. Ten times
is all if the run jumps over stable slip, which more accurate jumps hardly spare. It is made
with the *opposite stepper*, whose leading error is minus that of the run: the limit of short steps
lies between both runs. Two runs with errors of one sign can agree on an outcome that shorter steps
change. The step is up to 4 times shorter, as far as the budget pays for it, and at most half as
long. If the budget does not pay for the opposite stepper, or if it is unstable because fast motion
is hardly damped, the reference run has the stepper of the run. It is full dynamics rather than a
hybrid run if the budget pays for both. The budget is half a second and twice the work of the run,
or twice the work that the plan announced if that is less.

If the error is of order p in the step, it is 1/(1 -+ r^-p) times the difference of two runs whose
steps have the ratio r, with + for opposite steppers; `SAFETY` times that is reported. If an event
ends at another block, or in one run alone, the difference has no order; `TURNED` times the
difference is reported. If no step resolves weakening of friction, nothing is measured: friction
drops at once in both runs.

If the error of a planned run exceeds the tolerance, the run is refined. A run in linear geometry is
repeated in finite geometry. A run in finite geometry is replaced by its reference run, for which no
smaller error is reported. The reference run is compared with a still finer run while the budget
lasts.

If only a few of many events still differ, they are named, and all others are measured. Otherwise
single events cannot be trusted from the first difference on, and later events are compared by their
statistics. The first difference is that from a finer run, as far as the budget pays for it. Where
that does not reach an event, it is that from the coarser run. If events before the first difference
do not tell what is wanted, the error of all events is reported, which exceeds the tolerance.

An event of few blocks that slips other blocks in two runs is a difference, too, even if the error
is within the tolerance: what follows from it has no order in the step. So is an event in which a
block slips once more in one of the runs, and one that ends in one of them alone.

Reference runs end where the run and they have cost `MOST` times the work of the run and its first
reference run, or `MOST` times what the plan announced if that is less. Events that they do not
cover are not measured.

Source: P. J. Roache, J. Fluids Eng. 116, 405 (1994), factors of safety for two grids.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import STEPPERS
from pyfric.engines import ACCURACY, ENGINES, RunError, kept, work, work_so_far
from pyfric.planning.price import Reference, Runs, affordable, budget, operations
from pyfric.record import Errors, differences, statistics
from pyfric.scene import default_geometry
from pyfric.statics import EquilibriumError

if TYPE_CHECKING:
    from pyfric.engines import Options
    from pyfric.record import Differences, Record
    from pyfric.scene import Geometry, Scene

DYNAMICS, SAFETY, TURNED = 1.25, 2.0, 3.0
"""Factors of safety for reported errors: of a quasi-static run compared with dynamics, of runs with
two steps, and of any runs in which an event ends at another block or time. They are definitions, as
for two grids."""
LOOSEST = 1e-3
"""Largest error of jumps that a plan accepts, over F_N."""
LADDER = 0.01
"""Accuracy of jumps in the reference run of a quasi-static run, over the tolerance."""
STRICTER = 0.1
"""Largest accuracy of jumps of a reference run over that of the run."""
FEW = 0.1
"""Largest share of main events that may be named as undetermined while the others are measured."""
MOST = 2.5
"""Largest work of a run with its verification, over the expected one: reference runs end there. A
price may then be wrong by 1.6 until a run takes 4 times the time that was announced."""
PERTURBATION = 1e-9
"""Relative increase of the driver's speed in the perturbed run."""


@dataclass(frozen=True, kw_only=True)
class Specification:
    """Specification of a run, from which similar runs can be made.

    Attributes:
        scene: the scene.
        t_begin, t_end: times of the beginning and the end, in s.
        options: options with engine, geometry, step and switching resolved.
        run: function that runs a scene to a time (s) with options; `enough` can end the run.
        refines: whether steps and geometry may be changed.
        expected: error that the plan expects.
        work: work of the run that the plan expects, in s; inf without a plan.
        whole: work of the run and its verification that the plan announced, likewise.
        refinement: what the plan announced for refinement, likewise.
        geometry: geometry of reference runs; None means finite, or linear for a chain.
    """

    scene: Scene
    t_begin: float
    t_end: float
    options: Options
    run: Callable[..., Record]
    refines: bool = False
    expected: float | None = None
    work: float = math.inf
    whole: float = math.inf
    refinement: float = 0.0
    geometry: Geometry | None = None

    def again(self, record: Record, largest: float | None = None, **changes: Any) -> Record:
        """Return a run made like a record, with some options changed; it ends at a work (s)."""
        same = kept(record.method) | {"fidelity": record.method.engine}
        plain = {"sample": self.options.sample, "checkpoint": None, "verify": None}
        options = dataclasses.replace(self.options, **(same | plain | changes))
        enough = None if largest is None else lambda run: work_so_far(run) > largest
        return self.run(self.scene, self.t_end, options, enough=enough)


def verified(record: Record, made: Specification) -> Record | None:
    """Return a run with its measured errors, refined if they exceed the tolerance.

    None is returned for a quasi-static run whose errors exceed the tolerance: dynamics replaces it.

    Args:
        record: record of the run.
        made: specification of the run. Its option `verify` is "sample" or None: within the budget.
            "full": with the best reference run at any cost, and with a run whose driver is faster
            by `PERTURBATION`.
    """
    start = time.perf_counter()
    try:
        if ENGINES[record.method.engine].steps:
            record = _Verification(record, made).record_with_errors()
        else:
            record = _quasistatic(record, made)
    except (RunError, EquilibriumError) as error:
        note = f"errors were not measured: the reference run ended ({error})"
        record = dataclasses.replace(record, notes=(*record.notes, note))
    if record is None:
        return None
    seconds = {"verification": time.perf_counter() - start}
    return dataclasses.replace(record, timings={**record.timings, **seconds})


def _promise(made: Specification) -> dict[str, Any]:
    promise = {"want": made.options.want, "tolerance": made.options.tolerance}
    return promise | {"expected": made.expected, "t_end": made.t_end}


def _errors(found: Differences, made: Specification, factor: float, by: str) -> Errors:
    return Errors(**_promise(made), by=(by,), **found.errors(factor))


def _beyond(errors: Errors) -> bool:
    error = errors.measured()
    return error is not None and errors.tolerance is not None and error > errors.tolerance


def _with(record: Record, errors: Errors, notes: list[str]) -> Record:
    if errors.verdict and (errors.holds is False or (not errors.holds and errors.until is None)):
        notes = [*notes, errors.verdict]
    record = dataclasses.replace(record, errors=errors, notes=(*record.notes, *notes))
    return record.with_late_columns()  # it may have been a reference run


def _apart(record: Record, other: Record) -> float:
    """Return the start (s) of the first event that slips other blocks in another run.

    Events whose numbers of episodes differ count, too. Of events that go on to the end, only those
    that go on in both runs can count, by their episodes. inf is returned if there is none.
    """
    names = ["n_blocks", "first_block", "last_block"]
    same = min(len(record.events), len(other.events))
    ours, theirs = (run.events[:same] for run in (record, other))
    ended, theirs_ended = (run["finished"].to_numpy() for run in (ours, theirs))
    off = (ours[names].to_numpy() != theirs[names].to_numpy()).any(axis=1) & ended & theirs_ended
    episodes = ours["n_episodes"].to_numpy() != theirs["n_episodes"].to_numpy()
    off |= episodes & (ended == theirs_ended)
    return float(ours["t_start"][off].min()) if off.any() else math.inf


def _words(record: Record) -> str:
    accuracy = record.method.accuracy
    jumps = "" if accuracy is None else f", jumps within {accuracy:.1g} F_N"
    return f"{record.method}{jumps}"


def _quasistatic(record: Record, made: Specification) -> Record | None:
    """Compare a quasi-static run with dynamics, as far as the budget allows."""
    scene, geometry = made.scene, made.geometry or default_geometry(made.scene)
    spent = min(work(scene, "linear", record.counts), made.work)
    largest = math.inf if made.options.verify == "full" else budget(spent)
    how = {"fidelity": "hybrid", "dt": "auto", "switching": "located", "geometry": geometry}
    how |= {"accuracy": min(LADDER * made.options.tolerance, LOOSEST), "energies": False}
    by = made.again(record, largest, **how)
    found = differences(record, by)
    factor = TURNED if found.turned else DYNAMICS
    errors = _errors(found, made, factor, f"dynamics ({_words(by)})")
    if made.refines and _beyond(errors):
        return None
    return _with(record, errors, [])


class _Verification:
    """Verification of a run with time steps by a reference run."""

    def __init__(self, record: Record, made: Specification) -> None:
        self.record, self.made, self.full = record, made, made.options.verify == "full"
        self.geometry = made.geometry or default_geometry(made.scene)
        spent = work_so_far(record)
        left = budget(min(spent, made.work))
        self.left = math.inf if self.full else left
        self.first = self._level()
        whole = min(made.whole, spent + min(self.first.work, left))
        self.over = MOST * whole - spent - left  # what reference runs may take beyond the budget
        self.notes: list[str] = []

    def record_with_errors(self) -> Record:
        """Return the run with its errors, or the reference run that replaces it."""
        made = self.made
        reference = self._reference(self.first)
        errors = self._compared(reference)
        while _beyond(errors) and made.refines and not self.full and reference.done:
            off = errors.measured()
            if self.record.method.geometry != reference.method.geometry:
                self.record = made.again(self.record, geometry=self.geometry)
                self.left -= work_so_far(self.record)
                self.notes.append(f"refined to {_words(self.record)}: measured error {off:.2g}")
                errors = self._compared(reference)
                continue
            self.notes.append(f"refined to {_words(reference)}: measured error {off:.2g}")
            coarse, self.record = self.record, reference
            self.over += MOST * made.refinement
            errors = self._compared(coarse)
            level = self._level()
            if not _beyond(errors) or level.work > self.left:
                break
            reference = self._reference(level)
            errors = self._compared(reference)
        if self.full:
            errors = self._perturbed(errors)
        elif _beyond(errors):
            errors = self._determined(errors)
        elif math.isfinite(t := self._other_outcome()):
            notes = [*self.notes]
            before = self._until(errors, t, self.other)
            if before.measured() is None:  # earlier events do not tell what is wanted
                self.notes = notes
            else:
                errors = before
        dt = min(run.method.dt for run in (self.record, self.other))
        if dt > (resolves := made.scene.resolving_step):
            errors = Errors(**_promise(made))
            self.notes.append(
                f"errors were not measured: steps of {dt:.3g} s do not resolve weakening, which "
                f"needs dt <= {resolves:.3g} s, and friction drops at once in both of two runs"
            )
        return _with(self.record, errors, self.notes)

    def _compared(self, other: Record) -> Errors:
        """Return the errors that follow from another run.

        Shorter steps leave a known share of the error. From a coarser run, whose events may end
        elsewhere, no smaller error follows.
        """
        method = self.record.method
        order = 1 if method.switching == "step_end" else STEPPERS[method.stepper].order
        left = (method.dt / other.method.dt) ** -order  # over the error of the run
        if other.method.stepper == method.stepper:
            left = -left
        coarser = other.method.dt > method.dt
        self.factor = TURNED / SAFETY if coarser else 1 / (1 + left)
        self.found, self.other = differences(self.record, other), other
        return self._scaled(self.found)

    def _scaled(self, found: Differences) -> Errors:
        return _errors(found, self.made, self._factor(found.turned), _words(self.other))

    def _factor(self, turned: bool) -> float:
        """Return reported errors over differences. `turned`: see `Differences.turned`."""
        return max(SAFETY * self.factor, TURNED) if turned else SAFETY * self.factor

    # --- reference runs --------------------------------------------------------------------------

    def _references(self) -> list[Reference]:
        """Return the reference runs of the run as it is now."""
        scene, method, counts = self.record.scene, self.record.method, self.record.counts
        lasts = self.made.t_end - self.made.t_begin
        made = operations(scene, method.engine, counts, method.dt, lasts, method.stepper)
        steps = method.stepper, method.dt, method.switching
        return Runs(scene, self.geometry, made, *steps).references()

    def _level(self) -> Reference:
        """Return the best reference run within the budget, or the cheapest one if none is."""
        possible = self._references()
        return affordable(possible, self.left) or possible[-1]

    def _how(self, level: Reference) -> dict[str, Any]:
        """Return the options of a reference run."""
        method = self.record.method
        how = {"fidelity": level.engine, "geometry": self.geometry}
        how |= {"stepper": level.stepper, "dt": level.dt, "accuracy": None}
        how["rtol"] = method.rtol and max(method.rtol * (level.dt / method.dt) ** 4, 1e-12)
        if level.engine == "hybrid":
            strict = STRICTER * (method.accuracy or ACCURACY)
            if not self.record.counts.get("slides", 0):
                strict = min(strict, ACCURACY)
            how["accuracy"] = max(strict, 1e-9)
        return how

    def _reference(self, level: Reference) -> Record:
        """Make a reference run, which is ended if the run and its verification cost too much."""
        found = self.made.again(self.record, self.left + self.over, **self._how(level))
        self.left -= work_so_far(found)
        return found

    # --- what is not determined ------------------------------------------------------------------

    def _determined(self, errors: Errors) -> Errors:
        """Return the errors without the events on which two runs disagree."""
        options, main = self.made.options, int(self.record.events["is_main"].sum())
        off = self.found.beyond(options.tolerance / self._factor(turned=False), options.want)
        if 0 < len(off) <= FEW * main and (off["event"] > 0).all():
            rest = self._scaled(self.found.without(off))
            if not _beyond(rest):
                named = tuple(int(event) for event in off["event"])
                return dataclasses.replace(rest, undetermined=named)
        if self.other.method.dt > self.record.method.dt and self.left > 0:
            first = self._first_part(self.other)
            if first.measured() is not None:
                return first
        return self._until(errors, self._parted(), self.other)

    def _parted(self) -> float:
        """Return the start (s) of the first event on which two runs disagree, NaN if none."""
        options = self.made.options
        off = self.found.beyond(options.tolerance / self._factor(turned=True), options.want)
        return float(off["t_start"].min())

    def _first_part(self, coarse: Record) -> Errors:
        """Return the errors that a finer run measures as far as the budget goes.

        Later events have the statistics of the run and of a coarser one, which disagree.
        """
        kept, notes = (self.found, self.other, self.factor), [*self.notes]
        method = self.record.method
        possible = [run for run in self._references() if run.engine == method.engine]
        level = min(possible, key=lambda run: (run.stepper == method.stepper, run.work))
        errors = self._compared(self.made.again(self.record, self.left, **self._how(level)))
        t = self._parted()
        if np.isnan(t) and not errors.partly:
            return errors
        errors = self._until(errors, float(np.fmin(t, self.found.covered)), coarse)
        if errors.measured() is None:
            (self.found, self.other, self.factor), self.notes = kept, notes
        return errors

    def _until(self, errors: Errors, t: float, other: Record) -> Errors:
        """Return the errors before an event that begins at t (s), and statistics of later events.

        The event may begin a little earlier or later in the other run. An event of fewer blocks
        that has another outcome is the end, too. Where earlier events do not tell what is
        wanted, the errors remain those of all events, which are beyond the tolerance.
        """
        if not t > self.made.t_begin:
            return errors
        events = self.record.events
        t = min(t, self._other_outcome())
        ended = events["t_stop"][(events["t_start"] < t) & (events["t_stop"] < t)]
        until = float(max(ended, default=self.made.t_begin))
        self.notes.append(
            f"single events cannot be trusted from t = {until:.6g} s on: two runs disagree"
        )
        before = self._scaled(self.found.before(until))
        if before.measured() is None and _beyond(errors):
            before = errors
        together = statistics(self.record, other, until)
        return dataclasses.replace(before, until=until, statistics=together)

    def _other_outcome(self) -> float:
        """Return the start (s) of the first event that slips other blocks or ends in one run alone.

        inf is returned if there is none.
        """
        alone = self.found.events["t_start"][self.found.events["outlasts"] > 0]
        return min(_apart(self.record, self.other), alone.min() if len(alone) else math.inf)

    def _perturbed(self, errors: Errors) -> Errors:
        """Return the errors up to the first event that a slightly faster driver changes."""
        made, driver = self.made, self.made.scene.driver
        faster = 1 + PERTURBATION
        protocol = tuple((t, V * faster) for t, V in driver.protocol)
        driver = dataclasses.replace(driver, V=driver.V * faster, protocol=protocol)
        scene = dataclasses.replace(made.scene, driver=driver)
        if scene == made.scene:
            self.notes.append("sensitivity was not measured: no driver moves")
            return errors
        other = dataclasses.replace(made, scene=scene).again(self.record)
        found = differences(self.record, other)
        off = found.beyond(made.options.tolerance / SAFETY, made.options.want)
        if not len(off):
            return errors
        apart = _errors(found, made, SAFETY, f"a driver that is faster by {PERTURBATION:g}")
        return self._until(apart, float(off["t_start"].min()), other)
