"""A whole measured curve as a measurement, for smooth responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

from pyfric.fitting.measurement import ROWS, At, Measurement, measurement
from pyfric.fitting.misfits import OF_FORCES
from pyfric.fitting.of_events import OF_THE_CURVE
from pyfric.measured import Curve, noise_of
from pyfric.record import Record
from pyfric.scene import Number
from pyfric.values import SceneError, check_number, check_whole

POINTS, PARTS = 500, 20
"""Largest number of means of a curve, and number of parts within which errors of a wrong model are
correlated (choices)."""


@measurement
@dataclass(frozen=True, repr=False, init=False)
class CurveOf(Measurement):
    """A loading curve as a whole: F_T/F_N at all times, for smooth responses.

    Means of consecutive samples are compared with means of the run over the same times.

    Args:
        curve: a curve with forces. Its first sample is at the time `start` of the run.
        error: standard deviation of a sample of F_T/F_N, > 0; None means the noise of the curve.
        points: largest number of means.
        start: time in the run at which the curve begins, s; 0 is the start of loading.

    Attributes:
        t_from, t_to: begin and end of each mean, s, shape (n,).
        f: means of F_T/F_N.
        error: standard deviations of the means.

    Raises:
        SceneError: an argument is refused; the curve has no forces or no noise.
    """

    kind: ClassVar[str] = "curve"
    own: ClassVar[dict[str, str]] = OF_THE_CURVE
    smooth: ClassVar[bool] = True
    engines: ClassVar[tuple[str, ...]] = ()
    t_from: np.ndarray
    t_to: np.ndarray
    f: np.ndarray
    error: np.ndarray

    def __init__(
        self,
        curve: Curve,
        *,
        error: float | None = None,
        points: int = POINTS,
        start: Number = 0.0,
    ) -> None:
        if not isinstance(curve, Curve) or not curve.has_forces:
            allowed = "a Curve with forces, as pyfric.measured.read makes of a file"
            raise SceneError("curve", type(curve).__name__, "", allowed, "no curve")
        points = check_whole("points", points, 8)
        begins = check_number("start", start, "s", ge=0.0)
        if error is None:
            error = noise_of(curve) if curve.noise is None else curve.noise
        allowed = "> 0: the standard deviation of a sample, where the curve tells none"
        if not check_number("error", error, "", ge=0.0) > 0:
            raise SceneError("error", error, "", allowed)
        f, t = curve.over_F_N, curve.t - curve.t[0] + begins
        kept = np.isfinite(f)
        f, t = f[kept], t[kept]
        edges = np.unique(np.linspace(0, len(t), min(points, len(t)) + 1).astype(int))
        first, counts = edges[:-1], np.diff(edges)
        half = 0.5 * float(np.median(np.diff(t))) * (counts > 1)
        found = {
            "t_from": np.maximum(t[first] - half, 0.0),
            "t_to": t[edges[1:] - 1] + half,
            "f": np.add.reduceat(f, first) / counts,
            "error": error / np.sqrt(counts),
        }
        for name, values in found.items():
            object.__setattr__(self, name, values)

    @property
    def duration(self) -> float:
        return float(self.t_to[-1])

    @property
    def size(self) -> int:
        return len(self.f)

    @property
    def groups(self) -> np.ndarray:
        return np.arange(self.size) * PARTS // self.size

    def seen(self, record: Record) -> np.ndarray:
        """Return means of F_T/F_N of a run over the times of the measured means, shape (n,)."""
        t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
        scene = record.scene
        varies = scene.load_at(0.0) is not None
        f = F_T / (np.array([scene.load_at(each)[0] for each in t]) if varies else scene.F_N)
        area = np.concatenate([[0.0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(t))])
        width = self.t_to - self.t_from
        ends = [_area_to(each, t, f, area) for each in (self.t_from, self.t_to)]
        means = np.divide(ends[1] - ends[0], width, out=np.zeros(len(width)), where=width > 0)
        return np.where(width > 0, means, np.interp(self.t_from, t, f))

    def _model(self, seen: np.ndarray, at: At) -> np.ndarray:
        offset, drift = (at.values.get(name, 0.0) for name in OF_THE_CURVE)
        return seen + offset + drift * 0.5 * (self.t_from + self.t_to)

    def residuals(self, seen: np.ndarray, at: At) -> np.ndarray:
        return (self._model(seen, at) - self.f) / np.hypot(self.error, at.tolerance)

    def overview(self, seen: np.ndarray, at: At) -> np.ndarray:
        return (self._model(seen, at) - self.f) / np.hypot(self.error, OF_FORCES)

    def none(self, at: At) -> np.ndarray:
        return (1 + np.abs(self.f)) / np.hypot(self.error, at.tolerance)

    def table(self, seen: np.ndarray, at: At) -> pd.DataFrame:
        model = self._model(seen, at)
        t = 0.5 * (self.t_from + self.t_to)
        columns = (t, self.f, self.error, model, (model - self.f) / self.error)
        return pd.DataFrame(dict(zip(ROWS, columns, strict=True)))

    def excess(self, seen: np.ndarray, at: At) -> np.ndarray:
        return (self._model(seen, at) - self.f) ** 2 - self.error**2


def _area_to(times: np.ndarray, t: np.ndarray, f: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return the integral of a piecewise linear curve up to each time in `times`."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    part = times - t[k]
    slope = np.divide(f[k + 1] - f[k], t[k + 1] - t[k], out=np.zeros(len(k)), where=t[k + 1] > t[k])
    return area[k] + part * (f[k] + 0.5 * slope * part)
