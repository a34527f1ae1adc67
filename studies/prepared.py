"""Fast, slow and arrested fronts on prepared interfaces of junctions, in two dimensions.

A slab of the preset `slow`, 30 mm high, has a uniform interface: p = F_N/N_x, a shear tau_0, and
stretches of junctions spread evenly about their mean by `width` u_s to both sides. A constant push
beyond mu_s p on the first blocks starts a front. Its kinds are:

arrested         it does not pass all blocks within `T_END`
arrested, slow   it does not pass all blocks within `T_END`, and a stretch of it is slow
fast             it passes all blocks, and no stretch is slow
slow             it passes all blocks, and a stretch is slow

Fronts, speeds and slow stretches are those of `studies/slow.py`.

Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014), for the law of junctions.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from sizes import size
from slow import SLOW, longest_stretch

from pyfric import figures
from pyfric.engines import Options, step_size
from pyfric.figures.style import legend
from pyfric.paper.cases.slow_fronts import AVERAGED, passages, prepared, speeds
from pyfric.record import material_of
from pyfric.scene import preset
from pyfric.sweeps import Job, PhaseDiagram, phase_diagram

if TYPE_CHECKING:
    from pathlib import Path

    from pyfric.figures import DataFigure
    from pyfric.record import Record

__all__ = ["CHECKS", "checks", "diagram", "figure", "job", "kind", "slowest"]

TAU = size(tuple(np.round(np.arange(0.1, 0.1701, 0.005), 3)), (0.1, 0.17))
"""Values of tau_0/p."""
WIDTH = size(tuple(np.round(np.arange(0.0, 0.501, 0.1), 3)), (0.0, 0.2))
"""Half width of the distribution of stretches, in units of u_s."""
T_END = size(60e-3, 2e-3)
"""Longest time in which a front must pass all blocks, s: 30 mean times t_R."""
SAMPLE = 1e-4
"""Time between points of the curve, s."""
CHECKS = {"as in the map": {}, "half the step": {"share": 0.5}, "seed 1": {"seed": 1}}
"""Runs of the map that are repeated with other settings."""


def job(tau: float, width: float, share: float = 1.0, seed: int = 0) -> Job:
    """Return the run at tau_0/p and a half width of stretches, in units of u_s.

    Args:
        tau, width: tau_0/p, and the half width.
        share: step, in units of the map's step.
        seed: seed of the junctions' times.
    """
    law = dataclasses.replace(preset("slow").interface.law, stretch=float(width), seed=seed)
    scene = prepared(tau, law)
    dt = share * step_size(scene, "auto", "rk4")
    end = f"reached = {(scene.N_x - 1) * scene.slider.l!r} m"
    how = Options(fidelity="dynamic", dt=dt, sample=SAMPLE, stop_when=end)
    return Job(scene=scene, t_end=T_END, options=how)


def _front(record: Record) -> tuple[np.ndarray, tuple[int, int] | None]:
    """Return passages of the front of the largest event, and its slow stretch."""
    if record.events.empty:
        return np.full(record.scene.N_x, np.nan), None
    t = passages(record, int(record.events["n_blocks"].idxmax()))
    return t, longest_stretch(
        speeds(t, record.scene.slider.l), SLOW * material_of(record.scene).c_S
    )


def kind(record: Record) -> str:
    """Return the kind of the front."""
    t, stretch = _front(record)
    if np.isfinite(t).all():
        return "fast" if stretch is None else "slow"
    return "arrested" if stretch is None else "arrested, slow"


def slowest(record: Record) -> float:
    """Return the speed of the slow stretch in units of c_S, or NaN without a slow stretch."""
    t, stretch = _front(record)
    if stretch is None:
        return np.nan
    first, last = stretch
    return (
        (last - first)
        * record.scene.slider.l
        / (t[last] - t[first])
        / material_of(record.scene).c_S
    )


def diagram(folder: Path) -> PhaseDiagram:
    """Return the map; runs are kept in the folder."""
    axes = {"x": ("tau", TAU), "y": ("width", WIDTH), "cache": folder}
    labels = {"kind": kind, "slowest": slowest}
    return phase_diagram(job, label=labels, lines=False, **axes)


def checks(folder: Path, widths: tuple[float, ...] = size((0.2, 0.4), WIDTH)) -> pd.DataFrame:
    """Return kinds and speeds of slow stretches along the map, for runs with other settings."""
    rows = []
    for name, how in CHECKS.items():
        axes = {"x": ("tau", TAU), "y": ("width", widths), "cache": folder}
        labels = {"kind": kind, "slowest": slowest}
        table = phase_diagram(
            lambda a, b, how=how: job(a, b, **how), label=labels, lines=False, **axes
        ).table
        rows.append(table.assign(case=name))
    return pd.concat(rows, ignore_index=True)[["case", "tau", "width", "kind", "slowest"]]


def figure(found: PhaseDiagram, others: pd.DataFrame) -> DataFigure:
    """Draw the map: lengths of fronts as colours, kinds as symbols."""
    fig = figures.phase_map(found, "kind")
    (axes, *_) = fig.axes
    for symbols in axes.lines:
        symbols.set(markersize=4, color="0.25", markeredgewidth=0.8)
    legend(axes, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    axes.set_xlabel(r"$\tau_0/p$")
    axes.set_ylabel(r"half width of stretches over $u_s$")
    fig.tables["checks"] = others
    fig.caption = (
        f"Fronts on prepared interfaces of junctions, {len(found.table)} runs. Colours: speed of "
        "the front over the last quarter of the blocks, over c; white where it does not come "
        f"there. A stretch is slow at {SLOW:g} c_S or less, over {AVERAGED} l and at least five "
        "blocks."
    )
    return fig
