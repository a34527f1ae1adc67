"""Status codes of the core."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """Status codes of the core (pyfric_status in Fortran); `message` explains them."""

    DONE = 0
    LOG_FULL = 1
    ENDLESS = 2
    TOO_SHORT = 3
    NO_MEMORY = 4

    @property
    def message(self) -> str:
        return {
            Status.DONE: "all steps were made",
            Status.LOG_FULL: "stopped early: the log has no room for one more step",
            Status.ENDLESS: "stopped inside a step: contacts switch too often in it",
            Status.TOO_SHORT: "stopped inside a step: its error stays too large",
            Status.NO_MEMORY: "nothing was done: its memory could not be allocated",
        }[self]
