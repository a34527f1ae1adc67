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
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self, get_args

import numpy as np
import pandas as pd
from scipy.stats import qmc

from pyfric.engines.options import NUMBERS, Options, step_size
from pyfric.engines.planner import _cost, _scout, plan
from pyfric.engines.store import cache_folder, failed_before, kept
from pyfric.engines.sweep import ELSEWHERE, Job, JobError, run_all
from pyfric.record import Record, analysis
from pyfric.scene import (
    PRESETS,
    Scene,
    SceneError,
    check_number,
    default_geometry,
    parse_quantity,
    preset,
    quantities,
    unknown,
    written,
)

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Estimate", "Results", "Span", "Sweep"]

Kind = Literal["grid", "list", "random", "sobol", "halton", "latin"]
DRAWN: Mapping[str, Callable[..., Any]] = {
    "sobol": qmc.Sobol,
    "halton": qmc.Halton,
    "latin": qmc.LatinHypercube,
}
PARTS = ("slider", "top", "driver", "interface")
MOST_POINTS = 1_000_000
ASKED = 5
"""The cost of a sweep is that of so many of its points, on average."""
MEASURED = {
    "events": ("1", "number of events"),
    "main_events": ("1", "number of events of at least 4 blocks"),
    "precursors": ("1", "number of precursors before the first system-size event"),
    "F_first": ("N", "static force at which the first main event starts"),
    "F_max": ("N", "largest force of the loading curve"),
    "L_p_max": ("1", "longest precursor before the first system-size event, over L"),
    "t_slide": ("s", "start of the first system-size event"),
    "seconds": ("s", "processor time of the run"),
}
"""Column -> unit and meaning."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """A range of a number: n values in a grid or list, or where points are drawn.

    Args:
        start, stop: its ends, in SI.
        n: number of values in a grid or list, ends included.
        step: distance of the values; drawn ones are rounded to it.
        scale: "linear" or "log".
    """

    start: float
    stop: float
    n: int | None = None
    step: float | None = None
    scale: Literal["linear", "log"] = "linear"

    def values(self, name: str) -> list[float]:
        """Return the values in a grid or list."""
        if self.step is not None:
            count = math.floor((self.stop - self.start) / self.step * (1 + 1e-12)) + 1
        elif self.n is not None:
            count = self.n
        else:
            raise SceneError(name, None, "", "a range with n or step", "how many values?")
        if count > MOST_POINTS:
            raise SceneError(name, count, "", f"at most {MOST_POINTS} values")
        if self.step is not None:
            return [_short(self.start + i * self.step) for i in range(count)]
        return [self.at(share) for share in np.linspace(0.0, 1.0, count)]

    def at(self, share: float) -> float:
        """Return the value at a share of the range, 0 to 1."""
        if self.scale == "log":
            value = self.start * (self.stop / self.start) ** share
        else:
            value = self.start + share * (self.stop - self.start)
        if self.step is not None:
            value = self.start + round((value - self.start) / self.step) * self.step
        return _short(value)


def _short(value: float) -> float:
    """Return a number without the rounding of its last digits: 3 mm, not 3.0000000000000001 mm."""
    return float(f"{float(value):.12g}")


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
        drawn = DRAWN[self.points](fields, seed=rng)
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
            costs = np.array([_expected(job) for job in asked])
            seconds, size = costs.mean(axis=0) * len(left)
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
        document = _document(Path(path))
        known = ("scene", "t_end", "points", "n", "seed", "over", "options", "limits")
        for key, value in document.items():
            if key not in known:
                raise unknown(key, value, key, known)
        for key in ("scene", "t_end", "over"):
            if key not in document:
                raise SceneError(key, None, "", "an entry of a sweep", "missing")
        tables = {key: _table(document, key) for key in ("over", "options", "limits")}
        scene = _scene(document["scene"], Path(path).parent)
        unit_of = units(scene)
        over = {}
        for name, value in _flat(tables["over"]).items():
            if name not in unit_of:
                raise unknown(f"over.{name}", value, name, unit_of)
            over[name] = _read(name, value, unit_of[name])
        options = {
            key: _si(f"options.{key}", value, NUMBERS[key][0] if key in NUMBERS else None)
            for key, value in tables["options"].items()
        }
        for key, value in tables["limits"].items():
            if key not in ("max_hours", "max_GB"):
                raise unknown(f"limits.{key}", value, key, ("max_hours", "max_GB"))
        return cls(
            scene=scene,
            t_end=_si("t_end", document["t_end"], "s"),
            over=over,
            options=options,
            **{key: document[key] for key in ("points", "n", "seed") if key in document},
            **tables["limits"],
        )


class _Before(Exception):
    """Why a run failed the last time, in its words."""


def _found(folder: Path, job: Job) -> Record | JobError | None:
    """Return the finished record of a job, or why it failed, or None."""
    record = kept(folder, job.key, job.scene)
    if record is None and (reason := failed_before(folder, job.key)):
        return JobError(job, _Before(reason))
    return record


def units(scene: Scene) -> dict[str, str | None]:
    """Return the fields that may vary, with their SI units; None for those that are no numbers."""
    found: dict[str, str | None] = {"t_end": "s"}
    for name in PARTS:
        part = getattr(scene, name)
        marks = quantities(type(part))
        for one in dataclasses.fields(part):
            found[f"{name}.{one.name}"] = marks[one.name].unit if one.name in marks else None
    for one in dataclasses.fields(Options):
        if one.name not in ELSEWHERE:
            found[f"options.{one.name}"] = NUMBERS[one.name][0] if one.name in NUMBERS else None
    return found


def _expected(job: Job) -> tuple[float, float]:
    """Return the expected time of a run in s, and the size of its record in bytes."""
    scene, t_end, how = job.scene, job.t_end, job.options
    scout = _scout(scene, t_end)
    size = 8.0 * scout.events * (9 * scene.N_x + 40) + 1e5
    if how.fidelity == "auto":
        return plan(scene, how.want, how.tolerance, t_end=t_end).seconds, size
    if how.fidelity in ("quasistatic", "equilibrium"):
        return scout.seconds * (1 + scout.far), size
    geometry = how.geometry or default_geometry(scene)
    dt = step_size(scene, how.dt, how.stepper)
    return _cost(scene, t_end, scout, how.fidelity, geometry, dt)[1], size


# --- reading -------------------------------------------------------------------------------------


def _document(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        reason = f"cannot be read ({error.strerror})"
        raise SceneError("sweep", str(path), "", "a readable sweep file", reason) from None
    except (ValueError, RecursionError) as error:
        raise SceneError("sweep", str(path), "", "a TOML document", f"not TOML ({error})") from None


def _table(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise SceneError(key, table, "", f"a table [{key}]", "not a table")
    return table


def _scene(given: Any, folder: Path) -> Scene:
    if isinstance(given, str) and given in PRESETS:
        return preset(given)
    if isinstance(given, str):
        return Scene.from_toml(folder / given)
    if isinstance(given, dict):
        import tomli_w

        return Scene.from_toml(tomli_w.dumps(given) + "\n")
    raise SceneError("scene", given, "", "a preset, a scene file or a table [scene]")


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by their dotted names."""
    found = {}
    for key, value in table.items():
        inner = isinstance(value, dict) and "from" not in value
        found |= _flat(value, f"{prefix}{key}.") if inner else {prefix + key: value}
    return found


def _read(name: str, value: Any, unit: str | None) -> list[Any] | Span:
    name = f"over.{name}"
    if isinstance(value, list):
        return [_si(name, one, unit) for one in value]
    if not isinstance(value, dict):
        raise SceneError(name, value, "", "a list of values, or a range with from and to")
    known = ("from", "to", "n", "step", "scale")
    for key in value:
        if key not in known:
            raise unknown(f"{name}.{key}", value[key], key, known)
    if unit is None or "to" not in value:
        raise SceneError(name, value, "", "a list" if unit is None else "a range with from and to")
    lengths = {
        key: _si(f"{name}.{key}", value[key], unit)
        for key in ("from", "to", "step")
        if key in value
    }
    rest = {key: value[key] for key in ("n", "scale") if key in value}
    return Span(start=lengths["from"], stop=lengths["to"], step=lengths.get("step"), **rest)


def _si(name: str, value: Any, unit: str | None) -> Any:
    """Return a value of the file, as a number in SI where it has a unit."""
    if unit and not (name.endswith("options.dt") and value == "auto"):
        return parse_quantity(name, value, unit)
    return check_number(name, value, "") if unit == "" else value


# --- results -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Results:
    """What became of each point of a sweep: its record, or why there is none.

    Attributes:
        sweep: the sweep.
        outcomes: for each point a `Record`, a `JobError`, the `SceneError` of one that is refused,
            or None for one that waits.
    """

    sweep: Sweep
    outcomes: tuple[Record | JobError | SceneError | None, ...]

    @property
    def table(self) -> pd.DataFrame:
        """One row for each point: its fields, status, reason, key, engine, and `MEASURED`."""
        rows = []
        jobs = self.sweep.jobs()
        for values, job, one in zip(self.sweep.at(), jobs, self.outcomes, strict=True):
            row = dict(values) | _said(one)
            row["key"] = job.key if isinstance(job, Job) else ""
            rows.append(row | _measured(one if isinstance(one, Record) else None))
        return pd.DataFrame(rows).rename_axis("point")

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of points that failed or were refused."""
        table = self.table
        return table[table["status"].isin(("failed", "refused"))]

    @property
    def done(self) -> bool:
        """Whether all points are complete."""
        return all(isinstance(one, Record) for one in self.outcomes)

    def to_xarray(self) -> xr.Dataset:
        """The table as a dataset with units: on the axes of a grid, or else on "point"."""
        import xarray as xr  # slow to import

        table, names = self.table, list(self.sweep.over)
        unit_of = units(self.sweep.scene)
        if self.sweep.points == "grid":
            dims, axes = names, self.sweep._values()
            coordinates = {name: (name, axes[name]) for name in names}
            shape = tuple(len(axes[name]) for name in names)
        else:
            dims, shape = ["point"], (len(table),)
            coordinates = {name: ("point", table[name].to_numpy()) for name in names}
        data = {
            name: (dims, _plain(column).reshape(shape))
            for name, column in table.items()
            if name not in names
        }
        dataset = xr.Dataset(data, coordinates, {"title": "pyfric sweep"})
        for name in names:
            dataset[name].attrs["units"] = unit_of[name] or "1"
        for name, (unit, meaning) in MEASURED.items():
            dataset[name].attrs.update(units=unit, long_name=meaning)
        return dataset

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write sweep.csv, sweep.nc and, with pyarrow, sweep.parquet; return their paths.

        Raises:
            OSError: a file cannot be written.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = [folder / "sweep.csv", folder / "sweep.nc"]
        with written(paths[0]) as draft:
            self.table.to_csv(draft)
        with written(paths[1]) as draft:
            draft.write_bytes(self.to_xarray().to_netcdf(engine="h5netcdf"))
        try:
            import pyarrow  # noqa: F401
        except ImportError:
            return paths
        paths.append(folder / "sweep.parquet")
        with written(paths[2]) as draft:
            self.table.to_parquet(draft)
        return paths


def _plain(column: pd.Series) -> np.ndarray:
    values = column.to_numpy()
    return values if values.dtype.kind in "fi" else np.array([str(one) for one in values])


def _said(one: Any) -> dict[str, str]:
    """Return status and reason of an outcome, and the engine of a record."""
    if isinstance(one, Record):
        engine = f"{one.method.engine}, {one.method.geometry}"
        return {"status": one.status, "reason": "", "engine": engine}
    if one is None:
        return {"status": "waiting", "reason": "", "engine": ""}
    if isinstance(one, JobError):
        before = isinstance(one.error, _Before)
        reason = str(one.error) if before else f"{type(one.error).__name__}: {one.error}"
        return {"status": "failed", "reason": reason, "engine": ""}
    return {"status": "refused", "reason": str(one), "engine": ""}


def _measured(record: Record | None) -> dict[str, float]:
    if record is None:
        return dict.fromkeys(MEASURED, math.nan)
    main = record.events[record.events["is_main"]]
    lengths, sliding = analysis.precursor_lengths(record), analysis.system_size_events(record)
    return {
        "events": float(len(record.events)),
        "main_events": float(len(main)),
        "precursors": float(len(lengths)),
        "F_first": float(main["F_T_start"].iloc[0]) if len(main) else math.nan,
        "F_max": float(record.curve["F_T"].max()),
        "L_p_max": float(lengths["L_p_over_L"].max()),
        "t_slide": float(sliding["t_start"].iloc[0]) if len(sliding) else math.nan,
        "seconds": float(record.timings.get("processor", math.nan)),
    }
