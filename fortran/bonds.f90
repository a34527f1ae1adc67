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
    integer :: first        !! column of the first block, minus the column to which the bond belongs
    integer :: second       !! column of the second block, minus the column to which the bond belongs
    integer :: rows         !! row of the second block, minus the row of the first block
    real(dp) :: d(2)        !! vector from the first to the second block of the unloaded lattice, over l
    real(dp) :: stiffness   !! stiffness of the spring, over k
  end type bond_t

  !> Bonds to nearest neighbours and to next-nearest neighbours. Bonds to next-nearest neighbours are mirror images of each other.
  !> Modules that have to be fast have a copy of the table, so that its numbers are known to the compiler.
  integer, parameter :: BESIDE = 1, ABOVE = 2, RIGHT = 3, LEFT = 4, N_BOND = 4
  type(bond_t), parameter :: BONDS(N_BOND) = [ &
    bond_t(0, 1, 0, [1.0_dp, 0.0_dp], 1.0_dp), &
    bond_t(0, 0, 1, [0.0_dp, 1.0_dp], 1.0_dp), &
    bond_t(0, 1, 1, [1.0_dp, 1.0_dp], 0.5_dp), &
    bond_t(1, 0, 1, [-1.0_dp, 1.0_dp], 0.5_dp)]

  !> Weights 4 c n n^T of the neighbours of a block, with n = d/|d|. c is 1, or the stiffness over k.
  type :: weights_t
    real(dp) :: beside  !! force x by displacement x of the blocks beside the block
    real(dp) :: above   !! force z by displacement z of the blocks above and below
    real(dp) :: corner  !! force x by displacement x, and z by z, of the blocks at the corners
    real(dp) :: cross   !! force x by displacement z, and z by x, of the blocks at the corners
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
