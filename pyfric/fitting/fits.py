"""Parameters of a scene from the events of measured curves, with what is known of them.

The misfit is that of `pyfric.fitting.misfits`. It is minimised from several starts: least squares
of the overview, then of the misfit with a tolerance of forces that goes to zero. It ends with
profiles (`pyfric.fitting.profiles`).

The search for starts takes quasi-static runs, where friction allows them; the rest is done with the
engine that is asked for. Quasi-static runs alone serve for questions of statics: they lack what
inertia does, which is 0.01 to 0.05 F_N after large events.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.misfits import PER_EVENT, Misfit, onset
from pyfric.fitting.problem import OTHERS, Problem
from pyfric.fitting.profiles import profiled
from pyfric.fitting.results import Fit
from pyfric.fitting.search import FOLLOWED, minima, walked
from pyfric.measured import Curve, events
from pyfric.scene import SceneError, SceneLike, as_scene, check_number, check_whole

TOLERANCES = (0.01, 0.003, 0.0)
"""Standard deviations of forces added while the minimum is searched, over F_N. A policy."""
STARTS = 8
"""Starts, spread over the bounds, that are followed at most until the residuals are those of noise.
A policy."""
SEARCH = "quasistatic"
"""Engine that searches for starts."""


def fit(
    scene: SceneLike | Sequence[SceneLike],
    measured: Curve | pd.DataFrame | Sequence[Curve | pd.DataFrame],
    vary: Mapping[str, tuple[float, float]],
    *,
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
        measured: curve, or its table of events (`pyfric.measured.events`), or several.
        vary: name of a parameter, as in `Scene.replace`, -> bounds in SI units. Also "offset", a
            force over F_N added to the curve, and "drift", 1/s.
        level: confidence of the intervals, > 0, < 1.
        part: "onset": events before the first large one (a fifth of the largest drop) are compared
            one by one, and large ones by their mean forces; "all": all are compared one by one, for
            periodic sequences.
        model_error: standard deviation of forces of the model, over F_N, that is added to the
            errors of the measurement.
        seed: of the runs that are spread over the bounds.
        progress: function that is told what is done.
        options: of the runs, as of `pyfric.simulate`; fidelity = "hybrid" by default.

    Returns:
        The best parameters, their intervals and profiles, and residuals.

    Raises:
        SceneError: an argument is refused, a curve has fewer than two events, or no parameters in
            the bounds have a run.
    """
    several = isinstance(measured, Sequence)
    measured = list(measured) if several else [measured]
    scenes = list(scene) if isinstance(scene, list | tuple) else [scene] * len(measured)
    if len(scenes) != len(measured):
        allowed = f"one, or {len(measured)}, as there are curves"
        raise SceneError("scene", len(scenes), "", allowed, "scenes")
    level = check_number("level", level, "", gt=0.0, lt=1.0)
    model_error = check_number("model_error", model_error, "", ge=0.0)
    seed = check_whole("seed", seed, 0)
    say = progress or (lambda text: None)
    tables, bounds = [_table_of(curve) for curve in measured], _bounds(vary)
    options = {"fidelity": "hybrid", "progress": False} | options
    if part not in ("onset", "all"):
        raise SceneError("part", part, "", "'onset' or 'all'")
    wholes, later = tables, [None] * len(tables)
    if part == "onset":
        tables = [onset(whole) for whole in wholes]
        later = [whole.iloc[len(head) :] for whole, head in zip(wholes, tables, strict=True)]
    scenes = [as_scene(each, {}) for each in scenes]
    problem = Problem(scenes, tables, later, bounds, options, model_error)
    dim = len(bounds)
    spread = scipy.stats.qmc.Sobol(dim, rng=np.random.default_rng(seed)).random(STARTS)
    starts = [np.full(dim, 0.5), *spread]
    if options["fidelity"] != SEARCH and problem.can(SEARCH):
        search = Problem(scenes, tables, later, bounds, {"fidelity": SEARCH}, model_error)
        starts = minima(search, starts, TOLERANCES[:1], say)[:FOLLOWED]
        problem.runs += search.runs
    found = minima(problem, starts, TOLERANCES, say)
    if not found:
        raise SceneError("vary", ", ".join(bounds), "", "bounds with a run", "none has one")
    u = walked(problem, found[0], say)
    u, profiles, intervals = profiled(problem, u, level, say)
    compared, values = problem.misfits(u), problem.values(u)
    assert compared is not None  # the best of those that have a run
    missing = sum(apart.missing for apart in compared)
    count = sum(len(table) for table in tables) - missing
    others = int(sum(np.count_nonzero(apart.residuals[-OTHERS:]) for apart in compared))
    return Fit(
        scenes=tuple(problem.scenes_of(values)),
        values=values,
        intervals=intervals,
        profiles=profiles,
        level=level,
        chi2=sum(apart.chi2 for apart in compared),
        dof=PER_EVENT * count + others - len(values),
        table=_compared(problem, u, compared),
        missing=missing,
        extra=sum(apart.extra for apart in compared),
        engine=options["fidelity"],
        runs=problem.runs,
        bounds=bounds,
    )


def _table_of(measured: Curve | pd.DataFrame) -> pd.DataFrame:
    """Return a table of events that knows where it ends, and what it resolves."""
    if isinstance(measured, Curve):
        table, t = events(measured), measured.t
        step = float(np.median(np.diff(t)))
        resolution = table.attrs["smooth"] * step if table.attrs["noise"] else 0.0
        table.attrs |= {"t_end": float(t[-1] - t[0]), "resolution": resolution}
    else:
        table = measured.copy()
        table.attrs = {"t_end": float(table["t_stop"].max()), **measured.attrs}
    if len(table) < 2:
        raise SceneError("measured", len(table), "", "a curve with two or more events", "events")
    if not (table[["peak_error", "valley_error"]] > 0).all(axis=None):
        allowed = "events of a curve with noise: pyfric.measured.events(curve, noise=1e-3)"
        raise SceneError("measured", None, "", allowed, "forces without errors")
    return table


def _bounds(vary: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return checked bounds."""
    if not vary:
        raise SceneError(
            "vary", None, "", 'names and bounds, such as {"mu_k": (0.3, 0.6)}', "empty"
        )
    found = {}
    for name, ends in vary.items():
        try:
            low, high = (check_number(f"vary.{name}", end, "") for end in ends)
        except (TypeError, ValueError) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"vary.{name}", str(ends), "", "two bounds", "") from None
        if not low < high:
            raise SceneError(f"vary.{name}", str(ends), "", "two bounds, the smaller one first", "")
        found[name] = low, high
    return found


def _compared(problem: Problem, u: np.ndarray, found: Sequence[Misfit]) -> pd.DataFrame:
    """Return measured events beside those of the model."""
    parts = []
    for n, (table, model, apart) in enumerate(
        zip(problem.tables, problem.model(u) or [], found, strict=True), 1
    ):
        part = table[["t_start", "peak", "valley", "peak_error", "valley_error"]].copy()
        part.insert(0, "event", table.index)
        part.insert(0, "curve", n)
        with_none = model.reindex(model.index[apart.partner].where(apart.partner >= 0, -1))
        for name in ("peak", "valley"):
            part[f"model_{name}"] = with_none[name].to_numpy()
        half = len(table)
        part["off_peak"], part["off_valley"] = (
            apart.residuals[:half],
            apart.residuals[half : 2 * half],
        )
        parts.append(part)
    return pd.concat(parts, ignore_index=True)
