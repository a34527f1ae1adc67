!> The bonds of the lattice, as data: forces, energies and powers follow from this table.
!>
!> A bond leads from its first block to its second one, and belongs to the column and row of one of them. Each column and
!> row has the same bonds. Sums add a bond and its mirror image first, so that a mirrored lattice gives the mirrored bits.
module pyfric_bonds
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: bond_t, BONDS, N_BOND, BESIDE, ABOVE, RIGHT, LEFT, weights_t, SPRINGS, DASHPOTS

  type :: bond_t
    integer :: first        !! columns from the one that it counts to, to its first block
    integer :: second       !! columns to its second block
    integer :: rows         !! rows from the first to the second
    real(dp) :: d(2)        !! reference vector, over l
    real(dp) :: stiffness   !! over k
  end type bond_t

  !> Bonds to the nearest neighbours, and to the next-nearest ones, which are mirror images of each other. If speed matters,
  !> a module has a copy of the table, so that the compiler knows its numbers.
  integer, parameter :: BESIDE = 1, ABOVE = 2, RIGHT = 3, LEFT = 4, N_BOND = 4
  type(bond_t), parameter :: BONDS(N_BOND) = [ &
    bond_t(0, 1, 0, [1.0_dp, 0.0_dp], 1.0_dp), &
    bond_t(0, 0, 1, [0.0_dp, 1.0_dp], 1.0_dp), &
    bond_t(0, 1, 1, [1.0_dp, 1.0_dp], 0.5_dp), &
    bond_t(1, 0, 1, [-1.0_dp, 1.0_dp], 0.5_dp)]

  !> Weights 4 c n n^T of the neighbours of a block, n = d/|d|, c = 1 or the stiffness over k.
  type :: weights_t
    real(dp) :: beside  !! x from x of the blocks beside it
    real(dp) :: above   !! z from z of those above and below
    real(dp) :: corner  !! x from x, and z from z, of those at the corners
    real(dp) :: cross   !! x from z, and z from x, of those at the corners
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
