"""Residuals of parameters: runs of scenes, and how far they are from measurements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pyfric.engines import Options
from pyfric.fitting.misfits import CAP, PER_EVENT, Misfit, misfit, overview
from pyfric.measured import events
from pyfric.planning import check_run, simulate
from pyfric.scene import SceneError
from pyfric.statics import EquilibriumError

OF_THE_CURVE = ("offset", "drift")
"""Parameters of a curve, not of a scene: a force added to it (over F_N), and one per time (1/s)."""
OTHERS = 4
"""Residuals of a curve that are not of its events."""
LONGER = 1.1
"""Time of runs over that of the measurement: a policy."""


class Problem:
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
