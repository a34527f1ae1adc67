"""Buffers for the logs of the core."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Switching = Literal["step_end", "located"]
POINTS = 512
"""Largest number of points of the loading curve in one call of the core. With this number, calls
take little time compared with steps."""
POINT = 16
"""How many numbers a point of the loading curve has; see `pyfric.core.curve_point`."""


def room_of_step(N_x: int, switching: Switching) -> tuple[int, int]:
    """Return the largest number of switches, and of starts and ends of slip, in one step.

    pyfric_location in Fortran has the same numbers.
    """
    return (8 * N_x + 200, 64) if switching == "located" else (N_x, 1)


class Log:
    """Buffers for switches, starts and ends of slip (see `pyfric.record.episodes`), and the curve.

    With a threshold of speed, the buffers also hold passages of blocks through the threshold, in
    the form of switches, and starts and ends of fast slip.

    Args:
        N_x: number of blocks along the interface.
        switches: room for switches; None means room for many steps.
        quiet: room for starts and ends of slip.
        every: number of steps between two points of the loading curve; 0 means no points.
        threshold: speed above which a block is fast, in m/s; 0 means no threshold.

    Attributes:
        tried: number of steps and sub-steps that the last call computed. Of a rejected step, the
            computed share of the lattice is added.
        block: block at which the last call failed, counted from 0; -1 if it did not fail.
        t: time at which the last call failed, in s.
        fast: shape (2, N_x), int32. Row 0: +1 or -1 for blocks that are fast to the right or left,
            0 for others. Row 1: 1 for blocks that became fast with almost no contact force.
        speeds: velocities of the blocks at the end of the last step, and the largest |sum| of
            velocities since fast slip began, shape (N_x + 1,), in m/s.
    """

    def __init__(
        self,
        N_x: int,
        switches: int | None = None,
        quiet: int = 256,
        every: int = 0,
        threshold: float = 0.0,
    ) -> None:
        switches = 16 * N_x + 1024 if switches is None else switches
        self.N_x, self.tried, self.block, self.t = N_x, 0.0, -1, math.nan
        self.switch_i = np.zeros((4, switches), dtype=np.int32, order="F")
        self.switch_r = np.zeros((4, switches), order="F")
        self.quiet_i = np.zeros((N_x + 1, quiet), dtype=np.int32, order="F")
        self.quiet_r = np.zeros((N_x + 2 + POINT, quiet), order="F")
        self.every, self.threshold = every, threshold
        self.points = np.zeros((POINT, POINTS if every else 0), order="F")
        crossings, bursts = (switches, quiet) if threshold else (1, 1)  # f2py takes no empty arrays
        self.fast, self.speeds = np.zeros((2, N_x), dtype=np.int32), np.zeros(N_x + 1)
        self.crossing_i = np.zeros((4, crossings), dtype=np.int32, order="F")
        self.crossing_r = np.zeros((4, crossings), order="F")
        self.burst_i = np.zeros((N_x + 1, bursts), dtype=np.int32, order="F")
        self.burst_r = np.zeros((N_x + 3 + POINT, bursts), order="F")
        self.n_switch = self.n_quiet = self.n_point = self.n_crossing = self.n_burst = 0

    def switches(self) -> dict[str, np.ndarray]:
        """Return the columns of the log of switches, as copies."""
        return of_blocks(self.switch_i[:, : self.n_switch], self.switch_r[:, : self.n_switch])

    def crossings(self) -> dict[str, np.ndarray]:
        """Return the passages of blocks through the threshold, as copies."""
        n = self.n_crossing
        return of_blocks(self.crossing_i[:, :n], self.crossing_r[:, :n])

    def quiet(self) -> dict[str, np.ndarray]:
        """Return the columns of the log of starts and ends of slip, as copies."""
        i, r = self.quiet_i[:, : self.n_quiet], self.quiet_r[:, : self.n_quiet]
        return of_all(i, r, r[2 + POINT :])

    def bursts(self) -> dict[str, np.ndarray]:
        """Return the starts and ends of fast slip, as copies; sum_v is the largest |sum of v_x|."""
        i, r = self.burst_i[:, : self.n_burst], self.burst_r[:, : self.n_burst]
        return of_all(i, r, r[2 + POINT : -1]) | {"sum_v": r[-1].copy()}

    def points_of(self, what: Literal["quiet", "bursts"]) -> np.ndarray:
        """Return points of the loading curve at the entries of a log, shape (16, n)."""
        quiet = what == "quiet"
        r, n = (self.quiet_r, self.n_quiet) if quiet else (self.burst_r, self.n_burst)
        return r[2 : 2 + POINT, :n].copy()


def of_blocks(i: np.ndarray, r: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a log of single blocks from its integers `i` and numbers `r`."""
    return {
        "step": r[0].astype(np.int64),
        "block": i[0].astype(np.int64),
        "old": i[1].copy(),
        "new": i[2].copy(),
        "corner": i[3].astype(bool),
        "t": r[1].copy(),
        "u_x": r[2].copy(),
        "p": r[3].copy(),
    }


def of_all(i: np.ndarray, r: np.ndarray, u_x: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a log of the interface from integers `i`, numbers `r` and u_x."""
    return {
        "step": r[0].astype(np.int64),
        "t": r[1].copy(),
        "kind": i[0].copy(),
        "F_T": r[2].copy(),
        "u_x": u_x.T.copy(order="C"),
        "mode": i[1:].T.copy(order="C"),
    }
