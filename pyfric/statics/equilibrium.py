"""Static equilibria: the loaded slider at the start, and the slider at given interface positions.

`StaticSolver` holds the bottom row at given u_x and finds the static state of all other blocks. The
vertical contact has two states (`contact`). A block with u_z < 0 is closed and carries
p = -k_f u_z. Any other block is open: it carries neither p nor friction, and its u_x is free.

`loaded_state` is the start of a run, with F_N applied and F_T = 0. The bottom row is held at
u_x = 0, unless a block would need more friction than mu_s p. In that case F_N is applied
proportionally and quasi-statically. In linear geometry this loading is self-similar: a block that
slips does so from the smallest load on, always in one direction. Conditions on the final state
(`contact`, with displacements counted from u_x = 0) therefore suffice. For mu_s = mu_k this is a
linear complementarity problem. For mu_s > mu_k blocks that slipped have mu_k, and there can be
several solutions; the order of the conditions selects one solution. In finite geometry the same
conditions are imposed at full load.

Newton's method, on all blocks, finds the static state for given contact states. If this state
violates their conditions, the contact solver (`complementarity`) finds other contact states. The
contact solver uses the condensed slider in linear geometry. In finite geometry its loads are
corrected for the difference.

A chain does not slip while it is loaded, because scenes with such slip are refused. In a chain p_i
is constant, and blocks without friction stay closed.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import functools
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from pyfric.core import OPEN, STUCK, check_driven
from pyfric.scene import FRICTIONLESS, Geometry, PrescribedLoad, as_scene, check_geometry
from pyfric.statics.complementarity import Contact, ContactProblem, Route, Static
from pyfric.statics.contact import (
    LEAST_DEFINITENESS,
    States,
    Values,
    rounding,
    with_free,
)
from pyfric.statics.rest import Equilibrium, EquilibriumError, as_prescribed, check_rests
from pyfric.statics.rows import ends
from pyfric.statics.system import System
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.scene import OnDriven, Scene, SceneLike

MAX_NEWTON = 60
"""Largest number of Newton steps for one set of contact states."""
ACCEPTED = 1e-9
"""Largest residual force accepted if rounding prevents a smaller residual, over F_N/N_x."""
CORRECTIONS = 10
"""Largest number of calls of the contact solver for one static state; about 2 are needed."""
JUNCTION_STEPS = 100
"""Largest number of steps to the loaded state on junctions."""
JUNCTION_ROUNDED = 1e-12
"""Residual force on junctions that counts as rounding, over F_N/N_x."""


class StaticSolver(System):
    """Static states of one scene, for given interface displacements and driver positions.

    Factorisations are stored for each set of contact states. All factorisations belong to the
    loaded state, so that results do not depend on earlier solutions.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        geometry: "linear" or "finite".
        u_drv0: u_x of the driven blocks at drive = 0 and F_T = 0, in m, as `Scene.u_driven` returns
            it; None means u_x in the loaded state.

    Attributes:
        loaded: the loaded equilibrium with F_T = 0 (an `Equilibrium`).

    Raises:
        SceneError: not a scene, unknown geometry, or finite geometry for a prescribed load.
        EquilibriumError: the scene has no loaded equilibrium.

    Source: PRL 107, 074301 (2011).
    """

    def __init__(
        self, scene: SceneLike, geometry: Geometry = "linear", *, u_drv0: OnDriven | None = None
    ) -> None:
        scene = as_scene(scene)
        check_geometry(geometry, scene)
        if u_drv0 is not None:
            check_driven(scene, u_drv0)
        if scene.prescribed:  # displacements count from t = 0
            self.scene, self.geometry = scene, geometry
            self.loaded = as_prescribed(scene)
            self.u_drv0 = self.loaded.u_drv0 if u_drv0 is None else u_drv0
            return
        super().__init__(scene, geometry)
        self.loaded = self._load_slider()
        self.pressed = scene.bare & ~self.loaded.open
        if geometry == "finite":
            self.linearise(self.coordinates(self.loaded.u, self.loaded.rod))
        self.u_drv0 = self.loaded.u_drv0 if u_drv0 is None else u_drv0

    def __repr__(self) -> str:
        return f"StaticSolver of {self.scene.name or 'a scene'}, {self.geometry} geometry"

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray | None = None,
        load: tuple[float, float] | None = None,
        near: Equilibrium | None = None,
    ) -> Equilibrium:
        """Return the equilibrium with the interface held.

        Held blocks that lift off become free. If such blocks come down again, they are held again.
        A block that lifts off a second time stays without friction.

        Args:
            u_x_bottom: u_x of the bottom blocks, shape (N_x,), in m; ignored for free blocks.
            drive: displacement V t of the driver since t = 0, in m.
            free: blocks without friction (open blocks), shape (N_x,), bool; their u_x is a result.
                Free blocks carry p if they touch the foundation. None means no block.
            load: F_N and T, in N; None means their values at t = 0.
            near: equilibrium at which the search starts; None means the loaded state.

        Returns:
            The equilibrium. F_T is K (drive - d (u_x - u_drv0)), with the mean over driven blocks.

        Raises:
            SceneError: an argument has the wrong shape or is not finite.
            EquilibriumError: no equilibrium was found.
        """
        check_rests(self.scene)
        if load is not None:
            return self.under(load).solve(u_x_bottom, drive, free=free, near=near)
        scene, N_x = self.scene, self.scene.N_x
        given, drive = np.array(u_x_bottom, dtype=float), float(drive)
        loose = np.zeros(N_x, bool) if free is None else np.array(free, dtype=bool)
        for name, value in (("u_x_bottom", given), ("free", loose)):
            if value.shape != (N_x,):
                raise SceneError(name, value.shape, "", f"shape ({N_x},)", "wrong shape")
        if not (np.isfinite(given[~loose]).all() and np.isfinite(drive)):
            wrong = given[~loose & ~np.isfinite(given)]
            field, bad = ("u_x_bottom", wrong[0]) if len(wrong) else ("drive", drive)
            raise SceneError(field, float(bad), "m", "finite numbers", "not a finite number")
        begin = near or self.loaded
        q = self.coordinates(begin.u, begin.rod)
        if not loose.all():  # the slider as a whole may be far from where it began
            q += np.mean((given - begin.u[0, 0])[~loose]) * self.translation()

        states = States(scene, with_free(scene, ~self.loaded.open, loose), FRICTIONLESS)
        return self._rest(q, states, given, drive, loose)

    def _load_slider(self) -> Equilibrium:
        """Return the loaded state. Bottom blocks slip only if they exceed their strength.

        With a given initial slip, blocks stick at this slip, whatever their friction force is.
        """
        scene, home = self.scene, self.scene.home
        if scene.law.junctions and not isinstance(scene.top, PrescribedLoad):
            return self._load_on_junctions()
        states, q = (
            States(scene, np.zeros(scene.N_x), scene.law.static, driven=False),
            np.zeros(len(self.arm)),
        )
        held = None if scene.interface.slip is None else np.zeros(scene.N_x, bool)
        return self._rest(q, states, home, None, held)

    def _load_on_junctions(self) -> Equilibrium:
        """Return the loaded state on junctions, which are pinned at u_x = 0 before F_N is applied.

        Junctions add n_s k_j = sqrt(n_s C p) to the stiffness of each bottom block along x, with
        the present p. The chord iteration uses the tangent of linear geometry, with the stiffness
        of the junctions at the last p.
        """
        scene, N_x, unit = self.scene, self.scene.N_x, self.scene.F_N / self.scene.N_x
        at, states = ends(N_x), States(scene, np.zeros(N_x), scene.law.static, driven=False)
        q, p, least = np.zeros(len(self.arm)), np.full(N_x, unit), np.inf
        of_bonds = self.bond_tangents(q)
        for step in range(JUNCTION_STEPS):
            u_x, u_z = q[at.u_x], q[at.u_z]
            if step:
                height = u_z + scene.gap
                states.enter(slice(None), np.where(height < 0, STUCK, OPEN))
                p = np.where(states.closed, -scene.k_f * height, 0.0)
            held = scene.law.stiffness(p)
            forces, F_T = self.forces(q, states, None)
            forces[at.u_x] -= held * u_x
            residual = float(np.max(np.abs(forces)))
            rounded = JUNCTION_ROUNDED * unit
            if residual <= rounded or (least <= 1e3 * rounded and residual >= least):
                now = Values(u_x, -held * u_x, u_z, p, F_T)
                return self._result(q, states, now, None, residual, step)
            least = min(least, residual)
            springs = np.zeros(len(q))
            springs[at.u_x] = held
            K = self.stiffness(of_bonds, states.mode, driven=False) + sp.diags_array(springs)
            q = q + self.leading(splu(K.tocsc()).solve(forces), self.arm, residual)
        what = "the slider on junctions does not settle under its load"
        raise EquilibriumError(what, residual, rounded, JUNCTION_STEPS)

    # --- Newton's method, and the contact solver -------------------------------------------------

    @functools.cached_property
    def _problem(self) -> ContactProblem:
        """Contact problem of the condensed slider."""
        return ContactProblem(self.scene)

    def _rest(
        self,
        q: np.ndarray,
        states: States,
        given: np.ndarray,
        drive: float | None,
        loose: np.ndarray | None = None,
    ) -> Equilibrium:
        """Return the static state whose contact states meet their conditions.

        Newton's method finds the static state for given contact states. If these contact states
        violate their conditions, the contact solver finds other contact states, on the slider
        linearised about the static state. In linear geometry the contact solver's states are final.

        Args:
            q: initial coordinates, shape (n_q,).
            states: initial contact states, changed in place.
            given: positions of held blocks, shape (N_x,), in m.
            drive: displacement of the driver since t = 0, in m; None means no driver.
            loose: blocks without friction, shape (N_x,), bool; all others are held. None means
                proportional loading, with friction.
        """
        scene, at, steps = self.scene, ends(self.scene.N_x), 0
        for _ in range(CORRECTIONS):
            q[at.u_x][states.stuck] = given[states.stuck]
            (found, forces, F_T), residual, made = self._newton(q, states, drive)
            q, steps = found.copy(), steps + made
            states.tol = rounding(scene, self.largest(q))
            u_x, u_z = q[at.u_x], q[at.u_z]
            height = u_z + scene.gap
            f = states.slip * (states.law.slide(scene.k_f) * height)
            f = np.where(states.stuck, -forces[at.u_x], f)
            p = np.where(states.closed, -scene.k_f * height, 0.0)
            now = Values(u_x, f, u_z, p, F_T)
            if loose is not None:
                unmet = states.misplaced(now, STUCK, given)
            else:
                unmet = states.unmet_in_loading(now, given) if scene.N_z > 1 else None
            if unmet is None:
                return self._result(found, states, now, drive, residual, steps)
            contact = self._contact(states, now, given, drive)
            if loose is not None:
                contact.hold_at(given, loose | (contact.slip != 0))
            else:
                try:
                    contact.load(given)
                except EquilibriumError:
                    break
                _warn_if_ambiguous(contact)
            states.enter(slice(None), contact.mode)
        T = scene.top.T if drive is None else 0.0
        what = (
            "contact states do not settle" + f" under top.T = {T:g} N; take a smaller one" * bool(T)
        )
        raise EquilibriumError(what, residual, states.tol, steps)

    def _contact(
        self, states: States, now: Values, given: np.ndarray, drive: float | None
    ) -> Contact:
        """Return the contact states on the condensed slider, corrected for the present forces."""
        at, problem = 0.0, self._problem
        if self._loads is not None:
            problem = problem.along(Route(0.0, 1.0, self._loads))
        if drive is None:
            problem = problem.undriven()
        else:
            at = drive + self.scene.d * float(np.mean(self.u_drv0))
        law, driven = states.law, states.driven
        problem = problem.corrected(now, at)
        return Contact(problem, given, at, states.mode, law=law, driven=driven)

    def _newton(
        self, q: np.ndarray, states: States, drive: float | None
    ) -> tuple[tuple[np.ndarray, np.ndarray, float], float, int]:
        """Return the static state for one set of contact states.

        Returned are coordinates, generalised forces without friction of stuck blocks (N), F_T (N),
        the residual force (N) and the number of steps.

        The iteration uses the factors of the reference state (chord iteration). If the iteration
        converges slowly, the factors are renewed. The iteration ends at the level of rounding. The
        iteration also ends below `ACCEPTED` if a renewed tangent does not help. Steps keep their
        leading bits (`System.leading`), so that no kernel of LAPACK changes the state. Linear
        geometry takes three to six steps.
        """
        unknown, unit = self.unknown(states.mode), self.scene.F_N / self.scene.N_x
        if unknown[-1] - unknown[0] == len(unknown) - 1:  # a slice takes less time
            unknown = slice(unknown[0], unknown[-1] + 1)
        how = {"driven": states.driven}
        how["friction"] = -states.law.slide(self.scene.k_f) * states.slip
        factor = self.factor(states.mode, **how)
        arm, limit, renewed = self.arm[unknown], ACCEPTED * unit, False
        best, least, previous = None, np.inf, np.inf
        for step in range(MAX_NEWTON + 1):  # noqa: B007 (returned after the loop)
            with np.errstate(all="ignore"):
                forces, F_T = self.forces(q, states, drive)
                force = forces[unknown]
                residual = float(np.max(np.abs(force / arm)))
            if not np.isfinite(residual):
                break
            rounded = 2.0**-52 * self.largest(q)
            if residual < least:
                best, least = (q, forces, F_T), residual
            if residual <= rounded / 4:
                break
            if residual > 0.5 * previous:
                if least <= 16 * rounded or (renewed and least <= limit):
                    break
                factor, renewed = self.factor(states.mode, **how, q=q), True
            previous = residual
            q = q.copy()
            q[unknown] += self.leading(factor.solve(force), arm, residual)
        limit = max(limit, 16 * 2.0**-52 * self.largest(best[0] if best else q))
        if not least <= limit:
            raise EquilibriumError("Newton's method does not converge", least, limit, step)
        if drive is not None and self.geometry == "finite" and self.largest_turn(best[0]) > 1:
            raise EquilibriumError("the slider turns over", least, limit, step)
        return best, least, step

    def _result(
        self,
        q: np.ndarray,
        states: States,
        now: Values,
        drive: float | None,
        residual: float,
        steps: int,
    ) -> Equilibrium:
        scene, (u, rod) = self.scene, self.displacements(q)
        return Equilibrium(
            u=u,
            rod=rod,
            F_T=now.F_T,
            f=now.f,
            tau=-scene.d * now.f,
            p=np.maximum(now.p, 0.0),
            open=~states.closed,
            slipped=(states.slip != 0) & (drive is None),
            drive=0.0 if drive is None else drive,
            u_drv0=scene.u_driven(u) if drive is None else self.u_drv0,
            residual=residual,
            iterations=steps,
        )


def _warn_if_ambiguous(contact: Contact) -> None:
    """Warn if the definiteness of the slip operator is below `LEAST_DEFINITENESS`."""
    found = contact.definiteness()
    if found < LEAST_DEFINITENESS:
        warnings.warn(
            "friction is so strong that the loaded state may not be the only one. While F_N is "
            f"applied, {np.count_nonzero(contact.slip)} blocks slip, and the definiteness of their "
            f"slip operator is {found:.3g}, below {LEAST_DEFINITENESS:g}. A smaller mu_k makes the "
            "state unique",
            RuntimeWarning,
            stacklevel=7,
        )


@functools.lru_cache(maxsize=4)
def _solver(scene: Scene, geometry: Geometry) -> StaticSolver:
    return StaticSolver(scene, geometry)


def loaded_state(scene: SceneLike, geometry: Geometry = "linear") -> Equilibrium:
    """Return the initial state of a run: F_N applied with friction active, F_T = 0.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        geometry: "linear" or "finite".

    Returns:
        The equilibrium; its u_drv0 is u_x of the driven blocks.

    Raises:
        SceneError: not a scene, unknown geometry, or finite geometry for a chain.
        EquilibriumError: no equilibrium was found.

    Warns:
        RuntimeWarning: blocks slip while F_N is applied, and the state may not be unique.

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
) -> Equilibrium:
    """Return the equilibrium with the interface held: see `StaticSolver.solve`."""
    scene = as_scene(scene)
    check_geometry(geometry, scene)
    return _solver(scene, geometry).solve(u_x_bottom, drive, free=free)


class RememberedStates:
    """A `StaticSolver` that stores its solutions, so that each state is solved only once.

    The search for a new state starts at the latest state.
    """

    def __init__(self, solver: StaticSolver) -> None:
        self.finder = solver
        self.latest: Equilibrium | None = None
        self.found: dict[tuple[Any, ...], Static | EquilibriumError] = {}

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
    ) -> Static:
        key = u_x_bottom.tobytes(), float(drive), free.tobytes(), load
        if key not in self.found:
            try:
                how = {"free": free, "load": load, "near": self.latest}
                rest = self.finder.solve(u_x_bottom, drive, **how)
                if isinstance(rest, Equilibrium):
                    self.latest = rest
                self.found[key] = Static(rest.F_T, rest.tau, rest.p)
            except EquilibriumError as error:
                self.found[key] = error
        found = self.found[key]
        if isinstance(found, EquilibriumError):
            raise found
        return found
