"""Events of a loading curve, or of slip at a sensor: one table for measurements and for runs.

An event is a fall of F_T/F_N. In noise, falls are found with the difference D of the means of
``smooth`` samples after and before each sample, minus the rise by loading. The standard deviation
of D is noise sqrt(2/smooth). A fall counts where D is below -`CLEAR` standard deviations. With 8
samples this is 2.5 times the noise, and a fall of 5 times the noise is missed once in three
million.

Means are over the time of ``smooth`` usual steps. Where samples are further apart, means have fewer
samples, at least one, and D has a larger deviation. No falls are found within this time of either
end of the curve.

Forces at both ends of a fall, and their errors, come from robust straight lines through the samples
on either side. A fall below the threshold between these lines is no event; it counts as loading
between events. The time of a sudden fall is uncertain by a step. The rise by loading in this time
is an error of both forces, but not of the drop. A fall in a gap of the samples that is longer than
these lines is no event. The event after such a gap has no recurrence.

Before the search for falls, `noise` checks the samples.

A step of slip is a fall of -slip, with creep in place of loading, and is found in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd

from pyfric.measured.curve import Curve
from pyfric.measured.lines import ROUNDED, robust_lines
from pyfric.measured.noise import check_ends, estimated, outliers
from pyfric.measured.sensors import slips
from pyfric.record import Record
from pyfric.values import SceneError, check_number, check_whole, usage

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

COLUMNS = {
    "t_start": ("s", "last time before the fall"),
    "t_stop": ("s", "first time after it"),
    "peak": ("1", "F_T/F_N at t_start"),
    "valley": ("1", "F_T/F_N at t_stop"),
    "drop": ("1", "peak - valley"),
    "peak_error": ("1", "standard error of peak"),
    "valley_error": ("1", "standard error of valley; the time of a sudden fall adds to both"),
    "drop_error": ("1", "standard error of drop"),
    "rate": ("1/s", "rise of F_T/F_N over time since the event before"),
    "stiffness": ("1/m", "rise of F_T/F_N over the load point; times F_N, a stiffness"),
    "recurrence": ("s", "time since the start of the event before"),
}
"""Columns of a table of events: unit and meaning."""
OF_SLIP = {
    "t_start": ("s", "last time before the step"),
    "t_stop": ("s", "first time after it"),
    "before": ("m", "slip at t_start"),
    "after": ("m", "slip at t_stop"),
    "slip": ("m", "after - before: of the event"),
    "before_error": ("m", "standard error of before"),
    "after_error": ("m", "standard error of after"),
    "slip_error": ("m", "standard error of slip"),
    "speed": ("m/s", "slip/(t_stop - t_start): no more than the speed, as a step may be shorter"),
    "rate": ("m/s", "creep since the event before"),
    "recurrence": ("s", "time since the start of the event before"),
}
"""Columns of a table of steps of slip: unit and meaning."""
_OF_FORCE, _OF_SLIP = pd.Index(list(COLUMNS)), pd.Index(list(OF_SLIP))
NAMES = {"peak": "before", "valley": "after", "drop": "slip"}
"""Names of columns of falls -> names for steps of slip."""
SMOOTH = 8
"""Number of samples of a mean in noise (a choice)."""
CLEAR = 5.0
"""Threshold of D in standard deviations (a choice). Noise alone gives one false event in 3e6
samples."""
NEAR = 4
"""Number of samples of the lines at the ends of an event, over ``smooth`` (a choice)."""
BLOCK = 64
"""Number of samples of a block, over ``smooth``. The rate of loading is a median over blocks."""
TOLD = 0.95
"""Share of samples at which the reported threshold holds, if time steps differ (a choice)."""


def noise_of(curve: Curve) -> float:
    """Return the standard deviation of white noise of F_T/F_N, from its second differences.

    In a curve without forces, the noise of slip (m) is returned. Without noise, 0 is returned.
    Events do not change the median of differences. If a filter has averaged n samples, noise is not
    white, and the estimate is too small. Means of many samples then have sqrt(n) times the
    remaining noise. In this case, give the larger noise to `events`.

    Raises:
        SceneError: samples are not equally spaced, or most of them are equal.
    """
    t, f, _ = _samples(curve, curve.has_forces)
    return estimated(t, f)[0]


@usage()
def events(
    of: Curve | Record,
    *,
    column: Literal["force", "slip"] | None = None,
    x: float | str | None = None,
    noise: float | str | None = None,
    smooth: int | None = None,
    threshold: float | str | None = None,
    t_gap: float | None = None,
) -> pd.DataFrame:
    """Return the events of a loading curve, or of slip at a sensor, as measured or of a run.

    Args:
        of: a measured curve, or a run. The events of a run are the events of its catalogue, with
            static forces. `pyfric.measured.sampled` makes a curve from a run.
        column: column of a curve in which events are found. None means force, or slip in a curve
            without forces.
        x: distance of a slip sensor from the trailing edge in a run, m. None means the force.
        noise: standard deviation of the noise of F_T/F_N, or of slip (m), >= 0; None means an
            estimate (`noise_of`).
        smooth: number of samples of a mean, less than half of those of the curve. None means 8, or
            1 without noise. Falls within the time of that number of usual steps are one event.
        threshold: smallest drop of an event, over F_N, or its smallest slip, m. None means the
            smallest drop that noise does not cause.
        t_gap: longest pause between falls of one event, s, in runs and in curves without noise. The
            time of the event is the time of its largest fall. Its drop is the sum of all falls.
            None means the pause of `pyfric.build_catalogue` in runs and in curves from `sampled`;
            events then last from the start of the first fall to the end of the last. In other
            curves None means 0, so that each fall from one turning point to the next is an event.
            Slip without noise is split into steps wherever it grows, even if it creeps.

    Returns:
        A data frame with a row for each event, counted from 1, and columns as in `COLUMNS` or
        `OF_SLIP`. Its attrs have noise; smooth; threshold, the smallest possible drop; resolution,
        the time in s within which falls are one event; and notes, on samples or events that were
        left out or may be missing.

    Raises:
        SceneError: an argument is refused; F_N or the noise is unknown; slip decreases; or the
            sensor was clipped.
    """
    if not isinstance(of, Curve | Record):
        allowed = "a Curve, such as pyfric.measured.read makes of a file, or a record"
        raise SceneError("of", type(of).__name__, "", allowed, "no curve")
    in_force = _in_force(of, column, x)
    unit = "" if in_force else "m"
    if t_gap is not None:
        t_gap = check_number("t_gap", t_gap, "s", ge=0.0)
    if threshold is not None:
        threshold = check_number("threshold", threshold, unit, ge=0.0)
    if isinstance(of, Record):
        if x is None:
            return _of_record(of, threshold or 0.0, t_gap)
        return _slips_of_record(of, x, threshold or 0.0, t_gap or 0.0)
    t_gap = of.t_gap if t_gap is None else t_gap
    t, f, point = _samples(of, in_force)
    notes: list[str] = []
    if noise is None:
        noise = of.noise if in_force or not of.has_forces else None
        if noise is None:
            noise, said = estimated(t, f)
            notes += [said] if said else []
    noise = check_number("noise", noise, unit, ge=0.0)
    smooth = check_whole("smooth", smooth or (SMOOTH if noise else 1), 1, max((len(t) - 1) // 2, 1))
    rounding = float(ROUNDED * np.abs(f).max())
    if noise > rounding:
        out = outliers(f, noise, smooth)
        if out.any():
            said = f"{out.sum()} samples that stand alone are left out"
            notes.append(f"{said}, first at {t[out][0]:.6g} s")
            t, f, point = t[~out], f[~out], point[~out]
        names = ("mu", "F_T", "tau") if in_force else ("slip",)
        check_ends(f, next(name for name in names if name in of.table))
        windows = Windows.of(t, smooth)
        clear = CLEAR * noise * windows.spread
        least = max(float(np.quantile(clear, TOLD)) if len(clear) else 0.0, threshold or 0.0)
        falls = _falls(t, f, noise, windows, np.maximum(clear, least))
        table = _table(t, f, point, falls, noise, windows)
        while (small := table["drop"].to_numpy() < least).any():
            falls = [fall for fall, out in zip(falls, small, strict=True) if not out]
            table = _table(t, f, point, falls, noise, windows)
        notes += _unresolved(t, f, noise, least, windows, len(table))
        resolution = windows.time
    else:
        least = max(rounding, threshold or 0.0)
        table = _table(t, f, point, _steps(t, f, rounding, t_gap), 0.0, None)
        table = table[table["drop"] >= least]
        resolution, noise = 0.0, 0.0
    if not in_force and np.median(f[-smooth:]) > np.median(f[:smooth]) + least:
        allowed = 'slip that grows; with the other sign, calibration={"slip": "-1 m"} of '
        raise SceneError("slip", None, "m", f"{allowed}pyfric.measured.read", "it decreases")
    table = table if in_force else _of_slip(table)
    return _finished(table, noise, smooth, least, resolution, notes)


def _in_force(of: Curve | Record, column: str | None, x: float | str | None) -> bool:
    """Whether events are falls of the force; otherwise they are steps of slip."""
    if isinstance(of, Record):
        if column not in (None, "force" if x is None else "slip"):
            allowed = "None: x, the place of a slip sensor, tells it in a run"
            raise SceneError("column", column, "", allowed)
        return x is None
    if x is not None:
        raise SceneError("x", x, "m", "None: a curve has its place", "it is of runs")
    known = ["force"] * of.has_forces + ["slip"] * ("slip" in of.table)
    if column is not None and column not in known:
        raise SceneError("column", column, "", " or ".join(known), "the curve has no other")
    return (column or known[0]) == "force"


def _samples(curve: Curve, in_force: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, F_T/F_N or -slip (m), and load point of a curve, without gaps."""
    f = curve.over_F_N if in_force else -curve.table["slip"].to_numpy()
    kept = np.isfinite(f)
    if kept.sum() < 3:
        raise SceneError("curve", int(kept.sum()), "", "three or more samples", "gaps")
    point = np.full(len(f), np.nan)
    if in_force and "load_point" in curve.table:
        point = curve.table["load_point"].to_numpy()
    return curve.t[kept], f[kept], point[kept]


def _finished(
    columns: Mapping[str, ArrayLike] | pd.DataFrame,
    noise: float,
    smooth: int,
    threshold: float,
    resolution: float,
    notes: Sequence[str] = (),
) -> pd.DataFrame:
    """Return events as a table, made from one array, which is ten times as fast as from columns."""
    recurrence = np.diff(np.asarray(columns["t_start"]), prepend=np.nan)
    if "part" in columns:
        recurrence[np.diff(np.asarray(columns["part"]), prepend=-1) != 0] = np.nan
    names = _OF_SLIP if "slip" in columns else _OF_FORCE
    numbers = [recurrence if name == "recurrence" else columns[name] for name in names]
    index = pd.RangeIndex(1, len(recurrence) + 1, name="event")
    table = pd.DataFrame(np.column_stack(numbers), index, names)
    table.attrs = {"noise": noise, "smooth": smooth, "threshold": threshold}
    table.attrs |= {"resolution": resolution, "notes": tuple(notes)}
    return table


def _of_slip(table: pd.DataFrame) -> pd.DataFrame:
    """Return falls of -slip as steps of slip."""
    table = table.assign(before=-table["peak"], after=-table["valley"], rate=-table["rate"])
    table = table.rename(columns={f"{name}_error": f"{new}_error" for name, new in NAMES.items()})
    table = table.rename(columns={"drop": "slip"})
    return table.assign(speed=table["slip"] / (table["t_stop"] - table["t_start"]))


def _slips_of_record(
    record: Record, x: float | str, threshold: float, t_gap: float
) -> pd.DataFrame:
    """Return the slips at a place, one for each event of a run, that exceed a threshold."""
    names = ["t_start", "t_stop", "before", "after"]
    table = pd.DataFrame(slips(record, x, t_gap), columns=names, dtype=float)
    table["slip"] = table["after"] - table["before"]
    table = table[table["slip"] > threshold]
    passed = table["t_stop"] - table["t_start"]
    table["speed"] = (table["slip"] / passed).where(passed > 0)
    t = table["t_stop"].shift().fillna(float(record.curve["t"].iloc[0]))
    creep, passed = table["before"] - table["after"].shift().fillna(0.0), table["t_start"] - t
    table["rate"] = (creep / passed).where(passed > 0)
    table = table.assign(**{f"{name}_error": 0.0 for name in NAMES.values()})
    return _finished(table, 0.0, 1, threshold, 0.0)


def _steps(t: np.ndarray, f: np.ndarray, clear: float, t_gap: float) -> list[tuple[int, int]]:
    """Return the last sample before and the first after each fall of a curve without noise."""
    falls: list[tuple[int, int]] = []
    for i in np.flatnonzero(np.diff(f) < -clear):
        if falls and t[i] - t[falls[-1][1]] <= t_gap:
            falls[-1] = falls[-1][0], i + 1
        else:
            falls.append((i, i + 1))
    return falls


@dataclass(frozen=True)
class Windows:
    """Samples of the means before and after each place between two samples.

    Attributes:
        smooth: number of usual steps of a mean.
        step: the usual step, s.
        first: index of the sample before the first place.
        starts, stops: index of the first sample of the mean before each place, and index after the
            last sample of the mean after it, shape (m,).
        spread: standard deviation of the difference of both means, for unit noise of samples, shape
            (m,).
        time: time within which falls are one event, s.
        gaps: index of the last sample before each time step longer than the lines at the ends of a
            fall.
    """

    smooth: int
    step: float
    first: int
    starts: np.ndarray
    stops: np.ndarray
    spread: np.ndarray
    time: float
    gaps: np.ndarray

    @classmethod
    def of(cls, t: np.ndarray, smooth: int) -> Windows:
        """Return the windows of samples at the times t."""
        steps = np.diff(t)
        step = float(np.median(steps)) or float(steps.mean())
        far, edge = (smooth - 0.5) * step, (smooth - 1.25) * step
        places = np.flatnonzero((t[:-1] - t[0] >= edge) & (t[-1] - t[1:] >= edge))
        starts = np.searchsorted(t, t[places] - far, side="right")
        stops = np.searchsorted(t, t[places + 1] + far, side="left")
        spread = np.sqrt(1 / (places + 1 - starts) + 1 / (stops - places - 1))
        time = max(smooth * step, float(np.quantile(steps, TOLD)))
        first = int(places[0]) if len(places) else 0
        return cls(smooth, step, first, starts, stops, spread, time, _gaps(t, smooth))

    def means(self, f: np.ndarray) -> np.ndarray:
        """Return the mean after each place minus the mean before it, shape (m,)."""
        middle = float(np.median(f))
        sums = np.concatenate([[0.0], np.cumsum(f - middle)])
        at = self.first + 1 + np.arange(len(self.starts))
        before = (sums[at] - sums[self.starts]) / (at - self.starts)
        return (sums[self.stops] - sums[at]) / (self.stops - at) - before


def _falls(
    t: np.ndarray, f: np.ndarray, noise: float, windows: Windows, clear: np.ndarray
) -> list[tuple[int, int]]:
    """Return the last sample before and the first after each fall in noise.

    A clear rise is no fall, however fast loading is. A fall in a gap does not count.
    """
    from scipy.signal import find_peaks, peak_widths  # slow to import

    size, first = len(windows.starts), windows.first
    if size < 3:
        return []
    rise, apart = windows.means(f), windows.means(t)
    block = min(BLOCK * windows.smooth, size)
    parts = np.array_split(np.arange(size), max(size // block, 1))
    rates = _medians(rise / apart, len(parts))
    centres = [0.5 * (p[0] + p[-1]) for p in parts]

    D = rise - np.interp(np.arange(size), centres, rates) * apart
    peaks, told = find_peaks(-D, height=(clear, None), prominence=(clear, None))
    widths, _, left, right = peak_widths(-D, peaks, 0.5, _heights(told))
    falls: list[tuple[int, int]] = []
    samples = 0.5 * (windows.stops - windows.starts)[peaks]
    for peak, width, begin, end, n in zip(peaks, widths, left, right, samples, strict=True):
        at = int(peak) + first
        slow = width > n + 2
        start = int(np.ceil(begin + n / 2)) + first if slow else at
        stop = int(end - n / 2) + first + 1 if slow else at + 1
        start, stop = max(start, 0), min(max(stop, start + 1), len(f) - 1)
        last = falls[-1][1] if falls else -2
        near = last >= 0 and f[start] <= f[last]
        near = near and (
            start - last <= windows.smooth or not (np.diff(f[last : start + 1]) > 0).any()
        )
        if start < last or near:  # a shoulder of the previous fall
            start, stop = falls[-1][0], max(falls.pop()[1], stop)
        falls.append((start, stop))
    gaps = windows.gaps
    ends = np.array(falls, dtype=int).reshape(-1, 2)
    over = np.searchsorted(gaps, ends[:, 1]) > np.searchsorted(gaps, ends[:, 0])
    rises = f[ends[:, 1]] - f[ends[:, 0]] > CLEAR * noise * np.sqrt(2)
    return [fall for fall, none in zip(falls, over | rises, strict=True) if not none]


def _medians(values: np.ndarray, count: int) -> np.ndarray:
    """Return the medians of parts of values, as `np.array_split` makes them."""
    size, more = divmod(len(values), count)
    longer, others = np.split(values, [more * (size + 1)])
    parts = longer.reshape(more, size + 1), others.reshape(count - more, size)
    return np.concatenate([np.median(part, axis=1) for part in parts])


def _heights(told: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return heights and bases of peaks for `peak_widths`, so that 0.5 means half of D."""
    return told["peak_heights"], told["left_bases"], told["right_bases"]


def _unresolved(
    t: np.ndarray, f: np.ndarray, noise: float, least: float, windows: Windows, found: int
) -> list[str]:
    """Return a note if single samples show more falls than means do."""
    if windows.smooth == 1:
        return []
    single = Windows.of(t, 1)
    clear = np.maximum(CLEAR * noise * single.spread, least)
    seen = len(_falls(t, f, noise, single, clear))
    if seen <= found:
        return []
    said = f"single samples show {seen} falls of more than {clear.max(initial=0.0):.2g}"
    return [f"{said}; those within {windows.time:.3g} s are one here: smooth=1 tells them apart"]


def _table(
    t: np.ndarray,
    f: np.ndarray,
    x: np.ndarray,
    falls: list[tuple[int, int]],
    noise: float,
    windows: Windows | None,
) -> pd.DataFrame:
    """Return the table of falls; in noise, forces are from lines through the samples."""
    starts, stops = np.array(falls, dtype=int).reshape(-1, 2).T
    begins = np.concatenate([[0], stops[:-1]])[: len(starts)]
    ends = np.concatenate([starts[1:], [len(t) - 1]])[: len(starts)]
    part = np.zeros(len(starts), dtype=int)
    zero = np.zeros(len(starts))
    peak, valley, of_peak, of_valley, within = f[starts], f[stops], zero, zero, zero
    if windows is not None:
        gaps = windows.gaps
        part = np.searchsorted(gaps, starts)
        begins = np.maximum(begins, np.append(-1, gaps)[part] + 1)
        ends = np.minimum(ends, np.append(gaps, len(t) - 1)[np.searchsorted(gaps, stops)])
        far = (NEAR * windows.smooth - 0.5) * windows.step
        least = windows.smooth
        froms = np.searchsorted(t, t[starts] - far, side="right")
        tos = np.searchsorted(t, t[stops] + far, side="left")
        froms = np.maximum(begins, np.minimum(froms, starts + 1 - least))
        tos = np.minimum(ends + 1, np.maximum(tos, stops + least))
        sudden = stops == starts + 1  # the fall is between both samples, where a line has to end
        middle = 0.5 * (t[starts] + t[stops])
        within = np.where(sudden, t[stops] - t[starts], 0.0)
        peak, of_peak = _at(t, f, froms, starts + 1, np.where(sudden, middle, t[starts]), noise)
        valley, of_valley = _at(t, f, stops, tos, np.where(sudden, middle, t[stops]), noise)
    rate = _slopes(t, f, begins, starts + 1)
    shared = within / np.sqrt(12) * np.nan_to_num(rate)  # error of the time of the fall
    columns = {
        **{"part": part, "t_start": t[starts], "t_stop": t[stops]},
        **{"peak": peak, "valley": valley, "drop": peak - valley},
        "peak_error": np.hypot(of_peak, shared),
        "valley_error": np.hypot(of_valley, shared),
        "drop_error": np.hypot(of_peak, of_valley),
        "rate": rate,
        "stiffness": _slopes(x, f, begins, starts + 1),
    }
    return pd.DataFrame(columns, dtype=float)


def _gaps(t: np.ndarray, smooth: int) -> np.ndarray:
    """Return the last sample before each time step longer than `NEAR` times smooth usual steps."""
    from scipy.ndimage import median_filter  # slow to import

    steps = np.diff(t)
    usual = np.maximum(median_filter(steps, 2 * smooth + 1, mode="nearest"), steps.mean())
    return np.flatnonzero(steps > NEAR * smooth * usual)


def _at(
    t: np.ndarray,
    f: np.ndarray,
    starts: np.ndarray,
    stops: np.ndarray,
    times: np.ndarray,
    noise: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return values and standard errors, at times, of the lines through parts of samples."""
    lines = robust_lines(t, f, starts, stops)
    off = np.where(lines.count < 3, 0.0, times - lines.centre)
    slope = np.where(lines.count < 3, 0.0, lines.slope)
    mean = np.add.reduceat(np.append(f, 0.0), np.stack([starts, stops], axis=1).ravel())[::2]
    value = np.where(lines.count < 3, mean / lines.count, lines.value)
    spread = np.where(lines.spread > 0, lines.spread, np.inf)
    return value + slope * off, noise * np.sqrt(1 / lines.count + off**2 / spread)


def _slopes(x: np.ndarray, f: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> np.ndarray:
    """Return the slopes of lines through parts of samples, NaN where x does not vary."""
    if not np.isfinite(x).any():
        return np.full(len(starts), np.nan)
    lines = robust_lines(x, f, starts, stops)
    return np.where(lines.spread > 0, lines.slope, np.nan)


def _of_record(record: Record, threshold: float, t_gap: float | None) -> pd.DataFrame:
    """Return the events of a catalogue with finite static forces and a drop above a threshold.

    Events closer than a pause count as one. An event of the catalogue may have several falls,
    between which the load grows. If a pause is given, such events of a quasi-static run are first
    split into their falls, each at one time of the curve.
    """
    scene, curve, found = record.scene, record.columns("curve"), record.columns("events")
    t, F_T = curve["t"], curve["F_T"]
    sudden = np.flatnonzero((np.diff(t) == 0) & (np.diff(F_T) < 0))

    def over(t: float, F_T: float) -> float:
        load = scene.load_at(t)
        return F_T / (scene.F_N if load is None else load[0])

    first = float(t[0]), float(F_T[0])
    ends = (found[name].tolist() for name in ("t_start", "t_stop", "F_T_start", "F_T_arrest"))
    together: list[list[tuple[float, ...]]] = []
    for start, stop, F_start, F_stop in zip(*ends, strict=True):
        if not np.isfinite(F_start - F_stop):
            continue
        inside = [] if t_gap is None else sudden[(t[sudden] >= start) & (t[sudden] <= stop)]
        falls = [(t[n], t[n], F_T[n], F_T[n + 1]) for n in inside]
        for begin, end, before, after in falls or [(start, stop, F_start, F_stop)]:
            fall = (begin, end, over(begin, before), over(end, after))
            if together and begin - together[-1][-1][1] <= (t_gap or 0.0):
                together[-1].append(fall)
            else:
                together.append([fall])
    rows, last, valley = [], first[0], over(*first)
    for row in map(_as_one, together):
        if row["drop"] > threshold:
            passed, rise = row["t_start"] - last, row["peak"] - valley
            moved = scene.drive(row["t_start"]) - scene.drive(last)
            row["rate"] = rise / passed if passed else np.nan
            row["stiffness"] = rise / moved if moved else np.nan
            rows.append(row)
            last, valley = row["t_stop"], row["valley"]
    columns = {name: [row[name] for row in rows] for name in COLUMNS if name != "recurrence"}
    return _finished(columns, 0.0, 1, threshold, 0.0)


def _as_one(falls: list[tuple[float, ...]]) -> dict[str, float]:
    """Return several falls (t_start, t_stop, peak, valley) as one fall at the time of the largest.

    The drop of this fall is the sum of all drops. Its peak and valley are the values that loading
    alone would give.
    """
    drops = [peak - valley for _, _, peak, valley in falls]
    main = int(np.argmax(drops))
    t_start, t_stop, peak, _ = falls[main]
    peak, drop = peak + sum(drops[:main]), sum(drops)
    ends = {"t_start": t_start, "t_stop": t_stop, "peak": peak, "valley": peak - drop, "drop": drop}
    return ends | dict.fromkeys(("peak_error", "valley_error", "drop_error"), 0.0)
