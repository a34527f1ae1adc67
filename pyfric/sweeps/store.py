"""The store of finished runs: files in one folder, named by a hash of the run.

A file is the record of a run, or a part of the table of an ensemble (`pyfric.sweeps.measures`).

Records are kept in the folder that `PYFRIC_CACHE` names, or else in the user's cache folder. Files
are written and deleted as a whole. Each file contains a hash of its content. Processes and machines
may share a folder. The process that makes a run holds a lock on a file beside the place of its
record. The system releases the lock when this process ends, however it ends. If a lock is not
available or is lost, a run is made twice, with the same result.
"""

from __future__ import annotations

import functools
import io
import logging
import os
import re
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from platformdirs import user_cache_path

from pyfric.record import Record, RecordError
from pyfric.scene import Scene
from pyfric.values import SceneError, clean_drafts, sealed, unsealed, write

CACHE_VARIABLE = "PYFRIC_CACHE"
"""Environment variable that names another folder for finished runs."""
MAX_BYTES = 2**30
"""Largest size of finished runs in pyfric's own folder. Folders that users name
are not trimmed."""
TABLE = ".npz"
"""End of the name of a part of a table."""
FAILED = ".failed"
"""End of the name of a file with the reason why a run failed."""
FORGET = 30.0
"""Age at which a file on a failed run is deleted, in days."""
LOCK = ".running"
"""End of the name of a lock file, held by the process that makes a run."""
NAME = re.compile(r"[0-9a-f]{40}\.\w+")
DAY = 86400.0
POLL = 0.05
"""Time between two tries to lock a file, s."""
SILENCE = 1.0
"""Waiting time after which a line in the log names the other process, s."""

Cache = bool | str | os.PathLike[str] | None
"""Choice of the store: pyfric's own (True), another folder (a path), or none (False, None)."""

log = functools.cache(logging.getLogger("pyfric").warning)
"""Write a line to the log, once."""


class Entry(NamedTuple):
    """A file of the store: its path, size in bytes, and time of its last use."""

    path: Path
    size: int
    used: float

    @property
    def age(self) -> float:
        """Time since its last use, in days."""
        return (time.time() - self.used) / DAY

    def read(self) -> Record | dict[str, np.ndarray] | str:
        """Return the record, the arrays of a part of a table, or the error in reading the file."""
        try:
            return table_in(self.path) if self.path.suffix == TABLE else Record.load(self.path)
        except (OSError, RecordError) as error:
            return str(error)

    def delete(self) -> bool:
        """Delete the file unless another process used or replaced it meanwhile."""
        try:
            if self.path.stat().st_mtime != self.used:
                return False
            self.path.unlink()
        except OSError:
            return False
        return True


def table_in(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a part of a table.

    Raises:
        OSError: the file cannot be read.
        RecordError: the file is damaged.
    """
    inside = unsealed(path.read_bytes())
    if inside is None:
        raise RecordError(f"{path}: damaged, or no part of a table")
    with np.load(io.BytesIO(inside), allow_pickle=False) as arrays:
        return dict(arrays)


@dataclass(frozen=True)
class Store:
    """Finished runs in a folder.

    Attributes:
        folder: folder of the runs; it need not exist. None means that nothing is stored.
        own: whether the folder is pyfric's own; otherwise the user has named it.
    """

    folder: Path | None
    own: bool = False

    @classmethod
    def at(cls, cache: Cache) -> Self:
        """Return the store that an argument `cache` names.

        Raises:
            SceneError: the argument names no store.
        """
        if cache is None or cache is False:
            return cls(None)
        if cache is True:
            given = os.environ.get(CACHE_VARIABLE)
            if not given:
                return cls(user_cache_path("pyfric", appauthor=False), own=True)
            cache = given
        if not isinstance(cache, str | os.PathLike):
            raise SceneError("cache", cache, "", "True, False, None, or the path of a folder")
        return cls(Path(cache))

    # --- runs ------------------------------------------------------------------------------------

    def load(self, key: str, scene: Scene) -> Record | None:
        """Return the finished run of a scene; None if there is none.

        A file that is damaged or cannot be read counts as missing, and the log names this file.
        """
        if self.folder is None:
            return None
        path = self.folder / f"{key}.nc"
        try:
            record = Record.load(path)
        except FileNotFoundError:
            return None
        except (OSError, RecordError) as error:
            log(f"a finished run is made again: {error}")
            return None
        with suppress(OSError):  # the folder may be read-only
            os.utime(path)  # used just now
        same = replace(record.scene, name=scene.name) == scene
        return record if same and record.done else None

    def save(self, key: str, record: Record) -> None:
        """Store a finished run; if it cannot be written, write a line to the log."""
        if self.folder is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            record.save(self.folder / f"{key}.nc", overwrite=True)
            (self.folder / f"{key}{FAILED}").unlink(missing_ok=True)
        except OSError as error:
            log(f"finished runs are not kept in {self.folder}: {error.strerror or error}")

    def load_table(self, key: str) -> dict[str, np.ndarray] | None:
        """Return the arrays of a part of a table; None if there is none.

        A file that is damaged or cannot be read counts as missing, and the log names this file.
        """
        if self.folder is None:
            return None
        path = self.folder / f"{key}{TABLE}"
        try:
            found = table_in(path)
        except FileNotFoundError:
            return None
        except (OSError, RecordError) as error:
            log(f"a part of a table is made again: {error}")
            return None
        with suppress(OSError):  # the folder may be read-only
            os.utime(path)  # used just now
        return found

    def save_table(self, key: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Store a part of a table; if it cannot be written, write a line to the log."""
        if self.folder is None:
            return
        content = io.BytesIO()
        np.savez(content, **arrays)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write(self.folder / f"{key}{TABLE}", sealed(content.getbuffer()), TABLE)
        except OSError as error:
            log(f"parts of tables are not kept in {self.folder}: {error.strerror or error}")

    def note_failure(self, key: str, reason: str) -> None:
        """Store the reason why a run failed; if it cannot be written, do nothing."""
        if self.folder is not None:
            with suppress(OSError):
                self.folder.mkdir(parents=True, exist_ok=True)
                write(self.folder / f"{key}{FAILED}", reason.encode())

    def failure(self, key: str) -> str:
        """Return the reason why a run failed the last time, or ""."""
        if self.folder is not None:
            with suppress(OSError):
                return (self.folder / f"{key}{FAILED}").read_text(encoding="utf-8")
        return ""

    # --- locks -----------------------------------------------------------------------------------

    def lock_file(self, key: str) -> Path:
        """Return the path of the file that is locked while a run is made."""
        return (self.folder or Path()) / f".{key}{LOCK}"

    @contextmanager
    def reserved(self, key: str, what: str, look: Callable[[], None]) -> Iterator[bool]:
        """Lock a run, once no other process makes it, in a with block; yield whether it is locked.

        The run is not locked in a folder without write permission, or without locks. `look` is
        called repeatedly while waiting; an exception from it ends the waiting. A line in the log
        names the process that makes `what`.
        """
        from filelock import FileLock  # slow to import

        path, begin = self.lock_file(key), time.monotonic()
        lock = FileLock(path, poll_interval=POLL, fallback_to_soft=False)

        def waiting() -> bool:
            look()
            if time.monotonic() - begin > SILENCE:
                with suppress(OSError):
                    log(f"waiting for {path.read_text() or 'another process'}, which makes {what}")
            return False

        if self.folder is not None:
            with suppress(OSError):
                lock.acquire(cancel_check=waiting)
                path.write_text(f"process {os.getpid()} of {socket.gethostname()}")
        try:
            yield lock.is_locked
        finally:
            if lock.is_locked:
                with suppress(OSError):
                    path.unlink()
                lock.release()

    # --- deletion --------------------------------------------------------------------------------

    def entries(self, *ends: str) -> list[Entry]:
        """Return the files of the store with these endings, most recently used first.

        Without endings, all records and parts of tables are returned.
        """
        found, ends = [], ends or (".nc", TABLE)
        for path in self.folder.iterdir() if self.folder and self.folder.is_dir() else ():
            with suppress(OSError):  # another process has deleted it
                if path.suffix in ends and NAME.fullmatch(path.name):
                    stat = path.stat()
                    found.append(Entry(path, stat.st_size, stat.st_mtime))
        return sorted(found, key=lambda entry: -entry.used)

    def prune(
        self, max_bytes: int | None = None, older_than: float | None = None, damaged: bool = False
    ) -> tuple[list[Entry], int]:
        """Delete unfinished files of killed processes, and runs that exceed the given limits.

        Args:
            max_bytes: delete the least recently used runs until the others fit into this number of
                bytes.
            older_than: delete runs not used for this number of days.
            damaged: delete files that are damaged, or records of another version.

        Returns:
            The deleted files, and the number of unfinished files.
        """
        if self.folder is None:
            return [], 0
        gone, size = [], 0
        for entry in self.entries():
            unwanted = older_than is not None and entry.age > older_than
            unwanted = unwanted or (damaged and isinstance(entry.read(), str))
            size += 0 if unwanted else entry.size
            if (unwanted or (max_bytes is not None and size > max_bytes)) and entry.delete():
                gone.append(entry)
        for entry in self.entries(FAILED):
            if entry.age > (FORGET if older_than is None else older_than):
                entry.delete()
        from filelock import FileLock

        for path in self.folder.glob(f".*{LOCK}"):
            with suppress(OSError), FileLock(path, timeout=0, fallback_to_soft=False):
                path.unlink()  # no process has locked it
        return gone, clean_drafts(self.folder)
