"""Checks of what the theory's functions are given; every refusal is a `SceneError`."""

from __future__ import annotations

from typing import Any

import numpy as np

from pyfric.scene import SceneError, check_number

__all__ = ["checked", "checked_array", "choice", "same_shape"]


def checked_array(field: str, value: Any, unit: str = "", **limits: float) -> np.ndarray:
    """Return a number, array or column of numbers as floats, each finite and within the limits.

    Args:
        field: name used in the error.
        value: what was given, any shape.
        unit: SI unit used in the error.
        limits: gt, ge, le, lt, as in `pyfric.scene.check_number`.

    Raises:
        SceneError: not real numbers, empty, or one of them not finite or outside the limits.
    """
    if not (isinstance(value, list | tuple) or hasattr(value, "__array__")):
        return np.asarray(check_number(field, value, unit, **limits))
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "iuf" or not array.size:
        raise SceneError(field, value, unit, "numbers, at least one", "not an array of numbers")
    array = array.astype(float)
    smallest, largest = array.min(), array.max()  # NaN if there is one
    for extreme in (smallest, largest):
        check_number(field, extreme, unit, **limits)
    return array


def checked(field: str, value: Any, unit: str = "", **limits: float) -> float:
    """Return one number as a float; see `checked_array`."""
    return check_number(field, value, unit, **limits)


def choice(field: str, value: Any, allowed: tuple) -> Any:
    """Return the value if it is one of those allowed.

    Raises:
        SceneError: it is not.
    """
    if isinstance(value, bool) or value not in allowed:
        raise SceneError(field, value, "", " or ".join(map(repr, allowed)))
    return value


def same_shape(**arrays: np.ndarray) -> list[np.ndarray]:
    """Return the arrays broadcast against each other.

    Raises:
        SceneError: their shapes do not fit.
    """
    try:
        return list(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = [array.shape for array in arrays.values()]
        names = ", ".join(arrays)
        raise SceneError(names, shapes, "", "shapes that broadcast", "shapes differ") from None
