!> Many steps, with contact states switched between them, on one or more threads.
module pyfric_stepping
  use, intrinsic :: iso_c_binding, only: c_loc, c_intptr_t
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, close_state, LB, LANES
  use pyfric_lattice, only: N_BOND
  use pyfric_rows, only: budget_t, row_t, new_row
  use pyfric_rk4, only: rk4_step, RING
  use pyfric_contact, only: contact_t, log_t, switch_contacts
  use pyfric_status, only: DONE, LOG_FULL
!$ use omp_lib, only: omp_get_thread_num, omp_get_num_threads
  implicit none (type, external)
  private
  public :: advance_rk4, widen, aligned

contains

  !> RK4 with switching at step ends, from step number `step` on; stops early when the log could overflow.
  subroutine advance_rk4(s, t0, dt, n_steps, n_threads, keep_budget, step, y, rod, contact, budget, log, status)
    type(model_t), intent(in) :: s
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
    real(dp), allocatable :: a(:)
    integer :: made, n, at

    n = (s%n + 2*LANES)*4*s%nz
    allocate (a(2*n + LANES))
    at = aligned(a)
    call widen(s, y, a(at))
    call widen(s, y, a(at + n))
    call steps(s, t0, dt, n_steps, n_threads, keep_budget, step, a(at), a(at + n), rod, contact, budget, log, made)
    call narrow(s, a(at), y)
    status = merge(DONE, LOG_FULL, made == n_steps)
  end subroutine advance_rk4

  !> The same on rows with bounds LB:n+LANES: the state goes back and forth between y and z, and ends in y.
  subroutine steps(s, t0, dt, n_steps, n_threads, keep_budget, step, y, z, rod, contact, budget, log, made)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t0                             !! time of step 0 [s]
    real(dp), intent(in) :: dt                             !! step [s]
    integer, intent(in) :: n_steps                         !! steps to make
    integer, intent(in) :: n_threads                       !! threads to ask for
    logical, intent(in) :: keep_budget                     !! integrate works and dissipations too
    real(dp), intent(inout) :: step                        !! steps made since step 0
    real(dp), intent(inout) :: y(LB:s%n + LANES, 4, s%nz)      !! state
    real(dp), intent(inout) :: z(LB:s%n + LANES, 4, s%nz)      !! work space
    real(dp), intent(inout) :: rod(6)                      !! rod
    type(contact_t), intent(inout) :: contact
    type(budget_t), intent(inout) :: budget
    type(log_t), intent(inout) :: log
    integer, intent(out) :: made                           !! steps made now
    real(dp) :: rod_z(6), step_begin
    type(row_t) :: bottom
    logical :: go

    rod_z = rod
    bottom = new_row(s)
    made = 0
    step_begin = step
    go = room(s, log)
    !$omp parallel default(none) num_threads(n_threads) &
    !$omp shared(s, t0, dt, n_steps, keep_budget, step, step_begin, y, z, rod, rod_z, contact, budget, log, bottom, made, go)
    call one_thread()
    !$omp end parallel
    if (mod(made, 2) == 1) then
      y = z
      rod = rod_z
    end if

  contains

    !> The steps of the rows that one thread owns; the first thread also switches the contacts.
    subroutine one_thread()
      real(dp), allocatable :: work(:)
      type(row_t) :: row
      integer :: n, at, k, me, team, j0, j1

      me = 0
      team = 1
      !$ me = omp_get_thread_num()
      !$ team = omp_get_num_threads()
      j0 = 1 + (me*s%nz)/team
      j1 = ((me + 1)*s%nz)/team
      row = new_row(s)
      n = s%n + 2*LANES
      allocate (work(n*(12*RING + 8 + N_BOND + 2) + LANES))
      work = 0.0_dp
      at = aligned(work)
      do k = 1, n_steps
        if (.not. go) exit
        if (mod(k, 2) == 1) then
          call rk4_step(s, t0 + (step_begin + (k - 1))*dt, dt, j0, j1, keep_budget, contact%mode, contact%s_0, y, rod, &
                        z, rod_z, budget, work(at), work(at + 12*n*RING), work(at + n*(12*RING + 8)), &
                        work(at + n*(12*RING + 8 + N_BOND)), work(at + n*(12*RING + 9 + N_BOND)), row)
        else
          call rk4_step(s, t0 + (step_begin + (k - 1))*dt, dt, j0, j1, keep_budget, contact%mode, contact%s_0, z, rod_z, &
                        y, rod, budget, work(at), work(at + 12*n*RING), work(at + n*(12*RING + 8)), &
                        work(at + n*(12*RING + 8 + N_BOND)), work(at + n*(12*RING + 9 + N_BOND)), row)
        end if
        !$omp barrier
        if (me == 0) then
          step = step_begin + k
          if (mod(k, 2) == 1) then
            call switch_contacts(s, step, t0 + step*dt, dt, z, contact, log, bottom)
          else
            call switch_contacts(s, step, t0 + step*dt, dt, y, contact, log, bottom)
          end if
          made = k
          go = room(s, log)
        end if
        !$omp barrier
      end do
    end subroutine one_thread
  end subroutine steps

  !> True while one more step cannot overflow the log.
  pure function room(s, log) result(yes)
    type(model_t), intent(in) :: s
    type(log_t), intent(in) :: log
    logical :: yes

    yes = log%n_switch + s%nx <= size(log%switch_r, 2) .and. log%n_quiet < size(log%quiet_r, 2)
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
