"""Measured errors: records that differ by what is known, closed forms, refinement, files."""

import dataclasses
import json
import math

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from helpers import small_rod

import pyfric
from pyfric.cli import main
from pyfric.engines import cost, verification
from pyfric.engines.cost import CHEAP, FINEST, WORTH, beside, beside_ladder, coarser_step, work
from pyfric.engines.guard import hurry
from pyfric.engines.verification import (
    COARSER,
    FAST,
    FINER,
    JUMPS,
    PERTURBATION,
    SPEEDS,
    Made,
    stretch,
    verified,
)
from pyfric.record import Errors, Record, differences, not_verified, statistics, summary
from pyfric.record.errors import UNITS
from pyfric.scene import chain, preset, setup1, slab
from pyfric.statics import stability_limit


@pytest.fixture(scope="module")
def ladder():
    return pyfric.simulate(small_rod(), 1.5, fidelity="quasistatic")


def changed(record, event, **by):
    """Return the record with numbers added to one event."""
    events = record.events
    for name, value in by.items():
        events.loc[event, name] += value
    return record.replace(events=events)


def main_events(record):
    """Return the numbers of the main events."""
    return record.events.index[record.events["is_main"]]


def without(record, events):
    """Return the record without some events, which are counted anew."""
    kept = ~record.events.index.isin(events)
    arrays = {name: array[kept] for name, array in record.arrays.items()}
    return record.replace(events=record.events[kept], arrays=arrays)


# --- comparisons ---------------------------------------------------------------------------------


def test_a_record_does_not_differ_from_itself(ladder):
    found = differences(ladder, ladder).errors()
    assert found["events"] == ladder.events["is_main"].sum() > 5
    assert [found[name] for name in ("start", "arrest", "length", "stress")] == [0, 0, 0, 0]
    assert found["rupture"] is None  # the ladder has no motion
    names = ("start", "arrest", "length", "stress")
    assert found["compared"] == dict.fromkeys(names, found["events"])
    table = differences(ladder, ladder).events
    assert (table["event"] == table["other"]).all()
    assert set(table["event"]) == set(main_events(ladder))


def test_known_differences_are_found(ladder):
    main, F_N = main_events(ladder), ladder.scene.F_N
    other = changed(ladder, main[2], F_T_start=0.01 * F_N, L_p_over_L=0.1)
    other = changed(other, main[4], F_T_arrest=-0.02 * F_N)
    tau = other.tau_after.copy()
    tau[main[1] - 1] += 0.03 * F_N / ladder.scene.N_x
    found = differences(ladder, other.replace(tau_after=tau))
    errors = found.errors()
    assert errors["start"] == pytest.approx(0.01)
    assert errors["arrest"] == pytest.approx(0.02)
    assert errors["length"] == pytest.approx(0.1)
    assert errors["stress"] == pytest.approx(0.03)
    starts = ladder.events["t_start"]
    assert found.parted(0.005) == starts[main[2]]
    assert found.parted(0.015) == starts[main[4]]
    assert found.parted(0.025) is None
    assert found.before(starts[main[2]]).errors()["start"] == 0


def test_front_speeds_are_relative_and_lost_ones_count(ladder):
    """Times stretched by 5 % make speeds 5 % slower; a front that is not there is all wrong."""
    times = ladder.rupture_times
    e = int(np.argmax(np.isfinite(times).sum(axis=1)))
    front = np.full(times.shape, np.nan)
    front[e, ladder.scene.n_of_i - 1] = 1e-6 * np.arange(ladder.scene.N_x)
    one, slow, none = (
        ladder.replace(rupture_times=t) for t in (front, 1.05 * front, np.full(times.shape, np.nan))
    )
    found = differences(slow, one).errors()
    assert found["speed_median"] == pytest.approx(1 - 1 / 1.05)
    assert found["speed_worst"] == pytest.approx(1 - 1 / 1.05)
    assert differences(none, one).errors()["speed_95"] == 1.0
    assert differences(none, none).errors()["speed_95"] is None


def test_an_event_after_the_end_is_compared_with_the_force_there(ladder):
    """A run that ends just before its last event is not a run without it."""
    main = main_events(ladder)
    t = float(ladder.events["t_start"][main[-1]])
    short = pyfric.simulate(ladder.scene, t - 1e-6, fidelity="quasistatic")
    assert differences(short, ladder).errors()["start"] < 1e-6
    late = changed(ladder, main[-1], t_start=-2e-6)  # the other one has it just before
    assert differences(late, short).errors()["start"] < 1e-4


def test_an_event_begun_while_the_last_one_goes_on_is_part_of_it(ladder):
    """Two runs of which one sees a pause inside its last event: nothing to compare."""
    main = main_events(ladder)
    fewer = without(ladder, range(main[-2] + 1, len(ladder.events) + 1))
    assert differences(ladder, fewer).errors()["start"] > 1e-3
    events = fewer.events
    events.loc[main[-2], "finished"] = False
    assert differences(ladder, fewer.replace(events=events)).errors()["start"] == 0


@pytest.mark.parametrize("parts", [False, True])
def test_an_event_that_goes_on_is_compared_by_its_force(ladder, parts):
    """Two runs that part inside their last event, which a pause may part in one of them."""
    last, F_N = main_events(ladder)[-2:], ladder.scene.F_N
    one = on = going_on(without(ladder, range(last[0] + 1, len(ladder.events) + 1)), last[0])
    if parts:
        one = going_on(ladder, last[1])
    events = ladder.events
    t, force = (ladder.curve[name].to_numpy() for name in ("t", "F_T"))
    between = 0.5 * (t[1:] + t[:-1])
    other = dataclasses.replace(on, curve=resampled(on, between, np.interp(between, t, force)))
    assert differences(one, other).errors()["arrest"] == 0  # other samples of the same motion
    late = force + np.where(t > events["t_start"][last[1]], 0.1 * F_N, 0.0)
    other = dataclasses.replace(on, curve=resampled(on, t, late))
    assert 0.08 < differences(one, other).errors()["arrest"] <= 0.1


def going_on(record, event):
    """Return the record with an event that goes on at its end."""
    events = record.events
    events.loc[event, "t_stop"], events.loc[event, "finished"] = np.nan, False
    return record.replace(events=events)


def resampled(record, t, force):
    """Return the loading curve with other samples."""
    return record.curve.iloc[: len(t)].assign(t=t, F_T=force)


def test_runs_without_slip_are_compared_by_their_loading_curves(ladder):
    t = float(ladder.events["t_start"].iloc[0])
    one = pyfric.simulate(ladder.scene, 0.9 * t, fidelity="quasistatic")
    assert not len(one.events)
    off = one.curve.assign(F_T=one.curve["F_T"] * 1.5)
    found = differences(one, one.replace(curve=off)).errors()
    assert found["arrest"] == pytest.approx(0, abs=1e-12)  # two samples, with anything between
    fine = resampled_at(one, np.linspace(0, one.curve["t"].iloc[-1], 100))
    off = fine.replace(curve=fine.curve.assign(F_T=fine.curve["F_T"] * 1.5))
    found = differences(fine, off).errors()
    assert found["events"] == 0
    assert found["start"] is None
    assert found["arrest"] == pytest.approx(0.5 * fine.curve["F_T"].max() / one.scene.F_N, rel=0.1)
    assert (
        Errors(want="precursors", tolerance=0.1, **differences(fine, fine).errors()).holds is True
    )


def resampled_at(record, t):
    """Return a record whose loading curve has samples at these times, s."""
    known = record.curve
    force = np.interp(t, known["t"], known["F_T"])
    return record.replace(curve=pd.DataFrame({"t": t, "F_T": force}))


def test_statistics_of_what_follows(ladder):
    main = ladder.events[ladder.events["is_main"]]
    t = float(main["t_start"].iloc[2])
    other = changed(ladder, main.index[4], F_T_start=0.1 * ladder.scene.F_N)
    value, off = statistics(ladder, other, t)["mean start/F_N"]
    assert value == pytest.approx(main["F_T_start"].iloc[2:].mean() / ladder.scene.F_N)
    assert off == pytest.approx(0.1 / (len(main) - 2))
    assert statistics(ladder, other, t)["main events"] == (len(main) - 2, 0)


# --- runs that measure their errors --------------------------------------------------------------


def one_block(dt_share, verify):
    """One undamped block that slips once: its neighbour carries too much load to move.

    m u'' = K V t - (K + k) u - mu_k p from u = 0, where K V t = mu_s p.
    """
    scene = chain(
        p=(500.0, 2500.0, 2500.0), L=5e-3, k=2e6, M=3e-3, K=1e6, V=0.5, mu_s=0.7, mu_k=0.4, eta=0.0
    )
    t_0 = 0.7 * 500.0 / (1e6 * 0.5)
    dt = dt_share * stability_limit(scene)[0]
    record = pyfric.simulate(
        scene, t_0 + 2e-4, fidelity="dynamic", dt=dt, switching="located", verify=verify, t_gap=1e-5
    )
    m, stiff, drop, rate = scene.m, 3e6, 0.3 * 500.0, 1e6 * 0.5
    omega = math.sqrt(stiff / m)
    # u = (drop/stiff)(1 - cos) + rate/stiff (t - sin/omega); u' = 0 again at omega t = 2 pi - 2 a
    a = math.atan(rate / (omega * drop))
    t = (math.pi + 2 * a) / omega
    u = drop / stiff * (1 - math.cos(omega * t)) + rate / stiff * (t - math.sin(omega * t) / omega)
    return record, 0.7 * 500.0 + rate * t - 1e6 * u


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_the_measured_error_is_the_error_of_a_closed_form(share):
    record, exact = one_block(share, "full")
    event = record.events.iloc[0]
    error = abs(event["F_T_arrest"] - exact) / record.scene.F_N
    assert error > 1e-9
    assert record.errors.arrest == pytest.approx(FINER * error, rel=0.1)
    sampled, _ = one_block(share, "sample")
    assert sampled.errors.arrest >= error


@pytest.fixture(scope="module")
def refined():
    """A plan in linear geometry whose front speeds need finite geometry."""
    scene = setup1(L=0.03, H=0.015, V=5e-3, F_N=800.0)
    return pyfric.simulate(scene, 0.035, want="front_speed", tolerance=0.03, verify="full")


def test_a_plan_measures_its_errors(refined):
    errors = refined.errors
    assert errors.want == "front_speed"
    assert errors.tolerance == 0.03
    assert errors.holds
    assert 0 < errors.measured() == errors.speed_95 <= errors.speed_worst
    assert errors.events > 2
    assert refined.timings["verification"] > 0


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_jumps_in_finite_geometry_leave_an_error_of_front_speeds(refined, share):
    """Beside itself a run has just that error: in proportion where the driver is slow."""
    driver = refined.scene.driver
    driver = dataclasses.replace(driver, V=share * FAST / hurry(refined.scene) * driver.V)
    scene = dataclasses.replace(refined.scene, driver=driver)
    made = Made(scene=scene, t_begin=0.0, t_end=1.0, options=pyfric.Options(), run=None)
    stepped = verification._Stepped(refined, made)
    stepped.other, stepped.factor = refined, FINER
    errors = stepped.errors()
    for name, most in SPEEDS.items():
        assert getattr(errors, name) == pytest.approx(share * most)


def test_a_record_keeps_them(refined, tmp_path):
    path = refined.save(tmp_path / "a.nc")
    assert Record.load(path) == refined
    assert Record.load(path).errors == refined.errors
    shown = CliRunner().invoke(main, ["info", str(path)]).output
    assert str(refined.errors) in shown
    assert "expected" in str(refined.errors)


def test_what_is_not_asked_for_is_not_measured():
    scene = small_rod(V=0.05)
    for how in ({"verify": "none"}, {"fidelity": "hybrid"}):
        assert pyfric.simulate(scene, 2e-3, **how).errors is None
    with pytest.raises(pyfric.SceneError, match="verify"):
        pyfric.Options(verify="some")


def test_the_price_is_at_most_the_cost_of_the_run_or_cheap():
    for want, tolerance in (("precursors", 0.01), ("front_speed", 0.05), ("stress", 0.1)):
        found = pyfric.plan(small_rod(), want, tolerance, t_end=0.7)
        ready = cost.set_up(small_rod(), "hybrid", "finite").seconds
        assert 0 < found.price <= max(found.seconds, CHEAP + ready)
        assert 0 < found.share <= 1


def test_what_is_compared_hangs_on_counts_and_not_on_the_clock(monkeypatch):
    """The same shares on a machine that is ten times as slow."""
    scene, shares = preset("fig1"), []
    for pace in (1.0, 10.0):
        monkeypatch.setattr(cost, "pace", lambda pace=pace: pace)
        shares.append([pyfric.plan(scene, "stress", one, t_end=0.9).share for one in (0.1, 0.01)])
    assert shares[0] == shares[1]
    assert min(shares[0]) < 1


def test_the_run_beside_is_finer_where_that_is_paid_for():
    scene, dt = small_rod(), pyfric.step_size(small_rod())
    cheap = beside(scene, 1e7, 0, "finite", dt)
    assert (cheap.dt, cheap.share) == (dt / FINEST, 1)
    dear = beside(scene, 2.5e7, 0, "finite", dt)
    assert (dear.dt, dear.share) == (dt / 2, 1)
    for geometry, least in (("finite", 1.0), ("linear", 0.9)):
        for jumps in (0, 1e3):
            long = beside(scene, 1e9, jumps, geometry, dt)
            own = work(scene.N_x * scene.N_z, 1e9, jumps, geometry)
            assert long.dt == coarser_step(scene, dt) > dt
            assert long.seconds <= own
            assert long.share >= (least if not jumps else 0.5)
            assert 20 * long.share == round(20 * long.share)


def test_dynamics_measures_jumps_that_spare_little():
    """As long as it takes at most four times as long, and no longer than is paid for."""
    scene, dt = small_rod(), pyfric.step_size(small_rod())
    blocks, times = scene.N_x * scene.N_z, WORTH * 0.9
    lasts = times * 1e6 * dt / (4 * blocks)  # that dynamics takes `times` as many evaluations
    assert beside(scene, 1e6, 1e-9, "finite", dt, lasts=lasts).whole
    assert not beside(scene, 1e6, 1e-9, "finite", dt, lasts=2 * lasts).whole
    assert not beside(scene, 1e6, 0, "finite", dt, lasts=lasts).whole
    dear = beside(scene, 1e9, 1e-9, "finite", dt, lasts=1e3 * lasts)
    assert not dear.whole
    assert dear.seconds <= work(blocks, 1e9, 1e-9, "finite")


def test_a_ladder_is_compared_for_as_many_events_as_are_cheap():
    scene = small_rod()
    few, many = (beside_ladder(scene, n, 10 * n, pyfric.step_size(scene)) for n in (3, 3000))
    assert few.share == 1
    assert 0 < many.share < 0.2
    assert max(few.seconds, many.seconds) <= CHEAP
    assert 3000 * many.share == pytest.approx(round(3000 * many.share))
    none = beside_ladder(preset("fig1", l=1.25e-3), 10, 1000, 1e-7)
    assert (none.share, none.seconds) == (0, 0)


def test_a_stretch_begins_at_the_start_and_ends_with_its_share_of_events(ladder):
    made = Made(scene=ladder.scene, t_begin=0.0, t_end=1.5, options=pyfric.Options(), run=None)
    starts = ladder.events["t_start"].to_numpy()
    assert stretch(ladder, made, 1.0) == 1.5
    assert (starts < stretch(ladder, made, 0.5)).sum() == len(starts) // 2
    dynamic = dataclasses.replace(ladder.method, engine="dynamic")
    assert stretch(dataclasses.replace(ladder, method=dynamic), made, 0.5) == 0.75


def test_the_coarser_step_is_stable():
    scene = small_rod()
    limit = stability_limit(scene)[0]
    for share in (0.01, 0.5, 0.7, 0.9, 1.0):
        step = coarser_step(scene, share * limit)
        assert step < limit
        assert not 0.8 < step / (share * limit) < 1.25


def test_beyond_the_tolerance_is_said():
    errors = Errors(want="precursors", tolerance=0.01, expected=0.001, start=0.02, arrest=0.001)
    assert errors.holds is False
    assert errors.measured() == 0.02
    assert "BEYOND 0.01" in str(errors)
    assert "(expected 0.001)" in str(errors)
    assert 0 < PERTURBATION < 1e-6


# --- measured, bounded, or not measured ----------------------------------------------------------


def test_what_was_not_measured_is_never_zero(ladder, tmp_path):
    """None in numbers, text, JSON and on the page, as plain as a broken promise."""
    for want in ("precursors", "stress", "front_speed", None):
        errors = Errors(want=want, tolerance=0.01)
        assert errors.measured() is None
        assert errors.holds is None
        assert {errors.state(name) for name in UNITS} == {"not measured"}
        assert "NOT MEASURED, nothing was compared" in str(errors)
        record = ladder.replace(errors=errors)
        found = summary(record, [])["errors"]
        assert (found["measured"], found["holds"], found["start"]) == (None, None, None)
        assert '"holds": null' in json.dumps(found)
        assert "NOT MEASURED" in record.summary()
        assert "NOT MEASURED" in record.to_html(tmp_path / "page.html").read_text()
        assert Record.load(record.save(tmp_path / "a.nc")).errors == errors


def test_the_number_that_was_wanted_has_to_be_known():
    forces = {"tolerance": 0.01, "start": 0.001, "arrest": 0.002}
    assert Errors(want="precursors", **forces).measured() == 0.002
    assert Errors(want="stress", **forces).holds is None
    assert Errors(want="stress", **forces, stress=0.003).measured() == 0.003
    assert Errors(want="front_speed", **forces).holds is None
    assert Errors(want="front_speed", **forces, speed_95=0.1).holds is False
    assert Errors(want="precursors", tolerance=0.01, rupture=0.004).measured() == 0.004
    assert Errors(want="front_speed", tolerance=0.01, rupture=0.004).measured() is None
    assert Errors(**forces | {"tolerance": None}).holds is None


def test_a_bound_names_its_formula():
    errors = Errors(want="precursors", tolerance=0.1, arrest=0.01, events=3, covered=0.5)
    errors = errors.bounded("what ladders leave out", start=0.05)
    assert [errors.state(name) for name in ("start", "arrest", "length")] == [
        "bounded", "measured", "not measured",
    ]  # fmt: skip
    assert errors.holds is True
    said = str(errors)
    assert "measured errors (3 main events, to 0.5 s): arrest 0.01 F_N\n" in said
    assert "bounded: start 0.05 F_N by what ladders leave out" in said
    assert "length, stress, rupture, speed_median, speed_95, speed_worst not measured" in said


def test_a_record_that_nothing_was_compared_with_says_so(ladder):
    record = ladder.replace(errors=None)
    (note,) = not_verified(record)
    assert "nothing was compared" in note
    assert not_verified(record.replace(errors=Errors())) == ()
    assert "errors not measured: nothing was compared" in record.summary()
    assert summary(record, [])["errors"]["holds"] is None


def test_fronts_of_an_event_that_goes_on_are_compared_as_far_as_both_have_come(ladder):
    """One run is some blocks further; where both have been, its times are 3 % longer."""
    N_x, event, short = ladder.scene.N_x, main_events(ladder)[-1], 4
    ladder = without(ladder, range(event + 1, len(ladder.events) + 1))
    times = np.full(ladder.region.shape, np.nan)
    times[event - 1, ladder.scene.n_of_i - 1] = 1e-6 * np.arange(N_x)
    ahead = going_on(ladder, event).replace(rupture_times=1.03 * times)
    behind = times.copy()
    behind[event - 1, ladder.scene.n_of_i > N_x - short] = np.nan
    behind = going_on(ladder, event).replace(rupture_times=behind)
    found = differences(ahead, behind).errors()
    assert found["speed_worst"] == pytest.approx(1 - 1 / 1.03)
    assert found["compared"]["speed_worst"] == N_x - short - 4
    off = np.std(np.linspace(0, 1, N_x - short))
    assert found["rupture"] == pytest.approx(0.03 * off)
    nowhere = going_on(ladder, event).replace(rupture_times=np.full(times.shape, np.nan))
    nothing = Errors(want="front_speed", tolerance=0.05, **differences(ahead, nowhere).errors())
    assert (nothing.speed_95, nothing.holds) == (None, None)


def prescribed(**changes):
    """Return a run of a prescribed interface whose front goes on to the end."""
    p = [100.0] * 30
    tau = [69.0 if n else 71.0 for n in range(30)]
    scene = slab(p=p, tau=tau, L=29 * 2.5e-3, H=0.01, l=2.5e-3, **changes)
    return pyfric.simulate(scene, 4e-5, fidelity="dynamic", progress=False, dt=2e-7)


def test_a_prescribed_interface_is_compared_by_its_rupture_times():
    run = prescribed()
    assert np.isnan(run.events["F_T_start"]).all()
    assert not run.events["finished"].any()
    times = run.rupture_times[0]
    assert np.isfinite(times).sum() > 10
    found = differences(run, run).errors()
    assert (found["start"], found["arrest"], found["stress"], found["length"]) == (None,) * 4
    assert found["rupture"] == found["speed_95"] == 0
    for want in ("precursors", "front_speed"):
        assert Errors(want=want, tolerance=0.01, **found).holds is True
    known = np.isfinite(times)
    late = run.replace(rupture_times=run.rupture_times + 1e-6)
    span = np.ptp(times[known])
    errors = Errors(want="precursors", tolerance=0.01, **differences(late, run).errors())
    assert errors.measured() == pytest.approx(1e-6 / span)
    assert errors.holds is False
    assert differences(late, run).parted(0.5e-6 / span) == run.events["t_start"].loc[1]
    assert differences(late, run).parted(2e-6 / span) is None
    lost = differences(run, without(run, [1])).errors()  # it never ruptures
    assert lost["rupture"] == pytest.approx(run.curve["t"].iloc[-1] / span)


# --- refinement, with runs whose errors are known ------------------------------------------------


class Known:
    """Runs off by `step` (dt/dt_0)^4 F_N, and by `bonds` F_N in linear geometry, in start forces.

    From main event `chaos` on, a faster driver moves them by 0.3 F_N. Jumps leave `jumps[tight]`.
    Steps of more than `turn` dt_0 take a wrong turn: one event is 0.1 L longer, the next one starts
    at 0.005 F_N more.
    """

    def __init__(self, ladder, step=0.0, bonds=0.0, chaos=None, noise=0.0, jumps=(), turn=np.inf):
        self.ladder, self.step, self.bonds, self.chaos = ladder, step, bonds, chaos
        self.noise, self.asked, self.jumps, self.turn = noise, [], jumps, turn
        self.dt_0 = pyfric.step_size(ladder.scene)
        self.main = main_events(ladder)

    def run(self, scene, t_end, options, tight=0):
        how = {"engine": "hybrid", "geometry": options.geometry, "dt": options.dt}
        method = dataclasses.replace(
            self.ladder.method, **how, stepper="rk4", switching="located", variant=""
        )
        off = self.step * (options.dt / self.dt_0) ** 4
        off += self.bonds * (options.geometry == "linear")
        off += sum(self.jumps[tight : tight + 1])
        events = self.ladder.events
        events.loc[self.main, "F_T_start"] += off * scene.F_N
        if options.dt > self.turn * self.dt_0:
            events.loc[self.main[2], "L_p_over_L"] += 0.1
            events.loc[self.main[3], "F_T_start"] += 0.005 * scene.F_N
        if self.chaos is not None:
            late = self.main[self.chaos :]
            fast = scene.driver.V != self.ladder.scene.driver.V
            apart = 0.3 * fast + self.noise * (options.dt / self.dt_0) ** 0.1
            events.loc[late, "F_T_start"] += apart * scene.F_N
        self.asked.append((options.geometry, options.dt / self.dt_0, tight))
        counts = {"block_evaluations": 10**10, "jumps": 0}
        return dataclasses.replace(self.ladder, method=method, events=events, counts=counts)

    def verified(self, mode, tolerance=0.01, geometry="finite"):
        options = pyfric.Options(
            fidelity="hybrid", geometry=geometry, dt=self.dt_0, tolerance=tolerance
        )
        scene = self.ladder.scene
        made = Made(
            scene=scene, t_begin=0.0, t_end=1.5, options=options, run=self.run, refines=True
        )
        return verified(self.run(scene, 1.5, options), mode, made)


def test_a_small_error_takes_one_more_run(ladder):
    known = Known(ladder, step=1e-4)
    for mode in ("sample", None):  # 1e10 evaluations are not cheap
        known.asked.clear()
        errors = known.verified(mode).errors
        assert len(known.asked) == 2
        ratio = known.asked[1][1]
        assert errors.start == pytest.approx(COARSER * 1e-4 * (ratio**4 - 1) + JUMPS)
    full = known.verified("full").errors
    assert full.start == pytest.approx(FINER * 1e-4 + JUMPS)
    assert all(tight for _, _, tight in known.asked[1:2])


def test_steps_are_cut_until_the_error_is_within_the_tolerance(ladder):
    known = Known(ladder, step=0.01)
    record = known.verified("sample")
    assert [share for _, share, _ in known.asked[2:]] == [1 / 2, 1 / 8]
    assert record.method.dt == known.dt_0 / 2
    assert record.errors.start == pytest.approx(FINER * 0.01 / 16 + JUMPS)
    assert record.errors.holds
    assert any("refined to hybrid, finite geometry" in note for note in record.notes)


def test_a_wrong_turn_that_half_the_step_takes_too_is_found(ladder):
    """Events of other lengths are no errors of some order in the step."""
    record = Known(ladder, step=0.01, turn=1 / 6).verified("sample", tolerance=0.02)
    assert record.method.dt == pyfric.step_size(ladder.scene) / 2
    off = 0.005 + 0.01 * (2**-4 - (2 * FINEST) ** -4)
    assert record.errors.start == pytest.approx(COARSER * off + JUMPS)


def test_a_refined_run_is_compared_with_stricter_jumps_than_its_own(ladder):
    known = Known(ladder, jumps=(0.3, 0.1))  # the same for all steps
    record = known.verified("sample")
    assert [tight for _, _, tight in known.asked] == [0, 1, 1, 2, 1, 3]  # the last 1: perturbed
    assert record.errors.start == pytest.approx(JUMPS)
    np.testing.assert_array_equal(record.events["F_T_start"], ladder.events["F_T_start"])


def test_linear_geometry_is_left_first(ladder):
    known = Known(ladder, bonds=0.05)
    record = known.verified("sample", geometry="linear")
    assert [geometry for geometry, _, _ in known.asked] == ["linear", *(3 * ["finite"])]
    assert [share for _, share, _ in known.asked[2:]] == [1 / 2, 1.0]
    assert record.method.geometry == "finite"
    assert record.errors.start == pytest.approx(JUMPS)


def test_chaos_is_said(ladder):
    """Runs that differ however small the step, as those with another driver do."""
    known = Known(ladder, chaos=4, noise=0.5)
    record = known.verified("sample")
    at = float(ladder.events["t_start"][known.main[4]])
    ends = ladder.events["t_stop"].to_numpy()
    assert record.errors.until == ends[ends < at].max()  # it may begin earlier in another run
    assert record.errors.start == pytest.approx(JUMPS)
    assert record.errors.statistics["mean start/F_N"][1] == pytest.approx(0.3)
    assert any("single events cannot be trusted" in note for note in record.notes)
    calm = Known(ladder, step=1e-4, chaos=4).verified("sample")
    assert calm.errors.until is None  # nobody asked: steps nearly twice as long agree


def test_what_no_refinement_helps_is_said(ladder):
    """Nothing that could be trusted is left to compare."""
    record = Known(ladder, step=1e4).verified("sample")
    assert record.errors.until is not None
    assert "finer steps give other ones" in record.notes[-2]
    assert record.errors.holds is None
    assert "NOT MEASURED" in record.notes[-1]


@pytest.mark.parametrize(("step", "runs"), [(1e-7, 2), (1e-4, 4)])
def test_steps_are_not_cut_for_what_jumps_leave(ladder, step, runs):
    """It is the same for all steps; but errors of steps that are too large are cut."""
    known = Known(ladder, step=step)
    record = known.verified("sample", tolerance=JUMPS / 2)
    assert len(known.asked) == runs
    assert not record.errors.holds
    assert record.errors.start < 1.5 * JUMPS
    assert record.notes[-2] == verification.VAIN
