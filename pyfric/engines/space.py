"""The slider at fixed contact states: held and free coordinates, static solutions, slow shapes.

While no contact state changes, the deviation w of the slider from its quasi-static path is a damped
linear oscillation. Stuck blocks are held in u_x, and all other coordinates are free:

    M w'' + C w' + K w = 0 .

Slow motion is computed in a space B of few shapes. These are the slowest undamped modes,
K phi = omega^2 M phi, found by shift-invert block Lanczos; the static response to the driver; and
the viscous corrections K^-1 C phi of all these shapes.

The truncated part of the motion, outside B, decays. A mode of frequency omega with at least half of
its elastic energy in bonds decays at the rate eta omega^2/(4 k) or faster. The reason is that the
viscosity of a bond resists the whole relative motion, and its spring only one component. In the
truncated part, omega is at least the frequency of the fastest undamped mode in B. Overdamped modes
come in pairs. The slower mode of a pair decays at least at the ratio of elastic to viscous forces,
which is k/(6 eta) or more in plane waves.

In finite geometry K is factorised at the loaded state. Solutions at other tangents are corrected
for the change of bond stiffness.

Source: B. N. Parlett, The Symmetric Eigenvalue Problem (1998), Lanczos and Rayleigh-Ritz methods.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN, STUCK
from pyfric.scene import FRICTIONLESS
from pyfric.statics import BARE, EquilibriumError, Memory, States, ends, extended, mass

if TYPE_CHECKING:
    from collections.abc import Callable

    import scipy.sparse as sp

    from pyfric.statics import StaticSolver

N_MODES = 28
"""Number of undamped modes in a new space."""
BLOCK, APPLIED = 16, 6
"""Number of vectors in a block of block Lanczos, and number of applications of the operator to a
block. They leave an error of 4e-4 in the squared frequency of the fastest mode. Both
are policies."""
FEW, KEPT = 4, 32
"""Largest number of slipped blocks for which a static state is found from stored responses, and
number of stored responses. Events of few blocks recur at the same blocks. Both are policies."""
SLOWEST = 7.0
"""Largest ratio of viscous to elastic forces in overdamped motion, in units of eta/k. It is 6 in
plane waves; edges of a lattice raise it to 6.6."""


def ends_of_spectrum(
    apply: Callable[[np.ndarray], np.ndarray], start: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues of a symmetric operator, shape (m,), ascending, and vectors, (n, m).

    The eigenvalues are Ritz values of block Lanczos with `APPLIED` applications of the operator.
    The smallest and the largest have converged.

    Args:
        apply: the operator, on vectors of shape (n, k).
        start: a vector that the first block contains, shape (n,).
        count: number of largest eigenvalues needed, at most n/2.
    """
    n = len(start)
    first = np.random.default_rng(0).standard_normal((n, min(BLOCK, n)))
    first[:, 0] = start / np.linalg.norm(start) * math.sqrt(n)
    block, basis, images = np.linalg.qr(apply(first))[0], [], []
    for _ in range(max(APPLIED, math.ceil(count / BLOCK)) if n > BLOCK else 1):
        basis.append(block)
        images.append(apply(block))
        if sum(part.shape[1] for part in basis) + BLOCK > n:
            break
        block = images[-1]
        for _ in range(2):  # two passes are enough
            for part in basis:
                block = block - part @ (part.T @ block)
        block = np.linalg.qr(block)[0]
    whole = np.hstack(basis)
    squares, vectors = np.linalg.eigh(whole.T @ np.hstack(images))
    return squares, whole @ vectors


class Tangent(NamedTuple):
    """The linearised forces at one state.

    Attributes:
        K, C: stiffness (N/m) and viscosity (N s/m), shape (n_q, n_q).
        stiffer: change of bond stiffness since the factorised tangent, (3, n_bonds), in N/m.
    """

    K: sp.csr_array
    C: sp.csr_array
    stiffer: np.ndarray | float = 0.0


class Space:
    """Static solutions and slow shapes with stuck blocks held and all other blocks open.

    Blocks without friction are in contact if they touch the foundation in the loaded state.

    Args:
        solver: static states of the scene in its geometry.
        stuck: stuck blocks, shape (N_x,), bool; all others are open.
        near: a space with more stuck blocks, to extend; None: a new space.
        modes: number of undamped modes in a new space.

    Attributes:
        held, open: indices of stuck and of open blocks.
        free: indices of the coordinates that are not held, shape (n_free,).
        K, C: stiffness (N/m) and viscosity (N s/m) at the factorised tangent, shape (n_q, n_q).
        M: masses, shape (n_q,), in kg.
        B: shapes, with B'M B = 1, shape (n_q, r).
        cut: frequency up to which the space contains all undamped modes, in 1/s.
        fastest: upper limit for the expected decay rate of the truncated part, in 1/s.
        decay: smallest possible decay rate of the truncated part, in 1/s.
        slips: indices of slipping blocks; empty here, see `pyfric.engines.slipping`.

    Raises:
        EquilibriumError: all blocks are open, or the static state is unstable.
    """

    slips = np.zeros(0, dtype=int)

    def __init__(
        self,
        solver: StaticSolver,
        stuck: np.ndarray,
        near: Space | None = None,
        modes: int = N_MODES,
    ) -> None:
        scene = solver.scene
        self.solver, self.stuck = solver, stuck
        self.held, self.open = np.flatnonzero(stuck), np.flatnonzero(~stuck)
        mode = np.where(stuck, STUCK, np.where(solver.pressed, BARE, OPEN)).astype(np.int8)
        self.contact = States(scene, mode, FRICTIONLESS)
        self.K, self.free = solver.tangents(mode), solver.unknown(mode)
        self._K_held, self._by_gap = self.K[self.held], np.zeros(self.K.shape[0])
        self._grounded = solver.grounded(mode, driven=True)
        self._by_gap[ends(scene.N_x).u_z] = -scene.k_f * scene.gap * self.contact.closed
        if near is None:
            if not stuck.any():  # singular: rounding would decide whether it can be factorised
                what = "the slider is not supported: all blocks are open"
                raise EquilibriumError(what, np.nan, 0.0, 0)
            self._factor = solver.factor(mode, driven=True)
        else:
            blocks = np.flatnonzero(near.stuck & ~stuck)
            self._factor = Released(near, blocks, self.K, self.free)
        self.M, self.n_q, q = mass(scene), self.K.shape[0], np.zeros(self.K.shape[0])
        if solver.geometry == "finite":
            q = solver.coordinates(solver.loaded.u, solver.loaded.rod)
            self._bonds = solver.bond_tangents(q)
        self.C = solver.damping(q)
        self.cut = cut = self._find(modes) if near is None else self._extend(near)
        overdamped = scene.slider.k / (SLOWEST * scene.eta) if scene.eta else np.inf
        self.fastest = min(cut, overdamped)
        self.decay = min(scene.eta * cut**2 / (4 * scene.slider.k), self.fastest)
        self._moved: Memory[np.ndarray] = Memory(KEPT)

    # --- shapes ----------------------------------------------------------------------------------

    def _find(self, modes: int) -> float:
        """Set B to a new space; return the largest frequency of its undamped modes, in 1/s."""
        free, M, scene = self.free, self.M[self.free], self.solver.scene
        # Stuck blocks of a chain could only move vertically, and nothing excites that motion.
        count = min(modes, len(free) // 2) if scene.N_z > 1 else 0
        if not count:
            self.B = np.zeros((self.n_q, 0))
            return 0.0
        root, driven = np.sqrt(M), self.drift[free]
        squares, basis = ends_of_spectrum(
            lambda x: root[:, None] * self._factor.solve(root[:, None] * x), root * driven, count
        )
        if squares[0] <= 0:
            what = "the static state is unstable: too few blocks hold a slider that is compressed"
            raise EquilibriumError(what, np.nan, 0.0, 0)
        squares, basis = squares[-count:], basis[:, -count:] / root[:, None]
        viscous = self._viscous(np.column_stack([basis, driven]))
        self._span(basis, np.column_stack([driven, viscous]))
        return 1 / math.sqrt(squares[0])

    def _extend(self, near: Space) -> float:
        """Set B to an extension of `near`; return the largest frequency of `near`, in 1/s.

        The extension consists of responses to displacements and forces of the released blocks
        (`Released`), and of their viscous corrections. Any motion w is a combination of these
        responses and of a motion w_0 with the released blocks held. The two parts are orthogonal in
        K. If w is orthogonal in M to the new space, w'M w = w'M w_0 is at most |w| times the norm
        of the part of w_0 outside the old modes. The elastic energy of this part is at most the
        elastic energy of w. So no such w is slower than the modes that the old space lacks.
        """
        shapes = self._factor.shapes[self.free]
        self._span(near.B[self.free], np.hstack([shapes, self._viscous(shapes)]))
        return near.cut

    def _viscous(self, shapes: np.ndarray) -> np.ndarray:
        """Return the viscous corrections K^-1 C phi of shapes (n_free, m); none if eta = 0."""
        if not self.solver.scene.eta:
            return shapes[:, :0]
        return self._factor.solve(self.C[self.free][:, self.free] @ shapes)

    def _span(self, basis: np.ndarray, shapes: np.ndarray) -> None:
        """Set B to a basis of the space of `basis` (n_free, m) and `shapes` (n_free, k)."""
        basis = extended(basis, shapes, self.M[self.free])
        rows = np.zeros((basis.shape[1], self.n_q))
        rows[:, self.free] = basis.T
        self.B = rows.T  # columns are contiguous

    # --- static solutions ------------------------------------------------------------------------

    def answer(self, force: np.ndarray) -> np.ndarray:
        """Return the static displacements under forces on all coordinates, shape (n_q,)."""
        found = np.zeros(force.shape)
        found[self.free] = self._factor.solve(force[self.free])
        return found

    def moved(self, blocks: np.ndarray) -> np.ndarray:
        """Return the static responses, (n_q, n), to unit displacements of n stuck blocks."""
        q = np.zeros((self.n_q, len(blocks)))
        q[blocks, np.arange(len(blocks))] = 1.0
        return q + self.answer(-(self.K @ q))

    def carried(self, q: np.ndarray, u_x: np.ndarray, drive: float) -> np.ndarray | None:
        """Return the static state after a slip of few stuck blocks and a motion of the driver.

        If more than `FEW` blocks have slipped, return None. In finite geometry the state has an
        error of second order.

        Args:
            q: the static state before, shape (n_q,), in m.
            u_x: positions of the stuck blocks afterwards, shape (n_stuck,), in m.
            drive: motion of the driver, in m.
        """
        slip = u_x - q[self.held]
        blocks = self.held[slip != 0].tolist()
        if len(blocks) > FEW:
            return None
        shapes = {block: self._moved[block] for block in blocks if block in self._moved}
        new = [block for block in blocks if block not in shapes]
        if new:
            shapes |= zip(new, np.ascontiguousarray(self.moved(np.array(new)).T), strict=True)
        q = q + drive * self.drift
        for block, shape in shapes.items():
            q += slip[np.searchsorted(self.held, block)] * shape
            self._moved.made(block, lambda shape=shape: shape)
        return q

    @functools.cached_property
    def drift(self) -> np.ndarray:
        """Derivative dq/d(drive) of the static state, shape (n_q,)."""
        return self.answer(self.solver.push)

    @functools.cached_property
    def lag(self) -> np.ndarray:
        """Lag of the slider behind its static state over the driver's speed, (n_q,), in s."""
        return self.answer(-(self.C @ self.drift))

    def damping(self, q: np.ndarray) -> sp.csr_array:
        """Return the damping matrix at q, shape (n_q, n_q), in N s/m."""
        return self.solver.damping(q)

    def bends(self, q: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return second derivatives of resisting forces along q + s rate at s = 0, shape (n_q,)."""
        return self.solver.bends(q, rate)

    def elastic(self, w: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return a resisting force K w (N) without its friction, shape (n_q,)."""
        return force

    def forces(
        self, q: np.ndarray, drive: float, load: tuple[float, float] | None = None
    ) -> np.ndarray:
        """Return the forces on the coordinates, without friction, shape (n_q,), in N.

        Args:
            q: coordinates, shape (n_q,), in m.
            drive: displacement of the driver since t = 0, in m.
            load: F_N and T, in N; None means those at t = 0.
        """
        solver = self.solver.under(load)
        force = solver.load + solver.unpushed + drive * solver.push + self._by_gap
        if solver.geometry == "linear":
            return force - self.K @ q
        return force - self._grounded * q + solver.of_springs(q)

    def on_held(self, x: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return force - K x on stuck blocks, for a force (N) and displacements x, (n_q,) each."""
        return force[self.held] - self._K_held @ x

    # --- other tangents --------------------------------------------------------------------------

    @property
    def tangent(self) -> Tangent:
        """The factorised tangent."""
        return Tangent(self.K, self.C)

    def tangent_at(self, q: np.ndarray) -> Tangent:
        """Return the tangent at coordinates q (m), shape (n_q,), in finite geometry."""
        bonds = self.solver.bond_tangents(q)
        K = self.solver.stiffness(bonds, self.contact.mode, driven=True)
        return Tangent(K, self.solver.damping(q), bonds - self._bonds)

    @property
    def linear(self) -> bool:
        """Whether forces are linear in the coordinates."""
        return self.solver.geometry == "linear"

    def stiffer(self, q: np.ndarray) -> np.ndarray | None:
        """Return the change of bond stiffness from the factorised tangent to q, (3, n_bonds), N/m.

        In linear geometry, return None.
        """
        if self.solver.geometry == "linear":
            return None
        return self.solver.bond_tangents(q) - self._bonds

    def restoring(self, x: np.ndarray, stiffer: np.ndarray | None) -> np.ndarray:
        """Return K x, shape (n_q,), with changes of bond stiffness included."""
        return self.K @ x if stiffer is None else self.K @ x + self.solver.stiffened(x, stiffer)

    def refined(
        self, x: np.ndarray, force: np.ndarray, stiffer: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the response to a force, corrected once for changes of bond stiffness.

        Args:
            x: response without changes of bond stiffness, shape (n_q,), in m.
            force: shape (n_q,), in N.
            stiffer: changes of bond stiffness, shape (3, n_bonds), in N/m; None means none.

        Returns:
            The response, shape (n_q,), in m; the force that it leaves on stuck blocks, shape
            (n_stuck,), in N; and the correction, shape (n_q,), in m. Terms of second order in the
            correction are left out.
        """
        if stiffer is None:
            return x, self.on_held(x, force), np.zeros_like(x)
        left = force - self.restoring(x, stiffer)
        shift = self.answer(left)
        return x + shift, self.on_held(shift, left), shift


class Released:
    """Static solutions after some blocks were released, from solutions with these blocks stuck.

    A solution is the solution with these blocks stuck, plus a combination of responses: to
    displacements u_x of the released blocks, and to forces on their u_z (Woodbury's formula).
    No new factorisation is needed.

    Args:
        near: the space with these blocks stuck.
        blocks: the released blocks, shape (m,).
        K: stiffness afterwards, shape (n_q, n_q), in N/m.
        free: free coordinates afterwards, shape (n,).

    Attributes:
        shapes: the responses, shape (n_q, 2 m).
    """

    def __init__(self, near: Space, blocks: np.ndarray, K: sp.csr_array, free: np.ndarray) -> None:
        self.near, self.free, lifted = near, free, len(near.stuck) + blocks
        force = np.zeros((near.n_q, len(blocks)))
        force[lifted, np.arange(len(blocks))] = 1.0
        self.shapes = shapes = np.hstack([near.moved(blocks), near.answer(force)])
        self._at = np.concatenate([blocks, lifted])
        self._K = K[self._at]
        self._responses = shapes @ np.linalg.inv(shapes.T @ (K @ shapes))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return x with K x = b for the free coordinates, shape (n,) or (n, columns)."""
        force = np.zeros((self.near.n_q, *b.shape[1:]))
        force[self.free] = b
        x = self.near.answer(force)
        left = force[self._at] - self._K @ x
        return (x + self._responses @ (self.shapes[self._at].T @ left))[self.free]


def loaded_space(solver: StaticSolver) -> Space:
    """Return the space of the loaded slider, which the solver stores."""
    if "space" not in solver.kept:
        stuck = ~(solver.loaded.open | solver.scene.bare)
        solver.kept["space"] = Space(solver, stuck)
    return solver.kept["space"]
