"""Sizes and recurrence of events: counts, b-value, waiting times.

The magnitude of an event is m = log10 of its size. The catalogue is complete from m_c on. The
number of events above m falls as 10^(-b m). The b-value of largest likelihood and its error are

    b = log10(e) / (mean m - m_c) ,
    sigma_b = ln(10) b^2 [ sum (m - mean m)^2 / (n (n - 1)) ]^(1/2) ,

over the n events with m >= m_c. Integer sizes are counts, such as numbers of blocks. A count k
stands for all sizes from k to k + 1, and m_c is the magnitude of the smallest count. Likewise, a
magnitude that was rounded to a bin stands for the whole bin. An event with magnitudes from m to
m + w has the likelihood 10^(-b m) - 10^(-b (m + w)). The score and its derivative are

    s = m_c - m + w/(10^(b w) - 1) ,   ds/db = -ln(10) w^2 10^(b w)/(10^(b w) - 1)^2 .

The sum of s vanishes, and sigma_b = [sum s^2 n/(n - 1)]^(1/2) / |sum ds/db|. For w = 0 the formulas
for b and sigma_b reduce to the equations above. With the potency as size, b is the exponent of its
cumulative distribution. The b-value of the moment magnitude is 3/2 of this b.

The smallest events are slip of single blocks, so that l and L bound the range of sizes. By default,
m_c is the lower end of the most frequent bin of magnitudes (maximum curvature).

Source: K. Aki, Bull. Earthq. Res. Inst. 43, 237 (1965), b; Y. Shi and B. A. Bolt, Bull. Seismol.
Soc. Am. 72, 1677 (1982), its error; S. Tinti and F. Mulargia, Bull. Seismol. Soc. Am. 77, 2125
(1987), magnitudes in bins; S. Wiemer and M. Wyss, Bull. Seismol. Soc. Am. 90, 859 (2000),
completeness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import ArrayLike

from pyfric.display import Shown, html
from pyfric.record.data import RecordData
from pyfric.record.held import held_in, of_record
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    from collections.abc import Callable

BIN = 0.1
"""Width of bins of magnitude. A policy."""
FEWEST = 2
"""Smallest number of events that gives a b-value with an error."""
WHOLE = 1e-9
"""Largest distance of a count from an integer, over the count."""


class Sizes(NamedTuple):
    """Sizes of events.

    Attributes:
        events: data frame with a row for each event of positive size, in order of time: t (s), its
            start; size; magnitude; complete, whether its magnitude is at least m_c; waiting (s),
            the time since the last complete event, NaN for the first and for incomplete events.
        counts: data frame with a row for each size, in order: size; number of events of at least
            this size.
        m_c: magnitude from which the catalogue is complete.
        n: number of events of magnitude m_c or more.
        b, b_error: b-value and its standard error.
        recurrence: mean waiting time, s; NaN for fewer than two events.
        variation: standard deviation of waiting times over their mean: 0 for periodic events, 1 for
            a Poisson process.
    """

    events: pd.DataFrame
    counts: pd.DataFrame
    m_c: float
    n: int
    b: float
    b_error: float
    recurrence: float
    variation: float

    plot = Shown.plot
    _repr_html_ = html


def b_value(
    magnitudes: ArrayLike, m_c: float | None = None, *, bin: float = 0.0
) -> tuple[float, float]:
    """Return the b-value of magnitudes and its standard error; see the module.

    Args:
        magnitudes: shape (n,), without NaN. If all sizes 10^m are integers, they are counts.
        m_c: magnitude from which the catalogue is complete; None means the smallest magnitude.
        bin: width of bins to which magnitudes are rounded, 0 if they are not rounded. The bin of
            m_c is complete.

    Raises:
        SceneError: an argument is refused, fewer than two magnitudes are at least m_c, or all of
            these are equal.
    """
    m = np.asarray(magnitudes, dtype=float)
    if m.ndim != 1 or not np.isfinite(m).all():
        shown = m.tolist() if m.size < 5 else f"shape {m.shape}"
        raise SceneError("magnitudes", shown, "", "a list of finite numbers")
    bin = check_number("bin", bin, "", ge=0.0)
    m_c = float(m.min(initial=np.inf)) if m_c is None else check_number("m_c", m_c, "")
    m = m[m >= m_c - 1e-9 * max(abs(m_c), 1.0)]
    if m.size < FEWEST:
        allowed = f"a magnitude below which {FEWEST} or more events are left out"
        raise SceneError("m_c", m_c, "", allowed.replace("below", "above"), f"{m.size} events")
    low, width, m_c = _ranges(m, m_c, bin)
    above = float(low.mean()) - m_c
    if not (above > 0 and (m > m.min()).any()):
        raise SceneError("magnitudes", m_c, "", "events of different size", "all are equal")
    b = float(np.log10(np.e)) / above
    if width.any():
        b = _root(lambda at: float(_scores(low, width, m_c, at)[0].sum()), b)
    score, falls = _scores(low, width, m_c, b)
    return b, float(np.sqrt((score**2).sum() * m.size / (m.size - 1)) / falls.sum())


def _ranges(m: np.ndarray, m_c: float, bin: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return lower end and width of the magnitude range of each event, (n,), and their m_c."""
    with np.errstate(over="ignore", invalid="ignore"):
        count = np.rint(10.0**m)
        counts = count.min() >= 1 and (np.abs(10.0**m - count) <= WHOLE * count).all()
    if bin or not counts:
        return m - bin / 2, np.full(m.shape, bin), m_c - bin / 2
    least = np.ceil(10.0**m_c * (1 - WHOLE))
    return np.log10(count), np.log1p(1 / count) / np.log(10), float(np.log10(least))


def _scores(
    low: np.ndarray, width: np.ndarray, m_c: float, b: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the score s of each event and -ds/db at b; see the module."""
    half, scale = np.log(10) * b * width / 2, np.log(10) * b
    wide = np.where(half > 0, half, 1.0)
    with np.errstate(over="ignore"):
        mean = np.where(half > 0, 2 * wide / np.expm1(2 * wide), 1.0) / scale
        falls = np.where(half > 0, (wide / np.sinh(wide)) ** 2, 1.0) / (scale * b)
    return m_c - low + mean, falls


def _root(of: Callable[[float], float], near: float) -> float:
    """Return the positive root of a decreasing function."""
    low = high = near
    while of(low) < 0:
        low /= 2
    while of(high) > 0:
        high *= 2
    return low if low == high else float(scipy.optimize.brentq(of, low, high, xtol=1e-12 * low))


@of_record
def sizes(record: RecordData, size: str = "potency", complete: float | None = None) -> Sizes:
    """Return sizes and recurrence of the finished events of a record; see the module.

    Args:
        size: column of `record.events`, such as "potency" (m^2), "n_blocks" or "friction_heat".
        complete: size from which the catalogue is complete, in the unit of the column; None means
            the lower end of the most frequent bin of magnitudes.

    Raises:
        SceneError: there is no such column, `complete` is refused, or fewer than two events have
            this size.
    """
    events, known = record.events, held_in("events")
    numbers = [name for name in events if events[name].dtype.kind in "if"]
    if size not in numbers:
        raise SceneError("size", size, "", "a column of numbers of the events, such as 'potency'")
    found = events[events["finished"] & (events[size] > 0)]
    if len(found) < FEWEST:
        allowed = f"{FEWEST} or more finished events with a {size} > 0"
        raise SceneError("record", len(found), "", allowed, "too few: raise t_end")
    m = np.log10(found[size].to_numpy(dtype=float))
    if complete is None:
        m_c = most_frequent(m)
    else:
        m_c = np.log10(check_number("complete", complete, known[size].unit, gt=0.0))
    counts = pd.DataFrame({"size": np.sort(found[size].to_numpy())})
    counts["number"] = len(counts) - np.searchsorted(counts["size"], counts["size"], side="left")
    kept = m >= m_c
    try:
        b, b_error = b_value(m[kept], m_c)
    except SceneError as error:
        allowed = f"a size with {FEWEST} or more larger events of different size"
        given = float(10**m_c) if complete is None else complete
        raise SceneError("complete", given, known[size].unit, allowed, error.reason) from None
    t = found["t_start"].to_numpy()
    waiting = np.full(len(t), np.nan)
    waiting[np.flatnonzero(kept)[1:]] = np.diff(t[kept])
    table = {"t": t, "size": found[size], "magnitude": m, "complete": kept, "waiting": waiting}
    waits = waiting[np.isfinite(waiting)]
    mean = float(waits.mean()) if waits.size else np.nan
    variation = float(waits.std(ddof=1)) / mean if waits.size > 1 else np.nan
    n = int(kept.sum())
    return Sizes(pd.DataFrame(table), counts, float(m_c), n, b, b_error, mean, variation)


def most_frequent(magnitudes: np.ndarray) -> float:
    """Return the lower end of the bin of width `BIN` with the largest number of magnitudes."""
    least = float(np.min(magnitudes))
    number = np.bincount(((magnitudes - least) / BIN).astype(int))
    return least + BIN * int(np.argmax(number))
