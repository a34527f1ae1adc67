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
  implicit none (type, external)
  private
  public :: rk4_t, new_rk4, rk4_step

  real(dp), parameter :: NODE(4) = [0.0_dp, 0.5_dp, 0.5_dp, 1.0_dp]    !! c_s
  real(dp), parameter :: WEIGHT(4) = [1.0_dp, 2.0_dp, 2.0_dp, 1.0_dp]  !! 6 b_s
  integer, parameter :: RING = 4  !! rows of a stage that are kept: row j is last needed by stage 4 of row j

  !> Work space of one thread.
  type :: rk4_t
    real(dp), allocatable :: q(:, :, :, :)   !! rows of stages 2..4 (N_x, 4, 0:RING-1, 2:4)
    real(dp), allocatable :: carry(:, :, :)  !! (N_x, 2, 4)
    type(row_t) :: row
  end type rk4_t

contains

  pure function new_rk4(nx) result(w)
    integer, intent(in) :: nx  !! blocks along the interface
    type(rk4_t) :: w

    allocate (w%q(nx, 4, 0:RING - 1, 2:4), w%carry(nx, 2, 4))
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
          call one_row(y(:, :, max(j - 1, 1)), y(:, :, j), y(:, :, min(j + 1, s%nz)))
        else
          call one_row(w%q(:, :, mod(j + RING - 1, RING), stage), w%q(:, :, mod(j, RING), stage), &
                       w%q(:, :, mod(j + 1, RING), stage))
        end if
      end do
    end do

  contains

    !> Stage `stage` of row j: forces, powers, and the row of the next stage (or of the new state).
    subroutine one_row(dn, q, up)
      real(dp), intent(in) :: dn(s%nx, 4)  !! the row below at this stage
      real(dp), intent(in) :: q(s%nx, 4)   !! the row at this stage
      real(dp), intent(in) :: up(s%nx, 4)  !! the row above at this stage
      real(dp) :: c

      call row_forces(s, j, t + NODE(stage)*dt, dn, q, up, mode, w%carry(:, :, stage), w%row)
      if (j < lo) return
      if (keep_budget .and. j >= j0 .and. j <= j1) then
        c = dt/6.0_dp*WEIGHT(stage)
        call row_powers(s, j, c, q, up, rod_stage(5, stage), w%row, budget)
      end if
      if (j == s%nz .and. s%rigid) then
        call rod_row()
      else
        if (stage < 4) then
          call to_stage(s%nx, NODE(stage + 1)*dt, s%m, y(1, 1, j), q(1, VX), w%row%fx, w%row%fz, &
                        w%q(1, 1, mod(j, RING), stage + 1))
        else
          call to_end(s%nx, dt, s%m, y(1, 1, j), w%q(1, VX, mod(j, RING), 2), w%q(1, VX, mod(j, RING), 3), q(1, VX), &
                      w%row%fx, w%row%fz, y_new(1, 1, j))
        end if
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
        call rod_to_row(s, rod_stage(:, stage + 1), w%q(:, :, mod(j, RING), stage + 1))
      else
        rod_new = rod + dt/6.0_dp*rod_sum
        call rod_to_row(s, rod_new, y_new(:, :, j))
      end if
    end subroutine rod_row
  end subroutine rk4_step

  !> The next stage: u + c v_s, v + c F_s/m.
  pure subroutine to_stage(n, c, m, y, v, fx, fz, q)
    integer, intent(in) :: n
    real(dp), intent(in) :: c        !! time to the next stage [s]
    real(dp), intent(in) :: m        !! block mass [kg]
    real(dp), intent(in) :: y(n, 4)  !! state at the start of the step
    real(dp), intent(in) :: v(n, 2)  !! velocities of this stage [m/s]
    real(dp), intent(in) :: fx(n)    !! force [N]
    real(dp), intent(in) :: fz(n)    !! force [N]
    real(dp), intent(out) :: q(n, 4) !! next stage
    real(dp) :: c_m
    integer :: i

    c_m = c/m
    !GCC$ ivdep
    do i = 1, n
      q(i, UX) = y(i, UX) + c*v(i, 1)
      q(i, UZ) = y(i, UZ) + c*v(i, 2)
      q(i, VX) = y(i, VX) + c_m*fx(i)
      q(i, VZ) = y(i, VZ) + c_m*fz(i)
    end do
  end subroutine to_stage

  !> The end of the step: u + dt/6 (v_1 + 2 v_2 + 2 v_3 + v_4), v + dt/6 (F_1 + 2 F_2 + 2 F_3 + F_4)/m. The first three
  !> forces are taken from the velocities they led to: dt F_1/m = 2 (v_2 - v), dt F_2/m = 2 (v_3 - v), dt F_3/m = v_4 - v.
  pure subroutine to_end(n, dt, m, y, v2, v3, v4, fx, fz, y_new)
    integer, intent(in) :: n
    real(dp), intent(in) :: dt            !! step [s]
    real(dp), intent(in) :: m             !! block mass [kg]
    real(dp), intent(in) :: y(n, 4)       !! state at the start of the step
    real(dp), intent(in) :: v2(n, 2)      !! velocities of stage 2 [m/s]
    real(dp), intent(in) :: v3(n, 2)      !! velocities of stage 3 [m/s]
    real(dp), intent(in) :: v4(n, 2)      !! velocities of stage 4 [m/s]
    real(dp), intent(in) :: fx(n)         !! force of stage 4 [N]
    real(dp), intent(in) :: fz(n)         !! force of stage 4 [N]
    real(dp), intent(out) :: y_new(n, 4)  !! state at the end of the step
    real(dp) :: c, c_m, third
    integer :: i

    c = dt/6.0_dp
    c_m = c/m
    third = 1.0_dp/3.0_dp
    !GCC$ ivdep
    do i = 1, n
      y_new(i, UX) = y(i, UX) + c*((y(i, VX) + v4(i, 1)) + 2.0_dp*(v2(i, 1) + v3(i, 1)))
      y_new(i, UZ) = y(i, UZ) + c*((y(i, VZ) + v4(i, 2)) + 2.0_dp*(v2(i, 2) + v3(i, 2)))
      y_new(i, VX) = y(i, VX) + (third*(((v2(i, 1) - y(i, VX)) + 2.0_dp*(v3(i, 1) - y(i, VX))) + (v4(i, 1) - y(i, VX))) &
                                 + c_m*fx(i))
      y_new(i, VZ) = y(i, VZ) + (third*(((v2(i, 2) - y(i, VZ)) + 2.0_dp*(v3(i, 2) - y(i, VZ))) + (v4(i, 2) - y(i, VZ))) &
                                 + c_m*fz(i))
    end do
  end subroutine to_end
end module pyfric_rk4
