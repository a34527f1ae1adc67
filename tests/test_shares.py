"""What explains front speeds: synthetic fronts with speeds from prestress, position, or both."""

import numpy as np
import pandas as pd
import pytest

from pyfric.paper.claims.shares import BINS, SCATTER, position_alone, shares, told


@pytest.fixture(autouse=True)
def fewer_draws(monkeypatch):
    monkeypatch.setattr("pyfric.paper.claims.shares.DRAWS", 249)


def fronts(speed, count=24, blocks=40, noise=0.0):
    """Return fronts on which prestress falls with the position, each with its own mean.

    `speed` is ln v_c as a function of prestress and position; `noise` is its noise from block to
    block.
    """
    rng = np.random.default_rng(1)
    tables = []
    for n, level in enumerate(rng.uniform(0.0, 0.5, count)):
        place = np.linspace(0, 1, blocks)
        scaled = 1 - place + level
        ln_v = speed(scaled, place) + noise * rng.standard_normal(blocks)
        about = {"front": n, "pair": n % 2, "place": place, "scaled": scaled, "v_c": np.exp(ln_v)}
        tables.append(pd.DataFrame(about))
    return pd.concat(tables, ignore_index=True)


def test_speed_that_follows_the_prestress_is_told_from_position():
    found = shares(fronts(lambda s, x: s, noise=0.05), "scaled")
    value = found.loc["value"]
    assert value["prestress"] > 0.95
    assert value["position"] < value["prestress"] - 0.1
    assert value["beyond"] > 0.8
    assert found.loc["low", "more"] > 0
    assert found.loc["low", "beyond"] > found.loc["null", "beyond"]


def test_speed_that_follows_the_position_is_told_from_prestress():
    """Prestress also explains most of such speeds, because it follows the position, too."""
    found = shares(fronts(lambda s, x: -x, noise=0.05), "scaled")
    value = found.loc["value"]
    assert value["prestress"] > 0.6
    assert value["position"] > 0.95
    assert value["beyond"] < 0.05
    assert found.loc["high", "more"] < 0


@pytest.mark.parametrize("scatter", SCATTER)
def test_speeds_that_know_the_position_alone(scatter):
    points = fronts(lambda s, x: s - 0.3 * x, noise=0.05)
    alone = position_alone(points, scatter=scatter)
    found = shares(points, "scaled")
    null = shares(alone, "scaled").loc["value"]
    assert found.loc["value", "beyond"] > 0.8
    assert null["beyond"] < 0.25
    assert null["beyond"] < found.loc["low", "beyond"]
    assert null["position"] == pytest.approx(found.loc["value", "position"], abs=0.05)
    pd.testing.assert_frame_equal(alone, position_alone(points, scatter=scatter))


def test_what_the_position_leaves_is_scattered_and_no_less():
    points = fronts(lambda s, x: s - 0.3 * x, noise=0.05)
    bins = pd.qcut(points["place"], BINS, labels=False)
    curve = np.log(points["v_c"]).groupby(bins).transform("mean")
    left = {one: np.log(position_alone(points, scatter=one)["v_c"]) - curve for one in SCATTER}
    before = np.log(points["v_c"]) - curve
    np.testing.assert_allclose(np.sort(left["shuffled"]), np.sort(before), atol=1e-12)
    signs = (left["signs"] / before).groupby(points["front"])
    np.testing.assert_allclose(np.abs(signs.mean()), 1, atol=1e-9)  # one sign for each front
    assert signs.mean().min() < 0 < signs.mean().max()


def test_likeness_along_fronts_is_kept_by_signs_alone():
    """Random signs leave more to chance, and set the limit."""
    found = shares(fronts(lambda s, x: s - 0.3 * x, noise=0.05), "scaled")
    assert found.loc["signs", "beyond"] > 2 * found.loc["shuffled", "beyond"]
    assert found.loc["null"].equals(found.loc[list(SCATTER)].max())


def test_shares_are_those_of_least_squares():
    points = fronts(lambda s, x: s**2 + 0.2 * np.sin(9 * x), noise=0.2)
    y = np.log(points["v_c"].to_numpy())
    s, x = (
        pd.get_dummies(pd.qcut(points[one], BINS)).to_numpy(float) for one in ("scaled", "place")
    )

    def explained(columns):
        return 1 - np.var(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) / np.var(y)

    value = shares(points, "scaled").loc["value"]
    of_s, of_x, both = explained(s), explained(x), explained(np.hstack([s, x]))
    assert value["prestress"] == pytest.approx(of_s, abs=1e-12)
    assert value["position"] == pytest.approx(of_x, abs=1e-12)
    assert value["more"] == pytest.approx(of_s - of_x, abs=1e-12)
    assert value["beyond"] == pytest.approx((both - of_x) / (1 - of_x), abs=1e-10)
    y = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    assert value["after"] == pytest.approx(explained(s), abs=1e-12)


def test_groups_have_curves_of_their_own():
    points = fronts(lambda s, x: s, noise=0.01)
    points.loc[points["pair"] == 1, "v_c"] **= -1.0
    one, two = (shares(points, "scaled", by).loc["value", "prestress"] for by in ("", "pair"))
    assert one < 0.1
    assert two > 0.98


def test_fronts_are_drawn_not_blocks():
    """The same number of blocks on fewer fronts gives a wider interval."""
    wide, narrow = (
        shares(fronts(lambda s, x: s + 0.5 * np.sin(50 * (s + x)), *size), "scaled")
        for size in ((6, 160), (48, 20))
    )
    width = [one.loc["high", "prestress"] - one.loc["low", "prestress"] for one in (wide, narrow)]
    assert width[0] > 2 * width[1]
    for one in (wide, narrow):
        assert one.loc["low", "prestress"] < one.loc["value", "prestress"]
        assert one.loc["value", "prestress"] < one.loc["high", "prestress"]


def test_a_share_in_words():
    table = pd.DataFrame({"beyond": [0.251, 0.149, 0.401]}, ["value", "low", "high"])
    assert told(table, "beyond") == "0.25 (0.15 to 0.40)"
