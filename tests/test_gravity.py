"""Gravity as a load on all blocks and the rod."""

import numpy as np
import pytest
from helpers import GEOMETRIES, budget_error, refused, small_free, small_rod
from test_lattice import twin_forces

import pyfric
from pyfric.core import OPEN
from pyfric.statics import ContactProblem, StaticSolver

G = {"slider.g": 9.81e3}
"""Gravity so strong that the weight of the slider equals the load."""
SCENES = {"rod": small_rod().replace(G), "free": small_free().replace(G)}
EACH = pytest.mark.parametrize("name", SCENES)


@EACH
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_foundation_carries_load_and_weight(name, geometry):
    """Each block above the interface is at rest under its weight, by the springs of the twin."""
    scene = SCENES[name]
    loaded, weight = StaticSolver(scene, geometry).loaded, scene.m * scene.slider.g
    total = scene.F_N + scene.slider.g * (scene.slider.M + scene.M_rod)
    assert total > 1.1 * scene.F_N
    assert loaded.p.sum() == pytest.approx(total, rel=1e-12)
    forces = twin_forces(scene, loaded.u, geometry)
    inner = forces[1:-1]
    np.testing.assert_allclose(inner[:, 1], weight, rtol=1e-8)
    np.testing.assert_allclose(inner[:, 0], 0.0, atol=1e-8 * weight)
    np.testing.assert_allclose(forces[0, 1] + loaded.p, weight, rtol=1e-8)
    column = scene.F_N + scene.M_rod * scene.slider.g + scene.N_x * weight
    assert forces[-1, 1].sum() == pytest.approx(column, rel=1e-9)


@EACH
def test_the_condensed_slider_weighs_as_much(name):
    scene = SCENES[name]
    loaded, now = StaticSolver(scene, "linear").loaded, ContactProblem(scene).loaded().values()
    np.testing.assert_allclose(now.p, loaded.p, rtol=1e-9)
    np.testing.assert_allclose(now.f, loaded.f, atol=1e-9 * scene.F_N)


def test_a_lifted_slider_falls_freely():
    """Until it lands, z'' = -g - F_N/M and x is constant; load and weight do the work."""
    scene = small_free(V=0.0, T=0.0, theta=0.0, h=1e-3).replace(G | {"top.F_N": 1e-3})
    state = StaticSolver(scene, "linear").loaded.state(scene, 1e-7)
    state.y[:, 0], height = 0.0, 1e-4
    state.y[:, 1], state.mode[:] = height, OPEN
    state.margin[:] = 0.0
    a, t = scene.slider.g + 1e-3 / scene.slider.M, 1e-4
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False, "energies": True}
    scene = scene.replace({"driver.K": 1e-6})
    state = state.under(scene)
    record = pyfric.simulate(scene, t, initial=state, **how)
    end = record.final_state
    np.testing.assert_allclose(end.y[:, 1].mean(), height - a * end.t**2 / 2, rtol=1e-9)
    np.testing.assert_allclose(end.y[:, 3].mean(), -a * end.t, rtol=1e-9)
    work = record.curve["work_load"].iloc[-1] - record.curve["work_load"].iloc[0]
    assert work == pytest.approx(scene.slider.M * a**2 * end.t**2 / 2, rel=1e-4)


@EACH
def test_the_energy_budget_has_the_work_of_weights(name):
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False, "energies": True}
    scene = SCENES[name].replace({"driver.V": 0.5})
    record = pyfric.simulate(scene, 2e-3, dt=pyfric.step_size(scene) / 2, **how)
    assert len(record.switches["t"])
    lifted = record.final_state.y[:, 1] - StaticSolver(scene, "linear").loaded.u[:, 1]
    of_weights = abs(np.sum(scene.weights * lifted))
    assert budget_error(record) < 0.03 * of_weights


def test_engines_agree_under_gravity():
    """Engines agree under a changing F_N, too, which does not change the weights."""
    scene = small_free(V=0.08).replace(G | {"top.protocol": ((2e-3, 400.0), (6e-3, 440.0))})
    how = {"progress": False, "geometry": "linear"}
    exact, jumped = (pyfric.simulate(scene, 0.01, fidelity=f, **how) for f in ("dynamic", "hybrid"))
    static = pyfric.simulate(scene, 0.01, fidelity="quasistatic", progress=False)
    start = [r.events["F_T_start"].to_numpy() for r in (exact, jumped, static)]
    assert len(start[0]) >= 2
    np.testing.assert_allclose(start[1], start[0], atol=1e-3 * scene.F_N)
    assert start[2][0] == pytest.approx(start[0][0], abs=1e-3 * scene.F_N)
    solver = StaticSolver(scene, "linear")
    later = solver.solve(solver.loaded.u[0, 0], 0.0, load=(440.0, 0.0))
    assert later.p.sum() == pytest.approx(440.0 + scene.slider.g * scene.slider.M, rel=1e-12)


def test_a_known_p_carries_the_weight_too():
    scene = small_free(theta=0.0).replace(G)
    p = [scene.pressing / scene.N_x] * scene.N_x
    loaded = pyfric.loaded_state(pyfric.pressed(scene, p=p))
    np.testing.assert_allclose(loaded.p, p, rtol=1e-6)
    few = [scene.F_N / scene.N_x] * scene.N_x
    refused(lambda: pyfric.pressed(scene, p=few), "p", "F_N + weight")


def test_gravity_is_refused_where_p_is_given():
    refused(lambda: pyfric.chain().replace(G), "slider.g", "prescribed")
    refused(lambda: small_rod().replace({"slider.g": -1.0}), "slider.g", value=-1.0, within=(0,))


def test_the_weight_of_setup_1_is_small():
    scene = pyfric.preset("fig1").replace({"slider.g": 9.81})
    more = pyfric.loaded_state(scene).p.sum() / scene.F_N - 1
    assert more == pytest.approx(4.24e-4, abs=1e-6)
    assert scene.M_rod == scene.slider.M
