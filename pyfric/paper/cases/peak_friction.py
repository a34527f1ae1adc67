"""Z. Farkas and others, 2005: springs that break and come together out of phase."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.figures import BLACK, BLUE, ORANGE, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import Scene, chain
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record

WIDTHS = (0.0, 0.1, 0.3)
"""Half widths of a uniform distribution of thresholds, over their mean."""
P, MU_S, K_P, V, L = 20.0, 0.5, 2e5, 1e-5, 1e-3
PERIODS = 20.5
SAMPLES = 499


@case(
    "Springs that break one by one: static over kinetic friction by loss of phase",
    "Z. Farkas, S. R. Dahmen, D. E. Wolf, 2005, arXiv:cond-mat/0502644",
    "number",
    {
        "springs": "start without strain; each breaks at a largest strain of its own (abstract)",
        "width": "values and a uniform distribution: choice",
        "N": "60 springs; choice",
        "broken": "a spring holds again without strain: blocks with mu_k = mu_s/2; choice",
    },
)
def peak_friction(
    run: Runner,
    *,
    widths: tuple[float, ...] = WIDTHS,
    N: int = 60,
    kept: float = 0.0,
) -> Found:
    """Measure the ratio of the first peak to steady friction.

    `kept` is the share of strain that a spring keeps when it breaks.
    """
    period = MU_S * P / (K_P * V)
    options = {"fidelity": "hybrid", "dt": 1e-6, "sample": period / SAMPLES, "t_gap": 1e-5}
    jobs = [Job(_springs(N, w, kept), PERIODS * period, options) for w in widths]
    records = dict(zip(widths, run(jobs), strict=True))
    rows = [{"width": w, **_forces(record, period)} for w, record in records.items()]
    table = pd.DataFrame(rows)
    exact = 2 * (1 - table["width"])
    parts = [
        Claim(
            "peak_friction a",
            "first peak over steady friction at equal thresholds",
            float(table["ratio"].iloc[0]),
            Band(1.99, 2.01, "upper bound 2; samples of the mean"),
            "largest force where slip starts, in 1.5 periods, over the mean of ten later ones",
            [given("a third of the strain is kept", kept=1 / 3)],
        ),
        Claim(
            "peak_friction b",
            "the ratio falls with the width, from 2 towards 1",
            float(np.abs(table["ratio"] / exact - 1).max()),
            Band(None, 0.01, "samples of the mean, and a finite number of springs"),
            "largest |ratio/(2 - 2 w) - 1| for half widths w up to 0.3 of the mean",
            [given("a third of the strain is kept", kept=1 / 3)],
            "2 - 2 w, for a uniform distribution with w <= 1/3, is not from this source.",
        ),
    ]
    return Found(parts, lambda: _drawn(table, records, period))


def _springs(N: int, width: float, kept: float) -> Scene:
    """Return blocks coupled only by the plate; in slip a block keeps the share `kept` of strain."""
    mu_s = MU_S * (1 + width * np.linspace(-1, 1, N))
    return chain(
        L=(N - 1) * L,
        l=L,
        p=P,
        k=1e-3,
        eta=0.0,
        M=N * 1e-5,
        side="top",
        mu_s=mu_s.tolist(),
        mu_k=((1 + kept) / 2 * mu_s).tolist(),
        K=N * K_P,
        V=V,
    )


def _forces(record: Record, period: float) -> dict[str, float]:
    """Return the first peak and the steady mean force, over the mean threshold, and their ratio."""
    curve, events, whole = record.curve, record.events, record.scene.N_x * MU_S * P
    peak = float(events["F_T_start"][events["t_start"] < 1.5 * period].max()) / whole
    steady = curve["F_T"][(curve["t"] > 10.25 * period) & (curve["t"] <= 20.25 * period)]
    return {"peak": peak, "steady": steady.mean() / whole, "ratio": peak * whole / steady.mean()}


def _drawn(table: pd.DataFrame, records: dict[float, Record], period: float) -> DataFigure:
    """Draw force over time, and the ratio over the width."""
    fig, (axes, right) = panels(4.2, (1, 1))
    for (width, record), colour in zip(records.items(), (BLACK, BLUE, VERMILION), strict=False):
        curve, whole = record.curve, record.scene.N_x * MU_S * P
        axes.plot(
            curve["t"] / period, curve["F_T"] / whole, color=colour, lw=0.8, label=f"{width:g}"
        )
    axes.set(xlabel="time in periods", ylabel="force over mean threshold", xlim=(0, 8))
    axes.set_ylim(0, 1.3)
    legend(axes, title="half width w", ncols=3, loc="upper right")
    w = np.linspace(0, 1 / 3, 50)
    right.plot(w, 2 * (1 - w), color=ORANGE, label="2 - 2 w")
    right.plot(table["width"], table["ratio"], "o", color=BLACK, label="runs")
    right.set(xlabel="half width w of thresholds", ylabel="first peak over steady force")
    legend(right)
    fig.caption = (
        "Force of a plate on springs that break at thresholds of a uniform distribution, and its "
        "first peak over its mean once they are out of phase."
    )
    fig.tables = {"ratios": table}
    return fig
