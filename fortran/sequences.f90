!> Quasi-static sequences of many runs on threads. Runs are stored in plain arrays of Python.
!>
!> Runs share the slider and the protocol, and differ in their interface. One thread makes all changes of a run, so that the bits
!> of the run do not depend on other runs.
module pyfric_sequences
  use pyfric_kinds, only: dp, ip
  use pyfric_law, only: STUCK, OPEN_GAP
  use pyfric_pivots, only: slider_t, ground_t, contact_t, new_contact, new_values, make_base, find_ends, KEPT
  use pyfric_sequence, only: rules_t, leg_t, log_t, run_t, new_log, go_on
  use pyfric_status, only: DONE, NO_MEMORY
  implicit none (type, external)
  private
  public :: new_slider, new_rules, new_leg, follow_all, N_SCALES, N_RULES, N_LEG, N_FIELDS, N_STATES, N_COUNTS, N_NUMBERS

  integer, parameter :: N_SCALES = 6           !! how many numbers of a slider Python passes
  integer, parameter :: N_RULES = 7            !! how many numbers rules have
  integer, parameter :: N_LEG = 9              !! how many numbers a leg has
  integer, parameter :: N_FIELDS = 4           !! number of fields of the interface: hold, slide, k_f [N/m], gap [m]
  integer, parameter :: N_STATES = 3 + KEPT    !! how many integers are stored for a block
  integer, parameter :: N_COUNTS = 15          !! how many integers are stored for a run
  integer, parameter :: N_NUMBERS = 4          !! how many numbers are stored for a run

  !> Work space of a thread for a run.
  type :: work_t
    type(ground_t) :: ground
    type(contact_t) :: contact
    type(run_t) :: run
    type(log_t) :: log
    logical :: complete = .false.              !! whether memory was allocated
    logical :: shares = .false.                !! whether other runs begin with a table of this run
  end type work_t

contains

  pure function new_slider(nx, n_routes, scales, s, drive, loads, f_t) result(slider)
    integer, intent(in) :: nx
    integer, intent(in) :: n_routes
    real(dp), intent(in) :: scales(N_SCALES)            !! see slider_t
    real(dp), intent(in) :: s(2*nx, 2*nx)
    real(dp), intent(in) :: drive(2*nx)
    real(dp), intent(in) :: loads(2*nx, 2, n_routes)
    real(dp), intent(in) :: f_t(2, n_routes)
    type(slider_t) :: slider
    integer :: failed

    slider%nx = nx
    slider%k = scales(1)
    slider%k_driver = scales(2)
    slider%unit = scales(3)
    slider%rounded = scales(4)
    slider%least = scales(5)
    slider%lost = scales(6)
    allocate (slider%s(2*nx, 2*nx), slider%drive(2*nx), slider%loads(2*nx, 2, n_routes), slider%f_t(2, n_routes), stat=failed)
    slider%complete = failed == 0
    if (.not. slider%complete) return
    slider%s(:, :) = s
    slider%drive(:) = drive
    slider%loads(:, :, :) = loads
    slider%f_t(:, :) = f_t
  end function new_slider

  pure function new_rules(numbers, nx, stops) result(rules)
    real(dp), intent(in) :: numbers(N_RULES - 1)        !! see rules_t; limits of changes and growth are over N_x
    integer, intent(in) :: nx
    logical, intent(in) :: stops
    type(rules_t) :: rules

    rules = rules_t(nint(numbers(1))*nx, nint(numbers(2)), nint(numbers(3))*nx, numbers(4), numbers(5), numbers(6), stops)
  end function new_rules

  pure function new_leg(numbers) result(leg)
    real(dp), intent(in) :: numbers(N_LEG)              !! see leg_t
    type(leg_t) :: leg

    leg = leg_t(numbers(1), numbers(2), numbers(3), numbers(4), numbers(5), numbers(6), numbers(7), nint(numbers(8)), &
                nint(numbers(9)))
  end function new_leg

  !> Follows all runs. Each run has its own status at the end.
  subroutine follow_all(s, rules, legs, max_changes, threads, n, rooms, fields, kinds, states, columns, tables, counts, &
                        numbers, switch_i, switch_r, quiet_i, quiet_r, points, logged, status)
    type(slider_t), intent(in) :: s
    type(rules_t), intent(in) :: rules
    type(leg_t), intent(in) :: legs(:)
    integer, intent(in) :: max_changes                  !! largest number of changes in each run
    integer, intent(in) :: threads                      !! largest number of threads
    integer, intent(in) :: n                            !! runs
    integer, intent(in) :: rooms(3)                     !! largest numbers of switches, starts and ends of slip, points
    real(dp), intent(in) :: fields(s%nx, N_FIELDS, n)   !! fields of the interface
    integer(ip), intent(in) :: kinds(s%nx, n)           !! 0 never touches, 1 touches without friction, 2 with friction
    integer(ip), intent(inout) :: states(s%nx, N_STATES, n)  !! this array and the next four: see `restore`
    real(dp), intent(inout) :: columns(s%nx + 2, 2, n)
    real(dp), intent(inout) :: tables(3*s%nx + 1, s%nx + 2, 1 + KEPT, n)
    integer(ip), intent(inout) :: counts(N_COUNTS, n)
    real(dp), intent(inout) :: numbers(N_NUMBERS, n)
    integer(ip), intent(inout) :: switch_i(4, rooms(1), n)   !! this array and the next four: see log_t
    real(dp), intent(inout) :: switch_r(4, rooms(1), n)
    integer(ip), intent(inout) :: quiet_i(s%nx + 1, rooms(2), n)
    real(dp), intent(inout) :: quiet_r(3*s%nx + 3, rooms(2), n)
    real(dp), intent(inout) :: points(3, rooms(3), n)
    integer(ip), intent(inout) :: logged(3, n)          !! numbers of entries of the logs
    integer(ip), intent(inout) :: status(n)             !! see pyfric_status
    type(work_t) :: w, first
    integer :: i

    first = new_work(s, rooms)
    if (counts(N_COUNTS, 1) == 0) call share(s, fields(:, :, 1), kinds(:, 1), states(:, 1, 1), first)
    !$omp parallel default(none) num_threads(threads) private(w, i) &
    !$omp shared(s, rules, legs, max_changes, n, rooms, fields, kinds, states, columns, tables, counts, numbers, switch_i) &
    !$omp shared(switch_r, quiet_i, quiet_r, points, logged, status, first)
    w = new_work(s, rooms)
    !$omp do schedule(dynamic)
    do i = 1, n
      status(i) = NO_MEMORY
      if (.not. (w%complete .and. first%complete)) cycle
      call restore(s, fields(:, :, i), kinds(:, i), states(:, :, i), columns(:, :, i), tables(:, :, :, i), counts(:, i), &
                   numbers(:, i), first, w)
      call go_on(s, rules, legs, max_changes, w%ground, w%contact, w%run, w%log)
      call save_log(w%log, logged(:, i), switch_i(:, :, i), switch_r(:, :, i), quiet_i(:, :, i), quiet_r(:, :, i), &
                    points(:, :, i))
      call save(s, w, states(:, :, i), columns(:, :, i), tables(:, :, :, i), counts(:, i), numbers(:, i))
      status(i) = w%run%status
    end do
    !$omp end do
    !$omp end parallel
  end subroutine follow_all

  pure function new_work(s, rooms) result(w)
    type(slider_t), intent(in) :: s
    integer, intent(in) :: rooms(3)                     !! largest numbers of entries of the logs
    type(work_t) :: w
    integer :: nx, failed

    nx = s%nx
    w%contact = new_contact(nx)
    w%log = new_log(nx, rooms(1), rooms(2), rooms(3))
    allocate (w%ground%hold(nx), w%ground%slide(nx), w%ground%k_f(nx), w%ground%gap(nx), w%ground%touches(nx), &
              w%ground%rubs(nx), w%run%home(nx), w%run%corner(nx), w%run%mode(nx), stat=failed)
    call new_values(nx, w%run%before, w%contact%status)
    call new_values(nx, w%run%rate, w%contact%status)
    w%complete = failed == 0 .and. w%contact%status == DONE .and. w%log%complete
  end function new_work

  !> Sets the foundation of a run.
  pure subroutine take_ground(s, fields, kinds, ground)
    type(slider_t), intent(in) :: s
    real(dp), intent(in) :: fields(s%nx, N_FIELDS)
    integer(ip), intent(in) :: kinds(s%nx)
    type(ground_t), intent(inout) :: ground

    ground%hold = fields(:, 1)
    ground%slide = fields(:, 2)
    ground%k_f = fields(:, 3)
    ground%gap = fields(:, 4)
    ground%touches = kinds > 0
    ground%rubs = kinds > 1
  end subroutine take_ground

  !> Computes the table of the first run with all blocks held. Runs with an equal foundation begin with this table.
  pure subroutine share(s, fields, kinds, mode, first)
    type(slider_t), intent(in) :: s
    real(dp), intent(in) :: fields(s%nx, N_FIELDS)
    integer(ip), intent(in) :: kinds(s%nx)
    integer(ip), intent(in) :: mode(s%nx)
    type(work_t), intent(inout) :: first

    if (.not. first%complete) return
    first%shares = .true.
    call take_ground(s, fields, kinds, first%ground)
    first%contact%sets(:, 1) = merge(1_ip, 0_ip, mode /= OPEN_GAP)
    associate (c => first%contact)
      call make_base(s, first%ground, mode /= OPEN_GAP, 1, c%squares(:, :, 1), c%sides(:, :, 1), c%bases(:, :, 1), c%status)
    end associate
  end subroutine share

  !> Restores a run that `save` stored, or begins a new run.
  pure subroutine restore(s, fields, kinds, states, columns, tables, counts, numbers, first, w)
    type(slider_t), intent(in) :: s
    real(dp), intent(in) :: fields(s%nx, N_FIELDS)
    integer(ip), intent(in) :: kinds(s%nx)
    integer(ip), intent(in) :: states(s%nx, N_STATES)   !! contact state, corner slip, state as logged, blocks of stored tables
    real(dp), intent(in) :: columns(s%nx + 2, 2)        !! input of the table; u_x at the last release, last two unused
    real(dp), intent(in) :: tables(3*s%nx + 1, s%nx + 2, 1 + KEPT)  !! the table, and tables with all blocks held
    integer(ip), intent(in) :: counts(N_COUNTS)         !! see `save`
    real(dp), intent(in) :: numbers(N_NUMBERS)          !! drive at the next change, `little` [m], tol [N], offset [m]
    type(work_t), intent(in) :: first
    type(work_t), intent(inout) :: w

    call take_ground(s, fields, kinds, w%ground)
    w%log%n_switch = 0
    w%log%n_quiet = 0
    w%log%n_point = 0
    w%run%leg = counts(1)
    w%run%phase = counts(2)
    w%run%step = counts(3)
    w%run%tried = counts(4)
    w%run%rests = counts(5)
    w%run%grown = counts(6)
    w%run%events = counts(7)
    w%run%starts = counts(8)
    w%run%releases = counts(9)
    w%run%block = counts(10)
    w%run%new = counts(11)
    w%run%slips = counts(12) == 1
    w%run%gradual = counts(13) == 1
    w%run%ahead = numbers(1)
    w%run%little = numbers(2)
    w%run%offset = numbers(4)
    w%run%home = columns(:s%nx, 2)
    w%run%corner = states(:, 2)
    w%run%mode = states(:, 3)
    w%contact%status = DONE
    w%contact%mode = states(:, 1)
    w%contact%free = w%contact%mode /= STUCK
    call find_ends(w%contact)
    w%contact%column = columns(:, 1)
    w%contact%sets = states(:, 4:)
    w%contact%route = abs(counts(14))
    w%contact%way = sign(1_ip, counts(14))
    w%contact%base = max(counts(15), 1_ip)
    w%contact%tol = numbers(3)
    w%contact%known = .false.
    if (counts(15) > 0) then
      w%contact%table = tables(:, :, 1)
      w%contact%bases = tables(:, :, 2:)
    else if (first%shares .and. alike(w%ground, first%ground)) then
      w%contact%sets(:, 1) = first%contact%sets(:, 1)
      w%contact%bases(:, :, 1) = first%contact%bases(:, :, 1)
      w%contact%status = first%contact%status
    end if
  end subroutine restore

  !> Whether two interfaces have equal foundations.
  pure function alike(a, b) result(yes)
    type(ground_t), intent(in) :: a
    type(ground_t), intent(in) :: b
    logical :: yes

    yes = all(abs(a%k_f - b%k_f) <= 0.0_dp) .and. all(abs(a%gap - b%gap) <= 0.0_dp)
  end function alike

  !> Stores a run. Its tables are stored only if the run may go on.
  pure subroutine save(s, w, states, columns, tables, counts, numbers)
    type(slider_t), intent(in) :: s
    type(work_t), intent(in) :: w
    integer(ip), intent(inout) :: states(s%nx, N_STATES)
    real(dp), intent(inout) :: columns(s%nx + 2, 2)
    real(dp), intent(inout) :: tables(3*s%nx + 1, s%nx + 2, 1 + KEPT)
    integer(ip), intent(inout) :: counts(N_COUNTS)
    real(dp), intent(inout) :: numbers(N_NUMBERS)

    states(:, 1) = w%contact%mode
    states(:, 2) = w%run%corner
    states(:, 3) = w%run%mode
    states(:, 4:) = w%contact%sets
    columns(:, 1) = w%contact%column
    columns(:s%nx, 2) = w%run%home
    counts = [w%run%leg, w%run%phase, w%run%step, w%run%tried, w%run%rests, w%run%grown, w%run%events, w%run%starts, &
              w%run%releases, w%run%block, w%run%new, merge(1, 0, w%run%slips), merge(1, 0, w%run%gradual), &
              w%contact%way*w%contact%route, w%contact%base]
    numbers = [w%run%ahead, w%run%little, w%contact%tol, w%run%offset]
    if (w%run%status == DONE) return
    tables(:, :, 1) = w%contact%table
    tables(:, :, 2:) = w%contact%bases
  end subroutine save

  pure subroutine save_log(log, logged, switch_i, switch_r, quiet_i, quiet_r, points)
    type(log_t), intent(in) :: log
    integer(ip), intent(out) :: logged(3)               !! numbers of switches, starts and ends of slip, points
    integer(ip), intent(inout) :: switch_i(:, :)        !! this array and the next four: see log_t
    real(dp), intent(inout) :: switch_r(:, :)
    integer(ip), intent(inout) :: quiet_i(:, :)
    real(dp), intent(inout) :: quiet_r(:, :)
    real(dp), intent(inout) :: points(:, :)

    logged = [log%n_switch, log%n_quiet, log%n_point]
    switch_i(:, :logged(1)) = log%switch_i(:, :logged(1))
    switch_r(:, :logged(1)) = log%switch_r(:, :logged(1))
    quiet_i(:, :logged(2)) = log%quiet_i(:, :logged(2))
    quiet_r(:, :logged(2)) = log%quiet_r(:, :logged(2))
    points(:, :logged(3)) = log%points(:, :logged(3))
  end subroutine save_log
end module pyfric_sequences
