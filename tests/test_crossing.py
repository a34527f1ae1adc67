"""First crossings, compared with fine scans."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pyfric.engines import crossing
from pyfric.engines.crossing import first_crossing


def value(c, rate, modal, rates, s):
    return c[:, None] + rate[:, None] * s + (modal @ np.exp(np.outer(rates, s))).real


def check_first_crossing(c, rate, modal, rates, s_end, ds):
    """Check on a fine scan that a crossing is not late, and early only if a margin is near zero."""
    found = first_crossing(c, rate, modal, rates, s_end, ds)
    assert 0 <= found <= s_end
    grid = np.linspace(0, s_end, 8 * round(s_end / ds) + 1)
    below = (value(c, rate, modal, rates, grid) <= 0).any(axis=0)
    first = grid[np.argmax(below)] if below.any() else np.inf
    assert found <= first + ds * (1 + 1e-9)
    if found < s_end:
        near = np.linspace(found, min(found + 2 * ds, s_end), 33)
        low = value(c, rate, modal, rates, near).min(axis=1)
        curve = (np.abs(modal) * np.abs(rates) ** 2) @ np.exp(rates.real * found) * ds**2 / 8
        assert (low <= curve + 1e-12 * np.abs(c)).any()
    return found, first


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def motions(draw):
    n_c, n = draw(st.integers(1, 4)), draw(st.integers(0, 5))

    def some(size, low, high):
        return np.array(draw(st.lists(numbers(low, high), min_size=size, max_size=size)))

    modal = (some(n_c * n, -2, 2) + 1j * some(n_c * n, -2, 2)).reshape(n_c, n)
    rates = -some(n, 0, 30) + 1j * some(n, 0, 300)
    room = np.abs(modal).sum(axis=1)
    c = some(n_c, -0.1, 1.5) * np.maximum(room, 0.1)  # crossings, grazes and neither
    rate = some(n_c, -3, 1)
    return c, rate, modal, rates, draw(st.sampled_from([0.05, 0.5, 2.0]))


@settings(max_examples=150)
@given(motions())
@example(
    (
        np.full(2, 0.1),
        np.array([0.0, -2e-313]),
        np.zeros((2, 0), complex),
        np.zeros(0, complex),
        0.05,
    )
)
def test_first_crossing_is_that_of_a_fine_scan(motion):
    *margins, s_end = motion
    check_first_crossing(*margins, s_end, ds=1e-3)


@settings(max_examples=60)
@given(
    depth=st.floats(1e-7, 1e-2),
    omega=st.floats(20, 400),
    phase=st.floats(0, 6.28),
    decay=st.floats(0, 5),
)
@example(depth=1e-6, omega=300.0, phase=3.0, decay=0.0)
def test_no_dip_is_missed(depth, omega, phase, decay):
    """A margin falls slightly below zero for a short time, and comes back."""
    ds = 1e-4
    modal, rates = np.array([[np.exp(1j * phase)]]), np.array([-decay + 1j * omega])
    grid = np.linspace(0, 0.5, 100_001)
    wave = value(np.zeros(1), np.zeros(1), modal, rates, grid)[0]
    lowest = wave.argmin()
    c = np.array([-wave[lowest] - depth])
    if c[0] + wave[0] <= 0:
        return
    first = grid[np.argmax(c[0] + wave <= 0)]
    found = first_crossing(c, np.zeros(1), modal, rates, 0.5, ds)
    assert first - 30 * np.sqrt(ds) <= found <= first + ds


def test_first_crossing_without_modes_is_that_of_the_drift():
    none, no_rates = np.zeros((2, 0), complex), np.zeros(0, complex)
    c, rate = np.array([1.0, 2.0]), np.array([-2.0, -1.0])
    found = first_crossing(c, rate, none, no_rates, 10.0, 1e-6)
    assert 0.5 - 2e-6 <= found <= 0.5
    assert first_crossing(c, -rate, none, no_rates, 10.0, 1e-6) == 10.0
    assert first_crossing(-c, rate, none, no_rates, 10.0, 1e-6) == 0.0


def test_first_crossing_after_a_long_wait_is_cheap(monkeypatch):
    """Ten thousand decay times take few evaluations."""
    count = [0]
    exp = np.exp

    def counted(x):
        count[0] += 1
        return exp(x)

    monkeypatch.setattr(crossing.np, "exp", counted)
    c, rate = np.array([1.0]), np.array([-1e-3])
    modal, rates = np.array([[0.9 + 0j]]), np.array([-10 + 300j])
    found = first_crossing(c, rate, modal, rates, 1e4, 1e-6)
    assert found == pytest.approx(1000.0, abs=2e-6)
    assert count[0] < 300


def test_numbers_that_are_none_do_not_hang():
    bad = np.array([np.nan, 1.0])
    modal, rates = np.ones((2, 1), complex), np.array([-1 + 10j])
    assert first_crossing(bad, np.zeros(2), modal, rates, 1.0, 1e-3) == 0.0
