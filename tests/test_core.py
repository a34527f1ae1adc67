"""The Fortran core, compared with the twin, with itself, and with exact results."""

import dataclasses
import os
import re
from pathlib import Path

import numpy as np
import pytest
import twin
from helpers import GEOMETRIES, advance, bits, log_bits, mirrored_state, run_python, small
from tolerances import ROUNDING

from pyfric import core
from pyfric.core import OPEN, STUCK, State, StateError, builds
from pyfric.scene import LAWS, Interface, laws, setup1, setup2
from pyfric.statics import loaded_state, stability_limit
from pyfric.values import SceneError

CLOCKS = small().law.memory
VARIANTS = [
    pytest.param(name, marks=[] if runs else pytest.mark.skip(f"this processor cannot run {name}"))
    for name, runs in core.variants().items()
]


SCENES = [
    small(),
    small("free"),
    small(side="right", mu_s=0.5, mu_k=0.2),
    small("free", side="right", F_N=40.0),
    setup1(L=0.005, H=0.0025, h=2.5e-3),  # 3 x 2 blocks, the driver on the rod
    setup2(L=0.002, H=0.001, h=1e-3),
    small(L=0.0425, h=7.5e-3),
    small(mu_s=0.9, mu_k=0.3, d_c=2e-6),
    small("free", side="right", d_c=4e-7),
    small(h=2.5e-3).replace(h_top=0.0125),  # a plate up to the rod
    small("free", side="right", h=2e-3).replace(h_top=4e-3),
    small(
        "free",
        side="right",
        gap=[1e-7 * (n % 3) for n in range(13)],
        contact=[True, False] + [True] * 11,
    ),
    small(mu_s=[0.0] + [0.7] * 8, mu_k=[0.0] + [0.4] * 8, gap=1e-7),
]
IDS = [
    f"{'rod' if s.rigid else 'free'}-{s.N_x}x{s.N_z}-{s.driver.side}-{s.interface.d_c:g}"
    + f"-plate of {s.n_driven}" * (s.n_driven > 1)
    + "-uneven" * (not s.whole)
    for s in SCENES
]


def on_rod(scene, state):
    """Set the top row to the motion of the rod."""
    if scene.rigid:
        X, Z, phi, dX, dZ, dphi = state.rod
        one = np.ones(scene.N_x)
        state.y[-1] = X * one, Z + phi * scene.x, dX * one, dZ + dphi * scene.x
    else:
        state.rod[:] = 0.0
    return state


def random_state(scene, geometry, strain=1e-4, speed=1.0, dt=None, seed=0):
    """Return the loaded state, shaken: all contact states occur and many change soon."""
    rng = np.random.default_rng(seed)
    dt = 0.2 * stability_limit(scene)[0] if dt is None else dt
    state = loaded_state(scene, geometry).state(scene, dt)
    l = scene.slider.l
    state.y[:, :2] += strain * l * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] += speed * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.rod[:3] += strain * rng.standard_normal(3) * [l, l, 1]
    state.rod[3:] += speed * rng.standard_normal(3) * [1, 1, 1 / l]
    state.mode[:] = rng.choice([STUCK, 1, -1, OPEN], scene.N_x)
    state.y[0, 2, state.mode == STUCK] = 0
    with_slip(scene, state, rng)
    return on_rod(scene, state)


def with_slip(scene, state, rng):
    """Give blocks that do not stick a slip of up to 1.5 d_c."""
    state.s_0[:] = 0.0
    slipped = 1.5 * scene.interface.d_c * rng.random(scene.N_x)
    state.s_0[:] = np.where(state.mode == STUCK, 0.0, slipped - state.slip)


# --- against the twin ----------------------------------------------------------------------------


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("strain", [1e-4, 2e-3, 0.2])  # series, where it ends, closed form
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("scene", SCENES, ids=IDS)
def test_right_hand_side_is_that_of_the_twin(scene, geometry, strain, variant):
    state = random_state(scene, geometry, strain)
    state.mode[:] = np.resize([1, STUCK, -1, OPEN], scene.N_x)
    state.y[0, 2, state.mode == STUCK] = 0
    with_slip(scene, state, np.random.default_rng(1))
    t = 0.013
    here = core.evaluate(core.model(scene, geometry, state.u_drv0), state, t, variant)
    now = state.y, state.rod, state.mode, state.u_drv0, state.slip
    there = twin.right_hand_side(scene, geometry, t, *now)

    def close(a, b, least=0.0):
        scale = max(np.abs(b).max(), least)
        np.testing.assert_allclose(a, b, rtol=0, atol=ROUNDING * scale)

    m_top, i_top = twin.rod_inertia(scene)  # of the rod, F_N and its torque cancel in part
    close(here.a, there.dydt[:, 2:], scene.F_N / m_top)
    close(here.f, there.f)
    close(here.p, there.p)
    close(here.F_T, np.array(there.F_T))
    if scene.rigid:
        close(here.a_rod[:2], there.drod[3:5], scene.F_N / m_top)
        close(here.a_rod[2:], there.drod[5:], scene.F_N * scene.slider.L / i_top)
    powers = [here.dissipated.sum(), here.heat.sum(), *here.work]
    np.testing.assert_allclose(powers, list(there.rates.values()), rtol=100 * ROUNDING)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("scene", SCENES, ids=IDS)
def test_bond_forces_are_those_of_the_twin(scene, geometry):
    """The scene has springs only: no foundation, load, viscosity or rod."""
    y = random_state(scene, geometry).y
    here = core.bond_forces(scene, geometry)(y[:, :2])
    y[:, 2:] = 0
    there = twin.bond_forces(scene, y, geometry)
    largest = 6 * scene.slider.k * np.abs(y[:, :2]).max()  # of the terms that are added
    np.testing.assert_allclose(here, there, rtol=0, atol=ROUNDING * largest)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("scene", SCENES, ids=IDS)
def test_energies_are_those_of_the_twin(scene, geometry):
    state = random_state(scene, geometry, 1e-2)
    here = core.energies(core.model(scene, geometry, state.u_drv0), state, 0.01)
    there = twin.energies(scene, geometry, state.y, state.rod, 0.01, state.u_drv0)
    assert here["kinetic_blocks"] == pytest.approx(
        there["kinetic_blocks"] + there["kinetic_top"], rel=1e-14
    )
    assert here["kinetic_rod"] == pytest.approx(there["kinetic_rod"], rel=1e-14)
    for name in ("bonds", "foundation", "mattress", "driver"):
        assert here[f"elastic_{name}"] == pytest.approx(there[name], rel=1e-13)


STEPS = 40
LEGS = ((10, 5), (STEPS, 2000))
"""Numbers of steps from the start, and the allowed growth of rounding."""


@pytest.mark.parametrize(
    ("scene", "geometry"),
    [(scene, GEOMETRIES[n // 2 % 2]) for n, scene in enumerate(SCENES)],
    ids=IDS,
)
def test_runs_make_the_switches_of_the_twin(scene, geometry):
    """From a shaken state both make the same switches, and the same state up to growing rounding.

    Another test compares forces in both geometries; here each scene has one geometry.
    """
    state = random_state(scene, geometry)
    there = twin.Run(*(a.copy() for a in (state.y, state.rod, state.mode, state.slip)))
    rows, expected, twins = [], [], np.zeros(5)
    for n, growth in LEGS:
        done, rest = state.step, n - state.step
        made = advance(scene, geometry, state, rest).switches()
        there = twin.run(
            scene, geometry, there.y, there.rod, there.mode, state.u_drv0, state.dt, rest, done,
            there.slip,
        )  # fmt: skip
        columns = (made[name].tolist() for name in ("step", "block", "old", "new"))
        rows += zip(*columns, strict=True)
        expected += there.switches
        assert rows == expected
        np.testing.assert_array_equal(state.mode, there.mode)
        np.testing.assert_allclose(state.slip, there.slip, rtol=0, atol=growth * ROUNDING * 1e-6)
        for c in range(4):
            scale = np.abs(there.y[:, c]).max()
            np.testing.assert_allclose(
                state.y[:, c], there.y[:, c], rtol=0, atol=growth * ROUNDING * scale
            )
        works = [state.dissipated.sum(), state.heat.sum(), *state.work, state.loss.sum()]
        twins += list(there.works.values())
        np.testing.assert_allclose(works, twins, rtol=1e-12)
    assert rows


def test_all_changes_of_contact_occur_in_these_runs():
    seen = set()
    for scene in SCENES:
        state = random_state(scene, "linear")
        made = advance(scene, "linear", state, STEPS).switches()
        seen |= set(zip(made["old"].tolist(), made["new"].tolist(), strict=True))
    # A block sticks only from slip, and opens from slip or stick.
    assert {(0, 1), (0, -1), (1, 0), (-1, 0), (1, 2), (-1, 2), (2, 1), (2, -1)} <= seen


# --- the same bits -------------------------------------------------------------------------------


def wide(kind, d_c=0.0):
    if kind == "rod":
        return setup1(L=0.1, H=0.02, V=0.5, d_c=d_c)
    return setup2(L=0.05, H=0.008, theta=0.5, V=0.3, d_c=d_c)


@pytest.mark.parametrize("d_c", [0.0, 1e-6])
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_threads_and_variants_do_not_change_a_bit(kind, geometry, d_c):
    scene = wide(kind, d_c)
    start = random_state(scene, geometry)
    reference = start.copy()
    log = advance(scene, geometry, reference, 60)
    assert log.n_switch > 20
    others = [{"threads": 2}, {"threads": 3}, {"threads": 4}, {"threads": scene.N_z}]
    others += [{"variant": name, "threads": 2} for name, runs in core.variants().items() if runs]
    for options in others:
        state = start.copy()
        again = advance(scene, geometry, state, 60, **options)
        assert bits(state) == bits(reference), options
        assert log_bits(again) == log_bits(log), options


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_runs(variant):
    scene = small()
    start = random_state(scene, "finite")
    state, reference = start.copy(), start.copy()
    advance(scene, "finite", state, 40, variant=variant)
    advance(scene, "finite", reference, 40)
    assert bits(state) == bits(reference)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
@pytest.mark.parametrize("cuts", [(30, 30), (1, 59), (17, 0, 20, 23)])
@pytest.mark.parametrize("d_c", [0.0, 1e-6])
def test_split_runs_do_not_change_a_bit(kind, geometry, d_c, cuts, tmp_path):
    scene = small(kind, d_c=d_c)
    start = random_state(scene, geometry)
    whole, state = start.copy(), start.copy()
    advance(scene, geometry, whole, 60)
    for n in cuts:
        advance(scene, geometry, state, n)
        state.save(tmp_path / "state.npz", overwrite=True)
        state = State.load(tmp_path / "state.npz")
    assert bits(state) == bits(whole)


def test_a_state_is_not_saved_under_the_suffix_of_another_format(tmp_path):
    with pytest.raises(SceneError, match="netCDF"):
        random_state(small(), "linear").save(tmp_path / "state.nc")
    assert not list(tmp_path.iterdir())


def test_a_full_log_stops_early_and_goes_on():
    scene = small()
    start = random_state(scene, "linear")
    whole, state = start.copy(), start.copy()
    long = advance(scene, "linear", whole, 60)
    short, found = core.Log(scene.N_x, switches=scene.N_x + 2, quiet=1), []
    model = core.model(scene, "linear", state.u_drv0)
    calls = 0
    while state.step < 60:
        status = core.advance(model, state, short, 60 - state.step)
        assert (status == core.Status.DONE) == (state.step == 60)
        found.append(short.switches())
        calls += 1
    assert calls > 2
    assert bits(state) == bits(whole)
    for name, column in long.switches().items():
        np.testing.assert_array_equal(np.concatenate([one[name] for one in found]), column)


def test_budget_does_not_change_the_motion():
    scene = small()
    state = random_state(scene, "finite")
    other = state.copy()
    advance(scene, "finite", state, 50)
    advance(scene, "finite", other, 50, budget=False)
    np.testing.assert_array_equal(state.y, other.y)
    assert not other.dissipated.any()


# --- symmetries ----------------------------------------------------------------------------------


@pytest.mark.parametrize("d_c", [0.0, 1e-6])
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_mirror_image(kind, geometry, d_c):
    """The mirrored scene gives the mirrored bits (0 and -0 count as equal)."""
    left, right = (small(kind, side=side, d_c=d_c) for side in ("left", "right"))
    state = random_state(left, geometry)
    image = mirrored_state(state)
    log = advance(left, geometry, state, 100)
    log_image = advance(right, geometry, image, 100)
    assert log.n_switch == log_image.n_switch > 10
    back = mirrored_state(image)
    for name in ("y", "rod", "mode", "corner", "margin", "loss", "heat", "work", "s_0"):
        np.testing.assert_array_equal(getattr(back, name), getattr(state, name), err_msg=name)


@pytest.mark.parametrize("d_c", [0.0, 1e-6])
@pytest.mark.parametrize("kind", ["rod", "free"])
def test_doubling_load_and_speed_doubles_every_bit(kind, d_c):
    F_N, V = (3500.0, 0.5) if kind == "rod" else (400.0, 0.3)
    one, two = (small(kind, F_N=c * F_N, V=c * V, d_c=c * d_c) for c in (1, 2))
    state = random_state(one, "linear")
    double = state.copy()
    double.u_drv0 *= 2
    for name, factor in (("y", 2), ("rod", 2), ("margin", 2), ("s_0", 2)):
        getattr(double, name)[...] = factor * getattr(state, name)
    log, log_double = (advance(s, "linear", x, 100) for s, x in ((one, state), (two, double)))
    assert log.n_switch > 10
    for name, factor in (
        ("y", 2), ("rod", 2), ("mode", 1), ("corner", 1), ("margin", 2), ("loss", 4),
        ("dissipated", 4), ("heat", 4), ("work", 4), ("s_0", 2),
    ):  # fmt: skip
        np.testing.assert_array_equal(getattr(double, name), factor * getattr(state, name))
    for name, factor in (("step", 1), ("t", 1), ("u_x", 2), ("p", 2), ("corner", 1)):
        np.testing.assert_array_equal(log_double.switches()[name], factor * log.switches()[name])


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_rigid_translation_has_no_force(geometry):
    scene = dataclasses.replace(small("free"), driver=dataclasses.replace(small().driver, K=1e-30))
    state = loaded_state(scene, geometry).state(scene, 1e-7)
    state.y[:] = 0.0
    state.y[:, 0], state.y[:, 1] = 3 * scene.slider.l, 0.5 * scene.slider.l  # above the foundation
    state.mode[:] = OPEN
    forces = core.evaluate(core.model(scene, geometry, 0.0), state, 0.0)
    np.testing.assert_array_equal(forces.a[:-1, 1], 0.0)
    np.testing.assert_allclose(forces.a[:, 0], 0.0, atol=1e-25)
    np.testing.assert_allclose(-forces.a[-1, 1] * scene.m, scene.load, rtol=1e-14)


def test_rigid_rotation_has_no_force_in_finite_geometry():
    scene = small("free")
    state = loaded_state(scene, "finite").state(scene, 1e-7)
    l, angle = scene.slider.l, 0.3
    j, i = np.mgrid[: scene.N_z, : scene.N_x]
    r = l * np.stack([i, j], axis=1)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    state.y[:] = 0.0
    state.y[:, :2] = np.einsum("ab,jbi->jai", turn, r) - r + [[[0], [l]]]
    state.mode[:] = OPEN
    model = core.model(scene, "finite", state.y[scene.j_h, 0, scene.i_h])
    forces = scene.m * core.evaluate(model, state, 0.0).a
    forces[-1, 1] += scene.load
    assert np.abs(forces).max() < 1e-13 * scene.slider.k * l


# --- switching -----------------------------------------------------------------------------------


def test_release_is_located_inside_the_step():
    """A steady driver releases blocks at times that hardly depend on the step."""
    scene = small(V=0.5)
    limit = stability_limit(scene)[0]
    first = []
    for share in (0.4, 0.2, 0.1, 0.05):
        state = loaded_state(scene).state(scene, share * limit)
        log = advance(scene, "linear", state, round(1.5e-3 / state.dt))
        made = log.switches()
        start = np.flatnonzero(made["old"] == STUCK)[0]
        assert made["t"][start] <= made["step"][start] * state.dt
        assert made["t"][start] > (made["step"][start] - 1) * state.dt
        first.append(made["t"][start])
    errors = np.abs(np.array(first[:-1]) - first[-1]) / limit
    assert (errors < 0.01).all()


def test_a_block_slips_back():
    """The initial tau is antisymmetric; where it helps the driver, a block can slip back."""
    scene = small(V=0.1)
    state = loaded_state(scene).state(scene, 0.5e-6)
    made = advance(scene, "linear", state, 20_000).switches()
    assert {1, -1} <= set(made["new"].tolist())


def test_open_blocks_feel_no_friction():
    scene = small()
    state = random_state(scene, "linear")
    state.mode[:] = OPEN
    state.y[0, 1] = 1e-6
    forces = core.evaluate(core.model(scene, "linear", 0.0), state, 0.0)
    assert not forces.f.any()
    assert not forces.p.any()
    assert not forces.heat.any()


def test_evaluation_leaves_the_state_alone():
    scene = small()
    state = random_state(scene, "finite")
    before = bits(state)
    core.evaluate(core.model(scene, "finite", state.u_drv0), state, 0.1)
    core.energies(core.model(scene, "finite", state.u_drv0), state, 0.1)
    assert bits(state) == before


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("y", np.zeros((6, 4, 8))),
        ("y", np.zeros((6, 4, 9), dtype=np.float32)),
        ("y", np.zeros((9, 4, 6)).T),
        ("mode", np.zeros(9, dtype=np.int64)),
        ("rod", np.zeros(3)),
        ("work", [0.0, 0.0]),
        ("work", np.ma.masked_array([0.0, 1e36], mask=[False, True])),
        ("memory", np.zeros((9, 2))),
        ("memory", np.zeros(8, CLOCKS)),
        ("memory", np.zeros(9, CLOCKS[["s_0"]])),
        ("memory", np.zeros(9, [("s_0", float), ("t_0", np.float32)])),
        ("dt", 0.0),
        ("dt", float("nan")),
        ("t0", float("inf")),
        ("step", -1),
    ],
)
def test_nothing_wrong_reaches_the_core(name, value):
    scene = small()
    state = random_state(scene, "linear")
    model = core.model(scene, "linear", 0.0)
    setattr(state, name, value)
    with pytest.raises(StateError, match=name):
        core.advance(model, state, core.Log(scene.N_x), 1)


def test_wrong_calls_are_refused():
    scene = small()
    state = random_state(scene, "linear")
    model = core.model(scene, "linear", 0.0)
    with pytest.raises(ValueError, match="n_steps"):
        core.advance(model, state, core.Log(scene.N_x), -1)
    with pytest.raises(ValueError, match="threads"):
        core.advance(model, state, core.Log(scene.N_x), 1, threads=0)
    with pytest.raises(ValueError, match="log"):
        core.advance(model, state, core.Log(3), 1)
    with pytest.raises(ValueError, match="geometry"):
        core.model(scene, "cubic", 0.0)
    with pytest.raises(ValueError, match="not finite"):
        core.model(scene, "linear", float("nan"))


def components(name):
    """Return the components of a derived type in Fortran, in order, parts expanded."""
    folder = Path(__file__).parents[1] / "fortran"
    source = (folder / "law.f90").read_text() + (folder / "model.f90").read_text()
    pattern = rf"type(?:, bind\(c\))? :: {name}\n(.*?)end type {name}"
    body = re.search(pattern, source, re.S).group(1)
    found = []
    for kind, component in re.findall(r"^ +(.*?) :: (\w+)", body, re.M):
        part = re.fullmatch(r"type\((\w+)\)", kind)
        found += components(part.group(1)) if part else [component]
    return found


@pytest.mark.parametrize(
    ("name", "here"), [("counts_t", core.Counts), ("constants_t", core.Constants)]
)
def test_what_is_passed_has_the_same_names_in_the_same_order(name, here):
    assert components(name) == [one.lower() for one in here._fields]


@pytest.mark.parametrize(
    ("file", "law"), [("junctions", laws.Junctions), ("evolution", laws.RateAndState)]
)
def test_numbers_of_a_law_have_the_same_names_in_the_same_order(file, law):
    source = (Path(__file__).parents[1] / "fortran" / f"{file}.f90").read_text()
    names = re.findall(r":: (\w+)", re.search(r"type :: numbers_t\n(.*?)end type", source, re.S)[1])
    given = law(**law.example)
    scene = small("rod").replace({"interface": Interface(mu_s=0.45, mu_k=0.45, law=given)})
    assert names == [name.lower() for name in scene.law.core_numbers]


@pytest.mark.parametrize(
    ("file", "first", "known"),
    [
        ("law", "RESTING", [law.code for law in LAWS]),
        ("evolution", "AGEING", [law.code for law in laws.EVOLUTIONS.values()]),
    ],
)
def test_codes_of_laws_are_those_of_the_core(file, first, known):
    source = (Path(__file__).parents[1] / "fortran" / f"{file}.f90").read_text()
    codes = re.search(rf"parameter :: ({first} = .*)", source)[1]
    assert [int(code) for code in re.findall(r"= (\d+)", codes)] == known


def test_status_codes_are_those_of_the_core():
    """The lists in Fortran and in Python are the same."""
    source = Path(__file__).parents[1] / "fortran" / "status.f90"
    lines = [s for s in source.read_text().splitlines() if "parameter ::" in s]
    codes = {s.split("::")[1].split("=")[0].strip(): int(s.split("=")[1].split()[0]) for s in lines}
    assert codes == {one.name: one.value for one in core.Status}


# --- builds --------------------------------------------------------------------------------------


def test_the_core_needs_no_fortran_library():
    """The core has no I/O and no stop, so that a wheel contains only OpenMP."""
    files = list(Path(core.__file__).parent.glob("_core_*"))
    assert files
    assert not any(b"libgfortran" in file.read_bytes() for file in files)


def test_variant_is_chosen_by_the_environment():
    known = core.variants()
    name = [n for n, runs in known.items() if runs][-1]
    done = run_python("from pyfric import core; print(core.VARIANT)", PYFRIC_VARIANT=name)
    assert done.stdout.strip() == name, done.stderr
    done = run_python("from pyfric import core", PYFRIC_VARIANT="v9")
    assert done.returncode != 0
    assert "PYFRIC_VARIANT = 'v9': not installed" in done.stderr


def test_contraction_is_off():
    """Fused multiply-add would change bits between instruction sets."""
    info = core.build_info()
    assert "-ffp-contract=off" in info["flags"]
    assert not any(flag in info["flags"] for flag in ("-ffast-math", "-Ofast", "-march=native"))


@pytest.mark.parametrize("openmp", [True, False])
@pytest.mark.parametrize("names", [("v4", "v2"), ("baseline",)])
def test_a_build_says_what_it_lacks(openmp, names, monkeypatch):
    monkeypatch.setattr(builds, "build_info", lambda: {"openmp": openmp})
    monkeypatch.setattr(builds, "variants", lambda: dict.fromkeys(names, True))
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    said = core.lacks()
    assert len(said) == (not openmp) + (names == ("baseline",))
    assert any("one thread" in one for one in said) == (not openmp)
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert len(core.lacks()) == (not openmp)


@pytest.mark.skipif(core.processors() < 2, reason="needs two processors")
def test_bound_threads_leave_processors_to_the_process():
    """With OMP_PROC_BIND, as on clusters, libgomp binds its first thread to one processor."""
    code = "import os; from pyfric import core; print(core.processors(), os.sched_getaffinity(0))"
    done = run_python(code, OMP_PROC_BIND="true")
    assert done.stdout.strip() == f"{core.processors()} {os.sched_getaffinity(0)}", done.stderr


def test_small_lattices_use_one_thread():
    assert core.useful_threads(57 * 31) == 1
    assert core.useful_threads(57 * 31, threads=8) == 1
    assert core.useful_threads(10 * core.BLOCKS_PER_THREAD, threads=1) == 1
    if core.build_info()["openmp"]:
        assert core.useful_threads(10 * core.BLOCKS_PER_THREAD, threads=4) == 4
