#!/bin/sh
# NumPy 2.4.6, numpy.f2py, with gfortran.
#
# Input: a mask of integers (0 and 2, such as counts of contacts) for a logical argument.
# Expected: nonzero is .true., as for a single value, so a mask and its .not. exclude each other.
# Seen: a single 2 becomes .true.. In an array a 2 stays 2; x and .not. x (3) then both come back as nonzero. A mask of type bool
# is right.
# pyfric's procedures for f2py take integers and real numbers only, and Python sets them to 0 and 1.
set -eu
command -v gfortran >/dev/null || exit 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet numpy==2.4.6 meson==1.9.1 ninja==1.13.0
cd "$folder"
PATH="$folder/bin:$PATH"
cat >masks.f90 <<'END'
subroutine each(n, mask, yes, no)
  integer, intent(in) :: n
  logical, intent(in) :: mask(n)
  logical, intent(out) :: yes(n), no(n)
  yes = mask
  no = .not. mask
end subroutine each

subroutine alone(mask, yes, no)
  logical, intent(in) :: mask
  logical, intent(out) :: yes, no
  yes = mask
  no = .not. mask
end subroutine alone
END
FC=gfortran python -m numpy.f2py -c -m masks masks.f90 >said 2>&1 || { tail -5 said; exit 2; }
python - <<'END'
import sys

import masks
import numpy as np

counts = np.array([0, 2])
mixed = [part.tolist() for part in masks.each(counts)]
clean = [part.tolist() for part in masks.each(counts > 0)]
single = masks.alone(2)
print("integers 0, 2: mask", mixed[0], "not", mixed[1])
print("bool: mask", clean[0], "not", clean[1])
print("a single 2: mask", single[0], "not", single[1])
both = mixed[0][1] and mixed[1][1]
sys.exit(not (both and clean == [[0, 1], [1, 0]] and single == (1, 0)))
END
