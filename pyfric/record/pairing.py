"""Pairs of corresponding events of two runs, in order of time, at the least total distance.

The distance of two events is the sum of

    start       |difference of F_T_start|/F_N; 0 if F_T_start is unknown in a run
    time        loading by the driver between the first slips, over F_N; if the driver stands
                still, the time between first slips over the time that is compared
    blocks      1 - (blocks common to both ranges)/(blocks from the first to the last of either)

Each term is 0 for equal events, and about 1 for events that have nothing in common.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pyfric.scene import Scene


def paired(a: pd.DataFrame, b: pd.DataFrame, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of corresponding events in two tables, in order of time.

    Each event of the shorter table has a partner in the longer table.

    Args:
        a, b: tables of events of two runs of a scene, or parts of these tables.
        scene: the scene.

    Returns:
        Rows of a and rows of b, counted from 0, of the same length.
    """
    return in_order(event_distances(a, b, scene))


def event_distances(
    a: pd.DataFrame, b: pd.DataFrame, scene: Scene, span: float | None = None
) -> np.ndarray:
    """Return the distances of events of two tables, shape (len(a), len(b)); see the module.

    `span` is the time that is compared, s; None means the start of the last event.
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
    """Return the weight of differences in time, in 1/s; differences of F/F_N have the weight 1."""
    rate = scene.driver.K * scene.driver.fastest / scene.F_N
    return rate if rate or span <= 0 else 1 / span


def _pairs(name: str, a: pd.DataFrame, b: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a column for each pair, (len(a), len(b)) each."""
    return np.broadcast_arrays(a[name].to_numpy(float)[:, None], b[name].to_numpy(float))


def in_order(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pairs, in order, with the least total cost.

    Each row has a pair if the matrix has no more rows than columns; otherwise each column has a
    pair.
    """
    n, m = cost.shape
    if n > m:
        return in_order(cost.T)[::-1]
    least = np.full((n + 1, m + 1), np.inf)  # least cost of the first i rows, in j columns
    least[0] = 0.0
    for i in range(n):
        least[i + 1, 1:] = np.minimum.accumulate(least[i, :-1] + cost[i])
    chosen, j = np.zeros(n, dtype=int), m
    for i in range(n - 1, -1, -1):
        j = int(np.argmin(least[i, :j] + cost[i, :j]))
        chosen[i] = j
    return np.arange(n), chosen
