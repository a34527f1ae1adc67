"""Numbers with units: checks of all numeric inputs, and conversion from text."""

import functools
import math
import operator
import re
import tomllib
from fractions import Fraction
from functools import lru_cache
from numbers import Integral, Real
from typing import Any

import numpy as np

from pyfric.values.errors import NO_UNIT, SceneError, show

SMALLEST = 1e-30
"""Smallest accepted non-zero magnitude (SI); products of smaller values could underflow."""
LARGEST = 1e30
"""Largest accepted magnitude (SI); products of larger values could overflow."""

# fmt: off
USUAL = frozenset({
    "angstrom", "bar", "day", "degree", "dimensionless", "dyne", "foot", "force_kilogram",
    "force_pound", "gram", "hertz", "hour", "inch", "joule", "kilogram_force", "meter",
    "metric_ton", "micron", "minute", "newton", "pascal", "percent", "poise", "pound",
    "pound_force_per_square_inch", "radian", "second", "standard_atmosphere",
})
# fmt: on
"""Accepted units, by their names in pint. Other units are likely mistakes: gr is a grain, th a mil,
kt a knot, c a speed."""
UNUSUAL = ("megameter", "gigameter", "megasecond", "gigasecond", "petameter")
"""Units that are refused as likely mistakes: Mm for mm, Ms for ms."""

# pint evaluates arithmetic, which may take long. Units may therefore contain no numbers, except
# exponents of one digit: m^2, m**2, m2, m², s^-1, s-1, s⁻¹.
_FACTOR = r"[A-Za-zµμ%]+(?:(?:\^|\*\*)[-−]?[1-9]|[-−][1-9]|[2-9]|⁻?[¹²³])?"
_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|nan|inf(?:inity)?)(?![\d.]))"
    rf"\s*(?P<unit>(?:(?:1\s*/\s*)?{_FACTOR}(?:(?:\s*[*/·⋅]\s*|\s+){_FACTOR})*)?)\s*",
    re.IGNORECASE | re.ASCII,
)
_LONGEST = 80  # characters in a quantity
_SIGNS = str.maketrans("−⁻¹²³⋅", "--123·")
_POWER = re.compile(r"(?<=[A-Za-zµμ%])(?=-?[1-9])")
_NAME = re.compile(r"\b[A-Z][A-Za-z]{4,}\b")
"""Name of a unit that begins with a capital. Shorter names are symbols, such as MPa and mPa."""


SHARES = ("1", "F_N", "sqrt(k m)")
"""Units of pure numbers, as messages show them."""
LIMITS = {
    "gt": (">", operator.gt, "too small"),
    "ge": (">=", operator.ge, "too small"),
    "le": ("<=", operator.le, "too large"),
    "lt": ("<", operator.lt, "too large"),
}
"""Sign and comparison of each limit, and the fault of a value beyond the limit, by name."""


@functools.lru_cache(maxsize=1024)
def range_text(unit: str, **limits: float | None) -> str:
    """Return the allowed range in words, such as ``"a finite number > 0.0 m"``."""
    given = {name: limits[name] for name in LIMITS if limits.get(name) is not None}
    ranges = [f"{LIMITS[name][0]} {limit:.12g}" for name, limit in given.items()]
    return " ".join(["a finite number", " and ".join(ranges), unit]).replace("  ", " ").strip()


def check_number(
    field: str, value: Any, unit: str, *, note: str = "", **limits: float | None
) -> float:
    """Return `value` in SI as a float if it is a finite real number inside the given limits.

    Args:
        field: dotted name used in the error.
        value: a Python or NumPy real scalar, in SI; text such as "5 mm" or, for pure numbers, "0.7"
            and "5 %"; or a quantity of a library of units, see `in_si`. Booleans and arrays are
            refused.
        unit: SI unit, ``""`` for a pure number.
        note: other allowed values, appended to the range in the error.
        limits: gt, ge, le, lt (>, >=, <=, <), in the same unit; None means no limit.

    Returns:
        The number as a Python float; -0.0 becomes 0.0.

    Raises:
        SceneError: wrong type or unit, NaN, infinite, outside the limits, or a non-zero magnitude
            outside `SMALLEST` … `LARGEST`.
    """
    allowed = range_text(unit, **limits)
    value = in_si(field, value, unit, allowed=allowed + note)

    def refused(reason: str, shown: Any = value, size: str = "") -> SceneError:
        return SceneError(field, shown, unit, allowed + size + note, reason)

    if isinstance(value, bool) or not isinstance(value, Real):
        text = f', or text such as "1 {unit}"' if unit else ""
        raise refused(f"a number is needed, not {type(value).__name__}", size=text)
    try:
        number = float(value) + 0.0
    except (OverflowError, ValueError):
        raise refused("too large for a floating-point number") from None
    if not math.isfinite(number):
        raise refused("not a finite number", number)
    for name, limit in limits.items():
        _, fits, wrong = LIMITS[name]
        if limit is not None and not fits(number, limit):
            raise refused(wrong, number)
    if number and not SMALLEST <= abs(number) <= LARGEST:
        raise refused("out of range", number, f", of magnitude {SMALLEST:g} to {LARGEST:g}")
    return number


def check_whole(
    field: str, value: Any, least: int, largest: int | None = None, *, note: str = ""
) -> int:
    """Return `value` as a Python integer if it is an integer inside the limits.

    Args:
        field: dotted name used in the error.
        value: an integer of Python or NumPy. Booleans, and floats such as 2.0, are refused.
        least, largest: limits, both included.
        note: other allowed values, appended to the range in the error.

    Raises:
        SceneError: another type, or outside the limits.
    """
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < least or (largest is not None and value > largest):
        allowed = f">= {least}" if largest is None else f"from {least} to {largest}"
        reason = "" if whole else "not a whole number"
        raise SceneError(field, value, "", f"a whole number {allowed}{note}", reason)
    return int(value)


def in_si(field: str, value: Any, unit: str, *, allowed: str) -> Any:
    """Convert text, or a quantity of pint, to SI; return anything else unchanged.

    Text needs a unit, such as "5 mm". Text for a pure number has no unit, or percent.

    Raises:
        SceneError: the value has no unit, or a unit of another dimension.
    """
    if isinstance(value, str):
        return parse_quantity(field, value, "" if unit in SHARES else unit, allowed=allowed)
    if not (hasattr(value, "to_base_units") and hasattr(value, "magnitude")):
        return value
    try:
        return value.to(unit or "dimensionless").magnitude
    except Exception as error:  # each library of units raises its own errors
        raise SceneError(field, str(value), unit, allowed, str(error)) from None


def check_unmasked(field: str, value: Any) -> None:
    """Raise SceneError for masked values of NumPy, because conversion would drop the mask."""
    if np.ma.is_masked(value):
        n = int(np.ma.count_masked(value))
        allowed, reason = "numbers without gaps", f"{n} of {np.size(value)} masked"
        raise SceneError(field, "an array", "", f"{allowed}: leave out or fill them", reason)


def as_list(value: Any) -> Any:
    """Return an array of NumPy or pandas without unit as a list; anything else unchanged.

    Raises:
        SceneError: values are masked.
    """
    check_unmasked("", value)
    plain = getattr(value, "ndim", 0) and not (hasattr(value, "unit") or hasattr(value, "units"))
    return np.asarray(value).tolist() if plain else value


def parse_quantity(field: str, value: Any, unit: str, *, allowed: str = "") -> float:
    """Return the SI number of a quantity written as text, such as ``"5 mm"``.

    The number is rounded once: ``"2.5 mm"`` gives the same float as ``2.5e-3``. NaN, infinities and
    limits are checked by `check_number`.

    Args:
        field: dotted name used in the error.
        value: the text ``"<number> <unit>"``.
        unit: SI unit to convert to.
        allowed: the allowed range, used in the error.

    Raises:
        SceneError: the value is not text, has no number or no unit, or its unit is unknown or of
            another dimension.
    """
    example = f"1 {unit}"
    allowed = allowed or range_text(unit)
    allowed += f', written with a unit such as "{example}"' * bool(unit)
    no_unit = f'{NO_UNIT}: write e.g. "{example}"'

    def refused(reason: str) -> SceneError:
        return SceneError(field, value, unit, allowed, reason)

    if isinstance(value, (int, float)) and not isinstance(value, bool):
        raise refused(no_unit)
    if not isinstance(value, str):
        raise refused(f"a quantity in quotes is needed, not {type(value).__name__}")
    match = _QUANTITY.fullmatch(value) if len(value) <= _LONGEST else None
    if match is None:
        raise refused("not a number" + " followed by a unit" * bool(unit))
    if unit and not match["unit"]:
        raise refused(no_unit)
    number = float(match["number"])
    if match["unit"] == unit:
        return number
    try:
        factor = _factor(match["unit"], unit)
    except ValueError as error:
        raise refused(str(error)) from None
    if number == 0 or not math.isfinite(number):
        return number
    try:
        return float(Fraction(match["number"]) * factor)
    except OverflowError:
        return math.copysign(math.inf, number)


def spoken(text: str) -> Any:
    """Return a value from a line of text, such as the argument of `--set`.

    The text is read as TOML: a number in SI, a list, or a table such as {mean = 0.7, std = 0.02}.
    Numbers that TOML does not accept, such as .005 and 1.e-3, are accepted, too. Any other line is
    returned as text, such as "7.5 mm" or "left".
    """
    try:
        return tomllib.loads(f"value = {text}").get("value", text)
    except (ValueError, RecursionError):
        pass
    try:
        return float(text)
    except ValueError:
        return text


PREFIXES = {0: "", -1: "m", -2: "u", -3: "n", 1: "k", 2: "M", 3: "G"}
"""Prefixes of units, by power of 1000."""


def with_prefix(value: float, unit: str) -> str:
    """Return a value in SI with four digits and a prefix of its unit, such as "8 um"."""
    power = prefix_power(value)
    return f"{float(f'{value:.4g}') / 1000.0**power:.4g} {PREFIXES[power]}{unit}"


def prefix_power(value: float) -> int:
    """Return the power of 1000 for the prefix of a value with four digits."""
    power = math.floor(math.log10(abs(float(f"{value:.4g}"))) / 3) if value else 0
    return min(max(power, -3), 3)


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # slow to import, and needed only for units other than SI units

    return pint.UnitRegistry(non_int_type=Fraction)


_SMALLER = re.compile(r"(?:s|m|N|Pa|J)(?=$|[ /])")
_LARGER = re.compile(r"(?:N|Pa|J)(?=$|[ /])")
"""First unit of a product, without exponent, to which prefixes below 1, or above 1, can belong."""


def _prefixed(name: str, unit: str) -> Fraction | None:
    """Return the number of SI `unit` in one `name`, such as "mm/s", if only a prefix differs.

    Otherwise return None. The definitions of all units, which take 0.7 s to read, are not needed.
    """
    powers = {prefix: power for power, prefix in PREFIXES.items()} | {"µ": -2, "μ": -2}
    power = powers.get(name[: len(name) - len(unit)])
    if power is None or not name.endswith(unit):
        return None
    return Fraction(1000) ** power if (_LARGER if power > 0 else _SMALLER).match(unit) else None


@lru_cache(maxsize=256)
def _factor(name: str, unit: str) -> Fraction:
    """Return the exact number of SI `unit` in one `name`.

    Raises:
        ValueError: no factor converts the unit. The message gives the reason.
    """
    if (factor := _prefixed(name, unit)) is not None:
        return factor
    registry, shown = _registry(), show(name)
    try:
        plain = _POWER.sub("^", name.translate(_SIGNS))
        given, wanted = map(registry.parse_units, (plain, unit))
        same = given.dimensionality == wanted.dimensionality
    except Exception:  # pint raises many types of errors
        small = _NAME.sub(lambda word: word[0].lower(), name)
        instead = f": write {show(small)}" if small != name and _known(small, unit) else ""
        raise ValueError(f"unknown unit {shown}{instead}") from None
    if not same:
        raise ValueError(f"wrong unit: {shown} does not convert to {unit or 'a pure number'}")
    for full, _ in registry.Quantity(1, given).unit_items():
        _, root, _ = registry.parse_unit_name(full)[0]
        if root not in USUAL or full in UNUSUAL:
            raise ValueError(f"{shown} would be a {full.replace('_', ' ')}: write a usual unit")
    try:
        factor = Fraction(registry.convert(Fraction(1), given, wanted))
    except Exception:  # offset and logarithmic units in a product
        raise ValueError(f"no factor converts unit {shown} to {unit}") from None
    if not factor > 0:
        raise ValueError(f"unit {shown}: its factor to {unit} is not positive")
    return factor


def _known(name: str, unit: str) -> bool:
    """Whether a factor converts a unit to the SI unit."""
    try:
        return _factor(name, unit) > 0
    except ValueError:
        return False
