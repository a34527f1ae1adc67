"""`pyfric verify`: its checks, and failures of a wrong build."""

import json
import math
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner

from pyfric import core
from pyfric.checks import verify
from pyfric.checks.regression import Check
from pyfric.cli.commands import main

SOME = """
from pyfric.checks import verify
from pyfric.cli.commands import main
groups = dict(verify._all())
hybrid = "run1_linear: hybrid engine against stored full dynamics"
verify._all = lambda: [(name, groups[name]) for name in ("build", hybrid)]
main(["verify", "--json"])
"""
"""A command with one group of checks. Tests of claims, core and reference have the other groups."""


@pytest.mark.parametrize(
    ("words", "groups", "least"),
    [
        pytest.param(["-c", SOME], 2, 1, id="two groups"),
        pytest.param(
            ["-m", "pyfric", "verify", "--json"],
            len(list(verify._all())),
            5,
            id="all",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_this_build_outside_the_source_tree(words, groups, least, tmp_path):
    words = [sys.executable, "-P", *words]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    checks = json.loads(done.stdout)
    failed = [check for check in checks if not check["holds"]]
    assert (done.returncode, failed) == (0, [])
    assert len({check["group"] for check in checks}) == groups
    for part in ("static force at first slip", "behind the tip", "v_c of blocks", "collapse"):
        of = [check for check in checks if part in check["name"]]
        assert len(of) >= least, part
        assert all(check["tolerance"] < 0.5 for check in of)


def of(monkeypatch, *makers):
    monkeypatch.setattr(verify, "_all", lambda: [(f"group {n}", m) for n, m in enumerate(makers)])


def test_a_check_that_fails_is_told(monkeypatch):
    of(
        monkeypatch,
        lambda: ([Check("fine", 0.5, 1.0, "s")], "a note"),
        lambda: ([Check("wrong", 1.5, 1.0), Check("nothing", math.nan, 1.0)], ""),
    )
    run = CliRunner().invoke(main, ["verify"])
    assert run.exit_code == 1
    lines = run.output.splitlines()
    verdicts = {line.split()[0]: line.split()[-1] for line in lines if line.startswith("  ")}
    assert verdicts == {"fine": "holds", "note:": "note", "wrong": "FAILS", "nothing": "FAILS"}
    assert "2 of 3 FAIL" in run.output
    run = CliRunner().invoke(main, ["verify", "--json"])
    assert run.exit_code == 1
    assert [check["holds"] for check in json.loads(run.output)] == [True, False, False]


def test_a_check_that_cannot_be_made_fails(monkeypatch):
    def broken():
        raise RuntimeError("contacts switch without end")

    of(monkeypatch, broken, lambda: ([Check("fine", 0.0, 1.0)], ""))
    found = verify.verify()
    assert list(found["holds"]) == [False, True]
    assert "without end" in verify.report(found)


def test_checks_without_end_are_ended(monkeypatch):
    def endless():
        while True:
            pass

    of(monkeypatch, endless, endless)
    monkeypatch.setattr(verify, "LIMIT", 0.2)
    begin = time.process_time()
    found = verify.verify()
    assert time.process_time() - begin < 0.35  # for both runs together
    assert not found["holds"].any()
    assert verify.report(found).count("together may take 0.2 s") == 2


def test_all_that_holds_ends_with_code_0(monkeypatch):
    of(monkeypatch, lambda: ([Check("fine", 1.0, 1.0)], ""))
    run = CliRunner().invoke(main, ["verify"])
    assert run.exit_code == 0
    assert "all 1 checks hold" in run.output


@pytest.mark.parametrize(
    "other",
    [
        ("linear", "linear", "step_end"),
        ("linear", "finite", "located"),
        ("ageing", "finite", "step_end"),
        ("linear", "finite", "step_end"),
    ],
)
def test_other_bits_are_noticed(other, monkeypatch):
    """The last case has another bit in one velocity at its end."""
    known = verify.digest("linear", "finite", "step_end", core.VARIANT, 1)
    if other == ("linear", "finite", "step_end"):
        advance = core.advance

        def off(model, state, *rest, **options):
            status = advance(model, state, *rest, **options)
            state.y[3, 2, 5] = math.nextafter(state.y[3, 2, 5], math.inf)
            return status

        monkeypatch.setattr(core, "advance", off)
    assert verify.digest(*other, core.VARIANT, 1)[0] != known[0]
    assert verify.digest(*other, core.VARIANT, 1, True)[0] != known[0]
    assert known[1] >= verify.SWITCHES


def test_what_the_build_lacks_is_said(monkeypatch):
    monkeypatch.setattr(core, "lacks", lambda: ["built without OpenMP: one thread"])
    assert "built without OpenMP" in verify._build()[1]


@pytest.mark.parametrize("compiler", ["GCC version 12.2.0", "Debian flang version 19.1.7"])
def test_contraction_is_noticed(compiler, monkeypatch):
    def build(flags):
        return lambda _: {"compiler": compiler, "flags": flags, "openmp": True}

    monkeypatch.setattr(core, "build_info", build("-O3 -ffp-contract=off"))
    assert all(check.holds for check in verify._build()[0])
    monkeypatch.setattr(core, "build_info", build("-O3"))
    assert not any(check.holds for check in verify._build()[0])


def test_skipped_variants_are_named(monkeypatch):
    monkeypatch.setattr(core, "variants", lambda: {"v9": False, core.VARIANT: True})
    checks, note = verify._bits()
    assert "v9 (not on this processor)" in note
    assert not any("v9" in check.name for check in checks)
    assert all(check.holds for check in checks)
