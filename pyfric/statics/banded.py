"""Cholesky factorisation of a banded matrix with a border of few unknowns.

In column-first order the lattice couples neighbouring columns only, so that its stiffness is a band
of about 2 N_z; the three unknowns of a rod couple to all columns and border the band:

    [ A  B ] [y]   [b]
    [ B' D ] [z] = [c] ,   (D - B' A^-1 B) z = c - B' A^-1 b ,   A y = b - B z .

Source: LAPACK's pbtrf and pbtrs, through SciPy.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cython_lapack
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpbtrs

if TYPE_CHECKING:
    import scipy.sparse as sp

__all__ = ["BandedCholesky", "WithSpring"]

BLOCK, MANY = 128, 8
"""Rows of the factor that act together, on at least this many columns."""


class BandedCholesky:
    """A factorised symmetric, positive definite matrix.

    Args:
        K: symmetric sparse matrix, shape (n_q, n_q), whose unknown rows and columns are factorised.
        unknown: their indices, shape (n,).
        order: all unknowns, counted from 0, of the band in the order in which they are coupled,
            then the border.
        n_border: unknowns of the border.

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
        MemoryError: the band does not fit.
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
        self._factor = _factorised(ab)
        if n_border:
            below = np.zeros((n_border, n + n_border))
            below[i[edge] - n, j[edge]] = value[edge]
            self._B = np.asfortranarray(below[:, :n].T)
            self._AB = self._solved(self._B)
            D = below[:, n:] - self._B.T @ self._AB
            self._inverse = np.linalg.inv((D + D.T) / 2)

    def _solved(self, b: np.ndarray) -> np.ndarray:
        if b.ndim == 2 and b.shape[1] >= MANY and len(self._factor) > 2 * BLOCK:
            return self._many(b)
        return dpbtrs(self._factor, b)[0]  # the upper triangle takes a third less time

    def _many(self, b: np.ndarray) -> np.ndarray:
        """Return the same for many columns at once: the band is read once, in blocks of rows.

        With U1 the rows of the factor U from i on, in its triangle, to the right of that and in the
        triangle where the band ends, U'y = b goes downward and U x = y upward.
        """
        x, (n, w) = np.asfortranarray(b), (len(b), len(self._factor) - 1)
        x = x.copy(order="F") if x is b else x
        starts = range(0, n, BLOCK)
        for i in starts:
            (j, k), triangle, right, end = self._rows(i, n, w)
            x[i:j] = top = dtrsm(1.0, triangle, x[i:j], trans_a=1)
            x[j:k] -= right.T @ top
            x[k : k + end.shape[1]] -= end.T @ top
        for i in reversed(starts):
            (j, k), triangle, right, end = self._rows(i, n, w)
            top = x[i:j] - right @ x[j:k] - end @ x[k : k + end.shape[1]]
            x[i:j] = dtrsm(1.0, triangle, top)
        return x

    def _rows(self, i: int, n: int, w: int) -> tuple[tuple[int, int], *tuple[np.ndarray, ...]]:
        """Return where a block of rows of U and its rectangle end, and its three parts."""
        j = min(i + BLOCK, n)
        k = min(i + w, n)
        flat, step = self._factor.ravel(order="F"), self._factor.itemsize

        def part(column: int, columns: int) -> np.ndarray:
            shape, begin = (j - i, columns), w + i + column * w
            return np.lib.stride_tricks.as_strided(flat[begin:], shape, (step, w * step))

        return (j, k), part(i, j - i), part(j, k - j), np.tril(part(k, min(j - i, n - k)))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return x with K x = b, shape (n,) or (n, columns)."""
        x = np.empty_like(b)
        y = self._solved(b[self._band])
        if len(self._border):
            z = self._inverse @ (b[self._border] - self._B.T @ y)
            x[self._border] = z
            y = y - self._AB @ z
        x[self._band] = y
        return x


class WithSpring:
    """A factorised matrix K and a spring between one combination of the unknowns and a wall.

    With r the combination times the root of the stiffness (Sherman and Morrison's formula),

        (K + r r')^-1 b = x - K^-1 r (r'x)/(1 + r'K^-1 r),   x = K^-1 b .

    Args:
        factor: K, factorised, shape (n, n).
        row: r, shape (n,), in the root of N/m.
    """

    def __init__(self, factor: BandedCholesky, row: np.ndarray) -> None:
        self._factor, self._row, answer = factor, row, factor.solve(row)
        self._answer = answer / (1 + row @ answer)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return x with (K + r r') x = b, shape (n,) or (n, columns)."""
        x = self._factor.solve(b)
        pull = self._row @ x
        return x - (self._answer * pull if b.ndim == 1 else np.outer(self._answer, pull))


def _procedure() -> ctypes._CFuncPtr:
    """Return SciPy's pbtrf: called like this it lets other threads run, so that Ctrl-C is heard."""
    capsule = cython_lapack.__pyx_capi__["dpbtrf"]
    name = ctypes.pythonapi.PyCapsule_GetName
    name.restype, name.argtypes = ctypes.c_char_p, (ctypes.py_object,)
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    number = ctypes.POINTER(ctypes.c_int)
    kinds = (ctypes.c_char_p, number, number, ctypes.c_void_p, number, number)
    return ctypes.CFUNCTYPE(None, *kinds)(pointer(capsule, name(capsule)))


_pbtrf = _procedure()


def _factorised(ab: np.ndarray) -> np.ndarray:
    """Factorise a band in place: ab[-1 - j + i, j] = A[i, j], i <= j, in Fortran's order."""
    rows, n = ab.shape
    failed = ctypes.c_int()
    numbers = [ctypes.byref(ctypes.c_int(value)) for value in (n, rows - 1, rows)]
    _pbtrf(b"U", *numbers[:2], ab.ctypes.data, numbers[2], ctypes.byref(failed))
    if failed.value:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return ab
