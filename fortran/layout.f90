!> Layout of a row of blocks in memory.
!>
!> Inside the core a row is cut into LANES pieces of equal length, which are interleaved. Block i of piece c is element
!> c + (i - 1) LANES of a row with bounds LB:n+LANES. Neighbours are then LANES elements apart, so that loops over 1:n
!> work on whole, aligned vectors. Elements below 1 and above n repeat the ends of the neighbouring pieces (`close_row`).
!> After the last block, the row is padded with blocks at rest.
module pyfric_layout
  implicit none (type, external)
  private
  public :: LANES, LB, UX, UZ, VX, VZ, padded, elements

  integer, parameter :: LANES = 4, LB = 1 - LANES
  !> Indices of the fields of a row of the state.
  integer, parameter :: UX = 1, UZ = 2, VX = 3, VZ = 4

contains

  !> Length of a row of nx blocks, a whole number of vectors.
  elemental function padded(nx) result(n)
    integer, intent(in) :: nx   !! number of blocks
    integer :: n

    n = LANES*((nx + LANES - 1)/LANES)
  end function padded

  !> Element of each block i = 1..n in a row. Elements of i above nx are padding.
  pure function elements(n) result(at)
    integer, intent(in) :: n   !! padded length of the row
    integer :: at(n), i, m

    m = n/LANES
    at = [(1 + mod(i - 1, m)*LANES + (i - 1)/m, i=1, n)]
  end function elements
end module pyfric_layout
