!> exp and log from additions, multiplications and divisions alone: those of libraries choose their code by processor.
!>
!> Within 1e-15 of exp(x), relative, for |x| < 700, and within 3e-16 (1 + |log(x)|) of log(x) for normal numbers. They work on
!> n numbers, so that vectors speed them up.
module pyfric_elementary
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: exponentials, logarithms, logs_of_1_plus

  !> log(2) in two parts, of which the first has 21 zeros at its end, so that its products with exponents are exact.
  real(dp), parameter :: LOG_2 = real(z'3FE62E42FEE00000', dp), LOG_2_REST = 1.90821492927058770002e-10_dp
  real(dp), parameter :: LOG_2_INVERSE = 1.4426950408889634074_dp, ROOT_2 = 1.41421356237309504880_dp
  !> Terms of exp(r) for |r| < log(2)/2, and of atanh(z)/z for |z| < 0.172 and |z| < 0.24.
  integer, parameter :: N_EXP = 14, N_LOG = 11, N_LOG_1 = 14
  !> Bits of the fraction of a number, and the exponent of 1.
  integer, parameter :: DIGITS_2 = 52, BIAS = 1023
  integer :: n
  real(dp), parameter :: INVERSE(0:N_EXP) = [1.0_dp, (1.0_dp/gamma(real(n + 1, dp)), n=1, N_EXP)]  !! 1/n!
  real(dp), parameter :: ODD(0:N_LOG_1) = [(1.0_dp/real(2*n + 1, dp), n=0, N_LOG_1)]

contains

  pure subroutine exponentials(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! becomes exp(x)
    integer :: i

    do i = 1, n
      x(i) = exponential(x(i))
    end do
  end subroutine exponentials

  pure subroutine logarithms(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! becomes log(x); > 0 at first
    integer :: i

    do i = 1, n
      x(i) = logarithm(x(i))
    end do
  end subroutine logarithms

  pure subroutine logs_of_1_plus(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! becomes log(1 + x); 0 to 0.62 at first
    integer :: i

    do i = 1, n
      x(i) = twice_atanh(N_LOG_1, x(i)/(2.0_dp + x(i)))
    end do
  end subroutine logs_of_1_plus

  !> exp(x) = 2^k exp(r), r = x - k log(2); 0 below -700, and the value at 700 above.
  pure elemental function exponential(x) result(y)
    real(dp), intent(in) :: x
    real(dp) :: y, r
    integer :: k, i

    r = max(min(x, 700.0_dp), -700.0_dp)
    k = int(r*LOG_2_INVERSE + sign(0.5_dp, r))
    r = (r - k*LOG_2) - k*LOG_2_REST
    y = INVERSE(N_EXP)
    !GCC$ unroll 16
    do i = N_EXP - 1, 0, -1
      y = y*r + INVERSE(i)
    end do
    y = merge(0.0_dp, y*power_of_2(k), x < -700.0_dp)
  end function exponential

  !> 2^k, for a normal number.
  pure elemental function power_of_2(k) result(y)
    integer, intent(in) :: k
    real(dp) :: y

    y = transfer(shiftl(int(k + BIAS, int64), DIGITS_2), y)
  end function power_of_2

  !> log(x) = e log(2) + 2 atanh((m - 1)/(m + 1)), x = m 2^e with m from sqrt(1/2) to sqrt(2).
  pure elemental function logarithm(x) result(y)
    real(dp), intent(in) :: x    !! > 0
    real(dp) :: y, m
    integer(int64) :: bits
    integer :: e

    bits = transfer(x, bits)
    e = int(shiftr(bits, DIGITS_2)) - BIAS
    m = transfer(bits - shiftl(int(e, int64), DIGITS_2), m)
    e = merge(e + 1, e, m > ROOT_2)
    m = merge(0.5_dp*m, m, m > ROOT_2)
    y = e*LOG_2 + (e*LOG_2_REST + twice_atanh(N_LOG, (m - 1.0_dp)/(m + 1.0_dp)))
  end function logarithm

  !> 2 atanh(z) = 2 z (1 + z^2/3 + z^4/5 + ...).
  pure elemental function twice_atanh(terms, z) result(y)
    integer, intent(in) :: terms
    real(dp), intent(in) :: z
    real(dp) :: y, z_2
    integer :: i

    z_2 = z*z
    y = ODD(terms)
    !GCC$ unroll 16
    do i = terms - 1, 0, -1
      y = y*z_2 + ODD(i)
    end do
    y = 2.0_dp*z*y
  end function twice_atanh
end module pyfric_elementary
