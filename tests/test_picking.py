"""Events of loading curves: sampled runs have the events of their catalogue."""

import functools

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pyfric
from pyfric.fitting import misfit
from pyfric.measured import COLUMNS, Curve, events, lines, noise_of, robust_line, sampled
from pyfric.measured.picking import _gaps
from pyfric.values import SceneError

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
    """The stiffness is that of the condensed stuck slider, in series with the driver's spring."""
    own = events(run())
    np.testing.assert_allclose(own["rate"], own["stiffness"] * 0.7875e-3, rtol=1e-9)
    np.testing.assert_allclose(own["stiffness"], own["stiffness"].iloc[0], rtol=2e-3)
    noisy = events(sampled(run(), STEP, noise=NOISE))
    np.testing.assert_allclose(noisy["stiffness"], own["stiffness"].iloc[0], rtol=0.04)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("changes", [{}, {"mu_k": 0.5}, {"mu_s": 0.6}])
def test_in_noise_no_event_above_five_sigma_is_lost(seed, changes):
    """Drops are right within their errors, and there are no false events."""
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
    """In steps of 2 ms loading adds more than noise; misfits of both ends are independent."""
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
    """Ring-down is no slip: in noise, drops of static forces are found."""
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
    """Falls in a gap are unknown, and so is the recurrence of the next event."""
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


# --- what samples are worth ----------------------------------------------------------------------

PERIOD, DROP = 0.1, 0.05


def saw(t):
    """Return a curve with falls of 0.05 every 0.1 s."""
    return 0.45 + DROP * (t % PERIOD) / PERIOD


def noisy(t, seed=1, noise=NOISE):
    return saw(t) + noise * np.random.default_rng(seed).standard_normal(len(t))


MS = np.arange(2000) * 1e-3


def found_all(found, n=19):
    """Whether all falls are found, with their drops."""
    off = found["drop"] - DROP * (1 - 1e-3 / PERIOD * 0.5)
    return len(found) == n and (np.abs(off) < 5 * found["drop_error"] + 1e-3).all()


def test_means_are_over_times_and_not_over_samples():
    """At 100 Hz eight samples are most of a period, and single samples show the falls."""
    t = np.concatenate([np.arange(0, 1, 0.01), np.arange(1, 2, 0.001)])
    found = events(Curve.of(t=t, mu=noisy(t)))
    assert len(found) == 19
    np.testing.assert_allclose(found["drop"], DROP, atol=3e-3)
    np.testing.assert_allclose(found["t_stop"] - found["t_start"], [0.01] * 9 + [1e-3] * 10)
    slow = found["t_start"] < 0.95
    assert found["drop_error"][slow].min() > 1.9 * found["drop_error"].iloc[-9:].max()
    assert found.attrs["threshold"] == pytest.approx(5 * np.sqrt(2) * found.attrs["noise"])
    assert found.attrs["resolution"] == pytest.approx(0.01)
    backward = events(Curve.of(t=2 - t[::-1], mu=noisy(2 - t[::-1])))
    assert len(backward) == 19


@pytest.mark.parametrize("seed", range(4))
def test_no_drop_is_below_the_threshold(seed):
    """No drop is below the reported or the given threshold."""
    rng = np.random.default_rng(seed)
    t = np.arange(6000) * STEP
    sizes = np.cumsum(rng.exponential(2.5e-3, 150))[np.minimum((t / 0.02).astype(int), 149)]
    curve = Curve.of(t=t, mu=0.125 * t - sizes + 1 + NOISE * rng.standard_normal(len(t)))
    for how in ({}, {"threshold": 4e-3}, {"smooth": 2}, {"noise": 2e-3}):
        found = events(curve, **how)
        assert len(found) > 10
        assert found["drop"].min() >= found.attrs["threshold"] >= how.get("threshold", 0.0)


@pytest.mark.parametrize("value", [0.0, 0.7, 9999.0])
@pytest.mark.parametrize("length", [1, 3])
def test_readings_that_stand_alone_are_left_out_and_said(value, length):
    f = noisy(MS)
    assert found_all(events(Curve.of(t=MS, mu=f)))
    f[555 : 555 + length] = value + 1e-3 * np.arange(length)
    found = events(Curve.of(t=MS, mu=f))
    assert found_all(found)
    assert (
        f"{length} samples that stand alone are left out, first at 0.555 s" in found.attrs["notes"]
    )
    many = noisy(MS)
    many[np.random.default_rng(0).choice(2000, 24, replace=False)] = value
    assert found_all(events(Curve.of(t=MS, mu=many)))


@pytest.mark.parametrize(
    "clipped",
    [
        lambda f: np.minimum(f, 0.48),
        lambda f: np.minimum(f, 0.4995),
        lambda f: np.maximum(f, 0.452),
        lambda f: np.where((MS > 0.7) & (MS < 0.724), 9999.0, f),
    ],
)
def test_a_sensor_at_its_end_is_refused(clipped):
    with pytest.raises(SceneError, match=r"reading stands in \d+ samples.*valid={\"mu\""):
        events(Curve.of(t=MS, mu=clipped(noisy(MS))))


def test_rest_at_both_ends_and_coarse_digits_are_no_clipping():
    f = noisy(MS)
    f[:300], f[1900:] = 0.0, 0.0
    assert len(events(Curve.of(t=MS, mu=f), noise=NOISE)) == 16
    for digits in (5e-4, 1e-3, 2e-3):
        coarse = np.round(noisy(MS) / digits) * digits
        assert len(events(Curve.of(t=MS, mu=coarse), noise=NOISE)) == 19


def falls(f):
    """Return maxima and the next minima, one by one, as an oracle."""
    drops, k = [], 0
    while k + 1 < len(f):
        top = k
        while k + 1 < len(f) and f[k + 1] < f[k]:
            k += 1
        if k > top:
            drops.append(f[top] - f[k])
        else:
            k += 1
    return drops


@pytest.mark.parametrize("curve", ["steps", "spline", "slow"])
def test_without_noise_events_are_falls_between_turning_points(curve):
    """The curve is from another code, has an event every few samples, or joins points."""
    rng = np.random.default_rng(0)
    t = np.arange(1200) * 8e-4
    if curve == "spline":
        t = np.arange(0, 1.9, 1e-3)
        f = CubicSpline(MS[::10], saw(MS[::10]))(t)
    else:
        knots = np.concatenate([[0], np.cumsum(rng.integers(3, 9, 300))])
        f = CubicSpline(knots, np.cumsum(rng.choice([-0.01, 0.012], 301)))(np.arange(1200))
        f = f if curve == "slow" else np.round(f, 9)
    for how in ({}, {"noise": 0.0}):
        found = events(Curve.of(t=t, mu=f), **how)
        np.testing.assert_allclose(found["drop"], falls(f), rtol=0, atol=1e-12)
    assert "turning points" in events(Curve.of(t=t, mu=f)).attrs["notes"][0]
    claimed = events(Curve.of(t=t, mu=f), noise=1e-7, smooth=1)
    assert len(claimed) <= len(falls(f))


def test_a_straight_line_has_no_events():
    for f in (0.4 + 0.01 * MS, np.interp(MS, [0, 0.3, 2], [0, 0.2, 0.5])):
        found = events(Curve.of(t=MS, mu=f))
        assert found.empty
        assert "no noise" in found.attrs["notes"][0]


def test_noise_that_is_not_white_is_said():
    kernel = np.ones(4) / 4
    white = np.random.default_rng(3).standard_normal(2003)
    f = saw(MS) + NOISE * np.convolve(white, kernel, "valid")
    assert "not white" in events(Curve.of(t=MS, mu=f)).attrs["notes"][0]
    assert events(Curve.of(t=MS, mu=noisy(MS))).attrs["notes"] == ()
    digits = np.round(noisy(MS), 3)
    assert events(Curve.of(t=MS, mu=digits)).attrs["notes"] == ()


def test_falls_that_means_do_not_tell_apart_are_said():
    t = np.arange(0, 2, 0.016)  # six samples in each period
    f = noisy(t)
    found = events(Curve.of(t=t, mu=f), noise=NOISE)
    assert len(found) < 19
    (said,) = found.attrs["notes"]
    assert "single samples show 19 falls" in said
    assert len(events(Curve.of(t=t, mu=f), noise=NOISE, smooth=1)) == 19


def test_what_is_no_curve_or_no_number_of_samples_is_refused():
    curve = Curve.of(t=MS, mu=noisy(MS))
    for call, said in (
        (lambda: events("x.csv"), "of = 'str': no curve.*pyfric.measured.read"),
        (lambda: events(curve, smooth=10**9), "smooth = 1000000000.*from 1 to 999"),
        (lambda: pyfric.fit("fig1", "x.csv", {"mu_k": (0.4, 0.5)}), "measured = 'str'"),
        (lambda: events(Curve.of(t=MS, mu=-noisy(MS))), "negative throughout"),
    ):
        with pytest.raises(SceneError, match=said):
            call()


def test_a_fit_says_what_events_leave_out():
    curve = sampled(run(mu_k=0.46), STEP, noise=NOISE)
    f = curve.force().copy()
    f[1234] = 0.0
    said = []
    found = pyfric.fit(
        pyfric.preset("fig1", l="5 mm"),
        Curve.of(t=curve.t, F_T=f, F_N=curve.F_N),
        {"mu_k": (0.455, 0.465)},
        part="all",
        fidelity="quasistatic",
        progress=said.append,
    )
    (note,) = found.notes
    assert "1 samples that stand alone" in note
    assert note in said
    assert str(found).endswith(note)


# --- lines ---------------------------------------------------------------------------------------


def plain_line(x, y):
    """Return one robust line by plain loops, as an oracle."""
    weights, centre, value, slope = np.ones(len(x)), x.mean(), y.mean(), 0.0
    for _ in range(5):
        at, mean = (weights * x).sum() / weights.sum(), (weights * y).sum() / weights.sum()
        spread = (weights * (x - at) ** 2).sum()
        slope = (weights * (x - at) * (y - mean)).sum() / spread if spread > 0 else 0.0
        value = mean + slope * (centre - at)
        off = np.abs(y - value - slope * (x - centre))
        scale = 1.4826 * np.median(off)
        if scale <= 1e-9 * np.abs(y).max() or len(x) < 5:
            break
        weights = (1 - np.clip(off / (6 * scale), 0, 1) ** 2) ** 2
    return value, slope


@pytest.mark.parametrize("at_once", [1, 50, 1 << 20])
def test_lines_through_parts_are_those_through_each(monkeypatch, at_once):
    monkeypatch.setattr(lines, "AT_ONCE", at_once)
    rng = np.random.default_rng(0)
    x, y = np.sort(rng.random(600)), rng.standard_normal(600)
    y[rng.integers(0, 600, 30)] += 50
    x[100:110] = x[100]
    starts = np.array([0, 3, 5, 100, 200, 0, 599, 100])
    stops = np.array([3, 5, 6, 164, 600, 600, 600, 105])
    found = lines.robust_lines(x, y, starts, stops)
    for k, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        value, slope = plain_line(x[start:stop], y[start:stop])
        assert found.value[k] == pytest.approx(value, rel=1e-9)
        assert found.slope[k] == pytest.approx(slope, rel=1e-7, abs=1e-12)
        assert found.centre[k] == pytest.approx(x[start:stop].mean())
        assert found.count[k] == stop - start
    x[5] = np.nan
    some = lines.robust_lines(x, y, np.array([0, 5]), np.array([8, 6]))
    kept = np.delete(np.arange(8), 5)
    assert some.value[0] == pytest.approx(plain_line(x[kept], y[kept])[0])
    assert (some.count == (7, 0)).all()
    assert np.isnan(some.value[1])


def test_lines_do_not_follow_outliers():
    x = np.linspace(0, 1, 50)
    y = 2 * x + 1e-3 * np.random.default_rng(1).standard_normal(50)
    y[::9] += 1
    assert robust_line(x, y) == pytest.approx((1, 2), abs=2e-3)


def test_a_small_fall_just_before_a_large_one_is_part_of_it():
    """The force grows between both falls; a laboratory would also see a single event."""
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
