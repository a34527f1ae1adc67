"""Static states at fixed contact states, and data that later jumps reuse.

Modes of contact states, and paths on which static states lie, are stored.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric import core
from pyfric.engines.cost import set_up
from pyfric.engines.modes import Modes, modes_at, modes_of
from pyfric.engines.path import at, rest
from pyfric.engines.slipping import SlipGaps, SlipSpace
from pyfric.engines.space import N_MODES, Space, loaded_space
from pyfric.statics import EquilibriumError, Memory, Static, Weakening, ends

if TYPE_CHECKING:
    from pyfric.engines.jump import Landing
    from pyfric.statics import Equilibrium, StaticSolver

BALANCED = 1e-10
"""Largest error of a contact force in static states of events, over F_N."""
KEPT, KEPT_SLIPS, PATHS = 8, 3, 1e8
"""Largest number of sets of contact states whose modes are stored; largest number of sets of
slipping blocks whose shapes are stored; memory for stored paths of static states, in bytes."""


class Start(NamedTuple):
    """The start of searches for static states at given contact states.

    Attributes:
        q: coordinates of the last static state, shape (n_q,), in m.
        drive: displacement of the driver in this state, in m.
        load: F_N and T in this state, in N; None means those at t = 0.
        drift: dq/d(drive) at the end of the last jump, shape (n_q,).
        contraction: last observed factor by which an iteration reduces the error.
    """

    q: np.ndarray
    drive: float
    load: tuple[float, float] | None
    drift: np.ndarray
    contraction: float


class RestStates:
    """Static states at fixed contact states, and data that later jumps reuse.

    Stored are the modes at the last tangent that a jump needed, and the starts of searches for
    static states and their derivatives. Results of a jump depend on stored data: within its
    accuracy in finite geometry, within rounding in linear geometry.

    Args:
        solver: static states of the scene in its geometry.
        dt: time step of the run, in s.
        stepper: the stepper that makes these steps.
        made: counts of the run; "modal_bases" is increased.
    """

    def __init__(self, solver: StaticSolver, dt: float, stepper: str, made: dict[str, int]) -> None:
        self.known, self.dt, self.stepper, self.made = solver, dt, stepper, made
        self._loaded = ~(solver.loaded.open | solver.scene.bare)
        room = core.available() / set_up(solver.scene, "hybrid", solver.geometry).bytes
        self._modes: Memory[Modes] = Memory(int(min(max(room, 1), KEPT)))
        paths = int(max(PATHS / (3 * 8 * len(solver.arm)), 1))
        self._rests: Memory[tuple[float, np.ndarray]] = Memory(paths)
        self._starts: Memory[Start] = Memory(paths)
        self._unstable: set[bytes] = set()
        self._slips: Memory[SlipSpace] = Memory(KEPT_SLIPS)

    def slipping(self, closed: np.ndarray, weakening: Weakening, q: np.ndarray) -> Modes:
        """Return the modes with slipping blocks at the tangent of a state q (m), shape (n_q,).

        Args:
            closed: blocks in contact, shape (N_x,), bool.
            weakening: friction of the blocks that slip.
            q: coordinates, shape (n_q,), in m.

        Raises:
            EquilibriumError: the static state is unstable.
        """
        slips = np.flatnonzero(weakening.way)
        key = closed.tobytes() + slips.tobytes()
        space = self._slips.made(key, lambda: SlipSpace(self.modes(closed).space, slips))
        slipping = space.at(weakening, q)
        return modes_at(SlipGaps(slipping), slipping.tangent_at(q), self.dt, self.stepper)

    def modes(self, stuck: np.ndarray) -> Modes:
        """Return the modes of the slider at these contact states."""
        return self._modes.made(stuck.tobytes(), lambda: self._found(stuck))

    def _found(self, stuck: np.ndarray) -> Modes:
        """Return new modes. If few blocks were released, extend the space of the loaded slider."""
        self.made["modal_bases"] += 1
        if (stuck == self._loaded).all():
            return modes_of(loaded_space(self.known), self.dt, self.stepper)
        released = self._loaded & ~stuck
        added = 4 * released.sum()  # two responses of each block, and their viscous corrections
        extends = added <= N_MODES and not (stuck & ~self._loaded).any()
        near = loaded_space(self.known) if extends else None
        return modes_of(Space(self.known, stuck, near), self.dt, self.stepper)

    def renew(self, stuck: np.ndarray, q: np.ndarray) -> Modes:
        """Return the modes at the tangent of a state q (m), and store these modes."""
        renewed = self._modes[stuck.tobytes()] = self.modes(stuck).at(q)
        return renewed

    def start(self, stuck: np.ndarray) -> Start:
        """Return the start of searches at contact states; at first, the loaded state."""
        known = self.known

        def loaded() -> Start:
            q = known.coordinates(known.loaded.u, known.loaded.rod)
            return Start(q, 0.0, None, self.modes(stuck).space.drift, 1.0)

        return self._starts.made(stuck.tobytes(), loaded)

    def at(
        self,
        u_x: np.ndarray,
        stuck: np.ndarray,
        drive: float,
        load: tuple[float, float] | None,
        enough: float,
        near: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return coordinates (m) and forces (N) of the static state, or None if none is found.

        The search starts on a stored path with these stuck blocks at these positions. Without such
        a path, the start is the latest state with these contact states, plus the slip of few
        blocks. If many blocks have slipped, the start is `near` (m).
        """
        key = stuck.tobytes()
        if key in self._unstable:
            return None
        try:
            modes, start = self.modes(stuck), self.start(stuck)
        except EquilibriumError:
            self._unstable.add(key)
            return None
        held = modes.space.held
        place = key, u_x[held].tobytes()
        if place in self._rests:
            drive_0, path = self._rests[place]
            q = at(path, drive - drive_0)
        else:
            q = modes.space.carried(start.q, u_x[held], drive - start.drive)
            if q is None or load != start.load:
                q = start.q.copy() if near is None else near.copy()
        q[held] = u_x[held]
        found = rest(modes, q, drive, load, enough, start.contraction)
        if found is None:
            self._starts[key] = start._replace(contraction=1.0)
            return None
        q, forces, contraction = found
        self._starts[key] = Start(q, drive, load, start.drift, contraction)
        path = np.array([q, start.drift, np.zeros_like(q)])
        self._rests.made(place, lambda: (drive, path))
        return q, forces

    def keep(self, u_x: np.ndarray, stuck: np.ndarray, landing: Landing) -> None:
        """Store the path of a jump if only the driver moves. Static states lie on this path."""
        jump, key = landing.jump, stuck.tobytes()
        outside, drift = jump.outside, jump.drift_at(landing.n * self.dt)
        if drift is not None:
            self._starts[key] = self.start(stuck)._replace(drift=drift)
        if outside.steady and outside.V and not any(outside.gain):
            path = jump.path.q / np.array([[1.0], [outside.V], [outside.V**2]])
            self._rests[key, u_x[stuck].tobytes()] = outside.drive, path

    def solve(
        self,
        u_x: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
        near: Equilibrium | None = None,
    ) -> Static | Equilibrium:
        """Return a static state for the catalogue, at these contact states if they are consistent.

        Otherwise the static solver finds the state.
        """
        scene, bottom, found = self.known.scene, ends(len(free)), None
        if not free.all():
            found = self.at(u_x, ~free, drive, load, BALANCED * scene.F_N)
        if found is not None:
            q, forces = found
            height, closed = q[bottom.u_z] + scene.gap, ~free | self.known.pressed
            if not ((np.where(closed, height, -height) > 0) & scene.touches).any():
                moved = float(self.known.driven_row @ q)
                F_T = scene.driver_force(drive, moved, self.known.u_drv0)
                tau = np.where(free, 0.0, scene.d * forces[bottom.u_x])
                return Static(F_T, tau, np.where(closed, -scene.k_f * height, 0.0))
        return self.known.solve(u_x, drive, free=free, load=load, near=near)
