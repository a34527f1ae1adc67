"""Measured errors: records that differ by what is known, closed forms, refinement, files."""

import dataclasses
import math

import numpy as np
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
from pyfric.record import Errors, Record, differences, statistics
from pyfric.scene import chain, preset, setup1
from pyfric.statics import stability_limit


@pytest.fixture(scope="module")
def ladder():
    return pyfric.simulate(small_rod(), 1.5, fidelity="quasistatic")


def changed(record, row, **by):
    """Return the record with numbers added to one event."""
    events = record.events
    for name, value in by.items():
        events.loc[row, name] += value
    return dataclasses.replace(record, events=events)


# --- comparisons ---------------------------------------------------------------------------------


def test_a_record_does_not_differ_from_itself(ladder):
    found = differences(ladder, ladder).errors()
    assert found["events"] == ladder.events["is_main"].sum() > 5
    assert [found[name] for name in ("start", "arrest", "length", "stress")] == [0, 0, 0, 0]


def test_known_differences_are_found(ladder):
    main, F_N = np.flatnonzero(ladder.events["is_main"]), ladder.scene.F_N
    other = changed(ladder, main[2], F_T_start=0.01 * F_N, L_p_over_L=0.1)
    other = changed(other, main[4], F_T_arrest=-0.02 * F_N)
    tau = other.tau_after.copy()
    tau[main[1]] += 0.03 * F_N / ladder.scene.N_x
    found = differences(ladder, dataclasses.replace(other, tau_after=tau))
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
        dataclasses.replace(ladder, rupture_times=t)
        for t in (front, 1.05 * front, np.full(times.shape, np.nan))
    )
    found = differences(slow, one).errors()
    assert found["speed_median"] == pytest.approx(1 - 1 / 1.05)
    assert found["speed_worst"] == pytest.approx(1 - 1 / 1.05)
    assert differences(none, one).errors()["speed_95"] == 1.0
    assert differences(none, none).errors()["speed_95"] is None


def test_an_event_after_the_end_is_compared_with_the_force_there(ladder):
    """A run that ends just before its last event is not a run without it."""
    main = np.flatnonzero(ladder.events["is_main"])
    t = float(ladder.events["t_start"][main[-1]])
    short = pyfric.simulate(ladder.scene, t - 1e-6, fidelity="quasistatic")
    assert differences(short, ladder).errors()["start"] < 1e-6
    late = changed(ladder, main[-1], t_start=-2e-6)  # the other one has it just before
    assert differences(late, short).errors()["start"] < 1e-4


def test_an_event_begun_while_the_last_one_goes_on_is_part_of_it(ladder):
    """Two runs of which one sees a pause inside its last event: nothing to compare."""
    main = np.flatnonzero(ladder.events["is_main"])
    events = ladder.events
    events.loc[main[-2] + 1 :, "F_T_start"] = np.nan
    without = dataclasses.replace(ladder, events=events)
    assert differences(ladder, without).errors()["start"] > 1e-3
    events.loc[main[-2], "finished"] = False
    joined = dataclasses.replace(without, events=events)
    assert differences(ladder, joined).errors()["start"] == 0


@pytest.mark.parametrize("parts", [False, True])
def test_an_event_that_goes_on_is_compared_by_its_force(ladder, parts):
    """Two runs that part inside their last event, which a pause may part in one of them."""
    last, F_N = np.flatnonzero(ladder.events["is_main"])[-2:], ladder.scene.F_N
    events = ladder.events
    events.loc[last, "t_stop"], events.loc[last, "finished"] = np.nan, False
    events.loc[last[0] + 1 :, "F_T_start"] = np.nan
    on = dataclasses.replace(ladder, events=events)
    if parts:
        events = ladder.events
        events.loc[last[1], "t_stop"], events.loc[last[1], "finished"] = np.nan, False
    one = dataclasses.replace(ladder, events=events)
    t, force = (ladder.curve[name].to_numpy() for name in ("t", "F_T"))
    between = 0.5 * (t[1:] + t[:-1])
    other = dataclasses.replace(on, curve=resampled(on, between, np.interp(between, t, force)))
    assert differences(one, other).errors()["arrest"] == 0  # other samples of the same motion
    late = force + np.where(t > events["t_start"][last[1]], 0.1 * F_N, 0.0)
    other = dataclasses.replace(on, curve=resampled(on, t, late))
    assert 0.08 < differences(one, other).errors()["arrest"] <= 0.1


def resampled(record, t, force):
    """Return the loading curve with other samples."""
    return record.curve.iloc[: len(t)].assign(t=t, F_T=force)


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
    assert not errors.holds
    assert errors.measured() == 0.02
    assert "BEYOND 0.01" in str(errors)
    assert Errors.from_json(errors.to_json()) == errors
    assert 0 < PERTURBATION < 1e-6


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
        self.main = np.flatnonzero(ladder.events["is_main"])

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
    record = Known(ladder, step=1e4).verified("sample")
    assert record.errors.until is not None
    assert "finer steps give other ones" in record.notes[-1]


@pytest.mark.parametrize(("step", "runs"), [(1e-7, 2), (1e-4, 4)])
def test_steps_are_not_cut_for_what_jumps_leave(ladder, step, runs):
    """It is the same for all steps; but errors of steps that are too large are cut."""
    known = Known(ladder, step=step)
    record = known.verified("sample", tolerance=JUMPS / 2)
    assert len(known.asked) == runs
    assert not record.errors.holds
    assert record.errors.start < 1.5 * JUMPS
    assert record.notes[-2] == verification.VAIN
