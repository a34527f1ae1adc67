!> Quasi-static sequences of events in compiled loops, for many runs at a time. pyfric.engines.quasistatic makes the same changes
!> in Python.
!>
!> A run follows the legs of a protocol. Between events all forces are linear in the position of the driver, so that the next
!> change follows from their rates. In an event the driver rests, and contact states change until all conditions are met.
!> Conditions are checked in the order of pyfric.statics.contact: blocks on the wrong side of the foundation open or land; blocks
!> that moved along their friction force stick again; the block with the largest |f| - hold p is released. Blocks whose violations
!> are equal within rounding change together. If friction does not weaken, slip grows continuously. The signs of the rates then
!> decide which blocks at their threshold slip.
!>
!> A run is a state machine. Each call of `act` makes at most one change. A run may therefore stop after any change, and go on
!> later with the same bits.
!>
!> Source: PRL 107, 074301 (2011), for the model.
module pyfric_sequence
  use pyfric_kinds, only: dp, ip
  use pyfric_law, only: STUCK, OPEN_GAP
  use pyfric_pivots, only: slider_t, ground_t, values_t, contact_t, look, rates, put, change, hold_all, renew, &
                           test_definite, BARE
  use pyfric_status, only: DONE, LOG_FULL, PAUSED, UNSETTLED, IDLE, GROWS, AMBIGUOUS
  implicit none (type, external)
  private
  public :: rules_t, leg_t, log_t, run_t, new_log, go_on

  !> Codes of the next action of a run: begin a leg; find the next change; make the change; change states in an event; change states
  !> while slip grows; find the next change while slip grows; end a leg.
  integer, parameter :: BEGINS = 0, SEEKS = 1, MOVES = 2, SETTLES = 3, FOLLOWS = 4, PASSES = 5, ENDS = 6

  !> Limits of a sequence. Python passes the values (pyfric.core.Rules).
  type :: rules_t
    integer :: changes     !! largest number of changes of contact state in one event
    integer :: idle        !! largest number of successive changes without motion of the driver
    integer :: growth      !! largest number of changes while slip grows, in one leg
    real(dp) :: rate       !! rate of a force, over stiffness times rate of displacement, that counts as rounding
    real(dp) :: definite   !! definiteness below which slip may not be unique
    real(dp) :: p_corner   !! p below which slip begins as a corner episode [N]
    logical :: stops       !! whether to stop before each change between events
  end type rules_t

  !> A leg of the protocol, as pyfric.core.CoreLeg.
  type :: leg_t
    real(dp) :: t          !! beginning [s]
    real(dp) :: t_end      !! end, may be infinite [s]
    real(dp) :: first      !! integral of the driver's speed, or the parameter of a route, at t [m]
    real(dp) :: last       !! value of `first` at t_end [m]
    real(dp) :: value      !! speed at t [m/s]
    real(dp) :: slope      !! rate of the speed [m/s2]
    real(dp) :: offset     !! drive minus `first`, and minus the offset of the run [m]
    integer :: way         !! +1 or -1, 0 if the driver rests
    integer :: route       !! number of the route of the loads; 0: loads do not change
  end type leg_t

  type :: log_t
    integer :: n_switch = 0
    integer :: n_quiet = 0
    integer :: n_point = 0
    logical :: complete = .false.               !! whether memory was allocated
    integer(ip), allocatable :: switch_i(:, :)  !! block from 0, old state, new state, corner
    real(dp), allocatable :: switch_r(:, :)     !! step, time [s], u_x [m], p [N]
    integer(ip), allocatable :: quiet_i(:, :)   !! +1 first slip or -1 last stick, then contact states
    real(dp), allocatable :: quiet_r(:, :)      !! step, time [s], F_T [N], u_x [m], f [N], p [N]
    real(dp), allocatable :: points(:, :)       !! time [s], F_T [N], number of logged changes
  end type log_t

  type :: run_t
    integer(ip) :: status = DONE                !! see pyfric_status
    integer :: leg = 1
    integer :: phase = BEGINS
    integer :: step = 0                         !! number of logged changes
    integer :: tried = 0                        !! number of changes in this event
    integer :: rests = 0                        !! number of changes since the driver moved
    integer :: grown = 0                        !! number of changes while slip grows, in this leg
    integer :: events = 0
    integer :: starts = 0                       !! number of starts of slip, without corner slip
    integer :: releases = 0
    integer :: block = 0                        !! block that changes next
    integer :: new = STUCK                      !! new state of this block
    logical :: slips = .false.                  !! whether a block slips, without corner slip
    logical :: gradual = .false.                !! whether slip grows continuously, because friction does not weaken
    real(dp) :: ahead = 0.0_dp                  !! drive at the next change [m]
    real(dp) :: little = 0.0_dp                 !! largest motion of the driver by rounding [m]
    real(dp) :: offset = 0.0_dp                 !! offset of the drive in all legs [m]
    real(dp), allocatable :: home(:)            !! u_x at the last release [m]
    integer(ip), allocatable :: corner(:)       !! 1: slip of the block began with p < p_corner
    integer(ip), allocatable :: mode(:)         !! states as logged
    type(values_t) :: before                    !! the state before a change
    type(values_t) :: rate                      !! work space: derivatives of the state
  end type run_t

contains

  pure function new_log(nx, switches, quiet, points) result(log)
    integer, intent(in) :: nx
    integer, intent(in) :: switches             !! largest number of switches
    integer, intent(in) :: quiet
    integer, intent(in) :: points
    type(log_t) :: log
    integer :: failed

    allocate (log%switch_i(4, switches), log%switch_r(4, switches), log%quiet_i(nx + 1, quiet), log%quiet_r(3*nx + 3, quiet), &
              log%points(3, points), stat=failed)
    log%complete = failed == 0
  end function new_log

  !> Follows a run to the end of its legs, or until it stops.
  pure subroutine go_on(s, rules, legs, max_changes, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: legs(:)
    integer, intent(in) :: max_changes          !! largest number of changes in this call
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log
    integer :: made

    run%status = DONE
    if (run%leg == 1 .and. run%phase == BEGINS) call renew(s, g, c)
    do made = 1, max_changes
      if (run%leg > size(legs)) return
      if (.not. has_room(s, log)) run%status = LOG_FULL
      if (run%status == DONE) call act(s, rules, legs(run%leg), g, c, run, log)
      if (c%status /= DONE) run%status = c%status
      if (run%status /= DONE) return
    end do
    if (run%leg <= size(legs)) run%status = PAUSED
  end subroutine go_on

  !> Whether the log has room for the entries of one change.
  pure function has_room(s, log) result(yes)
    type(slider_t), intent(in) :: s
    type(log_t), intent(in) :: log
    logical :: yes

    yes = log%n_switch + s%nx <= size(log%switch_r, 2) .and. log%n_quiet < size(log%quiet_r, 2) &
          .and. log%n_point + 2 <= size(log%points, 2)
  end function has_room

  !> Makes the next action of a run.
  pure subroutine act(s, rules, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log

    select case (run%phase)
    case (BEGINS)
      call begin_leg(s, rules, leg, g, c, run, log)
    case (SEEKS)
      call seek(s, rules, leg, g, c, run)
    case (MOVES)
      call move(s, rules, leg, g, c, run, log)
    case (SETTLES)
      call settle(s, rules, leg, g, c, run, log)
    case (FOLLOWS)
      call grow(s, rules, leg, g, c, run, log)
    case (PASSES)
      call pass(s, rules, leg, g, c, run)
    case default
      call end_leg(s, leg, g, c, run, log)
    end select
  end subroutine act

  ! --- legs ----------------------------------------------------------------------------------------

  !> Begins a leg. If the driver turns or loads change, all slip stops.
  pure subroutine begin_leg(s, rules, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log

    if (leg%way /= c%way .or. leg%route > 0) then
      call hold_all(s, g, c)
      if (c%status /= DONE) return
      call look(s, g, c)
      call log_changes(s, rules, leg%t, c, c%now, run, log)
    end if
    if (leg%route > 0) then
      c%route = leg%route
      c%sets = -1
      c%column(s%nx + 1) = (run%offset + leg%offset) + leg%first
      call renew(s, g, c)
    end if
    run%phase = ENDS
    run%rests = 0
    run%grown = 0
    run%tried = 0
    run%little = c%tol/s%k_driver
    if (leg%way == 0) return
    c%way = leg%way
    run%phase = merge(FOLLOWS, SEEKS, run%gradual)
  end subroutine begin_leg

  pure subroutine end_leg(s, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log

    run%phase = BEGINS
    run%leg = run%leg + 1
    if (leg%t_end > huge(leg%t_end)) return
    c%column(s%nx + 1) = (run%offset + leg%offset) + leg%last
    c%known = .false.
    call log_point(s, leg%t_end, g, c, run, log)
  end subroutine end_leg

  !> Whether the leg ends before the next change.
  pure function beyond(leg, way, run) result(yes)
    type(leg_t), intent(in) :: leg
    integer, intent(in) :: way
    type(run_t), intent(in) :: run
    logical :: yes

    yes = abs(run%ahead) >= huge(run%ahead) .or. .not. way*(run%ahead - ((run%offset + leg%offset) + leg%last)) <= 0.0_dp
  end function beyond

  !> Time at which the driver is at a position [s].
  pure function time_at(leg, offset, drive) result(t)
    type(leg_t), intent(in) :: leg
    real(dp), intent(in) :: offset             !! offset of the drive of the run [m]
    real(dp), intent(in) :: drive              !! position of the driver [m]
    real(dp) :: t, far, speed, root

    far = leg%way*((drive - (offset + leg%offset)) - leg%first)
    speed = leg%way*leg%value
    root = sqrt(max(speed**2 + 2*leg%way*leg%slope*far, 0.0_dp))
    t = leg%t
    if (speed + root > 0.0_dp) t = t + 2*far/(speed + root)
  end function time_at

  ! --- events --------------------------------------------------------------------------------------

  !> Finds the next change of contact state. Without a next change, the leg ends.
  pure subroutine seek(s, rules, leg, g, c, run)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run

    call next_change(s, rules, g, c, .true., run)
    if (beyond(leg, c%way, run)) then
      run%phase = ENDS
      return
    end if
    run%rests = merge(run%rests + 1, 0, c%way*(run%ahead - c%column(s%nx + 1)) <= run%little)
    if (run%rests > rules%idle) run%status = IDLE
    run%phase = MOVES
    if (run%status == DONE .and. rules%stops) run%status = PAUSED
  end subroutine seek

  !> Moves the driver to the next change and makes this change. The release of a block begins an event.
  pure subroutine move(s, rules, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log
    real(dp) :: t

    c%column(s%nx + 1) = run%ahead
    c%known = .false.
    t = time_at(leg, run%offset, run%ahead)
    call log_point(s, t, g, c, run, log)
    run%before = c%now
    call change(s, g, c, run%block, int(run%new, ip))
    if (c%status /= DONE) return
    call look(s, g, c)
    run%phase = SEEKS
    if (run%new == STUCK .or. run%new == OPEN_GAP) then
      call log_changes(s, rules, t, c, c%now, run, log)
      call log_point(s, t, g, c, run, log)
      return
    end if
    call log_changes(s, rules, t, c, run%before, run, log)
    run%phase = SETTLES
    run%events = run%events + 1
    run%tried = 0
    run%home = run%before%u_x
  end subroutine move

  !> Makes one change in an event. If all conditions are met, ends the event: all blocks stick.
  pure subroutine settle(s, rules, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log
    real(dp) :: by(s%nx), u_x(s%nx), t
    integer(ip) :: new(s%nx)
    logical :: unmet

    if (run%tried >= rules%changes) run%status = UNSETTLED
    if (run%status /= DONE) return
    call look(s, g, c)
    run%before = c%now
    call unmet_in_event(s, g, c, run%home, by, new, u_x, unmet)
    t = time_at(leg, run%offset, c%column(s%nx + 1))
    if (unmet) then
      call put(s, g, c, chosen(s%nx, rules, run%tried, by, c%tol), new, u_x)
      run%tried = run%tried + 1
    else
      call hold_all(s, g, c)
      run%phase = SEEKS
    end if
    if (c%status /= DONE) return
    call look(s, g, c)
    if (unmet) call log_changes(s, rules, t, c, run%before, run, log)
    if (.not. unmet) call log_changes(s, rules, t, c, c%now, run, log)
    if (.not. unmet) call log_point(s, t, g, c, run, log)
  end subroutine settle

  !> Whether each block changes: blocks with the largest violation, equal within rounding, change. In the second half of all allowed
  !> changes, only the first block that violates a condition changes, which ends cycles.
  pure function chosen(nx, rules, tried, by, least) result(which)
    integer, intent(in) :: nx
    type(rules_t), intent(in) :: rules
    integer, intent(in) :: tried
    real(dp), intent(in) :: by(nx)              !! violations [N]
    real(dp), intent(in) :: least               !! largest violation that rounding can cause [N]
    logical :: which(nx)
    integer :: first

    which = by >= max(maxval(by) - least, least)
    if (tried < rules%changes/2) return
    first = findloc(by > least, .true., dim=1)
    which = .false.
    which(first) = .true.
  end function chosen

  !> Violations of the first condition, in their order, that is not met in an event.
  pure subroutine unmet_in_event(s, g, c, home, by, new, u_x, unmet)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(in) :: c
    real(dp), intent(inout) :: home(s%nx)       !! u_x at which blocks that move back stick; set at a release [m]
    real(dp), intent(out) :: by(s%nx)           !! violation of the condition of each block [N]
    integer(ip), intent(out) :: new(s%nx)       !! new state of each block
    real(dp), intent(out) :: u_x(s%nx)          !! u_x at which each block is held if it sticks [m]
    logical, intent(out) :: unmet

    by = merge(g%k_f, -min(s%k, g%k_f), c%mode /= OPEN_GAP)*(c%now%u_z + g%gap)
    new = merge(OPEN_GAP, STUCK, c%mode /= OPEN_GAP)
    u_x = c%now%u_x
    unmet = maxval(by) > c%tol
    if (unmet) return

    by = -merge(c%mode, 0_ip, abs(c%mode) == 1)*(c%now%u_x - home)*s%k
    new = STUCK
    u_x = home
    unmet = maxval(by) > c%tol
    if (unmet) return

    home = c%now%u_x
    by = merge(abs(c%now%f) - g%hold*c%now%p, 0.0_dp, c%mode == STUCK)
    new = merge(merge(1_ip, 0_ip, c%now%f < 0.0_dp), -1_ip, .not. c%now%f > 0.0_dp)
    u_x = home
    unmet = maxval(by) > c%tol
  end subroutine unmet_in_event

  !> The next change of contact state as the driver moves: its drive (huge if there is none), block and new state. With `reload`,
  !> a slipping block with negligible p sticks as soon as p grows again.
  pure subroutine next_change(s, rules, g, c, reload, run)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    logical, intent(in) :: reload
    type(run_t), intent(inout) :: run
    real(dp) :: small, best
    logical :: closed(s%nx), held(s%nx), light(s%nx)

    call look(s, g, c)
    call rates(s, g, c, run%rate)
    small = small_rate(s, rules, run%rate)
    closed = c%mode /= OPEN_GAP
    held = c%mode == STUCK
    light = reload .and. abs(c%mode) == 1 .and. c%now%p <= 2*s%least
    best = huge(best)
    run%block = 1
    run%new = STUCK
    associate (now => c%now, rate => run%rate, at => c%way*c%column(s%nx + 1))
      call sooner(s%nx, at, 1_ip, g%hold*now%p + now%f, g%hold*rate%p + rate%f, held, small, best, run)
      call sooner(s%nx, at, -1_ip, g%hold*now%p - now%f, g%hold*rate%p - rate%f, held, small, best, run)
      call sooner(s%nx, at, OPEN_GAP, now%p, rate%p, closed, small, best, run)
      call sooner(s%nx, at, STUCK, s%k*(now%u_z + g%gap), s%k*rate%u_z, .not. closed .and. g%touches, small, best, run)
      call sooner(s%nx, at, STUCK, 2*s%least - now%p, -rate%p, light, small, best, run)
    end associate
    run%ahead = c%way*best
  end subroutine next_change

  !> Sets the next change to the block whose margin falls to zero first, if this zero precedes the best change so far.
  pure subroutine sooner(nx, at, new, margin, slope, which, small, best, run)
    integer, intent(in) :: nx
    real(dp), intent(in) :: at                !! present path of the driver [m]
    integer(ip), intent(in) :: new            !! state that these blocks get
    real(dp), intent(in) :: margin(nx)        !! margin to the new state [N]
    real(dp), intent(in) :: slope(nx)         !! rate of the margin [N/m]
    logical, intent(in) :: which(nx)
    real(dp), intent(in) :: small             !! largest rate by rounding [N/m]
    real(dp), intent(inout) :: best           !! path of the driver at the first change [m]
    type(run_t), intent(inout) :: run
    real(dp) :: far, nearest
    integer :: i, first

    first = 0
    nearest = huge(best)
    do i = 1, nx
      if (.not. (which(i) .and. slope(i) < -small)) cycle
      far = max(margin(i), 0.0_dp)/(-slope(i))
      if (far < nearest) first = i
      if (far < nearest) nearest = far
    end do
    if (first == 0 .or. .not. at + nearest < best) return
    best = at + nearest
    run%block = first
    run%new = new
  end subroutine sooner

  !> Largest rate of a force that rounding can cause [N/m].
  pure function small_rate(s, rules, rate) result(small)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(values_t), intent(in) :: rate
    real(dp) :: small

    small = rules%rate*(s%k*maxval(abs(rate%u_x)) + min(s%k, s%k_driver))
  end function small_rate

  ! --- slip that grows -----------------------------------------------------------------------------

  !> Lets blocks stick or slip according to rates under motion of the driver. If all conditions hold, logs the state.
  pure subroutine grow(s, rules, leg, g, c, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log
    real(dp) :: by(s%nx), small, t
    integer(ip) :: new(s%nx)
    logical :: unmet

    if (run%grown >= rules%growth) run%status = GROWS
    if (run%status == DONE .and. run%tried >= rules%changes) run%status = UNSETTLED
    if (run%status /= DONE) return
    call look(s, g, c)
    call unmet_in_rates(s, rules, g, c, run%rate, by, new, small, unmet)
    if (unmet) then
      call put(s, g, c, chosen(s%nx, rules, run%tried, by, small), new, c%now%u_x)
      run%tried = run%tried + 1
      return
    end if
    t = time_at(leg, run%offset, c%column(s%nx + 1))
    call log_changes(s, rules, t, c, c%now, run, log)
    run%events = run%starts
    call log_point(s, t, g, c, run, log)
    run%phase = PASSES
    run%ahead = c%column(s%nx + 1)
    if (.not. any(c%mode == STUCK)) run%phase = ENDS
    if (run%phase == PASSES .and. rules%stops) run%status = PAUSED
  end subroutine grow

  !> Violations of conditions by rates. A slipping block that would move back sticks. A stuck block at its threshold slips if it
  !> would exceed the threshold. If a block has just landed, f is zero within rounding, and the rate of f gives the direction.
  pure subroutine unmet_in_rates(s, rules, g, c, rate, by, new, small, unmet)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(ground_t), intent(in) :: g
    type(contact_t), intent(in) :: c
    type(values_t), intent(inout) :: rate       !! derivatives of the state
    real(dp), intent(out) :: by(s%nx)           !! violation of the condition of each block [N/m]
    integer(ip), intent(out) :: new(s%nx)       !! new state of each block
    real(dp), intent(out) :: small              !! largest violation by rounding [N/m]
    logical, intent(out) :: unmet
    integer(ip) :: slip, way
    integer :: i
    real(dp) :: f

    call rates(s, g, c, rate)
    small = small_rate(s, rules, rate)
    do i = 1, s%nx
      slip = merge(c%mode(i), 0_ip, abs(c%mode(i)) == 1)
      f = merge(c%now%f(i), rate%f(i), abs(c%now%f(i)) > c%tol)
      way = merge(merge(1_ip, 0_ip, f > 0.0_dp), -1_ip, .not. f < 0.0_dp)
      by(i) = 0.0_dp
      if (c%mode(i) == STUCK .and. g%hold(i)*c%now%p(i) - abs(c%now%f(i)) <= c%tol) by(i) = way*rate%f(i) - g%hold(i)*rate%p(i)
      by(i) = max(-slip*rate%u_x(i)*s%k, by(i))
      new(i) = merge(STUCK, -way, slip /= 0)
    end do
    unmet = maxval(by) > small
  end subroutine unmet_in_rates

  !> Moves the driver to the next change and makes this change, if the present state is unique.
  pure subroutine pass(s, rules, leg, g, c, run)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: leg
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(inout) :: run
    logical :: definite

    call test_definite(s, g, c, rules%definite, definite)
    if (.not. definite) run%status = AMBIGUOUS
    if (run%status /= DONE) return
    call next_change(s, rules, g, c, .false., run)
    if (beyond(leg, c%way, run)) then
      run%phase = ENDS
      return
    end if
    c%column(s%nx + 1) = run%ahead
    c%known = .false.
    call change(s, g, c, run%block, int(run%new, ip))
    run%phase = FOLLOWS
    run%grown = run%grown + 1
    run%tried = 0
  end subroutine pass

  ! --- logs ----------------------------------------------------------------------------------------

  !> Logs the blocks whose state has changed. Slip starts at the values `before` the change.
  pure subroutine log_changes(s, rules, t, c, before, run, log)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    real(dp), intent(in) :: t                   !! time [s]
    type(contact_t), intent(in) :: c            !! `now` is up to date
    type(values_t), intent(in) :: before
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log
    integer(ip) :: new(s%nx), old(s%nx)
    logical :: was
    integer :: i

    old = run%mode
    new = merge(OPEN_GAP, c%mode, c%mode == BARE)
    if (all(new == old)) return
    do i = 1, s%nx
      if (new(i) == old(i)) cycle
      if (abs(new(i)) == 1) run%releases = run%releases + 1
      if (abs(new(i)) == 1 .and. abs(old(i)) /= 1) then
        call log_switch(rules, i, new(i), t, before, run, log)
      else
        call log_switch(rules, i, new(i), t, c%now, run, log)
      end if
    end do
    run%mode = new
    was = run%slips
    run%slips = any(abs(new) == 1 .and. run%corner == 0)
    if (run%slips .and. .not. was) call log_quiet(run%step, t, 1_ip, old, before, log)
    if (was .and. .not. run%slips) call log_quiet(run%step, t, -1_ip, new, c%now, log)
    if (run%slips .and. .not. was) run%starts = run%starts + 1
    run%step = run%step + 1
  end subroutine log_changes

  pure subroutine log_switch(rules, i, new, t, at, run, log)
    type(rules_t), intent(in) :: rules
    integer, intent(in) :: i                    !! block, from 1
    integer(ip), intent(in) :: new              !! state of the block after the change
    real(dp), intent(in) :: t                   !! time [s]
    type(values_t), intent(in) :: at            !! values, of which u_x and p are logged
    type(run_t), intent(inout) :: run
    type(log_t), intent(inout) :: log

    if (abs(run%mode(i)) /= 1) run%corner(i) = merge(1_ip, 0_ip, at%p(i) < rules%p_corner)
    log%n_switch = log%n_switch + 1
    log%switch_i(:, log%n_switch) = [int(i - 1, ip), run%mode(i), new, run%corner(i)]
    log%switch_r(:, log%n_switch) = [real(run%step, dp), t, at%u_x(i), at%p(i)]
  end subroutine log_switch

  pure subroutine log_quiet(step, t, kind, mode, at, log)
    integer, intent(in) :: step
    real(dp), intent(in) :: t                   !! time [s]
    integer(ip), intent(in) :: kind             !! +1 first slip, -1 last stick
    integer(ip), intent(in) :: mode(:)
    type(values_t), intent(in) :: at
    type(log_t), intent(inout) :: log

    log%n_quiet = log%n_quiet + 1
    log%quiet_i(1, log%n_quiet) = kind
    log%quiet_i(2:, log%n_quiet) = mode
    log%quiet_r(:3, log%n_quiet) = [real(step, dp), t, at%f_t]
    log%quiet_r(4:, log%n_quiet) = [at%u_x, at%f, at%p]
  end subroutine log_quiet

  pure subroutine log_point(s, t, g, c, run, log)
    type(slider_t), intent(in) :: s
    real(dp), intent(in) :: t                   !! time [s]
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    type(run_t), intent(in) :: run
    type(log_t), intent(inout) :: log

    call look(s, g, c)
    log%n_point = log%n_point + 1
    log%points(:, log%n_point) = [t, c%now%f_t, real(run%step, dp)]
  end subroutine log_point
end module pyfric_sequence
