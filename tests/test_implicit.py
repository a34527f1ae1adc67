"""The implicit, non-smooth stepper: order, exact sliders, stability, budget, agreement, bits."""

import dataclasses
import functools

import numpy as np
import pytest
import twin

import pyfric
from pyfric import core
from pyfric.core import OPEN
from pyfric.engines import RunError
from pyfric.engines.implicit import MoreauJean
from pyfric.scene import SceneError, chain, preset, setup1, setup2
from pyfric.statics import StaticSolver, loaded_state, stability_limit

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", progress=False)
implicit = functools.partial(simulate, method="moreau_jean")


def small(kind="rod", **changes):
    if kind == "rod":
        return setup1(**{"L": 0.02, "H": 0.0125, "V": 0.5} | changes)
    return setup2(**{"L": 0.012, "H": 0.005, "theta": 0.5, "V": 0.3} | changes)


def slider(**changes):
    """Return a chain of three blocks that hardly know of each other; see test_location."""
    rest = {"L": 2.0, "l": 1.0, "k": 1e-14, "M": 3.0, "K": 1e-14, "eta": 1e-16, "k_f": 1.0}
    return chain(**rest | {"p": 1.0, "mu_s": 0.5, "mu_k": 0.25, "V": 0.125} | changes)


def shaken(scene, dt, size):
    """Return the loaded state with smooth velocities of `size` m/s; nothing slips."""
    state = loaded_state(scene).state(scene, dt)
    j = np.arange(scene.N_z)[:, None]
    state.y[:, 2] = size * np.sin(0.7 * j) * np.cos(3 * scene.x / scene.x[-1])
    state.y[:, 3] = size * np.sin(0.5 * j) * np.sin(2 * scene.x / scene.x[-1])
    if scene.rigid:
        state.y[-1, 2:] = 0
    return state


def closure(record):
    """Return the largest error of the energy budget over the work of the driver."""
    curve = record.curve
    stored = curve[list(core.ENERGIES)].sum(axis=1)
    put_in = curve[["work_driver", "work_load"]].sum(axis=1)
    lost = curve[["dissipated_bonds", "friction_heat", "switching_loss"]].sum(axis=1)
    return np.abs(stored - stored[0] - put_in + lost).max() / curve["work_driver"].iloc[-1]


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_order_is_two_while_nothing_switches(kind):
    scene = small(kind, V=1e-3)
    dt = 0.1 * stability_limit(scene)[0]
    exact = shaken(scene, dt / 8, 1e-3)
    log, model = core.Log(scene.N_x), core.model(scene, "linear", exact.u_drv0)
    core.advance(model, exact, log, 40 * 8)
    errors = []
    for halvings in range(3):
        state = shaken(scene, dt / 2**halvings, 1e-3)
        record = implicit(scene, 40 * dt, initial=state, dt=state.dt)
        assert not len(record.switches["t"])
        errors.append(np.abs(record.final_state.y - exact.y).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2) < 0.2), orders


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_one_step_obeys_the_equation_of_the_twin(kind):
    """(v' - v)/h is the acceleration of the twin at the middle, (q' - q)/h the velocity there."""
    scene = small(kind)
    dt = 2e-8
    state = shaken(scene, dt, 0.02)
    slips = np.arange(scene.N_x) % 2 == 0
    state.mode[slips] = 1
    state.y[0, 2] = np.where(slips, 0.3, 0.0)
    now = implicit(scene, dt, initial=state, dt=dt).final_state
    assert (now.mode == state.mode).all()
    y, rod = (now.y + state.y) / 2, (now.rod + state.rod) / 2
    there = twin.right_hand_side(scene, "linear", dt / 2, y, rod, now.mode, now.u_drv0)
    change = (now.y - state.y) / dt
    for c in range(4):
        scale = np.abs(there.dydt[:, c]).max()
        assert np.abs(change[:, c] - there.dydt[:, c]).max() < 1e-9 * scale
    works = [now.dissipated.sum(), now.heat.sum(), *now.work]
    np.testing.assert_allclose(works, dt * np.array(list(there.rates.values())), rtol=1e-9)


def test_a_static_state_stays_where_it_is():
    """Also with steps of a second."""
    scene = small(V=0.0)
    record = implicit(scene, 10.0, dt=1.0)
    rest = loaded_state(scene)
    u = record.final_state.y[:, :2]
    assert np.abs(u - rest.u).max() < 1e-12 * np.abs(rest.u).max()
    assert not len(record.switches["t"])


def test_reversals_and_final_stick_of_a_block_on_a_spring():
    """|u| falls by 2 mu_k p/k each half period, then mu_s p holds the block; of first order."""
    errors = []
    for dt in (0.02, 0.01, 0.005):
        scene = slider(k_top=1.0)
        state = loaded_state(scene).state(scene, dt)
        state.y[0, 0, 1], state.mode[1] = -2.35, 1
        record = implicit(scene, 20.0, initial=state, dt=dt)
        own = record.switches["block"] == 1
        assert record.switches["new"][own][-1] == 0
        final = record.final_state
        assert (final.mode[1], final.y[0, 2, 1]) == (0, 0.0)
        last = record.switches["t"][own][-1]
        errors.append(max(abs(last - 4 * np.pi), abs(final.y[0, 0, 1] + 0.35)))
        assert last == pytest.approx(4 * np.pi, abs=8 * dt)
    assert errors[2] < 0.6 * errors[0]
    assert errors[2] < 0.03


def test_stuck_blocks_use_mu_s_and_slipping_ones_mu_k():
    """A driven block is released at mu_s p, and the driver's force then falls below mu_k p."""
    scene = slider(K=1.0)
    record = implicit(scene, 12.0, dt=0.01)
    t, new = (record.switches[name] for name in ("t", "new"))
    assert new[:2].tolist() == [1, 0]
    assert t[0] == pytest.approx(0.5 / 0.125, abs=0.02)  # K V t = mu_s p
    tau = 2 * (np.pi - np.arctan(0.25 / 0.125))  # see test_location.stick_slip
    assert t[1] - t[0] == pytest.approx(tau, abs=0.05)
    force = np.interp(t[1], record.curve["t"], record.curve["F_T"])
    drop = 0.25 * (1 - np.cos(tau)) - 0.125 * np.sin(tau)
    assert force == pytest.approx(0.5 - drop, abs=0.02)


def test_a_block_opens_and_lands():
    """Thrown up from the foundation: SHM, flight, SHM; see test_location."""
    scene = slider()
    state = loaded_state(scene).state(scene, 0.005)
    state.y[0, 3, 1] = 2.0
    record = implicit(scene, 6.0, initial=state, dt=0.005)
    s = record.switches
    flight = s["t"][(s["block"] == 1) & ((s["new"] == OPEN) | (s["old"] == OPEN))][:2]
    np.testing.assert_allclose(flight, np.pi / 6 + np.array([0, 2 * np.sqrt(3)]), atol=0.02)


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_the_energy_budget_closes_to_rounding(kind):
    """The midpoint rule conserves the energy of linear motion; friction works on the same v."""
    record = implicit(small(kind), 2e-3, dt=0.4e-6)
    assert len(record.events) >= 1
    assert record.curve["friction_heat"].iloc[-1] > 0.01 * record.curve["work_driver"].iloc[-1]
    assert closure(record) < 1e-10  # rounding of 5000 steps


def test_events_tend_to_those_of_rk4():
    """The same blocks; forces within 1e-3 F_N, switches within 2 us, at a quarter of the limit."""
    how = {"geometry": "linear", "t_gap": 2e-5, "budget": False}
    there = simulate(small(), 2.5e-3, switching="located", dt=0.05e-6, **how)
    here = implicit(small(), 2.5e-3, dt=0.4e-6, **how)
    assert (here.method.stepper, here.method.geometry) == ("moreau_jean", "linear")
    assert len(there.events) >= 3
    for name in ("first_block", "last_block"):
        np.testing.assert_array_equal(here.events[name], there.events[name])
    for name in ("F_T_start", "F_T_arrest"):
        difference = np.abs(here.events[name] - there.events[name]) / here.scene.F_N
        assert np.nanmax(difference) < 1e-3
    np.testing.assert_allclose(here.switches["t"][:10], there.switches["t"][:10], atol=2e-6)


@pytest.mark.parametrize(
    "changes", [{"k_f": 13.5e10}, {"eta": 3e4}, {"eta": 1e-6}], ids=["k_f", "eta", "undamped"]
)
def test_stable_where_explicit_steps_are_not(changes):
    """Above the limit of RK4, thirty times and more where something is stiff: the motion stays."""
    scene = small(**changes)
    limit = stability_limit(scene)[0]
    dt = 8e-6 if limit > 1e-6 else 4e-6
    assert dt > (1.5 if limit > 1e-6 else 30) * limit
    with pytest.raises(SceneError, match="stability limit"):
        simulate(scene, 1e-3, dt=dt)
    assert stability_limit(scene, "moreau_jean")[0] == np.inf
    record = implicit(scene, 4e-3, dt=dt)
    assert record.status == "complete"
    if OPEN not in record.switches["new"]:
        assert closure(record) < 1e-10
    assert record.curve["kinetic_blocks"].max() < 0.1 * record.curve["work_driver"].iloc[-1]
    assert 0 < record.curve["F_T"].max() < scene.interface.mu_s * scene.F_N * 1.1


@pytest.mark.parametrize("k_f", [13.5e8, 13.5e10])
def test_a_stiff_foundation_gives_the_forces_of_small_explicit_steps(k_f):
    """k_f = 100 k and 10,000 k: the first event of RK4 at its own, smaller step."""
    scene = small(k_f=k_f)
    limit = stability_limit(scene)[0]
    there = simulate(scene, 1.5e-3, geometry="linear", budget=False, t_gap=2e-5)
    here = implicit(scene, 1.5e-3, dt=1e-6, budget=False, t_gap=2e-5)
    assert there.method.dt <= 0.5 * limit
    a, b = here.events.iloc[0], there.events.iloc[0]
    assert (a["first_block"], a["last_block"]) == (b["first_block"], b["last_block"])
    assert a["F_T_start"] == pytest.approx(b["F_T_start"], abs=2e-3 * scene.F_N)


def test_many_blocks_at_threshold_at_once():
    """Every block of a chain is pulled alike by its own spring: all slip, and stop, together."""
    N = 41
    scene = chain(L=(N - 1) * 2.5e-3, k_top=1e7, K=1e-30, V=0.0, mu_s=0.7)
    dt = 0.3 * stability_limit(scene)[0]
    state = loaded_state(scene).state(scene, dt)
    state.y[0, 0] = -1.2 * 0.7 * scene.load / scene.k_top
    record = implicit(scene, 400 * dt, initial=state, dt=dt)
    first, last = record.switches["t"][:N], record.switches["t"][-N:]
    assert (record.switches["new"][:N] == 1).all()
    assert np.ptp(first) == 0
    assert (record.final_state.mode == 0).all()
    assert np.ptp(last) <= 2 * dt


def test_a_run_in_parts_is_the_whole_run(tmp_path):
    how = {"dt": 1e-6, "sample": 1e-5}
    whole = implicit(small(), 2e-3, **how)
    part = implicit(small(), 1.15e-3, **how)
    part = pyfric.Record.load(part.save(tmp_path / "part.nc"))
    rest = simulate(small(), 2e-3, initial=part)
    assert len(whole.switches["t"]) > 10
    drop = {"timings": {}}
    assert dataclasses.replace(rest, **drop).identical(dataclasses.replace(whole, **drop))


def test_doubling_load_and_speed_doubles_every_bit():
    one, two = (implicit(small(F_N=f * 3500, V=f * 0.5), 2e-3, dt=1e-6) for f in (1.0, 2.0))
    assert len(one.switches["t"]) > 10
    np.testing.assert_array_equal(two.switches["t"], one.switches["t"])
    np.testing.assert_array_equal(two.final_state.y, 2 * one.final_state.y)


def test_driven_from_the_right_it_is_the_mirror_image():
    left, right = (implicit(small(side=side), 2e-3, dt=1e-6) for side in ("left", "right"))
    np.testing.assert_array_equal(right.switches["t"], left.switches["t"])
    np.testing.assert_array_equal(
        np.sort(right.switches["block"]), np.sort(8 - left.switches["block"])
    )
    np.testing.assert_allclose(right.curve["F_T"], left.curve["F_T"], rtol=0, atol=1e-6)


def test_no_contact_state_ends_the_run_with_a_reason(monkeypatch):
    monkeypatch.setattr(MoreauJean, "_contacts", lambda *_: None)
    with pytest.raises(RunError, match=r"no contact state .* dt = 1e-06 s from t = 0 s") as stop:
        implicit(small(), 1e-4, dt=1e-6)
    assert stop.value.record.status.startswith("failed")


@pytest.mark.parametrize(
    ("fidelity", "options", "field", "allowed"),
    [
        ("dynamic", {"geometry": "finite"}, "geometry", "method = 'moreau_jean'"),
        ("dynamic", {"switching": "located"}, "switching", "'step_end'"),
        ("dynamic", {"d_c": 1e-6}, "interface.d_c", "method = 'moreau_jean'"),
        ("hybrid", {}, "method", "fidelity = 'hybrid'"),
        ("quasistatic", {}, "method", "makes no steps"),
    ],
)
def test_refused_options(fidelity, options, field, allowed):
    scene = small(d_c=options.pop("d_c", 0.0))
    with pytest.raises(SceneError) as refusal:
        implicit(scene, 1e-4, fidelity=fidelity, **options)
    assert refusal.value.field == field
    assert allowed in str(refusal.value)


def test_the_scene_of_the_paper():
    """Fig. 1 through a hundred steps of 20 us: the stuck slider follows its static states."""
    scene = preset("fig1")
    record = implicit(scene, 2e-3, dt=20e-6)
    rest = StaticSolver(scene).solve(record.final_state.y[0, 0], scene.driver.V * 2e-3)
    assert record.curve["F_T"].iloc[-1] == pytest.approx(rest.F_T, abs=1e-4 * scene.F_N)
