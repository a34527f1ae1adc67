"""Slow values are made once, and no more are kept than there is room for."""

from pyfric.statics import Memory


def test_what_is_kept_is_made_once():
    memory, made = Memory(2), []

    def get(key):
        return memory.made(key, lambda: made.append(key) or key.upper())

    assert [get(key) for key in "abab"] == list("ABAB")
    assert made == list("ab")
    get("c")  # the longest unused value, a, is dropped
    assert "a" not in memory
    get("b")
    assert made == list("abc")
    get("a")
    assert made == list("abca")


def test_there_is_room_before_something_new_is_made():
    memory = Memory(1)
    memory.made(1, object)
    assert memory.made(2, lambda: 1 not in memory)
