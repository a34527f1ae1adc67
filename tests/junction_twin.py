"""An interface of junctions in plain NumPy, as an oracle for the core.

The oracle follows the description of the law, junction by junction. `twin` gives the lattice
forces. Arrays are (N_x, n_s), with blocks from left to right. The top row is free or prescribed;
there is no rod.
"""

from typing import Any

import numpy as np
import twin


class Junctions:
    """Anchors of all junctions, and their changes.

    Args:
        of: the `pyfric.laws.Junctions` of a scene, with numbers for its fields and C given.
        mu_s, mu_d: coefficients.
        numbers: numbers of the blocks, counted from the trailing edge, in the order left to right.
        u_x: displacements at which all junctions are pinned, shape (N_x,), m.
    """

    def __init__(
        self, of: Any, mu_s: float, mu_d: float, numbers: np.ndarray, u_x: np.ndarray
    ) -> None:
        self.of, self.mu_s, self.mu_d, self.numbers = of, mu_s, mu_d, numbers
        self.anchor = np.repeat(u_x[:, None], of.n_s, axis=1)
        self.pinned = np.ones(self.anchor.shape, dtype=bool)
        self.release = np.zeros(self.anchor.shape)
        self.breaks = np.zeros(self.anchor.shape, dtype=int)

    def stretches(self, u_x: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return k_j (N_x, 1), N/m, and the stretches d (N_x, n_s), m; a junction bears k_j d."""
        k = np.sqrt(self.of.C * p / self.of.n_s)[:, None]
        d, u_d = u_x[:, None] - self.anchor, self.mu_d * k / self.of.C
        return k, np.where(self.pinned, d, np.clip(d, -u_d, u_d))

    def force(self, u_x: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the force on each block along +x, (N_x,), N."""
        k, d = self.stretches(u_x, p)
        return -(k * d).sum(axis=1)

    def energy(self, u_x: np.ndarray, p: np.ndarray) -> float:
        """Return the elastic energy of the junctions, J."""
        k, d = self.stretches(u_x, p)
        return float((k * d**2).sum() / 2)

    def settle(self, t: float, u_x: np.ndarray, p: np.ndarray) -> None:
        """Drag anchors, break and pin junctions, at the end of a step."""
        k, d = self.stretches(u_x, p)
        self.anchor = np.where(self.pinned, self.anchor, u_x[:, None] - d)
        for i in range(len(u_x)):
            if p[i] == 0:
                if self.pinned[i].any():
                    self.anchor[i], self.pinned[i], self.release[i] = u_x[i], False, t
                continue
            u_s, u_d = self.mu_s * k[i, 0] / self.of.C, self.mu_d * k[i, 0] / self.of.C
            for j in range(self.of.n_s):
                if self.pinned[i, j] and abs(d[i, j]) > u_s:
                    self.pinned[i, j] = False
                    self.anchor[i, j] = u_x[i] - np.sign(d[i, j]) * u_d
                    self.breaks[i, j] += 1
                    self.release[i, j] = t + self.time_of_slip(i, j, self.breaks[i, j])
                if not self.pinned[i, j] and self.release[i, j] <= t:
                    self.pinned[i, j], self.anchor[i, j] = True, u_x[i]

    def time_of_slip(self, i: int, j: int, n: int) -> float:
        """Return t_R of the n-th break of junction j (from 0) of the block in column i, s."""
        counter = np.array([0, self.numbers[i], j + 1, n], dtype=np.uint64)
        key = np.array([self.of.seed, 0], dtype=np.uint64)
        raw = np.random.Philox(key=key, counter=counter).random_raw(12)
        total = sum((raw >> np.uint64(11)) * 2.0**-53)
        return max(self.of.t_R + self.of.t_R_std * (total - 6), 0.0)


def rk4_step(
    scene: Any, geometry: str, t: float, y: np.ndarray, junctions: Junctions, u_drv0: float,
    dt: float,
) -> np.ndarray:  # fmt: skip
    """Return y after a step of classical RK4 with fixed anchors; then settle the anchors."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        F, p, _ = twin.all_but_friction(scene, geometry, t, y, u_drv0)
        F[0, 0] += junctions.force(y[0, 0], p)
        return np.concatenate([y[:, 2:], F / scene.m], axis=1)

    k1 = slope(t, y)
    k2 = slope(t + dt / 2, y + dt / 2 * k1)
    k3 = slope(t + dt / 2, y + dt / 2 * k2)
    k4 = slope(t + dt, y + dt * k3)
    y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    junctions.settle(t + dt, y[0, 0], twin.normal_forces(scene, y))
    return y
