"""Commands by topic. Every module here is read when the command line starts; see `read`."""

import importlib
import pkgutil

__all__ = ["read"]


def read() -> None:
    """Import all modules here, each of which adds its commands to `pyfric.cli.app.main`."""
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        importlib.import_module(module.name)
