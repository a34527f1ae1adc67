"""What a run has recorded so far: the loading curve, motion at its points, and the two logs."""

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
    """What a run has recorded so far.

    Args:
        names: columns of the loading curve, first t and F_T.

    Attributes:
        motion: arrays over blocks for each point of the curve, if the law records motion.
        switches, quiet: parts of the two logs.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names, self._points = names, array("d")
        self.motion: list[dict[str, np.ndarray]] = []
        self.switches: list[Mapping[str, np.ndarray]] = []
        self.quiet: list[Mapping[str, np.ndarray]] = []

    def log(self, switches: Mapping[str, np.ndarray], quiet: Mapping[str, np.ndarray]) -> None:
        """Add entries to the two logs."""
        self.switches.append(switches)
        self.quiet.append(quiet)

    def mark(self) -> tuple[Any, ...]:
        """Return what `back` needs to forget all that is recorded from now on."""
        return self.n, self.switches[:], self.quiet[:]

    def back(self, mark: tuple[Any, ...]) -> None:
        """Forget what was recorded since a mark was made."""
        n, self.switches, self.quiet = mark
        self.cut(n)

    def take(self, before: Record, *, last: bool) -> None:
        """Take over the curve and motion of a record, with or without its last point."""
        self.add(before.curve.to_numpy())
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

    def curve(self) -> pd.DataFrame:
        """Return the loading curve."""
        points = np.array(self._points).reshape(-1, len(self.names))
        return pd.DataFrame(points, columns=self.names)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the motion, arrays (points of the curve, N_x) by name."""
        names = self.motion[0] if self.motion else ()
        return {name: np.array([at[name] for at in self.motion]) for name in names}

    def logs(self, N_x: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Return the two logs, of N_x blocks, each in one part."""
        if not self.switches:
            empty = Log(N_x, 0, 0)
            return empty.switches(), empty.quiet()
        switches, quiet = _joined(self.switches), _joined(self.quiet)
        self.switches, self.quiet = [switches], [quiet]
        return switches, quiet


def _joined(parts: list[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
