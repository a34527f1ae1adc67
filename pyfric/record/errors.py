"""Measured errors of a run: two records of one scene, compared event by event.

Each main event of either record (each event, where there are no main ones) is paired with an event
of the other one, in order, at the least total cost (`paired`). An event that the other run would
have had after its end is compared with the force that this one reached; one that begins while the
last event of the other run goes on to the end is part of that: a pause near `t_gap` parts them.
Where an event goes on in one of the runs, the forces on the way are compared in place of arrests.

What is local stays with its event: lengths, front speeds, arrest. Start forces hang on the stresses
that all earlier events left.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.record.rupture import front_speed

if TYPE_CHECKING:
    from pyfric.record.record import Record

__all__ = ["Differences", "Errors", "differences", "paired", "statistics"]

BLOCK = 0.1
"""Weight of a difference of blocks over N_x beside one of forces over F_N, where events are paired.
"""
LOST = 1.0
"""Relative error of a front speed that only one of two runs has."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """What a run may be off by, measured by runs that leave out less, or more, than it does.

    Forces are over F_N and of main events, lengths over L, stresses over F_N/N_x (root mean square
    over the interface), front speeds relative. Each is the largest one, but for the median and the
    95th percentile of front speeds. None stands for what there was nothing of. `arrest` holds also
    what forces of events that go on to the end are apart.

    Attributes:
        want, tolerance, expected: of the plan; None where there was none.
        start, arrest, length, stress, speed_median, speed_95, speed_worst: measured errors.
        events: main events that were compared.
        covered: time up to which they were, s.
        until: time from which on single events cannot be trusted, s; None if there is no such time.
        statistics: what holds for the events after that, together: name to value and error.
        by: what the run was compared with.
    """

    want: str | None = None
    tolerance: float | None = None
    expected: float | None = None
    start: float | None = None
    arrest: float | None = None
    length: float | None = None
    stress: float | None = None
    speed_median: float | None = None
    speed_95: float | None = None
    speed_worst: float | None = None
    events: int = 0
    covered: float = 0.0
    until: float | None = None
    statistics: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    by: tuple[str, ...] = ()

    def measured(self, want: str | None = None) -> float:
        """Return the error that a tolerance bounds: what is wanted decides (`PROMISED`)."""
        names = PROMISED.get(want or self.want or "", FORCES)
        return max(
            (value for name in names if (value := getattr(self, name)) is not None), default=0.0
        )

    @property
    def holds(self) -> bool:
        """Whether the measured error is within the tolerance."""
        return self.tolerance is None or self.measured() <= self.tolerance

    def __str__(self) -> str:
        def number(value: float | None) -> str:
            return "-" if value is None else f"{value:.2g}"

        forces = f"start {number(self.start)}, arrest {number(self.arrest)}"
        speeds = " / ".join(map(number, (self.speed_median, self.speed_95, self.speed_worst)))
        lines = [
            f"measured errors ({self.events} main events, to {self.covered:.6g} s): {forces} F_N, "
            f"length {number(self.length)} L, stress {number(self.stress)} F_N/N_x, front speed "
            f"{speeds} (median / 95 % / worst)"
        ]
        if self.expected is not None:
            verdict = "within" if self.holds else "BEYOND"
            lines.append(
                f"for {self.want}: expected {self.expected:.2g}, measured {self.measured():.2g}, "
                f"{verdict} {self.tolerance:g}"
            )
        if self.until is not None:
            lines.append(f"single events cannot be trusted from {self.until:.6g} s on")
            lines += [f"  {k}: {v:.4g} +- {e:.2g}" for k, (v, e) in self.statistics.items()]
        return "\n".join([*lines, *(f"by {one}" for one in self.by)])

    def to_json(self) -> dict[str, Any]:
        """Return what a file keeps."""
        return dataclasses.asdict(self) | {"statistics": dict(self.statistics)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Errors:
        """Return what a file kept."""
        pairs = {name: (float(a), float(b)) for name, (a, b) in values["statistics"].items()}
        return cls(**dict(values) | {"statistics": pairs, "by": tuple(values["by"])})


FORCES = ("start", "arrest")
PROMISED = {"stress": (*FORCES, "stress"), "front_speed": ("speed_95",)}
"""What is wanted -> the errors that its tolerance bounds; `FORCES` for all else."""


class Differences(NamedTuple):
    """How far apart two runs are: one row for each pair of events, one for each front speed.

    Attributes:
        events: t_start (s), start, arrest, length, stress; NaN where there is nothing to compare.
        speeds: t_start of the event (s) and error.
        covered: time up to which both runs go, s.
    """

    events: pd.DataFrame
    speeds: pd.DataFrame
    covered: float

    @property
    def turned(self) -> bool:
        """Whether an event ends at another block: such differences have no order in the step."""
        return bool((self.events["length"] > 0).any())

    def before(self, t: float) -> Differences:
        """Return the differences of events that start before a time, in s."""
        kept = (one[one["t_start"] < t] for one in (self.events, self.speeds))
        return Differences(*kept, min(self.covered, t))

    def parted(self, tolerance: float, want: str | None = None) -> float | None:
        """Return the start of the first event that is further apart than this, s."""
        if want == "front_speed":
            by_event = self.speeds.groupby("t_start")["error"].quantile(0.95)
            off = by_event.index[by_event > tolerance]
        else:
            names = list(PROMISED.get(want or "", FORCES))
            off = self.events.loc[(self.events[names] > tolerance).any(axis=1), "t_start"]
        return float(off.min()) if len(off) else None

    def errors(self, factor: float = 1.0) -> dict[str, Any]:
        """Return the differences as fields of `Errors`, times a factor."""
        found: dict[str, Any] = {}
        for name in ("start", "arrest", "length", "stress"):
            found[name] = _of(self.events[name], np.max, factor)
        speeds = self.speeds["error"]
        found["speed_median"] = _of(speeds, np.median, factor)
        found["speed_95"] = _of(speeds, lambda one: np.quantile(one, 0.95), factor)
        found["speed_worst"] = _of(speeds, np.max, factor)
        return found | {"events": int(self.events["own"].sum()), "covered": self.covered}


def _of(values: pd.Series, number: Any, factor: float) -> float | None:
    values = values.dropna().to_numpy()
    return float(factor * number(values)) if len(values) else None


def differences(record: Record, other: Record) -> Differences:
    """Return how far two runs of a scene are apart, up to where the shorter one ends."""
    covered = min(float(one.curve["t"].iloc[-1]) for one in (record, other))
    own, speeds = _rows(record, other, covered)
    its, _ = _rows(other, record, covered)
    events = pd.concat([own.assign(own=True), its.assign(own=False)], ignore_index=True)
    return Differences(events, speeds, covered)


def _rows(a: Record, b: Record, covered: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return differences of the main events of a from events of b, and of their front speeds."""
    scene, F_N, N_x = a.scene, a.scene.F_N, a.scene.N_x
    some = a.events["is_main"].any() or b.events["is_main"].any()
    ours = a.events[(a.events["is_main"] | (not some)) & _known(a, covered)]
    theirs = b.events[_known(b, covered)]
    later = _later(b, covered)
    rate = scene.driver.K * scene.driver.V / F_N
    cost = np.abs(np.subtract.outer(_column(ours, "F_T_start"), _column(theirs, "F_T_start"))) / F_N
    cost += rate * np.abs(np.subtract.outer(_column(ours, "t_start"), _column(theirs, "t_start")))
    for name in ("first_block", "last_block"):
        apart = np.abs(np.subtract.outer(_column(ours, name), _column(theirs, name)))
        cost += BLOCK / N_x * apart
    never = np.abs(_column(ours, "F_T_start") - later) / F_N
    never += rate * np.abs(covered - _column(ours, "t_start"))
    cost = np.hstack([cost, np.repeat(never[:, None], len(ours), axis=1)])
    i, j = paired(cost)
    rows, speeds = [], []
    for e, k in zip(ours.index[i], j, strict=True):
        row, v = _pair(a, b, e, theirs.index[k]) if k < len(theirs) else _no_pair(a, b, e, later)
        rows.append(row)
        speeds.append(pd.DataFrame({"t_start": row["t_start"], "error": v}))
    names = ["t_start", "start", "arrest", "length", "stress"]
    empty = pd.DataFrame({"t_start": np.zeros(0), "error": np.zeros(0)})
    table = pd.DataFrame(rows, columns=names, dtype=float)
    return table, pd.concat(speeds, ignore_index=True) if speeds else empty


def _known(record: Record, covered: float) -> pd.Series:
    events = record.events
    return np.isfinite(events["F_T_start"]) & (events["t_start"] <= covered)


def _column(events: pd.DataFrame, name: str) -> np.ndarray:
    return events[name].to_numpy(dtype=float)


def _later(record: Record, covered: float) -> float:
    """Return the force of a run at a time, in N."""
    return float(np.interp(covered, record.curve["t"], record.curve["F_T"]))


def _pair(a: Record, b: Record, e: int, k: int) -> tuple[dict[str, float], np.ndarray]:
    """Return the differences of event e of a from event k of b, and those of front speeds."""
    scene, one, two = a.scene, a.events.loc[e], b.events.loc[k]
    F_N, N_x = scene.F_N, scene.N_x
    ended = bool(one["finished"] and two["finished"])
    arrest = one["F_T_arrest"] - two["F_T_arrest"] if ended else _going_on(a, b, one, two)
    row = {
        "t_start": float(one["t_start"]),
        "start": abs(one["F_T_start"] - two["F_T_start"]) / F_N,
        "arrest": abs(arrest) / F_N,
        "length": abs(one["L_p_over_L"] - two["L_p_over_L"]) if ended else np.nan,
        "stress": np.nan,
    }
    moments = ("before", "after") if ended else ("before",)
    off = [
        getattr(a, f"{name}_{when}")[e] - getattr(b, f"{name}_{when}")[k]
        for when in moments
        for name in ("tau", "p")
    ]
    row["stress"] = max(float(np.sqrt(np.mean(one**2))) for one in off) * N_x / F_N
    return row, _speeds(a, b, e, k) if ended else np.zeros(0)


def _going_on(a: Record, b: Record, one: pd.Series, two: pd.Series) -> float:
    """Return how far forces are apart in an event that goes on in one of two runs, in N.

    NaN where both have come to rest, too late to know whether they go on.
    """
    if not (one["finished"] or two["finished"] or np.isnan(one["t_stop"] + two["t_stop"])):
        return np.nan
    ends = (
        e["t_stop"] if e["finished"] else r.curve["t"].iloc[-1] for r, e in ((a, one), (b, two))
    )
    begin, other = one["t_start"], two["t_start"]
    lasts = min(end - start for end, start in zip(ends, (begin, other), strict=True))
    return _apart(a, b, begin, begin + lasts, other - begin)


def _apart(a: Record, b: Record, begin: float, end: float, later: float = 0.0) -> float:
    """Return how far forces of two runs are apart between two times, in N, as far as samples tell.

    The other run is so much later, in s. Between samples a force may be anywhere in the range of
    the two before and the two after.
    """
    t = a.curve["t"].to_numpy()
    t = t[(t >= begin) & (t <= end)]
    (low, high), (least, most) = _range(a, t), _range(b, t + later)
    return float(np.maximum(low - most, least - high).max(initial=0.0))


def _range(record: Record, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest force, in N, of the two samples before and after times."""
    when, force = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    near = np.searchsorted(when, t)[:, None] + np.arange(-2, 2)
    near = force[np.clip(near, 0, len(force) - 1)]
    return near.min(axis=1), near.max(axis=1)


def _speeds(a: Record, b: Record, e: int, k: int) -> np.ndarray:
    """Return relative differences of front speeds at the blocks that have one in either run."""
    l, d = a.scene.slider.l, a.scene.d
    v, w = (front_speed(one.rupture_times[n], l, d) for one, n in ((a, e), (b, k)))
    either = np.isfinite(v) | np.isfinite(w)
    off = np.abs(v[either] / w[either] - 1)
    return np.where(np.isfinite(off), off, LOST)


def _no_pair(a: Record, b: Record, e: int, later: float) -> tuple[dict[str, float], np.ndarray]:
    """Return what is known of an event that the other run has not had yet, or has in another."""
    one, F_N = a.events.loc[e], a.scene.F_N
    row = {"t_start": float(one["t_start"])} | dict.fromkeys(("length", "stress"), np.nan)
    if (~b.events["finished"] & (b.events["t_start"] < one["t_start"])).any():
        end = one["t_stop"] if one["finished"] else a.curve["t"].iloc[-1]
        part = {"start": np.nan, "arrest": _apart(a, b, one["t_start"], end) / F_N}
        return row | part, np.zeros(0)
    start = abs(one["F_T_start"] - later) / F_N
    return row | {"start": start, "arrest": np.nan}, np.zeros(0)


def statistics(record: Record, other: Record, t: float) -> dict[str, tuple[float, float]]:
    """Return numbers of the events after a time (s) together, each with its difference."""
    covered = min(float(one.curve["t"].iloc[-1]) for one in (record, other))
    a, b = (_together(one, t, covered) for one in (record, other))
    return {name: (a[name], abs(a[name] - b[name])) for name in a if name in b}


def _together(record: Record, t: float, covered: float) -> dict[str, float]:
    F_N, events = record.scene.F_N, record.events
    late = events[events["is_main"] & (events["t_start"] >= t) & (events["t_start"] <= covered)]
    when = np.linspace(t, covered, 1001)
    force = np.interp(when, record.curve["t"], record.curve["F_T"])
    found = {"mean F_T/F_N": float(force.mean() / F_N), "main events": float(len(late))}
    for name, column, unit in (
        ("mean start/F_N", "F_T_start", F_N),
        ("mean arrest/F_N", "F_T_arrest", F_N),
        ("mean L_p/L", "L_p_over_L", 1.0),
    ):
        values = late[column].dropna()
        if len(values):
            found[name] = float(values.mean() / unit)
    return found


def paired(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pairs, in order, that cover the shorter side at least total cost.

    An event of four blocks in one engine may have three in the other, where it is no main event.
    """
    n, m = cost.shape
    if n > m:
        return paired(cost.T)[::-1]
    least = np.full((n + 1, m + 1), np.inf)  # of the first rows, among the first columns
    least[0] = 0.0
    for i in range(n):
        least[i + 1, 1:] = np.minimum.accumulate(least[i, :-1] + cost[i])
    chosen, j = np.zeros(n, dtype=int), m
    for i in range(n - 1, -1, -1):
        j = int(np.argmin(least[i, :j] + cost[i, :j]))
        chosen[i] = j
    return np.arange(n), chosen
