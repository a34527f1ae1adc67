"""The command line: `start` is the command `pyfric`."""

import os
import signal
from types import FrameType
from typing import NoReturn


def start() -> None:
    """Run the command line; Ctrl-C and SIGTERM end it quietly from the first moment on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    from pyfric.cli.commands import main

    main()


def _end(number: int, frame: FrameType | None) -> NoReturn:
    """End the process while there is nothing to save."""
    os.write(2, b"interrupted\n")
    os._exit(128 + number)
