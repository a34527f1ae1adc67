"""Static condensation of the slider onto its interface.

All rows above the bottom row, the rod and the driver spring are eliminated, from the top downward.
The result, without foundation and friction, is a quadratic potential U of the interface
v = (u_x, u_z) and of driver and loads w = (drive, 1, F_N, T). With matrices S, G and a vector c,

    forces that the interface has to carry = S v - G w ,   F_T = dU/d(drive) = c.w - G_drive.v .

The driver spring is relaxed at drive = 0 if the driven block is at u_x = 0, so that
drive = V t + d u_drv0. For a plate u_drv0 is the mean over its blocks. The second component of w
stands for constant forces: weights, the prescribed shear of a chain, and forces due to differences
of u_drv0 between the blocks of a plate.

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
from pyfric.statics.operators import bond_stiffness, coordinates, driven_dofs
from pyfric.statics.rest import EquilibriumError
from pyfric.statics.rows import ends

if TYPE_CHECKING:
    from collections.abc import Hashable

    from pyfric.scene import OnDriven, Scene

LARGE = 10_000
"""Number of unknowns above which condensation takes seconds. Condensation needs 3 N_z (2 N_x)^3
operations: 7e8 in the Fig. 1 scene, 1e12 with 561 x 301 blocks."""
KEPT = 4
"""Number of stored condensed sliders."""


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
        c: row from w to F_T at v = 0, shape (4,), in N/m, N, 1 and 1; zeros without the driver.
        P: loads on the interface per force on each driven block, shape (2 N_x, n).
        D: matrix from w to u_x of driven blocks, shape (n, 4); columns in 1 (zeros), m, m/N, m/N.
        F: u_x of driven blocks per force on each driven block, shape (n, n), in m/N.
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

    The bonds are eliminated at k = 1 N/m and scaled; the spring of the mattress is added as one
    more force. The last `KEPT` results of elimination are stored, and shared by all scenes with the
    same `_inputs`.

    Args:
        scene: the scene.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    k, found = scene.slider.k, _known.made(_inputs(scene), lambda: _condensed(scene))
    found = Condensed(k * found.S, found.G, found.c, found.P, found.D / k, found.F / k)
    return _on_mattress(found, scene.kappa) if scene.rigid else found


def _inputs(scene: Scene) -> tuple[Hashable, ...]:
    """Return all quantities on which the elimination of the upper rows depends.

    Scenes that differ only in interface, driver's spring and speed, protocols, size of loads, k and
    mattress agree in all these quantities.
    """
    slider, driver, top = scene.slider, scene.driver, scene.top
    lattice = scene.N_x, scene.N_z, slider.l, slider.edges, scene.walls
    at = scene.j_h, scene.j_h_top, driver.side, scene.rigid, scene.k_top / slider.k
    loads = (scene.load / scene.F_N).tobytes(), isinstance(top, PrescribedLoad)
    shear = scene.shear.tobytes() if loads[1] else b""
    weights = (scene.weights.tobytes(), scene.M_rod if scene.rigid else 0.0) if slider.g else ()
    return (*lattice, *at, *loads, shear, slider.g, *weights)


def _condensed(scene: Scene) -> Condensed:
    """Return the slider condensed at k = 1 N/m and without its mattress.

    Under a rod, the torque on the rod is the last force, and phi is its displacement.
    """
    N_x, N_z = scene.N_x, scene.N_z
    stiff = bond_stiffness(scene)
    n = stiff.shape[0]
    unit = coordinates(scene)[driven_dofs(scene)].toarray().T  # forces of 1 N on driven blocks
    if scene.rigid:
        unit = np.column_stack([unit, np.arange(n) == n - 1])
    r, c = np.hstack([np.zeros((n, 4)), unit]), np.zeros((unit.shape[1], 4 + unit.shape[1]))
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
        part.flags.writeable = False  # scenes share these arrays
    return Condensed(*found)


def _on_mattress(free: Condensed, kappa: float) -> Condensed:
    """Return a slider under a rod with the mattress, which turns the rod by -kappa phi.

    The torque t = -kappa (P' v + D w + F f + F_t t) is the last force of the free slider.
    """
    Y = kappa / (1 + kappa * free.F[-1, -1])
    P, D, F = free.P[:, -1], free.D[-1], free.F[-1, :-1]
    half = Y * np.outer(P, P)
    return Condensed(
        S=free.S + (half + half.T) / 2,
        G=free.G - np.outer(P, Y * D),
        c=free.c,
        P=free.P[:, :-1] - np.outer(P, Y * F),
        D=free.D[:-1] - np.outer(Y * F, D),
        F=free.F[:-1, :-1] - Y * np.outer(F, F),
    )
