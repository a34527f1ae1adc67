"""Static condensation: the slider as its interface feels it.

All rows above the bottom one, the rod and the driver spring are eliminated, from the top downward.
What is left, without foundation and friction, is a potential U of the interface v = (u_x, u_z) and
of what is outside, w = (drive, 1, F_N, T). It is quadratic, so that with S, G and c

    S v - G w are the forces the interface has to carry,   F_T = dU/d(drive) = c.w - G_drive.v .

The driver spring is relaxed at drive = 0 with the driven block at u_x = 0: drive = V t + d u_drv0.
The second of w stands for the loads at t = 0, in place of F_N and T.

The lattice couples neighbouring rows only. Eliminating row j + 1 therefore changes row j alone:

    A_j = K_jj - K_j,j+1 A_j+1^-1 K_j+1,j ,

dense matrices of 2 N_x unknowns, N_z of them; the rod has three.

Source: block elimination (Schur complements) of the linear geometry of PRL 107, 074301 (2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dposv

from pyfric.statics.operators import driven_dof, stiffness
from pyfric.statics.rest import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["LARGE", "Condensed", "condense"]

LARGE = 10_000
"""Unknowns from which on condensing takes seconds: 3 N_z (2 N_x)^3 operations, 7e8 in the Fig. 1
scene, 1e12 with 561 x 301 blocks."""


@dataclass(frozen=True)
class Condensed:
    """The slider condensed onto its interface (linear geometry); see the top of this module.

    Attributes:
        S: stiffness of the interface, driver attached, shape (2 N_x, 2 N_x), in N/m.
        G: loads on the interface by w, shape (2 N_x, 4), in N/m, N, 1 and 1.
        c: F_T by w at v = 0, shape (4,), in the same units.
    """

    S: np.ndarray
    G: np.ndarray
    c: np.ndarray

    def undriven(self) -> Condensed:
        """Return the slider without its driver, which is wherever F_T = 0."""
        drive = self.G[:, 0]
        S = self.S - np.outer(drive, drive) / self.c[0]
        return Condensed(S, self.G - np.outer(drive, self.c / self.c[0]), np.zeros(4))


def condense(scene: Scene) -> Condensed:
    """Eliminate the slider above its bottom row, with rod and driver.

    Args:
        scene: the scene.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    N_x, N_z = scene.N_x, scene.N_z
    stiff = stiffness(scene, closed=np.zeros(N_x, dtype=bool))
    n = stiff.shape[0]
    r, c = np.zeros((n, 4)), np.array([scene.driver.K, 0.0, 0.0, 0.0])
    # Under a rod the driven block of the top row moves with the rod.
    on_rod = scene.rigid and scene.j_h == N_z - 1
    r[n - 3 if on_rod else driven_dof(scene), 0] = scene.driver.K * scene.d
    if scene.rigid:
        r[-2, 1:3] = -scene.F_N, -1.0
    else:
        r[-N_x:, 1], r[-N_x:, 2] = -scene.load, -scene.load / scene.F_N
        r[-2 * N_x : -N_x, 1], r[-2 * N_x : -N_x, 3] = scene.shear, scene.d / N_x

    edges = [*range(0, 2 * N_x * N_z, 2 * N_x), n]
    A, G = stiff[edges[-2] :, edges[-2] :].toarray(), r[edges[-2] :]
    for j in range(N_z - 2, -1, -1):
        here, above = slice(edges[j], edges[j + 1]), slice(edges[j + 1], edges[j + 2])
        B = stiff[above, here]
        _, solved, failed = dposv(
            A, np.column_stack([B.toarray(), G]), overwrite_a=1, overwrite_b=1
        )
        if failed:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0)
        to_B, to_G = solved[:, : 2 * N_x], solved[:, 2 * N_x :]
        c -= G[:, 0] @ to_G
        BT = B.T.tocsr()
        half = BT @ to_B
        A = stiff[here, here].toarray() - (half + half.T) / 2
        G = r[here] - BT @ to_G
    return Condensed(A, G, c)
