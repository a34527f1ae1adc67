"""Rate-and-state friction: the law, exact blocks, an independent integration, bits, refusals."""

import functools
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rated as study
import rated_ruptures
from helpers import advance, bits, mirrored_scene, mirrored_state, refused, small
from rate_state import EVOLUTIONS, LAW, RATES, coefficient, rated, row, sliding, slow
from scipy.integrate import solve_ivp

import pyfric
from pyfric import core
from pyfric.scene import Interface, chain, laws
from pyfric.statics import loaded_state, stability_limit
from pyfric.values import SceneError

STORED = Path(__file__).parents[1] / "reference_data" / "rated"
IMEX = {"stepper": "imex", "switching": "step_end"}


def total(scene, state):
    """Return the energy of a state plus losses minus work done on it, in J."""
    stored = sum(core.energies(core.model(scene, "linear", state.u_drv0), state, state.t).values())
    return stored + state.heat.sum() + state.dissipated.sum() - state.work.sum()


# --- the law --------------------------------------------------------------------------------------


@pytest.mark.parametrize("evolution", EVOLUTIONS)
@pytest.mark.parametrize("V_c", [None, 1e-2])
def test_friction_is_that_of_the_literature(evolution, V_c):
    """Friction agrees from 1e-30 to 10 m/s and 1e-8 to 1e8 s, to a few roundings of f/a."""
    v = np.concatenate([10.0 ** np.arange(-30, 2), -(10.0 ** np.arange(-12, 2)), [0.0]])
    scene = row(len(v), evolution=evolution, V_c=V_c, alpha=0.3)
    state = loaded_state(scene).state(scene, 1e-7)
    state.y[0, 2] = v
    for theta in (1e-8, 1e-3, 1.0, 1e8):
        state.theta[:] = theta
        model = core.model(scene, "linear", state.u_drv0)
        f = core.evaluate(model, state, 0.0).f
        expected = -20.0 * coefficient(scene.interface.law, v, theta) - 0.3 * v
        np.testing.assert_allclose(f, expected.astype(float), rtol=3e-14, atol=0)


@pytest.mark.parametrize("alpha", [0.0, 16.0])
@pytest.mark.parametrize("V_c", [None, 1e-2])
def test_speed_balances_the_load(alpha, V_c):
    scene = row(8, V_c=V_c, alpha=alpha)
    law, p = scene.law, np.full(8, 20.0)
    load = np.array([-14.0, -5.0, -1e-3, 0.0, 1e-6, 1e-30, 12.0, 16.0])
    for theta in (1e-5, 1.0, 1e6):
        v = slow(scene, np.log(theta), load, speed=0.0).v  # no block is slower
        force = (p * coefficient(law.kind, v, theta)).astype(float) + alpha * v
        np.testing.assert_allclose(force, load, rtol=1e-10, atol=1e-300)


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_state_after_a_step_in_speed(evolution):
    """On a stiff spring the state has a closed form.

    Ageing law: theta relaxes as exp(-x/D_c). Nagata's law: it relaxes as exp(-x/((1 + c) D_c)).
    Slip law: ln(v theta/D_c) relaxes as exp(-x/D_c). PRZ law: v theta/(2 D_c) is a tanh.
    """
    scene = row(3, evolution=evolution)
    law, v, spring = scene.law, 1e-4, 1e12
    x, before = np.linspace(1e-5, 5e-5, 5), 0.02
    load = float(20.0 * coefficient(law.kind, v, before))  # with this load it slides at once
    how = {"load_1": spring * v, "spring": spring, "times": x / v, "end": x[-1] / v}
    found = slow(scene, np.log(before), load, **how)
    assert found.goes_on
    np.testing.assert_allclose(found.points[:, 0, 0], x, rtol=1e-7)
    steady, theta = law.D_c / v, np.exp(found.points[:, 1, 0])
    left = np.exp(-x / (law.D_c * (1 + law.c)))
    expected = {
        "ageing": lambda: steady + (before - steady) * left,
        "slip": lambda: steady * (before / steady) ** left,
        "prz": lambda: 2 * steady * np.tanh(x / (2 * law.D_c) + np.arctanh(before / (2 * steady))),
        "nagata": lambda: steady + (before - steady) * left,
    }
    np.testing.assert_allclose(theta, expected[evolution](), rtol=1e-7)


@pytest.mark.parametrize("c", [0.5, 2.0])
def test_a_sudden_step_in_speed_meets_a_part_of_the_direct_effect(c):
    """The first step of friction is a/(1 + c) ln of the ratio in Nagata's law, a ln in others."""
    scene = row(3, evolution="nagata", c=c)
    law, p, V, times = scene.law, 20.0, 1e-6, 50.0
    theta, mu = law.D_c / V, law.mu_k + (law.a - law.b) * np.log(V / law.kind.V_star)
    carried = np.log(theta) + c / law.b * mu
    # The spring is so stiff that the slip during the step is 1e-3 D_c.
    spring = 1e3 * p * law.a / law.D_c
    how = {"load_1": spring * times * V, "spring": spring, "dt": 1e-12}
    found = slow(scene, np.log(theta), p * mu, end=1e-2 * law.D_c / (times * V), **how)
    v, theta = found.v[0], np.exp(found.log_theta[0])
    assert v == pytest.approx(times * V, rel=0.02)
    after = float(coefficient(law.kind, v, theta))
    assert after - mu == pytest.approx(law.a / (1 + c) * np.log(v / V), rel=0.02)
    assert np.log(theta) + c / law.b * after == pytest.approx(carried, abs=0.02)


def test_strength_after_a_hold_grows_by_b_ln_of_time():
    """By the ageing law on a stiff spring the peak exceeds steady friction by b ln(1 + t V/D_c)."""
    scene, V, spring = row(3), 1e-4, 1e12
    law, p = scene.interface.law, 20.0
    steady = p * (law.f_star + (law.a - law.b) * np.log(V / law.V_star))
    gains, holds = [], np.array([0.01, 1.0, 100.0])
    for t in holds:
        held = slow(scene, np.log(law.D_c / V), steady, spring=spring, end=t, dt=1e-12)
        load = float(steady - spring * held.u[0])
        times = np.linspace(0, 2e-7, 200)[1:]
        steps = {"times": times, "end": times[-1], "dt": 1e-12}
        how = {"load_1": spring * V, "spring": spring} | steps
        again = slow(scene, held.log_theta, load, **how)
        force = load + spring * (V * times - again.points[:, 0, 0])
        assert force.argmax() < len(force) - 1
        gains.append(force.max() - steady)
    np.testing.assert_allclose(gains, p * law.b * np.log1p(holds * V / law.D_c), rtol=1e-4)


# --- full dynamics --------------------------------------------------------------------------------


def twin(scene, push):
    """Return the right-hand side of a chain, independent of pyfric; y holds u, v, ln(theta)."""
    N, law, p = scene.N_x, scene.interface.law, scene.p_prescribed
    cut = 0.0 if law.V_c is None else law.V_star / law.V_c

    def rates(t, y):
        u, v, theta = y[:N], y[N : 2 * N], np.exp(y[2 * N :])
        pair = scene.slider.k * np.diff(u) + scene.eta * np.diff(v)
        F = np.append(pair, 0.0) - np.append(0.0, pair)
        F[0] += push + scene.driver.K * (scene.driver.V * t - u[0])
        psi = np.log(law.V_star * theta / law.D_c + cut)
        steep = np.exp((law.f_star + law.b * psi) / law.a) / (2 * law.V_star)
        inside = v * steep
        F -= p * law.a * np.arcsinh(inside) + scene.interface.alpha * v
        rate = RATES[law.evolution](np.abs(v) * theta / law.D_c) / theta
        if law.evolution == "nagata":  # - (c/b) dmu/dt, mu = a asinh(|inside|)
            soft = law.c / np.sqrt(1 + inside**2)
            rate -= soft * law.a / law.b * steep * np.sign(v) * F / scene.m
            rate /= 1 + soft * np.abs(inside) * (1 - cut / np.exp(psi))
        return np.concatenate([v, F / scene.m, rate])

    return rates


@pytest.mark.parametrize("evolution", EVOLUTIONS)
@pytest.mark.parametrize("more", [{}, {"V_c": 0.05, "alpha": 0.2}])
def test_runs_are_those_of_an_own_integration_to_third_order(evolution, more):
    """Runs agree with SciPy's DOP853 at tolerances of rounding; speeds are 0.08 to 0.7 m/s."""
    scene, t_end = row(evolution=evolution, **more), 1e-3
    first = sliding(scene, 1e-7, [0.12, 0.1, 0.1, 0.1])
    start = np.concatenate([np.zeros(4), first.y[0, 2], np.log(first.theta)])
    push = scene.driver.K * first.u_drv0
    how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16, "max_step": 1e-6}
    exact = solve_ivp(twin(scene, push), (0, t_end), start, **how).y[:, -1]
    exact[8:] = np.exp(exact[8:])
    errors, energy = [], []
    for n in (3000, 6000):
        begin = sliding(scene, t_end / n, [0.12, 0.1, 0.1, 0.1])
        before = total(scene, begin)
        advance(scene, "linear", begin, n, **IMEX)
        found = np.concatenate([begin.y[0, 0], begin.y[0, 2], begin.theta])
        errors.append(np.abs(found / exact - 1).max())
        energy.append(abs(total(scene, begin) - before) / begin.work[0])
    assert errors[0] < 3e-7
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3, abs=0.15)
    assert energy[0] < 3e-6
    assert np.log2(energy[0] / energy[1]) == pytest.approx(3, abs=0.2)


def growth(share, V):
    """Return growth rates of small perturbations of steady sliding, measured and by theory.

    One block on a spring of `share` times the critical stiffness. Three blocks, joined by springs
    that are far stiffer, move as one.
    """
    p, m = 60.0, 3 * row(3).m
    a, b, D_c = LAW["a"], LAW["b"], LAW["D_c"]
    critical = p * (b - a) / D_c * (1 + m * V**2 / (a * p * D_c))
    scene = row(3, V=V, K=share * critical, p=p / 3)
    # x'' = -(K x + p (a/V x' + b/theta d))/m, d' = -V/D_c d - x'/V
    theta = D_c / V
    matrix = [[0, 1, 0], [-share * critical / m, -p * a / V / m, -p * b / theta / m]]
    matrix.append([0, -1 / V, -V / D_c])
    values, vectors = np.linalg.eig(np.array(matrix))
    rate, mode = values[np.argmax(values.imag)], vectors[:, np.argmax(values.imag)]
    period = 2 * np.pi / rate.imag
    steps = math.ceil(period / min(0.4 * stability_limit(scene, "imex")[0], period / 200))
    state = sliding(scene, period / steps, V)
    steady = LAW["f_star"] + (a - b) * np.log(V / scene.law.kind.V_star)
    carried = steady * p * np.array([0, 2, 1]) / 3  # by the bond to the previous block
    state.y[0, 0] = -np.cumsum(carried) / scene.slider.k
    state.u_drv0 = steady * p / scene.driver.K
    x, w, d = (mode / mode[1] * 1e-4 * V).real  # on the pair of solutions that oscillates
    state.y[0, 0] += x
    state.y[0, 2] += w
    state.theta[:] += d
    grown = []
    for _ in range(3):
        advance(scene, "linear", state, steps, budget=False, **IMEX)
        grown.append(state.y[0, 2].mean() - V)
    return np.log(grown[2] / grown[0]) / (2 * period), rate.real


@pytest.mark.parametrize("V", [0.03, 0.3])
def test_growth_rates_and_the_critical_stiffness(V):
    """Rates agree to 1 % on both sides of k_c = p (b - a)/D_c (1 + m V^2/(a p D_c))."""
    shares, found = (0.8, 0.98, 1.02, 1.25), []
    for share in shares:
        rate, expected = growth(share, V)
        assert (expected > 0) == (share < 1)
        if abs(share - 1) > 0.1:
            assert rate == pytest.approx(expected, rel=0.01)
        found.append(rate)
    assert found[1] > 0 > found[2]  # k_c lies between
    assert np.interp(0.0, found[2:0:-1], shares[2:0:-1]) == pytest.approx(1, abs=1e-3)


def test_steps_are_stable_at_any_speed():
    """Energy does not grow from 1e-12 to 10 m/s, at the stability limit of the lattice."""
    scene = small("rod").replace({"interface": rated(theta_0=1.0), "driver.V": 0.0})
    dt = 0.98 * stability_limit(scene, "imex")[0]
    for speed in (1e-12, 1e-6, 1e-2, 10.0):
        state = loaded_state(scene).state(scene, dt)
        state.y[:-1, 2] += speed * np.cos(np.arange(scene.N_x))
        model = core.model(scene, "linear", state.u_drv0)
        before = sum(core.energies(model, state, 0.0).values())
        advance(scene, "linear", state, 3000, **IMEX)
        after = sum(core.energies(model, state, 0.0).values())
        assert np.isfinite(state.y).all()
        assert np.isfinite(state.theta).all()
        assert after + state.heat.sum() + state.dissipated.sum() - state.work.sum() < before * (
            1 + 1e-3
        )
        assert np.abs(state.y[:, 2]).max() <= 1.01 * speed + 1e-9


@pytest.mark.parametrize("evolution", EVOLUTIONS)
@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_threads_variants_and_cuts_do_not_change_a_bit(evolution, geometry):
    scene = small("rod", V=0.5).replace(
        {"interface": rated(evolution=evolution, v_0=1e-2, D_c=1e-6)}
    )
    dt = 0.4 * stability_limit(scene, "imex")[0]

    def run(cuts=(1200,), **how):
        state = loaded_state(scene, geometry).state(scene, dt)
        for n in cuts:
            advance(scene, geometry, state, n, **IMEX, **how)
        return state

    first = run()
    assert np.ptp(first.theta) > 0
    assert (first.mode == 1).any()
    for cuts, how in [((1200,), {"threads": 3}), ((1, 400, 799), {}), ((600, 600), {"threads": 2})]:
        assert bits(run(cuts, **how)) == bits(first)
    for variant in (name for name, runs in core.variants().items() if runs):
        assert bits(run(variant=variant)) == bits(first)


def test_mirrored_scenes_give_mirrored_bits():
    scene = small("rod", V=0.5).replace({"interface": rated(v_0=1e-2, D_c=1e-6)})
    dt = 0.4 * stability_limit(scene, "imex")[0]
    state = loaded_state(scene).state(scene, dt)
    other = mirrored_state(state)
    for one, end in ((scene, state), (mirrored_scene(scene), other)):
        advance(one, "linear", end, 1200, **IMEX)
    assert np.array_equal(mirrored_state(other).y, state.y)
    assert np.array_equal(mirrored_state(other).theta, state.theta)
    assert (state.mode == 1).any()


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_a_state_is_positive_where_steps_do_not_resolve_it(evolution):
    """A step slips by more than 10 D_c: theta is still at least about D_c/v."""
    scene = row(V=0.1, evolution=evolution, D_c=1e-9, v_0=None, theta_0=1e-6)
    dt = 0.4 * stability_limit(scene, "imex")[0]
    state, fastest, least = sliding(scene, dt, 0.1), 0.1, np.inf
    for _ in range(100):
        advance(scene, "linear", state, 1, **IMEX)
        fastest, least = max(fastest, np.abs(state.y[0, 2]).max()), min(least, state.theta.min())
    assert 0.1 * dt > 10 * 1e-9
    assert least > 0.1 * 1e-9 / fastest


@pytest.mark.parametrize("kind", ["friction", "evolution"])
def test_a_law_that_the_core_does_not_know_is_an_error(kind, monkeypatch):
    """An unknown number of a law does not select another law."""
    scene = row()
    state = loaded_state(scene).state(scene, 1e-7)
    if kind == "evolution":
        monkeypatch.setitem(laws.EVOLUTIONS, "ageing", laws.EVOLUTIONS["ageing"]._replace(code=99))
    model = core.model(scene, "linear", state.u_drv0)
    if kind == "friction":
        model.counts[core.Counts._fields.index("law")] = 99
    elastic = np.zeros((4, 3)), np.zeros((4, 4))
    limits = core.SlowLimits(end=1.0, dt=1e-7, relative=1e-6, u=1e-12, log_theta=1e-6)
    calls = [lambda: core.evaluate(model, state, 0.0), lambda: core.energies(model, state, 0.0)]
    if kind == "evolution":
        calls.append(lambda: core.slow_slip(model, elastic, elastic, np.zeros(4), limits))
    for call in calls:
        with pytest.raises(ValueError, match="does not know this law"):
            call()


def test_explicit_steps_are_refused_by_the_core():
    scene = row()
    state = loaded_state(scene).state(scene, 1e-7)
    with pytest.raises(ValueError, match="imex"):
        advance(scene, "linear", state, 1, stepper="rk4", switching="step_end")


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"a": 1.5}, "a"),
        ({"b": -0.1}, "b"),
        ({"D_c": 10.0}, "D_c"),
        ({"theta_0": 1.0, "v_0": 1e-6}, "v_0"),
        ({"evolution": "Dieterich"}, "evolution"),
        ({"evolution": "nagata"}, "c"),
        ({"evolution": "nagata", "c": -1.0}, "c"),
        ({"evolution": "slip", "c": 2.0}, "c"),
    ],
)
def test_values_that_cannot_be_meant_are_refused(changes, field):
    refused(lambda: laws.RateAndState(**(LAW | changes)), f"interface.law.{field}")


def test_a_rate_of_stress_needs_an_evolution_effect():
    refused(lambda: row(evolution="nagata", b=0.0).law, "interface.law.b", "> 0")


def test_pmma_has_the_friction_of_its_source():
    """Above v* it is f_0 + a ln(1 + v/v*) + b f_0 ln(1 + theta/phi*) (cRacklet)."""
    law = pyfric.preset("rate_and_state_pmma").interface.law
    a, b, f_0, v_star, phi_star, D = 0.005, 0.075, 0.285, 1e-7, 3.3e-4, 5e-7
    for v in (1e-5, 1e-3, 0.1):
        for theta in (D / v, 1e-3, 1.0):
            known = f_0 + a * np.log(1 + v / v_star) + b * f_0 * np.log(1 + theta / phi_star)
            assert coefficient(law, v, theta) == pytest.approx(known, abs=2e-3)


def test_an_interface_has_no_other_coefficients():
    law = laws.RateAndState(**LAW)
    refused(lambda: chain(interface=Interface(mu_s=0.7, law=law)).law, "interface.mu_s", "f_star")
    refused(lambda: chain(interface=Interface(d_c=1e-6, law=law)), "interface.d_c", "D_c")
    scene = chain(interface=Interface(law=law))
    assert scene.replace({"interface.law.f_star": 0.5}).law.mu_s == 0.5


def test_a_state_is_needed_if_nothing_moves_at_first():
    refused(lambda: chain(V=0.0, interface=rated()), "interface.law.theta_0", "v_0")
    assert chain(V=0.0, interface=rated(theta_0=2.0)).law.theta == 2.0


def test_a_is_refused_where_speeds_at_rest_vanish():
    """At rest v is about V* exp(-(f* + b ln(V* theta/D_c))/a)."""
    refused(lambda: row(a=1e-3).law, "interface.law.a", value=0.001, within=(0.00166, 550))
    refused(lambda: row(a=[0.01, 0.01, 1e-3, 0.01]).law, "interface.law.a", "0.001")
    assert row(a=1.67e-3).law.a == 1.67e-3
    assert row(a=1e-3, b=1e-3, f_star=0.4).law.a == 1e-3


@pytest.mark.parametrize("fidelity", ["dynamic", "hybrid"])
def test_blocks_with_the_least_a_hold(fidelity):
    """After 300 years of contact the first block creeps at less than 1e-200 m/s."""
    scene = row(V=1e-3, K=1e6, a=1.67e-3, v_0=None, theta_0=1e10)
    record = pyfric.simulate(scene, 2e-3, fidelity=fidelity, progress=False)
    assert 0 < record.final_state.y[0, 2, 0] < 1e-200
    assert record.curve["F_T"].iloc[-1] == pytest.approx(2.0, rel=1e-3)  # K V t
    assert -record.motion["f"][-1].sum() == pytest.approx(2.0, rel=1e-3)


def test_fields_of_the_law_are_named_where_they_stand():
    refused(lambda: row(a=[0.01, 0.02]).law, "interface.law.a", "a list of 4")
    with pytest.raises(SceneError) as caught:
        pyfric.preset("rate_and_state", a=[0.01, 0.02])
    assert caught.value.field == "interface.law.a"
    assert "that of the preset" not in str(caught.value)
    spread = pyfric.Spread(mean=0.01, std=0.1, seed=1)
    refused(lambda: row(a=spread).law, "interface.law.a", "the spread reaches this")


def test_a_random_coefficient_is_drawn_once():
    law = row(8, f_star=pyfric.Spread(mean=0.6, std=0.05, seed=1)).law
    assert np.ptp(law.mu_s) > 0.05
    assert np.array_equal(law.mu_s, law.mu_k)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"stepper": "rk4"}, "stepper"),
        ({"switching": "located"}, "switching"),
        ({"fidelity": "quasistatic"}, "interface.law"),
    ],
)
def test_methods_without_this_friction_are_refused(options, field):
    how = {"fidelity": "dynamic", "progress": False} | options
    refused(lambda: pyfric.simulate(row(), 1e-4, **how), field)


def test_other_laws_have_no_implicit_steps():
    refused(lambda: pyfric.simulate("chain", 1e-4, fidelity="dynamic", stepper="imex"), "stepper")


# --- the study ------------------------------------------------------------------------------------


@pytest.mark.portable
def test_precursors_of_the_preset_are_those_of_full_dynamics():
    """Blocks are the same, and forces agree to a tenth of the accuracy; full dynamics is stored.

    Without viscosity of bonds between ruptures, errors of forces are 6e-5 to 8e-5 F_N.
    """
    stored = pd.read_csv(STORED / "rated_precursors.csv")
    full = stored[stored["case"] == "full dynamics"]
    record = study.run(*study.CASES["V = 0.4 mm/s"], 0.48e-3)
    events = record.events[record.events["is_main"]]
    assert len(full) == len(events) == 2
    off = events["F_T_start"].to_numpy() / record.scene.F_N - full["F_T_over_F_N"].to_numpy()
    assert 0 < np.abs(off).max() < 0.1 * record.method.accuracy
    assert events["n_blocks"].to_list() == full["n_blocks"].to_list()


@pytest.mark.portable
@functools.cache
def two_precursors():
    return study.run({}, {}, 0.49e-3)


def test_the_stored_study_is_that_of_its_command(monkeypatch):
    """First precursors of new runs agree with stored ones as closely as any processor allows."""
    stored = pd.read_csv(STORED / "rated_precursors.csv")
    assert list(dict.fromkeys(stored["case"])) == list(study.CASES)
    record = two_precursors()
    monkeypatch.setattr(study, "run", lambda *_: record)
    again = study.study(("V = 0.4 mm/s",), 0.49e-3)
    known = stored[stored["case"] == "V = 0.4 mm/s"].iloc[: len(again)].reset_index(drop=True)
    np.testing.assert_allclose(again["F_T_over_F_N"], known["F_T_over_F_N"], rtol=0, atol=1e-5)
    assert (again["n_blocks"] == known["n_blocks"]).all()
    assert study.report(stored).count("\n") == len(study.CASES)
    figure = study.draw(stored)
    assert len(figure.axes[0].lines) == 1 + len(study.SHOWN)


@pytest.mark.portable
def test_tau_over_p_after_a_precursor_is_the_friction_at_its_speed(monkeypatch):
    """In the preset this holds within 0.01; its fronts are slow."""
    record = two_precursors()
    table = rated_ruptures.ruptures(record, study.OPTIONS)
    assert len(table) == rated_ruptures.count(record) == 2
    assert (np.abs(table["tau_over_p_after"] - table["steady_friction"]) < 0.01).all()
    assert (table["tau_over_p_before"] > table["tau_over_p_after"]).all()
    assert (table["front_over_c_S"] < 0.1).all()
    assert rated_ruptures.regime(record) == "slow fronts"
    # A state grows at most by the time of rest; a rupture begins below the friction of its blocks.
    last, law = rated_ruptures.precursors(record)[-1], record.scene.interface.law
    before = record.episodes[record.episodes["event"] < last]
    slipped = before.groupby("n")["t_stop"].max().reindex(np.flatnonzero(record.region[-1]) + 1)
    theta = record.events.loc[last, "t_start"] - slipped.min()
    case = table.iloc[-1]
    rested = case["steady_friction"] + law.b * np.log(case["slip_speed_m_s"] * theta / law.D_c)
    assert case["tau_over_p_before"] < case["friction_of_onset"] < rested
    assert "V = 0.4 mm/s: 2" in rated_ruptures.report(table.assign(case="V = 0.4 mm/s"))
    monkeypatch.setattr(rated_ruptures, "fronts", lambda *_: np.nan)
    assert rated_ruptures.regime(record) == "too short for a speed"


def first_main(V, v_slip):
    """Return F_T/F_N at the start of the first main event."""
    size = {"l": "10 mm", "H": "70 mm", "h": "10 mm", "D_c": "0.3 um"}
    scene = pyfric.preset("rate_and_state", size, V=f"{V} mm/s", v_slip=f"{v_slip} mm/s")
    how = {"stop_when": "main_events", "accuracy": 1e-3, "verify": "none", "progress": False}
    record = pyfric.simulate(scene, 0.72 / V, fidelity="hybrid", **how)
    main = record.events[record.events["is_main"]]
    return float(main["F_T_start"].iloc[0] / scene.F_N)


def test_the_first_event_hangs_on_what_counts_as_slip_and_hardly_on_the_driver():
    creep, fast = [[first_main(V, share * V) for V in (0.4, 4.0)] for share in (0.25, 2.5)]
    assert creep == pytest.approx([0.325, 0.320], abs=2e-3)
    assert fast == pytest.approx([0.471, 0.486], abs=2e-3)
