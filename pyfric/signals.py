"""Ctrl-C and other signals that ask to stop: runs return their records, files are written whole.

A run that is interrupted returns its record (`answered`). The next run in the same script or cell
raises KeyboardInterrupt (`raise_if_asked`). While a file is written, Ctrl-C waits (`held_back`). In
a block of `saved_first`, Ctrl-C also waits between the end of a run and the end of its save. In a
command, all `SIGNALS` act like Ctrl-C, and signals after the first are ignored. If a library blocks
the interpreter, the process ends, unless data are being saved (`commanded`). Python handles signals
only in its main thread, so these functions have no effect in other threads.
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
from types import FrameType

SIGNALS = (
    *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT),
    *(signal.SIGUSR1, signal.SIGXCPU),
)
"""Signals that ask a command to stop."""
PATIENCE = 1.0
"""Time within which a command has to stop by itself after a signal, in s."""


class _State(threading.local):
    """Active blocks of a thread, and the signal that asked the thread to stop."""

    number = 0  # first signal, 0 for none
    answered = False  # whether a run has ended because of the signal
    held = 0  # number of active blocks in which signals wait
    saving: int | None = None  # value of `held` at the start of a block of `saved_first`
    at_once = 0  # number of active blocks of `at_once`
    command = False
    terminals: tuple[int, ...] = ()
    script: FrameType | None = None  # script or cell whose next run raises KeyboardInterrupt


_now = _State()


@contextmanager
def answered() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether a run should stop and return a partial result."""
    if _now.at_once:
        yield lambda: False
        _now.held += _now.saving is not None
        return
    with held_back():
        try:
            yield lambda: _now.number > 0
        finally:
            _now.held += _now.saving is not None
            if _now.number:
                _now.answered, _now.script = True, _script()


@contextmanager
def held_back() -> Iterator[None]:
    """Delay Ctrl-C until the end of the block."""
    with _listening():
        _now.held += 1
        try:
            yield
        finally:
            _now.held -= 1


@contextmanager
def saved_first() -> Iterator[None]:
    """Delay Ctrl-C from the end of a run in the block until the end of the block."""
    if _now.saving is not None:
        yield
        return
    with _listening():
        _now.saving = _now.held
        try:
            yield
        finally:
            _now.held, _now.saving = _now.saving, None


def nothing_to_save() -> None:
    """End the delay of Ctrl-C after a run without result; raise KeyboardInterrupt if delayed."""
    if _now.saving is not None and _now.held > _now.saving:
        _now.held = _now.saving
        if _now.number:
            raise KeyboardInterrupt


@contextmanager
def at_once() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in all runs of the block, without partial results."""
    raise_if_asked()
    _now.at_once += 1
    try:
        yield
    finally:
        _now.at_once -= 1


def raise_if_asked() -> None:
    """Raise KeyboardInterrupt if Ctrl-C ended an earlier run of this script or cell."""
    script, _now.script = _now.script, None
    if script is not None and script is _script():
        raise KeyboardInterrupt


def forget() -> None:
    """Forget that Ctrl-C ended a run, because the user continues the run."""
    _now.script = None


def asked_to_stop() -> int:
    """Return the signal that asked this command to stop, or 0."""
    return _now.number


@contextmanager
def commanded() -> Iterator[None]:
    """Let `SIGNALS` end a command, except SIGHUP under nohup."""
    if _elsewhere():
        yield
        return
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    taken = set(SIGNALS) - ({signal.SIGHUP} if ignored else set())
    before = {number: signal.signal(number, _handle) for number in taken}
    vars(_now).clear()
    _now.command, _now.terminals = True, tuple(filter(os.isatty, (1, 2)))
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)
    wakeup = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    ended = threading.Event()
    threading.Thread(target=_end_if_unheard, args=(ear, ended, vars(_now)), daemon=True).start()
    hook, sys.unraisablehook = sys.unraisablehook, _swallowed
    try:
        yield
    finally:
        sys.unraisablehook = hook
        ended.set()
        signal.set_wakeup_fd(wakeup)
        mouth.close()
        for number, handler in before.items():
            signal.signal(number, handler)
        vars(_now).clear()


def _handle(number: int, frame: FrameType | None) -> None:
    first, _now.number = not _now.number, _now.number or number
    if number == signal.SIGHUP:
        _leave_terminal()
    if _now.held or _now.answered:
        _say("saving, please wait")
    elif first or not _now.command:
        raise KeyboardInterrupt
    else:
        _say("stopping, please wait")


@contextmanager
def _listening() -> Iterator[None]:
    """Handle Ctrl-C in the block; after the block, raise a signal that had no effect."""
    if _elsewhere():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    outermost = before is not _handle
    if outermost:
        signal.signal(signal.SIGINT, _handle)
    asked = _now.number
    try:
        yield
        waited = _now.number and not (asked or _now.held or _now.answered)
    finally:
        if outermost:
            signal.signal(signal.SIGINT, before)
            _now.number, _now.answered = 0, False
    if waited and _now.command:
        raise KeyboardInterrupt
    if waited:
        signal.raise_signal(signal.SIGINT)


def _swallowed(told: sys.UnraisableHookArgs) -> None:
    """Show an exception that cannot be raised, unless it is a KeyboardInterrupt."""
    if not issubclass(told.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(told)


def _end_if_unheard(ear: socket.socket, ended: threading.Event, main: dict[str, int]) -> None:
    """End the process if a signal had no effect for `PATIENCE` and nothing is being saved."""
    with ear:
        while (told := ear.recv(1)) and told[0] not in SIGNALS:
            pass
        begin = time.monotonic()
        while told and not ended.wait(0.05):
            if main.get("held") or main.get("answered"):
                begin = time.monotonic()
            if time.monotonic() - begin > PATIENCE:
                _say("interrupted")
                os._exit(128 + told[0])


def _leave_terminal() -> None:
    """Discard output to a terminal that is closed, where writing would fail."""
    for stream in _now.terminals:
        if not os.isatty(stream):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def _script() -> FrameType | None:
    """Return the frame of the script, notebook cell or input line that calls pyfric."""
    frame = sys._getframe()
    while frame is not None and frame.f_code.co_name != "<module>":
        frame = frame.f_back
    return frame


def _say(text: str) -> None:
    with suppress(OSError):
        os.write(2, f"{text}\n".encode())


def _elsewhere() -> bool:
    return threading.current_thread() is not threading.main_thread()
