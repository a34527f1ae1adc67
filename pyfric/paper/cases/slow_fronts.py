"""J. K. Trømborg and others, 2014: fronts on junctions that change from fast to slow."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, GREY, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.record import material_of
from pyfric.scene import preset, slab
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene
    from pyfric.scene.laws import FrictionLaw

SHEAR = (0.12, 0.135, 0.17)
"""tau_0/p of the interfaces."""
WIDTH = 0.2
"""Half width of the distribution of initial stretches of junctions, over u_s."""
PUSHED, EXCESS = 5, 0.2
"""Number of permanently pushed blocks, and excess of their force over mu_s p, over mu_s p."""
HEIGHT, T_END = 30e-3, 30e-3
"""Height of the slab (m), end of runs (s): 15 mean times t_R."""
SLOW = 0.03
"""Front speed over c_S below which a front counts as slow."""
AVERAGED = 4
"""Number of blocks over which a front speed is averaged."""


@case(
    "Junctions that slip for a while: fronts turn from fast to slow",
    "J. K. Trømborg, H. A. Sveinsson, J. Scheibert, K. Thøgersen, D. S. Amundsen, "
    "A. Malthe-Sørenssen, Proc. Natl. Acad. Sci. 111, 8764 (2014), "
    "doi:10.1073/pnas.1321752111, arXiv:1402.4700",
    "trend",
    {
        "junctions, F_N, k_f": "preset slow, which follows the source",
        "tau_0/p": "uniform, 0.135, and 0.12 and 0.17 beside it; choice",
        "width": "stretches of junctions spread by 0.2 u_s; choice",
    },
)
def slow_fronts(
    run: Runner, *, t_R: float = 2e-3, shear: Sequence[float] = SHEAR, t_end: float = T_END
) -> Found:
    """Measure fronts on slabs under uniform shear; t_R is the mean slip time of a junction, s."""
    rows = []
    for tau, record in zip(shear, run([_job(tau, t_R, t_end) for tau in shear]), strict=True):
        passed = passages(record, int(record.events["n_blocks"].idxmax()))
        v = speeds(passed, record.scene.slider.l) / material_of(record.scene).c_S
        rows.append(
            pd.DataFrame(
                {"tau_over_p": tau, "block": np.arange(1, len(v) + 1), "t": passed, "v_over_c_S": v}
            )
        )
    table = pd.concat(rows, ignore_index=True)
    known = table[table["block"] > 2 * PUSHED].dropna()
    drops = known.groupby("tau_over_p")["v_over_c_S"].agg(lambda v: v.max() / v.min())
    slowest = known["v_over_c_S"].min()
    damages = [given("junctions that slip for 20 us", t_R=2e-5)]
    parts = [
        Claim(
            "slow_fronts a",
            "trend: one front turns from fast to slow",
            float(drops.max()),
            Band(20.0, None, "abstract: much slower than fast fronts; the factor is a choice"),
            "largest over least speed along one front, over five blocks, beyond block 10",
            damages,
        ),
        Claim(
            "slow_fronts b",
            "trend: the slow part is far below the speed of sound",
            float(slowest),
            Band(None, SLOW, "abstract: much slower than sound; the limit is a choice", "c_S"),
            "least speed over five blocks, beyond block 10",
            damages,
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _job(tau: float, t_R: float, t_end: float) -> Job:
    law = dataclasses.replace(
        preset("slow").interface.law, t_R=t_R, t_R_std=0.3 * t_R, stretch=WIDTH
    )
    scene = prepared(tau, law, name=f"tau_0 = {tau:g} p")
    how = {"fidelity": "dynamic", "verify": "none", "energies": False, "sample": t_end / 100}
    return Job(scene, t_end, how | {"stop_when": f"reached = {scene.slider.L!r} m"})


def prepared(tau: float, law: FrictionLaw, name: str = "") -> Scene:
    """Return a slab of the preset `slow` under uniform shear, with its first blocks pushed.

    Args:
        tau: shear tau_0/p.
        law: law of its junctions.
        name: name of the scene.
    """
    slow = preset("slow")
    slider, interface, p = slow.slider, slow.interface, slow.F_N / slow.N_x
    push = EXCESS * interface.mu_s * p + (interface.mu_s - tau) * p
    return slab(
        p=p,
        tau=tau * p,
        L=slider.L,
        H=HEIGHT,
        l=slider.l,
        eta=slow.eta,
        dashpots=slider.dashpots,
        law=law,
        mu_s=interface.mu_s,
        mu_k=interface.mu_k,
        push=[(n, push) for n in range(1, PUSHED + 1)],
        name=name,
    )


def passages(record: Record, event: int) -> np.ndarray:
    """Return times (s) at which the front passes blocks from the trailing edge, or NaN, (N_x,)."""
    of_event = record.episodes[record.episodes["event"] == event]
    first = of_event.groupby("n")["t_start"].min()
    times = first.reindex(np.arange(1, record.scene.N_x + 1)).to_numpy()
    return np.maximum.accumulate(times)  # NaN from the first block on that does not rupture


def speeds(t: np.ndarray, l: float) -> np.ndarray:
    """Return front speeds (m/s) from passage times, NaN at two blocks from either end, (N_x,)."""
    v, half = np.full(len(t), np.nan), AVERAGED // 2
    with np.errstate(divide="ignore"):
        v[half:-half] = AVERAGED * l / (t[AVERAGED:] - t[:-AVERAGED])
    return v


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.4)
    for (tau, rows), colour in zip(
        table.groupby("tau_over_p"), (GREY, VERMILION, BLUE), strict=False
    ):
        axes.plot(rows["block"], rows["v_over_c_S"], "o-", color=colour, ms=2.5, lw=0.8,
                  label=rf"$\tau_0$ = {tau:g} $p$")  # fmt: skip
    axes.axhline(SLOW, color="0.5", lw=0.7, ls=(0, (4, 3)))
    axes.set(yscale="log", xlabel="block from the pushed edge", ylabel="front speed over $c_S$")
    legend(axes, loc="upper right")
    fig.caption = (
        "Speed of fronts on slabs whose junctions slip for 2 ms, over the way, at three uniform "
        "prestresses. Dashed: the limit of slow fronts."
    )
    fig.tables = {"fronts": table}
    return fig
