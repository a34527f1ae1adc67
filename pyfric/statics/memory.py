"""A bounded cache that drops its least recently used entry first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

T = TypeVar("T")


class Memory(Generic[T]):
    """A cache of at most `room` values by key.

    Args:
        room: largest number of values, at least 1.
    """

    def __init__(self, room: int) -> None:
        self.room = room
        self._kept: dict[Hashable, T] = {}

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key. If it is missing, drop old values and call `make`."""
        if key in self._kept:
            self._kept[key] = self._kept.pop(key)
        else:
            while len(self._kept) >= self.room:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = make()
        return self._kept[key]

    def __contains__(self, key: Hashable) -> bool:
        return key in self._kept

    def __getitem__(self, key: Hashable) -> T:
        """Return what is kept for a key."""
        return self._kept[key]

    def put(self, key: Hashable, value: T) -> T:
        """Store a value for a key in place of an earlier one, and return it."""
        self._kept.pop(key, None)
        return self.get(key, lambda: value)

    def clear(self) -> None:
        """Drop all values."""
        self._kept.clear()
