"""The store of finished runs: record files in one folder, named by the hash of what was run.

Records are kept in the folder that `PYFRIC_CACHE` names, or else in the user's cache folder. Files
come and go whole, and carry the hash of their content, so that any number of processes and machines
may use one folder without locks.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import re
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from platformdirs import user_cache_path

from pyfric.record import Record, RecordError
from pyfric.scene import clean_drafts, write

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = [
    "CACHE_VARIABLE",
    "MAX_BYTES",
    "Entry",
    "cache_folder",
    "check",
    "entries",
    "failed_before",
    "keep",
    "kept",
    "note_failure",
    "own",
    "prune",
]

CACHE_VARIABLE = "PYFRIC_CACHE"
"""Environment variable that names another folder for finished runs."""
MAX_BYTES = 2**30
"""Most bytes of finished runs in pyfric's own folder; those that users name are not trimmed."""
FAILED = ".failed"
"""End of the name of a note why a run failed."""
NAME = re.compile(r"[0-9a-f]{40}\.nc")
DAY = 86400.0


class Entry(NamedTuple):
    """A file of the store: its path, size in bytes, time of its last use, and which file it is."""

    path: Path
    size: int
    used: float
    file: int

    @property
    def age(self) -> float:
        """Time since its last use, in days."""
        return (time.time() - self.used) / DAY


def cache_folder() -> Path:
    """Return the folder in which finished runs are kept; it need not exist."""
    given = os.environ.get(CACHE_VARIABLE)
    return Path(given) if given else user_cache_path("pyfric", appauthor=False)


def kept(folder: Path, key: str, scene: Scene) -> Record | None:
    """Return the finished run of a scene; None where there is none.

    A file that is damaged or cannot be read is as good as none, with a warning.
    """
    path = folder / f"{key}.nc"
    try:
        record = Record.load(path)
    except FileNotFoundError:
        return None
    except (OSError, RecordError) as error:
        warnings.warn(f"a finished run is made again: {error}", RuntimeWarning, stacklevel=2)
        return None
    with contextlib.suppress(OSError):  # the folder may be read-only
        os.utime(path)  # used just now
    same = dataclasses.replace(record.scene, name=scene.name) == scene
    return record if same and record.done else None


def keep(folder: Path, key: str, record: Record) -> None:
    """Keep a finished run; where that fails, warn and go on."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        record.save(folder / f"{key}.nc")
        (folder / f".{key}{FAILED}").unlink(missing_ok=True)
    except OSError as error:
        warnings.warn(f"a finished run is not kept: {error}", RuntimeWarning, stacklevel=2)


def own(cache: bool | str | os.PathLike[str]) -> bool:
    """Whether finished runs go to pyfric's own folder, and not to one that the user named."""
    return cache is True and not os.environ.get(CACHE_VARIABLE)


def note_failure(folder: Path, key: str, reason: str) -> None:
    """Note why a run failed, until it is complete; where that fails, go on."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write(folder / f".{key}{FAILED}", reason.encode())


def failed_before(folder: Path, key: str) -> str:
    """Return why a run failed the last time, or ""."""
    with contextlib.suppress(OSError):
        return (folder / f".{key}{FAILED}").read_text(encoding="utf-8")
    return ""


def entries(folder: Path) -> list[Entry]:
    """Return the files of the store, those used last first; other files are not its own."""
    found = []
    for path in folder.glob("*.nc"):
        with contextlib.suppress(OSError):  # another process was faster
            if NAME.fullmatch(path.name):
                stat = path.stat()
                found.append(Entry(path, stat.st_size, stat.st_mtime, stat.st_ino))
    return sorted(found, key=lambda one: -one.used)


def check(entry: Entry) -> Record | str:
    """Return the record, or what is wrong with its file."""
    try:
        return Record.load(entry.path)
    except (OSError, RecordError) as error:
        return str(error)


def prune(
    folder: Path,
    most: int | None = None,
    older_than: float | None = None,
    damaged: bool = False,
) -> tuple[list[Entry], int]:
    """Delete drafts left behind, and runs that are not wanted any more.

    A file that another process uses or replaces meanwhile stays.

    Args:
        folder: the store.
        most: delete those used least recently until the others fit into so many bytes.
        older_than: delete those not used for so many days.
        damaged: delete files that are damaged, or records of another version.

    Returns:
        What was deleted, and the number of drafts.
    """
    gone, size = [], 0
    for entry in entries(folder):
        unwanted = older_than is not None and entry.age > older_than
        unwanted = unwanted or (damaged and isinstance(check(entry), str))
        size += 0 if unwanted else entry.size
        if (unwanted or (most is not None and size > most)) and _delete(entry):
            gone.append(entry)
    if most is not None or older_than is not None:
        _forget_failures(folder, 30.0 if older_than is None else older_than)
    return gone, clean_drafts(folder)


def _forget_failures(folder: Path, days: float) -> None:
    for path in folder.glob(f".*{FAILED}"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > days * DAY:
                path.unlink()


def _delete(entry: Entry) -> bool:
    """Delete a file unless it was used or replaced since it was listed."""
    try:
        now = entry.path.stat()
        if (now.st_ino, now.st_mtime) != (entry.file, entry.used):
            return False
        entry.path.unlink()
    except OSError:
        return False
    return True
