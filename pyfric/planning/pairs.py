"""Two runs of a scene at different levels: their difference is the error of the coarser run.

The finer run is returned, with the error of the coarser run. The error is not extrapolated with an
order of convergence, because rupture times do not have the order of the stepper. Two runs may also
differ in the blocks that slip in an event, or in whether the event has ended. Such differences are
less reliable, because two wrong outcomes can be alike, and are multiplied by `SAFETY`.

If the two finest runs still differ by more than the tolerance, single events cannot be trusted from
the first difference on. Later events are compared by their statistics.

Source: P. J. Roache, J. Fluids Eng. 116, 405 (1994), factors of safety for two grids.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from pyfric.engines import ended_by_condition
from pyfric.record import Errors, differences, statistics

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.engines import Options
    from pyfric.planning.levels import Level
    from pyfric.record import Differences, Model, Record
    from pyfric.scene import Scene

SAFETY = 3.0
"""Factor of safety for two grids. The factor multiplies differences if the slip of an event
differs, or if the coarser run is returned."""
PERTURBATION = 1e-9
"""Relative increase of the driver's speed in the perturbed run."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A scene, the time and options of its run, and the function that makes a run.

    Attributes:
        scene: the scene.
        t_begin, t_end: times of the beginning and the end, in s.
        options: options on this scene.
        run: function of scene, end (s) and options that makes a run, which `enough` can end.
    """

    scene: Scene
    t_begin: float
    t_end: float
    options: Options
    run: Callable[..., Record]


class Made(NamedTuple):
    """A finished run: its level, its record, and its wall time, in s."""

    level: Level
    record: Record
    seconds: float


class Pair:
    """Two runs of a scene. The answer is the finer run, if this run may be returned.

    Args:
        asked: the scene, with time and options.
        coarse, fine: the runs.

    Attributes:
        answer, other: the run that is returned, and the run with which it is compared.
        found: differences of the runs.
    """

    def __init__(self, asked: Asked, coarse: Made, fine: Made) -> None:
        self.asked, self.coarse, self.fine = asked, coarse, fine
        self.finer = fine.level.answers and fine.record.done
        self.answer, self.other = (fine, coarse) if self.finer else (coarse, fine)
        self.found = differences(self.answer.record, self.other.record)
        if self.found.lacking.any():
            self.found = differences(*self._further())

    def _further(self) -> tuple[Record, Record]:
        """Return both runs; a run that lacks the last event of the other run is continued.

        The continuation ends when the driver has added the tolerance times F_N to F_T.
        """
        scene, own = self.asked.scene, self.found.events["own"][self.found.lacking]
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
        """Return the errors of the answer from given differences; None means all differences."""
        asked, found = self.asked, self.found if found is None else found
        end, t_end = float(self.answer.record.curve["t"].iloc[-1]), asked.t_end
        t_end = min(t_end, end) if ended_by_condition(self.answer.record) else t_end
        promise = {"want": asked.options.want, "tolerance": asked.options.tolerance, "t_end": t_end}
        if not self.resolved:
            return Errors(**promise)
        factor = self.factor(found.turned)
        return Errors(**promise, by=(self.by,), factor=factor, **found.errors(factor))

    @property
    def resolved(self) -> bool:
        """Whether the finer run resolves weakening; otherwise friction drops at once in both."""
        dt = self.fine.level.dt
        return dt is None or dt <= self.asked.scene.resolving_step

    @property
    def by(self) -> Model:
        """The model with which the answer is compared."""
        return self.other.level.model

    def factor(self, turned: bool) -> float:
        """Return the ratio of reported errors to differences."""
        return SAFETY if turned or not self.finer else 1.0

    def as_far_as_it_goes(self) -> tuple[Errors, list[str]]:
        """Return errors of all events, or of events before the first difference, and notes."""
        errors, want = self.errors(), self.asked.options.want
        if not self.resolved:
            dt, resolves = self.fine.level.dt, self.asked.scene.resolving_step
            note = f"errors were not measured: steps of {dt:.3g} s do not resolve weakening, which "
            note += f"needs dt <= {resolves:.3g} s, and friction drops at once in both of two runs"
            return errors, [note]
        off = self.found.beyond(errors.tolerance / errors.factor, want)["t_start"]
        again = self.found.events["t_start"][self.found.open & ~self.found.lacking]
        if errors.holds is not False and again.empty:
            return errors, []
        return self.until(errors, float(min([*off, *again])))

    def until(self, errors: Errors, t: float) -> tuple[Errors, list[str]]:
        """Return the errors before an event that begins at t (s), and statistics of later events.

        If the wanted error is unknown for earlier events, errors of all events are returned.
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
    """A run, and its repetition with a driver that is faster by the share `PERTURBATION`."""

    @property
    def by(self) -> Model:
        return dataclasses.replace(super().by, faster=PERTURBATION)


def finest(asked: Asked, runs: list[Made]) -> Pair:
    """Return the pair of the finest run that may be returned and the finest of the other runs."""
    able = [n for n, made in enumerate(runs) if made.level.answers and made.record.done]
    last = len(runs) - 1
    return Pair(asked, runs[last - 1 if able[-1] == last else able[-1]], runs[last])
