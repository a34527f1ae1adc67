"""What a run at one point tells of the levels that other points need.

The difference of two runs is the error of the coarser one. Where it is within the tolerance, the
coarser level suffices, although the finer run is returned.
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
    """What a run tells of levels, by their numbers from 0.

    Attributes:
        made: the model of the record.
        level: number of its level; full dynamics may be in the place of the hybrid engine.
        needs: the cheapest level that keeps the tolerance, as far as was measured. If the two
            levels that were compared differ by more than that, it is the next one above both.
        errors: errors of the levels that were compared, of all events or of those before the first
            one that differs.
        holds: whether the record keeps the tolerance; None where not all was measured.
    """

    made: Model
    level: int
    needs: int
    errors: Mapping[int, float]
    holds: bool | None


def levels_of(scene: Scene, options: Options) -> tuple[Level, ...]:
    """Return the levels of a run from the loaded slider, whether its engine is named or not."""
    return (levels if options.fidelity == "auto" else of_named)(scene, options)


def told(record: Record, of: Sequence[Level]) -> Told:
    """Return what a record tells of the levels of its scene that can be made."""
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
