"""What a run takes: its work, counted, and its memory.

Work is in seconds on one core of the machine on which its units were measured, so that what it
decides is the same on every machine. `machine_speed` turns it into seconds of this one.
"""

from __future__ import annotations

import functools
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf

from pyfric.core import STEPPERS, available
from pyfric.scene import SceneError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.engines.dynamic import Run
    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene

__all__ = [
    "POINTS",
    "SetUp",
    "check_memory",
    "full_work",
    "machine_speed",
    "set_up",
    "work",
    "work_so_far",
]

EVALUATION, BOTTOM, BLOCK = 0.5e-6, 8e-9, {"linear": 3.1e-9, "finite": 6.3e-9}
"""A force evaluation, of the slider, of each block of its bottom row, and of each block, in s."""
CALL = 5e-5
"""A call of the core, of which there is at least one for each point of the loading curve, in s."""
ATTEMPT = {"linear": (2.5e-3, 1e-6), "finite": (4e-3, 2.5e-6)}
"""An attempt to jump, in s, and more for each block. All units set prices only, no result."""
BASE = 0.02
"""What finds modes on any lattice, in s."""
POINTS = 5000
"""Points of the loading curve, unless it is said otherwise."""
RUN = 0.02
"""What a run takes before and after its steps, in s."""
RELEASE, STATIC_EVENT = 1e-8, 1e-3
"""The release of a block in the quasi-static engine, over N_x^2, and an event of it, in s."""
FLOPS, BYTES, UNKNOWN = 13e9, 11.6e9, 25e-6
"""Operations per second of a banded factorisation, bytes per second of its solutions, and seconds
for all else about one unknown."""
SOLUTIONS = 84
"""Solutions with the factor that find the modes of one set of contact states."""
REFERENCE, PACE = (250, 3000), 25e9
"""Half width and length of a band, and the operations per second of its factorisation on the
machine on which the units were measured."""


FASTEST, SLOWEST = 0.2, 10.0
"""A measured speed of the machine outside of this is a disturbed measurement."""


class SetUp(NamedTuple):
    """Work in s, and largest memory in bytes."""

    work: float
    bytes: float


def work(scene: Scene, geometry: Geometry, counts: Mapping[str, float]) -> float:
    """Return the work of what a record counts, in s."""
    blocks = scene.N_x * scene.N_z
    evaluation = EVALUATION + BOTTOM * scene.N_x + BLOCK[geometry] * blocks
    attempt, of_block = ATTEMPT[geometry]
    return (
        counts.get("block_evaluations", 0) / blocks * evaluation
        + counts.get("calls", 0) * CALL
        + counts.get("attempts", 0) * (attempt + of_block * blocks)
        + counts.get("modal_bases", 0) * set_up(scene, "hybrid", geometry).work
        + counts.get("releases", 0) * RELEASE * scene.N_x**2
        + counts.get("static_events", 0) * STATIC_EVENT
    )


def work_so_far(run: Run | Record) -> float:
    """Return the work of a run with steps, or of its record, in s."""
    counts, method = run.counts() if callable(run.counts) else run.counts, run.method
    calls = counts["steps"] / max(method.sample, 1)
    return work(run.scene, method.geometry, {**counts, "calls": calls})


def full_work(
    scene: Scene,
    geometry: Geometry,
    dt: float,
    lasts: float,
    stepper: str = "rk4",
    points: int = POINTS,
) -> float:
    """Return the work of full dynamics with steps dt over a time, both in s."""
    steps = lasts / dt
    evaluations = len(STEPPERS[stepper].c) * steps * scene.N_x * scene.N_z
    counts = {"block_evaluations": evaluations, "calls": min(steps, points)}
    return RUN + work(scene, geometry, counts)


def set_up(scene: Scene, fidelity: str, geometry: str) -> SetUp:
    """Return what an engine takes before its first step; of the hybrid one, to find modes once."""
    N_x, N_z = scene.N_x, scene.N_z
    n, band = 2 * N_x * N_z, 2 * min(N_x, N_z) + 2
    if N_z == 1 or scene.prescribed:
        return SetUp(0.0, 1e3 * n)
    if fidelity in ("quasistatic", "equilibrium"):  # dense rows, one after the other
        size = 2.0 * N_x
        return SetUp(N_z * size**3 * (7 / 3) / FLOPS, 6 * 8 * size**2 + 500.0 * n)
    hybrid = fidelity == "hybrid"
    factor = 8.0 * n * band
    seconds = (1 + hybrid) * factor / 8 * band / FLOPS + UNKNOWN * n
    seconds += (SOLUTIONS if hybrid else 4) * 2 * factor / BYTES + BASE * hybrid
    return SetUp(seconds, (1 + hybrid + (geometry == "finite")) * factor + 1e3 * n)


@functools.cache
def machine_speed() -> float:
    """Return the time of a factorisation here over that by `PACE`: above 1 where slower."""
    width, n = REFERENCE
    band = np.full((width + 1, n), 1e-3, order="F")
    band[0] = 1.0
    start = time.thread_time()
    dpbtrf(band, lower=1, overwrite_ab=1)
    seconds = time.thread_time() - start
    return float(np.clip(seconds * PACE / (n * width**2), FASTEST, SLOWEST))


def check_memory(scene: Scene, fidelity: str, geometry: str) -> None:
    """Raise SceneError if a run needs more memory than there is."""
    needed, there = set_up(scene, fidelity, geometry).bytes, available()
    if needed > there:
        allowed = f"a lattice that fits into the available memory, {there / 1e9:.3g} GB"
        what = f"{scene.N_x} x {scene.N_z} blocks, {fidelity} engine, {geometry} geometry"
        reason = f"about {needed / 1e9:.3g} GB are needed ({what})"
        raise SceneError("slider.l", scene.slider.l, "m", allowed, reason)
