"""Junctions that break, slip and pin again: exact blocks, a twin, bits, energy, refusals."""

import dataclasses
import functools

import numpy as np
import pytest
from helpers import GEOMETRIES, advance, bits, log_bits, refused, same_run
from junction_twin import Junctions as Twin
from junction_twin import rk4_step
from one_block import MU_D, MU_S, U_S, Dragged, irwin_hall, slipping_share

import pyfric
from pyfric import core
from pyfric.figures import space_time
from pyfric.figures.strip import event_frames
from pyfric.record.analysis import budget_error
from pyfric.scene import chain, setup1, setup2
from pyfric.scene.laws import Junctions
from pyfric.statics import loaded_state, stability_limit

# --- one block at a given speed, against closed forms ---------------------------------------------


@pytest.fixture(scope="module")
def steady():
    """Return a block after steady sliding at q = v t_R/u_s, and F/p on the last 2 u_s."""

    @functools.cache
    def made(q, distance):
        block, v = Dragged(1e-3, 1e-3, t_R_distribution="gamma", stretch=1.0), q * U_S / 1e-3
        fine, block.STEPS = block.STEPS, 80
        block.slide(v, distance - 2, every=16)
        block.STEPS = fine  # short steps over 2 u_s, in which all break again
        ratio = block.slide(v, 2, every=40).mean()
        return block, block.state, ratio

    def again(q, distance):
        block, state, ratio = made(q, distance)
        block.state = state.copy()
        return block, ratio

    return again


@pytest.mark.parametrize(
    ("q", "distance"), [pytest.param(1.0, 6, marks=pytest.mark.slow), (4.0, 5)]
)
def test_steady_friction_falls_with_speed(steady, q, distance):
    """F/p = (mu_s/2 + mu_d q)/(1 + q), q = v t_R/u_s, for any distribution of t_R."""
    block, ratio = steady(q, distance)
    assert ratio == pytest.approx((MU_S / 2 + MU_D * q) / (1 + q), abs=1e-3)
    assert block.pinned() == pytest.approx(1 / (1 + q), abs=5e-3)


def test_slipping_share_from_all_pinned():
    """Break n of a junction comes n t_p plus n - 1 times of slip after the start."""
    t_R, std, v = 1e-3, 0.3e-3, 1e-3
    block, t_p = Dragged(t_R, std), U_S / v

    # Up to 3 u_s in all; before the first break long steps are exact.
    for distance, steps in ((0.95, 20), (0.35, 600), (0.4, 600), (0.6, 600), (0.7, 600)):
        block.STEPS = steps
        block.slide(v, distance, every=round(distance * steps))
        share = slipping_share(block.t, t_p, t_R, std)
        assert 1 - block.pinned() == pytest.approx(share, abs=1e5**-0.5)


def test_first_peak_is_twice_steady_friction_without_time_of_slip():
    """Equal thresholds give mu_s p at first, mu_s p/2 in the mean (Farkas, Dahmen, Wolf 2005)."""
    block = Dragged(0.0, n_s=50)
    ratio = block.slide(1e-3, 4.0, every=1)
    assert ratio.max() == pytest.approx(MU_S, rel=1.01 / Dragged.STEPS)
    assert ratio[Dragged.STEPS :].mean() == pytest.approx(MU_S / 2, rel=1.01 / Dragged.STEPS)


def test_a_bundle_of_unequal_junctions_breaks_from_the_weakest_on():
    """At first F/p = mu_s y S(y) + mu_d (1 - S(y)), with S the share of c_j > y."""
    half = 0.5
    block = Dragged(10.0, n_s=2000, u_s_spread=half)
    c, y = block.scene.law.kind.factors, np.arange(1, 641) / Dragged.STEPS
    even = 1 + half * (2 * np.arange(2000) - 1999) / 2000
    np.testing.assert_allclose(np.sort(c), even, rtol=1e-14)
    assert abs(np.corrcoef(c, np.arange(2000))[0, 1]) < 0.1  # in random order
    whole = np.clip((1 + half - y) / (2 * half), 0, 1)
    ratio = block.slide(1e-3, 1.6, every=1)
    np.testing.assert_allclose(ratio, MU_S * y * whole + MU_D * (1 - whole), atol=2e-3)
    assert ratio.max() < 0.8 * MU_S


@pytest.mark.parametrize("switching", ["step_end", "located"])
def test_each_junction_breaks_at_its_own_stretch(switching):
    """Located breaks are exact; breaks at step ends are at most one step late."""
    block, y = Dragged(10.0, n_s=4, u_s_spread=0.8), np.array([0.4, 0.8, 1.2, 1.6])
    np.testing.assert_allclose(np.sort(block.scene.law.kind.factors), y)
    n, state = 100, block.state.with_dt(1e-5)
    state.y[:, 2] = 2 * U_S / (n * 1e-5)
    log = core.Log(3, 1000, 1000)
    how = {"budget": False, "stepper": "rk4", "switching": switching}
    assert core.advance(block.model, state, log, n, **how) == core.Status.DONE
    broken = (state.release - 10.0)[0] / (n * 1e-5) * 2  # displacement at the break, over u_s
    late = np.sort(broken) - y
    assert (late > -1e-9).all()
    assert late.max() < (1e-6 if switching == "located" else 1.01 * 2 / n)


def test_unequal_junctions_slide_as_their_cycles_say():
    """F/p is the mean of (mu_s c^2/2 + mu_d q)/(c + q): c u_s of pull, then v t_R of slip."""
    q, v = 1.0, 1e-3
    block = Dragged(q * U_S / v, n_s=200, u_s_spread=0.6)
    block.STEPS = 50
    c = block.scene.law.kind.factors
    ratio = block.slide(v, 80.0, every=1)[500:].mean()
    assert ratio == pytest.approx(np.mean((MU_S * c**2 / 2 + MU_D * q) / (c + q)), rel=0.015)
    equal = (MU_S / 2 + MU_D * q) / (1 + q)
    assert abs(ratio / equal - 1) > 0.02


def mean_field(moves, cells, pins):
    """Return F/p after each step of the mean field: pinned junctions by stretch, slipping by age.

    Args:
        moves: for each step, whether the block moves by u_s/cells; otherwise it rests.
        cells: number of cells of stretches up to u_s.
        pins: share of slipping junctions that pin 0, 1, 2, ... steps after their break.
    """
    pinned, slipping, found = np.zeros(cells + 1), 0.0, []
    pinned[0], due = 1.0, np.zeros(len(moves) + len(pins))
    for step, moved in enumerate(moves):
        if moved:
            broken, pinned[1:], pinned[0] = pinned[-1], pinned[:-1].copy(), 0.0
            due[step : step + len(pins)] += broken * pins
            slipping += broken
        slipping -= due[step]
        pinned[0] += due[step]
        found.append(MU_S * (pinned @ np.arange(cells + 1)) / cells + MU_D * slipping)
    return np.array(found)


def test_slides_and_holds_are_those_of_the_mean_field():
    """1e4 junctions go through slides and holds without a closed form."""
    t_R, cells, v = 1e-3, 200, 1e-3
    dt, block = U_S / v / cells, Dragged(t_R, 0.3e-3, n_s=3334)
    x = (np.arange(801) * dt - t_R) / 0.3e-3 + 6
    pins = np.diff(irwin_hall(1)(np.clip(x, 0, 12)), prepend=0.0)
    moves, found = [], []
    for speed, n in ((v, 500), (0.0, 150), (v, 330), (0.0, 40), (v, 700)):
        moves += [speed > 0] * n
        found.append(block.move(speed, n, dt))
    exact = mean_field(moves, cells, pins)
    assert np.ptp(exact[500:]) > 0.05
    np.testing.assert_allclose(np.concatenate(found), exact, atol=0.01)


def test_hold_relaxes_while_junctions_pin(steady):
    """F/p = w mu_s/2 + (1 - w) mu_d exp(-t/t_R) for exponential times, w = 1/5."""
    block, _ = steady(4.0, 5)
    begin = block.t
    for n, dt in ((5, 1e-4), (5, 1e-4), (10, 1e-4), (10, 2e-4)):
        ratio = block.move(0.0, n, dt)[-1]
        exact = MU_S / 10 + 4 * MU_D / 5 * np.exp(-(block.t - begin) / 1e-3)
        assert ratio == pytest.approx(exact, abs=1e-3)


def test_slide_after_hold_peaks_by_the_speed_of_the_slide_before(steady):
    """F(y)/p = (1 - w) mu_s y + w [mu_s (1 - y^2)/2 + mu_d y] for y <= 1: no junction pins.

    Its peak is at y* = min(1, (1 - w)/w + mu_d/mu_s).
    """
    block, _ = steady(4.0, 5)
    w = block.pinned()
    assert w == pytest.approx(0.2, abs=5e-3)
    block.move(0.0, 1, 20e-3)  # only exp(-20) of the junctions still slip
    ratio = block.slide(1.0, 0.975)
    y = np.arange(1, len(ratio) + 1) * 10 / Dragged.STEPS
    exact = (1 - w) * MU_S * y + w * (MU_S * (1 - y**2) / 2 + MU_D * y)
    np.testing.assert_allclose(ratio, exact, atol=1e-3)


# --- a lattice against the twin -------------------------------------------------------------------

FAST = {"n_s": 12, "t_R": 2e-5, "t_R_std": 8e-6, "seed": 3}


def small(kind="free", **changes):
    """Return a lattice on junctions that rupture, pin and rupture again within 1 ms."""
    law = Junctions(u_s=4e-7, **FAST)
    own = {"mu_s": 0.6, "mu_k": 0.2, "law": law, "V": 5.0} | changes
    if kind == "rod":
        return setup1(**{"L": 0.0125, "H": 0.0075, "F_N": 700.0} | own)
    return setup2(**{"L": 0.005, "H": 0.003, "theta": 0.3} | own)


def begin(scene, geometry, dt):
    return loaded_state(scene, geometry).state(scene, dt)


def follows_twin(scene, geometry, state, n):
    """Make n steps of core and twin, compare them, and return the contact states after each."""
    dt = state.dt
    of = dataclasses.replace(scene.interface.law, C=float(scene.law.C), u_s=None)
    twin = Twin(of, 0.6, 0.2, scene.n_of_i, np.zeros(scene.N_x))
    np.testing.assert_allclose(state.anchor, twin.anchor, atol=1e-18)
    y, modes = state.y.copy(), []
    for step in range(n):
        y = rk4_step(scene, geometry, step * dt, y, twin, state.u_drv0, dt)
        advance(scene, geometry, state, 1, budget=False)
        modes.append(state.mode.copy())
    np.testing.assert_array_equal(state.breaks, twin.breaks)
    np.testing.assert_array_equal(state.pinned == 1, twin.pinned)
    np.testing.assert_allclose(state.release, twin.release, rtol=0, atol=1e-15)
    scale = np.abs(y).max(axis=(0, 2))
    np.testing.assert_allclose(state.anchor, twin.anchor, rtol=0, atol=1e-11 * scale[0])
    np.testing.assert_allclose(state.y / scale[:, None], y / scale[:, None], rtol=0, atol=1e-10)
    stored = core.energies(core.model(scene, geometry, state.u_drv0), state, state.t)
    p = scene.k_f * -np.minimum(y[0, 1], 0)
    assert stored["elastic_junctions"] == pytest.approx(twin.energy(y[0, 0], p), rel=1e-9)
    return np.array(modes)


@pytest.mark.parametrize(("geometry", "side"), [("linear", "left"), ("finite", "right")])
def test_lattice_is_that_of_the_twin(side, geometry):
    """Anchors, breaks, times of release and motion agree through ruptures."""
    scene = small(side=side)
    state = begin(scene, geometry, 3e-7)
    follows_twin(scene, geometry, state, 300)
    assert state.breaks.max() >= 2  # some junctions pinned and broke again


def test_shaken_lattice_is_that_of_the_twin():
    """Core and twin agree while blocks turn back, lift off and touch again."""
    scene = small(V=0.0, F_N=100.0)
    state = begin(scene, "linear", 3e-7)
    state.y[:, 2:] = 0.8 * np.random.default_rng(5).standard_normal(state.y[:, 2:].shape)
    modes = follows_twin(scene, "linear", state, 500)
    opened = modes == core.OPEN
    assert (opened[1:] & ~opened[:-1]).sum() > 2
    assert (opened[:-1] & ~opened[1:]).sum() > 2
    assert state.breaks.max() >= 1


def test_times_of_slip_are_drawn_by_counter():
    """A time is mean + std (sum of 12 uniform numbers - 6), by seed, block, junction, break."""
    scene = small(side="right")
    state = begin(scene, "linear", 3e-7)
    before, found = state.copy(), 0
    for _ in range(400):
        advance(scene, "linear", state, 1, budget=False)
        for i, j in np.argwhere((state.breaks > before.breaks) & (state.pinned == 0)):
            counter = np.array([0, scene.n_of_i[i], j + 1, state.breaks[i, j]], dtype=np.uint64)
            key = np.array([FAST["seed"], 0], dtype=np.uint64)
            raw = np.random.Philox(key=key, counter=counter).random_raw(12)
            total = 0.0
            for one in (raw >> np.uint64(11)) * 2.0**-53:
                total += one
            t_R = max(FAST["t_R"] + FAST["t_R_std"] * (total - 6), 0.0)
            assert state.release[i, j] == pytest.approx(state.t + t_R, rel=1e-15, abs=0)
            found += 1
        before = state.copy()
    assert found > 50


# --- bits, energy, order --------------------------------------------------------------------------


@pytest.mark.parametrize("switching", ["step_end", "located"])
@pytest.mark.parametrize("stepper", ["rk4", "adaptive"])
def test_bits_do_not_depend_on_threads_and_builds(switching, stepper):
    scene = small("rod")
    states, logs = [], []
    how = {"switching": switching, "stepper": stepper, "rtol": 1e-6}
    variants = [name for name, runs in core.variants().items() if runs]
    for threads, variant in [(1, core.VARIANT), (2, core.VARIANT), *((1, v) for v in variants)]:
        state = begin(scene, "finite", 3e-7)
        log = advance(scene, "finite", state, 500, threads=threads, variant=variant, **how)
        states.append(bits(state))
        logs.append(log_bits(log))
    assert state.breaks.max() >= 2
    assert all(one == states[0] for one in states)
    assert all(one == logs[0] for one in logs)


@pytest.mark.parametrize("switching", ["step_end", "located"])
def test_runs_go_on_in_the_middle_of_a_rupture(switching, tmp_path):
    """Sums over pinned junctions are computed again after reading a state, with equal bits."""
    scene = small("rod")
    whole = begin(scene, "finite", 3e-7)
    advance(scene, "finite", whole, 500, switching=switching)
    state = begin(scene, "finite", 3e-7)
    cut = 0
    for n in (150, 61, 1, 88, 200):
        advance(scene, "finite", state, n, switching=switching)
        cut += bool((state.mode != 0).any() and (state.mode == 0).any())
        state = core.State.load(state.save(tmp_path / "state.npz", overwrite=True))
    assert cut >= 1
    assert bits(state) == bits(whole)


@pytest.mark.parametrize("switching", ["step_end", "located"])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_energy_is_conserved_with_the_work_of_the_stiffness(geometry, switching):
    """k_j follows p; without the work of its change the budget error is larger."""
    how = {"fidelity": "dynamic", "geometry": geometry, "switching": switching, "energies": True}
    how |= {"dt": 1e-7, "verify": "none", "sample": 1e-6}
    record = pyfric.simulate(small("rod"), 3e-4, **how)
    assert record.final_state.breaks.min() >= 1
    curve = record.curve
    assert budget_error(curve) < 1e-4
    assert budget_error(curve.assign(stiffness_work=0.0)) > 3 * budget_error(curve)


def test_located_steps_keep_the_order_of_the_stepper():
    """Breaks, releases and starts of dragging are located, so that the order is 4."""
    scene = small(law=Junctions(n_s=4, u_s=4e-7, t_R=2e-5, t_R_std=4e-6, stretch=0.3))
    ends, T = [], 1.2e-4
    for steps in (300, 600, 1200, 9600):
        state = begin(scene, "linear", T / steps)
        advance(scene, "linear", state, steps, switching="located", budget=False)
        ends.append(state)
    assert ends[-1].breaks.sum() > 50
    assert all((one.breaks == ends[-1].breaks).all() for one in ends)
    errors = [np.abs(one.y[:, 0] - ends[-1].y[:, 0]).max() for one in ends[:-1]]
    assert errors[0] / errors[1] > 12
    assert errors[1] / errors[2] > 12


# --- steps, start, refusals -----------------------------------------------------------------------


@pytest.mark.parametrize("stepper", ["rk4", "verlet", "symplectic_euler"])
def test_step_limit_is_that_of_the_stiffness_of_junctions(stepper):
    """Stiff junctions that never break are stable just below the limit, unstable above."""
    law = Junctions(n_s=10, C=1e16, t_R=1e-3)
    scene = chain(L=0.01, law=law, mu_s=1e6, mu_k=0.0, V=0.0)
    limit, _ = stability_limit(scene, stepper)
    plain, _ = stability_limit(chain(L=0.01), stepper)
    assert limit < 0.9 * plain
    for share, stable in ((0.98, True), (1.3, False)):
        state = begin(scene, "linear", share * limit)
        rng = np.random.default_rng(0)
        state.y[:, 2] = 1e-9 * rng.standard_normal(scene.N_x)
        advance(scene, "linear", state, 2000, stepper=stepper, budget=False)
        assert (np.abs(state.y[:, 2]).max() < 1e-7) == stable


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_loaded_slider_is_at_rest_on_its_junctions(geometry):
    scene = pyfric.preset("slow")
    rest = loaded_state(scene, geometry)
    state = rest.state(scene, 1e-7)
    forces = core.evaluate(core.model(scene, geometry, state.u_drv0), state, 0.0)
    unit = scene.F_N / scene.N_x
    assert np.abs(forces.a[:-1]).max() * scene.m < 1e-8 * unit
    assert (state.pinned == 1).all()
    np.testing.assert_allclose(state.anchor, 0.0, atol=1e-20)
    np.testing.assert_allclose(forces.f, rest.f, atol=1e-10 * unit)


def test_start_is_refused_where_a_junction_would_break():
    scene = pyfric.preset("slow", mu_s=0.2, n_s=10, stretch=1.0)
    refused(
        lambda: pyfric.simulate(scene, 1e-4, fidelity="dynamic"), "interface.law", "would break"
    )


@pytest.mark.parametrize("fidelity", ["hybrid", "quasistatic", "equilibrium"])
def test_jumps_over_rests_are_refused(fidelity):
    call = pyfric.simulate
    refused(
        lambda: call("slow", 0.1, fidelity=fidelity), "interface.law", "break and pin all the time"
    )


def test_plan_takes_full_dynamics_and_says_the_price():
    plan = pyfric.plan("slow", t_end=1.6)
    assert (plan.alone.engine, plan.alone.switching) == ("dynamic", "step_end")
    assert plan.seconds[1] > 10
    assert "break and pin all the time" in plan.levels[0].cannot
    assert "left out (junctions" in str(plan)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("n_s", {"n_s": 1}),
        ("n_s", {"n_s": 2.5}),
        ("seed", {"seed": -1}),
        ("u_s", {"u_s": None}),
        ("u_s", {"C": 1e9}),
        ("t_R", {"t_R": -1.0}),
        ("ruptured", {"ruptured": 0.0}),
        ("t_R_distribution", {"t_R_distribution": "cauchy"}),
    ],
)
def test_values_are_refused(name, values):
    refused(lambda: Junctions(**{"n_s": 10, "u_s": 1e-6} | values), f"interface.law.{name}")


def test_fields_may_vary_along_the_interface(tmp_path):
    """Scene files and records keep a list and a `Spread`, which is drawn once."""
    t_R = pyfric.Spread(mean=2e-5, std=2e-6)
    u_s = tuple(np.linspace(3e-7, 5e-7, 6))
    scene = small(law=Junctions(n_s=6, u_s=u_s, t_R=t_R), side="right")
    assert scene.varied == ("u_s", "t_R")
    assert pyfric.Scene.from_toml(scene.to_toml()) == scene
    np.testing.assert_allclose(scene.law.u_s(scene.F_N / scene.N_x), u_s[::-1])
    record = pyfric.simulate(scene, 2e-4, fidelity="dynamic", verify="none")
    record.save(tmp_path / "run.nc")
    again = pyfric.Record.load(tmp_path / "run.nc")
    assert again == record
    assert again.scene.drawn == scene.drawn


def test_records_go_on_and_say_what_ruptured(tmp_path):
    """A run equals one that was saved, read and continued; events cover ruptured blocks."""
    scene, how = small("rod"), {"fidelity": "dynamic", "verify": "none", "t_gap": 2e-5}
    whole = pyfric.simulate(scene, 3e-4, **how)
    half = pyfric.simulate(scene, 1.3e-4, **how)
    half.save(tmp_path / "half.nc")
    again = pyfric.simulate(scene, 3e-4, initial=pyfric.Record.load(tmp_path / "half.nc"), **how)
    assert bits(again.final_state) == bits(whole.final_state)
    assert all(np.array_equal(again.motion[name], values) for name, values in whole.motion.items())
    assert (whole.events["n_blocks"] > 1).any()
    assert same_run(whole, pyfric.simulate(scene, 3e-4, **how))


@pytest.fixture(scope="module")
def ruptured():
    """Return a run with a rupture of the whole interface."""
    how = {"fidelity": "dynamic", "verify": "none", "sample": 4e-7, "t_gap": 2e-5, "dt": 2e-7}
    return pyfric.simulate(small("rod", side="right"), 3e-4, **how)


def test_motion_is_that_of_the_state(ruptured):
    """Motion is recorded at each point of the curve; the last point is the final state."""
    motion, state = ruptured.motion, ruptured.final_state
    assert {name: values.shape for name, values in motion.items()} == dict.fromkeys(
        ("pinned", "u_x", "v_x", "f"), (len(ruptured.curve), ruptured.scene.N_x)
    )
    np.testing.assert_array_equal(motion["u_x"][-1], state.y[0, 0])
    np.testing.assert_allclose(motion["pinned"][-1], state.pinned.mean(axis=1), rtol=1e-7)
    assert ruptured.to_xarray()["motion_pinned"].dims == ("t", "x")


def test_blocks_are_ruptured_while_few_junctions_are_pinned(ruptured):
    """Episodes begin when the share falls below 30 %, and end when it returns."""
    t, pinned = ruptured.curve["t"].to_numpy(), ruptured.motion["pinned"]
    ended = ruptured.episodes[ruptured.episodes["t_stop"].notna()]
    assert len(ended) > 2
    for row in ended.itertuples():
        inside = (t > row.t_start + 2e-6) & (t < row.t_stop - 2e-6)
        assert (pinned[inside, row.i] < 0.3).all()
    for i in range(ruptured.scene.N_x):
        low = t[(pinned[:, i] < 0.29) & (ruptured.motion["f"][:, i] != 0)]  # in contact
        own = ruptured.episodes[ruptured.episodes["i"] == i]
        ends = own["t_stop"].fillna(np.inf).to_numpy()
        inside = (low[:, None] >= own["t_start"].to_numpy() - 2e-6) & (low[:, None] <= ends + 2e-6)
        assert inside.any(axis=1).all()


def test_picture_shows_the_share_of_pinned_junctions(ruptured):
    event = int(ruptured.events["n_blocks"].idxmax())
    fig = space_time(ruptured, event)
    shares = fig.tables["pinned"]["share"].to_numpy().reshape(-1, ruptured.scene.N_x)
    at = np.isin(ruptured.curve["t"], fig.tables["pinned"]["t_s"].unique())
    np.testing.assert_array_equal(shares, ruptured.motion["pinned"][at][:, ::-1])
    assert "pinned junctions" in fig.caption
    few = pyfric.simulate(ruptured.scene, 3e-4, fidelity="dynamic", sample=1e-4, t_gap=2e-5)
    event = int(few.events["n_blocks"].idxmax())
    refused(lambda: space_time(few, event), "sample", "too few points")


def test_strips_and_films_run_the_event_again(ruptured):
    """On junctions the event is run again from the start, with the same bits."""
    event = int(ruptured.events["n_blocks"].idxmax())
    (frame,) = event_frames(ruptured, event, [2.9e-4])
    at = int(np.abs(ruptured.curve["t"] - frame.t).argmin())
    assert ruptured.curve["t"].iloc[at] == pytest.approx(frame.t, abs=4e-7)
    f = -ruptured.scene.d * ruptured.motion["f"][at][::-1]
    np.testing.assert_allclose(frame.tau, f, atol=0.02 * np.abs(f).max())


def test_breaks_are_located_because_step_ends_change_events():
    """At half the limit, events are those of a fourth of the step if breaks are located."""
    scene = pyfric.preset("slow", L=0.03, H=0.015, t_R_std=0.0, V=0.01, n_s=20, F_N=411.0)
    how = {"fidelity": "dynamic", "geometry": "linear", "sample": 1e-4, "progress": False}
    how["t_gap"] = 3e-4  # pauses are 0.23 ms and 1.35 ms
    dt = pyfric.step_size(scene)
    made = {
        (switching, share): pyfric.simulate(
            scene, 0.02, dt=share * dt, switching=switching, **how
        ).events["t_start"]
        for switching, share in ((None, 1.0), ("located", 0.25), ("step_end", 1.0))
    }
    fine = made["located", 0.25]
    assert len(fine) >= 2
    np.testing.assert_allclose(made[None, 1.0], fine, atol=1e-7)
    at_ends = made["step_end", 1.0]
    assert np.abs(at_ends.iloc[: len(fine)].to_numpy() - fine.to_numpy()).max() > 5e-6


@pytest.mark.parametrize(
    ("spread", "switching"),
    [
        ({"t_R_std": 0.0}, "located"),
        ({}, "step_end"),
        ({"t_R_std": 0.0, "stretch": 0.1}, "step_end"),
    ],
)
def test_where_junctions_break_one_by_one_a_note_says_that_they_switch_late(spread, switching):
    scene = pyfric.preset("slow", L=0.03, H=0.015, n_s=20, F_N=411.0, **spread)
    record = pyfric.simulate(scene, 1e-4, fidelity="dynamic", progress=False)
    assert record.method.switching == switching
    late = [note for note in record.notes if "break at step ends" in note]
    assert len(late) == (switching == "step_end")
