"""Small exact results: radiation damping, the quasi-static 1D slider, rigid statics of the torque.

Source: derived here; the 1D length also in the paper's references on precursors, PRL 107, 074301
(2011).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric.record.theory.inputs import checked, checked_array, same_shape
from pyfric.scene import SceneError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pyfric.record.theory.waves import Material

__all__ = ["echo_time", "quasistatic_length", "radiation_stress", "rigid_pressure"]


def radiation_stress(material: Material, v: ArrayLike) -> np.ndarray:
    """Return the traction rho c_S v that a row loses when it starts to slide at v, Pa.

    It is exact for uniform sliding, until the wave comes back: see `echo_time`.

    Args:
        material: the material; for one body on a rigid plane, v is its speed.
        v: sliding speed, m/s, any shape, either sign.

    Raises:
        SceneError: v is not finite.
    """
    return (material.rho * material.c_S * checked_array("v", v, "m/s"))[()]


def echo_time(material: Material, H: float) -> float:
    """Return 2 H/c_S: how long a shear wave needs to the top and back, s.

    Args:
        material: the material.
        H: height, m.

    Raises:
        SceneError: H is not positive.
    """
    return 2 * checked("H", H, "m", gt=0) / material.c_S


def quasistatic_length(F_T: ArrayLike, F_N: float, mu_k: float) -> np.ndarray:
    """Return L_p/L = F_T/(mu_k F_N) of precursors in one dimension, at most 1.

    It holds under uniform p, without initial shear and without inertia.

    Args:
        F_T: tangential force, N, any shape, >= 0.
        F_N: normal force, N.
        mu_k: kinetic friction coefficient, > 0.

    Raises:
        SceneError: a value is out of range.
    """
    F_N, mu_k = checked("F_N", F_N, "N", gt=0), checked("mu_k", mu_k, gt=0)
    return np.minimum(checked_array("F_T", F_T, "N", ge=0) / (mu_k * F_N), 1.0)[()]


def rigid_pressure(
    F_T: ArrayLike, F_N: float, h_over_L: float, x_over_L: ArrayLike = 0.0
) -> np.ndarray:
    """Return the pressure under a rigid slider on an even foundation, over F_N/L.

    1 + 6 (h/L)(F_T/F_N)(2 x/L - 1): forces and torques balance. At the trailing edge, x = 0, it is
    1 - 6 (h/L) F_T/F_N. It is that of a continuous interface, free of torque from above.

    Args:
        F_T: tangential force at the height h, N, any shape, >= 0.
        F_N: normal force, N.
        h_over_L: h/L, >= 0.
        x_over_L: x/L from the trailing edge, 0 to 1, any shape that broadcasts.

    Raises:
        SceneError: a value is out of range, or the trailing edge would lift off.
    """
    F_N, h_over_L = checked("F_N", F_N, "N", gt=0), checked("h_over_L", h_over_L, ge=0)
    F_T = checked_array("F_T", F_T, "N", ge=0)
    tilt = 6 * h_over_L * F_T / F_N
    if (tilt > 1).any():
        allowed = f"a finite number <= {F_N / (6 * h_over_L):.12g} N"
        raise SceneError("F_T", float(F_T.max()), "N", allowed, "the trailing edge lifts off")
    x = checked_array("x_over_L", x_over_L, ge=0, le=1)
    tilt, x = same_shape(F_T=tilt, x_over_L=x)
    return (1 + tilt * (2 * x - 1))[()]
