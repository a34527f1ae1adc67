"""The schedule of attempts to leave out steps. It limits the work of attempts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pyfric.engines.skip import Prices

if TYPE_CHECKING:
    from pyfric.engines.recorder import Recorder

SPENT = 1 / 4
"""Largest work of all attempts to jump, over the work of full dynamics up to the same time. No run
therefore takes much longer than full dynamics."""
COUNTED = ("attempts", "landings", "slides", "modal_bases")
"""Counted operations that attempts to jump consist of."""


class Schedule:
    """Times of attempts to jump.

    An attempt waits until the work of earlier attempts is a small share of all work.

    Args:
        recorder: recorder of the run, whose counts include the operations `COUNTED`.
        step: first step of the run.

    Attributes:
        attempt, slide: work of an attempt to jump over rest, and over slip, in steps.
        shortest: least number of steps of a jump that saves work.
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
        """Return the number of steps from step number `step` to the next attempt."""
        return max(self._next - step, 0)

    def put_off(self, step: int, wait: int) -> None:
        """Put off the next attempt to step number `step` + `wait` or later."""
        self._asked, self._next = step, max(step + wait, self._paid_off())

    def forget(self, step: int) -> None:
        """Cancel the wait after the last attempt, if blocks slip after that attempt."""
        if step > self._asked:
            self._next = self._paid_off()

    def _paid_off(self) -> int:
        """Return the step at which the work of all attempts has fallen to the share `SPENT`.

        Attempts of a run that this run continues are included.
        """
        counts = self.recorder.counts
        spent = self.prices.in_steps({name: counts[name] for name in COUNTED})
        return self._begun + math.ceil(spent / SPENT)
