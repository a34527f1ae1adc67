"""A run of an engine with time steps, from the loaded state to the record."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from pyfric.display import Progress, run_bar
from pyfric.engines.guard import folded, largest_strain
from pyfric.engines.stopping import stopping_of
from pyfric.engines.stretches import ON_GRID, last_step
from pyfric.record import Record
from pyfric.scene import SceneError, check_number
from pyfric.signals import answered
from pyfric.statics import EquilibriumError, StaticSolver, check_pushes, one_thread

if TYPE_CHECKING:
    from pyfric.core import State
    from pyfric.engines.dynamic import Run
    from pyfric.engines.options import Options
    from pyfric.scene import Geometry, OnDriven, Scene

FOLDING = 0.2
"""Strain of bonds above which F_N is reported as too large if no loaded state is found."""


def integrate(
    engine: type[Run],
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    enough: Callable[[Run], bool] | None = None,
) -> Record:
    """Integrate a scene with an engine that makes time steps; see `pyfric.simulate`.

    The run ends with status "interrupted" as soon as `enough` returns true.
    """
    before = initial if isinstance(initial, Record) else None
    if before is not None:
        initial = before.final_state
    if initial is not None:
        initial = initial if before is not None else initial.under(scene)
        initial.check_physics(scene)
    t_begin = 0.0 if initial is None else initial.t
    t_end = check_number("t_end", t_end, "s", ge=t_begin)
    method = options.settled(scene, engine, t_begin, t_end)

    # One BLAS thread from here on: banded matrices and small products get slower with more.
    with run_bar(progress, scene.name, t_begin, t_end) as show, one_thread():
        start = time.perf_counter()
        solver = _loaded(scene, method.geometry, None if initial is None else initial.u_drv0)
        dt = method.dt
        state = solver.loaded.state(scene, dt) if initial is None else initial.with_dt(dt)
        stopping = stopping_of(options.stop_when, scene, method.t_gap, before, t_end)
        if stopping is not None and before is None:
            stopping.begin(state)
        run = engine(scene, method, solver, state, before, stopping)
        run.timings["set-up"] = time.perf_counter() - start
        last = _last(scene, state, t_end)
        with answered() as stop:
            run.advance(last, lambda: stop() or (enough is not None and enough(run)), show, options)
            done = "complete" if run.state.step >= last else "interrupted"
            return run.record(run.ending or done, late=enough is None)


def _last(scene: Scene, state: State, t_end: float) -> int:
    """Return the number of the last step. Each breakpoint of a protocol starts a new time grid."""
    t0 = state.t0
    for corner in scene.corners:
        if state.t + ON_GRID * state.dt < corner < t_end:
            t0 = corner - last_step(t0, state.dt, corner) * state.dt
    return math.ceil((t_end - t0) / state.dt * (1 - 1e-14))


def _loaded(scene: Scene, geometry: Geometry, u_drv0: OnDriven | None) -> StaticSolver:
    """Return the static solver with the loaded slider.

    Raises:
        SceneError: the load folds the lattice (finite geometry), or pushes are refused.
        EquilibriumError: no loaded state was found, for any other reason.
    """
    strain, pushed = largest_strain(scene, 0.0, 0.0), scene
    scene = scene.replace({"top.push": ()}) if scene.top.push else scene
    allowed = (
        "a force that compresses bonds by less than their length, far below k l N_x = "
        f"{scene.slider.k * scene.slider.l * scene.N_x:.3g} N"
    )
    try:
        solver = StaticSolver(scene, geometry, u_drv0=u_drv0)
    except EquilibriumError as error:
        if geometry == "linear" or strain < FOLDING:
            raise
        raise SceneError("top.F_N", scene.F_N, "N", allowed, str(error)) from error
    at = folded(scene, solver.loaded.u) if geometry == "finite" else None
    if at is not None:
        reason = f"it folds the lattice at the block in column {at[0] + 1}, row {at[1] + 1}"
        raise SceneError("top.F_N", scene.F_N, "N", allowed, reason)
    if u_drv0 is None:
        check_pushes(pushed, solver)
    return solver
