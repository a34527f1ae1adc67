"""The slider condensed onto its interface, compared with the full matrix and the static solver."""

import dataclasses

import numpy as np
import pytest
from helpers import small_free, small_rod
from scipy.sparse.linalg import spsolve

from pyfric.scene import Scene, chain, preset, setup1, setup2
from pyfric.statics import EquilibriumError, StaticSolver, stiffness
from pyfric.statics.condensation import Condensed, _condensed, _known, condense
from pyfric.statics.operators import bond_stiffness, coordinates, driven_dofs


def small_chain(**changes) -> Scene:
    N = 9
    tau = tuple(3.0 * np.cos(np.arange(N)))
    return chain(**{"L": 0.02, "p": tuple(20.0 + np.arange(N)), "tau": tau, "k_top": 2e6} | changes)


ROWS = [small_rod(h=j * 2.5e-3) for j in range(1, 7)]
ROWS += [small_free(h=j * 1e-3, theta=0.4) for j in (1, 3, 6)]
FLAT = [setup1(L=0.01, H=2.5e-3, h=2.5e-3), setup2(L=4e-3, H=1e-3, h=1e-3, theta=-1.0)]
CHAINS = [small_chain(), small_chain(k_top=0.0), chain(L=5e-3)]
ODD = [small_rod(k_f=1.0), small_rod(mattress=0.0), small_rod(K=1e-3), small_free(K=1e13)]
ODD += [setup2(L=2e-3, H=8e-3, h=8e-3), setup1(L=5e-3, H=0.04, h=0.04)]
SCENES = [
    dataclasses.replace(one, driver=dataclasses.replace(one.driver, side=side))
    for one in [*ROWS, *FLAT, *CHAINS, *ODD]
    for side in ("left", "right")
]


def name(scene: Scene) -> str:
    return f"{scene.name}-{scene.N_x}x{scene.N_z}-{scene.j_h}-{scene.driver.side}"


def full(scene: Scene, v: np.ndarray, X: float) -> tuple[np.ndarray, float]:
    """Return forces on the interface and F_T, from one sparse solve for all other unknowns."""
    N_x, n = scene.N_x, 2 * scene.N_x * scene.N_z
    K = stiffness(scene, closed=np.zeros(N_x, dtype=bool)).tocsc()
    load = np.zeros(n)
    if not scene.rigid:
        load[n - N_x :] = -scene.load
        load[n - 2 * N_x : n - N_x] = scene.shear
    load[driven_dofs(scene)] += scene.driver.K * scene.d * X
    T = coordinates(scene)
    load = T.T @ load
    if scene.rigid:
        load[-2] -= scene.F_N
    b, q = 2 * N_x, np.zeros(len(load))
    q[:b] = v
    if len(q) > b:
        q[b:] = spsolve(K[b:, b:], load[b:] - K[b:, :b] @ v)
    F_T = scene.driver.K * (X - scene.d * (T @ q)[driven_dofs(scene)])
    return (K @ q - load)[:b], F_T


def outside(scene: Scene, X: float) -> np.ndarray:
    """Return driver and loads: the driver at X, loads as at t = 0."""
    return np.array([X, 1.0, scene.F_N, scene.top.T])


def force(scene: Scene, slider: Condensed, v: np.ndarray, X: float) -> float:
    return float(slider.c @ outside(scene, X) - slider.G[:, 0] @ v)


def states(scene: Scene, seed: int):
    """Return random interfaces and drivers, of the size of displacements under F_N."""
    rng, N_x = np.random.default_rng(seed), scene.N_x
    size = scene.F_N / N_x / scene.slider.k
    for scale in (0.0, 1.0, 100.0):
        v = scale * size * rng.standard_normal(2 * N_x)
        yield v, scale * size * rng.standard_normal()


@pytest.mark.parametrize("scene", SCENES, ids=name)
def test_forces_are_those_of_the_full_matrix(scene):
    slider = condense(scene).driven(scene)
    for v, X in states(scene, 1):
        forces, F_T = full(scene, v, X)
        pull = scene.driver.K * max(abs(X), np.abs(v).max())
        scale = max(np.abs(forces).max(), scene.F_N / scene.N_x)
        here = slider.S @ v - slider.G @ outside(scene, X)
        np.testing.assert_allclose(here, forces, rtol=0, atol=1e-12 * max(scale, pull))
        assert force(scene, slider, v, X) == pytest.approx(F_T, rel=0, abs=1e-12 * max(scale, pull))


@pytest.mark.parametrize("scene", SCENES, ids=name)
def test_the_potential_is_symmetric(scene):
    """S is symmetric, and the coupling of driver and interface is reciprocal."""
    slider, N_x = condense(scene).driven(scene), scene.N_x
    np.testing.assert_allclose(slider.S, slider.S.T, rtol=0, atol=1e-14 * np.abs(slider.S).max())
    zero = np.zeros(2 * N_x)
    at_0, F_0 = full(scene, zero, 0.0)
    stiff = max(scene.slider.k, min(scene.driver.K, 1e10))
    X = scene.F_N / stiff
    at_X, F_X = full(scene, zero, X)
    accuracy = 1e-10 * max(stiff, scene.driver.K)
    np.testing.assert_allclose(slider.G[:, 0], (at_0 - at_X) / X, rtol=0, atol=accuracy)
    assert slider.c[0] == pytest.approx((F_X - F_0) / X, abs=accuracy)
    for i in (0, N_x - 1, N_x, 2 * N_x - 1):
        v = zero.copy()
        v[i] = X
        change = (full(scene, v, 0.0)[1] - F_0) / X
        assert -slider.G[:, 0][i] == pytest.approx(change, abs=accuracy)

    def U(v, X):
        quadratic = v @ slider.S @ v / 2 + slider.c[0] * X**2 / 2
        at_0 = slider.c @ outside(scene, 0.0)
        return quadratic - v @ slider.G @ outside(scene, X) + at_0 * X

    v, X = next(s for s in states(scene, 2) if s[1])
    slope = (U(v, X * 1.5) - U(v, X * 0.5)) / X  # exact, because U is quadratic
    size = max(abs(force(scene, slider, v, X)), scene.driver.K * abs(X), scene.F_N)
    assert slope == pytest.approx(force(scene, slider, v, X), abs=1e-9 * size)


@pytest.mark.parametrize("scene", [*ROWS, *FLAT, small_chain(), chain()], ids=name)
def test_states_are_those_of_the_static_solver(scene):
    solver, slider = StaticSolver(scene, "linear"), condense(scene).driven(scene)
    rng, size = np.random.default_rng(3), scene.F_N / scene.N_x / scene.slider.k
    for _ in range(3):
        drive = 0.1 * scene.F_N / scene.driver.K * rng.random()
        u_x = solver.loaded.u[0, 0] + 0.1 * size * rng.standard_normal(scene.N_x)
        state = solver.solve(u_x, drive)
        v = np.concatenate(state.u[0])
        X = drive + scene.d * state.u_drv0
        forces = slider.S @ v - slider.G @ outside(scene, X)
        scale = 1e-12 * scene.F_N
        np.testing.assert_allclose(forces, [*state.f, *state.p], rtol=0, atol=scale)
        assert force(scene, slider, v, X) == pytest.approx(state.F_T, rel=0, abs=scale)


@pytest.mark.parametrize("name", ["fig1", "setup2+"])
def test_the_papers_lattices(name):
    scene = preset(name)
    slider = condense(scene).driven(scene)
    v, X = list(states(scene, 4))[1]
    forces, F_T = full(scene, v, X)
    here = slider.S @ v - slider.G @ outside(scene, X)
    np.testing.assert_allclose(here, forces, rtol=0, atol=1e-12 * np.abs(forces).max())
    assert force(scene, slider, v, X) == pytest.approx(F_T, rel=1e-11)


def test_doubling_all_forces_doubles_all_loads():
    scenes = small_rod(F_N=1750.0), small_rod(F_N=3500.0)
    one, two = (condense(scene).driven(scene) for scene in scenes)
    np.testing.assert_array_equal(one.S, two.S)
    np.testing.assert_array_equal(one.G[:, 0], two.G[:, 0])
    at_one, at_two = (outside(scene, 0.0) for scene in scenes)
    np.testing.assert_array_equal(2 * (one.G @ at_one), two.G @ at_two)
    assert 2 * (one.c @ at_one) == two.c @ at_two


@pytest.mark.parametrize(
    "scene", [small_rod(), small_free(theta=0.4).replace({"top.T": 7.0})], ids=name
)
def test_loads_at_the_start_are_those_of_F_N_and_T(scene):
    slider = condense(scene).driven(scene)
    forces, F_T = full(scene, np.zeros(2 * scene.N_x), 0.0)
    loads = slider.G @ outside(scene, 0.0)
    np.testing.assert_allclose(loads, -forces, rtol=0, atol=1e-13 * np.abs(loads).max())
    assert slider.c @ outside(scene, 0.0) == pytest.approx(F_T, rel=1e-12)
    assert not slider.G[:, 1].any()


@pytest.mark.parametrize("scene", [small_rod(h=0.01), small_free(K=1e9), small_chain()], ids=name)
def test_without_the_driver_no_force_moves_it(scene):
    """At F_T = 0 the forces on the interface are those without a driver."""
    free = condense(scene)
    slider = free.driven(scene)
    for v, _ in states(scene, 5):
        X = -force(scene, slider, v, 0.0) / slider.c[0]
        expected, F_T = full(scene, v, X)
        scale = max(np.abs(expected).max(), scene.F_N / scene.N_x)
        assert F_T == pytest.approx(0, abs=1e-9 * scale)
        forces = free.S @ v - free.G @ outside(scene, 0.0)
        np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-9 * scale)
    assert not free.c.any()


def test_a_slider_without_support_is_refused(monkeypatch):
    scene = small_rod(h=12.5e-3)
    broken = bond_stiffness(scene).tolil()
    broken[-1, -1] = -1.0
    monkeypatch.setattr("pyfric.statics.condensation.bond_stiffness", lambda _: broken.tocsr())
    with pytest.raises(EquilibriumError, match="not supported"):
        condense(scene)


MADE = []
"""Scenes whose bonds were eliminated."""


def counted(scene):
    MADE.append(scene)
    return _condensed(scene)


@pytest.mark.parametrize(
    "change",
    [
        *({"mu_s": 0.9}, {"mu_k": 0.1}, {"d_c": 1e-6}, {"k_f": 1e6}, {"name": "other"}),
        *({"F_N": 4e3}, {"V": 1.0}, {"K": 1e3}, {"eta": 1.0}, {"k": 1e6}, {"mattress": 0.0}),
    ],
    ids=str,
)
@pytest.mark.parametrize("make", [small_rod, small_free])
def test_bonds_are_eliminated_once_for_scenes_with_the_same_lattice(make, change, monkeypatch):
    """Shared results have the same bits as new ones."""
    monkeypatch.setattr("pyfric.statics.condensation._condensed", counted)
    scene = make(F_N=2e3, **({"theta": 0.3} if make is small_free else {}))
    if "mattress" in change and make is small_free:
        return
    condense(scene)
    made, other = len(MADE), scene.replace(change)
    shared = condense(other)
    assert len(MADE) == made
    _known.clear()
    fresh = condense(other)
    assert len(MADE) == made + 1
    for field in dataclasses.fields(Condensed):
        np.testing.assert_array_equal(getattr(shared, field.name), getattr(fresh, field.name))


@pytest.mark.parametrize("change", [{"h": 2.5e-3}, {"side": "right"}, {"L": 0.025}, {"g": 9.81}])
def test_all_else_has_a_part_in_it(change, monkeypatch):
    monkeypatch.setattr("pyfric.statics.condensation._condensed", counted)
    scene = small_rod()
    condense(scene)
    made = len(MADE)
    condense(scene.replace(change))
    assert len(MADE) == made + 1
