"""The fields of a record, checked and read-only; see `Record`."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.core import State
from pyfric.record.held import (
    EDGES,
    LOGS,
    TABLES,
    RecordError,
    checked,
    found_arrays,
    held_in,
    table,
)
from pyfric.record.measured import Errors
from pyfric.record.method import Method
from pyfric.scene import Scene
from pyfric.values import SceneError, meant, nearest, no_attribute

if TYPE_CHECKING:
    from pyfric.scene import Number

TEXTS = ("versions", "timings", "counts")
"""Fields of a record that are mappings from names to texts or numbers."""
COPY_ON_WRITE = int(pd.__version__.partition(".")[0]) >= 3
"""Whether pandas copies on write, so that changes of a shallow copy leave the table unchanged."""


class Table(pd.DataFrame):
    """A table of a record: a data frame that suggests columns for unknown names."""

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return pd.DataFrame  # parts of a table are plain data frames

    def __getitem__(self, key: Any) -> Any:
        try:
            return super().__getitem__(key)
        except KeyError:
            raise KeyError(self._said(key)) from None

    def __getattr__(self, name: str) -> Any:
        try:
            return super().__getattr__(name)
        except AttributeError:
            found = "" if name.startswith("_") else meant(name, self.columns)
            if not found:
                raise
            raise AttributeError(f"no column {name!r}; write {found!r} in brackets") from None

    def _said(self, key: Any) -> str:
        """Return the message for an unknown column."""
        found = nearest(key, self.columns) if isinstance(key, str) else ""
        hint = f"; did you mean {found!r}?" if found else ""
        return f"{key!r} is no column{hint}; columns: {', '.join(map(str, self.columns))}"


class Events(Table):
    """The table of events of a record; a call returns the events by another criterion."""

    def _said(self, key: Any) -> str:
        if isinstance(key, int):
            return f"{key} is no column; record.events.loc[1] is event 1, record.events.iloc[0] too"
        return super()._said(key)

    def __call__(
        self, threshold: Number | None = None, t_gap: Number | None = None
    ) -> pd.DataFrame:
        """Return the events of the record by another criterion; see `Record.with_events`."""
        return self._record.with_events(threshold, t_gap).events


class _Guarded:
    """A field whose value is copied at each access and so is not changed through the copy."""

    def __init__(self, default: Any = dataclasses.MISSING) -> None:
        self.default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self.field, self.name = name, f"_{name}"

    def __get__(self, record: RecordData | None, owner: type | None = None) -> Any:
        if record is None:
            if self.default is dataclasses.MISSING:
                raise AttributeError(self.name)
            return self.default
        if self.field not in TABLES:
            return copy.deepcopy(record.__dict__[self.name])
        frame = record._frame(self.field).copy(deep=not COPY_ON_WRITE)
        own = Events(frame) if self.field == "events" else Table(frame)
        object.__setattr__(own, "_record", record)
        return own

    def __set__(self, record: RecordData, value: Any) -> None:
        if self.field not in TABLES:
            record.__dict__[self.name] = copy.deepcopy(value)
            return
        own = {name: column.copy() for name, column in checked(self.field, value, {}).items()}
        record.__dict__[self.name] = MappingProxyType(_read_only(own))
        record.__dict__.pop(f"{self.name}_frame", None)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordData:
    """The fields of a record, checked and read-only; see `Record`."""

    scene: Scene
    method: Method
    curve: pd.DataFrame = _Guarded()
    events: pd.DataFrame = _Guarded()
    episodes: pd.DataFrame = _Guarded()
    arrays: Mapping[str, np.ndarray]
    tau_initial: np.ndarray
    p_initial: np.ndarray
    quiet: Mapping[str, np.ndarray]
    switches: Mapping[str, np.ndarray]
    motion: Mapping[str, np.ndarray] = field(default_factory=dict)
    crossings: Mapping[str, np.ndarray] = field(default_factory=dict)
    bursts: Mapping[str, np.ndarray] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    status: str = "complete"
    final_state: State | None = _Guarded(default=None)
    errors: Errors | None = None

    def __post_init__(self) -> None:
        self._check_arrays()
        self._check_texts()

    def _check_arrays(self) -> None:
        own, sizes = self.__dict__, {"x": self.scene.N_x}
        sizes |= {"event": len(own["_events"]["t_start"]), "t": len(own["_curve"]["t"])}
        edges = {name: own[name] for name in EDGES}
        own |= _read_only(checked("interface", edges, sizes, edges))
        arrays = checked("interface", self.arrays, sizes, found_arrays())
        own["arrays"] = MappingProxyType(_read_only(arrays))
        for log in LOGS:
            own[log] = MappingProxyType(_read_only(checked(log, own[log], sizes)))

    def _check_texts(self) -> None:
        for name in TEXTS:
            self.__dict__[name] = MappingProxyType(dict(self.__dict__[name]))
        if not (self.done or self.status == "interrupted" or self.status.startswith("failed")):
            raise RecordError(f"record: status {self.status!r} is unknown")

    def __getattr__(self, name: str) -> np.ndarray:
        """Return the array over events and blocks of that name."""
        if name in self.__dict__.get("arrays", ()):
            return self.arrays[name]
        instead = "" if name.startswith("_") else self._place(name)
        raise no_attribute("record", name, self, instead, dir(type(self)))

    def __getitem__(self, name: str) -> Any:
        """Raise TypeError, whose message names the attribute to use."""
        raise TypeError(f"a record has attributes; write record.{name}")

    def _place(self, name: str) -> str:
        """Return the Python expression for a column or an attribute of the scene; "" if none."""
        for group in TABLES:
            if name in held_in(group):
                return f'record.{group}["{name}"]'
        return f"record.scene.{name}" if hasattr(type(self.scene), name) else ""

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.arrays]

    def columns(self, group: str) -> Mapping[str, np.ndarray]:
        """Return the columns of "curve", "events" or "episodes" as read-only arrays.

        Access to columns takes less time than access to the table. Slow columns of events are
        missing until the table of events has been read once.
        """
        return self.__dict__[f"_{group}"]

    def _frame(self, group: str) -> pd.DataFrame:
        """Return the table of a group, which is made at the first access."""
        kept = f"_{group}_frame"
        if kept not in self.__dict__:
            self.__dict__[kept] = table(group, self.columns(group))
        return self.__dict__[kept]

    @property
    def done(self) -> bool:
        """Whether the run is complete, or was ended by its engine or by a condition."""
        return self.status == "complete" or self.status.startswith("ended ")

    @property
    def transitions(self) -> Mapping[str, np.ndarray]:
        """Starts and ends of slip that define the events: `quiet` by contact, `bursts` by rate."""
        return self.quiet if self.method.threshold is None else self.bursts

    def row(self, event: int) -> int:
        """Return the row of an event in arrays over events, counted from 0.

        Args:
            event: number of the event, counted from 1.

        Raises:
            SceneError: there is no such event.
        """
        count = len(self.columns("events")["t_start"])
        allowed = f"an event of the record, 1 to {count}" if count else "none: nothing slipped"
        if isinstance(event, bool) or not isinstance(event, int | np.integer):
            raise SceneError("event", event, "", allowed, "not an integer")
        if not 1 <= event <= count:
            raise SceneError("event", int(event), "", allowed, "no such event")
        return int(event) - 1


def _read_only(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    views = {name: array.view() for name, array in arrays.items()}
    for view in views.values():
        view.flags.writeable = False
    return views
