"""Contacts that strengthen while they rest."""

from typing import Annotated, ClassVar

from pyfric.scene.checked import NotNegative, Positive, part
from pyfric.scene.laws.kinds import FrictionLaw, Means, law
from pyfric.scene.laws.table import Table

__all__ = ["Ageing"]

PER_DECADE, DECADES = 32, 9
"""Knots for each decade of time beyond t_c; the last one is this many decades beyond it."""


@law
@part
class Ageing(FrictionLaw):
    """mu_s + B log10(1 + t/t_c) after a block has stuck for t; it slips like `LinearWeakening`.

    Args:
        B: gain of mu_s for each decade of time, >= 0.
        t_c: time at which the gain begins, s, > 0.

    The table has 32 knots for each decade: the slope between two times a decade apart is within
    3e-4 B. It ends 1e9 t_c after sticking.

    Source: J. H. Dieterich, J. Geophys. Res. 77, 3690 (1972), time-dependent friction.
    """

    B: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "ageing"
    example: ClassVar[dict[str, float]] = {"B": 0.02, "t_c": 1e-5}

    def hold(self, of: Means) -> Table | None:
        """Return the gain, on knots that are even in log(1 + t/t_c)."""
        decades = [n / PER_DECADE for n in range(PER_DECADE * DECADES + 1)]
        x = (self.t_c * (10.0**n - 1) for n in decades)
        return Table(tuple(x), tuple(self.B * n for n in decades)) if self.B else None
