"""G. Albertini and others, 2020, S. Schär and others, 2021: interfaces of random strength."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.cases.interface import MODULUS, half_space, stiffness_of, strength
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import Spread, Walls

L_C = 24
"""Number of blocks in the nucleation length."""
LENGTHS = (0.125, 0.25, 0.5, 1.0, 2.0)
"""Correlation lengths over the nucleation length."""
MEAN, STD = 0.7, 0.035
"""Mean and standard deviation of mu_s."""


@case(
    "Random strength: the longer its correlation, the lower and the more scattered static friction",
    "G. Albertini, S. Karrer, M. D. Grigoriu, D. S. Kammer (2020), "
    "arXiv:2005.06113; S. Schär, G. Albertini, D. S. Kammer (2021), arXiv:2010.04343",
    "trend",
    {
        "correlation": "longer: lower static friction; shorter: higher, less scattered (abstract)",
        "strength": "mean 0.7 p, standard deviation 5 %; choice",
        "L_c, L": "24 and 240 blocks, 100 interfaces, uniform load, linear weakening; choice",
    },
)
def random_strength(
    run: Runner,
    *,
    lengths: Sequence[float] = LENGTHS,
    seeds: int = 100,
    shape: tuple[int, int] = (240, 60),
    L_c: int = L_C,
    std: float = STD,
) -> Found:
    """Compute the load at which slow slip loses stability, against correlation length."""
    walls = Walls(left="mirrored", right="mirrored", top="held")
    K = stiffness_of(half_space(*shape, walls=walls))
    w = 2 * 1.158 * MODULUS / L_c
    rows = []
    for length in lengths:
        for seed in range(seeds):
            field = Spread(mean=MEAN, std=std, correlation_length=length * L_c, seed=seed)
            tau, n = strength(K, np.asarray(half_space(*shape, mu_s=field).law.mu_s), w)
            rows.append({"xi": length, "seed": seed, "strength": tau / MEAN, "patch": n / L_c})
    table = pd.DataFrame(rows)
    of = table.groupby("xi")["strength"]
    mean, scatter = of.mean(), of.std()
    damages = [given("hardly any disorder, 0.001 %", std=1e-5 * MEAN)]
    parts = [
        Claim(
            "random_strength a",
            "trend: longer correlation, lower strength",
            float(mean.iloc[-1] - mean.iloc[0]),
            Band(None, -0.01, "abstract; the size is a choice"),
            "mean strength over mean local strength, longest less shortest correlation",
            damages,
            "From L_c on it falls no further; 24 and 12 blocks in L_c agree within 0.003.",
        ),
        Claim(
            "random_strength b",
            "trend: longer correlation, more scatter",
            float(scatter.iloc[-1] / scatter.iloc[0]),
            Band(1.5, None, "abstract; the factor is a choice"),
            "standard deviation, longest over shortest correlation",
            [given("one correlation length", lengths=[1.0])],
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.3)
    axes.plot(table["xi"], table["strength"], ".", color="0.75", ms=2, label="interfaces")
    of = table.groupby("xi")["strength"]
    axes.errorbar(of.mean().index, of.mean(), of.std(), fmt="o", color=BLUE, ms=3.5, lw=0.8,
                  label="mean, standard deviation")  # fmt: skip
    axes.set(xscale="log", xlabel="correlation length over $L_c$", ylabel="strength over its mean")
    axes.set_xticks(sorted(of.groups), [f"{xi:g}" for xi in sorted(of.groups)])
    axes.minorticks_off()
    legend(axes, loc="lower left")
    fig.caption = (
        "Uniform shear at which slow slip loses stability, over the mean of the local strength, on "
        "interfaces whose strength varies by 5 %, over its correlation length in L_c."
    )
    fig.tables = {"strengths": table}
    return fig
