"""Resolution study: which results converge as the lattice constant l falls?

Amontons-Coulomb friction has no length scale. The slider of the Fig. 1 scene is refined in two
ways. With eta = sqrt(0.1 k m) at every l, as in the paper, waves are damped over a fixed number of
blocks. With eta fixed in N s/m, a fixed bulk viscosity, waves are damped over a fixed length. In a
square lattice under plane stress k does not depend on l, and block mass and load fall with l.

The hybrid engine with located switching runs each scene; the prediction curve of mu_s = mu_k
needs no dynamics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric.engines import prediction_curve
from pyfric.figures import DataFigure
from pyfric.record import analysis
from pyfric.scene import preset
from pyfric.signals import at_once
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["SPACINGS", "figure", "study", "summary"]

SPACINGS = size((5e-3, 2.5e-3, 1.25e-3, 0.625e-3), (5e-3, 2.5e-3))
"""Lattice constants of the Fig. 1 scene, m."""
T_END = 0.45
"""End of the runs, s: six main precursors at l = 2.5 mm."""
LENGTHS = (0.1, 0.15, 0.2)
"""L_p/L at which forces of the prediction curve are compared."""
LOADS = (0.05, 0.1, 0.2, 0.4)
"""x/L at which the loaded state is compared."""
TRAVEL = 0.02
"""Nearest distance from the trailing edge at which a front speed counts, m."""


def scene(l: float, viscosity: str) -> Scene:
    """Return the Fig. 1 scene with lattice constant l (m).

    viscosity is "eta = sqrt(0.1 k m)", or "eta fixed" with the value for l = 2.5 mm.
    """
    eta = preset("fig1").eta if viscosity == VISCOSITIES[1] else None
    return preset("fig1", l=l, eta=eta)


VISCOSITIES = ("eta = sqrt(0.1 k m)", "eta fixed")


@at_once()
def study(
    spacings: Sequence[float] = SPACINGS,
    t_end: float = T_END,
    *,
    workers: int | None = None,
    cache: bool = True,
    progress: bool | None = None,
) -> dict[str, pd.DataFrame]:
    """Run the study.

    Args:
        spacings: lattice constants, in m, that divide the lengths of the scene.
        t_end: end of the runs, in s.
        workers, cache, progress: see `pyfric.run_all`, which makes the runs.

    Returns:
        Tables. "events": the main events of each run, with l (m), viscosity, event, force_start,
        force_arrest (over F_N), L_p_over_L, micro_slips (events of fewer blocks since the last main
        one). "fronts": l, viscosity, event, x_over_L, v_c (m/s), tau_over_p. "prediction": l, force
        (F_T/F_N), L_p_over_L. "loaded": l, x_over_L, tau_over_p of the loaded slider.

    Raises:
        SceneError: a lattice constant does not divide the lengths.
    """
    tables: dict[str, list[pd.DataFrame]] = {
        name: [] for name in ("events", "fronts", "prediction", "loaded")
    }
    how = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
    which = [(l, viscosity) for l in spacings for viscosity in VISCOSITIES]
    jobs = [Job(scene=scene(*one), t_end=t_end, options=how) for one in which]
    records = dict(
        zip(which, run_all(jobs, workers=workers, cache=cache, progress=progress), strict=True)
    )
    for l in spacings:
        curve = prediction_curve(scene(l, VISCOSITIES[0]))
        grown = curve.curve[["F_T", "L_p_over_L"]].assign(F_T=curve.curve["F_T"] / curve.scene.F_N)
        tables["prediction"].append(grown.rename(columns={"F_T": "force"}).assign(l=l))
        for viscosity in VISCOSITIES:
            record = records[l, viscosity]
            same = {"l": l, "viscosity": viscosity}
            tables["events"].append(_events(record).assign(**same))
            fronts = analysis.fronts(record)
            far = fronts["x_over_L"] * record.scene.slider.L >= TRAVEL
            tables["fronts"].append(fronts[far & fronts["v_c"].notna()].assign(**same))
        loaded = analysis.stress_profile(record)
        tables["loaded"].append(loaded[["x_over_L", "tau_over_p"]].assign(l=l))
    return {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}


def _events(record: Record) -> pd.DataFrame:
    events, F_N = record.events, record.scene.F_N
    main = np.flatnonzero(events["is_main"] & events["finished"])
    table = events.iloc[main]
    return pd.DataFrame(
        {
            "event": table.index,
            "force_start": table["F_T_start"].to_numpy() / F_N,
            "force_arrest": table["F_T_arrest"].to_numpy() / F_N,
            "L_p_over_L": table["L_p_over_L"].to_numpy(),
            "micro_slips": np.diff(main, prepend=-1) - 1,
        }
    )


def summary(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return results for each lattice constant, one row per quantity and viscosity.

    Columns: quantity; viscosity ("" where it plays no part); one column per l; order, the exponent
    p in |value - value at half the l| ~ l^p from the three finest, NaN where the differences do
    not fall; change, the relative change between the two finest.
    """
    spacings = sorted(tables["prediction"]["l"].unique(), reverse=True)
    rows = []

    def add(quantity: str, viscosity: str, values: dict[float, float]) -> None:
        fine = [values.get(l, np.nan) for l in spacings[-3:]]
        order = np.nan
        if len(fine) == 3:
            first, second = abs(fine[0] - fine[1]), abs(fine[1] - fine[2])
            if first > second > 0:
                order = float(np.log(first / second) / np.log(spacings[-2] / spacings[-1]))
        change = abs(fine[-1] / fine[-2] - 1)
        row = {"quantity": quantity, "viscosity": viscosity}
        row |= {f"l = {l * 1e3:g} mm": values.get(l, np.nan) for l in spacings}
        rows.append(row | {"order": order, "change": change})

    loaded, prediction = (tables[name].groupby("l") for name in ("loaded", "prediction"))
    for x in LOADS:
        at = {l: float(np.interp(x, t["x_over_L"], t["tau_over_p"])) for l, t in loaded}
        add(f"tau/p of the loaded slider at x/L = {x:g}", "", at)
    for length in LENGTHS:
        at = {l: float(np.interp(length, t["L_p_over_L"], t["force"])) for l, t in prediction}
        add(f"predicted F_T/F_N at L_p/L = {length:g}", "", at)
    for viscosity in VISCOSITIES:
        events = tables["events"][tables["events"]["viscosity"] == viscosity].groupby("l")
        fronts = tables["fronts"][tables["fronts"]["viscosity"] == viscosity].groupby("l")
        add("F_T/F_N at the first main event", viscosity, _each(events, "force_start", "first"))
        add("main events up to the end", viscosity, {l: float(len(t)) for l, t in events})
        add("micro-slips per main event", viscosity, _each(events, "micro_slips", "mean"))
        at = {}
        for l, table in events:
            longest = np.maximum.accumulate(table["L_p_over_L"].to_numpy())
            at[l] = float(np.interp(LENGTHS[1], longest, table["force_arrest"]))
        add(f"arrest F_T/F_N at L_p/L = {LENGTHS[1]:g}", viscosity, at)
        add("largest front speed (m/s)", viscosity, _each(fronts, "v_c", "max"))
        add("median front speed (m/s)", viscosity, _each(fronts, "v_c", "median"))
    return pd.DataFrame(rows)


def _each(groups: pd.api.typing.DataFrameGroupBy, column: str, how: str) -> dict[float, float]:
    return {l: float(v) for l, v in getattr(groups[column], how)().items()}


def figure(tables: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the study as a figure: lengths, front speeds with both viscosities, loaded state."""
    colours = ("#E69F00", "#009E73", "#0072B2", "#CC79A7", "#000000")
    fig = DataFigure(figsize=(7.2, 5.4), layout="constrained")
    FigureCanvasAgg(fig)
    (lengths, loaded), speeds = fig.subplots(2, 2)
    spacings = sorted(tables["prediction"]["l"].unique(), reverse=True)
    for l, colour in zip(spacings, colours, strict=False):
        text = f"l = {l * 1e3:g} mm"
        table = tables["loaded"][tables["loaded"]["l"] == l]
        loaded.plot(table["x_over_L"], table["tau_over_p"], color=colour, lw=1, label=text)
        table = tables["prediction"][tables["prediction"]["l"] == l]
        lengths.plot(table["force"], table["L_p_over_L"], color=colour, lw=0.8)
        for viscosity, marker, axes in zip(VISCOSITIES, "o^", speeds, strict=True):
            table = tables["events"]
            table = table[(table["l"] == l) & (table["viscosity"] == viscosity)]
            lengths.plot(
                table["force_arrest"], table["L_p_over_L"], marker, color=colour, ms=3.5, mfc="none"
            )
            table = tables["fronts"]
            table = table[(table["l"] == l) & (table["viscosity"] == viscosity)]
            axes.plot(table["tau_over_p"], table["v_c"], marker, color=colour, ms=3, mfc="none")
    lengths.set_xlim(0, 1.1 * tables["events"]["force_arrest"].max())
    lengths.set_ylim(0, 1.3 * tables["events"]["L_p_over_L"].max())
    lengths.set_xlabel(r"force after arrest $F_\mathrm{T}/F_\mathrm{N}$", fontsize=8)
    lengths.set_ylabel(r"length $L_\mathrm{p}/L$", fontsize=8)
    loaded.set_xlabel(r"position $x/L$", fontsize=8)
    loaded.set_ylabel(r"$\tau/p$ at $F_\mathrm{T}=0$", fontsize=8)
    loaded.legend(fontsize=7, frameon=False)
    for axes in speeds:
        axes.set_xlabel(r"$\tau/p$ just before the event", fontsize=8)
        axes.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)", fontsize=8)
        axes.set_yscale("log")
    titles = (
        "(a) precursors; lines: prediction",
        "(b) loaded slider",
        r"(c) $\eta=\sqrt{0.1\,k\,m}$ (o)",
        r"(d) $\eta$ fixed (^)",
    )
    for axes, title in zip((lengths, loaded, *speeds), titles, strict=True):
        axes.set_title(title, fontsize=8, loc="left")
        axes.tick_params(labelsize=7, direction="in", which="both")
    fig.caption = (
        "Fig. 1 scene with lattice constants "
        + ", ".join(f"{l * 1e3:g}" for l in spacings)
        + " mm: (a) precursor lengths with eta by its formula (circles) and fixed (triangles), and "
        "the prediction of mu_s = mu_k (lines); (b) loaded state; front speeds (c) with eta by its "
        f"formula and (d) fixed, from {TRAVEL * 1e3:g} mm behind the trailing edge on. Hybrid "
        "engine, linear geometry, located switching."
    )
    fig.tables = {**tables, "summary": summary(tables)}
    return fig
