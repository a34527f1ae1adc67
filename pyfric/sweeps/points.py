"""A sweep: one scene, and the points at which some of its numbers or options are varied.

    sweep = Sweep.from_toml("sweep.toml")
    print(sweep.estimate())
    results = sweep.run()
    results.table            # one row for each point
    results.to_xarray()      # the same with units, on the axes of a grid

The file is TOML, and quantities carry their units::

    scene = "setup2"         # a preset, a scene file beside this one, or a table [scene]
    t_end = "1.2 s"
    points = "grid"          # or list, random, sobol, halton, latin

    [over]
    "top.theta" = [-0.5, 0, 0.5]
    "driver.h" = { from = "2 mm", to = "10 mm", step = "2 mm" }

    [options]                # those of `pyfric.simulate`
    fidelity = "quasistatic"

    [limits]
    max_hours = 1
    max_GB = 2

A grid takes all combinations, a list the first values of all fields, then the second ones, and so
on. The others draw `n` points from ranges, with a `seed`; `scale = "log"` makes a range even in its
logarithm, and `step` keeps to multiples of a step.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self, get_args

import numpy as np
import scipy

from pyfric.display import html
from pyfric.engines import Options, expected_cost
from pyfric.record import Record
from pyfric.scene import Scene, SceneError, check_number, unknown
from pyfric.sweeps.results import Before, Results
from pyfric.sweeps.store import cache_folder, failed_before, kept
from pyfric.sweeps.sweep import Job, JobError, run_all
from pyfric.sweeps.sweep_file import read_sweep
from pyfric.sweeps.varied import MOST_POINTS, PARTS, Span, units

__all__ = ["Estimate", "Sweep"]

Kind = Literal["grid", "list", "random", "sobol", "halton", "latin"]
DRAWN: Mapping[str, str] = {"sobol": "Sobol", "halton": "Halton", "latin": "LatinHypercube"}
"""Classes of `scipy.stats.qmc`, which is slow to import: first use imports it."""
ASKED = 5
"""The cost of a sweep is that of so many of its points, on average."""


class Estimate(NamedTuple):
    """What a sweep comes to: points, those refused and finished, and what the others take."""

    points: int
    refused: int
    finished: int
    hours: float
    GB: float

    def __str__(self) -> str:
        left = self.points - self.refused - self.finished
        return (
            f"{self.points} points: {self.finished} finished, {self.refused} refused, {left} to "
            f"run; about {self.hours:.2g} h of processor time and {self.GB:.2g} GB"
        )


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One scene at many points.

    Args:
        scene: what is varied.
        t_end: time of the end, s.
        over: dotted fields ("driver.h", "t_end", "options.tolerance") to lists of values in SI, or
            to a `Span`.
        points: "grid", "list", "random", "sobol", "halton" or "latin"; see the module.
        n: number of points that are drawn.
        seed: of drawn points; the same seed gives the same points.
        options: those of all runs; a mapping becomes `Options`.
        max_hours, max_GB: a sweep whose estimate is beyond is refused; None means no limit.

    Raises:
        SceneError: an argument is refused.
    """

    scene: Scene
    t_end: float
    over: Mapping[str, Sequence[Any] | Span]
    points: Kind = "grid"
    n: int | None = None
    seed: int = 0
    options: Options = field(default_factory=Options)
    max_hours: float | None = None
    max_GB: float | None = None

    def __repr__(self) -> str:
        fields = ", ".join(self.over)
        return f"Sweep of {self.scene.name or 'a scene'} over {fields}: {self.points}, t_end = " + (
            f"{self.t_end:g} s"
        )

    def _repr_html_(self) -> str:
        return html(self)

    def __post_init__(self) -> None:
        first = Job(scene=self.scene, t_end=self.t_end, options=self.options)
        for name in ("scene", "t_end", "options"):
            object.__setattr__(self, name, getattr(first, name))
        known = get_args(Kind)
        if self.points not in known:
            raise unknown("points", self.points, str(self.points), known)
        if not self.over:
            raise SceneError("over", self.over, "", "at least one field with its values")
        for name, values in self.over.items():
            if name not in units(self.scene):
                raise unknown(f"over.{name}", values, name, units(self.scene))
            self._check(name, values)
        for name in ("max_hours", "max_GB"):
            if getattr(self, name) is not None:
                check_number(f"limits.{name}", getattr(self, name), "", gt=0.0)
        for name, least in (("n", 1), ("seed", 0)):
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool)
            drawn = self.points not in ("grid", "list")
            if (name != "n" or drawn) and not (whole and least <= value <= MOST_POINTS):
                raise SceneError(name, value, "", f"a whole number, {least} … {MOST_POINTS}")
        lengths = [len(values) for values in self._values().values()]
        if self.points == "list" and len(set(lengths)) > 1:
            raise SceneError("over", lengths, "", "as many values of each field in a list")
        if self.points == "grid" and math.prod(lengths) > MOST_POINTS:
            raise SceneError("over", lengths, "", f"at most {MOST_POINTS} points")

    def _check(self, name: str, values: Sequence[Any] | Span) -> None:
        if isinstance(values, Span):
            ends = {"gt": 0.0} if values.scale == "log" else {}
            for end in (values.start, values.stop):
                check_number(f"over.{name}", end, units(self.scene)[name], **ends)
            if not values.start < values.stop:
                raise SceneError(f"over.{name}", (values.start, values.stop), "", "from < to")
            if values.scale not in ("linear", "log"):
                raise SceneError(f"over.{name}.scale", values.scale, "", "'linear' or 'log'")
            if values.step is not None:
                check_number(f"over.{name}.step", values.step, units(self.scene)[name], gt=0.0)
            whole = isinstance(values.n, int) and not isinstance(values.n, bool)
            if values.n is not None and not (whole and values.n >= 2):
                raise SceneError(f"over.{name}.n", values.n, "", "a whole number >= 2")
        elif isinstance(values, str) or not isinstance(values, Sequence) or not len(values):
            raise SceneError(f"over.{name}", values, "", "a list of values, or a range")
        elif self.points not in ("grid", "list"):
            raise SceneError(
                f"over.{name}", values, "", f"a range, because points are {self.points}"
            )

    def _values(self) -> dict[str, list[Any]]:
        if self.points not in ("grid", "list"):
            return {}
        return {
            name: values.values(f"over.{name}") if isinstance(values, Span) else list(values)
            for name, values in self.over.items()
        }

    def at(self) -> list[dict[str, Any]]:
        """Return the points: for each the values of its fields, in SI."""
        names = list(self.over)
        if self.points == "grid":
            rows = itertools.product(*self._values().values())
        elif self.points == "list":
            rows = zip(*self._values().values(), strict=True)
        else:
            spans = list(self.over.values())
            rows = (
                [one.at(share) for one, share in zip(spans, shares, strict=True)]
                for shares in self._drawn(len(spans))
            )
        return [dict(zip(names, row, strict=True)) for row in rows]

    def _drawn(self, fields: int) -> np.ndarray:
        rng = np.random.default_rng(self.seed)
        if self.points == "random":
            return rng.random((self.n, fields))
        drawn = getattr(scipy.stats.qmc, DRAWN[self.points])(fields, seed=rng)
        if self.points == "sobol":  # in powers of two, which keeps its balance
            return drawn.random_base2(max(self.n - 1, 0).bit_length())[: self.n]
        return drawn.random(self.n)

    def jobs(self) -> list[Job | SceneError]:
        """Return the job of each point, or why it is refused."""
        return [self._job(values) for values in self.at()]

    def _job(self, values: Mapping[str, Any]) -> Job | SceneError:
        grouped: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            part, _, key = name.rpartition(".")
            grouped.setdefault(part, {})[key] = value
        try:
            parts = {
                name: dataclasses.replace(getattr(self.scene, name), **grouped[name])
                for name in PARTS
                if name in grouped
            }
            return Job(
                scene=dataclasses.replace(self.scene, **parts),
                t_end=grouped.get("", {}).get("t_end", self.t_end),
                options=dataclasses.replace(self.options, **grouped.get("options", {})),
            )
        except SceneError as error:
            return error

    # --- running ---------------------------------------------------------------------------------

    def estimate(self, cache: bool | str | os.PathLike[str] = True) -> Estimate:
        """Return what the sweep comes to, by `pyfric.plan` for a few of its points."""
        jobs, found = self.jobs(), self._finished(cache)
        left = [
            job
            for job, one in zip(jobs, found, strict=True)
            if isinstance(job, Job) and not isinstance(one, Record)
        ]
        refused = sum(isinstance(job, SceneError) for job in jobs)
        hours = GB = 0.0
        if left:
            asked = left[:: math.ceil(len(left) / ASKED)]
            costs = [expected_cost(job.scene, job.t_end, job.options) for job in asked]
            seconds, size = np.mean(costs, axis=0) * len(left)
            hours, GB = seconds / 3600, size / 1e9
        return Estimate(len(jobs), refused, len(jobs) - len(left) - refused, hours, GB)

    def _finished(self, cache: bool | str | os.PathLike[str]) -> list[Record | Exception | None]:
        """Return the finished record of each point, why it failed or is refused, or None."""
        folder = None
        if cache is not False:
            folder = cache_folder() if cache is True else Path(cache)
        jobs = self.jobs()
        if folder is None:
            return [None if isinstance(job, Job) else job for job in jobs]
        return [_found(folder, job) if isinstance(job, Job) else job for job in jobs]

    def status(self, cache: bool | str | os.PathLike[str] = True) -> Results:
        """Return the results so far; points that have not been run are "waiting".

        Points that failed are "failed", with the reason; `run` tries them again.
        """
        return Results(self, tuple(self._finished(cache)))

    def run(self, cache: bool | str | os.PathLike[str] = True, **how: Any) -> Results:
        """Run all points that are not finished.

        Args:
            cache: as in `run_all`.
            **how: workers, progress and executor of `run_all`.

        Raises:
            SceneError: an argument is refused, or the estimate is beyond a limit.
            KeyboardInterrupt: after Ctrl-C; finished runs are kept, and the next call goes on.
        """
        if self.max_hours is not None or self.max_GB is not None:
            found = self.estimate(cache)
            for name, value in (("max_hours", found.hours), ("max_GB", found.GB)):
                limit = getattr(self, name)
                if limit is not None and value > limit:
                    allowed = f"at least {value:.2g}, which the sweep would take ({found})"
                    raise SceneError(f"limits.{name}", limit, "", allowed, "too little")
        jobs = self.jobs()
        made = iter(
            run_all(
                [one for one in jobs if isinstance(one, Job)], cache=cache, errors="return", **how
            )
        )
        return Results(self, tuple(next(made) if isinstance(one, Job) else one for one in jobs))

    # --- files -----------------------------------------------------------------------------------

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Self:
        """Return the sweep that a file describes.

        Raises:
            SceneError: it cannot be read, or a value is refused.
        """
        return cls(**read_sweep(Path(path)))


def _found(folder: Path, job: Job) -> Record | JobError | None:
    """Return the finished record of a job, or why it failed, or None."""
    record = kept(folder, job.key, job.scene)
    if record is None and (reason := failed_before(folder, job.key)):
        return JobError(job, Before(reason))
    return record
