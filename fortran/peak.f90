!> Additions at the largest rate of this processor, to which the speed of the core is compared.
module pyfric_peak
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: additions, WIDTH

  integer, parameter :: WIDTH = 32  !! number of sums, which hide the latency and stay in registers

contains

  !> Adds steps(i) to sum i, n times. Sums stay in registers.
  pure subroutine additions(n, steps, total)
    integer, intent(in) :: n                  !! additions to each sum
    real(dp), intent(in) :: steps(WIDTH)      !! number that is added to each sum
    real(dp), intent(out) :: total            !! sum of all results
    real(dp) :: sums(WIDTH)
    integer :: i, k

    sums = 0.0_dp
    do k = 1, n
      !GCC$ unroll 32
      do i = 1, WIDTH
        sums(i) = sums(i) + steps(i)
      end do
    end do
    total = sum(sums)
  end subroutine additions
end module pyfric_peak
