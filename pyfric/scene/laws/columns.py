"""Tables from CSV files with two columns of numbers and their units; measured curves.

Messages quote only numbers and heads of columns from a file, because a wrong path may name a file
with other content.
"""

from __future__ import annotations

import csv
import os
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyfric.scene.laws.kinds import MAX_KNOTS, Table
from pyfric.values import (
    NAMES,
    SCALED,
    Line,
    SceneError,
    check_number,
    check_whole,
    is_number,
    lines_of,
    naming,
    parse_quantity,
    read_at_most,
    unit_among,
    unit_in,
)

MAX_BYTES = 1_048_576
"""Largest CSV file that is read."""
TWO_COLUMNS = "two columns, separated by semicolons or tabs where numbers have decimal commas"
PASSES = 4
"""Number of iterations that space knots evenly along the curve."""
ROUNDED = 1e-12
"""Relative fall of mu below which a curve counts as flat, due to rounding of least squares."""


@dataclass(frozen=True)
class Measured:
    """A measured, noisy curve of mu over slip.

    Its table is the piecewise linear, non-increasing curve that fits the rows in least squares.
    Unlike an envelope, this curve keeps the mean of mu, and so the fracture energy. Knots are
    evenly spaced along the curve: between neighbours, the sum of relative slip and relative loss of
    mu is the same. Slip counts from its smallest value. An interface without mu_s and mu_k takes
    them from the ends of the curve.

    Args:
        path: a CSV file of two columns, see `from_csv`; rows may be in any order.
        knots: number of knots, at least 2, at most the number of different slips.
    """

    path: str | os.PathLike[str]
    knots: int = field(default=20, kw_only=True)

    def __post_init__(self) -> None:
        check_whole("knots", self.knots, 2, MAX_KNOTS)

    def table(self, name: str, unit: str) -> Table:
        """Return the table; name of the field and SI unit of the slip are as in `from_csv`.

        Raises:
            SceneError: see `from_csv`; or mu does not fall.
        """
        read = _read(self.path, name, unit)
        slip = np.array(read.x) - min(read.x)
        n = min(self.knots, len(np.unique(slip)))
        knots = np.linspace(0.0, slip.max(), n)
        for _ in range(PASSES):
            mu = _falling(knots, slip, np.array(read.y))
            if n < 2 or not mu[0] - mu[-1] > ROUNDED * mu[0]:
                raise _refused(name, None, "mu that falls with slip", self.path, "it does not fall")
            along = knots / knots[-1] + (mu[0] - mu) / (mu[0] - mu[-1])
            last, knots = knots, np.interp(np.linspace(0.0, along[-1], n), along, knots)
        places = tuple(f"{os.fspath(self.path)}, knot {k}" for k in range(1, n + 1))
        return Table(tuple(last.tolist()), tuple(mu.tolist()), places).checked(name, unit)


def _falling(knots: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the non-increasing values >= 0 at knots that fit y at x in least squares."""
    from scipy.optimize import nnls  # slow to import

    shares = np.array([np.interp(x, knots, unit) for unit in np.eye(len(knots))]).T
    sums = np.triu(np.ones((len(knots), len(knots))))  # a value is the sum of the falls after it
    return sums @ nnls(shares @ sums, y)[0]


def from_csv(path: str | os.PathLike[str], name: str, unit: str) -> Table:
    """Return the table in a CSV file of two columns.

    Empty lines and lines that start with # are ignored. The first line, or a line with # above the
    numbers, may name the columns with their units: "slip (um),mu", "slip [um],mu", "slip/um,mu",
    "slip_um,mu" or "um,-". Without units, numbers are in SI units. Without units, the first head
    may have no digit, and no head a factor such as 10^-6. Commas, semicolons, tabs or blanks
    separate the columns. Numbers may have decimal commas if commas do not separate the columns.

    Args:
        path: the file, in UTF-8.
        name: name of the field, for errors.
        unit: SI unit of the first column; the second one has no unit.

    Raises:
        SceneError: the file cannot be read, is not a regular file or is too large; it has other
            columns, too many rows or an unclear unit; or a value is not a number, negative or out
            of order. The message names file, row and column.
    """
    table = _read(path, name, unit, ge=0.0)
    if not 2 <= len(table.x) <= MAX_KNOTS:
        allowed = f"2 to {MAX_KNOTS} rows of numbers, or a curve said to be measured"
        raise _refused(name, len(table.x), allowed, path, "rows")
    return table.checked(name, unit)


def _read(path: str | os.PathLike[str], name: str, unit: str, ge: float | None = None) -> Table:
    """Return the rows of a file in SI units, in their order; slip must be at least `ge`."""
    comments, heads, rows = _lines(path, name)
    columns = ((unit, ge), ("", 0.0))
    try:
        written = _units(comments, heads, rows[0].n, unit)
    except ValueError as error:
        allowed = f'heads such as "name ({unit})", "name/{unit}" or "name_{unit}"'
        raise _refused(name, None, allowed, path, str(error)) from None
    numbers: tuple[list[float], list[float]] = ([], [])
    for n, cells in rows:
        for c, (cell, given, (si, least)) in enumerate(zip(cells, written, columns, strict=True)):
            with naming(where=f"{os.fspath(path)}, row {n}, column {c + 1}"):
                number = parse_quantity(name, f"{cell} {given}", si) if given else float(cell)
                numbers[c].append(check_number(name, number, si, ge=least))
    places = tuple(f"{os.fspath(path)}, row {n}" for n, _ in rows)
    return Table(tuple(numbers[0]), tuple(numbers[1]), places)


def _lines(path: str | os.PathLike[str], name: str) -> tuple[list[Line], Line | None, list[Line]]:
    """Return the comments of a file, the heads of its two columns (or None), and its numbers."""
    allowed = f"a CSV file with two columns of numbers, of at most {MAX_BYTES} bytes"
    try:
        content = read_at_most(path, MAX_BYTES + 1)
        text = content.decode("utf-8-sig") if len(content) <= MAX_BYTES else ""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no text in UTF-8"
        raise SceneError(name, os.fspath(path), "", allowed, reason) from None
    if len(content) > MAX_BYTES:
        raise SceneError(name, os.fspath(path), "", allowed, "too large")
    try:
        comments, rows, apart, _ = lines_of(text)
    except (csv.Error, ValueError) as error:
        raise _refused(
            name, None, "rows of numbers with decimal points", path, str(error)
        ) from None
    named = bool(rows) and len(rows[0].cells) == 2 and not any(map(is_number, rows[0].cells))
    heads = rows.pop(0) if named else None
    for n, cells in rows:
        if len(cells) != 2:
            where = f"row {n}: {len(cells)} columns, separated by {NAMES[apart]}"
            raise _refused(name, None, TWO_COLUMNS, path, f"{where}{_cause(cells, heads)}")
        for c, cell in enumerate(cells, 1):
            if not is_number(cell):
                where = f"row {n}, column {c}: not a number{_cause(cells, heads)}"
                raise _refused(name, None, "a number", path, where)
    if not rows:
        raise _refused(name, 0, f"2 to {MAX_KNOTS} rows of numbers", path, "rows")
    return comments, heads, rows


def _cause(cells: list[str], heads: Line | None) -> str:
    """Return why a row may not be two numbers, and what to do; "" if it is not known."""
    if len(cells) == 4:  # probably decimal commas
        return ""
    if heads is not None and not any(map(is_number, cells)):
        return "; if this row has units, write them in the heads, such as 'slip (um)'"
    return "; keep those of slip (or time, or speed) and of mu" if len(cells) > 2 else ""


def _units(comments: list[Line], heads: Line | None, first: int, si: str) -> tuple[str, str]:
    """Return the units in the heads of the two columns, "" for SI units; numbers begin at `first`.

    Raises:
        ValueError: a head names an unclear unit, or only a comment names a unit.
    """
    for n, cells in comments:  # as numpy.savetxt writes heads
        if heads is None and n == first - 1 and len(cells) == 2:
            text = " ".join(cells)
            heads = Line(n, cells) if SCALED.search(text) or not re.search(r"\d", text) else None
    found = ["", ""]
    for c, (cell, unit) in enumerate(zip(heads.cells, (si, ""), strict=True) if heads else ()):
        try:
            found[c] = unit_in(cell, unit)
        except ValueError as error:
            raise ValueError(f"row {heads.n}, column {c + 1}, {cell!r}: {error}") from None
    for n, cells in comments if not found[0] else ():
        if word := unit_among(" ".join(cells), si):
            raise ValueError(f"row {n}: a comment names {word}, but no column head has a unit")
    return found[0], found[1]


def _refused(name: str, value: Any, allowed: str, path: Any, where: str) -> SceneError:
    return SceneError(name, value, "", allowed, f"{os.fspath(path)}, {where}")
