"""One event run again with full dynamics, to look at what the record does not hold."""

from __future__ import annotations

import math

import numpy as np

from pyfric import core
from pyfric.core import State
from pyfric.figures.style import single
from pyfric.planning import simulate
from pyfric.record import Record
from pyfric.scene import SceneError

LEAD = 20
"""Steps between the state that a run up to it gives and the event."""


class Again:
    """An event run again, from a state shortly before it, which the hybrid engine gives.

    On junctions and on a prescribed interface full dynamics gives it, which takes as long as the
    run up to there did.

    Attributes:
        model, state: of the core; the state changes with `to`.
    """

    def __init__(self, record: Record, event: int, initial: State | None = None) -> None:
        """Find the state before the event.

        Args:
            record: a run of the hybrid or the dynamic engine; its geometry and stepper are kept.
            event: its number, from 1; both passed `check_event`.
            initial: the state that the run began from; None for the loaded slider.

        Raises:
            SceneError: a stepper that the hybrid engine lacks, or a run that began from another
                state.
        """
        scene, method = record.scene, record.method
        first = 0.0 if initial is None else initial.t
        if record.curve["t"].iloc[0] != first:
            raise another_start()
        t_start, lead = record.events["t_start"].loc[event], LEAD * method.dt
        begin, self.due = max(first, t_start - lead), t_start + lead
        self.steps = {"stepper": method.stepper, "switching": method.switching}
        if method.rtol is not None:
            self.steps["rtol"] = method.rtol
        how = {"geometry": method.geometry, "dt": method.dt, "progress": False}
        engine = "hybrid" if scene.has_rests and scene.law.rests else "dynamic"
        again = simulate(scene, begin, fidelity=engine, initial=initial, **how, **self.steps)
        self.state: State = again.final_state
        before = record.events["t_start"] <= begin
        same = np.array_equal(record.final_state.u_drv0, self.state.u_drv0)
        same = same and len(again.events) == before.sum()
        if not same:
            raise another_start()
        self.model = core.model(scene, method.geometry, self.state.u_drv0)
        self.log = core.Log(scene.N_x)
        self.slipped = bool(np.isin(self.state.mode, (1, -1)).any())
        self.steps["threads"] = core.useful_threads(scene.N_x * scene.N_z)

    def check(self) -> None:
        """Raise SceneError if nothing slips where it should: the run began from another state."""
        if self.state.t > self.due and not self.slipped:
            raise another_start()

    def to(self, t: float) -> State:
        """Return the state at the first step end from t (s) on; times may not go back."""
        state = self.state
        last = math.ceil((t - state.t0) / state.dt * (1 - 1e-14))
        while state.step < last:
            core.advance(self.model, state, self.log, last - state.step, budget=False, **self.steps)
            self.slipped |= bool(self.log.switches()["block"].size)
        return state


def another_start() -> SceneError:
    """Return the refusal of a run that began from another state."""
    allowed = "a run from the loaded slider at t = 0, or the state that it began from, as initial"
    return SceneError("record", "a run from another state", "", allowed)


def check_event(record: Record, event: int) -> None:
    """Raise SceneError unless the record has motion and this event."""
    single(record)
    if record.method.engine not in ("hybrid", "dynamic"):
        allowed = "a run of the hybrid or the dynamic engine"
        raise SceneError("record", record.method.engine, "", allowed, "it has no motion")
    record.row(event)
