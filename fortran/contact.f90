!> Contact states of the interface: switching at the end of a step, and the log of switches.
module pyfric_contact
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, close_row, UX, UZ, VX, LB, LANES
  use pyfric_boundaries, only: foundation, driver_force
  use pyfric_friction, only: stop_reversed, next_mode, slip, STUCK
  use pyfric_lattice, only: N_BOND
  use pyfric_rows, only: row_t, bond_forces, outer_forces
  implicit none (type, external)
  private
  public :: contact_t, log_t, switch_contacts

  !> What the contact adds to the state.
  type :: contact_t
    integer(ip), allocatable :: mode(:)    !! contact states
    integer(ip), allocatable :: corner(:)  !! 1: the block's slip began with p < p_corner
    real(dp), allocatable :: slack(:)      !! mu_s p - |f| at the last step's end [N]
    real(dp), allocatable :: loss(:)       !! kinetic energy removed by switching [J]
    real(dp), allocatable :: s_0(:)        !! slip s = s_0 +- u_x since the last stick; s itself while open [m]
  end type contact_t

  !> Switches, and the interface each time its last slipping block stops or the first one starts.
  type :: log_t
    integer :: n_switch = 0
    integer :: n_quiet = 0
    integer(ip), allocatable :: switch_i(:, :)    !! block from 0, old state, new state, corner
    real(dp), allocatable :: switch_r(:, :)       !! step, time [s], u_x [m], p [N]
    integer(ip), allocatable :: quiet_i(:, :)     !! +1 first slip or -1 last stick, then contact states
    real(dp), allocatable :: quiet_r(:, :)        !! step, time [s], F_T [N], then u_x [m]
  end type log_t

contains

  !> New contact states at the end of step number `step`, at time t. Releases are timed inside the step, where
  !> the slack mu_s p - |f| crosses zero on a straight line; the state itself switches at the step's end.
  subroutine switch_contacts(s, step, t, dt, y, contact, log, w)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                    !! steps made
    real(dp), intent(in) :: t                       !! time [s]
    real(dp), intent(in) :: dt                      !! step [s]
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz)  !! v_x of the bottom row may be set to zero
    type(contact_t), intent(inout) :: contact
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    integer(ip) :: old
    real(dp) :: carry(LB:s%n + LANES, 2), b(LB:s%n + LANES, N_BOND), fx(LB:s%n + LANES), fz(LB:s%n + LANES)
    real(dp) :: v_x(s%nx), other, slack, t_switch
    logical :: was_active, active
    integer :: i

    v_x = y(s%at(:s%nx), VX, 1)
    call foundation(s, y(LB, UZ, 1), w%p)
    call stop_reversed(s%m, w%p, contact%mode, v_x, contact%loss)
    y(s%at(:s%nx), VX, 1) = v_x
    call close_row(s%n, y(LB, VX, 1))
    carry = 0.0_dp
    b = 0.0_dp
    call bond_forces(s, 1, w%none, y(LB, 1, 1), y(LB, 1, min(2, s%nz)), carry, b, fx, fz, w)
    call outer_forces(s, 1, t, y(LB, 1, 1), fx, fz, w%f_t)
    was_active = any(abs(contact%mode) == 1 .and. contact%corner == 0)
    do i = 1, s%nx
      old = contact%mode(i)
      other = fx(s%at(i))
      slack = s%mu_s*w%p(i) - abs(other)
      contact%mode(i) = next_mode(s%mu_s, other, w%p(i), old, v_x(i))
      if (contact%mode(i) /= old) then
        t_switch = t
        if (old == STUCK .and. slack < 0.0_dp .and. contact%slack(i) > 0.0_dp) then
          t_switch = t + dt*(slack/(contact%slack(i) - slack))
        end if
        contact%s_0(i) = slip(old, contact%s_0(i), y(s%at(i), UX, 1))
        if (contact%mode(i) == STUCK) contact%s_0(i) = 0.0_dp
        contact%s_0(i) = slip(contact%mode(i), contact%s_0(i), -y(s%at(i), UX, 1))
        if (abs(old) /= 1) contact%corner(i) = merge(1_ip, 0_ip, w%p(i) < s%p_corner)
        call log_switch(i, old, t_switch)
      end if
      contact%slack(i) = slack
    end do
    active = any(abs(contact%mode) == 1 .and. contact%corner == 0)
    if (active .neqv. was_active) call log_quiet()

  contains

    subroutine log_switch(i, old, t_switch)
      integer, intent(in) :: i            !! block, from 1
      integer(ip), intent(in) :: old      !! contact state before
      real(dp), intent(in) :: t_switch    !! time [s]

      log%n_switch = log%n_switch + 1
      log%switch_i(:, log%n_switch) = [int(i - 1, ip), old, contact%mode(i), contact%corner(i)]
      log%switch_r(:, log%n_switch) = [step, t_switch, y(s%at(i), UX, 1), w%p(i)]
    end subroutine log_switch

    subroutine log_quiet()
      log%n_quiet = log%n_quiet + 1
      log%quiet_i(1, log%n_quiet) = merge(1_ip, -1_ip, active)
      log%quiet_i(2:, log%n_quiet) = contact%mode
      log%quiet_r(1, log%n_quiet) = step
      log%quiet_r(2, log%n_quiet) = t
      log%quiet_r(3, log%n_quiet) = driver_force(s, t, y(s%at(s%i_h), UX, s%j_h))
      log%quiet_r(4:, log%n_quiet) = y(s%at(:s%nx), UX, 1)
    end subroutine log_quiet
  end subroutine switch_contacts
end module pyfric_contact
