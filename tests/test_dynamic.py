"""Full dynamics: waves, order, stability, budgets, continued runs, the paper's scene."""

import dataclasses
import errno
import functools
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from helpers import (
    ENERGY_IN,
    ENERGY_OUT,
    GEOMETRIES,
    advance,
    budget_error,
    same_run,
    shaken,
    small,
)

import pyfric
from pyfric import core
from pyfric.core import OPEN, STUCK, StateError
from pyfric.engines import RunError, default_stepper, step_size, strains
from pyfric.engines.step_sizes import AUTO_SHARE, LONGEST
from pyfric.record import Record, analysis
from pyfric.scene import preset, setup1, setup2
from pyfric.statics import StaticSolver, loaded_state, stability_limit
from pyfric.values import SceneError

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", sample=1e-5)  # few points


# --- waves ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize(("polarisation", "speed"), [(0, np.sqrt(1.5)), (1, np.sqrt(0.5))])
def test_wave_speeds(polarisation, speed, geometry):
    """A standing wave along a free slider moves at sqrt(1.5) or sqrt(0.5) l sqrt(k/m).

    The wave has the shape exp(i q x) of the infinite lattice, in the middle of a long, free slider.
    Its frequency is measured before waves from the ends arrive.
    """
    scene = setup2(L=0.2, H=0.004, l=1e-3, eta=1e-12, h=1e-3)
    c = speed * scene.slider.l * np.sqrt(scene.slider.k / scene.m)
    # Plane waves fill the plane: use the long-wave acceleration -(c q)^2 u of an interior block.
    state = loaded_state(scene, geometry).state(scene, 1e-9)
    state.y[:] = 0
    q = 2 * np.pi / (100 * scene.slider.l)
    amplitude = 1e-9 * scene.slider.l
    state.y[:, polarisation] = amplitude * np.cos(q * scene.x)
    state.y[0, 1] += 1e-12
    state.mode[:] = OPEN
    forces = core.evaluate(core.model(scene, geometry, 0.0), state, 0.0)
    middle = scene.N_x // 2
    omega2 = -forces.a[2, polarisation, middle] / state.y[2, polarisation, middle]
    assert np.sqrt(omega2) / q == pytest.approx(c, rel=1e-3)


def test_wave_speeds_of_the_paper():
    """Waves have 1720 and 993 m/s on the lattice with m = M/N, 1677 and 968 m/s in a continuum."""
    scene = preset("fig1")
    unit = scene.slider.l * np.sqrt(scene.slider.k / scene.m)
    lattice = np.sqrt([1.5, 0.5]) * unit
    np.testing.assert_allclose(lattice, [1720, 993], atol=0.6)
    N_x, N_z = scene.N_x, scene.N_z
    continuum = lattice * np.sqrt((N_x - 1) * (N_z - 1) / (N_x * N_z))
    np.testing.assert_allclose(continuum, [1677, 968], atol=0.6)


def test_a_pulse_travels_at_the_longitudinal_speed():
    """In a wide lattice a plane pulse in u_x moves at sqrt(1.5) l sqrt(k/m)."""
    scene = setup2(L=0.3, H=0.06, l=1e-3, eta=1e-12, h=1e-3, M=0.108)
    c = np.sqrt(1.5) * scene.slider.l * np.sqrt(scene.slider.k / scene.m)
    dt, n = 0.2 * stability_limit(scene)[0], 100
    state = loaded_state(scene).state(scene, dt)
    width, amplitude = 8e-3, 1e-9
    profile = amplitude * np.exp(-((scene.x / width) ** 2))
    state.y[:] = 0
    state.y[:, 0] = profile
    state.y[:, 2] = c * profile * 2 * scene.x / width**2
    state.y[0, 1] += 1e-12
    state.mode[:] = OPEN
    start = state.y[30, 0].copy()
    calm = dataclasses.replace(scene, top=dataclasses.replace(scene.top, F_N=1e-20))
    advance(calm, "linear", state, n)
    row = state.y[30, 0]  # the middle: the free surfaces are 30 l away
    moved = (np.sum(scene.x * row**2) / np.sum(row**2)) - np.sum(scene.x * start**2) / np.sum(
        start**2
    )
    assert c * n * dt < 30e-3
    assert moved == pytest.approx(c * n * dt, rel=0.01)


# --- accuracy and stability of the stepper -------------------------------------------------------


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_order_is_four_while_nothing_switches(kind, geometry):
    scene = small(kind, V=1e-3)
    coarse = 0.2 * stability_limit(scene)[0]
    ends = []
    for halvings in range(4):
        state = shaken(scene, geometry, coarse)
        state.dt = coarse / 2**halvings
        log = advance(scene, geometry, state, 40 * 2**halvings)
        assert log.n_switch == 0
        ends.append(np.concatenate([state.y.ravel(), state.rod, state.dissipated, state.work]))
    errors = [np.abs(end - ends[-1])[: state.y.size].max() for end in ends[:-1]]
    budget_errors = [np.abs(end - ends[-1])[state.y.size + 6 :].max() for end in ends[:-1]]
    for found in (errors, budget_errors):
        orders = np.log2(np.array(found[:-2]) / found[1:-1])
        assert np.all(np.abs(orders - 4) < 0.25), orders


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_blow_up_is_where_theory_puts_it(kind):
    """Just below the limit a shaken slider calms down; just above it the motion blows up."""
    scene = preset("fig1" if kind == "rod" else "setup2")
    limit, _ = stability_limit(scene)
    size = {}
    for share in (0.99, 1.02):
        state = shaken(scene, "linear", share * limit, size=1e-9)
        start = np.abs(state.y[:, 2:]).max()
        advance(scene, "linear", state, 4000)
        size[share] = np.abs(state.y[:, 2:]).max() / start
    assert size[0.99] < 0.5
    assert not size[1.02] < 1e10


def test_the_limit_of_the_paper_s_scenes():
    """In setup 1, 1.57 us is stable and 1.60 us is not; the limit of setup 2 is 0.68 us."""
    assert stability_limit(preset("fig1"))[0] == pytest.approx(1.57e-6, rel=0.01)
    assert stability_limit(preset("setup2"))[0] == pytest.approx(0.68e-6, rel=0.01)


# --- conservation --------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_energy_budget_closes(kind, geometry):
    """The error has the order of the stepper, through slip, reversal and lift-off."""
    scene = small(kind)
    errors, switches = [], []
    for share in (0.5, 0.125):
        dt = share * stability_limit(scene)[0]
        how = {"geometry": geometry, "dt": dt, "switching": "step_end"}
        record = simulate(scene, 3e-3, **how, progress=False)
        assert len(record.events) >= 1
        errors.append(budget_error(record))
        switches.append(record.curve["switching_loss"].iloc[-1])
        scale = record.curve["work_driver"].iloc[-1]
        assert record.curve["friction_heat"].iloc[-1] > 1e-3 * scale
    assert errors[-1] < 1e-6 * scale
    assert errors[-1] < errors[0] / 30
    assert all(loss > 0 for loss in switches)


def test_momentum_follows_the_outer_forces():
    """Horizontal momentum changes by the impulse of driver and friction, with the step's order."""
    scene = small("free")
    dt = 0.05 * stability_limit(scene)[0]
    state = loaded_state(scene).state(scene, dt)
    advance(scene, "linear", state, 30_000)
    model = core.model(scene, "linear", state.u_drv0)
    momentum, force = [], []
    for _ in range(41):
        F = core.evaluate(model, state, state.t)
        momentum.append([scene.m * state.y[:, c].sum() for c in (2, 3)])
        force.append([scene.d * F.F_T + F.f.sum(), F.p.sum() - scene.F_N])
        log = advance(scene, "linear", state, 1)
        assert log.n_switch == 0 or len(momentum) > 1
    change = np.gradient(np.array(momentum), dt, axis=0)[2:-2]
    np.testing.assert_allclose(change, np.array(force)[2:-2], atol=2e-3 * np.abs(force).max())


def test_a_stuck_slider_follows_the_static_solution():
    """Driven slowly, the slider passes through the equilibria of `StaticSolver`."""
    scene = setup1(L=0.05, H=0.025, V=0.5e-3)
    for geometry in GEOMETRIES:
        solver = StaticSolver(scene, geometry)
        record = simulate(scene, 0.01, geometry=geometry, progress=False)
        assert len(record.events) == 0
        state = record.final_state
        # The slider lags a little behind the driver: compare at the drive a drift time earlier.
        rest = solver.solve(state.y[0, 0], scene.driver.V * state.t)
        F_T = record.curve["F_T"].iloc[-1]
        assert F_T == pytest.approx(rest.F_T, abs=1e-4 * scene.F_N)
        np.testing.assert_allclose(
            state.y[:, :2], rest.u, rtol=0, atol=1e-3 * np.abs(rest.u - solver.loaded.u).max()
        )


# --- contact -------------------------------------------------------------------------------------


def test_blocks_open_and_land():
    """A high driver lifts the trailing edge: the first block opens, and lands in later events."""
    scene = setup1(L=0.02, H=0.0125, h=0.0125, V=0.5, mattress=1e3)
    record = simulate(scene, 6e-3, geometry="linear", progress=False)
    assert record.status == "complete"
    assert OPEN in record.switches["new"]
    assert OPEN in record.switches["old"]
    p = record.p_after[record.events["finished"].to_numpy()]
    assert (p >= 0).all()


@pytest.mark.parametrize("side", ["left", "right"])
def test_static_values_of_events_balance(side):
    """At rest, before and after every event, sum tau = F_T and moments balance."""
    scene = small(side=side)
    record = simulate(scene, 3e-3, geometry="linear", t_gap=2e-5, progress=False)
    done = record.events["finished"].to_numpy()
    assert done.any()
    for force, tau, p in (
        ("F_T_start", record.tau_before, record.p_before),
        ("F_T_arrest", record.tau_after, record.p_after),
    ):
        F_T = record.events[force].to_numpy()[done]
        np.testing.assert_allclose(tau[done].sum(axis=1), F_T, rtol=0, atol=1e-9 * scene.F_N)
        np.testing.assert_allclose(p[done].sum(axis=1), scene.F_N, rtol=1e-11)


# --- runs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_a_run_in_parts_is_the_whole_run(kind, geometry, tmp_path):
    """Curve, catalogue, logs and state agree bit for bit, also through a file."""
    scene = small(kind)
    whole = simulate(scene, 3e-3, geometry=geometry, sample=1e-5, progress=False)
    part = simulate(scene, 1.3e-3, geometry=geometry, sample=1e-5, progress=False)
    part = Record.load(part.save(tmp_path / "part.nc"))
    part = simulate(scene, 1.3333e-3, initial=part, progress=False)
    rest = simulate(scene, 3e-3, initial=part, progress=False)
    assert len(whole.events) > 0
    assert same_run(rest, whole, status="complete")


@pytest.mark.parametrize("kind", ["rod", "free"])
def test_points_of_the_curve_are_those_of_the_state(kind):
    """The core samples the curve; the last point follows from the last state."""
    scene = small(kind)
    scene = scene.replace({"driver.h_top": scene.driver.h + scene.slider.l})
    record = simulate(scene, 3e-3, sample=1e-5, progress=False)
    apart = record.method.sample * record.method.dt
    assert np.diff(record.curve["t"])[:-1] == pytest.approx(apart, rel=1e-9)
    last, state = record.curve.iloc[-1], record.final_state
    assert last["t"] == state.t
    F_T = scene.driver_force(scene.drive(state.t), scene.u_driven(state.y), state.u_drv0)
    assert last["F_T"] == pytest.approx(F_T, rel=1e-9)
    assert last["friction_heat"] == pytest.approx(state.heat.sum(), rel=1e-12)
    assert last["dissipated_bonds"] == pytest.approx(state.dissipated.sum(), rel=1e-12)
    assert last["work_driver"] == state.work[0]
    assert budget_error(record) < 1e-3
    bare = simulate(scene, 3e-3, sample=1e-5, energies=False, progress=False).curve
    assert bare.equals(record.curve[["t", "F_T"]])


def test_doubling_load_and_speed_doubles_a_whole_run():
    """In linear geometry all results double bit for bit."""
    one, two = small(), small(F_N=7000.0, V=1.0)
    records = [simulate(s, 3e-3, geometry="linear", t_gap=2e-5, progress=False) for s in (one, two)]
    assert records[0].events["finished"].any()
    a, b = (r.curve for r in records)
    np.testing.assert_array_equal(b["t"], a["t"])
    np.testing.assert_array_equal(b["F_T"], 2 * a["F_T"])
    for name in (*core.ENERGIES, *ENERGY_IN, *ENERGY_OUT):
        np.testing.assert_array_equal(b[name], 4 * a[name], err_msg=name)
    a, b = (r.events for r in records)
    for name, factor in (
        ("t_start", 1), ("t_stop", 1), ("F_T_start", 2), ("F_T_arrest", 2), ("L_p_over_L", 1),
        ("first_block", 1), ("last_block", 1), ("n_episodes", 1),
    ):  # fmt: skip
        np.testing.assert_array_equal(b[name], factor * a[name], err_msg=name)
    for name in ("tau_before", "p_before", "tau_after", "p_after", "tau_initial", "p_initial"):
        a, b = (getattr(r, name) for r in records)
        np.testing.assert_array_equal(b, 2 * a, err_msg=name)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_a_run_driven_from_the_right_is_the_mirror_image(kind, geometry):
    """Events agree; forces agree to rounding, because the first sparse solve is not symmetric."""
    left, right = (
        simulate(small(kind, side=side), 3e-3, geometry=geometry, progress=False)
        for side in ("left", "right")
    )
    assert len(left.events) > 0
    np.testing.assert_allclose(right.curve["F_T"], left.curve["F_T"], rtol=0, atol=1e-6)
    for name in ("first_block", "last_block", "nucleation_block", "n_episodes", "n_blocks"):
        np.testing.assert_array_equal(right.events[name], left.events[name])
    np.testing.assert_array_equal(right.region, left.region[:, ::-1])
    np.testing.assert_allclose(right.p_after, left.p_after[:, ::-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(right.tau_after, left.tau_after[:, ::-1], rtol=0, atol=1e-6)


def test_a_state_starts_a_run_of_its_own():
    scene = small()
    first = simulate(scene, 1.5e-3, progress=False)
    second = simulate(scene, 2e-3, initial=first.final_state, progress=False)
    assert second.curve["t"].iloc[0] == first.final_state.t
    assert second.events["t_start"].min() > first.final_state.t
    whole = simulate(scene, 2e-3, progress=False)
    np.testing.assert_array_equal(second.final_state.y, whole.final_state.y)
    finer = simulate(scene, 2e-3, initial=first.final_state, dt=1e-7, progress=False)
    assert finer.final_state.t == pytest.approx(2e-3, abs=1e-7)


def test_record_says_what_was_run(tmp_path):
    scene = small()
    record = simulate(scene, 2e-3, geometry="linear", dt=2e-7, progress=False)
    assert record.method.engine == "dynamic"
    assert record.method.dt == 2e-7
    assert record.method.variant == core.VARIANT
    assert record.versions["pyfric"]
    assert record.timings["per_block_and_step"] > 0
    assert record.curve["t"].iloc[-1] == pytest.approx(2e-3, abs=2e-7)
    assert record.curve["F_T"].iloc[0] == 0
    np.testing.assert_allclose(record.p_initial.sum(), scene.F_N, rtol=1e-11)
    assert Record.load(record.save(tmp_path / "a.nc")) == record


def test_curve_without_budget():
    record = simulate(small(), 1e-4, energies=False, progress=False)
    assert list(record.curve) == ["t", "F_T"]


def test_progress_is_reported():
    seen = []
    simulate(small(), 2e-3, progress=seen.append)
    assert seen[-1].t >= 2e-3
    assert 0 <= seen[-1].t_end - 2e-3 < pyfric.step_size(small())  # the last step passes t_end
    assert seen[-1].events >= 1
    assert seen[-1].rate > 0


def test_a_run_of_no_length():
    record = simulate(small(), 0.0, progress=False)
    assert len(record.curve) == 1
    assert record.status == "complete"


def test_ctrl_c_leaves_a_valid_record():
    """The run stops within half a second, and can be continued."""
    scene = preset("fig1")
    started, pressed = threading.Event(), []

    def press():
        assert started.wait(60)
        time.sleep(0.1)
        pressed.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    before = signal.getsignal(signal.SIGINT)
    record = simulate(scene, 10.0, progress=lambda _: started.set())
    late = time.perf_counter() - pressed[0]
    thread.join()
    assert signal.getsignal(signal.SIGINT) is before
    assert record.status == "interrupted"
    assert late < 0.5
    assert 0 < record.final_state.t < 10
    assert record.curve["t"].iloc[-1] == record.final_state.t
    more = simulate(scene, record.final_state.t + 1e-5, initial=record, progress=False)
    assert more.status == "complete"


def test_checkpoints_can_be_continued(tmp_path):
    scene = small()
    path = tmp_path / "c.nc"
    often = {"checkpoint": path, "checkpoint_every": 1e-2}
    whole = simulate(scene, 3e-3, progress=False, sample=3e-4, **often)
    saved = Record.load(path)
    assert saved.status == "interrupted"
    assert 0 < saved.final_state.t <= whole.final_state.t
    rest = simulate(scene, 3e-3, initial=saved, progress=False, sample=3e-4)
    assert same_run(rest, whole, status="complete")


def test_a_checkpoint_that_cannot_be_written_is_refused(tmp_path):
    for path in (tmp_path / "no folder" / "c.nc", tmp_path, "/dev/null"):
        with pytest.raises(OSError, match=str(path)):
            simulate(small(), 2e-3, progress=False, checkpoint=path)


def test_a_checkpoint_that_fails_later_does_not_end_the_run(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left")

    monkeypatch.setattr(Record, "save", full)
    options = {"checkpoint": tmp_path / "c.nc", "checkpoint_every": 1e-2}
    with pytest.warns(RuntimeWarning, match="was not written") as said:
        record = simulate(small(), 2e-3, progress=False, sample=3e-4, **options)
    assert record.status == "complete"
    assert len(said) == 1


def test_a_run_that_leaves_the_numbers_keeps_what_was_good():
    scene = small()
    record = simulate(scene, 1e-4, progress=False)
    state = record.final_state.copy()
    state.y[2, 2] = 1e200
    with pytest.raises(RunError, match=r"not finite at step .*, t = .*row 3.* limit") as caught:
        simulate(scene, 1e-3, initial=state, progress=False)
    kept = caught.value.record
    assert kept.status.startswith("failed")
    assert np.isfinite(kept.final_state.y).all()
    assert np.isfinite(kept.curve["t"]).all()


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "field", "allowed"),
    [
        ({"dt": 2.1e-6}, "dt", "2e-06 s"),
        ({"dt": 0.0}, "dt", ""),
        ({"dt": float("nan")}, "dt", ""),
        ({"dt": "fast"}, "dt", "auto"),
        ({"t_end": -1.0}, "t_end", ">= 0"),
        ({"t_end": float("inf")}, "t_end", ""),
        ({"t_end": 1e9}, "t_end", "steps"),
        ({"sample": 0.0}, "sample", ""),
        ({"t_gap": -1.0}, "t_gap", ""),
        ({"threads": 0}, "threads", ""),
        ({"threads": 2.5}, "threads", ""),
        ({"threads": True}, "threads", ""),
        ({"geometry": "cubic"}, "geometry", "linear"),
        ({"stepper": "euler"}, "stepper", "rk4"),
        ({"checkpoint_every": 0.0}, "checkpoint_every", ""),
    ],
)
def test_bad_arguments_are_refused(arguments, field, allowed):
    with pytest.raises(SceneError) as caught:
        simulate(preset("fig1"), **{"t_end": 0.1, "progress": False} | arguments)
    assert caught.value.field == field
    assert allowed in str(caught.value)


def test_a_step_above_the_limit_names_it():
    with pytest.raises(SceneError, match=r"dt = 2\.1e-06 s.*2e-06 s.*stability limit of rk46"):
        step_size(preset("fig1"), 2.1e-6)


def test_states_that_do_not_fit_are_refused():
    scene = small()
    record = simulate(scene, 1e-4, progress=False)
    with pytest.raises(StateError, match="not int"):
        simulate(scene, 1e-3, initial=5, progress=False)
    with pytest.raises(StateError, match="another scene"):
        simulate(small(mu_k=0.3), 1e-3, initial=record, progress=False)
    for change, word in (
        (lambda s: s.mode.__setitem__(0, 7), "mode"),
        (lambda s: s.y.__setitem__((0, 1, 0), np.nan), "finite"),
        (lambda s: s.y.__setitem__((0, 2), 1.0), "stuck"),
        (lambda s: s.rod.__setitem__(0, 1.0), "rod"),
        (lambda s: setattr(s, "y", s.y[:, :, :-1].copy()), "y"),
        (lambda s: setattr(s, "memory", s.memory[["t_0"]].astype([("t_0", float)])), "s_0, t_0"),
    ):
        state = record.final_state.copy()
        change(state)
        with pytest.raises(StateError, match=word):
            simulate(scene, 1e-3, initial=state, progress=False)


def test_auto_step_is_a_share_of_the_limit():
    for scene in (preset("fig1"), preset("setup2"), small()):
        for switching, accuracy, share in (
            ("step_end", 1e-5, AUTO_SHARE),
            ("located", 1e-6, AUTO_SHARE),
            ("located", 1e-6 / 64, AUTO_SHARE / 2),
            ("located", 1e-3, LONGEST),
        ):
            dt = step_size(scene, accuracy=accuracy, switching=switching)
            limit, _ = stability_limit(scene, default_stepper(scene, switching))
            assert 0.99 * share * limit < dt <= share * limit


# --- the paper's scene ---------------------------------------------------------------------------


@pytest.fixture(
    scope="module",
    params=[
        pytest.param({"l": 5e-3, "V": 8 * 0.7875e-3}, id="coarse and fast"),
        pytest.param({}, id="as in the paper", marks=pytest.mark.slow),
    ],
)
def fig1_record(request):
    """Run Fig. 1 of the paper up to 0.9 s, in linear geometry, at 0.9 of the stability limit."""
    scene = preset("fig1", **request.param)
    dt = 0.9 * stability_limit(scene)[0]
    t_end = 0.85 * preset("fig1").driver.V / scene.driver.V
    return simulate(
        scene, t_end, geometry="linear", dt=dt, sample=1e-4, energies=False, progress=False
    )


def test_fig1_has_precursors_of_increasing_length(fig1_record):
    """At least 11 main precursors start at the trailing edge, each longer than the previous one."""
    events = fig1_record.events
    main = events[events["is_main"]]
    assert main["is_precursor"].all()
    assert len(main) >= 11
    assert main["at_trailing_edge"].all()
    assert (main["first_block"] == 1).all()
    assert (np.diff(main["L_p_over_L"]) > 0).all()
    assert (main["F_T_arrest"] < main["F_T_start"]).all()
    assert main["F_T_arrest"].iloc[-1] < fig1_record.scene.F_N * 0.5


def test_fig1_slips_from_stuck_blocks_only(fig1_record):
    """Every episode of the record is a slip between two sticks, or opens."""
    assert (fig1_record.episodes["slip"].abs() > 0).all()
    assert STUCK in fig1_record.quiet["mode"]


@pytest.mark.slow
def test_fig1_does_not_hang_on_the_step():
    """A quarter of the stability limit gives the same sequence of main precursors."""
    scene = preset("fig1")
    limit = stability_limit(scene)[0]
    ladders = []
    for share in (0.5, 0.25):
        record = simulate(scene, 0.9, dt=share * limit, energies=False, progress=False)
        main = record.events[record.events["is_main"]]
        ladders.append(main[["L_p_over_L", "F_T_start"]].to_numpy())
    assert len(ladders[0]) == len(ladders[1])
    blocks, force = np.abs(ladders[0] - ladders[1]).max(axis=0) * [scene.N_x, 1 / scene.F_N]
    assert blocks <= 1.5
    assert force < 5e-3


@pytest.mark.parametrize("engine", ["dynamic", "quasistatic"])
def test_a_slider_that_turns_over_has_a_note(engine):
    scene = setup1(L=0.03, H=0.1, h=0.1, F_N=1000.0, V=0.5)
    record = pyfric.simulate(scene, 3e-3, fidelity=engine, progress=False)
    assert sum("turns over" in note for note in record.notes) == 1
    assert (record.switches["new"] == 2).sum() > scene.N_x / 2
    low = scene.replace({"driver.h": 0.01})
    record = pyfric.simulate(low, 3e-3, fidelity=engine, progress=False)
    assert not any("turns over" in note for note in record.notes)


def test_contacts_that_open_are_counted_from_those_at_the_start():
    scene = small()
    log = {"t": np.array([1.0, 2.0]), "old": np.array([0, 2]), "new": np.array([2, 0])}
    mode = np.zeros(scene.N_x, dtype=np.int32)
    assert strains.contact_notes(scene, "dynamic", log, mode) == ()
    mode[: scene.N_x // 2] = OPEN
    (note,) = strains.contact_notes(scene, "dynamic", log, mode)
    assert f"from t = 1 s on {scene.N_x // 2 + 1} of {scene.N_x} blocks" in note


def test_the_budget_of_a_run_from_a_state_counts_from_its_first_point():
    how = {"fidelity": "dynamic", "energies": True, "accuracy": 1e-7, "progress": False}
    first = pyfric.simulate(small(), 1.2e-3, **how)
    second = pyfric.simulate(small(), 1.5e-3, initial=first.final_state, **how)
    assert second.curve["work_driver"].iloc[0] == first.curve["work_driver"].iloc[-1] > 0
    assert analysis.budget_error(second) == analysis.budget_error(second.curve) < 1e-4
    assert not any("budget" in note for note in second.notes)
    assert analysis.budget_error(second.curve.assign(work_driver=0.0)) > 0.1


FROM_STATICS = """
import hashlib
import pyfric
from helpers import small

found = hashlib.sha256()
slips = small(top=pyfric.DistributedLoad(F_N=100.0, T=5.0), mu_s=0.1, mu_k=0.05)
assert pyfric.loaded_state(slips).slipped.any()
for scene, t_end in (
    (small(), 1.6e-3),
    (slips, 2e-4),
    (pyfric.overstressed(small(), x=0.0, length="10 mm", begin=1e-4), 2e-4),
    (pyfric.preset("slow", L="20 mm", H="10 mm"), 2e-4),
    (pyfric.setup1(), 2e-5),
    (pyfric.setup2(), 2e-5),
):
    for geometry in ("finite", "linear"):
        how = {"fidelity": "dynamic", "geometry": geometry, "energies": True, "progress": False}
        record = pyfric.simulate(scene, t_end, **how)
        for values in (record.curve.to_numpy(), *record.switches.values(), record.final_state.y):
            found.update(values.tobytes())
        found.update(record.events.to_csv().encode())
    found.update(str(len(record.switches["t"])).encode())
print(found.hexdigest())
"""


def test_no_kernel_of_blas_changes_a_bit_of_full_dynamics():
    """Loaded states must agree in their last bits: free top, rod, slip, junctions."""
    found = set()
    for kernel in ("Prescott", "Haswell"):
        env = os.environ | {"OPENBLAS_CORETYPE": kernel, "PYTHONPATH": os.path.dirname(__file__)}
        words = [sys.executable, "-c", FROM_STATICS]
        made = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
        if made.returncode < 0:
            pytest.skip(f"this processor has no {kernel}")
        assert made.returncode == 0, made.stderr
        found.add(made.stdout)
    assert len(found) == 1
