"""Data of a run so far: the loading curve, motion at its points, and logs."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.core import Log

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pyfric.record.record import Record


class History:
    """Data of a run so far.

    Args:
        names: columns of the loading curve, of which the first two are t and F_T.

    Attributes:
        motion: arrays over blocks for each point of the curve, if the run records motion.
        parts: parts of the logs, by name.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names, self._points = names, array("d")
        self.motion: list[dict[str, np.ndarray]] = []
        self.parts: dict[str, list[Mapping[str, np.ndarray]]] = {}

    def log(self, **entries: Mapping[str, np.ndarray]) -> None:
        """Add entries to logs, by the name of the log."""
        for name, more in entries.items():
            self.parts.setdefault(name, []).append(more)

    def mark(self) -> tuple[Any, ...]:
        """Return a mark of the present data, to which `back` returns."""
        return self.n, {name: parts[:] for name, parts in self.parts.items()}

    def back(self, mark: tuple[Any, ...]) -> None:
        """Discard the data added since a mark."""
        n, self.parts = mark
        self.cut(n)

    def take(self, before: Record, *, last: bool) -> None:
        """Start from the curve and motion of a record, with or without the last point."""
        self.add(before.curve.reindex(columns=list(self.names)).to_numpy())
        kept = zip(*before.motion.values(), strict=True)
        self.motion = [dict(zip(before.motion, arrays, strict=True)) for arrays in kept]
        self.cut(len(before.curve) - (not last))

    @property
    def n(self) -> int:
        """Number of points of the curve."""
        return len(self._points) // len(self.names)

    @property
    def begin(self) -> float:
        """Time of the first point, in s."""
        return self._points[0]

    @property
    def last(self) -> tuple[float, float]:
        """Time (s) and force of the driver (N) at the last point."""
        t, F_T = self._points[-len(self.names) :][:2]
        return t, F_T

    def add(self, points: np.ndarray) -> None:
        """Add points to the curve, shape (n, number of columns)."""
        self._points.frombytes(np.ascontiguousarray(points, dtype=float).tobytes())

    def cut(self, n: int) -> None:
        """Keep the first n points of the curve."""
        del self._points[n * len(self.names) :], self.motion[n:]

    def points(self) -> np.ndarray:
        """Return the points of the curve, shape (n, number of columns)."""
        return np.array(self._points).reshape(-1, len(self.names))

    def curve(self) -> pd.DataFrame:
        """Return the loading curve."""
        return pd.DataFrame(self.points(), columns=self.names)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the motion as arrays by name, shape (points of the curve, N_x)."""
        names = self.motion[0] if self.motion else ()
        return {name: np.array([at[name] for at in self.motion]) for name in names}

    def logs(self, N_x: int, *more: str) -> dict[str, dict[str, np.ndarray]]:
        """Return the logs "switches", "quiet" and `more` of N_x blocks, joined from parts."""
        empty = Log(N_x, 0, 0)
        for name in ("switches", "quiet", *more):
            parts = self.parts.get(name) or [getattr(empty, name)()]
            self.parts[name] = [_joined(parts)]
        return {name: dict(self.parts[name][0]) for name in ("switches", "quiet", *more)}


def _joined(parts: list[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return the parts of a log as one log, with NaN where a part lacks a column."""
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: np.concatenate([_column(part, name) for part in parts]) for name in names}


def _column(part: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    return part[name] if name in part else np.full(len(part["t"]), np.nan)
