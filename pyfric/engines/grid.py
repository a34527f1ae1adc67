"""The time grid of steps, and breakpoints of protocols on it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyfric.core import State

__all__ = ["ON_GRID", "just_after", "last_step"]

ON_GRID = 1e-9
"""A breakpoint of a protocol this close to the end of a step, over dt, counts as on it."""


def last_step(t0: float, dt: float, t: float) -> int:
    """Return the number of the first step that ends at t or later, within rounding."""
    return math.ceil((t - t0) / dt * (1 - 1e-14) - ON_GRID)


def just_after(state: State) -> float:
    """Return a time (s) just after the state, which selects the next piece of a protocol."""
    return state.t + ON_GRID * state.dt
