"""Static states for jumps under limits of friction that change with time (`Interface.limit`)."""

from __future__ import annotations

import copy
import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from pyfric.scene import NO_LIMIT

if TYPE_CHECKING:
    from pyfric.statics import StaticSolver


class Limits:
    """Solvers of one scene under its limits of friction.

    Between two breakpoints the strength of a block is mu(t) p. Jumps are made only while all limits
    are constant. Gap functions are then those of Amontons-Coulomb friction with min(mu_s, limit).

    Args:
        known: the solver without limits.
    """

    def __init__(self, known: StaticSolver) -> None:
        self.known = self.present = known
        self._mu_s = known.scene.field("mu_s")

    def solver(self, t: float, now: float, slips: bool) -> StaticSolver | None:
        """Return the solver of present limits, or None if they allow no jump.

        Args:
            t: time that selects the pieces of the limits, in s.
            now: present time, in s.
            slips: whether blocks slip, which excludes jumps under a limit below mu_s.
        """
        scene, hold = self.known.scene, self.known.scene.law.static.tables.hold
        if not scene.interface.limit:
            return self.known
        limit, rate = scene.limit_at(t, now)
        mu_s = scene.field("mu_s")
        binds = limit < (mu_s if hold is None else NO_LIMIT)
        if rate.any() or (binds.any() and (slips or hold is not None or not limit.all())):
            return None
        if not np.array_equal(np.minimum(mu_s, limit), self._mu_s):
            self._mu_s, self.present = np.minimum(mu_s, limit), copy.copy(self.known)
            self.present.kept = {}
            values = {"mu_s": self._mu_s, "mu_k": np.minimum(scene.field("mu_k"), limit)}
            order = np.argsort(scene.n_of_i)
            fields = {name: tuple(of[order].tolist()) for name, of in values.items()}
            interface = dataclasses.replace(scene.interface, **fields, limit=(), limit_from=None)
            self.present.scene = dataclasses.replace(scene, interface=interface)
        return self.present
