"""Posterior of a fit: draws of all parameters together, by affine-invariant walkers (emcee).

The likelihood is exp(-chi^2/2) of the same misfit, and priors are flat within the bounds. Where
forces of the model jump, draws show it, and a profile is its envelope.
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
"""Walkers, at least, and at least four for each parameter. A policy."""
BURNT = 4
"""One in so many draws of each walker, those at the beginning, is left out. A policy."""


def posterior(
    found: Fit,
    draws: int = 1000,
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> pd.DataFrame:
    """Draw parameters from their posterior, given the measurements of a fit.

    As in intervals of the fit, forces of the model have the error `found.model_error`. Each draw
    takes a run: 0.05 s for the quasi-static engine with 29 blocks along the interface.

    Args:
        found: a fit of this process.
        draws: number of draws that are kept, at least 100.
        seed: of the draws.
        progress: function that is told what is done.

    Returns:
        A data frame with a row for each draw, and columns for each parameter and chi2. Its attrs
        have the acceptance and independent, the number of draws over their correlation length.

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
    spread = ways / np.sqrt(np.maximum(variances, 12.0))  # 12: flat within the bounds
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
