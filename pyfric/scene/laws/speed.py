"""Friction that depends on the speed of slip."""

from typing import Annotated, Any, ClassVar

from pyfric.scene.checked import NotNegative
from pyfric.scene.laws.kinds import FrictionLaw, Means, Tables, law
from pyfric.scene.laws.table import Table


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
