"""Two levels and their difference: runs with known errors, closed forms, traps."""

import dataclasses
import math

import numpy as np
import pytest
from helpers import small_rod

import pyfric
from pyfric.engines import Options, RunError
from pyfric.planning.levels import first_step, levels, of_named
from pyfric.planning.pairs import PERTURBATION, SAFETY, Asked, Made, Pair
from pyfric.planning.simulation import leveled
from pyfric.record import Record
from pyfric.scene import Spread, chain, preset, setup1
from pyfric.statics import EquilibriumError, stability_limit


@pytest.fixture(scope="module")
def ladder():
    return pyfric.simulate(small_rod(), 1.5, fidelity="quasistatic")


def main_events(record):
    """Return the numbers of the main events."""
    return record.events.index[record.events["is_main"]]


class Known:
    """Runs with known errors of start forces, over F_N.

    `static` is the error without inertia, `bonds` that of linear geometry, and `step` that of the
    first step of a plan, of order 6. Steps of at least `turn` first steps take a wrong turn: an
    event is 0.1 L longer, and the next event starts at 0.005 F_N more. From main event `chaos` on,
    runs differ by `noise` for any step.
    """

    def __init__(
        self, ladder, *, static=0.0, bonds=0.0, step=0.0, turn=np.inf, chaos=None, noise=1.0
    ):
        self.ladder, self.static, self.bonds, self.step = ladder, static, bonds, step
        self.turn, self.chaos, self.noise = turn, chaos, noise
        self.main, self.asked, self.fails = main_events(ladder), [], {}
        self.longest = first_step(ladder.scene, Options())

    def run(self, scene, t_end, options, *, enough=None, initial=None, progress=None):
        if options.fidelity in self.fails:
            raise self.fails[options.fidelity]
        self.asked.append((options.fidelity, options.geometry, options.stepper, options.dt))
        share = 0.0 if options.dt == "auto" else options.dt / self.longest
        static = options.fidelity == "quasistatic"
        off = self.static * static + self.bonds * (options.geometry == "linear" and not static)
        off += self.step * share**6
        method = dataclasses.replace(
            self.ladder.method,
            engine=options.fidelity,
            geometry=options.geometry,
            dt=None if static else options.dt,
            stepper="" if static else options.stepper,
            accuracy=options.accuracy,
            sample=10**6,
        )
        events = self.ladder.events
        events.loc[events["is_main"], "F_T_start"] += off * scene.F_N
        if share >= self.turn:
            events.loc[self.main[2], "L_p_over_L"] += 0.1
            events.loc[self.main[3], "F_T_start"] += 0.005 * scene.F_N
        if self.chaos is not None:
            by = self.noise * len(self.asked) * scene.F_N
            events.loc[self.main[self.chaos :], "F_T_start"] += by
        counts = {"steps": 100, "block_evaluations": 100}
        counts = {"releases": 1, "static_events": 1} if static else counts
        return dataclasses.replace(self.ladder, method=method, events=events, counts=counts)

    def made(self, **options):
        scene = self.ladder.scene
        options = Options(**{"budget": "1000 x"} | options).on(scene)
        asked = Asked(scene=scene, t_begin=0.0, t_end=1.5, options=options, run=self.run)
        of = levels(scene, options) if options.fidelity == "auto" else of_named(scene, options)
        return leveled(asked, of)


def engines(known):
    return [(engine, geometry) for engine, geometry, *_ in known.asked]


QUASISTATIC, LINEAR, FINITE = (
    ("quasistatic", "linear"),
    ("hybrid", "linear"),
    ("hybrid", "finite"),
)


@pytest.mark.parametrize(
    ("errors", "tolerance", "expected"),
    [
        ({}, 0.1, [QUASISTATIC, FINITE]),
        ({"static": 0.04}, 0.05, [QUASISTATIC, FINITE]),
        ({"static": 0.09}, 0.05, [QUASISTATIC, FINITE, FINITE]),
        ({"bonds": 0.01}, 0.02, [LINEAR, FINITE]),
        ({"bonds": 0.04}, 0.02, [LINEAR, FINITE, FINITE]),
        ({"bonds": 0.04, "step": 0.3}, 0.02, [LINEAR, *[FINITE] * 3]),
    ],
)
def test_levels_are_made_until_two_agree_and_the_finer_one_is_returned(
    ladder, errors, tolerance, expected
):
    known = Known(ladder, **errors)
    record = known.made(tolerance=tolerance)
    assert engines(known) == expected
    assert (record.method.engine, record.method.geometry) == expected[-1]
    assert record.errors.holds
    assert record.errors.factor == 1
    assert record.timings["verification"] >= 0


def test_the_error_is_that_of_the_coarser_run(ladder):
    record = Known(ladder, static=0.04, bonds=0.001).made(tolerance=0.05)
    assert record.errors.start == pytest.approx(0.04)
    assert str(record.errors.by[0]).startswith("quasistatic, linear geometry")
    record = Known(ladder, bonds=0.001).made(tolerance=0.02)
    assert record.errors.start == pytest.approx(0.001)
    assert str(record.errors.by[0]).startswith("hybrid, linear geometry")
    known = Known(ladder, bonds=0.4, step=1e-3)
    record = known.made(tolerance=0.01)
    steps = [dt / known.longest for *_, dt in known.asked]
    assert steps == pytest.approx([1, 2 / 3, 4 / 9])
    off = [1e-3 * share**6 for share in steps]
    assert record.errors.start == pytest.approx(off[1] - off[2], rel=1e-6)


def test_an_event_that_turned_has_a_factor_of_safety(ladder):
    """The difference of 0.005 F_N is within 0.01, but three times 0.005 is not."""
    known = Known(ladder, turn=0.9)
    record = known.made(tolerance=0.012)
    assert record.method.dt == pytest.approx(known.asked[-1][-1])
    assert len(known.asked) == 3
    assert record.errors.holds
    turned = Known(ladder, turn=0.9)
    pair = [
        Made(level, turned.run(ladder.scene, 1.5, level.options(Options())), 0.0)
        for level in levels(ladder.scene, Options())[:2]
    ]
    asked = Asked(scene=ladder.scene, t_begin=0.0, t_end=1.5, options=Options(), run=turned.run)
    errors = Pair(asked, *pair).errors()
    assert errors.factor == SAFETY
    assert errors.start == pytest.approx(SAFETY * 0.005)
    assert errors.holds is False


def test_a_level_beyond_the_budget_is_not_made_and_said(ladder):
    errors = {"bonds": 0.4}
    for budget, levels_made in (("1 x", 2), ("1 us", 2), ("1000 x", 3), (1e3, 3)):
        known = Known(ladder, **errors)
        record = known.made(tolerance=0.01, budget=budget)
        assert len(known.asked) == levels_made
        said = [note for note in record.notes if note.startswith("not made: hybrid, finite")]
        assert len(said) == (levels_made == 2)
        assert record.errors.holds is (levels_made == 3)
    for wrong in ("0 x", "0.5 x", "x", "3 y", -1.0, 0.0, True):
        with pytest.raises(pyfric.SceneError, match="budget"):
            Options(budget=wrong)


def test_without_verification_one_level_is_made(ladder):
    for tolerance, expected in ((0.1, QUASISTATIC), (0.03, LINEAR), (0.01, FINITE), (1e-4, FINITE)):
        known = Known(ladder)
        record = known.made(tolerance=tolerance, verify="none")
        assert engines(known) == [expected]
        assert record.errors is None


def test_a_full_verification_makes_a_level_more_and_a_faster_driver(ladder):
    known = Known(ladder, static=0.04)
    record = known.made(tolerance=0.05, verify="full")
    assert engines(known) == [QUASISTATIC, FINITE, FINITE, FINITE]
    assert known.asked[2] == known.asked[3]
    assert record.method.geometry == "finite"
    assert record.errors.holds


def test_a_run_that_a_slightly_faster_driver_changes_does_not_hold(ladder):
    known = Known(ladder, chaos=4, noise=1e-5)
    plain = known.run

    def run(scene, *how, **more):
        faster = scene != ladder.scene
        record = plain(ladder.scene, *how, **more)
        if faster:
            assert scene.driver.V == ladder.scene.driver.V * (1 + PERTURBATION)
            events = record.events
            events.loc[known.main[4:], "F_T_start"] += 0.3 * scene.F_N
            record = record.replace(events=events)
        return record

    known.run = run
    errors = known.made(tolerance=0.05, verify="full").errors
    starts = ladder.events["t_start"]
    assert errors.holds is None
    assert starts[known.main[3]] < errors.until < starts[known.main[4]]
    assert "a driver that is faster by 1e-09" in str(errors)


def test_sensitivity_of_a_driver_that_stands_still_is_not_measured(ladder):
    scene = preset("fig1", V=0.0)
    record = pyfric.simulate(scene, 1e-4, verify="full", progress=False)
    assert "sensitivity was not measured: no driver moves" in record.notes


# --- where runs do not agree ---------------------------------------------------------------------


def test_from_when_on_single_events_cannot_be_trusted_is_said(ladder):
    known = Known(ladder, chaos=4)
    record = known.made(tolerance=0.05)
    errors, starts = record.errors, ladder.events["t_start"]
    assert starts[known.main[3]] < errors.until < starts[known.main[4]]
    assert errors.holds is None
    assert errors.events == 4
    assert errors.start < 1e-12
    assert errors.statistics["main events"][1] == 0
    assert errors.verdict.endswith(f"up to {errors.until:.6g} s")
    assert any("single events cannot be trusted" in note for note in record.notes)


def test_where_no_event_can_be_trusted_the_errors_of_all_are_reported(ladder):
    errors = Known(ladder, chaos=0).made(tolerance=0.05).errors
    assert (errors.until, errors.holds) == (None, False)
    assert errors.start >= 1
    assert "does not hold, BEYOND" in str(errors)


@pytest.mark.parametrize("failed", ["quasistatic", "hybrid"])
def test_a_level_that_fails_is_left_out_and_said(ladder, failed):
    known = Known(ladder)
    known.fails[failed] = EquilibriumError("it does not settle", np.nan, 0.0, 1)
    record = known.made(tolerance=0.1)
    assert failed not in {engine for engine, _ in engines(known)}
    assert any(f"left out: {failed}" in note and "settle" in note for note in record.notes)
    if failed == "hybrid":
        assert record.errors is None
        assert any("errors were not measured: no other level" in note for note in record.notes)


def test_the_error_of_a_run_of_which_no_level_can_be_made_is_raised(ladder):
    known = Known(ladder)
    known.fails["quasistatic"] = EquilibriumError("it does not settle", np.nan, 0.0, 1)
    known.fails["hybrid"] = RunError("the motion is not finite", ladder)
    with pytest.raises(RunError) as failure:
        known.made(tolerance=0.1)
    assert any("left out: quasistatic" in note for note in failure.value.record.notes)


def test_a_finer_run_that_is_interrupted_measures_as_far_as_it_goes(ladder):
    known = Known(ladder, static=1e-3)
    plain, t = known.run, float(ladder.events["t_start"][known.main[3]]) + 0.01

    def run(scene, t_end, options, **how):
        record = plain(scene, t_end, options, **how)
        if options.fidelity == "quasistatic":
            return record
        part = pyfric.simulate(scene, t, fidelity="quasistatic")
        return part.replace(method=record.method, status="interrupted")

    known.run = run
    record = known.made(tolerance=0.1)
    assert record.method.engine == "quasistatic"
    assert record.status == "complete"
    assert record.errors.holds is None
    assert record.errors.covered == pytest.approx(t)
    assert "NOT MEASURED from" in record.notes[-1]


def test_weakening_that_no_step_resolves_is_not_measured(ladder):
    """Friction drops at once in both runs."""
    scene = small_rod(d_c=1e-12)
    known = Known(ladder)
    options = Options(tolerance=0.1).on(scene)
    asked = Asked(scene=scene, t_begin=0.0, t_end=1.5, options=options, run=known.run)
    of = [level for level in levels(scene, options) if level.dt is not None]
    made = [Made(level, known.run(scene, 1.5, level.options(options)), 0.0) for level in of[-2:]]
    errors, notes = Pair(asked, *made).as_far_as_it_goes()
    assert errors.measured() is None
    assert "do not resolve weakening" in notes[0]


# --- named engines -------------------------------------------------------------------------------


def test_a_named_run_is_returned_and_compared_with_half_its_step(ladder):
    known = Known(ladder, step=1e-3)
    dt = 0.5 * known.longest
    record = known.made(fidelity="hybrid", dt=dt, verify="sample", tolerance=0.01)
    assert record.method.dt == dt
    assert known.asked[1] == ("hybrid", "finite", "rk46", pytest.approx(dt / 2))
    off = 1e-3 * 0.5**6 * (1 - 1 / 64)
    assert record.errors.start == pytest.approx(SAFETY * off)


def test_named_linear_geometry_is_compared_with_finite_geometry(ladder):
    record = Known(ladder, bonds=0.01).made(fidelity="hybrid", geometry="linear", verify="sample")
    assert record.method.geometry == "linear"
    assert record.errors.start == pytest.approx(SAFETY * 0.01)
    assert record.errors.holds is False


def test_a_named_static_sequence_is_compared_with_dynamics(ladder):
    known = Known(ladder, static=0.02)
    record = known.made(fidelity="quasistatic", verify="sample", tolerance=0.1)
    assert record.method.engine == "quasistatic"
    assert engines(known)[1] == FINITE
    assert record.errors.start == pytest.approx(SAFETY * 0.02)


def one_block(dt_share):
    """Return one undamped block that slips once; its neighbour's load is too large to move.

    m u'' = K V t - (K + k) u - mu_k p from u = 0, where K V t = mu_s p.
    """
    scene = chain(
        p=(500.0, 2500.0, 2500.0), L=5e-3, k=2e6, M=3e-3, K=1e6, V=0.5, mu_s=0.7, mu_k=0.4, eta=0.0
    )
    t_0 = 0.7 * 500.0 / (1e6 * 0.5)
    how = {"fidelity": "dynamic", "dt": dt_share * stability_limit(scene)[0], "t_gap": 1e-5}
    record = pyfric.simulate(scene, t_0 + 2e-4, **how, verify="sample", progress=False)
    m, stiff, drop, rate = scene.m, 3e6, 0.3 * 500.0, 1e6 * 0.5
    omega = math.sqrt(stiff / m)
    # u = (drop/stiff)(1 - cos) + rate/stiff (t - sin/omega); u' = 0 again at omega t = 2 pi - 2 a
    a = math.atan(rate / (omega * drop))
    t = (math.pi + 2 * a) / omega
    u = drop / stiff * (1 - math.cos(omega * t)) + rate / stiff * (t - math.sin(omega * t) / omega)
    return record, 0.7 * 500.0 + rate * t - 1e6 * u


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_the_measured_error_bounds_that_of_a_closed_form(share):
    record, exact = one_block(share)
    error = abs(record.events.iloc[0]["F_T_arrest"] - exact) / record.scene.F_N
    assert error > 1e-9
    assert error <= record.errors.arrest <= 2 * SAFETY * error


# --- runs ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made():
    scene = setup1(L=0.03, H=0.015, V=5e-3, F_N=800.0)
    return pyfric.simulate(scene, 0.03, want="front_speed", tolerance=0.03, progress=False)


def test_a_planned_run_measures_its_errors(made):
    errors = made.errors
    assert (errors.want, errors.tolerance) == ("front_speed", 0.03)
    assert errors.holds
    assert 0 < errors.measured() == errors.speed_95 <= errors.speed_worst
    assert errors.events > 2
    how = {"fidelity": "dynamic", "dt": made.method.dt / 2, "energies": False}
    fine = pyfric.simulate(made.scene, 0.03, **how, progress=False)
    real = pyfric.record.differences(made, fine).errors()
    assert real["speed_95"] <= errors.speed_95


def test_a_record_keeps_its_errors(made, tmp_path):
    path = made.save(tmp_path / "a.nc")
    assert Record.load(path).errors == made.errors
    assert str(made.errors) in made.summary()


def test_what_is_not_asked_for_is_not_measured():
    scene = small_rod(V=0.05)
    for how in ({"verify": "none"}, {"fidelity": "hybrid"}):
        assert pyfric.simulate(scene, 2e-3, **how).errors is None
    with pytest.raises(pyfric.SceneError, match="verify"):
        pyfric.Options(verify="some")


def truth(record):
    """Return full dynamics with a fifth of the step of a record, up to the record's end."""
    how = {"fidelity": "dynamic", "dt": record.method.dt / 5, "t_gap": record.method.t_gap}
    how |= {"energies": False, "progress": False}
    return pyfric.simulate(record.scene, record.final_state.t, **how)


ROUNDING = 1e-7
"""Errors of full dynamics with a fifth of the step are of this size, over F_N."""
DISORDERED = setup1(
    L=0.03, H=0.01, F_N=490.0, h=5e-3, K=2e6, V=0.049, mu_s=Spread(mean=0.7, std=0.05, seed=4)
)
TRAPS = {
    "last stop within t_gap before the end": (DISORDERED, 0.012, 0.02, None),
    "ended by a condition just inside an event": (
        setup1(L=0.03, H=0.01, F_N=1000.0, h=5e-3, K=2e6, V=0.02),
        0.05,
        0.00212,
        "L_p = 0.3",
    ),
    "the same at 2 kN": (
        setup1(L=0.03, H=0.01, F_N=2000.0, h=5e-3, K=2e6, V=0.02),
        0.05,
        0.00212,
        "L_p = 0.3",
    ),
}


@pytest.mark.parametrize(("scene", "t_end", "tolerance", "ends"), TRAPS.values(), ids=TRAPS)
def test_what_ends_inside_an_event_is_measured_or_said(scene, t_end, tolerance, ends):
    """A run that ends inside an event has a measured error, or a note that it has none."""
    how = {"tolerance": tolerance, "stop_when": ends, "t_gap": 3e-4}
    record = pyfric.simulate(scene, t_end, **how, progress=False)
    real = pyfric.record.differences(record, truth(record)).errors()
    assert record.errors.events > 0
    if record.errors.holds:
        measured = max(record.errors.measured(), ROUNDING)
        assert max(real["start"] or 0.0, real["arrest"] or 0.0) <= measured
    else:
        assert "NOT MEASURED" in str(record.errors) or "BEYOND" in str(record.errors)


@pytest.mark.parametrize("side", ["left", "right"])
def test_levels_do_not_agree_on_a_wrong_history(side):
    """With steps of RK4 of 0.87 and 0.9 of its limit, events 3 to 6 are equally wrong in both.

    The oracle is full dynamics with steps of a tenth of the limit.
    """
    slider = {"L": 0.02, "H": 0.0125, "h": 0.0025, "K": 2747160.0, "eta": 11.2631, "F_N": 94.0443}
    interface = {"mu_s": 0.571278, "mu_k": 0.435512, "k_f": 9075060.0}
    scene = pyfric.setup1(**slider, **interface, V=4.05157e-4, side=side)
    record = pyfric.simulate(scene, 0.06, tolerance=0.02, progress=False)
    events = record.events
    starts = events["F_T_start"][events["is_main"]] / scene.F_N
    known = [0.3682, 0.4101, 0.4407, 0.4655, 0.4872, 0.4292]
    np.testing.assert_allclose(starts, known, rtol=0, atol=1e-4)
    assert record.errors.holds
    assert record.errors.measured() < 1e-5
