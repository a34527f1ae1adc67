"""M. Campillo and others, 2002: critical weakening of a patch between unbreakable barriers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, VERMILION, DataFigure, legend, mark, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.cases.interface import MODULUS, half_space, slipping, stiffness_of
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.sweeps import Job

BETA_0 = 1.158
"""beta_0 of the source: half length times weakening rate over modulus."""
BETA = (1.05, 1.1, 1.14, 1.18, 1.22, 1.3)
EDGE = (0.36, 0.4, 0.44, 0.48)
DROP, OVER = 0.25, 1e-3
"""mu_s - mu_k of the patch, and its initial shear above mu_s p, over mu_s p."""
BARRIER = 10.0
"""mu_s of the barriers."""
STEP, T_END = 0.3, 400.0
"""Time step and end of runs, in sqrt(m/k)."""


@case(
    "A patch between barriers: critical rate of weakening",
    "M. Campillo, P. Favreau, I. R. Ionescu, C. Voisin, J. Geophys. Res. 107 (2002), "
    "doi:10.1029/2002JB001969; K. Uenishi, J. R. Rice, J. Geophys. Res. 108, 2042 (2003), "
    "doi:10.1029/2001JB001681",
    "number",
    {
        "beta_0": "1.158 (abstract): a small patch of half length a has weakening rate beta_0/a",
        "modulus": "G in antiplane; G/(1 - nu) in plane (Uenishi and Rice)",
        "slip": "one body on a rigid plane: half of the slip between two bodies",
        "a": "n l/2 for n blocks",
    },
)
def patch(
    run: Runner,
    *,
    shape: tuple[int, int] = (240, 120),
    n: int = 12,
    edge: bool = False,
    beta: Sequence[float] = BETA,
) -> Found:
    """Measure the critical weakening of a patch of n blocks, in the middle or at a free edge."""
    static = 1 / slipping(stiffness_of(half_space(*shape)), _blocks(shape[0], n, edge), 1.0)
    size = shape[0] // 2, shape[1] // 2
    records = run([_job(b, size, n, edge) for b in beta])
    slips = [
        record.events["potency"].iloc[0] / (n * record.scene.interface.d_c) for record in records
    ]
    table = pd.DataFrame({"beta": beta, "slip_over_d_c": slips})
    ran = table["slip_over_d_c"] > 0.5
    found = (table["beta"][~ran].max() + table["beta"][ran].min()) / 2
    damages = [given("a patch at a free edge, with one barrier", edge=True, beta=EDGE)]
    parts = [
        Claim(
            "patch a",
            "critical weakening rate w a l/(2 k/3), from static stiffness",
            static * n / 2 / MODULUS,
            Band(0.995 * BETA_0, 1.005 * BETA_0, "abstract; 0.5 % for lattice and finite slab"),
            f"least w at which static stiffness of {n} blocks loses definiteness",
            damages,
        ),
        Claim(
            "patch b",
            "the same from runs of full dynamics",
            float(found),
            Band(BETA_0 - 0.03, BETA_0 + 0.03, "abstract; distance of the runs"),
            "middle between the last run in which slip stops before d_c/2 and the first beyond",
            damages,
        ),
    ]
    return Found(parts, lambda: _drawn(table, static * n / 2 / MODULUS))


def _blocks(N_x: int, n: int, edge: bool) -> slice:
    first = 0 if edge else (N_x - n) // 2
    return slice(first, first + n)


def _job(beta: float, size: tuple[int, int], n: int, edge: bool) -> Job:
    """Return the run of a patch that initially carries a little more than its strength."""
    mu_s, tau, inside = np.full(size[0], BARRIER), np.zeros(size[0]), _blocks(size[0], n, edge)
    mu_s[inside] = 0.7
    tau[inside] = 0.7 * (1 + OVER)
    w = beta * MODULUS / (n / 2)
    scene = half_space(*size, mu_s=mu_s.tolist(), mu_k=0.7 - DROP, d_c=DROP / w, tau=tau.tolist())
    return Job(scene, T_END, {"fidelity": "dynamic", "verify": "none", "dt": STEP})


def _drawn(table: pd.DataFrame, static: float) -> DataFigure:
    fig, (axes,) = panels(2.2)
    axes.plot(table["beta"], table["slip_over_d_c"], "o-", color=BLUE, ms=3.5, lw=0.8, label="runs")
    mark(axes, BETA_0, rf"$\beta_0$ = {BETA_0}", vertical=True, at=0.05)
    axes.axvline(static, color=VERMILION, lw=0.8, label="static stiffness")
    axes.set(xlabel=r"$\beta = w a/(\frac{2}{3} k l)$", ylabel="mean slip over $d_c$")
    axes.set(ylim=(0, None))
    legend(axes, loc="upper left")
    fig.caption = (
        "Slip of a patch of half length a between barriers, which starts 0.1 % above its "
        "strength, over the rate w at which its friction falls with slip. Dashed: the published "
        "critical rate. Red: rate at which static stiffness loses definiteness."
    )
    fig.tables = {"runs": table}
    return fig
