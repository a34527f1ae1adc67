"""Scene files in TOML. Numbers are in SI units; text contains a number and its unit::

    name = "fig1"
    stop_when = ["arrested"]    # optional: conditions that end a run

    [slider]
    L = "140 mm"
    H = "75 mm"
    l = "2.5 mm"
    k = "13.5 MN/m"
    M = "75.6 g"

    [top]
    kind = "rod"            # or "distributed", or "prescribed"
    F_N = "3500 N"

    [driver]
    K = "4 MN/m"
    V = "0.7875 mm/s"
    h = "5 mm"

    [interface]
    mu_s = 0.7
    mu_k = 0.45

    [walls]                 # optional: for a prescribed interface in two dimensions
    left = "mirrored"       # or "free", "absorbing"
    right = "absorbing"
    top = "absorbing"       # or "held"

    [interface.law]         # optional; default: mu falls linearly over d_c, at once if d_c = 0
    kind = "ageing"         # or another law of `pyfric.laws`
    B = 0.01
    t_c = "1 ms"

A law of kind "table" takes lists or CSV files: slide = "friction.csv", relative to the scene file.
As in Python, L = "140 mm" and L = 0.14 are the same. Text may have any unit of the right dimension.
A field that may vary along the interface is a number, a list, or a table, such as
mu_s = {mean = 0.7, std = 0.02, correlation_length = "10 mm", seed = 1} or mu_s = {file = "mu.csv"}.
"""

import codecs
import os
import tomllib
from pathlib import Path
from typing import Any

from pyfric.values.errors import SceneError
from pyfric.values.files import read_at_most

MAX_FILE = 1_048_576
"""Largest size of a scene file, in bytes; a file can hold two lists of `checked.MAX_LISTED`
forces."""


def parsed(source: str | os.PathLike[str], what: str = "scene") -> tuple[dict[str, Any], Path]:
    """Return the TOML document in a file, or in a text of several lines, and its folder.

    Names of files in the document are relative to this folder. For a text, this folder is the
    current folder.

    Args:
        source: the path of a file, or the text.
        what: name of the content, for errors.

    Raises:
        SceneError: the file cannot be read, is too large or is not TOML.
    """
    if not isinstance(source, str | os.PathLike):
        raise SceneError(what, source, "", f"the path of a {what} file, or its text")
    if isinstance(source, str) and "\n" in source:
        name, folder, data = None, Path(), source.encode("utf-8", "replace")
    else:
        name, folder = str(source), Path(source).parent
        try:
            data = read_at_most(source, MAX_FILE + 1)
        except (OSError, ValueError) as error:
            reason = f"cannot be read ({getattr(error, 'strerror', None) or error})"
            raise SceneError(what, name, "", f"a readable {what} file", reason) from None
    if len(data) > MAX_FILE:
        raise SceneError(what, name, "", f"at most {MAX_FILE} bytes of TOML", "too large")
    try:
        # Some editors write a byte order mark, and some write UTF-16.
        code = "utf-16" if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
        return tomllib.loads(data.decode(code)), folder
    except RecursionError:
        raise SceneError(what, name, "", "a TOML document", "nested too deeply") from None
    except ValueError as error:
        raise SceneError(what, name, "", "a TOML document", f"not TOML ({error})") from None
