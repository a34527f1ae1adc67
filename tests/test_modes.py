"""Modes of the slider at fixed contact states, compared with dense matrices and each other."""

import functools

import numpy as np
import pytest
from scipy import linalg

from pyfric.engines.modes import modes_of
from pyfric.engines.rests import RestStates
from pyfric.engines.space import Space
from pyfric.scene import setup1, setup2
from pyfric.statics import EquilibriumError, StaticSolver

SCENES = {
    "rod": (setup1(L=0.04, H=0.02), "linear"),
    "free": (setup2(L=0.012, H=0.004), "linear"),
    "finite": (setup1(L=0.04, H=0.02), "finite"),
}


@functools.cache
def systems(name):
    """Return spaces of the closed slider, and two with eight released blocks: extended, and new."""
    solver = StaticSolver(*SCENES[name])
    stuck = np.ones(solver.scene.N_x, dtype=bool)
    closed = Space(solver, stuck.copy(), modes=24)
    stuck[[0, 1, 2, 3, 4, 5, 9, -1]] = False
    return closed, Space(solver, stuck, closed), Space(solver, stuck, modes=24)


def slowest_outside(system):
    """Return the smallest frequency of motion that is orthogonal to the space, in 1/s."""
    free, root = system.free, np.sqrt(system.M[system.free])
    A = system.K[free][:, free].toarray() / np.outer(root, root)
    outside = linalg.null_space((system.B[free] * root[:, None]).T)
    return np.sqrt(linalg.eigvalsh(outside.T @ A @ outside)[0])


@pytest.mark.parametrize("name", SCENES)
def test_statics_of_released_blocks(name):
    _, extended, own = systems(name)
    force = np.random.default_rng(1).standard_normal((own.n_q, 3))
    for b in (force, force[:, 0]):
        expected = own.answer(b)
        limit = 1e-11 * np.abs(expected).max()
        np.testing.assert_allclose(extended.answer(b), expected, rtol=0, atol=limit)


@pytest.mark.parametrize("name", SCENES)
def test_slow_modes_of_released_blocks(name):
    _, extended, own = systems(name)
    found, expected = (
        np.sort(np.abs(one.rates[one.rates.imag > 0]))[:6]
        for one in (modes_of(extended), modes_of(own))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("name", SCENES)
def test_motion_outside_the_space_is_no_slower_than_the_cut(name):
    """The extended space is included, with the cut of the closed slider."""
    closed, extended, own = systems(name)
    assert extended.cut == closed.cut
    for one in (closed, extended, own):
        assert slowest_outside(one) > (1 - 1e-6) * one.cut


@pytest.mark.parametrize("name", SCENES)
def test_the_closed_space_alone_misses_slower_motion(name):
    closed, extended, _ = systems(name)
    alone = Space(extended.solver, extended.stuck, closed)
    alone.B = closed.B
    assert slowest_outside(alone) < 0.95 * closed.cut


@pytest.mark.parametrize(
    ("stepper", "last"),
    [("rk4", ()), ("rk46", (1 / 120, 1 / 720)), ("rk46_waves", (0.007856772044, 0.000959998595))],
)
def test_amplitudes_grow_as_in_steps(stepper, last):
    """Growth is R(z) of each stepper, by its polynomial, at the exact rates."""
    solver = StaticSolver(*SCENES["free"])
    stuck, dt = np.ones(solver.scene.N_x, dtype=bool), 2e-7
    system = modes_of(Space(solver, stuck, modes=12), dt, stepper)
    z = system.rates * dt
    factors = (1, 1, 1 / 2, 1 / 6, 1 / 24, *last)
    growth = sum(factor * z**power for power, factor in enumerate(factors))
    np.testing.assert_allclose(np.exp(system.growth * dt), growth, rtol=1e-10)
    ringing = (np.abs(z) > 0.05) & (np.abs(z) < 0.4)
    assert ringing.sum() >= 3
    power = 7 if stepper == "rk46" else 5
    lacks = {"rk4": 1 / 120, "rk46": 1 / 5040, "rk46_waves": 1 / 120 - last[0] if last else 0}
    error = (system.growth - system.rates)[ringing] * dt
    np.testing.assert_allclose(error, -lacks[stepper] * z[ringing] ** power, rtol=0.25)


def exact_modes(system):
    """Return rates (1/s) and shapes of all damped modes of free coordinates, by dense matrices."""
    free, n = system.free, len(system.free)
    K, C = (matrix[free][:, free].toarray() for matrix in (system.K, system.C))
    M = system.M[free]
    bottom = -np.hstack([K, C]) / M[:, None]
    rates, x = np.linalg.eig(np.vstack([np.eye(n, 2 * n, n), bottom]))
    return rates, x[:n]


def apart(shape, true, M):
    """Return the part of a shape that is orthogonal in M to another shape, over its length."""
    rest = shape - np.vdot(true * M, shape) / np.vdot(true * M, true) * true
    return np.sqrt(np.vdot(rest * M, rest).real / np.vdot(shape * M, shape).real)


@pytest.mark.parametrize("name", ["rod", "free"])
def test_corrected_shapes_are_the_exact_ones_as_far_as_modes_are_slow(name):
    """The ratio of errors after and before a correction is 1.9 |lambda|/cut."""
    system, _, _ = systems(name)
    rates, exact = exact_modes(system)
    found, free = modes_of(system), system.free
    slow = np.flatnonzero((found.rates.imag > 0) & (np.abs(found.rates) < 0.4 * system.cut))
    assert len(slow) >= 4
    for k, (shift, rate, _) in zip(slow.tolist(), found.corrected(slow), strict=True):
        true = exact[:, np.argmin(np.abs(rates - rate))]
        shape = system.B @ found.x[:, k]
        shapes = shape[free], (shape + shift)[free]
        before, after = (apart(one, true, system.M[free]) for one in shapes)
        assert after < 2 * abs(rate) / system.cut * before


@pytest.mark.parametrize("name", ["rod", "free"])
def test_corrected_rates_are_as_close_to_the_exact_ones_as_they_say(name):
    """Errors are 0.3 to 0.8 of their estimates."""
    system, _, _ = systems(name)
    modes, (exact, _) = modes_of(system), exact_modes(system)
    slow = np.flatnonzero((modes.rates.imag > 0) & (np.abs(modes.rates) < 0.4 * system.cut))

    def error(rates):
        return np.abs(rates[:, None] - exact).min(axis=1)

    _, rates, off = (np.array(part) for part in zip(*modes.corrected(slow), strict=True))
    rounding = 1e-10 * np.abs(rates)  # of the dense eigenvalues
    assert (error(rates) < off + rounding).all()
    assert (off < error(modes.rates[slow]) / 3).all()


def test_modes_are_frozen():
    modes = modes_of(systems("rod")[0], 2e-7)
    before = {name: np.copy(value) for name, value in vars(modes).items() if name[0] != "_"}
    modes.corrected(np.arange(1))
    for name, value in before.items():
        if isinstance(getattr(modes, name), np.ndarray):
            np.testing.assert_array_equal(getattr(modes, name), value)
            with pytest.raises(ValueError, match="read-only"):
                getattr(modes, name)[...] = 0
    with pytest.raises(AttributeError):
        modes.rates = modes.growth


def test_a_slider_that_one_block_holds_is_unstable_under_its_load():
    """The slider turns over about that block, unless bonds cannot rotate."""
    scene = setup2(L=0.012, H=0.006, F_N=84.9882, theta=0.550417, k_f=4.87537e7, K=78409.2)
    stuck = np.arange(scene.N_x) == scene.N_x - 1
    assert Space(StaticSolver(scene, "linear"), stuck).cut > 0
    with pytest.raises(EquilibriumError, match="unstable"):
        Space(StaticSolver(scene, "finite"), stuck)
    made = {"modal_bases": 0}
    rests = RestStates(StaticSolver(scene, "finite"), 1e-7, "rk4", made)
    for _ in range(2):
        assert rests.at(np.zeros(scene.N_x), stuck, 0.0, None, 1e-6) is None
    assert made["modal_bases"] == 1  # the basis is not computed again
