"""What a run takes, counted: before the first step, in steps and jumps, and to measure its errors.

Static states and modes are counts of operations, by the size of the lattice, times the pace of this
machine. What is decided by cost looks at counts alone, so that it is the same on every machine.
"""

from __future__ import annotations

import functools
import math
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf

from pyfric.core import available
from pyfric.engines.modes import N_MODES
from pyfric.engines.options import step_size
from pyfric.scene import SceneError, default_geometry
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from pyfric.scene import Geometry, Scene

__all__ = [
    "CHEAP",
    "FINEST",
    "NS",
    "WORTH",
    "Beside",
    "SetUp",
    "beside",
    "beside_ladder",
    "check_memory",
    "coarser_step",
    "evaluations_of_events",
    "pace",
    "set_up",
    "stepped",
    "verification",
    "work",
]

NS = {"linear": 3.1, "finite": 6.3}
"""Time per block and force evaluation in ns, for the expected cost (`pyfric bench kernel`)."""
JUMP = {"linear": 3e-6, "finite": 15e-6}
"""Time of a jump per block, in s."""
RELEASE = 1e-8
"""Time of the release of a block in the ladder, over N_x^2, in s."""
RING, STEPS_EVENT, STEPS_BLOCK, STEPS_SWITCH = 0.06, 60, 5, 7
"""What an event takes in the hybrid engine: until the slider may be left to its modes, this many
times the decay time of what they leave out (a chain: steps); steps of the automatic size for each
block of its front; and steps more to locate its switches. Measured on the paper's scenes and with
half their l: within a factor of 2. Six other scenes (setups 1 and 2 with other L, H, l, eta, K, F_N
and mu; 17 to 54 % of their steps are ring-down), up to the eighth main event, in both geometries,
before jumps began earlier and with 0.12 and 10: plans count 0.94 to 1.75 times what runs take, 0.91
to 1.56 with the run's own number of events. Six runs of the paper's scenes since: 0.7 to 1.7."""
FINE_RING = 0.18
"""The same number of decay times where modes are those of `fine`, of which there are more. Measured
on the Fig. 1 scene at l = 1.25 and 0.625 mm, with 0.22 before jumps began earlier: within a factor
of 1.3. On 17 runs of the paper's figures, with their own number of events: 0.45 to 1.56 times what
they take; a fifth in setup 2 with theta = 0.833, where blocks of little load slip on and on."""
CHEAP = 0.5
"""A run that measures errors and takes less than this is made whole, s."""
FINEST = 4
"""The run's own step over that of the finest run beside it."""
WORTH = 4.0
"""Where full dynamics takes at most so many times as long, it measures the errors of jumps."""
LONGER, NEAR = 2.0, 0.95
"""The coarser run's step over the run's own; at most this share of the stability limit."""
PARTS = 20
"""The part of a run that is compared is a number of these: rounding does not change it."""

FLOPS, BYTES, UNKNOWN = 13e9, 11.6e9, 25e-6
"""Operations per second of a banded factorisation, bytes per second of its solutions, and seconds
for all else about one unknown. Measured on the Fig. 1 scene at l = 1.25 to 0.5 mm."""
REFERENCE, PACE = (250, 3000), 25e9
"""Half width and length of the band that is factorised to tell the pace of this machine, and the
operations per second of that, which fits into the cache, where the numbers above were measured."""
SOLUTIONS = {"hybrid": 84, "dynamic": 4}
"""Solutions with the factors before the first step: nearly all of them find modes."""
FINE_SOLUTIONS = 30
"""The same for the hybrid engine where modes are those of `fine`."""
FACTORS = {"hybrid": 2, "dynamic": 1}
"""Factorisations before the first step."""


class SetUp(NamedTuple):
    """Time in s on one core, and largest memory in bytes."""

    seconds: float
    bytes: float


class Beside(NamedTuple):
    """A run that measures errors of another: its step (s), the part of the other that it covers,
    its counted time on one core, in s, and whether it is full dynamics."""

    dt: float
    share: float
    seconds: float
    whole: bool = False


def work(blocks: int, evaluations: float, jumps: float, geometry: Geometry) -> float:
    """Return the counted time of block evaluations, and of jumps of a lattice, in s."""
    return evaluations * NS[geometry] * 1e-9 + jumps * JUMP[geometry] * blocks


def evaluations_of_events(
    scene: Scene,
    events: float,
    front_blocks: float,
    geometry: Geometry,
    dt: float,
    steps: float = math.inf,
) -> float:
    """Return the block evaluations of events in the hybrid engine.

    Args:
        scene: the scene.
        events: their number.
        front_blocks: blocks of all their fronts together.
        geometry: its geometry.
        dt: step of the run, in s.
        steps: most steps that they can take.
    """
    auto = step_size(scene)
    ringing = STEPS_EVENT * auto
    if scene.N_z > 1 and scene.eta > 0:
        ringing = RING / _truncated_decay(scene)
    lasts = events * ringing + front_blocks * STEPS_BLOCK * auto
    steps = min(steps, lasts / dt) + front_blocks * STEPS_SWITCH
    return 4.0 * steps * scene.N_x * scene.N_z


def _truncated_decay(scene: Scene) -> float:
    """Return roughly the rate at which motions faster than the modes kept decay, in 1/s.

    Below omega there are L H omega^2 (1/c_s^2 + 1/c_l^2)/(4 pi) modes (Weyl's law); here
    c_l^2 = 3 c_s^2.
    """
    slider = scene.slider
    c_s2 = slider.l**2 * slider.k / (2 * scene.m)
    omega2 = 3 * math.pi * N_MODES * c_s2 / (slider.L * slider.H)
    return omega2 * scene.eta / (4 * slider.k)


def coarser_step(scene: Scene, dt: float) -> float:
    """Return the step of the coarser run, in s; half the step where there is none."""
    ratio = min(LONGER, NEAR * stability_limit(scene)[0] / dt)
    return dt * (ratio if ratio > 1.25 else 0.5)


def beside(
    scene: Scene,
    evaluations: float,
    jumps: float,
    geometry: Geometry,
    dt: float,
    cheap: float = CHEAP,
    lasts: float = math.inf,
) -> Beside:
    """Return the run that measures errors of another one at the price of that, or `cheap`, in s.

    It has a quarter or half of the step where it can cover the whole, and longer steps otherwise.
    Beside a run with jumps it is full dynamics, of a run that `lasts` so long, in s, where that can
    cover the whole (`stepped`).
    """
    blocks, other = scene.N_x * scene.N_z, default_geometry(scene)
    most = max(work(blocks, evaluations, jumps, geometry), cheap)
    for step in (dt / FINEST, dt / 2, coarser_step(scene, dt)):
        counted = evaluations * dt / step, jumps
        whole = stepped(scene, *counted, step, lasts)
        if whole is not None and whole <= most:
            return Beside(step, 1.0, whole, whole=True)
        seconds = work(blocks, *counted, other)
        if seconds <= most:
            return Beside(step, 1.0, seconds)
    share = max(math.floor(PARTS * most / seconds), 1) / PARTS
    return Beside(step, share, share * seconds)


def stepped(
    scene: Scene, evaluations: float, jumps: float, dt: float, lasts: float
) -> float | None:
    """Return the counted time of full dynamics in place of a run with jumps, in s.

    None where there are no jumps, or where they spare much: more than `WORTH` times.
    """
    blocks, geometry = scene.N_x * scene.N_z, default_geometry(scene)
    whole = work(blocks, 4.0 * lasts / dt * blocks, 0, geometry)
    worth = WORTH * work(blocks, evaluations, jumps, geometry)
    return whole if jumps and whole <= worth else None


def verification(
    scene: Scene,
    mode: str | None,
    counted: tuple[float, float],
    geometry: Geometry,
    dt: float,
    lasts: float,
) -> float:
    """Return the counted time in which the errors of a run are measured, in s.

    Args:
        scene: the scene.
        mode: `Options.verify`.
        counted: block evaluations and jumps of the run.
        geometry, dt, lasts: its own geometry, step and length, in s.
    """
    blocks, (evaluations, jumps) = scene.N_x * scene.N_z, counted
    if mode == "none":
        return 0.0
    if mode == "full":
        finer = work(blocks, FINEST * evaluations, jumps, default_geometry(scene))
        return finer + work(blocks, evaluations, jumps, geometry)
    return beside(scene, *counted, geometry, dt, 0.0 if mode else CHEAP, lasts).seconds


def beside_ladder(scene: Scene, events: int, front_blocks: int, dt: float) -> Beside:
    """Return the run of the hybrid engine that measures errors of a ladder in the same way.

    Its share is 0 where not even one event is paid for.
    """
    geometry = default_geometry(scene)
    ready = set_up(scene, "hybrid", geometry).seconds / pace()
    own = set_up(scene, "quasistatic", "linear").seconds / pace()
    own += RELEASE * front_blocks * scene.N_x**2
    made = evaluations_of_events(scene, events, front_blocks, geometry, dt)
    seconds = work(scene.N_x * scene.N_z, made, events, geometry)
    share = min((max(own, CHEAP) - ready) / max(seconds, 1e-30), 1.0)
    share = max(math.floor(share * max(events, 1)), 0) / max(events, 1)
    return Beside(dt, share, ready + share * seconds if share else 0.0)


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
    solutions = SOLUTIONS[fidelity]
    seconds += solutions * 2 * kept / BYTES + UNKNOWN * n
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


def check_memory(scene: Scene, fidelity: str, geometry: str) -> None:
    """Raise SceneError if a run needs more memory than there is."""
    needed, there = set_up(scene, fidelity, geometry).bytes, available()
    if needed > there:
        allowed = f"a lattice that fits into the memory there is, {there / 1e9:.3g} GB"
        what = f"{scene.N_x} x {scene.N_z} blocks, {fidelity} engine, {geometry} geometry"
        reason = f"about {needed / 1e9:.3g} GB are needed ({what})"
        raise SceneError("slider.l", scene.slider.l, "m", allowed, reason)
