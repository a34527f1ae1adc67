"""Numbers of runs, such as the number of precursors, for tables of many runs.

An `Outline` gives numbers of a run without making tables, which saves time. Each number is one
function of an `Outline`. Its decorator, `run_column`, holds unit and meaning.

Main events have at least four blocks. Precursors and system-size events are finished main events.
Only precursors before the first system-size event count.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import pyfric.record.balance  # noqa: F401  its columns of events
from pyfric.record.held import held_in
from pyfric.record.recurrence import b_value, most_frequent
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.record.catalogue import Catalogue
    from pyfric.record.record import Record
    from pyfric.scene import Scene

Number = Callable[["Outline"], float]


class RunColumn(NamedTuple):
    """A number of a run: its unit, its meaning, and the function that computes it."""

    unit: str
    meaning: str
    find: Number


RUN_COLUMNS: dict[str, RunColumn] = {}
"""Numbers of runs by name."""


EVENT_COLUMNS = (
    *(name for name, held in held_in("events").items() if held.find and held.required),
    "potency",
)
"""Columns of events in an outline."""


def run_column(unit: str, meaning: str) -> Callable[[Number], Number]:
    """Enter the decorated function as a number of runs, under its own name."""

    def enter(find: Number) -> Number:
        RUN_COLUMNS[find.__name__] = RunColumn(unit, meaning, find)
        return find

    return enter


class Outline:
    """Events and curve of a run, as columns that are computed when read.

    Args:
        scene: the scene.
        events: columns of events by name.
        curve: columns of the loading curve by name, t (s) and F_T (N).
        status: status of the record.
        transitions: the log of starts and ends of slip.
    """

    final_state = None  # numbers of finished events do not need the state

    def __init__(
        self,
        scene: Scene,
        events: Callable[[str], np.ndarray],
        curve: Mapping[str, np.ndarray],
        status: str,
        transitions: Mapping[str, np.ndarray],
    ) -> None:
        self.scene, self.curve, self.status = scene, curve, status
        self.events, self.transitions = _Columns(events), transitions

    @classmethod
    def of_record(cls, record: Record) -> Outline:
        """Return the outline of a record."""
        early = record.columns("events")

        def column(name: str) -> np.ndarray:
            return early[name] if name in early else record.events[name].to_numpy()

        curve = record.columns("curve")
        return cls(record.scene, column, curve, record.status, record.transitions)

    @classmethod
    def of_catalogue(
        cls, catalogue: Catalogue, curve: Mapping[str, np.ndarray], status: str
    ) -> Outline:
        """Return the outline of a run from its catalogue."""

        def column(name: str) -> np.ndarray:
            held = held_in("events")[name]
            return catalogue[name] if held.required else held.checked(held.find(found))

        found = cls(catalogue.scene, column, curve, status, catalogue.quiet)
        return found

    def columns(self, group: str) -> Mapping[str, np.ndarray]:
        """Return columns of "events" or "curve", as `Record.columns` does."""
        return self.events if group == "events" else self.curve

    def __getitem__(self, name: str) -> float:
        """Return a number of `RUN_COLUMNS`."""
        return float(RUN_COLUMNS[name].find(self))

    @functools.cached_property
    def done(self) -> np.ndarray:
        """(n_events,) whether an event is main and finished."""
        return self.events["is_main"] & self.events["finished"]

    @functools.cached_property
    def sliding(self) -> np.ndarray:
        """Rows of system-size events."""
        return np.flatnonzero(self.done & (self.events["L_p_over_L"] == 1))

    @functools.cached_property
    def precursors(self) -> np.ndarray:
        """Rows of precursors before the first system-size event."""
        rows = np.flatnonzero(self.done & self.events["is_precursor"])
        return rows[rows < self.sliding[0]] if len(self.sliding) else rows


class _Columns(Mapping[str, np.ndarray]):
    """Columns of events, each computed at its first access."""

    def __init__(self, find: Callable[[str], np.ndarray]) -> None:
        self._find = functools.cache(find)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._find(name)

    def __len__(self) -> int:
        return len(EVENT_COLUMNS)

    def __iter__(self) -> Iterator[str]:
        return iter(EVENT_COLUMNS)


def _first(values: np.ndarray) -> float:
    return float(values[0]) if len(values) else math.nan


# --- numbers -------------------------------------------------------------------------------------


@run_column("1", "number of events")
def n_events(run: Outline) -> float:
    return len(run.events["t_start"])


@run_column("1", "number of events of at least 4 blocks")
def n_main_events(run: Outline) -> float:
    return run.events["is_main"].sum()


@run_column("1", "number of precursors before the first system-size event")
def n_precursors(run: Outline) -> float:
    return len(run.precursors)


@run_column("N", "static force at which the first main event starts")
def F_first(run: Outline) -> float:
    return _first(run.events["F_T_start"][run.events["is_main"]])


@run_column("N", "largest force of the loading curve")
def F_max(run: Outline) -> float:
    return run.curve["F_T"].max()


@run_column("1", "longest precursor before the first system-size event, over L")
def L_p_max(run: Outline) -> float:
    lengths = run.events["L_p_over_L"][run.precursors]
    return lengths.max() if len(lengths) else math.nan


@run_column("s", "start of the first system-size event")
def t_slide(run: Outline) -> float:
    return _first(run.events["t_start"][run.sliding])


@run_column("N", "static force at which the first system-size event starts: the strength")
def F_slide(run: Outline) -> float:
    return _first(run.events["F_T_start"][run.sliding])


@run_column("s", "start of the first main event")
def t_first(run: Outline) -> float:
    return _first(run.events["t_start"][run.events["is_main"]])


@run_column("m", "distance of the first slip of the first main event from the trailing edge")
def x_first(run: Outline) -> float:
    return _first(run.events["x_nucleation"][run.events["is_main"]])


@run_column("1", "blocks that slip in the first main event")
def n_blocks_first(run: Outline) -> float:
    return _first(run.events["n_blocks"][run.events["is_main"]])


@run_column("1", "length of the first precursor, over L")
def L_p_first(run: Outline) -> float:
    return _first(run.events["L_p_over_L"][run.precursors])


@run_column("N", "static force at which the first precursor starts")
def F_precursor(run: Outline) -> float:
    return _first(run.events["F_T_start"][run.precursors])


@run_column("N", "largest drop of the static force in an event")
def drop_max(run: Outline) -> float:
    drops = (run.events["F_T_start"] - run.events["F_T_arrest"])[run.events["finished"]]
    return drops.max() if len(drops) else math.nan


@run_column("1", "number of system-size events")
def n_system_size(run: Outline) -> float:
    return len(run.sliding)


@run_column("s", "mean time between system-size events")
def recurrence(run: Outline) -> float:
    waits = np.diff(run.events["t_start"][run.sliding])
    return waits.mean() if len(waits) else math.nan


@run_column("m2", "potency of all finished events")
def potency(run: Outline) -> float:
    return run.events["potency"][run.events["finished"]].sum()


@run_column("1", "b-value of the potency of finished events, from the most frequent bin on")
def b(run: Outline) -> float:
    size = run.events["potency"][run.events["finished"]]
    m = np.log10(size[size > 0])
    try:
        return b_value(m[m >= (m_c := most_frequent(m))], m_c)[0] if len(m) else math.nan
    except SceneError:  # too few events of different size
        return math.nan
