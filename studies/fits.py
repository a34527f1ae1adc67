"""Fits of runs with random parameters: errors, coverage of intervals, detection of wrong models.

A truth is a quasi-static run of the Fig. 1 scene with random mu_s and mu_k, sampled at 2 kHz with
noise of 1e-3 F_N. Its events are fitted with both parameters free. The truths of two sets lie
outside the model: mu_s varies along the interface ("disorder"), or the driver is at twice the
height ("height").

Coverage depends on the draws of noise. `pulls` separates the effect of draws from that of
intervals. A pull is one step of Gauss and Newton from the truth, divided by its standard deviation.
The variance of pulls is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sizes import size

import pyfric
from pyfric.fitting import Events, Together, fit, misfit
from pyfric.fitting.problem import Problem
from pyfric.fitting.search import derivatives
from pyfric.measured import events, sampled

__all__ = ["pulls", "report", "report_of_pulls", "study"]

SETS: dict[str, int] = {"right": size(200, 1), "disorder": size(10, 0), "height": size(10, 0)}
"""Set of truths -> number of truths in this set."""
RANGES = {"mu_s": (0.6, 0.8), "mu_k": (0.35, 0.55)}
RANGES = size(RANGES, {"mu_s": (0.7, 0.71)})
"""Ranges from which parameters of truths are drawn uniformly."""
BOUNDS = size({"mu_s": (0.55, 0.85), "mu_k": (0.3, 0.6)}, {"mu_s": (0.69, 0.72)})
NOISE, STEP, T_END = 1e-3, "0.5 ms", size(1.3, 0.6)
INSIDE = 1.645
"""Number of standard deviations that holds 90 % of a normal distribution."""
STD = 0.03
"""Standard deviation of mu_s of blocks in the set "disorder"."""


def study(path: Path, say: Callable[[str], None] = print) -> pd.DataFrame:
    """Return a row for each fit; fits that are missing in the file are made and added to it."""
    rows = pd.read_csv(path).to_dict("records") if path.exists() else []
    made = {(row["set"], row["seed"]) for row in rows}
    for seed in range(max(SETS.values())):  # so that an unfinished file holds all sets
        for name, count in SETS.items():
            if seed < count and (name, seed) not in made:
                say(f"{name} {seed}")
                rows.append(_row(name, seed))
                pd.DataFrame(rows).to_csv(path, index=False, float_format="%.8g")
    return pd.DataFrame(rows)


def truth_of(name: str, seed: int) -> dict[str, float]:
    """Return the true parameters of a fit."""
    rng = np.random.default_rng([list(SETS).index(name), seed])
    return {key: float(rng.uniform(*ends)) for key, ends in RANGES.items()}


def pulls(
    seeds: Iterable[int] = range(SETS["right"]),
    draws: int = size(8, 1),
    say: Callable[[str], None] = print,
) -> pd.DataFrame:
    """Return a row for each truth of the set "right" and each draw of noise.

    The draw with which a truth was fitted comes first.

    Columns are the pulls of parameters, and the decrease of chi^2 by one step of Gauss and Newton
    from the truth with linear residuals. The mean of this decrease is the number of parameters.
    """
    rows = []
    scene = pyfric.preset("fig1", l="5 mm")
    how = {"fidelity": "quasistatic", "progress": False}
    for seed in seeds:
        say(f"pulls {seed}")
        true = truth_of("right", seed)
        record, known = pyfric.simulate(scene.replace(**true), T_END, **how), {}
        for draw in range(draws):
            measured = sampled(record, STEP, noise=NOISE, seed=seed + 1000 * draw)
            data = Together.of(Events(measured, "all"))
            problem = Problem([scene], [data], BOUNDS, how, 0.0)
            problem.known = known  # all draws use the same runs
            u = problem.place(true)
            residuals, jacobian = problem.residuals(u), derivatives(problem, u)[0]
            variance = np.linalg.inv(jacobian.T @ jacobian)
            along = jacobian.T @ residuals
            found = -(variance @ along) / np.sqrt(np.diag(variance))
            row = {"seed": seed, "draw": draw} | dict(zip(problem.names, found, strict=True))
            rows.append(row | {"lowers": float(along @ variance @ along)})
    return pd.DataFrame(rows)


def _row(name: str, seed: int) -> dict[str, Any]:
    true = truth_of(name, seed)
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
    """Return whether the interval of a parameter holds its true value, for each fit."""
    low, high = table[f"{name}_low"].fillna(-np.inf), table[f"{name}_high"].fillna(np.inf)
    return (low <= table[f"{name}_true"]) & (table[f"{name}_true"] <= high)


def report_of_pulls(table: pd.DataFrame) -> str:
    """Return variances of pulls, and the share of pulls within an interval of 90 %."""
    lines = []
    for draw, part in [*table.groupby("draw"), ("all", table)]:
        lines.append(
            f"draw {draw}: {len(part)} truths, chi^2 lowered by {part['lowers'].mean():.2f}"
        )
        for key in RANGES:
            inside = (part[key].abs() < INSIDE).mean()
            lines.append(f"  {key}: variance {part[key].var():.2f}, {inside:.0%} within 90 %")
    for key in RANGES:
        of_noise, of_truths = parts_of_pulls(table, key)
        lines.append(f"{key}: variance {of_noise:.2f} by noise, {of_truths:.2f} by truth")
    return "\n".join(lines)


def parts_of_pulls(table: pd.DataFrame, key: str) -> tuple[float, float]:
    """Return the variance of pulls between draws of noise, and between truths.

    Deviations between truths are the same in all draws of noise: their causes are times of force
    drops between samples, and small events that noise hides.
    """
    draws = table.pivot(index="seed", columns="draw", values=key)
    of_noise = float(draws.var(axis=1).mean())
    return of_noise, float(draws.mean(axis=1).var() - of_noise / draws.shape[1])


def report(table: pd.DataFrame) -> str:
    """Return results of the fits: errors, coverage, and the number of fits that are rejected."""
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
