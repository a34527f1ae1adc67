"""Loading protocols: quantities that change with time, in straight pieces.

A protocol is a first value, from t = 0 on, and corners: pairs of a time and the value there.
Between corners it is a straight line, after the last one it stays. Two corners at one time are a
jump.
"""

from __future__ import annotations

import bisect
import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from pyfric.scene.checked import Quantity, Written
from pyfric.scene.units import SceneError

__all__ = ["Course", "Leg", "Piece", "legs", "piece_at", "pieces"]

MAX_CORNERS = 1000
"""Most corners of one protocol."""

Corners = tuple[tuple[float, float], ...]


class Piece(NamedTuple):
    """A straight piece: from time t (s) on, value + slope (t' - t); `integral` is that up to t."""

    t: float
    value: float
    slope: float
    integral: float

    def at(self, t: float) -> float:
        """Return the value at time t, in s."""
        return self.value + self.slope * (t - self.t)

    def integral_at(self, t: float) -> float:
        """Return the integral from 0 to t, in s."""
        since = t - self.t
        return self.integral + (self.value + 0.5 * self.slope * since) * since


def pieces(first: float, corners: Corners) -> list[Piece]:
    """Return the pieces of a protocol, the last of which goes on for good."""
    t, value, integral, found = 0.0, first, 0.0, []
    for t_next, value_next in corners:
        if t_next > t:
            found.append(Piece(t, value, (value_next - value) / (t_next - t), integral))
            integral += 0.5 * (value + value_next) * (t_next - t)
        t, value = t_next, value_next
    return [*found, Piece(t, value, 0.0, integral)]


def piece_at(course: Sequence[Piece], t: float) -> Piece:
    """Return the piece that time t (s) lies in; at a corner the one that begins there."""
    return course[max(bisect.bisect_right([one.t for one in course], t) - 1, 0)]


class Leg(NamedTuple):
    """A stretch of time, from t to t_end (s), in which an integral grows or falls all the way.

    The integral goes from `first` to `last`; `way` is +1 where it grows, -1 where it falls, and 0
    where it rests; `value` and `slope` are those of the piece, at t.
    """

    t: float
    t_end: float
    first: float
    last: float
    way: int
    value: float
    slope: float

    def time_at(self, integral: float) -> float:
        """Return when the integral has a value, in s: t where it rests."""
        far, speed = self.way * (integral - self.first), self.way * self.value
        root = math.sqrt(max(speed**2 + 2 * self.way * self.slope * far, 0.0))
        return self.t + (2 * far / (speed + root) if speed + root > 0 else 0.0)


def legs(course: Sequence[Piece], t_end: float) -> list[Leg]:
    """Return the legs of a protocol up to t_end (s), which may be inf."""
    found: list[Leg] = []
    ends = [*(piece.t for piece in course[1:]), math.inf]
    for piece, end in zip(course, ends, strict=True):
        if found and piece.t >= t_end:
            break
        turn = piece.t - piece.value / piece.slope if piece.slope else math.inf
        last = min(end, t_end)
        for a, b in itertools.pairwise([piece.t, *([turn] if piece.t < turn < last else []), last]):
            value = piece.value if math.isinf(b) else piece.at(0.5 * (a + b))
            way = int(math.copysign(1, value)) if value else 0
            to = (
                piece.integral_at(b)
                if math.isfinite(b)
                else way * math.inf
                if way
                else piece.integral
            )
            found.append(Leg(a, b, piece.integral_at(a), to, way, piece.at(a), piece.slope))
    return found


@dataclasses.dataclass(frozen=True)
class Course(Quantity):
    """Annotation of the corners of a protocol: pairs of a time in s and a value in `unit`."""

    @property
    def allowed(self) -> str:
        one = Quantity(self.unit, self.gt, self.ge, self.le)
        return f"pairs of a time >= 0 s, in order, and {one.allowed}"

    def check(self, value: Any) -> Corners:
        written = isinstance(value, Written)
        value = value.value if written else value
        if not isinstance(value, list | tuple) or len(value) > MAX_CORNERS:
            reason = f"at most {MAX_CORNERS} pairs" if isinstance(value, list | tuple) else ""
            raise SceneError("", value, self.unit, self.allowed, reason or "not a list of pairs")
        time, size = Quantity("s", ge=0.0), Quantity(self.unit, self.gt, self.ge, self.le)
        found: list[tuple[float, float]] = []
        for n, pair in enumerate(value, 1):
            if not isinstance(pair, list | tuple) or len(pair) != 2:
                raise SceneError("", pair, self.unit, self.allowed, f"corner {n}: not a pair")
            try:
                both = [
                    mark.check(Written(x) if written else x)
                    for mark, x in zip((time, size), pair, strict=True)
                ]
            except SceneError as error:
                reason = f"corner {n}: {error.reason}"
                raise SceneError("", error.value, error.unit, error.allowed, reason) from None
            t = both[0]
            if found and t < found[-1][0]:
                allowed = f">= {found[-1][0]!r} s, the time of corner {n - 1}"
                raise SceneError("", t, "s", allowed, f"corner {n}: out of order")
            if len(found) > 1 and t == found[-2][0]:
                raise SceneError("", t, "s", "at most two", f"corner {n}: a third one at this time")
            found.append((t, both[1]))
        return tuple(found)

    def written(self, value: Corners) -> Any:
        return [[f"{t!r} s", f"{size!r} {self.unit}"] for t, size in value]
