!> All forces at one state, without a step.
module pyfric_evaluation
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  use pyfric_model, only: model_t, driven_u
  use pyfric_boundaries, only: rod_acceleration, driver_force
  use pyfric_rows, only: row_t, new_row, row_forces, row_powers, take_shared, budget_t
  use pyfric_status, only: DONE, NO_MEMORY
  use pyfric_workspace, only: reserve, aligned, widen, FX, FZ, CARRY, BONDS, COLUMNS
  implicit none (type, external)
  private
  public :: all_forces

contains

  !> Computes accelerations, contact forces and powers, n_times over for timing.
  subroutine all_forces(s, t, n_times, y, rod, mode, memory, a, a_rod, f, p, f_t, power, status)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                   !! time [s]
    integer, intent(in) :: n_times              !! number of equal evaluations
    real(dp), intent(in) :: y(s%nx, 4, s%nz)    !! state
    real(dp), intent(in) :: rod(6)              !! X, Z, phi and their rates
    integer(ip), intent(in) :: mode(s%nx)       !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp), intent(out) :: a(s%nx, 2, s%nz)   !! accelerations [m/s2]
    real(dp), intent(out) :: a_rod(3)           !! accelerations of X, Z [m/s2], phi [rad/s2]
    real(dp), intent(out) :: f(s%nx)            !! friction force along +x [N]
    real(dp), intent(out) :: p(s%nx)            !! foundation force [N]
    real(dp), intent(out) :: f_t                !! driver force [N]
    type(budget_t), intent(inout) :: power      !! powers of the state are added [W]
    integer(ip), intent(out) :: status          !! see pyfric_status
    real(dp), allocatable :: state(:, :), rows(:, :)
    type(row_t) :: w
    logical :: complete
    integer :: k

    status = NO_MEMORY
    w = new_row(s)
    complete = w%complete .and. power%complete
    call reserve(s, 4*s%nz, 1, state, complete)
    call reserve(s, COLUMNS, 1, rows, complete)
    if (.not. complete) return
    status = DONE
    rows = 0.0_dp
    a_rod = 0.0_dp
    call widen(s, y, state(aligned(state(:, 1)), 1))
    do k = 1, n_times
      call sweep(k == n_times, state(aligned(state(:, 1)), 1), rows(aligned(rows(:, 1)), 1))
    end do
    call take_shared(power)
    f = w%f
    p = w%p
    f_t = driver_force(s, t, driven_u(s, state(aligned(state(:, 1)), 1)))

  contains

    !> Makes one evaluation, row by row.
    subroutine sweep(keep, q, work)
      logical, intent(in) :: keep                                 !! store the results
      real(dp), intent(in) :: q(LB:s%n + LANES, 4, s%nz)          !! state
      real(dp), intent(inout) :: work(LB:s%n + LANES, COLUMNS)    !! work space
      integer :: j, below, above

      work(:, CARRY:CARRY + 1) = 0.0_dp
      do j = 1, s%nz
        below = max(j - 1, 1)
        above = min(j + 1, s%nz)
        call row_forces(s, j, t, q(LB, 1, below), q(LB, 1, j), q(LB, 1, above), mode, memory, work(LB, CARRY), work(LB, BONDS), &
                        work(LB, FX), work(LB, FZ), w)
        if (.not. keep) cycle
        call row_powers(s, j, t, 1.0_dp, mode, memory, q(LB, 1, j), q(LB, 1, above), rod(5), w, power)
        a(:, 1, j) = work(s%at(:s%nx), FX)/s%m
        a(:, 2, j) = work(s%at(:s%nx), FZ)/s%m
        if (j == s%nz .and. s%rigid) then
          a_rod = rod_acceleration(s, t, rod(3), work(LB, FX), work(LB, FZ))
          a(:, 1, j) = a_rod(1)
          a(:, 2, j) = a_rod(2) + a_rod(3)*s%x
        end if
      end do
    end subroutine sweep
  end subroutine all_forces
end module pyfric_evaluation
