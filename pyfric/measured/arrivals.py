"""Arrivals of fronts at slip sensors, in the form that `pyfric.fit` takes.

A front arrives at a sensor when slip begins there. Slip is fitted, by least squares, by a line that
is level before this time and has a constant slope after it. The fit uses the samples before a step
and the first part of its rise. If slip begins smoothly, the time of the corner is late by about the
same amount at all sensors. Only differences of arrivals count in a fit.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from pyfric.measured.curve import Curve
from pyfric.measured.picking import NEAR, events
from pyfric.values import SceneError, check_number

PART = 0.25
"""Part of the slip of an event up to which the rise is fitted by a line (a choice)."""
FEWEST = 3
"""Fewest samples of a rise from which its speed is fitted (a choice). With fewer samples, slip is
taken to begin between two samples."""


def arrivals(
    table: pd.DataFrame,
    sensors: Mapping[float, Curve],
    *,
    within: float | str | None = None,
) -> pd.DataFrame:
    """Return the times at which fronts arrived at slip sensors.

    Args:
        table: events of the loading curve (`pyfric.measured.events`).
        sensors: place from the trailing edge, m -> curve with slip, with the same zero of time.
        within: longest time between an event and its slip, s; None means the sum of the resolutions
            of both curves.

    Returns:
        A data frame with a row for each event and each sensor that slipped. Columns: event (number
        in the table), x (m), t and error (s). If a sensor slips twice, the first time counts.

    Raises:
        SceneError: an argument is refused, or no sensor slips in an event.
    """
    if within is not None:
        within = check_number("within", within, "s", ge=0.0)
    if not isinstance(sensors, Mapping) or not all(
        isinstance(curve, Curve) for curve in sensors.values()
    ):
        raise SceneError("sensors", type(sensors).__name__, "", "a dict: place -> Curve with slip")
    rows = []
    for place, curve in sensors.items():
        x = check_number("sensors", place, "m", ge=0.0)
        steps = events(curve, column="slip")
        far = within
        if far is None:
            far = table.attrs.get("resolution", 0.0) + steps.attrs["resolution"]
        seen = set()
        for _, step in steps.iterrows():
            t, error = _corner(curve, step, steps.attrs)
            off = np.maximum(table["t_start"] - t, t - table["t_stop"])
            if len(off) and off.min() <= far and (event := off.idxmin()) not in seen:
                seen.add(event)
                rows.append((event, x, t, error))
    if not rows:
        allowed = "sensors that slip in events of the table, with the same zero of time"
        raise SceneError("sensors", len(sensors), "", allowed, "none does")
    found = pd.DataFrame(rows, columns=["event", "x", "t", "error"])
    return found.sort_values(["event", "x"], ignore_index=True)


def _corner(curve: Curve, step: pd.Series, attrs: Mapping[str, float]) -> tuple[float, float]:
    """Return the start of a step of slip and its standard error, in s."""
    kept = np.isfinite(curve.table["slip"])
    t, slip = curve.t[kept], curve.table["slip"].to_numpy()[kept]
    apart = NEAR * int(attrs["smooth"])
    start, stop = np.searchsorted(t, [step["t_start"], step["t_stop"]])
    rise = slip[start : stop + 1] > step["before"] + PART * step["slip"]
    end = start + int(np.argmax(rise)) if rise.any() else stop
    near = slice(max(start - apart, 0), max(end, start + 1) + 1)
    t, slip = t[near], slip[near]
    middles = 0.5 * (t[1:] + t[:-1])
    fits = [_broken(t, slip, middle) for middle in middles]
    k = int(np.argmin([left for left, _ in fits]))
    at, speed = middles[k], fits[k][1]
    error = (t[k + 1] - t[k]) / np.sqrt(12)
    later = t > at
    if later.sum() >= FEWEST and attrs["noise"]:
        slopes = np.stack([np.ones(len(t)), np.maximum(t - at, 0.0), -speed * later], axis=1)
        scale = np.abs(slopes).max(axis=0)
        variances = np.diag(np.linalg.pinv((slopes / scale).T @ (slopes / scale))) / scale**2
        error = np.hypot(error, attrs["noise"] * np.sqrt(variances[2]))
    return float(at), float(error)


def _broken(t: np.ndarray, slip: np.ndarray, at: float) -> tuple[float, float]:
    """Return the sum of squared residuals, and the slope, of a line with its corner at a time."""
    shape = np.stack([np.ones(len(t)), np.maximum(t - at, 0.0)], axis=1)
    scale = shape.max(axis=0)
    found = np.linalg.lstsq(shape / scale, slip, rcond=None)[0] / scale
    return float(np.sum((slip - shape @ found) ** 2)), float(found[1])
