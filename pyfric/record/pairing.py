"""Which events of two runs are the same: pairs in order of time, at the least total cost.

Two events are as far apart as the sum of

    start       |difference of F_T_start|/F_N; left out where a run has no such force
    time        the force over F_N by which the driver loads in the time between their first slips,
                or, where it stands still, that time over the time that is compared
    blocks      1 - the blocks from the first to the last that both have, over those of either

each 0 for equal events, and of the order of 1 for events that have nothing in common.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pyfric.scene import Scene


def paired(a: pd.DataFrame, b: pd.DataFrame, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return rows of two tables of events that belong together, in order.

    Each event of the shorter table has its partner in the longer one.

    Args:
        a, b: tables of events of runs of one scene, or parts of them.
        scene: that scene.

    Returns:
        Rows of a and rows of b, counted from 0, of the same length.
    """
    return in_order(event_distances(a, b, scene))


def event_distances(
    a: pd.DataFrame, b: pd.DataFrame, scene: Scene, span: float | None = None
) -> np.ndarray:
    """Return how far apart the events of two tables are, (len(a), len(b)); see the module.

    `span` is the time that is compared, s; None is that of the last event.
    """
    if span is None:
        span = max((events["t_start"].max() for events in (a, b) if len(events)), default=0.0)
    first, last = (_pairs(name, a, b) for name in ("first_block", "last_block"))
    both = np.minimum(*last) - np.maximum(*first) + 1
    either = np.maximum(*last) - np.minimum(*first) + 1
    apart = 1 - np.maximum(both, 0) / either
    apart += np.nan_to_num(np.abs(np.subtract(*_pairs("F_T_start", a, b)))) / scene.F_N
    return apart + pace(scene, span) * np.abs(np.subtract(*_pairs("t_start", a, b)))


def pace(scene: Scene, span: float) -> float:
    """Return the weight of a difference in time relative to one in forces over F_N, in 1/s."""
    rate = scene.driver.K * scene.driver.fastest / scene.F_N
    return rate if rate or span <= 0 else 1 / span


def _pairs(name: str, a: pd.DataFrame, b: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a column for each pair, (len(a), len(b)) each."""
    return np.broadcast_arrays(a[name].to_numpy(float)[:, None], b[name].to_numpy(float))


def in_order(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pairs, in order, that cover the shorter side at least total cost.

    An event of four blocks in one engine may have three in the other, where it is no main event.
    """
    n, m = cost.shape
    if n > m:
        return in_order(cost.T)[::-1]
    least = np.full((n + 1, m + 1), np.inf)  # of the first rows, among the first columns
    least[0] = 0.0
    for i in range(n):
        least[i + 1, 1:] = np.minimum.accumulate(least[i, :-1] + cost[i])
    chosen, j = np.zeros(n, dtype=int), m
    for i in range(n - 1, -1, -1):
        j = int(np.argmin(least[i, :j] + cost[i, :j]))
        chosen[i] = j
    return np.arange(n), chosen
