!> Piecewise linear functions. Python tabulates them once, so that steps need no transcendental functions.
module pyfric_curve
  use pyfric_kinds, only: dp, ip
  implicit none (type, external)
  private
  public :: curve_t, new_curve, cell, at_x

  !> A function that is linear between knots and constant beyond them.
  type :: curve_t
    logical :: complete = .false.   !! whether memory was allocated
    integer :: n                    !! number of knots; 0: no curve
    real(dp), allocatable :: x(:)
    real(dp), allocatable :: y(:)
    real(dp), allocatable :: slope(:)
  end type curve_t

contains

  pure function new_curve(n, xy) result(curve)
    integer(ip), intent(in) :: n
    real(dp), intent(in) :: xy(2, n)
    type(curve_t) :: curve
    integer :: c, failed

    curve%n = n
    allocate (curve%x(n), curve%y(n), curve%slope(max(n - 1, 0)), stat=failed)
    if (failed /= 0) return
    curve%x(:) = xy(1, :)
    curve%y(:) = xy(2, :)
    do c = 1, n - 1
      curve%slope(c) = (xy(2, c + 1) - xy(2, c))/(xy(1, c + 1) - xy(1, c))
    end do
    curve%complete = .true.
  end function new_curve

  !> Index of the last knot at or before x, found by bisection; 0 if there is none.
  pure elemental function cell(curve, x) result(c)
    type(curve_t), intent(in) :: curve
    real(dp), intent(in) :: x
    integer :: c, next, middle

    c = 0
    next = curve%n + 1
    do while (next - c > 1)
      middle = (c + next)/2
      if (x >= curve%x(middle)) then
        c = middle
      else
        next = middle
      end if
    end do
  end function cell

  !> Value of the curve at x. The curve must have a knot.
  pure elemental function at_x(curve, x) result(y)
    type(curve_t), intent(in) :: curve
    real(dp), intent(in) :: x
    real(dp) :: y
    integer :: c

    c = cell(curve, x)
    if (c == 0) then
      y = curve%y(1)
    else if (c == curve%n) then
      y = curve%y(c)
    else
      y = curve%y(c) + curve%slope(c)*(x - curve%x(c))
    end if
  end function at_x
end module pyfric_curve
