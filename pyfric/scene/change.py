"""Names of the fields of a scene, and scenes with changed values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

from pyfric.scene.composed import Composed
from pyfric.scene.laws import FrictionLaw
from pyfric.scene.parts import PARTS, DistributedLoad, Interface, PrescribedLoad, Rod
from pyfric.scene.protocol import followed
from pyfric.values import (
    Annotation,
    Positive,
    SceneError,
    annotations,
    check_number,
    naming,
    unknown,
)

Parts = Composed | Mapping[str, Any]
S = TypeVar("S", bound=Composed)
PRESET_OF = {Rod: "setup1", DistributedLoad: "setup2", PrescribedLoad: "chain"}
"""Classes of top boundaries, and the name of a preset with each."""
PROTOCOLS = (
    ("driver.V", "driver.protocol"),
    ("top.F_N", "top.protocol"),
    ("top.T", "top.T_protocol"),
)
"""Fields that may change with time: names of the first value and of the breakpoints."""


def scene_fields(scene: Parts) -> dict[str, Annotation]:
    """Return the names of all fields of a scene, as in a scene file, and their annotations.

    A prescribed load also has the field F_N, which is the sum of its p.

    Examples are "name", "top", "driver.h", "interface.law.t_c", and "interface.mu_s.seed" if mu_s
    is a `Spread`.

    Args:
        scene: a scene, or its parts by name.
    """
    parts = scene if isinstance(scene, Mapping) else {name: getattr(scene, name) for name in PARTS}
    found: dict[str, Annotation] = {"name": Annotation(), "stop_when": Annotation()}
    for name, part in parts.items():
        found[name] = PARTS[name]
        if dataclasses.is_dataclass(type(part)):
            found |= _inside(part, name, annotations(type(part)))
        if isinstance(part, PrescribedLoad):
            found["top.F_N"] = Positive("N")
    return found


def _inside(owner: Any, prefix: str, marks: Mapping[str, Annotation]) -> dict[str, Annotation]:
    """Return the fields of a part and of its nested parts; `marks` annotate its own fields."""
    found: dict[str, Annotation] = {}
    for field, mark in marks.items():
        name, value = f"{prefix}.{field}", getattr(owner, field)
        found[name] = mark
        if dataclasses.is_dataclass(type(value)):
            found |= _inside(value, name, mark.of_drawn(type(value)) or annotations(type(value)))
    return found


def full_name(scene: Parts, name: str, value: Any = None, more: Iterable[str] = ()) -> str:
    """Return the name of a field with its part: "driver.h" for "h", "interface.law.B" for "law.B".

    Args:
        scene: a scene, or its parts by name.
        name: a dotted name, or its end. Of several matching names, the name with the fewest dots
            counts.
        value: the new value, for the error message.
        more: further names that are allowed.

    Raises:
        SceneError: no field, or more than one field, has this name.
    """
    name, known = str(name), dict.fromkeys([*scene_fields(scene), *more])
    found = [full for full in known if f".{full}".endswith(f".{name}")]
    depth = min((full.count(".") for full in found), default=0)
    found = [full for full in found if full.count(".") == depth]
    if len(found) == 1:
        return found[0]
    if found:
        raise SceneError(name, value, "", " or ".join(found), "is in several parts")
    ends = list(dict.fromkeys([*known, *(full.partition(".")[2] or full for full in known)]))
    for top, preset in PRESET_OF.items():  # a field of another class of tops
        end = name.removeprefix("top.")
        if end in {field.name for field in dataclasses.fields(top)}:
            reason = f"unknown here, a field of {top.__name__}"
            raise SceneError(name, value, "", f'a scene with one, such as "{preset}"', reason)
    raise unknown(name, value, name, ends)


def changed(scene: S, changes: Mapping[str, Any]) -> S:
    """Return the scene with changed values; see `Scene.replace`.

    A new F_N scales the p of a prescribed load.
    """
    parts = {name: changes.get(name, getattr(scene, name)) for name in PARTS}
    names = once((full_name(parts, name, value), value) for name, value in changes.items())
    known = scene_fields(parts) if any(name.count(".") > 1 for name in names) else {}
    for name, value in names.items():  # in a `Spread`, numbers have the unit of its field
        owner = known.get(name.rpartition(".")[0])
        if owner and owner.drawn:
            with naming(name):
                names[name] = known[name].check(value)
    law, interface = names.get("interface.law"), parts["interface"]
    new = isinstance(law, FrictionLaw) and law.ends() is not None
    if new or any(name.startswith("interface.law.") for name in names):
        known_ends = (
            interface.law.ends() or (None, None) if isinstance(interface, Interface) else ()
        )
        for mu, end in zip(("mu_s", "mu_k"), known_ends, strict=False):
            follows = new or (end is not None and getattr(interface, mu) == end)
            if follows and not any(name.startswith(f"interface.{mu}") for name in names):
                names[f"interface.{mu}"] = None  # the law defines this coefficient
    prescribed = isinstance(names.get("top", scene.top), PrescribedLoad)
    F_N = names.pop("top.F_N", None) if prescribed else None
    paths = {tuple(name.split(".")): value for name, value in names.items()}
    if F_N is not None:
        F_N = check_number("top.F_N", F_N, "N", gt=0.0)
        unchecked = Composed(**{name: getattr(scene, name) for name in annotations(Composed)})
        now = _with(unchecked, paths)
        paths["top", "p"] = np.multiply(now.top.p, F_N / now.F_N).tolist()
    return _with(scene, paths)


def once(changes: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return names and values as a dict.

    Raises:
        SceneError: a name is given twice.
    """
    found: dict[str, Any] = {}
    for name, value in changes:
        if name in found:
            raise SceneError(name, value, "", "one of both", "given twice")
        found[name] = value
    return found


def joined(changes: Mapping[str, Any] | None, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes by name and as keywords in one dict.

    Raises:
        SceneError: a name is given twice, or the changes are no mapping.
    """
    if not isinstance(changes, Mapping | None):
        raise SceneError("changes", changes, "", "a mapping from names of fields to values")
    return once([*(changes or {}).items(), *fields.items()])


def _with(owner: Any, changes: Mapping[tuple[str, ...], Any]) -> Any:
    """Return a part with changed values; all values are set before the part is checked."""
    new = {path[0]: value for path, value in changes.items() if len(path) == 1}
    for name in dict.fromkeys(path[0] for path in changes if len(path) > 1):
        inside = {path[1:]: v for path, v in changes.items() if path[0] == name and path[1:]}
        inner = new.get(name, getattr(owner, name))
        if not dataclasses.is_dataclass(inner):
            field, value = next(iter(inside.items()))
            reason = f"{name} is {inner!r}, which has no {'.'.join(field)}"
            raise SceneError(".".join((name, *field)), value, "", f"a field of {name}", reason)
        new[name] = _with(inner, inside)
    return dataclasses.replace(owner, **new)


def followed_by(before: S, after: S, t: float) -> tuple[S, list[str]] | None:
    """Return a scene that equals `before` up to t and `after` from t on, and texts on the changes.

    None is returned if the scenes differ in anything but driver speed, loads, `stop_when` and name.

    Args:
        before: the scene up to t.
        after: the scene from t on; times of its protocols count from t = 0, too.
        t: time, in s.
    """
    if type(before.top) is not type(after.top):
        return None
    fields, said = scene_fields(before), []
    others = {"name": after.name, "stop_when": after.stop_when}
    whole = dict(others)
    for first, corners in PROTOCOLS:
        if corners not in fields:
            continue
        ends = attrgetter(first, corners)
        whole[corners] = followed(*ends(before), *ends(after), t)
        others |= dict(zip((first, corners), ends(after), strict=True))
        if whole[corners] != ends(before)[1]:
            unit = fields[first].unit
            now, then = (value for at, value in whole[corners] if at == t)
            text = f"{first} = {then:.6g} {unit} instead of {now:.6g} {unit}"
            said.append(text if then != now else f"another {corners}")
    if changed(before, others) != after:
        return None
    return changed(before, whole), said
