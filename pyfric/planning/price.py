"""Price of measured errors: possible reference runs, and the budget that pays for them."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

from pyfric.engines import RUN, finer_counts, full_counts, located, work
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pyfric.engines import Options
    from pyfric.scene import Geometry, Scene

PLAIN, CHEAP = 2.0, 0.5
"""Largest work of verification, in s: `PLAIN` times the work of the run, plus `CHEAP`."""
RATIOS = (4.0, 3.5, 3.0, 2.5, 2.0)
"""Possible ratios of the step of a run to that of its reference run."""


class Reference(NamedTuple):
    """A possible reference run: engine, ratio of the step of the run to its own, work in s."""

    engine: str
    ratio: float
    work: float


def operations(
    scene: Scene, engine: str, counts: Mapping[str, float], full: Mapping[str, float], stepper: str
) -> dict[str, Mapping[str, float]]:
    """Return the operations of full dynamics and of a run with the same step, by engine.

    Args:
        scene: the scene.
        engine: engine of the run.
        counts: its operations, see `pyfric.engines.cost.work`.
        full: those of full dynamics, without located transitions, of which there are as many.
        stepper: the stepper of both.
    """
    evaluations = full["block_evaluations"] + located(scene, counts, stepper)
    return {"dynamic": {**full, "block_evaluations": evaluations}} | {engine: counts}


def references(
    scene: Scene,
    geometry: Geometry,
    runs: Mapping[str, Mapping[str, float]],
    stepper: str,
    ratios: Sequence[float] = RATIOS,
) -> list[Reference]:
    """Return possible reference runs, the best one first.

    Args:
        scene: the scene.
        geometry: geometry of reference runs.
        runs: result of `operations`.
        stepper: the stepper.
        ratios: ratios of the step of the run to those of reference runs.
    """
    found = []
    for ratio in ratios:
        for engine, counts in runs.items():
            finer = finer_counts(scene, counts, ratio, stepper)
            found.append(Reference(engine, ratio, RUN + work(scene, geometry, finer)))
    return found


def budget(made: float) -> float:
    """Return the largest work of verification, in s, for a run whose work is `made`."""
    return PLAIN * made + CHEAP


def affordable(possible: Sequence[Reference], left: float) -> Reference | None:
    """Return the best reference run whose work is at most `left` (s), or None."""
    return next((one for one in possible if one.work <= left), None)


def verification_work(
    made: float, possible: Callable[[Sequence[float]], Sequence[Reference]]
) -> tuple[float, float]:
    """Return the work (s) of verification, and what is added if the run has to be refined.

    The refined run is the first reference run. It is compared with a second one. Whatever cannot be
    paid for otherwise uses up the budget.

    Args:
        made: work of the run, in s.
        possible: function that returns the reference runs with these ratios of steps.
    """
    left = budget(made)
    first = affordable(possible(RATIOS), left) or Reference("", 1.0, left)
    left -= first.work
    second = affordable(possible([first.ratio * ratio for ratio in RATIOS]), left)
    return first.work, second.work if second else left


def price(
    scene: Scene,
    options: Options,
    engine: str,
    dt: float,
    t_end: float,
    made: float,
    counts: dict[str, float] | None = None,
) -> tuple[float, float]:
    """Return the work (s) of verification, and what is added if the run has to be refined.

    Args:
        scene: the scene.
        options: options of the run.
        engine: its engine.
        dt: its step, in s.
        t_end: its length, in s.
        made: its work, in s.
        counts: its operations; None means those of full dynamics without located transitions.
    """
    if options.verify == "none":
        return 0.0, 0.0
    if engine in ("quasistatic", "equilibrium"):
        return budget(made), 0.0
    stepper, geometry = options.stepper, options.geometry or default_geometry(scene)
    full = full_counts(scene, dt, t_end, stepper, options.calls_on(scene))
    runs = operations(scene, engine, counts or full, full | {"calls": 0}, stepper)
    return verification_work(made, functools.partial(references, scene, geometry, runs, stepper))
