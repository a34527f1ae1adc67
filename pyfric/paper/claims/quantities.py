"""Quantities of several claims: lengths over forces, and stresses after precursors."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.engines import prediction_curve
from pyfric.record import analysis

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

# --- lengths over forces -------------------------------------------------------------------------


def growing(record: Record) -> pd.DataFrame:
    """Return the precursors of the first loading that reach further than all earlier precursors."""
    table = analysis.precursor_lengths(record)
    before = table["L_p_over_L"].cummax().shift(fill_value=0.0)
    return table[table["L_p_over_L"] > before].reset_index(drop=True)


def short(table: pd.DataFrame) -> pd.DataFrame:
    """Return the precursors shorter than L/2."""
    return table[table["L_p_over_L"] < 0.5]


def force_step(table: pd.DataFrame) -> float:
    """Return the mean step of force between precursors, over F_N; NaN for fewer than two."""
    force = table["force"].to_numpy()
    return float((force[-1] - force[0]) / (len(force) - 1)) if len(force) > 1 else np.nan


def force_at(table: pd.DataFrame, lengths: Iterable[float]) -> np.ndarray:
    """Return forces (F_N) at L_p/L in `lengths`, interpolated between precursors; NaN outside."""
    L_p, force = table["L_p_over_L"].to_numpy(), table["force"].to_numpy()
    return np.interp(list(lengths), L_p, force, left=np.nan, right=np.nan)


def furthest(tables: Iterable[pd.DataFrame], base: pd.DataFrame) -> tuple[float, list[float]]:
    """Return the largest difference of force at equal L_p, over a step, and all differences."""
    apart = [
        float(np.abs(table["force"] - force_at(base, table["L_p_over_L"])).max())
        for table in tables
    ]
    return float(np.max(apart)) / force_step(base), apart


def straight(table: pd.DataFrame, N_x: int) -> float:
    """Return the RMS deviation of lengths, in blocks, from a straight line over force."""
    force, L_p = table["force"].to_numpy(), table["L_p_over_L"].to_numpy()
    return rms(L_p - np.polyval(np.polyfit(force, L_p, 1), force)) * N_x


def prediction_error(record: Record) -> np.ndarray:
    """Return forces after precursors minus forces of the prediction curve at equal L_p."""
    curve = _prediction(record.scene)
    L_p, F_T = curve["L_p_over_L"].to_numpy(), curve["F_T"].to_numpy() / record.scene.F_N
    table = growing(record)
    at = np.searchsorted(L_p, table["L_p_over_L"].to_numpy() - 0.5 / record.scene.N_x)
    return table["force"].to_numpy()[at < L_p.size] - F_T[at[at < L_p.size]]


@functools.lru_cache(maxsize=128)
def _prediction(scene: Scene) -> pd.DataFrame:
    """Return the prediction curve of a scene, computed once."""
    return prediction_curve(scene).curve


# --- stresses after precursors -------------------------------------------------------------------


def reach(record: Record, event: int) -> int:
    """Return L_p of an event in blocks."""
    return round(record.events["L_p_over_L"].loc[event] * record.scene.N_x)


def corner(record: Record) -> int:
    """Return the number of blocks at x <= h + l."""
    return record.scene.j_h + 2


def left_behind(record: Record, events: Iterable[int] | None = None) -> pd.DataFrame:
    """Return stresses after precursors on slipped, closed blocks, without the tip block.

    Args:
        events: numbers of events; None means the precursors of the first loading.

    Returns:
        Rows of `analysis.stress_profile`; ``inner`` says whether x > h + l.
    """
    events = analysis.precursor_lengths(record)["event"] if events is None else events
    tables = []
    for event in events:
        table = analysis.stress_profile(record, event, "after")
        slipped = (table["region"] == 1) & (table["p"] > 0)
        tables.append(table[slipped & (table["n"] < reach(record, event))])
    if not tables:
        return analysis.stress_profile(record)[:0].assign(inner=False)
    table = pd.concat(tables, ignore_index=True)
    return table.assign(inner=table["n"] > corner(record))


def size(left: pd.DataFrame) -> float:
    """Return the RMS of the scaled prestress after precursors; NaN without blocks."""
    return rms(left["scaled"]) if len(left) else np.nan


def weighted(left: pd.DataFrame) -> str:
    """Return the RMS of the scaled prestress without the corner, and weighted by p, as text."""
    if left.empty:
        return "no such blocks left behind"
    inner = size(left[left["inner"]])
    by_p = np.sqrt(np.average(np.square(left["scaled"]), weights=left["p"]))
    return f"without the blocks at x <= h + l {inner:.3f}, weighted by p {by_p:.3f}"


# --- numbers -------------------------------------------------------------------------------------


def rms(x: Iterable[float]) -> float:
    """Return the root mean square of numbers."""
    return float(np.sqrt(np.mean(np.square(np.asarray(x)))))


def stated(number: float, digits: str = ".3f") -> str:
    """Return a number as text; NaN is "none"."""
    return "none" if np.isnan(number) else format(number, digits)


def listed(numbers: dict[str, float], digits: str = ".3f") -> str:
    """Return names and their numbers as text."""
    return ", ".join(f"{name}: {stated(value, digits)}" for name, value in numbers.items())
