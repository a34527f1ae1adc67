"""Columns of numbers in the files of laboratories: text, MATLAB, HDF5, TDMS and Look.

Nothing is understood here: a column has a name, numbers, and the unit that the file states.

A Look file, as the biaxial apparatus at Penn State writes, has a head of 36 bytes (a title of 20
characters and four integers: rows, columns, two without use), then a head of 84 bytes for each of
16 or 32 channels (13 characters of name, 13 of unit, an integer, 50 of comment, number of values),
then the values of each channel in turn. Integers are big-endian; values have 4 or 8 bytes, in the
order of the computer that wrote them.
"""

from __future__ import annotations

import csv
import functools
import os
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyfric.measured.meanings import MEANINGS, SPELLED, unit_stated
from pyfric.scene import (
    LARGEST,
    SMALLEST,
    Line,
    SceneError,
    fits,
    is_number,
    lines_of,
    read_at_most,
)

MAX_BYTES = 512 * 1024**2
"""Largest file that is read."""
MAX_COLUMNS = 64
"""Most columns of an array that is a table, not a picture."""
HDF5 = b"\x89HDF\r\n\x1a\n"
GAPS = ("", "-", "--", "NA", "N/A", "#N/A", "na", "n/a", "null", "1.#QNAN", "-1.#IND")
"""Cells without a number, beside NaN."""
COMMENTS = re.compile(r"(?m)^\s*(?:%|//|!)")
"""Signs of comments beside #."""
LVM_HEAD = "***End_of_Header***"
"""End of what LabVIEW writes above a table in text (.lvm)."""
_SUFFIXED = re.compile(
    r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\W\d_][^\s,;]*)"
)
"""A number with a unit behind it."""
_FORTRAN = re.compile(r"(?<![\w.])([+-]?(?:\d+\.\d*|\.\d+))[dD](?=[+-]?\d{1,3}(?![\w.]))")
"""A number whose exponent has the sign D, as Fortran writes it."""
_CHANNEL = np.dtype(
    [("name", "S13"), ("unit", "S13"), ("_", ">i4"), ("comment", "S50"), ("count", ">i4")]
)
HEAD = 36
CHANNELS = (16, 32)
VALUES = (4, 8)
"""Of Look files: bytes of the head, possible numbers of channels, and of bytes of a value."""


@dataclass
class Column:
    """A column of a file: what to call for its numbers, its head, and the stated unit."""

    numbers: Callable[[], np.ndarray]
    head: str
    unit: str = ""


@dataclass
class Found:
    """What a file holds: its kind, columns by name, in order, and notes."""

    kind: str
    columns: dict[str, Column] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, column: Column) -> None:
        """Add a column; later ones of the same name get a number."""
        n, plain = 1, name
        while name in self.columns:
            n, name = n + 1, f"{plain}:{n + 1}"
        self.columns[name] = column

    def add_array(self, name: str, head: str, values: np.ndarray, unit: str = "") -> None:
        """Add an array: a column, or a table with a sample in each row; a name has the group."""
        if values.dtype.kind not in "iufb" or values.ndim > 2 or values.size < 2:
            return
        if values.ndim == 1 or 1 in values.shape:
            self.add(name, Column(lambda: values.ravel().astype(float), head, unit))
        elif values.shape[1] <= MAX_COLUMNS:
            for c in range(values.shape[1]):
                numbers = functools.partial(lambda c: values[:, c].astype(float), c)
                self.add(f"{name}:{c + 1}", Column(numbers, f"{head}:{c + 1}", unit))


def refused(path: Any, allowed: str, reason: str) -> SceneError:
    """Return the error for a file that is not understood."""
    return SceneError("path", os.fspath(path), "", allowed, reason)


def contents(path: str | os.PathLike[str], *, head: int, decimal: str | None) -> Found:
    """Return the columns of a file, whose beginning says of which kind it is.

    Raises:
        SceneError: the file cannot be read, or is of no kind that is known.
    """
    try:
        content = read_at_most(path, MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refused(path, "a file of measurements", reason) from None
    if len(content) > MAX_BYTES:
        raise refused(path, f"at most {MAX_BYTES} bytes: cut it", "too large")
    if content[:8] == HDF5 or content[512:520] == HDF5:
        return _hdf5(path, content[:6] == b"MATLAB")
    if content[:6] == b"MATLAB":
        return _matlab(path)
    if content[:4] == b"TDSm":
        return _tdms(path)
    if content[:2] == b"PK":
        raise refused(path, "CSV: export the table from the spreadsheet", "a zip file or workbook")
    if look := _look(path, content):
        return look
    return _text(path, content, head, decimal)


# --- text ----------------------------------------------------------------------------------------


def _text(path: Any, content: bytes, head: int, decimal: str | None) -> Found:
    found = Found("text")
    text = _decoded(path, content, found)
    if (end := text.rfind(LVM_HEAD)) >= 0:
        head = max(head, text.count("\n", 0, end) + 1)
    text = COMMENTS.sub("#", "\n" * head + "\n".join(text.splitlines()[head:]))
    text = _FORTRAN.sub(r"\1e", text)
    try:
        lines = lines_of(text, decimal=decimal)
    except (csv.Error, ValueError) as error:
        allowed = 'decimal="," or decimal="." says which'
        raise refused(path, allowed, str(error)) from None
    plain = _without_ends(lines.plain)
    if not plain:
        raise refused(path, "rows of numbers", "no row of numbers")
    width = len(plain[-1].cells)
    pattern = [_numeric(cell) for cell in plain[-1].cells]
    if not any(pattern):
        _refuse_last(path, plain[-1])
    begin = len(plain)
    while begin and _fits_pattern(plain[begin - 1].cells, pattern):
        begin -= 1
    rows, heads = plain[begin:], plain[:begin]
    if any(_looks_like_data(row, pattern) for row in heads):
        _refuse_broken(path, heads, rows[0], pattern)
    if lines.apart == " ":
        written = text.splitlines()
        heads = [_blanks_in_names(row, written[row.n - 1], width) for row in heads]
    names, units = _names(heads, lines.comments, width, rows[0].n)
    if lines.commas:
        found.notes.append("decimal commas")
    for c in range(width):
        name = names[c] if names else str(c + 1)
        suffix = _suffix(rows, c)
        stated = units[c] if units else unit_stated(name)
        if suffix and stated and suffix != stated:
            reason = f"column {c + 1}: {stated!r} at the top, {suffix!r} behind numbers"
            raise refused(path, "one unit in a column", reason)
        unit = units[c] if units else suffix
        found.add(name, Column(lambda c=c: _numbers(path, rows, c), name, unit))
    return found


def _without_ends(rows: list[Line]) -> list[Line]:
    """Return rows without the empty cell behind a separator at the end of each row of numbers."""
    if not rows or len(rows[-1].cells) < 2 or rows[-1].cells[-1]:
        return rows
    width = len(rows[-1].cells)
    if any(len(row.cells) == width and row.cells[-1] for row in rows):
        return rows
    return [Line(n, cells[:-1] if len(cells) == width else cells) for n, cells in rows]


def _blanks_in_names(row: Line, written: str, width: int) -> Line:
    """Return a row above the numbers: its names may have blanks, and be apart by two of them."""
    apart = re.split(r"\s{2,}|(?<=[)\]>])\s+(?=[(\[<])", written.strip("# 	"))
    return Line(row.n, apart) if len(row.cells) != width and len(apart) == width else row


def _refuse_last(path: Any, row: Line) -> None:
    """Refuse a table whose last row has no cell that is a number.

    Raises:
        SceneError: always.
    """
    if any(map(is_number, re.split(r"[\s|:]+", " ".join(row.cells)))):
        allowed = "columns separated by commas, semicolons or tabs"
        reason = f"the last row, {row.n}, has words or other signs between its numbers"
        raise refused(path, allowed, reason)
    allowed = (
        "rows of numbers up to the end of the file, separated by commas, semicolons, tabs or "
        "blanks: cut what is below them"
    )
    raise refused(path, allowed, f"the last row, {row.n}, has no number")


def _refuse_broken(path: Any, heads: list[Line], first: Line, pattern: list[bool]) -> None:
    """Refuse a table that is broken off; say at which row and cell.

    Raises:
        SceneError: always.
    """
    n, cells = heads[-1]
    last = (
        n
        if any(map(_numeric, cells))
        else next(r.n for r in reversed(heads) if _looks_like_data(r, pattern))
    )
    allowed = f"rows of equal columns; head={last} leaves out the rows above"
    reason = f"row {n}: {len(cells)} columns, row {first.n}: {len(pattern)}"
    if len(cells) == len(pattern):
        pairs = enumerate(zip(cells, pattern, strict=True))
        wrong = (
            c for c, (cell, number) in pairs if number and not _numeric(cell) and cell not in GAPS
        )
        c = next(wrong, 0)
        allowed = f"a number, or a gap such as NaN; head={last} leaves out the rows above"
        reason = f"row {n}, column {c + 1}: {cells[c]!r} is no number"
    raise refused(path, allowed, reason)


def _decoded(path: Any, content: bytes, found: Found) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text, note = content.decode("utf-16", errors="replace"), ""
    else:
        try:
            text, note = content.decode("utf-8-sig"), ""
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")
            note = "read as Windows text (cp1252), as it is not UTF-8"
    if "\0" in text or "\ufffd" in text:
        kinds = "text, MATLAB, HDF5, TDMS, or a Look file"
        raise refused(path, kinds, "not a kind of file that is known")
    found.notes += [note] if note else []
    return text


def _numeric(cell: str) -> bool:
    return is_number(cell) or bool(_SUFFIXED.fullmatch(cell))


def _fits_pattern(cells: list[str], pattern: list[bool]) -> bool:
    """Whether a row has numbers, or gaps, where the last row has numbers."""
    if len(cells) != len(pattern):
        return False
    wanted = [cell for cell, number in zip(cells, pattern, strict=True) if number]
    return any(map(_numeric, wanted)) and all(_numeric(c) or c in GAPS for c in wanted)


def _looks_like_data(row: Line, pattern: list[bool]) -> bool:
    """Whether a row above the numbers is one of them that was broken off."""
    share = sum(map(_numeric, row.cells)) / len(row.cells)
    return len(row.cells) > 1 and share > 0.5 * sum(pattern) / len(pattern)


def _names(
    heads: list[Line], comments: list[Line], width: int, first: int
) -> tuple[list[str], list[str]]:
    """Return the names of columns and the row of their units, [] where there is none."""
    if heads and len(heads[-1].cells) == width + 1 and heads[-1].cells[-1] == "Comment":  # .lvm
        heads = [Line(heads[-1].n, heads[-1].cells[:-1])]
    rows = [row for row in heads if len(row.cells) == width]
    if not rows:
        rows = [row for row in comments if len(row.cells) == width and row.n < first][-2:]
        if len(rows) > 1 and not all(map(_like_unit, map(_unbracketed, rows[-1].cells))):
            rows = rows[-1:]
    if not rows:
        return [], []
    units = [_unbracketed(cell) for cell in rows[-1].cells]
    if len(rows) > 1 and all(map(_like_unit, units)):
        return rows[-2].cells, units
    return rows[-1].cells, []


def _unbracketed(cell: str) -> str:
    return cell.strip().strip("()[]<>").strip()


def _like_unit(text: str) -> bool:
    known = text in ("", "-", ".", "1", "%", "V", "mV", "bits", "bit") or text.lower() in SPELLED
    return known or any(fits(text, meaning.unit) for meaning in MEANINGS.values())


def _suffix(rows: list[Line], c: int) -> str:
    """Return the unit behind each number of a column, "" if there is none."""
    if is_number(rows[-1].cells[c]):
        return ""
    matches = (_SUFFIXED.fullmatch(row.cells[c]) for row in rows)
    behind = Counter(match["unit"] for match in matches if match)
    return re.sub(r"(?<=[A-Za-zµ])\d+$", "", next(iter(behind))) if len(behind) == 1 else ""


def _numbers(path: Any, rows: list[Line], c: int) -> np.ndarray:
    values, behind = np.empty(len(rows)), set[str]()
    for k, (n, cells) in enumerate(rows):
        cell = cells[c]
        if is_number(cell):
            values[k] = float(cell)
            behind |= {""} if np.isfinite(values[k]) else set()
        elif match := _SUFFIXED.fullmatch(cell):
            values[k] = float(match["number"])
            behind.add(match["unit"])
        elif cell in GAPS:
            values[k] = np.nan
        else:
            reason = f"row {n}, column {c + 1}: {cell[:30]!r} is no number"
            allowed = "numbers in the columns that are read, without marks of thousands; for clock "
            allowed += 'times, columns={...} without t, and step="..."'
            raise refused(path, allowed, reason)
    if len(behind) > 1:
        several = ", ".join(repr(unit) for unit in sorted(behind))
        raise refused(path, "one unit in a column", f"column {c + 1} has {several} behind numbers")
    infinite = np.isinf(values)
    values[infinite] = np.nan  # an instrument beyond its range
    return values


# --- containers ----------------------------------------------------------------------------------


def _matlab(path: Any) -> Found:
    from scipy.io import loadmat  # slow to import

    found = Found("MATLAB")

    def visit(name: str, head: str, value: Any) -> None:
        if isinstance(value, np.ndarray) and value.dtype.names:
            for n, each in enumerate(value.ravel(), 1):
                of = name if value.size == 1 else f"{name}({n})"
                for key in value.dtype.names:
                    visit(f"{of}.{key}", key, each[key])
        elif isinstance(value, np.ndarray):
            found.add_array(name, head, value)

    try:
        content = loadmat(path)
    except Exception as error:  # of many kinds
        raise refused(path, "a MATLAB file that can be read", type(error).__name__) from None
    for name, value in content.items():
        if not name.startswith("__"):
            visit(name, name, value)
    return found


def _hdf5(path: Any, matlab: bool) -> Found:
    import h5py  # slow to import

    found = Found("MATLAB 7.3" if matlab else "HDF5")
    try:
        with h5py.File(path, "r") as file:

            def visit(name: str, item: Any) -> None:
                if not isinstance(item, h5py.Dataset):
                    return
                for key in item.dtype.names or ():
                    found.add_array(f"{name}.{key}", key, item[key])
                if item.attrs.get("MATLAB_class", b"") in (b"char", b"cell"):
                    return
                units = (item.attrs[key] for key in ("units", "unit") if key in item.attrs)
                texts = (
                    u for given in units for u in np.ravel(given) if isinstance(u, str | bytes)
                )
                unit = next(texts, "")
                unit = unit.decode() if isinstance(unit, bytes) else str(unit)
                if item.dtype.kind in "iufb" and item.ndim <= 2 and item.size > 1:
                    values = item[()]
                    head = name.rpartition("/")[2]
                    found.add_array(name, head, values.T if matlab else values, unit)

            file.visititems(visit)
    except (OSError, UnicodeDecodeError) as error:
        raise refused(path, "an HDF5 file that can be read", str(error)[:80]) from None
    if matlab:
        found.columns = {name.replace("/", "."): c for name, c in found.columns.items()}
    return found


def _tdms(path: Any) -> Found:
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise refused(path, "the extra 'tdms': pip install pyfric[tdms]", "a TDMS file") from None
    found = Found("TDMS")
    waves: dict[tuple[str, float, float, int], str] = {}
    try:
        for group in TdmsFile.read(path).groups():
            for channel in group.channels():
                if channel.dtype is None or np.dtype(channel.dtype).kind not in "iufb":
                    continue
                told = channel.properties
                unit = told.get("unit_string") or told.get("NI_UnitDescription") or ""
                name = f"{group.name}/{channel.name}"
                found.add_array(name, channel.name, np.asarray(channel[:]), str(unit))
                if step := told.get("wf_increment"):
                    waves.setdefault(
                        (group.name, told.get("wf_start_offset", 0.0), step, len(channel)), name
                    )
    except Exception as error:  # of many kinds
        raise refused(path, "a TDMS file that can be read", type(error).__name__) from None
    several = {key[0] for key in waves if sum(other[0] == key[0] for other in waves) > 1}
    for (of, begin, step, size), channel in waves.items():
        times = functools.partial(lambda b, s, n: b + s * np.arange(n), begin, step, size)
        name = f"time of {channel[len(of) + 1 :]}" if of in several else "time"
        found.add(f"{of}/{name}", Column(times, "time", "s"))
    return found


def _look(path: Any, content: bytes) -> Found | None:
    """Return the channels of a Look file, None if it is none."""
    if len(content) < HEAD + CHANNELS[0] * _CHANNEL.itemsize:
        return None
    for count, size in ((count, size) for count in CHANNELS for size in VALUES):
        begin = HEAD + count * _CHANNEL.itemsize
        if len(content) < begin:
            continue
        channels = np.frombuffer(content, _CHANNEL, count, HEAD)
        used = [c for c in channels if _written(c["name"]) and c["count"] > 0]
        values = sum(int(c["count"]) for c in used)
        if used and begin + values * size == len(content):
            found = Found("Look")
            order = _order(path, content[begin:], size)
            at = begin
            for c in used:
                array = np.frombuffer(content, f"{order}f{size}", int(c["count"]), at)
                name = _written(c["name"])
                found.add_array(name, name, array, _written(c["unit"]))
                at += int(c["count"]) * size
            return found
    return None


def _written(text: bytes) -> str:
    """Return a text of a Look file, which ends at its first zero; "" for a channel without use."""
    text = text.split(b"\0")[0].decode("latin-1").strip()
    return "" if text.startswith("no_val") else text


def _order(path: Any, content: bytes, size: int) -> str:
    """Return the order of bytes, ">" or "<": in the wrong one, numbers are beyond all bounds."""

    def usual(order: str) -> bool:
        values = np.abs(np.frombuffer(content, f"{order}f{size}").astype(float))
        return bool(((values == 0) | ((values > SMALLEST) & (values < LARGEST))).all())

    orders = [order for order in "><" if usual(order)]
    if len(orders) != 1:
        raise refused(path, "values in one order of bytes", "a Look file whose order is not clear")
    return orders[0]
