"""Measured errors: records that differ by what is known, closed forms, refinement, files."""

import dataclasses
import math

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import small_rod

import pyfric
from pyfric.cli import main
from pyfric.engines.verification import PERTURBATION, coarser_step
from pyfric.record import Errors, Record, differences, statistics
from pyfric.scene import chain, setup1
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
    assert record.errors.arrest == pytest.approx(error, rel=1.0)
    assert record.errors.arrest > 0.5 * error
    sampled, _ = one_block(share, "sample")
    assert sampled.errors.arrest >= error


@pytest.fixture(scope="module")
def refined():
    """A plan in linear geometry whose front speeds need finite geometry."""
    scene = setup1(L=0.03, H=0.015, V=5e-3, F_N=800.0)
    return pyfric.simulate(scene, 0.06, want="front_speed", tolerance=0.03)


def test_a_plan_measures_its_errors(refined):
    errors = refined.errors
    assert errors.want == "front_speed"
    assert errors.tolerance == 0.03
    assert errors.holds
    assert 0 < errors.measured() == errors.speed_95 <= errors.speed_worst
    assert errors.events > 3
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


def test_the_price_is_at_most_the_cost_of_the_run():
    for want, tolerance in (("precursors", 0.01), ("front_speed", 0.05), ("motion", 0.01)):
        found = pyfric.plan(small_rod(), want, tolerance, t_end=0.7)
        assert 0 < found.price <= found.seconds * (1 + 1e-12)
        assert 0 < found.share <= 1


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
