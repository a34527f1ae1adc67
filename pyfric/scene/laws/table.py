"""Tables: functions that are straight between knots, and constant beyond them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pyfric.scene.errors import SceneError
from pyfric.scene.units import check_number, parse_quantity

__all__ = ["MAX_KNOTS", "Table", "from_csv", "sampled"]

MAX_KNOTS = 1000
"""Most knots of a table."""
MAX_BYTES = 1_048_576
"""Largest CSV file that is read."""
CLOSE = 1e-3
"""How close `sampled` follows a function, over its range."""


@dataclass(frozen=True)
class Table:
    """Knots x, which increase from 0, and the values y there."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __repr__(self) -> str:
        return f"<table of {len(self.x)} knots up to {self.x[-1]:.4g}>"

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


def from_csv(path: str | Path, field: str = "interface.law", unit: str = "") -> Table:
    """Return the table in a CSV file of two columns.

    Empty lines and lines that start with # are left out. The first line may have the names of the
    columns, with units in parentheses: "slip (um), mu". Without units numbers are in SI units.

    Args:
        path: the file, in UTF-8.
        field: name of the table, for messages.
        unit: SI unit of the first column; the second one has none.

    Raises:
        SceneError: the file cannot be read or is too large, has other columns or too many rows, or
            a value is no number, negative or out of order; with file, row, column and value.
    """
    lines = _lines(path, field)
    names, written = _header(path, lines, field, unit)
    rows: list[list[float]] = []
    for n, cells in lines:
        if len(cells) != 2:
            raise _refused(field, ",".join(cells), "two columns", path, f"row {n}: {len(cells)}")
        row = []
        for name, cell, given, si in zip(names, cells, written, (unit, ""), strict=True):
            where = f"row {n}, column {name}"
            try:
                number = parse_quantity(field, f"{cell} {given}", si) if given else float(cell)
                row.append(check_number(field, number, si, ge=0.0))
            except ValueError as error:
                allowed, reason = (
                    getattr(error, "allowed", "a number"),
                    getattr(error, "reason", ""),
                )
                where += f": {reason}" if reason else ": not a number"
                raise _refused(field, cell, allowed, path, where) from None
        if row[0] <= rows[-1][0] if rows else row[0] != 0:
            allowed = f"more than {rows[-1][0]!r} {unit}" if rows else f"0 {unit}"
            where = f"row {n}, column {names[0]}: {'out of order' if rows else 'tables start at 0'}"
            raise _refused(field, row[0], allowed.strip(), path, where)
        rows.append(row)
    if not 2 <= len(rows) <= MAX_KNOTS:
        raise _refused(field, len(rows), f"2 to {MAX_KNOTS} rows of numbers", path, "rows")
    x, y = zip(*rows, strict=True)
    return Table(x, y)


def _refused(field: str, value: Any, allowed: str, path: str | Path, where: str) -> SceneError:
    return SceneError(field, value, "", allowed, f"{path}, {where}")


def _lines(path: str | Path, field: str) -> list[tuple[int, list[str]]]:
    """Return the number of each line that says something, and its cells."""
    allowed = f"a CSV file with two columns of numbers, of at most {MAX_BYTES} bytes"
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
        text = content.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(field, str(path), "", allowed, reason) from None
    if len(content) > MAX_BYTES:
        raise SceneError(field, str(path), "", allowed, "too large")
    lines = enumerate(map(str.strip, text.splitlines()), 1)
    return [(n, [*map(str.strip, line.split(","))]) for n, line in lines if line and line[0] != "#"]


def _header(
    path: str | Path, lines: list[tuple[int, list[str]]], field: str, unit: str
) -> tuple[tuple[str, str], tuple[str, str]]:
    """Return the names of the columns, and their units if any; a line of them is taken away."""
    names, units = ["1", "2"], ["", ""]
    if not lines or any(map(_is_number, lines[0][1])):
        return (names[0], names[1]), (units[0], units[1])
    n, cells = lines.pop(0)
    for c, (cell, si) in enumerate(zip(cells[:2], (unit, ""), strict=False)):
        name, _, written = cell.partition("(")
        names[c], units[c] = f"{c + 1} ({name.strip()})", written.rstrip(") ")
        if units[c]:
            try:
                parse_quantity(field, f"1 {units[c]}", si)
            except SceneError as error:
                where = f"row {n}, column {names[c]}: {error.reason}"
                raise _refused(field, cell, f"a unit of {si or '1'}", path, where) from None
    return (names[0], names[1]), (units[0], units[1])


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
