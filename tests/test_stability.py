"""The stability map: computed limits compared with runs."""

import math

import limits
import numpy as np
import pytest

from pyfric import core
from pyfric.checks import stability
from pyfric.figures import save_figure
from pyfric.scene import preset
from pyfric.statics import loaded_state, stability_limit

WITHIN = 0.05


@pytest.mark.parametrize(
    ("eta", "stiffness", "stepper"),
    [
        *((eta, 100.0, stepper) for eta in (0.0, 3.0) for stepper in stability.LIMITED),
        (math.sqrt(0.1), 1.0, "rk4"),
    ],
)
def test_computed_limits_are_those_of_runs(eta, stiffness, stepper):
    scene = limits.small_slider(eta, stiffness)
    computed, details = stability_limit(scene, stepper)
    assert details["exact"]
    measured = stability.measured_limit(scene, stepper, computed)
    assert measured == pytest.approx(computed, rel=WITHIN)
    assert not stability.grows(scene, stepper, 0.98 * computed)


@pytest.mark.parametrize("stepper", ["verlet", "symplectic_euler"])
@pytest.mark.parametrize("name", ["fig1", "setup2", "chain"])
def test_without_damping_steps_times_frequency_have_a_limit_of_two(name, stepper):
    """The limit of RK4 is 2 sqrt(2), for the same highest frequency."""
    scene = preset(name, eta=0.0)
    found, rk4 = stability_limit(scene, stepper)[0], stability_limit(scene)[0]
    assert found / rk4 == pytest.approx(1 / math.sqrt(2), rel=1e-7)


def test_the_limit_of_the_paper_s_lattice_is_that_of_runs():
    """For 57 x 31 blocks plane waves set the limit; computed and measured, it is 1.57 us."""
    scene = preset("fig1", V=0.0, mu_s=1e6)
    computed = stability_limit(scene)[0]
    assert not stability.grows(scene, "rk4", computed)
    assert stability.grows(scene, "rk4", 1.03 * computed)


def test_adaptive_steps_stay_stable_far_above_the_limit_of_rk4():
    scene = limits.small_slider(math.sqrt(0.1), 1.0)
    dt = 20 * stability_limit(scene)[0]
    rest = loaded_state(scene)
    state = rest.state(scene, dt)
    state.y[1:-1, 2:] = 1e-9 * np.random.default_rng(1).standard_normal(state.y[1:-1, 2:].shape)
    model, log = core.model(scene, "linear", rest.u_drv0), core.Log(scene.N_x)
    core.advance(model, state, log, 200, stepper="adaptive", rtol=1e-3, budget=False)
    allowed = 1e-3 * scene.F_N / scene.N_x / math.sqrt(scene.slider.k * scene.m)
    assert np.abs(state.y[:, 2:]).max() < allowed  # errors may grow as far as they are accepted


def test_map_and_figure(tmp_path):
    table = limits.stability_map(("rk4",), (0.1, 1.0), (1.0, 10.0))
    assert list(table) == ["stepper", "eta", "stiffness", "computed", "measured", "ratio"]
    assert len(table) == 4
    np.testing.assert_allclose(table["ratio"], 1, atol=WITHIN)
    fig = limits.figure(table)
    names = {path.name for path in save_figure(fig, tmp_path / "map")}
    assert names == {"map.png", "map.pdf", "map.txt", "map_limits.csv"}
