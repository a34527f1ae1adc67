"""Files of loggers: TDMS, MDF, universal files and Look.

The biaxial apparatus at Penn State writes Look files. A Look file begins with a head of 36 bytes: a
title of 20 characters and four integers (rows, columns, two without use). A head of 84 bytes
follows for each of 16 or 32 channels: 13 characters of name, 13 of unit, an integer, 50 characters
of comment, and the number of values. The values of each channel follow in turn. Integers are
big-endian; values have 4 or 8 bytes, in the order of the computer that wrote them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from pyfric.measured.found import Asked, Column, Found, refused
from pyfric.values import LARGEST, SMALLEST, read_at_most

SCALES = ("Linear", "Polynomial", "RTD", "Strain", "Table", "Thermistor", "Thermocouple")
SCALES += ("Add", "Subtract")
"""Scales of TDMS channels that npTDMS applies."""
TIME = 17
"""Type of an abscissa that is time, in universal files."""
_CHANNEL = np.dtype(
    [("name", "S13"), ("unit", "S13"), ("_", ">i4"), ("comment", "S50"), ("count", ">i4")]
)
HEAD = 36
CHANNELS = (16, 32)
VALUES = (4, 8)
"""Number of bytes of the head of a Look file; possible numbers of channels, and of bytes of a
value."""


def tdms(path: Any, asked: Asked) -> Found:
    """Return the channels of a TDMS file, and their times since the first sample of their group.

    Raises:
        SceneError: the file cannot be read, or a channel has a scale that npTDMS does not apply.
    """
    from nptdms import TdmsFile

    found = Found("TDMS")
    try:
        file = TdmsFile.read(path)
        spans = _spans(path)
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "a TDMS file that can be read", type(error).__name__) from None
    for group in file.groups():
        waves: dict[Any, str] = {}
        for channel in group.channels():
            if channel.dtype is None or np.dtype(channel.dtype).kind not in "iufb":
                continue
            told, name = channel.properties, f"{group.name}/{channel.name}"
            for of in (told, group.properties, file.properties):
                _check_scales(path, channel.name, of)
            unit = told.get("unit_string") or told.get("NI_UnitDescription") or ""
            clock = None
            if step := told.get("wf_increment"):
                own = spans.get(channel.path, ())
                if sum(count for _, count in own) != len(channel):
                    own = ((None, len(channel)),)
                clock = (group.name, told.get("wf_start_offset", 0.0), step, own)
                clock = next((other for other in waves if _together(other, clock)), clock)
                waves.setdefault(clock, channel.name)
            found.add_array(name, channel.name, np.asarray(channel[:]), str(unit), clock=clock)
        starts = [start for *_, own in waves for start, _ in own if start is not None]
        for clock, channel in waves.items():
            numbers = functools.partial(_times, clock, min(starts, default=None))
            name = f"time of {channel}" if len(waves) > 1 else "time"
            found.add(f"{group.name}/{name}", Column(numbers, "time", "s", clock))
            if len(clock[-1]) > 1:
                found.notes.append(f"{channel!r} was recorded in {len(clock[-1])} parts")
    return found


def _together(clock: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Whether two channels were sampled together: their parts begin within half a step."""
    half = np.timedelta64(round(0.5e9 * clock[2]), "ns")
    pairs = list(zip(clock[3], other[3], strict=False))
    known = [(a, b) for (a, _), (b, _) in pairs if a is not None and b is not None]
    return (
        clock[:3] == other[:3]
        and [count for _, count in clock[3]] == [count for _, count in other[3]]
        and [a is None for a, _ in clock[3]] == [b is None for b, _ in other[3]]
        and all(abs(a - b) <= half for a, b in known)
    )


def _times(clock: tuple[Any, ...], first: Any) -> np.ndarray:
    """Return the times of samples since the first start in a group, s."""
    _, offset, step, spans = clock
    parts = []
    for start, count in spans:
        late = 0.0 if start is None else float((start - first) / np.timedelta64(1, "s"))
        parts.append(late + offset + step * np.arange(count))
    return np.concatenate(parts)


def _spans(path: Any) -> dict[str, tuple[tuple[Any, int], ...]]:
    """Return the start and the number of samples of each part, by channel of a TDMS file.

    A repeated recording of a waveform writes a new start. npTDMS keeps only the last start.
    """
    from nptdms.reader import TdmsReader

    class Reader(TdmsReader):
        """Reads the properties of channels in each segment, in order."""

        def _update_object_properties(self, said: Any) -> None:
            super()._update_object_properties(said)
            said = {of: dict(pairs) for of, pairs in (said or {}).items()}
            starts = {of: pairs.get("wf_start_time") for of, pairs in said.items()}
            told.append({of: start and start.as_datetime64("ns") for of, start in starts.items()})

    told: list[dict[str, Any]] = []
    found: dict[str, list[tuple[Any, int]]] = {}
    reader = Reader(path)
    try:
        reader.read_metadata()
        for said, segment in zip(told, reader._segments, strict=True):
            for each in segment.ordered_objects:
                count = each.number_values * segment.num_chunks if each.has_data else 0
                parts = found.setdefault(each.path, [])
                start = said.get(each.path)
                if parts and start in (None, parts[-1][0]):
                    parts[-1] = parts[-1][0], parts[-1][1] + count
                elif count:
                    parts.append((start, count))
    finally:
        reader.close()
    return {of: tuple(parts) for of, parts in found.items()}


def _check_scales(path: Any, channel: str, told: Mapping[str, Any]) -> None:
    """Check that npTDMS applies the scales of a channel, its group or the file.

    Raises:
        SceneError: npTDMS would return raw counts.
    """
    if told.get("NI_Scaling_Status") == "scaled":
        return
    for n in range(int(told.get("NI_Number_Of_Scales", 0))):
        kind = told.get(f"NI_Scale[{n}]_Scale_Type")
        if kind not in (None, *SCALES):
            allowed = f"one of {', '.join(SCALES)}; else save scaled values in LabVIEW or DIAdem"
            raise refused(path, allowed, f"channel {channel!r} has a scale of type {kind!r}")


def mdf(path: Any, asked: Asked) -> Found:
    """Return the channels of an MDF file, 3 or 4, and the times of each group of channels.

    Raises:
        SceneError: the file cannot be read.
    """
    from asammdf import MDF

    found = Found("MDF")
    try:
        with MDF(path) as file:
            clocks: dict[bytes, str] = {}
            for g, group in enumerate(file.groups):
                master = file.masters_db.get(g)
                times = np.asarray(file.get_master(g))
                clock = times.tobytes()
                for c, channel in enumerate(group.channels):
                    if c == master:
                        continue
                    signal = file.get(group=g, index=c, ignore_invalidation_bits=True)
                    bad = signal.invalidation_bits
                    values = np.asarray(signal.samples)
                    if values.dtype.kind not in "iufb" or values.ndim > 1:
                        continue
                    if bad is not None and np.any(bad):
                        values = np.where(bad, np.nan, values.astype(float))
                        said = f"{channel.name!r}: {np.sum(bad)} invalid samples are gaps"
                        found.notes.append(said)
                    found.add_array(
                        channel.name, channel.name, values, signal.unit or "", clock=clock
                    )
                if master is not None and len(times) > 1 and clock not in clocks:
                    clocks[clock] = "time" if len(file.groups) == 1 else f"time of group {g + 1}"
                    numbers = functools.partial(np.copy, times)
                    found.add(clocks[clock], Column(numbers, "time", "s", clock))
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "an MDF file that can be read", type(error).__name__) from None
    return found


def universal(path: Any, asked: Asked) -> Found:
    """Return the functions of time in a universal file (datasets 58).

    Raises:
        SceneError: the file cannot be read.
    """
    from pyuff import UFF

    found = Found("universal file")
    try:
        file = UFF(path)
        kinds = file.get_set_types()
        sets = [file.read_sets(n) for n, kind in enumerate(kinds) if int(kind) == 58]
    except Exception as error:  # libraries raise many types of errors
        raise refused(path, "a universal file that can be read", type(error).__name__) from None
    clocks: dict[Any, tuple[str, str, np.ndarray]] = {}
    for n, each in enumerate(sets, 1):
        values, times = np.asarray(each["data"]), np.asarray(each["x"], dtype=float)
        name = _said(each, "id1") or _said(each, "rsp_ent_name") or f"set {n}"
        if values.dtype.kind == "c" or each.get("abscissa_spec_data_type") != TIME:
            found.notes.append(f"{name!r} is left out: it is no function of time")
            continue
        clock = times.tobytes()
        if clock not in clocks:
            clocks[clock] = name, _said(each, "abscissa_axis_units_lab") or "s", times
            if each.get("abscissa_spacing") == 1:
                found.notes += _digits(name, float(each["abscissa_inc"]), len(times))
        unit = _said(each, "ordinate_axis_units_lab")
        found.add_array(name, name, values, unit, clock=clock)
    for clock, (name, unit, times) in clocks.items():
        name = f"time of {name}" if len(clocks) > 1 else "time"
        found.add(name, Column(functools.partial(np.copy, times), "time", unit, clock))
    return found


def _said(dataset: Mapping[str, Any], key: str) -> str:
    """Return the text of an entry of a universal file, "" for "NONE"."""
    text = str(dataset.get(key, "")).strip()
    return "" if text == "NONE" else text


def _digits(name: str, step: float, size: int) -> list[str]:
    """Return a list with a note if six digits in a file may round a time step (s)."""
    if not step or float(f"{step:.4g}") == step:  # a round number
        return []
    late = 0.5 * 10 ** (np.floor(np.log10(step)) - 5) * size
    said = f"{name!r}: of its interval, {step:.6g} s, the file has six digits; times may be off by"
    return [f"{said} {late:.2g} s at the end"]


def is_look(start: bytes, size: int) -> bool:
    """Whether a file with these first bytes is a Look file."""
    return _sizes(start, size) is not None


def _sizes(content: bytes, size: int) -> tuple[int, int] | None:
    """Return the number of channels and of bytes of a value; None if this is no Look file."""
    for count, each in ((count, each) for count in CHANNELS for each in VALUES):
        begin = HEAD + count * _CHANNEL.itemsize
        if len(content) < begin:
            continue
        channels = np.frombuffer(content, _CHANNEL, count, HEAD)
        used = [c for c in channels if _written(c["name"]) and c["count"] > 0]
        if used and begin + sum(int(c["count"]) for c in used) * each == size:
            return count, each
    return None


def look(path: Any, asked: Asked) -> Found:
    """Return the channels of a Look file.

    Raises:
        SceneError: the order of bytes in the file is not clear.
    """
    content = read_at_most(path)
    sizes = _sizes(content, len(content))
    assert sizes is not None  # `is_look` was true
    count, size = sizes
    found, at = Found("Look"), HEAD + count * _CHANNEL.itemsize
    order = _order(path, content[at:], size)
    for c in np.frombuffer(content, _CHANNEL, count, HEAD):
        if (name := _written(c["name"])) and c["count"] > 0:
            array = np.frombuffer(content, f"{order}f{size}", int(c["count"]), at)
            found.add_array(name, name, array, _written(c["unit"]))
            at += int(c["count"]) * size
    return found


def _written(text: bytes) -> str:
    """Return a text of a Look file, up to its first zero byte; "" for an unused channel."""
    text = text.split(b"\0")[0].decode("latin-1").strip()
    return "" if text.startswith("no_val") else text


def _order(path: Any, content: bytes, size: int) -> str:
    """Return the byte order, ">" or "<", in which all numbers have a possible size."""

    def usual(order: str) -> bool:
        values = np.abs(np.frombuffer(content, f"{order}f{size}").astype(float))
        return bool(((values == 0) | ((values > SMALLEST) & (values < LARGEST))).all())

    orders = [order for order in "><" if usual(order)]
    if len(orders) != 1:
        raise refused(path, "values in one order of bytes", "a Look file whose order is not clear")
    return orders[0]
