"""R. Capozza and N. Pugno, 2015: static friction of a slider with grooves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, DataFigure, mark, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import preset
from pyfric.sweeps import Job

GROOVES = (0, 1, 2, 4, 7, 14)
"""Numbers of grooves of one block each, evenly spread."""
T_END = 1.3
"""End of runs, after several events over the whole interface, s."""


@case(
    "Grooves: a few lower static friction, many do so less",
    "R. Capozza, N. Pugno, Tribol. Lett. (2015), doi:10.1007/s11249-015-0510-9, arXiv:1605.04088",
    "trend",
    {
        "trend": "a low density of grooves lowers static friction, a higher one weakens this "
        "(abstract)",
        "slider": "setup 1 of the paper of pyfric, pushed at a side, quasi-static; choice",
        "grooves": "one block, 2.5 mm, each; choice",
    },
)
def surface_grooves(run: Runner, *, grooves: Sequence[int] = GROOVES) -> Found:
    """Measure the largest force as a function of the number of grooves."""
    how = {"fidelity": "quasistatic", "geometry": "linear", "verify": "none"}
    records = run([Job(preset("fig1", contact=_contact(n)), T_END, how) for n in grooves])
    largest = [record.events["F_T_start"].max() / record.scene.F_N for record in records]
    table = pd.DataFrame({"grooves": grooves, "largest_force": largest})
    ratio = (table["largest_force"] / table["largest_force"].iloc[0] - 1).to_numpy()
    alike = [given("flat sliders instead", grooves=(0,) * len(GROOVES))]
    parts = [
        Claim(
            "surface_grooves a",
            "trend: a few grooves lower static friction",
            float(ratio[1:3].min()),
            Band(None, -0.02, "abstract; the size is a choice"),
            "change of the largest F_T by one or two grooves",
            alike,
            "A slider pushed at a side breaks piece by piece anyway: its largest force is "
            "little more than that of kinetic friction, with and without grooves.",
        ),
        Claim(
            "surface_grooves b",
            "trend: many grooves lower it less",
            float(ratio[-1] - ratio[1:3].min()),
            Band(0.01, None, "abstract; the size is a choice"),
            "change by most grooves less that by a few",
            alike,
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _contact(grooves: int, N_x: int = 57) -> list[bool]:
    """Return whether each block touches the substrate; blocks at evenly spread grooves do not."""
    touches = np.ones(N_x, bool)
    touches[[round((n + 1) * (N_x - 1) / (grooves + 1)) for n in range(grooves)]] = False
    return touches.tolist()


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.2)
    axes.plot(table["grooves"], table["largest_force"], "o-", color=BLUE, ms=3.5, lw=0.8)
    mark(axes, 0.45, r"$\mu_k$", at=0.9)
    axes.set(xlabel="grooves", ylabel="largest $F_T/F_N$")
    fig.caption = "Largest force of setup 1, quasi-static, over the number of its grooves."
    fig.tables = {"forces": table}
    return fig
