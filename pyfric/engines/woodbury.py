"""Static solutions after blocks were released, without a new factorisation (Woodbury's formula)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import scipy.sparse as sp

    from pyfric.engines.space import Space


class Released:
    """Static solutions after some blocks were released, from those while they were stuck.

    A solution is the one with these blocks stuck, plus a combination of the responses to
    displacements u_x of the released blocks and to forces on their u_z.

    Args:
        near: the space with these blocks stuck.
        blocks: the released blocks, shape (m,).
        K: stiffness afterwards, shape (n_q, n_q), in N/m.
        free: free coordinates afterwards, shape (n,).

    Attributes:
        shapes: the responses, shape (n_q, 2 m).
    """

    def __init__(self, near: Space, blocks: np.ndarray, K: sp.csr_array, free: np.ndarray) -> None:
        self.near, self.free, lifted = near, free, len(near.stuck) + blocks
        force = np.zeros((near.n_q, len(blocks)))
        force[lifted, np.arange(len(blocks))] = 1.0
        self.shapes = shapes = np.hstack([near.moved(blocks), near.answer(force)])
        self._at = np.concatenate([blocks, lifted])
        self._K = K[self._at]
        self._responses = shapes @ np.linalg.inv(shapes.T @ (K @ shapes))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return x with K x = b for the free coordinates, shape (n,) or (n, columns)."""
        force = np.zeros((self.near.n_q, *b.shape[1:]))
        force[self.free] = b
        x = self.near.answer(force)
        left = force[self._at] - self._K @ x
        return (x + self._responses @ (self.shapes[self._at].T @ left))[self.free]
