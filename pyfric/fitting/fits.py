"""Parameters of a scene from the events of measured curves, with what is known of them.

The misfit is that of `pyfric.fitting.misfits`. It is minimised from several starts: least squares
of the overview, then of the misfit with a tolerance of forces that goes to zero. It ends with
profiles. A profile is the least misfit against the value of one parameter, with all others free.
An interval holds all values whose misfit is above the least one by no more than the quantile of
chi^2 with one degree of freedom. Forces of the model jump where an event takes another block; their
scatter adds to the variance, and the quantile grows with it. A parameter whose profile stays below
it up to a bound is not determined there.

The search for starts takes quasi-static runs, where friction allows them; the rest is done with the
engine that is asked for. Quasi-static runs alone serve for questions of statics: they lack what
inertia does, which is 0.01 to 0.05 F_N after large events.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd
import scipy

from pyfric.display import html
from pyfric.engines import Options
from pyfric.fitting.misfits import CAP, PER_EVENT, Misfit, misfit, onset, overview
from pyfric.measured import Curve, events
from pyfric.planning import check_run, simulate
from pyfric.scene import SceneError, SceneLike, as_scene, check_number, check_whole
from pyfric.statics import EquilibriumError

OF_THE_CURVE = ("offset", "drift")
"""Parameters of a curve, not of a scene: a force added to it (over F_N), and one per time (1/s)."""
TOLERANCES = (0.01, 0.003, 0.0)
"""Standard deviations of forces added while the minimum is searched, over F_N. A policy."""
STARTS = 8
"""Starts, spread over the bounds, that are followed at most until the residuals are those of noise.
A policy."""
SEARCH, FOLLOWED = "quasistatic", 3
"""Engine that searches for starts, and how many of its minima are followed by others. Policies."""
COARSE = 1e-2
"""Step of differences of the overview, over the bounds: a policy."""
OTHERS = 4
"""Residuals of a curve that are not of its events."""
STEP = 1e-3
"""Step of differences over the bounds: a policy."""
WALK, FAR, WALKS = 2e-3, 8, 3
"""Step of the search for minima nearby, over the bounds; steps either way; how often. Policies."""
POINTS = 5
"""Points of a profile on either side; they reach to `REACH` standard deviations. Policies."""
REACH = 2.4
BEYOND = 2
"""Points of a profile in a row beyond the limit, where it ends; one may be a jump. A policy."""
WIDER = 4
"""How often a profile is widened, each time by a factor of two, until it has an end."""
LONGER = 1.1
"""Time of runs over that of the measurement: a policy."""
DOUBTFUL = 0.01
"""Probability of the residuals below which the model is said not to fit. A policy."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Parameters that fit measured events, and what is known of them.

    Attributes:
        scenes: the scenes with the best parameters, one for each curve.
        values: best parameters by name.
        intervals: name -> ends of the confidence interval; an end is NaN where the bound is reached
            before the misfit tells.
        profiles: name -> data frame with columns value and chi2.
        level: confidence of the intervals.
        chi2, dof: sum of squares, and degrees of freedom.
        table: measured events with columns curve, event, peak, valley, model_peak, model_valley
            (over F_N), off_peak, off_valley (standard deviations).
        missing, extra: events of the measurement that the model has not, and the reverse.
        engine: the engine of its runs.
        runs: number of runs that were made, also those of the search.
        bounds: name -> bounds that were searched.
    """

    scenes: tuple[Any, ...]
    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    profiles: Mapping[str, pd.DataFrame]
    level: float
    chi2: float
    dof: int
    table: pd.DataFrame
    missing: int
    extra: int
    engine: str
    runs: int
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Of a sum of squares at least this large, if the model is right."""
        return float(scipy.stats.chi2.sf(self.chi2, max(self.dof, 1)))

    @property
    def fits(self) -> bool:
        """Whether the residuals are those of noise: `probability` at least 0.01."""
        return self.probability >= DOUBTFUL

    def __str__(self) -> str:
        lines = []
        for name, value in self.values.items():
            low, high = self.intervals[name]
            if math.isnan(low) and math.isnan(high):
                lines.append(
                    f"{name} = {value:.5g}: not determined within {_said(self.bounds[name])}"
                )
                continue
            least, largest = self.bounds[name]
            ends = f"{f'{low:.5g}' if low == low else f'< {least:.5g}'} to "
            ends += f"{high:.5g}" if high == high else f"> {largest:.5g}"
            lines.append(f"{name} = {value:.5g}, {self.level:.0%}: {ends}")
        n = len(self.table)
        lines.append(
            f"chi^2 {self.chi2:.4g} with {self.dof} degrees of freedom, {n} events measured, "
            f"{self.missing} missing in the model, {self.extra} more in the model"
        )
        if not self.fits:
            lines.append(
                f"THE MODEL DOES NOT FIT (probability {self.probability:.1g}): intervals do not "
                "hold; try another law, disorder, or another parameter"
            )
        lines.append(f"{self.runs} runs, {self.engine} at the end")
        return "\n".join(lines)

    __repr__ = __str__

    _repr_html_ = html


def _said(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.5g} to {bounds[1]:.5g}"


class _Problem:
    """Residuals of parameters between 0 and 1, for scenes and tables of events."""

    def __init__(
        self,
        scenes: Sequence[Any],
        tables: Sequence[pd.DataFrame],
        later: Sequence[pd.DataFrame | None],
        bounds: Mapping[str, tuple[float, float]],
        options: Mapping[str, Any],
        model_error: float,
    ) -> None:
        self.scenes, self.tables, self.later, self.options = scenes, tables, later, options
        self.names = list(bounds)
        self.low, self.high = (np.array(ends) for ends in zip(*bounds.values(), strict=True))
        self.model_error = model_error
        self.size = sum(PER_EVENT * len(table) + OTHERS for table in tables)
        self.known: dict[tuple[float, ...], list[pd.DataFrame] | None] = {}
        self.runs = 0

    def can(self, engine: str) -> bool:
        """Whether an engine can run the scenes."""
        try:
            for scene in self.scenes:
                check_run(scene, Options(fidelity=engine))
        except SceneError:
            return False
        return True

    def values(self, u: np.ndarray) -> dict[str, float]:
        """Return the parameters by name."""
        return dict(zip(self.names, (self.low + u * (self.high - self.low)).tolist(), strict=True))

    def scenes_of(self, values: Mapping[str, float]) -> list[Any]:
        """Return the scenes with these parameters."""
        changes = {name: value for name, value in values.items() if name not in OF_THE_CURVE}
        return [scene.replace(**changes) for scene in self.scenes]

    def model(self, u: np.ndarray) -> list[pd.DataFrame] | None:
        """Return the tables of events of the model; None where it has no run."""
        values = self.values(u)
        of_scene = tuple(value for name, value in values.items() if name not in OF_THE_CURVE)
        if of_scene not in self.known:
            try:
                self.known[of_scene] = [
                    self.run(scene, table, **self.options)
                    for scene, table in zip(self.scenes_of(values), self.tables, strict=True)
                ]
            except (SceneError, EquilibriumError):
                self.known[of_scene] = None
        found = self.known[of_scene]
        offset, drift = (values.get(name, 0.0) for name in OF_THE_CURVE)
        if found is None or not (offset or drift):
            return found
        moved = []
        for table in found:
            added = {
                name: table[name] + offset + drift * table[time]
                for name, time in (("peak", "t_start"), ("valley", "t_stop"))
            }
            moved.append(table.assign(**added))
        return moved

    def run(self, scene: Any, table: pd.DataFrame, **options: Any) -> pd.DataFrame:
        """Return the events of a run as long as the measurement."""
        self.runs += 1
        t_end = LONGER * float(table.attrs["t_end"])
        record = simulate(scene, t_end, **options)
        return events(record, t_gap=table.attrs.get("resolution", 0.0))

    def misfits(self, u: np.ndarray, tolerance: float = 0.0) -> list[Misfit] | None:
        """Return the misfit of each curve, None where there is no run."""
        model = self.model(u)
        if model is None:
            return None
        tolerance = math.hypot(tolerance, self.model_error)
        return [
            misfit(table, found, tolerance=tolerance, later=later)
            for table, found, later in zip(self.tables, model, self.later, strict=True)
        ]

    def overview(self, u: np.ndarray) -> np.ndarray:
        """Return the overview of all curves; large numbers where there is no run."""
        model = self.model(u)
        if model is None:
            return np.full(self.size - OTHERS * len(self.tables), 10 * CAP)
        pairs = zip(self.tables, model, strict=True)
        return np.concatenate([overview(table, found) for table, found in pairs])

    def residuals(self, u: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Return the residuals of all curves, shape (size,)."""
        found = self.misfits(u, tolerance)
        if found is None:
            return np.full(self.size, CAP)
        return np.concatenate([apart.residuals for apart in found])

    def chi2(self, u: np.ndarray, tolerance: float = 0.0) -> float:
        """Return the sum of squares."""
        return float(np.sum(self.residuals(u, tolerance) ** 2))


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
    problem = _Problem(scenes, tables, later, bounds, options, model_error)
    dim = len(bounds)
    spread = scipy.stats.qmc.Sobol(dim, rng=np.random.default_rng(seed)).random(STARTS)
    starts = [np.full(dim, 0.5), *spread]
    if options["fidelity"] != SEARCH and problem.can(SEARCH):
        search = _Problem(scenes, tables, later, bounds, {"fidelity": SEARCH}, model_error)
        starts = _minima(search, starts, TOLERANCES[:1], say)[:FOLLOWED]
        problem.runs += search.runs
    minima = _minima(problem, starts, TOLERANCES, say)
    if not minima:
        raise SceneError("vary", ", ".join(bounds), "", "bounds with a run", "none has one")
    u = _walked(problem, minima[0], say)
    u, profiles, intervals = _profiles(problem, u, level, say)
    found, values = problem.misfits(u), problem.values(u)
    assert found is not None  # the best of those that have a run
    missing = sum(apart.missing for apart in found)
    count = sum(len(table) for table in tables) - missing
    others = int(sum(np.count_nonzero(apart.residuals[-OTHERS:]) for apart in found))
    return Fit(
        scenes=tuple(problem.scenes_of(values)),
        values=values,
        intervals=intervals,
        profiles=profiles,
        level=level,
        chi2=sum(apart.chi2 for apart in found),
        dof=PER_EVENT * count + others - len(values),
        table=_compared(problem, u, found),
        missing=missing,
        extra=sum(apart.extra for apart in found),
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


def _minima(
    problem: _Problem,
    starts: Sequence[np.ndarray],
    tolerances: Sequence[float],
    say: Callable[[str], None],
) -> list[np.ndarray]:
    """Return minima of the misfit with the last of some tolerances, the least one first.

    Where residuals are those of noise, no further start is followed.
    """
    found: list[tuple[float, np.ndarray]] = []
    engine = problem.options["fidelity"]
    for number, start in enumerate(starts, 1):
        if problem.model(start) is None:
            continue
        say(f"least squares by the {engine} engine from start {number}")
        u = _solved(problem.overview, start, COARSE)
        for tolerance in tolerances:
            u = _solved(functools.partial(problem.residuals, tolerance=tolerance), u, STEP)
        found.append((problem.chi2(u, tolerances[-1]), u))
        least = min(chi2 for chi2, _ in found)
        if scipy.stats.chi2.sf(least, problem.size - len(u)) >= DOUBTFUL:
            break
    return [u for _, u in sorted(found, key=lambda pair: pair[0])]


def _walked(problem: _Problem, u: np.ndarray, say: Callable[[str], None]) -> np.ndarray:
    """Return the parameters of a lower minimum nearby, if residuals are not those of noise.

    Each parameter is moved either way, with the others along.
    """
    for _ in range(WALKS):
        least = problem.chi2(u)
        if scipy.stats.chi2.sf(least, problem.size - len(u)) >= DOUBTFUL:
            break
        say("minima nearby")
        jacobian, best = _jacobian(problem, u), u
        for k in range(len(u)):
            others = np.arange(len(u)) != k
            for step in WALK * np.concatenate([np.arange(-FAR, 0), np.arange(1, FAR + 1)]):
                start = np.clip(u + step * _ridge(jacobian, k)[0], 0, 1)
                tried, chi2 = _least_of_others(problem, start, jacobian, others)
                if chi2 < least:
                    best, least = tried, chi2
        if best is u:
            break
        u = _solved(problem.residuals, best, STEP)
        u = u if problem.chi2(u) < least else best
    return u


def _ridge(jacobian: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    """Return the change of all parameters with one, others free, and its standard deviation."""
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    if not inverse[k, k] > 0:
        return np.eye(len(inverse))[k], 1.0
    return inverse[:, k] / inverse[k, k], math.sqrt(inverse[k, k])


def _solved(
    residuals: Callable[[np.ndarray], np.ndarray], u: np.ndarray, step: float
) -> np.ndarray:
    """Return the parameters of a local minimum."""
    u = np.clip(u, 2 * step, 1 - 2 * step)
    how = {"bounds": (0.0, 1.0), "diff_step": step, "xtol": 1e-4, "ftol": 1e-2, "max_nfev": 12}
    return scipy.optimize.least_squares(residuals, u, **how).x


def _profiles(
    problem: _Problem, u: np.ndarray, level: float, say: Callable[[str], None]
) -> tuple[np.ndarray, dict[str, pd.DataFrame], dict[str, tuple[float, float]]]:
    """Return the best parameters, profiles, and intervals.

    Where a profile finds a lower misfit, it is the new best, and profiles begin again.
    """
    quantile = float(scipy.stats.chi2.ppf(level, 1))
    for _ in range(3):
        least, lower = problem.chi2(u), None
        made: dict[str, list[tuple[float, float]]] = {}
        jacobian, jumps = _derivatives(problem, u)
        limit = quantile * (1 + jumps)
        for k, name in enumerate(problem.names):
            say(f"profile of {name}")
            made[name], lowest = _profile(problem, u, jacobian, k, least, limit)
            if lowest[0] < (lower or (least,))[0] - 1e-9:
                lower = lowest
        if lower is None:
            break
        u = lower[1]
    least = problem.chi2(u)
    profiles, intervals = {}, {}
    for k, name in enumerate(problem.names):
        low, width = problem.low[k], problem.high[k] - problem.low[k]
        points = sorted([*made[name], (u[k], least)])
        at, chi2 = np.array(points).T
        profiles[name] = pd.DataFrame({"value": low + at * width, "chi2": chi2})
        ends = _interval(at, chi2, min(least, chi2.min()) + limit)
        intervals[name] = tuple(float(low + end * width) for end in ends)
    return u, profiles, intervals


def _jacobian(problem: _Problem, u: np.ndarray) -> np.ndarray:
    """Return derivatives of the residuals by central differences."""
    return _derivatives(problem, u)[0]


def _derivatives(problem: _Problem, u: np.ndarray) -> tuple[np.ndarray, float]:
    """Return derivatives of the residuals, and the mean variance of their jumps, per residual."""
    columns, jumps, centre = [], [], problem.residuals(u)
    for k in range(len(u)):
        ends = [np.clip(u + sign * 2 * STEP * (np.arange(len(u)) == k), 0, 1) for sign in (-1, 1)]
        low, high = (problem.residuals(end) for end in ends)
        columns.append((high - low) / (ends[1][k] - ends[0][k]))
        jumps.append(np.clip(high + low - 2 * centre, -1, 1) ** 2 / 6)
    return np.array(columns).T, float(np.mean(jumps))


def _profile(
    problem: _Problem, u: np.ndarray, jacobian: np.ndarray, k: int, least: float, limit: float
) -> tuple[list[tuple[float, float]], tuple[float, np.ndarray]]:
    """Return points (value, chi2) of one profile, and the least misfit with its parameters."""
    others = np.arange(len(u)) != k
    ridge, deviation = _ridge(jacobian, k)
    points, lowest = [], (least, u)
    for side in (-1, 1):
        step, at, beyond = REACH * deviation / POINTS, 0.0, 0
        for number in range(POINTS * WIDER):
            if number and number % POINTS == 0:
                step *= 2
            if beyond == BEYOND and number >= 3:
                break
            at += step
            start = np.clip(u + side * at * ridge, 0, 1)
            if not 0 < u[k] + side * at < 1:
                break
            found, chi2 = _least_of_others(problem, start, jacobian, others)
            points.append((float(found[k]), chi2))
            beyond = beyond + 1 if chi2 > least + limit else 0
            if chi2 < lowest[0]:
                lowest = chi2, found
    return points, lowest


def _least_of_others(
    problem: _Problem, start: np.ndarray, jacobian: np.ndarray, others: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the parameters of least misfit with one of them held, by steps of Gauss and Newton."""
    best, residuals = start, problem.residuals(start)
    for _ in range(2 if others.any() else 0):
        change = np.linalg.lstsq(jacobian[:, others], -residuals, rcond=None)[0]
        tried = best.copy()
        tried[others] = np.clip(tried[others] + change, 0, 1)
        new = problem.residuals(tried)
        if new @ new >= residuals @ residuals:
            break
        best, residuals = tried, new
    return best, float(residuals @ residuals)


def _interval(at: np.ndarray, chi2: np.ndarray, limit: float) -> tuple[float, float]:
    """Return the outermost places where a profile passes a limit; NaN where it does not."""
    inside = np.flatnonzero(chi2 <= limit)
    ends = []
    for edge, out in ((inside[0], -1), (inside[-1], 1)):
        beyond = edge + out
        if not 0 <= beyond < len(at):
            ends.append(np.nan)
            continue
        share = (limit - chi2[edge]) / (chi2[beyond] - chi2[edge])
        ends.append(at[edge] + share * (at[beyond] - at[edge]))
    return ends[0], ends[1]


def _compared(problem: _Problem, u: np.ndarray, found: Sequence[Misfit]) -> pd.DataFrame:
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
