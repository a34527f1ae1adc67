"""The peers of the speed comparison compute the same forces as the twin."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import peer
from peers import available, lammps_bonds, numba_forces, numpy_forces
from twin import Slab, bond_forces

GEOMETRIES = ("linear", "finite")
RTOL = 1e-12
"""Tolerance of a force over the largest one. The peers sum in another order than the twin."""
RTOL_LAMMPS = 1e-10
"""Tolerance for LAMMPS, which subtracts absolute coordinates and lengths: rounding over strain."""


def make_scene(N_x=7, N_z=5, eta=7.6):
    slider = SimpleNamespace(k=13.5e6, l=2.5e-3)
    return Slab(N_x=N_x, N_z=N_z, eta=eta, slider=slider)


def random_state(scene, seed, strain=1e-2, speed=0.1):
    y = np.random.default_rng(seed).uniform(-1, 1, (scene.N_z, 4, scene.N_x))
    y[:, :2] *= strain * scene.slider.l
    y[:, 2:] *= speed
    return y


def error(F, expected):
    """Return the largest difference relative to the largest force."""
    assert F.shape == expected.shape
    return np.max(np.abs(F - expected)) / np.max(np.abs(expected))


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("size", [(7, 5), (3, 2), (2, 6), (5, 1)])
def test_numpy_against_twin(geometry, size):
    scene = make_scene(*size)
    forces = numpy_forces(scene, geometry)
    for seed in range(3):
        y = random_state(scene, seed)
        assert error(forces(y), bond_forces(scene, y, geometry)) < RTOL


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_numpy_separates_springs_and_dashpots(geometry):
    scene, undamped = make_scene(), make_scene(eta=0.0)
    y = random_state(scene, 4)
    at_rest = y * [[1], [1], [0], [0]]
    assert np.array_equal(
        numpy_forces(undamped, geometry)(y), numpy_forces(scene, geometry)(at_rest)
    )


def test_unknown_geometry_is_refused():
    with pytest.raises(ValueError, match="'linear' or 'finite'"):
        numpy_forces(make_scene(), "curved")
    with pytest.raises(ValueError, match="'linear' or 'finite'"):
        numba_forces(make_scene(), "curved")


def test_every_peer_has_a_version_or_a_reason():
    found = available()
    assert list(found) == ["numpy", "numba", "lammps"]
    assert found["numpy"] == np.__version__
    for text in found.values():
        assert text[0].isdigit() or text.startswith("missing: ")


def test_missing_numba_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ImportError, match=r"studies/requirements\.txt"):
        numba_forces(make_scene(), "linear")
    assert available()["numba"].startswith("missing: ")


@pytest.mark.peers
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("size", [(7, 5), (3, 2), (2, 6), (5, 1)])
def test_numba_against_twin(geometry, size):
    peer("numba")
    scene = make_scene(*size)
    forces = numba_forces(scene, geometry)
    for seed in range(3):
        y = random_state(scene, seed)
        assert error(forces(y), bond_forces(scene, y, geometry)) < RTOL


@pytest.mark.peers
@pytest.mark.parametrize("style", ["harmonic", "harmonic/omp"])
@pytest.mark.parametrize("integrate", [False, True])
def test_lammps_against_twin(style, integrate):
    peer("lammps")
    scene = make_scene(9, 6, eta=0.0)
    with lammps_bonds(scene, style=style, integrate=integrate) as lammps:
        start = lammps.displacements()
        for n in (1, 3):
            lammps.run(n)
            u = lammps.displacements()
            expected = bond_forces(scene, np.concatenate([u, 0 * u], axis=1), "finite")
            assert error(lammps.forces(), expected) < RTOL_LAMMPS
        assert np.array_equal(u, start) != integrate


@pytest.mark.peers
@pytest.mark.parametrize("style", ["harmonic", "harmonic/omp"])
def test_lammps_evaluates_in_every_step(style):
    peer("lammps")
    with lammps_bonds(make_scene(), style=style) as lammps:
        expected = lammps.forces()
        step = lammps._lmp.extract_global("ntimestep")
        for n in (1, 2, 10):
            lammps._lmp.numpy.extract_atom("f")[:] = 0.0
            lammps.run(n)
            step += n
            assert np.array_equal(lammps.forces(), expected)
            assert lammps._lmp.extract_global("ntimestep") == step
