"""Fields and options that may vary in a sweep, with their units, and ranges of numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import scipy

from pyfric.engines import Options
from pyfric.scene import Number, SceneLike, as_scene, full_name, scene_fields
from pyfric.sweeps.runs import OPTIONS
from pyfric.values import Annotation, Quantity, SceneError, check_number, check_whole, naming

MAX_POINTS = 1_000_000
"""Largest number of points of a sweep."""
Scale = Literal["linear", "log"]
SEQUENCES = {"sobol": "Sobol", "halton": "Halton", "latin": "LatinHypercube"}
"""Classes of `scipy.stats.qmc`, which is slow to import and so is imported at first use."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """A range: n values in a grid or list, or the range of drawn points.

    Args:
        start, stop: its ends, in SI or as text such as "5 mm", the lower end first. Text is read
            with the unit of the field that varies.
        n: number of values in a grid or list, ends included, at least 2; None with a step.
        step: distance of the values from `start` on; drawn values are rounded to them. If ends and
            step are integers, so are the values.
        scale: "linear" or "log"; only "linear" with a step.

    Raises:
        SceneError: a value is refused.
    """

    start: Number
    stop: Number
    n: int | None = None
    step: Number | None = None
    scale: Scale = "linear"

    def __post_init__(self) -> None:
        if self.scale not in get_args(Scale):
            raise SceneError("scale", self.scale, "", "'linear' or 'log'")
        if str in map(type, (self.start, self.stop, self.step)):
            return  # until the unit is known
        least = 0.0 if self.scale == "log" else None
        for name in ("start", "stop"):
            check_number(name, getattr(self, name), "", gt=least)
        if not self.start < self.stop:
            raise SceneError("start", self.start, "", f"below {self.stop!r}, the upper end")
        if self.step is not None:
            check_number("step", self.step, "", gt=0.0)
            if self.n is not None:
                raise SceneError("n", self.n, "", "n or step, not both")
            if self.scale == "log":
                raise SceneError("scale", self.scale, "", "'linear' with a step")
        if self.n is not None:
            check_whole("n", self.n, 2, MAX_POINTS)

    def in_si(self, name: str, unit: str) -> Span:
        """Return the range of a field with this name and unit, in SI.

        Raises:
            SceneError: a value is refused.
        """
        ends = {key: getattr(self, key) for key in ("start", "stop", "step")}
        ends = {key: end for key, end in ends.items() if isinstance(end, str)}
        found = {key: check_number(f"{name}.{key}", end, unit) for key, end in ends.items()}
        with naming(where=name):
            return dataclasses.replace(self, **found) if found else self

    def values(self, name: str) -> list[float]:
        """Return the values in a grid or list.

        Raises:
            SceneError: there are too many values, or neither n nor step is given. The error has
                this name.
        """
        if self.step is not None:
            count = self._steps() + 1
            if count > MAX_POINTS:
                raise SceneError(name, count, "", f"at most {MAX_POINTS} values")
            return [self._stepped(i) for i in range(count)]
        if self.n is None:
            raise SceneError(name, None, "", "a range with n or step", "how many values?")
        return [self.at(share) for share in np.linspace(0.0, 1.0, self.n)]

    def _steps(self) -> int:
        """Return the number of steps that fit into the range."""
        return math.floor((self.stop - self.start) / self.step * (1 + 1e-12))

    def _stepped(self, n: int) -> float:
        """Return the value n steps from the start, an integer if ends and step are integers."""
        value = self.start + n * self.step
        whole = all(isinstance(number, int) for number in (self.start, self.stop, self.step))
        return value if whole else _short(value)

    def share(self, value: float) -> float:
        """Return the position of a value in the range, 0 to 1: the inverse of `at`."""
        if self.scale == "log":
            return math.log(value / self.start) / math.log(self.stop / self.start)
        return (value - self.start) / (self.stop - self.start)

    def at(self, share: float) -> float:
        """Return the value at a position in the range, 0 to 1."""
        if self.scale == "log":
            value = self.start * (self.stop / self.start) ** share
        else:
            value = self.start + share * (self.stop - self.start)
        if self.step is None:
            return _short(value)
        n = round((value - self.start) / self.step)
        return self._stepped(min(n, self._steps()))


def _short(value: float) -> float:
    """Return a number without the rounding of its last digits: 3 mm, not 3.0000000000000001 mm."""
    return float(f"{float(value):.12g}")


def drawn(spans: Sequence[Span], kind: str, n: int, seed: int) -> list[list[float]]:
    """Return n points with a value in each range, drawn as "random" or by one of `SEQUENCES`."""
    rng = np.random.default_rng(seed)
    if kind == "random":
        shares = rng.random((n, len(spans)))
    else:
        sequence = getattr(scipy.stats.qmc, SEQUENCES[kind])(len(spans), seed=rng)
        # Sobol's points are balanced in powers of two.
        even = kind == "sobol"
        shares = sequence.random_base2((n - 1).bit_length())[:n] if even else sequence.random(n)
    return [[span.at(share) for span, share in zip(spans, row, strict=True)] for row in shares]


def varied(scene: SceneLike) -> dict[str, Annotation]:
    """Return name -> annotation of each field and option that may vary."""
    marks = {name: Options.declared()[name].mark for name in OPTIONS}
    options = {
        f"options.{name}": Quantity(mark.unit) if isinstance(mark, Quantity) else Annotation()
        for name, mark in marks.items()
    }
    return {"t_end": Quantity("s", ge=0.0)} | scene_fields(as_scene(scene)) | options


def full_field(scene: SceneLike, name: str, values: Any) -> str:
    """Return the full name of a varied field or option.

    Raises:
        SceneError: there is no such field, or it is in several parts.
    """
    with naming(f"over.{name}"):
        return full_name(as_scene(scene), name, values, varied(scene))
