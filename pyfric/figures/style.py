"""Common parts of all figures: registry, size, colours, panels, captions, and files."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pyfric.display import Shown
from pyfric.record import Record, check_record
from pyfric.scene import Scene, laws
from pyfric.values import PREFIXES, SceneError, figure_stem, prefix_power, usage, write_all

COLUMN_WIDTH = 3.4
"""Width of one journal column, inches."""
PNG_DPI = 300

SMALL, BODY = 7, 8  # font sizes, pt

BLACK, ORANGE, SKY, GREEN = "black", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#999999"
"""The Okabe-Ito set, which stays distinguishable under colour blindness, and grey."""

PAPER = "Phys. Rev. Lett. 107, 074301"

Draw = TypeVar("Draw", bound=Callable[..., Any])


class DataFigure(Figure):
    """A figure with its ``caption`` (text) and ``tables`` (name -> data frame behind it)."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"layout": "constrained"} | options)
        FigureCanvasAgg(self)
        self.caption: str = ""
        self.tables: dict[str, pd.DataFrame] = {}

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=150)
        return picture.getvalue()


class PaperFigure(NamedTuple):
    """A figure of the paper.

    Attributes:
        title: its title.
        runs: name of its runs, a key of `pyfric.paper.RUNS`.
        draw: function of a record, or of a list of records if there are several runs.
        precursor: number, from 1, of the main precursor of the first loading that the paper shows;
            None for figures of several events.
    """

    title: str
    runs: str
    draw: Callable[..., DataFigure]
    precursor: int | None = None


FIGURES: dict[str, PaperFigure] = {}
"""Name -> figure, in the order of the modules. `sorted` gives the order of the paper."""


def figure(title: str, *, runs: str, precursor: int | None = None) -> Callable[[Draw], Draw]:
    """Register the decorated function as a figure of the paper, under its own name."""

    def enter(draw: Draw) -> Draw:
        draw = usage()(draw)
        FIGURES[draw.__name__] = PaperFigure(title, runs, draw, precursor)
        return draw

    return enter


def panels(
    height: float, ratios: Sequence[float] = (1,), **rest: Any
) -> tuple[DataFigure, list[Axes]]:
    """Return a figure of this height (inches) and its panels, one below the other.

    With several panels, letters are above them at the left, outside the axes.
    """
    fig = DataFigure(figsize=(COLUMN_WIDTH, height))
    fig.get_layout_engine().set(h_pad=0.02, w_pad=0.02, hspace=0.02)
    axes = list(fig.subplots(len(ratios), 1, squeeze=False, height_ratios=ratios, **rest)[:, 0])
    for number, panel in enumerate(axes):
        style(panel, "abcdef"[number] if len(axes) > 1 else "")
    return fig, axes


def style(axes: Axes, letter: str = "") -> None:
    """Set the ticks, frame and sizes of labels of a panel, and write its letter."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set_size(BODY)
    axes.tick_params(which="both", direction="in", top=True, right=True, labelsize=SMALL)
    axes.tick_params(width=0.6, length=3)
    axes.tick_params(which="minor", width=0.4, length=1.5)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
    if letter:
        axes.set_title(f"({letter})", loc="left", fontsize=BODY, fontweight="bold", pad=2)


def legend(axes: Axes, **options: Any) -> None:
    """Draw a compact legend without a frame."""
    standard = {
        "fontsize": SMALL,
        "title_fontsize": SMALL,
        "alignment": "left",
        "handlelength": 1.4,
        "handletextpad": 0.5,
        "labelspacing": 0.3,
        "columnspacing": 1.0,
        "borderaxespad": 0.3,
        "frameon": False,
    }
    axes.legend(**standard | options)


def mark(axes: Axes, value: float, text: str, *, vertical: bool = False, **where: Any) -> None:
    """Draw a dashed line at a value, with its name."""
    draw = axes.axvline if vertical else axes.axhline
    draw(value, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
    at, away = where.get("at", 0.02), where.get("away", (2, 2))
    axes.annotate(
        text,
        (value, at) if vertical else (at, value),
        xycoords=("data", "axes fraction") if vertical else ("axes fraction", "data"),
        xytext=away,
        textcoords="offset points",
        ha=where.get("ha", "left"),
        va=where.get("va", "bottom"),
        fontsize=SMALL,
        color="0.35",
    )


def colour_bar(
    fig: DataFigure, image: Any, axes: Any, text: str, extend: str = "both", **where: Any
) -> None:
    """Draw a bar of the colours of an image, beside the axes."""
    bar = fig.colorbar(image, ax=axes, extend=extend, pad=0.01, aspect=30, **where)
    bar.ax.tick_params(which="both", labelsize=SMALL)
    bar.ax.tick_params(width=0.6, length=2)
    bar.outline.set_linewidth(0.6)
    bar.set_label(text, fontsize=SMALL)


@usage('save_figure(record.plot(), "name")')
def save_figure(fig: DataFigure | Shown, path_stem: str | os.PathLike[str]) -> list[Path]:
    """Write the figure as PNG (300 dpi) and PDF, its caption as text and its data as CSV.

    ``fig`` may also be an object with a picture, such as a record. ``path_stem`` is a path, with or
    without the suffix .png or .pdf. The files are stem.png, stem.pdf, stem.txt and
    stem_<table>.csv. Returns the paths.

    Raises:
        OSError: a file cannot be written, such as into a missing folder.
        SceneError: the suffix belongs to another format.
    """
    from matplotlib.backends.backend_pdf import FigureCanvasPdf  # slow to import

    fig = fig.plot() if isinstance(fig, Shown) else fig
    stem = figure_stem(path_stem)
    png, pdf = io.BytesIO(), io.BytesIO()
    dpi, layout = fig.dpi, fig.get_layout_engine()
    fig.set_dpi(PNG_DPI)
    # savefig would draw everything twice for the layout
    FigureCanvasAgg(fig).print_png(png, metadata={"Description": fig.caption})
    fig.set_layout_engine("none")  # the layout is final
    about = {"Subject": fig.caption, "CreationDate": None}
    FigureCanvasPdf(fig).print_pdf(pdf, metadata=about)
    FigureCanvasAgg(fig)
    fig.set_dpi(dpi)
    fig.set_layout_engine(layout)
    contents = {".png": png.getvalue(), ".pdf": pdf.getvalue(), ".txt": f"{fig.caption}\n".encode()}
    for name, table in fig.tables.items():
        contents[f"_{name}.csv"] = table.to_csv(index=False).encode()
    return write_all({stem.with_name(stem.name + end): what for end, what in contents.items()})


def time_unit(span: float) -> tuple[float, str]:
    """Return the number of units in a second, and the unit, that suit times of a span (s)."""
    for unit, scale in ((r"$\mu$s", 1e6), ("ms", 1e3)):
        if span * scale < 1e3:
            return scale, unit
    return 1.0, "s"


# --- captions ------------------------------------------------------------------------------------


def listed(records: Iterable[Record]) -> list[Record]:
    """Return records as a list.

    Raises:
        SceneError: there is no record, or a single record is not in a list.
    """
    if not isinstance(records, Iterable):
        raise SceneError("records", type(records).__name__, "", "a list of records", "not a list")
    if not (found := list(records)):
        raise SceneError("records", found, "", "one or more records", "none is given")
    return found


def single(record: Record) -> None:
    """Raise SceneError if the argument is not a single record."""
    check_record(record)


def caption(records: Record | Sequence[Record], *texts: str) -> str:
    """Join texts, and add a line on the scenes and a line on the methods of the records.

    The line on methods also names the version, and runs that are not complete.
    """
    several = [*records] if isinstance(records, Sequence) else [records]
    hows = "; ".join(dict.fromkeys(str(record.method) for record in several))
    gaps = joined(
        f"{gap * 1e3:g} ms" for gap in sorted({record.method.t_gap for record in several})
    )
    made = [f"Method: {hows}; events joined over pauses up to {gaps}."]
    for status in dict.fromkeys(record.status for record in several if record.status != "complete"):
        made.append(f"Run {status}.")
    known = {record.versions["pyfric"] for record in several if "pyfric" in record.versions}
    if known:
        made.append(f"pyfric {joined(sorted(known))}.")
    return "\n".join(
        [" ".join(texts), scene_text([record.scene for record in several]), " ".join(made)]
    )


def scene_text(scenes: Sequence[Scene]) -> str:
    """Return parameters of scenes of one kind of load as text, with lists of different values."""
    first = scenes[0]

    def of(get: Any, unit: str = "", power: int = 0) -> str:
        return in_unit(sorted({get(scene) for scene in scenes}), unit, power)

    if first.rigid:
        load = "rigid rod on top"
    elif first.prescribed:
        load = "prescribed interface"
    elif first.N_z == 1:
        load = f"chain under prescribed loads, k_top = {of(lambda s: s.k_top, 'N/m', 2)}"
    else:
        load = f"distributed load, theta = {of(lambda s: s.top.theta)}"
    blocks = sorted({(scene.N_x, scene.N_z) for scene in scenes})
    head = "Scenes" if len(scenes) > 1 else f"Scene {first.name}".strip()
    pairs = sorted({(scene.law.mean.mu_s, scene.law.mean.mu_k) for scene in scenes})
    if len(pairs) == 1:
        friction = "mu_s = {:g}, mu_k = {:g}".format(*pairs[0])
    else:
        friction = "mu_s/mu_k = " + ", ".join(f"{s:g}/{k:g}" for s, k in pairs)
    if any(scene.interface.d_c for scene in scenes):
        friction += f", d_c = {of(lambda s: s.law.static.mean.d_c, 'm', -2)}"
    if any(scene.law.mean.alpha for scene in scenes):
        friction += f", alpha = {of(lambda s: s.law.mean.alpha, 'N s/m')}"
    used = [scene.interface.law for scene in scenes]
    kinds = {law.kind if law.ends() is None else str(law) for law in used}
    kinds = sorted(kinds - {laws.LinearWeakening.kind})
    friction += f", friction law {' and '.join(kinds)}" if kinds else ""
    varied = sorted({name for scene in scenes for name in scene.varied})
    friction += f" (means; {', '.join(varied)} vary along the interface)" if varied else ""
    plates, on = "", first.driver.side
    if on.startswith("pull "):
        on = f"{on.removeprefix('pull ')}, pulled"
    if any(scene.n_driven > 1 and scene.driver.side != "top" for scene in scenes):
        plates = f"h_top = {of(lambda s: s.j_h_top * s.slider.l, 'm', -1)}, "
    return (
        f"{head}: {load}, L = {of(lambda s: s.slider.L, 'm', -1)}, "
        f"H = {of(lambda s: s.slider.H, 'm', -1)}, l = {of(lambda s: s.slider.l, 'm', -1)} "
        f"({', '.join(f'{x} x {z}' for x, z in blocks)} blocks), "
        f"F_N = {of(lambda s: s.F_N, 'N')}, driver K = {of(lambda s: s.driver.K, 'N/m', 2)}, "
        f"V = {of(lambda s: s.driver.V, 'm/s', -1)}, "
        f"h = {of(lambda s: s.driver.h, 'm', -1)}, {plates}on the {on}; "
        f"k = {of(lambda s: s.slider.k, 'N/m', 2)}, {friction}."
    )


def in_unit(
    values: Sequence[float], unit: str, power: int = 0, digits: int = 6, joint: str = ", "
) -> str:
    """Return numbers in SI as text in one unit.

    The unit has the prefix of this power of 1000, or another prefix if the largest number would
    need an exponent.
    """
    largest = max(values, key=abs)
    if unit and "e" in f"{largest / 1000.0**power:.4g}":
        power = prefix_power(largest)
    texts = joint.join(f"{value / 1000.0**power:.{digits}g}" for value in values)
    return f"{texts} {PREFIXES[power]}{unit}".strip()


def joined(texts: Iterable[str]) -> str:
    """Return texts as a list in a sentence: a, b and c."""
    *others, last = texts
    return f"{', '.join(others)} and {last}" if others else last
