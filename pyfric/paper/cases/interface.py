"""Stability of slip weakening under a half space, from static stiffness.

Blocks that slip by u lose w u of their friction. K is the stiffness of the slider with all other
blocks of the interface stuck. Slip is stable while K - w is positive definite. In terms of the
compliance C of the slipping blocks, all eigenvalues of sqrt(w) C sqrt(w) must be below 1.

Source: M. Campillo, I. R. Ionescu, J. Geophys. Res. 102, 20363 (1997), for the eigenvalue problem;
K. Uenishi, J. R. Rice, J. Geophys. Res. 108, 2042 (2003), for in-plane and antiplane shear.
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

    Its in-plane modulus is G/(1 - nu) = 2 k/(3 l) (per unit thickness).
    """
    own = {"L": N_x - 1.0, "H": N_z - 1.0, "l": 1.0, "k": 1.0, "M": float(N_x * N_z), "p": 1.0}
    own |= {"walls": Walls(top="held"), "name": "half space"}
    return slab(**own | fields)


MODULUS = 2 / 3
"""In-plane modulus G/(1 - nu) of the lattice times the thickness, over k; nu = 1/3 (plane
stress)."""


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
        blocks: indices of slipping blocks, from 0; all others are stuck.
        w: force that each block loses per slip, shape (N_x,) or a number, N/m.
    """
    root = np.sqrt(np.broadcast_to(np.asarray(w, float), len(K)))[blocks]
    inside = K[blocks, :][:, blocks]
    C = scipy.linalg.cho_solve(scipy.linalg.cho_factor(inside), np.diag(root))
    return float(scipy.linalg.eigvalsh(root[:, None] * C)[-1])


def strength(K: np.ndarray, tau_p: np.ndarray, w: float) -> tuple[float, int]:
    """Return the uniform shear at which slow slip loses stability, and the blocks that slip then.

    Uniform shear rises from 0. A block slips when its shear reaches the strength tau_p, and then
    loses w of strength per slip, without a lower limit. The slips u of the slipping blocks follow
    from (K - w) u = tau - tau_p while K - w is positive definite. Otherwise the slider has no state
    of rest.

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
