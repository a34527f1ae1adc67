"""The result of a run as one read-only object; `pyfric.record.held` lists its contents."""

from __future__ import annotations

import dataclasses
import functools
import os
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

from pyfric.display import Shown, page
from pyfric.record import layout
from pyfric.record.analysis import __all__ as ANALYSES
from pyfric.record.catalogue import build_catalogue
from pyfric.record.classes import rupture_class
from pyfric.record.data import RecordData
from pyfric.record.held import RecordError, found_arrays, held_in
from pyfric.record.netcdf import file_image, read_image
from pyfric.record.rates import SAMPLED, fast_slip
from pyfric.record.report import summary, text
from pyfric.scene import followed_by
from pyfric.signals import held_back
from pyfric.statics import StaticSolver
from pyfric.values import check_folder_name, check_free, check_number, usage, write, write_all

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from pyfric.record.catalogue import Catalogue
    from pyfric.scene import Number

READERS = {
    ".nc": "",
    ".toml": "; pyfric.Scene.from_toml reads scenes",
    ".npz": "; pyfric.State.load reads states",
    "": "; pyfric.measured.read reads measured curves",
}
"""Texts that name the function which reads a file, by the ending of the file name."""
WITHOUT_ARRAYS = {"method", "versions", "timings", "counts", "notes", "status", "errors"}
"""Fields of a record that can change without a check of its arrays."""
UNSEALED = "the file was changed after pyfric wrote it: what it holds need not be what a run made"


@dataclass(frozen=True, kw_only=True, eq=False)
class Record(RecordData, Shown):
    """A finished, interrupted or failed run.

    Arrays over blocks run from left to right. Events are counted from 1. Arrays over events have
    event n in row n - 1 (`row`). Arrays and mappings are read-only. Each access to tables or final
    state returns a copy. Records are equal (``==``) if they hold the same values, bit for bit, with
    the same types.

    Attributes:
        scene, method: the scene, and the `Method` of its run.
        curve: data frame with t (s), F_T (N) and, with the option `energies`, energies (J).
        events, episodes: data frames of the catalogue; see `pyfric.record.catalogue`. The index of
            events is their number, as in ``record.events.loc[3]``. Episodes have a column `event`.
        arrays: arrays over events and blocks by name, shape (n_events, N_x). Each is also an
            attribute: region, rupture_times (s), X_c0_over_l, X_c_over_l, tau_before, p_before,
            tau_after and p_after (N).
        tau_initial, p_initial: interface forces at t = 0, shape (N_x,), N.
        quiet, switches: the logs from which the catalogue is made, as dicts of arrays
            (`QUIET_COLUMNS`, `SWITCH_COLUMNS`).
        motion: arrays of shape (points of the curve, N_x): u_x (m), v_x (m/s), f (N), and state
            variables of laws without rest. Empty for laws with rest, unless the run has a
            threshold.
        crossings, bursts: logs like switches and quiet, of slip faster than a threshold.
        versions, timings: version of each library, and time of each part of the run in s, by name.
        counts: counts of work by name, such as steps and block_evaluations.
        notes: warnings for the reader, such as assumptions that failed.
        status: "complete", "interrupted", "failed: reason", or "ended ..." if the engine or a
            condition ended the run before t_end.
        final_state: the `State` to continue from, or None.
        errors: the measured `Errors`, or None.

    Raises:
        RecordError: a field, named in the message, is missing, of the wrong type, or contradicts
            other fields.
    """

    rupture_class = rupture_class

    @classmethod
    def from_catalogue(cls, catalogue: Catalogue, *, late: bool = True, **rest: Any) -> Self:
        """Return the record of a run from its catalogue and the remaining attributes.

        `late` adds columns of events that take long to compute; reference runs do not need them.
        """
        record = cls(**_tables(catalogue), **rest)
        record.__dict__["_late"] = late
        return record

    def with_late_columns(self) -> Self:
        """Return the record with the columns of events that take long to compute.

        These columns are computed at the first access to the table of events.
        """
        if self.__dict__.get("_late"):
            return self
        new = self._copied()
        new.__dict__["_late"] = True
        return new

    def _frame(self, group: str) -> pd.DataFrame:
        if group == "events" and self.__dict__.get("_late"):
            self.__dict__["_late"] = False  # the functions below read the other columns
            events = self.__dict__["_events"]
            missing = [column for name, column in held_in("events").items() if name not in events]
            found = {
                column.name: column.checked(values)
                for column in missing
                if (values := column.find(self)) is not None
            }
            self.__dict__["_events"] = MappingProxyType({**events, **found})
            self.__dict__.pop("_events_frame", None)
        return super()._frame(group)

    def _copied(self) -> Self:
        """Return a record with the same attributes, without a check of its tables."""
        new = object.__new__(type(self))
        new.__dict__.update(self.__dict__)
        return new

    def with_events(self, threshold: Number | None = None, t_gap: Number | None = None) -> Self:
        """Return the record with events by another criterion; see `pyfric.record.rates`.

        Analysis, figures, summary and files of the new record use these events.

        Args:
            threshold: slip rate above which a block slips, m/s, such as "1 mm/s"; None means slip
                by contact.
            t_gap: longest pause inside an event, s; None means the `t_gap` of the record.

        Raises:
            SceneError: an argument is refused, or the record does not hold the slip rates.
        """
        t_gap = self.method.t_gap if t_gap is None else check_number("t_gap", t_gap, "s", ge=0.0)
        notes = tuple(note for note in self.notes if SAMPLED not in note)
        if threshold is None:
            logs, last = (self.switches, self.quiet), self.final_state
            fast = {"crossings": {}, "bursts": {}}
        else:
            threshold = check_number("threshold", threshold, "m/s", gt=0.0)
            found = fast_slip(self, threshold)
            logs, last, notes = found[:2], found.last, (*notes, *found.notes)
            fast = dict(zip(("crossings", "bursts"), logs, strict=True))
        t = self.curve["t"]
        catalogue = build_catalogue(
            *logs,
            self.scene,
            t_gap=t_gap,
            t_begin=float(t.iloc[0]),
            t_end=float(t.iloc[-1]),
            last=last,
            solver=self._solver(),
        )
        made = _tables(catalogue)
        method = dataclasses.replace(self.method, threshold=threshold, t_gap=t_gap)
        return self.replace(**made, **fast, method=method, notes=notes).with_late_columns()

    def _place(self, name: str) -> str:
        return f"pyfric.analysis.{name}(record)" if name in ANALYSES else super()._place(name)

    def _solver(self) -> StaticSolver | None:
        """Return the solver for static states of the record; None without static states."""
        if not self.scene.has_rests:
            return None
        state = self.final_state
        home = None if state is None else state.u_drv0
        return StaticSolver(self.scene, self.method.geometry, u_drv0=home)

    def replace(self, **changes: Any) -> Self:
        """Return the record with changed attributes, including arrays over blocks."""
        arrays = {name: changes.pop(name) for name in found_arrays() if name in changes}
        if arrays:
            changes["arrays"] = changes.get("arrays", self.arrays) | arrays
        known = {field.name for field in dataclasses.fields(self)}
        if strange := changes.keys() - known:
            raise TypeError(f"a record has no {', '.join(sorted(strange))}")
        new = self._copied()
        for name, value in changes.items():
            object.__setattr__(new, name, value)
        if changes.keys() - WITHOUT_ARRAYS:
            new._check_arrays()
        new._check_texts()
        return new

    def summary(self) -> str:
        """Return a text: status, events, method, errors, notes."""
        return text(summary(self, []))

    __repr__ = summary

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        if layout.attributes(self) != layout.attributes(other):
            return False
        ours, theirs = (list(layout.held_by(record)) for record in (self, other))
        return len(ours) == len(theirs) and all(
            a == b and left.shape == right.shape and left.tobytes() == right.tobytes()
            for (a, left), (b, right) in zip(ours, theirs, strict=True)
        )

    __hash__ = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy a record by its fields, so that it stays read-only."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        plain = {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in values.items()}
        return functools.partial(type(self), **plain), ()

    # --- files -----------------------------------------------------------------------------------

    @usage('record.save("run.nc")')
    @held_back()
    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write one netCDF file, whole or not at all.

        A file of the same run that ends at the same or an earlier time is replaced. Any other file
        is replaced only if `overwrite` is True; otherwise the record is saved beside it, under
        another name. The file is made in memory, because HDF5 does not survive a full disk.

        Raises:
            OSError: the file cannot be written. The message names path and reason.
            SceneError: the file exists and holds something else; or the name has the ending of
                another format, such as .csv.
        """
        if not (overwrite or self._goes_on_from(path)):
            held = "something else than an earlier part of this run"
            check_free(path, overwrite, self.save, held)
        variables, attributes = layout.variables(self), layout.attributes(self)
        values = {name: array for name, (_, array, _) in variables.items()}
        sealed = attributes | {layout.SEAL: layout.seal(values, attributes)}
        return write(path, file_image(variables, sealed), ".nc")

    def _goes_on_from(self, path: str | os.PathLike[str]) -> bool:
        """Whether a file holds this run, up to the same or an earlier time."""
        try:
            before = Record.load(path, unsealed=True)
        except (OSError, RecordError):
            return False
        (begin, end), (t_begin, t) = (record.curve["t"].iloc[[0, -1]] for record in (self, before))
        if t > end or t_begin != begin or self.method != before.method:
            return False
        found = followed_by(before.scene, self.scene, float(t))
        return found is not None and found[0] == self.scene

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, unsealed: bool = False) -> Self:
        """Read a record written by `save`.

        Args:
            path: path of the file.
            unsealed: whether a valid record that another program changed is read, too. The record
                then has a note.

        Raises:
            FileNotFoundError: there is no such file.
            RecordError: the file is not a pyfric record, is damaged, or has another schema. The
                message names the reason.
        """
        if not isinstance(path, str | os.PathLike):
            raise RecordError(f"record: a path is needed, not {type(path).__name__}")
        path = Path(os.path.expanduser(path))
        if not os.path.exists(path):  # or if no file can have this name
            full = f"{path}.nc"
            raise FileNotFoundError(
                f"no record at {path}" + f"; write {full}" * os.path.isfile(full)
            )
        if not path.is_file():
            raise RecordError(f"{path}: not a pyfric record (not a regular file)")
        try:
            attributes, values = read_image(memoryview(path.read_bytes()))
        except Exception as error:  # HDF5 raises many kinds of errors for other files
            reader = READERS.get(path.suffix, READERS[""])
            raise RecordError(
                f"{path}: damaged, or not a pyfric record ({error}){reader}"
            ) from error
        schema = attributes.get("pyfric_schema")
        if schema is None:
            raise RecordError(f"{path}: not a pyfric record (no attribute pyfric_schema)")
        if not isinstance(schema, int) or schema != layout.SCHEMA:
            made = f"{path}: written with record schema {schema}, this pyfric reads"
            raise RecordError(f"{made} {layout.SCHEMA}; another version of pyfric is needed")
        own = attributes.get(layout.SEAL) == layout.seal(values, attributes)
        if not (own or unsealed):
            reason = f"its content and {layout.SEAL} do not agree"
            read = "load(path, unsealed=True) reads what another program changed"
            raise RecordError(f"{path}: damaged, or changed ({reason}); {read}")
        try:
            record = cls(**layout.fields(attributes, layout.grouped(values)))
        except (KeyError, TypeError, ValueError) as error:
            raise RecordError(f"{path}: damaged pyfric record ({error})") from error
        return record if own else record.replace(notes=(*record.notes, UNSEALED))

    def to_xarray(self) -> xr.Dataset:
        """Return an `xarray.Dataset` of curve, events and interface, without logs.

        Coordinates are t (s), event (from 1), x (m, from the trailing edge), and the block number
        n along x. F_T and energies have the dimension t. Columns of `events` have the dimension
        event and the prefix event_. Arrays over blocks have dimensions (event, x). Each variable
        has units and a long_name. The package xarray is needed.
        """
        return layout.dataset(self)

    def to_datatree(self) -> xr.DataTree:
        """Return all of the record as an `xarray.DataTree`.

        Groups are curve, events, episodes, interface (arrays over blocks), the logs such as quiet
        and switches, and final_state. The package xarray is needed.
        """
        return layout.datatree(self)

    @usage('record.to_html("run.html")')
    def to_html(self, path: str | os.PathLike[str]) -> Path:
        """Write one self-contained page about the record, at most 2 MB, and return its path.

        The page shows the loading curve, slip along the interface, stresses of each event, and the
        method; see `pyfric.figures.record_page`.

        Raises:
            OSError: the file cannot be written. The message names path and reason.
            SceneError: the name has the ending of another format, such as .png.
        """
        return write(path, page(self).encode(), ".html")

    @usage('record.to_mat("run.mat")')
    @held_back()
    def to_mat(self, path: str | os.PathLike[str]) -> Path:
        """Write a file for MATLAB (version 5) and Octave; return its path.

        Each group of `to_datatree` is a struct, such as ``curve.F_T`` or ``events.t_start``. The
        struct ``about`` has scene, method, status and notes as text. Columns are column vectors.
        Arrays over events and blocks have one row for each event.

        Raises:
            OSError: the file cannot be written. The message names path and reason.
            SceneError: the name has the ending of another format, such as .nc.
        """
        return write(path, layout.mat(self), ".mat")

    @usage('record.to_csv("tables")')
    def to_csv(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables as CSV into ``folder`` (made if missing) and return the paths.

        curve.csv, events.csv and episodes.csv are the data frames. stresses.csv has the arrays over
        blocks, with one row per event and block. interface.csv has the loaded interface.
        columns.csv gives unit and meaning of each column. Floats are written with full precision.

        Raises:
            OSError: a file cannot be written.
            SceneError: ``folder`` has the ending of a file name.
        """
        folder = Path(os.path.expanduser(folder))
        check_folder_name(folder)
        folder.mkdir(parents=True, exist_ok=True)
        tables = layout.csv_tables(self)
        return write_all(
            {folder / f"{k}.csv": v.to_csv(index=False).encode() for k, v in tables.items()}
        )


Record.__init__ = usage('pyfric.load("run.nc"), or pyfric.simulate(scene, "400 ms")')(
    Record.__init__
)


def _tables(catalogue: Catalogue) -> dict[str, Any]:
    """Return the tables and arrays of a record by name."""
    tables = {"events": catalogue.columns, "episodes": catalogue.slips}
    return tables | {"arrays": catalogue.arrays}


load = Record.load
