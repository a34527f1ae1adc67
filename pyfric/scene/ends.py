"""Syntax of `stop_when`: conditions that end a run, as text "name" or "name = values".

It is the same in Python, on the command line, in scene files and in sweep files. The module
`pyfric.engines.stopping` defines when each condition holds.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

from pyfric.scene.checked import Annotation, Written
from pyfric.scene.errors import SceneError, unknown
from pyfric.scene.units import read_number


class Value(NamedTuple):
    """A value of a condition: its unit, limits and default."""

    unit: str
    limits: Mapping[str, float]
    default: float | None = None


COUNT = Value("", {"ge": 1.0}, 1.0)
TAKES: dict[str, tuple[Value, ...]] = {
    "arrested": (),
    "at_rest": (),
    "reached": (Value("m", {"ge": 0.0}),),
    "L_p": (Value("", {"gt": 0.0, "le": 1.0}),),
    "precursors": (COUNT,),
    "main_events": (COUNT,),
    "system_size": (COUNT,),
    "slow": (Value("m/s", {"gt": 0.0}), Value("s", {"ge": 0.0})),
}
"""Name of a condition -> its values."""


def _names() -> str:
    shown = []
    for name, takes in TAKES.items():
        values = ", ".join(f"1 {one.unit}".strip() for one in takes)
        shown.append(f"'{name} = {values}'" if values else repr(name))
    return ", ".join(shown)


@functools.lru_cache(maxsize=64)
def condition(text: str) -> tuple[str, tuple[float, ...]]:
    """Return the name of a condition and its values, in SI.

    Raises:
        SceneError: the condition is unknown, or a value is refused.
    """
    name, _, values = (part.strip() for part in text.partition("="))
    if name not in TAKES:
        refused = unknown("stop_when", text, name, TAKES)
        raise SceneError("stop_when", text, "", _names(), refused.reason)
    takes = TAKES[name]
    given = [one.strip() for one in values.split(",")] if values else []
    given += [one.default for one in takes[len(given) :] if one.default is not None]
    if len(given) != len(takes):
        reason = f"{name} takes {len(takes)} numbers"
        raise SceneError("stop_when", text, "", _names(), reason)
    pairs = zip(given, takes, strict=True)
    numbers = tuple(read_number("stop_when", value, one.unit, **one.limits) for value, one in pairs)
    if takes == (COUNT,) and numbers[0] % 1:
        raise SceneError("stop_when", text, "", "a whole number >= 1", "a number of events")
    return name, numbers


def checked_conditions(given: Any) -> tuple[str, ...]:
    """Return conditions as a tuple of texts.

    Raises:
        SceneError: a condition is unknown, or a value is refused.
    """
    texts = (given,) if isinstance(given, str) else given
    if not (isinstance(texts, list | tuple) and all(isinstance(one, str) for one in texts)):
        raise SceneError("stop_when", given, "", f"text, or a list of texts: {_names()}")
    for text in texts:
        condition(text)
    return tuple(texts)


class Conditions(Annotation):
    """Annotation of conditions: a text, or a list of texts."""

    @property
    def allowed(self) -> str:
        return f"a list of {_names()}"

    def check(self, value: Any, written: Written | None = None) -> tuple[str, ...]:
        return checked_conditions(value)
