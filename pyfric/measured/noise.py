"""What samples are worth: their noise, readings that stand alone, and ends of a sensor.

These are policies for what loggers write: a single reading may be a fault of the line; a sensor
beyond its range repeats its largest reading; a curve of another code, or through points, has no
noise. Each is said, or refused, before events are looked for.
"""

from __future__ import annotations

import numpy as np

from pyfric.measured.lines import NORMAL, ROUNDED
from pyfric.values import SceneError

EQUAL = 0.01
"""Spread of time steps, over their median, up to which samples are equally spaced."""
WHITE, SMOOTH_LINE = 1.3, 3.5
"""Noise from every second sample over that from all: 1 if it is white, 4 on a smooth line."""
FAR = 4.0
"""Second differences count as so many times their median at most, as events have larger ones."""
ALONE, LONGEST, AROUND = 10.0, 3, 17
"""Readings stand alone if they are at most so many in a row, and away from those on either side by
so many times the noise and the median step of so many samples around them."""
FEW = 0.05
"""Largest share of readings that stand alone; more are the signal."""
RARE = 1e-6
"""Probability of a run of equal readings at an end that is no accident."""
OFTEN, FINE = 5, 0.02
"""Readings at an end that are no accident, where less than this share of readings equal the one
before."""


def estimated(t: np.ndarray, f: np.ndarray) -> tuple[float, str]:
    """Return the standard deviation of white noise of samples, and what to say of it.

    Raises:
        SceneError: samples are not equally spaced, or digits are coarser than the noise.
    """
    steps = np.diff(t)
    even = steps.all() and np.quantile(np.abs(steps / np.median(steps) - 1), 0.9) <= EQUAL
    if not even:
        allowed = 'the standard deviation, such as noise=1e-3 (over F_N) or "1 um" (of slip), or 0'
        raise SceneError("noise", None, "", allowed, "samples are not equally spaced")
    noise = float(NORMAL * np.median(_off(f, 1)) / np.sqrt(6))
    if not noise and np.median(np.abs(np.diff(f))) == 0:
        allowed = "the standard deviation, such as that of the last digit, or 0"
        raise SceneError("noise", None, "", allowed, "digits are coarser than the noise")
    if noise <= ROUNDED * np.abs(f).max(initial=0.0):
        return 0.0, "the curve has no noise: events are all falls between turning points"
    off = [_off(f, apart) for apart in (1, 2)]
    medians = [float(np.median(each)) for each in off]
    if SMOOTH_LINE < medians[1] / medians[0] <= 4 + WHITE - 1:
        said = "the curve is smooth between events, and has no noise that could be told: events are"
        return 0.0, f"{said} all falls between turning points"
    first, second = (
        np.minimum(each, FAR * at).mean() for each, at in zip(off, medians, strict=True)
    )
    if second > WHITE * first:
        said = "the noise is not white, or there is an event every few samples: the estimate may be"
        return noise, f"{said} too small; noise= says what is left of it in means"
    return noise, ""


def _off(f: np.ndarray, apart: int) -> np.ndarray:
    """Return how far second differences of samples apart are from their median."""
    second = f[2 * apart :] - 2 * f[apart:-apart] + f[: -2 * apart]
    return np.abs(second - np.median(second)) if len(second) else np.zeros(1)


def outliers(f: np.ndarray, noise: float, smooth: int) -> np.ndarray:
    """Return which samples stand alone, shape (n,): no force goes there and comes back at once."""
    from scipy.ndimage import median_filter  # slow to import

    found = np.zeros(len(f), dtype=bool)
    longest = min(LONGEST, smooth // 2)
    if longest < 1 or len(f) < 3 * LONGEST:
        return found
    steps = median_filter(np.abs(np.diff(f)), AROUND, mode="nearest")
    far = ALONE * np.maximum(noise, steps)
    padded = np.pad(f, LONGEST, mode="reflect")
    threes = np.median(np.lib.stride_tricks.sliding_window_view(padded, LONGEST), axis=1)
    n = len(f)
    for length in range(1, longest + 1):
        runs = np.lib.stride_tricks.sliding_window_view(f, length)
        before, after = threes[: len(runs)], threes[LONGEST + length : LONGEST + length + len(runs)]
        away = np.append(far, far[-1])[: len(runs)]
        above = runs.min(axis=1) > np.maximum(before, after) + away
        below = runs.max(axis=1) < np.minimum(before, after) - away
        for k in range(length):
            found[k : n - length + 1 + k] |= above | below
    return found if found.mean() <= FEW else np.zeros(n, dtype=bool)


def check_ends(f: np.ndarray, name: str) -> None:
    """Check that a sensor was not clipped: that its largest and smallest readings do not repeat.

    Raises:
        SceneError: they do, more often than noise and digits let them.
    """
    equal = np.diff(f) == 0
    for end, word in ((f.max(), "largest"), (f.min(), "smallest")):
        at = f == end
        inner = np.flatnonzero(~at)
        if not len(inner):
            return
        at = at[inner[0] : inner[-1] + 1]  # a curve may begin or end at rest
        others = equal[~(f[1:] == end)]
        chance = min(max(float(others.mean()) if len(others) else 0.0, 1e-12), 1 - 1e-12)
        longest = max(3, 2 + int(np.log(RARE / len(f)) / np.log(chance)))
        run = _longest(at)
        if run >= longest or (at.sum() >= OFTEN and chance < FINE):
            reason = f"the {word} reading stands in {at.sum()} samples, {run} in a row"
            allowed = "readings within the range of the sensor, and no number for a missing one; "
            allowed += f'valid={{"{name}": (low, high)}} of pyfric.measured.read makes others gaps'
            raise SceneError(name, float(end), "", allowed, reason)


def _longest(at: np.ndarray) -> int:
    """Return the length of the longest run of what is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
