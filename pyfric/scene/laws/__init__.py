"""Friction laws as data, one module for each family; see docs/laws.md."""

# isort: off
from pyfric.scene.laws.columns import Measured, from_csv
from pyfric.scene.laws.kinds import KINDS, FrictionLaw, Means, Tables, check_tables, law
from pyfric.scene.laws.table import Table, sampled

# The kinds are in this order in `KINDS`.
from pyfric.scene.laws.simple import (
    Ageing,
    ExponentialHealing,
    ExponentialWeakening,
    LinearWeakening,
    SpeedDependent,
)
from pyfric.scene.laws.tabulated import TabulatedLaw
from pyfric.scene.laws.junctions import Junctions
# isort: on

__all__ = [
    "KINDS",
    "Ageing",
    "ExponentialHealing",
    "ExponentialWeakening",
    "FrictionLaw",
    "Junctions",
    "LinearWeakening",
    "Means",
    "Measured",
    "SpeedDependent",
    "Table",
    "Tables",
    "TabulatedLaw",
    "check_tables",
    "from_csv",
    "law",
    "sampled",
]
