"""The catalogue of events of a run, made from its logs of slip.

All engines write two logs of the same form, from which the catalogue is made here. The definitions
below therefore hold for all engines. Logs of slip faster than a threshold also have this form
(`pyfric.record.rates`):

event
    Non-corner episodes (see `pyfric.record.episodes`) with pauses of at most ``t_gap``. A new event
    begins with slip more than ``t_gap`` after the end of all earlier slip. Corner episodes are
    recorded, but belong to no event.
slipped region of an event
    Per block: 1 slipped in an episode of the event; 2 slipped only in a corner episode that
    overlaps the event, or was open during the event; 0 stuck all the time. L_p/L is the number of
    consecutive blocks with 1 or 2, counted from block 1, divided by N_x.
front of an event
    See `pyfric.record.rupture`.

Each column of the table of events, and each array over events and blocks, is one function of a
`Catalogue`. The function may read other columns by name. Its decorator holds unit and meaning.

Arrays over blocks run from left to right. Block *numbers* n run from 1 at the trailing edge, the
driven side. Events are counted from 1. Times are in s, lengths in m, forces in N.
"""

from __future__ import annotations

import functools
import itertools
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.core import OPEN, State
from pyfric.record.data import RecordData
from pyfric.record.episodes import LastSlip, build_episodes
from pyfric.record.growth import nucleation_lengths
from pyfric.record.held import block_array, checked, event_column, found_arrays, held_in, table
from pyfric.record.method import T_GAP
from pyfric.record.rupture import (
    first_slips,
    five_known,
    front_speed,
    longest_link,
    rupture_front,
)
from pyfric.record.zones import RESOLVED, zone_at_rest, zone_moving
from pyfric.scene import Scene
from pyfric.statics import EquilibriumError, StaticSolver

ROUNDED = 1e-9
"""Differences of times below this share of t_gap count as rounding."""

MAIN_EVENT_BLOCKS = 4
"""Smallest number of distinct blocks in a main event, if the interface has as many. A policy."""


class Statics(NamedTuple):
    """Static states: F_T, shape (n,), and tau and p, shape (n, N_x), in N."""

    F_T: np.ndarray
    tau: np.ndarray
    p: np.ndarray

    def at(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Return the states in some rows by name; NaN where a row is -1."""
        return {
            name: np.concatenate([all_, np.full((1, *all_.shape[1:]), np.nan)])[rows]
            for name, all_ in self._asdict().items()
        }


@dataclass(kw_only=True)
class Catalogue:
    """Slip in a run: episodes, events, and arrays over events and blocks.

    ``catalogue[name]`` is a column of events, or an array over events and blocks.

    Attributes:
        slips: columns of the episodes, with the event of each.
        quiet, switches: the logs, as dicts of arrays.
        t_gap: longest pause inside an event, s.
        t_end: time of the end of the run, s; inf if unknown.
        solver: computes static states; None leaves them NaN.
        statics: static states at the rows of the quiet log; None if not given.
    """

    scene: Scene
    slips: Mapping[str, np.ndarray]
    quiet: Mapping[str, np.ndarray]
    switches: Mapping[str, np.ndarray]
    t_gap: float
    t_end: float
    solver: StaticSolver | None
    statics: Statics | None = None
    _found: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def events(self) -> pd.DataFrame:
        """A data frame with a row for each event, counted from 1."""
        return table("events", self.columns)

    @property
    def episodes(self) -> pd.DataFrame:
        """A data frame with a row for each episode, and its event in the column `event`."""
        return table("episodes", self.slips)

    @functools.cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The columns of `events`."""
        held = held_in("events").items()
        return {name: self[name] for name, column in held if column.find and column.required}

    @functools.cached_property
    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays over events and blocks by name, shape (n_events, N_x), blocks from the left."""
        return {name: self[name] for name in found_arrays()}

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._found:
            held = (held_in("events") | found_arrays())[name]
            self._found[name] = held.checked(held.find(self))
        return self._found[name]

    @functools.cached_property
    def joined(self) -> dict[str, np.ndarray]:
        """Columns of the episodes that are part of events, and `row`, the event's row from 0."""
        of_event = self.slips["event"] > 0
        columns = {name: column[of_event] for name, column in self.slips.items()}
        return columns | {"row": columns["event"] - 1}

    @functools.cached_property
    def first(self) -> np.ndarray:
        """(n_events,) first row of each event in `joined`."""
        return np.flatnonzero(np.diff(self.joined["row"], prepend=-1))

    def of_each(self, function: np.ufunc, name: str) -> np.ndarray:
        """Return a reduction, such as np.maximum, of a column of episodes over each event."""
        return function.reduceat(self.joined[name], self.first)

    @functools.cached_property
    def reached(self) -> np.ndarray:
        """(n_events,) number of consecutive blocks from block 1 on that slipped or are open."""
        region = self["region"][:, np.argsort(self.scene.n_of_i)]
        return np.logical_and.accumulate(region > 0, axis=1).sum(axis=1)

    @functools.cached_property
    def front_speed(self) -> np.ndarray:
        """(n_events, N_x) speed of the front at each block, m/s."""
        return front_speed(self["rupture_times"], self.scene.slider.l, self.scene.ahead)

    def force(self, rows: np.ndarray) -> np.ndarray:
        """Return the forces in rows of the quiet log, in N; NaN for row -1."""
        return np.append(self.quiet["F_T"], np.nan)[rows]

    @functools.cached_property
    def static(self) -> dict[str, dict[str, np.ndarray]]:
        """F_T, tau and p (N) of the static states at the "start" and the "stop" of events.

        The bottom row is held at the u_x of the quiet log. Open blocks are free. The driver is at
        its position at this time. The states of all engines are thus without ring-down.
        """
        scene, failed, found = self.scene, [], {}
        rows = {at: self[f"quiet_{at}"] for at in ("start", "stop")}
        if self.statics is not None:
            return {at: self.statics.at(row) for at, row in rows.items()}
        for at in rows:
            tau = np.full((len(rows[at]), scene.N_x), np.nan)
            found[at] = {"F_T": np.full(len(tau), np.nan), "tau": tau, "p": tau.copy()}
        for e, at in itertools.product(range(len(rows["start"])), found):  # in order of time
            row, t = rows[at][e], self[f"t_{at}"][e]
            if row < 0 or not self.solver:
                continue
            load = scene.load_at(t)
            how = {} if load is None else {"load": load}
            u_x, mode = self.quiet["u_x"][row], self.quiet["mode"][row]
            try:
                rest = self.solver.solve(u_x, scene.drive(t), free=mode == OPEN, **how)
            except EquilibriumError as error:
                failed.append(f"t = {t:.6g} s: {error}")
                continue
            for name, values in found[at].items():
                values[e] = getattr(rest, name)
        if failed:
            what = f"{len(failed)} static states of events were not found and are NaN"
            warnings.warn(f"{what}, the first at {failed[0]}", RuntimeWarning, stacklevel=2)
        return found

    def quiet_rows(self, kind: int, steps: np.ndarray) -> np.ndarray:
        """Return rows of the quiet log of a kind at given steps; -1 for steps without a row."""
        rows = np.flatnonzero(self.quiet["kind"] == kind)
        have = self.quiet["step"][rows]
        first, last = (np.searchsorted(have, steps, side) for side in ("left", "right"))
        at = np.append(rows, -1)[first if kind > 0 else last - 1]
        return np.where(last > first, at, -1)


def build_catalogue(
    switches: Mapping[str, np.ndarray],
    quiet: Mapping[str, np.ndarray],
    scene: Scene,
    *,
    t_gap: float = T_GAP,
    t_begin: float = 0.0,
    t_end: float | None = None,
    last: State | LastSlip | None = None,
    solver: StaticSolver | None = None,
    statics: Statics | None = None,
) -> Catalogue:
    """Build the catalogue of a run from its logs.

    Args:
        switches, quiet: the logs, as mappings of columns with the types of `SWITCH_COLUMNS` and
            `QUIET_COLUMNS`.
        scene: gives N_x, the driven side, l, h, V and the lattice's shear speed.
        t_gap: longest pause inside an event, s. The number of events depends on it.
        t_begin: time at which the logs begin, s. Episodes of blocks that already slip begin there.
        t_end: time at which the run ended, s. An event that stopped within ``t_gap`` of t_end is
            not finished, because a later episode could still have joined it.
        last: state at the end of the logs. Blocks that slip in this state but are not in the logs
            have slipped all the time. If `last` is None, such blocks do not count.
        solver: a `StaticSolver` for static forces and stresses; if None, they are NaN.
        statics: static states at the rows of the quiet log. These states replace the solver.

    Returns:
        The catalogue. columns.csv of `Record.to_csv` lists its columns and arrays with unit and
        meaning. If friction weakens with slip alone, a record also has the column
        nucleation_length (m), from `pyfric.analysis.nucleations`.

    Raises:
        RecordError: a log lacks a column, is inconsistent, or does not fit the scene.

    Warns:
        RuntimeWarning: static states were not found.
    """
    if not t_gap >= 0:
        raise ValueError(f"t_gap = {t_gap!r} s: must be at least 0")
    sizes = {"x": scene.N_x}
    switches, quiet = checked("switches", switches, sizes), checked("quiet", quiet, sizes)
    episodes = build_episodes(switches, scene.n_of_i, t_begin=t_begin, last=last)
    episodes["event"] = _event_numbers(episodes, t_gap)
    return Catalogue(
        scene=scene,
        slips=episodes,
        quiet=quiet,
        switches=switches,
        t_gap=t_gap,
        t_end=math.inf if t_end is None else t_end,
        solver=solver,
        statics=statics,
    )


def parts(pause: Any, t_gap: float) -> Any:
    """Whether a pause (s) exceeds t_gap by more than rounding and so separates two events."""
    return pause > t_gap * (1 + ROUNDED)


def _event_numbers(episodes: Mapping[str, np.ndarray], t_gap: float) -> np.ndarray:
    """(n_episodes,) number of the event each episode belongs to, from 1; 0 for corner episodes."""
    joins = ~episodes["corner"]
    start, stop = episodes["t_start"][joins], episodes["t_stop"][joins]
    end_of_all = np.maximum.accumulate(np.where(np.isnan(stop), np.inf, stop))
    begins = np.ones(start.size, dtype=bool)
    begins[1:] = parts(start[1:] - end_of_all[:-1], t_gap)
    event = np.zeros(len(joins), dtype=np.int64)
    event[joins] = np.cumsum(begins)
    return event


def main_blocks(N_x: int) -> int:
    """Return the smallest number of distinct blocks in a main event: four, or N_x if smaller."""
    return min(MAIN_EVENT_BLOCKS, N_x)


def count_main(episodes: Mapping[str, np.ndarray], t_gap: float, N_x: int) -> int:
    """Return the number of main events of the episodes of N_x blocks.

    Args:
        episodes: columns of the episodes.
        t_gap: longest pause inside an event, s.
        N_x: number of blocks.
    """
    event = _event_numbers(episodes, t_gap)
    blocks = _distinct_blocks(event[event > 0] - 1, episodes["n"][event > 0])
    return int((blocks >= main_blocks(N_x)).sum())


def _distinct_blocks(row: np.ndarray, n: np.ndarray) -> np.ndarray:
    """(n_events,) number of distinct blocks in each event, from row and block of each episode."""
    blocks = max(n.max(initial=0), 1)
    return np.bincount(np.unique(row * blocks + n - 1) // blocks)


# --- columns of the table of events --------------------------------------------------------------


@event_column("s", "time of the first slip")
def t_start(of: Catalogue) -> np.ndarray:
    return of.joined["t_start"][of.first]


@event_column("s", "time of the last stick, NaN if slip goes on at the end of the log")
def t_stop(of: Catalogue) -> np.ndarray:
    return of.of_each(np.maximum, "t_stop")


@event_column("s", "time from first slip to last stick")
def duration(of: Catalogue) -> np.ndarray:
    return of["t_stop"] - of["t_start"]


@event_column("N", "tangential force of the static equilibrium at first slip")
def F_T_start(of: Catalogue) -> np.ndarray:
    return of.static["start"]["F_T"]


@event_column("N", "tangential force of the static equilibrium at last stick")
def F_T_arrest(of: Catalogue) -> np.ndarray:
    return of.static["stop"]["F_T"]


@event_column("N", "instantaneous tangential force at first slip")
def F_T_start_inst(of: Catalogue) -> np.ndarray:
    return of.force(of["quiet_start"])


@event_column("N", "instantaneous tangential force at last stick")
def F_T_arrest_inst(of: Catalogue) -> np.ndarray:
    return of.force(of["quiet_stop"])


@event_column("1", "lowest number of a block that slipped, 1 at the trailing edge", int)
def first_block(of: Catalogue) -> np.ndarray:
    return of.of_each(np.minimum, "n")


@event_column("1", "highest number of a block that slipped, 1 at the trailing edge", int)
def last_block(of: Catalogue) -> np.ndarray:
    return of.of_each(np.maximum, "n")


@event_column("1", "length slipped or open from the trailing edge, in blocks over N_x")
def L_p_over_L(of: Catalogue) -> np.ndarray:
    return of.reached / of.scene.N_x


@event_column("1", "number of distinct blocks that slipped", int)
def n_blocks(of: Catalogue) -> np.ndarray:
    return _distinct_blocks(of.joined["row"], of.joined["n"])


@event_column("1", "number of the block that slipped first, 1 at the trailing edge", int)
def nucleation_block(of: Catalogue) -> np.ndarray:
    return of.joined["n"][of.first]


@event_column("m", "distance of the first slip from the trailing edge")
def x_nucleation(of: Catalogue) -> np.ndarray:
    return (of["nucleation_block"] - 1) * float(of.scene.slider.l)


@event_column("1", "number of slip episodes", int)
def n_episodes(of: Catalogue) -> np.ndarray:
    return np.bincount(of.joined["row"], minlength=of.first.size)


@event_column("1", "number of blocks in the front", int)
def n_front(of: Catalogue) -> np.ndarray:
    return np.isfinite(of["rupture_times"]).sum(axis=1)


@event_column("1", "blocks of the front without speed: their five times do not increase", int)
def n_not_increasing(of: Catalogue) -> np.ndarray:
    return (five_known(of["rupture_times"]) & np.isnan(of.front_speed)).sum(axis=1)


@event_column("1", f"share of the front's blocks with X_c0 >= {RESOLVED} l, zone at rest")
def share_X_c0(of: Catalogue) -> np.ndarray:
    return _share_resolved(of["X_c0_over_l"], np.isfinite(of["X_c0_over_l"]))


@event_column(
    "1", f"share of the front's blocks with X_c(v) >= {RESOLVED} l, of those with a speed"
)
def share_X_c(of: Catalogue) -> np.ndarray:
    with_speed = np.isfinite(of.front_speed) & np.isfinite(of["X_c0_over_l"])
    return _share_resolved(of["X_c_over_l"], with_speed)


@event_column("1", "slip has stopped and no later episode can join", bool)
def finished(of: Catalogue) -> np.ndarray:
    return np.isfinite(of["t_stop"]) & (of.t_end - of["t_stop"] > of.t_gap)


@event_column("1", "0 < L_p < L", bool)
def is_precursor(of: Catalogue) -> np.ndarray:
    return (of.reached > 0) & (of.reached < of.scene.N_x)


@event_column("1", f"at least {MAIN_EVENT_BLOCKS} blocks slipped, or all of fewer", bool)
def is_main(of: Catalogue) -> np.ndarray:
    return of["n_blocks"] >= main_blocks(of.scene.N_x)


@event_column("1", "first slip at x <= h + l from the trailing edge", bool)
def at_trailing_edge(of: Catalogue) -> np.ndarray:
    row = 0 if of.scene.driver.side == "top" else of.scene.j_h
    return of["nucleation_block"] - 1 <= row + 1  # exact in block numbers


@event_column("1", "row of the quiet log at first slip, -1 for none", int)
def quiet_start(of: Catalogue) -> np.ndarray:
    return of.quiet_rows(+1, of.joined["step_start"][of.first])


@event_column("1", "row of the quiet log at last stick, -1 for none", int)
def quiet_stop(of: Catalogue) -> np.ndarray:
    steps = np.where(np.isfinite(of["t_stop"]), of.of_each(np.maximum, "step_stop"), -1)
    return of.quiet_rows(-1, steps)


@event_column("m", "length at which stable slip loses stability, by static states", required=False)
def nucleation_length(record: RecordData) -> np.ndarray | None:
    return nucleation_lengths(record)


def _share_resolved(blocks: np.ndarray, of: np.ndarray) -> np.ndarray:
    """(n_events,) share of chosen blocks with `RESOLVED` blocks in the zone; NaN for 0/0."""
    enough, nan = (blocks >= RESOLVED) & of, np.full(len(blocks), np.nan)
    return np.divide(enough.sum(axis=1), of.sum(axis=1), out=nan, where=of.any(axis=1))


# --- arrays over events and blocks ---------------------------------------------------------------


@block_array("1", "1 slipped in the event, 2 corner slip or open in it, 0 neither", np.int8)
def region(of: Catalogue) -> np.ndarray:
    """Corner slip counts if it overlaps the event. Blocks that fit both 1 and 2 have 1.

    A block is open in an event if it is open at the end of the event, or lifts off or lands during
    the event.
    """
    found = np.zeros((of.first.size, of.scene.N_x), dtype=np.int8)
    if len(found) == 0:
        return found
    begin, end = of["t_start"], _or_inf(of["t_stop"])
    corner = of.slips["event"] == 0
    low = np.searchsorted(end, of.slips["t_start"][corner], side="left")
    high = np.searchsorted(begin, _or_inf(of.slips["t_stop"][corner]), side="right")
    overlaps = np.maximum(high - low, 0)  # a corner episode may overlap several events
    within = np.arange(overlaps.sum()) - np.repeat(np.cumsum(overlaps) - overlaps, overlaps)
    found[np.repeat(low, overlaps) + within, np.repeat(of.slips["i"][corner], overlaps)] = 2

    known = of["quiet_stop"] >= 0
    open_at_end = np.zeros(found.shape, dtype=bool)
    open_at_end[known] = of.quiet["mode"][of["quiet_stop"][known]] == OPEN
    if np.isinf(end[-1]):  # an unfinished last event ends with the log
        open_at_end[-1] = _last_modes(of) == OPEN
    found[open_at_end] = 2
    old, new, t = (of.switches[name] for name in ("old", "new", "t"))
    row = np.searchsorted(begin, t, side="right") - 1  # row of the last event that has begun
    within = ((old == OPEN) != (new == OPEN)) & (row >= 0) & (t <= end[row])
    found[row[within], of.switches["block"][within]] = 2
    found[of.joined["row"], of.joined["i"]] = 1
    return found


@block_array("s", "rupture time of the blocks in the front")
def rupture_times(of: Catalogue) -> np.ndarray:
    first = first_slips(of.joined, of.first.size, of.scene.N_x)
    return rupture_front(first, of.scene.n_of_i, longest_link(of.scene))


@block_array("1", "blocks in the cohesive zone of the front, at rest")
def X_c0_over_l(of: Catalogue) -> np.ndarray:
    inside = np.isfinite(of["rupture_times"])
    return np.where(inside, zone_at_rest(of.scene, of["p_before"]), np.nan)


@block_array("1", "blocks in the cohesive zone at the speed of the front, below c_R")
def X_c_over_l(of: Catalogue) -> np.ndarray:
    return zone_moving(of.scene, of["p_before"], of.front_speed)


@block_array("N", "friction force in the static state at first slip")
def tau_before(of: Catalogue) -> np.ndarray:
    return of.static["start"]["tau"]


@block_array("N", "contact force in the static state at first slip")
def p_before(of: Catalogue) -> np.ndarray:
    return of.static["start"]["p"]


@block_array("N", "friction force in the static state at last stick")
def tau_after(of: Catalogue) -> np.ndarray:
    return of.static["stop"]["tau"]


@block_array("N", "contact force in the static state at last stick")
def p_after(of: Catalogue) -> np.ndarray:
    return of.static["stop"]["p"]


def _last_modes(of: Catalogue) -> np.ndarray:
    """(N_x,) contact modes at the end of the logs."""
    modes = of.quiet["mode"][-1].copy() if len(of.quiet["t"]) else np.zeros(of.scene.N_x, int)
    blocks, at = np.unique(of.switches["block"][::-1], return_index=True)
    modes[blocks] = of.switches["new"][::-1][at]
    return modes


def _or_inf(values: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(values), np.inf, values)
