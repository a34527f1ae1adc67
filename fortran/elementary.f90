!> exp and log from additions, multiplications and divisions alone. Libraries would choose their code by processor.
!>
!> The relative error of exp(x) is below 1e-15 for |x| < 700. The error of log(x) is below 3e-16 (1 + |log(x)|) for normal
!> numbers. Procedures work on n numbers, so that compilers vectorise the loops. Integers up to 2^51 are converted by additions
!> to numbers near 2^52, whose last bit counts ones, because vectors have no conversions.
module pyfric_elementary
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: exponentials, logarithms, logs_of_1_plus

  !> log(2) in two parts. The last 21 bits of the first part are zero, so that its products with exponents are exact.
  real(dp), parameter :: LOG_2 = real(z'3FE62E42FEE00000', dp), LOG_2_REST = 1.90821492927058770002e-10_dp
  real(dp), parameter :: LOG_2_INVERSE = 1.4426950408889634074_dp
  !> Numbers of terms: of exp(r) for |r| < log(2)/2, and of atanh(z)/z for |z| < 0.172 and for |z| < 0.24.
  integer, parameter :: N_EXP = 13, N_LOG = 9, N_LOG_1 = 12
  !> Number of bits of the fraction of a number; biased exponent of 1; bits of 1 and of sqrt(1/2).
  integer, parameter :: DIGITS_2 = 52
  integer(int64), parameter :: BIAS = 1023_int64, ONE = shiftl(BIAS, DIGITS_2), ROOT_HALF = int(z'3FE6A09E667F3BCD', int64)
  !> A number whose last bit counts ones, also after additions of up to 2^51; 2^52; bits of 2^52.
  real(dp), parameter :: WHOLE = 1.5_dp*2.0_dp**DIGITS_2, TWO_52 = 2.0_dp**DIGITS_2
  integer(int64), parameter :: BITS_52 = shiftl(BIAS + DIGITS_2, DIGITS_2)
  integer :: n
  real(dp), parameter :: INVERSE(0:N_EXP) = [1.0_dp, (1.0_dp/gamma(real(n + 1, dp)), n=1, N_EXP)]  !! 1/n!
  real(dp), parameter :: ODD(0:N_LOG_1) = [(1.0_dp/real(2*n + 1, dp), n=0, N_LOG_1)]

contains

  pure subroutine exponentials(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! on entry x, on return exp(x)
    integer :: i

    do i = 1, n
      x(i) = exponential(x(i))
    end do
  end subroutine exponentials

  pure subroutine logarithms(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! on entry x > 0, on return log(x)
    integer :: i

    do i = 1, n
      x(i) = logarithm(x(i))
    end do
  end subroutine logarithms

  pure subroutine logs_of_1_plus(n, x)
    integer, intent(in) :: n
    real(dp), intent(inout) :: x(n)   !! on entry x from 0 to 0.62, on return log(1 + x)
    integer :: i

    do i = 1, n
      x(i) = twice_atanh(N_LOG_1, x(i)/(2.0_dp + x(i)))
    end do
  end subroutine logs_of_1_plus

  !> exp(x) = 2^k exp(r), r = x - k log(2). The result is 0 for x < -700, and exp(700) for x > 700.
  pure elemental function exponential(x) result(y)
    real(dp), intent(in) :: x
    real(dp) :: y, r, k

    r = max(min(x, 700.0_dp), -700.0_dp)
    k = r*LOG_2_INVERSE + WHOLE
    y = transfer(shiftl(transfer(k, BIAS) + BIAS, DIGITS_2), y)
    k = k - WHOLE
    r = (r - k*LOG_2) - k*LOG_2_REST
    y = merge(0.0_dp, y*sum_of_exp(r), x < -700.0_dp)
  end function exponential

  !> 1 + r + r^2/2 + r^3/6 + ..., with terms added in pairs, fours and eights.
  pure elemental function sum_of_exp(r) result(y)
    real(dp), intent(in) :: r
    real(dp) :: y, r_2, r_4

    r_2 = r*r
    r_4 = r_2*r_2
    y = ((INVERSE(10) + INVERSE(11)*r) + (INVERSE(12) + INVERSE(13)*r)*r_2)*r_4 &
        + ((INVERSE(6) + INVERSE(7)*r) + (INVERSE(8) + INVERSE(9)*r)*r_2)
    y = 1.0_dp + (r + r_2*(((INVERSE(2) + INVERSE(3)*r) + (INVERSE(4) + INVERSE(5)*r)*r_2) + y*r_4))
  end function sum_of_exp

  !> log(x) = e log(2) + 2 atanh((m - 1)/(m + 1)), x = m 2^e with m from sqrt(1/2) to sqrt(2).
  pure elemental function logarithm(x) result(y)
    real(dp), intent(in) :: x    !! > 0
    real(dp) :: y, m, e
    integer(int64) :: bits

    bits = transfer(x, bits) + (ONE - ROOT_HALF)
    e = transfer(ior(shiftr(bits, DIGITS_2), BITS_52), e) - (TWO_52 + real(BIAS, dp))
    m = transfer(iand(bits, shiftl(1_int64, DIGITS_2) - 1_int64) + ROOT_HALF, m)
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
