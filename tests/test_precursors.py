"""The study of precursors: its rule on numbers made up, its lengths, and its stored result."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import precursors
import precursors_found as found
import pytest

import pyfric
from pyfric.laws import ExponentialWeakening

ROOT = Path(__file__).parents[1]
STORED = ROOT / "reference_data" / "precursors"
SHARES = np.array([0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.6])
FACTORS = {"base": (1, 1, 1, 1), "L": (0.5, 1, 1, 1), "H": (1, 0.5, 1, 1), "h": (1, 1, 4, 1)}
FACTORS |= {"l": (1, 1, 1, 0.5), "mu": (1, 1, 1, 1), "H, L": (0.5, 0.5, 1, 1), "h2": (1, 1, 2, 1)}


def made_up(of, noise=0.0):
    """Return points in which a scale sets the count, falling from 15 to 0."""
    rows, rng = [], np.random.default_rng(0)
    for name, (L, H, h, l) in FACTORS.items():
        about = {"L": 0.14 * L, "H": 0.075 * H, "h": 5e-3 * h, "l": 5e-3 * l}
        for share in SHARES:
            L_c = share * about["L"]
            d_c = L_c / 3000 * (0.5 if name == "mu" else 1.0)
            rows.append(about | {"series": name, "share": share, "L_c": L_c, "d_c": d_c})
    table = pd.DataFrame(rows).assign(L_energy=lambda t: t["L_c"])
    x = np.log(of(table)) - np.log(of(table)).mean()
    y = math.log(16) / (1 + np.exp(2.5 * x))
    return table.assign(y=y + noise * rng.standard_normal(len(table)))


@pytest.mark.parametrize(
    ("scale", "noise", "said"),
    [
        ("L_c/L", 0.05, "holds"),
        ("L_c/h", 0.05, "refuted"),
        ("d_c", 0.05, "refuted"),
        ("L_c/l", 0.05, "refuted"),
        ("L_c/L", 1.0, "not told"),
    ],
)
def test_the_rule_tells_which_scale_sets_the_count(scale, noise, said):
    """The share of the true scale is high, and that of others low; noise tells nothing."""
    table = found.collapse(made_up(found.SCALES[scale], noise), draws=200)
    assert found.verdict(table) == said
    shares = table.set_index("scale")["share"]
    if noise < 1:
        assert shares[scale] > 0.95
        assert shares.idxmax() == scale or shares[scale] > shares.max() - 0.02
    assert (table["low"] <= table["high"]).all()


def test_a_series_does_not_predict_itself():
    """A curve through the own points would explain all of a series that differs from all others."""
    x = np.tile(SHARES, 3)
    series = np.repeat(["a", "b", "c"], len(SHARES))
    y = -np.log(x) + np.where(series == "c", 5.0, 0.0)
    assert found.share(x, -np.log(x), series) == pytest.approx(1.0)
    assert found.share(x, y, series) < 0
    assert found.share(x, np.log(x), series) < 0.1  # counts that rise have no falling curve


def test_the_end_is_the_last_fall_below_one_half():
    shares = np.array([0.1, 0.2, 0.4])
    assert found.end(shares, np.array([3.0, 1.0, 0.0])) == pytest.approx(math.sqrt(0.2 * 0.4))
    assert found.end(shares, np.array([0.0, 0.5, 0.4])) == pytest.approx(0.2)
    assert found.end(shares, np.array([0.4, 0.0, 0.0])) == 0
    assert found.end(shares, np.array([0.0, 0.0, 1.0])) == np.inf


def test_ends_have_errors_from_seeds():
    counts = {0.1: [3, 3, 3, 3], 0.2: [1, 0, 1, 0], 0.4: [0, 0, 0, 0]}
    rows = [
        {"series": "a", "share": share, "n": n, "zone": 60 * share}
        for share, each in counts.items()
        for n in each
    ]
    (row,) = found.ends(pd.DataFrame(rows), draws=200).to_dict("records")
    assert row["end"] == pytest.approx(0.2)
    assert row["low"] < row["end"] < row["high"]
    assert row["zone"] == pytest.approx(12)


def test_large_precursors_reach_four_blocks_of_the_larger_spacing():
    rows = pd.DataFrame(
        {
            "L": 0.14,
            "l": [5e-3, 2.5e-3, 5e-3],
            "lengths": ["0.1034 0.1379 0.5", "0.1228 0.1404", ""],
        }
    )
    table = found.measured(rows)
    assert table["large"].tolist() == [2, 1, 0]  # 3, 4, 14 of 29 blocks; 7, 8 of 57
    assert table["longest"].tolist()[:2] == [0.5, 0.1404]
    assert table["first"].isna().tolist() == [False, False, True]


# --- lengths -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", precursors.SERIES)
@pytest.mark.parametrize("share", [0.05, 0.6])
def test_scenes_have_the_nucleation_length_that_is_asked_for(name, share):
    scene = precursors.scene_at(precursors.SERIES[name], share)
    assert precursors.nucleation_length(scene) == pytest.approx(share * scene.slider.L, rel=1e-12)


def test_nucleation_lengths_are_those_of_theory():
    """1.158 E/(2 W) with W = drop/(2 d_c); E B = 4 k/3. Rate and state: two cases of a/b."""
    scene = precursors.scene_at(precursors.SERIES["base"], 0.1)
    E_B, L_x = 4 / 3 * scene.slider.k, scene.slider.l * scene.N_x
    W_B = 0.25 * scene.F_N / L_x / (2 * scene.interface.d_c)
    expected = 1.158 * E_B / 2 / W_B
    assert precursors.nucleation_length(scene) == pytest.approx(expected, rel=1e-3)
    rated = precursors.scene_at(precursors.SERIES["rate and state"], 0.6)
    L_b = scene.slider.l * rated.law.blocks_in_L_b(rated.F_N / rated.N_x, rated.slider.k)
    assert 0.6 * rated.slider.L == pytest.approx(2 * L_b / (math.pi * (1 - 2 / 3) ** 2))
    small = precursors.nucleation_length(rated.replace(a=0.005))
    assert small == pytest.approx(2 * 1.3774 * L_b)


def test_exponential_weakening_has_the_slope_and_twice_the_energy():
    about = precursors.about("exponential", 0.1)
    base = precursors.about("base", 0.1)
    assert about["L_c"] == base["L_c"]
    assert about["L_energy"] == 2 * base["L_energy"]
    assert about["zone"] == pytest.approx(2 * base["zone"], rel=0.02)
    law = ExponentialWeakening()
    assert law == precursors.SERIES["exponential"].changes["law"]


# --- runs ----------------------------------------------------------------------------------------


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(precursors, "BASE", {"l": 5e-3, "L": 0.04, "H": 0.02, "F_N": 1000.0})
    monkeypatch.setattr(precursors, "PUSHED", 0.4e-3)
    series = {"base": precursors.Series(at=(0.05, 0.1)), "few": precursors.Series(at=(), seeds=1)}
    monkeypatch.setattr(precursors, "SERIES", series)
    monkeypatch.setattr(precursors, "CHECKED", (("base", 0.05),))


def test_runs_that_are_there_are_not_made_again(small, tmp_path, monkeypatch):
    """What was made before a stop stays, and more seeds add runs; counts are those of records."""
    made, real = [], precursors._made

    def counted(job):
        if len(made) == 2:
            made.append(None)
            raise KeyboardInterrupt
        made.append(job)
        return real(job)

    monkeypatch.setattr(precursors, "_made", counted)
    with pytest.raises(KeyboardInterrupt):
        precursors.study(tmp_path, ["base"], seeds=2)
    table = precursors.study(tmp_path, ["base"], seeds=2)
    assert len(made) == 5  # four runs, one of them begun twice
    assert table[["share", "seed"]].to_numpy().tolist() == [
        [0.05, 0],
        [0.05, 1],
        [0.1, 0],
        [0.1, 1],
    ]
    again = precursors.study(tmp_path, ["base"], seeds=2)
    pd.testing.assert_frame_equal(table, again)
    assert len(made) == 5
    record = made[0].made(progress=False).with_events()
    run = pyfric.record.Outline.of_record(record)
    assert table["n"].iloc[0] == run["n_precursors"] > 0
    assert float(table["lengths"].iloc[0].split()[0]) == pytest.approx(run["L_p_first"], abs=1e-4)
    checks = precursors.checks(tmp_path)
    pd.testing.assert_frame_equal(checks, precursors.checks(tmp_path))
    both = found.compared(table, checks)
    assert both["n"].tolist() == both["n_dynamic"].tolist()
    assert both["F_first"].to_numpy() == pytest.approx(both["F_first_dynamic"], abs=1e-3)
