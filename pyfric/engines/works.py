"""The energy budget of a jump over rest.

While nothing slips, the motion is a polynomial plus decaying modes, and works have closed forms.
With the position x of the driver and loads b they are

    driver   int F_T dx = K [x^2/2 + d u_drv0 x] - K d int u_h V ds ,
    loads    int b.q' ds = [b.q] - b' . int q ds .

The heat of dashpots is the work minus the change of the stored energy.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from pyfric import core

if TYPE_CHECKING:
    from pyfric.core import Model, State
    from pyfric.engines.jump import Landing
    from pyfric.statics import StaticSolver


def works_of_jump(solver: StaticSolver, landing: Landing, q: np.ndarray) -> np.ndarray:
    """Return works of the driver and of all other external forces in a jump, shape (2,), in J.

    Args:
        solver: static states of the scene in its geometry.
        landing: end of the jump.
        q: coordinates at the start of the jump, shape (n_q,), in m.
    """
    scene, jump, outside = solver.scene, landing.jump, landing.jump.outside
    s, K, d, home = landing.n * jump.dt, scene.driver.K, scene.d, np.mean(solver.u_drv0)
    x_0, x_1 = (outside.drive_at(part) for part in (0.0, s))
    moved = jump.integral(solver.driven_row, s, (outside.V, outside.a))
    driver = K * (x_1 - x_0) * ((x_0 + x_1) / 2 + d * home) - K * d * moved
    loads = [solver.under(outside.load_at(part)).load for part in (0.0, s)]
    load = loads[1] @ landing.q - loads[0] @ q
    if any(outside.gain):
        load -= jump.integral(outside.load_rate, s, (1.0, 0.0))
    return np.array([driver, load])


def add_jump(
    solver: StaticSolver, model: Model, state: State, landing: Landing, q: np.ndarray
) -> None:
    """Add the works of a jump and the heat of dashpots to the budget of a state.

    The heat is divided evenly among rows of dashpots.

    Args:
        solver: static states of the scene in its geometry.
        model: the scene in the form that the core takes.
        state: the state at the start of the jump.
        landing: end of the jump.
        q: coordinates at the start of the jump, shape (n_q,), in m.
    """
    works, t = works_of_jump(solver, landing, q), state.t + landing.n * state.dt
    then = dataclasses.replace(state, y=state.y.copy())
    then.y[:, :2], rod = solver.displacements(landing.q)
    then.y[:, 2:], rates = solver.displacements(landing.v)
    then.rod = np.concatenate([rod, rates])
    before, after = (
        sum(core.energies(model, found, at).values()) for found, at in ((state, state.t), (then, t))
    )
    state.work += works
    state.dissipated += (works.sum() - (after - before)) / len(state.dissipated)
