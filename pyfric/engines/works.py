"""Works of the driver and of loads in a jump over rest.

While nothing slips, blocks move along a polynomial and in decaying modes, so that the integrals of
forces over the motion have closed forms:

    driver   int F_T dx = K [x^2/2 + d u_drv0 x] - K d int u_h V ds ,   F_T = K (x - d (u_h - u_drv0))
    loads    int b.q' ds = [b.q] - b' . int q ds .
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pyfric.engines.jump import Landing
    from pyfric.statics import StaticSolver


def works_of_jump(solver: StaticSolver, landing: Landing, q: np.ndarray) -> np.ndarray:
    """Return works of the driver, and of loads and shear, in a jump, in J.

    Args:
        solver: static states of the scene in its geometry.
        landing: end of the jump.
        q: coordinates at its begin, shape (n_q,), in m.
    """
    scene, jump, outside = solver.scene, landing.jump, landing.jump.outside
    s, K, d, home = landing.n * jump.dt, scene.driver.K, scene.d, np.mean(solver.u_drv0)
    x_0, x_1 = (outside.drive_at(part) for part in (0.0, s))
    moved = jump.integral(solver.driven_row, s, (outside.V, outside.a))
    driver = K * (x_1 - x_0) * ((x_0 + x_1) / 2 + d * home) - K * d * moved
    loads = [solver.under(outside.load_at(part)).load for part in (0.0, s)]
    load = loads[1] @ landing.q - loads[0] @ q
    if any(outside.gain):
        load -= jump.integral(solver.under(outside.gain).load, s, (1.0, 0.0))
    return np.array([driver, load])
