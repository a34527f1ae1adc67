"""One event run again with full dynamics, for data that the record does not hold."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from pyfric import core
from pyfric.core import State
from pyfric.engines import ENGINES
from pyfric.figures.style import single
from pyfric.planning import simulate
from pyfric.record import Record
from pyfric.values import SceneError

LEAD = 20
"""Number of steps before an event at which the run with full dynamics begins."""


def again(
    record: Record,
    event: int,
    times: Iterable[float],
    initial: State | None = None,
    dt: float | None = None,
) -> Iterator[tuple[Any, State]]:
    """Yield the core's model, and its state after the first step that reaches each time.

    The event is run again from a state shortly before it. A run of the hybrid engine gives the
    state. On junctions and on a prescribed interface, full dynamics gives the state and takes as
    long as the original run.

    Args:
        record: a run of the hybrid or the dynamic engine; its geometry and stepper are kept.
        event: number of the event, from 1. Record and event have passed `check_event`.
        times: times of the wanted states, rising, s.
        initial: the state from which the run began; None for the loaded slider.
        dt: step from the first of `times` on, s; None for the step of the run.

    Raises:
        SceneError: the hybrid engine lacks the stepper; or the run began from another state, as
            other events before the event, or a missing event, show.
    """
    scene, method = record.scene, record.method
    first = 0.0 if initial is None else initial.t
    if record.curve["t"].iloc[0] != first:
        raise another_start()
    t_start, lead = record.events["t_start"].loc[event], LEAD * method.dt
    begin = max(first, t_start - lead)
    steps = {"stepper": method.stepper, "switching": method.switching}
    if method.rtol is not None:
        steps["rtol"] = method.rtol
    how: dict[str, Any] = {"geometry": method.geometry, "dt": method.dt, "progress": False}
    engine = "dynamic" if ENGINES["hybrid"].cannot(scene) else "hybrid"
    if engine == method.engine == "hybrid":
        how["accuracy"] = method.accuracy
    made = simulate(scene, begin, fidelity=engine, initial=initial, **how, **steps)
    state: State = made.final_state
    before = record.events["t_start"] <= begin
    same = np.array_equal(record.final_state.u_drv0, state.u_drv0)
    if not same or len(made.events) != before.sum():
        raise another_start()
    model, log = core.model(scene, method.geometry, state.u_drv0), core.Log(scene.N_x)
    slipped = bool(np.isin(state.mode, (1, -1)).any())
    steps["threads"] = core.useful_threads(scene.N_x * scene.N_z)
    for t in times:
        last = math.ceil((t - state.t0) / state.dt * (1 - 1e-14))
        while state.step < last:
            core.advance(model, state, log, last - state.step, budget=False, **steps)
            slipped |= bool(log.switches()["block"].size)
        if dt is not None:
            state, dt = state.with_dt(dt), None
        yield model, state
    if state.t > t_start + lead and not slipped:
        raise another_start()


def another_start() -> SceneError:
    """Return the error for a run that began from another state."""
    allowed = "a run from the loaded slider at t = 0, or the state that it began from, as initial"
    return SceneError("record", "a run from another state", "", allowed)


def check_event(record: Record, event: int) -> None:
    """Raise SceneError if the record has no event of this number, or no motion."""
    single(record)
    if record.method.engine not in ("hybrid", "dynamic"):
        allowed = "a run of the hybrid or the dynamic engine"
        raise SceneError("record", record.method.engine, "", allowed, "it has no motion")
    record.row(event)
