"""Pictures of measured curves, of sweeps, and of one slab with several sizes of blocks."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pandas as pd

from pyfric.figures.loading import envelope
from pyfric.figures.style import BLUE, GREY, VERMILION, DataFigure, legend, panels, time_unit
from pyfric.measured import Curve, events
from pyfric.sweeps import MEASURED, Resolution, Results
from pyfric.values import SceneError, unknown

LINES = 8
"""Largest number of lines of a sweep, one for each set of values of its other fields."""


def curve_figure(curve: Curve) -> DataFigure:
    """Draw a measured curve: F_T/F_N, forces or slip over time, and its events.

    Returns:
        The figure. Its tables are "curve" and, if events are found, "events".
    """
    name, label = next(
        (name, label)
        for name, label in (
            ("mu", "$F_T/F_N$"),
            ("F_T", "$F_T$ (N)"),
            ("tau", r"$\tau$ (Pa)"),
            ("slip", "slip (m)"),
        )
        if name in curve.table
    )
    values, label = curve.table[name].to_numpy(), label
    found = None
    with suppress(SceneError):
        if curve.has_forces:
            values, label = curve.over_F_N, "$F_T/F_N$"
    with suppress(SceneError):
        found = events(curve)
    fig, (axes,) = panels(2.4)
    scale, unit = time_unit(float(np.ptp(curve.t)))
    shown = np.isfinite(values)
    axes.plot(*envelope(scale * curve.t[shown], values[shown]), color=BLUE, lw=0.6)
    fig.tables = {"curve": curve.table}
    counted = "events are not known"
    if found is not None:
        ends = ("peak", "valley") if "peak" in found else ("before", "after")
        for end, at, colour in zip(ends, ("t_start", "t_stop"), (VERMILION, GREY), strict=True):
            axes.plot(scale * found[at], found[end], ".", ms=3, color=colour, label=end)
        if len(found):
            legend(axes, loc="lower right")
        fig.tables["events"] = found
        counted = f"{len(found)} events"
    axes.set(xlabel=f"time ({unit})", ylabel=label)
    fig.caption = f"{curve.source or 'A curve'}: {len(curve.t)} samples; {counted}."
    return fig


def sweep_figure(results: Results, column: str | None = None) -> DataFigure:
    """Draw a column of the table of a sweep over its first field.

    In a grid, there is a line for each set of values of the other fields.

    Args:
        results: the results of a `pyfric.Sweep`.
        column: a number of each run, such as "n_precursors" or "t_slide"; None means "F_first", or
            "F_max" if no run has a main event.

    Returns:
        The figure. Its table is "sweep".

    Raises:
        SceneError: there is no such column.
    """
    table, (name, *rest) = results.table, list(results.sweep.over)
    column = column or ("F_first" if table["F_first"].notna().any() else "F_max")
    if column not in MEASURED:
        raise unknown("column", column, str(column), MEASURED)
    fig, (axes,) = panels(2.6)
    numbers = pd.to_numeric(table[name], errors="coerce")
    places = table[name].astype(str) if numbers.isna().any() else numbers
    lines = rest if results.sweep.points == "grid" else []
    parts = [((), table)]
    if lines:
        parts = list(table.astype(dict.fromkeys(lines, str)).groupby(lines, sort=False))
    for values, part in parts[:LINES]:
        text = ", ".join(f"{key} = {value}" for key, value in zip(lines, values, strict=True))
        look = ".-" if results.sweep.points == "grid" else "."
        axes.plot(places[part.index], table[column][part.index], look, ms=4, lw=0.8, label=text)
    unit, meaning = MEASURED[column]
    axes.set(xlabel=name, ylabel=column + (f" ({unit})" if unit != "1" else ""))
    if lines:
        legend(axes)
    left = f"; {LINES} of {len(parts)} lines are shown" if len(parts) > LINES else ""
    states = ", ".join(f"{n} {state}" for state, n in table["status"].value_counts().items())
    fig.caption = f"{column}, {meaning}, over {name}: {states}{left}."
    fig.tables = {"sweep": table}
    return fig


def resolution_figure(found: Resolution) -> DataFigure:
    """Draw results against the size of blocks, each over its value at the smallest l.

    Returns:
        The figure. Its table is "resolution".
    """
    table = found.table
    sizes = [column for column in table if not isinstance(column, str)]
    fig, (axes,) = panels(2.6)
    for quantity, row in table[sizes].astype(float).iterrows():
        if np.isfinite(row.iloc[-1]) and row.iloc[-1]:
            at = [1e3 * float(size) for size in sizes]
            axes.plot(at, row / row.iloc[-1], ".-", ms=4, lw=0.8, label=str(quantity))
    axes.set(xscale="log", xlabel="$l$ (mm)", ylabel="over the value at the smallest $l$")
    axes.axhline(1, color=GREY, lw=0.6, zorder=0)
    if axes.get_legend_handles_labels()[0]:
        legend(axes)
    fig.caption = "Results of one slab over the size of its blocks. " + " ".join(found.notes)
    fig.tables = {"resolution": table.reset_index()}
    return fig
