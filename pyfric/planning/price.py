"""Price of measured errors: possible reference runs, and the budget that pays for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from pyfric.core import STEPPERS
from pyfric.engines import RUN, default_switching, finer_counts, full_counts, located, work
from pyfric.scene import default_geometry
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pyfric.engines import Options
    from pyfric.scene import Geometry, Scene

PLAIN, CHEAP = 2.0, 0.5
"""Largest work of verification, in s: `PLAIN` times the work of the run, plus `CHEAP`."""
RATIOS = (4.0, 3.0, 2.5, 2.0)
"""Possible ratios of the step of a run to that of its reference run. With a smaller ratio both runs
could deviate in the same event."""
USABLE = 0.95
"""Longest step of an opposite stepper over its stability limit, which is that at rest."""


class Reference(NamedTuple):
    """A possible reference run: engine, stepper, step and work in s."""

    engine: str
    stepper: str
    dt: float
    work: float


class Runs(NamedTuple):
    """A run with each of the engines that could make it.

    Attributes:
        scene: the scene.
        geometry: geometry of reference runs.
        counts: operations by engine: see `operations`.
        stepper, dt, switching: how steps are made; dt in s.
    """

    scene: Scene
    geometry: Geometry
    counts: Mapping[str, Mapping[str, float]]
    stepper: str
    dt: float
    switching: str

    def like(self, stepper: str, dt: float) -> Runs:
        """Return these runs with another stepper and a shorter step (s)."""
        counts = {
            engine: finer_counts(self.scene, made, self.dt / dt, self.stepper, stepper)
            for engine, made in self.counts.items()
        }
        return self._replace(counts=counts, stepper=stepper, dt=dt)

    def references(self) -> list[Reference]:
        """Return possible reference runs, the best one first.

        They resolve weakening of friction, if some can.
        """
        scene, stepper, dt = self.scene, self.stepper, self.dt
        ways = [(stepper, dt / ratio) for ratio in RATIOS]
        opposite = STEPPERS[stepper].opposite if self.switching == "located" else ""
        if opposite:
            longest = USABLE * stability_limit(scene, opposite)[0]
            ways = [(opposite, step) for _, step in ways if step <= longest] + ways
        resolve = [way for way in ways if way[1] <= scene.resolving_step]
        return [
            Reference(engine, *way, RUN + work(scene, self.geometry, counts))
            for way in resolve or ways
            for engine, counts in self.like(*way).counts.items()
        ]


def operations(
    scene: Scene, engine: str, counts: Mapping[str, float], dt: float, lasts: float, stepper: str
) -> dict[str, Mapping[str, float]]:
    """Return the operations of full dynamics and of a run with the same step, by engine.

    Args:
        scene: the scene.
        engine: engine of the run.
        counts: its operations, see `pyfric.engines.cost.work`. As many transitions are located by
            full dynamics.
        dt, lasts: step and duration, in s.
        stepper: the stepper of both.
    """
    full = full_counts(scene, dt, lasts, stepper)
    full["block_evaluations"] += located(scene, counts, stepper)
    return {"dynamic": full, engine: counts}


def budget(made: float) -> float:
    """Return the largest work of verification, in s, for a run whose work is `made`."""
    return PLAIN * made + CHEAP


def affordable(possible: Sequence[Reference], left: float) -> Reference | None:
    """Return the best reference run whose work is at most `left` (s), or None."""
    return next((run for run in possible if run.work <= left), None)


def verification_work(made: float, runs: Runs) -> tuple[float, float]:
    """Return the work (s) of verification, and what is added if the run has to be refined.

    The refined run is the first reference run. It is compared with a second one. Whatever cannot be
    paid for otherwise uses up the budget.

    Args:
        made: work of the run, in s.
        runs: the run, with each engine.
    """
    left = budget(made)
    first = affordable(runs.references(), left)
    if first is None:
        return left, 0.0
    left -= first.work
    second = affordable(runs.like(first.stepper, first.dt).references(), left)
    return first.work, second.work if second else left


def price(
    scene: Scene,
    options: Options,
    engine: str,
    geometry: Geometry,
    dt: float,
    t_end: float,
    made: float,
    counts: dict[str, float] | None = None,
) -> tuple[float, float]:
    """Return the work (s) of verification, and what is added if the run has to be refined.

    Jumps of a reference run in another geometry are not counted: its price is then the budget.

    Args:
        scene: the scene.
        options: options of the run.
        engine, geometry: its engine and geometry.
        dt: its step, in s.
        t_end: its length, in s.
        made: its work, in s.
        counts: its operations; None means those of full dynamics without located transitions.
    """
    if options.verify == "none":
        return 0.0, 0.0
    if engine in ("quasistatic", "equilibrium"):
        return budget(made), 0.0
    stepper, of_reference = options.stepper, options.geometry or default_geometry(scene)
    counts = counts or full_counts(scene, dt, t_end, stepper, options.calls_on(scene))
    each = operations(scene, engine, counts, dt, t_end, stepper)
    switching = options.switching or default_switching(scene)
    runs = Runs(scene, of_reference, each, stepper, dt, switching)
    first, more = verification_work(made, runs)
    if engine == "hybrid" and geometry != of_reference:
        first = budget(made)
    return first, more
