#!/bin/sh
# SciPy 1.17.1, scipy.sparse.linalg.lobpcg.
#
# Input: the stiffness of a chain of 400 springs of 1 MN/m, in N/m, in MN/m and in TN/m; its four lowest eigenvalues from a
# random start, with the default tolerance.
# Expected: the same eigenvalues in each unit, or the warning that the function gives if it does not converge.
# Seen: eigenvalues are right in N/m and in MN/m. In TN/m they are 2 000 to 29 000 times too large, without a warning. The
# residual is compared with a fixed number, 1.5e-8 times the number of blocks, however large the entries of the matrix are. The
# documentation says that tol is a stopping criterion. With a tol in proportion to the unit the eigenvalues are right.
# pyfric finds modes by its own block Lanczos method, in units of k and m. To check modes with lobpcg, scale the matrix.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/bin/python" -W error - <<'END'
import sys

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import lobpcg

N = 400
spring = np.ones(N - 1)
chain = sparse.diags_array([-spring, 2 * np.ones(N), -spring], offsets=[-1, 0, 1], format="csc")
exact = 4 * np.sin(np.arange(1, 5) * np.pi / (2 * (N + 1))) ** 2
start = np.random.default_rng(0).standard_normal((N, 4))


def off(unit, **how):
    """Eigenvalues over the exact ones; stiffness of a spring in this unit."""
    found, _ = lobpcg(unit * chain, start.copy(), largest=False, maxiter=5000, **how)
    return found / (unit * exact)


newton, mega, tera = off(1e6), off(1.0), off(1e-6)
scaled = off(1e-6, tol=6e-6 * 1e-6)
print("eigenvalues over exact ones, N/m:", newton, "\nMN/m:", mega, "\nTN/m:", tera)
print("TN/m, tol 6e-12:", scaled)
right = all(np.abs(one - 1).max() < 1e-3 for one in (newton, mega, scaled))
sys.exit(not (right and tera.min() > 1e3))
END
