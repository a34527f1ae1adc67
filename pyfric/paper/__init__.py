"""Published results: the paper's runs, page and claims, and cases of others."""

from pyfric.paper import cases, claims
from pyfric.paper.reproduction import reproduce, write_index
from pyfric.paper.runs import RUNS

__all__ = ["RUNS", "cases", "claims", "reproduce", "write_index"]
