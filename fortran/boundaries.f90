!> Boundary forces: elastic foundation, side driver, normal load, rigid rod, absorbing sides and top.
module pyfric_boundaries
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, close_state, reflected, row_share, column_shares, ABSORBING
  implicit none (type, external)
  private
  public :: driver_speed, load_share, foundation, foundation_rate, heights, driver_on, driver_force, rod_acceleration, rod_to_row
  public :: mirror_sum, weights, absorb, absorbed, reflected_row

contains

  !> Foundation force: p_i = k_f,i |z_i| if the height z_i = u_z + gap_i < 0, else 0; or the prescribed p [N].
  pure subroutine foundation(s, u_z, p)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: u_z(LB:s%n + LANES)  !! bottom row [m]
    real(dp), intent(out) :: p(s%nx)             !! upward force on the blocks, left to right [N]
    integer :: i

    if (s%prescribed) then
      p = s%load
      return
    end if
    do i = 1, s%nx
      p(i) = s%k_f(i)*max(-(u_z(s%at(i)) + s%gap(i)), 0.0_dp)
    end do
  end subroutine foundation

  !> Rate of p_i: -k_f,i v_z if z_i < 0, else 0; 0 if p is prescribed [N/s].
  pure subroutine foundation_rate(s, u_z, v_z, p_rate)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: u_z(LB:s%n + LANES)  !! bottom row [m]
    real(dp), intent(in) :: v_z(LB:s%n + LANES)  !! bottom row [m/s]
    real(dp), intent(out) :: p_rate(s%nx)        !! left to right
    integer :: i

    p_rate = 0.0_dp
    if (s%prescribed) return
    do i = 1, s%nx
      if (u_z(s%at(i)) + s%gap(i) < 0.0_dp) p_rate(i) = -s%k_f(i)*v_z(s%at(i))
    end do
  end subroutine foundation_rate

  !> Heights of the bottom blocks above the foundation [m]; l for blocks that never touch the foundation.
  pure function heights(s, u_z) result(z)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: u_z(LB:s%n + LANES)  !! bottom row [m]
    real(dp) :: z(s%nx)                          !! left to right
    integer :: i

    do i = 1, s%nx
      z(i) = merge(u_z(s%at(i)) + s%gap(i), s%l, s%k_f(i) > 0.0_dp)
    end do
  end function heights

  !> Speed of the driver in this piece of its protocol [m/s].
  elemental function driver_speed(s, t) result(v)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t    !! time [s]
    real(dp) :: v

    v = s%v_drv + s%a_drv*(t - s%t_seg)
  end function driver_speed

  !> Load at time t over the load at t_seg.
  elemental function load_share(s, t) result(share)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t    !! time [s]
    real(dp) :: share

    share = 1.0_dp + s%load_rate*(t - s%t_seg)
  end function load_share

  !> Force of the driver on driven block b, (K/n) (X(t) - x_h) [N]. x_h is the displacement of this block along the
  !> push since t = 0. n is the number of driven blocks. X is the integral of the driver's speed, V t at constant speed.
  elemental function driver_on(s, b, t, u_x) result(f)
    type(model_t), intent(in) :: s
    integer, intent(in) :: b     !! number of the driven block, see driven_number
    real(dp), intent(in) :: t    !! time [s]
    real(dp), intent(in) :: u_x  !! displacement of this block [m]
    real(dp) :: f, t_seg

    t_seg = t - s%t_seg
    f = s%k_drv*((s%x_drv + (s%v_drv + 0.5_dp*s%a_drv*t_seg)*t_seg) - s%d*(u_x - s%u_drv0(b)))
  end function driver_on

  !> F_T, the sum of the forces on all driven blocks [N].
  pure function driver_force(s, t, u_x) result(f_t)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                       !! time [s]
    real(dp), intent(in) :: u_x(s%n_driven)         !! displacements of driven blocks [m]
    real(dp) :: f_t
    integer :: b

    f_t = driver_on(s, 1, t, u_x(1))
    do b = 2, s%n_driven
      f_t = f_t + driver_on(s, b, t, u_x(b))
    end do
  end function driver_force

  !> X'', Z'', phi'' of the rod with the top row glued to the rod, from the forces on the top row. Forces on blocks i and
  !> N_x + 1 - i are added first, so that the mirrored row gives the same bits.
  pure function rod_acceleration(s, t, phi, fx, fz) result(a)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                      !! time [s]
    real(dp), intent(in) :: phi                    !! tilt [rad]
    real(dp), intent(in) :: fx(LB:s%n + LANES)     !! forces on the top row [N]
    real(dp), intent(in) :: fz(LB:s%n + LANES)     !! forces on the top row [N]
    real(dp) :: a(3), total(3)
    integer :: i, l, r

    total = 0.0_dp
    do i = 1, s%nx/2
      l = s%at(i)
      r = s%at(s%nx + 1 - i)
      total = total + [fx(l) + fx(r), fz(l) + fz(r), s%x(i)*fz(l) + s%x(s%nx + 1 - i)*fz(r)]
    end do
    if (mod(s%nx, 2) == 1) then
      l = s%at(s%nx/2 + 1)
      total = total + [fx(l), fz(l), s%x(s%nx/2 + 1)*fz(l)]
    end if
    a = [total(1)/s%m_top, ((total(2) - s%f_n*load_share(s, t)) - s%m_rod*s%g)/s%m_top, (total(3) - s%kappa*phi)/s%i_top]
  end function rod_acceleration

  !> Sets the top row from the rod: u_x = X, u_z = Z + phi x.
  pure subroutine rod_to_row(s, rod, q)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: rod(6)      !! X, Z, phi and their rates
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4)
    integer :: i

    do i = 1, s%nx
      q(s%at(i), UX) = rod(1)
      q(s%at(i), UZ) = rod(2) + rod(3)*s%x(i)
      q(s%at(i), VX) = rod(4)
      q(s%at(i), VZ) = rod(5) + rod(6)*s%x(i)
    end do
    call close_state(s, q)
  end subroutine rod_to_row

  !> Adds tractions of absorbing sides and top: -rho c_P v normal, and -rho c_S v tangential. On a quarter block between two
  !> absorbing edges only normal tractions act, because all four would shorten the largest stable step by a third.
  !> J. Lysmer, R. L. Kuhlemeyer, J. Eng. Mech. Div. ASCE 95, 859 (1969).
  pure subroutine absorb(s, j, q, fx, fz)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                        !! row, from 1 at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the row
    real(dp), intent(inout) :: fx(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)   !! force on the row [N]
    real(dp) :: c(s%nx), z_s(s%nx)
    integer :: i, e

    if (s%left == ABSORBING) call absorb_at(s, row_share(s, j), along_side(s, j), 1, q, fx, fz)
    if (s%right == ABSORBING) call absorb_at(s, row_share(s, j), along_side(s, j), s%at(s%nx), q, fx, fz)
    if (j < s%nz .or. s%top /= ABSORBING) return
    c = column_shares(s)
    z_s = along_top(s)
    do i = 1, s%nx
      e = s%at(i)
      fx(e) = fx(e) - c(i)*(z_s(i)*q(e, VX))
      fz(e) = fz(e) - c(i)*(s%z_p*q(e, VZ))
    end do
  end subroutine absorb

  !> Adds the tractions of an absorbing side on one block.
  pure subroutine absorb_at(s, c, z_s, e, q, fx, fz)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: c                       !! face of the block over the face of a whole block
    real(dp), intent(in) :: z_s                     !! tangential impedance [N s/m]
    integer, intent(in) :: e                        !! element of the block
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the row
    real(dp), intent(inout) :: fx(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)   !! force on the row [N]

    fx(e) = fx(e) - c*(s%z_p*q(e, VX))
    fz(e) = fz(e) - c*(z_s*q(e, VZ))
  end subroutine absorb_at

  !> Tangential impedance of blocks at the top [N s/m].
  pure function along_top(s) result(z_s)
    type(model_t), intent(in) :: s
    real(dp) :: z_s(s%nx)

    z_s = s%z_s
    if (s%left == ABSORBING) z_s(1) = 0.0_dp
    if (s%right == ABSORBING) z_s(s%nx) = 0.0_dp
  end function along_top

  !> Tangential impedance of the block of row j at a side [N s/m].
  pure function along_side(s, j) result(z_s)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j  !! row, from 1 at the bottom
    real(dp) :: z_s

    z_s = merge(0.0_dp, s%z_s, j == s%nz .and. s%top == ABSORBING)
  end function along_side

  !> Power that leaves through the sides and the top of row j [W].
  pure function absorbed(s, j, q) result(power)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                      !! row, from 1 at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)  !! the row
    real(dp) :: power, z_s
    integer :: last

    last = s%at(s%nx)
    z_s = along_side(s, j)
    power = 0.0_dp
    if (s%left == ABSORBING) power = power + row_share(s, j)*(s%z_p*q(1, VX)**2 + z_s*q(1, VZ)**2)
    if (s%right == ABSORBING) power = power + row_share(s, j)*(s%z_p*q(last, VX)**2 + z_s*q(last, VZ)**2)
    if (j < s%nz .or. s%top /= ABSORBING) return
    power = power + mirror_sum(s%nx, column_shares(s)*(along_top(s)*q(s%at(:s%nx), VX)**2 + s%z_p*q(s%at(:s%nx), VZ)**2))
  end function absorbed

  !> Weights of the blocks of row j [N].
  pure function weights(s, j) result(w)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j  !! row, from 1 at the bottom
    real(dp) :: w(s%nx)

    w = s%m*s%g*row_share(s, j)*column_shares(s)
  end function weights

  !> Image of the top row, beyond a mirrored top.
  pure function reflected_row(s, q) result(above)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)  !! the top row
    real(dp) :: above(LB:s%n + LANES, 4)
    integer :: i

    do i = LB, s%n + LANES
      above(i, :) = reflected(q(i, :))
    end do
  end function reflected_row

  !> Sum of a row in which numbers i and N_x + 1 - i are added first, so that the mirrored row gives the same bits.
  pure function mirror_sum(n, w) result(total)
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)
    real(dp) :: total
    integer :: i

    total = 0.0_dp
    do i = 1, n/2
      total = total + (w(i) + w(n + 1 - i))
    end do
    if (mod(n, 2) == 1) total = total + w(n/2 + 1)
  end function mirror_sum
end module pyfric_boundaries
