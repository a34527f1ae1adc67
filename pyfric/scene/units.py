"""Numbers with units: the checks and the parser behind every input, and their one error."""

import difflib
import math
import pickle
import re
import reprlib
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from numbers import Real
from typing import Any

import numpy as np

SMALLEST = 1e-30
"""Smallest non-zero magnitude accepted (SI); smaller values would let products underflow."""
LARGEST = 1e30
"""Largest magnitude accepted (SI); larger values would let products overflow."""

EXAMPLES = {
    "m": "5 mm",
    "kg": "75.6 g",
    "N": "3500 N",
    "N/m": "13.5 MN/m",
    "m/s": "0.7875 mm/s",
    "N s/m": "1.5 N s/m",
    "s": "0.2 us",
}
"""SI unit -> a quantity to show in messages."""

NO_UNIT = "missing unit"
LIKE = 0.6
"""Words at least so alike, on a scale up to 1, may be meant for one another."""

_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|nan|inf(?:inity)?)(?![\d.]))"
    r"\s*(?P<unit>.*?)\s*",
    re.IGNORECASE | re.ASCII | re.DOTALL,
)
# One-digit exponents only, no parentheses and no other numbers: nothing here can take long.
_FACTOR = r"[A-Za-zµμ%]+(?:(?:\^|\*\*)-?[1-9]|[²³])?"
_UNIT = re.compile(rf"{_FACTOR}(?:(?:\s*[*/·]\s*|\s+){_FACTOR})*")
_LONGEST = 80  # characters in a quantity

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 100


class _Shown(str):
    """The text of a value that cannot be pickled."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


class SceneError(ValueError):
    """An input is refused before anything starts.

    Attributes:
        field: dotted name of the input, such as ``"slider.l"``.
        value: what was given; ``None`` where it is missing.
        unit: SI unit of the input; ``""`` where it has none.
        allowed: what would be accepted, as text.
        reason: what is wrong with the value, as text (may be empty).
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
        others: Iterable["SceneError"] = (),
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
        return "\n".join([text, *(str(other) for other in self.others)])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        field, value, *rest = self.args
        try:
            pickle.dumps(value)
        except Exception:  # whatever a user passed, the error reaches the other process
            value = _Shown(show(value))
        return type(self), (field, value, *rest), vars(self) | {"value": value}

    def at(self, field: str) -> "SceneError":
        """Return the same error under another dotted name."""
        return SceneError(field, self.value, self.unit, self.allowed, self.reason, self.others)

    def flat(self) -> list["SceneError"]:
        """Return this problem and all others, each as an error of its own."""
        first = SceneError(self.field, self.value, self.unit, self.allowed, self.reason)
        return [first, *(one for other in self.others for one in other.flat())]

    @classmethod
    def joined(cls, errors: Iterable["SceneError"]) -> "SceneError":
        """Return one error that lists all `errors` (at least one); attributes from the first."""
        first, *rest = [one for error in errors for one in error.flat()]
        return cls(first.field, first.value, first.unit, first.allowed, first.reason, rest)


def show(value: Any) -> str:
    """Return a short text for any value, however large or deep it is."""
    try:
        return repr(float(value)) if isinstance(value, np.floating) else _SHORT.repr(value)
    except ValueError:  # integers with thousands of digits have no decimal text
        return f"<a very large {type(value).__name__}>"


def range_text(
    unit: str,
    *,
    gt: float | None = None,
    ge: float | None = None,
    le: float | None = None,
    lt: float | None = None,
) -> str:
    """Return the allowed range in words, such as ``"a finite number > 0.0 m"``."""
    limits = ((">", gt), (">=", ge), ("<=", le), ("<", lt))
    ranges = [f"{sign} {limit:.12g}" for sign, limit in limits if limit is not None]
    return " ".join(["a finite number", " and ".join(ranges), unit]).replace("  ", " ").strip()


def check_number(
    field: str,
    value: Any,
    unit: str,
    *,
    gt: float | None = None,
    ge: float | None = None,
    le: float | None = None,
    lt: float | None = None,
) -> float:
    """Return `value` as a float if it is a finite real number inside the given limits.

    Args:
        field: dotted name used in the error.
        value: a Python or NumPy real scalar, in SI; booleans, strings and arrays are refused.
        unit: SI unit used in the error, ``""`` for a pure number.
        gt, ge, le, lt: limits (>, >=, <=, <), in the same unit.

    Returns:
        The same number as a Python float; -0.0 becomes 0.0.

    Raises:
        SceneError: wrong type, NaN, infinite, outside the limits, or a non-zero magnitude
            outside `SMALLEST` … `LARGEST`.
    """
    allowed = range_text(unit, gt=gt, ge=ge, le=le, lt=lt)

    def refused(reason: str, shown: Any = value) -> SceneError:
        return SceneError(field, shown, unit, allowed, reason)

    if isinstance(value, bool) or not isinstance(value, Real):
        raise refused(f"a number is needed, not {type(value).__name__}")
    try:
        number = float(value) + 0.0
    except (OverflowError, ValueError):
        raise refused("too large for a floating-point number") from None
    if not math.isfinite(number):
        raise refused("not a finite number", number)
    below = (gt is not None and not number > gt) or (ge is not None and not number >= ge)
    above = (le is not None and not number <= le) or (lt is not None and not number < lt)
    if below or above:
        raise refused("too small" if below else "too large", number)
    if number and not SMALLEST <= abs(number) <= LARGEST:
        size = f"of magnitude {SMALLEST:g} to {LARGEST:g}"
        raise SceneError(field, number, unit, f"{allowed}, {size}", "out of range")
    return number


def check_quantity(field: str, value: Any, unit: str, **limits: float | None) -> float:
    """Return a number in SI, text with a unit, or a quantity of a library of units, as `in_si`.

    Args:
        field, unit, limits: see `check_number`.

    Raises:
        SceneError: see `check_number` and `in_si`.
    """
    value = in_si(field, value, unit, allowed=range_text(unit, **limits))
    return check_number(field, value, unit, **limits)


def in_si(field: str, value: Any, unit: str, *, allowed: str = "") -> Any:
    """Return text with a unit, or a quantity of pint or the like, in SI; all else as it is.

    Raises:
        SceneError: it has no unit, or one of another dimension.
    """
    if isinstance(value, str) and unit:
        return parse_quantity(field, value, unit, allowed=allowed)
    if not (hasattr(value, "to_base_units") and hasattr(value, "magnitude")):
        return value
    try:
        return value.to(unit or "dimensionless").magnitude
    except Exception as error:  # each library has its own
        allowed = allowed or f"a quantity in {unit or '1'}"
        raise SceneError(field, str(value), unit, allowed, str(error)) from None


def parse_quantity(field: str, value: Any, unit: str, *, allowed: str = "") -> float:
    """Return the SI number of a quantity written as text, such as ``"5 mm"``.

    The number is rounded once: ``"2.5 mm"`` gives the same float as ``2.5e-3``.
    NaN, infinities and ranges are left to `check_number`.

    Args:
        field: dotted name used in the error.
        value: the text ``"<number> <unit>"``.
        unit: SI unit to convert to.
        allowed: the allowed range, used in the error.

    Raises:
        SceneError: not text, no number, no unit, an unknown unit or one of another dimension.
    """
    example = EXAMPLES.get(unit, f"1 {unit}")
    allowed = f'{allowed or range_text(unit)}, written with a unit such as "{example}"'

    def refused(reason: str) -> SceneError:
        return SceneError(field, value, unit, allowed, reason)

    if isinstance(value, (int, float)) and not isinstance(value, bool):
        raise refused(f'{NO_UNIT}: write e.g. "{example}"')
    if not isinstance(value, str):
        raise refused(f"a quantity in quotes is needed, not {type(value).__name__}")
    match = _QUANTITY.fullmatch(value) if len(value) <= _LONGEST else None
    if match is None:
        raise refused("not a number followed by a unit")
    number = float(match["number"])
    name = match["unit"]
    if not name:
        raise refused(f'{NO_UNIT}: write e.g. "{example}"')
    if name == unit:
        return number
    factor = _factor(name, unit)
    if isinstance(factor, str):
        raise refused(factor)
    if number == 0 or not math.isfinite(number):
        return number
    try:
        return float(Fraction(match["number"]) * factor)
    except OverflowError:
        return math.copysign(math.inf, number)


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # slow to import, and needed only for units other than the SI ones

    return pint.UnitRegistry(non_int_type=Fraction)


@lru_cache(maxsize=256)
def _factor(name: str, unit: str) -> Fraction | str:
    """Return the exact number of SI `unit` in one `name`, or what is wrong with `name`."""
    if not _UNIT.fullmatch(name):
        return f"{show(name)} is not a unit"

    def spelled(text: str) -> str:
        text = text.replace("²", "**2").replace("³", "**3").replace("^", "**")
        text = re.sub(r"\s*([/·]|(?<!\*)\*(?!\*))\s*", r"\1", text).replace("·", "*")
        return re.sub(r"\s+", "*", text)

    registry = _registry()
    try:
        given, wanted = registry.parse_units(spelled(name)), registry.parse_units(spelled(unit))
        same = given.dimensionality == wanted.dimensionality
    except Exception:  # pint raises many types for a unit it cannot read
        return f"unknown unit {show(name)}"
    if not same:
        return f"wrong unit: {show(name)} does not convert to {unit}"
    try:
        factor = Fraction(registry.convert(Fraction(1), given, wanted))
    except Exception:  # offset and logarithmic units in a product
        return f"unit {show(name)} does not convert to {unit} by a factor"
    return factor if factor > 0 else f"unit {show(name)} has no positive factor"


def nearest(key: str, known: Iterable[str]) -> str:
    """Return the entry of `known` that is spelled most like `key`, ``""`` if none is alike."""
    folded = key[:64].casefold()

    def likeness(name: str) -> tuple[float, float]:
        other = name.casefold()
        ratio = difflib.SequenceMatcher(None, folded, other).ratio()
        if folded and (folded.startswith(other) or other.startswith(folded)):
            ratio = max(ratio, LIKE)  # "Length" means L
        return ratio, difflib.SequenceMatcher(None, key[:64], name).ratio()

    best = max(known, key=likeness, default="")
    return best if likeness(best)[0] >= LIKE else ""


def unknown(field: str, value: Any, key: str, known: Iterable[str]) -> SceneError:
    """Return the error for a `key` that is not one of `known`, with the nearest known one."""
    known = list(known)
    guess = nearest(key, known)
    hint = f", did you mean {guess!r}?" if guess else ""
    return SceneError(field, value, "", f"one of {', '.join(known)}", f"unknown{hint}")
