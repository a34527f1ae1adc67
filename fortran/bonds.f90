!> The table of the bonds of the lattice, from which forces, energies and powers follow.
!>
!> A bond leads from its first block to its second block, and belongs to the column and row of one of these blocks. Each column
!> and row has the same bonds. Sums add a bond and its mirror image first, so that a mirrored lattice gives the mirrored bits.
module pyfric_bonds
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: bond_t, BONDS, N_BOND, BESIDE, ABOVE, RIGHT, LEFT, weights_t, SPRINGS, DASHPOTS

  type :: bond_t
    integer :: first        !! columns from the column to which the bond belongs, to its first block
    integer :: second       !! columns from this column to its second block
    integer :: rows         !! rows from the first to the second block
    real(dp) :: d(2)        !! reference vector, over l
    real(dp) :: stiffness   !! over k
  end type bond_t

  !> Bonds to nearest neighbours, and to next-nearest neighbours, which are mirror images of each other. Modules that have to be
  !> fast have their own copy of the table, so that the compiler knows its numbers.
  integer, parameter :: BESIDE = 1, ABOVE = 2, RIGHT = 3, LEFT = 4, N_BOND = 4
  type(bond_t), parameter :: BONDS(N_BOND) = [ &
    bond_t(0, 1, 0, [1.0_dp, 0.0_dp], 1.0_dp), &
    bond_t(0, 0, 1, [0.0_dp, 1.0_dp], 1.0_dp), &
    bond_t(0, 1, 1, [1.0_dp, 1.0_dp], 0.5_dp), &
    bond_t(1, 0, 1, [-1.0_dp, 1.0_dp], 0.5_dp)]

  !> Weights 4 c n n^T of the neighbours of a block, n = d/|d|, c = 1 or the stiffness over k.
  type :: weights_t
    real(dp) :: beside  !! x from x of the blocks beside it
    real(dp) :: above   !! z from z of the blocks above and below
    real(dp) :: corner  !! x from x, and z from z, of the blocks at the corners
    real(dp) :: cross   !! x from z, and z from x, of the blocks at the corners
  end type weights_t

  type(weights_t), parameter :: DASHPOTS = weights_t( &
    4.0_dp*BONDS(BESIDE)%d(1)**2/sum(BONDS(BESIDE)%d**2), &
    4.0_dp*BONDS(ABOVE)%d(2)**2/sum(BONDS(ABOVE)%d**2), &
    4.0_dp*BONDS(RIGHT)%d(1)**2/sum(BONDS(RIGHT)%d**2), &
    4.0_dp*product(BONDS(RIGHT)%d)/sum(BONDS(RIGHT)%d**2))
  type(weights_t), parameter :: SPRINGS = weights_t( &
    BONDS(BESIDE)%stiffness*DASHPOTS%beside, &
    BONDS(ABOVE)%stiffness*DASHPOTS%above, &
    BONDS(RIGHT)%stiffness*DASHPOTS%corner, &
    BONDS(RIGHT)%stiffness*DASHPOTS%cross)
end module pyfric_bonds
