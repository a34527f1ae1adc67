"""The cost of fine lattices: runs beside another build, and steps by state of the slider."""

import contextlib
import json
from pathlib import Path

import fine
import numpy as np
import pandas as pd
import pytest

import pyfric
from pyfric.scene import preset


@pytest.fixture(scope="module")
def table():
    patch = pytest.MonkeyPatch()
    asked = []

    @contextlib.contextmanager
    def built(commit):
        asked.append(commit)
        yield Path(pyfric.__file__).parents[1]

    patch.setattr(fine, "built", built)
    patch.setattr(fine, "CASES", fine.CASES | {"2.5 mm": fine.Case("fig1", {}, 0.28)})
    frame = fine.finer(("2.5 mm", "plan"), commits=["older"], repeats=1)
    patch.undo()
    assert asked == ["older"]
    return frame


@pytest.mark.slow
def test_both_builds_make_the_same_runs(table):
    assert table["build"].tolist() == ["this", "older"] * 2
    one, other = (part.reset_index() for _, part in table.groupby("build"))
    for name in ("steps", "events", "attempts", *fine.SIZES):
        np.testing.assert_array_equal(one[name], other[name])
    assert (table["seconds"] > 0).all()
    assert table["GB"].between(0.02, 2).all()
    assert "processor time of older over" in fine.report(table)


@pytest.mark.slow
def test_errors_are_those_beside_full_dynamics(monkeypatch):
    case = fine.Case("fig1", {"l": 5e-3, "V": 8e-3}, 0.022, accuracy=1e-4)
    monkeypatch.setattr(fine, "CASES", {"rough": case})
    (row,) = fine.finer(["rough"], commits=[], repeats=1, errors=True).to_dict("records")
    assert row["events"] > 0
    assert 0 < row["error"] < 1e-4


def test_other_events_have_no_error():
    case = fine.CASES["2.5 mm"]
    known = {json.dumps(case): np.array([1.0, 2.5])}
    assert np.isnan(fine._error(np.zeros(3), case, known))
    assert fine._error(np.array([1.0, 2.0]), case, known) == 0.5


@pytest.mark.slow
def test_steps_of_all_kinds_are_those_of_the_run(table):
    row = table.iloc[0]
    record = pyfric.simulate(
        preset("fig1"), 0.28, fidelity="hybrid", geometry="linear", threads=1, progress=False
    )
    assert row["steps"] == record.counts["steps"] == sum(row[[*fine.SIZES, "at_rest"]])
    assert 0 <= row["at_rest"] < row["steps"]
    assert row["events"] == len(record.events) > 0


def test_cost_against_l_is_drawn_beside_slopes():
    names, times = (
        [name for line in fine.LINES.values() for name in line],
        0.1 * 8.0 ** np.arange(4),
    )
    both = {"this": np.tile(times, 2), "older": 2 * np.tile(times, 2)}
    frames = [pd.DataFrame({"case": names, "build": b, "seconds": s}) for b, s in both.items()]
    (axes,) = fine.figure(pd.concat(frames)).axes
    drawn = [line.get_ydata() for line in axes.lines]
    assert (
        sum(np.allclose(y, times) for y in drawn)
        == sum(np.allclose(y, 2 * times) for y in drawn)
        == 2
    )
    ratios = sorted({round(float(y[2] / y[1]), 6) for y in drawn})
    assert ratios == [8, 16]  # l is halved twice
    assert [line.get_linestyle() for line in axes.lines].count("--") == len(fine.SLOPES)


def test_spells_end_when_no_block_slips():
    t, block = [1.0, 1.5, 2.0, 2.25, 3.0, 4.0, 5.0], [0, 1, 0, 1, 2, 3, 3]
    old, new = [0, 0, 1, -1, 0, 0, 2], [1, -1, 0, 0, 2, 2, 1]
    switches = {"t": t, "block": block, "old": old, "new": new}
    lasts, blocks = fine.spells(switches, 7.0)
    np.testing.assert_array_equal(lasts, [1.25, 2.0])  # block 3 slips after landing, to the end
    np.testing.assert_array_equal(blocks, [2, 1])


def test_a_commit_that_does_not_exist_is_not_built():
    with pytest.raises(fine.subprocess.CalledProcessError), fine.built("no-such-commit"):
        pass
