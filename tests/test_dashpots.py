"""Dashpots along the bonds only: forces, objectivity, powers, stability limit, order."""

import dataclasses

import numpy as np
import pytest
import twin
from helpers import GEOMETRIES, advance, budget_error, operators, shaken, small

import pyfric
from pyfric import core
from pyfric.scene import Scene, Walls, slab
from pyfric.statics import stability_limit
from pyfric.values import SceneError


def along(scene, **changes):
    return dataclasses.replace(
        scene, slider=dataclasses.replace(scene.slider, dashpots="along", **changes)
    )


def test_scenes():
    scene = along(small())
    assert Scene.from_toml(scene.to_toml()) == scene
    assert small().to_toml().count('dashpots = "full"') == 1
    with pytest.raises(SceneError, match="'full' or 'along'"):
        dataclasses.replace(small().slider, dashpots="both")


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_forces_and_powers_are_those_of_the_twin(kind, geometry):
    scene = along(small(kind))
    state = shaken(scene, geometry, 1e-7, size=1e-8)
    model = core.model(scene, geometry, state.u_drv0)
    found = core.evaluate(model, state, 0.0)
    other = twin.bond_forces(scene, state.y, geometry)
    full = twin.bond_forces(small(kind), state.y, geometry)
    assert np.abs(other - full).max() > 0.02 * np.abs(full).max()
    inner = slice(1, -1)  # rows without friction, load or rod
    np.testing.assert_allclose(
        scene.m * found.a[inner, :, 2:],
        other[inner, :, 2:],
        rtol=0,
        atol=1e-12 * np.abs(other).max(),
    )
    v = state.y[:, 2:]
    elastic = twin.bond_forces(along(small(kind), eta=0.0), state.y, geometry)
    lost = -np.sum((other - elastic) * v)
    assert sum(found.dissipated) == pytest.approx(lost, rel=1e-11)


def test_powers_over_mirrored_walls_are_those_of_the_forces():
    walls = Walls(left="mirrored", right="mirrored", top="mirrored")
    scene = along(slab(p=1.0, L=0.0125, H=0.0075, l=2.5e-3, walls=walls))
    state = shaken(scene, "linear", 1e-7)
    state.mode[:] = 1
    found = core.evaluate(core.model(scene, "linear", 0.0), state, 0.0)
    _, _, C = operators(scene)
    v = state.y[:, 2:].ravel()
    assert sum(found.dissipated) == pytest.approx(v @ (C @ v), rel=1e-12)
    other = twin.bond_forces(scene, state.y, "linear")
    np.testing.assert_allclose(
        scene.m * found.a[1:], other[1:], rtol=0, atol=1e-12 * np.abs(other).max()
    )


@pytest.mark.parametrize("dashpots", ["full", "along"])
def test_a_turning_lattice_is_not_held_back_along_the_bonds(dashpots):
    """In finite geometry, at 0.3 rad and turning, "full" resists and "along" does not."""
    scene = small("free")
    scene = along(scene) if dashpots == "along" else scene
    j, i = np.mgrid[: scene.N_z, : scene.N_x]
    x, z = scene.slider.l * i, scene.slider.l * j
    c, s, omega = np.cos(0.3), np.sin(0.3), 50.0
    y = np.zeros((scene.N_z, 4, scene.N_x))
    y[:, 0], y[:, 1] = (c - 1) * x - s * z, s * x + (c - 1) * z
    y[:, 2], y[:, 3] = -omega * (s * x + c * z), omega * (c * x - s * z)
    state = shaken(scene, "finite", 1e-7)
    state.y[:] = y
    model = core.springs(scene, "finite", viscous=True)
    lost = core.evaluate(model, state, 0.0).dissipated.sum()
    scale = scene.eta * (omega * scene.slider.l) ** 2 * scene.N_x * scene.N_z
    assert (lost > scale) if dashpots == "full" else (abs(lost) < 1e-20 * scale)


def test_the_stability_limit_is_where_steps_grow():
    scene = along(small("free"))
    limit, _ = stability_limit(scene)
    assert limit > stability_limit(small("free"))[0]
    M, K, C = operators(scene)
    n = len(M)
    K, C = (X.toarray() / M[:, None] for X in (K, C))
    values = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    z = values[:, None] * limit * np.array([1.0, 1.1])
    growth = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max(axis=0)
    assert growth[0] <= 1 + 1e-9
    assert growth[1] > 1.01


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_order_is_four_and_energy_closes(geometry):
    scene, ends = along(small()), []
    for n in (32, 64, 256):
        state = shaken(scene, geometry, 3.2e-5 / n)
        state.y[:, 2:] = shaken(scene, geometry, 1e-6, size=1e-8).y[:, 2:]
        advance(scene, geometry, state, n)
        ends.append(state.y[:, :2].copy())
    coarse, fine = (np.abs(end - ends[2]).max() for end in ends[:2])
    assert np.log2(coarse / fine) == pytest.approx(4, abs=0.4)


def test_a_run_keeps_its_energy():
    record = pyfric.simulate(
        along(small("free")), 1.5e-3, fidelity="dynamic", switching="located", dt=2e-7
    )
    assert record.switches["block"].size > 5
    assert budget_error(record) < 1e-6 * record.curve["work_driver"].iloc[-1]
