"""What the study of `precursors` comes to: the functions of its rule, its table and its figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from scipy.optimize import isotonic_regression
from sizes import size

__all__ = ["ENOUGH", "ONE", "SCALES", "collapse", "end", "ends", "points", "share", "verdict"]

ENOUGH = 0.9
"""Least share of the variance that counts as a collapse."""
DRAWS = size(1000, 20)
"""Draws of series, and of seeds."""
CHANCE = 0.95
ONE = 1.5
"""Largest over smallest end that still counts as one value."""
RESOLVED = 6
"""Fewest blocks in the zone, as in `pyfric.record.zones`."""
SAME = 0.2
"""Relative difference of ends on two lattices that counts as none."""
SCALES: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "L_c/L": lambda of: of["L_c"] / of["L"],
    "L_c/H": lambda of: of["L_c"] / of["H"],
    "L_G/L": lambda of: of["L_energy"] / of["L"],
    "d_c": lambda of: of["d_c"],
    "L_c": lambda of: of["L_c"],
    "L_c/h": lambda of: of["L_c"] / of["h"],
    "L_c/l": lambda of: of["L_c"] / of["l"],
}
NULLS = ("d_c", "L_c", "L_c/h", "L_c/l")


# --- points --------------------------------------------------------------------------------------


def points(runs: pd.DataFrame, column: str = "n") -> pd.DataFrame:
    """Return one row for each series and L_c/L: what it is, and a number of its runs.

    Columns added: runs; mean and error, of the number over seeds; y = ln(1 + mean), and its error.
    """
    same = ["series", "share", "law", "d_c", "L_c", "L_energy", "L", "H", "l", "h", "zone"]
    groups = runs.groupby(same, sort=False)[column]
    table = groups.agg(runs="count", mean="mean", error="sem").reset_index()
    return table.assign(y=np.log1p(table["mean"]), y_error=table["error"] / (1 + table["mean"]))


# --- collapse ------------------------------------------------------------------------------------


def _curve(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the places and values of the best curve that never rises."""
    at, where, count = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.bincount(where, y) / count
    return at, isotonic_regression(mean, weights=count, increasing=False).x


def share(x: np.ndarray, y: np.ndarray, series: np.ndarray) -> float:
    """Return the share of the variance of y that curves through the other series predict.

    Args:
        x: values of a scale, > 0, shape (n,).
        y: what is to collapse, shape (n,).
        series: name of the series of each point, shape (n,).
    """
    x, left = np.log(x), np.empty(len(y))
    for name in np.unique(series):
        own = series == name
        left[own] = y[own] - np.interp(x[own], *_curve(x[~own], y[~own]))
    return float(1 - np.mean(left**2) / np.var(y))


def collapse(
    table: pd.DataFrame, scales: Sequence[str] = tuple(SCALES), draws: int = DRAWS
) -> pd.DataFrame:
    """Return the share of each scale, its 95 % interval, and how often it exceeds that of L_c/L.

    Args:
        table: that of `points`.
        scales: names in `SCALES`, of which the first is compared with the others.
        draws: draws of series with replacement. Copies of a series are left out together.
    """
    names, rng = table["series"].unique(), np.random.default_rng(1)
    parts = {name: table[table["series"] == name] for name in names}
    found = np.empty((draws, len(scales)))
    for k in range(draws):
        drawn = rng.choice(names, len(names))
        while len(np.unique(drawn)) == 1:
            drawn = rng.choice(names, len(names))
        found[k] = _shares(pd.concat([parts[name] for name in drawn]), scales)
    low, high = np.quantile(found, [0.025, 0.975], axis=0)
    better = (found > found[:, :1]).mean(axis=0)
    rows = {"scale": list(scales), "share": _shares(table, scales), "low": low, "high": high}
    return pd.DataFrame(rows | {"better_than_first": better})


def _shares(table: pd.DataFrame, scales: Sequence[str]) -> list[float]:
    y, series = table["y"].to_numpy(), table["series"].to_numpy()
    return [share(SCALES[name](table).to_numpy(), y, series) for name in scales]


def verdict(found: pd.DataFrame, nulls: Sequence[str] = NULLS) -> str:
    """Return "holds", "refuted" or "not told" for the first scale; see the rule."""
    own, table = found.iloc[0]["share"], found.set_index("scale")
    others = table.loc[list(nulls), "better_than_first"]
    if (others >= CHANCE).any():
        return "refuted"
    return "holds" if own >= ENOUGH and (others <= 1 - CHANCE).all() else "not told"


# --- the end -------------------------------------------------------------------------------------


def end(shares: np.ndarray, counts: np.ndarray) -> float:
    """Return where mean counts fall below 1/2 for good, on a line in ln of the share.

    0 if they are below everywhere, inf if the last one is not.

    Args:
        shares: L_c/L, rising, shape (n,).
        counts: mean counts there, shape (n,).
    """
    above = np.flatnonzero(counts >= 0.5)
    if not above.size:
        return 0.0
    if (k := int(above[-1])) == len(counts) - 1:
        return np.inf
    part = (counts[k] - 0.5) / (counts[k] - counts[k + 1])
    return float(np.exp(np.interp(part, [0, 1], np.log(shares[k : k + 2]))))


def ends(runs: pd.DataFrame, column: str = "n", draws: int = DRAWS) -> pd.DataFrame:
    """Return the end of precursors in each series, L_c/L, with draws of seeds at each point.

    Columns: series; end; low, high: 16 and 84 %; zone, blocks in X_c0 there (L_b for rate and
    state).
    """
    rows = []
    for name, part in runs.groupby("series", sort=False):
        by_share = [one[column].to_numpy() for _, one in part.groupby("share")]
        shares, rng = np.sort(part["share"].unique()), np.random.default_rng(1)
        value = end(shares, np.array([one.mean() for one in by_share]))
        drawn = [
            end(shares, np.array([rng.choice(one, len(one)).mean() for one in by_share]))
            for _ in range(draws)
        ]
        low, high = np.quantile(drawn, [0.16, 0.84], method="nearest")
        zone = value * float((part["zone"] / part["share"]).iloc[0])
        rows.append({"series": name, "end": value, "low": low, "high": high, "zone": zone})
    return pd.DataFrame(rows)


def spread_of_ends(found: pd.DataFrame, runs: pd.DataFrame) -> pd.DataFrame:
    """Return for each scale the std of the ln of ends, and largest over smallest.

    Series without an end in their range are left out; how many remain is the column series.
    """
    about = runs.drop_duplicates("series").set_index("series")
    known = found[np.isfinite(found["end"]) & (found["end"] > 0)].set_index("series")
    about = about.loc[known.index]
    rows = []
    for name, of in SCALES.items():
        at = of(about) / about["share"] * known["end"]
        rows.append(
            {
                "scale": name,
                "series": len(at),
                "std_ln": float(np.log(at).std()),
                "ratio": float(at.max() / at.min()),
            }
        )
    return pd.DataFrame(rows)
