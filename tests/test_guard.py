"""Checks that stop a run: numbers, energy, lattice."""

import dataclasses

import numpy as np
import pytest

import pyfric
from pyfric import core
from pyfric.engines import RunError, default_stepper, folded
from pyfric.engines.guard import MARGIN, Guard
from pyfric.scene import chain, setup1, setup2
from pyfric.statics import StaticSolver, stability_limit
from pyfric.values import SceneError


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-2} | changes)


def free(**changes):
    return setup2(**{"L": 0.012, "H": 0.005, "F_N": 50.0, "V": 2e-2} | changes)


SCENES = {
    "rod": (rod(), 0.02),
    "rod, fast": (rod(V=10.0), 2e-3),
    "rod, high driver": (rod(h=0.0125, V=0.2), 0.02),
    "free": (free(), 0.02),
    "free, light edge": (free(theta=1.0, V=0.2), 0.01),
    "no viscosity": (rod(eta=0.0, V=0.2), 0.01),
    "no friction": (free(mu_s=0.0, mu_k=0.0), 0.01),
    "chain": (chain(L=0.02, tau=60.0, V=0.2), 0.01),
    "chain, held": (chain(L=0.02, tau=60.0, k_top=2e7, V=0.2), 0.01),
    "soft driver": (rod(K=1e3, V=10.0), 0.01),
    "weakening": (rod(V=0.2, d_c=1e-6), 0.01),
    "load removed": (rod(V=0.0, **{"top.protocol": [(2e-4, 400.0), (2e-4, 20.0)]}), 2e-3),
    "load removed, free": (free(V=0.0, **{"top.protocol": [(2e-4, 50.0), (2e-4, 5.0)]}), 2e-3),
}


@pytest.mark.parametrize(
    ("name", "share"), [*((name, 0.99) for name in SCENES), ("rod", 0.5), ("weakening", 0.5)]
)
def test_the_bound_of_energy_holds_without_its_margin(name, share, monkeypatch):
    """Exact motion cannot exceed the bound; stable steps use little of the margin."""
    scene, t_end = SCENES[name]
    monkeypatch.setattr("pyfric.engines.guard.MARGIN", 0.02)
    dt = share * stability_limit(scene)[0]
    calls = (1000,) if share == 0.5 else (1000, 20)  # short calls and, near the limit, long calls
    for every in (t_end / n for n in calls):
        how = {"geometry": "linear", "energies": False, "progress": False}
        record = pyfric.simulate(
            scene, t_end, fidelity="dynamic", dt=dt, sample=every, switching="step_end", **how
        )
        assert record.status == "complete"


@pytest.mark.parametrize(("name", "share"), [("rod", 1.3), ("free", 1.1), ("chain", 1.1)])
def test_steps_above_the_limit_are_stopped(name, share, monkeypatch):
    """Growth is seen long before numbers overflow; steps are clearly above the limit of all
    states."""
    scene, _ = SCENES[name]
    dt = share * stability_limit(scene, default_stepper(scene))[0]
    monkeypatch.setattr("pyfric.engines.options.step_size", lambda *_: dt)
    with pytest.raises(RunError, match=r"energy grows from .* at step") as caught:
        pyfric.simulate(
            scene, 0.05, fidelity="dynamic", geometry="linear", switching="step_end", progress=False
        )
    kept = caught.value.record
    assert kept.status.startswith("failed: the energy grows")
    assert "the energy grows" in kept.summary()
    assert np.isfinite(kept.final_state.y).all()
    assert kept.curve["t"].iloc[-1] > 0
    assert np.abs(kept.curve["F_T"]).max() < 10 * scene.F_N


def test_the_step_and_the_block_are_those_where_it_began():
    scene = rod()
    record = pyfric.simulate(scene, 1e-4, fidelity="dynamic", progress=False)
    state = record.final_state.copy()
    state.y[3, 3, 5] = 1e200
    with pytest.raises(RunError, match=r"column 6 .*, row 4 ") as caught:
        pyfric.simulate(scene, 2e-4, initial=state, fidelity="dynamic", progress=False)
    assert f"at step {state.step + 1}, " in str(caught.value)


def test_rounding_is_no_instability():
    """Blocks of a slab at rest without strain are released: all motion is rounding."""
    scene = pyfric.slab(L=0.02, H=0.01, l=0.002, p=20.0, tau=5.0)
    state = pyfric.released(scene, 3)
    record = pyfric.simulate(scene, 5e-4, initial=state, fidelity="dynamic", progress=False)
    assert record.status == "complete"
    assert not record.notes


def test_energy_from_nowhere_is_seen():
    scene = rod(V=0.0)
    solver = StaticSolver(scene, "linear")
    state = solver.loaded.state(scene, 1e-6)
    guard = Guard(scene, core.model(scene, "linear", state.u_drv0), "linear", solver.loaded)
    base = guard.energy(state)
    assert guard.trouble(state, state, base) is None
    for share in (0.5 * MARGIN, 2 * MARGIN):
        kicked = state.copy()
        kicked.y[2, 2, 3] = np.sqrt(2 * share * base.stored / scene.m)
        kicked.step = 1
        found = guard.trouble(state, kicked, base)
        assert (found is None) == (share < MARGIN)
    assert (found.i, found.j) == (3, 2)
    assert "energy" in found.what


def test_energy_of_an_earlier_state_is_that_of_its_loads():
    scene = rod(V=0.01, **{"driver.protocol": [(1e-4, 0.01), (1e-4, 0.0)]})
    solver = StaticSolver(scene, "linear")
    state = solver.loaded.state(scene, 1e-6)
    state.step = 500
    before, after = (core.model(scene, "linear", state.u_drv0, t) for t in (0.0, 2e-3))
    guard = Guard(scene, before, "linear", solver.loaded)
    base = guard.energy(state)
    guard.model = after
    assert guard.energy(state, before) == base != guard.energy(state)


def test_folded_cells_are_found():
    scene = free()
    l = scene.slider.l
    u = np.zeros((scene.N_z, 2, scene.N_x))
    j, i = np.mgrid[: scene.N_z, : scene.N_x]
    assert folded(scene, u) is None
    angle = 2.5  # a turned lattice is not folded
    u[:, 0] = l * (np.cos(angle) * i - np.sin(angle) * j - i)
    u[:, 1] = l * (np.sin(angle) * i + np.cos(angle) * j - j)
    assert folded(scene, u) is None
    u[:] = 0.0
    u[2, 0, 4] = 0.9 * l
    assert folded(scene, u) is None
    u[2, 0, 4] = 1.1 * l
    column, row = folded(scene, u)
    assert row in (1, 2, 3)
    assert column in (4, 5)
    assert folded(chain(), np.zeros((1, 2, 57))) is None


def test_loads_that_fold_are_refused_or_noted():
    scene = rod(F_N=4e5, V=20.0)
    for fidelity in ("hybrid", "dynamic", "auto"):
        with pytest.raises(SceneError, match="folds the lattice") as caught:
            pyfric.simulate(scene, 1e-3, fidelity=fidelity, progress=False)
        assert caught.value.field == "top.F_N"
    for fidelity in ("quasistatic", "hybrid"):
        geometry = None if fidelity == "quasistatic" else "linear"
        how = {"fidelity": fidelity, "geometry": geometry, "progress": False}
        assert "strains reach about 1.3" in pyfric.simulate(scene, 1e-5, **how).notes[0]
        notes = pyfric.simulate(rod(V=1e-3), 1e-5, **how).notes
        assert not any("strains" in note for note in notes)
    soft = dataclasses.replace(free(), top=dataclasses.replace(free().top, F_N=5e4))
    with pytest.raises(SceneError, match=r"top\.F_N = 50000"):  # there is no loaded state
        pyfric.simulate(soft, 1e-3, fidelity="hybrid", progress=False)


def test_a_lattice_that_folds_stops_the_run():
    """The run stops in the step of the fold; here it would unfold a few steps later."""
    with pytest.raises(RunError, match=r"folded at step \d+, t = .* block in column 1 ") as caught:
        pyfric.simulate(rod(V=300.0), 1e-3, fidelity="dynamic", progress=False)
    kept = caught.value.record
    assert folded(kept.scene, kept.final_state.y[:, :2]) is None
    assert kept.final_state.step > 0


def test_no_fold_passes_the_core():
    """With random displacements, each folded lattice ends a call after one step."""
    scene, rng, seen = free(), np.random.default_rng(3), []
    start = StaticSolver(scene).loaded.state(scene, 1e-15)  # a step that moves nothing
    model, log = core.model(scene, "finite", start.u_drv0), core.Log(scene.N_x)
    for size in np.repeat([0.05, 0.1, 0.2, 0.4], 25):
        state = start.copy()
        state.y[1:, :2] += size * scene.slider.l * rng.normal(size=(scene.N_z - 1, 2, scene.N_x))
        ends = core.advance(model, state, log, 2) == core.Status.STRAINED
        seen.append((folded(scene, state.y[:, :2]) is not None, ends))
        assert state.step == (1 if ends else 2)
    assert {(True, True), (False, False)} <= set(seen)
    assert (True, False) not in seen


def test_a_slider_that_turns_over_is_no_fold():
    """The core then ends each call after one step, and the run goes on."""
    scene = free(F_N=1.0, **{"top.T": 0.0})
    state = StaticSolver(scene).loaded.state(scene, 1e-7)
    j, i = np.mgrid[: scene.N_z, : scene.N_x]
    l, angle = scene.slider.l, 1.2
    state.y[:, 0] = l * (np.cos(angle) * i - np.sin(angle) * j - i)
    state.y[:, 1] = l * (np.sin(angle) * i + np.cos(angle) * j - j) + 1e-3
    state.mode[:] = core.OPEN
    record = pyfric.simulate(scene, 3e-5, initial=state, fidelity="dynamic", progress=False)
    assert record.status == "complete"
    assert record.final_state.step >= 5
