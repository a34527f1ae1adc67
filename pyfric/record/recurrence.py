"""Sizes of events and how they recur: counts, b-value, waiting times.

The magnitude of an event is m = log10 of its size. In a catalogue that is complete from m_c on,
with numbers of events above m that fall as 10^(-b m), the b-value and its standard error are

    b = log10(e) / (mean m - (m_c - bin/2)) ,
    sigma_b = ln(10) b^2 [ sum (m - mean m)^2 / (n (n - 1)) ]^(1/2) ,

over the n events with m >= m_c. `bin` is the width in which magnitudes are rounded, 0 if they are
not. With the potency as size, b is the exponent of its cumulative distribution; the b-value of the
moment magnitude is 3/2 of it.

The smallest events are those of single blocks, so that l and L bound the range. If m_c is left
open, it is the lower end of the most frequent bin of magnitudes (of the maximum curvature).

Source: K. Aki, Bull. Earthq. Res. Inst. 43, 237 (1965), b; T. Utsu, Geophys. Bull. Hokkaido Univ.
13, 99 (1965), magnitudes in bins; Y. Shi and B. A. Bolt, Bull. Seismol. Soc. Am. 72, 1677 (1982),
its error; S. Wiemer and M. Wyss, Bull. Seismol. Soc. Am. 90, 859 (2000), completeness.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from pyfric.record.data import RecordData
from pyfric.record.held import held_in
from pyfric.scene import SceneError, check_number

BIN = 0.1
"""Width of bins of magnitude in which the most frequent one is looked for: a policy."""
FEWEST = 2
"""Fewest events of a b-value with an error."""


class Sizes(NamedTuple):
    """Sizes of events.

    Attributes:
        events: data frame with a row for each event of positive size, in order of time: t (s), its
            start; size; magnitude; complete, whether it is at least m_c; waiting (s), the time
            since the last complete one, NaN for the first and for others.
        counts: data frame with a row for each size, in order: size; number of events at least so
            large.
        m_c: magnitude from which the catalogue is complete.
        n: number of events from there on.
        b, b_error: b-value and its standard error.
        recurrence: mean waiting time, s; NaN for fewer than two events.
        variation: its standard deviation over the mean: 0 for a clock, 1 for a Poisson process.
    """

    events: pd.DataFrame
    counts: pd.DataFrame
    m_c: float
    n: int
    b: float
    b_error: float
    recurrence: float
    variation: float


def b_value(
    magnitudes: ArrayLike, m_c: float | None = None, *, bin: float = 0.0
) -> tuple[float, float]:
    """Return the b-value of magnitudes and its standard error; see the module.

    Args:
        magnitudes: shape (n,), without NaN.
        m_c: magnitude from which they are complete; None is the smallest one.
        bin: width in which they are rounded, 0 if they are not.

    Raises:
        SceneError: an argument is refused, there are fewer than two magnitudes from m_c on, or all
            are equal to it.
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
    above = float(m.mean()) - (m_c - bin / 2)
    if not above > 0:
        raise SceneError("magnitudes", m_c, "", "events of different size", "all are equal")
    b = float(np.log10(np.e)) / above
    spread = float(np.sqrt(((m - m.mean()) ** 2).sum() / (m.size * (m.size - 1))))
    return b, float(np.log(10)) * b**2 * spread


def sizes(record: RecordData, size: str = "potency", complete: float | None = None) -> Sizes:
    """Return sizes of the finished events of a record, and how they recur; see the module.

    Args:
        size: column of `record.events`, such as "potency" (m^2), "n_blocks" or "friction_heat".
        complete: size from which the catalogue is complete, in the unit of the column; None: that
            of the most frequent bin of magnitudes.

    Raises:
        SceneError: there is no such column, `complete` is refused, or fewer than two events are
            left.
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
    """Return the lower end of the bin of width `BIN` with the most magnitudes."""
    least = float(np.min(magnitudes))
    number = np.bincount(((magnitudes - least) / BIN).astype(int))
    return least + BIN * int(np.argmax(number))
