"""Sizes of events: b-value with its error, completeness, counts and waiting times."""

import numpy as np
import pandas as pd
import pytest
from helpers import refused

import pyfric
from pyfric import analysis
from pyfric.record.recurrence import BIN, most_frequent

QUIET = {"progress": False, "threads": 1}


def magnitudes(b, n, seed, least=-8.0):
    """Return magnitudes whose numbers fall as 10^(-b m) from `least` on."""
    rng = np.random.default_rng(seed)
    return least + rng.exponential(np.log10(np.e) / b, n)


@pytest.fixture(scope="module")
def run():
    scene = pyfric.preset("fig1", L=0.05, H=0.02, F_N=700.0, V=2e-3)
    return pyfric.simulate(scene, 0.5, fidelity="quasistatic", **QUIET)


def with_sizes(run, m, t):
    """Return the record with events of these magnitudes and starts (s), all finished."""
    old = run.events.iloc[np.zeros(len(m), dtype=int)].reset_index(drop=True)
    events = old.assign(t_start=t, t_stop=t + 1e-4, potency=10.0**m, finished=True)
    arrays = {name: values[np.zeros(len(m), dtype=int)] for name, values in run.arrays.items()}
    return run.replace(events=events, arrays=arrays)


# --- b -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("b", [2 / 3, 1.0, 1.5])
def test_b_of_made_up_catalogues_is_within_its_error(b):
    found = np.array([analysis.b_value(magnitudes(b, 500, seed), -8.0) for seed in range(200)])
    off = (found[:, 0] - b) / found[:, 1]
    assert 0.60 < (np.abs(off) < 1).mean() < 0.76  # 0.68 +- 0.033, of a normal distribution
    assert np.abs(off).max() < 4
    assert found[:, 0].mean() == pytest.approx(b, abs=4 * b / np.sqrt(500 * 200))
    assert found[:, 1].mean() == pytest.approx(found[:, 0].std(ddof=1), rel=0.15)


def test_b_by_hand():
    """The mean is 0.5 above m_c = 1, and the deviations are 0.5, 0 and 0.5."""
    b, error = analysis.b_value([1.0, 1.5, 2.0], 1.0)
    assert b == pytest.approx(np.log10(np.e) / 0.5, rel=1e-14)
    assert error == pytest.approx(np.log(10) * b**2 * np.sqrt(0.5 / 6), rel=1e-14)


def test_rounded_magnitudes_need_their_bin():
    m = magnitudes(1.0, 100_000, 1)
    rounded = np.round(m / 0.2) * 0.2
    with_bin = analysis.b_value(rounded, -7.8, bin=0.2)
    without = analysis.b_value(rounded, -7.8)
    assert abs(with_bin[0] - 1.0) < 3 * with_bin[1]
    assert without[0] - 1.0 > 20 * without[1]


@pytest.mark.parametrize("least", [1, 3, 20])
@pytest.mark.parametrize("b", [0.5, 1.0, 1.5])
def test_b_of_counts_is_within_its_error(b, least):
    """Counts are whole parts of numbers of which a share (k/least)^-b is above k."""
    off, errors = [], []
    for seed in range(200):
        counts = np.floor(least * np.random.default_rng(seed).random(500) ** (-1 / b))
        found, error = analysis.b_value(np.log10(counts), np.log10(least))
        off.append((found - b) / error)
        errors.append(error)
    off = np.array(off)
    assert 0.60 < (np.abs(off) < 1).mean() < 0.76
    assert 0.84 < (np.abs(off) < 1.645).mean() < 0.95
    assert np.mean(off * errors) == pytest.approx(0.0, abs=4 * b / np.sqrt(500 * 200))


def test_b_of_many_counts_is_that_of_a_power_law_of_counts():
    """The number of k is k^-2 (SciPy's zeta law); for large k cumulative numbers fall as 1/k."""
    counts = np.random.default_rng(1).zipf(2.0, 200_000).astype(float)
    b, error = analysis.b_value(np.log10(counts), np.log10(20.0))
    assert abs(b - 1.0) < 2 * error < 0.03


def test_counts_in_two_classes_by_hand():
    """For one event of one block and one of two, x = 2^-b maximises (1 - x)(x - x^c)."""
    b, _ = analysis.b_value(np.log10([1.0, 2.0]))
    tried = np.linspace(b - 0.01, b + 0.01, 21)
    likelihood = (1 - 2.0**-tried) * (2.0**-tried - 3.0**-tried)
    assert np.argmax(likelihood) == 10
    large, exact = (analysis.b_value(np.log10([x, 2 * x]))[0] for x in (1e6, 1e6 + 1 / 3))
    assert large == pytest.approx(exact, rel=1e-5)


def test_events_below_completeness_do_not_count():
    """Below -7 only one event in 16 was recorded."""
    m = magnitudes(1.0, 20_000, 2)
    seen = m[(m >= -7) | (np.arange(m.size) % 16 == 0)]
    b, error = analysis.b_value(seen, -7.0)
    assert abs(b - 1.0) < 3 * error
    biased, small = analysis.b_value(seen)
    assert abs(biased - 1.0) > 10 * small
    assert most_frequent(seen) == pytest.approx(-7.0, abs=BIN)


# --- of a record ---------------------------------------------------------------------------------


def test_sizes_of_a_record(run):
    m, rng = magnitudes(2 / 3, 2000, 5), np.random.default_rng(6)
    t = np.cumsum(rng.exponential(0.01, len(m)))
    found = analysis.sizes(with_sizes(run, m, t), complete=1e-8)
    assert abs(found.b - 2 / 3) < 2 * found.b_error
    assert (found.b, found.b_error) == pytest.approx(analysis.b_value(m, -8.0))
    assert (found.n, found.m_c) == (2000, -8.0)
    assert found.recurrence == pytest.approx(np.diff(t).mean(), rel=1e-12)
    assert found.variation == pytest.approx(np.diff(t).std(ddof=1) / np.diff(t).mean(), rel=1e-12)
    assert 0.9 < found.variation < 1.1  # Poisson
    counts = found.counts
    assert counts["number"].iloc[[0, -1]].tolist() == [2000, 1]
    k = 700
    assert counts["number"][k] == (10.0**m >= counts["size"][k]).sum()


def test_waiting_times_are_those_between_complete_events(run):
    record = with_sizes(run, np.array([-8.0, -9.0, -7.5, -7.0]), np.array([0.0, 1.0, 3.0, 4.5]))
    found = analysis.sizes(record, complete="1e-8 m2")
    np.testing.assert_array_equal(found.events["waiting"], [np.nan, np.nan, 3.0, 1.5])
    assert found.events["complete"].tolist() == [True, False, True, True]
    assert found.recurrence == 2.25
    open_one = record.events
    open_one.loc[4, "finished"] = False
    assert analysis.sizes(record.replace(events=pd.DataFrame(open_one)), complete=1e-8).n == 2


def test_other_sizes_and_what_is_refused(run):
    by_blocks = analysis.sizes(run, "n_blocks", complete=1)
    assert (
        by_blocks.events["size"].tolist() == run.events["n_blocks"][run.events["finished"]].tolist()
    )
    refused(lambda: analysis.sizes(run, "region"), "size")
    refused(lambda: analysis.sizes(run, "is_main"), "size")
    refused(lambda: analysis.sizes(run, "friction_heat"), "record", value=0, within=(2, 0))
    refused(lambda: analysis.sizes(run, complete=0.0), "complete", "m2")
    refused(lambda: analysis.sizes(run, complete=1.0), "complete", "m2")
    refused(lambda: analysis.b_value([1.0, np.nan]), "magnitudes")
    refused(lambda: analysis.b_value([1.0, 2.0], 1.5), "m_c", value=1.5, within=(2,))
    refused(lambda: analysis.b_value([1.0, 1.0]), "magnitudes", "equal")
    refused(lambda: analysis.b_value([1.0, 2.0], bin=-1), "bin")


def test_the_figure_draws_what_it_tells(run):
    figure = pyfric.figures.size_figure(run, complete=1e-12)
    found = analysis.sizes(run, complete=1e-12)
    assert f"b = {found.b:.3f}" in figure.caption
    points, line, _ = figure.axes[0].lines
    np.testing.assert_array_equal(points.get_ydata(), found.counts["number"])
    x, y = line.get_data()
    slope = np.log(y[1] / y[0]) / np.log(x[1] / x[0])
    assert -slope == pytest.approx(found.b)
    assert set(figure.tables) == {"events", "counts"}
