"""Accuracy and cost of each method in one panel, compared with the paper's, for the Fig. 1 scene.

The horizontal axis is the ratio of the processor time of the paper's method to that of a method.
The vertical axis is the largest error of start and arrest forces of main events, over F_N. Points
and errors are those of `studies/accuracy.py`. LAMMPS is timed on the bond forces of the steps of
velocity Verlet.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import accuracy as chart
import numpy as np
import pandas as pd
from beside import chart_points

from pyfric.engines import default_stepper, step_size
from pyfric.figures import DataFigure
from pyfric.figures.style import style
from pyfric.scene import preset
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE = "Fig. 1"
PAPER_DT = 0.2e-6
"""The paper's step in setup 1, s."""
PAPER = "RK4, switching at step ends\n(the paper's method)"
HYBRID = "hybrid engine"
VERLET = "velocity Verlet, step ends"
"""The steps on which LAMMPS is timed; not drawn."""
WANT = "precursors"
NEAR = 0.5
"""Largest ratio of errors, in decades, at which points share a label."""
RED, BLUE, GREY = "#C00000", "#0072B2", "0.35"


def methods() -> dict[str, chart.Method]:
    """Return the compared methods, by their names in the picture."""
    scene = preset("fig1")
    limit, _ = stability_limit(scene)
    own = ("located", step_size(scene) / limit, default_stepper(scene))
    return {
        PAPER: chart.Method("dynamic", "finite", "step_end", PAPER_DT / limit),
        "RK4, located switching": chart.Method("dynamic", "finite", "located", 0.5),
        "six stages, located switching": chart.Method("dynamic", "finite", *own),
        VERLET: chart.FULL,
        HYBRID: chart.Method("hybrid", "finite", *own),
        "hybrid engine,\nlinear geometry": chart.Method("hybrid", "linear", *own),
        "quasi-static\nsequence": chart.Method("quasistatic"),
    }


def points(*, progress: bool = False) -> pd.DataFrame:
    """Measure the points: columns of `accuracy.chart`, ``name``, and the ratio ``cheaper``."""

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    named = methods()
    table = pd.DataFrame(chart.points(SCENE, chart.scenes()[SCENE], say, tuple(named.values())))
    table = pd.concat([table, pd.DataFrame(chart_points(table))], ignore_index=True)
    table["name"] = table["kind"].map({"plan": "plan", "peer": "LAMMPS, bonds only"})
    table.loc[table["kind"] == "method", "name"] = list(named)
    paper = table.loc[table["name"] == PAPER, "seconds"].item()
    return table.assign(cheaper=paper / table["seconds"])


def figure(table: pd.DataFrame) -> DataFigure:
    """Return a figure of the table of `points`: error over cost of each method."""
    fig = DataFigure(figsize=(6.2, 3.6))
    axes = fig.subplots()
    style(axes)
    plans = table[(table["kind"] == "plan") & (table["want"] == WANT)]
    axes.loglog(plans["cheaper"], plans[WANT], "-o", color=BLUE, ms=4, lw=1.2)
    near = (np.log10(plans[WANT]).diff().abs() > NEAR).cumsum()
    for _, same in plans.groupby(near):
        text = f"pyfric's choice for a\ntolerance of {' or '.join(map(str, same['tolerance']))}"
        _name(axes, same.loc[same["cheaper"].idxmin()], text, BLUE, (-13, -22), "right")
    shown = table[table["kind"].isin(["method", "peer"]) & (table["name"] != VERLET)]
    for _, row in shown.iterrows():
        colour = RED if row["name"] == PAPER else GREY
        marker = "D" if row["kind"] == "peer" else "s"
        axes.loglog(row["cheaper"], row[WANT], marker, color=colour, ms=5)
        _name(axes, row, row["name"], colour)
    axes.set_xlabel("times cheaper than the paper's method")
    axes.set_ylabel(r"error of forces over $F_\mathrm{N}$")
    axes.set_xlim(0.6, table["cheaper"].max() * 6)
    axes.set_ylim(plans[WANT].min() / 20, shown[WANT].max() * 4)
    paper, best = (shown[shown["name"] == name].iloc[0] for name in (PAPER, HYBRID))
    fig.caption = (
        "Error of start and arrest forces (the largest of main events, over F_N) against processor "
        "time, compared with the paper's method: Fig. 1 scene, up to its fourth main event. The "
        f"hybrid engine is {best['cheaper']:.0f} times cheaper, and its error is {best[WANT]:.1g} "
        f"instead of {paper[WANT]:.1g}. Blue: pyfric's choice, "
        "with the coarser run that measures its error."
    )
    fig.tables = {"points": table}
    return fig


def _name(
    axes: Axes,
    row: pd.Series,
    text: str,
    colour: str,
    offset: tuple[float, float] = (7, -3),
    side: str = "left",
) -> None:
    look = {"fontsize": 7.5, "color": colour, "ha": side}
    axes.annotate(text, (row["cheaper"], row[WANT]), offset, textcoords="offset points", **look)
