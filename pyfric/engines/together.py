"""Quasi-static sequences of many scenes at a time, on threads, without records.

Scenes that differ only in their interface share the condensed slider and the protocol, and run in
one call of the core. Each run has the same bits as a `QuasistaticRun` of this scene. While the core
follows one batch of scenes, the next batch is prepared.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from threading import Event
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric.core import Sequences, Status, processors, room_of_run
from pyfric.engines.pauses import longest_pause
from pyfric.engines.quasistatic import (
    AMBIGUOUS,
    GROWTH,
    IDLE,
    QUASISTATIC,
    QuasistaticRun,
    changes_in_a_call,
    why_not,
)
from pyfric.record import Outline, Statics, build_catalogue
from pyfric.scene import Scene
from pyfric.statics import (
    SMALL,
    EquilibriumError,
    Start,
    interfaces_of,
    legs_of,
    one_thread,
    rules_of,
    slider_of,
    stretches,
)
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pyfric.core import SequenceLog
    from pyfric.engines.options import Options
    from pyfric.statics import ContactProblem, Stretch

BATCH, BATCH_BYTES = 64, 64_000_000
"""Largest number of scenes in a batch, and of bytes of their states and logs."""
KEPT = 16
"""Number of foundations whose loaded state is stored."""


class Asked(NamedTuple):
    """A scene, the time to which it runs (s), and its t_gap (s); None means `longest_pause`."""

    scene: Scene
    t_end: float
    t_gap: float | None = None


def outlines(
    asked: Iterable[Asked | Exception], threads: int | None = None
) -> Iterator[Outline | Exception]:
    """Yield outlines of the quasi-static sequences of scenes, in the order of scenes.

    Args:
        asked: scenes that `check_ladder` accepts, or exceptions, which are passed on. The iterator
            is read one batch ahead.
        threads: number of threads of the core; None means one for each processor. The number does
            not change results.

    Yields:
        The outline of each run, or the SceneError or EquilibriumError that prevented it.
    """
    threads, together, stop = threads or processors(), _Together(), Event()
    with ThreadPoolExecutor(1, "pyfric") as pool:
        under_way: tuple[list[Any], Any] | None = None
        try:
            for batch in together.batches(iter(asked)):
                made, groups = together.prepared(batch)
                begun = pool.submit(_follow, groups, threads, stop)
                if under_way is not None:
                    yield from _finished(*under_way)
                under_way = made, begun
            if under_way is not None:
                yield from _finished(*under_way)
        finally:
            stop.set()


def has_outline(scene: Scene, options: Options) -> bool:
    """Return whether `outlines` can make a run: a quasi-static sequence without end conditions.

    In such a run, all options except `t_gap` have no effect.
    """
    ends = scene.stop_when if options.stop_when is None else options.stop_when
    return options.fidelity == QUASISTATIC.name and options.verify in (None, "none") and not ends


class _Loaded(NamedTuple):
    """The loaded state of a slider on a foundation.

    Attributes:
        problem: the condensed slider.
        t_gap: longest pause inside an event, in s.
        start: start of runs.
        F_T: force of the driver at the start, in N.
        held: stuck blocks, their p and f (N), and rounding (N), if no block slips under the load.
    """

    problem: ContactProblem
    t_gap: float
    start: Start
    F_T: float
    held: tuple[np.ndarray, np.ndarray, np.ndarray, float] | None


class _Group(NamedTuple):
    """Runs that share slider and protocol: indices in the batch, sequences, logs, and status."""

    numbers: list[int]
    runs: Sequences
    max_changes: int
    logs: list[list[SequenceLog]]
    status: np.ndarray
    phase: np.ndarray
    tol: np.ndarray


class _Run(NamedTuple):
    """A run of a batch: its scene, t_gap (s), F_T at the start (N), group, and index in it."""

    asked: Asked
    t_gap: float
    F_T: float
    group: _Group
    place: int


class _Together:
    """Batches of scenes, and the loaded states that they share."""

    def __init__(self) -> None:
        self.known: dict[Any, _Loaded] = {}

    def batches(self, asked: Iterator[Asked | Exception]) -> Iterator[list[Asked | Exception]]:
        """Yield scenes in batches of bounded size."""
        for first in asked:
            size = BATCH
            if isinstance(first, Asked):
                size = int(min(max(BATCH_BYTES // room_of_run(first.scene.N_x), 1), BATCH))
            yield [first, *itertools.islice(asked, size - 1)]

    def prepared(
        self, batch: Sequence[Asked | Exception]
    ) -> tuple[list[_Run | Exception], list[_Group]]:
        """Return the runs of a batch, and their groups with equal slider and protocol."""
        shared: dict[Any, list[tuple[int, Asked, _Loaded, Start]]] = {}
        made: list[Any] = list(batch)
        for n, each in enumerate(batch):
            if isinstance(each, Exception):
                continue
            scene, t_end, _ = each
            try:
                loaded, start = self.loaded(scene)
            except (SceneError, EquilibriumError) as error:
                made[n] = error
                continue
            drive = None if scene.load_at(0.0) is None else start.drive  # loads follow it
            key = scene.slider, scene.top, scene.driver, scene.walls, t_end, drive
            shared.setdefault(key, []).append((n, each, loaded, start))
        groups = []
        for members in shared.values():
            _, first, loaded, start = members[0]
            parts = stretches(first.scene, start.drive, first.t_end)
            groups.append(_group(parts, loaded, [(n, begin) for n, _, _, begin in members]))
            for place, (n, each, of, _) in enumerate(members):
                t_gap = of.t_gap if each.t_gap is None else each.t_gap
                made[n] = _Run(each, t_gap, of.F_T, groups[-1], place)
        return made, groups

    def loaded(self, scene: Scene) -> tuple[_Loaded, Start]:
        """Return the loaded state of a scene, and the start of its run.

        If no block slips under the load, scenes with equal foundations share the loaded state.
        """
        fields = (np.asarray(field).tobytes() for field in (scene.k_f, scene.gap))
        kinds = (scene.touches.tobytes(), scene.bare.tobytes())
        key = scene.slider, scene.top, scene.driver, scene.walls, *fields, *kinds
        known = self.known.get(key) if scene.interface.slip is None else None
        if known is not None and known.held is not None:
            stuck, p, f, tol = known.held
            if not (scene.law.static.remaining(p, f)[stuck] < -tol).any():
                return known, known.start._replace(scene=scene)
        with one_thread() if scene.N_x <= SMALL else nullcontext():
            run = QuasistaticRun(scene, longest_pause(scene) if known is None else known.t_gap)
        held = None
        if (applied := run.problem.applied()) is not None:
            held = applied.stuck, applied.values().p, applied.values().f, applied.tol
        start = Start.of(run.contact)
        found = _Loaded(run.problem, run.t_gap, start, run.initial.F_T, held)
        if held is not None and scene.interface.slip is None:
            while len(self.known) >= KEPT:
                del self.known[next(iter(self.known))]
            self.known[key] = found
        return found, start


def _group(parts: Sequence[Stretch], loaded: _Loaded, members: list[tuple[int, Start]]) -> _Group:
    """Return the runs of a group at their start."""
    scene, n = loaded.problem.scene, len(members)
    runs = Sequences(
        slider_of(loaded.problem, parts),
        rules_of(scene, IDLE, GROWTH),
        legs_of(parts),
        interfaces_of([start for _, start in members], parts),
    )
    logs: list[list[SequenceLog]] = [[] for _ in members]
    numbers = np.zeros(n, dtype=np.int32), np.zeros(n, dtype=np.int32), np.zeros(n)
    max_changes = changes_in_a_call(scene.N_x)
    return _Group([number for number, _ in members], runs, max_changes, logs, *numbers)


def _follow(groups: Sequence[_Group], threads: int, stop: Event) -> None:
    """Follow all runs of groups to their ends, or until `stop` is set."""
    for group in groups:
        runs, left = group.runs, np.arange(len(group.runs))
        while len(left) and not stop.is_set():
            status = runs.go_on(group.max_changes, threads=threads)
            for n, number in enumerate(left):
                group.logs[number].append(runs.log(n))
            group.status[left], group.tol[left] = status, runs.tol
            group.phase[left] = runs.count("phase")
            goes_on = (status == Status.PAUSED) | (status == Status.LOG_FULL)
            left = left[goes_on]
            runs = runs.part(goes_on) if len(left) else runs


def _finished(made: Sequence[_Run | Exception], begun: Any) -> Iterator[Outline | Exception]:
    """Yield the outlines of a batch, once the core has finished it."""
    begun.result()
    for run in made:
        yield run if isinstance(run, Exception) else _outline(run)


def _outline(run: _Run) -> Outline | Exception:
    """Return the outline of a run, or the error that stopped it."""
    group, n, scene = run.group, run.place, run.asked.scene
    logs, status = group.logs[n], Status(group.status[n])
    points = np.concatenate([[[0.0, run.F_T]], *(log.points[:, :2] for log in logs)])
    t = float(points[-1, 0])
    if status not in (Status.DONE, Status.AMBIGUOUS) or not np.isfinite(points[-1, 1]):
        rules, tol = group.runs.rules, float(group.tol[n])
        return why_not(status, int(group.phase[n]), t, tol, rules, scene.N_x)
    statics = Statics(
        *(_joined([getattr(log, name) for log in logs]) for name in ("F_T", "f", "p"))
    )
    catalogue = build_catalogue(
        *({k: _joined([log[m][k] for log in logs]) for k in logs[0][m]} for m in (0, 1)),
        scene=scene,
        t_gap=run.t_gap,
        t_end=t,
        statics=statics._replace(tau=-scene.d * statics.tau),
    )
    curve = {"t": points[:, 0], "F_T": points[:, 1]}
    ended = AMBIGUOUS if status == Status.AMBIGUOUS else "complete"
    return Outline.of_catalogue(catalogue, curve, ended)


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
