"""The paper's runs, page and claims."""

from pyfric.paper import claims
from pyfric.paper.page import reproduce, write_index

__all__ = ["claims", "reproduce", "write_index"]
