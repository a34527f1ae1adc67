"""Stable slip as a skip: jumps over rest, and over slow slip if friction depends on slip alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.engines.grid import just_after
from pyfric.engines.path import Outside, rest
from pyfric.engines.ring_down import RingDown
from pyfric.statics import EquilibriumError, Weakening

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.engines.modes import Modes
    from pyfric.scene import Scene

FAST = 10.0
"""Slip speed over the driver's speed above which no jump over slip is tried. A static path reaches
such speeds only just before slip becomes unstable."""


class StableSlip(RingDown):
    """The skip over rest and stable slip.

    With the option `energies` only rest is skipped, because the heat of slip in jumps is unknown.
    """

    @staticmethod
    def fits(scene: Scene) -> bool:
        """Return whether friction of a scene depends on slip alone, except for a viscous part."""
        return scene.law.slides

    def _slips_for(self, state: State) -> int:
        """Return the number of steps during which slip prevents a jump.

        For a jump, slip has to be slow. All slipping blocks must have slipped for `Schedule.slide`
        steps or more.
        """
        slips = np.abs(state.mode) == 1
        if self.method.budget or not slips.any():
            return super()._slips_for(state)
        V = self.scene.piece("V", just_after(state)).at(state.t), self.scene.V_top
        if np.abs(state.y[0, 2, slips]).max() > FAST * np.abs(V).max():
            return self.schedule.slide
        lasts = (state.t - state.t_0[slips].max()) / state.dt
        return max(self.schedule.slide - math.floor(lasts), 0)

    def _shortest_wait(self, state: State) -> int:
        slips = (np.abs(state.mode) == 1).any()
        return self.schedule.slide if slips else self.schedule.attempt

    def _begin(
        self, state: State, closed: np.ndarray, outside: Outside
    ) -> tuple[Modes, tuple[np.ndarray, np.ndarray]] | None:
        """Return the modes and the static state, or None if no static state is stable."""
        slips = np.abs(state.mode) == 1
        if not slips.any():
            return super()._begin(state, closed, outside)
        q, _ = self._coordinates(state)
        self.recorder.made["slides"] += 1
        way = np.where(slips, state.mode, 0)
        weakening = Weakening(self.scene.law.static, way, state.s_0, state.y[0, 0])
        try:
            modes = self.rests.slipping(closed, weakening, q)
        except EquilibriumError:
            return None
        if modes.grows:
            return None
        found = rest(modes, q, outside.drive, outside.load, self.accuracy)
        return None if found is None else (modes, found[:2])
