"""Lines on which a label changes in a plane of two parameters, and maps refined at these lines.

    def label(theta, h):
        (record,) = run_all([Job(scene=setup2(theta=theta, h=h), t_end=1.0)])
        return "precursors" if len(analysis.precursors(record)) else "none"

    line = boundary(label, along=(-1.0, 1.0), over=[1e-3, 2e-3, 3e-3], scale="linear")

Each label costs a run, so the search needs few labels. The first point of a line is found by
bisection. For each later point, the earlier points predict where the line is. A first run at the
prediction shows on which side the line lies. A second run lies on this side, at half the error of
the last prediction. Further runs, each twice as far away as the previous run, bracket the line.
Bisection then narrows the bracket. Between known labels, steps are so short that each point needs
at most one run more than bisection.

A label may be the sign of a continuous number, such as a speed minus a limit. If a function
`measure` gives this number, the line is its root. Interpolation between the ends of the bracket
finds the root in two or three runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from typing import Any, get_args

import numpy as np
import pandas as pd

from pyfric.signals import at_once
from pyfric.sweeps.varied import Scale, Span
from pyfric.values import SceneError, check_number, check_whole

Label = Callable[[float, float], Hashable]
Measure = Callable[[float, float], float]

POINTS = 3
"""Number of last points of a line through which a parabola predicts the next point."""
FIRST = 16.0
"""First step across the line from the second point on, over the width of the last bracket."""
NEAR = 0.9
"""If a root is nearer to one end of its bracket than this share of the wanted width, the next run
is on the other side of the root."""
FAINT = 1e-3
"""Weight of a cell whose corners have the same label, over that of a cell with different labels."""


def _span(name: str, ends: Sequence[float], scale: Scale) -> Span:
    """Return the range of a parameter."""
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
        raise SceneError(name, ends, "", "two numbers, the lower one first")
    try:
        return Span(start=ends[0], stop=ends[1], scale=scale).in_si("", "")
    except SceneError as error:
        raise error.at(f"{name}.{error.field.lstrip('.')}") from None


def _one(label: Hashable) -> Hashable:
    """Return a label; every NaN becomes the same object, so that `in` finds it in a list."""
    if not isinstance(label, Hashable):
        allowed = "text, a number or a truth value"
        raise SceneError("f", type(label).__name__, "", allowed, "no label to compare")
    nan = isinstance(label, float | np.floating) and math.isnan(label)
    return math.nan if nan else label


def _measured(number: float) -> float:
    """Return the number that `measure` has returned; it may be NaN."""
    try:
        return float(number)
    except (TypeError, ValueError):
        raise SceneError("measure", number, "", "a function that returns a number") from None


@at_once()
def boundary(
    f: Label,
    along: tuple[float, float],
    over: Sequence[float] | np.ndarray,
    *,
    scale: Scale = "log",
    over_scale: Scale = "linear",
    tolerance: float = 1e-3,
    known: pd.DataFrame | None = None,
    measure: Measure | None = None,
) -> pd.DataFrame:
    """Follow a line on which a label changes.

    At each value of `over`, the line is where the label first differs from the label at the lower
    end of `along`. After a value without a line, the search begins again in the whole range.

    Args:
        f: a function of a value of `along` and a value of `over`. f returns a label that can be
            compared, such as text or a truth value; NaN is a label, too. If f makes runs with
            `run_all`, finished runs are stored, and a line that was stopped goes on. Runs of f may
            share one verification (`pyfric.Shared`).
        along: ends of the searched range, the lower end first.
        over: values at which the line is wanted, rising or falling.
        scale: scale of the range, "log" or "linear".
        over_scale: scale of `over` in which the line is smooth, "log" or "linear".
        tolerance: largest error of the line: in decades, or over the length of a linear range.
        known: labels that are already known, such as those of a map: columns ``along``, ``over``
            and ``label``, and ``measure`` if it is given. Known labels within the range bracket the
            line.
        measure: a function of the same values, called after f. `measure` returns a number that
            passes zero continuously where the label changes, or NaN if it is unknown.

    Returns:
        One row for each value of `over`. Columns: ``over``; ``along``, the middle of the last
        bracket; ``low`` and ``high``, its ends; ``below`` and ``above``, their labels; ``runs``,
        how often f was called. If both ends of the range have the same label, the values are NaN.

    Raises:
        SceneError: an argument is refused, and f has not been called; f returns no label; or
            measure returns no number.
    """
    span = _span("along", along, scale)
    tolerance = check_number("tolerance", tolerance, "", gt=0.0, lt=0.5)
    if over_scale not in get_args(Scale):
        raise SceneError("over_scale", over_scale, "", "'linear' or 'log'")
    if known is not None and not {"along", "over", "label"} <= set(known):
        raise SceneError("known", list(known), "", "columns along, over and label")
    if np.ndim(over) != 1 or isinstance(over, str):
        raise SceneError("over", over, "", "a list of values, rising or falling")
    least = 0.0 if over_scale == "log" else None
    values = [check_number("over", value, "", gt=least) for value in over]
    steps = np.diff(values)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise SceneError("over", over, "", "rising or falling values")
    names = ["along", "over", "label", "measure"]
    known = (pd.DataFrame() if known is None else known).reindex(columns=names)
    line = _Line(f, measure, span, known, tolerance)
    rows = [line.point(over, math.log(over) if over_scale == "log" else over) for over in values]
    return pd.DataFrame(rows, columns=_Line.columns)


class _Line:
    """The points of a line, and the known labels at its next value of `over`.

    Positions and widths are shares of the range.
    """

    columns = ("over", "along", "low", "high", "below", "above", "runs")

    def __init__(
        self, f: Label, measure: Measure | None, span: Span, known: pd.DataFrame, tolerance: float
    ) -> None:
        self.f, self.measure, self.span, self.known = f, measure, span, known
        decades = math.log10(span.stop / span.start) if span.scale == "log" else 1.0
        self.width = 2 * tolerance / decades
        self.step = FIRST * self.width
        self.points: list[tuple[float, float]] = []  # `over` in its scale, position
        self.below: Hashable = None

    def point(self, over: float, x: float) -> tuple[Any, ...]:
        """Return the row of the next value of `over`; x is this value in its scale."""
        self.over, self.runs = over, 0
        rows = self.known[np.isclose(self.known["over"], over, rtol=1e-9, atol=0.0)]
        rows = rows.assign(share=[*map(self.span.share, rows["along"])])
        pairs = zip(rows["share"], rows["label"], strict=True)
        self.labels = {at: _one(label) for at, label in sorted(pairs) if 0 <= at <= 1}
        self.numbers = dict(zip(rows["share"], rows["measure"], strict=True))
        guess, bracket = None, None
        if self.points:
            low, high = self.ends()
            guess = min(max(_extended(self.points[-POINTS:], x), low), high)
            bracket = self._narrowed(low, high, guess)
        if bracket is None:
            self.points.clear()
            self.step = FIRST * self.width
            guess, self.below = None, self.label(min(self.labels, default=0.0))
            low, high = self.ends()
            if self.is_below(high) and not self.is_below(0.0):
                self.below = self.label(0.0)  # no known label was below the line
                low, high = self.ends()
            if not self.is_below(high):
                bracket = self._narrowed(low, high)
        if bracket is None:
            return over, math.nan, math.nan, math.nan, self.below, self.below, self.runs
        low, high = bracket
        middle = (low + high) / 2
        if guess is not None:
            half = max(abs(middle - guess) / 2 / self.width, 1.0)
            self.step = self.width * 2 ** math.ceil(math.log2(half))
        self.points.append((x, middle))
        places = map(self.span.at, (middle, low, high))
        return over, *places, self.label(low), self.label(high), self.runs

    def label(self, share: float) -> Hashable:
        if share not in self.labels:
            at = self.span.at(share), self.over
            self.labels[share] = _one(self.f(*at))
            self.runs += 1
            if self.measure is not None:
                self.numbers[share] = _measured(self.measure(*at))
        return self.labels[share]

    def is_below(self, share: float) -> bool:
        return self.label(share) in [self.below]

    def ends(self) -> tuple[float, float]:
        """Return the known bracket of the place at which the label changes."""
        above = (share for share, label in self.labels.items() if label not in [self.below])
        high = min(above, default=1.0)
        return max((share for share in self.labels if share < high), default=0.0), high

    def root(self, low: float, high: float) -> float | None:
        """Return the root of the measure between two positions; None if its sign does not change.

        The position as a function of the measure is interpolated by a parabola through these two
        points and a third point, whose measure is nearest to zero.
        """
        known = {share: number for share, number in self.numbers.items() if math.isfinite(number)}
        a, b = (known.get(share, math.nan) for share in (low, high))
        if not (a * b <= 0 and a != b):
            return None
        others = sorted(known.keys() - {low, high}, key=lambda share: abs(known[share]))
        ends = [(a, low), (b, high)]
        for share in others[:1]:
            root = _extended([*ends, (known[share], share)], 0.0)
            if low < root < high:
                return root
        return _extended(ends, 0.0)

    def _narrowed(
        self, low: float, high: float, guess: float | None = None
    ) -> tuple[float, float] | None:
        """Return a bracket narrowed to the wanted width; None if the range ends first.

        Runs are made where the line is expected. With a measure, the place is its root. Otherwise
        the first place is the guess. Further places move away from the guess until labels differ.
        In a known bracket, runs are so near to the middle that the search needs at most one run
        more than bisection.
        """
        left, step, guess_is_below = math.inf, self.step, None
        while high - low > (1 + 1e-9) * self.width:
            if left == math.inf and {low, high} <= self.labels.keys():
                left = math.ceil(math.log2((high - low) / self.width)) + 1
            left -= 1
            middle, root = (low + high) / 2, self.root(low, high)
            share = middle if guess is None else guess
            if root is not None:
                end = low if root < middle else high
                near = abs(root - end) < NEAR * self.width
                share = end + math.copysign(self.width, middle - root) if near else root
            reach = self.width * 2.0**left
            share = min(max(share, low, high - reach), high, low + reach)
            is_below = self.is_below(share)
            if share == (high if is_below else low):
                return None
            low, high = (share, high) if is_below else (low, share)
            if guess is not None:
                guess_is_below = is_below if guess_is_below is None else guess_is_below
                guess = share + (step if is_below else -step)
                guess, step = guess if is_below == guess_is_below else None, 2 * step
        return low, high


def _extended(points: Sequence[tuple[float, float]], x: float) -> float:
    """Return the polynomial through all points, at another x (Lagrange's formula)."""
    return sum(
        share * math.prod((x - other) / (at - other) for other, _ in points if other != at)
        for at, share in points
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
    """Return labels in a rectangle, with more points where they differ.

    Triangles between points are divided: first those with different labels, and of these the
    largest. The division needs the package `adaptive`.

    Args:
        f: a function of x and y that returns a label.
        x, y: ends of the ranges, the lower end first.
        runs: how often f is called, at least 4.
        scales: scales of the ranges of x and y: "log" or "linear".

    Returns:
        ``x``, ``y`` and ``label`` of each point, in the order of the calls.

    Raises:
        SceneError: an argument is refused, and f has not been called; or f returns no label.
        ImportError: `adaptive` is not installed.
    """
    if isinstance(scales, str) or len(scales) != 2:
        raise SceneError("scales", scales, "", "two of 'linear' and 'log', of x and y")
    spans = [_span(*given) for given in zip("xy", (x, y), scales, strict=True)]
    runs = check_whole("runs", runs, 4)
    import adaptive

    rows: list[tuple[float, float, Hashable]] = []
    numbers: dict[Hashable, int] = {}

    def number(at: tuple[float, float]) -> float:
        point = [span.at(float(share)) for span, share in zip(spans, at, strict=True)]
        label = _one(f(*point))
        rows.append((*point, label))
        return float(numbers.setdefault(label, len(numbers)))

    def weight(simplex: np.ndarray, values: Sequence[float], _: float) -> float:
        (a, b), (c, d) = np.asarray(simplex)[1:] - np.asarray(simplex)[0]
        return abs(a * d - b * c) * (1.0 if len(set(values)) > 1 else FAINT)

    unit = [(0.0, 1.0)] * 2
    learner = adaptive.LearnerND(number, bounds=unit, loss_per_simplex=weight)
    adaptive.runner.simple(learner, npoints_goal=runs)
    return pd.DataFrame(rows, columns=["x", "y", "label"])
