"""Work-precision chart: error over cost of each method, and of planned runs.

The chart has one panel for each want. Four scenes run up to their fourth main event: the Fig. 1
scene, run 4, setup 2, and a random scene. Every method is run once on each scene, and its record is
compared event by event with that of a reference (`errors`). Planned runs of every want and
tolerance are compared in the same way. The cost of a planned run includes the plan and the runs by
which it measures its own error (`Record.errors`). Cost is processor time, divided by that of full
dynamics by velocity Verlet with switches at step ends. Scenes of different size thus share one
axis.

A method without a result for a want, or with other events than the reference, has a cost but no
error. Such methods are drawn above the axes.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from sizes import size, tiny

from pyfric.checks.chart import Method, after_events, run
from pyfric.engines import RunError
from pyfric.figures import DataFigure
from pyfric.planning import simulate
from pyfric.record import front_speed, paired
from pyfric.scene import Scene, preset, setup1
from pyfric.signals import at_once
from pyfric.statics import stability_limit
from pyfric.values import SceneError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pyfric.record import Record

__all__ = [
    "TOLERANCES",
    "WANTS",
    "chart",
    "drawn",
    "errors",
    "figure",
    "frontier",
    "full_dynamics",
    "points",
    "scenes",
]

EVENTS = size(4, 1)
"""Number of main events in a run."""
TOLERANCES = size((0.1, 0.03, 0.01, 0.003, 0.001), (0.1,))
WANTS = {
    "loading_curve": "loading curve: $F_\\mathrm{T}(t)$, RMS over $F_\\mathrm{N}$",
    "precursors": "precursors: start and arrest force over $F_\\mathrm{N}$, worst",
    "stress": "stresses after events, RMS over $F_\\mathrm{N}/N_x$",
    "front_speed": "front speeds, 95th percentile of relative differences",
}
"""Want -> meaning of its error."""
REFERENCE = size(1 / 16, 1 / 2)
"""Step of the reference, as a share of the stability limit."""
SCENE = {"L": 0.07, "H": 0.04, "l": 5e-3, "F_N": 1750.0, "V": 20e-3}
"""Fields of the only scene at tiny sizes."""
TRIES = size(2, 1)
"""Number of repeats of a method, of which the quickest counts. Full dynamics runs once."""


FULL = Method("dynamic", "finite", "step_end", 0.45, "verlet")
"""The method whose cost is the unit."""
METHODS = (
    Method("quasistatic"),
    *(Method("hybrid", "linear", "located", share) for share in (0.9, 0.5, 0.25)),
    *(Method("hybrid", "finite", "located", share) for share in (0.9, 0.5, 0.25, 0.125)),
    Method("hybrid", "linear", "step_end", 0.5),
    *(Method("hybrid", "finite", "step_end", share) for share in (0.5, 0.125)),
    FULL,
    Method("dynamic", "finite", "located", 0.5),
)
METHODS = size(METHODS, (METHODS[0], METHODS[2], METHODS[5], FULL))


def drawn(seed: int) -> Scene:
    """Return a scene of setup 1 drawn at random: length, height, load, friction, driver."""
    rng = np.random.default_rng(seed)
    mu_s = rng.uniform(0.4, 0.9)
    return setup1(
        L=2.5e-3 * rng.integers(32, 64),
        H=2.5e-3 * rng.integers(12, 30),
        h=2.5e-3 * rng.integers(1, 5),
        F_N=rng.uniform(1000, 4000),
        mu_s=mu_s,
        mu_k=mu_s * rng.uniform(0.4, 0.8),
        name="random",
    )


def scenes() -> dict[str, Scene]:
    """Return the scenes of the chart by name."""
    small = {"Fig. 1": preset("fig1", **SCENE)}
    return (
        small
        if tiny()
        else {
            "Fig. 1": preset("fig1"),
            "run 4": preset("run4"),
            "setup 2": preset("setup2"),
            "random": drawn(7),
        }
    )


@at_once()
def chart(*, progress: bool = False) -> pd.DataFrame:
    """Measure all points of the chart.

    Args:
        progress: print on stderr what is running.

    Returns:
        One row per point. Columns: scene; kind ("method", "plan", "reference"); want and
        tolerance of a plan, and ``said``, the error that the plan measured; engine, stepper,
        switching, geometry; share (of the stability limit), dt (s); seconds (processor time),
        evaluations (blocks times force evaluations), status ("ok", or why there is no answer); the
        errors of `WANTS`, NaN without an answer; events, the number compared; missing, the number
        of events in only one of the two runs.

    Raises:
        RunError: the reference left the range of numbers.
    """

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    rows = [row for name, scene in scenes().items() for row in points(name, scene, say)]
    return pd.DataFrame(rows)


# --- points --------------------------------------------------------------------------------------


def points(
    name: str,
    scene: Scene,
    say: Callable[[str], None] = lambda _: None,
    methods: tuple[Method, ...] = METHODS,
    events: int = EVENTS,
) -> Iterator[dict[str, Any]]:
    """Yield the points of one scene; see `chart`."""
    t_end = after_events(scene, events)
    say(f"{name}: reference, up to {t_end:.3g} s")
    truth, seconds = _run(scene, t_end, Method("hybrid", "finite", "located", REFERENCE))
    yield {"scene": name, "kind": "reference", **_row(truth, seconds, REFERENCE)}
    known: dict[Method, dict[str, Any]] = {}

    def measured(method: Method) -> dict[str, Any]:
        if method not in known:
            say(f"{name}: {', '.join(str(one) for one in method if one is not None)}")
            known[method] = _measured(scene, t_end, method, truth)
        return known[method]

    for method in methods:
        yield {"scene": name, "kind": "method", **measured(method)}
    for want in WANTS:
        for tolerance in TOLERANCES:
            say(f"{name}: what the planner takes for {want} within {tolerance:g}")
            yield {"scene": name, "kind": "plan", **_planned(scene, t_end, want, tolerance, truth)}


def _run(scene: Scene, t_end: float, method: Method) -> tuple[Record, float]:
    """Return the record and the processor time, s; steps are `share` of the limit of rk4."""
    dt = None if method.share is None else method.share * stability_limit(scene)[0]
    once = method.fidelity == "dynamic" or method.share == REFERENCE
    runs = [run(scene, t_end, method, dt) for _ in range(1 if once else TRIES)]
    return min(runs, key=lambda one: one[1])


def _measured(scene: Scene, t_end: float, method: Method, truth: Record) -> dict[str, Any]:
    """Return a row with the errors of a method, or the reason of its failure."""
    try:
        record, seconds = _run(scene, t_end, method)
    except (SceneError, RunError) as error:
        return {"engine": method.fidelity, "share": method.share, "status": str(error)}
    return _row(record, seconds, method.share) | errors(record, truth)


def _planned(
    scene: Scene, t_end: float, want: str, tolerance: float, truth: Record
) -> dict[str, Any]:
    """Return a row of a planned run, with the error that the run measured."""
    begin = time.process_time()
    how = {"want": want, "tolerance": tolerance}
    record = simulate(scene, t_end, progress=False, threads=1, **how)
    seconds, dt = time.process_time() - begin, record.method.dt
    share = None if dt is None else dt / stability_limit(scene)[0]
    asked = how | {"said": None if record.errors is None else record.errors.measured()}
    return asked | _row(record, seconds, share) | errors(record, truth)


def _row(record: Record, seconds: float, share: float | None) -> dict[str, Any]:
    method = record.method
    return {
        "engine": method.engine,
        "stepper": method.stepper,
        "switching": method.switching,
        "geometry": method.geometry,
        "share": share,
        "dt": method.dt,
        "seconds": seconds,
        "evaluations": record.counts.get("block_evaluations", 0),
        "status": "ok",
    }


def errors(record: Record, truth: Record) -> dict[str, Any]:
    """Return the errors of `WANTS`, and the numbers of compared and missing events.

    Main events from the trailing edge are paired. If one run has more events, the pairs with the
    smallest differences count.
    """
    rows = [_rows(one) for one in (record, truth)]
    i, j = paired(record.events.iloc[rows[0]], truth.events.iloc[rows[1]], truth.scene)
    a, b = rows[0][i], rows[1][j]
    found = {"events": len(i), "missing": abs(len(rows[0]) - len(rows[1]))}
    if not len(i):
        return found | {"status": "no event in common"}
    if found["missing"]:
        found["status"] = f"{found['missing']} of {len(rows[1])} events differ"
    F_N, unit = truth.scene.F_N, truth.scene.F_N / truth.scene.N_x
    forces = ("F_T_start", "F_T_arrest")
    force = [record.events[x].to_numpy()[a] - truth.events[x].to_numpy()[b] for x in forces]
    stress = [getattr(record, x)[a] - getattr(truth, x)[b] for x in ("tau_after", "p_after")]
    speed = np.abs(_speeds(record, a) / _speeds(truth, b) - 1)
    t = truth.curve["t"].to_numpy()
    apart = np.interp(t, record.curve["t"], record.curve["F_T"]) - truth.curve["F_T"].to_numpy()
    return found | {
        "loading_curve": float(np.sqrt(np.mean(apart**2))) / F_N,
        "precursors": float(np.abs(force).max()) / F_N,
        "stress": float(np.sqrt(np.mean(np.square(stress)))) / unit,
        "front_speed": _high(speed),
    }


def _high(off: np.ndarray) -> float:
    """Return the 95th percentile of the values other than NaN, or NaN if all are NaN."""
    known = off[np.isfinite(off)]
    return float(np.quantile(known, 0.95)) if len(known) else math.nan


def _rows(record: Record) -> np.ndarray:
    """Return the finished main events from the trailing edge."""
    events = record.events
    return np.flatnonzero(events["is_main"] & events["finished"] & (events["L_p_over_L"] > 0))


def _speeds(record: Record, rows: np.ndarray) -> np.ndarray:
    if record.method.dt is None:
        return np.full((len(rows), record.scene.N_x), np.nan)
    return front_speed(record.rupture_times[rows], record.scene.slider.l, record.scene.d)


# --- reading -------------------------------------------------------------------------------------


def frontier(part: pd.DataFrame, want: str) -> pd.DataFrame:
    """Return the points of a scene that none beats in both cost and error, sorted by cost."""
    part = part[np.isfinite(part[want]) & (part["status"] == "ok")].sort_values("seconds")
    least = part[want].cummin()
    return part[part[want] < least.shift(fill_value=math.inf)]


COLOURS = {"Fig. 1": "#0072B2", "run 4": "#D55E00", "setup 2": "#009E73", "random": "#CC79A7"}
GREY, RED = "0.6", "#C00000"
KINDS = {
    ("quasistatic", "linear"): ("^", "quasi-static sequence"),
    ("hybrid", "linear"): ("s", "hybrid, linear geometry"),
    ("hybrid", "finite"): ("o", "hybrid, finite geometry"),
    ("dynamic", "finite"): ("p", "full dynamics"),
}
"""Engine and geometry -> marker and name in the chart."""
NO_ANSWER = 2.0
"""Height at which points without an answer are drawn."""


def figure(table: pd.DataFrame) -> DataFigure:
    """Return the chart: error over cost, one panel for each want.

    Grey symbols are methods, by `KINDS`; lines are the frontier of each scene. Large symbols are
    planned runs. A bar reaches up to the tolerance of the plan, is red if the error is larger, and
    is thick up to the measured error. Diamonds are other programs (rows of the kind "peer").
    """
    fig = DataFigure(figsize=(7.2, 6.6), layout="constrained")
    FigureCanvasAgg(fig)
    table = _in_units(table)
    panels = fig.subplots(2, 2, sharex=True, sharey=True)
    for (want, label), axes, letter in zip(WANTS.items(), panels.flat, "abcd", strict=True):
        _panel(axes, table, want)
        axes.set_title(f"({letter}) {label}", fontsize=8, loc="left")
    for axes in panels[-1]:
        axes.set_xlabel("processor time over that of full dynamics", fontsize=8)
    for axes in panels[:, 0]:
        axes.set_ylabel("error", fontsize=8)
    fig.legend(
        handles=_handles(table), loc="outside lower center", ncols=4, fontsize=7, frameon=False
    )
    kept = table[table["kind"] == "plan"]
    kept = kept.assign(error=[row[row["want"]] for _, row in kept.iterrows()])
    broken = kept[~(kept["error"] <= kept["tolerance"])]
    said = kept["said"].notna().any()
    thick = ", its thick part at the error that the run measured itself, which the cost holds"
    fig.caption = (
        f"What accuracy costs, for four questions; scenes: {', '.join(table['scene'].unique())}, "
        "up to their fourth main event. "
        "Grey: methods, with several steps and both kinds of switching; lines: the cheapest for "
        "each error. Large: what the planner takes for tolerances "
        f"{', '.join(map(str, TOLERANCES))}; "
        f"a bar ends at the tolerance{thick if said else ''}. Crosses on top: no such quantity, or "
        f"other events than the reference. {len(kept) - len(broken)} of {len(kept)} plans meet "
        "their tolerance. Reference: the hybrid engine in finite geometry, located switches, steps "
        "of a sixteenth of the limit."
    )
    fig.tables = {"points": table}
    return fig


def full_dynamics(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of `FULL`, one for each scene."""
    rows = table[table["kind"] == "method"]
    for name, value in zip(FULL._fields, FULL, strict=True):
        rows = rows[rows["engine" if name == "fidelity" else name] == value]
    return rows


def _in_units(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with ``cost``, the time divided by that of `FULL` on the same scene."""
    unit = full_dynamics(table).groupby("scene")["seconds"].min()
    return table.assign(cost=table["seconds"] / table["scene"].map(unit))


def _panel(axes: Axes, table: pd.DataFrame, want: str) -> None:
    for tolerance in TOLERANCES:
        axes.axhline(tolerance, color="0.9", lw=0.6, zorder=0)
    every = table[table["kind"] == "method"]
    answered = np.isfinite(every[want]) & (every["status"] == "ok")
    for (engine, geometry), (marker, _) in KINDS.items():
        rows = every[answered & (every["engine"] == engine) & (every["geometry"] == geometry)]
        axes.loglog(rows["cost"], rows[want], marker, color=GREY, ms=3.5, mew=0, zorder=1)
    none = every[~answered & np.isfinite(every["cost"])]
    axes.loglog(none["cost"], np.full(len(none), NO_ANSWER), "x", color=GREY, ms=4, zorder=1)
    for scene, colour in COLOURS.items():
        rows = table[table["scene"] == scene]
        peer = rows[rows["kind"] == "peer"]
        axes.loglog(peer["cost"], peer[want], "D", mfc="none", color=colour, ms=4, zorder=2)
        best = frontier(rows[rows["kind"] == "method"], want)
        axes.plot(best["cost"], best[want], color=colour, lw=1, alpha=0.5, drawstyle="steps-post")
        _choices(axes, rows[(rows["kind"] == "plan") & (rows["want"] == want)], want, colour)
    axes.set_ylim(1e-8, 4)
    axes.tick_params(labelsize=7, direction="in", which="both")


def _choices(axes: Axes, rows: pd.DataFrame, want: str, colour: str) -> None:
    """Draw planned runs, each with a bar between its error and its tolerance."""
    for _, row in rows.iterrows():
        error, tolerance = row[want], row["tolerance"]
        kept = error <= tolerance
        look = {"color": colour if kept else RED, "lw": 0.8, "zorder": 3}
        axes.plot([row["cost"]] * 2, [error, tolerance], **look)
        axes.plot(
            [row["cost"]] * 2, [error, max(row["said"], 1e-9)], **look | {"lw": 2.5}, alpha=0.6
        )
        axes.plot(row["cost"], tolerance, "_", ms=6, **look)
        axes.plot(
            row["cost"],
            error,
            "o",
            ms=5.5,
            mec="white" if kept else RED,
            mew=0.6,
            color=colour,
            zorder=4,
        )


def _handles(table: pd.DataFrame) -> list[Line2D]:
    dot = {"ls": "", "ms": 4}
    handles = [
        Line2D([], [], color=colour, marker="o", ms=5.5, lw=1, label=scene)
        for scene, colour in COLOURS.items()
        if (table["scene"] == scene).any()
    ]
    handles += [
        *(
            Line2D([], [], marker=one, color=GREY, label=name, **dot)
            for one, name in KINDS.values()
        ),
        Line2D([], [], marker="x", color=GREY, label="no answer", **dot),
        Line2D([], [], color="0.3", marker="_", lw=0.8, label="planner: error to tolerance"),
        Line2D([], [], color="0.6", lw=2.5, label="to what the run measured itself"),
    ]
    handles += [
        Line2D([], [], marker="D", color="0.4", mfc="none", label=f"{engine}, bonds", **dot)
        for engine in table["engine"][table["kind"] == "peer"].unique()
    ]
    return handles
