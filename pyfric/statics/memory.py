"""A bounded cache that drops its least recently made or used value first."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar

T = TypeVar("T")


class Memory(dict[Hashable, T]):
    """A cache of at most `room` values by key.

    Args:
        room: largest number of values, at least 1.
    """

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def made(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key. A missing value is made, and old values are dropped."""
        if key in self:
            self[key] = self.pop(key)
        else:
            while len(self) >= self.room:
                del self[next(iter(self))]
            self[key] = make()
        return self[key]
