"""A skip replaces steps of the hybrid engine by a solution that takes less work.

Between steps, a run asks its skip:

    wait(state)        number of steps before the next attempt, or 0
    span(state, last)  the motion over the steps that can be left out now, or None

Ring-down, stable slip and slow slip are skips. An attempt also takes work. Each skip therefore
waits until its attempts are a small share of the work of steps (`Prices`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pyfric.engines.cost import work, work_of_step

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.record import Method
    from pyfric.scene import Scene

MOSTLY = 0.5
"""Share of the time integrated step by step above which the record has a note."""


@dataclasses.dataclass(frozen=True)
class Span:
    """A solution that replaces a number of steps.

    Args:
        n: number of steps.
        F_T: function that returns the forces of the driver (N) at times since the beginning of the
            span (s), the times of the points of the curve.
        motion: function that returns the motion of the interface at such times, arrays over times
            and blocks.
        put: function that sets a state to the end of the span, energies included; None: steps lead
            to the end, because the solution is not accurate enough there.
        reach: number of steps up to which `F_T` holds; None: n.
        done: number of steps that the continued run has already recorded.
        ending: status of a run that ends with the span, or "".
    """

    n: int
    F_T: Callable[[np.ndarray], np.ndarray]
    motion: Callable[[np.ndarray], Mapping[str, np.ndarray]]
    put: Callable[[State], None] | None
    reach: int | None = None
    done: int = 0
    ending: str = ""


class Skip(Protocol):
    """A solution that replaces steps of one run."""

    def wait(self, state: State) -> int:
        """Return the number of steps before the next attempt, 0 for an attempt now."""
        ...

    def span(self, state: State, last: int) -> Span | None:
        """Return steps that can be left out, from a state to step `last` at most, or None."""
        ...

    def notes(self, counts: Mapping[str, int]) -> tuple[str, ...]:
        """Return notes for the record on the use of the skip, from counts of operations."""
        ...


class Prices:
    """Work of operations, in units of the work of a step.

    Args:
        scene: the scene.
        method: the method of the run.
    """

    def __init__(self, scene: Scene, method: Method) -> None:
        self.scene, self.geometry = scene, method.geometry
        self._step = work_of_step(scene, method.geometry, method.stepper)

    def in_steps(self, counts: Mapping[str, int]) -> float:
        """Return the work of counted operations, in units of a step."""
        return work(self.scene, self.geometry, counts) / self._step


def mostly_stepped(counts: Mapping[str, int], why: str) -> tuple[str, ...]:
    """Return a note with the reason `why` if most of the time was integrated step by step."""
    share = counts["steps"] / max(counts["steps"] + counts["steps_spared"], 1)
    if share <= MOSTLY or counts["steps"] < 1000:
        return ()
    said = f"{100 * share:.0f} % of the time was integrated like in full dynamics"
    return (f"{said} (more than {100 * MOSTLY:.0f} %): {why}",)
