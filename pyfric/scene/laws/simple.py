"""Friction laws of few parameters: weakening with slip, strengthening with contact time, speed."""

import functools
import math
from typing import Annotated, Any, ClassVar

from pyfric.scene.checked import NotNegative, Positive
from pyfric.scene.errors import SceneError
from pyfric.scene.laws.kinds import FrictionLaw, Means, Tables, law
from pyfric.scene.laws.table import Table, sampled

FAR = 8.0
"""End of the exponentials in units of d_c or t_c; there exp(-8) = 3.4e-4 of them is left."""
PER_DECADE, DECADES = 32, 9
"""Knots for each decade of time after t_c, and the number of decades of the table of `Ageing`."""


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
        unit = _decay()
        x = tuple(self.t_c * time for time in unit.x)
        gain = Table(x, tuple(self.gain * (1 - left) for left in unit.y)) if self.gain else None
        return super().tables(of)._replace(hold=gain)


@law
class SpeedDependent(FrictionLaw):
    """`LinearWeakening` with mu of a slipping block multiplied by a factor that depends on speed.

    Args:
        v: speeds, m/s, from 0 on, increasing.
        factor: factor of mu at each speed, >= 0; linear between speeds, constant after the last.

    Source: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979): friction changes with speed.
    """

    v: Annotated[tuple[float, ...], NotNegative("m/s", listed=True)]
    factor: Annotated[tuple[float, ...], NotNegative("", listed=True)]

    kind: ClassVar[str] = "speed"
    example: ClassVar[dict[str, Any]] = {"v": (0.0, 0.02, 0.1), "factor": (1.0, 0.7, 0.85)}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the factor."""
        return super().tables(of)._replace(speed=Table(self.v, self.factor))


@functools.cache
def _decay() -> Table:
    end = math.exp(-FAR)
    return sampled(lambda x: (math.exp(-x) - end) / (1 - end), FAR)
