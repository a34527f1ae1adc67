"""Where slip loses stability: the nucleation of events with friction that weakens over a length.

From the state of rest before an event, stable slip is followed as static states
(`pyfric.statics.creep`) until none is near: an eigenvalue of the slipping part has passed zero, or
a block that would have to slip lets it pass. The extent of the blocks that slip then is the
nucleation length. It follows from statics alone, whichever engine made the record.

For a long interface in an infinite body and linear weakening the length does not depend on how the
load is spread: 2 h_n = 1.158 mu* /W with mu* = E'/2 and W = (mu_s - mu_k) p/D_c, two bodies.

Source: K. Uenishi and J. R. Rice, J. Geophys. Res. 108, 2042 (2003).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.core import OPEN
from pyfric.record.griffith import condensed
from pyfric.scene import SceneError
from pyfric.statics import LARGE, ContactProblem, Creep, EquilibriumError, creeps

if TYPE_CHECKING:
    from pyfric.record.record import Record


def nucleations(record: Record) -> pd.DataFrame:
    """Return where the events of a record lose stability; see the module.

    Args:
        record: a run; finite geometry is treated as linear.

    Returns:
        One row for each event before which all blocks are stuck. Columns: event; t (s) and F_T (N)
        at the end of stable slip; first_block, last_block and n_blocks of the blocks that slip
        then, counted from the trailing edge; length (m) from first to last block. NaN and 0 if slip
        stays stable, if the driver does not move on, or if loads differ from those at t = 0.

    Raises:
        SceneError: friction does not weaken over a length, or depends on more than slip.
    """
    scene = record.scene
    if not creeps(scene.law):
        raise SceneError(
            "interface.d_c", scene.interface.d_c, "m", "> 0, and a law of slip alone",
            "slip does not lose stability",
        )  # fmt: skip
    problem, begin = condensed(record)
    rows = []
    for event, row in record.events["quiet_start"].items():
        if row >= 0:
            t = float(record.events["t_start"].loc[event])
            rows.append({"event": event} | _nucleation(problem, record, int(row), begin, t))
    names = ["event", "t", "F_T", "first_block", "last_block", "n_blocks", "length"]
    return pd.DataFrame(rows, columns=names)


def nucleation_lengths(record: Record) -> np.ndarray | None:
    """Return `length` of `nucleations` for each event, (n_events,), in m; NaN where there is none.

    None where friction does not weaken with slip alone, where no static states are known, and on
    lattices of more than `LARGE` unknowns, for which it takes too long to be done unasked.
    """
    scene = record.scene
    if not creeps(scene.law) or not scene.has_rests or 2 * scene.N_x * scene.N_z > LARGE:
        return None
    lengths = np.full(len(record.events), np.nan)
    if len(lengths):
        table = nucleations(record)
        lengths[table["event"].to_numpy(dtype=int) - 1] = table["length"]
    return lengths


def _nucleation(
    problem: ContactProblem, record: Record, row: int, begin: float, t: float
) -> dict[str, float]:
    """Return one row of `nucleations`."""
    scene, none = record.scene, np.zeros(record.scene.N_x)
    u_x, mode = (record.quiet[name][row] for name in ("u_x", "mode"))
    creep = Creep(problem, u_x, none, mode != OPEN, none)
    none = dict.fromkeys(("t", "F_T", "first_block", "last_block"), np.nan)
    none |= {"n_blocks": 0, "length": np.nan}
    legs = scene.legs(float(record.curve["t"].iloc[-1]))
    leg = next(one for one in reversed(legs) if one.t <= t)
    if leg.way < 1 or scene.load_at(t) != scene.load_at(0.0):
        return none
    near = max(scene.drive(t) - ROUNDING * abs(scene.drive(t)), leg.first)
    try:
        path, changes = creep.nucleate(begin + near, begin + leg.last)
    except EquilibriumError:  # nothing is left that carries the slider
        return none
    n = np.sort(scene.n_of_i[creep.way != 0])
    if changes[-1].what != "unstable" or not path or not n.size:
        return none
    return {
        "t": leg.time_at(path[-1].drive - begin),
        "F_T": path[-1].F_T,
        "first_block": int(n[0]),
        "last_block": int(n[-1]),
        "n_blocks": n.size,
        "length": (n[-1] - n[0] + 1) * scene.slider.l,
    }


ROUNDING = 1e-9
"""An event is followed from this share of the driver's way before its first slip (rounding: the way
is known to 1e-16 of itself, and what follows from it to a hundred thousand times that)."""
