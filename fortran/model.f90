!> What never changes during a run: lattice, boundaries, friction coefficients.
module pyfric_model
  use pyfric_kinds, only: dp, ip
  implicit none (type, external)
  private
  public :: model_t, new_model, N_CONSTANTS, UX, UZ, VX, VZ

  integer(ip), parameter :: N_CONSTANTS = 18
  !> Fields of one row of the state y(N_x, 4, N_z).
  integer, parameter :: UX = 1, UZ = 2, VX = 3, VZ = 4

  type :: model_t
    integer :: nx           !! blocks along the interface
    integer :: nz           !! rows
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
    real(dp) :: p_corner    !! slip that starts below this p is a corner episode [N]
    real(dp), allocatable :: x(:)     !! block positions from the centre [m]
    real(dp), allocatable :: load(:)  !! downward load on the top row, setup 2 [N]
  end type model_t

contains

  !> The model from the plain arrays that Python passes (order: pyfric.core.pack).
  pure function new_model(nx, nz, finite, rigid, i_h, j_h, c, x, load) result(s)
    integer(ip), intent(in) :: nx               !! blocks along the interface
    integer(ip), intent(in) :: nz               !! rows
    integer(ip), intent(in) :: finite           !! 1: finite geometry, 0: linear
    integer(ip), intent(in) :: rigid            !! 1: rod, 0: free top row
    integer(ip), intent(in) :: i_h              !! column of the driven block, from 1
    integer(ip), intent(in) :: j_h              !! row of the driven block, from 1
    real(dp), intent(in) :: c(N_CONSTANTS)      !! constants [SI]
    real(dp), intent(in) :: x(nx)               !! positions from the centre [m]
    real(dp), intent(in) :: load(nx)            !! downward load on the top row [N]
    type(model_t) :: s

    s%nx = nx
    s%nz = nz
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
    s%x = x
    s%load = load
  end function new_model
end module pyfric_model
