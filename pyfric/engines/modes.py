"""Slow modes of the slider at fixed contact states, at one tangent, in closed form.

In the space B of slow shapes (`space`), with B'M B = 1 and w = B y (Galerkin's method),

    y'' + (B'C B) y' + (B'K B) y = 0 ,    y = Re sum_k a_k x_k exp(lambda_k s) .

Of each conjugate pair, one eigenvector is stored, multiplied by two. At the end of a jump, the
static response to the residual of a mode is subtracted. The corrected shape is, with phi = B x,
phi - K^-1 (K + lambda C + lambda^2 M) phi. Rayleigh's functional of this shape corrects lambda.

A time step multiplies a mode by R(z), z = lambda dt (`Stepper.growth`). It leaves the quasi-static
path unchanged. The ring-down of a run with steps dt therefore has the rates log(R)/dt.

In finite geometry the tangent changes by delta K. The rates change with it, to first order by
delta lambda = -phi.delta K phi/(phi.C phi + 2 lambda phi.M phi).

Source: B. N. Parlett, The Symmetric Eigenvalue Problem (1998), Rayleigh-Ritz method.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import STEPPERS
from pyfric.engines.gaps import GapFunctions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.engines.space import Space, Tangent


def applied(operator: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """Return a real linear operator, applied to complex vectors, shape (n, m)."""
    real, imag = np.hsplit(operator(np.hstack([x.real, x.imag])), 2)
    return real + 1j * imag


def stepped(rates: np.ndarray, dt: float | None, stepper: str) -> np.ndarray:
    """Return the rates of amplitudes in time steps dt (s), from exact rates, both in 1/s.

    dt = None returns the exact rates.
    """
    if dt is None:
        return rates
    z = rates * dt
    growth = np.log(STEPPERS[stepper].growth(z)) / dt
    growth.real = np.minimum(growth.real, 0.0)
    return growth


class Motion(NamedTuple):
    """A deviation from the quasi-static path, split into modes and a truncated part.

    Attributes:
        a: amplitudes of the damped modes, shape (n,), complex.
        energy: energy of the truncated part, in J.
        gaps: present change of the gap functions by the truncated part, shape (n_c,), in N.
        decay: present decay rate of the amplitude of the truncated part, in 1/s.
        driven: largest amplitudes by which the truncated part drives the modes, shape (n,).
    """

    a: np.ndarray
    energy: float
    gaps: np.ndarray
    decay: float
    driven: np.ndarray


class Corrected(NamedTuple):
    """A mode corrected by the static response to its residual.

    Attributes:
        shift: correction of the shape, shape (n_q,), complex, in m.
        rate: corrected rate, in 1/s.
        off: remaining error of the rate, in 1/s.
    """

    shift: np.ndarray
    rate: complex
    off: float


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenpairs of the reduced system at one tangent. Arrays are read-only.

    Attributes:
        gap_functions: gap functions of the contact states.
        tangent: tangent about which the slider is linearised.
        dt: time step that the ring-down follows, in s; None means exact time.
        stepper: the stepper that makes these steps.
        rates: eigenvalues of the damped modes, one of each conjugate pair, shape (n,), in 1/s, in
            order of decay, slowest first.
        growth: rates of the amplitudes in time steps, shape (n,), in 1/s.
        x: eigenvectors in the space, shape (r, n), complex.
        norm: phi.C phi + 2 lambda phi.M phi of eigenvectors not doubled, shape (n,), in N s/m.
        pulled: left eigenvectors, not doubled, over `norm`, shape (r, n).
        grows: largest growth rate among the modes, 0 if none grows, in 1/s.
        damping: B'C B, shape (r, r), in 1/s.
        compliance: inverse of B'K B, shape (r, r), in s^2.
        gaps: gap functions of modes of amplitude 1, shape (n_c, n), complex, in N.
        u_h: mean u_x of the driven blocks in these modes, shape (n,), complex, in m.
        fade: expected decay rate of the truncated part, in 1/s.
        off: largest errors of the rates, shape (n,), in 1/s.
    """

    gap_functions: GapFunctions
    tangent: Tangent
    dt: float | None
    stepper: str
    rates: np.ndarray
    growth: np.ndarray
    x: np.ndarray
    norm: np.ndarray
    pulled: np.ndarray
    grows: float
    damping: np.ndarray
    compliance: np.ndarray
    gaps: np.ndarray
    u_h: np.ndarray
    fade: float
    off: np.ndarray
    _corrections: dict[int, Corrected] = dataclasses.field(default_factory=dict)
    _works: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def space(self) -> Space:
        """The slider at these contact states."""
        return self.gap_functions.space

    def at(self, q: np.ndarray) -> Modes:
        """Return the modes in the same space, at the tangent of a state q (m), shape (n_q,)."""
        return modes_at(self.gap_functions, self.space.tangent_at(q), self.dt, self.stepper)

    def stepped(self, rates: np.ndarray) -> np.ndarray:
        """Return the rates of amplitudes in time steps, from exact rates, both in 1/s."""
        return stepped(rates, self.dt, self.stepper)

    # --- corrections -----------------------------------------------------------------------------

    def corrected(self, which: np.ndarray) -> list[Corrected]:
        """Return the corrected modes with these indices.

        With Q(lambda) = K + lambda C + lambda^2 M and a shape phi, Rayleigh's functional gives the
        error of a rate, delta lambda = phi.Q phi/(phi.C phi + 2 lambda phi.M phi). `off` is the
        error after the correction. The share of `off` in delta lambda is the sum of two parts, at
        most 1. One part is the square of the factor by which the correction reduces the residual.
        The other is |delta lambda/lambda|, because the functional is of first order in it. With
        slip, K is unsymmetric. The left eigenvector, which is not corrected, then replaces phi on
        the left, and the first part is the factor instead of its square.
        """
        numbers = which.tolist()
        new = [k for k in numbers if k not in self._corrections]
        if new:
            psi = self.pulled[:, new] * self.norm[new]
            found = self._correct(self.x[:, new], psi, self.rates[new], self.norm[new])
            self._corrections.update(zip(new, found, strict=True))
        return [self._corrections[k] for k in numbers]

    def _correct(
        self, x: np.ndarray, psi: np.ndarray, rates: np.ndarray, norm: np.ndarray
    ) -> Iterator[Corrected]:
        """Return corrected modes, from right and left eigenvectors, rates and norms."""
        phi = applied(self.space.B.dot, x)
        left = self._residual(phi, rates)
        shift = -applied(self.space.answer, left)
        change = self._residual(shift, rates)
        twice = np.where(rates.imag > 0, 2.0, 1.0)  # the real part of one mode of a pair
        before, after = (np.linalg.norm(f[self.space.free], axis=0) for f in (left, left + change))
        ratio = np.divide(after, before, out=np.ones_like(after), where=before > 0)
        if len(self.space.slips):
            wrong = np.sum((self.space.B @ psi) * change, axis=0) / (norm * twice)
        else:
            wrong = np.sum(shift * (2 * left + change), axis=0) / (norm * twice**2)
            ratio = ratio**2
        kept = np.minimum(ratio + np.abs(wrong / rates), 1.0)
        rates = rates - (1 - kept) * wrong
        rates.real = np.minimum(rates.real, 0.0)
        shifts = np.ascontiguousarray(shift.T)
        shifts.flags.writeable = False
        return map(Corrected, shifts, rates.tolist(), (kept * np.abs(wrong)).tolist())

    def _residual(self, phi: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return (K + lambda C + lambda^2 M) phi of shapes phi (n_q, m) with rates (m,) in 1/s."""
        drag = applied(self.tangent.C.dot, phi) + rates * (self.space.M[:, None] * phi)
        return applied(self.tangent.K.dot, phi) + rates * drag

    def changes(self, stiffer: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Return changes of rates, (m,), in 1/s, to first order in changes of bond stiffness.

        Args:
            stiffer: changes from the factorised tangent, shape (3, n_bonds), in N/m.
            which: indices of the modes, shape (m,).
        """
        added = np.ravel(stiffer - self.tangent.stiffer)
        works = [self._work(k) @ added for k in which.tolist()]
        return -np.array([complex(*work) for work in works], dtype=complex)

    def _work(self, k: int) -> np.ndarray:
        """Return derivatives of -rates[k] by bond stiffness, real and imaginary, (2, 3 n_bonds)."""
        if k not in self._works:
            phi = applied(self.space.B.dot, self.pulled[:, [k]] * self.norm[k])[:, 0]
            parts = self.space.solver.elongations(np.column_stack([phi.real, phi.imag]))
            du_x, du_z = (du[:, 0] + 1j * du[:, 1] for du in parts)
            work = np.concatenate([du_x**2, 2 * du_x * du_z, du_z**2]) / self.norm[k]
            self._works[k] = np.array([work.real, work.imag])
        return self._works[k]

    # --- amplitudes and motion -------------------------------------------------------------------

    def amplitudes(self, y: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, shape (n,), from y = (B'M w, B'M v), shape (2, r).

        C and K are symmetric: a_k = x_k.((lambda_k + C) y + y')/(x_k.C x_k + 2 lambda_k x_k.x_k).
        """
        return (self.damping @ y[0] + y[1]) @ self.pulled + self.rates * (y[0] @ self.pulled)

    def excited(self, v: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, (n,), after velocities v (m/s) without displacements."""
        return ((self.space.M * v) @ self.space.B) @ self.pulled

    def pushed(self, force: np.ndarray) -> np.ndarray:
        """Return the amplitudes of modes, (n,), in their static response to a force, (n_q,)."""
        y = self.compliance @ (force @ self.space.B)
        return self.amplitudes(np.array([y, np.zeros_like(y)]))

    def split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        """Split a deviation w (m) with rate v (m/s), shape (n_q,), into modes and truncated part.

        For the truncated part, M w and M v are orthogonal to B. Viscosity couples the truncated
        part to the modes. It adds phi.C w/(phi.C phi + 2 lambda phi.M phi) to the amplitude of a
        mode phi. K w is orthogonal to B, too, unless B contains responses to slip. In this case K w
        drives the modes, at frequencies of `cut` or more.
        """
        space, (K, C, _) = self.space, self.tangent
        y_0, y_1, drawn = np.array([space.M * w, space.M * v, C @ w]) @ space.B
        w, v = np.array([w, v]) - np.array([y_0, y_1]) @ space.B.T
        force, drag, momentum = K @ w, C @ v, space.M * v
        twice_kinetic = float(v @ momentum)
        energy = 0.5 * (twice_kinetic + float(w @ space.elastic(w, force)))
        decay = float(v @ drag) / (2 * twice_kinetic) if twice_kinetic > 0 else 0.0
        gaps = self.gap_functions.at(w, -(force + drag)[space.held], v)
        a = self.amplitudes(np.array([y_0, y_1])) + (drawn - self.damping @ y_0) @ self.pulled
        driven = np.abs((force @ space.B) @ self.pulled) / (space.cut or math.inf)
        return Motion(a, max(energy, 0.0), gaps, max(decay, space.decay), driven)

    def motion_of(self, a: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return w (m), w' (m/s), w'' (m/s^2), shape (3, n_q), of all modes before correction."""
        return (np.array([a, a * rates, a * rates**2]) @ self.x.T).real @ self.space.B.T


def modes_of(space: Space, dt: float | None = None, stepper: str = "rk4") -> Modes:
    """Return the damped modes of the slider at the state at which its stiffness was factorised.

    Args:
        space: the slider at its contact states.
        dt: time step that the ring-down follows, in s; None means exact time.
        stepper: the stepper that makes these steps.
    """
    return modes_at(GapFunctions(space), space.tangent, dt, stepper)


def modes_at(
    gap_functions: GapFunctions, tangent: Tangent, dt: float | None, stepper: str
) -> Modes:
    """Return the modes of a slider that is linearised at a tangent."""
    space = gap_functions.space
    B, held = space.B, space.held
    KB, CB, r = tangent.K @ B, tangent.C @ B, B.shape[1]
    stiffness, damping = B.T @ KB, B.T @ CB
    top = np.hstack([np.zeros((r, r)), np.eye(r)])
    rates, x = np.linalg.eig(np.vstack([top, -np.hstack([stiffness, damping])]))
    one_of_pair = np.flatnonzero(rates.imag >= 0)
    one_of_pair = one_of_pair[np.argsort(-rates[one_of_pair].real, kind="stable")]
    left = x[:r] if not len(space.slips) else np.linalg.inv(x)[:, r:].T
    rates, x, left = rates[one_of_pair], x[:r, one_of_pair], left[:, one_of_pair]
    grows = float(rates.real.max(initial=0.0))
    rates = np.minimum(rates.real, 0.0) + 1j * rates.imag
    norm = np.sum(left * (damping @ x), axis=0) + 2 * rates * np.sum(left * x, axis=0)
    real = x * np.where(rates.imag > 0, 2.0, 1.0)
    f, w = KB[held] @ real + (CB[held] @ real) * rates, B @ real
    return Modes(
        gap_functions=gap_functions,
        tangent=tangent,
        dt=dt,
        stepper=stepper,
        rates=rates,
        growth=stepped(rates, dt, stepper),
        x=real,
        norm=norm,
        pulled=left / norm,
        grows=grows,
        damping=damping,
        compliance=np.linalg.inv(stiffness),
        gaps=gap_functions.of(w, f, w * rates),
        u_h=(space.solver.driven_row @ B) @ real,
        fade=_fade(space, rates),
        off=_off(space, (KB, CB), (stiffness, damping), x, rates) / np.abs(norm),
    )


def _off(
    space: Space,
    forces: tuple[np.ndarray, np.ndarray],
    reduced: tuple[np.ndarray, np.ndarray],
    x: np.ndarray,
    rates: np.ndarray,
) -> np.ndarray:
    """Return r.M^-1 r/cut^2 of the residuals r of modes, shape (n,), in N/m.

    A residual is orthogonal to the space. It excites only motion outside the space, of frequencies
    of `cut` or more. For chains it is 0, because the space contains all motion.

    Args:
        space: the slider.
        forces: K B and C B, shape (n_q, r).
        reduced: B'K B and B'C B, shape (r, r).
        x: eigenvectors, not doubled, shape (r, n).
        rates: rates of the modes, in 1/s, shape (n,).
    """
    if not space.cut:
        return np.zeros(len(rates))
    root = np.sqrt(space.M[space.free])[:, None]
    (K, C), (k, c) = (force[space.free] / root for force in forces), reduced
    parts = K.T @ K - k.T @ k, C.T @ C - c.T @ c, K.T @ C - k.T @ c
    of_K, of_C, mixed = (np.sum(x.conj() * (part @ x), axis=0) for part in parts)
    squares = (of_K + np.abs(rates) ** 2 * of_C + 2 * rates * mixed).real
    return np.maximum(squares, 0.0) / space.cut**2


def _fade(space: Space, rates: np.ndarray) -> float:
    """Return the expected decay rate of motion faster than all modes of a space, in 1/s.

    Viscous damping is proportional to omega^2, with the factor of the least damped mode.
    """
    waves = rates[rates.imag > 0]
    if not len(waves):
        return space.decay
    least = float(np.min(-waves.real / np.abs(waves) ** 2))
    return min(max(least * space.cut**2, space.decay), space.fastest)
