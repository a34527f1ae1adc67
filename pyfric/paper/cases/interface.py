"""Slip that weakens friction under a half space: when it loses stability, from static stiffness.

Blocks of an interface that slip by u and lose w u of their friction are stable while K - w is
positive definite, with K the stiffness of the slider where all other blocks of the interface are
stuck. With the compliance C of the slipping blocks, this is: all eigenvalues of
sqrt(w) C sqrt(w) are below 1.

Source: M. Campillo, I. R. Ionescu, J. Geophys. Res. 102, 20363 (1997), for the eigenvalue problem;
K. Uenishi, J. R. Rice, J. Geophys. Res. 108, 2042 (2003), for shear in plane and in antiplane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
import scipy.sparse.linalg

from pyfric.scene import Scene, Walls, slab
from pyfric.statics import stiffness

if TYPE_CHECKING:
    from collections.abc import Sequence


def half_space(N_x: int, N_z: int, **fields: Any) -> Scene:
    """Return a slab of N_x by N_z blocks with held top; l = 1 m, k = 1 N/m, m = 1 kg, p = 1 N.

    Its modulus in plane is G/(1 - nu) = 2 k/(3 l) (per unit thickness).
    """
    own = {"L": N_x - 1.0, "H": N_z - 1.0, "l": 1.0, "k": 1.0, "M": float(N_x * N_z), "p": 1.0}
    own |= {"walls": Walls(top="held"), "name": "half space"}
    return slab(**own | fields)


MODULUS = 2 / 3
"""G/(1 - nu) of the lattice in plane, times the thickness, over k. nu = 1/3 in plane stress."""


def stiffness_of(scene: Scene) -> np.ndarray:
    """Return the static stiffness of the interface over u_x, shape (N_x, N_x), N/m.

    u_z of the bottom row and all other blocks are free.
    """
    K, n = stiffness(scene, driver=False).tocsc(), scene.N_x
    inner = K[n:, n:].tocsc()
    across = K[n:, :n].toarray()
    return K[:n, :n].toarray() - across.T @ scipy.sparse.linalg.splu(inner).solve(across)


def slipping(K: np.ndarray, blocks: slice | Sequence[int], w: np.ndarray | float) -> float:
    """Return the largest eigenvalue of sqrt(w) C sqrt(w): slip is stable below 1.

    Args:
        K: stiffness of the interface, N/m.
        blocks: those that slip, from 0; all others are stuck.
        w: force that each block loses per slip, shape (N_x,) or a number, N/m.
    """
    root = np.sqrt(np.broadcast_to(np.asarray(w, float), len(K)))[blocks]
    inside = K[blocks, :][:, blocks]
    C = scipy.linalg.cho_solve(scipy.linalg.cho_factor(inside), np.diag(root))
    return float(scipy.linalg.eigvalsh(root[:, None] * C)[-1])


def strength(K: np.ndarray, tau_p: np.ndarray, w: float) -> tuple[float, int]:
    """Return the uniform shear at which slow slip loses stability, and the blocks that slip then.

    Uniform shear rises from 0. A block slips when the shear on it reaches its strength tau_p, and
    loses w of it per slip (no lower end). The slips u of the blocks that slip follow from
    (K - w) u = tau - tau_p, as long as K - w is positive definite there; without that the slider is
    no longer at rest.

    Args:
        K: stiffness of the interface, N/m, shape (N_x, N_x).
        tau_p: strength, N, shape (N_x,).
        w: rate of weakening, N/m.
    """
    slips = np.zeros(len(K), bool)
    slips[np.argmin(tau_p)] = True
    tau = float(tau_p.min())
    while True:
        A = np.flatnonzero(slips)
        try:
            factor = scipy.linalg.cho_factor(K[np.ix_(A, A)] - w * np.eye(len(A)))
        except np.linalg.LinAlgError:
            return tau, len(A)
        others = np.flatnonzero(~slips)
        if not len(others):
            return tau, len(A)
        by_tau, at_zero = scipy.linalg.cho_solve(
            factor, np.column_stack([np.ones(len(A)), -tau_p[A]])
        ).T
        to = K[np.ix_(others, A)]
        gain = 1 - to @ by_tau
        needed = np.divide(tau_p[others] + to @ at_zero, gain, out=np.full(len(others), np.inf),
                           where=gain > 0)  # fmt: skip
        first = int(np.argmin(needed))
        tau = max(tau, float(needed[first]))
        slips[others[first]] = True
