"""Measured errors of a run: two records of one scene, compared event by event.

Each main event of one record is paired with an event of the other record (`pairing`). If neither
record has main events, all events are paired. A partner may begin after the end of the shorter run.

The comparison ends at the start of the first event that one run has and the other run has not
reached by its end. The error of this event is at least the force by which the other run is below
its start force. The comparison also ends at an event in which blocks slip many times (`AGAIN`) and
the two runs differ.

A pause near `t_gap` may split one event in two. An event that begins during the last event of the
other run is therefore taken as a part of that last event. An event that has not ended in one of the
runs is compared up to the end of the shorter run. For such an event, forces during the event are
compared instead of arrest forces. Front speeds are compared at blocks whose five rupture times are
known in both runs. A prescribed interface has no forces, so rupture times are compared. If nothing
slips in either run, only the loading curves are compared.

Errors of lengths, front speeds and arrest forces belong to one event. The error of a start force
contains the errors of stresses after all earlier events.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.record.analysis import mean_force
from pyfric.record.catalogue import parts
from pyfric.record.data import RecordData
from pyfric.record.measured import FORCES, PROMISED
from pyfric.record.pairing import event_distances, in_order, pace
from pyfric.record.rupture import five_known, front_speed
from pyfric.values import SceneError

SAME = 0.5
"""Smallest share of common blocks with which events are paired if the true partner may begin after
the end of the other run. A policy."""
AGAIN = 2.0
"""Mean number of slips of a block in an event, above which the outcome of an event that differs
between two runs is unknown. In the paper's scenes the number is at most 1.12. A policy."""
BLOCKS = ("n_blocks", "first_block", "last_block", "L_p_over_L")
"""Columns of events that depend on which blocks slip."""
BY_EVENT = ("start", "arrest", "length", "stress", "rupture")
"""Differences with one value for each pair of events."""
MARKS = ("turned", "open")
"""Flags of each pair of events."""


class Differences(NamedTuple):
    """Differences of two runs: tables of pairs of events and of front speeds.

    Attributes:
        events: number of the event in each run (0 for none), t_start (s), and the differences
            `BY_EVENT`, NaN if unknown. `turned` is 1 if different blocks slip, if a block slips a
            different number of times, or if the event has ended in one run alone. `own` is False
            for main events that only the other run has.
        speeds: event, t_start (s) and error.
        curve: if nothing slips in either run, largest difference of forces over F_N, and number of
            points compared; () otherwise.
        covered: end of the comparison, s.
    """

    events: pd.DataFrame
    speeds: pd.DataFrame
    curve: tuple[float, int] | tuple[()]
    covered: float

    @property
    def turned(self) -> bool:
        """Whether slip differs in any event; errors then do not decrease as a power of dt."""
        return bool((self.events["turned"] > 0).any())

    @property
    def open(self) -> pd.Series:
        """Whether the error of each event may be larger than its difference, shape (n,)."""
        return self.events["open"] > 0

    @property
    def lacking(self) -> pd.Series:
        """Whether each event is missing in one run because this run ends too early, shape (n,)."""
        return self.open & ((self.events["event"] == 0) | (self.events["other"] == 0))

    def before(self, t: float) -> Differences:
        """Return the differences of events that start before a time, in s."""
        kept = (table[table["t_start"] < t] for table in (self.events, self.speeds))
        return Differences(*kept, self.curve, min(self.covered, t))

    def beyond(self, tolerance: float, want: str | None = None) -> pd.DataFrame:
        """Return the rows of `events` in which a difference exceeds a tolerance.

        With `want="front_speed"`, rows of events whose lengths differ are included.
        """
        if want == "front_speed":
            by_event = self.speeds.groupby("event")["error"].quantile(0.95)
            off = self.events["event"].isin(by_event.index[by_event > tolerance])
            return self.events[off | (self.events["length"] > 0)]
        names = PROMISED.get(want or "", FORCES)
        if self.events[list(FORCES)].isna().all(axis=None):
            names = ("rupture",)
        return self.events[(self.events[list(names)] > tolerance).any(axis=1)]

    def errors(self, factor: float = 1.0) -> dict[str, Any]:
        """Return the differences, times a factor, as fields of `Errors`."""
        values = {name: self.events[name].dropna().to_numpy() for name in BY_EVENT}
        speeds, found = self.speeds["error"].to_numpy(), {}
        for name, known in values.items():
            found[name] = float(factor * known.max()) if known.size else None
        for name, share in (("speed_median", 0.5), ("speed_95", 0.95), ("speed_worst", 1.0)):
            found[name] = float(factor * np.quantile(speeds, share)) if speeds.size else None
            values[name] = speeds
        compared = {name: len(known) for name, known in values.items() if len(known)}
        if self.curve:
            found["curve"], compared["curve"] = factor * self.curve[0], self.curve[1]
        events = int((self.events["own"] & (self.events["event"] > 0)).sum())
        return found | {"compared": compared, "events": events, "covered": self.covered}


def differences(record: RecordData, other: RecordData, until: float = math.inf) -> Differences:
    """Return the differences of two runs of a scene.

    Args:
        record, other: the runs.
        until: the comparison ends at this time (s), or at the end of the shorter run.

    Raises:
        SceneError: the runs have different numbers of blocks.
    """
    if other.scene.N_x != (N_x := record.scene.N_x):
        raise SceneError("other", other.scene.N_x, "", f"a run with {N_x} blocks", "other blocks")
    covered = min(until, *(float(run.curve["t"].iloc[-1]) for run in (record, other)))
    own, speeds = _Pairs(record, other, covered).rows()
    others, _ = _Pairs(other, record, covered).rows()
    rows: dict[tuple[int, int], dict[str, float]] = {}
    for mine, found in ((True, own), (False, others)):
        for (e, k), row in found.items():
            pair = (e, k) if mine else (k, e)
            before = rows.setdefault(pair, row | {"own": False})
            before |= {name: np.fmax(before[name], row[name]) for name in (*BY_EVENT, *MARKS)}
            before["own"] |= mine
    columns = "event", "other", "t_start", *BY_EVENT, *MARKS, "own"
    values = ([e, k, *(row[name] for name in columns[2:])] for (e, k), row in rows.items())
    events = pd.DataFrame(list(values), columns=columns).astype({"event": int, "other": int})
    begin, curve = float(record.curve["t"].iloc[0]), ()
    if not rows and record.scene.driver.K and covered > begin:
        curve = _curves_apart(record, other, covered)
    covered = float(np.fmin(covered, events["t_start"][events["open"] > 0].min()))
    return Differences(events, speeds, curve, covered)


Event = dict[str, Any]
"""A row of the table of events."""


class _Pairs:
    """Main events of a run a, each with its partner among the events of a run b."""

    def __init__(self, a: RecordData, b: RecordData, covered: float) -> None:
        self.a, self.b, self.covered = a, b, covered
        ours = a.events[a.events["t_start"] <= covered]
        theirs = b.events["is_main"][b.events["t_start"] <= covered]
        any_main = ours["is_main"].any() or theirs.any()
        self.ours = ours[ours["is_main"] | (not any_main)]
        later = b.events["is_main"] & (b.events["t_start"] > covered)
        self.theirs = b.events[later.cumsum() <= 1]  # up to the next main event
        self.events, self.partners = (
            dict(zip(table.index.tolist(), table.to_dict("records"), strict=True))
            for table in (self.ours, self.theirs)
        )
        self.force = float(np.interp(covered, b.curve["t"], b.curve["F_T"]))

    def rows(self) -> tuple[dict[tuple[int, int], dict[str, float]], pd.DataFrame]:
        """Return differences of events by pairs of numbers, and differences of front speeds."""
        rows, speeds = {}, [np.zeros((3, 0))]
        unknown = dict.fromkeys(BY_EVENT, np.nan) | dict.fromkeys(MARKS, 0.0)
        for e, k in self._chosen():
            row, off = self._pair(e, k) if k else (self._alone(e), np.zeros(0))
            begin = self.events[e]["t_start"]
            rows[e, k] = unknown | row | {"t_start": begin}
            speeds.append(np.array([np.full(len(off), e), np.full(len(off), begin), off]))
        return rows, pd.DataFrame(np.hstack(speeds).T, columns=["event", "t_start", "error"])

    def _chosen(self) -> list[tuple[int, int]]:
        """Return the numbers of the events of run a, each with the number of its partner in run b.

        The number is 0 if run b ends before the partner begins.
        """
        cost = event_distances(self.ours, self.theirs, self.a.scene, self.covered)
        late = (self.covered - self.ours["t_start"].to_numpy()) * pace(self.a.scene, self.covered)
        off = np.abs(self.ours["F_T_start"].to_numpy() - self.force) / self.a.scene.F_N
        never = SAME + late + np.nan_to_num(off)
        i, j = in_order(np.hstack([cost, np.repeat(never[:, None], len(never), axis=1)]))
        ours, theirs = list(self.events), [*self.partners, *[0] * len(never)]
        return [(ours[e], theirs[k]) for e, k in zip(i.tolist(), j.tolist(), strict=True)]

    def _pair(self, e: int, k: int) -> tuple[dict[str, float], np.ndarray]:
        """Return the differences of event e of run a and event k of run b, and of front speeds."""
        event, partner = self.events[e], self.partners[k]
        ended = bool(event["finished"] and partner["finished"])
        F_N, start = self.a.scene.F_N, event["F_T_start"] - partner["F_T_start"]
        arrest = event["F_T_arrest"] - partner["F_T_arrest"]
        arrest = arrest if ended else self._going_on(event, partner)
        row = {
            "start": abs(start) / F_N,
            "arrest": abs(arrest) / F_N if np.isfinite(start) else np.nan,
            "length": abs(event["L_p_over_L"] - partner["L_p_over_L"]) if ended else np.nan,
            "stress": self._stress(e, k, ended),
            "rupture": self._rupture(e, k, forces=bool(np.isfinite(start)), ended=ended),
            "turned": (turned := self._turned(event, partner, ended)),
        }
        again = max(each["n_episodes"] / each["n_blocks"] for each in (event, partner))
        return row | {"open": turned and again > AGAIN}, self._speeds(e, k, ended)

    def _turned(self, event: Event, partner: Event, ended: bool) -> bool:
        """Return whether two events differ in the blocks that slip, or only one event has ended.

        Two unfinished events are compared by their numbers of episodes.
        """
        off = event["n_episodes"] != partner["n_episodes"]
        off &= event["finished"] == partner["finished"]
        if ended:
            off |= any(event[name] != partner[name] for name in BLOCKS)
        return bool(off or self._outlasts(event, partner) or self._outlasts(partner, event))

    def _outlasts(self, event: Event, partner: Event) -> bool:
        """Return whether an event has not ended, but its partner has ended within both runs."""
        ended = partner["finished"] and parts(self.covered - partner["t_stop"], self.a.method.t_gap)
        return bool(ended and not event["finished"])

    def _alone(self, e: int) -> dict[str, float]:
        """Return differences, or lower bounds, for an event of run a without partner in run b."""
        a, b, event, F_N = self.a, self.b, self.events[e], self.a.scene.F_N
        begun = (other for other in self.partners.values() if other["t_start"] < event["t_start"])
        if any(not other["finished"] for other in begun):
            end = event["t_stop"] if event["finished"] else a.curve["t"].iloc[-1]
            known = np.isfinite(event["F_T_start"])
            return {"arrest": _apart(a, b, event["t_start"], end) / F_N if known else np.nan}
        if np.isfinite(event["F_T_start"]):
            return {"start": abs(event["F_T_start"] - self.force) / F_N, "open": True}
        times = a.rupture_times[e - 1]
        span = np.ptp(times[np.isfinite(times)]) if np.isfinite(times).any() else 0.0
        late = self.covered - event["t_start"]
        return {"rupture": late / span if span > 0 else np.nan, "open": True}

    def _going_on(self, event: Event, partner: Event) -> float:
        """Return the difference of forces in an event that has not ended in a run, in N.

        If slip has stopped in both runs, return the difference of arrest forces.
        """
        if np.maximum(event["t_stop"], partner["t_stop"]) <= self.covered:
            return float(event["F_T_arrest"] - partner["F_T_arrest"])
        ends = (
            event["t_stop"] if event["finished"] else run.curve["t"].iloc[-1]
            for run, event in ((self.a, event), (self.b, partner))
        )
        begin, other = event["t_start"], partner["t_start"]
        lasts = min(end - start for end, start in zip(ends, (begin, other), strict=True))
        return _apart(self.a, self.b, begin, begin + lasts, other - begin)

    def _of_both(self, name: str, e: int, k: int) -> tuple[np.ndarray, np.ndarray]:
        return self.a.arrays[name][e - 1], self.b.arrays[name][k - 1]

    def _stress(self, e: int, k: int, ended: bool) -> float:
        """Return the largest root mean square of differences of tau and p, over F_N/N_x."""
        moments = ("before", "after") if ended else ("before",)
        names = [f"{name}_{when}" for when in moments for name in ("tau", "p")]
        off = [np.sqrt(np.mean(np.subtract(*self._of_both(name, e, k)) ** 2)) for name in names]
        return float(np.fmax.reduce(off)) * self.a.scene.N_x / self.a.scene.F_N

    def _rupture(self, e: int, k: int, *, forces: bool, ended: bool) -> float:
        """Return the root mean square difference of rupture times, over the duration of the front.

        If forces are compared, the mean difference is subtracted, because start forces contain it.
        If the event has ended in both runs, a block that only one front has passed counts as 1.
        """
        t, other = self._of_both("rupture_times", e, k)
        known, others = np.isfinite(t), np.isfinite(other)
        if not (known.any() and others.any()):
            return np.nan
        both, alone = known & others, int((known ^ others).sum()) if ended else 0
        lasts = min(np.ptp(t[both]), np.ptp(other[both])) if both.any() else 0.0
        if not lasts > 0:
            return 1.0 if alone else np.nan
        off = (t - other)[both]
        off -= off.mean() if forces else 0.0
        square = np.sum((off / np.ptp(other[both])) ** 2)
        return float(np.sqrt((square + alone) / (len(off) + alone)))

    def _speeds(self, e: int, k: int, ended: bool) -> np.ndarray:
        """Return relative differences of front speeds, |v - w| over the larger speed.

        Blocks are compared if both runs have their five rupture times. If the event has ended in
        both runs, blocks with a speed in one run alone are compared too, and count as 1.
        """
        times, scene = self._of_both("rupture_times", e, k), self.a.scene
        v, w = (front_speed(t, scene.slider.l, scene.ahead) for t in times)
        compared = np.isfinite(v) | np.isfinite(w)
        if not ended:
            compared &= five_known(times[0]) & five_known(times[1])
        v, w = v[compared], w[compared]
        off = np.abs(v - w) / np.maximum(v, w)
        return np.where(np.isfinite(off), off, 1.0)


def _apart(a: RecordData, b: RecordData, begin: float, end: float, later: float = 0.0) -> float:
    """Return the largest certain difference of forces of two runs between two times, in N.

    Times of run b are `later` (s) than times of run a. Between samples, a force may lie anywhere in
    the range of the two samples before and the two samples after.
    """
    t = a.curve["t"].to_numpy()
    t = t[(t >= begin) & (t <= end)]
    (low, high), (lowest, highest) = _range(a, t), _range(b, t + later)
    return float(np.maximum(low - highest, lowest - high).max(initial=0.0))


def _curves_apart(a: RecordData, b: RecordData, end: float) -> tuple[float, int]:
    """Return the largest difference of forces without slip, over F_N, and the number of points.

    Forces are compared at the points of the run with fewer points. Jumps between static states,
    with two points at one time, are left out.
    """
    coarse, fine = sorted((a.curve, b.curve), key=len)
    t = coarse["t"][(coarse["t"] <= end) & ~coarse["t"].duplicated(keep=False)]
    t = np.union1d(t, end)
    off = np.abs(np.subtract(*(np.interp(t, c["t"], c["F_T"]) for c in (coarse, fine))))
    return float(off.max()) / a.scene.F_N, len(t)


def _range(record: RecordData, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and largest force (N) of two samples before and two after each time."""
    when, force = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    near = np.searchsorted(when, t)[:, None] + np.arange(-2, 2)
    near = force[np.clip(near, 0, len(force) - 1)]
    return near.min(axis=1), near.max(axis=1)


def statistics(record: RecordData, other: RecordData, t: float) -> dict[str, tuple[float, float]]:
    """Return means over events after a time (s) by name, with their difference between runs."""
    covered = min(float(run.curve["t"].iloc[-1]) for run in (record, other))
    a, b = (_together(run, t, covered) for run in (record, other))
    return {name: (a[name], abs(a[name] - b[name])) for name in a if name in b}


def _together(record: RecordData, t: float, covered: float) -> dict[str, float]:
    F_N, events = record.scene.F_N, record.events
    late = events[events["is_main"] & (events["t_start"] >= t) & (events["t_start"] <= covered)]
    begin = min(max(t, float(record.curve["t"].iloc[0])), covered)
    mean = mean_force(record, begin, covered) / F_N
    found = {"mean F_T/F_N": mean, "main events": float(len(late))}
    for name, column, unit in (
        ("mean start/F_N", "F_T_start", F_N),
        ("mean arrest/F_N", "F_T_arrest", F_N),
        ("mean L_p/L", "L_p_over_L", 1.0),
    ):
        values = late[column].dropna()
        if len(values):
            found[name] = float(values.mean() / unit)
    return found
