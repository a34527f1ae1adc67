"""Status codes of the core."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """Status codes of the core (pyfric_status in Fortran)."""

    DONE = 0  # all steps were made
    LOG_FULL = 1  # stopped early: the log has no room for one more step
    ENDLESS = 2  # stopped inside a step: contacts switch too often in this step
    TOO_SHORT = 3  # stopped inside a step: the error of this step stays too large
    NO_MEMORY = 4  # nothing was done: memory could not be allocated
    STRAINED = 5  # stopped early, after a step: a cell may be turned inside out
    UNKNOWN_LAW = 13  # nothing was done: the friction law is not known
    # the codes below belong to quasi-static sequences
    PAUSED = 6  # stopped early: the number of changes asked for was made
    UNSETTLED = 7  # contact states do not settle
    IDLE = 8  # slip goes on without end, in events of no length
    GROWS = 9  # the growth of the slipping zone does not end
    AMBIGUOUS = 10  # slip may not be unique from here on
    UNSUPPORTED = 11  # the slider is not supported
    UNHELD = 12  # the slider is not held by the blocks that stick
