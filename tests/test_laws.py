"""Friction laws as tables, each compared with an independent solution of the same equation."""

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import advance, bits, budget_error, log_bits, refused
from scipy.integrate import solve_ivp
from test_core import random_state
from test_weakening import CASES, D_C, MU_K, MU_S, SLOPE, P, rigid, sliding, slip_of_one_block

import pyfric
from pyfric import core, laws, theory
from pyfric.core import STUCK
from pyfric.scene import Spread, chain, setup1
from pyfric.scene.restless import WITHOUT_REST
from pyfric.statics import loaded_state
from pyfric.values import SceneError

KINDS = {
    name: {"law": kind(**kind.example)}
    for name, kind in laws.KINDS.items()
    if kind not in WITHOUT_REST
}
"""Laws that are tables; junctions have tests of their own."""
LAWS = KINDS | {"viscous": {"alpha": 40.0, "d_c": 0.0}}


def with_law(scene, **changes):
    return dataclasses.replace(scene, interface=dataclasses.replace(scene.interface, **changes))


def located(scene, state, n):
    log = core.Log(scene.N_x)
    model = core.model(scene, "linear", state.u_drv0)
    status = core.advance(model, state, log, n, switching="located")
    assert status == core.Status.DONE
    return log


def curve(table, nothing):
    """Return the table as a function of one number."""
    return (lambda x: nothing) if table is None else (lambda x: np.interp(x, table.x, table.y))


def one_block(scene, v, t):
    """Return u (m), and the heat (J) above mu_k p and by alpha, of m u'' = mu_s p - k_top u - f."""
    of, tables = scene.interface, scene.interface.tables
    slide, speed, age = curve(tables.slide, 0.0), curve(tables.speed, 1), curve(tables.age, 1)
    d_c = of.d_c or 1.0

    def rates(t, y):
        u, v = y[:2]
        mu = (MU_K + (MU_S - MU_K) * slide(u / d_c)) * speed(abs(v)) * age(t)
        a = ((MU_S - mu) * P - of.alpha * v - scene.k_top * u) / scene.m
        return [v, a, (mu - MU_K) * P * v, of.alpha * v**2]

    found = solve_ivp(
        rates, (0, t), [0, v, 0, 0], method="DOP853", rtol=1e-12, atol=1e-22, max_step=t / 300
    )
    return found.y[[0, 2, 3], -1]


@pytest.mark.parametrize("name", LAWS)
def test_a_block_slips_as_solve_ivp_sees_it(name):
    """The motion agrees to the order of the stepper, across all knots."""
    scene = with_law(rigid(0.3 * SLOPE), **LAWS[name])
    v = 1.2 * D_C * math.sqrt(SLOPE / scene.m)
    t = 3 * D_C / v
    u, above, viscous = one_block(scene, v, t)
    errors = []
    for n in (16, 64):
        state = sliding(scene, t / n, v)
        located(scene, state, n)
        errors.append(abs(state.y[0, 0, 0] / u - 1))
        np.testing.assert_array_equal(state.y[0, 0], state.y[0, 0, 0])
    assert errors[1] < 2e-8
    assert errors[0] > 4**3.5 * errors[1] or errors[0] < 1e-7
    np.testing.assert_allclose(state.parts[:, 0], [above, viscous], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_a_block_beside_stuck_ones_slips_like_one_of_many(name):
    """Bonds are negligible: 2e-12 N over the whole slip."""
    many = with_law(rigid(0.3 * SLOPE), **LAWS[name])
    many = dataclasses.replace(many, slider=dataclasses.replace(many.slider, k=1e-6, eta=0.0))
    tau = P * MU_S * np.array([0.9, 0.9, 1.0])
    alone = dataclasses.replace(many, top=dataclasses.replace(many.top, tau=tau))
    v, u = 1.2 * D_C * math.sqrt(SLOPE / many.m), []
    for scene, slips in ((many, [1, 1, 1]), (alone, [0, 0, 1])):
        state = sliding(scene, 3 * D_C / v / 16, v)
        state.mode[:] = slips
        state.y[0, 2] *= slips
        located(scene, state, 16)
        u.append(state.y[0, 0, 2])
    assert u[1] == pytest.approx(u[0], rel=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_linear_weakening_is_the_closed_form(name):
    scene = rigid(CASES[name])
    v = 1.2 * D_C * math.sqrt(SLOPE / scene.m)
    t, n = 2.5 * D_C / v, 2048
    state = sliding(scene, t / n, v)
    located(scene, state, n)
    exact = slip_of_one_block(scene.k_top, scene.m, v, t)
    assert state.y[0, 0, 0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("name", KINDS)
def test_energy_closes_with_every_kind(name):
    """The budget closes to the order of the stepper, with separate parts of the heat."""
    scene = setup1(L=0.01, H=0.005, F_N=200.0, V=0.3)
    scene = with_law(scene, d_c=1e-6, alpha=3.0, **KINDS[name])
    how = {"fidelity": "dynamic", "geometry": "linear", "sample": 2e-5, "progress": False}
    left = []
    for dt in (1.6e-6, 8e-7):
        record = pyfric.simulate(scene, 1.2e-3, dt=dt, energies=True, **how)
        left.append(budget_error(record) / record.curve["work_driver"].iloc[-1])
    assert left[1] < 2e-8
    assert left[0] > 5 * left[1]
    last, state = record.curve.iloc[-1], record.final_state
    assert last["friction_heat"] > 0.05 * last["work_driver"]
    parts = tuple(map(math.fsum, state.parts))
    assert (last["weakening_heat"], last["viscous_heat"]) == pytest.approx(parts, rel=1e-13)
    assert 0 < last["viscous_heat"] < last["friction_heat"] - last["weakening_heat"]


@pytest.mark.parametrize("name", KINDS)
def test_threads_variants_and_parts_do_not_change_a_bit(name, tmp_path):
    spread = Spread(mean=0.7, range=0.02, seed=1)
    scene = with_law(setup1(L=0.04, H=0.02, V=0.5), d_c=1e-6, alpha=3.0, mu_s=spread, **KINDS[name])
    start = random_state(scene, "linear")

    def made(state, n=40, **options):
        return advance(scene, "linear", state, n, switching="located", **options)

    whole = start.copy()
    log = made(whole)
    assert log.n_switch > 20
    others = [{"threads": 2}, {"threads": 4}]
    others += [{"variant": name} for name, runs in core.variants().items() if runs]
    for options in others:
        state = start.copy()
        assert log_bits(made(state, **options)) == log_bits(log), options
        assert bits(state) == bits(whole), options
    made(start, 17)
    start.save(tmp_path / "state.npz")
    state = core.State.load(tmp_path / "state.npz")
    made(state, 23)
    assert bits(state) == bits(whole)


def test_the_exponential_is_followed():
    left = laws.ExponentialWeakening().tables(laws.Means(0.7, 0.45, 1e-6)).slide
    x = np.linspace(0, 20, 4001)
    assert np.abs(left(x) - np.exp(-x)).max() < 1e-3
    assert left(8.0) == 0
    assert len(left.x) < 50


def slide_hold_slide(law):
    """Return the times of rest (s) of a driven block, and mu at the end of each.

    The driver holds three times, and moves again after each hold.
    """
    K, V, heavy = 1e6, 0.05, (P, 1e7, 1e7)
    scene = with_law(chain(L=5e-3, p=heavy, k=1e3, K=K, V=V, eta=5.0, M=3e-3), law=law)
    held = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, V=0.0))
    state, found = loaded_state(scene).state(scene, 1e-6), []
    for hold in (1e-3, 1e-2, 1e-1):
        while True:  # until the block has slipped, and sticks
            log = located(scene, state, 50).switches()
            if (log["new"] == STUCK).any():
                break
        state = changed_speed(state, V, 0.0)
        assert not located(held, state, round(hold / state.dt)).n_switch
        state = changed_speed(state, 0.0, V)
        stuck_since, u = state.t_0[0], state.y[0, 0, 0]
        assert state.mode[0] == STUCK
        while True:
            log = located(scene, state, 50).switches()
            if len(log["t"]):
                break
        t = log["t"][0]
        force = K * (V * t - (u - state.u_drv0)) - scene.slider.k * u
        found.append((t - stuck_since, force / P))
    return np.array(found).T


def test_slide_hold_slide_heals_by_B_per_decade():
    B, t_c = 0.02, 1e-5
    age, mu = slide_hold_slide(laws.Ageing(B=B, t_c=t_c))
    slopes = np.diff(mu) / np.diff(np.log10(1 + age / t_c))
    np.testing.assert_allclose(slopes, B, rtol=1e-3)
    np.testing.assert_allclose(mu, 0.7 + B * np.log10(1 + age / t_c), atol=1e-3 * B)


def test_slide_hold_slide_heals_exponentially():
    gain, t_c = 0.03, 4e-3
    age, mu = slide_hold_slide(laws.ExponentialHealing(gain=gain, t_c=t_c))
    np.testing.assert_allclose(mu, 0.7 - gain * np.expm1(-age / t_c), atol=1e-3 * gain)
    assert 0.3 < (mu[0] - 0.7) / gain < 0.7


def changed_speed(state, old, new):
    """Return the state for a driver with another speed at the same position."""
    state = state.copy()
    state.u_drv0 += (old - new) * state.t
    return state


@pytest.mark.parametrize(
    ("v", "alpha", "eta"),
    [
        (0.14, 1.0, 0.0),
        (0.2, 1.0, 0.0),
        (0.8, 0.1, 0.0),
        (0.95, 0.3, 0.1**0.5),
        (2.0, 0.0, 0.1**0.5),
    ],
)
def test_fronts_of_the_viscous_chain_have_the_exact_speed(v, alpha, eta):
    """Speeds are those of Wiener-Hopf theory; the slowest is 14 % of c."""
    mu_s, mu_k, p, n, released = 0.7, 0.45, 10.0, 320, 20
    taubar = float(theory.chain_prestress(v, alpha, eta))
    tau = p * (mu_k + taubar * (mu_s - mu_k))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tau, eta=0.0, K=1e-3, V=0.0)
    unit, impedance = math.sqrt(scene.m / scene.slider.k), math.sqrt(scene.m * scene.slider.k)
    slider = dataclasses.replace(scene.slider, eta=eta * impedance)
    scene = with_law(dataclasses.replace(scene, slider=slider), alpha=alpha * impedance)
    state = loaded_state(scene).state(scene, min(0.15, 0.097 / v) * unit)
    state.mode[:released] = 1
    log = core.Log(n, 5000, 200)
    model = core.model(scene, "linear", state.u_drv0)
    steps = round(1.1 * (n - released) / v * unit / state.dt)
    assert core.advance(model, state, log, steps, switching="located") == core.Status.DONE
    switches = log.switches()
    first = switches["old"] == STUCK
    block, t = switches["block"][first], switches["t"][first]
    late = block >= n // 2
    speed = np.polyfit(t[late], block[late], 1)[0] * unit
    assert speed == pytest.approx(v, rel=1e-4)


def test_refusals_name_knot_and_value():
    scene = chain(L=5e-3)
    for law, text in (
        (lambda: laws.SpeedDependent(v=(0.0, 1.0), factor=(1.1, 0.5)), "too large"),
        (lambda: laws.SpeedDependent(v=(0.0, 1.0, 1.0), factor=(1, 0.5, 0.4)), "knot 3"),
        (lambda: laws.SpeedDependent(v=(0.1, 1.0), factor=(1.0, 0.5)), "start at 0"),
        (lambda: laws.SpeedDependent(v=(0.0, 1.0), factor=(1.0,)), "lengths"),
        (lambda: laws.SpeedDependent(v=(0.0, 1.0), factor=(1.0, -0.5)), "factor"),
        (lambda: laws.TabulatedLaw(slip=(0.0, 1e-6), mu=(0.7, 0.5)), "mu_k"),
        (lambda: laws.TabulatedLaw(slip=(0.0, 1e-6), mu=(0.8, 0.45)), "too large"),
        (lambda: laws.TabulatedLaw(slip=(0.0, 1e-6)), "missing"),
        (lambda: laws.TabulatedLaw(contact_time=(0.0, 1.0), gain=(0.1, 0.0)), "gain"),
        (lambda: laws.TabulatedLaw.of(slide=(lambda s: 0.7 if s < 0.3 else 0.45, 1.0)), "jumps"),
        (lambda: laws.TabulatedLaw.of(slide=(lambda s: math.nan, 1.0)), "finite"),
        (lambda: laws.TabulatedLaw.of(slide="nowhere.csv"), "CSV"),
        (lambda: laws.TabulatedLaw.of(slide=5), "a CSV file, a function"),
        (lambda: laws.ExponentialWeakening(), "d_c"),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=text):
            with_law(scene, law=law())


@pytest.mark.parametrize(
    ("table", "function", "text"),
    [
        ("hold", lambda t: "x", "hold = 'x': the function at 0 s: not a number"),
        ("age", lambda t: math.inf, "age = inf: the function at 0 s: not a finite number"),
        ("slide", lambda s: None, "slide: the function at 0 m: a number is needed, not NoneType"),
        ("speed", lambda v: float(v > 0.3), "speed = <function.*: below .* m/s: it jumps"),
    ],
)
def test_refusals_of_functions_name_the_field(table, function, text):
    with pytest.raises(SceneError, match=rf"^interface\.law\.{text}.*; allowed: "):
        laws.TabulatedLaw.of(**{table: (function, 1.0)})


@pytest.mark.parametrize("periods", [1, 2, 4, 8])
def test_tables_follow_functions_with_equal_values_at_quarters(periods):
    end = 3e-6

    def wave(s):
        return 0.45 + 0.125 * (1 + math.cos(2 * math.pi * periods * s / end))

    law = laws.TabulatedLaw.of(slide=(wave, end))
    s = np.linspace(0, end, 997)
    np.testing.assert_allclose(np.interp(s, law.slip, law.mu), [*map(wave, s)], atol=4e-4)


def test_a_law_of_ones_own_takes_ten_lines():
    """The code is that of the page."""
    page = (Path(__file__).parents[1] / "docs" / "laws.md").read_text(encoding="utf-8")
    code = page[page.index("```python\n") + 10 :].split("```")[0]
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 10
    found = {}
    exec(code, found)
    scene, slide = found["scene"], found["scene"].interface.tables.slide
    s = np.linspace(0, 3e-6, 101)
    np.testing.assert_allclose(slide(s), (1 - s / 3e-6) ** 2, atol=1e-3)
    assert found["record"].scene == scene == pyfric.Scene.from_toml(scene.to_toml())


@pytest.mark.parametrize("name", laws.KINDS)
def test_the_page_names_every_kind(name):
    page = (Path(__file__).parents[1] / "docs" / "laws.md").read_text(encoding="utf-8")
    assert f"| `{name}` |" in page


CSV = "# of a test\nslip (um), mu\n0, 0.7\n\n0.5, 0.6\n3, 0.45\n"


def csv_scene(folder, content, name="friction.csv", table="slide"):
    """Return the scene file of the default chain, with a law from a CSV file in a subfolder."""
    (folder / "laws").mkdir(exist_ok=True)
    (folder / "laws" / name).write_text(content)
    law = f'\n[interface.law]\nkind = "table"\n{table} = "laws/{name}"\n'
    file = folder / "scene.toml"
    file.write_text(chain(L=5e-3).to_toml() + law)
    return file


def test_the_end_of_a_function_has_a_unit():
    def fall(s):
        return 0.7 - 0.25 * min(s / 3e-6, 1.0)

    found = laws.TabulatedLaw.of(slide=(fall, "3 um"))
    assert found == laws.TabulatedLaw.of(slide=(fall, 3e-6))
    for end in ("3 N", "-3 um", -1.0, "3"):
        with pytest.raises(SceneError, match=r"interface\.law\.slide\.end"):
            laws.TabulatedLaw.of(slide=(fall, end))


def test_a_table_takes_the_place_of_the_coefficients():
    law = laws.TabulatedLaw(slip=(0.0, 3e-6), mu=(0.66, 0.41))
    before = chain(L=5e-3, mu_s=0.7, mu_k=0.45)
    interface = before.replace(law=law).interface
    assert (interface.law, interface.mu_s, interface.mu_k) == (law, 0.66, 0.41)
    with pytest.raises(SceneError, match="mu_k"):
        before.replace(law=law, mu_k=0.3)


def test_scene_files_name_tables_and_records_hold_them(tmp_path, monkeypatch):
    file = csv_scene(tmp_path, CSV)
    scene = pyfric.Scene.from_toml(file)
    law = laws.TabulatedLaw(slip=(0.0, 5e-7, 3e-6), mu=(0.7, 0.6, 0.45))
    assert scene.interface.law == law
    assert laws.TabulatedLaw.of(slide=tmp_path / "laws" / "friction.csv") == law
    record = pyfric.simulate(scene, 1e-4, fidelity="dynamic", progress=False)
    saved = record.save(tmp_path / "run.nc")
    for one in (file, *(tmp_path / "laws").iterdir()):
        one.unlink()
    monkeypatch.chdir("/")
    here = pyfric.Record.load(saved)
    assert here.scene == scene
    on = pyfric.simulate(scene, 2e-4, initial=here, progress=False)
    assert on.status == "complete"


@pytest.fixture
def offer(tmp_path, monkeypatch):
    """Make an installed package that offers laws."""
    monkeypatch.syspath_prepend(tmp_path)

    def made(package, **laws):
        lines = (f"{name} = {package}:{name}" for name in laws)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("\n".join(["[pyfric.laws]", *lines, ""]))
        text = "".join(f"{name} = {law}\n" for name, law in laws.items() if law)
        (tmp_path / f"{package}.py").write_text(f"import pyfric\n{text}")
        monkeypatch.delitem(sys.modules, package, raising=False)

    return made


def test_a_law_of_another_package_is_found_by_its_name(offer):
    columns = {"slip": [0.0, 3e-6], "mu": [0.7, 0.45]}
    offer("quarry", granite=columns, marble=f"pyfric.laws.TabulatedLaw(**{columns})")
    law = laws.named("granite")
    assert law == laws.named("marble") == laws.TabulatedLaw(**columns)
    scene = pyfric.preset("fig1", law=law)
    assert pyfric.Scene.from_toml(scene.to_toml()) == scene  # works without the package


def test_laws_that_packages_do_not_offer_are_refused(offer):
    with pytest.raises(SceneError, match="granite"):
        laws.named("granite")
    offer("quarry", granite="1", marble="", slate={"slip": [0.0, 3e-6], "mu": [0.7, -0.1]})
    with pytest.raises(SceneError, match=r"granit.*did you mean 'granite'"):
        laws.named("granit")
    with pytest.raises(SceneError, match=r"granite of quarry is no table"):
        laws.named("granite")
    with pytest.raises(SceneError, match=r"quarry.*marble"):
        laws.named("marble")
    refused(lambda: laws.named("slate"), "interface.law.mu", value=-0.1, within=(0,))
    offer("pit", granite={})
    with pytest.raises(SceneError, match=r"offered by pit, quarry"):
        laws.named("granite")
