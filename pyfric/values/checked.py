"""Base of the parts of a scene: frozen dataclasses that check their values, with `SceneError`.

The annotation of a field states its allowed values: a `Quantity`, a part (`OneOf`), and so on.
Values come from Python or from a scene file (`Written`). In a file, quantities are text with a
unit, and parts are tables.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import typing
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyfric.values.errors import SceneError, naming, numbered, show, unknown
from pyfric.values.units import (
    as_list,
    check_number,
    check_whole,
    in_si,
    range_text,
)

FOR_EVER = (math.inf, "inf s")
"""Values that mean "without end" or "never", in Python and in scene files."""
MAX_LISTED = 10_000
"""Largest number of values in a list."""


@dataclasses.dataclass(frozen=True)
class Written:
    """A value from a scene file, which may name files in `folder`; None forbids files."""

    value: Any
    folder: Path | None = None


class Annotation:
    """The allowed values of a field; `allowed` is a text that describes these values."""

    unit: str = ""
    allowed: str = ""
    drawn: tuple[type, ...] = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.allowed!r})" if self.allowed else type(self).__name__

    def check(self, value: Any, written: Written | None = None) -> Any:
        """Return the checked value, from Python or from an entry `written` in a scene file.

        Raises:
            SceneError: the value is refused; the error is raised without the name of the field.
        """
        return value

    def written(self, value: Any) -> Any:
        """Return a value in the form of a scene file."""
        return value

    def of_drawn(self, cls: type) -> Mapping[str, Annotation]:
        """Return the annotations of a class of `drawn`, with the unit of this annotation."""
        return in_unit(cls, self.unit) if cls in self.drawn else {}


@dataclasses.dataclass(frozen=True)
class Quantity(Annotation):
    """A number: its SI unit and limits."""

    unit: str = ""
    gt: float | None = None
    ge: float | None = None
    le: float | None = None
    optional: bool = False
    listed: bool = False  # a sequence of numbers is allowed, and becomes a tuple
    each: str = "number"  # word for an entry of the sequence
    drawn: tuple[type, ...] = ()  # classes of allowed objects, which are tables in a scene file
    note: str = ""
    endless: bool = False  # inf is allowed

    @property
    def _limits(self) -> dict[str, float | None]:
        return {"gt": self.gt, "ge": self.ge, "le": self.le}

    @property
    def allowed(self) -> str:
        return range_text(self.unit, **self._limits) + self.note

    def check(self, value: Any, written: Written | None = None) -> Any:
        value = in_si("", value, self.unit, allowed=self.allowed)
        if value is None and self.optional:
            return None
        if isinstance(value, self.drawn):
            return value
        if self.drawn and isinstance(value, Mapping):
            return self._drawn(value, written)
        value = as_list(value)
        if self.listed and isinstance(value, list | tuple):
            if len(value) > MAX_LISTED:
                raise SceneError("", value, "", f"at most {MAX_LISTED} numbers", "too many")
            number = Quantity(self.unit, **self._limits, endless=self.endless)
            return numbered(self.each, lambda entry: number.check(entry, written), value)
        if self.endless and isinstance(value, float | str) and value in FOR_EVER:
            return math.inf
        return check_number("", value, self.unit, **self._limits, note=self.note)

    def _drawn(self, values: Mapping[str, Any], written: Written | None) -> Any:
        """Return the object for a table, of the class in `drawn` that has the fields of the table.

        If the table names a file, its numbers are read.
        """
        if values.keys() == {"file"} and isinstance(values["file"], str):
            folder = written.folder if written else Path()
            if folder is None:
                raise SceneError(
                    "", values["file"], "", "numbers: this text names no files", "file"
                )
            return self.drawn[-1].read(folder / values["file"], self.unit)
        cls = next((c for c in self.drawn if values.keys() <= annotations(c).keys()), self.drawn[0])
        found = dict(values)
        for name, mark in self.of_drawn(cls).items():
            if name in values:
                with naming(where=name):
                    found[name] = mark.check(found[name], written)
        try:
            return cls(**found)
        except SceneError as error:
            raise error.at("", error.field.rpartition(".")[2]) from None

    def written(self, value: Any) -> Any:
        if isinstance(value, self.drawn):
            return table(value, self.of_drawn(type(value)))
        if isinstance(value, tuple):
            return [self.written(v) for v in value]
        return f"{value!r} {self.unit}" if self.unit else value


@dataclasses.dataclass(frozen=True)
class Switches(Annotation):
    """True or False, or a sequence of these values, one for each block, which becomes a tuple."""

    allowed: str = "True or False, or a list of N_x of them"

    def check(self, value: Any, written: Written | None = None) -> bool | tuple[bool, ...] | None:
        value = as_list(value)
        if value is None or isinstance(value, bool):
            return value
        if not isinstance(value, list | tuple):
            raise SceneError("", value, "", self.allowed, f"not bool, but {type(value).__name__}")

        def one(entry: Any) -> bool:
            if isinstance(entry, bool):
                return entry
            reason = f"not bool, but {type(entry).__name__}"
            raise SceneError("", entry, "", "True or False", reason)

        return numbered("block", one, value)

    def written(self, value: Any) -> Any:
        return list(value) if isinstance(value, tuple) else value


@dataclasses.dataclass(frozen=True)
class Whole(Annotation):
    """An integer from a smallest to a largest value."""

    largest: int
    least: int = 0

    def check(self, value: Any, written: Written | None = None) -> int:
        return check_whole("", value, self.least, self.largest)


@dataclasses.dataclass(frozen=True)
class Words(Annotation):
    """One of the words of a `Literal`."""

    words: tuple[str, ...]
    optional: bool = False

    @property
    def allowed(self) -> str:
        return " or ".join(map(repr, self.words))

    def check(self, value: Any, written: Written | None = None) -> str | None:
        if (isinstance(value, str) and value in self.words) or (self.optional and value is None):
            return value
        reason = "missing" if value is None else "not text"
        if isinstance(value, str):
            reason = unknown("", value, value, self.words).reason
        raise SceneError("", value, "", self.allowed, reason)


@dataclasses.dataclass(frozen=True)
class Name(Annotation):
    """A line of text without control characters, such as characters that set its direction."""

    longest: int

    @property
    def allowed(self) -> str:
        return f"text of at most {self.longest} characters"

    def check(self, value: Any, written: Written | None = None) -> str:
        if not isinstance(value, str):
            raise SceneError("", value, "", self.allowed, f"not text, but {type(value).__name__}")
        if len(value) > self.longest:
            raise SceneError("", value, "", self.allowed, "too long")
        for n, sign in enumerate(value, 1):
            if unicodedata.category(sign) in UNSEEN and sign not in JOINERS:
                reason = f"character {n} (U+{ord(sign):04X}) is no letter, mark or space"
                raise SceneError("", ascii(value), "", self.allowed, reason)
        return value


UNSEEN, JOINERS = ("Cc", "Cf", "Cs", "Zl", "Zp"), "\u200c\u200d"
"""Unicode categories that are refused in a line of text, and two characters that are allowed."""

Positive = functools.partial(Quantity, gt=0.0)
NotNegative = functools.partial(Quantity, ge=0.0)


class OneOf(Annotation):
    """A part of one of several classes. In a scene file the entry `kind` selects the class.

    If a class has a method `from_file`, this method reads the table of the part.

    Args:
        classes: the classes, or a common base class.
        kinds: mapping of kinds to classes; None means the attributes `kind` of the classes.
        allowed: description of the values that are allowed in Python.
    """

    def __init__(
        self, *classes: type, kinds: Mapping[str, type] | None = None, allowed: str = ""
    ) -> None:
        self.classes, self.section = classes, classes[0]._section
        self.kinds = {c.kind: c for c in classes if hasattr(c, "kind")} if kinds is None else kinds
        self.allowed = allowed or " or ".join(c.__name__ for c in classes)

    def check(self, value: Any, written: Written | None = None) -> Any:
        if isinstance(value, self.classes):
            return value
        if isinstance(value, str) and self.kinds:
            return self._named(value)
        if not written:
            reason = f"{type(value).__name__} is something else"
            fields = isinstance(value, Mapping) and ", ".join(f"{name}=..." for name in value)
            by_name = f", or its fields by their names, {fields}" if fields else ""
            raise SceneError("", value, "", self.allowed + by_name, reason)
        if not isinstance(value, dict):
            reason = "missing" if value is None else "not a table"
            raise SceneError(self.section, value, "", f"a table [{self.section}]", reason)
        entries = dict(value)
        cls = self.classes[0]
        if self.kinds:
            with naming(f"{self.section}.kind"):
                cls = self.kinds[Words(tuple(self.kinds)).check(entries.pop("kind", None))]
        make = getattr(cls, "from_file", functools.partial(from_entries, cls))
        return make(entries, written.folder)

    def _named(self, kind: str) -> Any:
        """Return the part of a kind, without parameters."""
        if kind not in self.kinds:
            raise unknown("", kind, kind, self.kinds)
        cls = self.kinds[kind]
        try:
            return cls()
        except SceneError as error:
            missing = ", ".join(f"{each.field.rpartition('.')[2]}=..." for each in error.flat())
            allowed = f"{cls.__name__}({missing}), or a table with its kind in a file"
            raise SceneError("", kind, "", allowed, "it has parameters") from None

    def written(self, value: Any) -> Any:
        return table(value)


HINTS: dict[type, dict[str, Any]] = {}
"""Types of the fields of each part, with their annotations."""


@functools.cache
def annotations(cls: type) -> dict[str, Annotation]:
    """Return the annotations of the fields of a part; a `Literal` becomes `Words`."""
    found = {}
    for name, hint in HINTS[cls].items():
        inside = typing.get_args(hint)
        for mark in (hint, *inside):
            if isinstance(mark, Annotation):
                found[name] = mark
            elif typing.get_origin(mark) is typing.Literal:
                found[name] = Words(typing.get_args(mark), type(None) in inside)
    return found


@functools.cache
def in_unit(cls: type, unit: str) -> dict[str, Annotation]:
    """Return the annotations of the fields of a part; fields in `cls.in_unit` get a unit."""
    return {
        name: dataclasses.replace(mark, unit=unit) if name in cls.in_unit else mark
        for name, mark in annotations(cls).items()
    }


def from_entries(cls: type, entries: Mapping[str, Any], folder: Path | None, **more: Any) -> Any:
    """Return the part for a table of a scene file; files that the table names are in `folder`.

    A method `from_file` of a part calls this function after it has read its own entries.
    """
    marks = annotations(cls)
    values = {n: Written(v, folder) if n in marks else v for n, v in entries.items()}
    return cls(**values, **more)


def table(part: Any, marks: Mapping[str, Annotation] | None = None) -> dict[str, Any]:
    """Return a part as a table of a scene file, without empty values and default parts."""
    marks = annotations(type(part)) if marks is None else marks
    found = {"kind": part.kind} if hasattr(part, "kind") else {}
    for field in dataclasses.fields(part):
        name, value = field.name, getattr(part, field.name)
        default = dataclasses.is_dataclass(value) and value == field.default
        if not (default or value in (None, (), "")):
            found[name] = marks[name].written(value)
    return found


@typing.dataclass_transform(frozen_default=True, kw_only_default=True)
def part(cls: type) -> type:
    """Turn a class into a frozen dataclass with keyword arguments, which checks its values."""
    cls = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    plain = cls.__init__
    _move_hints(cls, plain)

    @functools.wraps(plain)
    def __init__(self: Any, /, *args: Any, **given: Any) -> None:
        plain(self, **_checked(cls, args, given))

    def __setattr__(self: Any, name: str, value: Any) -> None:
        field = f"{cls._section}.{name}".lstrip(".")
        instead = f'scene.replace({{"{field}": {show(value)}}}) returns a scene with this value'
        raise dataclasses.FrozenInstanceError(f"{name} of a {cls.__name__} stays; {instead}")

    cls.__init__, cls.__setattr__ = __init__, __setattr__
    return cls


def _move_hints(cls: type, init: Any) -> None:
    """Move the annotations of fields to `HINTS`, so that the help of a part shows plain types."""
    own = typing.get_type_hints(cls, include_extras=True)
    of_bases = [HINTS[base] for base in reversed(cls.__mro__) if base in HINTS]
    inherited = {name: hint for hints in of_bases for name, hint in hints.items()}
    HINTS[cls] = own | {n: hint for n, hint in inherited.items() if n not in cls.__annotations__}
    plain = typing.get_type_hints(cls)
    cls.__annotations__ = {name: plain[name] for name in cls.__annotations__}
    init.__annotations__ = {name: plain.get(name, t) for name, t in init.__annotations__.items()}
    for field in dataclasses.fields(cls):
        field.type = plain[field.name]


def _checked(cls: type, args: tuple[Any, ...], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the checked values of the fields of a part; the error lists all faults."""
    prefix, marks = f"{cls._section}." if cls._section else "", annotations(cls)
    fields = {field.name: field.default for field in dataclasses.fields(cls)}
    positions = [name for name in getattr(cls, "_positions", ()) if name not in given]
    given = dict(zip(positions, args, strict=False)) | dict(given)
    named = f"keyword arguments, as in {cls.__name__}({', '.join(f'{n}=...' for n in fields)})"
    if len(args) > len(positions):
        allowed = getattr(cls, "_example", named)
        raise SceneError(cls.__name__, args[len(positions)], "", allowed, "not understood")
    wrong: list[SceneError] = []
    strange, elsewhere = [n for n in given if n not in fields], getattr(cls, "_elsewhere", {})
    wrong += [unknown(prefix + n, given[n], n, fields) for n in strange if n not in elsewhere]
    known = [SceneError(prefix + n, given[n], "", elsewhere[n]) for n in strange if n in elsewhere]
    if known:
        raise known[0]
    found = {}
    for name, default in fields.items():
        mark = marks.get(name, Annotation())
        if name not in given and default is dataclasses.MISSING:
            wrong.append(SceneError(prefix + name, None, mark.unit, mark.allowed, "missing"))
        elif name in given:
            value = given[name]
            inside, written = (value.value, value) if isinstance(value, Written) else (value, None)
            try:
                found[name] = mark.check(inside, written)
            except SceneError as error:
                error = error if error.field else error.at(prefix + name)
                others = (n for n, m in marks.items() if value in getattr(m, "words", ()))
                if isinstance(value, str) and (other := next(others, "")):
                    allowed = f"{error.allowed}; {other}={value!r} exists"
                    error = SceneError(error.field, value, "", allowed, error.reason)
                wrong.append(error)
    if wrong:
        raise SceneError.joined(wrong)
    return found
