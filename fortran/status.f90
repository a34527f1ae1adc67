!> Codes that leave the core. The same list, with its messages, is pyfric.core.Status.
module pyfric_status
  use pyfric_kinds, only: ip
  implicit none (type, external)
  private
  public :: DONE, LOG_FULL, ENDLESS, TOO_SHORT, NO_MEMORY, STRAINED

  integer(ip), parameter :: DONE = 0       !! all steps were made
  integer(ip), parameter :: LOG_FULL = 1   !! stopped early: the log has no room for one more step
  integer(ip), parameter :: ENDLESS = 2    !! stopped inside a step: contacts switch too often in it
  integer(ip), parameter :: TOO_SHORT = 3  !! stopped inside a step: its error stays too large
  integer(ip), parameter :: NO_MEMORY = 4  !! nothing was done: its memory could not be allocated
  integer(ip), parameter :: STRAINED = 5   !! stopped early, after a step: a cell may be turned inside out
end module pyfric_status
