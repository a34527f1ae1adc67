!> Forces of the springs and dashpots of the lattice, row by row.
!>
!> A row q(N_x, 4) holds u_x, u_z, v_x, v_z. Each bond is evaluated once, as the force on its first block;
!> the second gets the opposite. Four families start in a row: horizontal h(i): (i) - (i+1) in the row itself,
!> and to the row above vertical v(i): (i) - (i), diagonals d1(i): (i) - (i+1) and d2(i): (i+1) - (i).
!> Sums pair left with right neighbours, so that a mirrored lattice gives the mirrored bits.
module pyfric_lattice
  use pyfric_kinds, only: dp
  use pyfric_model, only: model_t, UX, UZ, VX, VZ
  implicit none
  private
  public :: bond_row, gather, bond_power, bond_energy
  public :: HX, HZ, D1X, D1Z, D2X, D2Z, WX, WZ, N_BOND

  !> Columns of the bond buffer b(0:N_x, N_BOND): force on the first block of each bond [N].
  integer, parameter :: HX = 1, HZ = 2, D1X = 3, D1Z = 4, D2X = 5, D2Z = 6, WX = 7, WZ = 8, N_BOND = 8

  !> Up to this s = (r/l)^2 - 1 the series of 1 - l/r is exact to machine precision.
  real(dp), parameter :: S_SERIES = 2.0_dp**(-7)

contains

  !> All bonds that start in row lo. Without a row above, up is not read and its bonds are zero.
  pure subroutine bond_row(s, has_up, lo, up, b)
    type(model_t), intent(in) :: s
    logical, intent(in) :: has_up
    real(dp), intent(in) :: lo(s%nx, 4)             !! the row [m, m/s]
    real(dp), intent(in) :: up(s%nx, 4)             !! the row above [m, m/s]
    real(dp), intent(inout) :: b(0:s%nx, N_BOND)    !! forces [N]; b(0, :) and b(N_x, :HZ..D2Z) stay zero
    integer :: n

    n = s%nx
    if (.not. s%finite) then
      call horizontal_linear(n, s%k, s%eta, lo, b(0, HX), b(0, HZ))
      if (has_up) then
        call vertical_linear(n, s%k, s%eta, lo, up, b(0, WX), b(0, WZ))
        call diagonal_linear(n, s%k, s%eta, lo, up, b(0, D1X), b(0, D1Z), b(0, D2X), b(0, D2Z))
      end if
    else
      call bonds_finite(n - 1, n, s%k, s%l, 0.0_dp, s%eta, lo, lo(2, 1), b(1, HX), b(1, HZ))
      if (has_up) then
        call bonds_finite(n, n, s%k, 0.0_dp, s%l, s%eta, lo, up, b(1, WX), b(1, WZ))
        call bonds_finite(n - 1, n, 0.5_dp*s%k, s%l, s%l, s%eta, lo, up(2, 1), b(1, D1X), b(1, D1Z))
        call bonds_finite(n - 1, n, 0.5_dp*s%k, -s%l, s%l, s%eta, lo(2, 1), up, b(1, D2X), b(1, D2Z))
      end if
    end if
    if (.not. has_up) b(:, D1X:WZ) = 0.0_dp
  end subroutine bond_row

  !> Linear geometry, F = k n (n.du) + eta dv with n = (1, 0).
  pure subroutine horizontal_linear(n, k, eta, q, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k            !! stiffness [N/m]
    real(dp), intent(in) :: eta          !! viscosity [N s/m]
    real(dp), intent(in) :: q(n, 4)      !! the row
    real(dp), intent(inout) :: fx(0:n)   !! force [N]
    real(dp), intent(inout) :: fz(0:n)   !! force [N]
    integer :: i

    do i = 1, n - 1
      fx(i) = k*(q(i + 1, UX) - q(i, UX)) + eta*(q(i + 1, VX) - q(i, VX))
      fz(i) = eta*(q(i + 1, VZ) - q(i, VZ))
    end do
  end subroutine horizontal_linear

  !> Linear geometry, F = k n (n.du) + eta dv with n = (0, 1).
  pure subroutine vertical_linear(n, k, eta, lo, up, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: k            !! stiffness [N/m]
    real(dp), intent(in) :: eta          !! viscosity [N s/m]
    real(dp), intent(in) :: lo(n, 4)     !! the row
    real(dp), intent(in) :: up(n, 4)     !! the row above
    real(dp), intent(inout) :: fx(0:n)   !! force [N]
    real(dp), intent(inout) :: fz(0:n)   !! force [N]
    integer :: i

    do i = 1, n
      fx(i) = eta*(up(i, VX) - lo(i, VX))
      fz(i) = k*(up(i, UZ) - lo(i, UZ)) + eta*(up(i, VZ) - lo(i, VZ))
    end do
  end subroutine vertical_linear

  !> Linear geometry, stiffness k/2: F = (k/2) n (n.du) + eta dv with n = (1, 1)/sqrt(2) and (-1, 1)/sqrt(2).
  pure subroutine diagonal_linear(n, k, eta, lo, up, f1x, f1z, f2x, f2z)
    integer, intent(in) :: n
    real(dp), intent(in) :: k             !! stiffness of nearest neighbours [N/m]
    real(dp), intent(in) :: eta           !! viscosity [N s/m]
    real(dp), intent(in) :: lo(n, 4)      !! the row
    real(dp), intent(in) :: up(n, 4)      !! the row above
    real(dp), intent(inout) :: f1x(0:n)   !! force [N]
    real(dp), intent(inout) :: f1z(0:n)   !! force [N]
    real(dp), intent(inout) :: f2x(0:n)   !! force [N]
    real(dp), intent(inout) :: f2z(0:n)   !! force [N]
    real(dp) :: e1, e2, k4
    integer :: i

    k4 = 0.25_dp*k
    do i = 1, n - 1
      e1 = k4*((up(i + 1, UX) - lo(i, UX)) + (up(i + 1, UZ) - lo(i, UZ)))
      f1x(i) = eta*(up(i + 1, VX) - lo(i, VX)) + e1
      f1z(i) = eta*(up(i + 1, VZ) - lo(i, VZ)) + e1
      e2 = k4*((lo(i + 1, UX) - up(i, UX)) + (up(i, UZ) - lo(i + 1, UZ)))
      f2x(i) = eta*(up(i, VX) - lo(i + 1, VX)) - e2
      f2z(i) = eta*(up(i, VZ) - lo(i + 1, VZ)) + e2
    end do
  end subroutine diagonal_linear

  !> Finite geometry: F = k (r - l0)/r (d + du) + eta dv, with the reference bond d = (d_x, d_z), l0 = |d|.
  !>
  !> s = (r/l0)^2 - 1 = (2 d.du + |du|^2)/l0^2 and (r - l0)/r = 1 - (1 + s)^(-1/2), as a series where all |s| are
  !> small, else in closed form. The choice depends on the state alone: same bits everywhere.
  pure subroutine bonds_finite(n, ld, k, d_x, d_z, eta, a, b, fx, fz)
    integer, intent(in) :: n             !! bonds
    integer, intent(in) :: ld            !! distance of two fields in a row
    real(dp), intent(in) :: k            !! stiffness [N/m]
    real(dp), intent(in) :: d_x          !! reference bond [m]
    real(dp), intent(in) :: d_z          !! reference bond [m]
    real(dp), intent(in) :: eta          !! viscosity [N s/m]
    real(dp), intent(in) :: a(ld, *)     !! first blocks
    real(dp), intent(in) :: b(ld, *)     !! second blocks
    real(dp), intent(inout) :: fx(n)     !! force on the first blocks [N]
    real(dp), intent(inout) :: fz(n)     !! force on the first blocks [N]
    real(dp) :: dx, dz, s, g, s_max, inv_l2, x2, z2
    integer :: i

    inv_l2 = 1.0_dp/(d_x*d_x + d_z*d_z)
    x2 = 2.0_dp*d_x
    z2 = 2.0_dp*d_z
    s_max = 0.0_dp
    do i = 1, n
      dx = b(i, UX) - a(i, UX)
      dz = b(i, UZ) - a(i, UZ)
      s = (dx*(x2 + dx) + dz*(z2 + dz))*inv_l2
      s_max = max(s_max, abs(s))
      g = k*s*series(s)
      fx(i) = g*(d_x + dx) + eta*(b(i, VX) - a(i, VX))
      fz(i) = g*(d_z + dz) + eta*(b(i, VZ) - a(i, VZ))
    end do
    if (s_max <= S_SERIES) return
    do i = 1, n
      dx = b(i, UX) - a(i, UX)
      dz = b(i, UZ) - a(i, UZ)
      s = (dx*(x2 + dx) + dz*(z2 + dz))*inv_l2
      g = k*s/((1.0_dp + s) + sqrt(1.0_dp + s))
      fx(i) = g*(d_x + dx) + eta*(b(i, VX) - a(i, VX))
      fz(i) = g*(d_z + dz) + eta*(b(i, VZ) - a(i, VZ))
    end do
  end subroutine bonds_finite

  !> (1 - (1 + s)^(-1/2))/s by its Taylor series: coefficients (-1)^n (2n+1)!!/(2n+2)!!.
  elemental function series(s) result(g)
    real(dp), intent(in) :: s  !! (r/l0)^2 - 1
    real(dp) :: g

    g = 0.5_dp + s*(-0.375_dp + s*(0.3125_dp + s*(-0.2734375_dp + s*(0.24609375_dp &
        + s*(-0.2255859375_dp + s*(0.20947265625_dp - s*0.196380615234375_dp))))))
  end function series

  !> Force on a row: its own bonds minus what the row below already holds of them (carry); then carry for the row above.
  pure subroutine gather(n, b, carry_x, carry_z, fx, fz)
    integer, intent(in) :: n
    real(dp), intent(in) :: b(0:n, N_BOND)   !! bonds that start in the row [N]
    real(dp), intent(inout) :: carry_x(n)    !! forces of bonds from below, on the lower blocks [N]
    real(dp), intent(inout) :: carry_z(n)    !! forces of bonds from below, on the lower blocks [N]
    real(dp), intent(out) :: fx(n)           !! force on the row [N]
    real(dp), intent(out) :: fz(n)           !! force on the row [N]
    integer :: i

    do i = 1, n
      fx(i) = ((b(i, HX) - b(i - 1, HX)) + (b(i, D1X) + b(i - 1, D2X))) + (b(i, WX) - carry_x(i))
      carry_x(i) = b(i, WX) + (b(i - 1, D1X) + b(i, D2X))
    end do
    do i = 1, n
      fz(i) = ((b(i, HZ) - b(i - 1, HZ)) + (b(i, D1Z) + b(i - 1, D2Z))) + (b(i, WZ) - carry_z(i))
      carry_z(i) = b(i, WZ) + (b(i - 1, D1Z) + b(i, D2Z))
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
    do i = 1, n - 1
      w(i) = (lo(i + 1, VX) - lo(i, VX))**2 + (lo(i + 1, VZ) - lo(i, VZ))**2
    end do
    w(n) = 0.0_dp
    if (has_up) then
      do i = 1, n - 1
        w(i) = w(i) + (((up(i + 1, VX) - lo(i, VX))**2 + (up(i + 1, VZ) - lo(i, VZ))**2) &
                       + ((up(i, VX) - lo(i + 1, VX))**2 + (up(i, VZ) - lo(i + 1, VZ))**2))
      end do
      do i = 1, n
        w(i) = w(i) + ((up(i, VX) - lo(i, VX))**2 + (up(i, VZ) - lo(i, VZ))**2)
      end do
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
