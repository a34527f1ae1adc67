"""Events by slip rate: passages through a threshold in steps and between points."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from helpers import refused

import pyfric
from pyfric.record.rates import SAMPLED, contacts_at, fast_slip

SMALL = {"L": 0.05, "H": 0.02, "V": 20e-3, "F_N": 700.0}
QUIET = {"progress": False, "threads": 1}
THRESHOLD = 1e-3  # m/s
T_END = 8e-3  # s
APART = 5e-5  # s


@pytest.fixture(scope="module")
def scene():
    return pyfric.preset("fig1", **SMALL)


@pytest.fixture(scope="module")
def every(scene):
    """Return a run of full dynamics with a point of the curve after each step."""
    dt = 0.78e-6
    how = {"dt": dt, "sample": dt, "threshold": "1 mm/s", "switching": "step_end"}
    return pyfric.simulate(scene, T_END, fidelity="dynamic", **how, **QUIET)


@pytest.fixture(scope="module")
def rated():
    scene = pyfric.preset("rate_and_state", L=0.05, H=0.02)
    how = {"threshold": "0.2 mm/s", "sample": APART}
    return pyfric.simulate(scene, 0.9, fidelity="hybrid", **how, **QUIET)


# --- in every step -------------------------------------------------------------------------------


def test_a_threshold_changes_no_bit_of_the_run(scene, every):
    how = {"dt": every.method.dt, "sample": every.method.dt, "switching": "step_end"}
    plain = pyfric.simulate(scene, T_END, fidelity="dynamic", **how, **QUIET)
    assert plain.curve.equals(every.curve)
    for log in ("switches", "quiet"):
        for name, values in getattr(plain, log).items():
            np.testing.assert_array_equal(getattr(every, log)[name], values)
    assert every.with_events().episodes.equals(plain.episodes)
    assert "v_x" not in plain.motion
    assert "v_x" in every.motion


def test_passages_are_those_of_the_motion_after_each_step(every):
    """Motion is recorded after each step, with speeds in single precision."""
    motion = every.replace(method=dataclasses.replace(every.method, threshold=None))
    found = fast_slip(motion, THRESHOLD)
    assert found.notes
    known = every.crossings
    assert len(known["t"]) > 20
    for name in ("step", "block", "old", "new"):
        np.testing.assert_array_equal(found.crossings[name], known[name])
    dt = every.method.dt
    np.testing.assert_allclose(found.crossings["t"], known["t"], rtol=0, atol=1e-3 * dt)
    for name in ("step", "kind"):
        np.testing.assert_array_equal(found.bursts[name], every.bursts[name])
    np.testing.assert_allclose(found.bursts["sum_v"][1::2], every.bursts["sum_v"][1::2], rtol=1e-5)


def test_fast_slip_lies_within_slip_by_contact(every):
    contact, rate = every.with_events(), every.with_events("1 mm/s")
    assert len(rate.episodes) >= len(every.events) > 2
    slips = contact.episodes
    for _, one in rate.episodes.iterrows():
        mine = slips[slips["i"] == one["i"]]
        ends = mine["t_stop"].fillna(np.inf) + every.method.dt
        assert ((mine["t_start"] <= one["t_start"]) & (ends >= one["t_start"])).any()


def test_a_continued_run_has_the_same_events(scene):
    how = {"fidelity": "dynamic", "threshold": THRESHOLD, "sample": 2e-5}
    whole = pyfric.simulate(scene, T_END, **how, **QUIET)
    t = float(whole.events["t_start"].iloc[1]) + 5e-6  # in an event
    first = pyfric.simulate(scene, t, **how, **QUIET)
    assert not first.events["finished"].iloc[-1]
    again = pyfric.simulate(scene, T_END, initial=first, **QUIET)
    assert again.method.threshold == THRESHOLD
    for log in ("crossings", "bursts"):
        for name, values in getattr(whole, log).items():
            if name != "sum_v":
                np.testing.assert_array_equal(getattr(again, log)[name], values)
    a, b = (record.bursts["sum_v"] for record in (again, whole))
    assert (a != b).sum() <= 1  # the present event: before the cut, points of the curve count
    np.testing.assert_allclose(a, b, rtol=0.4)


def test_blocks_that_are_fast_from_begin_to_end_count(scene, every):
    """Such blocks pass no threshold, because the initial state is inside an event."""
    t = float(every.events["t_start"].iloc[0]) + 8e-6
    before = pyfric.simulate(scene, t, dt=every.method.dt, fidelity="dynamic", **QUIET)
    how = {"initial": before.final_state, "threshold": 1e-9, "fidelity": "dynamic"}
    record = pyfric.simulate(scene, t + 3e-6, dt=every.method.dt, **how, **QUIET)
    fast = np.abs(before.final_state.y[0, 2]) > 1e-9
    assert set(record.episodes["i"]) >= set(np.flatnonzero(fast))
    assert len(np.setdiff1d(np.flatnonzero(fast), record.crossings["block"])) > 0
    again = record.events(threshold=1e-9)
    assert again["n_blocks"].tolist() == record.events["n_blocks"].tolist()


def test_a_file_keeps_them(every, tmp_path):
    assert pyfric.load(every.save(tmp_path / "one.nc")) == every


def test_the_hybrid_engine_has_the_same_events(scene):
    slower, how = scene.replace({"driver.V": 1e-3}), {"geometry": "linear", "threshold": 1e-3}
    how |= QUIET | {"dt": pyfric.step_size(slower)}
    hybrid = pyfric.simulate(slower, 0.1, fidelity="hybrid", accuracy=1e-6, **how)
    full = pyfric.simulate(slower, 0.1, fidelity="dynamic", **how)
    assert hybrid.counts["jumps"] > 1
    names = ["t_start", "t_stop", "potency", "t_fast", "potency_rate"]
    a, b = hybrid.events[names], full.events[names]
    assert len(b) > 1
    np.testing.assert_allclose(a.to_numpy(), b.to_numpy(), rtol=1e-4)
    motion, u_x = hybrid.motion["u_x"], full.motion["u_x"]
    np.testing.assert_allclose(motion, u_x, rtol=0, atol=1e-4 * np.abs(u_x - u_x[0]).max())


# --- between points of the curve -----------------------------------------------------------------


def test_times_between_points_are_linear(every):
    """In synthetic motion of block 3, v rises to 4 and falls to -2 between points 1 ms apart."""
    n, N_x = 5, every.scene.N_x
    t, v, u_x = 1e-3 * np.arange(n), np.zeros((n, N_x), dtype=np.float32), np.zeros((n, N_x))
    v[:, 2] = 0.0, 4.0, -2.0, 0.0, 0.0
    u_x[:, 2] = 0.0, 1.0, 2.0, 1.5, 1.5
    curve = pd.DataFrame({"t": t, "F_T": 10.0 + t})
    empty = {name: values[:0] for name, values in every.switches.items()}
    method = dataclasses.replace(every.method, threshold=None)
    state = every.final_state
    state.mode[:] = 0
    record = every.replace(
        curve=curve, motion={"u_x": u_x, "v_x": v}, switches=empty, final_state=state,
        method=method, episodes=every.episodes[:0], crossings={}, bursts={},
    )  # fmt: skip
    found = fast_slip(record, 1.0)
    np.testing.assert_array_equal(found.crossings["block"], [2, 2, 2])
    np.testing.assert_array_equal(found.crossings["new"], [1, -1, 0])
    expected = [1e-3 / 4, 1e-3 + 4 / 6 * 1e-3, 2e-3 + 1e-3 / 2]
    np.testing.assert_allclose(found.crossings["t"], expected, rtol=1e-12)
    np.testing.assert_array_equal(found.bursts["kind"], [1, -1])
    np.testing.assert_array_equal(found.bursts["u_x"][:, 2], [0.0, 1.5])
    assert found.bursts["sum_v"][1] == 4.0
    assert SAMPLED in found.notes[0]


def test_open_blocks_are_not_fast(every):
    t = every.curve["t"].to_numpy()
    modes = contacts_at(every, t[[0, -1]])
    np.testing.assert_array_equal(modes[-1], every.final_state.mode)
    assert (modes[0] == 0).all()


# --- rate-and-state friction ---------------------------------------------------------------------


def test_slow_events_are_found_as_roots_of_slip_without_inertia(rated):
    """Points of the curve are `APART` apart. Passages in the slow phase lie between them."""
    assert rated.counts["slow_steps"] > 100
    other = rated.with_events(1.0000001 * rated.method.threshold)
    assert any(SAMPLED in note for note in other.notes)
    assert not any(SAMPLED in note for note in rated.notes)
    known = rated.crossings
    assert (np.diff(known["step"]) >= 0).all()
    sums, seen = (bursts["sum_v"][1::2] for bursts in (rated.bursts, other.bursts))
    np.testing.assert_allclose(sums, seen, rtol=0.05)
    slow = rated.events.loc[rated.events["n_blocks"].idxmax()]
    fast = rated.with_events()
    assert slow["t_start"] < fast.events["t_start"].iloc[-1]  # begins before blocks reach v_slip
    near = other.episodes["t_start"].to_numpy()
    apart = [np.abs(near - t).min() for t in rated.episodes["t_start"] if t > 0]
    assert np.median(apart) < APART


def test_v_slip_is_the_criterion_of_its_own_events(rated):
    own, same = rated.with_events(), rated.with_events(rated.scene.law.kind.v_slip)
    pd.testing.assert_frame_equal(pd.DataFrame(own.events), pd.DataFrame(same.events))
    assert len(own.events) >= 1


# --- a front that creeps -------------------------------------------------------------------------


def test_a_creeping_front_has_a_precursor_and_a_static_friction():
    """With a fast driver and viscosity of slip, contacts show a single endless event."""
    scene = pyfric.preset("fig1", L=0.1, H=0.03, F_N=1e3, V=0.05, alpha=30.0, d_c=1e-5)
    record = pyfric.simulate(scene, 8e-3, fidelity="dynamic", threshold=0.1, **QUIET)
    creep = record.with_events()
    (event,) = creep.events.itertuples()
    assert (event.n_blocks, event.finished) == (scene.N_x, False)
    friction = pyfric.analysis.friction_coefficients(creep)
    assert friction.mu_s_macro == record.curve["F_T"].max() / scene.F_N
    assert 0 < friction.R < 1
    assert 0.5 < event.length_fast / scene.slider.L < 1
    table = pyfric.analysis.extent(creep, 1)
    slow, fast = (
        table["speed"][rows] for rows in (table["t"] < event.t_fast, table["t"] >= event.t_fast)
    )
    assert slow.median() < 0.5 * fast.max()
    assert 1 <= len(record.events) <= 3
    assert (record.events["t_start"] > event.t_fast).all()
    assert record.events["finished"].any()


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("threshold", [0, -1, "1 mm", float("nan"), "fast"])
def test_thresholds_are_checked(scene, every, threshold):
    refused(lambda: every.events(threshold=threshold), "threshold")
    refused(lambda: pyfric.simulate(scene, 1e-4, threshold=threshold, **QUIET), "threshold")


def test_a_record_without_rates_says_what_to_do(scene):
    record = pyfric.simulate(scene, 1e-3, fidelity="hybrid", **QUIET)
    refused(lambda: record.events(threshold="1 mm/s"), "threshold", "option threshold")
    refused(lambda: record.events(t_gap=-1.0), "t_gap")
    how = {"fidelity": "quasistatic", "threshold": 1e-3}
    refused(lambda: pyfric.simulate(scene, 1e-3, **how, **QUIET), "threshold")


def test_a_longer_pause_joins_events(every):
    assert len(every.events(threshold="1 mm/s", t_gap="0.1 s")) == 1
    assert len(every.events(t_gap=0.0)) >= len(every.events())
