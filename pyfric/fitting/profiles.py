"""Profiles and confidence intervals.

A profile is the least misfit as a function of one parameter, with all others free. A confidence
interval holds all values whose misfit exceeds the least misfit by at most a limit: the quantile of
chi^2 with one degree of freedom. The model's forces jump where an event takes another block. The
scatter of these jumps adds to the variance, and the limit grows with it. Jumps also cut valleys of
the misfit, which derivatives then cannot follow. Random steps therefore push the ends of an
interval outward. An interval has no end on a side where the profile stays below the limit up to the
bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from pyfric.fitting.problem import DOUBTFUL, Problem, probability
from pyfric.fitting.search import derivatives, deviation, least_of_others, solved


@dataclass(frozen=True, kw_only=True)
class Policies:
    """Settings of profiles. Other values take more or fewer runs, and change intervals a little.

    Attributes:
        points, reach: on either side, the first `points` points of a profile reach to `reach`
            standard deviations. The next `points` points are twice as far apart, and so on.
        across: the largest distance of points is 1/across of the range between the bounds.
        wider: number of times that the distance of points doubles before a profile is given up.
        beyond: number of consecutive points above the limit that end a profile. A single point may
            be a jump of the model.
        rounds: largest number of times that profiles begin again from a lower minimum.
        misses, worth: an end of an interval is final after `misses` consecutive random steps that
            do not move it by `worth` standard deviations.
        grows, shrinks: factors of the length of random steps after a success and after a failure.
        off: largest error of a wrong model's forces, over F_N, that intervals assume.
        draws: number of draws of the measurements, with replacement, for a wrong model.
    """

    points: int = 5
    reach: float = 2.4
    across: int = 10
    wider: int = 4
    beyond: int = 2
    rounds: int = 3
    misses: int = 20
    worth: float = 0.1
    grows: float = 2.0
    shrinks: float = 0.85
    off: float = 0.1
    draws: int = 400


POLICIES = Policies()
Points = dict[str, list[tuple[np.ndarray, float]]]
"""Points (parameters between 0 and 1, chi2) of profiles by the name of the fixed parameter."""


class Profiles(NamedTuple):
    """Best parameters, profiles, intervals by name, and the assumed error of the model's forces."""

    u: np.ndarray
    profiles: dict[str, pd.DataFrame]
    intervals: dict[str, tuple[float, float]]
    model_error: float


def known_of(
    problem: Problem,
    u: np.ndarray,
    level: float,
    say: Callable[[str], None],
    policies: Policies = POLICIES,
) -> Profiles:
    """Return best parameters, profiles, intervals, and the assumed error of the model's forces.

    If the model does not fit, the assumed error of its forces is their deviation at the best
    parameters. Intervals then also hold the best parameters of draws of the measurements.
    """
    given = assumed = problem.model_error
    if not problem.smooth or probability(problem.chi2(u), problem.dof(u)) >= DOUBTFUL:
        u, profiles, intervals = profiled(problem, u, level, say, policies)
    if probability(problem.chi2(u), problem.dof(u)) < DOUBTFUL:
        say("how far the model is off")
        for _ in range(2):  # the second time with the new best parameters
            assumed = max(given, min(problem.scatter(u, policies.off), policies.off))
            if assumed == problem.model_error:
                break
            problem.model_error = assumed
            u = solved(problem, u)
        u, profiles, intervals = profiled(problem, u, level, say, policies)
        intervals = _drawn(problem, u, level, intervals, policies)
        problem.model_error = given
    return Profiles(u, profiles, intervals, assumed)


def _drawn(
    problem: Problem,
    u: np.ndarray,
    level: float,
    intervals: dict[str, tuple[float, float]],
    policies: Policies,
) -> dict[str, tuple[float, float]]:
    """Return intervals extended to the best parameters of draws of the measurements (bootstrap).

    A wrong model may fit only a part of the measurements, and chance decides which part.
    Consecutive measurements are drawn together. The best parameters of a draw are chosen from all
    tried parameters, and from points along each parameter from bound to bound.
    """
    for k in range(len(u)):
        for place in np.linspace(0, 1, policies.across + 1):
            problem.model(np.where(np.arange(len(u)) == k, place, u))
    tried = np.array([at for at in problem.tried.values() if problem.model(at) is not None])
    groups, squares = problem.groups, np.array([problem.residuals(at) ** 2 for at in tried])
    of_groups = np.array([squares[:, groups == n].sum(axis=1) for n in np.unique(groups)])
    rng, n = np.random.default_rng(0), len(of_groups)
    weights = rng.multinomial(n, np.full(n, 1 / n), size=policies.draws)
    best = tried[np.argmin(weights @ of_groups, axis=1)]
    ends = np.quantile(best, (0.5 - 0.5 * level, 0.5 + 0.5 * level), axis=0)
    ends = np.where((ends > 0) & (ends < 1), ends, np.nan)  # no end at a bound
    lows, highs = problem.low + ends * (problem.high - problem.low)
    found = {}
    for k, (name, (low, high)) in enumerate(intervals.items()):
        found[name] = float(np.minimum(low, lows[k])), float(np.maximum(high, highs[k]))
    return found


def profiled(
    problem: Problem,
    u: np.ndarray,
    level: float,
    say: Callable[[str], None],
    policies: Policies = POLICIES,
) -> tuple[np.ndarray, dict[str, pd.DataFrame], dict[str, tuple[float, float]]]:
    """Return the best parameters, and profiles and intervals by name of a parameter."""
    quantile = float(scipy.stats.chi2.ppf(level, 1))
    u, made, limit = _made(problem, u, quantile, say, policies)
    least = problem.chi2(u)
    profiles, intervals = {}, {}
    for k, name in enumerate(problem.names):
        low, width = problem.low[k], problem.high[k] - problem.low[k]
        at, chi2 = _along([*made[name], (u, least)], k)
        profiles[name] = pd.DataFrame({"value": low + at * width, "chi2": chi2})
        ends = _interval(at, chi2, min(least, chi2.min()) + limit)
        intervals[name] = tuple(float(low + end * width) for end in ends)
    return u, profiles, intervals


def _made(
    problem: Problem, u: np.ndarray, quantile: float, say: Callable[[str], None], policies: Policies
) -> tuple[np.ndarray, Points, float]:
    """Return the best parameters, profiles up to the limit, and the limit above the least misfit.

    If a profile finds a misfit that is lower by more than the limit, profiles begin again from the
    lower misfit. After a smaller gain, profiles still reach above the new limit. If the least
    misfit exceeds the misfit of noise, the limit grows in proportion (Birge ratio).
    """
    made: Points = {}
    for _ in range(policies.rounds):
        least = problem.chi2(u)
        jacobian, jumps = derivatives(problem, u)
        limit, best = quantile * (1 + jumps) * _birge(problem, u), (u, least)
        for k, name in enumerate(problem.names):
            say(f"profile of {name}")
            sides = (
                _outwards(problem, u, jacobian, k, side, least + limit, policies)
                for side in (-1, 1)
            )
            made[name] = [point for points in sides for point in points]
            best = min([best, *made[name]], key=lambda point: point[1])
        if best[1] < least - 1e-9:
            polished = solved(problem, best[0])
            u = polished if problem.chi2(polished) < best[1] else best[0]
        if least - problem.chi2(u) <= quantile:
            break
    if len(u) > 1 and not problem.smooth:  # the profile of a single parameter is exact
        _push(problem, u, jacobian, limit, made, say, policies)
    return u, made, limit


def _birge(problem: Problem, u: np.ndarray) -> float:
    """Return chi^2 over its degrees of freedom; 1 if noise explains chi^2."""
    chi2, dof = problem.chi2(u), max(problem.dof(u), 1)
    return max(chi2 / dof, 1.0) if probability(chi2, dof) < DOUBTFUL else 1.0


def _outwards(
    problem: Problem,
    u: np.ndarray,
    jacobian: np.ndarray,
    k: int,
    side: int,
    highest: float,
    policies: Policies,
) -> list[tuple[np.ndarray, float]]:
    """Return points (parameters, chi2) of one side of a profile, up to a limit.

    The search for each point begins at its neighbour. The last point is beyond the limit or at the
    bound.
    """
    points: list[tuple[np.ndarray, float]] = []
    end, widest = float(side > 0), 1 / policies.across
    step = min(policies.reach * deviation(jacobian, k) / policies.points, widest)
    at, beyond, found, number = u[k], 0, u, 0
    while at != end and not (beyond >= policies.beyond and number >= 3):
        if number and number % policies.points == 0:
            step = min(2 * step, widest)
        if number >= policies.points * policies.wider and step < widest:
            break
        at = np.clip(at + side * step, 0.0, 1.0)
        found, chi2 = least_of_others(problem, found, jacobian, k, at)
        points.append((found, chi2))
        beyond, number = beyond + 1 if chi2 > highest else 0, number + 1
    return points


def _push(
    problem: Problem,
    u: np.ndarray,
    jacobian: np.ndarray,
    limit: float,
    made: Points,
    say: Callable[[str], None],
    policies: Policies,
) -> None:
    """Add points to profiles by random steps that move the ends of intervals outward."""
    pool = [(u, problem.chi2(u)), *(point for points in made.values() for point in points)]
    highest = min(chi2 for _, chi2 in pool) + limit
    inside = [point for point in pool if point[1] <= highest]
    values, vectors = np.linalg.eigh(np.linalg.pinv(jacobian.T @ jacobian))
    spread = (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T  # signs of vectors cancel
    for k, name in enumerate(problem.names):
        say(f"ends of the interval of {name}")
        for side in (-1, 1):
            inside += _pushed(problem, inside, spread, k, side, highest, policies)
    for k, name in enumerate(problem.names):
        ends = _interval(*_along([*made[name], pool[0]], k), highest)
        for side, known in zip((-1, 1), ends, strict=True):
            end = max(inside, key=lambda point: side * point[0][k])
            if side * (end[0][k] - known) > 0:
                further = [point for point in made[name] if side * (point[0][k] - end[0][k]) > 0]
                made[name].append(end)
                if not further:
                    made[name] += _outwards(problem, end[0], jacobian, k, side, highest, policies)


def _pushed(
    problem: Problem,
    inside: list[tuple[np.ndarray, float]],
    spread: np.ndarray,
    k: int,
    side: int,
    highest: float,
    policies: Policies,
) -> list[tuple[np.ndarray, float]]:
    """Return points (parameters, chi2) within a limit, each further out than the last.

    Steps are random and lead outwards. `spread` is the root of the covariance of the parameters.
    """
    rng, worth = np.random.default_rng(0), policies.worth * float(np.linalg.norm(spread[k]))
    u = max((place for place, _ in inside), key=lambda place: side * place[k])
    found, size, missed = [], 1.0, 0
    while missed < policies.misses:
        step = size * (spread @ rng.standard_normal(len(u)))
        tried = np.clip(u + step * np.copysign(side, side * step[k]), 0, 1)
        chi2, gain = problem.chi2(tried), side * (tried[k] - u[k])
        missed = 0 if chi2 <= highest and gain > worth else missed + 1
        if chi2 <= highest and gain > 0:
            u, size = tried, size * policies.grows
            found.append((u, chi2))
        else:
            size *= policies.shrinks
    return found


def _along(points: list[tuple[np.ndarray, float]], k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of a parameter at the points, in rising order, and chi^2 at each value."""
    at, chi2 = np.array(sorted((float(place[k]), value) for place, value in points)).T
    return at, chi2


def _interval(at: np.ndarray, chi2: np.ndarray, limit: float) -> tuple[float, float]:
    """Return the outermost values where a profile passes a limit; NaN on a side without any."""
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
