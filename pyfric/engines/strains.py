"""Strains of bonds: the largest strain expected, cells turned inside out, and notes on both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import OPEN
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.scene import Scene

STRAIN_SHARE = 0.65
"""Largest strain of a bond, at the driven block, over F_T/(k l). A driver that pushes a plate
causes smaller strains."""
LINEAR = 0.1
"""Strain above which a record in linear geometry has a note."""


def folded(scene: Scene, u: np.ndarray) -> tuple[int, int] | None:
    """Return column and row of a block at which a cell is turned inside out, or None.

    Args:
        scene: the scene.
        u: displacements, shape (N_z, 2, N_x), in m.
    """
    if scene.N_z == 1:
        return None
    l, x, z = scene.slider.l, u[:, 0], u[:, 1]
    right_x, right_z = l + np.diff(x, axis=1), np.diff(z, axis=1)  # (N_z, N_x - 1)
    up_x, up_z = np.diff(x, axis=0), l + np.diff(z, axis=0)  # (N_z - 1, N_x)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            area = right_x[rows] * up_z[:, columns] - right_z[rows] * up_x[:, columns]
            if not (area > 0).all():
                j, i = np.argwhere(~(area > 0))[0]
                return int(i + (columns.start or 0)), int(j + (rows.start or 0))
    return None


def largest_strain(scene: Scene, F_T: float, t_end: float = math.inf) -> float:
    """Return the largest strain of a bond under the driver force F_T, or under F_N and T.

    Args:
        scene: the scene.
        F_T: force of the driver, in N.
        t_end: time until which F_N and T are considered, in s.
    """
    unit = scene.slider.k * scene.slider.l
    if scene.N_z == 1 or scene.prescribed:
        return abs(F_T) / unit
    times = [0.0, *(corner for corner in scene.corners if corner < t_end)]
    times += [t_end] * math.isfinite(t_end)
    load = max(max(map(abs, scene.load_at(t) or (scene.F_N,))) for t in times)
    return max(STRAIN_SHARE * abs(F_T), load / scene.N_x) / unit


def strain_notes(scene: Scene, engine: str, F_T: float, t_end: float) -> tuple[str, ...]:
    """Return notes on linear geometry up to t_end (s), for driver forces up to F_T (N)."""
    strain = largest_strain(scene, F_T, t_end)
    if strain <= LINEAR:
        return ()
    instead = "; geometry = 'finite' follows them" * (default_geometry(scene) == "finite")
    return (
        f"{engine}: strains reach about {strain:.2g}, above {LINEAR:g}, where linear geometry, "
        f"which leaves out the rotation and the change of length of bonds, means little{instead}",
    )


def contact_notes(
    scene: Scene, engine: str, switches: Mapping[str, np.ndarray], mode: np.ndarray | None = None
) -> tuple[str, ...]:
    """Return a note if most blocks were open at some time; `mode` has the final contact states."""
    changes = (switches["new"] == OPEN).astype(int) - (switches["old"] == OPEN)
    number = np.cumsum(changes)
    if mode is not None and len(number):
        number += np.sum(mode == OPEN) - number[-1]
    lifted = np.flatnonzero(2 * number > scene.N_x)
    if scene.N_z == 1 or not len(lifted):
        return ()
    at = lifted[0]
    return (
        f"{engine}: from t = {switches['t'][at]:.4g} s on {number[at]} of {scene.N_x} blocks have "
        "no contact: the slider turns over or lifts off; a lower driver (h) or T, or a longer "
        "slider (L), keeps it down",
    )
