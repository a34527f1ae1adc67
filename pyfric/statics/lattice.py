"""The lattice as a list of bonds, and its forces, tangents and matrices.

Displacements of all blocks are one vector u_full in the order of an array u[j, c, i], with row j,
component c (0 for x, 1 for z) and column i. The index is (2 j + c) N_x + i. A bond from block a to
block b has du = u_b - u_a. Another lattice needs only another list of bonds.

Source: PRL 107, 074301 (2011), model section.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.scene import Scene

DIRECTIONS = ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5))
"""Bonds of a block of the square lattice, each once: columns and rows between the block and its
neighbour, and the stiffness over k."""


@dataclass(frozen=True)
class Bonds:
    """All bonds of a lattice, each once.

    Bonds across a mirrored side or top lead to the image of block b, which has the displacements
    u_x and -u_z of block b. Such bonds come in equal pairs, and one bond is listed for each pair. A
    bond that is its own image counts as half a bond.

    Attributes:
        a, b: flat indices j N_x + i of the two blocks, shape (n,), int.
        d: reference vector from a to b, shape (n, 2), in m.
        l: reference length |d|, shape (n,), in m.
        k: stiffness, shape (n,), in N/m.
        shape: (N_z, N_x).
        image: bonds that lead to an image, shape (n,), bool.
        share: share of each dashpot that counts, shape (n,): 1, 1/2 or 1/4.
    """

    a: np.ndarray
    b: np.ndarray
    d: np.ndarray
    l: np.ndarray
    k: np.ndarray
    shape: tuple[int, int]
    image: np.ndarray
    share: np.ndarray

    @functools.cached_property
    def difference(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Matrices D_x, D_z with D_c u_full = u_c(b) - u_c(a), each of shape (n, 2 N_x N_z).

        For an image D_z u_full = -u_z(b) - u_z(a).
        """
        N_x, n = self.shape[1], len(self.a)
        away, shown = -np.ones(n), (np.ones(n), np.where(self.image, -1.0, 1.0))
        rows, block = np.tile(np.arange(n), 2), np.concatenate([self.a, self.b])
        x, size = block // N_x * 2 * N_x + block % N_x, (n, 2 * self.shape[0] * N_x)
        return tuple(
            sp.csr_array((np.concatenate([away, shown[c]]), (rows, x + c * N_x)), shape=size)
            for c in (0, 1)
        )

    @functools.cached_property
    def gather(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Matrices from bond tensions to forces on blocks: minus the transposes of `difference`."""
        return tuple((-D.T).tocsr() for D in self.difference)


def bonds(scene: Scene) -> Bonds:
    """Return the bonds of the square lattice: four neighbours at distance l, four at sqrt(2) l.

    Source: PRL 107, 074301 (2011); springs on the edges have full stiffness.
    """
    N_x, N_z = scene.N_x, scene.N_z
    index = np.arange(N_x * N_z).reshape(N_z, N_x)
    inside = [
        (
            index[max(-dz, 0) : N_z - max(dz, 0), : N_x - dx].ravel(),
            index[max(dz, 0) : N_z - max(-dz, 0), dx:].ravel(),
            (dx, dz, factor),
        )
        for dx, dz, factor in DIRECTIONS
    ]
    pairs = inside + _over_walls(scene, index)
    size = [len(a) for a, *_ in pairs]
    a, b = (np.concatenate(ends) for ends in list(zip(*pairs, strict=True))[:2])
    dx, dz, factor = np.repeat(np.array([pair[2] for pair in pairs]), size, axis=0).T
    image = np.arange(len(a)) >= sum(size[: len(inside)])
    share = np.where(image & (a == b), 0.5, 1.0)
    rows, columns = scene.shares
    if min(rows.min(), columns.min()) < 1:  # within a row or a column of half blocks
        share *= np.where(dz == 0, rows[a // N_x], 1.0) * np.where(dx == 0, columns[a % N_x], 1.0)
    d, l = scene.slider.l * np.column_stack([dx, dz]), scene.slider.l * np.hypot(dx, dz)
    return Bonds(a, b, d, l, factor * scene.slider.k * share, (N_z, N_x), image, share)


def _over_walls(
    scene: Scene, index: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, tuple[float, float, float]]]:
    """Return blocks a and b, direction and stiffness of bonds across mirrored sides and top."""
    sides = {"left": (index[:, 0], (-1, 0)), "right": (index[:, -1], (1, 0))}
    sides["top"] = index[-1], (0, 1)
    found = []
    for name, (row, (dx, dz)) in sides.items():
        if getattr(scene.walls, name) == "mirrored":
            found.append((row, row, (dx, dz, 1.0)))
            found.append((row[:-1], row[1:], (dx + abs(dz), dz + abs(dx), 0.5)))
    return found


def spring_forces(lattice: Bonds, u: np.ndarray) -> np.ndarray:
    """Return the forces k n (n.du) of all springs on the blocks in linear geometry.

    Opposite forces cancel to rounding. `core.bond_forces` has rounding errors of the order of k u,
    which are large if the slider rotates.

    Args:
        lattice: from `bonds`.
        u: displacements, shape (N_z, 2, N_x) or flat, in m.

    Returns:
        Forces in N, in the shape of u.
    """
    du_x, du_z = (D @ u.reshape(-1) for D in lattice.difference)
    X, Z = lattice.d.T
    tension = lattice.k * (X * du_x + Z * du_z) / lattice.l**2
    gather_x, gather_z = lattice.gather
    return (gather_x @ (tension * X) + gather_z @ (tension * Z)).reshape(u.shape)


def spring_tangents(lattice: Bonds, du: Sequence[np.ndarray] | None = None) -> np.ndarray:
    """Return the entries xx, xz and zz of the stiffness of each bond, shape (3, n_bonds), in N/m.

    In linear geometry the stiffness is k n n^T. In finite geometry the force is k (r - l) D/r with
    D = d + du and r = |D|, and the stiffness is k ((r - l)/r I + l D D^T/r^3).

    Args:
        lattice: from `bonds`.
        du: du_x and du_z over each bond, where the finite geometry is linearised, each of shape
            (n_bonds,), in m; None means linear geometry.

    Source: PRL 107, 074301 (2011), force k_ij (r_ij - l_ij) dx_ij / r_ij.
    """
    X, Z = d_x, d_z = lattice.d.T
    r, isotropic = lattice.l, 0.0
    if du is not None:
        du_x, du_z = du
        X, Z = d_x + du_x, d_z + du_z
        r = np.sqrt(X * X + Z * Z)
        e = (du_x * (d_x + X) + du_z * (d_z + Z)) / (r + lattice.l)  # r - l
        isotropic = lattice.k * e / r
    along = lattice.k * lattice.l / r**3
    return np.array([along * X * X + isotropic, along * X * Z, along * Z * Z + isotropic])


def spring_bends(
    lattice: Bonds, du: Sequence[np.ndarray], rate: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return second derivatives of spring forces by s, where du(s) changes at a constant rate.

    With D' = d(du)/ds and r' = D.D'/r, the force k (r - l) D/r of a bond has the second derivative
    k l (2 r' D'/r^2 + (D'.D' - 3 r'^2) D/r^3).

    Args:
        lattice: from `bonds`.
        du: du_x and du_z over each bond, each of shape (n_bonds,), in m.
        rate: derivatives of du by s, in m per unit of s.

    Returns:
        The x and z components, each of shape (n_bonds,), in N per squared unit of s.
    """
    (X, Z), (dX, dZ) = (d + more for d, more in zip(lattice.d.T, du, strict=True)), rate
    r = np.sqrt(X * X + Z * Z)
    dr, scale = (X * dX + Z * dZ) / r, lattice.k * lattice.l / (r * r)
    along, across = (dX * dX + dZ * dZ - 3 * dr * dr) / r, 2 * dr
    return scale * (across * dX + along * X), scale * (across * dZ + along * Z)


def assembled(
    differences: sp.csr_array, of_bonds: np.ndarray, ground: np.ndarray | float = 0.0
) -> sp.csr_array:
    """Return the matrix E' B E + diag(ground) of 2 x 2 matrices B of bonds, shape (n_q, n_q).

    Args:
        differences: E, du_x and then du_z over each bond by coordinates, shape (2 n_bonds, n_q).
        of_bonds: entries xx, xz and zz for each bond, shape (3, n_bonds).
        ground: spring (or dashpot) from each coordinate to the ground, shape (n_q,).
    """
    (xx, xz, zz), n = of_bonds, of_bonds.shape[1]
    entries = np.array([[xx, xz], [xz, zz]]).transpose(0, 2, 1).ravel()
    columns = np.tile(np.arange(2 * n).reshape(2, n).T.ravel(), 2)
    B = sp.csr_array((entries, columns, np.arange(0, 4 * n + 1, 2)), shape=(2 * n, 2 * n))
    K = differences.T.tocsr() @ (B @ differences)
    return (K + sp.diags_array(np.broadcast_to(ground, K.shape[0]))).tocsr()


def spring_stiffness(lattice: Bonds) -> sp.csr_array:
    """Return the stiffness of all springs in linear geometry, (2 N_x N_z, 2 N_x N_z), in N/m."""
    E = sp.vstack(lattice.difference).tocsr()
    return assembled(E, spring_tangents(lattice))
