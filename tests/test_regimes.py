"""Every regime of `pyfric.checks.regimes` behaves as stated; the table itself can fail."""

import dataclasses
import inspect
import json
from functools import partial

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from pyfric.checks import regimes
from pyfric.checks.regimes import REGIMES, Observed, observe, report
from pyfric.cli.commands import main

NAMES = [one.name for one in REGIMES]
LONGEST = 10.0
"""Longest processor time of a regime, in s."""


@pytest.mark.parametrize("regime", REGIMES, ids=NAMES)
def test_regimes_behave_as_stated(regime):
    row = observe([regime]).iloc[0]
    assert row["observed"] == row["stated"], row["says"]
    assert row["value"] <= row["limit"] or not row["quantity"], row["says"]
    assert row["as_stated"]
    assert row["says"]
    assert row["seconds"] < LONGEST


def test_the_table_covers_what_it_is_for():
    wanted = [
        "dt above", "k_f >> k", "eta = 0", "eta limits", "mu_s = mu_k", "mu_s just above",
        "mu_k = 0", "lift-off", "corner cascade", "at once", "V too high", "folds", "F_T pulls",
        "F_N = 0", "K very large", "K very small", "one row", "two rows",
    ]  # fmt: skip
    assert all(any(word in name for name in NAMES) for word in wanted)
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize(
    ("seen", "right"),
    [
        (Observed("answer", "fine", "x", 0.5, 1.0), True),
        (Observed("answer", "too far", "x", 2.0, 1.0), False),
        (Observed("answer", "no number", "x", np.nan, 1.0), False),
        (Observed("silence", "nothing said", "x", 0.5, 1.0), False),
    ],
)
def test_what_is_not_as_stated_is_shown(seen, right):
    regime = dataclasses.replace(REGIMES[1], look=lambda _: seen)
    table = observe([regime])
    assert bool(table["as_stated"][0]) == right
    assert ("NOT AS STATED" in report(table)) == (not right)


def test_observers_see_silence():
    """Each kind of observer reports a scene that does not behave as stated."""
    calm = regimes.rod
    for look in (
        partial(regimes._refused, field="top.F_N"),
        partial(regimes._noted, note="strains reach"),
        partial(regimes._stopped, t_end=1e-5),
    ):
        assert look(calm).behaviour == "silence"
    slow = partial(calm, V=2e-4)
    assert regimes._moved_up(slow, t_end=0.4, finer=1).behaviour == "silence"
    assert regimes._same(calm, t_end=1e-5).behaviour == "wrong answer"
    assert regimes._same(calm, t_end=3e-3, opens=True).behaviour == "wrong answer"


def test_command_line(tmp_path, monkeypatch):
    monkeypatch.setattr(regimes, "REGIMES", REGIMES[-8:-6])
    monkeypatch.setattr(
        inspect.unwrap(regimes.observe), "__defaults__", (REGIMES[-8:-6], lambda _: None)
    )
    path = tmp_path / "regimes.csv"
    done = CliRunner().invoke(main, ["regimes", "--out", str(path)])
    assert done.exit_code == 0, done.output
    assert "2 of 2 as stated" in done.output
    table = pd.read_csv(path)
    assert table["as_stated"].all()
    assert list(table["regime"]) == NAMES[-8:-6]
    done = CliRunner().invoke(main, ["regimes", "--json"])
    assert len(json.loads(done.stdout)) == 2
    assert CliRunner().invoke(main, ["regimes", "--out", "/no/where/x.csv"]).exit_code == 2
    wrong = dataclasses.replace(REGIMES[1], look=lambda _: Observed("silence", "!"))
    monkeypatch.setattr(inspect.unwrap(regimes.observe), "__defaults__", ((wrong,), lambda _: None))
    assert CliRunner().invoke(main, ["regimes"]).exit_code == 1
