"""Results of the study `precursors`: the functions of its rule, its table and its figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import isotonic_regression
from sizes import size

from pyfric.figures import DataFigure

__all__ = [
    "ENOUGH",
    "ONE",
    "SCALES",
    "collapse",
    "end",
    "ends",
    "figure",
    "measured",
    "points",
    "report",
    "share",
    "tables",
    "verdict",
]

ENOUGH = 0.9
"""Least share of the variance that counts as a collapse."""
DRAWS = size(1000, 20)
"""Numbers of draws of series, and of seeds."""
CHANCE = 0.95
ONE = 1.5
"""Ratio of the largest to the smallest end below which all ends are one value."""
RESOLVED = 6
"""Fewest blocks in the zone, as in `pyfric.record.zones`."""
SAME = 0.2
"""Relative difference up to which ends on two lattices agree."""
SCALES: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "L_c/L": lambda of: of["L_c"] / of["L"],
    "L_c/H": lambda of: of["L_c"] / of["H"],
    "L_G/L": lambda of: of["L_energy"] / of["L"],
    "d_c": lambda of: of["d_c"],
    "L_c": lambda of: of["L_c"],
    "L_c/h": lambda of: of["L_c"] / of["h"],
    "L_c/l": lambda of: of["L_c"] / of["l"],
    "L_b/L": lambda of: of["zone"] * of["l"] / of["L"],
}
NULLS = ("d_c", "L_c", "L_c/h", "L_c/l")
WEAKENING = tuple(name for name in SCALES if name != "L_b/L")
RATED = ("L_c/L", "L_c/H", "L_b/L", "d_c", "L_c/h", "L_c/l")
"""Scales of both kinds of laws. L is the same in all series of rate and state."""
LARGEST = 5e-3
"""Larger spacing of the two compared lattices, m."""


# --- points --------------------------------------------------------------------------------------


def points(runs: pd.DataFrame, column: str = "n") -> pd.DataFrame:
    """Return one row for each series and L_c/L: its description, and a number of its runs.

    Columns added: runs; mean and error of the number over seeds; y = ln(1 + mean), and its error.
    """
    same = ["series", "share", "law", "d_c", "L_c", "L_energy", "L", "H", "l", "h", "zone"]
    groups = runs.groupby(same, sort=False)[column]
    table = groups.agg(runs="count", mean="mean", error="sem").reset_index()
    return table.assign(y=np.log1p(table["mean"]), y_error=table["error"] / (1 + table["mean"]))


# --- collapse ------------------------------------------------------------------------------------


def _curve(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of the least-squares curve that never rises."""
    at, where, count = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.bincount(where, y) / count
    return at, isotonic_regression(mean, weights=count, increasing=False).x


def share(x: np.ndarray, y: np.ndarray, series: np.ndarray) -> float:
    """Return the share of the variance of y that curves through the other series predict.

    Args:
        x: values of a scale, > 0, shape (n,).
        y: values to collapse, shape (n,).
        series: name of the series of each point, shape (n,).
    """
    x, left = np.log(x), np.empty(len(y))
    for name in np.unique(series):
        own = series == name
        left[own] = y[own] - np.interp(x[own], *_curve(x[~own], y[~own]))
    return float(1 - np.mean(left**2) / np.var(y))


def collapse(
    table: pd.DataFrame, scales: Sequence[str] = WEAKENING, draws: int = DRAWS
) -> pd.DataFrame:
    """Return the share of each scale, its 95 % interval, and how often it exceeds that of L_c/L.

    Args:
        table: the table of `points`.
        scales: names in `SCALES`, of which the first is compared with the others.
        draws: draws of series with replacement. Copies of a series are left out together.
    """
    rng, y = np.random.default_rng(1), table["y"].to_numpy()
    names, series = np.unique(table["series"], return_inverse=True)
    x = [SCALES[name](table).to_numpy() for name in scales]
    rows = [np.flatnonzero(series == k) for k in range(len(names))]

    def shares(kept: np.ndarray) -> list[float]:
        return [share(of[kept], y[kept], series[kept]) for of in x]

    found = []
    while len(found) < draws:
        drawn = rng.integers(len(names), size=len(names))
        if len(np.unique(drawn)) > 1:
            found.append(shares(np.concatenate([rows[k] for k in drawn])))
    low, high = np.quantile(found, [0.025, 0.975], axis=0)
    better = (np.array(found) > np.array(found)[:, :1]).mean(axis=0)
    about = {"scale": list(scales), "share": shares(np.arange(len(y))), "low": low, "high": high}
    return pd.DataFrame(about | {"better_than_first": better})


def verdict(found: pd.DataFrame, nulls: Sequence[str] = NULLS) -> str:
    """Return "holds", "refuted" or "not told" for the first scale; see the rule."""
    own, table = found.iloc[0]["share"], found.set_index("scale")
    others = table.loc[list(nulls), "better_than_first"]
    if (others >= CHANCE).any():
        return "refuted"
    return "holds" if own >= ENOUGH and (others <= 1 - CHANCE).all() else "not told"


# --- the end -------------------------------------------------------------------------------------


def end(shares: np.ndarray, counts: np.ndarray) -> float:
    """Return L_c/L where mean counts fall below 1/2 for good, interpolated in ln(L_c/L).

    The result is 0 if all counts are below 1/2, and inf if the last count is not.

    Args:
        shares: L_c/L, rising, shape (n,).
        counts: mean counts at these L_c/L, shape (n,).
    """
    above = np.flatnonzero(counts >= 0.5)
    if not above.size:
        return 0.0
    if (k := int(above[-1])) == len(counts) - 1:
        return np.inf
    part = (counts[k] - 0.5) / (counts[k] - counts[k + 1])
    return float(np.exp(np.interp(part, [0, 1], np.log(shares[k : k + 2]))))


def half(shares: np.ndarray, counts: np.ndarray) -> float:
    """Return L_c/L where mean counts first fall below half of the first count; see `end`.

    This value is outside the rule, and was added when counts were known.
    """
    below = np.flatnonzero(counts < counts[0] / 2)
    stop = below[0] + 1 if below.size else len(counts)
    return end(shares[:stop], counts[:stop] / max(counts[0], 1e-9))


def ends(
    runs: pd.DataFrame,
    column: str = "n",
    draws: int = DRAWS,
    end: Callable[[np.ndarray, np.ndarray], float] = end,
) -> pd.DataFrame:
    """Return L_c/L at the end of precursors in each series, with draws of seeds at each point.

    Columns: series; end; low, high: 16 and 84 %; zone, blocks in X_c0 at the end (in L_b for rate
    and state).
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
    """Return for each scale the std of ln of ends, and the ratio of the largest to the smallest.

    Series without an end in their range are left out; the column series has the number that remain.
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


# --- all of it -----------------------------------------------------------------------------------


def measured(runs: pd.DataFrame) -> pd.DataFrame:
    """Return runs with columns from lengths: first and longest precursor, in L, and large.

    large is the number of precursors at least as long as four blocks of `LARGEST`.
    """
    lengths = [np.array(str(text).split(), float) for text in runs["lengths"].fillna("")]
    reached = (runs["L"] + runs["l"]) * (1 + 1e-3)  # lengths are stored with four digits
    large = [(one * far >= 4 * LARGEST).sum() for one, far in zip(lengths, reached, strict=True)]
    first = [one[0] if one.size else np.nan for one in lengths]
    return runs.assign(
        first=first, longest=[one.max() if one.size else np.nan for one in lengths], large=large
    )


def tables(runs: pd.DataFrame, checks: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the tables of the study by name.

    Args:
        runs: the table of `precursors.study`.
        checks: the table of `precursors.checks`.
    """
    runs = measured(runs)
    found = points(runs)
    for column in ("n_by_rate", "first", "longest"):
        other = points(runs, column)
        found[[f"{column}_mean", f"{column}_error"]] = other[["mean", "error"]]
    own = []
    for by, column in {"contact": "n", "rate": "n_by_rate", "four blocks of 5 mm": "large"}.items():
        own.append(ends(runs, column).assign(by=by))
    own.append(ends(runs, end=half).assign(by="half of the first count"))
    scales, spreads = [], []
    for by, column in {"contact": "n", "rate": "n_by_rate"}.items():
        for law, part in _laws(runs).items():
            names = WEAKENING if law == "slip weakening" else RATED
            scales.append(collapse(points(part, column), names).assign(by=by, law=law))
            of = spread_of_ends(ends(part, column), part)
            spreads.append(of[of["scale"].isin(names)].assign(by=by, law=law))
    return {
        "runs": runs,
        "points": found,
        "ends": pd.concat(own, ignore_index=True),
        "collapse": pd.concat(scales, ignore_index=True),
        "spread": pd.concat(spreads, ignore_index=True),
        "checks": compared(runs, checks),
    }


def _laws(runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the runs with slip weakening, and those with rate and state, if any."""
    rated = runs["law"] == "rate_and_state"
    both = {"slip weakening": runs[~rated], "rate and state": runs[rated]}
    return {law: part for law, part in both.items() if part["series"].nunique() > 1}


def compared(runs: pd.DataFrame, checks: pd.DataFrame) -> pd.DataFrame:
    """Return counts and forces of runs beside those of full dynamics."""
    if not len(checks):
        return pd.DataFrame(columns=["series", "share", "n", "n_dynamic"])
    same = ["series", "share", "seed"]
    names = ["n", "n_by_rate", "F_first", "F_slide_by_rate", "seconds"]
    return checks[same + names].merge(
        runs[same + names], on=same, suffixes=("_dynamic", ""), validate="one_to_one"
    )


def report(found: dict[str, pd.DataFrame]) -> str:
    """Return the verdict, the ends and the checks as text."""
    lines = []
    for (law, by), part in found["collapse"].groupby(["law", "by"], sort=False):
        nulls = [name for name in NULLS if name in set(part["scale"])]
        lines.append(f"{law}, events by {by}: L_c/L {verdict(part, nulls)}")
        lines += [
            f"  {row['scale']}: {row['share']:.2f} ({row['low']:.2f} to {row['high']:.2f}), "
            f"better than L_c/L in {row['better_than_first']:.0%}"
            for _, row in part.iterrows()
        ]
    lines.append("ends in L_c/L, by contact and by rate")
    for name, part in found["ends"].groupby("series", sort=False):
        each = ", ".join(
            f"{row['end']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
            for _, row in part[part["by"].isin(["contact", "rate"])].iterrows()
        )
        lines.append(f"  {name}: {each}")
    return "\n".join(lines)


def figure(found: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the study as a figure: counts over d_c and L_c/L, lengths, and rate and state."""
    table = found["points"]
    rated = table["law"] == "rate_and_state"
    fig = DataFigure(figsize=(8.4, 7.6), layout="constrained")
    (by_d_c, by_share), (lengths, of_rate) = fig.subplots(2, 2)
    for (name, part), look in zip(table[~rated].groupby("series", sort=False), LOOKS, strict=False):
        how = {**look, "label": _label(name)} | LINES
        by_d_c.errorbar(1e6 * part["d_c"], part["mean"], part["error"], **how)
        by_share.errorbar(part["share"], part["mean"], part["error"], **how)
        longest = part["longest_mean"], part["longest_error"]
        lengths.errorbar(part["share"], *longest, **how)
    for (name, part), look in zip(table[rated].groupby("series", sort=False), LOOKS, strict=False):
        label = _label(name.removeprefix("rate and state, ")).replace("rate and state", "base")
        of_rate.errorbar(part["share"], part["mean"], part["error"], **look, label=label, **LINES)
    share = r"nucleation length over length of the slider, $L_\mathrm{c}/L$"
    panels = (
        (by_d_c, "(a) slip weakening, over $d_c$", r"slip of weakening $d_\mathrm{c}$ ($\mu$m)"),
        (by_share, "(b) the same runs over $L_c/L$", share),
        (lengths, "(c) their longest precursor", share),
        (of_rate, "(d) rate and state, over $L_c/L$", share),
    )
    ticks = (0.5, 1, 2, 5, 10, 20), *[(0.02, 0.05, 0.1, 0.2, 0.5)] * 2, (0.2, 0.4, 0.8, 1.6)
    for (axes, title, label), at in zip(panels, ticks, strict=True):
        axes.set_xscale("log")
        axes.minorticks_off()
        axes.set_xticks(at, [f"{one:g}" for one in at])
        axes.set_xlabel(label)
        axes.set_title(title, fontsize=9, loc="left")
        if axes is not lengths:
            axes.set_ylabel("precursors in a run")
            axes.set_yscale("symlog", linthresh=1, linscale=0.6)
            axes.set_yticks([0, 1, 2, 5, 10, 20, 50], ["0", "1", "2", "5", "10", "20", "50"])
            axes.set_ylim(bottom=-0.15)
    lengths.set_ylabel(r"longest precursor $L_\mathrm{p}/L$")
    lengths.set_ylim(0, 1)
    fig.legend(*by_d_c.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    if rated.any():
        of_rate.legend(fontsize=8, frameon=False)
    fig.tables = found
    fig.caption = (
        "Precursors before the first event of the whole slider: means over seeds of disorder in "
        "mu_s (3 %, correlation length 20 mm; f* by 1 % with rate and state), error bars are "
        "standard errors. Each series changes one thing of the Fig. 1 scene with l = 5 mm. L_c is "
        "the nucleation length of Uenishi and Rice, or of Rubin and Ampuero in (d). Hybrid engine, "
        "linear geometry, accuracy 1e-3."
    )
    return fig


def _label(name: str) -> str:
    """Return the name of a series with the paper's letters."""
    words = {"mu_s": r"$\mu_\mathrm{s}$", "F_N": r"$F_\mathrm{N}$"}
    for plain, letters in words.items():
        name = name.replace(plain, letters)
    return name


LINES: dict[str, Any] = {"ms": 3.5, "lw": 0.8, "capsize": 2, "elinewidth": 0.8}
LOOKS: tuple[dict[str, Any], ...] = tuple(
    {"color": colour, "fmt": f"{marker}{line}"}
    for marker, line, colour in (
        ("o", "-", "black"),
        ("s", "-", "#D55E00"),
        ("^", "-", "#009E73"),
        ("v", "-", "#0072B2"),
        ("D", "-", "#CC79A7"),
        ("P", "-", "#56B4E9"),
        ("<", "--", "#E69F00"),
        (">", "--", "#D55E00"),
        ("x", "--", "#009E73"),
        ("1", "--", "#0072B2"),
        ("2", "--", "#CC79A7"),
        ("o", ":", "black"),
        ("s", ":", "#D55E00"),
    )
)
"""Colours of series, in their order."""
