"""Residuals of parameters: runs of scenes, and how far they are from measurements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.engines import Options
from pyfric.fitting.misfits import CAP, PER_EVENT, Misfit, misfit, overview
from pyfric.fitting.results import DOUBTFUL, probability
from pyfric.fitting.sensors import arrivals_off, fronts_of, lengths_of, lengths_off
from pyfric.measured import events
from pyfric.planning import check_run, simulate
from pyfric.scene import SceneError
from pyfric.statics import EquilibriumError

OF_THE_CURVE = {"offset": "", "drift": "1/s"}
"""Parameters of a curve, not of a scene, and their units: a force added to it (over F_N), and one
per time."""
OTHERS = 4
"""Residuals of a curve that are not of its events."""
LONGER = 1.1
"""Time of runs over that of the measurement: a policy."""


@dataclass(frozen=True, kw_only=True)
class Data:
    """What was measured in one experiment.

    Attributes:
        table: events that are compared one by one; later: those of which means count.
        lengths, arrivals: see `pyfric.fitting.sensors`.
        t_end: end of the measurement, s.
    """

    table: pd.DataFrame
    later: pd.DataFrame | None = None
    lengths: pd.DataFrame | None = None
    arrivals: pd.DataFrame | None = None
    t_end: float

    @property
    def size(self) -> int:
        """Number of residuals."""
        parts = (len(part) for part in (self.lengths, self.arrivals) if part is not None)
        return (PER_EVENT * len(self.table) + OTHERS if len(self.table) else 0) + sum(parts)

    @property
    def of_overview(self) -> int:
        """Number of residuals of the overview."""
        return 2 * len(self.table) + (0 if self.lengths is None else len(self.lengths))

    @property
    def of_fronts(self) -> int:
        """Number of independent residuals of lengths and arrivals."""
        count = 0 if self.lengths is None else len(self.lengths)
        if self.arrivals is not None:
            count += len(self.arrivals) - self.arrivals["event"].nunique()
        return count


class Seen(NamedTuple):
    """What a run has of what was measured."""

    events: pd.DataFrame
    lengths: pd.DataFrame | None
    fronts: Mapping[float, np.ndarray] | None


class Problem:
    """Residuals of parameters between 0 and 1, for scenes and measurements."""

    def __init__(
        self,
        scenes: Sequence[Any],
        data: Sequence[Data],
        bounds: Mapping[str, tuple[float, float]],
        options: Mapping[str, Any],
        model_error: float,
    ) -> None:
        self.scenes, self.data, self.options = scenes, data, options
        self.names = list(bounds)
        self.low, self.high = (np.array(ends) for ends in zip(*bounds.values(), strict=True))
        self.model_error = model_error
        self.size = sum(each.size for each in data)
        self.known: dict[tuple[float, ...], list[Seen] | None] = {}
        self.runs = 0
        self.reason = ""  # why parameters had no run, the last time

    def can(self, engine: str) -> bool:
        """Whether an engine can run the scenes."""
        try:
            for scene in self.scenes:
                check_run(scene, Options(fidelity=engine))
        except SceneError:
            return False
        return True

    def check(self, starts: Sequence[np.ndarray]) -> None:
        """Refuse what no run can mend.

        Args:
            starts: parameters that are not on the bounds, in the middle, or at another round share.

        Raises:
            SceneError: an engine cannot run the scenes, none of the parameters is a scene, or there
                are as many parameters as numbers that were measured.
        """
        for scene in self.scenes:
            check_run(scene, Options(fidelity=self.options["fidelity"]))
        told = sum((PER_EVENT * len(d.table) + OTHERS) * bool(len(d.table)) for d in self.data)
        told += sum(each.of_fronts for each in self.data)
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
        """Refuse parameters at which nothing is compared.

        Raises:
            SceneError: residuals that tell something are no more than parameters.
        """
        if self.dof(u) > 0:
            return
        found = self.misfits(u) or []
        counts = sum(len(each.table) for each in self.data), sum(apart.missing for apart in found)
        reason = (
            f"at the best parameters the model has {counts[0] - counts[1]} of {counts[0]} events"
        )
        allowed = "bounds within which events of the model are those that were measured"
        raise SceneError("vary", ", ".join(self.names), "", allowed, reason)

    def values(self, u: np.ndarray) -> dict[str, float]:
        """Return the parameters by name."""
        return dict(zip(self.names, (self.low + u * (self.high - self.low)).tolist(), strict=True))

    def place(self, values: Mapping[str, float]) -> np.ndarray:
        """Return parameters by name as numbers between 0 and 1."""
        at = np.array([values[name] for name in self.names])
        return np.clip((at - self.low) / (self.high - self.low), 0, 1)

    def scenes_of(self, values: Mapping[str, float]) -> list[Any]:
        """Return the scenes with these parameters."""
        changes = {name: value for name, value in values.items() if name not in OF_THE_CURVE}
        return [scene.replace(**changes) for scene in self.scenes]

    def model(self, u: np.ndarray) -> list[Seen] | None:
        """Return what the model has of each measurement; None where it has no run."""
        values = self.values(u)
        of_scene = tuple(value for name, value in values.items() if name not in OF_THE_CURVE)
        if of_scene not in self.known:
            try:
                pairs = zip(self.scenes_of(values), self.data, strict=True)
                self.known[of_scene] = [self.run(scene, each) for scene, each in pairs]
            except (SceneError, EquilibriumError) as error:
                self.known[of_scene], self.reason = None, str(error)
        found = self.known[of_scene]
        offset, drift = (values.get(name, 0.0) for name in OF_THE_CURVE)
        if found is None or not (offset or drift):
            return found
        moved = []
        for seen in found:
            added = {
                name: seen.events[name] + offset + drift * seen.events[time]
                for name, time in (("peak", "t_start"), ("valley", "t_stop"))
            }
            moved.append(seen._replace(events=seen.events.assign(**added)))
        return moved

    def run(self, scene: Any, data: Data) -> Seen:
        """Return what a run as long as the measurement has of it."""
        self.runs += 1
        record = simulate(scene, LONGER * data.t_end, **self.options)
        return Seen(
            events(record, t_gap=data.table.attrs.get("resolution") or None),
            None if data.lengths is None else lengths_of(record),
            None if data.arrivals is None else fronts_of(record),
        )

    def misfits(self, u: np.ndarray, tolerance: float = 0.0) -> list[Misfit] | None:
        """Return the misfit of the events of each curve, None where there is no run."""
        model = self.model(u)
        if model is None:
            return None
        tolerance = math.hypot(tolerance, self.model_error)
        return [
            misfit(each.table, seen.events, tolerance=tolerance, later=each.later)
            for each, seen in zip(self.data, model, strict=True)
        ]

    def of_fronts(
        self, u: np.ndarray, found: Sequence[Misfit], tolerance: float = 0.0
    ) -> list[np.ndarray]:
        """Return the residuals of lengths and arrivals of each curve, given those of events."""
        parts = []
        tolerance = math.hypot(tolerance, self.model_error)
        model = self.model(u) or []
        for scene, each, seen, apart in zip(self.scenes, self.data, model, found, strict=True):
            off = [np.zeros(0)]
            if each.lengths is not None and seen.lengths is not None:
                off.append(lengths_off(each.lengths, seen.lengths, 1 / scene.N_x, tolerance))
            if each.arrivals is not None and seen.fronts is not None:
                starts = seen.events["t_start"].to_numpy()
                pairs = zip(each.table.index, apart.partner, strict=True)
                partner = {event: float(starts[k]) for event, k in pairs if k >= 0}
                off.append(arrivals_off(each.arrivals, partner, seen.fronts, scene.slider.l))
            parts.append(np.concatenate(off))
        return parts

    def overview(self, u: np.ndarray) -> np.ndarray:
        """Return the overviews of all curves, and residuals of lengths."""
        model = self.model(u)
        if model is None:
            return np.full(sum(each.of_overview for each in self.data), CAP)
        off = []
        for scene, each, seen in zip(self.scenes, self.data, model, strict=True):
            if len(each.table):
                off.append(overview(each.table, seen.events))
            if each.lengths is not None and seen.lengths is not None:
                off.append(lengths_off(each.lengths, seen.lengths, 1 / scene.N_x))
        return np.concatenate(off)

    def residuals(self, u: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Return the residuals of all curves, shape (size,)."""
        found = self.misfits(u, tolerance)
        if found is None:
            return np.full(self.size, CAP)
        of_events = [
            apart.residuals for each, apart in zip(self.data, found, strict=True) if len(each.table)
        ]
        return np.concatenate([*of_events, *self.of_fronts(u, found, tolerance)])

    def chi2(self, u: np.ndarray, tolerance: float = 0.0) -> float:
        """Return the sum of squares."""
        return float(np.sum(self.residuals(u, tolerance) ** 2))

    def fits(self, u: np.ndarray, tolerance: float = 0.0) -> bool:
        """Whether the residuals are those of noise, if all of them count: enough for a search."""
        return probability(self.chi2(u, tolerance), self.size - len(u)) >= DOUBTFUL

    def dof(self, u: np.ndarray) -> int:
        """Return the degrees of freedom: residuals that tell something, less parameters."""
        count = -len(u)
        for each, apart in zip(self.data, self.misfits(u) or [], strict=True):
            count += PER_EVENT * (len(each.table) - apart.missing) + each.of_fronts
            count += int(np.count_nonzero(apart.residuals[-OTHERS:]))
        return count

    def scatter(self, u: np.ndarray, tolerance: float) -> float:
        """Return the root of the mean square of forces by which events are off, over F_N.

        The variance of the measurement is taken away. Events are matched with a tolerance of
        forces, so that those that are far off count, too.
        """
        parts = [np.zeros(0)]
        model, found = self.model(u) or [], self.misfits(u, tolerance) or []
        for each, seen, apart in zip(self.data, model, found, strict=True):
            rows = np.flatnonzero(apart.partner >= 0)
            for name in ("peak", "valley"):
                known, error = (each.table[part].to_numpy() for part in (name, f"{name}_error"))
                off = seen.events[name].to_numpy()[apart.partner[rows]] - known[rows]
                parts.append(off**2 - error[rows] ** 2)
        squares = np.concatenate(parts)
        return math.sqrt(max(float(squares.mean()), 0.0)) if squares.size else 0.0
