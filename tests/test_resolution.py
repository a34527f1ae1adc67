"""The resolution study: its comparisons, and the theory of them."""

import functools

import numpy as np
import pytest
import resolution

from pyfric.figures import save_figure
from pyfric.scene import preset
from pyfric.values import SceneError

SPACINGS = (5e-3, 2.5e-3)
BY_FORMULA, FIXED = resolution.VISCOSITIES


@functools.cache
def tables():
    return resolution.study(SPACINGS, 0.3, workers=1, cache=False, progress=False)


def at(name, l, viscosity=None):
    table = tables()[name]
    table = table[table["l"] == l]
    return table if viscosity is None else table[table["viscosity"] == viscosity]


def test_scenes_differ_in_what_they_should():
    """k and the bulk viscosity do not depend on l; the mass of a block follows from its size."""
    fine, coarse = (resolution.scene(l, FIXED) for l in reversed(SPACINGS))
    assert fine.slider.k == coarse.slider.k
    assert fine.eta == coarse.eta == preset("fig1").eta
    assert fine.slider.M == coarse.slider.M
    formula = resolution.scene(5e-3, BY_FORMULA)
    assert formula.eta == pytest.approx(np.sqrt(0.1 * formula.slider.k * formula.m), rel=1e-12)


def test_at_the_paper_s_spacing_both_viscosities_are_one_scene():
    one, other = (at("events", 2.5e-3, v).drop(columns="viscosity") for v in (BY_FORMULA, FIXED))
    assert len(one) >= 2
    np.testing.assert_array_equal(one.to_numpy(), other.to_numpy())


def test_tables_hold_what_the_runs_give():
    for l in SPACINGS:
        loaded = at("loaded", l)["tau_over_p"].to_numpy()
        np.testing.assert_allclose(loaded, -loaded[::-1], atol=1e-9)
        grown = at("prediction", l)
        assert (np.diff(grown["L_p_over_L"]) >= 0).all()
        assert (np.diff(grown["force"]) >= -1e-12).all()
        events = at("events", l, BY_FORMULA)
        assert (events["force_arrest"] < events["force_start"]).all()
        assert (events["micro_slips"] >= 0).all()


def test_the_summary_has_a_value_for_each_spacing():
    found = resolution.summary(tables())
    assert list(found)[:4] == ["quantity", "viscosity", "l = 5 mm", "l = 2.5 mm"]
    assert found[["l = 5 mm", "l = 2.5 mm"]].notna().sum().min() >= len(found) - 4
    loaded = found[found["quantity"].str.startswith("tau/p")]
    assert (loaded["change"] < 0.1).all()


def test_the_order_is_that_of_the_differences():
    """Values 1 + l^2 differ by 3 l^2, then by 3/4 l^2: order 2."""
    three = {name: tables()[name].iloc[:0].copy() for name in ("events", "fronts", "prediction")}
    x = np.linspace(0, 1, 11)
    loaded = [
        resolution.pd.DataFrame({"x_over_L": x, "tau_over_p": 1 + l**2, "l": l}) for l in (4, 2, 1)
    ]
    grown = [resolution.pd.DataFrame({"force": x, "L_p_over_L": x, "l": l}) for l in (4, 2, 1)]
    three |= {"loaded": resolution.pd.concat(loaded), "prediction": resolution.pd.concat(grown)}
    found = resolution.summary(three)
    assert found["order"].iloc[0] == pytest.approx(2)
    assert found["change"].iloc[0] == pytest.approx(1 - 2 / 5)


def test_a_spacing_that_does_not_fit_is_refused_before_any_run():
    with pytest.raises(SceneError, match="multiple of l"):
        resolution.study((2.5e-3, 2.4e-3), 0.3, workers=1, progress=False)


def test_the_figure(tmp_path):
    fig = resolution.figure(tables())
    assert [len(axes.lines) for axes in fig.axes] == [6, 2, 2, 2]
    names = {path.name for path in save_figure(fig, tmp_path / "resolution")}
    assert {"resolution.png", "resolution_summary.csv", "resolution_events.csv"} <= names
