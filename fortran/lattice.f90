!> Forces of the springs and dashpots of the lattice, row by row.
!>
!> A row q holds u_x, u_z, v_x, v_z; neighbours in it are LANES elements apart (see pyfric_model). In linear geometry,
!> and for the dashpots, a block gathers what its eight neighbours do to it. In finite geometry each bond is evaluated
!> once, in the row where it starts, and what it does to the row above is carried along to it. Sums pair left with right
!> neighbours, so that a mirrored lattice gives the mirrored bits, and a translation gives no force, to the last bit.
module pyfric_lattice
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, S_SERIES, close_left, image, MIRRORED
  implicit none (type, external)
  private
  public :: forces_linear, elastic_finite, viscous, along_linear, along_finite, bond_power, bond_energy
  public :: halve_bonds, halved_power, halved_energy
  public :: N_BOND

  !> Columns of the bond buffer b(LB:n+LANES, N_BOND) of finite geometry: force on the first block of each bond [N].
  !> Horizontal h(i): (i) - (i+1), vertical w(i): (i) - (i), diagonals d1(i): (i) - (i+1) and d2(i): (i+1) - (i).
  integer, parameter :: HX = 1, HZ = 2, D1X = 3, D1Z = 4, D2X = 5, D2Z = 6, WX = 7, WZ = 8, N_BOND = 8

contains

  !> Linear geometry: F = k n (n.du) with n = (1, 0), (0, 1), and (k/2) n (n.du) with n = (1, 1)/sqrt(2), (-1, 1)/sqrt(2).
  !>
  !> All eight bonds of a block, with c its own displacement and up, dn, E, W those around it:
  !> F_x = (k/4)(4 (E + W)_x + sum of diagonal u_x + (NE - NW - SE + SW)_z - 12 c_x), F_z likewise with N + S for E + W.
  !> Rows that do not exist are passed as zero: `rows` (0 to 2) of them exist, and edge is +1 (above only), -1 (below
  !> only) or 0.
  pure subroutine forces_linear(n, last, goes_on, k, eta, rows, edge, dn, q, up, fx, fz)
    integer, intent(in) :: n           !! padded length of a row
    integer, intent(in) :: last        !! element of the last block
    logical, intent(in) :: goes_on(2)  !! beyond the left and right sides are images of the blocks there
    real(dp), intent(in) :: k          !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: eta        !! viscosity [N s/m]
    real(dp), intent(in) :: rows       !! neighbouring rows
    real(dp), intent(in) :: edge       !! side of the only neighbouring row
    real(dp), intent(in) :: dn(LB:n + LANES, 4) !! the row below
    real(dp), intent(in) :: q(LB:n + LANES, 4) !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4) !! the row above
    real(dp), intent(out) :: fx(LB:n + LANES)     !! force on the row [N]
    real(dp), intent(out) :: fz(LB:n + LANES)     !! force on the row [N]
    real(dp) :: k4, c_x, c_z, c_v
    integer :: i

    k4 = 0.25_dp*k
    c_x = 8.0_dp + 2.0_dp*rows
    c_z = 6.0_dp*rows
    c_v = 2.0_dp + 3.0_dp*rows
    do i = 1, n
      fx(i) = k4*((4.0_dp*(q(i + LANES, UX) + q(i - LANES, UX)) &
                   + (((up(i + LANES, UX) + dn(i + LANES, UX)) + (up(i - LANES, UX) + dn(i - LANES, UX))) &
                      + ((up(i + LANES, UZ) - dn(i + LANES, UZ)) - (up(i - LANES, UZ) - dn(i - LANES, UZ))))) - c_x*q(i, UX)) &
              + eta*(((q(i + LANES, VX) + q(i - LANES, VX)) + ((up(i, VX) + dn(i, VX)) &
                          + ((up(i + LANES, VX) + dn(i + LANES, VX)) + (up(i - LANES, VX) + dn(i - LANES, VX))))) - c_v*q(i, VX))
      fz(i) = k4*((4.0_dp*(up(i, UZ) + dn(i, UZ)) &
                   + (((up(i + LANES, UZ) + dn(i + LANES, UZ)) + (up(i - LANES, UZ) + dn(i - LANES, UZ))) &
                      + ((up(i + LANES, UX) - dn(i + LANES, UX)) - (up(i - LANES, UX) - dn(i - LANES, UX))))) - c_z*q(i, UZ)) &
              + eta*(((q(i + LANES, VZ) + q(i - LANES, VZ)) + ((up(i, VZ) + dn(i, VZ)) &
                          + ((up(i + LANES, VZ) + dn(i + LANES, VZ)) + (up(i - LANES, VZ) + dn(i - LANES, VZ))))) - c_v*q(i, VZ))
    end do
    if (.not. goes_on(1)) call wall_linear(n, k4, eta, rows, edge, 1, 1 + LANES, 1.0_dp, dn, q, up, fx, fz)
    if (.not. goes_on(2)) call wall_linear(n, k4, eta, rows, edge, last, last - LANES, -1.0_dp, dn, q, up, fx, fz)
  end subroutine forces_linear

  !> The same for a block at a side wall, which has neighbours in its own column and in column c.
  pure subroutine wall_linear(n, k4, eta, rows, edge, i, c, side, dn, q, up, fx, fz)
    integer, intent(in) :: n           !! padded length of a row
    real(dp), intent(in) :: k4          !! k/4 [N/m]
    real(dp), intent(in) :: eta         !! viscosity [N s/m]
    real(dp), intent(in) :: rows        !! neighbouring rows
    real(dp), intent(in) :: edge        !! side of the only neighbouring row
    integer, intent(in) :: i            !! column of the wall
    integer, intent(in) :: c            !! its neighbour
    real(dp), intent(in) :: side        !! +1: the neighbour is on the right, -1: on the left
    real(dp), intent(in) :: dn(LB:n + LANES, 4) !! the row below
    real(dp), intent(in) :: q(LB:n + LANES, 4) !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4) !! the row above
    real(dp), intent(inout) :: fx(LB:n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:n + LANES)    !! force on the row [N]

    fx(i) = k4*((4.0_dp*q(c, UX) + ((up(c, UX) + dn(c, UX)) + side*((up(c, UZ) - dn(c, UZ)) - edge*q(i, UZ)))) &
                - (4.0_dp + rows)*q(i, UX))
    fz(i) = k4*((4.0_dp*(up(i, UZ) + dn(i, UZ)) &
                 + ((up(c, UZ) + dn(c, UZ)) + side*((up(c, UX) - dn(c, UX)) - edge*q(i, UX)))) - (5.0_dp*rows)*q(i, UZ))
    call wall_viscous(n, eta, rows, i, c, dn, q, up, fx, fz)
  end subroutine wall_linear

  !> Adds the dashpots, eta (v_j - v_i) on all eight bonds.
  pure subroutine viscous(n, last, eta, rows, dn, q, up, fx, fz)
    integer, intent(in) :: n                       !! padded length of a row
    integer, intent(in) :: last                    !! element of the last block
    real(dp), intent(in) :: eta                    !! viscosity [N s/m]
    real(dp), intent(in) :: rows                   !! neighbouring rows; those that do not exist are passed as zero
    real(dp), intent(in) :: dn(LB:n + LANES, 4)    !! the row below
    real(dp), intent(in) :: q(LB:n + LANES, 4)     !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4)    !! the row above
    real(dp), intent(inout) :: fx(LB:n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:n + LANES)    !! force on the row [N]
    real(dp) :: c, left(2), right(2)
    integer :: i

    left = [fx(1), fz(1)]
    right = [fx(last), fz(last)]
    c = 2.0_dp + 3.0_dp*rows
    do i = 1, n
      fx(i) = fx(i) + eta*(((q(i + LANES, VX) + q(i - LANES, VX)) + ((up(i, VX) + dn(i, VX)) &
                            + ((up(i + LANES, VX) + dn(i + LANES, VX)) + (up(i - LANES, VX) + dn(i - LANES, VX))))) - c*q(i, VX))
      fz(i) = fz(i) + eta*(((q(i + LANES, VZ) + q(i - LANES, VZ)) + ((up(i, VZ) + dn(i, VZ)) &
                            + ((up(i + LANES, VZ) + dn(i + LANES, VZ)) + (up(i - LANES, VZ) + dn(i - LANES, VZ))))) - c*q(i, VZ))
    end do
    fx(1) = left(1)
    fz(1) = left(2)
    fx(last) = right(1)
    fz(last) = right(2)
    call wall_viscous(n, eta, rows, 1, 1 + LANES, dn, q, up, fx, fz)
    call wall_viscous(n, eta, rows, last, last - LANES, dn, q, up, fx, fz)
  end subroutine viscous

  !> The same for a block at a side wall, which has neighbours in its own column and in column c.
  pure subroutine wall_viscous(n, eta, rows, i, c, dn, q, up, fx, fz)
    integer, intent(in) :: n                       !! padded length of a row
    real(dp), intent(in) :: eta                    !! viscosity [N s/m]
    real(dp), intent(in) :: rows                   !! neighbouring rows
    integer, intent(in) :: i                       !! element of the block at the wall
    integer, intent(in) :: c                       !! element of its neighbour
    real(dp), intent(in) :: dn(LB:n + LANES, 4)    !! the row below
    real(dp), intent(in) :: q(LB:n + LANES, 4)     !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4)    !! the row above
    real(dp), intent(inout) :: fx(LB:n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:n + LANES)    !! force on the row [N]

    fx(i) = fx(i) + eta*((q(c, VX) + ((up(i, VX) + dn(i, VX)) + (up(c, VX) + dn(c, VX)))) - (1.0_dp + 2.0_dp*rows)*q(i, VX))
    fz(i) = fz(i) + eta*((q(c, VZ) + ((up(i, VZ) + dn(i, VZ)) + (up(c, VZ) + dn(c, VZ)))) - (1.0_dp + 2.0_dp*rows)*q(i, VZ))
  end subroutine wall_viscous

  !> Finite geometry: forces of the springs on a row; carry holds those from below, and on return those on the row above.
  pure subroutine elastic_finite(n, last, k, l, near, diagonal, has_up, q, up, b, carry, fx, fz)
    integer, intent(in) :: n           !! padded length of a row
    integer, intent(in) :: last        !! element of the last block
    real(dp), intent(in) :: k                   !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                   !! lattice constant [m]
    real(dp), intent(in) :: near(7)             !! series of a spring of length l
    real(dp), intent(in) :: diagonal(7)         !! series of a diagonal spring
    logical, intent(in) :: has_up               !! there is a row above; else up is not read
    real(dp), intent(in) :: q(LB:n + LANES, 4) !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4) !! the row above
    real(dp), intent(inout) :: b(LB:n + LANES, N_BOND)   !! work space; zero where there is no bond
    real(dp), intent(inout) :: carry(LB:n + LANES, 2)      !! forces on the row from below; then on the row above [N]
    real(dp), intent(out) :: fx(LB:n + LANES)              !! force on the row [N]
    real(dp), intent(out) :: fz(LB:n + LANES)              !! force on the row [N]
    real(dp) :: t_max, t_up
    integer :: i

    call horizontal_finite(n, near, l, q, b, t_max)
    if (has_up) then
      call up_finite(n, near, diagonal, l, q, up, b, t_up)
      t_max = max(t_max, t_up)
    else
      b(:, D1X:WZ) = 0.0_dp
    end if
    if (t_max > (S_SERIES*l**2)**2) call bonds_exact(n, k, l, has_up, q, up, b)
    b(last, HX:D2Z) = 0.0_dp
    do i = HX, D2Z
      call close_left(n, b(LB, i))
    end do
    call gather(n, b(LB, HX), b(LB, D1X), b(LB, D2X), b(LB, WX), carry(LB, 1), fx)
    call gather(n, b(LB, HZ), b(LB, D1Z), b(LB, D2Z), b(LB, WZ), carry(LB, 2), fz)
  end subroutine elastic_finite

  !> The sum of the series.
  pure function summed(c, t) result(g)
    real(dp), intent(in) :: c(7)
    real(dp), intent(in) :: t     !! r^2 - l0^2 [m2]
    real(dp) :: g, t2

    t2 = t*t
    g = t*((c(1) + t*c(2)) + t2*((c(3) + t*c(4)) + t2*((c(5) + t*c(6)) + t2*c(7))))
  end function summed

  !> Finite geometry: F = k (r - l0)/r (d + du), bonds within a row, by the series.
  pure subroutine horizontal_finite(n, c, l, q, b, t_max)
    integer, intent(in) :: n           !! padded length of a row
    real(dp), intent(in) :: c(7)                !! series of a spring of length l
    real(dp), intent(in) :: l                   !! lattice constant [m]
    real(dp), intent(in) :: q(LB:n + LANES, 4) !! the row
    real(dp), intent(inout) :: b(LB:n + LANES, N_BOND)   !! forces on the first blocks [N]
    real(dp), intent(out) :: t_max              !! largest t^2 [m4]
    real(dp) :: dx, dz, t, g
    integer :: i

    t_max = 0.0_dp
    do i = 1, n
      dx = q(i + LANES, UX) - q(i, UX)
      dz = q(i + LANES, UZ) - q(i, UZ)
      t = dx*(2.0_dp*l + dx) + dz*dz
      t_max = max(t_max, t*t)
      g = summed(c, t)
      b(i, HX) = g*(l + dx)
      b(i, HZ) = g*dz
    end do
  end subroutine horizontal_finite

  !> The bonds to the row above.
  pure subroutine up_finite(n, near, diagonal, l, q, up, b, t_max)
    integer, intent(in) :: n           !! padded length of a row
    real(dp), intent(in) :: near(7)             !! series of a spring of length l
    real(dp), intent(in) :: diagonal(7)         !! series of a diagonal spring
    real(dp), intent(in) :: l                   !! lattice constant [m]
    real(dp), intent(in) :: q(LB:n + LANES, 4) !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4) !! the row above
    real(dp), intent(inout) :: b(LB:n + LANES, N_BOND)   !! forces on the first blocks [N]
    real(dp), intent(out) :: t_max              !! largest t^2; a fourth of it on diagonals, which are longer [m4]
    real(dp) :: dx, dz, t, t1, t2, g
    integer :: i

    t_max = 0.0_dp
    do i = 1, n
      dx = up(i, UX) - q(i, UX)
      dz = up(i, UZ) - q(i, UZ)
      t = dx*dx + dz*(2.0_dp*l + dz)
      t_max = max(t_max, t*t)
      g = summed(near, t)
      b(i, WX) = g*dx
      b(i, WZ) = g*(l + dz)
    end do
    do i = 1, n
      dx = up(i + LANES, UX) - q(i, UX)
      dz = up(i + LANES, UZ) - q(i, UZ)
      t1 = dx*(2.0_dp*l + dx) + dz*(2.0_dp*l + dz)
      g = summed(diagonal, t1)
      b(i, D1X) = g*(l + dx)
      b(i, D1Z) = g*(l + dz)
      dx = up(i, UX) - q(i + LANES, UX)
      dz = up(i, UZ) - q(i + LANES, UZ)
      t2 = dx*(dx - 2.0_dp*l) + dz*(2.0_dp*l + dz)
      g = summed(diagonal, t2)
      b(i, D2X) = g*(dx - l)
      b(i, D2Z) = g*(l + dz)
      t_max = max(t_max, 0.25_dp*max(t1*t1, t2*t2))
    end do
  end subroutine up_finite

  !> All bonds that start in a row in closed form, for strains beyond the series.
  pure subroutine bonds_exact(n, k, l, has_up, q, up, b)
    integer, intent(in) :: n           !! padded length of a row
    real(dp), intent(in) :: k                    !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                    !! lattice constant [m]
    logical, intent(in) :: has_up                !! there is a row above
    real(dp), intent(in) :: q(LB:n + LANES, 4)    !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4) !! the row above
    real(dp), intent(inout) :: b(LB:n + LANES, N_BOND)    !! forces on the first blocks [N]
    integer :: i

    do i = 1, n
      b(i, [HX, HZ]) = spring(k, l, 0.0_dp, q(i, :), q(i + LANES, :))
    end do
    if (.not. has_up) return
    do i = 1, n
      b(i, [WX, WZ]) = spring(k, 0.0_dp, l, q(i, :), up(i, :))
    end do
    do i = 1, n
      b(i, [D1X, D1Z]) = spring(0.5_dp*k, l, l, q(i, :), up(i + LANES, :))
      b(i, [D2X, D2Z]) = spring(0.5_dp*k, -l, l, q(i + LANES, :), up(i, :))
    end do
  end subroutine bonds_exact

  !> Force of one spring on its first block, in closed form [N].
  pure function spring(k, d_x, d_z, first, second) result(f)
    real(dp), intent(in) :: k          !! stiffness [N/m]
    real(dp), intent(in) :: d_x        !! reference bond [m]
    real(dp), intent(in) :: d_z        !! reference bond [m]
    real(dp), intent(in) :: first(4)   !! first block
    real(dp), intent(in) :: second(4)  !! second block
    real(dp) :: f(2), dx, dz, s

    dx = second(UX) - first(UX)
    dz = second(UZ) - first(UZ)
    s = (dx*(2.0_dp*d_x + dx) + dz*(2.0_dp*d_z + dz))/(d_x**2 + d_z**2)
    f = k*s/((1.0_dp + s) + sqrt(1.0_dp + s))*[d_x + dx, d_z + dz]
  end function spring

  !> One component of the force on a row: its own bonds, and carry from below; then carry for the row above.
  pure subroutine gather(n, h, d1, d2, w, carry, f)
    integer, intent(in) :: n           !! padded length of a row
    real(dp), intent(in) :: h(LB:n + LANES)        !! horizontal bonds [N]
    real(dp), intent(in) :: d1(LB:n + LANES)       !! diagonals to the right [N]
    real(dp), intent(in) :: d2(LB:n + LANES)       !! diagonals to the left [N]
    real(dp), intent(in) :: w(LB:n + LANES)        !! vertical bonds [N]
    real(dp), intent(inout) :: carry(LB:n + LANES)   !! force on the row from below; then on the row above [N]
    real(dp), intent(out) :: f(LB:n + LANES)         !! force on the row [N]
    integer :: i

    do i = 1, n
      f(i) = ((h(i) - h(i - LANES)) + (d1(i) + d2(i - LANES))) + (w(i) + carry(i))
      carry(i) = -(w(i) + (d1(i - LANES) + d2(i)))
    end do
  end subroutine gather

  !> Adds dashpots that act along the bonds, eta n (n.dv), in linear geometry: the springs' sums with eta for k and k/2.
  pure subroutine along_linear(n, last, goes_on, eta, rows, edge, dn, q, up, fx, fz)
    integer, intent(in) :: n           !! padded length of a row
    integer, intent(in) :: last        !! element of the last block
    logical, intent(in) :: goes_on(2)  !! beyond the left and right sides are images of the blocks there
    real(dp), intent(in) :: eta        !! viscosity [N s/m]
    real(dp), intent(in) :: rows       !! neighbouring rows; those that do not exist are passed as zero
    real(dp), intent(in) :: edge       !! side of the only neighbouring row
    real(dp), intent(in) :: dn(LB:n + LANES, 4)     !! the row below
    real(dp), intent(in) :: q(LB:n + LANES, 4)      !! the row
    real(dp), intent(in) :: up(LB:n + LANES, 4)     !! the row above
    real(dp), intent(inout) :: fx(LB:n + LANES)     !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:n + LANES)     !! force on the row [N]
    real(dp) :: half, c_x, c_z, ends(4)
    integer :: i

    ends = [fx(1), fz(1), fx(last), fz(last)]
    half = 0.5_dp*eta
    c_x = 4.0_dp + 2.0_dp*rows
    c_z = 4.0_dp*rows
    do i = 1, n
      fx(i) = fx(i) + half*((2.0_dp*(q(i + LANES, VX) + q(i - LANES, VX)) &
                             + (((up(i + LANES, VX) + dn(i + LANES, VX)) + (up(i - LANES, VX) + dn(i - LANES, VX))) &
                                + ((up(i + LANES, VZ) - dn(i + LANES, VZ)) - (up(i - LANES, VZ) - dn(i - LANES, VZ))))) &
                            - c_x*q(i, VX))
      fz(i) = fz(i) + half*((2.0_dp*(up(i, VZ) + dn(i, VZ)) &
                             + (((up(i + LANES, VZ) + dn(i + LANES, VZ)) + (up(i - LANES, VZ) + dn(i - LANES, VZ))) &
                                + ((up(i + LANES, VX) - dn(i + LANES, VX)) - (up(i - LANES, VX) - dn(i - LANES, VX))))) &
                            - c_z*q(i, VZ))
    end do
    if (.not. goes_on(1)) then
      ends(:2) = ends(:2) + at_wall(1, 1 + LANES, 1.0_dp)
      fx(1) = ends(1)
      fz(1) = ends(2)
    end if
    if (.not. goes_on(2)) then
      ends(3:) = ends(3:) + at_wall(last, last - LANES, -1.0_dp)
      fx(last) = ends(3)
      fz(last) = ends(4)
    end if

  contains

    !> Force on a block at a side wall, which has neighbours in its own column and in column c [N].
    pure function at_wall(i, c, side) result(f)
      integer, intent(in) :: i
      integer, intent(in) :: c
      real(dp), intent(in) :: side  !! +1: the neighbour is on the right, -1: on the left
      real(dp) :: f(2)

      f(1) = half*((2.0_dp*q(c, VX) + ((up(c, VX) + dn(c, VX)) + side*((up(c, VZ) - dn(c, VZ)) - edge*q(i, VZ)))) &
                   - (2.0_dp + rows)*q(i, VX))
      f(2) = half*((2.0_dp*(up(i, VZ) + dn(i, VZ)) + ((up(c, VZ) + dn(c, VZ)) &
                                                      + side*((up(c, VX) - dn(c, VX)) - edge*q(i, VX)))) - 3.0_dp*rows*q(i, VZ))
    end function at_wall
  end subroutine along_linear

  !> The same in finite geometry: n is the present direction of the bond, and its rotation meets no resistance.
  pure subroutine along_finite(s, has_dn, has_up, dn, q, up, fx, fz)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_dn
    logical, intent(in) :: has_up
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)   !! the row below
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)   !! the row above
    real(dp), intent(inout) :: fx(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)   !! force on the row [N]
    real(dp) :: f(2)
    logical :: left, right
    integer :: i, e, w, o

    do i = 1, s%nx
      o = s%at(i)
      w = o - LANES
      e = o + LANES
      left = i > 1 .or. s%left == MIRRORED
      right = i < s%nx .or. s%right == MIRRORED
      f = dashpot(s, right, 1, 0, q(o, :), q(e, :)) + dashpot(s, left, -1, 0, q(o, :), q(w, :))
      f = f + (dashpot(s, has_up, 0, 1, q(o, :), up(o, :)) + dashpot(s, has_dn, 0, -1, q(o, :), dn(o, :)))
      f = f + (dashpot(s, has_up .and. right, 1, 1, q(o, :), up(e, :)) + dashpot(s, has_up .and. left, -1, 1, q(o, :), up(w, :)))
      f = f + (dashpot(s, has_dn .and. right, 1, -1, q(o, :), dn(e, :)) + dashpot(s, has_dn .and. left, -1, -1, q(o, :), dn(w, :)))
      fx(o) = fx(o) + f(1)
      fz(o) = fz(o) + f(2)
    end do
  end subroutine along_finite

  !> Force of one such dashpot on its first block [N].
  pure function dashpot(s, there, a, b, here, other) result(f)
    type(model_t), intent(in) :: s
    logical, intent(in) :: there      !! the bond exists
    integer, intent(in) :: a          !! columns to the other block
    integer, intent(in) :: b          !! rows
    real(dp), intent(in) :: here(4)   !! the first block
    real(dp), intent(in) :: other(4)  !! the other one
    real(dp) :: f(2), d(2)

    f = 0.0_dp
    if (.not. there) return
    d = s%l*[a, b]
    if (s%finite) d = d + (other(UX:UZ) - here(UX:UZ))
    f = s%eta*sum(d*(other(VX:VZ) - here(VX:VZ)))/sum(d*d)*d
  end function dashpot

  !> Power of such dashpots on the bonds that start in a row, half of those over mirrored sides and top [W].
  pure function power_along(s, has_up, q, up) result(power)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    real(dp) :: power, above(4)
    logical :: left, right
    integer :: i, o

    power = 0.0_dp
    do i = 1, s%nx
      o = s%at(i)
      left = i > 1 .or. s%left == MIRRORED
      right = i < s%nx .or. s%right == MIRRORED
      if (i < s%nx) power = power + lost(.true., 1, 0, q(o, :), q(o + LANES, :))
      if (has_up) then
        power = power + lost(.true., 0, 1, q(o, :), up(o, :)) &
                + (lost(right, 1, 1, q(o, :), up(o + LANES, :)) + lost(left, -1, 1, q(o, :), up(o - LANES, :)))
      else if (s%top == MIRRORED) then
        above = image(q(o + LANES, :))
        power = power + 0.5_dp*lost(.true., 0, 1, q(o, :), image(q(o, :))) + lost(i < s%nx, 1, 1, q(o, :), above)
      end if
    end do

  contains

    pure function lost(there, a, b, here, other) result(rate)
      logical, intent(in) :: there
      integer, intent(in) :: a
      integer, intent(in) :: b
      real(dp), intent(in) :: here(4)
      real(dp), intent(in) :: other(4)
      real(dp) :: rate

      rate = sum(dashpot(s, there, a, b, here, other)*(other(VX:VZ) - here(VX:VZ)))
    end function lost
  end function power_along

  !> Takes half of the bonds within the bottom row off its forces: its blocks are half blocks, as a cut along the row
  !> leaves them.
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

  !> The power that is dissipated in these halves, those over mirrored sides included [W].
  pure function halved_power(s, q) result(power)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)  !! the row
    real(dp) :: power, dv(2)
    integer :: i, o

    power = 0.0_dp
    do i = 1, s%nx - 1
      o = s%at(i)
      dv = q(o + LANES, VX:VZ) - q(o, VX:VZ)
      if (s%along) dv(2) = 0.0_dp
      power = power + 0.5_dp*s%eta*sum(dv**2)
    end do
    if (s%along) return
    if (s%left == MIRRORED) power = power + s%eta*q(1, VZ)**2
    if (s%right == MIRRORED) power = power + s%eta*q(s%at(s%nx), VZ)**2
  end function halved_power

  !> The elastic energy of these halves [J].
  pure function halved_energy(s, q) result(energy)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(s%nx, 4)  !! the row
    real(dp) :: energy

    energy = 0.25_dp*s%k*sum((q(2:, UX) - q(:s%nx - 1, UX))**2)
  end function halved_energy

  !> Power dissipated by the bonds that start in a row, sum of eta |dv|^2 [W].
  pure function bond_power(s, has_up, q, up) result(power)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    real(dp) :: power
    real(dp) :: w(s%n), w_last
    integer :: i, last

    if (s%along) then
      power = power_along(s, has_up, q, up)
      return
    end if
    last = s%at(s%nx)
    w_last = 0.0_dp
    do i = 1, s%n
      w(i) = (q(i + LANES, VX) - q(i, VX))**2 + (q(i + LANES, VZ) - q(i, VZ))**2
    end do
    if (has_up) then
      do i = 1, s%n
        w(i) = (w(i) + ((up(i, VX) - q(i, VX))**2 + (up(i, VZ) - q(i, VZ))**2)) &
               + (((up(i + LANES, VX) - q(i, VX))**2 + (up(i + LANES, VZ) - q(i, VZ))**2) &
                  + ((up(i, VX) - q(i + LANES, VX))**2 + (up(i, VZ) - q(i + LANES, VZ))**2))
      end do
      w_last = (up(last, VX) - q(last, VX))**2 + (up(last, VZ) - q(last, VZ))**2
    end if
    w(last) = w_last
    if (s%right == MIRRORED) w(s%at(s%nx + 1:)) = 0.0_dp
    power = s%eta*lane_sum(s%n, w)
    if (s%left == MIRRORED) power = power + s%eta*over_side(has_up, q(1, :), up(1, :))
    if (s%right == MIRRORED) power = power + s%eta*over_side(has_up, q(last, :), up(last, :))
    if (s%top == MIRRORED .and. .not. has_up) power = power + s%eta*over_top(s, q(s%at(:s%nx), :))
  end function bond_power

  !> |dv|^2 of the bonds of a block over a mirrored side: half of the one within the row, one of two alike diagonals.
  pure function over_side(has_up, block, up) result(w)
    logical, intent(in) :: has_up
    real(dp), intent(in) :: block(4)  !! at the side
    real(dp), intent(in) :: up(4)     !! above it
    real(dp) :: w, dv(4)

    w = 2.0_dp*block(VZ)**2
    if (.not. has_up) return
    dv = image(up) - block
    w = w + (dv(VX)**2 + dv(VZ)**2)
  end function over_side

  !> The same over a mirrored top, all blocks of the top row together.
  pure function over_top(s, q) result(w)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(s%nx, 4)  !! the top row
    real(dp) :: w, dv(4)
    integer :: i

    w = 2.0_dp*q(s%nx, VZ)**2
    do i = 1, s%nx - 1
      dv = image(q(i + 1, :)) - q(i, :)
      w = w + (2.0_dp*q(i, VZ)**2 + (dv(VX)**2 + dv(VZ)**2))
    end do
  end function over_top

  !> A sum lane by lane: vectorises, and its order does not depend on the processor.
  pure function lane_sum(n, w) result(total)
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)
    real(dp) :: total
    real(dp) :: lane(LANES)
    integer :: i

    lane = 0.0_dp
    do i = 1, n, LANES
      lane = lane + w(i:i + LANES - 1)
    end do
    total = (lane(1) + lane(2)) + (lane(3) + lane(4))
  end function lane_sum

  !> Elastic energy of the bonds that start in a row: k (r - l0)^2/2, or k (n.du)^2/2 in linear geometry [J].
  pure function bond_energy(s, has_up, q, up) result(energy)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: q(s%nx, 4)  !! the row
    real(dp), intent(in) :: up(s%nx, 4)  !! the row above
    real(dp) :: energy
    integer :: i

    energy = 0.0_dp
    do i = 1, s%nx - 1
      energy = energy + one(s%k, s%l, 0.0_dp, q(i, :), q(i + 1, :))
    end do
    if (.not. has_up) then
      if (s%top == MIRRORED) energy = energy + over_top()
      return
    end if
    if (s%left == MIRRORED) energy = energy + one(0.5_dp*s%k, -s%l, s%l, q(1, :), image(up(1, :)))
    if (s%right == MIRRORED) energy = energy + one(0.5_dp*s%k, s%l, s%l, q(s%nx, :), image(up(s%nx, :)))
    do i = 1, s%nx
      energy = energy + one(s%k, 0.0_dp, s%l, q(i, :), up(i, :))
    end do
    do i = 1, s%nx - 1
      energy = energy + (one(0.5_dp*s%k, s%l, s%l, q(i, :), up(i + 1, :)) &
                         + one(0.5_dp*s%k, -s%l, s%l, q(i + 1, :), up(i, :)))
    end do

  contains

    pure function one(k, d_x, d_z, a, b) result(e)
      real(dp), intent(in) :: k     !! stiffness [N/m]
      real(dp), intent(in) :: d_x   !! reference bond [m]
      real(dp), intent(in) :: d_z   !! reference bond [m]
      real(dp), intent(in) :: a(4)  !! first block
      real(dp), intent(in) :: b(4)  !! second block
      real(dp) :: e, dx, dz, l0, stretch

      dx = b(UX) - a(UX)
      dz = b(UZ) - a(UZ)
      l0 = sqrt(d_x*d_x + d_z*d_z)
      if (s%finite) then
        stretch = (dx*(2.0_dp*d_x + dx) + dz*(2.0_dp*d_z + dz))/(sqrt((d_x + dx)**2 + (d_z + dz)**2) + l0)
      else
        stretch = (d_x*dx + d_z*dz)/l0
      end if
      e = 0.5_dp*k*stretch**2
    end function one

    !> Half of the bonds over a mirrored top.
    pure function over_top() result(e)
      real(dp) :: e
      integer :: i

      e = 0.0_dp
      do i = 1, s%nx
        e = e + 0.5_dp*one(s%k, 0.0_dp, s%l, q(i, :), image(q(i, :)))
        if (i < s%nx) e = e + one(0.5_dp*s%k, s%l, s%l, q(i, :), image(q(i + 1, :)))
      end do
    end function over_top
  end function bond_energy
end module pyfric_lattice
