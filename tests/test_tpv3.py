"""TPV3: its scene, its reference, and a rupture on a coarse lattice."""

import math

import numpy as np
import pandas as pd
import pytest
import tpv3

from pyfric.engines import step_size
from pyfric.scene import Scene, preset
from pyfric.values import SceneError


def test_the_scene_is_that_of_the_benchmark():
    scene = preset("tpv3", l=500.0)
    slider, l = scene.slider, scene.slider.l
    c_S = l * math.sqrt(slider.k / (2 * scene.m))
    assert c_S == pytest.approx(3464.0, rel=1e-12)
    assert scene.m / l**2 == pytest.approx(2670.0, rel=1e-12)
    x = tpv3.distance(scene)
    np.testing.assert_allclose(scene.shear[x < 1.5] / l, 81.6e6, rtol=1e-14)
    np.testing.assert_allclose((scene.shear / scene.shares[1])[x > 1.5] / l, 70e6, rtol=1e-14)
    np.testing.assert_allclose(scene.p_prescribed[x < 15] / l, 120e6, rtol=1e-14)
    assert (scene.N_x, scene.N_z, scene.walls.left) == (36, 24, "mirrored")
    S = (0.677 * 120 - 70) / (70 - 0.525 * 120)
    assert S == pytest.approx(1.6, abs=0.01)
    assert Scene.from_toml(scene.to_toml()) == scene
    with pytest.raises(SceneError, match=r"slider\.l"):
        preset("tpv3", l=2000.0)


def test_ruptures_come_near_the_reference_on_a_coarse_lattice():
    """At l = 200 m, with four blocks in X_c0, within 1.0 % of the last arrival; 0.1 % at 100 m."""
    scene = preset("tpv3", l=200.0, H=8e3)
    times, rate, slip = tpv3.ruptured(scene, step_size(scene), 6.0)
    x = tpv3.distance(scene)
    inside = x < 15
    assert np.isfinite(times[inside]).all()
    assert np.isinf(times[~inside]).all()
    arrivals = np.interp(tpv3.STATIONS, x, times)
    assert tpv3.misfit(arrivals) < 0.012
    assert tpv3.misfit(arrivals + 0.1) > 0.02
    assert (np.diff(times[(x > 2) & inside]) > 0).all()
    assert 2 < 2 * rate[x < 10].max() < 15
    assert 2 * np.interp(5.0, x, slip) == pytest.approx(tpv3.PLACES[5][1], rel=0.04)


def test_the_report_says_misfits_and_orders():
    rows = [{"l": l, "eta2": 0.001, "dashpots": "along", "rms": l / 2e4} for l in (100.0, 50.0)]
    more = {"t_14": 4.7, "rate_5": 1.0, "slip_5": 1.0, "rate_10": 1.0, "slip_10": 1.0}
    frame = pd.DataFrame([row | more | {"dt": 1e-3, "seconds": 1.0} for row in rows])
    assert tpv3.orders(frame) == pytest.approx([1.0])
    text = tpv3.report(frame)
    assert "observed order: 1.00" in text
    assert "0.250 %" in text
    assert tpv3.misfit(tpv3.REFERENCE + 0.047177) == pytest.approx(0.01)
