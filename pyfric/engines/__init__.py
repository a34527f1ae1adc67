"""Plan and run."""

from pyfric.engines.dynamic import RunError
from pyfric.engines.expected import expected_cost
from pyfric.engines.guard import folded
from pyfric.engines.options import OPTION_UNITS, Options, step_size
from pyfric.engines.planner import Assumption, Plan, plan
from pyfric.engines.prediction import prediction_curve
from pyfric.engines.progress import Progress, jobs_bar
from pyfric.engines.quasistatic import QuasistaticRun
from pyfric.engines.scout import decay_times
from pyfric.engines.simulation import simulate

__all__ = [
    "OPTION_UNITS",
    "Assumption",
    "Options",
    "Plan",
    "Progress",
    "QuasistaticRun",
    "RunError",
    "decay_times",
    "expected_cost",
    "folded",
    "jobs_bar",
    "plan",
    "prediction_curve",
    "simulate",
    "step_size",
]
