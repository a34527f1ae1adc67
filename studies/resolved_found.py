"""Results of the study `resolved`: its numbers, its verdict and its figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from resolved import D_C, VISCOSITIES

from pyfric.figures import DataFigure
from pyfric.figures.style import style
from pyfric.paper.claims.shares import shares
from pyfric.record import RESOLVED
from pyfric.record.zones import material_of
from pyfric.scene import preset
from pyfric.theory import g_II

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

__all__ = ["figure", "report", "summary", "verdict"]

SHARE = 0.5
"""Least share of resolved places, and least share of the variance that a collapse explains."""
COLOURS = ("#0072B2", "#D55E00", "#009E73")
MARKERS = {"run1": "o", "run2": "s", "run3": "^", "run4": "x"}


def _points(fronts: pd.DataFrame) -> pd.DataFrame:
    """Return the places that count: front, its number; place, 0 to 1; every, if in all variants."""
    points = fronts[fronts["inside"] & fronts["v_c"].notna()].copy()
    points["front"] = points.groupby(["scene", "event"], sort=False).ngroup()
    variants = fronts[["d_c", "viscosity"]].drop_duplicates()
    number = points.groupby(["front", "x"])["v_c"].transform("size")
    return points.assign(every=number == len(variants))


def _placed(points: pd.DataFrame) -> pd.DataFrame:
    x = points.groupby("front")["x"]
    first, last = x.transform("min"), x.transform("max")
    return points.assign(place=((points["x"] - first) / (last - first)).fillna(0.5))


def summary(fronts: pd.DataFrame) -> pd.DataFrame:
    """Return the shares that prestress, position and G/Gamma explain, for each variant.

    Returns:
        Columns: places, "own" or "every"; d_c; viscosity; fronts and points, their numbers; zone,
        the share of places with `RESOLVED` blocks or more, and zone_median; above_R and above_L,
        shares of v_c above c_R and c_L; then value, low, high and null of prestress, of position,
        of G/Gamma ("release"), of the prestress beyond the position, and of the prestress with
        ranks of v_c in place of ln v_c ("ranks"), which give single slow places no extra weight.
    """
    points, rows = _points(fronts), []
    for which, some in (("own", points), ("every", points[points["every"]])):
        for (d_c, viscosity), part in some.groupby(["d_c", "viscosity"], sort=False):
            row = {"places": which, "d_c": d_c, "viscosity": viscosity}
            row |= {"fronts": part["front"].nunique(), "points": len(part)}
            row["zone"] = float((part["zone"] >= RESOLVED).mean())
            row["zone_median"] = float(part["zone"].median())
            row |= {f"above_{c}": float((part[f"v_{c}"] > 1).mean()) for c in "RL"}
            part = _placed(part)
            for name, some_places, column, share in _asked(part):
                found = shares(some_places, column)[share]
                row |= {f"{name}_{end}": found[end] for end in ("value", "low", "high", "null")}
            rows.append(row)
    return pd.DataFrame(rows)


def _asked(part: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame, str, str]]:
    """Yield the quantities of a row: a name, the places, and column and share of `shares`."""
    for share in ("prestress", "position", "beyond"):
        yield share, part, "scaled", share
    yield "release", part, "release", "prestress"
    ranks = part.assign(v_c=np.exp(part["v_c"].rank(pct=True)))
    yield "ranks", ranks, "scaled", "prestress"


def verdict(row: pd.Series) -> str:
    """Return the verdict on a row of `summary`: keeps, loses, untold, or unresolved."""
    if row["zone"] < SHARE:
        return "unresolved"
    if row["prestress_low"] > max(SHARE, row["prestress_null"]):
        return "keeps"
    if row["prestress_high"] < SHARE or row["prestress_value"] < row["prestress_null"]:
        return "loses"
    return "untold"


def report(table: pd.DataFrame) -> str:
    """Return the table as text: shares of the variance of ln v_c, with their intervals."""
    rows: dict[str, Any] = {
        "places": table["places"],
        "d_c (um)": [f"{1e6 * one:g}" for one in table["d_c"]],
        "eta^2": table["viscosity"],
        "fronts": table["fronts"],
        "points": table["points"],
        "6 or more": [f"{one:.0%}" for one in table["zone"]],
        "v > c_R": [f"{one:.0%}" for one in table["above_R"]],
    }
    for key in ("prestress", "position", "release", "beyond"):
        ends = table[[f"{key}_{end}" for end in ("value", "low", "high", "null")]]
        rows[key] = ["{:.2f} ({:.2f} to {:.2f}; {:.2f})".format(*one) for one in ends.to_numpy()]
    rows["verdict"] = [verdict(row) for _, row in table.iterrows()]
    return pd.DataFrame(rows).to_string(index=False)


def figure(fronts: pd.DataFrame, checks: pd.DataFrame) -> DataFigure:
    """Draw the fronts of `resolved.study`, with numbers and `resolved.checks` as tables."""
    points = _points(fronts)
    fig = DataFigure(figsize=(7.0, 5.4), layout="constrained")
    (by_stress, by_stress_2), (by_G, zones) = fig.subplots(2, 2)
    little, paper = VISCOSITIES
    titles = (
        (by_stress, "(a) $\\eta^2$ = 0.001 $km$, along bonds", little, "scaled"),
        (by_stress_2, "(b) the paper's $\\eta^2$ = 0.1 $km$", paper, "scaled"),
        (by_G, "(c) as (a), against the energy release", little, "release"),
        (zones, "(d) measured cohesive zone of (a)", little, "x"),
    )
    for axes, title, viscosity, column in titles:
        style(axes)
        axes.set_title(title, fontsize=8, loc="left")
        some = points[points["viscosity"] == viscosity]
        for d_c, colour in zip(sorted(D_C), COLOURS, strict=False):
            label = rf"$d_\mathrm{{c}}$ = {d_c * 1e6:g} $\mu$m"
            axes.plot([], [], "o", color=colour, ms=3, label=label)
            for name, marker in MARKERS.items():
                part = some[(some["d_c"] == d_c) & (some["scene"] == name)]
                x = part["x"] / preset(name).slider.L if column == "x" else part[column]
                y = part["zone"] if column == "x" else part["v_R"]
                axes.plot(x, y, marker, color=colour, ms=2.2, mew=0.5, ls="")
    _label(by_stress, by_stress_2, by_G, zones)
    fig.caption = (
        "The last two precursors of runs 1 to 4, from the same tractions with three values of d_c: "
        "speeds of fronts against (a, b) the scaled prestress and (c) the energy release of static "
        "states over the fracture energy, with the speed of a crack in an infinite body (line). "
        "(d) Blocks between the tip and the block behind it that has slipped by d_c. Circles, "
        "squares, triangles and crosses: runs 1 to 4. Full dynamics, linear geometry."
    )
    fig.tables = {"fronts": fronts, "summary": summary(fronts), "checks": checks}
    return fig


def _label(by_stress: Axes, by_stress_2: Axes, by_G: Axes, zones: Axes) -> None:
    material = material_of(preset("run1"))
    for axes in (by_stress, by_stress_2, by_G):
        axes.set_ylabel(r"front speed $v_\mathrm{c}/c_\mathrm{R}$", fontsize=8)
        axes.set_yscale("log")
        axes.set_yticks([0.1, 0.2, 0.5, 1, 2], ["0.1", "0.2", "0.5", "1", "2"])
        axes.set_ylim(0.1, 3)
        axes.minorticks_off()
        axes.axhline(material.c_P / material.c_R, color="0.6", lw=0.6, ls=":")
        axes.annotate(
            r"$c_\mathrm{L}$",
            (0.98, material.c_P / material.c_R),
            (0, 1),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            fontsize=7,
            color="0.4",
            ha="right",
        )
    scaled = r"(\tau/p-\mu_\mathrm{k})/(\mu_\mathrm{s}-\mu_\mathrm{k})"
    for axes in (by_stress, by_stress_2):
        axes.set_xlabel(rf"scaled prestress ${scaled}$", fontsize=8)
    v = np.linspace(0.05, 0.995, 200)
    by_G.plot(1 / g_II(material, v * material.c_R), v, "k", lw=0.8, label="crack")
    by_G.set_xscale("log")
    by_G.minorticks_off()
    by_G.set_xlim(0.5, 12)
    by_G.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
    by_G.set_xlabel(r"energy release $G/\Gamma$", fontsize=8)
    zones.axhline(RESOLVED, color="0.6", lw=0.6, ls=":")
    zones.set_xlabel("position $x/L$", fontsize=8)
    zones.set_ylabel("blocks in the moving zone", fontsize=8)
    zones.set_ylim(bottom=0)
    for axes in (by_stress, by_G):
        axes.legend(fontsize=6.5, frameon=False)
