"""`python -m pyfric` is the command `pyfric`."""

from pyfric.cli import start

start()
