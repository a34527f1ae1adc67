"""Words have the same meaning in all commands; help, completion, output into pipes."""

import io
import json
import math
import re
import sys
import warnings

import click
import pandas as pd
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from helpers import STUDIES

from pyfric.cli.app import Commands
from pyfric.cli.commands import main
from pyfric.cli.shared import Tell
from pyfric.scene import PRESETS

PRINTS = {"scene", "completion"}
"""Commands that print a text in place of a result: a scene in TOML, a script."""


def leaves(command=main, name=()):
    if isinstance(command, click.Group):
        for key, one in command.commands.items():
            yield from leaves(one, (*name, key))
    else:
        yield pytest.param(command, id=" ".join(name))


def option(command, name):
    return next((one for one in command.params if name in one.opts), None)


@pytest.mark.parametrize("command", [*leaves(), *leaves(STUDIES, ("studies",))])
def test_words_mean_the_same(command):
    assert (option(command, "--json") is None) == (command.name in PRINTS)
    out = option(command, "--out")
    if out is not None:
        assert out.metavar in ("FILE", "STEM", "DIR")
        replaces = option(command, "--overwrite") is not None
        assert replaces == (out.metavar != "DIR")  # a folder may exist
        assert command.name in PRINTS or option(command, "--quiet")
    for name, said in (
        ("--json", "Print the result as JSON."),
        ("--quiet", "Print nothing but errors."),
        ("--overwrite", "Replace files that exist."),
    ):
        one = option(command, name)
        assert one is None or (one.is_flag, one.help) == (True, said)


@pytest.mark.parametrize("width", [60, 80])
def test_help_never_cuts_a_sentence(width):
    commands = {id(one.values[0]): one.values[0] for one in leaves()}
    told = CliRunner().invoke(main, ["--help"], terminal_width=width).output
    for group in (one for one in main.commands.values() if isinstance(one, click.Group)):
        told += CliRunner().invoke(main, [group.name, "--help"], terminal_width=width).output
    assert "..." not in told.replace("[ARGS]...", "")
    words = " ".join(told.split())
    for one in commands.values():
        summary = " ".join(one.help.partition("\n\n")[0].split())
        assert summary in words
        assert summary.endswith(".")


def completed(words, incomplete):
    completion = ShellComplete(main, {}, "pyfric", "_PYFRIC_COMPLETE")
    return [one.value for one in completion.get_completions(words, incomplete)]


def test_shells_complete_scenes_and_fields():
    presets = [name for name in PRESETS if name.startswith("setup2")]
    assert completed(["run"], "setup2") == [*presets, "setup2"]  # presets and files
    assert completed(["run", "fig1", "--set"], "mu") == ["mu_s=", "mu_k="]
    assert completed(["draw", "setup2", "--set"], "th") == ["theta="]
    assert completed(["plan", "mine.toml", "--set"], "h") == ["h=", "h_top="]
    assert completed(["run", "fig1", "--fidelity"], "q") == ["quasistatic"]
    assert "show" in completed([], "sh")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_scripts_of_completion(shell):
    told = CliRunner().invoke(main, ["completion", shell])
    assert (told.exit_code, f"_PYFRIC_COMPLETE={shell}_complete" in told.output) == (0, True)


def test_nothing_but_the_result_goes_into_a_pipe():
    run = ["run", "chain", "--t-end", "1 us"]
    told = CliRunner().invoke(main, [*run, "--json", "--quiet"])
    assert (json.loads(told.stdout)["status"], told.stderr) == ("complete", "")
    told = CliRunner().invoke(main, run)
    assert (told.stdout[:15], told.stderr) == ("chain: complete", "")
    told = CliRunner().invoke(main, [*run, "--quiet"])
    assert (told.stdout, told.stderr) == ("", "")


def test_progress_is_for_those_who_look_on(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert not Tell(quiet=False, as_json=False).progress
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert Tell(quiet=False, as_json=False).progress
    assert not Tell(quiet=True, as_json=False).progress
    assert not Tell(quiet=False, as_json=True).progress


def test_a_warning_is_one_line_and_said_once():
    @click.group(cls=Commands)
    def group():
        pass

    @group.command()
    def minutes():
        for _ in range(3):
            warnings.warn("not written", RuntimeWarning, stacklevel=2)
        warnings.warn("not unique", RuntimeWarning, stacklevel=2)

    with warnings.catch_warnings(action="always"):
        said = CliRunner().invoke(group, ["minutes"]).stderr
    assert said == "Warning: not written\nWarning: not unique\n"


def test_json_has_all_digits_and_null_for_what_is_not_finite(capsys):
    frame = pd.DataFrame({"dt": [1 / 3e7, math.inf], "n": [1, 2], "name": ["a", None]})
    Tell(quiet=False, as_json=True).table(frame, str)
    first, second = json.loads(capsys.readouterr().out)
    assert first == {"dt": 1 / 3e7, "n": 1, "name": "a"}
    assert second == {"dt": None, "n": 2, "name": None}


def test_lists_of_commands_begin_with_run():
    assert main.list_commands(None)[0] == "run"
    told = CliRunner().invoke(main, ["--help"]).output
    assert re.search(r"Simulate:\n +run ", told)
