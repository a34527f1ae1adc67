"""The memory that there is for a run."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

import numpy as np

__all__ = ["available"]

CONTAINERS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Files with the limit and the use of memory of a container."""
LIMITS = ((resource.RLIMIT_AS, 0), (resource.RLIMIT_DATA, 5))
"""Limits of a process, and which number of /proc/self/statm, in pages, they are on."""


def available() -> float:
    """Return the memory that there is, in bytes.

    The least of what the machine has, what is left in its container, and what is left below the
    limits of this process (`ulimit -v` and `ulimit -d`). Infinite where the system does not tell.
    """
    found = [np.inf]
    for files in CONTAINERS:
        with suppress(OSError, ValueError):  # no container, or "max"
            limit, used = (float(Path(file).read_text()) for file in files)
            found.append(limit - used)
    with suppress(OSError):
        pages = Path("/proc/self/statm").read_text().split()
        for limited, column in LIMITS:
            limit, _ = resource.getrlimit(limited)
            if limit != resource.RLIM_INFINITY:
                found.append(limit - float(pages[column]) * resource.getpagesize())
        lines = Path("/proc/meminfo").read_text().splitlines()
        machine = (line.split()[1] for line in lines if line.startswith("MemAvailable"))
        found += [1024.0 * float(size) for size in machine]
    return max(min(found), 0.0)
