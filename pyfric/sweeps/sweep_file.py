"""The file of a sweep: TOML, in which quantities carry their units (see `points`)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyfric.engines import OPTION_UNITS
from pyfric.scene import (
    PRESETS,
    Scene,
    SceneError,
    check_number,
    parse_quantity,
    preset,
    unknown,
)
from pyfric.sweeps.varied import Span, units

__all__ = ["read_sweep"]


def read_sweep(path: Path) -> dict[str, Any]:
    """Return the arguments of the `Sweep` that a file describes.

    Raises:
        SceneError: it cannot be read, or a value is refused.
    """
    document = _document(path)
    known = ("scene", "t_end", "points", "n", "seed", "over", "options", "limits")
    for key, value in document.items():
        if key not in known:
            raise unknown(key, value, key, known)
    for key in ("scene", "t_end", "over"):
        if key not in document:
            raise SceneError(key, None, "", "an entry of a sweep", "missing")
    tables = {key: _table(document, key) for key in ("over", "options", "limits")}
    scene = _scene(document["scene"], path.parent)
    for key, value in tables["limits"].items():
        if key not in ("max_hours", "max_GB"):
            raise unknown(f"limits.{key}", value, key, ("max_hours", "max_GB"))
    return {
        "scene": scene,
        "t_end": _si("t_end", document["t_end"], "s"),
        "over": _over(tables["over"], units(scene)),
        "options": {
            key: _si(f"options.{key}", value, OPTION_UNITS.get(key))
            for key, value in tables["options"].items()
        },
        **{key: document[key] for key in ("points", "n", "seed") if key in document},
        **tables["limits"],
    }


def _over(table: Mapping[str, Any], unit_of: Mapping[str, str | None]) -> dict[str, Any]:
    over = {}
    for name, value in _flat(table).items():
        if name not in unit_of:
            raise unknown(f"over.{name}", value, name, unit_of)
        over[name] = _read(name, value, unit_of[name])
    return over


def _document(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        reason = f"cannot be read ({error.strerror})"
        raise SceneError("sweep", str(path), "", "a readable sweep file", reason) from None
    except (ValueError, RecursionError) as error:
        raise SceneError("sweep", str(path), "", "a TOML document", f"not TOML ({error})") from None


def _table(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise SceneError(key, table, "", f"a table [{key}]", "not a table")
    return table


def _scene(given: Any, folder: Path) -> Scene:
    if isinstance(given, str) and given in PRESETS:
        return preset(given)
    if isinstance(given, str):
        return Scene.from_toml(folder / given)
    if isinstance(given, dict):
        import tomli_w

        return Scene.from_toml(tomli_w.dumps(given) + "\n")
    raise SceneError("scene", given, "", "a preset, a scene file or a table [scene]")


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by their dotted names."""
    found = {}
    for key, value in table.items():
        inner = isinstance(value, dict) and "from" not in value
        found |= _flat(value, f"{prefix}{key}.") if inner else {prefix + key: value}
    return found


def _read(name: str, value: Any, unit: str | None) -> list[Any] | Span:
    name = f"over.{name}"
    if isinstance(value, list):
        return [_si(name, one, unit) for one in value]
    if not isinstance(value, dict):
        raise SceneError(name, value, "", "a list of values, or a range with from and to")
    known = ("from", "to", "n", "step", "scale")
    for key in value:
        if key not in known:
            raise unknown(f"{name}.{key}", value[key], key, known)
    if unit is None or "to" not in value:
        raise SceneError(name, value, "", "a list" if unit is None else "a range with from and to")
    lengths = {
        key: _si(f"{name}.{key}", value[key], unit)
        for key in ("from", "to", "step")
        if key in value
    }
    rest = {key: value[key] for key in ("n", "scale") if key in value}
    return Span(start=lengths["from"], stop=lengths["to"], step=lengths.get("step"), **rest)


def _si(name: str, value: Any, unit: str | None) -> Any:
    """Return a value of the file, as a number in SI where it has a unit."""
    if unit and not (name.endswith("options.dt") and value == "auto"):
        return parse_quantity(name, value, unit)
    return check_number(name, value, "") if unit == "" else value
