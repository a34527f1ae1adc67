"""The result of a fit: parameters, intervals, profiles, residuals, and whether the model fits."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import pandas as pd

from pyfric.display import Shown
from pyfric.fitting.measurement import Together, packed, unpacked
from pyfric.fitting.problem import DOUBTFUL, Problem, probability, wider
from pyfric.fitting.profiles import Profiles, known_of
from pyfric.scene import Scene
from pyfric.values import SceneError, check_number, read_at_most, write

OF_FRONTS = ("lengths", "arrivals")
"""Kinds of measurements of fronts."""
FORMAT = "pyfric fit 1"
"""First entry of the file of a fit."""
AT_BOUND = 0.01
"""Distance from a bound, over the width of the bounds, within which a parameter is at this bound (a
choice)."""


@dataclass(frozen=True, kw_only=True)
class Fit(Shown):
    """Parameters that fit measurements, with intervals and residuals.

    Attributes:
        scenes: the scenes with the best parameters, one for each curve.
        values: best parameters by name.
        intervals: name -> ends of the confidence interval. An end is NaN if the bound comes before
            the limit of the misfit.
        profiles: name -> data frame with columns value and chi2, which assume `model_error`.
        level: confidence of the intervals.
        chi2, dof: sum of squared residuals with the given errors, and degrees of freedom.
        table: measured events with columns curve, event, peak, valley, model_peak, model_valley
            (over F_N), off_peak, off_valley (standard deviations).
        missing, extra: number of measured events missing in the model, and of extra model events.
        others: measured and model values of other quantities than events: columns curve, kind (of
            measurement), at (place in it), measured, error, model, off (standard deviations).
        engine: engine of the runs of the fit.
        runs: number of runs, including the search.
        bounds: name -> bounds of the search.
        model_error: standard deviation of the model's forces, over F_N, that intervals assume. If
            the model does not fit, the error is the larger of the given error and the deviation of
            the model.
        notes: remarks on samples and events that were left out or may be missing.
        problem: the scenes, measurements and runs, for profiles and `pyfric.fitting.posterior`.
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
    others: pd.DataFrame = field(default_factory=pd.DataFrame)
    model_error: float = 0.0
    notes: tuple[str, ...] = ()
    problem: Any = field(default=None, repr=False, compare=False)

    @classmethod
    def of(
        cls,
        problem: Problem,
        found: Profiles,
        level: float,
        notes: tuple[str, ...] = (),
    ) -> Self:
        """Return the fit with the parameters and profiles in `found`."""
        u = found.u
        missing, extra = problem.counts(u)
        values = problem.values(u)
        return cls(
            scenes=tuple(problem.scenes_of(values)),
            values=values,
            intervals=found.intervals,
            profiles=found.profiles,
            level=level,
            chi2=problem.chi2(u),
            dof=problem.dof(u),
            table=problem.tables(u, one_by_one=True),
            missing=missing,
            extra=extra,
            engine=problem.options["fidelity"],
            runs=problem.runs,
            bounds=problem.bounds,
            others=problem.tables(u, one_by_one=False),
            model_error=found.model_error,
            notes=notes + problem.notes,
            problem=problem,
        )

    def profiled(
        self, level: float = 0.9, *, progress: Callable[[str], None] | None = None
    ) -> Self:
        """Return the fit with profiles and intervals, at the confidence `level`.

        Raises:
            SceneError: level is refused.
        """
        level = check_number("level", level, "", gt=0.0, lt=1.0)
        problem = self.problem
        found = known_of(
            problem, problem.place(self.values), level, progress or (lambda text: None)
        )
        notes = tuple(note for note in self.notes if note not in problem.notes)
        return type(self).of(problem, found, level, notes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the fit and its measurements as JSON, and return the path.

        The fit that `load` returns can give profiles, posterior and page, too.

        Raises:
            OSError: the file cannot be written; an existing file is then unchanged.
            SceneError: the suffix belongs to another format.
        """
        problem = self.problem
        content = {
            part.name: packed(getattr(self, part.name))
            for part in dataclasses.fields(self)
            if part.name not in ("scenes", "problem")
        }
        made = {
            "scenes": [scene.to_toml() for scene in problem.scenes],
            "data": [[packed(part) for part in each] for each in problem.data],
            "options": packed(dict(problem.options)),
            "model_error": problem.model_error,
        }
        whole = {"format": FORMAT, "fit": content, "problem": made}
        text = json.dumps(whole, allow_nan=False, default=str)
        return write(path, text.encode(), ".json")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Return the fit in a file that `save` wrote.

        Raises:
            SceneError: the file cannot be read, or holds no fit.
        """
        try:
            whole = json.loads(read_at_most(path))
            if whole["format"] != FORMAT:
                raise ValueError(whole["format"])
            content = {name: unpacked(value) for name, value in whole["fit"].items()}
            made = whole["problem"]
            problem = Problem(
                [Scene.from_toml(text) for text in made["scenes"]],
                [Together(unpacked(part) for part in each) for each in made["data"]],
                content["bounds"],
                unpacked(made["options"]),
                made["model_error"],
            )
            problem.runs = content["runs"]
            scenes = tuple(problem.scenes_of(content["values"]))
            return cls(scenes=scenes, problem=problem, **content)
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            reason = getattr(error, "strerror", None) or f"no fit in it: {error}"
            allowed = "a file that Fit.save of this version wrote"
            raise SceneError("path", os.fspath(path), "", allowed, reason) from None

    @property
    def fronts(self) -> pd.DataFrame:
        """The rows of `others` on lengths of precursors and arrivals of fronts."""
        return self.others[self.others["kind"].isin(OF_FRONTS)] if len(self.others) else self.others

    @property
    def at_bounds(self) -> dict[str, tuple[float, float]]:
        """Name -> wider bounds, for each parameter at one of its bounds.

        If the model does not fit, parameters whose interval has only one end are included.
        """
        found = {}
        for name, value in self.values.items():
            low, high = self.bounds[name]
            share = (value - low) / (high - low)
            ends = [math.isnan(end) for end in self.intervals.get(name, (0.0, 0.0))]
            open_ends = ends if sum(ends) == 1 and not self.fits else [False, False]
            if share < AT_BOUND or open_ends[0]:
                found[name] = wider(low, high, -1)
            elif share > 1 - AT_BOUND or open_ends[1]:
                found[name] = wider(low, high, 1)
        return found

    @property
    def probability(self) -> float:
        """Probability of a sum of squares at least this large if the model is right."""
        return probability(self.chi2, self.dof)

    @property
    def fits(self) -> bool:
        """Whether the residuals are as small as noise: `probability` at least 0.01."""
        return self.probability >= DOUBTFUL

    def __str__(self) -> str:
        lines = []
        for name, value in self.values.items():
            if name not in self.intervals:
                lines.append(f"{name} = {value:.5g}")
                continue
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
        counts = [f"chi^2 {self.chi2:.4g} with {self.dof} degrees of freedom"]
        if n := len(self.table):
            counts += [f"{n} events measured", f"{self.missing} missing in the model"]
            counts += [f"{self.extra} more in the model"]
        if len(self.others):
            kinds = self.others["kind"].value_counts()
            counts += [f"{n} {WORDS.get(str(kind), kind)}" for kind, n in kinds.items()]
        lines.append(", ".join(counts))
        if not self.fits:
            assumed = (
                f"assume forces that are off by {self.model_error:.2g} F_N"
                if self.model_error
                else "are wider by the root of chi^2 over its degrees of freedom"
            )
            lines.append(
                f"THE MODEL DOES NOT FIT (probability {self.probability:.1g}): intervals "
                f"{assumed}, and may not hold; try another law, disorder, or another parameter"
            )
        for name, (low, high) in self.at_bounds.items():
            lines.append(f"{name} sits at its bound: widen its bounds to {_said((low, high))}")
        lines.append(f"{self.runs} runs, {self.engine} at the end")
        lines += self.notes
        return "\n".join(lines)

    __repr__ = __str__


WORDS = {
    "known": "known before",
    "curve": "points of curves",
    "sizes": "numbers of populations",
}
"""Kind of measurement -> words for its values in a text."""


def _said(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.5g} to {bounds[1]:.5g}"
