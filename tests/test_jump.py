"""Jumps: their inputs, their errors, and their cost."""

import functools
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import GEOMETRIES

import pyfric
from pyfric.engines import space
from pyfric.engines.jump import Jump, Landing, Wait
from pyfric.engines.modes import modes_of
from pyfric.engines.path import Outside, path_from, rest
from pyfric.engines.ringing import Ringing
from pyfric.scene import preset, setup1, setup2
from pyfric.statics import StaticSolver, stability_limit

SCENE = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3)
DT = 0.3 * stability_limit(SCENE)[0]


def linearised(geometry):
    """Return the modes of the loaded slider, its static state, and velocities after a blow."""
    solver = StaticSolver(SCENE, geometry)
    modes = modes_of(space.Space(solver, ~solver.loaded.open), DT)
    q = solver.coordinates(solver.loaded.u, solver.loaded.rod)
    *start, _ = rest(modes, q, 0.0, None, 1e-9 * SCENE.F_N)
    v = np.zeros(len(q))
    v[modes.space.free] = np.random.default_rng(1).standard_normal(len(modes.space.free))
    return modes, start, v


def begun(modes, start, v, least=1, **more):
    """Return a jump that begins with velocities v (m/s)."""
    outside, n_x = Outside(modes.space.solver, 0.0), SCENE.N_x
    path = path_from(modes, outside, *start)
    motion = modes.split(path.lag[0] * 0.0, v)
    how = {"dt": DT, "accuracy": 1e-6 * SCENE.F_N, "least": least, "wait": 1} | more
    return Jump(modes, outside, path, motion, np.zeros(n_x), **how)


def landed(modes, start, v, steps):
    """Return all numbers of a jump that begins with velocities v (m/s): its end and its curve."""
    jump = begun(modes, start, v)
    landing = jump.land(steps)
    assert isinstance(landing, Landing)
    curve = jump.u_h(DT * np.arange(1, landing.n, 16))
    return landing.n, landing.error, *landing.q, *landing.v, *landing.gaps, *curve


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_jump_does_not_depend_on_those_before(geometry):
    """A shorter jump before, with more modes, does not change the bits."""
    modes, start, v = linearised(geometry)
    first = landed(modes, start, 1e-6 * v, 20_000)
    other = landed(modes, start, 1e-6 * v, 4_000)
    assert other[0] < first[0]
    assert landed(modes, start, 1e-6 * v, 20_000) == first
    fresh = linearised(geometry)[0]
    assert landed(fresh, start, 1e-6 * v, 20_000) == first


def test_corrections_that_diverge_are_given_up(monkeypatch):
    """If errors grow with each correction, the second one ends the attempt."""
    modes, start, v = linearised("finite")
    jump, found, calls = begun(modes, start, 1e-6 * v, least=4_000), Jump._landed, []
    path = jump.path

    def worse(one, *how):
        q, u, gaps, shift, _ = found(one, *how)
        calls.append(4.0 ** len(calls) * 1e-3 * SCENE.F_N)
        return q, u, gaps + calls[-1], shift, 1.0

    monkeypatch.setattr(Jump, "_landed", worse)
    assert isinstance(jump.land(4_001), Wait)
    assert jump.predicted == len(calls) == 2
    assert jump.path is path


def test_the_truncated_part_ends_no_jump_once_it_has_faded():
    """A faint truncated part does not shorten a jump; a strong one does."""
    solver = StaticSolver(setup1(L=0.02, H=0.0125, F_N=400.0, V=0.02), "linear")
    modes = modes_of(space.Space(solver, ~solver.loaded.open, modes=3), DT)
    _, start, v = linearised("linear")
    path = path_from(modes, outside := Outside(solver, 0.0), *start)
    v -= modes.space.B @ (modes.space.B.T @ (modes.space.M * v))
    how = {"dt": DT, "accuracy": 1e-6 * SCENE.F_N, "least": 1, "wait": 1}
    quiet, faint, loud = (
        Jump(modes, outside, path, modes.split(0.0 * v, size * v), np.zeros(SCENE.N_x), **how)
        for size in (0.0, 1e-3, 1e-2)
    )
    ends = [jump._longest(100_000) for jump in (quiet, faint, loud)]
    assert ends[0] == ends[1] > ends[2]
    assert faint._lost(ends[1] * DT) < faint.accuracy < faint._lost(0.0)
    assert loud._lost(ends[2] * DT) > loud.accuracy


def test_errors_count_when_the_next_event_begins():
    """Errors may ring down until the next event, except at the end of a piece of a protocol."""
    modes, start, v = linearised("finite")
    v = modes.space.B @ (modes.space.B.T @ (modes.space.M * v))

    def end(n_far, **more):
        how = {"accuracy": 1e-9 * SCENE.F_N, "loose": 2.5e-7 * SCENE.F_N} | more
        return begun(modes, start, 3e-4 * v, **how).land(1000, n_far)

    landing = end(10**6)
    assert (type(landing), landing.n) == (Landing, 1000)
    assert landing.jump._due(1000, 10**6) > 20 * 1000 * DT
    assert not isinstance(end(1000), Landing)
    assert not isinstance(end(1001), Landing)
    assert not isinstance(end(10**6, loose=None), Landing)  # the end has the accuracy of a landing


def test_landings_are_predicted_again_in_finite_geometry_only(monkeypatch):
    scene, jumps, land = setup2(L=0.03, H=0.01, V=0.02), [], Jump.land
    monkeypatch.setattr(Jump, "land", lambda one, *n: (jumps.append(one), land(one, *n))[1])
    for geometry in GEOMETRIES:
        jumps.clear()
        how = {"geometry": geometry, "accuracy": 1e-6, "progress": False}
        made = pyfric.simulate(scene, 0.01, fidelity="hybrid", **how)
        counts = made.counts
        assert counts["landings"] >= len(jumps) >= counts["attempts"] > 0
        assert (counts["landings"] == len(jumps)) == (geometry == "linear")


def test_errors_of_rates_fall_as_a_wait_assumes():
    """A jump that begins a little later shows the decay."""
    rng, s, later = np.random.default_rng(0), 1e-3, 1e-8
    off, gaps = rng.random(5), rng.normal(size=(4, 5)) + 1j * rng.normal(size=(4, 5))
    a, growth = rng.normal(size=5) + 0j, -rng.uniform(1e2, 1e4, 5) + 1e4j
    which = np.arange(5)

    def late(a):
        ringing = SimpleNamespace(gaps=gaps * a, off=off, growth=growth)
        ringing.late = functools.partial(Ringing.late, ringing)
        jump = SimpleNamespace(ringing=ringing, share=1.0)
        jump._counted = functools.partial(Jump._counted, jump)
        return Jump._late(jump, s, s, which)

    (before, decay), (after, _) = late(a), late(a * np.exp(growth * later))
    assert decay == pytest.approx(np.log(before / after) / later, rel=1e-3)
    assert -growth.real.max() < decay < -growth.real.min()


VISCOUS = {"eta": 8.815, "k_f": 1.8315e6, "K": 1.7049e6, "mu_k": 0.4595, "theta": -0.4343}
HEAVY = {"L": 0.015, "H": 0.008, "M": 0.012 * 144 / 2121, "F_N": 320.0, "V": 0.01}
LATE_ERRORS = {
    "rates of viscous modes": (
        setup2(L=0.017, H=0.004, M=5.092e-4, F_N=121.27, h=3e-3, V=0.063567, **VISCOUS),
        1.4386e-3,
        "linear",
    ),
    "a fast mode that excites a slow one": (setup2(k_f=4.6875e5, **HEAVY), 0.023, "finite"),
}
"""Scenes with larger errors after than at the end of a jump: scene, t_end, geometry."""


@pytest.mark.parametrize("name", LATE_ERRORS)
def test_what_modes_leave_during_a_jump_is_estimated(name):
    scene, t_end, geometry = LATE_ERRORS[name]
    how = {"geometry": geometry, "accuracy": 1e-6, "energies": False, "progress": False}
    a, b = (pyfric.simulate(scene, t_end, fidelity=one, **how) for one in ("hybrid", "dynamic"))
    assert a.counts["jumps"] > 0
    assert len(a.events) == len(b.events) > 1
    for column in ("F_T_start", "F_T_arrest"):
        apart = np.abs(a.events[column] - b.events[column]).max() / scene.F_N
        assert apart < 1e-6


@pytest.mark.parametrize("wrong", [False, True])
def test_a_slow_driver_is_no_slower(wrong, monkeypatch):
    """There are 5e8 steps between events; with a deliberately bad prediction jumps are halved."""
    if wrong:
        start = space.Space.drift.func
        monkeypatch.setattr(space.Space.drift, "func", lambda of: 300.0 * start(of))
    scene = preset("fig1", l=5e-3, V=1e-7)
    how = {"fidelity": "hybrid", "geometry": "finite", "accuracy": 1e-3, "progress": False}
    made = pyfric.simulate(scene, 1e4, **how)
    assert len(made.events) > 10
    assert made.counts["steps_spared"] > 1e5 * made.counts["steps"]
    assert made.counts["landings"] < 10 * len(made.events)
