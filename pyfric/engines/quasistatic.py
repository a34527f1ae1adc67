"""Quasi-static engines: every state is an equilibrium, without inertia, in linear geometry.

`QuasistaticRun` makes a quasi-static sequence of events, also called a ladder. Between events no
block slips and all forces are affine in the driver's position. A closed formula therefore gives the
next start of slip. During an event the driver rests. Slipping blocks carry mu_k p, and stuck blocks
stay below mu_s p. Blocks are released one at a time, in order of |f| - mu_s p, largest first. A
block that would move back sticks again where it was. At the end of the event all blocks stick. The
driver may also move back, and loads may change. The sequence leaves out the overshoot of moving
blocks, which makes events shorter.

For mu_s = mu_k slip grows continuously. It is followed exactly: between two changes of contact
state all quantities are linear in the drive. The signs of the rates decide which blocks at their
threshold slip and which stick. A sequence with negligible mu_s - mu_k is treated in the same way,
because it would have too many events. `pyfric.engines.prediction` treats any scene in this way.

The core follows the sequence (`pyfric.core.Sequences`) if it can (`pyfric.statics.follows`). In
Python, `_climb` and `_grow` make the same changes in the same order, for other runs and for tests.

Source: PRL 107, 074301 (2011), for the model, and for arrest lengths with mu_s = mu_k.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import (
    CORNER_SHARE,
    IN_EVENT,
    OPEN,
    STUCK,
    Sequences,
    StateError,
    Status,
)
from pyfric.display import Progress, run_bar
from pyfric.engines.engine import Counted, Engine
from pyfric.engines.options import owned
from pyfric.engines.pauses import loading_notes, longest_pause
from pyfric.engines.recorder import kept_notes
from pyfric.engines.stopping import stopping_of
from pyfric.engines.strains import contact_notes, strain_notes
from pyfric.record import (
    QUIET_COLUMNS,
    SWITCH_COLUMNS,
    History,
    Method,
    Record,
    Statics,
    build_catalogue,
    versions,
    zone_notes,
)
from pyfric.signals import answered
from pyfric.statics import (
    LEAST_DEFINITENESS,
    ContactProblem,
    EquilibriumError,
    Start,
    Stretch,
    check_ladder,
    check_statics,
    follows,
    interfaces_of,
    legs_of,
    rules_of,
    slider_of,
    stretches,
)
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pyfric.core import Rules, State
    from pyfric.engines.options import Options
    from pyfric.engines.stopping import Stopping
    from pyfric.scene import Scene
    from pyfric.statics import Contact, Values

GROWTH = 60
"""Largest number of changes of contact state while a slipping zone grows, over N_x."""
IDLE = 200
"""Largest number of successive changes of contact state without motion of the driver."""

IN_A_CALL = 4_000_000
"""Changes of contact state in a call of the core, times N_x^2. They take a few milliseconds."""
ENDLESS = "at t = {t:.6g} s slip goes on without end, in events of no length"
OF_EVENT = "the quasi-static event at t = {t:.6g} s: {what}"
AMBIGUOUS = "ended where slip may not be unique"
"""Status of a run that ends because the solution for slip may not be unique."""
WHY = {
    Status.DONE: "the quasi-static sequence left the range of numbers",
    Status.UNSETTLED: "contact states do not settle",
    Status.GROWS: "the growth of the slipping zone does not end",
    Status.UNSUPPORTED: "the slider is not supported",
    Status.UNHELD: "the slider is not held by the blocks that stick",
}
"""Status of the core -> reason why it could not go on."""

BENDS = 32
"""Number of straight parts of the curve between two changes of contact state while the driver
accelerates."""


def _columns(rows: list[tuple[Any, ...]], kinds: Mapping[str, np.dtype]) -> dict[str, np.ndarray]:
    columns = zip(kinds.items(), zip(*rows, strict=True), strict=True)
    return {name: np.array(values, dtype=kind) for (name, kind), values in columns}


def changes_in_a_call(N_x: int) -> int:
    """Return the largest number of changes of contact state in a call of the core."""
    return max(IN_A_CALL // N_x**2, 1)


def why_not(
    status: Status, phase: int, t: float, tol: float, rules: Rules, N_x: int
) -> EquilibriumError:
    """Return the error of a run that the core could not follow to its end.

    Args:
        status: status of the core.
        phase: phase of the run.
        t: time at which the run stopped, in s.
        tol: largest violation of conditions by rounding, in N.
        rules: limits of the run.
        N_x: number of blocks.
    """
    if status == Status.IDLE:
        return EquilibriumError(ENDLESS.format(t=t), np.nan, tol, int(rules.idle))
    limits = {Status.UNSETTLED: rules.changes * N_x, Status.GROWS: rules.growth * N_x}
    what = OF_EVENT.format(t=t, what=WHY[status]) if phase == IN_EVENT else WHY[status]
    return EquilibriumError(what, np.nan, tol, int(limits.get(status, 0)))


def _check_slip(scene: Scene, contact: Contact) -> None:
    """Refuse an initial slip under which a block exceeds its strength."""
    now = contact.values()
    excess = np.where(contact.stuck, -contact.law.remaining(now.p, now.f), -np.inf)
    i = int(np.argmax(excess))
    if scene.interface.slip is not None and excess[i] > contact.tol:
        n, slip = scene.n_of_i[i], float(scene.field("slip")[i])
        reason = f"block {n} from the trailing edge then bears {excess[i]:.3g} N more than mu_s p"
        allowed = "a slip after which all blocks rest, or fidelity = 'hybrid' or 'dynamic'"
        raise SceneError("interface.slip", slip, "m", allowed, reason)


class QuasistaticRun:
    """The quasi-static sequence of events of one scene.

    Args:
        scene: the scene.
        t_gap: longest pause inside an event, in s; None means `longest_pause`.
        stopping: conditions that end the run.
        in_core: whether the core follows the sequence; None means whenever it can.

    Raises:
        EquilibriumError: the scene has no loaded equilibrium.
    """

    name = "quasistatic"
    until_slip = False
    """Whether a run ends before its first slip."""

    def __init__(
        self,
        scene: Scene,
        t_gap: float | None = None,
        stopping: Stopping | None = None,
        in_core: bool | None = None,
    ) -> None:
        start = time.perf_counter()
        self.scene, self.stopping = scene, stopping
        self.in_core = follows(scene) if in_core is None else in_core
        self.t_gap = longest_pause(scene) if t_gap is None else t_gap
        self.problem = ContactProblem(scene)
        self.contact = self.problem.loaded()
        _check_slip(scene, self.contact)
        self.drive_0 = self.contact.drive
        self.history = History(["t", "F_T"])
        self.mode_0 = self.mode = self.contact.logged
        self.corner, self.p_corner = np.zeros(scene.N_x, bool), CORNER_SHARE * scene.F_N / scene.N_x
        self.slips, self.changes, self.starts, self.events, self.releases = False, 0, 0, 0, 0
        self.nothing = self.history.logs(scene.N_x)["quiet"]  # columns of an empty log
        self.switches: list[tuple[Any, ...]] = []  # rows of logs not yet in the history
        self.quiet: list[tuple[Any, ...]] = []
        self.steps: list[int] = []  # changes before each point of the curve
        self.statics: list[tuple[Any, ...]] = []  # F_T, f, p at starts and ends of slip
        self.stretch = Stretch(scene.legs(0.0)[0], self.drive_0)  # present part of the protocol
        self.ending = ""  # status of a run that ends before t_end
        self.t_quiet = -math.inf  # no slip before this time
        self.begin = 0.0  # no condition ends the run before this time
        self.notes: tuple[str, ...] = ()
        self.timings = {"set-up": time.perf_counter() - start}
        self.initial = self.contact.values()

    @property
    def counts(self) -> dict[str, int]:
        """Counts of released blocks and of events."""
        return {"releases": self.releases, "static_events": self.events, "block_evaluations": 0}

    @property
    def grows(self) -> bool:
        """Whether slip grows continuously."""
        return self.contact.law.gradual and not self.until_slip

    @property
    def t(self) -> float:
        return self.stretch.leg.time_at(self.contact.drive - self.stretch.offset)

    def sample(self) -> None:
        self.point(self.t, self.contact.values().F_T)

    def point(self, t: float, F_T: float) -> None:
        """Add the point t (s), F_T (N) to the curve."""
        self.history.add(np.array([[t, F_T]]))
        self.steps.append(self.changes)

    def log(self, t: float, before: Values | None = None) -> None:
        """Log the changes of contact state. Slip starts at the values `before` the change."""
        old, new = self.mode, self.contact.logged
        changed = np.flatnonzero(new != old)
        if not changed.size:
            return
        now = self.contact.values()
        before = now if before is None else before
        self.releases += int((np.abs(new[changed]) == 1).sum())
        for i in changed:
            begins = abs(old[i]) != 1
            at = before if begins and abs(new[i]) == 1 else now
            if begins:
                self.corner[i] = at.p[i] < self.p_corner
            corner = self.corner[i]
            self.switches.append((self.changes, i, old[i], new[i], corner, t, at.u_x[i], at.p[i]))
        self.mode, was = new, self.slips
        self.slips = bool(((np.abs(new) == 1) & ~self.corner).any())  # without corner slip
        if self.slips != was:
            kind, mode, at = (-1, new, now) if was else (1, old, before)
            self.quiet.append((self.changes, t, kind, at.F_T, at.u_x.copy(), mode))
            self.statics.append(([at.F_T], at.f[None], at.p[None]))
            self.starts += self.slips
        self.changes += 1

    def pass_on(self) -> None:
        """Pass the changes since the last call to the history and to the conditions."""
        if not self.switches:
            return
        switches = _columns(self.switches, SWITCH_COLUMNS)
        quiet = _columns(self.quiet, QUIET_COLUMNS) if self.quiet else self.nothing
        self.history.log(switches=switches, quiet=quiet)
        if self.stopping is not None:
            self.stopping.take(switches, quiet)
        self.switches, self.quiet = [], []

    def advance(self, t_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> bool:
        """Follow the scene to t_end (s); return False if the run was interrupted.

        Raises:
            EquilibriumError: an event does not end, or slip goes on in events of zero length.
        """
        start = time.perf_counter()
        self.sample()
        self.follow(t_end, stop, show)
        if not np.isfinite(self.history.last[1]):
            raise EquilibriumError(WHY[Status.DONE], np.nan, self.contact.tol, 0)
        self.timings["events"] = time.perf_counter() - start
        return not stop()

    def follow(self, t_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> None:
        """Follow the segments of the protocol up to t_end (s), which may be inf."""
        parts = stretches(self.scene, self.drive_0, t_end)
        if self.in_core:
            self._follow_in_core(parts, stop, show)
            return
        contact = self.contact
        for stretch in parts:
            leg, offset, route = stretch
            if leg.way != contact.way or route is not None:  # all slip stops
                contact.hold_all()
                self.log(leg.t)
            self.stretch = stretch
            if route is not None:
                contact.along(self.problem.along(route), offset + leg.first)
            if leg.way:
                contact.way = leg.way
                go = self._grow if self.grows else self._climb
                go(offset + leg.last, stop, show)
            if stop() or self.ending or math.isinf(leg.t_end):
                return
            contact.drive = offset + leg.last
            self.point(leg.t_end, contact.values().F_T)
            show(*self.history.last, self.events)

    def _follow_in_core(
        self, parts: Sequence[Stretch], stop: Callable[[], bool], show: Callable[..., None]
    ) -> None:
        """Follow the segments of the protocol in the core."""
        scene, stops = self.scene, self.stopping is not None or self.until_slip
        if self.grows:
            self._note_continuous()
        runs = Sequences(
            slider_of(self.problem, parts),
            rules_of(scene, IDLE, GROWTH),
            legs_of(parts),
            interfaces_of([Start.of(self.contact)], parts, grow=not self.until_slip),
        )
        limit, status = changes_in_a_call(scene.N_x), Status.PAUSED
        self._force_at = lambda drive: runs.force(0, drive)
        while status in (Status.PAUSED, Status.LOG_FULL) and not stop():
            status = Status(runs.go_on(limit, stops=stops)[0])
            self._take(runs)
            self.stretch = parts[min(int(runs.count("leg")[0]), len(parts)) - 1]
            show(*self.history.last, self.events)
            if stops and runs.looks[0]:
                ahead = float(runs.ahead[0])
                t = self.stretch.leg.time_at(ahead - self.stretch.offset)
                if self._ended(t) or self._slips(int(runs.slipping[0]), t, ahead):
                    return
        if status == Status.AMBIGUOUS:
            self._end_ambiguous()
        elif status not in (Status.DONE, Status.PAUSED, Status.LOG_FULL):
            t, phase, tol = self.history.last[0], int(runs.count("phase")[0]), float(runs.tol[0])
            raise why_not(status, phase, t, tol, runs.rules, scene.N_x)

    def _slips(self, i: int, t: float, drive: float) -> bool:
        """End a run that ends before its first slip if block i slips next; -1 means none."""
        if i < 0 or not self.until_slip:
            return False
        self.point(t, self._force_at(drive))
        self._end_at_slip(i)
        return True

    def _take(self, runs: Sequences) -> None:
        """Add the logs of the last call of the core to the history, and copy its counts."""
        log = runs.log(0)
        self.history.add(log.points[:, :2])
        self.steps += log.points[:, 2].astype(int).tolist()
        self.history.log(switches=log.switches, quiet=log.quiet)
        self.statics.append((log.quiet["F_T"], log.f, log.p))
        if self.stopping is not None:
            self.stopping.take(log.switches, log.quiet)
        self.mode = runs.mode[0]
        self.changes, self.events, self.releases, self.starts = (
            int(runs.count(name)[0]) for name in ("step", "events", "releases", "starts")
        )

    # --- in Python -------------------------------------------------------------------------------

    def _climb(self, drive_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> None:
        """Follow the sequence of events until the driver is at drive_end."""
        contact, idle = self.contact, 0
        rounding = contact.tol / self.scene.driver.K
        while not stop():
            drive, i, mode = contact.next_change()
            if not contact.way * (drive - drive_end) <= 0:
                return
            idle = idle + 1 if contact.way * (drive - contact.drive) <= rounding else 0
            if idle > IDLE:
                raise EquilibriumError(ENDLESS.format(t=self.t), np.nan, contact.tol, IDLE)
            if self._ended(self.stretch.leg.time_at(drive - self.stretch.offset)):
                return
            contact.drive = drive
            self.sample()
            if mode in (OPEN, STUCK):
                contact.change(i, mode)
                self.log(self.t)
            else:
                self._event(i, mode, stop)
            self.sample()
            show(*self.history.last, self.events)
            if self.ending:
                return

    def _grow(self, drive_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> None:
        """Follow continuous slip, mu_k = mu_s, until the driver is at drive_end or nothing changes.

        Raises:
            EquilibriumError: stick and slip are not found from rates, or the zone grows without
                end.
        """
        self._note_continuous()
        contact, law = self.contact, self.contact.law.continuous()
        contact.law = law
        for _ in range(GROWTH * self.scene.N_x):
            for _ in contact.settle_rates():
                pass
            self.log(self.t)
            self.events = self.starts
            self.sample()
            show(*self.history.last, self.events)
            if stop() or not contact.stuck.any() or self._ended(self.t):
                return
            if contact.definiteness() < LEAST_DEFINITENESS:
                self._end_ambiguous()
                return
            drive, i, mode = contact.next_change(reload=False)
            if math.isinf(drive) or not contact.way * (drive - drive_end) <= 0:
                return
            contact.drive = drive
            contact.change(i, mode)
        limit = GROWTH * self.scene.N_x
        raise EquilibriumError(WHY[Status.GROWS], np.nan, contact.tol, limit)

    def _end_at_slip(self, i: int) -> None:
        """End the run at the first slip, of block i."""
        (t, F_T), n = self.history.last, int(self.scene.n_of_i[i])
        self.ending = "ended at first slip"
        self.notes += (
            f"{self.name}: the run ends where block {n} slips first, "
            f"at t = {t:.9g} s and F_T/F_N = {F_T / self.scene.F_N:.9g}",
        )

    def _note_continuous(self) -> None:
        """Add a note that slip is continuous, if mu_s exceeds mu_k by a negligible amount."""
        law = self.contact.law
        if np.any(law.drop > 0):
            self.notes += (
                f"mu_s - mu_k = {np.max(law.drop):.3g} is negligible: "
                f"slip is continuous, at mu_s = {law.mean.mu_s:g}",
            )

    def _end_ambiguous(self) -> None:
        """End the run because the solution for slip may not be unique from here on."""
        self.ending = AMBIGUOUS
        self.notes += (
            f"{self.name}: slip is followed up to F_T/F_N = "
            f"{self.history.last[1] / self.scene.F_N:.6g}, where the definiteness of the "
            f"slip operator falls below {LEAST_DEFINITENESS:g}: friction is so strong "
            f"(mu = {self.contact.law.mean.mu_s:g}) that the solution may not be unique beyond",
        )

    def _ended(self, t: float) -> bool:
        """Return whether a condition ends the run before the next change, at t (s)."""
        if self.stopping is None:
            return False
        self.pass_on()
        now = self.history.last[0]
        self.stopping.look(now, self.mode)
        due, text = self.stopping.due()
        if max(due, self.begin) <= t:
            self.ending = self.stopping.named(text)
            self.t_quiet = max(due, self.begin, now)
            if self.begin > max(due, now):  # end of the record that is continued
                (leg, offset, _), s = self.stretch, self.begin - self.stretch.leg.t
                drive = offset + leg.first + s * (leg.value + 0.5 * s * leg.slope)
                self.point(leg.time_at(drive - offset), self._force_at(drive))
        return bool(self.ending)

    def _force_at(self, drive: float) -> float:
        """Return F_T (N) with the driver at a position (m), at fixed contact states."""
        self.contact.drive = drive
        return self.contact.values().F_T

    def _event(self, i: int, direction: int, stop: Callable[[], bool]) -> None:
        """Release block i and follow the event at this position of the driver."""
        self.events += 1
        contact, t = self.contact, self.t
        now = contact.values()
        contact.change(i, direction)
        self.log(t, now)
        try:
            for before in contact.follow(now.u_x):
                self.log(t, before)
                if stop():
                    return
        except EquilibriumError as error:
            what, *figures = error.args
            raise EquilibriumError(OF_EVENT.format(t=t, what=what), *figures) from error
        contact.hold_all()
        self.log(t)

    def known_statics(self) -> Statics:
        """Return the static states at the logged starts and ends of slip."""
        if not self.statics:
            nothing = np.zeros((0, self.scene.N_x))
            return Statics(np.zeros(0), nothing, nothing)
        F_T, f, p = map(np.concatenate, zip(*self.statics, strict=True))
        return Statics(F_T, -self.scene.d * f, p)

    def _with_bends(self) -> np.ndarray:
        """Return the points of the curve, with more points where the driver accelerates, (n, 2).

        Between two points F_T is linear in the position of the driver.
        """
        scene, points = self.scene, self.history.points()
        if not any(leg.slope for leg in scene.legs(self.history.last[0])):
            return points
        rows = points.tolist()
        found = rows[:1]
        for (t, F_T), end in itertools.pairwise(rows):
            if end[0] > t and scene.piece("V", 0.5 * (t + end[0])).slope:
                times = np.linspace(t, end[0], BENDS + 1).tolist()
                first, *inside, last = map(scene.drive, times)
                rate = (end[1] - F_T) / (last - first) if last != first else 0.0
                forces = [F_T + rate * (drive - first) for drive in inside]
                found += zip(times[1:-1], forces, strict=True)
            found.append(end)
        return np.array(found)

    def record(self, status: str, engine: str | None = None, **columns: Any) -> Record:
        """Return the record of the run so far."""
        start = time.perf_counter()
        scene = self.scene
        self.pass_on()
        logs = self.history.logs(scene.N_x)
        catalogue = build_catalogue(
            **logs,
            scene=scene,
            t_gap=self.t_gap,
            t_end=max(self.history.last[0], self.t_quiet),
            statics=self.known_statics(),
        )
        points = self.history.points() if columns else self._with_bends()
        curve = {"t": points[:, 0], "F_T": points[:, 1], **columns}
        t_end, F_T = self.history.last[0], float(np.abs(points[:, 1]).max())
        f, p = self.initial.f, self.initial.p
        engine = engine or self.name
        warned = strain_notes(scene, engine, F_T, t_end)
        if engine == "quasistatic":  # a prediction is independent of V
            warned += loading_notes(scene, engine) + zone_notes(scene, engine, catalogue)
            warned += contact_notes(scene, engine, logs["switches"])
        return Record.from_catalogue(
            catalogue,
            scene=scene,
            method=Method(engine=engine, geometry="linear", t_gap=self.t_gap),
            curve=curve,
            tau_initial=-scene.d * f,
            p_initial=p,
            **logs,
            versions=versions(),
            timings=self.timings | {"catalogue": time.perf_counter() - start},
            counts=self.counts,
            notes=(*self.notes, *warned),
            status=status,
        )


class EquilibriumRun(QuasistaticRun):
    """The stuck slider under the driver, up to the first slip. Blocks may open and close."""

    name = "equilibrium"
    until_slip = True

    def _event(self, i: int, direction: int, stop: Callable[[], bool]) -> None:
        self._end_at_slip(i)


def static_sequence(
    kind: type[QuasistaticRun],
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    enough: Callable[[Counted], bool] | None = None,
) -> Record:
    """Follow a scene through static states to t_end (s); see `pyfric.simulate`.

    A run that continues a record is computed again from t = 0, with the same bits. A run ends with
    status "interrupted" as soon as `enough` returns true.
    """
    if not isinstance(initial, Record | None):
        raise StateError(f"initial: the {kind.name} engine continues records only")
    begin = 0.0 if initial is None else float(initial.curve["t"].iloc[-1])
    t_end = check_number("t_end", t_end, "s", ge=begin)
    gap = longest_pause(scene) if options.t_gap is None else options.t_gap
    run = kind(scene, gap, stopping_of(options.stop_when, scene, gap, initial, t_end))
    run.begin = begin
    with run_bar(progress, scene.name, 0.0, t_end) as bar, answered() as stop:

        def show(t: float, F_T: float, events: int) -> None:
            bar(Progress(t, 0.0, t_end, F_T / scene.F_N, events, math.nan))

        def ends() -> bool:
            return stop() or (enough is not None and enough(run))

        done = run.advance(t_end, ends, show)
        record = run.record(run.ending or "complete" if done else "interrupted")
    return record.replace(notes=(*kept_notes(initial), *record.notes))


QUASISTATIC = Engine(
    name=QuasistaticRun.name,
    models="a sequence of static states; events by a rule without inertia",
    leaves_out=("inertia, waves, ring-down", "rotation of bonds"),
    options=owned("run", "events"),
    geometries=("linear",),
    check=check_ladder,
    follow=functools.partial(static_sequence, QuasistaticRun),
)
EQUILIBRIUM = Engine(
    name=EquilibriumRun.name,
    models="static states up to the first slip",
    leaves_out=QUASISTATIC.leaves_out,
    options=owned("run"),
    geometries=("linear",),
    check=check_statics,
    follow=functools.partial(static_sequence, EquilibriumRun),
)
