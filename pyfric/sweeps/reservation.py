"""One run at a time for each key in a folder that processes and machines share.

Who makes a run keeps a small file beside the place of its record, and touches it as long as it
works. A file that nobody has touched for `EXPIRY` belongs to someone who is gone, and so does at
once one of a process of this machine that no longer runs. Times are those of the folder's file
system, not of the machine's clock. If a reservation is lost nevertheless, a run is made twice, with
the same result: records are written whole or not at all.

A sweep that ends before its runs says so in a file too (`give_up`): runs that processes of others
make for it end when they see it (`given_up`).
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["clear", "give_up", "given_up", "reserved"]

BEAT = 10.0
"""Time between two touches, s."""
EXPIRY = 60.0
"""Age after which a reservation that was not touched is void, s."""
SUFFIX = ".running"
GIVEN_UP = ".given_up"
PATIENCE = 2.0
"""Time in which runs see that their sweep was given up, s."""


@contextmanager
def reserved(folder: Path, key: str) -> Iterator[bool]:
    """Reserve the run of this key during the block; give whether it is ours to make.

    Where the folder takes no files, all is ours.
    """
    path = folder / f".{key}{SUFFIX}"
    _end_if_void(path)
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    made = False
    try:
        with open(path, "x") as file:
            made = True
            file.write(_owner())
    except FileExistsError:
        yield False
        return
    except OSError:
        if made:  # and the disk is full
            path.unlink(missing_ok=True)
        yield True
        return
    done = threading.Event()
    beat = threading.Thread(target=_touch, args=(path, done), daemon=True)
    beat.start()
    try:
        yield True
    finally:
        done.set()
        beat.join()
        path.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Delete the reservations in a folder that are void, and what was given up long ago."""
    for path in folder.glob(f".*{SUFFIX}"):
        _end_if_void(path)
    for path in folder.glob(f".*{GIVEN_UP}"):
        with suppress(OSError):
            if _now(folder) - path.stat().st_mtime > EXPIRY:
                path.unlink()


def given_up(folder: Path, sweep: str) -> bool:
    """Whether the sweep of this name wants no more runs."""
    return (folder / f".{sweep}{GIVEN_UP}").exists()


def give_up(folder: Path, sweep: str, ended: Callable[[], bool]) -> None:
    """Say that a sweep wants no more runs, until all have ended or had the time to see it."""
    path = folder / f".{sweep}{GIVEN_UP}"
    with suppress(OSError):
        path.touch()
        begin = time.monotonic()
        try:
            while not ended() and time.monotonic() - begin < PATIENCE:
                time.sleep(0.02)
        finally:
            if ended():
                path.unlink()


def _touch(path: Path, done: threading.Event) -> None:
    while not done.wait(BEAT):
        with suppress(OSError):
            os.utime(path)


def _owner() -> str:
    """Return what names this process: machine, container and number."""
    with suppress(OSError):
        return f"{socket.gethostname()} {os.stat('/proc/self/ns/pid').st_ino} {os.getpid()}"
    return f"{socket.gethostname()} - {os.getpid()}"


def _end_if_void(path: Path) -> None:
    """Delete a reservation whose owner is gone; of several that try, one does."""
    if not _is_void(path):
        return
    aside = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    with suppress(OSError):
        os.rename(path, aside)
        aside.unlink()


def _is_void(path: Path) -> bool:
    try:
        owner, touched = path.read_text(), path.stat().st_mtime
    except OSError:
        return False  # it has just ended
    if not owner:
        return _now(path.parent) - touched > EXPIRY
    machine, process = owner.rsplit(" ", 1)
    if os.name == "posix" and machine == _owner().rsplit(" ", 1)[0]:
        try:
            os.kill(int(process), 0)  # only asks
        except ProcessLookupError:
            return True
        except OSError:
            pass
    return _now(path.parent) - touched > EXPIRY


def _now(folder: Path) -> float:
    """Return the time by the clock that stamps files in this folder."""
    path = folder / f".{secrets.token_hex(8)}{SUFFIX}"
    try:
        path.touch(exist_ok=False)
        return path.stat().st_mtime
    except OSError:
        return 0.0
    finally:
        with suppress(OSError):
            path.unlink()
