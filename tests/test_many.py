"""The cost of many runs beside another build, and the scatter of many runs with disorder."""

import contextlib
from pathlib import Path

import fine
import many
import numpy as np
import pytest
import scatter
from helpers import small_rod

import pyfric
from pyfric.record import Outline


@pytest.mark.slow
def test_both_builds_make_the_same_cases(monkeypatch):
    asked = []

    @contextlib.contextmanager
    def built(commit):
        asked.append(commit)
        yield Path(pyfric.__file__).parents[1]

    monkeypatch.setattr(fine, "built", built)
    frame = many.costs(["ensemble"], commits=["older"], repeats=1, quick=True)
    assert asked == ["older"]
    assert frame["case"].tolist() == ["ensemble"] * 2
    assert frame["build"].tolist() == ["this", "older"]
    assert frame["runs"].tolist() == [50, 50]
    assert (frame[["processor", "wall"]] > 0).all().all()
    assert "processor time of older over this build's" in many.report(frame)


def test_all_cases_are_quick_and_known():
    assert set(many.QUICK) | {"fit"} == set(many.CASES)
    assert set(many.FEWER) < set(many.CASES)


# --- scatter -------------------------------------------------------------------------------------


def test_errors_of_means_are_those_of_independent_values():
    """With groups of one, the jackknife error of a mean is exactly std/sqrt(n)."""
    values = np.random.default_rng(0).normal(size=50)
    error = scatter.errors(values, np.arange(50), np.mean)
    assert error == pytest.approx(values.std(ddof=1) / np.sqrt(50), rel=1e-12)
    groups = np.arange(5000) % 20
    values = np.random.default_rng(1).normal(size=5000)
    of_std = scatter.errors(values, groups, lambda x: np.std(x, ddof=1))
    assert of_std == pytest.approx(1 / np.sqrt(2 * 5000), rel=0.4)


@pytest.fixture(scope="module")
def found():
    scene = small_rod(V=5e-3)
    return scatter.study(scene, seeds=12, t_end=0.4, cache=False)


def test_the_table_is_that_of_single_runs(found):
    table = scatter.table(found)
    assert len(table) == len(scatter.sets()) == 10
    row, (width, length) = table.iloc[7], scatter.sets()[7]
    assert (row["width"], row["correlation_length"]) == (width, length)
    field = scatter.field(width, length)
    strengths, lengths, early = [], [], 0
    for n in range(12):
        spread = pyfric.Spread(
            mean=field.mean, std=field.std, correlation_length=length, seed=7 * 12 + n
        )
        scene = small_rod(V=5e-3).replace(mu_s=spread)
        record = pyfric.simulate(scene, 0.4, fidelity="quasistatic", progress=False)
        run = Outline.of_record(record)
        strengths.append(run["F_slide"] / scene.F_N)
        lengths.append(run["L_p_first"])
        events = record.events[record.events["finished"]]
        early += int((events["t_start"] < run["t_slide"]).sum())
    assert row["strength_n"] == 12
    assert row["strength_mean"] == pytest.approx(np.mean(strengths), rel=1e-12)
    assert row["strength_std"] == pytest.approx(np.std(strengths, ddof=1), rel=1e-9)
    assert row["first_length_mean"] == pytest.approx(np.nanmean(lengths), rel=1e-12)
    assert 0 < row["strength_mean_error"] < row["strength_std"]
    assert len(scatter._sizes(found[width, length])[0]) == early


def test_counts_fall_with_size(found):
    counts = scatter.counts(found)
    for _, part in counts.groupby(["width", "correlation_length"]):
        assert (np.diff(part["number"]) <= 0).all()
    figure = scatter.figure(found)
    assert set(figure.tables) == {"table", "sizes"}
    assert figure.caption
