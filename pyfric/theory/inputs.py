"""Checks of what the theory's functions are given; every refusal is a `SceneError`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pyfric.scene import LIMITS, SceneError, range_text


def checked_array(field: str, value: Any, unit: str = "", **limits: float) -> np.ndarray:
    """Return a number, array or column of numbers as floats, each finite and within the limits.

    Args:
        field: name used in the error.
        value: what was given, any shape.
        unit: SI unit used in the error.
        limits: gt, ge, le, lt: >, >=, <=, <.

    Raises:
        SceneError: not real numbers, none, or one of them not finite or outside the limits. Text
            and quantities of a library of units are refused: an array would drop the unit.
    """
    given = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(one, str) or hasattr(one, "magnitude") for one in given):
        raise SceneError(field, value, unit, f"plain numbers{unit and f', in {unit}'}")
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "iuf" or not array.size:
        raise SceneError(field, value, unit, "real numbers, at least one")
    array = array.astype(float) + 0.0
    fits = np.isfinite(array)
    for name, limit in limits.items():
        fits &= LIMITS[name][1](array, limit)
    if not fits.all():
        raise SceneError(field, float(array[~fits][0]), unit, range_text(unit, **limits))
    return array


def checked(field: str, value: Any, unit: str = "", **limits: float) -> float:
    """Return one number as a float; see `checked_array`."""
    array = checked_array(field, value, unit, **limits)
    if array.ndim:
        raise SceneError(field, value, unit, "one number")
    return float(array)


def each(of: Callable[[float], float], values: np.ndarray) -> np.ndarray:
    """Return the results of a function of one number, in the shape of the values."""
    return np.reshape([of(one) for one in values.flat], values.shape)[()]


def same_shape(**arrays: np.ndarray) -> list[np.ndarray]:
    """Return the arrays broadcast against each other.

    Raises:
        SceneError: their shapes do not fit.
    """
    try:
        return list(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = [array.shape for array in arrays.values()]
        raise SceneError(", ".join(arrays), shapes, "", "shapes that broadcast") from None
