"""Pilot runs: what is looked at before a scene is run, so that nothing has to be guessed.

The quasi-static engine says which events there are, on a lattice with larger blocks if need be. The
hybrid engine makes the first part of the run: what it takes there is counted, and the rest of the
run takes as much more as it has more events, each weighed with the blocks that slip.
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
from pyfric.record import build_catalogue
from pyfric.scene import FIELDS, SceneError
from pyfric.statics import EquilibriumError, StaticSolver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.record import Record
    from pyfric.scene import Interface, Scene

__all__ = ["Pilot", "coarser", "interval", "linear_error", "most_open", "pilot_run"]

BLOCKS, COLUMNS = 5_000, 250
"""Lattices with more blocks, or more along the interface, are looked at with larger blocks."""
EVENTS, CHANGES = 300, 2e8
"""The quasi-static pilot run ends after so many events, or changes of contact state times N_x^2: a
few seconds."""
NEARBY = 1e-3
"""Change of the driving force, over F_N, over which slopes of static states are taken."""
MOST_EVENTS = 1e4
"""More events than this are left to dynamics, which need not look at each."""


class Pilot(NamedTuple):
    """What the quasi-static engine says about a scene.

    Attributes:
        scene: the scene with larger blocks, or itself, with Amontons-Coulomb friction.
        record: of its run, which covers `far` of the whole; None where that `failed`.
        times: when events begin and how many blocks slip in each, shape (n, 2).
        interval: median time between main events, s.
        open: most blocks that are open at a time.
        F_max: largest |F_T|, N.
        far: part of the time that the pilot run covers.
        failed: why the quasi-static engine does not do; "" where it does.
        seconds: what it took.
    """

    scene: Scene
    record: Record | None
    times: np.ndarray
    interval: float
    open: int
    F_max: float
    far: float
    failed: str
    seconds: float

    def weight(self, t_end: float = math.inf) -> float:
        """Return the events up to a time (s), each weighed with the blocks that slip in it."""
        t, blocks = self.times.T
        return float(np.sum(1 + blocks[t < t_end]))

    def share(self, t: float) -> float:
        """Return which part of the work of the whole run is done at t (s)."""
        whole = self.weight() / max(self.far, 1e-12)
        return self.weight(t) / whole if whole else 1.0


@functools.lru_cache(maxsize=16)
def pilot_run(scene: Scene, t_end: float) -> Pilot:
    """Return what the quasi-static engine says about a run of a scene to t_end (s)."""
    small = coarser(scene)
    small = dataclasses.replace(small, interface=small.interface.coulomb())
    F_max = small.law.mean.hold(largest_load(small, t_end)[0])
    none = np.zeros((0, 2))
    guess = Pilot(small, None, none, max(t_end, 1e-9) / 20, 0, F_max, 0.0, "", 0.0)

    def enough() -> bool:
        return run.events >= EVENTS or run.log.step * small.N_x**2 > CHANGES

    try:
        run = QuasistaticRun(small)
        run.advance(t_end, enough, lambda *_: None)
        record = run.record("complete")
    except EquilibriumError as error:
        return guess._replace(failed=str(error))
    far = min(run.rows[-1][0] / max(t_end, 1e-30), 1.0)
    many = run.events / max(far, 1e-12) > MOST_EVENTS
    events = record.events
    blocks = events["n_blocks"] * (scene.N_x / small.N_x)
    return Pilot(
        scene=small,
        record=record,
        times=np.column_stack([events["t_start"], blocks]),
        interval=interval(record),
        open=most_open(record),
        F_max=max(abs(F) for _, F in run.rows),
        far=far,
        failed=f"about {run.events / far:.0e} events up to t_end" if many else "",
        seconds=sum(run.timings.values()),
    )


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


def most_open(record: Record) -> int:
    """Return how many blocks are open at a time at most."""
    return int((record.quiet["mode"] == OPEN).sum(axis=1).max(initial=0))

def coarser(scene: Scene) -> Scene:
    """Return the scene with blocks so large that `BLOCKS` and `COLUMNS` suffice.

    It keeps L, H, h and eta where there are blocks that fit; L and eta otherwise.
    """
    N_x, N_z = scene.N_x, scene.N_z
    if N_x * N_z <= BLOCKS and N_x <= COLUMNS:
        return scene
    if N_z == 1:
        return _coarser_chain(scene)
    n = math.gcd(N_x - 1, N_z - 1, scene.j_h)
    for q in range(2, n + 1):
        n_x, n_z = (N_x - 1) // q, (N_z - 1) // q
        few = (n_x + 1) * (n_z + 1) <= BLOCKS and n_x < COLUMNS
        if n % q == 0 and few and n_x >= 2:
            slider = dataclasses.replace(scene.slider, l=scene.slider.l * q, eta=scene.eta)
            return dataclasses.replace(
                scene, slider=slider, interface=_interface_on(scene, n_x + 1)
            )
    q = max((N_x - 1) / (COLUMNS - 1), math.sqrt(N_x * N_z / BLOCKS))
    n_x = max(math.floor((N_x - 1) / q), 2)
    while n_x > 2 and (n_x + 1) * (round(n_x * (N_z - 1) / (N_x - 1)) + 1) > BLOCKS:
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
    slider, top, N_x, N = scene.slider, scene.top, scene.N_x, COLUMNS
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


def linear_error(pilot: Pilot) -> float | None:
    """Return how far linear geometry is from finite geometry in start forces, over F_N.

    Measured where the driver pulls most, and at the last event: for the interface that the pilot
    run has there, the force at which the next block slips follows from two static states in finite
    geometry. None where there is no event, or no such state.
    """
    if pilot.record is None or pilot.record.events.empty:
        return None
    scene, quiet = pilot.scene, pilot.record.quiet
    begins = np.flatnonzero(quiet["kind"] > 0)
    rows = {int(begins[np.argmax(np.abs(quiet["F_T"][begins]))]), int(begins[-1])}
    try:
        solver = StaticSolver(scene, "finite")
        found = [_apart(solver, quiet, row) for row in rows]
    except (EquilibriumError, SceneError):
        return None
    return max(found)


def _apart(solver: StaticSolver, quiet: Mapping[str, np.ndarray], row: int) -> float:
    """Return how far apart the forces are at which the event of a row begins, over F_N."""
    scene, t = solver.scene, float(quiet["t"][row])
    free, u_x, F_T = quiet["mode"][row] == OPEN, quiet["u_x"][row], float(quiet["F_T"][row])
    load, drive = scene.load_at(t), scene.drive(t)
    back = np.copysign(NEARBY * scene.F_N / scene.driver.K, F_T)
    now, before = (solver.solve(u_x, drive - one, free=free, load=load) for one in (0.0, back))
    margins = [np.array(scene.law.margins(one.p, one.f))[:, ~free] for one in (now, before)]
    falls = (margins[1] - margins[0]) / (now.F_T - before.F_T)
    with np.errstate(divide="ignore", invalid="ignore"):
        further = np.where(falls > 0, margins[0] / falls, np.inf)
    return float(abs(now.F_T + further.min() - F_T) / scene.F_N)
