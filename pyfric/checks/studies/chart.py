"""Work-precision chart: what accuracy costs, for every method and question.

Three scenes, each small enough for every method:

event
    The 11th main precursor of the Fig. 1 scene, from 20 us before its first slip until 0.3 ms
    after. Questions: rupture times (s, RMS over the front, from the first slip on), front speed
    (RMS of relative differences), interface stresses at arrest (norm of the difference over the
    norm), start and arrest forces (over F_N), farthest block, closure of the energy budget (over
    the friction heat). All methods start from one state per geometry. The reference is RK4 with
    located switching in finite geometry, with steps that are halved until it no longer changes.
curve
    The loading curve of the Fig. 1 scene up to 0.35 s, five main precursors, by all engines.
    Arrest forces (largest difference, over F_N) and lengths (blocks). Reference: the hybrid engine
    with located switching and small steps, finite geometry.
wave
    A standing wave in a free lattice of the same size, without friction and viscosity, beside
    LAMMPS, which integrates the same bonds with velocity Verlet. Error of the displacements after
    two periods.
slider
    Four blocks that stick and slip, beside `scipy.integrate.solve_ivp` with events. Error of the
    times of all switches.

Work is the time in the core (event, slider), or of the whole run (curve), the least of repeats,
and the number of blocks times force evaluations. A method that fails or is refused at a point
stays in the table, with the reason.
"""

from __future__ import annotations

import math
import sys
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.integrate import solve_ivp

from pyfric import core
from pyfric.checks.pairing import agreement
from pyfric.checks.studies import peers
from pyfric.core import OPEN, State
from pyfric.engines import RunError, simulate
from pyfric.figures import DataFigure
from pyfric.record import budget_left, front_speed
from pyfric.scene import SceneError, at_once, chain, preset
from pyfric.statics import loaded_state, stability_limit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene

__all__ = ["QUESTIONS", "chart", "curve_points", "event_points", "figure", "orders"]

EVENT, BEFORE, AFTER = 10, 20e-6, 300e-6
"""The main precursor, counted from 0, and the times before and after its first slip, s."""
CURVE_END = 0.35
SHARES = (2.0, 0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125)
"""Steps over the stability limit; the first one must be refused."""
REFERENCE_SHARES = (0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625)
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
REPEATS = 3

QUESTIONS = {
    "rupture": "rupture times (s)",
    "speed": "front speed (relative)",
    "stress": "stress at arrest (relative)",
    "arrest": "arrest force ($F_\\mathrm{N}$)",
    "energy": "energy closure (relative)",
}
"""Error columns of the event -> what they mean."""


LINE = ("stepper", "switching", "geometry")
"""What tells the lines of the event apart."""


class Method(NamedTuple):
    """One way to integrate: a line of the chart."""

    stepper: str
    switching: str
    geometry: Geometry
    shares: tuple[float, ...] = SHARES
    rtols: tuple[float | None, ...] = (None,)


METHODS = (
    Method("rk4", "step_end", "finite"),
    Method("rk4", "located", "finite"),
    Method("verlet", "step_end", "finite"),
    Method("verlet", "located", "finite"),
    Method("symplectic_euler", "step_end", "finite"),
    Method("symplectic_euler", "located", "finite"),
    Method("adaptive", "located", "finite", (2.0,), RTOLS),
    Method("rk4", "step_end", "linear"),
    Method("rk4", "located", "linear"),
)


@at_once()
def chart(*, progress: bool = False) -> pd.DataFrame:
    """Measure all points of the chart.

    Args:
        progress: say on stderr what is running.

    Returns:
        One row per point. Columns: scene, engine, stepper, switching, geometry, dt (s), share (dt
        over the stability limit of RK4), rtol, seconds, evaluations, status ("ok", or why it
        failed), the errors of `QUESTIONS`, start, blocks, missing (blocks whose rupture time only
        one of the two has), and the same errors against the reference of the same geometry, with
        "own_" before their names. NaN where a question does not apply.
    """

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    parts = (event_points, curve_points, wave_points, slider_points)
    return pd.concat([pd.DataFrame(part(say)) for part in parts], ignore_index=True)


# --- one event -----------------------------------------------------------------------------------


class _Start(NamedTuple):
    """A state just before the event, and the references that start there."""

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
    """Yield the points of one event; see `chart`.

    Args:
        say: told what is running.
        scene: None means the Fig. 1 scene.
        event: the main event, counted from 0.
        methods: lines of the chart.
        reference_shares: steps of the reference over the limit, the last one of which counts.
        repeats: runs of each point that are timed.
    """
    scene = preset("fig1") if scene is None else scene
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
                        _event_run(scene, start.state, start.t_end, budget=budget, **options)
                        for budget in (True, *(repeats * [False]))
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
    while plan is None or plan.events["is_main"].sum() <= event:
        t_end += 0.1 * scene.F_N / (scene.driver.K * scene.driver.V)
        plan = simulate(scene, t_end, initial=plan, **options)
    main = plan.events[plan.events["is_main"]]
    t_start = float(main["t_start"].iloc[event])
    record = simulate(scene, t_start - BEFORE, **options)
    return record.final_state, t_start + AFTER


def _event_run(scene: Scene, state: State, t_end: float, budget: bool = True, **how: Any) -> Record:
    return simulate(
        scene,
        t_end,
        fidelity="dynamic",
        initial=state,
        budget=budget,
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
    """Return what the energy budget leaves over, over the friction heat."""
    curve = record.curve
    if "friction_heat" not in curve:
        return math.nan
    heat = curve["friction_heat"]
    left = budget_left(curve)
    return abs(float((left.iloc[-1] - left.iloc[0]) / (heat.iloc[-1] - heat.iloc[0])))


# --- the loading curve ---------------------------------------------------------------------------


def curve_points(say: Callable[[str], None] = lambda _: None) -> Iterator[dict[str, Any]]:
    """Yield the points of the loading curve; see `chart`."""
    scene = preset("fig1")
    limit = stability_limit(scene)[0]
    say("curve: reference")
    hybrid = {"fidelity": "hybrid", "switching": "located", "geometry": "finite"}
    truth, before = (
        simulate(scene, CURVE_END, dt=share * limit, progress=False, threads=1, **hybrid)
        for share in (1 / 64, 1 / 32)
    )
    found = agreement(before, truth)
    yield {
        "scene": "reference",
        "engine": "hybrid",
        "stepper": "rk4",
        "switching": "located",
        "geometry": "finite",
        "dt": limit / 32,
        "share": 1 / 32,
        "status": "ok",
        "arrest": found.arrest,
        "start": found.start,
        "blocks": found.blocks,
    }
    lines = [
        ("hybrid", switching, geometry, shares)
        for switching in ("step_end", "located")
        for geometry, shares in (("finite", SHARES[1:]), ("linear", SHARES[1:]))
    ]
    lines += [("dynamic", "step_end", geometry, (0.5,)) for geometry in ("finite", "linear")]
    lines += [("dynamic", "located", "finite", (0.5,)), ("quasistatic", None, None, (None,))]
    for engine, switching, geometry, shares in lines:
        for share in shares:
            say(f"curve: {engine}, {switching}, {geometry}, {share}")
            options = {"fidelity": engine, "geometry": geometry}
            if share is not None:
                options |= {"switching": switching, "dt": share * limit, "threads": 1}
            seconds = math.inf
            for _ in range(1 if engine == "dynamic" else REPEATS):
                begin = time.perf_counter()
                record = simulate(scene, CURVE_END, progress=False, budget=False, **options)
                seconds = min(seconds, time.perf_counter() - begin)
            found = agreement(record, truth)
            yield {
                "scene": "curve",
                "engine": engine,
                "stepper": None if share is None else "rk4",
                "switching": switching,
                "geometry": geometry or "linear",
                "dt": math.nan if share is None else share * limit,
                "share": share,
                "status": "ok",
                "seconds": seconds,
                "evaluations": record.counts["block_evaluations"],
                "arrest": found.arrest,
                "start": found.start,
                "blocks": found.blocks,
                "missing": found.missing,
            }


# --- beside peers --------------------------------------------------------------------------------

AMPLITUDE = 1e-3
"""Of the wave, in l."""


def wave_points(say: Callable[[str], None] = lambda _: None) -> Iterator[dict[str, Any]]:
    """Yield the points of the standing wave; see `chart`."""
    scene = preset("fig1")
    unit = math.sqrt(scene.m / scene.slider.k)  # of time
    u = np.zeros((scene.N_z, 2, scene.N_x))
    u[:, 0] = AMPLITUDE * scene.slider.l * np.cos(np.pi * (scene.x / scene.slider.L + 0.5))
    t_end = 4 * (scene.N_x - 1) / math.sqrt(1.5) * unit
    least = math.ceil(t_end / (1.6 * unit))
    numbers = [least * 2**k for k in range(7)]

    say("wave: reference")
    truth = _wave(scene, u, t_end, 4 * numbers[-1], "rk4")[0]
    scale = _rms(truth)
    for stepper in ("rk4", "verlet", "symplectic_euler"):
        for n in numbers:
            say(f"wave: {stepper}, {n} steps")
            runs = [_wave(scene, u, t_end, n, stepper) for _ in range(REPEATS)]
            yield {
                **_wave_row("pyfric", stepper, t_end / n, runs[0][0], truth, scale),
                "seconds": min(seconds for _, seconds in runs),
                "evaluations": n * core.STEPPERS[stepper].evaluations * scene.N_x * scene.N_z,
            }
    if peers.available()["lammps"].startswith("missing"):
        yield {"scene": "wave", "engine": "LAMMPS", "status": peers.INSTALL}
        return
    with peers.lammps_bonds(scene, integrate=True) as peer:
        for n in numbers:
            say(f"wave: LAMMPS, {n} steps")
            seconds = math.inf
            for _ in range(REPEATS):
                peer.start(u, t_end / n / unit)
                begin = time.perf_counter()
                peer.run(n)
                seconds = min(seconds, time.perf_counter() - begin)
            yield {
                **_wave_row("LAMMPS", "verlet", t_end / n, peer.displacements(), truth, scale),
                "seconds": seconds,
                "evaluations": n * scene.N_x * scene.N_z,
            }


def _wave(
    scene: Scene, u: np.ndarray, t_end: float, n: int, stepper: str
) -> tuple[np.ndarray, float]:
    """Return u after n steps of the free lattice from rest at u, and the time it took, in s."""
    state = loaded_state(scene).state(scene, t_end / n)
    state.y[:], state.rod[:], state.mode[:] = 0.0, 0.0, OPEN
    state.y[:, :2] = u
    model, log = core.springs(scene, "finite"), core.Log(scene.N_x)
    begin = time.perf_counter()
    core.advance(model, state, log, n, stepper=stepper, budget=False)
    return state.y[:, :2].copy(), time.perf_counter() - begin


def _wave_row(
    engine: str, stepper: str, dt: float, u: np.ndarray, truth: np.ndarray, scale: float
) -> dict[str, Any]:
    error = _rms((u - truth).ravel()) / scale
    row = {"scene": "wave", "engine": engine, "stepper": stepper, "geometry": "finite", "dt": dt}
    if not error < 1:
        return row | {"status": "unstable: the wave has grown"}
    return row | {"status": "ok", "displacement": error}


SLIDER_END = 2e-4


def slider_points(say: Callable[[str], None] = lambda _: None) -> Iterator[dict[str, Any]]:
    """Yield the points of the small slider; see `chart`."""
    scene = chain(
        L=7.5e-3,
        p=(60.0, 70.0, 55.0, 65.0),
        tau=(20.0, 0.0, -10.0, 15.0),
        V=0.3,
        k_top=2e7,
        K=4e6,
        k=5e7,
        mu_s=0.7,
        mu_k=0.2,
    )
    truth, _, _ = _ivp(scene, 1e-12)
    for rtol in (1e-3, 1e-5, 1e-7, 1e-9):
        say(f"slider: solve_ivp, {rtol:g}")
        runs = [_ivp(scene, rtol) for _ in range(REPEATS)]
        found, _, evaluations = runs[0]
        yield {
            **_slider_row("scipy solve_ivp", "DOP853", "located", found, truth),
            "rtol": rtol,
            "seconds": min(seconds for _, seconds, _ in runs),
            "evaluations": evaluations * scene.N_x,
        }
    limit = stability_limit(scene)[0]
    for switching in ("step_end", "located"):
        for share in SHARES[1:]:
            say(f"slider: rk4, {switching}, {share:g}")
            runs = [
                simulate(
                    scene,
                    SLIDER_END,
                    fidelity="dynamic",
                    switching=switching,
                    dt=share * limit,
                    sample=SLIDER_END,
                    budget=False,
                    progress=False,
                )
                for _ in range(REPEATS)
            ]
            log = runs[0].switches
            found = list(zip(log["t"], log["block"], log["old"], log["new"], strict=True))
            yield {
                **_slider_row("pyfric", "rk4", switching, found, truth),
                "dt": share * limit,
                "share": share,
                "seconds": min(run.timings["stepping"] for run in runs),
                "evaluations": runs[0].counts["block_evaluations"],
            }


def _slider_row(
    engine: str, stepper: str, switching: str, found: list[tuple], truth: list[tuple]
) -> dict[str, Any]:
    row = {"scene": "slider", "engine": engine, "stepper": stepper, "switching": switching}
    if [one[1:] for one in found] != [one[1:] for one in truth]:
        return row | {"status": f"other switches: {len(found)} instead of {len(truth)}"}
    error = _rms(np.array([a[0] - b[0] for a, b in zip(found, truth, strict=True)]))
    return row | {"status": "ok", "rupture": error}


def _ivp(scene: Scene, rtol: float) -> tuple[list[tuple], float, int]:
    """Return the switches (t, block, old, new) by SciPy, seconds, and the evaluations of forces."""
    N, m, eta = scene.N_x, scene.m, scene.eta
    law = scene.law
    p, k, driver = scene.load, scene.slider.k, scene.driver
    bond = np.eye(N, k=1) + np.eye(N, k=-1) - np.diag([1.0, *((N - 2) * [2.0]), 1.0])
    stiff = k * bond - scene.k_top * np.eye(N)
    stiff[0, 0] -= driver.K
    push, viscous = np.zeros(N), eta * bond
    push[0] = driver.K * driver.V
    mode = np.zeros(N, dtype=int)

    def other(t: float, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return scene.shear + stiff @ u + viscous @ v + push * t

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        v = np.where(mode == 0, 0.0, y[N:])
        a = (other(t, y[:N], v) - mode * law.slide(p)) / m
        return np.concatenate([v, np.where(mode == 0, 0.0, a)])

    def margin(i: int) -> Callable[[float, np.ndarray], float]:
        def value(t: float, y: np.ndarray) -> float:
            if mode[i]:
                return mode[i] * y[N + i]
            return law.hold(p[i]) - abs(other(t, y[:N], y[N:])[i])

        value.terminal, value.direction = True, -1
        return value

    margins, found = [margin(i) for i in range(N)], []
    t, y, evaluations, begin = 0.0, np.zeros(2 * N), 0, time.perf_counter()
    while True:
        options = {"rtol": rtol, "atol": rtol * 1e-9, "events": margins, "method": "DOP853"}
        done = solve_ivp(slope, (t, SLIDER_END), y, **options)
        evaluations += done.nfev
        t, y = float(done.t[-1]), done.y[:, -1].copy()
        hit = [i for i in range(N) if done.t_events[i].size]
        if not hit:
            return found, time.perf_counter() - begin, evaluations
        i, old = hit[0], mode[hit[0]]
        y[N + i] = 0.0
        force = other(t, y[:N], y[N:])[i]
        stays = old and abs(force) <= law.hold(p[i])
        mode[i] = 0 if stays else int(np.sign(force))
        found.append((t, i, old, mode[i]))


# --- reading -------------------------------------------------------------------------------------


def orders(table: pd.DataFrame, question: str = "rupture") -> pd.DataFrame:
    """Return the measured orders: slopes of log error over log dt of each method of the event.

    Errors are those against the reference of the same geometry, of the points whose error is at
    least ten times what the reference still changes by.

    Args:
        table: from `chart`.
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
    "rk4": "#0072B2",
    "verlet": "#009E73",
    "symplectic_euler": "#E69F00",
    "adaptive": "#CC79A7",
    "quasistatic": "#000000",
    "hybrid": "#56B4E9",
}
MARKERS = {"step_end": "s", "located": "o"}
PANELS = (
    ("event", "rupture", "rupture times (s)"),
    ("event", "speed", "front speed (relative)"),
    ("event", "stress", "stress at arrest (relative)"),
    ("event", "energy", "energy left over (friction heat)"),
    ("curve", "arrest", r"loading curve: arrest force ($F_\mathrm{N}$)"),
    ("wave", "displacement", "free wave (relative)"),
    ("slider", "rupture", "four blocks: switch times (s)"),
)
"""Scene, column and label of each panel."""


def figure(table: pd.DataFrame) -> DataFigure:
    """Return the chart: error over computing time, one panel for each question.

    Filled markers are finite geometry, open ones linear; circles are located switching, squares
    switching at step ends, triangles runs without switches, diamonds peers.
    """
    fig = DataFigure(figsize=(7.2, 8.4), layout="constrained")
    FigureCanvasAgg(fig)
    handles: dict[str, Any] = {}
    *panels, last = fig.subplots(4, 2).flat
    for (scene, name, label), axes, letter in zip(PANELS, panels, "abcdefg", strict=True):
        part = table[(table["scene"] == scene) & (table["status"] == "ok")]
        keys = ["engine", "stepper", "switching", "geometry"]
        part = part[np.isfinite(part["seconds"]) & (part[name] > 0)]
        for key, line in part.groupby(keys, sort=False, dropna=False):
            engine, stepper, switching, geometry = (None if v != v else v for v in key)
            text = _label(scene, engine, stepper, switching, geometry)
            colour = COLOURS.get(engine, COLOURS.get(stepper))
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
    last.axis("off")
    last.legend(handles=list(handles.values()), loc="center", ncols=2, fontsize=6, frameon=False)
    failed = table[table["status"] != "ok"]
    fig.caption = (
        "Error against computing time for every method. (a-d) The 11th main precursor of the "
        "Fig. 1 scene, from one state; reference: RK4 with located switching in finite geometry, "
        "steps halved until converged. (e) Loading curve of that scene up to 0.35 s, whole runs. "
        "(f) A standing wave in the free lattice, beside LAMMPS. (g) Four blocks, beside SciPy. "
        f"Each line is a ladder of steps or tolerances; {len(failed)} points were refused or "
        "failed and stand in the table with the reason."
    )
    measured = [orders(table, question) for question in QUESTIONS]
    fig.tables = {"points": table, "orders": pd.concat(measured, ignore_index=True)}
    return fig


def _label(scene: str, engine: str, stepper: str, switching: str, geometry: str) -> str:
    if engine in ("LAMMPS", "scipy solve_ivp"):
        return f"{engine}, {stepper}"
    words = [stepper or engine]
    if scene == "curve" and engine != "quasistatic":
        words.insert(0, engine)
    if switching:
        words.append(switching.replace("_", " "))
    return ", ".join([*words, *([geometry] if geometry else [])])
