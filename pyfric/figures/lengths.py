"""Fig. 2: lengths of precursors against force, with the prediction for mu_s = mu_k."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pyfric.engines import prediction_curve
from pyfric.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PAPER,
    PURPLE,
    SKY,
    VERMILION,
    DataFigure,
    caption,
    figure,
    joined,
    legend,
    listed,
    mark,
    panels,
    single,
)
from pyfric.record import Record, precursor_lengths
from pyfric.scene import Scene
from pyfric.values import SceneError

COLOURS = (SKY, BLUE, GREEN, ORANGE, VERMILION, PURPLE)
MARKERS = "os^D"
SHIFT = 0.1
"""Shift to the right of each load from the previous load, in F_T/F_N."""


@figure("Fig. 2(a): precursor length against force, setup 1", runs="fig2a")
def fig2a(records: Sequence[Record]) -> DataFigure:
    """Fig. 2(a) of the paper: precursor length against force after arrest, setup 1.

    Colours are h, markers L. Lines are `prediction_curve`, one for each L and h. Small dots are
    precursors that reach no further than an earlier precursor. If runs with equal L and h have
    different F_N, panel (b) shows these runs again. Each F_N and its prediction are shifted to the
    right.

    Args:
        records: runs of setup 1 up to sliding; L, h and F_N may differ.

    Raises:
        SceneError: there is no record.
    """
    records = listed(records)
    scenes = [record.scene for record in records]
    predicted = {(scene.slider.L, scene.driver.h, scene.driver.h_top): scene for scene in scenes}
    points, curves = lengths_of(records), _predictions(list(predicted.values()))
    colour = dict(zip(sorted(curves["h_mm"].unique()), cycle(COLOURS), strict=False))
    shape = dict(zip(sorted(curves["L_mm"].unique()), cycle(MARKERS), strict=False))
    several = points.groupby(["L_mm", "h_mm"])["F_N"].transform("nunique") > 1

    both = several.any()
    fig, axes = panels(5.0, (1.7, 1)) if both else panels(3.1)
    for _, curve in curves.groupby(["L_mm", "h_mm", "theta"], dropna=False):
        axes[0].plot(curve["F_T_over_F_N"], curve["L_p_over_L"], color="0.75", lw=0.6, zorder=1)
    for (L, h), rows in points.groupby(["L_mm", "h_mm"]):
        _draw(axes[0], rows, colour[h], shape[L])
    handles = [_dot(shade, f"{h:g} mm") for h, shade in colour.items()]
    legend(axes[0], handles=handles, title=r"height $h$", loc="upper left")
    axes[0].add_artist(axes[0].get_legend())
    handles = [_dot("0.3", f"$L$ = {L:g} mm", marker) for L, marker in shape.items()]
    handles += [Line2D([], [], color="0.75", lw=1, label=PREDICTED)]
    legend(axes[0], handles=handles, loc="upper left", bbox_to_anchor=(0.25, 1.0))
    _frame(axes[0], records)
    if both:
        _draw_loads(axes[1], points[several], curves, shape)
    fig.tables = {"points": points, "prediction": curves}
    what = (
        "Precursor length L_p/L against the static F_T/F_N after arrest, setup 1; after Fig. 2(a) "
        f"of {PAPER}. Colour: h; marker: L."
    )
    if both:
        what += f" (b) Runs that differ in F_N, each F_N shifted by {SHIFT:g}; colour: F_N."
    fig.caption = caption(records, what, _what(points))
    return fig


def _draw_loads(
    axes: Axes, points: pd.DataFrame, curves: pd.DataFrame, shape: dict[float, str]
) -> None:
    """Draw runs that differ only in F_N, each F_N shifted from the previous one."""
    handles = []
    for n, (F_N, rows) in enumerate(points.groupby("F_N")):
        colour = (BLUE, VERMILION, GREEN)[n % 3]
        for (L, h), group in rows.groupby(["L_mm", "h_mm"]):
            curve = curves[(curves["L_mm"] == L) & (curves["h_mm"] == h)]
            axes.plot(curve["F_T_over_F_N"] + n * SHIFT, curve["L_p_over_L"], color="0.75", lw=0.6)
            group = group.assign(F_T_over_F_N=group["F_T_over_F_N"] + n * SHIFT)
            _draw(axes, group, colour, shape[L])
        shift = f" (+{n * SHIFT:g})" if n else ""
        handles.append(_dot(colour, rf"$F_\mathrm{{N}}$ = {F_N:g} N{shift}"))
    heights = joined(f"{h:g}" for h in sorted(points["h_mm"].unique()))
    legend(axes, handles=handles, title=rf"$h$ = {heights} mm", loc="upper left")
    axes.set_xlabel(r"force after arrest $F_\mathrm{T}/F_\mathrm{N}$, shifted")
    axes.set_ylabel(r"$L_\mathrm{p}/L$")
    axes.set_ylim(0, 1.02)
    axes.set_xlim(left=0)


@figure("Fig. 2(b): precursor length against force, setup 2", runs="fig2b")
def fig2b(records: Sequence[Record]) -> DataFigure:
    """Fig. 2(b) of the paper: as Fig. 2(a), for setup 2 and several slopes theta of the load.

    Raises:
        SceneError: there is no record, or a record is not of setup 2.
    """
    records = listed(records)
    for record in records:
        if (kind := record.scene.top.kind) != "distributed":
            raise SceneError("scene.top.kind", kind, "", "'distributed', as in setup 2")
    points, curves = lengths_of(records), _predictions([record.scene for record in records])
    fig, (axes,) = panels(2.7)
    handles = []
    for n, theta in enumerate(sorted({record.scene.top.theta for record in records})):
        colour, shape = (BLUE, BLACK, VERMILION, GREEN)[n % 4], MARKERS[n % 4]
        curve = curves[curves["theta"] == theta]
        axes.plot(curve["F_T_over_F_N"], curve["L_p_over_L"], color=colour, lw=0.8, zorder=1)
        _draw(axes, points[points["theta"] == theta], colour, shape)
        handles.append(_dot(colour, rf"$\theta = {theta:g}$", shape))
    handles.append(Line2D([], [], color="0.3", lw=0.8, label=PREDICTED))
    legend(axes, handles=handles, loc="upper left")
    _frame(axes, records)
    fig.tables = {"points": points, "prediction": curves}
    what = (
        "Precursor length L_p/L against the static F_T/F_N after arrest, setup 2; after Fig. 2(b) "
        f"of {PAPER}. theta > 0: little load on the trailing edge. theta = 0.833: from F_T/F_N of "
        "about 0.28 on an interior gap opens, and the order of events depends on rounding."
    )
    fig.caption = caption(records, what, _what(points))
    return fig


def growth(record: Record) -> DataFigure:
    """Draw the growth of the slipping zone of `prediction_curve`: length against force."""
    single(record)
    curve = _prediction(record)
    fig, (axes,) = panels(2.4)
    axes.plot(curve["F_T_over_F_N"], curve["L_p_over_L"], color=BLACK, lw=0.9)
    axes.set_xlim(0, 1.05 * max(curve["F_T_over_F_N"].max(), 1e-9))
    axes.set_ylim(0, 1.02)
    axes.set_xlabel(r"force $F_\mathrm{T}/F_\mathrm{N}$")
    axes.set_ylabel(r"slipping zone $L_\mathrm{p}/L$")
    fig.tables = {"prediction": curve}
    mu = record.scene.law.mean.mu_k
    what = f"Length L_p/L of the slipping zone against F_T/F_N for mu_s = mu_k = {mu:g}."
    fig.caption = caption(record, what)
    return fig


PREDICTED = r"$\mu_\mathrm{s}=\mu_\mathrm{k}$ prediction"


def lengths_of(records: Sequence[Record]) -> pd.DataFrame:
    """Return a table of all precursors.

    Columns: scene, L_mm, h_mm, F_N, theta (NaN without slope), event, F_T_over_F_N, L_p_over_L, and
    advances, whether the precursor reaches further than all earlier precursors.
    """
    tables = []
    for record in records:
        table = precursor_lengths(record).rename(columns={"force": "F_T_over_F_N"})
        before = table["L_p_over_L"].cummax().shift(fill_value=0.0)
        table["advances"] = table["L_p_over_L"] > before
        tables.append(_named(record.scene, table))
    return pd.concat(tables, ignore_index=True)


def _named(scene: Scene, table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with its scene in leading columns."""
    columns = {
        "scene": scene.name,
        "L_mm": round(scene.slider.L * 1e3, 9),
        "h_mm": round(scene.driver.h * 1e3, 9),
        "F_N": scene.F_N,
        "theta": getattr(scene.top, "theta", np.nan),
    }
    return pd.DataFrame(columns, index=table.index).join(table)


def _predictions(scenes: Sequence[Scene]) -> pd.DataFrame:
    tables = [_named(scene, _prediction(prediction_curve(scene))) for scene in scenes]
    return pd.concat(tables, ignore_index=True)


def _prediction(record: Record) -> pd.DataFrame:
    curve = record.curve
    force = curve["F_T"] / record.scene.F_N
    return pd.DataFrame({"F_T_over_F_N": force, "L_p_over_L": curve["L_p_over_L"]})


def _draw(axes: Axes, rows: pd.DataFrame, colour: str, shape: str) -> None:
    ahead = {"marker": shape, "ms": 3.2, "mec": "white", "mfc": colour, "mew": 0.3, "zorder": 3}
    behind = {"marker": ".", "ms": 2, "mec": colour, "zorder": 2}
    for advances, look in ((True, ahead), (False, behind)):
        shown = rows[rows["advances"] == advances]
        axes.plot(shown["F_T_over_F_N"], shown["L_p_over_L"], ls="", **look)


def _dot(colour: str, label: str, shape: str = "o") -> Line2D:
    look = {"mec": colour, "mfc": colour, "mew": 0.7, "ms": 3.5}
    return Line2D([], [], ls="", marker=shape, label=label, **look)


def _frame(axes: Axes, records: Sequence[Record]) -> None:
    for mu_k in sorted({record.scene.law.mean.mu_k for record in records}):
        mark(axes, mu_k, r"$\mu_\mathrm{k}$", vertical=True, at=0.02, away=(3, 2))
    axes.set_xlim(0, 1.1 * max(record.scene.law.mean.mu_k for record in records))
    axes.set_ylim(0, 1.02)
    axes.set_xlabel(r"force after arrest $F_\mathrm{T}/F_\mathrm{N}$")
    axes.set_ylabel(r"precursor length $L_\mathrm{p}/L$")


def _what(points: pd.DataFrame) -> str:
    return (
        "Lines: growth of the slipping zone with mu_s = mu_k; dashed: mu_k. "
        f"{len(points)} precursors of 4 blocks or more, before the first event over the whole "
        f"interface. Small dots: the {int((~points['advances']).sum())} that reach no further than "
        "an earlier one."
    )
