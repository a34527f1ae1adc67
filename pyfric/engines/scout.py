"""What the ladder says about a scene before it is run: events, forces, decay times.

Large lattices are scouted with larger blocks.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.engines.guard import largest_load
from pyfric.engines.quasistatic import QuasistaticRun
from pyfric.engines.modes import Linearised
from pyfric.record import build_catalogue
from pyfric.scene import FIELDS
from pyfric.statics import EquilibriumError, StaticSolver

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Interface, Scene

__all__ = ["DecayTimes", "Scout", "coarser", "decay_times", "interval", "most_open", "scouted"]

SCOUT_BLOCKS, SCOUT_COLUMNS = 5_000, 250
"""Lattices with more blocks, or more along the interface, are scouted with larger blocks."""
SCOUT_EVENTS = 300
"""The scout stops after this many events; their number is extrapolated."""
MOST_EVENTS = 1e4
"""More events than this are left to dynamics, which need not look at each."""
SCOUT_WORK = 2e8
"""It also stops after this many changes of contact state times N_x^2: a few seconds."""


class Scout(NamedTuple):
    """What the ladder says about a scene."""

    events: int
    front_blocks: int  # blocks that slip in main events, all events together
    interval: float  # median time between main events, s
    open: int  # most blocks that are open at a time
    F_max: float  # N
    seconds: float
    far: float  # t_end over the time at which the scout stopped
    drop: float  # most by which F_T falls in an event over the whole interface, over F_N
    failed: str


def scouted(scene: Scene, t_end: float) -> Scout:
    """Return what the ladder says about a run of a scene to t_end (s), with larger blocks."""
    refined = scene.N_x
    scene = _without_weakening(coarser(scene))
    refined /= scene.N_x
    F_max = scene.law.mean.hold(largest_load(scene, t_end)[0])
    guess = Scout(20, 20 * scene.N_x, max(t_end, 1e-9) / 20, 0, F_max, 0.0, 1.0, 0.0, "")

    def enough() -> bool:
        return run.events >= SCOUT_EVENTS or run.log.step * scene.N_x**2 > SCOUT_WORK

    try:
        run = QuasistaticRun(scene)
        run.advance(t_end, enough, lambda *_: None)
        record = run.record("complete")
    except EquilibriumError as error:
        return guess._replace(failed=str(error))
    main = record.events[record.events["is_main"]]
    far = t_end / max(run.rows[-1][0], 1e-30)
    refined *= far
    many = run.events * far > MOST_EVENTS
    return Scout(
        events=max(int(len(record.events) * refined), 1),
        front_blocks=int(main["n_blocks"].sum() * refined),
        interval=interval(record),
        open=most_open(record),
        F_max=max(abs(F) for _, F in run.rows),
        seconds=sum(run.timings.values()),
        far=far,
        drop=_drop(record),
        failed=f"about {run.events * far:.0e} events up to t_end" if many else "",
    )


def _drop(record: Record) -> float:
    """Return how far F_T falls in the ladder's events over the whole interface, over F_N.

    Without viscosity a slider overshoots by as much as it fell, which the ladder leaves out.
    """
    events = record.events
    whole = events[events["is_main"] & (events["n_blocks"] == record.scene.N_x)]
    fall = (whole["F_T_start"] - whole["F_T_arrest"]).max()
    return float(fall / record.scene.F_N) if fall > 0 else 0.0


def _without_weakening(scene: Scene) -> Scene:
    """Return the scene with Amontons-Coulomb friction, which the ladder can follow."""
    return dataclasses.replace(scene, interface=scene.interface.coulomb())


def interval(record: Record) -> float:
    """Return the median time between main events of the ladder, in s; inf where there are none.

    A longest pause inside an event is left out: at high V it makes one event of many.
    """
    log = record.switches, record.quiet, record.scene
    events = build_catalogue(*log, t_gap=0.0).events
    starts = events["t_start"].to_numpy()[events["is_main"].to_numpy()]
    if len(starts) > 1:
        return float(np.median(np.diff(starts)))
    return float(record.curve["t"].iloc[-1]) if len(starts) else math.inf


class DecayTimes(NamedTuple):
    """How long oscillations of the stuck slider last, in s: the slowest one, the fast ones."""

    slow: float
    fast: float


@functools.lru_cache(maxsize=16)
def decay_times(scene: Scene) -> DecayTimes:
    """Return how long oscillations of the stuck slider last (linear geometry).

    "Fast" are those that the hybrid engine does not follow in closed form. Large lattices are
    replaced by coarser ones of the same viscosity. Nothing moves in a chain whose blocks stick.
    """
    if scene.N_z == 1:
        return DecayTimes(0.0, 0.0)
    if scene.eta == 0:
        return DecayTimes(math.inf, math.inf)
    scene = coarser(scene)
    frozen = Linearised(StaticSolver(scene, "linear"), np.ones(scene.N_x, dtype=bool))
    slow = float(np.min(-frozen.rates.real, initial=frozen.decay or np.inf))
    times = [1 / rate if rate > 0 else math.inf for rate in (slow, float(frozen.decay))]
    return DecayTimes(*times)


def coarser(scene: Scene) -> Scene:
    """Return the scene with blocks so large that `SCOUT_BLOCKS` and `SCOUT_COLUMNS` suffice.

    It keeps L, H, h and eta where there are blocks that fit; L and eta otherwise.
    """
    N_x, N_z = scene.N_x, scene.N_z
    if N_x * N_z <= SCOUT_BLOCKS and N_x <= SCOUT_COLUMNS:
        return scene
    if N_z == 1:
        return _coarser_chain(scene)
    n = math.gcd(N_x - 1, N_z - 1, scene.j_h)
    for q in range(2, n + 1):
        n_x, n_z = (N_x - 1) // q, (N_z - 1) // q
        few = (n_x + 1) * (n_z + 1) <= SCOUT_BLOCKS and n_x < SCOUT_COLUMNS
        if n % q == 0 and few and n_x >= 2:
            slider = dataclasses.replace(scene.slider, l=scene.slider.l * q, eta=scene.eta)
            return dataclasses.replace(
                scene, slider=slider, interface=_interface_on(scene, n_x + 1)
            )
    q = max((N_x - 1) / (SCOUT_COLUMNS - 1), math.sqrt(N_x * N_z / SCOUT_BLOCKS))
    n_x = max(math.floor((N_x - 1) / q), 2)
    while n_x > 2 and (n_x + 1) * (round(n_x * (N_z - 1) / (N_x - 1)) + 1) > SCOUT_BLOCKS:
        n_x -= 1
    l = scene.slider.L / n_x
    n_z = max(round(scene.slider.H / l), 1)
    j_h = min(max(round(scene.driver.h / l), 1), n_z)
    slider = dataclasses.replace(scene.slider, l=l, H=l * n_z, eta=scene.eta)
    driver = dataclasses.replace(scene.driver, h=l * j_h)
    return dataclasses.replace(
        scene, slider=slider, driver=driver, interface=_interface_on(scene, n_x + 1)
    )


def _coarser_chain(scene: Scene) -> Scene:
    """Return the chain with fewer blocks: the same rod under the same forces per length."""
    slider, top, N_x, N = scene.slider, scene.top, scene.N_x, SCOUT_COLUMNS
    q, at = (N_x - 1) / (N - 1), np.linspace(0, N_x - 1, N)
    p, tau = (
        np.interp(at, np.arange(N_x), np.broadcast_to(value, N_x)) * (N_x / N)
        for value in (top.p, top.tau)
    )
    interface = _interface_on(scene, N)
    most = (1 - 1e-12) * np.asarray(interface.mu_s) * p
    tau = np.clip(tau, -most, most)
    top = dataclasses.replace(top, p=tuple(p), tau=tuple(tau), k_top=top.k_top * q)
    slider = dataclasses.replace(slider, l=slider.L / (N - 1), k=slider.k / q, eta=scene.eta / q)
    return dataclasses.replace(scene, slider=slider, top=top, interface=interface)


def _interface_on(scene: Scene, N_x: int) -> Interface:
    """Return the interface with its fields on another number of blocks."""
    order = np.argsort(scene.n_of_i)
    fields = {name: scene.field(name)[order] for name in FIELDS}
    return scene.interface.on(N_x, fields)


def most_open(record: Record) -> int:
    return int((record.quiet["mode"] == OPEN).sum(axis=1).max(initial=0))
