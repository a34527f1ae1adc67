"""Profiles and confidence intervals.

A profile is the least misfit against the value of one parameter, with all others free. An interval
holds all values whose misfit is above the least one by no more than the quantile of chi^2 with one
degree of freedom. Forces of the model jump where an event takes another block; their scatter adds
to the variance, and the quantile grows with it. A parameter whose profile stays below it up to a
bound is not determined there.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.problem import Problem
from pyfric.fitting.search import COARSE, STEP, derivatives, least_of_others, ridge, solved

POINTS = 5
"""Points of a profile on either side; they reach to `REACH` standard deviations. Policies."""
REACH = 2.4
BEYOND = 2
"""Points of a profile in a row beyond the limit, where it ends; one may be a jump. A policy."""
WIDER = 4
"""How often a profile is widened, each time by a factor of two, until it has an end."""
ACROSS = 10
"""Parts of a profile from bound to bound. A policy."""
ROUNDS = 3
"""How often profiles begin again from a lower minimum. A policy."""


Points = dict[str, list[tuple[float, float]]]
"""Points (value between 0 and 1, chi2) of profiles by the name of the parameter."""


def profiled(
    problem: Problem, u: np.ndarray, level: float, say: Callable[[str], None]
) -> tuple[np.ndarray, dict[str, pd.DataFrame], dict[str, tuple[float, float]]]:
    """Return the best parameters, profiles, and intervals."""
    quantile = float(scipy.stats.chi2.ppf(level, 1))
    matched = any(len(each.table) for each in problem.data)
    u, made, limit = (_nearby if matched else _across)(problem, u, quantile, say)
    least = problem.chi2(u)
    profiles, intervals = {}, {}
    for k, name in enumerate(problem.names):
        low, width = problem.low[k], problem.high[k] - problem.low[k]
        points = sorted([*made[name], (u[k], least)])
        at, chi2 = np.array(points).T
        profiles[name] = pd.DataFrame({"value": low + at * width, "chi2": chi2})
        ends = _interval(at, chi2, min(least, chi2.min()) + limit)
        intervals[name] = tuple(float(low + end * width) for end in ends)
    return u, profiles, intervals


def _nearby(
    problem: Problem, u: np.ndarray, quantile: float, say: Callable[[str], None]
) -> tuple[np.ndarray, Points, float]:
    """Return the best parameters, profiles as far as the limit, and the limit above the least.

    Where a profile finds a misfit that is lower by more than the interval allows, profiles begin
    again from there. Others reach beyond the limit of a slightly lower one as they are.
    """
    made: Points = {}
    limit = quantile
    for _ in range(ROUNDS):
        least, lower = problem.chi2(u), None
        jacobian, jumps = derivatives(problem, u)
        limit = quantile * (1 + jumps)
        for k, name in enumerate(problem.names):
            say(f"profile of {name}")
            made[name], lowest = _profile(problem, u, jacobian, k, least, limit)
            if lowest[0] < (lower or (least,))[0] - 1e-9:
                lower = lowest
        if lower is not None:
            u = lower[1]
            polished = solved(problem.residuals, u, STEP)
            u = polished if problem.chi2(polished) < lower[0] else u
        if least - problem.chi2(u) <= quantile:
            break
    return u, made, limit


def _across(
    problem: Problem, u: np.ndarray, quantile: float, say: Callable[[str], None]
) -> tuple[np.ndarray, Points, float]:
    """Return the same for data without events, with profiles from bound to bound.

    Lengths alone may leave a parameter open. Each point starts from its neighbour. Lengths of a
    model jump by blocks: points may be above the least misfit there, and intervals too narrow.
    """
    made: Points = {}
    best = problem.chi2(u), u
    for k, name in enumerate(problem.names):
        say(f"profile of {name}")
        made[name], others = [], np.arange(len(u)) != k
        places = np.linspace(0, 1, ACROSS + 1)
        for side in (places[places < u[k]][::-1], places[places > u[k]]):
            at = u.copy()
            for place in side:
                at[k] = place
                if others.any():
                    held = functools.partial(_held, problem, at, others)
                    at = _filled(at, others, solved(held, at[others], COARSE))
                made[name].append((float(place), problem.chi2(at)))
                best = min(best, (made[name][-1][1], at.copy()), key=lambda pair: pair[0])
    return best[1], made, quantile


def _held(problem: Problem, u: np.ndarray, others: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the residuals with other parameters than the one that is held."""
    return problem.residuals(_filled(u, others, values))


def _filled(u: np.ndarray, which: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return parameters with some of them replaced."""
    found = u.copy()
    found[which] = values
    return found


def _profile(
    problem: Problem, u: np.ndarray, jacobian: np.ndarray, k: int, least: float, limit: float
) -> tuple[list[tuple[float, float]], tuple[float, np.ndarray]]:
    """Return points (value, chi2) of one profile, and the least misfit with its parameters."""
    others = np.arange(len(u)) != k
    along, deviation = ridge(jacobian, k)
    points, lowest = [], (least, u)
    for side in (-1, 1):
        step, at, beyond = REACH * deviation / POINTS, 0.0, 0
        for number in range(POINTS * WIDER):
            if number and number % POINTS == 0:
                step *= 2
            if beyond == BEYOND and number >= 3:
                break
            at += step
            start = np.clip(u + side * at * along, 0, 1)
            if not 0 < u[k] + side * at < 1:
                break
            found, chi2 = least_of_others(problem, start, jacobian, others)
            points.append((float(found[k]), chi2))
            beyond = beyond + 1 if chi2 > least + limit else 0
            if chi2 < lowest[0]:
                lowest = chi2, found
    return points, lowest


def _interval(at: np.ndarray, chi2: np.ndarray, limit: float) -> tuple[float, float]:
    """Return the outermost places where a profile passes a limit; NaN where it does not."""
    inside = np.flatnonzero(chi2 <= limit)
    ends = []
    for edge, out in ((inside[0], -1), (inside[-1], 1)):
        beyond = edge + out
        if not 0 <= beyond < len(at):
            ends.append(np.nan)
            continue
        share = (limit - chi2[edge]) / (chi2[beyond] - chi2[edge])
        ends.append(at[edge] + share * (at[beyond] - at[edge]))
    return ends[0], ends[1]
