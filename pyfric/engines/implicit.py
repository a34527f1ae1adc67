"""Non-smooth implicit steps: a Moreau-Jean scheme with Coulomb friction, in linear geometry.

One step from q, v to q', v' takes all forces at a middle state, q_m = q + h v_m/2 with
v_m = (v + v')/2, and what the interface does as impulses P_x, P_z:

    M (v' - v) = h (g(t + h/2) - K q_m - C v_m) + E (P_x, R_z) ,   q' = q + h v_m .

K holds the foundation under all blocks; where there is a gap, R_z takes it away again.

Friction is imposed on v', foundation pressure at the middle:

    stuck   v'_x = 0,         |P_x| <= mu_s P_z
    slip    sigma v'_x >= 0,  P_x = -sigma mu_k P_z
    closed  R_z = 0,  P_z = -h k_f u_z > 0                       (u_z of q_m)
    open    P_x = 0,  R_z = h k_f u_z, so that P_z = 0,  u_z >= 0

With W = E' A^-1 E, A = 2 M + h C + h^2 K/2 (factorised once), this is a complementarity problem of
2 N_x unknowns, solved by changing contact states one after the other: a block that would slip
backwards is held, of the held ones the one with the largest |P_x| - mu_s P_z is released. Between
such changes the scheme is the implicit midpoint rule: of second order, stable for every step.
Contact states change at step ends only, which is of first order. The energy budget closes to
rounding, but for steps in which a block leaves or meets the foundation.

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988);
M. Jean, The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Eng. 177, 235 (1999).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lu_factor, lu_solve

from pyfric.core import OPEN, STUCK, Status
from pyfric.engines.dynamic import Run
from pyfric.scene import SceneError
from pyfric.statics import BandedCholesky, damping, mass, stiffness

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.statics import StaticSolver

__all__ = ["ImplicitRun", "MoreauJean"]

TOL = 1e-12
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""
KEPT = 64
"""Factorisations of contact states that are kept."""


class _Impulses(NamedTuple):
    """What one step does at the interface: impulses in N s, and v_m of the bottom row in m/s."""

    P_x: np.ndarray
    P_z: np.ndarray
    R_z: np.ndarray
    v_x: np.ndarray


class MoreauJean:
    """Steps of one scene with one step length.

    Args:
        solver: static solver of the scene, in linear geometry.
        h: step, in s.
        u_drv0: u_x of the driven block at which F_T = 0 at t = 0, in m.
    """

    def __init__(self, solver: StaticSolver, h: float, u_drv0: float) -> None:
        scene = solver.scene
        N_x = scene.N_x
        self.scene, self.h, self.u_drv0 = scene, h, u_drv0
        self.M, self.C = mass(scene), damping(scene)
        self.K = stiffness(scene)
        self.load, self.row = solver.load, solver.driven_row
        A = (sp.diags_array(2 * self.M) + h * self.C + h * h / 2 * self.K).tocsr()
        self.A = BandedCholesky(A, *solver.banded(np.arange(len(self.M))))
        self.W = np.empty((2 * N_x, 2 * N_x))
        for i in range(2 * N_x):
            unit = np.zeros(len(self.M))
            unit[i] = 1.0
            self.W[:, i] = self.A.solve(unit)[: 2 * N_x]
        self.tol = TOL * h * scene.F_N / N_x
        self._factors: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def step(
        self, q: np.ndarray, v: np.ndarray, mode: np.ndarray, t: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, _Impulses] | None:
        """Return v_m (shape (n_q,)), v', the new contact states and the impulses; None for none.

        Args:
            q, v: coordinates (m, rad) and their rates at t, shape (n_q,).
            mode: contact states at t, shape (N_x,).
            t: time, in s.
        """
        h, N = self.h, self.scene.N_x
        drive = self.scene.driver.V * (t + h / 2) + self.scene.d * self.u_drv0
        push = (self.scene.driver.K * self.scene.d * drive) * self.row
        right = 2 * self.M * v + h * (self.load + push - self.K @ q)
        free = self.A.solve(right)
        found = self._contacts(q, v, mode, free)
        if found is None:
            return None
        slip, closed, now = found
        impulse = np.zeros(len(q))
        impulse[:N] = now.P_x
        impulse[N : 2 * N] = now.R_z
        v_m = free + self.A.solve(impulse)
        held = closed & (slip == 0)
        v_m[:N][held] = v[:N][held] / 2
        v_new = 2 * v_m - v
        v_new[:N][held] = 0.0
        return v_m, v_new, np.where(closed, slip, OPEN).astype(np.int32), now

    def _contacts(
        self, q: np.ndarray, v: np.ndarray, mode: np.ndarray, free: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, _Impulses] | None:
        """Return directions of slip, closed blocks and impulses; None where nothing is found."""
        N, mu_s = self.scene.N_x, self.scene.interface.mu_s
        slip, closed = np.where(mode == OPEN, 0, mode), mode != OPEN
        stopped = np.zeros(N, dtype=bool)
        v_x, u_z = v[:N], q[N : 2 * N]
        for tries in range(20 * N + 100):
            now = self._solve(v_x, u_z, slip, closed, free)
            depth = np.where(closed, -now.P_z, -now.R_z)
            if (depth > self.tol).any():
                wrong = depth > self.tol
                if tries > 20:
                    wrong = depth == depth.max()
                lands = wrong & ~closed
                closed = closed ^ wrong
                along = np.sign(2 * now.v_x - v_x).astype(np.int32)
                slip = np.where(lands, along, np.where(closed, slip, 0))
                continue
            back = closed & (slip * (2 * now.v_x - v_x) * self.scene.m < -self.tol)
            if back.any():
                slip, stopped = np.where(back, 0, slip), stopped | back
                continue
            over = np.where(closed & (slip == 0), np.abs(now.P_x) - mu_s * now.P_z, -np.inf)
            over[stopped & (now.P_x * mode <= 0)] = -np.inf  # what stops a block may do so
            i = int(np.argmax(over))
            if not over[i] > self.tol:
                return slip, closed, now
            slip = slip.copy()
            slip[i] = 1 if now.P_x[i] < 0 else -1
        return None

    def _solve(
        self,
        v_x: np.ndarray,
        u_z: np.ndarray,
        slip: np.ndarray,
        closed: np.ndarray,
        free: np.ndarray,
    ) -> _Impulses:
        """Return impulses and v_m of the bottom row in one contact state."""
        N, h, k_f = self.scene.N_x, self.h, self.scene.k_f
        b = free[: 2 * N]
        held = closed & (slip == 0)
        foundation = -h * k_f * (u_z + h / 2 * b[N:])
        friction = self.scene.interface.mu_k * slip
        right = np.concatenate(
            [
                np.where(held, self.scene.m * (v_x / 2 - b[:N]), -friction * foundation),
                np.where(closed, 0.0, -foundation),
            ]
        )
        key = slip.tobytes() + closed.tobytes()
        if key not in self._factors:
            while len(self._factors) >= KEPT:
                del self._factors[next(iter(self._factors))]
            matrix = np.eye(2 * N)
            i = np.flatnonzero(held)
            matrix[i] = self.scene.m * self.W[i]
            i = np.flatnonzero(slip)
            stiff = h * h / 2 * k_f
            matrix[i] -= (friction[i] * stiff)[:, None] * self.W[N + i]
            i = N + np.flatnonzero(~closed)
            matrix[i] -= stiff * self.W[i]
            self._factors[key] = lu_factor(matrix)
        P = lu_solve(self._factors[key], right)
        at = b + self.W @ P
        P_z = np.where(closed, -h * k_f * (u_z + h / 2 * at[N:]), 0.0)
        return _Impulses(P[:N], P_z, P[N:], at[:N])


class ImplicitRun(Run):
    """A run of full dynamics with implicit steps."""

    steppers = ("moreau_jean",)
    switchings = ("step_end",)
    geometries = ("linear",)

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        interface = self.scene.interface
        if interface.weakens:
            allowed = "0 m with method = 'moreau_jean'"
            raise SceneError("interface.d_c", interface.d_c, "m", allowed)
        self.scheme = MoreauJean(self.solver.known, self.state.dt, self.state.u_drv0)

    def make_steps(self, state: State, n_steps: int) -> Status:
        """Make up to n_steps; the state changes in place, and the log is filled."""
        known, scheme, N_x = self.solver.known, self.scheme, self.scene.N_x
        log = self.log
        log.n_switch = log.n_quiet = log.tried = 0
        q = known.coordinates(state.y[:, :2], state.rod[:3])
        v = known.coordinates(state.y[:, 2:], state.rod[3:])
        status = Status.DONE
        for _ in range(n_steps):
            if log.n_switch + N_x > log.switch_r.shape[1] or log.n_quiet >= log.quiet_r.shape[1]:
                status = Status.LOG_FULL
                break
            made = scheme.step(q, v, state.mode, state.t)
            log.tried += 1
            if made is None:
                log.t, status = state.t, Status.ENDLESS
                break
            v_m, v, mode, now = made
            if self.method.budget:
                self._add_works(state, q + state.dt / 2 * v_m, v_m, now)
            q = q + state.dt * v_m
            state.step += 1
            self._switch(state, q, mode, now)
        state.y[:, :2], state.rod[:3] = known.displacements(q)
        state.y[:, 2:], state.rod[3:] = known.displacements(v)
        return status

    def _stuck_at(self, status: Status) -> str:
        return (
            f"no contact state (stick, slip, gap of each block) satisfies the friction law in the "
            f"step of dt = {self.state.dt:g} s from t = {self.log.t:.9g} s; reduce dt"
        )

    def _add_works(self, state: State, q: np.ndarray, v: np.ndarray, now: _Impulses) -> None:
        scene, scheme, h = self.scene, self.scheme, state.dt
        u = float(scheme.row @ q)
        drive = scene.driver.V * (state.t + h / 2)
        F_T = scene.driver.K * (drive - scene.d * (u - state.u_drv0))
        state.work += h * np.array([F_T * scene.driver.V, float(scheme.load @ v)])
        state.dissipated[0] += h * float(v @ (scheme.C @ v))
        state.heat -= now.P_x * v[: scene.N_x]

    def _switch(self, state: State, q: np.ndarray, mode: np.ndarray, now: _Impulses) -> None:
        """Take over new contact states and log them, as pyfric_contact does."""
        scene, log = self.scene, self.log
        N_x = scene.N_x
        p = scene.k_f * np.maximum(-q[N_x : 2 * N_x], 0.0)
        state.slack[:] = (scene.interface.mu_s * now.P_z - np.abs(now.P_x)) / state.dt
        if (mode == state.mode).all():
            return
        was_active = ((np.abs(state.mode) == 1) & (state.corner == 0)).any()
        for i in np.flatnonzero(mode != state.mode):
            old = state.mode[i]
            if abs(old) != 1:
                state.corner[i] = p[i] < self.model.constants[17]
            slip = 0.0 if mode[i] == STUCK else state.slip[i]
            state.s_0[i] = slip - (mode[i] * q[i] if abs(mode[i]) == 1 else 0.0)
            state.mode[i] = mode[i]
            log.switch_i[:, log.n_switch] = i, old, mode[i], state.corner[i]
            log.switch_r[:, log.n_switch] = state.step, state.t, q[i], p[i]
            log.n_switch += 1
        active = ((np.abs(mode) == 1) & (state.corner == 0)).any()
        if active != was_active:
            u = float(self.scheme.row @ q)
            F_T = scene.driver.K * (scene.driver.V * state.t - scene.d * (u - state.u_drv0))
            log.quiet_i[:, log.n_quiet] = 1 if active else -1, *mode
            log.quiet_r[:, log.n_quiet] = state.step, state.t, F_T, *q[:N_x]
            log.n_quiet += 1
