"""Integral quantities of events: extent, onset of the fast part, potency, energies."""

import numpy as np
import pytest
from helpers import refused

import pyfric
from pyfric import analysis
from pyfric.record.balance import SLOW, _onset
from pyfric.record.zones import pace_limits

QUIET = {"progress": False, "threads": 1}
PARTS = ("elastic", "kinetic", "friction_heat", "switching_loss", "damped", "radiated")


@pytest.fixture(scope="module")
def record():
    scene = pyfric.preset("fig1", L=0.05, H=0.02, V=20e-3, F_N=700.0)
    return pyfric.simulate(scene, 12e-3, fidelity="dynamic", threshold="1 mm/s", **QUIET)


@pytest.fixture(scope="module")
def chain():
    """Return a chain with slip weakening and given p: heat follows from slip alone."""
    scene = pyfric.preset("chain", V=0.05, d_c=1e-8, alpha=0.05)
    how = {"sample": 1e-6, "threshold": "1 um/s", "t_gap": 1e-5, "dt": 1e-7}
    return pyfric.simulate(scene, 2e-3, fidelity="dynamic", **how, **QUIET).with_events()


# --- potency -------------------------------------------------------------------------------------


def test_potency_by_contact_is_all_slip(chain):
    """Without corner slip, blocks move only in events."""
    assert len(chain.events) > 2
    assert not chain.episodes["corner"].any()
    moved = chain.final_state.y[0, 0] - chain.motion["u_x"][0]
    total = chain.scene.slider.l * moved.sum()
    assert chain.events["potency"].sum() == pytest.approx(total, rel=1e-12, abs=0)
    history = analysis.potency_history(chain)
    assert history["potency"].iloc[-1] == pytest.approx(total, rel=1e-12, abs=0)


def test_potency_by_rate_is_that_between_its_logs(record):
    log, l, dt = record.bursts, record.scene.slider.l, record.method.dt
    events = record.events.dropna(subset="t_stop")
    assert len(events) > 2
    for _, event in events.iterrows():
        mine = (log["t"] > event["t_start"] - dt) & (log["t"] < event["t_stop"] + 2 * dt)
        rows = log["u_x"][mine]
        assert (log["kind"][mine][0], log["kind"][mine][-1]) == (1, -1)
        expected = l * (rows[-1] - rows[0]).sum()
        assert event["potency"] == pytest.approx(expected, rel=1e-12, abs=0)
    contact = record.with_events().events["potency"].sum()
    assert 0.9 * contact < record.events["potency"].sum() <= contact * (1 + 1e-4)


def test_potency_from_points_of_the_curve_is_that_of_its_rows(record):
    other = record.with_events("3 mm/s")
    u_x, t = record.motion["u_x"], record.curve["t"].to_numpy()
    events = other.events.dropna(subset="t_stop")
    assert (events["potency"] > 0).sum() > 1
    for _, event in events.iterrows():
        first = np.searchsorted(t, event["t_start"], side="right") - 1
        last = np.searchsorted(t, event["t_stop"])
        expected = record.scene.slider.l * (u_x[last] - u_x[first]).sum()
        assert event["potency"] == pytest.approx(expected, rel=1e-12, abs=0)


def test_potency_rate_is_the_slope_of_potency(record):
    event = int(record.events["potency"].idxmax())
    table = analysis.potency_history(record, event)
    slopes = np.diff(table["potency"]) / np.diff(table["t"])
    low, high = (
        fun(table["rate"][1:].to_numpy(), table["rate"][:-1].to_numpy())
        for fun in (np.fmin, np.fmax)
    )
    within = (slopes > low - 0.05 * slopes.max()) & (slopes < high + 0.05 * slopes.max())
    assert within.mean() > 0.95
    largest = record.events["potency_rate"][event]
    assert largest == pytest.approx(table["rate"].max(), rel=0.02)
    assert largest >= table["rate"].max() * (1 - 1e-6)


# --- energies ------------------------------------------------------------------------------------


@pytest.mark.parametrize("threshold", [None, "1 mm/s", "3 mm/s"])
def test_energies_of_events_balance(record, threshold):
    """The energies balance within the budget error of the run, which is due to steps."""
    events = record.events(threshold=threshold)
    left = events["work"] - events[list(PARTS)].sum(axis=1)
    assert np.abs(left).max() <= 2 * analysis.budget_left(record.curve).abs().max()
    assert np.abs(left).max() < 1e-3 * events["friction_heat"].max()


def test_heat_in_a_chain_follows_from_slip(chain):
    """Heat is mu_k p times slip, plus (mu_s - mu_k) p d_c/2 for each slip beyond d_c."""
    scene, law = chain.scene, chain.scene.law
    assert len(chain.events) > 2
    assert chain.curve["friction_heat"].is_monotonic_increasing
    for number, event in chain.events[chain.events["finished"]].iterrows():
        slips = chain.episodes[chain.episodes["event"] == number]
        d_c, p = float(np.max(scene.interface.d_c)), scene.F_N / scene.N_x
        way = np.minimum(slips["slip"].abs() / d_c, 1.0)
        weakening = (0.25 * p * d_c * (way - way**2 / 2)).sum()
        assert law.mean.mu_s - law.mean.mu_k == pytest.approx(0.25)
        assert event["weakening_heat"] == pytest.approx(weakening, rel=2e-3)
        kinetic = float(law.mean.mu_k) * p * slips["slip"].abs().sum()
        expected = kinetic + event["weakening_heat"] + event["viscous_heat"]
        assert event["friction_heat"] == pytest.approx(expected, rel=1e-6)
        assert event["viscous_heat"] > 0


def test_walls_take_what_is_radiated():
    """Without viscosity only the walls take energy from waves."""
    how = {"L": 0.02, "H": 0.01, "l": 1e-3}
    made = pyfric.preset("slab", **how) if "slab" in pyfric.PRESETS else None
    scene = made or pyfric.preset("tpv3", L=3000.0, H=1500.0, l=150.0)
    record = pyfric.simulate(scene, 1.0, fidelity="dynamic", energies=True, **QUIET)
    curve = record.curve
    assert scene.walls.absorb
    assert 0 < curve["radiated"].iloc[-1] < curve["dissipated_bonds"].iloc[-1]
    assert (curve["radiated"].diff().dropna() >= 0).all()
    event = record.events.iloc[0]
    assert event["radiated"] > 0
    left = event["work"] - event[list(PARTS)].sum()
    assert abs(left) <= 2 * analysis.budget_left(curve).abs().max()


def test_what_is_not_measured_is_nan(record):
    scene = record.scene
    hybrid = pyfric.simulate(scene, 6e-3, fidelity="hybrid", **QUIET)
    assert len(hybrid.events)
    assert hybrid.events[["work", *PARTS, "potency_rate"]].isna().all(axis=None)
    assert hybrid.events["potency"].notna().all()
    meanings = pyfric.record.held_in("events")
    assert "not measured" in meanings["friction_heat"].meaning
    refused(lambda: analysis.potency_history(hybrid), "record", "option threshold")


# --- extent --------------------------------------------------------------------------------------


def test_extent_counts_blocks(record):
    event = int(record.events["n_blocks"].idxmax())
    table, l = analysis.extent(record, event), record.scene.slider.l
    slips = record.episodes[record.episodes["event"] == event]
    for _, row in table.iterrows():
        before = slips[slips["t_start"] <= row["t"]]
        assert row["length"] <= l * before["n"].nunique() * (1 + 1e-12)
        now = (slips["t_start"] <= row["t"]) & ~(slips["t_stop"] <= row["t"])
        assert row["slipping"] == pytest.approx(l * now.sum())
    assert table["length"].iloc[-1] == pytest.approx(l * record.events["n_blocks"][event])
    k = len(table) // 2 - 2
    passed = table["t"].iloc[k + 4] - table["t"].iloc[k]
    assert table["speed"].iloc[k] == pytest.approx(4 * l / passed)
    refused(lambda: analysis.extent(record, 99), "event")


def test_the_fast_part_begins_where_speeds_stay_high(record):
    limit = SLOW * pace_limits(record.scene)[0]
    seen = 0
    for number, event in record.events.iterrows():
        table = analysis.extent(record, number)
        fast = (table["speed"] >= limit).to_numpy()
        if not fast.any():
            assert np.isnan(event["t_fast"])
            continue
        longest, k = 0, 0
        for i in range(len(fast)):
            length = next((j for j in range(i, len(fast)) if not fast[j]), len(fast)) - i
            if length > longest:
                longest, k = length, i
        assert (event["t_fast"], event["length_fast"]) == (table["t"][k], table["length"][k])
        seen += 1
    assert seen


def test_of_two_fast_stretches_the_longer_one_counts(record):
    """The front passes at 2, 0.5 and 2 times the limit of fast speeds, from either end."""
    l, fast = record.scene.slider.l, SLOW * pace_limits(record.scene)[0]
    pace = np.concatenate([np.full(5, 2.0), np.full(5, 0.5), np.full(8, 2.0)]) * fast
    t = np.concatenate([[0.0], np.cumsum(l / pace)])
    slips = record.episodes.iloc[np.zeros(2 * t.size, dtype=int)].reset_index(drop=True)
    n = np.tile(np.arange(1, t.size + 1), 2)
    event, start = np.repeat([1, 2], t.size), np.concatenate([t, 1.0 + t[::-1]])
    slips = slips.assign(n=n, event=event, t_start=start, t_stop=start + 1e-3)
    arrays = {name: values[:2] for name, values in record.arrays.items()}
    made = record.replace(episodes=slips, events=record.events.iloc[:2], arrays=arrays)
    speed = analysis.extent(made, 1)["speed"]
    first = int(np.flatnonzero(speed[5:] >= fast)[0]) + 5
    assert (speed[first:-4] >= fast).all()
    found = (first + 1) * l
    np.testing.assert_allclose(_onset(made), [[t[first], found], [1 + t[first], found]], rtol=1e-12)
    assert analysis.extent(made, 2)["n"].tolist() == list(range(t.size, 0, -1))
