"""Contact switches located inside a step: exact solutions, an oracle with events, known traps."""

import functools

import numpy as np
import pytest
from helpers import budget_error, small
from scipy.integrate import solve_ivp

import pyfric
from pyfric import core
from pyfric.core import OPEN, STUCK
from pyfric.engines import RunError
from pyfric.scene import chain, setup1, setup2
from pyfric.statics import loaded_state, stability_limit

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", progress=False, sample=1e-5)

EPS = 2.0**-52


def slider(**changes):
    """Return a chain of three almost uncoupled blocks, the first of which is driven.

    m = 1 kg, p = 1 N, mu_s = 0.5, mu_k = 0.25, K = 1 N/m for simple numbers.
    """
    rest = {"L": 2.0, "l": 1.0, "k": 1e-14, "M": 3.0, "K": 1.0, "eta": 1e-16, "k_f": 1.0}
    return chain(**rest | {"p": 1.0, "mu_s": 0.5, "mu_k": 0.25, "V": 0.125} | changes)


def start(scene, dt):
    return loaded_state(scene).state(scene, dt)


def advance(scene, state, n, log=None, **options):
    """Make n steps; return the columns of the switch log, and the other logs."""
    log = log or core.Log(scene.N_x)
    model = core.model(scene, "linear", state.u_drv0)
    options = {"switching": "located"} | options
    assert core.advance(model, state, log, n, **options) == core.Status.DONE
    return log.switches()


def stick_slip(scene, cycles):
    """Return the exact times of release and stop of a driven block.

    Slip: m u'' = K (V t - u) - mu_k p from F_T = mu_s p and u' = 0. With tau the time since,
    w = sqrt(K/m), d = (mu_s - mu_k) p/K:  u' = V (1 - cos w tau) + d w sin w tau, which vanishes
    again at w tau = 2 (pi - arctan(d w/V)).
    """
    K, V, m = scene.driver.K, scene.driver.V, scene.m
    p, mu_s, mu_k = scene.load[0], scene.interface.mu_s, scene.interface.mu_k
    w, d = np.sqrt(K / m), (mu_s - mu_k) * p / K
    times, t = [], mu_s * p / (K * V)
    for _ in range(cycles):
        tau = 2 * (np.pi - np.arctan(d * w / V)) / w
        u = V * (tau - np.sin(w * tau) / w) + d * (1 - np.cos(w * tau))
        times += [t, t + tau]
        t += tau + (u - V * tau) / V  # F_T has fallen by K (u - V tau) and has to grow back
    return np.array(times)


# --- exact sliders -------------------------------------------------------------------------------


def test_a_driven_block_sticks_and_slips_at_the_exact_times():
    """The error of releases and stops in five cycles falls with the fourth power of dt."""
    scene = slider()
    exact = stick_slip(scene, 5)
    errors = []
    for n in (500, 1000, 2000):
        state = start(scene, 1.05 * exact[-1] / n)
        made = advance(scene, state, n)
        own = made["block"] == 0
        np.testing.assert_array_equal(made["new"][own][:10], [1, 0] * 5)
        errors.append(np.abs(made["t"][own][:10] - exact).max())
        assert state.loss.sum() < 1e-25
    assert errors[-1] < 1e-9 * exact[-1]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.7).all(), orders


def test_switching_at_step_ends_is_of_first_order():
    """For the same slider the error of times falls in proportion to the step."""
    scene = slider()
    exact = stick_slip(scene, 5)
    errors = []
    for n in (500, 1000, 2000, 4000):
        state = start(scene, 1.05 * exact[-1] / n)
        made = advance(scene, state, n, switching="step_end")
        errors.append(np.abs(made["t"][made["block"] == 0][:10] - exact).mean())
    order = np.polyfit(np.log2([500, 1000, 2000, 4000]), np.log2(errors), 1)[0]
    assert -1.5 < order < -0.6
    assert errors[-1] > 1e-4


def test_immediate_reversal_and_final_stick():
    """A block on a spring reverses every half period, loses 2 mu_k p/k each time, and sticks."""
    scene = slider(k_top=1.0, K=1e-14, mu_s=0.5, mu_k=0.25)
    state = start(scene, 0.02)
    state.y[0, 0, 1], state.mode[1] = -2.35, 1
    made = advance(scene, state, 1000)
    own = made["block"] == 1
    # |u| = 2.35, 1.85, 1.35, 0.85, 0.35 <= mu_s p/k
    np.testing.assert_array_equal(made["new"][own], [-1, 1, -1, 0])
    np.testing.assert_allclose(made["t"][own], np.pi * np.arange(1, 5), atol=1e-7)
    np.testing.assert_allclose(made["u_x"][own], [1.85, -1.35, 0.85, -0.35], atol=1e-7)
    assert state.loss.sum() < 1e-20


def test_a_block_opens_and_lands_at_the_exact_times():
    """Thrown up, a block leaves the foundation, flies freely, and comes down again."""
    scene = slider(K=1e-14)
    errors = []
    for dt in (0.04, 0.02):
        state = start(scene, dt)
        state.y[0, 3, 1] = 2.0
        made = advance(scene, state, round(6 / dt))
        own = (made["block"] == 1) & ((made["new"] == OPEN) | (made["old"] == OPEN))
        # u_z = -1 + 2 sin t up to pi/6, then flight under the load of 1 N on 1 kg
        exact = np.pi / 6 + np.array([0.0, 2 * np.sqrt(3)])
        np.testing.assert_array_equal(made["new"][own][0], OPEN)
        np.testing.assert_array_equal(made["old"][own][1], OPEN)
        errors.append(np.abs(made["t"][own][:2] - exact).max())
    assert errors[1] < 1e-7
    assert errors[0] / errors[1] > 12


# --- an oracle -----------------------------------------------------------------------------------


def oracle(scene, u, v, t_end):
    """Return (t, block, old, new) of a chain with constant p, by DOP853 with events."""
    N, m, k, eta = scene.N_x, scene.m, scene.slider.k, scene.eta
    p, mu_s, mu_k = scene.load, scene.interface.mu_s, scene.interface.mu_k
    K, V, i_h = scene.driver.K, scene.driver.V, scene.i_h

    def other(t, u, v):
        f = scene.shear - scene.k_top * u
        du, dv = np.diff(u), np.diff(v)
        f[:-1] += k * du + eta * dv
        f[1:] -= k * du + eta * dv
        f[i_h] += K * (V * t - u[i_h])
        return f

    mode, t, found = np.zeros(N, dtype=int), 0.0, []
    y = np.concatenate([u, v])
    while t < t_end:
        now = mode.copy()

        def slope(t, y, mode=now):
            u, v = y[:N], np.where(mode == 0, 0.0, y[N:])
            a = (other(t, u, v) - mode * mu_k * p) / m
            return np.concatenate([v, np.where(mode == 0, 0.0, a)])

        def margin(t, y, i, mode=now):
            if mode[i]:
                return mode[i] * y[N + i]
            return mu_s * p[i] - abs(other(t, y[:N], y[N:])[i])

        events = []
        for i in range(N):
            event = functools.partial(lambda t, y, i, margin=margin: margin(t, y, i), i=i)
            event.terminal, event.direction = True, -1
            events.append(event)
        done = solve_ivp(
            slope, (t, t_end), y, method="DOP853", events=events, rtol=1e-12, atol=1e-15
        )
        t, y = done.t[-1], done.y[:, -1].copy()
        hit = [i for i in range(N) if done.t_events[i].size]
        if not hit:
            break
        (i,) = hit
        y[N + i] = 0.0
        force = other(t, y[:N], y[N:])[i]
        old = mode[i]
        if old == 0 or abs(force) > mu_s * p[i]:
            mode[i] = 1 if force > 0 else -1
        else:
            mode[i] = 0
        found.append((t, i, old, mode[i]))
    return found


def test_a_small_slider_as_solve_ivp_sees_it():
    """Four coupled blocks make the same 14 switches, at times that converge to those of SciPy."""
    p = (60.0, 70.0, 55.0, 65.0)
    tau = (20.0, 0.0, -10.0, 15.0)
    scene = chain(L=7.5e-3, p=p, tau=tau, V=0.3, k_top=2e7, K=4e6, k=5e7, mu_s=0.7, mu_k=0.2)
    there = oracle(scene, np.zeros(4), np.zeros(4), 2e-4)
    assert len(there) == 14
    errors = []
    for share in (0.05, 0.025):
        state = start(scene, share * stability_limit(scene)[0])
        made = advance(scene, state, round(2e-4 / state.dt))
        columns = (made[name].tolist() for name in ("block", "old", "new"))
        assert list(zip(*columns, strict=True)) == [one[1:] for one in there]
        errors.append(np.abs(made["t"] - [one[0] for one in there]).max())
    assert errors[1] < 1e-7 * there[-1][0]
    assert errors[0] / errors[1] > 12


# --- failures known elsewhere --------------------------------------------------------------------


def test_a_root_at_the_end_of_a_step_is_found_once():
    """K V t reaches mu_s p exactly at the end of step 64; numbers are exact in binary."""
    scene = slider(V=0.125, k=2.0**-60, eta=2.0**-70)
    state = start(scene, 0.0625)
    assert state.u_drv0 == 0
    made = advance(scene, state, 64)
    assert not len(made["t"])
    assert state.margin[0] == 0
    made = advance(scene, state, 3)
    assert made["block"].tolist() == [0]
    assert made["step"][0] == 65
    assert made["t"][0] == pytest.approx(4.0, abs=1e-12)


def test_a_stop_at_the_end_of_a_step_is_found_once():
    """With v = 1 - t and dt = 1/16 the block stops exactly at the end of a step."""
    scene = slider(K=2.0**-60, k=2.0**-60, eta=2.0**-70, mu_s=2.0, mu_k=1.0)
    state = start(scene, 0.0625)
    state.y[0, 2, 1], state.mode[1] = 1.0, 1
    made = advance(scene, state, 16)
    made = {name: np.concatenate([column, advance_more[name]]) for advance_more in
            [advance(scene, state, 3)] for name, column in made.items()}  # fmt: skip
    assert made["new"].tolist() == [STUCK]
    assert made["t"][0] == pytest.approx(1.0, abs=1e-12)
    assert state.y[0, 0, 1] == pytest.approx(0.5, abs=1e-13)


@pytest.mark.parametrize("phase", [0.5, 0.37])
def test_a_double_crossing_inside_one_step_is_not_missed(phase):
    """An open neighbour on a spring pulls a stuck block just beyond mu_s p and back in one step.

    Slack is mu_s p - k A cos(w t) with k A = 1.001 mu_s p: it is negative for 0.09 radians, in the
    middle of a step of 0.4 radians.
    """
    k = 1e-3
    scene = slider(k=k, K=1e-14, k_top=1.0, eta=1e-16)
    w = np.sqrt(scene.k_top + k)
    dt = 0.4 / w
    A = 1.001 * 0.5 / k
    state = start(scene, dt)
    begin = (3 + phase) * 0.4  # phase of the neighbour at t = 0: the peak is inside step 4
    state.mode[2] = OPEN
    state.y[0, :, 2] = A * np.cos(begin), 1e6, A * w * np.sin(begin), 0.0
    model = core.model(scene, "linear", state.u_drv0)
    before = core.evaluate(model, state, 0.0).f[1]
    assert abs(before) < 0.5
    made = advance(scene, state, 5)
    first = made["block"] == 1
    assert first.any()
    # the phase error of RK4 in three steps of 0.4 radians is 3e-4
    exact = (begin - np.arccos(1 / 1.001)) / w
    assert made["t"][first][0] == pytest.approx(exact, abs=0.01 * dt)
    coarse = start(scene, dt)
    coarse.mode[2], coarse.y[0, :, 2] = OPEN, [
        A * np.cos(begin), 1e6, A * w * np.sin(begin), 0.0]  # fmt: skip
    missed = advance(scene, coarse, 5, switching="step_end")
    assert 1 not in missed["block"]  # no step end shows the crossing


def test_endless_switching_is_stopped_with_block_and_time(monkeypatch):
    """A thousand reversals in one adaptive step exceed the limit."""
    scene = slider(k_top=1.0, K=1e-14, mu_s=1e-4, mu_k=5e-5)
    state = start(scene, 3141.0)
    state.y[0, 0, 1], state.mode[1] = -2.0, 1
    log = core.Log(scene.N_x)
    model = core.model(scene, "linear", state.u_drv0)
    options = {"stepper": "adaptive", "rtol": 1e-4, "switching": "located"}
    assert core.advance(model, state.copy(), log, 1, **options) == core.Status.ENDLESS
    assert log.block == 1
    assert np.pi * 60 < log.t < 3141
    monkeypatch.setattr(
        "pyfric.engines.step_sizes.LONGEST_LOCATED", np.inf
    )  # otherwise such a step is refused
    with pytest.raises(RunError, match=r"block 2 .* between stick, slip and gap at t = \d") as stop:
        simulate(scene, 3141.0, initial=state, dt=3141.0, **options)
    assert stop.value.record.status.startswith("failed: contacts switch without end")
    assert stop.value.record.final_state.step == 0


def test_no_static_kinetic_gap_does_not_switch_without_end():
    """With mu_s = mu_k a driven block starts to creep, and goes on."""
    scene = slider(mu_k=0.5)
    state = start(scene, 0.05)
    made = advance(scene, state, 400)
    assert made["t"][0] == pytest.approx(4.0, abs=1e-9)
    assert len(made["t"]) < 20
    assert state.y[0, 0, 0] > 0.9 * 0.125 * (20 - 4) - 0.3


def test_signs_are_compared_not_products():
    """With forces of 1e-170 N, products of margins underflow, but the same switches are found."""
    scene = setup1(L=0.02, H=0.0125, V=0.5)
    scale = 2.0**-580
    state = loaded_state(scene).state(scene, 0.5e-6)
    model = core.model(scene, "linear", state.u_drv0)
    advance_to = functools.partial(core.advance, switching="located", budget=False)
    tiny = state.copy()
    for name in ("y", "rod", "margin"):
        setattr(tiny, name, scale * getattr(state, name))
    numbers = model.numbers.copy()
    for name in ("F_N", "v_drv", "u_mean", "p_corner"):
        numbers[core.Constants._fields.index(name)] *= scale
    load = slice(-2 * scene.N_x, -scene.N_x)
    numbers[load] *= scale
    model_tiny = model._replace(numbers=numbers)
    log, log_tiny = core.Log(scene.N_x), core.Log(scene.N_x)
    advance_to(model, state, log, 2400)
    advance_to(model_tiny, tiny, log_tiny, 2400)
    assert log.n_switch > 5
    assert 0 < np.abs(tiny.y[:, :2]).max() < 1e-170
    np.testing.assert_array_equal(log_tiny.switches()["t"], log.switches()["t"])
    np.testing.assert_array_equal(log_tiny.switches()["new"], log.switches()["new"])


def test_blocks_that_switch_together_do_so_in_mirror_symmetry():
    """Both halves of a slider pulled apart switch at the same times, bit for bit."""
    scene = setup2(L=0.012, H=0.005, theta=0.0, K=1e-30, V=0.0)
    state = loaded_state(scene).state(scene, 0.4 * stability_limit(scene)[0])
    u = state.y[:, :2]
    u[:, 0] = (u[:, 0] - u[:, 0, ::-1]) / 2
    u[:, 1] = (u[:, 1] + u[:, 1, ::-1]) / 2
    state.y[1:, 2] = 5.0 * scene.x / scene.x[-1]
    made = advance(scene, state, 300)
    assert len(made["t"]) >= 6
    times = {}
    for t, block, new in zip(made["t"], made["block"], made["new"], strict=True):
        times.setdefault(float(t), []).append((int(block), int(new)))
    for switches in times.values():
        mirrored = {(scene.N_x - 1 - i, -new if new in (1, -1) else new) for i, new in switches}
        assert mirrored == set(switches)
    np.testing.assert_array_equal(state.y[:, 2], -state.y[:, 2, ::-1])
    np.testing.assert_array_equal(state.y[:, 1], state.y[:, 1, ::-1])


def test_many_blocks_at_threshold_at_the_same_instant():
    """Equal springs pull all blocks of a uniform chain, and all slip at once."""
    N = 41
    scene = chain(L=(N - 1) * 2.5e-3, k_top=1e7, K=1e-30, V=0.0, mu_s=0.7)
    state = start(scene, 0.3 * stability_limit(scene)[0])
    state.y[0, 0] = -1.2 * 0.7 * scene.load / scene.k_top
    made = advance(scene, state, 1)
    assert sorted(made["block"]) == list(range(N))
    assert (made["new"] == 1).all()
    assert np.ptp(made["t"]) < 1e-9 * state.dt
    made = advance(scene, state, 400)  # all blocks stop together, too
    assert sorted(made["block"]) == list(range(N))
    assert np.ptp(made["t"]) < 1e-9 * state.dt
    assert (made["new"] == STUCK).all()


# --- the lattice ---------------------------------------------------------------------------------


def rupture_times(dt, T, **options):
    scene = setup1(L=0.02, H=0.0125, V=0.5)
    state = loaded_state(scene).state(scene, dt)
    made = advance(scene, state, round(T / dt), **options)
    return made["t"], made["block"], made["new"]


@pytest.fixture(scope="module")
def reference():
    return rupture_times(0.0125e-6, 1.2e-3)


@pytest.mark.parametrize(
    ("stepper", "least"), [("rk4", 3.5), ("verlet", 1.9), ("symplectic_euler", 0.9)]
)
def test_order_of_rupture_times(stepper, least, reference):
    """For a short front in a lattice, located switching keeps the order of the stepper."""
    errors = []
    for dt in (0.2e-6, 0.1e-6, 0.05e-6):
        t, block, new = rupture_times(dt, 1.2e-3, stepper=stepper)
        n = 20
        np.testing.assert_array_equal(block[:n], reference[1][:n])
        np.testing.assert_array_equal(new[:n], reference[2][:n])
        errors.append(np.sqrt(np.mean((t[:n] - reference[0][:n]) ** 2)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > least).all(), (errors, orders)


def test_switching_at_step_ends_loses_the_order(reference):
    errors = []
    for dt in (0.2e-6, 0.1e-6, 0.05e-6, 0.025e-6):
        t, block, _ = rupture_times(dt, 1.2e-3, switching="step_end")
        np.testing.assert_array_equal(block[:20], reference[1][:20])
        errors.append(np.sqrt(np.mean((t[:20] - reference[0][:20]) ** 2)))
    order = -np.polyfit(range(4), np.log2(errors), 1)[0]
    assert 0.6 < order < 1.4, (errors, order)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_located_runs_in_parts_through_a_record_and_hybrid(geometry, tmp_path):
    """A continued run has the same bits; the hybrid engine makes the same events."""
    options = {"geometry": geometry, "switching": "located", "sample": 1e-5, "t_gap": 2e-5}
    whole = simulate(small(), 2e-3, **options)
    assert (whole.method.stepper, whole.method.switching) == ("rk46", "located")
    part = simulate(small(), 1.15e-3, **options)
    part = pyfric.Record.load(part.save(tmp_path / "part.nc"))
    rest = simulate(small(), 2e-3, initial=part)
    assert len(whole.switches["t"]) > 20
    accuracy = 1e-6 if geometry == "linear" else 1e-2
    assert rest.method == whole.method
    assert rest.final_state.y.tobytes() == whole.final_state.y.tobytes()
    for name, column in whole.switches.items():
        assert rest.switches[name].tobytes() == column.tobytes(), name
    assert rest.counts == whole.counts
    hybrid = simulate(small(), 2e-3, fidelity="hybrid", accuracy=accuracy, **options)
    assert hybrid.counts["jumps"] >= 1
    assert len(whole.events) >= 3
    np.testing.assert_array_equal(hybrid.events["last_block"], whole.events["last_block"])
    for name in ("F_T_start", "F_T_arrest"):
        difference = np.abs(hybrid.events[name] - whole.events[name]) / whole.scene.F_N
        assert np.nanmax(difference) < 1e-3
    if geometry == "linear":  # jumps in finite geometry are not exact enough for micro-slips
        for name in ("block", "old", "new"):
            np.testing.assert_array_equal(hybrid.switches[name][:10], whole.switches[name][:10])
        np.testing.assert_allclose(hybrid.switches["t"][:10], whole.switches["t"][:10], atol=2e-8)


def test_located_switching_loses_no_energy():
    """The switching loss, 1e-8 J at step ends, is only rounding, and the budget closes faster."""
    errors = []
    for share in (0.4, 0.2):
        dt = share * stability_limit(small())[0]
        record = simulate(small(), 1.4e-3, geometry="linear", dt=dt, switching="located")
        curve = record.curve
        scale = curve["work_driver"].iloc[-1]
        assert curve["friction_heat"].iloc[-1] > 0.05 * scale
        assert curve["switching_loss"].iloc[-1] < 1e-25
        errors.append(budget_error(record))
    assert errors[1] < 1e-6 * scale
    assert errors[0] / errors[1] > 12
    at_ends = simulate(small(), 1.4e-3, geometry="linear", dt=dt, switching="step_end")
    assert at_ends.curve["switching_loss"].iloc[-1] > 1e-10


def test_quiet_transitions_have_the_time_of_the_switch():
    record = simulate(small(), 1.4e-3, geometry="linear", switching="located")
    first = record.quiet["kind"] > 0
    assert first.any()
    assert np.isin(record.quiet["t"], record.switches["t"]).all()
    on_grid = record.quiet["step"] * record.method.dt
    assert (record.quiet["t"] <= on_grid).all()
    assert (record.quiet["t"] > on_grid - record.method.dt).all()


def test_the_core_refuses_wrong_options():
    scene = slider()
    state = start(scene, 0.01)
    model = core.model(scene, "linear", state.u_drv0)
    for wrong in ({"stepper": "euler"}, {"switching": "never"}, {"rtol": 0.0}, {"rtol": np.nan}):
        with pytest.raises(ValueError, match="stepper"):
            core.advance(model, state, core.Log(scene.N_x), 1, **wrong)
    small_log = core.Log(scene.N_x, quiet=1)
    with pytest.raises(ValueError, match="log"):
        core.advance(model, state, small_log, 1, switching="located")


def test_a_slip_that_starts_with_no_force_of_its_own():
    """With slip weakening friction is continuous at release, and v grows from zero slope.

    K = 1 N/m, m = 1 kg, mu_s p = 0.5 N: released at t = 4, m u'' = V (t - 4) - u + u/4 while
    friction falls by 0.25 N over d_c = 1 m.
    """
    scene = slider(d_c=1.0)
    errors = []
    for dt in (0.04, 0.02):
        state = start(scene, dt)
        made = advance(scene, state, round(6 / dt))
        assert made["new"].tolist() == [1]
        assert made["t"][0] == pytest.approx(4.0, abs=1e-9)
        w = np.sqrt(0.75)
        exact = 0.125 * (2 / w**2 - np.sin(2 * w) / w**3)
        errors.append(abs(state.y[0, 0, 0] - exact))
    assert errors[1] < 1e-9
    assert errors[0] / errors[1] > 12


@pytest.mark.parametrize("threads", [1, 3])
def test_a_trial_takes_the_bottom_rows_only(threads):
    """A trial computes two of fifteen rows: 14 of the 60 rows of stages of a step.

    The number of trials follows from the difference of computed work and whole steps.
    """
    scene = setup1(L=0.02, H=0.035, V=5.0)
    state = loaded_state(scene).state(scene, 0.2e-6)
    model, log = core.model(scene, "linear", state.u_drv0), core.Log(scene.N_x)
    assert core.advance(model, state, log, 3000, switching="located", threads=threads) == 0
    instants = len(np.unique(log.switches()["t"]))
    assert instants > 5
    trials = (log.tried - 3000 - instants) * 60 / 14
    assert trials == pytest.approx(round(trials), abs=1e-6)
    assert instants <= round(trials) < 1.5 * instants  # the first trial predicts the second
