"""Tables of numbers as text: separators of columns, decimal commas, units in heads of columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from typing import NamedTuple

from pyfric.values.errors import SceneError
from pyfric.values.units import parse_quantity

SEPARATORS = ("\t", ";", ",", " ")
"""Possible separators of columns, in the order in which they are tried. A blank may be repeated."""
NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}
NO_UNIT = ("", "-", "–", "1")
"""Texts that stand for no unit."""
_BRACKETS = re.compile(r"[(\[<](?P<unit>[^()\[\]<>]*)[)\]>]\s*$")
_BETWEEN = re.compile(r"\s*(?P<sign>[/:|=,;])\s*|[\s_]+(?:in[\s_]+)?")
_MARKUP = re.compile(r"\\(?:mathrm|text|rm|[,;! ])|[${}]")
_WORD = re.compile(r"[A-Za-zµμ]+")
_LAST = re.compile(r"[A-Z]?[a-zµμ]+|[A-Z]+")
_BRACES = re.compile(r"^([^\\$]*)\{([^{}]*)\}$")
_INDEX = re.compile(r"\b([^\W\d]+)\d\b")
"""A digit at the end of a name, as in mu_2."""
_FACTOR = re.compile(r"[x*×·⋅]?\s*[\d^%‰⁰¹²³⁴-⁹⁻][\d^%‰⁰¹²³⁴-⁹⁻.eE*−-]*|[*×·⋅]")
"""A number, a power of ten, a product or a share that remains in the head of a column."""
SCALED = re.compile(r"[*×·⋅^⁰¹²³⁴-⁹]|\b1(?:e-?\d|0-\d|00+\b)", re.IGNORECASE)
"""Signs and powers of ten in a factor. Dates, temperatures and sample numbers do not match."""
_SHARES = re.compile(r"per\W?cent|per\W?mill?e?|ppm", re.IGNORECASE)
WORDS = ("min", "dyn", "mus", "mud")
"""Units that are also names of friction coefficients: minimum, dynamic friction, mu_s, mu_d."""
COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
"""A number with a decimal comma."""
POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?|[+-]?\d+\.")
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[,.]\d{3}")
"""Text that is either a decimal number or a number of thousands."""
_BLANKS = re.compile(r"\s+(?![(\[<])")
"""Blanks between columns. Blanks before a bracket are part of a head."""


class Line(NamedTuple):
    """A line of a file: its number, counted from 1, and its cells."""

    n: int
    cells: list[str]


class Lines(NamedTuple):
    """Lines of a table, without empty lines.

    Attributes:
        comments: lines that start with #, without the #.
        plain: all other lines, with decimal points.
        apart: separator of columns, one of `SEPARATORS`.
        commas: whether the file has decimal commas.
    """

    comments: list[Line]
    plain: list[Line]
    apart: str
    commas: bool


def lines_of(text: str) -> Lines:
    """Return the lines of a table of numbers.

    The last line determines the separator of columns. Numbers may have decimal commas. If commas
    separate columns, such numbers are in quotes.

    Args:
        text: content of the file.

    Raises:
        ValueError: commas may be decimal commas or separators. The message gives a remedy.
        csv.Error: a quote is not closed.
    """
    written = text.splitlines()
    lines = [(n, t) for n, t in enumerate(map(str.strip, written), 1) if t]
    plain = [(n, t) for n, t in lines if t[0] != "#"]
    apart = separator_of(plain[-1][1]) if plain else ","
    comments = _cells([(n, t.lstrip("# ")) for n, t in lines if t[0] == "#"], apart)
    rows = _cells(plain, apart)
    rows = _with_ends(rows, written) if apart == "\t" else rows
    commas = _decimal_commas(rows)
    if commas:
        rows = [
            Line(n, [c.replace(",", ".") if COMMA.fullmatch(c) else c for c in cells])
            for n, cells in rows
        ]
    return Lines(comments, rows, apart, commas)


def separator_of(line: str) -> str:
    """Return the separator of the numbers of a line."""
    for apart in SEPARATORS:
        cells = cells_of(line, apart)
        if len(cells) > 1 and all(is_number(c) or COMMA.fullmatch(c) or not c for c in cells):
            return apart
    return next((sign for sign in "\t;" if sign in line), ",")


def _decimal_commas(rows: list[Line]) -> bool:
    """Whether numbers have decimal commas.

    Raises:
        ValueError: rows differ, or a comma may separate thousands.
    """
    commas = [(n, c) for n, cells in rows for c in cells if COMMA.fullmatch(c)]
    if not commas:
        return False
    if point := next((n for n, cells in rows if any(map(POINT.fullmatch, cells))), 0):
        raise ValueError(f"row {commas[0][0]} has a decimal comma, row {point} a decimal point")
    if all(THOUSANDS.fullmatch(c) for _, c in commas):
        raise ValueError(f"the comma in row {commas[0][0]} may be decimal, or part thousands")
    return True


def cells_of(line: str, apart: str) -> list[str]:
    """Return the cells of a line.

    Raises:
        csv.Error: a quote is not closed.
    """
    if apart == " ":
        return _BLANKS.split(line)
    cells = line.split(apart) if '"' not in line else next(csv.reader([line], delimiter=apart))
    return [cell.strip() for cell in cells]


def _cells(lines: Iterable[tuple[int, str]], apart: str) -> list[Line]:
    """Return the cells of each line, with the separator `apart`."""
    return [Line(n, cells_of(line, apart)) for n, line in lines]


def _with_ends(rows: list[Line], written: list[str]) -> list[Line]:
    """Return rows separated by tabs, with their empty first and last cells restored."""

    def is_filled(cells: list[str]) -> bool:
        numbers = sum(is_number(cell) or bool(COMMA.fullmatch(cell)) for cell in cells)
        return 2 * numbers > len(cells)

    width = max((len(row.cells) for row in rows if is_filled(row.cells)), default=0)
    found = []
    for n, cells in rows:
        line = written[n - 1].strip(" \r")
        left = len(line) - len(line.lstrip("\t"))
        right = len(line) - len(line.rstrip("\t"))
        left = min(left, max(width - len(cells), 0))
        right = min(right, max(width - len(cells) - left, 0))
        found.append(Line(n, [""] * left + cells + [""] * right))
    return found


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # Python alone accepts 1_000


# --- units in heads ------------------------------------------------------------------------------


def unit_in(head: str, si: str) -> str:
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
        if fits(unit, si):
            return unit
        raise ValueError(f"{unit!r} is no unit of {si or 'a pure number'}")
    for between in [None, *_BETWEEN.finditer(head)]:
        unit = head if between is None else head[between.end() :]
        plain = len(unit) > 1 or unit == si or (between is not None and between["sign"])
        if plain and unit != "in" and fits(unit, si):  # the h of t_h may be an index
            _check_name(head[: between.start()] if between else "", si)
            return unit
    if si and "/" in head:
        raise ValueError(f"the text after / is no unit of {si}")
    if word := unit_among(head, si):
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
        if any(fits(word, unit) for unit in ("N", "Pa", *lengths)):
            raise ValueError(f"{word!r} is a unit, and a friction coefficient has none")
    return ""


def _check_name(name: str, si: str, *, index: bool = True) -> None:
    """Check that a column head without its unit has no number except an index, and no share like ‰.

    Raises:
        ValueError: the head has a number or a share.
    """
    name = _INDEX.sub(r"\1", name) if index else name
    if left := _FACTOR.search(name) or (None if si else _SHARES.search(name)):
        instead = "write a unit such as um" if si else "a friction coefficient has none"
        raise ValueError(f"{left[0].strip()!r} is a factor, not a unit; {instead}")


def unit_among(text: str, si: str) -> str:
    """Return a word of a text that is a possible unit of a column, or part of a unit; else ""."""
    for word in _WORD.findall(text) if si else ():
        for form in (word, word.lower(), _LAST.findall(word)[-1].lower()):
            if form != "in" and (fits(form, si) or (si == "m/s" and fits(form, "m"))):
                return word
    return ""


def fits(unit: str, si: str) -> bool:
    """Whether a text is a unit that converts to the SI unit, or percent if `si` is ""."""
    if not si:
        return unit in ("%", "percent")
    try:
        parse_quantity("", f"1 {unit}", si)
    except SceneError:
        return False
    return True
