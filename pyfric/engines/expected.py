"""What a run will come to, before it is made: its time and the size of its record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pyfric.engines.cost import verification
from pyfric.engines.options import step_size
from pyfric.engines.planner import _cost, plan
from pyfric.engines.scout import scouted
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from pyfric.engines.options import Options
    from pyfric.scene import Scene

__all__ = ["expected_cost"]


def expected_cost(scene: Scene, t_end: float, how: Options) -> tuple[float, float]:
    """Return the expected time of a run to t_end (s) in s, and the size of its record in bytes."""
    scout = scouted(scene, t_end)
    size = 8.0 * scout.events * (9 * scene.N_x + 40) + 1e5
    if how.fidelity == "auto":
        found = plan(scene, how.want, how.tolerance, t_end=t_end)
        price = found.price
        if how.verify is not None and found.dt is not None:
            counted = found.evaluations, scout.events * (found.fidelity == "hybrid")
            own = found.geometry, found.dt, t_end
            price = verification(scene, how.verify, counted, *own)
        return found.seconds + price * (how.verify != "none"), size
    if how.fidelity in ("quasistatic", "equilibrium"):
        return scout.seconds * (1 + scout.far), size
    geometry = how.geometry or default_geometry(scene)
    dt = step_size(scene, how.dt, how.stepper)
    evaluations, seconds = _cost(scene, t_end, scout, how.fidelity, geometry, dt)
    counted = evaluations, scout.events * (how.fidelity == "hybrid")
    own = geometry, dt, t_end
    return seconds + verification(scene, how.verify or "none", counted, *own), size
