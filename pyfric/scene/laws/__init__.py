"""Friction laws as data: one module for each family, listed in `MODULES`; see docs/laws.md."""

import importlib
from typing import TYPE_CHECKING

from pyfric.scene.laws.columns import Measured, from_csv
from pyfric.scene.laws.kinds import KINDS, FrictionLaw, Means, Tables, check_tables, law
from pyfric.scene.laws.table import Table, sampled

if TYPE_CHECKING:  # for type checkers; at run time MODULES decides
    from pyfric.scene.laws.healing import Ageing as Ageing
    from pyfric.scene.laws.healing import ExponentialHealing as ExponentialHealing
    from pyfric.scene.laws.junctions import Junctions as Junctions
    from pyfric.scene.laws.speed import SpeedDependent as SpeedDependent
    from pyfric.scene.laws.tabulated import TabulatedLaw as TabulatedLaw
    from pyfric.scene.laws.weakening import ExponentialWeakening as ExponentialWeakening
    from pyfric.scene.laws.weakening import LinearWeakening as LinearWeakening

MODULES = (
    "weakening",
    "healing",
    "speed",
    "tabulated",
    "junctions",
)
"""Modules with the kinds of laws; a new module needs a line here."""

for _name in MODULES:
    _module = importlib.import_module(f"{__name__}.{_name}")
    globals().update({name: getattr(_module, name) for name in _module.__all__})

__all__ = [
    "KINDS",
    "FrictionLaw",
    "Measured",
    "Means",
    "Table",
    "Tables",
    "check_tables",
    "from_csv",
    "law",
    "sampled",
    *(kind.__name__ for kind in KINDS.values()),
]
