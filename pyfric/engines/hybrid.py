"""Hybrid engine: full dynamics in events, cheaper solutions between events.

Events are integrated as in full dynamics, by the same core and with the same time steps. Between
events a skip (`pyfric.engines.skip`) replaces steps. The law of friction selects the skip:
ring-down and stable slip have closed forms, slow slip is followed without inertia. A slider that
never comes to rest is integrated in full, and its record has a note.

Source: PRL 107, 074301 (2011) for the model.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from pyfric.engines.engine import Engine
from pyfric.engines.integration import integrate
from pyfric.engines.moving import MovingParts, has_parts
from pyfric.engines.options import owned
from pyfric.engines.ring_down import RingDown
from pyfric.engines.slow_slip import SlowSlip
from pyfric.engines.stable_slip import StableSlip
from pyfric.statics import check_rests

if TYPE_CHECKING:
    from pyfric.engines.guarded import GuardedSteps
    from pyfric.engines.skip import Skip
    from pyfric.scene import Scene

SKIPS = (SlowSlip, StableSlip, RingDown)
"""Skips, in the order in which they are tried. The last is taken if no skip fits a scene."""


def kind_of(scene: Scene) -> type[RingDown | SlowSlip]:
    """Return the first class of `SKIPS` that fits a scene."""
    return next((kind for kind in SKIPS if kind.fits(scene)), SKIPS[-1])


def skip_of(steps: GuardedSteps) -> Skip:
    """Return the skip of a run. In long chains, let steps compute the moving part alone."""
    scene, method = steps.scene, steps.method
    if has_parts(scene) and not (method.budget or method.threshold):
        parts = MovingParts(steps.recorder.known, method)
        steps.in_core, steps.longest = parts.advance, min(steps.longest, parts.longest)
    return kind_of(scene)(steps)


def check_scene(scene: Scene) -> None:
    """Raise SceneError for a scene in which no steps can be left out."""
    check_rests(scene)
    kind_of(scene).check(scene)


HYBRID = Engine(
    name="hybrid",
    models="dynamics inside events, closed forms or slip without inertia between them",
    leaves_out=("fast modes, once they have nearly decayed",),
    options=owned("run", "events", "steps", "energies"),
    jumps=True,
    steppers=("rk4", "rk46", "rk46_waves", "imex"),
    check=check_scene,
    follow=functools.partial(integrate, "hybrid", skip_of=skip_of),
)
