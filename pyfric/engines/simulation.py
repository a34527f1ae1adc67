"""Runs of any fidelity: one function that chooses, or obeys."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

from pyfric.core import State, StateError
from pyfric.engines import planner, quasistatic
from pyfric.engines.dynamic import Run, RunError, check_options, integrate
from pyfric.engines.hybrid import HybridRun
from pyfric.record import T_GAP, Record
from pyfric.scene import SceneError
from pyfric.statics import EquilibriumError, one_thread_if_small

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from pyfric.core import Switching
    from pyfric.engines.dynamic import Progress, Stepper
    from pyfric.engines.planner import Fidelity, Plan, Want
    from pyfric.scene import Geometry, Scene

__all__ = ["simulate"]

ENGINES: dict[str, type[Run]] = {"dynamic": Run, "hybrid": HybridRun}


@one_thread_if_small
def simulate(
    scene: Scene,
    t_end: float,
    *,
    fidelity: Fidelity | Literal["auto", "equilibrium"] = "auto",
    want: Want = "precursors",
    tolerance: float = 0.01,
    geometry: Geometry | None = None,
    method: Stepper = "rk4",
    switching: Switching | None = None,
    rtol: float | None = None,
    dt: float | Literal["auto"] = "auto",
    initial: State | Record | None = None,
    budget: bool | None = None,
    sample: float | None = None,
    t_gap: float = T_GAP,
    threads: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 60.0,
) -> Record:
    """Simulate a scene from the loaded slider, or from where another run stopped.

    Args:
        scene: what is simulated.
        t_end: time of the end, in s; the last step ends there or just beyond.
        fidelity: "dynamic" integrates everything. "hybrid" integrates events and solves the waiting
            between them. "quasistatic" has no inertia. "equilibrium" is the stuck slider, and ends
            at the first slip. "auto" takes what `pyfric.plan` finds enough
            for `want` within `tolerance`; options below that a level lacks rule it out.
        want: what the run is made for; see `pyfric.plan`.
        tolerance: accepted error; see `pyfric.plan`.
        geometry: "finite" (as in the paper) or "linear"; None leaves it to the plan, or means
            "finite", or "linear" where there is no other (chain, static engines).
        method: the stepper. "rk4": classical RK4, order 4 (the paper's). "verlet": velocity Verlet
            with viscous forces at a predicted velocity, order 2. "symplectic_euler": semi-implicit
            Euler, order 1. "adaptive": RK4 with an estimate of its error, sub-steps inside dt.
            All but "rk4" need full dynamics.
        switching: "step_end": contacts switch at the end of a step (the paper's), which costs an
            order-1 error of their times. "located": they switch inside the step, where v_x,
            mu_s p - |f| or u_z of a block has its root, and the step is finished from there. A
            margin that crosses zero twice in a sub-step is noticed if the parabola through its
            start, middle and end dips below zero. None leaves it to the plan, or means
            "step_end".
        rtol: for method "adaptive": largest error of a sub-step, in displacements over F_N/(N_x s),
            in velocities over F_N/(N_x sqrt(s m)), s the largest of k, k_f and k_top; None means
            1e-6.
        dt: time step in s, or "auto" (see `step_size`; with a plan, its step).
        initial: None starts at t = 0 from the loaded state with F_T = 0. A `State` starts there. A
            `Record` of the same scene goes on where it stopped, and the result holds the whole run.
            Its engine, geometry, method, switching, step, rtol, budget, sampling and t_gap are
            kept, and those arguments are not used. Full dynamics goes on with the same bits; the
            hybrid engine finds the same events, at forces that agree to 1e-10 F_N in linear
            geometry and to 1e-6 in finite geometry.
        budget: keep the energy budget (adds its columns to the curve); full dynamics only. None
            means yes for fidelity = "dynamic".
        sample: time between two points of the loading curve, in s; None means 5000 points.
        t_gap: longest pause inside an event, in s.
        threads: most threads to use, None for all; small lattices use one.
        progress: True for a bar on stderr, a function that is called about ten times per second,
            False for nothing; None shows the bar where stderr is a terminal.
        checkpoint: file to which the run so far is saved as a record every `checkpoint_every` s.

    Returns:
        The record. Its status is "interrupted" if Ctrl-C stopped the run: what was done is
        complete, and `initial=record` goes on. Its `notes` say where a run with fidelity = "auto"
        had to move up one level, and why.

    Raises:
        SceneError: an argument is refused; nothing has been done.
        StateError: `initial` does not belong to the scene or the engine.
        EquilibriumError: the scene has no loaded state.
        RunError: the motion left the range of numbers, or contacts switched without end inside a
            step; its `record` holds the run before that.

    Source: PRL 107, 074301 (2011).
    """
    known = ("auto", *ENGINES, *quasistatic.ENGINES)
    if not (isinstance(fidelity, str) and fidelity in known):
        raise SceneError("fidelity", fidelity, "", " or ".join(map(repr, known)))
    tolerance = planner.check_question(want, tolerance)
    if isinstance(initial, Record) and initial.method.stepper:
        method, rtol = initial.method.stepper, initial.method.rtol
    check_options(
        scene, geometry, method, switching, rtol, budget, sample, threads, checkpoint_every
    )
    if not isinstance(initial, State | Record | None):
        raise StateError(f"initial: expected a State or a Record, not {type(initial).__name__}")
    stepped = {
        "geometry": geometry,
        "method": method,
        "switching": switching,
        "rtol": rtol,
        "dt": dt,
        "budget": budget,
        "sample": sample,
        "threads": threads,
        "checkpoint": checkpoint,
        "checkpoint_every": checkpoint_every,
    }
    common = {"initial": initial, "t_gap": t_gap, "progress": progress}
    if fidelity == "auto" and isinstance(initial, Record):
        fidelity = initial.method.engine
        if fidelity not in known:
            raise StateError(f"initial: a record of the {fidelity} engine does not go on")
    if fidelity != "auto":
        return _run(fidelity, scene, t_end, stepped, common)
    chosen = planner.plan(scene, want, tolerance, t_end=t_end)
    chosen = _with_options(chosen, scene, stepped, initial)
    return _planned(chosen, scene, t_end, stepped, common)


def _run(fidelity: str, scene: Scene, t_end: float, stepped: dict, common: dict) -> Record:
    if fidelity in ENGINES:
        return integrate(ENGINES[fidelity], scene, t_end, **stepped, **common)
    for name, without in (
        ("geometry", (None, "linear")),
        ("method", ("rk4",)),
        ("switching", (None, "step_end")),
        ("dt", ("auto",)),
        ("budget", (None, 0)),
    ):
        if stepped[name] not in without:
            allowed = f"nothing, because the {fidelity} engine is linear and makes no steps"
            raise SceneError(name, stepped[name], "s" if name == "dt" else "", allowed)
    return quasistatic.simulate(fidelity, scene, t_end, **common)


def _with_options(chosen: Plan, scene: Scene, stepped: dict, initial: State | None) -> Plan:
    """Return the plan at the level that has all the options that were given."""
    if chosen.fidelity == "quasistatic" and (
        initial is not None
        or stepped["budget"]
        or stepped["dt"] != "auto"
        or stepped["geometry"] == "finite"
        or stepped["method"] != "rk4"
        or stepped["switching"] == "located"
    ):
        chosen = chosen.up(scene, [])
    if stepped["budget"] or stepped["method"] != "rk4":
        chosen = dataclasses.replace(chosen, fidelity="dynamic")
    if stepped["geometry"] is not None:
        chosen = dataclasses.replace(chosen, geometry=stepped["geometry"])
    return chosen


def _planned(chosen: Plan, scene: Scene, t_end: float, stepped: dict, common: dict) -> Record:
    """Run a plan; where an assumption turns out wrong, move up one level and say so."""
    not_less = f"; not less: {'; '.join(chosen.reasons)}" if chosen.reasons else ""
    notes = [
        f"planned for {chosen.want} within {chosen.tolerance:g}: {chosen.fidelity}, "
        f"{chosen.geometry} geometry{not_less}"
    ]
    while True:
        options = dict(stepped)
        if chosen.fidelity == "quasistatic":
            options |= {"geometry": None, "dt": "auto", "budget": None, "switching": None}
        else:
            options["geometry"] = chosen.geometry
            if options["dt"] == "auto" and options["method"] == "rk4":
                options["dt"] = chosen.dt
            if options["switching"] is None:
                options["switching"] = chosen.switching
        try:
            record, higher = _run(chosen.fidelity, scene, t_end, options, common), None
            failed = chosen.check(record) if record.status == "complete" else []
            reasons = [str(one) for one in failed]
            if failed:
                higher = chosen.up(scene, failed)
        except EquilibriumError as error:
            if chosen.fidelity != "quasistatic":
                raise
            higher, reasons = chosen.up(scene, []), [str(error)]
        except RunError as error:
            error.record = dataclasses.replace(error.record, notes=(*error.record.notes, *notes))
            raise
        if higher is not None and stepped["geometry"] not in (None, higher.geometry):
            higher = None
        if higher is None:
            notes += [f"does not hold: {reason}" for reason in reasons]
            return dataclasses.replace(record, notes=(*record.notes, *notes))
        before, chosen = chosen, higher
        notes.append(
            f"moved up from {before.fidelity}, {before.geometry} geometry, to {chosen.fidelity}, "
            f"{chosen.geometry} geometry: {'; '.join(reasons)}"
        )
