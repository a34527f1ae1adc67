"""Which software and machine made a record or a set of files."""

from __future__ import annotations

import datetime
import platform
from pathlib import Path

import numpy as np
import tomli_w

from pyfric import core
from pyfric.scene import __version__, write


def versions() -> dict[str, str]:
    """Return what a record says about the software that made it."""
    build = core.build_info()
    return {
        "pyfric": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "compiler": build["compiler"],
        "flags": build["flags"],
        "machine": platform.machine(),
    }


def provenance(path: Path, command: str) -> Path:
    """Write what made a set of files: command, date, software and processor. Return the path."""
    made = {
        "command": command,
        "date": datetime.datetime.now(datetime.UTC).replace(microsecond=0),
        "processor": _processor(),
        "versions": versions(),
    }
    return write(path, tomli_w.dumps(made).encode())


def _processor() -> str:
    """Return the model of the processor as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
