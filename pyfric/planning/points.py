"""The level that a scene needs, from the verified run of a similar scene.

The difference of two runs is the error of the coarser run. If this error is within the tolerance,
the coarser level suffices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from pyfric.planning.levels import Level, as_full, levels, of_named

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pyfric.engines import Options
    from pyfric.record import Model, Record
    from pyfric.scene import Scene


class Told(NamedTuple):
    """Measured errors of levels in a run; levels are numbered from 0.

    Attributes:
        made: the model of the record.
        level: number of the record's level, in which full dynamics may replace the hybrid engine.
        needs: number of the cheapest level within the tolerance. If the two compared levels differ
            by more than the tolerance, `needs` is the next level above both.
        errors: errors of the compared levels, of all events or of events before the first
            difference.
        holds: whether the error of the record is within the tolerance; None if not measured over
            the whole run.
    """

    made: Model
    level: int
    needs: int
    errors: Mapping[int, float]
    holds: bool | None


def levels_of(scene: Scene, options: Options) -> tuple[Level, ...]:
    """Return the levels of a run from the loaded slider, with a named engine or "auto"."""
    return (levels if options.fidelity == "auto" else of_named)(scene, options)


def told(record: Record, of: Sequence[Level]) -> Told:
    """Return the measured errors in a record, assigned to the levels of its scene that can run."""
    numbers: dict[Model, int] = {}
    for number, level in enumerate(of):
        numbers |= {level.model: number, as_full(level).model: number}
    made, errors = record.method.model, record.errors
    own = numbers[made]
    error = None if errors is None else errors.measured()
    if error is None:
        return Told(made, own, own, {}, None)
    other = numbers[errors.by[0]]
    needs = min(own, other) if errors.holds else max(own, other) + 1
    return Told(made, own, needs, {own: error, other: error}, errors.holds)
