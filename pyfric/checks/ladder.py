"""The quasi-static sequence against full dynamics: precursors by length and force."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from pyfric.checks.check import Check, largest
from pyfric.record import paired
from pyfric.scene import Scene

__all__ = ["LADDER", "Ladder", "ladder_at_given_length", "ladder_event_by_event"]

LADDER = 0.03
"""Forces of the quasi-static sequence, over F_N: it has no inertia, so that nothing overshoots."""
NO_INERTIA = "no inertia: nothing overshoots, and steps are a little shorter"


class Ladder(NamedTuple):
    """Main precursors from the trailing edge: lengths in blocks, forces over F_N; their table."""

    length: np.ndarray
    start: np.ndarray
    arrest: np.ndarray
    events: pd.DataFrame
    scene: Scene

    @classmethod
    def of(cls, events: pd.DataFrame, scene: Scene) -> Ladder:
        """Return the precursors before the first system-size event.

        The length is the farthest block: L_p is 0 where a corner block that hardly carries load did
        not move.
        """
        main = events[events["is_main"] & events["at_trailing_edge"]]
        main = main[(main["last_block"] == scene.N_x).cumsum() == 0]
        forces = main[["F_T_start", "F_T_arrest"]].to_numpy().T / scene.F_N
        return cls(main["last_block"].to_numpy(), *forces, main, scene)


def ladder_event_by_event(
    a: Ladder, b: Ladder, blocks: int, last: int | None = None
) -> list[Check]:
    """Compare a ladder b with a, each event of a with one of b; b may have one more.

    Args:
        a: of full dynamics.
        b: of the quasi-static engine, in the same geometry.
        blocks: tolerance of lengths.
        last: tolerance of the last, longest one; None means the same.
    """
    more = len(b.length) - len(a.length)
    if more < 0:
        return [_check("missing precursors", math.nan, 0)]
    _, k = paired(a.events, b.events, a.scene)
    off = np.abs(b.length[k] - a.length)
    return [
        _check("precursors more", more, 1),
        _check("lengths, blocks", largest(off[:-1]), blocks),
        _check("longest precursor, blocks", off[-1], last or blocks),
        _check("start, over F_N", largest(b.start[k] - a.start), LADDER),
        _check("arrest, over F_N", largest(b.arrest[k] - a.arrest), LADDER),
    ]


def ladder_at_given_length(a: Ladder, b: Ladder) -> list[Check]:
    """Compare the forces at which precursors of a length start and stop, where both have some."""
    common = (a.length >= b.length[0]) & (a.length <= b.length[-1])
    checks = [
        _check("lengths that do not grow", (np.diff(b.length) <= 0).sum(), 0),
        _check("precursors out of range", (~common).sum(), 2),
    ]
    for force in ("start", "arrest"):
        at_length = np.interp(a.length[common], b.length, getattr(b, force))
        error = largest(at_length - getattr(a, force)[common])
        checks.append(_check(f"{force} at given length, over F_N", error, LADDER))
    return checks


def _check(what: str, value: float, tolerance: float) -> Check:
    return Check(f"quasi-static: {what}", value, tolerance, why=NO_INERTIA)
