"""Tables: functions that are straight between knots, and constant beyond them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pyfric.scene.units import SceneError, check_number

__all__ = ["MAX_KNOTS", "Table", "from_csv", "sampled"]

MAX_KNOTS = 1000
"""Most knots of a table."""
CLOSE = 1e-3
"""How close `sampled` follows a function, over its range."""


@dataclass(frozen=True)
class Table:
    """Knots x, which increase from 0, and the values y there."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __call__(self, x: Any) -> Any:
        """Return the values at x, any shape."""
        return np.interp(x, self.x, self.y)

    @property
    def slopes(self) -> np.ndarray:
        """The slope between each pair of knots."""
        return np.diff(self.y) / np.diff(self.x)

    @property
    def area(self) -> float:
        """Integral over all knots."""
        return float(np.trapezoid(self.y, self.x))

    def checked(self, field: str, unit: str) -> Table:
        """Return the table if its knots are in order, and its values finite.

        Raises:
            SceneError: they are not.
        """
        if len(self.x) != len(self.y) or not 2 <= len(self.x) <= MAX_KNOTS:
            allowed = f"2 to {MAX_KNOTS} knots, each with one value"
            raise SceneError(field, [len(self.x), len(self.y)], "", allowed, "lengths do not fit")
        for n, (x, y) in enumerate(zip(self.x, self.y, strict=True), 1):
            try:
                check_number(field, x, unit, ge=0.0)
                check_number(field, y, "")
            except SceneError as error:
                reason = f"knot {n}: {error.reason}"
                raise SceneError(field, error.value, unit, error.allowed, reason) from None
        if self.x[0] != 0:
            raise SceneError(field, self.x[0], unit, f"0 {unit}", "knot 1: tables start at 0")
        falls = np.flatnonzero(np.diff(self.x) <= 0)
        if falls.size:
            n = int(falls[0]) + 1
            allowed = f"more than {self.x[n - 1]!r} {unit}: laws do not jump"
            raise SceneError(field, self.x[n], unit, allowed, f"knot {n + 1}: not beyond the last")
        return self


def sampled(function: Callable[[float], float], end: float, *, close: float = CLOSE) -> Table:
    """Return a table that follows a function on [0, end].

    Intervals are halved until the chord is within `close` of the function at their quarters, over
    the range of the function on 17 points.

    Args:
        function: takes and returns a number.
        end: end of the table, in the unit of its argument.
        close: distance allowed, over the range of the function.

    Raises:
        SceneError: a value is not a finite number, or `MAX_KNOTS` do not follow the function.
    """
    end = check_number("end", end, "", gt=0.0)

    def value(x: float) -> float:
        return check_number(f"the law at {x:.6g}", function(x), "")

    coarse = [value(end * n / 16) for n in range(17)]
    allowed = close * (max(coarse) - min(coarse))
    x, y, todo = [0.0], [coarse[0]], [(0.0, end)]
    while todo:
        a, b = todo.pop()
        y_a, y_b = value(a), value(b)
        off = max(
            abs(value(a + share * (b - a)) - (y_a + share * (y_b - y_a)))
            for share in (0.25, 0.5, 0.75)
        )
        if off > allowed and len(x) + len(todo) > MAX_KNOTS:
            reason = "it jumps, or is too rough"
            raise SceneError("law", b, "", f"a function that {MAX_KNOTS} knots follow", reason)
        if off > allowed:
            todo += [((a + b) / 2, b), (a, (a + b) / 2)]
        else:
            x.append(b)
            y.append(y_b)
    return Table(tuple(x), tuple(y))


def from_csv(path: str | Path) -> Table:
    """Return the table in a CSV file of two columns; lines that start with # are left out.

    Raises:
        SceneError: the file cannot be read, or has other columns.
    """
    allowed = "a CSV file with two columns of numbers"
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
        rows = [_row(line) for line in lines if line.strip() and not line.startswith("#")]
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError("interface.law", str(path), "", allowed, reason) from None
    x, y = zip(*rows, strict=True) if rows else ((), ())
    return Table(x, y)


def _row(line: str) -> tuple[float, float]:
    x, y = map(float, line.split(","))
    return x, y
