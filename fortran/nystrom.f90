!> Explicit steppers given by a table of coefficients: semi-implicit Euler, velocity Verlet, an embedded Runge-Kutta pair.
!>
!> With forces F_j(u_j, v_j, t + c_j h) of stages j < i, stage i lies at
!>
!>     u_i = u + c_i h v + h^2 sum_j abar_ij F_j/m,   v_i = v + h sum_j a_ij F_j/m ,
!>
!> and the step ends at u + h v + h^2 sum_i bbar_i F_i/m, v + h sum_i b_i F_i/m. A thread owns rows j0..j1 and waits
!> for the others between stages; every row sees the same operations for any number of threads.
module pyfric_nystrom
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, UX, UZ, VX, VZ, LB, LANES, close_state
  use pyfric_boundaries, only: rod_acceleration, rod_to_row
  use pyfric_lattice, only: N_BOND
  use pyfric_rows, only: row_t, row_forces, row_powers, budget_t
  implicit none (type, external)
  private
  public :: table_t, table_of, nystrom_step, RK4, SYMPLECTIC_EULER, VERLET, ADAPTIVE, MOST_STAGES

  !> Steppers; the same numbers are in pyfric.core.
  integer(ip), parameter :: RK4 = 0, SYMPLECTIC_EULER = 1, VERLET = 2, ADAPTIVE = 3
  integer, parameter :: MOST_STAGES = 5

  type :: table_t
    integer :: stages = 0
    real(dp) :: c(MOST_STAGES) = 0.0_dp
    real(dp) :: a(MOST_STAGES, MOST_STAGES) = 0.0_dp
    real(dp) :: abar(MOST_STAGES, MOST_STAGES) = 0.0_dp
    real(dp) :: b(MOST_STAGES) = 0.0_dp
    real(dp) :: bbar(MOST_STAGES) = 0.0_dp
    real(dp) :: e(MOST_STAGES) = 0.0_dp     !! b minus that of the embedded method
    real(dp) :: ebar(MOST_STAGES) = 0.0_dp  !! bbar minus that of the embedded method
  end type table_t

contains

  !> The table of a stepper.
  pure function table_of(stepper) result(table)
    integer(ip), intent(in) :: stepper
    type(table_t) :: table

    select case (stepper)
    case (SYMPLECTIC_EULER)
      table = symplectic_euler_table()
    case (VERLET)
      table = verlet_table()
    case (ADAPTIVE)
      table = zonneveld_table()
    case default  ! RK4 has a sweep of its own
      table = table_t()
    end select
  end function table_of

  !> v' = v + h F(u, v)/m, u' = u + h v'. Order 1.
  pure function symplectic_euler_table() result(table)
    type(table_t) :: table

    table%stages = 1
    table%b(1) = 1.0_dp
    table%bbar(1) = 1.0_dp
  end function symplectic_euler_table

  !> u' = u + h (v + h F_1/2m), v' = v + h (F_1 + F_2)/2m, with F_2 at u' and the predicted velocity v + h F_1/m, on
  !> which viscous forces depend. Order 2.
  pure function verlet_table() result(table)
    type(table_t) :: table

    table%stages = 2
    table%c(2) = 1.0_dp
    table%a(2, 1) = 1.0_dp
    table%abar(2, 1) = 0.5_dp
    table%b(1:2) = 0.5_dp
    table%bbar(1) = 0.5_dp
  end function verlet_table

  !> Classical RK4 with one more stage, which makes it a pair of orders 4 and 3 (J. A. Zonneveld, 1963; E. Hairer,
  !> S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, section II.4).
  pure function zonneveld_table() result(table)
    type(table_t) :: table
    real(dp) :: low(MOST_STAGES)
    integer :: i, j, k

    table%stages = 5
    table%c = [0.0_dp, 0.5_dp, 0.5_dp, 1.0_dp, 0.75_dp]
    table%a(2, 1) = 0.5_dp
    table%a(3, 2) = 0.5_dp
    table%a(4, 3) = 1.0_dp
    table%a(5, 1:4) = [5.0_dp, 7.0_dp, 13.0_dp, -1.0_dp]/32.0_dp
    table%b = [1.0_dp, 2.0_dp, 2.0_dp, 1.0_dp, 0.0_dp]/6.0_dp
    low = [-3.0_dp, 14.0_dp, 14.0_dp, 13.0_dp, -32.0_dp]/6.0_dp
    table%e = table%b - low
    do i = 1, 5  ! abar = a a, bbar = b a, as u' = v
      do j = 1, 5
        do k = 1, 5
          table%abar(i, j) = table%abar(i, j) + table%a(i, k)*table%a(k, j)
        end do
        table%bbar(j) = table%bbar(j) + table%b(i)*table%a(i, j)
        table%ebar(j) = table%ebar(j) + table%e(i)*table%a(i, j)
      end do
    end do
  end function zonneveld_table

  !> Rows j0..j1 of the state one step later, and their part of the error. Contact states are frozen during the step.
  subroutine nystrom_step(s, table, t, h, j0, j1, keep_budget, mode, s_0, y, rod, y_new, rod_new, budget, f, q, carry, b, &
                          fx, fz, w, err)
    type(model_t), intent(in) :: s
    type(table_t), intent(in) :: table
    real(dp), intent(in) :: t                         !! time at the start [s]
    real(dp), intent(in) :: h                         !! step [s]
    integer, intent(in) :: j0                         !! first row of this thread
    integer, intent(in) :: j1                         !! last row of this thread
    logical, intent(in) :: keep_budget                !! integrate works and dissipations too
    integer(ip), intent(in) :: mode(s%nx)             !! contact states
    real(dp), intent(in) :: s_0(s%nx)                 !! see pyfric_friction [m]
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)          !! state at the start
    real(dp), intent(in) :: rod(6)                    !! X, Z, phi and their rates at the start
    real(dp), intent(inout) :: y_new(LB:s%n + LANES, 4, s%nz)   !! rows j0..j1 are written
    real(dp), intent(inout) :: rod_new(6)             !! written by the thread that owns the top row
    type(budget_t), intent(inout) :: budget           !! entries of rows j0..j1 are advanced
    real(dp), intent(inout) :: f(LB:s%n + LANES, 2, s%nz, MOST_STAGES)  !! forces of the stages, shared [N]
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4, s%nz)       !! a stage, shared
    real(dp), intent(inout) :: carry(LB:s%n + LANES, 2)         !! work space of finite geometry
    real(dp), intent(inout) :: b(LB:s%n + LANES, N_BOND)        !! work space of finite geometry, zero at first
    real(dp), intent(inout) :: fx(LB:s%n + LANES)               !! work space
    real(dp), intent(inout) :: fz(LB:s%n + LANES)               !! work space
    type(row_t), intent(inout) :: w
    real(dp), intent(out) :: err(2)                   !! largest error of u [m] and of v [m/s] in these rows
    real(dp) :: rod_a(3, MOST_STAGES), rod_stage(6)
    integer :: stage, j

    rod_stage = rod
    do stage = 1, table%stages
      if (stage == 1) then
        call sweep(t, y)
      else
        do j = j0, j1
          call one_row(table%c(stage), table%abar(stage, :), table%a(stage, :), stage - 1, q(LB, 1, j), rod_stage)
        end do
        !$omp barrier
        call sweep(t + table%c(stage)*h, q)
      end if
      !$omp barrier
    end do
    do j = j0, j1
      call one_row(1.0_dp, table%bbar, table%b, table%stages, y_new(LB, 1, j), rod_new)
    end do
    err = 0.0_dp
    if (any(abs(table%e) > 0.0_dp)) call row_errors()

  contains

    !> Forces and powers of a stage, on rows j0..j1. In finite geometry the row below starts the carry.
    subroutine sweep(t_stage, at)
      real(dp), intent(in) :: t_stage                    !! time [s]
      real(dp), intent(in) :: at(LB:s%n + LANES, 4, s%nz)  !! the stage
      integer :: below, above

      carry = 0.0_dp
      do j = merge(max(1, j0 - 1), j0, s%finite), j1
        below = max(j - 1, 1)
        above = min(j + 1, s%nz)
        if (j < j0) then
          call row_forces(s, j, t_stage, at(LB, 1, below), at(LB, 1, j), at(LB, 1, above), mode, s_0, carry, b, fx, fz, w)
          cycle
        end if
        call row_forces(s, j, t_stage, at(LB, 1, below), at(LB, 1, j), at(LB, 1, above), mode, s_0, carry, b, &
                        f(LB, 1, j, stage), f(LB, 2, j, stage), w)
        if (keep_budget) call row_powers(s, j, h*table%b(stage), at(LB, 1, j), at(LB, 1, above), rod_stage(5), w, budget)
        if (j == s%nz .and. s%rigid) rod_a(:, stage) = rod_acceleration(s, rod_stage(3), f(LB, 1, j, stage), f(LB, 2, j, stage))
      end do
    end subroutine sweep

    !> Row j at a stage or at the end, from the first n stages; the top row by the rod.
    subroutine one_row(c, for_u, for_v, n, to, rod_to)
      real(dp), intent(in) :: c                          !! time of the stage over h
      real(dp), intent(in) :: for_u(MOST_STAGES)
      real(dp), intent(in) :: for_v(MOST_STAGES)
      integer, intent(in) :: n                           !! stages known
      real(dp), intent(inout) :: to(LB:s%n + LANES, 4)   !! the row
      real(dp), intent(inout) :: rod_to(6)               !! the rod
      integer :: k

      if (j < s%nz .or. .not. s%rigid) then
        call combine(s%n, s%nz, n, j, c*h, h*h/s%m*for_u, h/s%m*for_v, y(LB, 1, j), f, to)
        call close_state(s, to)
      else
        rod_to(1:3) = rod(1:3) + c*h*rod(4:6)
        rod_to(4:6) = rod(4:6)
        do k = 1, n
          rod_to(1:3) = rod_to(1:3) + h*h*for_u(k)*rod_a(:, k)
          rod_to(4:6) = rod_to(4:6) + h*for_v(k)*rod_a(:, k)
        end do
        call rod_to_row(s, rod_to, to)
      end if
    end subroutine one_row

    !> Largest difference to the embedded method; tilt counts by the displacement of the slider's ends.
    subroutine row_errors()
      real(dp) :: of_rod(3, 2), arm(3)
      integer :: k

      do j = j0, j1
        if (j < s%nz .or. .not. s%rigid) then
          err = max(err, difference(s%n, s%nz, table%stages, j, h*h/s%m*table%ebar, h/s%m*table%e, f))
        else
          of_rod = 0.0_dp
          do k = 1, table%stages
            of_rod(:, 1) = of_rod(:, 1) + h*h*table%ebar(k)*rod_a(:, k)
            of_rod(:, 2) = of_rod(:, 2) + h*table%e(k)*rod_a(:, k)
          end do
          arm = [1.0_dp, 1.0_dp, maxval(abs(s%x))]
          err = max(err, [maxval(arm*abs(of_rod(:, 1))), maxval(arm*abs(of_rod(:, 2)))])
        end if
      end do
    end subroutine row_errors
  end subroutine nystrom_step

  !> u + ch v + sum_k abar_k F_k, v + sum_k a_k F_k.
  pure subroutine combine(n, nz, stages, j, ch, abar, a, y, f, q)
    integer, intent(in) :: n                         !! length of a row
    integer, intent(in) :: nz                        !! rows
    integer, intent(in) :: stages                    !! stages known
    integer, intent(in) :: j                         !! row
    real(dp), intent(in) :: ch                       !! time from the start of the step [s]
    real(dp), intent(in) :: abar(MOST_STAGES)        !! times h^2/m [m/N]
    real(dp), intent(in) :: a(MOST_STAGES)           !! times h/m [m/(N s)]
    real(dp), intent(in) :: y(LB:n + LANES, 4)       !! the row at the start
    real(dp), intent(in) :: f(LB:n + LANES, 2, nz, MOST_STAGES)  !! forces of the stages [N]
    real(dp), intent(inout) :: q(LB:n + LANES, 4)    !! the row
    integer :: i, k

    do i = 1, n
      q(i, UX) = y(i, UX) + ch*y(i, VX)
      q(i, UZ) = y(i, UZ) + ch*y(i, VZ)
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
  pure function difference(n, nz, stages, j, ebar, e, f) result(most)
    integer, intent(in) :: n                         !! length of a row
    integer, intent(in) :: nz                        !! rows
    integer, intent(in) :: stages                    !! stages
    integer, intent(in) :: j                         !! row
    real(dp), intent(in) :: ebar(MOST_STAGES)        !! times h^2/m [m/N]
    real(dp), intent(in) :: e(MOST_STAGES)           !! times h/m [m/(N s)]
    real(dp), intent(in) :: f(LB:n + LANES, 2, nz, MOST_STAGES)  !! forces of the stages [N]
    real(dp) :: most(2), d(4)
    integer :: i, k

    most = 0.0_dp
    do i = 1, n
      d = 0.0_dp
      do k = 1, stages
        d(1:2) = d(1:2) + ebar(k)*f(i, :, j, k)
        d(3:4) = d(3:4) + e(k)*f(i, :, j, k)
      end do
      most = max(most, [max(abs(d(1)), abs(d(2))), max(abs(d(3)), abs(d(4)))])
    end do
  end function difference
end module pyfric_nystrom
