"""Pushes on any interface, and starts of ruptures: patches, forced ruptures, ramps."""

import numpy as np
import pytest
from helpers import (
    GEOMETRIES,
    advance,
    dynamic,
    first_slips,
    mirrored_scene,
    refused,
    small_free,
    small_rod,
)
from test_lattice import twin_forces

import pyfric
from pyfric import core
from pyfric.record import budget_error
from pyfric.scene import Scene, chain, default_geometry
from pyfric.scene.laws import Ageing

L = 2.5e-3
SCENES = {
    "rod": small_rod(V=0.0),
    "free": small_free(V=0.0),
    "chain": chain(L=12 * L, tau=10.0, K=0.0, V=0.0),
    "slab": pyfric.slab(p=60.0, tau=30.0, L=12 * L, H=6 * L, l=L),
    "right": mirrored_scene(small_rod(V=0.0, mu_s=[0.7 + 0.01 * n for n in range(13)])),
}
EACH = pytest.mark.parametrize("name", SCENES)


def rest_of(scene, geometry="linear"):
    """Return friction along the drive and strength of the loaded slider, from the trailing edge."""
    state = pyfric.StaticSolver(scene, geometry).loaded
    order = np.argsort(scene.n_of_i)
    return (-scene.d * state.f)[order], scene.law.hold(state.p)[order]


# --- forces --------------------------------------------------------------------------------------


@EACH
def test_a_block_at_rest_takes_a_push_by_its_friction(name):
    """Below the threshold of a ramp nothing moves, and f balances it to rounding."""
    scene = SCENES[name]
    tau, strength = rest_of(scene)
    n, rate = 5, 1e6
    pushed = pyfric.ramped(scene, x=4 * scene.slider.l, rate=rate)
    until = 0.9 * (strength[n - 1] - tau[n - 1]) / rate
    record = dynamic(pushed, until)
    state = record.final_state
    assert record.events.empty
    model = core.model(pushed, "linear", state.u_drv0, state.t)
    found = core.evaluate(model, state, state.t)
    i = int(np.argmax(scene.n_of_i == n))
    f = pyfric.StaticSolver(scene, "linear").loaded.f.copy()
    f[i] -= scene.d * rate * state.t
    np.testing.assert_allclose(found.f, f, atol=1e-9 * strength.max())
    np.testing.assert_allclose(state.margin, scene.law.hold(found.p) - abs(f), rtol=1e-7)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("name", ["rod", "free", "right"])
def test_a_block_that_slips_is_accelerated_by_its_push(name, geometry):
    """Accelerations differ by d F/m on this block alone."""
    scene = SCENES[name]
    pushed = scene.replace({"top.push": ((3, 55.0), (7, 200.0, 0.0, 1.0, -300.0))})
    state = pyfric.StaticSolver(scene, geometry).loaded.state(scene, 1e-7)
    state.mode[:] = 1
    t, a = 0.25, []
    for one in (scene, pushed):
        a.append(core.evaluate(core.model(one, geometry, state.u_drv0, t), state, t).a)
    added = np.zeros_like(a[0])
    order = np.argsort(scene.n_of_i)
    added[0, 0, order[[2, 6]]] = scene.d * np.array([55.0, 125.0]) / scene.m
    np.testing.assert_allclose(a[1] - a[0], added, atol=1e-9 * np.abs(added).max())


@pytest.mark.parametrize("geometry", ["linear", "finite"])
@pytest.mark.parametrize("name", ["rod", "free", "right"])
def test_energy_of_pushes(name, geometry):
    """The budget includes the work of pushes and closes, also with ramps that end."""
    scene = SCENES[name]
    force = 3.0 * scene.F_N / scene.N_x
    pushed = scene.replace(
        {"top.push": ((2, force, 0.0, 3e-5), (6, 0.0, 1e-5, 8e-5, force / 2e-5))}
    )
    record = dynamic(pushed, 1.5e-4, geometry=geometry, energies=True, dt=1e-7)
    assert budget_error(record.curve) < 1e-6
    moved = record.curve[["work_load", "dissipated_bonds"]].iloc[-1]
    assert moved["work_load"] > moved["dissipated_bonds"] > 0


def test_the_same_bits_on_any_number_of_threads():
    """25 x 13 blocks run on several threads, although these save no time."""
    scene = small_rod(L=0.06, H=0.03, V=0.0)
    scene = pyfric.overstressed(scene, x=0.03, length=0.02)
    solver = pyfric.StaticSolver(scene.replace({"top.push": ()}), "finite")
    found = []
    for threads in (1, *(2, 3, 4) * 5):
        state = solver.loaded.state(scene, 1e-7)
        advance(scene, "finite", state, 200, threads=threads)
        found.append(state)
    assert (found[0].mode == 1).any()
    assert all(one == found[0] for one in found)
    assert found[0].work[1] != 0


def test_mirrored_pushes():
    scene = pyfric.ramped(small_rod(V=0.0), x=5 * L, rate=1e7)
    one, other = (dynamic(s, 5e-5).final_state for s in (scene, mirrored_scene(scene)))
    np.testing.assert_array_equal(one.mode, -other.mode[::-1])
    np.testing.assert_allclose(one.y[:, 0], -other.y[:, 0, ::-1], rtol=1e-9)
    assert (one.mode == 1).any()


# --- starts --------------------------------------------------------------------------------------


@EACH
def test_a_ramp_starts_slip_where_it_reaches_the_strength(name):
    scene = SCENES[name]
    tau, strength = rest_of(scene)
    pushed = pyfric.ramped(scene, x=6 * scene.slider.l, rate=1e7, begin=1e-5)
    due = 1e-5 + (strength[6] - tau[6]) / 1e7
    first = first_slips(dynamic(pushed, due + 1e-6, stop_when="main_events"))
    assert np.nanargmin(first) == 6
    assert first[6] == pytest.approx(due, rel=1e-9)


@EACH
def test_a_patch_starts_where_it_is(name):
    """All blocks of the patch slip at once, and their neighbours later."""
    scene = SCENES[name]
    l = scene.slider.l
    pushed = pyfric.overstressed(scene, x=6 * l, length=4.2 * l, begin=2e-5)
    assert [one.block for one in pushed.top.push] == [5, 6, 7, 8, 9]
    first = first_slips(dynamic(pushed, 4e-5))
    np.testing.assert_allclose(first[4:9], 2e-5, rtol=1e-6)
    assert not (np.delete(first, range(4, 9)) <= 2e-5 * (1 + 1e-6)).any()
    tau, strength = rest_of(scene, default_geometry(scene))
    force = [one.force for one in pushed.top.push]
    np.testing.assert_allclose(force + tau[4:9], 1.05 * strength[4:9], rtol=1e-9)


@pytest.mark.parametrize("speed", [50.0, 400.0])
@pytest.mark.parametrize("name", ["rod", "chain", "slab"])
def test_a_forced_rupture_runs_at_its_speed(name, speed):
    """Stresses are too low for a rupture by itself: nothing slips ahead of it, and it ends."""
    scene = SCENES[name].replace({"mu_s": 3.0, "mu_k": 2.9})
    l, x = scene.slider.l, 6.5 * SCENES[name].slider.l
    pushed = pyfric.forced(scene, x=x, length=9 * l, speed=speed, excess=0.1)
    t_end = 6 * l / speed
    first = first_slips(dynamic(pushed, t_end))
    at = np.arange(scene.N_x) * l
    inside = abs(at - x) <= 4.5 * l * (1 + 1e-9)
    assert inside.sum() == 10
    np.testing.assert_allclose(first[inside], abs(at - x)[inside] / speed, rtol=1e-6)
    assert not np.isfinite(first[~inside]).any()


def test_fronts_leave_a_patch_by_themselves():
    """In a slab near its strength the rupture of a small patch reaches both ends later."""
    slab = pyfric.slab(p=60.0, tau=38.0, L=60 * L, H=20 * L, l=L)
    pushed = pyfric.overstressed(slab, x=30 * L, length=4 * L)
    record = dynamic(pushed, 4e-4)
    first = first_slips(record)
    assert np.isfinite(first).all()
    assert (np.diff(first[:29]) < 0).all()
    np.testing.assert_allclose(first, first[::-1], rtol=1e-6)
    assert record.rupture_class().reached == slab.N_x


def test_sliders_that_are_driven():
    """Pushes are computed for the slider as the driver has loaded it when they begin."""
    scene = small_rod(V=5e-3)
    solver = pyfric.StaticSolver(scene, "finite")
    t = 0.02
    state = solver.solve(solver.loaded.u[0, 0], scene.drive(t))
    margin = scene.law.hold(state.p) - abs(state.f)
    assert margin.min() > 0
    pushed = pyfric.overstressed(scene, x=3 * L, length=0.0, begin=t)
    assert pushed.top.push[0].force == pytest.approx(1.05 * scene.law.hold(state.p)[3] + state.f[3])
    record = dynamic(pushed, t + 1e-5, geometry="finite")
    assert first_slips(record)[3] == pytest.approx(t, rel=1e-6)
    too_little = scene.replace({"top.push": ((4, 0.99 * float(margin[3]), t),)})
    refused(
        lambda: pyfric.simulate(too_little, t + 1e-5, fidelity="dynamic"),
        "top.push",
        "does not let it slip",
    )
    refused(lambda: pyfric.ramped(small_rod(), x=1.0, rate=1.0), "x", value=1.0, within=(0, 0.03))
    late = {"x": 3 * L, "length": 0.0, "begin": 10.0}
    refused(lambda: pyfric.overstressed(scene, **late), "begin", "something slips before")


def test_laws_that_heal_and_files():
    """Starts work with another friction law, and files keep the scene with its ramps."""
    scene = small_rod(V=0.0, law=Ageing(B=0.02, t_c=1e-3))
    both = pyfric.forced(scene, x=5 * L, length=3 * L, speed="100 m/s")
    both = pyfric.ramped(both, x=0.0, rate=1.0)
    assert len(both.top.push) == 4
    assert Scene.from_toml(both.to_toml()) == both
    short = scene.replace({"top.push": ((1, 0.0, 0.0, 1.0, 1e3),)})
    assert Scene.from_toml(short.to_toml()) == short
    assert pyfric.preset("fig1", push=((3, 99.0),)).top.push[0].block == 3


def test_refused_starts():
    scene = SCENES["rod"]
    patch = {"x": 5 * L, "length": 2 * L}
    for more, field, said in (
        ({"x": -1.0}, "x", "too small"),
        ({"x": 1.0}, "x", "outside the interface"),
        ({"x": "5 s"}, "x", "wrong unit"),
        ({"length": -1.0}, "length", "too small"),
        ({"x": 4.5 * L, "length": 0.1 * L}, "length", "no block lies inside"),
        ({"excess": 0.0}, "excess", "too small"),
        ({"begin": -1.0}, "begin", "too small"),
    ):
        refused(lambda more=more: pyfric.overstressed(scene, **patch | more), field, said)
    refused(lambda: pyfric.forced(scene, **patch, speed=0.0), "speed", value=0.0, within=(0,))
    refused(lambda: pyfric.ramped(scene, x=0.0, rate=-1.0), "rate", value=-1.0, within=(0,))
    refused(lambda: pyfric.overstressed("slow", **patch), "interface.law", "no threshold")
    for push, said in (
        ((1, 1.0), "does not let it slip"),
        ((14, 1e6), "outside the interface"),
        ((1, 0.0), "pushes nothing"),
    ):
        weak = dict.fromkeys(["push"], (push,))
        refused(lambda weak=weak: dynamic(scene.replace(weak), 1e-4), "top.push", said)
    pushed = pyfric.overstressed(scene, **patch)
    for fidelity in ("hybrid", "quasistatic", "equilibrium"):
        run = {"fidelity": fidelity}
        refused(lambda run=run: pyfric.simulate(pushed, 1e-3, **run), "top.push", "full dynamics")
    assert pyfric.plan(pushed, t_end=1e-3).alone.engine == "dynamic"


# --- slip before the start -----------------------------------------------------------------------

EDGE = (0.0, 2e-7, 4e-7, 6e-7, 6e-7, 4e-7, 2e-7, 0.0)


def slipped(scene, slip, scale=1.0):
    values = [scale * s for s in slip] + [0.0] * (scene.N_x - len(slip))
    return scene.replace({"interface.slip": values})


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("make", [small_rod, small_free])
def test_blocks_rest_where_a_slip_brought_them(make, geometry):
    """Springs of the twin balance above the interface, and friction sums to F_T = 0."""
    scene = slipped(make(), EDGE)
    loaded = pyfric.StaticSolver(scene, geometry).loaded
    np.testing.assert_array_equal(loaded.u[0, 0, :8], EDGE)
    forces = twin_forces(scene, loaded.u, geometry)
    unit = scene.F_N / scene.N_x
    np.testing.assert_allclose(forces[1:-1], 0.0, atol=1e-8 * unit)
    np.testing.assert_allclose(forces[0, 0], -loaded.f, atol=1e-8 * unit)
    np.testing.assert_allclose(forces[0, 1], -loaded.p, atol=1e-8 * unit)
    assert loaded.f.sum() == pytest.approx(0.0, abs=1e-8 * unit)
    assert np.abs(loaded.tau - pyfric.StaticSolver(make(), geometry).loaded.tau).max() > 0.01 * unit
    if geometry == "linear":
        now = pyfric.statics.ContactProblem(scene).loaded().values()
        np.testing.assert_allclose(now.f, loaded.f, atol=1e-8 * unit)


def test_slip_is_linear_and_a_common_slip_moves_the_slider():
    scene = small_free()
    tau = [
        pyfric.StaticSolver(s, "linear").loaded.tau
        for s in (
            scene,
            slipped(scene, EDGE),
            slipped(scene, EDGE, -1.0),
            scene.replace({"interface.slip": 1e-3}),
            mirrored_scene(slipped(scene, EDGE)),
        )
    ]
    size = np.abs(tau[1]).max()
    np.testing.assert_allclose(tau[1] + tau[2], 2 * tau[0], atol=1e-10 * size)
    np.testing.assert_allclose(tau[3], tau[0], atol=1e-9 * size)
    np.testing.assert_allclose(tau[4][::-1], tau[1], atol=1e-10 * size)


def test_what_a_slip_overloads_slips_at_once():
    """The run begins with an event at the ends of the slip; a smaller slip leaves all at rest."""
    scene = small_free(V=0.0)
    tau, strength = rest_of(slipped(scene, EDGE, 8.0))
    over = np.flatnonzero(np.abs(tau) > strength) + 1
    assert 0 < len(over) < 6
    records = [dynamic(slipped(scene, EDGE, 8.0), 1e-4, fidelity=f) for f in ("dynamic", "hybrid")]
    first = records[0].episodes.query("t_start < 1e-6")["n"]
    assert sorted(first) == over.tolist()
    assert records[1].episodes.equals(records[0].episodes)
    quiet = dynamic(slipped(scene, EDGE, 0.3), 1e-4)
    assert quiet.episodes.empty
    assert np.abs(quiet.final_state.y[:, 2:]).max() < 1e-9
    wrong = slipped(scene, EDGE, 8.0)
    refused(lambda: pyfric.simulate(wrong, 1.0, fidelity="quasistatic"), "interface.slip", "rest")


def test_the_sequence_starts_from_a_slip():
    scene = slipped(small_free(V=0.02), EDGE, 0.3)
    how = {"fidelity": "quasistatic", "geometry": "linear", "progress": False}
    static, exact = pyfric.simulate(scene, 0.01, **how), dynamic(scene, 0.01)
    plain = pyfric.simulate(small_free(V=0.02), 0.01, **how)
    first = [r.events["F_T_start"].iloc[0] for r in (static, exact, plain)]
    assert first[0] == pytest.approx(first[1], abs=1e-4 * scene.F_N)
    assert abs(first[2] - first[0]) > 1e-3 * scene.F_N


def test_a_slip_is_refused_where_blocks_do_not_count_from_it():
    refused(lambda: chain().replace({"interface.slip": 1e-6}), "interface.slip", "tau")
    slow = pyfric.preset("slow")
    refused(lambda: slow.replace({"interface.slip": 1e-6}), "interface.slip", "rest")
    refused(lambda: slipped(small_rod(), (np.inf,)), "interface.slip", "finite")
