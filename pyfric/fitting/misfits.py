"""Misfit of two tables of events: which events match, and how much they differ.

Far from the best parameters, all matches may be shifted by one event. Each shift is a local minimum
of the misfit. `overview` avoids these minima. `overview` compares the force of events and their
number as functions of the load. The load is the force of an event plus all drops before it.

Near the best parameters, events are matched in their order. Times of events do not count: in
stick-slip, a small difference of the period becomes a large difference of times. Residuals are the
forces at both ends of each event, with correlated errors, and the rate of loading between events.
The matching minimises the sum of squares (dynamic programming). The residual of an unmatched event
is the part of its drop above the threshold. No residual exceeds `CAP`. The residual of an unmatched
measured event is at least `ALONE`, so that noise does not separate a pair. Events of the model
before the first and after the last match do not count, because the times at which a measurement
begins and ends are arbitrary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pyfric.fitting.measurement import CAP

ALONE = 3.0
"""Smallest residual of an unmatched measured event, in standard deviations. Noise gives one matched
pair in ninety a larger residual (chi^2 with two degrees of freedom)."""
OF_FORCES, OF_COUNTS = 3e-3, 0.2
"""Standard deviations in the overview: of forces over F_N, and of numbers of events (choices)."""
LARGE = 0.2
"""Smallest drop of a large event, over the largest drop (a choice)."""
FEWEST = 3
"""Fewest large events whose mean is compared (a choice)."""
PER_EVENT = 2
"""Number of residuals of a measured event: at its start and its end."""
COMPARED = ["peak", "valley", "drop", "peak_error", "valley_error", "drop_error", "rate"]
"""Columns of tables of events that a misfit compares."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """Differences of a model from a table of measured events.

    Attributes:
        residuals: in standard deviations, shape (2 n + 4,): forces at the starts and at the ends of
            the n measured events; the rate of loading; unmatched events of the model; mean forces
            at starts and at ends of large events.
        partner: matching row of the model for each measured event, -1 without a match, shape (n,).
        extra: number of unmatched events of the model between matches, above the threshold.
    """

    residuals: np.ndarray
    partner: np.ndarray
    extra: int

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def missing(self) -> int:
        """Number of measured events without a match in the model."""
        return int((self.partner < 0).sum())


def onset(table: pd.DataFrame) -> pd.DataFrame:
    """Return the events before the first large event, or all if these are fewer than `FEWEST`."""
    large = np.flatnonzero(table["drop"] >= LARGE * table["drop"].max())
    return table.iloc[: large[0]] if len(large) and large[0] >= FEWEST else table


def misfit(
    measured: pd.DataFrame,
    model: pd.DataFrame,
    *,
    tolerance: float = 0.0,
    later: pd.DataFrame | None = None,
) -> Misfit:
    """Return the differences of the events of a model from measured events.

    Args:
        measured, model: tables of `pyfric.measured.events`. Errors are taken from `measured`.
        later: further measured events; of these, only the mean forces of large events count.
        tolerance: standard deviation of forces added to the errors, over F_N.
    """
    n, m = len(measured), len(model)
    known, found = _columns(measured), _columns(model)
    off = _off(known, found, tolerance)
    threshold = measured.attrs.get("threshold", 0.0)
    of_drop = np.hypot(known["drop_error"], np.sqrt(2) * tolerance)
    of_drop = np.maximum(of_drop, np.finfo(float).tiny)
    alone = np.clip((known["drop"] - threshold) / of_drop, ALONE, CAP)
    typical = float(np.median(of_drop)) if n else 1.0
    unseen = np.clip((found["drop"] - threshold) / typical, 0.0, CAP)
    cost = np.minimum(off["peak"] ** 2 + off["valley"] ** 2, 2 * CAP**2)
    partner = _matched(cost, alone**2, unseen**2)
    rows = np.flatnonzero(partner >= 0)
    at_start = np.sqrt(alone**2 / 2)
    at_end = at_start.copy()
    for residuals, name in ((at_start, "peak"), (at_end, "valley")):
        residuals[rows] = np.clip(off[name][rows, partner[rows]], -CAP, CAP)
    between = np.zeros(m, dtype=bool)
    if len(rows):
        between[partner[rows[0]] : partner[rows[-1]]] = True
        between[partner[rows]] = False
    extra = unseen[between]
    other = [_rate_off(known["rate"], found["rate"]), float(np.sqrt(np.sum(extra**2)))]
    other += _means_off(later, model, tolerance)
    return Misfit(
        residuals=np.concatenate([at_start, at_end, other]),
        partner=partner,
        extra=int((extra > 1).sum()),
    )


def _columns(table: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return the columns `COMPARED` as arrays.

    Converting all columns at once takes a tenth of the time of converting each column.
    """
    of = dict(zip(table.columns, table.to_numpy().T, strict=True))
    return {name: of[name].astype(float) for name in COMPARED}


def _off(
    measured: dict[str, np.ndarray], model: dict[str, np.ndarray], tolerance: float
) -> dict[str, np.ndarray]:
    """Return differences of forces at both ends of events, in standard deviations, each (n, m).

    The error of the time of an event contributes to both ends. The covariance is c = (s_peak^2 +
    s_valley^2 - s_drop^2)/2. The second residual is the difference of valleys minus c/s_peak^2
    times the difference of peaks, which makes both residuals independent.
    """
    variances = {
        name: measured[f"{name}_error"][:, None] ** 2 for name in ("peak", "valley", "drop")
    }
    shared = 0.5 * (variances["peak"] + variances["valley"] - variances["drop"])
    peak, valley = (variances[name] + tolerance**2 for name in ("peak", "valley"))
    peak = np.maximum(peak, np.finfo(float).tiny)
    own = np.maximum(valley - shared**2 / peak, np.finfo(float).tiny)
    of_peak, of_valley = (
        model[name][None, :] - measured[name][:, None] for name in ("peak", "valley")
    )
    of_valley = of_valley - shared / peak * of_peak
    return {"peak": of_peak / np.sqrt(peak), "valley": of_valley / np.sqrt(own)}


def overview(measured: pd.DataFrame, model: pd.DataFrame) -> np.ndarray:
    """Return rough residuals of forces and numbers of events, without matching, shape (2 n,).

    An event has a weight by its drop: 0 below half the threshold of the measurement, 1/2 at the
    threshold, 1 from 1.5 times the threshold on. Numbers of events may differ by a constant,
    because small early events may be lost in noise.
    """
    threshold = measured.attrs.get("threshold", 0.0)

    def load_and_count(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
        drop = table["drop"].to_numpy()
        seen = np.clip(drop / threshold - 0.5, 0.0, 1.0) if threshold else np.ones(len(drop))
        return table["peak"].to_numpy() + np.cumsum(drop * seen) - drop * seen, np.cumsum(seen)

    at, count = load_and_count(measured)
    known, of_model = (np.append(0.0, values) for values in load_and_count(model))
    forces = np.append(0.0, model["peak"].to_numpy())
    off = np.interp(at, known, forces) - measured["peak"].to_numpy()
    more = np.interp(at, known, of_model) - count
    return np.concatenate([off / OF_FORCES, (more - np.median(more)) / OF_COUNTS])


def _means_off(
    later: pd.DataFrame | None, model: pd.DataFrame, tolerance: float
) -> tuple[float, float]:
    """Return differences of mean forces of large events after the first, in standard deviations."""
    if later is None:
        return 0.0, 0.0
    parts = [later, model.iloc[len(onset(model)) :]]
    parts = [part[part["drop"] >= LARGE * part["drop"].max()] for part in parts]
    if min(map(len, parts)) < FEWEST:
        return 0.0, 0.0
    off = []
    for name in ("peak", "valley"):
        known, found = (part[name].to_numpy() for part in parts)
        variance = known.var(ddof=1) / len(known) + found.var(ddof=1) / len(found) + tolerance**2
        off.append(float(np.clip((found.mean() - known.mean()) / np.sqrt(variance), -CAP, CAP)))
    return off[0], off[1]


def _rate_off(measured: np.ndarray, model: np.ndarray) -> float:
    """Return the difference of the median rates of loading, over its standard error."""
    known, found = (rates[~np.isnan(rates)] for rates in (measured, model))
    if len(known) < 3 or not len(found):
        return 0.0
    spread = 1.4826 * float(np.median(np.abs(known - np.median(known))))
    error = 1.2533 * spread / np.sqrt(len(known))  # standard error of a median
    if not error > 0:
        return 0.0
    return float(np.clip((np.median(found) - np.median(known)) / error, -CAP, CAP))


def _matched(cost: np.ndarray, alone: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Return the row of the model matched to each measured event, -1 if none, at least cost."""
    n, m = cost.shape
    total = np.zeros((n + 1, m + 1))  # cost of matching i measured and j model events
    total[1:, 0] = np.cumsum(alone)
    step = np.zeros((n + 1, m + 1), dtype=np.int8)
    step[1:, 0] = 1
    step[0, 1:] = 2
    for i in range(1, n + 1):
        pair = total[i - 1, :-1] + cost[i - 1]
        lone = total[i - 1, 1:] + alone[i - 1]
        best = np.minimum(pair, lone)
        step[i, 1:] = pair > lone
        row = [float(total[i, 0])]
        skips = unseen.tolist() if i < n else [0.0] * m
        for j, (matched, skip) in enumerate(zip(best.tolist(), skips, strict=True), 1):
            more = row[-1] + skip  # an unmatched event of the model
            row.append(min(matched, more))
            if more < matched:
                step[i, j] = 2
        total[i] = row
    partner, i, j = np.full(n, -1), n, m
    while i > 0:
        if step[i, j] == 2:
            j -= 1
        elif step[i, j] == 1:
            i -= 1
        else:
            i, j = i - 1, j - 1
            partner[i] = j
    return partner
