"""The same slider with larger blocks, for rough estimates: pilot runs and relaxation times."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pyfric.scene import Scene

BLOCKS, COLUMNS = 5_000, 250
"""Most blocks, and most columns of blocks, that a lattice keeps; a larger one is coarsened."""


def coarser(scene: Scene) -> Scene:
    """Return the scene with larger blocks, so that `BLOCKS` and `COLUMNS` are not exceeded.

    If a larger lattice constant divides all lengths, L, H, h, h_top and eta stay the same.
    Otherwise L and eta stay the same, and the heights are rounded.
    """
    N_x, N_z = scene.N_x, scene.N_z
    if N_x * N_z <= BLOCKS and N_x <= COLUMNS:
        return scene
    if N_z == 1:
        return _coarser_chain(scene)
    n = math.gcd(N_x - 1, N_z - 1, scene.j_h, scene.j_h_top)
    for q in range(2, n + 1):
        n_x, n_z = (N_x - 1) // q, (N_z - 1) // q
        few = (n_x + 1) * (n_z + 1) <= BLOCKS and n_x < COLUMNS
        if n % q == 0 and few and n_x >= 2:
            slider = dataclasses.replace(
                scene.slider, l=scene.slider.l * q, eta=scene.eta, damping=None
            )
            interface = scene.interface_on(n_x + 1)
            return dataclasses.replace(scene, slider=slider, interface=interface)
    q = max((N_x - 1) / (COLUMNS - 1), math.sqrt(N_x * N_z / BLOCKS))
    n_x = max(math.floor((N_x - 1) / q), 2)
    while n_x > 2 and (n_x + 1) * (round(n_x * (N_z - 1) / (N_x - 1)) + 1) > BLOCKS:
        n_x -= 1
    l = scene.slider.L / n_x
    n_z = max(round(scene.slider.H / l), 1)
    slider = dataclasses.replace(scene.slider, l=l, H=l * n_z, eta=scene.eta, damping=None)
    heights = {"h": scene.driver.h, "h_top": scene.driver.h_top}
    rows = {n: min(max(round(z / l), 1), n_z) for n, z in heights.items() if z is not None}
    driver = dataclasses.replace(scene.driver, **{name: l * j for name, j in rows.items()})
    interface = scene.interface_on(n_x + 1)
    return dataclasses.replace(scene, slider=slider, driver=driver, interface=interface)


def _coarser_chain(scene: Scene) -> Scene:
    """Return a chain of fewer blocks: the same rod under the same forces per length."""
    slider, top, N_x, N = scene.slider, scene.top, scene.N_x, COLUMNS
    q, at = (N_x - 1) / (N - 1), np.linspace(0, N_x - 1, N)
    p, tau = (
        np.interp(at, np.arange(N_x), np.broadcast_to(value, N_x)) * (N_x / N)
        for value in (top.p, top.tau)
    )
    interface = scene.interface_on(N)
    most = (1 - 1e-12) * np.asarray(interface.mu_s) * p
    tau = np.clip(tau, -most, most)
    top = dataclasses.replace(top, p=tuple(p), tau=tuple(tau), k_top=top.k_top * q)
    slider = dataclasses.replace(
        slider, l=slider.L / (N - 1), k=slider.k / q, eta=scene.eta / q, damping=None
    )
    return dataclasses.replace(scene, slider=slider, top=top, interface=interface)
