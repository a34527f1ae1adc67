"""Heads of LabVIEW text files (.lvm): sections, units and clocks of channels.

Each section begins with lines that end in a mark. These lines give the number of channels and, for
each channel, date and time of the first sample, X0, Delta_X and unit. The names of columns follow.
A section may have no column of times, a single column, or one for each channel.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pyfric.measured.found import Column

END = b"***End_of_Header***"
_CHANNELS = re.compile(rb"(?m)^Channels\b")
X = "X_Value"
"""Head of a column of times."""
_CLOCK = ("Date", "Time", "X0", "Delta_X")
"""Entries that define the clock of a channel."""
Told = Mapping[str, list[str]]
"""Entries above a section: name -> a value for each channel."""


def sections(content: bytes) -> tuple[list[Told], bytes]:
    """Return the entries above each section, and the text with these lines empty."""
    told: list[Told] = []
    at = last = 0
    kept = []
    while (mark := content.find(END, at)) >= 0:
        starts = [at + m.start() for m in _CHANNELS.finditer(content[at:mark])]
        begin = starts[-1] if starts else (at if not last else mark)
        end = content.find(b"\n", mark)
        end = len(content) if end < 0 else end
        block = content[begin:end]
        told.append(_told(block))
        kept += [content[last:begin], b"\n" * block.count(b"\n")]
        at = last = end
    if not told:
        return [], content
    file, *own = told
    return [file, *own], b"".join(kept) + content[last:]


def _told(block: bytes) -> Told:
    text = block.decode("latin-1")
    lines = (line.split("\t" if "\t" in text else ",") for line in text.splitlines())
    cells = {line[0].strip(): [cell.strip() for cell in line[1:]] for line in lines}
    return {name: [cell for cell in values if cell] for name, values in cells.items()}


def decimal(told: list[Told]) -> str | None:
    """Return the decimal mark that the file states."""
    mark = told[0].get("Decimal_Separator", []) if told else []
    return mark[0] if mark and mark[0] in (".", ",") else None


def described(columns: list[Column], told: list[Told]) -> list[tuple[str, Column]]:
    """Return the columns of a text by name; a LabVIEW text also gives units, clocks and times."""
    if not told:
        return [(column.head, column) for column in columns]
    above = told[1] if len(told) > 1 else told[0]
    channels = [column for column in columns if column.head not in (X, "")]
    own: Column | None = None
    found: list[tuple[str, Column]] = []
    clocks: list[tuple[Any, ...]] = []
    for column in columns:
        if column.head == X and np.isfinite(column.numbers()).any():
            own = replace(column, head="time", unit="s")
            found.append((X, own))
        elif column in channels:
            n = channels.index(column)
            values = {name: each[n] for name, each in above.items() if len(each) == len(channels)}
            clock = _clock(values, own, clocks)
            if own is not None and own.clock is None:
                own.unit = "s" if values.get("X_Dimension", "Time") == "Time" else ""
                own.clock = clock
            unit = column.unit or values.get("Y_Unit_Label", "")
            found.append((column.head, replace(column, unit=unit, clock=clock)))
    step = _number(above.get("Delta_X", [""])[0])
    if own is None and len(told) < 3 and channels and step:
        begin, size = _number(above.get("X0", [""])[0]) or 0.0, len(channels[0].numbers())
        times = functools.partial(lambda b, s, n: b + s * np.arange(n), begin, step, size)
        found.append(("time", Column(times, "time", "s", clocks[0])))
    return found


def _clock(
    values: Mapping[str, str], times: Column | None, clocks: list[tuple[Any, ...]]
) -> tuple[Any, ...]:
    """Return the clock of a channel: start, date, X0, step, times; add it to the known clocks.

    Channels that began within half a step of each other have the same clock.
    """
    date, begin, late, step = (values.get(name, "") for name in _CLOCK)
    written = b"" if times is None else times.numbers().tobytes()
    clock = (begin, date, late, step, written)
    half = 0.5 * (_number(step) or 0.0)
    for other in clocks:
        apart = abs(_seconds(other[0]) - _seconds(begin))
        if other[1:] == clock[1:] and (other[0] == begin or apart <= half):
            return other
    clocks.append(clock)
    return clock


def _number(text: str) -> float | None:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def _seconds(text: str) -> float:
    """Return the seconds of a time such as 12:01:02.5, NaN for any other text."""
    parts = [_number(part) for part in text.split(":")]
    if len(parts) != 3 or None in parts:
        return np.nan
    return float(np.dot(parts, (3600.0, 60.0, 1.0)))
