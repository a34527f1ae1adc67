"""The front of an event: when it reached each block, and how fast it was.

Take each block's first slip in the event. Two neighbouring blocks are linked when these first slips
are at most ``link_time`` apart. The front is the longest run of linked blocks (the earliest one if
two are equally long). First slips in other runs, and all later slips, are left out: a second
rupture merged into the event, or a block that had slipped before the front came, would otherwise
show up as a very slow front.

The default ``link_time`` is 40 l/c_s with c_s = l sqrt(k/(2 m)), the shear speed of the lattice.
One pause of that length makes v_c = 4 l/(40 l/c_s) = 0.1 c_s, so one pause cannot by itself pass
for a slow front (v_c < 0.05 c_s), while a steady front is followed down to 0.025 c_s.

Arrays over blocks run from left to right, times are in s, speeds in m/s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric.record.zones import RESOLVED, zone_at_rest, zone_moving

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.scene import Scene

__all__ = [
    "count_not_increasing",
    "default_link_time",
    "first_slips",
    "front_speed",
    "rupture_front",
    "shares",
]

LINK_LENGTHS = 40.0
"""Default ``link_time`` in units of l/c_s."""


def default_link_time(scene: Scene) -> float:
    """Default ``link_time`` of a front, s: 40 l/c_s = 40 sqrt(2 m/k)."""
    return LINK_LENGTHS * float(np.sqrt(2 * scene.m / scene.slider.k))


def rupture_front(first_slips: np.ndarray, n_of_i: np.ndarray, link_time: float) -> np.ndarray:
    """Rupture times of each event's front (definition at the top of this module).

    Parameters
    ----------
    first_slips
        (n_events, N_x) start of each block's first slip in the event, s, NaN for blocks that did
        not slip; columns from left to right.
    n_of_i
        (N_x,) block numbers; equal candidates are told apart by time, then by block number.
    link_time
        Largest difference between linked neighbours, s.

    Returns
    -------
    ndarray
        (n_events, N_x), s: ``first_slips`` where the block belongs to the front, NaN elsewhere.
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


def front_speed(rupture_times: np.ndarray, l: float, d: int = 1) -> np.ndarray:
    """Front speed at each block, averaged over five blocks: v_c(i) = 4 l/(t_{i+2} - t_{i-2}).

    Parameters
    ----------
    rupture_times
        (..., N_x) rupture times, s, columns from left to right.
    l
        Lattice spacing, m.
    d
        +1 for fronts that run to the right (driven from the left), -1 for the left.

    Returns
    -------
    ndarray
        (..., N_x), m/s. NaN at two blocks from either end, and where the five times do not all
        exist or do not strictly increase away from the driven side. The event table counts the
        latter as ``n_not_increasing``.

    Source: the paper, Fig. 4 (v_c as an average over five blocks).

    >>> pyfric.front_speed(np.array([0.0, 1e-6, 2e-6, 3e-6, 4e-6]), l=1e-3)[2].round(6)
    np.float64(1000.0)
    """
    t = np.asarray(rupture_times, dtype=float)[..., ::d]
    v_c = np.full(t.shape, np.nan)
    if t.shape[-1] >= 5:
        increasing = _five(np.diff(t, axis=-1) > 0, 4)
        span = t[..., 4:] - t[..., :-4]
        v_c[..., 2:-2] = np.divide(4 * l, span, out=np.full(span.shape, np.nan), where=increasing)
    return v_c[..., ::d]


def first_slips(joined: pd.DataFrame, n_events: int, n_of_i: np.ndarray) -> np.ndarray:
    """(n_events, N_x) start of the first slip of each block in each event, s, NaN where none."""
    t = np.full(n_events * n_of_i.size, np.nan)
    key = joined["event"].to_numpy() * n_of_i.size + joined["i"].to_numpy()
    key, first = np.unique(key, return_index=True)
    t[key] = joined["t_start"].to_numpy()[first]
    return t.reshape(n_events, n_of_i.size)


def _five(steps: np.ndarray, width: int) -> np.ndarray:
    """True where ``width`` consecutive entries along the last axis are all True."""
    return np.lib.stride_tricks.sliding_window_view(steps, width, axis=-1).all(axis=-1)


def count_not_increasing(rupture_times: np.ndarray, d: int) -> np.ndarray:
    """(n_events,) blocks with five rupture times that do not strictly increase."""
    if rupture_times.shape[1] < 5:
        return np.zeros(rupture_times.shape[0], dtype=np.int64)
    five_exist = _five(np.isfinite(rupture_times), 5).sum(axis=1)
    return five_exist - np.isfinite(front_speed(rupture_times, 1.0, d)).sum(axis=1)


def shares(scene: Scene, times: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n_events,) shares of each front's blocks with `RESOLVED` blocks in X_c0, and in X_c(v)."""
    v, inside = front_speed(times, scene.slider.l, scene.d), np.isfinite(times)
    at_rest = np.where(inside, zone_at_rest(scene, p), np.nan)
    known = np.isfinite(at_rest), np.isfinite(at_rest) & np.isfinite(v)
    enough = at_rest >= RESOLVED, zone_moving(scene, p, v) >= RESOLVED
    return tuple(
        np.divide(e.sum(axis=1), k.sum(axis=1), out=np.full(len(p), np.nan), where=k.any(axis=1))
        for e, k in zip(enough, known, strict=True)
    )
