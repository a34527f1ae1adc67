"""Contacts that strengthen while they rest, up to a limit."""

import functools
import math
from typing import Annotated, ClassVar

from pyfric.scene.checked import NotNegative, Positive, part
from pyfric.scene.laws.kinds import FrictionLaw, Means, law
from pyfric.scene.laws.table import Table, sampled

__all__ = ["ExponentialHealing"]

FAR = 8.0
"""The exponential is cut at this many t_c, where exp(-8) = 3.4e-4 of it is left."""


@law
@part
class ExponentialHealing(FrictionLaw):
    """mu_s + gain (1 - exp(-t/t_c)) after a block has stuck for t, within 1e-3 gain.

    It slips like `LinearWeakening`.

    Args:
        gain: what mu_s gains in a long rest, >= 0.
        t_c: time over which it does, s, > 0.

    Source: A. Yu. Ishlinskii, I. V. Kragelskii, Zh. Tekh. Fiz. 14, 276 (1944), static friction
    that grows with the time of contact and saturates.
    """

    gain: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "healing"
    example: ClassVar[dict[str, float]] = {"gain": 0.05, "t_c": 1e-4}

    def hold(self, of: Means) -> Table | None:
        """Return the gain."""
        unit = _unit()
        x = tuple(self.t_c * t for t in unit.x)
        return Table(x, tuple(self.gain * share for share in unit.y)) if self.gain else None


@functools.cache
def _unit() -> Table:
    end = -math.expm1(-FAR)
    return sampled(lambda x: -math.expm1(-x) / end, FAR)
