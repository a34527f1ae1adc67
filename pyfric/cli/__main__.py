"""`python -m pyfric.cli` is the command `pyfric`."""

from pyfric.cli import start

start()
