"""The study of precursors: its rule on synthetic numbers, its lengths, and its stored result."""

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
    """Return points whose counts fall from 15 to 0 with one of the scales."""
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
    """The share of the true scale is high; all other shares, and all with noise, are low."""
    table = found.collapse(made_up(found.SCALES[scale], noise), draws=100)
    assert found.verdict(table) == said
    shares = table.set_index("scale")["share"]
    if noise < 1:
        assert shares[scale] > 0.95
        assert shares.idxmax() == scale or shares[scale] > shares.max() - 0.02
    assert (table["low"] <= table["high"]).all()


def test_a_series_does_not_predict_itself():
    """The share is low for a series unlike the others, although a curve fits its own points."""
    x = np.tile(SHARES, 3)
    series = np.repeat(["a", "b", "c"], len(SHARES))
    y = -np.log(x) + np.where(series == "c", 5.0, 0.0)
    assert found.share(x, -np.log(x), series) == pytest.approx(1.0)
    assert found.share(x, y, series) < 0
    assert found.share(x, np.log(x), series) < 0.1  # no falling curve fits rising counts


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
    """Weakening: 1.158 E/(2 W), W = drop/(2 d_c), E B = 4 k/3. Rate and state: two cases of a/b."""
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
    """Finished runs stay after a stop, and more seeds add runs; counts are those of records."""
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


# --- stored --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stored():
    names = ("runs", "points", "ends", "collapse", "spread", "checks")
    return {name: pd.read_csv(STORED / f"precursors_{name}.csv") for name in names}


@pytest.fixture(scope="module")
def page():
    return " ".join((ROOT / "docs/explanation/precursors.md").read_text(encoding="utf-8").split())


def test_stored_tables_are_those_of_the_stored_runs(stored):
    """Points and ends follow from the stored runs; every point of every series has its seeds."""
    runs = stored["runs"]
    for name, series in precursors.SERIES.items():
        own = runs[runs["series"] == name]
        assert sorted(own["share"].unique()) == sorted(series.at)
        assert (own.groupby("share")["seed"].nunique() == series.seeds).all()
        row = precursors.about(name, series.at[-1])
        last = own[own["share"] == series.at[-1]].iloc[0]
        for key, value in row.items():
            assert last[key] == (
                value if isinstance(value, str) else pytest.approx(value, rel=1e-5)
            )
    points = found.points(found.measured(runs))
    assert points["mean"].to_numpy() == pytest.approx(stored["points"]["mean"], abs=1e-5)
    ends = stored["ends"]
    for by, column in {"contact": "n", "rate": "n_by_rate"}.items():
        again = found.ends(runs, column, draws=1)["end"].to_numpy()
        assert again == pytest.approx(ends.loc[ends["by"] == by, "end"], rel=1e-4)
    shares = found.collapse(points[points["law"] != "rate_and_state"], draws=1)["share"]
    kept = stored["collapse"]
    kept = kept[(kept["by"] == "contact") & (kept["law"] == "slip weakening")]["share"]
    assert shares.to_numpy() == pytest.approx(kept, abs=1e-5)


def test_the_page_says_what_is_stored(stored, page):
    points = stored["points"].set_index(["series", "share"])
    ends = stored["ends"].set_index(["series", "by"])
    half = {name: ends.loc[(name, "half of the first count"), "end"] for name in precursors.SERIES}
    for law, said in (("slip weakening", "not told"), ("rate and state", "not told")):
        table = stored["collapse"]
        table = table[(table["law"] == law) & (table["by"] == "contact")]
        nulls = [name for name in found.NULLS if name in set(table["scale"])]
        assert found.verdict(table, nulls) == said
        share = table.set_index("scale")["share"]["L_c/L"]
        assert f"{share:.0%} with {law}".replace("%", " %") in page
    by_rate = stored["collapse"].query("by == 'rate' and scale == 'L_c/L'")["share"]
    said = "it is {:.0%} and {:.0%}, so".format(*by_rate)
    assert said.replace("%", " %") in page
    ratio = stored["spread"].query("by == 'contact' and law == 'slip weakening'")
    assert (ratio["series"] == 9).all()
    ratio = ratio.set_index("scale")["ratio"]
    assert f"smallest is {ratio['L_G/L']:.1f} for" in page
    assert f"and {ratio.drop('L_G/L').min():.1f} or more for each other" in page
    assert f"are left at {half['h = 20 mm']:.2f}, at {half['base']:.2f} with" in page
    lengths = (half["L = 70 mm"], half["L = 70 mm, H = 35 mm"])
    assert "left at {:.2f} and {:.2f}".format(*lengths) in page
    assert "$L_c$ = {:.0f} and {:.0f} mm".format(*(70 * one for one in lengths)) in page
    assert f"instead of {140 * half['base']:.0f} mm" in page
    assert f"half are left at {half['H = 35 mm']:.2f} already" in page
    assert (
        f"Exponential weakening ends at {ends.loc[('exponential', 'contact'), 'end']:.2f}" in page
    )
    fine = ends.loc[("l = 2.5 mm", "contact")]
    assert f"$L_c/L$ = {fine['end']:.2f}, where the zone spans {fine['zone']:.1f} blocks" in page
    assert f"the half is {half['base'] / half['l = 2.5 mm'] - 1:.0%}".replace("%", " %") in page
    assert f"the end at {ends.loc[('base', 'contact'), 'end']:.2f}" in page
    for name in ("F_N = 1750 N", "V = 3.15 mm/s", "V = 0.2 mm/s"):
        assert abs(half[name] / half["base"] - 1) < 0.02
    several = points[(points["mean"] >= 2) & (points["law"] != "rate_and_state")]
    least, most = several["longest_mean"].min(), several["longest_mean"].max()
    assert f"spans {least:.2f} to {most:.2f} of the slider" in page
    rated = points["mean"]["rate and state"]
    assert f"from {rated[0.2]:.0f} at 0.2 to one at 1.2" in page
    assert rated[1.2] == 1


def test_the_hybrid_engine_has_the_counts_of_full_dynamics(stored, page):
    checks = stored["checks"]
    assert len(checks) == len(precursors.CHECKED)
    assert (checks["n"] == checks["n_dynamic"]).all()
    assert (checks["n_by_rate"] == checks["n_by_rate_dynamic"]).all()
    off = max(
        (checks[name] - checks[f"{name}_dynamic"]).abs().max()
        for name in ("F_first", "F_slide_by_rate")
    )
    assert off < 6e-6
    assert "forces within 5e-6" in page
