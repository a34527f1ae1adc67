#!/bin/sh
# NumPy 2.4.6, numpy.f2py.
#
# Input: a procedure with real(dp) arguments, dp from a module in another file, as in most Fortran projects. f2py reads only the
# file of the procedure, because the module needs no wrapper.
# Expected: an error, or double precision once the compiler knows dp.
# Seen: f2py ends with 0 and wraps the arguments as single precision; one printed line says so. If f2py reads both files, it wraps
# double precision.
# pyfric's only file for f2py uses c_double and c_int.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet numpy==2.4.6
cd "$folder"
cat >kinds.f90 <<'END'
module kinds
  integer, parameter :: dp = selected_real_kind(15)
end module kinds
END
cat >work.f90 <<'END'
subroutine work(n, force, slip, total)
  use kinds, only: dp
  integer, intent(in) :: n
  real(dp), intent(in) :: force(n), slip(n)
  real(dp), intent(out) :: total
  total = sum(force*slip)
end subroutine work
END
wrapped() { # FILES: the types of the arrays in the wrapper that f2py writes
    rm -f probemodule.c
    bin/python -m numpy.f2py "$@" -m probe --lower >said 2>&1
    grep -o 'ndarray_from_pyobj( *NPY_[A-Z]*' probemodule.c | sed 's/.*NPY_//' | sort -u | tr '\n' ' '
}
alone=$(wrapped work.f90)
both=$(wrapped kinds.f90 work.f90)
echo "the file alone: $alone; with the module: $both"
[ "$alone" = "FLOAT " ] && [ "$both" = "DOUBLE " ]
