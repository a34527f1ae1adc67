"""Quasi-static sequences of the core, compared with those in Python, and their calls."""

import functools

import numpy as np
import off_box
import pytest
from helpers import small_free, small_rod
from hypothesis import given, settings
from hypothesis import strategies as st
from test_contact import sliders
from test_heights import KINDS, grooved
from tolerances import SEQUENCE

import pyfric
from pyfric.core import VARIANT, Sequences, Status, variants
from pyfric.engines.quasistatic import GROWTH, IDLE, QuasistaticRun
from pyfric.engines.stopping import stopping_of
from pyfric.scene import chain, preset, setup2
from pyfric.statics import (
    EquilibriumError,
    Start,
    follows,
    interfaces_of,
    legs_of,
    rules_of,
    slider_of,
    stretches,
)

LOGGED = {"switches": ("step", "block", "old", "new", "corner"), "quiet": ("step", "kind", "mode")}
"""Columns of the logs that have to be equal."""


def followed(scene, t_end, in_core, **how):
    """Return a run to t_end and its logs, or the reason why it stopped."""
    try:
        run = QuasistaticRun(scene, t_gap=1e-3, in_core=in_core, **how)
        run.advance(t_end, lambda: False, lambda *_: None)
    except EquilibriumError as error:
        return None, str(error).partition(" (")[0]
    run.pass_on()
    return run, run.history.logs(scene.N_x)


def check_twins(scene, t_end, force=SEQUENCE, **how):
    """Check that both make the same changes in the same order, with the same forces."""
    (one, first), (two, second) = (
        followed(scene, t_end, in_core, **how) for in_core in (True, False)
    )
    if one is None or two is None:
        assert first == second
        return None
    for log, names in LOGGED.items():
        for name in names:
            np.testing.assert_array_equal(first[log][name], second[log][name], err_msg=name)
    assert one.counts == two.counts
    assert (one.ending, one.notes, one.steps) == (two.ending, two.notes, two.steps)
    F_N, u_x = scene.F_N, second["quiet"]["u_x"]
    points, at_rest = (
        [run.history.points() for run in (one, two)],
        [run.known_statics() for run in (one, two)],
    )
    far = np.abs(u_x).max(initial=0.0) + F_N / scene.slider.k
    values = {
        "t": (*(each[:, 0] for each in points), 10 * t_end),
        "F_T": (*(each[:, 1] for each in points), F_N),
        "p": (first["switches"]["p"], second["switches"]["p"], F_N),
        "u_x": (first["quiet"]["u_x"], u_x, far),
        "tau": (*(each.tau for each in at_rest), F_N),
        "p at rest": (*(each.p for each in at_rest), F_N),
    }
    for name, (a, b, unit) in values.items():
        np.testing.assert_allclose(a, b, rtol=0, atol=force * unit, err_msg=name)
    return two


# --- against Python ------------------------------------------------------------------------------

DISORDER = pyfric.Spread(mean=0.7, std=0.035, seed=3)
SMOOTH = pyfric.Spread(mean=0.7, std=0.05, correlation_length=5e-3, seed=4)
TURNS = ((0.7, 7.875e-4), (0.7, -7.875e-4), (1.0, -7.875e-4), (1.0, 3e-3), (1.9, 0.0))
LOADS = {"top.protocol": ((0.2, 400.0), (0.5, 330.0), (0.5, 350.0), (0.8, 420.0))}
TINY = functools.partial(setup2, H=6e-3, k_f=9.375e6)
SCENES = {
    "fig1": (preset("fig1"), 0.9),
    "setup2": (preset("setup2"), 0.2),
    "rod, right": (small_rod(side="right", h=7.5e-3), 1.0),
    "theta = 0.833": (small_free(theta=0.833), 1.0),
    "theta = -0.833, right": (small_free(theta=-0.833, side="right"), 1.0),
    "lifts off": (small_rod(h=15e-3), 1.0),
    "no kinetic friction": (small_free(mu_k=0.0), 0.5),
    "spread": (small_rod().replace(mu_s=DISORDER), 1.0),
    "spread, correlated": (small_free(theta=0.5).replace(mu_s=SMOOTH), 0.6),
    "spread of all": (
        small_rod().replace(
            mu_s=DISORDER,
            mu_k=pyfric.Spread(mean=0.4, range=0.05, seed=1),
            k_f=pyfric.Spread(mean=13.5e6, std=1e6, seed=2),
            gap=pyfric.Spread(mean=1e-6, range=5e-7, seed=2),
        ),
        1.0,
    ),
    "turns": (small_rod().replace({"driver.protocol": TURNS}), 2.0),
    "accelerates": (small_rod().replace({"driver.protocol": ((0.5, 2e-3), (1.0, 0.0))}), 1.0),
    "loads": (small_free(T=5.0).replace(LOADS), 1.0),
    "slipped": (small_rod().replace(slip=tuple(np.linspace(2e-6, 0, 13).tolist())), 1.0),
    "slips while it is loaded": (small_free(mu_s=0.2, mu_k=0.1, theta=0.833), 0.3),
    "plate": (small_rod(h=5e-3, h_top=10e-3), 1.0),
    "chain": (chain(L=0.05, k_top=2e7, p=off_box.UNEVEN, V=0.02), 0.03),
    "symmetric": (chain(L=0.05, k_top=2e7, V_top=0.02, V=0.0), 7e-4),
    **{kind: (grooved(kind, V=6e-3), 0.2 if kind == "apart" else 0.1) for kind in KINDS},
    "light blocks": (small_free(theta=1.0, h=4e-3), 0.8),
    "light blocks, rod": (small_rod(h=15e-3), 1.3),
    "turned": (TINY(L=6e-3, h=2e-3, theta=1.0, mu_s=0.7, mu_k=0.21), 2.5),
    "turned, landed": (TINY(L=10e-3, h=1e-3, theta=1.0, mu_s=0.3, mu_k=0.0), 1.1),
    "bare, setup 2": (small_free(mu_s=[0.7] * 15 + [0.0] * 6, mu_k=[0.45] * 15 + [0.0] * 6), 1.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_events_are_those_in_python(name):
    assert check_twins(*SCENES[name]).releases > 10


@pytest.mark.parametrize(
    "name", sorted(n for n, c in off_box.CASES.items() if not c.scene.interface.d_c)
)
def test_events_off_the_box_are_those_in_python(name):
    case = off_box.CASES[name]
    assert check_twins(case.scene, case.t_end).releases > 3


def continuous(scene, mu=0.45):
    return scene.replace(mu_s=mu, mu_k=mu)


GROWING = {
    **{name: continuous(preset(name)) for name in ("fig1", "setup2", "setup2+", "chain")},
    "mu = 4": continuous(small_free(), 4.0),
    "mu = 5": continuous(small_free(k_f=1e10), 5.0),
    "moves back": continuous(small_free(theta=0.5, h=6e-3), 0.2),
    "moves back, tips": continuous(small_free(theta=1.0, h=6e-3), 0.2),
    "landed": continuous(TINY(L=4e-3, h=2e-3, theta=-1.0), 0.1),
    "turns": continuous(small_rod().replace({"driver.protocol": TURNS})),
    "apart": continuous(grooved("apart")),
    "gaps": continuous(grooved("gaps")),
}


@pytest.mark.parametrize("name", GROWING)
def test_continuous_slip_is_that_in_python(name):
    """Slip may not be unique here, and the driver reverses."""
    assert check_twins(GROWING[name], 1.5).grows


@settings(max_examples=40)
@given(
    data=st.data(),
    mu_s=st.sampled_from([0.1, 0.3, 0.7, 1.5]),
    share=st.sampled_from([0.0, 0.3, 0.9, 1.0]),
    seed=st.integers(0, 1000),
    spread=st.sampled_from([0.0, 0.1]),
)
def test_sequences_of_tiny_sliders_are_those_in_python(data, mu_s, share, seed, spread):
    """Sliders of 3 or 4 columns and 2 or 3 rows tip, lift off and land."""
    scene = data.draw(sliders(mu_s=mu_s, mu_k=share * mu_s))
    if spread and share < 1:
        field = pyfric.Spread(mean=mu_s, range=spread * (1 - share) * mu_s, seed=seed)
        scene = scene.replace(mu_s=field)
    reach = scene.F_N * mu_s * (1 / scene.driver.K + 1 / scene.slider.k)
    check_twins(scene, 3 * reach / scene.driver.V, force=100 * SEQUENCE)


@pytest.mark.parametrize("in_core", [True, False])
def test_a_slider_that_tips_over_one_block_is_refused(in_core):
    """Without kinetic friction the last block in contact holds nothing while it slips."""
    scene = TINY(L=3e-3, h=4e-3, theta=0.3, mu_s=0.3, mu_k=0.0, k_f=20171978.644915484)
    assert followed(scene, 0.6, in_core)[0].releases > 10
    run, why = followed(scene, 0.62, in_core)
    assert run is None
    assert "at t = 0.601692 s: the slider is not held" in why


@pytest.mark.parametrize("condition", ["precursors = 2", "L_p = 0.3", "system_size", "at_rest"])
def test_conditions_end_both_at_the_same_change(condition):
    scene = small_rod()
    stopping = lambda: stopping_of([condition], scene, 1e-3, None, 1.0)  # noqa: E731
    ended = [followed(scene, 1.0, in_core, stopping=stopping())[0] for in_core in (True, False)]
    one, two = ([run.ending, run.counts, run.steps] for run in ended)
    assert one == two
    assert (one[0] != "") == (condition != "at_rest")


def test_what_the_core_follows():
    assert follows(preset("fig1"))
    assert not follows(preset("slow"))
    assert not follows(preset("rate_and_state"))


# --- calls ---------------------------------------------------------------------------------------


def sequences(scenes, t_end, switches=None):
    """Return runs of scenes that differ in their interface."""
    runs = [QuasistaticRun(scene, t_gap=1e-3) for scene in scenes]
    parts = stretches(scenes[0], runs[0].drive_0, t_end)
    rules = rules_of(scenes[0], IDLE, GROWTH)
    slider, starts = slider_of(runs[0].problem, parts), [Start.of(run.contact) for run in runs]
    return Sequences(slider, rules, legs_of(parts), interfaces_of(starts, parts), switches)


def bits(runs, most=2**31 - 1, **how):
    """Return the logs of runs up to their end, by run."""
    found, left = [b""] * len(runs), np.arange(len(runs))
    while len(left):
        status = runs.go_on(most, **how)
        for n, run in enumerate(left):
            log = runs.log(n)
            arrays = (*log.switches.values(), *log.quiet.values(), log.points, log.f, log.p)
            found[run] = [*(found[run] or [[] for _ in arrays])]
            for kept, array in zip(found[run], arrays, strict=True):
                kept.append(array.tobytes())
        goes_on = (status == Status.PAUSED) | (status == Status.LOG_FULL)
        left, runs = left[goes_on], runs.part(goes_on)
    return [tuple(b"".join(kept) for kept in run) for run in found]


@functools.cache
def some_scenes():
    """Return scenes whose runs differ in length, foundation and law."""
    field = functools.partial(pyfric.Spread, mean=0.7, std=0.05)
    scenes = [small_rod(h=10e-3).replace(mu_s=field(seed=n)) for n in range(7)]
    scenes += [small_rod(h=10e-3, mu_s=0.45), small_rod(h=10e-3, k_f=2e6), small_rod(h=10e-3)]
    scenes += [small_rod(h=10e-3, gap=tuple([0.0, 1e-6] * 6 + [0.0]))]
    return scenes


@functools.cache
def alone():
    return [bits(sequences([scene], 1.0))[0] for scene in some_scenes()]


@pytest.mark.parametrize("threads", [1, 2, 3, 16])
def test_a_batch_gives_each_run_the_bits_that_it_has_alone(threads):
    assert len(set(alone())) == len(alone())
    assert bits(sequences(some_scenes(), 1.0), threads=threads) == alone()


def test_bits_do_not_depend_on_the_order():
    order = np.random.default_rng(0).permutation(len(alone()))
    found = bits(sequences([some_scenes()[n] for n in order], 1.0), threads=2)
    assert found == [alone()[n] for n in order]


@pytest.mark.parametrize("most", [1, 2, 7, 100])
def test_runs_go_on_with_the_same_bits(most):
    """Runs may stop anywhere, also inside events."""
    assert bits(sequences(some_scenes()[6:], 1.0), most, threads=2) == alone()[6:]


def test_runs_stop_where_a_log_is_full():
    scenes = some_scenes()[6:]
    runs = sequences(scenes, 1.0, switches=1)  # room for one change
    assert (runs.go_on(2**31 - 1) == Status.LOG_FULL).all()
    assert bits(sequences(scenes, 1.0, switches=1)) == alone()[6:]


@pytest.mark.parametrize("variant", [name for name, runs in variants().items() if runs])
def test_bits_do_not_depend_on_the_instruction_set(variant):
    assert variant != VARIANT or len(variants()) > 0
    assert bits(sequences(some_scenes(), 1.0), variant=variant) == alone()


def test_runs_stop_before_each_change_between_events():
    scene, ahead = small_rod(), []
    runs = sequences([scene], 1.0)
    while runs.go_on(2**31 - 1, stops=True)[0] == Status.PAUSED:
        assert runs.looks[0]
        ahead.append(runs.ahead[0])
        assert (runs.slipping[0] >= 0) == (np.abs(runs.count("new")[0]) == 1)
        drive = runs.columns[0, 0, -2]
        assert runs.force(0, drive) == pytest.approx(
            runs.log(0).points[-1, 1] if len(ahead) > 1 else 0
        )
    assert runs.status[0] == Status.DONE
    assert len(ahead) >= runs.count("events")[0] > 10
    assert (np.diff(ahead) >= 0).all()


def test_arguments_are_checked():
    runs = sequences([small_rod()], 1.0)
    for most, threads in ((0, 1), (1, 0), (2**31, 1)):
        with pytest.raises(ValueError, match="max_changes"):
            runs.go_on(most, threads=threads)


def test_a_slider_without_support_says_so():
    runs = sequences([small_rod()], 1.0)
    runs.fields[:, 2] = -1e9
    assert runs.go_on(10)[0] == Status.UNSUPPORTED
