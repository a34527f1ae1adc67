!> All forces on one row of blocks, and their powers.
module pyfric_rows
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: UX, UZ, VX, VZ, LB, LANES
  use pyfric_model, only: model_t, row_share, column_shares, cut_sides, driven_number, MIRRORED, HELD
  use pyfric_bonds, only: N_BOND
  use pyfric_lattice, only: around_t, gather_forces, halve_bonds, halve_columns
  use pyfric_finite, only: forces_finite
  use pyfric_bond_energy, only: bond_power
  use pyfric_boundaries, only: foundation, foundation_rate, driver_on, driver_speed, load_share, mirror_sum, weights, absorb, &
                               absorbed, reflected_row
  use pyfric_law, only: friction_force, friction_powers
  implicit none (type, external)
  private
  public :: row_t, new_row, other_forces, row_forces, row_powers, take_shared, budget_t, new_budget, save_budget

  !> Work space of one row, except forces on blocks and bonds, which are in aligned arrays.
  type :: row_t
    logical :: complete = .false.   !! whether memory was allocated
    real(dp), allocatable :: zeros(:, :)  !! zeros, in place of a missing row below or above (:, 4)
    real(dp), allocatable :: p(:)        !! foundation force, bottom row [N]
    real(dp), allocatable :: f(:)        !! friction force along +x, bottom row [N]
    real(dp), allocatable :: memory(:, :) !! state variables at the end of an implicit step, see pyfric_law
    real(dp) :: f_t                      !! force of the driver, row of a driven block [N]
  end type row_t

  !> Works and dissipations since the start [J].
  type :: budget_t
    logical :: complete = .true.    !! whether memory was allocated
    real(dp), allocatable :: dissipated(:)  !! heat of the bonds that start in each row, and energy to absorbing walls
    real(dp), allocatable :: radiated(:)    !! part of `dissipated` by absorbing walls
    real(dp), allocatable :: heat(:)        !! friction heat under each bottom block
    real(dp), allocatable :: above(:)       !! part of heat above the kinetic strength; on junctions heat of dragging
    real(dp), allocatable :: viscous(:)     !! part of heat by alpha; on junctions work of changes of stiffness
    real(dp) :: work(2)                     !! work of the driver; work of the forces on the top and of pushes
    real(dp) :: pushed = 0.0_dp             !! work of pushes in this step, which `take_shared` adds to work
    real(dp), allocatable :: driven(:)      !! work in this step of a driver on several blocks, by row; else not allocated
    real(dp), allocatable :: fallen(:)      !! work of gravity in this step, by row; without gravity not allocated
  end type budget_t

contains

  pure function new_row(s) result(w)
    type(model_t), intent(in) :: s
    type(row_t) :: w
    integer :: failed

    allocate (w%zeros(LB:s%n + LANES, 4), w%p(s%nx), w%f(s%nx), w%memory(merge(s%law%n_memory, 0, s%law%flows), s%nx), stat=failed)
    if (failed /= 0) return
    w%complete = .true.
    w%zeros = 0.0_dp
    w%p = 0.0_dp
    w%f = 0.0_dp
    w%f_t = 0.0_dp
  end function new_row

  !> Copies works and dissipations to the plain arrays of Python.
  pure subroutine save_budget(budget, dissipated, radiated, heat, above, viscous, work)
    type(budget_t), intent(in) :: budget
    real(dp), intent(out) :: dissipated(:)   !! this array and the next ones: see budget_t
    real(dp), intent(out) :: radiated(:)
    real(dp), intent(out) :: heat(:)
    real(dp), intent(out) :: above(:)
    real(dp), intent(out) :: viscous(:)
    real(dp), intent(out) :: work(2)

    dissipated = budget%dissipated
    radiated = budget%radiated
    heat = budget%heat
    above = budget%above
    viscous = budget%viscous
    work = budget%work
  end subroutine save_budget

  !> Works and dissipations from the plain arrays of Python.
  pure function new_budget(s, dissipated, radiated, heat, above, viscous, work) result(budget)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: dissipated(:)   !! this array and the next ones: see budget_t
    real(dp), intent(in) :: radiated(:)
    real(dp), intent(in) :: heat(:)
    real(dp), intent(in) :: above(:)
    real(dp), intent(in) :: viscous(:)
    real(dp), intent(in) :: work(2)
    type(budget_t) :: budget
    integer :: failed

    budget = budget_t(.true., dissipated, radiated, heat, above, viscous, work)
    if (s%j_h_top > s%j_h) then
      allocate (budget%driven(s%j_h:s%j_h_top), stat=failed)
      budget%complete = failed == 0
      if (budget%complete) budget%driven(:) = 0.0_dp
    end if
    if (s%g > 0.0_dp .and. budget%complete) then
      allocate (budget%fallen(s%nz), stat=failed)
      budget%complete = failed == 0
      if (budget%complete) budget%fallen(:) = 0.0_dp
    end if
  end function new_budget

  !> Forces of all springs and dashpots on row j. In finite geometry, carry contains forces from the row below on entry, and forces
  !> on the row above on return.
  pure subroutine bond_forces(s, j, dn, q, up, carry, b, fx, fz, w)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                  !! row, from 1 at the bottom
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)       !! the row below, not used at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)        !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)       !! the row above, not used at the top
    real(dp), intent(inout) :: carry(LB:s%n + LANES, 2) !! forces on the row from below, then on the row above [N]
    real(dp), intent(inout) :: b(LB:s%n + LANES, 2, N_BOND) !! work space of finite geometry
    real(dp), intent(inout) :: fx(LB:s%n + LANES)     !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)     !! force on the row [N]
    type(row_t), intent(in) :: w
    integer :: i

    if (s%finite) call forces_finite(s, j < s%nz, q, up, b, carry, fx, fz)
    if (s%finite .and. s%along) then
      continue  ! dashpots were added with the springs
    else if (j == s%nz .and. s%top == MIRRORED) then
      call gather_forces(s, around_t(2.0_dp, 0.0_dp), dn, q, reflected_row(s, q), fx, fz)
    else if (j > 1 .and. j < s%nz) then
      call gather_forces(s, around_t(2.0_dp, 0.0_dp), dn, q, up, fx, fz)
    else if (j < s%nz) then
      call gather_forces(s, around_t(1.0_dp, 1.0_dp), w%zeros, q, up, fx, fz)
    else if (j > 1) then
      call gather_forces(s, around_t(1.0_dp, -1.0_dp), dn, q, w%zeros, fx, fz)
    else
      call gather_forces(s, around_t(0.0_dp, 0.0_dp), w%zeros, q, w%zeros, fx, fz)
    end if
    if (s%has_halves) call halve_cuts(s, j, dn, q, up, fx, fz)
    do i = s%nx + 1, s%n
      fx(s%at(i)) = 0.0_dp
      fz(s%at(i)) = 0.0_dp
    end do
  end subroutine bond_forces

  !> Subtracts half of the forces of bonds along rows or columns of half blocks from row j.
  pure subroutine halve_cuts(s, j, dn, q, up, fx, fz)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                         !! row, from 1 at the bottom
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)    !! the row below, not used at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)     !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)    !! the row above, not used at the top
    real(dp), intent(inout) :: fx(LB:s%n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)    !! force on the row [N]

    if (row_share(s, j) < 1.0_dp) call halve_bonds(s, q, fx, fz)
    if (.not. cut_sides(s)) return
    if (j == s%nz .and. s%top == MIRRORED) then
      call halve_columns(s, [j > 1, .true.], dn, q, reflected_row(s, q), fx, fz)
    else
      call halve_columns(s, [j > 1, j < s%nz], dn, q, up, fx, fz)
    end if
  end subroutine halve_cuts

  !> Divides the forces on row j by the shares of its blocks, because the stepper uses the mass of whole blocks.
  pure subroutine weigh(s, j, fx, fz)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                         !! row, from 1 at the bottom
    real(dp), intent(inout) :: fx(LB:s%n + LANES)    !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)    !! force on the row [N]
    real(dp) :: c(s%nx)

    if (row_share(s, j) < 1.0_dp) then
      fx = 2.0_dp*fx
      fz = 2.0_dp*fz
    end if
    if (.not. cut_sides(s)) return
    c = column_shares(s)
    fx(s%at([1, s%nx])) = fx(s%at([1, s%nx]))/c([1, s%nx])
    fz(s%at([1, s%nx])) = fz(s%at([1, s%nx]))/c([1, s%nx])
  end subroutine weigh

  !> Adds the external forces on row j: driver, pushes on the bottom row, shear, weight, absorbing sides and top. On a free top
  !> row, the load and -k_top u_x are also added.
  pure subroutine outer_forces(s, j, t, q, fx, fz, f_t)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                        !! row, from 1 at the bottom
    real(dp), intent(in) :: t                       !! time [s]
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the row
    real(dp), intent(inout) :: fx(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)   !! force on the row [N]
    real(dp), intent(inout) :: f_t                  !! force of the driver, set on rows of driven blocks [N]
    real(dp) :: share, shear_gain, pull
    integer :: i

    if (j >= s%j_h .and. j <= s%j_h_top) then
      f_t = 0.0_dp
      do i = s%i_h, s%i_h_end
        pull = driver_on(s, driven_number(s, i, j), t, q(s%at(i), UX))
        fx(s%at(i)) = fx(s%at(i)) + s%d*pull
        f_t = f_t + pull
      end do
    end if
    if (j == 1 .and. s%pushed) then
      do i = 1, s%nx
        fx(s%at(i)) = fx(s%at(i)) + (s%push(i) + s%push_rate(i)*(t - s%t_seg))
      end do
    end if
    if (s%prescribed) call absorb(s, j, q, fx, fz)
    if (s%g > 0.0_dp) fz(s%at(:s%nx)) = fz(s%at(:s%nx)) - weights(s, j)
    if (s%rigid) return
    if (j == s%nz .and. .not. s%prescribed) then
      share = load_share(s, t)
      do i = 1, s%nx
        fz(s%at(i)) = fz(s%at(i)) - s%load(i)*share
      end do
    end if
    if (j /= s%j_shear .or. .not. s%sheared) return
    shear_gain = s%shear_rate*(t - s%t_seg)
    do i = 1, s%nx
      fx(s%at(i)) = fx(s%at(i)) + ((s%shear(i) + shear_gain) - s%k_top*q(s%at(i), UX))
    end do
  end subroutine outer_forces

  !> All horizontal forces on the bottom row except friction, outside of a step.
  pure subroutine other_forces(s, t, q, up, w, fx)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: t                       !! time [s]
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)    !! the bottom row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)   !! the row above
    type(row_t), intent(inout) :: w
    real(dp), intent(out) :: fx(LB:s%n + LANES)     !! forces along x [N]
    real(dp) :: carry(LB:s%n + LANES, 2), b(LB:s%n + LANES, 2, N_BOND), fz(LB:s%n + LANES)

    carry = 0.0_dp
    b = 0.0_dp
    call bond_forces(s, 1, w%zeros, q, up, carry, b, fx, fz, w)
    call outer_forces(s, 1, t, q, fx, fz, w%f_t)
  end subroutine other_forces

  !> Forces on row j including friction, at fixed contact states. In finite geometry, the carry of the bonds moves up one row.
  !> Forces on half blocks are doubled, because the stepper uses the mass of whole blocks.
  pure subroutine row_forces(s, j, t, dn, q, up, mode, memory, carry, b, fx, fz, w)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                  !! row, from 1 at the bottom
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: dn(LB:s%n + LANES, 4)       !! the row below, not used at the bottom
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)        !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)       !! the row above, not used at the top
    integer(ip), intent(in) :: mode(s%nx)     !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp), intent(inout) :: carry(LB:s%n + LANES, 2) !! bond forces from below, then on the row above [N]
    real(dp), intent(inout) :: b(LB:s%n + LANES, 2, N_BOND) !! work space of finite geometry
    real(dp), intent(inout) :: fx(LB:s%n + LANES)     !! force on the row [N]
    real(dp), intent(inout) :: fz(LB:s%n + LANES)     !! force on the row [N]
    type(row_t), intent(inout) :: w
    integer :: i

    call bond_forces(s, j, dn, q, up, carry, b, fx, fz, w)
    call outer_forces(s, j, t, q, fx, fz, w%f_t)
    if (j == 1) then
      call foundation(s, q(LB, UZ), w%p)
      call friction_force(s%law, s%nx, s%n, s%at, mode, memory, t, q(LB, UX), q(LB, VX), fx, w%p, w%f)
      do i = 1, s%nx
        fx(s%at(i)) = fx(s%at(i)) + w%f(i)
      end do
      if (.not. s%prescribed) then
        do i = 1, s%nx
          fz(s%at(i)) = fz(s%at(i)) + w%p(i)
        end do
      end if
    else if (j == s%nz .and. s%top == HELD) then
      fx = 0.0_dp
      fz = 0.0_dp
    end if
    if (s%has_halves .and. .not. (s%rigid .and. j == s%nz)) call weigh(s, j, fx, fz)
  end subroutine row_forces

  !> Adds c times the powers of row j to the budget, after a call of row_forces.
  pure subroutine row_powers(s, j, t, c, mode, memory, q, up, v_rod, w, budget)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j                !! row
    real(dp), intent(in) :: t               !! time [s]
    real(dp), intent(in) :: c               !! weight of this evaluation [s]
    integer(ip), intent(in) :: mode(s%nx)   !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)      !! the row
    real(dp), intent(in) :: up(LB:s%n + LANES, 4)     !! the row above
    real(dp), intent(in) :: v_rod           !! Z' of the rod [m/s]
    type(row_t), intent(in) :: w
    type(budget_t), intent(inout) :: budget
    real(dp) :: taken

    budget%dissipated(j) = budget%dissipated(j) + c*bond_power(s, j, q, up)
    if (s%prescribed) then
      taken = absorbed(s, j, q)
      budget%dissipated(j) = budget%dissipated(j) + c*taken
      budget%radiated(j) = budget%radiated(j) + c*taken
    end if
    if (j == 1) budget%heat = budget%heat - c*(w%f*q(s%at(:s%nx), VX))
    if (j == 1 .and. .not. s%law%simple) call parts_of_heat(s, c, mode, memory, q, w, budget)
    if (j >= s%j_h .and. j <= s%j_h_top) then
      if (allocated(budget%driven)) then
        budget%driven(j) = budget%driven(j) + c*(w%f_t*driver_speed(s, t))
      else
        budget%work(1) = budget%work(1) + c*(w%f_t*driver_speed(s, t))
      end if
    end if
    if (j == 1 .and. s%pushed) then
      budget%pushed = budget%pushed + c*mirror_sum(s%nx, (s%push + s%push_rate*(t - s%t_seg))*q(s%at(:s%nx), VX))
    end if
    if (allocated(budget%fallen)) then
      budget%fallen(j) = budget%fallen(j) - c*mirror_sum(s%nx, weights(s, j)*q(s%at(:s%nx), VZ))
      if (s%rigid .and. j == s%nz) budget%fallen(j) = budget%fallen(j) - c*(s%m_rod*s%g*v_rod)
    end if
    if (s%rigid) then
      if (j == s%nz) budget%work(2) = budget%work(2) - c*(s%f_n*load_share(s, t)*v_rod)
      return
    end if
    if (j == s%nz .and. .not. s%prescribed) then
      budget%work(2) = budget%work(2) - c*mirror_sum(s%nx, s%load*load_share(s, t)*q(s%at(:s%nx), VZ))
    end if
    if (j /= s%j_shear .or. .not. s%sheared) return
    budget%work(2) = budget%work(2) &
                     + c*mirror_sum(s%nx, (s%shear + s%shear_rate*(t - s%t_seg))*q(s%at(:s%nx), VX))
  end subroutine row_powers

  !> Adds works from several rows to the budget, after all rows: of a driver on several blocks, of gravity and of pushes.
  pure subroutine take_shared(budget)
    type(budget_t), intent(inout) :: budget

    if (allocated(budget%driven)) then
      budget%work(1) = budget%work(1) + sum(budget%driven)
      budget%driven = 0.0_dp
    end if
    if (allocated(budget%fallen)) then
      budget%work(2) = budget%work(2) + sum(budget%fallen)
      budget%fallen = 0.0_dp
    end if
    budget%work(2) = budget%work(2) + budget%pushed
    budget%pushed = 0.0_dp
  end subroutine take_shared

  !> Adds the two parts of the friction heat: above the kinetic strength, and viscous. Arrays are allocated only if needed.
  pure subroutine parts_of_heat(s, c, mode, memory, q, w, budget)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: c               !! weight of this evaluation [s]
    integer(ip), intent(in) :: mode(s%nx)   !! contact states
    real(dp), intent(in) :: memory(s%law%n_memory, s%nx) !! see pyfric_law
    real(dp), intent(in) :: q(LB:s%n + LANES, 4)      !! the bottom row
    type(row_t), intent(in) :: w
    type(budget_t), intent(inout) :: budget
    real(dp) :: above(s%nx), viscous(s%nx), p_rate(s%nx)

    call foundation_rate(s, q(LB, UZ), q(LB, VZ), p_rate)
    call friction_powers(s%law, s%nx, s%n, s%at, mode, memory, q(LB, UX), q(LB, VX), w%p, p_rate, w%f, above, viscous)
    budget%above = budget%above + c*above
    budget%viscous = budget%viscous + c*viscous
  end subroutine parts_of_heat
end module pyfric_rows
