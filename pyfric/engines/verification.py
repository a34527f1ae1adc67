"""Errors of a run, measured by runs that leave out less or more, and what follows from them.

"sample"   one run beside it whose steps are nearly twice as long, in finite geometry, and whose
           jumps neglect a hundredth: the run's own error is below the difference, because errors
           of order p grow by the p-th power of the step. It ends where it has cost as much as the
           run itself; errors are taken to grow with time beyond that. A ladder is compared with
           dynamics of its first main events.
"full"     one run beside it of half the step, in finite geometry, and one whose driver is faster by
           `PERTURBATION`: the difference from the first is the error, from the second it says what
           is determined at all.

Where a planned run is off by more than its tolerance, it is made again with less left out: in
finite geometry, then with half the step, up to `MOST` times, each compared with the one before.
Where that does not help, the perturbed run says whether anything would. From the time on at which
it is off by more than the tolerance, single events cannot be trusted, and the statistics of those
that follow are compared instead.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pyfric.core import STEPPERS
from pyfric.engines.dynamic import RunError
from pyfric.record import Errors, differences, statistics
from pyfric.scene import default_geometry
from pyfric.statics import EquilibriumError, stability_limit

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.record import Differences, Record
    from pyfric.scene import Geometry, Scene

__all__ = ["MOST", "PERTURBATION", "Made", "coarser_step", "verified"]

PERTURBATION = 1e-9
"""By how much the driver of the perturbed run is faster, relative."""
MOST = 3
"""How often a run is refined."""
LONGER, NEAR = 2.0, 0.95
"""The coarser run's step over the run's own; at most this share of the stability limit."""
SAMPLED = 3
"""Main events of a ladder that are compared with dynamics."""


@dataclass(frozen=True, kw_only=True)
class Made:
    """How a run was made, so that others like it can be.

    Attributes:
        scene: what was run.
        t_begin, t_end: from where to where, s.
        options: with engine, geometry, step and switching settled.
        run: makes a run of a scene, to a time (s), with options; tight = True where it measures
            errors: its jumps neglect less.
        refines: whether steps and geometry may be changed.
        expected: error that the plan expects.
        share: part of the time that the coarser run may take.
        geometry: of the runs beside it; None means finite, where there is one.
    """

    scene: Scene
    t_begin: float
    t_end: float
    options: Options
    run: Callable[..., Record]
    refines: bool = False
    expected: float | None = None
    share: float = 1.0
    geometry: Geometry | None = None

    def again(self, record: Record, t_end: float | None = None, **changes: object) -> Record:
        """Return a run made like a record, but for some options."""
        method = record.method
        same = {"dt": method.dt, "geometry": method.geometry, "switching": method.switching}
        plain = {"fidelity": method.engine, "method": None, "checkpoint": None}
        plain |= {"budget": False, "verify": None}
        options = dataclasses.replace(self.options, **(plain | same | changes))
        t_end = self.t_end if t_end is None else t_end
        return self.run(self.scene, t_end, options, tight=True)


def verified(record: Record, mode: str, made: Made) -> Record | None:
    """Return a run with its measured errors, refined where they exceed the tolerance.

    None for a ladder whose errors do: it is to be left for dynamics.
    """
    start = time.perf_counter()
    try:
        if record.method.engine == "quasistatic":
            record = _ladder(record, mode, made)
        elif record.method.engine in ("hybrid", "dynamic"):
            record = _stepped(record, mode, made)
    except (RunError, EquilibriumError) as error:
        note = f"errors were not measured: the run beside it ended ({error})"
        record = dataclasses.replace(record, notes=(*record.notes, note))
    if record is None:
        return None
    seconds = {"verification": time.perf_counter() - start}
    return dataclasses.replace(record, timings=record.timings | seconds)


def _errors(found: Differences, made: Made, factor: float, by: list[str]) -> Errors:
    promise = {"want": made.options.want, "tolerance": made.options.tolerance}
    return Errors(**promise, expected=made.expected, by=tuple(by), **found.errors(factor))


def _with(record: Record, errors: Errors, notes: list[str]) -> Record:
    if not errors.holds:
        beyond = f"measured error {errors.measured():.2g} for {errors.want}"
        notes = [*notes, f"does not hold: {beyond}, tolerance {errors.tolerance:g}"]
    return dataclasses.replace(record, errors=errors, notes=(*record.notes, *notes))


# --- the ladder ----------------------------------------------------------------------------------


def _ladder(record: Record, mode: str, made: Made) -> Record | None:
    """Compare a ladder with dynamics of all or the first of its main events."""
    t_end, geometry = made.t_end, default_geometry(made.scene)
    main = record.events[record.events["is_main"]]
    if mode == "sample" and len(main) > SAMPLED:
        t_end = float(main["t_stop"].iloc[SAMPLED - 1] + 2 * record.method.t_gap)
    how = {"fidelity": "hybrid", "dt": "auto", "geometry": geometry, "switching": "located"}
    other = made.again(record, t_end, **how)
    errors = _errors(differences(record, other), made, 1.0, [f"dynamics ({_words(other)})"])
    if made.refines and not errors.holds:
        return None
    return _with(record, errors, [])


# --- runs with steps -----------------------------------------------------------------------------


def _stepped(record: Record, mode: str, made: Made) -> Record:
    """Compare a run with others, and refine it."""
    tolerance, want = made.options.tolerance, made.options.want
    other, factor = _beside(record, mode, made)
    notes, until, perturbed = [], None, None
    if mode == "full":
        perturbed = _perturbed(record, made)
        until = differences(record, perturbed).parted(tolerance, want)
    for refined in range(MOST + 1):
        found = differences(record, other)
        if until is not None:
            found = found.before(until)
        errors = _errors(found, made, factor, [_words(other)])
        if errors.holds or not (made.refines and other.done) or refined == MOST:
            break
        if refined and until is None:
            perturbed = _perturbed(record, made)
            until = differences(record, perturbed).parted(tolerance, want)
            if until is not None:
                found = found.before(until)
                errors = _errors(found, made, factor, [_words(other)])
                if errors.holds:
                    break
        finer, beside, factor = _refined(record, other, made)
        notes.append(f"refined to {_words(finer)}: measured error {errors.measured():.2g}")
        record, other = finer, beside
    why = f"a driver faster by {PERTURBATION:g} gives other ones"
    if made.refines and not errors.holds:
        parted = found.parted(tolerance, want)
        if parted is not None:
            until, perturbed, why = parted, other, "finer steps give other ones"
            errors = _errors(found.before(until), made, factor, [_words(other)])
    if until is not None:
        together = statistics(record, perturbed, until)
        errors = dataclasses.replace(errors, until=until, statistics=together)
        notes.append(f"single events cannot be trusted from t = {until:.6g} s on: {why}")
    return _with(record, errors, notes)


def _words(record: Record) -> str:
    method = record.method
    return f"{method.engine}, {method.geometry} geometry, steps of {method.dt:.3g} s"


def coarser_step(scene: Scene, dt: float) -> float:
    """Return the step of the coarser run, in s; half the step where there is none."""
    ratio = min(LONGER, NEAR * stability_limit(scene)[0] / dt)
    return dt * (ratio if ratio > 1.25 else 0.5)


def _beside(record: Record, mode: str, made: Made) -> tuple[Record, float]:
    """Return the run to compare with, and the error of the run over the difference."""
    method, t_end = record.method, made.t_end
    order = 1 if method.switching == "step_end" else STEPPERS[method.stepper].order
    geometry = made.geometry or default_geometry(made.scene)
    dt = method.dt / 2
    if mode == "sample" and method.stepper == "rk4":
        dt = coarser_step(made.scene, method.dt)
        t_end = made.t_begin + made.share * (t_end - made.t_begin)
    other = made.again(record, t_end, dt=dt, geometry=geometry)
    if dt < method.dt:
        return other, 1 / (1 - 0.5**order)
    return other, max(1.0, 1 / ((dt / method.dt) ** order - 1)) / made.share


def _refined(record: Record, other: Record, made: Made) -> tuple[Record, Record, float]:
    """Return a run that leaves out less, the one to compare it with, and the factor."""
    method = record.method
    if other.method.dt < method.dt:  # the one beside it is the better one
        finer = made.again(other, dt=other.method.dt / 2)
        return other, finer, 1 / (1 - 0.5**4)
    if method.geometry != other.method.geometry:
        return made.again(record, geometry=other.method.geometry), other, 1.0
    return made.again(record, dt=method.dt / 2), record, 1.0


def _perturbed(record: Record, made: Made) -> Record:
    """Return the run with a driver that is faster by next to nothing."""
    driver = made.scene.driver
    driver = dataclasses.replace(driver, V=driver.V * (1 + PERTURBATION))
    return dataclasses.replace(made, scene=dataclasses.replace(made.scene, driver=driver)).again(
        record
    )
