"""The front of an event: rupture times of the blocks, and front speed.

Two neighbouring blocks are linked if their first slips in the event are at most ``link_time``
apart. The front is the longest row of linked blocks, the earliest if two are equally long. First
slips outside this row, and all later slips, are left out. Such slips may belong to a second rupture
in the event, or to slip before the front, and would appear as a very slow front.

``link_time`` is 40 l/c_s with c_s = l sqrt(k/(2 m)), the shear speed of the lattice. One pause of
this length gives v_c = 4 l/(40 l/c_s) = 0.1 c_s. One pause cannot be mistaken for a slow front,
v_c < 0.05 c_s. A steady front is followed down to 0.025 c_s. On junctions a front waits while
junctions slip. ``link_time`` is then at least their mean time of slip t_R.

Arrays over blocks run from left to right, times are in s, speeds in m/s.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pyfric.scene import Scene
from pyfric.values import SceneError, check_number, usage

AVERAGED = 4
"""Number of block spacings over which the speed of a front is averaged, as in the paper."""
SLOWEST = 0.1
"""Average speed of a front over c_s across one pause of length ``link_time``. The value is twice
0.05, the limit of slow fronts. A policy."""


def longest_link(scene: Scene) -> float:
    """Return the ``link_time`` of a scene, s: 4 l/(0.1 c_s) = 40 sqrt(2 m/k), or more."""
    of_waves = AVERAGED / SLOWEST * float(np.sqrt(2 * scene.m / scene.slider.k))
    return max(of_waves, scene.law.slowest)


def rupture_front(first_slips: np.ndarray, n_of_i: np.ndarray, link_time: float) -> np.ndarray:
    """Return rupture times of each event's front, as defined at the top of this module.

    Args:
        first_slips: (n_events, N_x) start of each block's first slip in the event, s, NaN for
            blocks that did not slip; columns from left to right.
        n_of_i: (N_x,) block numbers. Of equally long rows, the earliest is the front; of equally
            early rows, the nearest to block 1.
        link_time: largest difference between linked neighbours, s.

    Returns:
        (n_events, N_x), s: ``first_slips`` where the block is in the front, NaN elsewhere.
    """
    order = np.argsort(n_of_i)
    t = np.asarray(first_slips, dtype=float)[:, order]
    n_events, N_x = t.shape
    if n_events == 0:
        return np.empty((0, N_x))
    breaks = np.ones(t.shape, dtype=bool)
    breaks[:, 1:] = ~(np.abs(np.diff(t, axis=1)) <= link_time)  # NaN is never linked
    run = np.cumsum(breaks.ravel()) - 1
    first = np.flatnonzero(breaks.ravel())
    length = np.add.reduceat(np.isfinite(t).ravel().astype(np.int64), first)
    begin = np.fmin.reduceat(t.ravel(), first)
    event = first // N_x
    # longest first, then earliest, then nearest to the trailing edge
    best = np.lexsort((first, begin, -length, event))
    best = best[np.searchsorted(event[best], np.arange(n_events))]
    in_front = run.reshape(t.shape) == best[:, None]
    front = np.empty_like(t)
    front[:, order] = np.where(in_front, t, np.nan)
    return front


@usage("front_speed(record.rupture_times, record.scene.slider.l); analysis.front(record, event)")
def front_speed(rupture_times: np.ndarray, l: float, d: int = 1) -> np.ndarray:
    """Return the front speed at each block over five blocks: v_c(i) = 4 l/(t_{i+2} - t_{i-2}).

    Args:
        rupture_times: (..., N_x), s, columns from left to right.
        l: lattice spacing, m, or text such as "2.5 mm".
        d: +1 for fronts that run to the right (driven from the left), -1 for the left.

    Returns:
        (..., N_x), m/s. NaN within two blocks of either end, and where the five times do not all
        exist or do not strictly increase away from the driven side. In the event table,
        ``n_not_increasing`` counts blocks whose times do not increase.

    Raises:
        SceneError: a record, or times of a library of units, are given, or l is refused.

    Source: the paper, Fig. 4 (v_c as an average over five blocks).

    >>> pyfric.front_speed(np.array([0.0, 1e-6, 2e-6, 3e-6, 4e-6]), l=1e-3)[2].round(6)
    np.float64(1000.0)
    """
    if hasattr(rupture_times, "rupture_times"):
        allowed = (
            "times, shape (..., N_x); analysis.front(record, event) has the speeds of an event"
        )
        raise SceneError("rupture_times", type(rupture_times).__name__, "", allowed)
    names = ("magnitude", *("unit", "units") * isinstance(rupture_times, np.ndarray))
    if any(hasattr(rupture_times, name) for name in names):
        raise SceneError("rupture_times", rupture_times, "s", "plain numbers, in s")
    l = check_number("l", l, "m", gt=0.0)
    t = np.asarray(rupture_times, dtype=float)[..., ::d]
    v_c, half = np.full(t.shape, np.nan), AVERAGED // 2
    if t.shape[-1] > AVERAGED:
        increasing = _all_of(np.diff(t, axis=-1) > 0, AVERAGED)
        span = t[..., AVERAGED:] - t[..., :-AVERAGED]
        nan = np.full(span.shape, np.nan)
        v_c[..., half:-half] = np.divide(AVERAGED * l, span, out=nan, where=increasing)
    return v_c[..., ::d]


def first_slips(joined: Mapping[str, np.ndarray], n_events: int, N_x: int) -> np.ndarray:
    """(n_events, N_x) start of the first slip of each block in each event, s; NaN without slip.

    Slip that began before the log has NaN.

    Args:
        joined: columns of episodes that are part of events, in order of time: row of the event
            (from 0), i, t_start, step_start.
        n_events: number of events.
        N_x: number of columns.
    """
    t = np.full(n_events * N_x, np.nan)
    at, first = np.unique(joined["row"] * N_x + joined["i"], return_index=True)
    t[at] = np.where(joined["step_start"] < 0, np.nan, joined["t_start"])[first]
    return t.reshape(n_events, N_x)


def _all_of(steps: np.ndarray, width: int) -> np.ndarray:
    """True where ``width`` consecutive entries along the last axis are all True."""
    return np.lib.stride_tricks.sliding_window_view(steps, width, axis=-1).all(axis=-1)


def five_known(rupture_times: np.ndarray) -> np.ndarray:
    """(..., N_x) whether times are known at a block and at two blocks on either side."""
    known, half = np.zeros(rupture_times.shape, dtype=bool), AVERAGED // 2
    if rupture_times.shape[-1] > AVERAGED:
        known[..., half:-half] = _all_of(np.isfinite(rupture_times), AVERAGED + 1)
    return known
