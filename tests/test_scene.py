"""Scenes: values of the paper, exact round trip, and refusals that are always a SceneError."""

import copy
import dataclasses
import inspect
import math
import os
import pickle
import pydoc
import tomllib
from fractions import Fraction

import numpy as np
import pint
import pytest
import tomli_w
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pyfric.engines import Options
from pyfric.laws import TabulatedLaw
from pyfric.scene import (
    PRESETS,
    DistributedLoad,
    Driver,
    Interface,
    Material,
    PrescribedLoad,
    Rod,
    Scene,
    Slider,
    Spread,
    Walls,
    as_scene,
    full_name,
    laws,
    preset,
    setup1,
    setup2,
)
from pyfric.scene.parts import MAX_BLOCKS
from pyfric.scene.presets import Fields
from pyfric.scene.presets import settings as names_of
from pyfric.statics import loaded_state
from pyfric.values import Annotation, SceneError, annotations, check_number, parse_quantity, units
from pyfric.values.toml import MAX_FILE
from pyfric.values.units import LARGEST, SMALLEST

GOOD = """\
name = "good"
[slider]
L = "140 mm"
H = "75 mm"
l = "2.5 mm"
k = "13.5 MN/m"
M = "75.6 g"
[top]
kind = "rod"
F_N = "3500 N"
mass = "75.6 g"
mattress = "0.4 MN/m"
[driver]
K = "4 MN/m"
V = "0.7875 mm/s"
h = "5 mm"
side = "left"
[interface]
mu_s = 0.7
mu_k = 0.45
"""


def refused(text_or_call) -> SceneError:
    """Return the SceneError of a scene text or a call."""
    with pytest.raises(SceneError) as caught:
        Scene.from_toml(text_or_call) if isinstance(text_or_call, str) else text_or_call()
    error = caught.value
    for one in error.flat():
        assert one.field in str(error)
        assert one.allowed in str(error)
    return error


def same(a, b) -> bool:
    """Return whether two values are equal or both NaN."""
    return a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))


def changed(old: str, new: str) -> str:
    assert GOOD.count(old) >= 1
    return GOOD.replace(old, new, 1)


# Values of the paper


def test_setup1_has_the_values_of_the_paper():
    scene = setup1()
    assert scene.slider == Slider(L=0.14, H=0.075, l=2.5e-3, k=13.5e6, M=0.0756)
    assert scene.top == Rod(F_N=3500.0, mass=0.0756, mattress=0.4e6)
    assert scene.driver == Driver(K=4e6, V=0.7875e-3, h=5e-3, side="left")
    assert scene.interface == Interface(mu_s=0.7, mu_k=0.45)
    assert (scene.N_x, scene.N_z, scene.i_h, scene.j_h, scene.d) == (57, 31, 0, 2, 1)
    assert scene.m == 0.0756 / (57 * 31)
    assert scene.eta == math.sqrt(0.1 * 13.5e6 * scene.m)
    assert scene.k_f == 13.5e6
    assert scene.rigid
    assert scene.M_rod == 0.0756
    assert scene.kappa == pytest.approx(0.4e6 * 0.14**2 / 12, rel=1e-15)
    assert not scene.load.any()


@pytest.mark.parametrize(
    ("name", "L", "F_N", "h", "mu_s", "mu_k", "M"),
    [
        ("fig1", 0.14, 3500.0, 5e-3, 0.7, 0.45, 0.0756),
        ("run1", 0.14, 3500.0, 5e-3, 0.5, 0.2, 0.0756),
        ("run2", 0.14, 3500.0, 5e-3, 0.55, 0.3, 0.0756),
        ("run3", 0.14, 3500.0, 7.5e-3, 0.7, 0.45, 0.0756),
        ("run4", 0.2, 2700.0, 10e-3, 0.7, 0.45, 0.108),
    ],
)
def test_runs_of_the_paper(name, L, F_N, h, mu_s, mu_k, M):
    scene = preset(name)
    assert scene == setup1(L=L, F_N=F_N, h=h, mu_s=mu_s, mu_k=mu_k, M=M, name=name)


@pytest.mark.parametrize(
    ("name", "theta"), [("setup2", 0.0), ("setup2+", 0.833), ("setup2-", -0.833)]
)
def test_setup2_has_the_values_of_the_paper(name, theta):
    scene = preset(name)
    assert scene.slider == Slider(L=0.1, H=0.02, l=1e-3, k=9.375e6, M=0.012)
    assert scene.top == DistributedLoad(F_N=400.0, theta=theta)
    assert scene.driver == Driver(K=0.8e6, V=0.45e-3, h=2e-3)
    assert scene.interface == Interface(mu_s=0.7, mu_k=0.45)
    assert (scene.N_x, scene.N_z, scene.j_h, scene.name) == (101, 21, 2, name)
    assert not scene.rigid
    assert scene.M_rod == scene.kappa == 0.0
    n = np.arange(1, 102)
    np.testing.assert_allclose(scene.load, 400 / 101 * (1 + theta * (2 * n - 102) / 100), 1e-15)
    assert scene.load.sum() == pytest.approx(400.0, rel=1e-14)


def test_wave_speeds_of_the_paper_follow_at_both_lengths():
    for scene in (setup1(), preset("run4")):
        c = scene.slider.l * math.sqrt(scene.slider.k / scene.m)
        # The lattice has one row and column more than L/l and H/l, hence the few per cent.
        assert math.sqrt(1.5) * c == pytest.approx(1677, rel=0.04)
        assert math.sqrt(0.5) * c == pytest.approx(968, rel=0.04)
    assert preset("run4", M=0.0756).slider.M == 0.0756


def test_changing_l_keeps_k_and_the_mass():
    coarse = setup1(l=5e-3)
    assert (coarse.N_x, coarse.N_z, coarse.j_h) == (29, 16, 1)
    assert coarse.slider.k == 13.5e6
    assert coarse.m == 0.0756 / (29 * 16)


def test_x_is_measured_from_the_centre():
    scene = setup1()
    assert scene.x.shape == (57,)
    np.testing.assert_array_equal(scene.x, -scene.x[::-1])
    assert scene.x[-1] == pytest.approx(0.07, rel=1e-12)


@pytest.mark.parametrize("theta", [0.833, 0.0, -0.833, 1.0, -1.0])
def test_switching_the_side_mirrors_the_scene(theta):
    left = setup2(theta=theta)
    right = dataclasses.replace(left, driver=dataclasses.replace(left.driver, side="right"))
    assert right == setup2(theta=theta, side="right")
    np.testing.assert_array_equal(right.load, left.load[::-1])
    np.testing.assert_array_equal(right.n_of_i, left.n_of_i[::-1])
    assert left.n_of_i[0] == 1
    assert (right.d, right.i_h, right.j_h) == (-1, 100, left.j_h)
    assert (left.load >= 0).all()
    if theta > 0:
        assert left.load[0] < left.load[-1]


def test_doubling_the_load_doubles_every_bit_of_it():
    np.testing.assert_array_equal(setup2(theta=0.833, F_N=800.0).load, 2 * setup2(theta=0.833).load)


def test_given_eta_and_k_f_are_used():
    scene = setup1(eta=0.0, k_f=1e6)
    assert (scene.eta, scene.k_f) == (0.0, 1e6)


def test_scenes_are_immutable_hashable_and_copied_exactly():
    scene = preset("run1")
    with pytest.raises(AttributeError):
        scene.name = "x"
    with pytest.raises(AttributeError):
        scene.slider.L = 1.0
    assert hash(scene) == hash(copy.deepcopy(scene))
    assert pickle.loads(pickle.dumps(scene)) == scene
    with pytest.raises(TypeError):
        PRESETS["mine"] = PRESETS["run1"]


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("run1", Interface(mu_s=0.6, mu_k=0.4)),
        ("run3", Driver(K=1e6, V=1e-3, h=5e-3)),
        ("run4", Slider(L=0.1, H=0.05, l=5e-3, k=13.5e6, M=0.05)),
        ("run4", Rod(F_N=100.0)),
        ("setup2+", DistributedLoad(F_N=100.0)),
        ("setup2-", Rod(F_N=100.0)),
    ],
)
def test_a_whole_part_is_taken_as_it_is(name, part):
    where = "top" if isinstance(part, Rod | DistributedLoad) else type(part).__name__.lower()
    assert getattr(preset(name, {where: part}), where) == part


@pytest.mark.parametrize("name", ["law", "interface.law"])
def test_the_table_of_a_law_replaces_the_coefficients_of_a_preset(name):
    law = TabulatedLaw(slip=[0.0, 1e-6], mu=[0.6, 0.45])
    for changes in ({name: law}, {name: law, "mu_s": 0.6}, {name: law, "interface.mu_k": 0.45}):
        interface = preset("run1", changes).interface
        assert (interface.mu_s, interface.mu_k) == (0.6, 0.45)
    assert preset("run2", mu_s=0.6).interface == Interface(mu_s=0.6, mu_k=0.3)


def test_numpy_and_integer_scalars_become_plain_floats():
    slider = Slider(L=np.float64(4), H=np.int64(2), l=1, k=np.float32(2), M=Fraction(1, 2))
    values = (4.0, 2.0, 1.0, 2.0, 0.5, None, None, "full", "whole", 0.0)
    assert dataclasses.astuple(slider) == values
    assert {type(value) for value in dataclasses.astuple(slider)[:5]} == {float}


# Files


@pytest.mark.parametrize("name", PRESETS)
def test_presets_round_trip_exactly(name, tmp_path):
    scene = PRESETS[name]()
    path = tmp_path / "scene.toml"
    text = scene.to_toml(path)
    assert path.read_text() == text
    assert [file.name for file in tmp_path.iterdir()] == ["scene.toml"]
    for again in (Scene.from_toml(text), Scene.from_toml(path), Scene.from_toml(str(path))):
        assert again == scene
        assert again.to_toml() == scene.to_toml()  # all digits


awkward = st.floats(1e-3, 1e3, allow_nan=False)


@settings(max_examples=30)
@given(
    spacing=st.floats(1e-6, 1.0),
    columns=st.integers(2, 50),
    rows=st.integers(1, 50),
    k=awkward,
    M=awkward,
    eta=st.none() | awkward | st.just(0.0),
    k_f=st.none() | awkward,
    theta=st.none() | st.floats(-1.0, 1.0),
    F_N=awkward,
    K=awkward,
    V=awkward | st.just(0.0),
    mu=st.tuples(st.floats(0.0, 1e20), st.floats(0.0, 1.0)),
    side=st.sampled_from(["left", "right"]),
    name=st.text(
        st.characters(codec="utf-8", categories=["L", "M", "N", "P", "S", "Zs"]), max_size=200
    ),
    data=st.data(),
)
def test_every_scene_round_trips_exactly(
    spacing, columns, rows, k, M, eta, k_f, theta, F_N, K, V, mu, side, name, data
):
    row = data.draw(st.integers(1, rows))
    mu_s, ratio = mu
    tiny = mu_s * ratio < SMALLEST
    scene = Scene(
        slider=Slider(L=columns * spacing, H=rows * spacing, l=spacing, k=k, M=M, eta=eta),
        top=Rod(F_N=F_N)
        if theta is None or 0 < abs(theta) < SMALLEST
        else DistributedLoad(F_N=F_N, theta=theta),
        driver=Driver(K=K, V=V, h=row * spacing, side=side),
        interface=Interface(
            mu_s=0.0 if mu_s < SMALLEST else mu_s, mu_k=0.0 if tiny else mu_s * ratio, k_f=k_f
        ),
        name=name,
    )
    assert (scene.N_x, scene.N_z, scene.j_h) == (columns + 1, rows + 1, row)
    again = Scene.from_toml(scene.to_toml() + "\n")
    assert again == scene
    assert again.to_toml() == scene.to_toml()


def test_units_are_converted_and_rounded_once():
    assert Scene.from_toml(GOOD) == setup1(name="good")
    other = (
        GOOD.replace("140 mm", "14cm")
        .replace('"2.5 mm"', '"2500 µm"')
        .replace("13.5 MN/m", "13.5e3 N/mm")
        .replace("75.6 g", " 0.0756 kg ")
        .replace("0.4 MN/m", "4e5 kg/s^2")
        .replace("0.7875 mm/s", "787.5 um / s")
        .replace("3500 N", "3.5 kN")
    )
    assert Scene.from_toml(other) == setup1(name="good")


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5 mm", "m", 5e-3),
        ("+.5e1 mm", "m", 5e-3),
        ("5. mm", "m", 5e-3),
        ("1 inch", "m", 0.0254),
        ("1 N·s/m", "N s/m", 1.0),
        ("1 kg/s", "N s/m", 1.0),
        ("2 kg/s²", "N/m", 2.0),
        ("2 kg s**-2", "N/m", 2.0),
        ("5 mm s-1", "m/s", 5e-3),
        ("5 mm s⁻¹", "m/s", 5e-3),
        ("5 mm s^−1", "m/s", 5e-3),
        ("2 kN·mm⁻¹", "N/m", 2e6),
        ("2 g cm-3", "kg/m^3", 2000.0),
        ("2 newton⋅second/meter", "N s/m", 2.0),
        ("0.2 us", "s", 0.2e-6),
        ("1e-400 mm", "m", 0.0),
        ("1e400 mm", "m", math.inf),
        ("1e308 km", "m", math.inf),
    ],
)
def test_quantities(text, unit, value):
    assert parse_quantity("x", text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit", "reading"),
    [
        ("75.6 gr", "kg", "grain"),
        ("5 Mm", "m", "megameter"),
        ("5 th", "m", "thou"),
        ("5 pc", "m", "parsec"),
        ("1 c", "m/s", "speed of light"),
        ("1 kt", "m/s", "knot"),
        ("2 Ms", "s", "megasecond"),
    ],
)
def test_units_that_are_slips_of_the_pen_are_refused(text, unit, reading):
    assert f"would be a {reading}" in str(refused(lambda: parse_quantity("x", text, unit)))


@pytest.mark.parametrize(
    ("text", "unit", "write"),
    [
        ("2 Newton/meter", "N/m", "write 'newton/meter'"),
        ("2 Newton/Meter", "N/m", "write 'newton/meter'"),
        ("5 Micrometer", "m", "write 'micrometer'"),
        ("5 m.s-1", "m/s", 'such as "1 m/s"'),
        ("5 m·s^(-1)", "m/s", 'such as "1 m/s"'),
        ("5 Mpa", "Pa", 'such as "1 Pa"'),  # not mPa
    ],
)
def test_a_refused_unit_says_what_to_write(text, unit, write):
    error = refused(lambda: parse_quantity("x", text, unit))
    assert write in str(error)
    assert "'mpa'" not in str(error)


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "mm", "5", "five mm", "5 mmm", "5 kg", "5 m m", "5 degC", "5 m*dB", "5 %"),
        *(
            "5 m2",
            "5 m-1",
            "5 m1",
            "5 m-",
            "5 m⁻",
            "5,0 mm",
            "1.2.3 mm",
            "0x10 m",
            "5 mm mm/",
            "5 / mm",
            "5 m/0",
            "1_0 mm",
            "5 (m)",
        ),
        *("9**9**9**9 m", "5 m**9**9**9", "5 m^99", "5 m**(1/2)", "1e9 1e9 m", "__import__ m"),
        *(
            "5 m" + " m" * 60,
            "5 m\0",
            "5\nkg",
            "\u0665 mm",
            "5 m if 1",
            "5 lambda",
            "5 dimensionless",
        ),
    ],
)
def test_texts_that_are_no_length(text):
    error = refused(lambda: parse_quantity("slider.l", text, "m"))
    assert (error.field, error.value, error.unit) == ("slider.l", text, "m")
    assert "1 m" in error.allowed


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "scene.toml"
    setup1().to_toml(path)
    before = path.read_text()

    def broken(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", broken)
    with pytest.raises(OSError, match="disk full"):
        setup2().to_toml(path)
    assert path.read_text() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_files_that_cannot_be_read(tmp_path):
    long = tmp_path / "long.toml"
    long.write_text("#" * (MAX_FILE + 1))
    latin = tmp_path / "latin.toml"
    latin.write_bytes(b'name = "\xe9"\n')
    for source in (tmp_path, tmp_path / "none.toml", long, latin, "", "a\0b", "x" * 5000):
        error = refused(lambda source=source: Scene.from_toml(source))
        assert error.field == "scene"
    assert str(long) in str(refused(str(long)))


@pytest.mark.parametrize(
    "text",
    [
        "\n",
        "not toml\n",
        "a = [\n",
        "[slider]\n[slider]\n",
        "a = " + "[" * 5000 + "\n",
        "a = " + "9" * 5000 + "\n",
        "a = 0x" + "f" * 5000 + "\n",
        ".".join("a" * 4000) + " = 1\n",
        "#\n" * MAX_FILE,
        "\ud800\n",
        '"__dataclass_self__" = 1\nself = 2\n',
    ],
)
def test_texts_that_are_no_scene(text):
    assert refused(text).field


# Refusals: field, value, unit and allowed range


@pytest.mark.parametrize(
    ("changes", "field", "value", "unit", "allowed"),
    [
        ({"L": math.nan}, "slider.L", math.nan, "m", "> 0 m"),
        ({"F_N": math.nan}, "top.F_N", math.nan, "N", "> 0 N"),
        ({"K": math.inf}, "driver.K", math.inf, "N/m", ">= 0 N/m"),
        ({"mu_k": -math.inf}, "interface.mu_k", -math.inf, "", ">= 0"),
        ({"L": 0.141}, "slider.L", 0.141, "m", "a multiple of l = 0.0025 m"),
        ({"L": 0.14 * (1 + 1e-8)}, "slider.L", 0.14 * (1 + 1e-8), "m", "a multiple of l"),
        ({"L": 0.0025}, "slider.L", 0.0025, "m", ">= 2 l = 0.005 m"),
        ({"H": 0.0}, "slider.H", 0.0, "m", ">= l, or 0 for a chain under a prescribed load"),
        ({"H": 0.001}, "slider.H", 0.001, "m", ">= 1 l = 0.0025 m"),
        ({"H": 0.0751}, "slider.H", 0.0751, "m", "a multiple of l = 0.0025 m"),
        ({"h": 0.0}, "driver.h", 0.0, "m", "a multiple of l = 0.0025 m, from l to H = 0.075"),
        ({"h": 0.004}, "driver.h", 0.004, "m", "a multiple of l = 0.0025 m, from l to H = 0.075"),
        ({"h": 0.0775}, "driver.h", 0.0775, "m", "from l to H = 0.075 m"),
        ({"h": -0.0025}, "driver.h", -0.0025, "m", ">= 0 m, a multiple of l up to H"),
        ({"mu_k": 0.8}, "interface.mu_k", 0.8, "", "0 <= mu_k <= mu_s = 0.7"),
        ({"mu_k": -0.1}, "interface.mu_k", -0.1, "", ">= 0"),
        ({"k": 0.0}, "slider.k", 0.0, "N/m", "> 0 N/m"),
        ({"K": -1.0}, "driver.K", -1.0, "N/m", ">= 0 N/m"),
        ({"k_f": 0.0}, "interface.k_f", 0.0, "N/m", "> 0 N/m"),
        ({"M": 0.0}, "slider.M", 0.0, "kg", "> 0 kg"),
        ({"mass": -0.1}, "top.mass", -0.1, "kg", ">= 0 kg"),
        ({"mattress": -1.0}, "top.mattress", -1.0, "N/m", ">= 0 N/m"),
        ({"eta": -1.0}, "slider.eta", -1.0, "N s/m", ">= 0 N s/m"),
        ({"F_N": 0.0}, "top.F_N", 0.0, "N", "> 0 N"),
        ({"V": -1.0}, "driver.V", -1.0, "m/s", ">= 0 m/s"),
        ({"l": 1e-6}, "slider.l", 1e-6, "m", f"at most {MAX_BLOCKS} blocks"),
        ({"k": 1e300}, "slider.k", 1e300, "N/m", "1e-30 to 1e+30"),
        ({"M": 1e-300}, "slider.M", 1e-300, "kg", "1e-30 to 1e+30"),
        ({"L": True}, "slider.L", True, "m", "> 0 m"),
        ({"M": "0.1"}, "slider.M", "0.1", "kg", "> 0 kg"),
        ({"M": "75.6 mm"}, "slider.M", "75.6 mm", "kg", "> 0 kg"),
        ({"k": 10**400}, "slider.k", 10**400, "N/m", "> 0 N/m"),
        ({"mu_s": None}, "interface.mu_s", None, "", ">= 0"),
        ({"mu_s": 1j}, "interface.mu_s", 1j, "", ">= 0"),
        ({"mu_s": np.True_}, "interface.mu_s", np.True_, "", ">= 0"),
        ({"side": "up"}, "driver.side", "up", "", "'left' or 'right'"),
        ({"side": 1}, "driver.side", 1, "", "'left' or 'right'"),
        ({"name": 3}, "name", 3, "", "text"),
    ],
)
def test_refused_values(changes, field, value, unit, allowed):
    error = refused(lambda: setup1(**changes))
    assert (error.field, error.unit) == (field, unit)
    assert same(error.value, value)
    assert type(error.value) is type(value)
    assert allowed in error.allowed
    if isinstance(value, float):
        assert f"{field} = {value!r} {unit}".strip() + ":" in str(error)


@pytest.mark.parametrize("theta", [1.001, -1.001, math.nan, math.inf])
def test_theta_outside_its_range(theta):
    error = refused(lambda: setup2(theta=theta))
    assert (error.field, error.unit) == ("top.theta", "")
    assert error.allowed == "a finite number >= -1 and <= 1"


@pytest.mark.parametrize(
    ("old", "new", "field", "value", "unit", "reason"),
    [
        ('"140 mm"', '"0.14"', "slider.L", "0.14", "m", 'missing unit: write e.g. "1 m"'),
        ('"13.5 MN/m"', "nan", "slider.k", math.nan, "N/m", "not a finite number"),
        ("13.5 MN/m", "13.5 MN", "slider.k", "13.5 MN", "N/m", "wrong unit: 'MN'"),
        ("75.6 g", "75.6 mm", "slider.M", "75.6 mm", "kg", "wrong unit: 'mm'"),
        ("75.6 g", "75.6 gg", "slider.M", "75.6 gg", "kg", "unknown unit 'gg'"),
        ("75 mm", "70.1 mm", "slider.H", 70.1e-3, "m", "not a multiple of l"),
        ('"75.6 g"', "true", "slider.M", True, "kg", "a number is needed, not bool"),
        ('"75.6 g"', "[1]", "slider.M", [1], "kg", "a number is needed, not list"),
        ("3500 N", "nan N", "top.F_N", math.nan, "N", "not a finite number"),
        ("3500 N", "1e999 kN", "top.F_N", math.inf, "N", "not a finite number"),
        ("3500 N", "-3500 N", "top.F_N", -3500.0, "N", "too small"),
        ("mu_s = 0.7", 'mu_s = "0.7 m"', "interface.mu_s", "0.7 m", "", "wrong unit: 'm'"),
        ("mu_s = 0.7", 'mu_s = "high"', "interface.mu_s", "high", "", "not a number"),
        ("mu_s = 0.7", "mu_s = true", "interface.mu_s", True, "", "not bool"),
        ("mu_s = 0.7", "mu_s = nan", "interface.mu_s", math.nan, "", "not a finite"),
        ("mu_s = 0.7", "", "interface.mu_s", None, "", "missing"),
        ("mu_s = 0.7", "mus = 0.7", "interface.mus", 0.7, "", "did you mean 'mu_s'?"),
        ('L = "140 mm"', 'Length = "1 m"', "slider.Length", "1 m", "", "did you mean 'L'?"),
        ("mattress", "matress", "top.matress", "0.4 MN/m", "", "did you mean 'mattress'?"),
        ('"left"', '"Left"', "driver.side", "Left", "", "did you mean 'left'?"),
        ('"rod"', '"rods"', "top.kind", "rods", "", "did you mean 'rod'?"),
        ('"rod"', "1", "top.kind", 1, "", "not text"),
        ('kind = "rod"', "", "top.kind", None, "", "missing"),
        ('"good"', "5", "name", 5, "", "not text"),
    ],
)
def test_refused_texts(old, new, field, value, unit, reason):
    error = refused(changed(old, new))
    assert (error.field, error.unit) == (field, unit)
    assert same(error.value, value)
    assert reason in error.reason


def test_a_wrong_unit_names_the_range_too():
    assert "> 0 kg" in refused(changed("75.6 g", "75.6 mm")).allowed


@pytest.mark.parametrize("section", ["slider", "top", "driver", "interface"])
def test_missing_and_misnamed_tables(section):
    document = tomllib.loads(GOOD)
    table = document.pop(section)
    assert refused(tomli_w.dumps(document)).field == section
    error = refused(tomli_w.dumps(document | {section + "s": table}))
    assert error.field == section + "s"
    assert f"did you mean {section!r}?" in str(error)
    error = refused(tomli_w.dumps({section: 3} | document))
    assert (error.field, error.value, error.allowed) == (section, 3, f"a table [{section}]")


def test_all_problems_are_listed_and_the_first_gives_the_attributes():
    error = refused(GOOD.replace("140 mm", "140").replace("3500 N", "-1 N").replace("0.45", "-1"))
    assert [one.field for one in error.flat()] == ["slider.L", "top.F_N", "interface.mu_k"]
    assert error.field == "slider.L"
    assert len(str(error).splitlines()) == 3
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert (again.field, again.value, again.unit) == (error.field, error.value, error.unit)


def test_parts_of_the_wrong_type():
    good = setup1()
    parts = {"slider": good.slider, "top": good.top, "driver": good.driver}
    assert refused(lambda: Scene(**parts)).field == "interface"
    error = refused(lambda: Scene(**parts, interface={"mu_s": 0.7, "mu_k": 0.4}))
    assert error.field == "interface"
    assert error.allowed.startswith("Interface, or its fields by their names, mu_s=...")
    error = refused(lambda: dataclasses.replace(good, top=good.driver))
    assert (error.field, error.allowed) == ("top", "Rod or DistributedLoad or PrescribedLoad")
    assert refused(lambda: Slider(Length=1.0)).flat()[0].reason.endswith("did you mean 'L'?")
    assert refused(lambda: Scene(good.slider)).field
    for name in ("\ud800", "x" * 201):
        assert refused(lambda name=name: dataclasses.replace(good, name=name)).field == "name"


def test_unknown_presets():
    error = refused(lambda: preset("run5"))
    assert (error.field, error.value) == ("preset", "run5")
    assert "run4" in error.allowed
    assert "did you mean 'mu_s'?" in str(refused(lambda: preset("run1", mus=0.5)))
    for name in (3, None, ("mu_s", "mu_k")):  # no name at all
        assert refused(lambda name=name: setup1({name: 0.5})).reason.startswith("unknown")
    assert preset("run1", h=7.5e-3) == setup1(mu_s=0.5, mu_k=0.2, h=7.5e-3, name="run1")
    assert preset("fig1", name="x").name == "x"
    for other in (None, 1, [], b"fig1"):
        assert "run4" in refused(lambda other=other: preset(other)).allowed


def test_a_field_has_one_name_everywhere():
    """The name may omit its part, also inside fields."""
    scene = preset(
        "fig1", mu_s=Spread(mean=0.7, std=0.01, seed=1), law=laws.Ageing(B=0.01, t_c=1e-3)
    )
    for other in (
        scene.replace(mu_k=0.4),
        scene.replace({"interface.mu_k": 0.4}),
        scene.replace(interface=dataclasses.replace(scene.interface, mu_k=0.4)),
        preset(
            "fig1", {"interface.mu_k": 0.4, "law": scene.interface.law}, mu_s=scene.interface.mu_s
        ),
    ):
        assert other.interface.mu_k == 0.4
        assert other == scene.replace(mu_k=0.4)
    assert scene.replace(seed=2).interface.mu_s == Spread(mean=0.7, std=0.01, seed=2)
    assert scene.replace({"mu_s.seed": 2, "law.B": 0.02}).interface.law.B == 0.02
    assert scene.replace({"mu_s.seed": 2}) == scene.replace({"interface.mu_s.seed": 2}) != scene
    assert full_name(scene, "t_c") == "interface.law.t_c"
    assert scene.replace(
        interface=dataclasses.replace(scene.interface, d_c=1e-6), h=7.5e-3
    ).driver.h
    for name, text in (
        ("protocol", "top.protocol or driver.protocol"),
        ("law.C", "unknown"),
        ("slider.h", "unknown"),
        ("p", "a field of PrescribedLoad"),
    ):
        assert text in str(refused(lambda name=name: scene.replace({name: 1.0})))
    both = {"law": laws.Ageing(B=0.1, t_c=1.0), "law.B": 0.2}
    assert scene.replace(both).interface.law == laws.Ageing(B=0.2, t_c=1.0)
    error = refused(lambda: scene.replace({"mu_s": 0.7, "mu_s.seed": 2}))
    assert "mu_s is 0.7, which has no seed" in error.reason


def test_editors_are_told_every_name():
    parts = Slider, Rod, DistributedLoad, PrescribedLoad, Walls, Driver, Interface
    ends = [field.name for part in parts for field in dataclasses.fields(part)]
    tops = {field.name for part in parts[1:4] for field in dataclasses.fields(part)}
    others = [f.name for part in (*parts[:1], *parts[4:]) for f in dataclasses.fields(part)]
    alone = {name for name in ends if others.count(name) + (name in tops) == 1}
    whole = {field.name for field in dataclasses.fields(Scene)}
    assert set(Fields.__annotations__) == alone | whole


@pytest.mark.parametrize(
    "sign", ["\0", "\n", "\x1b", "\x85", "\u2028", "\u202e", "\u2066", "\u200f"]
)
def test_names_are_a_line_that_reads_as_it_stands(sign):
    error = refused(lambda: preset("fig1", name=f"a{sign}b"))
    assert (error.field, error.unit) == ("name", "")
    assert sign not in str(error)
    text = preset("fig1").to_toml().replace('"fig1"', tomli_w.dumps({"n": f"a{sign}b"})[4:-1])
    assert refused(text).field == "name"
    assert preset("fig1", name="\u0633\u0644\u0627\u0645 \u03b1\u200d\u6469").name


def test_words_that_are_not_alike_are_no_hint():
    """A field of another kind of top is not a misspelt field of this scene."""
    error = refused(changed("mattress", "theta"))
    assert (error.field, error.reason) == ("top.theta", "unknown")
    assert "did you mean" not in str(refused(lambda: preset("???")))
    error = refused(lambda: preset("fig1", theta=0.5))  # theta is not similar to eta either
    assert (error.field, error.reason) == ("theta", "unknown here, a field of DistributedLoad")


def test_numbers_without_unit_are_in_SI_everywhere():
    """Files and Python agree. Text has a unit, unless the quantity has none."""
    bare = GOOD.replace('"140 mm"', "0.14").replace('"3500 N"', "3500").replace("0.45", '"45 %"')
    assert (
        Scene.from_toml(bare)
        == Scene.from_toml(GOOD)
        == Scene.from_toml(GOOD).replace(L=0.14, F_N="3.5 kN", mu_k="0.45")
    )
    assert str(refused(changed("140 mm", "0.14"))).startswith("slider.L = '0.14': missing unit")
    assert str(refused(lambda: setup1(L="0.14"))).startswith("slider.L = '0.14': missing unit")
    assert str(refused(lambda: setup1(L=-0.14))).startswith("slider.L = -0.14 m: too small")


def test_a_byte_order_mark_is_no_part_of_a_scene(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_bytes(b"\xef\xbb\xbf" + setup1().to_toml().encode())
    assert Scene.from_toml(file) == Scene.from_toml("\ufeff" + setup1().to_toml()) == setup1()


def test_a_scene_by_its_name_or_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = setup1(h=7.5e-3, name="own")
    for file in ("own", "own.toml", "fig1"):
        own.to_toml(file)
    assert as_scene(own) is own
    assert as_scene("fig1") == preset("fig1")
    assert as_scene(tmp_path / "fig1") == own
    for name in ("own", "own.toml", "./fig1", os.fspath(tmp_path / "own"), own.to_toml()):
        assert as_scene(name) == own
    for wrong, what in (
        ("fig", "did you mean 'fig1'?"),
        ("x" * 9999, "run4"),
        ("a\0b", "run4"),
        (None, "run4"),
        (0.9, "a scene file"),
        ("none.toml", "cannot be read"),
        (tmp_path, "cannot be read"),
    ):
        assert what in str(refused(lambda wrong=wrong: as_scene(wrong)))


def test_check_number_for_run_parameters():
    assert check_number("dt", 1, "s", gt=0) == 1.0
    error = refused(lambda: check_number("dt", 2e-6, "s", gt=0, le=1.57e-6))
    assert (error.field, error.value, error.unit) == ("dt", 2e-6, "s")
    assert str(error) == ("dt = 2e-06 s: too large; allowed: a finite number > 0 and <= 1.57e-06 s")
    assert refused(lambda: check_number("n", 1.0, "", lt=1)).allowed == "a finite number < 1"
    assert math.copysign(1, check_number("x", -0.0, "")) == 1


# Thousands of broken scenes: a valid scene or a SceneError, never anything else


def consistent(scene: Scene) -> None:
    """Assert that no value derived from an accepted scene is NaN or infinite."""
    assert scene.N_x >= 3
    assert scene.N_z >= 2
    assert scene.N_x * scene.N_z <= MAX_BLOCKS
    assert 1 <= scene.j_h < scene.N_z
    assert scene.m > 0
    assert 0 <= scene.interface.mu_k <= scene.interface.mu_s
    for value in (scene.eta, scene.k_f, scene.kappa, scene.M_rod, scene.slider.k / scene.m):
        assert math.isfinite(value)
        assert value >= 0
    if scene.N_x < 10_000:
        assert np.isfinite(scene.x).all()
        assert np.isfinite(scene.load).all()
    assert Scene.from_toml(scene.to_toml()) == scene


def accepted_or_refused(text: str) -> None:
    try:
        scene = Scene.from_toml(text)
    except SceneError as error:
        assert str(error)
        assert repr(error)
        return
    consistent(scene)


KEYS = [(section, key) for section, table in tomllib.loads(GOOD).items()
        if isinstance(table, dict) for key in table]  # fmt: skip
UNITS = ["m", "mm", "km", "N", "kN", "kg", "g", "N/m", "MN/m", "mm/s", "m/s", "N s/m", "s", "K"]
UNITS += ["", "mmm", "degC", "dB", "inch", "lbf", "N/", "/m", "m**9**9", "%", "µm", "rad m", "ohm"]

numbers = (
    st.floats()
    | st.integers()
    | st.sampled_from([0, -1, 1e-320, 1e300, SMALLEST, LARGEST, 10**400, 1 << 70, 2.5e-3, 0.14])
    | st.sampled_from(["nan", "inf", "-inf", "1e999", "1e-999", "1e-99999999", "1.", ".5", "1e"])
)
quantities = st.builds("{}{}{}".format, numbers, st.sampled_from(["", " "]), st.sampled_from(UNITS))
scalars = (
    quantities
    | st.floats()
    | st.integers(-(2**70), 2**70)
    | st.booleans()
    | st.text(max_size=20)
    | st.dates()
    | st.datetimes()
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=4,
)
spellings = st.text(max_size=12) | st.sampled_from(
    [
        "self",
        "cls",
        "kind",
        "theta",
        "eta",
        "k_f",
        "__dataclass_self__",
        "l ",
        "\u2113",
        "slider",
        "",
    ]
)
changes = st.one_of(
    st.tuples(st.just("set"), st.sampled_from(KEYS), values),
    st.tuples(st.just("set"), st.sampled_from(KEYS), quantities),
    st.tuples(st.just("drop"), st.sampled_from(KEYS), st.none()),
    st.tuples(st.just("rename"), st.sampled_from(KEYS), spellings),
    st.tuples(st.just("add"), st.sampled_from(KEYS), st.tuples(spellings, values)),
    st.tuples(st.just("table"), st.sampled_from(KEYS), values),
    st.tuples(st.just("top"), st.sampled_from(KEYS), st.tuples(spellings, values)),
)


def broken(steps: list) -> str:
    """Return GOOD after some changes, as TOML."""
    document = tomllib.loads(GOOD)
    for action, (section, key), new in steps:
        table = document[section]
        if action == "table":
            document[section] = new
        elif action == "top":
            document.setdefault(*new)
        elif not isinstance(table, dict):
            continue
        elif action == "set":
            table[key] = new
        elif action == "drop":
            table.pop(key, None)
        elif action == "rename" and key in table:
            table[new] = table.pop(key)
        elif action == "add":
            table.setdefault(*new)
    return tomli_w.dumps(document)


@settings(max_examples=200)
@given(change=changes)
def test_documents_broken_once(change):
    try_broken([change])


@settings(max_examples=100)
@given(steps=st.lists(changes, min_size=2, max_size=3))
def test_documents_broken_twice(steps):
    try_broken(steps)


def try_broken(steps: list) -> None:
    try:
        text = broken(steps)
    except ValueError:  # TOML cannot express it
        return
    accepted_or_refused(text)


@settings(max_examples=250)
@given(
    start=st.integers(0, len(GOOD)),
    length=st.integers(0, 12),
    insert=st.text(max_size=8) | st.text("0123456789.eE+-_[]{}=\"'\n nafi", max_size=8),
)
def test_documents_with_random_edits(start, length, insert):
    accepted_or_refused(GOOD[:start] + insert + GOOD[start + length :])


@settings(max_examples=200)
@given(st.text(max_size=200) | st.text("[]{}=\"'\n\t ab1.,#\\", max_size=200))
@example("/dev/null")
@example(".")
def test_random_text(text):
    with pytest.raises(SceneError):
        Scene.from_toml(text)


@settings(max_examples=200)
@given(quantities | st.text("0123456789.eE+-*/^ mNkgs²µ%()", max_size=20) | st.text(max_size=12))
def test_random_quantities(text):
    for unit in ("m", "N s/m"):
        try:
            number = parse_quantity("x", text, unit)
        except SceneError:
            continue
        assert isinstance(number, float)


@settings(max_examples=200)
@given(
    st.dictionaries(
        st.sampled_from(names_of("setup1")),
        st.floats() | st.integers() | st.fractions() | st.text(max_size=5) | st.none()
        | st.complex_numbers() | st.binary(max_size=3) | st.booleans()
        | st.builds(np.float32, st.floats(width=32)) | st.lists(st.floats(), max_size=2)
        | st.builds(np.array, st.floats()),
        min_size=1,
        max_size=3,
    )
)  # fmt: skip
def test_broken_arguments(changes):
    try:
        scene = setup1(**changes)
    except SceneError as error:
        assert str(error)
        return
    consistent(scene)


@pytest.mark.parametrize("geometry", [None, [], "round", np.array([1.0, 2.0])])
def test_what_is_no_geometry(geometry):
    assert refused(lambda: loaded_state(setup1(), geometry)).field == "geometry"


def test_a_shear_force_beyond_friction_is_named():
    error = refused(lambda: setup2(T=281.0))
    assert str(error).startswith("top.T = 281.0 N: ")
    assert "mu_s F_N = 280.0 N" in str(error)
    assert setup2(T=-280.0).top.T == -280.0


@pytest.mark.parametrize(
    ("name", "changes", "fields"),
    [
        ("fig1", {"driver.h": 7.5e-3, "h": 5e-3}, {}),
        ("fig1", {"h": 7.5e-3}, {"h": 5e-3}),
        ("tpv3", {"slider.l": 200.0}, {"l": 100.0}),
    ],
)
def test_a_field_is_given_once(name, changes, fields):
    """A field that is given twice is refused."""
    assert refused(lambda: preset(name, changes, **fields)).reason == "given twice"


def test_changes_take_the_place_of_values_of_a_preset():
    assert preset("run3", {"driver.h": 5e-3}).driver.h == preset("run3", h=5e-3).driver.h == 5e-3


def test_what_is_no_part_or_no_change_is_refused():
    assert refused(lambda: preset("fig1", slider=None)).field == "slider"
    assert refused(lambda: preset("fig1", {"slider": 3})).field == "slider"
    assert refused(lambda: preset("fig1", 5)).field == "changes"
    assert refused(lambda: preset("fig1").replace({"h": 1e-2}, h=5e-3)).reason == "given twice"


def test_a_number_of_a_spread_may_have_the_unit_of_its_field():
    scene = preset("fig1", d_c=Spread(mean=1e-6, std=1e-8))
    spread = scene.replace({"interface.d_c.mean": "3 um", "interface.d_c.seed": 2}).interface.d_c
    assert spread == Spread(mean=3e-6, std=1e-8, seed=2)
    error = refused(lambda: scene.replace({"interface.d_c.mean": "3 kg"}))
    assert (error.field, error.unit) == ("interface.d_c.mean", "m")


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("interface.mu_s", [0.7] * 57),
        ("interface.mu_s", 0.7),
        ("slider.l", 2.5e-3),
        ("driver.protocol", [[0.0, 1e-3], [0.1, 2e-3]]),
        ("top.push", [[3.0, 10.0]]),
    ],
)
def test_masked_values_are_refused(field, values):
    """netCDF4 returns masked arrays; masked values are numbers, such as 1e36."""
    array = np.ma.masked_array(values)
    array[(-1,) * array.ndim] = np.ma.masked
    with pytest.raises(SceneError, match=rf"{field} = .*: 1 of {array.size} masked"):
        setup1().replace({field: array})


def test_masked_entries_of_a_list_are_refused():
    with pytest.raises(SceneError, match=r"interface\.mu_s = .*: block 2: 1 of 1 masked"):
        setup1(mu_s=[0.7, np.ma.masked, *[0.7] * 55])


@pytest.mark.parametrize("seed", [2**63 - 1, 2**63, 2**63 + 1, 2**64 - 1])
def test_seeds_above_half_of_their_range_are_not_rounded(seed):
    """NumPy's Philox converts a list of keys to floats from 2^63 on."""
    key = np.array([seed, 0], dtype=np.uint64)
    raw = np.random.Philox(key=key).random_raw(57) >> np.uint64(11)
    drawn = Spread(mean=0.5, range=0.5, seed=seed).draw(57, 1.0)
    np.testing.assert_array_equal(drawn, 0.5 + 0.5 * (2 * (raw * 2.0**-53) - 1))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("L", 0.14),
        ("K", 4e6),
        ("V", 0.4),
        ("h", 5.0),
        ("F_N", 1920.0),
        ("mu_s", 0.7),
        ("l", 2.5),
    ],
)
def test_a_quantity_never_loses_its_unit(field, value):
    """Pint warns if an array loses its unit, but not if a single number does."""
    units = {"L": "m", "K": "N/m", "V": "mm/s", "h": "mm", "F_N": "N", "mu_s": "", "l": "mm"}
    made = setup1(**{field: pint.Quantity(value, units[field])})
    assert made == setup1(**{field: f"{value} {units[field]}".strip() if units[field] else value})
    with pytest.raises(SceneError, match=field):
        setup1(**{field: pint.Quantity(value, "kelvin")})


@pytest.mark.parametrize("part", [Scene, Interface, Options])
def test_help_of_a_part_reads_like_its_documentation(part):
    text = pydoc.plain(pydoc.render_doc(part))
    assert part.__doc__.strip().splitlines()[0] in text
    assert not any(word in text for word in ("Annotated[", "Quantity(", " at 0x"))
    assert all(isinstance(mark, Annotation) for mark in annotations(part).values())


@pytest.mark.parametrize("part", [Slider, Driver, Interface, Material, Options])
def test_types_of_fields_are_plain(part):
    shown = inspect.signature(part)
    assert shown.parameters.keys() >= annotations(part).keys()
    types = {field.name: field.type for field in dataclasses.fields(part)}
    assert types == {name: given.annotation for name, given in shown.parameters.items()}


@pytest.mark.parametrize(
    "unit", ["s", "m", "N", "Pa", "m/s", "N/m", "N s/m", "J", "kg", "1/s", "m^2"]
)
def test_prefixes_are_those_of_pint(unit):
    """A unit that differs only in its prefix is read without Pint's definitions of units."""
    for prefix in ("", "n", "u", "µ", "m", "k", "M", "G"):
        name = prefix + unit
        quick = units._prefixed(name, unit)
        larger = prefix in ("k", "M", "G")
        simple = unit in ("N", "Pa", "N/m", "N s/m", "J") or (
            unit in ("s", "m", "m/s") and not larger
        )
        assert (quick is not None) is simple, name
        if simple:
            assert quick == Fraction(units._registry().convert(Fraction(1), name, unit)), name
