"""Loads over time: normal and shear forces, the path of the driver, pushes, limits of friction."""

import functools
import math
from typing import Literal

import numpy as np

from pyfric.scene.fields import Fields
from pyfric.scene.lattice import OnDriven
from pyfric.scene.parts import PrescribedLoad
from pyfric.scene.protocol import Leg, Piece, legs, piece_at, pieces

NO_LIMIT = float(np.finfo(float).max)
"""Value that stands for no limit of the friction coefficient."""


class Loads(Fields):
    """Forces on the blocks, path of the driver and limits of friction, as functions of time."""

    @functools.cached_property
    def F_N(self) -> float:
        """Total normal force in N."""
        prescribed = isinstance(self.top, PrescribedLoad)
        return math.fsum(self.p_prescribed) if prescribed else self.top.F_N

    @property
    def pressing(self) -> float:
        """Normal force on the interface at rest, in N: F_N and the weights of blocks and rod."""
        return self.F_N + float(self.weights.sum()) + self.M_rod * self.slider.g

    @property
    def p_prescribed(self) -> np.ndarray:
        """Prescribed p of the bottom blocks, left to right, shape (N_x,), in N.

        Without a `PrescribedLoad`, p is 0. A half block at a side has half of p.
        """
        if not isinstance(self.top, PrescribedLoad):
            return np.zeros(self.N_x)
        return self._by_column(self.top.p) * self.shares[1]

    @property
    def load(self) -> np.ndarray:
        """Downward forces on the top blocks, left to right, shape (N_x,), in N.

        The forces are 0 for a rod, and for a prescribed interface in two dimensions.
        """
        if self.rigid or self.prescribed:
            return np.zeros(self.N_x)
        if isinstance(self.top, PrescribedLoad):
            return self.p_prescribed
        slope = (2 * self.n_of_i - self.N_x - 1) / (self.N_x - 1)
        columns = self.shares[1]
        return self.F_N / columns.sum() * (1 + self.top.theta * slope) * columns

    @property
    def shear(self) -> np.ndarray:
        """Forces in +x on blocks of row j_shear at t = 0, left to right, shape (N_x,), in N.

        The forces are d tau_i for a `PrescribedLoad`, and d T/N_x for a `DistributedLoad`. A half
        block at a side has half of this force.
        """
        prescribed, columns = isinstance(self.top, PrescribedLoad), self.shares[1].sum()
        tau = self.top.tau if prescribed else self.top.T / columns
        return self.d * self._by_column(tau) * self.shares[1] + 0.0  # no -0.0

    @property
    def V_top(self) -> float:
        """Speed of the top plate in the drive direction, in m/s. T includes the plate's force."""
        return self.top.V_top or 0.0

    @functools.cached_property
    def corners(self) -> tuple[float, ...]:
        """Times of the breakpoints of protocols and pushes, in s, in order."""
        lists = self.driver.protocol, self.top.protocol, self.top.T_protocol
        times = {t for corners in lists for t, _ in corners}
        times |= {t + t_0 for t, _ in self.interface.limit for t_0 in self._limits_from.tolist()}
        times |= {t for push in self.top.push for t in (push.begin, push.end)}
        return tuple(sorted(t for t in times if 0 < t < math.inf))

    @functools.cached_property
    def _pieces(self) -> dict[str, list[Piece]]:
        rate = self.N_x * self.k_top * self.V_top
        return {
            "V": pieces(self.driver.V, self.driver.protocol),
            "F_N": pieces(self.F_N, self.top.protocol),
            "T": [piece.plus(rate) for piece in pieces(self.top.T, self.top.T_protocol)],
        }

    def piece(self, what: Literal["V", "F_N", "T"], t: float) -> Piece:
        """Return the piece of a protocol that begins at or before t (s): V, F_N or T."""
        return piece_at(self._pieces[what], t)

    def legs(self, t_end: float) -> list[Leg]:
        """Return the intervals up to t_end (s) in which the driver moves in one direction."""
        return legs(self._pieces["V"], t_end)

    def drive(self, t: float) -> float:
        """Return the displacement of the driver from 0 to t (s), in m: V t if V is constant."""
        return self.piece("V", t).integral_at(t)

    def driver_force(self, drive: float, u_h: OnDriven, u_drv0: OnDriven) -> float:
        """Return F_T = K (drive - d (u_h - u_drv0)) in N.

        Args:
            drive: displacement V t of the driver since t = 0, in m.
            u_h: u_x of the driven blocks, as `u_driven` returns it, or their mean, in m.
            u_drv0: value of u_h at which drive = 0 gives F_T = 0, in m.
        """
        return float(self.driver.K * (drive - self.d * np.mean(u_h - u_drv0)))

    def load_at(self, t: float) -> tuple[float, float] | None:
        """Return F_N and T (N) at t (s), or None if no protocol changes them."""
        if not (self.top.protocol or self.top.T_protocol or self.V_top):
            return None
        return self.piece("F_N", t).at(t), self.piece("T", t).at(t)

    def push_at(self, t: float, now: float | None = None) -> np.ndarray:
        """Return the pushes on the bottom blocks along +x, left to right, and their rates.

        Args:
            t: time that selects the active pushes, in s.
            now: time of evaluation, in s; None means t.

        Returns:
            Forces (N) and their rates (N/s), shape (2, N_x).
        """
        found = np.zeros((2, self.N_x))
        for push in self.top.push:
            if push.begin <= t < push.end:
                found[:, push.block - 1] += push.at(t if now is None else now), push.rate
        return self.d * found[:, self.n_of_i - 1] + 0.0  # no -0.0

    @functools.cached_property
    def _limits_from(self) -> np.ndarray:
        """Times from which the limits of friction count, left to right, shape (N_x,), in s."""
        given = self.interface.limit_from
        return np.zeros(self.N_x) if given is None else self.field("limit_from")

    def limit_at(self, t: float, now: float | None = None) -> np.ndarray:
        """Return the largest friction coefficients of the blocks, left to right, and their rates.

        Args:
            t: time that selects the pieces of `Interface.limit`, in s.
            now: time of evaluation, in s; None means t.

        Returns:
            Coefficients, `NO_LIMIT` for blocks without limit, and rates (1/s), shape (2, N_x).
        """
        found = np.array([np.full(self.N_x, NO_LIMIT), np.zeros(self.N_x)])
        if not (corners := self.interface.limit):
            return found
        times, mu = np.array(corners).T
        lasts = np.diff(times, append=np.inf)
        slopes = np.divide(np.diff(mu, append=mu[-1]), lasts, out=0 * mu, where=lasts > 0)
        begins = times[:, None] + self._limits_from  # rounded like `corners`
        n = np.sum(t >= begins, axis=0) - 1
        on = np.flatnonzero(n >= 0)
        n, since = n[on], (t if now is None else now) - begins[n[on], on]
        found[:, on] = mu[n] + slopes[n] * since, slopes[n]
        return found
