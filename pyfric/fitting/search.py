"""The search for the least misfit: least squares from several starts, and Gauss-Newton steps."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.linalg import norm

from pyfric.fitting.problem import Problem

FOLLOWED = 3
"""Largest number of minima of a rough search that a finer search starts from (a choice)."""
ALIKE = 0.01
"""Distance, over the width of the bounds, within which two minima of a smooth misfit count as one
(a choice)."""
TOLD = 5e-3
"""Negligible change of a smooth chi^2, if residuals are as small as noise (a choice)."""
COARSE = 1e-2
"""Step of finite differences of the overview, over the width of the bounds (a choice)."""
STEP = 1e-3
"""Step of finite differences of the misfit, over the width of the bounds (a choice)."""
NOTICED, WIDEST = 2.0, 0.05
"""Smallest change of the residuals (standard deviations) over the step of a derivative, and longest
step over the width of the bounds (choices)."""
WALK, FAR, WALKS = 2e-3, 8, 3
"""Search for minima nearby: step over the width of the bounds, number of steps to either side,
largest number of rounds (choices)."""


def minima(
    problem: Problem,
    starts: Sequence[np.ndarray],
    tolerances: Sequence[float],
    say: Callable[[str], None],
) -> list[np.ndarray]:
    """Return minima of the misfit at the last of some tolerances, the lowest first.

    Starts are taken in the order of their overviews. A start that fits within the first tolerance
    is followed to the last tolerance. The search ends when residuals are as small as noise. If no
    start fits, all are taken again without the overview. If no start fits within the first
    tolerance, the best `FOLLOWED` are followed. A smooth misfit needs only the last tolerance, and
    its search ends when two starts lead to one minimum.
    """
    if problem.smooth:
        tolerances = tolerances[-1:]
    rough: list[tuple[float, np.ndarray]] = []
    found: list[tuple[float, np.ndarray]] = []
    first, *others = tolerances

    def follow(u: np.ndarray) -> bool:
        for tolerance in others:
            u = solved(problem, u, tolerance)
        found.append((problem.chi2(u, tolerances[-1]), u))
        return problem.fits(u, tolerances[-1])

    seen = [start for start in starts if problem.model(start) is not None]
    seen.sort(key=lambda u: norm(problem.overview(u)))
    if problem.smooth:
        seen = seen[:FOLLOWED]
    for by_overview in (True,) if problem.smooth else (True, False):
        if any(problem.fits(u, tolerances[-1]) for _, u in found):
            break
        for number, start in enumerate(seen, 1):
            say(f"least squares by the {problem.options['fidelity']} engine from start {number}")
            u = start
            if by_overview:
                u = least(problem.overview, u, COARSE, problem.smooth)
            u = solved(problem, u, first)
            chi2 = problem.chi2(u, first)
            again = problem.smooth and any(norm(u - at) < ALIKE for _, at in rough)
            if chi2 > problem.size:
                rough.append((chi2, u))
            elif follow(u):
                break
            if again:
                break
    if not found:  # the best of the poor fits
        for _, u in sorted(rough, key=lambda pair: pair[0])[:FOLLOWED]:
            follow(u)
    return [u for _, u in sorted(found, key=lambda pair: pair[0])]


def walked(problem: Problem, u: np.ndarray, say: Callable[[str], None]) -> np.ndarray:
    """Return the parameters of a lower minimum nearby, if residuals exceed noise.

    Each parameter is moved in steps to either side, and the others are fitted again.
    """
    for _ in range(WALKS):
        if problem.smooth or problem.fits(u):
            break
        say("minima nearby")
        least, jacobian, best = problem.chi2(u), jacobian_of(problem, u), u
        for k in range(len(u)):
            for step in WALK * np.concatenate([np.arange(-FAR, 0), np.arange(1, FAR + 1)]):
                tried, chi2 = least_of_others(problem, u, jacobian, k, u[k] + step)
                if chi2 < least:
                    best, least = tried, chi2
        if best is u:
            break
        u = solved(problem, best)
        u = u if problem.chi2(u) < least else best
    return u


def deviation(jacobian: np.ndarray, k: int) -> float:
    """Return the standard deviation of a parameter with the others free; 1 if it has no effect."""
    variance = np.linalg.pinv(jacobian.T @ jacobian)[k, k]
    return math.sqrt(variance) if variance > 0 else 1.0


def solved(problem: Problem, u: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
    """Return the parameters of a local minimum of the misfit."""
    residuals = functools.partial(problem.residuals, tolerance=tolerance)
    return least(residuals, u, STEP, problem.smooth)


def least(
    residuals: Callable[[np.ndarray], np.ndarray], u: np.ndarray, step: float, smooth: bool
) -> np.ndarray:
    """Return the parameters of a local minimum, more accurate if the misfit is smooth."""
    u = np.clip(u, 2 * step, 1 - 2 * step)
    how = {"bounds": (0.0, 1.0), "diff_step": step, "xtol": 1e-4, "max_nfev": 12}
    how["ftol"] = min(TOLD / len(residuals(u)), 1e-2) if smooth else 1e-2
    return scipy.optimize.least_squares(residuals, u, **how).x


def jacobian_of(problem: Problem, u: np.ndarray) -> np.ndarray:
    """Return derivatives of the residuals by central differences."""
    return derivatives(problem, u)[0]


def derivatives(problem: Problem, u: np.ndarray) -> tuple[np.ndarray, float]:
    """Return derivatives of the residuals, and the mean variance of their jumps, per residual.

    Differences are central. Steps are so long that residuals change clearly. The change over a
    shorter step could be a single jump of the model.
    """
    columns, jumps, centre = [], [], problem.residuals(u)
    for k in range(len(u)):
        step = STEP
        while True:
            way = 2 * step * (np.arange(len(u)) == k)
            ends = [np.clip(u + sign * way, 0, 1) for sign in (-1, 1)]
            low, high = (problem.residuals(end) for end in ends)
            if norm(high - low) >= NOTICED or step >= WIDEST:
                break
            step *= 3
        columns.append((high - low) / (ends[1][k] - ends[0][k]))
        jumps.append(np.clip(high + low - 2 * centre, -1, 1) ** 2 / 6)
    return np.array(columns).T, float(np.mean(jumps))


def least_of_others(
    problem: Problem, near: np.ndarray, jacobian: np.ndarray, k: int, value: float
) -> tuple[np.ndarray, float]:
    """Return the parameters of least misfit with one of them fixed.

    The search begins twice: with the other parameters of `near`, and with other parameters moved
    along the derivatives. If the model jumps, either start may miss the valley of the misfit.
    """
    others, alone = np.arange(len(near)) != k, near.copy()
    alone[k] = np.clip(value, 0, 1)
    if not others.any():
        return alone, problem.chi2(alone)
    along = alone.copy()
    along[others] += _newton(jacobian[:, others], jacobian[:, k] * (alone[k] - near[k]))
    starts = [np.clip(along, 0, 1), *([] if problem.smooth else [alone])]
    ends = [_descended(problem, start, jacobian, others) for start in starts]
    return min(ends, key=lambda end: end[1])


def _descended(
    problem: Problem, u: np.ndarray, jacobian: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the parameters after at most two Gauss-Newton steps, and their chi^2."""
    residuals = problem.residuals(u)
    for _ in range(2):
        tried = u.copy()
        tried[free] = np.clip(tried[free] + _newton(jacobian[:, free], residuals), 0, 1)
        new = problem.residuals(tried)
        if new @ new >= residuals @ residuals:
            break
        u, residuals = tried, new
    return u, float(residuals @ residuals)


def _newton(jacobian: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Return the change of parameters that minimises the linearised residuals."""
    return np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
