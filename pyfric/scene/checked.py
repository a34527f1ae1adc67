"""Parts that check themselves: frozen dataclasses whose refusals are `SceneError`."""

import dataclasses
import functools
import typing
from collections.abc import Sequence
from typing import Any

import numpy as np
import pydantic
from pydantic_core import core_schema

from pyfric.scene.units import (
    SceneError,
    check_number,
    in_si,
    parse_quantity,
    range_text,
    unknown,
)

__all__ = ["NotNegative", "Positive", "Quantity", "Written", "names", "part", "quantities"]

MAX_LISTED = 10_000
"""Largest number of blocks whose forces can be listed one by one."""


@dataclasses.dataclass(frozen=True)
class Written:
    """A value as it stands in a scene file, where quantities are text with a unit."""

    value: Any


@dataclasses.dataclass(frozen=True)
class Quantity:
    """Annotation of a number: its SI unit and limits; also its validator."""

    unit: str = ""
    gt: float | None = None
    ge: float | None = None
    le: float | None = None
    optional: bool = False
    listed: bool = False  # or a sequence of numbers, which becomes a tuple
    drawn: type | None = None  # or an object of this class, a table in a scene file
    note: str = ""

    @property
    def _limits(self) -> dict[str, float | None]:
        return {"gt": self.gt, "ge": self.ge, "le": self.le}

    @property
    def allowed(self) -> str:
        return range_text(self.unit, **self._limits) + self.note

    def check(self, value: Any) -> float | tuple[float, ...] | None:
        if value is None and self.optional:
            return None
        written = isinstance(value, Written)
        if written:
            value = value.value
        if self.drawn is not None and isinstance(value, self.drawn):
            return value
        if self.drawn is not None and written and isinstance(value, dict):
            return self._drawn(value)
        if not written:
            value = in_si("", value, self.unit, allowed=self.allowed)
        several = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim)
        if self.listed and several:
            return self._each([Written(one) for one in value] if written else value)
        if written and self.unit:
            value = parse_quantity("", value, self.unit, allowed=self.allowed)
        try:
            return check_number("", value, self.unit, **self._limits)
        except SceneError as error:
            allowed = error.allowed + self.note
            raise SceneError("", error.value, self.unit, allowed, error.reason) from None

    def _drawn(self, table: dict[str, Any]) -> Any:
        """Return what a table of a scene file describes; some of its numbers have this unit."""
        marks = quantities(self.drawn)
        values = dict(table)
        for key in set(table) & set(marks):
            here = key in self.drawn.in_unit and self.unit
            one = dataclasses.replace(marks[key], unit=self.unit) if here else marks[key]
            try:
                values[key] = one.check(Written(table[key]))
            except SceneError as error:
                raise error.at(key) from None
        return self.drawn(**values)

    def _each(self, values: Sequence[Any]) -> tuple[float, ...]:
        if len(values) > MAX_LISTED:
            raise SceneError("", values, "", f"at most {MAX_LISTED} numbers", "too many")
        found, one = [], dataclasses.replace(self, listed=False, drawn=None, note="")
        for n, value in enumerate(values, 1):
            try:
                found.append(one.check(value))
            except SceneError as error:
                reason = f"block {n}: {error.reason}"
                raise SceneError("", error.value, self.unit, error.allowed, reason) from None
        return tuple(found)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)


@functools.cache
def quantities(cls: type) -> dict[str, Quantity]:
    """Return the `Quantity` of each numeric field of a part."""
    return {
        name: mark
        for name, hint in typing.get_type_hints(cls, include_extras=True).items()
        for mark in getattr(hint, "__metadata__", ())
        if isinstance(mark, Quantity)
    }


def names(cls: type) -> list[str]:
    return [field.name for field in dataclasses.fields(cls)]


def translated(cls: type, error: pydantic.ValidationError) -> SceneError:
    """Return the `SceneError` that says what a pydantic error says."""
    prefix = f"{cls._section}." if cls._section else ""
    marks, found = quantities(cls), {}
    for line in error.errors(include_url=False):
        key = str(line["loc"][0]) if line["loc"] else ""
        cause = line.get("ctx", {}).get("error")
        if isinstance(cause, SceneError):
            one = cause.at(prefix + key) if key else cause
        elif line["type"] == "unexpected_keyword_argument":
            one = unknown(prefix + key, line["input"], key, names(cls))
        else:
            mark = marks.get(key, Quantity())
            allowed = mark.allowed if key in marks else cls._allowed.get(key, "keyword arguments")
            missing = line["type"] == "missing"
            value, reason = (None, "missing") if missing else (line["input"], line["msg"])
            one = SceneError(prefix + key, value, mark.unit, allowed, reason)
        found.setdefault(key, one)
    return SceneError.joined(found.values())


@typing.dataclass_transform(frozen_default=True, kw_only_default=True)
def part(cls: type) -> type:
    """Make a frozen keyword-only pydantic dataclass whose refusals are `SceneError`."""
    config = pydantic.ConfigDict(extra="forbid", strict=True)
    cls = pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=config)(cls)
    checked = cls.__init__

    @functools.wraps(checked)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            checked(self, *args, **kwargs)
        except pydantic.ValidationError as error:
            raise translated(cls, error) from None

    cls.__init__ = __init__
    return cls


Positive = functools.partial(Quantity, gt=0.0)
NotNegative = functools.partial(Quantity, ge=0.0)
