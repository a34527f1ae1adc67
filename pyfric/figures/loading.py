"""Fig. 1(b): the loading curve, and where the interface slips."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from pyfric.figures.sketch import sketch
from pyfric.figures.style import (
    BLACK,
    BLUE,
    GREY,
    PAPER,
    SMALL,
    VERMILION,
    DataFigure,
    caption,
    figure,
    legend,
    mark,
    panels,
    single,
    time_unit,
)
from pyfric.record import Record, analysis, main_blocks, numbered

CURVE_BINS = 2000
"""Number of bins of the loading curve's envelope: about two per pixel at column width."""

KINDS = {
    "whole": ("whole interface", VERMILION, 1.5, 3),
    "partial": ("partial", BLUE, 1.5, 2),
    "micro": ("micro-slip", GREY, 0.6, 1),
}
"""Kind of event -> legend text, colour, line width (pt), drawing order."""


@figure("Fig. 1(a): the scene, to scale", runs="fig1")
def fig1a(record: Record) -> DataFigure:
    """Fig. 1(a) of the paper: a sketch of the scene; see `sketch`."""
    single(record)
    return sketch(record.scene)


@figure("Fig. 1(b): loading curve and slipping regions", runs="fig1")
def fig1b(record: Record) -> DataFigure:
    """Fig. 1(b) of the paper: loading curve, and where the interface slips in each event.

    Top: F_T/F_N against time, with mu_k as a reference. Bottom: each event is a vertical bar at the
    time of its first slip, over the slipped blocks. The axis is x/L from the trailing edge. Block n
    covers (n-1)/N_x to n/N_x, so that a bar from the trailing edge ends at L_p/L. Blocks that only
    made corner slips, or were open when the event ended, are drawn thin.
    """
    single(record)
    fig, (top, bottom) = panels(3.3, (1.15, 1), sharex=True)

    t, F_T = envelope(record.curve["t"].to_numpy(), record.curve["F_T"].to_numpy())
    force = F_T / record.scene.F_N
    segments = slip_segments(record)
    mu_k = record.scene.law.mean.mu_k
    mark(top, mu_k, r"$\mu_\mathrm{k}$", at=0, away=(6, -2), va="top")
    span = t[-1] - t[0] if t.size else 0.0
    scale, unit = time_unit(span)
    top.plot(scale * t, force, color=BLACK, lw=0.9, solid_joinstyle="round")
    top.set_ylim(0, 1.12 * max(mu_k, np.max(force, initial=0.0)))
    top.set_ylabel(r"force $F_\mathrm{T}/F_\mathrm{N}$")
    handles = _draw_segments(bottom, segments, scale)
    if handles:  # at the best place: below a long curve, above a short one
        legend(top, handles=handles, title="slip in (b)", loc="best")
    bottom.set_xlabel(rf"time $t$ ({unit})")
    if span > 0:
        bottom.set_xlim(scale * t[0], scale * (t[-1] + 0.01 * span))
    fig.align_ylabels([top, bottom])

    fig.caption = figure_caption(record)
    fig.tables = {
        "curve": pd.DataFrame({"t_s": t, "F_T_over_F_N": force}),
        "slip": segments,
    }
    return fig


def slip_segments(record: Record) -> pd.DataFrame:
    """Return slipped regions: one row for each event and each group of neighbouring blocks.

    Columns: event (from 1); t_s, time of first slip, s; kind, "whole" (over the whole interface),
    "partial" (main event) or "micro"; slipped, False for blocks that slipped only while nearly
    unloaded or were open in the event; first_block, last_block, from the trailing edge; x_from,
    x_to, x/L.
    """
    scene, events = record.scene, record.events
    region = record.region[:, np.argsort(scene.n_of_i)]
    edge = np.ones(region.shape, dtype=bool)
    edge[:, 1:] = region[:, 1:] != region[:, :-1]
    first = np.flatnonzero(edge)
    last = np.append(first[1:], region.size)[: first.size] - 1
    kept = region.ravel()[first] > 0
    first, last = first[kept], last[kept]
    row = first // scene.N_x
    n_first, n_last = first % scene.N_x + 1, last % scene.N_x + 1

    return pd.DataFrame(
        {
            "event": row + 1,
            "t_s": events["t_start"].to_numpy()[row],
            "kind": event_kinds(record)[row],
            "slipped": region.ravel()[first] == 1,
            "first_block": n_first,
            "last_block": n_last,
            "x_from": (n_first - 1) / scene.N_x,
            "x_to": n_last / scene.N_x,
        }
    )


def event_kinds(record: Record) -> np.ndarray:
    """Return the kind of each event: "whole" (over the whole interface), "partial" or "micro"."""
    main = record.events["is_main"].to_numpy()
    whole = main & (record.events["L_p_over_L"].to_numpy() == 1)
    return np.where(whole, "whole", np.where(main, "partial", "micro"))


def figure_caption(record: Record) -> str:
    """Return a caption with parameters of the scene, the engine and the numbers of events."""
    events = record.events
    t_end = record.curve["t"].iloc[-1] if len(record.curve) else 0.0
    kinds, main = event_kinds(record), events["is_main"].to_numpy()
    whole = int((kinds == "whole").sum())
    precursors = len(analysis.precursors(record))
    open_at_end = int((main & events["is_precursor"] & ~events["finished"]).sum())
    interior = int(main.sum()) - whole - precursors - open_at_end
    counts = [
        numbered(precursors, "main precursor"),
        f"{numbered(whole, 'event')} over the whole interface",
        *([numbered(open_at_end, "unfinished main event")] if open_at_end else []),
        *([f"{numbered(interior, 'main event')} away from the trailing edge"] if interior else []),
        f"{numbered(len(events) - int(main.sum()), 'micro-slip')} of fewer than "
        f"{main_blocks(record.scene.N_x)} blocks",
    ]
    what = (
        "Loading curve F_T/F_N (a) and slipping regions of all events over x/L, from the "
        f"trailing edge (b); after Fig. 1(b) of {PAPER}."
    )
    found = f"Up to t = {t_end:.4g} s: {', '.join(counts)}."
    return caption(record, what, found)


# --- parts ---------------------------------------------------------------------------------------


def envelope(t: np.ndarray, y: np.ndarray, bins: int = CURVE_BINS) -> tuple[np.ndarray, ...]:
    """Return the ends of a curve, and its lowest and highest points in each bin, in order."""
    if t.size <= 4 * bins:
        return t, y
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    extremes = [(a + np.argmin(y[a:b]), a + np.argmax(y[a:b])) for a, b in pairwise(edges)]
    kept = np.unique(np.concatenate([[0, t.size - 1], np.ravel(extremes)]))
    return t[kept], y[kept]


def _draw_segments(axes: Axes, segments: pd.DataFrame, scale: float) -> list[Line2D]:
    """Draw the bars, with times scaled; return a legend handle for each kind present."""
    handles = []
    for kind, (label, colour, width, order) in KINDS.items():
        rows = segments[segments["kind"] == kind]
        if rows.empty:
            continue
        t = scale * rows["t_s"].to_numpy()
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
    axes.set_ylabel(r"slip region $x/L$")
    if not handles:
        axes.text(0.5, 0.5, "no slip", transform=axes.transAxes, ha="center", fontsize=SMALL)
    return handles
