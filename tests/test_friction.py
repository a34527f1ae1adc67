"""The friction law in Python, beside the core's and its own limits."""

import math

import numpy as np
import pytest

from pyfric.scene import FRICTIONLESS, Law, clock, setup1, slipped
from pyfric.scene.laws import Table, Tables

p = np.array([0.0, 1.5, 40.0])
f = np.array([0.0, -0.9, 20.0])


def test_strengths():
    law = setup1(mu_s=0.7, mu_k=0.45, d_c=2e-6).law
    np.testing.assert_array_equal(law.hold(p), 0.7 * p)
    np.testing.assert_array_equal(law.slide(p), 0.45 * p)
    for slip, mu in ((0.0, 0.7), (0.5e-6, 0.6375), (1e-6, 0.575), (2e-6, 0.45), (1.0, 0.45)):
        np.testing.assert_allclose(law.slide(p, slip), mu * p, rtol=1e-15)
        np.testing.assert_allclose(law.slide(p, np.full(3, slip)), mu * p, rtol=1e-15)
    np.testing.assert_array_equal(Law(0.7, 0.45).slide(p, 0.0), 0.45 * p)
    assert not FRICTIONLESS.hold(p).any()
    assert not FRICTIONLESS.slide(p).any()


def test_weakening_is_straight_between_knots():
    """With a d_c for each column, one of them 0; a piece goes on beyond its ends."""
    table = Table((0.0, 1.0, 3.0), (1.0, 0.4, 0.0))
    d_c = np.array([1e-6, 2e-6, 0.0])
    law = Law(np.array([0.7, 0.6, 0.5]), 0.3, d_c, tables=Tables(slide=table))
    slip = np.array([0.5e-6, 4e-6, 1e-6])
    np.testing.assert_array_equal(law.piece(slip), [0, 1, 2])
    mu, rate = law.weakening(slip)
    np.testing.assert_allclose(mu, [0.3 + 0.4 * 0.7, 0.3 + 0.3 * 0.2, 0.3], rtol=1e-14)
    np.testing.assert_allclose(rate, [-0.4 * 0.6 / 1e-6, -0.3 * 0.2 / 2e-6, 0], rtol=1e-14)
    np.testing.assert_array_equal(law.slide(p, slip), mu * p)
    np.testing.assert_allclose(law.next_knot(law.piece(slip)), [1e-6, 6e-6, np.inf], rtol=1e-14)
    beyond, _ = law.weakening(slip + 1e-6, law.piece(slip))
    np.testing.assert_allclose(beyond, mu + 1e-6 * rate, rtol=1e-14)


def test_margins():
    law = Law(0.7, 0.45)
    np.testing.assert_array_equal(law.margin(p, f), np.minimum(*law.margins(p, f)))
    np.testing.assert_allclose(law.margins(p, f)[0], [0, 0.15, 48], rtol=1e-14)
    np.testing.assert_allclose(law.margins(p, f)[1], [0, 1.95, 8], rtol=1e-14)


def test_scaled_prestress():
    law = Law(0.7, 0.45)
    np.testing.assert_allclose(law.scaled(np.array([0.45, 0.575, 0.7])), [0, 0.5, 1], atol=1e-15)
    assert math.isnan(Law(0.5, 0.5).scaled(0.5))
    assert np.isnan(Law(0.5, 0.5).scaled(p)).all()


def test_slip_is_continuous_where_nearly_nothing_is_lost():
    assert Law(0.5, 0.5).gradual
    assert Law(0.5, 0.496).gradual
    assert not Law(0.5, 0.49).gradual
    assert Law(0.5, 0.496, 1e-6).continuous() == Law(0.5, 0.5)


def test_weakening_runs_away():
    """m s'' = drop p s/d_c."""
    law = setup1(mu_s=0.7, mu_k=0.45, d_c=1e-6).law
    assert law.growth(4.0, 1e-3) == pytest.approx(math.sqrt(1.0 / 1e-9))
    assert Law(0.7, 0.45).growth(4.0, 1e-3) == math.inf


def test_the_clock_counts_slip_and_nothing_else():
    mode = np.array([0, 1, -1, 2], dtype=np.int32)
    u_x = np.array([1e-3, 2e-3, 3e-3, 4e-3])
    s_0 = clock(np.array([0.0, 5e-6, 6e-6, 7e-6]), mode, u_x)
    np.testing.assert_array_equal(s_0[[0, 3]], [0.0, 7e-6])
    later = slipped(s_0, mode, u_x + np.array([1.0, 1e-6, -1e-6, 1.0]))
    np.testing.assert_allclose(later, [0.0, 6e-6, 7e-6, 7e-6], rtol=1e-9)


def test_a_scene_has_its_law():
    scene = setup1(mu_s=0.6, mu_k=0.3, d_c=1e-6)
    assert scene.law == Law(0.6, 0.3, 1e-6, tables=scene.interface.tables)
