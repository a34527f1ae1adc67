"""Posterior of a fit: joint draws of all parameters by affine-invariant walkers (emcee).

The likelihood is exp(-chi^2/2), with the misfit of the fit. Priors are flat within the bounds.
Jumps of the model's forces show in the draws, while a profile shows only their envelope.
"""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
import pandas as pd

from pyfric.fitting.results import Fit
from pyfric.fitting.search import derivatives
from pyfric.values import SceneError, check_whole

WALKERS = 8
"""Smallest number of walkers; with many parameters, four for each (a choice)."""
BURNT = 4
"""The first 1/`BURNT` of the draws of each walker are left out (a choice)."""


def posterior(
    found: Fit,
    draws: int = 1000,
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Draw parameters from their posterior, given the measurements of a fit.

    Forces of the model have the error `found.model_error`, as in the intervals of the fit. Each
    draw takes one run, which needs 0.05 s with the quasi-static engine and 29 blocks along the
    interface.

    Args:
        found: a fit, as `pyfric.fit` or `Fit.load` returns it.
        draws: number of draws to keep, at least 100.
        seed: seed of the draws.
        progress: function that receives each step as text.

    Returns:
        A data frame with a row for each draw, a column for each parameter, and the column chi2. Its
        attrs have "acceptance", the share of accepted steps, and "independent", the number of draws
        over their correlation length.

    Raises:
        SceneError: the extra "posterior" is missing, or an argument is refused.
    """
    draws, seed = check_whole("draws", draws, 100), check_whole("seed", seed, 0)
    if found.problem is None:
        raise SceneError("found", None, "", "a fit of this process, as fit returns it", "no runs")
    problem = copy.copy(found.problem)
    problem.model_error = found.model_error
    try:
        import emcee
    except ImportError:
        allowed = "the extra 'posterior': pip install pyfric[posterior]"
        raise SceneError("posterior", None, "", allowed, "emcee is missing") from None
    u = problem.place(found.values)
    dim, rng = len(u), np.random.default_rng(seed)
    walkers = max(WALKERS, 4 * dim)
    kept = -(-draws // walkers)
    burnt = -(-kept // (BURNT - 1))

    def log_likelihood(at: np.ndarray) -> float:
        if not ((at >= 0) & (at <= 1)).all() or problem.model(at) is None:
            return -np.inf
        return -0.5 * problem.chi2(at)

    jacobian = derivatives(problem, u)[0]
    variances, ways = np.linalg.eigh(jacobian.T @ jacobian)
    spread = ways / np.sqrt(np.maximum(variances, 12.0))  # 12: 1/variance of a flat prior
    start = np.clip(u + rng.standard_normal((walkers, dim)) @ spread.T, 0, 1)
    sampler = emcee.EnsembleSampler(walkers, dim, log_likelihood)
    sampler.random_state = np.random.RandomState(seed).get_state()
    for step, _ in enumerate(sampler.sample(start, iterations=burnt + kept), 1):
        if progress:
            progress(f"step {step} of {burnt + kept}, {walkers} draws each")
    at = sampler.get_chain(discard=burnt, flat=True)[-draws:]
    table = pd.DataFrame(problem.low + at * (problem.high - problem.low), columns=problem.names)
    table["chi2"] = -2 * sampler.get_log_prob(discard=burnt, flat=True)[-draws:]
    length = emcee.autocorr.integrated_time(sampler.get_chain(discard=burnt), quiet=True).max()
    acceptance = float(sampler.acceptance_fraction.mean())
    table.attrs = {"acceptance": acceptance, "independent": float(draws / max(length, 1.0))}
    return table
