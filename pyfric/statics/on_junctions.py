"""The loaded slider on junctions, which are pinned at u_x = 0 before F_N is applied.

The junctions add n_s k_j = sqrt(n_s C p) to the stiffness of each bottom block along x, with the
present p. The loaded state satisfies

    forces of bonds, foundation and load - sqrt(n_s C p) u_x = 0 .

A chord iteration solves this equation. Its tangent is that of linear geometry, with the stiffness
of the junctions at the last p.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from pyfric import core
from pyfric.statics.operators import coordinates, stiffness
from pyfric.statics.rest import Equilibrium, EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import Geometry, Scene

STEPS = 100
"""Largest number of steps of the iteration."""
ROUNDED = 1e-12
"""Residual force that counts as rounding, over F_N/N_x."""


def loaded_on_junctions(scene: Scene, geometry: Geometry) -> Equilibrium:
    """Return the static state under F_N, with F_T = 0, on junctions that are pinned at u_x = 0.

    Raises:
        EquilibriumError: the iteration does not converge.
    """
    N_x, N_z, unit = scene.N_x, scene.N_z, scene.F_N / scene.N_x
    T = coordinates(scene)
    K = stiffness(scene, closed=np.zeros(N_x, bool), driver=False)
    load = np.zeros((N_z, 2, N_x))
    load[-1] = scene.shear, -scene.load
    load = T.T @ load.ravel()
    if scene.rigid:
        load[-2] -= scene.F_N
    bonds = core.bond_forces(scene, geometry) if geometry == "finite" else None
    q, least = np.zeros(T.shape[1]), np.inf
    for step in range(STEPS):
        u = (T @ q).reshape(N_z, 2, N_x)
        closed = u[0, 1] < 0 if step else np.ones(N_x, bool)
        p = np.where(closed, -scene.k_f * np.minimum(u[0, 1], 0.0), 0.0)
        held = scene.law.stiffness(p if step else np.full(N_x, unit))
        force = load - K @ q
        if bonds is not None:
            force = load + T.T @ bonds(u).ravel()
            if scene.rigid:
                force[-1] -= scene.kappa * q[-1]
        force[:N_x] -= held * u[0, 0]
        force[N_x : 2 * N_x] += p
        residual = float(np.max(np.abs(force)))
        if residual <= ROUNDED * unit or (least <= 1e3 * ROUNDED * unit and residual >= least):
            return _found(scene, u, q, closed, held, p, residual, step)
        least = min(least, residual)
        contact = np.zeros(len(q))
        contact[:N_x], contact[N_x : 2 * N_x] = held, scene.k_f * closed
        q = q + splu((K + sp.diags_array(contact)).tocsc()).solve(force)
    what = "the slider on junctions does not settle under its load"
    raise EquilibriumError(what, residual, ROUNDED * unit, STEPS)


def _found(
    scene: Scene,
    u: np.ndarray,
    q: np.ndarray,
    closed: np.ndarray,
    held: np.ndarray,
    p: np.ndarray,
    residual: float,
    steps: int,
) -> Equilibrium:
    f = -held * u[0, 0]
    rod = q[-3:].copy() if scene.rigid else np.zeros(3)
    if scene.rigid:
        u[-1, 0], u[-1, 1] = rod[0], rod[1] + rod[2] * scene.x
    return Equilibrium(
        u=u,
        rod=rod,
        F_T=0.0,
        f=f,
        tau=-scene.d * f,
        p=p,
        open=~closed,
        slipped=np.zeros(scene.N_x, dtype=bool),
        drive=0.0,
        u_drv0=scene.u_driven(u),
        residual=residual,
        iterations=steps,
    )
