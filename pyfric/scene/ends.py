"""Syntax of `stop_when`: conditions that end a run, as text "name" or "name = values".

The syntax is the same in Python, on the command line, in scene files and in sweep files. The module
`pyfric.engines.stopping` defines when each condition holds.
"""

from __future__ import annotations

from typing import Any

from pyfric.values import (
    Annotation,
    NotNegative,
    Positive,
    Quantity,
    SceneError,
    Written,
    naming,
    spoken,
    unknown,
)

COUNT = Quantity("", ge=1.0)
TAKES: dict[str, tuple[Quantity, ...]] = {
    "arrested": (),
    "at_rest": (),
    "reached": (NotNegative("m"),),
    "L_p": (Quantity("", gt=0.0, le=1.0),),
    "precursors": (COUNT,),
    "main_events": (COUNT,),
    "system_size": (COUNT,),
    "slow": (Positive("m/s"), NotNegative("s")),
}
"""Names of conditions, and their values. If the number of events is left out, it is 1."""


def _names() -> str:
    shown = []
    for name, takes in TAKES.items():
        values = ", ".join(f"1 {number.unit}".strip() for number in takes)
        shown.append(f"'{name} = {values}'" if values else repr(name))
    return ", ".join(shown)


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
    given = [text.strip() for text in values.split(",")] if values else []
    given = given or ["1"] * takes.count(COUNT)
    if len(given) != len(takes):
        reason = f"{name} takes {len(takes)} numbers"
        raise SceneError("stop_when", text, "", _names(), reason)
    with naming("stop_when"):
        pairs = zip(given, takes, strict=True)
        numbers = tuple(mark.check(spoken(value)) for value, mark in pairs)
    if takes == (COUNT,) and numbers[0] % 1:
        raise SceneError("stop_when", text, "", "a whole number >= 1", "a number of events")
    return name, numbers


class Conditions(Annotation):
    """Annotation of conditions: a text, or a list of texts."""

    def check(self, value: Any, written: Written | None = None) -> tuple[str, ...]:
        texts = (value,) if isinstance(value, str) else value
        if not (isinstance(texts, list | tuple) and all(isinstance(text, str) for text in texts)):
            raise SceneError("stop_when", value, "", f"text, or a list of texts: {_names()}")
        for text in texts:
            condition(text)
        return tuple(texts)
