"""Friction laws as data, one module for each family; see docs/laws.md."""

import sys
from typing import Any

from pyfric.scene.laws.columns import Measured, from_csv
from pyfric.scene.laws.junctions import Junctions
from pyfric.scene.laws.kinds import (
    KINDS,
    Ageing,
    ExponentialHealing,
    ExponentialWeakening,
    FrictionLaw,
    LinearWeakening,
    Means,
    SpeedDependent,
    Table,
    Tables,
    Variable,
    check_tables,
    law,
    sampled,
)
from pyfric.scene.laws.named import named
from pyfric.scene.laws.rate_state import EVOLUTIONS, RateAndState
from pyfric.scene.laws.tabulated import TabulatedLaw
from pyfric.values import no_attribute

__all__ = [
    "EVOLUTIONS",
    "KINDS",
    "Ageing",
    "ExponentialHealing",
    "ExponentialWeakening",
    "FrictionLaw",
    "Junctions",
    "LinearWeakening",
    "Means",
    "Measured",
    "RateAndState",
    "SpeedDependent",
    "Table",
    "Tables",
    "TabulatedLaw",
    "Variable",
    "check_tables",
    "from_csv",
    "law",
    "named",
    "sampled",
]


def __getattr__(name: str) -> Any:
    """Refuse a name that no law has, and suggest one."""
    raise no_attribute("laws", name, sys.modules[__name__], known=__all__)
