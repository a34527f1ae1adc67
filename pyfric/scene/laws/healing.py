"""Contacts that strengthen with contact time: without limit, or up to a limit."""

import functools
import math
from typing import Annotated, ClassVar

from pyfric.scene.checked import NotNegative, Positive
from pyfric.scene.laws.kinds import FrictionLaw, Means, Tables, law
from pyfric.scene.laws.table import Table, sampled

PER_DECADE, DECADES = 32, 9
"""Knots for each decade of time after t_c, and the number of decades of the table."""
FAR = 8.0
"""End of the exponential in units of t_c; there exp(-8) = 3.4e-4 of it is left."""


@law
class Ageing(FrictionLaw):
    """mu_s + B log10(1 + t/t_c) after a block has stuck for t; it slips like `LinearWeakening`.

    Args:
        B: gain of mu_s for each decade of time, >= 0.
        t_c: time at which the gain begins, s, > 0.

    The table has 32 knots for each decade, so that the gain in a decade is right within 3e-4 B. It
    ends at t = 1e9 t_c.

    Source: J. H. Dieterich, J. Geophys. Res. 77, 3690 (1972), time-dependent friction.
    """

    B: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "ageing"
    example: ClassVar[dict[str, float]] = {"B": 0.02, "t_c": 1e-5}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the gain on knots evenly spaced in log(1 + t/t_c)."""
        decades = [n / PER_DECADE for n in range(PER_DECADE * DECADES + 1)]
        x = (self.t_c * (10.0**n - 1) for n in decades)
        gain = Table(tuple(x), tuple(self.B * n for n in decades)) if self.B else None
        return super().tables(of)._replace(hold=gain)


@law
class ExponentialHealing(FrictionLaw):
    """mu_s + gain (1 - exp(-t/t_c)) after a block has stuck for t, within 1e-3 gain.

    It slips like `LinearWeakening`.

    Args:
        gain: gain of mu_s after a long contact time, >= 0.
        t_c: time scale of the gain, s, > 0.

    Source: A. Yu. Ishlinskii, I. V. Kragelskii, Zh. Tekh. Fiz. 14, 276 (1944), static friction
    that grows with the time of contact and saturates.
    """

    gain: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "healing"
    example: ClassVar[dict[str, float]] = {"gain": 0.05, "t_c": 1e-4}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the gain."""
        unit = _unit()
        x = tuple(self.t_c * time for time in unit.x)
        gain = Table(x, tuple(self.gain * share for share in unit.y)) if self.gain else None
        return super().tables(of)._replace(hold=gain)


@functools.cache
def _unit() -> Table:
    end = -math.expm1(-FAR)
    return sampled(lambda x: -math.expm1(-x) / end, FAR)
