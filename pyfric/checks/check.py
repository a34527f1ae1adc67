"""A value that has to stay within a tolerance, and what is measured to get one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

__all__ = ["Check", "largest", "rms"]


@dataclass(frozen=True)
class Check:
    """A value that has to stay within a tolerance.

    Attributes:
        name: what was measured.
        value: not negative; NaN where there was nothing to measure.
        tolerance: largest value that holds.
        unit: of both; "" for pure numbers.
        why: the reason of the tolerance.
    """

    name: str
    value: float
    tolerance: float
    unit: str = ""
    why: str = ""

    @property
    def holds(self) -> bool:
        """Whether the value is within the tolerance; NaN never is."""
        return bool(self.value <= self.tolerance)

    def __str__(self) -> str:
        verdict = "holds" if self.holds else "FAILS"
        number = f"{self.value:.3g} {self.unit}".strip()
        return f"{verdict}: {self.name}: {number} (up to {self.tolerance:.3g})"


def largest(error: np.ndarray | list[float]) -> float:
    """Largest size, NaN if one is missing or there are none."""
    return float(np.max(np.abs(error))) if len(error) else math.nan


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error)))) if len(error) else math.nan
