"""Numbers of a table in text, read by pandas if all cells are plain, else line by line.

Pandas and reading by line give equal numbers. If pandas finds anything but plain numbers and gaps
in a part of the text, this part is read again line by line. Rows that do not fit the layout are
passed to the caller.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.measured.found import refused
from pyfric.values import COMMA, POINT, cells_of, is_number

PART = 1 << 22
"""Number of bytes that are parsed at once."""
BLANK = " "
"""Separator that stands for one or more blanks."""
GAPS = frozenset(
    {"", "-", "--", "NA", "N/A", "#N/A", "na", "n/a", "null"}
    | {"1.#QNAN", "-1.#IND", "1.#INF", "-1.#INF"}
)
"""Words for a missing number, besides NaN. An instrument beyond its range writes the last two."""
NOT_FINITE = frozenset(
    sign + word
    for sign in ("", "+", "-")
    for word in ("nan", "NaN", "NAN", "inf", "Inf", "INF", "infinity", "Infinity")
)
SUFFIXED = re.compile(
    r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\W\d_][^\s,;]*)"
)
"""Pattern of a number followed by its unit."""
_FORTRAN = re.compile(r"(?<![\w.])([+-]?(?:\d+\.\d*|\.\d+))[dD](?=[+-]?\d{1,3}(?![\w.]))")
_FORTRAN_BYTES = re.compile(_FORTRAN.pattern.encode())
"""Pattern of a number with D before its exponent, as Fortran writes it."""
_TRUTHS = (b"r", b"R", b"l", b"L")
"""Letters of the words true and false, which pandas reads as numbers. Numbers have none of these
letters."""
_OLD = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
_EXACT: Any = {"float_precision": "round_trip"} if _OLD else {}
"""Option with which pandas rounds as Python does; pandas from 3.1 on needs no option."""
_SIGNS = ("#", "%", "!", "//")
"""Characters at the beginning of a line that make it a comment."""


class Row(NamedTuple):
    """A line of a text: its number, counted from 1, its offset in bytes, text, cells."""

    n: int
    at: int
    text: str
    cells: list[str]


class Layout(NamedTuple):
    """How rows of numbers are written.

    Attributes:
        apart: separator of columns; a blank stands for one or more blanks.
        commas: whether numbers have decimal commas.
        width: number of cells in a row as written; cells after the first `kept` cells are empty.
        numbers: whether each of the kept columns has numbers.
        words: words that stand for gaps.
        plain: whether the numbers of each column have no unit.
    """

    apart: str
    commas: bool
    width: int
    numbers: tuple[bool, ...]
    words: frozenset[str]
    plain: tuple[bool, ...] = ()

    @property
    def kept(self) -> int:
        """Number of kept columns."""
        return len(self.numbers)

    def holds(self, cell: str) -> bool:
        """Whether a cell is a number or a gap."""
        if self.commas and POINT.fullmatch(cell):
            return False
        return cell in self.words or numeric(cell) or (self.commas and bool(COMMA.fullmatch(cell)))

    def fit(self, cells: list[str], *, numbered: bool = False) -> bool:
        """Whether cells are a row of the table; if `numbered`, a cell must be a number."""
        if len(cells) < self.kept or any(cells[self.kept :]):
            return False
        wanted = [cell for cell, number in zip(cells, self.numbers, strict=False) if number]
        return all(map(self.holds, wanted)) and not (
            numbered and all(c in self.words for c in wanted)
        )

    def number(self, cell: str) -> str:
        """Return a cell with a decimal point."""
        return cell.replace(",", ".") if self.commas and COMMA.fullmatch(cell) else cell


class Table:
    """The columns of a table, as numbers or as texts.

    Attributes:
        parsed: a row for each plain column of numbers, shape (columns, rows).
        filled: number of rows.
        gaps: whether a gap has been found yet.
    """

    def __init__(self, path: Any, layout: Layout, rows: int) -> None:
        self._path, self._layout = path, layout
        self._of = {c: k for k, c in enumerate(np.flatnonzero(layout.plain).tolist())}
        self.parsed = np.empty((len(self._of), rows))
        self._others = {c: list[str]() for c in range(layout.kept) if c not in self._of}
        self._lines = list[int]()
        self.filled = 0
        self.gaps = False

    def add(self, columns: pd.DataFrame | None, rows: list[Row], line: int) -> None:
        """Add rows that pandas has parsed, or that were read one by one."""
        size = len(rows) if columns is None else len(columns)
        at = slice(self.filled, self.filled + size)
        for c, k in self._of.items():
            if columns is None:
                self.parsed[k, at] = [self._plain(row, c) for row in rows]
            else:
                self.parsed[k, at] = columns[c]
        for c, texts in self._others.items():
            if columns is None:
                texts += [row.cells[c] for row in rows]
            else:
                texts += columns[c].fillna("").astype(str).str.strip().tolist()
        if self._others:
            lines = range(line, line + size) if columns is not None else [row.n for row in rows]
            self._lines += lines
        self.filled += size

    def _plain(self, row: Row, c: int) -> float:
        cell = self._layout.number(row.cells[c])
        if is_number(cell):
            return float(cell)
        if row.cells[c] in self._layout.words:
            return np.nan
        unit = SUFFIXED.fullmatch(cell)
        told = f"'', {unit['unit']!r}" if unit else repr(cell[:30])
        reason = f"column {c + 1} has {told} behind numbers"
        raise refused(self._path, "one unit in a column", reason)

    def suffix(self, c: int) -> str:
        """Return the unit behind each number of a column, "" if there is none."""
        matches = map(SUFFIXED.fullmatch, self._others[c])
        behind = Counter(match["unit"] for match in matches if match)
        return re.sub(r"(?<=[A-Za-zµ])\d+$", "", next(iter(behind))) if len(behind) == 1 else ""

    def numbers(self, c: int) -> np.ndarray:
        """Return the numbers of a column; values that are not finite are gaps.

        Raises:
            SceneError: a cell is no number, or numbers have different units.
        """
        k = self._of.get(c)
        values = self._of_texts(c) if k is None else self.parsed[k, : self.filled]
        values[np.isinf(values)] = np.nan  # an instrument beyond its range
        return values

    def _of_texts(self, c: int) -> np.ndarray:
        values, behind = np.empty(self.filled), set[str]()
        for k, cell in enumerate(self._others[c]):
            plain = self._layout.number(cell)
            if is_number(plain):
                values[k] = float(plain)
                behind |= {""} if np.isfinite(values[k]) else set()
            elif match := SUFFIXED.fullmatch(plain):
                values[k] = float(match["number"])
                behind.add(match["unit"])
            elif cell in self._layout.words:
                values[k] = np.nan
            else:
                allowed = "numbers in the columns that are read, without marks of thousands; for "
                allowed += 'clock times, columns={...} without t, and step="..."'
                where = f"row {self._lines[k]}, column {c + 1}"
                raise refused(self._path, allowed, f"{where}: {cell[:30]!r} is no number")
        if len(behind) > 1:
            several = ", ".join(repr(unit) for unit in sorted(behind))
            reason = f"column {c + 1} has {several} behind numbers"
            raise refused(self._path, "one unit in a column", reason)
        return values


def numeric(cell: str) -> bool:
    """Whether a cell is a number, with or without a unit behind it."""
    return is_number(cell) or bool(SUFFIXED.fullmatch(cell))


def is_comment(text: str) -> bool:
    """Whether a line is a comment."""
    return text.startswith(_SIGNS)


def plain(text: str) -> str:
    """Return a line with the letter D or d of Fortran exponents replaced by e."""
    return _FORTRAN.sub(r"\1e", text) if "D" in text or "d" in text else text


def split(text: str, apart: str) -> list[str]:
    """Return the cells of a line."""
    text = plain(text)
    return cells_of(text.strip() if apart == BLANK else text, apart)


def rows_of(content: bytes, encoding: str, first: int, start: int = 0) -> Iterator[Row]:
    """Yield the lines after an offset that are not empty, as rows without cells.

    The line at the offset has the number `first`.
    """
    n = first
    while start < len(content):
        stop = content.find(b"\n", start)
        stop = len(content) if stop < 0 else stop
        text = content[start:stop].decode(encoding, errors="replace").strip(" \r")
        if text.strip():
            yield Row(n, start, text, [])
        n, start = n + 1, stop + 1


def body(
    path: Any,
    content: bytes,
    encoding: str,
    begin: int,
    end: int,
    layout: Layout,
    between: Callable[[list[Row]], None],
) -> Table:
    """Return the numbers of a table.

    Args:
        path: path of the text.
        content, encoding: bytes of the text, and their encoding.
        begin, end: offset of the first row, and offset after the last row.
        layout: layout of the rows.
        between: function that receives consecutive rows that do not fit, and raises if they are not
            allowed.

    Raises:
        SceneError: numbers of a column have different units.
    """
    lines = content.count(b"\n", begin, end) + 1
    table = Table(path, layout, lines)
    n, at = content.count(b"\n", 0, begin) + 1, begin
    odd: list[Row] = []
    while at < end:
        stop = content.find(b"\n", min(at + PART, end), end) + 1 or end
        part = content[at:stop]
        columns = _parsed(part, encoding, layout, table)
        if columns is not None:
            if odd:
                between(odd)
                odd = []
            table.add(columns, [], n)
        else:
            odd = _one_by_one(part, encoding, n, layout, between, table, odd)
        n += part.count(b"\n")
        at = stop
    return table


def _one_by_one(
    part: bytes,
    encoding: str,
    n: int,
    layout: Layout,
    between: Callable[[list[Row]], None],
    table: Table,
    odd: list[Row],
) -> list[Row]:
    """Add the rows of a part to a table; return rows at its end that do not fit the layout."""
    fit: list[Row] = []
    for row in rows_of(part, encoding, n):
        row = row._replace(cells=split(row.text, layout.apart))
        if not is_comment(row.text) and layout.fit(row.cells):
            if odd:
                between(odd)
                odd = []
            fit.append(row)
        elif any(row.cells):
            odd.append(row)
    table.add(None, fit, n)
    return odd


def _parsed(part: bytes, encoding: str, layout: Layout, table: Table) -> pd.DataFrame | None:
    """Return the columns of a part of the text, or None if a cell is not plain.

    The search for gaps doubles the time, and begins only at the first part that has gaps.
    """
    if any(word in part for word in _TRUTHS):
        return None
    kinds = {c: float if plain else object for c, plain in enumerate(layout.plain)}
    kinds |= dict.fromkeys(range(layout.kept, layout.width), object)
    for gaps in (False, True)[table.gaps :]:
        text = _FORTRAN_BYTES.sub(rb"\1e", part) if gaps else part
        try:
            columns = pd.read_csv(
                io.BytesIO(text),
                header=None,
                names=range(layout.width),
                dtype=kinds,
                sep=r"\s+" if layout.apart == BLANK else layout.apart,
                decimal="," if layout.commas else ".",
                na_filter=gaps,
                keep_default_na=False,
                na_values=sorted(layout.words | NOT_FINITE),
                skipinitialspace=True,
                encoding=encoding,
                engine="c",
                **_EXACT,
            )
        except (ValueError, OverflowError):  # pandas versions raise different errors
            continue
        table.gaps = gaps
        return columns if _whole(columns, text, layout) else None
    return None


def _whole(columns: pd.DataFrame, text: bytes, layout: Layout) -> bool:
    """Whether each row had as many cells as columns; pandas hides missing and extra cells."""
    if not isinstance(columns.index, pd.RangeIndex):
        return False
    if any(columns[c].notna().any() for c in range(layout.kept, layout.width)):
        return False
    last = columns[layout.width - 1]
    if not last.isna().any():
        return True
    if b'"' in text:
        return False
    if layout.apart == BLANK:
        return len(text.split()) == layout.width * len(columns)
    return text.count(layout.apart.encode()) == (layout.width - 1) * len(columns)
