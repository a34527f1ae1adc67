"""Fits of random parameters to velocity steps and a slide-hold-slide of a block on a spring.

A truth is a run with random a, b, D_c, f* and stiffness of the machine, sampled at 50 Hz with noise
of 5e-4 F_N. Its whole curve is fitted with all five parameters free.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sizes import size

import pyfric
from pyfric.fitting import CurveOf, fit
from pyfric.measured import sampled

__all__ = ["report", "study"]

TRUTHS = size(30, 1)
RANGES = {
    "a": (0.008, 0.014),
    "b": (0.010, 0.020),
    "D_c": (5e-6, 2e-5),
    "f_star": (0.58, 0.62),
    "K": (1.5e8, 2.5e8),
}
"""Ranges from which parameters of truths are drawn uniformly."""
BOUNDS = size(
    {
        "a": (0.005, 0.02),
        "b": (0.007, 0.03),
        "D_c": (3e-6, 3e-5),
        "f_star": (0.55, 0.65),
        "K": (1e8, 3e8),
    },
    {"a": (0.005, 0.02)},
)
SLOW, FAST = 1e-6, 1e-5
PROTOCOL = (
    *((10, SLOW), (10, FAST), (15, FAST), (15, SLOW), (35, SLOW)),  # two steps
    *((35, 0.0), (65, 0.0), (65, FAST), (70, FAST)),  # slide, hold, slide
)
T_END, NOISE, STEP = size(70.0, 12.0), 5e-4, "20 ms"
HOW = {"fidelity": "hybrid", "geometry": "linear", "accuracy": 1e-4, "sample": "50 ms"}


def block(**changes: float) -> pyfric.Scene:
    """Return a block that a plate pulls: all parts move as one."""
    law = pyfric.laws.RateAndState(a=0.01, b=0.015, D_c=1e-5)
    scene = pyfric.chain(L=5e-3, F_N=3500.0, K=2e8, V=SLOW, side="top", protocol=PROTOCOL, law=law)
    return scene.replace(**changes)


def study(path: Path, say: Callable[[str], None] = print) -> pd.DataFrame:
    """Return a row for each fit; fits that are missing in the file are made and added to it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_csv(path).to_dict("records") if path.exists() else []
    made = {row["seed"] for row in rows}
    for seed in set(range(TRUTHS)) - made:
        say(f"truth {seed}")
        rows.append(_row(seed))
        pd.DataFrame(rows).to_csv(path, index=False, float_format="%.8g")
    return pd.DataFrame(rows)


def _row(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    true = {name: float(rng.uniform(*ends)) for name, ends in RANGES.items()}
    record = pyfric.simulate(block(**true), T_END, progress=False, **HOW)
    curve = sampled(record, STEP, noise=NOISE, seed=seed)
    found = fit(block(), CurveOf(curve), BOUNDS, **HOW)
    row: dict[str, Any] = {"seed": seed}
    for name, (low, high) in found.intervals.items():
        row |= {f"{name}_true": true[name], name: found.values[name]}
        row |= {f"{name}_low": low, f"{name}_high": high}
    return row | {"chi2": found.chi2, "dof": found.dof, "runs": found.runs}


def report(table: pd.DataFrame) -> str:
    """Return the number of intervals that hold the true value."""
    lines = [f"{len(table)} truths"]
    for name in BOUNDS:
        low, high = table[f"{name}_low"].fillna(-np.inf), table[f"{name}_high"].fillna(np.inf)
        holds = (low <= table[f"{name}_true"]) & (table[f"{name}_true"] <= high)
        off = (table[name] / table[f"{name}_true"] - 1).abs()
        width = ((high - low) / table[name]).median()
        lines.append(
            f"  {name}: {holds.sum()} of {len(table)} intervals of 90 % hold, width {width:.2%}, "
            f"largest error {off.max():.2%}"
        )
    return "\n".join(lines)
