!> Sub-steps inside a step: contact switches located in time, and the length of adaptive sub-steps.
!>
!> What is tried need not be a sub-step of the whole lattice: `judge` looks at the two bottom rows alone, and `settle`
!> comes when all rows of an accepted sub-step are made.
!>
!> Contact states are frozen during a sub-step. Each block has margins that stay positive meanwhile (pyfric_law). Where
!> one is negative at the end, shorter sub-steps are made until the earliest root is closed in; the sub-step then ends
!> just behind it, contacts switch there, and the next sub-step goes to the end of the step. A sub-step's end where no
!> margin is negative is not believed before the parabola through each margin at its start, middle and end has been
!> looked at: where it dips below zero, the sub-step is cut there. Signs are compared, never products.
module pyfric_location
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, close_state
  use pyfric_boundaries, only: foundation
  use pyfric_law, only: margins, knot_margins, cells, time_to_knot, N_CONTACT, N_KNOT
  use pyfric_rows, only: row_t, other_forces, budget_t
  use pyfric_contact, only: contact_t, switch_contacts
  use pyfric_log, only: log_t, has_room
  use pyfric_status, only: DONE, ENDLESS, TOO_SHORT
  implicit none (type, external)
  private
  public :: pace_t, new_pace, judge, settle, most_switches, MOST_QUIET

  real(dp), parameter :: NEAR = 2.0_dp**(-40)     !! a switch is found this close behind its root, over dt
  real(dp), parameter :: SHORTEST = 2.0_dp**(-30) !! shortest adaptive sub-step, over dt
  real(dp), parameter :: COARSE = 2.0_dp**(-4)    !! dips are looked for in sub-steps longer than this, over dt
  real(dp), parameter :: DIP = 2.0_dp**(-20)      !! and must be deeper than this share of the margin at the ends
  real(dp), parameter :: CLOSE = 2.0_dp**(-20)    !! knots of age closer than this are passed, over dt
  integer, parameter :: MOST_QUIET = 64           !! most quiet transitions that one step may log
  integer, parameter :: ADAPT_ORDER = 4           !! the error of an adaptive sub-step goes with this power of its length
  integer, parameter :: WHOLE = 0, CUT = 1, SEARCH = 2

  !> Where a step stands.
  type :: pace_t
    logical :: located             !! locate switches; else they are made at the step's end
    real(dp) :: from = 0.0_dp      !! start of the sub-step, counted from the start of the step [s]
    real(dp) :: left = 0.0_dp      !! time from there to the end of the step [s]
    real(dp) :: sub = 0.0_dp       !! length of the sub-step that is tried [s]
    real(dp) :: wish = 0.0_dp      !! longest sub-step that the error allows [s]
    integer :: phase = WHOLE       !! a sub-step of full length, one cut at a dip, a search between a and b
    logical :: looked = .false.    !! dips have been looked for
    real(dp) :: a = 0.0_dp         !! no margin is negative here, counted from the start of the sub-step [s]
    real(dp) :: b = 0.0_dp         !! one is negative here [s]
    integer :: trials = 0          !! sub-steps tried in this search
    integer :: side = 0            !! end of the search interval that moved last: -1 for a, +1 for b
    integer :: instants = 0        !! times in this step at which contacts switched
    integer :: block = 0           !! first block that switched last, from 1
    logical :: accepted = .true.   !! the sub-step that was tried is made
    logical :: finished = .true.   !! and ends the step
    logical :: crossed = .false.   !! a margin is negative at its end
    real(dp) :: t = 0.0_dp         !! time there [s]
    real(dp), allocatable :: g_0(:, :)  !! margins at the start of the sub-step: friction [N] or [m/s], gap [m], knots
    real(dp), allocatable :: g_a(:, :)  !! at a
    real(dp), allocatable :: g_b(:, :)  !! at b
    real(dp), allocatable :: g(:, :)    !! at the end of the sub-step that was tried
    real(dp), allocatable :: stuck(:)   !! there, what a block could bear besides if it were stuck [N]
    integer, allocatable :: passed(:, :) !! knots passed at the start of the sub-step
    type(budget_t) :: saved             !! works at the start of the sub-step
  end type pace_t

contains

  !> Most times in one step at which contacts may switch.
  elemental function most_instants(nx) result(n)
    integer, intent(in) :: nx
    integer :: n

    n = 100 + 2*nx
  end function most_instants

  !> Most switches that one step may log.
  elemental function most_switches(nx) result(n)
    integer, intent(in) :: nx
    integer :: n

    n = 8*nx + 200
  end function most_switches

  !> The pace at the start of a step.
  subroutine new_pace(s, t, dt, located, wish, y, contact, budget, w, pace)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                              !! time [s]
    real(dp), intent(in) :: dt                             !! step [s]
    logical, intent(in) :: located
    real(dp), intent(in) :: wish                           !! longest sub-step that the error allows [s]
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)     !! state
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(row_t), intent(inout) :: w
    type(pace_t), intent(out) :: pace
    integer :: n

    pace%located = located
    pace%wish = wish
    n = N_CONTACT + merge(N_KNOT, 0, s%law%kinked)
    allocate (pace%g_0(n, s%nx), pace%g_a(n, s%nx), pace%g_b(n, s%nx), pace%g(n, s%nx), pace%stuck(s%nx), pace%passed(2, s%nx))
    call look_at_knots(s, y(LB, 1, 1), contact, pace)
    call all_margins(s, t, y(LB, 1, 1), y(LB, 1, min(2, s%nz)), contact, pace%passed, w, pace%g_0, pace%stuck)
    call plan_next(s, t, dt, contact, budget, pace)
  end subroutine new_pace

  !> The knots that slip and speed of each block have passed.
  pure subroutine look_at_knots(s, q, contact, pace)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! bottom row
    type(contact_t), intent(in) :: contact
    type(pace_t), intent(inout) :: pace

    if (s%law%kinked) call cells(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, q(LB, UX), q(LB, VX), pace%passed)
  end subroutine look_at_knots

  !> Plans the next sub-step: as long as the error allows, to the end of the step or a knot of age at most.
  pure subroutine plan_next(s, t, dt, contact, budget, pace)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                !! time [s]
    real(dp), intent(in) :: dt               !! step [s]
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(pace_t), intent(inout) :: pace
    real(dp) :: to_knot

    pace%left = dt - pace%from
    pace%sub = pace%left
    if (pace%wish < pace%left*(1.0_dp - NEAR)) pace%sub = pace%wish
    if (pace%located) then
      to_knot = time_to_knot(s%law, s%nx, contact%mode, contact%memory, t)
      if (to_knot > CLOSE*dt) pace%sub = min(pace%sub, to_knot)
    end if
    pace%phase = WHOLE
    pace%looked = .false.
    pace%saved = budget
  end subroutine plan_next

  !> Looks at the bottom rows of a sub-step that was tried. Not accepted: another length is to be tried from its start.
  subroutine judge(s, step, t0, dt, err, old, new, contact, w, pace, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: t0                             !! time of step 0 [s]
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: err                            !! error over what is allowed
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at the start of the sub-step
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at its end
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(pace_t), intent(inout) :: pace
    integer(ip), intent(out) :: status                     !! see pyfric_status

    status = DONE
    pace%finished = pace%sub >= pace%left
    pace%t = t0 + step*dt + (pace%from + pace%sub)
    if (pace%finished) pace%t = t0 + (step + 1.0_dp)*dt
    call accept(s, pace%t, dt, err, old, new, contact, w, pace, pace%crossed, status)
    pace%finished = pace%finished .and. pace%accepted
  end subroutine judge

  !> After a sub-step that was judged. Accepted: contacts are switched where they must be, and the next sub-step is
  !> planned. Not accepted: the works are put back.
  subroutine settle(s, step, dt, err, new, contact, budget, log, w, pace, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: err                            !! error over what is allowed
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz) !! state at its end; v_x of blocks that stop is set to zero
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    type(pace_t), intent(inout) :: pace
    integer(ip), intent(inout) :: status                   !! see pyfric_status

    if (.not. pace%accepted) then
      budget = pace%saved
      return
    end if
    ! the error allows longer sub-steps: doubling takes it up by 2^ADAPT_ORDER
    if (pace%phase == WHOLE .and. err*2.0_dp**(ADAPT_ORDER + 1) < 1.0_dp) then
      pace%wish = max(pace%wish, min(2.0_dp*pace%sub, dt))
    end if
    if (pace%crossed) then
      call switch_inside(s, step, pace%t, new, contact, log, w, pace, status)
      if (status /= DONE) return
    else if (pace%finished .and. .not. pace%located) then
      call switch_contacts(s, step + 1.0_dp, pace%t, dt, new, contact, log, w)
    end if
    if (pace%located) then
      contact%margin = pace%stuck
      pace%g_0 = pace%g
    end if
    pace%from = pace%from + pace%sub
    if (pace%finished) then
      pace%from = 0.0_dp
      pace%instants = 0
    end if
    call plan_next(s, pace%t, dt, contact, budget, pace)
  end subroutine settle

  !> Whether the sub-step is made: its error is small, and no margin crosses zero before its end.
  subroutine accept(s, t, dt, err, old, new, contact, w, pace, crossed, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                              !! time at its end [s]
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: err                            !! error over what is allowed
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at the start of the sub-step
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at its end
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(pace_t), intent(inout) :: pace
    logical, intent(out) :: crossed                        !! a margin is negative at its end
    integer(ip), intent(inout) :: status                   !! see pyfric_status

    crossed = .false.
    pace%accepted = pace%phase /= WHOLE .or. err <= 1.0_dp
    if (.not. pace%accepted) then
      pace%sub = 0.5_dp*pace%sub
      pace%wish = pace%sub
      if (pace%sub < SHORTEST*dt) status = TOO_SHORT
      return
    end if
    if (.not. pace%located) return
    call all_margins(s, t, new(LB, 1, 1), new(LB, 1, min(2, s%nz)), contact, pace%passed, w, pace%g, pace%stuck)
    crossed = any(pace%g < 0.0_dp)
    if (crossed .or. pace%phase == SEARCH) call search_on(dt, crossed, pace)
    if (pace%accepted) call look_for_dips(s, t, dt, old, new, contact, w, pace)
  end subroutine accept

  !> Narrows the search down with what the trial has shown, and chooses the next.
  pure subroutine search_on(dt, crossed, pace)
    real(dp), intent(in) :: dt           !! step [s]
    logical, intent(in) :: crossed       !! a margin is negative at the end of the trial
    type(pace_t), intent(inout) :: pace
    real(dp) :: root

    if (pace%phase /= SEARCH) then
      pace%phase = SEARCH
      pace%a = 0.0_dp
      pace%g_a = pace%g_0
      pace%side = 0
      pace%trials = 0
    end if
    if (crossed) then
      pace%b = pace%sub
      pace%g_b = pace%g
      if (pace%side == 1) pace%g_a = 0.5_dp*pace%g_a
      pace%side = 1
    else
      pace%a = pace%sub
      pace%g_a = pace%g
      if (pace%side == -1) pace%g_b = 0.5_dp*pace%g_b
      pace%side = -1
    end if
    pace%trials = pace%trials + 1
    root = pace%a + (pace%b - pace%a)*first_root(pace%g_a, pace%g_b)
    pace%accepted = crossed .and. pace%b - root <= NEAR*dt
    if (pace%accepted) return
    if (mod(pace%trials, 3) == 0) root = 0.5_dp*(pace%a + pace%b)
    pace%sub = min(max(root, pace%a) + 0.5_dp*NEAR*dt, pace%b)
  end subroutine search_on

  !> Cuts the sub-step where a margin seems to dip below zero inside, once.
  subroutine look_for_dips(s, t, dt, old, new, contact, w, pace)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                              !! time at the end of the sub-step [s]
    real(dp), intent(in) :: dt                             !! step [s]
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)   !! state at its start
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)   !! state at its end
    type(contact_t), intent(in) :: contact
    type(row_t), intent(inout) :: w
    type(pace_t), intent(inout) :: pace
    real(dp) :: mid(LB:s%n + LANES, 4, 2), g_mid(size(pace%g, 1), s%nx), stuck_mid(s%nx), x
    integer :: j

    if (pace%looked .or. pace%sub < COARSE*dt) return
    pace%looked = .true.
    do j = 1, min(2, s%nz)
      call middle(s, pace%sub, old(LB, 1, j), new(LB, 1, j), mid(LB, 1, j))
    end do
    call all_margins(s, t - 0.5_dp*pace%sub, mid(LB, 1, 1), mid(LB, 1, min(2, s%nz)), contact, pace%passed, w, g_mid, &
                     stuck_mid)
    x = minval(dip_at(pace%g_0, g_mid, pace%g))
    if (x >= 1.0_dp) return
    pace%accepted = .false.
    pace%phase = CUT
    pace%sub = x*pace%sub
  end subroutine look_for_dips

  !> Switches contacts at the end of a sub-step that a margin has ended, if it was not a knot's.
  subroutine switch_inside(s, step, t, new, contact, log, w, pace, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: step                           !! steps made before this one
    real(dp), intent(in) :: t                              !! time [s]
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz) !! state; v_x of blocks that stop is set to zero
    type(contact_t), intent(inout) :: contact
    type(log_t), intent(inout) :: log
    type(row_t), intent(inout) :: w
    type(pace_t), intent(inout) :: pace
    integer(ip), intent(inout) :: status                   !! see pyfric_status

    if (any(pace%g(:N_CONTACT, :) < 0.0_dp)) then
      pace%instants = pace%instants + 1
      pace%block = findloc(any(pace%g(:N_CONTACT, :) < 0.0_dp, dim=1), .true., dim=1)
      if (pace%instants > most_instants(s%nx) .or. .not. has_room(log, s%nx, 1)) then
        status = ENDLESS
        return
      end if
      call switch_contacts(s, step + 1.0_dp, t, 0.0_dp, new, contact, log, w)
    end if
    call look_at_knots(s, new(LB, 1, 1), contact, pace)
    call all_margins(s, t, new(LB, 1, 1), new(LB, 1, min(2, s%nz)), contact, pace%passed, w, pace%g, pace%stuck)
  end subroutine switch_inside

  !> Smallest root of the straight lines from g_a at 0 to g_b at 1, over those that end below zero.
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

  !> Where in 0..1 the parabola through g_0, g_m, g_1 at 0, 1/2, 1 has a minimum below zero; 2 where it has none. Margins
  !> that are negative at the end are not looked at: their root is known.
  elemental function dip_at(g_0, g_m, g_1) result(x)
    real(dp), intent(in) :: g_0
    real(dp), intent(in) :: g_m
    real(dp), intent(in) :: g_1
    real(dp) :: x, slope, curve

    x = 2.0_dp
    if (g_1 < 0.0_dp) return
    slope = 4.0_dp*(g_m - g_0) - (g_1 - g_0)      ! g_0 + slope x + curve x^2
    curve = 2.0_dp*((g_0 - g_m) + (g_1 - g_m))
    if (slope < 0.0_dp .and. -slope < 2.0_dp*curve) then
      if (g_0 + 0.5_dp*slope*(-slope/(2.0_dp*curve)) < -DIP*max(g_0, g_1)) x = -slope/(2.0_dp*curve)
    end if
  end function dip_at

  !> Margins of the bottom blocks, and what they could bear besides if they were stuck.
  subroutine all_margins(s, t, q, up, contact, passed, w, g, stuck)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                           !! time [s]
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)        !! bottom row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)       !! the row above
    type(contact_t), intent(in) :: contact
    integer, intent(in) :: passed(2, s%nx)              !! knots passed at the start of the sub-step
    type(row_t), intent(inout) :: w
    real(dp), intent(out) :: g(:, :)                    !! [N] or [m/s], [m], knots [m] and [m/s]
    real(dp), intent(out) :: stuck(s%nx)                !! [N]
    real(dp) :: fx(LB:s%n + LANES)

    call foundation(s, q(LB, UZ), w%p)
    call other_forces(s, t, q, up, w, fx)
    call margins(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, t, fx, w%p, q(LB, UZ), q(LB, VX), g(:N_CONTACT, :), stuck)
    if (s%prescribed) g(2, :) = w%p  ! no gap opens
    if (s%law%kinked) then
      call knot_margins(s%law, s%nx, s%n, s%at, contact%mode, contact%memory, passed, q(LB, UX), q(LB, VX), &
                        g(N_CONTACT + 1:, :))
    end if
  end subroutine all_margins

  !> The middle of a sub-step by the cubic through its ends.
  pure subroutine middle(s, sub, old, new, mid)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: sub                          !! its length [s]
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
  end subroutine middle
end module pyfric_location
