"""Results of a sweep: one table, or a dataset with units."""

from __future__ import annotations

import io
import math
import os
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pandas as pd

from pyfric.display import Shown
from pyfric.record import RUN_COLUMNS, Outline, Record
from pyfric.sweeps.runs import Job, JobError
from pyfric.sweeps.shared import Shared
from pyfric.sweeps.varied import varied
from pyfric.values import SceneError, check_folder_name, unknown, write_all

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from pyfric.scene import Scene

OF_RUNS = ("n_events", "n_main_events", "n_precursors", "F_first", "F_max", "L_p_max", "t_slide")
"""Numbers of runs that are columns of the table."""
MEASURED = {
    **{name: RUN_COLUMNS[name][:2] for name in OF_RUNS},
    "error": ("1", "measured error that the tolerance bounds; NaN where it was not measured"),
    "seconds": ("s", "processor time of the run"),
}
"""Column -> unit and meaning."""


class Points(Protocol):
    """The attributes of a `Sweep` that `Results` uses."""

    @property
    def scene(self) -> Scene: ...
    @property
    def over(self) -> Mapping[str, Any]: ...
    @property
    def points(self) -> str: ...
    @property
    def rows(self) -> pd.DataFrame: ...
    @property
    def jobs(self) -> tuple[Job | SceneError, ...]: ...


@dataclass(frozen=True, repr=False)
class Results(Shown):
    """The results of a sweep: for each point its record, or the reason why there is none.

    Attributes:
        sweep: the `Sweep`.
        outcomes: for each point a `Record`; a `JobError` if it failed; a `SceneError` if it was
            refused; or None if it has not been run.
    """

    sweep: Points
    outcomes: tuple[Record | JobError | SceneError | None, ...]

    def __repr__(self) -> str:
        table = self.table.to_string(max_rows=20, max_cols=8)
        return f"Results of {len(self.outcomes)} points\n{table}"

    @property
    def table(self) -> pd.DataFrame:
        """One row for each point: its fields, status, reason, engine, level, key, `MEASURED`."""
        keys = [job.key if isinstance(job, Job) else "" for job in self.sweep.jobs]
        rows = [
            {**_status(outcome), "key": key, **_measured(outcome)}
            for outcome, key in zip(self.outcomes, keys, strict=True)
        ]
        table = pd.DataFrame(rows, index=self.sweep.rows.index)
        return pd.concat([self.sweep.rows.infer_objects(), table], axis=1)

    @property
    def report(self) -> str:
        """Number of points at each level, and measured errors, if points share a verification."""
        jobs, found = {job.key: job for job in self.sweep.in_order}, {}
        for job, outcome in zip(self.sweep.jobs, self.outcomes, strict=True):
            if isinstance(job, Job):
                found[job.key] = outcome
        shared = Shared()
        for _ in shared.stages(jobs, found):
            pass
        return str(shared)

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of points that failed or were refused."""
        table = self.table
        return table[table["status"].isin(("failed", "refused"))]

    def mean(self, column: str) -> pd.DataFrame:
        """Return the mean of a column of `MEASURED` over finished points that differ in seeds only.

        Args:
            column: the column. Points at which the column is NaN do not count.

        Returns:
            One row for each set of values of the fields that do not end in ".seed". Columns: these
            fields; ``mean``; its ``standard_error``, the standard deviation of the column (n - 1)
            over sqrt(n), NaN for one point; and ``n``, the number of points.

        Raises:
            SceneError: `MEASURED` has no such column, or no field is a seed.
        """
        if column not in MEASURED:
            raise unknown("column", column, str(column), MEASURED)
        table, fields = self.table, list(self.sweep.over)
        kept = [name for name in fields if not name.endswith(".seed")]
        if kept == fields:
            raise SceneError("over", fields, "", "a field that ends in .seed", "no field is a seed")
        groups = table.groupby(kept or np.zeros(len(table)), sort=False, dropna=False)[column]
        found = groups.agg(["mean", "sem", "count"]).set_axis(
            ["mean", "standard_error", "n"], axis=1
        )
        return found.reset_index(drop=not kept)

    def to_xarray(self) -> xr.Dataset:
        """The table as a dataset with units, on the axes of a grid or on the axis "point".

        The conversion needs the package xarray.
        """
        import xarray as xr  # slow to import

        table, names = self.table, list(self.sweep.over)
        marks = varied(self.sweep.scene)
        if self.sweep.points == "grid":
            dims, axes = names, self.sweep.over
            coordinates = {name: (name, _plain(pd.Series(axes[name]))) for name in names}
            shape = tuple(len(axes[name]) for name in names)
        else:
            dims, shape = ["point"], (len(table),)
            coordinates = {name: ("point", _plain(table[name])) for name in names}
        data = {
            name: (dims, _plain(column).reshape(shape))
            for name, column in table.items()
            if name not in names
        }
        dataset = xr.Dataset(data, coordinates, {"title": "pyfric sweep"})
        for name in names:
            dataset[name].attrs["units"] = marks[name].unit or "1"
        for name, (unit, meaning) in MEASURED.items():
            dataset[name].attrs.update(units=unit, long_name=meaning)
        return dataset

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write sweep.csv, with h5netcdf also sweep.nc, with pyarrow sweep.parquet; return paths.

        Raises:
            OSError: a file cannot be written.
            SceneError: the name ends in the suffix of a file.
        """
        folder = Path(os.path.expanduser(folder))
        check_folder_name(folder)
        folder.mkdir(parents=True, exist_ok=True)
        files = {folder / "sweep.csv": self.table.to_csv().encode()}
        if find_spec("h5netcdf") is not None:  # comes with xarray
            files[folder / "sweep.nc"] = _netcdf(self.to_xarray())
        if find_spec("pyarrow") is not None:
            plain = {name: _plain(column) for name, column in self.table.items()}
            frame = pd.DataFrame(plain, index=self.table.index)
            files[folder / "sweep.parquet"] = frame.to_parquet()
        return write_all(files)


def _netcdf(dataset: xr.Dataset) -> bytes:
    """Return a dataset as the bytes of a netCDF 4 file, made in memory because HDF5 locks files."""
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    image = io.BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(H5NetCDFStore(file))
    return image.getvalue()


def _plain(column: pd.Series) -> np.ndarray:
    """Return a column as numbers, or as text."""
    values = column.infer_objects().to_numpy()
    return values if values.dtype.kind in "fi" else np.array([str(value) for value in values])


def _status(outcome: Any) -> dict[str, str]:
    """Return status and reason of an outcome, and engine and level of a record."""
    found = dict.fromkeys(("status", "reason", "engine", "level"), "")
    if isinstance(outcome, Record):
        engine = f"{outcome.method.engine}, {outcome.method.geometry}"
        return found | {
            "status": outcome.status,
            "engine": engine,
            "level": str(outcome.method.model),
        }
    if outcome is None:
        return found | {"status": "waiting"}
    if isinstance(outcome, JobError):
        return found | {"status": "failed", "reason": outcome.reason}
    return found | {"status": "refused", "reason": str(outcome)}


def _measured(outcome: Any) -> dict[str, float]:
    if not isinstance(outcome, Record):
        return dict.fromkeys(MEASURED, math.nan)
    error, outline = outcome.errors, Outline.of_record(outcome)
    error = None if error is None else error.measured()
    return {
        **{name: outline[name] for name in OF_RUNS},
        "error": math.nan if error is None else error,
        "seconds": float(outcome.timings.get("processor", math.nan)),
    }
