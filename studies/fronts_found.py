"""Results of the study `fronts`: its numbers and its figure."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from cracks import FROM, TO, Crack, viscous
from fronts import D_C, LATE, MIDDLE
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pyfric import theory
from pyfric.figures import DataFigure
from pyfric.figures.style import mark
from pyfric.record import PER_BIN, analysis
from pyfric.scene import preset

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["figure", "summary"]


def summary(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the numbers of the study, with columns what, case and value."""
    c_R = Crack(blocks=1).material.c_R
    rows: list[tuple[str, str, float]] = []
    for about, table in tables["crack"].groupby(["blocks", "eta2", "dashpots"]):
        case, off = viscous(*about), table["v"] / table["v_theory"]
        rows += [
            ("crack: mean of v/v_theory - 1, 3 to 12 km", case, float(off.mean() - 1)),
            ("crack: largest |v/v_theory - 1|", case, float((off - 1).abs().max())),
            ("crack: highest speed over c_R", case, float(table["v"].max() / c_R)),
        ]
    for l, table in tables["lengths"].groupby("l", sort=False):
        for name in ("griffith", "ladder"):
            off = (table[name] - table["dynamics"]).abs()
            rows += [
                (f"L_p/L: largest |{name} - dynamics|", _case(l, D_C), float(off.max())),
                (f"L_p/L: median |{name} - dynamics|", _case(l, D_C), float(off.median())),
            ]
    material = theory.Material.of_lattice(*_lattice(preset("fig1")), 1.0)
    fronts = tables["fronts"][tables["fronts"]["v_c"].notna()]
    fig1, others = fronts[fronts["scene"] == "fig1"], fronts[fronts["scene"] != "fig1"]
    for (l, d_c, begun), table in fig1.groupby(["l", "d_c", "begun"], sort=False):
        rows += _speeds(table, _case(l, d_c, begun), material)
    for (l, d_c, begun), table in others.groupby(["l", "d_c", "begun"], sort=False):
        rows += _speeds(table, f"runs 1 to 4, {_case(l, d_c, begun)}", material)
    rows += _changes(fig1)
    return pd.DataFrame(rows, columns=["what", "case", "value"])


def _case(l: float, d_c: float, begun: float = 0.0) -> str:
    case = f"l = {l * 1e3:g} mm, d_c = {d_c * 1e6:g} um"
    return f"{case}, from l = {begun * 1e3:g} mm" if begun else case


def _lattice(scene: Scene) -> tuple[float, float, float]:
    return scene.slider.k, scene.m, scene.slider.l


def _speeds(
    table: pd.DataFrame, case: str, material: theory.Material
) -> list[tuple[str, str, float]]:
    v = table["v_c"].to_numpy()
    if not v.size:
        return []
    rows = [
        ("least and", case, float(table["X_c0_over_l"].min())),
        ("most blocks in X_c0", case, float(table["X_c0_over_l"].max())),
        ("share of blocks with 6 or more in X_c0", case, float((table["X_c0_over_l"] >= 6).mean())),
        ("highest v_c over c_L", case, float(v.max() / material.c_P)),
        ("highest v_c over c_R", case, float(v.max() / material.c_R)),
        ("share of v_c above c_L", case, float(np.mean(v > material.c_P))),
        ("share of v_c above c_R", case, float(np.mean(v > material.c_R))),
        ("median v_c over c_R", case, float(np.median(v) / material.c_R)),
    ]
    known = table["scaled"].notna()
    if known.sum() >= 20 * PER_BIN:
        spread = analysis.collapse_spread(table["scaled"][known], table["v_c"][known])
        share = 1 - spread.rms**2 / float(np.var(np.log(v[known])))
        rows += [
            ("rms of ln v_c about one curve of the scaled prestress", case, spread.rms),
            ("share of the variance of ln v_c that it explains", case, share),
        ]
    return rows


def _changes(fronts: pd.DataFrame) -> list[tuple[str, str, float]]:
    """Return how v_c(x) of the late precursor changes from one lattice to the next.

    Also return the change on one lattice if the run starts from the state of a coarser lattice.
    """
    late = fronts[fronts["late"]]
    rows, whole, begun = [], late[late["begun"] == 0], late[late["begun"] > 0]
    for d_c, tables in whole.groupby("d_c"):
        spacings = sorted(tables["l"].unique(), reverse=True)
        for coarse, fine in itertools.pairwise(spacings):
            one, two = (tables[tables["l"] == l] for l in (coarse, fine))
            rows += _change(one, two, f"{_case(coarse, d_c)}, to l = {fine * 1e3:g} mm")
    for (l, d_c), two in begun.groupby(["l", "d_c"], sort=False):
        same = whole[whole["d_c"] == d_c]
        for one in (same[same["l"] == 2 * l], same[same["l"] == l]):
            if len(one):
                case = _case(one["l"].iloc[0], d_c)
                rows += _change(one, two, f"{case}, to {_case(l, d_c, 2 * l)}")
    return rows


def _change(one: pd.DataFrame, two: pd.DataFrame, case: str) -> list[tuple[str, str, float]]:
    """Return the rms of ln(v_c/v_c') of two fronts at the places where both have speeds."""
    inside = one["x_over_L"].between(two["x_over_L"].min(), two["x_over_L"].max())
    other = np.interp(one["x_over_L"][inside], two["x_over_L"], two["v_c"])
    change = np.log(other / one["v_c"][inside])
    rows = [
        ("rms change of ln v_c(x), late precursor", case, float(np.sqrt(np.mean(change**2)))),
        ("median |change| of ln v_c(x), late precursor", case, float(np.median(np.abs(change)))),
    ]
    middle = change[one["x_over_L"][inside].between(*MIDDLE)]
    if len(middle):
        what = f"rms change of ln v_c(x), late precursor, x/L = {MIDDLE[0]:g} to {MIDDLE[1]:g}"
        rows.append((what, case, float(np.sqrt(np.mean(middle**2)))))
    return rows


COLOURS = ("#E69F00", "#009E73", "#0072B2", "#CC79A7", "#56B4E9", "#D55E00")


def figure(tables: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the study as a figure: cracks, lengths, speeds of the late precursor, all speeds."""
    fig = DataFigure(figsize=(7.2, 5.8), layout="constrained")
    FigureCanvasAgg(fig)
    (cracks, lengths), (late, every) = fig.subplots(2, 2)
    _draw_cracks(cracks, tables["crack"])
    _draw_lengths(lengths, tables["lengths"])
    _draw_fronts(late, every, tables["fronts"])
    several = (tables["fronts"]["scene"] != "fig1").any()
    titles = (
        "(a) crack at S = 3",
        r"(b) precursors, $d_\mathrm{c}$ = 1 $\mu$m",
        rf"(c) precursor with $L_\mathrm{{p}}/L$ near {LATE:g}",
        "(d) main events, runs 1 to 4" if several else "(d) main events",
    )
    for axes, title in zip((cracks, lengths, late, every), titles, strict=True):
        axes.set_title(title, fontsize=8, loc="left")
        axes.tick_params(labelsize=7, direction="in", which="both")
        axes.legend(fontsize=6, frameon=False)
    fig.caption = (
        "(a) Two-sided crack under a uniform stress drop, S = 3: front speed against half length "
        "for several numbers of blocks in X_c0, and the equation of motion of fracture mechanics. "
        "(b) Fig. 1 scene with d_c = 1 um: lengths in dynamics against the length at which the "
        "energy release of static states no longer exceeds the fracture energy. (c) Its front "
        "speeds, with d_c = 1 um (points) and 0 (thin lines), at several l; dashed: c_R, c_S, c_L "
        "of the lattice. (d) Speeds of main events against the scaled prestress, with d_c = 1 um "
        "(points) and 0 (faint crosses), of "
        + ("runs 1 to 4" if several else "the Fig. 1 scene")
        + "; grey: the exact speed in a chain with the paper's viscosity. Lattices that are not "
        "run as a whole begin from the tractions of one twice as coarse, just before the event. "
        + "Hybrid engine, linear geometry, located switching; the crack in full dynamics."
    )
    fig.tables = {**tables, "summary": summary(tables)}
    return fig


def _draw_cracks(axes: Any, table: pd.DataFrame) -> None:
    material = Crack(blocks=1).material
    groups = table.groupby(["blocks", "eta2", "dashpots"])
    for ((n, eta2, dashpots), rows), colour in zip(groups, COLOURS, strict=False):
        text = rf"{n:g} blocks in $X_\mathrm{{c0}}$" + (
            ", resists rotation" if dashpots == "full" else ""
        )
        text += ", paper's viscosity" if eta2 == 0.1 else ""
        axes.plot(rows["a"] / 1e3, rows["v"] / material.c_R, "o", color=colour, ms=2.5, label=text)
    a = np.linspace(FROM, TO, 100)
    v = Crack(blocks=1).speed(a)
    axes.plot(a / 1e3, v / material.c_R, "k", lw=0.8, label="fracture mechanics")
    axes.fill_between(
        a / 1e3,
        0.95 * v / material.c_R,
        1.05 * v / material.c_R,
        color="0.92",
        lw=0,
        label="within 5 %",
    )
    axes.set_xlabel("half length $a$ (km)", fontsize=8)
    axes.set_ylabel(r"front speed $v/c_\mathrm{R}$", fontsize=8)


def _draw_lengths(axes: Any, table: pd.DataFrame) -> None:
    for (l, rows), colour in zip(table.groupby("l", sort=False), COLOURS, strict=False):
        text = rf"$l$ = {l * 1e3:g} mm"
        axes.plot(rows["griffith"], rows["dynamics"], "o", color=colour, ms=3, label=text)
    axes.plot([0, 1], [0, 1], color="0.6", lw=0.7, label="equal")
    top = 1.15 * table["dynamics"].max()
    axes.set_xlim(0, top)
    axes.set_ylim(0, top)
    axes.set_xlabel(r"$L_\mathrm{p}/L$ where $G=\Gamma$, static states", fontsize=8)
    axes.set_ylabel(r"$L_\mathrm{p}/L$ in dynamics", fontsize=8)


def _chain(most: float) -> tuple[np.ndarray, np.ndarray]:
    """Return values of the scaled prestress, and front speeds of a chain at these, m/s."""
    k, m, l = _lattice(preset("fig1"))
    eta = preset("fig1").eta / math.sqrt(k * m)
    scaled = np.linspace(0.02, min(most, 0.8), 40)
    v = [theory.chain_speed(float(one), 0.0, eta) for one in scaled]
    return scaled, l * math.sqrt(k / m) * np.array(v)


def _draw_fronts(late: Any, every: Any, table: pd.DataFrame) -> None:
    d_cs, spacings = sorted(table["d_c"].unique()), sorted(table["l"].unique(), reverse=True)
    fig1, others = table[table["scene"] == "fig1"], table[table["scene"] != "fig1"]
    chosen = others if len(others) else fig1
    lattices = list(zip(spacings, COLOURS, strict=False))
    for (l, colour), d_c in itertools.product(lattices, d_cs):
        label = rf"$l$ = {l * 1e3:g} mm"
        if l in set(fig1["l"]):
            rows = fig1[(fig1["l"] == l) & (fig1["d_c"] == d_c) & fig1["late"]]
            rows = rows[rows["begun"] == rows["begun"].min()]
            how = {"marker": "o", "ls": "", "ms": 2.5, "label": label} if d_c else {"lw": 0.6}
            late.plot(rows["x_over_L"], rows["v_c"], color=colour, **how)
        if l in set(chosen["l"]):
            rows = chosen[(chosen["l"] == l) & (chosen["d_c"] == d_c)]
            how = {"marker": "o", "ms": 2, "label": label} if d_c else {"marker": "x", "ms": 1.5}
            how |= {"alpha": 1.0 if d_c else 0.3, "zorder": 3 if d_c else 1, "mew": 0.5}
            every.plot(rows["scaled"], rows["v_c"], ls="", color=colour, **how)
    every.plot(*_chain(chosen["scaled"].max()), color="0.3", lw=0.8, label="chain, exact")
    material = theory.Material.of_lattice(*_lattice(preset("fig1")), 1.0)
    speeds = {"R": material.c_R, "S": material.c_S, "L": material.c_P}
    for axes in (late, every):
        for name, speed in speeds.items():
            above = (0, -7) if name == "R" else (0, 1)
            mark(axes, speed, rf"$c_\mathrm{{{name}}}$", at=0.985, away=above, ha="right")
        axes.set_yscale("log")
    if 0 in d_cs:
        late.plot([], [], color="0.4", lw=0.6, label=r"lines: $d_\mathrm{c}$ = 0")
        every.plot([], [], "x", color="0.6", ms=3, mew=0.5, label=r"$d_\mathrm{c}$ = 0")
    for axes in (late, every):
        axes.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)", fontsize=8)
    every.set_ylim(top=9e3)  # room for the legend
    late.set_xlabel("position $x/L$", fontsize=8)
    scaled = r"(\tau/p-\mu_\mathrm{k})/(\mu_\mathrm{s}-\mu_\mathrm{k})"
    every.set_xlabel(rf"scaled prestress ${scaled}$", fontsize=8)
