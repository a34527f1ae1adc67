"""Phase diagrams: speeds as colours, labels as symbols, lines between them, and theory."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from pyfric.figures.style import (
    BLACK,
    COLUMN_WIDTH,
    GREY,
    PURPLE,
    SKY,
    VERMILION,
    DataFigure,
    colour_bar,
    legend,
    panels,
)
from pyfric.sweeps import PhaseDiagram, even_scale
from pyfric.theory import LARGEST_VISCOSITY, chain_prestress
from pyfric.values import unknown

SYMBOLS = ("x", "o", "s", "^", "D", "v", "*", "+")
"""Symbols of labels, in alphabetical order."""
COLOURS = (GREY, BLACK, SKY, PURPLE)
"""Colours of labels; each colour is used with all symbols before the next colour."""
THEORY = ((1.0, "-", "v = c"), (0.1, "--", "v = 0.1 c"))
"""Speeds over c of steady fronts that are drawn as lines; style and label of each line."""


def phase_map(diagram: PhaseDiagram, label: str | None = None) -> DataFigure:
    """Draw a phase diagram.

    Args:
        diagram: a result of `pyfric.phase_diagram`.
        label: label of the diagram that symbols show; None means the first label.

    Colours are speeds of fronts over c = l sqrt(k/m). For a chain over alpha and tau_bar, lines
    show steady fronts of speeds c and 0.1 c, by `pyfric.theory.chain_prestress` (alpha <= 10).
    White means that no front reached the end.

    Returns:
        The figure. Its tables are "table" and "lines" of the diagram.

    Raises:
        SceneError: the diagram has no such label.
    """
    x, y, table = diagram.x, diagram.y, diagram.table
    own = [x, y, "speed", "speed_over_c", "reached", "status"]
    labels = [name for name in table if name not in own]
    label = label or labels[0]
    if label not in labels:
        raise unknown("label", label, str(label), labels)
    fig, (axes,) = panels(0.85 * COLUMN_WIDTH)
    _speeds(axes, diagram)
    looks = itertools.cycle(itertools.product(COLOURS, SYMBOLS))
    for (colour, symbol), (value, rows) in zip(looks, table.groupby(label), strict=False):
        axes.plot(rows[x], rows[y], symbol, ms=2, color=colour, mfc="none", mew=0.5, label=value)
    for _, line in diagram.lines.sort_values(x).groupby(["label", "below", "above"]):
        axes.plot(line[x], line[y], "-" if len(line) > 1 else "_", color=BLACK, lw=1)
    highest = min(table[x].max(), LARGEST_VISCOSITY)
    theory = (x, y) == ("alpha", "tau_bar") and table[x].min() <= highest
    if theory:
        alpha = np.geomspace(table[x].min(), highest, 60)
        for v, look, text in THEORY:
            line = [chain_prestress(v, viscosity) for viscosity in alpha]
            axes.plot(alpha, line, look, color=VERMILION, lw=0.8, label=text)
    for name, set_scale in ((x, axes.set_xscale), (y, axes.set_yscale)):
        set_scale(even_scale(np.unique(table[name])))
    axes.set_ylim(*_edges(np.unique(table[y]))[[0, -1]])
    texts = [
        f"{name} ({unit})" if unit else NAMES.get(name, name)
        for name, unit in zip((x, y), diagram.units, strict=True)
    ]
    axes.set(xlabel=texts[0], ylabel=texts[1])
    legend(axes, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    fig.tables = {"table": table, "lines": diagram.lines}
    fig.caption = (
        f"Phase diagram over {x} and {y}: {len(table)} runs. Colours: speed of the front over c; "
        f"white where no front reached the end. Symbols: {label}."
    )
    if len(diagram.lines):
        fig.caption += " Black lines: where labels change."
    if theory:
        fig.caption += " Lines of constant v: steady fronts of the chain, by theory."
    return fig


NAMES = {"alpha": r"$\alpha/\sqrt{km}$", "tau_bar": r"$\bar\tau$"}
"""Name of a number of the chain -> its symbol."""


def _speeds(axes: Axes, diagram: PhaseDiagram) -> None:
    """Draw speeds of fronts as colours."""
    wide = diagram.table.pivot(index=diagram.y, columns=diagram.x, values="speed_over_c")
    speeds = np.ma.masked_invalid(wide.to_numpy())
    if not speeds.count():
        return
    edges = [_edges(values.to_numpy()) for values in (wide.columns, wide.index)]
    norm = LogNorm(*np.clip([speeds.min(), speeds.max()], 1e-3, 10.0))
    mesh = axes.pcolormesh(*edges, speeds, norm=norm, cmap="viridis", rasterized=True)
    colour_bar(axes.figure, mesh, axes, "$v/c$")


def _edges(values: np.ndarray) -> np.ndarray:
    """Return the edges of cells about values, (n + 1,)."""
    if even_scale(values) == "log":
        return np.exp(_edges(np.log(values)))
    middle = (values[1:] + values[:-1]) / 2
    return np.array([2 * values[0] - middle[0], *middle, 2 * values[-1] - middle[-1]])
