"""Modes of fine lattices: against exact modes and against stepping, and what they take."""

import tracemalloc

import numpy as np
import pytest

from pyfric.engines import simulate
from pyfric.engines.fine import CORRECTED, modes
from pyfric.engines.ringdown import Frozen
from pyfric.scene import preset, setup1, setup2
from pyfric.statics import BandedCholesky, StaticSolver, stability_limit

SCENES = {
    "rod": setup1(L=0.06, H=0.03, h=5e-3, mu_s=50.0),
    "free": setup2(L=0.024, H=0.012, theta=0.3, mu_s=50.0),
}


def frozen_of(scene, monkeypatch, opened=(), dt=None):
    """Return the slider with some blocks open the fine way, and with exact modes."""
    solver, stuck = StaticSolver(scene), np.ones(scene.N_x, dtype=bool)
    exact = Frozen(solver, ~np.isin(np.arange(scene.N_x), opened), dt)
    monkeypatch.setattr("pyfric.engines.fine.FINE", 10)
    fine = Frozen(solver, stuck, dt)
    if len(opened):
        fine = Frozen(solver, exact.stuck, dt, fine)
    return fine, exact


@pytest.mark.parametrize("opened", [(), (0,), (0, 1)], ids=["closed", "one open", "two open"])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_slow_modes_are_exact_and_others_nearly(scene, opened, monkeypatch):
    fine, exact = frozen_of(scene, monkeypatch, opened)
    assert len(fine.rates) > 40
    order = np.argsort(np.abs(exact.rates))
    off = np.array([np.min(np.abs(fine.rates - rate)) for rate in exact.rates[order]])
    off /= np.abs(exact.rates[order])
    assert off[:3].max() < 2e-7
    assert off[:6].max() < 1e-4
    assert off[:CORRECTED].max() < 1e-3
    np.testing.assert_allclose(fine.bound, exact.bound, rtol=1e-9)
    np.testing.assert_allclose(fine.drift, exact.drift, atol=1e-9 * np.abs(exact.drift).max())


@pytest.mark.parametrize("opened", [(), (0,)], ids=["closed", "one open"])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_what_is_left_out_stays_within_its_bound(scene, opened, monkeypatch):
    """Steps of the core without friction, from a smooth motion; errors of modes are part of it."""
    monkeypatch.setattr("pyfric.engines.ringdown.LARGE", 10)
    dt = 0.5 * stability_limit(scene)[0]
    fine, _ = frozen_of(scene, monkeypatch, opened, dt)
    rng = np.random.default_rng(0)
    w, v = (np.zeros(fine.n_q) for _ in range(2))
    for one, size in ((w, 1e-9), (v, 1e-4)):
        one[fine.free] = fine.solve(rng.standard_normal(len(fine.free)))
        one *= size / np.abs(one).max()
    begin = fine.split(w, v)
    whole = 0.5 * (v @ (fine._all_M * v) + w @ (fine.stiffness @ w))
    assert 0 < begin.remainder < 0.2 * whole
    rows, rows_v = fine._on_margins
    steps, last, left = 0, begin.remainder, []
    for n in (30, 100, 300):
        (w, v), steps = stepped(fine, w, v, n, dt), steps + n
        now, s = fine.split(w, v), steps * dt
        assert now.remainder <= last * (1 + 1e-9)
        last = now.remainder
        rest = rows @ w + rows_v @ v
        rest -= (fine.modal @ (fine.weight * begin.a * np.exp(fine.growth * s))).real
        bound = fine.bounds(begin) * np.exp(-fine.decay * s)
        assert (np.abs(rest) <= bound).all()
        stuck = slice(2 * fine.stuck.sum())
        left.append(fine.left(begin, s) / bound[stuck].max())
        assert np.abs(rest[stuck]).max() <= fine.left(begin, s)
    assert left[0] < 0.5


def stepped(frozen, w, v, n, dt):
    """Return a deviation n steps of RK4 later."""
    free = frozen.free
    M, (C, K) = frozen.M, (A[free][:, free] for A in (frozen._all_C, frozen.stiffness))
    y = np.array([w[frozen.free], v[frozen.free]])
    for _ in range(n):
        total, k = 0.0, 0.0
        for share, weight in ((0, 1), (0.5, 2), (0.5, 2), (1, 1)):
            x, u = y + (share * dt) * k
            k = np.array([u, -(C @ u + K @ x) / M])
            total = total + weight * k
        y = y + (dt / 6) * total
    q = np.zeros((2, frozen.n_q))
    q[:, frozen.free] = y
    return q


def test_what_a_fine_lattice_takes(monkeypatch):
    """Solutions, and memory over that of one vector of coordinates: both were far more."""
    scene = preset("fig1", l=1.25e-3)
    solver, stuck = StaticSolver(scene), np.ones(scene.N_x, dtype=bool)
    solve, made = BandedCholesky.solve, []
    monkeypatch.setattr(BandedCholesky, "solve", lambda self, b: made.append(1) or solve(self, b))
    solver.tangent(stuck)
    tracemalloc.start()
    fine = Frozen(solver, stuck, 4e-7)
    kept, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(fine.rates) >= modes(scene) - 1
    assert len(made) < 12
    assert kept < 120 * 8 * fine.n_q
    assert most < 300 * 8 * fine.n_q


def test_ring_downs_of_a_fine_lattice_take_few_steps():
    """Up to its first main event: 1 929; with 12 modes and rest where contacts keep it, 4 020."""
    how = {"fidelity": "hybrid", "geometry": "linear", "budget": False, "threads": 1}
    record = simulate(preset("fig1", l=1.25e-3), 0.25, progress=False, **how)
    assert record.events["is_main"].sum() == 1
    assert record.counts["steps"] < 2500
