!> One step of classical RK4 in a single sweep over the rows.
!>
!> Stage s of a row needs stage s - 1 of that row and its neighbours only, so the four stages follow each other up
!> the lattice, one row apart: what a stage needs is still in the cache whatever the size of the lattice. A thread
!> owns rows j0..j1 and repeats, in the rows next to them, the few earlier stages it needs. Nothing is shared while
!> a step runs, and every row sees the same operations for any number of threads.
module pyfric_rk4
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, UX, UZ, VX, VZ
  use pyfric_boundaries, only: rod_acceleration, rod_to_row
  use pyfric_rows, only: row_t, new_row, row_forces, row_powers, budget_t
  implicit none
  private
  public :: rk4_t, new_rk4, rk4_step

  real(dp), parameter :: NODE(4) = [0.0_dp, 0.5_dp, 0.5_dp, 1.0_dp]    !! c_s
  real(dp), parameter :: WEIGHT(4) = [1.0_dp, 2.0_dp, 2.0_dp, 1.0_dp]  !! 6 b_s

  !> Work space of one thread.
  type :: rk4_t
    real(dp), allocatable :: q(:, :, :, :)   !! two rows of stages 2..4 (N_x, 4, 0:1, 2:4)
    real(dp), allocatable :: sum(:, :, :)    !! weighted sums of four rows in flight (N_x, 4, 0:3)
    real(dp), allocatable :: carry(:, :, :)  !! (N_x, 2, 4)
    type(row_t) :: row
  end type rk4_t

contains

  pure function new_rk4(nx) result(w)
    integer, intent(in) :: nx  !! blocks along the interface
    type(rk4_t) :: w

    allocate (w%q(nx, 4, 0:1, 2:4), w%sum(nx, 4, 0:3), w%carry(nx, 2, 4))
    w%q = 0.0_dp
    w%row = new_row(nx)
  end function new_rk4

  !> Rows j0..j1 of the state one step later. Contact states are frozen during the step.
  subroutine rk4_step(s, t, dt, j0, j1, keep_budget, mode, y, rod, y_new, rod_new, budget, w)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                         !! time at the start [s]
    real(dp), intent(in) :: dt                        !! step [s]
    integer, intent(in) :: j0                         !! first row of this thread
    integer, intent(in) :: j1                         !! last row of this thread
    logical, intent(in) :: keep_budget                !! integrate works and dissipations too
    integer(ip), intent(in) :: mode(s%nx)             !! contact states
    real(dp), intent(in) :: y(s%nx, 4, s%nz)          !! state at the start
    real(dp), intent(in) :: rod(6)                    !! X, Z, phi and their rates at the start
    real(dp), intent(inout) :: y_new(s%nx, 4, s%nz)   !! rows j0..j1 are written
    real(dp), intent(inout) :: rod_new(6)             !! written by the thread that owns the top row
    type(budget_t), intent(inout) :: budget           !! entries of rows j0..j1 are advanced
    type(rk4_t), intent(inout) :: w
    real(dp) :: rod_stage(6, 4), rod_sum(6)
    integer :: lo, hi, j, stage, front

    rod_stage(:, 1) = rod
    do front = max(1, j0 - 4), j1 + 3
      do stage = 1, 4
        lo = max(1, j0 - (4 - stage))
        hi = min(s%nz, j1 + (4 - stage))
        j = front - stage + 1
        if (j < max(1, lo - 1) .or. j > hi) cycle
        if (j == max(1, lo - 1)) w%carry(:, :, stage) = 0.0_dp
        if (stage == 1) then
          call one_row(y(:, :, j), y(:, :, min(j + 1, s%nz)))
        else
          call one_row(w%q(:, :, mod(j, 2), stage), w%q(:, :, mod(j + 1, 2), stage))
        end if
      end do
    end do

  contains

    !> Stage `stage` of row j: forces, powers, and the row of the next stage (or of the new state).
    subroutine one_row(q, up)
      real(dp), intent(in) :: q(s%nx, 4)   !! the row at this stage
      real(dp), intent(in) :: up(s%nx, 4)  !! the row above at this stage
      real(dp) :: c

      call row_forces(s, j, t + NODE(stage)*dt, q, up, mode, w%carry(:, :, stage), w%row)
      if (j < lo) return
      if (keep_budget .and. j >= j0 .and. j <= j1) then
        c = dt/6.0_dp*WEIGHT(stage)
        call row_powers(s, j, c, q, up, rod_stage(5, stage), w%row, budget)
      end if
      if (j == s%nz .and. s%rigid) then
        call rod_row()
      else
        c = 1.0_dp/s%m
        select case (stage)
        case (1)
          call begin(s%nx, 0.5_dp*dt, c, q, w%row%fx, w%row%fz, w%sum(1, 1, mod(j, 4)), w%q(1, 1, mod(j, 2), 2))
        case (2, 3)
          call go_on(s%nx, NODE(stage + 1)*dt, c, y(1, 1, j), q, w%row%fx, w%row%fz, &
                     w%sum(1, 1, mod(j, 4)), w%q(1, 1, mod(j, 2), stage + 1))
        case (4)
          call finish(s%nx, dt/6.0_dp, c, y(1, 1, j), q, w%row%fx, w%row%fz, w%sum(1, 1, mod(j, 4)), y_new(1, 1, j))
        end select
      end if
    end subroutine one_row

    !> The same for the rod, which carries the top row.
    subroutine rod_row()
      real(dp) :: rate(6)

      rate(1:3) = rod_stage(4:6, stage)
      rate(4:6) = rod_acceleration(s, rod_stage(3, stage), w%row%fx, w%row%fz)
      if (stage == 1) rod_sum = 0.0_dp
      rod_sum = rod_sum + WEIGHT(stage)*rate
      if (stage < 4) then
        rod_stage(:, stage + 1) = rod + NODE(stage + 1)*dt*rate
        call rod_to_row(s, rod_stage(:, stage + 1), w%q(:, :, mod(j, 2), stage + 1))
      else
        rod_new = rod + dt/6.0_dp*rod_sum
        call rod_to_row(s, rod_new, y_new(:, :, j))
      end if
    end subroutine rod_row
  end subroutine rk4_step

  !> After stage 1: the weighted sum begins with k_1, and y_2 = y + c k_1.
  pure subroutine begin(n, c, inv_m, y, fx, fz, total, q)
    integer, intent(in) :: n
    real(dp), intent(in) :: c           !! time to the next stage [s]
    real(dp), intent(in) :: inv_m       !! 1/m [1/kg]
    real(dp), intent(in) :: y(n, 4)     !! state
    real(dp), intent(in) :: fx(n)       !! force [N]
    real(dp), intent(in) :: fz(n)       !! force [N]
    real(dp), intent(out) :: total(n, 4)
    real(dp), intent(out) :: q(n, 4)    !! next stage
    integer :: i

    do i = 1, n
      total(i, UX) = y(i, VX)
      total(i, UZ) = y(i, VZ)
      total(i, VX) = fx(i)*inv_m
      total(i, VZ) = fz(i)*inv_m
      q(i, UX) = y(i, UX) + c*y(i, VX)
      q(i, UZ) = y(i, UZ) + c*y(i, VZ)
      q(i, VX) = y(i, VX) + c*(fx(i)*inv_m)
      q(i, VZ) = y(i, VZ) + c*(fz(i)*inv_m)
    end do
  end subroutine begin

  !> After stages 2 and 3: sum + 2 k_s, and y_(s+1) = y + c k_s.
  pure subroutine go_on(n, c, inv_m, y, qs, fx, fz, total, q)
    integer, intent(in) :: n
    real(dp), intent(in) :: c           !! time to the next stage [s]
    real(dp), intent(in) :: inv_m       !! 1/m [1/kg]
    real(dp), intent(in) :: y(n, 4)     !! state at the start of the step
    real(dp), intent(in) :: qs(n, 4)    !! this stage
    real(dp), intent(in) :: fx(n)       !! force [N]
    real(dp), intent(in) :: fz(n)       !! force [N]
    real(dp), intent(inout) :: total(n, 4)
    real(dp), intent(out) :: q(n, 4)    !! next stage
    integer :: i

    do i = 1, n
      total(i, UX) = total(i, UX) + 2.0_dp*qs(i, VX)
      total(i, UZ) = total(i, UZ) + 2.0_dp*qs(i, VZ)
      total(i, VX) = total(i, VX) + 2.0_dp*(fx(i)*inv_m)
      total(i, VZ) = total(i, VZ) + 2.0_dp*(fz(i)*inv_m)
      q(i, UX) = y(i, UX) + c*qs(i, VX)
      q(i, UZ) = y(i, UZ) + c*qs(i, VZ)
      q(i, VX) = y(i, VX) + c*(fx(i)*inv_m)
      q(i, VZ) = y(i, VZ) + c*(fz(i)*inv_m)
    end do
  end subroutine go_on

  !> After stage 4: y_new = y + dt/6 (k_1 + 2 k_2 + 2 k_3 + k_4).
  pure subroutine finish(n, c, inv_m, y, qs, fx, fz, total, y_new)
    integer, intent(in) :: n
    real(dp), intent(in) :: c           !! dt/6 [s]
    real(dp), intent(in) :: inv_m       !! 1/m [1/kg]
    real(dp), intent(in) :: y(n, 4)     !! state at the start of the step
    real(dp), intent(in) :: qs(n, 4)    !! stage 4
    real(dp), intent(in) :: fx(n)       !! force [N]
    real(dp), intent(in) :: fz(n)       !! force [N]
    real(dp), intent(in) :: total(n, 4)
    real(dp), intent(out) :: y_new(n, 4)
    integer :: i

    do i = 1, n
      y_new(i, UX) = y(i, UX) + c*(total(i, UX) + qs(i, VX))
      y_new(i, UZ) = y(i, UZ) + c*(total(i, UZ) + qs(i, VZ))
      y_new(i, VX) = y(i, VX) + c*(total(i, VX) + fx(i)*inv_m)
      y_new(i, VZ) = y(i, VZ) + c*(total(i, VZ) + fz(i)*inv_m)
    end do
  end subroutine finish
end module pyfric_rk4
