"""The paper's runs, page and claims."""

from pyfric.paper import claims
from pyfric.paper.reproduction import reproduce, write_index
from pyfric.paper.runs import RUNS

__all__ = ["RUNS", "claims", "reproduce", "write_index"]
