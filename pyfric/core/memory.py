"""The memory available to a run."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

import numpy as np

CONTAINERS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Files with the limit and the use of memory of a container."""
LIMITS = ((resource.RLIMIT_AS, 0), (resource.RLIMIT_DATA, 5))
"""Limits of a process, and the index of the limited number in /proc/self/statm, in pages."""


def available() -> float:
    """Return the available memory, in bytes.

    It is the smallest of three values: the available memory of the machine, the rest of the limit
    of its container, and the rest of the limits of this process (`ulimit -v` and `ulimit -d`). It
    is inf if the system does not report these values.
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
