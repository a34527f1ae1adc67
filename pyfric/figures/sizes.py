"""Sizes of events, and waiting times between them."""

from __future__ import annotations

import numpy as np

from pyfric.figures.style import (
    BLACK,
    BLUE,
    VERMILION,
    DataFigure,
    caption,
    legend,
    mark,
    panels,
    single,
    time_unit,
)
from pyfric.record import Record, Sizes, held_in, sizes


def size_figure(record: Record, size: str = "potency", complete: float | None = None) -> DataFigure:
    """Draw numbers of events of at least each size (a), and waiting times between events (b).

    Args:
        record, size, complete: see `pyfric.analysis.sizes`.

    Raises:
        SceneError: see `pyfric.analysis.sizes`.
    """
    single(record)
    fig = sizes_drawn(sizes(record, size, complete), size, held_in("events")[size].unit)
    fig.caption = caption(record, fig.caption)
    return fig


def sizes_drawn(found: Sizes, size: str = "size", unit: str = "SI") -> DataFigure:
    """Draw sizes of events; `size` and `unit` are the label of the axis. See `size_figure`."""
    fig, (above, below) = panels(4.2, (1.3, 1))
    counts, m_c = found.counts, 10**found.m_c
    above.loglog(counts["size"], counts["number"], ls="", marker=".", ms=3, color=BLUE)
    line = np.array([m_c, counts["size"].iloc[-1]])
    label = rf"$b$ = {found.b:.2f} $\pm$ {found.b_error:.2f}"
    above.loglog(line, found.n * (line / m_c) ** -found.b, color=VERMILION, lw=1, label=label)
    mark(above, m_c, "complete", vertical=True)
    legend(above, loc="lower left")
    above.set_xlabel(f"{size.replace('_', ' ')} ({unit})")
    above.set_ylabel("events at least so large")
    waits = np.sort(found.events["waiting"].dropna().to_numpy())
    scale, name = time_unit(waits.max(initial=0.0))
    share = 1 - np.arange(len(waits)) / max(len(waits), 1)
    below.plot(scale * waits, share, color=BLACK, lw=0.9, drawstyle="steps-pre")
    if len(waits):
        mark(below, scale * found.recurrence, "mean", vertical=True)
    below.set_xlabel(f"waiting time ({name})")
    below.set_ylabel("share that waits longer")
    below.set_ylim(0, 1.02)
    below.set_xlim(left=0)
    fig.tables = {"events": found.events, "counts": counts}
    fig.caption = (
        f"Number of events of at least a {size.replace('_', ' ')} (a) and waiting times between "
        f"complete ones (b). b = {found.b:.3f}, standard error {found.b_error:.3f}, from "
        f"{found.n} of {len(found.events)} finished events."
    )
    return fig
