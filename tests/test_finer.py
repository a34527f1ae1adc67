"""A fine lattice starts from the tractions of a coarser one, just before an event."""

import numpy as np
import pytest
from finer import refined, tractions
from helpers import refused

import pyfric
from pyfric.core import OPEN
from pyfric.record import analysis
from pyfric.scene import setup1
from pyfric.statics import StaticSolver

HOW = {"fidelity": "hybrid", "geometry": "linear", "switching": "located", "progress": False}


def scene(l=2.5e-3, **changes):
    """Return a scene with a high driver, which lifts the edge, so slow that waves die away."""
    given = {"L": 0.07, "H": 0.0375, "h": 0.01, "V": 2e-3, "F_N": 1750.0, "d_c": 1e-6, "l": l}
    return setup1(**given | changes)


@pytest.fixture(scope="module", params=["left", "right"])
def coarse(request):
    return pyfric.simulate(scene(side=request.param), 0.14, **HOW)


def event_of(record):
    """Return the largest event with an open edge."""
    lifted = (record.p_before == 0).any(axis=1) & record.events["finished"]
    return 1 + int(np.where(lifted, record.events["n_front"], -1).argmax())


def equilibrium(record, event, on):
    state, solver = refined(record, event, on), StaticSolver(on)
    free = state.mode == OPEN
    return state, solver.solve(state.y[0, 0], on.drive(state.t), free=free)


def test_the_same_lattice_gives_the_state_and_the_event_back(coarse):
    event, on = event_of(coarse), coarse.scene
    assert event >= 1
    state, rest = equilibrium(coarse, event, on)
    unit = on.F_N / on.N_x
    np.testing.assert_array_equal(rest.p == 0, coarse.p_before[event - 1] == 0)
    np.testing.assert_allclose(rest.p, coarse.p_before[event - 1], rtol=0, atol=1e-6 * unit)
    np.testing.assert_allclose(rest.tau, coarse.tau_before[event - 1], rtol=0, atol=1e-6 * unit)
    assert state.margin.min() >= 0
    t_end = coarse.events["t_stop"].loc[event] + 1e-3
    again = pyfric.simulate(on, t_end, initial=state, dt=state.dt, **HOW)
    for name in ("first_block", "last_block", "n_front", "L_p_over_L"):
        assert again.events[name].iloc[0] == coarse.events[name].loc[event], name
    one, two = analysis.front(coarse, event), analysis.front(again, 1)
    np.testing.assert_allclose(two["v_c"], one["v_c"], rtol=0.005)
    start = coarse.events["t_start"].loc[event]
    assert again.events["t_start"].iloc[0] == pytest.approx(start, abs=3e-6)


def test_half_the_lattice_constant_has_the_same_tractions(coarse):
    event, on = event_of(coarse), scene(1.25e-3, side=coarse.scene.driver.side)
    _, rest = equilibrium(coarse, event, on)
    assert rest.F_T == pytest.approx(coarse.events["F_T_start"].loc[event], rel=0.01)
    assert rest.p.sum() == pytest.approx(on.F_N)
    both = (rest.p[::2] > 0) & (coarse.p_before[event - 1] > 0)
    assert both.sum() == 28
    ratio = coarse.tau_before[event - 1][both] / coarse.p_before[event - 1][both]
    np.testing.assert_allclose(rest.tau[::2][both] / rest.p[::2][both], ratio, atol=1e-8)
    between = tractions(coarse, event, on.x[1::2])[0]
    known, open_ = tractions(coarse, event, on.x[::2])
    np.testing.assert_allclose(between, (known[:-1] + known[1:]) / 2)
    np.testing.assert_array_equal(open_, coarse.p_before[event - 1] == 0)


def test_another_slider_is_refused(coarse):
    refused(lambda: refined(coarse, 1, scene(L=0.08)), "slider.L", value=0.08, within=(0.07,))
