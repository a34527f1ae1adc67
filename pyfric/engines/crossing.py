"""When margins of contact, which drift and ring, first reach 0.

Margins are c + rate s + bend s^2/2 + Re(modal exp(rates s)): what `modes` and `creeping` make of
a slider whose contact states do not change.
"""

from __future__ import annotations

import math

import numpy as np

__all__ = ["first_crossing"]

GONE = 1e-16
"""A mode is gone once it moves no margin by more than this share of the largest: rounding."""
GRID = 64
"""Points at which margins are evaluated together."""


def first_crossing(
    c: np.ndarray,
    rate: np.ndarray,
    modal: np.ndarray,
    rates: np.ndarray,
    s_end: float,
    ds: float,
    bend: np.ndarray | float = 0.0,
) -> float:
    """Return the first s in [0, s_end] at which a margin reaches 0.

    Margins are c + rate s + bend s^2/2 + Re(modal exp(rates s)).

    Nothing is missed between points: where a margin could dip below 0 within an interval, by the
    bound of its second derivative, the interval is halved.

    Args:
        c: margins, shape (n_c,), in N.
        rate: their drift, shape (n_c,), in N/s.
        modal: amplitudes, shape (n_c, n), complex, in N.
        rates: eigenvalues, shape (n,), in 1/s, with negative real part.
        s_end: end of the search, in s; returned if nothing crosses before.
        ds: resolution, in s: an interval this short that could hold a crossing counts as one.
        bend: twice the coefficient of s^2, shape (n_c,) or 0, in N/s^2.
    """
    size, bend = np.abs(modal), np.broadcast_to(bend, c.shape)
    fastest = np.max(np.abs(rates), initial=1 / s_end)
    s, h = 0.0, 0.1 / fastest
    while s < s_end:
        decay = np.exp(rates.real * s)
        # Leap: the modes can do no more than their present amplitude. Only margins that may reach 0
        # on the grid are followed.
        low = c + (rate + (0.5 * s) * bend) * s - size @ decay
        fall = -(rate + s * bend)
        root = fall**2 - 2 * bend * low
        fall = fall + np.sqrt(np.maximum(root, 0.0))
        falls = (root >= 0) & (fall > 0)
        near = ~(low > 0) | (falls & (2 * low <= GRID * h * fall))
        if not near.any():
            with np.errstate(over="ignore"):  # margins that next to nothing moves never fall
                leap = float(np.min(2 * low[falls] / fall[falls], initial=np.inf))
            s = min(s + leap, s_end)
            continue
        grid, alive = s + h * np.arange(GRID + 1), size.max(axis=0) * decay > GONE * np.max(c)
        value = c[near, None] + rate[near, None] * grid + np.outer(bend[near], 0.5 * grid**2)
        waves = np.exp(np.outer(rates[alive], grid))
        value += (modal[near][:, alive] @ waves).real
        curve = np.maximum(bend[near], 0.0)[:, None] * (h**2 / 8)
        fast = size[near][:, alive] * np.abs(rates[alive]) ** 2
        curve = curve + fast @ np.abs(waves[:, :-1]) * (h**2 / 8)
        sure = (np.minimum(value[:, :-1], value[:, 1:]) > curve).all(axis=0)
        n_sure = int(np.argmin(sure)) if not sure.all() else GRID
        s += n_sure * h
        if n_sure == GRID:
            h *= 2
        elif (n_sure < GRID and (value[:, n_sure] <= 0).any()) or h <= ds:
            return min(s, s_end)
        else:
            h = max(h / 4, ds / 2)
    return s_end if math.isfinite(s_end) else s
