"""`simulate`: a run with a named engine, or with levels chosen by a tolerance."""

from __future__ import annotations

import dataclasses
import functools
import logging
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import State, StateError
from pyfric.engines import (
    ENGINES,
    POINTS,
    SLOWEST,
    Counted,
    Options,
    RunError,
    check_kept,
    check_steps,
    default_stepper,
    full_work,
    kept,
    machine_speed,
    multiple,
    owned,
    shared_statics,
    step_of_waves,
    step_size,
    work,
)
from pyfric.planning.levels import alone, levels, of_named
from pyfric.planning.pairs import Asked, Made, finest
from pyfric.planning.plans import as_made, expected_work, work_done
from pyfric.planning.points import levels_of
from pyfric.record import Record
from pyfric.scene import as_scene, check_geometry, density_notes, followed_by
from pyfric.signals import forget, raise_if_asked
from pyfric.statics import (
    EquilibriumError,
    check_sticks,
    loaded_state,
    one_thread_if_small,
)
from pyfric.values import SceneError, check_number, check_whole, check_writable, naming, usage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Unpack

    from pyfric.display import Progress
    from pyfric.engines import Keywords
    from pyfric.planning.levels import Level
    from pyfric.planning.pairs import Pair
    from pyfric.scene import Number, Scene, SceneLike

STATIC_SHARE = 0.25
"""Largest work of a quasi-static sequence, over the work of full dynamics. A policy."""
BUDGET = "4 x"
"""Default of the option `budget`. A policy."""
LONG = 600.0
"""Expected wall time above which a note is printed before a run, in s."""
SHORT = 10.0
"""Smallest ratio of steps without and with viscosity that gives a note on its cost. A policy."""
LOGGER = logging.getLogger("pyfric")


@usage('simulate(scene, t_end="400 ms")')
@one_thread_if_small
def simulate(
    scene: SceneLike,
    t_end: Number | None = None,
    options: Options | None = None,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **keywords: Unpack[Keywords],
) -> Record:
    """Simulate a scene from the loaded slider, or continue another run.

    A `Record` as `initial` continues its run, and the result holds the whole run. Engine, geometry,
    stepper, switching, step, rtol, accuracy, energies, sampling and t_gap stay the same; other
    values of these options are refused. `want`, `tolerance` and `verify` are refused, too, because
    no level is chosen. The speed of the driver or the loads may change at the end of the record.
    The scene of the result then has a protocol with both values. The driver continues from its
    position, so that F_T does not jump. Times of protocols count from t = 0. Full dynamics
    continues with the same bits. The hybrid engine finds the same events, with forces that agree to
    its accuracy.

    Ctrl-C ends a run with status "interrupted". The record is then valid, and `initial=record`
    continues the run. The next call of `simulate`, `plan`, `run_all` or `prediction_curve` in the
    same script or cell raises KeyboardInterrupt, so that loops end. Before the first step, Ctrl-C
    raises KeyboardInterrupt at once.

    The logger "pyfric" of `logging` gets status and notes of the record, at level INFO.

    Full dynamics and planned runs that are expected to take more than ten minutes have a note. The
    note is also printed on stderr before the start, unless progress is False or a function.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file.
        t_end: time of the end, in s; required. The last step ends at t_end or just beyond.
        options: options of the run; None means `Options()`.
        initial: None starts at t = 0 from the loaded state with F_T = 0. A `State` starts from this
            state, also with another scene; if K or the driven blocks differ, F_T stays the same. A
            `Record` continues its run.
        progress: True for a bar on stderr, False for none, or a function that is called about ten
            times per second. None shows the bar if stderr is a terminal.
        **keywords: single options, which replace those in `options`; see `Options`.

    Returns:
        The record. Its status begins with "ended" if an engine could not continue to t_end, as in
        "ended at first slip", or if a condition ended the run, as in "ended by stop_when
        (arrested)". Its `notes` name the end of the run and, with fidelity = "auto", the levels
        that were run.

    Raises:
        SceneError: an argument is refused, or the run needs more memory than is available. No run
            has started.
        StateError: `initial` does not belong to the scene or the engine.
        EquilibriumError: the scene has no loaded state.
        OSError: `checkpoint` cannot be written. No run has started.
        RunError: the motion left the range of the model, or contacts switched without end inside a
            step. The attribute `record` of the error holds the run up to this point.

    Source: PRL 107, 074301 (2011).
    """
    if isinstance(initial, Record) and initial.status == "interrupted":
        forget()
    raise_if_asked()
    if not isinstance(initial, State | Record | None):
        raise StateError(f"initial: expected a State or a Record, not {type(initial).__name__}")
    if t_end is None:
        raise SceneError("t_end", None, "s", 'a time, as in simulate(scene, "900 ms")', "missing")
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if not isinstance(options, Options | None):
        allowed = 'Options, or keywords as in simulate(scene, t_end, fidelity="hybrid")'
        raise SceneError("options", options, "", allowed)
    given = {**(options or Options()).given(), **keywords}
    if isinstance(initial, Record):
        engine = initial.method.engine
        if engine not in ENGINES:
            raise StateError(f"initial: a record of the {engine} engine cannot be continued")
        keywords = {**keywords, **kept(initial.method)}
    options = dataclasses.replace(options or Options(), **keywords).on(scene)
    if options.verify == "shared":
        allowed = "'sample' for a single run; runs share a verification in run_all and in sweeps"
        raise SceneError("verify", "shared", "", allowed)
    notes: tuple[str, ...] = ()
    if isinstance(initial, Record):
        options = _going_on(initial, options)
        check_kept(scene, initial.method, given)
        scene, notes = _both(initial, scene)
    else:
        options.check_sample(t_end - (0.0 if initial is None else initial.t))
    check_run(scene, options, given)
    if options.checkpoint is not None:
        numbers = 4 * scene.N_x * scene.N_z + 2 * POINTS
        with naming("checkpoint"):
            check_writable(options.checkpoint, 8 * numbers, ".nc")
    run = functools.partial(_run, initial=initial, progress=progress)
    asked = Asked(scene=scene, t_begin=_begin(initial), t_end=t_end, options=options, run=run)
    if options.fidelity == "auto":
        of = levels(scene, options, begun=initial is not None)
        _check_steps(of, asked)
        notes += (*_short_steps(asked, progress),)
        return _logged(_with_notes(leveled(asked, of, progress), *notes))
    notes += (*_short_steps(asked, progress),)
    if options.verify not in (None, "none"):
        return _logged(_with_notes(leveled(asked, of_named(scene, options)), *notes))
    return _logged(_with_notes(run(scene, t_end, options), *notes))


def _logged(record: Record) -> Record:
    """Send status and notes of a record to the logger "pyfric"; return the record."""
    LOGGER.info("%s: %s", record.scene.name or "scene", record.status)
    for note in record.notes:
        LOGGER.info("%s", note)
    return record


def _check_steps(of: tuple[Level, ...], asked: Asked) -> None:
    """Raise SceneError if a run has too many steps, before any work."""
    for level in of:
        if level.dt is not None:
            check_steps(asked.t_begin, asked.t_end, level.dt)


def check_run(scene: Scene, options: Options, given: Mapping[str, Any] | None = None) -> None:
    """Raise SceneError if the named engine cannot run a scene, or lacks an option.

    `given` are the options that a user gave; None means all options that differ from their
    defaults.
    """
    named = options.fidelity != "auto" and options.verify in (None, "none")
    of_plan = owned("plan") - {"fidelity"}
    for name, value in (options.given() if given is None else given).items():
        if named and name in of_plan and value is not None:
            allowed = f"none with fidelity = {options.fidelity!r}: it chooses a model, or judges "
            allowed += "errors that verify measures"
            raise SceneError(name, value, "", allowed, "has no effect")
    if options.geometry is not None:
        check_geometry(options.geometry, scene)
    if options.fidelity != "auto":
        engine = ENGINES[options.fidelity]
        engine.check_options(options)
        engine.check(scene)


def _going_on(before: Record, options: Options) -> Options:
    """Return the options of a continued run, with the engine of the record."""
    engine = before.method.engine
    if options.fidelity == "auto":
        options = dataclasses.replace(options, fidelity=engine)
    if engine != options.fidelity:
        raise StateError(
            f"initial: the record is from the {engine} engine, not from {options.fidelity}"
        )
    if ENGINES[engine].steps and not isinstance(before.final_state, State):
        raise StateError("initial: this record holds no state of the dynamics to go on from")
    return options


def _both(before: Record, scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """Return the scene of a run that continues a record with changes, and notes on them."""
    if before.scene == scene:
        return scene, ()
    t = _begin(before)
    found = followed_by(before.scene, scene, t)
    if found is None:
        what = "not only the speed of the driver or the loads differ"
        instead = "pass its final_state"
        if before.final_state is None:
            instead = "this engine continues records only, and its records hold no motion"
        raise StateError(f"initial: the record belongs to another scene ({what}); {instead}")
    whole, said = found
    return whole, tuple(f"goes on from t = {t:.9g} s with {change}" for change in said)


def _run(
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    initial: State | Record | None,
    progress: bool | Callable[[Progress], None] | None,
    enough: Callable[[Counted], bool] | None = None,
) -> Record:
    """Run one engine, until the function `enough` returns True or the run reaches t_end (s)."""
    engine, said = ENGINES[options.fidelity], []
    if engine.name == "dynamic":
        begin = _begin(initial)
        method = engine.settled(scene, options, begin, t_end)
        made = full_work(scene, method.geometry, method.dt, t_end - begin, method.stepper)
        if made * SLOWEST > LONG:
            said = _said(scene, engine.name, made * machine_speed(), progress)
    how: dict[str, Any] = {"initial": initial, "progress": progress, "enough": enough}
    record = engine.run(scene, t_end, options, **how)
    if engine.steps and (last := density_notes(scene)):  # static states do not depend on density
        record = record.replace(notes=(*(n for n in record.notes if n not in last), *last))
    return _with_notes(record, *said)


def _short_steps(asked: Asked, progress: object) -> list[str]:
    """Return and print the note on events that take long because of viscosity; [] if none do.

    The note gives the cost of full dynamics, which is an upper limit for the hybrid engine.
    """
    scene, fidelity, lasts = asked.scene, asked.options.fidelity, asked.t_end - asked.t_begin
    if fidelity not in ("auto", "hybrid") or ENGINES["hybrid"].cannot(scene) or not scene.eta:
        return []
    dt, _ = asked.options.steps_on(scene)
    whole = full_work(scene, "linear", dt, lasts, asked.options.stepper_on(scene))
    if whole * SLOWEST <= LONG or whole * machine_speed() <= LONG:
        return []
    of_waves = step_of_waves(scene)
    if of_waves < SHORT * dt:
        return []
    note = (
        f"{fidelity}: viscosity makes steps {of_waves / dt:.2g} times shorter than waves do, and "
        f"events as many times longer to integrate: up to {whole * machine_speed() / 60:.2g} "
        "minutes on one core; a smaller eta, or fidelity = 'quasistatic', takes less"
    )
    if progress in (None, True) and sys.stderr is not None:
        print(note, file=sys.stderr, flush=True)
    return [note]


def _said(scene: Scene, engine: str, seconds: float, progress: object) -> list[str]:
    """Return and print the note on a run that is expected to take long; [] for short runs."""
    if seconds <= LONG:
        return []
    hint = "larger blocks take less: twice l, about a tenth of the time"
    if engine == "dynamic" and not ENGINES["hybrid"].cannot(scene):
        hint = f"fidelity = 'hybrid' often takes a small part of that; {hint}"
    note = f"{engine}: this run takes about {seconds / 60:.2g} minutes on one core; {hint}"
    if progress in (None, True) and sys.stderr is not None:
        print(note, file=sys.stderr, flush=True)
    return [note]


def _with_notes(record: Record, *notes: str) -> Record:
    new = [note for note in notes if note not in record.notes]
    return record.replace(notes=(*record.notes, *new)) if new else record


def _begin(initial: State | Record | None) -> float:
    """Return the time at which a run begins, in s."""
    if isinstance(initial, Record):
        return float(initial.curve["t"].iloc[-1])
    return 0.0 if initial is None else initial.t


# --- levels --------------------------------------------------------------------------------------


def _budget(asked: Asked, level: Level, before: Record) -> float:
    """Return the largest work of all runs together, in s; multiples refer to one run of a level."""
    budget = asked.options.budget or BUDGET
    times = multiple(budget)
    if times is None:
        return float(budget) / machine_speed()
    scene = asked.scene
    alone = dataclasses.replace(level, stepper=default_stepper(scene), dt=step_size(scene))
    return times * expected_work(scene, alone, asked.t_end - asked.t_begin, before)


class _Slower:
    """Ends a quasi-static sequence that takes more than `STATIC_SHARE` of full dynamics."""

    def __init__(self, asked: Asked) -> None:
        scene, lasts = asked.scene, asked.t_end - asked.t_begin
        full = full_work(scene, "linear", step_size(scene), lasts, default_stepper(scene))
        self.scene, self.limit, self.ended = scene, STATIC_SHARE * full, False

    def __call__(self, run: Any) -> bool:
        self.ended = work(self.scene, "linear", run.counts) > self.limit
        return self.ended


def leveled(asked: Asked, of: tuple[Level, ...], progress: object = None) -> Record:
    """Run levels until two successive levels agree; return the finest run that may be returned.

    With verify = "none" or "shared" one level is run, with "shared" the first level that can run.
    With "full" one more level is run, and then the returned run again with a driver that is faster
    by the share `PERTURBATION`.

    Raises:
        RunError, EquilibriumError: no level could be run to its end.
    """
    options, todo = asked.options, [level for level in of if not level.cannot]
    notes = [f"left out: {level.engine} ({level.cannot})" for level in of if level.cannot]
    if options.verify == "none":
        todo = todo[todo.index(alone(of, options.tolerance)) :]
    with shared_statics():
        return _leveled(asked, todo, notes, progress)


def _leveled(asked: Asked, todo: list[Level], notes: list[str], progress: object) -> Record:
    options, runs = asked.options, []
    agreed, failed, pair = False, None, None
    for asked_level in todo:
        before, lasts = runs[-1].record if runs else None, asked.t_end - asked.t_begin
        level = asked_level
        if options.fidelity == "auto":
            level = as_made(asked.scene, asked_level, lasts, before)
        expected = expected_work(asked.scene, level, lasts, before)
        if len(runs) > 1 and options.verify != "full":
            budget, spent = (
                _budget(asked, level, before),
                sum(work_done(run.record) for run in runs),
            )
            if spent + expected > budget:
                seconds = [f"{w * machine_speed():.2g} s" for w in (expected, spent, budget)]
                notes.append(
                    f"not made: {level}, which would take about {seconds[0]}: {seconds[1]} of "
                    f"{seconds[2]} are spent (option budget)"
                )
                break
        if level.engine == "hybrid":
            notes += _said(asked.scene, "hybrid", expected * machine_speed(), progress)
        start, how = time.perf_counter(), level.options(options)
        slower = None if level.dt else _Slower(asked)
        try:
            record = asked.run(asked.scene, asked.t_end, how, enough=slower)
        except (RunError, EquilibriumError) as error:
            failed = error
            notes.append(f"left out: {level} ({error})")
            continue
        if slower is not None and slower.ended:
            notes.append(f"left out: {level} (events without end: it takes too long)")
            continue
        runs.append(Made(level, record, time.perf_counter() - start))
        if not record.done or options.verify in ("none", "shared") or agreed:
            break
        if len(runs) > 1:
            pair = finest(asked, runs)
            errors = pair.errors()
            agreed = bool(errors.holds)
            enough = errors.measured() is None and not errors.partly  # finer levels do not help
            if enough or (agreed and options.verify != "full"):
                break
    alone_is_enough = options.verify == "none" or not isinstance(failed, RunError)
    if not runs or (len(runs) == 1 and runs[0].record.done and not alone_is_enough):
        if isinstance(failed, RunError):
            failed.record = _with_notes(failed.record, *notes)
        raise failed
    if len(runs) > 1 and (pair is None or pair.fine is not runs[-1]):
        pair = finest(asked, runs)
    return _answer(asked, runs, pair, notes)


def _answer(asked: Asked, runs: list[Made], pair: Pair | None, notes: list[str]) -> Record:
    """Return the finest run that may be returned, with its errors and notes."""
    options = asked.options
    if options.fidelity == "auto":
        levels = ", then ".join(str(made.level) for made in runs)
        notes = [f"for {options.want} within {options.tolerance:g}: {levels}", *notes]
    record = runs[0].record
    if pair is not None:
        errors, more = pair.as_far_as_it_goes()
        if options.verify == "full":
            errors, also = pair.perturbed(errors)
            more += also
        if errors.verdict and (errors.holds is False or (not errors.holds and not errors.until)):
            more.append(errors.verdict)
        seconds = sum(made.seconds for made in runs) - pair.answer.seconds
        record, notes = pair.answer.record, notes + more
        timings = {**record.timings, "verification": seconds}
        record = record.replace(errors=errors, timings=timings).with_late_columns()
    elif options.verify not in ("none", "shared") and record.done:
        notes.append("errors were not measured: no other level could be made")
    return _with_notes(record.with_late_columns(), *notes)


@one_thread_if_small
def simulate_point(
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    first: int = 0,
    count: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Record:
    """Return the run of one scene of a sweep that shares one verification.

    Args:
        scene: the scene.
        t_end: time of the end, in s.
        options: options of all scenes.
        first: number of the first level to run, from 0, among levels that can run.
        count: number of levels to run; None means until two levels agree. With 1 no error is
            measured.
        progress: as in `simulate`.

    Raises:
        SceneError, EquilibriumError, RunError: as `simulate`.
    """
    raise_if_asked()
    check_run(scene, options)
    options = dataclasses.replace(options, verify="shared" if count == 1 else "sample").on(scene)
    run = functools.partial(_run, initial=None, progress=progress)
    asked = Asked(scene=scene, t_begin=0.0, t_end=t_end, options=options, run=run)
    of = levels_of(scene, options)
    last = None if count in (None, 1) else first + count
    able = [level for level in of if not level.cannot][first:last]
    _check_steps(of, asked)
    return leveled(asked, (*(level for level in of if level.cannot), *able), progress)


def released(scene: SceneLike, blocks: int) -> State:
    """Return the loaded state with a number of blocks at the trailing edge released.

    The released blocks start with zero velocity and slip in the drive direction. Their friction has
    already fallen to mu_k. Such a state starts a front in a chain or on a prescribed interface:
    ``simulate(scene, t_end, initial=released(scene, 20), fidelity="dynamic")``.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        blocks: number of released blocks, 1 to N_x.

    Raises:
        SceneError: the number of blocks is out of range, or the friction law has no static states.
    """
    scene = as_scene(scene)
    check_sticks(scene)
    check_whole("blocks", blocks, 1, scene.N_x, note=" = N_x")
    state, first = loaded_state(scene).state(scene, step_size(scene)), scene.n_of_i <= blocks
    state.mode[first] = scene.d
    law = scene.law.static
    slide, d_c = law.tables.slide, np.broadcast_to(law.d_c, first.shape)
    weakened = d_c[first] * (1.0 if slide is None else slide.x[-1])
    state.s_0[first] = weakened - scene.d * state.y[0, 0][first]
    return state
