"""Relaxation time of the stuck slider, and the loading by the driver during that time."""

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
"""Undamped modes in which the slowest decay is sought; the slowest waves have it."""
AT_REST = 0.05
"""Increase of F_T during a relaxation time, over F_N, above which a quasi-static run carries a
note. It defines whether the slider comes to rest between events."""


@functools.lru_cache(maxsize=64)
def relaxation_time(scene: Scene) -> float:
    """Return the decay time of the slowest motion of the slider with all blocks stuck, in s.

    It is 1/min(-Re lambda) over the damped modes in linear geometry. For large lattices, it is that
    of larger blocks with the same viscosity. It is 0 for a chain, in which no block can move. It is
    infinite without viscosity and on a prescribed interface.

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
    """Return the increase of F_T by the driver during a relaxation time, over F_N.

    It is V t/(1/K + 1/k), with the largest speed V of the driver and the relaxation time t.
    """
    V = scene.driver.fastest
    if scene.N_z == 1 or V == 0:
        return 0.0
    return V * relaxation_time(scene) / (1 / scene.driver.K + 1 / scene.slider.k) / scene.F_N


def loading_notes(scene: Scene, engine: str) -> tuple[str, ...]:
    """Return a note if the slider does not come to rest between events."""
    share = loading_while_relaxing(scene)
    if share <= AT_REST:
        return ()
    return (
        f"{engine}: while the slider relaxes, in about {relaxation_time(scene) * 1e3:.2g} ms, the "
        f"driver adds {share:.2g} F_N to F_T (limit {AT_REST:g}): the slider does not come to rest "
        "between events",
    )
