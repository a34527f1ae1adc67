"""Fields as functions of x, linear between points, such as measured fields from a file."""

import csv
import os
from pathlib import Path
from typing import Annotated, ClassVar, Self

import numpy as np

from pyfric.values import (
    Quantity,
    SceneError,
    check_number,
    is_number,
    lines_of,
    naming,
    parse_quantity,
    part,
    read_at_most,
    unit_in,
)

MAX_BYTES = 1 << 20
"""Largest size of a file, in bytes."""
ROWS = "two columns of numbers, x and value, of at least two rows"


@part
class Profile:
    """A field given by its values at points along the interface, linear between them.

    The field is a function of x: sliders with smaller blocks or shorter length have the same
    interface. Blocks beyond the first or the last point are refused.

    Args:
        x: distances from the trailing edge, m, increasing; at least two.
        value: value of the field at each x, in its unit.

    Raises:
        SceneError: the lists differ in length, or x does not increase.
    """

    x: Annotated[tuple[float, ...], Quantity("m", listed=True, note=", or a list of them")]
    value: Annotated[tuple[float, ...], Quantity("", listed=True, note=", or a list of them")]

    _section: ClassVar[str] = "profile"
    in_unit: ClassVar[tuple[str, ...]] = ("value",)
    in_space: ClassVar[bool] = True

    def __post_init__(self) -> None:
        lists = isinstance(self.x, tuple) and isinstance(self.value, tuple)
        if not lists or len(self.x) != len(self.value) or len(self.x) < 2:
            allowed = "two lists of the same length, at least 2"
            raise SceneError("profile.value", self.value, "", allowed, "does not fit x")
        for n, (a, b) in enumerate(zip(self.x, self.x[1:], strict=False), 2):
            if not b > a:
                raise SceneError("profile.x", b, "m", f"> {a!r} m", f"point {n} is out of order")

    @classmethod
    def read(cls, path: str | os.PathLike[str], unit: str = "") -> Self:
        """Return the field in a file with the columns x and value.

        Args:
            path: an array of NumPy (.npy), shape (n, 2), in SI units; or a text in UTF-8 whose
                columns are separated by commas, semicolons, tabs or blanks. Its first row may name
                the columns with their units, such as "x (mm),k_f (N/um)"; without units, numbers
                are in SI.
            unit: SI unit of the field; "" if it has none.

        Raises:
            SceneError: the file cannot be read, has other columns, or numbers that are refused.
        """
        path = Path(path)
        numbers = _array(path) if path.suffix == ".npy" else _text(path, unit)
        with naming(where=os.fspath(path)):
            x, value = zip(*numbers, strict=True)
            return cls(x=x, value=value)

    @property
    def mean(self) -> float:
        """Mean over x, in the unit of the field."""
        area = float(np.trapezoid(self.value, self.x))
        return area / (self.x[-1] - self.x[0])

    def draw(self, n: int, l: float, name: str = "") -> np.ndarray:
        """Return the field on n blocks with spacing l (m), from the trailing edge on.

        Raises:
            SceneError: a block is beyond the first or the last point.
        """
        x = np.arange(n) * l
        rounding = 1e-9 * l
        if self.x[0] > rounding or self.x[-1] < x[-1] - rounding:
            outside = self.x[0] if self.x[0] > rounding else self.x[-1]
            allowed = f"points from 0 m to at least {x[-1]:.9g} m"
            raise SceneError("profile.x", outside, "m", allowed, "blocks are outside the profile")
        return np.interp(x, self.x, self.value)


def _array(path: Path) -> list[list[float]]:
    """Return the rows of a NumPy array file."""
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "no array of NumPy"
        raise SceneError("", os.fspath(path), "", ROWS, reason) from None
    if found.ndim != 2 or found.shape[1] != 2 or len(found) < 2 or found.dtype.kind not in "fiu":
        raise SceneError("", os.fspath(path), "", ROWS, f"shape {found.shape} of {found.dtype}")
    return found.astype(float).tolist()


def _text(path: Path, unit: str) -> list[list[float]]:
    """Return the rows of a text file, in SI units."""
    try:
        content = read_at_most(path, MAX_BYTES + 1)
        rows = lines_of(content.decode("utf-8-sig")).plain
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "no table in UTF-8"
        raise SceneError("", os.fspath(path), "", ROWS, reason) from None
    if len(content) > MAX_BYTES:
        raise SceneError("", os.fspath(path), "", f"at most {MAX_BYTES} bytes", "too large")
    units = ["", ""]
    if rows and not any(map(is_number, rows[0].cells)) and len(rows[0].cells) == 2:
        heads = rows.pop(0).cells
        try:
            units = [unit_in(head, si) for head, si in zip(heads, ("m", unit), strict=True)]
        except ValueError as error:
            raise SceneError("", os.fspath(path), "", "heads with units", str(error)) from None
    found = []
    for n, cells in rows:
        if len(cells) != 2:
            reason = f"row {n}: {len(cells)} columns"
            raise SceneError("", os.fspath(path), "", ROWS, reason)
        with naming(where=f"{os.fspath(path)}, row {n}"):
            found.append(
                [
                    parse_quantity("", f"{cell} {given}", si)
                    if given
                    else check_number("", _number(cell, si), si)
                    for cell, given, si in zip(cells, units, ("m", unit), strict=True)
                ]
            )
    if len(found) < 2:
        raise SceneError("", os.fspath(path), "", ROWS, f"{len(found)} rows")
    return found


def _number(cell: str, unit: str) -> float:
    """Return the number in a cell."""
    if not is_number(cell):
        raise SceneError("", cell, unit, "a number", "not a number")
    return float(cell)
