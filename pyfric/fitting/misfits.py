"""Misfit of two tables of events: which events belong together, and how far they are apart.

Far from the best parameters, a match may be wrong by an event throughout, and such matches are
minima of their own. `overview` has none of these: it compares the force of events, and how many
there were, as functions of the load, which is the force of an event and the drops before it.

Near them, events are matched in their order. Their times do not count: in stick-slip, a small
difference of a period would become a large one of times. What is compared are the forces at both
ends of each event, with what their errors share, and the rate of loading between events. The
matching minimises the sum of squares (dynamic programming). An event without a partner counts as
the part of its drop that would have been seen, but as no more than `CAP` standard deviations; so
does a pair, and no less than `ALONE`, so that noise parts no pair. Events of the model before the
first and after the last match are free: where the
measurement begins and ends is no property of the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pyfric.fitting.measurement import CAP

ALONE = 3.0
"""Standard deviations of a measured event without a partner, at least; noise alone makes a pair
worse once in ninety times (chi^2 with two degrees of freedom)."""
OF_FORCES, OF_COUNTS = 3e-3, 0.2
"""Standard deviations of an overview: of forces over F_N, and of numbers of events. Policies."""
LARGE = 0.2
"""Drop of a large event over the largest one: a policy."""
FEWEST = 3
"""Large events whose mean is compared. A policy."""
PER_EVENT = 2
"""Residuals of a measured event: at its start and its end."""
COMPARED = ["peak", "valley", "drop", "peak_error", "valley_error", "drop_error", "rate"]
"""Columns of events that are compared."""


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """How far a model is from a table of events.

    Attributes:
        residuals: in standard deviations, shape (2 n + 4,): at starts and ends of the n measured
            events, of the rate of loading, of events of the model that were not measured, and of
            the mean forces at starts and ends of large events.
        partner: row of the model for each measured event, -1 where there is none, shape (n,).
        extra: number of events of the model between matched ones that would have been seen.
    """

    residuals: np.ndarray
    partner: np.ndarray
    extra: int

    @property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(self.residuals @ self.residuals)

    @property
    def missing(self) -> int:
        """Number of measured events that the model has not."""
        return int((self.partner < 0).sum())


def onset(table: pd.DataFrame) -> pd.DataFrame:
    """Return the events before the first large one; all, where these are fewer than `FEWEST`."""
    large = np.flatnonzero(table["drop"] >= LARGE * table["drop"].max())
    return table.iloc[: large[0]] if len(large) and large[0] >= FEWEST else table


def misfit(
    measured: pd.DataFrame,
    model: pd.DataFrame,
    *,
    tolerance: float = 0.0,
    later: pd.DataFrame | None = None,
) -> Misfit:
    """Return how far the events of a model are from measured ones.

    Args:
        measured, model: tables of `pyfric.measured.events`; errors are those of the first.
        later: measured events of which only the means of large ones count.
        tolerance: standard deviation of forces that is added to the errors, over F_N.
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
    """Return what is compared as arrays; all at once takes a tenth of the time of columns."""
    of = dict(zip(table.columns, table.to_numpy().T, strict=True))
    return {name: of[name].astype(float) for name in COMPARED}


def _off(
    measured: dict[str, np.ndarray], model: dict[str, np.ndarray], tolerance: float
) -> dict[str, np.ndarray]:
    """Return how far ends of events are apart, in standard deviations, each of shape (n, m).

    Errors of both ends share that of the time of the event, whose variance is
    c = (s_peak^2 + s_valley^2 - s_drop^2)/2. The second residual is what is left of that of the
    valley if c/s_peak^2 of that of the peak is taken away, so that both are independent.
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
    """Return how far a model is, event by event, without a match: shape (2 n,).

    Events near the threshold of the measurement count in part: 0 below half of it, 1/2 at the
    threshold, 1 from 1.5 times the threshold on. Numbers of events may differ by a constant, as
    small early events may be lost in noise.
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
    """Return the difference of the median rates of loading, in its standard deviations."""
    known, found = (rates[~np.isnan(rates)] for rates in (measured, model))
    if len(known) < 3 or not len(found):
        return 0.0
    spread = 1.4826 * float(np.median(np.abs(known - np.median(known))))
    error = 1.2533 * spread / np.sqrt(len(known))  # of a median
    if not error > 0:
        return 0.0
    return float(np.clip((np.median(found) - np.median(known)) / error, -CAP, CAP))


def _matched(cost: np.ndarray, alone: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Return the partner of each measured event, -1 for none: the cheapest order-keeping match."""
    n, m = cost.shape
    total = np.zeros((n + 1, m + 1))  # of i measured and j events of the model
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
            more = row[-1] + skip  # the model may have an event more
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
