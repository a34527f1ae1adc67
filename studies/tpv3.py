"""TPV3 in two dimensions: rupture times on finer and finer lattices, and by spectral elements.

The scene is `pyfric.scene.tpv3`. The scene has one of the two bodies, so the rupture time of a
block is when its slip rate reaches half of 1 mm/s. Times at the stations, which lie between blocks,
are interpolated.

Reflections from the absorbing top and side shift these times by less than 1 us: a slab of 30 x
25 km at l = 50 m gives the same times.

Source: R. A. Harris et al., Seismol. Res. Lett. 80, 119 (2009).
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np
import pandas as pd
from sizes import size

from pyfric import core
from pyfric.engines import step_size
from pyfric.scene import Scene, preset
from pyfric.statics import loaded_state

__all__ = ["STATIONS", "distance", "misfit", "orders", "report", "ruptured", "tpv3"]

STATIONS = np.arange(2.0, 15.0)
"""Distances of stations from the middle, km."""
REFERENCE = np.array(
    [
        *(0.6167, 0.9748, 1.3525, 1.7109, 2.0559, 2.3961, 2.7339),
        *(3.0692, 3.4021, 3.7332, 4.0626, 4.3908, 4.7177),
    ]
)
"""Rupture times at stations, s, within 1 ms: spectral elements of 125 m with 6 nodes."""
SLIP_RATE = 0.5e-3
"""Slip rate of one body at which the front passes, m/s."""
LATTICES = size((100.0, 50.0, 25.0), (500.0,))
"""Lattice constants of the benchmark, m."""
PLACES = {5: (4.93, 5.153), 10: (7.63, 4.1435)}
"""Distance (km) -> largest slip rate (m/s, within 1 % at 5 km) and slip at 6 s (m) of the
reference."""
DASHPOTS = ((0.001, "along"), (0.001, "full"), (0.1, "full"))
"""eta^2/(k m) and kind of dashpots: the scene's, the same with resisted rotation, and the
paper's."""


def tpv3(*, quick: bool = False, progress: bool = False) -> pd.DataFrame:
    """Run TPV3 on lattices of 100, 50 and 25 m.

    Args:
        quick: leave out the finest lattice.
        progress: print on stderr what is being run.

    Returns:
        One row for each run; columns: l (m), eta2 (eta^2/(k m)), dashpots, rms (in units of the
        last arrival of the reference), t_2 ... t_14 (s), rate_5, rate_10 (m/s) and slip_5, slip_10
        (m) between two bodies, dt, seconds.
    """
    rows = []
    for eta2, dashpots in DASHPOTS:
        for l in LATTICES[: 2 if quick or (eta2, dashpots) != DASHPOTS[0] else None]:
            if progress:
                about = f"l = {l:g} m, eta^2 = {eta2:g} k m, {dashpots}"
                print(about, file=sys.stderr, flush=True)
            rows.append(_row(l, eta2, dashpots))
    return pd.DataFrame(rows)


def _row(l: float, eta2: float, dashpots: str) -> dict[str, Any]:
    start = time.process_time()
    scene = preset("tpv3", l=l)
    eta = math.sqrt(eta2 * scene.slider.k * scene.m)
    scene = preset("tpv3", l=l, eta=eta, dashpots=dashpots)
    dt = step_size(scene)
    times, rate, slip = ruptured(scene, dt, 6.0)
    x = distance(scene)
    arrivals = np.interp(STATIONS, x, times)
    row = {"l": l, "eta2": eta2, "dashpots": dashpots, "rms": misfit(arrivals)}
    row |= {f"t_{s:g}": t for s, t in zip(STATIONS, arrivals, strict=True)}
    for s in PLACES:
        row |= {f"rate_{s}": 2 * np.interp(s, x, rate), f"slip_{s}": 2 * np.interp(s, x, slip)}
    return row | {"dt": dt, "seconds": time.process_time() - start}


def orders(frame: pd.DataFrame) -> list[float]:
    """Return the observed orders of the misfit in the scene, from each lattice to the next."""
    low = frame[(frame["eta2"] == DASHPOTS[0][0]) & (frame["dashpots"] == DASHPOTS[0][1])]
    ratios = np.log(low["rms"]).diff() / np.log(low["l"]).diff()
    return ratios.dropna().tolist()


def report(frame: pd.DataFrame) -> str:
    """Return the table of a study as text."""
    lines = ["RMS of the rupture times at 2 to 14 km, over the last arrival, 4.7177 s"]
    lines += [
        "",
        "  l (m)  eta^2/(k m)  dashpots    RMS    14 km (s)   5 km (m/s, m)   10 km (m/s, m)     s",
    ]
    for row in frame.itertuples():
        lines.append(
            f"{row.l:7g}  {row.eta2:11g}  {row.dashpots:>8}  {100 * row.rms:5.3f} %"
            f"  {row.t_14:8.4f}"
            f"   {row.rate_5:6.2f}, {row.slip_5:6.3f}  {row.rate_10:6.2f}, {row.slip_10:6.3f}"
            f"  {row.seconds:6.0f}"
        )
    (rate_5, slip_5), (rate_10, slip_10) = PLACES.values()
    lines.append(
        f"      -            -         -        -    4.7177   {rate_5:6.2f}, {slip_5:6.3f}"
        f"  {rate_10:6.2f}, {slip_10:6.3f}       -"
    )
    found = ", ".join(f"{order:.2f}" for order in orders(frame))
    return "\n".join([*lines, "", f"observed order: {found}", ""])


# --- the benchmark -------------------------------------------------------------------------------


def distance(scene: Scene) -> np.ndarray:
    """Return the distances of the blocks from the middle, in km."""
    return (np.arange(scene.N_x) + 0.5) * scene.slider.l / 1e3


def ruptured(scene: Scene, dt: float, t_end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rupture times (s), largest slip rates (m/s) and slip (m) at t_end of each block.

    Rates are taken after each step. In the step of its release, at a located time, the speed of a
    block is interpolated linearly.
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
    """Return the RMS difference to the reference at the stations, in units of its last arrival."""
    return float(np.sqrt(np.mean((arrivals - REFERENCE) ** 2)) / REFERENCE[-1])
