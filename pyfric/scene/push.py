"""Pushes: constant or growing forces on chosen blocks of an interface."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from pyfric.scene.checked import Annotation, Quantity, Whole, Written
from pyfric.scene.errors import SceneError, numbered

FOR_EVER = (math.inf, "inf s")
"""Values that mean no end, in Python and in files."""
MAX_PUSHES = 1000
"""Largest number of pushes of one scene."""


class Push(NamedTuple):
    """A force in the drive direction on a block, counted from 1 at the trailing edge.

    The force is `force` + `rate` (t - `begin`), in N, from `begin` to `end` (s), which may be inf.
    """

    block: int
    force: float
    begin: float = 0.0
    end: float = math.inf
    rate: float = 0.0

    def at(self, t: float) -> float:
        """Return the force at t (s), in N, without regard to `end`."""
        return self.force + self.rate * (t - self.begin)

    @property
    def ever(self) -> bool:
        """Whether the force is constant from t = 0 on, without end."""
        return not (self.rate or self.begin) and self.end == math.inf


Pushed = tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True)
class Pushes(Annotation):
    """Annotation of pushes: lists of a block, a force, and perhaps begin, end and rate."""

    unit: str = "N"
    allowed: str = (
        "lists of a block's number, a force in N, and perhaps begin and end in s and a rate in N/s"
    )

    def check(self, value: Any, written: Written | None = None) -> tuple[Push, ...]:
        if not isinstance(value, list | tuple) or len(value) > MAX_PUSHES:
            reason = f"not a list of pushes, or more than {MAX_PUSHES}"
            raise SceneError("", value, "N", self.allowed, reason)
        return numbered("push", lambda one: self._push(one, written), value)

    def _push(self, given: Any, written: Written | None) -> Push:
        if not isinstance(given, list | tuple) or not 2 <= len(given) <= 5:
            raise SceneError("", given, "N", self.allowed, "not two to five numbers")
        block, *rest = given
        block = Whole(1_000_000_000).check(block)
        marks = (Quantity("N"), Quantity("s", ge=0.0), Quantity("s", gt=0.0), Quantity("N/s"))
        numbers = [
            math.inf if n == 2 and x in FOR_EVER else mark.check(x, written)
            for n, (mark, x) in enumerate(zip(marks, rest, strict=False))
        ]
        push = Push(block, *numbers)
        if not push.end > push.begin:
            raise SceneError("", push.end, "s", f"> {push.begin!r} s", "ends before it begins")
        return push

    def written(self, value: tuple[Push, ...]) -> Any:
        return [
            [one.block, f"{one.force!r} N", f"{one.begin!r} s"]
            + ([f"{one.end!r} s"] if math.isfinite(one.end) or one.rate else [])
            + ([f"{one.rate!r} N/s"] if one.rate else [])
            for one in value
        ]


def pushes_at(pushes: tuple[Push, ...], n_blocks: int, t: float, now: float) -> np.ndarray:
    """Return forces (N) and rates (N/s) at time `now` (s) of the pushes that act at t (s).

    The shape is (2, n_blocks), from the trailing edge on.
    """
    found = np.zeros((2, n_blocks))
    for one in pushes:
        if one.begin <= t < one.end:
            found[:, one.block - 1] += one.at(now), one.rate
    return found
