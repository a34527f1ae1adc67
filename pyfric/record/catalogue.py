"""From the log of contact switches to slip episodes, events and fronts.

Every engine writes the same two logs and this module alone turns them into a catalogue, so that
engines are compared on one set of definitions:

event
    Non-corner episodes (see `pyfric.record.episodes`) that follow each other within ``t_gap``: a
    new event begins when the next start comes more than ``t_gap`` after the end of all earlier
    slip. Corner episodes are recorded, but neither start, join nor end an event.
slipped region of an event
    Per block: 1 slipped in an episode of the event; 2 only slipped in a corner episode that
    overlaps the event, or is open at its end; 0 neither. L_p/L is the number of consecutive
    non-zero blocks, counted from block 1, divided by N_x.
front of an event
    See `pyfric.record.rupture`.

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

from pyfric.record.episodes import (
    OPEN,
    SWITCH_COLUMNS,
    build_episodes,
    columns_of,
    quiet_columns,
)
from pyfric.record.rupture import (
    count_not_increasing,
    default_link_time,
    first_slips,
    rupture_front,
    shares,
)
from pyfric.statics import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = [
    "EVENT_COLUMNS",
    "MAIN_EVENT_BLOCKS",
    "T_GAP",
    "Catalogue",
    "StaticValues",
    "build_catalogue",
    "static_values",
]

T_GAP = 1e-3
"""Default longest pause inside an event, s."""

MAIN_EVENT_BLOCKS = 4
"""Fewest distinct blocks that slip in a main event."""


class _Solver(Protocol):
    def solve(self, u_x_bottom: np.ndarray, drive: float, **how: Any) -> Any: ...


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
        A record adds nucleation_length, m, where friction weakens with slip alone: the length of
        `pyfric.analysis.nucleations`, NaN where that has none.

    Raises
    ------
    LogError
        If a log lacks a column, is inconsistent, or does not fit the scene.
    """
    if not t_gap >= 0:
        raise ValueError(f"t_gap = {t_gap!r} s: must be at least 0")
    switches = columns_of(switches, SWITCH_COLUMNS, "switch log")
    quiet = quiet_columns(quiet, scene.N_x)
    n_of_i = np.asarray(scene.n_of_i, dtype=np.int64)

    episodes = build_episodes(switches, n_of_i, t_begin=t_begin)
    episodes["event"] = _event_numbers(episodes, t_gap)
    joined = episodes[episodes["event"].to_numpy() >= 0]
    events = _event_table(joined, quiet, t_gap, t_end)
    region = _slipped_region(episodes, events, switches, quiet, scene.N_x)
    if link_time is None:
        link_time = default_link_time(scene)
    times = rupture_front(first_slips(joined, len(events), n_of_i), n_of_i, link_time)
    static = static_values(events, quiet, solver, scene.drive, scene.load_at)

    in_order = np.argsort(n_of_i)
    reached = np.logical_and.accumulate(region[:, in_order] > 0, axis=1).sum(axis=1)
    events["F_T_start"] = static.F_T_start
    events["F_T_arrest"] = static.F_T_arrest
    events["L_p_over_L"] = reached / scene.N_x
    events["x_nucleation"] = (events["nucleation_block"] - 1) * float(scene.slider.l)
    events["n_front"] = np.isfinite(times).sum(axis=1)
    events["n_not_increasing"] = count_not_increasing(times, scene.d)
    events["share_X_c0"], events["share_X_c"] = shares(scene, times, static.p_before)
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


def static_values(
    events: pd.DataFrame,
    quiet: Mapping[str, np.ndarray] | np.ndarray,
    solver: _Solver | None,
    drive: Callable[[float], float],
    load_at: Callable[[float], tuple[float, float] | None] = lambda _: None,
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
    load_at
        F_N and T, N, at a time, s, which `solver.solve` then takes as `load`; None where both are
        those at t = 0.
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
                load = load_at(t[e])
                how = {} if load is None else {"load": load}
                try:
                    rest = solver.solve(u_x[row], drive(t[e]), free=mode[row] == OPEN, **how)
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


def _distinct_blocks(event: np.ndarray, n: np.ndarray) -> np.ndarray:
    """(n_events,) how many different blocks slip in each event, of an event and block per row."""
    blocks = max(n.max(initial=0), 1)
    return np.bincount(np.unique(event * blocks + n - 1) // blocks)


def count_main(episodes: pd.DataFrame, t_gap: float) -> int:
    """Return how many main events the episodes of a run make with a longest pause, in s."""
    event = _event_numbers(episodes, t_gap)
    joins = event >= 0
    blocks = _distinct_blocks(event[joins], episodes["n"].to_numpy()[joins])
    return int((blocks >= MAIN_EVENT_BLOCKS).sum())


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
        "n_blocks": _distinct_blocks(event, n),
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
