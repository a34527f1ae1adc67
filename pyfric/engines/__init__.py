"""Choose a model, run it, measure its errors."""

from pyfric.display import Progress
from pyfric.engines.choice import Assumption, Plan, plan
from pyfric.engines.cost import full_work, machine_speed
from pyfric.engines.dynamic import RunError
from pyfric.engines.integration import folded
from pyfric.engines.options import OPTION_UNITS, Options, default_switching, step_size
from pyfric.engines.pauses import relaxation_time
from pyfric.engines.quasistatic import QuasistaticRun, prediction_curve
from pyfric.engines.simulation import check_run, expected_cost, released, simulate

__all__ = [
    "OPTION_UNITS",
    "Assumption",
    "Options",
    "Plan",
    "Progress",
    "QuasistaticRun",
    "RunError",
    "check_run",
    "default_switching",
    "expected_cost",
    "folded",
    "full_work",
    "machine_speed",
    "plan",
    "prediction_curve",
    "relaxation_time",
    "released",
    "simulate",
    "step_size",
]
