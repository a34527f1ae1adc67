"""Effect of disorder of mu_s on two collapses of the paper: lengths over force, and front speeds.

For each seed mu_s of each block is drawn from a uniform distribution about 0.7, independent of its
neighbours. The width is the standard deviation of mu_s, divided by its mean. Lengths of precursors
are those of the quasi-static sequence in the Fig. 1 scene (Fig. 2a). Lengths are compared with the
curve through the lengths without disorder. Front speeds are those of hybrid runs with located
transitions and blocks of 5 mm (Fig. 4). Their medians in bins of the prestress are over all seeds
of one width.

Source: PRL 107, 074301 (2011), Figs. 2(a) and 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric.figures import DataFigure
from pyfric.record import analysis
from pyfric.scene import Spread, preset
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["SEEDS", "WIDTHS", "disordered", "figure", "jobs", "study", "summary", "tables"]

WIDTHS = size((0.0, 0.01, 0.03, 0.1), (0.0, 0.1))
"""Widths: standard deviations of mu_s, divided by its mean; 0 is run once."""
SEEDS = tuple(range(1, size(21, 3)))
BINS = 6
"""Number of bins of the prestress; few, because the run without disorder has few points."""
COLOURS = ("black", "#0072B2", "#009E73", "#D55E00")
LADDER = {"fidelity": "quasistatic"}
FRONTS = {"fidelity": "hybrid", "geometry": "linear", "verify": "none"}


def disordered(scene: Scene, width: float, seed: int) -> Scene:
    """Return the scene with mu_s from a uniform distribution; width is its relative std."""
    if not width:
        return scene
    mean = scene.interface.mu_s
    return scene.replace(mu_s=Spread(mean=mean, range=math.sqrt(3) * width * mean, seed=seed))


def jobs(width: float, seed: int) -> tuple[Job, Job]:
    """Return the two runs of one draw: the quasi-static sequence, and the run for front speeds."""
    lengths, fronts = preset("fig1"), preset("fig1", l=5e-3, V=5e-3)
    return (
        Job(scene=disordered(lengths, width, seed), t_end=0.8, options=LADDER),
        Job(scene=disordered(fronts, width, seed), t_end=0.1, options=FRONTS),
    )


def study(
    folder: Path, seeds: Sequence[int] = SEEDS, say: Callable[[str], None] = lambda _: None
) -> dict[str, pd.DataFrame]:
    """Make all runs and return their lengths and fronts.

    Args:
        folder: where finished runs are kept; the next call uses them.
        seeds: seeds of the draws.
        say: called with the name of each run.
    """
    records = {}
    for width in WIDTHS:
        say(f"width {width:g}")
        for seed in seeds if width else seeds[:1]:
            both = run_all(jobs(width, seed), workers=1, cache=folder, progress=False)
            records[width, seed] = both[0], both[1]
    return tables(records)


def tables(records: dict[tuple[float, int], tuple[Record, Record]]) -> dict[str, pd.DataFrame]:
    """Return lengths, fronts and their summary, from records by width and seed."""
    lengths = [
        analysis.precursor_lengths(ladder).assign(width=width, seed=seed)
        for (width, seed), (ladder, _) in records.items()
    ]
    fronts = [
        analysis.fronts(run).assign(width=width, seed=seed)
        for (width, seed), (_, run) in records.items()
    ]
    found = {"lengths": pd.concat(lengths), "fronts": pd.concat(fronts)}
    clean = found["lengths"][found["lengths"]["width"] == 0].sort_values("force")
    inside = found["lengths"]["force"].between(clean["force"].iloc[0], clean["force"].iloc[-1])
    on_curve = np.interp(found["lengths"]["force"], clean["force"], clean["L_p_over_L"])
    found["lengths"]["off"] = (found["lengths"]["L_p_over_L"] - on_curve).where(inside)
    names = ["width", "seed", "event", "n", "x_over_L", "v_c", "tau_over_p", "scaled"]
    found["fronts"] = found["fronts"][names]
    return found | {"summary": summary(found)}


def summary(found: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return one row for each width: the scatter of lengths and speeds about one curve.

    Columns: width; precursors of all seeds; rms and largest distance of L_p/L from the curve;
    blocks of fronts; share of these blocks without a speed, because rupture times do not increase;
    rms of ln v_c about its median in bins of tau/p, and in bins of the scaled prestress of each
    block.
    """
    rows = []
    for width, lengths in found["lengths"].groupby("width"):
        fronts = found["fronts"][found["fronts"]["width"] == width]
        known = fronts[fronts["v_c"].notna()]
        row = {"width": width, "precursors": len(lengths)}
        row["rms_length"] = math.sqrt(np.mean(lengths["off"].dropna() ** 2))
        row["most_length"] = lengths["off"].abs().max()
        row |= {"front_blocks": len(fronts), "without_speed": 1 - len(known) / len(fronts)}
        for name in ("tau_over_p", "scaled"):
            spread = analysis.collapse_spread(known[name], known["v_c"], bins=BINS)
            row[f"rms_ln_v_c_{name}"] = spread.rms
        rows.append(row)
    return pd.DataFrame(rows)


def figure(found: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the study as a figure: lengths over force, and speeds over prestress."""
    fig = DataFigure(figsize=(7.2, 3.0), layout="constrained")
    FigureCanvasAgg(fig)
    left, right = fig.subplots(1, 2)
    widths = found["summary"]["width"]
    for width, colour in reversed(list(zip(widths, COLOURS, strict=False))):
        about = {"color": colour, "ls": "", "marker": "o", "ms": 4 if not width else 2.5}
        label = f"{100 * width:g} %" if width else "none"
        lengths, fronts = (
            found[one][found[one]["width"] == width] for one in ("lengths", "fronts")
        )
        left.plot(lengths["force"], lengths["L_p_over_L"], label=label, **about)
        right.plot(fronts["tau_over_p"], fronts["v_c"] / 1e3, label=label, **about)
    clean = found["lengths"][found["lengths"]["width"] == 0]
    left.plot(clean["force"], clean["L_p_over_L"], color="black", lw=0.8)
    left.set(xlabel="$F_T/F_N$ after arrest", ylabel="$L_p/L$")
    right.set(xlabel=r"$\tau/p$ before the event", ylabel="$v_c$ (km/s)", yscale="log")
    left.legend(title=r"spread of $\mu_s$", loc="upper left", frameon=False)
    for axes, letter in ((left, "a"), (right, "b")):
        axes.text(-0.21, 1.03, f"({letter})", transform=axes.transAxes, va="top")
    fig.tables = found
    fig.caption = (
        "(a) Lengths of precursors in the Fig. 1 scene by the ladder, (b) front speeds in it on "
        "blocks of 5 mm, driven at 5 mm/s, where mu_s of each block is drawn evenly about 0.7; 20 "
        "draws of each spread, which is standard deviation over mean."
    )
    return fig
