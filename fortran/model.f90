!> The constant part of a run: lattice, boundaries, friction law.
module pyfric_model
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES, UX, UZ, VX, VZ, padded, elements
  use pyfric_bonds, only: BONDS, N_BOND
  use pyfric_law, only: law_t, new_law
  implicit none (type, external)
  private
  public :: model_t, new_model, S_SERIES, close_left, close_row, close_state, reflected
  public :: FREE, MIRRORED, ABSORBING, HELD, row_share, column_shares, half_side, cut_sides, driven_number, driven_u

  !> Codes of boundary conditions at sides and top. Mirrored: half a bond beyond the side begins an image of the slider, with equal
  !> u_x and opposite u_z. Absorbing: dashpots with the impedances of plane waves. Held: the top row does not move.
  integer, parameter :: FREE = 0, MIRRORED = 1, ABSORBING = 2, HELD = 3

  !> Largest |s|, s = (r/l0)^2 - 1, for which the series of 1 - l0/r has machine precision.
  real(dp), parameter :: S_SERIES = 2.0_dp**(-7)

  !> Integers passed by Python, in this order, with the names of pyfric.core.Counts.
  type, bind(c) :: counts_t
    integer(ip) :: nx       !! blocks along the interface
    integer(ip) :: nz       !! rows
    integer(ip) :: finite   !! 1: finite geometry (bonds rotate), 0: linear
    integer(ip) :: rigid    !! 1: top row glued to the rod (setup 1), 0: free (setup 2)
    integer(ip) :: i_h      !! first column of driven blocks, from 1
    integer(ip) :: i_h_end  !! last column of driven blocks
    integer(ip) :: j_h      !! row of the lowest driven block, from 1
    integer(ip) :: j_h_top  !! row of the highest driven block
    integer(ip) :: prescribed !! 1: the interface has a given p and no foundation, 0: it has a foundation
    integer(ip) :: left     !! condition at the left side: FREE, MIRRORED or ABSORBING
    integer(ip) :: right    !! condition at the right side
    integer(ip) :: top      !! condition at the top, which can also be HELD
    integer(ip) :: along    !! 1: dashpots act along the bonds only, 0: on the full relative velocity
    integer(ip) :: law      !! friction law, see pyfric_law
    integer(ip) :: n_memory !! saved state variables of the law for each block
    integer(ip) :: n_own    !! how many other numbers the law has
    integer(ip) :: n_hold   !! number of knots of each table of the law
    integer(ip) :: n_slide
    integer(ip) :: n_speed
    integer(ip) :: n_age
    integer(ip) :: keeps    !! 1: slip in the friction law goes on after a stick
    integer(ip) :: halved   !! 1: blocks along free edges are half blocks
  end type counts_t

  !> Numbers passed by Python, in this order, with the names of pyfric.core.Constants. `new_model` reads all other numbers.
  type :: constants_t
    real(dp) :: l           !! lattice constant [m]
    real(dp) :: k           !! stiffness of nearest-neighbour springs [N/m]; diagonals have k/2
    real(dp) :: eta         !! bond viscosity [N s/m]
    real(dp) :: m           !! block mass [kg]
    real(dp) :: f_n         !! normal force at the rod's centre [N]
    real(dp) :: m_rod       !! mass of the rod alone [kg]
    real(dp) :: i_rod       !! inertia of the rod alone [kg m2]
    real(dp) :: m_top       !! mass of rod and top row [kg]
    real(dp) :: i_top       !! inertia of rod and top row about the centre [kg m2]
    real(dp) :: kappa       !! torque of the mattress per tilt [N m]
    real(dp) :: d           !! direction in which the driver pushes: +1 or -1
    real(dp) :: k_drv       !! stiffness of the driver on each driven block, K over their number [N/m]
    real(dp) :: v_drv       !! driver speed V at t_seg [m/s]
    real(dp) :: u_mean      !! mean u_x of the driven blocks at which F_T = 0 at t = 0 [m]
    real(dp) :: p_corner    !! p below which a start of slip is a corner episode [N]
    real(dp) :: k_top       !! stiffness that holds each block of a free top row at u_x = 0 [N/m]
    real(dp) :: t_seg       !! start of the piece of the protocol that is being run [s]
    real(dp) :: x_drv       !! position of the driver at t_seg [m]
    real(dp) :: a_drv       !! acceleration of the driver [m/s2]
    real(dp) :: load_rate   !! rate of F_N over F_N at t_seg [1/s]
    real(dp) :: shear_rate  !! rate of the force on each block of a free top row, along +x [N/s]
    real(dp) :: g           !! gravity, downward [m/s2]
  end type constants_t

  type, extends(constants_t) :: model_t
    logical :: complete = .false.   !! whether memory was allocated, and the friction law is known
    integer :: nx           !! blocks along the interface
    integer :: nz           !! rows
    integer :: n            !! nx rounded up to a multiple of LANES
    integer, allocatable :: at(:)   !! element of each block i = 1..n in a row; padding for i above nx
    logical :: finite       !! whether geometry is finite (bonds rotate) or linear
    logical :: rigid        !! whether the top row is glued to the rod (setup 1) or free (setup 2)
    integer :: i_h          !! first column of driven blocks
    integer :: i_h_end      !! last column of driven blocks
    integer :: n_driven     !! number of driven blocks
    integer :: j_h          !! row of the lowest driven block
    integer :: j_h_top      !! row of the highest driven block
    logical :: prescribed   !! whether the interface has no foundation, with `load` as p
    integer :: left         !! boundary condition at the left side; the next two: right side, top
    integer :: right
    integer :: top
    logical :: along        !! whether dashpots act only along the bonds
    integer :: j_shear      !! row on which shear acts
    logical :: halved       !! whether blocks along free edges are half blocks
    logical :: has_halves   !! whether there can be half blocks
    real(dp) :: z_p         !! impedance of a block to longitudinal waves, rho c_P times its face [N s/m]
    real(dp) :: z_s         !! impedance of a block to shear waves [N s/m]
    type(law_t) :: law      !! friction under the bottom row
    real(dp) :: series(7, N_BOND) !! coefficients of each bond's spring in finite geometry, see `series` [N/m^(2n+1)], n = 1...
    logical :: sheared      !! whether shear, its rate or k_top is not zero
    logical :: pushed       !! whether push or its rate is not zero
    real(dp), allocatable :: u_drv0(:) !! u_x of the driven blocks, row by row, at which their springs are relaxed at t = 0 [m]
    real(dp), allocatable :: k_f(:)   !! foundation stiffness, 0 under blocks without contact [N/m]
    real(dp), allocatable :: gap(:)   !! height of blocks above the foundation at u_z = 0 [m]
    real(dp), allocatable :: x(:)     !! block positions from the centre [m]
    real(dp), allocatable :: load(:)  !! downward load on a free top row, or prescribed p [N]
    real(dp), allocatable :: shear(:) !! constant force on row j_shear, along +x [N]
    real(dp), allocatable :: push(:)  !! force on the bottom row at t_seg, along +x [N]
    real(dp), allocatable :: push_rate(:) !! rate of push [N/s]
  end type model_t

contains

  !> The model from the plain arrays that Python passes.
  pure function new_model(counts, numbers) result(s)
    integer(ip), contiguous, intent(in) :: counts(:)   !! see counts_t
    real(dp), contiguous, intent(in) :: numbers(:)     !! see constants_t; u_drv0 of each driven block minus their mean [m];
                                                       !! see take_rows
    type(model_t) :: s
    type(counts_t) :: n
    integer :: first, last, failed

    n = transfer(counts, n)
    s%nx = n%nx
    s%nz = n%nz
    s%n = padded(s%nx)
    s%finite = n%finite == 1
    s%rigid = n%rigid == 1
    s%i_h = n%i_h
    s%i_h_end = n%i_h_end
    s%j_h = n%j_h
    s%j_h_top = n%j_h_top
    s%n_driven = (s%i_h_end - s%i_h + 1)*(s%j_h_top - s%j_h + 1)
    s%prescribed = n%prescribed == 1
    s%left = n%left
    s%right = n%right
    s%top = n%top
    s%along = n%along == 1
    s%halved = n%halved == 1
    s%has_halves = s%halved .or. s%prescribed
    s%j_shear = merge(1, s%nz, s%prescribed)
    first = storage_size(s%constants_t)/storage_size(s%l)
    s%constants_t = transfer(numbers(:first), s%constants_t)
    call derive(s)
    last = first + s%n_driven
    allocate (s%at(s%n), s%u_drv0(s%n_driven), stat=failed)
    if (failed /= 0) return
    s%at(:) = elements(s%n)
    s%u_drv0(:) = s%u_mean + numbers(first + 1:last)
    call take_rows(numbers(last + 1:), n, s)
    if (.not. s%complete) return
    s%sheared = s%k_top > 0.0_dp .or. abs(s%shear_rate) > 0.0_dp .or. any(abs(s%shear) > 0.0_dp)
    s%pushed = any(abs(s%push) > 0.0_dp) .or. any(abs(s%push_rate) > 0.0_dp)
  end function new_model

  !> Reads rows of N_x numbers: x [m], load, shear and push [N], rate of push [N/s], k_f [N/m], gap [m]; then rows of the law.
  pure subroutine take_rows(numbers, n, s)
    real(dp), contiguous, intent(in) :: numbers(:)
    type(counts_t), intent(in) :: n
    type(model_t), intent(inout) :: s
    integer, parameter :: ROWS = 7
    integer :: nx, failed

    nx = s%nx
    allocate (s%x(nx), s%load(nx), s%shear(nx), s%push(nx), s%push_rate(nx), s%k_f(nx), s%gap(nx), stat=failed)
    if (failed /= 0) return
    s%x(:) = numbers(:nx)
    s%load(:) = numbers(nx + 1:2*nx)
    s%shear(:) = numbers(2*nx + 1:3*nx)
    s%push(:) = numbers(3*nx + 1:4*nx)
    s%push_rate(:) = numbers(4*nx + 1:5*nx)
    s%k_f(:) = numbers(5*nx + 1:6*nx)
    s%gap(:) = numbers(6*nx + 1:7*nx)
    s%law = new_law(nx, n%law, n%n_memory, s%i_h > 1, n%keeps == 1, s%t_seg, n%n_own, &
                    [n%n_hold, n%n_slide, n%n_speed, n%n_age], numbers(ROWS*nx + 1:))
    s%complete = s%law%complete
  end subroutine take_rows

  !> Computes constants from others: impedances of a block, and springs in finite geometry.
  pure subroutine derive(s)
    type(model_t), intent(inout) :: s
    integer :: b

    s%z_p = sqrt(1.5_dp*s%k*s%m)
    s%z_s = sqrt(0.5_dp*s%k*s%m)
    do b = 1, N_BOND
      s%series(:, b) = series(BONDS(b)%stiffness*s%k, sum(BONDS(b)%d**2)*s%l**2)
    end do
  end subroutine derive

  !> Number of the driven block in column i and row j; driven blocks are counted row by row.
  elemental function driven_number(s, i, j) result(b)
    type(model_t), intent(in) :: s
    integer, intent(in) :: i   !! column
    integer, intent(in) :: j   !! row
    integer :: b

    b = (j - s%j_h)*(s%i_h_end - s%i_h + 1) + i - s%i_h + 1
  end function driven_number

  !> u_x of the driven blocks, row by row [m].
  pure function driven_u(s, y) result(u_x)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: y(LB:s%n + LANES, 4, s%nz)  !! state
    real(dp) :: u_x(s%n_driven)
    integer :: i, j

    do j = s%j_h, s%j_h_top
      do i = s%i_h, s%i_h_end
        u_x(driven_number(s, i, j)) = y(s%at(i), UX, j)
      end do
    end do
  end function driven_u

  !> Height of the blocks of row j over l: one half at a prescribed interface, at an absorbing top, and at halved edges; else 1.
  pure function row_share(s, j) result(c)
    type(model_t), intent(in) :: s
    integer, intent(in) :: j  !! row, from 1 at the bottom
    real(dp) :: c

    c = 1.0_dp
    if (j == 1 .and. (s%prescribed .or. s%halved .and. s%nz > 1)) c = 0.5_dp
    if (j == s%nz .and. s%nz > 1 .and. (s%top == ABSORBING .or. s%halved .and. s%top /= MIRRORED)) c = 0.5_dp
  end function row_share

  !> Width of the blocks of each column over l: one half at absorbing sides and at halved edges; else 1.
  pure function column_shares(s) result(c)
    type(model_t), intent(in) :: s
    real(dp) :: c(s%nx)

    c = 1.0_dp
    if (half_side(s, s%left)) c(1) = 0.5_dp
    if (half_side(s, s%right)) c(s%nx) = 0.5_dp
  end function column_shares

  !> Whether a side has half blocks.
  pure function cut_sides(s) result(yes)
    type(model_t), intent(in) :: s
    logical :: yes

    yes = half_side(s, s%left) .or. half_side(s, s%right)
  end function cut_sides

  !> Whether a side with this boundary condition has half blocks.
  pure function half_side(s, side) result(yes)
    type(model_t), intent(in) :: s
    integer, intent(in) :: side
    logical :: yes

    yes = side == ABSORBING .or. s%halved .and. side /= MIRRORED
  end function half_side

  !> Coefficients c_n of k (r - l0)/r = sum of c_n t^n, n = 1..7, in t = r^2 - l0^2 = 2 d.du + |du|^2.
  !>
  !> With s = t/l0^2, (r - l0)/r = 1 - (1 + s)^(-1/2), whose Taylor coefficients are -(-1)^n (2n-1)!!/(2n)!!. The Chebyshev
  !> polynomial T_7(s/S_SERIES) replaces the term n = 8 by lower terms. The error is 1e-17 of the sum.
  pure function series(k, l2) result(c)
    real(dp), intent(in) :: k   !! stiffness of the bond [N/m]
    real(dp), intent(in) :: l2  !! square of the length of the bond [m2]
    real(dp) :: c(7), taylor(8)
    integer :: n

    taylor(1) = 0.5_dp
    do n = 2, 8
      taylor(n) = -taylor(n - 1)*real(2*n - 1, dp)/real(2*n, dp)
    end do
    c = taylor(:7)
    c(6) = c(6) + taylor(8)*S_SERIES**2*1.75_dp
    c(4) = c(4) - taylor(8)*S_SERIES**4*0.875_dp
    c(2) = c(2) + taylor(8)*S_SERIES**6*0.109375_dp
    do n = 1, 7
      c(n) = k*c(n)/l2**n
    end do
  end function series

  !> Repeats the ends of the pieces of a row on the left, or on both sides, with zeros at the walls. Elements are copied one by one,
  !> because it is slow to read parts of vectors that were just stored.
  pure subroutine close_left(n, q)
    integer, intent(in) :: n                    !! length of a row
    real(dp), intent(inout) :: q(LB:n + LANES)  !! one field of the row
    integer :: i

    q(LB) = 0.0_dp
    !GCC$ novector
    !GCC$ unroll 8
    do i = LB + 1, 0
      q(i) = q(n + i - 1)
    end do
  end subroutine close_left

  pure subroutine close_row(n, q)
    integer, intent(in) :: n                    !! length of a row
    real(dp), intent(inout) :: q(LB:n + LANES)  !! one field of the row
    integer :: i

    call close_left(n, q)
    !GCC$ novector
    !GCC$ unroll 8
    do i = 2, LANES
      q(n + i - 1) = q(i)
    end do
    q(n + LANES) = 0.0_dp
  end subroutine close_row

  !> Image of a block at a mirrored side or top: the same u_x and v_x, the opposite u_z and v_z.
  pure function reflected(block) result(q)
    real(dp), intent(in) :: block(4)
    real(dp) :: q(4)

    q = [block(UX), -block(UZ), block(VX), -block(VZ)]
  end function reflected

  !> Closes a row of the state. In finite geometry the padding moves with the last block, so that its bonds have no strain.
  !> Beyond a mirrored side is the image of the last block.
  pure subroutine close_state(s, q)
    type(model_t), intent(in) :: s
    real(dp), intent(inout) :: q(LB:s%n + LANES, 4)  !! the row
    integer :: i

    if (s%finite) then
      do i = s%nx + 1, s%n
        q(s%at(i), UX) = q(s%at(s%nx), UX)
        q(s%at(i), UZ) = q(s%at(s%nx), UZ)
      end do
    end if
    do i = UX, VZ
      call close_row(s%n, q(LB, i))
    end do
    if (s%finite) q(s%n + LANES, UX:UZ) = q(s%at(s%nx), UX:UZ)
    if (s%left == MIRRORED) q(LB, :) = reflected(q(1, :))
    if (s%right == MIRRORED) q(s%at(s%nx) + LANES, :) = reflected(q(s%at(s%nx), :))
  end subroutine close_state
end module pyfric_model
