!> Energy of the springs and power of the dashpots of the lattice, row by row.
!>
!> A bond to an image, across a mirrored side or top, counts by one half. A bond between half blocks also counts by one half.
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

  !> Power of dashpots on the full relative velocity, in bonds that do not lead to an image [W].
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

    !> |dv|^2 of bond m whose first block is element i.
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

  !> Sum of numbers lane by lane. All processors add in this order.
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

  !> Energy [J] or power [W] of the bonds that start in row j, added bond by bond.
  pure function over_bonds(s, j, stride, viscous, q, up, images) result(total)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                       !! row, from 1 at the bottom
    integer, intent(in) :: stride                  !! 1: at all columns, nx: at the sides
    logical, intent(in) :: viscous                 !! power instead of energy
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)   !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)  !! the row above
    logical, intent(in), optional :: images        !! only bonds that lead to images
    real(dp) :: total, row(0:s%nx + 1, 4), above_it(0:s%nx + 1, 4), each(0:s%nx, N_BOND)
    integer :: i, m

    row = with_images(s, q)
    above_it = with_images(s, up)
    if (j == s%nz) then
      above_it(:, UX:VX:2) = row(:, UX:VX:2)
      above_it(:, UZ:VZ:2) = -row(:, UZ:VZ:2)
    end if
    do m = 1, N_BOND
      if (BOND(m)%rows == 0) then
        each(:, m) = of_bonds(s, m, viscous, row, row)
      else
        each(:, m) = of_bonds(s, m, viscous, row, above_it)
      end if
      each(:, m) = shares(s, j, m, present(images))*each(:, m)
    end do
    total = 0.0_dp
    do i = 0, s%nx, stride
      total = total + each(i, BESIDE)
    end do
    do i = 1, s%nx
      total = total + each(i, ABOVE)
    end do
    do i = 0, s%nx, stride
      total = total + (each(i, RIGHT) + each(i, LEFT))
    end do
  end function over_bonds

  !> Shares of bonds m that start in row j, by column: 1, or one half for images and half blocks, or 0 for missing bonds.
  pure function shares(s, j, m, images) result(c)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j        !! row, from 1 at the bottom
    integer, intent(in) :: m
    logical, intent(in) :: images   !! only bonds that lead to images
    real(dp) :: c(0:s%nx)

    c = 1.0_dp
    if (j + BOND(m)%rows > s%nz) c = merge(0.5_dp, 0.0_dp, s%top == MIRRORED)
    if (BOND(m)%first /= BOND(m)%second) then
      c(0) = min(c(0), merge(0.5_dp, 0.0_dp, s%left == MIRRORED))
      c(s%nx) = min(c(s%nx), merge(0.5_dp, 0.0_dp, s%right == MIRRORED))
    end if
    if (images) c = merge(0.0_dp, c, c >= 1.0_dp)
    if (BOND(m)%rows == 0) c = row_share(s, j)*c
    if (BOND(m)%first == BOND(m)%second) c(1:) = column_shares(s)*c(1:)
  end function shares

  !> Energies [J] or powers [W] of whole bonds m, by column.
  pure function of_bonds(s, m, viscous, row, to) result(e)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    logical, intent(in) :: viscous                !! powers instead of energies
    real(dp), intent(in) :: row(0:s%nx + 1, 4)    !! the row of their first blocks
    real(dp), intent(in) :: to(0:s%nx + 1, 4)     !! the row of their second blocks
    real(dp) :: e(0:s%nx)
    real(dp), dimension(0:s%nx) :: du_x, du_z
    integer :: a, b

    a = BOND(m)%first
    b = BOND(m)%second
    du_x = to(b:b + s%nx, UX) - row(a:a + s%nx, UX)
    du_z = to(b:b + s%nx, UZ) - row(a:a + s%nx, UZ)
    if (viscous) then
      e = power_of(s, m, du_x, du_z, to(b:b + s%nx, VX) - row(a:a + s%nx, VX), to(b:b + s%nx, VZ) - row(a:a + s%nx, VZ))
    else
      e = energy_of(s, m, du_x, du_z)
    end if
  end function of_bonds

  !> The blocks of a row, and the images beyond its sides.
  pure function with_images(s, q) result(row)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)  !! the row
    real(dp) :: row(0:s%nx + 1, 4)

    row(1:s%nx, :) = q(s%at(:s%nx), :)
    row(0, :) = reflected(row(1, :))
    row(s%nx + 1, :) = reflected(row(s%nx, :))
  end function with_images

  !> Power of the dashpots of bonds m [W], from differences between their second and first blocks.
  pure function power_of(s, m, du_x, du_z, dv_x, dv_z) result(power)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), dimension(0:s%nx), intent(in) :: du_x, du_z, dv_x, dv_z
    real(dp) :: power(0:s%nx)
    real(dp), dimension(0:s%nx) :: d_x, d_z

    if (s%along) then
      d_x = s%l*BOND(m)%d(1)
      d_z = s%l*BOND(m)%d(2)
      if (s%finite) then
        d_x = d_x + du_x
        d_z = d_z + du_z
      end if
      power = s%eta*((d_x*dv_x + d_z*dv_z)**2/(d_x*d_x + d_z*d_z))
    else
      power = s%eta*(dv_x**2 + dv_z**2)
    end if
  end function power_of

  !> Energy of the springs of bonds m [J], from differences between their second and first blocks.
  pure function energy_of(s, m, du_x, du_z) result(energy)
    type(model_t), intent(in) :: s
    integer, intent(in) :: m
    real(dp), dimension(0:s%nx), intent(in) :: du_x, du_z
    real(dp) :: energy(0:s%nx)
    real(dp) :: d(2), l0, stretch(0:s%nx)

    d = s%l*BOND(m)%d
    l0 = sqrt(d(1)*d(1) + d(2)*d(2))
    if (s%finite) then
      stretch = (du_x*(2.0_dp*d(1) + du_x) + du_z*(2.0_dp*d(2) + du_z))/(sqrt((d(1) + du_x)**2 + (d(2) + du_z)**2) + l0)
    else
      stretch = (d(1)*du_x + d(2)*du_z)/l0
    end if
    energy = 0.5_dp*(BOND(m)%stiffness*s%k)*stretch**2
  end function energy_of
end module pyfric_bond_energy
