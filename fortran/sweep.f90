!> One step of a Runge-Kutta method in a single sweep over the rows.
!>
!> In a Runge-Kutta method here, each stage depends only on the stage before: u + c_s h v_(s-1), v + c_s h F_(s-1)/m.
!> Stage s of a row needs only stage s - 1 of this row and of its neighbours. Therefore the stages follow each other up
!> the lattice, one row apart. In one front, one row of each stage is computed. Data then stay in the cache for any size of
!> the lattice. A thread owns rows j0..j1. In neighbouring rows the thread repeats the few earlier stages that rows j0..j1 need.
!> Threads share no data during a step. Operations on a row do not depend on the number of threads.
module pyfric_sweep
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, close_state
  use pyfric_boundaries, only: rod_acceleration, rod_to_row
  use pyfric_bonds, only: N_BOND
  use pyfric_rows, only: row_t, row_forces, row_powers, budget_t
  use pyfric_workspace, only: MAX_STAGES
  use pyfric_table_stepper, only: table_t
  implicit none (type, external)
  private
  public :: swept_step, share_of_step, bottom_front, bottom_rows

contains

  !> Number of the front after which the two bottom rows are complete, if there are more rows than fronts.
  pure integer function bottom_front(table) result(front)
    type(table_t), intent(in) :: table

    front = table%stages + 1
  end function bottom_front

  !> Total number of rows of all stages that are computed up to `bottom_front`.
  pure integer function bottom_rows(table) result(rows)
    type(table_t), intent(in) :: table

    rows = table%stages*(table%stages + 3)/2
  end function bottom_rows

  !> Computes rows j0..j1 of the state one step later, at fixed contact states. A sweep may be split into two calls with
  !> the same work space: one up to front `bottom_front`, and one from the next front on.
  subroutine swept_step(s, table, t, sub, j0, j1, first, last, keep_budget, mode, memory, y, rod, y_new, rod_new, budget, q, &
                      carry, b, fx, fz, w)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: t                         !! time at the start [s]
    real(dp), intent(in) :: sub                       !! length of the step or sub-step [s]
    integer, intent(in) :: j0                         !! first row of this thread
    integer, intent(in) :: j1                         !! last row of this thread
    integer, intent(in) :: first                      !! first front to make
    integer, intent(in) :: last                       !! last front to make
    logical, intent(in) :: keep_budget                !! whether to integrate work and dissipation
    integer(ip), intent(in) :: mode(s%nx)             !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx)      !! see pyfric_law
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)          !! state at the start
    real(dp), intent(in) :: rod(6)                    !! X, Z, phi and their rates at the start
    real(dp), intent(inout) :: y_new(LB:s%n + LANES, 4, s%nz)   !! rows j0..j1 are written
    real(dp), intent(inout) :: rod_new(6)             !! written by the thread that owns the top row
    type(budget_t), intent(inout) :: budget           !! works and heat, to which rows j0..j1 are added
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4, 0:table%stages, 2:table%stages)  !! work space: rows of stages
    real(dp), intent(inout) :: carry(LB:s%n + LANES, 2, table%stages)  !! work space of finite geometry
    real(dp), intent(inout) :: b(LB:s%n + LANES, 2, N_BOND)       !! work space of finite geometry
    real(dp), intent(inout) :: fx(LB:s%n + LANES)                 !! work space
    real(dp), intent(inout) :: fz(LB:s%n + LANES)                 !! work space
    type(row_t), intent(inout) :: w
    real(dp) :: rods(6, MAX_STAGES + 1), rod_sum(6)
    integer :: low, high, j, slot, stage, stages, front

    stages = table%stages
    rods(:, 1) = rod
    do front = max(1, j0 - stages, first), min(j1 + stages - 1, last)
      do stage = 1, stages
        low = max(1, j0 - (stages - stage))
        high = min(s%nz, j1 + (stages - stage))
        j = front - stage + 1
        if (j < max(1, low - 1) .or. j > high) cycle
        if (j == max(1, low - 1)) carry(:, :, stage) = 0.0_dp
        slot = mod(j, stages + 1)
        if (stage == 1) then
          call stage_of_row(y(LB, 1, max(j - 1, 1)), y(LB, 1, j), y(LB, 1, min(j + 1, s%nz)))
        else
          call stage_of_row(q(LB, 1, merge(stages, slot - 1, slot == 0), stage), q(LB, 1, slot, stage), &
                            q(LB, 1, merge(0, slot + 1, slot == stages), stage))
        end if
      end do
    end do

  contains

    !> Computes stage `stage` of row j: forces, powers, and the row of the next stage or of the new state.
    subroutine stage_of_row(dn, row, up)
      real(dp), intent(in) :: dn(LB:s%n + LANES, 4)    !! the row below at this stage
      real(dp), intent(in) :: row(LB:s%n + LANES, 4)   !! the row at this stage
      real(dp), intent(in) :: up(LB:s%n + LANES, 4)    !! the row above at this stage

      call row_forces(s, j, t + table%c(stage)*sub, dn, row, up, mode, memory, carry(LB, 1, stage), b, fx, fz, w)
      if (j < low) return
      if (keep_budget .and. j >= j0 .and. j <= j1) then
        call row_powers(s, j, t + table%c(stage)*sub, sub/6.0_dp*(6.0_dp*table%b(stage)), mode, memory, row, up, &
                        rods(5, stage), w, budget)
      end if
      if (j < s%nz .or. .not. s%rigid) then
        call next_row(s, table, stage, sub, slot, y(LB, 1, j), row, fx, fz, q, y_new(LB, 1, j))
        return
      end if
      call next_rod(s, table, t + table%c(stage)*sub, stage, sub, fx, fz, rods, rod_sum)
      if (stage < stages) then
        call rod_to_row(s, rods(:, stage + 1), q(LB, 1, slot, stage + 1))
      else
        rod_new = rods(:, stages + 1)
        call rod_to_row(s, rod_new, y_new(LB, 1, j))
      end if
    end subroutine stage_of_row
  end subroutine swept_step

  !> Computes a row of blocks at the next stage, or at the end of the step.
  pure subroutine next_row(s, table, stage, sub, slot, y, row, fx, fz, q, y_new)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    integer, intent(in) :: stage
    real(dp), intent(in) :: sub                          !! length of the step or sub-step [s]
    integer, intent(in) :: slot                          !! index of the row in q
    real(dp), intent(in) :: y(LB:s%n + LANES, 4)         !! the row at the start
    real(dp), intent(in) :: row(LB:s%n + LANES, 4)       !! the row at this stage
    real(dp), intent(in) :: fx(LB:s%n + LANES)           !! forces on the row [N]
    real(dp), intent(in) :: fz(LB:s%n + LANES)           !! forces on the row [N]
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4, 0:table%stages, 2:table%stages)  !! rows of the stages
    real(dp), intent(inout) :: y_new(LB:s%n + LANES, 4)  !! the row at the end

    if (stage < table%stages) then
      call to_stage(s%n, table%c(stage + 1)*sub, s%m, y, row(LB, VX), fx, fz, q(LB, 1, slot, stage + 1))
      call close_state(s, q(LB, 1, slot, stage + 1))
      return
    end if
    if (table%stages == 4) then
      call to_end(s%n, sub, s%m, y, q(LB, VX, slot, 2), q(LB, VX, slot, 3), row(LB, VX), fx, fz, y_new)
    else
      call to_end_of_six(s%n, table, sub, s%m, y, q(LB, VX, slot, 2), q(LB, VX, slot, 3), q(LB, VX, slot, 4), &
                         q(LB, VX, slot, 5), row(LB, VX), fx, fz, y_new)
    end if
    call close_state(s, y_new)
  end subroutine next_row

  !> Computes the rod, which carries the top row, at the next stage, or at the end of the step.
  pure subroutine next_rod(s, table, t, stage, sub, fx, fz, rods, rod_sum)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: t                 !! time of the stage [s]
    integer, intent(in) :: stage
    real(dp), intent(in) :: sub               !! length of the step or sub-step [s]
    real(dp), intent(in) :: fx(LB:s%n + LANES)   !! forces on the top row [N]
    real(dp), intent(in) :: fz(LB:s%n + LANES)   !! forces on the top row [N]
    real(dp), intent(inout) :: rods(6, MAX_STAGES + 1)  !! the rod at the stages and at the end
    real(dp), intent(inout) :: rod_sum(6)     !! weighted sum of the rates of the stages
    real(dp) :: rate(6)

    rate(1:3) = rods(4:6, stage)
    rate(4:6) = rod_acceleration(s, t, rods(3, stage), fx, fz)
    if (stage == 1) rod_sum = 0.0_dp
    rod_sum = rod_sum + (6.0_dp*table%b(stage))*rate
    if (stage < table%stages) then
      rods(:, stage + 1) = rods(:, 1) + table%c(stage + 1)*sub*rate
    else
      rods(:, stage + 1) = rods(:, 1) + sub/6.0_dp*rod_sum
    end if
  end subroutine next_rod

  !> The next stage: u + c v_s, v + c F_s/m.
  pure subroutine to_stage(n, c, m, y, v_s, fx, fz, q)
    integer, intent(in) :: n
    real(dp), intent(in) :: c                     !! time to the next stage [s]
    real(dp), intent(in) :: m                     !! block mass [kg]
    real(dp), intent(in) :: y(LB:n + LANES, 4)    !! state at the start of the step
    real(dp), intent(in) :: v_s(LB:n + LANES, 2)  !! velocities of this stage [m/s]
    real(dp), intent(in) :: fx(LB:n + LANES)      !! force of this stage [N]
    real(dp), intent(in) :: fz(LB:n + LANES)      !! force of this stage [N]
    real(dp), intent(inout) :: q(LB:n + LANES, 4) !! the next stage
    real(dp) :: c_m
    integer :: i

    c_m = c/m
    !GCC$ ivdep
    do i = 1, n
      q(i, UX) = y(i, UX) + c*v_s(i, 1)
      q(i, UZ) = y(i, UZ) + c*v_s(i, 2)
      q(i, VX) = y(i, VX) + c_m*fx(i)
      q(i, VZ) = y(i, VZ) + c_m*fz(i)
    end do
  end subroutine to_stage

  !> The end of a step of RK4: u + dt/6 (v_1 + 2 v_2 + 2 v_3 + v_4), v + dt/6 (F_1 + 2 F_2 + 2 F_3 + F_4)/m. The first three
  !> forces follow from the velocities of the stages: dt F_1/m = 2 (v_2 - v), dt F_2/m = 2 (v_3 - v), dt F_3/m = v_4 - v.
  pure subroutine to_end(n, dt, m, y, v2, v3, v4, fx, fz, y_new)
    integer, intent(in) :: n
    real(dp), intent(in) :: dt                          !! step [s]
    real(dp), intent(in) :: m                           !! block mass [kg]
    real(dp), intent(in) :: y(LB:n + LANES, 4)          !! state at the start of the step
    real(dp), intent(in) :: v2(LB:n + LANES, 2)         !! velocities of stage 2 [m/s]
    real(dp), intent(in) :: v3(LB:n + LANES, 2)         !! velocities of stage 3 [m/s]
    real(dp), intent(in) :: v4(LB:n + LANES, 2)         !! velocities of stage 4 [m/s]
    real(dp), intent(in) :: fx(LB:n + LANES)            !! force of stage 4 [N]
    real(dp), intent(in) :: fz(LB:n + LANES)            !! force of stage 4 [N]
    real(dp), intent(inout) :: y_new(LB:n + LANES, 4)   !! state at the end of the step
    real(dp) :: c, c_m, third
    integer :: i

    c = dt/6.0_dp
    c_m = c/m
    third = 1.0_dp/3.0_dp
    !GCC$ ivdep
    do i = 1, n
      y_new(i, UX) = y(i, UX) + c*((y(i, VX) + v4(i, 1)) + 2.0_dp*(v2(i, 1) + v3(i, 1)))
      y_new(i, UZ) = y(i, UZ) + c*((y(i, VZ) + v4(i, 2)) + 2.0_dp*(v2(i, 2) + v3(i, 2)))
      y_new(i, VX) = y(i, VX) + (third*(((v2(i, 1) + v4(i, 1)) + 2.0_dp*v3(i, 1)) - 4.0_dp*y(i, VX)) + c_m*fx(i))
      y_new(i, VZ) = y(i, VZ) + (third*(((v2(i, 2) + v4(i, 2)) + 2.0_dp*v3(i, 2)) - 4.0_dp*y(i, VZ)) + c_m*fz(i))
    end do
  end subroutine to_end

  !> The end of a step of six stages: u + dt sum_s b_s v_s, v + dt sum_s b_s F_s/m. The first five forces follow from the
  !> velocities of the stages: c_(s+1) dt F_s/m = v_(s+1) - v.
  pure subroutine to_end_of_six(n, table, dt, m, y, v2, v3, v4, v5, v6, fx, fz, y_new)
    integer, intent(in) :: n
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: dt                          !! step [s]
    real(dp), intent(in) :: m                           !! block mass [kg]
    real(dp), intent(in) :: y(LB:n + LANES, 4)          !! state at the start of the step
    real(dp), intent(in) :: v2(LB:n + LANES, 2)         !! velocities of stages [m/s]
    real(dp), intent(in) :: v3(LB:n + LANES, 2)
    real(dp), intent(in) :: v4(LB:n + LANES, 2)
    real(dp), intent(in) :: v5(LB:n + LANES, 2)
    real(dp), intent(in) :: v6(LB:n + LANES, 2)
    real(dp), intent(in) :: fx(LB:n + LANES)            !! force of the last stage [N]
    real(dp), intent(in) :: fz(LB:n + LANES)            !! force of the last stage [N]
    real(dp), intent(inout) :: y_new(LB:n + LANES, 4)   !! state at the end of the step
    real(dp) :: b(6), g(5), b_m
    integer :: i

    b = dt*table%b(:6)
    g = table%b(:5)/table%c(2:6)
    b_m = b(6)/m
    !GCC$ ivdep
    do i = 1, n
      y_new(i, UX) = y(i, UX) + (((b(1)*y(i, VX) + b(2)*v2(i, 1)) + (b(3)*v3(i, 1) + b(4)*v4(i, 1))) + &
                                 (b(5)*v5(i, 1) + b(6)*v6(i, 1)))
      y_new(i, VX) = y(i, VX) + (((g(1)*(v2(i, 1) - y(i, VX)) + g(2)*(v3(i, 1) - y(i, VX))) &
                                  + (g(3)*(v4(i, 1) - y(i, VX)) + g(4)*(v5(i, 1) - y(i, VX)))) &
                                 + (g(5)*(v6(i, 1) - y(i, VX)) + b_m*fx(i)))
    end do
    !GCC$ ivdep
    do i = 1, n
      y_new(i, UZ) = y(i, UZ) + (((b(1)*y(i, VZ) + b(2)*v2(i, 2)) + (b(3)*v3(i, 2) + b(4)*v4(i, 2))) + &
                                 (b(5)*v5(i, 2) + b(6)*v6(i, 2)))
      y_new(i, VZ) = y(i, VZ) + (((g(1)*(v2(i, 2) - y(i, VZ)) + g(2)*(v3(i, 2) - y(i, VZ))) &
                                  + (g(3)*(v4(i, 2) - y(i, VZ)) + g(4)*(v5(i, 2) - y(i, VZ)))) &
                                 + (g(5)*(v6(i, 2) - y(i, VZ)) + b_m*fz(i)))
    end do
  end subroutine to_end_of_six

  !> The two bottom rows at a share theta of a step, after front `bottom_front`. In linear motion the result equals the end of
  !> a step of length theta h. With alpha_sj = c_s c_(s-1) ... c_(s-j+1), the weights b(theta) fulfil
  !>
  !>     sum_s b_s(theta) alpha_sj = theta^(j+1) sum_s b_s alpha_sj ,   j = 0 ... stages - 1 .
  pure subroutine share_of_step(s, table, sub, theta, y, y_new, q, rows)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: sub                                 !! length of the step or sub-step [s]
    real(dp), intent(in) :: theta                               !! share of the step
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)          !! state at the start
    real(dp), intent(in) :: y_new(LB:s%n + LANES, 4, s%nz)      !! state at the end
    real(dp), intent(in) :: q(LB:s%n + LANES, 4, 0:table%stages, 2:table%stages)  !! rows of the stages
    real(dp), intent(out) :: rows(LB:s%n + LANES, 4, 2)         !! the bottom rows at this share
    real(dp) :: b(MAX_STAGES), last
    integer :: j, stage, d

    b = share_weights(table, theta)
    last = b(table%stages)/table%b(table%stages)                ! the last force follows from the end of the step
    rows = 0.0_dp
    do j = 1, min(2, s%nz)
      do d = 1, 2
        rows(:, d, j) = y(:, d, j) + sub*b(1)*y(:, d + 2, j)
        rows(:, d + 2, j) = y(:, d + 2, j) + last*(y_new(:, d + 2, j) - y(:, d + 2, j))
        do stage = 2, table%stages
          rows(:, d, j) = rows(:, d, j) + sub*b(stage)*q(:, d + 2, j, stage)
          rows(:, d + 2, j) = rows(:, d + 2, j) + (b(stage - 1) - last*table%b(stage - 1))/table%c(stage) &
                              *(q(:, d + 2, j, stage) - y(:, d + 2, j))
        end do
      end do
      call close_state(s, rows(LB, 1, j))
    end do
  end subroutine share_of_step

  !> The weights of `share_of_step`, computed from the last to the first, because alpha is triangular.
  pure function share_weights(table, theta) result(b)
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: theta
    real(dp) :: b(MAX_STAGES), alpha(MAX_STAGES, 0:MAX_STAGES - 1)
    integer :: j, n

    n = table%stages
    alpha = 0.0_dp
    alpha(:n, 0) = 1.0_dp
    do j = 1, n - 1
      alpha(j + 1:n, j) = table%c(j + 1:n)*alpha(j:n - 1, j - 1)
    end do
    b = 0.0_dp
    do j = n - 1, 0, -1
      b(j + 1) = (theta**(j + 1)*sum(table%b(:n)*alpha(:n, j)) - sum(b(j + 2:n)*alpha(j + 2:n, j)))/alpha(j + 1, j)
    end do
  end function share_weights
end module pyfric_sweep
