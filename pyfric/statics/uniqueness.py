"""Whether a quasi-static state is the only one: how definite its slip operator is.

The slip operator W gives the forces that resist the slip of the slipping blocks, per displacement.
Friction adds to the symmetric, positive definite F of the slider on its foundation what p changes
by as blocks move: W = F + sigma mu_k dp/du_x, which is not symmetric. While its symmetric part is
positive definite, forces and driver determine the slip. Its *definiteness* is the smallest delta
with

    (W + W')/2 x = delta F x :

1 without friction, falling linearly as mu_k grows, 0 where a slip exists that friction feeds. Where
it is below `LIMIT`, the answer is not relied on. It is known to about 1e-12, so that rounding
does not decide.

Source: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic
contact problems with friction, Ingenieur-Archiv 60, 529 (1990), for the phenomenon.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import dpotrf

__all__ = ["LIMIT", "definiteness", "is_definite"]

LIMIT = 0.01
"""Definiteness below which a state may not be the only one."""


def definiteness(W: np.ndarray, F: np.ndarray) -> float:
    """Return the smallest eigenvalue of the symmetric part of W relative to F; 1 without blocks.

    Args:
        W: slip operator, shape (n, n), in N/m.
        F: the same without friction, symmetric and positive definite, shape (n, n), in N/m.
    """
    if not len(W):
        return 1.0
    values = eigh(W + W.T, F + F.T, eigvals_only=True, subset_by_index=[0, 0])
    return float(values[0])


def is_definite(W: np.ndarray, F: np.ndarray) -> bool:
    """Return whether `definiteness` is above `LIMIT`, which costs less than its value."""
    return not len(W) or dpotrf(W + W.T - LIMIT * (F + F.T))[1] == 0
