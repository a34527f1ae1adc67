"""Steps of the moving part of a chain.

In a chain, forces pass only between neighbours. A block that rests between resting blocks stays
where it is, and the force on it is linear in the motion of the driver. Steps are therefore made for
the moving part alone: blocks that slip, blocks that the driver may release, and some resting blocks
on both sides. If slip comes within two blocks of an end of this part, the steps are repeated with
twice as many resting blocks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric import core
from pyfric.core import STUCK
from pyfric.engines.space import loaded_space
from pyfric.statics import CONTACT_TOL, ends

if TYPE_CHECKING:
    from pyfric.core import Log, Model, State, Status
    from pyfric.engines.space import Space
    from pyfric.record import Method
    from pyfric.scene import Scene
    from pyfric.statics import StaticSolver

ASIDE = 16
"""Initial number of resting blocks on each side of the blocks that may slip. It is also the number
of steps between two choices of the moving part, because a wave takes more than a step to the next
block. A larger number lengthens the time of a step, a smaller number is doubled more often. Results
depend on the number only by rounding."""


LEAST = 160
"""Least number of blocks of a chain whose moving part takes less time than the whole. It is a
policy: results depend on it only by rounding. In the preset `chain`, time of the moving part over
time of the whole is 1.1 with 57 blocks, 1.03 with 110, 0.84 with 200, and 0.58 with 300."""


def has_parts(scene: Scene) -> bool:
    """Return whether steps of the moving part alone are possible and save time."""
    if scene.N_x < LEAST:
        return False
    steady = not (scene.corners or scene.top.push or scene.interface.limit)
    return scene.N_z == 1 and scene.law.bears_mu_s and steady


def may_slip(scene: Scene, space: Space, state: State, n_steps: int) -> np.ndarray:
    """Return which blocks move, or may begin to slip within n_steps, shape (N_x,), bool.

    Under a steady driver, the margin of a resting block to slip is concave in time while all other
    blocks rest. The margin is therefore smallest at the beginning or at the end.

    Args:
        scene: a scene that `has_parts`.
        space: static solutions of the chain.
        state: its state.
        n_steps: number of steps.
    """
    (_, u_z, v_x, v_z), at = state.y[0], ends(scene.N_x)
    small = CONTACT_TOL * scene.F_N / scene.N_x
    moves = (
        (state.mode != STUCK) | (v_x != 0) | (np.abs(v_z) * np.sqrt(scene.k_f * scene.m) > small)
    )
    q, p = space.solver.coordinates(state.y[:, :2], state.rod[:3]), -scene.k_f * (u_z + scene.gap)
    begin, end = (state.t0 + n * state.dt for n in (state.step, state.step + n_steps + 1))
    f = space.forces(q, scene.drive(begin), scene.load_at(begin))
    later = f + (scene.drive(end) - scene.drive(begin)) * space.solver.push
    if scene.load_at(begin) is not None:
        loads = (space.solver.under(scene.load_at(t)).load for t in (end, begin))
        later += np.subtract(*loads)
    law = scene.law.static
    for forces in (f, later):
        moves |= law.remaining(p, forces[at.u_x]) <= small
    return moves


class MovingParts:
    """The stepper of a scene that `has_parts`.

    Args:
        known: static states of the scene.
        method: method of the run, without energies and threshold.
    """

    longest = ASIDE
    """Largest number of steps of one call."""

    def __init__(self, known: StaticSolver, method: Method) -> None:
        self.known = known
        self.how = {"stepper": method.stepper, "switching": method.switching, "budget": False}

    def advance(self, model: Model, state: State, log: Log, n_steps: int) -> Status:
        """Make up to n_steps; see `pyfric.core.advance`."""
        scene, space = self.known.scene, loaded_space(self.known)
        found = np.flatnonzero(may_slip(scene, space, state, n_steps))
        aside, N_x = ASIDE, scene.N_x
        while len(found):
            first, end = max(found[0] - aside, 0), min(found[-1] + 1 + aside, N_x)
            if end - first + 2 * aside >= N_x:
                break
            part = core.Part(model, first, end)
            own = part.state(state)
            switches = core.Log(end - first, quiet=log.quiet_i.shape[1], every=log.every)
            status = core.advance(part.model, own, switches, n_steps, **self.how)
            if not part.switched(switches):
                _take(scene, part, (own, switches), (state, log))
                return status
            aside *= 2
        return core.advance(model, state, log, n_steps, **self.how)


def _take(scene: Scene, part: core.Part, own: tuple[State, Log], whole: tuple[State, Log]) -> None:
    """Copy the state and log of a part to the whole, with the driver's forces on other blocks."""
    state, log = whole
    begin = state.step
    part.log(own[1], log, state)
    driven = np.zeros(scene.N_x, bool)
    driven[scene.i_h : scene.i_h_end + 1] = True
    driven[part.first : part.end] = False
    rest = float(np.sum((state.y[0, 0] - state.u_drv0)[driven])), int(driven.sum())
    part.put(own[0], state)
    points = (begin // max(log.every, 1) + 1 + np.arange(log.n_point)) * log.every
    for forces, times in (
        (log.points[0, : log.n_point], state.t0 + points * state.dt),
        (log.quiet_r[2, : log.n_quiet], log.quiet_r[1, : log.n_quiet]),
    ):
        x = np.array([scene.drive(t) for t in times])
        forces += scene.driver.K / scene.n_driven * (rest[1] * x - scene.d * rest[0])
