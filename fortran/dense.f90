!> Linear equations with a full matrix: LU decomposition with row exchanges, and Cholesky decomposition. Sums have a fixed order,
!> unlike in LAPACK.
module pyfric_dense
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: decompose, solve, applied, cholesky, solve_rows

contains

  !> Replaces A by L and U, P A = L U, with 1 on the diagonal of L.
  pure subroutine decompose(n, a, pivot)
    integer, intent(in) :: n
    real(dp), intent(inout) :: a(n, n)
    integer, intent(out) :: pivot(n)   !! row with which row k was exchanged
    real(dp) :: row(n)
    integer :: j, k

    do k = 1, n
      pivot(k) = k - 1 + maxloc(abs(a(k:, k)), dim=1)
      if (pivot(k) /= k) then
        row = a(k, :)
        a(k, :) = a(pivot(k), :)
        a(pivot(k), :) = row
      end if
      a(k + 1:, k) = a(k + 1:, k)/a(k, k)
      do j = k + 1, n
        a(k + 1:, j) = a(k + 1:, j) - a(k, j)*a(k + 1:, k)
      end do
    end do
  end subroutine decompose

  !> Replaces the right side x by the solution of A x = b.
  pure subroutine solve(n, lu, pivot, x)
    integer, intent(in) :: n
    real(dp), intent(in) :: lu(n, n)   !! from `decompose`
    integer, intent(in) :: pivot(n)    !! from `decompose`
    real(dp), intent(inout) :: x(n)
    real(dp) :: other
    integer :: k

    do k = 1, n
      other = x(pivot(k))
      x(pivot(k)) = x(k)
      x(k) = other
    end do
    do k = 1, n
      x(k + 1:) = x(k + 1:) - x(k)*lu(k + 1:, k)
    end do
    do k = n, 1, -1
      x(k) = x(k)/lu(k, k)
      x(:k - 1) = x(:k - 1) - x(k)*lu(:k - 1, k)
    end do
  end subroutine solve

  !> A x. Four columns are added at a time, in a fixed order, so that the result is stored less often.
  pure function applied(n, a, x) result(y)
    integer, intent(in) :: n
    real(dp), intent(in) :: a(n, n)
    real(dp), intent(in) :: x(n)
    real(dp) :: y(n)
    integer :: k, whole

    y = 0.0_dp
    whole = n - mod(n, 4)
    do k = 1, whole, 4
      y = (((y + x(k)*a(:, k)) + x(k + 1)*a(:, k + 1)) + x(k + 2)*a(:, k + 2)) + x(k + 3)*a(:, k + 3)
    end do
    do k = whole + 1, n
      y = y + x(k)*a(:, k)
    end do
  end function applied

  !> Replaces the lower triangle of a symmetric matrix A by L, A = L L'. Stops if A is not positive definite.
  pure subroutine cholesky(n, a, positive)
    integer, intent(in) :: n
    real(dp), intent(inout) :: a(n, n)
    logical, intent(out) :: positive
    integer :: j, k

    positive = .true.
    do k = 1, n
      positive = a(k, k) > 0.0_dp
      if (.not. positive) return
      a(k, k) = sqrt(a(k, k))
      a(k + 1:, k) = a(k + 1:, k)/a(k, k)
      do j = k + 1, n
        a(j:, j) = a(j:, j) - a(j, k)*a(j:, k)
      end do
    end do
  end subroutine cholesky

  !> Replaces each of m right sides by the solution of A x = b. Right sides are the rows of x.
  pure subroutine solve_rows(n, l, m, x)
    integer, intent(in) :: n
    real(dp), intent(in) :: l(n, n)       !! from `cholesky`
    integer, intent(in) :: m
    real(dp), intent(inout) :: x(m, n)
    integer :: i, k

    do k = 1, n
      x(:, k) = x(:, k)/l(k, k)
      do i = k + 1, n
        x(:, i) = x(:, i) - l(i, k)*x(:, k)
      end do
    end do
    do k = n, 1, -1
      do i = k + 1, n
        x(:, k) = x(:, k) - l(i, k)*x(:, i)
      end do
      x(:, k) = x(:, k)/l(k, k)
    end do
  end subroutine solve_rows
end module pyfric_dense
