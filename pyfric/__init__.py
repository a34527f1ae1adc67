"""The onset of frictional sliding in a 2D spring-block model.

    import pyfric

    record = pyfric.simulate(pyfric.preset("fig1"), t_end=0.9)
    record.events                          # the event catalogue
    figure = pyfric.figures.fig1b(record)  # loading curve and slipping regions
    pyfric.figures.save_figure(figure, "fig1b")

Source: J. Trømborg et al., Phys. Rev. Lett. 107, 074301 (2011).
"""

import importlib
import sys
from typing import TYPE_CHECKING, Any

from pyfric import display

if TYPE_CHECKING:
    from pyfric import figures, measured, theory
    from pyfric.core import State, StateError
    from pyfric.engines import Options, Progress, RunError, prediction_curve, step_size
    from pyfric.fitting import Fit, Sensitivity, fit, posterior, sensitivity
    from pyfric.paper import cases, claims
    from pyfric.planning import Level, Plan, plan, released, simulate
    from pyfric.record import (
        RUN_COLUMNS,
        Method,
        Record,
        RecordError,
        analysis,
        build_catalogue,
        front_speed,
        load,
    )
    from pyfric.scene import (
        MATERIALS,
        PRESETS,
        DistributedLoad,
        Driver,
        Interface,
        Material,
        PrescribedLoad,
        Profile,
        Rod,
        Scene,
        Slider,
        Spread,
        Walls,
        __version__,
        chain,
        laws,
        preset,
        presets,
        setup1,
        setup2,
        slab,
        thinned,
    )
    from pyfric.statics import (
        Equilibrium,
        EquilibriumError,
        StaticSolver,
        forced,
        loaded_state,
        overstressed,
        pressed,
        ramped,
        solve_static,
        stability_limit,
        weakened,
    )
    from pyfric.sweeps import (
        Ensemble,
        Job,
        JobError,
        Resolution,
        Shared,
        Span,
        Sweep,
        boundary,
        ensemble,
        label_map,
        phase_diagram,
        resolve,
        run_all,
    )
    from pyfric.values import SceneError

__all__ = [
    "MATERIALS",
    "PRESETS",
    "RUN_COLUMNS",
    "DistributedLoad",
    "Driver",
    "Ensemble",
    "Equilibrium",
    "EquilibriumError",
    "Fit",
    "Interface",
    "Job",
    "JobError",
    "Level",
    "Material",
    "Method",
    "Options",
    "Plan",
    "PrescribedLoad",
    "Profile",
    "Progress",
    "Record",
    "RecordError",
    "Resolution",
    "Rod",
    "RunError",
    "Scene",
    "SceneError",
    "Sensitivity",
    "Shared",
    "Slider",
    "Span",
    "Spread",
    "State",
    "StateError",
    "StaticSolver",
    "Sweep",
    "Walls",
    "__version__",
    "analysis",
    "boundary",
    "build_catalogue",
    "cases",
    "chain",
    "claims",
    "ensemble",
    "figures",
    "fit",
    "forced",
    "front_speed",
    "label_map",
    "laws",
    "load",
    "loaded_state",
    "measured",
    "overstressed",
    "phase_diagram",
    "plan",
    "posterior",
    "prediction_curve",
    "preset",
    "presets",
    "pressed",
    "ramped",
    "released",
    "resolve",
    "run_all",
    "sensitivity",
    "setup1",
    "setup2",
    "simulate",
    "slab",
    "solve_static",
    "stability_limit",
    "step_size",
    "theory",
    "thinned",
    "weakened",
]

ROOMS = (
    "values",
    "scene",
    "theory",
    "core",
    "statics",
    "record",
    "measured",
    "engines",
    "planning",
    "sweeps",
    "fitting",
    "figures",
    "paper",
    "checks",
)
"""Subpackages from the lowest up: each imports only subpackages before it in this list."""
SPACES = ("analysis", "measured", "fitting", "figures", "laws", "theory")
"""Modules that users import by name."""


def _figures() -> Any:
    from pyfric import figures

    return figures


display.figures = _figures


def __getattr__(name: str) -> Any:
    """Import a name when it is first used, with only the subpackages that it needs."""
    if name in ROOMS:
        return importlib.import_module(f"pyfric.{name}")
    for room in ROOMS if name in __all__ else ():
        found = importlib.import_module(f"pyfric.{room}")
        if hasattr(found, name):
            return globals().setdefault(name, getattr(found, name))
    from pyfric.values import line, meant, no_attribute

    instead = ""
    if found := meant(name, __all__):
        instead = f"pyfric.{found}"
    elif not line(name, "pyfric") and not name.startswith("_"):
        spaces = (space for space in SPACES if name in dir(__getattr__(space)))
        instead = next((f"pyfric.{space}.{name}" for space in spaces), "")
    raise no_attribute("pyfric", name, sys.modules[__name__], instead, __all__)


def __dir__() -> list[str]:
    own = {name for name in globals() if name.startswith("__")}
    return sorted({*own, *__all__})
