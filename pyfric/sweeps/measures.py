"""Numbers of many runs in one table, which is stored in parts.

Quasi-static sequences run in the core, many at a time (`pyfric.engines.together`). The results
equal the results of single runs, bit for bit. Runs of other engines are made as in `Sweep.run`.
`pyfric.record.outlines` defines the numbers of a run.

The table of sequences in the core is stored in parts of `PART` runs. The name of a part is a hash
of all that determines it. An ensemble that was stopped therefore goes on, and a larger ensemble
reuses the parts of a smaller one.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from pyfric.display import html, jobs_bar
from pyfric.engines import Asked, Options, has_outline, outlines
from pyfric.planning import simulate
from pyfric.record import EVENT_COLUMNS, RUN_COLUMNS, Outline, Record
from pyfric.scene import Scene, SceneLike, Spread, as_scene
from pyfric.sweeps.runs import Job, JobError, code_version, run_all
from pyfric.sweeps.store import MAX_BYTES, Cache, Store
from pyfric.values import SceneError, check_whole, unknown, write_all

PART = 256
"""Number of runs in a stored part, which take about a second in the Fig. 1 scene (a choice)."""
STATISTICS = ("mean", "standard_error", "std", "5 %", "median", "95 %", "n")
PLAIN = (bool, int, float, str, type(None))
Row = dict[str, Any]


class Points(Protocol):
    """The attributes of a `Sweep` that an `Ensemble` uses."""

    @property
    def scene(self) -> SceneLike: ...
    @property
    def t_end(self) -> float: ...
    @property
    def options(self) -> Options: ...
    @property
    def over(self) -> Mapping[str, Any]: ...
    @property
    def rows(self) -> pd.DataFrame: ...
    @property
    def jobs(self) -> tuple[Job | SceneError, ...]: ...
    @property
    def in_order(self) -> list[Job]: ...
    def job(self, point: int) -> Job | SceneError: ...


@dataclass(frozen=True)
class Ensemble:
    """Numbers of many runs.

    Attributes:
        sweep: the points.
        table: a row for each run: the varied values (of a `Spread` its seed), status, reason, and
            the requested numbers, in SI. A number that a run lacks is NaN.
        events: a row for each event of all runs: the label of the run, and the requested columns of
            events. None if no columns were requested.
    """

    sweep: Points
    table: pd.DataFrame
    events: pd.DataFrame | None = None

    def __repr__(self) -> str:
        counts = self.table["status"].value_counts().to_dict()
        said = ", ".join(f"{count} {name}" for name, count in counts.items())
        return f"Ensemble of {len(self.table)} runs: {said}\n{self.statistics().to_string()}"

    _repr_html_ = html

    @property
    def columns(self) -> list[str]:
        """Names of the requested numbers."""
        return [name for name in self.table if name in RUN_COLUMNS]

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of runs that failed or were refused."""
        return self.table[self.table["status"].isin(("failed", "refused"))]

    def statistics(self, *columns: str) -> pd.DataFrame:
        """Return statistics of numbers over all runs.

        Args:
            columns: names of numbers; none means all.

        Returns:
            A row for each number. Columns: mean; standard_error of the mean, std/sqrt(n); std, with
            n - 1; "5 %", median and "95 %", quantiles; n, the number of runs that have this number.
            NaN means too few runs.

        Raises:
            SceneError: the table has no number of a given name.
        """
        for name in columns:
            if name not in self.columns:
                raise unknown("column", name, str(name), self.columns)
        chosen = self.table[list(columns or self.columns)]
        quantiles = chosen.quantile([0.05, 0.5, 0.95])
        rows = [chosen.mean(), chosen.sem(), chosen.std(), *quantiles.to_numpy(), chosen.count()]
        return pd.DataFrame([*map(np.asarray, rows)], STATISTICS, chosen.columns).T

    def record(self, label: Any) -> Record:
        """Return the run of a row of the table as a record. Labels of an ensemble are its seeds.

        Raises:
            SceneError: the table has no row with this label, or the run is refused.
        """
        if label not in self.table.index:
            allowed = f"a label of the table, {self.table.index[0]!r} to {self.table.index[-1]!r}"
            raise SceneError(str(self.table.index.name), label, "", allowed, "no such run")
        job = self.sweep.job(int(self.table.index.get_loc(label)))
        if isinstance(job, SceneError):
            raise job
        return simulate(job.scene, job.t_end, job.options, progress=False)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write runs.csv, and events.csv if there are events; return paths.

        Raises:
            OSError: a file cannot be written.
        """
        folder = Path(os.path.expanduser(folder))
        folder.mkdir(parents=True, exist_ok=True)
        files = {folder / "runs.csv": self.table.to_csv().encode()}
        if self.events is not None:
            files[folder / "events.csv"] = self.events.to_csv(index=False).encode()
        return write_all(files)


# --- numbers of a sweep --------------------------------------------------------------------------


def measured(
    sweep: Points,
    columns: Sequence[str] | None,
    events: Sequence[str],
    cache: Cache,
    threads: int | None,
    progress: bool | Callable[[int, int], None] | None,
    how: Mapping[str, Any],
) -> Ensemble:
    """Return numbers of all points of a sweep; see `Sweep.measure`."""
    columns = _names("columns", [*RUN_COLUMNS] if columns is None else columns, RUN_COLUMNS)
    events = _names("events", events, EVENT_COLUMNS)
    if threads is not None:
        check_whole("threads", threads, 1)
    count = len(sweep.rows)
    if in_core(sweep):
        parts = _parts(sweep, columns, events, Store.at(cache), threads, progress)
        rows = [row for part in parts for row in part]
    else:
        jobs = sweep.in_order
        made = dict(
            zip(
                jobs,
                run_all(jobs, cache=cache, errors="return", progress=progress, **how),
                strict=True,
            )
        )
        outcomes = (made.get(job, job) for job in sweep.jobs)
        rows = [_row(_outlined(outcome), columns, events) for outcome in outcomes]
    table = pd.DataFrame(
        {
            **_varied(sweep),
            "status": [row["status"] for row in rows],
            "reason": [row["reason"] for row in rows],
            **{name: [row["numbers"][k] for row in rows] for k, name in enumerate(columns)},
        },
        index=sweep.rows.index,
    )
    if not events:
        return Ensemble(sweep, table)
    lengths = [len(row["events"][0]) for row in rows]
    of_all = {"point": np.repeat(np.arange(count), lengths)}
    for k, name in enumerate(events):
        of_all[name] = np.concatenate([row["events"][k] for row in rows])
    return Ensemble(sweep, table, pd.DataFrame(of_all))


def in_core(sweep: Points) -> bool:
    """Return whether the core can run all points of a sweep."""
    varied = any(name.startswith(("options.", "stop_when")) for name in sweep.over)
    return has_outline(as_scene(sweep.scene), sweep.options) and not varied


def _names(name: str, given: Sequence[str], known: Any) -> tuple[str, ...]:
    """Return the given names, each once, after a check that they are known."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise SceneError(name, given, "", f"a list of names, of {', '.join(known)}")
    for asked in given:
        if asked not in known:
            raise unknown(name, asked, str(asked), [*known])
    return tuple(dict.fromkeys(given))


def _parts(
    sweep: Points,
    columns: tuple[str, ...],
    events: tuple[str, ...],
    store: Store,
    threads: int | None,
    progress: bool | Callable[[int, int], None] | None,
) -> Iterator[list[Row]]:
    """Yield the rows of a table part by part; missing parts are made and stored."""
    count, about = len(sweep.rows), _about(sweep, columns, events)
    spans = [range(i, min(i + PART, count)) for i in range(0, count, PART)]
    keys = [_key(sweep, about, span) for span in spans]
    known = {key: store.load_table(key) for key in keys}
    todo = [n for key, span in zip(keys, spans, strict=True) if known[key] is None for n in span]
    done = count - len(todo)
    with jobs_bar(progress, count) as show:
        show(done, count)
        made = _made(sweep, todo, threads)
        for key, span in zip(keys, spans, strict=True):
            kept = known.pop(key)
            if kept is not None:
                yield _unpacked(kept, len(span), events)
                continue
            part = []
            for _ in span:
                part.append(_row(next(made), columns, events))
                done += 1
                show(done, count)
            store.save_table(key, _packed(part, events))
            yield part
        if todo:
            store.prune(MAX_BYTES if store.own else None)


def _made(sweep: Points, points: Sequence[int], threads: int | None) -> Iterator[Any]:
    """Yield the outline of the run of each point, or the error of a refused point."""
    t_gap = sweep.options.t_gap

    def asked(n: int) -> Asked | Exception:
        job = sweep.job(n)
        return Asked(job.scene, job.t_end, t_gap) if isinstance(job, Job) else job

    yield from outlines(map(asked, points), threads)


def _row(outcome: Outline | Exception, columns: tuple[str, ...], events: tuple[str, ...]) -> Row:
    """Return status, reason, and the requested numbers and events of a run."""
    if isinstance(outcome, Exception):
        status = "refused" if isinstance(outcome, SceneError) else "failed"
        nothing = [np.zeros(0) for _ in events]
        reason = outcome.reason if isinstance(outcome, JobError) else str(outcome)
        return {"status": status, "reason": reason} | {
            "numbers": np.full(len(columns), np.nan),
            "events": nothing,
        }
    return {
        "status": outcome.status,
        "reason": "",
        "numbers": np.array([outcome[name] for name in columns]),
        "events": [np.asarray(outcome.events[name]) for name in events],
    }


def _outlined(outcome: Record | Exception) -> Outline | Exception:
    return Outline.of_record(outcome) if isinstance(outcome, Record) else outcome


def _varied(sweep: Points) -> dict[str, Any]:
    """Return the varied values by name; for drawn fields, their seeds."""
    found: dict[str, Any] = {}
    for name, column in sweep.rows.infer_objects().items():
        drawn_ = [isinstance(value, Spread) for value in column]
        if all(drawn_):
            found[f"{name}.seed"] = [value.seed for value in column]
        else:
            found[str(name)] = column
    return found


# --- parts of a table ----------------------------------------------------------------------------


def _about(sweep: Points, columns: tuple[str, ...], events: tuple[str, ...]) -> list[Any]:
    """Return everything that determines all parts of a table."""
    scene = sweep.scene
    if isinstance(scene, Scene):
        scene = dataclasses.replace(scene, name="").to_toml()
    t_gap = sweep.options.t_gap
    return [scene, sweep.t_end, t_gap, columns, events, PART, code_version()]


def _key(sweep: Points, about: list[Any], points: Sequence[int]) -> str:
    """Return the hash of all that determines a part of a table."""
    rows = sweep.rows.iloc[points[0] : points[-1] + 1].to_dict("records")
    varied = [_said(sweep, n, row) for n, row in zip(points, rows, strict=True)]
    content = json.dumps([about, varied], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:40]


def _said(sweep: Points, n: int, row: Mapping[Any, Any]) -> Any:
    """Return the values of a point as lists for JSON; the hash of its run for other values."""
    if all(isinstance(value, PLAIN) for value in row.values()):
        return [[str(name), value] for name, value in row.items()]
    if all(isinstance(value, (Spread, *PLAIN)) for value in row.values()):
        return [[str(k), vars(v) if isinstance(v, Spread) else v] for k, v in row.items()]
    job = sweep.job(n)
    return job.key if isinstance(job, Job) else str(job)


def _packed(part: Sequence[Row], events: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return a part of a table as arrays by name."""
    found = {
        "status": np.array([row["status"] for row in part]),
        "reason": np.array([row["reason"] for row in part]),
        "numbers": np.array([row["numbers"] for row in part]),
        "lengths": np.array([len(row["events"][0]) if events else 0 for row in part]),
    }
    for k, name in enumerate(events):
        found[f"event_{name}"] = np.concatenate([row["events"][k] for row in part])
    return found


def _unpacked(kept: Mapping[str, np.ndarray], count: int, events: tuple[str, ...]) -> list[Row]:
    """Return the rows of a part of a table from its arrays."""
    ends = np.cumsum(kept["lengths"])[:-1]
    of_events = [np.split(kept[f"event_{name}"], ends) for name in events]
    return [
        {
            "status": str(kept["status"][n]),
            "reason": str(kept["reason"][n]),
            "numbers": kept["numbers"][n],
            "events": [column[n] for column in of_events],
        }
        for n in range(count)
    ]
