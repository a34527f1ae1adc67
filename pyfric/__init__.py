"""The onset of frictional sliding in a 2D spring-block model.

    import pyfric

    record = pyfric.simulate(pyfric.preset("fig1"), t_end=0.9)
    record.events                          # the event catalogue
    pyfric.figures.fig1b(record, "fig1b")  # loading curve and slipping regions

Source: J. Trømborg et al., Phys. Rev. Lett. 107, 074301 (2011).
"""

import importlib
import os
import re
import sys
from importlib import metadata
from typing import TYPE_CHECKING, Any

from pyfric import display

if TYPE_CHECKING:
    from pyfric import figures, theory
    from pyfric.core import State, StateError
    from pyfric.engines import Options, Progress, RunError, prediction_curve, step_size
    from pyfric.paper import claims
    from pyfric.planning import Assumption, Plan, plan, released, simulate
    from pyfric.record import (
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
        Rod,
        Scene,
        SceneError,
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
    )
    from pyfric.statics import (
        Equilibrium,
        EquilibriumError,
        StaticSolver,
        forced,
        loaded_state,
        overstressed,
        ramped,
        solve_static,
        stability_limit,
    )
    from pyfric.sweeps import (
        Job,
        JobError,
        Resolution,
        Span,
        Sweep,
        boundary,
        label_map,
        phase_diagram,
        resolve,
        run_all,
    )

__all__ = [
    "MATERIALS",
    "PRESETS",
    "Assumption",
    "DistributedLoad",
    "Driver",
    "Equilibrium",
    "EquilibriumError",
    "Interface",
    "Job",
    "JobError",
    "Material",
    "Method",
    "Options",
    "Plan",
    "PrescribedLoad",
    "Progress",
    "Record",
    "RecordError",
    "Resolution",
    "Rod",
    "RunError",
    "Scene",
    "SceneError",
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
    "chain",
    "claims",
    "figures",
    "forced",
    "front_speed",
    "label_map",
    "laws",
    "load",
    "loaded_state",
    "overstressed",
    "phase_diagram",
    "plan",
    "prediction_curve",
    "preset",
    "presets",
    "ramped",
    "released",
    "resolve",
    "run_all",
    "setup1",
    "setup2",
    "simulate",
    "slab",
    "solve_static",
    "stability_limit",
    "step_size",
    "theory",
]

ROOMS = (
    "scene",
    "theory",
    "core",
    "statics",
    "record",
    "engines",
    "planning",
    "sweeps",
    "figures",
    "paper",
    "checks",
)
"""From the ground up: a room imports those below it. The command line stands above them all."""


def _check_libraries() -> None:
    """Raise ImportError, with what to do, if a library that pyfric needs is missing or too old."""
    needed = [one for one in metadata.requires(__name__) or () if ";" not in one]
    wrong = {one: why for one in needed if (why := _wrong(*one.split(">=")))}
    if wrong:
        told = " and ".join(f"{one} ({why})" for one, why in wrong.items())
        mend = " ".join(f"'{one}'" for one in wrong)
        raise ImportError(f"pyfric needs {told}: python -m pip install {mend}")


def _wrong(name: str, least: str) -> str:
    """Return why a library does not do, or an empty string."""
    try:
        found = metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
    return f"{found} is installed" if _release(found) < _release(least) else ""


def _release(version: str) -> list[int]:
    """Return the numbers a version starts with, without zeros at the end."""
    numbers = [int(one) for one in re.split(r"[^\d.]", version)[0].split(".") if one]
    while numbers and not numbers[-1]:
        numbers.pop()
    return numbers


try:
    _check_libraries()
except metadata.PackageNotFoundError:
    pass  # the sources, which nobody installed, say nothing of versions
except ImportError as error:
    if os.path.basename(sys.argv[0]) == "pyfric":  # the command: its import is all that it has done
        sys.exit(f"Error: {error}")
    raise


def _figures() -> Any:
    from pyfric import figures

    return figures


display.figures = _figures


def __getattr__(name: str) -> Any:
    """Import what is used when it is first used, with the rooms it needs and no others."""
    if name in ROOMS:
        return importlib.import_module(f"pyfric.{name}")
    for room in ROOMS if name in __all__ else ():
        found = importlib.import_module(f"pyfric.{room}")
        if hasattr(found, name):
            return globals().setdefault(name, getattr(found, name))
    raise AttributeError(f"module 'pyfric' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *ROOMS})
