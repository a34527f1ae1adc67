#!/bin/sh
# SciPy 1.17.1, scipy.integrate.solve_ivp.
#
# Input: a block of 1 kg on a spring of 100 N/m whose end moves at 0.1 m/s, with friction that opposes slip. The function for
# the rates fills one work array and returns it in each call, as is usual where compiled code writes into an array.
# Expected: the same result as with new arrays, as LSODA gives. The documentation asks for an array of the shape of the state;
# it does not ask for a new one.
# Seen: with BDF the block is at -968 m instead of 0.143 m, and the run reports success. RK45 takes twice the evaluations for a
# larger error. The solvers keep the returned array. Before they use it, they call the function again, for a Jacobian or for a
# repeated step.
# pyfric calls none of these solvers. Functions in its studies and tests return new arrays to them.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/bin/python" - <<'END'
import sys

import numpy as np
from scipy.integrate import solve_ivp

M, K, V, F, V_0 = 1.0, 100.0, 0.1, 5.0, 1e-3  # kg, N/m, m/s, N, m/s


def filled(t, y, out):
    """Rates of displacement and speed."""
    out[0] = y[1]
    out[1] = (K * (V * t - y[0]) - F * np.tanh(y[1] / V_0)) / M
    return out


def run(method, work=None):
    """Displacement after 2 s, whether the run succeeded, and the number of evaluations."""
    found = solve_ivp(
        lambda t, y: filled(t, y, np.empty(2) if work is None else work),
        (0, 2), np.zeros(2), method=method, rtol=1e-4, atol=1e-8,
    )
    return float(found.y[0, -1]), found.success, found.nfev


methods, one = ("BDF", "RK45", "LSODA"), np.empty(2)
new, kept = [{method: run(method, work) for method in methods} for work in (None, one)]
for method in new:
    print(f"{method}: new arrays {new[method]}, one array {kept[method]}")
right = all(abs(u - 0.1435) < 1e-3 and done for u, done, _ in new.values())
lost = kept["BDF"][1] and abs(kept["BDF"][0] - new["BDF"][0]) > 1
slow = kept["RK45"][2] > 1.5 * new["RK45"][2]
sys.exit(not (right and lost and slow and kept["LSODA"] == new["LSODA"]))
END
