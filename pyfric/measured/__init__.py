"""Measurements: read a loading curve, find its events."""

from pyfric.measured.arrivals import arrivals
from pyfric.measured.curve import Curve, sampled
from pyfric.measured.lines import robust_line
from pyfric.measured.picking import COLUMNS, OF_SLIP, events, noise_of
from pyfric.measured.reading import read

__all__ = ["Curve", "arrivals", "events", "noise_of", "read", "sampled"]
