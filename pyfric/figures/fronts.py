"""Fig. 4: how fast rupture fronts run, and the prestress that they meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pyfric.figures.spacetime import LOOKS as LINES
from pyfric.figures.spacetime import speeds
from pyfric.figures.stresses import longest_precursor
from pyfric.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PAPER,
    VERMILION,
    DataFigure,
    caption,
    figure,
    legend,
    listed,
    mark,
    panels,
    single,
)
from pyfric.record import PER_BIN, Record, collapse_spread, front, fronts
from pyfric.scene import Scene

LOOKS = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (VERMILION, "D"))
"""Colour and marker of each run."""
MEDIANS = 10
"""Bins of the medians of a run."""
MEDIAN = {"mec": "black", "mew": 0.5, "ms": 3.4}
"""Look of their markers."""


@figure("Fig. 4(a): front speed and prestress in one precursor", runs="fig1", precursor=11)
def fig4a(record: Record, event: int | None = None) -> DataFigure:
    """Fig. 4(a) of the paper: front speed and prestress along the interface in one precursor.

    Top: v_c, averaged over five blocks, with the wave speeds of the lattice. Bottom: tau/p of the
    static state just before the event, with mu_s and mu_k.

    Args:
        record: a run with the small steps of want = "front_speed".
        event: its number, from 1; None means the longest precursor of the first loading.

    Raises:
        SceneError: there is no such event.
    """
    single(record)
    event = longest_precursor(record) if event is None else event
    table = front(record, event)
    friction, row = record.scene.law.mean, record.events.loc[event]
    fig, (top, bottom) = panels(3.4, sharex=True, ratios=(1.2, 1))
    _speeds(top, record.scene)
    top.plot(table["x_over_L"], table["v_c"], color=BLUE, lw=0.9, marker="o", ms=2.8)
    top.set_ylim(0, 1.1 * np.nanmax([*table["v_c"], *_wave_speeds(record.scene).values()]))
    top.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)")
    mark(bottom, friction.mu_s, r"$\mu_\mathrm{s}$", at=0.97, away=(0, 1), ha="right")
    mark(bottom, friction.mu_k, r"$\mu_\mathrm{k}$", at=0.97, away=(0, 1), ha="right")
    bottom.plot(table["x_over_L"], table["tau_over_p"], color=VERMILION, lw=0.9, marker="s", ms=2.8)
    bottom.set_ylim(min(0.0, table["tau_over_p"].min()), 1.35 * friction.mu_s)
    bottom.set_ylabel(r"prestress $\tau/p$")
    bottom.set_xlabel(r"position $x/L$ from the trailing edge")
    bottom.set_xlim(-0.01, max(table["x_over_L"].max() * 1.05, 0.05))
    fig.align_ylabels([top, bottom])
    fig.tables = {"front": table}
    known = table["v_c"].dropna()
    between = int(table["v_c"].isna().sum()) - 4
    what = (
        f"Speed of the rupture front (a) and tau/p just before it (b), event {event} "
        f"(L_p/L = {row['L_p_over_L']:.3g}, {len(known)} points); after Fig. 4(a) of {PAPER}. "
        f"There is no speed at two blocks at each end, and at {max(between, 0)} more whose five "
        "times do not increase. Dashed: long waves of the lattice, and mu_s, mu_k."
    )
    fig.caption = caption(record, what)
    return fig


@figure("Fig. 4(b): front speed against prestress, runs 1 to 4", runs="fig4b")
def fig4b(records: Sequence[Record]) -> DataFigure:
    """Fig. 4(b) of the paper: front speed against prestress, all main events of several runs.

    Top: against tau/p. Bottom (its inset): against (tau/p - mu_k)/(mu_s - mu_k).

    Args:
        records: runs with the small steps of want = "front_speed".

    Raises:
        SceneError: there is no record.
    """
    records = listed(records)
    tables = [fronts(one).assign(run=n, scene=one.scene.name) for n, one in enumerate(records, 1)]
    points = pd.concat(tables, ignore_index=True)
    blocks = len(points)
    points = points[np.isfinite(points["v_c"]) & np.isfinite(points["tau_over_p"])]
    points = points.reset_index(drop=True)
    fig, both = panels(4.4, (1, 1), sharey=True)
    handles, medians = _draw_runs(both, records, points)
    for axes in both:
        axes.set_yscale("log")
        _speeds(axes, records[0].scene)
        axes.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)")
    if len(medians):
        look = {"marker": "o", "mfc": "white", "color": "0.4", **MEDIAN}
        handles.append(Line2D([], [], label="medians", **look))
    legend(both[0], handles=handles, loc="lower right")
    both[0].set_xlabel(r"prestress $\tau/p$")
    scaled = r"(\tau/p-\mu_\mathrm{k})/(\mu_\mathrm{s}-\mu_\mathrm{k})"
    both[1].set_xlabel(rf"scaled prestress ${scaled}$")
    fig.tables = {"points": points, "medians": medians}
    what = (
        "Speed of rupture fronts against tau/p just before the event (a) and against "
        f"(tau/p - mu_k)/(mu_s - mu_k) (b); after Fig. 4(b) of {PAPER} and its inset. "
        f"{len(points)} blocks in {points.groupby(['run', 'event']).ngroups} main events. "
        f"{blocks - len(points)} blocks are left out: they are open or have no speed, at the ends "
        "of a front or where five times do not increase. Dashed: long waves of the lattice."
    )
    if len(medians):
        what += f" Lines: medians in {MEDIANS} bins of equal numbers of points."
    fig.caption = caption(records, what)
    return fig


def _draw_runs(
    both: Sequence[Axes], records: Sequence[Record], points: pd.DataFrame
) -> tuple[list[Line2D], pd.DataFrame]:
    """Draw the points of each run and, over them, its medians, where there are enough points.

    Returns:
        One legend handle for each run; run, scene, axis, its median, and v_c of each median.
    """
    handles, tables = [], [pd.DataFrame(columns=["at", "v_c", "run", "scene", "axis"])]
    for n, one in enumerate(records, 1):
        colour, shape = LOOKS[(n - 1) % len(LOOKS)]
        rows, friction = points[points["run"] == n], one.scene.law.mean
        look = {"ls": "", "marker": shape, "ms": 1.8, "color": colour, "alpha": 0.35, "mew": 0.3}
        look["zorder"] = 3 - len(rows) / max(len(points), 1)  # few on top
        look["rasterized"] = len(rows) > 5000
        medians = {"color": colour, "marker": shape, "lw": 1.2, "zorder": 5, **MEDIAN}
        for axes, x in zip(both, ("tau_over_p", "scaled"), strict=True):
            axes.plot(rows[x], rows["v_c"], **look)
            if len(rows) >= PER_BIN * MEDIANS:
                edges = collapse_spread(rows[x], rows["v_c"], bins=MEDIANS).edges
                cut = pd.cut(rows[x], np.unique(edges), include_lowest=True)
                table = rows.groupby(cut, observed=True)[[x, "v_c"]].median()
                table = table.rename(columns={x: "at"}).reset_index(drop=True)
                axes.plot(table["at"], table["v_c"], **medians)
                tables.append(table.assign(run=n, scene=one.scene.name, axis=x))
        name = rf"{one.scene.name}: $\mu_\mathrm{{s}}$, $\mu_\mathrm{{k}}$ = "
        label = name + f"{friction.mu_s:g}, {friction.mu_k:g}"
        handles.append(Line2D([], [], ls="", marker=shape, color=colour, ms=3.5, label=label))
    return handles, pd.concat(tables[1:] or tables)


def _speeds(axes: Axes, scene: Scene) -> None:
    for name, speed in _wave_speeds(scene).items():
        mark(axes, speed, LINES[name][-1], at=0.985, away=(0, 1), ha="right")


def _wave_speeds(scene: Scene) -> dict[str, float]:
    """Return the speeds of long waves that the paper shows, c_L and c_S, or c of a chain, m/s."""
    return {name: speed for name, speed in speeds(scene).items() if name != "c_R"}
