"""Rate-and-state friction."""

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from pyfric.scene.laws.kinds import FrictionLaw, Means, Tables, law
from pyfric.scene.spread import FIELD, Field
from pyfric.values import Positive, Quantity, SceneError

LARGEST = 1.0
"""Largest a and b. Measured values are about 0.01."""
LONGEST = 0.1
"""Largest D_c, in m. A larger number is most probably in um."""

MOST = 100.0
"""Largest c. The measured value is 2."""


class Evolution(NamedTuple):
    """A law of evolution; fortran/evolution.f90 has its functions in the core.

    Attributes:
        code: its number in the core.
        weakening: -d(ln theta)/d|u| at a change of speed, in 1/D_c, as a function of |v| theta/D_c
            and of the law (`pyfric.scene.RateStateLaw`).
        steady: |v| theta/D_c of steady slip.
    """

    code: int
    weakening: Callable[[np.ndarray, Any], Any]
    steady: float = 1.0


EVOLUTIONS = {
    "ageing": Evolution(1, lambda x, law: 1.0),
    "slip": Evolution(2, lambda x, law: 1.0 + np.log(np.maximum(x, 1e-300))),
    "prz": Evolution(3, lambda x, law: x / 2, steady=2.0),
    "nagata": Evolution(4, lambda x, law: (1 - law.c * law.a / (law.b * x)) / (1 + law.c)),
}
"""Laws of evolution by name."""


@law
class RateAndState(FrictionLaw):
    """Friction that depends on the speed v and on a state variable theta; no block ever rests.

    A block with normal force p resists with

        f = p a asinh( (v/2V*) exp((f* + b ln(V* theta/D_c)) / a) ) + alpha v ,

    which is p [f* + a ln(v/V*) + b ln(V* theta/D_c)] unless v is minute. The state evolves by

        "ageing"   dtheta/dt = 1 - |v| theta/D_c
        "slip"     dtheta/dt = -(|v| theta/D_c) ln(|v| theta/D_c)
        "prz"      dtheta/dt = 1 - (|v| theta/(2 D_c))^2
        "nagata"   dtheta/dt = 1 - |v| theta/D_c - (c/b) theta dmu/dt ,

    where mu = (|f| - alpha |v|)/p. At a steady speed theta = D_c/v, and the friction coefficient is
    f* + (a - b) ln(v/V*). With "prz" theta = 2 D_c/v, and the coefficient is higher by b ln 2.
    Steady friction weakens with speed if a < b. With a cut-off speed V_c, ln(V* theta/D_c + V*/V_c)
    replaces the logarithm, and steady friction rises above V_c. alpha is a field of the interface.
    theta of an open block evolves with its speed.

    A block counts as slipping while |v| >= v_slip: contact states, episodes, events and fronts
    follow from such blocks. The interface needs no mu_s and mu_k, which are both f*. While the
    slider is loaded, before t = 0, each block holds up to f* p.

    Args:
        a: direct effect, in (0, 1], and at least 1/550 of the friction coefficient at rest.
        b: evolution effect, in [0, 1].
        D_c: slip over which the state evolves, m, in (0, 0.1 m].
        f_star: friction coefficient f* at the reference speed, > 0.
        V_star: reference speed V*, m/s, > 0.
        evolution: "ageing", "slip", "prz" or "nagata".
        c: share of stress in the evolution of "nagata", in [0, 100]; other laws have none. Sudden
            changes of speed meet a direct effect of a/(1 + c), and the state follows over a slip of
            (1 + c) D_c.
        theta_0: state at t = 0, s, > 0; with ageing, the time since contact. Alternatively
        v_0: speed, m/s, > 0, at which the state at t = 0 would be steady; None means the speed of
            the driver.
        V_c: cut-off speed, m/s, > 0; None means none.
        v_slip: speed from which a block counts as slipping, m/s, > 0.

    a, b, D_c, f_star, theta_0 and v_0 are fields, like mu_s and mu_k.

    Sources: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979); A. L. Ruina, J. Geophys. Res. 88,
    10359 (1983); regularised by asinh: J. R. Rice, N. Lapusta, K. Ranjith, J. Mech. Phys. Solids
    49, 1865 (2001); prz: G. Perrin, J. R. Rice, G. Zheng, J. Mech. Phys. Solids 43, 1461 (1995);
    K. Nagata, M. Nakatani, S. Yoshida, J. Geophys. Res. 117, B02314 (2012). For changing p, the use
    of dmu/dt is a choice made here.
    """

    a: Annotated[Field, Quantity("", gt=0.0, le=LARGEST, **FIELD)]
    b: Annotated[Field, Quantity("", ge=0.0, le=LARGEST, **FIELD)]
    D_c: Annotated[Field, Quantity("m", gt=0.0, le=LONGEST, **FIELD)]
    f_star: Annotated[Field, Positive("", **FIELD)] = 0.6
    V_star: Annotated[float, Positive("m/s")] = 1e-6
    evolution: Literal["ageing", "slip", "prz", "nagata"] = "ageing"
    c: Annotated[float | None, Quantity("", ge=0.0, le=MOST, optional=True)] = None
    theta_0: Annotated[Field | None, Positive("s", optional=True, **FIELD)] = None
    v_0: Annotated[Field | None, Positive("m/s", optional=True, **FIELD)] = None
    V_c: Annotated[float | None, Positive("m/s", optional=True)] = None
    v_slip: Annotated[float, Positive("m/s")] = 1e-3

    kind: ClassVar[str] = "rate_and_state"
    fields: ClassVar[dict[str, str]] = {
        "a": "direct effect",
        "b": "evolution effect",
        "D_c": "slip over which the state evolves",
        "f_star": "friction coefficient at the reference speed",
        "theta_0": "state at t = 0",
        "v_0": "speed of the state at t = 0",
    }
    coefficient: ClassVar[str] = "f_star"
    example: ClassVar[dict[str, Any]] = {"a": 0.01, "b": 0.015, "D_c": 1e-6, "f_star": 0.45}

    def __post_init__(self) -> None:
        if self.theta_0 is not None and self.v_0 is not None:
            reason = "both are given"
            raise SceneError(f"{self._section}.v_0", self.v_0, "m/s", "theta_0 or v_0", reason)
        if (self.c is None) == (self.evolution == "nagata"):
            allowed = "a number with evolution = 'nagata', none with other laws"
            raise SceneError(f"{self._section}.c", self.c, "", allowed, f"{self.evolution!r}")

    def ends(self) -> tuple[Field, Field]:
        """Return f* twice, as mu_s and mu_k."""
        return self.f_star, self.f_star

    def tables(self, of: Means) -> Tables:
        """Return empty tables; a weakening distance of the interface is refused."""
        if of.d_c:
            reason = "D_c of the law says over which slip friction changes"
            raise SceneError("interface.d_c", of.d_c, "m", f"0 m with {self.kind}", reason)
        return Tables()
