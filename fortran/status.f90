!> Status codes of the core, as in pyfric.core.Status.
module pyfric_status
  use pyfric_kinds, only: ip
  implicit none (type, external)
  private
  public :: DONE, LOG_FULL, ENDLESS, TOO_SHORT, NO_MEMORY, STRAINED, UNKNOWN_LAW
  public :: PAUSED, UNSETTLED, IDLE, GROWS, AMBIGUOUS, UNSUPPORTED, UNHELD

  integer(ip), parameter :: DONE = 0       !! all steps were made
  integer(ip), parameter :: LOG_FULL = 1   !! stopped early: the log has no room for one more step
  integer(ip), parameter :: ENDLESS = 2    !! stopped inside a step: contacts switch too often in this step
  integer(ip), parameter :: TOO_SHORT = 3  !! stopped inside a step: the error of this step stays too large
  integer(ip), parameter :: NO_MEMORY = 4  !! nothing was done: memory could not be allocated
  integer(ip), parameter :: STRAINED = 5   !! stopped early, after a step: a cell may be turned inside out
  integer(ip), parameter :: UNKNOWN_LAW = 13 !! nothing was done: the friction law is not known
  !> Codes of quasi-static sequences, which also use DONE, LOG_FULL and NO_MEMORY.
  integer(ip), parameter :: PAUSED = 6       !! stopped early: the number of changes asked for was made
  integer(ip), parameter :: UNSETTLED = 7    !! contact states do not settle
  integer(ip), parameter :: IDLE = 8         !! slip goes on without end, in events of no length
  integer(ip), parameter :: GROWS = 9        !! the growth of the slipping zone does not end
  integer(ip), parameter :: AMBIGUOUS = 10   !! slip may not be unique from here on
  integer(ip), parameter :: UNSUPPORTED = 11 !! the slider is not supported
  integer(ip), parameter :: UNHELD = 12      !! the slider is not held by the blocks that stick
end module pyfric_status
