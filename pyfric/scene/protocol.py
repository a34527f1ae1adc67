"""Loads that change with time: piecewise linear protocols, and pushes of single blocks.

A protocol is a value at t = 0 and breakpoints (`corners`), which are pairs of a time and a value.
A protocol is linear between breakpoints and constant after the last breakpoint. Two breakpoints at
the same time are a jump. A push is a constant or growing force on one block of an interface.
"""

from __future__ import annotations

import bisect
import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from pyfric.values import (
    FOR_EVER,
    Annotation,
    Quantity,
    SceneError,
    Whole,
    Written,
    as_list,
    check_number,
    check_unmasked,
    numbered,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MOST = 1000
"""Largest number of breakpoints of one protocol, and of pushes of one scene."""

Corners = tuple[tuple[float, float], ...]


class Piece(NamedTuple):
    """A linear piece of a protocol: value + slope (t' - t) from time t (s) on.

    `integral` is the integral of the protocol from 0 to t.
    """

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

    def plus(self, rate: float) -> Piece:
        """Return the sum of this piece and the function rate t."""
        t, value, slope, integral = self
        if not rate:
            return self
        return Piece(t, value + rate * t, slope + rate, integral + 0.5 * rate * t**2)


def pieces(first: float, corners: Corners) -> list[Piece]:
    """Return the linear pieces of a protocol; the last piece has no end."""
    t, value, integral, found = 0.0, first, 0.0, []
    for t_next, value_next in corners:
        if t_next > t:
            found.append(Piece(t, value, (value_next - value) / (t_next - t), integral))
            integral += 0.5 * (value + value_next) * (t_next - t)
        t, value = t_next, value_next
    return [*found, Piece(t, value, 0.0, integral)]


def piece_at(path: Sequence[Piece], t: float) -> Piece:
    """Return the piece that contains time t (s); at a breakpoint, the piece that begins there."""
    return path[max(bisect.bisect_right([piece.t for piece in path], t) - 1, 0)]


def followed(first: float, corners: Corners, then_first: float, then: Corners, t: float) -> Corners:
    """Return the breakpoints of a protocol that continues as another protocol from t (s) on."""
    old, new = pieces(first, corners), pieces(then_first, then)
    if _from(old, t) == _from(new, t):
        return corners
    kept = tuple(corner for corner in corners if corner[0] < t)
    reached = next((value for t_at, value in corners if t_at == t), piece_at(old, t).at(t))
    rest = tuple(corner for corner in then if corner[0] > t)
    return (*kept, (t, reached), (t, piece_at(new, t).at(t)), *rest)


def _from(path: Sequence[Piece], t: float) -> list[tuple[float, float, float]]:
    """Return a protocol from time t (s) on: start times, values and slopes of its pieces."""
    now = piece_at(path, t)
    rest = [(piece.t, piece.value, piece.slope) for piece in path if piece.t > t]
    return [(t, now.at(t), now.slope), *rest]


class Leg(NamedTuple):
    """A load segment: an interval from t to t_end (s) in which an integral changes monotonically.

    The integral goes from `first` to `last`. `way` is +1 if it grows, -1 if it falls, and 0 if it
    is constant. `value` and `slope` belong to the protocol at t.
    """

    t: float
    t_end: float
    first: float
    last: float
    way: int
    value: float
    slope: float

    def time_at(self, integral: float) -> float:
        """Return the time (s) at which the integral has a value; t if the integral is constant."""
        far, speed = self.way * (integral - self.first), self.way * self.value
        root = math.sqrt(max(speed**2 + 2 * self.way * self.slope * far, 0.0))
        return self.t + (2 * far / (speed + root) if speed + root > 0 else 0.0)


def legs(course: Sequence[Piece], t_end: float) -> list[Leg]:
    """Return the load segments of a protocol up to t_end (s), which may be inf."""
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
            last_value = way * math.inf if way else piece.integral  # of a piece without end
            to = piece.integral_at(b) if math.isfinite(b) else last_value
            found.append(Leg(a, b, piece.integral_at(a), to, way, piece.at(a), piece.slope))
    return found


def _rows(
    of: Protocol | Pushes, what: tuple[str, str], value: Any, check: Callable[[Any], Any]
) -> tuple[Any, ...]:
    """Return the checked rows of a list; `what` holds the singular and plural name of a row."""
    value = as_list(value)
    if not isinstance(value, list | tuple):
        raise SceneError("", value, of.unit, of.allowed, f"not a list of {what[1]}")
    if len(value) > MOST:
        allowed = f"at most {MOST} {what[1]}{of.fewer}"
        raise SceneError("", len(value), "", allowed, "too many")
    return numbered(what[0], check, value)


def thinned(corners: ArrayLike, error: float | str) -> Corners:
    """Return fewer breakpoints, whose protocol equals the given protocol within an error.

    Time steps end at each breakpoint, so that a measured speed with many samples takes many steps.
    Jumps, which are two breakpoints at one time, remain. The error of the driver's displacement is
    then at most `error` times the time.

    Args:
        corners: pairs of a time (s) and a value, in SI units, shape (n, 2), in order of time.
        error: largest difference of a value from the line between remaining breakpoints, > 0, in
            the SI unit of the values, or as text such as "1 um/s" or "2 N".

    Raises:
        SceneError: an argument is refused.

    Source: D. H. Douglas, T. K. Peucker, Cartographica 10, 112 (1973): a line between two points is
    divided at the point furthest from it.
    """
    check_unmasked("corners", corners)
    try:
        pairs = np.asarray(corners, dtype=float)
    except (TypeError, ValueError):
        pairs = np.empty(0)
    fits = pairs.ndim == 2 and pairs.shape[1] == 2 and len(pairs) and np.isfinite(pairs).all()
    if not fits or (np.diff(pairs[:, 0]) < 0).any():
        shown = f"shape {pairs.shape}" if pairs.size else type(corners).__name__
        raise SceneError("corners", shown, "", "pairs of finite numbers in order of time")
    try:
        error = check_number("error", error, "N", gt=0.0)
    except SceneError:
        error = check_number("error", error, "m/s", gt=0.0, note=" for a speed, or N for a load")
    t, y = pairs.T
    kept = np.append(np.diff(t) == 0, True) | np.append(True, np.diff(t) == 0)
    todo = list(itertools.pairwise(np.flatnonzero(kept).tolist()))
    while todo:
        a, b = todo.pop()
        inside = slice(a, b + 1)
        off = np.abs(y[inside] - np.interp(t[inside], [t[a], t[b]], [y[a], y[b]]))
        if b > a + 1 and off.max() > error:
            n = a + int(np.argmax(off))
            kept[n] = True
            todo += [(a, n), (n, b)]
    return tuple((float(time), float(value)) for time, value in pairs[kept])


@dataclasses.dataclass(frozen=True)
class Protocol(Quantity):
    """Annotation of breakpoints: pairs of a time in s and a value in `unit`."""

    fewer: ClassVar[str] = "; pyfric.thinned(pairs, error) leaves out those that others tell"

    @property
    def _numbers(self) -> tuple[Quantity, Quantity]:
        return Quantity("s", ge=0.0), Quantity(self.unit, **self._limits)

    @property
    def allowed(self) -> str:
        return f"pairs of a time >= 0 s, in order, and {self._numbers[1].allowed}"

    def check(self, value: Any, written: Written | None = None) -> Corners:
        times: list[float] = []

        def corner(pair: Any) -> tuple[float, float]:
            pair = as_list(pair)
            if not isinstance(pair, list | tuple) or len(pair) != 2:
                raise SceneError("", pair, self.unit, self.allowed, "not a pair")
            of_t, of_value = self._numbers
            t = of_t.check(pair[0], written)
            if times and t < times[-1]:
                allowed = f">= {times[-1]!r} s, the time of corner {len(times)}"
                raise SceneError("", t, "s", allowed, "out of order")
            if len(times) > 1 and t == times[-2]:
                raise SceneError("", t, "s", "at most two", "two corners are at this time already")
            times.append(t)
            return t, of_value.check(pair[1], written)

        return _rows(self, ("corner", "pairs"), value, corner)

    def written(self, value: Corners) -> Any:
        time, size = self._numbers
        return [[time.written(t), size.written(y)] for t, y in value]


# --- pushes --------------------------------------------------------------------------------------


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
    """Annotation of pushes: lists of a block, a force, and optionally begin, end and rate."""

    fewer: ClassVar[str] = ""
    unit: str = "N"
    allowed: str = (
        "lists of a block's number, a force in N, and perhaps begin and end in s and a rate in N/s"
    )

    def check(self, value: Any, written: Written | None = None) -> tuple[Push, ...]:
        return _rows(self, ("push", "pushes"), value, lambda entry: self._push(entry, written))

    def _push(self, given: Any, written: Written | None) -> Push:
        given = as_list(given)
        if not isinstance(given, list | tuple) or not 2 <= len(given) <= 5:
            raise SceneError("", given, "N", self.allowed, "not two to five numbers")
        block, *rest = given
        if isinstance(block, float) and block.is_integer():  # from an array
            block = int(block)
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
            [push.block, f"{push.force!r} N", f"{push.begin!r} s"]
            + ([f"{push.end!r} s"] if math.isfinite(push.end) or push.rate else [])
            + ([f"{push.rate!r} N/s"] if push.rate else [])
            for push in value
        ]
