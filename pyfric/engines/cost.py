"""What it takes before the first step: time and memory of static states and modes.

Counts of operations, by the size of the lattice, times the pace of this machine. Steps and events
are counted by the planner.
"""

from __future__ import annotations

import functools
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf

from pyfric.scene import SceneError

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["SetUp", "available", "check_memory", "pace", "set_up"]

FLOPS, BYTES, UNKNOWN = 13e9, 11.6e9, 25e-6
"""Operations per second of a banded factorisation, bytes per second of its solutions, and seconds
for all else about one unknown. Measured on the Fig. 1 scene at l = 1.25 to 0.5 mm."""
REFERENCE, PACE = (250, 3000), 25e9
"""Half width and length of the band that is factorised to tell the pace of this machine, and the
operations per second of that, which fits into the cache, where the numbers above were measured."""
SOLUTIONS = {"hybrid": 84, "dynamic": 4}
"""Solutions with the factors before the first step: nearly all of them find modes."""
FACTORS = {"hybrid": 2, "dynamic": 1}
"""Factorisations before the first step."""
SOURCES = (
    "/sys/fs/cgroup/memory.max /sys/fs/cgroup/memory.current",
    "/sys/fs/cgroup/memory/memory.limit_in_bytes /sys/fs/cgroup/memory/memory.usage_in_bytes",
)
"""Files with the limit and the use of memory of a container."""


class SetUp(NamedTuple):
    """Time in s on one core, and largest memory in bytes."""

    seconds: float
    bytes: float


def set_up(scene: Scene, fidelity: str, geometry: str) -> SetUp:
    """Return what an engine takes before its first step."""
    N_x, N_z = scene.N_x, scene.N_z
    n, band = 2 * N_x * N_z, 2 * min(N_x, N_z) + 2
    if N_z == 1 or scene.prescribed:
        return SetUp(0.0, 1e3 * n)
    if fidelity in ("quasistatic", "equilibrium"):  # dense rows, one after the other
        size = 2.0 * N_x
        return SetUp(N_z * size**3 * (7 / 3) / FLOPS * pace(), 6 * 8 * size**2 + 500.0 * n)
    kept = 8.0 * n * band
    seconds = FACTORS[fidelity] * kept / 8 * band / FLOPS
    seconds += SOLUTIONS[fidelity] * 2 * kept / BYTES + UNKNOWN * n
    factors = FACTORS[fidelity] + (geometry == "finite")
    return SetUp(seconds * pace(), factors * kept + 1e3 * n)


@functools.cache
def pace() -> float:
    """Return the time of a factorisation here over that by `PACE`: above 1 where slower."""
    width, n = REFERENCE
    band = np.full((width + 1, n), 1e-3, order="F")
    band[0] = 1.0
    start = time.thread_time()
    dpbtrf(band, lower=1, overwrite_ab=1)
    seconds = time.thread_time() - start
    return float(np.clip(seconds * PACE / (n * width**2), 0.2, 10.0))


def available() -> float:
    """Return the memory that there is, in bytes: that of the machine, or less in a container.

    Infinite where the system does not tell.
    """
    found = [np.inf]
    for source in SOURCES:
        try:
            limit, used = (float(Path(one).read_text()) for one in source.split())
        except (OSError, ValueError):  # no container, or "max"
            continue
        found.append(limit - used)
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        lines = []
    found += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")]
    return min(found)


def check_memory(scene: Scene, fidelity: str, geometry: str) -> None:
    """Raise SceneError if a run needs more memory than there is."""
    needed, there = set_up(scene, fidelity, geometry).bytes, available()
    if needed > there:
        allowed = f"a lattice that fits into the memory there is, {there / 1e9:.3g} GB"
        what = f"{scene.N_x} x {scene.N_z} blocks, {fidelity} engine, {geometry} geometry"
        reason = f"about {needed / 1e9:.3g} GB are needed ({what})"
        raise SceneError("slider.l", scene.slider.l, "m", allowed, reason)
