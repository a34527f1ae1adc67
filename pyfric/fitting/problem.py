"""Residuals as functions of parameters: runs of scenes, compared with measurements."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import scipy

from pyfric.engines import Options
from pyfric.fitting.measurement import At, Measurement, Together
from pyfric.fitting.misfits import Misfit
from pyfric.fitting.of_events import Events
from pyfric.planning import check_run, simulate
from pyfric.scene import Scene
from pyfric.statics import EquilibriumError
from pyfric.values import SceneError

DOUBTFUL = 0.01
"""Probability of the residuals below which the model counts as not fitting (a choice)."""
FURTHER = (0.5, 1.0, 2.0, 4.0)
"""Distances beyond the bounds of a parameter, over their width, that are tried in order to suggest
wider bounds (a choice)."""
ONE = "@"
"""Mark between a parameter and the number of the only experiment that has it: "K@2"."""


def probability(chi2: float, dof: int) -> float:
    """Return the probability of a sum of squares at least this large if the model is right."""
    return float(scipy.stats.chi2.sf(chi2, max(dof, 1)))


def wider(low: float, high: float, side: int) -> tuple[float, float]:
    """Return bounds extended by their width on one side; positive bounds stay positive."""
    width = high - low
    if side > 0:
        return low, high + width
    return (low - width if low <= 0 or low > width else low / 2), high


class Problem:
    """Residuals of scenes and their measurements, as functions of parameters from 0 to 1.

    Args:
        scenes, data: scene and measurements of each experiment.
        bounds: name -> bounds in SI units; "NAME@2" is a parameter of the second experiment alone.
        options: options of the runs.
        model_error: standard deviation of the model's forces, over F_N.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        data: Sequence[Together],
        bounds: Mapping[str, tuple[float, float]],
        options: Mapping[str, Any],
        model_error: float,
    ) -> None:
        self.scenes, self.data, self.options = scenes, data, options
        self.bounds, self.names = dict(bounds), list(bounds)
        self.low, self.high = (np.array(ends) for ends in zip(*bounds.values(), strict=True))
        self.model_error = model_error
        self.size = sum(each.size for each in self.parts)
        self.smooth = all(each.smooth for each in self.parts)
        self.known: dict[tuple[Any, ...], list[Any] | None] = {}
        self.tried: dict[bytes, np.ndarray] = {}  # residuals of tried parameters
        self.runs = 0
        self.reason = ""  # why parameters could not be run, the last time

    @property
    def parts(self) -> Iterator[Measurement]:
        """Measurements of all experiments in order."""
        return (part for together in self.data for part in together)

    @property
    def groups(self) -> np.ndarray:
        """Group number of each residual; in a group, errors of a wrong model are correlated."""
        first, groups = 0, [np.zeros(0, dtype=int)]
        for part in self.parts:
            groups.append(first + part.groups)
            first = int(groups[-1].max(initial=first - 1)) + 1
        return np.concatenate(groups)

    def can(self, engine: str) -> bool:
        """Whether an engine can run the scenes."""
        try:
            for scene in self.scenes:
                check_run(scene, Options(fidelity=engine))
        except SceneError:
            return False
        return True

    def of_engine(self, engine: str) -> Problem | None:
        """Return the problem with measurements that another engine gives; None if it gives none."""
        data = [
            Together(part for part in each if not part.engines or engine in part.engines)
            for each in self.data
        ]
        if not self.can(engine) or not all(self.durations(self.scenes, data)):
            return None
        options = {"fidelity": engine, "progress": False}
        return Problem(self.scenes, data, self.bounds, options, self.model_error)

    @staticmethod
    def durations(scenes: Sequence[Scene], data: Sequence[Together]) -> list[float]:
        """Return the duration of the run of each experiment, s; 0 where no measurement gives it."""
        pairs = zip(scenes, data, strict=True)
        return [
            max((part.lasts(scene) or 0.0 for part in each), default=0.0) for scene, each in pairs
        ]

    def check(self, starts: Sequence[np.ndarray]) -> None:
        """Refuse a problem that cannot be solved, before any run.

        Args:
            starts: parameters to try, away from the bounds and from round fractions of their range.

        Raises:
            SceneError: the engine cannot run the scenes; no start gives a valid scene; or there are
                as many parameters as measured numbers.
        """
        for scene in self.scenes:
            check_run(scene, Options(fidelity=self.options["fidelity"]))
        told = sum(part.count for part in self.parts)
        if told <= len(self.names):
            names, reason = ", ".join(self.names), f"{told} numbers were measured"
            raise SceneError("vary", names, "", f"fewer than {told} parameters", reason)
        reasons = []
        for start in starts:
            try:
                self.scenes_of(self.values(start))
            except SceneError as error:
                reasons.append(str(error).partition("; allowed")[0])
            else:
                return
        allowed = "bounds between which any value makes a scene"
        raise SceneError("vary", ", ".join(self.names), "", allowed, f"none does: {reasons[0]}")

    def check_matched(self, u: np.ndarray) -> None:
        """Refuse best parameters at which no event matches.

        Raises:
            SceneError: no event matches, or no more residuals than parameters depend on parameters.
        """
        tables = [(each.one_by_one, seen) for each, seen, _ in self.compared(u, Events)]
        n, missing = sum(len(known) for known, _ in tables), self.counts(u)[0]
        if self.dof(u) > 0 and (missing < n or not n):
            return
        reason = f"at the best parameters the model has {n - missing} of {n} events"
        known, seen = (pd.concat(of) for of in zip(*tables, strict=True)) if tables else ((), ())
        if len(seen):
            forces = [f"{of['peak'].min():.3g} to {of['peak'].max():.3g}" for of in (known, seen)]
            reason += f": they begin at F_T/F_N = {forces[0]}, those of the model at {forces[1]}"
        elif tables:
            reason += ", and none of its own"
        allowed = "bounds within which events of the model are those that were measured"
        if nearer := self._nearer(u):
            allowed += f", such as {nearer}"
        elif not len(seen):
            allowed += "; a curve without events is pyfric.fitting.CurveOf(curve)"
        raise SceneError("vary", ", ".join(self.names), "", allowed, reason)

    def _nearer(self, u: np.ndarray) -> str:
        """Return, as text, wider bounds of a parameter that give smaller rough residuals."""
        best, found = float(np.linalg.norm(self.overview(u))), ""
        for name, (low, high) in self.bounds.items():
            for share, side in itertools.product(FURTHER, (-1, 1)):
                value = (high if side > 0 else low) + side * share * (high - low)
                if value <= 0 < low:
                    continue
                ends = min(low, value), max(high, value)
                bounds = self.bounds | {name: ends}
                wide = Problem(self.scenes, self.data, bounds, self.options, 0.0)
                at = wide.place(self.values(u) | {name: value})
                if wide.model(at) is not None:
                    off = float(np.linalg.norm(wide.overview(at)))
                    if off < best:
                        best, found = off, f"{name} from {ends[0]:.4g} to {ends[1]:.4g}"
        return found

    def values(self, u: np.ndarray) -> dict[str, float]:
        """Return the parameters by name, in SI units."""
        return dict(zip(self.names, (self.low + u * (self.high - self.low)).tolist(), strict=True))

    def place(self, values: Mapping[str, float]) -> np.ndarray:
        """Return parameters by name as numbers between 0 and 1."""
        at = np.array([values[name] for name in self.names])
        return np.clip((at - self.low) / (self.high - self.low), 0, 1)

    def own(self, values: Mapping[str, float], n: int) -> dict[str, float]:
        """Return the parameters of one experiment by name, without the number of the experiment."""
        found = {}
        for name, value in values.items():
            part, mark, number = name.partition(ONE)
            if not mark or number == str(n + 1):
                found[part] = value
        return found

    def scenes_of(self, values: Mapping[str, float]) -> list[Scene]:
        """Return the scene of each experiment with the parameters `values`."""
        return [self._scene(self.own(values, n), n) for n in range(len(self.scenes))]

    def _scene(self, values: Mapping[str, float], n: int) -> Scene:
        return self.scenes[n].replace(**self._changes(values, n))

    def _changes(self, values: Mapping[str, float], n: int) -> dict[str, float]:
        """Return the parameters of an experiment that belong to its scene."""
        others = {name for part in self.data[n] for name in part.own}
        return {name: value for name, value in values.items() if name not in others}

    def at(self, u: np.ndarray, n: int, tolerance: float = 0.0) -> At:
        """Return the parameters of an experiment and the error of the forces of its runs."""
        values = self.values(u)
        return At(values | self.own(values, n), math.hypot(tolerance, self.model_error))

    def model(self, u: np.ndarray) -> list[list[Any]] | None:
        """Return the model's value of each measurement; None if the parameters cannot be run."""
        self.tried.setdefault(u.tobytes(), u.copy())
        values, found = self.values(u), []
        for n in range(len(self.scenes)):
            own = self.own(values, n)
            key = (n, *self._changes(own, n).values())
            if key not in self.known:
                try:
                    self.known[key] = self.run(self._scene(own, n), n)
                except (SceneError, EquilibriumError) as error:
                    self.known[key], self.reason = None, str(error)
            found.append(self.known[key])
        return None if any(seen is None for seen in found) else found

    def run(self, scene: Scene, n: int) -> list[Any]:
        """Make a run as long as the measurements; return the value of each measurement in it."""
        self.runs += 1
        data = self.data[n]
        record = simulate(scene, self.durations([scene], [data])[0], **self.options)
        return [part.seen(record) for part in data]

    def compared(
        self, u: np.ndarray, kind: type[Any] = Measurement, tolerance: float = 0.0
    ) -> Iterator[tuple[Any, Any, At]]:
        """Yield each measurement of a kind, its value in a run, and the parameters."""
        for n, (together, seen) in enumerate(zip(self.data, self.model(u) or [], strict=False)):
            at = self.at(u, n, tolerance)
            pairs = zip(together, seen, strict=True)
            yield from ((part, has, at) for part, has in pairs if isinstance(part, kind))

    def misfits(self, u: np.ndarray) -> list[Misfit]:
        """Return the misfits of events that are compared one by one."""
        return [part.misfit(seen, at) for part, seen, at in self.compared(u, Events)]

    def counts(self, u: np.ndarray) -> tuple[int, int]:
        """Return the numbers of measured events missing in the model, and of extra model events."""
        found = self.misfits(u)
        return sum(each.missing for each in found), sum(each.extra for each in found)

    def overview(self, u: np.ndarray) -> np.ndarray:
        """Return the rough residuals of all measurements."""
        if self.model(u) is None:
            parts = ((part, n) for n, each in enumerate(self.data) for part in each)
            off = [part.none(self.at(u, n))[: part.of_overview] for part, n in parts]
            return np.concatenate(off)
        return np.concatenate([part.overview(seen, at) for part, seen, at in self.compared(u)])

    def residuals(self, u: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Return the residuals of all measurements, shape (size,)."""
        if self.model(u) is None:
            parts = ((part, n) for n, each in enumerate(self.data) for part in each)
            return np.concatenate([part.none(self.at(u, n, tolerance)) for part, n in parts])
        compared = self.compared(u, tolerance=tolerance)
        return np.concatenate([part.residuals(seen, at) for part, seen, at in compared])

    def chi2(self, u: np.ndarray, tolerance: float = 0.0) -> float:
        """Return the sum of squared residuals."""
        return float(np.sum(self.residuals(u, tolerance) ** 2))

    def fits(self, u: np.ndarray, tolerance: float = 0.0) -> bool:
        """Whether the sum of all squared residuals is as small as noise makes it."""
        return probability(self.chi2(u, tolerance), self.size - len(u)) >= DOUBTFUL

    def dof(self, u: np.ndarray) -> int:
        """Return the degrees of freedom: residuals that depend on parameters, minus parameters."""
        return sum(part.told(seen, at) for part, seen, at in self.compared(u)) - len(u)

    def scatter(self, u: np.ndarray, tolerance: float) -> float:
        """Return the RMS deviation of the model's forces, over F_N.

        The variance of the measurement is subtracted. Events are matched with a tolerance of
        forces, so that events with large deviations count, too.
        """
        found = [part.excess(seen, at) for part, seen, at in self.compared(u, tolerance=tolerance)]
        squares = np.concatenate([np.zeros(0), *found])
        return math.sqrt(max(float(squares.mean()), 0.0)) if squares.size else 0.0

    def tables(self, u: np.ndarray, *, one_by_one: bool) -> pd.DataFrame:
        """Return measured and model values: of events one by one, or of all other measurements."""
        parts, number = [], 0
        for number, (together, seen) in enumerate(zip(self.data, self.model(u) or [], strict=True)):
            at = self.at(u, number)
            for part, has in zip(together, seen, strict=True):
                if isinstance(part, Events) is one_by_one:
                    table = part.table(has, at)
                    table.insert(0, "curve", number + 1)
                    if not one_by_one:
                        table.insert(1, "kind", part.kind)
                    parts.append(table)
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    @functools.cached_property
    def notes(self) -> tuple[str, ...]:
        """Remarks on samples or events that were left out or may be missing."""
        pairs = zip(self.scenes, self.data, strict=True)
        said = (part.notes + part.doubts(scene) for scene, each in pairs for part in each)
        return tuple(dict.fromkeys(note for notes in said for note in notes))
