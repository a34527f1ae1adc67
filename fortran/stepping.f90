!> Many steps on one or more threads, with contact states switched at the end of steps or inside them.
module pyfric_stepping
  use, intrinsic :: iso_c_binding, only: c_int64_t
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, LB, LANES
  use pyfric_model, only: model_t
  use pyfric_rows, only: budget_t, row_t, new_row, take_shared
  use pyfric_workspace, only: reserve, aligned, widen, narrow, RINGS, CARRY, BONDS, FX, FZ, COLUMNS, MAX_STAGES
  use pyfric_sweep, only: swept_step, bottom_front, bottom_rows
  use pyfric_table_stepper, only: table_t, table_step
  use pyfric_contact, only: contact_t, switch_contacts
  use pyfric_boundaries, only: foundation
  use pyfric_energy, only: curve_point, N_POINT
  use pyfric_log, only: log_t, log_point, log_budget, log_speeds, log_burst, has_room
  use pyfric_location, only: step_control_t, new_control, test_substep, complete_substep, max_switches, MAX_QUIET
  use pyfric_status, only: DONE, LOG_FULL, NO_MEMORY, STRAINED
!$ use omp_lib, only: omp_get_thread_num, omp_get_num_threads
  implicit none (type, external)
  private
  public :: method_t, run_t, advance_steps

  !> The method of the steps.
  type :: method_t
    type(table_t) :: table       !! the stepper
    logical :: located           !! whether switches are located inside the step; if not, they occur at its end
    real(dp) :: rtol             !! allowed error of an adaptive sub-step, over the effect of F_N/N_x on the stiffest spring
    real(dp) :: t0               !! time of step 0 [s]
    real(dp) :: dt               !! step [s]
    integer :: n_steps           !! largest number of steps
    integer :: n_threads         !! largest number of threads; each thread owns some rows
    logical :: keep_budget       !! whether to integrate work and dissipation
  end type method_t

  !> Progress of the steps, which all threads share. Only the first thread changes the numbers here, between steps.
  type :: run_t
    real(dp) :: step                     !! steps made since step 0
    real(dp) :: sub                      !! length of the step or sub-step; adaptive: the longest that the error allows [s]
    real(dp) :: t = 0.0_dp               !! start of the step; after a failure, time of the failure [s]
    real(dp) :: tried = 0.0_dp           !! steps and sub-steps computed; of a rejected sub-step, the share of its rows computed
    real(dp) :: tested_share = 1.0_dp    !! share of the rows of a step that are computed before its test
    integer :: block = 0                 !! block at which a step failed, from 1
    integer(ip) :: status = DONE         !! see pyfric_status
    real(dp) :: end_step = 0.0_dp        !! number of the last step
    logical :: goes_on = .false.         !! whether one more step follows
    logical :: no_substeps = .false.     !! whether steps have no sub-steps
    logical :: bottom_first = .false.    !! whether bottom rows of a sub-step come first, others only if it is accepted
    integer :: current = 1               !! number of the present state, 1 or 2
    real(dp), allocatable :: err(:, :)   !! errors of u [m] and v [m/s] in each thread's rows
    real(dp) :: error = 0.0_dp           !! largest error over the allowed error
    real(dp) :: allowed(2) = 0.0_dp      !! allowed errors of u [m] and v [m/s]
    type(row_t) :: bottom_row
    type(step_control_t) :: control
  end type run_t

contains

  !> Makes steps from step number `step` on. Stops early if the log could overflow or a step fails.
  subroutine advance_steps(s, method, run, y, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: y(s%nx, 4, s%nz)     !! state
    real(dp), intent(inout) :: rod(6)               !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp), allocatable :: states(:, :), stage(:, :), forces(:, :), work(:, :)
    logical :: complete

    complete = .true.
    call reserve(s, 8*s%nz, 1, states, complete)
    call reserve(s, 4*s%nz, 1, stage, complete)
    call reserve(s, 2*MAX_STAGES*s%nz, 1, forces, complete)  ! memory that is not touched takes no time
    call reserve(s, COLUMNS, method%n_threads, work, complete)
    if (.not. complete) run%status = NO_MEMORY
    if (.not. complete) return
    if (.not. method%table%swept) then
      stage = 0.0_dp
      forces = 0.0_dp
    end if
    call steps(s, method, run, y, states(aligned(states(:, 1)), 1), stage(aligned(stage(:, 1)), 1), &
               forces(aligned(forces(:, 1)), 1), size(work, 1), work, rod, contact, budget, log)
    if (run%status == DONE .and. run%step < run%end_step) run%status = LOG_FULL
    if (run%status /= NO_MEMORY .and. .not. run%no_substeps) run%sub = run%control%longest
  end subroutine advance_steps

  !> Makes the steps with rows of bounds LB:n+LANES. Each step reads one of two states and writes the other.
  subroutine steps(s, method, run, narrow_y, y, stage, forces, n_work, work, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: narrow_y(s%nx, 4, s%nz)            !! state
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! work space: the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! work space: forces of all stages [N]
    integer, intent(in) :: n_work                                 !! work space of each thread
    real(dp), intent(inout) :: work(n_work, method%n_threads)     !! see `reserve`
    real(dp), intent(inout) :: rod(6)                             !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp) :: rods(6, 2)
    type(row_t) :: w(method%n_threads)

    call widen(s, narrow_y, y(LB, 1, 1, 1))
    call widen(s, narrow_y, y(LB, 1, 1, 2))
    rods(:, 1) = rod
    rods(:, 2) = rod
    call prepare(s, method, y(LB, 1, 1, 1), contact, budget, log, run, w)
    if (run%status == NO_MEMORY) return
    !$omp parallel default(none) num_threads(method%n_threads) &
    !$omp shared(s, method, run, y, stage, forces, n_work, work, w, rods, contact, budget, log)
    call thread_steps(s, method, run, y, stage, forces, n_work, work, w, rods, contact, budget, log)
    !$omp end parallel
    call narrow(s, y(LB, 1, 1, run%current), narrow_y)
    rod = rods(:, run%current)
  end subroutine steps

  !> Plans the first step of a call.
  subroutine prepare(s, method, y, contact, budget, log, run, w)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)     !! state
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(log_t), intent(in) :: log
    type(run_t), intent(inout) :: run
    type(row_t), intent(out) :: w(method%n_threads)        !! one for each thread
    real(dp) :: stiffest
    integer :: failed, i

    run%t = method%t0 + run%step*method%dt
    run%end_step = run%step + method%n_steps
    allocate (run%err(2, method%n_threads), stat=failed)
    run%bottom_row = new_row(s)
    do i = 1, method%n_threads
      w(i) = new_row(s)
    end do
    if (failed /= 0 .or. .not. (run%bottom_row%complete .and. all(w%complete))) run%status = NO_MEMORY
    if (run%status == NO_MEMORY) return
    run%err = 0.0_dp
    stiffest = max(s%k, maxval(s%k_f), s%k_top)
    run%allowed = method%rtol*s%f_n/s%nx/[stiffest, sqrt(stiffest*s%m)]
    run%no_substeps = .not. method%located .and. all(abs(method%table%e) <= 0.0_dp)
    if (run%no_substeps) then
      run%sub = method%dt
    else
      call new_control(s, run%t, method%dt, method%located, run%sub, y, contact, budget, run%bottom_row, run%control)
      if (.not. run%control%complete) run%status = NO_MEMORY
      if (run%status == NO_MEMORY) return
      run%sub = run%control%length
    end if
    run%bottom_first = method%located .and. method%table%swept .and. s%nz > bottom_front(method%table)
    if (run%bottom_first) run%tested_share = real(bottom_rows(method%table), dp)/(method%table%stages*s%nz)
    run%goes_on = run%step < run%end_step .and. log_has_room(s, method, log)
  end subroutine prepare

  !> Makes the steps of the rows that a thread owns. The first thread also switches the contacts.
  subroutine thread_steps(s, method, run, y, stage, forces, n_work, work, w, rods, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! work space: forces of all stages [N]
    integer, intent(in) :: n_work                                 !! work space of each thread
    real(dp), intent(inout) :: work(n_work, method%n_threads)     !! see `reserve`
    type(row_t), intent(inout) :: w(method%n_threads)             !! one for each thread
    real(dp), intent(inout) :: rods(6, 2)                         !! the rod at both states
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    integer :: thread, n_team, j0, j1, at
    logical :: bottom_first

    thread = 0
    n_team = 1
    !$ thread = omp_get_thread_num()
    !$ n_team = omp_get_num_threads()
    j0 = 1 + (thread*s%nz)/n_team
    j1 = ((thread + 1)*s%nz)/n_team
    work(:, thread + 1) = 0.0_dp
    at = aligned(work(:, thread + 1))
    bottom_first = run%bottom_first .and. s%nz >= 2*n_team   ! the first thread owns both bottom rows
    do
      if (.not. run%goes_on) exit
      if (bottom_first) then
        if (thread == 0) then
          call sweep(1, bottom_front(method%table))
          call test_step(s, method, run, y(LB, 1, 1, run%current), y(LB, 1, 1, 3 - run%current), work(at, 1), contact)
        end if
        !$omp barrier
      end if
      if (.not. bottom_first) call sweep(1, huge(1))
      if (bottom_first .and. run%control%accepted) call sweep(merge(bottom_front(method%table) + 1, 1, thread == 0), huge(1))
      !$omp barrier
      if (thread == 0) then
        if (.not. bottom_first) then
          call test_step(s, method, run, y(LB, 1, 1, run%current), y(LB, 1, 1, 3 - run%current), work(at, 1), contact)
        end if
        if (s%law%flows) contact%memory = w(1)%memory  ! the first thread owns the bottom row
        call complete_step(s, method, run, y(LB, 1, 1, 3 - run%current), rods(:, 3 - run%current), contact, budget, log)
      end if
      !$omp barrier
    end do

  contains

    !> Makes fronts of a sweep, or a step of the table stepper, on the rows of this thread.
    subroutine sweep(first, last)
      integer, intent(in) :: first
      integer, intent(in) :: last

      call advance_rows(s, method, run, j0, j1, first, last, y, stage, forces, rods, contact, budget, &
                        work(at, thread + 1), w(thread + 1), run%err(:, thread + 1))
    end subroutine sweep
  end subroutine thread_steps

  !> Computes rows j0..j1 of one step, or of a trial sub-step.
  subroutine advance_rows(s, method, run, j0, j1, first, last, y, stage, forces, rods, contact, budget, work, w, err)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(in) :: run
    integer, intent(in) :: j0                   !! first row of this thread
    integer, intent(in) :: j1                   !! last row of this thread
    integer, intent(in) :: first                !! fronts to make, see pyfric_sweep
    integer, intent(in) :: last                 !! see `first`
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz, 2)      !! the state and the next one
    real(dp), intent(inout) :: stage(LB:s%n + LANES, 4, s%nz)     !! work space of tables: a stage
    real(dp), intent(inout) :: forces(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! work space: forces of all stages [N]
    real(dp), intent(inout) :: rods(6, 2)                         !! the rod at both states
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(inout) :: budget
    real(dp), intent(inout) :: work(LB:s%n + LANES, COLUMNS)      !! work space of this thread, aligned
    type(row_t), intent(inout) :: w
    real(dp), intent(inout) :: err(2)           !! errors of u [m] and v [m/s] in these rows
    integer :: old, new

    old = run%current
    new = 3 - old
    if (method%table%swept) then
      call swept_step(s, method%table, run%t, run%sub, j0, j1, first, last, method%keep_budget, contact%mode, contact%memory, &
                    y(LB, 1, 1, old), rods(:, old), y(LB, 1, 1, new), rods(:, new), budget, work(LB, RINGS), &
                    work(LB, CARRY), work(LB, BONDS), work(LB, FX), work(LB, FZ), w)
    else
      call table_step(s, method%table, run%t, run%sub, j0, j1, method%keep_budget, contact%mode, contact%memory, &
                        y(LB, 1, 1, old), rods(:, old), y(LB, 1, 1, new), rods(:, new), budget, forces, stage, work, w, err)
    end if
  end subroutine advance_rows

  !> Whether the bottom rows of the sub-step from old to new are accepted.
  subroutine test_step(s, method, run, old, new, work, contact)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(in) :: old(LB:s%n + LANES, 4, s%nz)       !! state at the start
    real(dp), intent(in) :: new(LB:s%n + LANES, 4, s%nz)       !! state at the end
    real(dp), intent(in) :: work(LB:s%n + LANES, COLUMNS)      !! work space of the thread that made its bottom rows
    type(contact_t), intent(in) :: contact

    if (run%no_substeps) return
    run%error = max(maxval(run%err(1, :))/run%allowed(1), maxval(run%err(2, :))/run%allowed(2))
    call test_substep(s, method%table, run%step, method%t0, method%dt, run%error, old, new, work(LB, RINGS), contact, &
                      run%bottom_row, run%control, run%status)
  end subroutine test_step

  !> Finishes a step or sub-step: switches contacts and plans the next step or sub-step.
  subroutine complete_step(s, method, run, new, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(inout) :: run
    real(dp), intent(inout) :: new(LB:s%n + LANES, 4, s%nz)    !! state at the end
    real(dp), intent(in) :: rod(6)                             !! rod at the end
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    real(dp) :: next
    integer :: n_quiet

    call take_shared(budget)
    n_quiet = log%n_quiet
    run%tried = run%tried + merge(1.0_dp, run%tested_share, run%control%accepted)
    next = run%step + 1.0_dp
    if (run%no_substeps) then
      call switch_contacts(s, next, method%t0 + next*method%dt, method%dt, 0.0_dp, new, contact, log, run%bottom_row)
    else
      call complete_substep(s, run%step, method%dt, run%error, new, contact, budget, log, run%bottom_row, run%control, run%status)
      run%sub = run%control%length
    end if
    if (run%status /= DONE) then
      run%block = run%control%block
      run%t = run%t + merge(run%sub, 0.0_dp, run%control%accepted)
      run%goes_on = .false.
      return
    end if
    if (.not. run%control%accepted) return
    run%current = 3 - run%current
    if (run%control%finished) run%step = next
    run%t = method%t0 + run%step*method%dt
    if (.not. run%no_substeps) run%t = run%t + run%control%start
    if (method%keep_budget .and. log%n_quiet > n_quiet) then
      call log_budget(log, n_quiet, curve_point(s, run%t, new, rod, contact%memory, .true., budget, contact%loss))
    end if
    if (.not. run%control%finished) return
    if (log%threshold > 0.0_dp) call watch(s, method, run, new, rod, contact, budget, log)
    if (log%every > 0) then
      if (modulo(run%step, real(log%every, dp)) <= 0.0_dp) then
        call log_point(log, curve_point(s, run%t, new, rod, contact%memory, method%keep_budget, budget, contact%loss))
      end if
    end if
    if (s%finite .and. s%nz > 1) then
      if (may_fold(s, new)) run%status = STRAINED
    end if
    run%goes_on = run%status == DONE .and. run%step < run%end_step .and. log_has_room(s, method, log)
  end subroutine complete_step

  !> Whether a cell may be turned inside out. No cell is turned inside out if displacements of neighbours along x and z differ by
  !> less than l/sqrt(2), because the deformation gradient of each triangle of two bonds then differs from 1 by less than 1.
  pure function may_fold(s, y) result(found)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)  !! state
    logical :: found
    integer(c_int64_t) :: n
    integer :: j

    n = 0
    do j = 1, s%nz
      n = n + large(s, y(LB, UX, j), y(LB, UX, j), LANES)
      if (j < s%nz) n = n + large(s, y(LB, UX, j), y(LB, UX, j + 1), 0)
    end do
    found = n > 0
  end function may_fold

  !> Number of blocks of a row whose displacement differs by l/sqrt(2) or more from that of a neighbour.
  pure function large(s, row, other, shift) result(n)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: row(LB:s%n + LANES, 2)
    real(dp), intent(in) :: other(LB:s%n + LANES, 2)  !! the row of the neighbours
    integer, intent(in) :: shift                      !! elements to the neighbour
    integer(c_int64_t) :: n
    integer :: i

    n = 0
    do i = 1, s%n
      n = n + merge(0_c_int64_t, 1_c_int64_t, (other(i + shift, UX) - row(i, UX))**2 &
                    + (other(i + shift, UZ) - row(i, UZ))**2 < 0.5_dp*s%l**2)
    end do
  end function large

  !> Logs the blocks that passed the threshold of fast slip in a step, and the interface when fast slip begins or ends.
  subroutine watch(s, method, run, y, rod, contact, budget, log)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(run_t), intent(in) :: run
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)         !! state at the end of the step
    real(dp), intent(in) :: rod(6)                             !! rod at the end
    type(contact_t), intent(in) :: contact
    type(budget_t), intent(in) :: budget
    type(log_t), intent(inout) :: log
    real(dp) :: p(s%nx), point(N_POINT)
    logical :: turned

    call foundation(s, y(LB, UZ, 1), p)
    call log_speeds(log, contact%mode, run%step, run%t, method%dt, y(s%at(:s%nx), VX, 1), y(s%at(:s%nx), UX, 1), p, s%p_corner, &
                    turned)
    if (.not. turned) return
    point = curve_point(s, run%t, y, rod, contact%memory, method%keep_budget, budget, contact%loss)
    call log_burst(log, contact%mode, run%step, run%t, point, y(s%at(:s%nx), UX, 1))
  end subroutine watch

  !> Whether the log has room for the entries of one more step.
  pure function log_has_room(s, method, log) result(yes)
    type(model_t), intent(in) :: s
    type(method_t), intent(in) :: method
    type(log_t), intent(in) :: log
    logical :: yes

    if (method%located) then
      yes = has_room(log, max_switches(s%nx), MAX_QUIET)
    else
      yes = has_room(log, s%nx, 1)
    end if
  end function log_has_room
end module pyfric_stepping
