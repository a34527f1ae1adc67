"""Static condensation: the slider as its interface feels it.

All rows above the bottom one, the rod and the driver spring are eliminated, from the top downward.
What is left is the potential of the interface v = (u_x, u_z) and of the driver's position,
without foundation and friction,

    U(v, drive) = v.S v/2 - v.(g_0 + g_1 drive) + c_2 drive^2/2 + c_1 drive,

so that S v - g_0 - g_1 drive are the forces the interface has to carry and F_T = dU/d(drive).
The driver spring is relaxed at drive = 0 with the driven block at u_x = 0: drive = V t + d u_drv0.

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
        g_0: load on the interface at drive = 0, shape (2 N_x,), in N.
        g_1: the same per driver position, shape (2 N_x,), in N/m.
        c_1: F_T at v = 0, drive = 0, in N.
        c_2: stiffness the driver feels, in N/m.
    """

    S: np.ndarray
    g_0: np.ndarray
    g_1: np.ndarray
    c_1: float
    c_2: float

    def F_T(self, v: np.ndarray, drive: float) -> float:
        """Return the force of the driver in N at v, shape (2 N_x,), and drive, in m."""
        return self.c_1 + self.c_2 * drive - float(self.g_1 @ v)

    def undriven(self) -> Condensed:
        """Return the slider without its driver, which is wherever F_T = 0."""
        S = self.S - np.outer(self.g_1, self.g_1) / self.c_2
        g_0 = self.g_0 - self.g_1 * (self.c_1 / self.c_2)
        return Condensed(S=S, g_0=g_0, g_1=np.zeros_like(g_0), c_1=0.0, c_2=0.0)

    @property
    def outside(self) -> tuple[np.ndarray, np.ndarray]:
        """What drive and 1 do: loads on the interface, (2 N_x, 2), and F_T, shape (2,)."""
        return np.column_stack([self.g_1, self.g_0]), np.array([self.c_2, self.c_1])


def condense(scene: Scene, load: tuple[float, float] | None = None) -> Condensed:
    """Eliminate the slider above its bottom row, with rod and driver.

    Args:
        scene: the scene.
        load: F_N and T, in N; None means the loads at t = 0.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    N_x, N_z, K = scene.N_x, scene.N_z, scene.driver.K
    stiff = stiffness(scene, closed=np.zeros(N_x, dtype=bool))
    n = stiff.shape[0]
    g = np.zeros((n, 2))
    if scene.rigid:
        g[-2, 0] = -(scene.F_N if load is None else load[0])
    elif load is None:
        g[-N_x:, 0] = -scene.load
        g[-2 * N_x : -N_x, 0] = scene.shear
    else:
        g[-N_x:, 0] = -scene.load * (load[0] / scene.F_N)
        g[-2 * N_x : -N_x, 0] = scene.d * load[1] / N_x
    # Under a rod the driven block of the top row moves with the rod.
    on_rod = scene.rigid and scene.j_h == N_z - 1
    g[n - 3 if on_rod else driven_dof(scene), 1] = K * scene.d

    edges = [*range(0, 2 * N_x * N_z, 2 * N_x), n]
    c_1, c_2 = 0.0, K
    A, r = stiff[edges[-2] :, edges[-2] :].toarray(), g[edges[-2] :]
    for j in range(N_z - 2, -1, -1):
        here, above = slice(edges[j], edges[j + 1]), slice(edges[j + 1], edges[j + 2])
        B = stiff[above, here]
        _, solved, failed = dposv(
            A, np.column_stack([B.toarray(), r]), overwrite_a=1, overwrite_b=1
        )
        if failed:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0)
        to_B, to_r = solved[:, : 2 * N_x], solved[:, 2 * N_x :]
        c_1 -= float(r[:, 1] @ to_r[:, 0])
        c_2 -= float(r[:, 1] @ to_r[:, 1])
        BT = B.T.tocsr()
        half = BT @ to_B
        A = stiff[here, here].toarray() - (half + half.T) / 2
        r = g[here] - BT @ to_r
    return Condensed(S=A, g_0=r[:, 0], g_1=r[:, 1], c_1=c_1, c_2=c_2)
