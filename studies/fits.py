"""Fits of random truths: are parameters found, do intervals cover them, are wrong models noticed?

A truth is a quasi-static run of the Fig. 1 scene, sampled at 2 kHz with noise of 1e-3 F_N. mu_s and
mu_k are random. Its events are fitted with both free. In the sets "disorder" and "height" the truth
has what the model has not: mu_s that varies along the interface, or a driver at twice the height.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import pyfric
from pyfric.fitting import fit, misfit
from pyfric.measured import events, sampled

__all__ = ["report", "study"]

SETS: dict[str, int] = {"right": 100, "disorder": 10, "height": 10}
"""Sets of truths, and how many."""
RANGES = {"mu_s": (0.6, 0.8), "mu_k": (0.35, 0.55)}
"""Of truths, drawn evenly."""
BOUNDS = {"mu_s": (0.55, 0.85), "mu_k": (0.3, 0.6)}
NOISE, STEP, T_END = 1e-3, "0.5 ms", 1.3
STD = 0.03
"""Standard deviation of mu_s of blocks in the set "disorder"."""


def study(path: Path, say: Callable[[str], None] = print) -> pd.DataFrame:
    """Return a row for each fit; those in the file are not made again, and new ones are added."""
    rows = pd.read_csv(path).to_dict("records") if path.exists() else []
    made = {(row["set"], row["seed"]) for row in rows}
    for seed in range(max(SETS.values())):  # in turn, so that a part of them is of all kinds
        for name, count in SETS.items():
            if seed < count and (name, seed) not in made:
                say(f"{name} {seed}")
                rows.append(_row(name, seed))
                pd.DataFrame(rows).to_csv(path, index=False, float_format="%.8g")
    return pd.DataFrame(rows)


def _row(name: str, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng([list(SETS).index(name), seed])
    true = {key: float(rng.uniform(*ends)) for key, ends in RANGES.items()}
    scene = pyfric.preset("fig1", l="5 mm")
    truth = scene.replace(**true)
    if name == "disorder":
        truth = truth.replace(mu_s=pyfric.Spread(mean=true["mu_s"], std=STD, seed=seed))
    elif name == "height":
        truth = truth.replace(h=2 * scene.driver.h)
    record = pyfric.simulate(truth, T_END, fidelity="quasistatic", progress=False)
    measured = sampled(record, STEP, noise=NOISE, seed=seed)
    found = fit(scene, measured, BOUNDS, part="all", fidelity="quasistatic")
    longer = pyfric.simulate(truth, 1.1 * T_END, fidelity="quasistatic", progress=False)
    known = events(measured)
    own = misfit(known, events(longer, t_gap=known.attrs["smooth"] * float(np.diff(measured.t)[0])))
    row: dict[str, Any] = {"set": name, "seed": seed, "events": len(found.table)}
    for key, value in true.items():
        low, high = found.intervals[key]
        row |= {f"{key}_true": value, key: found.values[key]}
        row |= {f"{key}_low": low, f"{key}_high": high}
    row |= {
        "chi2_true": own.chi2,
        "chi2": found.chi2,
        "dof": found.dof,
        "probability": found.probability,
    }
    return row | {"missing": found.missing, "extra": found.extra, "runs": found.runs}


def covered(table: pd.DataFrame, name: str) -> pd.Series:
    """Whether the interval of a parameter has its true value, for each fit."""
    low, high = table[f"{name}_low"].fillna(-np.inf), table[f"{name}_high"].fillna(np.inf)
    return (low <= table[f"{name}_true"]) & (table[f"{name}_true"] <= high)


def report(table: pd.DataFrame) -> str:
    """Return what the fits say: errors, coverage, and models that were found not to fit."""
    lines = []
    for name, part in table.groupby("set", sort=False):
        flagged = int((part["probability"] < 0.01).sum())
        lines.append(f"{name}: {len(part)} fits, {flagged} said not to fit")
        for key in RANGES:
            off = (part[key] / part[f"{key}_true"] - 1).abs()
            lines.append(
                f"  {key}: largest error {off.max():.2%}, median {off.median():.2%}; "
                f"90 % intervals cover {covered(part, key).mean():.0%}"
            )
    return "\n".join(lines)
