"""`SceneError`, the error for all inputs: the value, its fault, and the allowed values."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from pyfric.values.words import line, meant, nearest

NO_UNIT = "missing unit"
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 100


class SceneError(ValueError):
    """An input is refused before a run starts.

    Attributes:
        field: dotted name of the input, such as ``"slider.l"``.
        value: the given value; ``None`` if missing.
        unit: SI unit of the input; ``""`` for a pure number or text.
        allowed: the allowed values, as text.
        reason: the fault of the value, as text (may be empty).
        others: further ``SceneError`` found at the same time.

    The message has one line for this problem and one for each of ``others``.
    """

    def __init__(
        self,
        field: str,
        value: Any,
        unit: str = "",
        allowed: str = "",
        reason: str = "",
        others: Iterable[SceneError] = (),
    ) -> None:
        self.field = field
        self.value = value
        self.unit = unit
        self.allowed = allowed
        self.reason = reason
        self.others = tuple(others)
        super().__init__(field, value, unit, allowed, reason, self.others)

    def __str__(self) -> str:
        name = self.field or "value"
        head = name if self.value is None else f"{name} = {show(self.value)}"
        bare = self.reason.startswith(NO_UNIT)
        if self.unit and isinstance(self.value, float) and not bare:
            head += f" {self.unit}"
        text = f"{head}: {self.reason or 'not allowed'}; allowed: {self.allowed}"
        return "\n".join([text, *map(str, self.others)])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def at(self, field: str, where: str = "") -> SceneError:
        """Return this error with another dotted name, and with a place before its reason."""
        reason = f"{where}: {self.reason or 'not allowed'}" if where else self.reason
        return type(self)(field, self.value, self.unit, self.allowed, reason, self.others)

    def flat(self) -> list[SceneError]:
        """Return this error and each of `others` as separate errors without `others`."""
        return [type(self)(*self.args[:-1]), *(e for other in self.others for e in other.flat())]

    @classmethod
    def joined(cls, errors: Iterable[SceneError]) -> SceneError:
        """Return one error that lists one or more `errors`, with the attributes of the first."""
        first, *others = [each for error in errors for each in error.flat()]
        return cls(*first.args[:-1], others)


@contextmanager
def naming(field: str = "", where: str = "") -> Iterator[None]:
    """Add a dotted name to a `SceneError` raised in the block, and a place before its reason."""
    try:
        yield
    except SceneError as error:
        raise error.at(field or error.field, where) from None


def numbered(what: str, check: Callable[[Any], Any], values: Iterable[Any]) -> tuple[Any, ...]:
    """Return checked values; an error gives the number of the refused value, from 1."""
    found = []
    for n, value in enumerate(values, 1):
        with naming(where=f"{what} {n}"):
            found.append(check(value))
    return tuple(found)


def show(value: Any) -> str:
    """Return a short text for any value, however large or deep it is."""
    try:
        return repr(float(value)) if isinstance(value, np.floating) else _SHORT.repr(value)
    except ValueError:  # integers with thousands of digits have no decimal text
        return f"<a very large {type(value).__name__}>"


def unknown(field: str, value: Any, key: str, known: Iterable[str]) -> SceneError:
    """Return the error for a `key` that is not in `known`; the error suggests a correct name."""
    known = list(known)
    if not meant(key, known) and (instead := line(key)):
        return SceneError(field, value, "", instead, "unknown here")
    guess = nearest(key, known)
    hint = f", did you mean {guess!r}?" if guess else ""
    return SceneError(field, value, "", f"one of {', '.join(known)}", f"unknown{hint}")
