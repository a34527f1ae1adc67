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
from pyfric.cli.commands import main
from pyfric.engines import ACCURACY, HybridRun, Options, integrate
from pyfric.engines.cost import CALL, full_counts, full_work, work_so_far
from pyfric.planning import verification
from pyfric.planning.price import RATIOS, Runs, budget
from pyfric.planning.verification import (
    DYNAMICS,
    MOST,
    PERTURBATION,
    SAFETY,
    TURNED,
    Specification,
    _apart,
    _Verification,
    verified,
)
from pyfric.record import Errors, Record, differences, statistics, summary
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


def test_runs_with_other_blocks_are_not_compared(ladder):
    other = pyfric.simulate(setup1(L=0.04, H=0.015, F_N=800.0), 0.1, fidelity="quasistatic")
    assert other.scene.N_x != ladder.scene.N_x
    with pytest.raises(pyfric.SceneError, match=r"a run with .* blocks"):
        differences(ladder, other)


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
    assert found.beyond(0.005)["t_start"].min() == starts[main[2]]
    assert found.beyond(0.015)["t_start"].min() == starts[main[4]]
    assert found.beyond(0.025).empty
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


def test_fronts_of_events_that_end_elsewhere_are_not_the_same(ladder):
    """Events without a single speed in common part runs, too, if front speeds are wanted."""
    main = main_events(ladder)
    longer = differences(changed(ladder, main[2], L_p_over_L=0.1), ladder)
    assert list(longer.beyond(0.01, "front_speed")["event"]) == [main[2]]
    assert longer.beyond(0.01).empty
    assert differences(ladder, ladder).beyond(0.01, "front_speed").empty


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


def test_an_event_that_has_ended_in_one_run_alone_has_no_order(ladder):
    """But for one that ends too late for the pause after it to be known."""
    last = main_events(ladder)[-1]
    ended = without(ladder, range(last + 1, len(ladder.events) + 1))
    on = going_on(ended, last)
    assert differences(ended, on).turned
    assert differences(on, ended).turned
    late = float(ended.events["t_stop"][last]) + 0.9 * ladder.method.t_gap
    assert not differences(ended, on, late).turned
    assert not differences(on, on).turned


def test_arrests_are_compared_where_one_run_ends_soon_after(ladder):
    """It has come to rest, too late to know whether the event goes on."""
    last, F_N = main_events(ladder)[-1], ladder.scene.F_N
    ended = without(ladder, range(last + 1, len(ladder.events) + 1))
    events = ended.events
    events.loc[last, "finished"] = False
    events.loc[last, "F_T_arrest"] += 1e-7 * F_N  # far less than between samples
    early = ended.replace(events=events)
    assert differences(ended, early).errors()["arrest"] == pytest.approx(1e-7)
    assert differences(early, ended).errors()["arrest"] == pytest.approx(1e-7)


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
    found = differences(one, one.replace(curve=off)).errors()  # two samples
    end = one.curve["F_T"].iloc[-1] / one.scene.F_N
    assert found["arrest"] == pytest.approx(0.5 * end, rel=1e-12)
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
    assert record.errors.arrest == pytest.approx(SAFETY * error, rel=0.1)
    sampled, _ = one_block(share, "sample")
    assert sampled.errors.arrest >= error


@pytest.fixture(scope="module")
def refined():
    """A plan in linear geometry whose front speeds need finite geometry."""
    scene = setup1(L=0.03, H=0.015, V=5e-3, F_N=800.0)
    return pyfric.simulate(scene, 0.03, want="front_speed", tolerance=0.03, verify="full")


def test_a_plan_measures_its_errors(refined):
    errors = refined.errors
    assert errors.want == "front_speed"
    assert errors.tolerance == 0.03
    assert errors.holds
    assert 0 < errors.measured() == errors.speed_95 <= errors.speed_worst
    assert errors.events > 2
    assert refined.timings["verification"] > 0


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


def test_beyond_the_tolerance_is_said():
    errors = Errors(want="precursors", tolerance=0.01, expected=0.001, start=0.02, arrest=0.001)
    assert errors.holds is False
    assert errors.measured() == 0.02
    assert "BEYOND 0.01" in str(errors)
    assert "(expected 0.001)" in str(errors)
    assert 0 < PERTURBATION < 1e-6


# --- measured, or not ----------------------------------------------------------------------------


def test_what_was_not_measured_is_never_zero(ladder, tmp_path):
    """None in numbers, text, JSON and on the page, as plain as a broken promise."""
    for want in ("precursors", "stress", "front_speed", None):
        errors = Errors(want=want, tolerance=0.01)
        assert errors.measured() is None
        assert errors.holds is None
        assert {getattr(errors, name) for name in UNITS} == {None}
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
    short = Errors(want="front_speed", **forces, events=3)
    assert short.verdict.endswith("NOT MEASURED, no front has a speed")
    assert Errors(want="front_speed", **forces, speed_95=0.1).holds is False
    assert Errors(want="precursors", tolerance=0.01, rupture=0.004).measured() == 0.004
    assert Errors(want="front_speed", tolerance=0.01, rupture=0.004).measured() is None
    assert Errors(**forces | {"tolerance": None}).holds is None


def test_measured_errors_are_told_apart_from_others():
    errors = Errors(want="precursors", tolerance=0.1, arrest=0.01, events=3, covered=0.5)
    assert errors.holds is True
    said = str(errors)
    assert "measured errors (3 events, to 0.5 s): arrest 0.01 F_N\n" in said
    assert (
        "start, length, stress, rupture, speed_median, speed_95, speed_worst not measured" in said
    )


def test_a_record_that_nothing_was_compared_with_says_so(ladder):
    record = ladder.replace(errors=None)
    assert "errors not measured (a planned run" in record.summary()
    assert summary(record, [])["errors"]["holds"] is None


def test_rupture_times_of_blocks_that_one_front_alone_passes_count(ladder):
    """Three blocks have no front speed, but rupture times; a block that one front misses is 1."""
    times, e = np.full(ladder.rupture_times.shape, np.nan), main_events(ladder)[0] - 1
    times[e, ladder.scene.n_of_i <= 3] = 1e-6 * np.arange(3)
    front, slow = (ladder.replace(rupture_times=by * times) for by in (1.0, 1.04))
    times[e, ladder.scene.n_of_i == 3] = np.nan
    short = ladder.replace(rupture_times=times)
    least = ladder.replace(rupture_times=np.where(ladder.scene.n_of_i == 1, times, np.nan))
    off = 0.04 * np.std([0.0, 0.5, 1.0])
    pairs = [(slow, front, off), (short, front, np.sqrt(1 / 3)), (front, short, np.sqrt(1 / 3))]
    for one, other, known in [*pairs, (least, front, 1.0)]:
        errors = Errors(want="front_speed", tolerance=0.02, **differences(one, other).errors())
        assert errors.rupture == pytest.approx(known)
        assert (errors.speed_95, errors.holds) == (None, None)
    assert differences(least, least).errors()["rupture"] is None


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
    assert (
        differences(late, run).beyond(0.5e-6 / span)["t_start"].min()
        == run.events["t_start"].loc[1]
    )
    assert differences(late, run).beyond(2e-6 / span).empty
    lost = differences(run, without(run, [1])).errors()  # it never ruptures
    assert lost["rupture"] == pytest.approx(run.curve["t"].iloc[-1] / span)


# --- verification, with runs whose errors are known ----------------------------------------------


class Known:
    """Runs off by `step` (dt/dt_0)^4 F_N, by `bonds` F_N in linear geometry, and by `jumps` times
    their accuracy, in start forces. With the opposite stepper, `step` counts with a minus.

    From main event `chaos` on, steps move them by `noise` (dt/dt_0)^0.1. Steps of more than `turn`
    dt_0 take a wrong turn: one event is 0.1 L longer, the next one starts at 0.005 F_N more. `part`
    is a shorter run, which those of steps of at most `short` dt_0 are.
    """

    part, short = None, 1 / 4

    def __init__(self, ladder, step=0.0, bonds=0.0, chaos=None, noise=0.0, jumps=0.0, turn=np.inf):
        self.ladder, self.step, self.bonds, self.chaos = ladder, step, bonds, chaos
        self.noise, self.asked, self.jumps, self.turn = noise, [], jumps, turn
        self.ends = []
        self.dt_0 = pyfric.step_size(ladder.scene)
        self.main, self.evaluations = main_events(ladder), 12 * 10**6

    def run(self, scene, t_end, options, enough=None):
        how = {"engine": options.fidelity, "geometry": options.geometry, "dt": options.dt}
        how |= {"accuracy": options.accuracy, "sample": 10**6}
        method = dataclasses.replace(
            self.ladder.method, **how, stepper=options.stepper, switching="located", variant=""
        )
        share = options.dt / self.dt_0
        sign = -1 if options.stepper == "rk4_opposite" else 1
        off = sign * self.step * share**4 + self.bonds * (options.geometry == "linear")
        off += self.jumps * (options.accuracy or 0.0)
        ladder = self.part if self.part is not None and share <= self.short * 1.001 else self.ladder
        events = ladder.events
        events.loc[events["is_main"], "F_T_start"] += off * scene.F_N
        if share > self.turn:
            events.loc[self.main[2], "L_p_over_L"] += 0.1
            events.loc[self.main[3], "F_T_start"] += 0.005 * scene.F_N
        if self.chaos is not None:
            events.loc[self.main[self.chaos :], "F_T_start"] += self.noise * share**0.1 * scene.F_N
        self.asked.append((options.geometry, share, options.accuracy, options.stepper))
        self.ends.append(enough)
        stages = 5 if sign < 0 else 4
        made = round(self.evaluations / share * stages / 4)
        blocks = scene.N_x * scene.N_z
        counts = {"block_evaluations": made, "steps": made // (stages * blocks), "landings": 0}
        return dataclasses.replace(ladder, method=method, events=events, counts=counts)

    def verified(
        self, mode, tolerance=0.01, geometry="finite", work=np.inf, accuracy=1e-4, refinement=0.0
    ):
        how = {"fidelity": "hybrid", "geometry": geometry, "dt": self.dt_0}
        options = pyfric.Options(**how, tolerance=tolerance, accuracy=accuracy, verify=mode)
        scene = self.ladder.scene
        how = {"options": options, "run": self.run, "refines": True, "work": work}
        how |= {"whole": work + budget(work), "refinement": refinement}
        made = Specification(scene=scene, t_begin=0.0, t_end=1.5, **how)
        return verified(self.run(scene, 1.5, options), made)


def test_a_small_error_takes_one_more_run(ladder):
    known = Known(ladder, step=1e-4)
    errors = known.verified(None).errors
    (_, *how) = known.asked[-1]
    assert len(known.asked) == 2
    assert how == [
        pytest.approx(1 / 2.5),
        ACCURACY,
        "rk4_opposite",
    ]  # twice the work, and half a second
    assert errors.start == pytest.approx(SAFETY * 1e-4)
    full = known.verified("full").errors
    assert full.start == pytest.approx(SAFETY * 1e-4)
    assert known.asked[3][1] == 1 / RATIOS[0]


def test_the_reference_is_the_best_that_is_paid_for(ladder):
    """The opposite stepper, and the largest ratio; dynamics, where that is paid for, not jumps."""
    scene, dt = ladder.scene, pyfric.step_size(ladder.scene)
    full, seen = full_work(scene, "finite", dt, 1.5), []
    for evaluations in (10**5, 12 * 10**6, 10**9):
        known = Known(ladder, step=1e-6)
        known.evaluations = evaluations
        record = known.verified(None)
        (_, share, accuracy, stepper) = known.asked[1]
        own = work_so_far(record)
        stages = 5 / 4 if stepper == "rk4_opposite" else 1
        assert stages * (full if accuracy is None else own) / share <= budget(own) * 1.01
        seen.append((share, accuracy is None, stepper))
    assert seen[0] == (1 / 4, False, "rk4_opposite")
    assert seen[1] == (pytest.approx(1 / 2.5), False, "rk4_opposite")
    assert seen[2] == (1 / 4, True, "rk4_opposite")  # dynamics spares nothing there


def test_undamped_motion_is_compared_with_the_same_stepper(ladder):
    scene = dataclasses.replace(
        ladder.scene, slider=dataclasses.replace(ladder.scene.slider, eta=0.0)
    )
    counts = {"dynamic": full_counts(scene, 1e-6, 1e-2)}
    for switching, eta, steppers in (
        ("located", 1, ["rk4_opposite"] * len(RATIOS) + ["rk4"] * len(RATIOS)),
        ("located", 0, ["rk4"] * len(RATIOS)),
        ("step_end", 1, ["rk4"] * len(RATIOS)),
    ):
        one = ladder.scene if eta else scene
        dt = 0.75 * stability_limit(one)[0]
        found = Runs(one, "finite", counts, "rk4", dt, switching).references()
        assert [level.stepper for level in found] == steppers
        for level in found:
            assert any(dt / level.dt == pytest.approx(ratio) for ratio in RATIOS)
    back = Runs(ladder.scene, "finite", counts, "rk4_opposite", dt / 2, "located").references()
    assert back[0].stepper == "rk4"


def test_verification_costs_what_the_plan_announced(ladder):
    """The reference run of a run that takes longer than its plan said ends earlier."""
    ended = []
    for announced in (np.inf, 1e-3):
        known = Known(ladder, step=1e-6)
        known.evaluations = 35 * 10**6
        record = known.verified(None, work=announced)
        assert known.asked[1][1] == 1 / RATIOS[-1]
        ended.append(known.ends[1](record))  # with as much work as the run
        assert known.asked[1][3] == "rk4"  # the opposite stepper takes longer
        assert record.errors.start == pytest.approx(SAFETY * 1e-6)
    assert 2 * work_so_far(record) > MOST * (1e-3 + budget(1e-3)) > work_so_far(record)
    assert ended == [False, True]


def test_a_run_that_is_too_far_off_gives_way_to_its_reference(ladder):
    """Of which no smaller error is claimed before it is compared with a finer one."""
    known = Known(ladder, step=0.007)
    record = known.verified(None)
    shares = [share for _, share, *_ in known.asked]
    assert shares == pytest.approx([1, 1 / 2.5, 1 / (2.5 * 2)])
    assert record.method.dt == known.dt_0 / 2.5
    assert any("refined to hybrid engine, finite geometry" in note for note in record.notes)
    assert record.errors.until is None
    assert record.errors.holds
    cheap = Known(ladder, step=0.007)
    cheap.evaluations = 3 * 10**6
    record = cheap.verified(None)
    shares = [share for _, share, *_ in cheap.asked]
    assert shares[:2] == [1, 1 / RATIOS[0]]
    assert record.method.dt <= cheap.dt_0 / RATIOS[0]


def test_events_are_trusted_as_far_as_the_budget_pays_for_a_finer_run(ladder):
    """The finer run ends after some main events, or before the first one."""
    main, starts = main_events(ladder), ladder.events["t_start"]
    known = Known(ladder, step=0.007)
    known.part = pyfric.simulate(ladder.scene, starts[main[3]] - 1e-3, fidelity="quasistatic")
    errors = known.verified(None).errors
    assert known.asked[-1][1] == pytest.approx(1 / (2.5 * 2))
    assert errors.events == 3
    assert starts[main[2]] <= errors.until < starts[main[3]]
    assert errors.measured() == pytest.approx(SAFETY * 0.007 / 2.5**4)
    assert errors.statistics
    known.part = pyfric.simulate(ladder.scene, starts[1] - 1e-3, fidelity="quasistatic")
    errors = known.verified(None).errors  # from the run of twice the step: no main event agrees
    assert errors.until <= starts[main[0]]
    assert errors.holds is False
    assert errors.events == len(main)
    assert errors.verdict.endswith(f"BEYOND {errors.tolerance:g}")


def test_a_budget_that_is_used_up_pays_for_no_finer_run(ladder):
    """A run without length would be compared with nothing: a difference of 0."""
    known = Known(ladder, step=0.007)
    errors = known.verified(None, work=1e-3).errors
    assert [share for _, share, *_ in known.asked] == [1, 1 / 2]
    assert errors.holds is False
    assert errors.events == len(main_events(ladder))
    nothing = pyfric.simulate(ladder.scene, 0.0, fidelity="quasistatic")
    found = differences(ladder, nothing)
    assert Errors(want="precursors", tolerance=0.01, **found.errors()).measured() is None


def test_a_refined_run_may_cost_what_was_announced_for_that(ladder):
    ended = []
    for refinement in (0.0, 1.0):
        known = Known(ladder, step=0.007)
        known.evaluations = 10**5
        known.verified(None, refinement=refinement)
        assert len(known.ends) == 3
        run = ladder.replace(counts={"calls": 1.5 / CALL})  # work of 1.5 s
        ended.append(known.ends[-1](run))
    assert ended == [True, False]


def test_other_small_events_end_the_trust_in_single_ones(ladder):
    main, starts = main_events(ladder), ladder.events["t_start"]
    known = Known(ladder, step=0.007, chaos=6, noise=0.3)
    until = known.verified(None).errors.until
    assert starts[main[4]] < until < starts[main[6]]
    (first, *_) = ladder.events.index[(starts > starts[main[2]]) & ~ladder.events["is_main"]]
    known.part = changed(ladder, first, last_block=1)
    assert known.verified(None).errors.until < starts[first] < until


def test_a_block_that_slips_once_more_makes_another_event(ladder):
    event = main_events(ladder)[2]
    assert _apart(ladder, ladder) == np.inf
    for more in (1, -1):
        other = changed(ladder, event, n_episodes=more)
        assert _apart(other, ladder) == ladder.events.loc[event, "t_start"]
    here, there = (
        one.replace(events=one.events.assign(finished=one.events.index != event))
        for one in (other, ladder)
    )
    assert _apart(here, there) == ladder.events.loc[event, "t_start"]  # goes on in both runs
    assert _apart(here, ladder) == np.inf


def test_small_errors_are_those_before_other_small_events(ladder):
    main, starts = main_events(ladder), ladder.events["t_start"]
    small = ladder.events.index[~ladder.events["is_main"]]
    known = Known(ladder, step=1e-4)
    known.evaluations = 10**5  # a run of a quarter of the step is paid for
    other = small[starts[small] > starts[main[2]]][0]
    known.part = changed(ladder, other, last_block=1)
    record = known.verified(None)
    errors = record.errors
    assert known.asked[1][1] == 1 / RATIOS[0]
    assert starts[main[1]] < errors.until < starts[other]
    assert errors.holds is None
    assert errors.verdict.endswith(f"up to {errors.until:.6g} s")
    assert errors.events == (starts[main] < errors.until).sum() >= 2
    assert errors.statistics
    assert any("cannot be trusted" in note for note in record.notes)
    known.part = changed(ladder, small[starts[small] < starts[main[0]]][0], last_block=1)
    record = known.verified(None)  # earlier events do not tell what is wanted
    assert (record.errors.until, record.errors.events) == (None, len(main))
    assert not any("cannot be trusted" in note for note in record.notes)


def test_an_event_that_ends_in_one_run_alone_ends_the_trust(ladder):
    """Even if forces agree as long as it lasts in both."""
    main, starts = main_events(ladder), ladder.events["t_start"]
    known = Known(ladder, step=1e-4)
    known.evaluations = 10**5
    known.part = going_on(without(ladder, range(main[-1] + 1, len(ladder.events) + 1)), main[-1])
    errors = known.verified(None).errors
    assert starts[main[-2]] < errors.until < starts[main[-1]]
    assert errors.holds is None
    assert errors.verdict.endswith(f"up to {errors.until:.6g} s")
    assert errors.events == len(main) - 1


def test_a_wrong_turn_has_no_order(ladder):
    """Events of other lengths are no errors of some order in the step."""
    record = Known(ladder, turn=1.0 - 1e-9).verified(None, tolerance=0.02)
    assert record.errors.start == pytest.approx(TURNED * 0.005)


def test_linear_geometry_gives_way(ladder):
    known = Known(ladder, bonds=0.05)
    record = known.verified(None, geometry="linear")
    assert record.method.geometry == "finite"
    assert [geometry for geometry, *_ in known.asked] == ["linear", "finite", "finite"]
    assert known.asked[-1][1:] == known.asked[0][1:]
    assert known.ends[-1] is None  # this run is the result: no budget ends it
    assert record.errors.start < 1e-12


def test_jumps_are_compared_with_stricter_ones(ladder):
    record = Known(ladder, jumps=10.0).verified(None)
    factor = SAFETY / (1 + 2.5**-4)
    assert record.errors.start == pytest.approx(factor * 10 * (1e-4 - ACCURACY))
    for accuracy, stricter in ((1e-3, ACCURACY), (ACCURACY, ACCURACY / 10), (1e-9, 1e-9)):
        known = Known(ladder)
        known.verified(None, accuracy=accuracy)
        assert known.asked[1][2] == pytest.approx(stricter)


def test_a_few_events_that_are_not_determined_are_named(ladder):
    """One of many that every step changes; all others are measured."""
    known = Known(ladder, step=1e-6)
    plain, event = known.run, known.main[3]

    def run(scene, t_end, options, enough=None):
        record = plain(scene, t_end, options)
        events = record.events
        events.loc[event, "F_T_arrest"] += 0.2 * (options.dt / known.dt_0) ** 0.5 * scene.F_N
        return record.replace(events=events)

    known.run = run
    record = known.verified(None)
    assert record.errors.undetermined == (event,)
    assert record.errors.holds
    assert record.errors.arrest < 1e-9
    assert f"but for 1 events that are not determined: {event}" in str(record.errors)


def test_an_event_of_the_other_run_alone_is_no_undetermined_one(ladder, monkeypatch):
    """It has no number in this run, by which it could be named."""
    begin, plain = ladder.events["t_start"][main_events(ladder)[5]], verification.differences

    def planted(a, b, *more):
        found = plain(a, b, *more)
        row = {"event": 0, "other": 1, "t_start": begin, "start": 0.3, "own": False}
        return found._replace(events=pd.concat([found.events, pd.DataFrame([row])]))

    monkeypatch.setattr(verification, "differences", planted)
    errors = Known(ladder, step=1e-6).verified(None).errors
    assert not errors.undetermined
    assert errors.until < begin


def test_from_when_on_single_events_cannot_be_trusted_is_said(ladder):
    """Runs that differ however small the step."""
    known = Known(ladder, chaos=4, noise=5.0)
    record = known.verified(None)
    at = float(ladder.events["t_start"][known.main[4]])
    ends = ladder.events["t_stop"].to_numpy()
    assert record.errors.until == ends[ends < at].max()  # it may begin earlier in another run
    assert record.errors.start < 1e-12
    assert record.errors.statistics["main events"][1] == 0
    assert any("single events cannot be trusted" in note for note in record.notes)
    assert Known(ladder, step=1e-4, chaos=4).verified(None).errors.until is None


def test_what_no_refinement_helps_is_said(ladder):
    """No main event can be trusted: the errors of all are reported."""
    record = Known(ladder, step=1e4).verified(None)
    assert record.errors.holds is False
    assert record.errors.start > 1
    assert "does not hold, BEYOND" in record.notes[-1]


def test_where_nothing_can_be_trusted_the_errors_of_all_events_are_reported(ladder):
    """The first event slips other blocks with each step."""
    known = Known(ladder, step=1e4)
    plain = known.run

    def run(scene, t_end, options, enough=None):
        record = plain(scene, t_end, options)
        return changed(record, 1, last_block=round(known.dt_0 / options.dt))

    known.run = run
    errors = known.verified(None).errors
    assert (errors.until, errors.holds) == (0.0, False)
    assert errors.start > 1
    assert "up to" not in errors.verdict


def test_a_part_that_was_not_compared_is_said(ladder):
    """A reference run that ends where its budget does."""
    known = Known(ladder, step=1e-6)
    plain = known.run

    def run(scene, t_end, options, enough=None):
        record = plain(scene, t_end, options)
        if enough is None:
            return record
        short = record.curve["t"] <= 0.7
        curve = record.curve[short].reset_index(drop=True)
        return record.replace(curve=curve, status="interrupted")

    known.run = run
    record = known.verified(None)
    assert record.errors.measured() < 1e-5
    assert record.errors.holds is None
    assert record.errors.covered < 0.71
    assert "NOT MEASURED from there to 1.5 s" in record.notes[-1]


def test_a_reference_run_ends_where_its_budget_does():
    """However much more it takes than was counted."""
    scene = small_rod()
    ended = []

    def run(scene, t_end, options, enough=None):
        record = pyfric.simulate(scene, t_end, options, progress=False)
        ended.append(enough)
        return record

    how = pyfric.Options(fidelity="hybrid", geometry="finite", accuracy=1e-4)
    made = Specification(scene=scene, t_begin=0.0, t_end=1e-3, options=how, run=run)
    record = verified(run(scene, 1e-3, how), made)
    (_, enough) = ended
    most = dataclasses.replace(record, counts={"block_evaluations": 10**12, "steps": 10**9})
    assert enough(most)
    assert not enough(record)


def test_nothing_is_measured_where_a_run_has_used_up_its_price():
    scene, how = small_rod(), pyfric.Options(fidelity="hybrid", geometry="finite", accuracy=1e-4)

    def run(scene, t_end, options, enough=None):
        return integrate(HybridRun, scene, t_end, options, progress=False, enough=enough)

    made = Specification(scene=scene, t_begin=0.0, t_end=0.4, options=how, run=run)
    record = run(scene, 0.4, how)
    before = verified(record, made).errors
    assert before.holds
    assert before.covered >= 0.4
    after = verified(record, dataclasses.replace(made, work=1e-3, whole=1e-3)).errors
    assert after.holds is None
    assert after.covered < 0.1


def test_a_ladder_is_compared_with_dynamics():
    scene = small_rod()
    record = pyfric.simulate(scene, 0.7, tolerance=0.1, progress=False)
    assert record.method.engine == "quasistatic"
    (by,) = record.errors.by
    assert by.startswith("dynamics (hybrid engine, finite geometry")
    other = pyfric.simulate(scene, 0.7, fidelity="hybrid", progress=False)
    found = differences(record, other).before(record.errors.covered)
    factor = TURNED if found.turned else DYNAMICS
    assert record.errors.start == pytest.approx(found.errors(factor)["start"], rel=0.05)


def test_the_perturbed_driver_follows_its_protocol_faster():
    scene = preset("fig1", V=0.0).replace({"driver.protocol": ((0.0, 1e-3),)})
    seen = []

    def run(scene, t_end, options, enough=None):
        seen.append(scene)
        return record

    record = pyfric.simulate(scene, 1e-3, fidelity="dynamic", progress=False)
    made = Specification(scene=scene, t_begin=0.0, t_end=1e-3, options=Options(), run=run)
    check = _Verification(record, made)
    check._perturbed(Errors())
    assert seen[0].driver.protocol == ((0.0, 1e-3 * (1 + PERTURBATION)),)
    still = dataclasses.replace(made, scene=scene.replace({"driver.protocol": ()}))
    check = _Verification(record, still)
    check._perturbed(Errors())
    assert check.notes == ["sensitivity was not measured: no driver moves"]


def test_a_run_that_a_slightly_faster_driver_changes_from_the_start_does_not_hold(ladder):
    """Although a shorter step does not change it."""
    options = Options(
        fidelity="hybrid", geometry="finite", dt=pyfric.step_size(ladder.scene), tolerance=0.01
    )

    def run(scene, *_, **__):
        changed = scene != ladder.scene
        return Known(ladder, step=0.1 * changed).run(ladder.scene, 1.5, options)

    made = Specification(scene=ladder.scene, t_begin=0.0, t_end=1.5, options=options, run=run)
    check = _Verification(run(ladder.scene), made)
    method = check.record.method
    method = dataclasses.replace(method, dt=method.dt / 2)
    errors = check._compared(dataclasses.replace(check.record, method=method))
    assert errors.holds
    errors = check._perturbed(errors)
    assert errors.start == pytest.approx(0.1 * SAFETY)
    assert errors.until < ladder.events["t_start"][main_events(ladder)[0]]
    assert errors.holds is False
    assert "a driver that is faster by 1e-09" in str(errors)
