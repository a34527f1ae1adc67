"""Static equilibria: the loaded slider at the start, and the slider at given interface positions.

`StaticSolver` holds the bottom row at given u_x and finds the state of rest of everything else. The
vertical contact is an active set: a block with u_z < 0 is closed and carries p = -k_f u_z, any
other one is open and carries neither p nor friction, so its u_x is free.

`loaded_state` is the start of a run: F_N applied, F_T = 0. The bottom row is held at u_x = 0 unless
a block would need more than mu_s p. Then F_N is applied proportionally and quasi-statically.
In linear geometry that loading is self-similar: a block that slips at all does so from
the first newton on, always in one direction, so the final state alone decides:

    stuck     u_x = 0,            |f| <= mu_s p
    slipped   sign(u_x) = s != 0, f = -s mu_k p
    open      p = 0,              f = 0

For mu_s = mu_k this is a linear complementarity problem. For mu_s > mu_k the same conditions hold
with mu_k on blocks that slipped, which leaves several solutions; the rule is to release the block
with the largest |f| - mu_s p, one at a time, to solve again, and to hold again blocks that moved
along their friction force. In finite geometry the same conditions are imposed at full load.

Forces are compared relative to F_N/N_x, displacements relative to others, never absolutely: in
linear geometry, doubling F_N and all displacements doubles every result bit for bit.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from pyfric.operators import (
    Geometry,
    bonds,
    check_geometry,
    coordinates,
    driven_dof,
    spring_forces,
    stiffness,
)

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["Equilibrium", "EquilibriumError", "StaticSolver", "loaded_state", "solve_static"]

MAX_NEWTON = 60
"""Largest number of Newton steps for one contact set."""
ACCEPTED = 1e-9
"""Largest accepted residual force, in units of F_N/N_x, where rounding forbids a smaller one."""
CONTACT_TOL = 1e-11
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""
KEPT = 12
"""Number of factorisations a solver keeps."""


class EquilibriumError(RuntimeError):
    """No equilibrium was found.

    Attributes:
        residual: largest force left over, in N (NaN if there is none to name).
        limit: largest residual that would have been accepted, in N.
        iterations: iterations done.
    """

    def __init__(self, what: str, residual: float, limit: float, iterations: int) -> None:
        self.residual, self.limit, self.iterations = residual, limit, iterations
        super().__init__(
            f"no equilibrium: {what} (residual {residual:.3g} N, limit {limit:.3g} N, "
            f"{iterations} iterations)"
        )


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """A state of rest. Arrays are read-only and run from left to right.

    Attributes:
        u: displacements, shape (N_z, 2, N_x), in m; [j, 0] is u_x of row j, [j, 1] is u_z.
        rod: X (m), Z (m), phi (rad), shape (3,); zeros without a rod.
        F_T: force of the driver, in N, positive where it pushes.
        f: friction force on each block in +x, shape (N_x,), in N.
        tau: -d f, shape (N_x,), in N: positive against driving, so that sum(tau) = F_T.
        p: foundation force on each block, shape (N_x,), in N.
        open: p = 0, shape (N_x,), bool.
        slipped: blocks that slipped while F_N was applied, shape (N_x,), bool (`loaded_state`).
        drive: displacement V t of the driver since t = 0, in m.
        u_drv0: u_x of the driven block at which drive = 0 gives F_T = 0, in m.
        residual: largest force left over, in N.
        iterations: number of Newton steps, all contact sets together.
    """

    u: np.ndarray
    rod: np.ndarray
    F_T: float
    f: np.ndarray
    tau: np.ndarray
    p: np.ndarray
    open: np.ndarray
    slipped: np.ndarray
    drive: float
    u_drv0: float
    residual: float
    iterations: int

    def __post_init__(self) -> None:
        for name in ("u", "rod", "f", "tau", "p", "open", "slipped"):
            getattr(self, name).setflags(write=False)


class _Contact(NamedTuple):
    """What is imposed on the bottom blocks, each of shape (N_x,)."""

    held: np.ndarray  # u_x is given (bool)
    closed: np.ndarray  # touches the foundation (bool)
    slip: np.ndarray  # direction of slip: f = -slip mu_k p (int8; 0 also where held or free)

    @property
    def key(self) -> bytes:
        return b"".join(part.tobytes() for part in self)


class StaticSolver:
    """States of rest of one scene, for given interface displacements and driver positions.

    Factorisations are kept by contact set and taken at one state, the loaded one, so that results
    do not depend on what was solved before. In finite geometry they drive a chord Newton
    iteration; where it converges slowly, the tangent is renewed.

    Args:
        scene: the scene.
        geometry: "linear" or "finite".
        u_drv0: u_x of the driven block at drive = 0 and F_T = 0, in m; None means that of the
            loaded state.

    Attributes:
        loaded: the loaded equilibrium with F_T = 0 (an `Equilibrium`).

    Raises:
        ValueError: unknown geometry.
        EquilibriumError: the scene has no loaded equilibrium.

    Source: PRL 107, 074301 (2011).
    """

    def __init__(
        self, scene: Scene, geometry: Geometry = "linear", *, u_drv0: float | None = None
    ) -> None:
        check_geometry(geometry)
        self.scene, self.geometry = scene, geometry
        N_x, N_z = scene.N_x, scene.N_z
        self._lattice, self._T = bonds(scene), coordinates(scene)
        self._T_transposed = self._T.T.tocsr()
        self._unit = scene.F_N / N_x
        self._load = np.zeros(2 * N_x * N_z)
        self._load[-N_x:] = -scene.load
        self._h = driven_dof(scene)
        # u_x and u_z of the bottom row are the first 2 N_x coordinates, because N_z >= 2.
        self._x, self._z = slice(0, N_x), slice(N_x, 2 * N_x)
        self._stiffest = max(12 * scene.slider.k, scene.k_f, scene.driver.K)
        # A residual torque on the rod counts as a force at its end.
        self._arm = np.ones(self._T.shape[1])
        if scene.rigid:
            self._arm[-1] = 2 / scene.slider.L
        self._reference: np.ndarray | None = None  # q at which factorisations are taken
        self._factors: dict[tuple[bool, bytes], SuperLU] = {}
        self._K: sp.csr_array | None = None
        self._u_drv0 = 0.0
        self.loaded = self._loaded()
        self._reference = self._coordinates_of(self.loaded)
        self._factors.clear()
        self._K = None
        self._u_drv0 = self.loaded.u_drv0 if u_drv0 is None else float(u_drv0)

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray | None = None,
        start: Equilibrium | None = None,
    ) -> Equilibrium:
        """Return the equilibrium with the interface held.

        Args:
            u_x_bottom: u_x of the bottom blocks, shape (N_x,), in m; not used where free.
            drive: displacement V t of the driver since t = 0, in m.
            free: blocks without friction (open ones), shape (N_x,), bool; their u_x is a
                result. They carry p if they touch the foundation. None means no block.
            start: state from which the iteration starts; None means the loaded state.

        A held block that lifts off is freed. If it comes down again it is held again; a block that
        lifts off a second time stays free, with p = k_f max(-u_z, 0).

        Returns:
            The equilibrium; F_T = K (drive - d (u_x - u_drv0)) at the driven block.

        Raises:
            ValueError: an argument has the wrong shape or is not finite.
            EquilibriumError: no equilibrium was found.
        """
        N_x = self.scene.N_x
        given = np.array(u_x_bottom, dtype=float)
        drive = float(drive)
        frictionless = np.zeros(N_x, bool) if free is None else np.array(free, dtype=bool)
        for name, value in (("u_x_bottom", given), ("free", frictionless)):
            if value.shape != (N_x,):
                raise ValueError(f"{name}: shape {value.shape}, expected ({N_x},)")
        if not (np.isfinite(given[~frictionless]).all() and np.isfinite(drive)):
            raise ValueError("u_x_bottom and drive must be finite")
        begin = self.loaded if start is None else start
        if begin.u.shape != self.loaded.u.shape:
            raise ValueError(f"start.u: shape {begin.u.shape}, expected {self.loaded.u.shape}")
        q = self._coordinates_of(begin)
        closed, lifted = ~begin.open, np.zeros(N_x, dtype=int)
        no_slip, steps = np.zeros(N_x, dtype=np.int8), 0
        for _ in range(4 * N_x + 20):
            contact = _Contact(closed & ~frictionless, closed, no_slip)
            q[self._x][contact.held] = given[contact.held]
            q, residual, used = self._newton(q, contact, drive)
            steps += used
            wrong = self._wrong_contact(q[self._z], closed)
            if not wrong.any():
                return self._result(q, contact, drive, residual, steps)
            lifted += wrong & closed
            frictionless |= lifted > 1
            closed = closed ^ wrong
        raise EquilibriumError("the set of open blocks does not settle", residual, 0.0, steps)

    # --- forces and Newton's method --------------------------------------------------------------

    def _forces(
        self, q: np.ndarray, contact: _Contact, drive: float | None
    ) -> tuple[np.ndarray, float]:
        """Return the force on each generalised coordinate (friction of held blocks excluded), F_T.

        drive = None means that there is no driver spring.
        """
        scene, x, z = self.scene, self._x, self._z
        u = self._T @ q
        force = spring_forces(self._lattice, u, self.geometry)
        force += self._load
        p = -scene.k_f * u[z] * contact.closed
        force[z] += p
        force[x] -= contact.slip * (scene.interface.mu_k * p)
        F_T = 0.0
        if drive is not None:
            F_T = scene.driver.K * (drive - scene.d * (u[self._h] - self._u_drv0))
            force[self._h] += scene.d * F_T
        force = self._T_transposed @ force
        if scene.rigid:
            force[-2] -= scene.F_N
            force[-1] -= scene.kappa * q[-1]
        return force, float(F_T)

    def _tangent(self, contact: _Contact, driven: bool, q: np.ndarray | None) -> SuperLU:
        """Factorise the tangent stiffness of the unknown coordinates at q (None: undeformed)."""
        if q is self._reference and self._K is not None:
            K = self._K
        else:
            u = None if q is None else self._T @ q
            K = stiffness(
                self.scene,
                closed=np.zeros(self.scene.N_x, dtype=bool),
                driver=False,
                lattice=self._lattice,
                u=u,
                geometry=self.geometry,
            )
            if q is self._reference:
                self._K = K
        N_x, n = self.scene.N_x, K.shape[0]
        foundation = np.zeros(n)
        foundation[self._z] = self.scene.k_f * contact.closed
        K = K + sp.diags_array(foundation)
        if driven:
            row = self._T[[self._h]]
            K = K + self.scene.driver.K * (row.T @ row)
        if contact.slip.any():  # d/du_z of the friction force -slip mu_k p, p = -k_f u_z
            coupling = -contact.slip * (self.scene.interface.mu_k * self.scene.k_f)
            K = K + sp.diags_array(coupling.astype(float), offsets=N_x, shape=(n, n))
        unknown = self._unknown(contact)
        K = K.tocsr()[unknown][:, unknown].tocsc()
        options = {} if contact.slip.any() else {"SymmetricMode": True}
        try:
            return splu(K, permc_spec="MMD_AT_PLUS_A", options=options)
        except RuntimeError as error:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0) from error

    def _factor(self, contact: _Contact, driven: bool) -> SuperLU:
        """Return the factorisation at the reference state, from the store if it is there."""
        key = (driven, contact.key)
        if key not in self._factors:
            while len(self._factors) >= KEPT:
                del self._factors[next(iter(self._factors))]
            self._factors[key] = self._tangent(contact, driven, self._reference)
        return self._factors[key]

    def _unknown(self, contact: _Contact) -> np.ndarray:
        """Return the indices of the coordinates that are not held."""
        unknown = np.ones(self._T.shape[1], dtype=bool)
        unknown[self._x] = ~contact.held
        return np.flatnonzero(unknown)

    def _newton(
        self, q: np.ndarray, contact: _Contact, drive: float | None
    ) -> tuple[np.ndarray, float, int]:
        """Return q at rest for one contact set, the residual force, the number of steps.

        The iteration ends at the level of rounding, or where the residual has stopped to fall at
        less than `ACCEPTED`. Linear geometry takes one step and a refinement.
        """
        unknown = self._unknown(contact)
        factor = self._factor(contact, drive is not None)
        limit = ACCEPTED * self._unit
        best, least, previous = q, np.inf, np.inf
        for step in range(MAX_NEWTON + 1):
            force = self._forces(q, contact, drive)[0][unknown]
            residual = float(np.max(np.abs(force * self._arm[unknown])))
            if not np.isfinite(residual):
                break
            if residual < least:
                best, least = q, residual
            rounding = 2.0**-52 * self._stiffest * float(np.max(np.abs(q[: 2 * len(self._z_all)])))
            if residual <= 2.0**-50 * self._unit + rounding / 4:
                break
            if residual > 0.5 * previous:
                if least <= limit + 16 * rounding:
                    break
                factor = self._tangent(contact, drive is not None, q)
            previous = residual
            q = q.copy()
            with np.errstate(all="ignore"):
                q[unknown] += factor.solve(force)
        if not least <= limit + 16 * rounding:
            raise EquilibriumError("Newton's method does not converge", least, limit, step)
        return best, least, step
