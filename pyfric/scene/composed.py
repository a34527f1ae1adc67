"""The friction law of the blocks, which follows from fields and loads together."""

import functools

import numpy as np

from pyfric.scene.friction import CoulombLaw, Law
from pyfric.scene.loads import Loads
from pyfric.scene.restless import WITHOUT_REST
from pyfric.values import SceneError, part


@part
class Composed(Loads):
    """The parts of a scene, with its friction law, loads, fields and blocks; see `Scene`."""

    @functools.cached_property
    def law(self) -> Law:
        """The friction law; its fields are numbers, or arrays of shape (N_x,), left to right."""
        if (own := WITHOUT_REST.get(type(self.interface.law))) is not None:
            V, p = self.piece("V", 0.0).at(0.0), self.F_N / self.N_x
            return own.of(self.interface.law, self.given_field, p, V)
        tables = self.interface.tables
        mu_s, mu_k, d_c, alpha = map(self.given_field, ("mu_s", "mu_k", "d_c", "alpha"))
        if np.any(alpha) and self.shares[1].min() < 1:
            alpha = alpha * self.shares[1]
        if tables.slide is not None and not np.any(d_c):
            d_c = 1.0  # the table is over slip in m
        return CoulombLaw(mu_s, mu_k, d_c, tables, alpha=alpha)

    def resting_law(self, reason: str, allowed: str = "another law") -> CoulombLaw:
        """Return the friction law of a scene whose blocks can rest.

        Raises:
            SceneError: blocks cannot rest. The message names the reason and the allowed laws.
        """
        if isinstance(self.law, CoulombLaw):
            return self.law
        raise SceneError("interface.law", self.interface.law.kind, "", allowed, reason)

    @functools.cached_property
    def bare(self) -> np.ndarray:
        """Blocks that can touch the foundation, but have no friction, shape (N_x,), bool."""
        return self.touches & self.law.bare

    @property
    def whole(self) -> bool:
        """True if all blocks can touch the foundation, without gaps, and have friction."""
        return bool(self.touches.all() and not np.any(self.gap) and not self.bare.any())

    @property
    def resolving_step(self) -> float:
        """Longest step that resolves weakening, in s (`Law.resolving_step`)."""
        return self.law.resolving_step(self.F_N / self.N_x, self.m_interface)

    @property
    def has_rests(self) -> bool:
        """True if the driver can lead to static states other than the initial state."""
        return not (self.prescribed or self.top.push or self.driver.K == 0)
