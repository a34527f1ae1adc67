"""Commands by topic: each module adds its own to `main`."""

from pyfric.cli.app import main
from pyfric.cli.commands import (
    build,
    cache,
    methods,
    paper,
    phases,
    resolve,
    run,
    scenes,
    show,
    sweep,
)

__all__ = [
    "build",
    "cache",
    "main",
    "methods",
    "paper",
    "phases",
    "resolve",
    "run",
    "scenes",
    "show",
    "sweep",
]
