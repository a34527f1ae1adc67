"""The longest pause inside an event, t_gap: its default, and the effect of its value.

If slip pauses for less than t_gap, it belongs to the same event. Three times of the scene determine
the default:

driver      time in which the driver adds `DRIVER_SHARE` of F_N to F_T; a longer pause is loading
ring-down   `RING_DOWN` relaxation times of the slow motion after an event
transit     time of a shear wave to cross the interface `TRANSITS` times; a shorter pause can be a
            front that waits for a wave from the other end

t_gap is the shorter one of the first two times, but at least the third. It is rounded to 1 or 3
times a power of ten, and is 1 ms in all scenes of the paper. If the driver never moves, it starts
no other event, and t_gap is the third time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pyfric.engines.relaxation import relaxation_time
from pyfric.record import count_main

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["longest_pause", "pause_notes", "pause_of_waves"]

DRIVER_SHARE = 1.2e-3
RING_DOWN = 4.0
TRANSITS = 3.0


def longest_pause(scene: Scene) -> float:
    """Return the default of t_gap for a scene, in s.

    A chain has no ring-down, because its stuck blocks cannot move. Without viscosity the relaxation
    time is infinite.
    """
    driver, transits = scene.driver, pause_of_waves(scene)
    if driver.K * driver.fastest == 0:
        return _rounded(transits)
    loading = DRIVER_SHARE * scene.F_N / (driver.K * driver.fastest)
    if loading <= transits or scene.N_z == 1:
        return _rounded(max(loading, transits))
    ringing = RING_DOWN * relaxation_time(scene)
    return _rounded(max(min(loading, ringing), transits))


def pause_of_waves(scene: Scene) -> float:
    """Return the time of a shear wave to cross the interface `TRANSITS` times, in s."""
    slider = scene.slider
    return TRANSITS * slider.L / (slider.l * math.sqrt(slider.k / (2 * scene.m)))


def _rounded(t: float) -> float:
    """Return the value nearest in ratio among 1 and 3 times the powers of ten."""
    halves = round(2 * math.log10(t))
    return float(f"{'13'[halves % 2]}e{halves // 2}")


def pause_notes(record: Record) -> tuple[str, ...]:
    """Return a note if half or twice t_gap changes the number of main events by more than one.

    The episodes of slip are only joined again into events; no static state is solved.
    """
    t_gap = record.method.t_gap
    half, here, twice = (count_main(record.episodes, factor * t_gap) for factor in (0.5, 1.0, 2.0))
    if max(abs(half - here), abs(twice - here)) <= 1:
        return ()
    return (
        f"{record.method.engine}: the number of main events depends on the longest pause "
        f"inside an event: {half}, {here} and {twice} with t_gap = {t_gap / 2:g}, {t_gap:g} and "
        f"{2 * t_gap:g} s",
    )
