"""When the next attempt to skip is worth its work."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pyfric.engines.skip import Prices

if TYPE_CHECKING:
    from pyfric.engines.recorder import Recorder

SPENT = 1 / 4
"""Largest work of all attempts to jump, over that of full dynamics up to the same time. An attempt
waits for it, so that no run takes much longer than full dynamics."""
COUNTED = ("attempts", "landings", "slides", "modal_bases")
"""Operations of attempts."""


class Schedule:
    """When attempts to jump are made: each waits until all before it have paid off.

    Args:
        recorder: what the run keeps, with counts of these operations.
        step: its first step.

    Attributes:
        attempt, slide: steps that take as long as an attempt to jump, and over slip.
        shortest: steps of a jump that is worth an attempt.
    """

    def __init__(self, recorder: Recorder, step: int) -> None:
        self.recorder, self.prices = recorder, Prices(recorder.scene, recorder.method)
        recorder.made |= dict.fromkeys(("jumps", "steps_spared", *COUNTED), 0)
        counts = recorder.counts
        self._begun = step - counts["steps"] - counts["steps_spared"]
        self._next, self._asked = step, step - 1
        self.attempt, self.shortest, self.slide = (
            math.ceil(self.prices.in_steps(dict.fromkeys(names, 1)))
            for names in (("attempts",), ("attempts", "landings"), ("slides",))
        )

    def left(self, step: int) -> int:
        """Return the number of steps from this one until the next attempt."""
        return max(self._next - step, 0)

    def put_off(self, step: int, wait: int) -> None:
        """Put off the next attempt after one that ended at a step, for so many steps at least."""
        self._asked, self._next = step, max(step + wait, self._paid_off())

    def forget(self, step: int) -> None:
        """Forget what the last attempt waits for: an event ends it."""
        if step > self._asked:
            self._next = self._paid_off()

    def _paid_off(self) -> int:
        """Return the step by which all attempts so far take a share `SPENT` of the work.

        Those of the run that it continues are included.
        """
        counts = self.recorder.counts
        spent = self.prices.in_steps({name: counts[name] for name in COUNTED})
        return self._begun + math.ceil(spent / SPENT)
