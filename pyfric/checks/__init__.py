"""Is it right, how good, how fast. A module is imported when it is used: each takes its time."""

import importlib
from types import ModuleType

__all__ = ["chart", "regimes", "regression", "stability", "tpv3", "verify"]


def __getattr__(name: str) -> ModuleType:
    if name in __all__:
        return importlib.import_module(f"pyfric.checks.{name}")
    raise AttributeError(f"module 'pyfric.checks' has no attribute {name!r}")
