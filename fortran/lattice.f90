!> Forces of the springs and dashpots of the lattice, row by row.
!>
!> A row q(N_x, 4) holds u_x, u_z, v_x, v_z. The bonds of a row are those within it and those to the row above, up;
!> the latter also pull at that row, which is what carry takes along to it. Between two rows a block has three bonds:
!> vertical, and two diagonals with stiffness k/2. Sums pair left with right neighbours, so that a mirrored lattice
!> gives the mirrored bits; a translation gives no force, to the last bit.
module pyfric_lattice
  use pyfric_kinds, only: dp
  use pyfric_model, only: model_t, UX, UZ, VX, VZ
  implicit none (type, external)
  private
  public :: elastic_row, viscous_row, bond_power, bond_energy
  public :: N_BOND

  !> Columns of the bond buffer b(0:N_x, N_BOND) of finite geometry: force on the first block of each bond [N].
  !> Horizontal h(i): (i) - (i+1), vertical w(i): (i) - (i), diagonals d1(i): (i) - (i+1) and d2(i): (i+1) - (i).
  integer, parameter :: HX = 1, HZ = 2, D1X = 3, D1Z = 4, D2X = 5, D2Z = 6, WX = 7, WZ = 8, N_BOND = 8

  !> Up to this s = (r/l)^2 - 1 the series of 1 - l/r is exact to machine precision.
  real(dp), parameter :: S_SERIES = 2.0_dp**(-7)

contains

  !> Forces of the springs on a row; carry holds those from below, and on return those on the row above.
  pure subroutine elastic_row(s, has_up, lo, up, b, carry, fx, fz)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up                   !! there is a row above; else up is not read
    real(dp), intent(in) :: lo(s%nx, 4)             !! the row [m, m/s]
    real(dp), intent(in) :: up(s%nx, 4)             !! the row above [m, m/s]
    real(dp), intent(inout) :: b(0:s%nx, N_BOND)    !! work space; b(0, :) and b(N_x, :D2Z) are zero
    real(dp), intent(inout) :: carry(s%nx, 2)       !! forces on the row from below; then on the row above [N]
    real(dp), intent(out) :: fx(s%nx)               !! force on the row [N]
    real(dp), intent(out) :: fz(s%nx)               !! force on the row [N]

    if (s%finite) then
      call bonds_finite(s%nx, s%k, s%l, has_up, lo, up, b)
      call gather(s%nx, b(0, HX), b(0, D1X), b(0, D2X), b(0, WX), carry(1, 1), fx)
      call gather(s%nx, b(0, HZ), b(0, D1Z), b(0, D2Z), b(0, WZ), carry(1, 2), fz)
    else if (has_up) then
      call elastic_linear(s%nx, s%k, lo, up, carry, fx, fz)
    else
      call elastic_linear_top(s%nx, s%k, lo, carry, fx, fz)
    end if
  end subroutine elastic_row

  !> Linear geometry: F = k n (n.du) with n = (1, 0), (0, 1), and (k/2) n (n.du) with n = (1, 1)/sqrt(2), (-1, 1)/sqrt(2).
  !>
  !> With a = up - lo and, along a row, second differences L and central differences C: k L_x within the row, k a_z
  !> upward, and (k/4)(2 a_x + L_x + C_z), (k/4)(2 a_z + L_z + C_x) of the row above from the diagonals; so a_z has
  !> (k/4) 6 a_z in all. (In the code, a_x and a_z hold 2 a.)
  pure subroutine elastic_linear(n, k, lo, up, carry, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k               !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: lo(n, 4)        !! the row
    real(dp), intent(in) :: up(n, 4)        !! the row above
    real(dp), intent(inout) :: carry(n, 2)  !! force on the row from below; then on the row above [N]
    real(dp), intent(out) :: fx(n)          !! force on the row [N]
    real(dp), intent(out) :: fz(n)          !! force on the row [N]
    real(dp) :: k4, a_x, a_z, l_x, l_z, c_x, c_z
    integer :: i

    k4 = 0.25_dp*k
    do i = 2, n - 1
      a_x = 2.0_dp*(up(i, UX) - lo(i, UX))
      a_z = 2.0_dp*(up(i, UZ) - lo(i, UZ))
      l_x = (lo(i + 1, UX) + lo(i - 1, UX)) - 2.0_dp*lo(i, UX)
      l_z = (lo(i + 1, UZ) + lo(i - 1, UZ)) - 2.0_dp*lo(i, UZ)
      c_x = lo(i + 1, UX) - lo(i - 1, UX)
      c_z = lo(i + 1, UZ) - lo(i - 1, UZ)
      fx(i) = carry(i, 1) + k*l_x
      fz(i) = carry(i, 2)
      carry(i, 1) = k4*((l_x - a_x) - c_z)
      carry(i, 2) = k4*((l_z - 3.0_dp*a_z) - c_x)
      l_x = (up(i + 1, UX) + up(i - 1, UX)) - 2.0_dp*up(i, UX)
      l_z = (up(i + 1, UZ) + up(i - 1, UZ)) - 2.0_dp*up(i, UZ)
      c_x = up(i + 1, UX) - up(i - 1, UX)
      c_z = up(i + 1, UZ) - up(i - 1, UZ)
      fx(i) = fx(i) + k4*((l_x + a_x) + c_z)
      fz(i) = fz(i) + k4*((l_z + 3.0_dp*a_z) + c_x)
    end do
    call wall_linear(n, k, 1, 2, 1.0_dp, lo, up, carry, fx, fz)
    call wall_linear(n, k, n, n - 1, -1.0_dp, lo, up, carry, fx, fz)
  end subroutine elastic_linear

  !> The same for a column at a side wall, which has one diagonal only, towards column c.
  pure subroutine wall_linear(n, k, i, c, side, lo, up, carry, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k               !! stiffness of nearest neighbours [N/m]
    integer, intent(in) :: i                !! column of the wall
    integer, intent(in) :: c                !! its neighbour
    real(dp), intent(in) :: side            !! +1: the neighbour is on the right, -1: on the left
    real(dp), intent(in) :: lo(n, 4)        !! the row
    real(dp), intent(in) :: up(n, 4)        !! the row above
    real(dp), intent(inout) :: carry(n, 2)  !! force on the row above [N]
    real(dp), intent(inout) :: fx(n)        !! force on the row [N]
    real(dp), intent(inout) :: fz(n)        !! force on the row [N]
    real(dp) :: e_up, e_down, e

    e_up = 0.25_dp*k*(side*(up(c, UX) - lo(i, UX)) + (up(c, UZ) - lo(i, UZ)))
    e_down = 0.25_dp*k*(side*(lo(c, UX) - up(i, UX)) - (lo(c, UZ) - up(i, UZ)))
    e = k*(up(i, UZ) - lo(i, UZ))
    fx(i) = (k*(lo(c, UX) - lo(i, UX)) + side*e_up) + carry(i, 1)
    fz(i) = (e_up + e) + carry(i, 2)
    carry(i, 1) = side*e_down
    carry(i, 2) = -(e_down + e)
  end subroutine wall_linear

  !> The same for the top row, which has no row above.
  pure subroutine elastic_linear_top(n, k, q, carry, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k             !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: q(n, 4)       !! the row
    real(dp), intent(in) :: carry(n, 2)   !! forces from below [N]
    real(dp), intent(out) :: fx(n)        !! force on the row [N]
    real(dp), intent(out) :: fz(n)        !! force on the row [N]
    integer :: i

    fx(1) = k*(q(2, UX) - q(1, UX)) + carry(1, 1)
    do i = 2, n - 1
      fx(i) = carry(i, 1) + k*((q(i + 1, UX) + q(i - 1, UX)) - 2.0_dp*q(i, UX))
    end do
    fx(n) = k*(q(n - 1, UX) - q(n, UX)) + carry(n, 1)
    fz = carry(:, 2)
  end subroutine elastic_linear_top

  !> Finite geometry: F = k (r - l0)/r (d + du) of every bond, with the reference bond d = (d_x, d_z), l0 = |d|.
  !>
  !> With s = (r/l0)^2 - 1 = (2 d.du + |du|^2)/l0^2, (r - l0)/r = 1 - (1 + s)^(-1/2): a series where all |s| in the
  !> row are small, else the closed form. The choice depends on the state alone: same bits everywhere.
  pure subroutine bonds_finite(n, k, l, has_up, lo, up, b)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                    !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                    !! lattice constant [m]
    logical, intent(in) :: has_up                !! there is a row above
    real(dp), intent(in) :: lo(n, 4)             !! the row
    real(dp), intent(in) :: up(n, 4)             !! the row above
    real(dp), intent(inout) :: b(0:n, N_BOND)    !! forces on the first blocks [N]
    real(dp) :: dx, dz, s, g, inv_l2, s_max, s_up
    integer :: i

    inv_l2 = 1.0_dp/l**2
    s_max = 0.0_dp
    do i = 1, n - 1
      dx = lo(i + 1, UX) - lo(i, UX)
      dz = lo(i + 1, UZ) - lo(i, UZ)
      s = (dx*(2.0_dp*l + dx) + dz*dz)*inv_l2
      s_max = max(s_max, abs(s))
      g = k*series(s)
      b(i, HX) = g*(l + dx)
      b(i, HZ) = g*dz
    end do
    if (has_up) then
      call up_finite(n, k, l, lo, up, b, s_up)
      s_max = max(s_max, s_up)
    else
      b(:, D1X:WZ) = 0.0_dp
    end if
    if (s_max > S_SERIES) call bonds_exact(n, k, l, has_up, lo, up, b)
  end subroutine bonds_finite

  !> The bonds to the row above.
  pure subroutine up_finite(n, k, l, lo, up, b, s_max)
    integer, intent(in) :: n
    real(dp), intent(in) :: k                    !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: l                    !! lattice constant [m]
    real(dp), intent(in) :: lo(n, 4)             !! the row
    real(dp), intent(in) :: up(n, 4)             !! the row above
    real(dp), intent(inout) :: b(0:n, N_BOND)    !! forces on the first blocks [N]
    real(dp), intent(out) :: s_max               !! largest |s|
    real(dp) :: dx, dz, s, s1, s2, g, inv_l2
    integer :: i

    inv_l2 = 1.0_dp/l**2
    s_max = 0.0_dp
    do i = 1, n
      dx = up(i, UX) - lo(i, UX)
      dz = up(i, UZ) - lo(i, UZ)
      s = (dx*dx + dz*(2.0_dp*l + dz))*inv_l2
      s_max = max(s_max, abs(s))
      g = k*series(s)
      b(i, WX) = g*dx
      b(i, WZ) = g*(l + dz)
    end do
    do i = 1, n - 1
      dx = up(i + 1, UX) - lo(i, UX)
      dz = up(i + 1, UZ) - lo(i, UZ)
      s1 = (dx*(2.0_dp*l + dx) + dz*(2.0_dp*l + dz))*(0.5_dp*inv_l2)
      g = 0.5_dp*k*series(s1)
      b(i, D1X) = g*(l + dx)
      b(i, D1Z) = g*(l + dz)
      dx = up(i, UX) - lo(i + 1, UX)
      dz = up(i, UZ) - lo(i + 1, UZ)
      s2 = (dx*(dx - 2.0_dp*l) + dz*(2.0_dp*l + dz))*(0.5_dp*inv_l2)
      g = 0.5_dp*k*series(s2)
      b(i, D2X) = g*(dx - l)
      b(i, D2Z) = g*(l + dz)
      s_max = max(s_max, max(abs(s1), abs(s2)))
    end do
  end subroutine up_finite

  !> 1 - (1 + s)^(-1/2) by its Taylor series: coefficients (-1)^n (2n+1)!!/(2n+2)!!.
  elemental function series(s) result(e)
    real(dp), intent(in) :: s  !! (r/l0)^2 - 1
    real(dp) :: e, s2

    s2 = s*s
    e = s*((0.5_dp - s*0.375_dp) + s2*((0.3125_dp - s*0.2734375_dp) + s2*((0.24609375_dp - s*0.2255859375_dp) &
                                                                    + s2*(0.20947265625_dp - s*0.196380615234375_dp))))
  end function series

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

  !> Adds the dashpots, eta (v_j - v_i) on every bond, of one component of the motion.
  !>
  !> With a = up - lo and second differences L along a row: eta (L_lo + 3 a + L_up) below, eta (L_lo - 3 a) above;
  !> the bonds within the row above are its own.
  pure subroutine viscous_row(n, eta, has_up, lo, up, carry, f)
    integer, intent(in) :: n
    real(dp), intent(in) :: eta           !! viscosity [N s/m]
    logical, intent(in) :: has_up         !! there is a row above
    real(dp), intent(in) :: lo(n)         !! velocity of the row [m/s]
    real(dp), intent(in) :: up(n)         !! velocity of the row above [m/s]
    real(dp), intent(inout) :: carry(n)   !! force on the row above [N]
    real(dp), intent(inout) :: f(n)       !! force on the row [N]
    real(dp) :: a, second
    integer :: i

    f(1) = f(1) + eta*(lo(2) - lo(1))
    f(n) = f(n) + eta*(lo(n - 1) - lo(n))
    if (.not. has_up) then
      do i = 2, n - 1
        f(i) = f(i) + eta*((lo(i + 1) + lo(i - 1)) - 2.0_dp*lo(i))
      end do
      return
    end if
    do i = 2, n - 1
      a = 3.0_dp*(up(i) - lo(i))
      second = (lo(i + 1) + lo(i - 1)) - 2.0_dp*lo(i)
      f(i) = f(i) + eta*(second + (a + ((up(i + 1) + up(i - 1)) - 2.0_dp*up(i))))
      carry(i) = carry(i) + eta*(second - a)
    end do
    f(1) = f(1) + eta*((up(1) - lo(1)) + (up(2) - lo(1)))
    f(n) = f(n) + eta*((up(n) - lo(n)) + (up(n - 1) - lo(n)))
    carry(1) = carry(1) + eta*((lo(1) - up(1)) + (lo(2) - up(1)))
    carry(n) = carry(n) + eta*((lo(n) - up(n)) + (lo(n - 1) - up(n)))
  end subroutine viscous_row

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
