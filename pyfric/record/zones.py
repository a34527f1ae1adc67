"""How many blocks a front has in its cohesive zone: the lattice resolves it with six or more.

Behind a front, friction falls from mu_s p to mu_k p over the length X_c, the cohesive zone. Where
that is not many blocks long, it is the lattice that sets the speed of the front. With the
fracture energy Gamma of the law (per body, `pyfric.theory.fracture_energy`) and the stress drop
dtau = (mu_s - mu_k) p,

    X_c0 = (9 pi/16) E' Gamma/dtau^2,     X_c(v) = X_c0/A_II(v),

per block, with G = Gamma l B, f = dtau l B and E' B = 4 k/3: X_c0/l = (3 pi/4) k G/f^2. With linear
weakening G = f d_c/2; with d_c = 0 there is no zone.

In a chain the zone is a quarter wave of k l^2 (1 - v^2/c^2) u'' + (f/d_c) u = 0, with d_c = 2 G/f:
X_c0/l = (pi/2) sqrt(2 k G)/f, X_c(v) = X_c0 sqrt|1 - v^2/c^2|, c = l sqrt(k/m).

Source: A. C. Palmer and J. R. Rice, Proc. R. Soc. A 332, 527 (1973); for the chain, derived here.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.scene import PrescribedLoad
from pyfric.theory import A_II, Material

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["RESOLVED", "zone_at_rest", "zone_moving", "zone_notes"]

RESOLVED = 6
"""Fewest blocks in X_c0 with which a front is resolved: fronts of a crack under uniform stress drop
then run within 5 % of fracture mechanics (`reference_data/fronts`)."""


def zone_at_rest(scene: Scene, p: np.ndarray) -> np.ndarray:
    """Return X_c0/l at each block: 0 without weakening, NaN where p is 0 or NaN.

    Args:
        scene: the scene.
        p: normal forces on the blocks from left to right, shape (..., N_x), N; where it is NaN, a
            prescribed one is taken.

    Source: see the module.
    """
    law, p = scene.law, np.asarray(p, dtype=float)
    if isinstance(scene.top, PrescribedLoad):
        given = scene.p_prescribed if scene.prescribed else scene.load
        p = np.where(np.isnan(p), given, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        drop, energy = law.drop * p, law.fracture_energy(p)
        if scene.N_z == 1:
            return math.pi / 2 * np.sqrt(2 * scene.slider.k * energy) / drop
        return 0.75 * math.pi * scene.slider.k * energy / drop**2


def zone_moving(scene: Scene, p: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return X_c(v)/l at each block; NaN where v is, and where it is not below c_R.

    Args:
        scene: the scene.
        p: as in `zone_at_rest`.
        v: front speeds, of the same shape, m/s.

    Source: see the module; above c_R, where cracks have no such zone, it has no value.
    """
    slider, at_rest = scene.slider, zone_at_rest(scene, p)
    if scene.N_z == 1:
        c = slider.l * math.sqrt(slider.k / scene.m)
        return at_rest * np.sqrt(np.abs(1 - (v / c) ** 2))
    material = Material.of_lattice(slider.k, scene.m, slider.l, 1.0)  # speeds do not depend on B
    at_rest, v = np.broadcast_arrays(at_rest, np.abs(v))
    below, blocks = v < material.c_R, np.full(v.shape, np.nan)
    if below.any():
        blocks[below] = at_rest[below] / A_II(material, v[below])
    return blocks


def zone_notes(scene: Scene, engine: str, blocks: np.ndarray) -> tuple[str, ...]:
    """Return what to know about front speeds where the lattice does not resolve the zone.

    Args:
        scene: the scene.
        engine: name of the engine.
        blocks: X_c0/l at the blocks of fronts that have speeds, any shape.
    """
    blocks = blocks[np.isfinite(blocks)]
    share = np.mean(blocks >= RESOLVED) if blocks.size else 1.0
    if share == 1:
        return ()
    why = f"X_c0/l = {blocks.min():.2g} to {blocks.max():.2g}"
    if not scene.law.weakens:
        why = "d_c = 0"
    return (
        f"{engine}: front speeds are set by the lattice: {100 * share:.0f} % of the blocks in "
        f"fronts of main events have {RESOLVED} blocks or more in their cohesive zone ({why})",
    )
