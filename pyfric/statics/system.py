"""The slider in generalised coordinates: forces, tangents, and their factorisations.

Coordinates q are the displacements of all blocks, row by row from the interface upward. Under a
rod, X, Z and phi replace the top row (`operators`). The first 2 N_x coordinates are always u_x and
u_z of the bottom row, because a rod has at least one row below it.
"""

from __future__ import annotations

import contextlib
import copy
import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.scene import PrescribedLoad
from pyfric.statics.banded import BandedCholesky
from pyfric.statics.condensation import LARGE
from pyfric.statics.lattice import (
    assembled,
    bonds,
    spring_bends,
    spring_forces,
    spring_tangents,
)
from pyfric.statics.memory import Memory
from pyfric.statics.operators import coordinates, damping, differences, driven_dofs, ground
from pyfric.statics.rest import EquilibriumError
from pyfric.statics.rows import ends

if TYPE_CHECKING:
    from typing import Self

    from pyfric.scene import Geometry, OnDriven, Scene
    from pyfric.statics.contact import States

LEADING = 13
"""Leading bits of a Newton step that are used, counted from the displacement of the stiffest spring
under the residual force. Fewer bits need more steps; with more bits, results show the rounding of
LAPACK."""
KEPT = 12
"""Number of stored factorisations. On large lattices only one factorisation is stored."""


class System:
    """The slider of one scene in coordinates, with any contact states.

    Args:
        scene: the scene.
        geometry: "linear" or "finite".

    Attributes:
        u_drv0: u_x of the driven blocks at drive = 0 and F_T = 0, in m: see `Scene.u_driven`.
        pressed: blocks without friction that touch the foundation, (N_x,), bool. Blocks that are
            open in the loaded state are left out once this state is computed.
        kept: results that engines store with the slider, by name.
    """

    u_drv0: OnDriven
    kept: dict[str, Any]

    def __init__(self, scene: Scene, geometry: Geometry) -> None:
        self.scene, self.geometry, self.u_drv0 = scene, geometry, 0.0
        self.pressed, self.kept = scene.bare, {}
        self._lattice, self._T = bonds(scene), coordinates(scene)
        self._springs = functools.partial(spring_forces, self._lattice)
        if geometry == "finite":
            self._springs = core.bond_forces(scene, geometry)
        n = self._T.shape[1]
        self._loads: tuple[float, float] | None = None
        self._load = np.zeros((scene.N_z, 2, scene.N_x))
        self._load[-1] = scene.shear, -scene.load
        self._load[:, 1] -= scene.weights
        # phi times arm is the displacement of the end of the rod; a torque over arm is a force.
        self.arm = np.ones(n)
        if scene.rigid:
            self.arm[-1] = scene.slider.L / 2
        self._stiffest = max(12 * scene.slider.k, np.max(scene.k_f), scene.driver.K, scene.k_top)
        self._factors: Memory[BandedCholesky | SuperLU] = Memory(1 if n > LARGE else KEPT)
        self.linearise(np.zeros(n))

    def linearise(self, q: np.ndarray) -> None:
        """Use the tangent at q for all later factorisations."""
        self._tangents = self.bond_tangents(q)
        self._factors.clear()

    def under(self, load: tuple[float, float] | None) -> Self:
        """Return this slider, or a copy of it under other loads F_N and T (N) than at t = 0."""
        if load is None:
            return self
        scene, other = self.scene, copy.copy(self)
        other.__dict__.pop("load", None)
        other._loads, other._load = load, self._load * (load[0] / scene.F_N)
        other._load[:, 1] += scene.weights * (load[0] / scene.F_N - 1)
        if not scene.rigid:
            tau = other._load[-1, 0] if isinstance(scene.top, PrescribedLoad) else 0.0
            columns = scene.shares[1]
            other._load[-1, 0] = tau + scene.d * load[1] / columns.sum() * columns
        return other

    # --- coordinates -----------------------------------------------------------------------------

    def coordinates(self, u: np.ndarray, rod: np.ndarray) -> np.ndarray:
        """Return q, (n_q,), from u, (N_z, 2, N_x), and rod, (3,), or q' from their velocities."""
        q = np.zeros(len(self.arm))
        n = len(q) - 3 if self.scene.rigid else len(q)
        q[:n] = u.reshape(-1)[:n]
        q[n:] = rod[: len(q) - n]
        return q

    def displacements(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u, shape (N_z, 2, N_x), and rod, shape (3,), from q; a rod sets the top row."""
        if not self.scene.rigid:
            return q.reshape(self._load.shape).copy(), np.zeros(3)
        X, Z, phi = rod = q[-3:].copy()
        top = np.full(self.scene.N_x, X), Z + phi * self.scene.x
        return np.concatenate([q[:-3], *top]).reshape(self._load.shape), rod

    def translation(self) -> np.ndarray:
        """Return the coordinates of a unit displacement along the interface, shape (n_q,)."""
        u = np.zeros(self._load.shape)
        u[:, 0] = 1.0
        return self.coordinates(u, np.array([1.0, 0.0, 0.0]))

    def largest(self, q: np.ndarray) -> float:
        """Return the largest stiffness times the largest displacement at q, in N.

        Rounding errors of forces are this value times 2^-52 times a small number of operations.
        """
        return self._stiffest * float(np.max(np.abs(q * self.arm)))

    def leading(self, step: np.ndarray, arm: np.ndarray, residual: float) -> np.ndarray:
        """Return a step with its leading bits only; later steps correct the omitted part.

        LAPACK kernels round in different orders, which changes the last bits of a step. Without its
        last bits each step, and so the state, is the same with all kernels.

        Args:
            step: displacements of unknown coordinates, shape (n,).
            arm: their arms, shape (n,).
            residual: largest force that the step removes, in N; it sets the precision.
        """
        unit = 2.0 ** (np.frexp(residual / self._stiffest)[1] - LEADING)
        return np.rint(step * arm / unit) * unit / arm

    # --- forces ----------------------------------------------------------------------------------

    @functools.cached_property
    def load(self) -> np.ndarray:
        """Constant forces on the coordinates, shape (n_q,), in N."""
        load = self._T.T @ self._load.ravel()
        if self.scene.rigid:
            load[-2] -= self._on_rod
        return load

    @property
    def _on_rod(self) -> float:
        """Downward force on the rod, F_N plus the weight of the rod, in N."""
        F_N = self.scene.F_N if self._loads is None else self._loads[0]
        return F_N + self.scene.M_rod * self.scene.slider.g

    @functools.cached_property
    def _driven(self) -> sp.csr_array:
        """Derivatives of u_x of the driven blocks by the coordinates, shape (n_q, n_driven)."""
        return self._T[driven_dofs(self.scene)].T.tocsr()

    @functools.cached_property
    def driven_row(self) -> np.ndarray:
        """Derivatives of the mean u_x of the driven blocks by the coordinates, shape (n_q,)."""
        return self._driven.mean(axis=1)

    @functools.cached_property
    def push(self) -> np.ndarray:
        """Forces on the coordinates per displacement of the driver, K d du_h/dq, (n_q,), in N/m."""
        return self.scene.driver.K * self.scene.d * self.driven_row

    @functools.cached_property
    def unpushed(self) -> np.ndarray:
        """Forces of the driver on the coordinates at u = 0 and drive = 0, shape (n_q,), in N."""
        n = self.scene.n_driven
        return self._driven @ np.broadcast_to(self.scene.driver.K / n * self.u_drv0, n)

    def of_springs(self, q: np.ndarray) -> np.ndarray:
        """Return the forces of all bonds on the coordinates at q, shape (n_q,), in N."""
        return self._on_coordinates(self._springs(self.displacements(q)[0]))

    def _on_coordinates(self, force: np.ndarray) -> np.ndarray:
        """Return generalised forces, (n_q,), from forces on blocks, (N_z, 2, N_x), in N."""
        found = self.coordinates(force, np.zeros(3))
        if self.scene.rigid:
            x, z = force[-1]
            found[-3:] = x.sum(), z.sum(), (self.scene.x * z).sum()  # without BLAS
        return found

    def forces(
        self, q: np.ndarray, contact: States, drive: float | None
    ) -> tuple[np.ndarray, float]:
        """Return the forces on the coordinates, without friction of stuck blocks, and F_T, in N.

        drive = None means that there is no driver spring.
        """
        scene, (u, _), F_T = self.scene, self.displacements(q), 0.0
        force = self._springs(u) + self._load
        if scene.k_top:
            force[-1, 0] -= scene.k_top * u[-1, 0]
        p = -scene.k_f * (u[0, 1] + scene.gap) * contact.closed
        force[0, 1] += p
        force[0, 0] -= contact.slip * contact.law.slide(p)
        if drive is not None:
            moved = scene.u_driven(u) - self.u_drv0
            F_T = scene.driver_force(drive, moved, 0.0)
            each = scene.driver.K / scene.n_driven * (drive - scene.d * moved)
            force[scene.driven] += scene.d * np.reshape(each, force[scene.driven].shape)
        force = self._on_coordinates(force)
        if scene.rigid:
            force[-2:] -= self._on_rod, scene.kappa * q[-1]
        return force, F_T

    # --- tangents --------------------------------------------------------------------------------

    def bond_tangents(self, q: np.ndarray) -> np.ndarray:
        """Return the stiffnesses xx, xz and zz of each bond at q, shape (3, n_bonds), in N/m."""
        du = self.elongations(q) if self.geometry == "finite" else None
        return spring_tangents(self._lattice, du)

    @functools.cached_property
    def _C(self) -> sp.csr_array:
        return damping(self.scene)

    def damping(self, q: np.ndarray) -> sp.csr_array:
        """Return the damping matrix at q, shape (n_q, n_q), in N s/m."""
        if self.geometry == "linear" or self.scene.slider.dashpots == "full":
            return self._C
        return damping(self.scene, self.elongations(q))

    @functools.cached_property
    def _differences(self) -> sp.csr_array:
        return differences(self._lattice, self._T)

    @functools.cached_property
    def _gather(self) -> sp.csr_array:
        return self._differences.T.tocsr()

    def elongations(self, shapes: np.ndarray) -> list[np.ndarray]:
        """Return du_x and du_z over each bond, shape (n_bonds, n), in deformations (n_q, n)."""
        found = self._differences @ shapes
        return [found[: len(found) // 2], found[len(found) // 2 :]]

    def largest_turn(self, q: np.ndarray) -> float:
        """Return the largest relative displacement of the ends of a bond, over l."""
        longest = max(np.abs(bonds).max() for bonds in self.elongations(q))
        return float(longest) / self.scene.slider.l

    def stiffened(self, shape: np.ndarray, stiffer: np.ndarray) -> np.ndarray:
        """Return forces (n_q,) of bond stiffness changes (3, n_bonds) in a deformation (n_q,)."""
        (x, z), (xx, xz, zz) = self.elongations(shape), stiffer
        return self._gather @ np.concatenate([xx * x + xz * z, xz * x + zz * z])

    def bends(self, q: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return second derivatives of spring forces along q + s rate at s = 0, shape (n_q,).

        In linear geometry the derivatives are zero.
        """
        if self.geometry == "linear":
            return np.zeros_like(q)
        forces = spring_bends(self._lattice, self.elongations(q), self.elongations(rate))
        return self._gather @ np.concatenate(forces)

    @functools.cached_property
    def _K(self) -> sp.csr_array:
        """Stiffness of all bonds in linear geometry, which does not depend on the state."""
        return assembled(self._differences, spring_tangents(self._lattice))

    def grounded(self, mode: np.ndarray, *, driven: bool) -> np.ndarray:
        """Return the stiffness from each coordinate to the ground, shape (n_q,), in N/m."""
        return ground(self.scene, self._T, mode != OPEN, driver=driven)

    def stiffness(self, of_bonds: np.ndarray, mode: np.ndarray, *, driven: bool) -> sp.csr_array:
        """Return the stiffness of bonds, foundation and driver, shape (n_q, n_q), in N/m.

        Args:
            of_bonds: from `bond_tangents`.
            mode: contact states, shape (N_x,).
            driven: whether the driver's spring is attached.
        """
        held = self.grounded(mode, driven=driven)
        if self.geometry == "linear":
            return (self._K + sp.diags_array(held)).tocsr()
        return assembled(self._differences, of_bonds, held)

    def tangents(self, mode: np.ndarray) -> sp.csr_array:
        """Return the tangent stiffness of `linearise` with foundation and driver, (n_q, n_q)."""
        return self.stiffness(self._tangents, mode, driven=True)

    def factor(
        self,
        mode: np.ndarray,
        *,
        driven: bool,
        friction: np.ndarray | float = 0.0,
        q: np.ndarray | None = None,
    ) -> BandedCholesky | SuperLU:
        """Return the factorisation of the tangent of `linearise`, for coordinates not held.

        Args:
            mode: contact states, shape (N_x,).
            driven: whether the driver's spring is attached.
            friction: signed friction of slipping blocks over u_z, shape (N_x,), in N/m.
            q: coordinates, shape (n_q,), at which to take another tangent. The factorisation of
                this tangent is not stored.
        """

        def make() -> BandedCholesky | SuperLU:
            of_bonds = self._tangents if q is None else self.bond_tangents(q)
            return self._factorised(self.stiffness(of_bonds, mode, driven=driven), mode, friction)

        return make() if q is not None else self._factors.made((driven, mode.tobytes()), make)

    def unknown(self, mode: np.ndarray) -> np.ndarray:
        """Return the indices of the coordinates that are not held."""
        unknown = np.ones(len(self.arm), dtype=bool)
        unknown[ends(self.scene.N_x).u_x] = mode != STUCK
        return np.flatnonzero(unknown)

    def _factorised(
        self, K: sp.csr_array, mode: np.ndarray, friction: np.ndarray | float = 0.0
    ) -> BandedCholesky | SuperLU:
        """Factorise K with friction for the coordinates not held; the slider must be supported."""
        N_x, unknown, rubs = self.scene.N_x, self.unknown(mode), np.any(friction)
        if rubs:  # friction couples u_x to u_z, N_x columns to the right
            coupling = np.zeros(K.shape[0] - N_x)
            coupling[ends(N_x).u_x] = friction
            K = (K + sp.diags_array(coupling, offsets=N_x)).tocsr()
        try:
            if not rubs:
                with contextlib.suppress(np.linalg.LinAlgError):  # not positive definite
                    return BandedCholesky(K, unknown, *self.banded(unknown))
            options = {} if rubs else {"SymmetricMode": True}
            return splu(K[unknown][:, unknown].tocsc(), permc_spec="MMD_AT_PLUS_A", options=options)
        except RuntimeError as error:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0) from error
        except MemoryError as error:
            what = f"not enough memory to factorise {len(unknown)} unknowns"
            raise EquilibriumError(what, np.nan, 0.0, 0) from error

    def banded(self, unknown: np.ndarray) -> tuple[np.ndarray, int]:
        """Return the order with the narrowest band, rod last, and the number of rod unknowns."""
        scene, n_rod = self.scene, 3 if self.scene.rigid else 0
        row, i = np.divmod(unknown[: len(unknown) - n_rod], scene.N_x)
        tall = scene.N_z > scene.N_x
        order = np.argsort(unknown[: len(unknown) - n_rod] if tall else i * (2 * scene.N_z) + row)
        return np.append(order, np.arange(len(order), len(unknown))), n_rod
