"""A scene with other values: names of fields, with or without their part, and quantities."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pyfric.scene.units import SceneError, unknown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.scene.scene import Scene

__all__ = ["changed"]

PARTS = ("slider", "top", "driver", "interface", "walls")


def changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Return the scene with these values; see `Scene.replace`."""
    whole = {one.name for one in dataclasses.fields(scene)}
    new: dict[str, Any] = {name: value for name, value in changes.items() if name in whole}
    inside: dict[str, dict[str, Any]] = {}
    for name, value in changes.items():
        if name not in whole:
            part, field = _place(scene, name, value)
            inside.setdefault(part, {})[field] = value
    for part, values in inside.items():
        new[part] = dataclasses.replace(new.get(part, getattr(scene, part)), **values)
    return dataclasses.replace(scene, **new)


def _place(scene: Scene, name: str, value: Any) -> tuple[str, str]:
    """Return the part and the field that a name such as "h" or "driver.h" stands for."""
    fields = {p: [one.name for one in dataclasses.fields(getattr(scene, p))] for p in PARTS}
    dotted = {f"{part}.{one}": (part, one) for part in PARTS for one in fields[part]}
    found = [place for key, place in dotted.items() if name in (key, place[1])]
    if len(found) == 1:
        return found[0]
    if found:
        parts = " or ".join(f"{part}.{field}" for part, field in found)
        raise SceneError(name, value, "", parts, "is in several parts")
    known = dict.fromkeys([*dotted, *(field for _, field in dotted.values())])
    raise unknown(name, value, name, known)
