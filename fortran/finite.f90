!> Forces of the bonds in finite geometry, row by row.
!>
!> Each bond is evaluated once, in the row where it starts. Its force on the row above is carried up to this row. With
!> D = d + du and r = |D|, a spring pulls the first block of a bond with k (r - l)/r D. A dashpot along the bond pulls this
!> block with eta (D.dv)/r^2 D.
module pyfric_finite
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_bonds, only: bond_t, BONDS, N_BOND, BESIDE, ABOVE, RIGHT, LEFT
  use pyfric_model, only: model_t, S_SERIES, close_left
  implicit none (type, external)
  private
  public :: forces_finite

  type(bond_t), parameter :: BOND(N_BOND) = BONDS

contains

  !> Forces of the springs on a row, and of dashpots along the bonds. On entry, carry contains forces on the row from bonds
  !> below; on return, forces on the row above.
  pure subroutine forces_finite(s, has_up, q, up, b, carry, fx, fz)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up                           !! whether there is a row above; if not, `up` is not read
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)            !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)           !! the row above
    real(dp), intent(inout) :: b(LB:s%n + LANES, 2, N_BOND) !! work space: forces on the first blocks, x and z [N]
    real(dp), intent(inout) :: carry(LB:s%n + LANES, 2)     !! forces on the row from below; then forces on the row above [N]
    real(dp), intent(out) :: fx(LB:s%n + LANES)             !! force on the row [N]
    real(dp), intent(out) :: fz(LB:s%n + LANES)             !! force on the row [N]
    real(dp) :: strain
    logical :: large
    integer :: m

    strain = 0.0_dp
    call by_series(s%n, BESIDE, s%l, s%series(:, BESIDE), q, q, b(LB, 1, BESIDE), b(LB, 2, BESIDE), strain)
    if (has_up) then
      call by_series(s%n, ABOVE, s%l, s%series(:, ABOVE), q, up, b(LB, 1, ABOVE), b(LB, 2, ABOVE), strain)
      call by_series(s%n, RIGHT, s%l, s%series(:, RIGHT), q, up, b(LB, 1, RIGHT), b(LB, 2, RIGHT), strain)
      call by_series(s%n, LEFT, s%l, s%series(:, LEFT), q, up, b(LB, 1, LEFT), b(LB, 2, LEFT), strain)
    else
      b(:, :, ABOVE:) = 0.0_dp
    end if
    large = strain > (S_SERIES*s%l**2)**2
    if (large) then
      call in_closed_form(s, BESIDE, q, q, b(LB, 1, BESIDE), b(LB, 2, BESIDE))
      do m = ABOVE, merge(LEFT, BESIDE, has_up)
        call in_closed_form(s, m, q, up, b(LB, 1, m), b(LB, 2, m))
      end do
    end if
    if (s%along) then
      call add_dashpots(s, BESIDE, q, q, b(LB, 1, BESIDE), b(LB, 2, BESIDE))
      do m = ABOVE, merge(LEFT, BESIDE, has_up)
        call add_dashpots(s, m, q, up, b(LB, 1, m), b(LB, 2, m))
      end do
    end if
    do m = 1, N_BOND
      if (BOND(m)%first == BOND(m)%second) cycle
      b(s%at(s%nx), :, m) = 0.0_dp  ! beyond the last block
      call close_left(s%n, b(LB, 1, m))
      call close_left(s%n, b(LB, 2, m))
    end do
    call gather(s%n, b, 1, carry(LB, 1), fx)
    call gather(s%n, b, 2, carry(LB, 2), fz)
  end subroutine forces_finite

  !> Adds the forces of springs of bond m, by their series in t = r^2 - l0^2.
  pure subroutine by_series(n, m, l, c, q, row, fx, fz, strain)
    integer, intent(in) :: n                      !! length of a row
    integer, intent(in) :: m
    real(dp), intent(in) :: l                     !! lattice constant [m]
    real(dp), intent(in) :: c(7)                  !! coefficients of the series
    real(dp), intent(in) :: q(LB:n + LANES, 4)    !! the row of the first blocks of the bonds
    real(dp), intent(in) :: row(LB:n + LANES, 4)  !! the row of the second blocks of the bonds
    real(dp), intent(inout) :: fx(LB:n + LANES)   !! forces on the first blocks [N]
    real(dp), intent(inout) :: fz(LB:n + LANES)   !! forces along z [N]
    real(dp), intent(inout) :: strain             !! largest (t/l0^2)^2 l^4 [m4]
    real(dp) :: dx, dz, t, t2, t2_max, g
    integer :: i

    t2_max = 0.0_dp
    do i = 1, n
      dx = row(i + LANES*BOND(m)%second, UX) - q(i + LANES*BOND(m)%first, UX)
      dz = row(i + LANES*BOND(m)%second, UZ) - q(i + LANES*BOND(m)%first, UZ)
      t = dx*plus(2.0_dp*BOND(m)%d(1), l, dx) + dz*plus(2.0_dp*BOND(m)%d(2), l, dz)
      t2 = t*t
      t2_max = max(t2_max, t2)
      g = t*((c(1) + t*c(2)) + t2*((c(3) + t*c(4)) + t2*((c(5) + t*c(6)) + t2*c(7))))
      fx(i) = g*plus(BOND(m)%d(1), l, dx)
      fz(i) = g*plus(BOND(m)%d(2), l, dz)
    end do
    strain = max(strain, t2_max/sum(BOND(m)%d**2)**2)
  end subroutine by_series

  !> c l + dx; only dx, without an addition, if c is 0.
  pure function plus(c, l, dx) result(x)
    real(dp), intent(in) :: c
    real(dp), intent(in) :: l   !! lattice constant [m]
    real(dp), intent(in) :: dx  !! difference of displacements [m]
    real(dp) :: x

    x = dx
    if (abs(c) > 0.0_dp) x = c*l + dx
  end function plus

  !> Forces of springs of bond m in closed form, for strains beyond the range of the series.
  pure subroutine in_closed_form(s, m, q, row, fx, fz)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row of the first blocks of the bonds
    real(dp), intent(in) :: row(LB:s%n + LANES, 4) !! the row of the second blocks of the bonds
    real(dp), intent(out) :: fx(LB:s%n + LANES)    !! forces on the first blocks [N]
    real(dp), intent(out) :: fz(LB:s%n + LANES)    !! forces along z [N]
    real(dp) :: k, d(2), l2, dx, dz, t, g
    integer :: i

    k = BOND(m)%stiffness*s%k
    d = s%l*BOND(m)%d
    l2 = d(1)**2 + d(2)**2
    do i = 1, s%n
      dx = row(i + LANES*BOND(m)%second, UX) - q(i + LANES*BOND(m)%first, UX)
      dz = row(i + LANES*BOND(m)%second, UZ) - q(i + LANES*BOND(m)%first, UZ)
      t = (dx*(2.0_dp*d(1) + dx) + dz*(2.0_dp*d(2) + dz))/l2
      g = k*t/((1.0_dp + t) + sqrt(1.0_dp + t))
      fx(i) = g*(d(1) + dx)
      fz(i) = g*(d(2) + dz)
    end do
  end subroutine in_closed_form

  !> Adds the forces of dashpots along bond m.
  pure subroutine add_dashpots(s, m, q, row, fx, fz)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row of the first blocks of the bonds
    real(dp), intent(in) :: row(LB:s%n + LANES, 4) !! the row of the second blocks of the bonds
    real(dp), intent(inout) :: fx(LB:s%n + LANES)  !! forces on the first blocks [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)  !! forces along z [N]
    real(dp) :: d(2), x, z, dvx, dvz, g
    integer :: i

    d = s%l*BOND(m)%d
    do i = 1, s%n
      x = d(1) + (row(i + LANES*BOND(m)%second, UX) - q(i + LANES*BOND(m)%first, UX))
      z = d(2) + (row(i + LANES*BOND(m)%second, UZ) - q(i + LANES*BOND(m)%first, UZ))
      dvx = row(i + LANES*BOND(m)%second, VX) - q(i + LANES*BOND(m)%first, VX)
      dvz = row(i + LANES*BOND(m)%second, VZ) - q(i + LANES*BOND(m)%first, VZ)
      g = s%eta*(x*dvx + z*dvz)/(x**2 + z**2)
      fx(i) = fx(i) + g*x
      fz(i) = fz(i) + g*z
    end do
  end subroutine add_dashpots

  !> One component of the force on a row, from its own bonds and from carry. On return, carry belongs to the row above.
  pure subroutine gather(n, b, c, carry, f)
    integer, intent(in) :: n                           !! length of a row
    real(dp), intent(in) :: b(LB:n + LANES, 2, N_BOND) !! forces on the first blocks [N]
    integer, intent(in) :: c                           !! component
    real(dp), intent(inout) :: carry(LB:n + LANES)     !! force on the row from below; then on the row above [N]
    real(dp), intent(out) :: f(LB:n + LANES)           !! force on the row [N]
    integer :: i

    do i = 1, n
      f(i) = ((b(i, c, BESIDE) - b(i - LANES, c, BESIDE)) + (b(i, c, RIGHT) + b(i - LANES, c, LEFT))) &
             + (b(i, c, ABOVE) + carry(i))
      carry(i) = -(b(i, c, ABOVE) + (b(i - LANES, c, RIGHT) + b(i, c, LEFT)))
    end do
  end subroutine gather
end module pyfric_finite
