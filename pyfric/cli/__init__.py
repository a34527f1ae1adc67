"""The command line."""

from pyfric.cli.app import main

__all__ = ["main"]
