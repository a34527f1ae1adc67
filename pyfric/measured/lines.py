"""Robust straight lines through samples, many at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NORMAL = 1.4826
"""Standard deviation over the median absolute deviation, of a normal distribution."""
TUKEY = 6.0
"""Standard deviations beyond which a sample has no weight. The efficiency in normal noise is
0.98."""
PASSES = 5
"""Number of times that a line is fitted with new weights."""
AT_ONCE = 1 << 20
"""Largest number of samples in lines that are fitted together."""
FEWEST = 5
"""Fewest samples of a line for which weights are used."""
ROUNDED = 1e-9
"""Rounding error, over the largest number."""


def robust_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Fit a line with Tukey's biweights; return its value at the mean of x, and its slope."""
    lines = robust_lines(x, y, np.array([0]), np.array([len(x)]))
    return float(lines.value[0]), float(lines.slope[0])


class Lines(NamedTuple):
    """Lines through m parts of samples.

    Attributes:
        value: value at the mean of x, shape (m,); NaN without samples.
        slope: slope; 0 if x does not vary.
        centre: the mean of x.
        spread: sum of squares of x about the centre.
        count: number of samples.
    """

    value: np.ndarray
    slope: np.ndarray
    centre: np.ndarray
    spread: np.ndarray
    count: np.ndarray


def robust_lines(x: np.ndarray, y: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> Lines:
    """Return lines through parts of samples: Tukey's biweights.

    Args:
        x, y: samples, shape (n,); samples with NaN in x do not count.
        starts, stops: first index of each part, and index after its last sample, shape (m,).

    """
    found = np.full((5, len(starts)), np.nan)
    sizes = stops - starts
    classes = np.ceil(np.log2(np.maximum(sizes, 1))).astype(int)
    for size in np.unique(classes):  # lengths within a factor of two
        alike = np.flatnonzero(classes == size)
        count = min((len(alike) << int(size)) // AT_ONCE + 1, len(alike))
        for rows in np.array_split(alike, count):
            at = starts[rows, None] + np.arange(int(sizes[rows].max()))
            inside = at < stops[rows, None]
            at = np.minimum(at, len(x) - 1)
            inside &= np.isfinite(x[at])
            found[:, rows] = _lines(
                np.where(inside, x[at], 0.0), np.where(inside, y[at], 0.0), inside
            )
    return Lines(*found)


def _lines(x: np.ndarray, y: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return a line for each row of x and y, fitted to the points where `inside` is true."""
    count = inside.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        centre = x.sum(axis=1) / count
        value, slope = y.sum(axis=1) / count, np.zeros(len(x))
        largest = np.abs(y).max(axis=1, initial=0.0)
    weights, going = inside.astype(float), count > 0
    for _ in range(PASSES):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        w, u, v = weights[rows], x[rows], y[rows]
        total = w.sum(axis=1)
        at, mean = (w * u).sum(axis=1) / total, (w * v).sum(axis=1) / total
        away = u - at[:, None]
        spread = (w * away**2).sum(axis=1)
        rise = (w * away * (v - mean[:, None])).sum(axis=1)
        slope[rows] = np.divide(rise, spread, out=np.zeros(len(rows)), where=spread > 0)
        value[rows] = mean + slope[rows] * (centre[rows] - at)
        off = np.abs(v - value[rows, None] - slope[rows, None] * (u - centre[rows, None]))
        scale = NORMAL * _medians(np.where(inside[rows], off, np.inf), count[rows])
        exact = (scale <= ROUNDED * largest[rows]) | (count[rows] < FEWEST)
        scale = np.where(exact, 1.0, scale)
        share = np.clip(off / (TUKEY * scale[:, None]), 0.0, 1.0)
        weights[rows] = inside[rows] * (1 - share**2) ** 2
        going[rows[exact]] = False
    spread = (inside * (x - centre[:, None]) ** 2).sum(axis=1)
    return np.stack([value, slope, centre, spread, count])


def _medians(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the median of the smallest `count` numbers of each row."""
    ordered, rows = np.sort(values, axis=1), np.arange(len(values))
    low, high = np.maximum((count - 1) // 2, 0), np.minimum(count // 2, values.shape[1] - 1)
    return 0.5 * (ordered[rows, low] + ordered[rows, high])
