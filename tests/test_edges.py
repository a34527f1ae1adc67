"""Half blocks along free edges: mass and stiffness of second order, dynamics, engines, refusals."""

import numpy as np
import pytest
from helpers import budget_error, operators, refused, small_free, small_rod
from scipy.linalg import eigh

import pyfric
from pyfric import core
from pyfric.scene import chain, setup2, slab
from pyfric.statics import ContactProblem, StaticSolver, stability_limit, stiffness

HALF = {"slider.edges": "half"}
SCENES = {"rod": small_rod().replace(HALF), "free": small_free().replace(HALF)}
EACH = pytest.mark.parametrize("name", SCENES)


def frequencies(edges, n):
    """Return the first three elastic frequencies of a free body of 2 n x n bonds, in rad/s."""
    scene = setup2(L=0.1, H=0.05, l=0.05 / n, h=0.05 / n).replace({"slider.edges": edges})
    M, _, _ = operators(scene)
    K = stiffness(scene, closed=np.zeros(scene.N_x, bool), driver=False).toarray()
    root = np.sqrt(M)
    values = eigh(K / root[:, None] / root, eigvals_only=True, subset_by_index=[0, 5])
    assert (values[:3] < 1e-9 * values[3]).all()  # a free body can move and turn
    return np.sqrt(values[3:6])


def test_frequencies_converge_to_second_order():
    """Halving l divides errors by four with half blocks, by at most two with whole blocks."""
    half, whole = ([frequencies(edges, n) for n in (4, 8, 16)] for edges in ("half", "whole"))
    falls = (half[0] - half[1]) / (half[1] - half[2])
    assert (falls > 3.7).all()
    assert (falls < 4.7).all()
    error = np.abs(half[1] / (half[2] + (half[2] - half[1]) / 3) - 1)
    other = np.abs(whole[1] / (half[2] + (half[2] - half[1]) / 3) - 1)
    assert (error < 0.006).all()
    assert (other[:2] > 5 * error[:2]).all()


def test_a_strip_under_uniform_stress_is_exact():
    """u_z = -z F_N/(E B L), u_x = -u_z' x/3, E B = 4 k/3, at any l; whole blocks differ."""
    for edges, exact in (("half", True), ("whole", False)):
        scene = small_free(theta=0.0).replace({"slider.edges": edges})
        strain = scene.F_N / (4 / 3 * scene.slider.k * scene.slider.L)
        u = np.zeros((scene.N_z, 2, scene.N_x))
        u[:, 0] = strain / 3 * scene.x
        u[:, 1] = -strain * scene.slider.l * np.arange(scene.N_z)[:, None]
        K = stiffness(scene, closed=np.zeros(scene.N_x, bool), driver=False)
        left = (K @ u.ravel()).reshape(u.shape)
        left[-1, 1] += scene.load
        left[0, 1] -= scene.load
        size = np.abs(left).max() / (scene.F_N / scene.N_x)
        assert (size < 1e-9) if exact else (size > 0.05)


def test_masses_are_those_of_the_material():
    small_slab = slab(p=60.0, tau=30.0, L=0.03, H=0.015, l=2.5e-3)
    for scene in (*SCENES.values(), chain().replace(HALF), small_slab.replace(HALF)):
        assert scene.m * np.outer(*scene.shares).sum() == pytest.approx(scene.slider.M, rel=1e-14)
        if scene is SCENES["free"]:
            assert scene.load.sum() == pytest.approx(scene.F_N, rel=1e-14)


@EACH
def test_accelerations_are_those_of_the_operators(name):
    """The core agrees with M, K, C at a random state: half blocks have half of all."""
    scene = SCENES[name]
    solver, rng = StaticSolver(scene, "linear"), np.random.default_rng(0)
    M, K, C = operators(scene)
    state = solver.loaded.state(scene, 1e-7)
    q = 1e-9 * rng.standard_normal(len(M))
    v = 1e-3 * rng.standard_normal(len(M))
    q[: scene.N_x] = v[: scene.N_x] = 0.0  # stuck
    u, rod = solver.displacements(q)
    v_u, v_rod = solver.displacements(v)
    at_rest = core.evaluate(core.model(scene, "linear", state.u_drv0), state, 0.0)
    state.y[:, :2] += u
    state.y[:, 2:] = v_u
    if scene.rigid:
        state.rod[:3] += rod
        state.rod[3:] = v_rod
    found = core.evaluate(core.model(scene, "linear", state.u_drv0), state, 0.0)
    exact = -(K @ q + C @ v) / M
    exact[: scene.N_x] = 0.0
    a = solver.coordinates(found.a, found.a_rod)
    np.testing.assert_allclose(a, exact, atol=1e-9 * np.abs(exact).max())
    assert np.abs(at_rest.a).max() < 1e-9 * np.abs(exact).max()


@EACH
def test_loads_rest_on_the_interface(name):
    """Corner blocks carry a half column; both static solvers agree; steps are stable."""
    scene = SCENES[name]
    loaded, now = StaticSolver(scene, "linear").loaded, ContactProblem(scene).loaded().values()
    assert loaded.p.sum() == pytest.approx(scene.F_N, rel=1e-12)
    np.testing.assert_allclose(now.p, loaded.p, rtol=1e-9)
    np.testing.assert_allclose(now.f, loaded.f, atol=1e-9 * scene.F_N)
    limit, _ = stability_limit(scene)
    M, K, C = operators(scene)
    rows = [-part.toarray() / M[:, None] for part in (K, C)]
    A = np.block([[np.zeros((len(M),) * 2), np.eye(len(M))], rows])
    z = np.linalg.eigvals(A) * limit
    growth = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    assert growth.max() < 1 + 1e-6
    z = 1.1 * z
    assert np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max() > 1


def test_engines_agree_on_half_blocks():
    scene = small_free(V=0.02).replace(HALF)
    how = {"progress": False, "geometry": "linear"}
    exact, jumped = (pyfric.simulate(scene, 0.01, fidelity=f, **how) for f in ("dynamic", "hybrid"))
    static = pyfric.simulate(scene, 0.01, fidelity="quasistatic", progress=False)
    assert len(exact.events) >= 2
    F_N, start = scene.F_N, [r.events["F_T_start"].to_numpy() for r in (exact, jumped, static)]
    np.testing.assert_allclose(start[1], start[0], atol=1e-3 * F_N)
    assert start[2][0] == pytest.approx(start[0][0], abs=1e-3 * F_N)
    energy = pyfric.simulate(scene, 1e-3, fidelity="dynamic", energies=True, **how)
    assert budget_error(energy) < 1e-6 * energy.curve["elastic_bonds"].max()


def test_a_chain_ends_in_half_blocks_in_both_engines():
    scene = chain(L=0.2, p=10.0, tau=0.0, V=2e-2).replace(HALF)
    how = {"progress": False, "geometry": "linear"}
    runs = [pyfric.simulate(scene, 1e-3, fidelity=f, **how) for f in ("dynamic", "hybrid")]
    start = [record.events["F_T_start"].to_numpy() for record in runs]
    assert start[0][0] == pytest.approx(0.7 * 5.0, rel=1e-6)  # force of a block with half of p
    assert runs[1].events["n_blocks"].tolist() == runs[0].events["n_blocks"].tolist()
    np.testing.assert_allclose(start[1], start[0], atol=1e-2)
    whole = pyfric.simulate(chain(L=0.2, p=10.0, tau=0.0, V=2e-2), 1e-3, fidelity="hybrid", **how)
    assert whole.events["F_T_start"].iloc[0] == pytest.approx(0.7 * 10.0, rel=1e-6)


def test_half_blocks_are_refused_where_forces_count_by_block():
    for scene, change, field in (
        (small_free(), {"top.k_top": 1.0}, "top.k_top"),
        (small_free(), {"top.T_protocol": ((1.0, 1.0),)}, "top.T_protocol"),
        (small_free(h=0.006, side="top"), {}, "driver.side"),
        (pyfric.preset("slow"), {}, "interface.law"),
    ):
        refused(lambda scene=scene, change=change: scene.replace(HALF | change), field, "half")
    scene = SCENES["rod"]
    refused(lambda: pyfric.simulate(scene, 1.0, geometry="finite"), "geometry", "half blocks")
    refused(lambda: small_rod().replace({"slider.edges": "quarter"}), "slider.edges", "half")


@pytest.mark.parametrize(
    "walls",
    [{}, {"left": "absorbing"}, {"right": "mirrored"}, {"top": "mirrored"}, {"top": "absorbing"}],
)
def test_slabs_have_half_blocks_beside_other_walls(walls):
    """The core agrees with the matrices at random states; a mirrored wall has whole blocks."""
    scene = slab(p=60.0, tau=0.0, L=0.03, H=0.015, l=2.5e-3)
    scene = scene.replace(HALF | {f"walls.{side}": of for side, of in walls.items()})
    M, K, C = operators(scene)
    state = pyfric.loaded_state(scene).state(scene, 1e-7)
    rng, shape = np.random.default_rng(0), (scene.N_z, 2, scene.N_x)
    u, v = 1e-9 * rng.standard_normal(shape), 1e-3 * rng.standard_normal(shape)
    u[0, 0] = v[0, 0] = 0.0
    state.y[:, :2], state.y[:, 2:] = u, v
    found = core.evaluate(core.model(scene, "linear", state.u_drv0), state, 0.0).a
    exact = -((K @ u.ravel() + C @ v.ravel()) / M).reshape(shape)
    exact[0, 0] = 0.0
    np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())
    columns = scene.shares[1]
    assert columns[-1] == (1.0 if walls.get("right") == "mirrored" else 0.5)
    assert scene.shares[0][-1] == (1.0 if walls.get("top") == "mirrored" else 0.5)
