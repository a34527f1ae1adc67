"""Plan and run."""

from pyfric.engines.dynamic import Progress, RunError, budget_error, step_size
from pyfric.engines.guard import folded
from pyfric.engines.planner import Assumption, Plan, decay_times, plan
from pyfric.engines.quasistatic import prediction_curve
from pyfric.engines.simulation import simulate
from pyfric.engines.sweep import Job, JobError, run_all

__all__ = [
    "Assumption",
    "Job",
    "JobError",
    "Plan",
    "Progress",
    "RunError",
    "budget_error",
    "decay_times",
    "folded",
    "plan",
    "prediction_curve",
    "run_all",
    "simulate",
    "step_size",
]
