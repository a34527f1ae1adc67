"""Parameters of a scene from measured curves, with confidence intervals.

A fit minimises the misfit (`pyfric.fitting.misfits`) from several starts. Each start first
minimises the overview, which compares events without matching. The misfit is then minimised with a
tolerance of forces that falls to zero. Profiles (`pyfric.fitting.profiles`) then give the
intervals.

The search for starts uses quasi-static runs, if the friction law allows them. The fit itself uses
the engine that the caller chooses. Quasi-static runs lack inertia, which changes forces after large
events by 0.01 to 0.05 F_N. Quasi-static runs are enough for static forces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.measurement import Known, Measurement, Together, experiments
from pyfric.fitting.misfits import FEWEST
from pyfric.fitting.of_events import POPULATION, Events, Sizes, large
from pyfric.fitting.problem import ONE, Problem
from pyfric.fitting.profiles import Profiles, known_of
from pyfric.fitting.results import Fit
from pyfric.fitting.search import FOLLOWED, minima, walked
from pyfric.fitting.sensors import Arrivals, Lengths
from pyfric.measured import Curve
from pyfric.scene import Number, Scene, SceneLike, as_scene, full_name, scene_fields
from pyfric.values import Quantity, SceneError, check_number, check_whole, naming, usage

TOLERANCES = (0.01, 0.003, 0.0)
"""Standard deviations of forces added during the search for the minimum, over F_N (a choice)."""
STARTS = 8
"""Largest number of starts, spread over the bounds (a choice). The search ends once the residuals
are as small as noise."""
MORE = 2.0
"""Ratio of the measured scatter of forces of large events to the model's scatter (a choice). Beyond
this ratio, large events are compared as a population."""
SEARCH = "quasistatic"
"""Engine of the runs that improve the starts of a fit."""

Measured = Curve | pd.DataFrame | Measurement | Together


@usage('fit(scene, curve, {"mu_k": (0.3, 0.6)}), with curve = pyfric.measured.read("curve.csv")')
def fit(
    scene: SceneLike | Sequence[SceneLike],
    measured: Measured | Sequence[Measured | None] | None,
    vary: Mapping[str, tuple[Number, Number]],
    *,
    lengths: pd.DataFrame | Sequence[pd.DataFrame | None] | None = None,
    arrivals: pd.DataFrame | Sequence[pd.DataFrame | None] | None = None,
    t_end: float | str | None = None,
    level: float | None = 0.9,
    part: Literal["onset", "all"] = "onset",
    model_error: float = 0.0,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Fit:
    """Fit parameters of a scene to measurements, such as the events of a loading curve.

    Args:
        scene: scene, preset or file with all known values, or a list with one for each experiment.
        measured: a measurement of `pyfric.fitting`, or a sum of measurements, such as Events(curve)
            + Known("mu_k", 0.45, 0.01). A list has one such entry for each experiment. A curve, or
            its table of events, stands for Events(curve, part). None: only lengths were measured.
        vary: name of a parameter, as in `Scene.replace`, -> bounds in SI units, or as text such as
            "3 kN". Every value between the bounds must be allowed. Two parameters belong to the
            curve: "offset", a force over F_N added to it, and "drift", 1/s. "K@2" is the K of the
            second experiment alone.
        lengths: lengths of precursors in the first loading, one table for each curve. Columns:
            force (F_T/F_N after arrest), L_p_over_L, error.
        arrivals: arrivals of fronts at sensors, one table for each curve. Columns: event (number in
            the table of events), x (m, from the trailing edge), t and error (s). Only time
            differences within an event count. The engine must resolve fronts: "hybrid" or
            "dynamic".
        t_end: end of the loading, s, if measured is None.
        level: confidence of the intervals, > 0, < 1. None means no profiles; `Fit.profiled` can add
            them later.
        part: which events are compared one by one. "onset": events before the first large event (a
            fifth of the largest drop); large events are compared by their mean forces. "all": all
            events, for periodic sequences. With "onset", large events that scatter more than the
            model's are compared as a population (`Sizes`), and the fit has a note.
        model_error: standard deviation of the model's forces, over F_N, added to the errors of
            measurement. If the model does not fit, intervals assume the deviation of the model at
            the best parameters.
        seed: seed of the starts that are spread over the bounds.
        progress: function that receives each step of the fit as text.
        options: options of the runs, as in `pyfric.simulate`; fidelity = "hybrid" by default.

    Returns:
        The best parameters, their intervals and profiles, and residuals.

    Raises:
        SceneError: an argument is refused; a curve has fewer than two events; the normal forces of
            a curve and its scene differ; no parameters within the bounds can be run; or no run has
            a measured event.
    """
    if level is not None:
        level = check_number("level", level, "", gt=0.0, lt=1.0)
    model_error = check_number("model_error", model_error, "", ge=0.0)
    seed = check_whole("seed", seed, 0)
    say = progress or (lambda text: None)
    options = {"fidelity": "hybrid", "progress": False} | options
    several = isinstance(measured, Sequence) and not isinstance(measured, str | Together)
    given = list(measured) if several else [measured]
    scenes = list(scene) if isinstance(scene, list | tuple) else [scene] * len(given)
    if len(scenes) != len(given):
        allowed = f"one, or {len(given)}, as there are curves"
        raise SceneError("scene", len(scenes), "", allowed, "scenes")
    scenes = [as_scene(each, {}) for each in scenes]
    made = _made(given, part, t_end, lengths=lengths, arrivals=arrivals)
    data = list(experiments(made))
    bounds = _bounds(scenes, data, vary)
    _check(scenes, data, bounds, options["fidelity"])
    problem = Problem(scenes, data, bounds, options, model_error)
    for note in problem.notes:
        say(note)
    notes: tuple[str, ...] = ()
    try:
        _check_repeats(problem, seed)
        u = _best(problem, seed, say)
    except _Unlike as unlike:
        said = f"{unlike}: they are compared as a population, by mean forces and recurrence"
        say(said)
        runs, problem, notes = problem.runs, _populations(problem), (said,)
        problem.runs = runs
        u = _best(problem, seed, say)
    found = Profiles(u, {}, {}, model_error)
    if level is not None:
        found = known_of(problem, u, level, say)
    return Fit.of(problem, found, level or 0.0, notes)


class _Unlike(Exception):
    """Measured events scatter more than the model's events."""


def _best(problem: Problem, seed: int, say: Callable[[str], None]) -> np.ndarray:
    """Return the parameters of least misfit, each from 0 to 1 between its bounds.

    Raises:
        SceneError: no parameters can be run, or no run has a measured event.
        _Unlike: measured events scatter more than the model's events.
    """
    starts = _starts(problem, seed)
    problem.check(starts[1:])
    search = None
    if problem.options["fidelity"] != SEARCH and not problem.smooth:
        search = problem.of_engine(SEARCH)
    if search is not None:
        starts = minima(search, starts, TOLERANCES[:1], say)[:FOLLOWED]
        problem.runs += search.runs
        problem.reason = search.reason
        if starts:
            _check_alike(search, starts[0])
    found = minima(problem, starts, TOLERANCES, say)
    if not found:
        reason = f"none has one; the last: {problem.reason}"
        raise SceneError("vary", ", ".join(problem.bounds), "", "bounds with a run", reason)
    u = found[0]
    _check_alike(problem, u)
    problem.check_matched(u)
    if problem.fits(u, TOLERANCES[-2]):  # a nearby minimum would not improve a worse fit enough
        u = walked(problem, u, say)
    return u


def _starts(problem: Problem, seed: int) -> list[np.ndarray]:
    """Return the starts of a search: the middle of the bounds, and `STARTS` points between them."""
    dim = len(problem.names)
    spread = scipy.stats.qmc.Sobol(dim, rng=np.random.default_rng(seed)).random(STARTS)
    return [np.full(dim, 0.5), *spread]


def _check_repeats(problem: Problem, seed: int) -> None:
    """Raise _Unlike if curves without a first loading scatter more than the runs of all starts."""
    parts = [part for part in problem.parts if isinstance(part, Events)]
    if not parts or not all(_may_scatter(part) and part.onset_is_whole for part in parts):
        return
    problem.check(starts := _starts(problem, seed)[1:])
    population = _populations(problem)
    population = population.of_engine(SEARCH) or population
    seen = [list(population.compared(u, Sizes)) for u in starts]
    problem.runs += population.runs
    for each in filter(None, seen):
        for part, has, _ in each:
            if MORE * _scatter(has) > _scatter(part.whole):
                return
    if any(seen):
        raise _Unlike(_said(parts))


def _check_alike(problem: Problem, u: np.ndarray) -> None:
    """Raise _Unlike if the best run does not fit, and scatters less than measured large events."""
    found = list(problem.compared(u, Events))
    if not found or problem.fits(u, TOLERANCES[0]):
        return
    for part, seen, _ in found:
        told = len(large(seen)) >= FEWEST and _may_scatter(part)
        if not told or MORE * _scatter(seen) > _scatter(part.whole):
            return
    raise _Unlike(_said([part for part, _, _ in found]))


def _may_scatter(part: Events) -> bool:
    """Whether a curve has many large events that scatter and are compared by their means."""
    enough = len(large(part.whole)) >= POPULATION
    return part.later is not None and enough and _scatter(part.whole) > TOLERANCES[0]


def _scatter(table: pd.DataFrame) -> float:
    """Return the standard deviation of F_T/F_N at the start of large events after the first."""
    peaks = large(table)["peak"].iloc[1:]
    return float(peaks.std()) if len(peaks) > 1 else 0.0


def _said(parts: Sequence[Events]) -> str:
    scatter = max(_scatter(part.whole) for part in parts)
    return f"forces of large events scatter by {scatter:.2g} F_N, those of the model by less"


def _populations(problem: Problem) -> Problem:
    """Return the problem in which the events of each curve are compared as a population."""
    data = [
        Together(
            Sizes(part.whole, spreads=False) if isinstance(part, Events) else part for part in each
        )
        for each in problem.data
    ]
    return Problem(problem.scenes, data, problem.bounds, problem.options, problem.model_error)


def _made(
    given: list[Any],
    part: str,
    t_end: float | str | None,
    *,
    lengths: pd.DataFrame | Sequence[pd.DataFrame | None] | None,
    arrivals: pd.DataFrame | Sequence[pd.DataFrame | None] | None,
) -> list[Together]:
    """Return the measurements of each experiment from its curve and tables."""
    if part not in ("onset", "all"):
        raise SceneError("part", part, "", "'onset' or 'all'")
    n = len(given)
    columns = zip(
        given, _parallel("lengths", lengths, n), _parallel("arrivals", arrivals, n), strict=True
    )
    return [_together(curve, of, at, part, t_end) for curve, of, at in columns]


def _together(
    measured: Any,
    lengths: pd.DataFrame | None,
    arrivals: pd.DataFrame | None,
    part: Any,
    t_end: float | str | None,
) -> Together:
    """Return the measurements of one experiment from its curve and tables."""
    if isinstance(measured, Measurement | Together):
        found = next(experiments(measured))
        if lengths is not None or arrivals is not None:
            name = "lengths" if lengths is not None else "arrivals"
            allowed = f"None: add pyfric.fitting.{name.capitalize()} to the measurements"
            raise SceneError(name, "a table", "", allowed)
        return found
    if measured is None:
        if lengths is None or arrivals is not None:
            raise SceneError("measured", None, "", "a curve, or lengths alone", "nothing to fit")
        if t_end is None:
            raise SceneError("t_end", None, "s", "the end of the loading", "no curve tells it")
        return Together.of(Lengths(lengths, t_end))
    if t_end is not None:
        raise SceneError("t_end", t_end, "s", "None", "the curve tells it")
    events = Events(measured, part)
    parts: list[Measurement] = [events]
    if lengths is not None:
        parts.append(Lengths(lengths))
    if arrivals is not None:
        parts.append(Arrivals(arrivals, events))
    return Together(parts)


def _parallel(name: str, given: Any, n: int) -> list[Any]:
    """Return the table of each curve in a list, None for a curve without a table."""
    tables = list(given) if isinstance(given, list | tuple) else [given] * (1 if n == 1 else n)
    if given is not None and not isinstance(given, list | tuple) and n > 1:
        raise SceneError(name, 1, "", f"a list of {n}, with None where there is none", "tables")
    if len(tables) != n:
        raise SceneError(name, len(tables), "", f"{n}, as there are curves", "tables")
    return tables


def _check(
    scenes: Sequence[Scene], data: Sequence[Together], bounds: Mapping[str, Any], engine: str
) -> None:
    """Raise SceneError if a measurement does not fit its scene, or runs of the engine lack it."""
    for scene, each, end in zip(scenes, data, Problem.durations(scenes, data), strict=True):
        if not end:
            allowed = "the end of the loading, as t_end of Lengths"
            raise SceneError("t_end", None, "s", allowed, "no measurement tells it")
        for part in each:
            if part.engines and engine not in part.engines:
                allowed = " or ".join(map(repr, part.engines))
                raise SceneError("fidelity", engine, "", allowed, f"it has no {part.kind}")
            if "F_N" not in bounds:
                part.check(scene)
            if isinstance(part, Known) and part.name not in bounds:
                allowed = f"a parameter that is varied: {', '.join(bounds)}"
                raise SceneError("name", part.name, "", allowed, "of Known")


def _bounds(
    scenes: Sequence[Scene],
    data: Sequence[Together],
    vary: Mapping[str, tuple[Number, Number]],
) -> dict[str, tuple[float, float]]:
    """Return name of a parameter -> its bounds in SI units, after checks."""
    if not vary or not isinstance(vary, Mapping):
        raise SceneError(
            "vary", str(vary), "", 'names and bounds, such as {"mu_k": (0.3, 0.6)}', ""
        )
    found = {}
    for name, ends in vary.items():
        field, unit = f"vary.{name}", _unit(scenes, data, name, ends)
        pair = () if isinstance(ends, str) or not np.iterable(ends) else tuple(ends)
        if len(pair) != 2:
            raise SceneError(field, str(ends), "", "two bounds, such as (0.3, 0.6)", "")
        low, high = (check_number(field, end, unit) for end in pair)
        if not low < high:
            raise SceneError(field, str(ends), "", "two bounds, the smaller one first", "")
        found[name] = low, high
    return found


def _unit(scenes: Sequence[Scene], data: Sequence[Together], name: str, ends: Any) -> str:
    """Return the SI unit of a parameter."""
    part, mark, number = name.partition(ONE)
    if mark and number not in (numbers := [str(n + 1) for n in range(len(scenes))]):
        allowed = f"the number of an experiment: {', '.join(numbers)}"
        raise SceneError(f"vary.{name}", number, "", allowed)
    units = {key: unit for each in data for kind in each for key, unit in kind.own.items()}
    if part in units:
        return units[part]
    with naming(f"vary.{name}"):
        mark = next(scene_fields(scene)[full_name(scene, part, ends)] for scene in scenes)
    if not isinstance(mark, Quantity):
        raise SceneError(f"vary.{name}", str(ends), "", "a number of the scene", "it is none")
    return mark.unit
