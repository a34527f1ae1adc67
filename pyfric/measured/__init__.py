"""Measurements: read a loading curve, find its events."""

from pyfric.measured.curve import Curve, sampled
from pyfric.measured.picking import COLUMNS, events, noise_of, robust_line
from pyfric.measured.reading import read

__all__ = ["Curve", "events", "noise_of", "read", "sampled"]
