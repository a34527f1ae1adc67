"""Engines, their options, and the cost of runs."""

from pyfric.display import Progress
from pyfric.engines.cost import (
    EVENT_STEPS,
    POINTS,
    RUN,
    SLOWEST,
    check_memory,
    finer_counts,
    full_counts,
    full_work,
    located,
    machine_speed,
    set_up,
    work,
    work_so_far,
)
from pyfric.engines.declared import Ends, Option, YesNo, multiple
from pyfric.engines.dynamic import DYNAMIC
from pyfric.engines.engine import ENGINES, Counted, Engine
from pyfric.engines.hybrid import HYBRID
from pyfric.engines.integration import Run, RunError, integrate
from pyfric.engines.loaded import shared_statics
from pyfric.engines.options import (
    FINEST,
    RTOL,
    Fidelity,
    Keywords,
    Options,
    Want,
    check_kept,
    kept,
    owned,
)
from pyfric.engines.pauses import coarser, longest_pause, pause_notes, relaxation_time
from pyfric.engines.prediction import prediction_curve
from pyfric.engines.quasistatic import EQUILIBRIUM, QUASISTATIC, QuasistaticRun
from pyfric.engines.step_sizes import (
    ACCURACY,
    MAX_STEPS,
    check_steps,
    default_stepper,
    default_switching,
    resolving,
    rounded_step,
    share_of_limit,
    step_of_waves,
    step_size,
)
from pyfric.engines.stopping import ended_by_condition, stopping_of
from pyfric.engines.strains import folded, largest_strain
from pyfric.engines.together import Asked, has_outline, outlines

ENGINES.update({engine.name: engine for engine in (EQUILIBRIUM, QUASISTATIC, HYBRID, DYNAMIC)})
