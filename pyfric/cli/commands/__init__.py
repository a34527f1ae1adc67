"""Commands by topic. Every module here is read when the command line starts; see `_read`."""

import importlib
import pkgutil

from pyfric.cli.app import main

__all__ = ["main"]


def _read() -> None:
    """Import all modules here, each of which adds its commands to `main`."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")


_read()
