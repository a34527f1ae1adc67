"""Lengths of precursors and arrivals of fronts: measured, in a model, and their differences.

Lengths are compared as a curve of L_p/L against F_T/F_N, so that precursors need no matching. The
model's curve is linear between its precursors. The curve begins at L_p = 0 without load, and ends
at the force at which the whole interface first slips. Arrivals are compared in matched events. The
mean difference in an event is subtracted, because the absolute time of an event is arbitrary.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from pyfric.fitting.measurement import CAP, ROWS, At, Measurement, measurement
from pyfric.fitting.of_events import LONGER, Events
from pyfric.record import Record, precursor_lengths, system_size_events
from pyfric.scene import Number
from pyfric.values import SceneError, check_number

LENGTHS = {"force": "F_T/F_N after arrest", "L_p_over_L": "length", "error": "its standard error"}
ARRIVALS = {
    "event": "number in the table of events",
    "x": "place of a sensor from the trailing edge, m",
    "t": "arrival there, s; only differences within an event count",
    "error": "its standard error, s",
}
"""Column of a table of arrivals -> its meaning; `LENGTHS` is for a table of lengths."""


def lengths_of(record: Record) -> pd.DataFrame:
    """Return the curve of lengths of a run: force (F_T/F_N, rising) and L_p_over_L."""
    found, sliding = precursor_lengths(record), system_size_events(record)
    points = list(zip(found["force"], found["L_p_over_L"], strict=True))
    if len(sliding):
        first = int(sliding["event"].iloc[0])
        points.append((record.events["F_T_start"].loc[first] / record.scene.F_N, 1.0))
    table = pd.DataFrame([(0.0, 0.0), *points], columns=["force", "L_p_over_L"])
    table["force"] = table["force"].cummax()
    return table


def lengths_off(
    measured: pd.DataFrame, model: pd.DataFrame, spacing: float, tolerance: float = 0.0
) -> np.ndarray:
    """Return differences of lengths in standard deviations, shape (n,).

    Args:
        measured: lengths with columns as in `LENGTHS`.
        model: the curve from `lengths_of`.
        spacing: distance of blocks over L. The spacing is an error of the model, because an arrest
            may move by a block.
        tolerance: standard deviation of the model's forces, over F_N.
    """
    force, length = (measured[name].to_numpy() for name in ("force", "L_p_over_L"))
    found = np.interp(force, model["force"], model["L_p_over_L"])
    slope = np.ptp(length) / np.ptp(force) if np.ptp(force) > 0 else 0.0
    error = np.hypot(np.hypot(measured["error"], spacing), slope * tolerance)
    return np.clip((found - length) / error.to_numpy(), -CAP, CAP)


def fronts_of(record: Record) -> dict[float, np.ndarray]:
    """Return start of an event (s) -> rupture times of blocks (s, NaN if a block has none)."""
    starts = record.events["t_start"].to_numpy().tolist()
    return dict(zip(starts, record.rupture_times, strict=True))


def arrivals_off(
    measured: pd.DataFrame,
    partner: Mapping[int, float],
    fronts: Mapping[float, np.ndarray],
    l: float,
) -> np.ndarray:
    """Return differences of arrival times in standard deviations, shape (n,).

    Args:
        measured: arrivals with columns as in `ARRIVALS`.
        partner: number of a measured event -> start of the matching event of the model, s.
        fronts: rupture times from `fronts_of`.
        l: distance of blocks, m.

    Returns:
        The differences; `CAP` for a sensor that no front of the model reaches, and for all sensors
        of an unmatched event.
    """
    off = np.full(len(measured), CAP)
    for event, rows in measured.groupby("event").indices.items():
        times = fronts.get(partner.get(event, np.nan))
        if times is None:
            continue
        part = measured.iloc[rows]
        found = np.interp(part["x"], l * np.arange(len(times)), times, left=np.nan, right=np.nan)
        late, weight = found - part["t"].to_numpy(), part["error"].to_numpy() ** -2.0
        seen = np.isfinite(late)
        if seen.any():
            late = late - np.average(late[seen], weights=weight[seen])
            off[rows[seen]] = np.clip((late * np.sqrt(weight))[seen], -CAP, CAP)
    return off


def checked(name: str, table: Any, columns: Mapping[str, str]) -> pd.DataFrame:
    """Return a table of measured lengths or arrivals as numbers, after checks.

    Raises:
        SceneError: a column is missing, a number is not finite, or an error is not above zero.
    """
    allowed = ", ".join(f"{key} ({text})" for key, text in columns.items())
    if not isinstance(table, pd.DataFrame) or (missing := set(columns) - set(table)):
        what = f"no {min(missing)}" if isinstance(table, pd.DataFrame) else type(table).__name__
        raise SceneError(name, what, "", f"a data frame with columns {allowed}", "")
    found = table[list(columns)].reset_index(drop=True)
    numbers = found.to_numpy(dtype=float)
    if not len(found) or not np.isfinite(numbers).all() or not (found["error"] > 0).all():
        allowed = "finite numbers, errors > 0, at least one row"
        raise SceneError(name, None, "", allowed, "a number that is none")
    return found


class _Lengths(NamedTuple):
    """The curve of lengths of a run, and the spacing of its blocks over L."""

    curve: pd.DataFrame
    spacing: float


@measurement
@dataclass(frozen=True, repr=False, init=False)
class Lengths(Measurement):
    """Lengths of precursors in the first loading.

    Args:
        lengths: a table with columns force (F_T/F_N after arrest), L_p_over_L and error.
        t_end: end of the loading, s; None means that another measurement of the experiment gives
            the end.

    Raises:
        SceneError: an argument is refused.
    """

    kind: ClassVar[str] = "lengths"
    lengths: pd.DataFrame
    t_end: float | None

    def __init__(self, lengths: pd.DataFrame, t_end: Number | None = None) -> None:
        object.__setattr__(self, "lengths", checked("lengths", lengths, LENGTHS))
        end = None if t_end is None else check_number("t_end", t_end, "s", gt=0.0)
        object.__setattr__(self, "t_end", end)

    @property
    def duration(self) -> float | None:
        return None if self.t_end is None else LONGER * self.t_end

    @property
    def size(self) -> int:
        return len(self.lengths)

    def seen(self, record: Record) -> _Lengths:
        return _Lengths(lengths_of(record), 1 / record.scene.N_x)

    def residuals(self, seen: _Lengths, at: At) -> np.ndarray:
        return lengths_off(self.lengths, seen.curve, seen.spacing, at.tolerance)

    def overview(self, seen: _Lengths, at: At) -> np.ndarray:
        return lengths_off(self.lengths, seen.curve, seen.spacing)

    def table(self, seen: _Lengths, at: At) -> pd.DataFrame:
        model = np.interp(self.lengths["force"], seen.curve["force"], seen.curve["L_p_over_L"])
        columns = (*(self.lengths[name] for name in LENGTHS), model, self.residuals(seen, at))
        return pd.DataFrame(dict(zip(ROWS, columns, strict=True)))


class _Fronts(NamedTuple):
    """Events of a run, rupture times by the start of the event, and the distance of blocks, m."""

    events: pd.DataFrame
    times: Mapping[float, np.ndarray]
    l: float


@measurement
@dataclass(frozen=True, repr=False, init=False)
class Arrivals(Measurement):
    """Arrivals of fronts at sensors. Only time differences within an event count.

    The engine must resolve fronts: "hybrid" or "dynamic".

    Args:
        arrivals: a table with columns event (number in the table of events), x (m, from the
            trailing edge), t and error (s).
        events: the `Events` of the same experiment.

    Raises:
        SceneError: an argument is refused, or an event is not compared one by one.
    """

    kind: ClassVar[str] = "arrivals"
    engines: ClassVar[tuple[str, ...]] = ("hybrid", "dynamic")
    arrivals: pd.DataFrame
    events: Events

    def __init__(self, arrivals: pd.DataFrame, events: Events) -> None:
        if not isinstance(events, Events):
            allowed = "pyfric.fitting.Events(curve) of the same experiment"
            raise SceneError("events", type(events).__name__, "", allowed, "no events")
        table = checked("arrivals", arrivals, ARRIVALS)
        known = events.one_by_one.index
        if unknown := set(table["event"]) - set(known):
            allowed = f"numbers of events that are compared one by one, {known[0]} to {known[-1]}"
            raise SceneError("arrivals.event", min(unknown), "", allowed, "no such event")
        object.__setattr__(self, "arrivals", table)
        object.__setattr__(self, "events", events)

    @property
    def duration(self) -> float:
        return self.events.duration

    @property
    def size(self) -> int:
        return len(self.arrivals)

    @property
    def of_overview(self) -> int:
        return 0

    @property
    def count(self) -> int:
        return len(self.arrivals) - int(self.arrivals["event"].nunique())

    def seen(self, record: Record) -> _Fronts:
        return _Fronts(self.events.seen(record), fronts_of(record), record.scene.slider.l)

    def residuals(self, seen: _Fronts, at: At) -> np.ndarray:
        partner = self.events.misfit(seen.events, at).partner
        starts = seen.events["t_start"].to_numpy()
        pairs = zip(self.events.one_by_one.index, partner, strict=True)
        known = {event: float(starts[k]) for event, k in pairs if k >= 0}
        return arrivals_off(self.arrivals, known, seen.times, seen.l)

    def overview(self, seen: _Fronts, at: At) -> np.ndarray:
        return np.zeros(0)

    def table(self, seen: _Fronts, at: At) -> pd.DataFrame:
        off, data = self.residuals(seen, at), self.arrivals
        model = data["t"] + off * data["error"]
        columns = (data["x"], data["t"], data["error"], model, off)
        return pd.DataFrame(dict(zip(ROWS, columns, strict=True)))
