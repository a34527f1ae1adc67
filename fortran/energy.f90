!> Energies of a state, and points of the loading curve.
module pyfric_energy
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, row_share, column_shares, driven_u
  use pyfric_bond_energy, only: bond_energy
  use pyfric_boundaries, only: driver_on, driver_force, foundation, mirror_sum
  use pyfric_rows, only: budget_t
  use pyfric_law, only: interface_energy
  implicit none (type, external)
  private
  public :: curve_point, N_POINT

  integer, parameter :: N_ENERGY = 7             !! number of energies of a state
  integer, parameter :: N_POINT = N_ENERGY + 9   !! how many numbers a point of the loading curve has

contains

  !> A point of the loading curve: F_T [N], and with a budget, in J: energies; works of driver and load; dissipation by bonds,
  !> friction and switches; two parts of the friction heat; the part of the dissipation by bonds that absorbing walls took.
  pure function curve_point(s, t, y, rod, memory, keep_budget, budget, loss) result(point)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                                  !! time [s]
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)         !! state
    real(dp), intent(in) :: rod(6)                             !! X, Z, phi and their rates
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx)       !! see pyfric_law
    logical, intent(in) :: keep_budget
    type(budget_t), intent(in) :: budget
    real(dp), intent(in) :: loss(s%nx)                         !! switching loss [J]
    real(dp) :: point(N_POINT)

    point = 0.0_dp
    point(1) = driver_force(s, t, driven_u(s, y))
    if (.not. keep_budget) return
    point(2:N_ENERGY + 1) = energies(s, t, y, rod, memory)
    point(N_ENERGY + 2:) = [budget%work, sum(budget%dissipated), mirror_sum(s%nx, budget%heat), mirror_sum(s%nx, loss), &
                            mirror_sum(s%nx, budget%above), mirror_sum(s%nx, budget%viscous), sum(budget%radiated)]
  end function curve_point

  !> Kinetic (blocks, rod) and elastic (bonds, foundation, mattress or k_top, driver spring, junctions) energies [J].
  pure function energies(s, t, y, rod, memory) result(e)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                  !! time [s]
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)   !! state
    real(dp), intent(in) :: rod(6)             !! rod
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp) :: e(N_ENERGY), p(s%nx), k, u_x(s%n_driven)
    integer :: j

    e = 0.0_dp
    do j = 1, s%nz
      e(1) = e(1) + 0.5_dp*s%m*row_share(s, j)*sum(column_shares(s)*(y(s%at(:s%nx), VX, j)**2 + y(s%at(:s%nx), VZ, j)**2))
      e(3) = e(3) + bond_energy(s, j, y(LB, 1, j), y(LB, 1, min(j + 1, s%nz)))
    end do
    if (.not. s%prescribed) then
      k = merge(s%k_f(1), maxval(s%k_f), s%k_f(1) > 0.0_dp)
      e(4) = 0.5_dp*k*sum(s%k_f/k*min(y(s%at(:s%nx), UZ, 1) + s%gap, 0.0_dp)**2)
    end if
    if (s%rigid) then
      e(2) = 0.5_dp*(s%m_rod*(rod(4)**2 + rod(5)**2) + s%i_rod*rod(6)**2)
      e(5) = 0.5_dp*s%kappa*rod(3)**2
    else if (s%sheared) then
      e(5) = 0.5_dp*s%k_top*sum(y(s%at(:s%nx), UX, s%nz)**2)
    end if
    if (s%k_drv > 0.0_dp) then
      u_x = driven_u(s, y)
      do j = 1, s%n_driven
        e(6) = e(6) + 0.5_dp*driver_on(s, j, t, u_x(j))**2/s%k_drv
      end do
    end if
    if (s%law%rests) return
    call foundation(s, y(LB, UZ, 1), p)
    e(7) = interface_energy(s%law, s%nx, memory, y(s%at(:s%nx), UX, 1), p)
  end function energies
end module pyfric_energy
