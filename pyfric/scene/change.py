"""Names of the fields of a scene, and the scene with other values."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pyfric.scene.errors import SceneError, unknown
from pyfric.scene.parts import DistributedLoad, PrescribedLoad, Rod

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene

__all__ = ["PARTS", "changed", "field_names", "full_name", "spoken"]

PARTS = ("slider", "top", "driver", "interface", "walls")


def field_names(parts: Any) -> list[str]:
    """Return the dotted names of all fields of a scene, those of its parts before those inside.

    Args:
        parts: a scene, or a mapping of `PARTS`.
    """
    level = parts if isinstance(parts, Mapping) else {p: getattr(parts, p) for p in PARTS}
    names: list[str] = []
    while level:  # parts, then what they hold, such as a law or a `Spread`
        level = {
            f"{name}.{field.name}": getattr(part, field.name)
            for name, part in level.items()
            if dataclasses.is_dataclass(part) and not isinstance(part, type)
            for field in dataclasses.fields(part)
        }
        names += level
    return names


def full_name(parts: Any, name: str, value: Any = None) -> str:
    """Return the dotted name that the end of one, such as "h" or "law.B", stands for.

    Args:
        parts: see `field_names`.
        name: a dotted name, or its end; a field of a part goes before what lies inside fields.
        value: what it is to become, for the error.

    Raises:
        SceneError: no field has this name, or several have.
    """
    names = field_names(parts)
    found = [full for full in names if f".{full}".endswith(f".{name}")]
    found = [full for full in found if full.count(".") == found[0].count(".")]
    if len(found) == 1:
        return found[0]
    if found:
        raise SceneError(name, value, "", " or ".join(found), "is in several parts")
    ends = dict.fromkeys([*names, *(full.partition(".")[2] for full in names)])
    for top in (Rod, DistributedLoad, PrescribedLoad):  # a word that is not spelled wrong
        if name.removeprefix("top.") in {field.name for field in dataclasses.fields(top)}:
            reason = f"unknown here, a field of {top.__name__}"
            raise SceneError(name, value, "", f"one of {', '.join(ends)}", reason)
    raise unknown(name, value, name, ends)


def changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Return the scene with these values; see `Scene.replace`."""
    whole = {field.name for field in dataclasses.fields(scene)}
    parts = {part: changes.get(part, getattr(scene, part)) for part in PARTS}
    inside: dict[str, Any] = {}
    for name, value in changes.items():
        if name not in whole:
            *path, last = full_name(parts, name, value).split(".")
            place = inside
            for step in path:
                place = place.setdefault(step, _Inside())
                if not isinstance(place, _Inside):
                    raise SceneError(name, value, "", "one of both", "given as a whole, too")
            place[last] = value
    for part, values in inside.items():
        parts[part] = _with(parts[part], values)
    given = {name: value for name, value in changes.items() if name in whole}
    return dataclasses.replace(scene, **given | parts)


def spoken(text: str) -> Any:
    """Return a value from a line of text, such as that of `--set`.

    It is what TOML makes of it (a number in SI, a list, a table such as {mean = 0.7, std = 0.02}),
    or the text itself, such as "7.5 mm" or "left".
    """
    try:
        return tomllib.loads(f"value = {text}").get("value", text)
    except (ValueError, RecursionError):
        return text


class _Inside(dict[str, Any]):
    """New values of fields of a part."""


def _with(part: Any, values: Mapping[str, Any]) -> Any:
    return dataclasses.replace(
        part,
        **{
            name: _with(getattr(part, name), value) if isinstance(value, _Inside) else value
            for name, value in values.items()
        },
    )
