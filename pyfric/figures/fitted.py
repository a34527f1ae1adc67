"""Figures of a fit (data, model, residuals, profiles), and a tornado plot of sensitivities."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pyfric.figures.style import (
    BLACK,
    BLUE,
    COLUMN_WIDTH,
    GREY,
    ORANGE,
    SMALL,
    VERMILION,
    DataFigure,
    legend,
    style,
)
from pyfric.fitting import COUNTS, QUANTITIES, Fit, Sensitivity

LIMITS = (-2, 2)
"""Range, in standard deviations, that holds most residuals of a model that fits."""


def fit_page(fit: Fit) -> DataFigure:
    """Draw a fit: forces of events or other measurements, residuals, and profiles.

    Returns:
        The figure. Its tables are "events", "others" and "profiles".
    """
    names = list(fit.profiles)
    fig = DataFigure(figsize=(2 * COLUMN_WIDTH, 4.2))
    grid = fig.add_gridspec(2, 1, height_ratios=(1.4, 1))
    top = grid[0].subgridspec(2, 1, height_ratios=(2, 1))
    forces, residuals = (fig.add_subplot(top[k]) for k in (0, 1))
    below = grid[1].subgridspec(1, max(len(names), 1))
    what = _draw_events(fit, forces, residuals) if len(fit.table) else _draw(fit, forces, residuals)
    for limit in (0, *LIMITS):
        residuals.axhline(limit, color=GREY, lw=0.6, ls="-" if not limit else "--", zorder=0)
    residuals.set_ylabel("residual\n(std. dev.)")
    residuals.margins(y=0.15)
    forces.sharex(residuals)
    forces.tick_params(labelbottom=False)
    style(forces, "a")
    style(residuals)
    for k, name in enumerate(names):
        axes, profile = fig.add_subplot(below[k]), fit.profiles[name]
        above = profile["chi2"] - profile["chi2"].min()
        axes.plot(profile["value"], above, ".-", color=BLACK, lw=0.8, ms=3)
        low, high = fit.intervals[name]
        ends = [fit.bounds[name][n] if np.isnan(v) else v for n, v in enumerate((low, high))]
        axes.axvspan(*ends, color=ORANGE, alpha=0.3, lw=0)
        axes.axvline(fit.values[name], color=VERMILION, lw=0.8)
        axes.set(xlabel=_said(name), ylabel=r"$\chi^2 - \chi^2_{min}$" if not k else "")
        axes.set_ylim(bottom=0)
        axes.ticklabel_format(useOffset=False)
        axes.locator_params(axis="x", nbins=4)
        style(axes, "bcdef"[k] if k < 5 else "")
    verdict = "fits" if fit.fits else "DOES NOT FIT"
    fig.caption = (
        f"(a) {what}, measured and of the model, and residuals; the model {verdict}: "
        f"chi^2 {fit.chi2:.4g} with {fit.dof} degrees of freedom. Others: profiles of parameters, "
        f"with intervals of {fit.level:.0%}"
        + ("." if fit.fits else f", for forces that are off by {fit.model_error:.2g} F_N.")
    )
    fig.tables = {
        "events": fit.table,
        "others": fit.others,
        "profiles": pd.concat(
            [pd.DataFrame(), *(fit.profiles[name].assign(parameter=name) for name in names)]
        ),
    }
    return fig


def _draw_events(fit: Fit, forces: Axes, residuals: Axes) -> str:
    """Draw measured and model forces of events, and residuals; return the title."""
    at = np.arange(1, len(fit.table) + 1)
    looks = {"peak": ("^", BLUE, "start"), "valley": ("v", VERMILION, "end")}
    for name, (symbol, colour, text) in looks.items():
        how = {"ms": 4, "color": colour, "mfc": "none", "mew": 0.7}
        forces.plot(at, fit.table[name], symbol, label=f"measured, {text}", **how)
        model = fit.table[f"model_{name}"]
        forces.plot(at, model, "_", color=BLACK, ms=6, label="model" if name == "peak" else None)
        residuals.plot(at, fit.table[f"off_{name}"], symbol, **how)
    forces.set(ylabel="$F_T/F_N$")
    residuals.set_xlabel("event")
    residuals.locator_params(axis="x", integer=True)
    legend(forces, loc="lower right")
    return "Forces of events"


LOOKS = {
    "curve": ("The loading curve", "$F_T/F_N$", "$t$ (s)"),
    "lengths": ("Lengths of precursors", "$L_p/L$", "$F_T/F_N$ after arrest"),
    "sizes": ("Numbers of a population of events", "value", ""),
    "arrivals": ("Arrivals of fronts", "$t$ (s)", "$x$ (m)"),
    "known": ("What was known", "value", ""),
}
"""Kind of measurement -> title and labels of the axes. The first kind present is drawn."""


def _draw(fit: Fit, values: Axes, residuals: Axes) -> str:
    """Draw other measurements of the first curve and of the model, and return the title."""
    part = fit.others[fit.others["curve"] == 1]
    kind = next(kind for kind in LOOKS if kind in set(part["kind"]))
    part = part[part["kind"] == kind]
    words = part["at"].map(lambda at: isinstance(at, str)).any()
    at = np.arange(len(part)) if words else part["at"].to_numpy(dtype=float)
    how = {"ms": 3, "color": BLUE, "mfc": "none", "mew": 0.7, "lw": 0.7}
    values.errorbar(at, part["measured"], part["error"], fmt="o", label="measured", **how)
    values.plot(at, part["model"], "_" if words else "-", color=BLACK, lw=0.8, label="model")
    residuals.plot(at, part["off"], "o", ms=3, color=BLUE, mfc="none", mew=0.7)
    if words:
        residuals.set_xticks(at, part["at"])
    what, label, below = LOOKS[kind]
    values.set(ylabel=label)
    residuals.set_xlabel(below)
    legend(values, loc="best")
    return what


def tornado(found: Sensitivity) -> DataFigure:
    """Draw changes of quantities with parameters as bars, the largest on top.

    Returns:
        The figure. Its table is "sensitivity".
    """
    table = found.table[np.isfinite(found.table["base"])]
    names = list(dict.fromkeys(table["quantity"]))
    columns, n = 2, len(set(table["parameter"]))
    rows = -(-len(names) // columns)
    fig = DataFigure(figsize=(2 * COLUMN_WIDTH, rows * (0.55 + 0.16 * n)))
    grid = fig.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(names) :]:
        axes.set_axis_off()
    for k, (name, axes) in enumerate(zip(names, grid, strict=False)):
        part = table[table["quantity"] == name]
        base, (unit, _) = part["base"].iloc[0], QUANTITIES[name]
        change = part[["low", "high"]].sub(base, axis=0).fillna(0.0)
        order = np.argsort(change.abs().max(axis=1).to_numpy(), kind="stable")
        for end, colour, text in (("low", BLUE, "lower"), ("high", ORANGE, "higher")):
            at = np.arange(n) + (0.2 if end == "high" else -0.2)
            bars = change[end].to_numpy()[order]
            axes.barh(at, bars, height=0.4, color=colour, label=text)
        shares = 100 * part["step"] / part["value"].abs()
        names_of = zip(part["parameter"], shares, strict=True)
        steps = [f"{_said(key)} $\\pm$ {share:.2g} %" for key, share in names_of]
        axes.set_yticks(np.arange(n), [steps[i] for i in order])
        axes.axvline(0, color=BLACK, lw=0.6)
        if not change.to_numpy().any():
            axes.set_xlim(-1, 1)
        said = TEXTS[name] + (f" ({unit})" if unit != "1" else "")
        axes.set_xlabel(f"change of {said}; {base:.4g} now")
        axes.locator_params(axis="x", nbins=5, integer=name in COUNTS)
        style(axes, "abcdefgh"[k])
        axes.tick_params(which="both", right=False, left=False)
        axes.xaxis.label.set_size(SMALL)
    if len(names):
        legend(grid[0], loc="lower right", title="parameter")
    fig.caption = (
        "Changes of quantities if one parameter is lower or higher by its step: "
        + "; ".join(f"({'abcdefgh'[k]}) {QUANTITIES[name][1]}" for k, name in enumerate(names))
        + "."
    )
    fig.tables = {"sensitivity": found.table}
    return fig


TEXTS = {
    "first_force": "first force over $F_N$",
    "largest_force": "largest force over $F_N$",
    "largest_drop": "largest drop over $F_N$",
    "precursors": "number of precursors",
    "longest": "longest $L_p/L$",
    "system_size": "number of system-size events",
    "recurrence": "recurrence",
    "front_speed": "front speed",
}
SYMBOLS = {
    "mu_s": r"$\mu_s$",
    "mu_k": r"$\mu_k$",
    "F_N": "$F_N$",
    "V": "$V$",
    "K": "$K$",
    "k": "$k$",
}


def _said(name: str) -> str:
    return SYMBOLS.get(name, name)
