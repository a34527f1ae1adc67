"""The slider linearised about a state: condensed onto its interface, and its waves.

Let K, C, M be stiffness, viscosity and masses of the slider, q its coordinates, and u those of the
blocks in contact. If u changes slowly, the other coordinates w follow their static state,
(K q)_w = b_w, and lag behind it by viscosity:

    q = G u + s K_ww^-1 b' + l ,   K_ww l = -(C q')_w .

This motion loads the interface (`Linearised.interface`). Any other motion is a wave, a free motion
of the slider with its interface held. Waves decay by viscosity. The load f of a wave multiplies the
speed of a block by exp(f/(a p)). It thereby changes the slip of the block until the wave has
decayed (`Waves.effect`).
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN, STUCK
from pyfric.scene import FRICTIONLESS
from pyfric.statics import States, Values, ends, mass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyfric.engines.path import Outside
    from pyfric.scene import RateStateLaw
    from pyfric.statics import StaticSolver

COLUMNS = 64
"""Largest number of right-hand sides in one solution. It limits the memory."""
LARGE = 500.0
"""Argument above which ln(I_0(x)) is taken as x, so that I_0 does not overflow."""


def after(
    part: tuple[np.ndarray, np.ndarray], s: float | np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """Return a part of an `Interface` at s (s) after displacements (m), shape (N_x,).

    For n times s, displacements have the shape (n, N_x), and the result has n rows.
    """
    return _over(part, (1.0, s, s * s / 2), moved)


def _over(
    part: tuple[np.ndarray, np.ndarray], powers: tuple[float | np.ndarray, ...], moved: np.ndarray
) -> np.ndarray:
    powers = np.stack(np.broadcast_arrays(*powers), axis=-1)
    return (part[0] @ powers[..., None] + part[1] @ moved[..., None])[..., 0]


class Interface(NamedTuple):
    """The condensed slider about a state, as a function of time and of slip since this state.

    Attributes:
        load: load on each block along +x, in N: its value, first and second derivative by time with
            blocks in contact held, shape (N_x, 3); and its derivatives by displacements of blocks,
            shape (N_x, N_x).
        p: normal force with the derivatives of `load`; for an open block -k_f u_z, which is
            negative.
        F_T: force of the driver with these derivatives, shapes (3,) and (N_x,).
        u: u_x of all blocks with these derivatives, in m; open blocks move with blocks in contact.
    """

    load: tuple[np.ndarray, np.ndarray]
    p: tuple[np.ndarray, np.ndarray]
    F_T: tuple[np.ndarray, np.ndarray]
    u: tuple[np.ndarray, np.ndarray]

    def at(self, s: float, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Return loads, normal forces and F_T (N) at s (s) after displacements (m)."""
        load, p, F_T = (after(part, s, moved) for part in self[:3])
        return load, p, float(F_T)

    def moving(
        self, s: float | np.ndarray, moved: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return u_x (m) and v_x (m/s) of all blocks, from values of the blocks in contact.

        Shapes are as in `after`.
        """
        return after(self.u, s, moved), _over(self.u, (0.0, 1.0, s), v)


class Waves(NamedTuple):
    """Waves in the slider, and their loads on the interface.

    Attributes:
        rest: the interface in the static state without waves.
        amplitude: amplitude of the load on each block, shape (N_x,), in N.
        impulse: integral of the load over all later times, shape (N_x,), in N s.
        direct: a p, shape (N_x,), in N.
        stiff: change of load and strength with slip, shape (N_x,), in N/m.
        pull: amplitude of the force of the driver, in N.
        frequency: mean angular frequency, in 1/s.
        decay: decay rate of the energy of waves, in 1/s.
    """

    rest: Values
    amplitude: np.ndarray
    impulse: np.ndarray
    direct: np.ndarray
    stiff: np.ndarray
    pull: float
    frequency: float
    decay: float

    @property
    def largest(self) -> float:
        """Sum of the amplitudes of loads, or amplitude of the driver's force if larger, in N."""
        return max(float(self.amplitude.sum()), self.pull)

    def slip(self, v: np.ndarray) -> np.ndarray:
        """Return the slip due to waves at speeds v (m/s), to first order, shape (N_x,), in m."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.direct > 0, v * self.impulse / self.direct, 0.0)

    def effect(self, v: np.ndarray, change: np.ndarray | float = 0.0) -> float:
        """Return the largest change of loads by slip beyond first order, in N.

        While waves last, the mean speed of a block is v I_0(amplitude/(a p)), with a Bessel
        function. The change of load by slip is at most the change of mean friction, or the
        amplitude.

        Args:
            v: speeds, shape (N_x,), in m/s.
            change: change of the speeds during a wave, shape (N_x,), in m/s.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            over = self.amplitude / self.direct
            mean = np.i0(np.fmin(over, LARGE))
            by_mean = self.stiff * v * (mean - 1) / self.decay
        friction = np.where(over < LARGE, self.direct * np.log(mean), self.amplitude)
        at_once = self.stiff * np.abs(self.slip(np.asarray(change)))
        return float(np.sum(np.fmin(by_mean, friction) + np.fmin(at_once, self.amplitude)))


class Linearised:
    """The slider about a state, with the blocks in contact held.

    Args:
        known: static states of the scene.
        closed: blocks in contact, shape (N_x,), bool.
        q: coordinates of the state, shape (n_q,), in m; None means the loaded state, whose factor
            is stored.

    Attributes:
        K, C: stiffness (N/m) and viscosity (N s/m), shape (n_q, n_q).
        M: masses, shape (n_q,), in kg.
    """

    def __init__(
        self, known: StaticSolver, closed: np.ndarray, q: np.ndarray | None = None
    ) -> None:
        mode = np.where(closed, STUCK, OPEN).astype(np.int8)
        self.known, self.closed, self.inside = known, closed, known.unknown(mode)
        self.contact, self.M = States(known.scene, mode, FRICTIONLESS), mass(known.scene)
        self._k_f = np.broadcast_to(known.scene.k_f, closed.shape) * known.scene.touches
        if q is None:
            self.K, self._inner = known.tangents(mode), known.factor(mode, driven=True)
            q = known.coordinates(known.loaded.u, known.loaded.rod)
        else:
            self.K = known.stiffness(known.bond_tangents(q), mode, driven=True)
            self._inner = known.factor(mode, driven=True, q=q)
        self.C = known.damping(q)

    def answer(self, force: np.ndarray) -> np.ndarray:
        """Return displacements (m) by forces (N) on the slider with held interface, (n_q[, n])."""
        found = np.zeros(force.shape)
        found[self.inside] = self._inner.solve(force[self.inside])
        return found

    def moving(self, v_x: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the velocities (m/s) of the slider in static motion, shape (n_q,).

        They follow from rates of forces (N/s) and v_x of blocks in contact: all other coordinates
        obey K q' = b'.
        """
        q = np.zeros(self.K.shape[0])
        q[: len(v_x)] = np.where(self.closed, v_x, 0.0)
        return q + self.answer(force - self.K @ q)

    def resistance(self, rates: np.ndarray | None, gains: np.ndarray | None = None) -> np.ndarray:
        """Return the forces of viscosity and inertia, -C q' - M q'' (N), shape (n_q[, n])."""
        of_v = 0.0 if rates is None else self.C @ rates
        of_a = 0.0 if gains is None else (self.M * gains.T).T
        return -of_v - of_a

    def loads(self, q: np.ndarray, force: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Return loads and normal forces of blocks (N), (N_x, ...), for q (m) and forces (N)."""
        held, k_f = self.closed, self._k_f
        if q.ndim > 1:
            held, k_f = held[:, None], k_f[:, None]
        load = (force - self.K @ q)[: len(held)]
        return np.where(held, load, 0.0), -k_f * q[ends(len(held)).u_z]

    def _shapes(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield groups of blocks in contact, and static responses (n_q, n) to 1 m of each block."""
        at = np.flatnonzero(self.closed)
        for part in np.array_split(at, -(-len(at) // COLUMNS)):
            q = -self.answer(self.K[:, part].toarray())
            q[part, range(len(part))] = 1.0
            yield part, q

    @functools.cached_property
    def by_u(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of load, normal force, F_T (N/m) and u_x by displacements of blocks."""
        N_x = len(self.closed)
        load, p, u = np.zeros((3, N_x, N_x))
        F_T = np.zeros(N_x)
        for part, q in self._shapes():
            load[:, part], p[:, part] = self.loads(q, 0.0)
            F_T[part], u[:, part] = -self.known.push @ q, q[:N_x]
        return load, p, F_T, u

    @functools.cached_property
    def by_v(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of load and normal force by velocities, shape (N_x, N_x), in N s/m.

        The slider moves through static states, q = G u. To first order in eta, the load changes by
        -G' C G v.
        """
        return self._resisted(lambda q: self.resistance(q))

    @functools.cached_property
    def by_a(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives by accelerations, in kg: to first order the load changes by -G' M G v'."""
        return self._resisted(lambda q: self.resistance(None, q))

    def _resisted(
        self, force_of: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return loads and normal forces by forces that resist unit motions, (N_x, N_x) each."""
        load, p = np.zeros((2, len(self.closed), len(self.closed)))
        for part, q in self._shapes():
            force = force_of(q)
            load[:, part], p[:, part] = self.loads(self.answer(force), force)
        p[~self.closed] = 0.0
        return load, p

    def interface(self, at: Values, outside: Outside, bends: np.ndarray | float = 0.0) -> Interface:
        """Return the condensed slider about a static state, under driver and loads.

        Driver and loads also move the slider while its interface is held. The result includes
        viscous forces of this motion. `bends` are second derivatives of spring forces during this
        motion, shape (n_q,), in N/s^2.
        """
        N_x, K, push = len(self.closed), self.known.scene.driver.K, self.known.push
        load, p, u = np.zeros((3, N_x, 3))
        F_T = np.array([at.F_T, K * outside.V, K * outside.a])
        load[:, 0], p[:, 0], u[:, 0] = (
            -at.f,
            np.where(self.closed, at.p, -self._k_f * at.u_z),
            at.u_x,
        )
        first, second = outside.rates()
        for n, force in enumerate((first, second - bends)):
            if np.any(force):
                q = self.answer(force)
                resists = self.resistance(q)
                rate, drag = self.loads(q, force), self.loads(self.answer(resists), resists)
                for part, faster, lag in zip((load, p), rate, drag, strict=True):
                    part[:, n + 1] += faster
                    part[:, n] += lag
                u[:, n + 1] = q[:N_x]
                F_T[n + 1] -= push @ q
        of_u = self.by_u
        return Interface((load, of_u[0]), (p, of_u[1]), (F_T, of_u[2]), (u, of_u[3]))

    def waves(
        self, at: np.ndarray, v: np.ndarray, outside: Outside, p: np.ndarray, law: RateStateLaw
    ) -> Waves:
        """Return the waves in a state of the slider.

        Waves obey M q'' + C q' + K q = 0 with the interface held. The integral of q over time
        follows from the initial state, K int(q) = M q' + C q. Frequency and decay are means
        weighted with energy.

        Args:
            at, v: coordinates (m) and velocities (m/s), shape (n_q,).
            outside: driver and loads.
            p: normal forces, shape (N_x,), in N.
            law: the friction law, for a, b and D_c.
        """
        closed, N_x = self.closed, len(self.closed)
        force, F_T = self.known.under(outside.load).forces(at, self.contact, outside.drive)
        static, path = self.answer(force), self.moving(v[:N_x], outside.rates()[0])
        q, w = -static - self.answer(self.resistance(path)), v - path
        w[:N_x][closed] = 0.0
        K_q, K_w, C_q = self.K @ q, self.K @ w, self.C @ q
        faster = K_q[self.inside] ** 2 / self.M[self.inside]
        energy = float(w @ (self.M * w) + q @ K_q)
        square = float(w @ K_w + faster.sum()) / energy if energy else 1.0
        decay = float(w @ (self.C @ w) + square * (q @ C_q)) / energy if energy else 0.0
        impulse, _ = self.loads(self.answer(self.M * w + C_q), C_q)
        load, above = self.loads(static, force)
        u_z, F_T = (at + static)[ends(N_x).u_z], F_T - float(self.known.push @ static)
        rest = Values(at[:N_x], -load, u_z, np.where(closed, p + above, p), F_T)
        amplitude = np.hypot(K_q[:N_x], K_w[:N_x] / math.sqrt(square))
        stiff = np.abs(np.diag(self.by_u[0])) + law.b * p / law.D_c
        of = (np.where(closed, part, 0.0) for part in (amplitude, impulse, law.a * p, stiff))
        push = self.known.push
        pull = math.hypot(push @ q, push @ w / math.sqrt(square))
        return Waves(rest, *of, pull, math.sqrt(square), decay)
