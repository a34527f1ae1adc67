"""Expected time and size of a run, for announcements."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from pyfric.engines.choice import choose
from pyfric.engines.cost import RUN, SLOWEST, full_work, machine_speed, work
from pyfric.engines.pilot import counted, expected_end, pilot_run, quasistatic_work
from pyfric.engines.price import CHEAP, price
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.record import Method
    from pyfric.scene import Scene

__all__ = ["expected_cost", "expected_dynamics", "long_note"]

LONG = 600.0
"""Expected duration above which a run prints a note before it starts, in s."""


def expected_cost(scene: Scene, t_end: float, how: Options) -> tuple[float, float]:
    """Return the expected time of a run to t_end (s) in s, and the size of its record in bytes.

    The time includes verification, but no refinement.
    """
    how = how.on(scene)
    if how.fidelity == "auto":
        found = choose(scene, how, t_end)
        return found.seconds + found.price, _size(scene, t_end)
    geometry = how.geometry or default_geometry(scene)
    t_end = expected_end(scene, t_end, how.stop_when)
    dt, switching = how.steps_on(scene)
    made, counts = full_work(scene, geometry, dt, t_end, how.stepper, how.calls), None
    if how.fidelity in ("quasistatic", "equilibrium"):
        made = quasistatic_work(scene, pilot_run(scene, t_end))
    elif how.fidelity == "hybrid" and made > CHEAP:
        made_of = {"geometry": geometry, "dt": dt, "switching": switching, "method": None}
        resolved = dataclasses.replace(how, **made_of)
        counts = counted(scene, t_end, resolved, pilot_run(scene, t_end))
        made = RUN + work(scene, geometry, counts)
    if how.verify is not None:
        made += price(scene, how, how.fidelity, dt, t_end, made, counts)[0]
    return made * machine_speed(), _size(scene, t_end)


def _size(scene: Scene, t_end: float) -> float:
    """Return the size of a record, in bytes."""
    if not (scene.has_rests and scene.law.rests):
        return 1e5
    return 1e5 + 8.0 * pilot_run(scene, t_end).events * (9 * scene.N_x + 40)


def long_note(scene: Scene, engine: str, seconds: float) -> str:
    """Return a note for a run that is expected to take long; "" if it is not."""
    if seconds <= LONG:
        return ""
    hint = "larger blocks take less: twice l, about a tenth of the time"
    if engine == "dynamic" and scene.law.rests and not scene.prescribed:
        hint = f"fidelity = 'hybrid' often takes a small part of that; {hint}"
    return f"{engine}: this run takes about {seconds / 60:.2g} minutes on one core; {hint}"


def expected_dynamics(scene: Scene, length: float, method: Method) -> float:
    """Return the expected time of full dynamics over `length` (s), in s; 0 if it cannot be long."""
    made = full_work(scene, method.geometry, method.dt, length, method.stepper)
    return made * machine_speed() if made * SLOWEST > LONG else 0.0
