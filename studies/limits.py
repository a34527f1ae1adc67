"""Stability map: the largest stable step of every stepper, computed and measured.

The computed limit is `pyfric.stability_limit`, from the eigenvalues of the scene's operator. The
measured limit comes from a small slider at rest with a tiny disturbance, once stuck to the surface
and once lifted off. A bisection over the step finds where the disturbance begins to grow. No
contact state changes meanwhile. Axes are the viscosity of the bonds, in units of sqrt(k m), and the
stiffness of the foundation, in units of k. Times are in units of sqrt(m/k).

Steppers without a limit are measured at a step far above that of RK4.
"""

from __future__ import annotations

import math
import sys
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric.checks.stability import LIMITED, measured_limit
from pyfric.figures import DataFigure
from pyfric.scene import setup1
from pyfric.signals import at_once
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.scene import Scene

__all__ = ["ETAS", "STIFFNESSES", "figure", "stability_map"]

ETAS = size((0.0, 0.03, 0.1, math.sqrt(0.1), 1.0, 3.0), (0.0, 1.0))
"""Values of eta/sqrt(k m); the paper's is sqrt(0.1)."""
STIFFNESSES = size((0.01, 1.0, 10.0, 100.0), (1.0,))
"""Values of k_f/k; the paper's is 1."""


def small_slider(eta: float, stiffness: float) -> Scene:
    """Return 8 x 5 blocks of setup 1 at rest, for eta in units of sqrt(k m) and k_f in units of k.

    Limits of this size are exact. Limits of larger sliders follow from plane waves in an infinite
    lattice, and are lower by up to a tenth.
    """
    size = {"L": 0.0175, "H": 0.01, "V": 0.0, "mu_s": 1e6}
    plain = setup1(**size)
    k, m = plain.slider.k, plain.m
    return setup1(**size, eta=eta * math.sqrt(k * m), k_f=stiffness * k)


@at_once()
def stability_map(
    steppers: Sequence[str] = LIMITED,
    etas: Sequence[float] = ETAS,
    stiffnesses: Sequence[float] = STIFFNESSES,
    *,
    progress: bool = False,
) -> pd.DataFrame:
    """Compute and measure the limits.

    Args:
        steppers: names of steppers in `LIMITED`.
        etas: viscosities, in units of sqrt(k m).
        stiffnesses: stiffnesses of the foundation, in units of k.
        progress: print on stderr what is running.

    Returns:
        Columns: stepper, eta (in sqrt(k m)), stiffness (k_f/k), computed and measured (the limits
        in units of sqrt(m/k)), ratio (measured over computed).
    """
    rows = []
    for stepper, eta, stiffness in product(steppers, etas, stiffnesses):
        if progress:
            print(f"{stepper}, eta {eta:.3g}, k_f/k {stiffness:g}", file=sys.stderr, flush=True)
        scene = small_slider(eta, stiffness)
        unit = math.sqrt(scene.m / scene.slider.k)
        computed = stability_limit(scene, stepper)[0]
        measured = measured_limit(scene, stepper, computed)
        rows.append(
            {
                "stepper": stepper,
                "eta": eta,
                "stiffness": stiffness,
                "computed": computed / unit,
                "measured": measured / unit,
                "ratio": measured / computed,
            }
        )
    return pd.DataFrame(rows)


def figure(table: pd.DataFrame) -> DataFigure:
    """Return the map: limits over viscosity, one panel per stepper, one line per foundation."""
    steppers = list(dict.fromkeys(table["stepper"]))
    colours = ("#0072B2", "#009E73", "#E69F00", "#D55E00")
    fig = DataFigure(figsize=(7.2, 2.9), layout="constrained")
    FigureCanvasAgg(fig)
    panels = np.atleast_1d(fig.subplots(1, len(steppers), sharey=True))
    for axes, stepper, letter in zip(panels, steppers, "abcdef", strict=False):
        part = table[table["stepper"] == stepper]
        for (stiffness, line), colour in zip(part.groupby("stiffness"), colours, strict=False):
            text = rf"$k_\mathrm{{f}}/k$ = {stiffness:g}"
            width = 2.6 if stiffness == part["stiffness"].min() else 1.2  # drawn below others
            axes.plot(line["eta"], line["computed"], color=colour, lw=width, label=text)
            axes.plot(line["eta"], line["measured"], "o", mec=colour, mfc="none", ms=4.5)
        axes.set_xscale("symlog", linthresh=0.03, linscale=0.4)
        axes.set_xticks([0, 0.1, 1], ["0", "0.1", "1"])
        axes.set_yscale("log")
        axes.axvline(math.sqrt(0.1), color="0.7", lw=0.7, ls=":")
        axes.set_title(f"({letter}) {stepper.replace('_', ' ')}", fontsize=8, loc="left")
        axes.set_xlabel(r"viscosity $\eta/\sqrt{km}$", fontsize=8)
        axes.tick_params(labelsize=7, direction="in", which="both")
        axes.grid(alpha=0.3, lw=0.5)
    panels[0].set_ylabel(r"largest stable step $\Delta t\,/\sqrt{m/k}$", fontsize=8)
    panels[0].legend(fontsize=6.5, frameon=False, title="line: computed, o: measured",
                     title_fontsize=6.5)  # fmt: skip
    fig.caption = (
        "Largest stable step over bond viscosity and foundation stiffness, in units of sqrt(m/k), "
        "for each explicit stepper: computed from the eigenvalues of the scene's operator (lines) "
        "and measured by running (circles) on 8 x 5 blocks of setup 1, stuck and lifted off. "
        "Dotted: the paper's viscosity."
    )
    fig.tables = {"limits": table}
    return fig
