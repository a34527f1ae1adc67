"""How long the stuck slider rings down, and how far the driver goes on meanwhile."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.engines.coarse import coarser
from pyfric.engines.modes import Linearised
from pyfric.statics import System

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["loading_notes", "loading_while_relaxing", "relaxation_time"]

SLOWEST = 10
"""Undamped modes among which the slowest decay is looked for: it is that of the slowest waves."""
AT_REST = 0.05
"""A run without inertia carries a note where the driver adds more to F_T than this during a
relaxation time, over F_N: a definition of coming to rest between events."""


@functools.lru_cache(maxsize=64)
def relaxation_time(scene: Scene) -> float:
    """Return the decay time of the slowest motion of the slider with all blocks stuck, in s.

    It is 1/min(-Re lambda) over its damped modes, in linear geometry; large lattices are taken with
    larger blocks of the same viscosity. 0 for a chain, in which nothing moves; infinite without
    viscosity, and where an interface is prescribed.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    if scene.N_z == 1:
        return 0.0
    if scene.eta == 0 or scene.prescribed:
        return math.inf
    small = coarser(scene)
    stuck = np.ones(small.N_x, dtype=bool)
    rates = Linearised(System(small, "linear"), stuck, modes=SLOWEST).rates
    slowest = float(np.min(-rates.real))
    return 1 / slowest if slowest > 0 else math.inf


def loading_while_relaxing(scene: Scene) -> float:
    """Return what the driver adds to F_T during a relaxation time, over F_N.

    That is V t/(1/K + 1/k) at its largest speed V.
    """
    V = scene.driver.fastest
    if scene.N_z == 1 or V == 0:
        return 0.0
    return V * relaxation_time(scene) / (1 / scene.driver.K + 1 / scene.slider.k) / scene.F_N


def loading_notes(scene: Scene, engine: str) -> tuple[str, ...]:
    """Return what to know where a slider does not come to rest between events."""
    share = loading_while_relaxing(scene)
    if share <= AT_REST:
        return ()
    return (
        f"{engine}: while the slider relaxes, in about {relaxation_time(scene) * 1e3:.2g} ms, the "
        f"driver adds {share:.2g} F_N to F_T (limit {AT_REST:g}): the slider does not come to rest "
        "between events",
    )
