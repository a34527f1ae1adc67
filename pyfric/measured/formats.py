"""The list of kinds of files: readers, their libraries, and advice for kinds without a reader."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple

from pyfric.measured import arrays, loggers
from pyfric.measured.found import Asked, Found, refused
from pyfric.measured.text import text
from pyfric.values import read_at_most

START = 4096
"""Number of bytes at the beginning of a file that decide its kind."""


class Format(NamedTuple):
    """A kind of file.

    Attributes:
        name: name of the kind.
        begins: function of the first bytes and the size of a file: whether it is of this kind.
        read: function that reads a file; None for a kind without a reader.
        extra: the extra with its library, as in pip install pyfric[extra].
        instead: advice for a kind without a reader.
    """

    name: str
    begins: Callable[[bytes, int], bool]
    read: Callable[[Any, Asked], Found] | None
    extra: str = ""
    instead: str = ""


def _signed(*signs: bytes, at: int = 0) -> Callable[[bytes, int], bool]:
    """Return a function that tests whether a file has one of the signs at an offset."""
    return lambda start, size: start[at:].startswith(signs)


def _is_hdf5(start: bytes, size: int) -> bool:
    return b"\x89HDF\r\n\x1a\n" in (start[:8], start[512:520])


def _is_npz(start: bytes, size: int) -> bool:
    return start.startswith(b"PK") and b".npy" in start[:300]


def _is_universal(start: bytes, size: int) -> bool:
    lines = start[:200].splitlines()[:2]
    return len(lines) == 2 and lines[0].strip() == b"-1" and lines[1][:6].strip().isdigit()


def _is_text(start: bytes, size: int) -> bool:
    return start[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" not in start.rstrip(b"\0")


FORMATS = (
    Format("HDF5", _is_hdf5, arrays.hdf5),
    Format("MATLAB", _signed(b"MATLAB"), arrays.matlab),
    Format("netCDF", _signed(b"CDF\x01", b"CDF\x02"), arrays.netcdf),
    Format("netCDF 5", _signed(b"CDF\x05"), None, instead="convert it: nccopy -k nc4"),
    Format("NumPy", _signed(b"\x93NUMPY"), arrays.numpy),
    Format("NumPy", _is_npz, arrays.numpy),
    Format("TDMS", _signed(b"TDSm"), loggers.tdms, "tdms"),
    Format("MDF", _signed(b"MDF  ", b"UnFinMF"), loggers.mdf, "mdf"),
    Format("universal file", _is_universal, loggers.universal, "uff"),
    Format("Look", loggers.is_look, loggers.look),
    Format(
        "Igor text",
        _signed(b"IGOR"),
        None,
        instead="in Igor, Data > Save Waves > Save Delimited Text, with names of waves",
    ),
    Format(
        "workbook",
        _signed(b"PK", b"\xd0\xcf\x11\xe0"),
        None,
        instead="CSV: export the table from the spreadsheet",
    ),
    Format("text", _is_text, text),
)
"""All kinds of files. The kind of a file is the first kind whose `begins` is true."""
KINDS = ", ".join(dict.fromkeys(each.name for each in FORMATS if each.read))
"""Names of the kinds that can be read."""


def contents(path: str | os.PathLike[str], asked: Asked) -> Found:
    """Return the columns of a file; its first bytes decide its kind.

    Raises:
        SceneError: the file cannot be read, or its kind is unknown.
    """
    try:
        start = read_at_most(path, START)
        path = os.path.expanduser(path)
        size = os.path.getsize(path)
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refused(path, "a file of measurements", reason) from None
    kind = next((each for each in FORMATS if each.begins(start, size)), None)
    if kind is None:
        raise refused(path, KINDS, "not a kind of file that is known")
    if kind.read is None:
        raise refused(path, kind.instead, f"{kind.name}, which is not read")
    try:
        return kind.read(path, asked)
    except ModuleNotFoundError:
        allowed = f"the extra {kind.extra!r}: pip install pyfric[{kind.extra}]"
        raise refused(path, allowed, f"a file of the kind {kind.name}") from None
