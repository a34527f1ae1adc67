"""Measured errors: records with known differences, and the texts on errors."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest
from helpers import refused, small_rod

import pyfric
from pyfric.record import Errors, Model, Record, differences, statistics, summary
from pyfric.record.measured import SAID
from pyfric.scene import setup1, slab


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
    """Return the record without some events, with new numbers for the others."""
    kept = ~record.events.index.isin(events)
    arrays = {name: array[kept] for name, array in record.arrays.items()}
    return record.replace(events=record.events[kept], arrays=arrays)


# --- comparisons ---------------------------------------------------------------------------------


def test_a_record_does_not_differ_from_itself(ladder):
    found = differences(ladder, ladder).errors()
    assert found["events"] == ladder.events["is_main"].sum() > 5
    assert [found[name] for name in ("start", "arrest", "length", "stress")] == [0, 0, 0, 0]
    assert found["rupture"] is None  # the quasi-static sequence has no motion
    names = ("start", "arrest", "length", "stress")
    assert found["compared"] == dict.fromkeys(names, found["events"])
    table = differences(ladder, ladder).events
    assert (table["event"] == table["other"]).all()
    assert set(table["event"]) == set(main_events(ladder))


def test_runs_with_other_blocks_are_not_compared(ladder):
    other = pyfric.simulate(setup1(L=0.04, H=0.015, F_N=800.0), 0.1, fidelity="quasistatic")
    assert other.scene.N_x != ladder.scene.N_x
    refused(lambda: differences(ladder, other), "other", value=17, within=(13,))


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
    """Times stretched by 5 % make speeds 5 % slower; a missing front has the error 1."""
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
    """If front speeds are wanted, events without common speeds make runs differ, too."""
    main = main_events(ladder)
    longer = differences(changed(ladder, main[2], L_p_over_L=0.1), ladder)
    assert list(longer.beyond(0.01, "front_speed")["event"]) == [main[2]]
    assert longer.beyond(0.01).empty
    assert differences(ladder, ladder).beyond(0.01, "front_speed").empty


def test_an_event_after_the_end_is_not_compared(ladder):
    """A run that ends just before its last event differs at least by the force it reached."""
    main = main_events(ladder)
    t = float(ladder.events["t_start"][main[-1]])
    short = pyfric.simulate(ladder.scene, t - 1e-4, fidelity="quasistatic")
    late = changed(ladder, main[-1], t_start=-2e-4)  # the other run has it just before
    for found in (differences(late, short), differences(short, late)):
        assert found.errors()["start"] < 1e-3
        assert found.open.sum() == 1
        assert found.covered == pytest.approx(t - 2e-4, abs=1e-12)
    how = {"want": "precursors", "tolerance": 0.01, "t_end": t - 1e-4}
    assert Errors(**how, **found.errors()).holds is None


def test_an_event_that_began_later_is_compared_where_the_other_run_goes_on(ladder):
    """The error of its force is far larger than the driver's change up to the shorter run's end."""
    main, F_N = main_events(ladder), ladder.scene.F_N
    t = float(ladder.events["t_start"][main[-1]])
    short = pyfric.simulate(ladder.scene, t + 1e-6, fidelity="quasistatic")
    later = changed(ladder, main[-1], t_start=1e-3, F_T_start=0.03 * F_N)
    for found in (differences(short, later), differences(later, short)):
        assert found.errors()["start"] == pytest.approx(0.03)
        assert not found.open.any()


def test_an_event_begun_while_the_last_one_goes_on_is_part_of_it(ladder):
    """One of two runs has a pause inside its last event: there is nothing to compare."""
    main = main_events(ladder)
    fewer = without(ladder, range(main[-2] + 1, len(ladder.events) + 1))
    assert differences(ladder, fewer).errors()["start"] > 1e-3
    events = fewer.events
    events.loc[main[-2], "finished"] = False
    assert differences(ladder, fewer.replace(events=events)).errors()["start"] == 0


@pytest.mark.parametrize("parts", [False, True])
def test_an_event_that_goes_on_is_compared_by_its_force(ladder, parts):
    """Two runs separate inside their last event, which a pause may split in one of them."""
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
    """The exception is an event so late that the pause after it is unknown."""
    last = main_events(ladder)[-1]
    ended = without(ladder, range(last + 1, len(ladder.events) + 1))
    on = going_on(ended, last)
    assert differences(ended, on).turned
    assert differences(on, ended).turned
    late = float(ended.events["t_stop"][last]) + 0.9 * ladder.method.t_gap
    assert not differences(ended, on, late).turned
    assert not differences(on, on).turned


def test_other_blocks_or_a_further_slip_are_another_turn(ladder):
    event = main_events(ladder)[2]
    assert not differences(ladder, ladder).turned
    for name in ("n_blocks", "first_block", "last_block", "n_episodes"):
        assert differences(changed(ladder, event, **{name: 1}), ladder).turned
    one, other = (
        run.replace(events=run.events.assign(finished=run.events.index != event))
        for run in (changed(ladder, event, n_episodes=1), ladder)
    )
    assert differences(one, other).turned  # the event goes on in both runs


def test_arrests_near_the_end_of_both_runs_are_compared(ladder):
    """Both runs have come to rest, too late to know whether the event goes on."""
    last, F_N = main_events(ladder)[-1], ladder.scene.F_N
    ended = without(ladder, range(last + 1, len(ladder.events) + 1))
    events = ended.events
    events.loc[last, "finished"] = False
    one = ended.replace(events=events)
    other = changed(one, last, F_T_arrest=0.054 * F_N)
    assert differences(one, other).errors()["arrest"] == pytest.approx(0.054)


def test_arrests_are_compared_where_one_run_ends_soon_after(ladder):
    """This run has come to rest, too late to know whether the event goes on."""
    last, F_N = main_events(ladder)[-1], ladder.scene.F_N
    ended = without(ladder, range(last + 1, len(ladder.events) + 1))
    events = ended.events
    events.loc[last, "finished"] = False
    events.loc[last, "F_T_arrest"] += 1e-7 * F_N  # far less than the change between samples
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
    """Such runs measure errors of loading curves alone."""
    t = float(ladder.events["t_start"].iloc[0])
    one = pyfric.simulate(ladder.scene, 0.9 * t, fidelity="quasistatic")
    assert not len(one.events)
    off = one.curve.assign(F_T=one.curve["F_T"] * 1.5)
    found = differences(one, one.replace(curve=off)).errors()  # a change at two samples
    end = one.curve["F_T"].iloc[-1] / one.scene.F_N
    assert found["curve"] == pytest.approx(0.5 * end, rel=1e-12)
    fine = resampled_at(one, np.linspace(0, one.curve["t"].iloc[-1], 100))
    off = fine.replace(curve=fine.curve.assign(F_T=fine.curve["F_T"] * 1.5))
    found = differences(fine, off).errors()
    assert found["events"] == 0
    assert (found["start"], found["arrest"]) == (None, None)
    assert found["curve"] == pytest.approx(0.5 * fine.curve["F_T"].max() / one.scene.F_N, rel=0.1)
    same = differences(fine, fine).errors()
    for want in ("loading_curve", "motion"):
        assert Errors(want=want, tolerance=0.1, **same).holds is True
    for want in ("precursors", "stress", "front_speed"):
        errors = Errors(want=want, tolerance=0.1, **same)
        assert (errors.measured(), errors.holds) == (None, None)
        assert f"for {want} within 0.1: NOT MEASURED" in str(errors)
        assert "force within 0 F_N (100 points without slip)" in str(errors)


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


# --- what is said --------------------------------------------------------------------------------


def test_beyond_the_tolerance_is_said():
    how = {"want": "precursors", "tolerance": 0.01, "factor": 3.0}
    how["by"] = (Model(engine="hybrid", geometry="finite", faster=0.1),)
    errors = Errors(**how, start=0.02, arrest=0.001)
    assert errors.holds is False
    assert errors.measured() == 0.02
    assert "BEYOND 0.01" in str(errors)
    assert "by hybrid, finite geometry, a driver that is faster by 0.1, differences times 3" in str(
        errors
    )


# --- measured, or not ----------------------------------------------------------------------------


def test_what_was_not_measured_is_never_zero(ladder, tmp_path):
    """Unmeasured errors are None in numbers, text, JSON and on the page."""
    for want in ("precursors", "stress", "front_speed", None):
        errors = Errors(want=want, tolerance=0.01)
        assert errors.measured() is None
        assert errors.holds is None
        assert {getattr(errors, name) for name in SAID} == {None}
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
    some = {"arrest": 0.01, "events": 3, "covered": 0.5}
    errors = Errors(want="precursors", tolerance=0.1, **some)
    assert (errors.measured(), errors.holds) == (None, None)  # no start force was compared
    assert Errors(want="precursors", tolerance=0.1, start=0.02, **some).holds is True
    said = str(errors)
    assert "measured errors, up to 0.5 s (3 events):\n  force at arrest within 0.01 F_N\n" in said
    assert (
        "force at start, force, slipped length, stresses, rupture times, front speed not measured"
        in said
    )


def test_a_record_that_nothing_was_compared_with_says_so(ladder):
    record = ladder.replace(errors=None)
    assert "errors not measured (a planned run" in record.summary()
    assert summary(record, [])["errors"]["holds"] is None


def test_rupture_times_of_blocks_that_one_front_alone_passes_count(ladder):
    """Three blocks have rupture times without front speeds; a missing block has the error 1."""
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
    """One run is some blocks ahead; on common blocks its times are 3 % longer."""
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
    lost = differences(run, without(run, [1])).errors()  # the block never ruptures
    assert lost["rupture"] == pytest.approx(run.curve["t"].iloc[-1] / span)
