"""Published results: runs, figures and claims of the paper, and cases from other publications."""

from pyfric.paper import cases, claims
from pyfric.paper.reproduction import reproduce, write_index
from pyfric.paper.runs import RUNS

__all__ = ["RUNS", "cases", "claims", "reproduce", "write_index"]
