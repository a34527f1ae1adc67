!> What never changes during a run: lattice, boundaries, friction coefficients.
module pyfric_model
  use pyfric_kinds, only: dp, ip
  implicit none (type, external)
  private
  public :: model_t, new_model, S_SERIES, close_left, close_row, close_state, N_CONSTANTS, UX, UZ, VX, VZ, LB, LANES

  integer(ip), parameter :: N_CONSTANTS = 20
  !> Fields of one row of the state.
  integer, parameter :: UX = 1, UZ = 2, VX = 3, VZ = 4
  !> Inside the core a row is cut into LANES pieces of equal length, interleaved: block i of piece c is element
  !> c + (i - 1) LANES of a row with bounds LB:n+LANES. Neighbours are then LANES elements apart, so that loops over
  !> 1:n work on whole, aligned vectors. Elements LB:0 and n+1: repeat the ends of the next pieces (`close_row`). Beyond
  !> the last block the row is filled up with blocks at rest.
  integer, parameter :: LANES = 4, LB = 1 - LANES

  !> Up to this |s|, s = (r/l0)^2 - 1, the series of 1 - l0/r is exact to machine precision.
  real(dp), parameter :: S_SERIES = 2.0_dp**(-7)

  type :: model_t
    integer :: nx           !! blocks along the interface
    integer :: nz           !! rows
    integer :: n            !! nx rounded up to LANES
    integer, allocatable :: at(:)   !! element of block i in a row, for i up to n; filling beyond nx
    logical :: finite       !! finite geometry (bonds rotate); else linear
    logical :: rigid        !! top row glued to the rod (setup 1); else free (setup 2)
    integer :: i_h          !! column of the driven block
    integer :: j_h          !! row of the driven block
    real(dp) :: l           !! lattice constant [m]
    real(dp) :: k           !! stiffness of nearest-neighbour springs [N/m]; diagonals have k/2
    real(dp) :: eta         !! bond viscosity [N s/m]
    real(dp) :: m           !! block mass [kg]
    real(dp) :: k_f         !! foundation stiffness [N/m]
    real(dp) :: mu_s        !! static friction coefficient [-]
    real(dp) :: mu_k        !! kinetic friction coefficient [-]
    real(dp) :: mu_0        !! friction coefficient where slip begins: mu_s, or mu_k without weakening [-]
    real(dp) :: drop        !! its loss per slip, (mu_s - mu_k)/d_c, or 0 without weakening [1/m]
    real(dp) :: f_n         !! normal force at the rod's centre [N]
    real(dp) :: m_rod       !! mass of the rod alone [kg]
    real(dp) :: i_rod       !! inertia of the rod alone [kg m2]
    real(dp) :: m_top       !! mass of rod and top row [kg]
    real(dp) :: i_top       !! inertia of rod and top row about the centre [kg m2]
    real(dp) :: kappa       !! torque of the mattress per tilt [N m]
    real(dp) :: d           !! direction in which the driver pushes: +1 or -1
    real(dp) :: k_drv       !! driver stiffness K [N/m]
    real(dp) :: v_drv       !! driver speed V [m/s]
    real(dp) :: u_drv0      !! u_x of the driven block at which F_T = 0 at t = 0 [m]
    real(dp) :: near(7)     !! series of a spring of length l, see `series` [N/m^(2n+1)], n = 1...
    real(dp) :: diagonal(7) !! the same for length sqrt(2) l
    real(dp) :: p_corner    !! slip that starts below this p is a corner episode [N]
    real(dp) :: k_top       !! stiffness that holds each block of a free top row at u_x = 0 [N/m]
    logical :: sheared      !! shear or k_top is not zero
    real(dp), allocatable :: x(:)     !! block positions from the centre [m]
    real(dp), allocatable :: load(:)  !! downward load on a free top row [N]
    real(dp), allocatable :: shear(:) !! constant force on a free top row, along +x [N]
  end type model_t

contains

  !> The model from the plain arrays that Python passes (order: pyfric.core.model).
  pure function new_model(nx, nz, finite, rigid, i_h, j_h, c, x, load, shear) result(s)
    integer(ip), intent(in) :: nx               !! blocks along the interface
    integer(ip), intent(in) :: nz               !! rows
    integer(ip), intent(in) :: finite           !! 1: finite geometry, 0: linear
    integer(ip), intent(in) :: rigid            !! 1: rod, 0: free top row
    integer(ip), intent(in) :: i_h              !! column of the driven block, from 1
    integer(ip), intent(in) :: j_h              !! row of the driven block, from 1
    real(dp), intent(in) :: c(N_CONSTANTS)      !! constants [SI]
    real(dp), intent(in) :: x(nx)               !! positions from the centre [m]
    real(dp), intent(in) :: load(nx)            !! downward load on the top row [N]
    real(dp), intent(in) :: shear(nx)           !! horizontal force on the top row [N]
    type(model_t) :: s
    integer :: i, m

    s%nx = nx
    s%nz = nz
    s%n = LANES*((nx + LANES - 1)/LANES)
    m = s%n/LANES
    s%at = [(1 + mod(i - 1, m)*LANES + (i - 1)/m, i=1, s%n)]
    s%finite = finite == 1
    s%rigid = rigid == 1
    s%i_h = i_h
    s%j_h = j_h
    s%l = c(1)
    s%k = c(2)
    s%eta = c(3)
    s%m = c(4)
    s%k_f = c(5)
    s%mu_s = c(6)
    s%mu_k = c(7)
    s%f_n = c(8)
    s%m_rod = c(9)
    s%i_rod = c(10)
    s%m_top = c(11)
    s%i_top = c(12)
    s%kappa = c(13)
    s%d = c(14)
    s%k_drv = c(15)
    s%v_drv = c(16)
    s%u_drv0 = c(17)
    s%p_corner = c(18)
    s%k_top = c(19)
    s%mu_0 = merge(s%mu_s, s%mu_k, c(20) > 0.0_dp)
    s%drop = 0.0_dp
    if (c(20) > 0.0_dp) s%drop = (s%mu_s - s%mu_k)/c(20)
    s%near = series(s%k, s%l**2)
    s%diagonal = series(0.5_dp*s%k, 2.0_dp*s%l**2)
    s%x = x
    s%load = load
    s%shear = shear
    s%sheared = s%k_top > 0.0_dp .or. any(abs(shear) > 0.0_dp)
  end function new_model

  !> Coefficients c_n of k (r - l0)/r = sum of c_n t^n, n = 1..7, in t = r^2 - l0^2 = 2 d.du + |du|^2.
  !>
  !> With s = t/l0^2, (r - l0)/r = 1 - (1 + s)^(-1/2), whose Taylor coefficients are -(-1)^n (2n-1)!!/(2n)!!. The term
  !> n = 8 is spread over lower ones by the Chebyshev polynomial T_7(s/S_SERIES), which leaves 1e-17 of the sum.
  pure function series(k, l2) result(c)
    real(dp), intent(in) :: k   !! stiffness of the bond [N/m]
    real(dp), intent(in) :: l2  !! its length squared [m2]
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

  !> Repeats the ends of the pieces of a row on its left, or on both sides; at the walls there is nothing.
  !> Element by element: these were stored as vectors just before, and only parts of one of them can be read at once.
  pure subroutine close_left(n, q)
    integer, intent(in) :: n                    !! length of a row
    real(dp), intent(inout) :: q(LB:n + LANES)  !! one field of it
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
    real(dp), intent(inout) :: q(LB:n + LANES)  !! one field of it
    integer :: i

    call close_left(n, q)
    !GCC$ novector
    !GCC$ unroll 8
    do i = 2, LANES
      q(n + i - 1) = q(i)
    end do
    q(n + LANES) = 0.0_dp
  end subroutine close_row

  !> Closes a row of the state. In finite geometry the filling follows the last block: no bond there is strained.
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
  end subroutine close_state
end module pyfric_model
