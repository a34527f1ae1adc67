"""The chain: the exact speed of a steady front.

Units: lattice constant l = 1, long-wave speed c = l sqrt(k/m) = 1. A block slips as soon as the
force of its springs and dashpots reaches the static threshold. `eta` is the bond viscosity.
`alpha` is the viscosity of a force -alpha v on every sliding block. Both viscosities are over
sqrt(k m). tau_bar is the uniform scaled prestress (tau/p - mu_k)/(mu_s - mu_k).

In the frame of the front the Fourier transform leads to a Wiener-Hopf problem with the kernel

    kappa(q) = [v^2 q^2 + i alpha v q - 4 sin^2(q/2) (1 - i eta v q)]/[v q (v q + i alpha)],

Im kappa >= 0 for q > 0, and kappa -> 1 for q -> inf. The factor of kappa at q = 0 is tau_bar:

    tau_bar = exp(-(1/pi) integral_0^inf arg kappa dq/q)           alpha > 0,
    tau_bar = sqrt(1 - 1/v^2) times this factor                    alpha = 0, v > 1.

For alpha = 0 and eta = 1, kappa = (1 - A(q)/(i v q))(1 - A(-q)/(i v q)) with A = 1 - exp(i q). The
factors have no zeros in their half planes, because |A| <= |q| there. Hence tau_bar = 1 - 1/v. For
alpha = eta = 0 the argument of kappa vanishes, and tau_bar = sqrt(1 - 1/v^2).

tau_bar rises with v in all tested cases, so that its inverse is unique. Where sliding is
overdamped, v << alpha, inertia drops out and tau_bar depends on w = alpha v alone:

    tau_bar = exp(-(1/pi) integral_0^inf arg[1 + 4 i sin^2(q/2)/(w q)] dq/q).

All formulas assume a steady front, behind which blocks go on sliding. Without inertia, a front
starts by itself once 1/tau_bar - 1 blocks are released. Only a run shows whether a front persists.
With little viscosity and little prestress it arrests, or alternates between arrest and propagation
(`Record.rupture_class`), although the formulas give a speed.

Source: derived here (Wiener-Hopf), after L. I. Slepyan, Models and Phenomena in Fracture Mechanics
(2002).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from pyfric.theory.inputs import checked, checked_array, refusal

SLOWEST, FASTEST = 1e-4, 1e4
"""Range of front speeds, in c."""
LARGEST_VISCOSITY = 10.0
"""Largest alpha and eta accepted, in sqrt(k m)."""

SLOWEST_OVERDAMPED, FASTEST_OVERDAMPED = 1e-8, 1e4
"""Range of w = alpha v, in c sqrt(k m)."""

_FAR = 200.0  # v q from which the tail is expanded, for eta, alpha <= 1
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_PERIODS = 64  # number of periods of q that are integrated one by one
_DAMPED = 50.0  # (alpha + 4 eta)/v from which waves with v q of order one leave exp(-25) or less
_HARMONICS = np.arange(1.0, 4001.0)


def chain_prestress(v: ArrayLike, alpha: float = 0.0, eta: float = 0.0) -> np.ndarray:
    """Return the scaled prestress tau_bar of a steady front of speed v, to about 1e-8.

    Args:
        v: front speed in c, any shape, `SLOWEST` to `FASTEST`; above 1 if alpha = 0.
        alpha: absolute viscosity in sqrt(k m), 0 to `LARGEST_VISCOSITY`.
        eta: bond viscosity in sqrt(k m), 0 to `LARGEST_VISCOSITY`.

    Source: see the module.
    """
    alpha, eta = _viscosities(alpha, eta)
    limits = {"ge": SLOWEST} if alpha else {"gt": 1.0}
    v = checked_array("v", v, "c", **limits, le=FASTEST)
    return np.reshape([_prestress(speed, alpha, eta) for speed in v.flat], v.shape)[()]


def chain_speed(tau_bar: ArrayLike, alpha: float = 0.0, eta: float = 0.0) -> np.ndarray:
    """Return the speed of a steady front, in c: the inverse of `chain_prestress`.

    Such a front need not start or persist. `Record.rupture_class` classifies the front of a run.

    Args:
        tau_bar: scaled prestress, between 0 and 1, any shape.
        alpha, eta: as in `chain_prestress`.

    Raises:
        ValueError: a value is out of range, or the speed would be outside `SLOWEST` ... `FASTEST`.
    """
    alpha, eta = _viscosities(alpha, eta)
    tau_bar = checked_array("tau_bar", tau_bar, gt=0, lt=1)
    least = SLOWEST if alpha else 1.0

    def prestress(v: float) -> float:
        return _prestress(v, alpha, eta) if alpha or v > 1 else 0.0

    limits = least, FASTEST, f"a front of {least:g} c to {FASTEST:g} c"
    return np.reshape(
        [_inverse(prestress, value, *limits) for value in tau_bar.flat], tau_bar.shape
    )[()]


def chain_prestress_overdamped(w: ArrayLike) -> np.ndarray:
    """Return tau_bar of a steady front where inertia is negligible, eta = 0; see the module.

    Args:
        w: alpha v in c sqrt(k m), any shape, `SLOWEST_OVERDAMPED` to `FASTEST_OVERDAMPED`.
    """
    limits = {"ge": SLOWEST_OVERDAMPED, "le": FASTEST_OVERDAMPED}
    w = checked_array("w", w, "c sqrt(k m)", **limits)
    return np.reshape([_overdamped(value) for value in w.flat], w.shape)[()]


def chain_speed_overdamped(tau_bar: ArrayLike, alpha: float) -> np.ndarray:
    """Return v = w(tau_bar)/alpha, in c: slow fronts; see `chain_prestress_overdamped`.

    Args:
        tau_bar: scaled prestress, between 0 and 1, any shape.
        alpha: absolute viscosity in sqrt(k m), > 0. The formula holds for v << alpha. At v = 0.1
            alpha the true speed differs by about 1 %.
    """
    tau_bar = checked_array("tau_bar", tau_bar, gt=0, lt=1)
    alpha = checked("alpha", alpha, "sqrt(k m)", gt=0)
    limits = (SLOWEST_OVERDAMPED, FASTEST_OVERDAMPED, f"w = alpha v of {SLOWEST_OVERDAMPED:g} to "
              f"{FASTEST_OVERDAMPED:g}")  # fmt: skip
    w = [_inverse(_overdamped, value, *limits) for value in tau_bar.flat]
    return np.reshape(w, tau_bar.shape)[()] / alpha


def chain_speed_undamped(tau_bar: ArrayLike) -> np.ndarray:
    """Return v = 1/sqrt(1 - tau_bar^2), in c: the front for alpha = eta = 0.

    Args:
        tau_bar: scaled prestress, 0 to 1 (not included), any shape.

    >>> round(float(pyfric.theory.chain_speed_undamped(0.6)), 12)
    1.25
    """
    tau_bar = checked_array("tau_bar", tau_bar, ge=0, lt=1)
    return (1 / np.sqrt((1 - tau_bar) * (1 + tau_bar)))[()]


def chain_speed_critical(tau_bar: ArrayLike) -> np.ndarray:
    """Return v = 1/(1 - tau_bar), in c: the front for alpha = 0, eta = 1; see the module.

    Args and errors as in `chain_speed_undamped`.
    """
    return (1 / (1 - checked_array("tau_bar", tau_bar, ge=0, lt=1)))[()]


# --- parts ---------------------------------------------------------------------------------------


def _viscosities(alpha: float, eta: float) -> tuple[float, float]:
    limits = {"ge": 0, "le": LARGEST_VISCOSITY}
    return tuple(checked(n, x, "sqrt(k m)", **limits) for n, x in (("alpha", alpha), ("eta", eta)))


def _arg_over_q(q: ArrayLike, v: float, alpha: float, eta: float) -> np.ndarray:
    """Return arg kappa / q. As Im kappa >= 0, arctan2 is the continuous branch, 0 to pi."""
    u, s = v * q, 4 * np.sin(q / 2) ** 2
    w = s / (u * u + alpha * alpha)
    return np.arctan2(w * (alpha / u + eta * u), 1 - w * (1 - alpha * eta)) / q


def _prestress(v: float, alpha: float, eta: float) -> float:
    if alpha == eta == 0:
        return np.sqrt(1 - 1 / v**2)
    if (alpha + 4 * eta) > _DAMPED * v:
        return _damped(v, alpha, eta)
    period = 2 * np.pi
    near = int(np.ceil(4 * max(1, eta) / (v * period)))  # zeros of kappa can lie close to these q
    far = max(near, 6, int(np.ceil(_FAR * max(1, alpha, eta) / (v * period))))
    # For small alpha, arg is a step of width alpha/v about q = alpha/v: a panel for each decade.
    ends = np.append(0.0, 10.0 ** np.arange(np.floor(np.log10(min(alpha / v, 1.0) or 1.0)), 1))
    total = _panels([*ends, *(period * np.arange(1, near + 1))], v, alpha, eta)
    q = period * (np.arange(near, far)[:, None] + (1 + _NODES) / 2)
    total += np.pi * np.sum(_arg_over_q(q, v, alpha, eta) @ _WEIGHTS)
    # Beyond Q, a multiple of 2 pi, arg = 4 sin^2(q/2) eta/(v q) + terms of mean b/(v q)^3.
    Q = period * far
    b = 2 * (alpha + 3 * eta) * (1 - alpha * eta) - 20 / 3 * eta**3
    total += 2 * eta / v * (np.pi / 2 - scipy.special.sici(Q)[0]) + b / (3 * (v * Q) ** 3)
    factor = 1.0 if alpha else np.sqrt(1 - 1 / v**2)
    return factor * np.exp(-total / np.pi)


def _panels(ends: Sequence[float], *kernel: float, of: Callable[..., Any] = _arg_over_q) -> float:
    """Return the integral of arg kappa / q over panels of q between these ends."""
    how = {"epsabs": 1e-11, "limit": 1000, "full_output": 1}
    return sum(
        scipy.integrate.quad(of, *span, kernel, **how)[0] for span in itertools.pairwise(ends)
    )


def _damped(v: float, alpha: float, eta: float) -> float:
    """Return tau_bar where viscosity damps all waves that the front makes, alpha + 4 eta >> v."""

    def W(u: complex) -> complex:
        return (1 - 1j * eta * u) / (u * (u + 1j * alpha))

    def dW(u: complex) -> complex:
        return -(1j * eta + W(u) * (2 * u + 1j * alpha)) / (u * (u + 1j * alpha))

    ends = 2 * np.pi * np.arange(_PERIODS + 1.0)
    return np.exp(-(_panels(ends, v, alpha, eta) + _beyond(W, dW, v)) / np.pi)


def _overdamped(w: float) -> float:
    """Return tau_bar(w), computed as in `_damped` with W = 1/(i u), u = w q."""
    ends = 2 * np.pi * np.arange(_PERIODS + 1.0)
    near = _panels(ends, w, of=lambda q, w: math.atan2(4 * math.sin(q / 2) ** 2, w * q) / q)
    return np.exp(-(near + _beyond(lambda u: -1j / u, lambda u: 1j / u**2, w)) / np.pi)


def _beyond(W: Callable[[float], complex], dW: Callable[[float], complex], v: float) -> float:
    """Return the integral of arg kappa / q from `_PERIODS` periods of q on, to 1e-10.

    kappa = 1 - 4 sin^2(q/2) W(u), u = v q, is C (1 - r exp(i q))(1 - r exp(-i q)) with
    C = ((1 + z)/2)^2, r = (z - 1)/(z + 1), z = sqrt(1 - 4 W). The mean of its argument over a
    period is arg C. The oscillation about this mean adds 2 v^2 d/du [Im Li_3(r)/u] at `begin`, and
    terms of v^4.
    """
    begin = 2 * np.pi * _PERIODS * v

    def mean(x: float) -> float:
        return 2 * np.angle(1 + np.sqrt(1 - 4 * W(np.exp(x))))

    end = max(np.log(begin), 0.0) + 30.0  # arg C falls as 1/u at least
    corner = np.log(2.0)
    ends = sorted({np.log(begin), end, *([corner] if np.log(begin) < corner else [])})
    how = {"epsabs": 1e-12, "limit": 1000}
    total = sum(scipy.integrate.quad(mean, *span, **how)[0] for span in itertools.pairwise(ends))
    z = np.sqrt(1 - 4 * W(begin))
    r, k = (z - 1) / (z + 1), _HARMONICS
    slope = -4 * dW(begin) / z / (z + 1) ** 2  # dr/du
    swing = np.sum(r**k * (slope / (r * k**2 * begin) - 1 / (k**3 * begin**2))).imag
    return total + 2 * v**2 * swing


def _inverse(
    of: Callable[[float], float], tau_bar: float, slowest: float, fastest: float, what: str
) -> float:
    """Return v with of(v) = tau_bar, or raise ValueError if v is not in the range."""

    def excess(v: float) -> float:
        return of(v) - tau_bar

    low, high = 1.0, 2.0
    while excess(high) < 0 and high < fastest:
        low, high = high, min(2 * high, fastest)
    while excess(low) > 0 and low > slowest:
        low, high = max(low / 2, slowest), low
    at_low, at_high = excess(low), excess(high)
    if at_low > 0 or at_high < 0:
        limit = tau_bar + (at_low if at_low > 0 else at_high)
        sign = ">=" if at_low > 0 else "<="
        raise refusal("tau_bar", float(tau_bar), "", f"a number {sign} {limit:.9g}, for {what}")
    return scipy.optimize.brentq(excess, low, high, xtol=1e-15, rtol=1e-11)
