"""What became of each point of a sweep: one table, or a dataset with units."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.record import Record, analysis
from pyfric.scene import SceneError, written
from pyfric.sweeps.sweep import Job, JobError
from pyfric.sweeps.varied import units

if TYPE_CHECKING:
    import xarray as xr

    from pyfric.sweeps.points import Sweep

__all__ = ["MEASURED", "Before", "Results"]

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


class Before(Exception):
    """Why a run failed the last time, in its words."""


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
        before = isinstance(one.error, Before)
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
