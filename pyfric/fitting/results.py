"""What a fit has found: parameters, intervals, profiles, residuals, and whether the model fits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
import scipy

from pyfric.display import Shown

DOUBTFUL = 0.01
"""Probability of the residuals below which the model is said not to fit. A policy."""


def probability(chi2: float, dof: int) -> float:
    """Return the probability of a sum of squares at least this large, if the model is right."""
    return float(scipy.stats.chi2.sf(chi2, max(dof, 1)))


@dataclass(frozen=True, kw_only=True)
class Fit(Shown):
    """Parameters that fit measured events, and what is known of them.

    Attributes:
        scenes: the scenes with the best parameters, one for each curve.
        values: best parameters by name.
        intervals: name -> ends of the confidence interval; an end is NaN where the bound is reached
            before the misfit tells.
        profiles: name -> data frame with columns value and chi2, which assume `model_error`.
        level: confidence of the intervals.
        chi2, dof: sum of squares with the errors that were given, and degrees of freedom.
        table: measured events with columns curve, event, peak, valley, model_peak, model_valley
            (over F_N), off_peak, off_valley (standard deviations).
        missing, extra: events of the measurement that the model has not, and the reverse.
        engine: the engine of its runs.
        runs: number of runs that were made, also those of the search.
        bounds: name -> bounds that were searched.
        fronts: measured lengths of precursors and arrivals of fronts with their residuals: columns
            curve, kind ("lengths" or "arrivals"), at (force, or x in m), off (standard deviations).
        model_error: standard deviation of forces of the model, over F_N, that intervals assume: the
            one that was given, or by how much a model that does not fit is off, if that is more.
        notes: what was left out of the curves, and what their events may miss.
        problem: what makes its runs, for `pyfric.fitting.posterior`.
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
    fronts: pd.DataFrame = field(default_factory=pd.DataFrame)
    model_error: float = 0.0
    notes: tuple[str, ...] = ()
    problem: Any = field(default=None, repr=False, compare=False)

    @property
    def probability(self) -> float:
        """Of a sum of squares at least this large, if the model is right."""
        return probability(self.chi2, self.dof)

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
        counts = [f"chi^2 {self.chi2:.4g} with {self.dof} degrees of freedom"]
        if n := len(self.table):
            counts += [f"{n} events measured", f"{self.missing} missing in the model"]
            counts += [f"{self.extra} more in the model"]
        if len(self.fronts):
            counts += [f"{n} {kind}" for kind, n in self.fronts["kind"].value_counts().items()]
        lines.append(", ".join(counts))
        if not self.fits:
            assumed = f"may not hold; they assume forces that are off by {self.model_error:.2g} F_N"
            lines.append(
                f"THE MODEL DOES NOT FIT (probability {self.probability:.1g}): intervals "
                f"{assumed if self.model_error else 'do not hold'}; try another law, disorder, or "
                "another parameter"
            )
        lines.append(f"{self.runs} runs, {self.engine} at the end")
        lines += self.notes
        return "\n".join(lines)

    __repr__ = __str__


def _said(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.5g} to {bounds[1]:.5g}"
