"""Events of loading curves: those of own runs, sampled, are the catalogue's."""

import functools

import numpy as np
import pytest

import pyfric
from pyfric.fitting import misfit
from pyfric.measured import COLUMNS, Curve, events, noise_of, robust_line, sampled
from pyfric.measured.picking import _gaps
from pyfric.scene import SceneError

NOISE, STEP = 1e-3, 5e-4


@functools.cache
def run(fidelity="quasistatic", t_end=1.3, l="5 mm", **changes):
    return pyfric.simulate(pyfric.preset("fig1", l=l, **changes), t_end, fidelity=fidelity)


def test_a_run_sampled_fully_has_the_events_of_its_catalogue():
    record = run(l="2.5 mm")  # some events have several falls
    found, known = events(sampled(record)), record.events
    assert list(found) == list(COLUMNS)
    assert len(found) == len(known) > 15
    F_N = record.scene.F_N
    for name, column in (("peak", "F_T_start"), ("valley", "F_T_arrest")):
        np.testing.assert_allclose(found[name], known[column] / F_N, rtol=0, atol=1e-6)
    for name in ("t_start", "t_stop"):
        np.testing.assert_allclose(found[name], known[name], rtol=0, atol=1e-12)
    own = events(record)
    for name in COLUMNS:
        np.testing.assert_allclose(found[name], own[name], rtol=1e-9, atol=1e-9)
    attrs = {"noise": 0.0, "smooth": 1, "threshold": pytest.approx(5e-10, rel=0.1)}
    assert found.attrs == attrs | {"resolution": 0.0, "notes": ()}


def test_stiffness_and_rate_are_those_of_the_apparatus():
    """Static condensation of the stuck slider, in series with the driver's spring."""
    own = events(run())
    np.testing.assert_allclose(own["rate"], own["stiffness"] * 0.7875e-3, rtol=1e-9)
    np.testing.assert_allclose(own["stiffness"], own["stiffness"].iloc[0], rtol=2e-3)
    noisy = events(sampled(run(), STEP, noise=NOISE))
    np.testing.assert_allclose(noisy["stiffness"], own["stiffness"].iloc[0], rtol=0.04)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("changes", [{}, {"mu_k": 0.5}, {"mu_s": 0.6}])
def test_in_noise_no_event_above_five_sigma_is_lost(seed, changes):
    """Drops are right within their errors, and nothing is found that is not there."""
    record = run(**changes)
    found = events(sampled(record, STEP, noise=NOISE, seed=seed), noise=NOISE)
    known = events(record, t_gap=8 * STEP)
    large = known[(known["drop"] > 5 * NOISE) & (known["t_stop"] < 1.3 - 8 * STEP)]
    assert len(large) >= 8
    for _, row in large.iterrows():
        near = found[np.abs(found["t_start"] - row["t_start"]) < 4 * STEP]
        assert len(near) == 1
        assert abs(near["drop"].iloc[0] - row["drop"]) < 4 * near["drop_error"].iloc[0]
        assert abs(near["peak"].iloc[0] - row["peak"]) < 5 * near["peak_error"].iloc[0]
    for t in found["t_start"]:
        assert np.abs(known["t_start"] - t).min() < 4 * STEP


def test_errors_of_drops_are_what_they_say():
    known = events(run(), t_gap=8 * STEP).set_index("t_start")["drop"]
    off = []
    for seed in range(40):
        found = events(sampled(run(), STEP, noise=NOISE, seed=seed), noise=NOISE)
        for _, row in found[found["drop"] > 5 * NOISE].iterrows():
            near = np.argmin(np.abs(known.index - row["t_start"]))
            off.append((row["drop"] - known.iloc[near]) / row["drop_error"])
    assert len(off) > 400
    assert np.mean(np.square(off)) == pytest.approx(1, abs=0.2)


def test_the_time_of_a_fall_moves_both_of_its_forces():
    """In steps of 2 ms, loading adds more than noise; misfits of both ends are independent."""
    sums, products = {"peak": [], "valley": []}, []
    for seed in range(24):
        record = run(mu_k=0.43 + 5e-3 * (seed % 8))  # events fall at other parts of a step
        known = events(record, t_gap=8 * 4 * STEP)
        found = events(sampled(record, 4 * STEP, noise=NOISE, seed=seed), noise=NOISE)
        found = found[found["drop"] > 10 * NOISE]
        ends = misfit(found, known).residuals[: 2 * len(found)].reshape(2, -1)
        products += (ends[0] * ends[1]).tolist()
        for _, row in found.iterrows():
            near = known.iloc[np.argmin(np.abs(known["t_start"] - row["t_start"]))]
            for name, off in sums.items():
                off.append((row[name] - near[name]) / row[f"{name}_error"])
    assert len(products) > 100
    for off in sums.values():
        assert np.mean(np.square(off)) == pytest.approx(1, abs=0.25)
    assert np.mean(products) == pytest.approx(0, abs=0.2)
    assert np.corrcoef(*sums.values())[0, 1] > 0.3


def test_full_dynamics_has_the_same_events():
    """Ring-down is not slip: the drops of static forces are found in noise."""
    record = run("hybrid", 0.8)
    found = events(sampled(record, STEP, noise=NOISE), noise=NOISE)
    known = events(record, t_gap=8 * STEP, threshold=5 * NOISE)
    assert len(known) > 5
    for _, row in known.iterrows():
        near = found[np.abs(found["t_start"] - row["t_start"]) < 8 * STEP]
        assert len(near) == 1
        assert near["drop"].iloc[0] == pytest.approx(row["drop"], abs=4 * NOISE)


def test_noise_is_estimated_and_asked_for_where_it_cannot_be():
    curve = sampled(run(), STEP, noise=2e-3)
    assert noise_of(curve) == pytest.approx(2e-3, rel=0.1)
    assert curve.noise == 2e-3
    plain = Curve.of(t=curve.t, F_T=curve.force(), F_N=curve.F_N)
    assert events(plain).attrs["noise"] == noise_of(plain)
    with pytest.raises(SceneError, match=r"not equally spaced.*noise=1e-3"):
        events(Curve.of(t=curve.t**2, F_T=curve.force(), F_N=curve.F_N))


@pytest.mark.parametrize("n", [2, 4, 8])
def test_filtered_noise_makes_no_events_if_it_is_told(n):
    t = np.arange(8000) * STEP
    white = np.random.default_rng(3).standard_normal(8000 + n - 1)
    noise = NOISE * np.convolve(white, np.ones(n) / np.sqrt(n), "valid")
    curve = Curve.of(t=t, mu=0.4 + 0.1 * (t / 0.1 % 1) + noise)
    assert noise_of(curve) < 0.7 * NOISE
    assert len(events(curve)) > 50
    assert len(events(curve, noise=np.sqrt(n) * NOISE)) == 39


def test_gaps_and_thresholds():
    t = np.arange(400) * STEP
    f = 0.5 * t - 0.05 * (t > 0.1)
    f[100:103] = np.nan
    found = events(Curve.of(t=t, mu=f), noise=0.0)
    assert found["drop"].tolist() == [pytest.approx(0.05 - 0.5 * STEP)]
    assert found["rate"].tolist() == [pytest.approx(0.5)]
    assert np.isnan(found["stiffness"].iloc[0])
    assert events(Curve.of(t=t, mu=f), noise=0.0, threshold=0.06).empty
    slow = 0.5 * t - 0.05 * np.clip((t - 0.08) / 0.04, 0, 1)
    noisy = slow + 1e-4 * np.random.default_rng(0).standard_normal(len(t))
    (row,) = events(Curve.of(t=t, mu=noisy), noise=1e-4).itertuples()
    assert (row.t_start, row.t_stop) == pytest.approx((0.08, 0.12), abs=3e-3)
    assert row.drop == pytest.approx(0.05 - 0.5 * 0.04, abs=2e-3)
    for how, text in (
        ({"noise": -1.0}, "noise"),
        ({"smooth": -2}, "smooth"),
        ({"threshold": -1.0}, "threshold"),
        ({"t_gap": -1.0}, "t_gap"),
    ):
        with pytest.raises(SceneError, match=text):
            events(Curve.of(t=t, mu=noisy), **how)


@pytest.mark.parametrize(("end", "seen"), [(0.88, 16), (0.93, 15)])
def test_a_long_gap_has_no_events(end, seen):
    """What falls in it is not known, nor how long ago the event before the next one was."""
    t = np.arange(4000) * STEP
    f = 0.4 + 0.1 * (t / 0.1 % 1) + NOISE * np.random.default_rng(0).standard_normal(4000)
    whole = events(Curve.of(t=t, mu=f), noise=NOISE)
    gap = np.where((t > 0.53) & (t < end), np.nan, f)
    parted = events(Curve.of(t=t, mu=gap), noise=NOISE)
    both = whole[whole["t_start"].isin(parted["t_start"])]
    assert (len(whole), len(parted)) == (19, seen)
    np.testing.assert_allclose(parted["drop"], both["drop"], rtol=0, atol=NOISE)
    first = int(np.searchsorted(parted["t_start"], end))
    assert np.flatnonzero(parted["recurrence"].isna()).tolist() == [0, first]
    assert parted["rate"].to_numpy() == pytest.approx(1.0, abs=0.05)
    slower = np.concatenate([t[:1000], t[1000::40]])
    assert not len(_gaps(slower, 8))
    assert not len(_gaps(np.repeat(t, 2), 8))


def test_lines_do_not_follow_outliers():
    x = np.linspace(0, 1, 50)
    y = 2 * x + 1e-3 * np.random.default_rng(1).standard_normal(50)
    y[::9] += 1
    assert robust_line(x, y) == pytest.approx((1, 2), abs=2e-3)


def test_a_small_fall_just_before_a_large_one_is_part_of_it():
    """Its force grows between both: as a laboratory sees it, but for the time within a step."""
    scene = pyfric.preset("fig1", {"l": "5 mm", "mu_s": 0.7487686, "mu_k": 0.4919614})
    record = pyfric.simulate(scene, 1.2, fidelity="quasistatic", progress=False)
    large = record.events["n_blocks"] == scene.N_x
    assert (record.events["t_stop"] - record.events["t_start"])[large].min() > 0.9e-3
    seen = events(sampled(record, 0.5e-3, noise=1e-6)).tail(3)
    found = events(record, t_gap=4e-3)
    found = found[found["drop"] > 0.04].tail(3)
    within = 0.5 * 0.5e-3 * found["rate"].max() + 5e-6
    for name in ("peak", "valley"):
        off = np.abs(seen[name].to_numpy() - found[name].to_numpy())
        assert (off < within).all()
    np.testing.assert_allclose(seen["drop"], found["drop"].to_numpy(), rtol=0, atol=5e-6)
