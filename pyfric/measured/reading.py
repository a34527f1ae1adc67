"""Read a measured curve from a file: choose columns, find units and meanings."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from pyfric.measured.curve import SIGNALS, Curve
from pyfric.measured.formats import KINDS, contents
from pyfric.measured.found import Asked, Column, Found, refused
from pyfric.measured.meanings import AMBIGUOUS, MEANINGS, bare, factor, meaning_of, unit_of_name
from pyfric.values import LARGEST, SceneError, check_number, check_whole, parse_quantity, usage

Restarts = Literal["join"] | int
NAMED = 6
"""Largest number of unused columns that a note names."""
GIVEN = {
    "columns": '{"t": 1, "F_T": "Force"}',
    "units": '{"t": "s", "F_T": "N"}',
    "calibration": '{"F_T": "0.12 N"}',
    "wraps": '{"load_point": 65536}',
    "valid": '{"F_T": ("-5 kN", "5 kN")}',
}
"""Argument that is a dict -> example of its value."""
BITS = (12, 14, 16, 24)
"""Numbers of bits of converters and counters."""
SOME = 1000
"""Number of samples that are tested for whole numbers."""
NEAR_END = 0.02
"""Distance from an end of the range of a counter, over the range, within which numbers reach the
end."""


@usage('read("curve.csv", units={"t": "s", "F_T": "N"}, F_N="400 N")')
def read(
    path: str | os.PathLike[str],
    columns: Mapping[str, str | int] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    calibration: Mapping[str, str | tuple[str, float]] | None = None,
    F_N: float | str | None = None,
    area: float | str | None = None,
    step: float | str | None = None,
    group: str = "",
    head: int = 0,
    decimal: Literal[".", ","] | None = None,
    gaps: str | Sequence[str] = (),
    wraps: Mapping[str, float] | None = None,
    valid: Mapping[str, tuple[float | str, float | str]] | None = None,
    restarts: Restarts | None = None,
) -> Curve:
    """Read a measured loading curve, or the curve of a slip sensor.

    The first bytes of a file decide its kind: {KINDS}. Some kinds need an extra. Units and meanings
    come from the file or from the arguments. If a unit or a meaning is missing, the file is
    refused, and the message says what to add.

    Args:
        path: the file.
        columns: meaning -> name of its column, or its number, from 1. Meanings are {MEANINGS}; step
            is the time since the previous sample, and is summed to t. None means all columns whose
            names have a known meaning. In files with groups, a name may omit its group. Columns of
            an array are called "name:1", "name:2" and so on; if its channels are in rows,
            "name(1,:)", "name(2,:)".
        units: meaning -> unit, where the file does not state it.
        calibration: meaning -> value of 1 in the file, such as "0.12 N", or a pair of this value
            and the number in the file that means zero. `calibration` replaces units.
        F_N, area: normal force (N) and area of the interface (m^2), or quantities with units.
        step: time between samples, s, if the file has no times.
        group: beginning of the names in a container, such as a group of HDF5 or TDMS.
        head: number of lines at the top of a text that are left out.
        decimal: decimal mark of a text, if it is ambiguous.
        gaps: words in a text that stand for gaps, such as "OVLD".
        wraps: meaning -> period of a counter that starts anew at its end, in numbers of the file,
            such as 65536. Changes of more than half a period count as a new start.
        valid: meaning -> smallest and largest value of the sensor's range, in SI or with units.
            Samples at these values or beyond are gaps.
        restarts: what to do if times start anew. "join" continues the times, one median step after
            the last. A number selects one part, counted from 1.

    Returns:
        The curve in SI units. Samples without a time are left out; other gaps are NaN. Its notes
        name the meaning of each column, and the unused columns.

    Raises:
        SceneError: the file cannot be read, or an entry of the file is not understood.
    """
    if not isinstance(path, str | os.PathLike):
        allowed = 'the path of a file, such as "curve.csv"'
        raise SceneError("path", type(path).__name__, "", allowed, "no path")
    check_whole("head", head, 0)
    if decimal not in (None, ".", ","):
        raise SceneError("decimal", decimal, "", '".", ",", or None')
    words = (gaps,) if isinstance(gaps, str) else tuple(gaps)
    given: dict[str, Any] = {"columns": columns, "units": units, "calibration": calibration}
    given |= {"wraps": wraps, "valid": valid}
    for name, pairs in given.items():
        if not isinstance(pairs, Mapping | None):
            allowed = f"a dict with meanings as keys, such as {name}={GIVEN[name]}"
            raise SceneError(name, repr(pairs), "", allowed, "no dict")
        if unknown := sorted(set(pairs or ()) - set(MEANINGS)):
            raise SceneError(f"{name}.{unknown[0]}", None, "", ", ".join(MEANINGS), "no meaning")
    for name, unit in (units or {}).items():
        if not isinstance(unit, str):
            raise SceneError(f"units.{name}", repr(unit), "", 'a unit in quotes, such as "kN"')
    found = contents(path, Asked(head, decimal, frozenset(words)))
    if group:
        of = {n: c for n, c in found.columns.items() if n.startswith(str(group))}
        names = {n[len(str(group)) :].lstrip("/.") or n: c for n, c in of.items()}
        if not names:
            raise SceneError("group", group, "", _names(found), "nothing has a name like this")
        found.columns = names
    chosen = _by_name(path, found) if columns is None else _chosen(found, columns)
    times = [name for name in chosen if name == "t" or MEANINGS[name].sums == "t"]
    if step is not None and times:
        raise SceneError("step", step, "s", "None", "the file has times")
    if len(times) > 1:
        raise SceneError("columns.step", None, "", "t or step", "both tell times")
    _check_clocks(path, found, chosen)
    for name in ("wraps", "valid"):
        if lost := sorted(set(given[name] or ()) - set(chosen)):
            allowed = f"one of {', '.join(chosen)}"
            raise SceneError(f"{name}.{lost[0]}", None, "", allowed, "no such column")
    table = {meaning: found.columns[name].numbers() for meaning, name in chosen.items()}
    scales = _scales(found, chosen, units or {}, calibration or {})
    for meaning, name in chosen.items():
        numbers = table[meaning]
        beyond = np.abs(numbers) > LARGEST
        if beyond.any():
            numbers[beyond] = np.nan
            found.notes.append(f"{name!r}: {beyond.sum()} numbers beyond {LARGEST:g} are gaps")
        if wraps and meaning in wraps:
            numbers = _unwrapped(meaning, numbers, wraps[meaning])
        else:
            _note_counter(found, meaning, name, numbers)
        scale, zero = scales[meaning]
        if zero:
            numbers -= zero
        if scale != 1.0:
            numbers *= scale
        if valid and meaning in valid:
            _leave_out(found, meaning, numbers, valid[meaning])
        table[meaning] = numbers
    if len({len(values) for values in table.values()}) > 1:
        told = ", ".join(f"{name}: {len(values)}" for name, values in table.items())
        raise refused(path, "columns of one length: choose a group or columns", told)
    if step is not None:
        size = len(next(iter(table.values()), []))
        table = {"t": check_number("step", step, "s", gt=0.0) * np.arange(size)} | table
    table = _summed(table)
    _check_chosen(path, found, table)
    kept = np.isfinite(table["t"])
    if not kept.all():
        found.notes.append(f"{np.sum(~kept)} samples without a time were left out")
        table = {name: values[kept] for name, values in table.items()}
    table = _one_start(path, table, restarts, found)
    notes = [f"{found.kind}", *found.notes]
    unused = [repr(name) for name in found.columns if name and name not in chosen.values()]
    if unused:
        more = f" and {len(unused) - NAMED} more" if len(unused) > NAMED else ""
        notes.append(f"not used: {', '.join(unused[:NAMED])}{more}")
    if F_N is not None and "F_N" in table:
        raise SceneError("F_N", F_N, "N", "None", "the file has normal forces")
    normal = table.pop("F_N", F_N)
    source = os.fspath(path)
    return Curve.of(F_N=normal, area=area, source=source, notes=notes, copy=False, **table)


for _name, _text in (("{KINDS}", KINDS), ("{MEANINGS}", ", ".join(MEANINGS))):
    read.__doc__ = str(read.__doc__).replace(_name, _text)


def _check_clocks(path: Any, found: Found, chosen: Mapping[str, str]) -> None:
    """Check that the chosen columns have the same clock.

    Raises:
        SceneError: their clocks differ, so that samples in one row have different times.
    """
    own = {name: found.columns[name].clock for name in chosen.values()}
    own = {name: clock for name, clock in own.items() if clock is not None}
    first = next(iter(own.values()), None)
    if other := next((name for name, clock in own.items() if clock != first), ""):
        allowed = "columns of one clock: columns={...} chooses them, for a curve of each clock"
        raise refused(path, allowed, f"{next(iter(own))!r} and {other!r} were not sampled together")


def _summed(table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the columns, with cumulative sums in place of columns that are summed."""
    found = {}
    for name, values in table.items():
        if of := MEANINGS[name].sums:
            name, values = of, np.cumsum(values) - values[:1]
            if not np.isfinite(values).all():
                gap = int(np.argmin(np.isfinite(values))) + 1
                reason = f"sample {gap} has none"
                raise SceneError("step", None, "s", "intervals without gaps", reason)
        found[name] = values
    return found


def _unwrapped(meaning: str, numbers: np.ndarray, period: Any) -> np.ndarray:
    period = check_number(f"wraps.{meaning}", period, "", gt=0.0)
    kept = np.isfinite(numbers)
    numbers[kept] = np.unwrap(numbers[kept], period=period)
    return numbers


def _note_counter(found: Found, meaning: str, name: str, numbers: np.ndarray) -> None:
    """Add a note if a counter reaches its ends or starts anew."""
    if (numbers[:SOME] % 1 > 0).any():
        return
    known = numbers[np.isfinite(numbers)]
    if len(known) < 2 or (known % 1).any():
        return
    low, high = known.min(), known.max()
    for bits in BITS:
        for begin in (0, -(2 ** (bits - 1))):
            size = 2**bits
            end, near = begin + size - 1, NEAR_END * size
            if not (begin <= low <= begin + near and end - near <= high <= end):
                continue
            if at := int(np.sum((known == begin) | (known == end))):
                said = f"{name!r} stands at an end of {bits} bits in {at} samples"
                found.notes.append(f"{said}, as what is beyond does")
            steps = np.diff(known)
            k = int(np.argmax(np.abs(steps)))
            if abs(steps[k]) > size / 2:
                found.notes.append(
                    f"{name!r} jumps by {steps[k]:.0f} behind sample {k + 1}: a counter of {bits} "
                    f'bits that was set back, or wraps (wraps={{"{meaning}": {size}}} undoes it)'
                )
            return


def _leave_out(found: Found, meaning: str, values: np.ndarray, ends: Any) -> None:
    """Turn values at the ends of a sensor's range, or beyond, into gaps."""
    field, unit = f"valid.{meaning}", MEANINGS[meaning].unit
    try:
        low, high = (check_number(field, end, unit) for end in ends)
    except (TypeError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(field, repr(ends), unit, "two ends, the smaller one first", "") from None
    if not low < high:
        raise SceneError(field, repr(ends), unit, "two ends, the smaller one first", "")
    out = (values <= low) | (values >= high)
    values[out] = np.nan
    found.notes.append(f"{meaning}: {out.sum()} samples that are not valid are gaps")


def _names(found: Found) -> str:
    names = "one of " + ", ".join(map(repr, found.columns)) if found.columns else "nothing"
    return "; ".join([names, *(note for note in found.notes if "left out" in note)])


def _by_name(path: Any, found: Found) -> dict[str, str]:
    """Return meaning -> name of the columns whose names have a known meaning."""
    chosen: dict[str, str] = {}
    meanings = {meaning_of(column.head) for column in found.columns.values()} - {""}
    for name, column in found.columns.items():
        if not (meaning := meaning_of(column.head)):
            continue
        if MEANINGS[meaning].sums in meanings:
            continue
        if meaning in chosen:
            allowed = f'columns={{"{meaning}": {chosen[meaning]!r}, ...}} or another choice'
            reason = f"{chosen[meaning]!r} and {name!r} are both {meaning}"
            raise refused(path, allowed, reason)
        chosen[meaning] = name
    return chosen


def _chosen(found: Found, columns: Mapping[str, str | int]) -> dict[str, str]:
    """Return meaning -> name of the requested columns."""
    chosen, names = {}, list(found.columns)
    for meaning, asked in columns.items():
        if not names:
            raise SceneError(f"columns.{meaning}", asked, "", _names(found), "no columns")
        if isinstance(asked, int) and not isinstance(asked, bool):
            check_whole(f"columns.{meaning}", asked, 1, len(names))
            chosen[meaning] = names[asked - 1]
            continue
        same = [name for name in names if name == asked]
        same = same or [n for n in names if found.columns[n].head == asked]
        same = same or [n for n in names if re.split("[/.]", n)[-1] == asked]
        same = same or [n for n in names if bare(found.columns[n].head) == bare(str(asked))]
        if len(same) != 1:
            reason = f"{len(same)} columns have this name"
            raise SceneError(f"columns.{meaning}", asked, "", _names(found), reason)
        chosen[meaning] = same[0]
    for meaning, name in chosen.items():
        if other := next((m for m, n in chosen.items() if n == name and m != meaning), ""):
            allowed = "a column for each meaning"
            raise SceneError(f"columns.{other}", name, "", allowed, f"it is {meaning}, too")
    return chosen


def _check_chosen(path: Any, found: Found, table: Mapping[str, Any]) -> None:
    """Refuse a file without times, or without force and slip; suggest columns."""
    may = [
        f"{name!r} may be {AMBIGUOUS[bare(column.head)]}"
        for name, column in found.columns.items()
        if bare(column.head) in AMBIGUOUS
    ]
    said = f"; columns: {', '.join(map(repr, found.columns)) or 'none'}"
    said = "; ".join([said, *(note for note in found.notes if "left out" in note)])
    may = f"; {', '.join(may)}" if may else ""
    if "t" not in table:
        allowed = 'columns={"t": name or number, ...}, or step= for equal steps'
        raise refused(path, allowed + said, "no column is known to be the time" + may)
    if not SIGNALS & set(table):
        allowed = 'columns={"t": ..., "F_T": name or number}, or tau, mu or slip'
        raise refused(path, allowed + said, "no column is known to be F_T, tau, mu or slip" + may)


def _scales(
    found: Found,
    chosen: Mapping[str, str],
    units: Mapping[str, str],
    calibration: Mapping[str, Any],
) -> dict[str, tuple[float, float]]:
    """Return the factor to SI of each chosen column, and the number in it that means zero."""
    missing: list[SceneError] = []
    found_scales = {}
    for meaning, name in chosen.items():
        column = found.columns[name]
        found_scales[meaning] = _scale(found, meaning, name, column, units, calibration, missing)
    if missing:
        first, *others = missing
        raise SceneError(*first.args[:-1], others)
    return found_scales


def _scale(
    found: Found,
    meaning: str,
    name: str,
    column: Column,
    units: Mapping[str, str],
    calibration: Mapping[str, Any],
    missing: list[SceneError],
) -> tuple[float, float]:
    """Return the factor to SI of a column, and the number in it that means zero.

    If the unit is not stated, an error is added to `missing`.
    """
    si = MEANINGS[meaning].unit
    if meaning in calibration:
        given = calibration[meaning]
        each, zero = given if isinstance(given, tuple) and len(given) == 2 else (given, 0.0)
        field = f"calibration.{meaning}"
        scale = parse_quantity(field, each, si) if si else check_number(field, each, "")
        if not scale:
            allowed = "what 1 in the file stands for, or a pair of this and the number for zero"
            raise SceneError(field, each, "", allowed, "zero")
        found.notes.append(f"{meaning}: {name!r}, calibrated")
        return scale, check_number(field, zero, "")
    where = f"units.{meaning}"
    stated = column.unit
    try:
        in_name = unit_of_name(column.head, si) if not stated else ""
    except ValueError as error:
        in_name, unclear = "", f"{name!r}: {error}"
    else:
        unclear = ""
    stated = stated or in_name
    given = units.get(meaning)
    if stated:
        if meaning in units and factor(where, given, si)[0] != factor(where, stated, si)[0]:
            raise SceneError(where, given, "", f"the unit in the file, {stated}", "it differs")
        try:
            scale, unit = factor(where, stated, si)
        except SceneError as error:
            allowed = f'calibration={{"{meaning}": "... {si or 1}"}}: what 1 in the file stands for'
            reason = f"{name!r} has the unit {stated!r}, which is none of {si or 'a ratio'}"
            if stated == "mPa":
                reason = f"{name!r} has the unit mPa, which may be a spelling of MPa"
            raise SceneError(where, None, si, allowed, reason) from error
    elif given is not None:
        scale, unit = factor(where, given, si)
    elif si:
        allowed = f'units={{"{meaning}": "{si}"}} or another unit'
        reason = unclear or f"{name!r} has no unit in the file"
        missing.append(SceneError(where, None, si, allowed, reason))
        return 1.0, 0.0
    elif unclear:
        raise SceneError(where, None, si, f'units={{"{meaning}": "1"}} or "%"', unclear)
    else:
        scale, unit = 1.0, ""
    found.notes.append(f"{meaning}: {name!r}" + f" in {unit}" * bool(unit))
    return scale, 0.0


def _one_start(
    path: Any, table: dict[str, np.ndarray], restarts: Restarts | None, found: Found
) -> dict[str, np.ndarray]:
    """Return the columns with times that do not decrease."""
    t = table["t"]
    starts = np.flatnonzero(np.diff(t) < 0) + 1
    if not len(starts):
        if restarts not in (None, "join", 1):
            raise SceneError("restarts", restarts, "", "None", "times do not start anew")
        return table
    parts = np.split(np.arange(len(t)), starts)
    whole = isinstance(restarts, int) and not isinstance(restarts, bool)
    if restarts != "join" and not whole:
        allowed = f'restarts="join", or the number of a part, 1 to {len(parts)}'
        reason = f"times start anew {len(starts)} times, first at sample {starts[0] + 1}"
        if restarts is not None:
            raise SceneError("restarts", restarts, "", allowed, reason)
        raise refused(path, allowed, reason)
    if whole:
        rows = parts[check_whole("restarts", restarts, 1, len(parts)) - 1]
        found.notes.append(f"part {restarts} of {len(parts)}")
        return {name: values[rows] for name, values in table.items()}
    joined = t.copy()
    for rows in parts[1:]:
        step = float(np.median(np.diff(t[rows]))) if len(rows) > 1 else 0.0
        joined[rows] = t[rows] - t[rows[0]] + joined[rows[0] - 1] + step
    found.notes.append(f"{len(parts)} parts, joined")
    return table | {"t": joined}
