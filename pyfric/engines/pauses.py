"""The longest pause inside an event: a default from the scene's own times, and what hangs on it.

Slip that pauses for less than t_gap goes on in the same event. Three times of the scene say what
that can be:

driver      the driver alone adds `DRIVER_SHARE` of F_N to F_T; a longer pause is loading
ring-down   the slow motion that an event leaves has decayed `RING_DOWN` times
transit     a shear wave has crossed the interface `TRANSITS` times; a shorter pause is a front
            that waits for news from the other end

t_gap is the shorter one of the first two, and at least the third, rounded to 1 or 3 times a power
of ten: 1 ms in all scenes of the paper. A driver that never moves brings no other event, and t_gap
is the third.
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

    Nothing rings down in a chain whose blocks stick, nor without viscosity.
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
    """Return how long waves cross the interface before a pause counts as rest, in s."""
    slider = scene.slider
    return TRANSITS * slider.L / (slider.l * math.sqrt(slider.k / (2 * scene.m)))


def _rounded(t: float) -> float:
    """Return the nearest one, by ratio, of 1 and 3 times the powers of ten."""
    halves = round(2 * math.log10(t))
    return float(f"{'13'[halves % 2]}e{halves // 2}")


def pause_notes(record: Record) -> tuple[str, ...]:
    """Return a note where half or twice t_gap gives other numbers of main events, by more than one.

    Nothing is solved for that: the episodes are joined into events once more.
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
