"""Friction laws as data: one module for each family, read in `MODULES`; see docs/laws.md."""

import importlib

from pyfric.scene.laws.kinds import KINDS, FrictionLaw, Means, Tables, check_tables, law
from pyfric.scene.laws.table import Table, from_csv, sampled

MODULES = (
    "weakening",
    "ageing",
    "healing",
    "speed",
    "tabulated",
)
"""Modules with the kinds of laws; a new one takes a line here."""

for _name in MODULES:
    _module = importlib.import_module(f"{__name__}.{_name}")
    globals().update({one: getattr(_module, one) for one in _module.__all__})

__all__ = [
    "KINDS",
    "FrictionLaw",
    "Means",
    "Table",
    "Tables",
    "check_tables",
    "from_csv",
    "law",
    "sampled",
    *(kind.__name__ for kind in KINDS.values()),
]
