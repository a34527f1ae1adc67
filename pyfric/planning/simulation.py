"""`simulate`: a run with the engine that the user names or the plan chooses."""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import State, StateError
from pyfric.engines import (
    ENGINES,
    POINTS,
    RUN,
    SLOWEST,
    Options,
    Run,
    RunError,
    check_kept,
    ended_by_condition,
    full_work,
    kept,
    machine_speed,
    owned,
    step_size,
    work,
)
from pyfric.planning.choice import choose
from pyfric.planning.pilot import counted, expected_end, pilot_run, quasistatic_work
from pyfric.planning.price import CHEAP, price
from pyfric.planning.verification import Specification, verified
from pyfric.record import Record
from pyfric.scene import (
    SceneError,
    as_scene,
    check_geometry,
    check_number,
    check_whole,
    check_writable,
    default_geometry,
    followed_by,
    naming,
)
from pyfric.signals import at_once, forget, nothing_to_save, raise_if_asked
from pyfric.statics import (
    EquilibriumError,
    check_sticks,
    loaded_state,
    one_thread_if_small,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Unpack

    from pyfric.display import Progress
    from pyfric.engines import Keywords
    from pyfric.planning.choice import Plan
    from pyfric.scene import Number, Scene, SceneLike

LONG = 600.0
"""Expected duration above which a run prints a note before it starts, in s."""


@one_thread_if_small
def simulate(
    scene: SceneLike,
    t_end: Number,
    options: Options | None = None,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **keywords: Unpack[Keywords],
) -> Record:
    """Simulate a scene from the loaded slider, or continue another run.

    A `Record` as `initial` continues its run, and the result holds the whole run. Engine, geometry,
    stepper, switching, step, rtol, accuracy, energies, sampling and t_gap are kept; other values of
    these options are refused. So are `want`, `tolerance` and `verify`: no model is chosen, and no
    errors are measured. The speed of the driver or the loads may differ from then on; the scene of
    the result then has a protocol that joins both. The driver continues from its position, so that
    F_T does not jump. Times of protocols count from t = 0. Full dynamics continues with the same
    bits. The hybrid engine finds the same events, with forces that agree to its accuracy.

    Ctrl-C ends a run with status "interrupted". The record is then valid, and `initial=record`
    continues the run. The next call of `simulate`, `plan`, `run_all` or `prediction_curve` in the
    same script or cell raises KeyboardInterrupt, so that loops end. Before the first step, Ctrl-C
    raises KeyboardInterrupt at once.

    Full dynamics and planned runs that are expected to take more than ten minutes carry a note. It
    is also printed on stderr before the start, unless progress is False or a function.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file.
        t_end: time of the end, in s; the last step ends there or just beyond.
        options: options of the run; None means `Options()`.
        initial: None starts at t = 0 from the loaded state with F_T = 0. A `State` starts from that
            state, also with another scene; if K or the driven blocks differ, F_T is kept. A
            `Record` continues its run.
        progress: True for a bar on stderr, False for none, or a function that is called about ten
            times per second. None shows the bar if stderr is a terminal.
        **keywords: single options, in place of those in `options`; see `Options`.

    Returns:
        The record. Its status begins with "ended" if an engine could not continue to t_end, as in
        "ended at first slip", or if a condition ended the run, as in "ended by stop_when
        (arrested)". Its `notes` say where that was. With fidelity = "auto" they also say which
        model was chosen, and why another model replaced it.

    Raises:
        SceneError: an argument is refused, or the run needs more memory than is available. No run
            has started.
        StateError: `initial` does not belong to the scene or the engine.
        EquilibriumError: the scene has no loaded state.
        OSError: `checkpoint` cannot be written. No run has started.
        RunError: the motion left the range of the model, or contacts switched without end inside a
            step. Its `record` holds the run before that.

    Source: PRL 107, 074301 (2011).
    """
    if isinstance(initial, Record) and initial.status == "interrupted":
        forget()
    raise_if_asked()
    if not isinstance(initial, State | Record | None):
        raise StateError(f"initial: expected a State or a Record, not {type(initial).__name__}")
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if not isinstance(options, Options | None):
        raise SceneError("options", options, "", "Options or None")
    given = {**(options or Options()).given(), **keywords}
    if isinstance(initial, Record):
        engine = initial.method.engine
        if engine not in ENGINES:
            raise StateError(f"initial: a record of the {engine} engine cannot be continued")
        keywords = {**keywords, **kept(initial.method)}
    options = dataclasses.replace(options or Options(), **keywords).on(scene)
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
    made = Specification(
        scene=scene, t_begin=_begin(initial), t_end=t_end, options=options, run=run
    )
    if options.fidelity == "auto":
        return _planned(made, initial, progress)
    record = _with_notes(run(scene, t_end, options), *notes)
    if options.verify in (None, "none") or not record.done:
        return record
    return verified(record, _until(made, record))


def check_run(scene: Scene, options: Options, given: Mapping[str, Any] | None = None) -> None:
    """Raise SceneError if the named engine cannot have a scene or an option.

    `given` are the options that a user named; None: those that differ from their defaults.
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
    """Return the options with the engine of a record that is continued."""
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
    """Return the scene of a record that continues as another scene, and notes on the changes."""
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
    enough: Callable[[Run], bool] | None = None,
) -> Record:
    """Run one engine. `enough` can end the run of an engine with time steps."""
    engine, said = ENGINES[options.fidelity], []
    if engine.name == "dynamic":
        begin = _begin(initial)
        method = options.settled(scene, engine, begin, t_end)
        made = full_work(scene, method.geometry, method.dt, t_end - begin, method.stepper)
        if made * SLOWEST > LONG:
            said = _said(scene, engine.name, made * machine_speed(), progress)
    how: dict[str, Any] = {"initial": initial, "progress": progress, "enough": enough}
    return _with_notes(engine.run(scene, t_end, options, **how), *said)


def _said(scene: Scene, engine: str, seconds: float, progress: object) -> list[str]:
    """Return the note on a run that is expected to take long, and print it; none if it is not."""
    if seconds <= LONG:
        return []
    hint = "larger blocks take less: twice l, about a tenth of the time"
    if engine == "dynamic" and scene.law.rests and not scene.prescribed:
        hint = f"fidelity = 'hybrid' often takes a small part of that; {hint}"
    note = f"{engine}: this run takes about {seconds / 60:.2g} minutes on one core; {hint}"
    if progress in (None, True) and sys.stderr is not None:
        print(note, file=sys.stderr, flush=True)
    return [note]


def _with_notes(record: Record, *notes: str) -> Record:
    new = [note for note in notes if note not in record.notes]
    return dataclasses.replace(record, notes=(*record.notes, *new)) if new else record


def _begin(initial: State | Record | None) -> float:
    """Return the time at which a run begins, in s."""
    if isinstance(initial, Record):
        return float(initial.curve["t"].iloc[-1])
    return 0.0 if initial is None else initial.t


def _planned(made: Specification, initial: State | None, progress: object) -> Record:
    """Run the chosen model and measure its errors; if a quasi-static run fails, run dynamics."""
    options, scene, notes, failed = made.options, made.scene, [], ""
    while True:
        with at_once():
            ladder = initial is None and not failed
            plan = choose(scene, options, made.t_end, t_begin=made.t_begin, ladder=ladder)
        notes.append((failed and f"quasistatic was not enough: {failed}; ") + _chosen(plan))
        level = dataclasses.replace(
            options,
            energies=bool(options.energies),
            fidelity=plan.fidelity,
            geometry=plan.geometry,
            dt=plan.dt or "auto",
            accuracy=plan.accuracy,
            switching=options.switching or plan.switching,
        )
        if plan.fidelity == "hybrid":
            notes += _said(scene, "hybrid", plan.seconds + plan.price, progress)
        try:
            record = made.run(scene, made.t_end, level)
        except RunError as error:
            error.record = _with_notes(error.record, *notes)
            raise
        except EquilibriumError as error:
            if plan.fidelity != "quasistatic":
                raise
            failed = str(error)
        else:
            failed = "; ".join(map(str, plan.check(record))) if record.done else ""
            if record.done and not failed and options.verify != "none":
                record = verified(record, _as_planned(_until(made, record), plan, level))
                if record is None:
                    failed = "errors measured by dynamics exceed the tolerance"
            if not failed:
                return _with_notes(record, *notes)
        nothing_to_save()


def _chosen(plan: Plan) -> str:
    """Return a note on the chosen model and the rejected ones."""
    rejected = f"; rejected: {'; '.join(plan.reasons)}" if plan.reasons else ""
    return (
        f"planned for {plan.want} within {plan.tolerance:g}: {plan.fidelity}, "
        f"{plan.geometry} geometry{rejected}"
    )


def _until(made: Specification, record: Record) -> Specification:
    """Return the specification of a run, up to the time at which a condition ended it."""
    t = min(made.t_end, _begin(record)) if ended_by_condition(record) else made.t_end
    return dataclasses.replace(made, t_end=t)


def _as_planned(made: Specification, plan: Plan, level: Options) -> Specification:
    """Return the specification of a planned run; options given by the user stay fixed.

    For cheap full dynamics `whole` is inf: `plan` announces what the run takes when it is made.
    """
    asked = made.options
    free = asked.dt == "auto" and asked.stepper == "rk4"
    speed = plan.seconds / plan.work
    whole = plan.work + plan.price / speed
    if plan.fidelity == "dynamic" and plan.work <= CHEAP:
        whole = math.inf
    promise = {"expected": plan.error, "work": plan.work, "whole": whole, "refines": free}
    promise["refinement"] = plan.refinement / speed
    return dataclasses.replace(made, options=level, geometry=asked.geometry, **promise)


def expected_cost(scene: Scene, t_end: float, how: Options) -> tuple[float, float]:
    """Return the expected time of a run to t_end (s) in s, and the size of its record in bytes.

    The time includes verification, but no refinement. A run that would be refused costs nothing.
    """
    how = how.on(scene)
    if how.fidelity == "auto":
        try:
            found = choose(scene, how, t_end)
        except SceneError:
            return 0.0, 0.0
        return found.seconds + found.price, _size(scene, t_end)
    geometry = how.geometry or default_geometry(scene)
    t_end = expected_end(scene, t_end, how.stop_when)
    dt, switching = how.steps_on(scene)
    made, counts = full_work(scene, geometry, dt, t_end, how.stepper, how.calls_on(scene)), None
    if how.fidelity in ("quasistatic", "equilibrium"):
        made = quasistatic_work(scene, pilot_run(scene, t_end))
    elif how.fidelity == "hybrid" and made > CHEAP:
        made_of = {"geometry": geometry, "dt": dt, "switching": switching, "method": None}
        resolved = dataclasses.replace(how, **made_of)
        counts = counted(scene, t_end, resolved, pilot_run(scene, t_end))
        made = RUN + work(scene, geometry, counts)
    if how.verify is not None:
        made += price(scene, how, how.fidelity, geometry, dt, t_end, made, counts)[0]
    return made * machine_speed(), _size(scene, t_end)


def _size(scene: Scene, t_end: float) -> float:
    """Return the size of a record, in bytes."""
    if not (scene.has_rests and scene.law.rests):
        return 1e5
    return 1e5 + 8.0 * pilot_run(scene, t_end).events * (9 * scene.N_x + 40)


def released(scene: SceneLike, blocks: int) -> State:
    """Return the loaded state with the first blocks from the trailing edge released.

    The released blocks start with zero velocity and slip in the drive direction. Their friction has
    already fallen to mu_k. This starts a front in a chain or on a prescribed interface:
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
    slide, d_c = scene.law.tables.slide, np.broadcast_to(scene.law.d_c, first.shape)
    weakened = d_c[first] * (1.0 if slide is None else slide.x[-1])
    state.s_0[first] = weakened - scene.d * state.y[0, 0][first]
    return state
