"""Static condensation of the slider onto its interface.

All rows above the bottom row, the rod and the driver spring are eliminated, from the top downward.
The result, without foundation and friction, is a quadratic potential U of the interface
v = (u_x, u_z) and of driver and loads w = (drive, 1, F_N, T). With matrices S, G and a vector c,

    forces that the interface has to carry = S v - G w ,   F_T = dU/d(drive) = c.w - G_drive.v .

The driver spring is relaxed at drive = 0 if the driven block is at u_x = 0, so that
drive = V t + d u_drv0. For a plate u_drv0 is the mean over its blocks; differences between the
blocks add constant forces (`Plate`). The second component of w stands for the loads at t = 0. The
last two components replace it if loads change.

The lattice couples only neighbouring rows. Elimination of row j + 1 therefore changes only row j:

    A_j = K_jj - K_j,j+1 A_j+1^-1 K_j+1,j .

There are N_z dense matrices of 2 N_x unknowns; the rod has three unknowns.

Source: block elimination (Schur complements) of the linear geometry of PRL 107, 074301 (2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dposv

from pyfric.statics.operators import coordinates, driven_dofs, stiffness
from pyfric.statics.rest import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import OnDriven, Scene

LARGE = 10_000
"""Number of unknowns above which condensation takes seconds. It needs 3 N_z (2 N_x)^3 operations:
7e8 in the Fig. 1 scene, 1e12 with 561 x 301 blocks."""


@dataclass(frozen=True)
class Condensed:
    """The slider condensed onto its interface (linear geometry); see the top of this module.

    Attributes:
        S: stiffness of the interface with the driver attached, shape (2 N_x, 2 N_x), in N/m.
        G: matrix from w to loads on the interface, shape (2 N_x, 4); columns in N/m, N, 1 and 1.
        c: row from w to F_T at v = 0, shape (4,), in the same units.
        always: constant forces that a plate adds to the loads, shape (2 N_x,), and to F_T, in N.
        plate: the plate that drives the slider; None for one driven block.
    """

    S: np.ndarray
    G: np.ndarray
    c: np.ndarray
    always: tuple[np.ndarray, float] | None = None
    plate: Plate | None = None

    def undriven(self) -> Condensed:
        """Return the slider without its driver, so that F_T = 0."""
        if self.plate is not None:
            return self.plate.slider
        if not self.c[0]:
            return self
        drive = self.G[:, 0]
        S = self.S - np.outer(drive, drive) / self.c[0]
        return Condensed(S, self.G - np.outer(drive, self.c / self.c[0]), np.zeros(4))


@dataclass(frozen=True)
class Plate:
    """The slider without its driver, and the response of the n blocks that a plate drives.

    Forces f on these blocks along +x give their displacements u = P' v + D w + F f, and load the
    interface with P f. Springs K/n between blocks and plate give
    f = Y (d drive + aside - P' v - D w) with 1/Y = n/K + F. Here aside is u_drv0 of each block
    minus the mean.

    Attributes:
        slider: the condensed slider without the driver.
        P: shape (2 N_x, n), dimensionless.
        D: shape (n, 4); columns in 1 (zeros, for the drive), m, m/N and m/N.
        F: shape (n, n), in m/N.
    """

    slider: Condensed
    P: np.ndarray
    D: np.ndarray
    F: np.ndarray

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return u_x of the blocks under the loads at t = 0 with F_T = 0, shape (n,), in m."""
        return self.P.T @ v + self.D[:, 1]

    def drives(self, scene: Scene, u_drv0: OnDriven) -> Condensed:
        """Return the driven slider.

        Args:
            scene: the scene.
            u_drv0: u_x of the driven blocks at which all springs are relaxed, shape (n,), in m.
        """
        free, d, n = self.slider, scene.d, len(self.F)
        Y = np.linalg.inv(n / scene.driver.K * np.eye(n) + self.F)
        Y = (Y + Y.T) / 2
        aside, PY, D = u_drv0 - np.mean(u_drv0), self.P @ Y, self.D.copy()
        D[:, 0] = -d
        half = PY @ self.P.T
        always = PY @ aside, float(d * np.sum(Y @ aside))
        S = free.S + (half + half.T) / 2
        return Condensed(S, free.G - PY @ D, -d * np.sum(Y @ D, axis=0), always, self)


def condense(scene: Scene) -> Condensed | Plate:
    """Eliminate the slider above its bottom row, with rod and driver.

    A plate as driver is not eliminated; `Plate.drives` attaches it later.

    Args:
        scene: the scene.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    N_x, N_z, several = scene.N_x, scene.N_z, scene.n_driven > 1
    stiff = stiffness(scene, closed=np.zeros(N_x, dtype=bool), driver=not several)
    n = stiff.shape[0]
    unit = coordinates(scene)[driven_dofs(scene)].toarray().T  # forces of 1 N on driven blocks
    r, c = np.zeros((n, 4)), np.array([scene.driver.K, 0.0, 0.0, 0.0])
    if several:
        r, c = np.hstack([r, unit]), np.zeros((scene.n_driven, 4 + scene.n_driven))
    else:
        r[:, 0] = scene.driver.K * scene.d * unit[:, 0]
    outside = slice(4, None) if several else 0
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
        c -= G[:, outside].T @ to_G
        BT = B.T.tocsr()
        half = BT @ to_B
        A = stiff[here, here].toarray() - (half + half.T) / 2
        G = r[here] - BT @ to_G
    if not several:
        return Condensed(A, G, c)
    return Plate(Condensed(A, G[:, :4], np.zeros(4)), G[:, 4:], -c[:, :4], -c[:, 4:])
