!> State variables of the junctions of a block: saved numbers of each junction, and derived quantities.
!>
!> A stage needs only the number of pinned junctions and the sum of their anchors. The sum is computed anew, in the order of
!> junctions, whenever a junction breaks or pins. The bits of the sum therefore do not depend on the history.
module pyfric_junction_memory
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: n_saved, n_whole, prepare

  !> Indices of the numbers saved for each junction: anchor [m]; 1 if pinned, 0 if slipping; time at which the junction pins or
  !> pinned [s]; number of breaks.
  integer, parameter, public :: ANCHOR = 1, PINNED = 2, RELEASE = 3, BREAKS = 4, N_PARTS = 4, N_SUMS = 8
  !> Indices of derived quantities. Of pinned junctions: their number; sum, mean, sum of squared deviations, smallest and largest of
  !> their anchors. Of slipping junctions: time at which the first pins; their number. Anchors and indices of slipping junctions
  !> follow.
  integer, parameter, public :: COUNT = 1, TOTAL = 2, CENTRE = 3, SQUARES = 4, LEAST = 5, GREATEST = 6, EARLIEST = 7, LOOSE = 8

contains

  !> How many numbers are saved for a block with n junctions.
  elemental function n_saved(n) result(numbers)
    integer, intent(in) :: n
    integer :: numbers

    numbers = N_PARTS*n
  end function n_saved

  !> How many numbers a block with n junctions has, including derived quantities.
  elemental function n_whole(n) result(numbers)
    integer, intent(in) :: n
    integer :: numbers

    numbers = n_saved(n) + N_SUMS + 2*n
  end function n_whole

  !> Computes the derived quantities of a block from its saved numbers.
  pure subroutine prepare(n, memory)
    integer, intent(in) :: n
    real(dp), intent(inout) :: memory(n_whole(n))
    integer :: s

    s = n_saved(n)
    call summarise(n, memory(:s), memory(s + 1:s + N_SUMS), memory(s + N_SUMS + 1:s + N_SUMS + n), memory(s + N_SUMS + n + 1:))
  end subroutine prepare

  !> Computes sums over the pinned junctions, in their order, and lists the slipping junctions.
  pure subroutine summarise(n, saved, sums, loose_anchors, loose_numbers)
    integer, intent(in) :: n
    real(dp), intent(in) :: saved(n, N_PARTS)
    real(dp), intent(out) :: sums(N_SUMS)
    real(dp), intent(inout) :: loose_anchors(n)   !! anchors of slipping junctions [m]
    real(dp), intent(inout) :: loose_numbers(n)
    integer :: j, m

    sums = 0.0_dp
    sums(LEAST) = huge(1.0_dp)
    sums(GREATEST) = -huge(1.0_dp)
    sums(EARLIEST) = huge(1.0_dp)
    m = 0
    do j = 1, n
      if (saved(j, PINNED) > 0.0_dp) then
        sums(COUNT) = sums(COUNT) + 1.0_dp
        sums(TOTAL) = sums(TOTAL) + saved(j, ANCHOR)
        sums(LEAST) = min(sums(LEAST), saved(j, ANCHOR))
        sums(GREATEST) = max(sums(GREATEST), saved(j, ANCHOR))
      else
        m = m + 1
        loose_anchors(m) = saved(j, ANCHOR)
        loose_numbers(m) = j
        sums(EARLIEST) = min(sums(EARLIEST), saved(j, RELEASE))
      end if
    end do
    sums(LOOSE) = m
    if (m == n) return
    sums(CENTRE) = sums(TOTAL)/sums(COUNT)
    do j = 1, n
      if (saved(j, PINNED) > 0.0_dp) sums(SQUARES) = sums(SQUARES) + (saved(j, ANCHOR) - sums(CENTRE))**2
    end do
  end subroutine summarise
end module pyfric_junction_memory
