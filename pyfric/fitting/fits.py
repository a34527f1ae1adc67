"""Parameters of a scene from the events of measured curves, with what is known of them.

The misfit is that of `pyfric.fitting.misfits`. It is minimised from several starts: least squares
of the overview, then of the misfit with a tolerance of forces that goes to zero. It ends with
profiles (`pyfric.fitting.profiles`).

The search for starts takes quasi-static runs, where friction allows them; the rest is done with the
engine that is asked for. Quasi-static runs alone serve for questions of statics: they lack what
inertia does, which is 0.01 to 0.05 F_N after large events.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.misfits import Misfit, onset
from pyfric.fitting.problem import OF_THE_CURVE, Data, Problem
from pyfric.fitting.profiles import profiled
from pyfric.fitting.results import DOUBTFUL, Fit, probability
from pyfric.fitting.search import FOLLOWED, STEP, minima, solved, walked
from pyfric.fitting.sensors import ARRIVALS, LENGTHS, checked
from pyfric.measured import COLUMNS, Curve, events
from pyfric.record import Record
from pyfric.scene import (
    Number,
    Quantity,
    Scene,
    SceneError,
    SceneLike,
    as_scene,
    check_number,
    check_whole,
    full_name,
    naming,
    scene_fields,
    usage,
)

TOLERANCES = (0.01, 0.003, 0.0)
"""Standard deviations of forces added while the minimum is searched, over F_N. A policy."""
STARTS = 8
"""Starts, spread over the bounds, that are followed at most until the residuals are those of noise.
A policy."""
OFF_LOAD = 0.05
"""Largest difference of the normal force of a scene from that of its curve, over it. A policy."""
OFF = 0.1
"""Largest error of forces of a wrong model, over F_N, that intervals assume. A policy."""
NOTHING = pd.DataFrame({name: np.zeros(0) for name in COLUMNS})
"""A table without events."""
SEARCH = "quasistatic"
"""Engine that searches for starts."""


@usage('fit(scene, curve, {"mu_k": (0.3, 0.6)}), with curve = pyfric.measured.read("curve.csv")')
def fit(
    scene: SceneLike | Sequence[SceneLike],
    measured: Curve | pd.DataFrame | Sequence[Curve | pd.DataFrame] | None,
    vary: Mapping[str, tuple[Number, Number]],
    *,
    lengths: pd.DataFrame | Sequence[pd.DataFrame | None] | None = None,
    arrivals: pd.DataFrame | Sequence[pd.DataFrame | None] | None = None,
    t_end: float | str | None = None,
    level: float = 0.9,
    part: Literal["onset", "all"] = "onset",
    model_error: float = 0.0,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Fit:
    """Fit parameters of a scene to the events of a measured curve.

    Args:
        scene: scene, preset or file, or one for each curve, with everything that is known.
        measured: curve, or its table of events (`pyfric.measured.events`), or several. None: only
            lengths were measured.
        vary: name of a parameter, as in `Scene.replace`, -> bounds in SI units, or as text such as
            "3 kN". It has to be a number that may have any value between them. Also "offset", a
            force over F_N added to the curve, and "drift", 1/s.
        lengths: of precursors in the first loading, one table for each curve: columns force, which
            is F_T/F_N after arrest, L_p_over_L and error.
        arrivals: of fronts at sensors, one table for each curve: columns event (number in the table
            of events), x (m, from the trailing edge), t and error (s). Only differences of times
            within an event count. The engine has to have fronts: "hybrid" or "dynamic".
        t_end: end of the loading, s, if measured is None.
        level: confidence of the intervals, > 0, < 1.
        part: "onset": events before the first large one (a fifth of the largest drop) are compared
            one by one, and large ones by their mean forces; "all": all are compared one by one, for
            periodic sequences.
        model_error: standard deviation of forces of the model, over F_N, that is added to the
            errors of the measurement. If no parameter fits, intervals assume that of the best one.
        seed: of the runs that are spread over the bounds.
        progress: function that is told what is done.
        options: of the runs, as of `pyfric.simulate`; fidelity = "hybrid" by default.

    Returns:
        The best parameters, their intervals and profiles, and residuals.

    Raises:
        SceneError: an argument is refused, a curve has fewer than two events or another normal
            force than its scene, no parameters in the bounds have a run, or none has events of the
            measurement.
    """
    several = isinstance(measured, Sequence) and not isinstance(measured, str)
    curves = list(measured) if several else [measured]
    scenes = list(scene) if isinstance(scene, list | tuple) else [scene] * len(curves)
    if len(scenes) != len(curves):
        allowed = f"one, or {len(curves)}, as there are curves"
        raise SceneError("scene", len(scenes), "", allowed, "scenes")
    level = check_number("level", level, "", gt=0.0, lt=1.0)
    model_error = check_number("model_error", model_error, "", ge=0.0)
    seed = check_whole("seed", seed, 0)
    say = progress or (lambda text: None)
    scenes = [as_scene(each, {}) for each in scenes]
    bounds = _bounds(scenes, vary)
    options = {"fidelity": "hybrid", "progress": False} | options
    if part not in ("onset", "all"):
        raise SceneError("part", part, "", "'onset' or 'all'")
    fronts = {"lengths": (lengths, LENGTHS), "arrivals": (arrivals, ARRIVALS)}
    tables = {name: _parallel(name, *given, len(curves)) for name, given in fronts.items()}
    if arrivals is not None and options["fidelity"] == SEARCH:
        raise SceneError("fidelity", SEARCH, "", "'hybrid' or 'dynamic'", "it has no fronts")
    data = [
        _data(curve, part, t_end, **{name: of[n] for name, of in tables.items()})
        for n, curve in enumerate(curves)
    ]
    if "F_N" not in bounds:
        for known, curve in zip(scenes, curves, strict=True):
            _check_load(known, curve)
    problem = Problem(scenes, data, bounds, options, model_error)
    dim = len(bounds)
    spread = scipy.stats.qmc.Sobol(dim, rng=np.random.default_rng(seed)).random(STARTS)
    starts = [np.full(dim, 0.5), *spread]
    problem.check(spread)
    for note in (note for each in data for note in each.table.attrs.get("notes", ())):
        say(note)
    if options["fidelity"] != SEARCH and problem.can(SEARCH):
        still = [dataclasses.replace(each, arrivals=None) for each in data]
        search = Problem(
            scenes, still, bounds, {"fidelity": SEARCH, "progress": False}, model_error
        )
        starts = minima(search, starts, TOLERANCES[:1], say)[:FOLLOWED]
        problem.runs += search.runs
        problem.reason = search.reason
    found = minima(problem, starts, TOLERANCES, say)
    if not found:
        reason = f"none has one; the last: {problem.reason}"
        raise SceneError("vary", ", ".join(bounds), "", "bounds with a run", reason)
    u = found[0]
    problem.check_matched(u)
    if problem.fits(u, TOLERANCES[-2]):  # what is further off is mended by no minimum nearby
        u = walked(problem, u, say)
    u, profiles, intervals = profiled(problem, u, level, say)
    assumed = model_error
    if probability(problem.chi2(u), problem.dof(u)) < DOUBTFUL:
        say("how far the model is off")
        for _ in range(2):  # then for the parameters that this error leads to
            assumed = max(model_error, min(problem.scatter(u, OFF), OFF))
            problem.model_error = assumed
            u = solved(problem.residuals, u, STEP)
        u, profiles, intervals = profiled(problem, u, level, say)
        problem.model_error = model_error
    compared, values = problem.misfits(u), problem.values(u)
    assert compared is not None  # the best of those that have a run
    return Fit(
        scenes=tuple(problem.scenes_of(values)),
        values=values,
        intervals=intervals,
        profiles=profiles,
        level=level,
        chi2=problem.chi2(u),
        dof=problem.dof(u),
        table=_compared(problem, u, compared),
        missing=sum(apart.missing for apart in compared),
        extra=sum(apart.extra for apart in compared),
        engine=options["fidelity"],
        runs=problem.runs,
        bounds=bounds,
        fronts=_of_fronts(problem, u, compared),
        model_error=assumed,
        notes=tuple(note for each in data for note in each.table.attrs.get("notes", ())),
        problem=problem,
    )


def _parallel(name: str, given: Any, columns: Mapping[str, str], n: int) -> list[Any]:
    """Return a checked table, or None, for each curve."""
    tables = list(given) if isinstance(given, list | tuple) else [given] * (1 if n == 1 else n)
    if given is not None and not isinstance(given, list | tuple) and n > 1:
        raise SceneError(name, 1, "", f"a list of {n}, with None where there is none", "tables")
    if len(tables) != n:
        raise SceneError(name, len(tables), "", f"{n}, as there are curves", "tables")
    return [None if table is None else checked(name, table, columns) for table in tables]


def _data(
    measured: Curve | pd.DataFrame | None,
    part: str,
    t_end: float | str | None,
    *,
    lengths: pd.DataFrame | None,
    arrivals: pd.DataFrame | None,
) -> Data:
    """Return what was measured in one experiment."""
    if measured is None:
        if lengths is None or arrivals is not None:
            raise SceneError("measured", None, "", "a curve, or lengths alone", "nothing to fit")
        if t_end is None:
            raise SceneError("t_end", None, "s", "the end of the loading", "no curve tells it")
        end = check_number("t_end", t_end, "s", gt=0.0)
        return Data(table=NOTHING, lengths=lengths, t_end=end)
    if t_end is not None:
        raise SceneError("t_end", t_end, "s", "None", "the curve tells it")
    whole = _table_of(measured)
    table = onset(whole) if part == "onset" else whole
    later = whole.iloc[len(table) :] if part == "onset" else None
    if arrivals is not None and (unknown := set(arrivals["event"]) - set(table.index)):
        allowed = f"numbers of events that are compared one by one, {table.index[0]} to "
        raise SceneError(
            "arrivals.event", min(unknown), "", f"{allowed}{table.index[-1]}", "no such event"
        )
    end = float(whole.attrs["t_end"])
    return Data(table=table, later=later, lengths=lengths, arrivals=arrivals, t_end=end)


def _check_load(scene: Scene, measured: Curve | pd.DataFrame | None) -> None:
    """Raise SceneError if a scene has another constant normal force than its curve."""
    if not isinstance(measured, Curve) or scene.load_at(0.0) is not None:
        return
    F_N = float(measured.table["F_N"].median()) if "F_N" in measured.table else measured.F_N
    if F_N is not None and abs(scene.F_N / F_N - 1) > OFF_LOAD:
        allowed = f"that of the curve, {F_N:.4g} N, within {OFF_LOAD:.0%}"
        raise SceneError("F_N", scene.F_N, "N", allowed, "the scene has another load")


def _table_of(measured: Curve | pd.DataFrame) -> pd.DataFrame:
    """Return a table of events that knows where it ends, and what it resolves."""
    if isinstance(measured, Record):
        allowed = 'pyfric.measured.sampled(record, "0.5 ms", noise=1e-3), a curve as measured'
        raise SceneError("measured", "Record", "", allowed, "a run is no measurement")
    whole = isinstance(measured, Curve) and measured.has_forces
    table = events(measured) if whole else measured
    columns = getattr(table, "columns", ())
    if absent := [name for name in COLUMNS if name not in columns]:
        allowed = (
            "a Curve with forces, as pyfric.measured.read makes of a file, or the events of one"
        )
        reason = f"it has no {', '.join(absent)}"
        raise SceneError("measured", type(measured).__name__, "", allowed, reason)
    if isinstance(measured, Curve):
        table.attrs["t_end"] = float(measured.t[-1] - measured.t[0])
    else:
        table = table.copy()
        table.attrs = {"t_end": float(table["t_stop"].max()), **measured.attrs}
    if len(table) < 2:
        raise SceneError("measured", len(table), "", "a curve with two or more events", "events")
    if not (table[["peak_error", "valley_error"]] > 0).all(axis=None):
        allowed = "events of a curve with noise: pyfric.measured.events(curve, noise=1e-3)"
        raise SceneError("measured", None, "", allowed, "forces without errors")
    return table


def _bounds(
    scenes: Sequence[Scene], vary: Mapping[str, tuple[Number, Number]]
) -> dict[str, tuple[float, float]]:
    """Return checked bounds in SI units."""
    if not vary or not isinstance(vary, Mapping):
        raise SceneError(
            "vary", str(vary), "", 'names and bounds, such as {"mu_k": (0.3, 0.6)}', ""
        )
    found = {}
    for name, ends in vary.items():
        field, unit = f"vary.{name}", _unit(scenes, name, ends)
        pair = () if isinstance(ends, str) or not np.iterable(ends) else tuple(ends)
        if len(pair) != 2:
            raise SceneError(field, str(ends), "", "two bounds, such as (0.3, 0.6)", "")
        low, high = (check_number(field, end, unit) for end in pair)
        if not low < high:
            raise SceneError(field, str(ends), "", "two bounds, the smaller one first", "")
        found[name] = low, high
    return found


def _unit(scenes: Sequence[Scene], name: str, ends: Any) -> str:
    """Return the unit of a parameter."""
    if name in OF_THE_CURVE:
        return OF_THE_CURVE[name]
    with naming(f"vary.{name}"):
        mark = next(scene_fields(scene)[full_name(scene, name, ends)] for scene in scenes)
    if not isinstance(mark, Quantity):
        raise SceneError(f"vary.{name}", str(ends), "", "a number of the scene", "it is none")
    return mark.unit


def _compared(problem: Problem, u: np.ndarray, found: Sequence[Misfit]) -> pd.DataFrame:
    """Return measured events beside those of the model."""
    parts = []
    for n, (each, seen, apart) in enumerate(
        zip(problem.data, problem.model(u) or [], found, strict=True), 1
    ):
        table, model = each.table, seen.events
        part = table[["t_start", "peak", "valley", "peak_error", "valley_error"]].copy()
        part.insert(0, "event", table.index)
        part.insert(0, "curve", n)
        for name in ("peak", "valley"):
            part[f"model_{name}"] = np.append(model[name], np.nan)[apart.partner]
        half = len(table)
        part["off_peak"], part["off_valley"] = (
            apart.residuals[:half],
            apart.residuals[half : 2 * half],
        )
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def _of_fronts(problem: Problem, u: np.ndarray, found: Sequence[Misfit]) -> pd.DataFrame:
    """Return measured lengths and arrivals with their residuals."""
    parts = []
    residuals = problem.of_fronts(u, found)
    for n, (each, off) in enumerate(zip(problem.data, residuals, strict=True), 1):
        rows = [("lengths", each.lengths, "force"), ("arrivals", each.arrivals, "x")]
        kinds = [(kind, at) for kind, of, name in rows if of is not None for at in of[name]]
        part = pd.DataFrame(kinds, columns=["kind", "at"])
        part.insert(0, "curve", n)
        parts.append(part.assign(off=off))
    return pd.concat(parts, ignore_index=True)
