"""Damages: runs shuffled, reversed or without an effect, for which claims must miss."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.paper.claims.claim import Damage, Runs

if TYPE_CHECKING:
    from pyfric.record import Record

STATES = ("tau_before", "p_before", "tau_after", "p_after")
INITIAL = ("tau_initial", "p_initial")

Change = Callable[["Record"], "Record"]


def each(what: str, change: Change, names: Iterable[str] = ()) -> Damage:
    """Return a damage that changes every record, or the named records."""
    chosen = set(names)

    def changed(runs: Runs) -> Runs:
        return {
            name: change(run) if not chosen or name in chosen else run for name, run in runs.items()
        }

    return Damage(what, changed)


def exchanged(what: str, pairs: Mapping[str, str]) -> Damage:
    """Return a damage that replaces each named run by another run."""
    return Damage(what, lambda runs: {**runs, **{a: runs[b] for a, b in pairs.items()}})


def given(what: str, **instead: Any) -> Damage:
    """Return a damage that gives other keywords to the measurement."""
    return Damage(what, given=instead)


def with_events(record: Record, **columns: Any) -> Record:
    """Return the record with changed columns of its events."""
    return record.replace(events=record.events.assign(**columns))


def with_force(function: Callable[[Record, np.ndarray], np.ndarray]) -> Change:
    """Return a change that replaces static forces by a function of the record and F_T/F_N."""

    def changed(record: Record) -> Record:
        events, F_N = record.events, record.scene.F_N
        names = ("F_T_start", "F_T_arrest")
        new = {name: F_N * function(record, events[name].to_numpy() / F_N) for name in names}
        return with_events(record, **new)

    return changed


def drops_undone(record: Record) -> Record:
    """Return the record with start and arrest forces of events exchanged."""
    events = record.events
    return with_events(record, F_T_start=events["F_T_arrest"], F_T_arrest=events["F_T_start"])


def every_second(record: Record) -> Record:
    """Return the record with every other main event unfinished."""
    events = record.events
    kept = events["is_main"].cumsum() % 2 == 1
    return with_events(record, finished=events["finished"] & kept)


def without_long(record: Record) -> Record:
    """Return the record with precursors longer than 0.8 L unfinished."""
    events = record.events
    short = (events["L_p_over_L"] <= 0.8) | (events["L_p_over_L"] == 1)
    return with_events(record, finished=events["finished"] & short)


def lengths_backwards(record: Record) -> Record:
    """Return the record with lengths of precursors in reverse order."""
    events = record.events
    chosen = (events["is_main"] & events["is_precursor"]).to_numpy()
    L_p = events["L_p_over_L"].to_numpy().copy()
    L_p[chosen] = L_p[chosen][::-1]
    return with_events(record, L_p_over_L=L_p)


def turned(record: Record) -> Record:
    """Return the record with the curve of length against force rotated by half a turn."""
    events = record.events
    top = float(events["F_T_start"].max())
    chosen = (events["is_main"] & events["is_precursor"]).to_numpy()
    new = {name: events[name].to_numpy().copy() for name in ("L_p_over_L", "F_T_arrest")}
    new["L_p_over_L"][chosen] = (1 + 1 / record.scene.N_x - new["L_p_over_L"][chosen])[::-1]
    new["F_T_arrest"][chosen] = (top - new["F_T_arrest"][chosen])[::-1]
    return with_events(record, **new)


def mirrored(record: Record) -> Record:
    """Return the record with left and right of the interface exchanged."""
    arrays = {name: getattr(record, name)[..., ::-1] for name in (*STATES, *INITIAL)}
    events = record.events.assign(at_trailing_edge=~record.events["at_trailing_edge"])
    return record.replace(**arrays, rupture_times=record.rupture_times[:, ::-1], events=events)


def before_for_after(record: Record) -> Record:
    """Return the record with stresses after events replaced by stresses before events."""
    return record.replace(tau_after=record.tau_before, p_after=record.p_before)


def loaded_for_initial(record: Record) -> Record:
    """Return the record with stresses at F_T = 0 replaced by stresses before the first event."""
    return record.replace(tau_initial=record.tau_before[0], p_initial=record.p_before[0])


def p_unchanged(record: Record) -> Record:
    """Return the record with p after events replaced by p at F_T = 0."""
    p = np.broadcast_to(record.p_initial, record.p_after.shape)
    return record.replace(p_after=np.array(p))


def p_shuffled(record: Record) -> Record:
    """Return the record with p/p_initial after each event shuffled along the interface."""
    rng = np.random.default_rng(0)
    ratio = record.p_after / record.p_initial
    return record.replace(p_after=rng.permuted(ratio, axis=1) * record.p_initial)


def fronts_backwards(record: Record) -> Record:
    """Return the record with times from block to block of each front in reverse order."""
    return _with_intervals(record, lambda intervals: intervals[::-1])


def fronts_slower(factor: float) -> Change:
    """Return a change by which all fronts take `factor` times as long."""
    return lambda record: _with_intervals(record, lambda intervals: factor * intervals)


def _with_intervals(record: Record, change: Callable[[np.ndarray], np.ndarray]) -> Record:
    times = record.rupture_times.copy()
    for row in times:
        known = np.flatnonzero(np.isfinite(row))
        if len(known) > 1:
            intervals = change(np.diff(row[known]))
            row[known[1:]] = row[known[0]] + np.cumsum(intervals)
    return record.replace(rupture_times=times)


def in_scene(**changes: float) -> Change:
    """Return a change that gives other values to the scene of a record."""
    return lambda record: record.replace(scene=record.scene.replace(**changes))
