"""Plan and run."""

from pyfric.engines import store
from pyfric.engines.boundaries import boundary, label_map
from pyfric.engines.dynamic import RunError
from pyfric.engines.guard import folded
from pyfric.engines.options import Options, step_size
from pyfric.engines.planner import Assumption, Plan, plan
from pyfric.engines.points import Estimate, Sweep
from pyfric.engines.progress import Progress, jobs_bar
from pyfric.engines.quasistatic import QuasistaticRun, prediction_curve
from pyfric.engines.results import Results
from pyfric.engines.scout import decay_times
from pyfric.engines.simulation import simulate
from pyfric.engines.sweep import Job, JobError, each, run_all, side_by_side
from pyfric.engines.varied import Span

__all__ = [
    "Assumption",
    "Estimate",
    "Job",
    "JobError",
    "Options",
    "Plan",
    "Progress",
    "QuasistaticRun",
    "Results",
    "RunError",
    "Span",
    "Sweep",
    "boundary",
    "decay_times",
    "each",
    "folded",
    "jobs_bar",
    "label_map",
    "plan",
    "prediction_curve",
    "run_all",
    "side_by_side",
    "simulate",
    "step_size",
    "store",
]
