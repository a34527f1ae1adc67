"""Events of a loading curve, or of slip at a sensor: one table for measurements and for runs.

An event is a fall of F_T/F_N. In noise, falls are found with the difference D of the means of
``smooth`` samples after and before each sample, less what loading adds, which has the standard
deviation noise sqrt(2/smooth). A fall counts where D is below `CLEAR` of these: with 8 samples,
2.5 times the noise, so that a fall of 5 times the noise is lost once in three million. Within
``smooth`` samples of an end of the curve nothing is found. Forces at both ends of a fall come from
robust straight lines through the samples on either side, so that their errors are known, too. The
time of a sudden fall is not known within a step; what loading adds in this time moves both forces,
and not the drop. What falls while nothing is measured for longer than these lines is no event, and
the next one has no recurrence.

A step of slip is a fall of -slip, with creep in place of loading. Both are found in the same way.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd

from pyfric.measured.curve import Curve
from pyfric.measured.sensors import slips
from pyfric.record import T_GAP, Record
from pyfric.scene import SceneError, check_number, check_whole

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
"""The same of a table of steps of slip."""
NAMES = {"peak": "before", "valley": "after", "drop": "slip"}
"""Names of what is found in -slip, as of slip."""
SMOOTH = 8
"""Samples of a mean in noise: a policy."""
CLEAR = 5.0
"""Standard deviations of D that are no noise: one false event in 3e6 samples. A policy."""
NEAR = 4
"""Lines at the ends of an event go through so many times ``smooth`` samples. A policy."""
BLOCK = 64
"""The rate of loading is the median over blocks of so many times ``smooth`` samples."""
NORMAL = 1.4826
"""Standard deviation over the median absolute deviation, of a normal distribution."""
TUKEY = 6.0
"""Standard deviations beyond which a sample has no weight: efficiency 98 % in normal noise."""
PASSES = 5
"""Iterations of weights."""
ROUNDED = 1e-9
"""Falls below this share of the largest force are rounding."""
EQUAL = 0.01
"""Spread of time steps, over their median, up to which samples are equally spaced."""


def noise_of(curve: Curve) -> float:
    """Return the standard deviation of white noise of F_T/F_N, from its second differences.

    In a curve without forces it is that of slip, m. Events do not move the median of differences.
    Where a filter has averaged n samples, noise is not white, and the estimate is too small: means
    of many samples have sqrt(n) times the noise that is left, which `events` has to be told.

    Raises:
        SceneError: it is not known: samples are not equally spaced, or most of them are equal.
    """
    return _noise_of(*_samples(curve, curve.has_forces))


def _noise_of(t: np.ndarray, f: np.ndarray) -> float:
    """Return the same of samples."""
    steps = np.diff(t)
    if np.quantile(np.abs(steps / np.median(steps) - 1), 0.9) > EQUAL if steps.all() else True:
        allowed = 'the standard deviation, such as noise=1e-3 (over F_N) or "1 um" (of slip), or 0'
        raise SceneError("noise", None, "", allowed, "samples are not equally spaced")
    second = np.diff(f, 2)
    noise = float(NORMAL * np.median(np.abs(second - np.median(second))) / np.sqrt(6))
    if not noise:
        allowed = "the standard deviation, such as that of the last digit, or 0"
        raise SceneError("noise", None, "", allowed, "digits are coarser than the noise")
    return noise


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
        of: a measured curve, or a run. The events of a run are those of its catalogue, with static
            forces; `pyfric.measured.sampled` makes a curve of it.
        column: of a curve in which events are found; None: force, or slip where there is no force.
        x: of a run: place of a slip sensor from the trailing edge, m; None: the force.
        noise: standard deviation of the noise of F_T/F_N, or of slip (m), >= 0; None: estimated
            (`noise_of`).
        smooth: number of samples of a mean; None: 8, or 1 without noise. Falls within so many
            samples are one event.
        threshold: smallest drop of an event, over F_N, or its smallest slip, m; None: what is clear
            of the noise.
        t_gap: without noise, and in runs: falls within this pause are one event, s, at the time of
            the largest, whose drop is the sum of theirs; None: that of `pyfric.build_catalogue`,
            from the start of the first fall to the end of the last.
            Without noise, all slip is a step, creep too.

    Returns:
        A data frame with a row for each event, counted from 1, and columns as in `COLUMNS`, or
        as in `OF_SLIP`; its attrs have noise, smooth, threshold and resolution: within so many
        seconds, events are one.

    Raises:
        SceneError: an argument is refused; F_N or the noise is not known; slip decreases.
    """
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
    t_gap = T_GAP if t_gap is None else t_gap
    t, f = _samples(of, in_force)
    if noise is None:
        noise = of.noise if in_force or not of.has_forces else None
        noise = _noise_of(t, f) if noise is None else noise
    noise = check_number("noise", noise, unit, ge=0.0)
    smooth = check_whole("smooth", smooth or (SMOOTH if noise else 1), 1)
    point = np.full(len(t), np.nan)
    if in_force and "load_point" in of.table:
        point = of.table["load_point"].to_numpy()[np.isfinite(of.over_F_N)]
    clear = (
        float(CLEAR * noise * np.sqrt(2 / smooth)) if noise else float(ROUNDED * np.abs(f).max())
    )
    threshold = clear if threshold is None else threshold
    falls = _falls(t, f, smooth, max(clear, threshold)) if noise else _steps(t, f, clear, t_gap)
    if not in_force and np.median(f[-smooth:]) > np.median(f[:smooth]) + clear:
        allowed = 'slip that grows; with the other sign, calibration={"slip": "-1 m"} of '
        raise SceneError("slip", None, "m", f"{allowed}pyfric.measured.read", "it decreases")
    table = _table(t, f, point, falls, noise, smooth)
    table = table[table["drop"] >= threshold] if not noise else table[table["drop"] > 0]
    resolution = float(smooth * np.median(np.diff(t))) if noise else 0.0
    table = table if in_force else _of_slip(table)
    return _finished(table, noise, smooth, threshold, resolution)


def _in_force(of: Curve | Record, column: str | None, x: float | str | None) -> bool:
    """Whether events are those of the force, not of slip."""
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


def _samples(curve: Curve, in_force: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and F_T/F_N or -slip (m), of a curve, without gaps."""
    f = curve.over_F_N if in_force else -curve.table["slip"].to_numpy()
    kept = np.isfinite(f)
    if kept.sum() < 3:
        raise SceneError("curve", int(kept.sum()), "", "three or more samples", "gaps")
    return curve.t[kept], f[kept]


def _finished(
    table: pd.DataFrame, noise: float, smooth: int, threshold: float, resolution: float
) -> pd.DataFrame:
    table = table.reset_index(drop=True)
    table.index = pd.RangeIndex(1, len(table) + 1, name="event")
    parts = table["part"] if "part" in table else np.zeros(len(table))
    table["recurrence"] = table["t_start"].groupby(np.asarray(parts)).diff()
    table = table[list(OF_SLIP if "slip" in table else COLUMNS)]
    table.attrs = {"noise": noise, "smooth": smooth, "threshold": threshold}
    table.attrs["resolution"] = resolution
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
    """Return the slip at a place in each event of a run that is above a threshold."""
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


def _falls(t: np.ndarray, f: np.ndarray, smooth: int, clear: float) -> list[tuple[int, int]]:
    """Return the last sample before and the first after each fall in noise."""
    from scipy.signal import find_peaks, peak_widths  # slow to import

    if len(f) < 2 * smooth + 1:
        return []
    means = np.convolve(f, np.ones(smooth) / smooth, "valid")
    times = np.convolve(t, np.ones(smooth) / smooth, "valid")
    rise, apart = means[smooth:] - means[:-smooth], times[smooth:] - times[:-smooth]
    block = min(BLOCK * smooth, len(rise))
    parts = np.array_split(np.arange(len(rise)), max(len(rise) // block, 1))
    rates = [np.median(rise[p] / apart[p]) for p in parts]
    centres = [p.mean() for p in parts]
    D = rise - np.interp(np.arange(len(rise)), centres, rates) * apart
    peaks, told = find_peaks(-D, height=clear, prominence=clear)
    widths, _, left, right = peak_widths(-D, peaks, 0.5, _heights(told))
    first = smooth - 1  # the last sample of the mean before in D[0]
    falls: list[tuple[int, int]] = []
    for peak, width, begin, end in zip(peaks, widths, left, right, strict=True):
        at = int(peak) + first
        slow = width > smooth + 2
        start = int(np.ceil(begin + smooth / 2)) + first if slow else at
        stop = int(end - smooth / 2) + first + 1 if slow else at + 1
        start, stop = max(start, 0), min(max(stop, start + 1), len(f) - 1)
        if falls and start < falls[-1][1]:  # a shoulder of the one before
            start, stop = falls[-1][0], max(falls.pop()[1], stop)
        falls.append((start, stop))
    return falls


def _heights(told: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return heights and bases of peaks, as `peak_widths` wants them, so that 0.5 is half of D."""
    return told["peak_heights"], told["left_bases"], told["right_bases"]


def _table(
    t: np.ndarray,
    f: np.ndarray,
    x: np.ndarray,
    falls: list[tuple[int, int]],
    noise: float,
    smooth: int,
) -> pd.DataFrame:
    rows, part = [], 0
    gaps = _gaps(t, smooth) if noise else set()
    falls = [fall for fall in falls if not any(fall[0] <= gap[0] < fall[1] for gap in gaps)]
    falls = sorted([*falls, *gaps])
    for k, (start, stop) in enumerate(falls):
        if (start, stop) in gaps:
            part += 1
            continue
        begin = falls[k - 1][1] if k else 0
        end = falls[k + 1][0] if k + 1 < len(falls) else len(t) - 1
        peak, valley, of_peak, of_valley, within = f[start], f[stop], 0.0, 0.0, 0.0
        before = slice(begin, start + 1)
        rate = _slope(t[before], f[before])
        if noise:
            near = slice(max(begin, start + 1 - NEAR * smooth), start + 1)
            next_to = slice(stop, min(end + 1, stop + NEAR * smooth))
            ends = t[start], t[stop]
            if stop == start + 1:  # the fall is between the two: a line has to reach it
                ends, within = (0.5 * (t[start] + t[stop]),) * 2, t[stop] - t[start]
            peak, of_peak = _at(t[near], f[near], ends[0], noise)
            valley, of_valley = _at(t[next_to], f[next_to], ends[1], noise)
        shared = within / np.sqrt(12) * np.nan_to_num(rate)  # of the time of the fall
        rows.append(
            {
                **{"part": part, "t_start": t[start], "t_stop": t[stop]},
                **{"peak": peak, "valley": valley},
                "drop": peak - valley,
                "peak_error": float(np.hypot(of_peak, shared)),
                "valley_error": float(np.hypot(of_valley, shared)),
                "drop_error": float(np.hypot(of_peak, of_valley)),
                "rate": rate,
                "stiffness": _slope(x[before], f[before]),
            }
        )
    columns = ["part", *(name for name in COLUMNS if name != "recurrence")]
    return pd.DataFrame(rows, columns=columns, dtype=float)


def _gaps(t: np.ndarray, smooth: int) -> set[tuple[int, int]]:
    """Return last sample before and first after each step longer than `NEAR` smooth others."""
    from scipy.ndimage import median_filter  # slow to import

    steps = np.diff(t)
    usual = np.maximum(median_filter(steps, 2 * smooth + 1, mode="nearest"), steps.mean())
    return {(int(i), int(i) + 1) for i in np.flatnonzero(steps > NEAR * smooth * usual)}


def robust_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return value at the mean of x, and slope, of a straight line: Tukey's biweights."""
    weights, centre, value, slope = np.ones(len(x)), x.mean(), y.mean(), 0.0
    for _ in range(PASSES):
        total = weights.sum()
        at, mean = (weights * x).sum() / total, (weights * y).sum() / total
        spread = (weights * (x - at) ** 2).sum()
        slope = (weights * (x - at) * (y - mean)).sum() / spread if spread > 0 else 0.0
        value = mean + slope * (centre - at)
        off = y - value - slope * (x - centre)
        scale = NORMAL * np.median(np.abs(off))
        if scale <= ROUNDED * np.abs(y).max(initial=0.0) or len(x) < 5:
            break
        share = np.clip(np.abs(off) / (TUKEY * scale), 0.0, 1.0)
        weights = (1 - share**2) ** 2
    return float(value), float(slope)


def _at(t: np.ndarray, f: np.ndarray, time: float, noise: float) -> tuple[float, float]:
    """Return value and standard error, at a time, of the line through samples."""
    if len(t) < 3:
        return float(f.mean()), noise / np.sqrt(len(t))
    value, slope = robust_line(t, f)
    off, spread = time - t.mean(), ((t - t.mean()) ** 2).sum()
    return value + slope * off, float(noise * np.sqrt(1 / len(t) + off**2 / spread))


def _slope(x: np.ndarray, f: np.ndarray) -> float:
    kept = np.isfinite(x)
    if kept.sum() < 2 or not np.ptp(x[kept]) > 0:
        return np.nan
    return robust_line(x[kept], f[kept])[1]


def _of_record(record: Record, threshold: float, t_gap: float | None) -> pd.DataFrame:
    """Return the events of a catalogue with finite static forces and a drop above a threshold.

    Those within a pause are one. An event of the catalogue may have several falls, and the load
    grows between them. If a pause is given, those of a quasi-static run, each at one time of its
    curve, are parted first.
    """
    scene, found = record.scene, record.events
    t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    sudden = np.flatnonzero((np.diff(t) == 0) & (np.diff(F_T) < 0))

    def over(t: float, F_T: float) -> float:
        load = scene.load_at(t)
        return F_T / (scene.F_N if load is None else load[0])

    first = float(record.curve["t"].iloc[0]), float(record.curve["F_T"].iloc[0])
    names = ["t_start", "t_stop", "F_T_start", "F_T_arrest"]
    together: list[list[tuple[float, ...]]] = []
    for start, stop, F_start, F_stop in found[names].itertuples(index=False):
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
    columns = [name for name in COLUMNS if name != "recurrence"]
    table = pd.DataFrame(rows, columns=columns, dtype=float)
    return _finished(table, 0.0, 1, threshold, 0.0)


def _as_one(falls: list[tuple[float, ...]]) -> dict[str, float]:
    """Return falls (t_start, t_stop, peak, valley) as one at the time of the largest.

    Its drop is the sum of theirs, and its peak and valley are those of loading without the others.
    """
    drops = [peak - valley for _, _, peak, valley in falls]
    main = int(np.argmax(drops))
    t_start, t_stop, peak, _ = falls[main]
    peak, drop = peak + sum(drops[:main]), sum(drops)
    ends = {"t_start": t_start, "t_stop": t_stop, "peak": peak, "valley": peak - drop, "drop": drop}
    return ends | dict.fromkeys(("peak_error", "valley_error", "drop_error"), 0.0)
