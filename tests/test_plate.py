"""A rigid plate against the side: `driver.h_top`."""

import dataclasses

import numpy as np
import pytest
import twin
from helpers import (
    GEOMETRIES,
    advance,
    bits,
    budget_error,
    mirrored_scene,
    mirrored_state,
    refused,
    same_run,
    shaken,
    small,
)
from tolerances import FORCE, REPRODUCED, ROUNDING
from twin import STUCK

import pyfric
from pyfric import core
from pyfric.core import State, StateError
from pyfric.engines.pauses import coarser
from pyfric.engines.quasistatic import QuasistaticRun
from pyfric.record import Record, RecordError
from pyfric.scene import Scene, setup1, setup2, slab
from pyfric.statics import ContactProblem, StaticSolver, loaded_state, stability

PLATES = {
    "rod": small(h=2.5e-3).replace(h_top=7.5e-3),
    "rod, up to the rod": small(h=5e-3, side="right").replace(h_top=0.0125),
    "free": small("free", h=2e-3).replace(h_top=4e-3),
    "free, whole side": small("free", h=1e-3, side="right").replace(h_top=5e-3),
    "pulled": small("free", h=2e-3, side="pull right").replace(h_top=4e-3),
    "rod, top": small(side="top", h=0.0125),
    "free, top": small("free", side="top", h=5e-3),
}
every = pytest.mark.parametrize("scene", PLATES.values(), ids=PLATES)
SIDES = {name: scene for name, scene in PLATES.items() if scene.driver.side != "top"}
at_sides = pytest.mark.parametrize("scene", SIDES.values(), ids=SIDES)


def run(scene, t_end, **how):
    return pyfric.simulate(scene, t_end, **{"progress": False, "threads": 1} | how)


# --- fields --------------------------------------------------------------------------------------


def test_what_is_not_on_the_driven_side_is_refused():
    scene, chain = small(h=5e-3), pyfric.preset("chain")
    for value, *texts in (
        ("2.5 mm", "0.0025 m", "above h", "from h = 0.005 m to H = 0.0125 m"),
        ("6 mm", "0.006 m", "not on a row", "a multiple of l = 0.0025 m"),
        ("15 mm", "0.015 m", "from h = 0.005 m to H = 0.0125 m"),
        ("-5 mm", "-0.005 m", "too small"),
    ):
        refused(lambda value=value: scene.replace(h_top=value), "driver.h_top", *texts)
    refused(lambda: chain.replace(h_top=chain.slider.l), "driver.h_top", value=0.0025, within=(0,))
    held = slab(L=0.02, H=0.01, l=1e-3, p=1.0).replace({"walls.top": "held"})
    top = {"driver.h": held.slider.l, "driver.h_top": held.slider.H}
    refused(lambda: held.replace(top), "driver.h_top", "the top row is held", "at most")


def test_a_plate_in_files_and_texts():
    scene = PLATES["free"]
    assert Scene.from_toml(scene.to_toml()) == scene
    assert "h_top = 0.004 m" in repr(scene)
    assert (scene.j_h, scene.j_h_top, scene.n_driven) == (2, 4, 3)
    figure = scene.plot()
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert "$h$ = 2$-$4 mm" in texts
    assert "h_top = 4 mm" in figure.caption


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_plate_of_one_block_is_that_block(geometry):
    """Bits agree in dynamics, hybrid runs and quasi-static sequences."""
    one = small(h=5e-3)
    two = one.replace(h_top=one.driver.h)
    for fidelity in ("dynamic", "hybrid") + ("quasistatic",) * (geometry == "linear"):
        how = {} if fidelity == "quasistatic" else {"geometry": geometry}
        a, b = (run(scene, 3e-3, fidelity=fidelity, **how) for scene in (one, two))
        assert len(a.events) > 0
        assert same_run(a, b, scene=one)


# --- static states -------------------------------------------------------------------------------


def at_rest(scene, geometry):
    """Return a state of rest with a displaced interface under the pushing plate."""
    solver = StaticSolver(scene, geometry)
    rng, unit = np.random.default_rng(0), scene.F_N / scene.slider.k / scene.N_x
    u_x = solver.loaded.u[0, 0] + 0.1 * unit * rng.standard_normal(scene.N_x)
    return solver, u_x, solver.solve(u_x, 0.2 * scene.F_N / scene.driver.K)


@every
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_static_states_are_at_rest_for_the_twin(scene, geometry):
    """The loaded state is at rest, too: the plate pushes no block although their u_x differ."""
    solver, _, pushed = at_rest(scene, geometry)
    if not (scene.rigid and scene.driver.side == "top"):
        assert np.ptp(solver.u_drv0) > 0.1 * np.abs(solver.u_drv0).max()
    for found in (solver.loaded, pushed):
        state = found.state(scene, 1e-7)
        t = found.drive / scene.driver.V
        assert (state.mode == STUCK).all()
        there = twin.right_hand_side(
            scene, geometry, t, state.y, state.rod, state.mode, solver.u_drv0
        )
        force = max(np.abs(scene.m * there.dydt).max(), np.abs(scene.M_rod * there.drod[3:5]).max())
        assert force < 1e-10 * scene.F_N
        np.testing.assert_allclose(there.f, found.f, rtol=0, atol=1e-11 * scene.F_N)
        assert there.F_T == pytest.approx(found.F_T, rel=0, abs=1e-12 * scene.F_N)
        forces = twin.driver_forces(scene, t, state.y, solver.u_drv0).values()
        assert (np.array([*forces]) > 0).all() or found is solver.loaded
        assert found.tau.sum() == pytest.approx(found.F_T, rel=0, abs=1e-12 * scene.F_N)


@at_sides
def test_forces_of_the_plate_turn_the_slider(scene):
    """Forces of the plate act at their blocks: sum p x = sum load x + sum F_j h_j + kappa phi."""
    solver, _, found = at_rest(scene, "linear")
    y = found.state(scene, 1e-7).y
    forces = twin.driver_forces(scene, found.drive / scene.driver.V, y, solver.u_drv0)
    turning = scene.d * sum(force * j * scene.slider.l for (j, _), force in forces.items())
    expected = scene.load @ scene.x + turning + scene.kappa * found.rod[2]
    assert found.p @ scene.x == pytest.approx(expected, rel=0, abs=1e-12 * scene.F_N)
    assert abs(turning) != pytest.approx(found.F_T * scene.driver.h, rel=0.1)


@every
def test_the_condensed_slider_is_the_whole_one(scene):
    """Springs on the condensed slider act like springs in the sparse matrix."""
    solver, u_x, there = at_rest(scene, "linear")
    problem, none = ContactProblem(scene), np.zeros(scene.N_x, dtype=bool)
    here = problem.solve(u_x, there.drive, free=none)
    force = 1e-12 * scene.F_N
    assert here.F_T == pytest.approx(there.F_T, rel=0, abs=force)
    np.testing.assert_allclose(here.tau, there.tau, rtol=0, atol=force)
    np.testing.assert_allclose(here.p, there.p, rtol=0, atol=force)
    assert problem.loaded().values().F_T == pytest.approx(0.0, rel=0, abs=force)
    np.testing.assert_allclose(problem.slider.S, problem.slider.S.T, rtol=1e-14)
    free = problem.undriven().slider
    one = ContactProblem(scene.replace(h_top=None)).undriven().slider
    np.testing.assert_allclose(free.S, one.S, rtol=0, atol=1e-9 * np.abs(one.S).max())
    aside = ContactProblem(scene, solver.u_drv0 + np.arange(scene.n_driven) * 1e-6)
    alike = scene.rigid and scene.driver.side == "top"  # then the mean of all springs decides
    assert alike or not np.allclose(aside.slider.G[:, 1], problem.slider.G[:, 1], rtol=0.01)


@every
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_soft_and_stiff_plates(scene, geometry):
    """A soft plate pushes with K X; a stiff plate moves all its blocks by X."""
    for K in (1.0, 1e14):
        solver = StaticSolver(scene.replace(K=K), geometry)
        drive = 1e-6
        found = solver.solve(solver.loaded.u[0, 0], drive)
        moved = scene.d * (scene.u_driven(found.u) - solver.u_drv0)
        if K == 1.0:
            assert found.F_T == pytest.approx(K * drive, rel=1e-6)
        else:
            np.testing.assert_allclose(moved, drive, rtol=1e-5)


@at_sides
def test_the_ladder_begins_where_a_block_is_at_its_threshold(scene):
    solver, ladder = StaticSolver(scene), QuasistaticRun(scene)
    ladder.advance(3e-3, lambda: bool(ladder.events), lambda *_: None)
    assert ladder.events
    ladder.pass_on()
    t, F_T = (ladder.history.logs(scene.N_x)["quiet"][name][0] for name in ("t", "F_T"))
    rest = solver.solve(solver.loaded.u[0, 0], scene.drive(t))
    assert F_T == pytest.approx(rest.F_T, rel=1e-10)
    margin = 0.7 * rest.p - np.abs(rest.f)
    assert margin.min() == pytest.approx(0.0, abs=1e-10 * scene.F_N)


# --- runs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("geometry", "name"),
    [
        ("linear", "rod, up to the rod"),
        ("linear", "free"),
        ("finite", "rod"),
        ("finite", "free, whole side"),
    ],
)
def test_energy_is_conserved(geometry, name):
    """The budget closes to the order of the stepper; the springs' energy exceeds F_T^2/2K."""
    scene = PLATES[name]
    errors = []
    for share in (0.5, 0.125):
        dt = share * stability.stability_limit(scene)[0]
        how = {"fidelity": "dynamic", "switching": "step_end"}
        record = run(scene, 3e-3, geometry=geometry, dt=dt, **how)
        assert len(record.events) >= 1
        errors.append(budget_error(record))
    curve = record.curve
    assert errors[1] < 1e-6 * curve["work_driver"].iloc[-1]
    assert errors[1] < errors[0] / 30
    together = curve["F_T"] ** 2 / (2 * scene.driver.K)
    more = (curve["elastic_driver"] - together) / together.max()
    assert more.max() > 5e-5
    assert more.min() > -1e-12
    work = scene.driver.V * np.trapezoid(curve["F_T"], curve["t"])
    assert curve["work_driver"].iloc[-1] == pytest.approx(work, rel=1e-3)


@at_sides
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_mirrored_scene_gives_the_mirrored_bits(scene, geometry):
    state = shaken(scene, geometry, 2e-7)
    image = mirrored_state(state)
    advance(scene, geometry, state, 200)
    advance(mirrored_scene(scene), geometry, image, 200)
    assert state.work[0] > 0
    back = mirrored_state(image)
    for name in ("y", "rod", "mode", "loss", "heat", "work"):
        np.testing.assert_array_equal(getattr(back, name), getattr(state, name), err_msg=name)


@pytest.mark.parametrize("name", ["rod, up to the rod", "free"])
def test_threads_do_not_change_a_bit(name):
    scene, states = PLATES[name], []
    for threads in (1, 2, scene.N_z):
        state = loaded_state(scene).state(scene, 2e-7)
        advance(scene, "finite", state, 6000, threads=threads, switching="located")
        states.append(bits(state))
    assert states[0] == states[1] == states[2]


@pytest.mark.parametrize("fidelity", ["dynamic", "hybrid"])
def test_runs_go_on_from_files(fidelity, tmp_path):
    scene = PLATES["rod"]
    how = {"fidelity": fidelity, "geometry": "finite", "sample": 8e-6}
    whole, half = run(scene, 3e-3, **how), run(scene, 1.5e-3, **how)
    two = run(scene, 3e-3, initial=Record.load(half.save(tmp_path / "half.nc")), **how)
    state = State.load(half.final_state.save(tmp_path / "state.npz"))
    assert state == half.final_state
    other = run(scene, 3e-3, initial=state, dt=state.dt, **how)
    for one in (two, other):
        y, expected = one.final_state.y, whole.final_state.y
        exact = 0 if fidelity == "dynamic" else REPRODUCED
        np.testing.assert_allclose(y, expected, rtol=0, atol=exact * np.abs(expected).max())
    assert fidelity == "hybrid" or same_run(two, whole, versions={})


def test_states_of_other_plates_are_refused(tmp_path):
    scene = PLATES["rod"]
    state = run(scene, 1e-4).final_state
    for other in (scene.replace(h_top=0.01), scene.replace(h_top=None)):
        with pytest.raises(StateError, match=r"state.u_drv0: shape .* the driver pushes"):
            dataclasses.replace(state, spring=None).check_physics(other)
        with pytest.raises(ValueError, match="u_drv0"):
            core.model(other, "linear", state.u_drv0)
        with pytest.raises(ValueError, match="u_drv0"):
            StaticSolver(other, u_drv0=state.u_drv0)
    record = run(scene, 1e-4)
    mixed = dataclasses.replace(record, scene=scene.replace(h_top=0.01))
    with pytest.raises(RecordError, match="u_drv0"):
        Record.load(mixed.save(tmp_path / "mixed.nc"))


OTHERS = {
    "speed": {"V": 0.6},
    "stiffness": {"K": 1.6e5},
    "stiffness and speed": {"K": 3.2e6, "V": 0.1},
    "higher": {"h": 3e-3, "h_top": 5e-3},
    "longer": {"h_top": 5e-3, "K": 2e6, "V": 0.0},
    "one block": {"h_top": None},
}


@pytest.mark.parametrize(
    ("name", "what"), [*(("free", what) for what in OTHERS), ("one", "speed"), ("one", "higher")]
)
def test_another_driver_goes_on_without_a_jump(name, what):
    """F_T stays the same, and so do forces on blocks that both plates drive."""
    changes = OTHERS[what]
    scene = small("free", h=2e-3) if name == "one" else PLATES[name]
    how = {"geometry": "linear", "sample": 2e-6}
    half = run(scene, 1e-3, **how)
    F_T, state = half.curve["F_T"].iloc[-1], half.final_state
    other = scene.replace(changes)
    two = run(other, 1.1e-3, **how, initial=half if changes.keys() == {"V"} else state)
    start = two.curve["F_T"][two.curve["t"] >= state.t].iloc[0]
    assert start == pytest.approx(F_T, rel=0, abs=1e-9 * scene.F_N)
    before = core.evaluate(core.model(scene, "linear", state.u_drv0), state, state.t)
    now = state.under(other)
    after = core.evaluate(core.model(other, "linear", now.u_drv0, now.t), now, now.t)
    assert after.F_T == pytest.approx(F_T, rel=0, abs=1e-9 * scene.F_N)
    if (other.j_h, other.j_h_top) == (scene.j_h, scene.j_h_top):
        np.testing.assert_allclose(after.a, before.a, rtol=0, atol=1e-9 * np.abs(before.a).max())
    assert now.under(other) == now


def test_a_driver_does_not_change_sides():
    scene = PLATES["free"]
    state = run(scene, 1e-4).final_state
    with pytest.raises(StateError, match="its driver is 'left'"):
        run(mirrored_scene(scene), 2e-4, initial=state)
    for spring in ([1.0, 1.0, 2.0, 9.0], [1.0, 1.0, 2.0, 3.0]):
        with pytest.raises(StateError, match=r"state\.spring"):
            run(scene, 2e-4, initial=dataclasses.replace(state, spring=np.array(spring)))


def test_stable_slip_and_nucleation_under_a_plate():
    scene = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3, d_c=5e-6, h=2.5e-3).replace(h_top=0.01)
    how = {"geometry": "linear"}
    a = run(scene, 0.06, fidelity="dynamic", **how)
    b = run(scene, 0.06, fidelity="hybrid", **how)
    assert len(a.events) == len(b.events) >= 1
    assert b.counts["steps"] < 0.7 * a.counts["steps"]
    np.testing.assert_allclose(
        b.events["F_T_start"], a.events["F_T_start"], rtol=0, atol=1e-4 * scene.F_N
    )
    ways = [pyfric.analysis.nucleations(one) for one in (a, b)]
    np.testing.assert_allclose(ways[0]["F_T"], ways[1]["F_T"], rtol=1e-4)
    assert (ways[0]["F_T"].dropna() <= a.curve["F_T"].max() * 1.01).all()


def test_a_prescribed_slab_under_a_plate():
    plain = slab(L=0.02, H=0.01, l=1e-3, p=1.0, tau=0.3)
    scene = plain.replace({"driver.K": 1e6, "driver.V": 0.05, "driver.h": 2e-3, "h_top": 6e-3})
    state = loaded_state(scene).state(scene, 1e-7)
    assert state.u_drv0.shape == (5,)
    advance(scene, "linear", state, 2000)
    t = state.t
    here = core.evaluate(core.model(scene, "linear", state.u_drv0), state, t)
    now = state.y, state.rod, state.mode, state.u_drv0, state.slip
    there = twin.right_hand_side(scene, "linear", t, *now)
    assert here.F_T == pytest.approx(there.F_T, rel=1e-12)
    largest = 6 * scene.slider.k * np.abs(state.y[:, :2]).max() / scene.m  # largest term of the sum
    np.testing.assert_allclose(here.a, there.dydt[:, 2:], rtol=0, atol=ROUNDING * largest)


@pytest.mark.parametrize(
    "scene",
    [
        setup1(L=0.03, H=0.02, h=5e-3, K=1e11).replace(h_top=0.0125),
        setup2(L=0.012, H=0.008, h=1e-3, K=1e11).replace(h_top=0.008),
    ],
    ids=["rod", "free"],
)
def test_largest_steps_are_those_of_the_whole_lattice(scene, monkeypatch):
    found, what = stability.stability_limit(scene)
    assert not what["exact"]
    assert found < 0.9 * stability.stability_limit(scene.replace(K=1.0))[0]
    monkeypatch.setattr(stability, "_REDUCED", (scene.N_x, scene.N_z))
    whole = stability.stability_limit(scene)[0]
    assert 0.9 * whole < found < 1.05 * whole


def test_coarser_plates():
    fine = setup1(l=0.5e-3, h=5e-3).replace(h_top=0.05)
    assert coarser(fine).driver == fine.driver
    odd = setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4).replace(h_top=9.1e-3)
    less = coarser(odd)
    assert less.driver.h_top == pytest.approx(9.1e-3, abs=less.slider.l)


def test_plans_take_plates():
    record = run(PLATES["rod"], 3e-3, want="precursors")
    assert record.scene.n_driven == 3
    exact = run(PLATES["rod"], 3e-3, fidelity="dynamic", geometry=record.method.geometry)
    assert record.events["F_T_start"].iloc[0] == pytest.approx(
        exact.events["F_T_start"].iloc[0], abs=1e3 * FORCE * exact.scene.F_N
    )
