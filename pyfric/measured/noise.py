"""Quality of samples: their noise, isolated readings, and clipping by a sensor.

Loggers have typical faults. An isolated reading may be a transmission error. A sensor beyond its
range repeats its largest reading. A curve from another code, or drawn through points, has no noise.
Each fault gives a note or an error before the search for events.
"""

from __future__ import annotations

import numpy as np

from pyfric.measured.lines import NORMAL, ROUNDED
from pyfric.values import SceneError

EQUAL = 0.01
"""Spread of time steps, over their median, up to which samples are equally spaced."""
WHITE, SMOOTH_LINE = 1.3, 3.5
"""Limits of the ratio of noise from every second sample to noise from all. The ratio is 1 for white
noise and 4 on a smooth line."""
FAR = 4.0
"""Limit of second differences, over their median. Events have larger second differences."""
ALONE, LONGEST, AROUND = 10.0, 3, 17
"""Readings are isolated if at most `LONGEST` of them are consecutive, and they differ from the
samples on either side by `ALONE` times the noise and the median step of the `AROUND` samples around
them."""
FEW = 0.05
"""Largest share of isolated readings; a larger share is part of the signal."""
RARE = 1e-6
"""Probability below which a run of equal readings at the end of the range is no accident."""
OFTEN, FINE = 5, 0.02
"""Number of equal readings at the end of the range that is no accident, if less than the share
`FINE` of readings equal the previous reading."""


def estimated(t: np.ndarray, f: np.ndarray) -> tuple[float, str]:
    """Return the standard deviation of white noise of samples, and a note on it.

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
    """Return the deviations of second differences, over `apart` samples, from their median."""
    second = f[2 * apart :] - 2 * f[apart:-apart] + f[: -2 * apart]
    return np.abs(second - np.median(second)) if len(second) else np.zeros(1)


def outliers(f: np.ndarray, noise: float, smooth: int) -> np.ndarray:
    """Return which samples are isolated, shape (n,): a force cannot jump and come back at once."""
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
    """Check that a sensor was not clipped: its largest and smallest readings do not repeat.

    Raises:
        SceneError: they repeat more often than noise and digits explain.
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
    """Return the length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
