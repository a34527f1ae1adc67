!> Sub-steps inside a step: contact switches located in time, and the length of adaptive sub-steps.
!>
!> `test_substep` needs only the two bottom rows of a trial sub-step. `complete_substep` is called when all rows of an
!> accepted sub-step are computed.
!>
!> Contact states are fixed during a sub-step. Each block has event functions that are positive while its contact state
!> lasts (pyfric_law). If an event function is negative at the end, shorter sub-steps are tried until the earliest root is
!> bracketed. The sub-step then ends just behind the root, where contacts switch. The next sub-step goes to the end of the
!> step. The stages of a sweep predict the root, so that one trial suffices in most cases. If no event function is negative
!> at the end, a parabola through start, middle and end is computed for each. If a parabola falls below zero, the sub-step ends
!> there. Crossings follow from the signs of event functions.
module pyfric_location
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, close_state
  use pyfric_boundaries, only: foundation, foundation_rate, heights
  use pyfric_law, only: event_functions, knot_functions, last_knots, time_to_knot, N_CONTACT, N_KNOT, N_MARK
  use pyfric_rows, only: row_t, other_forces, budget_t
  use pyfric_contact, only: contact_t, switch_contacts
  use pyfric_table_stepper, only: table_t
  use pyfric_sweep, only: share_of_step
  use pyfric_log, only: log_t, has_room
  use pyfric_status, only: DONE, ENDLESS, TOO_SHORT
  implicit none (type, external)
  private
  public :: step_control_t, new_control, test_substep, complete_substep, max_switches, MAX_QUIET

  real(dp), parameter :: ROOT_WIDTH = 2.0_dp**(-40)       !! largest distance of a switch behind its root, over dt
  real(dp), parameter :: FORESEEN_WIDTH = 2.0_dp**(-30)   !! largest distance of a switch behind a predicted root, over dt
  real(dp), parameter :: SHORTEST_SUBSTEP = 2.0_dp**(-30) !! shortest adaptive sub-step, over dt
  real(dp), parameter :: DIP_LENGTH = 2.0_dp**(-4)        !! shortest sub-step that is tested for dips, over dt
  real(dp), parameter :: DIP_DEPTH = 2.0_dp**(-20)        !! smallest depth of a dip, over the values at the ends
  real(dp), parameter :: KNOT_WIDTH = 2.0_dp**(-20)       !! distance at which a knot of age or a pinning counts as reached, over dt
  integer, parameter :: MAX_TRIALS = 60           !! largest number of trials; bisections at every third resolve 2^-20
  integer, parameter :: MAX_QUIET = 64            !! largest number of starts and ends of slip that one step may log
  integer, parameter :: ADAPT_ORDER = 4           !! power of the length with which the error of an adaptive sub-step grows
  integer, parameter :: WHOLE = 0, CUT = 1, SEARCH = 2

  !> Step control: progress within a step.
  type :: step_control_t
    logical :: complete = .false.   !! whether memory was allocated
    logical :: located             !! whether switches are located inside the step
    real(dp) :: start = 0.0_dp     !! start of the sub-step, counted from the start of the step [s]
    real(dp) :: remaining = 0.0_dp !! time from the start of the sub-step to the end of the step [s]
    real(dp) :: length = 0.0_dp    !! length of the sub-step that is tried [s]
    real(dp) :: longest = 0.0_dp   !! longest sub-step that the error allows [s]
    integer :: phase = WHOLE       !! WHOLE, a sub-step cut at a dip, or a search between a and b
    logical :: dips_checked = .false.  !! whether this sub-step was tested for dips
    real(dp) :: a = 0.0_dp         !! time without negative event functions, counted from the start of the sub-step [s]
    real(dp) :: b = 0.0_dp         !! time with a negative event function [s]
    integer :: trials = 0          !! number of sub-steps tried in this search
    integer :: moved = 0           !! end of the search interval that moved last: -1 for a, +1 for b
    integer :: n_instants = 0      !! number of times in this step at which contacts switched
    integer :: block = 0           !! first block of the last switches, from 1
    logical :: accepted = .true.   !! whether the trial sub-step is accepted
    logical :: finished = .true.   !! whether the trial sub-step ends the step
    logical :: crossed = .false.   !! whether an event function is negative at the end of the trial sub-step
    real(dp) :: t = 0.0_dp         !! time at the end of the trial sub-step [s]
    real(dp), allocatable :: g_0(:, :)  !! event functions at the start of the sub-step: friction [N] or [m/s], gap [m], knots
    real(dp), allocatable :: g_a(:, :)  !! event functions at a
    real(dp), allocatable :: g_b(:, :)  !! event functions at b
    real(dp), allocatable :: g(:, :)    !! event functions at the end of the trial sub-step
    real(dp), allocatable :: margin(:)  !! strength minus load at the end of the trial sub-step, as if stuck [N]
    real(dp), allocatable :: marks(:, :) !! marks of the law at the start of the sub-step, such as the last knots
    type(budget_t) :: works             !! energy budget at the start of the sub-step
  end type step_control_t

contains

  !> Largest number of times in one step at which contacts may switch: twice for each block, or for each junction.
  pure function max_instants(s) result(n)
    type(model_t), intent(in) :: s
    integer :: n

    n = 100 + 2*s%nx*s%law%per_block
  end function max_instants

  !> Largest number of switches that one step may log.
  elemental function max_switches(nx) result(n)
    integer, intent(in) :: nx
    integer :: n

    n = 8*nx + 200
  end function max_switches

  !> Step control at the start of a step.
  subroutine new_control(s, t, dt, located, longest, y, contact, budget, w, control)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                              !! time [s]
    real(dp), intent(in) :: dt                             !! step [s]
    logical, intent(in) :: located
    real(dp), intent(in) :: longest                        !! longest sub-step that the error allows [s]
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)     !! state
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(out) :: control
    integer :: n, failed

    control%located = located
    control%longest = longest
    n = N_CONTACT + merge(N_KNOT, 0, s%law%kinked)
    allocate (control%g_0(n, s%nx), control%g_a(n, s%nx), control%g_b(n, s%nx), control%g(n, s%nx), &
              control%margin(s%nx), control%marks(N_MARK, s%nx), stat=failed)
    if (failed /= 0) return
    control%complete = .true.
    call mark_knots(s, y(LB, 1, 1), contact, w, control)
    call evaluate_events(s, t, y(LB, 1, 1), y(LB, 1, min(2, s%nz)), contact, control%marks, w, control%g_0, control%margin)
    call plan_substep(s, t, dt, contact, budget, control)
  end subroutine new_control

  !> Stores the marks of the law at the start of a sub-step.
  pure subroutine mark_knots(s, q, contact, w, control)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! bottom row
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w                !! p is set [N]
    type(step_control_t), intent(inout) :: control
    real(dp) :: p_rate(s%nx)

    if (.not. s%law%kinked) return
    call foundation(s, q(LB, UZ), w%p)
    call foundation_rate(s, q(LB, UZ), q(LB, VZ), p_rate)
    call last_knots(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, q(LB, UX), q(LB, VX), w%p, p_rate, control%marks)
  end subroutine mark_knots

  !> Plans the next sub-step. The sub-step is as long as the error allows, and does not pass the end of the step or a knot of age.
  pure subroutine plan_substep(s, t, dt, contact, budget, control)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                !! time [s]
    real(dp), intent(in) :: dt               !! step [s]
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(step_control_t), intent(inout) :: control
    real(dp) :: to_knot

    control%remaining = dt - control%start
    control%length = control%remaining
    if (control%longest < control%remaining*(1.0_dp - ROOT_WIDTH)) control%length = control%longest
    if (control%located) then
      to_knot = time_to_knot(s%law, s%nx, contact%mode, contact%memory, t)
      if (to_knot > KNOT_WIDTH*dt) control%length = min(control%length, to_knot)
    end if
    control%phase = WHOLE
    control%dips_checked = .false.
    control%works = budget
  end subroutine plan_substep

  !> Tests a trial sub-step by its bottom rows. It is accepted if its error is small and no event function crosses zero
  !> before its end. If it is rejected, another length is planned from the same start.
  subroutine test_substep(s, table, step, t0, dt, err, old, new, q, contact, w, control, status)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: t0                             !! time of step 0 [s]
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: err                            !! error over the allowed error
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at the start of the sub-step
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at the end of the sub-step
    real(dp), intent(in) :: q(LB:s%n + LANES, 4, 0:table%stages, 2:table%stages)  !! stages, if a sweep made the sub-step
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(inout) :: control
    integer(ip), intent(out) :: status                     !! see pyfric_status
    logical :: first

    status = DONE
    first = control%phase /= SEARCH
    control%finished = control%length >= control%remaining
    control%t = t0 + step*dt + (control%start + control%length)
    if (control%finished) control%t = t0 + (step + 1.0_dp)*dt
    control%crossed = .false.
    control%accepted = control%phase /= WHOLE .or. err <= 1.0_dp
    if (.not. control%accepted) then
      control%length = 0.5_dp*control%length
      control%longest = control%length
      if (control%length < SHORTEST_SUBSTEP*dt) status = TOO_SHORT
    else if (control%located) then
      call evaluate_events(s, control%t, new(LB, 1, 1), new(LB, 1, min(2, s%nz)), contact, control%marks, w, control%g, &
                           control%margin)
      control%crossed = any(control%g < 0.0_dp)
      if (control%crossed .or. control%phase == SEARCH) then
        call narrow_search(dt, merge(FORESEEN_WIDTH, ROOT_WIDTH, table%swept), control)
      end if
      if (control%crossed .and. first .and. .not. control%accepted .and. table%swept) then
        call foresee(s, table, dt, old, new, q, contact, w, control)
      end if
      if (control%accepted) call check_dips(s, control%t, dt, old, new, contact, w, control)
    end if
    control%finished = control%finished .and. control%accepted
  end subroutine test_substep

  !> Finishes a tested sub-step. If it is accepted, contacts are switched and the next sub-step is planned. If it is
  !> rejected, the energy budget is restored.
  subroutine complete_substep(s, step, dt, err, new, contact, budget, log, w, control, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: err                            !! error over the allowed error
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz) !! state at the end; v_x of blocks that stop is set to zero
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(inout) :: control
    integer(ip), intent(inout) :: status                   !! see pyfric_status

    if (.not. control%accepted) then
      budget = control%works
      return
    end if
    ! the error allows longer sub-steps: doubling the length multiplies the error by 2^ADAPT_ORDER
    if (control%phase == WHOLE .and. err*2.0_dp**(ADAPT_ORDER + 1) < 1.0_dp) then
      control%longest = max(control%longest, min(2.0_dp*control%length, dt))
    end if
    if (control%located .and. (control%crossed .or. .not. s%law%rests)) then
      call switch_at_event(s, step, control%t, KNOT_WIDTH*dt, new, contact, log, w, control, status)
      if (status /= DONE) return
    else if (control%finished .and. .not. control%located) then
      call switch_contacts(s, step + 1.0_dp, control%t, dt, 0.0_dp, new, contact, log, w)
    end if
    if (control%located) then
      if (s%law%rests) contact%margin = control%margin
      control%g_0 = control%g
    end if
    control%start = control%start + control%length
    if (control%finished) then
      control%start = 0.0_dp
      control%n_instants = 0
    end if
    call plan_substep(s, control%t, dt, contact, budget, control)
  end subroutine complete_substep

  !> Predicts the length of the next trial from the stages of the last trial sub-step.
  subroutine foresee(s, table, dt, old, new, q, contact, w, control)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at the start of the sub-step
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at the end of the sub-step
    real(dp), intent(in) :: q(LB:s%n + LANES, 4, 0:table%stages, 2:table%stages)  !! stages of the sub-step
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(inout) :: control
    type(step_control_t) :: search
    real(dp) :: rows(LB:s%n + LANES, 4, 2)

    search = control
    do while (.not. search%accepted .and. search%trials < MAX_TRIALS)
      call share_of_step(s, table, control%b, search%length/control%b, old, new, q, rows)
      call evaluate_events(s, control%t - (control%b - search%length), rows(LB, 1, 1), rows(LB, 1, min(2, s%nz)), contact, &
                           control%marks, w, search%g, search%margin)
      search%crossed = any(search%g < 0.0_dp)
      call narrow_search(dt, ROOT_WIDTH, search)
    end do
    if (search%accepted) control%length = search%length
  end subroutine foresee

  !> Narrows the search interval by the result of the last trial, and chooses the length of the next trial.
  pure subroutine narrow_search(dt, width, control)
    real(dp), intent(in) :: dt           !! step [s]
    real(dp), intent(in) :: width        !! largest distance of the end of the sub-step behind the root, over dt
    type(step_control_t), intent(inout) :: control
    real(dp) :: root

    if (control%phase /= SEARCH) then
      control%phase = SEARCH
      control%a = 0.0_dp
      control%g_a = control%g_0
      control%moved = 0
      control%trials = 0
    end if
    if (control%crossed) then
      control%b = control%length
      control%g_b = control%g
      if (control%moved == 1) control%g_a = 0.5_dp*control%g_a
      control%moved = 1
    else
      control%a = control%length
      control%g_a = control%g
      if (control%moved == -1) control%g_b = 0.5_dp*control%g_b
      control%moved = -1
    end if
    control%trials = control%trials + 1
    root = control%a + (control%b - control%a)*first_root(control%g_a, control%g_b)
    control%accepted = control%crossed .and. control%b - root <= width*dt
    if (control%accepted) return
    if (mod(control%trials, 3) == 0) root = 0.5_dp*(control%a + control%b)
    control%length = min(max(root, control%a) + 0.5_dp*width*dt, control%b)
  end subroutine narrow_search

  !> Shortens the sub-step, at most once, to a time at which a parabola predicts a negative event function.
  subroutine check_dips(s, t, dt, old, new, contact, w, control)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                              !! time at the end of the sub-step [s]
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at its start
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at its end
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(inout) :: control
    real(dp) :: mid(LB:s%n + LANES, 4, 2), g_mid(size(control%g, 1), s%nx), margin_mid(s%nx), x
    integer :: j

    if (control%dips_checked .or. control%length < DIP_LENGTH*dt) return
    control%dips_checked = .true.
    do j = 1, min(2, s%nz)
      call midpoint(s, control%length, old(LB, 1, j), new(LB, 1, j), mid(LB, 1, j))
    end do
    call evaluate_events(s, t - 0.5_dp*control%length, mid(LB, 1, 1), mid(LB, 1, min(2, s%nz)), contact, control%marks, w, g_mid, &
                     margin_mid)
    x = minval(lowest_point(control%g_0, g_mid, control%g))
    if (x >= 1.0_dp) return
    control%accepted = .false.
    control%phase = CUT
    control%length = x*control%length
  end subroutine check_dips

  !> Switches contacts at the end of a sub-step that an event function has ended, unless the event is a knot. Anchors of slipping
  !> junctions follow their block at the end of each sub-step.
  subroutine switch_at_event(s, step, t, soon, new, contact, log, w, control, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: t                              !! time [s]
    real(dp), intent(in) :: soon                           !! time ahead within which junctions pin now [s]
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz) !! state; v_x of blocks that stop is set to zero
    type(contact_t), intent(inout) :: contact
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    type(step_control_t), intent(inout) :: control
    integer(ip), intent(inout) :: status                   !! see pyfric_status

    if (any(control%g(:N_CONTACT, :) < 0.0_dp)) then
      control%n_instants = control%n_instants + 1
      control%block = 1
      do while (.not. any(control%g(:N_CONTACT, control%block) < 0.0_dp))
        control%block = control%block + 1
      end do
      if (control%n_instants > max_instants(s) .or. .not. has_room(log, s%nx, 1)) then
        status = ENDLESS
        return
      end if
    end if
    if (any(control%g(:N_CONTACT, :) < 0.0_dp) .or. .not. s%law%rests) then
      call switch_contacts(s, step + 1.0_dp, t, 0.0_dp, soon, new, contact, log, w)
    end if
    call mark_knots(s, new(LB, 1, 1), contact, w, control)
    call evaluate_events(s, t, new(LB, 1, 1), new(LB, 1, min(2, s%nz)), contact, control%marks, w, control%g, control%margin)
  end subroutine switch_at_event

  !> Smallest root of the straight lines from g_a at 0 to g_b at 1 that end below zero.
  pure function first_root(g_a, g_b) result(x)
    real(dp), intent(in) :: g_a(:, :)
    real(dp), intent(in) :: g_b(:, :)
    real(dp) :: x
    integer :: i, k

    x = 1.0_dp
    do i = 1, size(g_a, 2)
      do k = 1, size(g_a, 1)
        if (g_b(k, i) >= 0.0_dp) cycle
        if (g_a(k, i) <= 0.0_dp) then
          x = 0.0_dp
        else
          x = min(x, g_a(k, i)/(g_a(k, i) - g_b(k, i)))
        end if
      end do
    end do
  end function first_root

  !> Position in 0..1 of a negative minimum of the parabola through g_0, g_m, g_1 at 0, 1/2, 1. The result is 2 if there is no
  !> such minimum, or if g_1 is negative.
  elemental function lowest_point(g_0, g_m, g_1) result(x)
    real(dp), intent(in) :: g_0
    real(dp), intent(in) :: g_m
    real(dp), intent(in) :: g_1
    real(dp) :: x, slope, curve

    x = 2.0_dp
    if (g_1 < 0.0_dp) return
    slope = 4.0_dp*(g_m - g_0) - (g_1 - g_0)      ! g_0 + slope x + curve x^2
    curve = 2.0_dp*((g_0 - g_m) + (g_1 - g_m))
    if (slope < 0.0_dp .and. -slope < 2.0_dp*curve) then
      if (g_0 + 0.5_dp*slope*(-slope/(2.0_dp*curve)) < -DIP_DEPTH*max(g_0, g_1)) x = -slope/(2.0_dp*curve)
    end if
  end function lowest_point

  !> Event functions of the bottom blocks, and strength minus load of each block as if it were stuck.
  subroutine evaluate_events(s, t, q, up, contact, marks, w, g, margin)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                           !! time [s]
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)        !! bottom row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)       !! the row above
    type(contact_t), intent(in) :: contact
    real(dp), intent(in) :: marks(N_MARK, s%nx)         !! marks of the law at the start of the sub-step
    type(row_t), intent(inout) :: w
    real(dp), intent(out) :: g(:, :)                    !! [N] or [m/s], [m], knots [m] and [m/s]
    real(dp), intent(out) :: margin(s%nx)               !! strength minus load [N]
    real(dp) :: fx(LB:s%n + LANES), p_rate(s%nx)

    call foundation(s, q(LB, UZ), w%p)
    if (s%law%rests) call other_forces(s, t, q, up, w, fx)
    call event_functions(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, t, fx, w%p, q(LB, UX), heights(s, q(LB, UZ)), &
                         q(LB, VX), g(:N_CONTACT, :), margin)
    if (s%prescribed) g(2, :) = w%p  ! contact never opens
    if (s%law%kinked) then
      call foundation_rate(s, q(LB, UZ), q(LB, VZ), p_rate)
      call knot_functions(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, marks, q(LB, UX), q(LB, VX), w%p, p_rate, &
                          g(N_CONTACT + 1:, :))
    end if
  end subroutine evaluate_events

  !> A row in the middle of a sub-step, by cubic interpolation between start and end.
  pure subroutine midpoint(s, sub, old, new, mid)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: sub                          !! length of the sub-step [s]
    real(dp), intent(in) :: old(LB:s%n + LANES, 4)       !! a row at the start
    real(dp), intent(in) :: new(LB:s%n + LANES, 4)       !! the row at the end
    real(dp), intent(out) :: mid(LB:s%n + LANES, 4)      !! the row in the middle
    integer :: i

    mid = 0.0_dp
    do i = 1, s%n
      mid(i, UX:UZ) = 0.5_dp*(old(i, UX:UZ) + new(i, UX:UZ)) + 0.125_dp*sub*(old(i, VX:VZ) - new(i, VX:VZ))
      mid(i, VX:VZ) = 1.5_dp*((new(i, UX:UZ) - old(i, UX:UZ))/sub) - 0.25_dp*(old(i, VX:VZ) + new(i, VX:VZ))
    end do
    call close_state(s, mid)
  end subroutine midpoint
end module pyfric_location
