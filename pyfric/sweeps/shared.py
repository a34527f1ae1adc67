"""One verification for many runs: errors measured at some points hold for the others.

A few points, spread over the list, are verified as in `simulate`: levels are run until two agree.
The other points run at the cheapest level that keeps the tolerance at all of these points. Some of
the other points are checks. Checks run at the next level, too, and return this finer run. The
difference of both runs is the error of the chosen level at this point. The report names checks
beyond the tolerance. No other point is run again.

Points share a verification if their options are equal and their scenes have the same models. From
the checks follows a confidence limit for the share of unmeasured points that keep the tolerance.

Source: C. Clopper, E. Pearson, Biometrika 26, 404 (1934), for the confidence limit.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy

from pyfric.display import html
from pyfric.planning import Told, levels_of, simulate_point, told
from pyfric.record import Errors, Record
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping

    from pyfric.engines import Options
    from pyfric.planning import Level
    from pyfric.scene import Scene

CALIBRATION = 5
"""Number of points that choose the level (a choice)."""
CHECKED, LEAST = 0.05, 2
"""Share of the other points that are checks, and their least number (choices)."""
CONFIDENCE = 0.95
"""Confidence of the limit for the share of unmeasured points that keep the tolerance (a choice)."""
GOLDEN = (math.sqrt(5) - 1) / 2
"""The golden ratio. Fractional parts of its multiples are spread evenly, without the period of a
grid."""


class Job(Protocol):
    """One run, as `pyfric.Job` describes it."""

    @property
    def scene(self) -> Scene: ...
    @property
    def t_end(self) -> float: ...
    @property
    def options(self) -> Options: ...
    @property
    def key(self) -> str: ...


def sharing(options: Options) -> Options:
    """Return the options of one of many runs; planned runs share a verification by default."""
    planned = options.fidelity == "auto" and options.method is None and options.verify is None
    return dataclasses.replace(options, verify="shared") if planned else options


def measured(count: int) -> int:
    """Return the number of points at which errors are measured, out of `count` points."""
    chosen = min(CALIBRATION, count)
    return chosen + _checks(count - chosen)


def _checks(rest: int) -> int:
    return min(max(LEAST, math.ceil(CHECKED * rest)), rest)


def able(scene: Scene, options: Options) -> tuple[Level, ...]:
    """Return the levels that can be run; () if the run is refused."""
    try:
        of = levels_of(scene, options.on(scene))
    except SceneError:
        return ()
    return tuple(level for level in of if not level.cannot)


@dataclass(frozen=True)
class Point:
    """A job among others that share a verification, and the levels at which it runs.

    Attributes:
        job: the job.
        first: number of its first level.
        count: number of levels that run, 2 for a check; None means until two agree.
        chosen_at: number of other points at which the level was chosen.
    """

    job: Job
    first: int = 0
    count: int | None = None
    chosen_at: int = 0

    def __str__(self) -> str:
        return str(self.job)

    @property
    def scene(self) -> Scene:
        """The scene of its job."""
        return self.job.scene

    @property
    def key(self) -> str:
        """The key of its job."""
        return self.job.key

    def made(self, progress: Callable[..., None]) -> Record:
        """Return the record of a run of the job at its levels."""
        job, options = self.job, dataclasses.replace(self.job.options, threads=1)
        how = {"first": self.first, "count": self.count, "progress": progress}
        record = simulate_point(job.scene, job.t_end, options, **how)
        if self.count != 1:
            return record
        promise = {"want": options.want, "tolerance": options.tolerance}
        return record.replace(errors=Errors(**promise, chosen_at=self.chosen_at))

    def answered(self, record: Record) -> bool:
        """Return whether a stored record suffices: it has errors, or at least the level `first`."""
        if record.errors is None or not record.errors.chosen_at:
            return True
        of = able(self.job.scene, self.job.options)
        return self.count == 1 and told(record, of).level >= self.first


@dataclass
class _Together:
    """Points of the same models and options, by the keys of their jobs."""

    options: Options
    of: tuple[Level, ...]
    calibration: dict[str, Told] = field(default_factory=dict)
    others: dict[str, Told] = field(default_factory=dict)
    points: dict[str, Point] = field(default_factory=dict)
    count: int = 0
    checks: int = 0

    @property
    def level(self) -> int | None:
        """Number of the level of the other points; None if it has not been chosen."""
        if not self.calibration:
            return None
        points = self.calibration.values()
        return min(max(point.needs for point in points), max(point.level for point in points))

    def choose_calibration(self, jobs: Mapping[str, Job]) -> dict[str, Point]:
        """Return the points that choose the level, evenly spaced from the first to the last."""
        keys, count = list(jobs), min(CALIBRATION - len(self.calibration), len(jobs))
        numbers = np.linspace(0, len(keys) - 1, max(count, 0)).round().astype(int)
        return {keys[number]: Point(jobs[keys[number]]) for number in numbers}

    def choose_others(self, jobs: Mapping[str, Job]) -> dict[str, Point]:
        """Return the other points, of which some are checks."""
        if self.level is None:
            return {key: Point(job) for key, job in jobs.items()}
        self.count += len(jobs)
        due = min(_checks(self.count) - self.checks, len(jobs))
        checked = {int(len(jobs) * ((n + 0.5) * GOLDEN % 1)) for n in range(due)}
        self.checks += len(checked)
        single = {"first": self.level, "count": 1, "chosen_at": len(self.calibration)}
        # The finest level is checked by the level below it.
        check = {"first": max(min(self.level, len(self.of) - 2), 0), "count": 2}
        return {
            key: Point(job, **(check if number in checked else single))
            for number, (key, job) in enumerate(jobs.items())
        }

    def report(self) -> str:
        """Return the number of points at each level, and the measured errors, as text."""
        found, level = [*self.calibration.values(), *self.others.values()], self.level
        by: dict[tuple[int, str], list[Told]] = {}
        for point in found:
            by.setdefault((point.level, point.made.engine), []).append(point)
        levels = ", ".join(f"{len(by[name])} by {by[name][0].made}" for name in sorted(by))
        wanted = f"{self.options.want} within {self.options.tolerance:g}"
        lines = [f"{wanted}: {len(found)} points, {levels}"]
        known = [point for point in found if point.errors]
        held = sum(bool(point.holds) for point in known)
        largest = max((point.errors[point.level] for point in known), default=math.nan)
        lines.append(
            f"errors were measured at {len(known)} points and are within the tolerance at {held}; "
            f"the largest is {largest:.2g}"
        )
        single = [point for point in found if not point.errors]
        if single:
            checks = [point for point in self.others.values() if point.errors]
            kept = [point.errors.get(level, 0.0) for point in checks if point.needs <= level]
            share = lower_limit(len(kept), len(checks))
            lines.append(
                f"the other {len(single)} were not measured: {single[0].made} keeps "
                f"the tolerance at {len(kept)} of {len(checks)} checks, with errors of at most "
                f"{max(kept, default=math.nan):.2g}, and so at {share:.0%} of the others or more "
                f"({CONFIDENCE:.0%} confidence)"
            )
        return "\n".join(lines)


def lower_limit(kept: int, checks: int) -> float:
    """Return the lower confidence limit of a share, if `kept` of `checks` keep the tolerance."""
    if kept == 0:
        return 0.0
    return float(scipy.stats.beta.ppf(1 - CONFIDENCE, kept, checks - kept + 1))


def _joined(parts: Iterable[dict[str, Point]]) -> dict[str, Point]:
    return {key: point for part in parts for key, point in part.items()}


class Shared:
    """Levels chosen by verified runs for other runs; see the module.

    `run_all` makes a `Shared` for each call. If jobs come one by one, give `run_all` the same
    object each time:

        shared = Shared()

        def label(theta, h):
            job = Job(scene=setup2(theta=theta, h=h), t_end=1.0, options={"verify": "shared"})
            (record,) = run_all([job], progress=False, shared=shared)
            return "precursors" if len(analysis.precursors(record)) else "none"

    The first `CALIBRATION` jobs then choose the level. Of the next jobs, the first two are checks,
    and later one in twenty. ``str(shared)`` is the report.
    """

    def __init__(self) -> None:
        self._together: dict[Hashable, _Together] = {}

    def stages(
        self, jobs: Mapping[str, Job], found: Mapping[str, Any]
    ) -> Iterator[dict[str, Point]]:
        """Yield the points of jobs that share a verification; first those that choose a level.

        Args:
            jobs: jobs by their keys.
            found: records by the same keys. The caller adds the records of a stage before it asks
                for the next stage.
        """
        levels: dict[str, tuple[Level, ...]] = {}
        new: dict[Hashable, dict[str, Job]] = {}
        points: dict[Hashable, dict[str, Point]] = {}
        for key, job in jobs.items():
            if job.options.verify == "shared":
                levels[key] = of = able(job.scene, job.options)
                name = job.options, tuple((each.engine, each.geometry, each.answers) for each in of)
                group = self._together.setdefault(name, _Together(job.options, of))
                new.setdefault(name, {})
                points[name] = points.get(name, {})
                if key in group.points:
                    points[name][key] = group.points[key]
                else:
                    new[name][key] = job

        def results(of: Mapping[str, Point]) -> dict[str, Told]:
            records = {key: found[key] for key in of if isinstance(found[key], Record)}
            return {key: told(record, levels[key]) for key, record in records.items()}

        first = {
            name: self._together[name].choose_calibration(lacking) for name, lacking in new.items()
        }
        yield _joined([*points.values(), *first.values()])
        second = {}
        for name, lacking in new.items():
            group = self._together[name]
            group.calibration |= results(first[name])
            second[name] = group.choose_others(
                {k: j for k, j in lacking.items() if k not in first[name]}
            )
            group.points |= first[name] | second[name]
        if any(second.values()):
            yield _joined(second.values())
        for name, group in ((name, self._together[name]) for name in new):
            later = (points[name] | second[name]).items()
            group.others |= results({k: point for k, point in later if k not in group.calibration})

    def __str__(self) -> str:
        groups = [group for group in self._together.values() if group.calibration]
        return "\n".join(group.report() for group in groups)

    __repr__ = __str__

    _repr_html_ = html
