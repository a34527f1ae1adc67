"""Convergence of methods on one event, for the study `accuracy`.

The event is the 11th main precursor of the Fig. 1 scene, from 20 us before its first slip until
0.3 ms after. Questions are rupture times (s, RMS over the front, from the first slip on), front
speed (RMS of relative differences), interface stresses at arrest (norm of the difference over the
norm), start and arrest forces (over F_N), farthest block, and closure of the energy budget (over
the friction heat). All methods start from one state per geometry. The reference is RK4 with located
switching in finite geometry, with steps halved until it no longer changes. Two more panels compare
with other programs (`beside`).

Work is given as the time in the core, the least of repeats, and as the number of blocks times force
evaluations. A method that fails or is refused at a point stays in the table, with the reason.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from accuracy import SCENE
from beside import slider_points, wave_points
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric.engines import RunError
from pyfric.figures import DataFigure
from pyfric.planning import simulate
from pyfric.record import budget_left, front_speed
from pyfric.scene import preset
from pyfric.signals import at_once
from pyfric.statics import stability_limit
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.core import State
    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene

__all__ = ["QUESTIONS", "event_points", "figure", "orders", "table"]

EVENT, BEFORE, AFTER = size(11, 1), 20e-6, 300e-6
"""The main precursor, counted from 0, and the times before and after its first slip, s."""
SHARES = size((2.0, 0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125), (2.0, 0.9))
"""Steps, as shares of the stability limit; the first step must be refused."""
REFERENCE_SHARES = size((0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625), (0.9, 0.5))
RTOLS = size((1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8), (1e-3,))
REPEATS = size(3, 1)

QUESTIONS = {
    "rupture": "rupture times (s)",
    "speed": "front speed (relative)",
    "stress": "stress at arrest (relative)",
    "arrest": "arrest force ($F_\\mathrm{N}$)",
    "energy": "energy closure (relative)",
}
"""Error columns of the event -> their meanings."""


LINE = ("stepper", "switching", "geometry")
"""Columns that define a line of the chart of the event."""


class Method(NamedTuple):
    """One method of integration: a line of the chart."""

    stepper: str
    switching: str
    geometry: Geometry
    shares: tuple[float, ...] = SHARES
    rtols: tuple[float | None, ...] = (None,)


METHODS = (
    Method("rk46", "located", "finite"),
    Method("rk4", "step_end", "finite"),
    Method("rk4", "located", "finite"),
    Method("verlet", "step_end", "finite"),
    Method("verlet", "located", "finite"),
    Method("symplectic_euler", "step_end", "finite"),
    Method("symplectic_euler", "located", "finite"),
    Method("adaptive", "located", "finite", (2.0,), RTOLS),
    Method("rk4", "step_end", "linear"),
    Method("rk4", "located", "linear"),
    Method("rk46", "located", "linear"),
)


@at_once()
def table(*, progress: bool = False) -> pd.DataFrame:
    """Measure all points.

    Args:
        progress: print on stderr what is running.

    Returns:
        One row per point. Columns: scene, engine, stepper, switching, geometry, dt (s), share (dt
        as a share of the stability limit of RK4), rtol, seconds, evaluations, status ("ok", or why
        it failed), the errors of `QUESTIONS`, start, blocks, missing (blocks with a rupture time in
        only one of the two runs), and the same errors against the reference of the same geometry,
        with "own_" before their names. NaN where a question does not apply.
    """

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    parts = (event_points, wave_points, slider_points)
    return pd.concat([pd.DataFrame(part(say)) for part in parts], ignore_index=True)


# --- one event -----------------------------------------------------------------------------------


class _Start(NamedTuple):
    """A state just before the event, and the reference runs from this state."""

    state: State
    t_end: float
    reference: Record


def event_points(
    say: Callable[[str], None] = lambda _: None,
    scene: Scene | None = None,
    event: int = EVENT,
    methods: tuple[Method, ...] = METHODS,
    reference_shares: tuple[float, ...] = REFERENCE_SHARES,
    repeats: int = REPEATS,
) -> Iterator[dict[str, Any]]:
    """Yield the points of one event; see `table`.

    Args:
        say: called with the name of each run.
        scene: None means the Fig. 1 scene.
        event: number of the main event, from 1.
        methods: lines of the chart.
        reference_shares: steps of the reference, as shares of the limit; the last counts.
        repeats: timed runs of each point.
    """
    scene = preset("fig1", **size({}, SCENE)) if scene is None else scene
    limit = stability_limit(scene)[0]
    starts: dict[str, _Start] = {}
    for geometry in ("finite", *({one.geometry for one in methods} - {"finite"})):
        say(f"event: reference, {geometry} geometry")
        state, t_end = _before_event(scene, event, geometry)
        options = {"stepper": "rk4", "switching": "located", "geometry": geometry}
        runs = [
            _event_run(scene, state, t_end, dt=share * limit, **options)
            for share in reference_shares
        ]
        starts[geometry] = _Start(state, t_end, runs[-1])
        for coarse, fine, share in zip(runs[:-1], runs[1:], reference_shares[:-1], strict=True):
            yield {
                "scene": "reference",
                "engine": "dynamic",
                "dt": share * limit,
                "share": share,
                "status": "ok",
                **options,
                **_event_errors(coarse, fine),
            }
    for one in methods:
        start, truth = starts[one.geometry], starts["finite"].reference
        for share in one.shares:
            for rtol in one.rtols:
                say(
                    f"event: {one.stepper}, {one.switching}, {one.geometry}, {share:g} {rtol or ''}"
                )
                options = {"stepper": one.stepper, "switching": one.switching}
                options["geometry"] = one.geometry
                options |= {"dt": share * limit, "rtol": rtol}
                row = {"scene": "event", "engine": "dynamic", "share": share, **options}
                try:
                    runs = [
                        _event_run(scene, start.state, start.t_end, energies=kept, **options)
                        for kept in (True, *(repeats * [False]))
                    ]
                except (SceneError, RunError) as error:
                    yield row | {"status": str(error)}
                    continue
                own = _event_errors(runs[0], start.reference)
                yield {
                    **row,
                    "status": "ok",
                    "seconds": min(run.timings["stepping"] for run in runs[1:]),
                    "evaluations": runs[1].counts["block_evaluations"],
                    **_event_errors(runs[0], truth),
                    **{f"own_{name}": value for name, value in own.items() if name != "energy"},
                }


def _before_event(scene: Scene, event: int, geometry: Geometry) -> tuple[State, float]:
    """Return the state `BEFORE` a main event, and the time `AFTER` its start (s)."""
    options = {"fidelity": "hybrid", "geometry": geometry, "progress": False, "threads": 1}
    plan, t_end = None, 0.0
    while plan is None or plan.events["is_main"].sum() < event:
        t_end += 0.1 * scene.F_N / (scene.driver.K * scene.driver.V)
        plan = simulate(scene, t_end, initial=plan, **options)
    main = plan.events[plan.events["is_main"]]
    t_start = float(main["t_start"].iloc[event - 1])
    record = simulate(scene, t_start - BEFORE, **options)
    return record.final_state, t_start + AFTER


def _event_run(
    scene: Scene, state: State, t_end: float, energies: bool = True, **how: Any
) -> Record:
    return simulate(
        scene,
        t_end,
        fidelity="dynamic",
        initial=state,
        energies=energies,
        sample=(t_end - state.t) / 4,
        threads=1,
        progress=False,
        **how,
    )


def _event_errors(run: Record, truth: Record) -> dict[str, float]:
    """Return the errors of the first main event of a run."""
    F_N = truth.scene.F_N
    found, rows = {"energy": _closure(run)}, []
    for record in (run, truth):
        main = np.flatnonzero(record.events["is_main"])
        if not len(main):
            return found | {"missing": record.scene.N_x}
        rows.append(main[0])
    (a, b), (t_a, t_b) = (
        rows,
        (
            record.rupture_times[row] - record.events["t_start"].iloc[row]
            for record, row in zip((run, truth), rows, strict=True)
        ),
    )
    one, other = run.events.iloc[a], truth.events.iloc[b]
    both = np.isfinite(t_a) & np.isfinite(t_b)
    v_a, v_b = (_speed(record, row) for record, row in ((run, a), (truth, b)))
    stress = [np.concatenate([r.tau_after[i], r.p_after[i]]) for r, i in ((run, a), (truth, b))]
    return found | {
        "rupture": _rms((t_a - t_b)[both]),
        "missing": int((np.isfinite(t_a) != np.isfinite(t_b)).sum()),
        "speed": _rms((v_a / v_b - 1)[np.isfinite(v_a) & np.isfinite(v_b)]),
        "stress": float(np.linalg.norm(stress[0] - stress[1]) / np.linalg.norm(stress[1])),
        "start": abs(one["F_T_start"] - other["F_T_start"]) / F_N,
        "arrest": abs(one["F_T_arrest"] - other["F_T_arrest"]) / F_N,
        "blocks": abs(int(one["last_block"]) - int(other["last_block"])),
    }


def _speed(record: Record, row: int) -> np.ndarray:
    return front_speed(record.rupture_times[[row]], record.scene.slider.l, record.scene.d)[0]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


def _closure(record: Record) -> float:
    """Return the residual of the energy budget, divided by the friction heat."""
    curve = record.curve
    if "friction_heat" not in curve:
        return math.nan
    heat = curve["friction_heat"]
    left = budget_left(curve)
    return abs(float((left.iloc[-1] - left.iloc[0]) / (heat.iloc[-1] - heat.iloc[0])))


# --- reading -------------------------------------------------------------------------------------


def orders(table: pd.DataFrame, question: str = "rupture") -> pd.DataFrame:
    """Return the measured orders: slopes of log error over log dt of each method of the event.

    Errors are those against the reference of the same geometry. Points count if their error is at
    least ten times the last change of the reference.

    Args:
        table: from `table`.
        question: column of errors.

    Returns:
        Columns: stepper, switching, geometry, question, order, points.
    """
    last = table[table["scene"] == "reference"].dropna(subset=[question])
    floor = 10 * last[question].iloc[-1] if len(last) else 0.0
    event = table[(table["scene"] == "event") & (table["status"] == "ok")]
    rows = []
    name = question if question == "energy" else f"own_{question}"
    for key, line in event.groupby(list(LINE), sort=False):
        line = line[(line[name] > (0 if question == "energy" else floor)) & line["rtol"].isna()]
        if len(line) >= 3:
            slope = np.polyfit(np.log(line["dt"]), np.log(line[name]), 1)[0]
            found = {"question": question, "order": float(slope), "points": len(line)}
            rows.append(dict(zip(LINE, key, strict=True)) | found)
    return pd.DataFrame(rows, columns=[*LINE, "question", "order", "points"])


COLOURS = {
    "rk46": "#D55E00",
    "rk4": "#0072B2",
    "verlet": "#009E73",
    "symplectic_euler": "#E69F00",
    "adaptive": "#CC79A7",
}
MARKERS = {"step_end": "s", "located": "o"}
PANELS = (
    ("event", "rupture", "rupture times (s)"),
    ("event", "speed", "front speed (relative)"),
    ("event", "stress", "stress at arrest (relative)"),
    ("event", "energy", "energy left over (friction heat)"),
    ("wave", "displacement", "free wave (relative)"),
    ("slider", "rupture", "four blocks: switch times (s)"),
)
"""Scene, column and label of each panel."""


def figure(table: pd.DataFrame) -> DataFigure:
    """Return the chart: error over computing time, one panel for each question.

    Filled markers are finite geometry, open markers linear. Circles are located switching, squares
    switching at step ends, triangles runs without switches, diamonds other programs.
    """
    fig = DataFigure(figsize=(7.2, 7.4), layout="constrained")
    FigureCanvasAgg(fig)
    handles: dict[str, Any] = {}
    panels = fig.subplots(3, 2).flat
    for (scene, name, label), axes, letter in zip(PANELS, panels, "abcdef", strict=True):
        part = table[(table["scene"] == scene) & (table["status"] == "ok")]
        keys = ["engine", "stepper", "switching", "geometry"]
        part = part[np.isfinite(part["seconds"]) & (part[name] > 0)]
        for key, line in part.groupby(keys, sort=False, dropna=False):
            engine, stepper, switching, geometry = (None if v != v else v for v in key)
            text = _label(engine, stepper, switching, geometry)
            colour = COLOURS.get(stepper)
            peer = engine in ("LAMMPS", "scipy solve_ivp")
            (handles[text],) = axes.loglog(
                line["seconds"],
                line[name],
                color="#666666" if peer else colour,
                ls="-" if switching == "located" else "--",
                marker="D" if peer else MARKERS.get(switching, "v"),
                mfc="none" if geometry == "linear" else None,
                ms=4,
                lw=1,
                label=text,
            )
        axes.set_title(f"({letter}) {label}", fontsize=8, loc="left")
        axes.set_xlabel("computing time (s)", fontsize=8)
        axes.set_ylabel("error", fontsize=8)
        axes.tick_params(labelsize=7, direction="in", which="both")
        axes.grid(alpha=0.3, lw=0.5)
    shown = list(handles.values())
    fig.legend(handles=shown, loc="outside lower center", ncols=4, fontsize=6, frameon=False)
    failed = table[table["status"] != "ok"]
    fig.caption = (
        "Error against computing time for every method. (a-d) The 11th main precursor of the "
        "Fig. 1 scene, from one state; reference: RK4 with located switching in finite geometry, "
        "steps halved until converged. (e) A standing wave in the free lattice, beside LAMMPS. "
        "(f) Four blocks, beside SciPy. "
        f"Along each line the step or the tolerance decreases; {len(failed)} points were refused "
        "or failed and stand in the table with the reason."
    )
    measured = [orders(table, question) for question in QUESTIONS]
    fig.tables = {"points": table, "orders": pd.concat(measured, ignore_index=True)}
    return fig


def _label(engine: str, stepper: str, switching: str, geometry: str) -> str:
    if engine in ("LAMMPS", "scipy solve_ivp"):
        return f"{engine}, {stepper}"
    words = [stepper]
    if switching:
        words.append(switching.replace("_", " "))
    return ", ".join([*words, *([geometry] if geometry else [])])
