"""Ctrl-C: a run ends with what it has, a file is written whole, everything else stops at once.

A run closes its record and gives it back (`answered`); what the same script or cell asks for next
raises KeyboardInterrupt (`raise_if_asked`). While a file is written Ctrl-C waits (`held_back`), and
from the end of a run to the end of its save where both are in one block (`saved_first`).
In a command, SIGTERM is a Ctrl-C, all after the first are absorbed, and where a library keeps the
interpreter waiting the process ends all the same, unless it has something to save (`commanded`).
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType

__all__ = [
    "answered",
    "asked_to_stop",
    "at_once",
    "commanded",
    "forget",
    "held_back",
    "nothing_to_save",
    "raise_if_asked",
    "saved_first",
]

PATIENCE = 1.0
"""Time that a command has to stop by itself, s."""


@dataclass
class _Now:
    """What is under way in the main thread, and what was pressed."""

    presses: int = 0
    number: int = 0  # the first signal
    held: int = 0
    saving: bool = False  # in a block that saves what a run of it gives
    unsaved: int = 0  # runs that ended there, counted in `held`
    answering: int = 0
    at_once: int = 0
    command: bool = False
    ending: bool = False  # a command that stops by itself with what it has
    pending: FrameType | None = None  # the script or cell whose next call raises


_now = _Now()


@contextmanager
def answered() -> Iterator[Callable[[], bool]]:
    """Give a function that says whether to stop: the block then ends by itself with what it has."""
    if _elsewhere():
        yield lambda: False
        return
    if _now.at_once:
        yield lambda: False
        _hold_unsaved()
        return
    with _installed():
        _now.answering += 1
        try:
            yield lambda: _now.presses > 0
        finally:
            _hold_unsaved()
            _now.answering -= 1
            if _now.presses:
                _now.pending, _now.ending = _script(), True


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block."""
    if _elsewhere():
        yield
        return
    with _late():
        _now.held += 1
        try:
            yield
        finally:
            _now.held -= 1


@contextmanager
def saved_first() -> Iterator[None]:
    """Let Ctrl-C wait from the end of a run in the block until the end of the block."""
    if _elsewhere() or _now.saving:
        yield
        return
    with _late():
        _now.saving = True
        try:
            yield
        finally:
            _now.saving = False
            _release_unsaved()


def nothing_to_save() -> None:
    """Let Ctrl-C act again, and at once if it was pressed: what just ended is of no use."""
    if _elsewhere() or not _now.unsaved:
        return
    _release_unsaved()
    if _now.presses:
        raise KeyboardInterrupt


def _hold_unsaved() -> None:
    if _now.saving:
        _now.held, _now.unsaved = _now.held + 1, _now.unsaved + 1


def _release_unsaved() -> None:
    _now.held, _now.unsaved = _now.held - _now.unsaved, 0


@contextmanager
def _late() -> Iterator[None]:
    """Answer what was pressed in the block after it."""
    with _installed():
        before = _now.presses
        yield
        pressed = _now.presses > before
    if not pressed or before or _now.held or _now.answering or _now.ending:
        return
    if _now.command:
        raise KeyboardInterrupt
    signal.raise_signal(signal.SIGINT)


@contextmanager
def at_once() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in all runs of the block: no part of them is of use."""
    if _elsewhere():
        yield
        return
    raise_if_asked()
    _now.at_once += 1
    try:
        yield
    finally:
        _now.at_once -= 1


def raise_if_asked() -> None:
    """Raise KeyboardInterrupt if Ctrl-C ended a run that this script or cell called before."""
    if _elsewhere() or _now.pending is None:
        return
    script, _now.pending = _now.pending, None
    if script is _script():
        raise KeyboardInterrupt


def forget() -> None:
    """Forget that Ctrl-C ended a run: the user goes on with it."""
    if not _elsewhere():
        _now.pending = None


def asked_to_stop() -> int:
    """Return the signal that asked this command to stop, or 0."""
    return _now.number if _now.presses else 0


@contextmanager
def commanded() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end a command."""
    if _elsewhere():
        yield
        return
    before = {one: signal.signal(one, _handle) for one in (signal.SIGINT, signal.SIGTERM)}
    _now.command, _now.presses, _now.ending = True, 0, False
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)
    old = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_insist, args=(ear,), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(old)
        mouth.close()
        for one, handler in before.items():
            signal.signal(one, handler)
        _now.command, _now.presses, _now.ending, _now.pending = False, 0, False, None


def _handle(number: int, frame: FrameType | None) -> None:
    _now.presses += 1
    if _now.presses == 1:
        _now.number = number
    if _now.answering or _now.held or (_now.command and _now.presses > 1):
        _now.ending |= _now.command and _now.answering > 0
        saves = _now.answering or _now.held or _now.ending
        if _now.held or _now.command or _now.presses > 1:
            _say("saving, please wait" if saves else "stopping, please wait")
        return
    raise KeyboardInterrupt


def _insist(ear: socket.socket) -> None:
    """End the process when Ctrl-C or SIGTERM was not heard for too long, and nothing is saved."""
    with ear, suppress(OSError):
        while (told := ear.recv(1)) and told[0] not in (signal.SIGINT, signal.SIGTERM):
            pass
        if not told:
            return
        ear.setblocking(False)
        begin = time.monotonic()
        while time.monotonic() - begin < PATIENCE:
            if _now.held or _now.answering or _now.ending:
                begin = time.monotonic()
            time.sleep(0.05)
            with suppress(BlockingIOError):
                if not ear.recv(64):
                    return
        _say("interrupted")
        os._exit(128 + told[0])


@contextmanager
def _installed() -> Iterator[None]:
    """Answer Ctrl-C here, unless that is done already."""
    before = signal.getsignal(signal.SIGINT)
    if before is _handle:
        yield
        return
    _now.presses = 0
    signal.signal(signal.SIGINT, _handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _now.presses, _now.ending = 0, False


def _script() -> FrameType | None:
    """Return the frame of the script, cell or input that this call comes from."""
    frame = sys._getframe()
    while frame is not None and frame.f_code.co_name != "<module>":
        frame = frame.f_back
    return frame


def _say(text: str) -> None:
    with suppress(OSError):
        os.write(2, f"{text}\n".encode())


def _elsewhere() -> bool:
    return threading.current_thread() is not threading.main_thread()
