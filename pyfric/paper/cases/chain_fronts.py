"""K. Thøgersen and others, 2019: front types and speeds of a chain with viscous friction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.figures import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.sweeps import Job, chain_job
from pyfric.theory import chain_speed

if TYPE_CHECKING:
    from pyfric.record import Record

TYPES = ("arrested", "alternating", "pulse", "crack", "slow", "sub-Rayleigh", "supershear")
"""Front types that the abstract of the source names."""
ALPHA = (0.01, 0.1, 0.3, 0.5456, 1.0, 3.0)
TAU_BAR = (0.003, 0.02, 0.05, 0.1111, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
BOTTOM = 3e-4
"""v/c at which the figure shows arrested fronts."""
STEADY = {"alpha": (0.3, 1.0), "tau_bar": (0.35, 0.5, 0.65, 0.8, 0.9)}
"""Points whose fronts are steady after 100 blocks."""


@case(
    "A chain with viscous friction: all types of fronts, and their speeds",
    "K. Thøgersen, H. A. Sveinsson, D. S. Amundsen, J. Scheibert, F. Renard, "
    "A. Malthe-Sørenssen, Phys. Rev. E 100, 043004 (2019), doi:10.1103/PhysRevE.100.043004",
    "number",
    {
        "alpha, tau_bar": "the two numbers of the model (abstract); values: choice",
        "N": "100 blocks, the first is pushed; choice",
    },
)
def chain_fronts(
    run: Runner,
    *,
    alpha: tuple[float, ...] = ALPHA,
    tau_bar: tuple[float, ...] = TAU_BAR,
    eta: float = 0.0,
) -> Found:
    """Measure fronts against prestress and viscosity; eta is a bond viscosity in sqrt(k m)."""
    points = [(a, b) for a in alpha for b in tau_bar]
    jobs = [_with_eta(chain_job(a, b), eta) for a, b in points]
    rows = [
        {"alpha": a, "tau_bar": b, **_class(record)}
        for (a, b), record in zip(points, run(jobs), strict=True)
    ]
    table = pd.DataFrame(rows)
    steady = table[
        table["alpha"].isin(STEADY["alpha"])
        & table["tau_bar"].isin(STEADY["tau_bar"])
        & table["kind"].isin(["crack", "pulse"])
    ]
    exact = [chain_speed(a, b) for b, a in zip(steady["alpha"], steady["tau_bar"], strict=True)]
    ratio = np.asarray(steady["speed_over_c"]) / np.array(exact)
    kinds = {*table["kind"], *table["pace"]} & set(TYPES)
    parts = [
        Claim(
            "chain_fronts a",
            "a chain of two numbers has all seven types of fronts",
            len(kinds),
            Band(len(TYPES), len(TYPES), "types that the abstract names"),
            "number of types among runs over alpha and tau_bar",
            [given("one prestress, tau_bar = 0.9", tau_bar=TAU_BAR[-1:])],
        ),
        Claim(
            "chain_fronts b",
            "steady fronts have the exact speed",
            float(np.abs(ratio - 1).max()),
            Band(None, 1e-3, "finite length of the chain"),
            "largest |v/v_exact - 1|, v the mean over the last quarter of the blocks",
            [given("bond viscosity of 0.316 sqrt(k m)", eta=0.316)],
            "The exact speed (pyfric.theory.chain_speed) is not from this source.",
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _class(record: Record) -> dict[str, Any]:
    """Return kind and pace of the rupture of a run, and its speed over c."""
    found, slider = record.rupture_class(), record.scene.slider
    c = slider.l * (slider.k / slider.m) ** 0.5
    return {"kind": found.kind, "pace": found.pace, "speed_over_c": found.speed / c}


def _with_eta(job: Job, eta: float) -> Job:
    """Return the job with a bond viscosity eta, in sqrt(k m)."""
    scene = job.scene
    eta *= float(np.sqrt(scene.slider.k * scene.m))
    return Job(scene.replace({"slider.eta": eta}), job.t_end, job.options)


def _drawn(table: pd.DataFrame) -> DataFigure:
    """Draw speed over prestress: runs by kind, and the exact speed of steady fronts."""
    fig, (axes,) = panels(3.0)
    colours = (BLACK, ORANGE, BLUE, PURPLE, VERMILION, GREEN)
    symbols = {"crack": "o", "pulse": "^", "alternating": "s", "arrested": "x"}
    for alpha, colour in zip(table["alpha"].unique(), colours, strict=False):
        rows = table[table["alpha"] == alpha]
        axes.plot([], [], color=colour, label=rf"$\alpha$ = {alpha:.2g} $\sqrt{{km}}$")
        for kind, marker in symbols.items():
            mine = rows[rows["kind"] == kind]
            v = np.nan_to_num(mine["speed_over_c"], nan=BOTTOM)
            axes.plot(mine["tau_bar"], v, marker, color=colour, ms=3.5, mfc="none", mew=0.8)
        x = np.geomspace(max(rows["tau_bar"].min(), 0.02), 0.93, 60)
        axes.plot(x, [chain_speed(b, alpha) for b in x], color=colour, lw=0.8)
    for kind, marker in symbols.items():
        axes.plot([], [], marker, color="0.4", ms=3.5, mfc="none", mew=0.8, label=kind)
    axes.set(
        xscale="log",
        yscale="log",
        ylim=(BOTTOM / 200, 4),
        xlabel=r"scaled prestress $\bar\tau$",
        ylabel="front speed $v/c$",
    )
    legend(axes, ncols=2, loc="lower left")
    fig.caption = (
        "Fronts in a chain of 100 blocks over the scaled prestress, at six viscosities alpha. "
        "Symbols: runs, by kind of front; crosses: fronts that arrest, which have no speed. "
        "Lines: exact speed of a steady front."
    )
    fig.tables = {"fronts": table}
    return fig
