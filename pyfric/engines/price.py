"""Cost of verification: the reference runs that a budget pays for.

The steps of a reference run are shorter than those of the run, by one of the factors `RATIOS`. The
largest factor within the budget is taken, and full dynamics rather than the hybrid engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from pyfric.engines.cost import (
    RUN,
    evaluations_of_steps,
    finer_counts,
    full_counts,
    work,
)
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pyfric.engines.options import Options
    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene

__all__ = [
    "CHEAP",
    "RATIOS",
    "Operations",
    "Reference",
    "affordable",
    "budget",
    "price",
    "verification_work",
]

PLAIN, CHEAP = 2.0, 0.5
"""Largest work of verification, in s: `PLAIN` times the work of the run, plus `CHEAP`."""
RATIOS = (4.0, 2.0, 1.5, 1.25)
"""Ratios of the step of a run to that of its reference run."""


class Reference(NamedTuple):
    """A possible reference run: engine, ratio of the step of the run to its own, work in s."""

    engine: str
    ratio: float
    work: float


@dataclass(frozen=True, kw_only=True)
class Operations:
    """Operations of a run with time steps, made or expected.

    Attributes:
        scene: the scene.
        engine, dt, stepper: engine, step in s, and stepper of the run.
        lasts: length of the run, in s.
        counts: its operations, see `pyfric.engines.cost.work`.
        geometry: geometry of reference runs.
    """

    scene: Scene
    engine: str
    dt: float
    stepper: str
    lasts: float
    counts: Mapping[str, float]
    geometry: Geometry

    @classmethod
    def of(cls, record: Record, lasts: float, geometry: Geometry) -> Operations:
        """Return the operations of a record."""
        method = record.method
        return cls(
            scene=record.scene,
            engine=method.engine,
            dt=method.dt,
            stepper=method.stepper,
            lasts=lasts,
            counts=record.counts,
            geometry=geometry,
        )

    def finer(self, engine: str, ratio: float) -> float:
        """Return the work (s) of a run of an engine with steps shorter by a ratio."""
        scene, counts = self.scene, self.counts
        if engine == self.engine:
            finer = finer_counts(scene, counts, ratio, self.stepper)
        else:
            finer = full_counts(scene, self.dt / ratio, self.lasts, self.stepper)
            located = evaluations_of_steps(scene, counts, self.stepper)
            finer["block_evaluations"] += counts["block_evaluations"] - located
        return RUN + work(scene, self.geometry, finer)

    def references(self, ratio: float = 1.0, ratios: Sequence[float] = RATIOS) -> list[Reference]:
        """Return the reference runs of a run with steps shorter by a ratio, the best one first."""
        engines = dict.fromkeys(("dynamic", self.engine))
        each = [(engine, ratio * r) for r in ratios for engine in engines]
        return [Reference(engine, r, self.finer(engine, r)) for engine, r in each]


def budget(made: float) -> float:
    """Return the largest work of verification, in s, for a run whose work is `made`."""
    return PLAIN * made + CHEAP


def affordable(references: Sequence[Reference], left: float) -> Reference | None:
    """Return the best reference run whose work is at most `left` (s), or None."""
    return next((one for one in references if one.work <= left), None)


def verification_work(
    made: float, references: Callable[[float], Sequence[Reference]]
) -> tuple[float, float]:
    """Return the work (s) of verification, and what is added if the run has to be refined.

    The refined run is the first reference run. It is compared with a second one. Whatever cannot be
    paid for otherwise uses up the budget.

    Args:
        made: work of the run, in s.
        references: function that returns the reference runs of a run with steps shorter by a ratio.
    """
    left = budget(made)
    first = affordable(references(1.0), left) or Reference("", 1.0, left)
    left -= first.work
    second = affordable(references(first.ratio), left)
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
        counts: operations of a hybrid run.
    """
    if options.verify == "none":
        return 0.0, 0.0
    if engine in ("quasistatic", "equilibrium"):
        return budget(made), 0.0
    run = Operations(
        scene=scene,
        engine=engine,
        dt=dt,
        stepper=options.stepper,
        lasts=t_end,
        counts=counts or full_counts(scene, dt, t_end, options.stepper, options.calls),
        geometry=options.geometry or default_geometry(scene),
    )
    return verification_work(made, run.references)
