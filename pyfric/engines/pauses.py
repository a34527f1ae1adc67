"""Relaxation time of the stuck slider, and t_gap, the longest pause inside an event.

The relaxation time of a large lattice is computed for the same slider with larger blocks.

Slip before and after a pause of less than t_gap belongs to one event. Three times of the scene
determine the default:

driver      time in which the driver adds `DRIVER_SHARE` of F_N to F_T; a longer pause is loading
ring-down   `RING_DOWN` relaxation times of the slow motion after an event
transit     time of a shear wave to cross the interface three times; in a shorter pause, a front may
            wait for a wave from the other end

t_gap is the shorter of the first two times, but at least the third. It is 1 ms in the paper's
scenes of both setups at their F_N and V. If the driver never moves, t_gap is the third time.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.engines.modes import modes_of
from pyfric.engines.space import Space
from pyfric.engines.stopping import pause_of_waves
from pyfric.record import count_main
from pyfric.scene import Interface
from pyfric.statics import Memory, System

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

DRIVER_SHARE, RING_DOWN = 0.9e-3, 4.0
"""Numbers fitted to the paper's scenes; `docs/explanation/numbers.md` describes their effect."""
SLOWEST = 10
"""Number of slowest undamped modes from which the slowest decay is computed."""
AT_REST = 0.05
"""Increase of F_T during a relaxation time, over F_N, above which a quasi-static run has a note.
The number is a policy."""
_known: Memory[float] = Memory(64)
"""Stored relaxation times, by the parts of a scene on which they depend."""
BLOCKS, COLUMNS = 5_000, 250
"""Largest number of blocks, and of columns of blocks, of a lattice that is not coarsened."""


def longest_pause(scene: Scene) -> float:
    """Return the default of t_gap for a scene, in s.

    The docstring of the module lists the times that determine it. The ring-down does not count in a
    chain, because stuck blocks cannot move. It does not count without viscosity, because it never
    ends.
    """
    driver, transits = scene.driver, pause_of_waves(scene)
    if driver.K * driver.fastest == 0:
        return transits
    loading = DRIVER_SHARE * scene.F_N / (driver.K * driver.fastest)
    if loading <= transits or scene.N_z == 1:
        return max(loading, transits)
    ringing = RING_DOWN * relaxation_time(scene)
    return max(min(loading, ringing), transits)


def pause_notes(record: Record) -> tuple[str, ...]:
    """Return a note if half or twice t_gap changes the number of main events by more than one.

    Episodes of slip are joined into events again, without static states.
    """
    t_gap, episodes = record.method.t_gap, record.columns("episodes")
    half, default, twice = (
        count_main(episodes, factor * t_gap, record.scene.N_x) for factor in (0.5, 1.0, 2.0)
    )
    if max(abs(half - default), abs(twice - default)) <= 1:
        return ()
    return (
        f"{record.method.engine}: the number of main events depends on the longest pause "
        f"inside an event: {half}, {default} and {twice} with t_gap = {t_gap / 2:g}, {t_gap:g} and "
        f"{2 * t_gap:g} s",
    )


def relaxation_time(scene: Scene) -> float:
    """Return the decay time of the slowest motion of the slider with all blocks stuck, in s.

    It is 1/min(-Re lambda) over the damped modes in linear geometry, with closed gaps. Large
    lattices are replaced by larger blocks with the same viscosity. A chain has 0, because no block
    can move. Without viscosity, or on a prescribed interface, the time is infinite.

    Raises:
        EquilibriumError: a part of the slider is not supported.
    """
    if scene.N_z == 1:
        return 0.0
    if scene.eta == 0 or scene.prescribed:
        return math.inf
    fields = (np.asarray(field).tobytes() for field in (scene.k_f, scene.touches, scene.bare))
    key = scene.slider, scene.top, scene.driver, scene.walls, *fields
    return _known.made(key, lambda: _relaxation_time(scene))


def _relaxation_time(scene: Scene) -> float:
    """Return the decay time of a scene; see `relaxation_time`."""
    known, mu = scene.interface, 1.0  # only blocks without friction differ
    if scene.bare.any():
        mu = tuple(np.where(scene.bare, 0.0, 1.0)[np.argsort(scene.n_of_i)].tolist())
    foundation = Interface(mu_s=mu, mu_k=mu, k_f=known.k_f, contact=known.contact)
    small = coarser(dataclasses.replace(scene, interface=foundation, name=""))
    stuck = small.touches & ~small.bare
    rates = modes_of(Space(System(small, "linear"), stuck, modes=SLOWEST)).rates
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


def coarser(scene: Scene) -> Scene:
    """Return the scene with larger blocks, so that `BLOCKS` and `COLUMNS` are not exceeded.

    L and eta stay the same. H, h and h_top stay the same if a larger lattice constant divides all
    lengths; otherwise they are rounded.
    """
    N_x, N_z = scene.N_x, scene.N_z
    if N_x * N_z <= BLOCKS and N_x <= COLUMNS:
        return scene
    if N_z == 1:
        return _coarser_chain(scene)
    n = math.gcd(N_x - 1, N_z - 1, scene.j_h, scene.j_h_top)
    for q in range(2, n + 1):
        n_x, n_z = (N_x - 1) // q, (N_z - 1) // q
        small_enough = (n_x + 1) * (n_z + 1) <= BLOCKS and n_x < COLUMNS
        if n % q == 0 and small_enough and n_x >= 2:
            slider = dataclasses.replace(
                scene.slider, l=scene.slider.l * q, eta=scene.eta, damping=None
            )
            return _on(scene, n_x + 1, slider=slider)
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
    return _on(scene, n_x + 1, slider=slider, driver=driver)


def _on(scene: Scene, N_x: int, **parts: Any) -> Scene:
    """Return a scene with new parts and N_x columns; k_top per length does not change."""
    if scene.k_top:
        k_top = scene.k_top * scene.N_x / N_x
        parts["top"] = dataclasses.replace(scene.top, k_top=k_top)
    return dataclasses.replace(scene, interface=scene.interface_on(N_x), **parts)


def _coarser_chain(scene: Scene) -> Scene:
    """Return the chain with fewer blocks, of equal elasticity and equal forces per length."""
    slider, top, N_x, N = scene.slider, scene.top, scene.N_x, COLUMNS
    q, at = (N_x - 1) / (N - 1), np.linspace(0, N_x - 1, N)
    p, tau = (
        np.interp(at, np.arange(N_x), np.broadcast_to(value, N_x)) * (N_x / N)
        for value in (top.p, top.tau)
    )
    interface = scene.interface_on(N)
    strength = (1 - 1e-12) * np.asarray(interface.mu_s) * p
    tau = np.clip(tau, -strength, strength)
    top = dataclasses.replace(top, p=tuple(p), tau=tuple(tau), k_top=top.k_top * q)
    slider = dataclasses.replace(
        slider, l=slider.L / (N - 1), k=slider.k / q, eta=scene.eta / q, damping=None
    )
    return dataclasses.replace(scene, slider=slider, top=top, interface=interface)
