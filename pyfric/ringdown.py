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
because the viscosity of a bond resists all of the relative motion and its spring only a part.

Contact is watched through margins c in N, all positive while no state changes: mu_s p + f and
mu_s p - f of stuck blocks, k_f u_z of open ones.

In finite geometry K is that of the loaded state; strains are small, so it changes little.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from pyfric.operators import damping, mass

if TYPE_CHECKING:
    from pyfric.equilibrium import StaticSolver

__all__ = ["Frozen", "Motion", "Rest", "first_crossing"]

N_VALUES = 40
"""Eigenvalues that are computed, those of smallest modulus; two make an oscillating mode."""
TINY = 1e-11
"""Tension below this many F_N/N_x is rounding."""
MAX_ITER = 100
"""Most restarts of ARPACK; few are needed."""
GRID = 64
"""Points at which margins are evaluated together."""


class Rest(NamedTuple):
    """A static state: coordinates, then forces on the interface (N), u_z (m), shape (N_x,)."""

    q: np.ndarray
    f: np.ndarray
    tau: np.ndarray
    p: np.ndarray
    u_z: np.ndarray
    F_T: float


class Motion(NamedTuple):
    """A deviation from the drifting state: amplitudes of modes and energy of the remainder, J."""

    a: np.ndarray
    remainder: float


class Frozen:
    """The slider with fixed contact states: drift, modes, and what they do to the contact.

    Args:
        solver: static states of the scene in its geometry.
        stuck: blocks that are held, shape (N_x,), bool; all others are open.

    Attributes:
        rates: eigenvalues of the modes, one of each conjugate pair, shape (n,), in 1/s.
        drift: dq/dX of the static state, shape (n_q,).
        lag: offset of the drifting state from the static one, shape (n_q,), in m.
        margin_rate: change of the margins with X, shape (n_c,), in N/m.
        force_rate: change of F_T with X, in N/m.
        bound: change of the margins by a remainder of energy E over sqrt(E), (n_c,), in N/sqrt(J).
        decay: rate at which the remainder decays at least, in 1/s.
    """

    def __init__(self, solver: StaticSolver, stuck: np.ndarray) -> None:
        scene = solver.scene
        N_x, k_f, mu_s, V = scene.N_x, scene.k_f, scene.interface.mu_s, scene.driver.V
        self.stuck, self.mu_s, self.k_f = stuck, mu_s, k_f
        K, factor, free = solver.tangent(stuck)
        self.solver, self._factor, self._rows = solver, factor, K
        self.free, self.n_q = free, K.shape[0]
        C = damping(scene)
        self.K, self.C, self.M = K[free][:, free], C[free][:, free], mass(scene)[free]
        self.push = push = scene.driver.K * scene.d * solver.driven_row
        self.drift, self.lag = np.zeros(self.n_q), np.zeros(self.n_q)
        self.drift[free] = factor.solve(push[free])
        self.lag[free] = factor.solve(-(self.C @ (V * self.drift[free])))
        self._find_modes(factor)
        cut = np.max(np.abs(self.rates), initial=0.0)
        self.decay = scene.eta * cut**2 / (4 * scene.slider.k)

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

    def _find_modes(self, factor) -> None:
        """Find the eigenvalues of smallest modulus and their modes."""
        n, C, M = len(self.free), self.C, self.M
        start = self.drift[self.free]
        inertia = float(start @ (M * start))
        # Rates are counted in units of a slow one: without that, ARPACK is lost where eta is small.
        unit = math.sqrt(float(start @ (self.K @ start)) / inertia) if inertia > 0 else 1.0

        def inverse(z: np.ndarray) -> np.ndarray:
            return np.concatenate([-factor.solve(C @ z[:n] + (M * unit) * z[n:]), z[:n] / unit])

        operator = LinearOperator((2 * n, 2 * n), inverse, dtype=float)
        start = np.concatenate([start, np.zeros(n)])
        count = min(N_VALUES, 2 * n - 2)
        try:
            found, vectors = eigs(
                operator, count, which="LM", v0=start + 1e-3 * np.abs(start).max(), maxiter=MAX_ITER
            )
        except ArpackError:  # no modes: all is remainder
            found, vectors = np.zeros(0, complex), np.zeros((2 * n, 0), complex)
        one_of_pair = found.imag <= 0
        rates = 1 / found[one_of_pair]
        self.rates = rates = np.minimum(rates.real, 0.0) + 1j * rates.imag
        self.phi = phi = vectors[:n, one_of_pair]
        self.weight = np.where(rates.imag > 0, 2.0, 1.0)
        momentum = M[:, None] * phi
        left = C @ phi + momentum * rates
        norm = np.sum(phi * (left + momentum * rates), axis=0)
        self._left, self._left_v = (left / norm).T, (momentum / norm).T

    def _compliance(self, factor, at: int) -> float:
        one = (self.free == at).astype(float)
        return float(one @ factor.solve(one))

    def rest(self, u_x: np.ndarray, drive: float) -> Rest | None:
        """Return the static state in linear geometry, None if it has other open blocks.

        Args:
            u_x: of the bottom blocks, shape (N_x,), in m; not used where open.
            drive: displacement of the driver since t = 0, in m.
        """
        scene, free = self.solver.scene, self.free
        N_x, held = scene.N_x, np.flatnonzero(self.stuck)
        load = self.solver.load + (drive + scene.d * self.solver.u_drv0) * self.push
        q = np.zeros(self.n_q)
        q[held] = u_x[held]
        q[free] = self._factor.solve(load[free] - self._rows[free] @ q)
        f = np.zeros(N_x)
        f[held] = (self._rows[held] @ q) - load[held]
        p = np.where(self.stuck, -self.k_f * q[N_x : 2 * N_x], 0.0)
        F_T = scene.driver.K * (drive + scene.d * (self.solver.u_drv0 - self.solver.driven_row @ q))
        rest = Rest(q, f, -scene.d * f, p, q[N_x : 2 * N_x], float(F_T))
        tiny = TINY * scene.F_N / N_x
        apart = (p[held] < -tiny).any() or (self.k_f * rest.u_z[~self.stuck] < -tiny).any()
        return None if apart else rest

    def margins(self, rest: Rest) -> np.ndarray:
        """Return the margins in a static state, shape (n_c,), in N."""
        load, f = self.mu_s * rest.p[self.stuck], rest.f[self.stuck]
        return np.concatenate([load + f, load - f, self.k_f * rest.u_z[~self.stuck]])

    def split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        """Split a deviation w (m) with rate v (m/s), shape (n_q,), into modes and remainder."""
        w, v = w[self.free], v[self.free]
        a = self._left @ w + self._left_v @ v
        w = w - (self.phi @ (self.weight * a)).real
        v = v - (self.phi @ (self.weight * a * self.rates)).real
        return Motion(a, 0.5 * float(v @ (self.M * v) + w @ (self.K @ w)))

    def deviation(self, a: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return w (m) and w' (m/s) of modes of amplitude a a time s (s) later, shape (n_q,)."""
        w, v = np.zeros(self.n_q), np.zeros(self.n_q)
        later = self.weight * a * np.exp(self.rates * s)
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
