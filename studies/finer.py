"""Start a fine lattice from the state of a coarser one, just before an event.

At the first slip of an event all blocks stick or are open. Tractions then define the state, because
friction does not depend on earlier slip. The finer lattice gets, at each block, the ratio of
friction to contact force of the coarser lattice at the same place. The displacements follow from
equilibrium,

    f_i = r(x_i) p_i   where the interface touches,   f_i = p_i = 0   where it is open.

The slider moves with the driver; waves of the coarse lattice are left out.

Unlike in a run from the loaded slider, the tractions are those that events on the coarse lattice
left, interpolated between its blocks. `fronts` measures the effect of this difference.

Source: PRL 107, 074301 (2011), tractions at crack initiation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pyfric.engines import step_size
from pyfric.statics import ContactProblem, EquilibriumError, StaticSolver
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core import State
    from pyfric.record import Record
    from pyfric.scene import Scene
    from pyfric.statics import Equilibrium

__all__ = ["held", "moved", "refined", "tractions"]

BELOW = 1e-9
"""Least excess of strength over friction at a block that starts stuck, in units of mu_s."""


AHEAD = 1e-4
"""Time between the two static states that give the speed of the slider under its driver, s."""


def tractions(record: Record, event: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the friction of a record just before an event, interpolated between its blocks.

    Args:
        record: a run.
        event: its number, from 1.
        x: positions from the middle of the slider, shape (n,), in m.

    Returns:
        f/p, shape (n,), and whether the interface is open at these positions, shape (n,), bool.
    """
    scene, row = record.scene, record.row(event)
    p = record.p_before[row]
    closed = p > 0
    ratio = -scene.d * record.tau_before[row][closed] / p[closed]
    here = np.rint((x - scene.x[0]) / scene.slider.l).astype(int)
    open_ = ~closed[np.clip(here, 0, scene.N_x - 1)]
    return np.interp(x, scene.x[closed], ratio), open_


def held(record: Record, event: int, scene: Scene) -> Callable[[float], Equilibrium]:
    """Return states of a finer lattice at rest just before an event.

    Args:
        record: a run on a coarser lattice.
        event: its number, from 1.
        scene: the same scene with a smaller l.

    Returns:
        The state of rest as a function of time, s, which sets the driver's position.

    Raises:
        SceneError: the slider has another length, or its friction depends on more than slip.
        EquilibriumError: the open blocks do not settle.
    """
    if not np.allclose(scene.x[[0, -1]], record.scene.x[[0, -1]], rtol=1e-9, atol=0):
        allowed = f"{record.scene.slider.L:g} m, as in the record"
        raise SceneError("slider.L", scene.slider.L, "m", allowed)
    t = float(record.events["t_start"].loc[event])
    ratio, open_ = tractions(record, event, scene.x)
    most = (1 - BELOW) * scene.law.static.hold(1.0)
    solver = StaticSolver(scene)
    drive = scene.drive(t) + scene.d * float(np.mean(solver.u_drv0))
    u_x, open_ = _displacements(scene, np.clip(ratio, -most, most), open_, drive)
    return lambda time: solver.solve(u_x, scene.drive(time), free=open_)


def refined(record: Record, event: int, scene: Scene) -> State:
    """Return the state of a finer lattice at the first slip of an event.

    Args and Raises are those of `held`.
    """
    t, at = float(record.events["t_start"].loc[event]), held(record, event, scene)
    return moved(at, scene, t, step_size(scene))


def moved(at: Callable[[float], Equilibrium], scene: Scene, t: float, dt: float) -> State:
    """Return the static state at t (s), with its rates under the moving driver; steps are dt."""
    now, later = (at(time).state(scene, dt, t) for time in (t, t + AHEAD))
    now.y[:, 2:] = (later.y[:, :2] - now.y[:, :2]) / AHEAD
    now.rod[3:] = (later.rod[:3] - now.rod[:3]) / AHEAD
    return now


def _displacements(
    scene: Scene, ratio: np.ndarray, open_: np.ndarray, drive: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return u_x (m) of the interface in equilibrium with f = ratio p, and its open blocks."""
    problem, N_x, open_ = ContactProblem(scene), scene.N_x, open_.copy()
    for _ in range(4 * N_x):
        table = problem.base(~open_)
        f, u_z = table[N_x : 2 * N_x], table[2 * N_x : 3 * N_x]
        rows = f + np.where(open_, 0.0, ratio * scene.k_f)[:, None] * u_z
        u_x = -np.linalg.solve(rows[:, :N_x], rows[:, N_x:] @ [drive, 1.0])
        depth = u_z @ np.concatenate([u_x, [drive, 1.0]])
        wrong = np.where(open_, -depth, depth)
        if wrong.max() <= 0:
            return u_x, open_
        open_[np.argmax(wrong)] ^= True
    raise EquilibriumError("the set of open blocks does not settle", np.nan, 0.0, 4 * N_x)
