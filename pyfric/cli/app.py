"""Command line: runs, scenes, figures, claims and timings.

Every command ends with a code of `Exit`. A refusal or failure prints one message on stderr, and no
traceback. SIGTERM and other signals act as Ctrl-C does. Commands are in `pyfric.cli.commands`.
"""

from __future__ import annotations

import errno
import re
import warnings
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.shared import Exit, signalled, stop

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


EXTRA = re.compile(r"extra arguments? \(([^\s)]+)")
"""Pattern of the message of click on arguments that a command does not take."""


class _Listed:
    """A command in a section of the help page, which shows its whole first paragraph.

    `example` is a valid command line, shown after a usage error.
    """

    def __init__(
        self, *given: Any, section: str = "Commands", example: str = "", **more: Any
    ) -> None:
        super().__init__(*given, **more)
        self.section, self.example = section, example

    def get_short_help_str(self, limit: int = 0) -> str:
        return " ".join((self.help or "").partition("\n\n")[0].split())


class Command(_Listed, click.Command):
    """A command of the group `Commands`."""

    def get_help_option_names(self, ctx: click.Context) -> list[str]:
        """Return the names of the help option, which are constant because click caches them."""
        return ["-h", "--help"]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        def with_hyphens(word: str) -> str:
            """Return an option with hyphens, if it was written with underscores as in Python."""
            name, sign, value = str(word).partition("=")
            other = name.replace("_", "-")
            known = name.startswith("--") and name not in names and other in names
            return f"{other}{sign}{value}" if known else word

        names = {name for param in self.get_params(ctx) for name in param.opts}
        return super().parse_args(ctx, [*map(with_hyphens, args)])

    def make_context(self, *given: Any, **more: Any) -> click.Context:
        try:
            return super().make_context(*given, **more)
        except click.UsageError as error:
            hint = self._hint(error)
            if not hint:
                raise
            if isinstance(error, click.NoSuchOption):
                error.possibilities = None
            text = f"{error.format_message().rstrip('.')}. {hint}"
            raise click.UsageError(text, error.ctx) from None

    def _hint(self, error: click.UsageError) -> str:
        """Return a suggestion for a command line that was not understood."""
        from pyfric.cli import hints

        if isinstance(error, click.NoSuchOption):
            hint = hints.of_option(error.option_name, self)
            return hint or f"Write: {self.example}" * bool(self.example)
        if isinstance(error, click.MissingParameter):
            return f"Write: {self.example}" if self.example else ""
        extra = EXTRA.search(error.message)
        if not extra:
            return ""
        return hints.of_extra(extra[1], self) or f"Write: {self.example}" * bool(self.example)


class Commands(_Listed, click.Group):
    """A group of commands that returns `Exit` codes and lists its commands in sections."""

    command_class = Command
    group_class = type

    def __init__(self, *given: Any, sections: Sequence[str] = ("Commands",), **more: Any) -> None:
        super().__init__(*given, **more)
        self.sections = sections

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        name = args[0].replace("_", "-")
        args = [name, *args[1:]] if name in self.commands else args
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            from pyfric.cli import hints

            if hint := hints.of_command(args[0], self.commands):
                ctx.fail(f"No such command {args[0]!r}. {hint}")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, run first."""
        return sorted(self.commands, key=lambda name: (name != "run", name))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a list of the commands of each section to the help page."""
        for section in self.sections:
            listed = [self.commands[name] for name in self.list_commands(ctx)]
            listed = [command for command in listed if command.section == section]
            with formatter.section(section):
                formatter.write_dl(
                    [(command.name, command.get_short_help_str()) for command in listed]
                )

    def invoke(self, ctx: click.Context) -> Any:
        from pyfric.signals import asked_to_stop, commanded

        if ctx.parent is not None:
            return super().invoke(ctx)
        with warnings.catch_warnings(), commanded():
            warnings.showwarning = _once()
            try:
                return super().invoke(ctx)
            except (click.ClickException, click.exceptions.Exit, click.Abort):
                raise
            except KeyboardInterrupt:
                stop(signalled(), "interrupted")
            except Exception as error:
                if asked_to_stop():  # such as an interrupted import
                    stop(signalled(), "interrupted")
                code = _code(error)
                if code is None:
                    raise
                from pyfric.cli.hints import in_shell

                said = in_shell(str(error), self.commands.get(ctx.invoked_subcommand or ""))
                stop(code, f"Error: {said or 'out of memory'}")


def _once() -> Callable[..., None]:
    """Return a function that shows a warning as one line on stderr; equal texts are shown once."""
    shown = set()

    def show(message: Warning | str, *where: Any) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            click.echo(f"Warning: {message}", err=True)

    return show


def _code(error: Exception) -> Exit | None:
    """Return the exit code of a refusal or failure; None for an unexpected error."""
    import pyfric

    variant = isinstance(error, ImportError) and str(error).startswith("PYFRIC_VARIANT")
    if variant or isinstance(error, pyfric.SceneError):  # the other errors need the core
        return Exit.BAD_INPUT
    if isinstance(error, pyfric.StateError | pyfric.RecordError):
        return Exit.BAD_INPUT
    if isinstance(error, OSError) and error.errno == errno.EPIPE:
        return None  # the reader of stdout has left: click ends quietly
    failures = pyfric.RunError | pyfric.JobError | pyfric.EquilibriumError | MemoryError | OSError
    return Exit.FAILED if isinstance(error, failures) else None


@click.group(
    cls=Commands,
    sections=("Simulate", "Measure", "Look", "The paper", "Methods", "This build"),
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="pyfric")
def main() -> None:
    """Simulate how an elastic block starts to slide on a frictional surface.

    A command that writes one file, or files named after one stem, replaces existing files only with
    --overwrite. A continued run replaces its earlier part. A command that writes into a folder
    makes the folder and replaces files with the same names. --json prints the result as JSON, and
    --quiet prints errors only. Progress is shown only in a terminal.
    """
