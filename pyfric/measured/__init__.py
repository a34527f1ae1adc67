"""Measured loading curves: reading of files, and search for events."""

import sys
from typing import Any

from pyfric.measured.arrivals import arrivals
from pyfric.measured.curve import Curve, sampled
from pyfric.measured.lines import robust_line
from pyfric.measured.picking import COLUMNS, OF_SLIP, events, noise_of
from pyfric.measured.reading import read
from pyfric.values import no_attribute

__all__ = ["Curve", "arrivals", "events", "noise_of", "read", "sampled"]


def __getattr__(name: str) -> Any:
    """Raise AttributeError for an unknown name, and suggest a known one."""
    raise no_attribute("measured", name, sys.modules[__name__], known=__all__)
