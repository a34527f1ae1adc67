"""The logs of contact switches, and the slip episodes in them.

An episode is the uninterrupted slip of one block, by contact or by rate (`pyfric.record.rates`). An
episode goes on through a direct reversal (+1 to -1). *Corner episodes*, which engines flag, start
with almost no contact force.

Arrays over blocks run from left to right (index i). Block *numbers* n run from 1 at the trailing
edge, the driven side. Times are in s, lengths in m, forces in N.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.record.held import RecordError, held_in

if TYPE_CHECKING:
    from pyfric.core import State

SWITCH_COLUMNS = {name: held.dtype for name, held in held_in("switches").items() if held.required}
"""Columns of the switch log: one row per change of a block's contact mode, in order of time."""

QUIET_COLUMNS = {name: held.dtype for name, held in held_in("quiet").items() if held.required}
"""Columns of the quiet log: a row for each start (kind +1) and end (kind -1) of slip anywhere,
corner slip left out. ``u_x`` and ``mode`` have a second axis of N_x blocks."""


class LastSlip(NamedTuple):
    """Direction of slip at the end of a log (0 for none), and whether it is corner slip, (N_x,)."""

    mode: np.ndarray
    corner: np.ndarray


def build_episodes(
    log: Mapping[str, np.ndarray],
    n_of_i: np.ndarray,
    *,
    t_begin: float,
    last: State | LastSlip | None,
) -> dict[str, np.ndarray]:
    """Return slip episodes ordered by start, at equal times by step, then by block number.

    Args:
        log: the switch log, with columns of the types of `SWITCH_COLUMNS`.
        n_of_i: (N_x,) block number from the trailing edge of each column.
        t_begin: time at which the log begins, s.
        last: state or slip at the end of the log. A block that slips at the end and is not in the
            log has slipped from t_begin on. If None, such blocks have no episode.

    Returns:
        The columns of the group "episodes" (`pyfric.record.held`) except event. If an episode is
        unfinished, its t_stop, u_x_stop and slip are NaN. If an episode began before the log, its
        u_x_start, slip and p_start are NaN.

    Raises:
        RecordError: successive contact states of a block contradict each other.
    """
    if log["block"].size and (log["block"].min() < 0 or log["block"].max() >= n_of_i.size):
        raise RecordError(f"switch log: block number outside 0...{n_of_i.size - 1}")
    log = _with_earlier_starts(log, t_begin, last)

    order = np.argsort(log["block"], kind="stable")  # block by block, in order of time
    block, old, new = (log[name][order] for name in ("block", "old", "new"))
    start, stop, reversals = _starts_and_stops(block, old, new)
    at_start, at_stop = order[start], order[stop]

    def stopped(name: str, missing: float) -> np.ndarray:
        return np.where(stop >= 0, log[name][at_stop], missing).astype(log[name].dtype)

    u_x_start, u_x_stop = log["u_x"][at_start], stopped("u_x", np.nan)
    table = {
        "n": n_of_i[block[start]],
        "i": block[start],
        "t_start": log["t"][at_start],
        "t_stop": stopped("t", np.nan),
        "step_start": log["step"][at_start],
        "step_stop": stopped("step", -1),
        "u_x_start": u_x_start,
        "u_x_stop": u_x_stop,
        "slip": u_x_stop - u_x_start,
        "direction": new[start],
        "reversals": reversals,
        "corner": log["corner"][at_start],
        "p_start": log["p"][at_start],
    }
    by_time = np.lexsort((table["n"], table["step_start"], table["t_start"]))
    return {name: column[by_time] for name, column in table.items()}


def _starts_and_stops(
    block: np.ndarray, old: np.ndarray, new: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows where episodes start and stop (-1: no stop), and their numbers of reversals."""
    broken = (block[1:] == block[:-1]) & (old[1:] != new[:-1])
    if broken.any():
        i = int(block[1:][broken][0])
        raise RecordError(f"switch log: contact states of block {i} (column) contradict each other")
    was, now = _slips(old), _slips(new)
    edge = np.append(np.flatnonzero(was != now), -1)  # starts and stops alternate within a block
    k = np.flatnonzero(now[edge[:-1]])
    start, stop = edge[k], edge[k + 1]
    stop[block[stop] != block[start]] = -1
    reversed_in = np.cumsum(now & ~was)[was & now & (old != new)] - 1
    return start, stop, np.bincount(reversed_in, minlength=k.size).astype(np.int64)


def _slips(mode: np.ndarray) -> np.ndarray:
    return np.abs(mode) == 1


def _with_earlier_starts(
    log: Mapping[str, np.ndarray], t_begin: float, last: State | LastSlip | None
) -> Mapping[str, np.ndarray]:
    """Add a start of slip at ``t_begin`` for each block that slips when the log begins."""
    blocks, first = np.unique(log["block"], return_index=True)
    slips = _slips(log["old"][first])
    blocks, mode, corner = (of[slips] for of in (blocks, log["old"][first], log["corner"][first]))
    if last is not None:
        never = np.setdiff1d(np.flatnonzero(_slips(last.mode)), log["block"])
        blocks = np.append(blocks, never)
        mode, corner = np.append(mode, last.mode[never]), np.append(corner, last.corner[never])
    if not blocks.size:
        return log
    unknown = np.full(blocks.size, np.nan)
    earlier = {
        "step": np.full(blocks.size, -1),
        "block": blocks,
        "old": np.zeros(blocks.size),
        "new": mode,
        "corner": corner,
        "t": np.full(blocks.size, t_begin),
        "u_x": unknown,
        "p": unknown,
    }
    return {
        key: np.concatenate([earlier[key].astype(kind), log[key]])
        for key, kind in SWITCH_COLUMNS.items()
    }
