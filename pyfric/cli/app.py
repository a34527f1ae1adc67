"""Command line: runs, scenes, figures, claims and timings.

Every command ends with a code of `Exit`; refusals and failures are one message on stderr, without
a traceback. SIGTERM acts as Ctrl-C does. Commands are in `pyfric.cli.commands`: every module there
is read, and adds its own to `main`.
"""

from __future__ import annotations

import errno
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

from pyfric.cli.shared import Exit, stop

__all__ = ["main"]


class _Commands(click.Group):
    """A group that ends with `Exit` codes."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with _sigterm_as_ctrl_c():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            stop(Exit.INTERRUPTED, "interrupted")
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except Exception as error:
            code = _code(error)
            if code is None:
                raise
            stop(code, f"Error: {str(error) or 'out of memory'}")


def _code(error: Exception) -> Exit | None:
    """Return the exit code of a refusal or failure; None for what nobody expects."""
    import pyfric

    if isinstance(error, pyfric.SceneError | pyfric.StateError | pyfric.RecordError):
        return Exit.BAD_INPUT
    if isinstance(error, OSError) and error.errno == errno.EPIPE:
        return None  # the reader of stdout has left: click ends quietly
    failures = pyfric.RunError | pyfric.JobError | pyfric.EquilibriumError | MemoryError | OSError
    return Exit.FAILED if isinstance(error, failures) else None


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[None]:
    """Let the first SIGTERM do what Ctrl-C does; further ones do nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came = False

    def handler(number: int, frame: Any) -> None:
        nonlocal came
        if came:
            return
        came = True
        ctrl_c = signal.getsignal(signal.SIGINT)
        if not callable(ctrl_c):
            raise KeyboardInterrupt
        ctrl_c(signal.SIGINT, frame)

    old = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, old)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pyfric")
def main() -> None:
    """Simulate how an elastic block starts to slide on a frictional surface."""
