"""The content of a file of measurements: columns with names, numbers, units and clocks.

A column has a name, numbers, the unit that the file states, and the clock by which it was sampled,
if the file gives one. `reading` finds the meanings of columns.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyfric.values import SceneError

MAX_COLUMNS = 64
"""Largest number of columns of an array that counts as a table; a larger array may be an image."""


@dataclass(frozen=True)
class Asked:
    """Requests of the caller: number of lines to skip at the top, decimal mark, words for gaps."""

    head: int = 0
    decimal: str | None = None
    gaps: frozenset[str] = frozenset()


@dataclass
class Column:
    """A column of a file.

    Attributes:
        numbers: function that returns its numbers in a new array.
        head: its name in the file.
        unit: its unit as stated in the file, or "".
        clock: clock of its samples. Samples of different clocks may have different times. None
            means unknown.
    """

    numbers: Callable[[], np.ndarray]
    head: str
    unit: str = ""
    clock: Hashable = None


@dataclass
class Found:
    """Content of a file: its kind, columns by name, in order, and notes."""

    kind: str
    columns: dict[str, Column] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, column: Column) -> None:
        """Add a column; later columns of the same name get a number."""
        n, plain = 1, name
        while name in self.columns:
            n, name = n + 1, f"{plain}:{n + 1}"
        self.columns[name] = column

    def add_array(
        self,
        name: str,
        head: str,
        values: np.ndarray,
        unit: str = "",
        *,
        clock: Hashable = None,
    ) -> None:
        """Add an array: a column, or a table with a sample in each row. `name` includes the group.

        A table with more columns than rows has a channel in each row. A table with too many columns
        is left out. Notes report both cases.
        """
        if values.dtype.kind not in "iufb" or values.size < 2:
            return
        if max(values.shape) == values.size:
            self.add(name, Column(lambda: values.ravel().astype(float), head, unit, clock))
            return
        shape = " x ".join(map(str, values.shape))
        if values.ndim > 2 or min(values.shape) > MAX_COLUMNS:
            self.notes.append(f"{name!r} is left out: {shape} numbers are no table of columns")
            return
        label = "{0}:{1}"
        if values.shape[1] > values.shape[0]:
            values, label = values.T, "{0}({1},:)"
            self.notes.append(f"{name!r} has {shape} numbers: its rows are taken for channels")
        for c in range(values.shape[1]):
            numbers = functools.partial(lambda array, c: array[:, c].astype(float), values, c)
            column = Column(numbers, f"{head}:{c + 1}", unit, clock)
            self.add(label.format(name, c + 1), column)


def refused(path: Any, allowed: str, reason: str) -> SceneError:
    """Return the error for a file that cannot be understood."""
    return SceneError("path", os.fspath(path), "", allowed, reason)
