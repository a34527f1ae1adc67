!> Contact states of the interface, switched at the end of a step or sub-step.
module pyfric_contact
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, LB, LANES
  use pyfric_model, only: model_t, close_state, row_share, column_shares, driven_u
  use pyfric_boundaries, only: foundation, driver_force
  use pyfric_law, only: stop_reversed, next_states, settle_moving, remember, STUCK
  use pyfric_log, only: log_t, log_switch, log_quiet
  use pyfric_rows, only: row_t, other_forces
  implicit none (type, external)
  private
  public :: contact_t, save_contact, switch_contacts

  !> State variables of the contact of each bottom block.
  type :: contact_t
    integer(ip), allocatable :: mode(:)    !! contact states
    integer(ip), allocatable :: corner(:)  !! 1: the block's slip began with p < p_corner
    real(dp), allocatable :: margin(:)     !! strength minus load of a stuck block at the end of the last step [N]; on
                                           !! junctions: number of breaks before the block is ruptured; rate-and-state:
                                           !! v_slip minus the speed of the block [m/s]
    real(dp), allocatable :: loss(:)       !! kinetic energy removed by switching; on junctions heat of breaks and pinning [J]
    real(dp), allocatable :: memory(:, :)  !! state variables of the law, see pyfric_law
  end type contact_t

contains

  !> Copies the variables of the contact to the plain arrays of Python.
  pure subroutine save_contact(contact, mode, corner, margin, loss, memory)
    type(contact_t), intent(in) :: contact
    integer(ip), intent(out) :: mode(:)      !! this array and the next four: see contact_t
    integer(ip), intent(out) :: corner(:)
    real(dp), intent(out) :: margin(:)
    real(dp), intent(out) :: loss(:)
    real(dp), intent(out) :: memory(:, :)    !! without derived quantities

    mode = contact%mode
    corner = contact%corner
    margin = contact%margin
    loss = contact%loss
    memory = contact%memory(:size(memory, 1), :)
  end subroutine save_contact

  !> Switches contact states at the end of step number `step`, at time t. The logged time of a release is the zero of the margin,
  !> interpolated linearly inside the step.
  subroutine switch_contacts(s, step, t, dt, soon, y, contact, log, w)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                    !! steps made
    real(dp), intent(in) :: t                       !! time [s]
    real(dp), intent(in) :: dt                      !! step [s]
    real(dp), intent(in) :: soon                    !! time ahead within which junctions pin now [s]
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz)  !! v_x of the bottom row may be set to zero
    type(contact_t), intent(inout) :: contact
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    integer(ip) :: new(s%nx)
    real(dp) :: fx(LB:s%n + LANES), margin(s%nx)
    logical :: was_active
    integer :: i

    if (s%law%rests) then
      call stop_blocks(s, y(LB, 1, 1), contact, w)
      call other_forces(s, t, y(LB, 1, 1), y(LB, 1, min(2, s%nz)), w, fx)
      call next_states(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, t, fx, w%p, y(LB, VX, 1), new, margin)
    else
      call foundation(s, y(LB, UZ, 1), w%p)
      call settle_moving(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, t, soon, y(LB, UX, 1), y(LB, VX, 1), w%p, new, &
                         margin, contact%loss)
    end if
    was_active = active(contact)
    do i = 1, s%nx
      if (new(i) /= contact%mode(i)) then
        call switch_block(s, i, new(i), margin(i), step, t, dt, y(s%at(i), UX, 1), w%p(i), contact, log)
      end if
    end do
    contact%margin = margin
    if (active(contact) .neqv. was_active) then
      call log_quiet(log, active(contact), contact%mode, step, t, &
                     driver_force(s, t, driven_u(s, y)), y(s%at(:s%nx), UX, 1))
    end if
  end subroutine switch_contacts

  !> Whether a block slips, without corner slip.
  pure function active(contact) result(yes)
    type(contact_t), intent(in) :: contact
    logical :: yes

    yes = any(abs(contact%mode) == 1 .and. contact%corner == 0)
  end function active

  !> Stops blocks of the bottom row that no longer move in their direction of slip.
  subroutine stop_blocks(s, q, contact, w)
    type(model_t), intent(in) :: s
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4)   !! the bottom row
    type(contact_t), intent(inout) :: contact
    type(row_t), intent(inout) :: w                   !! p is set [N]
    real(dp) :: v_x(s%nx)

    v_x = q(s%at(:s%nx), VX)
    call foundation(s, q(LB, UZ), w%p)
    call stop_reversed(row_share(s, 1)*column_shares(s)*s%m, w%p, contact%mode, v_x, contact%loss)
    q(s%at(:s%nx), VX) = v_x
    call close_state(s, q)
  end subroutine stop_blocks

  !> Switches block i and logs the switch.
  subroutine switch_block(s, i, new, margin, step, t, dt, u_x, p, contact, log)
    type(model_t), intent(in) :: s
    integer, intent(in) :: i            !! block, from 1
    integer(ip), intent(in) :: new      !! new contact state
    real(dp), intent(in) :: margin      !! margin at the end of the step [N]
    real(dp), intent(in) :: step        !! steps made
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: dt          !! step [s]
    real(dp), intent(in) :: u_x         !! displacement [m]
    real(dp), intent(in) :: p           !! foundation force [N]
    type(contact_t), intent(inout) :: contact
    type(log_t), intent(inout) :: log
    integer(ip) :: old
    real(dp) :: t_switch

    old = contact%mode(i)
    t_switch = t
    if (old == STUCK .and. margin < 0.0_dp .and. contact%margin(i) > 0.0_dp) then
      t_switch = t + dt*(margin/(contact%margin(i) - margin))
    end if
    contact%mode(i) = new
    call remember(s%law, old, new, t, u_x, contact%memory(:, i))
    if (abs(old) /= 1) contact%corner(i) = merge(1_ip, 0_ip, p < s%p_corner)
    call log_switch(log, i, old, new, contact%corner(i), step, t_switch, u_x, p)
  end subroutine switch_block
end module pyfric_contact
