!> Energies of a state.
module pyfric_energy
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, row_share, column_shares
  use pyfric_bond_energy, only: bond_energy
  use pyfric_boundaries, only: driver_on, foundation
  use pyfric_law, only: interface_energy
  implicit none (type, external)
  private
  public :: energies

contains

  !> Kinetic (blocks, rod) and elastic (bonds, foundation, mattress or k_top, driver spring, junctions) energies [J].
  pure function energies(s, t, y, rod, memory) result(e)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                  !! time [s]
    real(dp), intent(in) :: y(s%nx, 4, s%nz)   !! state
    real(dp), intent(in) :: rod(6)             !! rod
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp) :: e(7), p(s%nx), bottom(LB:s%n + LANES, 4)
    integer :: j

    e = 0.0_dp
    do j = 1, s%nz
      e(1) = e(1) + 0.5_dp*s%m*row_share(s, j)*sum(column_shares(s)*(y(:, VX, j)**2 + y(:, VZ, j)**2))
      e(3) = e(3) + bond_energy(s, j, row(j), row(min(j + 1, s%nz)))
    end do
    if (.not. s%prescribed) then
      e(4) = 0.5_dp*s%k_f(1)*sum(s%k_f/s%k_f(1)*min(y(:, UZ, 1), 0.0_dp)**2)
    end if
    if (s%rigid) then
      e(2) = 0.5_dp*(s%m_rod*(rod(4)**2 + rod(5)**2) + s%i_rod*rod(6)**2)
      e(5) = 0.5_dp*s%kappa*rod(3)**2
    else if (s%sheared) then
      e(5) = 0.5_dp*s%k_top*sum(y(:, UX, s%nz)**2)
    end if
    if (s%k_drv > 0.0_dp) then
      do j = s%j_h, s%j_h_top
        e(6) = e(6) + 0.5_dp*driver_on(s, j, t, y(s%i_h, UX, j))**2/s%k_drv
      end do
    end if
    if (s%law%rests) return
    bottom = row(1)
    call foundation(s, bottom(LB, UZ), p)
    e(7) = interface_energy(s%law, s%nx, memory, y(:, UX, 1), p)

  contains

    !> A row as it lies in the core.
    pure function row(j) result(q)
      integer, intent(in) :: j
      real(dp) :: q(LB:s%n + LANES, 4)

      q = 0.0_dp
      q(s%at(:s%nx), :) = y(:, :, j)
    end function row
  end function energies
end module pyfric_energy
