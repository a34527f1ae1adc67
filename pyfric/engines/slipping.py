"""The slider while some blocks slip, with friction that depends on slip.

A block i that slips in direction sigma carries the friction mu(s) p, with p = -k_f (u_z + gap) and
s = s_0 + sigma u_x, on one linear piece of the law. Its u_x is free. The tangent contains its
friction:

    (K w)_i = (K_elastic w)_i + mu' p w_x - sigma mu k_f w_z .

Weakening, mu' < 0, is a negative stiffness. The last term makes K unsymmetric. A static solution is
the solution with slipping blocks held, plus static responses to their displacements. The same
responses extend the space of slow shapes.

These equations hold until a block stops, which restores its full strength. In units of N, the gap
functions of a slipping block are

    sqrt(k m) sigma v_x ,   p ,   k (s_knot - s) .

While they are positive, deviations of the slider from its quasi-static path have no lasting effect.
The path ends where the largest eigenvalue of the slider reaches zero. Slip then goes on without the
driver.

Source: J. R. Rice and A. L. Ruina, J. Appl. Mech. 50, 343 (1983), stability against a stiffness.
"""

from __future__ import annotations

import copy
import functools
import math
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import scipy.sparse as sp

from pyfric.engines.gaps import GapFunctions
from pyfric.engines.space import Space, Tangent
from pyfric.scene import of
from pyfric.statics import extended

if TYPE_CHECKING:
    from pyfric.statics import Weakening


class Stiffer(NamedTuple):
    """Change of the tangent of a slider that slips.

    Attributes:
        bonds: change of bond stiffness, shape (3, n_bonds), in N/m; None in linear geometry.
        weakens, rubs: changes of mu' p and of sigma mu k_f, shape (n,), in N/m.
    """

    bonds: np.ndarray | None
    weakens: np.ndarray
    rubs: np.ndarray


class SlipSpace(Space):
    """Static solutions and slow shapes with slipping blocks.

    Args:
        near: the slider with all blocks in contact held.
        slips: indices of the blocks that slip, shape (n,).

    Attributes:
        shapes: static responses to unit displacements of these blocks, shape (n_q, n).
    """

    def __init__(self, near: Space, slips: np.ndarray) -> None:
        self.near, self.solver, self.slips = near, near.solver, slips
        self.stuck = near.stuck.copy()
        self.stuck[slips] = False
        self.held, self.open = np.flatnonzero(self.stuck), near.open
        self.free = np.sort(np.append(near.free, slips))
        self.K, self.C, self.M, self.n_q = near.K, near.C, near.M, near.n_q
        self.cut, self.fastest, self.decay = near.cut, near.fastest, near.decay
        self.lifted = slips + len(self.stuck)
        self.shapes = near.moved(slips)
        self._rows, self.contact = near.K[slips], near.contact
        self._on_shapes = self._rows @ self.shapes
        self.B = extended(near.B, self.shapes, self.M)
        k_f, alpha = near.solver.scene.k_f, near.solver.scene.law.alpha
        fields = k_f, alpha, near.solver.scene.gap
        self.k_f, self.alpha, self.gap = (np.broadcast_to(of(a, slips), len(slips)) for a in fields)
        if self.alpha.any():
            self.C = self.C + self._entries(self.alpha)

    def at(self, weakening: Weakening, q: np.ndarray) -> Self:
        """Return this slider with the friction `weakening`, linearised at q (m), shape (n_q,)."""
        now, slips = copy.copy(self), self.slips
        now.weakening, now.way = weakening, weakening.way[slips]
        now.weakens, now.rubs = now._friction(q)
        now.K = self.near.K + self._entries(now.weakens, -now.rubs)
        now._K_held = now.K[self.held]
        against = self._on_shapes + now.frictional(self.shapes)
        now._responses = self.shapes @ np.linalg.inv(against)
        return now

    def _entries(self, along: np.ndarray, across: np.ndarray | None = None) -> sp.csr_array:
        """Return a matrix of entries in rows u_x, and columns u_x and u_z, of slipping blocks."""
        rows, columns = np.tile(self.slips, 2), np.concatenate([self.slips, self.lifted])
        values = np.concatenate([along, np.zeros_like(along) if across is None else across])
        return sp.csr_array((values, (rows, columns)), shape=(self.n_q, self.n_q))

    def _friction(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mu' p and sigma mu k_f at q, both of shape (n,), in N/m."""
        mu, slope = (part[self.slips] for part in self.weakening.friction(q[: len(self.stuck)]))
        return -slope * self.k_f * (q[self.lifted] + self.gap), self.way * mu * self.k_f

    def frictional(self, w: np.ndarray) -> np.ndarray:
        """Return the friction in K w of slipping blocks, (n, ...), in N, for w, (n_q, ...)."""
        return (self.weakens * w[self.slips].T - self.rubs * w[self.lifted].T).T

    def answer(self, force: np.ndarray) -> np.ndarray:
        """Return the static displacements under forces on all coordinates, shape (n_q,)."""
        x = self.near.answer(force)
        left = force[self.slips] - self._rows @ x - self.frictional(x)
        return x + self._responses @ left

    def forces(
        self, q: np.ndarray, drive: float, load: tuple[float, float] | None = None
    ) -> np.ndarray:
        """Return the forces on the coordinates, with the friction of slip; see `Space.forces`."""
        force = self.near.forces(q, drive, load)
        _, rubs = self._friction(q)
        force[self.slips] += rubs * (q[self.lifted] + self.gap)
        return force

    def damping(self, q: np.ndarray) -> sp.csr_array:
        """Return the damping matrix at q, viscous friction included, (n_q, n_q), in N s/m."""
        C = self.solver.damping(q)
        return C + self._entries(self.alpha) if self.alpha.any() else C

    def bends(self, q: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return second derivatives of resisting forces along q + s rate at s = 0, shape (n_q,)."""
        found = super().bends(q, rate)
        _, slope = self.weakening.friction(q[: len(self.stuck)])
        along, across = rate[self.slips], rate[self.lifted]
        found[self.slips] -= 2 * slope[self.slips] * self.k_f * along * across
        return found

    def elastic(self, w: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return a resisting force K w (N) without its friction, shape (n_q,)."""
        force = force.copy()
        force[self.slips] -= self.frictional(w)
        return force

    @property
    def linear(self) -> bool:
        """False, because friction contains products of displacements."""
        return False

    def tangent_at(self, q: np.ndarray) -> Tangent:
        """Return the tangent at coordinates q (m), shape (n_q,), of the linearisation."""
        if self.solver.geometry == "linear":
            return self.tangent
        tangent = self.near.tangent_at(q)
        friction = self._entries(self.weakens, -self.rubs)
        return Tangent(tangent.K + friction, self.damping(q), tangent.stiffer)

    def stiffer(self, q: np.ndarray) -> Stiffer:
        """Return the change of the tangent from the state of the linearisation to a state q (m)."""
        weakens, rubs = self._friction(q)
        return Stiffer(self.near.stiffer(q), weakens - self.weakens, rubs - self.rubs)

    def restoring(self, x: np.ndarray, stiffer: Stiffer | None) -> np.ndarray:
        """Return K x, shape (n_q,), with changes of the tangent included."""
        force = super().restoring(x, None if stiffer is None else stiffer.bonds)
        if stiffer is not None:
            force[self.slips] += stiffer.weakens * x[self.slips] - stiffer.rubs * x[self.lifted]
        return force


class SlipGaps(GapFunctions):
    """Gap functions with slipping blocks; see the docstring of the module.

    Args:
        space: the slider, linearised.
    """

    space: SlipSpace

    def __init__(self, space: SlipSpace) -> None:
        super().__init__(space)
        k, m = space.solver.scene.slider.k, space.solver.scene.m
        self._pace, self._near = math.sqrt(k * m), k
        self._end = space.weakening.knot()[space.slips]
        self._ends = np.flatnonzero(np.isfinite(self._end))

    @functools.cached_property
    def unmoved(self) -> np.ndarray:
        """Gap functions at q = 0 without forces, shape (n_c,), in N."""
        found, ends = super().unmoved, self._ends
        path = self._end - self.space.weakening.clock[self.space.slips]
        found[len(found) - len(ends) :] += self._near * path[ends]
        return found

    def of(self, q: np.ndarray, f: np.ndarray, v: np.ndarray | float = 0.0) -> np.ndarray:
        """Return gap functions, or their changes; see `GapFunctions.of`."""
        space = self.space
        along = v[space.slips] if np.ndim(v) else np.zeros(q[space.slips].shape)
        paces = self._pace * (space.way * along.T).T
        pressed = -(space.k_f * q[space.lifted].T).T
        slipped = -self._near * (space.way * q[space.slips].T).T
        return np.concatenate([super().of(q, f, v), paces, pressed, slipped[self._ends]])

    @functools.cached_property
    def bound(self) -> np.ndarray:
        """Largest change of each gap function by a truncated part of 1 J, shape (n_c,), in N.

        For k (s_knot - s) the change is an estimate from the bonds of one block. An estimate is
        enough, because a late passage of a knot changes friction only to second order.
        """
        space, slips = self.space, self.space.slips
        paces = self._pace**2 / space.M[slips]
        slipped = np.full(len(self._ends), self._near)
        more = np.sqrt(2 * np.concatenate([paces, space.k_f, slipped]))
        return np.append(super().bound, more)
