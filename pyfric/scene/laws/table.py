"""Tables: functions that are linear between knots and constant beyond the last one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyfric.scene.errors import SceneError, naming
from pyfric.scene.units import check_number

MAX_KNOTS = 1000
"""Largest number of knots of a table."""
CLOSE = 1e-3
"""Error of `sampled`, over the range of the function."""


@dataclass(frozen=True)
class Table:
    """Knots x, which increase from 0, and values y.

    For messages, `places` gives the origin of each knot, such as "friction.csv, row 3".
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    places: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return f"<table of {len(self.x)} knots up to {self.x[-1]:.4g}>"

    def place(self, n: int) -> str:
        """Return the origin of knot n, counted from 0."""
        return self.places[n] if self.places else f"knot {n + 1}"

    def __call__(self, x: Any) -> Any:
        """Return the values at x, of any shape."""
        return np.interp(x, self.x, self.y)

    @property
    def slopes(self) -> np.ndarray:
        """Slopes between neighbouring knots."""
        return np.diff(self.y) / np.diff(self.x)

    @property
    def area(self) -> float:
        """Integral over all knots."""
        return float(np.trapezoid(self.y, self.x))

    def checked(self, name: str, unit: str) -> Table:
        """Return the table after a check of its knots and values.

        Args:
            name: name of the field, for the error.
            unit: unit of the knots.

        Raises:
            SceneError: the knots are not in order, or a value is not finite.
        """
        if len(self.x) != len(self.y) or not 2 <= len(self.x) <= MAX_KNOTS:
            allowed = f"2 to {MAX_KNOTS} knots, each with one value"
            raise SceneError(name, [len(self.x), len(self.y)], "", allowed, "lengths do not fit")
        for n, (x, y) in enumerate(zip(self.x, self.y, strict=True)):
            with naming(where=self.place(n)):
                check_number(name, x, unit, ge=0.0)
                check_number(name, y, "")
        if self.x[0] != 0:
            reason = f"{self.place(0)}: tables start at 0"
            raise SceneError(name, self.x[0], unit, f"0 {unit}".strip(), reason)
        if (np.diff(self.x) <= 0).any():
            n = int(np.argmax(np.diff(self.x) <= 0)) + 1
            allowed = f"more than {self.x[n - 1]!r} {unit}".strip() + ": laws do not jump"
            reason = f"{self.place(n)}: not beyond the one before"
            raise SceneError(name, self.x[n], unit, allowed, reason)
        return self


def sampled(function: Callable[[float], float], end: float) -> Table:
    """Return a table that follows a function on [0, end].

    Intervals are halved until the chord is close to the function at their quarters. The allowed
    error is `CLOSE` times the range of the function on 17 points.

    Args:
        function: a function of one number.
        end: end of the table, in the unit of the argument.

    Raises:
        SceneError: a value is not a finite number, or more than `MAX_KNOTS` would be needed.
    """
    end = check_number("end", end, "", gt=0.0)

    def value(x: float) -> float:
        return check_number(f"the law at {x:.6g}", function(x), "")

    coarse = [value(end * n / 16) for n in range(17)]
    allowed = CLOSE * (max(coarse) - min(coarse))
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
            raise SceneError("law", b, "", f"a function that {MAX_KNOTS} knots can follow", reason)
        if off > allowed:
            todo += [((a + b) / 2, b), (a, (a + b) / 2)]
        else:
            x.append(b)
            y.append(y_b)
    return Table(tuple(x), tuple(y))
