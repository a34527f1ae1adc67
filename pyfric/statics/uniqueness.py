"""Uniqueness of a quasi-static state: the definiteness of its slip operator.

The slip operator W gives the forces that resist slip per displacement of the slipping blocks. The
slider on its foundation contributes a symmetric, positive definite matrix F. Friction adds a term,
because p changes when blocks move: W = F + sigma mu_k dp/du_x, which is not symmetric. If the
symmetric part of W is positive definite, forces and driver determine the slip uniquely. The
*definiteness* is the smallest delta with

    (W + W')/2 x = delta F x .

It is 1 without friction and falls linearly as mu_k grows. It is 0 if there is a slip for which
friction supplies the whole work. Below `LIMIT`, a solution may not be unique. The definiteness is
accurate to about 1e-12, so that rounding does not decide.

Source: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic
contact problems with friction, Ingenieur-Archiv 60, 529 (1990), for the phenomenon.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import dpotrf

LIMIT = 0.01
"""Definiteness below which a state may not be unique."""


def definiteness(W: np.ndarray, F: np.ndarray) -> float:
    """Return the smallest eigenvalue of the symmetric part of W relative to F; 1 if n = 0.

    Args:
        W: slip operator, shape (n, n), in N/m.
        F: slip operator without friction, symmetric and positive definite, (n, n), in N/m.
    """
    if not len(W):
        return 1.0
    values = eigh(W + W.T, F + F.T, eigvals_only=True, subset_by_index=[0, 0])
    return float(values[0])


def is_definite(W: np.ndarray, F: np.ndarray) -> bool:
    """Return whether `definiteness` is above `LIMIT`, without computing its value."""
    return not len(W) or dpotrf(W + W.T - LIMIT * (F + F.T))[1] == 0
