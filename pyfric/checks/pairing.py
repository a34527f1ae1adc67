"""Which events of two runs are the same, and how far apart they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["Agreement", "agreement", "paired"]


def paired(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pairs, in order, that cover the shorter side at least total cost.

    An event of four blocks in one engine may have three in the other, where it is no main event.
    """
    n, m = cost.shape
    if n > m:
        return paired(cost.T)[::-1]
    least = np.full((n + 1, m + 1), np.inf)  # of the first rows, among the first columns
    least[0] = 0.0
    for i in range(n):
        least[i + 1, 1:] = np.minimum.accumulate(least[i, :-1] + cost[i])
    chosen, j = np.zeros(n, dtype=int), m
    for i in range(n - 1, -1, -1):
        j = int(np.argmin(least[i, :j] + cost[i, :j]))
        chosen[i] = j
    return np.arange(n), chosen


class Agreement(NamedTuple):
    """Largest differences of main events from the trailing edge, in order.

    Attributes:
        events: events compared.
        missing: how many events one of the two has more.
        start, arrest: forces, over F_N.
        blocks: farthest block.
    """

    events: int
    missing: int
    start: float
    arrest: float
    blocks: int


def agreement(record: Record, reference: Record) -> Agreement:
    """Compare the main events of two records that reach the trailing edge, in order.

    Where one has more of them, they are paired by their lengths.
    """
    a, b = (
        one.events[one.events["is_main"] & (one.events["L_p_over_L"] > 0) & one.events["finished"]]
        for one in (record, reference)
    )
    lengths = (one["last_block"].to_numpy(dtype=float) for one in (a, b))
    i, j = paired(np.abs(np.subtract.outer(*lengths)))
    F_N = reference.scene.F_N

    def largest(name: str, unit: float) -> float:
        apart = np.abs(a[name].to_numpy()[i] - b[name].to_numpy()[j])
        return float(np.max(apart, initial=0.0)) / unit

    return Agreement(
        events=len(i),
        missing=abs(len(a) - len(b)),
        start=largest("F_T_start", F_N),
        arrest=largest("F_T_arrest", F_N),
        blocks=int(largest("last_block", 1.0)),
    )
