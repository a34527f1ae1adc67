"""Conditions that end a run before t_end: `stop_when`.

A condition is text, "name" or "name = values". Python, the command line, scene files and sweep
files use the same text (`pyfric.scene.ends`):

    pyfric.simulate("fig1", 2.0, stop_when="precursors = 3")
    pyfric.simulate(scene, 1.0, stop_when=["arrested", "reached = 50 mm"])

Engines with time steps check conditions at the points of the loading curve, the quasi-static engine
after each event. Up to its end, a run has the same bits as the run without conditions. Each
condition is one function of the history of a run. It returns the time from which the condition
holds if nothing slips again, or inf if this time is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import OPEN
from pyfric.record import build_catalogue, creeps_to_rest, main_blocks, parts
from pyfric.scene import condition

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.core import Forces, State
    from pyfric.record import Record
    from pyfric.scene import Scene

ENDED = "ended by stop_when ("
"""Beginning of the status of a run that a condition ended."""
TRANSITS = 3.0
"""Shortest pause between two events, over the time of a shear wave to cross the interface; see
`pyfric.engines.pauses`."""
CONDITIONS: dict[str, Callable[..., float]] = {}
"""Name of a condition -> function of the history (`Stopping`) and of the condition's values."""


def holds(due: Callable[..., float]) -> Callable[..., float]:
    """Register a function in `CONDITIONS` under its own name."""
    CONDITIONS[due.__name__] = due
    return due


@holds
def arrested(seen: Stopping) -> float:
    """Slip has begun, and it either creeps to rest or has paused for t_gap.

    In a chain, where nothing moves while nothing slips, a pause of three wave transits suffices.
    """
    if not np.isfinite(seen.first).any():
        return math.inf
    if seen.slips:
        return seen.t if seen.creeps(0.0) else math.inf
    return seen.rested()


@holds
def at_rest(seen: Stopping) -> float:
    """As `arrested`, and the driver makes no block slip until t_end."""
    more = force_to_come(seen.scene, seen.t, seen.t_end)
    if not more < seen.weakest():
        return math.inf
    if seen.slips:
        return seen.t if seen.creeps(more) else math.inf
    return seen.rested()


@holds
def reached(seen: Stopping, x: float) -> float:
    """The block at distance x from the trailing edge, or the next block beyond x, has slipped."""
    n = math.ceil(x / seen.scene.slider.l * (1 - 1e-12)) + 1
    return float(seen.first[seen.scene.n_of_i == n][0]) if n <= seen.scene.N_x else math.inf


@holds
def L_p(seen: Stopping, share: float) -> float:
    """The present or last event has L_p/L of at least `share`, from the trailing edge on."""
    touched = (seen.region | (seen.mode == OPEN))[np.argsort(seen.scene.n_of_i)]
    length = np.logical_and.accumulate(touched).sum()
    return seen.t if seen.region.any() and length >= share * seen.scene.N_x else math.inf


@holds
def precursors(seen: Stopping, n: float) -> float:
    """The n-th precursor has ended: a main event with 0 < L_p < L."""
    return seen.ended("is_precursor", n)


@holds
def main_events(seen: Stopping, n: float) -> float:
    """The n-th main event has ended: at least four blocks slipped, or all if fewer."""
    return seen.ended("is_main", n)


@holds
def system_size(seen: Stopping, n: float) -> float:
    """The n-th system-size event has ended: a main event with L_p = L."""
    return seen.ended("L_p_over_L", n)


@holds
def slow(seen: Stopping, v: float, lasting: float) -> float:
    """Slip has begun, but for a time `lasting` no block has started to slip or exceeded speed v.

    Speeds are known at the points of the loading curve.
    """
    if seen.speed > v:
        seen.t_fast[v] = seen.t
    if not np.isfinite(seen.first).any():
        return math.inf
    return max(seen.t_fast.get(v, seen.since), seen.t_switch) + lasting


def ended_by_condition(record: Record) -> bool:
    """Return whether a condition of `stop_when` ended a run."""
    return record.status.startswith(ENDED)


def force_to_come(scene: Scene, t: float, t_end: float) -> float:
    """Return the largest change of the driver force between t and t_end (s), in N.

    If other loads change, return inf.
    """
    later = [corner for corner in scene.corners if t < corner < t_end]
    ramp = any(scene.piece(what, t).slope for what in ("F_N", "T"))
    if (scene.load_at(t) is not None or scene.top.push) and (later or ramp):
        return math.inf
    turns = [leg.t_end for leg in scene.legs(t_end) if leg.t_end > t]
    ways = [scene.drive(t_1) - scene.drive(t) for t_1 in (*later, *turns, t_end)]
    return scene.driver.K * max(map(abs, ways))


def pause_of_waves(scene: Scene) -> float:
    """Return the time of a shear wave to cross the interface `TRANSITS` times, in s."""
    slider = scene.slider
    return TRANSITS * slider.L / (slider.l * math.sqrt(slider.k / (2 * scene.m)))


def stopping_of(
    texts: Iterable[str] | None, scene: Scene, t_gap: float, before: Record | None, t_end: float
) -> Stopping | None:
    """Return the `Stopping` of a run, or None if it has no conditions.

    If a condition ended the record `before`, only slip after its end counts.
    """
    if not texts:
        return None
    goes_on = before is not None and ended_by_condition(before)
    since = float(before.curve["t"].iloc[-1]) if goes_on else -math.inf
    return Stopping(texts, scene, t_gap, since, t_end)


class Stopping:
    """The history of a run on which its end conditions depend, and the check of conditions.

    Args:
        conditions: texts of the conditions.
        scene: the scene.
        t_gap: longest pause inside an event, in s.
        since: time before which slip does not count, in s.
        t_end: end of the run if no condition holds, in s.

    Attributes:
        t: time of the last check, in s.
        first: time of each block's first slip, corner slip left out, in s; NaN if there is none.
        region: blocks that slipped, lifted off or landed in the present or last event.
        slips: whether blocks slip now, corner slip left out.
        t_rest: time at which slip last stopped, in s.
        begun: number of events that have begun after `since`.
        t_switch: time at which slip last stopped or a block last began to slip, in s.
        mode: contact states at the last check.
        speed: speed of the fastest slipping block at the last check, in m/s.
    """

    def __init__(
        self, conditions: Iterable[str], scene: Scene, t_gap: float, since: float, t_end: float
    ) -> None:
        self.conditions = [(text, *condition(text)) for text in conditions]
        self.scene, self.t_gap, self.since, self.t_end = scene, t_gap, since, t_end
        self.t, self.slips, self.speed = since, False, 0.0
        self.t_rest = self.t_switch = since
        self.begun, self._stopped = 0, -math.inf
        self.first = np.full(scene.N_x, np.nan)
        self.region = np.zeros(scene.N_x, dtype=bool)
        self.mode = np.zeros(scene.N_x, dtype=np.int32)
        self.t_fast: dict[float, float] = {}
        self.state: State | None = None
        self.forces: Callable[[], Forces] | None = None
        self._logs: list[tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]]] = []
        self._known: tuple[int, pd.DataFrame | None] = (-1, None)
        self._settled: dict[str, tuple[int, int]] = {}

    # --- input from a run ------------------------------------------------------------------------

    def begin(self, state: State) -> None:
        """Count the slip of blocks in an initial state, from the time of this state on."""
        slipping = (np.abs(state.mode) == 1) & (state.corner == 0)
        self.slips, self.region = bool(slipping.any()), slipping
        self.begun += int(self.slips)
        self.first[slipping] = state.t

    def take(self, switches: Mapping[str, np.ndarray], quiet: Mapping[str, np.ndarray]) -> None:
        """Add the log entries since the last call."""
        self._logs.append((switches, quiet))
        begin = -1
        for step, t, kind in zip(quiet["step"], quiet["t"], quiet["kind"], strict=True):
            if kind > 0 and parts(t - self.t_rest, self.t_gap):
                begin = step
            new = kind > 0 and t > self.since and parts(t - self._stopped, self.t_gap)
            self.begun += int(new)
            self.slips = kind > 0
            if kind < 0:
                self._stopped = float(t)
                self.t_rest = max(self._stopped, self.since)
        if begin >= 0:
            self.region[:] = False
        starts = (np.abs(switches["new"]) == 1) & (np.abs(switches["old"]) != 1)
        starts &= switches["t"] > self.since
        opens = (switches["old"] == OPEN) != (switches["new"] == OPEN)  # or lands
        opens &= self.slips | (switches["t"] <= self.t_rest)
        free = (starts | opens) & (switches["step"] >= begin)
        self.region[switches["block"][free]] = True
        plain = starts & ~switches["corner"]
        blocks, times = switches["block"][plain], switches["t"][plain]
        self.t_switch = max(self.t_switch, times.max(initial=self.since), self.t_rest)
        new = np.full(len(self.first), np.nan)
        new[blocks[::-1]] = times[::-1]
        self.first = np.fmin(self.first, new)

    def look(self, t: float, mode: np.ndarray) -> None:
        """Store the time (s) and contact states of a static state."""
        self.t, self.mode = t, mode

    def look_at(self, state: State, forces: Callable[[], Forces]) -> None:
        """Store a state in motion; `forces` returns its forces."""
        self.t, self.mode, self.state, self.forces = state.t, state.mode, state, forces
        slips = np.abs(state.mode) == 1
        self.speed = float(np.abs(state.y[0, 2, slips]).max(initial=0.0))

    # --- quantities for conditions ---------------------------------------------------------------

    @property
    def events(self) -> pd.DataFrame:
        """Events after `since`, under the assumption that nothing slips again."""
        count = sum(len(quiet["t"]) for _, quiet in self._logs)
        if count != self._known[0]:
            logs = zip(*self._logs, strict=True)
            switches, quiet = (
                {name: np.concatenate([log[name] for log in part]) for name in part[0]}
                for part in logs
            )
            self._logs = [(switches, quiet)]
            how = {"t_gap": self.t_gap, "t_end": math.inf}
            events = build_catalogue(switches, quiet, self.scene, **how).events
            self._known = count, events[events["t_start"] > self.since]
        return self._known[1]

    def ended(self, which: str, n: float) -> float:
        """Return the end (s) of the n-th main event with 1 in the column `which`."""
        if not self._logs or self.most_ended(which) < n:
            return math.inf
        events = self.events
        wanted = (events[which] == 1) & events["is_main"] & events["finished"]
        self._settled[which] = len(events[:-1]), int(wanted[:-1].sum())
        stops = events["t_stop"][wanted]
        return self.quiet(float(stops.iloc[math.ceil(n) - 1])) if len(stops) >= n else math.inf

    def most_ended(self, which: str) -> int:
        """Return an upper bound of the number of ended main events with 1 in the column `which`.

        The bound needs no new catalogue. In the last catalogue, all events except the last are
        final. The bound includes every later event, and the present event if this event has ended
        and can be a main event.
        """
        known, wanted = self._settled.get(which, (0, 0))
        present = not self.slips and int(self.region.sum()) >= main_blocks(self.scene.N_x)
        return wanted + max(self.begun - known - 1, 0) + present

    def quiet(self, t: float) -> float:
        """Return the time (s) after which new slip does not join an event that stopped at t."""
        return (t + self.t_gap) * (1 + 1e-12)

    def rested(self) -> float:
        """Return the time (s) from which the slider is at rest if nothing slips again."""
        if self.scene.N_z > 1:
            return self.quiet(self.t_rest)
        return min(self.quiet(self.t_rest), self.t_rest + pause_of_waves(self.scene))

    def weakest(self) -> float:
        """Return the smallest additional force (N) that makes a block in contact slip.

        Without a state, or if margins (`Law.margin`) are not forces, return -inf.
        """
        if self.state is None or self.scene.law.margin.unit != "N":
            return -math.inf
        return float(self.state.margin[self.mode != OPEN].min(initial=math.inf))

    def creeps(self, more: float) -> bool:
        """Return whether slip comes to rest by itself, even if the driver adds `more` (N)."""
        if self.state is None or not more < self.weakest():
            return False
        return creeps_to_rest(self.scene, self.state, lambda: self.forces().a, more)

    # --- the end ---------------------------------------------------------------------------------

    def due(self) -> tuple[float, str]:
        """Return the time (s) at which a condition first holds if nothing slips, and its text."""
        dues = ((CONDITIONS[name](self, *with_), text) for text, name, with_ in self.conditions)
        return min(((math.inf if math.isnan(t) else t, text) for t, text in dues))

    def status(self) -> str:
        """Return the status of a run that ends now, or "" if no condition holds."""
        t, text = self.due()
        return self.named(text) if t <= self.t else ""

    @staticmethod
    def named(text: str) -> str:
        """Return the status of a run that a condition ended."""
        return f"{ENDED}{text})"
