!> Many steps, with contact states switched between or inside them, on one or more threads.
module pyfric_stepping
  use, intrinsic :: iso_c_binding, only: c_loc, c_intptr_t
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, close_state, LB, LANES
  use pyfric_lattice, only: N_BOND
  use pyfric_rows, only: budget_t, row_t, new_row
  use pyfric_rk4, only: rk4_step, RING
  use pyfric_nystrom, only: table_t, table_of, nystrom_step, RK4, ADAPTIVE, MOST_STAGES
  use pyfric_contact, only: contact_t, log_t, switch_contacts
  use pyfric_location, only: pace_t, new_pace, judge, most_switches, MOST_QUIET
  use pyfric_status, only: DONE, LOG_FULL
!$ use omp_lib, only: omp_get_thread_num, omp_get_num_threads
  implicit none (type, external)
  private
  public :: method_t, advance_steps, widen, aligned

  !> How steps are made.
  type :: method_t
    integer(ip) :: stepper       !! see pyfric_nystrom
    logical :: located           !! locate switches inside the step; else they are made at its end
    real(dp) :: rtol             !! adaptive: error of a sub-step over that of F_N/N_x on the stiffest spring
    real(dp) :: h                !! adaptive: longest sub-step that the error allows [s]
    real(dp) :: tried = 0.0_dp   !! steps and sub-steps computed, also those that were not accepted
    integer :: block = 0         !! where it went wrong: block from 1
    real(dp) :: t = 0.0_dp       !! and time [s]
  end type method_t

contains

  !> Steps from step number `step` on; stops early when the log could overflow or a step cannot be made.
  subroutine advance_steps(s, method, t0, dt, n_steps, n_threads, keep_budget, step, y, rod, contact, budget, log, status)
    type(model_t), intent(in) :: s
    type(method_t), intent(inout) :: method
    real(dp), intent(in) :: t0                      !! time of step 0 [s]
    real(dp), intent(in) :: dt                      !! step [s]
    integer, intent(in) :: n_steps                  !! steps to make
    integer, intent(in) :: n_threads                !! threads to ask for; each gets its own rows
    logical, intent(in) :: keep_budget              !! integrate works and dissipations too
    real(dp), intent(inout) :: step                 !! steps made
    real(dp), intent(inout) :: y(s%nx, 4, s%nz)     !! state
    real(dp), intent(inout) :: rod(6)               !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    integer(ip), intent(out) :: status              !! see pyfric_status
    real(dp), allocatable :: a(:), stages(:)
    type(table_t) :: table
    integer :: n, at, q

    n = (s%n + 2*LANES)*4*s%nz
    allocate (a(2*n + LANES))
    at = aligned(a)
    call widen(s, y, a(at))
    call widen(s, y, a(at + n))
    table = table_of(method%stepper)
    allocate (stages(n + (n/2)*MOST_STAGES + LANES))  ! memory that a stepper does not touch costs nothing
    if (table%stages > 0) stages = 0.0_dp
    q = aligned(stages)
    call steps(s, table, method, t0, dt, n_steps, n_threads, keep_budget, step, a(at), a(at + n), stages(q), &
               stages(q + n), rod, contact, budget, log, status)
    call narrow(s, a(at), y)
  end subroutine advance_steps

  !> The same on rows with bounds LB:n+LANES: the state goes back and forth between y and z, and ends in y.
  subroutine steps(s, table, method, t0, dt, n_steps, n_threads, keep_budget, step, y, z, q, f, rod, contact, budget, log, &
                   status)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    type(method_t), intent(inout) :: method
    real(dp), intent(in) :: t0                             !! time of step 0 [s]
    real(dp), intent(in) :: dt                             !! step [s]
    integer, intent(in) :: n_steps                         !! steps to make
    integer, intent(in) :: n_threads                       !! threads to ask for
    logical, intent(in) :: keep_budget                     !! integrate works and dissipations too
    real(dp), intent(inout) :: step                        !! steps made since step 0
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz)      !! state
    real(dp), intent(inout) :: z(LB:s%n + LANES, 4, s%nz)      !! work space
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4, s%nz)      !! work space of tables: a stage
    real(dp), intent(inout) :: f(LB:s%n + LANES, 2, s%nz, MOST_STAGES)  !! and forces of all stages
    real(dp), intent(inout) :: rod(6)                      !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    integer(ip), intent(out) :: status                     !! see pyfric_status
    real(dp) :: rod_z(6), step_begin, t, h, err(2, n_threads), allowed(2), stiffest
    type(row_t) :: bottom
    type(pace_t) :: pace
    integer :: n_work
    logical :: go, in_y, whole

    rod_z = rod
    bottom = new_row(s)
    step_begin = step
    t = t0 + step*dt
    h = dt
    err = 0.0_dp
    stiffest = max(s%k, s%k_f, s%k_top)
    allowed = method%rtol*s%f_n/s%nx/[stiffest, sqrt(stiffest*s%m)]
    whole = .not. method%located .and. method%stepper /= ADAPTIVE
    if (.not. whole) then
      call new_pace(s, t, dt, method%located, method%h, y, contact, budget, bottom, pace)
      h = pace%h
    end if
    n_work = (s%n + 2*LANES)*(12*RING + 8 + N_BOND + 2)
    in_y = .true.
    status = DONE
    go = n_steps > 0 .and. room(s, method, log)
    !$omp parallel default(none) num_threads(n_threads) &
    !$omp shared(s, table, method, t0, dt, n_steps, keep_budget, step, step_begin, y, z, q, f, rod, rod_z, contact, budget) &
    !$omp shared(log, bottom, pace, go, in_y, whole, n_work, t, h, err, allowed, status)
    call one_thread()
    !$omp end parallel
    if (status == DONE .and. step - step_begin < n_steps) status = LOG_FULL
    if (.not. whole) method%h = pace%wish
    if (.not. in_y) then
      y = z
      rod = rod_z
    end if

  contains

    !> The steps of the rows that one thread owns; the first thread also switches the contacts.
    subroutine one_thread()
      real(dp), allocatable :: work(:)
      type(row_t) :: row
      integer :: at, me, team, j0, j1

      me = 0
      team = 1
      !$ me = omp_get_thread_num()
      !$ team = omp_get_num_threads()
      j0 = 1 + (me*s%nz)/team
      j1 = ((me + 1)*s%nz)/team
      row = new_row(s)
      allocate (work(n_work + LANES))
      work = 0.0_dp
      at = aligned(work)
      do
        if (.not. go) exit
        if (in_y) then
          call one_step(j0, j1, me + 1, y, rod, z, rod_z, work(at), row)
        else
          call one_step(j0, j1, me + 1, z, rod_z, y, rod, work(at), row)
        end if
        !$omp barrier
        if (me == 0) then
          if (in_y) then
            call after(y, z)
          else
            call after(z, y)
          end if
        end if
        !$omp barrier
      end do
    end subroutine one_thread

    !> Rows j0..j1 of one step, or of a sub-step that is tried.
    subroutine one_step(j0, j1, me, old, rod_old, new, rod_new, work, row)
      integer, intent(in) :: j0                                  !! first row of this thread
      integer, intent(in) :: j1                                  !! last row of this thread
      integer, intent(in) :: me                                  !! thread, from 1
      real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)       !! state at the start
      real(dp), intent(in) :: rod_old(6)                         !! rod at the start
      real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz)    !! state at the end
      real(dp), intent(inout) :: rod_new(6)                      !! rod at the end
      real(dp), intent(inout) :: work(n_work)                    !! this thread's, aligned
      type(row_t), intent(inout) :: row
      integer :: n

      n = s%n + 2*LANES
      if (method%stepper == RK4) then
        call rk4_step(s, t, h, j0, j1, keep_budget, contact%mode, contact%s_0, old, rod_old, new, rod_new, budget, work, &
                      work(1 + 12*n*RING), work(1 + n*(12*RING + 8)), work(1 + n*(12*RING + 8 + N_BOND)), &
                      work(1 + n*(12*RING + 9 + N_BOND)), row)
      else
        call nystrom_step(s, table, t, h, j0, j1, keep_budget, contact%mode, contact%s_0, old, rod_old, new, rod_new, &
                          budget, f, q, work, work(1 + 2*n), work(1 + n*(2 + N_BOND)), work(1 + n*(3 + N_BOND)), row, &
                          err(:, me))
      end if
    end subroutine one_step

    !> After a step or a sub-step from old to new: contacts, and what comes next.
    subroutine after(old, new)
      real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)       !! state at the start
      real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz)    !! state at the end
      logical :: accepted, finished

      method%tried = method%tried + 1.0_dp
      if (whole) then
        accepted = .true.
        finished = .true.
        call switch_contacts(s, step + 1.0_dp, t0 + (step + 1.0_dp)*dt, dt, new, contact, log, bottom)
      else
        call judge(s, step, t0, dt, maxval(maxval(err, dim=2)/allowed), old, new, contact, budget, log, bottom, pace, &
                   accepted, finished, status)
        h = pace%h
      end if
      if (finished .and. status == DONE) step = step + 1.0_dp
      if (status /= DONE) then
        method%block = pace%block
        method%t = t + merge(h, 0.0_dp, accepted)
        go = .false.
        return
      end if
      if (.not. accepted) return
      in_y = .not. in_y
      t = t0 + step*dt
      if (.not. whole) t = t + pace%from
      if (finished) go = step - step_begin < n_steps .and. room(s, method, log)
    end subroutine after
  end subroutine steps

  !> True while one more step cannot overflow the log.
  pure function room(s, method, log) result(yes)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(log_t), intent(in) :: log
    logical :: yes
    integer :: switches, quiet

    switches = merge(most_switches(s%nx), s%nx, method%located)
    quiet = merge(MOST_QUIET, 1, method%located)
    yes = log%n_switch + switches <= size(log%switch_r, 2) .and. log%n_quiet + quiet <= size(log%quiet_r, 2)
  end function room

  !> Index of the first element of a that lies on a vector of LANES.
  function aligned(a) result(at)
    real(dp), intent(in), target :: a(:)
    integer :: at
    integer(c_intptr_t) :: first

    first = transfer(c_loc(a), first)/8
    at = 1 + int(modulo(-first, int(LANES, c_intptr_t)))
  end function aligned

  !> The state with rows of bounds LB:n+LANES.
  pure subroutine widen(s, y, wide)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: y(s%nx, 4, s%nz)               !! state
    real(dp), intent(out) :: wide(LB:s%n + LANES, 4, s%nz)     !! the same
    integer :: j

    wide = 0.0_dp
    wide(s%at(:s%nx), :, :) = y
    do j = 1, s%nz
      call close_state(s, wide(LB, 1, j))
    end do
  end subroutine widen

  !> And back.
  pure subroutine narrow(s, wide, y)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: wide(LB:s%n + LANES, 4, s%nz)      !! state
    real(dp), intent(out) :: y(s%nx, 4, s%nz)              !! the same

    y = wide(s%at(:s%nx), :, :)
  end subroutine narrow
end module pyfric_stepping
