"""Static equilibria: the loaded slider at the start, and the slider at given interface positions.

`StaticSolver` holds the bottom row at given u_x and finds the state of rest of everything else. The
vertical contact is one of states (`contact`): a block with u_z < 0 is closed and carries
p = -k_f u_z, any other one is open and carries neither p nor friction, so its u_x is free.

`loaded_state` is the start of a run: F_N applied, F_T = 0. The bottom row is held at u_x = 0 unless
a block would need more than mu_s p. Then F_N is applied proportionally and quasi-statically.
In linear geometry that loading is self-similar: a block that slips at all does so from
the first newton on, always in one direction, so the final state alone decides:

    stuck     u_x = 0,            |f| <= mu_s p
    slipped   sign(u_x) = s != 0, f = -s mu_k p
    open      p = f = 0,          u_z >= 0

For mu_s = mu_k this is a linear complementarity problem. For mu_s > mu_k the same conditions hold
with mu_k on blocks that slipped, which leaves several solutions; the rule is to release the block
with the largest |f| - mu_s p, one at a time (equal ones together), to solve again, and to hold
again blocks that moved along their friction force. In finite geometry the same conditions are
imposed at full load.

Where the contact states that a search begins with are wrong, it goes on from those of the condensed
slider, which finds them by pivots, in linear geometry; Newton's method then exchanges what is left.

A chain does not slip while it is loaded: its scene is refused if it would. It keeps p_i, and blocks
without friction stay closed.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import functools
import warnings
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import STUCK
from pyfric.scene import FRICTIONLESS, Geometry, as_scene, check_geometry
from pyfric.statics.complementarity import Contact, ContactProblem
from pyfric.statics.contact import CONTACT_TOL, Interface, Unmet, Values, with_free
from pyfric.statics.rest import Equilibrium, EquilibriumError, as_prescribed, check_rests
from pyfric.statics.system import System
from pyfric.statics.uniqueness import LIMIT, definiteness

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from scipy.sparse.linalg import SuperLU

    from pyfric.scene import Law, Scene, SceneLike
    from pyfric.statics.banded import BandedCholesky

__all__ = ["Lattice", "StaticSolver", "loaded_state", "solve_static"]

MAX_NEWTON = 60
"""Largest number of Newton steps for one contact set."""
ACCEPTED = 1e-9
"""Largest accepted residual force, in units of F_N/N_x, where rounding forbids a smaller one."""


class Lattice(Interface):
    """Contact states of all blocks, and the whole lattice at rest in them, by Newton's method.

    Factors are those of the system's reference state (a chord iteration); where it converges
    slowly, the tangent is renewed.

    Args:
        system: the slider.
        q: coordinates to begin with, shape (n_q,).
        mode: contact states to begin with, shape (N_x,).
        u_x: where blocks are held, shape (N_x,), in m.
        drive: displacement of the driver since t = 0, in m; None means that there is no driver.
        law: the friction law.
        guess: returns contact states to go on with where the first ones are wrong.
        enough: residual force at which Newton's method may end, in N.
        near: factors of a tangent nearby, by contact states as bytes.
    """

    def __init__(
        self,
        system: System,
        q: np.ndarray,
        mode: np.ndarray,
        u_x: np.ndarray,
        drive: float | None,
        law: Law,
        guess: Callable[[], np.ndarray],
        *,
        enough: float = 0.0,
        near: dict[bytes, BandedCholesky | SuperLU] | None = None,
    ) -> None:
        super().__init__(system.scene, mode, law, driven=drive is not None)
        self.system, self.q, self.given, self.drive = system, q.copy(), u_x.copy(), drive
        self._guess, self._enough, self._near = guess, enough, near or {}
        self.steps, self._values = 0, None

    @property
    def tol(self) -> float:
        """Violations of conditions below it are rounding, in N."""
        return CONTACT_TOL * self.unit + 16 * self.system.rounding(self.q)

    def put(self, which: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> None:
        """Put blocks into states, each of shape (n,); those that stick are held at u_x (m)."""
        self.enter(which, mode)
        self.given[which], self._values = u_x, None

    def exchange(self, unmet: Callable[[Values], Unmet | None]) -> Iterator[Values]:
        """Change contact states until all conditions are met; see `Interface.exchange`."""
        if unmet(self.values()) is not None:
            self.put(slice(None), self._guess(), self.given)
            self._lifts[self.slip != 0] = 2
        return super().exchange(unmet)

    def values(self) -> Values:
        """Return the interface at rest in these contact states."""
        if self._values is None:
            held, N_x = self.stuck, self.N_x
            self.q[:N_x][held] = self.given[held]
            self._newton()
            u_x, u_z = self.q[:N_x], self.q[N_x : 2 * N_x]
            f = np.where(held, -self.forces[:N_x], self.slip * (self.law.slide(self.k_f) * u_z))
            p = np.where(self.closed, -self.k_f * u_z, 0.0)
            self._values = Values(u_x, f, u_z, p, self.F_T)
        return self._values

    def _newton(self) -> None:
        """Find q with forces (N) on the coordinates that vanish where they are not held.

        The iteration ends at the level of rounding, or, below `ACCEPTED`, where a renewed tangent
        does not help. Linear geometry takes one step and a refinement.
        """
        system, q, drive = self.system, self.q, self.drive
        unknown = system.unknown(self.mode)
        how = {"driven": self.driven, "friction": -self.law.slide(self.k_f) * self.slip}
        factor = self._near.get(self.mode.tobytes()) or system.factor(self.mode, **how)
        if unknown[-1] - unknown[0] == len(unknown) - 1:  # as a slice it takes less time
            unknown = slice(unknown[0], unknown[-1] + 1)
        arm, limit = system.arm[unknown], ACCEPTED * self.unit
        renewed, best, least, previous = False, None, np.inf, np.inf
        for step in range(MAX_NEWTON + 1):  # noqa: B007 (returned after the loop)
            with np.errstate(all="ignore"):
                forces, F_T = system.forces(q, self, drive)
                force = forces[unknown]
                residual = float(np.max(np.abs(force / arm)))
            if not np.isfinite(residual):
                break
            rounding = system.rounding(q)
            if residual < least:
                best, least = (q, forces, F_T), residual
            if residual <= max(rounding / 4, self._enough):
                break
            if residual > 0.5 * previous:
                if least <= 16 * rounding or (renewed and least <= limit):
                    break
                factor, renewed = system.factor_at(q, self.mode, **how), True
            previous = residual
            q = q.copy()
            q[unknown] += factor.solve(force)
        limit = max(limit, self._enough, 16 * system.rounding(best[0] if best else q))
        if not least <= limit:
            raise EquilibriumError("Newton's method does not converge", least, limit, step)
        self.q, self.forces, self.F_T = best
        self.residual, self.steps = least, self.steps + step
        if self.driven and system.geometry == "finite" and system.largest_turn(self.q) > 1:
            raise EquilibriumError("the slider turns over", least, limit, self.steps)

    def result(self) -> Equilibrium:
        """Return the state of rest."""
        scene, now, system = self.scene, self.values(), self.system
        u, rod = system.displacements(self.q)
        return Equilibrium(
            u=u,
            rod=rod,
            F_T=now.F_T,
            f=now.f,
            tau=-scene.d * now.f,
            p=np.maximum(now.p, 0.0),
            open=~self.closed,
            slipped=(self.slip != 0) & (not self.driven),
            drive=0.0 if self.drive is None else self.drive,
            u_drv0=system.u_drv0 if self.driven else float(u[scene.j_h, 0, scene.i_h]),
            residual=self.residual,
            iterations=self.steps,
        )


class StaticSolver(System):
    """States of rest of one scene, for given interface displacements and driver positions.

    Factorisations are kept by contact states and taken at one state, the loaded one, so that
    results do not depend on what was solved before.

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
        if scene.prescribed:  # displacements count from t = 0
            self.scene, self.geometry = scene, geometry
            self.loaded = as_prescribed(scene)
            self.u_drv0 = 0.0 if u_drv0 is None else float(u_drv0)
            return
        super().__init__(scene, geometry)
        self.loaded = self._load_slider()
        if geometry == "finite":
            self.linearise(self.coordinates(self.loaded.u, self.loaded.rod))
        self.u_drv0 = self.loaded.u_drv0 if u_drv0 is None else float(u_drv0)

    def __repr__(self) -> str:
        return f"StaticSolver of {self.scene.name or 'a scene'}, {self.geometry} geometry"

    @functools.cached_property
    def _problem(self) -> ContactProblem:
        """The condensed slider."""
        return ContactProblem(self.scene)

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

        Held blocks that lift off are freed; those that come down again are held again. One that
        lifts off a second time stays without friction.

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
        scene, N_x = self.scene, self.scene.N_x
        given, drive = np.array(u_x_bottom, dtype=float), float(drive)
        loose = np.zeros(N_x, bool) if free is None else np.array(free, dtype=bool)
        for name, value in (("u_x_bottom", given), ("free", loose)):
            if value.shape != (N_x,):
                raise ValueError(f"{name}: shape {value.shape}, expected ({N_x},)")
        if not (np.isfinite(given[~loose]).all() and np.isfinite(drive)):
            raise ValueError("u_x_bottom and drive must be finite")
        begin = self.loaded if start is None else start
        if begin.u.shape != self.loaded.u.shape:
            raise ValueError(f"start.u: shape {begin.u.shape}, expected {self.loaded.u.shape}")
        q = self.coordinates(begin.u, begin.rod)
        if not loose.all():  # the slider as a whole may be far from where it began
            q += np.mean((given - begin.u[0, 0])[~loose]) * self.translation()

        def condensed() -> np.ndarray:
            at = drive + scene.d * self.u_drv0
            return self._problem.held(given, at, loose, self._loads).mode

        near = {} if factor is None else {with_free(scene, ~loose, loose).tobytes(): factor}
        mode = with_free(scene, ~begin.open, loose)
        how = {"enough": enough, "near": near}
        lattice = Lattice(self, q, mode, given, drive, FRICTIONLESS, condensed, **how)
        lattice.hold_at(given, loose)
        return lattice.result()

    def _load_slider(self) -> Equilibrium:
        """Return the loaded state: the bottom row held, or slipped where it has to."""
        scene, home = self.scene, np.zeros(self.scene.N_x)

        def condensed() -> np.ndarray:
            contact = self._problem.applied()
            _warn_if_ambiguous(contact)
            return contact.mode

        mode, q = np.full(scene.N_x, STUCK), np.zeros(len(self.arm))
        lattice = Lattice(self, q, mode, home, None, scene.law, condensed)
        if scene.N_z > 1:
            lattice.load(home)
        return lattice.result()


def _warn_if_ambiguous(contact: Contact) -> None:
    """Warn where the slip operator (friction against slip) is not positive definite."""
    found = definiteness(*contact.slip_operator(contact.slip))
    if found < LIMIT:
        warnings.warn(
            f"{np.count_nonzero(contact.slip)} blocks slip while F_N is applied, and the "
            f"definiteness of their slip operator is {found:.3g} (at least {LIMIT:g}): friction is "
            "so strong that the loaded state may not be the only one; a smaller mu_k makes it "
            "unique",
            RuntimeWarning,
            stacklevel=8,
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
