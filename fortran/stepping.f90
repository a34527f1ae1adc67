!> Many steps, on one or more threads.
module pyfric_stepping
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t
  use pyfric_rows, only: budget_t, row_t, new_row
  use pyfric_rk4, only: rk4_t, new_rk4, rk4_step
  use pyfric_contact, only: contact_t, log_t, switch_contacts
  use pyfric_status, only: DONE, LOG_FULL
!$ use omp_lib, only: omp_get_thread_num, omp_get_num_threads
  implicit none (type, external)
  private
  public :: advance_rk4

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
    real(dp), allocatable :: z(:, :, :)
    real(dp) :: rod_z(6), step_begin
    type(rk4_t) :: w
    type(row_t) :: bottom
    integer :: k, made, me, team, j0, j1
    logical :: go

    allocate (z(s%nx, 4, s%nz))
    rod_z = rod
    bottom = new_row(s%nx)
    made = 0
    step_begin = step
    go = room()
    !$omp parallel default(none) num_threads(n_threads) private(w, k, me, team, j0, j1) &
    !$omp shared(s, t0, dt, n_steps, keep_budget, step, step_begin, y, z, rod, rod_z, contact, budget, log) &
    !$omp shared(bottom, made, go)
    me = 0
    team = 1
    !$ me = omp_get_thread_num()
    !$ team = omp_get_num_threads()
    j0 = 1 + (me*s%nz)/team
    j1 = ((me + 1)*s%nz)/team
    w = new_rk4(s%nx)
    do k = 1, n_steps
      if (.not. go) exit
      if (mod(k, 2) == 1) then
        call rk4_step(s, t0 + (step_begin + (k - 1))*dt, dt, j0, j1, keep_budget, contact%mode, y, rod, z, rod_z, budget, w)
      else
        call rk4_step(s, t0 + (step_begin + (k - 1))*dt, dt, j0, j1, keep_budget, contact%mode, z, rod_z, y, rod, budget, w)
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
        go = room()
      end if
      !$omp barrier
    end do
    !$omp end parallel
    if (mod(made, 2) == 1) then
      y = z
      rod = rod_z
    end if
    status = merge(DONE, LOG_FULL, made == n_steps)

  contains

    !> True while one more step cannot overflow the log.
    pure function room() result(yes)
      logical :: yes

      yes = log%n_switch + s%nx <= size(log%switch_r, 2) .and. log%n_quiet < size(log%quiet_r, 2)
    end function room
  end subroutine advance_rk4
end module pyfric_stepping
