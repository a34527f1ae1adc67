"""Static condensation of the slider onto its interface.

All rows above the bottom row, the rod and the driver spring are eliminated, from the top downward.
The result, without foundation and friction, is a quadratic potential U of the interface
v = (u_x, u_z) and of driver and loads w = (drive, 1, F_N, T). With matrices S, G and a vector c,

    forces that the interface has to carry = S v - G w ,   F_T = dU/d(drive) = c.w - G_drive.v .

The driver spring is relaxed at drive = 0 if the driven block is at u_x = 0, so that
drive = V t + d u_drv0. For a plate u_drv0 is the mean over its blocks. The second component of w
stands for the constant forces: those of differences between the blocks of a plate, weights, and
the prescribed shear of a chain.

The lattice couples only neighbouring rows. Elimination of row j + 1 therefore changes only row j:

    A_j = K_jj - K_j,j+1 A_j+1^-1 K_j+1,j .

There are N_z dense matrices of 2 N_x unknowns; the rod has three unknowns.

Source: block elimination (Schur complements) of the linear geometry of PRL 107, 074301 (2011).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dposv

from pyfric.scene import PrescribedLoad
from pyfric.statics.memory import Memory
from pyfric.statics.operators import coordinates, driven_dofs, stiffness
from pyfric.statics.rest import EquilibriumError
from pyfric.statics.rows import ends

if TYPE_CHECKING:
    from pyfric.scene import OnDriven, Scene

LARGE = 10_000
"""Number of unknowns above which condensation takes seconds. It needs 3 N_z (2 N_x)^3 operations:
7e8 in the Fig. 1 scene, 1e12 with 561 x 301 blocks."""
KEPT = 2
"""Condensed sliders that are kept."""


@dataclass(frozen=True)
class Condensed:
    """The slider condensed onto its interface (linear geometry); see the top of this module.

    Forces f on the n driven blocks along +x give their displacements u = P' v + D w + F f, and load
    the interface with P f. Springs K/n between these blocks and the driver give
    f = Y (d drive + aside - P' v - D w) with 1/Y = n/K + F. Here aside is u_drv0 of each block
    minus the mean.

    Attributes:
        S: stiffness of the interface, shape (2 N_x, 2 N_x), in N/m.
        G: matrix from w to loads on the interface, shape (2 N_x, 4); columns in N/m, N, 1 and 1.
        c: row from w to F_T at v = 0, shape (4,), in the same units; zeros without the driver.
        P: shape (2 N_x, n), dimensionless.
        D: shape (n, 4); columns in 1 (zeros, for the drive), m, m/N and m/N.
        F: shape (n, n), in m/N.
    """

    S: np.ndarray
    G: np.ndarray
    c: np.ndarray
    P: np.ndarray
    D: np.ndarray
    F: np.ndarray

    def driven(self, scene: Scene, u_drv0: OnDriven = 0.0) -> Condensed:
        """Return the slider with its driver attached.

        Args:
            scene: the scene.
            u_drv0: u_x of the driven blocks at which all springs are relaxed, in m. Only
                differences between the blocks matter.
        """
        d, n = scene.d, len(self.F)
        Y = np.linalg.inv(n / scene.driver.K * np.eye(n) + self.F)
        Y = (Y + Y.T) / 2
        PY, D = self.P @ Y, self.D.copy()
        D[:, 0] = -d
        D[:, 1] -= u_drv0 - np.mean(u_drv0)
        half = PY @ self.P.T
        S, G = self.S + (half + half.T) / 2, self.G - PY @ D
        return dataclasses.replace(self, S=S, G=G, c=-d * np.sum(Y @ D, axis=0))


_known: Memory[Condensed] = Memory(KEPT)


def condense(scene: Scene) -> Condensed:
    """Eliminate the slider above its bottom row, with the rod; `Condensed.driven` adds the driver.

    The last `KEPT` results are kept, for all scenes that differ in their interface only: neither
    friction nor foundation is part of the result. Its arrays are read-only.

    Args:
        scene: the scene.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    names = (part.name for part in dataclasses.fields(scene))
    key = tuple(getattr(scene, name) for name in names if name not in ("interface", "name"))
    return _known.made(key, lambda: _condensed(scene))


def _condensed(scene: Scene) -> Condensed:
    """Return the slider condensed; see `condense`."""
    N_x, N_z, n_driven = scene.N_x, scene.N_z, scene.n_driven
    stiff = stiffness(scene, closed=np.zeros(N_x, dtype=bool), driver=False)
    n = stiff.shape[0]
    unit = coordinates(scene)[driven_dofs(scene)].toarray().T  # forces of 1 N on driven blocks
    r, c = np.hstack([np.zeros((n, 4)), unit]), np.zeros((n_driven, 4 + n_driven))
    if scene.slider.g:
        weights = np.stack([0 * scene.weights, scene.weights], axis=1)
        r[:, 1] = -(coordinates(scene).T @ weights.ravel())
    if scene.rigid:
        r[-2, 2] = -1.0
        r[-2, 1] -= scene.M_rod * scene.slider.g
    else:
        *_, top_x, top_z = ends(N_x)
        r[top_z, 2], r[top_x, 3] = -scene.load / scene.F_N, scene.d / scene.shares[1].sum()
        if isinstance(scene.top, PrescribedLoad):
            r[top_x, 1] = scene.shear

    edges = [*range(0, 2 * N_x * N_z, 2 * N_x), n]
    A, G = stiff[edges[-2] :, edges[-2] :].toarray(), r[edges[-2] :]
    for j in range(N_z - 2, -1, -1):
        row, above = slice(edges[j], edges[j + 1]), slice(edges[j + 1], edges[j + 2])
        B = stiff[above, row]
        _, solved, failed = dposv(
            A, np.column_stack([B.toarray(), G]), overwrite_a=1, overwrite_b=1
        )
        if failed:
            raise EquilibriumError("the slider is not supported", np.nan, 0.0, 0)
        to_B, to_G = solved[:, : 2 * N_x], solved[:, 2 * N_x :]
        c -= G[:, 4:].T @ to_G
        BT = B.T.tocsr()
        half = BT @ to_B
        A = stiff[row, row].toarray() - (half + half.T) / 2
        G = r[row] - BT @ to_G
    found = A, G[:, :4], np.zeros(4), G[:, 4:], -c[:, :4], -c[:, 4:]
    for part in found:
        part.flags.writeable = False
    return Condensed(*found)
