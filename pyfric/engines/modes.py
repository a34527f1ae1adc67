"""The slider at fixed contact states, linearised: slow modes in closed form, a bound for the rest.

While no contact state changes, the deviation w of the slider from its quasi-static path is a damped
linear oscillation. Stuck blocks are held in u_x, and all other coordinates are free:

    M w'' + C w' + K w = 0 .

Slow motion is computed in a space B of few shapes. These are the slowest undamped modes,
K phi = omega^2 M phi, found by shift-invert Lanczos; the static response to the driver; and the
viscous corrections K^-1 C phi of all these shapes. With B'M B = 1 and w = B y (Galerkin's method),

    y'' + (B'C B) y' + (B'K B) y = 0 ,    y = Re sum_k a_k x_k exp(lambda_k s) .

Of each conjugate pair of eigenvectors, one is kept, multiplied by two. At the end of a jump, the
static response to its residual is subtracted: with phi = B x,
phi - K^-1 (K + lambda C + lambda^2 M) phi. Rayleigh's functional of this shape corrects lambda.

The truncated part w - B y has the rest of the energy, E, which cannot grow. By the Cauchy-Schwarz
inequality, E bounds the change of contact forces by the truncated part at any later time. The
truncated part also decays. A mode of frequency omega with at least half of its elastic energy in
bonds has -Re lambda >= eta omega^2/(4 k). The reason is that the viscosity of a bond resists the
whole relative motion, and its spring only one component. Here omega is at least the frequency of
the fastest undamped mode in B. The slower one of two overdamped modes decays at least at the ratio
of elastic to viscous forces, which is k/(6 eta) or more in plane waves.

Contact states are monitored with gap functions in N, which are positive while no state changes.
They are mu_s p + f and mu_s p - f for stuck blocks, and k_f u_z for open blocks.

A step of RK4 multiplies a mode by R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24, z = lambda dt. It leaves
the quasi-static path unchanged. The ring-down of a run with steps dt therefore has the rates
log(R)/dt. Other steppers have another R.

In finite geometry K is the tangent stiffness at one state, first the loaded one. Rates follow the
present tangent to first order, delta lambda = -phi.delta K phi/(phi.C phi + 2 lambda phi.M phi).

Source: B. N. Parlett, The Symmetric Eigenvalue Problem (1998), Lanczos and Rayleigh-Ritz methods.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from pyfric.core import OPEN, STEPPERS, STUCK
from pyfric.engines.woodbury import Released
from pyfric.scene import FRICTIONLESS
from pyfric.statics import EquilibriumError, States, extended, mass

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.statics import StaticSolver

N_MODES = 28
"""Number of undamped modes in the space."""
LANCZOS = 1e-3
"""Relative error of squared frequencies: what the space misses of a mode counts as truncated."""
SLOWEST = 7.0
"""Viscous over elastic forces of overdamped motion, over eta/k: 6 in plane waves. Edges of a
lattice raise it to 6.6."""


def applied(operator: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Return what a real linear operator makes of complex vectors, shape (n, m)."""
    real, imag = np.hsplit(operator(np.hstack([x.real, x.imag])), 2)
    return real + 1j * imag


class Motion(NamedTuple):
    """A deviation from the quasi-static path, split into modes and a truncated part.

    Attributes:
        a: amplitudes of the damped modes, shape (n,), complex.
        energy: energy of the truncated part, in J.
        gaps: present change of the gap functions by the truncated part, shape (n_c,), in N.
        decay: present decay rate of the amplitude of the truncated part, in 1/s.
    """

    a: np.ndarray
    energy: float
    gaps: np.ndarray
    decay: float


class Linearised:
    """The slider linearised with stuck blocks held and all other blocks open.

    Args:
        solver: static states of the scene in its geometry.
        stuck: stuck blocks, shape (N_x,), bool; all others are open.
        dt: step that the ring-down follows, in s; None means exact time.
        near: the slider with more stuck blocks, at the tangent that is factorised, whose space is
            extended; None: a new space.
        stepper: the stepper that makes these steps.
        modes: number of undamped modes in a new space.

    Attributes:
        rates: eigenvalues of the damped modes, one of each conjugate pair, shape (n,), in 1/s.
        growth: rates of the amplitudes, shape (n,), in 1/s: `rates`, changed by the steps.
        gaps: gap functions of modes of amplitude 1, shape (n_c, n), complex, in N.
        u_h: mean u_x of the driven blocks in these modes, shape (n,), complex, in m.
        bound: largest change of the gap functions by a truncated part of 1 J, (n_c,), in N.
        cut: frequency up to which the space contains all undamped modes, in 1/s.
        decay: smallest possible decay rate of the truncated part, in 1/s.
        fade: expected decay rate of the truncated part, in 1/s.
        contraction: last observed factor by which a chord iteration reduces the error.

    Raises:
        EquilibriumError: all blocks are open.
    """

    def __init__(
        self,
        solver: StaticSolver,
        stuck: np.ndarray,
        dt: float | None = None,
        near: Linearised | None = None,
        stepper: str = "rk4",
        modes: int = N_MODES,
    ) -> None:
        scene = solver.scene
        self.solver, self.stuck, self.dt, self.stepper = solver, stuck, dt, stepper
        self.held, self.open, self.law = np.flatnonzero(stuck), np.flatnonzero(~stuck), scene.law
        k_f, mu_s = (np.broadcast_to(a, len(stuck)) for a in (scene.k_f, self.law.hold(1.0)))
        self._of_contact = mu_s[self.held], k_f[self.held], k_f[self.open]
        mode = np.where(stuck, STUCK, OPEN).astype(np.int8)
        self._contact = States(scene, mode, FRICTIONLESS)
        self.K, self.free = solver.tangents(mode), solver.unknown(mode)
        if near is None:
            if not stuck.any():  # singular: rounding would decide whether it can be factorised
                what = "the slider is not supported: all blocks are open"
                raise EquilibriumError(what, np.nan, 0.0, 0)
            self._factor = solver.factor(mode, driven=True)
        else:
            blocks = np.flatnonzero(near.stuck & ~stuck)
            self._factor = Released(near, blocks, self.K, self.free)
        self.M, self.n_q, q = mass(scene), self.K.shape[0], np.zeros(self.K.shape[0])
        self.contraction = float(solver.geometry == "finite")
        if self.contraction:
            q = solver.coordinates(solver.loaded.u, solver.loaded.rod)
            self._bonds = solver.bond_tangents(q)
        self.C = solver.damping(q)
        self.cut = cut = self._find_space(modes) if near is None else self._extend_space(near)
        self._find_modes()
        overdamped = scene.slider.k / (SLOWEST * scene.eta) if scene.eta else np.inf
        self.fastest = min(cut, overdamped)
        self.decay = min(scene.eta * cut**2 / (4 * scene.slider.k), self.fastest)
        self.fade = self._fade(cut)
        self._find_bound()

    def at(self, q: np.ndarray) -> Linearised:
        """Return a copy with the tangent at a state q, and its modes in the same space."""
        found = copy.copy(self)
        found._bonds = self.solver.bond_tangents(q)
        found.K = self.solver.stiffness(found._bonds, self._contact.mode, driven=True)
        found.C = self.solver.damping(q)
        found._find_modes()
        return found

    # --- the space and its modes -----------------------------------------------------------------

    def _find_space(self, modes: int) -> float:
        """Find the shapes B, shape (n_q, r); return the largest frequency among them, in 1/s."""
        free, M, scene = self.free, self.M[self.free], self.solver.scene
        # Stuck blocks of a chain could only move vertically, and nothing excites that motion.
        count = min(modes, len(free) // 2) if scene.N_z > 1 else 0
        if not count:
            self.B = np.zeros((self.n_q, 0))
            return 0.0
        root, driven, n = np.sqrt(M), self.drift[free], len(free)
        squares, basis = np.full(1, np.inf), np.zeros((n, 0))
        with contextlib.suppress(ArpackError):  # without modes, all other motion is truncated
            inverse = LinearOperator((n, n), lambda x: root * self._factor.solve(root * x), float)
            room = 1 + 3 * count // 2  # fewer solutions than with twice the modes
            squares, basis = eigsh(inverse, count, v0=root * driven, tol=LANCZOS, ncv=room)
            basis /= root[:, None]
        viscous = self._viscous(np.column_stack([basis, driven]))
        self._span(basis, np.column_stack([driven, viscous]))
        return 1 / math.sqrt(squares.min())

    def _extend_space(self, near: Linearised) -> float:
        """Extend the space of the slider with more stuck blocks; return its largest frequency.

        Added are the responses to displacements and forces of the released blocks (`Released`),
        and their viscous corrections. Any motion w is a combination of these responses and of a
        motion w_0 without displacements of the released blocks, which is orthogonal to them in K.
        If w is orthogonal in M to the new space, w'M w = w'M w_0 is at most |w| times the part of
        w_0 outside the old modes, whose elastic energy is at most that of w. So no such motion is
        slower than the modes that the old space lacks.
        """
        shapes = self._factor.shapes[self.free]
        self._span(near.B[self.free], np.hstack([shapes, self._viscous(shapes)]))
        return near.cut

    def _viscous(self, shapes: np.ndarray) -> np.ndarray:
        """Return the viscous corrections K^-1 C phi of shapes (n_free, m), none if eta = 0."""
        if not self.solver.scene.eta:
            return shapes[:, :0]
        return self._factor.solve(self.C[self.free][:, self.free] @ shapes)

    def _span(self, basis: np.ndarray, shapes: np.ndarray) -> None:
        """Let B span a basis (n_free, m) and shapes (n_free, k) of the free coordinates."""
        basis = extended(basis, shapes, self.M[self.free])
        rows = np.zeros((basis.shape[1], self.n_q))
        rows[:, self.free] = basis.T
        self.B = rows.T  # columns are contiguous

    def _find_modes(self) -> None:
        """Find the eigenpairs of the reduced system, and their effect on contacts and driver."""
        B, N_x, solver = self.B, len(self.stuck), self.solver
        self._works: dict[int, np.ndarray] = {}
        self._shapes: dict[int, np.ndarray] = {}
        self._K_held = self.K[self.held]
        KB, CB, r = self.K @ B, self.C @ B, B.shape[1]
        BKB, self._CB = B.T @ KB, B.T @ CB
        self._compliances = np.linalg.inv(BKB)
        rates, x = np.linalg.eig(np.block([[np.zeros((r, r)), np.eye(r)], [-BKB, -self._CB]]))
        one_of_pair = rates.imag >= 0
        rates, x = rates[one_of_pair], x[:r, one_of_pair]
        self.rates = np.minimum(rates.real, 0.0) + 1j * rates.imag
        self.growth, self.off = self.stepped(self.rates), np.zeros(len(self.rates))
        self._norm = np.sum(x * (self._CB @ x), axis=0) + 2 * self.rates * np.sum(x * x, axis=0)
        self._pulled = x / self._norm
        self.x = x * np.where(rates.imag > 0, 2.0, 1.0)
        f = KB[self.held] @ self.x + (CB[self.held] @ self.x) * self.rates
        self.gaps = self.gap_functions(B[N_x : 2 * N_x] @ self.x, f)
        self.u_h = (solver.driven_row @ B) @ self.x

    def _fade(self, cut: float) -> float:
        """Return the expected decay rate of motion above a frequency `cut`, in 1/s.

        Viscous damping is proportional to omega^2. The factor is taken from the least damped mode.
        """
        waves = self.rates[self.rates.imag > 0]
        if not len(waves):
            return self.decay
        least = float(np.min(-waves.real / np.abs(waves) ** 2))
        return min(max(least * cut**2, self.decay), self.fastest)

    def _find_bound(self) -> None:
        """Find the largest change of each gap function by a truncated part of 1 J.

        A force K_i w is at most sqrt(2 E K_ii). Bonds between held blocks do not contribute.
        """
        held, free, (mu_s, k_f, lifting) = self.held, self.free, self._of_contact
        C = self.C[held][:, free]
        stiff = mu_s**2 * k_f + self.K[held][:, held].sum(axis=1)
        stiff = stiff + C.multiply(C) @ (1 / self.M[free])
        lifts = ((self.free == i + len(self.stuck)).astype(float) for i in self.open)
        compliance = [float(force @ self._factor.solve(force)) for force in lifts]
        lifted = lifting**2 * np.array(compliance, dtype=float)
        self.bound = np.sqrt(2 * np.concatenate([stiff, stiff, lifted]))

    def stepped(self, rates: np.ndarray) -> np.ndarray:
        """Return the rates of amplitudes that steps give for rates, both in 1/s."""
        if self.dt is None:
            return rates
        z = rates * self.dt
        growth = np.log(STEPPERS[self.stepper].growth(z)) / self.dt
        growth.real = np.minimum(growth.real, 0.0)
        return growth

    def rates_at(self, stiffer: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Return `rates`, corrected for some modes to first order in changes of bond stiffness.

        Args:
            stiffer: changes of bond stiffness, shape (3, n_bonds), in N/m.
            which: indices of the modes, shape (m,).
        """
        rates = self.rates.copy()
        for k in which:
            rates[k] -= complex(*(self._work(int(k)) @ stiffer.ravel()))
        return rates

    def _work(self, k: int) -> np.ndarray:
        """Return derivatives of -rates[k] by stiffnesses of bonds: two parts, (2, 3 n_bonds)."""
        if k not in self._works:
            phi = applied(self.B.dot, self._pulled[:, [k]] * self._norm[k])[:, 0]
            parts = self.solver.elongations(np.column_stack([phi.real, phi.imag]))
            du_x, du_z = (du[:, 0] + 1j * du[:, 1] for du in parts)
            work = np.concatenate([du_x**2, 2 * du_x * du_z, du_z**2]) / self._norm[k]
            self._works[k] = np.array([work.real, work.imag])
        return self._works[k]

    def moved(self, blocks: np.ndarray) -> np.ndarray:
        """Return the static responses, (n_q, n), to unit displacements of n stuck blocks."""
        q = np.zeros((self.n_q, len(blocks)))
        q[blocks, np.arange(len(blocks))] = 1.0
        return q + self.answer(-(self.K @ q))

    # --- statics ---------------------------------------------------------------------------------

    @functools.cached_property
    def drift(self) -> np.ndarray:
        """Derivative dq/d(drive) of the static state, shape (n_q,)."""
        return self.answer(self.solver.push)

    @functools.cached_property
    def latest_drift(self) -> np.ndarray:
        """`drift` at the end of the last jump, where the next path begins, shape (n_q,)."""
        return self.drift

    @functools.cached_property
    def lag(self) -> np.ndarray:
        """Lag of the slider behind its static state per speed of the driver, (n_q,), in s."""
        return self.answer(-(self.C @ self.drift))

    @functools.cached_property
    def steady_gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Gap functions of `drift` (N/m) and `lag` (N s/m) at a steady speed, shape (n_c,)."""
        pull = self.solver.push, -(self.C @ self.drift)
        return tuple(
            self.gaps_of(x, force[self.held] - self._K_held @ x)
            for x, force in zip((self.drift, self.lag), pull, strict=True)
        )

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
        if solver.geometry == "finite":
            return solver.forces(q, self._contact, drive)[0]
        return solver.load + solver.unpushed + drive * solver.push - self.K @ q

    def answer(self, force: np.ndarray) -> np.ndarray:
        """Return the static displacements under forces on all coordinates, shape (n_q,)."""
        found = np.zeros(force.shape)
        found[self.free] = self._factor.solve(force[self.free])
        return found

    def stiffer(self, q: np.ndarray) -> np.ndarray | None:
        """Return the change of bond stiffness to a state q, (3, n_bonds), in N/m.

        None in linear geometry.
        """
        if self.solver.geometry == "linear":
            return None
        return self.solver.bond_tangents(q) - self._bonds

    def refined(
        self, x: np.ndarray, force: np.ndarray, stiffer: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the response to a force, and the force that it leaves on stuck blocks.

        Args:
            x: response without changes of bond stiffness, which are corrected once, (n_q,), in m.
            force: shape (n_q,), in N.
            stiffer: changes of bond stiffness, shape (3, n_bonds), in N/m; None means none.

        Returns:
            The response, shape (n_q,), in m; the force, shape (n_stuck,), in N. What the correction
            does to the changed stiffness is of second order, and left out.
        """
        if stiffer is None:
            return x, force[self.held] - self._K_held @ x
        left = force - self.restoring(x, stiffer)
        shift = self.answer(left)
        return x + shift, left[self.held] - self._K_held @ shift

    def restoring(self, x: np.ndarray, stiffer: np.ndarray | None) -> np.ndarray:
        """Return K x, shape (n_q,), with changes of bond stiffness included."""
        return self.K @ x if stiffer is None else self.K @ x + self.solver.stiffened(x, stiffer)

    # --- gap functions and motion ----------------------------------------------------------------

    def gap_functions(self, u_z: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return gap functions, or changes of them, because they are linear; (n_c, ...), in N.

        Args:
            u_z: displacements of the bottom blocks, shape (N_x, ...), in m.
            f: friction force on the blocks that stick, shape (n_stuck, ...), in N.
        """
        mu_s, k_f, lifting = self._of_contact
        strength = (mu_s * (-k_f * u_z[self.held].T)).T
        lifted = (lifting * u_z[self.open].T).T
        return np.concatenate([strength + f, strength - f, lifted])

    def gaps_of(self, q: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the gap functions at q, (n_q,), with forces on the stuck blocks, (n_stuck,)."""
        N_x = len(self.stuck)
        return self.gap_functions(q[N_x : 2 * N_x], -forces)

    def strengthened(self, age: np.ndarray, *rows: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return gap functions, or parts of them, of blocks that have been stuck for `age`.

        Strength only grows with contact time, so that the present strength bounds the later one
        from below. The two gap functions of a block are mu_s p +- f; their sum gives p.

        Args:
            age: time since each block stuck, shape (N_x,), in s.
            rows: gap functions at age 0, shape (n_c, ...).
        """
        if self.law.tables.hold is None:
            return rows
        n, law = len(self.held), self.law.at(self.stuck)
        young = np.broadcast_to(law.hold(1.0), n)
        gain = law.hold(1.0, age[self.stuck]) - young
        share, found = np.divide(gain, 2 * young, out=np.zeros(n), where=young > 0), []
        for row in rows:
            more = (share * (row[:n] + row[n : 2 * n]).T).T
            found.append(np.concatenate([row[:n] + more, row[n : 2 * n] + more, row[2 * n :]]))
        return tuple(found)

    def amplitudes(self, y: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, shape (n,), from y, (2, r), which is B'M w and B'M v.

        C and K are symmetric: a_k = x_k.((lambda_k + C) y + y')/(x_k.C x_k + 2 lambda_k x_k.x_k).
        """
        return (self._CB @ y[0] + y[1]) @ self._pulled + self.rates * (y[0] @ self._pulled)

    def excited(self, v: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, (n,), in velocities v (m/s) without displacements."""
        return ((self.M * v) @ self.B) @ self._pulled

    def pushed(self, force: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, (n,), in their static response to a force, (n_q,)."""
        y = self._compliances @ (force @ self.B)
        return self.amplitudes(np.array([y, np.zeros_like(y)]))

    def split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        """Split a deviation w (m) with rate v (m/s), shape (n_q,), into modes and truncated part.

        For the truncated part, M w, M v and K w are orthogonal to B, but viscosity couples it to
        the modes. It adds phi.C w/(phi.C phi + 2 lambda phi.M phi) to the amplitude of a mode phi.
        """
        y_0, y_1, drawn = np.array([self.M * w, self.M * v, self.C @ w]) @ self.B
        w, v = np.array([w, v]) - np.array([y_0, y_1]) @ self.B.T
        force, drag, momentum = self.K @ w, self.C @ v, self.M * v
        twice_kinetic = float(v @ momentum)
        energy = 0.5 * (twice_kinetic + float(w @ force))
        decay = float(v @ drag) / (2 * twice_kinetic) if twice_kinetic > 0 else 0.0
        gaps = self.gaps_of(w, -(force + drag)[self.held])
        a = self.amplitudes(np.array([y_0, y_1])) + (drawn - self._CB @ y_0) @ self._pulled
        return Motion(a, max(energy, 0.0), gaps, max(decay, self.decay))

    def deviation(
        self, a: np.ndarray, rates: np.ndarray, which: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return w (m), w' (m/s) and w'' (m/s^2), shape (n_q,), of corrected modes.

        Args:
            a, rates: amplitudes and rates (1/s) of all modes, shape (n,).
            which: indices of the modes that count, shape (m,), see `correct`.
        """
        shapes = np.zeros((len(which), self.n_q), dtype=complex)
        for i, k in enumerate(which.tolist()):
            shapes[i] = self._shapes[k]
        return tuple((np.array([a, a * rates, a * rates**2])[:, which] @ shapes).real)

    def motion_of(self, a: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return w (m), w' (m/s) and w'' (m/s^2), shape (3, n_q), of all modes, not corrected."""
        return (np.array([a, a * rates, a * rates**2]) @ self.x.T).real @ self.B.T

    def correct(self, which: np.ndarray) -> None:
        """Correct shapes of modes by the static responses to their residuals, and their rates.

        With Q(lambda) = K + lambda C + lambda^2 M and a shape phi, Rayleigh's functional gives the
        error of a rate, delta lambda = phi.Q phi/(phi.C phi + 2 lambda phi.M phi). A further
        correction would divide it by the square of the factor by which this one reduces the
        residual; and the functional is of first order in delta lambda/lambda. The sum of both is
        the share of the error that is left, at most 1, and `off` what is left.

        Args:
            which: indices of the modes, shape (m,).
        """
        modes = [k for k in which.tolist() if k not in self._shapes]
        if modes:
            phi, rates = applied(self.B.dot, self.x[:, modes]), self.rates[modes]
            left = self._residual(phi, rates)
            shift = -applied(self.answer, left)
            change = self._residual(shift, rates)
            twice = np.where(rates.imag > 0, 2.0, 1.0)  # the real part of one mode of a pair
            wrong = np.sum(shift * (2 * left + change), axis=0) / (self._norm[modes] * twice**2)
            before, after = (np.linalg.norm(f[self.free], axis=0) for f in (left, left + change))
            ratio = np.divide(after, before, out=np.ones_like(after), where=before > 0)
            kept = np.minimum(ratio**2 + np.abs(wrong / rates), 1.0)
            rates = rates - (1 - kept) * wrong
            self.rates[modes] = np.minimum(rates.real, 0.0) + 1j * rates.imag
            self.growth[modes] = self.stepped(self.rates[modes])
            self.off[modes] = kept * np.abs(wrong)
            self._shapes.update(zip(modes, (phi + shift).T, strict=True))

    def _residual(self, phi: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return (K + lambda C + lambda^2 M) phi of shapes phi (n_q, m) with rates (m,) in 1/s."""
        drag = applied(self.C.dot, phi) + rates * (self.M[:, None] * phi)
        return applied(self.K.dot, phi) + rates * drag
