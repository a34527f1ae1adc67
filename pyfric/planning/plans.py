"""The expected cost of levels, and `plan`, which returns it.

Work of the first level is estimated from the counts of a quasi-static sequence. Work of each later
level is estimated from the counts of the level before.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from pyfric.display import html
from pyfric.engines import (
    ENGINES,
    EVENT_STEPS,
    Options,
    Want,
    check_steps,
    coarser,
    finer_counts,
    full_counts,
    located,
    machine_speed,
    set_up,
    step_of_waves,
    work,
)
from pyfric.planning.levels import Level, alone, as_full, first_step, levels, of_named
from pyfric.record import blocks_needed, zone_of_scene
from pyfric.scene import default_geometry
from pyfric.signals import at_once
from pyfric.statics import EquilibriumError, one_thread_if_small
from pyfric.values import SceneError, check_number, usage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.record import Record
    from pyfric.scene import Number, Scene, SceneLike

ROTATION_OF_BONDS = "rotation of bonds"
MOVING = 0.8
"""Front speed at which plans also give the length of the cohesive zone, over c_R, or over the speed
of sound in a chain. A policy."""
PILOT = 0.5
"""Largest work of the quasi-static sequence that estimates costs, in s. A policy."""


def expected_work(scene: Scene, level: Level, lasts: float, before: Record | None) -> float:
    """Return the expected work of a run at a level, in s, from the counts of another run.

    Args:
        scene: the scene.
        level: the level.
        lasts: length of the run, in s.
        before: a run at another level, or None.
    """
    counts = {} if before is None else dict(before.counts)
    first = set_up(scene, level.engine, level.geometry).work
    if level.dt is None:
        return first + work(scene, "linear", counts)
    full = full_counts(scene, level.dt, lasts, level.stepper)
    if counts.get("steps"):
        ratio, stepper = before.method.dt / level.dt, before.method.stepper
        full["block_evaluations"] += located(scene, counts, stepper)
        counts = finer_counts(scene, counts, ratio, stepper, level.stepper)
    else:
        events = int(before.events["is_main"].sum()) if before is not None else 0
        times = 1.0
        if level.engine == "hybrid":  # the shorter steps of viscosity make an event take more steps
            times = EVENT_STEPS * (1 + events) * step_of_waves(scene) / max(lasts, level.dt)
        counts = {name: count * times for name, count in full.items()}
    return first + work(scene, level.geometry, full if level.engine == "dynamic" else counts)


def as_made(scene: Scene, level: Level, lasts: float, before: Record | None) -> Level:
    """Return a level, or the level with full dynamics if jumps are not expected to save work.

    The arguments are those of `expected_work`.
    """
    full = as_full(level)
    spares = level.engine != "hybrid" or expected_work(scene, level, lasts, before) < expected_work(
        scene, full, lasts, before
    )
    return level if spares else full


def left_out(scene: Scene, level: Level) -> str:
    """Return the physics that a level leaves out, in words."""
    words = [word for word in ENGINES[level.engine].leaves_out if word != ROTATION_OF_BONDS]
    if words and scene.law.flows:
        words = ["inertia between ruptures"]
    if level.geometry != default_geometry(scene):
        words.append(ROTATION_OF_BONDS)
    return "; ".join(words) or "nothing"


def work_done(record: Record) -> float:
    """Return the work of a run, in s."""
    scene, method = record.scene, record.method
    first = set_up(scene, method.engine, method.geometry).work
    return first + work(scene, method.geometry, record.counts)


@functools.lru_cache(maxsize=16)
def pilot(scene: Scene, t_end: float, stop_when: tuple[str, ...] = ()) -> Record | None:
    """Return the quasi-static sequence of a scene to t_end (s), or None if there is none.

    A large lattice is replaced by a lattice of larger blocks.
    """
    small = coarser(scene)
    small = dataclasses.replace(small, interface=small.interface.coulomb())

    def enough(run: Any) -> bool:
        return work(small, "linear", run.counts) > PILOT

    if ENGINES["hybrid"].cannot(scene) or ENGINES["quasistatic"].cannot(small):
        return None
    options = Options(stop_when=stop_when)
    try:
        return ENGINES["quasistatic"].follow(
            small, t_end, options, initial=None, progress=False, enough=enough
        )
    except EquilibriumError:
        return None


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The levels of a scene, and their expected cost.

    Attributes:
        want: the wanted quantity.
        tolerance: accepted error, over F_N (relative error for front speeds).
        levels: the levels, the cheapest first, including levels that cannot run.
        left_out: physics that each level leaves out.
        seconds: expected time of each level on one core of this machine, in s.
        alone: the level that is run if no errors are measured.
        t_end: time at which the run is expected to end, in s.
        lattice: text with the lattice constant that front speeds need within the tolerance, and the
            time of such a run; "" if the present lattice suffices, and for other quantities.
    """

    want: Want
    tolerance: float
    levels: tuple[Level, ...]
    left_out: tuple[str, ...]
    seconds: tuple[float, ...]
    alone: Level
    t_end: float
    lattice: str = ""

    def __str__(self) -> str:
        lines = [
            f"for {self.want} within {self.tolerance:g}, to about {self.t_end:.3g} s: levels are "
            "made until two that follow each other agree; the finer one is the answer"
        ]
        rows = zip(self.levels, self.left_out, self.seconds, strict=True)
        for number, (level, left_out, seconds) in enumerate(rows, 1):
            if level.cannot:
                lines.append(f"-  {level.engine}: left out ({level.cannot})")
                continue
            role = "" if level.answers else " (measures errors alone)"
            lines.append(f"{number}  {level}: about {seconds:.2g} s{role}")
            lines.append(f"   models {ENGINES[level.engine].models}; leaves out {left_out}")
        lines.append(f"without errors (verify = 'none'): {self.alone}")
        return "\n".join([*lines, *([f"lattice: {self.lattice}"] if self.lattice else ())])

    __repr__ = __str__

    _repr_html_ = html


@usage('plan(scene, t_end="400 ms", tolerance=0.01)')
@at_once()
@one_thread_if_small
def plan(
    scene: SceneLike,
    want: Want = "precursors",
    tolerance: Number = 0.01,
    *,
    t_end: Number = 1.0,
    stop_when: str | Sequence[str] | None = None,
) -> Plan:
    """Return the levels that `simulate` runs for a quantity and a tolerance, and their cost.

    A quasi-static sequence gives the expected number of events and the end of the run.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        want: "loading_curve", "precursors", "stress", "front_speed" or "motion".
        tolerance: accepted error over F_N; relative error for front speeds.
        t_end: time of the end of the run, in s.
        stop_when: conditions that end the run before t_end, see `Options`; None means the
            conditions of the scene.

    Raises:
        SceneError: an argument is refused.
        EquilibriumError: the scene has no loaded state.

    Source: `pyfric.planning.levels`.
    """
    time = want[:1].isdigit() if isinstance(want, str) else isinstance(want, int | float)
    if time:
        allowed = f"one of {', '.join(map(repr, get_args(Want)))}"
        reason = f"a time is given by its name, plan(scene, t_end={want!r})"
        raise SceneError("want", want, "", allowed, reason)
    options = Options(want=want, tolerance=tolerance, stop_when=stop_when).on(scene)
    tolerance = options.tolerance
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    found = levels(scene, options)
    for level in found:
        if level.dt is not None and not level.cannot:
            check_steps(0.0, t_end, level.dt)
    first = pilot(scene, t_end, options.stop_when)
    if first is not None and first.done:
        t_end = min(t_end, float(first.curve["t"].iloc[-1]))
    found = tuple(as_made(scene, level, t_end, first) for level in found)
    speed = machine_speed()
    seconds = [speed * expected_work(scene, level, t_end, first) for level in found]
    single = alone(found, tolerance)
    return Plan(
        want=want,
        tolerance=tolerance,
        levels=found,
        left_out=tuple(left_out(scene, level) for level in found),
        seconds=tuple(seconds),
        alone=single,
        t_end=t_end,
        lattice=_lattice(scene, options, seconds[found.index(single)]),
    )


def _lattice(scene: Scene, options: Options, seconds: float) -> str:
    """Return a text with the l that front speeds need, and the time of a run; "" if l suffices.

    A run with half the lattice constant takes 8 times as long: 4 times the blocks, twice the steps.
    """
    if options.want != "front_speed":
        return ""
    blocks, moving = zone_of_scene(scene), zone_of_scene(scene, MOVING)
    little, need = blocks_needed(scene, options.tolerance)
    if not blocks < need:
        return ""
    text = f"X_c0/l = {blocks:.2g} ({moving:.2g} at {MOVING:g} of the limiting speed), and "
    text += f"front speeds within {options.tolerance:g} need {need:.2g}"
    if need > little:
        eta = scene.eta / math.sqrt(scene.slider.k * scene.m)
        text += f" with eta = {eta:.2g} sqrt(k m), {little:.2g} with little viscosity"
    if blocks == 0:
        return f"{text}: no l resolves a front whose friction does not weaken over a length d_c"
    times = math.ceil(need / blocks)
    seconds *= times ** (2 if scene.N_z == 1 else 3)
    l = scene.slider.l / times * 1e3
    return f"{text}: l = {l:.3g} mm, {times} times smaller, about {seconds:.2g} s"


def expected_cost(scene: Scene, t_end: float, options: Options) -> tuple[float, float]:
    """Return the expected time of a run to t_end (s) in s, and the size of its record in bytes.

    A planned run is assumed to make at least two levels, and all levels up to `Plan.alone`. For a
    run that would be refused, both are 0.
    """
    options = options.on(scene)
    try:
        check_steps(0.0, t_end, first_step(scene, options))
    except SceneError:
        return 0.0, 0.0
    first = pilot(scene, t_end, options.stop_when)
    if first is not None and first.done:
        t_end = min(t_end, float(first.curve["t"].iloc[-1]))
    if options.fidelity == "auto":
        found = [level for level in levels(scene, options) if not level.cannot]
        single = alone(found, options.tolerance)
        last = max(found.index(single), 1)
        found = [single] if options.verify == "none" else found[: last + 1]
    else:
        found = [*of_named(scene, options)][: 1 if options.verify in (None, "none") else 2]
    made = sum(expected_work(scene, level, t_end, first) for level in found)
    events = 0 if first is None else len(first.events)
    return made * machine_speed(), 1e5 + 8.0 * events * (9 * scene.N_x + 40)
