"""The quasi-static path of the slider at fixed contact states, and the static state it begins at.

Let s be the time since a jump began, K the tangent stiffness, and b the forces on the coordinates.
Between two breakpoints of a protocol, b is linear or quadratic in s. The path and its viscous lag
are

    q_0 + q_1 s + q_2 s^2/2 + l_0 + l_1 s ,
    K q_1 = b' ,   K q_2 = b'' - R ,   K l_1 = -C q_2 ,   K l_0 = -C (q_1 + l_1) - M q_2 .

R is the second derivative of the spring forces along q_1. In linear geometry R is zero and the path
is exact. In finite geometry the path is a prediction, which a jump corrects.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pyfric.engines.modes import Modes
    from pyfric.statics import StaticSolver

ROUNDS = 8
"""Largest number of corrections of one path. Corrections converge in fewer rounds, or diverge."""


class Outside:
    """Driver and loads from a time up to the next breakpoint of a protocol.

    Args:
        solver: static states of the scene in its geometry.
        t: time at which s = 0, in s.
        after: a time that selects the piece of the protocol, in s; None means t.
    """

    def __init__(self, solver: StaticSolver, t: float, after: float | None = None) -> None:
        self.solver, self.t = solver, t
        scene = solver.scene
        V, F_N, T = (scene.piece(what, t if after is None else after) for what in ("V", "F_N", "T"))
        self.drive, self.V, self.a = V.integral_at(t), V.at(t), V.slope
        self.load = None if scene.load_at(t) is None else (F_N.at(t), T.at(t))
        self.gain = (F_N.slope, T.slope)

    @property
    def steady(self) -> bool:
        """Whether forces change at a constant rate."""
        return self.a == 0

    @functools.cached_property
    def load_rate(self) -> np.ndarray | float:
        """Rate of the forces of loads on the coordinates, shape (n_q,), in N/s."""
        if not any(self.gain):
            return 0.0
        return self.solver.under(self.gain).load - self.solver.under((0.0, 0.0)).load

    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return b' (N/s) and b'' (N/s^2), shape (n_q,)."""
        return self.V * self.solver.push + self.load_rate, self.a * self.solver.push

    def drive_at(self, s: float | np.ndarray) -> float | np.ndarray:
        """Return the position of the driver at s (s), in m."""
        return self.drive + s * (self.V + (0.5 * s) * self.a)

    def load_at(self, s: float) -> tuple[float, float] | None:
        """Return F_N and T at s (s), in N; None if they never change."""
        if self.load is None:
            return None
        return self.load[0] + s * self.gain[0], self.load[1] + s * self.gain[1]


class Path(NamedTuple):
    """The quasi-static path of the slider, and its lag, as polynomials in s.

    Each polynomial is given by its value, first and second derivative at s = 0.

    Attributes:
        q: static coordinates, shape (3, n_q).
        lag: lag of the coordinates, shape (3, n_q).
        gaps: gap functions including the lag, shape (3, n_c), in N.
        stiffer: change of bond stiffness at s = 0, shape (3, n_bonds), in N/m; None if linear.
    """

    q: np.ndarray
    lag: np.ndarray
    gaps: np.ndarray
    stiffer: np.ndarray | None

    def bent(self, shift: np.ndarray, gaps: np.ndarray, s: float) -> Path:
        """Return the path with the same start, changed by shift (m) and gaps (N) at s (s)."""
        q, of_gaps = self.q.copy(), self.gaps.copy()
        q[2] += 2 / s**2 * shift
        of_gaps[2] += 2 / s**2 * gaps
        return self._replace(q=q, gaps=of_gaps)


def at(polynomial: np.ndarray, s: float) -> np.ndarray:
    """Return the value of a polynomial of `Path` at s (s)."""
    return polynomial[0] + s * (polynomial[1] + (0.5 * s) * polynomial[2])


def rest(
    modes: Modes,
    q: np.ndarray,
    drive: float,
    load: tuple[float, float] | None,
    enough: float,
    contraction: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return the static state at fixed contact states, its forces, and the contraction.

    Args:
        modes: the slider at these contact states.
        q: start of the iteration, with stuck blocks at their positions, shape (n_q,), in m.
        drive: displacement of the driver since t = 0, in m.
        load: F_N and T, in N; None means those at t = 0.
        enough: accepted error of gap functions, in N.
        contraction: expected factor by which an iteration reduces the error.

    Returns:
        q (m) and forces (N), shape (n_q,), and the last observed contraction; None if the iteration
        does not converge fast.
    """
    space, K, before = modes.space, modes.tangent.K, math.inf
    contraction = 0.0 if space.linear else contraction
    for _ in range(ROUNDS):
        force = space.forces(q, drive, load)
        left = force.copy()
        left[space.held] = 0.0
        if np.abs(left).sum() <= enough:  # contact forces can change by no more than this sum
            return q, force, contraction
        shift = space.answer(left)
        change = K @ shift
        error = float(np.abs(modes.gap_functions.at(shift, -change[space.held])).max())
        q, force = q + shift, force - change
        if math.isfinite(before):
            contraction = error / before if before > 0 else 0.0
        if not contraction <= 1.0:
            return None
        if error * contraction <= enough:
            return q, force, contraction
        before = error
    return None


def path_from(
    modes: Modes,
    outside: Outside,
    q: np.ndarray,
    forces: np.ndarray,
    drift: np.ndarray | None = None,
) -> Path:
    """Return the path from a static state.

    Args:
        modes: modes of the slider at its contact states.
        outside: driver and loads.
        q, forces: the static state (m) and the forces on it (N), shape (n_q,).
        drift: first estimate of dq/d(drive), shape (n_q,); None: that of the factorised tangent.
    """
    space, gap_functions = modes.space, modes.gap_functions
    stiffer, held, zero = space.stiffer(q), space.held, np.zeros_like(q)
    b_1, b_2 = outside.rates()
    steady, plain = outside.steady and not len(space.slips), not any(outside.gain)
    if stiffer is None and steady and plain:
        V, of_drift, of_lag = outside.V, *gap_functions.steady
        begin = gap_functions.whole(q, forces[held])
        gaps = begin + V * of_lag, V * of_drift, np.zeros_like(of_lag)
        lag = np.array([V * space.lag, zero, zero])
        return Path(np.array([q, V * space.drift, zero]), lag, np.array(gaps), stiffer)
    guess = outside.V * (space.drift if drift is None else drift) if plain else space.answer(b_1)
    q_1, left_1, _ = space.refined(guess, b_1, stiffer)
    b_2 = b_2 - space.bends(q, q_1)
    guess = outside.a * space.drift if stiffer is None else space.answer(b_2)
    q_2, left_2, _ = space.refined(guess, b_2, None if steady else stiffer)
    C = space.damping(q)
    l_1 = zero if steady else space.answer(-(C @ q_2))
    drag = -(C @ (q_1 + l_1))
    pull = drag - space.M * q_2
    guess = outside.V * space.lag if steady and plain else space.answer(pull)
    l_0, left_0, _ = space.refined(guess, pull, stiffer)
    bottom = zip((q, q_1, q_2), (forces[held], left_1, left_2), (q_1 + l_1, q_2, zero), strict=True)
    of = gap_functions.whole, gap_functions.at, gap_functions.at
    gaps = np.array([gap(*parts) for gap, parts in zip(of, bottom, strict=True)])
    gaps[0] += gap_functions.at(l_0, left_0 + (drag - pull)[held])
    if not steady:
        left = -(C @ q_2) - space.restoring(l_1, stiffer)
        gaps[1] += gap_functions.at(l_1, left[held])
    return Path(np.array([q, q_1, q_2]), np.array([l_0, l_1, zero]), gaps, stiffer)
