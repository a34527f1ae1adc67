"""Measurements as objects: sums, shared parameters, priors, saved fits, populations."""

import dataclasses
import functools
import itertools
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import velocity_steps
from scipy import integrate, optimize, signal
from test_fits import LENGTHS, SCENE, STATIC, cut_valley

import pyfric
from pyfric.figures import fit_page
from pyfric.fitting import (
    Arrivals,
    CurveOf,
    Events,
    Fit,
    Known,
    Lengths,
    Sizes,
    Together,
    fits,
    posterior,
    profiles,
)
from pyfric.fitting.measurement import KINDS, At, packed, unpacked
from pyfric.fitting.of_events import _numbers, large
from pyfric.fitting.problem import Problem
from pyfric.measured import COLUMNS, Curve, events, sampled
from pyfric.values import SceneError

HOW = {"fidelity": "quasistatic", "progress": False}
STORED = Path(__file__).parents[1] / "reference_data" / "fits" / "velocity_steps.csv"


@functools.cache
def curve(seed=0, t_end=1.2, noise=1e-3, **changes):
    record = pyfric.simulate(SCENE.replace(**changes), t_end, fidelity="quasistatic")
    return sampled(record, "0.5 ms", noise=noise, seed=seed)


@functools.cache
def all_kinds():
    own = Events(curve(), "all")
    later = events(curve()).iloc[-8:]
    table = pd.DataFrame({"event": [3, 3, 3], "x": [0.0, 0.02, 0.03], "t": 0.0, "error": 1e-6})
    return {
        "events": own,
        "sizes": Sizes(later),
        "lengths": Lengths(LENGTHS, 1.0),
        "arrivals": Arrivals(table, own),
        "curve": CurveOf(curve(), points=40),
        "known": Known("mu_k", 0.44, 0.01),
    }


@functools.cache
def run():
    return pyfric.simulate(SCENE, 1.32, fidelity="quasistatic", progress=False)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_answers_the_same_questions(kind):
    part, at = all_kinds()[kind], At({"mu_k": 0.45, "mu_s": 0.7})
    assert part.kind == kind
    seen = part.seen(run())
    off = part.residuals(seen, at)
    assert off.shape == part.none(at).shape == part.groups.shape == (part.size,)
    assert part.overview(seen, at).shape == (part.of_overview,)
    assert 0 < part.count <= part.size
    assert part.told(seen, at) <= part.size
    assert np.isfinite(off).all()
    wide = part.residuals(seen, at._replace(tolerance=0.1))
    assert wide @ wide <= off @ off + 1e-9
    assert len(part.table(seen, at))
    assert f"{part.count} numbers" in str(part) or kind == "known"
    again = unpacked(json.loads(json.dumps(packed(part), allow_nan=False)))
    assert type(again) is type(part)
    np.testing.assert_array_equal(again.residuals(again.seen(run()), at), off)


def test_measurements_add():
    kinds = list(all_kinds().values())
    whole = sum(kinds[:3])
    assert whole == Together(kinds[:3])
    assert kinds[0] + (kinds[1] + kinds[2]) == whole
    assert whole + kinds[3] == Together(kinds[:4])
    with pytest.raises(TypeError):
        whole + "a curve"


def test_sums_of_squares_add():
    parts = all_kinds()["events"], all_kinds()["lengths"], all_kinds()["known"]
    u, bounds = np.array([0.3]), {"mu_k": (0.4, 0.5)}
    one = [Problem([SCENE], [Together.of(part)], bounds, HOW, 0.0) for part in parts[:2]]
    whole = Problem([SCENE], [sum(parts)], bounds, HOW, 0.0)
    prior = ((0.43 - 0.44) / 0.01) ** 2
    assert whole.chi2(u) == pytest.approx(sum(each.chi2(u) for each in one) + prior)
    assert whole.runs == 1


def test_curves_and_tables_stand_for_measurements():
    """The arguments of `fit` make the same objects."""
    table = pd.DataFrame({"event": [1, 1], "x": [0.0, 0.02], "t": [0.0, 1e-5], "error": 1e-6})
    (made,) = fits._made([curve()], "all", None, lengths=LENGTHS, arrivals=table)
    own = Events(curve(), "all")
    assert packed(tuple(made)) == packed(tuple(own + Lengths(LENGTHS) + Arrivals(table, own)))
    (alone,) = fits._made([None], "onset", 1.0, lengths=LENGTHS, arrivals=None)
    assert packed(tuple(alone)) == packed((Lengths(LENGTHS, 1.0),))


def test_a_prior_is_a_measurement(monkeypatch):
    """Quasi-static sequences do not depend on the mass; only the prior determines it."""
    monkeypatch.setattr(fits, "STARTS", 1)
    data = Events(events(curve()).iloc[:9], "all") + Known("M", 0.07, 0.004)
    found = pyfric.fit(SCENE, data, {"M": (0.05, 0.1)}, fidelity="quasistatic")
    assert found.values["M"] == pytest.approx(0.07, abs=2e-4)
    half = 1.645 * 0.004
    np.testing.assert_allclose(found.intervals["M"], (0.07 - half, 0.07 + half), atol=5e-4)
    assert "1 known before" in str(found)


def test_parameters_are_shared_by_name(monkeypatch):
    """mu_k is the same in both experiments; the spring belongs to the second machine."""
    monkeypatch.setattr(fits, "STARTS", 2)
    K = SCENE.driver.K
    data = [Events(events(curve(mu_k=0.44, K=K * share)).iloc[:12], "all") for share in (1, 0.8)]
    bounds = {"mu_k": (0.42, 0.46), "K@2": (0.6 * K, 1.1 * K)}
    found = pyfric.fit(SCENE, data, bounds, level=None, fidelity="quasistatic")
    assert found.values["mu_k"] == pytest.approx(0.44, abs=2e-3)
    assert found.values["K@2"] == pytest.approx(0.8 * K, rel=0.03)
    assert [scene.driver.K for scene in found.scenes] == [K, found.values["K@2"]]
    assert set(found.table["curve"]) == {1, 2}
    for name, text in (("K@3", "vary.K@3 = '3'.*1, 2"), ("x@2", "vary.x@2")):
        with pytest.raises(SceneError, match=text):
            pyfric.fit(SCENE, data, {name: (0.1, 0.2)}, fidelity="quasistatic")


def test_a_saved_fit_goes_on(monkeypatch, tmp_path):
    """A fit that was read gives the same profiles, posterior and page."""
    monkeypatch.setattr(fits, "STARTS", 1)
    bounds, data = {"mu_k": (0.42, 0.46)}, events(curve(mu_k=0.44)).iloc[:12]
    short = pyfric.fit(SCENE, data, bounds, level=None, **STATIC)
    assert not short.profiles
    assert "mu_k = 0.4" in str(short)
    again = Fit.load(short.save(tmp_path / "short.json"))
    assert str(again) == str(short)
    assert again.scenes == short.scenes
    whole, same = short.profiled(), again.profiled()
    for other in (same, pyfric.fit(SCENE, data, bounds, **STATIC)):
        np.testing.assert_allclose(other.intervals["mu_k"], whole.intervals["mu_k"], rtol=1e-9)
    pd.testing.assert_frame_equal(whole.profiles["mu_k"], same.profiles["mu_k"])
    assert np.diff(short.profiled(0.5).intervals["mu_k"]) < np.diff(whole.intervals["mu_k"])
    read = Fit.load(whole.save(tmp_path / "whole.json"))
    assert str(read) == str(whole)
    for of in (short, read):
        assert fit_page(of).tables["events"].equals(of.table)
    pytest.importorskip("emcee")
    pd.testing.assert_frame_equal(posterior(read, 100), posterior(whole, 100))


def test_files_that_hold_no_fit_are_refused(tmp_path):
    path = tmp_path / "a.json"
    for text in ("", "[]", '{"format": "other"}', '{"format": "pyfric fit 1"}'):
        path.write_text(text)
        with pytest.raises(SceneError, match=r"path = .*no fit in it.*Fit\.save"):
            Fit.load(path)
    with pytest.raises(SceneError, match="No such file"):
        Fit.load(tmp_path / "b.json")


NEARBY = {part.name for part in dataclasses.fields(profiles.Policies)} - {"off", "draws"}


@pytest.mark.parametrize("name", sorted(NEARBY))
def test_policies_of_profiles_move_intervals_little(name):
    """Twice or half of each setting moves intervals by at most a seventh of their width.

    Valleys are cut by jumps. With half the points, an end may be off by a third of the width.
    """
    usual = profiles.POLICIES
    for factor, slope in itertools.product((0.5, 2.0), (0.8, 0.95)):
        ends = []
        for policies in (usual, changed(usual, name, factor)):
            problem, start = cut_valley(slope, 5e-4), np.array([0.5, 0.5])
            said = profiles.profiled(problem, start, 0.9, lambda text: None, policies)
            ends.append(np.array(list(said[2].values())))
        width = np.ptp(ends[0], axis=1)
        limit = 0.35 if (name, factor) == ("points", 0.5) else 0.15
        assert (np.abs(ends[1] - ends[0]).max(axis=1) < limit * width).all()


def changed(policies, name, factor):
    value = getattr(policies, name)
    new = max(int(factor * value), 1) if isinstance(value, int) else factor * value
    return dataclasses.replace(policies, **{name: new})


@functools.cache
def wrong():
    """No constant mu_k gives these forces at both speeds."""
    speeds = {0.304: SCENE.driver.V, 0.504: 1.5 * SCENE.driver.V}  # as if mu_k grew with V
    two = [events(curve(seed=1, mu_k=mu_k, V=V)).iloc[:9] for mu_k, V in speeds.items()]
    scenes = [SCENE.replace(V=V) for V in speeds.values()]
    return pyfric.fit(scenes, two, {"mu_k": (0.25, 0.55)}, level=None, **STATIC)


@pytest.mark.parametrize("name", [pytest.param("draws", marks=pytest.mark.slow), "off"])
def test_policies_of_wrong_models_move_intervals_little(name):
    found = wrong()
    assert not found.fits
    for factor in (0.5, 2.0):
        problem, policies = found.problem, changed(profiles.POLICIES, name, factor)
        u = problem.place(found.values)
        low, high = profiles.known_of(problem, u, 0.9, lambda text: None, policies).intervals[
            "mu_k"
        ]
        assert not low > 0.305  # mu_k of the first curve; an open end is NaN
        assert not high < 0.49  # near mu_k of the second curve


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Known("mu_k", 0.4, 0.0), "error = 0.0"),
        (lambda: Events(curve(), "end"), "'onset' or 'all'"),
        (lambda: Sizes(events(curve()).iloc[-5:]), "events are no population"),
        (lambda: CurveOf(curve(noise=0.0)), "error = 0.0: .*a sample"),
        (lambda: CurveOf(curve(), points=2), "points = 2"),
        (lambda: CurveOf(events(curve())), "a Curve with forces"),
        (lambda: Arrivals(LENGTHS, curve()), r"Events\(curve\)"),
        (lambda: pyfric.fit(SCENE, Lengths(LENGTHS), {"mu_k": (0.4, 0.5)}), "t_end"),
        (
            lambda: pyfric.fit(
                SCENE, Events(curve()) + Known("mu_s", 0.7, 0.1), {"mu_k": (0.4, 0.5)}
            ),
            "name = 'mu_s'.*varied: mu_k",
        ),
        (
            lambda: pyfric.fit(SCENE, Events(curve()), {"mu_k": (0.4, 0.5)}, lengths=LENGTHS),
            r"lengths = .*add pyfric\.fitting\.Lengths",
        ),
    ],
)
def test_bad_measurements_are_refused(make, text):
    with pytest.raises(SceneError, match=text):
        make()


# --- whole curves --------------------------------------------------------------------------------


def test_means_of_a_curve_are_those_of_the_run():
    """The means agree with means of samples; a run is linear between its points."""
    record = run()
    fine = sampled(record, "10 us")
    part = CurveOf(Curve.of(t=fine.t, F_T=fine.force(), F_N=SCENE.F_N), error=1e-3, points=60)
    assert part.size == 60
    assert np.abs(part.seen(record) - part.f).max() < 2e-5
    samples = CurveOf(sampled(record, "50 ms", noise=1e-3), points=1000)
    assert (samples.t_from == samples.t_to).all()
    assert samples.error == pytest.approx(1e-3)
    assert np.abs(samples.seen(record) - samples.f).max() < 5e-3
    at = At({"offset": 0.01, "drift": 0.1})
    off = samples.residuals(samples.seen(record), at) - samples.residuals(
        samples.seen(record), At({})
    )
    np.testing.assert_allclose(off, (0.01 + 0.1 * samples.t_from) / 1e-3)


# --- what cannot be fitted -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("vary", "text"),
    [
        (
            {"mu_k": (0.6, 0.69)},
            r"0 of \d+ events: they begin.*such as mu_k from 0\.[1-4]\d* to 0\.69",
        ),
        (
            {"mu_s": (0.46, 0.5)},
            r"0 of \d+ events: they begin.*such as mu_s from 0\.46 to 0\.[6-8]",
        ),
        ({"K": (1e3, 1e4)}, "and none of its own; allowed: bounds within .*(K from|CurveOf)"),
    ],
)
@pytest.mark.parametrize("part", ["all", "onset"])
def test_bounds_without_an_event_are_refused_in_one_sentence(vary, text, part, monkeypatch):
    monkeypatch.setattr(fits, "STARTS", 1)
    with pytest.raises(SceneError, match=text) as refused:
        pyfric.fit(SCENE, curve(), vary, part=part, fidelity="quasistatic")
    assert "\n" not in str(refused.value)


def test_parameters_at_a_bound_are_said(monkeypatch):
    monkeypatch.setattr(fits, "STARTS", 1)
    found = pyfric.fit(SCENE, curve(mu_k=0.44), {"mu_k": (0.441, 0.5)}, **STATIC)
    assert found.at_bounds["mu_k"] == pytest.approx((0.382, 0.5))
    assert "mu_k sits at its bound: widen its bounds to 0.382 to 0.5" in str(found)
    inside = pyfric.fit(SCENE, curve(mu_k=0.44), {"mu_k": (0.43, 0.45)}, **STATIC)
    assert not inside.at_bounds


def test_a_scene_without_events_is_told_from_a_curve_with_some():
    data = events(curve())
    with pytest.raises(SceneError, match=r"none of its own.*CurveOf") as refused:
        pyfric.fit(spring_slider(), data, {"a": (0.006, 0.02)}, **RATED)
    assert "\n" not in str(refused.value)


# --- populations ---------------------------------------------------------------------------------

M, G, STIFFNESS, SPEED = 0.03, 9.81, 168.0, 1e-3
RATE = STIFFNESS * SPEED / (M * G)
BLOCK = pyfric.chain(
    L=0.08, l=0.04, F_N=M * G, K=STIFFNESS, V=SPEED, M=M, k=1e5, side="top", mu_s=0.4, mu_k=0.3
)
STICK_SLIP = {"fidelity": "hybrid", "geometry": "linear"}


def scattered(n, mu_s, mu_k, scatter, seed):
    """Return events of a block on a spring whose strength changes from event to event.

    The block slips for half a period of the spring, and overshoots mu_k symmetrically.
    """
    peaks = mu_s + scatter * np.random.default_rng(seed).standard_normal(n)
    valleys = 2 * mu_k - peaks
    slip = np.pi * np.sqrt(M / STIFFNESS)
    waits = np.append(0.0, (peaks[1:] - valleys[:-1]) / RATE + slip)
    table = pd.DataFrame({"t_start": np.cumsum(waits), "peak": peaks, "valley": valleys})
    table["t_stop"], table["drop"], table["rate"] = table["t_start"] + slip, peaks - valleys, RATE
    for name in ("peak", "valley", "drop"):
        table[f"{name}_error"] = 1e-3
    absent = [name for name in COLUMNS if name not in table]
    return table.assign(**dict.fromkeys(absent, np.nan))


def test_events_that_do_not_repeat_are_a_population():
    """The fit finds this itself; mean forces give both coefficients within their intervals."""
    table = scattered(80, 0.38, 0.32, 0.015, seed=1)
    bounds, said = {"mu_s": (0.3, 0.5), "mu_k": (0.2, 0.4)}, []
    found = pyfric.fit(BLOCK, table, bounds, progress=said.append, **STICK_SLIP)
    assert "compared as a population" in found.notes[0]
    assert found.notes[0] in said
    assert set(found.others["kind"]) == {"sizes"}
    assert found.fits
    mean = table["peak"].mean()
    error = 0.015 / np.sqrt(80)
    assert abs(found.values["mu_s"] - mean) < error
    for name, true in (("mu_s", 0.38), ("mu_k", 0.32)):
        low, high = found.intervals[name]
        assert low - 0.3 * (high - low) < true < high + 0.3 * (high - low)
    low, high = found.intervals["mu_s"]
    assert 0.5 * 2 * 1.645 * error < high - low < 1.5 * 2 * 1.645 * error
    assert "population" in fit_page(found).caption


def test_how_long_runs_of_a_population_are_is_told_by_the_driver():
    """Forces of a sliding slider hardly rise between events, and do not show the loading."""
    table = scattered(400, 0.38, 0.32, 0.01, seed=1)
    sticks, slides = (Sizes(table.assign(rate=rate)) for rate in (RATE, 0.01 * RATE))
    first, apart = 0.38 / RATE, table["t_start"].diff().mean()
    for part in (sticks, slides):
        assert 1 < part.lasts(BLOCK) / (first + 20 * apart) < 1.2
        twice = part.lasts(BLOCK.replace(V=2 * SPEED))
        assert part.lasts(BLOCK) - twice == pytest.approx(1.1 * first / 2, rel=0.1)
    assert sticks.doubts(BLOCK) == ()
    assert "0.01 of what they would if the slider stuck" in slides.doubts(BLOCK)[0]
    rare = table.assign(t_start=50 * table["t_start"], t_stop=50 * table["t_stop"])
    assert Sizes(rare).lasts(BLOCK) < 1.1 * (first + 60 * apart)  # not for 50 times as long


def test_events_of_runs_of_a_population_are_found_as_those_of_the_curve():
    """If vibrations last longer than sticks, forces of the catalogue differ."""
    fast = BLOCK.replace(V=4 * SPEED, k=1e4, mu_k=0.37)
    record = pyfric.simulate(fast, 2.0, progress=False, **STICK_SLIP)
    part, at = Sizes(sampled(record, "0.5 ms", noise=1e-3, seed=1)), At({})
    off = part.residuals(part.seen(record), at)
    assert np.abs(off).max() < 3
    peaks = [large(of)["peak"].iloc[1:].mean() for of in (part.seen(record), events(record))]
    assert peaks[0] - peaks[1] > 0.005  # vibrations go on after the slip has begun


def test_scatter_of_strength_is_a_parameter():
    data = Sizes(scattered(80, 0.38, 0.32, 0.015, seed=1))
    bounds = {"mu_s": (0.3, 0.5), "mu_k": (0.2, 0.4), "scatter": (0.0, 0.05)}
    found = pyfric.fit(BLOCK, data, bounds, level=None, **STICK_SLIP)
    assert found.values["scatter"] == pytest.approx(0.015, rel=0.25)
    assert found.fits


def test_means_of_correlated_events_have_larger_errors():
    """Errors agree with the variance of means of many sequences x_n = r x_(n-1) + noise."""
    rng, n, r = np.random.default_rng(2), 400, 0.6
    table = scattered(n, 0.38, 0.32, 0.0, seed=0)
    means, expected = [], []
    for _ in range(300):
        x = signal.lfilter([1.0], [1.0, -r], 0.01 * rng.standard_normal(n + 50))[50:]
        numbers, covariance, _ = _numbers(table.assign(peak=0.38 + x))
        means.append(numbers[0])
        expected.append(covariance[0, 0])
    assert np.mean(expected) == pytest.approx(np.var(means), rel=0.3)
    assert np.mean(expected) > 2 * 0.01**2 / (1 - r**2) / n


def test_periodic_events_are_compared_one_by_one(monkeypatch):
    """Events that scatter in the model, too, are also compared one by one."""
    monkeypatch.setattr(fits, "STARTS", 1)
    table = scattered(20, 0.38, 0.32, 0.0, seed=1)
    found = pyfric.fit(
        BLOCK.replace(mu_k=0.32), table, {"mu_s": (0.35, 0.4)}, level=None, **STICK_SLIP
    )
    assert not found.notes
    assert len(found.table) == 20


# --- a, b and D_c from velocity steps ------------------------------------------------------------

V_0, V_1, WEIGHT, SPRING = 1e-6, 1e-5, 3500.0, 2e8
STEPS = ((10.0, V_0), (10.0, V_1), (14.0, V_1), (14.0, V_0), (24.0, V_0))
RATED = {"fidelity": "hybrid", "geometry": "linear", "accuracy": 1e-4, "sample": "50 ms"}
TRUE = {"a": 0.0123, "b": 0.0161, "D_c": 9e-6}


def spring_slider(**law):
    """Return a spring-slider: blocks of a chain, pushed by a plate, that move as one."""
    law = pyfric.laws.RateAndState(**({"f_star": 0.6, "V_star": 1e-6} | TRUE | law))
    return pyfric.chain(L=5e-3, F_N=WEIGHT, K=SPRING, V=V_0, side="top", protocol=STEPS, law=law)


def by_ode(t, a, b, D_c):
    """Return F_T/F_N of a massless spring-slider by SciPy: K (X(t) - x) = F_N f(v, psi)."""

    def slow(load, psi):
        return 2 * 1e-6 * np.exp(-(0.6 + b * psi) / a) * np.sinh(load / (a * WEIGHT))

    def rates(V):
        def of(t, y):
            load, psi = y
            v = slow(load, psi)
            return SPRING * (V - v), 1e-6 / D_c * np.exp(-psi) - v / D_c

        return of

    y, found = [0.0, 0.0], []  # psi = ln(V* theta/D_c) with theta = D_c/V_0
    for begin, end, V in ((0, 10, V_0), (10, 14, V_1), (14, 24, V_0)):
        at = t[(t >= begin) & (t < end)]
        how = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-9}
        done = integrate.solve_ivp(rates(V), (begin, end), y, t_eval=[*at, end], **how)
        found.append(done.y[0, :-1] / WEIGHT)
        y = done.y[:, -1]
    return np.concatenate(found)


def test_velocity_steps_tell_a_b_and_D_c():
    """The fit agrees with a fit of the spring-slider by SciPy, with the same noise."""
    noise, t = 5e-4, 0.05 * np.arange(479)
    record = pyfric.simulate(spring_slider(), 24.0, progress=False, **RATED)
    clean = by_ode(t, **TRUE)
    exact = np.interp(t, record.curve["t"], record.curve["F_T"] / WEIGHT)
    assert np.abs(exact - clean).max() < 0.2 * noise
    f = clean + noise * np.random.default_rng(3).standard_normal(len(t))
    data = CurveOf(Curve.of(t=t, F_T=f * WEIGHT, F_N=WEIGHT), error=noise)
    bounds = {"a": (0.006, 0.02), "b": (0.008, 0.03), "D_c": (3e-6, 3e-5)}
    found = pyfric.fit(spring_slider(a=0.01, b=0.02, D_c=2e-5), data, bounds, **RATED)
    scale = np.array([0.01, 0.01, 1e-5])
    own = optimize.least_squares(
        lambda u: (by_ode(t, *(u * scale)) - f) / noise, [1.0, 2.0, 2.0], diff_step=1e-4
    )
    spread = scale * np.sqrt(np.diag(np.linalg.inv(own.jac.T @ own.jac)))
    for k, name in enumerate(bounds):
        low, high = found.intervals[name]
        assert abs(found.values[name] - own.x[k] * scale[k]) < 0.2 * spread[k]
        assert high - low == pytest.approx(2 * 1.645 * spread[k], rel=0.1)
        assert abs(found.values[name] - TRUE[name]) < 4 * spread[k]
    assert found.fits
    assert found.chi2 == pytest.approx(2 * own.cost, rel=0.01)
    assert "479 points of curves" in str(found)
    assert "loading curve" in fit_page(found).caption


def test_stored_velocity_steps_hold_their_truths():
    """135 +- 4 of 150 intervals of 90 % should hold the truth."""
    table = pd.read_csv(STORED)
    held = 0
    for name in velocity_steps.RANGES:
        low, true, high = (table[f"{name}_{end}"] for end in ("low", "true", "high"))
        held += int(((low <= true) & (true <= high)).sum())
        assert (table[name] / true - 1).abs().max() < 0.01
    assert len(table) == velocity_steps.TRUTHS
    assert held >= 124  # three standard deviations
    assert "intervals of 90 % hold" in velocity_steps.report(table)
