"""The onset of frictional sliding in a 2D spring-block model.

    import pyfric

    record = pyfric.simulate(pyfric.preset("fig1"), t_end=0.9)
    record.events                          # the event catalogue
    pyfric.figures.fig1b(record, "fig1b")  # loading curve and slipping regions

Source: J. Trømborg et al., Phys. Rev. Lett. 107, 074301 (2011).
"""

import importlib
from types import ModuleType

from pyfric.core import State, StateError
from pyfric.engines import (
    Assumption,
    Job,
    JobError,
    Plan,
    Progress,
    RunError,
    plan,
    prediction_curve,
    run_all,
    simulate,
    step_size,
)
from pyfric.record import Method, Record, RecordError, analysis, build_catalogue, front_speed
from pyfric.scene import (
    PRESETS,
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Scene,
    SceneError,
    Slider,
    __version__,
    chain,
    preset,
    setup1,
    setup2,
)
from pyfric.statics import (
    Equilibrium,
    EquilibriumError,
    StaticSolver,
    loaded_state,
    solve_static,
    stability_limit,
)

__all__ = [
    "PRESETS",
    "Assumption",
    "DistributedLoad",
    "Driver",
    "Equilibrium",
    "EquilibriumError",
    "Interface",
    "Job",
    "JobError",
    "Method",
    "Plan",
    "PrescribedLoad",
    "Progress",
    "Record",
    "RecordError",
    "Rod",
    "RunError",
    "Scene",
    "SceneError",
    "Slider",
    "State",
    "StateError",
    "StaticSolver",
    "__version__",
    "analysis",
    "build_catalogue",
    "chain",
    "claims",
    "figures",
    "front_speed",
    "loaded_state",
    "plan",
    "prediction_curve",
    "preset",
    "run_all",
    "setup1",
    "setup2",
    "simulate",
    "solve_static",
    "stability_limit",
    "step_size",
]

_LATE = {"claims": "pyfric.paper.claims", "figures": "pyfric.figures"}


def __getattr__(name: str) -> ModuleType:
    """Import `pyfric.figures` and `pyfric.claims` when first used: they take their time."""
    if name in _LATE:
        return importlib.import_module(_LATE[name])
    raise AttributeError(f"module 'pyfric' has no attribute {name!r}")
