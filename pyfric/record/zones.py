"""Whether a lattice resolves a front: blocks in its cohesive zone, and the effect of viscosity.

Behind a front, friction falls from mu_s p to mu_k p over the length X_c, the cohesive zone. If
X_c is only a few blocks long, the lattice sets the speed of the front. With the fracture energy
Gamma of the law (per body, `pyfric.theory.fracture_energy`) and the stress drop
dtau = (mu_s - mu_k) p,

    X_c0 = (9 pi/16) E' Gamma/dtau^2,     X_c(v) = X_c0/A_II(v).

Per block, with G = Gamma l B, f = dtau l B and E' B = 4 k/3, X_c0/l = (3 pi/4) k G/f^2. Linear
weakening has G = f d_c/2. With d_c = 0 there is no zone.

In a chain the zone is a quarter wave of k l^2 (1 - v^2/c^2) u'' + (f/d_c) u = 0, with d_c = 2 G/f:
X_c0/l = (pi/2) sqrt(2 k G)/f, X_c(v) = X_c0 sqrt|1 - v^2/c^2|, c = l sqrt(k/m).

Dashpots slow fronts down. In the zone, their force over that of the springs is of the order of
eta v/(k X_c), proportional to r = (eta/sqrt(k m))/(X_c0/l). Measured two-sided cracks under a
uniform stress drop at S = 3 are slower than fracture mechanics predicts, in the mean by `VISCOUS`
sqrt(6 r). With the paper's viscosity and 6 blocks in X_c0 the decrease is 7.6 %. The rule holds
within a sixth in 18 cracks with eta^2 from 1e-4 to 1 k m and 3 to 8 blocks.

Source: A. C. Palmer and J. R. Rice, Proc. R. Soc. A 332, 527 (1973); for the chain, derived here;
for cracks, `reference_data/fronts/viscosity.csv`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from pyfric.scene import PrescribedLoad, Scene
from pyfric.theory import A_II, Material

RESOLVED = 6
"""Smallest number of blocks in X_c0 that resolves a front. At low viscosity, fronts of a crack
under uniform stress drop are then within 5 % of fracture mechanics (`reference_data/fronts`)."""
RESOLVED_L_B = 3
"""Smallest number of blocks in L_b that resolves rate-and-state friction."""
RESOLVED_ERROR = 0.05
"""Relative error of front speeds with `RESOLVED` blocks in X_c0. The error is proportional to l.
Records have a note if viscosity slows fronts by more than `RESOLVED_ERROR`."""
VISCOUS = {"full": 0.136, "along": 0.05}
"""Relative decrease of front speeds with eta = sqrt(k m) and 6 blocks in X_c0, for each kind of
dashpots, measured with cracks; see the module."""


_of_lattice = functools.lru_cache(maxsize=64)(Material.of_lattice)


def material_of(scene: Scene) -> Material:
    """Return the material of a lattice of width 1 m; speeds and g_II do not depend on width."""
    return _of_lattice(scene.slider.k, scene.m, scene.slider.l, 1.0)


def pace_limits(scene: Scene) -> tuple[float, float]:
    """Return c_R and c_S of a scene, in m/s; both are c in a chain."""
    if scene.N_z == 1:
        c = scene.slider.l * math.sqrt(scene.slider.k / scene.m)
        return c, c
    material = material_of(scene)
    return material.c_R, material.c_S


def zone_at_rest(scene: Scene, p: np.ndarray) -> np.ndarray:
    """Return X_c0/l at each block: 0 without weakening, NaN where p is 0 or NaN.

    X_c0/l is NaN, too, under a law whose fracture energy is not defined.

    Args:
        p: normal forces on the blocks from left to right, shape (..., N_x), N. A prescribed normal
            force replaces NaN.

    Source: see the module.
    """
    law, p = scene.law, np.asarray(p, dtype=float)
    if isinstance(scene.top, PrescribedLoad):
        given = scene.p_prescribed if scene.prescribed else scene.load
        p = np.where(np.isnan(p), given, p) / scene.shares[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        drop, energy = law.static.drop * p, law.fracture_energy(p)
        if scene.N_z == 1:
            return math.pi / 2 * np.sqrt(2 * scene.slider.k * energy) / drop
        return 0.75 * math.pi * scene.slider.k * energy / drop**2


def zone_moving(scene: Scene, p: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return X_c(v)/l at each block; NaN where v is NaN or, in two dimensions, at least c_R.

    Args:
        p: as in `zone_at_rest`.
        v: front speeds, of the same shape, m/s.

    Source: see the module.
    """
    at_rest = zone_at_rest(scene, p)
    if scene.N_z == 1:
        return at_rest * np.sqrt(np.abs(1 - (v / pace_limits(scene)[0]) ** 2))
    material = material_of(scene)
    at_rest, v = np.broadcast_arrays(at_rest, np.abs(v))
    below, blocks = v < material.c_R, np.full(v.shape, np.nan)
    if below.any():
        blocks[below] = at_rest[below] / A_II(material, v[below])
    return blocks


def can_rupture(scene: Scene) -> np.ndarray:
    """Return whether a front can pass each block, left to right, shape (N_x,), bool.

    With a driver a front can pass all blocks. Without a driver, a front can pass blocks whose
    prescribed shear force exceeds mu_k p.
    """
    if not isinstance(scene.top, PrescribedLoad) or scene.driver.K * scene.driver.fastest > 0:
        return np.ones(scene.N_x, dtype=bool)
    p = scene.p_prescribed if scene.prescribed else scene.load
    return np.abs(scene.shear) > scene.law.static.slide(p)


def _mean_p(scene: Scene) -> np.ndarray:
    """Return F_N/N_x for each block, NaN where p is prescribed, shape (N_x,), in N."""
    given = isinstance(scene.top, PrescribedLoad)
    return np.full(scene.N_x, np.nan if given else scene.F_N / scene.N_x)


def zone_of_scene(scene: Scene, speed: float = 0.0) -> float:
    """Return the least X_c(v)/l over the blocks of a scene that can rupture; NaN if none can.

    If p is not prescribed, the value F_N/N_x replaces p.

    Args:
        speed: v over c_R, or over c in a chain; below 1.
    """
    v = np.full(scene.N_x, speed * pace_limits(scene)[0])
    blocks = zone_moving(scene, _mean_p(scene), v)
    blocks = blocks[can_rupture(scene) & np.isfinite(blocks)]
    return float(blocks.min()) if blocks.size else math.nan


def blocks_needed(scene: Scene, tolerance: float) -> tuple[float, float]:
    """Return the numbers of blocks in X_c0 that resolve front speeds within a tolerance.

    The first number is for low viscosity, the second for the viscosity of the scene.
    """
    little = RESOLVED * max(1.0, RESOLVED_ERROR / tolerance)
    viscous = RESOLVED * (viscous_error(scene, RESOLVED) / tolerance) ** 2
    return little, float(np.fmax(little, viscous))


def viscous_error(scene: Scene, blocks: float) -> float:
    """Return the relative decrease of front speeds by dashpots, for a number of blocks in X_c0.

    The result is NaN for a chain, whose exact speeds are in `pyfric.theory`.

    Source: see the module.
    """
    if scene.N_z == 1:
        return math.nan
    slider = scene.slider
    eta = scene.eta / math.sqrt(slider.k * scene.m)
    return VISCOUS[slider.dashpots] * math.sqrt(eta * RESOLVED / blocks)


class Slipped(Protocol):
    """Members of a `Catalogue` that notes use."""

    slips: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray: ...

    @property
    def front_speed(self) -> np.ndarray: ...


def zone_notes(scene: Scene, engine: str, catalogue: Slipped) -> tuple[str, ...]:
    """Return notes on results that depend on l or on dashpots: front speeds, short precursors.

    If static states are unknown, as under a push, the value F_N/N_x replaces p.

    Args:
        engine: name of the engine.
        catalogue: catalogue of the run, of which main events with front speeds are used.
    """
    main = catalogue["is_main"]
    fast = np.isfinite(catalogue.front_speed) & main[:, None]
    if not scene.law.rests:  # on junctions there is no cohesive zone
        blocks = scene.law.blocks_in_L_b(scene.F_N / scene.N_x, scene.slider.k)
        if not blocks < RESOLVED_L_B:
            return ()
        said = f"weakening acts over L_b = {blocks:.2g} blocks, fewer than {RESOLVED_L_B}"
        return (f"{engine}: {said}: results depend on l",)
    if not scene.law.weakens:
        short = bool((main & catalogue["is_precursor"]).any())
        said = ["front speeds are set by the lattice"] * bool(fast.any())
        said += ["number and lengths of short precursors depend on l (see pyfric resolve)"] * short
        return (f"{engine}: d_c = 0: {', '.join(said)}",) if said else ()
    mean, unknown = _mean_p(scene), np.isnan(catalogue["p_before"])
    at_rest = np.where(unknown, zone_at_rest(scene, mean), catalogue["X_c0_over_l"])[fast]
    moving = zone_moving(scene, mean, catalogue.front_speed)
    moving = np.where(unknown, moving, catalogue["X_c_over_l"])[fast]
    blocks, why = at_rest[np.isfinite(at_rest)], []
    if not blocks.size:
        return ()
    for name, known in (("X_c0", blocks), ("X_c(v)", moving[np.isfinite(moving)])):
        share = np.mean(known < RESOLVED) if known.size else 0.0
        if share:
            span = f"{known.min():.2g} to {known.max():.2g}"
            why.append(f"{100 * share:.0f} % of blocks have {name}/l below {RESOLVED} ({span})")
    weakens = blocks[blocks > 0]  # other blocks have d_c = 0
    slow = viscous_error(scene, float(np.median(weakens))) if weakens.size else 0.0
    if slow > RESOLVED_ERROR:
        why.append(f"viscosity slows fronts by about {100 * slow:.0f} %")
    return (f"{engine}: front speeds of a continuum may differ: {'; '.join(why)}",) if why else ()


def chain_notes(scene: Scene, engine: str, catalogue: Slipped) -> tuple[str, ...]:
    """Return a note if slip from the trailing edge of a chain is too short to go on by itself.

    Blocks 1 to m that come to rest at mu_k p pass their excess force on to block m + 1. Block m + 1
    slips if the sum of tau_i - mu_k p_i up to it exceeds (mu_s - mu_k) p. At a uniform scaled
    prestress tau_bar, a front without inertia needs m >= 1/tau_bar - 1 blocks. Inertia lowers this
    number.
    """
    top, slipped = scene.top, catalogue.slips["n"]
    alone = scene.driver.K * scene.driver.fastest == 0 and not top.push
    if scene.N_z > 1 or not alone or top.k_top or not (scene.law.rests and slipped.size):
        return ()
    order = np.argsort(scene.n_of_i)
    law = scene.law.static
    rest = (scene.d * scene.shear - law.slide(scene.load))[order]
    drop = (law.drop * scene.load)[order]
    carried, m = np.cumsum(rest), int(slipped.max())
    if m >= scene.N_x or carried[m] >= drop[m]:
        return ()
    return (
        f"{engine}: slip reached block {m} of {scene.N_x}. At rest these blocks bring the next one "
        f"to {100 * carried[m] / drop[m]:.0f} % of the way from mu_k p to mu_s p: such a front "
        "dies unless inertia helps, although theory.chain_speed may know a steady one",
    )
