!> Explicit steppers given by a table of coefficients (pyfric.core.steppers).
!>
!> With forces F_j(u_j, v_j, t + c_j h) of stages j < i and h the length of the step or sub-step, stage i is at
!>
!>     u_i = u + c_i h v + h^2 sum_j abar_ij F_j/m,   v_i = v + h sum_j a_ij F_j/m ,
!>
!> and the step ends at u + h v + h^2 sum_i bbar_i F_i/m, v + h sum_i b_i F_i/m. A thread owns rows j0..j1 and waits
!> for the other threads between stages. Operations on a row do not depend on the number of threads.
!>
!> An implicit-explicit table has one more stage, at which the step ends. Its second part is for the friction R of blocks
!> that never rest, and for their state variable x with dx/dt = X. This part adds
!>
!>     u_i: + h^2 sum_j dbar_ij R_j/m ,   v_i: + h sum_j d_ij R_j/m ,   x_i = x + h sum_j s_ij X_j ,   d = s - a, dbar = a d .
!>
!> All stages after the first have the same d_ii = s_ii. In these stages, v_i and x_i are roots of equations
!> (pyfric_rate_state).
module pyfric_table_stepper
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, close_state, row_share, column_shares
  use pyfric_boundaries, only: rod_acceleration, rod_to_row, foundation
  use pyfric_law, only: begin_step, implicit_speeds
  use pyfric_rows, only: row_t, row_forces, row_powers, budget_t
  use pyfric_workspace, only: MAX_STAGES, FX, FZ, CARRY, BONDS, COLUMNS
  implicit none (type, external)
  private
  public :: table_t, new_table, table_step

  type :: table_t
    integer :: stages = 0
    logical :: swept = .false.             !! whether a single sweep makes a step (pyfric_sweep), from c and b alone
    real(dp) :: c(MAX_STAGES) = 0.0_dp
    real(dp) :: b(MAX_STAGES) = 0.0_dp
    real(dp) :: bbar(MAX_STAGES) = 0.0_dp
    real(dp) :: e(MAX_STAGES) = 0.0_dp     !! b minus b of the embedded method
    real(dp) :: ebar(MAX_STAGES) = 0.0_dp  !! bbar minus bbar of the embedded method
    real(dp) :: a(MAX_STAGES, MAX_STAGES) = 0.0_dp
    real(dp) :: abar(MAX_STAGES, MAX_STAGES) = 0.0_dp
    logical :: implicit = .false.          !! whether the stepper is implicit; a step then ends at the last stage
    real(dp) :: d(MAX_STAGES, MAX_STAGES) = 0.0_dp
    real(dp) :: dbar(MAX_STAGES, MAX_STAGES) = 0.0_dp
    real(dp) :: s(MAX_STAGES, MAX_STAGES) = 0.0_dp
  end type table_t

contains

  !> The table from the columns that Python passes: c, b; for a stepper that is not swept also bbar, e, ebar, a, abar; for an
  !> implicit stepper also d, dbar, s.
  pure function new_table(stages, columns) result(table)
    integer, intent(in) :: stages                !! at most MAX_STAGES
    real(dp), intent(in) :: columns(:, :)
    type(table_t) :: table

    table%stages = stages
    table%swept = size(columns, 2) == 2
    table%c(:stages) = columns(:, 1)
    table%b(:stages) = columns(:, 2)
    if (table%swept) return
    table%bbar(:stages) = columns(:, 3)
    table%e(:stages) = columns(:, 4)
    table%ebar(:stages) = columns(:, 5)
    table%a(:stages, :stages) = columns(:, 6:5 + stages)
    table%abar(:stages, :stages) = columns(:, 6 + stages:5 + 2*stages)
    table%implicit = size(columns, 2) > 5 + 2*stages
    if (.not. table%implicit) return
    table%d(:stages, :stages) = columns(:, 6 + 2*stages:5 + 3*stages)
    table%dbar(:stages, :stages) = columns(:, 6 + 3*stages:5 + 4*stages)
    table%s(:stages, :stages) = columns(:, 6 + 4*stages:)
  end function new_table

  !> Computes rows j0..j1 of the state one step later, and the error in these rows, at fixed contact states.
  subroutine table_step(s, table, t, sub, j0, j1, keep_budget, mode, memory, y, rod, y_new, rod_new, budget, f, q, work, w, err)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: t                         !! time at the start [s]
    real(dp), intent(in) :: sub                       !! length of the step or sub-step [s]
    integer, intent(in) :: j0                         !! first row of this thread
    integer, intent(in) :: j1                         !! last row of this thread
    logical, intent(in) :: keep_budget                !! whether to integrate works and dissipations
    integer(ip), intent(in) :: mode(s%nx)             !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx)      !! see pyfric_law
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)          !! state at the start
    real(dp), intent(in) :: rod(6)                    !! X, Z, phi and their rates at the start
    real(dp), intent(inout) :: y_new(LB:s%n + LANES, 4, s%nz)   !! rows j0..j1 are written
    real(dp), intent(inout) :: rod_new(6)             !! written by the thread that owns the top row
    type(budget_t), intent(inout) :: budget           !! works and heat, to which rows j0..j1 are added
    real(dp), intent(inout) :: f(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! forces of the stages, shared [N]
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4, s%nz)       !! a stage, shared
    real(dp), intent(inout) :: work(LB:s%n + LANES, COLUMNS)    !! work space, in which columns of bonds are zero on entry
    type(row_t), intent(inout) :: w
    real(dp), intent(out) :: err(2)                   !! largest error of u [m] and of v [m/s] in these rows
    real(dp) :: rod_a(3, MAX_STAGES), rod_stage(6)
    real(dp) :: friction(s%nx, MAX_STAGES), rate(s%nx, MAX_STAGES), x(s%nx), v(s%nx), shares(s%nx)
    real(dp) :: remembered(s%law%n_memory, s%nx)
    integer :: stage, last, j
    logical :: implicit

    rod_stage = rod
    last = table%stages
    if (table%implicit) last = last - 1
    implicit = table%implicit .and. s%law%flows
    if (implicit) then
      remembered = memory
      v = y(s%at(:s%nx), VX, 1)
      shares = row_share(s, 1)*column_shares(s)
      call begin_step(s%law%rate_state, s%nx, v, remembered(1, :), x, rate(:, 1))
    end if
    do stage = 1, last
      if (stage == 1) then
        call sweep(t, y, memory)
      else
        do j = j0, j1
          call stage_row(s, table%c(stage)*sub, sub, table%abar(stage, :), table%a(stage, :), stage - 1, j, y(LB, 1, j), &
                         rod, f, rod_a, q(LB, 1, j), rod_stage)
        end do
        if (implicit .and. j0 == 1) then
          call implicit_row(s, table, stage, sub, shares, v, x, friction, rate, q(LB, 1, 1), remembered)
        end if
        !$omp barrier
        if (implicit) then
          call sweep(t + table%c(stage)*sub, q, remembered)
        else
          call sweep(t + table%c(stage)*sub, q, memory)
        end if
      end if
      if (implicit .and. j0 == 1) friction(:, stage) = w%f/shares
      !$omp barrier
    end do
    do j = j0, j1
      call stage_row(s, sub, sub, table%bbar, table%b, last, j, y(LB, 1, j), rod, f, rod_a, y_new(LB, 1, j), rod_new)
    end do
    if (implicit .and. j0 == 1) then
      call implicit_row(s, table, table%stages, sub, shares, v, x, friction, rate, y_new(LB, 1, 1), remembered)
      w%memory = remembered
    end if
    err = 0.0_dp
    if (any(abs(table%e) > 0.0_dp)) err = row_errors(s, table, sub, j0, j1, f, rod_a)

  contains

    !> Computes forces and powers of a stage on rows j0..j1. In finite geometry, row j0 - 1 comes first, for its forces on row j0.
    subroutine sweep(t_stage, y_stage, memory_stage)
      real(dp), intent(in) :: t_stage                    !! time [s]
      real(dp), intent(in) :: y_stage(LB:s%n + LANES, 4, s%nz) !! the stage
      real(dp), intent(in) :: memory_stage(s%law%n_memory, s%nx) !! state variables of the stage
      integer :: below, above

      work(:, CARRY:CARRY + 1) = 0.0_dp
      do j = merge(max(1, j0 - 1), j0, s%finite), j1
        below = max(j - 1, 1)
        above = min(j + 1, s%nz)
        if (j < j0) then
          call row_forces(s, j, t_stage, y_stage(LB, 1, below), y_stage(LB, 1, j), y_stage(LB, 1, above), mode, memory_stage, &
                          work(LB, CARRY), work(LB, BONDS), work(LB, FX), work(LB, FZ), w)
          cycle
        end if
        call row_forces(s, j, t_stage, y_stage(LB, 1, below), y_stage(LB, 1, j), y_stage(LB, 1, above), mode, memory_stage, &
                        work(LB, CARRY), work(LB, BONDS), f(LB, 1, j, stage), f(LB, 2, j, stage), w)
        if (keep_budget) then
          call row_powers(s, j, t_stage, sub*table%b(stage), mode, memory_stage, y_stage(LB, 1, j), y_stage(LB, 1, above), &
                          rod_stage(5), w, budget)
        end if
        if (j == s%nz .and. s%rigid) then
          rod_a(:, stage) = rod_acceleration(s, t_stage, rod_stage(3), f(LB, 1, j, stage), f(LB, 2, j, stage))
        end if
      end do
    end subroutine sweep
  end subroutine table_step

  !> Computes the bottom row at an implicit stage: adds the part of the table for friction, and solves for velocities.
  pure subroutine implicit_row(s, table, stage, sub, shares, v, x, friction, rate, q, memory)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    integer, intent(in) :: stage
    real(dp), intent(in) :: sub                        !! length of the step [s]
    real(dp), intent(in) :: shares(s%nx)               !! shares of whole blocks in the row
    real(dp), intent(in) :: v(s%nx)                    !! velocities at the start [m/s]
    real(dp), intent(in) :: x(s%nx)                    !! state variables at the start, see pyfric_rate_state
    real(dp), intent(in) :: friction(s%nx, MAX_STAGES) !! R of the stages before, over the shares of whole blocks [N]
    real(dp), intent(inout) :: rate(s%nx, MAX_STAGES)  !! X of the stages before; X of this stage is added
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4)    !! on entry the row by the explicit part alone, on return with friction
    real(dp), intent(inout) :: memory(s%law%n_memory, s%nx) !! theta is set [s]
    real(dp) :: p(s%nx), m(s%nx), v_0(s%nx), x_0(s%nx), theta(s%nx)
    integer :: i, k

    call foundation(s, q(LB, UZ), p)
    m = s%m*shares
    x_0 = x
    do k = 1, stage - 1
      do i = 1, s%nx
        q(s%at(i), UX) = q(s%at(i), UX) + sub*sub/s%m*table%dbar(stage, k)*friction(i, k)
        q(s%at(i), VX) = q(s%at(i), VX) + sub/s%m*table%d(stage, k)*friction(i, k)
        x_0(i) = x_0(i) + sub*table%s(stage, k)*rate(i, k)
      end do
    end do
    v_0 = q(s%at(:s%nx), VX)
    call implicit_speeds(s%law%rate_state, s%nx, sub*table%s(stage, stage), m, p, x_0, v, v_0, theta, rate(:, stage))
    q(s%at(:s%nx), VX) = v_0
    memory(1, :) = theta
    call close_state(s, q)
  end subroutine implicit_row

  !> Computes row j at a stage or at the end of the step, from the first n stages. The rod sets the top row.
  pure subroutine stage_row(s, elapsed, sub, weight_u, weight_v, n, j, y, rod, f, rod_a, to, rod_to)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: elapsed                    !! time of the stage from the start of the step [s]
    real(dp), intent(in) :: sub                        !! length of the step or sub-step [s]
    real(dp), intent(in) :: weight_u(MAX_STAGES)
    real(dp), intent(in) :: weight_v(MAX_STAGES)
    integer, intent(in) :: n                           !! number of stages before
    integer, intent(in) :: j                           !! row
    real(dp), intent(in) :: y(LB:s%n + LANES, 4)       !! the row at the start
    real(dp), intent(in) :: rod(6)                     !! the rod at the start
    real(dp), intent(in) :: f(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! forces of the stages [N]
    real(dp), intent(in) :: rod_a(3, MAX_STAGES)      !! accelerations of the rod
    real(dp), intent(inout) :: to(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(inout) :: rod_to(6)               !! the rod
    integer :: k

    if (j < s%nz .or. .not. s%rigid) then
      call combine(s%n, s%nz, n, j, elapsed, sub*sub/s%m*weight_u, sub/s%m*weight_v, y, f, to)
      call close_state(s, to)
    else
      rod_to(1:3) = rod(1:3) + elapsed*rod(4:6)
      rod_to(4:6) = rod(4:6)
      do k = 1, n
        rod_to(1:3) = rod_to(1:3) + sub*sub*weight_u(k)*rod_a(:, k)
        rod_to(4:6) = rod_to(4:6) + sub*weight_v(k)*rod_a(:, k)
      end do
      call rod_to_row(s, rod_to, to)
    end if
  end subroutine stage_row

  !> Largest differences of u and v from the embedded method in rows j0..j1. A tilt of the rod counts as displacement of its ends.
  pure function row_errors(s, table, sub, j0, j1, f, rod_a) result(err)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: sub                        !! length of the step or sub-step [s]
    integer, intent(in) :: j0                          !! first row
    integer, intent(in) :: j1                          !! last row
    real(dp), intent(in) :: f(LB:s%n + LANES, 2, s%nz, MAX_STAGES)  !! forces of the stages [N]
    real(dp), intent(in) :: rod_a(3, MAX_STAGES)      !! accelerations of the rod
    real(dp) :: err(2), of_rod(3, 2), arm(3)
    integer :: j, k

    err = 0.0_dp
    do j = j0, j1
      if (j < s%nz .or. .not. s%rigid) then
        err = max(err, difference(s%n, s%nz, table%stages, j, sub*sub/s%m*table%ebar, sub/s%m*table%e, f))
      else
        of_rod = 0.0_dp
        do k = 1, table%stages
          of_rod(:, 1) = of_rod(:, 1) + sub*sub*table%ebar(k)*rod_a(:, k)
          of_rod(:, 2) = of_rod(:, 2) + sub*table%e(k)*rod_a(:, k)
        end do
        arm = [1.0_dp, 1.0_dp, maxval(abs(s%x))]
        err = max(err, [maxval(arm*abs(of_rod(:, 1))), maxval(arm*abs(of_rod(:, 2)))])
      end if
    end do
  end function row_errors

  !> u + elapsed v + sum_k abar_k F_k, v + sum_k a_k F_k.
  pure subroutine combine(n, nz, stages, j, elapsed, abar, a, y, f, q)
    integer, intent(in) :: n                         !! length of a row
    integer, intent(in) :: nz                        !! rows
    integer, intent(in) :: stages                    !! number of stages before
    integer, intent(in) :: j                         !! row
    real(dp), intent(in) :: elapsed                  !! time from the start of the step [s]
    real(dp), intent(in) :: abar(MAX_STAGES)        !! times h^2/m [m/N]
    real(dp), intent(in) :: a(MAX_STAGES)           !! times h/m [m/(N s)]
    real(dp), intent(in) :: y(LB:n + LANES, 4)       !! the row at the start
    real(dp), intent(in) :: f(LB:n + LANES, 2, nz, MAX_STAGES)  !! forces of the stages [N]
    real(dp), intent(inout) :: q(LB:n + LANES, 4)    !! the row
    integer :: i, k

    do i = 1, n
      q(i, UX) = y(i, UX) + elapsed*y(i, VX)
      q(i, UZ) = y(i, UZ) + elapsed*y(i, VZ)
      q(i, VX) = y(i, VX)
      q(i, VZ) = y(i, VZ)
    end do
    do k = 1, stages
      do i = 1, n
        q(i, UX) = q(i, UX) + abar(k)*f(i, 1, j, k)
        q(i, UZ) = q(i, UZ) + abar(k)*f(i, 2, j, k)
        q(i, VX) = q(i, VX) + a(k)*f(i, 1, j, k)
        q(i, VZ) = q(i, VZ) + a(k)*f(i, 2, j, k)
      end do
    end do
  end subroutine combine

  !> Largest |sum_k ebar_k F_k| and |sum_k e_k F_k| of a row.
  pure function difference(n, nz, stages, j, ebar, e, f) result(largest)
    integer, intent(in) :: n                         !! length of a row
    integer, intent(in) :: nz                        !! rows
    integer, intent(in) :: stages                    !! stages
    integer, intent(in) :: j                         !! row
    real(dp), intent(in) :: ebar(MAX_STAGES)        !! times h^2/m [m/N]
    real(dp), intent(in) :: e(MAX_STAGES)           !! times h/m [m/(N s)]
    real(dp), intent(in) :: f(LB:n + LANES, 2, nz, MAX_STAGES)  !! forces of the stages [N]
    real(dp) :: largest(2), d(4)
    integer :: i, k

    largest = 0.0_dp
    do i = 1, n
      d = 0.0_dp
      do k = 1, stages
        d(1:2) = d(1:2) + ebar(k)*f(i, :, j, k)
        d(3:4) = d(3:4) + e(k)*f(i, :, j, k)
      end do
      largest = max(largest, [max(abs(d(1)), abs(d(2))), max(abs(d(3)), abs(d(4)))])
    end do
  end function difference
end module pyfric_table_stepper
