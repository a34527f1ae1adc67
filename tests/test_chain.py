"""The chain, N_z = 1: scenes, forces, statics, fronts and whole runs."""

import dataclasses
import functools
import math
import tomllib

import numpy as np
import pytest
import scipy.linalg
import tomli_w
import twin
from click.testing import CliRunner
from helpers import ENERGY_IN, ENERGY_OUT, budget_error, operators, refused
from hypothesis import given, settings
from hypothesis import strategies as st

import pyfric
from pyfric import core
from pyfric.cli.commands import main
from pyfric.cli.shared import Exit
from pyfric.core import STUCK
from pyfric.figures import fig1b
from pyfric.record import Record
from pyfric.scene import PrescribedLoad, Scene, Slider, chain, preset, setup2
from pyfric.scene.presets import settings as names_of
from pyfric.statics import StaticSolver, loaded_state, stability_limit, stiffness
from pyfric.statics.stability import least_limit
from pyfric.values import SceneError
from pyfric.values.checked import MAX_LISTED

simulate = functools.partial(pyfric.simulate, fidelity="dynamic", sample=1e-5)  # few points

N = 13
TAU = tuple(20 * np.cos(np.arange(N)))
P = tuple(60 + 10 * np.sin(np.arange(N)))


def small(factor=1.0, **changes):
    """Return a chain with uneven forces that slips within a millisecond; `factor` scales forces."""
    forces = {"p": tuple(factor * p for p in P), "tau": tuple(factor * tau for tau in TAU)}
    rest = {"L": (N - 1) * 2.5e-3, "k_top": 2e7, "V": factor * 0.02}
    return chain(**forces | rest | changes)


def shaken(scene, seed=0):
    """Return a state away from rest in which blocks are stuck and slip either way."""
    rng = np.random.default_rng(seed)
    state = loaded_state(scene).state(scene, 0.2 * stability_limit(scene)[0])
    size = scene.F_N / scene.N_x / scene.slider.k
    state.y[0, :2] += 0.3 * size * rng.standard_normal((2, scene.N_x))
    state.y[0, 2:] += 1e5 * size * rng.standard_normal((2, scene.N_x))
    state.mode[:] = np.resize([STUCK, 1, -1], scene.N_x)
    state.y[0, 2, state.mode == STUCK] = 0
    return state


def advance(scene, state, n, **options):
    log = core.Log(scene.N_x)
    model = core.model(scene, "linear", state.u_drv0)
    assert core.advance(model, state, log, n, **options) == core.Status.DONE
    return log


# --- scenes --------------------------------------------------------------------------------------


def test_the_preset_is_setup_1_in_one_row():
    scene = preset("chain")
    assert (scene.N_x, scene.N_z, scene.j_h, scene.rigid) == (57, 1, 0, False)
    assert scene.slider == Slider(L=0.14, H=0.0, l=2.5e-3, k=540e6, M=0.0756)
    assert scene.F_N == pytest.approx(3500.0, rel=1e-15)
    assert scene.m == 0.0756 / 57
    np.testing.assert_array_equal(scene.load, 3500.0 / 57)
    assert not scene.shear.any()
    fine = chain(l=1.25e-3)
    assert (fine.slider.k, fine.F_N) == (2 * scene.slider.k, pytest.approx(3500.0, rel=1e-15))
    assert chain(L=0.2, k=1e6, M=0.1, p=3.0).slider == Slider(L=0.2, H=0.0, l=2.5e-3, k=1e6, M=0.1)


@pytest.mark.parametrize("side", ["left", "right"])
def test_forces_run_from_the_trailing_edge(side):
    scene = small(side=side)
    order = slice(None) if side == "left" else slice(None, None, -1)
    np.testing.assert_array_equal(scene.load[order], P)
    np.testing.assert_array_equal(scene.d * scene.shear[order], TAU)
    assert scene.F_N == pytest.approx(sum(P))
    at_start = loaded_state(scene)
    np.testing.assert_array_equal(at_start.tau[order], TAU)
    np.testing.assert_allclose(at_start.p[order], P, rtol=1e-15)
    assert at_start.F_T == 0
    assert not at_start.u[0, 0].any()


def test_scenes_are_hashable_and_lists_become_tuples():
    scene = small(p=np.array(P), tau=list(TAU))
    assert scene == small()
    assert hash(scene) == hash(small())
    assert (type(scene.top.p), type(scene.top.p[0])) == (tuple, float)


def test_lists_in_files_have_units(tmp_path):
    text = small(name="uneven").to_toml(tmp_path / "a.toml")
    document = tomllib.loads(text)
    assert document["top"]["p"][0] == "60.0 N"
    document["top"]["p"] = ["0.06 kN", *document["top"]["p"][1:]]
    assert Scene.from_toml(tomli_w.dumps(document)) == small(name="uneven")
    document["top"] |= {"p": "60 N", "tau": "0.01 kN"}
    assert Scene.from_toml(tomli_w.dumps(document)).top == PrescribedLoad(p=60, tau=10, k_top=2e7)
    for broken, text in (
        (["60 N"] * 12, "12 numbers"),
        (["60 N"] * 12 + ["60"], "block 13: missing unit"),
        ([60.0] * 12 + ["60"], "block 13: missing unit"),
        (["60 N"] * 12 + ["60 m"], "block 13: wrong unit"),
        (["60 N"] * 12 + ["-60 N"], "block 13: too small"),
        (["60 N"] * 12 + [["60 N"]], "block 13: a number is needed, not list"),
    ):
        document["top"]["p"] = broken
        refused(lambda: Scene.from_toml(tomli_w.dumps(document)), "top.p", text)


def test_the_largest_lists_fit_into_a_file():
    p = tuple(np.nextafter(1.2345e-10, 1) + 1e-20 * np.arange(MAX_LISTED))
    scene = chain(L=(MAX_LISTED - 1) * 1e-3, l=1e-3, p=p, tau=tuple(-0.1 * np.array(p)))
    assert Scene.from_toml(scene.to_toml()) == scene
    refused(lambda: chain(p=(1.0,) * (MAX_LISTED + 1)), "top.p", "too many")


@pytest.mark.parametrize(
    ("changes", "field", "texts"),
    [
        ({"p": 0.0}, "top.p", ["> 0 N, or a list of N_x of them"]),
        ({"p": (1.0,) * 12}, "top.p", ["13 of them", "12 numbers"]),
        ({"p": ()}, "top.p", ["0 numbers"]),
        ({"p": (1.0,) * 12 + (0.0,), "tau": 0.0}, "top.p", ["block 13: too small"]),
        ({"p": (1.0,) * 12 + (True,)}, "top.p", ["block 13: a number is needed"]),
        ({"p": [[1.0], [1.0, 2.0]]}, "top.p", ["block 1: a number is needed, not list"]),
        ({"p": np.array(1.0)}, "top.p", ["a number is needed, not ndarray"]),
        ({"p": np.ones((13, 1))}, "top.p", ["block 1"]),
        ({"tau": (0.0,) * 12 + (float("nan"),)}, "top.tau", ["block 13: not a finite number"]),
        ({"tau": (0.0,) * 3 + (-60.0,) + (0.0,) * 9}, "top.tau", ["block 4", "mu_s p = 42.98"]),
        ({"p": 10.0, "tau": 7.1}, "top.tau", ["block 1", "mu_s p = 7.0 N"]),
        ({"k_top": -1.0}, "top.k_top", [">= 0 N/m"]),
    ],
)
def test_refused_forces(changes, field, texts):
    refused(lambda: small(**changes), field, *texts)


def test_chains_and_lattices_do_not_mix():
    one, two = small(), setup2()
    replace = dataclasses.replace
    refused(lambda: replace(two, top=PrescribedLoad(p=(1.0,) * 13)), "top.p", "101 of them")
    refused(lambda: replace(one, top=two.top), "slider.H", value=0.0, unit="m", within=(0.0025, 0))
    driver = replace(one.driver, h=2.5e-3)
    refused(lambda: replace(one, driver=driver), "driver.h", value=0.0025, unit="m", within=(0,))


def test_finite_geometry_is_refused():
    scene = small()
    for call in (
        lambda: simulate(scene, 1e-3, geometry="finite"),
        lambda: StaticSolver(scene, "finite"),
        lambda: core.model(scene, "finite", 0.0),
    ):
        refused(call, "geometry", "a chain has linear geometry only")
    done = CliRunner().invoke(main, ["run", "chain", "--t-end", "1 ms", "--geometry", "finite"])
    assert done.exit_code == Exit.BAD_INPUT
    assert "linear geometry only" in done.stderr


def accepted_or_refused(call):
    try:
        scene = call()
    except SceneError as error:
        assert str(error)
        assert repr(error)
        return
    assert (scene.N_z, scene.j_h) == (1, 0)
    assert 0 < scene.F_N < np.inf
    if scene.N_x < 10_000:
        assert (np.abs(scene.shear) <= scene.interface.mu_s * scene.load).all()
    assert Scene.from_toml(scene.to_toml()) == scene


numbers = (
    st.floats()
    | st.integers()
    | st.none()
    | st.booleans()
    | st.text(max_size=4)
    | st.builds(np.float32, st.floats(width=32))
    | st.sampled_from([0.0, 1.0, -1.0, 10.0, 1e-320, 1e300, 10**400, 1j])
)
forces = (
    numbers | st.lists(numbers, max_size=4) | st.lists(st.floats(-50, 70), min_size=13, max_size=13)
)


@settings(max_examples=100)
@given(
    st.dictionaries(
        st.sampled_from(names_of("chain")),
        forces | st.builds(np.array, st.lists(st.floats(0.1, 70), min_size=13, max_size=13)),
        min_size=1,
        max_size=3,
    )
)
def test_broken_arguments(changes):
    accepted_or_refused(lambda: small(**changes))


texts = st.sampled_from(["1 N", "60 N", "-60 N", "nan N", "1 kN", "N", "1", "1 m", "", "1e999 N"])
entries = texts | st.integers() | st.floats() | st.booleans() | st.dictionaries(texts, texts)


@settings(max_examples=100)
@given(
    key=st.sampled_from([("top", name) for name in ("kind", "p", "tau", "k_top", "F_N")]
                        + [("slider", "H"), ("slider", "L"), ("driver", "h"), ("driver", "side")]),
    value=entries | st.lists(entries, max_size=4) | st.lists(texts, min_size=13, max_size=13)
    | st.sampled_from(["rod", "distributed", "prescribed", "0 m", "2.5 mm"]),
    drop=st.booleans(),
)  # fmt: skip
def test_broken_documents(key, value, drop):
    document = tomllib.loads(small().to_toml())
    section, name = key
    if drop:
        document[section].pop(name, None)
    else:
        document[section][name] = value
    accepted_or_refused(lambda: Scene.from_toml(tomli_w.dumps(document)))


# --- forces and matrices -------------------------------------------------------------------------

SCENES = [
    small(),
    small(side="right"),
    chain(L=5e-3, tau=9.0, K=1e9),
    small(k_top=0.0, eta=0.0),
    small(d_c=1e-6),
]


@pytest.mark.parametrize("scene", SCENES)
def test_forces_and_energies_are_those_of_the_twin(scene):
    state, t = shaken(scene), 1e-4
    model = core.model(scene, "linear", state.u_drv0)
    here = core.evaluate(model, state, t)
    now = state.y, state.rod, state.mode, state.u_drv0, state.slip
    there = twin.right_hand_side(scene, "linear", t, *now)
    for a, b in (
        (here.a, there.dydt[:, 2:]), (here.f, there.f), (here.p, there.p), (here.F_T, there.F_T),
        ([here.dissipated.sum(), here.heat.sum(), *here.work], list(there.rates.values())),
    ):  # fmt: skip
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-14 * np.abs(b).max())
    here = core.energies(model, state, t)
    there = twin.energies(scene, "linear", state.y, state.rod, t, state.u_drv0)
    assert here["kinetic_blocks"] == pytest.approx(there["kinetic_blocks"], rel=1e-14)
    for name in ("bonds", "foundation", "mattress", "driver"):
        assert here[f"elastic_{name}"] == pytest.approx(there[name], rel=1e-13)


@pytest.mark.parametrize("scene", SCENES)
def test_runs_make_the_switches_of_the_twin(scene):
    state = shaken(scene)
    start = state.copy()
    made = advance(scene, state, 150).switches()
    there = twin.run(
        scene,
        "linear",
        start.y,
        start.rod,
        start.mode,
        start.u_drv0,
        start.dt,
        150,
        slip=start.slip,
    )
    columns = (made[name].tolist() for name in ("step", "block", "old", "new"))
    rows = list(zip(*columns, strict=True))
    assert rows == there.switches
    assert rows
    for c in range(4):
        scale = np.abs(there.y[:, c]).max()
        np.testing.assert_allclose(state.y[:, c], there.y[:, c], rtol=0, atol=1e-11 * scale)
    works = [state.dissipated.sum(), state.heat.sum(), *state.work, state.loss.sum()]
    np.testing.assert_allclose(works, list(there.works.values()), rtol=1e-11, atol=1e-25)


def tridiagonal(scene, driver=True):
    """Return bands (3, N_x): k (2 u_i - u_i-1 - u_i+1) + k_top u_i, and K at the driven block."""
    k, n = scene.slider.k, scene.N_x
    bands = np.full((3, n), -k)
    bands[1] = 2 * k + scene.k_top
    bands[1, [0, -1]] -= k
    if driver:
        bands[1, scene.i_h] += scene.driver.K
    return bands


def dense(bands):
    return np.diag(bands[1]) + np.diag(bands[0, 1:], 1) + np.diag(bands[2, :-1], -1)


@pytest.mark.parametrize("driver", [True, False])
def test_the_stiffness_is_tridiagonal(driver):
    scene = small(side="right")
    K = stiffness(scene, driver=driver).toarray()
    np.testing.assert_allclose(K[:N, :N], dense(tridiagonal(scene, driver)), rtol=1e-14, atol=1e-6)
    np.testing.assert_array_equal(K[N:, N:], scene.k_f * np.eye(N))
    assert not K[:N, N:].any()


@pytest.mark.parametrize(("k_f", "K"), [(None, 4e6), (1e10, 5e9)])
@pytest.mark.parametrize("eta", [0.0, None, 5e3])
@pytest.mark.parametrize("k_top", [0.0, 2e7, 5e9])
def test_stability_limit(eta, k_top, k_f, K):
    """The limit is at most 3 % below, and never above, that of 40 blocks by all eigenvalues."""
    scene = chain(L=39 * 2.5e-3, eta=eta, k_top=k_top, k_f=k_f, K=K)
    exact = np.inf
    for closed in (True, False):
        M, stiff, C = operators(scene, closed=np.full(40, closed))
        for first in (0, 40):
            a, b = (-(A.toarray() / M[:, None])[first:, first:] for A in (stiff, C))
            n = len(a)
            z = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [a, b]]))
            z = z[np.abs(z) > 1e-4]
            exact = min(exact, least_limit(core.STEPPERS["rk4"], z)[0])
    limit = stability_limit(scene)[0]
    assert 0.97 * exact < limit < exact * (1 + 1e-6)


# --- statics -------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_stuck_chain_balances(side):
    scene = small(side=side)
    rng = np.random.default_rng(1)
    u_x, drive = 1e-7 * rng.standard_normal(N), 3e-6
    rest = StaticSolver(scene).solve(u_x, drive)
    pull = dense(tridiagonal(scene)) @ u_x - scene.shear
    pull[scene.i_h] -= scene.d * scene.driver.K * drive
    np.testing.assert_allclose(rest.f, pull, rtol=0, atol=1e-11 * np.abs(pull).max())
    total = rest.F_T + sum(TAU) - scene.k_top * scene.d * u_x.sum()
    assert rest.tau.sum() == pytest.approx(total, rel=1e-12)
    np.testing.assert_array_equal(rest.p, loaded_state(scene).p)


@pytest.mark.parametrize("side", ["left", "right"])
def test_blocks_without_friction_are_the_tridiagonal_solve(side):
    scene = small(side=side)
    free = np.zeros(N, dtype=bool)
    free[3:9] = True
    u_x, drive = 1e-7 * np.random.default_rng(2).standard_normal(N), 3e-6
    rest = StaticSolver(scene).solve(u_x, drive, free=free)
    right = scene.shear[3:9].copy()
    right[0] += scene.slider.k * u_x[2]
    right[-1] += scene.slider.k * u_x[9]
    inside = scipy.linalg.solve_banded((1, 1), tridiagonal(scene)[:, 3:9], right)
    np.testing.assert_allclose(rest.u[0, 0, 3:9], inside, rtol=1e-12)
    np.testing.assert_array_equal(rest.u[0, 0, ~free], u_x[~free])
    assert not rest.open.any()
    assert not rest.f[free].any()


def test_the_top_screens_the_driver():
    """Without friction u falls by a factor r from block to block, r + 1/r = 2 + k_top/k."""
    scene = chain(k_top=54e6, L=0.25)
    rest = StaticSolver(scene).solve(np.zeros(101), 1e-5, free=np.ones(101, dtype=bool))
    u = rest.u[0, 0]
    r = 1.05 - np.sqrt(1.05**2 - 1)
    np.testing.assert_allclose(u[1:50] / u[:49], r, rtol=1e-9)
    assert rest.F_T == pytest.approx(scene.k_top * u.sum(), rel=1e-12)


# --- fronts --------------------------------------------------------------------------------------


def front_speed(taubar, eta, share, switching="located"):
    """Return the speed of a front, in blocks per sqrt(m/k), and the record.

    The first 20 of 300 blocks are released at once: the run starts from the loaded state with
    their contacts at "slips to the right", so that at t = 0 their friction falls from tau to
    mu_k p. K and V are negligible. The speed is the slope of a straight line through block number
    against rupture time over blocks 150 to 300. `share` is the step over the time from block to
    block. If contacts switch at step ends, a block is released up to one step late. The front then
    takes a whole number of steps per block, and is slower than the exact front by at most `share`.
    """
    mu_s, mu_k, p, n, released = 0.7, 0.45, 10.0, 300, 20
    tau = p * (mu_k + taubar * (mu_s - mu_k))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tau, eta=eta, K=1e-3, V=0.0)
    unit = np.sqrt(scene.m / scene.slider.k)
    guess = UNDAMPED[taubar] if eta == 0 else DAMPED[taubar]
    state = loaded_state(scene).state(scene, share * unit / guess)
    state.mode[:released] = 1
    t_end = 1.05 * (n - released) * unit / guess
    record = simulate(
        scene,
        t_end,
        dt=state.dt,
        initial=state,
        switching=switching,
        energies=eta is None,
        t_gap=1.0,
        progress=False,
    )
    assert record.events["first_block"].tolist() == [1]
    times = record.rupture_times[0]
    assert np.isnan(times[:released]).all()  # no front has passed these blocks
    assert np.isfinite(times[released:]).all()
    return np.polyfit(times[n // 2 :], np.arange(n // 2, n), 1)[0] * unit, record


UNDAMPED = {taubar: 1 / np.sqrt(1 - taubar**2) for taubar in (0.3, 0.5, 0.7, 0.9)}
DAMPED = {0.5: 1.41, 0.7: 1.92, 0.9: 4.24}


@pytest.mark.parametrize("taubar", UNDAMPED)
def test_speed_of_undamped_fronts(taubar):
    """v_c/c = 1/sqrt(1 - taubar^2), taubar = (tau/p - mu_k)/(mu_s - mu_k)."""
    speed, _ = front_speed(taubar, 0.0, share=0.097)
    assert abs(speed / UNDAMPED[taubar] - 1) < 1e-4


@pytest.mark.slow
def test_speed_of_fronts_that_switch_at_step_ends():
    share = 4e-3
    speed, _ = front_speed(0.9, 0.0, share, "step_end")
    assert -share < speed / UNDAMPED[0.9] - 1 < 1e-4


@pytest.mark.parametrize("taubar", DAMPED)
def test_speed_of_damped_fronts(taubar):
    speed, record = front_speed(taubar, None, share=0.04)
    assert speed == pytest.approx(DAMPED[taubar], rel=0.01)
    assert budget_error(record) < 1e-6 * record.curve["work_load"].iloc[-1]


# --- whole runs ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def record():
    return simulate(small(), 4e-3, t_gap=2e-5, progress=False)


def test_energy_budget_closes():
    """The error has the order of the stepper, with all terms of the budget present."""
    errors = []
    for share in (0.3, 0.15, 0.075):
        dt = share * stability_limit(small())[0]
        record = simulate(small(), 4e-3, dt=dt, switching="step_end", sample=1e-6, progress=False)
        errors.append(budget_error(record))
    last = record.curve.iloc[-1]
    for name in ("elastic_mattress", *ENERGY_IN, *ENERGY_OUT):
        assert abs(last[name]) > 10 * errors[-1], name
    assert errors[-1] < 1e-6 * last["friction_heat"]
    assert errors[-1] < errors[0] / 30


def test_static_values_of_events_balance(record):
    scene = record.scene
    done = record.events[record.events["finished"]]
    assert len(done) > 3
    rows = done.index - 1
    for tau, F_T, row in (
        (record.tau_before, "F_T_start", "quiet_start"),
        (record.tau_after, "F_T_arrest", "quiet_stop"),
    ):
        u = record.quiet["u_x"][done[row]]
        total = done[F_T] + sum(TAU) - scene.k_top * u.sum(axis=1)
        np.testing.assert_allclose(tau[rows].sum(axis=1), total, rtol=1e-9)
    np.testing.assert_allclose(record.p_after[rows], np.tile(P, (len(done), 1)), rtol=1e-12)
    np.testing.assert_array_equal(record.tau_initial, TAU)


def test_doubling_all_forces_doubles_every_bit(record):
    double = simulate(small(2.0), 4e-3, t_gap=2e-5, progress=False)
    assert len(record.events) > 3
    for name in record.curve:
        factor = {"t": 1, "F_T": 2}.get(name, 4)
        np.testing.assert_array_equal(double.curve[name], factor * record.curve[name])
    for name in ("tau_before", "p_before", "tau_after", "p_after", "tau_initial", "p_initial"):
        np.testing.assert_array_equal(getattr(double, name), 2 * getattr(record, name))
    np.testing.assert_array_equal(double.rupture_times, record.rupture_times)
    for name, factor in (("y", 2), ("mode", 1), ("heat", 4), ("loss", 4), ("margin", 2)):
        there, here = getattr(double.final_state, name), getattr(record.final_state, name)
        np.testing.assert_array_equal(there, factor * here)


def test_a_mirrored_scene_gives_the_mirrored_bits(record):
    image = simulate(small(side="right"), 4e-3, t_gap=2e-5, progress=False)
    np.testing.assert_array_equal(
        image.curve.drop(columns=BY_COLUMN), record.curve.drop(columns=BY_COLUMN)
    )
    for name in BY_COLUMN:  # added from left to right
        np.testing.assert_allclose(image.curve[name], record.curve[name], rtol=1e-12, atol=1e-20)
    for name in ("t_start", "t_stop", "first_block", "last_block", "nucleation_block"):
        np.testing.assert_array_equal(image.events[name], record.events[name])
    flip = np.array([-1, 1, -1, 1])[None, :, None]
    np.testing.assert_array_equal(image.final_state.y[:, :, ::-1], flip * record.final_state.y)
    np.testing.assert_array_equal(image.tau_after[:, ::-1], record.tau_after)


BY_COLUMN = ["kinetic_blocks", "elastic_bonds", "elastic_foundation", "elastic_mattress"]
BY_COLUMN += ["dissipated_bonds"]


def test_a_run_in_parts_is_the_whole_run(record, tmp_path):
    """Parts give the same bits, also through a file, on more threads and in every variant."""
    sample = record.method.sample * record.method.dt
    part = simulate(small(), 1.3e-3, t_gap=2e-5, sample=sample, threads=3, progress=False)
    part = Record.load(part.save(tmp_path / "part.nc"))
    assert part.scene == record.scene
    rest = simulate(small(), 4e-3, initial=part, progress=False)
    rest = dataclasses.replace(rest, timings=record.timings)
    assert rest == record
    start = shaken(small())
    reference = start.copy()
    advance(small(), reference, 60)
    for name, runs in core.variants().items():
        if runs:
            state = start.copy()
            advance(small(), state, 60, threads=2, variant=name)
            np.testing.assert_array_equal(state.y, reference.y)


def test_records_hold_the_largest_lists(tmp_path):
    n = 3000
    p = tuple(60 + np.sin(np.arange(n)))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tuple(0.1 * np.array(p)))
    record = simulate(scene, 1e-5, progress=False)
    assert Record.load(record.save(tmp_path / "a.nc")) == record


def test_figure_and_tables(record, tmp_path):
    fig = fig1b(record)
    assert "chain under prescribed loads" in fig.caption
    assert "linear geometry" in fig.caption
    assert len(record.to_csv(tmp_path)) == 6


def test_command_line(tmp_path):
    out = tmp_path / "a.nc"
    line = ["run", "chain", "--set", "tau=25 N", "--set", "k_top=20 MN/m", "--t-end", "1 ms"]
    done = CliRunner().invoke(main, [*line, "--out", str(out), "--quiet"])
    assert done.exit_code == Exit.COMPLETE, done.output
    record = Record.load(out)
    assert record.scene == chain(tau=25.0, k_top=20e6)
    assert record.method.geometry == "linear"
    line[-1] = "1.1 ms"
    done = CliRunner().invoke(main, [*line, "--out", str(out), "--resume", "--quiet"])
    assert done.exit_code == Exit.COMPLETE, done.output
    done = CliRunner().invoke(main, ["scene", "chain", "--set", "tau=50 N"])
    assert done.exit_code == Exit.BAD_INPUT
    assert "top.tau = 50.0 N: block 1 from the trailing edge would slip" in done.stderr


# --- fronts that are started ---------------------------------------------------------------------


@pytest.mark.parametrize(("blocks", "runs", "side"), [(3, False, "left"), (5, True, "right")])
def test_a_front_without_inertia_needs_so_many_blocks(blocks, runs, side):
    """At tau_bar = 0.2, 1/tau_bar - 1 = 4 blocks just load the next block to mu_s p."""
    scene = chain(L=14 * 2.5e-3, p=10.0, tau=10 * (0.45 + 0.2 * 0.25), K=0.0, V=0.0, side=side)
    viscous = 10 * math.sqrt(scene.slider.k * scene.m)
    scene = scene.replace({"interface.alpha": viscous, "slider.eta": 0.0})
    first = pyfric.released(scene, blocks)
    t_end = (1e4 if runs else 4e3) * math.sqrt(scene.m / scene.slider.k)
    how = {"fidelity": "dynamic", "energies": False, "progress": False}
    record = pyfric.simulate(scene, t_end, initial=first, **how)
    slips = scene.n_of_i[record.final_state.y[0, 0] != 0]
    assert slips.max() == (scene.N_x if runs else blocks)
    told = [note for note in record.notes if "dies unless inertia helps" in note]
    assert len(told) == (not runs)
    assert runs or f"block {blocks} of {scene.N_x}" in told[0]
    assert runs or f"{100 * (blocks + 1) * 0.2:.0f} %" in told[0]


@pytest.mark.parametrize("law", [pyfric.laws.LinearWeakening(), pyfric.laws.ExponentialWeakening()])
def test_released_blocks_have_weakened(law):
    """All but the last block start with the acceleration (tau - mu_k p)/m."""
    scene = chain(L=29 * 2.5e-3, p=10.0, tau=5.0, K=0.0, V=0.0, d_c=1e-5, law=law)
    state = pyfric.released(scene, 4)
    how = {"fidelity": "dynamic", "initial": state, "progress": False}
    dt = pyfric.step_size(scene)
    v = pyfric.simulate(scene, dt, dt=dt, **how).final_state.y[0, 2, 0]
    mu_k = scene.interface.mu_k
    assert v * scene.m / dt == pytest.approx(5.0 - 10.0 * mu_k, rel=0.02)
    np.testing.assert_array_equal(state.slip[:4], 1e-5 * scene.law.tables.slide.x[-1])
    np.testing.assert_array_equal(state.mode, [1] * 4 + [0] * 26)
    for wrong in (0, 31, 2.5):
        with pytest.raises(pyfric.SceneError, match="blocks"):
            pyfric.released(scene, wrong)
