"""Pilot runs: short runs before the choice of a model.

A quasi-static run, with larger blocks if necessary, finds the events. Static states in both
geometries give the error of linear geometry. A hybrid run of the first part of the time gives the
work of that part. The work of the rest is extrapolated in proportion to its events, each weighted
with the number of blocks that slip; one that goes on counts in part. Cheap full dynamics is made
once, if its price is wanted: most transitions occur in the last events.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.engines import (
    MAX_STEPS,
    HybridRun,
    QuasistaticRun,
    Run,
    RunError,
    coarser,
    full_counts,
    full_work,
    integrate,
    located,
    longest_pause,
    set_up,
    stopping_of,
    work,
    work_so_far,
)
from pyfric.record import build_catalogue
from pyfric.scene import SceneError
from pyfric.statics import EquilibriumError, StaticSolver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.engines import Options
    from pyfric.record import Record
    from pyfric.scene import Scene

EVENTS, CHANGES = 300, 2e8
"""Most events, and most changes of contact state times N_x^2, of the quasi-static pilot run."""
NEARBY = 1e-3
"""Change of F_T, over F_N, from which slopes of static states are computed."""
MOST_EVENTS = 1e4
"""Expected number of events above which the quasi-static engine is rejected: dynamics need not
treat each of them."""
PART = 0.25
"""Part of the run, by weighted events, that the hybrid pilot run covers."""
DEAR, LONGEST = 0.1, 5.0
"""Largest work of a pilot run with time steps: of a hybrid one over that of full dynamics of the
whole run, and in s."""


class Pilot(NamedTuple):
    """Result of the quasi-static pilot run of a scene, with Amontons-Coulomb friction.

    Attributes:
        record: record of the pilot run; None if it had no static states.
        times: start times (s) and numbers of slipping blocks of events, shape (n, 2).
        far: share of the time that the pilot run covers.
        failed: why the quasi-static engine cannot be used; "" if it can.
        t_stop: time (s) at which a condition ends the run; inf if none does.
    """

    record: Record | None
    times: np.ndarray
    far: float
    failed: str
    t_stop: float = math.inf

    @property
    def events(self) -> float:
        """Expected number of events in the whole run."""
        return len(self.times) / max(self.far, 1e-12)

    @property
    def weight(self) -> float:
        """The number of events and of the blocks that slip in them."""
        return float(np.sum(1 + self.times[:, 1]))

    def share(self, t: float, t_end: float) -> float:
        """Return the share of the work of a run to t_end that is done at t, both in s.

        An event and the motion after it take until the next event; its work grows with time.
        """
        begins, blocks = self.times.T
        done = np.concatenate([[0.0], np.cumsum(1 + blocks)])
        if not len(begins):
            return min(t / t_end, 1.0) if t_end > 0 else 1.0
        share = np.interp(t, [*begins, self.far * t_end], done) / done[-1]
        return float(share) * self.far


@functools.lru_cache(maxsize=16)
def pilot_run(scene: Scene, t_end: float, stop_when: tuple[str, ...] = ()) -> Pilot:
    """Return the quasi-static pilot run of a scene to t_end (s), or until a condition holds."""
    small = coarser(scene)
    small = dataclasses.replace(small, interface=small.interface.coulomb())

    def enough() -> bool:
        return run.events >= EVENTS or run.changes * small.N_x**2 > CHANGES

    stopping = None
    try:
        if stop_when:
            stopping = stopping_of(stop_when, small, longest_pause(scene), None, t_end)
        run = QuasistaticRun(small, stopping=stopping)
        run.advance(t_end, enough, lambda *_: None)
        record = run.record("complete")
    except EquilibriumError as error:
        return Pilot(None, np.zeros((0, 2)), 0.0, str(error))
    t_stop = math.inf
    if stopping is not None and run.events:
        stopping.look(stopping.t_rest, run.mode)
        t_stop, _ = stopping.due()
    far = min(run.history.last[0] / max(t_end, 1e-30), 1.0)
    events, too_many = record.events, run.events / max(far, 1e-12) > MOST_EVENTS
    blocks = events["n_blocks"] * (scene.N_x / small.N_x)
    return Pilot(
        record=record,
        times=np.column_stack([events["t_start"], blocks]),
        far=far,
        failed=f"about {run.events / far:.0e} events up to t_end" if too_many else "",
        t_stop=t_stop,
    )


def quasistatic_work(scene: Scene, pilot: Pilot) -> float:
    """Return the work of the quasi-static engine, from its pilot run, in s."""
    releases = pilot.weight / max(pilot.far, 1e-12)
    made = {"releases": releases, "static_events": pilot.events}
    return work(scene, "linear", made) + set_up(scene, "quasistatic", "linear").work


def expected_end(scene: Scene, t_end: float, stop_when: tuple[str, ...] | None) -> float:
    """Return the time (s) at which a condition ends the pilot run; t_end (s) if none does."""
    if not (stop_when and scene.has_rests and scene.law.rests):
        return t_end
    return min(t_end, pilot_run(scene, t_end, stop_when).t_stop)


def interval(record: Record) -> float:
    """Return the median time between main events of a quasi-static run, in s; inf without any.

    Events are separated here by any pause, because at high V t_gap would join many into one.
    """
    log = record.switches, record.quiet, record.scene
    events = build_catalogue(*log, t_gap=0.0).events
    starts = events["t_start"].to_numpy()[events["is_main"].to_numpy()]
    if len(starts) > 1:
        return float(np.median(np.diff(starts)))
    return float(record.curve["t"].iloc[-1]) if len(starts) else math.inf


def drop(record: Record) -> float:
    """Return the largest drop of F_T in system-size events of a quasi-static run, over F_N.

    Without viscosity a slider overshoots by as much as F_T dropped. The quasi-static engine leaves
    this overshoot out.
    """
    events = record.events
    whole = events[events["is_main"] & (events["n_blocks"] == record.scene.N_x)]
    fall = (whole["F_T_start"] - whole["F_T_arrest"]).max()
    return float(fall / record.scene.F_N) if fall > 0 else 0.0


def linear_error(pilot: Pilot) -> float | None:
    """Return the error of start forces in linear geometry compared with finite geometry, over F_N.

    The error is the larger one of two events: the one with the largest |F_T|, and the last one. The
    interface has the slips of the pilot run. In finite geometry, two static states give the force
    at which the next block slips. None is returned if there is no event or no static state.
    """
    if pilot.record is None or pilot.record.events.empty:
        return None
    scene, quiet = pilot.record.scene, pilot.record.quiet
    begins = np.flatnonzero(quiet["kind"] > 0)
    rows = {int(begins[np.argmax(np.abs(quiet["F_T"][begins]))]), int(begins[-1])}
    try:
        solver = StaticSolver(scene, "finite")
        return max(_apart(solver, quiet, row) for row in rows)
    except (EquilibriumError, SceneError):
        return None


def _apart(solver: StaticSolver, quiet: Mapping[str, np.ndarray], row: int) -> float:
    """Return the difference between the start forces of the event of a row, over F_N."""
    scene, t = solver.scene, float(quiet["t"][row])
    free, u_x, F_T = quiet["mode"][row] == OPEN, quiet["u_x"][row], float(quiet["F_T"][row])
    load, drive = scene.load_at(t), scene.drive(t)
    back = np.copysign(NEARBY * scene.F_N / scene.driver.K, F_T)
    now, before = (solver.solve(u_x, drive - x, free=free, load=load) for x in (0.0, back))
    margins = [np.array(scene.law.margins(at.p, at.f))[:, ~free] for at in (now, before)]
    falls = (margins[1] - margins[0]) / (now.F_T - before.F_T)
    with np.errstate(divide="ignore", invalid="ignore"):
        further = np.where(falls > 0, margins[0] / falls, np.inf)
    return float(abs(now.F_T + further.min() - F_T) / scene.F_N)


def transitions(scene: Scene, t_end: float, options: Options) -> tuple[float, float]:
    """Return what full dynamics takes to locate transitions, counted in a run of it.

    A run whose work exceeds `LONGEST` is extrapolated in proportion to time.

    Args:
        scene: the scene.
        t_end: end of the run, in s.
        options: options of the run, with its geometry, switching and step.

    Returns:
        Block evaluations that locate transitions, and the time (s) at which the run ends.
    """
    plain = dataclasses.replace(options, fidelity="dynamic", checkpoint=None, verify=None)

    def enough(run: Run) -> bool:
        return work_so_far(run) > LONGEST

    try:
        record = integrate(Run, scene, t_end, plain, progress=False, enough=enough)
    except RunError as error:
        record = error.record
    made, t = located(scene, record.counts, options.stepper), float(record.curve["t"].iloc[-1])
    if record.status == "interrupted":
        return made * t_end / max(t, options.dt), t_end
    return made, min(t, t_end)


def counted(scene: Scene, t_end: float, options: Options, pilot: Pilot) -> dict[str, float]:
    """Return the operations of a hybrid run, extrapolated from its first part.

    Args:
        scene: the scene.
        t_end: end of the run, in s.
        options: options of the run, with its geometry and step.
        pilot: quasi-static pilot run of the scene.
    """
    geometry, dt = options.geometry, options.dt
    full = full_work(scene, geometry, dt, t_end)
    first = work(scene, geometry, {"modal_bases": 1})  # of the first modes, which says nothing of t
    plain = dataclasses.replace(options, fidelity="hybrid", checkpoint=None, verify=None)

    def share(t: float) -> float:
        return pilot.share(t, t_end)

    def enough(run: Run) -> bool:
        dear = work_so_far(run) - first > min(DEAR * full, LONGEST)
        return dear or share(run.state.t) >= PART

    try:
        last = min(t_end, MAX_STEPS * dt)
        record = integrate(HybridRun, scene, last, plain, progress=False, enough=enough)
    except (RunError, EquilibriumError):
        return full_counts(scene, dt, t_end)
    t = float(record.curve["t"].iloc[-1])
    part = max(share(t) or t / t_end, 1e-6)  # the time counts as long as there is no event
    made = {name: count / part for name, count in record.counts.items()}
    bases = record.counts["modal_bases"]
    return made | {"modal_bases": min(bases, 1) + max(bases - 1, 0) / part}
