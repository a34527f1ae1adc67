"""Options of runs on the command line, from the declarations of `pyfric.Options`.

The declarations are read only when a command is used or its help is shown. The list of all commands
is therefore fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import Command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.values import Annotation

ELSEWHERE = ("checkpoint", "checkpoint_every")
"""Options of runs without an option on the command line. --out of `pyfric run` is the
checkpoint."""


class OptionsCommand(Command):
    """A command with all or the named options of runs, placed before the option `before`."""

    def __init__(
        self, *given: Any, options: Sequence[str] = (), before: str = "quiet", **more: Any
    ) -> None:
        super().__init__(*given, **more)
        self.options, self.before, self.declared = options, before, False

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        if not self.declared:
            self.declared = True
            at = [param.name for param in self.params].index(self.before)
            self.params[at:at] = _declared(self.options)
        return super().get_params(ctx)


def _declared(names: Sequence[str]) -> list[click.Parameter]:
    """Return the click parameters of the named options; no names mean all options."""
    from pyfric.engines import Options

    options = Options.declared()
    return [
        _parameter(name, options[name].mark, options[name].default, options[name].short)
        for name in names or (name for name in options if name not in ELSEWHERE)
    ]


def _parameter(name: str, mark: Annotation, default: Any, text: str) -> click.Option:
    from pyfric.engines import Ends, YesNo

    word = name.replace("_", "-")
    more: dict[str, Any] = {"help": text[0].upper() + text[1:].replace("`", ""), "default": default}
    if words := getattr(mark, "words", None):
        return click.Option([f"--{word}"], type=click.Choice(words), **more)
    if isinstance(mark, YesNo):
        return click.Option([f"--{word}/--no-{word}"], **more)
    if isinstance(mark, Ends):
        return click.Option([f"--{word}"], multiple=True, metavar="CONDITION", **more)
    return click.Option([f"--{word}"], type=Value(mark), **more)


class Value(click.ParamType):
    """A number, or a quantity with its unit, as a declaration allows."""

    def __init__(self, mark: Annotation) -> None:
        self.mark, self.name = mark, "time" if mark.unit == "s" else "number"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        from pyfric.values import naming, spoken

        with naming(param.opts[0]):
            return self.mark.check(spoken(value) if isinstance(value, str) else value)
