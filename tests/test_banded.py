"""Cholesky factors of banded matrices with a border, compared with dense NumPy."""

from unittest import mock

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from pyfric.statics import banded
from pyfric.statics.banded import BandedCholesky


def bordered(n, width, n_border, seed):
    """Return a positive definite matrix with a band, whose unknowns are shuffled, and a border."""
    rng = np.random.default_rng(seed)
    size = n + n_border
    A = rng.uniform(-1, 1, (size, size))
    i, j = np.indices(A.shape)
    A[(np.abs(i - j) > width) & (i < n) & (j < n)] = 0.0
    A = A + A.T
    A += np.diag(np.abs(A).sum(axis=1) + 1)
    shuffled = np.append(rng.permutation(n), np.arange(n, size))
    return A[np.ix_(np.argsort(shuffled), np.argsort(shuffled))], shuffled


@given(
    n=st.integers(1, 30),
    width=st.integers(0, 8),
    n_border=st.integers(0, 3),
    columns=st.sampled_from([None, 1, 5]),
    together=st.sampled_from([1, banded.TOGETHER]),
    seed=st.integers(0, 100),
)
def test_solutions_are_those_of_numpy(n, width, n_border, columns, together, seed):
    """The unknowns are part of a larger matrix; the right-hand side is not changed."""
    A, order = bordered(n, width, n_border, seed)
    rng = np.random.default_rng(seed)
    unknown = np.sort(rng.choice(2 * len(A), len(A), replace=False))
    K = np.zeros((2 * len(A), 2 * len(A)))
    K[np.ix_(unknown, unknown)] = A
    K[np.setdiff1d(np.arange(len(K)), unknown)] = 7.0  # must not be read
    b = rng.standard_normal(len(A) if columns is None else (len(A), columns))
    given_b = b.copy()
    with mock.patch.object(banded, "TOGETHER", together):
        x = BandedCholesky(sp.csr_array(K), unknown, order, n_border).solve(b)
    np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(b, given_b)


def test_an_indefinite_matrix_is_refused():
    K = sp.csr_array(np.diag([1.0, -1.0, 1.0]))
    with pytest.raises(np.linalg.LinAlgError):
        BandedCholesky(K, np.arange(3), np.arange(3), 0)
