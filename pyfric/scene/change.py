"""A scene with other values: names of fields as in a scene file, with or without their part."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pyfric.scene.checked import quantities
from pyfric.scene.units import SceneError, unknown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.scene.checked import Quantity
    from pyfric.scene.scene import Scene

__all__ = ["changed", "full_name", "scene_fields"]

PARTS = ("slider", "top", "driver", "interface", "walls")


def scene_fields(scene: Scene) -> dict[str, Quantity | None]:
    """Return the names of all that a scene can have otherwise, as in a scene file.

    Such as "driver.h", "interface.mu_s.seed" where mu_s is a `Spread`, "interface.law.t_c"; "top"
    and "interface.law" are whole tables. Those of numbers come with their `Quantity`.
    """
    found: dict[str, Quantity | None] = {"name": None}
    for part in PARTS:
        found |= {part: None} | _inside(getattr(scene, part), part)
    return found


def _inside(owner: Any, prefix: str, unit: str = "") -> dict[str, Quantity | None]:
    """Return the fields of a part, and of what is in it; some of a `Spread` have the `unit`."""
    found: dict[str, Quantity | None] = {}
    marks = dict(quantities(type(owner)))
    for name in getattr(owner, "in_unit", ()):
        marks[name] = dataclasses.replace(marks[name], unit=unit)
    for field in dataclasses.fields(owner):
        name, value = f"{prefix}.{field.name}", getattr(owner, field.name)
        found[name] = mark = marks.get(field.name)
        if dataclasses.is_dataclass(value):
            found |= _inside(value, name, mark.unit if mark else "")
    return found


def changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Return the scene with these values; see `Scene.replace`."""
    names = {full_name(scene, name, value): value for name, value in changes.items()}
    return _replaced(scene, {tuple(name.split(".")): value for name, value in names.items()})


def _replaced(owner: Any, changes: Mapping[tuple[str, ...], Any]) -> Any:
    """Return a part with other values, all of which are set before they are checked."""
    new = {path[0]: value for path, value in changes.items() if len(path) == 1}
    for name in dict.fromkeys(path[0] for path in changes if len(path) > 1):
        inside = {path[1:]: v for path, v in changes.items() if path[0] == name and path[1:]}
        inner = new.get(name, getattr(owner, name))
        if not dataclasses.is_dataclass(inner):
            field, value = next(iter(inside.items()))
            reason = f"{name} is {inner!r}, which has no {'.'.join(field)}"
            raise SceneError(".".join((name, *field)), value, "", f"a field of {name}", reason)
        new[name] = _replaced(inner, inside)
    return dataclasses.replace(owner, **new)


def full_name(scene: Scene, name: str, value: Any = None) -> str:
    """Return the dotted name that a name such as "h", "driver.h" or "interface.law.B" stands for.

    Raises:
        SceneError: there is no such field, or it is in several parts.
    """
    known = scene_fields(scene)
    found = [name] if name in known else [key for key in known if _bare(key) == name]
    if len(found) == 1:
        return found[0]
    if found:
        raise SceneError(name, value, "", " or ".join(found), "is in several parts")
    raise unknown(name, value, name, [*known, *dict.fromkeys(filter(None, map(_bare, known)))])


def _bare(name: str) -> str:
    """Return the name of a field without its part; "" where it lies deeper."""
    field = name.partition(".")[2]
    return "" if "." in field else field
