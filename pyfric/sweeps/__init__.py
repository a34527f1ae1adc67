"""Many runs: points, executors, the store of finished runs, lines where a label changes."""

from pyfric.sweeps import store
from pyfric.sweeps.boundaries import boundary, label_map
from pyfric.sweeps.points import Estimate, Sweep
from pyfric.sweeps.results import Results
from pyfric.sweeps.sweep import Job, JobError, each, run_all, side_by_side
from pyfric.sweeps.varied import Span

__all__ = [
    "Estimate",
    "Job",
    "JobError",
    "Results",
    "Span",
    "Sweep",
    "boundary",
    "each",
    "label_map",
    "run_all",
    "side_by_side",
    "store",
]
