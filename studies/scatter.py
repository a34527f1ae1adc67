"""Scatter of strength and first precursor with disorder of mu_s: 10 000 quasi-static sequences.

mu_s of the blocks in the Fig. 1 scene has a normal distribution about 0.7 (`Spread`). The width is
its standard deviation, divided by its mean. In one half of the sets blocks are independent, and the
width changes. In the other half the width is 5 %, and the correlation length changes. Each set has
1000 seeds.

strength
    Static F_T/F_N at which the first system-size event starts.
first precursor
    Static F_T/F_N at which the first precursor starts, and its length over L.
sizes
    Potencies of all finished events before the first system-size event of their run. b is the
    exponent with which the number of events above a potency falls. Potencies count from `COMPLETE`
    of the largest of all sets on, so all sets are compared over the same range.

Errors are standard errors. Errors of means, of standard deviations and of b are from a jackknife
over `GROUPS` independent groups of seeds.

Source: PRL 107, 074301 (2011), for the model; B. Efron, The Jackknife, the Bootstrap and Other
Resampling Plans (1982), for errors.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric.figures import DataFigure
from pyfric.record import b_value
from pyfric.scene import Scene, Spread, preset
from pyfric.sweeps import Ensemble, ensemble

__all__ = ["LENGTHS", "SEEDS", "WIDTHS", "errors", "field", "figure", "sets", "study", "table"]

WIDTHS = size((1e-4, 1e-3, 0.01, 0.03, 0.05), (0.05,))
"""Widths of mu_s of independent blocks."""
LENGTHS = size((5e-3, 10e-3, 20e-3, 40e-3, 80e-3), (5e-3, 10e-3, 20e-3))
"""Correlation lengths at the width `WIDTH`, in m; L is 140 mm."""
WIDTH = 0.05
SEEDS = size(1000, 40)
"""Seeds of each set."""
T_END = 1.3
"""End of runs, s, after the slider has slid as a whole."""
GROUPS = 20
"""Number of groups of seeds; each group is left out in turn."""
COMPLETE = 0.01
"""Least potency of compared events, as a share of the largest of all sets. Smaller events are few,
and slips of single blocks at the trailing edge. The value is a choice."""
LEAST = 1e-5
"""Smallest potency in the figure, as a share of the largest of all sets."""
COLUMNS = ("F_slide", "F_precursor", "L_p_first", "n_precursors", "t_slide")
EVENTS = ("t_start", "finished", "potency")
QUANTITIES = {
    "strength": "F_slide",
    "first_force": "F_precursor",
    "first_length": "L_p_first",
    "precursors": "n_precursors",
}
"""Name in the table -> column of `pyfric.RUN_COLUMNS`."""


def field(width: float, length: float) -> Spread:
    """Return mu_s of a set with a width and a correlation length (m)."""
    mean = preset("fig1").interface.mu_s
    return Spread(mean=mean, std=width * mean, correlation_length=length)


def sets() -> list[tuple[float, float]]:
    """Return the width and the correlation length (m) of each set."""
    return [*((width, 0.0) for width in WIDTHS), *((WIDTH, length) for length in LENGTHS)]


def study(
    scene: Scene | None = None,
    *,
    seeds: int = SEEDS,
    t_end: float = T_END,
    cache: bool | str | Path = True,
    say: Callable[[str], None] = lambda _: None,
) -> dict[tuple[float, float], Ensemble]:
    """Make all runs, and return the ensemble of each set.

    Args:
        scene: the scene; None means that of Fig. 1.
        seeds: number of seeds of each set. Each set has seeds of its own.
        t_end: end of the runs, in s.
        cache: as in `ensemble`.
        say: called with the name of each run.
    """
    scene, found = scene or preset("fig1"), {}
    for n, (width, length) in enumerate(sets()):
        say(f"width {width:g}, correlation length {1e3 * length:g} mm")
        found[width, length] = ensemble(
            scene,
            {"mu_s": field(width, length)},
            seeds,
            t_end,
            columns=COLUMNS,
            events=EVENTS,
            seed=n * seeds,
            cache=cache,
            progress=False,
        )
    return found


def errors(values: np.ndarray, groups: np.ndarray, of: Callable[[np.ndarray], float]) -> float:
    """Return the standard error of a statistic, by leaving out each group of values in turn.

    Args:
        values: shape (n,).
        groups: number of the group of each value, shape (n,).
        of: the statistic.
    """
    left = np.array([of(values[groups != group]) for group in np.unique(groups)])
    n = len(left)
    return float(np.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum()))


def table(found: dict[tuple[float, float], Ensemble]) -> pd.DataFrame:
    """Return one row for each set.

    Columns: width; correlation_length (m); runs; for each of `QUANTITIES` mean and std with their
    errors, and n, the number of runs with a value; events, the number of compared sizes; b and its
    error.
    """
    sizes = {key: _sizes(one) for key, one in found.items()}
    least = COMPLETE * max(potency.max() for potency, _ in sizes.values())
    rows = []
    for (width, length), one in found.items():
        runs, F_N = one.table, one.sweep.job(0).scene.F_N
        row = {"width": width, "correlation_length": length, "runs": len(runs)}
        row["complete"] = int((runs["status"] == "complete").sum())
        for name, column in QUANTITIES.items():
            values = runs[column].to_numpy() / (F_N if column.startswith("F_") else 1.0)
            known = np.isfinite(values)
            values, groups = values[known], (np.arange(len(runs)) % GROUPS)[known]
            row[f"{name}_n"] = len(values)
            for what, of in (("mean", np.mean), ("std", lambda x: np.std(x, ddof=1))):
                row |= {
                    f"{name}_{what}": of(values),
                    f"{name}_{what}_error": errors(values, groups, of),
                }
        potency, seed = sizes[width, length]
        large = potency >= least
        m, groups = np.log10(potency[large]), seed[large] % GROUPS
        of_b = lambda x: b_value(x, np.log10(least))[0]  # noqa: E731
        row |= {"events": len(m), "b": of_b(m), "b_error": errors(m, groups, of_b)}
        rows.append(row)
    return pd.DataFrame(rows)


def _sizes(found: Ensemble) -> tuple[np.ndarray, np.ndarray]:
    """Return the potencies (m^2) of events before the first system-size event, and their seeds."""
    events = found.events
    slides = found.table["t_slide"].fillna(np.inf)
    early = events["t_start"].to_numpy() < slides.loc[events["seed"]].to_numpy()
    kept = events[early & events["finished"] & (events["potency"] > 0)]
    return kept["potency"].to_numpy(), kept["seed"].to_numpy()


def counts(found: dict[tuple[float, float], Ensemble]) -> pd.DataFrame:
    """Return the number of events per run with at least a given potency, for each set.

    Columns: width; correlation_length (m); potency (m^2); number for each run; its error.
    """
    rows = []
    for (width, length), one in found.items():
        potency, seed = _sizes(one)
        runs = len(one.table)
        for least in np.geomspace(LEAST * potency.max(), potency.max(), 61):
            each = np.bincount(seed[potency >= least] - one.table.index[0], minlength=runs)
            error = each.std(ddof=1) / np.sqrt(runs)
            row = {"width": width, "correlation_length": length, "potency": least}
            rows.append(row | {"number": each.mean(), "error": error})
    return pd.DataFrame(rows)


def figure(found: dict[tuple[float, float], Ensemble]) -> DataFigure:
    """Return the study as a figure: scatter over width and correlation length, and sizes."""
    known, sizes = table(found), counts(found)
    fig = DataFigure(figsize=(7.6, 5.6), layout="constrained")
    FigureCanvasAgg(fig)
    axes = fig.subplots(2, 2)
    by_width = known[known["correlation_length"] == 0]
    by_length = known[known["width"] == WIDTH]
    marks = {"strength": "o", "first_force": "s", "first_length": "^"}
    names = {
        "strength": "strength $F_T/F_N$",
        "first_force": "force of first precursor",
        "first_length": "its length $L_p/L$",
    }
    for ax, part, x in (
        (axes[0, 0], by_width, 100 * by_width["width"]),
        (axes[0, 1], by_length, 1e3 * by_length["correlation_length"]),
    ):
        for name, mark in marks.items():
            y, error = part[f"{name}_std"], part[f"{name}_std_error"]
            how = {"fmt": f"{mark}-", "ms": 4, "lw": 0.8, "capsize": 2}
            ax.errorbar(x, y, yerr=error, label=names[name], **how)
        ax.set(ylabel="std over seeds", yscale="log")
    ax, top = axes[1, 0], axes[1, 0].twiny()
    for of, part, x, mark in (
        (ax, by_width, 100 * by_width["width"], "o"),
        (top, by_length, 1e3 * by_length["correlation_length"], "s"),
    ):
        how = {"fmt": f"{mark}-", "ms": 4, "lw": 0.8, "capsize": 2}
        how["color"] = "C0" if of is ax else "C1"
        of.errorbar(x, part["strength_mean"], yerr=part["strength_mean_error"], **how)
    ax.set(ylabel="mean strength $F_T/F_N$", xscale="log")
    ax.set_xlabel(r"std of $\mu_s$ over its mean (%), circles", color="C0")
    top.set_xlabel("correlation length (mm), squares", color="C1")
    ax = axes[1, 1]
    for (width, length), part in sizes.groupby(["width", "correlation_length"]):
        if (width, length) in ((WIDTHS[0], 0.0), (WIDTH, 0.0), (WIDTH, LENGTHS[2])):
            row = known[(known["width"] == width) & (known["correlation_length"] == length)].iloc[0]
            label = f"{100 * width:g} %" + (f", {1e3 * length:g} mm" if length else "")
            label += f": b = {row['b']:.4f} $\\pm$ {row['b_error']:.4f}"
            part = part[part["number"] > 2 * part["error"]]
            ax.errorbar(part["potency"], part["number"], yerr=part["error"], lw=0.9, label=label)
    ax.set(xlabel="potency $s$ (m$^2$)", ylabel="events of at least $s$ in a run")
    ax.set(xscale="log", yscale="log")
    ax.legend(frameon=False, fontsize=7, loc="lower left")
    axes[0, 0].set(xlabel=r"standard deviation of $\mu_s$ over its mean (%)", xscale="log")
    axes[0, 1].set(xlabel="correlation length (mm)")
    axes[0, 0].legend(frameon=False, fontsize=8, loc="lower right")
    for ax, letter in zip(axes.flat, "abcd", strict=True):
        at, ha = (0.97, "right") if letter in "bd" else (0.02, "left")
        ax.text(at, 0.97, f"({letter})", transform=ax.transAxes, va="top", ha=ha)
    fig.tables = {"table": known, "sizes": sizes}
    fig.caption = (
        "Quasi-static sequences of the Fig. 1 scene with random mu_s, 1000 seeds for each point. "
        "Scatter of strength and first precursor (a) with the width of independent blocks and (b) "
        "with the correlation length at 5 %, where 0 is independent blocks; (c) mean strength; (d) "
        "sizes of events before the first system-size event. Errors are standard errors."
    )
    return fig
