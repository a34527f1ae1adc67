"""The study of public curves, on curves in closed form."""

import curves
import numpy as np
import pandas as pd
import pytest
from scipy import signal

from pyfric.fitting import Sizes
from pyfric.measured import events


def test_made_curves_are_stick_slip_of_a_strength_that_scatters():
    table = events(curves.made(168, 1100, n=60))
    assert len(table) == 60
    assert table["peak"].mean() == pytest.approx(0.38, abs=0.01)
    assert (table["peak"] + table["valley"]).mean() / 2 == pytest.approx(0.32, abs=0.01)


def test_population_of_a_made_curve():
    curve = curves.made(168, 1100, n=60)
    row = curves.population(events(curve), Sizes(curve))
    assert row["large"] == 60
    assert row["peak"] == pytest.approx(0.38, abs=3 * row["peak_error"])
    assert row["peak_std"] == pytest.approx(0.015, rel=0.3)
    assert row["peak_valley"] < -0.9  # slip overshoots mu_k symmetrically
    assert abs(row["follow"]) < 0.3
    assert 0.5 < row["half_drop_error"] / row["peak_error"] < 2


def test_errors_of_means_of_numbers_that_follow_each_other():
    """Errors are compared with the scatter of means of many sequences."""
    noise = 0.1 * np.random.default_rng(1).standard_normal((200, 450))
    values = signal.lfilter([1.0], [1.0, -0.5], noise)[:, 50:]
    told = np.mean([curves.error_of_mean(each) for each in values])
    assert told == pytest.approx(values.mean(axis=1).std(), rel=0.15)


def test_one_law_is_told_from_curves_with_a_level_of_their_own():
    rng = np.random.default_rng(0)
    names = ("peak_error", "valley_error", "half_drop_error", "force_error")
    table = pd.DataFrame({name: np.full(9, 0.005) for name in names})
    table["V"] = np.tile([42, 1100, 4300], 3)
    for name, value in (("mu_s", 0.36), ("mu_k", 0.33), ("force", 0.34)):
        table[name] = value + 0.003 * rng.standard_normal(9)
    same = curves.one_law(table).set_index(["number", "curves"])
    assert (same["chi2"] < 3 * same["dof"]).all()
    levels = 0.05 * rng.standard_normal(9)
    moved = {name: table[name] + levels for name in ("mu_s", "mu_k", "force")}
    other = curves.one_law(table.assign(**moved)).set_index(["number", "curves"])
    assert (other["chi2"] > 3 * other["dof"]).sum() >= 4
    assert other.loc[("mu_s - mu_k", "all"), "chi2"] == pytest.approx(
        same.loc[("mu_s - mu_k", "all"), "chi2"]
    )


def test_without_curves_it_says_where_they_are(tmp_path, monkeypatch):
    monkeypatch.delenv("PYFRIC_TINY", raising=False)
    assert "skipped" in curves.wanted(None)
    assert "npusteln/stickslip" in curves.wanted(tmp_path)
    (tmp_path / "k168Nm_v42.mat").touch()
    assert not curves.wanted(tmp_path)
