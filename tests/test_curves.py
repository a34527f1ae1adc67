"""The study of public curves, with curves that are made in closed form."""

import curves
import numpy as np
import pandas as pd
import pytest

from pyfric.measured import events


def test_made_curves_are_stick_slip_of_a_strength_that_scatters():
    table = events(curves.made(168, 1100, n=60))
    assert len(table) == 60
    assert table["peak"].mean() == pytest.approx(0.38, abs=0.01)
    assert (table["peak"] + table["valley"]).mean() / 2 == pytest.approx(0.32, abs=0.01)


def test_a_row_has_the_population_and_coefficients_that_hold_the_truth(monkeypatch):
    monkeypatch.setattr(curves, "BOUNDS", {"mu_s": (0.3, 0.5)})
    row = curves.row_of(curves.slider(168, 1100, mu_k=0.32), curves.made(168, 1100))
    assert row["large"] == 20
    assert row["stuck"] == pytest.approx(1.0, abs=0.1)
    assert row["mu_s_low"] < 0.38 < row["mu_s_high"]
    assert abs(row["peak_valley"]) > 0.9  # it swings as far beyond mu_k as it was before
    assert row["seconds"] < 60


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
