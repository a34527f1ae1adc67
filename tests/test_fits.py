"""Fits of measured events: known parameters are found, wrong models and gaps are reported."""

import functools
import itertools
import json
from pathlib import Path
from types import SimpleNamespace

import fits as study
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy import stats

import pyfric
from pyfric.cli.commands import main
from pyfric.figures import fit_page, tornado
from pyfric.fitting import (
    QUANTITIES,
    Arrivals,
    Events,
    Lengths,
    Sensitivity,
    fits,
    misfit,
    profiles,
    search,
)
from pyfric.fitting.misfits import CAP, _means_off, onset, overview
from pyfric.fitting.problem import Problem
from pyfric.fitting.profiles import _interval
from pyfric.fitting.sensors import arrivals_off, lengths_of, lengths_off
from pyfric.measured import Curve, events, sampled
from pyfric.values import SceneError

NOISE, STEP, T_END = 1e-3, 5e-4, 1.2
STATIC = {"fidelity": "quasistatic", "part": "all"}
SCENE = pyfric.preset("fig1", l="5 mm")
LENGTHS = pd.DataFrame({"force": [0.2, 0.3], "L_p_over_L": [0.2, 0.4], "error": 0.02})
ARRIVED = pd.DataFrame({"event": [1, 1], "x": [0.0, 0.02], "t": [0.0, 1e-5], "error": 1e-6})


@functools.cache
def curve(seed=0, noise=NOISE, **changes):
    record = pyfric.simulate(SCENE.replace(**changes), T_END, fidelity="quasistatic")
    return sampled(record, STEP, noise=noise, seed=seed)


def known_with(**changes):
    """Return the function that makes profiles, with other settings."""
    policies = profiles.Policies(**changes)
    return lambda *given: profiles.known_of(*given, policies)


def table(peaks, drops, error=1e-3, threshold=0.0, rate=None):
    peaks, drops = np.array(peaks, float), np.array(drops, float)
    found = pd.DataFrame({"peak": peaks, "drop": drops, "valley": peaks - drops})
    found["t_start"] = found["t_stop"] = np.arange(len(peaks), dtype=float)
    found["peak_error"] = found["valley_error"] = error
    found["drop_error"] = np.sqrt(2) * error
    found["rate"] = np.nan if rate is None else rate
    found.attrs["threshold"] = threshold
    return found


# --- misfit --------------------------------------------------------------------------------------


def test_events_are_matched_in_order_whatever_is_missing():
    peaks, drops = [0.1, 0.2, 0.3, 0.4], [0.01] * 4
    data = table(peaks, drops)
    same = misfit(data, table(peaks, drops))
    assert (same.chi2, same.missing, same.extra) == (0, 0, 0)
    assert same.partner.tolist() == [0, 1, 2, 3]
    lost = misfit(data, table([0.1, 0.2, 0.4], drops[:3]))
    assert lost.partner.tolist() == [0, 1, -1, 2]
    assert lost.missing == 1
    assert lost.chi2 == pytest.approx((0.01 / (1e-3 * np.sqrt(2))) ** 2)
    more = misfit(data, table([0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5], [0.01] * 7))
    assert more.partner.tolist() == [1, 2, 4, 5]
    assert (more.missing, more.extra) == (0, 1)  # events before and after do not count
    assert more.chi2 == pytest.approx(lost.chi2)
    off = misfit(data, table(np.array(peaks) + 2e-3, drops))
    np.testing.assert_allclose(off.residuals[:8], 2)
    assert misfit(data, table(np.array(peaks) + 2e-3, drops), tolerance=1).chi2 < 1e-3
    assert misfit(data, table([0.9], [0.01])).residuals.max() <= CAP


def test_a_match_is_the_cheapest_of_all():
    """The match is compared with every match that keeps the order."""
    rng = np.random.default_rng(2)

    def cheapest(cost, alone, unseen):
        n, m = cost.shape
        if n == 0 or m == 0:
            return alone.sum()
        best = alone[0] + cheapest(cost[1:], alone[1:], unseen)
        for j in range(m):
            rest = cheapest(cost[1:, j + 1 :], alone[1:], unseen[j + 1 :])
            best = min(best, cost[0, j] + rest)
        return best

    for _ in range(20):
        data, model = (table(rng.uniform(0, 0.02, n), rng.uniform(5e-3, 9e-3, n)) for n in (4, 3))
        model["drop"] = 0.0  # events of the model without a drop, none is extra
        model["valley"] = model["peak"] - 7e-3
        found = misfit(data, model)
        off = [
            (model[k].to_numpy()[None] - data[k].to_numpy()[:, None]) / 1e-3
            for k in ("peak", "valley")
        ]
        cost = np.minimum(off[0] ** 2 + off[1] ** 2, 2 * CAP**2)
        alone = np.clip(data["drop"] / (1e-3 * np.sqrt(2)), 3, CAP).to_numpy() ** 2
        got = sum(alone[i] if p < 0 else cost[i, p] for i, p in enumerate(found.partner))
        assert got == pytest.approx(cheapest(cost, alone, np.zeros(3)))


def test_the_rate_counts_with_its_error():
    rates = [1.0, 1.02, 0.98, 1.01, 0.99]
    data = table([0.1, 0.2, 0.3, 0.4, 0.5], [0.01] * 5, rate=rates)
    model = table([0.1, 0.2, 0.3, 0.4, 0.5], [0.01] * 5, rate=1.01)
    error = 1.2533 * 1.4826 * 0.01 / np.sqrt(5)
    assert misfit(data, model).residuals[10] == pytest.approx(0.01 / error)


def test_means_of_populations_count_with_their_standard_errors():
    rng, off = np.random.default_rng(1), []
    for _ in range(400):
        later, model = (table(*rng.normal([[0.5], [0.2]], 0.01, (2, n))) for n in (4, 6))
        model = pd.concat([table([0.1] * 3, [0.01] * 3), model], ignore_index=True)  # the onset
        off.append(_means_off(later, model, 0.0)[0])
    assert np.std(off) == pytest.approx(np.sqrt(8 / 6), rel=0.08)  # of Student's t with about 8


def test_an_overview_needs_no_match():
    peaks = np.linspace(0.1, 0.5, 9)
    data, other = table(peaks, [0.02] * 9), table(peaks[::2] + 0.01, [0.04] * 5)
    assert np.abs(overview(data, data)).max() < 1e-9
    sums = [np.sum(overview(data, table(peaks, [0.02 + d] * 9)) ** 2) for d in (0, 2e-3, 4e-3)]
    assert sums == sorted(sums)
    assert np.abs(overview(data, other)).max() > 5  # half as many events


def test_the_onset_ends_before_the_first_large_event():
    data = table(np.linspace(0.1, 0.8, 8), [0.01, 0.01, 0.012, 0.019, 0.1, 0.02, 0.1, 0.1])
    assert len(onset(data)) == 4
    assert len(onset(data.iloc[4:])) == 4  # no event is before the first large one


# --- fits ----------------------------------------------------------------------------------------


def test_known_parameters_are_found_within_their_intervals(monkeypatch):
    monkeypatch.setattr(fits, "STARTS", 2)
    bounds = {"mu_s": (0.6, 0.8), "mu_k": (0.35, 0.55)}
    said = []
    found = pyfric.fit(SCENE, curve(mu_s=0.68, mu_k=0.44), bounds, progress=said.append, **STATIC)
    for name, true in (("mu_s", 0.68), ("mu_k", 0.44)):
        low, high = found.intervals[name]
        assert low - (high - low) < true < high + (high - low)
        assert abs(found.values[name] / true - 1) < 2e-3
        assert high - low < 2e-3
        profile = found.profiles[name]
        assert profile["value"].is_monotonic_increasing
        assert profile["chi2"].min() == pytest.approx(found.chi2)
    assert found.fits
    assert found.model_error == 0
    assert found.dof > 25
    assert (found.missing, found.extra) == (0, 0)
    assert found.scenes[0].law.mean.mu_k == pytest.approx(found.values["mu_k"])
    assert len(found.table) == len(events(curve(mu_s=0.68, mu_k=0.44)))
    assert "mu_k = 0.4" in str(found)
    assert any("profile of mu_k" in text for text in said)
    page = fit_page(found)
    assert set(page.tables) == {"events", "others", "profiles"}
    assert "fits" in page.caption


def test_sensors_and_machines_are_parameters_too(monkeypatch):
    monkeypatch.setattr(fits, "STARTS", 1)
    whole = curve(mu_k=0.44)
    moved = events(whole).iloc[:12]
    for name in ("peak", "valley"):
        moved[name] += 0.02
    bounds = {"mu_k": (0.4, 0.5), "offset": (-0.05, 0.05)}
    found = pyfric.fit(SCENE, moved, bounds, **STATIC)
    assert found.values["offset"] == pytest.approx(0.02, abs=2e-3)
    assert found.values["mu_k"] == pytest.approx(0.44, abs=2e-3)
    K = SCENE.driver.K
    softer = pyfric.fit(
        SCENE, events(curve(K=0.8 * K)).iloc[:12], {"K": (0.5 * K, 1.5 * K)}, **STATIC
    )
    assert softer.values["K"] == pytest.approx(0.8 * K, rel=0.02)


def test_what_does_not_tell_is_said(monkeypatch):
    """Quasi-static sequences do not depend on the mass, and the fit says so."""
    monkeypatch.setattr(fits, "STARTS", 1)
    found = pyfric.fit(SCENE, events(curve()).iloc[:9], {"M": (0.05, 0.1)}, **STATIC)
    assert np.isnan(found.intervals["M"]).all()
    assert "not determined" in str(found)


def test_a_wrong_model_is_noticed(monkeypatch):
    """No constant mu_k gives these forces at both speeds."""
    monkeypatch.setattr(fits, "STARTS", 1)
    monkeypatch.setattr(search, "WALKS", 1)
    monkeypatch.setattr(search, "FAR", 1)
    monkeypatch.setattr(fits, "known_of", known_with(wider=1, rounds=1))
    speeds = {0.304: SCENE.driver.V, 0.504: 1.5 * SCENE.driver.V}  # as if mu_k grew with V
    scenes = [SCENE.replace(V=V) for V in speeds.values()]
    two = [events(curve(seed=1, mu_k=mu_k, V=V)).iloc[:9] for mu_k, V in speeds.items()]
    found = pyfric.fit(scenes, two, {"mu_k": (0.25, 0.55)}, **STATIC)
    assert not found.fits
    assert "DOES NOT FIT" in str(found)
    assert "DOES NOT FIT" in fit_page(found).caption
    assert set(found.table["curve"]) == {1, 2}
    low, high = found.intervals["mu_k"]
    assert 0.01 < found.model_error <= profiles.POLICIES.off
    assert not low > 0.404  # halfway between both; an open end is NaN
    assert not high < 0.404


def test_intervals_assume_the_scatter_that_a_model_has_not(monkeypatch):
    monkeypatch.setattr(fits, "STARTS", 1)
    scatter = 0.008
    table = events(curve(mu_k=0.44)).iloc[:16]
    off = scatter * np.random.default_rng(1).standard_normal((2, len(table)))
    for name, by in zip(("peak", "valley"), off, strict=True):
        table[name] += by
    found = pyfric.fit(SCENE, table, {"mu_k": (0.35, 0.55)}, model_error=1e-4, **STATIC)
    assert not found.fits
    assert found.model_error == pytest.approx(scatter, rel=0.4)  # 32 forces determine it to 1/8
    low, high = found.intervals["mu_k"]
    assert low < 0.44 < high
    narrow = pyfric.fit(SCENE, events(curve(mu_k=0.44)).iloc[:16], {"mu_k": (0.35, 0.55)}, **STATIC)
    assert high - low > 3 * np.diff(narrow.intervals["mu_k"])[0]
    assert f"off by {found.model_error:.2g} F_N" in str(found)
    assert f"off by {found.model_error:.2g} F_N" in fit_page(found).caption
    given = pyfric.fit(SCENE, table, {"mu_k": (0.35, 0.55)}, model_error=scatter / 2, **STATIC)
    assert given.model_error == pytest.approx(found.model_error, rel=0.05)  # the total error


def test_intervals_end_where_a_profile_passes_the_limit():
    at = np.array([0.0, 1.0, 2.0, 3.0])
    assert _interval(at, np.array([5.0, 1.0, 1.0, 3.0]), 2.0) == (0.75, 2.5)
    low, high = _interval(at, np.array([1.0, 1.0, 1.0, 3.0]), 2.0)
    assert np.isnan(low)
    assert high == 2.5


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"vary": {}}, "vary"),
        ({"vary": {"mu_k": (0.5, 0.4)}}, "smaller one first"),
        ({"vary": {"mu_k": 0.5}}, "two bounds"),
        ({"vary": ["mu_k"]}, "names and bounds"),
        ({"vary": {"mu_x": (0.4, 0.5)}}, "did you mean 'mu_s'|mu_x = .*unknown"),
        ({"vary": {"mu_k": (0.8, 0.9)}}, "mu_k exceeds mu_s"),
        ({"vary": {"F_N": ("3 kN", "4 s")}}, "vary.F_N = '4 s': wrong unit"),
        ({"vary": {"drift": ("0 N", "1 N")}}, "vary.drift = '0 N': wrong unit"),
        ({"vary": {"side": (0, 1)}}, "vary.side = .*a number of the scene"),
        ({"vary": {"l": (2e-3, 5e-3)}}, "vary = 'l': none does: slider.L = 0.14 m: not a multiple"),
        ({"vary": {"L": ("140 mm", "0.2 m")}}, "vary = 'L': none does: .*not a multiple of l"),
        ({"vary": {"h": (5e-3, 1e-2)}}, "vary = 'h': none does: driver.h = .*not on a row"),
        ({"fidelity": "fast"}, "fidelity = 'fast'"),
        ({"measured": "curve.csv"}, "measured = 'str'.*a Curve with forces"),
        ({"measured": pd.DataFrame({"t": [1.0]})}, "it has no t_start"),
        (
            {"measured": Curve.of(t=np.arange(50.0), slip=np.arange(50.0) ** 2)},
            "a Curve with forces",
        ),
        ({"level": 1.0}, "level"),
        ({"part": "end"}, "'onset' or 'all'"),
        ({"model_error": -1.0}, "model_error"),
        ({"scene": [SCENE, SCENE]}, "scene = 2"),
        ({"scene": SCENE.replace(F_N=0.9 * SCENE.F_N)}, "F_N = .*that of the curve, 3500 N"),
    ],
)
def test_bad_arguments_are_refused(how, text):
    given = {"scene": SCENE, "measured": curve(), "vary": {"mu_k": (0.4, 0.5)}} | how
    with pytest.raises(SceneError, match=text):
        pyfric.fit(given.pop("scene"), given.pop("measured"), given.pop("vary"), **STATIC | given)


def test_curves_without_events_or_errors_are_refused():
    with pytest.raises(SceneError, match="two or more events"):
        pyfric.fit(SCENE, events(curve()).iloc[:1], {"mu_k": (0.4, 0.5)})
    with pytest.raises(SceneError, match="without errors"):
        pyfric.fit(SCENE, curve(noise=0.0), {"mu_k": (0.4, 0.5)})


@pytest.mark.parametrize(
    "vary",
    [{"driver.V": (1e-9, 1e-8)}, {"K": (1e9, 1e10)}, {"V": (1e-9, 1e-8), "offset": (-0.1, 0.1)}],
)
def test_bounds_within_which_nothing_is_compared_are_refused(vary):
    record = pyfric.simulate(SCENE, 0.4, fidelity="quasistatic")
    with pytest.raises(SceneError, match="the model has 0 of 4 events") as refused:
        pyfric.fit(SCENE, sampled(record, STEP, noise=NOISE), vary, **STATIC)
    assert "\n" not in str(refused.value)


def test_as_many_parameters_as_numbers_are_refused_before_a_run(monkeypatch):
    monkeypatch.setattr(Problem, "run", lambda *given: pytest.fail("a run"))
    names = ("mu_s", "mu_k", "K", "k", "V", "F_N", "M", "eta", "g", "k_f")
    vary = {name: (0.4, 0.5) for name in names}
    data = events(curve()).iloc[:2]
    how = STATIC | {"part": "onset"}
    with pytest.raises(SceneError, match="8 numbers were measured; allowed: fewer than 8"):
        pyfric.fit(SCENE, data, vary, **how)
    with pytest.raises(SceneError, match="2 numbers were measured"):
        pyfric.fit(SCENE, None, dict(list(vary.items())[:2]), lengths=LENGTHS, t_end=1.0, **how)


def test_bounds_may_be_text_with_units(monkeypatch):
    seen = []

    def stop(self, starts):
        seen.append((self.names, self.low.tolist(), self.high.tolist()))
        raise SceneError("here", 1, "", "", "")

    monkeypatch.setattr(Problem, "check", stop)
    vary = {"F_N": ("3 kN", "4 kN"), "V": (1e-4, "1 mm/s"), "drift": ("0 1/s", 0.1)}
    with pytest.raises(SceneError, match="here"):
        pyfric.fit(SCENE, curve(), vary, **STATIC)
    assert seen == [(["F_N", "V", "drift"], [3000.0, 1e-4, 0.0], [4000.0, 1e-3, 0.1])]


def test_why_no_parameters_have_a_run_is_said(monkeypatch):
    def failing(self, scene, n):
        raise SceneError("a_field", 1.0, "", "another")

    monkeypatch.setattr(Problem, "run", failing)
    with pytest.raises(SceneError, match=r"vary = 'mu_k'.*the last: a_field = 1.0"):
        pyfric.fit(SCENE, curve(), {"mu_k": (0.4, 0.5)})


# --- sensitivity ---------------------------------------------------------------------------------


def test_sensitivities_are_differences_of_runs():
    found = pyfric.sensitivity(SCENE, T_END, {"mu_k": 0.01, "K": "5 %"})
    table = found.table.set_index(["parameter", "quantity"])
    assert set(found.table["quantity"]) == set(QUANTITIES)
    row = table.loc[("mu_k", "largest_force")]
    for end, mu_k in (("low", 0.44), ("base", 0.45), ("high", 0.46)):
        record = pyfric.simulate(SCENE.replace(mu_k=mu_k), T_END, fidelity="quasistatic")
        main = record.events[record.events["is_main"]]
        assert row[end] == pytest.approx(main["F_T_start"].max() / SCENE.F_N)
    assert table.loc[("K", "largest_force"), "step"] == pytest.approx(0.05 * SCENE.driver.K)
    assert np.isnan(table.loc[("K", "front_speed"), "base"])
    assert "a jump" in str(found)
    picture = tornado(found)
    assert picture.tables["sensitivity"] is found.table
    for steps, text in (
        ({"mu_x": 0.1}, "no number"),
        ({"K": "5"}, "missing unit"),
        ({"mu_k": "x %"}, "not a number"),
        ({"mu_k": -0.1}, "steps.mu_k"),
    ):
        with pytest.raises(SceneError, match=text):
            pyfric.sensitivity(SCENE, T_END, steps)


def as_found(J, base=1.0):
    """Return sensitivities whose half differences over steps are J (quantity, parameter)."""
    rows = [
        {"parameter": name, "value": 2.0, "step": 0.1, "quantity": quantity}
        | {"low": base - 0.1 * slope, "base": base, "high": base + 0.1 * slope}
        for name, slopes in J.items()
        for quantity, slope in slopes.items()
    ]
    return Sensitivity(table=pd.DataFrame(rows), scene=SCENE)


def test_what_is_known_alone_and_with_the_others_free():
    """Errors are those of least squares, by hand."""
    quantities = ("first_force", "largest_force", "recurrence", "precursors")
    slopes = {"a": (3.0, 4.0, 0.0, 50.0), "b": (4.0, 3.0, 0.0, 0.0), "c": (0.0, 0.0, 2.0, 0.0)}
    J = {name: dict(zip(quantities, values, strict=True)) for name, values in slopes.items()}
    found = as_found(J).known(1e-3).set_index("parameter")
    np.testing.assert_allclose(found["alone"], [1e-4, 1e-4, 2.5e-4])  # 1e-3/5/2, 1e-3/2/2
    # the determinant of [[3, 4], [4, 3]] is -7: a = (-3 f + 4 l)/7
    np.testing.assert_allclose(found["others_free"], [5e-4 * 5 / 7, 5e-4 * 5 / 7, 2.5e-4])
    two = as_found(J | {"d": J["a"]}).known().set_index("parameter")
    np.testing.assert_array_equal(np.isinf(two["others_free"]), [True, False, False, True])
    none = as_found(J | {"d": dict.fromkeys(quantities, 0.0)}).known().set_index("parameter")
    assert np.isinf(none.loc["d"]).all()
    np.testing.assert_allclose(none.loc["a"], found.loc["a"])
    with pytest.raises(SceneError, match="noise"):
        as_found(J).known(0.0)


def test_a_curve_tells_a_parameter_alone_better_than_with_others():
    steps = {"mu_s": 0.01, "mu_k": 0.01, "K": "5 %", "k_f": "5 %"}
    found = pyfric.sensitivity(SCENE, T_END, steps)
    known = found.known().set_index("parameter")
    assert (known["others_free"] > 3 * known["alone"]).all()
    assert "with the others free" in str(found)


# --- commands, and the stored study --------------------------------------------------------------


def test_commands_say_what_is_wrong_and_draw(tmp_path):
    data, stem = tmp_path / "curve.csv", str(tmp_path / "a")
    short = curve().table.iloc[:600]
    short.rename(columns={"t": "time_s", "F_T": "F_T (N)"}).to_csv(data, index=False)
    line = ["fit", "fig1", str(data), "--set", "l=5 mm", "--out", stem]
    for more, text in (
        (["--vary", "mu_k"], "write NAME=LOW:HIGH"),
        (["--vary", "mu_k=0.4"], "write NAME=LOW:HIGH"),
        (["--vary", "mu_k=0.4:0.5", "--column", "force"], "write MEANING=NAME"),
        (["--vary", "mu_k=0.4:0.5", "--unit", "t=ms"], "it differs"),
        (["--vary", "mu_k=0.4:0.5", "--unit", "load_point=m"], "--normal: missing"),
        (["--vary", "mu_k=0.4:0.5", "--calibration", "F_T=1 N@a"], "write MEANING=QUANTITY"),
        (["--vary", "mu_k=0.4:0.5", "--calibration", "F_T=1 m"], "--calibration F_T"),
        (["--vary", "mu_k=0.4:0.5", "--valid", "F_T=5"], "write MEANING=LOW:HIGH"),
        (["--vary", "mu_k=0.4:0.5", "--wrap", "F_T=x"], "write MEANING=PERIOD"),
        (["--vary", "mu_k=0.4:0.5", "--restarts", "all", "--unit", "load_point=m"], "not start"),
    ):
        done = CliRunner().invoke(main, [*line, *more])
        assert (done.exit_code, text in done.output) == (2, True), done.output
    line = ["sensitivity", "fig1", "--set", "l=5 mm", "--t-end", "0.4 s", "--out", stem]
    assert CliRunner().invoke(main, [*line, "--step", "mu_k=x"]).exit_code == 2
    done = CliRunner().invoke(main, [*line, "--step", "mu_k=2%", "--json"])
    rows = json.loads(done.stdout)
    assert {row["parameter"] for row in rows} == {"mu_k"}
    assert (tmp_path / "a.png").exists()


def test_the_command_reads_files_as_python_does(tmp_path, monkeypatch):
    """The file has numbers in bits, a line at the top, decimal commas, and no times."""
    data, seen = tmp_path / "curve.csv", []
    data.write_text("1,2,3\nN;F_T\n" + "".join(f"{k % 3};2048,{k}\n" for k in range(6)))
    told = [f"--column={pair}" for pair in ("t=1", "F_T=F_T")]
    told += ["--unit=t=ms", "--calibration=F_T=2 N @ 2048", "--head=1", "--decimal=,"]

    def stop(scene, measured, vary, **how):
        seen.append(measured)
        raise SceneError("here", 1, "", "", "")

    monkeypatch.setattr(pyfric, "fit", stop)
    line = ["fit", "fig1", str(data), "--vary=mu_k=0.4:0.5", "--normal=1 N", f"--out={tmp_path}/a"]
    for more in ([*told, "--restarts=2"], [*told[1:], "--step=1 ms"]):
        done = CliRunner().invoke(main, [*line, *more])
        assert (done.exit_code, "here" in done.output) == (2, True), done.output
    np.testing.assert_allclose(seen[0].t, (0, 1e-3, 2e-3))
    np.testing.assert_allclose(seen[0].over_F_N, (0.6, 0.8, 1.0), rtol=1e-9)
    np.testing.assert_allclose(seen[1].t, 1e-3 * np.arange(6))
    np.testing.assert_allclose(seen[1].over_F_N, 0.2 * np.arange(6), rtol=1e-9, atol=1e-12)
    data.write_text("time (s),mu,slip (um)\n0,0.1,8\n1,OVLD,2\n2,9,6\n3,0.4,0\n")
    more = ["--gap=OVLD", "--wrap=slip=10", "--valid=mu=0:1"]
    assert CliRunner().invoke(main, [*line[:4], *more, f"--out={tmp_path}/a"]).exit_code == 2
    np.testing.assert_allclose(seen[-1].table["mu"], (0.1, np.nan, np.nan, 0.4))
    np.testing.assert_allclose(seen[-1].table["slip"], (8e-6, 12e-6, 16e-6, 20e-6))


STORED = Path(__file__).parents[1] / "reference_data" / "fits" / "fits.csv"


def test_stored_fits_find_their_truths():
    table = pd.read_csv(STORED)
    right = table[table["set"] == "right"]
    assert ((right["mu_k"] / right["mu_k_true"] - 1).abs() < 0.01).all()
    assert (right["probability"] > 1e-3).all()
    for name in ("mu_s", "mu_k"):
        assert ((right[name] / right[f"{name}_true"] - 1).abs() < 2e-3).all()
    assert (table.loc[table["set"] != "right", "probability"] < 0.01).all()
    assert "90 % intervals cover" in study.report(table)


def test_errors_of_events_are_a_tenth_too_small():
    """Errors of fits exceed their covariance by a tenth; two stored fits are made again."""
    stored = pd.read_csv(STORED.parent / "pulls.csv")
    again = study.pulls(range(1), 2, say=lambda text: None)
    np.testing.assert_allclose(again, stored.iloc[:2], rtol=1e-3, atol=1e-3)
    for name in ("mu_s", "mu_k"):  # 1600 fits: the error of a variance is 0.04
        assert 1.0 < stored[name].var() < 1.3
        assert abs(stored[name].mean()) < 0.15
    assert 2.0 < stored["lowers"].mean() < 2.5  # for two parameters
    assert "draw all: 1600 truths" in study.report_of_pulls(stored)


@pytest.mark.slow
def test_a_stored_fit_is_made_again():
    known = pd.read_csv(STORED).sort_values("runs").set_index(["set", "seed"])
    row, known = study._row(*known.index[0]), known.iloc[0]  # the cheapest
    for name in ("mu_s_true", "mu_k_true", "mu_s", "mu_k", "chi2"):
        assert row[name] == pytest.approx(known[name], rel=1e-4)


# --- lengths and arrivals ------------------------------------------------------------------------


def test_lengths_are_compared_as_a_curve():
    model = pd.DataFrame({"force": [0.0, 0.2, 0.4], "L_p_over_L": [0.0, 0.2, 1.0]})
    data = pd.DataFrame({"force": [0.1, 0.3], "L_p_over_L": [0.08, 0.6], "error": 0.01})
    spacing = 0.04
    error = np.hypot(0.01, spacing)
    np.testing.assert_allclose(lengths_off(data, model, spacing), [0.02 / error, 0], atol=1e-12)
    error = np.hypot(error, (0.52 / 0.2) * 0.005)
    off = lengths_off(data, model, spacing, tolerance=0.005)
    np.testing.assert_allclose(off, [0.02 / error, 0], atol=1e-12)


def test_the_curve_of_lengths_ends_with_the_whole_interface():
    record = pyfric.simulate(SCENE, T_END, fidelity="quasistatic")
    found, known = lengths_of(record), pyfric.analysis.precursor_lengths(record)
    first = pyfric.analysis.system_size_events(record)["event"].iloc[0]
    assert found["force"].is_monotonic_increasing
    assert found["force"].iloc[-1] == record.events["F_T_start"].loc[first] / SCENE.F_N
    np.testing.assert_array_equal(found["L_p_over_L"], [0, *known["L_p_over_L"], 1])
    data = known.iloc[:-1].assign(error=0.01)
    assert np.abs(lengths_off(data, found, 1 / SCENE.N_x)).max() < 0.1


def test_arrivals_are_compared_within_an_event():
    l, times = 0.01, np.array([0.0, 1.0, 3.0, np.nan]) * 1e-5
    data = pd.DataFrame({"event": [1, 1, 1, 2], "x": [0.0, 0.015, 0.03, 0.0], "error": 1e-6})
    data["t"] = [5.0, 5.00002, 5.00005, 7.0]  # with another zero of time
    off = arrivals_off(data, {1: 0.5}, {0.5: times}, l)
    np.testing.assert_allclose(off[:2], 0, atol=1e-6)  # 20 us apart in both
    np.testing.assert_array_equal(off[2:], CAP)  # no front; no partner
    later = data.assign(t=data["t"] + np.array([0, 4e-6, 0, 0]))
    off = arrivals_off(later, {1: 0.5}, {0.5: times}, l)
    np.testing.assert_allclose(off[:2], [2, -2], rtol=1e-3)


def test_lengths_alone_tell_mu_k_and_leave_mu_s_open(monkeypatch):
    """mu_s needs forces at the start and end of events, as in the fit of a curve."""
    monkeypatch.setattr(fits, "STARTS", 1)
    monkeypatch.setattr(fits, "known_of", known_with(across=2))
    record = pyfric.simulate(SCENE.replace(mu_s=0.68, mu_k=0.43), 0.9, fidelity="quasistatic")
    lengths = pyfric.analysis.precursor_lengths(record).assign(error=0.02)
    bounds = {"mu_s": (0.55, 0.85), "mu_k": (0.3, 0.6)}
    how = {"lengths": lengths, "t_end": "0.9 s", "fidelity": "quasistatic"}
    found = pyfric.fit(SCENE, None, bounds, **how)
    assert found.fits
    assert abs(found.values["mu_k"] - 0.43) < 0.02
    ends = {
        name: [bounds[name][k] if np.isnan(end) else end for k, end in enumerate(pair)]
        for name, pair in found.intervals.items()
    }
    assert np.ptp(ends["mu_k"]) < 0.1
    assert ends["mu_k"][0] < 0.43 < ends["mu_k"][1]
    assert np.ptp(ends["mu_s"]) > 0.2
    assert f"{len(lengths)} lengths" in str(found)
    assert "L_p/L" in fit_page(found).axes[0].get_ylabel()


def test_lengths_and_arrivals_are_residuals_of_a_fit():
    """Residuals are as small as noise only near the true parameters."""
    record = pyfric.simulate(SCENE, 0.5, fidelity="hybrid", progress=False)
    data = sampled(record, STEP, noise=NOISE)
    lengths = pyfric.analysis.precursor_lengths(record).assign(error=0.02)
    table = events(data)
    own = record.events["t_start"].to_numpy()
    rows = []
    for event in table.index[:2]:
        k = int(np.argmin(np.abs(own - table["t_start"].loc[event])))
        times = record.rupture_times[k]
        at = np.flatnonzero(np.isfinite(times))
        rows += [(event, SCENE.slider.l * n, times[n], 2e-6) for n in at]
    arrivals = pd.DataFrame(rows, columns=["event", "x", "t", "error"])
    assert len(arrivals) > 4
    own = Events(table, "all")
    what = own + Lengths(lengths) + Arrivals(arrivals, own)
    problem = Problem(
        [SCENE], [what], {"mu_k": (0.4, 0.5)}, {"fidelity": "hybrid", "progress": False}, 0.0
    )
    truth, off = np.array([0.5]), np.array([0.2])
    residuals = problem.residuals(truth)
    assert len(residuals) == problem.size
    of_fronts = residuals[-len(arrivals) - len(lengths) :]
    assert np.abs(of_fronts).max() < 1e-3
    assert problem.chi2(truth) < 2 * len(residuals)
    assert problem.chi2(off) > 10 * problem.chi2(truth)
    assert np.abs(problem.residuals(off)[-len(arrivals) :]).max() > 1


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"measured": None}, "a curve, or lengths alone"),
        ({"measured": None, "lengths": LENGTHS}, "t_end"),
        ({"lengths": LENGTHS, "t_end": 1.0}, "the curve tells it"),
        ({"lengths": LENGTHS.drop(columns="error")}, "lengths = 'no error'.*L_p_over_L"),
        ({"lengths": LENGTHS.assign(error=0.0)}, "errors > 0"),
        ({"lengths": [LENGTHS, LENGTHS]}, "lengths = 2"),
        ({"arrivals": ARRIVED}, "it has no arrivals.*'hybrid' or 'dynamic'"),
        ({"arrivals": ARRIVED.assign(event=99), "fidelity": "hybrid"}, "no such event"),
    ],
)
def test_bad_lengths_and_arrivals_are_refused(how, text):
    given = {"scene": SCENE, "measured": curve(), "vary": {"mu_k": (0.4, 0.5)}} | how
    with pytest.raises(SceneError, match=text):
        pyfric.fit(given.pop("scene"), given.pop("measured"), given.pop("vary"), **STATIC | given)


@pytest.mark.parametrize("slope", [0.0, -5.0])
def test_others_are_found_beside_jumps_of_the_model(slope):
    """Derivatives predict the second parameter; beyond a jump, residuals do not."""

    def residuals(u):
        return np.array(
            [100 * (u[0] - 0.3), np.clip(100 * (u[1] - 0.5 - slope * (u[0] - 0.3)), -2, 2)]
        )

    jacobian = np.array([[100.0, 0.0], [500.0, 100.0]])
    problem = SimpleNamespace(residuals=residuals, smooth=False)
    found, chi2 = search.least_of_others(problem, np.array([0.3, 0.5]), jacobian, 0, 0.31)
    np.testing.assert_allclose(found, [0.31, 0.5 + 0.01 * slope], rtol=0, atol=1e-12)
    assert chi2 == pytest.approx(1.0)


def cut_valley(slope, ahead):
    """Return a problem whose narrow valley is cut obliquely by a jump of the model."""

    def residuals(u):
        a, b = u
        jump = 3.0 * (a - 0.5 - slope * (b - 0.5) > ahead)
        return np.array([(a - b) / 0.004, (a + b - 1) / 0.04, jump])

    return SimpleNamespace(
        residuals=residuals,
        chi2=lambda u: float(residuals(u) @ residuals(u)),
        names=["a", "b"],
        low=np.zeros(2),
        high=np.ones(2),
        smooth=False,
        dof=lambda u: 1,
    )


def test_intervals_go_on_along_jumps_of_the_model():
    """Intervals hold all points within the limit on a fine grid, except for thin tips."""
    places = np.meshgrid(*[np.linspace(0.4, 0.6, 1001)] * 2, indexing="ij")
    short = {}
    for slope, ahead in itertools.product((0.8, 0.85, 0.9, 0.95), (0.0, 5e-4, 1e-3)):
        problem = cut_valley(slope, ahead)
        residuals = problem.residuals(np.array(places))
        for misses in (0, profiles.POLICIES.misses):
            policies = profiles.Policies(misses=misses)
            start = np.array([0.5, 0.5])
            found, _, intervals = profiles.profiled(problem, start, 0.9, lambda _: None, policies)
            jumps = search.derivatives(problem, found)[1]
            limit = problem.chi2(found) + stats.chi2.ppf(0.9, 1) * (1 + jumps)
            inside = (residuals**2).sum(axis=0) <= limit
            for name, values in zip(problem.names, places, strict=True):
                exact = values[inside].min(), values[inside].max()
                off = np.abs(np.subtract(intervals[name], exact)) / np.ptp(exact)
                assert intervals[name][1] - exact[1] < 0.02 * np.ptp(exact)
                short.setdefault(misses, []).append(off.max())
    without, ends = (np.array(each) for each in short.values())
    assert (ends <= without + 1e-9).all()
    assert ends.mean() < 0.6 * without.mean()
    assert ends.max() < 0.12
