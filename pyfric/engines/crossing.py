"""First zero of gap functions during a jump.

While contact states do not change, `modes` gives each gap function the form
c + rate s + bend s^2/2 + Re(modal exp(rates s)).
"""

from __future__ import annotations

import math

import numpy as np

GONE = 1e-16
"""Amplitude over the largest c below which a mode is left out, because rounding is larger."""
N_FINE = 8
GRID = N_FINE**2
"""Number of intervals of the grid on which gap functions are evaluated together. An exponential is
the product of its value at every N_FINE-th point and of its change to the following points."""


def first_crossing(
    c: np.ndarray,
    rate: np.ndarray,
    modal: np.ndarray,
    rates: np.ndarray,
    s_end: float,
    ds: float,
    bend: np.ndarray | float = 0.0,
) -> float:
    """Return the first s in [0, s_end] at which a gap function reaches 0.

    Gap functions are c + rate s + bend s^2/2 + Re(modal exp(rates s)).

    No zero between grid points is missed. An interval is shortened if, by a bound of the second
    derivative, a gap function could dip below 0 within it.

    Args:
        c: constant parts, shape (n_c,), in N.
        rate: coefficients of s, shape (n_c,), in N/s.
        modal: amplitudes, shape (n_c, n), complex, in N.
        rates: eigenvalues, shape (n,), in 1/s, with negative real part.
        s_end: end of the search, in s; returned if no gap function reaches 0.
        ds: resolution, in s. An interval of this length that may hold a zero counts as a zero.
        bend: twice the coefficients of s^2, shape (n_c,) or 0, in N/s^2.
    """
    size, bend, squares = np.abs(modal), np.broadcast_to(bend, c.shape), np.abs(rates) ** 2
    largest = size.max(axis=0, initial=0.0)
    fastest = np.max(np.abs(rates), initial=1 / s_end)
    s, h = 0.0, 0.5 / fastest
    while s < s_end:
        decay = np.exp(rates.real * s)
        # Modes cannot exceed their present amplitudes. Gap functions are not evaluated if this
        # bound keeps them positive over the whole grid.
        low = c + (rate + (0.5 * s) * bend) * s - size @ decay
        fall = -(rate + s * bend)
        root = fall**2 - 2 * bend * low
        fall = fall + np.sqrt(np.maximum(root, 0.0))
        falls = (root >= 0) & (fall > 0)
        near = ~(low > 0) | (falls & (2 * low <= GRID * h * fall))
        if not near.any():
            with np.errstate(over="ignore"):  # a very slow fall gives an infinite time
                leap = float(np.min(2 * low[falls] / fall[falls], initial=np.inf))
            s = min(s + leap, s_end)
            continue
        grid, alive = s + h * np.arange(GRID + 1), largest * decay > GONE * np.max(c)
        if not alive.any():  # all modes have decayed: zeros of parabolas
            ahead = np.full(c.shape, np.inf)
            with np.errstate(over="ignore"):
                np.divide(2 * np.maximum(low, 0.0), fall, out=ahead, where=falls)
            return min(s + float(np.where(low > 0, ahead, 0.0).min()), s_end)
        value = c[near, None] + rate[near, None] * grid + np.outer(bend[near], 0.5 * grid**2)
        coarse = np.exp(np.outer(grid[::N_FINE], rates[alive]))
        fine = np.exp(np.outer(rates[alive], grid[:N_FINE] - s))
        part = np.ix_(near, alive)
        value += _sums(modal[part], coarse, fine).real[:, : GRID + 1]
        fast = _sums(size[part] * squares[alive], np.abs(coarse), np.abs(fine))[:, :GRID]
        curve = (np.maximum(bend[near], 0.0)[:, None] + fast) * (h**2 / 8)
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


def _sums(weights: np.ndarray, coarse: np.ndarray, fine: np.ndarray) -> np.ndarray:
    """Return sums over exponentials at the points of a grid, shape (n_c, coarse x fine points).

    Args:
        weights: weights of the exponentials, shape (n_c, n).
        coarse: exponentials at every `N_FINE`-th point, shape (n_coarse, n).
        fine: change of the exponentials over the following points, shape (n, N_FINE).
    """
    return ((weights[:, None] * coarse) @ fine).reshape(len(weights), -1)
