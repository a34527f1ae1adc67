"""Many runs: points, executors, the store of finished runs, lines where a label changes."""

from pyfric.sweeps.boundaries import boundary, label_map
from pyfric.sweeps.ensembles import ensemble
from pyfric.sweeps.measures import Ensemble
from pyfric.sweeps.phases import PhaseDiagram, chain_job, even_scale, phase_diagram
from pyfric.sweeps.results import MEASURED, Results
from pyfric.sweeps.runs import Job, JobError, run_all, side_by_side
from pyfric.sweeps.shared import Shared
from pyfric.sweeps.spacings import Resolution, resolve
from pyfric.sweeps.store import MAX_BYTES, Entry, Store
from pyfric.sweeps.sweep import Estimate, Sweep
from pyfric.sweeps.varied import Span
