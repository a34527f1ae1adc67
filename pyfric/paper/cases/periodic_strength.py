"""A. Gounon and others, 2022: a front on an interface of periodic strength."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, DataFigure, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.cases.strip import START, STRENGTH, job
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given

if TYPE_CHECKING:
    from pyfric.record import Record

ROWS, COLUMNS, RATIO = 21, 320, 1.3
"""Numbers of rows and columns of blocks of the strip; approximate G_0 over the mean of Gamma."""
PERIOD, CONTRAST = 24, 0.15
"""Number of blocks in a period; half the difference of strengths over their mean."""


@case(
    "Periodic strength: the front is fast and slow in turn, at the period",
    "A. Gounon, S. Latour, J. Letort, A. El Arem (2022), hal-03946798",
    "trend",
    {
        "trend": "slow and fast episodes alternate (abstract); they go with the heterogeneities "
        "(EGU22-7600)",
        "strip": "that of the case strip, with strength 15 % above and below its mean in turn",
        "period": "24 blocks, three cohesive zones; choice",
    },
)
def periodic_strength(
    run: Runner, *, contrast: float = CONTRAST, rows: int = ROWS, columns: int = COLUMNS
) -> Found:
    """Measure the front speed in a strip of periodic strength, and the period of the speed."""
    n = np.arange(columns)
    sign = np.where(((n - START) // (PERIOD // 2)) % 2, 1.0, -1.0)
    (record,) = run([job(RATIO, rows, columns, 1, STRENGTH * (1 + contrast * sign))])
    table = _speeds(record, sign)
    v = np.log(table["v_over_c"].to_numpy())
    x = table["block"].to_numpy()
    left = v - np.polyval(np.polyfit(x, v, 2), x)
    power = np.abs(np.fft.rfft(left * np.hanning(len(left)), 16 * len(left))) ** 2
    frequency = np.fft.rfftfreq(16 * len(left))
    known = (frequency > 2 / len(left)) & (frequency < 1 / 6)
    period = 1 / frequency[known][np.argmax(power[known])]
    swing = float(np.exp(2 * np.std(left)))
    parts = [
        Claim(
            "periodic_strength a",
            "trend: the front's speed alternates at the period of the strength",
            float(period / PERIOD),
            Band(0.9, 1.1, "EGU22-7600: correlated with the heterogeneities; 10 % is a choice"),
            "period of the strongest Fourier component of ln v, over that of the strength",
            [given("uniform strength", contrast=0.0)],
        ),
        Claim(
            "periodic_strength b",
            "trend: fast and slow episodes",
            swing,
            Band(1.5, None, "abstract; the factor is a choice"),
            "exp of twice the standard deviation of ln v about a parabola",
            [given("uniform strength", contrast=0.0)],
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _speeds(record: Record, sign: np.ndarray) -> pd.DataFrame:
    """Return front speeds over c at blocks beyond the start, from rupture times of neighbours."""
    first = record.episodes.groupby("n")["t_start"].min().reindex(range(1, record.scene.N_x + 1))
    t = np.maximum.accumulate(first.to_numpy())
    known = np.flatnonzero(np.isfinite(t))
    n = np.arange(START + 4, known[-1] - 2)
    v = 4 / (t[n + 2] - t[n - 2])
    return pd.DataFrame({"block": n + 1, "v_over_c": v, "strong": sign[n] > 0})


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.2)
    axes.plot(table["block"], table["v_over_c"], color=BLUE, lw=0.9)
    axes.fill_between(table["block"], 0, 1, where=table["strong"], color="0.9", lw=0,
                      transform=axes.get_xaxis_transform())  # fmt: skip
    axes.set(xlabel="block", ylabel="front speed over $l\\sqrt{k/m}$", ylim=(0, None))
    fig.caption = (
        "Speed of a front in a strip whose strength alternates by 15 % about its mean, over five "
        "blocks. Grey: strong blocks."
    )
    fig.tables = {"speeds": table}
    return fig
