"""What runs: engines, their options, and what runs cost."""

from pyfric.display import Progress
from pyfric.engines.cost import (
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
from pyfric.engines.dynamic import Run, RunError
from pyfric.engines.hybrid import HybridRun
from pyfric.engines.integration import folded, integrate, largest_strain
from pyfric.engines.options import (
    ACCURACY,
    FINEST,
    MAX_STEPS,
    RTOL,
    Fidelity,
    Keywords,
    Options,
    Want,
    check_kept,
    check_steps,
    default_switching,
    kept,
    multiple,
    step_size,
)
from pyfric.engines.pauses import coarser, longest_pause, pause_notes, relaxation_time
from pyfric.engines.quasistatic import (
    EquilibriumRun,
    QuasistaticRun,
    prediction_curve,
    static_sequence,
)
from pyfric.engines.stopping import ended_by_condition, stopping_of

ENGINES = {engine.name: engine for engine in (EquilibriumRun, QuasistaticRun, HybridRun, Run)}
"""All engines by name, the cheapest first."""
