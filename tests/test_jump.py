"""Single jumps: what they depend on."""

import numpy as np
import pytest
from helpers import GEOMETRIES

from pyfric.engines.jump import Jump, Landing, Outside, path_from, rest
from pyfric.engines.modes import modes_of
from pyfric.engines.space import Space
from pyfric.scene import setup1
from pyfric.statics import StaticSolver, stability_limit

SCENE = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3)
DT = 0.3 * stability_limit(SCENE)[0]


def linearised(geometry):
    """Return the modes of the loaded slider, its static state, and its velocities under a blow."""
    solver = StaticSolver(SCENE, geometry)
    modes = modes_of(Space(solver, ~solver.loaded.open), DT)
    q = solver.coordinates(solver.loaded.u, solver.loaded.rod)
    *start, _ = rest(modes, q, 0.0, None, 1e-9 * SCENE.F_N)
    v = np.zeros(len(q))
    v[modes.space.free] = np.random.default_rng(1).standard_normal(len(modes.space.free))
    return modes, start, v


def landed(modes, start, v, steps):
    """Return all numbers of a jump that begins with velocities v (m/s): its end and its curve."""
    outside, n_x = Outside(modes.space.solver, 0.0), SCENE.N_x
    path = path_from(modes, outside, *start)
    motion = modes.split(path.lag[0] * 0.0, v)
    how = {"dt": DT, "accuracy": 1e-6 * SCENE.F_N, "least": 1}
    jump = Jump(modes, outside, path, motion, np.zeros(n_x), **how)
    landing = jump.land(steps)
    assert isinstance(landing, Landing)
    curve = jump.u_h(DT * np.arange(1, landing.n, 16))
    return landing.n, landing.error, *landing.q, *landing.v, *landing.gaps, *curve


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_jump_does_not_depend_on_those_before(geometry):
    """The other jump is shorter, so that more modes count at its end; the bits are the same."""
    modes, start, v = linearised(geometry)
    first = landed(modes, start, 1e-6 * v, 20_000)
    other = landed(modes, start, 1e-6 * v, 4_000)
    assert other[0] < first[0]
    assert landed(modes, start, 1e-6 * v, 20_000) == first
    fresh = linearised(geometry)[0]
    assert landed(fresh, start, 1e-6 * v, 20_000) == first
