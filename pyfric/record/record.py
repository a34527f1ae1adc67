"""What happened in a run: one frozen object, one self-describing file.

A record file is netCDF 4 and opens with any netCDF reader; `xarray.open_dataset` shows every
variable with its unit and meaning. Attributes of the file:

``pyfric_schema``
    Version of this layout. A file with another one is refused.
``scene``
    The scene as TOML text.
``method``, ``versions``, ``timings``, ``counts``, ``notes``, ``errors``, ``final_state``,
``tables``
    JSON. ``tables`` lists the columns of each table in order, with their types.
``status``
    "complete", "interrupted", "failed: reason", or "ended ..." where an engine had no way on.

Variables of the loading curve carry their plain names on the dimension ``t``; those of the event
and episode tables and of the two logs begin with ``event_``, ``episode_``, ``quiet_`` and
``switch_``. Stresses are on (``event``, ``x``), x from the centre of the slider, and so are
``X_c0_over_l`` and ``X_c_over_l``, the blocks in the cohesive zone of fronts, which are found anew
from what is read. Numbers are stored as they are in memory, so that a loaded record equals the
saved one bit for bit. The last line of the file is the SHA-256 of all before it, which readers of
netCDF do not see.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd

from pyfric.core import State
from pyfric.display import html, page
from pyfric.record.catalogue import T_GAP
from pyfric.record.episodes import QUIET_COLUMNS, SWITCH_COLUMNS
from pyfric.record.errors import Errors
from pyfric.record.labels import describe
from pyfric.record.netcdf import Variable, file_image, read_image
from pyfric.record.nucleation import nucleation_lengths
from pyfric.record.report import summary, text
from pyfric.record.rupture import front_speed
from pyfric.record.zones import zone_at_rest, zone_moving
from pyfric.scene import Scene, sealed, unsealed, write
from pyfric.signals import held_back

if TYPE_CHECKING:
    import xarray as xr

    from pyfric.record.catalogue import Catalogue

__all__ = ["SCHEMA", "Method", "Record", "RecordError"]

SCHEMA = 6
"""Version of the file layout that this module writes and reads."""

SWITCH = {
    "located": "contacts switch where they do inside steps",
    "step_end": "contacts switch at step ends, as in the paper",
}
STRESSES = ("tau_before", "p_before", "tau_after", "p_after")
LOGS = {"quiet": QUIET_COLUMNS, "switches": SWITCH_COLUMNS}
PREFIX = {"quiet": "quiet_", "switches": "switch_"}
GROUPS = {
    "curve": "",
    "events": "event_",
    "episodes": "episode_",
    "interface": "",
    "quiet": "quiet_",
    "switches": "switch_",
    "final_state": "final_",
}
"""Group of a tree -> what the names of its variables begin with in the file."""
DRAWN = "drawn_"
"""Begins the names of fields of the interface as they were drawn, on x."""
UNSEEN = ("episode_", "quiet_", "switch_", "final_")
TABLES = {"curve": ("t", ""), "events": ("event", "event_"), "episodes": ("episode", "episode_")}


class RecordError(ValueError):
    """A file is not a record that this version can read, or a record does not fit together."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """How a scene was run.

    ``rtol`` is the largest error of an adaptive sub-step, None for other steppers. ``dt`` (s) is
    None for engines without a fixed step; ``sample`` is the number of steps between
    two points of the curve; ``t_gap`` (s) is the longest pause inside an event; ``budget`` says
    whether the energy budget was kept.
    """

    engine: str
    geometry: str
    stepper: str = ""
    switching: str = ""
    rtol: float | None = None
    dt: float | None = None
    sample: int = 0
    t_gap: float = T_GAP
    threads: int = 1
    variant: str = ""
    budget: bool = False

    def __str__(self) -> str:
        """Engine, geometry, stepper, step and where contacts switch, in words."""
        words = [f"{self.engine} engine", f"{self.geometry} geometry"]
        if self.stepper:
            words.append(self.stepper)
        if self.dt is not None:
            words.append(f"dt = {self.dt * 1e6:g} us")
        if self.switching:
            words.append(SWITCH[self.switching])
        return ", ".join(words)


class _Guarded:
    """A field of which everybody gets a copy of his own: what he changes there is his alone."""

    def __init__(self, default: Any = dataclasses.MISSING) -> None:
        self.default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = f"_{name}"

    def __get__(self, record: Record | None, owner: type | None = None) -> Any:
        if record is None:
            if self.default is dataclasses.MISSING:
                raise AttributeError(self.name)
            return self.default
        return _copied(record.__dict__[self.name])

    def __set__(self, record: Record, value: Any) -> None:
        record.__dict__[self.name] = _copied(value, deep=True)


def _copied(value: Any, deep: bool = False) -> Any:
    if isinstance(value, pd.DataFrame):
        return value.copy(deep=deep)  # a shallow one is copied where it is written to
    return copy.deepcopy(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A finished, interrupted or failed run.

    Arrays over blocks run from left to right. A record cannot be changed: its arrays and mappings
    are read-only, tables and final state are copies each time they are asked for. Records are equal
    (``==``) if they hold the same values, bit for bit, with the same types.

    Attributes
    ----------
    scene, method
        What was run and how.
    curve
        Data frame with t (s), F_T (N) and, when the budget was kept, energies (J).
    events, episodes, region, rupture_times, tau_before, p_before, tau_after, p_after
        The catalogue: see `pyfric.record.catalogue`. Arrays have shape (n_events, N_x).
    tau_initial, p_initial
        Interface forces at t = 0, shape (N_x,), N.
    quiet, switches
        The logs as dicts of arrays (`QUIET_COLUMNS`, `SWITCH_COLUMNS` of `catalogue`); what
        the catalogue was made from, and what it is made from again when the run goes on.
    versions, timings
        Names to version texts, and names to seconds.
    counts
        Names to numbers of things done, such as steps and block_evaluations.
    notes
        What a reader has to know: assumptions that failed, levels of the plan that were left.
    status
        "complete", "interrupted", "failed: reason", or "ended ..." for a run whose engine had no
        way on before its time.
    final_state
        The state to continue from: a `State`, a dict of arrays and numbers, or None.
    errors
        `Errors` that were measured, or None.

    Raises
    ------
    RecordError
        If shapes or status do not fit together.
    """

    scene: Scene
    method: Method
    curve: pd.DataFrame = _Guarded()
    events: pd.DataFrame = _Guarded()
    episodes: pd.DataFrame = _Guarded()
    region: np.ndarray
    rupture_times: np.ndarray
    tau_before: np.ndarray
    p_before: np.ndarray
    tau_after: np.ndarray
    p_after: np.ndarray
    tau_initial: np.ndarray
    p_initial: np.ndarray
    quiet: Mapping[str, np.ndarray]
    switches: Mapping[str, np.ndarray]
    versions: Mapping[str, str] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    status: str = "complete"
    final_state: Any = _Guarded(default=None)
    errors: Errors | None = None

    def __post_init__(self) -> None:
        for name, shape in self._shapes().items():
            array = _read_only(getattr(self, name))
            if array.shape != shape:
                raise RecordError(f"record: {name} has shape {array.shape}, needs {shape}")
            object.__setattr__(self, name, array)
        for log, columns in LOGS.items():
            values = getattr(self, log)
            for name in columns:
                if name not in values:
                    raise RecordError(f"record: {log} has no column {name}")
            frozen = {name: _read_only(values[name]) for name in columns}
            object.__setattr__(self, log, MappingProxyType(frozen))
        for name in ("versions", "timings", "counts"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name in ("t", "F_T"):
            if name not in self.curve:
                raise RecordError(f"record: the curve has no column {name}")
        if not (self.done or self.status == "interrupted" or self.status.startswith("failed")):
            raise RecordError(f"record: status {self.status!r} is unknown")

    @property
    def done(self) -> bool:
        """Whether nothing is left to do: the run is complete, or ended where its engine ends."""
        return self.status == "complete" or self.status.startswith("ended ")

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        by_block = (self.scene.N_x,)
        by_event = (len(self.events), *by_block)
        names = ("region", "rupture_times", *STRESSES)
        shapes = dict.fromkeys(names, by_event)
        return shapes | {"tau_initial": by_block, "p_initial": by_block}

    @classmethod
    def from_catalogue(cls, catalogue: Catalogue, **rest: Any) -> Self:
        """Record of a run from its catalogue and the remaining attributes."""
        record = cls(
            events=catalogue.events,
            episodes=catalogue.episodes,
            region=catalogue.region,
            rupture_times=catalogue.rupture_times,
            **{name: getattr(catalogue.static, name) for name in STRESSES},
            **rest,
        )
        lengths = nucleation_lengths(record)
        if lengths is None:
            return record
        events = record.events.assign(nucleation_length=lengths)
        return dataclasses.replace(record, events=events)

    def summary(self) -> str:
        """Return what the record holds, in lines: status, events, method, errors, notes."""
        return text(summary(self, []))

    __repr__ = summary

    def _repr_html_(self) -> str:
        return html(self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return all(
            _identical(getattr(self, one.name), getattr(other, one.name))
            for one in dataclasses.fields(self)
        )

    __hash__ = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Records are pickled and copied as what they are made from, and stay read-only."""
        values = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        plain = {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in values.items()}
        return _made, (type(self), plain)

    # --- files -----------------------------------------------------------------------------------

    @held_back()
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write one netCDF file, atomically: a file of that name is replaced whole or not at all.

        HDF5 sees memory alone: it does not survive a disk that fills up.

        Raises
        ------
        RecordError
            If a table holds a column that the file cannot hold exactly.
        OSError
            If the file cannot be written; it names path and reason.
        """
        variables = dict(self._variables())
        for name, (dims, _, attributes) in variables.items():
            if name != "n" and "x" in dims:
                attributes["coordinates"] = "n"
        return write(path, sealed(file_image(variables, self._attributes())))

    def to_xarray(self) -> xr.Dataset:
        """What happened, as an `xarray.Dataset`: curve, events and interface, and no logs.

        Coordinates are t (s), event (row of `events`), x (m, from the centre of the slider) and, on
        x, n (block from the trailing edge). F_T and energies are on t; event_..., the columns of
        `events`, on event; region, rupture_times and stresses on (event, x). Every variable has
        its units and its long_name.
        """
        import xarray as xr  # slow to import

        variables = dict(self._variables())
        kept = {k: v for k, v in variables.items() if not k.startswith(UNSEEN)}
        event = {"units": "1", "long_name": "row of the table of events"}
        kept["event"] = ("event", np.arange(len(self.events)), event)
        coordinates = {name: kept.pop(name) for name in ("t", "event", "x", "n")}
        attributes = {
            **self._titles(),
            "scene": self.scene.to_toml(),
            "method": str(self.method),
            "status": self.status,
            "notes": "\n".join(self.notes),
            "pyfric": self.versions.get("pyfric", ""),
        }
        return xr.Dataset(kept, coordinates, attributes)

    def to_datatree(self) -> xr.DataTree:
        """All of the record as an `xarray.DataTree`, from which `from_datatree` makes it again.

        Groups are curve, events, episodes, interface (stresses and regions), quiet and switches
        (the logs) and final_state.
        """
        import xarray as xr  # slow to import

        whole = self._dataset()
        names = {group: [] for group in GROUPS}
        for name in map(str, whole.variables):
            names[_group(name, self.curve)].append(name)
        groups = {
            group: whole[mine].rename({name: name.removeprefix(GROUPS[group]) for name in mine})
            for group, mine in names.items()
        }
        groups = {group: one.drop_attrs(deep=False) for group, one in groups.items()}
        return xr.DataTree.from_dict({"/": xr.Dataset(attrs=whole.attrs), **groups})

    @classmethod
    def from_datatree(cls, tree: xr.DataTree) -> Self:
        """Return the record that a tree of `to_datatree` holds.

        Raises
        ------
        RecordError
            If something is missing, does not fit together or has another schema.
        """
        values = {
            GROUPS[group] + str(name): variable.to_numpy()
            for group in GROUPS
            if group in tree.children
            for name, variable in tree[group].to_dataset(inherit=False).variables.items()
        }
        return cls._checked("tree", tree.attrs, values)

    def _titles(self) -> dict[str, str]:
        name = self.scene.name or "unnamed scene"
        return {"title": f"pyfric record: {name}", "Conventions": "CF-1.11"}

    def _dataset(self) -> xr.Dataset:
        """The record as it is laid out in the file."""
        import xarray as xr  # slow to import

        variables = dict(self._variables())
        coordinates = {name: variables.pop(name) for name in ("t", "x", "n")}
        return xr.Dataset(variables, coordinates, self._attributes())

    def _attributes(self) -> dict[str, Any]:
        """Attributes of the file."""
        return {
            **self._titles(),
            "pyfric_schema": SCHEMA,
            "scene": self.scene.to_toml(),
            "method": json.dumps(dataclasses.asdict(self.method)),
            "versions": json.dumps(dict(self.versions)),
            "timings": json.dumps(dict(self.timings)),
            "counts": json.dumps(dict(self.counts)),
            "notes": json.dumps(list(self.notes)),
            "status": self.status,
            "errors": json.dumps(None if self.errors is None else self.errors.to_json()),
            "final_state": json.dumps(_state_plan(self.final_state)),
            "tables": json.dumps({name: _dtypes(getattr(self, name)) for name in TABLES}),
        }

    def _variables(self) -> Iterator[tuple[str, Variable]]:
        """Name and content of every variable of the file."""

        def variable(dims: Any, values: np.ndarray, name: str, table: str = "") -> Variable:
            unit, long_name = describe(name, table)
            dims = (dims,) if isinstance(dims, str) else tuple(dims)
            return dims, values, {"units": unit, "long_name": long_name}

        yield "x", variable("x", np.asarray(self.scene.x), "x")
        yield "n", variable("x", np.asarray(self.scene.n_of_i), "n")
        for name, values in self.scene.drawn.items():
            values = np.array(values)[self.scene.n_of_i - 1]
            yield DRAWN + name, variable("x", values, DRAWN + name)
        taken = {"x", "n", *self._shapes()}
        for table, (dim, prefix) in TABLES.items():
            for name, column in getattr(self, table).items():
                if prefix + name in taken:
                    raise RecordError(f"record: column {name!r} of {table} needs another name")
                taken.add(prefix + name)
                yield prefix + name, variable(dim, _plain(column), name, table)
        for name, shape in self._shapes().items():
            dims = ("event", "x")[-len(shape) :]
            yield name, variable(dims, getattr(self, name), name)
        v_c = front_speed(self.rupture_times, self.scene.slider.l, self.scene.d)
        at_rest = zone_at_rest(self.scene, self.p_before)
        at_rest[np.isnan(self.rupture_times)] = np.nan
        moving = zone_moving(self.scene, self.p_before, v_c)
        yield "X_c0_over_l", variable(("event", "x"), at_rest, "X_c0_over_l")
        yield "X_c_over_l", variable(("event", "x"), moving, "X_c_over_l")
        for log in LOGS:
            for name, values in getattr(self, log).items():
                yield PREFIX[log] + name, variable((log, "x")[: values.ndim], values, name)
        for name, value in _state_items(self.final_state).items():
            if _kind(value) in ("array", "int", "float", "bool"):
                array = np.asarray(value)
                dims = tuple(f"final_{name}_{axis}" for axis in range(array.ndim))
                attributes = {"units": "SI", "long_name": f"{name} of the final state"}
                yield "final_" + name, (dims, array, attributes)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a record written by `save`.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        RecordError
            If the file is not a pyfric record, is damaged, or has another schema.
        """
        if not isinstance(path, str | os.PathLike):
            raise RecordError(f"record: a path is needed, not {type(path).__name__}")
        path = Path(path)
        if not os.path.exists(path):  # also where no file can have this name
            raise FileNotFoundError(f"no record at {path}")
        if not path.is_file():
            raise RecordError(f"{path}: not a pyfric record (not a regular file)")
        inside = unsealed(path.read_bytes())
        if inside is None:
            reason = "its content and the hash at its end do not agree"
            raise RecordError(f"{path}: damaged, or not a pyfric record ({reason})")
        try:
            attributes, values = read_image(inside)
        except Exception as error:  # whatever the HDF5 layers make of a foreign file
            raise RecordError(f"{path}: not a pyfric record ({error})") from error
        return cls._checked(str(path), attributes, values)

    @classmethod
    def _checked(
        cls, source: str, attributes: Mapping[str, Any], values: Mapping[str, Any]
    ) -> Self:
        """Return the record that attributes and variables of a file, or of a tree, come to."""
        schema = attributes.get("pyfric_schema")
        if schema is None:
            raise RecordError(f"{source}: not a pyfric record (no attribute pyfric_schema)")
        if schema != SCHEMA:
            made = f"{source}: written with record schema {schema}, this pyfric reads {SCHEMA}"
            raise RecordError(f"{made}; another version of pyfric is needed")
        try:
            return cls._from_file(attributes, values)
        except (KeyError, TypeError, ValueError) as error:
            raise RecordError(f"{source}: damaged pyfric record ({error})") from error

    @classmethod
    def _from_file(cls, attributes: Mapping[str, Any], values: Mapping[str, np.ndarray]) -> Self:
        tables = {
            name: _table(values, TABLES[name][1], columns)
            for name, columns in json.loads(attributes["tables"]).items()
        }
        arrays = ("region", "rupture_times", *STRESSES, "tau_initial", "p_initial")
        return cls(
            scene=_scene(attributes["scene"], values),
            method=Method(**json.loads(attributes["method"])),
            **tables,
            **{name: values[name] for name in arrays},
            **{
                log: {name: values[PREFIX[log] + name] for name in columns}
                for log, columns in LOGS.items()
            },
            versions=json.loads(attributes["versions"]),
            timings=json.loads(attributes["timings"]),
            counts=json.loads(attributes["counts"]),
            notes=tuple(json.loads(attributes["notes"])),
            status=attributes["status"],
            errors=_errors(json.loads(attributes["errors"])),
            final_state=_load_state(json.loads(attributes["final_state"]), values),
        )

    def to_html(self, path: str | os.PathLike[str]) -> Path:
        """Write one page about the record, at most 2 MB that stand alone, and return its path.

        It shows the loading curve, where the interface slips, each event with its stresses, and
        what made the record; see `pyfric.figures.record_page`.

        Raises
        ------
        OSError
            If the file cannot be written; it names path and reason.
        """
        return write(path, page(self).encode())

    def to_csv(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables as CSV into ``folder`` (made if missing) and return the paths.

        curve.csv, events.csv and episodes.csv are the data frames; stresses.csv has one row per
        event and block, with event -1 for the initial state; columns.csv gives unit and meaning of
        every column. Floats are written with all the digits that tell them apart.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        tables = {name: getattr(self, name) for name in TABLES}
        tables["events"] = tables["events"].rename_axis("event").reset_index()
        tables["stresses"] = self._stress_table()
        labels = [
            (table, column, *describe(column, table))
            for table, frame in tables.items()
            for column in frame
        ]
        tables["columns"] = pd.DataFrame(labels, columns=["table", "column", "unit", "meaning"])
        return [
            write(folder / f"{name}.csv", frame.to_csv(index=False).encode())
            for name, frame in tables.items()
        ]

    def _stress_table(self) -> pd.DataFrame:
        n_events, N_x = self.region.shape
        nothing = np.full(N_x, np.nan)
        initial = {"tau_before": self.tau_initial, "p_before": self.p_initial}
        columns = {
            "event": np.repeat(np.arange(-1, n_events), N_x),
            "n": np.tile(self.scene.n_of_i, n_events + 1),
            "x": np.tile(self.scene.x, n_events + 1),
            "region": np.concatenate([np.zeros(N_x, np.int8), self.region.ravel()]),
        }
        for name in (*STRESSES, "rupture_times"):
            first = initial.get(name, nothing)
            columns[name] = np.concatenate([first, getattr(self, name).ravel()])
        return pd.DataFrame(columns)


def _made(kind: type[Record], values: dict[str, Any]) -> Record:
    return kind(**values)


def _errors(values: dict[str, Any] | None) -> Errors | None:
    return None if values is None else Errors.from_json(values)


def _scene(text: str, values: Mapping[str, np.ndarray]) -> Scene:
    """Return the scene of a file, whose fields are not drawn again."""
    first = np.argsort(values["n"])  # from the trailing edge on
    drawn = [name for name in values if name.startswith(DRAWN)]
    return Scene.from_toml(text, draws={k.removeprefix(DRAWN): values[k][first] for k in drawn})


# --- columns -------------------------------------------------------------------------------------


def _read_only(values: Any) -> np.ndarray:
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


def _dtypes(frame: pd.DataFrame) -> dict[str, str]:
    return {str(name): str(dtype) for name, dtype in frame.dtypes.items()}


def _plain(column: pd.Series) -> np.ndarray:
    """Values of a column as a NumPy array of numbers, booleans or text."""
    values = column.to_numpy()
    if values.dtype.kind in "biuf":
        return values
    if all(isinstance(value, str) for value in values):
        return np.array(values, dtype=np.str_)
    raise RecordError(f"record: column {column.name!r} ({column.dtype}) is not numbers or text")


def _group(name: str, curve: pd.DataFrame) -> str:
    """Return the group of a tree that holds this variable of a file."""
    for group, prefix in GROUPS.items():
        if prefix and name.startswith(prefix):
            return group
    return "curve" if name in curve else "interface"


def _table(
    values: Mapping[str, np.ndarray], prefix: str, columns: Mapping[str, str]
) -> pd.DataFrame:
    return pd.DataFrame(
        {name: pd.Series(values[prefix + name]).astype(dtype) for name, dtype in columns.items()}
    )


# --- final state ---------------------------------------------------------------------------------


def _state_items(state: Any) -> dict[str, Any]:
    if state is None:
        return {}
    if isinstance(state, Mapping):
        return dict(state)
    return {one.name: getattr(state, one.name) for one in dataclasses.fields(state) if one.init}


def _kind(value: Any) -> str:
    if isinstance(value, np.ndarray | np.generic):
        return "array"
    for kind in (bool, int, float):  # bool first: it is an int
        if type(value) is kind:
            return kind.__name__
    return "json"


def _state_plan(state: Any) -> dict[str, Any] | None:
    """What the attributes say about the final state: its class and the kind of each entry."""
    if state is None:
        return None
    plan = {name: [_kind(value), None] for name, value in _state_items(state).items()}
    for name, value in _state_items(state).items():
        if plan[name][0] == "json":
            plan[name][1] = value
        elif plan[name][0] == "array":
            plan[name][1] = np.asarray(value).dtype.str
    return {"class": "dict" if isinstance(state, Mapping) else "State", "entries": plan}


def _load_state(plan: Mapping[str, Any] | None, values: Mapping[str, np.ndarray]) -> Any:
    if plan is None:
        return None
    types = {"bool": bool, "int": int, "float": float}
    state = {}
    for name, (kind, detail) in plan["entries"].items():
        if kind == "json":
            state[name] = detail
        elif kind == "array":
            state[name] = values["final_" + name].astype(detail)
        else:
            state[name] = types[kind](values["final_" + name].item())
    if plan["class"] == "dict":
        return state

    return State(**state)


# --- equality ------------------------------------------------------------------------------------


def _identical(a: Any, b: Any) -> bool:
    if isinstance(a, pd.DataFrame):
        if not (isinstance(b, pd.DataFrame) and _dtypes(a) == _dtypes(b) and len(a) == len(b)):
            return False
        return list(a) == list(b) and all(_identical(_plain(a[c]), _plain(b[c])) for c in a)
    if isinstance(a, np.ndarray | np.generic):
        same_form = isinstance(b, np.ndarray | np.generic) and a.dtype == b.dtype
        return same_form and np.shape(a) == np.shape(b) and a.tobytes() == b.tobytes()
    if isinstance(a, Mapping):
        same_keys = isinstance(b, Mapping) and list(a) == list(b)
        return same_keys and all(_identical(a[key], b[key]) for key in a)
    if isinstance(a, float) and isinstance(b, float):
        return _identical(np.float64(a), np.float64(b))
    if dataclasses.is_dataclass(a) and not isinstance(a, Scene | Method):
        return type(a) is type(b) and _identical(_state_items(a), _state_items(b))
    return type(a) is type(b) and a == b
