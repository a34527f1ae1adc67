"""Sizes of studies: those that are measured, or tiny ones, with which each command ends in seconds.

With --tiny, or `PYFRIC_TINY` set to 1, every study takes its second sizes. Its numbers mean nothing
then: it is to be seen that its commands work.
"""

from __future__ import annotations

import os
from typing import TypeVar

T = TypeVar("T")

__all__ = ["TINY", "size", "tiny"]

TINY = "PYFRIC_TINY"
"""Environment variable that processes which a study starts know, too."""


def tiny() -> bool:
    """Whether sizes are tiny; to be set before a study is imported."""
    return os.environ.get(TINY) == "1"


def size(full: T, small: T) -> T:
    """Return one of two sizes of a study."""
    return small if tiny() else full
