"""Measured events: one by one (`Events`), or as a population (`Sizes`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import pandas as pd

from pyfric.fitting.measurement import CAP, ROWS, At, Measurement, measurement
from pyfric.fitting.misfits import (
    FEWEST,
    LARGE,
    OF_COUNTS,
    OF_FORCES,
    PER_EVENT,
    Misfit,
    misfit,
    onset,
    overview,
)
from pyfric.measured import COLUMNS, Curve, events, sampled
from pyfric.record import Record
from pyfric.scene import Scene
from pyfric.values import SceneError

OTHERS = 4
"""Number of residuals of a curve that do not belong to single events."""
LONGER = 1.1
"""Duration of runs over the duration of the measurement (a choice)."""
OFF_LOAD = 0.05
"""Largest relative difference between the normal forces of a scene and its curve (a choice)."""
OF_THE_CURVE = {"offset": "", "drift": "1/s"}
"""Parameters of the curve itself, and their units: a constant force added to it, over F_N, and a
force per time."""
IN_A_ROW = 3
"""Number of consecutive events whose errors in a wrong model count as correlated (a choice)."""
POPULATION, ENOUGH = 8, 20
"""Fewest measured events of a population, and number of events that a run should have (choices)."""
LATER = 3.0
"""Longest time between events that the duration of a run allows for, over the time between events
of a slider that sticks (a choice)."""
SLIDES = 0.5
"""Rate of force between events, over the rate of a stuck slider, below which a note says that the
slider slides (a choice)."""
FAINT = 1e-3
"""Noise added to runs, over the noise of the curve. It makes all readings of a run different and
leaves means unchanged."""
NUMBERS = ("mean peak", "mean valley", "recurrence", "spread of peaks", "spread of valleys")
"""Statistics of a population. Forces are over F_N. The recurrence is the mean time between events,
in s. Spreads are standard deviations."""


def table_of(measured: Curve | pd.DataFrame) -> pd.DataFrame:
    """Return a table of events with the end of the measurement and the normal force in its attrs.

    Raises:
        SceneError: `measured` is no curve or table of events, has fewer than two events, or no
            errors of forces.
    """
    if isinstance(measured, Record):
        allowed = 'pyfric.measured.sampled(record, "0.5 ms", noise=1e-3), a curve as measured'
        raise SceneError("measured", "Record", "", allowed, "a run is no measurement")
    whole = isinstance(measured, Curve) and measured.has_forces
    table = events(measured) if whole else measured
    columns = getattr(table, "columns", ())
    if absent := [name for name in COLUMNS if name not in columns]:
        allowed = (
            "a Curve with forces, as pyfric.measured.read makes of a file, or the events of one"
        )
        reason = f"it has no {', '.join(absent)}"
        raise SceneError("measured", type(measured).__name__, "", allowed, reason)
    if isinstance(measured, Curve):
        table.attrs["t_end"] = float(measured.t[-1] - measured.t[0])
        table.attrs["F_N"] = _load(measured)
    else:
        table = table.copy()
        table.attrs = {"t_end": float(table["t_stop"].max()), **measured.attrs}
    if len(table) < 2:
        allowed = "a curve with two or more events; a smooth one is pyfric.fitting.CurveOf(curve)"
        raise SceneError("measured", len(table), "", allowed, "events")
    if not (table[["peak_error", "valley_error"]] > 0).all(axis=None):
        allowed = "events of a curve with noise: pyfric.measured.events(curve, noise=1e-3)"
        raise SceneError("measured", None, "", allowed, "forces without errors")
    return table


def _load(curve: Curve) -> float | None:
    """Return the normal force of a curve (N): the median of a column, or a constant."""
    return float(curve.table["F_N"].median()) if "F_N" in curve.table else curve.F_N


def moved(table: pd.DataFrame, at: At) -> pd.DataFrame:
    """Return events of a run with the offset and drift of the curve added to their forces."""
    offset, drift = (at.values.get(name, 0.0) for name in OF_THE_CURVE)
    if not (offset or drift):
        return table
    ends = (("peak", "t_start"), ("valley", "t_stop"))
    ends = {name: (table[name].to_numpy(), table[t].to_numpy()) for name, t in ends}
    return table.assign(**{name: F + offset + drift * t for name, (F, t) in ends.items()})


class _OfEvents(Measurement):
    """Measurements on the events of a loading curve."""

    own: ClassVar[dict[str, str]] = OF_THE_CURVE
    whole: pd.DataFrame

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(self.whole.attrs.get("notes", ()))

    def check(self, scene: Scene) -> None:
        F_N = self.whole.attrs.get("F_N")
        if F_N is None or scene.load_at(0.0) is not None:
            return
        if abs(scene.F_N / F_N - 1) > OFF_LOAD:
            allowed = f"that of the curve, {F_N:.4g} N, within {OFF_LOAD:.0%}"
            raise SceneError("F_N", scene.F_N, "N", allowed, "the scene has another load")

    def seen(self, record: Record) -> pd.DataFrame:
        return events(record, t_gap=self.whole.attrs.get("resolution") or None)


@measurement
@dataclass(frozen=True, repr=False, init=False)
class Events(_OfEvents):
    """Events of a loading curve, compared one by one.

    Args:
        measured: curve, or its table of events (`pyfric.measured.events`).
        part: which events are compared one by one. "onset": events before the first large event (a
            fifth of the largest drop); large events are compared by their mean forces. "all": all
            events, for periodic sequences.

    Attributes:
        whole: table of all events.
        one_by_one: table of the events that are compared one by one.
        later: table of the later events, whose mean forces are compared; None with part = "all".

    Raises:
        SceneError: an argument is refused; the curve has fewer than two events, or no noise.
    """

    kind: ClassVar[str] = "events"
    whole: pd.DataFrame
    one_by_one: pd.DataFrame
    later: pd.DataFrame | None

    def __init__(
        self, measured: Curve | pd.DataFrame, part: Literal["onset", "all"] = "onset"
    ) -> None:
        if part not in ("onset", "all"):
            raise SceneError("part", part, "", "'onset' or 'all'")
        whole = table_of(measured)
        first = onset(whole) if part == "onset" else whole
        object.__setattr__(self, "whole", whole)
        object.__setattr__(self, "one_by_one", first)
        later = whole.iloc[len(first) :] if part == "onset" else None
        object.__setattr__(self, "later", later)

    @property
    def onset_is_whole(self) -> bool:
        """Whether all events are compared one by one, because the curve has no first loading."""
        return len(self.one_by_one) == len(self.whole)

    @property
    def duration(self) -> float:
        return LONGER * float(self.whole.attrs["t_end"])

    @property
    def size(self) -> int:
        return PER_EVENT * len(self.one_by_one) + OTHERS

    @property
    def of_overview(self) -> int:
        return PER_EVENT * len(self.one_by_one)

    @property
    def groups(self) -> np.ndarray:
        n = len(self.one_by_one)
        number = np.arange(n) // IN_A_ROW
        return np.concatenate([number, number, n + np.arange(OTHERS)])

    def misfit(self, seen: pd.DataFrame, at: At) -> Misfit:
        """Return the misfit of the events of a run, with the matches."""
        model = moved(seen, at)
        return misfit(self.one_by_one, model, tolerance=at.tolerance, later=self.later)

    def residuals(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        return self.misfit(seen, at).residuals

    def overview(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        return overview(self.one_by_one, moved(seen, at))

    def told(self, seen: pd.DataFrame, at: At) -> int:
        apart = self.misfit(seen, at)
        matched = len(self.one_by_one) - apart.missing
        return PER_EVENT * matched + int(np.count_nonzero(apart.residuals[-OTHERS:]))

    def table(self, seen: pd.DataFrame, at: At) -> pd.DataFrame:
        table, apart, n = self.one_by_one, self.misfit(seen, at), len(self.one_by_one)
        found = table[["t_start", "peak", "valley", "peak_error", "valley_error"]].copy()
        found.insert(0, "event", table.index)
        for k, name in enumerate(("peak", "valley")):
            model = np.append(moved(seen, at)[name], np.nan)
            found[f"model_{name}"] = model[apart.partner]
            found[f"off_{name}"] = apart.residuals[k * n : (k + 1) * n]
        return found

    def excess(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        partner, model = self.misfit(seen, at).partner, moved(seen, at)
        rows, parts = np.flatnonzero(partner >= 0), []
        for name in ("peak", "valley"):
            known, error = (
                self.one_by_one[part].to_numpy()[rows] for part in (name, f"{name}_error")
            )
            parts.append((model[name].to_numpy()[partner[rows]] - known) ** 2 - error**2)
        return np.concatenate(parts)


@measurement
@dataclass(frozen=True, repr=False, init=False)
class Sizes(_OfEvents):
    """Large events of a loading curve as a population: mean forces, recurrence, and spreads.

    `Sizes` is for irregular sequences, in which single events of model and measurement do not
    match. Large events have at least a fifth of the largest drop. Standard errors of the means,
    measured and of the run, include the scatter from event to event and its correlation along the
    sequence (Newey and West). Runs are sampled with the step of the curve, and their events are
    found as in the curve. Sampling, and vibrations after events, therefore affect runs and
    measurement alike.

    Args:
        measured: curve, or its table of events (`pyfric.measured.events`).
        spreads: whether standard deviations of forces are compared, too. The parameter "scatter" is
            a standard deviation of forces from event to event, over F_N, that is added to the
            scatter of the model.

    Attributes:
        whole: table of all events.

    Raises:
        SceneError: an argument is refused; the curve has fewer than eight large events, or no
            noise.

    Source: W. K. Newey and K. D. West, Econometrica 55, 703 (1987).
    """

    kind: ClassVar[str] = "sizes"
    own: ClassVar[dict[str, str]] = OF_THE_CURVE | {"scatter": ""}
    smooth: ClassVar[bool] = True
    whole: pd.DataFrame
    spreads: bool

    def __init__(self, measured: Curve | pd.DataFrame, *, spreads: bool = True) -> None:
        object.__setattr__(self, "whole", table_of(measured))
        object.__setattr__(self, "spreads", spreads)
        if (n := len(large(self.whole))) < POPULATION:
            allowed = f"a curve with {POPULATION} or more large events"
            raise SceneError("measured", n, "", allowed, "events are no population")

    @property
    def duration(self) -> float:
        """Longest duration of a run, s: `LONGER` times the duration of the measurement."""
        return LONGER * float(self.whole.attrs["t_end"])

    def lasts(self, scene: Scene) -> float:
        """Return the time of a first loading and enough events, s, at most `duration`.

        Loading times follow from the speed and stiffness of the driver. The measured rate of force
        is too small if the slider slides between events.
        """
        table, rate = large(self.whole), self._loading(scene)
        if not rate > 0:
            return self.duration
        apart = min(table["t_start"].diff().mean(), LATER * table["drop"].mean() / rate)
        return min(self.duration, LONGER * float(table["peak"].mean() / rate + ENOUGH * apart))

    def _loading(self, scene: Scene) -> float:
        """Return the mean rise of F_T/F_N of a slider that sticks, 1/s."""
        t_end = float(self.whole.attrs["t_end"])
        return scene.driver.K * abs(scene.drive(t_end)) / (t_end * scene.F_N)

    def doubts(self, scene: Scene) -> tuple[str, ...]:
        """Return a note if the slider slides between events."""
        stuck = self._loading(scene)
        share = float(self.whole["rate"].median()) / stuck if stuck else np.nan
        if not share < SLIDES:
            return ()
        said = f"forces rise between events by {share:.2g} of what they would if the slider stuck"
        return (f"{said}: it slides there, and events tell little of mu_s",)

    def seen(self, record: Record) -> pd.DataFrame:
        attrs = self.whole.attrs
        if not attrs.get("resolution") or not attrs.get("noise"):
            return super().seen(record)
        how = {name: attrs[name] for name in ("noise", "smooth", "threshold")}
        step = attrs["resolution"] / attrs["smooth"]
        return events(sampled(record, step, noise=FAINT * attrs["noise"]), **how)

    @property
    def size(self) -> int:
        return len(NUMBERS) if self.spreads else 3

    def told(self, seen: pd.DataFrame, at: At) -> int:
        return self.size if len(large(seen)) >= FEWEST else 0

    def residuals(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        if not self.told(seen, at):
            return self.none(at)
        known, found = _numbers(self.whole), self._of_model(seen, at)
        off = found[0] - known[0]
        error = known[1] + found[1] + at.tolerance**2 * np.diag(_of_forces(known[0]) ** 2)
        means = np.linalg.solve(np.linalg.cholesky(error), off[:3])
        spreads = off[3:] / np.hypot(np.hypot(known[2], found[2]), at.tolerance)
        return np.concatenate([means, spreads if self.spreads else spreads[:0]])

    def overview(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        if not self.told(seen, at):
            return self.none(at)
        known, found = (
            of[0][: self.size] for of in (_numbers(self.whole), self._of_model(seen, at))
        )
        units = np.full(self.size, OF_FORCES)
        units[2] = OF_COUNTS * known[2]
        return (found - known) / units

    def none(self, at: At) -> np.ndarray:
        return np.full(self.size, CAP * CAP)

    def table(self, seen: pd.DataFrame, at: At) -> pd.DataFrame:
        known = _numbers(self.whole)
        error = np.append(np.sqrt(np.diag(known[1])), known[2])
        model, off = np.full(len(NUMBERS), np.nan), np.full(len(NUMBERS), np.nan)
        if self.told(seen, at):
            model, off[: self.size] = self._of_model(seen, at)[0], self.residuals(seen, at)
        rows = zip(NUMBERS, known[0], error, model, off, strict=True)
        return pd.DataFrame(rows, columns=list(ROWS))

    def excess(self, seen: pd.DataFrame, at: At) -> np.ndarray:
        if not self.told(seen, at):
            return np.full(3, np.inf)
        known = _numbers(self.whole)
        off = (self._of_model(seen, at)[0] - known[0])[:3]
        return (off**2 - np.diag(known[1])) / _of_forces(known[0]) ** 2

    def _of_model(self, seen: pd.DataFrame, at: At) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the statistics of a run from its first large event on, and their errors."""
        model = moved(seen, at)
        first = np.flatnonzero(model["drop"] >= LARGE * model["drop"].max())[0]
        found, of_means, of_spreads = _numbers(model.iloc[first:])
        errors = large(self.whole)[["peak_error", "valley_error"]]
        of_noise = np.sqrt((errors**2).mean().to_numpy())
        found[3:] = np.hypot(np.hypot(found[3:], of_noise), at.values.get("scatter", 0.0))
        return found, of_means, of_spreads


def large(table: pd.DataFrame) -> pd.DataFrame:
    """Return the large events of a table."""
    return table[table["drop"] >= LARGE * table["drop"].max()] if len(table) else table


def _of_forces(numbers: np.ndarray) -> np.ndarray:
    """Return the errors of the three means for an error F_N of each force.

    The recurrence is proportional to the drop, which has the errors of both forces.
    """
    peak, valley, recurrence = numbers[:3]
    return np.array([1.0, 1.0, np.sqrt(2) * recurrence / (peak - valley)])


def _numbers(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `NUMBERS`, the covariance of the three means, and standard errors of the spreads."""
    part = large(table)
    rows = part[["peak", "valley"]].assign(time=part["t_start"].diff()).to_numpy()[1:]
    means = rows.mean(axis=0)
    off, n = rows - means, len(rows)
    covariance, lags = off.T @ off / n, int(n ** (1 / 3))
    for lag in range(1, lags + 1):
        lagged = off[lag:].T @ off[:-lag] / n
        covariance = covariance + (1 - lag / (lags + 1)) * (lagged + lagged.T)
    if known := [name for name in ("peak_error", "valley_error") if name in part]:
        covariance = covariance + np.diag([*(part[known] ** 2).mean(), 0.0])
    forces = part[["peak", "valley"]].std(ddof=1).to_numpy()
    spreads = forces / np.sqrt(2 * max(len(part) - 1, 1))
    return np.concatenate([means, forces]), covariance / n, spreads
