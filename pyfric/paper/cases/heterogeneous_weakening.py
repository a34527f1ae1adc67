"""M. Lebihain and others, 2022: nucleation lengths where the rate of weakening varies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, VERMILION, DataFigure, legend, mark, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.cases.interface import MODULUS, half_space, slipping, stiffness_of
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given

L_C = 32
"""Number of blocks in the nucleation length at the mean rate of weakening."""
SIZES = (1, 2, 4, 8, 16, 32, 64, 128)
"""Sizes of asperities in blocks."""
CONTRAST = 0.5
"""Contrast c. Rates of weakening are 1 - c and 1 + c times their mean."""


@case(
    "Nucleation where the rate of weakening varies: the mean rate counts on small scales",
    "M. Lebihain, T. Roch, M. Violay, J.-F. Molinari (2021), arXiv:2102.10870",
    "trend",
    {
        "regimes": "local, extremal, homogenised; scales far below L_c are averaged (abstract)",
        "asperities": "weakening rates 0.5 and 1.5 times the mean, by coin; choice",
        "L_c": "32 blocks at the mean rate; slip grows to both sides of one place; choice",
    },
)
def heterogeneous_weakening(
    run: Runner,
    *,
    sizes: Sequence[int] = SIZES,
    seeds: int = 100,
    shape: tuple[int, int] = (240, 120),
    length: int = L_C,
) -> Found:
    """Compute nucleation lengths against the size of asperities, from static stiffness."""
    K = stiffness_of(half_space(*shape))
    mean = 2 * 1.158 * MODULUS / length
    uniform = _length(K, np.full(len(K), mean))
    rows = []
    for size in sizes:
        for seed in range(seeds):
            rate = mean * _asperities(len(K), size, seed)
            rows.append({"size": size / uniform, "seed": seed, "ratio": _length(K, rate) / uniform})
    table = pd.DataFrame(rows)
    ratio = table.groupby("size")["ratio"]
    spread = ratio.std() / ratio.mean()
    small, large = spread.index[0], spread.index[-1]
    damages = [given("asperities of two to four L_c alone", sizes=[2 * length, 4 * length])]
    parts = [
        Claim(
            "heterogeneous_weakening a",
            "asperities far below L_c: the nucleation length is that of the mean rate",
            float(ratio.mean()[small]),
            Band(0.95, 1.05, "abstract: can be averaged; 5 % is a choice"),
            f"mean over {seeds} interfaces, over L_c of the mean rate",
            damages,
            "With 64 blocks in L_c and asperities of the same size: 0.978 +- 0.012.",
        ),
        Claim(
            "heterogeneous_weakening b",
            "trend: nucleation lengths scatter with the size of asperities (homogenised to local)",
            float(spread[large] / spread[small]),
            Band(3.0, None, "abstract: regimes; the factor is a choice"),
            "scatter (std over mean) of the largest asperities over that of the smallest",
            damages,
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _asperities(N_x: int, size: int, seed: int) -> np.ndarray:
    """Return rates over their mean, high or low at random, in asperities that begin at random."""
    rng = np.random.default_rng([seed, size])
    coins = 1 + CONTRAST * rng.choice([-1.0, 1.0], N_x // size + 2)
    begin = int(rng.integers(size))
    return np.repeat(coins, size)[begin : begin + N_x]


def _length(K: np.ndarray, w: np.ndarray) -> float:
    """Return the length, in blocks (interpolated), at which the central patch loses stability."""
    middle = len(K) // 2

    def largest(half: int) -> float:
        return slipping(K, slice(middle - half, middle + half), w)

    low, high = 1, len(K) // 2 - 10
    if largest(high) < 1:
        return np.nan
    while high - low > 1:
        half = (low + high) // 2
        low, high = (half, high) if largest(half) < 1 else (low, half)
    below, above = largest(low), largest(high)
    return 2 * (low + (1 - below) / (above - below))


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.4)
    ratio = table.groupby("size")["ratio"]
    axes.plot(table["size"], table["ratio"], ".", color="0.75", ms=2, label="interfaces")
    axes.errorbar(
        ratio.mean().index, ratio.mean(), ratio.std(), fmt="o", color=BLUE, ms=3.5, lw=0.8,
        label="mean, standard deviation",
    )  # fmt: skip
    mark(axes, 1.0, "mean rate", at=0.98, ha="right")
    for rate, text in ((1 + CONTRAST, "fast"), (1 - CONTRAST, "slow")):
        axes.axhline(1 / rate, color=VERMILION, lw=0.7, ls=":")
        axes.text(table["size"].min(), 1 / rate, f"{text} rate alone", fontsize=7, va="bottom")
    axes.set(xscale="log", xlabel="size of asperities over $L_c$", ylabel="nucleation length/$L_c$")
    axes.set_ylim(0.45, 2.55)
    legend(axes, loc="upper left")
    fig.caption = (
        "Nucleation lengths of slip that grows to both sides of one place on interfaces whose "
        "weakening rate is 0.5 or 1.5 times the mean, over the size of asperities. L_c is the "
        "length at the mean rate. Dotted: lengths at either rate alone."
    )
    fig.tables = {"lengths": table}
    return fig
