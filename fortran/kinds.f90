!> Kinds of numbers in the core, C doubles and C integers as in NumPy, and the value NaN.
module pyfric_kinds
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use, intrinsic :: iso_fortran_env, only: int64
  implicit none (type, external)
  private
  public :: dp, ip, NOT_KNOWN

  integer, parameter :: dp = c_double
  integer, parameter :: ip = c_int
  !> NaN, the result of procedures for an unknown friction law.
  real(dp), parameter :: NOT_KNOWN = transfer(int(z'7FF8000000000000', int64), 1.0_dp)
end module pyfric_kinds
