"""Initial states in which some blocks already slip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from pyfric.engines.options import step_size
from pyfric.scene import SceneError, as_scene
from pyfric.statics import check_sticks, loaded_state

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.scene import SceneLike

__all__ = ["released"]


def released(scene: SceneLike, blocks: int, dt: float | Literal["auto"] = "auto") -> State:
    """Return the loaded state with the first blocks from the trailing edge released.

    The released blocks start with zero velocity and slip in the drive direction. Their friction has
    already fallen to mu_k. This starts a front in a chain or on a prescribed interface:
    ``simulate(scene, t_end, initial=released(scene, 20), fidelity="dynamic")``.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        blocks: number of released blocks, 1 to N_x.
        dt: time step of the run, as in `step_size`.

    Raises:
        SceneError: the number of blocks is out of range, the friction law has no static states, or
            the step is refused.
    """
    scene = as_scene(scene)
    check_sticks(scene)
    if not (isinstance(blocks, int | np.integer) and 1 <= blocks <= scene.N_x):
        raise SceneError("blocks", blocks, "", f"a whole number from 1 to N_x = {scene.N_x}")
    state, first = loaded_state(scene).state(scene, step_size(scene, dt)), scene.n_of_i <= blocks
    state.mode[first] = scene.d
    weakened = np.broadcast_to(scene.law.d_c, first.shape)[first]
    state.s_0[first] = weakened - scene.d * state.y[0, 0][first]
    return state
