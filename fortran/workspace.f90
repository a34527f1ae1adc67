!> Work space of steps: rows with bounds LB:n+LANES, whose first block is aligned to a vector of LANES elements.
module pyfric_workspace
  use, intrinsic :: iso_c_binding, only: c_loc, c_intptr_t
  use pyfric_kinds, only: dp
  use pyfric_layout, only: LB, LANES
  use pyfric_model, only: model_t, close_state
  use pyfric_bonds, only: N_BOND
  implicit none (type, external)
  private
  public :: reserve, aligned, widen, narrow
  public :: MAX_STAGES, RINGS, FX, FZ, CARRY, BONDS, COLUMNS

  integer, parameter :: MAX_STAGES = 6  !! largest number of stages of a stepper
  !> First columns of the parts of a thread's work space work(LB:n+LANES, COLUMNS). RINGS: rows of each stage after the first, whose
  !> number is the number of stages plus 1. Row j is last needed by the last stage of row j, and the two bottom rows until switches
  !> are located. CARRY, in finite geometry: forces on the row above, two for each stage [N]. BONDS: forces of bonds [N]. FX and FZ:
  !> forces on a row [N].
  integer, parameter :: RINGS = 1, CARRY = RINGS + 4*(MAX_STAGES + 1)*(MAX_STAGES - 1), BONDS = CARRY + 2*MAX_STAGES, &
    FX = BONDS + 2*N_BOND, FZ = FX + 1, COLUMNS = FZ

contains

  !> Allocates n_rows rows for each thread, and `aligned` additional elements.
  pure subroutine reserve(s, n_rows, n_threads, memory, complete)
    type(model_t), intent(in) :: s
    integer, intent(in) :: n_rows                          !! number of rows of a single field
    integer, intent(in) :: n_threads
    real(dp), allocatable, intent(out) :: memory(:, :)
    logical, intent(inout) :: complete                     !! becomes false without memory
    integer :: failed

    allocate (memory((s%n + 2*LANES)*n_rows + LANES, n_threads), stat=failed)
    complete = complete .and. failed == 0
  end subroutine reserve

  !> Index of the first element of the array a that is aligned to a vector of LANES elements.
  function aligned(a) result(at)
    real(dp), intent(in), target :: a(:)
    integer :: at
    integer(c_intptr_t) :: first

    first = transfer(c_loc(a), first)/8
    at = 1 + int(modulo(-first, int(LANES, c_intptr_t)))
  end function aligned

  !> Copies the state to rows of bounds LB:n+LANES.
  pure subroutine widen(s, y, wide)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: y(s%nx, 4, s%nz)               !! state
    real(dp), intent(out) :: wide(LB:s%n + LANES, 4, s%nz)     !! state in such rows
    integer :: j

    wide = 0.0_dp
    wide(s%at(:s%nx), :, :) = y
    do j = 1, s%nz
      call close_state(s, wide(LB, 1, j))
    end do
  end subroutine widen

  !> Copies the state back from rows of bounds LB:n+LANES.
  pure subroutine narrow(s, wide, y)
    type(model_t), intent(in) :: s
    real(dp), intent(in) :: wide(LB:s%n + LANES, 4, s%nz)      !! state
    real(dp), intent(out) :: y(s%nx, 4, s%nz)              !! state without padding

    y = wide(s%at(:s%nx), :, :)
  end subroutine narrow
end module pyfric_workspace
