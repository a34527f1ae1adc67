"""Command line: runs, scenes, figures, claims and timings.

Every command ends with a code of `Exit`; refusals and failures are one message on stderr, without
a traceback. SIGTERM acts as Ctrl-C does. Commands are in `pyfric.cli.commands`: every module there
is read, and adds its own to `main`.
"""

from __future__ import annotations

import errno
from typing import Any

import click

from pyfric.cli.shared import Exit, signalled, stop

__all__ = ["main"]


class _Whole:
    """A command of which a list of commands shows the whole first paragraph, not its beginning."""

    def get_short_help_str(self, limit: int = 0) -> str:
        return " ".join((self.help or "").partition("\n\n")[0].split())


class _Command(_Whole, click.Command):
    """A command that Ctrl-C and SIGTERM end."""

    def invoke(self, ctx: click.Context) -> Any:
        from pyfric.scene import asked_to_stop, commanded

        with commanded():
            try:
                return super().invoke(ctx)
            except KeyboardInterrupt:
                stop(signalled(), "interrupted")
            except (click.ClickException, click.exceptions.Exit, click.Abort):
                raise
            except Exception:
                if asked_to_stop():  # such as an import that was cut short
                    stop(signalled(), "interrupted")
                raise


class _Commands(_Whole, click.Group):
    """A group that ends with `Exit` codes."""

    command_class = _Command
    group_class = type

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
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


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pyfric")
def main() -> None:
    """Simulate how an elastic block starts to slide on a frictional surface.

    Where a command writes one file, or files named after one stem, --overwrite is needed to replace
    what is there. Where it writes a folder, the folder is made if it is missing, and files in it
    that have the names of the outputs are replaced. --json prints the result as JSON, --quiet
    nothing but errors. Progress is shown in a terminal only.
    """
