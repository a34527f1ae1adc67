!> Number kinds shared by the core: C doubles and C integers, as NumPy holds them.
module pyfric_kinds
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  implicit none (type, external)
  private
  public :: dp, ip

  integer, parameter :: dp = c_double
  integer, parameter :: ip = c_int
end module pyfric_kinds
