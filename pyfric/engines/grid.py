"""The time grid of a run; breakpoints of a protocol start a new grid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.scene import Scene

ON_GRID = 1e-9
"""Largest distance, over dt, at which a breakpoint of a protocol counts as the end of a step."""


def last_of_run(scene: Scene, state: State, t_end: float) -> int:
    """Return the number of the last step of a run to t_end (s).

    Each breakpoint of a protocol starts a new time grid.
    """
    t0 = state.t0
    for corner in scene.corners:
        if state.t + ON_GRID * state.dt < corner < t_end:
            t0 = corner - last_step(t0, state.dt, corner) * state.dt
    return math.ceil((t_end - t0) / state.dt * (1 - 1e-14))


def last_step(t0: float, dt: float, t: float) -> int:
    """Return the number of the first step that ends at t or later, within rounding."""
    return math.ceil((t - t0) / dt * (1 - 1e-14) - ON_GRID)


def just_after(state: State) -> float:
    """Return a time (s) just after the state. At a breakpoint it lies in the next piece."""
    return state.t + ON_GRID * state.dt


def next_corner(scene: Scene, state: State) -> float:
    """Return the time (s) of the next breakpoint of a protocol, inf if there is none."""
    t = just_after(state)
    return next((corner for corner in scene.corners if corner > t), math.inf)


def piece_ends(scene: Scene, state: State, last: int) -> int:
    """Return the number of the last step, at most `last`, before the next breakpoint."""
    corner = next_corner(scene, state)
    if math.isinf(corner):
        return last
    return min(last, last_step(state.t0, state.dt, corner) - 1)


def at_corner(scene: Scene, state: State) -> bool:
    """Return whether the present step ends at a breakpoint of a protocol."""
    near = ON_GRID * state.dt
    return any(abs(corner - state.t) <= near for corner in scene.corners)
