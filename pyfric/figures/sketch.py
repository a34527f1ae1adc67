"""Sketches of scenes, like Fig. 1(a): the lattice and its loads, drawn to scale.

Lengths in the drawing are in hundredths of L.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle

from pyfric.figures.style import (
    BLACK,
    BLUE,
    COLUMN_WIDTH,
    GREEN,
    GREY,
    ORANGE,
    PAPER,
    SMALL,
    VERMILION,
    DataFigure,
    in_unit,
    panels,
    scene_text,
)
from pyfric.scene import Scene, SceneLike, as_scene
from pyfric.values import annotations, prefix_power

MOST_COLUMNS = 32
"""Largest number of columns of blocks that are drawn."""
MOST_SPRINGS = 6
"""Largest number of springs that are drawn for a plate."""
FIELD_ROOM = 11
"""Height of the drawing of a field below the interface, in hundredths of L: two lines of text."""
FIELDS = {
    "mu_s": (r"$\mu_\mathrm{s}$", "", 0),
    "mu_k": (r"$\mu_\mathrm{k}$", "", 0),
    "d_c": (r"$d_\mathrm{c}$", "m", -2),
    "alpha": (r"$\alpha$", "N s/m", 0),
    "k_f": (r"$k_\mathrm{f}$", "N/m", 2),
    "gap": ("gap", "m", -2),
    "slip": ("slip before", "m", -2),
    "limit_from": ("limit from", "s", -1),
}
"""Name of a field -> its symbol, unit, and power of 1000 of the usual prefix."""
LINE = 0.8  # of springs and outlines, pt


def sketch(scene: SceneLike) -> DataFigure:
    """Draw a scene to scale: lattice, foundation, load on the top and driver, with their numbers.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.

    Large lattices are thinned, as the caption says. Lengths of the load's arrows are proportional
    to the forces.

    Fields of the interface that vary are drawn below it, from their least to their largest value.

    Returns:
        The figure. Its table "columns" has a row for each column of blocks: n, x_mm from the
        trailing edge, load_N and shear_N, and the fields that vary, in SI units.
    """
    scene = as_scene(scene)
    slider, d = scene.slider, scene.ahead
    l, H = 100 * slider.l / slider.L, 100 * slider.H / slider.L
    above = 28 if scene.top.kind == "prescribed" else 23
    below = 19 + FIELD_ROOM * len(scene.varied)
    fig, (axes,) = panels(COLUMN_WIDTH * (above + H + below) / 152)
    fig.set_layout_engine("none")
    axes.set_position((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim((-42, 110) if d > 0 else (-10, 142))
    axes.set_ylim(-below, H + above)
    axes.set_aspect("equal")

    q = _thinning(scene)
    x = _kept(scene.N_x, q) * l
    z = np.union1d(_kept(scene.N_z, q), [scene.j_h, scene.j_h_top]) * l
    _lattice(axes, x, z, scene.N_z == 1)
    _foundation(axes, x, scene)
    if scene.rigid:
        _rod(axes, H, scene)
    else:
        _load(axes, l, H, scene)
    if scene.driver.K:
        _driver(axes, z, l, scene)
    _fields(axes, l, scene)
    _length(axes, (0, -13), (100, -13), f"$L$ = {_shown(slider.L, 'm', -1)}", 3)
    if scene.N_z > 1:
        far = 104 if d > 0 else -4
        _length(axes, (far, 0), (far, H), f"$H$ = {_shown(slider.H, 'm', -1)}", 3 * d)

    n, x_mm = scene.n_of_i, (scene.n_of_i - 1) * slider.l * 1e3
    columns = {"n": n, "x_mm": x_mm, "load_N": _forces(scene), "shear_N": scene.shear}
    fields = {name: scene.field(name) for name in scene.varied}
    fig.tables = {"columns": pd.DataFrame(columns | fields)}
    driven = "the driven row" if scene.n_driven == 1 else "the rows at the plate's edges"
    thin = f" One block of {q} in each direction and {driven} are drawn."
    what = f"Sketch of the scene, to scale, after Fig. 1(a) of {PAPER}."
    fig.caption = f"{what}{thin if q > 1 else ''}\n{scene_text([scene])}"
    return fig


def _thinning(scene: Scene) -> int:
    """Return n if every n-th block is drawn; if possible, steps are equal from edge to edge."""
    least = -(-scene.N_x // MOST_COLUMNS)
    common = np.gcd.reduce([scene.N_x - 1, scene.N_z - 1, scene.j_h, scene.j_h_top])
    whole = [q for q in range(least, 3 * least + 1) if common % q == 0]
    return whole[0] if whole else least


def _kept(count: int, q: int) -> np.ndarray:
    return np.unique(np.append(np.arange(0, count, q), count - 1))


def _lattice(axes: Axes, x: np.ndarray, z: np.ndarray, chain: bool) -> None:
    if chain:
        for left, right in pairwise(x):
            axes.plot(*_zigzag((left, 0), (right, 0), 0.8, 3), color=BLUE, lw=0.5)
    else:
        X, Z = np.meshgrid(x, z)
        ends = [
            (X[:, :-1], Z[:, :-1], X[:, 1:], Z[:, 1:]),
            (X[:-1], Z[:-1], X[1:], Z[1:]),
            (X[:-1, :-1], Z[:-1, :-1], X[1:, 1:], Z[1:, 1:]),
            (X[:-1, 1:], Z[:-1, 1:], X[1:, :-1], Z[1:, :-1]),
        ]
        lines = np.concatenate([np.stack(pair, axis=-1).reshape(-1, 2, 2) for pair in ends])
        axes.add_collection(LineCollection(list(lines), colors=BLUE, linewidths=0.25, alpha=0.8))
    X, Z = np.meshgrid(x, z)
    size = 2.2 if chain else 0.9
    axes.plot(X.ravel(), Z.ravel(), ls="", marker="s", ms=size, color=BLACK, zorder=3)


def _forces(scene: Scene) -> np.ndarray:
    """Return the downward forces on the blocks of the top or of a prescribed interface, N."""
    return scene.p_prescribed if scene.prescribed else scene.load


def _foundation(axes: Axes, x: np.ndarray, scene: Scene) -> None:
    """Draw the springs of the foundation, and the values of uniform fields.

    A prescribed interface is drawn on the wall.
    """
    depth = 1 if scene.prescribed else 5
    if not scene.prescribed:
        springs = [_zigzag((at, -0.3), (at, -depth), 0.7, 3).T for at in x]
        axes.add_collection(LineCollection(springs, colors=GREEN, linewidths=0.5))
    _wall(axes, -2, 102, -depth, -1)
    friction = scene.law.static.mean
    means = {"mu_s": friction.mu_s, "mu_k": friction.mu_k}
    if scene.N_z > 1 and not scene.prescribed:
        means = {"k_f": np.mean(scene.k_f)} | means
    if scene.interface.d_c:
        means["d_c"] = friction.d_c
    told = [
        f"{FIELDS[name][0]} = {_shown(value, *FIELDS[name][1:], digits=3)}"
        for name, value in means.items()
        if name not in scene.varied
    ]
    _text(axes, (50, -9.5), ", ".join(told), GREEN)


def _fields(axes: Axes, l: float, scene: Scene) -> None:
    """Draw the fields that vary along the interface, each from its least to its largest value."""
    for n, name in enumerate(scene.varied):
        values = scene.field(name)
        values = np.where(np.isfinite(values), values, np.nan)  # inf (no limit) is not drawn
        low, high = np.nanmin(values), np.nanmax(values)
        bottom, high_at = -(19 + FIELD_ROOM * (n + 1) - 3), 5
        height = bottom + high_at * (values - low) / max(high - low, np.finfo(float).tiny)
        axes.step(np.arange(scene.N_x) * l, height, where="mid", color=GREEN, lw=LINE)
        if name in FIELDS:
            text, of, power = FIELDS[name]
        else:  # a field of the friction law
            text, of = name, annotations(type(scene.interface.law))[name].unit
            power = prefix_power(high)
        text += f"\n{_shown((low, high), of, power, digits=3, joint='$-$')}"
        place, side = (-3, "right") if scene.d > 0 else (103, "left")
        _text(axes, (place, bottom + high_at / 2), text, GREEN, ha=side)


def _rod(axes: Axes, H: float, scene: Scene) -> None:
    """Draw the rod, the mattress that resists its tilt, and F_N at its centre."""
    thick, above = 2, 10
    axes.add_patch(Rectangle((0, H), 100, thick, fc=GREY, ec=BLACK, lw=LINE, zorder=4))
    if scene.top.mattress:
        low = H + thick
        places = [at for at in np.linspace(0, 100, 14) if abs(at - 50) > 8]
        springs = [_zigzag((at, low), (at, H + above), 0.9, 4).T for at in places]
        axes.add_collection(LineCollection(springs, colors=ORANGE, linewidths=0.6))
        for begin, end in ((-2, 43), (57, 102)):
            _wall(axes, begin, end, H + above, 1)
        text = f"mattress {_shown(scene.top.mattress, 'N/m', 2)}"
        _text(axes, (0, H + 14), text, ORANGE, ha="left")
    _arrow(axes, (50, H + above + 5.5), (50, H + thick), VERMILION, 1.6)
    _text(axes, (50, H + 18.5), rf"$F_\mathrm{{N}}$ = {_shown(scene.F_N, 'N')}", VERMILION)
    _text(axes, (100, H + 14), f"rod {_shown(scene.M_rod * 1e3, 'g')}", "0.3", ha="right")


def _load(axes: Axes, l: float, H: float, scene: Scene) -> None:
    """Draw normal and shear forces on the blocks, and for a chain the springs to a rigid top."""
    at = np.linspace(0, scene.N_x - 1, min(scene.N_x, 21)).round().astype(int)
    load, shear, row = _forces(scene), scene.shear[at], scene.j_shear * l
    largest, gap = np.max(load), 0.8
    for where, force in zip(at * l, load[at], strict=True):
        _arrow(axes, (where, row + gap + 10 * force / largest), (where, row + gap), VERMILION, 0.7)
    if np.any(shear):
        for where, force in zip(at * l, shear, strict=True):
            tip = where + 4 * force / np.max(np.abs(shear))
            _arrow(axes, (where, row + 0.6), (tip, row + 0.6), ORANGE, 0.7)
    if scene.top.kind == "distributed":
        text = rf"$F_\mathrm{{N}}$ = {_shown(scene.F_N, 'N')}, $\theta = {scene.top.theta:g}$"
    else:
        span = _shown(np.unique([np.min(load), largest]), "N", digits=3, joint=" to ")
        text = f"$p_i$ = {span} on each block"
        more = []
        if np.any(shear):
            more.append(rf"$\tau_i$ up to {_shown(np.max(np.abs(shear)), 'N', digits=3)}")
        if scene.k_top:
            stiff = _shown(scene.k_top, "N/m", 2, digits=3)
            more.append(rf"$k_\mathrm{{top}}$ = {stiff} to a rigid top")
        text = "\n".join([text, ", ".join(more)]).strip()
    _text(axes, (50, H + 15.5), text, VERMILION, va="bottom")


def _driver(axes: Axes, z: np.ndarray, l: float, scene: Scene) -> None:
    """Draw the spring at height h or the springs of a plate, the moving end, and their values."""
    d, driver, ends = scene.ahead, scene.driver, np.array([scene.j_h, scene.j_h_top])
    if driver.side == "top":
        _driven_top(axes, z[-1], l, scene)
        return
    rows = z[(z >= ends[0] * l) & (z <= ends[1] * l)]
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_SPRINGS)).round().astype(int)]
    wall = 0.0 if d > 0 else 100.0
    far = wall - d * 13
    for at in rows:
        axes.plot(*_zigzag((far, at), (wall, at), 1.6, 6), color=BLACK, lw=LINE, zorder=5)
    high = rows[-1] - rows[0] + 6
    axes.add_patch(Rectangle((far - 0.6, rows[0] - 3), 1.2, high, fc=BLACK, zorder=5))
    middle = (rows[0] + rows[-1]) / 2
    course = [(far - d * 9, middle), (far - d * 1.2, middle)]
    _arrow(axes, *(course if d == scene.d else course[::-1]), BLACK, 1.2)
    left, side = far - d * 28, "left" if d > 0 else "right"
    K, V = _shown(driver.K, "N/m", 2), _shown(driver.V, "m/s", -1, digits=4)
    _text(axes, (left, rows[-1] + 10), f"$K$ = {K}", BLACK, ha=side)
    _text(axes, (left, rows[-1] + 5), f"$V$ = {V}", BLACK, ha=side)
    if driver.h:
        height = _shown(np.unique(ends * scene.slider.l), "m", -1, joint="$-$")
        _text(axes, (left, rows[0] - 6), f"$h$ = {height}", BLACK, ha=side)


def _driven_top(axes: Axes, H: float, l: float, scene: Scene) -> None:
    """Draw springs from the blocks of the top to a moving plate, and their values."""
    x = np.linspace(0, scene.N_x - 1, min(scene.N_x, MOST_SPRINGS)).round() * l
    for at in x:
        axes.plot(*_zigzag((at, H), (at + 4, H + 4), 1.0, 4), color=BLACK, lw=LINE, zorder=5)
    axes.add_patch(Rectangle((x[0] + 2, H + 4), x[-1] - x[0] + 4, 0.8, fc=BLACK, zorder=5))
    _arrow(axes, (-14, H + 4.4), (0, H + 4.4), BLACK, 1.2)
    K, V = _shown(scene.driver.K, "N/m", 2), _shown(scene.driver.V, "m/s", -1, digits=4)
    _text(axes, (-41, H + 14), f"$K$ = {K}", BLACK, ha="left")
    _text(axes, (-41, H + 9), f"$V$ = {V}", BLACK, ha="left")


def _length(
    axes: Axes, start: Sequence[float], stop: Sequence[float], text: str, away: float
) -> None:
    """Draw a length between two arrow heads, with its text beside or below it."""
    look = {"arrowstyle": "<->", "lw": 0.6, "color": "0.3", "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", stop, start, arrowprops=look)
    x, z = (start[0] + stop[0]) / 2, (start[1] + stop[1]) / 2
    upright = start[0] == stop[0]
    at = (x + away, z) if upright else (x, z - 3.2)
    _text(axes, at, text, "0.3", rotation=90 if upright else 0)


def _wall(axes: Axes, start: float, stop: float, z: float, out: int) -> None:
    """Draw a fixed horizontal wall, hatched above (out = 1) or below (out = -1)."""
    axes.plot((start, stop), (z, z), color=BLACK, lw=LINE)
    lines = [[(a, z), (a - 1.5, z + 1.5 * out)] for a in np.arange(start, stop + 1e-9, 2.5)]
    axes.add_collection(LineCollection(lines, colors=BLACK, linewidths=0.3))


def _arrow(
    axes: Axes, tail: Sequence[float], tip: Sequence[float], colour: str, width: float
) -> None:
    look = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
    look["mutation_scale"] = 4 + 3 * width
    axes.annotate("", tip, tail, arrowprops=look, zorder=6)


def _text(axes: Axes, at: Sequence[float], text: str, colour: str, **where: str | float) -> None:
    standard = {"ha": "center", "va": "center", "fontsize": SMALL, "color": colour, "zorder": 7}
    axes.text(*at, text, **standard | where)


def _shown(values: float | Sequence[float], unit: str, power: int = 0, **how: Any) -> str:
    """Return numbers in SI as text in one unit; see `in_unit`."""
    text = in_unit(np.atleast_1d(values), unit, power, **how)
    return text.replace(" u", r" $\mu$").replace("^2", "$^2$")


def _zigzag(start: Sequence[float], stop: Sequence[float], width: float, turns: int) -> np.ndarray:
    """Return a spring from start to stop, shape (2, points): straight ends, zigzag between."""
    start, stop = np.asarray(start, float), np.asarray(stop, float)
    along = stop - start
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    s = np.concatenate([[0, 0.12], np.linspace(0.12, 0.88, 4 * turns + 1)[1:-1:2], [0.88, 1]])
    side = np.zeros(s.size)
    side[2:-2] = np.resize([1, -1], s.size - 4)
    return (start[:, None] + along[:, None] * s) + width / 2 * across[:, None] * side
