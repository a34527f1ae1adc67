"""Slip sensors: their events are those of the run, their arrivals are its first slips."""

import functools

import numpy as np
import pandas as pd
import pytest

import pyfric
from pyfric.figures import event_frames
from pyfric.fitting import Arrivals, Events
from pyfric.fitting.problem import Problem
from pyfric.fitting.sensors import ARRIVALS, checked
from pyfric.measured import OF_SLIP, Curve, arrivals, events, noise_of, sampled
from pyfric.measured.sensors import displacement
from pyfric.values import SceneError

NOISE, STEP, T_END = 1e-6, 5e-4, 1.3
FINE = 1e-6
"""Time between samples of a sensor that resolves fronts, s."""


@functools.cache
def run(fidelity="quasistatic", t_end=T_END, **changes):
    scene = pyfric.preset("fig1", l="5 mm", **changes)
    return pyfric.simulate(scene, t_end, fidelity=fidelity, progress=False)


# --- events --------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 8, 29])
def test_a_sensor_sampled_fully_has_the_slip_of_each_event(n):
    record = run()
    x = (n - 1) * record.scene.slider.l
    own, found = events(record, x=x), events(sampled(record, x=x), t_gap=0)
    assert list(own) == list(found) == list(OF_SLIP)
    episodes = record.episodes[record.episodes["n"] == n]
    known = episodes.groupby("event")["slip"].sum()
    assert len(known) >= 5
    np.testing.assert_allclose(own["slip"], known, rtol=1e-9)
    np.testing.assert_allclose(own["t_start"], record.events["t_start"].loc[known.index])
    for name in ("t_start", "before", "after", "slip", "recurrence"):
        np.testing.assert_allclose(found[name], own[name], rtol=1e-9, atol=1e-15)
    assert own["after"].iloc[-1] == pytest.approx(known.sum())
    np.testing.assert_allclose(own["rate"].dropna(), 0, atol=1e-12)  # no creep


def test_slip_of_all_sensors_is_the_potency_of_events():
    record = run()
    l, total = record.scene.slider.l, 0.0
    for n in range(record.scene.N_x):
        total += l * events(record, x=n * l)["slip"].sum()
    assert total == pytest.approx(record.events["potency"].sum(), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("x", ["0 mm", "35 mm", "0.14 m"])
def test_in_noise_no_slip_above_five_sigma_is_lost(seed, x):
    record = run()
    found, known = events(sampled(record, STEP, x=x, noise="1 um", seed=seed)), events(record, x=x)
    assert found.attrs["noise"] == NOISE
    large = known[known["slip"] > 5 * NOISE]
    assert len(large) >= 5
    for _, row in large.iterrows():
        near = found[np.abs(found["t_start"] - row["t_start"]) < 4 * STEP]
        assert len(near) == 1
        for name in ("before", "after", "slip"):
            assert abs(near[name].iloc[0] - row[name]) < 4 * near[f"{name}_error"].iloc[0]
    for t in found["t_start"]:
        assert np.abs(known["t_start"] - t).min() < 4 * STEP


def test_errors_of_slip_are_what_they_say():
    known, off = events(run(), x=0.035), []
    for seed in range(24):
        found = events(sampled(run(), STEP, x=0.035, noise=NOISE, seed=seed))
        for _, row in found[found["slip"] > 8 * NOISE].iterrows():
            near = known.iloc[np.argmin(np.abs(known["t_start"] - row["t_start"]))]
            off += [(row[k] - near[k]) / row[f"{k}_error"] for k in ("before", "after", "slip")]
    assert len(off) > 500
    assert np.mean(np.square(off)) == pytest.approx(1, abs=0.2)


def test_full_dynamics_has_the_same_slip():
    record = run("hybrid", 0.8)
    for x in (0.0, 0.035):
        known = events(record, x=x, t_gap=8 * STEP, threshold="5 um")
        found = events(sampled(record, STEP, x=x, noise=NOISE))
        assert len(known) >= 5
        for _, row in known.iterrows():
            near = found[np.abs(found["t_start"] - row["t_start"]) < 4 * STEP]
            assert len(near) == 1
            assert abs(near["slip"].iloc[0] - row["slip"]) < 4 * near["slip_error"].iloc[0]


def test_slow_steps_have_a_speed_and_creep_a_rate():
    t = np.arange(4000) * STEP
    slip = 5e-6 * t + 40e-6 * (np.clip((t - 0.8) / 0.05, 0, 1) + (t > 1.4))
    slip += 1e-7 * np.random.default_rng(0).standard_normal(len(t))
    curve = Curve.of(t=t, slip=slip)
    first, second = events(curve).itertuples()
    assert (first.t_start, first.t_stop) == pytest.approx((0.8, 0.85), abs=4e-3)
    assert first.speed == pytest.approx(40e-6 / 0.05, rel=0.1)
    assert second.rate == pytest.approx(5e-6, rel=0.05)
    assert second.slip == pytest.approx(40e-6, abs=3e-7)
    assert second.recurrence == pytest.approx(0.6, abs=4e-3)
    assert noise_of(curve) == pytest.approx(1e-7, rel=0.1)


def test_slip_is_the_displacement_of_the_block():
    """Slip is compared with states at rest, which do not come from episodes."""
    record = run()
    t, u = displacement(record, 2 * record.scene.slider.l)
    quiet = record.quiet
    at = np.interp(quiet["t"][quiet["kind"] < 0] + 1e-9, t, u)
    np.testing.assert_allclose(at, quiet["u_x"][quiet["kind"] < 0][:, 2], atol=1e-12)


def test_slip_of_a_run_that_records_motion():
    """Recorded motion at points of the curve agrees with the slip episodes."""
    scene = pyfric.preset("chain", V=0.05, d_c=1e-8, alpha=0.05)
    how = {"sample": 1e-6, "threshold": "1 um/s", "t_gap": 1e-5, "dt": 1e-7, "progress": False}
    record = pyfric.simulate(scene, 2e-3, fidelity="dynamic", **how).with_events()
    for x in (0.0, 2 * scene.slider.l):
        t, slip = displacement(record, x)
        assert len(t) == len(record.curve)
        assert slip[-1] > 0
        known = events(record, x=x)
        assert len(known) > 2
        assert known["slip"].sum() == pytest.approx(known["after"].iloc[-1], rel=1e-9, abs=0)
        for name, time in (("before", "t_start"), ("after", "t_stop")):
            at = np.interp(known[time], t, slip)
            np.testing.assert_allclose(at, known[name], rtol=1e-3, atol=1e-9)


def test_a_curve_has_forces_or_slip_or_both(tmp_path):
    t = np.arange(400) * STEP
    slip = 30e-6 * (t > 0.1) + NOISE * np.random.default_rng(1).standard_normal(len(t))
    mu = 0.5 * t - 0.05 * (t > 0.12) + 1e-4 * np.random.default_rng(2).standard_normal(len(t))
    both, alone = Curve.of(t=t, mu=mu, slip=slip), Curve.of(t=t, slip=slip)
    assert "peak" in events(both)
    pd.testing.assert_frame_equal(events(both, column="slip"), events(alone))
    path = tmp_path / "sensor.csv"
    rows = np.column_stack([t, 1e6 * slip])
    np.savetxt(path, rows, delimiter=",", header="time (s),slip (um)", comments="")
    read = pyfric.measured.read(path)
    np.testing.assert_allclose(events(read)["slip"], events(alone)["slip"], rtol=1e-6)
    np.savetxt(path, rows, delimiter=",", header="time (s),slip", comments="")
    with pytest.raises(SceneError, match=r"units.slip: missing|'slip' has no unit"):
        pyfric.measured.read(path)
    force = Curve.of(t=t, mu=mu)
    for call, text in (
        (lambda: events(force, column="slip"), "column = 'slip'.*allowed: force"),
        (lambda: events(alone, column="force"), "column = 'force'.*allowed: slip"),
        (lambda: events(alone, x=0.1), "it is of runs"),
        (lambda: events(run(), column="slip"), "x, the place"),
        (lambda: events(run(), x=0.3), "x = 0.3 m"),
        (lambda: events(Curve.of(t=t, slip=-slip)), "it decreases"),
        (lambda: events(Curve.of(t=t, slip=slip.round(4))), "digits are coarser"),
        (lambda: alone.over_F_N, "no force"),
        (lambda: sampled(run(), x="-1 mm"), "x = "),
        (lambda: sampled(run(), x=0.0, noise="1 s"), "noise"),
    ):
        with pytest.raises(SceneError, match=text):
            call()


# --- arrivals ------------------------------------------------------------------------------------


def recorded(event, noise, seed, frames, phase=0.0):
    """Return the table of forces, and the curves of sensors that an event triggers.

    `phase` is the position of the first slip between two samples. Slip in the event is that of the
    recorded motion, or linear from its start to its stop.
    """
    record = run("hybrid", 0.5)
    rng, sensors = np.random.default_rng(seed), {}
    l, start = record.scene.slider.l, record.events["t_start"].loc[event]
    t = start + FINE * (np.arange(-200, 110) + phase)
    moved = seen_in_frames(event) if frames else None
    for n in np.flatnonzero(np.isfinite(record.rupture_times[event - 1])):
        if moved is None:
            slip = np.interp(t, *displacement(record, l * n))
            slip = slip - slip[0]
        else:
            slip = np.interp(t, moved[0], moved[1][:, n])
        sensors[l * n] = Curve.of(t=t, slip=slip + noise * rng.standard_normal(len(t)))
    return record, events(sampled(record, STEP, noise=1e-3)), sensors


@functools.cache
def seen_in_frames(event):
    record = run("hybrid", 0.5)
    times = record.events["t_start"].loc[event] + FINE * np.arange(110)
    frames = event_frames(record, event, times)
    t, v = np.array([frame.t for frame in frames]), np.array([frame.v[0, 0] for frame in frames])
    steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None]
    return t, np.concatenate([np.zeros((1, v.shape[1])), np.cumsum(steps, axis=0)])


def late(record, event, found):
    n = np.round(found["x"] / record.scene.slider.l).astype(int)
    return found["t"].to_numpy() - record.rupture_times[event - 1][n]


@pytest.mark.parametrize("noise", [1e-8, 1e-7])
def test_arrivals_are_first_slips_within_their_errors(noise):
    """Slip is a line with one corner here."""
    off = []
    for seed in range(6):
        record, table, sensors = recorded(5, noise, seed, frames=False, phase=seed / 6)
        found = arrivals(table, sensors)
        assert list(found) == list(ARRIVALS)
        checked("arrivals", found, ARRIVALS)
        assert set(found["event"]) == {4}  # noise hides one of the earlier events
        assert len(found) == np.isfinite(record.rupture_times[4]).sum() == 8
        off += (late(record, 5, found) / found["error"]).tolist()
    assert np.mean(np.square(off)) == pytest.approx(1, abs=0.5)


def test_arrivals_of_slip_that_begins_smoothly_are_late_together():
    """The motion is that of full dynamics. The first block begins most slowly."""
    record, table, sensors = recorded(5, 2e-8, 0, frames=True)
    off = late(record, 5, arrivals(table, sensors))
    assert np.abs(off[1:] - off[1:].mean()).max() < FINE
    assert 0 < off[1:].mean() < FINE
    assert 0 < off[0] < 4 * FINE
    assert np.ptp(record.rupture_times[4][:8]) > 25 * FINE


def test_arrivals_are_residuals_of_a_fit():
    """At the true parameters the residuals are as small as noise."""
    record, table, sensors = recorded(5, 1e-8, 0, frames=False)
    own = Events(table, "all")
    data = Arrivals(arrivals(table, sensors), own)
    how = {"fidelity": "hybrid", "progress": False}
    problem = Problem([record.scene], [own + data], {"mu_k": (0.4, 0.5)}, how, 0.0)
    off = [problem.residuals(np.array([u]))[-data.size :] for u in (0.5, 0.2)]
    assert 0.1 < np.mean(off[0] ** 2) < 3
    assert np.mean(off[1] ** 2) > 10


def test_sensors_belong_to_the_events_of_a_curve():
    _, table, sensors = recorded(5, 1e-8, 0, frames=False)
    wrong = "place -> Curve"
    for kept, text in (
        ([], wrong),
        ({0.0: table}, wrong),
        ({}, "none does"),
        ({-0.1: sensors[0.0]}, "sensors = -0.1"),
    ):
        with pytest.raises(SceneError, match=text):
            arrivals(table, kept)
    later = {x: Curve.of(t=c.t + 0.02, slip=c.table["slip"]) for x, c in sensors.items()}
    with pytest.raises(SceneError, match="same zero of time"):
        arrivals(table, later)
    assert set(arrivals(table, later, within="25 ms")["event"]) == {4}
    both = {0.0: sampled(run(), STEP, x=0.0, noise=NOISE)}
    own = events(sampled(run(), STEP, noise=1e-3))
    found, known = arrivals(own, both), events(run(), x=0.0)
    assert found["event"].is_unique
    assert len(found) > 10
    for _, row in found.iterrows():
        assert np.abs(known["t_start"] - row["t"]).min() < 2 * STEP
