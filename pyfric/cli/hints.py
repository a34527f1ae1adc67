"""Messages of the command line: hints for unknown words, and errors in terms of options.

`pyfric.values.words` finds similar words. Errors of Python functions name arguments, such as
units={"t": "s"}. On the command line, the same errors name options, such as --unit t=s.
"""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

import click

from pyfric.scene import PRESETS, SETTABLE
from pyfric.values import LINES, line, meant, nearest, plain

if TYPE_CHECKING:
    from collections.abc import Iterable

ALLOWED = "; allowed: "
TABLE = re.compile(r"(\w+)=\{([^{}]*)\}")
ENTRY = re.compile(r"""["'](\w+)["']: ("[^"]*"|'[^']*'|\([^)]*\)|[^,]+)""")
SCALAR = re.compile(r"""\b(\w+) ?= ?("[^"]*"|'[^']*'|[\w.+-]*)(?=[\s,;:)]|$)""")
HEAD = re.compile(r"(\w+)(\.| = |: )(.*)")
CALL = re.compile(r"pyfric\.[\w.]+\(\w+, ([^()]*)\)")


def in_shell(text: str, command: click.Command | None) -> str:
    """Return the text of an error with options of a command in place of arguments of Python."""
    options = {} if command is None else options_of(command)
    for words, said in LINES[""].items():
        text = text.replace(said, LINES["shell"].get(words, said))
    return "\n".join(_line_in_shell(each, options) for each in text.split("\n"))


def options_of(command: click.Command) -> dict[str, str]:
    """Return argument of Python -> option of a command, such as units -> --unit."""
    found = {}
    for param in command.get_params(click.Context(command)):
        if isinstance(param, click.Option) and param.name:
            found |= {param.name: param.opts[0], f"{param.name}s": param.opts[0]}
    return found


def _line_in_shell(text: str, options: dict[str, str]) -> str:
    text = re.sub(r" of pyfric\.measured\.\w+", "", text)
    head, allowed, what = text.partition(ALLOWED)
    begin = HEAD.fullmatch(head)
    name, sign, rest = begin.groups() if begin else ("", "", "")
    option = options.get(name, "")
    if option and sign == ".":
        head = f"{option} {rest.replace(' = ', '=', 1)}"
    elif option and plain(option) != plain(name):  # other options have the name of the argument
        head = f"{option}{sign.replace(' = ', ' ')}{rest}"

    def table(found: re.Match[str]) -> str:
        if found[1] not in options:
            return found[0]
        pairs = [f"{key}={_value(value)}" for key, value in ENTRY.findall(found[2])]
        pairs = [shlex.quote(pair) if " " in pair else pair for pair in pairs]
        return " ".join(f"{options[found[1]]} {pair}" for pair in pairs) or options[found[1]]

    def scalar(found: re.Match[str]) -> str:
        if found[1] not in options:
            return found[0]
        value = found[2].strip("\"'")
        if value in ("True", "False"):
            return options[found[1]] if value == "True" else f"--no-{options[found[1]][2:]}"
        return f"{options[found[1]]} {shlex.quote(value) if ' ' in value else value}".rstrip()

    what = TABLE.sub(table, CALL.sub(r"\1", what))
    return head + allowed + SCALAR.sub(scalar, what)


def _value(text: str) -> str:
    """Return a value of a dict as it is written in an option."""
    if text.startswith("("):
        return ":".join(part.strip(" \"'") for part in text.strip("()").split(","))
    return "NAME" if text.startswith("name") else text.strip("\"'")


def of_command(word: str, known: Iterable[str]) -> str:
    """Return a suggestion for a command that does not exist, or ""."""
    if word in PRESETS or word.endswith(".toml"):
        return f"Write: pyfric run {word} --t-end '400 ms'"
    if word.endswith(".nc"):
        return f"Write: pyfric show {word}"
    if found := meant(word, known):
        return f"Write: pyfric {found}"
    if instead := line(word, "command"):
        return f"Write: {instead.format(presets=', '.join(PRESETS))}"
    return "" if nearest(word, known) else f"Write: {line('*', 'command')}"


def of_option(word: str, command: click.Command) -> str:
    """Return a suggestion for an option that a command does not have, or ""."""
    word, options = word.lstrip("-"), options_of(command)
    if instead := line(word, "shell"):
        return f"Write: {instead}"
    names = {name.lstrip("-").replace("-", "_"): name for name in options.values()}
    if found := meant(word, names):
        return f"Write: {names[found]}"
    if word in options:
        return f"Write: {options[word]}"
    known = word if word in SETTABLE else meant(word, SETTABLE)
    return f"Write: --set '{known}=VALUE'" if known and "changes" in options else ""


def of_extra(word: str, command: click.Command) -> str:
    """Return a suggestion for an argument that a command does not take, or ""."""
    if "=" not in word:
        return ""
    if "changes" in options_of(command):
        return f"Write: --set {shlex.quote(word)}"
    name, _, values = word.partition("=")
    return f"Write into FILE: [over] {name} = [{values}]"
