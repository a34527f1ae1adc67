"""The file of a sweep: TOML, in which quantities carry their units (see `pyfric.sweeps.sweep`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from pyfric.scene import (
    PRESETS,
    Quantity,
    Scene,
    SceneError,
    Written,
    naming,
    parsed,
    preset,
    unknown,
)
from pyfric.sweeps.varied import Span, full_field, varied

ENTRIES = ("scene", "t_end", "points", "n", "seed", "over", "options", "limits")
LIMITS = ("max_hours", "max_GB")
NAMES = {"from": "start", "to": "stop", "step": "step"}
RANGE = (*NAMES, "n", "scale")


def read_sweep(path: Path) -> dict[str, Any]:
    """Return the arguments of the `Sweep` that a file describes.

    Raises:
        SceneError: it cannot be read, or a value is refused.
    """
    document = parsed(path, "sweep")
    _check_keys("", document, ENTRIES)
    for key in ("scene", "t_end", "over"):
        if key not in document:
            raise SceneError(key, None, "", "an entry of a sweep", "missing")
    over, options, limits = (_table(document, key) for key in ("over", "options", "limits"))
    _check_keys("limits.", limits, LIMITS)
    scene = _scene(document["scene"], path.parent)
    free = {"gt": None, "ge": None, "le": None}  # what is out of range is refused at its point
    marks = {
        name: dataclasses.replace(mark, **free) if isinstance(mark, Quantity) else mark
        for name, mark in varied(scene).items()
    }

    def read(name: str, value: Any, field: str = "") -> Any:
        """Return a value of the file, in SI."""
        if name not in marks or value == "auto":
            return value  # what is unknown is refused where it is used
        with naming(field or name):
            return marks[name].check(value, Written(value, path.parent))

    return {
        "scene": scene,
        "t_end": read("t_end", document["t_end"]),
        "over": _over(over, scene, read),
        "options": {key: read(f"options.{key}", value) for key, value in options.items()},
        **{key: document[key] for key in ("points", "n", "seed") if key in document},
        **limits,
    }


def _check_keys(prefix: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key, value in table.items():
        if key not in known:
            raise unknown(prefix + key, value, key, known)


def _table(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise SceneError(key, table, "", f"a table [{key}]", "not a table")
    return table


def _scene(given: Any, folder: Path) -> Scene:
    if isinstance(given, str):
        return preset(given) if given in PRESETS else Scene.from_toml(folder / given)
    if isinstance(given, dict):
        return Scene.from_toml(tomli_w.dumps(given) + "\n", files=folder)
    raise SceneError("scene", given, "", "a preset, a scene file or a table [scene]")


def _over(
    table: Mapping[str, Any], scene: Scene, read: Callable[..., Any]
) -> dict[str, list[Any] | Span]:
    """Return what varies: lists of values, or ranges, by the full names of fields."""
    over: dict[str, list[Any] | Span] = {}
    for given, value in _flat(table).items():
        name = full_field(scene, given, value)
        field = f"over.{name}"
        if isinstance(value, list):
            over[name] = [read(name, entry, field) for entry in value]
        elif isinstance(value, dict) and {"from", "to"} <= set(value):
            _check_keys(f"{field}.", value, RANGE)
            ends = {key: read(name, value[key], f"{field}.{key}") for key in NAMES if key in value}
            try:
                over[name] = Span(**{NAMES.get(k, k): v for k, v in (value | ends).items()})
            except SceneError as error:
                entry = {"start": "from", "stop": "to"}.get(error.field, error.field)
                raise error.at(f"{field}.{entry}") from None
        else:
            allowed = "a list of values, or a range with from and to"
            raise SceneError(field, value, "", allowed)
    return over


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by their dotted names."""
    found = {}
    for key, value in table.items():
        inner = isinstance(value, dict) and "from" not in value
        found |= _flat(value, f"{prefix}{key}.") if inner else {prefix + key: value}
    return found
