"""Contact of the interface as one complementarity problem: stuck, slip +, slip -, open.

A block is in exactly one of these states (d is the slider's, sigma a block's direction):

    stuck   u_x held,                 |f| <= mu_s p,  p >= 0
    slip    f = -sigma mu_k p,        sigma du_x >= 0, p >= 0
    open    p = f = 0,                u_z >= 0

`Interface` holds the condensed slider of one scene. `Interface.contact` gives a `Contact`: f, u_x, u_z
and F_T as affine functions of the held u_x and of the driver, in a table whose columns are exchanged
when a block is released or held (a rank-one change each), so that following the states of one event
costs microseconds for each change.

Source: PRL 107, 074301 (2011), friction law; tables with exchanged columns are the pivots of linear
complementarity (R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pyfric.condensation import condense

if TYPE_CHECKING:
    from pyfric.scene import Scene

CONTACT_TOL = 1e-11
"""Violations of contact or friction conditions below this many F_N/N_x are rounding."""


class Change(NamedTuple):
    """The next change of contact along the driver's path."""

    X: float
    block: int
    kind: str  # "slip", "open", "land"


class Values(NamedTuple):
    """The interface at one position of the driver; arrays have shape (N_x,)."""

    u_x: np.ndarray
    f: np.ndarray
    u_z: np.ndarray
    p: np.ndarray
    F_T: float


class Interface:
    """The condensed slider of one scene and its contact with the substrate (linear geometry)."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.slider = condense(scene)
        self.unit = scene.F_N / scene.N_x
        self._bases: dict[bytes, np.ndarray] = {}

    def base(self, closed: np.ndarray) -> np.ndarray:
        """Return the table with all u_x held: rows u_x, f, u_z, F_T; columns u_x, X, 1."""
        key = closed.tobytes()
        if key not in self._bases:
            while len(self._bases) >= 64:
                del self._bases[next(iter(self._bases))]
            self._bases[key] = self._new_base(closed)
        return self._bases[key]

    def _new_base(self, closed: np.ndarray) -> np.ndarray:
        s, N_x = self.slider, self.scene.N_x
        x, z = slice(0, N_x), slice(N_x, 2 * N_x)
        A = s.S[z, z].copy()
        A[np.diag_indices(N_x)] += self.scene.k_f * closed
        load = np.column_stack([s.g_1, s.g_0])
        table = np.zeros((3 * N_x + 1, N_x + 2))
        table[:N_x, :N_x] = np.eye(N_x)
        factor = cho_factor(A, check_finite=False)
        u_z = cho_solve(factor, np.column_stack([-s.S[z, x], load[z]]), check_finite=False)
        table[2 * N_x : 3 * N_x] = u_z
        f = table[N_x : 2 * N_x]
        f[:] = s.S[x, z] @ u_z
        f[:, :N_x] += s.S[x, x]
        f[:, N_x:] -= load[x]
        table[-1] = -s.g_1[z] @ u_z
        table[-1, :N_x] -= s.g_1[x]
        table[-1, N_x:] += s.c_2, s.c_1
        return table

    def contact(self, u_x: np.ndarray, X: float, closed: np.ndarray) -> Contact:
        """Return the interface held at u_x, open where not closed."""
        return Contact(self, u_x, X, closed)


class Contact:
    """Contact states of all blocks, and the table that goes with them.

    Attributes:
        slip: direction of the blocks that slip, 0 elsewhere, shape (N_x,), int8.
        closed: blocks that touch the foundation, shape (N_x,), bool.
        X: position of the driver, in m.
    """

    def __init__(self, interface: Interface, u_x: np.ndarray, X: float, closed: np.ndarray) -> None:
        self.interface, scene = interface, interface.scene
        self.N_x, self.k_f = scene.N_x, scene.k_f
        self.mu_s, self.mu_k = scene.interface.mu_s, scene.interface.mu_k
        self.tol = CONTACT_TOL * interface.unit
        self.slip = np.zeros(self.N_x, dtype=np.int8)
        self.closed = np.array(closed, dtype=bool)
        self.free = np.zeros(self.N_x, dtype=bool)
        self.column = np.concatenate([u_x, [X, 1.0]])
        self.table = interface.base(self.closed).copy()
        for i in np.flatnonzero(~self.closed):
            self._exchange(i)

    @property
    def X(self) -> float:
        return float(self.column[-2])

    @X.setter
    def X(self, value: float) -> None:
        self.column[-2] = value

    @property
    def held(self) -> np.ndarray:
        return ~self.free

    def _exchange(self, i: int) -> None:
        """Free a held block, on which the force is then given, or hold a free one where it is."""
        table, column, N_x = self.table, self.column, self.N_x
        if self.free[i]:
            row = table[i].copy()
            value = row @ column
        else:
            row = table[N_x + i] - (self.slip[i] * self.mu_k * self.k_f) * table[2 * N_x + i]
            value = 0.0
        pivot = row[i]
        row /= -pivot
        row[i] = 1.0 / pivot
        factor = table[:, i].copy()
        table[:, i] = 0.0
        table += np.outer(factor, row)
        column[i] = value
        self.free[i] = not self.free[i]

    def release(self, i: int, direction: int) -> None:
        """Let a stuck block slip."""
        self.slip[i] = direction
        self._exchange(i)

    def hold(self, i: int, u_x: float | None = None) -> None:
        """Hold a slipping block, where it is or at u_x."""
        self._exchange(i)
        self.slip[i] = 0
        if u_x is not None:
            self.column[i] = u_x

    def hold_all(self) -> None:
        """Hold all slipping blocks where they are; the table starts afresh."""
        now = self.table[: self.N_x] @ self.column
        self.column[: self.N_x] = now
        self.slip[:] = 0
        self._renew()

    def set_closed(self, closed: np.ndarray) -> None:
        """Open and close blocks; blocks that close are held where they are, others stay."""
        u_x = self.table[: self.N_x] @ self.column
        self.closed = closed.copy()
        self.slip[~closed] = 0
        self.column[: self.N_x] = u_x
        self._renew()

    def _renew(self) -> None:
        self.table = self.interface.base(self.closed).copy()
        self.free[:] = False
        for i in np.flatnonzero((self.slip != 0) | ~self.closed):
            self._exchange(i)

    def values(self) -> Values:
        v = self.table @ self.column
        N_x = self.N_x
        u_z = v[2 * N_x : 3 * N_x]
        p = np.where(self.closed, -self.k_f * u_z, 0.0)
        f = np.where(self.free, -self.slip * (self.mu_k * p), v[N_x : 2 * N_x])
        return Values(v[:N_x], f, u_z, p, float(v[-1]))

    def rates(self) -> Values:
        """Return the derivatives of `values` by X."""
        v = self.table[:, -2]
        N_x = self.N_x
        u_z = v[2 * N_x : 3 * N_x]
        p = np.where(self.closed, -self.k_f * u_z, 0.0)
        f = np.where(self.free, -self.slip * (self.mu_k * p), v[N_x : 2 * N_x])
        return Values(v[:N_x], f, u_z, p, float(v[-1]))
