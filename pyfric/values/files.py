"""Files that are written completely or not at all, and files with a checksum."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import itertools
import os
import re
import secrets
import shutil
import socket
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pyfric.signals import held_back
from pyfric.values.errors import SceneError

MARK = b"\npyfric sha256 "
SEAL_LENGTH = len(MARK) + 64 + 1
DRAFT = re.compile(r"\.pyfric-(?P<host>.+)-(?P<process>\d{1,9})-[0-9a-f]{8}\.tmp(\.\w+)?")
FORMATS = {
    **{".nc": "netCDF", ".csv": "CSV", ".html": "HTML", ".toml": "TOML", ".json": "JSON"},
    **{".png": "PNG", ".pdf": "PDF", ".svg": "SVG", ".jpg": "JPEG", ".gif": "GIF", ".mp4": "MP4"},
    **{".txt": "text", ".xlsx": "Excel", ".parquet": "Parquet", ".npz": "NumPy", ".zip": "zip"},
    ".mat": "MATLAB",
}
"""Formats of files, by suffix of the file name in small letters."""
OLD = 86400.0
"""Age above which a temporary file of another machine counts as abandoned, in s."""


@contextmanager
def written(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the name of a temporary file beside path, which replaces path at the end of the block.

    If the block raises, the temporary file is deleted and path is unchanged. Ctrl-C is delayed.
    Temporary files of killed processes in the folder are deleted, too.

    Raises:
        OSError: the file cannot be written, or path is a folder or a device. The error names path.
    """
    with held_back(), _regular(path) as target:
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


def check_suffix(path: str | os.PathLike[str], own: str) -> None:
    """Refuse the name of a file whose suffix stands for another format than the suffix `own`.

    Raises:
        SceneError: the suffix is in `FORMATS`, and differs from `own`.
    """
    found = Path(path).suffix.lower()
    if own and found != own and found in FORMATS:
        reason = f"the file would be {FORMATS[own]}, not {FORMATS[found]}"
        tables = "; to_csv, or --csv, writes tables" * (own == ".nc" and found == ".csv")
        raise SceneError("path", os.fspath(path), "", f"a name that ends in {own}{tables}", reason)


def check_free(
    path: str | os.PathLike[str], overwrite: bool, save: Callable[[Path], object], held: str = ""
) -> None:
    """Raise SceneError if a file exists and `overwrite` is False, after a save under another name.

    Args:
        path: the file.
        overwrite: whether the file may be replaced.
        save: function that writes a new file, such as run-2.nc for run.nc.
        held: content of the file, for the message.

    Raises:
        SceneError: the file exists.
    """
    known = Path(path).expanduser()
    if not overwrite and known.is_file():
        names = (known.with_stem(f"{known.stem}-{n}") for n in itertools.count(2))
        save(beside := next(name for name in names if not name.exists()))
        allowed = "another name; overwrite=True replaces it"
        reason = "the file exists" + f" and holds {held}" * bool(held)
        reason += f"; nothing is lost: the new one is {beside.name}"
        raise SceneError("path", os.fspath(path), "", allowed, reason)


def check_folder_name(folder: Path) -> None:
    """Refuse the name of a file as the name of a folder for several files.

    Raises:
        SceneError: the suffix is in `FORMATS`.
    """
    if folder.suffix.lower() in FORMATS and not folder.is_dir():
        allowed = f'a folder for several files, such as "{folder.stem}"'
        raise SceneError("folder", str(folder), "", allowed, "the name of a file")


def figure_stem(path: str | os.PathLike[str]) -> Path:
    """Return a path without the suffix .png or .pdf, as stem for the names of a figure's files.

    Raises:
        SceneError: the suffix belongs to another format.
    """
    path = Path(path)
    if path.suffix.lower() in (".png", ".pdf"):
        return figure_stem(path.with_suffix(""))  # so that a stem is its own stem
    check_suffix(path, ".png")
    return path


def write(path: str | os.PathLike[str], content: bytes, suffix: str = "") -> Path:
    """Write a file completely or not at all, and return its path; `suffix` belongs to its format.

    Raises:
        OSError: see `written`.
        SceneError: see `check_suffix`.
    """
    check_suffix(path, suffix)
    with written(path) as draft:
        draft.write_bytes(content)
    return Path(os.path.expanduser(path))


def write_all(contents: Mapping[str | os.PathLike[str], bytes]) -> list[Path]:
    """Write files by path, and return the paths; no file is replaced before all are on the disk.

    Raises:
        OSError: see `written`.
    """
    with contextlib.ExitStack() as stack:
        for path, content in contents.items():
            draft = stack.enter_context(written(path))
            with _regular(path):
                draft.write_bytes(content)
                _flush(draft)
    return [Path(os.path.expanduser(path)) for path in contents]


def read_at_most(path: str | os.PathLike[str], size: int = -1) -> bytes:
    """Return the first `size` bytes, or all, of a regular file, without waiting for a pipe.

    Raises:
        OSError: the file cannot be read, or is not a regular file.
        ValueError: path is not a valid path.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | os.O_NONBLOCK)

    with open(os.path.expanduser(path), "rb", opener=at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file", os.fspath(path))
        return file.read(size)


def check_writable(path: str | os.PathLike[str], size: int = 0, suffix: str = "") -> None:
    """Check whether a file of a size in bytes can be written; the check leaves no file.

    Raises:
        OSError: the file cannot be written. The error names path.
        SceneError: see `check_suffix`; `suffix` belongs to the format of the file.
    """
    check_suffix(path, suffix)
    with _regular(path) as target:
        draft = _draft(target.parent)
        try:
            draft.touch()
        finally:
            draft.unlink(missing_ok=True)
        free = shutil.disk_usage(target.parent).free
        if free < size:
            text = f"{os.strerror(errno.ENOSPC)}: {free} bytes are free, {size} are needed"
            raise OSError(errno.ENOSPC, text)


@contextmanager
def _regular(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the file that a path names, which is regular or does not exist.

    An OSError names this path instead of a temporary file.
    """
    target = Path(os.path.realpath(os.path.expanduser(path)))
    try:
        if target.is_symlink():  # after all links were followed
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        if target.is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
        if target.exists() and not target.is_file():
            raise OSError(errno.EINVAL, "Not a regular file")
        yield target
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
    """Return an identifier of this machine or container, for shared folders."""
    try:
        namespace = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        return socket.gethostname()
    return f"{socket.gethostname()}-{namespace}"


def _draft(folder: Path) -> Path:
    return folder / f".pyfric-{_host()}-{os.getpid()}-{secrets.token_hex(4)}.tmp"


def clean_drafts(folder: Path) -> int:
    """Delete the temporary files that killed processes left in a folder; return their number.

    A file is deleted if its process no longer exists. If the process cannot be checked, the file is
    deleted if it is older than a day.
    """
    gone = 0
    with contextlib.suppress(OSError):
        for path in list(folder.iterdir()):
            named = DRAFT.fullmatch(path.name)
            if named and _left_behind(path, named["host"], int(named["process"])):
                with contextlib.suppress(OSError):  # go on with other files
                    path.unlink()
                    gone += 1
    return gone


def _left_behind(draft: Path, host: str, process: int) -> bool:
    if host == _host():
        try:
            os.kill(process, 0)  # signal 0 only checks that the process exists
        except ProcessLookupError:
            return True
        except PermissionError:  # a process of another user
            pass
    try:
        return time.time() - draft.stat().st_mtime > OLD
    except OSError:
        return False


# --- seals ---------------------------------------------------------------------------------------


def sealed(content: bytes | memoryview) -> bytes:
    """Return content with its SHA-256 at the end, which readers of netCDF and zip ignore."""
    return b"".join((content, _seal(content)))


def unsealed(content: bytes) -> memoryview | None:
    """Return the content without its checksum, or None if the checksum does not match."""
    inside = memoryview(content)[:-SEAL_LENGTH]
    return inside if content[-SEAL_LENGTH:] == _seal(inside) else None


def _seal(content: bytes | memoryview) -> bytes:
    return MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
