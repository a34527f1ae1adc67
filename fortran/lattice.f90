!> Forces of the springs and dashpots of the lattice, row by row.
!>
!> A row q(N_x, 4) holds u_x, u_z, v_x, v_z. In linear geometry, and for the dashpots, a block gathers what its eight
!> neighbours do to it. In finite geometry each bond is evaluated once, in the row where it starts, and what it does to
!> the row above is carried along to it. Sums pair left with right neighbours, so that a mirrored lattice gives the
!> mirrored bits, and a translation gives no force, to the last bit.
module pyfric_lattice
  use pyfric_kinds, only: dp
  use pyfric_model, only: model_t, UX, UZ, VX, VZ
  implicit none (type, external)
  private
  public :: elastic_linear, elastic_finite, viscous, bond_power, bond_energy
  public :: N_BOND

  !> Columns of the bond buffer b(0:N_x, N_BOND) of finite geometry: force on the first block of each bond [N].
  !> Horizontal h(i): (i) - (i+1), vertical w(i): (i) - (i), diagonals d1(i): (i) - (i+1) and d2(i): (i+1) - (i).
  integer, parameter :: HX = 1, HZ = 2, D1X = 3, D1Z = 4, D2X = 5, D2Z = 6, WX = 7, WZ = 8, N_BOND = 8

  !> Up to this |s|, s = (r/l0)^2 - 1, the series of 1 - l0/r is exact to machine precision.
  real(dp), parameter :: S_SERIES = 2.0_dp**(-7)

contains

  !> Linear geometry: F = k n (n.du) with n = (1, 0), (0, 1), and (k/2) n (n.du) with n = (1, 1)/sqrt(2), (-1, 1)/sqrt(2).
  !>
  !> All eight bonds of a block, with c its own displacement and up, dn, E, W those around it:
  !> F_x = (k/4)(4 (E + W)_x + sum of diagonal u_x + (NE - NW - SE + SW)_z - 12 c_x), F_z likewise with N + S for E + W.
  !> Rows that do not exist are passed as zero: `rows` (0 to 2) of them exist, and edge is +1 (above only), -1 (below
  !> only) or 0.
  pure subroutine elastic_linear(n, k, rows, edge, dn, q, up, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k          !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: rows       !! neighbouring rows
    real(dp), intent(in) :: edge       !! side of the only neighbouring row
    real(dp), intent(in) :: dn(n, 4)   !! the row below
    real(dp), intent(in) :: q(n, 4)    !! the row
    real(dp), intent(in) :: up(n, 4)   !! the row above
    real(dp), intent(out) :: fx(n)     !! force on the row [N]
    real(dp), intent(out) :: fz(n)     !! force on the row [N]
    real(dp) :: k4, c_x, c_z
    integer :: i

    k4 = 0.25_dp*k
    c_x = 8.0_dp + 2.0_dp*rows
    c_z = 6.0_dp*rows
    do i = 2, n - 1
      fx(i) = k4*((4.0_dp*(q(i + 1, UX) + q(i - 1, UX)) &
                   + (((up(i + 1, UX) + dn(i + 1, UX)) + (up(i - 1, UX) + dn(i - 1, UX))) &
                      + ((up(i + 1, UZ) - dn(i + 1, UZ)) - (up(i - 1, UZ) - dn(i - 1, UZ))))) - c_x*q(i, UX))
      fz(i) = k4*((4.0_dp*(up(i, UZ) + dn(i, UZ)) &
                   + (((up(i + 1, UZ) + dn(i + 1, UZ)) + (up(i - 1, UZ) + dn(i - 1, UZ))) &
                      + ((up(i + 1, UX) - dn(i + 1, UX)) - (up(i - 1, UX) - dn(i - 1, UX))))) - c_z*q(i, UZ))
    end do
    call wall_linear(n, k4, rows, edge, 1, 2, 1.0_dp, dn, q, up, fx, fz)
    call wall_linear(n, k4, rows, edge, n, n - 1, -1.0_dp, dn, q, up, fx, fz)
  end subroutine elastic_linear

  !> The same for a block at a side wall, which has neighbours in its own column and in column c.
  pure subroutine wall_linear(n, k4, rows, edge, i, c, side, dn, q, up, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k4          !! k/4 [N/m]
    real(dp), intent(in) :: rows        !! neighbouring rows
    real(dp), intent(in) :: edge        !! side of the only neighbouring row
    integer, intent(in) :: i            !! column of the wall
    integer, intent(in) :: c            !! its neighbour
    real(dp), intent(in) :: side        !! +1: the neighbour is on the right, -1: on the left
    real(dp), intent(in) :: dn(n, 4)    !! the row below
    real(dp), intent(in) :: q(n, 4)     !! the row
    real(dp), intent(in) :: up(n, 4)    !! the row above
    real(dp), intent(inout) :: fx(n)    !! force on the row [N]
    real(dp), intent(inout) :: fz(n)    !! force on the row [N]

    fx(i) = k4*((4.0_dp*q(c, UX) + ((up(c, UX) + dn(c, UX)) + side*((up(c, UZ) - dn(c, UZ)) - edge*q(i, UZ)))) &
                - (4.0_dp + rows)*q(i, UX))
    fz(i) = k4*((4.0_dp*(up(i, UZ) + dn(i, UZ)) &
                 + ((up(c, UZ) + dn(c, UZ)) + side*((up(c, UX) - dn(c, UX)) - edge*q(i, UX)))) - (5.0_dp*rows)*q(i, UZ))
  end subroutine wall_linear

  !> Adds the dashpots, eta (v_j - v_i) on all eight bonds, of one component of the motion.
  pure subroutine viscous(n, eta, rows, dn, v, up, f)
    integer, intent(in) :: n
    real(dp), intent(in) :: eta     !! viscosity [N s/m]
    real(dp), intent(in) :: rows    !! neighbouring rows; those that do not exist are passed as zero
    real(dp), intent(in) :: dn(n)   !! velocity of the row below [m/s]
    real(dp), intent(in) :: v(n)    !! velocity of the row [m/s]
    real(dp), intent(in) :: up(n)   !! velocity of the row above [m/s]
    real(dp), intent(inout) :: f(n) !! force on the row [N]
    real(dp) :: c
    integer :: i

    c = 2.0_dp + 3.0_dp*rows
    do i = 2, n - 1
      f(i) = f(i) + eta*(((v(i + 1) + v(i - 1)) + ((up(i) + dn(i)) &
                          + ((up(i + 1) + dn(i + 1)) + (up(i - 1) + dn(i - 1))))) - c*v(i))
    end do
    c = 1.0_dp + 2.0_dp*rows
    f(1) = f(1) + eta*((v(2) + ((up(1) + dn(1)) + (up(2) + dn(2)))) - c*v(1))
    f(n) = f(n) + eta*((v(n - 1) + ((up(n) + dn(n)) + (up(n - 1) + dn(n - 1)))) - c*v(n))
  end subroutine viscous

  !> Finite geometry: forces of the springs on a row; carry holds those from below, and on return those on the row above.
  pure subroutine elastic_finite(n, k, l, has_up, q, up, b, carry, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                   !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                   !! lattice constant [m]
    logical, intent(in) :: has_up               !! there is a row above; else up is not read
    real(dp), intent(in) :: q(n, 4)             !! the row
    real(dp), intent(in) :: up(n, 4)            !! the row above
    real(dp), intent(inout) :: b(0:n, N_BOND)   !! work space; b(0, :) and b(N_x, :D2Z) are zero
    real(dp), intent(inout) :: carry(n, 2)      !! forces on the row from below; then on the row above [N]
    real(dp), intent(out) :: fx(n)              !! force on the row [N]
    real(dp), intent(out) :: fz(n)              !! force on the row [N]
    real(dp) :: t_max, t_up

    call horizontal_finite(n, k, l, q, b, t_max)
    if (has_up) then
      call up_finite(n, k, l, q, up, b, t_up)
      t_max = max(t_max, t_up)
    else
      b(:, D1X:WZ) = 0.0_dp
    end if
    if (t_max > S_SERIES*l**2) call bonds_exact(n, k, l, has_up, q, up, b)
    call gather(n, b(0, HX), b(0, D1X), b(0, D2X), b(0, WX), carry(1, 1), fx)
    call gather(n, b(0, HZ), b(0, D1Z), b(0, D2Z), b(0, WZ), carry(1, 2), fz)
  end subroutine elastic_finite

  !> Coefficients c_n of k (r - l0)/r = sum of c_n t^n, n = 1..8, in t = r^2 - l0^2 = 2 d.du + |du|^2.
  !>
  !> With s = t/l0^2, (r - l0)/r = 1 - (1 + s)^(-1/2), whose Taylor coefficients are -(-1)^n (2n-1)!!/(2n)!!.
  pure function series(k, l2) result(c)
    real(dp), intent(in) :: k   !! stiffness of the bond [N/m]
    real(dp), intent(in) :: l2  !! its length squared [m2]
    real(dp) :: c(8)
    integer :: n

    c(1) = 0.5_dp*k/l2
    do n = 2, 8
      c(n) = -c(n - 1)*real(2*n - 1, dp)/(real(2*n, dp)*l2)
    end do
  end function series

  !> The sum of the series.
  pure function summed(c, t) result(g)
    real(dp), intent(in) :: c(8)
    real(dp), intent(in) :: t     !! r^2 - l0^2 [m2]
    real(dp) :: g, t2

    t2 = t*t
    g = t*((c(1) + t*c(2)) + t2*((c(3) + t*c(4)) + t2*((c(5) + t*c(6)) + t2*(c(7) + t*c(8)))))
  end function summed

  !> Finite geometry: F = k (r - l0)/r (d + du), bonds within a row, by the series.
  pure subroutine horizontal_finite(n, k, l, q, b, t_max)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                   !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                   !! lattice constant [m]
    real(dp), intent(in) :: q(n, 4)             !! the row
    real(dp), intent(inout) :: b(0:n, N_BOND)   !! forces on the first blocks [N]
    real(dp), intent(out) :: t_max              !! largest |t| [m2]
    real(dp) :: c(8), dx, dz, t, g
    integer :: i

    c = series(k, l*l)
    t_max = 0.0_dp
    do i = 1, n - 1
      dx = q(i + 1, UX) - q(i, UX)
      dz = q(i + 1, UZ) - q(i, UZ)
      t = dx*(2.0_dp*l + dx) + dz*dz
      t_max = max(t_max, abs(t))
      g = summed(c, t)
      b(i, HX) = g*(l + dx)
      b(i, HZ) = g*dz
    end do
  end subroutine horizontal_finite

  !> The bonds to the row above.
  pure subroutine up_finite(n, k, l, q, up, b, t_max)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                   !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                   !! lattice constant [m]
    real(dp), intent(in) :: q(n, 4)             !! the row
    real(dp), intent(in) :: up(n, 4)            !! the row above
    real(dp), intent(inout) :: b(0:n, N_BOND)   !! forces on the first blocks [N]
    real(dp), intent(out) :: t_max              !! largest |t|; half of it on diagonals, which are longer [m2]
    real(dp) :: c(8), dx, dz, t, t1, t2, g
    integer :: i

    c = series(k, l*l)
    t_max = 0.0_dp
    do i = 1, n
      dx = up(i, UX) - q(i, UX)
      dz = up(i, UZ) - q(i, UZ)
      t = dx*dx + dz*(2.0_dp*l + dz)
      t_max = max(t_max, abs(t))
      g = summed(c, t)
      b(i, WX) = g*dx
      b(i, WZ) = g*(l + dz)
    end do
    c = series(0.5_dp*k, 2.0_dp*l*l)
    do i = 1, n - 1
      dx = up(i + 1, UX) - q(i, UX)
      dz = up(i + 1, UZ) - q(i, UZ)
      t1 = dx*(2.0_dp*l + dx) + dz*(2.0_dp*l + dz)
      g = summed(c, t1)
      b(i, D1X) = g*(l + dx)
      b(i, D1Z) = g*(l + dz)
      dx = up(i, UX) - q(i + 1, UX)
      dz = up(i, UZ) - q(i + 1, UZ)
      t2 = dx*(dx - 2.0_dp*l) + dz*(2.0_dp*l + dz)
      g = summed(c, t2)
      b(i, D2X) = g*(dx - l)
      b(i, D2Z) = g*(l + dz)
      t_max = max(t_max, 0.5_dp*max(abs(t1), abs(t2)))
    end do
  end subroutine up_finite

  !> All bonds that start in a row in closed form, for strains beyond the series.
  pure subroutine bonds_exact(n, k, l, has_up, lo, up, b)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                    !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                    !! lattice constant [m]
    logical, intent(in) :: has_up                !! there is a row above
    real(dp), intent(in) :: lo(n, 4)             !! the row
    real(dp), intent(in) :: up(n, 4)             !! the row above
    real(dp), intent(inout) :: b(0:n, N_BOND)    !! forces on the first blocks [N]
    integer :: i

    do i = 1, n - 1
      b(i, [HX, HZ]) = spring(k, l, 0.0_dp, lo(i, :), lo(i + 1, :))
    end do
    if (.not. has_up) return
    do i = 1, n
      b(i, [WX, WZ]) = spring(k, 0.0_dp, l, lo(i, :), up(i, :))
    end do
    do i = 1, n - 1
      b(i, [D1X, D1Z]) = spring(0.5_dp*k, l, l, lo(i, :), up(i + 1, :))
      b(i, [D2X, D2Z]) = spring(0.5_dp*k, -l, l, lo(i + 1, :), up(i, :))
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
    integer, intent(in) :: n
    real(dp), intent(in) :: h(0:n)        !! horizontal bonds [N]
    real(dp), intent(in) :: d1(0:n)       !! diagonals to the right [N]
    real(dp), intent(in) :: d2(0:n)       !! diagonals to the left [N]
    real(dp), intent(in) :: w(0:n)        !! vertical bonds [N]
    real(dp), intent(inout) :: carry(n)   !! force on the row from below; then on the row above [N]
    real(dp), intent(out) :: f(n)         !! force on the row [N]
    integer :: i

    do i = 1, n
      f(i) = ((h(i) - h(i - 1)) + (d1(i) + d2(i - 1))) + (w(i) + carry(i))
      carry(i) = -(w(i) + (d1(i - 1) + d2(i)))
    end do
  end subroutine gather

  !> Power dissipated by the bonds that start in a row, sum of eta |dv|^2 [W].
  pure function bond_power(s, has_up, lo, up) result(power)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: lo(s%nx, 4)  !! the row
    real(dp), intent(in) :: up(s%nx, 4)  !! the row above
    real(dp) :: power
    real(dp) :: w(s%nx)
    integer :: i, n

    n = s%nx
    if (has_up) then
      do i = 1, n - 1
        w(i) = (((lo(i + 1, VX) - lo(i, VX))**2 + (lo(i + 1, VZ) - lo(i, VZ))**2) &
                + ((up(i, VX) - lo(i, VX))**2 + (up(i, VZ) - lo(i, VZ))**2)) &
               + (((up(i + 1, VX) - lo(i, VX))**2 + (up(i + 1, VZ) - lo(i, VZ))**2) &
                  + ((up(i, VX) - lo(i + 1, VX))**2 + (up(i, VZ) - lo(i + 1, VZ))**2))
      end do
      w(n) = (up(n, VX) - lo(n, VX))**2 + (up(n, VZ) - lo(n, VZ))**2
    else
      do i = 1, n - 1
        w(i) = (lo(i + 1, VX) - lo(i, VX))**2 + (lo(i + 1, VZ) - lo(i, VZ))**2
      end do
      w(n) = 0.0_dp
    end if
    power = s%eta*lane_sum(n, w)
  end function bond_power

  !> A sum in eight lanes: vectorises, and its order does not depend on the processor.
  pure function lane_sum(n, w) result(total)
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)
    real(dp) :: total
    real(dp) :: lane(8)
    integer :: i

    lane = 0.0_dp
    do i = 1, n - 7, 8
      lane = lane + w(i:i + 7)
    end do
    do i = n - mod(n, 8) + 1, n
      lane(1) = lane(1) + w(i)
    end do
    total = ((lane(1) + lane(2)) + (lane(3) + lane(4))) + ((lane(5) + lane(6)) + (lane(7) + lane(8)))
  end function lane_sum

  !> Elastic energy of the bonds that start in a row: k (r - l0)^2/2, or k (n.du)^2/2 in linear geometry [J].
  pure function bond_energy(s, has_up, lo, up) result(energy)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: lo(s%nx, 4)  !! the row
    real(dp), intent(in) :: up(s%nx, 4)  !! the row above
    real(dp) :: energy
    integer :: i

    energy = 0.0_dp
    do i = 1, s%nx - 1
      energy = energy + one(s%k, s%l, 0.0_dp, lo(i, :), lo(i + 1, :))
    end do
    if (.not. has_up) return
    do i = 1, s%nx
      energy = energy + one(s%k, 0.0_dp, s%l, lo(i, :), up(i, :))
    end do
    do i = 1, s%nx - 1
      energy = energy + (one(0.5_dp*s%k, s%l, s%l, lo(i, :), up(i + 1, :)) &
                         + one(0.5_dp*s%k, -s%l, s%l, lo(i + 1, :), up(i, :)))
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
  end function bond_energy
end module pyfric_lattice
