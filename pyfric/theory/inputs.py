"""Checks of the arguments of theory functions; every refusal is a `ValueError`."""

from __future__ import annotations

from typing import Any

import numpy as np

_LIMITS = {
    "gt": (">", np.greater),
    "ge": (">=", np.greater_equal),
    "le": ("<=", np.less_equal),
    "lt": ("<", np.less),
}


def refusal(field: str, value: Any, unit: str, allowed: str) -> ValueError:
    """Return the error that names the given value and the accepted values."""
    return ValueError(f"{field} = {value!r} {unit}".rstrip() + f"; allowed: {allowed}")


def _has_unit(value: Any) -> bool:
    """Whether a value is a quantity of a unit library; some quantities are NumPy arrays."""
    names = ("magnitude", *("unit", "units") * isinstance(value, np.ndarray | np.generic))
    return any(hasattr(value, name) for name in names)


def checked_array(field: str, value: Any, unit: str = "", **limits: float) -> np.ndarray:
    """Return a number, array or column of numbers as floats, each finite and within the limits.

    Args:
        field: name used in the error.
        value: the given value, any shape.
        unit: SI unit used in the error.
        limits: gt, ge, le, lt for limits >, >=, <=, <.

    Raises:
        ValueError: a value is not a real number, not finite or outside the limits, or there is no
            value. Text and quantities with units are refused, because an array would drop the unit.
            Masked values are refused, because an array would ignore the mask.
    """
    if np.ma.is_masked(value):
        raise refusal(field, value, unit, "numbers without gaps: leave out or fill what is masked")
    given = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(value, str) or _has_unit(value) for value in given):
        raise refusal(field, value, unit, f"plain numbers{unit and f', in {unit}'}")
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "iuf" or not array.size:
        raise refusal(field, value, unit, "real numbers, at least one")
    array = array.astype(float) + 0.0
    fits = np.isfinite(array)
    for name, limit in limits.items():
        fits &= _LIMITS[name][1](array, limit)
    if not fits.all():
        ranges = [f"{_LIMITS[name][0]} {limit:.12g}" for name, limit in limits.items()]
        allowed = " ".join(["a finite number", " and ".join(ranges), unit]).strip()
        raise refusal(field, float(array[~fits][0]), unit, allowed)
    return array


def checked(field: str, value: Any, unit: str = "", **limits: float) -> float:
    """Return one number as a float; see `checked_array`."""
    array = checked_array(field, value, unit, **limits)
    if array.ndim:
        raise refusal(field, value, unit, "one number")
    return float(array)


def choice(field: str, value: Any, allowed: tuple) -> Any:
    """Return the value if it is allowed.

    Raises:
        ValueError: the value is not allowed.
    """
    if isinstance(value, bool) or value not in allowed:
        raise refusal(field, value, "", " or ".join(map(repr, allowed)))
    return value


def same_shape(**arrays: np.ndarray) -> list[np.ndarray]:
    """Return the arrays broadcast against each other.

    Raises:
        ValueError: the shapes of the arrays do not fit.
    """
    try:
        return list(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = [array.shape for array in arrays.values()]
        raise refusal(", ".join(arrays), shapes, "", "shapes that broadcast") from None
