"""A skip replaces steps of the hybrid engine by a solution that takes less work.

Between steps, a run asks its skip:

    wait(state)        number of steps before the next attempt, or 0
    span(state, last)  the motion over the steps that can be left out now, or None

Ring-down, stable slip and slow slip are skips. An attempt takes work itself. Each skip waits until
its attempts take no more than a set share of the work of steps (`Prices`).
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
"""The record has a note if a larger share of the time than this was integrated step by step."""


@dataclasses.dataclass(frozen=True)
class Span:
    """Steps that can be left out.

    Args:
        n: number of steps.
        F_T: function of times since its beginning (s), at the points of the curve, that returns the
            forces of the driver, in N.
        motion: function of the same times that returns the motion of the interface, arrays over
            times and blocks.
        put: function that sets a state to the end of the span, energies included; None: the end is
            not known well enough, and steps lead to it.
        reach: number of steps up to which `F_T` is asked; None: n.
        done: number of steps that a run before this one has recorded.
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
        """Return notes on the steps that were left out."""
        ...


class Prices:
    """Work of operations, in units of the work of a step.

    Args:
        scene: the scene.
        method: how it is run.
    """

    def __init__(self, scene: Scene, method: Method) -> None:
        self.scene, self.geometry = scene, method.geometry
        self._step = work_of_step(scene, method.geometry, method.stepper)

    def in_steps(self, counts: Mapping[str, int]) -> float:
        """Return the work of counted operations, in units of a step."""
        return work(self.scene, self.geometry, counts) / self._step


def mostly_stepped(counts: Mapping[str, int], why: str) -> tuple[str, ...]:
    """Return a note if most of the time was integrated step by step, as in full dynamics."""
    share = counts["steps"] / max(counts["steps"] + counts["steps_spared"], 1)
    if share <= MOSTLY or counts["steps"] < 1000:
        return ()
    said = f"{100 * share:.0f} % of the time was integrated like in full dynamics"
    return (f"{said} (more than {100 * MOSTLY:.0f} %): {why}",)
