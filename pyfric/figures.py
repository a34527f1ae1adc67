"""Figures of the paper, drawn from records.

Every function returns a `DataFigure`: a Matplotlib figure that carries its caption and the data
behind it. `save_figure` writes all of them side by side. Nothing here uses pyplot, so drawing
leaves no global state and needs no display. Colours are from the Okabe-Ito set, which stays
distinguishable under colour blindness; line widths differ as well.
"""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pyfric.catalogue import MAIN_EVENT_BLOCKS

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["DataFigure", "fig1b", "figure_caption", "save_figure", "slip_segments"]

COLUMN_WIDTH = 3.4
"""Width of one journal column, inches."""
PNG_DPI = 300
CURVE_BINS = 2000
"""Columns of the loading curve's envelope: about two per pixel at column width."""

SMALL, BODY = 7, 8  # font sizes, pt

KINDS = {
    "whole": ("whole interface", "#D55E00", 1.5, 3),
    "partial": (f"partial, {MAIN_EVENT_BLOCKS} blocks or more", "#0072B2", 1.5, 2),
    "micro": ("micro-slip, fewer blocks", "#999999", 0.6, 1),
}
"""Kind of event -> legend text, colour, line width (pt), drawing order."""


class DataFigure(Figure):
    """A figure with its ``caption`` (text) and ``tables`` (name -> data frame behind it)."""

    caption: str = ""
    tables: dict[str, pd.DataFrame]


def fig1b(record: Record, path: str | os.PathLike[str] | None = None) -> DataFigure:
    """Fig. 1(b) of the paper: loading curve, and where the interface slips in each event.

    Top: F_T/F_N against time, with mu_k as a reference. Bottom: each event as a vertical bar at
    the time of its first slip, over the blocks that slipped; x/L from the trailing edge. Block n
    covers (n-1)/N_x to n/N_x, so that a bar from the trailing edge ends at L_p/L. Blocks that
    only made corner slips, or were open when the event ended, are drawn thin.

    Parameters
    ----------
    record
        The run to draw.
    path
        If given, the figure is also written there: see `save_figure`.
    """
    fig = DataFigure(figsize=(COLUMN_WIDTH, 3.3), layout="constrained")
    FigureCanvasAgg(fig)
    fig.get_layout_engine().set(h_pad=0.02, w_pad=0.02, hspace=0.02)
    top, bottom = fig.subplots(2, 1, sharex=True, height_ratios=(1.15, 1))

    t, F_T = _envelope(record.curve["t"].to_numpy(), record.curve["F_T"].to_numpy())
    force = F_T / record.scene.F_N
    segments = slip_segments(record)
    _draw_curve(top, t, force, record.scene.interface.mu_k)
    handles = _draw_segments(bottom, segments)
    if handles:  # below the rising curve, where there is room
        top.legend(
            handles=handles,
            title="slip in (b)",
            loc="lower right",
            fontsize=SMALL,
            title_fontsize=SMALL,
            alignment="left",
            handlelength=1.4,
            labelspacing=0.3,
            borderaxespad=0.3,
            frameon=False,
        )
    bottom.set_xlabel(r"time $t$ (s)", fontsize=BODY)
    if t.size and t[-1] > t[0]:
        bottom.set_xlim(t[0], t[-1] + 0.01 * (t[-1] - t[0]))
    for axes, letter in ((top, "a"), (bottom, "b")):
        _style(axes, letter)
    fig.align_ylabels([top, bottom])

    fig.caption = figure_caption(record)
    fig.tables = {
        "curve": pd.DataFrame({"t_s": t, "F_T_over_F_N": force}),
        "slip": segments,
    }
    if path is not None:
        save_figure(fig, path)
    return fig


def slip_segments(record: Record) -> pd.DataFrame:
    """Slipped regions as straight pieces: one row per event and run of neighbouring blocks.

    Columns: event (row of ``record.events``); t_s, time of first slip, s; kind, "whole" (reaches
    over the whole interface), "partial" (main event) or "micro"; slipped, False for blocks that
    only made corner slips or were open at the end; first_block, last_block, numbers from the
    trailing edge; x_from, x_to, x/L from the trailing edge.
    """
    scene, events = record.scene, record.events
    region = record.region[:, np.argsort(scene.n_of_i)]
    edge = np.ones(region.shape, dtype=bool)
    edge[:, 1:] = region[:, 1:] != region[:, :-1]
    first = np.flatnonzero(edge)
    last = np.append(first[1:], region.size)[: first.size] - 1
    kept = region.ravel()[first] > 0
    first, last = first[kept], last[kept]
    event = first // scene.N_x
    n_first, n_last = first % scene.N_x + 1, last % scene.N_x + 1

    whole = events["is_main"].to_numpy() & (events["L_p_over_L"].to_numpy() == 1)
    kind = np.where(events["is_main"].to_numpy(), "partial", "micro")
    kind = np.where(whole, "whole", kind)
    return pd.DataFrame(
        {
            "event": event,
            "t_s": events["t_start"].to_numpy()[event],
            "kind": kind[event],
            "slipped": region.ravel()[first] == 1,
            "first_block": n_first,
            "last_block": n_last,
            "x_from": (n_first - 1) / scene.N_x,
            "x_to": n_last / scene.N_x,
        }
    )


def figure_caption(record: Record) -> str:
    """Caption with the scene's parameters, the engine and what was found."""
    scene, method, events = record.scene, record.method, record.events
    slider, driver, friction = scene.slider, scene.driver, scene.interface
    if scene.rigid:
        load = "rigid rod on top"
    elif scene.N_z == 1:
        load = f"chain under prescribed loads, k_top = {scene.k_top / 1e6:g} MN/m"
    else:
        load = f"distributed load, theta = {scene.top.theta:g}"
    step = "" if method.dt is None else f", time step {method.dt * 1e6:g} us"
    how = ", ".join(part for part in (method.stepper, method.switching) if part)
    t_end = record.curve["t"].iloc[-1] if len(record.curve) else 0.0
    main = events["is_main"].to_numpy()
    whole = int((main & (events["L_p_over_L"].to_numpy() == 1)).sum())
    precursors = int((main & events["is_precursor"].to_numpy()).sum())
    interior = int(main.sum()) - whole - precursors
    counts = [
        f"{precursors} main precursors",
        f"{whole} events over the whole interface",
        *([f"{interior} main events away from the trailing edge"] if interior else []),
        f"{len(events) - int(main.sum())} micro-slips of fewer than {MAIN_EVENT_BLOCKS} blocks",
    ]
    what = (
        "Loading curve F_T/F_N (a) and slipping regions of all events over x/L, from the "
        "trailing edge (b); after Fig. 1(b) of Phys. Rev. Lett. 107, 074301."
    )
    which = (
        f"Scene{' ' + scene.name if scene.name else ''}: {load}, L = {slider.L * 1e3:g} mm, "
        f"H = {slider.H * 1e3:g} mm, l = {slider.l * 1e3:g} mm ({scene.N_x} x {scene.N_z} blocks), "
        f"F_N = {scene.F_N:g} N, driver K = {driver.K / 1e6:g} MN/m, V = {driver.V * 1e3:g} mm/s, "
        f"h = {driver.h * 1e3:g} mm, on the {driver.side}; k = {slider.k / 1e6:g} MN/m, "
        f"mu_s = {friction.mu_s:g}, mu_k = {friction.mu_k:g}."
    )
    by = (
        f"Engine: {method.engine}, {method.geometry} geometry{', ' + how if how else ''}{step}; "
        f"events joined over pauses up to {method.t_gap * 1e3:g} ms."
    )
    text = [what, which, by, f"Up to t = {t_end:.4g} s: {', '.join(counts)}."]
    if record.status != "complete":
        text.append(f"Run {record.status}.")
    if "pyfric" in record.versions:
        text.append(f"pyfric {record.versions['pyfric']}.")
    return " ".join(text)


def save_figure(fig: DataFigure, path_stem: str | os.PathLike[str]) -> list[Path]:
    """Write the figure as PNG (300 dpi) and PDF, its caption as text and its data as CSV.

    ``path_stem`` is a path without suffix; the files are stem.png, stem.pdf, stem.txt and
    stem_<table>.csv. Missing folders are made. Returns the paths.
    """
    stem = Path(path_stem)
    stem.parent.mkdir(parents=True, exist_ok=True)
    paths = [stem.with_name(stem.name + suffix) for suffix in (".png", ".pdf", ".txt")]
    png, pdf, txt = paths
    fig.savefig(png, dpi=PNG_DPI, metadata={"Description": fig.caption})
    fig.savefig(pdf, dpi=PNG_DPI, metadata={"Subject": fig.caption, "CreationDate": None})
    txt.write_text(fig.caption + "\n", encoding="utf-8")
    for name, table in fig.tables.items():
        paths.append(stem.with_name(f"{stem.name}_{name}.csv"))
        table.to_csv(paths[-1], index=False)
    return paths


# --- parts ---------------------------------------------------------------------------------------


def _envelope(t: np.ndarray, y: np.ndarray, bins: int = CURVE_BINS) -> tuple[np.ndarray, ...]:
    """Thin a curve to the lowest and highest point of each bin, in order, and both ends."""
    if t.size <= 4 * bins:
        return t, y
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    extremes = [(a + np.argmin(y[a:b]), a + np.argmax(y[a:b])) for a, b in pairwise(edges)]
    kept = np.unique(np.concatenate([[0, t.size - 1], np.ravel(extremes)]))
    return t[kept], y[kept]


def _draw_curve(axes: Axes, t: np.ndarray, force: np.ndarray, mu_k: float) -> None:
    axes.axhline(mu_k, color="0.5", lw=0.7, ls=(0, (4, 3)))
    axes.annotate(
        r"$\mu_\mathrm{k}$",
        (0, mu_k),
        xycoords=("axes fraction", "data"),
        xytext=(6, -2),
        textcoords="offset points",
        ha="left",
        va="top",
        fontsize=SMALL,
        color="0.35",
    )
    axes.plot(t, force, color="black", lw=0.9, solid_joinstyle="round")
    axes.set_ylim(0, 1.12 * max(mu_k, np.max(force, initial=0.0)))
    axes.set_ylabel(r"force $F_\mathrm{T}/F_\mathrm{N}$", fontsize=BODY)


def _draw_segments(axes: Axes, segments: pd.DataFrame) -> list[Line2D]:
    """Draw the bars; return one legend handle per kind that occurs."""
    handles = []
    for kind, (label, colour, width, order) in KINDS.items():
        rows = segments[segments["kind"] == kind]
        if rows.empty:
            continue
        t = rows["t_s"].to_numpy()
        ends = [np.column_stack([t, rows[x].to_numpy()]) for x in ("x_from", "x_to")]
        widths = np.where(rows["slipped"], width, width / 3)
        lines = LineCollection(
            list(np.stack(ends, axis=1)),
            colors=colour,
            linewidths=widths,
            capstyle="butt",
            zorder=order,
            rasterized=len(rows) > 5000,
        )
        axes.add_collection(lines)
        handles.append(Line2D([], [], color=colour, lw=max(width, 1.0), label=label))
    axes.set_ylim(0, 1)
    axes.set_ylabel(r"slip region $x/L$", fontsize=BODY)
    if not handles:
        axes.text(0.5, 0.5, "no slip", transform=axes.transAxes, ha="center", fontsize=SMALL)
    return handles


def _style(axes: Axes, letter: str) -> None:
    axes.tick_params(direction="in", top=True, right=True, labelsize=SMALL, width=0.6, length=3)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
    axes.text(
        0.02,
        0.96,
        f"({letter})",
        transform=axes.transAxes,
        ha="left",
        va="top",
        fontsize=BODY,
        fontweight="bold",
    )
