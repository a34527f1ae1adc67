"""Analysis of hand-made records whose answers are known exactly, and of one real run."""

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import refused

import pyfric
from pyfric import SceneError, core
from pyfric.record import (
    QUIET_COLUMNS,
    SWITCH_COLUMNS,
    Method,
    Record,
    analysis,
    front_speed,
    held_in,
)
from pyfric.record.zones import zone_at_rest, zone_moving
from pyfric.scene import LAWS, setup1

F_N, N, L_BLOCK = 1000.0, 11, 2.5e-3
MU_S, MU_K = 0.75, 0.5
UNIT = F_N / N

EVENTS = (
    # n_blocks, reached, finished, F_T_start, F_T_arrest
    (5, 5, True, 100.0, 90.0),
    (1, 1, True, 120.0, 119.0),  # micro-slip
    (6, 0, True, 200.0, 190.0),  # away from the trailing edge
    (8, 8, True, 300.0, 280.0),
    (11, 11, True, 400.0, 240.0),
    (4, 4, True, 350.0, 340.0),  # after the first system-size event
    (11, 11, True, 420.0, 250.0),
    (9, 9, False, 410.0, np.nan),
)
T_START = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])


def nothing(group, rows):
    """Return the columns of a table, all zero."""
    known = held_in(group).items()
    return {name: np.zeros(rows, held.dtype) for name, held in known if held.required}


def made_up(side="left", mu_s=MU_S, events=EVENTS, speed=500.0, d_c=0.0):
    """Event e ruptures blocks 1 ... reached at `speed`; block n has tau/p = 0.5 + n/100 before."""
    size = {"L": (N - 1) * L_BLOCK, "H": 5e-3, "h": 2.5e-3}
    scene = setup1(**size, F_N=F_N, mu_s=mu_s, mu_k=MU_K, side=side, d_c=d_c)
    column = np.argsort(scene.n_of_i)  # column of block n = 1 ... N
    count = len(events)
    n = np.arange(1, N + 1)
    blocks, reached, finished, F_start, F_arrest = (np.array(x) for x in zip(*events, strict=True))
    p = UNIT * (1 + 0.1 * n)

    def by_column(rows):
        table = np.empty_like(rows)
        table[..., column] = rows
        return table

    inside = n <= reached[:, None]
    times = np.where(inside, T_START[:count, None] + (n - 1) * L_BLOCK / speed, np.nan)
    p_before = np.tile(p, (count, 1))
    p_before[:, 2] = 0.0  # block 3 is open
    tau_before = p_before * (0.5 + n / 100)
    p_after = np.where(inside, 0.75 * p, p) * np.where(finished, 1.0, np.nan)[:, None]
    table = nothing("events", count) | {
        "t_start": T_START[:count],
        "t_stop": T_START[:count] + 1e-3,
        "F_T_start": F_start,
        "F_T_arrest": F_arrest,
        "L_p_over_L": reached / N,
        "n_blocks": blocks,
        "finished": finished,
        "is_precursor": (reached > 0) & (reached < N),
        "is_main": blocks >= 4,
    }
    by_block = {
        "region": inside.astype(np.int8),
        "rupture_times": times,
        "tau_before": tau_before,
        "p_before": p_before,
        "tau_after": MU_K * p_after,
        "p_after": p_after,
    }
    arrays = {name: by_column(rows) for name, rows in by_block.items()}
    speeds = front_speed(arrays["rupture_times"], L_BLOCK, scene.d)
    at_rest = zone_at_rest(scene, arrays["p_before"])
    at_rest[np.isnan(arrays["rupture_times"])] = np.nan
    moving = zone_moving(scene, arrays["p_before"], speeds)
    t = np.linspace(0, 8, 801)
    quiet = {
        k: np.zeros((0, N) if k in ("u_x", "mode") else 0, v) for k, v in QUIET_COLUMNS.items()
    }
    return Record(
        scene=scene,
        method=Method(engine="made up", geometry="linear"),
        curve=pd.DataFrame({"t": t, "F_T": 50.0 * t}),
        events=pd.DataFrame(table),
        episodes=pd.DataFrame(nothing("episodes", 0)),
        arrays=arrays | {"X_c0_over_l": at_rest, "X_c_over_l": moving},
        tau_initial=by_column(UNIT * (n - 6.0)),
        p_initial=by_column(p),
        quiet=quiet,
        switches={k: np.zeros(0, v) for k, v in SWITCH_COLUMNS.items()},
    )


@pytest.fixture(scope="module", params=["left", "right"])
def record(request):
    return made_up(request.param)


# --- events --------------------------------------------------------------------------------------


def test_precursors_are_finished_main_events_short_of_the_whole(record):
    table = analysis.precursors(record)
    assert table["event"].tolist() == [1, 4, 6]
    assert table["force_start"].tolist() == [0.1, 0.3, 0.35]
    assert table["force_arrest"].tolist() == [0.09, 0.28, 0.34]
    assert set(record.events) < set(table)
    assert analysis.system_size_events(record)["event"].tolist() == [5, 7]


def test_lengths_are_those_of_the_first_loading(record):
    table = analysis.precursor_lengths(record)
    assert list(table) == ["event", "force", "L_p_over_L"]
    assert table["event"].tolist() == [1, 4]
    assert table["force"].tolist() == [0.09, 0.28]
    assert table["L_p_over_L"].tolist() == [5 / N, 8 / N]
    cut = analysis.precursor_lengths(made_up(events=EVENTS[:2]))
    assert cut["event"].tolist() == [1]


# --- stresses ------------------------------------------------------------------------------------


def test_profile_of_the_loaded_slider(record):
    table = analysis.stress_profile(record)
    n = np.arange(1, N + 1)
    assert table["n"].tolist() == n.tolist()
    np.testing.assert_allclose(table["x_over_L"], (n - 1) / 10, rtol=1e-15)
    np.testing.assert_allclose(table["tau"], n - 6.0, rtol=1e-15)
    np.testing.assert_allclose(table["p"], 1 + 0.1 * n, rtol=1e-15)
    np.testing.assert_array_equal(table["p_over_p_initial"], 1.0)
    assert not table["region"].any()


def test_profile_before_and_after_an_event(record):
    n = np.arange(1, N + 1)
    before = analysis.stress_profile(record, 4)
    shut = n != 3
    np.testing.assert_allclose(before["tau_over_p"][shut], 0.5 + n[shut] / 100, rtol=1e-14)
    np.testing.assert_allclose(before["scaled"][shut], n[shut] / 25, rtol=1e-12)
    assert before["p_over_p_initial"].tolist() == np.where(shut, 1.0, 0.0).tolist()
    assert before[["tau_over_p", "scaled"]][~shut].isna().all(axis=None)
    after = analysis.stress_profile(record, 4, "after")
    np.testing.assert_allclose(after["scaled"], 0.0, atol=1e-14)
    np.testing.assert_allclose(after["p_over_p_initial"], np.where(n <= 8, 0.75, 1.0), rtol=1e-14)
    np.testing.assert_array_equal(after["region"], n <= 8)


def test_equal_coefficients_leave_no_scaled_prestress():
    record = made_up(mu_s=MU_K)
    assert analysis.stress_profile(record)["scaled"].isna().all()
    assert np.isnan(analysis.friction_coefficients(record).R)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ((9,), "event"),
        ((0,), "event"),
        ((-1,), "event"),
        ((1.0,), "event"),
        ((True,), "event"),
        ((1, "during"), "when"),
        ((8, "after"), "event"),  # not finished
    ],
)
def test_states_that_do_not_exist_are_refused(arguments, field):
    with pytest.raises(SceneError) as refused:
        analysis.stress_profile(made_up(), *arguments)
    assert refused.value.field == field
    assert refused.value.value == arguments[field == "when"]


# --- fronts --------------------------------------------------------------------------------------


def test_front_has_the_speed_it_was_made_with(record):
    table = analysis.front(record, np.int64(4))
    assert table["n"].tolist() == list(range(1, 9))
    assert table["v_c"].isna().tolist() == [True, True, False, False, False, False, True, True]
    np.testing.assert_allclose(table["v_c"][2:6], 500.0, rtol=1e-9)
    np.testing.assert_allclose(table["t"], 3.0 + np.arange(8) * 5e-6, rtol=1e-15)
    np.testing.assert_allclose(table["scaled"][3:], np.arange(4, 9) / 25, rtol=1e-12)
    assert np.isnan(table["tau_over_p"][2])


def test_fronts_are_those_of_all_finished_main_events(record):
    table = analysis.fronts(record)
    assert table["event"].unique().tolist() == [1, 4, 5, 6, 7]
    pd.testing.assert_frame_equal(
        table[table["event"] == 5].drop(columns="event").reset_index(drop=True),
        analysis.front(record, 5),
    )
    none = analysis.fronts(made_up(events=EVENTS[1:2]))
    assert list(none) == list(table)
    assert none.empty


@pytest.mark.parametrize("event", [99, None, "3"])
def test_fronts_of_no_event_are_refused(event):
    with pytest.raises(SceneError, match="event"):
        analysis.front(made_up(), event)


# --- numbers -------------------------------------------------------------------------------------


def test_friction_of_the_whole_slider(record):
    found = analysis.friction_coefficients(record)
    assert found.mu_s_macro == pytest.approx(0.42, rel=1e-15)
    assert found.mu_k_macro == pytest.approx(0.05 * 5.0, rel=1e-12)  # mean of 0.05 t over 4 ... 6 s
    assert found.R == pytest.approx((0.42 - 0.5) / 0.25, rel=1e-12)
    once = analysis.friction_coefficients(made_up(events=EVENTS[:5]))
    assert once.mu_s_macro == pytest.approx(0.4, rel=1e-15)
    assert np.isnan(once.mu_k_macro)


def test_kinetic_friction_is_the_mean_of_the_whole_curve(record):
    """The curve is a line with triangles of 20 N, and of other heights before and after."""
    t = record.curve["t"]
    bent = record.curve["F_T"] + np.select([t < 4, t <= 6], [7.0, 20.0], -30.0) * (
        1 - abs(t % 2 - 1)
    )
    bent = dataclasses.replace(record, curve=record.curve.assign(F_T=bent))
    here, there = (analysis.friction_coefficients(one).mu_k_macro for one in (bent, record))
    assert here - there == pytest.approx(20.0 / 2 / F_N, rel=1e-3)


def test_friction_coefficients_take_the_load_of_the_time():
    """Twice the load and twice the force, from before the first event on, change nothing."""
    record = made_up()
    events = record.events.assign(F_T_start=2 * record.events["F_T_start"])
    curve = record.curve.assign(F_T=2 * record.curve["F_T"])
    F_N, t = record.scene.F_N, 0.5 * float(events["t_start"].iloc[0])
    scene = record.scene.replace({"top.protocol": [(t, F_N), (t, 2 * F_N)]})
    heavy = record.replace(scene=scene, events=events, curve=curve)
    plain, found = (analysis.friction_coefficients(one) for one in (record, heavy))
    np.testing.assert_allclose(found, plain, rtol=1e-12)


def test_a_driver_that_moves_back_leaves_no_mean_of_sliding(record):
    """Sliding lasts from 4 to 6 s."""
    V = record.scene.driver.V
    for t, known in ((3.0, True), (5.0, False), (7.0, True)):
        corners = [(t, V), (t, -V), (t + 0.5, -V), (t + 0.5, V)]
        scene = record.scene.replace({"driver.protocol": corners})
        found = analysis.friction_coefficients(record.replace(scene=scene))
        assert np.isfinite(found.mu_k_macro) == known


def test_numbers_that_a_run_does_not_have_are_refused():
    record = made_up()
    end = float(record.curve["t"].iloc[-1])
    for begin, until in ((0.0, 1.01 * end), (end, 0.0), (-1e-3, end), (0.0, np.nan), (None, end)):
        with pytest.raises(pyfric.SceneError, match=r"begin|end"):
            analysis.mean_force(record, begin, until)
    with pytest.raises(pyfric.SceneError, match=r"^begin = "):
        analysis.mean_force(record, 2 * end, 3 * end)
    t, F_T = (record.curve[name] for name in ("t", "F_T"))
    for largest in (-1e-3, np.nan):
        with pytest.raises(pyfric.SceneError, match="largest_shift"):
            analysis.compare_curve(record, t, F_T, largest_shift=largest)
    with pytest.raises(pyfric.SceneError, match="energies = True"):
        analysis.budget_error(record.curve)


@pytest.mark.parametrize("given", ["m.csv", Path("m.csv"), pd.DataFrame({"t": [0.0], "F": [1.0]})])
def test_a_file_or_a_table_is_no_curve(given):
    for rest in ((), (given,)):
        if rest and isinstance(given, pd.DataFrame):
            continue
        with pytest.raises(pyfric.SceneError, match=r"two arrays; pandas.read_csv reads them"):
            analysis.compare_curve(made_up(), given, *rest)


def test_every_energy_counts_in_the_budget():
    """Energy that enters is stored or lost: initially 1 J of each kind, finally other amounts."""
    stored, came = core.ENERGIES, ("work_driver", "work_load")
    lost = ("dissipated_bonds", "friction_heat", "switching_loss")
    end = {name: 1.0 + 0.5**n for n, name in enumerate((*stored, *lost))}
    end["work_load"] = 0.25
    end["work_driver"] = sum(end.values()) - len(stored) - 2 * 0.25
    start = {name: float(name in stored) for name in end}
    curve = pd.DataFrame([start, end])
    assert set(end) == {*stored, *came, *lost}
    np.testing.assert_allclose(analysis.budget_left(curve), 0.0, atol=1e-15)
    for name in end:
        wrong = curve.assign(**{name: [start[name], end[name] + 0.125]})
        np.testing.assert_allclose(abs(analysis.budget_left(wrong)), [0.0, 0.125], atol=1e-15)
    for term in {term.name: term for law in LAWS for term in law.terms}.values():
        more = curve.get(term.name, 0.0) + np.array([0.0, 0.125])
        left = analysis.budget_left(curve.assign(**{term.name: more}))
        way = {"stored": 0.125, "lost": 0.125, "given": -0.125, "part": 0.0}[term.counts]
        np.testing.assert_allclose(left, [0.0, way], atol=1e-15)
    still = 1e4 * pd.DataFrame([start, start])
    still.loc[1, stored[0]] *= 1 + 2**-50  # rounding of 1e4 J of each kind
    assert 0 < analysis.budget_error(still) < 1e-8


def test_friction_needs_sliding():
    with pytest.raises(SceneError, match="raise t_end"):
        analysis.friction_coefficients(made_up(events=EVENTS[:4]))


def test_sliding_that_goes_on_has_the_peak_of_the_force():
    """The last event, from 4 s on, has all blocks and no end; F_T of the curve falls from 5 s."""
    events = (*EVENTS[:4], (11, 11, False, 150.0, np.nan))
    going = made_up(events=events)
    with pytest.raises(SceneError, match="still rises"):
        analysis.friction_coefficients(going)
    curve = going.curve
    fallen = curve["F_T"].where(curve["t"] <= 5.0, 240.0)
    fallen[curve["t"] < 2.0] += 500.0  # before the last event
    found = analysis.friction_coefficients(going.replace(curve=curve.assign(F_T=fallen)))
    assert found.mu_s_macro == pytest.approx(0.3, rel=1e-12)  # force of an earlier event
    higher = curve["F_T"].where(curve["t"] <= 5.0, 240.0).where(curve["t"] < 4.0, lambda f: 2 * f)
    found = analysis.friction_coefficients(going.replace(curve=curve.assign(F_T=higher)))
    assert found.mu_s_macro == pytest.approx(0.5, rel=1e-12)
    assert np.isnan(found.mu_k_macro)
    assert found.R == pytest.approx(0.0, abs=1e-12)


def test_points_on_steps_have_no_spread_and_noise_has_its_own():
    x = np.repeat([1.0, 2.0, 3.0, 4.0], 10)
    curve = analysis.collapse_spread(x, np.exp(x), bins=4)
    assert curve.rms < 1e-15
    assert curve.n == 40
    np.testing.assert_allclose(curve.median, np.exp([1.0, 2.0, 3.0, 4.0]), rtol=1e-14)
    sign = np.tile([1, -1], 20)
    assert analysis.collapse_spread(x, np.exp(x + 0.1 * sign), bins=4).rms == pytest.approx(0.1)
    assert analysis.collapse_spread(x, x + 0.1 * sign, bins=4, log=False).rms == pytest.approx(0.1)
    two = np.concatenate([np.exp(x), 2 * np.exp(x)])  # two curves, ln 2 apart
    found = analysis.collapse_spread(np.tile(x, 2), two, bins=4)
    assert found.rms == pytest.approx(np.log(2) / 2)


def test_missing_points_are_left_out():
    x = np.arange(100.0)
    y = np.where(x % 2, np.nan, 3.0)
    found = analysis.collapse_spread(x, y, bins=5)
    assert (found.n, found.rms) == (50, 0.0)
    assert found.edges[0] == 0
    assert found.edges[-1] == 98


def test_bins_end_between_points():
    """The last digit of a point must not move it to another bin of a stored curve."""
    x = np.arange(101.0)  # every quantile is a point
    found = analysis.collapse_spread(x, 1 + x, bins=5)
    assert (np.abs(found.edges[1:-1, None] - x).min(axis=1) == 0.5).all()


@pytest.mark.parametrize(
    ("y", "bins", "field"),
    [(1.0, 0, "bins"), (1.0, 2.5, "bins"), (1.0, 11, "bins"), (-1.0, 2, "y"), (0.0, 2, "y")],
)
def test_too_few_points_or_no_logarithm_are_refused(y, bins, field):
    with pytest.raises(SceneError) as refused:
        analysis.collapse_spread(np.arange(50.0), y, bins=bins)
    assert refused.value.field == field


# --- a real run ----------------------------------------------------------------------------------


def test_real_run():
    """The driver's force is the sum of tau; before an event some block is at mu_s."""
    scene = pyfric.preset("fig1")
    record = pyfric.simulate(scene, 0.45, fidelity="hybrid", geometry="linear", progress=False)
    main = analysis.precursors(record)
    assert len(main) >= 4
    for row in main.itertuples():
        before = analysis.stress_profile(record, row.event)
        assert before["tau"].sum() / scene.N_x == pytest.approx(row.force_start, rel=1e-9)
        assert before["p"].sum() / scene.N_x == pytest.approx(1.0, rel=1e-9)
        # one step of the driver may pass between the last grid point and the switch
        assert before["scaled"].max() == pytest.approx(1.0, abs=2e-4)
        assert before["n"][before["scaled"].argmax()] == row.nucleation_block
        after = analysis.stress_profile(record, row.event, "after")
        reached = round(row.L_p_over_L * scene.N_x)
        assert (after["region"][:reached] > 0).all()
        assert after["region"][reached] == 0
        speeds = analysis.front(record, row.event)["v_c"].dropna()
        assert ((speeds > 100) & (speeds < 4000)).all()
    assert (np.diff(analysis.precursor_lengths(record)["L_p_over_L"]) > 0).all()
    image = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, side="right"))
    mirror = pyfric.simulate(image, 0.45, fidelity="hybrid", geometry="linear", progress=False)
    event = int(main["event"].iloc[-1])
    pd.testing.assert_frame_equal(
        analysis.front(mirror, event), analysis.front(record, event), rtol=1e-6, check_exact=False
    )


# --- beside a measurement ------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [0.0, 0.0123, -0.02])
def test_a_curve_that_is_shifted_is_found(shift):
    record = pyfric.simulate("fig1", 0.3, fidelity="quasistatic", progress=False)
    t = np.linspace(0.03, 0.27, 400)
    curve = record.curve
    noise = 5 * np.sin(1e4 * t**2)
    measured = np.interp(t, curve["t"], curve["F_T"]) + noise
    found = analysis.compare_curve(record, t - shift, measured, largest_shift=0.03)
    assert found.shift == pytest.approx(shift, abs=2e-4)
    assert found.rms_shifted == pytest.approx(np.sqrt(np.mean(noise**2)), rel=0.02)
    apart = np.interp(t - shift, curve["t"], curve["F_T"]) - measured
    assert found.rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-12)
    assert found.n == 400


def test_masked_points_are_gaps():
    """netCDF4 returns such arrays; the masked values are 1e36."""
    record = pyfric.simulate("fig1", 0.1, fidelity="quasistatic", progress=False)
    t, F_T = np.ma.masked_array(np.linspace(0, 0.1, 9)), np.ma.masked_array(np.arange(9.0))
    F_T[3], t[5] = np.ma.masked, np.ma.masked
    F_T.data[3] = t.data[5] = 1e36
    kept = [0, 1, 2, 4, 6, 7, 8]
    plain = analysis.compare_curve(record, t.data[kept], F_T.data[kept])
    assert analysis.compare_curve(record, t, F_T) == plain
    x, y = np.ma.masked_array(np.arange(1.0, 12)), np.ma.masked_array(np.arange(1.0, 12))
    plain = analysis.collapse_spread(x.data[1:], y.data[1:], bins=1)
    y[0] = np.ma.masked
    y.data[0] = 1e36
    assert analysis.collapse_spread(x, y, bins=1).rms == plain.rms


def test_curves_that_cannot_be_compared_are_refused():
    record = pyfric.simulate("fig1", 0.05, fidelity="quasistatic", progress=False)
    for t, F_T, field, text in (
        ([0.0, 0.1], [1.0], "t", "shapes do not fit"),
        ([[0.0, 0.1]], [[1.0, 2.0]], "t", "shapes do not fit"),
        ([0.1, 0.0], [1.0, 2.0], "t[1]", "finite times that increase"),
        ([0.0, 0.1, 0.1], [1.0, 2.0, 3.0], "t[2]", "finite times that increase"),
        ([0.0, np.nan], [1.0, 2.0], "t[1]", "finite times that increase"),
        ([0.0, 0.1], [np.nan, 2.0], "F_T[0]", "finite forces"),
    ):
        refused(lambda t=t, F_T=F_T: analysis.compare_curve(record, t, F_T), field, text)
    refused(
        lambda: analysis.compare_curve(record, [5.0, 5.1], [1.0, 2.0]),
        "t",
        "outside the run",
        value=5.0,
        unit="s",
    )
    refused(lambda: analysis.compare_curve(record, "abc", [1.0, 2.0]), "t", "not numbers")
    refused(lambda: analysis.compare_curve(record, [0.0, 0.1], "abc"), "F_T", "not numbers")
    early = analysis.compare_curve(record, [0.06, 0.09], [1.0, 2.0], largest_shift=0.05)
    assert np.isnan(early.rms)
    assert early.n >= 1


def test_friction_counts_the_shear_force():
    """T pulls with the driver: the slider slides when F_T + T is its friction."""
    how = {"fidelity": "quasistatic", "progress": False}
    with_T, without = (
        pyfric.analysis.friction_coefficients(
            pyfric.simulate(pyfric.setup2(l="2 mm", T=T), 0.8, **how)
        )
        for T in ("80 N", "0 N")
    )
    assert with_T.mu_k_macro == pytest.approx(without.mu_k_macro, rel=0.05)
    assert 0 <= with_T.R <= 1


def test_griffith_length_is_the_end_of_the_longest_stretch():
    table = pd.DataFrame({"G": [2.0, 0, 0, 2, 2, 2, 0, 0, 2, 0], "Gamma": 1.0})
    assert pyfric.analysis.griffith_length(table) == 0.6
    assert pyfric.analysis.griffith_length(table.assign(G=0.0)) == 0.0
    assert pyfric.analysis.griffith_length(table.assign(G=2.0)) == 1.0
