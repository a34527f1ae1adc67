!> Many steps, with contact states switched between or inside them, on one or more threads.
module pyfric_stepping
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  use pyfric_model, only: model_t
  use pyfric_rows, only: budget_t, row_t, new_row
  use pyfric_workspace, only: reserve, aligned, widen, narrow, RINGS, CARRY, BONDS, FX, FZ, COLUMNS, MOST_STAGES
  use pyfric_rk4, only: rk4_step, BOTTOM_FRONT, BOTTOM_ROWS
  use pyfric_nystrom, only: table_t, nystrom_step
  use pyfric_contact, only: contact_t, switch_contacts
  use pyfric_log, only: log_t, has_room
  use pyfric_location, only: pace_t, new_pace, judge, settle, most_switches, MOST_QUIET
  use pyfric_status, only: DONE, LOG_FULL
!$ use omp_lib, only: omp_get_thread_num, omp_get_num_threads
  implicit none (type, external)
  private
  public :: method_t, run_t, advance_steps

  !> How steps are made.
  type :: method_t
    type(table_t) :: table       !! the stepper
    logical :: located           !! locate switches inside the step; else they are made at its end
    real(dp) :: rtol             !! adaptive: error of a sub-step over that of F_N/N_x on the stiffest spring
    real(dp) :: t0               !! time of step 0 [s]
    real(dp) :: dt               !! step [s]
    integer :: n_steps           !! steps to make
    integer :: n_threads         !! threads to ask for; each gets its own rows
    logical :: keep_budget       !! integrate works and dissipations too
  end type method_t

  !> Where the steps stand; shared by all threads, changed by the first one between steps.
  type :: run_t
    real(dp) :: step             !! steps made since step 0
    real(dp) :: sub              !! length of the step or sub-step; adaptive: the longest that the error allows [s]
    real(dp) :: t = 0.0_dp       !! its start; on return where it went wrong [s]
    real(dp) :: tried = 0.0_dp   !! steps and sub-steps computed; of those that were not accepted the share below
    real(dp) :: share = 1.0_dp   !! of a step that is computed before it is judged
    integer :: block = 0         !! where it went wrong: block from 1
    integer(ip) :: status = DONE !! see pyfric_status
    real(dp) :: last = 0.0_dp    !! step at which to end
    logical :: go = .false.      !! make one more
    logical :: whole = .false.   !! no sub-steps
    logical :: apart = .false.   !! the bottom rows of a sub-step are made first, the others if it is accepted
    integer :: now = 1           !! which of the two states is the present one
    real(dp), allocatable :: err(:, :)   !! errors of u [m] and v [m/s] in each thread's rows
    real(dp) :: worst = 0.0_dp           !! the largest over what is allowed
    real(dp) :: allowed(2) = 0.0_dp      !! and what is allowed
    type(row_t) :: bottom
    type(pace_t) :: pace
  end type run_t

contains

  !> Steps from step number `step` on; stops early when the log could overflow or a step cannot be made.
  subroutine advance_steps(s, method, run, y, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: y(s%nx, 4, s%nz)     !! state
    real(dp), intent(inout) :: rod(6)               !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp), allocatable :: states(:), stage(:), forces(:)

    call reserve(s, 8*s%nz, states)
    call reserve(s, 4*s%nz, stage)
    call reserve(s, 2*MOST_STAGES*s%nz, forces)  ! memory that a stepper does not touch costs nothing
    if (method%table%stages > 0) then
      stage = 0.0_dp
      forces = 0.0_dp
    end if
    call steps(s, method, run, y, states(aligned(states)), stage(aligned(stage)), forces(aligned(forces)), rod, contact, &
               budget, log)
    if (run%status == DONE .and. run%step < run%last) run%status = LOG_FULL
    if (.not. run%whole) run%sub = run%pace%wish
  end subroutine advance_steps

  !> The same with rows of bounds LB:n+LANES; the state goes back and forth between two of them.
  subroutine steps(s, method, run, narrow_y, y, stage, forces, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: narrow_y(s%nx, 4, s%nz)            !! state
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! work space: the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MOST_STAGES)  !! and forces of all stages [N]
    real(dp), intent(inout) :: rod(6)                             !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp) :: rods(6, 2)

    call widen(s, narrow_y, y(LB, 1, 1, 1))
    call widen(s, narrow_y, y(LB, 1, 1, 2))
    rods = spread(rod, 2, 2)
    call start(s, method, y(LB, 1, 1, 1), contact, budget, log, run)
    !$omp parallel default(none) num_threads(method%n_threads) &
    !$omp shared(s, method, run, y, stage, forces, rods, contact, budget, log)
    call one_thread(s, method, run, y, stage, forces, rods, contact, budget, log)
    !$omp end parallel
    call narrow(s, y(LB, 1, 1, run%now), narrow_y)
    rod = rods(:, run%now)
  end subroutine steps

  !> Plans the first step.
  subroutine start(s, method, y, contact, budget, log, run)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)     !! state
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(log_t), intent(in) :: log
    type(run_t), intent(inout) :: run
    real(dp) :: stiffest

    run%t = method%t0 + run%step*method%dt
    run%last = run%step + method%n_steps
    allocate (run%err(2, method%n_threads))
    run%err = 0.0_dp
    stiffest = max(s%k, maxval(s%k_f), s%k_top)
    run%allowed = method%rtol*s%f_n/s%nx/[stiffest, sqrt(stiffest*s%m)]
    run%bottom = new_row(s)
    run%whole = .not. method%located .and. all(abs(method%table%e) <= 0.0_dp)
    if (run%whole) then
      run%sub = method%dt
    else
      call new_pace(s, run%t, method%dt, method%located, run%sub, y, contact, budget, run%bottom, run%pace)
      run%sub = run%pace%sub
    end if
    run%apart = method%located .and. method%table%stages == 0 .and. s%nz > BOTTOM_FRONT
    if (run%apart) run%share = real(BOTTOM_ROWS, dp)/(4*s%nz)
    run%go = run%step < run%last .and. room(s, method, log)
  end subroutine start

  !> The steps of the rows that one thread owns; the first thread also switches the contacts.
  subroutine one_thread(s, method, run, y, stage, forces, rods, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MOST_STAGES)  !! and forces of all stages [N]
    real(dp), intent(inout) :: rods(6, 2)                         !! the rod at both states
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp), allocatable :: work(:)
    type(row_t) :: w
    integer :: me, team, j0, j1, at
    logical :: apart

    me = 0
    team = 1
    !$ me = omp_get_thread_num()
    !$ team = omp_get_num_threads()
    j0 = 1 + (me*s%nz)/team
    j1 = ((me + 1)*s%nz)/team
    call reserve(s, COLUMNS, work)
    work = 0.0_dp
    w = new_row(s)
    at = aligned(work)
    apart = run%apart .and. s%nz >= 2*team  ! the first thread owns both bottom rows
    do
      if (.not. run%go) exit
      if (apart) then
        if (me == 0) then
          call fronts(1, BOTTOM_FRONT)
          call look(s, method, run, y(LB, 1, 1, run%now), y(LB, 1, 1, 3 - run%now), contact)
        end if
        !$omp barrier
      end if
      if (.not. apart) call fronts(1, huge(1))
      if (apart .and. run%pace%accepted) call fronts(merge(BOTTOM_FRONT + 1, 1, me == 0), huge(1))
      !$omp barrier
      if (me == 0) then
        if (.not. apart) call look(s, method, run, y(LB, 1, 1, run%now), y(LB, 1, 1, 3 - run%now), contact)
        call after(s, method, run, y(LB, 1, 1, 3 - run%now), contact, budget, log)
      end if
      !$omp barrier
    end do

  contains

    !> Fronts of RK4, or a step of a table.
    subroutine fronts(first, last)
      integer, intent(in) :: first
      integer, intent(in) :: last

      call one_step(s, method, run, j0, j1, first, last, y, stage, forces, rods, contact, budget, work(at), w, &
                    run%err(:, me + 1))
    end subroutine fronts
  end subroutine one_thread

  !> Rows j0..j1 of one step, or of a sub-step that is tried.
  subroutine one_step(s, method, run, j0, j1, first, last, y, stage, forces, rods, contact, budget, work, w, err)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(in) :: run
    integer, intent(in) :: j0                   !! first row of this thread
    integer, intent(in) :: j1                   !! last row of this thread
    integer, intent(in) :: first                !! fronts to make, see pyfric_rk4
    integer, intent(in) :: last                 !! see `first`
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MOST_STAGES)  !! and forces of all stages [N]
    real(dp), intent(inout) :: rods(6, 2)                         !! the rod at both states
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(inout) :: budget
    real(dp), intent(inout) :: work(LB:s%n + LANES, COLUMNS)      !! this thread's, aligned
    type(row_t), intent(inout) :: w
    real(dp), intent(inout) :: err(2)           !! errors of u [m] and v [m/s] in these rows
    integer :: old, new

    old = run%now
    new = 3 - old
    if (method%table%stages == 0) then
      call rk4_step(s, run%t, run%sub, j0, j1, first, last, method%keep_budget, contact%mode, contact%memory, &
                    y(LB, 1, 1, old), rods(:, old), y(LB, 1, 1, new), rods(:, new), budget, work(LB, RINGS), &
                    work(LB, CARRY), work(LB, BONDS), work(LB, FX), work(LB, FZ), w)
    else
      call nystrom_step(s, method%table, run%t, run%sub, j0, j1, method%keep_budget, contact%mode, contact%memory, &
                        y(LB, 1, 1, old), rods(:, old), y(LB, 1, 1, new), rods(:, new), budget, forces, stage, work, w, err)
    end if
  end subroutine one_step

  !> Whether the sub-step from old to new is accepted: its bottom rows say so.
  subroutine look(s, method, run, old, new, contact)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)       !! state at the start
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)       !! state at the end
    type(contact_t), intent(in) :: contact

    if (run%whole) return
    run%worst = maxval(maxval(run%err, dim=2)/run%allowed)
    call judge(s, run%step, method%t0, method%dt, run%worst, old, new, contact, run%bottom, run%pace, run%status)
  end subroutine look

  !> After a step or a sub-step: contacts, and what comes next.
  subroutine after(s, method, run, new, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz)    !! state at the end
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp) :: next

    run%tried = run%tried + merge(1.0_dp, run%share, run%pace%accepted)
    next = run%step + 1.0_dp
    if (run%whole) then
      call switch_contacts(s, next, method%t0 + next*method%dt, method%dt, new, contact, log, run%bottom)
    else
      call settle(s, run%step, method%dt, run%worst, new, contact, budget, log, run%bottom, run%pace, run%status)
      run%sub = run%pace%sub
    end if
    if (run%status /= DONE) then
      run%block = run%pace%block
      run%t = run%t + merge(run%sub, 0.0_dp, run%pace%accepted)
      run%go = .false.
      return
    end if
    if (.not. run%pace%accepted) return
    run%now = 3 - run%now
    if (run%pace%finished) run%step = next
    run%t = method%t0 + run%step*method%dt
    if (.not. run%whole) run%t = run%t + run%pace%from
    if (run%pace%finished) run%go = run%step < run%last .and. room(s, method, log)
  end subroutine after

  !> True while one more step cannot overflow the log.
  pure function room(s, method, log) result(yes)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(log_t), intent(in) :: log
    logical :: yes

    if (method%located) then
      yes = has_room(log, most_switches(s%nx), MOST_QUIET)
    else
      yes = has_room(log, s%nx, 1)
    end if
  end function room
end module pyfric_stepping
