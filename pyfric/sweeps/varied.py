"""What may vary in a sweep: fields with their units, and ranges of numbers."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pyfric.engines import OPTION_UNITS, Options
from pyfric.scene import Scene, SceneError, quantities
from pyfric.sweeps.sweep import ELSEWHERE

__all__ = ["MOST_POINTS", "PARTS", "Span", "units"]

PARTS = ("slider", "top", "driver", "interface")


MOST_POINTS = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Span:
    """A range of a number: n values in a grid or list, or where points are drawn.

    Args:
        start, stop: its ends, in SI.
        n: number of values in a grid or list, ends included.
        step: distance of the values; drawn ones are rounded to it.
        scale: "linear" or "log".
    """

    start: float
    stop: float
    n: int | None = None
    step: float | None = None
    scale: Literal["linear", "log"] = "linear"

    def values(self, name: str) -> list[float]:
        """Return the values in a grid or list."""
        if self.step is not None:
            count = math.floor((self.stop - self.start) / self.step * (1 + 1e-12)) + 1
        elif self.n is not None:
            count = self.n
        else:
            raise SceneError(name, None, "", "a range with n or step", "how many values?")
        if count > MOST_POINTS:
            raise SceneError(name, count, "", f"at most {MOST_POINTS} values")
        if self.step is not None:
            return [_short(self.start + i * self.step) for i in range(count)]
        return [self.at(share) for share in np.linspace(0.0, 1.0, count)]

    def at(self, share: float) -> float:
        """Return the value at a share of the range, 0 to 1."""
        if self.scale == "log":
            value = self.start * (self.stop / self.start) ** share
        else:
            value = self.start + share * (self.stop - self.start)
        if self.step is not None:
            value = self.start + round((value - self.start) / self.step) * self.step
        return _short(value)


def _short(value: float) -> float:
    """Return a number without the rounding of its last digits: 3 mm, not 3.0000000000000001 mm."""
    return float(f"{float(value):.12g}")


def units(scene: Scene) -> dict[str, str | None]:
    """Return the fields that may vary, with their SI units; None for those that are no numbers."""
    found: dict[str, str | None] = {"t_end": "s"}
    for name in PARTS:
        part = getattr(scene, name)
        marks = quantities(type(part))
        for one in dataclasses.fields(part):
            found[f"{name}.{one.name}"] = marks[one.name].unit if one.name in marks else None
    for one in dataclasses.fields(Options):
        if one.name not in ELSEWHERE:
            found[f"options.{one.name}"] = OPTION_UNITS.get(one.name)
    return found
