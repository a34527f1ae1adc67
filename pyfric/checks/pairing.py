"""Which events of two runs are the same, and how far apart they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.record import paired

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["Agreement", "agreement"]


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
