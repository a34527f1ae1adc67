"""The hybrid engine follows stable slip: against full dynamics."""

import dataclasses

import numpy as np
import pytest

import pyfric
from pyfric.core import OPEN
from pyfric.engines.cost import work, work_of_step
from pyfric.engines.creeping import Creeping
from pyfric.engines.hybrid import SPENT, RestStates
from pyfric.engines.jump import Wait
from pyfric.scene import setup1, setup2
from pyfric.scene.laws import Ageing
from pyfric.statics import StaticSolver, damping, mass

FORCE = 1e-4
"""Start and arrest forces, over F_N: measured 3e-8 and 5e-6."""


def rod(**changes):
    return setup1(**{"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-3, "d_c": 5e-6} | changes)


def run(scene, t_end, fidelity, **how):
    how = {"geometry": "linear", "progress": False, "threads": 1} | how
    return pyfric.simulate(scene, t_end, fidelity=fidelity, **how)


@pytest.mark.usefixtures("free_attempts")
def test_stable_slip_is_full_dynamics():
    """Stable slip for 4 ms, an event, stable slip once more, of two parts of the interface."""
    scene, t_end = rod(side="right"), 0.048
    a = run(scene, t_end, "dynamic", energies=False)
    b = run(scene, t_end, "hybrid")
    assert len(a.events) == len(b.events) > 1
    for name in ("first_block", "last_block", "nucleation_block", "n_blocks", "L_p_over_L"):
        np.testing.assert_array_equal(b.events[name], a.events[name], err_msg=name)
    for name in ("F_T_start", "F_T_arrest"):
        limit = FORCE * scene.F_N
        np.testing.assert_allclose(b.events[name], a.events[name], rtol=0, atol=limit, err_msg=name)
    for name in ("block", "old", "new"):
        np.testing.assert_array_equal(b.switches[name], a.switches[name])
    np.testing.assert_allclose(b.switches["t"], a.switches["t"], rtol=0, atol=1e-6)
    error = (b.curve["F_T"] - a.curve["F_T"]) / scene.F_N
    assert np.quantile(np.abs(error), 0.98) < 1e-5
    assert b.counts["steps"] < 0.25 * a.counts["steps"]
    assert b.counts["steps"] + b.counts["steps_spared"] == b.final_state.step


def test_stable_slip_takes_hardly_any_steps():
    """At a speed ten times slower: a fiftieth of all, most of them while an attempt is paid off."""
    b = run(rod(V=2e-4), 0.36, "hybrid")
    assert b.final_state.step - b.switches["step"][0] > 20_000
    assert b.counts["steps"] < 0.02 * b.final_state.step


@pytest.mark.parametrize(("speed", "slip"), [(0.01, 3e-4), (0.3, 3e-3)])
def test_attempts_take_a_part_of_the_work_of_full_dynamics(speed, slip):
    """Over stable slip, and where the next event comes before a jump is possible."""
    b = run(rod(V=speed, d_c=5e-6 if speed < 0.1 else 0.0), slip / speed, "hybrid")
    counts = b.counts
    assert counts["attempts"] >= 2
    assert (counts["slides"] > 0) == (speed < 0.1)
    attempts = {name: counts[name] for name in ("landings", "slides", "modal_bases")}
    full = b.final_state.step * work_of_step(b.scene, "linear", "rk4")
    last = max(work(b.scene, "linear", {name: 1}) for name in attempts)
    assert work(b.scene, "linear", attempts) <= SPENT * full + 2 * last
    assert counts["steps"] + counts["steps_spared"] == b.final_state.step


def test_few_jumps_are_tried_where_none_is_possible():
    """An overdamped slider on a fast driver: every jump is refused."""
    scene = setup2(L=0.01, H=0.006, eta=300.0, theta=-0.833, V=0.2, h=1e-3, side="right")
    record = run(scene, 3e-4, "hybrid", geometry="finite")
    assert record.counts["jumps"] == 0
    assert record.counts["attempts"] < 0.01 * record.counts["steps"]


def test_stable_slip_goes_on_from_a_record():
    scene = rod()
    one = run(scene, 0.037, "hybrid")
    half = run(scene, 0.0325, "hybrid")
    assert (np.abs(half.final_state.mode) == 1).any()
    two = run(scene, 0.037, "hybrid", initial=half)
    assert len(one.events) == len(two.events)
    np.testing.assert_array_equal(two.switches["block"], one.switches["block"])
    np.testing.assert_allclose(two.switches["t"], one.switches["t"], rtol=0, atol=1e-6)


def test_a_refused_attempt_waits_until_what_was_too_large_has_decayed():
    """Rows move against each other, which no slow shape does: the larger motion takes longer."""
    scene = rod()
    record = run(scene, 0.0325, "hybrid")
    known = StaticSolver(scene)
    creeping, rests = Creeping(scene, known, 1e-6 * scene.F_N), RestStates(known, 1e-7, "rk4", {})
    rests.made["modal_bases"] = 0
    rough = np.zeros((scene.N_z, 2, scene.N_x))
    rough[1:-1, 0] = (-1.0) ** np.arange(1, scene.N_z - 1)[:, None]
    waits = []
    for speed in (1e-3, 1e3):
        state = record.final_state.copy()
        assert (np.abs(state.mode) == 1).any()
        state.y[:, 2:] += speed * rough
        closed = state.mode != OPEN
        found = creeping.land(state, 2e-3, lambda: rests.modes(closed), state.step + 10**6)  # noqa: B023
        waits.append(found.steps)
        assert isinstance(found, Wait)
    v = known.coordinates(rough, np.zeros(3))
    decay = v @ (damping(scene) @ v) / (2 * v @ (mass(scene) * v))
    assert waits[1] - waits[0] == pytest.approx(np.log(1e6) / (decay * state.dt), rel=0.1)


def test_where_stable_slip_is_left_to_dynamics():
    scene = rod()
    assert Creeping.possible(scene, "linear")
    assert not Creeping.possible(scene, "finite")
    for change in ({"alpha": 0.1}, {"d_c": 0.0}, {"law": Ageing(B=0.01, t_c=1e-3)}):
        other = dataclasses.replace(scene.interface, **change)
        other = dataclasses.replace(scene, interface=other)
        assert not Creeping.possible(other, "linear")
    back = scene.replace({"driver.protocol": [(1.0, 2e-3), (1.0, 0.0), (2.0, 0.0), (2.0, -1e-3)]})
    creeping = Creeping(back, StaticSolver(back), 1.0)
    assert [creeping.speed(t) for t in (0.5, 1.5, 2.5)] == [2e-3, 0.0, 0.0]
