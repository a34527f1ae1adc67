"""Linear elastic fracture mechanics of frictional cracks: sub-Rayleigh fronts in mode II.

A crack |x| < a in an infinite plane drops the shear stress by dtau(x) and runs at the speed v on
both sides, v < c_R. With r = (c_S/c_P)^2, E' = `Material.E_prime` and

    alpha_s = sqrt(1 - v^2/c_S^2),  alpha_d = sqrt(1 - v^2/c_P^2),
    D = 4 alpha_d alpha_s - (1 + alpha_s^2)^2,

the energy that flows into each tip is G = A_II k_II^2 K_II^2/E', where K_II is the static stress
intensity, k_II(v) the ratio of dynamic to static, A_II(v) the energy per stress intensity, and
g_II = A_II k_II^2. The front obeys G = Gamma. k_II is the function of the self-similar crack, which
is exact for a uniform stress drop and constant speed. In all other cases the equation of motion is
an approximation.

**One body or two.** The crack above lies between two bodies. By symmetry each body moves like one
body on a rigid plane, with half of the relative slip. For one body (``bodies = 1``) G, Gamma and
d_c are half of their values for two bodies. The slider of this package is one body. Functions take
Gamma and d_c in the convention of ``bodies``.

Source: L. B. Freund, Dynamic Fracture Mechanics (1990), chapters 5 to 7 (A_II, k_II after Burridge
and Willis 1969, Kostrov 1964); A. C. Palmer and J. R. Rice, Proc. R. Soc. A 332, 527 (1973);
K. B. Broberg, Cracks and Fracture (1999); D. J. Andrews, J. Geophys. Res. 81, 5679 (1976) and Bull.
Seismol. Soc. Am. 75, 1 (1985).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from pyfric.theory.inputs import checked, checked_array, choice, refusal, same_shape
from pyfric.theory.waves import Material, reduced_D

Bodies = Literal[1, 2]
StressDrop = "float | Callable[[float], float]"

ACCURACY = 1e-8
"""Largest error accepted from the quadrature of a stress drop, over its largest value."""

ANDREWS_S = 1.77
"""Limit of S, below which a crack in two dimensions can become supershear (Andrews 1985)."""

# Trapezoidal rule in y = ln(v x), which is exponentially accurate: the integrand of I is analytic
# for |Im y| < pi/2 and falls as exp(-|y|).
_STEP = 0.25
_X = np.exp(np.arange(-148, 149) * _STEP)
_WEIGHT = _STEP * _X / (1 + _X**2) ** 1.5


# --- functions of the speed ----------------------------------------------------------------------


def alpha_s(material: Material, v: ArrayLike) -> np.ndarray:
    """Return sqrt(1 - v^2/c_S^2) for speeds v of any shape, m/s, 0 to c_S."""
    return np.sqrt(1 - _xi(material, v, material.c_S) ** 2)[()]


def alpha_d(material: Material, v: ArrayLike) -> np.ndarray:
    """Return sqrt(1 - v^2/c_P^2); v as in `alpha_s`."""
    return np.sqrt(1 - material.r * _xi(material, v, material.c_S) ** 2)[()]


def D(material: Material, v: ArrayLike) -> np.ndarray:
    """Return 4 alpha_d alpha_s - (1 + alpha_s^2)^2; v as in `alpha_s`."""
    xi2 = _xi(material, v, material.c_S) ** 2
    return (xi2 * reduced_D(xi2, material.r))[()]


def A_II(material: Material, v: ArrayLike) -> np.ndarray:
    """Return A_II = v^2 alpha_s/((1 - nu) c_S^2 D), with nu of plane strain.

    A_II is 1 at rest and infinite at c_R. 1/(1 - nu) is 2 (1 - c_S^2/c_P^2). With nu of plane
    stress this factor is 1 + nu.

    Args:
        v: front speed, m/s, any shape, 0 to c_R (not included).

    Source: Freund (1990), chapter 5.
    """
    xi2 = _xi(material, v, material.c_R, open_=True) ** 2
    D_over_xi2 = _positive(reduced_D(xi2, material.r))
    return (2 * (1 - material.r) * np.sqrt(1 - xi2) / D_over_xi2)[()]


def I_v(material: Material, v: ArrayLike) -> np.ndarray:
    """Return I(v) of the self-similar crack, to about 1e-14.

    I = (v/c_S^2)/integral_0^inf R(i x) (v^-2 + x^2)^(-3/2) (c_S^-2 + x^2)^(-1/2) dx, where
    R(z) = (c_S^-2 - 2 z^2)^2 + 4 z^2 sqrt(c_P^-2 - z^2) sqrt(c_S^-2 - z^2).

    Args:
        v: front speed, m/s, any shape, 0 to c_R; the value at 0 is the limit.

    Source: Freund (1990), chapter 6.
    """
    return _I(_xi(material, v, material.c_R), material.r)[()]


def k_II(material: Material, v: ArrayLike) -> np.ndarray:
    """Return k_II = -I R(1/v) v c_S^2/sqrt(v^-2 - c_S^-2): dynamic over static K_II.

    k_II is 1 at rest and 0 at c_R. v is as in `I_v`.

    Source: Freund (1990), chapter 6, with R(1/v) = -D/v^4.
    """
    xi = _xi(material, v, material.c_R)
    D_over_xi2 = np.maximum(reduced_D(xi**2, material.r), 0.0)
    return (_I(xi, material.r) * D_over_xi2 / np.sqrt(1 - xi**2))[()]


def g_II(material: Material, v: ArrayLike) -> np.ndarray:
    """Return g_II = A_II k_II^2, dynamic over static energy release rate: 1 at rest, 0 at c_R.

    g_II falls with v. v is as in `I_v`.
    """
    return _g(_xi(material, v, material.c_R), material.r)[()]


# --- cracks --------------------------------------------------------------------------------------


def stress_intensity(
    a: ArrayLike, stress_drop: StressDrop, breaks: Sequence[float] = ()
) -> np.ndarray:
    """Return the static K_II of a crack, Pa sqrt(m).

    K_II = (2/sqrt(pi)) integral_0^a dtau(t) sqrt(a/(a^2 - t^2)) dt. With t = a sin(theta) the
    integrand is dtau(a sin theta), without singularity.

    Args:
        a: half length of the crack, m, any shape.
        stress_drop: dtau, Pa: a number, or a function of the distance t >= 0 from the middle (m),
            even in t.
        breaks: distances t > 0 at which the function jumps or has a kink, m.

    Returns:
        K_II, in the shape of a. For uniform dtau, K_II is dtau sqrt(pi a).

    Raises:
        ValueError: a value is out of range, the function returns a value that is not finite, or the
            quadrature does not reach `ACCURACY` (breaks are missing).

    Source: Freund (1990), chapter 6; H. Tada et al., The Stress Analysis of Cracks Handbook.
    """
    a = checked_array("a", a, "m", gt=0)
    if not callable(stress_drop):
        return (checked("stress_drop", stress_drop, "Pa") * np.sqrt(np.pi * a))[()]
    if len(breaks):
        breaks = checked_array("breaks", breaks, "m", gt=0)
    breaks = np.sort(np.ravel(breaks))
    K = [_intensity(length, stress_drop, breaks[breaks < length]) for length in a.flat]
    return np.reshape(K, a.shape)[()]


def energy_release_rate(
    material: Material, K_II: ArrayLike, v: ArrayLike = 0.0, *, bodies: Bodies = 1
) -> np.ndarray:
    """Return G = g_II(v) K_II^2/E' of two bodies, half of it for one, J/m^2.

    Args:
        K_II: static stress intensity, Pa sqrt(m), any shape; see `stress_intensity`.
        v: front speed, m/s, 0 to c_R, any shape that broadcasts.
        bodies: 1 (a body on a rigid plane) or 2 (two bodies).
    """
    share = _share(bodies)
    K, xi = same_shape(
        K_II=checked_array("K_II", K_II, "Pa m^0.5"), v=_xi(material, v, material.c_R)
    )
    return (share * _g(xi, material.r) * K**2 / material.E_prime)[()]


def crack_length(
    material: Material, v: ArrayLike, stress_drop: float, Gamma: ArrayLike, *, bodies: Bodies = 1
) -> np.ndarray:
    """Return the half length at which a crack under a uniform stress drop runs at v, m.

    a = Gamma E'/(pi g_II(v) dtau^2), with Gamma of two bodies. At v = 0 this is the critical
    length.

    Args:
        v: front speed, m/s, 0 to c_R (not included), any shape.
        stress_drop: dtau, Pa.
        Gamma: fracture energy in the convention of `bodies`, J/m^2.
        bodies: 1 (a body on a rigid plane) or 2 (two bodies).

    Source: Freund (1990), chapter 7; see the approximation at the top of the module.
    """
    share = _share(bodies)
    stress_drop = checked("stress_drop", stress_drop, "Pa", gt=0)
    Gamma, xi = same_shape(
        Gamma=checked_array("Gamma", Gamma, "J/m^2", ge=0),
        v=_xi(material, v, material.c_R, open_=True),
    )
    g = _positive(_g(xi, material.r))
    return (Gamma / share * material.E_prime / (np.pi * g * stress_drop**2))[()]


def crack_speed(
    material: Material,
    a: ArrayLike,
    stress_drop: StressDrop,
    Gamma: ArrayLike,
    *,
    breaks: Sequence[float] = (),
    bodies: Bodies = 1,
) -> np.ndarray:
    """Return the front speed of a crack of half length a, m/s: the root of G(a, v) = Gamma.

    The speed is 0 if the crack is too short to grow, or if K_II <= 0.

    Args:
        a: half length, m, any shape.
        stress_drop, breaks: as in `stress_intensity`.
        Gamma: fracture energy at the tip in the convention of `bodies`, J/m^2, a number or one for
            each a; 0 gives c_R.
        bodies: 1 (a body on a rigid plane) or 2 (two bodies).

    Source: Freund (1990), chapter 7; see the approximation at the top of the module.
    """
    share = _share(bodies)
    a, Gamma = same_shape(
        a=checked_array("a", a, "m", gt=0), Gamma=checked_array("Gamma", Gamma, "J/m^2", ge=0)
    )
    K = np.maximum(stress_intensity(a, stress_drop, breaks), 0.0)
    static = share * K**2 / material.E_prime
    low, high = np.zeros(a.shape), np.full(a.shape, material.c_R / material.c_S)
    for _ in range(52):
        middle = (low + high) / 2
        grows = static * _g(middle, material.r) > Gamma
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return np.where(static > Gamma, high * material.c_S, 0.0)[()]


# --- friction ------------------------------------------------------------------------------------


def fracture_energy(mu_s: float, mu_k: float, p: ArrayLike, d_c: ArrayLike) -> np.ndarray:
    """Return Gamma = (mu_s - mu_k) p d_c/2 of linear slip weakening, J/m^2.

    d_c of `pyfric.Interface` gives the energy per body. D_c = 2 d_c gives the energy of both
    bodies.

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
        mu_s, mu_k: friction coefficients, mu_s > mu_k >= 0.
        p: normal stress, Pa, > 0, any shape.
        d_c: slip of weakening in the convention of `bodies`, m, any shape that broadcasts.
        v: front speed, m/s, 0 to c_R (not included), any shape that broadcasts.
        bodies: 1 (a body on a rigid plane) or 2 (two bodies).

    Source: Palmer and Rice (1973).
    """
    share, drop = _share(bodies), _friction_drop(mu_s, mu_k, p)
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
    given = {"tau_p": tau_p, "tau_0": tau_0, "tau_r": tau_r}
    stresses = {name: checked_array(name, value, "Pa") for name, value in given.items()}
    tau_p, tau_0, tau_r = same_shape(**stresses)
    wrong = (tau_0 <= tau_r) | (tau_0 > tau_p)
    if wrong.any():
        raise refusal("tau_0", float(tau_0[wrong][0]), "Pa", "tau_p >= tau_0 > tau_r")
    return ((tau_p - tau_0) / (tau_0 - tau_r))[()]


# --- parts ---------------------------------------------------------------------------------------


def _share(bodies: Bodies) -> float:
    """Return the share of the energy of two bodies that `bodies` of them have: 1/2 or 1."""
    return choice("bodies", bodies, (1, 2)) / 2


def _friction_drop(mu_s: float, mu_k: float, p: ArrayLike) -> np.ndarray:
    mu_k = checked("mu_k", mu_k, ge=0)
    return (checked("mu_s", mu_s, ge=mu_k) - mu_k) * checked_array("p", p, "Pa", ge=0)


def _xi(material: Material, v: ArrayLike, top: float, open_: bool = False) -> np.ndarray:
    """Return v/c_S, after a check that v is between 0 and `top` (m/s)."""
    return checked_array("v", v, "m/s", ge=0, **{"lt" if open_ else "le": top}) / material.c_S


def _positive(value: np.ndarray) -> np.ndarray:
    """Return a quantity that is 0 at c_R, without negative values due to rounding."""
    return np.maximum(value, np.finfo(float).eps ** 2)


def _I(xi: np.ndarray, r: float) -> np.ndarray:
    # With X = v x, in units of c_S: 1/I = integral R v^2/sqrt(v^2 + X^2) (1 + X^2)^(-3/2) dX, and
    # R v^2 = v^2 + 4 X^2 (X^2 + v^2 - P)/v^2 with P = sqrt(X^2 + r v^2) sqrt(X^2 + v^2).
    v2, X2 = xi[..., None] ** 2, _X**2
    s2 = X2 + v2
    P = np.sqrt(X2 + r * v2) * np.sqrt(s2)
    Rv2 = v2 + 4 * X2 - 4 * X2 * ((1 + r) * X2 + r * v2) / (P + X2)
    return 1 / (Rv2 / np.sqrt(s2) @ _WEIGHT)


def _g(xi: np.ndarray, r: float) -> np.ndarray:
    D_over_xi2 = np.maximum(reduced_D(xi**2, r), 0.0)
    return 2 * (1 - r) * _I(xi, r) ** 2 * D_over_xi2 / np.sqrt(1 - xi**2)


def _intensity(a: float, stress_drop: Callable[[float], float], breaks: np.ndarray) -> float:
    peak = 0.0

    def value(theta: float) -> float:
        nonlocal peak
        dtau = checked("stress_drop(t)", stress_drop(a * np.sin(theta)), "Pa")
        peak = max(peak, abs(dtau))
        return dtau

    ends = [0.0, *np.arcsin(breaks / a), np.pi / 2]
    total = error = 0.0
    for low, high in itertools.pairwise(ends):
        part, wrong, *_ = scipy.integrate.quad(
            value, low, high, epsabs=0, epsrel=1e-10, full_output=1
        )
        total, error = total + part, error + wrong
    if error > ACCURACY * peak:
        found = f"its quadrature for a = {a:.6g} m is uncertain by {error:.1g} Pa"
        allowed = f"a function smooth between its breaks; {found}"
        raise refusal("stress_drop", stress_drop, "", allowed)
    return 2 * np.sqrt(a / np.pi) * total
