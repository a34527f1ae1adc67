"""Commands by topic: each module adds its own to `main`."""

from pyfric.cli.app import main
from pyfric.cli.commands import (
    build,
    cache,
    look,
    measured,
    methods,
    paper,
    run,
    sweep,
)
