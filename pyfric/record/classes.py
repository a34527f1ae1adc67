"""Classes of rupture: how a front ends, which blocks stick behind it, and how fast it is.

The definitions are pyfric's own. Blocks are counted from 1 at the trailing edge to N.

kind
    nothing slipped: the run has no event.
    arrested: the event ends before block N slips: all blocks are stuck or open, or creep to rest.
    alternating: block N slips, and some block n >= 5 sticks before block n + 1 slips.
    pulse: when block N first slips, some block behind it is stuck.
    crack: when block N first slips, all other blocks slip or are open.
    unfinished: none of these kinds at the end of the run.
pace, of fronts that reach block N
    slow: v < `slow` times the limit; `slow` is 0.1 by default.
    sub-Rayleigh: slower than the limit: c in a chain, c_R in two dimensions.
    beyond c_R: between c_R and c_S, in two dimensions.
    supershear: faster than c in a chain, than c_S in two dimensions.

v is the mean speed over the last quarter of the blocks. c = l sqrt(k/m). c_R and c_S are speeds of
long waves in the lattice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import OPEN, State
from pyfric.record.data import RecordData
from pyfric.record.zones import pace_limits
from pyfric.scene import Scene
from pyfric.values import check_number

FROM_BLOCK = 5
"""First block n that is checked for stick before block n + 1 slips. A policy."""
SLOW = 0.1
"""Default speed below which a front is slow, over c in a chain, over c_R in two dimensions."""
LAST = 0.25
"""Share of the blocks, up to the last block, over which the speed is averaged. A policy."""


NOTHING = "nothing slipped"
"""Kind and pace of a run without events."""


class RuptureClass(NamedTuple):
    """Kind and pace of a front, its speed (m/s), and the last block that it reached."""

    kind: str
    pace: str
    speed: float
    reached: int

    def __str__(self) -> str:
        return " ".join(dict.fromkeys(word for word in (self.pace, self.kind) if word))


def creeps_to_rest(
    scene: Scene, state: State, accelerations: Callable[[], np.ndarray], more: float = 0.0
) -> bool:
    """Return whether all slip comes to rest by itself and no other block starts to slip.

    The result is True if the forces that motion can still add are smaller than the margin against
    slip of every block in contact. These forces are viscous friction alpha v, inertia m a, and
    sqrt(12 k E), the largest force that the kinetic energy E can add on a block held by a stiffness
    of 6 k. The result is False under a law whose margins (`Law.margin`) are no forces.

    Args:
        state: state with blocks in motion.
        accelerations: function that returns accelerations of blocks, (N_z, 2, N_x), in m/s^2.
        more: force that the driver adds, in N.
    """
    if scene.law.margin.unit != "N":  # the margins against slip are no forces
        return False
    weakest = float(state.margin[state.mode != OPEN].min(initial=math.inf))
    v, slips = np.abs(state.y[0, 2]), np.abs(state.mode) == 1
    held = float(np.broadcast_to(scene.law.alpha, v.shape)[slips] @ v[slips])
    if not held + more < weakest:
        return False
    rows, columns = scene.shares
    masses = scene.m * rows[:, None, None] * columns
    E = float((masses * state.y[:, 2:] ** 2).sum()) / 2
    loose = float((masses * np.abs(accelerations())).sum())
    return held + loose + math.sqrt(12 * scene.slider.k * E) + more < weakest


def rupture_class(record: RecordData, event: int | None = None, slow: float = SLOW) -> RuptureClass:
    """Return the class of the rupture of an event; see `pyfric.record.classes`.

    Args:
        event: number of the event, from 1; None means the event in which the most blocks slip.
            Without events the class is "nothing slipped".
        slow: speed below which a front is slow, over c in a chain, over c_R in two dimensions.

    Raises:
        SceneError: there is no such event.
    """
    slow = check_number("slow", slow, "", gt=0.0, lt=1.0)
    events, scene = record.columns("events"), record.scene
    if event is None and not len(events["t_start"]):
        return RuptureClass(NOTHING, NOTHING, math.nan, 0)
    if event is None:
        event = int(np.argmax(events["n_blocks"])) + 1
    row, slips = record.row(event), record.columns("episodes")
    of_event = slips["event"] == event
    n, start, end = (slips[name][of_event] for name in ("n", "t_start", "t_stop"))
    blocks, first = np.unique(n, return_index=True)
    t, stop = np.full(scene.N_x, np.nan), np.full(scene.N_x, np.nan)
    t[blocks - 1], stop[blocks - 1] = start[first], end[first]
    reached = int(blocks[-1])
    if reached < scene.N_x:
        ended = bool(events["finished"][row]) or _at_rest(record)
        return RuptureClass("arrested" if ended else "unfinished", "", math.nan, reached)
    before = start <= t[-1]
    kind, v = _kind(t, stop, n[before], end[before]), _speed(t, scene)
    return RuptureClass(kind, _pace(v, slow, scene), v, reached)


def _at_rest(record: RecordData) -> bool:
    """Whether a run ends at rest, or in slip that creeps to rest."""
    if record.status.startswith("ended by stop_when (a"):
        return True
    state, scene = record.final_state, record.scene
    if state is None or not (np.abs(state.mode) == 1).any():
        return True
    model = core.model(scene, record.method.geometry, state.u_drv0, state.t)
    return creeps_to_rest(scene, state, lambda: core.evaluate(model, state, state.t).a)


def _kind(t: np.ndarray, stop: np.ndarray, n: np.ndarray, end: np.ndarray) -> str:
    """Return the kind of a front that reached the last block.

    Args:
        t, stop: start and end of the first episode of each block, shape (N_x,), in s.
        n, end: block and end (s) of the episodes that began before the last block slipped, in order
            of time.
    """
    after = slice(FROM_BLOCK - 1, None)
    if (stop[:-1][after] < t[1:][after]).any():
        return "alternating"
    blocks, last = np.unique(n[::-1], return_index=True)
    stuck = (end[::-1][last] <= t[-1]) & (blocks < len(t))
    return "pulse" if stuck.any() else "crack"


def _speed(t: np.ndarray, scene: Scene) -> float:
    """Return the mean speed over the last blocks, in m/s; NaN if the front does not advance."""
    n = math.floor(len(t) * (1 - LAST))
    lasts = t[-1] - t[n - 1]
    return (len(t) - n) * scene.slider.l / lasts if lasts > 0 else math.nan


def _pace(v: float, slow: float, scene: Scene) -> str:
    limit, shear = pace_limits(scene)
    if not v > 0:
        return ""
    if v < slow * limit:
        return "slow"
    if v <= limit:
        return "sub-Rayleigh"
    return "supershear" if v > shear else "beyond c_R"
