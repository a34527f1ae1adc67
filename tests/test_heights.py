"""Interfaces that are not flat: gaps, blocks without contact, blocks without friction."""

import numpy as np
import pytest
from helpers import budget_error, small_free, small_rod

import pyfric
from pyfric.core import OPEN
from pyfric.scene import preset
from pyfric.statics import ContactProblem, StaticSolver, loaded_state
from pyfric.values import SceneError

LINEAR = {"geometry": "linear"}


def every_other(n, a, b, width=2):
    return [a if i // width % 2 == 0 else b for i in range(n)]


def grooved(kind, **changes):
    """Return 13 x 7 or 21 x 7 blocks; every other pair lacks friction or contact, or has a gap."""
    base = small_rod(V=0.02) if kind != "free" else small_free(V=0.02)
    n = base.N_x
    own = {
        "bare": {"mu_s": every_other(n, 0.7, 0.0), "mu_k": every_other(n, 0.45, 0.0)},
        "apart": {"contact": every_other(n, True, False)},
        "gaps": {"gap": every_other(n, 0.0, 3e-6)},
        "free": {"gap": every_other(n, 0.0, 4e-7), "contact": every_other(n, True, False, 7)},
    }
    return base.replace(own[kind] | changes)


KINDS = ("bare", "apart", "gaps", "free")


@pytest.mark.parametrize("kind", KINDS)
def test_newton_and_the_contact_solver_find_the_same_start(kind):
    scene = grooved(kind)
    rest, now = loaded_state(scene), ContactProblem(scene).loaded().values()
    assert rest.p == pytest.approx(now.p, abs=1e-9 * scene.F_N)
    assert rest.f == pytest.approx(now.f, abs=1e-9 * scene.F_N)
    height = rest.u[0, 1] + scene.gap
    p = np.where(scene.touches, scene.slider.k * np.maximum(-height, 0.0), 0.0)
    assert rest.p == pytest.approx(p, abs=1e-9 * scene.F_N)
    assert rest.p.sum() == pytest.approx(scene.F_N, rel=1e-9)
    assert not rest.f[scene.bare | ~scene.touches].any()


@pytest.mark.parametrize("kind", KINDS)
def test_jumps_make_the_events_of_full_dynamics(kind):
    scene = grooved(kind, V=6e-3)
    runs = [pyfric.simulate(scene, 0.1, fidelity=f, **LINEAR) for f in ("dynamic", "hybrid")]
    a, b = (run.events for run in runs)
    assert len(a) == len(b) >= 2
    for name in ("first_block", "last_block", "nucleation_block"):
        assert (a[name] == b[name]).all()
    starts = [events["F_T_start"].to_numpy() for events in (a, b)]
    assert starts[1] == pytest.approx(starts[0], abs=1e-5 * scene.F_N)
    made = runs[1].counts
    assert made["steps"] < 0.2 * (made["steps"] + made["steps_spared"])
    at = runs[1].final_state
    assert (at.mode[scene.bare | ~scene.touches] == OPEN).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_sequence_is_near_full_dynamics(kind):
    scene = grooved(kind)
    still, full = (
        pyfric.simulate(scene, 0.03, fidelity=f, **how)
        for f, how in (("quasistatic", {}), ("dynamic", LINEAR))
    )
    peaks = [run.curve["F_T"].max() / scene.F_N for run in (still, full)]
    assert peaks[0] == pytest.approx(peaks[1], abs=0.03)
    first = [float(run.events["F_T_start"].iloc[0]) for run in (still, full)]
    assert first[0] == pytest.approx(first[1], abs=1e-4 * scene.F_N)


def test_a_flat_gap_lowers_the_slider_and_changes_no_force():
    flat, low = small_rod(), small_rod(gap=1e-5)
    a, b = loaded_state(flat), loaded_state(low)
    assert b.p == pytest.approx(a.p, rel=1e-9)
    assert b.f == pytest.approx(a.f, abs=1e-9 * flat.F_N)
    assert b.u[:, 1] == pytest.approx(a.u[:, 1] - 1e-5, abs=1e-12)
    runs = [
        pyfric.simulate(scene.replace(V=0.02), 0.02, fidelity="hybrid", **LINEAR)
        for scene in (flat, low)
    ]
    starts = [run.events["F_T_start"].to_numpy() for run in runs]
    assert starts[1] == pytest.approx(starts[0], abs=1e-7 * flat.F_N)


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_blocks_that_hardly_touch_bear_less_and_less(geometry):
    """As the gap under the ends grows, they are held by friction, slip, and open."""
    scene, bears = small_rod(F_N=200.0), []
    for gap in np.linspace(3.70e-6, 3.75e-6, 51):
        ends = [gap, *[0.0] * 11, gap]
        rest = loaded_state(scene.replace({"interface.gap": ends}), geometry)
        assert (np.abs(rest.tau) <= 0.7 * rest.p * (1 + 1e-9) + 1e-12).all()
        assert rest.p[0] == pytest.approx(rest.p[-1], abs=1e-8)
        bears.append(rest.p[0])
    unit = scene.F_N / scene.N_x
    assert bears[0] > 5e-3 * unit
    assert bears[-1] == 0.0
    assert np.diff(bears).max() <= 0.0
    assert np.abs(np.diff(bears)).max() <= scene.k_f * 1e-9  # not stiffer than the foundation


@pytest.mark.parametrize("share", [0.0, 1e-6, 1e-3])
def test_ends_that_shall_bear_next_to_nothing_do(share):
    scene, p = small_rod(F_N=200.0, V=0.5), np.ones(13)
    p[[0, -1]] = share
    p *= scene.F_N / p.sum()
    made = pyfric.pressed(scene, p=p.tolist())
    assert loaded_state(made).p == pytest.approx(p, abs=2e-9 * scene.F_N / 13)
    for engine in ("quasistatic", "hybrid", "dynamic"):
        assert pyfric.simulate(made, 2e-4, fidelity=engine, progress=False, **LINEAR).done


def test_a_block_that_never_lands_is_one_without_contact():
    n = small_rod().N_x
    far = small_rod(gap=every_other(n, 0.0, 1e-3))
    apart = small_rod(contact=every_other(n, True, False))
    assert loaded_state(far).u == pytest.approx(loaded_state(apart).u, abs=1e-14)


def test_the_energy_budget_closes_over_gaps():
    scene = grooved("gaps", V=0.5)
    dt = pyfric.step_size(scene) / 2
    run = pyfric.simulate(scene, 2e-3, fidelity="dynamic", dt=dt, energies=True, **LINEAR)
    assert len(run.events)
    assert budget_error(run) < 1e-4


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("make", [small_rod, small_free])
def test_pressed_carries_what_was_measured(make, side):
    scene = make(side=side)
    n = np.arange(scene.N_x)
    share = 1 + 0.4 * np.cos(2 * np.pi * n / (scene.N_x - 1))  # this distribution has no torque
    p = scene.F_N * share / share.sum()
    made = pyfric.pressed(scene, p=p)
    assert made.gap.min() == 0 < made.gap.max()
    order = np.argsort(scene.n_of_i)
    assert loaded_state(made).p[order] == pytest.approx(p, rel=1e-6)
    assert loaded_state(made, "finite").p[order] == pytest.approx(p, rel=0.02)
    by_x = pyfric.pressed(scene, p=lambda x: float(np.interp(x, n * scene.slider.l, p)))
    assert by_x.gap == pytest.approx(made.gap, abs=1e-12)


def test_pressed_finds_gaps_under_blocks_that_slip():
    scene = small_rod(mu_s=0.1, mu_k=0.05)
    p = np.full(scene.N_x, scene.F_N / scene.N_x)
    made = pyfric.pressed(scene, p=p)
    rest = loaded_state(made)
    assert rest.slipped.any()
    assert rest.p == pytest.approx(p, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"p": [1.0] * 13}, "p", "multiply p by 269.23"),
        ({"p": [3500 / 12] * 12}, "p", "one for each block"),
        ({"p": [-1.0] + [1.0] * 12}, "p, block 1", ">= 0 N"),
        ({"p": [500.0 / 3] * 6 + [2500.0 / 7] * 7}, "p", "would tilt"),
    ],
)
def test_pressed_refuses_what_is_not_in_balance(change, field, words):
    with pytest.raises(SceneError, match=words) as error:
        pyfric.pressed(small_rod(), **change)
    assert error.value.field == field


def test_pressed_refuses_blocks_without_contact_and_prescribed_p():
    with pytest.raises(SceneError, match="without contact"):
        pyfric.pressed(small_rod(contact=[False] + [True] * 12), p=[3500 / 13] * 13)
    with pytest.raises(SceneError, match="p is given"):
        pyfric.pressed("chain", p=[1.0])


@pytest.mark.parametrize(
    ("make", "change", "field"),
    [
        (small_rod, {"gap": -1e-6}, "interface.gap"),
        (small_rod, {"gap": [1e-6]}, "interface.gap"),
        (small_rod, {"contact": [True]}, "interface.contact"),
        (small_rod, {"contact": 1}, "interface.contact"),
        (small_rod, {"contact": [True] + [False] * 12}, "interface.contact"),
        (pyfric.chain, {"contact": False}, "interface.contact"),
        (pyfric.chain, {"gap": 1e-6}, "interface.gap"),
    ],
)
def test_scenes_refuse_gaps_and_contact(make, change, field):
    with pytest.raises(SceneError) as error:
        make(**change)
    assert error.value.field == field


def test_a_file_keeps_gaps_and_contact():
    scene = grooved("free", gap=pyfric.Spread(mean=1e-6, range=1e-7, seed=2))
    assert pyfric.Scene.from_toml(scene.to_toml()) == scene
    assert "contact" not in small_rod().to_toml()
    assert "gap" not in small_rod().to_toml()


def test_a_chain_without_friction_in_its_middle_moves_freely_there():
    mu = [0.7] * 20 + [0.0] * 17 + [0.7] * 20
    scene = pyfric.chain(mu_s=mu, mu_k=[0.6 * m for m in mu])
    still, fast = (pyfric.simulate(scene, 0.1, fidelity=f) for f in ("quasistatic", "hybrid"))
    peaks = [run.curve["F_T"].max() for run in (still, fast)]
    assert peaks[0] == pytest.approx(peaks[1], abs=0.03 * scene.F_N)
    assert fast.counts["steps_spared"] > fast.counts["steps"]


def test_coarse_and_mirrored_lattices_keep_what_touches():
    scene = preset("grooves")
    assert scene.touches[:8].tolist() == [True] * 4 + [False] * 4
    assert preset("grooves", side="right").touches[::-1].tolist() == scene.touches.tolist()
    assert scene.interface_on(29).contact == preset("grooves", l=5e-3).interface.contact
    gap = preset("wavy").gap
    assert gap.max() == pytest.approx(20e-6)
    assert gap[14] == pytest.approx(0.0, abs=1e-15)


def test_solve_gives_p_of_blocks_without_friction():
    scene = grooved("bare")
    solver = StaticSolver(scene)
    rest = solver.solve(solver.loaded.u[0, 0], 0.0, free=scene.bare)
    assert rest.p == pytest.approx(solver.loaded.p, abs=1e-9 * scene.F_N)
    assert (rest.p[scene.bare] > 0).all()
