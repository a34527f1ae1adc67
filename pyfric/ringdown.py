"""Ring-down of a slider on which nothing slips: a few modes, and a bound for the rest.

While no contact state changes, the slider is a damped linear oscillator about a static state that
drifts with the driver. With w the deviation from the drifting state, the blocks that stick held and
the open ones free,

    M w'' + C w' + K w = 0 .

The slowest modes phi exp(lambda s), (lambda^2 M + lambda C + K) phi = 0, are followed in closed
form. M, C and K are symmetric, so the amplitude of a mode is

    a = (phi.(C w + M w') + lambda phi.M w) / (phi.C phi + 2 lambda phi.M phi) .

The energy E of what the modes leave out cannot grow. By the inequality of Cauchy and Schwarz it
bounds what the remainder does to the contact at any later time. It also decays: a mode of frequency
omega with at least half of its elastic energy in the bonds has -Re lambda >= eta omega^2/(4 k),
because the viscosity of a bond resists all of the relative motion and its spring only a part. The
slower one of two overdamped modes decays at its own |lambda|.

Contact is watched through margins c in N, all positive while no state changes: mu_s p + f and
mu_s p - f of stuck blocks, k_f u_z of open ones.

A step of RK4 multiplies a mode by R(lambda dt) = 1 + z + z^2/2 + z^3/6 + z^4/24 and reproduces the
drifting state exactly, so that the ring-down of a run with steps dt is that of the rates
log(R)/dt: nothing is lost or gained against stepping.

In finite geometry K is that of the loaded state; strains are small, so it changes little.
`Frozen.stiffened` corrects the rates, whose errors add up over time, to first order.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from pyfric.operators import damping, mass

if TYPE_CHECKING:
    from pyfric.equilibrium import Equilibrium, StaticSolver

__all__ = ["Frozen", "Motion", "first_crossing"]

N_VALUES = 40
"""Eigenvalues that are computed, those of smallest modulus; two make an oscillating mode."""
GRID = 64
"""Points at which margins are evaluated together."""


class Motion(NamedTuple):
    """A deviation from the drifting state: amplitudes of modes and energy of the remainder, J."""

    a: np.ndarray
    remainder: float


class Frozen:
    """The slider with fixed contact states: drift, modes, and what they do to the contact.

    Args:
        solver: static states of the scene in its geometry.
        stuck: blocks that are held, shape (N_x,), bool; all others are open.
        dt: step of RK4 that the ring-down follows, in s; None means exact time.

    Attributes:
        rates: eigenvalues of the modes, one of each conjugate pair, shape (n,), in 1/s.
        growth: rates of the amplitudes: `rates`, or what RK4 makes of them, shape (n,), in 1/s.
        drift: dq/dX of the static state, shape (n_q,).
        lag: offset of the drifting state from the static one, shape (n_q,), in m.
        margin_rate: change of the margins with X, shape (n_c,), in N/m.
        force_rate: change of F_T with X, in N/m.
        bound: change of the margins by a remainder of energy E over sqrt(E), (n_c,), in N/sqrt(J).
        decay: rate at which the remainder decays at least, in 1/s.
    """

    def __init__(self, solver: StaticSolver, stuck: np.ndarray, dt: float | None = None) -> None:
        scene = solver.scene
        N_x, k_f, mu_s, V = scene.N_x, scene.k_f, scene.interface.mu_s, scene.driver.V
        self.stuck, self.mu_s, self.k_f = stuck, mu_s, k_f
        K, factor, free = solver.tangent(stuck)
        self.free, self.n_q = free, K.shape[0]
        C = damping(scene)
        self.K, self.C, self.M = K[free][:, free], C[free][:, free], mass(scene)[free]
        push = scene.driver.K * scene.d * solver.driven_row
        self.drift, self.lag = np.zeros(self.n_q), np.zeros(self.n_q)
        self.drift[free] = factor.solve(push[free])
        self.lag[free] = factor.solve(-(self.C @ (V * self.drift[free])))
        # Stuck blocks of a chain can only move vertically, which nothing makes them do.
        self._find_modes(factor, N_VALUES if scene.N_z > 1 else 0)
        self.dt = dt
        self.growth = self.stepped(self.rates)
        cut = np.max(np.abs(self.rates), initial=0.0)
        self.decay = min(scene.eta * cut**2 / (4 * scene.slider.k), cut)

        # margins as rows over w and w'
        held, open_ = np.flatnonzero(stuck), np.flatnonzero(~stuck)
        pick = sp.eye_array(self.n_q, format="csr")
        p = -k_f * pick[held + N_x]
        rows = sp.vstack([mu_s * p + K[held], mu_s * p - K[held], k_f * pick[open_ + N_x]]).tocsr()
        rows_v = sp.vstack([C[held], -C[held], sp.csr_array((len(open_), self.n_q))]).tocsr()
        self.modal = rows[:, free] @ self.phi + (rows_v[:, free] @ self.phi) * self.rates
        direct = np.concatenate([-push[held], push[held], np.zeros(len(open_))])
        self.margin_rate = rows @ self.drift + direct
        self.margin_lag = rows @ self.lag + rows_v @ (V * self.drift)
        viscous = C[held][:, free].multiply(C[held][:, free]) @ (1 / self.M)
        stiff = mu_s**2 * k_f + K.diagonal()[held] + viscous
        lift = [self._compliance(factor, i + N_x) for i in open_]
        self.bound = np.sqrt(2 * np.concatenate([stiff, stiff, k_f**2 * np.array(lift)]))
        # F_T = K_drv (X - d u_h)
        row = -scene.driver.K * scene.d * solver.driven_row
        self.force_modal, self.force_lag = row[free] @ self.phi, float(row @ self.lag)
        self.force_rate = scene.driver.K + float(row @ self.drift)

    def _find_modes(self, factor, count: int) -> None:
        """Find the eigenvalues of smallest modulus, up to count of them, and their modes."""
        n, C, M = len(self.free), self.C, self.M

        def inverse(z: np.ndarray) -> np.ndarray:
            return np.concatenate([-factor.solve(C @ z[:n] + M * z[n:]), z[:n]])

        operator = LinearOperator((2 * n, 2 * n), inverse, dtype=float)
        start = np.concatenate([self.drift[self.free], np.zeros(n)])
        start += 1e-3 * np.abs(start).max() * np.cos(np.arange(2 * n))
        count = min(count, 2 * n - 2)
        found, vectors = np.zeros(0, complex), np.zeros((2 * n, 0), complex)
        for ncv in (2 * count + 1, 4 * count) if count else ():  # pairs may need more room
            try:
                found, vectors = eigs(operator, count, ncv=min(ncv, 2 * n), v0=start, maxiter=20)
            except ArpackError:  # no modes: all is remainder
                continue
            break
        one_of_pair = found.imag <= 0
        self.rates = rates = 1 / found[one_of_pair]
        rates.real = np.minimum(rates.real, 0.0)  # rounding where nothing is damped
        self.phi = phi = vectors[:n, one_of_pair]
        self.weight = np.where(rates.imag > 0, 2.0, 1.0)
        momentum = M[:, None] * phi
        left = C @ phi + momentum * rates
        self._norm = norm = np.sum(phi * (left + momentum * rates), axis=0)
        self._left, self._left_v = (left / norm).T, (momentum / norm).T

    def _compliance(self, factor, at: int) -> float:
        one = (self.free == at).astype(float)
        return float(one @ factor.solve(one))

    def margins(self, rest: Equilibrium) -> np.ndarray:
        """Return the margins in a static state, shape (n_c,), in N."""
        load, f = self.mu_s * rest.p[self.stuck], rest.f[self.stuck]
        return np.concatenate([load + f, load - f, self.k_f * rest.u[0, 1, ~self.stuck]])

    def slack(self, margins: np.ndarray) -> np.ndarray:
        """Return mu_s p - |f| of each bottom block, shape (N_x,), in N; 0 where open."""
        n, slack = int(self.stuck.sum()), np.zeros(len(self.stuck))
        slack[self.stuck] = np.minimum(margins[:n], margins[n : 2 * n])
        return slack

    def split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        """Split a deviation w (m) with rate v (m/s), shape (n_q,), into modes and remainder."""
        w, v = w[self.free], v[self.free]
        a = self._left @ w + self._left_v @ v
        w = w - (self.phi @ (self.weight * a)).real
        v = v - (self.phi @ (self.weight * a * self.rates)).real
        energy = 0.5 * float(v @ (self.M * v) + w @ (self.K @ w))
        return Motion(a, max(energy, 0.0))

    def stepped(self, rates: np.ndarray) -> np.ndarray:
        """Return the rates of amplitudes that RK4 makes of rates, 1/s."""
        if self.dt is None:
            return rates
        z = rates * self.dt
        growth = np.log(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))) / self.dt
        growth.real = np.minimum(growth.real, 0.0)
        return growth

    def stiffened(self, change: sp.csr_array) -> np.ndarray:
        """Return `growth` where K differs by a small change (N/m), to first order."""
        change = change[self.free][:, self.free] @ self.phi
        return self.stepped(self.rates - np.sum(self.phi * change, axis=0) / self._norm)

    def deviation(
        self, a: np.ndarray, s: float, growth: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return w (m) and w' (m/s) of modes of amplitude a a time s (s) later, shape (n_q,)."""
        w, v = np.zeros(self.n_q), np.zeros(self.n_q)
        later = self.weight * a * np.exp((self.growth if growth is None else growth) * s)
        w[self.free] = (self.phi @ later).real
        v[self.free] = (self.phi @ (later * self.rates)).real
        return w, v


def first_crossing(
    c: np.ndarray, rate: np.ndarray, modal: np.ndarray, rates: np.ndarray, s_end: float, ds: float
) -> float:
    """Return the first s in [0, s_end] at which c + rate s + Re(modal exp(rates s)) reaches 0.

    Nothing is missed between points: where a margin could dip below 0 within an interval, by the
    bound of its second derivative, the interval is halved.

    Args:
        c: margins, shape (n_c,), in N.
        rate: their drift, shape (n_c,), in N/s.
        modal: amplitudes, shape (n_c, n), complex, in N.
        rates: eigenvalues, shape (n,), in 1/s, with negative real part.
        s_end: end of the search, in s; returned if nothing crosses before.
        ds: resolution, in s: an interval this short that could hold a crossing counts as one.
    """
    size = np.abs(modal)
    fastest = np.max(np.abs(rates), initial=1 / s_end)
    s, h = 0.0, 0.1 / fastest
    while s < s_end:
        decay = np.exp(rates.real * s)
        # Leap: the modes can do no more than their present amplitude.
        low = c + rate * s - size @ decay
        if (low > 0).all():
            falls = rate < 0
            leap = float(np.min(low[falls] / -rate[falls], initial=np.inf))
            if leap > GRID * h:
                s = min(s + leap, s_end)
                continue
        grid = s + h * np.arange(GRID + 1)
        value = c[:, None] + rate[:, None] * grid + (modal @ np.exp(np.outer(rates, grid))).real
        curve = (size * np.abs(rates) ** 2) @ np.exp(np.outer(rates.real, grid[:-1])) * (h**2 / 8)
        sure = (np.minimum(value[:, :-1], value[:, 1:]) > curve).all(axis=0)
        n_sure = int(np.argmin(sure)) if not sure.all() else GRID
        s += n_sure * h
        if n_sure == GRID:
            h *= 2
        elif (n_sure < GRID and (value[:, n_sure] <= 0).any()) or h <= ds:
            return min(s, s_end)
        else:
            h = max(h / 4, ds / 2)
    return s_end if math.isfinite(s_end) else s
