"""Errors of a run, measured by runs that leave out less, and what follows from them.

The run beside it is in finite geometry, neglects a hundredth of what jumps may, or does not jump
at all where that takes at most `WORTH` times as long, and has

a quarter of the step  where that is cheap (`CHEAP`), or half of it: it covers the whole run. Errors
                       of order p are 1/(1 - 4^-p) of the difference; `FINER` times that is
                       reported.
nearly twice the step  otherwise ("sample"), for as much of the run as costs as much again, by
                       counted work, from the start on. Errors of the run itself are smaller than
                       the difference, but both may miss what shorter steps find: `COARSER` times
                       the difference is reported, growing with the events that it does not cover.

Where little decides whether a block slips, both runs may take the same wrong turn: with a step n
times shorter once where the run itself does n^4 times: half the step misses one in 16, a quarter
one in 256. Where events of the two runs end at other blocks, the difference is no error of
some order in the step: `COARSER` times it is reported.

"full" takes a quarter of the step whatever it costs, and one more run whose driver is faster by
`PERTURBATION`, which says what is determined at all. A ladder is compared with dynamics, from the
start to where that has cost as much as the ladder, or `CHEAP`; what it leaves out is taken to be
off by what the plan expects. The factors are meant to hold in 19 runs of 20; `pyfric check-plans`
counts how often they do.

Where a planned run is off by more than its tolerance, it is compared with the one of shorter steps
first, and then made again with less left out: in finite geometry, then as the run beside it, up to
`MOST` times, each compared with a quarter of the step, and jumps that neglect a tenth or none. With
little viscosity the order of events hangs on what jumps leave, and two runs that leave the same
would take the same wrong turn. Where that does not help, the perturbed run says whether anything
would. From the time on at which it is off by more than the tolerance, single events cannot be
trusted, and the statistics of those that follow are compared instead.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import STEPPERS
from pyfric.engines.cost import CHEAP, FINEST, beside, beside_ladder, stepped
from pyfric.engines.dynamic import RunError
from pyfric.engines.guard import hurry
from pyfric.engines.options import step_size
from pyfric.record import Errors, differences, statistics
from pyfric.scene import default_geometry
from pyfric.statics import EquilibriumError

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.record import Differences, Record
    from pyfric.scene import Geometry, Scene

__all__ = ["COARSER", "FINER", "MOST", "PERTURBATION", "TIGHTER", "Made", "verified"]

PERTURBATION = 1e-9
"""By how much the driver of the perturbed run is faster, relative."""
MOST = 2
"""How often a run is made again with shorter steps."""
DYNAMICS, FINER, COARSER = 1.25, 2.0, 3.0
"""Reported error over the one measured, beside dynamics, finer steps and coarser ones: factors of
safety, as for two grids."""
VAIN = (
    "not refined: shorter steps do not change what jumps may leave, which alone is more than the "
    'tolerance; fidelity="dynamic" has no jumps'
)
TIGHTER, FURTHER, TANGENTS = 1e-2, 0.1, 0.2
"""What jumps of runs that measure errors may neglect, over what others may; over that, where the
run was itself one that measured errors; change of bonds at which they take modes anew."""
JUMPS = 3e-5
"""What jumps of both runs neglect of forces, over F_N, and of stresses, over F_N/N_x: beside full
dynamics of small scenes, 1.7e-5 at most."""
SPEEDS = {"speed_median": 3e-4, "speed_95": 1.6e-3, "speed_worst": 2.5e-3}
"""What jumps of both runs leave of front speeds in finite geometry, relative, because their modes
are those of an earlier state: the most beside full dynamics of three small scenes with fast
drivers, of jumps that ended up to 400 steps early."""
FAST = 0.01
"""Less of that is left where the driver pushes on by less than this, over F_N, during a ring-down:
in 40 small scenes the measured error was too small by more than 1e-4 only above 0.009."""


@dataclass(frozen=True, kw_only=True)
class Made:
    """How a run was made, so that others like it can be.

    Attributes:
        scene: what was run.
        t_begin, t_end: from where to where, s.
        options: with engine, geometry, step and switching settled.
        run: makes a run of a scene, to a time (s), with options; where it measures errors, `tight`
            says how much less its jumps neglect.
        refines: whether steps and geometry may be changed.
        expected: error that the plan expects.
        geometry: of the runs beside it; None means finite, where there is one.
    """

    scene: Scene
    t_begin: float
    t_end: float
    options: Options
    run: Callable[..., Record]
    refines: bool = False
    expected: float | None = None
    geometry: Geometry | None = None

    def again(
        self, record: Record, t_end: float | None = None, tight: int = 1, **changes: object
    ) -> Record:
        """Return a run made like a record, but for some options."""
        method = record.method
        same = {"dt": method.dt, "geometry": method.geometry, "switching": method.switching}
        plain = {"fidelity": method.engine, "method": None, "checkpoint": None}
        plain |= {"budget": method.budget, "verify": None}
        options = dataclasses.replace(self.options, **(plain | same | changes))
        t_end = self.t_end if t_end is None else t_end
        return self.run(self.scene, t_end, options, tight=tight)


def verified(record: Record, mode: str | None, made: Made) -> Record | None:
    """Return a run with its measured errors, refined where they exceed the tolerance.

    None for a ladder whose errors do: it is to be left for dynamics.

    Args:
        record: of the run.
        mode: "sample", at most at the price of the run; None, also where that is more but less
            than `CHEAP`; "full".
        made: how it was made.
    """
    start = time.perf_counter()
    try:
        if record.method.engine == "quasistatic":
            record = _ladder(record, mode, made)
        elif record.method.engine in ("hybrid", "dynamic"):
            record = _Stepped(record, made).verified(mode)
    except (RunError, EquilibriumError) as error:
        note = f"errors were not measured: the run beside it ended ({error})"
        record = dataclasses.replace(record, notes=(*record.notes, note))
    if record is None:
        return None
    seconds = {"verification": time.perf_counter() - start}
    return dataclasses.replace(record, timings=record.timings | seconds)


def _errors(found: Differences, made: Made, factor: float, by: str) -> Errors:
    promise = {"want": made.options.want, "tolerance": made.options.tolerance}
    return Errors(**promise, expected=made.expected, by=(by,), **found.errors(factor))


def _with(record: Record, errors: Errors, notes: list[str]) -> Record:
    if errors.verdict and not errors.holds:
        notes = [*notes, errors.verdict]
    return dataclasses.replace(record, errors=errors, notes=(*record.notes, *notes))


def _words(record: Record) -> str:
    method = record.method
    return f"{method.engine}, {method.geometry} geometry, steps of {method.dt:.3g} s"


def stretch(record: Record, made: Made, share: float) -> float:
    """Return the time (s) by which a run has done a share of its work, from the start on.

    The work of full dynamics is time, that of engines that wait in closed form is events. The first
    main event is always inside.
    """
    events, starts = record.events, record.events["t_start"].to_numpy()
    if share >= 1:
        return made.t_end
    first = events["t_stop"][events["is_main"] & events["finished"]].min() + 2 * record.method.t_gap
    if record.method.engine == "dynamic" or not len(starts):
        t = made.t_begin + share * (made.t_end - made.t_begin)
    else:
        t = starts[min(int(share * len(starts)), len(starts) - 1)]
    return float(min(np.fmax(t, first), made.t_end))


def _ladder(record: Record, mode: str | None, made: Made) -> Record | None:
    """Compare a ladder with dynamics of all or the first of its events."""
    events, scene = record.events, made.scene
    blocks = int(events["n_blocks"][events["is_main"]].sum())
    other = beside_ladder(scene, len(events), blocks, step_size(scene))
    share = 1.0 if mode == "full" else other.share
    if share == 0:
        note = "errors were not measured: dynamics of one event takes longer than the whole ladder"
        return dataclasses.replace(record, notes=(*record.notes, note))
    how = {"fidelity": "hybrid", "dt": "auto", "switching": "located"}
    how["geometry"] = default_geometry(scene)
    by = made.again(record, stretch(record, made, share), **how)
    errors = _errors(differences(record, by), made, DYNAMICS, f"dynamics ({_words(by)})")
    if share < 1:  # the rest may be off by as much as ladders are
        least = made.expected or 0.0
        known = {name: getattr(errors, name) for name in ("start", "arrest")}
        known = {name: max(value or 0.0, least) for name, value in known.items()}
        errors = dataclasses.replace(errors, **known)
    if made.refines and errors.holds is False:
        return None
    return _with(record, errors, [])


class _Stepped:
    """A run with steps, and the run that its errors are measured by."""

    def __init__(self, record: Record, made: Made) -> None:
        self.record, self.made = record, made
        self.geometry = made.geometry or default_geometry(made.scene)
        self.until: float | None = None
        self.perturbed: Record | None = None
        self.notes: list[str] = []
        self.tight, self.vain = 0, False

    def verified(self, mode: str | None) -> Record:
        """Return the run with its errors, refined where it may be."""
        made, why = self.made, f"a driver faster by {PERTURBATION:g} gives other ones"
        self._compare(mode)
        if mode == "full":
            self._perturb()
        refined, errors = 0, self.errors()
        while errors.holds is False and not self.vain and made.refines and self.other.done:
            if self.other.method.dt > self.record.method.dt:
                self._finer(2)
            elif refined and self.perturbed is None:
                self._perturb()
            elif refined < MOST:
                refined += self._refine(errors)
            else:
                break
            errors = self.errors()
        if self.vain and made.refines:
            self.notes.append(VAIN)
        elif made.refines and errors.holds is False:
            parted = self._parted(self.other, self.factor)
            if parted is not None:
                self.until, self.perturbed = parted, self.other
                why, errors = "finer steps give other ones", self.errors()
        return self._told(errors, why)

    def errors(self) -> Errors:
        """Return what is measured now, of events that can be trusted."""
        found = differences(self.record, self.other)
        if self.until is not None:
            found = found.before(self.until)
        factor = max(self.factor, COARSER) if found.turned else self.factor
        errors, left = _errors(found, self.made, factor, _words(self.other)), self._left()
        jumps = Errors(want=errors.want, tolerance=errors.tolerance, **left)
        self.vain = bool(errors.holds) and jumps.holds is False
        known = {name: getattr(errors, name) for name in left}
        more = {name: one + left[name] for name, one in known.items() if one is not None}
        return dataclasses.replace(errors, **more)

    def _left(self) -> dict[str, float]:
        """Return what jumps of both runs leave of each error, whatever the step."""
        if "dynamic" in (self.record.method.engine, self.other.method.engine):
            return {}
        left = dict.fromkeys(("start", "arrest", "stress"), JUMPS)
        if self.geometry == "finite":
            fast = min(hurry(self.made.scene) / FAST, 1.0)
            left |= {name: fast * most for name, most in SPEEDS.items()}
        return left

    def _told(self, errors: Errors, why: str) -> Record:
        """Return the run with its errors, and with what follows the events that can be trusted."""
        if self.until is not None:
            together = statistics(self.record, self.perturbed, self.until)
            errors = dataclasses.replace(errors, until=self.until, statistics=together)
            when = f"{self.until:.6g} s"
            self.notes.append(f"single events cannot be trusted from t = {when} on: {why}")
        return _with(self.record, errors, self.notes)

    def _compare(self, mode: str | None) -> None:
        """Make the run beside it that `mode` pays for."""
        record, method, made = self.record, self.record.method, self.made
        if mode == "full" or method.stepper != "rk4":
            self._finer(FINEST if mode == "full" else 2)
            return
        counts = record.counts.get("block_evaluations", 0), record.counts.get("jumps", 0)
        cheap, lasts = CHEAP if mode is None else 0.0, made.t_end - made.t_begin
        by = beside(made.scene, *counts, method.geometry, method.dt, cheap, lasts)
        if by.dt < method.dt:
            self._finer(method.dt / by.dt, by.whole)
        else:
            self._again(by.dt, by.whole, stretch(record, made, by.share))
            self.factor = COARSER / by.share

    def _finer(self, times: float, whole: bool | None = None) -> None:
        """Compare the run with one whose step is so many times shorter.

        It is full dynamics if `whole`, or by default where jumps spare little.
        """
        record, method, made = self.record, self.record.method, self.made
        order = 1 if method.switching == "step_end" else STEPPERS[method.stepper].order
        dt = method.dt / times
        if whole is None:
            counts = record.counts.get("block_evaluations", 0), record.counts.get("jumps", 0)
            lasts = made.t_end - made.t_begin
            whole = stepped(made.scene, times * counts[0], counts[1], dt, lasts) is not None
        self._again(dt, whole)
        self.factor = FINER / (1 - times**-order)

    def _again(self, dt: float, whole: bool, t_end: float | None = None) -> None:
        """Make the run beside it: of other steps (s), stricter jumps or none."""
        how = {"dt": dt, "geometry": self.geometry, "tight": self.tight + 1}
        how["fidelity"] = "dynamic" if whole else self.record.method.engine
        self.other = self.made.again(self.record, t_end, **how)

    def _refine(self, errors: Errors) -> bool:
        """Take a run that leaves out less: finite geometry, then the one of shorter steps.

        Return whether they are shorter.
        """
        method, off = self.record.method, errors.measured()
        shorter = method.geometry == self.other.method.geometry
        if not shorter:
            how = {"geometry": self.other.method.geometry, "tight": self.tight}
            self.record = self.made.again(self.record, **how)
        else:
            self.record, self.tight = self.other, self.tight + 1
            self._finer(FINEST)
        self.perturbed = self.until = None
        self.notes.append(f"refined to {_words(self.record)}: measured error {off:.2g}")
        return shorter

    def _perturb(self) -> None:
        """See from when on a driver that is faster by next to nothing gives other events."""
        made, driver = self.made, self.made.scene.driver
        driver = dataclasses.replace(driver, V=driver.V * (1 + PERTURBATION))
        scene = dataclasses.replace(made.scene, driver=driver)
        self.perturbed = dataclasses.replace(made, scene=scene).again(self.record, tight=self.tight)
        self.until = self._parted(self.perturbed, FINER)

    def _parted(self, other: Record, factor: float) -> float | None:
        """Return when the last event ended, in s, before one that is off by too much.

        That event begins in another run a little earlier or later than here.
        """
        options, events = self.made.options, self.record.events
        found = differences(self.record, other)
        t = found.parted(options.tolerance / factor, options.want)
        if t is None:
            return None
        ended = events["t_stop"][(events["t_start"] < t) & (events["t_stop"] < t)]
        return float(max(ended, default=self.made.t_begin))
