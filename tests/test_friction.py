"""The friction law in Python, compared with the core and with its limits."""

import math

import numpy as np
import pytest

from pyfric.scene import FRICTIONLESS, LAWS, CoulombLaw, Law, Spread, preset, setup1, slipped

p = np.array([0.0, 1.5, 40.0])
f = np.array([0.0, -0.9, 20.0])


def test_strengths():
    law = setup1(mu_s=0.7, mu_k=0.45, d_c=2e-6).law
    np.testing.assert_array_equal(law.hold(p), 0.7 * p)
    np.testing.assert_array_equal(law.slide(p), 0.45 * p)
    assert not FRICTIONLESS.hold(p).any()
    assert not FRICTIONLESS.slide(p).any()


def test_margins():
    law = CoulombLaw(0.7, 0.45)
    np.testing.assert_array_equal(law.remaining(p, f), np.minimum(*law.margins(p, f)))
    np.testing.assert_allclose(law.margins(p, f)[0], [0, 0.15, 48], rtol=1e-14)
    np.testing.assert_allclose(law.margins(p, f)[1], [0, 1.95, 8], rtol=1e-14)


def test_no_law_has_what_is_of_another():
    """Strength, tables and weakening are of blocks that rest."""
    own = vars(CoulombLaw).keys() - vars(Law).keys() - {"fields", "state", "margin", "memory"}
    own -= {"terms", "code"}
    assert {"hold", "slide", "remaining", "margins", "tables", "d_c", "drop", "gradual"} <= own
    for law in LAWS:
        assert law.__bases__ == (Law,)
        assert law is CoulombLaw or not [name for name in own if hasattr(law, name)]


def test_static_states_obey_amontons_coulomb_friction_under_any_law():
    weak = setup1(mu_s=0.7, mu_k=0.45, d_c=1e-6).law
    assert weak.static is weak
    slow, rated = preset("slow").law, preset("rate_and_state", alpha=2.0).law
    assert slow.static == CoulombLaw(slow.mu_s, slow.mu_k)
    assert rated.static == CoulombLaw(0.6, 0.6, alpha=2.0)


@pytest.mark.parametrize("name", ["mu_s", "t_R"])
def test_the_law_of_some_columns_has_their_fields(name):
    scene = preset("slow")
    field = Spread(mean=getattr(scene.law, name), std=0.1 * getattr(scene.law, name), seed=1)
    law = scene.replace({name: field}).law
    some, mean = law.at([3, 1]), law.mean
    assert np.ndim(getattr(law, name)) == 1
    for each in law.fields:
        whole = np.broadcast_to(getattr(law, each), scene.N_x)
        np.testing.assert_array_equal(np.broadcast_to(getattr(some, each), 2), whole[[3, 1]])
        assert getattr(mean, each) == np.mean(getattr(law, each))


def test_scaled_prestress():
    law = CoulombLaw(0.7, 0.45)
    np.testing.assert_allclose(law.scaled(np.array([0.45, 0.575, 0.7])), [0, 0.5, 1], atol=1e-15)
    assert math.isnan(CoulombLaw(0.5, 0.5).scaled(0.5))
    assert np.isnan(CoulombLaw(0.5, 0.5).scaled(p)).all()


def test_slip_is_continuous_where_nearly_nothing_is_lost():
    assert CoulombLaw(0.5, 0.5).gradual
    assert CoulombLaw(0.5, 0.496).gradual
    assert not CoulombLaw(0.5, 0.49).gradual
    assert CoulombLaw(0.5, 0.496, 1e-6).continuous() == CoulombLaw(0.5, 0.5)


def test_weakening_runs_away():
    """Slip grows as m s'' = drop p s/d_c."""
    law = setup1(mu_s=0.7, mu_k=0.45, d_c=1e-6).law
    assert law.resolving_step(4.0, 1e-3) == pytest.approx(math.sqrt(1e-9))
    assert CoulombLaw(0.7, 0.45).resolving_step(4.0, 1e-3) == math.inf


def test_the_clock_counts_slip_and_nothing_else():
    mode = np.array([0, 1, -1, 2], dtype=np.int32)
    u_x = np.array([1e-3, 2e-3, 3e-3, 4e-3])
    s_0 = np.array([0.0, 5e-6, 6e-6, 7e-6]) - np.where(np.abs(mode) == 1, mode * u_x, 0.0)
    np.testing.assert_array_equal(s_0[[0, 3]], [0.0, 7e-6])
    later = slipped(s_0, mode, u_x + np.array([1.0, 1e-6, -1e-6, 1.0]))
    np.testing.assert_allclose(later, [0.0, 6e-6, 7e-6, 7e-6], rtol=1e-9)


def test_a_scene_has_its_law():
    scene = setup1(mu_s=0.6, mu_k=0.3, d_c=1e-6)
    assert scene.law == CoulombLaw(0.6, 0.3, 1e-6, tables=scene.interface.tables)
