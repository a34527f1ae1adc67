"""Scene files, which are TOML. Every number that has a unit is written with it::

    name = "fig1"

    [slider]
    L = "140 mm"
    H = "75 mm"
    l = "2.5 mm"
    k = "13.5 MN/m"
    M = "75.6 g"

    [top]
    kind = "rod"            # or "distributed", or "prescribed"
    F_N = "3500 N"

    [driver]
    K = "4 MN/m"
    V = "0.7875 mm/s"
    h = "5 mm"

    [interface]
    mu_s = 0.7
    mu_k = 0.45

    [walls]                 # of a prescribed interface in two dimensions; may be left out
    left = "mirrored"       # or "free", "absorbing"
    right = "absorbing"
    top = "absorbing"       # or "held"

    [interface.law]         # may be left out: mu falls linearly over d_c, or at once if d_c = 0
    kind = "ageing"         # or another of `pyfric.laws`
    B = 0.01
    t_c = "1 ms"

A law of kind "table" takes lists or CSV files: slide = "friction.csv", from the scene's folder on.
Pure numbers are bare; lengths, forces and so on are text with any unit that fits. What may vary
along the interface is a number, a list, or a table, such as
mu_s = {mean = 0.7, std = 0.02, correlation_length = "10 mm", seed = 1}.
"""

import dataclasses
import os
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import tomli_w

from pyfric.scene.checked import Quantity, Written, names, quantities
from pyfric.scene.laws import KINDS, FrictionLaw
from pyfric.scene.parts import (
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.scene.protocol import Course
from pyfric.scene.spread import Spread
from pyfric.scene.units import SceneError, unknown

__all__ = ["MAX_FILE", "parsed", "read", "read_value", "text"]

MAX_FILE = 1_048_576
"""Largest scene file accepted, in bytes; two lists of `MAX_LISTED` forces fit."""
PARTS: dict[str, tuple[type, ...]] = {
    "slider": (Slider,),
    "top": (Rod, DistributedLoad, PrescribedLoad),
    "driver": (Driver,),
    "interface": (Interface,),
    "walls": (Walls,),
}
"""Table of a scene file -> classes of the part that it may hold, by their kinds."""
LAW = "law"
"""Table of the interface that holds a friction law."""


def _classes(section: str) -> tuple[type, ...]:
    return tuple(KINDS.values()) if section == f"interface.{LAW}" else PARTS[section]


def text(name: str, parts: Iterable[Any]) -> str:
    """Return a scene as TOML."""
    document: dict[str, Any] = {"name": name} if name else {}
    for part in parts:
        document[part._section] = _table(part, several=len(_classes(part._section)) > 1)
    return tomli_w.dumps(document)


def _table(part: Any, *, several: bool) -> dict[str, Any]:
    """Return a part as a table; the default friction law is left out."""
    table, marks = {"kind": part.kind} if several else {}, quantities(type(part))
    for field in dataclasses.fields(part):
        value, key = getattr(part, field.name), field.name
        if key == "dashpots" and value == field.default:
            continue
        if key == LAW and value != field.default:
            table[key] = _table(value, several=True)
        elif isinstance(marks.get(key), Course) and value:
            table[key] = marks[key].written(value)
        elif key != LAW and value not in (None, ()):
            table[key] = _as_written(value, marks[key].unit if key in marks else "")
    return table


def read(source: str | os.PathLike[str]) -> tuple[dict[str, Any], list[SceneError]]:
    """Return what a scene file or text holds, by the fields of a scene, and what is wrong in it.

    Raises:
        SceneError: it cannot be read, is too large or not TOML.
    """
    document = parsed(source)
    known = ["name", *PARTS]
    errors = [
        unknown(key, value, key, known) for key, value in document.items() if key not in known
    ]
    found: dict[str, Any] = {"name": document.get("name", "")}
    for section in PARTS:
        if section == "walls" and section not in document:
            continue
        try:
            found[section] = _part_from(section, document.get(section), _folder(source))
        except SceneError as error:
            errors.append(error)
    return found, errors


def read_value(name: str, value: Any, mark: Quantity | None, folder: Path) -> Any:
    """Return what stands in a scene file in `folder` for a field, as the scene has it.

    Args:
        name: dotted name of the field.
        value: what stands there: of a part or a friction law, its table.
        mark: the `Quantity` of the field, None for what is no number.
        folder: where files lie that the value names.

    Raises:
        SceneError: the value is refused.
    """
    if name in (*PARTS, f"interface.{LAW}"):
        return _part_from(name, value, folder)
    if mark is None:
        return value
    try:
        return mark.check(Written(value))
    except SceneError as error:
        raise error.at(name) from None


def _as_written(value: Any, unit: str) -> Any:
    """Return a value of a part as it stands in a scene file."""
    if isinstance(value, Spread):
        units = {key: unit for key in value.in_unit} | {"correlation_length": "m"}
        given = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return {
            key: _as_written(one, units.get(key, ""))
            for key, one in given.items()
            if one is not None
        }
    if isinstance(value, tuple):
        return [_as_written(one, unit) for one in value]
    return f"{value!r} {unit}" if unit else value


def parsed(source: str | os.PathLike[str], what: str = "scene") -> dict[str, Any]:
    """Return the TOML document in a file, or in a text of several lines.

    Args:
        source: the file or text.
        what: what it holds, for messages.

    Raises:
        SceneError: it cannot be read, is too large or not TOML.
    """
    if not isinstance(source, str | os.PathLike):
        raise SceneError(what, source, "", f"the path of a {what} file, or its text")
    if isinstance(source, str) and "\n" in source:
        name, data = None, source.encode("utf-8", "replace")
    else:
        name = str(source)
        try:
            with open(source, "rb") as file:
                data = file.read(MAX_FILE + 1)
        except (OSError, ValueError) as error:
            reason = f"cannot be read ({getattr(error, 'strerror', None) or error})"
            raise SceneError(what, name, "", f"a readable {what} file", reason) from None
    if len(data) > MAX_FILE:
        raise SceneError(what, name, "", f"at most {MAX_FILE} bytes of TOML", "too large")
    try:
        return tomllib.loads(data.decode("utf-8-sig"))  # some editors put a mark in front
    except RecursionError:
        raise SceneError(what, name, "", "a TOML document", "nested too deeply") from None
    except ValueError as error:
        raise SceneError(what, name, "", "a TOML document", f"not TOML ({error})") from None


def _folder(source: str | os.PathLike[str]) -> Path:
    """Return the folder from which a scene file names others; that of text is the current one."""
    return Path() if isinstance(source, str) and "\n" in source else Path(source).parent


def _part_from(section: str, table: Any, folder: Path) -> Any:
    """Return the part that a table of a scene file in `folder` describes."""
    if not isinstance(table, dict):
        reason = "missing" if table is None else "not a table"
        raise SceneError(section, table, "", f"a table [{section}]", reason)
    cls, table = _class_of(section, table)
    if issubclass(cls, FrictionLaw):
        table = cls.read_files(table, folder)
    known, marks = names(cls), quantities(cls)
    listed = [*(["kind"] if len(_classes(section)) > 1 else []), *known]
    errors = [
        unknown(f"{section}.{key}", value, key, listed)
        for key, value in table.items()
        if key not in known
    ]
    values = {
        key: Written(value) if key in marks else value
        for key, value in table.items()
        if key in known
    }
    try:
        if LAW in values:
            values[LAW] = _part_from(f"{section}.{LAW}", values[LAW], folder)
        part = cls(**values)
    except SceneError as error:
        errors.append(error)
    if errors:
        raise SceneError.joined(errors)
    return part


def _class_of(section: str, table: dict[str, Any]) -> tuple[type, dict[str, Any]]:
    """Return the class that a table asks for, and the rest of the table."""
    classes = _classes(section)
    if len(classes) == 1:
        return classes[0], table
    kinds, rest = {one.kind: one for one in classes}, dict(table)
    kind = rest.pop("kind", None)
    if not isinstance(kind, str):
        allowed = " or ".join(repr(one) for one in kinds)
        raise SceneError(
            f"{section}.kind", kind, "", allowed, "missing" if kind is None else "not text"
        )
    if kind not in kinds:
        raise unknown(f"{section}.kind", kind, kind, kinds)
    return kinds[kind], rest
