"""Friction that weakens with slip."""

import functools
import math
from typing import ClassVar

from pyfric.scene.errors import SceneError
from pyfric.scene.laws.kinds import FrictionLaw, Means, Tables, law
from pyfric.scene.laws.table import Table, sampled

FAR = 8.0
"""End of the exponential in units of d_c; there exp(-8) = 3.4e-4 of it is left."""


@law
class LinearWeakening(FrictionLaw):
    """mu = mu_s - (mu_s - mu_k) min(s/d_c, 1); with d_c = 0 it is Amontons-Coulomb friction.

    Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
    """

    kind: ClassVar[str] = "linear"


@law
class ExponentialWeakening(FrictionLaw):
    """mu = mu_k + (mu_s - mu_k) exp(-s/d_c), within 1e-3 (mu_s - mu_k), up to s = 8 d_c.

    For larger slip mu = mu_k.

    Source: S. Abercrombie, J. Rice, Geophys. J. Int. 162, 406 (2005), laws of slip weakening.
    """

    kind: ClassVar[str] = "exponential"

    def tables(self, of: Means) -> Tables:
        """Return the exponential; its last value is 0."""
        if not of.d_c > 0:
            allowed = "a finite number > 0 m with an exponential law"
            raise SceneError("interface.d_c", of.d_c, "m", allowed, "nothing to decay over")
        return Tables(slide=_decay())


@functools.cache
def _decay() -> Table:
    end = math.exp(-FAR)
    return sampled(lambda x: (math.exp(-x) - end) / (1 - end), FAR)
