"""Events by slip rate: the logs of slip faster than a threshold.

There are two criteria of slip for the definition of an event (`pyfric.record.catalogue`). By
contact, a block slips between a release and the next stick. With rate-and-state friction, a block
slips by contact while it is faster than ``v_slip``. By rate, a block slips while it is in contact
and |v_x| exceeds a threshold. By either criterion, slip with pauses of up to ``t_gap`` is one
event. Slip that never pauses by contact, such as a creeping front in a viscous interface, can hold
several events by rate. Slow slip below ``v_slip`` can also hold events by rate.

Times at which a rate passes the threshold come from one of two sources:

a run with the option ``threshold``
    Rates are compared with the threshold after each step, and interpolated linearly between steps.
    The hybrid engine also compares rates at the end of its jumps. Where rate-and-state friction
    slips without inertia, the times are roots of the solution.
a record with `motion`
    Rates are compared at the points of the curve, and interpolated linearly between them. Events
    between two points are missed, and a note of the record says so.

Both sources give a log in the form of switches, and a log of starts and ends of slip. The
second log holds displacements just before and just after fast slip, so that the sum of slip is
exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.record.data import RecordData
from pyfric.record.episodes import QUIET_COLUMNS, SWITCH_COLUMNS, LastSlip
from pyfric.record.held import ENERGIES
from pyfric.values import SceneError, check_number

SAMPLED = "slip rates are those of points of the curve"
"""Beginning of the note in a record whose events follow from its motion."""

Log = Mapping[str, np.ndarray]


class Fast(NamedTuple):
    """Slip faster than a threshold.

    Attributes:
        crossings, bursts: logs in the form of `switches` and `quiet`.
        last: blocks that are fast at the end.
        notes: notes for the record.
    """

    crossings: dict[str, np.ndarray]
    bursts: dict[str, np.ndarray]
    last: LastSlip
    notes: tuple[str, ...] = ()


def fast_slip(record: RecordData, threshold: Any) -> Fast:
    """Return the slip of a record that is faster than a threshold; see the module.

    Args:
        threshold: slip rate, m/s, or text with a unit, such as "1 mm/s".

    Raises:
        SceneError: the threshold is refused, or the record does not hold the rates.
    """
    v, law = check_number("threshold", threshold, "m/s", gt=0.0), record.scene.law
    if v == record.method.threshold:
        crossings = dict(record.crossings)
        return Fast(crossings, dict(record.bursts), _last(record, crossings, v))
    if v == law.v_slip and record.final_state is not None:
        switches = {name: record.switches[name] for name in SWITCH_COLUMNS}
        state = record.final_state
        return Fast(switches, dict(record.quiet), LastSlip(state.mode, state.corner))
    if "v_x" not in record.motion or len(record.curve) < 2:
        known = record.method.threshold
        kept = "" if known is None else f" {known!r} m/s,"
        allowed = f"{kept} a run with the option threshold, or under a law without rest".lstrip()
        raise SceneError("threshold", v, "m/s", allowed, "the record holds no other slip rates")
    return _sampled(record, v)


def _last(record: RecordData, crossings: Log, threshold: float) -> LastSlip:
    """Return the blocks that are fast at the end, including blocks that were always fast."""
    mode, corner = np.zeros((2, record.scene.N_x), dtype=np.int32)
    mode[crossings["block"]], corner[crossings["block"]] = crossings["new"], crossings["corner"]
    if (state := record.final_state) is not None:
        v = state.y[0, 2]
        mode = np.where((np.abs(v) > threshold) & (state.mode != OPEN), np.sign(v), 0)
    return LastSlip(mode.astype(np.int32), corner)


def _sampled(record: RecordData, threshold: float) -> Fast:
    """Return fast slip from the slip rates at points of the curve."""
    curve, t = record.curve, record.curve["t"].to_numpy()
    u_x, v = record.motion["u_x"], record.motion["v_x"].astype(float)
    mode = contacts_at(record, t)
    fast = np.where((np.abs(v) > threshold) & (mode != OPEN), np.sign(v), 0).astype(np.int32)

    every = max(record.method.sample, 1)
    k, block = np.nonzero(fast[1:] != fast[:-1])
    old, new = fast[k, block], fast[k + 1, block]
    before, after = np.abs(v[k, block]), np.abs(v[k + 1, block])
    apart = np.where(old * new < 0, before + after, np.abs(after - before))
    way = np.where(old * new < 0, before, np.abs(threshold - before))
    share = np.clip(np.divide(way, apart, out=np.zeros(k.size), where=apart > 0), 0.0, 1.0)
    crossings = {
        "step": every * (k + 1),
        "block": block,
        "old": old,
        "new": new,
        "corner": np.zeros(k.size, dtype=bool),
        "t": t[k] + share * (t[k + 1] - t[k]),
        "u_x": u_x[k, block] + share * (u_x[k + 1, block] - u_x[k, block]),
        "p": np.full(k.size, np.nan),
    }
    crossings = {name: crossings[name].astype(kind) for name, kind in SWITCH_COLUMNS.items()}

    active = (fast != 0).any(axis=1)
    turns = np.flatnonzero(active[1:] != active[:-1]) + 1
    kind = np.where(active[turns], 1, -1)
    at = np.where(kind > 0, turns - 1, turns)  # points just before and just after fast slip
    first, last = (np.searchsorted(k + 1, turns, side) for side in ("left", "right"))
    spans = list(zip(kind, first, last, strict=True))
    times = [(min if way > 0 else max)(crossings["t"][a:b]) for way, a, b in spans]
    bursts = {
        "step": every * turns,
        "t": np.array(times),
        "kind": kind,
        "F_T": curve["F_T"].to_numpy()[at],
        "u_x": u_x[at],
        "mode": mode[at],
    }
    bursts = {name: bursts[name].astype(kind) for name, kind in QUIET_COLUMNS.items()}
    rate, begin = np.abs(v.sum(axis=1)), np.where(kind > 0, turns, np.append(0, turns)[:-1])
    ends = [(a, b + 1) for a, b in zip(begin, turns, strict=True)]
    bursts["sum_v"] = np.array([rate[a:b].max() for a, b in ends], dtype=float)
    bursts |= {name: curve[name].to_numpy()[at] for name in curve if name in ENERGIES}
    longest = float(np.diff(t).max())
    note = f"{record.method.engine}: {SAMPLED}, at most {longest:.3g} s apart"
    return Fast(crossings, bursts, LastSlip(fast[-1], np.zeros(record.scene.N_x)), (note,))


def contacts_at(record: RecordData, t: np.ndarray) -> np.ndarray:
    """Return the contact states at increasing times (s), shape (n, N_x)."""
    log, N_x = record.switches, record.scene.N_x
    state = record.final_state
    first = np.zeros(N_x, dtype=np.int32) if state is None else state.mode.copy()
    blocks, at = np.unique(log["block"], return_index=True)
    first[blocks] = log["old"][at]
    found = np.broadcast_to(first, (len(t), N_x)).copy()
    for i in blocks:
        mine = log["block"] == i
        seen = np.searchsorted(log["t"][mine], t, side="right")
        found[:, i] = np.append(first[i], log["new"][mine])[seen]
    return found
