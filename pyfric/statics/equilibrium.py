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
with the largest |f| - mu_s p, one at a time (equal ones together), to solve again, and to hold
again blocks that moved along their friction force. In finite geometry the same conditions are
imposed at full load.

Forces are compared relative to F_N/N_x, displacements relative to others, never absolutely: in
linear geometry, doubling F_N and all displacements doubles every result bit for bit.

A chain does not slip while it is loaded: its scene is refused if it would. It keeps p_i, and blocks
without friction stay closed.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import contextlib
import copy
import functools
import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from pyfric import core
from pyfric.scene import Geometry, PrescribedLoad, as_scene, check_geometry
from pyfric.statics.banded import BandedCholesky, WithSpring
from pyfric.statics.on_junctions import loaded_on_junctions
from pyfric.statics.operators import (
    Assembly,
    bonds,
    coordinates,
    driven_dof,
    spring_forces,
    spring_tangents,
    stiffness,
)
from pyfric.statics.rest import Equilibrium, EquilibriumError, as_prescribed, check_rests
from pyfric.statics.uniqueness import LIMIT, definiteness

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pyfric.scene import Scene, SceneLike

__all__ = ["StaticSolver", "loaded_state", "solve_static"]

MAX_NEWTON = 60
"""Largest number of Newton steps for one contact set."""
ACCEPTED = 1e-9
"""Largest accepted residual force, in units of F_N/N_x, where rounding forbids a smaller one."""
CONTACT_TOL = 1e-11
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""
TIE = 1e-9
"""Excess forces closer than this many F_N/N_x are equal, so that symmetric scenes stay so."""
KEPT, LARGE = 12, 10_000
"""Number of factorisations a solver keeps; with more unknowns than `LARGE` it keeps one."""


class _Contact(NamedTuple):
    """What is imposed on the bottom blocks, each of shape (N_x,)."""

    held: np.ndarray  # u_x is given (bool)
    closed: np.ndarray  # touches the foundation (bool)
    slip: np.ndarray  # direction of slip, f = -slip mu_k p (int8); 0 where held or frictionless

    @property
    def key(self) -> bytes:
        return b"".join(part.tobytes() for part in self)


class _Bottom(NamedTuple):
    """What one contact set leads to, each of shape (N_x,)."""

    u_x: np.ndarray
    u_z: np.ndarray
    f: np.ndarray  # on held blocks what balances their other forces
    rounding: float  # size of rounding errors of forces, N


class _Found(NamedTuple):
    """Coordinates at rest for one contact set, and what the iteration came to."""

    q: np.ndarray
    forces: np.ndarray  # on the coordinates, without friction of held blocks, N
    F_T: float
    residual: float  # N
    steps: int


class StaticSolver:
    """States of rest of one scene, for given interface displacements and driver positions.

    Factorisations are kept by contact set and taken at one state, the loaded one, so that results
    do not depend on what was solved before. In finite geometry they drive a chord Newton
    iteration; where it converges slowly, the tangent is renewed.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        geometry: "linear" or "finite".
        u_drv0: u_x of the driven block at drive = 0 and F_T = 0, in m; None means that of the
            loaded state.

    Attributes:
        loaded: the loaded equilibrium with F_T = 0 (an `Equilibrium`).

    Raises:
        SceneError: no scene, unknown geometry, or finite geometry for a prescribed load.
        EquilibriumError: the scene has no loaded equilibrium.

    Source: PRL 107, 074301 (2011).
    """

    def __init__(
        self, scene: SceneLike, geometry: Geometry = "linear", *, u_drv0: float | None = None
    ) -> None:
        scene = as_scene(scene)
        check_geometry(geometry, scene)
        self.scene, self.geometry = scene, geometry
        N_x, N_z = scene.N_x, scene.N_z
        if scene.prescribed:  # displacements count from t = 0
            self.loaded = as_prescribed(scene)
            self._u_drv0 = 0.0 if u_drv0 is None else float(u_drv0)
            return
        self._lattice, self._T = bonds(scene), coordinates(scene)
        self._springs = functools.partial(spring_forces, self._lattice)
        if geometry == "finite":
            self._springs = core.bond_forces(scene, geometry)
        self._T_transposed = self._T.T.tocsr()
        self._on_rod = self._T_transposed[-3:, -2 * N_x :]
        self._unit = scene.F_N / N_x
        self._limit = ACCEPTED * self._unit
        self._stiffest = max(12 * scene.slider.k, np.max(scene.k_f), scene.driver.K, scene.k_top)
        self._load, self._F_N = np.zeros(2 * N_x * N_z), scene.F_N
        self._load[-2 * N_x :] = np.concatenate([scene.shear, -scene.load])
        self._top = slice(2 * N_x * (N_z - 1), 2 * N_x * (N_z - 1) + N_x)  # u_x of the top row
        self._h = driven_dof(scene)
        # u_x and u_z of the bottom row are the first 2 N_x coordinates: a rod has rows below.
        self._x, self._z = slice(0, N_x), slice(N_x, 2 * N_x)
        # phi times arm is the displacement of the end of the rod, a torque over arm a force there.
        self._arm = np.ones(self._T.shape[1])
        if scene.rigid:
            self._arm[-1] = scene.slider.L / 2
        # A translation along the interface.
        self._along = np.zeros(len(self._arm))
        rows = N_z - 1 if scene.rigid else N_z
        self._along[: 2 * N_x * rows].reshape(rows, 2, N_x)[:, 0] = 1.0
        if scene.rigid:
            self._along[-3] = 1.0
        self._factors: dict[tuple[bool, bytes], BandedCholesky | WithSpring | SuperLU] = {}
        self._u_drv0 = 0.0
        self._K = self._bond_stiffness(np.zeros(self._T.shape[1]))
        self.loaded = self._load_slider()
        if geometry == "finite":
            self._K = self._bond_stiffness(self._coordinates_of(self.loaded))
            self._factors.clear()
        self._u_drv0 = self.loaded.u_drv0 if u_drv0 is None else float(u_drv0)

    def __repr__(self) -> str:
        return f"StaticSolver of {self.scene.name or 'a scene'}, {self.geometry} geometry"

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray | None = None,
        start: Equilibrium | None = None,
        enough: float = 0.0,
        load: tuple[float, float] | None = None,
        factor: BandedCholesky | SuperLU | None = None,
    ) -> Equilibrium:
        """Return the equilibrium with the interface held.

        Args:
            u_x_bottom: u_x of the bottom blocks, shape (N_x,), in m; not used where free.
            drive: displacement V t of the driver since t = 0, in m.
            free: blocks without friction (open ones), shape (N_x,), bool; their u_x is a
                result. They carry p if they touch the foundation. None means no block.
            start: state from which the iteration starts; None means the loaded state.
            enough: residual force at which it may end, in N; 0 goes on to rounding.
            load: F_N and T, in N; None means those at t = 0.
            factor: of a tangent nearby, with the free blocks open and all others held; None means
                that of the loaded state.

        The vertical contact is solved with u_x held. Held blocks that lift off in its solution are
        freed and it is solved again. Blocks that come down again are held again; one that lifts
        off a second time stays without friction.

        Returns:
            The equilibrium; F_T = K (drive - d (u_x - u_drv0)) at the driven block.

        Raises:
            ValueError: an argument has the wrong shape or is not finite.
            EquilibriumError: no equilibrium was found.
        """
        check_rests(self.scene)
        if load is not None:
            how = {"free": free, "start": start, "enough": enough, "factor": factor}
            return self.under(load).solve(u_x_bottom, drive, **how)
        N_x = self.scene.N_x
        given, drive = np.array(u_x_bottom, dtype=float), float(drive)
        frictionless = np.zeros(N_x, bool) if free is None else np.array(free, dtype=bool)
        for name, value in (("u_x_bottom", given), ("free", frictionless)):
            if value.shape != (N_x,):
                raise ValueError(f"{name}: shape {value.shape}, expected ({N_x},)")
        if not (np.isfinite(given[~frictionless]).all() and np.isfinite(drive)):
            raise ValueError("u_x_bottom and drive must be finite")
        begin = self.loaded if start is None else start
        if begin.u.shape != self.loaded.u.shape:
            raise ValueError(f"start.u: shape {begin.u.shape}, expected {self.loaded.u.shape}")
        q, closed = self._coordinates_of(begin), ~begin.open
        if not frictionless.all():  # the slider as a whole may be far from where it began
            q += np.mean((given - begin.u[0, 0])[~frictionless]) * self._along
        # Enough to stand on: the free ones are open. A block of a chain stands on its own.
        if self.scene.N_z > 1 and np.sum(closed & ~frictionless) >= 2:
            closed &= ~frictionless
        held, lifted = ~frictionless, np.zeros(N_x, dtype=bool)
        steps, near = 0, {}
        if factor is not None:
            near[_Contact(held, held, np.zeros(N_x, dtype=np.int8)).key] = factor
        while True:  # a block lifts off at most twice
            q[self._x][held] = given[held]
            found, contact = self._touching(q, held, closed, drive, enough, near)
            q, steps, closed = found.q, steps + found.steps, contact.closed
            up, down = held & ~closed, closed & ~held & ~frictionless
            if up.any():
                frictionless |= up & lifted
                lifted |= up
                held = held & ~up
            elif down.any():
                held = held | down
            else:
                return self._result(found, contact, drive, steps)

    def _touching(
        self,
        q: np.ndarray,
        held: np.ndarray,
        closed: np.ndarray,
        drive: float,
        enough: float,
        near: Mapping[bytes, BandedCholesky | SuperLU],
    ) -> tuple[_Found, _Contact]:
        """Return the state of rest with u_x held, steps of all iterations counted, and the contact.

        Blocks keep or lose u_x by `held` alone, open or not, so that the foundation is the only
        condition: in linear geometry a convex problem with one solution. The iteration exchanges
        all blocks on the wrong side; if that does not end, the worst ones only.
        """
        steps, no_slip = 0, np.zeros(len(held), dtype=np.int8)
        sweeps = 4 * len(held) + 20
        for sweep in range(sweeps):
            contact = _Contact(held, closed, no_slip)
            factor = near.get(contact.key)
            found = self._newton(q, contact, drive, enough, factor)
            q, steps = found.q, steps + found.steps
            wrong = self._wrong_side(q[self._z], closed, self._rounding(q))
            if not wrong.any():
                return found._replace(steps=steps), contact
            if sweep >= 20 or not (closed ^ wrong).any():
                depth = np.where(wrong, np.abs(q[self._z]), -np.inf)
                wrong = depth >= depth.max() * (1 - TIE)
            closed = closed ^ wrong
        raise EquilibriumError(
            "the set of open blocks does not settle", found.residual, self._limit, steps
        )

    def tangent(
        self, stuck: np.ndarray, at: np.ndarray | None = None
    ) -> tuple[sp.csr_array, BandedCholesky | SuperLU, np.ndarray]:
        """Return the tangent stiffness with foundation and driver.

        Args:
            stuck: blocks that are closed and held, shape (N_x,), bool; the others are open.
            at: coordinates of the state, shape (n_q,); None means the loaded one.

        Returns:
            K, shape (n_q, n_q), in N/m; its factorisation for the free coordinates; their indices.

        Raises:
            EquilibriumError: all blocks are open.
        """
        if not stuck.any():  # singular: rounding would decide whether it can be factorised
            what = "the slider is not supported: all blocks are open"
            raise EquilibriumError(what, np.nan, self._limit, 0)
        contact = _Contact(stuck, stuck, np.zeros(len(stuck), dtype=np.int8))
        bare = self._K if at is None else self._bond_stiffness(at)
        K = self._supported(bare, stuck, driven=True)
        factor = self._factor(contact, True) if at is None else self._factorised(K, contact)
        return K, factor, self._unknown(contact)

    def under(self, load: tuple[float, float] | None) -> StaticSolver:
        """Return the same solver under another F_N and T (N) than at t = 0."""
        if load is None:
            return self
        scene, other = self.scene, copy.copy(self)
        other.__dict__.pop("load", None)
        other._F_N, T = load
        other._load = self._load * (other._F_N / scene.F_N)
        if not scene.rigid:
            other._load[self._top] = scene.d * T / scene.N_x
        return other

    def bond_tangents(self, q: np.ndarray) -> np.ndarray:
        """Return the stiffnesses xx, xz and zz of each bond at q, shape (3, n_bonds), in N/m."""
        return spring_tangents(self._lattice, self._spread(q), self.geometry)

    @functools.cached_property
    def _elongation(self) -> sp.csr_array:
        return sp.vstack([D @ self._T for D in self._lattice.difference]).tocsr()

    def elongations(self, shapes: np.ndarray) -> list[np.ndarray]:
        """Return du_x and du_z over each bond, shape (n_bonds, n), of shapes (n_q, n)."""
        return np.split(self._elongation @ shapes, 2)

    @functools.cached_property
    def _gather(self) -> sp.csr_array:
        return self._elongation.T.tocsr()

    def stiffened(self, shape: np.ndarray, stiffer: np.ndarray) -> np.ndarray:
        """Return the forces of a shape, (n_q,), where bonds are stiffer as in `bond_tangents`."""
        (x, z), (xx, xz, zz) = self.elongations(shape), stiffer
        return self._gather @ np.concatenate([xx * x + xz * z, xz * x + zz * z])

    @property
    def u_drv0(self) -> float:
        """u_x of the driven block at drive = 0 and F_T = 0, in m."""
        return self._u_drv0

    @functools.cached_property
    def load(self) -> np.ndarray:
        """Forces on the coordinates that do not depend on the state, shape (n_q,), in N."""
        load = self._T_transposed @ self._load
        if self.scene.rigid:
            load[-2] -= self._F_N
        return load

    @functools.cached_property
    def _assembly(self) -> Assembly:
        return Assembly(self._lattice, self._T)

    @functools.cached_property
    def driven_row(self) -> np.ndarray:
        """Derivatives of u_x of the driven block by the coordinates, shape (n_q,)."""
        return self._T[[self._h]].toarray()[0]

    @functools.cached_property
    def push(self) -> np.ndarray:
        """Forces on the coordinates for each metre of the driver, K d dq_h/dq, (n_q,), in N/m."""
        return self.scene.driver.K * self.scene.d * self.driven_row

    # --- forces and Newton's method --------------------------------------------------------------

    def _forces(
        self, q: np.ndarray, contact: _Contact, drive: float | None
    ) -> tuple[np.ndarray, float]:
        """Return the forces on the coordinates, without friction of held blocks, and F_T.

        drive = None means that there is no driver spring.
        """
        scene, x, z = self.scene, self._x, self._z
        u = self._spread(q)
        force = self._springs(u) + self._load
        if scene.k_top:
            force[self._top] -= scene.k_top * u[self._top]
        p = -scene.k_f * u[z] * contact.closed
        force[z] += p
        force[x] -= contact.slip * scene.law.slide(p)
        F_T = 0.0
        if drive is not None:
            F_T = scene.driver_force(drive, u[self._h], self._u_drv0)
            force[self._h] += scene.d * F_T
        if scene.rigid:
            force = np.append(force[: len(q) - 3], self._on_rod @ force[-2 * scene.N_x :])
            force[-2] -= self._F_N
            force[-1] -= scene.kappa * q[-1]
        return force[: len(q)], F_T

    def _spread(self, q: np.ndarray) -> np.ndarray:
        """Return the displacements of all blocks, the same as T q without a sparse product."""
        scene = self.scene
        if not scene.rigid:
            return np.append(q, np.zeros(len(self._load) - len(q)))  # a held row does not move
        top = np.full(scene.N_x, q[-3]), q[-2] + q[-1] * scene.x
        return np.concatenate([q[:-3], *top])

    def _bond_stiffness(self, q: np.ndarray) -> sp.csr_array:
        """Return the tangent stiffness of bonds and mattress at q."""
        if self.geometry == "finite" and len(self._arm) <= LARGE:
            mattress = np.zeros(len(q))
            mattress[-1] = self.scene.kappa if self.scene.rigid else 0.0
            return self._assembly.stiffness(self.bond_tangents(q), mattress)
        nowhere = np.zeros(self.scene.N_x, dtype=bool)
        return stiffness(
            self.scene,
            closed=nowhere,
            driver=False,
            lattice=self._lattice,
            u=self._T @ q,
            geometry=self.geometry,
        )

    def _supported(self, K: sp.csr_array, closed: np.ndarray, *, driven: bool) -> sp.csr_array:
        """Return K with the foundation under the closed blocks and, if driven, the driver."""
        foundation = np.zeros(K.shape[0])
        foundation[self._z] = self.scene.k_f * closed
        if driven:
            foundation += self.scene.driver.K * self.driven_row**2  # one entry, 1
        return (K + sp.diags_array(foundation)).tocsr()

    def _factorised(self, K: sp.csr_array, contact: _Contact) -> BandedCholesky | SuperLU:
        """Factorise K, supported, with friction, for the coordinates not held."""
        scene, n = self.scene, K.shape[0]
        if contact.slip.any():
            # Friction -slip mu_k p with p = -k_f u_z couples u_x to u_z, N_x columns to the right.
            coupling = np.zeros(n - scene.N_x)
            coupling[self._x] = -scene.law.slide(scene.k_f) * contact.slip
            K = (K + sp.diags_array(coupling, offsets=scene.N_x)).tocsr()
        unknown = self._unknown(contact)
        options = {} if contact.slip.any() else {"SymmetricMode": True}
        try:
            if not contact.slip.any():
                with contextlib.suppress(np.linalg.LinAlgError):  # not positive definite
                    return BandedCholesky(K, unknown, *self.banded(unknown))
            return splu(K[unknown][:, unknown].tocsc(), permc_spec="MMD_AT_PLUS_A", options=options)
        except RuntimeError as error:
            raise EquilibriumError("the slider is not supported", np.nan, self._limit, 0) from error
        except MemoryError as error:
            what = f"not enough memory to factorise {len(unknown)} unknowns"
            raise EquilibriumError(what, np.nan, self._limit, 0) from error

    def _factor(self, contact: _Contact, driven: bool) -> BandedCholesky | WithSpring | SuperLU:
        """Return the factorisation at the reference state, from the store if it is there."""
        key, large = (driven, contact.key), len(self._arm) > LARGE
        if key not in self._factors:
            bare = self._factors.get((False, contact.key)) if driven and large else None
            while len(self._factors) >= (1 if large else KEPT):
                del self._factors[next(iter(self._factors))]
            if isinstance(bare, BandedCholesky):  # one factorisation less
                row = np.sqrt(self.scene.driver.K) * self.driven_row[self._unknown(contact)]
                self._factors[key] = WithSpring(bare, row)
            else:
                K = self._supported(self._K, contact.closed, driven=driven)
                self._factors[key] = self._factorised(K, contact)
        return self._factors[key]

    def banded(self, unknown: np.ndarray) -> tuple[np.ndarray, int]:
        """Return the order of unknowns that makes the narrowest band, rod last; size of the rod."""
        scene, n_rod = self.scene, 3 if self.scene.rigid else 0
        row, i = np.divmod(unknown[: len(unknown) - n_rod], scene.N_x)
        tall = scene.N_z > scene.N_x
        order = np.argsort(unknown[: len(unknown) - n_rod] if tall else i * (2 * scene.N_z) + row)
        return np.append(order, np.arange(len(order), len(unknown))), n_rod

    def _unknown(self, contact: _Contact) -> np.ndarray:
        """Return the indices of the coordinates that are not held."""
        unknown = np.ones(len(self._arm), dtype=bool)
        unknown[self._x] = ~contact.held
        return np.flatnonzero(unknown)

    def _rounding(self, q: np.ndarray) -> float:
        """Return the size of rounding errors in forces at q, in N."""
        return 2.0**-52 * self._stiffest * float(np.max(np.abs(q * self._arm)))

    def _newton(
        self,
        q: np.ndarray,
        contact: _Contact,
        drive: float | None,
        enough: float = 0.0,
        factor: BandedCholesky | SuperLU | None = None,
    ) -> _Found:
        """Return the state of rest for one contact set.

        The iteration ends at the level of rounding, or, below `ACCEPTED`, where a renewed tangent
        does not help. Linear geometry takes one step and a refinement.
        """
        unknown, driven = self._unknown(contact), drive is not None
        if unknown[-1] - unknown[0] == len(unknown) - 1:  # as a slice it takes less time
            unknown = slice(unknown[0], unknown[-1] + 1)
        arm = self._arm[unknown]
        factor, renewed = factor or self._factor(contact, driven), False
        best, least, previous = None, np.inf, np.inf
        for step in range(MAX_NEWTON + 1):  # noqa: B007 (returned after the loop)
            with np.errstate(all="ignore"):
                forces, F_T = self._forces(q, contact, drive)
                force = forces[unknown]
                residual = float(np.max(np.abs(force / arm)))
            if not np.isfinite(residual):
                break
            rounding = self._rounding(q)
            if residual < least:
                best, least = (q, forces, F_T), residual
            if residual <= max(rounding / 4, enough):
                break
            if residual > 0.5 * previous:
                if least <= 16 * rounding or (renewed and least <= self._limit):
                    break
                K = self._supported(self._bond_stiffness(q), contact.closed, driven=driven)
                factor, renewed = self._factorised(K, contact), True
            previous = residual
            q = q.copy()
            q[unknown] += factor.solve(force)
        limit = max(self._limit, enough, 16 * self._rounding(best[0] if best else q))
        if not least <= limit:
            raise EquilibriumError("Newton's method does not converge", least, limit, step)
        return _Found(*best, least, step)

    # --- loading ---------------------------------------------------------------------------------

    def _load_slider(self) -> Equilibrium:
        """Return the loaded state: the bottom row held, or slipped where it has to."""
        N_x = self.scene.N_x
        if not (self.scene.law.rests or isinstance(self.scene.top, PrescribedLoad)):
            return loaded_on_junctions(self.scene, self.geometry)
        everywhere = np.ones(N_x, dtype=bool)
        contact = _Contact(everywhere, everywhere, np.zeros(N_x, dtype=np.int8))
        found, steps = None, 0

        def at_rest(contact: _Contact) -> _Bottom:
            nonlocal found, steps
            q = np.zeros(len(self._arm)) if found is None else found.q.copy()
            q[self._x][contact.held] = 0.0
            found = self._newton(q, contact, None)
            q, steps = found.q, steps + found.steps
            f = self._friction(q, contact, found.forces)
            return _Bottom(q[self._x], q[self._z], f, self._rounding(q))

        held_everywhere = at_rest(contact)
        if self.scene.N_z > 1 and self._next_contact(contact, held_everywhere) is not None:
            S, g = self._condensed()
            contact = self._settled(contact, lambda c: self._condensed_rest(S, g, c))
            contact = self._settled(contact, at_rest)
            self._warn_if_ambiguous(S, contact)
        return self._result(found, contact, None, steps)

    def _settled(self, contact: _Contact, rest: Callable[[_Contact], _Bottom]) -> _Contact:
        """Return the contact set that meets all conditions of loading."""
        sweeps = 8 * self.scene.N_x + 20
        for sweep in range(sweeps):
            changed = self._next_contact(contact, rest(contact), one=sweep > sweeps // 2)
            if changed is None:
                return contact
            contact = changed
        what = "slip during loading does not settle"
        raise EquilibriumError(what, np.nan, self._limit, sweeps)

    def _next_contact(
        self, contact: _Contact, now: _Bottom, *, one: bool = False
    ) -> _Contact | None:
        """Return the next contact set to try while F_N is applied, or None if this one is right.

        In this order: blocks on the wrong side of the foundation change; blocks that moved along
        their friction force are held again; the block with the largest |f| - mu_s p is released.
        With `one`, only the leftmost block of all these changes, which ends cycles.
        """
        held, closed, slip = (part.copy() for part in contact)
        p = -self.scene.k_f * now.u_z * closed
        margin = np.where(held, self.scene.law.margin(p, now.f), 0.0)
        wrong = self._wrong_side(now.u_z, closed, now.rounding)
        back = slip * now.u_x * self._stiffest < -now.rounding
        weak = margin < -(CONTACT_TOL * self._unit + 16 * now.rounding)
        if not (wrong | back | weak).any():
            return None
        if one:
            first = np.arange(len(p)) == np.argmax(wrong | back | weak)
            wrong, back, weak = wrong & first, back & first, weak & first
        if wrong.any():
            closed ^= wrong
            held[wrong], slip[wrong] = closed[wrong], 0
        elif back.any():
            held[back], slip[back] = True, 0
        else:
            margin = np.where(weak, margin, np.inf)
            i = int(np.argmin(margin))
            released = margin <= margin[i] + TIE * self._unit
            held[released], slip[released] = False, -np.sign(now.f[released])
            if not held.any():
                # All blocks slip: the slider moves as a whole until one of them is back at u_x = 0.
                other = np.flatnonzero(slip == -slip[i])
                if not len(other):
                    raise EquilibriumError("the slider slides away", np.nan, self._limit, 0)
                j = other[np.argmin(np.abs(now.u_x[other]))]
                held[j], slip[j] = True, 0
        return _Contact(held, closed, slip)

    def _condensed(self) -> tuple[np.ndarray, np.ndarray]:
        """Return S and g: without contact, S (u_x, u_z) - g are the forces the interface needs.

        Linear geometry, without driver: S has shape (2 N_x, 2 N_x), g shape (2 N_x,).
        """
        b = 2 * self.scene.N_x
        K = stiffness(
            self.scene,
            closed=np.zeros(self.scene.N_x, dtype=bool),
            driver=False,
            lattice=self._lattice,
        ).tocsc()
        load = self._T_transposed @ self._load
        if self.scene.rigid:
            load[-2] -= self.scene.F_N
        inside = splu(K[b:, b:], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        to_inside = K[b:, :b].toarray()
        S = K[:b, :b].toarray() - to_inside.T @ inside.solve(to_inside)
        return S, -to_inside.T @ inside.solve(load[b:])

    def _with_contact(self, S: np.ndarray, contact: _Contact) -> np.ndarray:
        """Return S with foundation and friction of the slipping blocks."""
        i = np.arange(self.scene.N_x)
        j = i + self.scene.N_x
        A = S.copy()
        A[j, j] += self.scene.k_f * contact.closed
        A[i, j] -= self.scene.law.slide(self.scene.k_f) * contact.slip
        return A

    def _condensed_rest(self, S: np.ndarray, g: np.ndarray, contact: _Contact) -> _Bottom:
        """Return the interface at rest for one contact set, in linear geometry."""
        N_x = self.scene.N_x
        unknown = np.concatenate([~contact.held, np.ones(N_x, dtype=bool)])
        v = np.zeros(2 * N_x)
        A = self._with_contact(S, contact)
        try:
            v[unknown] = np.linalg.solve(A[np.ix_(unknown, unknown)], g[unknown])
        except np.linalg.LinAlgError as error:
            raise EquilibriumError("the slider is not supported", np.nan, self._limit, 0) from error
        u_x, u_z = v[self._x], v[self._z]
        f = np.where(contact.held, (S @ v - g)[self._x], 0.0)
        f += contact.slip * (self.scene.law.slide(self.scene.k_f) * u_z)
        return _Bottom(u_x, u_z, f, 64 * self._rounding(np.pad(v, (0, len(self._arm) - len(v)))))

    def _warn_if_ambiguous(self, S: np.ndarray, contact: _Contact) -> None:
        """Warn where the slip operator (friction against slip) is not positive definite."""
        slipping = np.flatnonzero(contact.slip)
        free = np.concatenate([~contact.closed, np.ones(self.scene.N_x, dtype=bool)])
        rest = np.flatnonzero(free)

        def slip_operator(slip: np.ndarray) -> np.ndarray:
            A = self._with_contact(S, contact._replace(slip=slip))
            B = np.linalg.solve(A[np.ix_(rest, rest)], A[np.ix_(rest, slipping)])
            return A[np.ix_(slipping, slipping)] - A[np.ix_(slipping, rest)] @ B

        found = definiteness(slip_operator(contact.slip), slip_operator(0 * contact.slip))
        if found < LIMIT:
            warnings.warn(
                f"{len(slipping)} blocks slip while F_N is applied, and the definiteness of their "
                f"slip operator is {found:.3g} (at least {LIMIT:g}): friction is so strong that "
                "the loaded state may not be the only one; a smaller mu_k makes it unique",
                RuntimeWarning,
                stacklevel=4,
            )

    # --- states ----------------------------------------------------------------------------------

    def _wrong_side(self, u_z: np.ndarray, closed: np.ndarray, rounding: float) -> np.ndarray:
        """Return the closed blocks with u_z > 0 and the open ones with u_z < 0."""
        pull = self.scene.k_f * np.where(closed, u_z, -u_z)
        return pull > CONTACT_TOL * self._unit + 16 * rounding

    def _friction(self, q: np.ndarray, contact: _Contact, forces: np.ndarray) -> np.ndarray:
        """Return f: what balances the other forces where held, -slip mu_k p elsewhere."""
        slipping = contact.slip * (self.scene.law.slide(self.scene.k_f) * q[self._z])
        return np.where(contact.held, -forces[self._x], slipping)

    def _coordinates_of(self, state: Equilibrium) -> np.ndarray:
        return self.coordinates(state.u, state.rod)

    def coordinates(self, u: np.ndarray, rod: np.ndarray) -> np.ndarray:
        """Return q, shape (n_q,), of u, shape (N_z, 2, N_x), and rod, shape (3,); rates alike."""
        q = np.zeros(len(self._arm))
        n = len(q) - 3 if self.scene.rigid else len(q)
        q[:n] = u.reshape(-1)[:n]
        q[n:] = rod[: len(q) - n]
        return q

    def displacements(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u, shape (N_z, 2, N_x), and rod, shape (3,), of q, top row by the rod."""
        scene = self.scene
        u = (self._T @ q).reshape(scene.N_z, 2, scene.N_x)
        if not scene.rigid:
            return u, np.zeros(3)
        u[-1, 0], u[-1, 1] = q[-3], q[-2] + q[-1] * scene.x
        return u, q[-3:].copy()

    def _result(
        self, found: _Found, contact: _Contact, drive: float | None, steps: int
    ) -> Equilibrium:
        scene, q = self.scene, found.q
        u = (self._T @ q).reshape(scene.N_z, 2, scene.N_x)
        f = self._friction(q, contact, found.forces)
        return Equilibrium(
            u=u,
            rod=q[-3:].copy() if scene.rigid else np.zeros(3),
            F_T=found.F_T,
            f=f,
            tau=-scene.d * f,
            p=np.where(contact.closed, scene.k_f * np.maximum(-u[0, 1], 0.0), 0.0),
            open=~contact.closed,
            slipped=contact.slip != 0,
            drive=0.0 if drive is None else drive,
            u_drv0=float(u[scene.j_h, 0, scene.i_h]) if drive is None else self._u_drv0,
            residual=found.residual,
            iterations=steps,
        )


@functools.lru_cache(maxsize=4)
def _solver(scene: Scene, geometry: Geometry) -> StaticSolver:
    return StaticSolver(scene, geometry)


def loaded_state(scene: SceneLike, geometry: Geometry = "linear") -> Equilibrium:
    """Return the start of a run: F_N applied with friction active, F_T = 0.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        geometry: "linear" or "finite".

    Returns:
        The equilibrium; its u_drv0 is u_x of the driven block.

    Raises:
        SceneError: no scene, unknown geometry, or finite geometry for a chain.
        EquilibriumError: no equilibrium was found.

    Warns:
        RuntimeWarning: blocks slip while F_N is applied and the state may not be unique.

    Source: PRL 107, 074301 (2011).
    """
    scene = as_scene(scene)
    check_geometry(geometry, scene)
    return _solver(scene, geometry).loaded


def solve_static(
    scene: SceneLike,
    u_x_bottom: np.ndarray,
    drive: float,
    *,
    geometry: Geometry = "linear",
    free: np.ndarray | None = None,
    start: Equilibrium | None = None,
) -> Equilibrium:
    """Return the equilibrium with the interface held: see `StaticSolver.solve`."""
    scene = as_scene(scene)
    check_geometry(geometry, scene)
    return _solver(scene, geometry).solve(u_x_bottom, drive, free=free, start=start)
