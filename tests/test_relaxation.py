"""The relaxation time of the stuck slider, compared with its full spectrum."""

import math
import time

import numpy as np
import pytest
from scipy import linalg

import pyfric
from pyfric.core import STUCK
from pyfric.engines import pauses
from pyfric.engines.pauses import loading_while_relaxing, relaxation_time
from pyfric.scene import chain, preset, setup1, setup2, slab
from pyfric.statics import StaticSolver, damping, mass


def small(**changes):
    return setup1(**{"L": 0.03, "H": 0.015} | changes)


def spectrum(scene):
    """Return all eigenvalues of the stuck slider from dense matrices."""
    solver, mode = StaticSolver(scene, "linear"), np.full(scene.N_x, STUCK)
    K, free = solver.tangents(mode), solver.unknown(mode)
    K, C = K[free][:, free].toarray(), damping(scene)[free][:, free].toarray()
    M, n = mass(scene)[free], len(free)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / M[:, None], -C / M[:, None]]])
    return linalg.eigvals(A)


@pytest.mark.parametrize(
    "scene",
    [small(), small(eta=1e-3), setup2(L=0.012, H=0.004), small(k_f=13.5e6 / 20), small(k_f=4e8)],
    ids=["rod", "little viscosity", "free", "soft foundation", "stiff foundation"],
)
def test_the_relaxation_time_is_that_of_the_full_spectrum(scene):
    slowest = np.min(-spectrum(scene).real)
    assert 1 / relaxation_time(scene) == pytest.approx(slowest, rel=1e-3)


def test_relaxation_without_viscosity_or_motion():
    assert relaxation_time(small(eta=0.0)) == math.inf
    assert relaxation_time(chain()) == relaxation_time(chain(eta=0.0)) == 0.0
    held = slab(p=[100.0] * 9, tau=[0.0] * 9, L=0.02, H=0.01, l=2.5e-3)
    assert relaxation_time(held) == math.inf


@pytest.mark.parametrize("eta", [1e-6, 1e-3])
def test_hardly_damped_modes_are_found_quickly(eta):
    start = time.process_time()
    slow = relaxation_time(preset("fig1", eta=eta))
    assert time.process_time() - start < 10
    assert slow * eta == pytest.approx(relaxation_time(preset("fig1", eta=0.1)) * 0.1, rel=0.01)


def test_a_fast_driver_is_noted():
    slow, fast = small(V=1e-4), small(V=0.05)
    ratio = loading_while_relaxing(fast) / loading_while_relaxing(slow)
    assert ratio == pytest.approx(500)
    for scene, noted in ((slow, False), (fast, True)):
        record = pyfric.simulate(scene, 1e-3, fidelity="quasistatic")
        assert any("does not come to rest" in note for note in record.notes) == noted


def test_friction_has_no_part_in_it(monkeypatch):
    """The time is computed once for scenes that differ only in friction; the foundation counts."""
    scene, found, find = preset("fig1", l=5e-3), [], pauses._relaxation_time
    monkeypatch.setattr(pauses, "_relaxation_time", lambda one: found.append(one) or find(one))
    known = relaxation_time(scene)
    found.clear()
    for change in ({"mu_s": 0.9}, {"mu_k": 0.1}, {"d_c": 1e-6}, {"alpha": 0.1}, {"name": "other"}):
        assert relaxation_time(scene.replace(change)) == known
    assert not found
    assert relaxation_time(scene.replace(k_f=1e6)) != known
