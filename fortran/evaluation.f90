!> All forces at one state, without a step.
module pyfric_evaluation
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, LB, LANES
  use pyfric_lattice, only: N_BOND
  use pyfric_boundaries, only: rod_acceleration
  use pyfric_rows, only: row_t, new_row, row_forces, row_powers, budget_t
  use pyfric_stepping, only: widen, aligned
  implicit none (type, external)
  private
  public :: all_forces

contains

  !> Accelerations, contact forces and powers; repeated n_times, which only takes time.
  subroutine all_forces(s, t, n_times, y, rod, mode, s_0, a, a_rod, f, p, f_t, power)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                   !! time [s]
    integer, intent(in) :: n_times              !! evaluations to make
    real(dp), intent(in) :: y(s%nx, 4, s%nz)    !! state
    real(dp), intent(in) :: rod(6)              !! X, Z, phi and their rates
    integer(ip), intent(in) :: mode(s%nx)       !! contact states
    real(dp), intent(in) :: s_0(s%nx)           !! see pyfric_friction [m]
    real(dp), intent(out) :: a(s%nx, 2, s%nz)   !! accelerations [m/s2]
    real(dp), intent(out) :: a_rod(3)           !! of X, Z [m/s2], phi [rad/s2]
    real(dp), intent(out) :: f(s%nx)            !! friction force along +x [N]
    real(dp), intent(out) :: p(s%nx)            !! foundation force [N]
    real(dp), intent(out) :: f_t                !! driver force [N]
    type(budget_t), intent(inout) :: power      !! powers are added [W]
    real(dp), allocatable :: work(:)
    type(row_t) :: w
    integer :: n, q, c, b, k

    n = s%n + 2*LANES
    allocate (work(n*(4*s%nz + N_BOND + 4) + LANES))
    work = 0.0_dp
    q = aligned(work)
    c = q + 4*n*s%nz
    b = c + 2*n
    w = new_row(s)
    a_rod = 0.0_dp
    call widen(s, y, work(q))
    do k = 1, n_times
      call sweep(k == n_times, work(q), work(c), work(b), work(b + n*N_BOND), work(b + n*(N_BOND + 1)))
    end do
    f = w%f
    p = w%p
    f_t = w%f_t

  contains

    !> One evaluation, row by row.
    subroutine sweep(keep, q, carry, b, fx, fz)
      logical, intent(in) :: keep                                 !! take the results
      real(dp), intent(in) :: q(LB:s%n + LANES, 4, s%nz)          !! state
      real(dp), intent(inout) :: carry(LB:s%n + LANES, 2)         !! work space
      real(dp), intent(inout) :: b(LB:s%n + LANES, N_BOND)        !! work space
      real(dp), intent(inout) :: fx(LB:s%n + LANES)               !! forces on a row [N]
      real(dp), intent(inout) :: fz(LB:s%n + LANES)               !! forces on a row [N]
      integer :: j, below, above

      carry = 0.0_dp
      do j = 1, s%nz
        below = max(j - 1, 1)
        above = min(j + 1, s%nz)
        call row_forces(s, j, t, q(LB, 1, below), q(LB, 1, j), q(LB, 1, above), mode, s_0, carry, b, fx, fz, w)
        if (.not. keep) cycle
        call row_powers(s, j, 1.0_dp, q(LB, 1, j), q(LB, 1, above), rod(5), w, power)
        a(:, 1, j) = fx(s%at(:s%nx))/s%m
        a(:, 2, j) = fz(s%at(:s%nx))/s%m
        if (j == s%nz .and. s%rigid) then
          a_rod = rod_acceleration(s, rod(3), fx, fz)
          a(:, 1, j) = a_rod(1)
          a(:, 2, j) = a_rod(2) + a_rod(3)*s%x
        end if
      end do
    end subroutine sweep
  end subroutine all_forces
end module pyfric_evaluation
