"""What the friction law says about a front: fracture energy, cohesive zone, strength excess S.

``bodies`` is explained in `pyfric.theory.cracks`: the slider is one body, on a rigid plane.

Source: A. C. Palmer and J. R. Rice, Proc. R. Soc. A 332, 527 (1973); D. J. Andrews, J. Geophys.
Res. 81, 5679 (1976) and Bull. Seismol. Soc. Am. 75, 1 (1985).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pyfric.theory.cracks import A_II, Bodies
from pyfric.theory.inputs import checked, checked_array, choice, refusal, same_shape
from pyfric.theory.waves import Material

ANDREWS_S = 1.77
"""In two dimensions a crack can become supershear only where S is below this (Andrews 1985)."""


def fracture_energy(mu_s: float, mu_k: float, p: ArrayLike, d_c: ArrayLike) -> np.ndarray:
    """Return Gamma = (mu_s - mu_k) p d_c/2 of linear slip weakening, J/m^2.

    The d_c of `pyfric.Interface` gives the energy per body, D_c = 2 d_c that of both bodies.

    Args:
        mu_s, mu_k: friction coefficients, mu_s >= mu_k >= 0.
        p: normal stress, Pa, any shape.
        d_c: slip of weakening, m, any shape that broadcasts.

    Source: Palmer and Rice (1973).
    """
    drop = _friction_drop(mu_s, mu_k, p)
    drop, d_c = same_shape(p=drop, d_c=checked_array("d_c", d_c, "m", ge=0))
    return (drop * d_c / 2)[()]


def cohesive_zone(
    material: Material,
    mu_s: float,
    mu_k: float,
    p: ArrayLike,
    d_c: ArrayLike,
    v: ArrayLike = 0.0,
    *,
    bodies: Bodies = 1,
) -> np.ndarray:
    """Return the length of the cohesive zone X_c(v) = X_c0/A_II(v), m.

    X_c0 = (9 pi/32)(E'/2) D_c/((mu_s - mu_k) p) with the D_c of two bodies, D_c = 2 d_c of one.

    Args:
        material: the material.
        mu_s, mu_k: friction coefficients, mu_s > mu_k >= 0.
        p: normal stress, Pa, > 0, any shape.
        d_c: slip of weakening in the convention of `bodies`, m, any shape that broadcasts.
        v: front speed, m/s, 0 to c_R (not included), any shape that broadcasts.
        bodies: 1, on a rigid plane, or 2.

    Source: Palmer and Rice (1973).
    """
    share = choice("bodies", bodies, (1, 2)) / 2
    drop = _friction_drop(mu_s, mu_k, p)
    if not (drop > 0).all():
        raise refusal("(mu_s - mu_k) p", float(drop.min()), "Pa", "a finite number > 0 Pa")
    drop, d_c, A = same_shape(
        p=drop, d_c=checked_array("d_c", d_c, "m", ge=0), v=np.asarray(A_II(material, v))
    )
    return (9 * np.pi / 64 * material.E_prime * d_c / share / (drop * A))[()]


def strength_excess(tau_p: ArrayLike, tau_0: ArrayLike, tau_r: ArrayLike) -> np.ndarray:
    """Return S = (tau_p - tau_0)/(tau_0 - tau_r); supershear needs S < `ANDREWS_S`.

    With the scaled prestress tau_bar of `pyfric.analysis`, S = 1/tau_bar - 1.

    Args:
        tau_p: peak stress, Pa, any shape.
        tau_0: initial stress, Pa, tau_r < tau_0 <= tau_p, any shape that broadcasts.
        tau_r: residual stress, Pa, any shape that broadcasts.

    Source: Andrews (1976).
    """
    tau_p, tau_0, tau_r = same_shape(
        tau_p=checked_array("tau_p", tau_p, "Pa"),
        tau_0=checked_array("tau_0", tau_0, "Pa"),
        tau_r=checked_array("tau_r", tau_r, "Pa"),
    )
    wrong = (tau_0 <= tau_r) | (tau_0 > tau_p)
    if wrong.any():
        raise refusal("tau_0", float(tau_0[wrong][0]), "Pa", "tau_p >= tau_0 > tau_r")
    return ((tau_p - tau_0) / (tau_0 - tau_r))[()]


# --- parts ---------------------------------------------------------------------------------------


def _friction_drop(mu_s: float, mu_k: float, p: ArrayLike) -> np.ndarray:
    mu_k = checked("mu_k", mu_k, ge=0)
    return (checked("mu_s", mu_s, ge=mu_k) - mu_k) * checked_array("p", p, "Pa", ge=0)
