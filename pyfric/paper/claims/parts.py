"""What several claims measure: lengths over forces, and what precursors leave behind."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.engines import prediction_curve
from pyfric.record import analysis

if TYPE_CHECKING:
    from pyfric.record import Record


def growing(record: Record) -> pd.DataFrame:
    """Precursors of the first loading that reach further than all before."""
    table = analysis.precursor_lengths(record)
    before = table["L_p_over_L"].cummax().shift(fill_value=0.0)
    return table[table["L_p_over_L"] > before].reset_index(drop=True)


def force_step(table: pd.DataFrame) -> float:
    """Mean step of the force between precursors, over F_N; NaN with fewer than two."""
    force = table["force"].to_numpy()
    return float((force[-1] - force[0]) / (len(force) - 1)) if len(force) > 1 else np.nan


def force_at(table: pd.DataFrame, lengths: Iterable[float]) -> np.ndarray:
    """Force at given L_p/L, between precursors by interpolation; NaN outside."""
    L_p, force = table["L_p_over_L"].to_numpy(), table["force"].to_numpy()
    return np.interp(list(lengths), L_p, force, left=np.nan, right=np.nan)


def forces_apart(table: pd.DataFrame, reference: pd.DataFrame) -> np.ndarray:
    """Force of each precursor minus that of the reference at equal length, over F_N."""
    there = force_at(reference, table["L_p_over_L"])
    return (table["force"].to_numpy() - there)[np.isfinite(there)]


def reach(record: Record, event: int) -> int:
    """L_p in blocks."""
    return round(record.events["L_p_over_L"].iloc[event] * record.scene.N_x)


def arrested(record: Record, event: int) -> pd.DataFrame:
    """Profile after a precursor over its slipped, closed blocks, tip block excluded."""
    table = analysis.stress_profile(record, event, "after")
    slipped = (table["region"] == 1) & (table["p"] > 0)
    return table[slipped & (table["n"] < reach(record, event))]


def left_behind(record: Record, column: str = "scaled") -> np.ndarray:
    """What the precursors of the first loading leave, all together; NaN where there are none."""
    events = analysis.precursor_lengths(record)["event"]
    left = [arrested(record, event)[column].to_numpy() for event in events]
    return np.concatenate(left) if left else np.array([np.nan])


def prediction_error(record: Record) -> np.ndarray:
    """Force after each precursor minus that at which its last block slips with mu_s = mu_k."""
    curve = prediction_curve(record.scene).curve
    L_p, F_T = curve["L_p_over_L"].to_numpy(), curve["F_T"].to_numpy() / record.scene.F_N
    table = growing(record)
    at = np.searchsorted(L_p, table["L_p_over_L"].to_numpy() - 0.5 / record.scene.N_x)
    return table["force"].to_numpy()[at < L_p.size] - F_T[at[at < L_p.size]]


def straight(table: pd.DataFrame, N_x: int) -> float:
    """RMS distance in blocks of the lengths from a straight line over the force."""
    force, L_p = table["force"].to_numpy(), table["L_p_over_L"].to_numpy()
    return rms(L_p - np.polyval(np.polyfit(force, L_p, 1), force)) * N_x


def rms(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def exponent(x: Iterable[float], y: Iterable[float]) -> float:
    """Slope of ln y over ln x."""
    return float(np.polyfit(np.log(list(x)), np.log(list(y)), 1)[0])


def precursors_below(record: Record, below: float) -> pd.DataFrame:
    """The growing precursors with L_p/L below a limit."""
    table = growing(record)
    return table[table["L_p_over_L"] < below]
