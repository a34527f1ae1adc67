"""Tables from CSV files with two columns of numbers and their units; measured curves.

Messages quote only numbers and heads of columns from a file, because a wrong path may name a file
with other content.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from pyfric.scene.errors import SceneError, naming
from pyfric.scene.files import read_at_most
from pyfric.scene.laws.kinds import MAX_KNOTS, Table
from pyfric.scene.units import check_number, check_whole, parse_quantity

MAX_BYTES = 1_048_576
"""Largest CSV file that is read."""
NO_UNIT = ("", "-", "–", "1")
"""Texts that stand for no unit."""
PASSES = 4
"""Number of iterations that space knots evenly along the curve."""
ROUNDED = 1e-12
"""A curve whose mu falls by less than this share is flat: least squares round so."""
_BRACKETS = re.compile(r"[(\[<](?P<unit>[^()\[\]<>]*)[)\]>]\s*$")
_BETWEEN = re.compile(r"\s*(?P<sign>[/:|=,;])\s*|[\s_]+(?:in[\s_]+)?")
_MARKUP = re.compile(r"\\(?:mathrm|text|rm|[,;! ])|[${}]")
_WORD = re.compile(r"[A-Za-zµμ]+")
_LAST = re.compile(r"[A-Z]?[a-zµμ]+|[A-Z]+")
_BRACES = re.compile(r"^([^\\$]*)\{([^{}]*)\}$")
_INDEX = re.compile(r"\b([^\W\d]+)\d\b")
"""A digit at the end of a name, as in mu_2."""
_FACTOR = re.compile(r"[x*×·⋅]?\s*[\d^%‰⁰¹²³⁴-⁹⁻][\d^%‰⁰¹²³⁴-⁹⁻.eE*−-]*|[*×·⋅]")
"""What is left of a number, a power of ten, a product or a share."""
_SCALED = re.compile(r"[*×·⋅^⁰¹²³⁴-⁹]|\b1(?:e-?\d|0-\d|00+\b)", re.IGNORECASE)
"""What a comment with a factor has, and one with a date, a temperature or a number of a sample
has not."""
_SHARES = re.compile(r"per\W?cent|per\W?mill?e?|ppm", re.IGNORECASE)
WORDS = ("min", "dyn", "mus", "mud")
"""Units that are words of a friction coefficient: the minimum, dynamic friction, mu_s, mu_d."""


class _Line(NamedTuple):
    """A line of a file: its number, counted from 1, and its cells."""

    n: int
    cells: list[str]


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
    "slip_um,mu" or "um,-". Without units, numbers are in SI units. Then the first head may have no
    digit, and neither head a factor such as 10^-6. Commas, semicolons or tabs separate the columns.

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


def _lines(
    path: str | os.PathLike[str], name: str
) -> tuple[list[_Line], _Line | None, list[_Line]]:
    """Return the comments of a file, the heads of its two columns (or None), and its numbers."""
    allowed = f"a CSV file with two columns of numbers, of at most {MAX_BYTES} bytes"
    try:
        content = read_at_most(path, MAX_BYTES + 1)
        text = content.decode("utf-8-sig") if len(content) <= MAX_BYTES else ""
        lines = [(n, t) for n, t in enumerate(map(str.strip, text.splitlines()), 1) if t]
        plain = [(n, t) for n, t in lines if t[0] != "#"]
        apart = next((sign for sign in "\t;" if plain and sign in plain[-1][1]), ",")
        rows = _cells(plain, apart)
        comments = _cells([(n, t.lstrip("# ")) for n, t in lines if t[0] == "#"], apart)
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "no text in UTF-8"
        raise SceneError(name, os.fspath(path), "", allowed, reason) from None
    if len(content) > MAX_BYTES:
        raise SceneError(name, os.fspath(path), "", allowed, "too large")
    named = bool(rows) and len(rows[0].cells) == 2 and not any(map(_is_number, rows[0].cells))
    heads = rows.pop(0) if named else None
    for n, cells in rows:
        if len(cells) != 2:
            where = f"row {n}: {len(cells)} columns{_cause(cells, heads)}"
            raise _refused(name, None, "two columns", path, where)
        for c, cell in enumerate(cells, 1):
            if not _is_number(cell):
                where = f"row {n}, column {c}: not a number{_cause(cells, heads)}"
                raise _refused(name, None, "a number", path, where)
    if not rows:
        raise _refused(name, 0, f"2 to {MAX_KNOTS} rows of numbers", path, "rows")
    return comments, heads, rows


def _cause(cells: list[str], heads: _Line | None) -> str:
    """Return why a row may not be two numbers, and what to do; "" if it is not known."""
    digits = sum(cell.lstrip("+-").isdigit() for cell in cells)
    points = [cell.replace(",", ".") for cell in cells]
    if len(cells) == 4 and digits >= 3:
        return "; decimal commas need other separators than commas, such as semicolons"
    if points != cells and all(map(_is_number, points)):
        return "; it has decimal commas: write decimal points"
    if len(cells) == 1 and len(cells[0].split()) == 2:
        return "; separate columns by commas, semicolons or tabs"
    if heads is not None and not any(map(_is_number, cells)):
        return "; if this row has units, write them in the heads, such as 'slip (um)'"
    return "; keep those of slip (or time, or speed) and of mu" if len(cells) > 2 else ""


def _cells(lines: Iterable[tuple[int, str]], apart: str) -> list[_Line]:
    """Return the cells of each line, which `apart` separates."""
    return [
        _Line(n, [cell.strip() for cell in next(csv.reader([line], delimiter=apart))])
        for n, line in lines
    ]


def _units(comments: list[_Line], heads: _Line | None, first: int, si: str) -> tuple[str, str]:
    """Return the units in the heads of the two columns, "" for SI units; numbers begin at `first`.

    Raises:
        ValueError: a head names an unclear unit, or only a comment names a unit.
    """
    for n, cells in comments:  # as numpy.savetxt writes heads
        if heads is None and n == first - 1 and len(cells) == 2:
            text = " ".join(cells)
            heads = _Line(n, cells) if _SCALED.search(text) or not re.search(r"\d", text) else None
    found = ["", ""]
    for c, (cell, unit) in enumerate(zip(heads.cells, (si, ""), strict=True) if heads else ()):
        try:
            found[c] = _unit_in(cell, unit)
        except ValueError as error:
            raise ValueError(f"row {heads.n}, column {c + 1}, {cell!r}: {error}") from None
    for n, cells in comments if not found[0] else ():
        if word := _unit_among(" ".join(cells), si):
            raise ValueError(f"row {n}: a comment names {word}, but no column head has a unit")
    return found[0], found[1]


def _unit_in(head: str, si: str) -> str:
    """Return the unit in the head of a column, "" if there is none.

    Raises:
        ValueError: the unit is not understood.
    """
    head = _BRACES.sub(r"\1(\2)", head.strip())
    head = _MARKUP.sub("", head.replace("\\mu", "µ")).strip()
    brackets = _BRACKETS.search(head)
    if brackets or head in NO_UNIT:
        unit = brackets["unit"].strip() if brackets else head
        _check_name(head[: brackets.start()] if brackets else "", si)
        if unit == "" or (unit in NO_UNIT and not si):
            return ""
        if _fits(unit, si):
            return unit
        raise ValueError(f"{unit!r} is no unit of {si or 'a pure number'}")
    for between in [None, *_BETWEEN.finditer(head)]:
        unit = head if between is None else head[between.end() :]
        plain = len(unit) > 1 or unit == si or (between is not None and between["sign"])
        if plain and unit != "in" and _fits(unit, si):  # the h of t_h need not be a unit
            _check_name(head[: between.start()] if between else "", si)
            return unit
    if si and "/" in head:
        raise ValueError(f"the text after / is no unit of {si}")
    if word := _unit_among(head, si):
        raise ValueError(f"{word!r} is a unit; write it in brackets at the end of the head")
    last = re.split(r"[\s_]+", head)[-1]
    if si == "m" and last == "in":
        raise ValueError("'in' may be a unit; write inches as (in)")
    _check_name(head if si else head.removesuffix("/1"), si, index=not si)
    if re.search("[,;|=]", head):
        raise ValueError("a head is one name; write its unit in brackets at the end")
    if si or last in WORDS:
        return ""
    words = [head.rpartition("/")[2].strip(), *re.split(r"[^\w/]+", head)]
    words += [last] if len(last) > 1 or "/" not in head else []  # N of F_T/F_N is an index
    for word in words:
        lengths = ("m", "s", "m/s") if len(word) > 1 else ()
        if any(_fits(word, unit) for unit in ("N", "Pa", *lengths)):
            raise ValueError(f"{word!r} is a unit, and a friction coefficient has none")
    return ""


def _check_name(name: str, si: str, *, index: bool = True) -> None:
    """Check that a head without its unit has no number but an index, and no share such as ‰.

    Raises:
        ValueError: it has one.
    """
    name = _INDEX.sub(r"\1", name) if index else name
    if left := _FACTOR.search(name) or (None if si else _SHARES.search(name)):
        instead = "write a unit such as um" if si else "a friction coefficient has none"
        raise ValueError(f"{left[0].strip()!r} is a factor, not a unit; {instead}")


def _unit_among(text: str, si: str) -> str:
    """Return a word of a text that is a possible unit of a column, or a part of one; else ""."""
    for word in _WORD.findall(text) if si else ():
        for form in (word, word.lower(), _LAST.findall(word)[-1].lower()):
            if form != "in" and (_fits(form, si) or (si == "m/s" and _fits(form, "m"))):
                return word
    return ""


def _fits(unit: str, si: str) -> bool:
    """Whether a text is a unit that converts to the SI unit, or per cent if that is ""."""
    if not si:
        return unit in ("%", "percent")
    try:
        parse_quantity("", f"1 {unit}", si)
    except SceneError:
        return False
    return True


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _refused(name: str, value: Any, allowed: str, path: Any, where: str) -> SceneError:
    return SceneError(name, value, "", allowed, f"{os.fspath(path)}, {where}")
