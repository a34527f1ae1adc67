"""Where a label changes: a line in a plane of two parameters, and a map that is finer there.

    def label(theta, h):
        (record,) = run_all([Job(scene=setup2(theta=theta, h=h), t_end=1.0)])
        return "precursors" if len(analysis.precursors(record)) else "none"

    line = boundary(label, along=(-1.0, 1.0), over=[1e-3, 2e-3, 3e-3], scale="linear")

A label costs a run, so runs are what counts. The first point of a line is found by bisection of the
whole range. The next ones are warm: the points before say where the line will be; a first run tells
the side, a second one, further on, brackets the line, and bisection does the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd

from pyfric.scene import SceneError, at_once, check_number

__all__ = ["boundary", "label_map"]

Label = Callable[[float, float], Hashable]
Scale = Literal["log", "linear"]

DEGREES = 4
"""Predictions are polynomials of degree 0 to 3 through the last points."""
NEAR, FAR = 2.0, 8.0
"""First step across the line, over the tolerance: 3 runs in all where the prediction was off by
less than the first, 5 where it was off by less than the second. Further steps double."""
FAINT = 1e-3
"""Weight of a cell whose corners have one label, over that of one where labels differ."""


class _Range:
    """A range of a parameter; s runs from 0 to 1 over it, evenly in its scale."""

    def __init__(self, name: str, ends: Sequence[float], scale: str) -> None:
        if scale not in ("log", "linear"):
            raise SceneError("scale", scale, "", "'log' or 'linear'")
        allowed = "two numbers, the lower one first"
        if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
            raise SceneError(name, ends, "", allowed)
        least = 0.0 if scale == "log" else None
        self.low, self.high = (check_number(name, value, "", gt=least) for value in ends)
        if not self.low < self.high:
            raise SceneError(name, ends, "", allowed)
        self.log = scale == "log"

    @property
    def decades(self) -> float:
        return math.log10(self.high / self.low)

    def value(self, s: float) -> float:
        if s in (0.0, 1.0):
            return self.high if s else self.low
        if self.log:
            return self.low * 10 ** (s * self.decades)
        return self.low + s * (self.high - self.low)


@at_once()
def boundary(
    f: Label,
    along: tuple[float, float],
    over: Sequence[float] | np.ndarray,
    *,
    scale: Scale = "log",
    tolerance: float = 1e-3,
) -> pd.DataFrame:
    """Follow a line on which a label changes.

    At each value of `over` the line is where the label stops being the one at the lower end of
    `along`. After a value at which there is no line, the next one begins with the whole range.

    Args:
        f: a function of a value along and a value over that returns a label: text, a truth value or
            anything else that can be compared. Where it makes its runs with `run_all`, they are
            kept, and a line that was stopped goes on.
        along: ends of the range that is searched, the lower one first.
        over: values at which the line is wanted, rising or falling: neighbours help each other.
        scale: of the range: "log" or "linear".
        tolerance: width of the last bracket: in decades, or over the length of a linear range.

    Returns:
        One row for each value of `over`: ``over``; ``along``, the middle of the bracket, in the
        scale, and its ends ``low`` and ``high``, NaN where both ends of the range have one label;
        ``below`` and ``above``, the labels at the ends of the bracket; ``runs``, how often f was
        called; ``warm``, whether two or more neighbours said where to look.

    Raises:
        SceneError: an argument is refused; f has not been called.
    """
    within = _Range("along", along, scale)
    tolerance = check_number("tolerance", tolerance, "", gt=0.0, lt=1.0)
    values = [check_number("over", value, "") for value in over]
    steps = np.diff(values)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise SceneError("over", over, "", "rising or falling values")
    line = _Line(f, within, tolerance / within.decades if within.log else tolerance)
    return pd.DataFrame([line.point(value) for value in values], columns=_Line.columns)


class _Line:
    """A line so far."""

    columns = ("over", "along", "low", "high", "below", "above", "runs", "warm")

    def __init__(self, f: Label, within: _Range, width: float) -> None:
        self.f, self.within, self.width = f, within, width
        self.known: list[tuple[float, float]] = []  # over, s
        self.below: Hashable = None
        self.step = FAR

    def point(self, over: float) -> tuple[Any, ...]:
        """Return the row of the next value."""
        labels: dict[float, Hashable] = {}

        def is_below(s: float) -> bool:
            if s not in labels:
                labels[s] = self.f(self.within.value(s), over)
            return labels[s] == self.below

        neighbours, bracket, guess = len(self.known), None, math.nan
        if neighbours:
            guess = min(max(self._predicted(over), 0.0), 1.0)
            bracket = self._across(guess, is_below)
        if bracket is None:
            self.known, neighbours, bracket = [], 0, (0.0, 1.0)
            is_below(0.0)
            self.below = labels[0.0]
            if is_below(1.0):
                none = (math.nan, math.nan, math.nan)
                return over, *none, self.below, self.below, len(labels), False
        low, high = self._bisected(*bracket, is_below)
        s, value = (low + high) / 2, self.within.value
        self.step = NEAR if abs(s - guess) < NEAR * self.width else FAR
        self.known = [*self.known, (over, s)][-DEGREES - 2 :]
        ends = value(s), value(low), value(high)
        return over, *ends, labels[low], labels[high], len(labels), neighbours > 1

    def _predicted(self, over: float) -> float:
        """Return where the line should be, by the degree that was best for the last two points.

        The next higher one is tried where none of them was good.
        """
        most = len(self.known) - 1
        misses = [self._miss(points) for points in range(1, min(most, DEGREES) + 1)]
        points = 1 + int(np.argmin(misses)) if misses else 1
        if most == 1 or (misses and points == len(misses) and min(misses) > self.width):
            points += 1
        return _extended(self.known[-min(points, DEGREES) :], over)

    def _miss(self, points: int) -> float:
        """Return how far predictions from so many points were off, but no less than the width."""
        known = self.known
        tried = [n for n in (len(known) - 1, len(known) - 2) if n >= points]
        return max(
            self.width,
            *(abs(_extended(known[n - points : n], known[n][0]) - known[n][1]) for n in tried),
        )

    def _across(
        self, guess: float, is_below: Callable[[float], bool]
    ) -> tuple[float, float] | None:
        """Return a bracket that is found from a guess; None where the range ends before it."""
        side = is_below(guess)
        step = (self.step if side else -self.step) * self.width
        before = guess
        while 0.0 < before < 1.0 or before == guess:
            here = min(max(before + step, 0.0), 1.0)
            if here == before:
                break
            if is_below(here) != side:
                return min(before, here), max(before, here)
            before, step = here, 2 * step
        return None

    def _bisected(
        self, low: float, high: float, is_below: Callable[[float], bool]
    ) -> tuple[float, float]:
        while high - low > (1 + 1e-9) * self.width:
            middle = (low + high) / 2
            low, high = (middle, high) if is_below(middle) else (low, middle)
        return low, high


def _extended(points: Sequence[tuple[float, float]], over: float) -> float:
    """Return the polynomial through all points, at another value (Lagrange's formula)."""
    return sum(
        s * math.prod((over - other) / (at - other) for other, _ in points if other != at)
        for at, s in points
    )


# --- maps ----------------------------------------------------------------------------------------


@at_once()
def label_map(
    f: Label,
    x: tuple[float, float],
    y: tuple[float, float],
    runs: int,
    *,
    scales: tuple[Scale, Scale] = ("linear", "linear"),
) -> pd.DataFrame:
    """Return labels in a rectangle, at more points where they differ.

    Triangles between the points are divided, the largest first, those whose corners differ before
    others. Needs the package `adaptive`, the extra ``pyfric[sweeps]``.

    Args:
        f: a function of x and y that returns a label.
        x, y: ends of the ranges, the lower ones first.
        runs: how often f is called, at least 4.
        scales: of the ranges of x and y: "log" or "linear".

    Returns:
        ``x``, ``y`` and ``label`` of each point, in the order of the calls.

    Raises:
        SceneError: an argument is refused; f has not been called.
        ImportError: `adaptive` is not installed.
    """
    ranges = [
        _Range(name, ends, scale) for name, ends, scale in zip("xy", (x, y), scales, strict=True)
    ]
    if isinstance(runs, bool) or not (isinstance(runs, int) and runs >= 4):
        raise SceneError("runs", runs, "", "a whole number >= 4")
    import adaptive

    rows: list[tuple[float, float, Hashable]] = []
    numbers: dict[Hashable, int] = {}

    def number(at: tuple[float, float]) -> float:
        here = [one.value(float(s)) for one, s in zip(ranges, at, strict=True)]
        label = f(*here)
        rows.append((*here, label))
        return float(numbers.setdefault(label, len(numbers)))

    def weight(simplex: np.ndarray, values: Sequence[float], _: float) -> float:
        (a, b), (c, d) = np.asarray(simplex)[1:] - np.asarray(simplex)[0]
        return abs(a * d - b * c) * (1.0 if len(set(values)) > 1 else FAINT)

    unit = [(0.0, 1.0)] * 2
    learner = adaptive.LearnerND(number, bounds=unit, loss_per_simplex=weight)
    adaptive.runner.simple(learner, npoints_goal=runs)
    return pd.DataFrame(rows, columns=["x", "y", "label"])
