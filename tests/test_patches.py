"""Bounds from patches of the lattice against the worst motions of all of it, dense."""

import numpy as np
import pytest

from pyfric.engines import patches, ringdown
from pyfric.engines.ringdown import Frozen
from pyfric.scene import setup1, setup2
from pyfric.statics import StaticSolver

SCENES = {
    "rod": setup1(L=0.06, H=0.03, h=5e-3),
    "free": setup2(L=0.024, H=0.012, theta=0.3),
    "foundation": setup1(L=0.06, H=0.03, h=5e-3, k_f=np.linspace(1e7, 3e7, 25)),
}


@pytest.fixture(params=[("rod", (0, 1)), ("free", ()), ("foundation", (24,))], ids=str)
def slider(request, monkeypatch):
    """Return a slider with some blocks open, whose patches are a few blocks wide."""
    name, opened = request.param
    monkeypatch.setattr("pyfric.engines.fine.FINE", 10)
    monkeypatch.setattr(ringdown, "LARGE", 10)
    for what in ("REACH", "SHORT"):
        monkeypatch.setattr(patches, what, 4)
    scene = SCENES[name]
    solver, stuck = StaticSolver(scene), np.ones(scene.N_x, dtype=bool)
    closed = Frozen(solver, stuck)
    return Frozen(solver, ~np.isin(np.arange(scene.N_x), opened), closed=closed)


def test_no_motion_does_more_than_its_bound(slider):
    """The most that a margin gains from E + (T^2) E_1 together, for several times T."""
    free = slider.free
    K, C = (A[free][:, free].toarray() for A in (slider._rows[:], slider._all_C))
    M = slider.M
    rows, rows_v = (A[:, free].toarray() for A in slider._on_margins)
    drag = (C / M[:, None]).T
    zero = np.zeros_like(K)
    energy = np.block([[K, zero], [zero, np.diag(M)]]) / 2
    inner = (K / M[:, None]).T
    rate = np.block([[inner @ K, inner @ C], [drag @ K, drag @ C + K]]) / 2
    margins = np.hstack([rows, rows_v])
    scene, ratios = slider.solver.scene, []
    for time in np.array([0.0, 0.3, 1.0, 3.0, 10.0]) * np.sqrt(scene.m / scene.slider.k):
        answer = np.linalg.solve(energy + time**2 * rate, margins.T)
        worst = np.sqrt(np.sum(margins.T * answer, axis=0))
        by_rate, by_energy = slider._near
        both = np.inf if time == 0 else np.hypot(by_rate / time, by_energy)
        bound = np.minimum(slider.bound, both)
        assert (worst <= bound * (1 + 1e-6)).all()
        ratios.append(np.median(bound / worst))
    assert ratios[0] < 1.1
    assert max(ratios) < 2.5
