"""TPV3 in two dimensions: rupture times of a benchmark, by spectral elements and by runs.

The scene is `pyfric.scene.tpv3`. A block's rupture time is when its slip rate reaches half of
1 mm/s, because it is one of two bodies that part. Times at the stations, which lie between blocks,
are interpolated.

What comes back from the absorbing top and side shifts these times by less than 1 us: a slab of 30 x
25 km at l = 50 m gives the same ones.

Source: R. A. Harris et al., Seismol. Res. Lett. 80, 119 (2009).
"""

from __future__ import annotations

import numpy as np

from pyfric import core
from pyfric.scene import Scene
from pyfric.statics import loaded_state

STATIONS = np.arange(2.0, 15.0)
"""Distances from the middle, km."""
REFERENCE = np.array(
    [
        *(0.6167, 0.9748, 1.3525, 1.7109, 2.0559, 2.3961, 2.7339),
        *(3.0692, 3.4021, 3.7332, 4.0626, 4.3908, 4.7177),
    ]
)
"""Rupture times there, s, converged to 1 ms: spectral elements of 125 m with 6 nodes."""
SLIP_RATE = 0.5e-3
"""Slip rate of one body at which the front passes, m/s."""


def distance(scene: Scene) -> np.ndarray:
    """Return the distances of the blocks from the middle, in km."""
    return (np.arange(scene.N_x) + 0.5) * scene.slider.l / 1e3


def ruptured(scene: Scene, dt: float, t_end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rupture times (s), largest slip rates (m/s) and slip (m) at t_end of each block.

    Rates are looked at after each step. A block that has just been released, at a time that is
    located, is taken to gain speed evenly until then.
    """
    model, log = core.model(scene, "linear", 0.0), core.Log(scene.N_x)
    state = loaded_state(scene).state(scene, dt)
    start, times = np.zeros(scene.N_x), np.full(scene.N_x, np.inf)
    before, most = np.zeros(scene.N_x), np.zeros(scene.N_x)
    while state.t < t_end - dt / 2:
        start[:] = state.t
        core.advance(model, state, log, 1, switching="located", budget=False)
        switches = log.switches()
        start[switches["block"]] = switches["t"]
        now = state.y[0, 2]
        passed = np.isinf(times) & (now >= SLIP_RATE)
        share = (SLIP_RATE - before[passed]) / (now - before)[passed]
        times[passed] = start[passed] + share * (state.t - start[passed])
        before, most = now.copy(), np.maximum(most, now)
    return times, most, state.y[0, 0].copy()


def misfit(arrivals: np.ndarray) -> float:
    """Return the RMS difference to the reference over the stations, over its last arrival."""
    return float(np.sqrt(np.mean((arrivals - REFERENCE) ** 2)) / REFERENCE[-1])
