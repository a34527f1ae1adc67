"""Sizes of studies: full sizes, or tiny ones, with which each command ends in seconds.

With --tiny, or `PYFRIC_TINY` set to 1, every study takes its tiny sizes. Numbers of a tiny study
mean nothing; the run only shows that the command works.
"""

from __future__ import annotations

import os
from typing import TypeVar

T = TypeVar("T")

__all__ = ["TINY", "size", "tiny"]

TINY = "PYFRIC_TINY"
"""Environment variable, which child processes of a study inherit."""


def tiny() -> bool:
    """Return whether sizes are tiny; `TINY` is set before a study is imported."""
    return os.environ.get(TINY) == "1"


def size(full: T, small: T) -> T:
    """Return the full or the tiny size of a study."""
    return small if tiny() else full
