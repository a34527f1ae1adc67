"""Pushes: forces on chosen blocks of a prescribed interface, for ever or over a time."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from pyfric.scene.checked import Annotation, Quantity, Whole, Written
from pyfric.scene.errors import SceneError

__all__ = ["Push", "Pushed", "Pushes", "forces"]

MAX_PUSHES = 1000
"""Most pushes of one scene."""


class Push(NamedTuple):
    """A force along the driving on a block, counted from 1 at the trailing edge.

    `force` (N) acts from `begin` up to `end` (s), which may be inf.
    """

    block: int
    force: float
    begin: float = 0.0
    end: float = math.inf


Pushed = tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True)
class Pushes(Annotation):
    """Annotation of pushes: lists of a block, a force, and where wanted a begin and an end."""

    unit: str = "N"
    allowed: str = "lists of a block's number, a force in N, and perhaps a begin and an end in s"

    def check(self, value: Any) -> tuple[Push, ...]:
        written = isinstance(value, Written)
        pushes = value.value if written else value
        if not isinstance(pushes, list | tuple) or len(pushes) > MAX_PUSHES:
            reason = f"not a list of pushes, or more than {MAX_PUSHES}"
            raise SceneError("", pushes, "N", self.allowed, reason)
        found = []
        for n, push in enumerate(pushes, 1):
            try:
                found.append(self._push(push, written))
            except SceneError as error:
                reason = f"push {n}: {error.reason}"
                raise SceneError("", error.value, error.unit, error.allowed, reason) from None
        return tuple(found)

    def _push(self, given: Any, written: bool) -> Push:
        if not isinstance(given, list | tuple) or not 2 <= len(given) <= 4:
            raise SceneError("", given, "N", self.allowed, "not two to four numbers")
        block, *rest = given
        block = Whole(1_000_000_000).check(block)
        marks = (Quantity("N"), Quantity("s", ge=0.0), Quantity("s", gt=0.0))
        ever = [] if len(rest) < 3 or rest[2] != math.inf else [rest.pop()]
        numbers = [
            mark.check(Written(x) if written else x) for mark, x in zip(marks, rest, strict=False)
        ]
        push = Push(block, *numbers, *ever)
        if not push.end > push.begin:
            raise SceneError("", push.end, "s", f"> {push.begin!r} s", "ends before it begins")
        return push

    def written(self, value: tuple[Push, ...]) -> Any:
        return [
            [one.block, f"{one.force!r} N", f"{one.begin!r} s"]
            + ([f"{one.end!r} s"] if math.isfinite(one.end) else [])
            for one in value
        ]


def forces(pushes: tuple[Push, ...], n_blocks: int, t: float) -> np.ndarray:
    """Return the force on each block at t (s), from the trailing edge on, in N."""
    found = np.zeros(n_blocks)
    for one in pushes:
        if one.begin <= t < one.end:
            found[one.block - 1] += one.force
    return found
