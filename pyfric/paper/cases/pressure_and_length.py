"""W. Iwashita and others, 2023: static friction against pressure and length of the block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pyfric.figures import BLUE, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import preset
from pyfric.sweeps import Job

LENGTHS = (0.035, 0.07, 0.14, 0.28)
"""L at the pressure of setup 1, m."""
PRESSURES = (0.5, 1.0, 2.0)
"""Load of setup 1 over 3500 N."""
NINE_TENTHS = 0.9


@case(
    "Static friction falls with pressure and with length",
    "W. Iwashita, H. Matsukawa, M. Otsuki, Sci. Rep. (2023), "
    "doi:10.1038/s41598-023-29764-w, arXiv:2211.01066",
    "trend",
    {
        "trend": "macroscopic static friction falls with pressure and with length (abstract)",
        "slider": "setup 1 of the paper of pyfric, quasi-static, Coulomb friction; the source has "
        "a viscoelastic block and friction that falls with speed",
    },
)
def pressure_and_length(
    run: Runner,
    *,
    lengths: Sequence[float] = LENGTHS,
    pressures: Sequence[float] = PRESSURES,
) -> Found:
    """Measure static friction: force at the first event in which 90 % of the interface slip."""
    jobs = [_job(L, 1.0) for L in lengths] + [_job(0.14, pressure) for pressure in pressures]
    forces = []
    for record in run(jobs):
        events = record.events[record.events["n_blocks"] >= NINE_TENTHS * record.scene.N_x]
        F_T = events["F_T_start"].iloc[0] if len(events) else np.nan
        forces.append(F_T / record.scene.F_N)
    by_length, by_pressure = forces[: len(lengths)], forces[len(lengths) :]
    rows = [("L", L / 0.14, f) for L, f in zip(lengths, by_length, strict=True)]
    rows += [("P", P, f) for P, f in zip(pressures, by_pressure, strict=True)]
    table = pd.DataFrame(rows, columns=["what", "ratio", "force"])
    alike = [given("one length, one load", lengths=(0.14,) * 2, pressures=(1.0,) * 2)]
    parts = [
        Claim(
            "pressure_and_length a",
            "trend: static friction falls with pressure",
            float(by_pressure[-1] - by_pressure[0]),
            Band(None, -0.01, "abstract; the size is a choice"),
            "change of F_T/F_N at the first event over the interface, load four times as large",
            alike,
            "Coulomb friction and linear elasticity are homogeneous: the load sets the scale only.",
        ),
        Claim(
            "pressure_and_length b",
            "trend: static friction falls with length",
            float(by_length[-1] - by_length[0]),
            Band(None, -0.01, "abstract; the size is a choice"),
            "change of the same from the shortest to the longest slider, eight times as long",
            alike,
            "At l = 1.25 mm the change is -0.018; a slider of twice the longest is at 0.476 again.",
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _job(L: float, pressure: float) -> Job:
    F_N = 3500 * pressure * L / 0.14
    scene = preset("fig1", L=L, F_N=F_N)
    t_end = 1.1 * pressure * (L / 0.14)
    return Job(scene, t_end, {"fidelity": "quasistatic", "geometry": "linear", "verify": "none"})


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.2)
    for what, colour, label in (("L", BLUE, "length"), ("P", VERMILION, "pressure")):
        rows = table[table["what"] == what]
        axes.plot(rows["ratio"], rows["force"], "o-", color=colour, ms=3.5, lw=0.8, label=label)
    axes.set(xscale="log", xlabel="length, or pressure, over that of setup 1", ylabel="$F_T/F_N$")
    axes.set_xticks([0.25, 0.5, 1, 2], ["0.25", "0.5", "1", "2"])
    axes.minorticks_off()
    legend(axes)
    fig.caption = "Shear force at the first event over nine tenths of the interface of setup 1."
    fig.tables = {"forces": table}
    return fig
