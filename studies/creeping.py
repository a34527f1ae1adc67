"""Slow fronts of viscous slip in two dimensions: where they appear, and if a chain predicts them.

The runs are those of slabs on a prescribed interface, free on top, under a uniform scaled prestress
tau_bar = (tau/p - mu_k)/(mu_s - mu_k). A patch at the trailing edge, twice as long as the slab is
high, is stressed beyond its strength. A viscous force alpha v resists slip. Each slab has an
equivalent chain, with k = E B H/l and the mass m of a column. Alpha is in units of sqrt(k m) of
this chain, and speeds in units of its c = l sqrt(k/m).

Overdamped fronts of the chain run at v/c = w(tau_bar)/alpha. On lengths below H, a slab of height H
differs from a chain. The study measures s in v/c = w/(s alpha), the number of columns that act as
one block.

Other runs are the same slabs without alpha, whose mu falls from mu_s to mu_k over a time t_w since
slip began, and the Fig. 1 slider with alpha under its driver. A slab has no speed if its last block
slips before the front comes.

Source: K. Thøgersen et al., PRE 100, 043004 (2019), for the chain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.optimize import brentq
from sizes import size

import pyfric
from pyfric import figures, theory
from pyfric.figures.style import BLUE, GREEN, VERMILION, style
from pyfric.record import SLOW, pace_limits
from pyfric.scene import preset, slab
from pyfric.scene.laws import TabulatedLaw
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pyfric.figures import DataFigure
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["figure", "overdamped", "report", "slab_job", "slider_job", "study"]

ROWS = size((2, 3, 5), (2,))
"""Numbers of blocks in the height of the slabs."""
ALPHA = size((0.3, 1.0, 3.0), (1.0,))
"""Viscosities of slip, in units of sqrt(k m) of the equivalent chain."""
TAU_BAR = size((0.1, 0.2, 0.4, 0.6), (0.6,))
"""Scaled prestresses."""
WEAKENING = size((3.0, 30.0, 300.0), (3.0,))
"""Times t_w of weakening, in units of l/c."""
COLOURS = (BLUE, VERMILION, GREEN)
"""Colours of slabs in pictures."""
BLOCKS = size(120, 20)
"""Blocks along the slabs."""
MU_S, MU_K, P, L = 0.7, 0.45, 60.0, 2.5e-3
"""Friction coefficients, normal force of a block (N) and lattice constant (m)."""
SLIDER_ALPHA = size((0.0, 0.03, 0.1, 0.3), (0.0,))
"""Viscosities of the slider, in units of sqrt(k m) of its equivalent chain."""
T_END, SCENE = size((0.5, {}), (0.015, {"l": 5e-3, "V": 20e-3}))
"""End of runs of the slider, s, unless an event over the whole interface ends them before."""


def overdamped(tau_bar: float) -> float:
    """Return w = alpha v of a steady overdamped front of a chain, in units of c sqrt(k m)."""
    return brentq(lambda w: float(theory.chain_prestress_overdamped(w)) - tau_bar, 1e-5, 1e3)


def lumped(scene: Scene) -> tuple[float, float]:
    """Return c (m/s) and sqrt(k m) (N s/m) of the equivalent chain of a slider."""
    high = scene.N_z - 0.5 if scene.prescribed else scene.N_z  # half blocks at the bottom
    k, m = high * 4 / 3 * scene.slider.k, high * scene.m
    return scene.slider.l * math.sqrt(k / m), math.sqrt(k * m)


def slab_job(rows: int, tau_bar: float, alpha: float, t_w: float = 0.0) -> Job:
    """Return the run of a slab up to the end of its front; alpha in sqrt(k m), t_w in l/c."""
    tau = (MU_K + (MU_S - MU_K) * tau_bar) * P
    size = {"L": (BLOCKS - 1) * L, "H": (rows - 1) * L, "l": L}
    scene = slab(p=P, tau=tau, mu_s=MU_S, mu_k=MU_K, **size)
    c, unit = lumped(scene)
    scene = scene.replace({"interface.alpha": alpha * unit})
    if t_w:
        falls = {"age_time": (0.0, t_w * L / c), "age_factor": (1.0, MU_K / MU_S)}
        scene = scene.replace({"mu_k": MU_S, "law": TabulatedLaw(**falls)})
    scene = pyfric.overstressed(scene, x=0.0, length=4 * rows * L, excess=0.01)
    slowest = min(overdamped(tau_bar) / (10 * rows * alpha), 0.1) if alpha else 0.02
    t_end = BLOCKS * L / (c * slowest)
    options = {"fidelity": "dynamic", "energies": False, "verify": "none", "sample": t_end / 2000}
    ends = ("arrested", f"reached = {(BLOCKS - 1) * L!r}")
    return Job(scene=scene, t_end=t_end, options=options | {"stop_when": ends})


def slider_job(alpha: float) -> Job:
    """Return the run of the Fig. 1 slider with viscosity alpha."""
    scene = preset("fig1", **SCENE)
    scene = scene.replace({"interface.alpha": alpha * lumped(scene)[1]})
    options = {"fidelity": "dynamic", "geometry": "linear", "energies": False, "verify": "none"}
    return Job(scene=scene, t_end=T_END, options=options | {"stop_when": "system_size"})


def front(record: Record) -> dict[str, Any]:
    """Return class and speed (in c of the equivalent chain) of the largest rupture of a run."""
    found = record.rupture_class()
    v, c_R = found.speed, pace_limits(record.scene)[0]
    told = {"kind": found.kind, "pace": found.pace, "reached": found.reached}
    return told | {"v_over_c": v / lumped(record.scene)[0], "v_over_c_R": v / c_R}


def fronts(record: Record) -> dict[str, Any]:
    """Return numbers of main events and blocks, speeds in c_R, and the share of slow blocks."""
    events = record.events[record.events["is_main"]]
    v = pyfric.analysis.fronts(record)["v_c"].dropna() / pace_limits(record.scene)[0]
    told = {"events": len(events), "most": int(events["n_blocks"].max()), "speeds": len(v)}
    parts = {f"v_{share}": float(np.percentile(v, share)) for share in (10, 50, 90)}
    return told | parts | {"slow": float((v < SLOW).mean())}


def study(folder: Path, say: Callable[[str], None] = lambda _: None) -> dict[str, pd.DataFrame]:
    """Make the runs that are missing in the folder; return the tables."""

    def run(job: Job, told: Callable[[Record], dict[str, Any]] = front) -> dict[str, Any]:
        (record,) = run_all([job], workers=1, cache=folder, progress=False)
        return told(record)

    slabs, aged, sliders = [], [], []
    for rows in ROWS:
        for tau_bar in TAU_BAR:
            say(f"{rows} rows, tau_bar = {tau_bar:g}")
            w = overdamped(tau_bar)
            for alpha in ALPHA:
                here = {"rows": rows, "alpha": alpha, "tau_bar": tau_bar}
                found = run(slab_job(rows, tau_bar, alpha))
                s = w / (alpha * found["v_over_c"])
                slabs.append(here | found | {"chain": w / alpha, "s": s})
            for t_w in WEAKENING:
                here = {"rows": rows, "t_w": t_w, "tau_bar": tau_bar}
                aged.append(here | run(slab_job(rows, tau_bar, 0.0, t_w)))
    for alpha in SLIDER_ALPHA:
        say(f"slider, alpha = {alpha:g}")
        sliders.append({"alpha": alpha} | run(slider_job(alpha), fronts))
    names = ("slabs", "weakening", "sliders")
    return dict(zip(names, map(pd.DataFrame, (slabs, aged, sliders)), strict=True))


def figure(found: dict[str, pd.DataFrame]) -> DataFigure:
    """Return a figure: speeds in slabs beside the chain's formula, and with weakening in time."""
    fig = figures.DataFigure(figsize=(7.2, 3.2), layout="constrained")
    FigureCanvasAgg(fig)
    left, right = fig.subplots(1, 2)
    style(left)
    style(right)
    w = np.logspace(-2, 1, 100)
    tau_bar = [float(theory.chain_prestress_overdamped(one)) for one in w]
    left.plot(tau_bar, w, color="black", lw=1.0, label="chain, $w$")
    for n, (rows, of_rows) in enumerate(found["slabs"].groupby("rows")):
        for alpha, shown in of_rows.groupby("alpha"):
            marker = "osD^"[ALPHA.index(alpha)]
            look = {
                "marker": marker,
                "ls": "none",
                "color": COLOURS[n],
                "fillstyle": "none",
                "ms": 5,
            }
            left.plot(shown["tau_bar"], alpha * shown["v_over_c"], **look)
        left.plot([], [], color=COLOURS[n], lw=3, label=f"slab, {rows} rows")
    left.set(xlabel=r"$\bar\tau$", ylabel=r"$\alpha v/(c\sqrt{km})$", xscale="log", yscale="log")
    _symbols(left, r"$\alpha/\sqrt{km}$", ALPHA, "none")
    for n, (_, of_rows) in enumerate(found["weakening"].groupby("rows")):
        for t_w, shown in of_rows.groupby("t_w"):
            marker = "osD^"[WEAKENING.index(t_w)]
            look = {"color": COLOURS[n], "marker": marker, "ls": ":", "lw": 0.7, "ms": 5}
            right.plot(shown["tau_bar"], shown["v_over_c"], **look)
    right.set(xlabel=r"$\bar\tau$", ylabel="$v/c$, friction that falls over $t_w$", yscale="log")
    _symbols(right, r"$t_w c/l$", WEAKENING, "full")
    fig.tables = dict(found)
    fig.caption = (
        "Fronts in slabs. (a) alpha v over the prestress: circles, squares and diamonds: alpha = "
        f"{', '.join(f'{one:g}' for one in ALPHA)}, in units of the lumped chain; line: overdamped "
        "chain. (b) Friction that falls over a time t_w: circles, squares and diamonds: t_w c/l "
        f"= {', '.join(f'{one:g}' for one in WEAKENING)}; colours as in (a).\n\n{report(found)}"
    )
    return fig


def _symbols(axes: Axes, name: str, values: Sequence[float], fillstyle: str) -> None:
    """Add a legend of the symbols to a panel."""
    for marker, value in zip("osD^", values, strict=False):
        look = {"marker": marker, "ls": "none", "fillstyle": fillstyle, "ms": 5}
        axes.plot([], [], color="0.3", label=f"{name} = {value:g}", **look)
    axes.legend(fontsize=7, frameon=False)


def report(found: dict[str, pd.DataFrame]) -> str:
    """Return the tables as text."""
    return "\n\n".join(
        f"{name}\n{table.to_string(index=False, float_format=lambda x: f'{x:.3g}')}"
        for name, table in found.items()
    )
