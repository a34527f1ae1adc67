"""Full dynamics, the reference engine.

The whole lattice is integrated with a uniform step. The paper's method is classical RK4 with
contact states that switch at the end of a step. Options select other steppers, and switches that
are located inside the step.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import functools

from pyfric import core
from pyfric.engines.engine import Engine
from pyfric.engines.integration import integrate
from pyfric.engines.options import owned

DYNAMIC = Engine(
    name="dynamic",
    models="dynamics throughout",
    options=owned("run", "events", "steps", "energies"),
    steppers=tuple(core.STEPPERS),
    follow=functools.partial(integrate, "dynamic"),
)
