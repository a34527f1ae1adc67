"""Two runs of a scene at different levels: their difference is the error of the coarser one.

The finer run is returned, and no larger error than that of the coarser one is reported for it. If
both differ by steps and jumps alone, and no event took another turn, errors of steps of order p
fall by r^p with the ratio r of the steps, and those of jumps with their accuracy. The difference is
then 1 - r^-p times the error of the coarser run, or 1 + r^-p times for opposite steppers.
`SAFETY` times what is left is reported. Where an event slips other blocks, one of them once more,
or has ended in one run alone, differences have no order, and `TURNED` times the difference is
reported.

If the two finest runs still differ by more than the tolerance, single events cannot be trusted from
the first difference on. Later events are compared by their statistics.

Source: P. J. Roache, J. Fluids Eng. 116, 405 (1994), factors of safety for two grids.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from pyfric.core import STEPPERS
from pyfric.engines import ended_by_condition
from pyfric.record import Errors, differences, statistics

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.engines import Options
    from pyfric.planning.levels import Level
    from pyfric.record import Differences, Record
    from pyfric.scene import Scene

SAFETY, TURNED = 2.0, 3.0
"""Factors of safety: of errors with a known order or of the coarser run, and of differences in which
an event took another turn. Policies, as for two grids."""
PERTURBATION = 1e-9
"""Relative increase of the driver's speed in the perturbed run."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked for, and the function that makes a run.

    Attributes:
        scene: the scene.
        t_begin, t_end: times of the beginning and the end, in s.
        options: options on this scene.
        run: function of scene, end (s) and options that makes a run; `enough` can end it.
    """

    scene: Scene
    t_begin: float
    t_end: float
    options: Options
    run: Callable[..., Record]


class Made(NamedTuple):
    """A run that was made: its level, its record, and the wall time that it took, in s."""

    level: Level
    record: Record
    seconds: float


class Pair:
    """Two runs, of which the answer is the finer one if it may be returned.

    Args:
        asked: what is asked for.
        coarse, fine: the runs.

    Attributes:
        answer, other: the run that is returned, and the other one.
        found: how far they are apart.
    """

    def __init__(self, asked: Asked, coarse: Made, fine: Made) -> None:
        self.asked, self.coarse, self.fine = asked, coarse, fine
        self.finer = fine.level.answers and fine.record.done
        self.answer, self.other = (fine, coarse) if self.finer else (coarse, fine)
        self.found = differences(self.answer.record, self.other.record)
        if self.found.open.any():
            self.found = differences(*self._further())

    def _further(self) -> tuple[Record, Record]:
        """Return both runs, of which one that lacks the last event of the other one goes on.

        It goes on until the driver has added the tolerance to F_T.
        """
        scene, own = self.asked.scene, self.found.events["own"][self.found.open]
        pace, records = scene.driver.K * scene.driver.fastest, []
        for made, lacks in ((self.answer, (~own).any()), (self.other, own.any())):
            record = made.record
            if lacks and record.done and pace:
                more = self.asked.options.tolerance * scene.F_N / pace
                options = dataclasses.replace(made.level.options(self.asked.options), stop_when=())
                end = float(record.curve["t"].iloc[-1])
                record = self.asked.run(scene, end + more, options, initial=record, progress=False)
            records.append(record)
        return records[0], records[1]

    def errors(self, found: Differences | None = None) -> Errors:
        """Return the errors of the answer, from some of the differences; None means all."""
        asked, found = self.asked, self.found if found is None else found
        end, t_end = float(self.answer.record.curve["t"].iloc[-1]), asked.t_end
        t_end = min(t_end, end) if ended_by_condition(self.answer.record) else t_end
        promise = {"want": asked.options.want, "tolerance": asked.options.tolerance, "t_end": t_end}
        if not self.resolved:
            return Errors(**promise)
        factor = self.factor(found.turned)
        by = (str(self.other.level),)
        return Errors(**promise, by=by, factor=factor, **found.errors(factor))

    @property
    def resolved(self) -> bool:
        """Whether the finer run resolves weakening of friction; otherwise both drop it at once."""
        dt = self.fine.level.dt
        return dt is None or dt <= self.asked.scene.resolving_step

    def factor(self, turned: bool) -> float:
        """Return reported errors over differences."""
        if turned:
            return TURNED
        return min(SAFETY * self._left(), 1.0) if self.finer else SAFETY

    def _left(self) -> float:
        """Return the expected error of the finer run over the difference."""
        a, b = self.coarse.level, self.fine.level
        if (a.engine, a.geometry) != (b.engine, b.geometry) or a.dt is None:
            return 1.0
        order = 1 if b.switching == "step_end" else STEPPERS[b.stepper].order
        times = (a.dt / b.dt) ** order
        left = 1 / (times + 1) if a.stepper != b.stepper else 1 / (times - 1)
        return max(left, b.accuracy / a.accuracy) if a.accuracy else left

    def as_far_as_it_goes(self) -> tuple[Errors, list[str]]:
        """Return the errors of the answer, or of its events before the first difference."""
        errors, want = self.errors(), self.asked.options.want
        if not self.resolved:
            dt, resolves = self.fine.level.dt, self.asked.scene.resolving_step
            note = f"errors were not measured: steps of {dt:.3g} s do not resolve weakening, which "
            note += f"needs dt <= {resolves:.3g} s, and friction drops at once in both of two runs"
            return errors, [note]
        if errors.holds is not False:
            return errors, []
        off = self.found.beyond(errors.tolerance / errors.factor, want)
        return self.until(errors, float(off["t_start"].min()))

    def until(self, errors: Errors, t: float) -> tuple[Errors, list[str]]:
        """Return the errors before an event that begins at t (s), and statistics of later events.

        The event may begin a little earlier or later in the other run. Where earlier events do not
        tell what is wanted, the errors remain those of all events.
        """
        asked, record = self.asked, self.answer.record
        ended = record.events["t_stop"][record.events["t_stop"] < t]
        until = float(max(ended, default=asked.t_begin))
        before = self.errors(self.found.before(until))
        if before.measured() is None or before.holds is False:
            return errors, []
        after = statistics(record, self.other.record, until)
        note = f"single events cannot be trusted from t = {until:.6g} s on: two runs disagree"
        return dataclasses.replace(before, until=until, statistics=after), [note]

    def perturbed(self, errors: Errors) -> tuple[Errors, list[str]]:
        """Return the errors up to the first event that a slightly faster driver changes."""
        asked, driver, faster = self.asked, self.asked.scene.driver, 1 + PERTURBATION
        protocol = tuple((t, V * faster) for t, V in driver.protocol)
        driver = dataclasses.replace(driver, V=driver.V * faster, protocol=protocol)
        scene = dataclasses.replace(asked.scene, driver=driver)
        if scene == asked.scene:
            return errors, ["sensitivity was not measured: no driver moves"]
        record = asked.run(scene, asked.t_end, self.answer.level.options(asked.options))
        level = dataclasses.replace(self.answer.level, answers=False)
        other = Faster(asked, self.answer, Made(level, record, 0.0))
        apart = other.errors()
        if apart.holds is not False:
            return errors, []
        off = other.found.beyond(apart.tolerance / apart.factor, asked.options.want)
        return other.until(apart, float(off["t_start"].min()))


class Faster(Pair):
    """A run, and the same run with a driver that is faster by `PERTURBATION`."""

    def errors(self, found: Differences | None = None) -> Errors:
        by = f"a driver that is faster by {PERTURBATION:g}"
        return dataclasses.replace(super().errors(found), by=(by,))


def finest(asked: Asked, runs: list[Made]) -> Pair:
    """Return the pair of the finest run that may be returned and the finest other run."""
    able = [n for n, made in enumerate(runs) if made.level.answers and made.record.done]
    last = len(runs) - 1
    return Pair(asked, runs[last - 1 if able[-1] == last else able[-1]], runs[last])
