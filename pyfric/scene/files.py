"""Files that are either there as before or complete, and whose content can be checked."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pyfric.signals import held_back

__all__ = [
    "check_writable",
    "clean_drafts",
    "drafts",
    "read_at_most",
    "sealed",
    "unsealed",
    "write",
    "written",
]

MARK = b"\npyfric sha256 "
SEAL_LENGTH = len(MARK) + 64 + 1
DRAFT = re.compile(r"\.pyfric-(?P<host>.+)-(?P<process>\d{1,9})-[0-9a-f]{8}\.tmp(\.\w+)?")
OLD = 86400.0
"""Age at which the draft of another machine counts as left behind, in s."""


@contextmanager
def written(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give the name of a draft beside path; at the end of the block it takes the place of path.

    If the block raises, the draft goes away and path stays as it was. Ctrl-C waits. Drafts that
    killed processes left in the folder go away too.

    Raises:
        OSError: the file cannot be written, or path is a folder or a device. It names path.
    """
    target = Path(os.path.realpath(path))
    with held_back(), _naming(path):
        _check_regular(target)
        clean_drafts(target.parent)
        draft = _draft(target.parent)
        try:
            yield draft
            _flush(draft)
            os.replace(draft, target)
        finally:
            draft.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # not every file system can flush a folder
        _flush(target.parent)


def write(path: str | os.PathLike[str], content: bytes) -> Path:
    """Write a file whole or not at all and return its path.

    Raises:
        OSError: see `written`.
    """
    with written(path) as draft:
        draft.write_bytes(content)
    return Path(path)


def read_at_most(path: str | os.PathLike[str], size: int) -> bytes:
    """Return what a regular file begins with, at most so many bytes; a pipe is not waited for.

    Raises:
        OSError: it cannot be read, or is no regular file.
        ValueError: no path.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", opener=at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file", os.fspath(path))
        return file.read(size)


def check_writable(path: str | os.PathLike[str], size: int = 0) -> None:
    """Try whether a file of this size, in bytes, can be written; leave nothing behind.

    Raises:
        OSError: it cannot. It names path.
    """
    target = Path(os.path.realpath(path))
    with _naming(path):
        _check_regular(target)
        draft = _draft(target.parent)
        try:
            draft.touch()
        finally:
            draft.unlink(missing_ok=True)
        free = shutil.disk_usage(target.parent).free
        if free < size:
            text = f"{os.strerror(errno.ENOSPC)}: {free} bytes are free, {size} are needed"
            raise OSError(errno.ENOSPC, text)


def _check_regular(target: Path) -> None:
    if target.is_symlink():  # after all links were followed
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "Not a regular file")


@contextmanager
def _naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let an OSError name this path, and not a draft or nothing."""
    try:
        yield
    except OSError as error:
        other = error.filename is not None and not DRAFT.fullmatch(Path(error.filename).name)
        if error.errno is None or other:
            raise
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


# --- drafts --------------------------------------------------------------------------------------


def _host() -> str:
    """Return what tells apart the machines, and containers, that share a folder."""
    try:
        namespace = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        return socket.gethostname()
    return f"{socket.gethostname()}-{namespace}"


def _draft(folder: Path) -> Path:
    return folder / f".pyfric-{_host()}-{os.getpid()}-{secrets.token_hex(4)}.tmp"


def drafts(folder: Path) -> list[Path]:
    """Return the drafts that killed processes left in a folder.

    Their process is gone; where that cannot be known they are older than a day.
    """
    found = []
    with contextlib.suppress(OSError):
        for entry in os.scandir(folder):
            named = DRAFT.fullmatch(entry.name)
            if named and _left_behind(Path(entry.path), named["host"], int(named["process"])):
                found.append(Path(entry.path))
    return found


def _left_behind(draft: Path, host: str, process: int) -> bool:
    if os.name == "posix" and host == _host():
        try:
            os.kill(process, 0)  # asks whether it is there
        except ProcessLookupError:
            return True
        except PermissionError:  # there is one, of another user
            pass
    try:
        return time.time() - draft.stat().st_mtime > OLD
    except OSError:
        return False


def clean_drafts(folder: Path) -> int:
    """Delete the drafts that killed processes left in a folder; return how many there were."""
    found = drafts(folder)
    for draft in found:
        with contextlib.suppress(OSError):
            draft.unlink()
    return len(found)


# --- seals ---------------------------------------------------------------------------------------


def sealed(content: bytes | memoryview) -> bytes:
    """Return content with its SHA-256 at the end, where readers of netCDF and zip ignore it."""
    return b"".join((content, _seal(content)))


def unsealed(content: bytes) -> memoryview | None:
    """Return the content without its checksum, or None if a bit of it has changed."""
    inside = memoryview(content)[:-SEAL_LENGTH]
    return inside if content[-SEAL_LENGTH:] == _seal(inside) else None


def _seal(content: bytes | memoryview) -> bytes:
    return MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
