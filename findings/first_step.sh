#!/bin/sh
# SciPy 1.17.1, scipy.integrate.RK45, RK23, DOP853 and solve_ivp.
#
# Input: slip that begins at u = 0 and grows over 10^4 s, with seconds, 2^20 s and 2^-20 s as the unit of time. Tolerances are
# those of the displacement, in metres in each case.
# Expected: the same first step in seconds, because a power of two changes no digit.
# Seen: the solver chooses a first step of 1e-4 of the unit of time, in any unit. A start at zero makes its trial step 1e-6 in
# that unit. A given first step (first_step) is the same in all units.
# pyfric chooses the first step of slow slip itself, so a scene in other units has the same events.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/bin/python" - <<'END'
import sys

import numpy as np
from scipy.integrate import RK45

V, D = 1e-9, 1e-5  # m/s, m


def first(time, **how):
    """First step in seconds, with times in units of `time` seconds."""
    def rate(t, u):
        return V * time * (1 + u / D)

    given = {name: value / time for name, value in how.items()}
    pair = RK45(rate, 0.0, np.zeros(1), 1e6 / time, rtol=1e-6, atol=1e-12, **given)
    return pair.h_abs * time


units = 1.0, 2.0**20, 2.0**-20
chosen, given = [first(one) for one in units], [first(one, first_step=1.0) for one in units]
print("chosen first step in s, with seconds, 2^20 s and 2^-20 s as the unit of time:", *chosen)
print("first step of 1 s that is given:", *given)
sys.exit(not (len(set(given)) == 1 and len(set(chosen)) > 1))
END
