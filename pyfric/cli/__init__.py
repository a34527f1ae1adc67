"""The command line."""

from pyfric.cli import commands
from pyfric.cli.app import main

__all__ = ["main"]

commands.read()
