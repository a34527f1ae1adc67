"""Cholesky factorisation of a banded matrix with a border of few unknowns.

In column-first order the lattice couples only neighbouring columns. Its stiffness is then a band
matrix of half width about 2 N_z. The three unknowns of a rod couple to all columns and form a
border:

    [ A  B ] [y]   [b]
    [ B' D ] [z] = [c] ,   (D - B' A^-1 B) z = c - B' A^-1 b ,   A y = b - B z .

LAPACK's band solver reads the whole factor once for each right side. Here many right sides are
solved together. The factor, of half width w, is cut into w x w blocks, which are triangles on the
diagonal and to the right of the diagonal. In LAPACK's band storage each column begins one row above
the previous column. A block therefore is a dense matrix whose columns begin w numbers apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.blas import dtrmm, dtrsm
from scipy.linalg.lapack import dpbtrs

if TYPE_CHECKING:
    import scipy.sparse as sp


TOGETHER = 1024
"""Half width times number of right sides, from which joint solution of right sides is faster."""


class BandedCholesky:
    """A factorised symmetric, positive definite matrix.

    Args:
        K: symmetric sparse matrix, shape (n_q, n_q). Its unknown rows and columns are factorised.
        unknown: indices of the unknown rows and columns, shape (n,).
        order: permutation of the n unknowns: unknowns of the band in the order of their coupling,
            then unknowns of the border.
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
        row, column = j[lower], i[lower]  # the upper triangle of the symmetric K
        self._width = width = int((column - row).max(initial=0))
        # Further rows of the unit matrix make the number of rows a multiple of the width.
        ab = np.zeros((width + 1, n + -n % max(width, 1)), order="F")
        ab[width, n:] = 1.0
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
        n = len(self._band)
        if b.ndim == 1 or self._width * b.shape[1] < TOGETHER:
            return dpbtrs(self._factor[:, :n], b)[0]
        x = np.zeros((self._factor.shape[1], b.shape[1]))
        x[:n] = b
        self._solve_together(x.reshape(-1, self._width, b.shape[1]))
        return x[:n]

    def _solve_together(self, x: np.ndarray) -> None:
        """Solve in place for right sides x, shape (n/w, w, columns)."""
        for i in range(len(x)):
            if i:
                x[i] -= dtrmm(1.0, self._block(i - 1, i), x[i - 1].T, side=1, lower=1).T
            x[i] = dtrsm(1.0, self._block(i, i), x[i].T, side=1).T
        for i in reversed(range(len(x))):
            if i + 1 < len(x):
                right = self._block(i, i + 1)
                x[i] -= dtrmm(1.0, right, x[i + 1].T, side=1, lower=1, trans_a=1).T
            x[i] = dtrsm(1.0, self._block(i, i), x[i].T, side=1, trans_a=1).T

    def _block(self, i: int, j: int) -> np.ndarray:
        """Return block (i, j) of the factor, (w, w); only its part in the band is defined."""
        w = self._width
        numbers = self._factor.ravel(order="K")[w * (1 + i + j * w) :][: w * w]
        return numbers.reshape(w, w, order="F")

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
