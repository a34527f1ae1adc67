"""Fitted numbers, doubled and halved: forces and error estimates hold.

The table of these numbers is in `docs/explanation/numbers.md`.
"""

import functools
import importlib
from pathlib import Path

import numpy as np
import off_box
import pandas as pd
import pytest

import pyfric
from pyfric import core
from pyfric.core import packing
from pyfric.engines import cost, pauses, quasistatic, slow_slip, stable_slip
from pyfric.planning import levels
from pyfric.record import differences
from pyfric.scene import friction, preset, setup1
from pyfric.statics import sequences

ACCURACY = 1e-6
"""Tolerance of start and arrest forces of every event, over F_N."""
SETS = {
    "protocol_linear": ("space.N_MODES", "ring_down.AMPLIFIED"),
    "viscosity_10_light_finite": ("jump.SAMPLED",),
}
"""Stored runs with other parameters than the paper's -> numbers that matter in them."""
FITTED = [(name, constant) for name, constants in SETS.items() for constant in constants]
SLOW = [
    pytest.param("light_finite", constant, marks=pytest.mark.slow)
    for constants in SETS.values()
    for constant in constants
]


def scaled(number, factor):
    if isinstance(number, dict):
        return {name: scaled(one, factor) for name, one in number.items()}
    if isinstance(number, tuple):
        return tuple(factor * one for one in number)
    return type(number)(factor * number)


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize(
    ("name", "constant"), [*FITTED, ("protocol_linear", "schedule.SPENT"), *SLOW]
)
def test_events_do_not_depend_on_it(constant, factor, name, monkeypatch):
    module, _, attribute = constant.partition(".")
    module = importlib.import_module(f"pyfric.engines.{module}")
    value = getattr(module, attribute)
    monkeypatch.setattr(module, attribute, scaled(value, factor))
    if attribute == "N_MODES":
        defaults = (None, module.N_MODES)
        monkeypatch.setattr(module.Space.__init__, "__defaults__", defaults)
    known = off_box.load(name)
    found = known.apart(known.hybrid(ACCURACY))
    assert (found["events"], found["blocks"]) == (0, 0)
    limit = ACCURACY / (factor if attribute == "AMPLIFIED" else 1.0)
    assert max(found["start"], found["arrest"]) <= max(limit, ACCURACY)


PLANS = {
    "levels.LOOSE": (0.05, "quasistatic, linear", "hybrid, linear"),
    "levels.ROTATION": (0.01, "hybrid, linear", "hybrid, finite"),
    "levels.STEP_ERROR": (0.01, "hybrid, linear", "hybrid, linear"),
}
"""Number -> a tolerance, and the first levels of the Fig. 1 scene, number halved and doubled."""


def rod(**changes):
    return setup1({"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 2e-3} | changes)


@functools.cache
def full(t_end, **changes):
    how = {"fidelity": "dynamic", "energies": False, "progress": False, "geometry": "linear"}
    return pyfric.simulate(rod(**changes), t_end, **how)


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("constant", PLANS)
def test_plans_keep_their_promise_whatever_is_left_out(constant, factor, monkeypatch):
    _, _, attribute = constant.partition(".")
    monkeypatch.setattr(levels, attribute, factor * getattr(levels, attribute))
    tolerance, *first = PLANS[constant]
    scene, how = preset("fig1"), {"want": "precursors", "tolerance": tolerance, "progress": False}
    level = pyfric.plan(scene, "precursors", tolerance, t_end=0.3).levels[0]
    assert f"{level.engine}, {level.geometry}" == first[factor > 1]
    made = pyfric.simulate(scene, 0.3, **how)
    errors = differences(made, exact()).errors()
    assert max(errors["start"], errors["arrest"]) <= made.errors.measured() <= tolerance


@functools.cache
def exact():
    how = {"fidelity": "hybrid", "geometry": "finite", "progress": False}
    return pyfric.simulate("fig1", 0.3, accuracy=1e-8, **how)


PRICES = (
    "EVALUATION",
    "BOTTOM",
    "BLOCK",
    "CLOSED",
    "JUNCTION",
    "CALL",
    "EVENT_STEPS",
    "LANDING",
    "SLIDE",
    "RUN",
    "RELEASE",
    "STATIC_EVENT",
    "FLOPS",
    "UNKNOWN",
    "MODES",
)
RATED = ("cost.RATED", "cost.SLOW_STEP", "slow_slip.SPENT", "slow_slip.SLIPPED")
RATED += ("slow_slip.WAVES", "slow_slip.INERTIA", "slow_slip.BENT")
"""Prices and shares that matter only with rate-and-state friction."""


@pytest.fixture
def priced(monkeypatch):
    """Return a function that multiplies a price, and restores the previous one."""
    cost.machine_speed()

    def change(name, factor):
        monkeypatch.undo()
        monkeypatch.setattr(cost, name, scaled(getattr(cost, name), factor))
        cost.prices.cache_clear()

    yield change
    monkeypatch.undo()
    cost.prices.cache_clear()


@pytest.mark.slow
def test_plans_keep_their_promise_whatever_work_costs(priced):
    """Hybrid engine and full dynamics cost about the same here, so that prices decide."""
    scene, t_end, tolerance = preset("fig1", l=5e-3, V=0.01), 0.05, 1e-3
    how = {"fidelity": "dynamic", "geometry": "finite", "energies": False, "progress": False}
    known, made = pyfric.simulate(scene, t_end, dt=2e-7, **how), {}
    for name in PRICES:
        for factor in (0.5, 2.0):
            priced(name, factor)
            record = pyfric.simulate(scene, t_end, tolerance=tolerance, progress=False)
            made[record.method.engine, record.method.dt, record.method.geometry] = record
    for record in made.values():
        errors = differences(record, known).errors()
        assert errors["events"] > 3
        assert max(errors["start"], errors["arrest"]) <= record.errors.measured()


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("limit", ["stable_slip.FAST", "cost.SLIDE"])
def test_stable_slip_does_not_depend_on_them(limit, factor, monkeypatch, priced):
    module, _, name = limit.partition(".")
    if module == "cost":
        priced(name, factor)
    else:
        monkeypatch.setattr(stable_slip, name, factor * stable_slip.FAST)
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    a, b = full(0.048, d_c=5e-6), pyfric.simulate(rod(d_c=5e-6), 0.048, **how)
    assert len(a.events) == len(b.events) > 1
    limit = 1e-5 * a.scene.F_N
    np.testing.assert_allclose(b.events["F_T_start"], a.events["F_T_start"], rtol=0, atol=limit)


@functools.cache
def slow_slider(fidelity):
    """Return a slider of 13 x 7 blocks through two slow events, with rate-and-state friction."""
    size = {"L": 0.06, "H": 0.03, "l": 5e-3, "h": 5e-3, "F_N": 1500.0}
    scene = preset("rate_and_state", {**size, "D_c": 1e-6, "V": 4e-3})
    how = {"accuracy": 4e-4} if fidelity == "hybrid" else {"energies": False}
    how |= {"fidelity": fidelity, "geometry": "finite", "sample": 1.2e-4, "progress": False}
    return pyfric.simulate(scene, 0.09, **how)


@pytest.mark.parametrize("factor", [0.5, pytest.param(2.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("constant", RATED)
def test_slow_slip_does_not_depend_on_them(constant, factor, monkeypatch, priced):
    module, _, name = constant.partition(".")
    if module == "cost":
        priced(name, factor)
    else:
        monkeypatch.setattr(slow_slip, name, factor * getattr(slow_slip, name))
    full, run = slow_slider("dynamic"), slow_slider.__wrapped__("hybrid")
    assert run.counts["steps_spared"] > 0
    assert run.events["n_blocks"].to_list() == full.events["n_blocks"].to_list() == [1, 13]
    limit = 4e-4 * full.scene.F_N
    np.testing.assert_allclose(
        run.events["F_T_start"], full.events["F_T_start"], rtol=0, atol=limit
    )


ADVISE = {
    "engines.strains.STRAIN_SHARE": {"F_N": 16e3, "V": 0.08},
    "record.zones.RESOLVED": {"d_c": 1.5e-6},
    "record.zones.RESOLVED_ERROR": {"d_c": 1.5e-6},
    "record.zones.VISCOUS": {"d_c": 1.5e-6},
}
"""Number -> changes of `rod` for which it decides the advice."""
COUNTS = ["share_X_c0", "share_X_c"]
"""Columns of events that count blocks with a resolved zone, and so depend on `RESOLVED`."""


def advised(**changes):
    """Return a planned run, and the advice in its notes and its plan."""
    scene, how = rod(**changes), {"want": "front_speed", "tolerance": 0.02}
    record = pyfric.simulate(scene, 0.06, **how, geometry="linear", progress=False, verify="none")
    return record, (record.notes, pyfric.plan(scene, **how, t_end=0.06).lattice)


@pytest.mark.slow
@pytest.mark.parametrize("constant", ADVISE)
def test_advice_changes_and_leaves_results_alone(constant, monkeypatch):
    before, said = advised(**ADVISE[constant])
    assert len(before.events) > 3
    module, _, attribute = constant.rpartition(".")
    module = importlib.import_module(f"pyfric.{module}")
    value = getattr(module, attribute)
    for factor in (0.5, 2.0):
        monkeypatch.setattr(module, attribute, scaled(value, factor))
        after, says = advised(**ADVISE[constant])
        assert says != said
        pd.testing.assert_frame_equal(before.curve, after.curve)
        events = [one.events.drop(columns=COUNTS) for one in (before, after)]
        pd.testing.assert_frame_equal(*events)


EVENTS = {
    "fig1": (0.9, (53, 53, 51), (53, 53, 53), 14),
    "setup2": (0.5, (50, 48, 48), (49, 48, 48), 13),
    "run3": (0.5, (38, 38, 33), (38, 38, 38), 5),
    "chain": (0.5, (100, 100, 100), (100, 100, 100), 47),
}
"""Preset -> end of the run in s, events with half, once and twice `DRIVER_SHARE` and `RING_DOWN`,
main events."""


@functools.cache
def static(name):
    how = {"fidelity": "quasistatic", "geometry": "linear", "progress": False}
    return pyfric.simulate(preset(name), EVENTS[name][0], **how)


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("constant", ["DRIVER_SHARE", "RING_DOWN"])
@pytest.mark.parametrize("name", EVENTS)
def test_main_events_are_the_same_with_other_longest_pauses(name, constant, factor, monkeypatch):
    monkeypatch.setattr(pauses, constant, factor * getattr(pauses, constant))
    events = static(name).events(t_gap=pauses.longest_pause(preset(name)))
    _, *known, main = EVENTS[name]
    count = known[constant == "RING_DOWN"][[0.5, 1.0, 2.0].index(factor)]
    assert (len(events), int(events["is_main"].sum())) == (count, main)


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("constant", ["DRIVER_SHARE", "RING_DOWN"])
@pytest.mark.parametrize("V", [2e-3, 2e-2])
def test_waves_decide_the_longest_pause_of_a_fast_rod(V, constant, factor, monkeypatch):
    monkeypatch.setattr(pauses, constant, factor * getattr(pauses, constant))
    assert pauses.longest_pause(rod(V=V)) == pauses.pause_of_waves(rod(V=V))


def test_a_fast_rod_has_other_events_with_other_pauses():
    found = {}
    for V, t_end in ((2e-3, 0.06), (2e-2, 0.02)):
        how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
        record = pyfric.simulate(rod(V=V), t_end, **how)
        for factor in (0.5, 1, 2):
            events = record.events(t_gap=factor * record.method.t_gap)
            found[V, factor] = len(events), int(events["is_main"].sum())
    assert list(found.values()) == [(25, 6), (21, 6), (19, 6), (34, 25), (28, 19), (7, 5)]


@functools.cache
def at_corners(share):
    """Return the quasi-static sequence of setup 2+, whose trailing edge is nearly unloaded."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (core, packing, sequences, quasistatic):
            patch.setattr(module, "CORNER_SHARE", share)
        how = {"fidelity": "quasistatic", "geometry": "linear", "progress": False}
        return pyfric.simulate("setup2+", 0.2, **how)


@pytest.mark.parametrize(("factor", "count"), [(0.5, 76), (1.0, 76), (2.0, 84)])
def test_the_corner_share_changes_what_is_called_an_event_and_no_motion(factor, count):
    a, b = at_corners(packing.CORNER_SHARE), at_corners(factor * packing.CORNER_SHARE)
    np.testing.assert_array_equal(a.curve["F_T"], b.curve["F_T"])
    assert (len(b.events), int(b.events["is_main"].sum())) == (count, 17)


@pytest.mark.parametrize(("share", "factor"), [(0.006, 0.5), (0.015, 2.0)])
def test_forces_with_and_without_jumps_agree_where_friction_falls_little(
    share, factor, monkeypatch
):
    scene = rod(mu_s=0.6, mu_k=0.6 * (1 - share))
    how = {"fidelity": "quasistatic", "geometry": "linear", "progress": False}
    a = pyfric.simulate(scene, 0.12, **how).curve
    monkeypatch.setattr(friction, "GRADUAL", factor * friction.GRADUAL)
    b = pyfric.simulate(scene, 0.12, **how).curve
    t = np.linspace(0, 0.12, 200)
    forces = [np.interp(t, curve["t"], curve["F_T"]) / scene.F_N for curve in (a, b)]
    assert max(forces[0]) > 0.59
    apart = np.abs(np.subtract(*forces)).max()
    assert 1e-6 < apart < 0.6 * 2 * friction.GRADUAL


def test_the_docs_list_them_all():
    page = Path(__file__).parents[1] / "docs" / "explanation" / "numbers.md"
    text = page.read_text(encoding="utf-8")
    chosen = [*PLANS, "routes.SOFTEST"]
    prices = (*(f"cost.{name}" for name in PRICES), *RATED[:2])
    advice = (constant.partition(".")[2] for constant in ADVISE)
    fitted = (constant for _, constant in FITTED)
    more = ("pauses.DRIVER_SHARE", "pauses.RING_DOWN", "packing.CORNER_SHARE", "friction.GRADUAL")
    for constant in (*fitted, *chosen, *prices, *advice, *more):
        assert f"`{constant}`" in text
