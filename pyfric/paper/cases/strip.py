"""H. Weng and J.-P. Ampuero, 2019: fronts in a strip of fixed height, here in two dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, DataFigure, mark, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.cases.interface import half_space
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import Walls
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record

ROWS, COLUMNS = 21, 320
"""Numbers of rows and columns of blocks of the strip; H = 20 l."""
STRENGTH, D_C = 0.25, 1.7
"""(mu_s - mu_k) p in p, and d_c in p/k: the cohesive zone at rest spans eight blocks."""
START = 40
"""Number of blocks with strength equal to their shear, which start the front without overstress."""
MU_K = 0.45
RATIOS = (0.8, 0.9, 0.97, 1.03, 1.1, 1.2, 1.35)
"""G_0 over Gamma of the other blocks."""
HIGHER = (0.4, 0.5, 0.6, 0.7)
STEP = 0.3
"""Time step, in sqrt(m/k)."""


@case(
    "A strip with held top: fronts need an energy release that the height limits",
    "H. Weng, J.-P. Ampuero, J. Geophys. Res. 124, 8584 (2019), doi:10.1029/2019JB017684",
    "number",
    {
        "G_0": "gamma Dtau^2 W/mu (abstract); for a strip in two dimensions Dtau^2 H/(2 mu), from "
        "the energy that a unit of length loses",
        "mu": "k/2 of the lattice, for a unit of thickness",
        "H, X_c0": "20 and 8 blocks; choice",
    },
)
def strip(
    run: Runner,
    *,
    ratios: Sequence[float] = RATIOS,
    rows: int = ROWS,
    columns: int = COLUMNS,
    higher: int = 1,
) -> Found:
    """Measure fronts against G_0/Gamma; a damage holds the top `higher` times as high."""
    jobs = [job(ratio, rows, columns, higher) for ratio in ratios]
    H = rows - 1
    reached = [(_reached(record) - START) / H for record in run(jobs)]
    table = pd.DataFrame({"G_0_over_Gamma": ratios, "reached_over_H": reached})
    through = table["reached_over_H"] > (0.94 * columns - START) / H
    critical = (
        table["G_0_over_Gamma"][~through].max() + table["G_0_over_Gamma"][through].min()
    ) / 2
    return Found(
        [
            Claim(
                "strip",
                "a front runs on if G_0 = Dtau^2 H/(2 mu) exceeds Gamma",
                float(critical),
                Band(0.9, 1.1, "abstract; 10 % for lattice, viscosity and distance of the runs"),
                "G_0/Gamma between the last front that stops and the first that runs through",
                [given("top held at twice the height", higher=2, ratios=HIGHER)],
                "Twice as fine: between 1 and 1.1, too. A third of the viscosity: 1.15, three "
                "times of it: 1.02.",
            ),
        ],
        lambda: _drawn(table),
    )


def job(
    ratio: float, rows: int, columns: int, higher: int, strength: np.ndarray | float = STRENGTH
) -> Job:
    """Return the run of a strip whose first blocks are weaker than the others.

    Args:
        ratio: G_0 over Gamma.
        rows, columns: numbers of rows and columns of blocks.
        higher: height of the held top, over that of `rows`.
        strength: (mu_s - mu_k) p of each block, in p; Gamma belongs to `STRENGTH`.
    """
    Gamma = STRENGTH * D_C / 2
    H = rows - 1
    drop = np.sqrt(ratio * Gamma / H)
    mu_s = np.broadcast_to(MU_K + strength, columns).copy()
    mu_s[:START] = MU_K + 0.99 * drop
    scene = half_space(
        columns,
        higher * H + 1,
        tau=MU_K + drop,
        mu_s=mu_s.tolist(),
        mu_k=MU_K,
        d_c=D_C,
        walls=Walls(left="mirrored", right="absorbing", top="held"),
    )
    t_end = 6.0 * columns
    how = {"fidelity": "dynamic", "verify": "none", "energies": False, "dt": STEP}
    how |= {"sample": t_end / 100, "stop_when": ("arrested", f"reached = {0.95 * columns}")}
    return Job(scene, t_end, how)


def _reached(record: Record) -> int:
    """Return the number of blocks that the front from the mirror line has reached."""
    return int(record.events["last_block"].max())


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.2)
    axes.plot(table["G_0_over_Gamma"], table["reached_over_H"], "o-", color=BLUE, ms=3.5, lw=0.8)
    mark(axes, 1.0, r"$G_0 = \Gamma$", vertical=True, at=0.9)
    axes.set(xlabel=r"$G_0/\Gamma$", ylabel="way of the front over $H$", ylim=(0, None))
    fig.caption = (
        "How far fronts run in a strip whose top is held, beyond the blocks that start them, over "
        "the steady energy release G_0 = Dtau^2 H/(2 mu) over the fracture energy Gamma."
    )
    fig.tables = {"fronts": table}
    return fig
