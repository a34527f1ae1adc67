"""From the log of contact switches to slip episodes, events and fronts.

Every engine writes the same two logs and this module alone turns them into a catalogue, so that
engines are compared on one set of definitions:

episode
    One block's uninterrupted slip. A direct reversal (+1 to -1) continues it. Episodes that start
    with almost no contact force are *corner episodes* (flagged by the engine): they are recorded,
    but neither start, join nor end an event.
event
    Non-corner episodes that follow each other within ``t_gap``: a new event begins when the next
    start comes more than ``t_gap`` after the end of all earlier slip.
slipped region of an event
    Per block: 1 slipped in an episode of the event; 2 only slipped in a corner episode that
    overlaps the event, or is open at its end; 0 neither. L_p/L is the number of consecutive
    non-zero blocks, counted from block 1, divided by N_x.
front of an event
    Take each block's first slip in the event. Two neighbouring blocks are linked when these first
    slips are at most ``link_time`` apart. The front is the longest run of linked blocks (the
    earliest one if two are equally long). First slips in other runs, and all later slips, are left
    out: a second rupture merged into the event, or a block that had slipped before the front came,
    would otherwise show up as a very slow front.

The default ``link_time`` is 40 l/c_s with c_s = l sqrt(k/(2 m)), the shear speed of the lattice.
One pause of that length makes v_c = 4 l/(40 l/c_s) = 0.1 c_s, so one pause cannot by itself pass
for a slow front (v_c < 0.05 c_s), while a steady front is followed down to 0.025 c_s.

Arrays over blocks run from left to right (index i). Block *numbers* n run from 1 at the trailing
edge, the driven side. Times are in s, lengths in m, forces in N.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pandas as pd

from pyfric.record.zones import RESOLVED, zone_at_rest, zone_moving
from pyfric.statics import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = [
    "MAIN_EVENT_BLOCKS",
    "QUIET_COLUMNS",
    "SWITCH_COLUMNS",
    "T_GAP",
    "Catalogue",
    "LogError",
    "StaticValues",
    "build_catalogue",
    "build_episodes",
    "default_link_time",
    "front_speed",
    "rupture_front",
    "static_values",
]

T_GAP = 1e-3
"""Default longest pause inside an event, s."""

MAIN_EVENT_BLOCKS = 4
"""Fewest distinct blocks that slip in a main event."""

LINK_LENGTHS = 40.0
"""Default ``link_time`` in units of l/c_s."""

OPEN = 2

SWITCH_COLUMNS = {
    "step": np.int64,
    "block": np.int64,
    "old": np.int32,
    "new": np.int32,
    "corner": np.bool_,
    "t": np.float64,
    "u_x": np.float64,
    "p": np.float64,
}
"""Columns of the switch log: one row per change of a block's contact mode, in order of time."""

QUIET_COLUMNS = {
    "step": np.int64,
    "t": np.float64,
    "kind": np.int32,
    "F_T": np.float64,
    "u_x": np.float64,
    "mode": np.int32,
}
"""Columns of the quiet log: one row whenever the number of slipping non-corner blocks leaves 0
(kind +1) or returns to 0 (kind -1). ``u_x`` and ``mode`` have a second axis of N_x blocks."""


class LogError(ValueError):
    """The switch or quiet log contradicts itself or the scene."""


class _Solver(Protocol):
    def solve(self, u_x_bottom: np.ndarray, drive: float, *, free: np.ndarray) -> Any: ...


@dataclass(frozen=True, kw_only=True)
class StaticValues:
    """Static equilibria at the first slip and the last stick of every event.

    ``F_T_start`` and ``F_T_arrest`` have shape (n_events,), N; the stresses have shape
    (n_events, N_x), N, blocks from left to right. Rows are NaN where the log holds no such state
    (an unfinished event has no arrest).
    """

    F_T_start: np.ndarray
    F_T_arrest: np.ndarray
    tau_before: np.ndarray
    p_before: np.ndarray
    tau_after: np.ndarray
    p_after: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Catalogue:
    """Episodes, events and what belongs to each event.

    ``episodes`` and ``events`` are data frames (columns: `build_episodes`, `build_catalogue`).
    ``region`` (n_events, N_x) int8 is the slipped region, ``rupture_times`` (n_events, N_x) the
    rupture time of each block of the front, s, NaN elsewhere. ``static`` holds the static stresses.
    """

    episodes: pd.DataFrame
    events: pd.DataFrame
    region: np.ndarray
    rupture_times: np.ndarray
    static: StaticValues


def build_catalogue(
    switches: Mapping[str, np.ndarray] | np.ndarray,
    quiet: Mapping[str, np.ndarray] | np.ndarray,
    scene: Scene,
    *,
    t_gap: float = T_GAP,
    t_begin: float = 0.0,
    t_end: float | None = None,
    solver: _Solver | None = None,
    link_time: float | None = None,
) -> Catalogue:
    """Build the catalogue of a run from its logs.

    Parameters
    ----------
    switches, quiet
        The logs, as structured arrays or mappings of columns (`SWITCH_COLUMNS`, `QUIET_COLUMNS`).
    scene
        Gives N_x, the driven side, l, h, V and the lattice's shear speed.
    t_gap
        Longest pause inside an event, s. The number of events depends on it.
    t_begin
        Time at which the logs begin, s. Blocks already slipping then start their episode there.
    t_end
        Time at which the run ended, s. If given, an event that stopped within ``t_gap`` of it is
        not finished, because a later episode could still have joined it.
    solver
        A `StaticSolver` for the static forces and stresses; without it they are NaN.
    link_time
        Largest difference of first slips of neighbouring blocks in one front, s. Default:
        `default_link_time`.

    Returns
    -------
    Catalogue
        The ``events`` columns are t_start, t_stop (NaN if slip goes on at the end of the log) and
        duration, s; F_T_start and F_T_arrest, of the static equilibria, and F_T_start_inst and
        F_T_arrest_inst, instantaneous, N; first_block, last_block and nucleation_block, numbers
        from the trailing edge of blocks in non-corner episodes; x_nucleation, m from the trailing
        edge; L_p_over_L; n_blocks, distinct blocks in non-corner episodes; n_episodes; n_front,
        blocks in the front; n_not_increasing, blocks of the front whose five rupture times exist
        but do not increase (`front_speed` is NaN there); share_X_c0 and share_X_c, how many of the
        front's blocks have at least six blocks in their cohesive zone at rest, and at the speed
        of the front (of those that have one; not at c_R or above), NaN where there are none or no
        static state (see `zones`); finished; is_precursor (0 < L_p < L);
        is_main (n_blocks >= 4); at_trailing_edge (nucleation at x <= h + l); quiet_start and
        quiet_stop, rows of the quiet log at first slip and last stick, -1 where there is none.

    Raises
    ------
    LogError
        If a log lacks a column, is inconsistent, or does not fit the scene.
    """
    if not t_gap >= 0:
        raise ValueError(f"t_gap = {t_gap!r} s: must be at least 0")
    switches = _columns(switches, SWITCH_COLUMNS, "switch log")
    quiet = _quiet_columns(quiet, scene.N_x)
    n_of_i = np.asarray(scene.n_of_i, dtype=np.int64)

    episodes = build_episodes(switches, n_of_i, t_begin=t_begin)
    episodes["event"] = _event_numbers(episodes, t_gap)
    joined = episodes[episodes["event"].to_numpy() >= 0]
    events = _event_table(joined, quiet, t_gap, t_end)
    region = _slipped_region(episodes, events, switches, quiet, scene.N_x)
    if link_time is None:
        link_time = default_link_time(scene)
    times = rupture_front(_first_slips(joined, len(events), n_of_i), n_of_i, link_time)
    static = static_values(events, quiet, solver, scene.drive)

    in_order = np.argsort(n_of_i)
    reached = np.logical_and.accumulate(region[:, in_order] > 0, axis=1).sum(axis=1)
    events["F_T_start"] = static.F_T_start
    events["F_T_arrest"] = static.F_T_arrest
    events["L_p_over_L"] = reached / scene.N_x
    events["x_nucleation"] = (events["nucleation_block"] - 1) * float(scene.slider.l)
    events["n_front"] = np.isfinite(times).sum(axis=1)
    events["n_not_increasing"] = _count_not_increasing(times, scene.d)
    events["share_X_c0"], events["share_X_c"] = _shares(scene, times, static.p_before)
    events["is_precursor"] = (reached > 0) & (reached < scene.N_x)
    events["is_main"] = events["n_blocks"] >= MAIN_EVENT_BLOCKS
    # x <= h + l on the lattice: exact in block numbers
    events["at_trailing_edge"] = events["nucleation_block"] - 1 <= scene.j_h + 1
    return Catalogue(
        episodes=episodes,
        events=events[list(EVENT_COLUMNS)],
        region=region,
        rupture_times=times,
        static=static,
    )


EVENT_COLUMNS = (
    "t_start",
    "t_stop",
    "duration",
    "F_T_start",
    "F_T_arrest",
    "F_T_start_inst",
    "F_T_arrest_inst",
    "first_block",
    "last_block",
    "L_p_over_L",
    "n_blocks",
    "nucleation_block",
    "x_nucleation",
    "n_episodes",
    "n_front",
    "n_not_increasing",
    "share_X_c0",
    "share_X_c",
    "finished",
    "is_precursor",
    "is_main",
    "at_trailing_edge",
    "quiet_start",
    "quiet_stop",
)
"""Columns of the event table, in order."""


def build_episodes(
    switches: Mapping[str, np.ndarray] | np.ndarray, n_of_i: np.ndarray, *, t_begin: float = 0.0
) -> pd.DataFrame:
    """Slip episodes, one row each, ordered by start (ties: by step, then by block number).

    Parameters
    ----------
    switches
        The switch log (`SWITCH_COLUMNS`).
    n_of_i
        (N_x,) block number from the trailing edge of each column.
    t_begin
        Time at which the log begins, s.

    Returns
    -------
    DataFrame
        Columns: n, block number from the trailing edge; i, column from the left, 0-based; t_start,
        t_stop, s; step_start, step_stop, the time steps (-1: before or after the log); u_x_start,
        u_x_stop and slip, their difference, m; direction, +1 (to the right) or -1, at the start;
        reversals, changes of direction; corner; p_start, N. Of an unfinished episode t_stop,
        u_x_stop and slip are NaN; of one that began before the log u_x_start, slip and p_start.

    Raises
    ------
    LogError
        If a block's modes do not follow on from each other.
    """
    n_of_i = np.asarray(n_of_i, dtype=np.int64)
    log = _columns(switches, SWITCH_COLUMNS, "switch log")
    if log["block"].size and (log["block"].min() < 0 or log["block"].max() >= n_of_i.size):
        raise LogError(f"switch log: block outside 0...{n_of_i.size - 1}")
    log = _with_earlier_starts(log, t_begin)

    order = np.argsort(log["block"], kind="stable")  # block by block, in order of time
    block, old, new = (log[name][order] for name in ("block", "old", "new"))
    broken = (block[1:] == block[:-1]) & (old[1:] != new[:-1])
    if broken.any():
        i = int(block[1:][broken][0])
        raise LogError(f"switch log: the modes of block {i} (column) do not follow on")

    was, now = _slips(old), _slips(new)
    edge = np.flatnonzero(was != now)  # starts and stops alternate within a block
    k = np.flatnonzero(now[edge])
    start = edge[k]
    has_stop = np.zeros(k.size, dtype=bool)
    inside = k + 1 < edge.size
    has_stop[inside] = block[edge[k[inside] + 1]] == block[start[inside]]
    stop = np.full(k.size, -1)
    stop[has_stop] = edge[k[has_stop] + 1]
    reversed_in = np.cumsum(now & ~was)[was & now & (old != new)] - 1
    reversals = np.bincount(reversed_in, minlength=k.size).astype(np.int64)

    at_start = order[start]
    at_stop = order[stop[has_stop]]

    def stopped(name: str, missing: float) -> np.ndarray:
        column = np.full(k.size, missing, dtype=log[name].dtype)
        column[has_stop] = log[name][at_stop]
        return column

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
    return pd.DataFrame({name: column[by_time] for name, column in table.items()})


def static_values(
    events: pd.DataFrame,
    quiet: Mapping[str, np.ndarray] | np.ndarray,
    solver: _Solver | None,
    drive: Callable[[float], float],
) -> StaticValues:
    """Static equilibria at the first slip and the last stick of every event.

    The bottom row is held at the u_x of the quiet log, open blocks are free, and the driver stands
    where it is then. The results are free of ring-down and drift, whichever engine wrote the log.

    Parameters
    ----------
    events
        Event table with t_start, t_stop, quiet_start and quiet_stop.
    quiet
        The quiet log (`QUIET_COLUMNS`).
    solver
        ``solver.solve(u_x_bottom, drive, free=mask)`` returns an object with F_T (N) and tau and p
        ((N_x,), N). None leaves every value NaN, and so does an `EquilibriumError`, with a warning.
    drive
        Displacement of the driver, m, at a time, s.
    """
    u_x, mode = np.asarray(quiet["u_x"]), np.asarray(quiet["mode"])
    values, failed = {}, []
    for side, row_name, t_name in (
        ("start", "quiet_start", "t_start"),
        ("stop", "quiet_stop", "t_stop"),
    ):
        rows, t = events[row_name].to_numpy(), events[t_name].to_numpy()
        F_T = np.full(len(events), np.nan)
        tau = np.full((len(events), u_x.shape[1]), np.nan)
        p = tau.copy()
        if solver is not None:
            for e in np.flatnonzero(rows >= 0):
                row = rows[e]
                try:
                    rest = solver.solve(u_x[row], drive(t[e]), free=mode[row] == OPEN)
                except EquilibriumError as error:
                    failed.append((t[e], error))
                    continue
                F_T[e], tau[e], p[e] = rest.F_T, rest.tau, rest.p
        values[side] = F_T, tau, p
    if failed:
        t_first, error = failed[0]
        warnings.warn(
            f"{len(failed)} static states of events were not found and are NaN, the first at "
            f"t = {t_first:.6g} s: {error}",
            RuntimeWarning,
            stacklevel=2,
        )
    (F_T_start, tau_before, p_before), (F_T_arrest, tau_after, p_after) = values.values()
    return StaticValues(
        F_T_start=F_T_start,
        F_T_arrest=F_T_arrest,
        tau_before=tau_before,
        p_before=p_before,
        tau_after=tau_after,
        p_after=p_after,
    )


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


# --- logs ----------------------------------------------------------------------------------------


def _columns(log: Any, columns: Mapping[str, Any], name: str) -> dict[str, np.ndarray]:
    """The log as a dict of arrays with the agreed types."""
    try:
        table = {key: np.asarray(log[key]).astype(kind) for key, kind in columns.items()}
    except (KeyError, ValueError, IndexError) as error:
        raise LogError(f"{name}: needs the columns {', '.join(columns)} ({error})") from error
    if len({column.shape[0] for column in table.values()}) != 1:
        raise LogError(f"{name}: columns of different lengths")
    return table


def _quiet_columns(log: Any, N_x: int) -> dict[str, np.ndarray]:
    table = _columns(log, QUIET_COLUMNS, "quiet log")
    for key in ("u_x", "mode"):
        if table[key].shape != (table["t"].size, N_x):
            raise LogError(f"quiet log: {key} has shape {table[key].shape}, needs (rows, {N_x})")
    return table


def _slips(mode: np.ndarray) -> np.ndarray:
    return np.abs(mode) == 1


def _with_earlier_starts(log: dict[str, np.ndarray], t_begin: float) -> dict[str, np.ndarray]:
    """Add a start at ``t_begin`` for each block whose first switch finds it slipping."""
    _, first = np.unique(log["block"], return_index=True)
    first = first[_slips(log["old"][first])]
    if first.size == 0:
        return log
    earlier = {
        "step": np.full(first.size, -1),
        "block": log["block"][first],
        "old": np.zeros(first.size),
        "new": log["old"][first],
        "corner": log["corner"][first],
        "t": np.full(first.size, t_begin),
        "u_x": np.full(first.size, np.nan),
        "p": np.full(first.size, np.nan),
    }
    return {
        key: np.concatenate([earlier[key].astype(kind), log[key]])
        for key, kind in SWITCH_COLUMNS.items()
    }


# --- events --------------------------------------------------------------------------------------


def _event_numbers(episodes: pd.DataFrame, t_gap: float) -> np.ndarray:
    """(n_episodes,) number of the event each episode belongs to, -1 for corner episodes."""
    joins = ~episodes["corner"].to_numpy()
    start = episodes["t_start"].to_numpy()[joins]
    stop = episodes["t_stop"].to_numpy()[joins]
    end_of_all = np.maximum.accumulate(np.where(np.isnan(stop), np.inf, stop))
    splits = start[1:] - end_of_all[:-1] > t_gap
    event = np.full(len(episodes), -1, dtype=np.int64)
    event[joins] = np.concatenate([np.zeros(min(start.size, 1), np.int64), np.cumsum(splits)])
    return event


def _event_table(
    joined: pd.DataFrame, quiet: dict[str, np.ndarray], t_gap: float, t_end: float | None
) -> pd.DataFrame:
    """Everything about the events that needs only their own episodes (in order of time)."""
    event, n = joined["event"].to_numpy(), joined["n"].to_numpy()
    first = np.flatnonzero(np.diff(event, prepend=-1))
    t_stop = np.maximum.reduceat(joined["t_stop"].to_numpy(), first)  # NaN while one slips
    stopped = np.isfinite(t_stop)
    step_start = joined["step_start"].to_numpy()[first]
    step_stop = np.maximum.reduceat(joined["step_stop"].to_numpy(), first)
    step_stop = np.where(stopped, step_stop, -1)
    quiet_start = _quiet_rows(quiet, +1, step_start)
    quiet_stop = _quiet_rows(quiet, -1, step_stop)
    t_start = joined["t_start"].to_numpy()[first]
    blocks = max(n.max(initial=0), 1)
    distinct = np.unique(event * blocks + n - 1) // blocks  # one entry per event and block
    F_T = np.append(quiet["F_T"], np.nan)  # row -1: no such state
    finished = stopped if t_end is None else stopped & (t_end - t_stop > t_gap)
    table = {
        "t_start": t_start,
        "t_stop": t_stop,
        "duration": t_stop - t_start,
        "F_T_start_inst": F_T[quiet_start],
        "F_T_arrest_inst": F_T[quiet_stop],
        "first_block": np.minimum.reduceat(n, first),
        "last_block": np.maximum.reduceat(n, first),
        "n_blocks": np.bincount(distinct, minlength=first.size),
        "nucleation_block": n[first],
        "n_episodes": np.bincount(event, minlength=first.size),
        "finished": finished,
        "quiet_start": quiet_start,
        "quiet_stop": quiet_stop,
    }
    return pd.DataFrame(table)


def _quiet_rows(quiet: dict[str, np.ndarray], kind: int, steps: np.ndarray) -> np.ndarray:
    """Row of the quiet log with this kind and step, -1 where there is none."""
    rows = np.flatnonzero(quiet["kind"] == kind)
    if rows.size == 0:
        return np.full(steps.shape, -1, dtype=np.int64)
    have = quiet["step"][rows]
    if kind > 0:
        at = np.minimum(np.searchsorted(have, steps, side="left"), rows.size - 1)
    else:
        at = np.maximum(np.searchsorted(have, steps, side="right") - 1, 0)
    return np.where(have[at] == steps, rows[at], -1)


def _slipped_region(
    episodes: pd.DataFrame,
    events: pd.DataFrame,
    switches: dict[str, np.ndarray],
    quiet: dict[str, np.ndarray],
    N_x: int,
) -> np.ndarray:
    """(n_events, N_x) int8: 1 slipped, 2 corner slip or open at the end, 0 neither."""
    region = np.zeros((len(events), N_x), dtype=np.int8)
    if len(events) == 0:
        return region
    event, column = episodes["event"].to_numpy(), episodes["i"].to_numpy()

    corner = episodes[event < 0]
    t_stop = _or_inf(events["t_stop"])
    low = np.searchsorted(t_stop, corner["t_start"].to_numpy(), side="left")
    high = np.searchsorted(events["t_start"].to_numpy(), _or_inf(corner["t_stop"]), side="right")
    overlaps = np.maximum(high - low, 0)  # a corner episode may overlap several events
    within = np.arange(overlaps.sum()) - np.repeat(np.cumsum(overlaps) - overlaps, overlaps)
    region[np.repeat(low, overlaps) + within, np.repeat(corner["i"].to_numpy(), overlaps)] = 2

    row = events["quiet_stop"].to_numpy()
    known = row >= 0
    open_at_end = np.zeros(region.shape, dtype=bool)
    open_at_end[known] = quiet["mode"][row[known]] == OPEN
    if np.isinf(t_stop[-1]):  # only the last event can be unfinished: it ends with the log
        open_at_end[-1] = _last_modes(switches, quiet, N_x) == OPEN
    region[open_at_end] = 2
    region[event[event >= 0], column[event >= 0]] = 1
    return region


def _last_modes(
    switches: dict[str, np.ndarray], quiet: dict[str, np.ndarray], N_x: int
) -> np.ndarray:
    """(N_x,) contact modes at the end of the logs."""
    modes = quiet["mode"][-1].copy() if quiet["t"].size else np.zeros(N_x, dtype=np.int32)
    blocks, at = np.unique(switches["block"][::-1], return_index=True)
    modes[blocks] = switches["new"][::-1][at]
    return modes


def _or_inf(column: pd.Series) -> np.ndarray:
    values = column.to_numpy()
    return np.where(np.isnan(values), np.inf, values)


# --- fronts --------------------------------------------------------------------------------------


def _first_slips(joined: pd.DataFrame, n_events: int, n_of_i: np.ndarray) -> np.ndarray:
    """(n_events, N_x) start of the first slip of each block in each event, s, NaN where none."""
    t = np.full(n_events * n_of_i.size, np.nan)
    key = joined["event"].to_numpy() * n_of_i.size + joined["i"].to_numpy()
    key, first = np.unique(key, return_index=True)
    t[key] = joined["t_start"].to_numpy()[first]
    return t.reshape(n_events, n_of_i.size)


def _five(steps: np.ndarray, width: int) -> np.ndarray:
    """True where ``width`` consecutive entries along the last axis are all True."""
    return np.lib.stride_tricks.sliding_window_view(steps, width, axis=-1).all(axis=-1)


def _count_not_increasing(rupture_times: np.ndarray, d: int) -> np.ndarray:
    """(n_events,) blocks with five rupture times that do not strictly increase."""
    if rupture_times.shape[1] < 5:
        return np.zeros(rupture_times.shape[0], dtype=np.int64)
    five_exist = _five(np.isfinite(rupture_times), 5).sum(axis=1)
    return five_exist - np.isfinite(front_speed(rupture_times, 1.0, d)).sum(axis=1)


def _shares(scene: Scene, times: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n_events,) shares of each front's blocks with `RESOLVED` blocks in X_c0, and in X_c(v)."""
    v, inside = front_speed(times, scene.slider.l, scene.d), np.isfinite(times)
    at_rest = np.where(inside, zone_at_rest(scene, p), np.nan)
    known = np.isfinite(at_rest), np.isfinite(at_rest) & np.isfinite(v)
    enough = at_rest >= RESOLVED, zone_moving(scene, p, v) >= RESOLVED
    return tuple(
        np.divide(e.sum(axis=1), k.sum(axis=1), out=np.full(len(p), np.nan), where=k.any(axis=1))
        for e, k in zip(enough, known, strict=True)
    )
