"""Profiles and confidence intervals.

A profile is the least misfit against the value of one parameter, with all others free. An interval
holds all values whose misfit is above the least one by no more than the quantile of chi^2 with one
degree of freedom. Forces of the model jump where an event takes another block; their scatter adds
to the variance, and the quantile grows with it. Jumps cut valleys of the misfit, which then go on
where derivatives do not lead: the ends of an interval are pushed on by random steps. A parameter
whose profile stays below the limit up to a bound is not determined there.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.problem import Problem
from pyfric.fitting.search import COARSE, STEP, derivatives, deviation, least_of_others, solved

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
MISSES, WORTH = 20, 0.1
"""Steps in a row that do not push an end of an interval on by that many standard deviations, after
which it stays. Policies."""
GROWS, SHRINKS = 2.0, 0.85
"""Factors of the length of such a step after one that went on, and after a miss. Policies."""

Points = dict[str, list[tuple[np.ndarray, float]]]
"""Points (parameters between 0 and 1, chi2) of profiles by the name of the one that is held."""


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
        at, chi2 = _along([*made[name], (u, least)], k)
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
    for _ in range(ROUNDS):
        least = problem.chi2(u)
        jacobian, jumps = derivatives(problem, u)
        limit, best = quantile * (1 + jumps), (u, least)
        for k, name in enumerate(problem.names):
            say(f"profile of {name}")
            sides = (_outwards(problem, u, jacobian, k, side, least + limit) for side in (-1, 1))
            made[name] = [point for points in sides for point in points]
            best = min([best, *made[name]], key=lambda point: point[1])
        if best[1] < least - 1e-9:
            polished = solved(problem.residuals, best[0], STEP)
            u = polished if problem.chi2(polished) < best[1] else best[0]
        if least - problem.chi2(u) <= quantile:
            break
    if len(u) > 1:  # a profile of one alone is exact
        _push(problem, u, jacobian, limit, made, say)
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
                made[name].append((at.copy(), problem.chi2(at)))
                best = min(best, made[name][-1][::-1], key=lambda pair: pair[0])
    return best[1], made, quantile


def _held(problem: Problem, u: np.ndarray, others: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the residuals with other parameters than the one that is held."""
    return problem.residuals(_filled(u, others, values))


def _filled(u: np.ndarray, which: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return parameters with some of them replaced."""
    found = u.copy()
    found[which] = values
    return found


def _outwards(
    problem: Problem, u: np.ndarray, jacobian: np.ndarray, k: int, side: int, highest: float
) -> list[tuple[np.ndarray, float]]:
    """Return points (parameters, chi2) of one side of a profile, as far as it is within a limit.

    Each point begins from its neighbour.
    """
    points: list[tuple[np.ndarray, float]] = []
    step, at, beyond, found = REACH * deviation(jacobian, k) / POINTS, 0.0, 0, u
    for number in range(POINTS * WIDER):
        if number and number % POINTS == 0:
            step *= 2
        if beyond == BEYOND and number >= 3:
            break
        at += step
        if not 0 < u[k] + side * at < 1:
            break
        found, chi2 = least_of_others(problem, found, jacobian, k, u[k] + side * at)
        points.append((found, chi2))
        beyond = beyond + 1 if chi2 > highest else 0
    return points


def _push(
    problem: Problem,
    u: np.ndarray,
    jacobian: np.ndarray,
    limit: float,
    made: Points,
    say: Callable[[str], None],
) -> None:
    """Add to profiles the points at which intervals end, where random steps push these on."""
    pool = [(u, problem.chi2(u)), *(point for points in made.values() for point in points)]
    highest = min(chi2 for _, chi2 in pool) + limit
    inside = [point for point in pool if point[1] <= highest]
    values, vectors = np.linalg.eigh(np.linalg.pinv(jacobian.T @ jacobian))
    spread = (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T  # no sign of vectors counts
    for k, name in enumerate(problem.names):
        say(f"ends of the interval of {name}")
        for side in (-1, 1):
            inside += _pushed(problem, inside, spread, k, side, highest)
    for k, name in enumerate(problem.names):
        ends = _interval(*_along([*made[name], pool[0]], k), highest)
        for side, known in zip((-1, 1), ends, strict=True):
            end = max(inside, key=lambda point: side * point[0][k])
            if side * (end[0][k] - known) > 0:
                further = [point for point in made[name] if side * (point[0][k] - end[0][k]) > 0]
                made[name].append(end)
                if not further:
                    made[name] += _outwards(problem, end[0], jacobian, k, side, highest)


def _pushed(
    problem: Problem,
    inside: list[tuple[np.ndarray, float]],
    spread: np.ndarray,
    k: int,
    side: int,
    highest: float,
) -> list[tuple[np.ndarray, float]]:
    """Return points (parameters, chi2) within a limit, each further out than the one before.

    Steps are random and lead outwards. `spread` is the root of the covariance of the parameters.
    """
    rng, worth = np.random.default_rng(0), WORTH * float(np.linalg.norm(spread[k]))
    u = max((place for place, _ in inside), key=lambda place: side * place[k])
    found, size, missed = [], 1.0, 0
    while missed < MISSES:
        step = size * (spread @ rng.standard_normal(len(u)))
        tried = np.clip(u + step * np.copysign(side, side * step[k]), 0, 1)
        chi2, gain = problem.chi2(tried), side * (tried[k] - u[k])
        missed = 0 if chi2 <= highest and gain > worth else missed + 1
        if chi2 <= highest and gain > 0:
            u, size = tried, size * GROWS
            found.append((u, chi2))
        else:
            size *= SHRINKS
    return found


def _along(points: list[tuple[np.ndarray, float]], k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return values of a parameter, rising, and chi2 there."""
    at, chi2 = np.array(sorted((float(place[k]), value) for place, value in points)).T
    return at, chi2


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
