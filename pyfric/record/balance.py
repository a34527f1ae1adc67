"""Extent of slip in an event, onset of its fast part, potency and energies.

**Extent.** l(t) is l times the number of blocks that have slipped in the event by t. The speed of
l(t) is averaged over five blocks, 4 l/(t_{k+4} - t_k), with t_k the time of first slip of the k-th
block to slip. The *fast part* is the longest row of blocks at which this speed is at least `SLOW`
times the limit of fronts, c in a chain and c_R in two dimensions. l at its onset is the length to
which slip grows slowly, before a fast front.

**Potency.** l times the sum over blocks of their displacement between the first and the last slip
of the event, in m^2 (per width). By contact, the sum of the potencies of events is the potency of
all slip except corner slip. By rate, slip below the threshold is missing.

**Energies.** Differences of the energy budget between first slip and last stick. Full dynamics and
the hybrid engine record the energy budget with the option `energies`. In one event

    work = kinetic + elastic + friction_heat + switching_loss + damped + radiated .

`elastic` and `kinetic` are changes of elastic and kinetic energy. `weakening_heat` is the part of
the friction heat above mu_k p. `viscous_heat` is the part of the friction heat from viscosity of
slip. `damped` is heat of dashpots of bonds. `radiated` is the energy that leaves through absorbing
walls. On junctions, `work` includes the work of changes of their stiffness.

Source: extent and speed as in the paper's Fig. 4; potency: K. Aki and P. G. Richards, Quantitative
Seismology (2002), chapter 3.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
import pandas as pd

import pyfric.record.catalogue  # noqa: F401  its columns come first
from pyfric.record.classes import SLOW
from pyfric.record.data import RecordData
from pyfric.record.held import ENERGIES, counted, event_column
from pyfric.record.rupture import AVERAGED
from pyfric.record.zones import pace_limits
from pyfric.values import SceneError

NOT_MEASURED = "NaN: not measured, without energies = True"


def extent(record: RecordData, event: int) -> pd.DataFrame:
    """Return the extent of slip in an event over time; see the module.

    Args:
        event: number of the event, from 1.

    Returns:
        One row for each block that slips, in the order of first slips. Columns: n, number of the
        block; t (s), time of its first slip, or start of the record; length (m), l(t), this block
        included; slipping (m), l times the number of blocks that slip at t; speed (m/s) of l(t),
        NaN for the last four blocks.

    Raises:
        SceneError: no such event.
    """
    record.row(event)
    slips, l = record.columns("episodes"), record.scene.slider.l
    slips = {name: column[slips["event"] == event] for name, column in slips.items()}
    _, n, t, speed = _growth(slips, l)
    start, stop = (np.sort(slips[name][~np.isnan(slips[name])]) for name in ("t_start", "t_stop"))
    now = np.searchsorted(start, t, side="right") - np.searchsorted(stop, t, side="right")
    lengths = l * np.arange(1, t.size + 1)
    columns = {"n": n, "t": t, "length": lengths, "slipping": l * now, "speed": speed}
    return pd.DataFrame(columns)


def _growth(episodes: Mapping[str, np.ndarray], l: float) -> tuple[np.ndarray, ...]:
    """Return event, block and time (s) of each first slip of a block, and the speed (m/s) of l(t).

    First slips are ordered by event, then by time. Corner episodes are left out.
    """
    event, n, t = (episodes[name] for name in ("event", "n", "t_start"))
    order = np.lexsort((n, t, event))
    order = order[event[order] > 0]
    blocks = n.max(initial=0) + 1
    _, first = np.unique(event[order] * blocks + n[order], return_index=True)
    kept = order[np.sort(first)]
    event, n, t = event[kept], n[kept], t[kept]
    speed = np.full(t.size, np.nan)
    same = event[AVERAGED:] == event[:-AVERAGED]
    passed = (t[AVERAGED:] - t[:-AVERAGED])[same]
    with np.errstate(divide="ignore"):
        speed[:-AVERAGED][same] = AVERAGED * l / passed
    return event, n, t, speed


def potency_history(record: RecordData, event: int | None = None) -> pd.DataFrame:
    """Return potency and potency rate at the points of the curve; see the module.

    Args:
        event: number of the event, from 1; None means the whole record.

    Returns:
        Columns: t (s); potency (m^2) since the first row; rate (m^2/s).

    Raises:
        SceneError: no such event, or the record holds no motion.
    """
    if "v_x" not in record.motion:
        allowed = "a run with the option threshold, or under a law without rest"
        raise SceneError("record", record.method.engine, "", allowed, "it holds no motion")
    t, l = record.curve["t"].to_numpy(), record.scene.slider.l
    rows = slice(None)
    if event is not None:
        record.row(event)
        begin, end = record.events.loc[event, ["t_start", "t_stop"]]
        first = max(np.searchsorted(t, begin, side="right") - 1, 0)
        last = len(t) if np.isnan(end) else np.searchsorted(t, end, side="left") + 1
        rows = slice(first, last)
    u_x, v = record.motion["u_x"][rows], record.motion["v_x"][rows].astype(float)
    moved = l * (u_x - u_x[:1]).sum(axis=1)
    return pd.DataFrame({"t": t[rows], "potency": moved, "rate": l * v.sum(axis=1)})


# --- columns of the table of events --------------------------------------------------------------


def _count(record: RecordData) -> int:
    """Return the number of events."""
    return len(record.columns("events")["t_start"])


def _onset(record: RecordData) -> np.ndarray:
    """Return time (s) and length (m) at the onset of the fast part of events, (n_events, 2)."""
    found, l = np.full((_count(record), 2), np.nan), record.scene.slider.l
    event, _, t, speed = _growth(record.columns("episodes"), l)
    fast = speed >= SLOW * pace_limits(record.scene)[0]  # False for the last four blocks
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]]).astype(int)))
    begin, end = edges[::2], edges[1::2]
    order = np.lexsort((begin, begin - end, event[begin]))  # in each event, longest first
    _, longest = np.unique(event[begin[order]], return_index=True)
    k = begin[order[longest]]
    first = np.searchsorted(event, event[k])
    found[event[k] - 1] = np.column_stack([t[k], l * (k - first + 1)])
    return found


def _ends(record: RecordData, name: str) -> np.ndarray:
    """Return values at first slip and last stick of events, (2, n_events, ...); NaN if missing.

    In an unfinished event, the end of the record replaces the last stick.
    """
    events, log = record.columns("events"), record.transitions
    values = np.asarray(log[name], dtype=float)
    none = np.full((1, *values.shape[1:]), np.nan)
    ends = np.stack(
        [np.concatenate([values, none])[events[at]] for at in ("quiet_start", "quiet_stop")]
    )
    going = np.flatnonzero(np.isnan(events["t_stop"]))
    state = record.final_state
    if name == "u_x" and state is not None:
        ends[1, going] = state.y[0, 0]
    elif name in (curve := record.columns("curve")):
        ends[1, going] = curve[name][-1]
    return ends


def _moved(record: RecordData, *names: str) -> np.ndarray:
    """Return the change of a sum of columns of the budget in each event, J."""
    curve = record.columns("curve")
    held = [name for name in names if name in record.transitions and name in curve]
    if not held:
        return np.full(_count(record), np.nan)
    return sum(np.diff(_ends(record, name), axis=0)[0] for name in held)


def _part(record: RecordData, name: str) -> np.ndarray:
    """Return a part of the friction heat in each event, in J; 0 if the law has no such part."""
    curve = record.columns("curve")
    known = "friction_heat" in curve and record.scene.law.rests
    if known and name not in curve:
        return 0.0 * _moved(record, "friction_heat")
    return _moved(record, name)


@event_column("s", "onset of the longest fast stretch of l(t), NaN for none", required=False)
def t_fast(record: RecordData) -> np.ndarray:
    return _onset(record)[:, 0]


@event_column("m", "extent of slip at the onset of the fast part, NaN for none", required=False)
def length_fast(record: RecordData) -> np.ndarray:
    return _onset(record)[:, 1]


@event_column("m2", "l times the sum of displacements of the blocks", required=False)
def potency(record: RecordData) -> np.ndarray:
    return record.scene.slider.l * np.diff(_ends(record, "u_x"), axis=0)[0].sum(axis=1)


@event_column("m2/s", "largest l |sum of v_x|, NaN: not measured, no slip rates", required=False)
def potency_rate(record: RecordData) -> np.ndarray:
    events, log, found = record.columns("events"), record.transitions, []
    if "v_x" in record.motion:
        v = record.motion["v_x"].astype(float).sum(axis=1)
        found.append(_largest(events, record.columns("curve")["t"], np.abs(v)))
    if "sum_v" in log:  # logged at the end of fast slip
        ends = np.flatnonzero(log["kind"] < 0)
        begins = np.append(log["t"], np.nan)[ends - 1]
        found.append(_largest(events, begins, log["sum_v"][ends]))
    none = np.full(_count(record), np.nan)
    return record.scene.slider.l * functools.reduce(np.fmax, found, none)


def _largest(events: Mapping[str, np.ndarray], t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the largest value in each event, NaN if none; `values` are at increasing `t` (s)."""
    begin = np.searchsorted(t, events["t_start"])
    stop = np.where(np.isnan(events["t_stop"]), np.inf, events["t_stop"])
    end = np.searchsorted(t, stop, side="right")
    spans = zip(begin, end, strict=True)
    return np.array([values[a:b].max() if a < b else np.nan for a, b in spans])


@event_column("J", f"work of driver and loads. {NOT_MEASURED}", required=False)
def work(record: RecordData) -> np.ndarray:
    return _moved(record, "work_driver", "work_load", *counted("given"))


@event_column("J", f"what elastic energy gained, left as stress. {NOT_MEASURED}", required=False)
def elastic(record: RecordData) -> np.ndarray:
    return _moved(record, *(name for name in ENERGIES if name.startswith("elastic_")))


@event_column("J", f"what kinetic energy gained, left in motion. {NOT_MEASURED}", required=False)
def kinetic(record: RecordData) -> np.ndarray:
    return _moved(record, *(name for name in ENERGIES if name.startswith("kinetic_")))


@event_column("J", f"heat of friction. {NOT_MEASURED}", required=False)
def friction_heat(record: RecordData) -> np.ndarray:
    return _moved(record, "friction_heat")


@event_column("J", f"of it above mu_k p. {NOT_MEASURED}, or not defined", required=False)
def weakening_heat(record: RecordData) -> np.ndarray:
    return _part(record, "weakening_heat")


@event_column("J", f"of it by viscosity of slip. {NOT_MEASURED}, or not defined", required=False)
def viscous_heat(record: RecordData) -> np.ndarray:
    return _part(record, "viscous_heat")


@event_column("J", f"kinetic energy removed by switches. {NOT_MEASURED}", required=False)
def switching_loss(record: RecordData) -> np.ndarray:
    return _moved(record, "switching_loss")


@event_column("J", f"heat of dashpots of bonds. {NOT_MEASURED}", required=False)
def damped(record: RecordData) -> np.ndarray:
    walls = radiated(record) if record.scene.walls.absorb else 0.0
    return _moved(record, "dissipated_bonds") - walls


@event_column("J", f"energy through absorbing walls. {NOT_MEASURED}", required=False)
def radiated(record: RecordData) -> np.ndarray:
    if not record.scene.walls.absorb:
        return 0.0 * _moved(record, "dissipated_bonds")
    return _moved(record, "radiated")
