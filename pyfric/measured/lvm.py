"""What LabVIEW writes above a table in text (.lvm): sections, units and clocks of channels.

Each section has lines of its own above its heads, which end in a mark: number of channels, and for
each of them date and time of the first sample, X0 and Delta_X, unit. There may be no column of
times, one, or one for each channel.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping

import numpy as np

from pyfric.measured.found import Column

END = b"***End_of_Header***"
_CHANNELS = re.compile(rb"(?m)^Channels\b")
X = "X_Value"
"""Head of a column of times."""
_CLOCK = ("Date", "Time", "X0", "Delta_X")
"""What tells when a channel was sampled."""
Told = Mapping[str, list[str]]
"""Values of what is above a section, by name: one for each channel."""


def sections(content: bytes) -> tuple[list[Told], bytes]:
    """Return what stands above each section, and the text with these lines empty."""
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


def described(columns: list[Column], told: list[Told]) -> list[Column]:
    """Return the columns of a LabVIEW text with their units and clocks, and its times."""
    above = told[1] if len(told) > 1 else told[0]
    times = [column for column in columns if column.head == X]
    channels = [column for column in columns if column.head not in (X, "")]
    filled = [time for time in times if np.isfinite(time.numbers()).any()]
    found: list[Column] = []
    for n, column in enumerate(channels):
        if len(filled) > 1:
            before = [each for each in columns[: columns.index(column)] if each in filled]
            own = before[-1] if before else filled[0]
        else:
            own = filled[0] if filled else None
        values = {name: each[n] for name, each in above.items() if len(each) == len(channels)}
        clock = tuple(values.get(name, "") for name in _CLOCK)
        seconds = "s" if values.get("X_Dimension", "Time") == "Time" else ""
        if own is not None:
            clock = (*clock, hash(own.numbers().tobytes()))
            if own.clock is None:
                own.head, own.unit, own.clock = "time", seconds, clock
        column.clock = clock
        column.unit = column.unit or values.get("Y_Unit_Label", "")
        found.append(column)
    if not filled and len(told) < 3 and channels:
        values = {name: each[0] for name, each in above.items() if each}
        try:
            begin, step = float(values.get("X0", "0")), float(values["Delta_X"])
        except (KeyError, ValueError):
            return found
        size = len(channels[0].numbers())
        times = functools.partial(lambda b, s, n: b + s * np.arange(n), begin, step, size)
        found.append(Column(times, "time", "s", channels[0].clock))
    return [column for column in columns if column in filled or column in channels] + found[
        len(channels) :
    ]
