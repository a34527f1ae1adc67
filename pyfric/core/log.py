"""Buffers for the logs of the core."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Switching = Literal["step_end", "located"]
POINTS = 512
"""Room for points of the loading curve: so many that calls take little of the time."""


def room_of_step(N_x: int, switching: Switching) -> tuple[int, int]:
    """Return the largest numbers of switches and of starts and ends of slip in one step.

    They are those of pyfric_location.
    """
    return (8 * N_x + 200, 64) if switching == "located" else (N_x, 1)


class Log:
    """Buffers for switches, starts and ends of slip (see `pyfric.record.episodes`), and the curve.

    Args:
        N_x: number of blocks along the interface.
        switches: room for switches; None means enough for many steps.
        quiet: room for starts and ends of slip.
        every: number of steps between two points of the loading curve; 0: none is kept.

    Attributes:
        tried: number of steps and sub-steps that the last call computed. A step that RK4 rejected
            counts by the share of the lattice that was computed.
        block: block at which the last call failed, counted from 0; -1 if it did not fail.
        t: time at which the last call failed, in s.
    """

    def __init__(
        self, N_x: int, switches: int | None = None, quiet: int = 256, every: int = 0
    ) -> None:
        switches = 16 * N_x + 1024 if switches is None else switches
        self.N_x, self.tried, self.block, self.t = N_x, 0.0, -1, math.nan
        self.switch_i = np.zeros((4, switches), dtype=np.int32, order="F")
        self.switch_r = np.zeros((4, switches), order="F")
        self.quiet_i = np.zeros((N_x + 1, quiet), dtype=np.int32, order="F")
        self.quiet_r = np.zeros((N_x + 3, quiet), order="F")
        self.every = every
        self.points = np.zeros((15, POINTS if every else 0), order="F")
        self.n_switch = self.n_quiet = self.n_point = 0

    def switches(self) -> dict[str, np.ndarray]:
        """Return the columns of the switch log, as copies."""
        i, r = self.switch_i[:, : self.n_switch], self.switch_r[:, : self.n_switch]
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

    def quiet(self) -> dict[str, np.ndarray]:
        """Return the columns of the quiet log, as copies."""
        i, r = self.quiet_i[:, : self.n_quiet], self.quiet_r[:, : self.n_quiet]
        return {
            "step": r[0].astype(np.int64),
            "t": r[1].copy(),
            "kind": i[0].copy(),
            "F_T": r[2].copy(),
            "u_x": r[3:].T.copy(order="C"),
            "mode": i[1:].T.copy(order="C"),
        }
