!> Energy of the springs and power of the dashpots of the lattice, row by row.
!>
!> A bond to an image, across a mirrored side or top, counts by one half. So does a bond between half blocks.
module pyfric_bond_energy
  use pyfric_kinds, only: dp
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_bonds, only: bond_t, BONDS, N_BOND, BESIDE, ABOVE, RIGHT, LEFT
  use pyfric_model, only: model_t, reflected, row_share, column_shares, cut_sides, MIRRORED
  implicit none (type, external)
  private
  public :: bond_power, bond_energy

  type(bond_t), parameter :: BOND(N_BOND) = BONDS

contains

  !> Elastic energy of the bonds that start in row j: k (r - l0)^2/2, or k (n.du)^2/2 in linear geometry [J].
  pure function bond_energy(s, j, q, up) result(energy)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                       !! row, from 1 at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    real(dp) :: energy

    energy = over_bonds(s, j, 1, .false., q, up)
  end function bond_energy

  !> Power dissipated by the bonds that start in row j: eta |dv|^2, or eta (n.dv)^2 along the bonds [W].
  pure function bond_power(s, j, q, up) result(power)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                       !! row, from 1 at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    real(dp) :: power

    if (s%along .or. row_share(s, j) < 1.0_dp .or. cut_sides(s)) then
      power = over_bonds(s, j, 1, .true., q, up)
    else
      power = inner_power(s, j, q, up)
      if (j == s%nz .and. s%top == MIRRORED) then
        power = power + over_bonds(s, j, 1, .true., q, up, images=.true.)
      else if (s%left == MIRRORED .or. s%right == MIRRORED) then
        power = power + over_bonds(s, j, s%nx, .true., q, up, images=.true.)
      end if
    end if
  end function bond_power

  !> The same for bonds that do not lead to an image, with dashpots on the full relative velocity [W].
  pure function inner_power(s, j, q, up) result(power)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                       !! row, from 1 at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    real(dp) :: power, w(s%n), w_last
    integer :: i, last

    last = s%at(s%nx)
    w_last = 0.0_dp
    if (j < s%nz) then
      do i = 1, s%n
        w(i) = (speed2(BESIDE, i, q) + speed2(ABOVE, i, up)) + (speed2(RIGHT, i, up) + speed2(LEFT, i, up))
      end do
      w_last = speed2(ABOVE, last, up)
    else
      do i = 1, s%n
        w(i) = speed2(BESIDE, i, q)
      end do
    end if
    w(last) = w_last
    if (s%right == MIRRORED) w(s%at(s%nx + 1:)) = 0.0_dp
    power = s%eta*lane_sum(s%n, w)

  contains

    !> |dv|^2 of bond m of element i.
    pure function speed2(m, i, row) result(w)
      integer, intent(in) :: m
      integer, intent(in) :: i
      real(dp), intent(in) :: row(LB:s%n + LANES, 4)  !! the row of its second block
      real(dp) :: w
      integer :: i_1, i_2

      i_1 = i + LANES*BOND(m)%first
      i_2 = i + LANES*BOND(m)%second
      w = (row(i_2, VX) - q(i_1, VX))**2 + (row(i_2, VZ) - q(i_1, VZ))**2
    end function speed2
  end function inner_power

  !> A sum lane by lane. It vectorises, and its order does not depend on the processor.
  pure function lane_sum(n, w) result(total)
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)
    real(dp) :: total
    real(dp) :: lane(LANES)
    integer :: i

    lane = 0.0_dp
    do i = 1, n, LANES
      lane = lane + w(i:i + LANES - 1)
    end do
    total = (lane(1) + lane(2)) + (lane(3) + lane(4))
  end function lane_sum

  !> Energies [J] or powers [W] of the bonds that start in row j, added bond by bond.
  pure function over_bonds(s, j, stride, viscous, q, up, images) result(total)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                       !! row, from 1 at the bottom
    integer, intent(in) :: stride                  !! 1: at all columns, nx: at the sides
    logical, intent(in) :: viscous                 !! powers
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    logical, intent(in), optional :: images        !! those that lead to images only
    real(dp) :: total, row(4, 0:s%nx + 1), above_it(4, 0:s%nx + 1), column(s%nx)
    integer :: i

    column = column_shares(s)
    row = with_images(s, q)
    above_it = with_images(s, up)
    if (j == s%nz) then
      above_it(1:3:2, :) = row(1:3:2, :)
      above_it(2:4:2, :) = -row(2:4:2, :)
    end if
    total = 0.0_dp
    do i = 0, s%nx, stride
      total = total + of_bond(BESIDE, i, row)
    end do
    do i = 1, s%nx
      total = total + of_bond(ABOVE, i, above_it)
    end do
    do i = 0, s%nx, stride
      total = total + (of_bond(RIGHT, i, above_it) + of_bond(LEFT, i, above_it))
    end do

  contains

    !> Contribution of bond m of column i; 0 if the bond does not exist.
    pure function of_bond(m, i, to) result(e)
      integer, intent(in) :: m
      integer, intent(in) :: i
      real(dp), intent(in) :: to(4, 0:s%nx + 1)  !! the row of its second block
      real(dp) :: e, change(4)
      integer :: i_1, i_2
      logical :: image

      e = 0.0_dp
      i_1 = i + BOND(m)%first
      i_2 = i + BOND(m)%second
      image = min(i_1, i_2) < 1 .or. max(i_1, i_2) > s%nx .or. j + BOND(m)%rows > s%nz
      if (min(i_1, i_2) < 1 .and. s%left /= MIRRORED .or. max(i_1, i_2) > s%nx .and. s%right /= MIRRORED) return
      if (j + BOND(m)%rows > s%nz .and. s%top /= MIRRORED .or. present(images) .and. .not. image) return
      change = to(:, i_2) - row(:, i_1)
      e = merge(power_of(s, m, change), energy_of(s, m, change), viscous)
      if (image) e = 0.5_dp*e
      if (BOND(m)%rows == 0) e = row_share(s, j)*e
      if (i_1 == i_2) e = column(i)*e
    end function of_bond
  end function over_bonds

  !> The blocks of a row, and the images beyond its sides.
  pure function with_images(s, q) result(row)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)  !! the row
    real(dp) :: row(4, 0:s%nx + 1)

    row(:, 1:s%nx) = transpose(q(s%at(:s%nx), :))
    row(:, 0) = reflected(row(:, 1))
    row(:, s%nx + 1) = reflected(row(:, s%nx))
  end function with_images

  !> Power of the dashpot of bond m [W].
  pure function power_of(s, m, change) result(power)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), intent(in) :: change(4)  !! from the first block to the second one
    real(dp) :: power, d(2)

    d = s%l*BOND(m)%d
    if (s%finite) d = d + change(UX:UZ)
    power = s%eta*merge(sum(d*change(VX:VZ))**2/sum(d*d), sum(change(VX:VZ)**2), s%along)
  end function power_of

  !> Energy of the spring of bond m [J].
  pure function energy_of(s, m, change) result(energy)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), intent(in) :: change(4)  !! from the first block to the second one
    real(dp) :: energy, d(2), du(2), l0, stretch

    d = s%l*BOND(m)%d
    du = change(UX:UZ)
    l0 = sqrt(d(1)*d(1) + d(2)*d(2))
    if (s%finite) then
      stretch = (du(1)*(2.0_dp*d(1) + du(1)) + du(2)*(2.0_dp*d(2) + du(2)))/(sqrt((d(1) + du(1))**2 + (d(2) + du(2))**2) + l0)
    else
      stretch = (d(1)*du(1) + d(2)*du(2))/l0
    end if
    energy = 0.5_dp*(BOND(m)%stiffness*s%k)*stretch**2
  end function energy_of
end module pyfric_bond_energy
