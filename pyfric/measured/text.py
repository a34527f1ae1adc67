"""Tables of numbers in text.

The first and last rows of a table give its layout: the separator of columns, the decimal mark, and
which columns hold numbers. `body` then parses the rows between. A text may hold several tables with
the same columns, each below its own heads. Such tables are joined.
"""

from __future__ import annotations

import csv
import functools
import re
from collections import Counter
from dataclasses import replace
from typing import Any, NamedTuple

from pyfric.measured.body import (
    BLANK,
    GAPS,
    SUFFIXED,
    Layout,
    Row,
    Table,
    body,
    is_comment,
    numeric,
    plain,
    rows_of,
    split,
)
from pyfric.measured.found import Asked, Column, Found, refused
from pyfric.measured.lvm import decimal, described, sections
from pyfric.measured.meanings import MEANINGS, SPELLED, unit_stated
from pyfric.values import (
    COMMA,
    POINT,
    THOUSANDS,
    SceneError,
    cells_of,
    fits,
    is_number,
    read_at_most,
    separator_of,
)

MAX_BYTES = 512 * 1024**2
"""Largest size of a text, in bytes."""
SAMPLE = 1 << 14
"""Number of bytes at either end from which the layout is found."""
RUN = 5
"""Number of similar rows that make a table. A longer run counts as this number of rows."""
_FRACTION = re.compile(rb"\d,(?:\d{1,2}(?!\d)|\d{4,})|(?<![\d,])0,\d|(?<!\d),\d")
_WHOLE = re.compile(rb"(?m)(?:^|[;\t, ])[+-]?[1-9]\d{0,2}\s*(?:[;\t, ]|$)")
_POINTED = re.compile(rb"\d\.|\.\d")
"""Patterns: a decimal comma (not followed by three digits, or after a zero); a whole number below
1000; a number with a decimal point."""
NOT_LENGTHS = ("", "-", ".", "1", "%", "V", "mV", "Volt", "Volts", "bits", "bit", "RN", "TS")
"""Further units in a row of units; TS is a time stamp, RN a record number."""
_RULER = re.compile(r"[-=_+|*]{2,}")
_COMMENT = "Comment"
"""Last name in the heads of a LabVIEW text. No column has this name."""


class Head(NamedTuple):
    """Names of columns, their units ([] if there are none), number of the row, whether comment."""

    names: list[str]
    units: list[str]
    n: int = 0
    comment: bool = False


def text(path: Any, asked: Asked) -> Found:
    """Return the columns of a text.

    Raises:
        SceneError: the file cannot be read, or an entry of the file is not understood.
    """
    found = Found("text")
    content = read_at_most(path, MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise refused(path, f"at most {MAX_BYTES} bytes: cut it", "too large")
    content, encoding = _decoded(path, content, found)
    told, content = sections(content)
    if asked.decimal is None:
        asked = replace(asked, decimal=decimal(told))
    start, first = _skipped(content, asked.head)
    try:
        layout, begin, tops, end, feet = _layout(path, content, encoding, start, first, asked)
    except csv.Error as error:
        raise refused(path, "quotes that are closed", str(error)) from None
    head = _heads(tops, layout, tops[-1].n + 1 if tops else first)
    _check_commas(path, content, begin, end, layout, head, asked)
    if any(_looks_like_data(row, layout, above=True) and _begins(row, layout) for row in tops):
        _refuse_broken(path, tops, layout, content.count(b"\n"))
    starts: list[int] = []

    def between(rows: list[Row]) -> None:
        """Accept rows between rows of numbers as heads of a further table, or refuse them."""
        again = _heads(rows, layout, rows[-1].n + 1)
        if any(_looks_like_data(row, layout) and row.cells != head.names for row in rows):
            _refuse_broken(path, rows, layout, content.count(b"\n"))
        remarks = all(is_comment(row.text) for row in rows)
        if remarks and (not head.comment or not again.names):
            return
        if not again.names or again[:2] != head[:2]:
            n = again.n if again.names else rows[0].n
            what = "has other heads" if again.names else f"reads {rows[0].text[:30]!r}"
            allowed = "one table, or tables with the same heads: cut the file in two, or leave out "
            allowed += f"the first one with head={rows[0].n - 1}" if again.names else "such rows"
            reason = f"a second table begins in row {n}, which {what}"
            raise refused(path, allowed, reason)
        starts.append(rows[-1].n + 1)

    table = body(path, content, encoding, begin, end, layout, between)
    if layout.commas:
        found.notes.append("decimal commas")
    if starts:
        rows = [content.count(b"\n", 0, begin) + 1, *starts]
        said = ", ".join(map(str, rows[:4])) + ", ..." * (len(rows) > 4)
        found.notes.append(f"{len(rows)} tables of the same columns, from rows {said}")
    if feet:
        said = repr(feet[0].text[:30])
        found.notes.append(f"rows below the table are left out, from row {feet[0].n}: {said}")
    columns = _columns(path, table, layout, head)
    for name, column in described(columns, told):
        found.add(name, column)
    return found


def _skipped(content: bytes, head: int) -> tuple[int, int]:
    """Return the offset after `head` lines, and the number of the next line."""
    at = 0
    for n in range(head):
        at = content.find(b"\n", at) + 1
        if not at:
            lines = n + 1
            raise SceneError("head", head, "", f"fewer lines than the file has, {lines}")
    return at, head + 1


def _decoded(path: Any, content: bytes, found: Found) -> tuple[bytes, str]:
    """Return a text with line feeds as ends of lines, and its encoding."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        content = content.decode("utf-16", errors="replace").encode()
    content = content.removeprefix(b"\xef\xbb\xbf")
    if content.endswith(b"\0") and content.rstrip(b"\0"):
        content = content.rstrip(b"\0")
        found.notes.append("zeros at the end are left out, as after a loss of power")
    encoding = "utf-8"
    if not content.isascii():
        try:
            content.decode()
        except UnicodeDecodeError:
            encoding = "cp1252"
            found.notes.append("read as Windows text (cp1252), as it is not UTF-8")
    unknown = "\ufffd".encode() if encoding == "utf-8" else b"\x81"
    if b"\0" in content or (not content.isascii() and unknown in content):
        allowed = "text in UTF-8, UTF-16 or Windows-1252"
        raise refused(path, allowed, "not a kind of file that is known")
    if b"\r" in content and b"\n" not in content:
        content = content.replace(b"\r", b"\n")
    return content, encoding


# --- layout --------------------------------------------------------------------------------------


def _layout(
    path: Any, content: bytes, encoding: str, start: int, first: int, asked: Asked
) -> tuple[Layout, int, list[Row], int, list[Row]]:
    """Return the layout, the start of the rows of numbers, rows above, their end, rows below."""
    cut = max(start, content.rfind(b"\n", 0, max(len(content) - SAMPLE, 0)) + 1)
    late = content.count(b"\n", start, cut) + first
    tail = [row for row in rows_of(content, encoding, late, cut) if not is_comment(row.text)]
    if not tail:
        raise refused(path, "rows of numbers", "no row of numbers")
    apart = _separator(tail)
    words = GAPS | asked.gaps
    rows = [row._replace(cells=split(row.text, apart)) for row in tail]
    commas = asked.decimal != "." and any(COMMA.fullmatch(c) for row in rows for c in row.cells)
    flags, width = _pattern(rows, words, commas)
    if not any(flags):
        _refuse_last(path, tail[-1], apart)
    kept = width
    early = rows_of(content[: start + SAMPLE], encoding, first, start)
    ends = [split(row.text, apart) for row in early] + [row.cells for row in rows]
    ends = [cells for cells in ends if len(cells) == width]
    while kept > 1 and not any(cells[kept - 1] for cells in ends):
        kept -= 1
    layout = Layout(apart, commas, width, tuple(flags[:kept]), words)
    layout = layout._replace(plain=_plain(rows, layout))
    tops, at = [], start
    for row in rows_of(content, encoding, first, start):
        if not is_comment(row.text):
            row = row._replace(cells=split(row.text, apart))
            if layout.fit(row.cells, numbered=True):
                at = row.at
                break
        tops.append(row)
    else:
        at = -1
    feet = []
    for row in reversed(rows):
        if layout.fit(row.cells, numbered=True):
            break
        feet.insert(0, row)
    end = feet[0].at if feet else len(content)
    if any(_looks_like_data(row, layout) and _begins(row, layout) for row in feet):
        last = feet[0].cells
        cut_off = len(feet) == 1 and len(last) < layout.kept and all(map(layout.holds, last[:-1]))
        if not cut_off:
            _refuse_broken(path, feet, layout, 0)
    if at < 0:
        _refuse_last(path, tail[-1], apart)
    tops = [row._replace(cells=_cells_of_head(row, layout)) for row in tops]
    return layout, at, tops, end, feet


def _separator(tail: list[Row]) -> str:
    """Return the separator of columns that most rows have; rows of numbers count more."""
    votes: Counter[str] = Counter()
    for row in tail:
        apart = separator_of(plain(row.text))
        cells = cells_of(row.text, apart)
        numbers = all(is_number(c) or COMMA.fullmatch(c) or not c for c in cells)
        if len(cells) > 1:
            votes[apart] += 3 if numbers else 1
    return votes.most_common(1)[0][0] if votes else separator_of(plain(tail[-1].text))


def _pattern(rows: list[Row], words: frozenset[str], commas: bool) -> tuple[list[bool], int]:
    """Return which columns of similar rows hold numbers, and the number of columns."""

    def kind(cell: str) -> bool | None:
        number = numeric(cell) or (commas and bool(COMMA.fullmatch(cell)))
        return True if number else None if cell in words else False

    best: tuple[tuple[int, int], list[Any]] = (0, 0), []
    run: list[Any] = []
    length = 0
    for row in rows:
        kinds = [kind(cell) for cell in row.cells]
        alike = len(kinds) == len(run) and not any(
            a is not b for a, b in zip(kinds, run, strict=True) if a is not None and b is not None
        )
        if alike:
            run = [b if a is None else a for a, b in zip(kinds, run, strict=True)]
            length += 1
        else:
            run, length = kinds, 1
        numbers = sum(each is True for each in run)
        score = numbers * min(length, RUN), length
        if numbers and score >= best[0]:
            best = score, run
    return [each is True for each in best[1]], len(best[1])


def _plain(rows: list[Row], layout: Layout) -> tuple[bool, ...]:
    """Return which columns of numbers have no units after the numbers."""
    fit = [row.cells for row in rows if layout.fit(row.cells, numbered=True)]

    def bare(c: int) -> bool:
        return not any(
            SUFFIXED.fullmatch(cells[c]) and not is_number(cells[c]) for cells in fit[-1:]
        )

    return tuple(number and bare(c) for c, number in enumerate(layout.numbers))


def _cells_of_head(row: Row, layout: Layout) -> list[str]:
    """Return the cells of a row of names; names may have single blanks inside."""
    text = row.text.lstrip("#%!/ ") if is_comment(row.text) else row.text
    cells = split(text, layout.apart)
    if layout.apart == BLANK and len(cells) != layout.kept:
        apart = re.split(r"\s{2,}|(?<=[)\]>])\s+(?=[(\[<])", text.strip("# \t"))
        return apart if len(apart) == layout.kept else cells
    if len(cells) > layout.kept and not any(cells[layout.kept :]):
        return cells[: layout.kept]
    return cells


def _heads(rows: list[Row], layout: Layout, first: int) -> Head:
    """Return the heads of columns among rows above the numbers."""
    width = layout.kept
    rows = [row._replace(cells=_cells_of_head(row, layout)) for row in rows]
    if rows and len(rows[-1].cells) == width + 1 and rows[-1].cells[-1] == _COMMENT:
        rows[-1] = rows[-1]._replace(cells=rows[-1].cells[:-1])
    rows = [row for row in rows if len(row.cells) == width and row.n < first]
    rows = [row for row in rows if not all(map(_RULER.fullmatch, row.cells))]
    words = [row for row in rows if not is_comment(row.text)]
    while words and is_comment(rows[-1].text) and not _all_units(rows[-1].cells):
        rows.pop()
    if not rows:
        return Head([], [])
    of_units = [len(rows) > 1 and _all_units(row.cells) for row in rows]
    named = [k for k, row in enumerate(rows) if not of_units[k] and _tell_apart(row, layout)]
    at = named[-1] if named else len(rows) - (2 if of_units[-1] else 1)
    units = list[str]()
    if at + 1 < len(rows) and of_units[at + 1]:
        units = [_unbracketed(cell) for cell in rows[at + 1].cells]
    return Head(rows[at].cells, units, rows[at].n, is_comment(rows[at].text))


def _tell_apart(row: Row, layout: Layout) -> bool:
    """Whether a row has different cells above all columns of numbers, as a row of names has."""
    cells = [cell for cell, number in zip(row.cells, layout.numbers, strict=True) if number]
    return len(set(cells) - {""}) == len(cells)


def _unbracketed(cell: str) -> str:
    return cell.strip().strip("()[]<>").strip()


def _all_units(cells: list[str]) -> bool:
    return all(map(_like_unit, map(_unbracketed, cells)))


def _like_unit(text: str) -> bool:
    known = text in NOT_LENGTHS or text.lower() in SPELLED
    return known or any(fits(text, meaning.unit) for meaning in MEANINGS.values())


# --- refusals ------------------------------------------------------------------------------------


def _check_commas(
    path: Any, content: bytes, begin: int, end: int, layout: Layout, head: Head, asked: Asked
) -> None:
    """Check that commas and points in rows of numbers have a clear meaning.

    Raises:
        SceneError: their meaning is not clear.
    """
    late = content.rfind(b"\n", begin, max(end - SAMPLE, begin)) + 1 or begin
    early = min(content.find(b"\n", begin + SAMPLE, late) + 1 or late, late)
    cells = _of_numbers(content[begin:early], layout) + _of_numbers(content[late:end], layout)
    if layout.apart == "," and not any("," in cell for each in cells for cell in each):
        if asked.decimal == ",":
            allowed = "semicolons, tabs or blanks between columns, or numbers in quotes"
            raise refused(path, allowed, "commas separate columns, and cannot be decimal, too")
        if asked.decimal is None and not head.names and not _POINTED.search(content, begin, end):
            allowed = 'decimal="." if commas separate columns; else semicolons between columns'
            reason = "whole numbers apart by commas, without heads, may have decimal commas"
            raise refused(path, allowed, reason)
    mark = "," if layout.commas else "."
    marked = [cell for each in cells for cell in each if mark in cell]
    if asked.decimal or not all(map(THOUSANDS.fullmatch, marked)):
        return
    if content.find(mark.encode(), begin, end) < 0:
        return
    if layout.commas:
        clear = _FRACTION.search(content, begin, end)
    else:
        clear = not _WHOLE.search(content, begin, end)
        if not clear:
            columns = list(zip(*_of_numbers(content[begin:end], layout), strict=True))
            points = [cell for column in columns for cell in column if "." in cell]
            clear = not all(map(THOUSANDS.fullmatch, points))
            clear = clear or not any(map(_may_be_thousands, columns))
    if not clear:
        name = "comma" if layout.commas else "point"
        allowed = 'decimal="," or decimal="." says which'
        cell = next(iter(marked), "1.000")
        raise refused(path, allowed, f"the {name} in {cell!r} may be decimal, or part thousands")


def _of_numbers(content: bytes, layout: Layout) -> list[list[str]]:
    """Return the cells that hold numbers, row by row."""
    rows = (split(row.text, layout.apart) for row in rows_of(content, "latin-1", 1))
    columns = [c for c, number in enumerate(layout.numbers) if number]
    return [[row[c] for c in columns] for row in rows if layout.fit(row)]


def _may_be_thousands(cells: tuple[str, ...]) -> bool:
    """Whether points may separate thousands: only numbers from 1000 on have points."""
    points = [bool(THOUSANDS.fullmatch(cell)) for cell in cells]
    whole = [bool(re.fullmatch(r"[+-]?\d{1,3}", cell)) for cell in cells]
    return any(points) and any(whole) and all(map(any, zip(points, whole, strict=True)))


def _refuse_last(path: Any, row: Row, apart: str) -> None:
    """Refuse a table whose last row has no cell that is a number.

    Raises:
        SceneError: always.
    """
    if any(map(is_number, re.split(r"[\s|:]+", " ".join(split(row.text, apart))))):
        allowed = "columns separated by commas, semicolons or tabs"
        reason = f"the last row, {row.n}, has words or other signs between its numbers"
        raise refused(path, allowed, reason)
    allowed = "rows of numbers separated by commas, semicolons, tabs or blanks"
    raise refused(path, allowed, f"the last row, {row.n}, has no number")


def _looks_like_data(row: Row, layout: Layout, *, above: bool = False) -> bool:
    """Whether a row that does not fit looks like data; `above` the table, it needs more numbers."""
    if is_comment(row.text) or (above and len(row.cells) < 2):
        return False
    numbers = [numeric(layout.number(cell)) for cell in row.cells]
    if not above and len(numbers) == layout.kept and numbers[0] and layout.numbers[0]:
        return True
    share = sum(numbers) / len(numbers)
    half = 0.5 * sum(layout.numbers) / layout.kept
    return share > half if above else share >= half


def _begins(row: Row, layout: Layout) -> bool:
    """Whether a row begins with a number, as rows of data do; a row of means begins with a word."""
    return numeric(layout.number(row.cells[0])) or not layout.numbers[0]


def _refuse_broken(path: Any, rows: list[Row], layout: Layout, total: int) -> None:
    """Refuse rows that do not fit, but look like numbers, in a text of `total` lines.

    Raises:
        SceneError: always. The message suggests to skip the rows above, if they are few.
    """
    rows = [row for row in rows if _looks_like_data(row, layout)]
    row, last = rows[0], rows[-1].n
    above = f"; head={last} leaves out the rows above" if 2 * last <= total + 1 else ""
    if len(row.cells) != layout.kept:
        reason = f"row {row.n}: {len(row.cells)} columns, other rows: {layout.kept}"
        raise refused(path, f"rows of equal columns: mend or cut this one{above}", reason)
    c, cell = next(
        (c, cell)
        for c, (cell, number) in enumerate(zip(row.cells, layout.numbers, strict=True))
        if number and not layout.holds(cell)
    )
    where = f"row {row.n}, column {c + 1}"
    if not layout.commas and COMMA.fullmatch(cell):
        reason = f"{where}: {cell!r} has a decimal comma, others have a decimal point"
        raise refused(path, "one decimal mark", reason)
    if layout.commas and POINT.fullmatch(cell):
        reason = f"{where}: {cell!r} has a decimal point, others have a decimal comma"
        raise refused(path, "one decimal mark", reason)
    reason = f"{where}: {cell[:30]!r} is no number"
    raise refused(path, f'a number, or gaps="{cell[:30]}" if it stands for a gap{above}', reason)


# --- columns -------------------------------------------------------------------------------------


def _columns(path: Any, table: Table, layout: Layout, head: Head) -> list[Column]:
    """Return the columns of a table."""
    found = []
    for c in range(layout.kept):
        name = head.names[c] if head.names else str(c + 1)
        suffix = table.suffix(c) if layout.numbers[c] and not layout.plain[c] else ""
        stated = head.units[c] if head.units else unit_stated(name)
        if suffix and stated and suffix != stated:
            reason = f"column {c + 1}: {stated!r} at the top, {suffix!r} behind numbers"
            raise refused(path, "one unit in a column", reason)
        unit = head.units[c] if head.units else suffix
        found.append(Column(functools.partial(table.numbers, c), name, unit))
    return found
