"""Interfaces of junctions that break, slip for a while, and pin again."""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from pyfric.scene.laws.kinds import FrictionLaw, Means, Table, law
from pyfric.scene.spread import FIELD, Field
from pyfric.values import NotNegative, Positive, Quantity, SceneError, Whole

MOST = 1_000_000
"""Largest number of junctions of a block."""
PARTS = 512
"""Number of parts of equal probability in a table of quantiles."""
TAIL = 1e-6
"""Probability beyond the last knots of a table of quantiles. The first and last parts of the table
are halved down to this probability.
"""


@law
class Junctions(FrictionLaw):
    """Each block has n_s junctions, which carry equal shares of its normal force p.

    A pinned junction is a spring of stiffness k_j = sqrt(C p/n_s) to its anchor. A pinned junction
    breaks at a stretch u_s = mu_s sqrt(p/(n_s C)). For a time t_R it then slips and carries at most
    mu_k p/n_s. Afterwards it pins at the position of the block, without force. The junctions of an
    open block slip, and pin when the block touches again. A block is ruptured while less than a
    share `ruptured` of its junctions is pinned. Episodes, events and fronts consist of ruptured
    blocks. The velocity of the block at its rupture sets the sign of slip.

    With constant C, u_s falls as 1/sqrt(n_s), so that n_s would change the physics. Therefore u_s
    is given, at the mean load p = F_N/N_x, and C = mu_s^2 p/(n_s u_s^2) follows. If F_N changes
    with time or p varies along the interface, C is constant.

    Args:
        n_s: number of junctions of each block, >= 2.
        u_s: stretch at which a junction breaks under the mean load at t = 0, m, > 0; alternatively
        C: the constant in k_j = sqrt(C p/n_s), N/m^2, > 0.
        t_R: mean slip time of a junction, s, >= 0.
        t_R_std: standard deviation of the slip time, s, >= 0; 0: a fixed time, no random numbers.
        t_R_distribution: "normal", cut at 0, or "gamma", whose shape parameter follows from the
            means of t_R and t_R_std over the interface.
        stretch: half width, over u_s, of the uniform distribution of initial stretches, in [0, 1].
        u_s_spread: half width, over u_s, of the uniform distribution of the stretches at which the
            junctions of a block break, in [0, 1].
        ruptured: share of pinned junctions below which a block is ruptured, in (0, 1].
        seed: seed of the random numbers, a whole number from 0 to 2^64 - 1.

    With `u_s_spread`, junction j breaks at c_j u_s. The c_j of a block are evenly spread about 1,
    the same in each block; their order is random.

    u_s, C, t_R and t_R_std are fields, like mu_s and mu_k. Junctions are initially pinned at their
    positions before F_N was applied. On a prescribed interface, the given shear stretches them.

    The slip time after break n of junction j of block i is t_R + t_R_std (S - 6), with S the sum of
    12 uniform numbers. n, j and i count from 1, blocks from the trailing edge. The uniform numbers
    are those of Philox 4x64-10 after the counter (0, i, j, n) under the key (seed, 0). "gamma" uses
    only the first one.

    Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014). The use of the present p,
    and the behaviour of junctions when motion reverses, are choices made here.
    """

    n_s: Annotated[int, Whole(MOST, least=2)] = 100
    u_s: Annotated[Field | None, Positive("m", optional=True, **FIELD)] = None
    C: Annotated[Field | None, Positive("N/m^2", optional=True, **FIELD)] = None
    t_R: Annotated[Field, NotNegative("s", **FIELD)] = 2e-3
    t_R_std: Annotated[Field, NotNegative("s", **FIELD)] = 0.0
    t_R_distribution: Literal["normal", "gamma"] = "normal"
    stretch: Annotated[float, Quantity("", ge=0.0, le=1.0)] = 0.0
    u_s_spread: Annotated[float, Quantity("", ge=0.0, le=1.0)] = 0.0
    ruptured: Annotated[float, Quantity("", gt=0.0, le=1.0)] = 0.3
    seed: Annotated[int, Whole(2**64 - 1)] = 0

    kind: ClassVar[str] = "junctions"
    fields: ClassVar[dict[str, str]] = {
        "u_s": "stretch at which junctions break",
        "C": "constant of the stiffness of junctions",
        "t_R": "mean time that junctions slip",
        "t_R_std": "its standard deviation",
    }
    example: ClassVar[dict[str, Any]] = {"n_s": 20, "u_s": 1e-6, "t_R": 5e-5, "t_R_std": 1e-5}

    def __post_init__(self) -> None:
        if (self.u_s is None) == (self.C is None):
            reason = "both are given" if self.C is not None else "neither is given"
            raise SceneError(f"{self._section}.u_s", self.u_s, "m", "either u_s or C", reason)

    def tables(self, of: Means) -> Any:
        """Return empty tables: junctions need none."""
        if of.d_c:
            reason = "junctions say how friction falls"
            raise SceneError("interface.d_c", of.d_c, "m", f"0 m with {self.kind}", reason)
        return super().tables(of._replace(d_c=0.0))

    @property
    def factors(self) -> np.ndarray:
        """The c_j: stretch at which each junction of a block breaks, over u_s, shape (n_s,)."""
        n = self.n_s
        if not self.u_s_spread:
            return np.ones(n)
        drawn = np.random.Philox(key=[self.seed, 1]).random_raw(n)
        order = np.argsort(np.argsort(drawn, kind="stable"), kind="stable")
        return 1 + self.u_s_spread * (2 * order + 1 - n) / n

    def quantiles_of_t_R(self, cv: float) -> Table | None:
        """Return the quantiles of t_R over its mean as a table; None for a normal distribution.

        The table is refined at both ends and scaled to a mean of 1.

        Args:
            cv: standard deviation over mean.
        """
        if self.t_R_distribution == "normal" or cv == 0:
            return None
        from scipy.special import gammaincinv  # slow to import

        shape = 1 / cv**2
        halves = 2.0 ** -np.arange(1, 1 - math.log2(TAIL * PARTS))
        inner = np.arange(1, PARTS) / PARTS
        u = np.concatenate([[0.0], np.sort(halves) / PARTS, inner, 1 - halves / PARTS])
        y = gammaincinv(shape, u) / shape
        u, y = np.append(u, 1.0), np.append(y, y[-1])
        mean = float(np.trapezoid(y, u))
        return Table(tuple(u.tolist()), tuple((y / mean).tolist()))
