"""Steppers other than RK4: order, twin, stability, equal bits, agreement, budgets."""

import dataclasses
import functools
import math

import numpy as np
import pytest
import twin
from helpers import GEOMETRIES, advance, bits, budget_error, log_bits, mirrored_state, shaken, small

import pyfric
from pyfric import core
from pyfric.core import OPEN, STUCK, State
from pyfric.engines import default_stepper, step_size
from pyfric.scene import chain, preset, setup1
from pyfric.statics import dispersion, loaded_state, stability_limit
from pyfric.values import SceneError

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", progress=False, sample=1e-5)

OTHERS = ("rk46", "rk46_waves", "symplectic_euler", "verlet", "adaptive", "imex")
"""Steppers other than RK4, which has its own tests."""
SIX = "rk46", "rk46_waves"
FIXED = {"rtol": 1.0}
"""With this allowed error, adaptive steps are as long as dt."""
EXPLICIT = [name for name, stepper in core.STEPPERS.items() if not stepper.implicit]
WAYS = [(m, s) for m in EXPLICIT for s in ("step_end", "located")]


def wild(scene, geometry="linear", seed=0, speed=1.0):
    """Return a state far from rest in which many contacts switch soon."""
    rng = np.random.default_rng(seed)
    dt = 0.2 * stability_limit(scene)[0]
    state = loaded_state(scene, geometry).state(scene, dt)
    l = scene.slider.l
    state.y[:, :2] += 1e-4 * l * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] += speed * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.mode[:] = np.where(state.y[0, 1] < 0, rng.choice([STUCK, 1, -1], scene.N_x), OPEN)
    slips = np.abs(state.mode) == 1
    state.y[0, 2, slips] = state.mode[slips] * np.abs(state.y[0, 2, slips])
    state.y[0, 2, state.mode == STUCK] = 0
    if scene.rigid:
        state.rod[3:] = speed * rng.standard_normal(3) * [1, 1, 1 / l]
        X, Z, phi, dX, dZ, dphi = state.rod
        one = np.ones(scene.N_x)
        state.y[-1] = X * one, Z + phi * scene.x, dX * one, dZ + dphi * scene.x
    return state


# --- one step, and its order ---------------------------------------------------------------------


@pytest.mark.parametrize("stepper", OTHERS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_one_step_is_that_of_the_twin(kind, geometry, stepper):
    scene = small(kind)
    state = wild(scene, geometry)
    there = {
        "rk46": twin.rk46_step,
        "rk46_waves": twin.rk46_waves_step,
        "symplectic_euler": twin.symplectic_euler_step,
        "verlet": twin.verlet_step,
        "adaptive": twin.rk4_step,
        "imex": twin.imex_step,
    }[stepper](
        scene, geometry, 0.0, state.y, state.rod, state.mode, state.u_drv0, state.dt
    )  # fmt: skip
    before = state.mode.copy()
    advance(scene, geometry, state, 1, stepper=stepper, **FIXED)
    kept = state.mode == before
    y = there[0]
    for c in range(4):
        scale = np.abs(y[:, c]).max()
        close = np.abs(state.y[:, c] - y[:, c]) < 1e-14 * scale
        assert close[1:].all()
        assert close[0][kept].all()
    np.testing.assert_allclose(state.rod, there[1], rtol=1e-13, atol=1e-25)


@pytest.mark.parametrize(
    ("stepper", "order"),
    [("symplectic_euler", 1), ("verlet", 2), ("imex", 3), ("adaptive", 4)],
)
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_order_while_nothing_switches(kind, geometry, stepper, order):
    """State and budget converge at the order of the stepper; the reference is RK4."""
    scene = small(kind, V=1e-3)
    coarse = {"adaptive": 0.2}.get(stepper, 0.05) * stability_limit(scene)[0]
    size = 1e-8
    exact = shaken(scene, geometry, coarse, size)
    exact.dt = coarse / 16
    advance(scene, geometry, exact, 40 * 16)
    ends = []
    for halvings in range(3):
        state = shaken(scene, geometry, coarse, size)
        state.dt = coarse / 2**halvings
        log = advance(scene, geometry, state, 40 * 2**halvings, stepper=stepper, **FIXED)
        assert log.n_switch == 0
        assert log.tried == 40 * 2**halvings
        ends.append(state)
    for names in (("y",), ("dissipated", "work")):
        errors = [max(np.abs(getattr(s, n) - getattr(exact, n)).max() for n in names) for s in ends]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.all(np.abs(orders - order) < 0.3), (names, orders)


@pytest.mark.parametrize("stepper", [name for name in core.STEPPERS if name != "rk46"])
def test_order_of_pure_slip(stepper):
    """All blocks slip in one direction: motion is smooth, and converges to full order."""
    scene = small(mu_s=0.3, mu_k=0.2)
    order = core.STEPPERS[stepper].order
    coarse, ends = 0.2e-6, []
    for halvings in (0, 1, 2, 6):
        state = loaded_state(scene).state(scene, coarse / 2**halvings)
        state.y[:, 2], state.rod[3], state.mode[:] = 20.0, 20.0, 1
        how = {"stepper": "rk4"} if halvings == 6 else {"stepper": stepper}
        log = advance(scene, "linear", state, 30 * 2**halvings, **how, **FIXED)
        assert log.n_switch == 0
        ends.append(np.concatenate([state.y.ravel() / 1e-6, state.heat]))
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - order) < 0.35), orders


# --- six stages ----------------------------------------------------------------------------------

GROWTHS = {
    "rk46": [1 / math.factorial(k) for k in range(7)],
    "rk46_waves": [1, 1, 1 / 2, 1 / 6, 1 / 24, 0.007856772044, 0.000959998595],
}
"""Coefficients of R(z): those of exp(z), and those of Berland, Bogey and Bailly (2006)."""


def left_of_order_4(stepper):
    """Return the residuals of the eight conditions of order 4 and of those of linear motion."""
    a, b, c = stepper.a, stepper.b, stepper.c
    conditions = [
        (b.sum(), 1), (b @ c, 1 / 2), (b @ c**2, 1 / 3), (b @ a @ c, 1 / 6), (b @ c**3, 1 / 4),
        (b @ (c * (a @ c)), 1 / 8), (b @ a @ c**2, 1 / 12), (b @ a @ a @ c, 1 / 24),
    ]  # fmt: skip
    return np.array([found - exact for found, exact in conditions])


@pytest.mark.parametrize("name", SIX)
def test_six_stages_meet_their_conditions(name):
    """Coefficients give order 4 in nonlinear motion, and R(z); an error of 1e-9 is noticed."""
    stepper = core.STEPPERS[name]
    assert np.abs(left_of_order_4(stepper)).max() < 1e-16
    np.testing.assert_allclose(stepper.growth.coef, GROWTHS[name], rtol=1e-10)
    assert (stepper.b > 0).all()
    assert ((stepper.c >= 0) & (stepper.c <= 1)).all()
    for field in ("b", "c"):
        for k in range(1, 6):
            off = getattr(stepper, field).copy()
            off[k] += 1e-9
            a = np.diag(off[1:], -1) if field == "c" else stepper.a
            damaged = core.Stepper(
                name, 4, **{"b": stepper.b, "c": stepper.c, "a": a} | {field: off}
            )
            assert np.abs(left_of_order_4(damaged)).max() > 1e-11, (field, k)


@pytest.mark.parametrize("name", SIX)
def test_order_of_six_stages_in_nonlinear_motion(name):
    """The motion is a pendulum, u'' = -sin u."""
    errors = []
    for steps, stepper in ((80, name), (160, name), (320, name), (40000, "rk4")):
        h, u, v = 6.0 / steps, 2.0, 0.0
        for _ in range(steps):
            u, p = core.STEPPERS[stepper].step(lambda u, p, h=h: -h * h * np.sin(u), u, h * v)
            v = p / h
        errors.append(u)
    errors = np.abs(np.array(errors[:-1]) - errors[-1])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(np.abs(orders - 4) < 0.35), orders


@pytest.mark.parametrize(("name", "order"), [("rk46", 6), ("rk46_waves", 4)])
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_order_of_six_stages_on_the_lattice(kind, name, order):
    """The order is that of states in linear geometry; orders of works and heat are 4 or more."""
    scene = small(kind, V=1e-3)
    coarse = 0.5 * stability_limit(scene)[0]
    exact = shaken(scene, "linear", coarse, 1e-8)
    exact.dt = coarse / 16
    advance(scene, "linear", exact, 40 * 16, stepper="rk46")
    ends = []
    for halvings in range(3):
        state = shaken(scene, "linear", coarse, 1e-8)
        state.dt = coarse / 2**halvings
        assert advance(scene, "linear", state, 40 * 2**halvings, stepper=name).n_switch == 0
        ends.append(state)
    orders = {}
    for names in (("y",), ("dissipated", "work")):
        errors = [max(np.abs(getattr(s, n) - getattr(exact, n)).max() for n in names) for s in ends]
        orders[names[0]] = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders["y"] - order - 0.1) < 0.5), orders
    assert core.STEPPERS[name].linear_order == order
    assert np.all(orders["dissipated"] > 3.6), orders


def test_undamped_motion_grows_in_six_stages_as_said():
    """|R| - 1 is |z|^8/5760 on the imaginary axis; the other stepper is stable up to 3.81."""
    y = np.array([0.2, 0.4, 0.8])
    growth = np.abs(core.STEPPERS["rk46"].growth(1j * y)) - 1
    np.testing.assert_allclose(growth, y**8 / 5760, rtol=0.1)
    assert (
        np.abs(core.STEPPERS["rk46_waves"].growth(1j * np.linspace(0, 3.81, 999))) < 1 + 1e-9
    ).all()
    for eta, name in ((0.0, "rk46_waves"), (None, "rk46")):
        assert default_stepper(preset("fig1", eta=eta)) == name
    assert default_stepper(chain()) == "rk46_waves"


@pytest.mark.parametrize("stepper", ["rk4", *SIX, "imex"])
def test_growth_is_that_of_a_step(stepper):
    stepper = core.STEPPERS[stepper]
    for omega, gamma in ((0.3, 0.1), (1.5, 2.0), (0.1, 0.0)):
        rate = -gamma / 2 + 1j * np.sqrt(omega**2 - gamma**2 / 4 + 0j)
        u, p = stepper.step(lambda u, p, w=omega, g=gamma: -(w**2) * u - g * p, 1.0, rate)
        np.testing.assert_allclose([u, p], stepper.growth(rate) * np.array([1.0, rate]), rtol=1e-13)


# --- the adaptive stepper ------------------------------------------------------------------------


def test_adaptive_error_follows_rtol():
    """Sub-steps are halved to the allowed error, so that the error of the run follows rtol."""
    scene = small("free", V=1e-3)
    dt = stability_limit(scene)[0]
    exact = shaken(scene, "linear", dt, size=1e-6)
    exact.dt = dt / 64
    advance(scene, "linear", exact, 20 * 64)
    errors, tried = [], []
    unit = scene.F_N / scene.N_x / np.sqrt(scene.slider.k * scene.m)
    allowed = 10.0 ** -np.arange(2.0, 9.0)
    for rtol in allowed:
        state = shaken(scene, "linear", dt, size=1e-6)
        log = advance(scene, "linear", state, 20, stepper="adaptive", rtol=rtol)
        errors.append(np.abs(state.y - exact.y)[:, 2:].max() / unit)
        tried.append(log.tried)
    assert (np.diff(tried) >= 0).all()
    assert tried[-1] > 4 * tried[0]
    assert (errors < 20 * allowed).all()
    assert errors[-1] < 1e-4 * errors[0]


def test_adaptive_sub_steps_end_on_the_grid():
    """With dt beyond the limit of RK4, sub-steps are within it, and time is still a step count."""
    scene = small(V=1e-3)
    limit = stability_limit(scene, "adaptive")[0]
    assert limit == stability_limit(scene, "rk4")[0]
    state = shaken(scene, "linear", 0.1 * limit, size=1e-7)
    state.dt = 10 * limit
    log = advance(scene, "linear", state, 50, stepper="adaptive", rtol=1e-4)
    assert (state.step, state.t) == (50, 50 * state.dt)
    assert log.tried > 10 * 50
    assert 0 < state.sub < 2 * limit
    assert np.abs(state.y[:, 2:]).max() < 1.0
    with pytest.raises(SceneError):
        step_size(scene, 10 * limit, "rk4")
    assert step_size(scene, 10 * limit, "adaptive") == 10 * limit


def test_an_error_that_nothing_brings_down_is_a_status():
    scene = small()
    state = wild(scene)
    log = core.Log(scene.N_x)
    model = core.model(scene, "linear", state.u_drv0)
    options = {"stepper": "adaptive", "rtol": 1e-300}
    assert core.advance(model, state, log, 1, **options) == core.Status.TOO_SHORT
    assert 0 <= log.t < state.dt


# --- stability -----------------------------------------------------------------------------------


@pytest.mark.parametrize("stepper", ["symplectic_euler", "verlet", "adaptive"])
@pytest.mark.parametrize("eta", [None, 1e-3])
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_blow_up_is_where_theory_puts_it(kind, eta, stepper):
    """Just below the limit a shaken slider calms down; just above it the motion blows up."""
    scene = preset("fig1" if kind == "rod" else "setup2", eta=eta)
    limit, _ = stability_limit(scene, stepper)
    size = {}
    for share in (0.99, 1.02):
        state = shaken(scene, "linear", share * limit, size=1e-9)
        begin = np.abs(state.y[:, 2:]).max()
        advance(scene, "linear", state, 1000, stepper=stepper, budget=False, rtol=1e300)
        size[share] = np.abs(state.y[:, 2:]).max() / begin
    assert size[0.99] < 3
    assert not size[1.02] < 1e4


@pytest.mark.parametrize("eta", [1e-9, None, 300.0])
def test_limits_of_plane_waves_are_the_analytic_ones(eta):
    """Symplectic Euler has (w h)^2 + 2 g h = 4; both steppers have the limits 2/w and 2/g."""
    scene = preset("fig1", eta=eta)
    grid = np.linspace(0, np.pi, 201) / scene.slider.l
    q = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    w, g = dispersion(scene, q)
    g = g[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.nanmin((np.sqrt(g * g + 4 * w * w) - g) / (w * w))
    assert stability_limit(scene, "symplectic_euler")[0] == pytest.approx(exact, rel=1e-3)
    for stepper in ("symplectic_euler", "verlet"):
        limit = stability_limit(scene, stepper)[0]
        if eta == 1e-9:
            assert limit == pytest.approx(2 / w.max(), rel=1e-4)
        elif eta == 300.0:
            assert limit == pytest.approx(2 / g.max(), rel=0.02)
        assert limit < stability_limit(scene, "rk4")[0]


@pytest.mark.parametrize("stepper", ["symplectic_euler", "verlet"])
@pytest.mark.parametrize("k_f", [None, 1e9])
def test_limits_of_small_lattices_are_exact(stepper, k_f):
    """The spectral radius of the core's step, as a matrix, passes one at the limit.

    A foundation much stiffer than the lattice, which sets the limit, is tried, too.
    """
    scene = setup1(L=0.005, H=0.0025, h=2.5e-3, k_f=k_f, mu_k=0.0)
    limit, info = stability_limit(scene, stepper)
    assert info["exact"]
    radius = {}
    for share in (0.999, 1.001):
        worst = 0.0
        for mode, raised in ((STUCK, False), (STUCK, True), (1, False), (OPEN, True)):
            columns = []
            rest = loaded_state(scene).state(scene, share * limit)
            rest.mode[:] = mode
            if mode == 1:
                rest.y[:, 2], rest.rod[3] = 1.0, 1.0  # so fast that no block stops
            if raised:
                rest.y[:, 1] += 1e-3
                rest.rod[1] += 1e-3
            free = [(0, c, i) for c in ((1, 3) if mode == STUCK else range(4)) for i in range(3)]
            base = rest.copy()
            advance(scene, "linear", base, 1, stepper=stepper)
            size = 1e-9 * np.array([1.0, 1.0, 1 / rest.dt, 1 / rest.dt])
            for where in [*free, *range(6)]:
                state = rest.copy()
                if isinstance(where, tuple):
                    unit = size[where[1]]
                    state.y[where] += unit
                else:
                    unit = size[2 * (where // 3)] / (scene.x[-1] if where % 3 == 2 else 1)
                    state.rod[where] += unit
                    X, Z, phi, *v = state.rod
                    one = np.ones(3)
                    state.y[-1] = X * one, Z + phi * scene.x, v[0] * one, v[1] + v[2] * scene.x
                advance(scene, "linear", state, 1, stepper=stepper)
                dy, drod = state.y - base.y, state.rod - base.rod
                image = [dy[at] / size[at[1]] for at in free]
                arm = np.array([1, 1, scene.x[-1]] * 2)
                image += list(drod * arm / np.repeat(size[[0, 2]], 3))
                columns.append(np.array(image))
            worst = max(worst, np.abs(np.linalg.eigvals(np.array(columns).T)).max())
        radius[share] = worst
    assert radius[0.999] < 1 + 1e-4
    assert radius[1.001] > 1 + 1e-4


def test_steps_above_the_limit_are_refused_by_name():
    scene = preset("fig1")
    for stepper in ("rk4", "verlet", "symplectic_euler"):
        limit = stability_limit(scene, stepper)[0]
        assert step_size(scene, 0.999 * limit, stepper) == 0.999 * limit
        assert 0.4 * limit < step_size(scene, "auto", stepper) <= 0.5 * limit
        with pytest.raises(SceneError, match=f"stability limit of {stepper}"):
            simulate(scene, 1e-3, stepper=stepper, dt=1.001 * limit)
    with pytest.raises(ValueError, match="'verlet'"):
        stability_limit(scene, "leapfrog")


# --- the same bits -------------------------------------------------------------------------------


@pytest.mark.parametrize(("stepper", "switching"), WAYS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_threads_variants_and_cuts_do_not_change_a_bit(geometry, stepper, switching):
    scene = setup1(L=0.04, H=0.0175, V=0.5)
    begin = wild(scene, geometry)
    how = {"stepper": stepper, "switching": switching, "rtol": 1e-3}
    reference = begin.copy()
    log = advance(scene, geometry, reference, 30, **how)
    assert log.n_switch > 5
    others = [{"threads": 3}]
    others += [{"variant": name, "threads": 2} for name, runs in core.variants().items() if runs]
    for options in others:
        state = begin.copy()
        again = advance(scene, geometry, state, 30, **how, **options)
        assert bits(state) == bits(reference), options
        assert log_bits(again) == log_bits(log), options
    state, logs = begin.copy(), []
    for n in (1, 16, 0, 13):
        logs.append(advance(scene, geometry, state, n, **how).switches())
    assert bits(state) == bits(reference)
    for name, column in log.switches().items():
        np.testing.assert_array_equal(np.concatenate([one[name] for one in logs]), column)


@pytest.mark.parametrize(("stepper", "switching"), WAYS)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_mirror_image(kind, stepper, switching):
    left, right = small(kind), small(kind, side="right")
    how = {"stepper": stepper, "switching": switching, "rtol": 1e-3}
    state = wild(left)
    image = mirrored_state(state)
    log = advance(left, "linear", state, 300, **how)
    log_image = advance(right, "linear", image, 300, **how)
    assert log.n_switch == log_image.n_switch > 5
    back = mirrored_state(image)
    for name in ("y", "rod", "mode", "corner", "margin", "loss", "heat", "work", "sub"):
        np.testing.assert_array_equal(getattr(back, name), getattr(state, name), err_msg=name)
    np.testing.assert_array_equal(np.sort(log.switches()["t"]), np.sort(log_image.switches()["t"]))


@pytest.mark.parametrize(("stepper", "switching"), WAYS)
def test_doubling_load_and_speed_doubles_every_bit(stepper, switching):
    one, two = small(), small(F_N=7000.0, V=1.0)
    how = {"stepper": stepper, "switching": switching, "rtol": 1e-3}
    state = wild(one)
    double = state.copy()
    for name in ("y", "rod", "margin", "u_drv0"):
        setattr(double, name, 2 * getattr(state, name))
    log, log_double = (
        advance(s, "linear", x, 300, **how) for s, x in ((one, state), (two, double))
    )
    assert log.n_switch > 5
    for name, factor in (
        ("y", 2), ("rod", 2), ("mode", 1), ("corner", 1), ("margin", 2), ("loss", 4),
        ("dissipated", 4), ("heat", 4), ("work", 4), ("sub", 1),
    ):  # fmt: skip
        np.testing.assert_array_equal(getattr(double, name), factor * getattr(state, name))
    np.testing.assert_array_equal(log_double.switches()["t"], log.switches()["t"])
    assert log_double.tried == log.tried


# --- runs ----------------------------------------------------------------------------------------


EVENTS = {"geometry": "linear", "t_gap": 2e-5, "energies": False}


@pytest.fixture(scope="module")
def reference():
    return simulate(small(), 2.5e-3, **EVENTS, dt=0.02e-6, switching="located")


@pytest.mark.parametrize(
    ("stepper", "switching", "dt", "error"),
    [
        ("rk4", "located", 0.4e-6, 1e-6),
        ("rk46", "located", 0.6e-6, 1e-7),
        ("rk46_waves", "located", 0.6e-6, 1e-6),
        ("verlet", "located", 0.1e-6, 1e-5),
        ("symplectic_euler", "located", 0.02e-6, 1e-3),
        ("adaptive", "located", 1.0e-6, 1e-4),
        ("rk4", "step_end", 0.05e-6, 1e-3),
        pytest.param("verlet", "step_end", 0.05e-6, 1e-3, marks=pytest.mark.slow),
        pytest.param("symplectic_euler", "step_end", 0.02e-6, 1e-3, marks=pytest.mark.slow),
        pytest.param("adaptive", "step_end", 0.05e-6, 1e-3, marks=pytest.mark.slow),
    ],
)
def test_every_method_tends_to_the_same_run(stepper, switching, dt, error, reference):
    """Events have the blocks of the reference, and its forces within `error` F_N."""
    how = {"rtol": 1e-5} if stepper == "adaptive" else {}
    record = simulate(small(), 2.5e-3, **EVENTS, stepper=stepper, switching=switching, dt=dt, **how)
    assert (record.method.stepper, record.method.switching) == (stepper, switching)
    assert record.method.rtol == how.get("rtol")
    per_step = core.STEPPERS[stepper].evaluations * 9 * 6
    assert record.counts["block_evaluations"] >= per_step * record.counts["steps"]
    a, b = record.events, reference.events
    assert len(b) >= 2
    for name in ("first_block", "last_block"):
        np.testing.assert_array_equal(a[name], b[name])
    for name in ("F_T_start", "F_T_arrest"):
        difference = np.abs(a[name] - b[name]) / record.scene.F_N
        assert np.nanmax(difference) < error, name


@pytest.mark.parametrize(
    ("stepper", "least"),
    [("verlet", 1.8), ("symplectic_euler", 0.8), ("adaptive", 3.5), ("rk46_waves", 3.5)],
)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_energy_budget_closes(geometry, stepper, least):
    """The error has the order of the stepper, with located slip, reversal and lift-off."""
    errors = []
    for dt in (0.4e-6, 0.2e-6):
        how = {"rtol": 1.0} if stepper == "adaptive" else {}
        record = simulate(
            small(), 1.4e-3, geometry=geometry, stepper=stepper, switching="located", dt=dt, **how
        )
        curve = record.curve
        scale = curve["work_driver"].iloc[-1]
        assert curve["friction_heat"].iloc[-1] > 0.05 * scale
        assert curve["switching_loss"].iloc[-1] < 1e-20 * scale
        errors.append(budget_error(record) / scale)
    assert np.log2(errors[0] / errors[1]) > least, errors
    assert errors[1] < 0.03


def test_a_record_goes_on_with_its_own_method(tmp_path):
    how = {"stepper": "adaptive", "switching": "located", "rtol": 1e-4, "dt": 2e-6, "sample": 1e-5}
    whole = simulate(small(), 1.5e-3, **how)
    part = simulate(small(), 1.15e-3, **how)
    part = pyfric.Record.load(part.save(tmp_path / "part.nc"))
    assert part.method == dataclasses.replace(whole.method, sample=part.method.sample)
    rest = simulate(small(), 1.5e-3, initial=part)
    assert rest.method == whole.method
    drop = {"timings": {}}
    assert dataclasses.replace(rest, **drop) == dataclasses.replace(whole, **drop)
    state = whole.final_state
    assert State.load(state.save(tmp_path / "s.npz")).sub == state.sub > 0


def test_plans_keep_the_method_that_was_asked_for():
    record = pyfric.simulate(small(), 2e-4, stepper="verlet", tolerance=0.5, progress=False)
    assert (record.method.engine, record.method.stepper) == ("dynamic", "verlet")
    record = pyfric.simulate(small(), 2e-4, switching="located", tolerance=0.5, progress=False)
    assert (record.method.engine, record.method.switching) == ("dynamic", "located")


@pytest.mark.parametrize(
    ("fidelity", "options", "field", "allowed"),
    [
        ("dynamic", {"switching": "never"}, "switching", "'step_end' or 'located'"),
        ("dynamic", {"switching": 3}, "switching", "'located'"),
        ("dynamic", {"stepper": "rk45"}, "stepper", "'adaptive'"),
        ("dynamic", {"rtol": 1e-3}, "rtol", "stepper = 'adaptive'"),
        ("dynamic", {"stepper": "adaptive", "rtol": 0.0}, "rtol", ">="),
        ("dynamic", {"stepper": "adaptive", "rtol": float("nan")}, "rtol", "finite"),
        ("hybrid", {"stepper": "verlet"}, "stepper", "'imex', or fidelity = 'dynamic'"),
        ("quasistatic", {"stepper": "verlet"}, "stepper", "makes no time steps"),
        ("quasistatic", {"switching": "located"}, "switching", "makes no time steps"),
    ],
)
def test_refused_options(fidelity, options, field, allowed):
    with pytest.raises(SceneError) as refusal:
        pyfric.simulate(small(), 1e-4, fidelity=fidelity, progress=False, **options)
    assert refusal.value.field == field
    assert allowed in str(refusal.value)


def test_the_chain_runs_with_every_method():
    scene = chain(L=0.03, V=0.05, tau=30.0)
    ends = [
        simulate(scene, 5e-4, stepper=m, switching=s, dt=0.1e-6).curve["F_T"].iloc[-1]
        for m, s in WAYS
    ]
    assert np.ptp(ends) < 2e-3 * scene.F_N
