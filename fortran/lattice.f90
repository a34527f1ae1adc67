!> Forces of neighbours on a block, row by row: springs in linear geometry, and dashpots.
!>
!> A row q contains u_x, u_z, v_x, v_z. Neighbours in a row are LANES elements apart (see pyfric_layout). Missing rows below and
!> above are passed as zeros. Sums pair left with right neighbours. A mirrored lattice therefore gives the mirrored bits, and a
!> translation gives exactly zero force.
module pyfric_lattice
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_bonds, only: weights_t, SPRINGS, DASHPOTS
  use pyfric_model, only: model_t, half_side, MIRRORED
  implicit none (type, external)
  private
  public :: around_t, gather_forces, halve_bonds, halve_columns

  !> Number and side of the rows next to a row.
  type :: around_t
    real(dp) :: rows  !! number of neighbouring rows
    real(dp) :: edge  !! side of a single neighbouring row: +1 above, -1 below; 0 with two rows
  end type around_t

contains

  !> Forces on a row in linear geometry. In finite geometry, adds the forces of dashpots on the full relative velocity.
  pure subroutine gather_forces(s, around, dn, q, up, fx, fz)
    type(model_t), intent(in) :: s
    type(around_t), intent(in) :: around
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)    !! the row below
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)     !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)    !! the row above
    real(dp), intent(inout) :: fx(LB:s%n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)    !! force on the row [N]
    real(dp) :: k4, eta4, at_wall(2, -1:1)
    integer :: i, side

    k4 = 0.25_dp*s%k
    eta4 = 0.25_dp*s%eta
    do side = -1, 1, 2
      at_wall(:, side) = force_at_wall(merge(1, s%at(s%nx), side == 1), side)
    end do
    if (s%finite) then
      do i = 1, s%n
        fx(i) = fx(i) + s%eta*drag(VX, i)
        fz(i) = fz(i) + s%eta*drag(VZ, i)
      end do
    else if (s%along) then
      do i = 1, s%n
        fx(i) = k4*pull_x(SPRINGS, UX, i) + eta4*pull_x(DASHPOTS, VX, i)
        fz(i) = k4*pull_z(SPRINGS, UX, i) + eta4*pull_z(DASHPOTS, VX, i)
      end do
    else
      do i = 1, s%n
        fx(i) = k4*pull_x(SPRINGS, UX, i) + s%eta*drag(VX, i)
        fz(i) = k4*pull_z(SPRINGS, UX, i) + s%eta*drag(VZ, i)
      end do
    end if
    do side = -1, 1, 2
      i = merge(1, s%at(s%nx), side == 1)
      if (merge(s%left, s%right, side == 1) == MIRRORED) cycle
      fx(i) = at_wall(1, side)
      fz(i) = at_wall(2, side)
    end do

  contains

    !> Bonds along n, sum of 4 c n (n.du) with weights w = 4 c n n^T. With E and W the blocks beside a block, N and S above
    !> and below it, NE to SW at its corners:
    !>
    !>     x:  w (E + W)_x + w_corner (NE + SE + NW + SW)_x + w_cross (NE - SE - NW + SW)_z - (sum of the weights) u_x
    !>
    !> The z component has N + S in place of E + W.
    pure function pull_x(w, c, i) result(f)
      type(weights_t), intent(in) :: w
      integer, intent(in) :: c  !! UX, or VX for dashpots
      integer, intent(in) :: i  !! element of the block
      real(dp) :: f

      f = (w%beside*(q(i + LANES, c) + q(i - LANES, c)) &
           + (w%corner*((up(i + LANES, c) + dn(i + LANES, c)) + (up(i - LANES, c) + dn(i - LANES, c))) &
              + w%cross*((up(i + LANES, c + 1) - dn(i + LANES, c + 1)) - (up(i - LANES, c + 1) - dn(i - LANES, c + 1))))) &
          - 2.0_dp*(w%beside + around%rows*w%corner)*q(i, c)
    end function pull_x

    pure function pull_z(w, c, i) result(f)
      type(weights_t), intent(in) :: w
      integer, intent(in) :: c  !! UX, or VX for dashpots
      integer, intent(in) :: i  !! element of the block
      real(dp) :: f

      f = (w%above*(up(i, c + 1) + dn(i, c + 1)) &
           + (w%corner*((up(i + LANES, c + 1) + dn(i + LANES, c + 1)) + (up(i - LANES, c + 1) + dn(i - LANES, c + 1))) &
              + w%cross*((up(i + LANES, c) - dn(i + LANES, c)) - (up(i - LANES, c) - dn(i - LANES, c))))) &
          - around%rows*(w%above + 2.0_dp*w%corner)*q(i, c + 1)
    end function pull_z

    !> Force on a block at a side wall [N].
    pure function force_at_wall(i, side) result(f)
      integer, intent(in) :: i     !! element of the block
      integer, intent(in) :: side  !! +1: neighbours are on the right, -1: on the left
      real(dp) :: f(2)

      if (s%finite) then
        f = [fx(i), fz(i)] + s%eta*drag_at_wall(i, side)
      else if (s%along) then
        f = k4*pull_at_wall(SPRINGS, UX, i, side) + eta4*pull_at_wall(DASHPOTS, VX, i, side)
      else
        f = k4*pull_at_wall(SPRINGS, UX, i, side) + s%eta*drag_at_wall(i, side)
      end if
    end function force_at_wall

    !> Forces on a block at a side wall, x and z. With a single neighbouring row, cross terms of the block's own u remain.
    pure function pull_at_wall(w, c, i, side) result(f)
      type(weights_t), intent(in) :: w
      integer, intent(in) :: c     !! UX, or VX for dashpots
      integer, intent(in) :: i     !! element of the block
      integer, intent(in) :: side  !! +1: neighbours are on the right, -1: on the left
      real(dp) :: f(2), corner(2), cross(2)
      integer :: e

      e = i + side*LANES
      corner = w%corner*(up(e, c:c + 1) + dn(e, c:c + 1))
      cross = w%cross*(real(side, dp)*((up(e, c:c + 1) - dn(e, c:c + 1)) - around%edge*q(i, c:c + 1)))
      f(1) = (w%beside*q(e, c) + (corner(1) + cross(2))) &
             - (w%beside + around%rows*w%corner)*q(i, c)
      f(2) = (w%above*(up(i, c + 1) + dn(i, c + 1)) + (corner(2) + cross(1))) &
             - around%rows*(w%above + w%corner)*q(i, c + 1)
    end function pull_at_wall

    !> Sum of dv of the dashpots of a block on the full relative velocity.
    pure function drag(c, i) result(f)
      integer, intent(in) :: c  !! VX or VZ
      integer, intent(in) :: i  !! element of the block
      real(dp) :: f

      f = ((q(i + LANES, c) + q(i - LANES, c)) &
           + ((up(i, c) + dn(i, c)) + ((up(i + LANES, c) + dn(i + LANES, c)) + (up(i - LANES, c) + dn(i - LANES, c))))) &
          - (2.0_dp + 3.0_dp*around%rows)*q(i, c)
    end function drag

    !> Sum of dv of the dashpots of a block at a side wall, x and z.
    pure function drag_at_wall(i, side) result(f)
      integer, intent(in) :: i     !! element of the block
      integer, intent(in) :: side  !! +1: neighbours are on the right, -1: on the left
      real(dp) :: f(2)
      integer :: e

      e = i + side*LANES
      f = (q(e, VX:VZ) + ((up(i, VX:VZ) + dn(i, VX:VZ)) + (up(e, VX:VZ) + dn(e, VX:VZ)))) &
          - (1.0_dp + 2.0_dp*around%rows)*q(i, VX:VZ)
    end function drag_at_wall
  end subroutine gather_forces

  !> Subtracts half of the forces of bonds within a row of half blocks.
  pure subroutine halve_bonds(s, q, fx, fz)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the row
    real(dp), intent(inout) :: fx(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)   !! force on the row [N]
    real(dp) :: d(4)
    integer :: i, o

    do i = 1, s%nx
      o = s%at(i)
      d = 0.0_dp
      if (i > 1 .or. s%left == MIRRORED) d = q(o - LANES, :) - q(o, :)
      if (i < s%nx .or. s%right == MIRRORED) d = d + (q(o + LANES, :) - q(o, :))
      fx(o) = fx(o) - 0.5_dp*(s%k*d(UX) + s%eta*d(VX))
      if (.not. s%along) fz(o) = fz(o) - 0.5_dp*s%eta*d(VZ)
    end do
  end subroutine halve_bonds

  !> Subtracts half of the forces of bonds to the rows below and above in columns of half blocks.
  pure subroutine halve_columns(s, rows, dn, q, up, fx, fz)
    type(model_t), intent(in) :: s
    logical, intent(in) :: rows(2)                   !! whether there is a row below, above
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)    !! the row below
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)     !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)    !! the row above
    real(dp), intent(inout) :: fx(LB:s%n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)    !! force on the row [N]
    real(dp) :: d(4)
    integer :: side, o

    do side = -1, 1, 2
      if (.not. half_side(s, merge(s%left, s%right, side < 0))) cycle
      o = merge(1, s%at(s%nx), side < 0)
      d = 0.0_dp
      if (rows(1)) d = dn(o, :) - q(o, :)
      if (rows(2)) d = d + (up(o, :) - q(o, :))
      fz(o) = fz(o) - 0.5_dp*(s%k*d(UZ) + s%eta*d(VZ))
      if (.not. s%along) fx(o) = fx(o) - 0.5_dp*s%eta*d(VX)
    end do
  end subroutine halve_columns
end module pyfric_lattice
