"""Gaps that give prescribed normal forces at the start, such as measured forces.

With p prescribed, the bottom row is at u_z where S_zz u_z = loads + p - S_zx u_x, and a block that
carries p_i has the gap g_i = -u_z,i - p_i/k_f,i. Translation of a slider (and tilt, without a rod)
changes no force. Of all gaps that are nowhere negative, the gaps with the smallest mean are chosen.
If the slider can tilt freely, the gaps have no mean slope.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.scene import as_scene
from pyfric.statics.complementarity import ContactProblem
from pyfric.statics.condensation import condense
from pyfric.statics.rest import EquilibriumError
from pyfric.statics.rows import ends
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pyfric.scene import Number, Scene, SceneLike

OFF = 1e-9
"""Accepted error of p, over F_N/N_x. Two to four iterations reach this accuracy."""
ROUNDS = 30
"""Largest number of iterations; each finds u_x of blocks that slip under the previous gaps."""
UNBALANCED = 1e-6
"""Largest accepted net force of p and loads, over F_N, and net torque, over F_N L."""
TILT = 1e-3
"""Largest tilt of a rod at t = 0 that p may need (a choice, far above the tilt in any run)."""


def pressed(scene: SceneLike, *, p: Sequence[Number] | Callable[[float], float]) -> Scene:
    """Return a scene with gaps under which the blocks carry p at t = 0, in linear geometry.

    In finite geometry p differs by a fraction of the order of the strain, 1e-3 in Fig. 1.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file; its gaps are replaced.
        p: normal forces at t = 0: N_x numbers >= 0 in N from the trailing edge on, or a function of
            x (m). x is the distance from the first block at the trailing edge. The sum of p is F_N,
            plus the weight if there is gravity. The torque of p equals the torque of the load.
            Under a rod the two torques may differ slightly; the mattress carries the difference.

    Raises:
        SceneError: p is prescribed already, does not fit the blocks, or is not in balance.
        EquilibriumError: blocks slip so much under F_N that no gaps are found.
    """
    scene = as_scene(scene)
    if not np.any(scene.k_f) or scene.N_z == 1:
        raise SceneError("top.kind", scene.top.kind, "", "'rod' or 'distributed'", "p is given")
    target = _checked(scene, p)
    order, (x, z, *_) = np.argsort(scene.n_of_i), ends(scene.N_x)
    slider, k_f = condense(scene), np.where(scene.touches, scene.k_f, 1.0)
    loads = slider.G @ np.array([0.0, 1.0, scene.F_N, scene.top.T])
    u_x, rises = np.zeros(scene.N_x), np.column_stack([np.ones(scene.N_x), scene.x])
    for _ in range(ROUNDS):
        force = loads[z] + target - slider.S[z, x] @ u_x
        u_z = np.linalg.lstsq(slider.S[z, z], force, rcond=1e-12)[0]
        gap = -u_z - target / k_f
        if not scene.kappa:  # without a slope, which no force determines
            gap -= rises @ np.linalg.lstsq(rises, gap, rcond=None)[0]
        gap = np.where(scene.touches, gap - gap[scene.touches].min(), 0.0)
        found = scene.replace({"interface.gap": gap[order].tolist()})
        now = ContactProblem(found).loaded().values()
        if np.abs(now.p - target).max() <= OFF * scene.F_N / scene.N_x:
            return found
        u_x = now.u_x
    what = "no gaps are found: blocks slip while F_N is applied. A larger mu_s holds them"
    worst = float(np.abs(now.p - target).max())
    raise EquilibriumError(what, worst, OFF * scene.F_N / scene.N_x, ROUNDS)


def _checked(scene: Scene, p: Any) -> np.ndarray:
    """Return p of each block, shape (N_x,), in N, after a check that p carries the slider."""
    l, N_x, order = scene.slider.l, scene.N_x, scene.n_of_i - 1
    values = [p(n * l) for n in range(N_x)] if callable(p) else list(p)
    if len(values) != N_x:
        raise SceneError("p", len(values), "", f"{N_x} numbers", "one for each block")
    numbers = [check_number(f"p, block {n}", v, "N", ge=0.0) for n, v in enumerate(values, 1)]
    target = np.array(numbers)[order]
    bad = ~scene.touches & (target > 0)
    if bad.any():
        n = int(scene.n_of_i[np.argmax(bad)])
        raise SceneError(f"p, block {n}", numbers[n - 1], "N", "0 N", "a block without contact")
    missing = float(target.sum()) - scene.pressing
    if abs(missing) > UNBALANCED * scene.F_N:
        factor, what = scene.pressing / target.sum(), "F_N + weight" if scene.slider.g else "F_N"
        allowed = f"a sum of {what} = {scene.pressing!r} N; multiply p by {factor:.9g}"
        raise SceneError("p", float(target.sum()), "N", allowed, "does not carry the load")
    torque = float((target - scene.load) @ scene.x)
    limit = max(UNBALANCED * scene.F_N * scene.slider.L, TILT * scene.kappa)
    if abs(torque) > limit:
        reason = "torque of p about the centre, minus that of the loads: the slider would tilt"
        raise SceneError("p", torque, "N m", f"0 N m, within {limit:.3g} N m", reason)
    return target
