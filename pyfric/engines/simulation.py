"""Runs of any fidelity: one function that chooses, or obeys."""

from __future__ import annotations

import dataclasses
import functools
import sys
from typing import TYPE_CHECKING, Any

from pyfric.core import State, StateError
from pyfric.engines import planner, quasistatic
from pyfric.engines.cost import check_memory
from pyfric.engines.dynamic import Run, RunError
from pyfric.engines.hybrid import HybridRun
from pyfric.engines.integration import integrate
from pyfric.engines.options import ACCURACY, CURVE_POINTS, Options, kept
from pyfric.engines.pauses import pause_notes
from pyfric.engines.stretches import check_straight
from pyfric.engines.verification import FURTHER, TIGHTER, Made, verified
from pyfric.record import Record
from pyfric.scene import SceneError, check_geometry, check_number, check_writable
from pyfric.signals import forget, nothing_to_save, raise_if_asked
from pyfric.statics import EquilibriumError, one_thread_if_small

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.engines.planner import Plan
    from pyfric.engines.progress import Progress
    from pyfric.scene import Scene, SceneLike

__all__ = ["simulate"]

ENGINES: dict[str, type[Run]] = {"dynamic": Run, "hybrid": HybridRun}
"""The engines with time steps."""


@one_thread_if_small
def simulate(
    scene: SceneLike,
    t_end: float,
    options: Options | None = None,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **keywords: Any,
) -> Record:
    """Simulate a scene from the loaded slider, or from where another run stopped.

    Args:
        scene: what is simulated: a scene, the name of a preset, or the path of a scene file.
        t_end: time of the end, in s; the last step ends there or just beyond.
        options: how; None means `Options()`.
        initial: None starts at t = 0 from the loaded state with F_T = 0. A `State` starts there. A
            `Record` of the same scene goes on where it stopped, and the result holds the whole run.
            Its engine, geometry, stepper, switching, step, rtol, budget, sampling and t_gap are
            kept, and those options are not used. Full dynamics goes on with the same bits; the
            hybrid engine finds the same events, at forces that agree to 1e-10 F_N in linear
            geometry and to 1e-6 in finite geometry.
        progress: True for a bar on stderr, a function that is called about ten times per second,
            False for nothing; None shows the bar where stderr is a terminal.
        **keywords: single options, in place of those in `options`: fidelity, method, want,
            tolerance, geometry, stepper, switching, rtol, dt, budget, sample, t_gap, threads,
            checkpoint, checkpoint_every; see `Options`.

    Returns:
        The record. Its status is "interrupted" if Ctrl-C stopped the run: what was done is
        complete, and `initial=record` goes on. The next call of `simulate`, `plan`, `run_all` or
        `prediction_curve` in the same script or cell raises KeyboardInterrupt instead, which ends
        loops. Before the first step, Ctrl-C raises KeyboardInterrupt at once. The status begins
        with "ended" where an engine had no way on before t_end, as in "ended at first slip". Its
        `notes` say where that was, and where a run with fidelity = "auto" had to move up one level,
        and why. A run expected to take more than ten minutes says so, and what takes less: on
        stderr before the start, unless progress is False or a function, and in its notes.

    Raises:
        SceneError: an argument is refused, or the run needs more memory than there is; nothing has
            been done.
        StateError: `initial` does not belong to the scene or the engine.
        EquilibriumError: the scene has no loaded state.
        OSError: `checkpoint` cannot be written; nothing has been done.
        RunError: the motion left the range of numbers, or contacts switched without end inside a
            step; its `record` holds the run before that.

    Source: PRL 107, 074301 (2011).
    """
    if isinstance(initial, Record) and initial.status == "interrupted":
        forget()
    raise_if_asked()
    if not isinstance(initial, State | Record | None):
        raise StateError(f"initial: expected a State or a Record, not {type(initial).__name__}")
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if isinstance(initial, Record):
        keywords |= kept(initial.method)
    if not isinstance(options, Options | None):
        raise SceneError("options", options, "", "Options or None")
    options = (options or Options()).changed(keywords)
    if isinstance(initial, Record):
        options = _going_on(initial, scene, options)
    else:
        options.check_sample(t_end - (0.0 if initial is None else initial.t))
    if options.method is not None and options.fidelity == "auto":
        options = dataclasses.replace(options, fidelity="dynamic")
    if options.geometry is not None:
        check_geometry(options.geometry, scene)
    if options.checkpoint is not None:
        numbers = 4 * scene.N_x * scene.N_z + 2 * CURVE_POINTS
        check_writable(options.checkpoint, 8 * numbers)
    run = functools.partial(_run, initial=initial, progress=progress)
    made = Made(scene=scene, t_begin=_begin(initial), t_end=t_end, options=options, run=run)
    if options.fidelity != "auto":
        record = run(scene, t_end, options)
        if options.verify in (None, "none") or not record.done or isinstance(initial, Record):
            return record
        return verified(record, options.verify, made)
    chosen = planner.plan(scene, options.want, options.tolerance, t_end=t_end)
    return _planned(_with_options(chosen, scene, options, initial), made)


def _going_on(before: Record, scene: Scene, options: Options) -> Options:
    """Return the options with the engine of a record that goes on."""
    engine = before.method.engine
    if engine not in (*ENGINES, *quasistatic.ENGINES):
        raise StateError(f"initial: a record of the {engine} engine does not go on")
    if options.fidelity == "auto":
        options = dataclasses.replace(options, fidelity=engine)
    _check_continues(before, scene, options.fidelity)
    return options


def _check_continues(before: Record, scene: Scene, engine: str) -> None:
    """Raise StateError unless an engine can go on from this record."""
    made = before.method.engine
    if made != engine:
        raise StateError(f"initial: the record comes from the {made} engine, this is {engine}")
    if before.scene != scene:
        raise StateError("initial: the record belongs to another scene; pass its final_state")
    if engine in ("dynamic", "hybrid") and not isinstance(before.final_state, State):
        raise StateError("initial: this record holds no state of the dynamics to go on from")


def _run(
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    initial: State | Record | None,
    progress: bool | Callable[[Progress], None] | None,
    tight: int = 0,
) -> Record:
    """Run one engine, with jumps that are `tighter` where it is to measure errors of another."""
    how: dict[str, Any] = {"initial": initial, "progress": progress}
    if options.fidelity in ENGINES:
        begin = _begin(initial)
        method = options.settled(scene, ENGINES[options.fidelity], begin, t_end)
        check_memory(scene, method.engine, method.geometry)
        how_made = method.engine, method.geometry, method.dt
        note = planner.long_note(scene, t_end - begin, *how_made)
        if note and progress in (None, True) and sys.stderr is not None:
            print(note, file=sys.stderr, flush=True)
        if tight and options.fidelity == "hybrid":
            accuracy = max((options.accuracy or ACCURACY) * TIGHTER * FURTHER ** (tight - 1), 1e-9)
            options = dataclasses.replace(options, accuracy=accuracy)
        record = integrate(ENGINES[options.fidelity], scene, t_end, options, **how)
        return _with_notes(record, *pause_notes(record), *([note] if note else []))
    options.check_static()
    check_straight(scene)
    check_memory(scene, options.fidelity, "linear")
    record = quasistatic.simulate(options.fidelity, scene, t_end, t_gap=options.t_gap, **how)
    return _with_notes(record, *pause_notes(record))


def _with_notes(record: Record, *notes: str) -> Record:
    return dataclasses.replace(record, notes=(*record.notes, *notes)) if notes else record


def _begin(initial: State | Record | None) -> float:
    """Return the time at which a run begins, in s."""
    if isinstance(initial, Record):
        return float(initial.curve["t"].iloc[-1])
    return 0.0 if initial is None else initial.t


def _with_options(chosen: Plan, scene: Scene, options: Options, initial: State | None) -> Plan:
    """Return the plan at the level that has all the options that were given."""
    stepped = options.budget or options.stepper != "rk4"
    if chosen.fidelity == "quasistatic" and (
        initial is not None
        or stepped
        or options.dt != "auto"
        or options.geometry == "finite"
        or options.switching is not None
    ):
        chosen = chosen.up(scene, [])
    if stepped:
        chosen = dataclasses.replace(chosen, fidelity="dynamic")
    if options.geometry is not None:
        chosen = dataclasses.replace(chosen, geometry=options.geometry)
    return chosen


def _at_level(options: Options, chosen: Plan) -> Options:
    """Return the options with what the plan says where they leave it open."""
    if chosen.fidelity == "quasistatic":
        free = {"geometry": None, "dt": "auto", "budget": None, "switching": None}
        return dataclasses.replace(options, fidelity=chosen.fidelity, **free)
    step = chosen.dt if options.dt == "auto" and options.stepper == "rk4" else options.dt
    return dataclasses.replace(
        options,
        fidelity=chosen.fidelity,
        geometry=chosen.geometry,
        dt=step,
        switching=options.switching or chosen.switching,
    )


def _planned(chosen: Plan, made: Made) -> Record:
    """Run a plan and measure its errors; where an assumption turns out wrong, move up one level."""
    options, scene = made.options, made.scene
    not_less = f"; not less: {'; '.join(chosen.reasons)}" if chosen.reasons else ""
    notes = [
        f"planned for {chosen.want} within {chosen.tolerance:g}: {chosen.fidelity}, "
        f"{chosen.geometry} geometry{not_less}"
    ]
    while True:
        level, record, reasons = _at_level(options, chosen), None, []
        try:
            record = made.run(scene, made.t_end, level)
            failed = chosen.check(record) if record.done else []
            reasons, higher = [str(one) for one in failed], None
            if failed:
                higher = chosen.up(scene, failed)
        except EquilibriumError as error:
            if chosen.fidelity != "quasistatic":
                raise
            higher, reasons = chosen.up(scene, []), [str(error)]
        except RunError as error:
            error.record = _with_notes(error.record, *notes)
            raise
        if higher is not None and options.geometry not in (None, higher.geometry):
            higher = None
        if higher is None and record.done and options.verify != "none":
            found = verified(record, options.verify, _as_planned(made, chosen, level))
            if found is None:
                reasons, higher = ["errors measured by dynamics exceed the tolerance"], None
                higher = chosen.up(scene, [])
            else:
                record = found
        if higher is None:
            notes += [f"does not hold: {reason}" for reason in reasons]
            return _with_notes(record, *notes)
        nothing_to_save()
        before, chosen = chosen, higher
        notes.append(
            f"moved up from {before.fidelity}, {before.geometry} geometry, to {chosen.fidelity}, "
            f"{chosen.geometry} geometry: {'; '.join(reasons)}"
        )


def _as_planned(made: Made, chosen: Plan, level: Options) -> Made:
    """Return how a level of a plan was made; what users settled stays."""
    asked = made.options
    free = asked.dt == "auto" and asked.stepper == "rk4"
    promise = {"expected": chosen.error, "refines": free}
    return dataclasses.replace(made, options=level, geometry=asked.geometry, **promise)
