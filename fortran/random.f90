!> Random numbers as functions of a key and a counter, independent of number and order of earlier draws.
!>
!> Philox4x64-10: ten rounds of multiplication mix a counter of four words of 64 bits with a key of two words. A word is held as
!> four limbs of 16 bits, the lowest first, so that no integer overflows and every compiler gives the same bits.
!> J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, Proc. SC '11 (2011), doi:10.1145/2063384.2063405.
module pyfric_random
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_kinds, only: dp
  implicit none (type, external)
  private
  public :: uniforms

  integer, parameter :: BITS = 16, LIMBS = 4, WORDS = 4, ROUNDS = 10
  !> Factors of the two halves of the counter, and the increment of the key in each round.
  integer(int64), parameter :: FACTOR(LIMBS, 2) = reshape([integer(int64) :: &
    int(z'6C93'), int(z'E14C'), int(z'470E'), int(z'D2E7'), int(z'1157'), int(z'9512'), int(z'8263'), int(z'CA5A')], [LIMBS, 2])
  integer(int64), parameter :: GAIN(LIMBS, 2) = reshape([integer(int64) :: &
    int(z'7C15'), int(z'7F4A'), int(z'79B9'), int(z'9E37'), int(z'A73B'), int(z'84CA'), int(z'AE85'), int(z'BB67')], [LIMBS, 2])

contains

  !> n numbers in [0, 1): numpy.random.Philox(key=key, counter=counter).random_raw(n) >> 11, times 2^-53. The counter increases
  !> by one before each four numbers.
  pure function uniforms(key, counter, n) result(u)
    integer(int64), intent(in) :: key(2)          !! bits of unsigned words, the lowest first
    integer(int64), intent(in) :: counter(WORDS)  !! bits of unsigned words, the lowest first
    integer, intent(in) :: n                      !! how many numbers
    real(dp) :: u(n)
    integer(int64) :: now(LIMBS*WORDS), mixed(LIMBS, WORDS), of_key(LIMBS, 2)
    integer :: i, word

    of_key = in_limbs(key)
    mixed = in_limbs(counter)
    do i = 1, WORDS
      now(LIMBS*(i - 1) + 1:LIMBS*i) = mixed(:, i)
    end do
    do i = 1, n
      word = 1 + mod(i - 1, WORDS)
      if (word == 1) then
        now(1) = now(1) + 1
        now = carried(now)
        mixed = philox(of_key, now)
      end if
      u(i) = uniform(mixed(:, word))
    end do
  end function uniforms

  !> The counter after all rounds of mixing with the key.
  pure function philox(key, counter) result(mixed)
    integer(int64), intent(in) :: key(LIMBS, 2)
    integer(int64), intent(in) :: counter(LIMBS, WORDS)
    integer(int64) :: mixed(LIMBS, WORDS), of_round(LIMBS, 2), first(2*LIMBS), second(2*LIMBS)
    integer :: round

    of_round = key
    mixed = counter
    do round = 1, ROUNDS
      first = product_of(FACTOR(:, 1), mixed(:, 1))
      second = product_of(FACTOR(:, 2), mixed(:, 3))
      mixed(:, 1) = ieor(ieor(second(LIMBS + 1:), mixed(:, 2)), of_round(:, 1))
      mixed(:, 2) = second(:LIMBS)
      mixed(:, 3) = ieor(ieor(first(LIMBS + 1:), mixed(:, 4)), of_round(:, 2))
      mixed(:, 4) = first(:LIMBS)
      of_round(:, 1) = carried(of_round(:, 1) + GAIN(:, 1))
      of_round(:, 2) = carried(of_round(:, 2) + GAIN(:, 2))
    end do
  end function philox

  !> The exact product of two words a and b.
  pure function product_of(a, b) result(ab)
    integer(int64), intent(in) :: a(LIMBS)
    integer(int64), intent(in) :: b(LIMBS)
    integer(int64) :: ab(2*LIMBS)
    integer :: i

    ab = 0
    do i = 1, LIMBS
      ab(i:i + LIMBS - 1) = ab(i:i + LIMBS - 1) + a(i)*b
    end do
    ab = carried(ab)
  end function product_of

  !> Carries the excess of limbs above 16 bits to the next limb; the carry of the last limb is dropped.
  pure function carried(grown) result(number)
    integer(int64), intent(in) :: grown(:)
    integer(int64) :: number(size(grown)), carry
    integer :: i

    carry = 0
    do i = 1, size(grown)
      carry = carry + grown(i)
      number(i) = ibits(carry, 0, BITS)
      carry = shiftr(carry, BITS)
    end do
  end function carried

  !> Limbs of words.
  pure function in_limbs(word) result(split)
    integer(int64), intent(in) :: word(:)
    integer(int64) :: split(LIMBS, size(word))
    integer :: i

    do i = 1, LIMBS
      split(i, :) = ibits(word, BITS*(i - 1), BITS)
    end do
  end function in_limbs

  !> The upper 53 bits of a word, times 2^-53.
  pure function uniform(word) result(u)
    integer(int64), intent(in) :: word(LIMBS)
    real(dp) :: u

    u = real(shiftr(word(1), 11) + shiftl(word(2), 5) + shiftl(word(3), 21) + shiftl(word(4), 37), dp)*2.0_dp**(-53)
  end function uniform
end module pyfric_random
