"""A sweep: one scene, and the points at which some of its fields or options take other values.

    sweep = Sweep.from_toml("sweep.toml")
    print(sweep.estimate())
    results = sweep.run()
    results.table            # one row for each point
    results.to_xarray()      # the same with units, on the axes of a grid
    results.mean("n_precursors")  # over seeds, with standard errors
    sweep.measure().table    # numbers only: many quasi-static runs take little time

A file of a sweep (docs/sweeps.md) is TOML with the entries `ENTRIES`. Numbers are in SI, and text
has its unit.

"grid" takes all combinations. "list" takes the first values of all fields, then the second values,
and so on. The other kinds draw `n` points from ranges, with a `seed`. `scale = "log"` makes a range
even in its logarithm. `step` rounds drawn values to steps from the start of the range.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self, get_args

import numpy as np
import pandas as pd
import tomli_w

from pyfric.display import Shown
from pyfric.engines import Options
from pyfric.planning import check_run, expected_cost
from pyfric.record import Record
from pyfric.scene import PRESETS, Number, Scene, SceneLike, as_scene
from pyfric.sweeps.measures import Ensemble, measured
from pyfric.sweeps.results import Results
from pyfric.sweeps.runs import DEFAULTS, Job, JobError, run_all
from pyfric.sweeps.shared import measured as measured_at
from pyfric.sweeps.shared import sharing
from pyfric.sweeps.store import Cache, Store
from pyfric.sweeps.varied import MAX_POINTS, Span, drawn, full_field, varied
from pyfric.values import (
    Annotation,
    Quantity,
    SceneError,
    Written,
    check_number,
    check_whole,
    naming,
    parsed,
    unknown,
    usage,
)

ENTRIES = ("scene", "t_end", "points", "n", "seed", "over", "options", "limits")
LIMITS = ("max_hours", "max_GB")
NAMES = {"from": "start", "to": "stop", "step": "step"}
RANGE = (*NAMES, "n", "scale")
"""Names of the entries of the file of a sweep, of [limits], and of a range."""

Kind = Literal["grid", "list", "random", "sobol", "halton", "latin"]
ASKED = 5
"""Number of points from whose mean cost the cost of a sweep is estimated."""


class Estimate(NamedTuple):
    """Numbers of all, refused and finished points, and the cost of the other points."""

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


@dataclass(frozen=True, init=False, repr=False)
class Sweep(Shown):
    """One scene at many points.

    Args:
        scene: the varied scene. With the name of a preset, each point is `preset(name, values)`, so
            that values which the preset derives from l or L change with them. With a `Scene` or a
            file, only the fields in `over` change.
        t_end: time of the end, in s or as "300 ms".
        over: a mapping from names to lists of values, in SI or as "5 mm", or to a `Span`; or a
            DataFrame with a row for each point. Names are fields of a scene file ("driver.h", "h",
            "interface.mu_s.seed", "interface.law"), "t_end", or options ("options.tolerance").
        points: "grid", "list", "random", "sobol", "halton" or "latin"; see the module.
        n: number of points that are drawn.
        seed: seed of drawn points; the same seed gives the same points.
        options: options of all runs, as `Options` or a mapping. Planned runs share a verification
            (`Shared`) unless `verify` says otherwise.
        max_hours, max_GB: limits of the estimate, beyond which the sweep is refused; None means no
            limit.

    Raises:
        SceneError: an argument is refused.
    """

    scene: Scene | str
    t_end: float
    over: dict[str, list[Any] | Span]
    points: Kind
    n: int | None
    seed: int
    options: Options
    max_hours: float | None
    max_GB: float | None

    @usage('Sweep(scene, "1 s", {"mu_s": [0.6, 0.7], "h": ["5 mm", "10 mm"]})')
    def __init__(
        self,
        scene: SceneLike,
        t_end: Number,
        over: Mapping[str, Iterable[Any] | Span] | pd.DataFrame,
        *,
        points: Kind = "grid",
        n: int | None = None,
        seed: int = 0,
        options: Options | Mapping[str, Any] = DEFAULTS,
        max_hours: float | None = None,
        max_GB: float | None = None,
    ) -> None:
        first = Job(scene=scene, t_end=t_end, options=options)
        scene = scene if isinstance(scene, str) and scene in PRESETS else first.scene
        vars(self).update(scene=scene, t_end=first.t_end, options=first.options)
        points = "list" if isinstance(over, pd.DataFrame) else points
        if points not in get_args(Kind):
            raise unknown("points", points, str(points), get_args(Kind))
        vars(self).update(points=points, max_hours=max_hours, max_GB=max_GB)
        vars(self).update(over=self._listed(over))
        for name, limit in (("max_hours", max_hours), ("max_GB", max_GB)):
            if limit is not None:
                check_number(f"limits.{name}", limit, "", gt=0.0)
        vars(self).update(n=n, seed=check_whole("seed", seed, 0, MAX_POINTS))
        if self._drawn:
            vars(self).update(n=check_whole("n", n, 1, MAX_POINTS))
            return
        if n is not None:
            raise SceneError("n", n, "", f"none: points = {points!r} are not drawn at random")
        lengths = [len(values) for values in self.over.values()]
        if points == "list" and len(set(lengths)) > 1:
            raise SceneError("over", lengths, "", "as many values of each field in a list")
        if math.prod(lengths if points == "grid" else lengths[:1]) > MAX_POINTS:
            raise SceneError("over", lengths, "", f"at most {MAX_POINTS} points")

    def __repr__(self) -> str:
        fields = ", ".join(self.over)
        name = as_scene(self.scene).name or "a scene"
        return f"Sweep of {name} over {fields}: {self.points}, t_end = {self.t_end:g} s"

    @property
    def _drawn(self) -> bool:
        return self.points not in ("grid", "list")

    def _listed(self, over: Any) -> dict[str, list[Any] | Span]:
        """Return the fields by their full names, with lists of values, or ranges to draw from."""
        if not isinstance(over, Mapping | pd.DataFrame):
            allowed = "a mapping from names to values, or a DataFrame"
            raise SceneError("over", over, "", allowed)
        marks, listed = varied(self.scene), {}
        for given, values in dict(over).items():
            name = full_field(self.scene, given, values)
            if name in listed:
                raise SceneError(f"over.{given}", values, "", "each field once")
            if isinstance(values, Span):
                values = values.in_si(f"over.{name}", marks[name].unit)
                listed[name] = values if self._drawn else values.values(f"over.{name}")
                continue
            if self._drawn:
                allowed = f"a range, because points are {self.points}"
                raise SceneError(f"over.{name}", values, "", allowed)
            if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
                raise SceneError(f"over.{name}", values, "", "a list of values, or a range")
            listed[name] = [_as_in_scene(value, marks[name]) for value in values]
            if not listed[name]:
                raise SceneError(f"over.{name}", values, "", "at least one value")
            if self.points == "grid" and len({*map(repr, listed[name])}) < len(listed[name]):
                raise SceneError(f"over.{name}", values, "", "each value once in a grid")
        if not listed:
            raise SceneError("over", over, "", "at least one field with its values")
        return listed

    @functools.cached_property
    def rows(self) -> pd.DataFrame:
        """One row for each point: the values of its fields, in SI."""
        values = [*self.over.values()]
        if self._drawn:
            rows = drawn(values, self.points, self.n, self.seed)
        elif self.points == "grid":
            rows = itertools.product(*values)
        else:
            rows = zip(*values, strict=True)
        frame = pd.DataFrame([*map(list, rows)], columns=[*self.over], dtype=object)
        return frame.rename_axis("point")

    @functools.cached_property
    def jobs(self) -> tuple[Job | SceneError, ...]:
        """The job of each point, or the reason why it is refused."""
        return tuple(map(self.job, range(len(self.rows))))

    @functools.cached_property
    def _records(self) -> list[dict[str, Any]]:
        return self.rows.to_dict("records")

    def job(self, point: int) -> Job | SceneError:
        """Return the job of a point, counted from 0, or the reason why it is refused."""
        if "jobs" in self.__dict__:
            return self.jobs[point]
        values = dict(self._records[point])
        t_end = values.pop("t_end", self.t_end)
        names = [name for name in values if name.startswith("options.")]
        options = {name.removeprefix("options."): values.pop(name) for name in names}
        try:
            options = dataclasses.replace(self.options, **options) if options else self.options
            options = sharing(options)
            job = Job(scene=as_scene(self.scene, values), t_end=t_end, options=options)
            check_run(job.scene, job.options)
            return job
        except SceneError as error:
            return error

    # --- running ---------------------------------------------------------------------------------

    @property
    def in_order(self) -> list[Job]:
        """The jobs that are not refused, with most blocks first."""
        jobs = [job for job in self.jobs if isinstance(job, Job)]
        return sorted(jobs, key=lambda job: -job.scene.N_x * job.scene.N_z)

    def estimate(self, cache: Cache = True) -> Estimate:
        """Return the cost of the sweep, estimated from a few of its points."""
        outcomes = self.status(cache).outcomes
        finished = sum(isinstance(outcome, Record) for outcome in outcomes)
        refused = sum(isinstance(outcome, SceneError) for outcome in outcomes)
        pairs = zip(self.jobs, outcomes, strict=True)
        left = [job for job, found in pairs if not isinstance(found, Record | SceneError)]
        asked = left[:: math.ceil(len(left) / ASKED) or 1]
        share = measured_at(len(left)) / max(len(left), 1)
        costs = [_cost(job, share) for job in asked]
        seconds, size = np.mean(costs, axis=0) * len(left) if left else (0.0, 0.0)
        return Estimate(len(outcomes), refused, finished, seconds / 3600, size / 1e9)

    def status(self, cache: Cache = True) -> Results:
        """Return the results so far; points that have not been run are "waiting".

        Points that failed are "failed", with the reason; `run` tries them again.
        """
        store, outcomes = Store.at(cache), []
        for job in self.jobs:
            found = job if isinstance(job, SceneError) else store.load(job.key, job.scene)
            if found is None and (reason := store.failure(job.key)):
                found = JobError(job, reason)
            outcomes.append(found)
        return Results(self, tuple(outcomes))

    def run(self, cache: Cache = True, **how: Any) -> Results:
        """Run all points that are not finished, with most blocks first.

        Args:
            cache: as in `run_all`.
            **how: workers, progress and executor of `run_all`.

        Raises:
            SceneError: an argument is refused, or the estimate exceeds a limit.
            KeyboardInterrupt: after Ctrl-C; finished runs are kept, and the next call goes on.
        """
        if self.max_hours is not None or self.max_GB is not None:
            found = self.estimate(cache)
            for name, value in (("max_hours", found.hours), ("max_GB", found.GB)):
                limit = getattr(self, name)
                if limit is not None and value > limit:
                    allowed = f"at least {value:.2g}, which the sweep would take ({found})"
                    raise SceneError(f"limits.{name}", limit, "", allowed, "too little")
        jobs = self.in_order
        made = dict(zip(jobs, run_all(jobs, cache=cache, errors="return", **how), strict=True))
        return Results(self, tuple(made.get(job, job) for job in self.jobs))

    def measure(
        self,
        columns: Sequence[str] | None = None,
        *,
        events: Sequence[str] = (),
        cache: Cache = True,
        threads: int | None = None,
        progress: bool | Callable[[int, int], None] | None = None,
        **how: Any,
    ) -> Ensemble:
        """Return numbers of the runs of all points in one table.

        Quasi-static sequences without conditions for their end run in the core, many at a time.
        Other runs are made as in `run`.

        Args:
            columns: numbers of each run, names in `pyfric.RUN_COLUMNS`; None means all.
            events: columns of events, for a table of the events of all runs.
            cache: as in `run_all`. For sequences in the core, parts of the table are stored.
            threads: largest number of threads of the core; results do not depend on it.
            progress: as in `run_all`.
            **how: workers and executor of `run_all`, for other runs.

        Raises:
            SceneError: an argument is refused.
            KeyboardInterrupt: after Ctrl-C; finished parts are kept, and the next call goes on.
        """
        return measured(self, columns, events, cache, threads, progress, how)

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Self:
        """Return the sweep that a file describes.

        Raises:
            SceneError: the file cannot be read, or a value is refused.
        """
        if not isinstance(path, str | os.PathLike):
            raise SceneError("sweep", path, "", "the path of a sweep file")
        return cls(**_read(Path(path)))


def _cost(job: Job, share: float) -> np.ndarray:
    """Return the expected time (s) and size (bytes) of a job, if a share of jobs is verified."""
    whole = np.array(expected_cost(job.scene, job.t_end, job.options))
    if job.options.verify != "shared":
        return whole
    options = dataclasses.replace(job.options, verify="none")
    single = np.array(expected_cost(job.scene, job.t_end, options))
    return share * whole + (1 - share) * single


def _as_in_scene(value: Any, mark: Annotation) -> Any:
    """Return a value as the scene stores it; a refused value is returned unchanged."""
    value = value.item() if isinstance(value, np.generic) else value
    try:
        return mark.check(value)
    except SceneError:
        return value


# --- files ---------------------------------------------------------------------------------------


def _read(path: Path) -> dict[str, Any]:
    """Return the arguments of the `Sweep` that a file describes.

    Raises:
        SceneError: the file cannot be read, or a value is refused.
    """
    document, folder = parsed(path, "sweep")
    if "slider" in document:
        allowed = f'a file with scene = "{path.name}", t_end = "1 s" and [over] mu_s = [0.6, 0.7]'
        raise SceneError("sweep", str(path), "", allowed, "this is a scene")
    _check_keys("", document, ENTRIES)
    for key in ("scene", "t_end", "over"):
        if key not in document:
            raise SceneError(key, None, "", "an entry of a sweep", "missing")
    for key in ("over", "options", "limits"):
        if not isinstance(table := document.setdefault(key, {}), dict):
            raise SceneError(key, table, "", f"a table [{key}]", "not a table")
    limits, scene = document.pop("limits"), document["scene"]
    _check_keys("limits.", limits, LIMITS)
    if isinstance(scene, str):
        scene = scene if scene in PRESETS else Scene.from_toml(folder / scene)
    elif isinstance(scene, dict):
        scene = Scene.from_toml(tomli_w.dumps(scene) + "\n", files=folder)
    else:
        raise SceneError("scene", scene, "", "a preset, a scene file or a table [scene]")
    free = {"gt": None, "ge": None, "le": None}  # a value out of range is refused at its point
    marks = {
        name: dataclasses.replace(mark, **free) if isinstance(mark, Quantity) else mark
        for name, mark in varied(scene).items()
    }

    def read(name: str, value: Any, field: str = "") -> Any:
        """Return a value of the file, in SI."""
        if name not in marks or value == "auto":
            return value  # an unknown name is refused later
        with naming(field or name):
            return marks[name].check(value, Written(value, folder))

    given = {
        "scene": scene,
        "t_end": read("t_end", document["t_end"]),
        "over": _over(document["over"], scene, read),
        "options": {key: read(f"options.{key}", v) for key, v in document["options"].items()},
    }
    return document | limits | given


def _check_keys(prefix: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key, value in table.items():
        if key not in known:
            raise unknown(prefix + key, value, key, known)


def _over(table: Mapping[str, Any], scene: SceneLike, read: Callable[..., Any]) -> dict[str, Any]:
    """Return the varied lists of values and ranges, in SI; `Sweep` refuses anything else."""
    over = _flat(table)
    for given, value in over.items():
        name = full_field(scene, given, value)
        field = f"over.{name}"
        if isinstance(value, list):
            over[given] = [read(name, entry, field) for entry in value]
        elif isinstance(value, dict) and {"from", "to"} <= set(value):
            _check_keys(f"{field}.", value, RANGE)
            ends = {key: read(name, value[key], f"{field}.{key}") for key in NAMES if key in value}
            try:
                over[given] = Span(**{NAMES.get(k, k): v for k, v in (value | ends).items()})
            except SceneError as error:
                entry = {"start": "from", "stop": "to"}.get(error.field, error.field)
                raise error.at(f"{field}.{entry}") from None
    return over


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by their dotted names."""
    found = {}
    for key, value in table.items():
        inner = isinstance(value, dict) and "from" not in value
        found |= _flat(value, f"{prefix}{key}.") if inner else {prefix + key: value}
    return found
