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
"""Files with the memory limit of a container, and files with the memory in use."""
LIMITS = ((resource.RLIMIT_AS, 0), (resource.RLIMIT_DATA, 5))
"""Memory limits of a process, each with the index in /proc/self/statm of the memory in use, in
pages."""


def available() -> float:
    """Return the available memory, in bytes.

    The result is the smallest of three values: the available memory of the machine, the rest of the
    limit of its container, and the rest of the limits of this process (`ulimit -v` and
    `ulimit -d`). If the system reports none of these values, the result is inf.
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
