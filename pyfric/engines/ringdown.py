"""Ring-down of a slider on which nothing slips: a few modes, and a bound for the rest.

While no contact state changes, the slider is a damped linear oscillator about a static state that
drifts with the driver. With w the deviation from the drifting state, the blocks that stick held and
the open ones free,

    M w'' + C w' + K w = 0 .

The slowest modes phi exp(lambda s), (lambda^2 M + lambda C + K) phi = 0, are followed in closed
form. M, C and K are symmetric, so the amplitude of a mode is

    a = (phi.(C w + M w') + lambda phi.M w) / (phi.C phi + 2 lambda phi.M phi) .

In linear geometry, on all but the smallest lattices, modes are found otherwise (`fine`).

The energy E of what the modes leave out cannot grow. By the inequality of Cauchy and Schwarz it
bounds what the remainder does to the contact at any later time; on large lattices the energy of its
rate gives a lower bound (`patches`). It also decays: a mode of frequency
omega with at least half of its elastic energy in the bonds has -Re lambda >= eta omega^2/(4 k),
because the viscosity of a bond resists all of the relative motion and its spring only a part. The
slower one of two overdamped modes decays at its own |lambda|.

Contact is watched through margins c in N, all positive while no state changes: mu_s p + f and
mu_s p - f of stuck blocks, k_f u_z of open ones.

A step of RK4 multiplies a mode by R(lambda dt) = 1 + z + z^2/2 + z^3/6 + z^4/24 and reproduces the
drifting state exactly, so that the ring-down of a run with steps dt is that of the rates
log(R)/dt: nothing is lost or gained against stepping.

In finite geometry K is that of an earlier state. `Frozen.tangent_at` corrects the rates, whose
errors add up over time, to first order, and takes K anew where it has changed much. Drift and lag
are corrected in the same way where a jump begins and where it ends; its rates are of its middle.
"""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from pyfric.engines.fine import FineModes, Space, closed_space, is_fine, modes
from pyfric.engines.patches import FEWEST_ROWS, Patches
from pyfric.engines.smooth import slowest
from pyfric.scene import of
from pyfric.statics import LARGE, damping, mass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse.linalg import SuperLU

    from pyfric.scene import Geometry, Scene
    from pyfric.statics import BandedCholesky, StaticSolver

__all__ = ["STRAINED", "Frozen", "Held", "Motion", "Rest"]

N_VALUES, N_VALUES_LARGE = 40, 24
"""Eigenvalues that are computed, those of smallest modulus; two make an oscillating mode. The
second number is for more than `LARGE` unknowns in finite geometry."""
RENEWED = 6
"""Modes that follow K where it changes, the slowest ones: others do not last until a jump ends."""
TINY = 1e-11
"""Tension below this many F_N/N_x is rounding."""
FEW, MOST_COLUMNS, MOST_OPENINGS = 6, 40, 8
"""On lattices of more than `LARGE` unknowns a state follows from the last one where few blocks
moved since; the responses to single blocks are kept, and the shapes of blocks that opened."""
MAX_ITER = 20
"""Most restarts of ARPACK; few are needed."""
STRAINED = 0.005
"""In finite geometry K is taken anew where the stiffness of a bond has changed by this many k."""


class Rest(NamedTuple):
    """A static state: coordinates, then forces on the interface (N), u_z (m), shape (N_x,)."""

    q: np.ndarray | None
    f: np.ndarray
    tau: np.ndarray
    p: np.ndarray
    u_z: np.ndarray
    F_T: float


class Motion(NamedTuple):
    """A deviation from the drifting state: amplitudes of modes and energy of the remainder, J.

    `rate` is the energy of the remainder's rate, in J/s^2, where bounds take it; else inf.
    """

    a: np.ndarray
    remainder: float
    rate: float = math.inf


class Course(NamedTuple):
    """How a static state moves while the driver gains speed and loads change at constant rates.

    A time s later it has moved by v s + a s^2/2, and the slider lags behind it by lag + lag_rate s;
    margins have changed by rate s + bend s^2/2, and by the lag's margin_lag + margin_lag_rate s;
    F_T alike. Coordinates have the shape (n_q,), margins (n_c,); m, N and s.
    """

    v: np.ndarray
    a: np.ndarray | float
    lag: np.ndarray
    lag_rate: np.ndarray | float
    margin_rate: np.ndarray
    margin_bend: np.ndarray
    margin_lag: np.ndarray
    margin_lag_rate: np.ndarray | float
    force_rate: float
    force_bend: float
    force_lag: float
    force_lag_rate: float

    def way(self, s: float, begin: float = 0.0) -> np.ndarray:
        """Return how far the static state moves up to s (s) from `begin` (s) on, (n_q,), in m."""
        return (s - begin) * (self.v + (0.5 * (s + begin)) * self.a)

    def path(self, s: float) -> np.ndarray:
        """Return how far static state and lag have moved at s (s), shape (n_q,), in m."""
        return self.way(s) + (self.lag + s * self.lag_rate)

    def speed(self, s: float) -> np.ndarray:
        """Return the rates of coordinates of the lagging state at s (s), (n_q,), in m/s."""
        return self.v + (s * self.a + self.lag_rate)

    def force(self, s: float, begin: float = 0.0) -> float:
        """Return what F_T gains up to s (s) from `begin` (s) on, without the lag, in N."""
        return (s - begin) * (self.force_rate + 0.5 * (s + begin) * self.force_bend)


def remainder_decay(scene: Scene, geometry: Geometry = "linear") -> float:
    """Return roughly the rate at which motions faster than the modes kept decay, in 1/s.

    It is 1 to 1.5 times `Frozen.decay` on the paper's lattices and on those with half their l in
    finite geometry; where modes are those of `fine` it is that of the fastest ones.
    """
    kept = modes(scene) if is_fine(scene, geometry) else N_VALUES / 2
    if geometry == "finite" and 2 * scene.N_x * scene.N_z > LARGE:
        kept = N_VALUES_LARGE / 2
    return slowest(scene, kept) ** 2 * scene.eta / (4 * scene.slider.k)


class Held:
    """The slider with the blocks held that stick, all others open: its static states.

    Args:
        solver: static states of the scene in its geometry.
        stuck: blocks that are held, shape (N_x,), bool; all others are open.
        closed: the same slider with all blocks stuck. With it, blocks are opened by corrections of
            low rank, without a factorisation: the way for large lattices.
        at: state whose tangent is taken, shape (n_q,); None means the loaded one.
        carries: blocks on the foundation, stuck or not, shape (N_x,), bool; None means those that
            stick. Without `closed`, None.

    Attributes:
        drift: dq/d(drive) of the static state, shape (n_q,).
        force_rate: change of F_T with the drive, in N/m.
    """

    def __init__(
        self,
        solver: StaticSolver,
        stuck: np.ndarray,
        closed: Held | None = None,
        at: np.ndarray | None = None,
        carries: np.ndarray | None = None,
    ) -> None:
        self.stuck, self.k_f = stuck, solver.scene.k_f
        self.carries = stuck if carries is None else carries
        self._columns: dict[int, np.ndarray] = {}
        self._last: tuple[np.ndarray, float, np.ndarray] | None = None
        if closed is None:
            K, factor, free = solver.tangent(stuck, at)
        else:
            factor = _Opened(closed, np.flatnonzero(~stuck), np.flatnonzero(~self.carries))
            K, free = factor.K, factor.free
        self.solver, self._factor, self._rows = solver, factor, K
        self.free, self.n_q, self.push = free, K.shape[0], solver.push
        self.drift = np.zeros(self.n_q)
        if closed is None:
            self.drift[free] = factor.solve(self.push[free])
        else:
            self.drift[free] = factor.corrected(closed.drift[closed.free], self.push[free])
        held = np.flatnonzero(stuck)
        self._drift_force = (K @ self.drift - self.push)[held]
        # F_T = K (drive - d u_h)
        self.force_rate = solver.scene.driver.K - float(self.push @ self.drift)

    def rest(
        self, u_x: np.ndarray, drive: float, outside: tuple[float, float] | None = None
    ) -> Rest:
        """Return the static state in linear geometry, whether or not its contacts are right.

        Args:
            u_x: of the bottom blocks, shape (N_x,), in m; not used where open.
            drive: displacement of the driver since t = 0, in m.
            outside: F_N and T, in N; None means those at t = 0.
        """
        scene, free = self.solver.scene, self.free
        N_x, held = scene.N_x, np.flatnonzero(self.stuck)
        load = self.solver.under(outside).load
        load = load + (drive + scene.d * self.solver.u_drv0) * self.push
        q = self._moved(u_x, drive) if outside is None else None
        if q is None:
            q = np.zeros(self.n_q)
            q[held] = u_x[held]
            q[free] = self._factor.solve(load[free] - (self._rows @ q)[free])
        if len(free) > LARGE and outside is None:
            self._last = u_x.copy(), drive, q
        f = np.zeros(N_x)
        f[held] = (self._rows @ q - load)[held]
        p = np.where(self.carries, -self.k_f * q[N_x : 2 * N_x], 0.0)
        F_T = scene.driver_force(drive, self.solver.driven_row @ q, self.solver.u_drv0)
        return Rest(q, f, -scene.d * f, p, q[N_x : 2 * N_x], F_T)

    @property
    def factor(self) -> BandedCholesky | SuperLU | _Opened:
        """Solves for the free coordinates, with this K."""
        return self._factor

    @property
    def stiffness(self) -> sp.csr_array | _Lowered:
        """The stiffness of all coordinates, shape (n_q, n_q), in N/m."""
        return self._rows

    def solve(self, force: np.ndarray) -> np.ndarray:
        """Return the displacements of free coordinates under forces on them."""
        return self._factor.solve(force)

    def shape(self, u_x: np.ndarray) -> np.ndarray:
        """Return q, shape (n_q, ...), where stuck blocks are moved to u_x, (N_x, ...)."""
        q = np.zeros((self.n_q, *u_x.shape[1:]))
        held, free = np.flatnonzero(self.stuck), self.free
        q[held] = u_x[held]
        q[free] = self._factor.solve(-(self._rows @ q)[free])
        return q

    def fits(self, rest: Rest) -> bool:
        """Whether no block is pulled down by the foundation or in it, but for rounding."""
        return not self.wrong(rest).any()

    def wrong(self, rest: Rest) -> np.ndarray:
        """Return the blocks for which that does not hold, shape (N_x,), bool."""
        scene = self.solver.scene
        low = np.where(self.carries, rest.p, self.k_f * rest.u_z)
        return low < -TINY * scene.F_N / scene.N_x

    def driven(self, rest: Rest, drive: float, drive_now: float) -> Rest | None:
        """Return a static state, without q, after the driver has moved on, to first order.

        That is exact in linear geometry. None if it has other open blocks.
        """
        N_x, held = len(self.stuck), np.flatnonzero(self.stuck)
        by = drive_now - drive
        f = rest.f.copy()
        f[held] += by * self._drift_force
        u_z = rest.u_z + by * self.drift[N_x : 2 * N_x]
        p = np.where(self.carries, -self.k_f * u_z, 0.0)
        d = self.solver.scene.d
        moved = Rest(None, f, -d * f, p, u_z, rest.F_T + by * self.force_rate)
        return moved if self.fits(moved) else None

    def _moved(self, u_x: np.ndarray, drive: float) -> np.ndarray | None:
        """Return q from the last state of a large lattice, if few blocks have moved since."""
        if self._last is None:
            return None
        before, drive_before, q = self._last
        moved = np.flatnonzero(self.stuck & (u_x != before))
        new = [i for i in moved if i not in self._columns]
        if len(moved) > FEW or len(new) > 1:  # a solution for each new one
            return None
        q = q + (drive - drive_before) * self.drift
        for i in moved:
            if i not in self._columns:
                while len(self._columns) >= MOST_COLUMNS:
                    del self._columns[next(iter(self._columns))]
                side = self._rows[[i]].toarray()[0, self.free]
                self._columns[i] = -self._factor.solve(side)
            q[self.free] += (u_x[i] - before[i]) * self._columns[i]
            q[i] = u_x[i]
        return q


class Frozen(Held):
    """The slider with fixed contact states: drift, modes, and what they do to the contact.

    Args:
        solver: static states of the scene in its geometry.
        stuck: blocks that are held, shape (N_x,), bool; all others are open.
        dt: step of RK4 that the ring-down follows, in s; None means exact time.
        closed: the same slider with all blocks stuck; see `Held`. Modes are then found in its
            space, to which the opened blocks add their static shapes.
        at: state whose tangent is taken, shape (n_q,); None means the loaded one.
        near: the same slider with the tangent of a state nearby: modes follow from its modes.

    Attributes:
        rates: eigenvalues of the modes, one of each conjugate pair, shape (n,), in 1/s.
        growth: rates of the amplitudes: `rates`, or what RK4 makes of them, shape (n,), in 1/s.
        lag: offset of the drifting state from the static one, shape (n_q,), in m.
        margin_rate: change of the margins with the drive, shape (n_c,), in N/m.
        bound: change of the margins by a remainder of energy E over sqrt(E), (n_c,), in N/sqrt(J).
        decay: rate at which the remainder decays at least, in 1/s.
    """

    def __init__(
        self,
        solver: StaticSolver,
        stuck: np.ndarray,
        dt: float | None = None,
        closed: Frozen | None = None,
        at: np.ndarray | None = None,
        near: Frozen | None = None,
    ) -> None:
        super().__init__(solver, stuck, closed, at)
        scene, factor, free, push = solver.scene, self._factor, self.free, self.push
        N_x, k_f, law, V = scene.N_x, scene.k_f, scene.law, scene.driver.V
        self.law, self.dt = law, dt
        if solver.geometry == "finite":
            loaded = solver.coordinates(solver.loaded.u, solver.loaded.rod)
            self._bonds = solver.bond_tangents(loaded if at is None else at)
        self._squares: np.ndarray | None = None
        K, C = self._rows, (closed or near)._all_C if closed or near else damping(scene)
        self._all_C, self._all_M = C, mass(scene)
        self.M = self._all_M[free]
        self.lag = np.zeros(self.n_q)
        self.lag[free] = factor.solve(-(C @ (V * self.drift))[free])
        self._fine: FineModes | None = None
        self._openings: dict[int, np.ndarray] = {}
        if is_fine(scene, solver.geometry):
            self._find_fine(closed)
        else:
            self._find_dense(near, factor)
        self.growth = self.stepped(self.rates)

        # margins as rows over w and w'
        held, open_ = np.flatnonzero(stuck), np.flatnonzero(~stuck)
        pick = sp.eye_array(self.n_q, format="csr")
        p = _times(-of(k_f, held), pick[held + N_x])
        strength, lifted = (
            _times(of(law.hold(1.0), held), p),
            _times(of(k_f, open_), pick[open_ + N_x]),
        )
        rows = sp.vstack([strength + K[held], strength - K[held], lifted]).tocsr()
        if near is not None:  # the same dashpots
            rows_v, self._viscous = near._on_margins[1], near._viscous
        else:
            empty = sp.csr_array((len(open_), self.n_q))
            rows_v = sp.vstack([C[held], -C[held], empty]).tocsr()
            self._viscous = C[held][:, free].multiply(C[held][:, free]) @ (1 / self.M)
        self.modal = self._on(rows) + self._on(rows_v) * self.rates
        direct = np.concatenate([-push[held], push[held], np.zeros(len(open_))])
        self.margin_rate = rows @ self.drift + direct
        self.margin_lag = rows @ self.lag + rows_v @ (V * self.drift)
        moved = K[held][:, held].sum(axis=1)  # bonds between held blocks carry nothing
        stiff = of(law.hold(1.0) ** 2 * k_f, held) + moved + self._viscous
        lift = factor.lift() if closed else [self._compliance(factor, i + N_x) for i in open_]
        self._on_margins = rows, rows_v
        self.bound = np.sqrt(
            2 * np.concatenate([stiff, stiff, of(k_f, open_) ** 2 * np.array(lift)])
        )
        self._patches = self._near = None
        if self._fine and len(free) > LARGE and scene.N_z >= FEWEST_ROWS:
            self._patches = closed._patches if closed else Patches(scene, self._all_M, C)
            self._find_near(held, open_)
        self.force_modal = -self._on(sp.csr_array(push[None]))[0]
        self.force_lag = -float(push @ self.lag)

    def course(
        self,
        V: float,
        a: float = 0.0,
        more: np.ndarray | None = None,
        stiffer: np.ndarray | None = None,
    ) -> Course:
        """Return how the static state moves.

        Args:
            V: speed of the driver, in m/s.
            a: its rate of change, in m/s^2.
            more: rates of other forces on the coordinates, shape (n_q,), in N/s.
            stiffer: what bonds gain from this tangent to that of the state, which counts to first
                order, shape (3, n_bonds), in N/m.
        """
        given, steady = self.solver.scene.driver.V, a == 0 and more is None
        if V == given and steady and stiffer is None:
            margins = V * self.margin_rate, np.zeros_like(self.margin_lag), self.margin_lag, 0.0
            force = V * self.force_rate, 0.0, self.force_lag, 0.0
            return Course(V * self.drift, 0.0, self.lag, 0.0, *margins, *force)
        (rows, rows_v), K, M = self._on_margins, self.solver.scene.driver.K, self._all_M
        force = V * self.push + (0.0 if more is None else more)
        v, bent = V * self.drift if more is None else self._answer(force), a * self.drift
        lag_rate = self._answer(-(self._all_C @ bent)) if a else bent
        more_v = more_lag = np.zeros(self.n_q)
        if stiffer is not None:
            more_v = self.solver.stiffened(v, stiffer)
            v = v - self._answer(more_v)
        pull = self._all_C @ (v + lag_rate) + M * bent
        if stiffer is not None:
            lag = self.lag if V == given and steady else self._answer(-pull)
            more_lag = self.solver.stiffened(lag, stiffer)
        lag = self._answer(-pull - more_lag)
        held, still = np.flatnonzero(self.stuck), np.zeros(int((~self.stuck).sum()))
        direct, direct_lag, direct_a = (
            np.concatenate([one[held], -one[held], still])
            for one in (more_v - force, more_lag, -a * self.push)
        )
        return Course(
            v, bent, lag, lag_rate,
            rows @ v + direct, rows @ bent + direct_a,
            rows @ lag + rows_v @ (v + lag_rate) + direct_lag, rows @ lag_rate + rows_v @ bent,
            K * V - float(self.push @ v), K * a - float(self.push @ bent),
            -float(self.push @ lag), -float(self.push @ lag_rate),
        )  # fmt: skip

    def _answer(self, force: np.ndarray) -> np.ndarray:
        """Return the displacements, shape (n_q, ...), that forces on all coordinates make."""
        found = np.zeros(force.shape)
        found[self.free] = self._factor.solve(force[self.free])
        return found

    def moved(self, rest: Rest, course: Course, s: float) -> Rest:
        """Return the static state a time s (s) later on its course."""
        n, held = int(self.stuck.sum()), np.flatnonzero(self.stuck)
        way, f = course.way(s), rest.f.copy()
        gain = s * (course.margin_rate + (0.5 * s) * course.margin_bend)
        f[held] += (gain[:n] - gain[n : 2 * n]) / 2  # mu_s p + f and mu_s p - f
        u_z = rest.u_z + way[len(f) : 2 * len(f)]
        p = np.where(self.stuck, -self.k_f * u_z, 0.0)
        F_T = rest.F_T + course.force(s)
        return Rest(rest.q + way, f, -self.solver.scene.d * f, p, u_z, F_T)

    def _find_modes(
        self, factor: BandedCholesky | SuperLU, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the eigenvalues of smallest modulus, up to count of them, and their modes."""
        n, C, M = len(self.free), self.C, self.M
        start = self.drift[self.free]
        inertia = float(start @ (M * start))
        # Rates are counted in units of a slow one: without that, ARPACK is lost where eta is small.
        unit = math.sqrt(float(start @ (self.K @ start)) / inertia) if inertia > 0 else 1.0

        def inverse(z: np.ndarray) -> np.ndarray:
            return np.concatenate([-factor.solve(C @ z[:n] + (M * unit) * z[n:]), z[:n] / unit])

        operator = LinearOperator((2 * n, 2 * n), inverse, dtype=float)
        start = np.concatenate([start, np.zeros(n)])
        start += 1e-3 * np.abs(start).max() * np.cos(np.arange(2 * n))
        count = min(count, 2 * n - 2)
        found, vectors = np.zeros(0, complex), np.zeros((2 * n, 0), complex)
        for ncv in (2 * count + 1, 4 * count) if count else ():  # pairs may need more room
            room = {"ncv": min(ncv, 2 * n), "maxiter": MAX_ITER, "tol": 1e-10}
            with contextlib.suppress(ArpackError):  # no modes: all is remainder
                found, vectors = eigs(operator, count, v0=start, **room)
                break
        one_of_pair = found.imag <= 0
        rates = 1 / found[one_of_pair]
        rates = np.minimum(rates.real, 0.0) + 1j * rates.imag
        return rates, vectors[:n, one_of_pair]

    def _find_dense(self, near: Frozen | None, factor: BandedCholesky | SuperLU) -> None:
        """Find exact modes of the lattice, or those near the modes of another tangent."""
        scene, free = self.solver.scene, self.free
        self.K, self.C = self._rows[free][:, free], near.C if near else self._all_C[free][:, free]
        if near is not None:
            self._keep_modes(*self._renewed_modes(near, factor))
        else:
            # Stuck blocks of a chain can only move vertically, which nothing makes them do.
            most = N_VALUES if len(free) <= LARGE else N_VALUES_LARGE
            self._keep_modes(*self._find_modes(factor, most if scene.N_z > 1 else 0))
        cut = np.max(np.abs(self.rates), initial=0.0)
        self.decay = min(scene.eta * cut**2 / (4 * scene.slider.k), cut)

    def _find_fine(self, closed: Frozen | None) -> None:
        """Find modes of a fine lattice, whose smooth shapes hold many."""
        scene, matrices = self.solver.scene, (self._all_M, self._all_C, self._rows)
        if closed is None:
            pulled = [self.drift] + ([self.lag] if self.lag.any() else [])
            self._space = closed_space(scene, self._answer, *matrices, np.column_stack(pulled))
        else:
            opened = np.flatnonzero(~self.stuck)
            width = None if len(opened) <= FEW else 2
            shapes = [closed._opening(i)[:, :width] for i in opened]
            lower = opened + scene.N_x, np.broadcast_to(self.k_f, scene.N_x)[opened]
            self._space = Space(closed._space, shapes, *matrices, lower)
        self._fine = fine = FineModes(self._space)
        self.rates, self.weight, self.decay = fine.rates, fine.weight, fine.decay

    def _opening(self, i: int) -> np.ndarray:
        """Return the static shapes that a block adds to the space of modes once it is open.

        These are the answers to a force on it and to its u_x, and those to their inertia and
        viscosity, shape (n_q, 6). Where more than `FEW` blocks are open, the first two are used.
        """
        if i not in self._openings:
            N_x, (M, C) = len(self.stuck), (self._all_M[:, None], self._all_C)
            both = np.zeros((self.n_q, 2))
            both[self.free] = np.column_stack([self._columns[i + N_x], self._columns[i]])
            both[i, 1] = 1.0
            forces = np.hstack([M * both] + ([C @ both] if self.solver.scene.eta > 0 else []))
            more = self._answer(forces)
            while len(self._openings) >= MOST_OPENINGS:
                del self._openings[next(iter(self._openings))]
            self._openings[i] = np.hstack([both, more])
        return self._openings[i]

    def _renewed_modes(
        self, near: Frozen, factor: BandedCholesky | SuperLU
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return slow modes anew, from those of a state nearby, and the others as they were."""
        size, slow, fast = np.abs(near.rates), slice(RENEWED), slice(RENEWED, None)
        below = 1.001 * np.max(size, initial=0.0)
        if len(size) > RENEWED:
            below = math.sqrt(size[RENEWED - 1] * size[RENEWED])
        rates, phi = self._modes_near(near.rates[slow], near.phi[:, slow], below, factor)
        return np.append(rates, near.rates[fast]), np.hstack([phi, near.phi[:, fast]])

    def _modes_near(
        self,
        rates: np.ndarray,
        phi: np.ndarray,
        slow: float,
        factor: BandedCholesky | SuperLU,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the modes with rates up to `slow` near modes that are roughly right.

        What these lack, K^-1 (lambda^2 M + lambda C + K) phi, and they themselves make the space
        in which modes are found.
        """
        basis = np.hstack([phi.real, phi.imag])
        left = self.M[:, None] * phi
        left *= rates
        left += self.C @ phi
        left *= rates
        left += self.K @ phi
        count = basis.shape[1]
        wider = np.empty((len(basis), count + 2 * len(rates)))
        wider[:, :count] = basis
        del basis, phi
        wider[:, count : count + len(rates)] = factor.solve(left.real)
        wider[:, count + len(rates) :] = factor.solve(left.imag)
        del left
        return self._modes_in(wider, slow)

    def _modes_in(self, basis: np.ndarray, slow: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the modes in a space of shapes with rates up to `slow`, Galerkin's way.

        The shapes are scaled in place: on large lattices they take much memory.
        """
        length = np.linalg.norm(basis, axis=0)
        basis /= np.where(length > 0, length, 1.0)  # overdamped modes are real: no imaginary part
        size, axes = np.linalg.eigh(basis.T @ (self.M[:, None] * basis))
        apart = size > 1e-13 * size[-1]
        axes = axes[:, apart] / np.sqrt(size[apart])
        K, C = (axes.T @ (basis.T @ (A @ basis)) @ axes for A in (self.K, self.C))
        zero, one = np.zeros_like(K), np.eye(len(K))
        found, vectors = np.linalg.eig(np.block([[zero, one], [-K, -C]]))
        kept = (np.abs(found) <= slow) & (found.imag >= 0)
        shares = axes @ vectors[: len(K), kept]
        phi = np.empty((len(basis), kept.sum()), complex)
        phi.real, phi.imag = basis @ shares.real, basis @ shares.imag
        return found[kept], phi

    def _on(self, rows: sp.csr_array) -> np.ndarray:
        """Return the products of rows over coordinates with the modes."""
        return self._fine.on(rows) if self._fine else rows[:, self.free] @ self.phi

    def _sum(self, a: np.ndarray) -> np.ndarray:
        """Return the coordinates of a sum of modes, each with its conjugate, shape (n_q,)."""
        if self._fine:
            return self._fine.spread(self.weight * a)
        q = np.zeros(self.n_q)
        q[self.free] = (self.phi @ (self.weight * a)).real
        return q

    def _moving(self, a: np.ndarray) -> Sequence[np.ndarray]:
        """Return the coordinates of a sum of modes, as `_sum` does, and their rates."""
        if not self._fine:
            return self._sum(a), self._sum(a * self.rates)
        both = np.column_stack([a, a * self.rates])
        return np.ascontiguousarray(self._fine.spread(self.weight[:, None] * both).T)

    @property
    def shapes(self) -> np.ndarray:
        """Shapes of which slow modes consist, shape (n_q, n)."""
        if self._fine:
            return self._space.slow()
        shapes = np.zeros((self.n_q, 2 * len(self.rates)))
        shapes[self.free] = np.hstack([self.phi.real, self.phi.imag])
        return shapes

    def _keep_modes(self, rates: np.ndarray, phi: np.ndarray) -> None:
        """Store modes, slow ones first, with what their amplitudes need."""
        order = np.argsort(np.abs(rates), kind="stable")
        rates, phi = rates[order], phi[:, order]
        self.rates, self.phi = rates, phi
        self.weight = np.where(rates.imag > 0, 2.0, 1.0)
        self._norm = np.sum(phi * (self.C @ phi + 2 * rates * (self.M[:, None] * phi)), axis=0)
        groups = slice(RENEWED), slice(RENEWED, None)  # others than the slow ones may be older
        parts = phi.real.T, phi.imag.T
        self._groups = [(some, np.vstack([part[some] for part in parts])) for some in groups]

    def _compliance(self, factor: BandedCholesky | SuperLU | _Opened, at: int) -> float:
        one = (self.free == at).astype(float)
        return float(one @ factor.solve(one))

    def _find_near(self, held: np.ndarray, open_: np.ndarray) -> None:
        """Find bounds from the patch around each block."""
        n, near, (rows, rows_v) = len(held), np.empty((3, len(self.bound))), self._on_margins
        at = [[k, k + n] for k in range(n)] + [[2 * n + k] for k in range(len(open_))]
        for i, some in zip([*held, *open_], at, strict=True):
            pair = rows[some], rows_v[some]
            near[:, some] = self._patches.bounds(i, self.stuck, self._rows, pair)
        self.bound, self._near = np.minimum(self.bound, near[0]), near[1:]

    def bounds(self, motion: Motion) -> np.ndarray:
        """Return what the remainder of a motion does to the margins at most, shape (n_c,), in N."""
        root = math.sqrt(motion.remainder)
        if self._near is None:
            return self.bound * root
        return np.minimum(self.bound * root, np.array([math.sqrt(motion.rate), root]) @ self._near)

    def left(self, motion: Motion, s: float) -> float:
        """Return how much of the remainder is left in any force after a time s (s), in N.

        On large lattices errors of modes decay with them, and the rest faster.
        """
        stuck = slice(2 * int(self.stuck.sum()))  # open blocks carry no force
        most = self.bounds(motion)[stuck].max()
        left = most * math.exp(-self.decay * s)
        if self._near is None:
            return left
        errors = self._fine.errors * np.abs(motion.a) * self.bound[stuck].max()
        fast = (most + errors.sum()) * math.exp(-self._fine.fast * s)
        return min(left, fast + float(errors @ np.exp(self.growth.real * s)))

    def margins(self, rest: Rest) -> np.ndarray:
        """Return the margins in a static state, shape (n_c,), in N."""
        held = self.law.at(self.stuck).margins(rest.p[self.stuck], rest.f[self.stuck])
        return np.concatenate([*held, (self.k_f * rest.u_z)[~self.stuck]])

    def aged(self, age: np.ndarray, *rows: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return margins, or their rates and amplitudes, of blocks that have been stuck for `age`.

        Both margins of a block are mu_s p +- f, so that their sum gives p. Blocks only grow
        stronger: what the law says now bounds what it says later from below.

        Args:
            age: time since each block stuck, shape (N_x,), in s.
            rows: margins of the law at age 0, shape (n_c, ...).
        """
        if self.law.tables.hold is None:
            return rows
        n, law = int(self.stuck.sum()), self.law.at(self.stuck)
        young = np.broadcast_to(law.hold(1.0), n)
        gain = law.hold(1.0, age[self.stuck]) - young
        share = np.divide(gain, 2 * young, out=np.zeros(n), where=young > 0)
        found = []
        for row in rows:
            more = (share * (row[:n] + row[n : 2 * n]).T).T
            found.append(np.concatenate([row[:n] + more, row[n : 2 * n] + more, row[2 * n :]]))
        return tuple(found)

    def margin(self, margins: np.ndarray) -> np.ndarray:
        """Return mu_s p - |f| of each bottom block, shape (N_x,), in N; 0 where open."""
        n, margin = int(self.stuck.sum()), np.zeros(len(self.stuck))
        margin[self.stuck] = np.minimum(margins[:n], margins[n : 2 * n])
        return margin

    def split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        """Split a deviation w (m) with rate v (m/s), shape (n_q,), into modes and remainder."""
        if self._fine:
            return self._fine_split(w, v)
        a, w, v = self._dense_motion(w, v)
        energy = 0.5 * float(v @ (self.M * v) + w @ (self.K @ w))
        return Motion(a, max(energy, 0.0))

    def _fine_split(self, w: np.ndarray, v: np.ndarray) -> Motion:
        force, momentum = self._rows @ w, self._all_M * v
        force[: len(self.stuck)][self.stuck] = 0.0  # held
        a = self._fine.amplitudes(force, momentum)
        w, v = np.array([w, v]) - self._moving(a)
        force = self._rows @ w
        energy = max(0.5 * float(v @ (self._all_M * v) + w @ force), 0.0)
        if self._near is None:
            return Motion(a, energy)
        force += self._all_C @ v
        force[: len(self.stuck)][self.stuck] = 0.0  # held
        rate = 0.5 * float(force @ (force / self._all_M) + v @ (self._rows @ v))
        return Motion(a, energy, max(rate, 0.0))

    def _dense_motion(
        self, w: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w, v, a = w[self.free], v[self.free], np.zeros(len(self.rates), complex)
        for some, shapes in self._groups:
            rates = self.rates[some]
            found = np.array([self.C @ w + self.M * v, self.M * w]) @ shapes.T
            by_one, by_rate = found[:, : len(rates)] + 1j * found[:, len(rates) :]
            a[some] = (by_one + rates * by_rate) / self._norm[some]
            twice = self.weight[some] * a[some] * np.array([np.ones_like(rates), rates])
            moved = np.hstack([twice.real, -twice.imag]) @ shapes
            w, v = w - moved[0], v - moved[1]
        return a, w, v

    def stepped(self, rates: np.ndarray) -> np.ndarray:
        """Return the rates of amplitudes that RK4 makes of rates, 1/s."""
        if self.dt is None:
            return rates
        z = rates * self.dt
        growth = np.log(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))) / self.dt
        growth.real = np.minimum(growth.real, 0.0)
        return growth

    def tangent_at(self, q: np.ndarray, strained: float = STRAINED) -> tuple[Frozen, np.ndarray]:
        """Return the slider with the tangent of a state near q, and what bonds gain up to q's.

        That is this one, or one with the tangent at q if a bond has changed by `strained` k.
        """
        stiffer = self.stiffer(q)
        if np.abs(stiffer).max() <= strained * self.solver.scene.slider.k:
            return self, stiffer
        return Frozen(self.solver, self.stuck, self.dt, at=q, near=self), np.zeros_like(stiffer)

    def stiffer(self, q: np.ndarray) -> np.ndarray:
        """Return what stiffnesses of bonds gain up to a state q, shape (3, n_bonds), in N/m."""
        return self.solver.bond_tangents(q) - self._bonds

    def bend(self, a: np.ndarray) -> float:
        """Return about how far K, changed by modes of amplitude a, changes the margins, in N.

        A bond that is stretched or turned by a share of its length is stiffer by two such shares.
        """
        bent = self.solver.elongations(self._sum(a))
        share = 2 * float(np.abs(bent).max()) / self.solver.scene.slider.l
        return share * float((np.abs(self.modal) @ (self.weight * np.abs(a))).max())

    def growth_with(self, stiffer: np.ndarray) -> np.ndarray:
        """Return `growth`, of slow modes to first order where bonds are `stiffer`."""
        n = min(RENEWED, len(self.rates))
        if self._squares is None:
            phi = np.zeros((self.n_q, n), complex)
            phi[self.free] = self.phi[:, :n]
            x, z = self.solver.elongations(phi)
            squares = np.concatenate([x * x, 2 * x * z, z * z]).T
            self._squares = np.concatenate([squares.real, squares.imag])
        real, imag = np.split(self._squares @ stiffer.ravel(), 2)
        rates = self.rates.copy()
        rates[:n] -= (real + 1j * imag) / self._norm[:n]
        if len(self.free) > LARGE:
            self._squares = None
        return self.stepped(rates)

    def deviation(
        self, a: np.ndarray, s: float, growth: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return w (m) and w' (m/s) of modes of amplitude a a time s (s) later, shape (n_q,)."""
        later = a * np.exp((self.growth if growth is None else growth) * s)
        w, v = self._moving(later)
        return w, v


class _Opened:
    """Solves with some blocks opened, from the factorisation with all of them stuck.

    Freeing block i frees u_x, lifting it removes k_f from u_z; a block that opens is freed and
    lifted. With y the coordinates that are free in both cases, x the freed u_x and zeta the u_z of
    the lifted blocks,

        y = K^-1 (b + k_f E_z zeta - K_yx x),   zeta = E_z.y,   c = K_xy y + K_xx x .
    """

    def __init__(self, closed: Held, freed: np.ndarray, lifted: np.ndarray) -> None:
        N_x, k_f = len(closed.stuck), closed.k_f
        rows = closed._rows
        lift = np.zeros(rows.shape[0])
        lift[lifted + N_x] = -of(k_f, lifted)
        self.K = _Lowered(rows, lift)
        self.free = np.concatenate([freed, closed.free])
        self._solve, self._freed, self._k_f = closed._factor.solve, len(freed), of(k_f, lifted)
        self._z = np.searchsorted(closed.free, lifted + N_x)
        self._K_xy, K_xx = rows[freed][:, closed.free], rows[freed][:, freed].toarray()
        m, keys = len(lifted), [*(lifted + N_x), *freed]
        self.shapes = np.empty((len(closed.free), len(keys)))
        for column, key in enumerate(keys):
            if key not in closed._columns:
                if key < N_x:
                    side = -rows[[key]].toarray()[0, closed.free]
                else:
                    side = of(k_f, key - N_x) * (closed.free == key)
                closed._columns[key] = self._solve(side)
            self.shapes[:, column] = closed._columns[key]
        self._small = np.zeros((len(keys), len(keys)))
        self._small[:m] = -self.shapes[self._z]
        self._small[:m, :m] += np.eye(m)
        self._small[m:] = self._K_xy @ self.shapes
        self._small[m:, m:] += K_xx

    def lift(self) -> np.ndarray:
        """Return the compliance of each lifted block against a force upward, in m/N."""
        y = self.shapes[:, : len(self._z)] / self._k_f
        side = np.vstack([y[self._z], -(self._K_xy @ y)])
        return np.diag(y[self._z] + self.shapes[self._z] @ np.linalg.solve(self._small, side))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return the displacements under forces on the free coordinates."""
        return self.corrected(self._solve(b[self._freed :]), b)

    def corrected(self, y: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the same from the displacements y with all blocks stuck."""
        side = np.concatenate([y[self._z], b[: self._freed] - self._K_xy @ y])
        theta = np.linalg.solve(self._small, side)
        return np.concatenate([theta[len(self._z) :], y + self.shapes @ theta])


class _Lowered:
    """A sparse matrix plus a diagonal, which is not added: on large lattices that takes memory."""

    def __init__(self, rows: sp.csr_array, diagonal: np.ndarray) -> None:
        self.shape, self._rows, self._diagonal = rows.shape, rows, diagonal

    def __matmul__(self, q: np.ndarray) -> np.ndarray:
        return self._rows @ q + (self._diagonal * q.T).T

    def __getitem__(self, rows: np.ndarray | slice) -> sp.csr_array:
        return self._rows[rows] + sp.diags_array(self._diagonal).tocsr()[rows]

    def diagonal(self) -> np.ndarray:
        return self._rows.diagonal() + self._diagonal


def _times(factor: float | np.ndarray, rows: sp.csr_array) -> sp.csr_array:
    """Return sparse rows times a number, or each times its own."""
    return sp.diags_array(factor) @ rows if np.ndim(factor) else factor * rows
