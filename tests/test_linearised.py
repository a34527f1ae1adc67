"""The linearised slider: effects of viscosity and inertia, and waves about the static path."""

import numpy as np
import pytest
from rate_state import rated
from scipy.linalg import eig

import pyfric
from pyfric.core import evaluate, model
from pyfric.engines.linearised import Linearised, Waves
from pyfric.engines.path import Outside
from pyfric.engines.slow_slip import values_of
from pyfric.scene import chain, setup1
from pyfric.statics import StaticSolver, damping, stiffness
from pyfric.statics.operators import mass

SIZE = {"L": 0.03, "H": 0.015, "h": 0.005, "l": 0.0025, "F_N": 200.0}


@pytest.mark.parametrize("rows", [0.015, 0.0])
def test_viscosity_is_that_of_slow_oscillations(rows):
    """Viscosity agrees with the stiffness K + i w C, condensed at a small frequency w."""
    scene = setup1({**SIZE, "H": rows}) if rows else chain(L=0.02)
    scene = scene.replace({"interface": rated()})
    closed, N_x = np.arange(scene.N_x) != (3 if rows else -1), scene.N_x
    load, p = Linearised(StaticSolver(scene, "linear"), closed).by_v
    w = 1e-9
    whole = stiffness(scene, closed=closed).toarray() + 1j * w * damping(scene).toarray()
    at, forces, moved = condensed_dense(whole, closed)
    np.testing.assert_allclose(
        -load[np.ix_(at, at)], forces.imag / w, rtol=0, atol=1e-12 * size(forces.imag / w)
    )
    pressed = -np.outer(scene.k_f * closed, np.ones(len(at))) * moved[N_x : 2 * N_x].imag / w
    np.testing.assert_allclose(p[:, at], pressed, rtol=0, atol=1e-12 * size(forces.imag / w))
    assert not rows or np.abs(p).max() > 0.01 * size(forces.imag / w)
    assert not load[~closed].any()
    assert not load[:, ~closed].any()


def condensed_dense(whole, closed):
    """Return blocks in contact, forces on them for 1 m of each, and displacements of all blocks."""
    at = np.flatnonzero(closed)
    inside = np.setdiff1d(np.arange(len(whole)), at)
    moved = np.zeros((len(whole), len(at)), whole.dtype)
    moved[at, range(len(at))] = 1.0
    moved[inside] = -np.linalg.solve(whole[np.ix_(inside, inside)], whole[np.ix_(inside, at)])
    return at, (whole @ moved)[at], moved


def size(values):
    """Return the largest magnitude of the values."""
    return np.abs(values).max()


@pytest.mark.parametrize("rows", [0.015, 0.0])
def test_inertia_is_that_of_slow_oscillations(rows):
    """Inertia agrees with the stiffness K - w^2 M, condensed at a small frequency w."""
    scene = setup1({**SIZE, "H": rows}) if rows else chain(L=0.02)
    scene = scene.replace({"interface": rated()})
    closed = np.arange(scene.N_x) != (3 if rows else -1)
    load, _ = Linearised(StaticSolver(scene, "linear"), closed).by_a
    K, square = stiffness(scene, closed=closed).toarray(), 1e4
    at, forces, _ = condensed_dense(K - square * np.diag(mass(scene)), closed)
    slow = (condensed_dense(K, closed)[1] - forces) / square
    np.testing.assert_allclose(-load[np.ix_(at, at)], slow, rtol=0, atol=1e-4 * size(slow))
    assert load.sum() == pytest.approx(-mass_of(scene), rel=0.2)


def mass_of(scene):
    """Return the mass that moves if the interface moves, in kg."""
    return scene.slider.M + scene.M_rod


def test_viscosity_under_the_driver_is_that_of_full_dynamics():
    """If all blocks stick and waves have decayed, friction is static plus a viscous term."""
    scene = setup1({**SIZE, "mu_s": 9.0, "V": 2e-4})
    state = pyfric.simulate(
        scene, 0.03, fidelity="dynamic", geometry="linear", progress=False
    ).final_state
    known = StaticSolver(scene, "linear")
    closed, outside = state.mode == 0, Outside(known, state.t)
    at = known.solve(state.y[0, 0], outside.drive)
    about = Linearised(known, closed)
    load = about.interface(values_of(at), outside).load[0][:, 0]
    found = evaluate(model(scene, "linear", state.u_drv0), state, state.t).f
    drag = load + at.f
    assert closed.all()
    np.testing.assert_allclose(-found - -at.f, drag, rtol=0, atol=1e-3 * size(drag))


def free(damping_share=1.0, V=1e-3):
    """Return a linearised slider, its driver and its law."""
    scene = setup1({**SIZE, "V": V}).replace({"interface": rated()})
    scene = scene.replace({"slider.eta": damping_share * scene.eta})
    known = StaticSolver(scene, "linear")
    about = Linearised(known, np.full(scene.N_x, True))
    return about, Outside(known, 0.01), scene.law


def waves_of(about, outside, law, q, w):
    """Return the waves q (m), w (m/s) of inner coordinates about the static path."""
    known, N_x = about.known, len(about.closed)
    v_x = np.linspace(1e-6, 2e-6, N_x)
    static = known.solve(known.loaded.u[0, 0], outside.drive)
    path = about.moving(v_x, outside.rates()[0])
    at = known.coordinates(static.u, static.rod) + about.answer(about.resistance(path))
    at[about.inside] += q
    path[about.inside] += w
    return about.waves(at, path, outside, np.full(N_x, 15.0), law)


def test_the_impulse_of_waves_is_the_integral_of_their_load():
    """The impulse agrees with the first-order system of positions and velocities."""
    about, outside, law = free()
    rng, n, N_x = np.random.default_rng(1), len(about.inside), len(about.closed)
    q, w = 1e-9 * rng.standard_normal(n), 1e-4 * rng.standard_normal(n)
    found = waves_of(about, outside, law, q, w)
    K, C = about.K.toarray(), about.C.toarray()
    inner = np.ix_(about.inside, about.inside)
    M = about.M[about.inside]
    system = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-K[inner] / M[:, None], -C[inner] / M[:, None]],
        ]
    )
    ends = -np.linalg.solve(system, np.concatenate([q, w]))
    load = -K[:N_x, about.inside] @ ends[:n] - C[:N_x, about.inside] @ ends[n:]
    np.testing.assert_allclose(found.impulse, load, rtol=0, atol=1e-9 * size(load))
    assert size(load) > 0


@pytest.mark.parametrize("phase", [0.0, 0.7, 2.0])
def test_waves_of_one_mode_have_its_frequency_and_decay(phase):
    """Waves agree at every phase; the amplitude of a block is its largest load over a period."""
    about, outside, law = free(damping_share=0.02)
    n, N_x = len(about.inside), len(about.closed)
    K, C = about.K.toarray(), about.C.toarray()
    inner, M = np.ix_(about.inside, about.inside), np.diag(about.M[about.inside])
    zero, one = np.zeros((n, n)), np.eye(n)
    values, shapes = eig(
        np.block([[zero, one], [-K[inner], -C[inner]]]), np.block([[one, zero], [zero, M]])
    )
    slowest = np.argmin(np.where(values.imag > 1, values.imag, np.inf))
    value, shape = values[slowest], 1e-9 * shapes[:, slowest] / size(shapes[:n, slowest])
    now = (shape * np.exp(1j * phase)).real
    found = waves_of(about, outside, law, now[:n], now[n:])
    assert found.frequency == pytest.approx(abs(value), rel=0.01)
    assert found.decay == pytest.approx(-2 * value.real, rel=0.05)
    load = K[:N_x, about.inside] @ shape[:n] + C[:N_x, about.inside] @ shape[n:]
    np.testing.assert_allclose(found.amplitude, np.abs(load), rtol=0, atol=0.02 * size(load))


def test_no_waves_are_none():
    about, outside, law = free()
    n = len(about.inside)
    found = waves_of(about, outside, law, np.zeros(n), np.zeros(n))
    there = waves_of(about, outside, law, np.zeros(n), np.full(n, 1e-4))
    assert found.amplitude.sum() < 1e-6 * there.amplitude.sum()
    assert found.effect(np.full(len(about.closed), 1e-3)) < 1e-6 * there.amplitude.sum()
    static = about.known.solve(about.known.loaded.u[0, 0], outside.drive)
    np.testing.assert_allclose(there.rest.f, static.f, rtol=0, atol=1e-9 * size(static.f))
    np.testing.assert_allclose(there.rest.p, 15.0, rtol=1e-3)


@pytest.mark.parametrize("over", [0.05, 0.5, 2.0, 5.0])
@pytest.mark.parametrize("phase", [0.0, 1.2])
def test_the_effect_of_waves_bounds_the_slip_they_make(over, phase):
    """The slip of a block under a load A exp(-g t) cos(w t + phase) is v exp(load/(a p)) dt."""
    w, g, v, direct, stiff = 1e4, 200.0, 1e-6, 0.3, 1e7
    A = over * direct
    t = np.linspace(0, 40 / g, 2_000_001)
    load = A * np.exp(-g * t) * np.cos(w * t + phase)
    more = v * np.trapezoid(np.expm1(load / direct), t)
    impulse = np.trapezoid(load, t)
    waves = Waves(
        None,
        *(np.array([one]) for one in (A, impulse, direct, stiff)),
        pull=0.0,
        frequency=w,
        decay=2 * g,
    )
    by_impulse = waves.slip(np.array([v]))[0]
    assert by_impulse == pytest.approx(v * impulse / direct)
    left = stiff * abs(more - by_impulse)
    bound = waves.effect(np.array([v]))
    assert left <= 1.1 * bound
    assert bound <= max(3 * left, 1e-3 * stiff * abs(by_impulse))


def test_the_effect_has_a_bound_without_decay():
    """For any amplitude, slip is at most that which balances the mean friction."""
    for A in (0.0, 1e-6, 0.3, 3e3):
        parts = (np.array([one]) for one in (A, 0.0, 0.3, 1e7))
        effect = Waves(None, *parts, pull=0.0, frequency=1e4, decay=0.0).effect(np.array([1e-3]))
        assert 0 <= effect <= A
        assert (effect > 0) == (A > 0)
