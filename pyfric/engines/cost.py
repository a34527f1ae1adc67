"""Cost of a run: work and memory.

Work is counted in operations and expressed in seconds on one core of a reference machine. Decisions
by work are therefore the same on every machine: the choice of a level, the end of a reference run,
and the times of attempts to jump. `machine_speed` converts work into seconds on this machine.
"""

from __future__ import annotations

import functools
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import STEPPERS, available
from pyfric.engines.strains import largest_strain
from pyfric.scene import setup1
from pyfric.statics import loaded_state
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene

EVALUATION, BOTTOM, BLOCK = 1.3e-6, 5e-9, {"linear": 3.5e-9, "finite": 8.5e-9}
"""Time of one force evaluation, in s: a constant, a part for each bottom block, and a part for each
block of the lattice. The constant includes checks of states."""
BEYOND, CLOSED = 2.0**-8, 10e-9
"""Strain beyond which the core also computes bonds in closed form, and additional time of one force
evaluation for each block, in s. Below this strain, a series in (r^2 - l0^2)/l0^2 is accurate. This
variable is about twice the strain, and its limit 2^-7."""
JUNCTION = 1.25e-9
"""Additional time of one force evaluation for each junction, in s."""
RATED, SLOW_STEP = (7e-7, 9e-8), (2e-4, 2.5e-7)
"""Times for rate-and-state friction, in s. Additional time of one force evaluation: a constant, and
a part for each bottom block. Time of one step of slow slip: a constant, and a part over N_x^2."""
CALL = 1.5e-4
"""Time of one call of the core, in s. Runs with conditions, or with a law that records motion, need
a call for each point of the loading curve. Recording motion doubles the time of a call."""
ATTEMPT = {"linear": (0.5e-3, 0.2e-8), "finite": (1.0e-3, 1.0e-8)}
LANDING = {"linear": (0.5e-3, 0.4e-8), "finite": (1.2e-3, 1.2e-8)}
"""Time of an attempt to jump before the end of the jump is predicted, and time of one prediction of
this end, in s. Each time is a constant, and a part for each number of a banded factor. The times
include the calls of the core before and after a jump."""
SLIDE = (1.4e-2, 6e-8)
"""Additional time of an attempt to jump if blocks slip, in s: a constant, and a part for each
number of a banded factor."""
EVENT_STEPS = 130.0
"""Work of the hybrid engine for each main event, in time steps of the scene without viscosity. In
20 of 21 runs of all sizes it was 34 to 570. The work is inversely proportional to the step."""
POINTS = 5000
"""Default number of points of the loading curve."""
RUN = 0.015
"""Time that a run takes before its first step and after its last step, in s."""
RELEASE, STATIC_EVENT = 2.2e-9, 4e-6
"""Times of the quasi-static engine, in s: for the release of a block, over N_x^2; for an event."""
FLOPS, UNKNOWN, MODES = 8e9, 3e-6, 13e-6
"""Operations per second in a banded factorisation and in solutions with its factor; and, for each
unknown, remaining time (s) of the loaded state and of the modes of one set of contact states."""
TIMED = 250
"""Number of time steps whose time `machine_speed` measures."""
FASTEST, SLOWEST = 0.2, 10.0
"""Smallest and largest result of `machine_speed`. Values beyond these limits are errors."""


class SetUp(NamedTuple):
    """Work (s) and largest memory (bytes) of an engine before its first step."""

    work: float
    bytes: float


@functools.lru_cache(16)
def prices(scene: Scene, geometry: Geometry) -> dict[str, float]:
    """Return the work of one operation, for each kind that a record counts, in s."""
    blocks = scene.N_x * scene.N_z
    evaluation = EVALUATION + BOTTOM * scene.N_x + BLOCK[geometry] * blocks
    evaluation += JUNCTION * scene.law.junctions * scene.N_x
    if scene.law.flows:
        evaluation += RATED[0] + RATED[1] * scene.N_x
    if geometry == "finite" and largest_strain(scene, 0.0) > BEYOND:
        evaluation += CLOSED * blocks
    numbers = blocks * _band(scene)
    dynamic, hybrid = (set_up(scene, fidelity, geometry).work for fidelity in ("dynamic", "hybrid"))
    return {
        "block_evaluations": evaluation / blocks,
        "calls": CALL * (2 if scene.law.junctions else 1),
        "attempts": ATTEMPT[geometry][0] + ATTEMPT[geometry][1] * numbers,
        "landings": LANDING[geometry][0] + LANDING[geometry][1] * numbers,
        "slow_steps": SLOW_STEP[0] + SLOW_STEP[1] * scene.N_x**2,
        "slides": SLIDE[0] + SLIDE[1] * numbers,
        "modal_bases": hybrid - dynamic,
        "releases": RELEASE * scene.N_x**2,
        "static_events": STATIC_EVENT,
    }


def work(scene: Scene, geometry: Geometry, counts: Mapping[str, float]) -> float:
    """Return the work of the operations that a record counts, in s."""
    return sum(price * counts.get(name, 0) for name, price in prices(scene, geometry).items())


def work_of_step(scene: Scene, geometry: Geometry, stepper: str) -> float:
    """Return the work of one step without located transitions, in s."""
    return work(scene, geometry, full_counts(scene, 1.0, 1.0, stepper))


def work_so_far(record: Record) -> float:
    """Return the work that a run with time steps has done, in s."""
    return work(record.scene, record.method.geometry, record.counts)


def full_counts(
    scene: Scene, dt: float, lasts: float, stepper: str, calls: int = 0
) -> dict[str, float]:
    """Return the counts of operations of full dynamics with steps dt (s) over `lasts` (s).

    Steps that locate transitions are not counted, because their number is unknown before the run.
    """
    steps = lasts / dt
    evaluations = STEPPERS[stepper].evaluations * steps * scene.N_x * scene.N_z
    return {"steps": steps, "block_evaluations": evaluations, "calls": min(calls, steps)}


def located(scene: Scene, counts: Mapping[str, float], stepper: str) -> float:
    """Return the number of block evaluations that located transitions, outside of whole steps."""
    of_steps = STEPPERS[stepper].evaluations * counts["steps"] * scene.N_x * scene.N_z
    return max(counts["block_evaluations"] - of_steps, 0.0)


def finer_counts(
    scene: Scene, counts: Mapping[str, float], ratio: float, old: str, new: str
) -> dict[str, float]:
    """Return the counts of operations of a run with a new stepper and `ratio` times as many steps.

    Numbers of jumps, calls, and steps that locate transitions do not change.
    """
    of_steps = counts["block_evaluations"] - located(scene, counts, old)
    evaluations = counts["block_evaluations"] + (ratio - 1) * of_steps
    evaluations *= STEPPERS[new].evaluations / STEPPERS[old].evaluations
    return {**counts, "steps": ratio * counts["steps"], "block_evaluations": evaluations}


def full_work(
    scene: Scene,
    geometry: Geometry,
    dt: float,
    lasts: float,
    stepper: str,
    calls: int = 0,
) -> float:
    """Return the work (s) of full dynamics with steps dt over a time `lasts`, both in s."""
    return RUN + work(scene, geometry, full_counts(scene, dt, lasts, stepper, calls))


def _band(scene: Scene) -> int:
    """Return the number of columns in the band of a factorised stiffness matrix."""
    return 2 * min(scene.N_x, scene.N_z) + 2


def set_up(scene: Scene, fidelity: str, geometry: str) -> SetUp:
    """Return the work and memory of an engine before its first step.

    For the hybrid engine this includes the modes of one set of contact states.
    """
    N_x, N_z = scene.N_x, scene.N_z
    n, band = 2 * N_x * N_z, _band(scene)
    if N_z == 1 or scene.prescribed:
        return SetUp(0.0, 1e3 * n)
    if fidelity in ("quasistatic", "equilibrium"):  # dense matrices, one for each row of blocks
        size = 2.0 * N_x
        return SetUp(N_z * size**3 * (7 / 3) / FLOPS, 6 * 8 * size**2 + 500.0 * n)
    hybrid = fidelity == "hybrid"
    factor = 8.0 * n * band
    factorised = factor / 8 * band / FLOPS
    seconds = factorised + UNKNOWN * n + hybrid * (factorised + MODES * n)
    return SetUp(seconds, (1 + hybrid + (geometry == "finite")) * factor + 1e3 * n)


@functools.cache
def machine_speed() -> float:
    """Return the time of steps of the paper's slider over their work; above 1 on slow machines.

    Steps are made on one thread. An equal number of steps without timing comes first.
    """
    scene, dt, seconds = setup1(), 2e-7, 0.0  # the step of the paper
    state = loaded_state(scene, "finite").state(scene, dt)
    model, log = core.model(scene, "finite", state.u_drv0), core.Log(scene.N_x)
    for _ in range(2):
        start = time.thread_time()
        core.advance(model, state, log, TIMED, switching="located", budget=False)
        seconds = time.thread_time() - start
    expected = work(scene, "finite", full_counts(scene, dt, TIMED * dt, "rk4"))
    return float(np.clip(seconds / expected, FASTEST, SLOWEST))


def check_memory(scene: Scene, fidelity: str, geometry: str) -> None:
    """Raise SceneError if a run needs more memory than is available."""
    needed, free_bytes = set_up(scene, fidelity, geometry).bytes, available()
    if needed > free_bytes:
        allowed = f"a lattice that fits into the available memory, {free_bytes / 1e9:.3g} GB"
        what = f"{scene.N_x} x {scene.N_z} blocks, {fidelity} engine, {geometry} geometry"
        reason = f"about {needed / 1e9:.3g} GB are needed ({what})"
        raise SceneError("slider.l", scene.slider.l, "m", allowed, reason)
