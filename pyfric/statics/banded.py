"""Cholesky factorisation of a banded matrix with a border of few unknowns.

In column-first order the lattice couples only neighbouring columns. Its stiffness is then a band
matrix of half width about 2 N_z. The three unknowns of a rod couple to all columns and form a
border:

    [ A  B ] [y]   [b]
    [ B' D ] [z] = [c] ,   (D - B' A^-1 B) z = c - B' A^-1 b ,   A y = b - B z .
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dpbtrs

if TYPE_CHECKING:
    import scipy.sparse as sp


class BandedCholesky:
    """A factorised symmetric, positive definite matrix.

    Args:
        K: symmetric sparse matrix, shape (n_q, n_q). Its unknown rows and columns are factorised.
        unknown: indices of the unknown rows and columns, shape (n,).
        order: permutation of the n unknowns: first those of the band, in the order of their
            coupling, then those of the border.
        n_border: number of unknowns of the border.

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
        MemoryError: the band does not fit into memory.
    """

    def __init__(
        self, K: sp.csr_array, unknown: np.ndarray, order: np.ndarray, n_border: int
    ) -> None:
        n = len(order) - n_border
        self._band, self._border = order[:n], order[n:]
        at = np.full(K.shape[0], -1)
        at[unknown[order]] = np.arange(len(order))
        i, j, value = np.repeat(at, np.diff(K.indptr)), at[K.indices], K.data
        lower, edge = (i >= j) & (j >= 0) & (i < n), (i >= n) & (j >= 0)
        row, column = j[lower], i[lower]  # of the upper triangle: K is symmetric
        width = int((column - row).max(initial=0))
        ab = np.zeros((width + 1, n), order="F")
        ab[width + row - column, column] = value[lower]
        self._factor = cholesky_banded(ab, overwrite_ab=True, check_finite=False)
        if n_border:
            below = np.zeros((n_border, n + n_border))
            below[i[edge] - n, j[edge]] = value[edge]
            self._B = np.asfortranarray(below[:, :n].T)
            self._AB = self._solved(self._B)
            D = below[:, n:] - self._B.T @ self._AB
            self._inverse = np.linalg.inv((D + D.T) / 2)

    def _solved(self, b: np.ndarray) -> np.ndarray:
        return dpbtrs(self._factor, b)[0]

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return x with K x = b, shape (n,) or (n, columns)."""
        x = np.empty_like(b)
        y = self._solved(b[self._band])
        if len(self._border):
            z = self._inverse @ (b[self._border] - self._B.T @ y)
            x[self._border] = z
            y -= self._AB @ z
        x[self._band] = y
        return x
