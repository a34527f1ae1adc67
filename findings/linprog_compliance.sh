#!/bin/sh
# SciPy 1.17.1, scipy.optimize.linprog with HiGHS, its default method.
#
# Input: the least force F that closes a gap g of a spring with compliance c: minimise F with c F >= g. The ratio g/c is 10 N
# for each c, from 1e-6 to 1e-12 m/N. Compliances of contacts in SI units are often below 1e-9 m/N.
# Expected: F = 10 N for each c, or an error or warning.
# Seen: from c = 1e-9 m/N on, F = 0 with status 0 ("optimal"). HiGHS takes coefficients of 1e-9 and less for zero, and the gap
# is then below its absolute tolerance. Neither the result nor the documentation of SciPy says so. With the row divided by c, F
# = 10 N.
# pyfric has no linear programs: it solves contact by Newton steps in forces over F_N.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/bin/python" -W error - <<'END'
import sys

from scipy.optimize import linprog


def force(c, unit=1.0):
    """F in N and the status, with the row of the gap divided by `unit`."""
    found = linprog([1.0], A_ub=[[-c / unit]], b_ub=[-10 * c / unit], bounds=[(0, None)])
    return float(found.x[0]), found.status


compliances = 1e-6, 1e-8, 1e-9, 1e-10, 1e-12
for c in compliances:
    print(f"c = {c:g} m/N: F, status = {force(c)}; row over c: {force(c, c)}")
plain = [force(c) for c in compliances]
scaled = [force(c, c) for c in compliances]
sys.exit(not (plain == [(10, 0)] * 2 + [(0, 0)] * 3 and scaled == [(10, 0)] * 5))
END
