"""CSV files of friction: units in heads, refusals without contents of the file, measured curves."""

import os

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from pyfric import laws
from pyfric.scene import Interface, Scene, chain
from pyfric.values import SceneError
from pyfric.values.tables import unit_in

FALL = ((0.0, 0.65), (8.0, 0.453))


def table(folder, content, name="slide"):
    """Return the law of a scene file that names a CSV file in a folder beside it."""
    (folder / "laws").mkdir(exist_ok=True)
    (folder / "laws" / "friction.csv").write_text(content)
    file = folder / "scene.toml"
    scene = chain(L=5e-3, mu_s=0.7, mu_k=0.453).to_toml()
    file.write_text(f'{scene}\n[interface.law]\nkind = "table"\n{name} = "laws/friction.csv"\n')
    return Scene.from_toml(file).interface.law


def rows(heads, rows=FALL, apart=","):
    return "\n".join([heads, *(apart.join(map(repr, row)) for row in rows)]) + "\n"


@pytest.mark.parametrize(
    "heads",
    [
        *("slip (um),mu", "slip [um],mu", "slip/um,mu", "slip_um,mu", "um,-", "slip um,mu (-)"),
        *("slip / um , mu", "slip in um,mu", "Slip [µm],friction", "slip (\u03bcm),mu"),
        *('"slip (um)",mu', "# a curve\nslip (um),mu\n# of 2011", "\ufeffslip (um),mu"),
        *("slip ($\\mu$m),$\\mu$", "slip (micrometers),mu/1", "x_1/um,tau/p", "# slip_um,mu"),
        *("slip (um);mu", "slip (um)\tmu", "slip{um},mu_min", "slip (um),mu_dyn", "slip (um),mus"),
        *("slip, um;mu", "slip, um\tmu", "slip: um,mu_2", "slip = um,F_T/F_N"),
    ],
)  # fmt: skip
def test_units_in_heads_are_understood(tmp_path, heads):
    apart = next((sign for sign in ";\t" if sign in heads), ",")
    law = table(tmp_path, rows(heads, apart=apart))
    assert (law.slip, law.mu) == ((0.0, 8e-6), (0.65, 0.453))
    assert repr(law) == "TabulatedLaw(slip 0 to 8 um, 2 knots, mu 0.650 to 0.453)"


@pytest.mark.parametrize(
    "heads",
    [
        *("", "slip,mu", "s,mu", "slip_max,mu_s", "slip (m),mu", "m,-"),
        *("# 2011-05-03, sample 4", "# at 20 °C, dry"),
    ],
)
def test_without_a_unit_numbers_are_in_si(tmp_path, heads):
    assert table(tmp_path, rows(heads)).slip == (0.0, 8.0)


@pytest.mark.parametrize(
    ("heads", "text"),
    [
        ("um slip,mu", "row 1, column 1, 'um slip': 'um' is a unit"),
        ("slip.um,mu", "'um' is a unit"),
        ("slip (um) filtered,mu", "'um' is a unit"),
        ("slip (s),mu", "'s' is no unit of m"),
        ("slip (-),mu", "'-' is no unit of m"),
        ("slip/d_c,mu", "the text after / is no unit of m"),
        ("slip (um),mu (N)", "column 2, 'mu (N)': 'N' is no unit"),
        ("# slip in um", "row 1: a comment names um"),
        ("# slip in um\nslip,mu", "row 1: a comment names um"),
        ("SLIP_UM,MU", "'UM' is a unit"),
        ("slipUm,mu", "'slipUm' is a unit"),
        ("slip*1e6,mu", "'*1e6' is a factor"),
        ("slip (um),mu_N", "'N' is a unit"),
        ("slip (um),mu Pa", "'Pa' is a unit"),
        ("mu,slip_um", "column 2, 'slip_um': 'um' is a unit"),
        ("slip_um,v_mm/s", "'mm/s' is a unit"),
        ("slip_um,time_ms", "'ms' is a unit"),
        ("slip*1e6 (m),mu", "'*1e6' is a factor"),
        ("slip (um),mu*1000", "'*1000' is a factor"),
        ("slip (um),mu x10", "'x10' is a factor"),
        ("slip (um),1000 mu", "'1000' is a factor"),
        ("slip/10^-6 m,mu", "'10^-6' is a factor"),
        ("slip/(10^-6 m),mu", "'10^-6 m' is no unit of m"),
        ("slip / (10⁻⁶ m),mu", "'10⁻⁶ m' is no unit of m"),
        ("slip/10-6 m,mu", "'10-6' is a factor"),
        ("slip·10^6 (m),mu", "'·10^6' is a factor"),
        ("slip_2,mu", "'2' is a factor"),
        ("slip (um),F_T / 10^3 N", "'10^3' is a factor"),
        ("slip (um),F_T/kN", "'kN' is a unit"),
        ("slip (um),F_T/F_N_kN", "'kN' is a unit"),
        ("slip (um),mu·10³", "'·10³' is a factor"),
        ("slip (um),mu / ‰", "'‰' is a factor"),
        ("slip (um),mu in per cent", "'per cent' is a factor"),
        ("slip, um;mu", "a head is one name"),
        ("# slip/10^-6 m,mu", "row 1, column 1, 'slip/10^-6 m': '10^-6' is a factor"),
        ("# slip,mu*1000", "'*1000' is a factor"),
        ("# slip,1000 mu", "'1000' is a factor"),
        ("# slip,mu 1e3", "'1e3' is a factor"),
        ("slip_in,mu", "'in' may be a unit"),
        ("slip in in,mu", "'in' may be a unit"),
    ],
)
def test_units_that_are_not_understood_are_refused(tmp_path, heads, text):
    with pytest.raises(SceneError) as caught:
        table(tmp_path, rows(heads))
    assert text in str(caught.value)
    assert '"name (m)"' in caught.value.allowed


@pytest.mark.parametrize(
    "content",
    [
        "slip (um);mu\n0,0;0,65\n8,0;0,453\n",
        "slip (um)\tmu\n0\t0,65\n8\t0,453\n",
        "slip (um)   mu\n0,0 0,65\n8,0  0,453\n",
        "slip_um mu\n0 0.65\n8 0.453\n",
        "# slip_um mu\n0.0e0 6.5e-1\n8 0.453\n",
    ],
)
def test_blanks_and_decimal_commas(tmp_path, content):
    law = table(tmp_path, content)
    assert (law.slip, law.mu) == ((0.0, 8e-6), (0.65, 0.453))


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("0,0,0,65\n8,0,0,453\n", "row 1: 4 columns, separated by commas; allowed: .* decimal"),
        ("0;0,65\n8;0.453\n", "row 1 has a decimal comma, row 2 a decimal point"),
        ("0;1,453\n8;1,412\n", "comma in row 1 may be decimal, or part thousands"),
    ],
)
def test_commas_are_not_guessed(tmp_path, content, text):
    with pytest.raises(SceneError, match=text):
        table(tmp_path, content)


LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "cm": 1e-2, "inch": 0.0254, "Nm": None}
POWERS = {"10^-6": 1e-6, "10-3": 1e-3, "1e-6": 1e-6, "10⁻⁶": 1e-6, "10^{-3}": 1e-3, "1000": 1e3}
POWERS |= {"10**-6": 1e-6, "10^3": 1e3, "100": 100.0}
FORMS = ("{0} ({1})", "{0} [{1}]", "{0}/{1}", "{0} / {1}", "{0}/({1})", "{0}, {1}", "{0} in {1}")
FORMS += ("{0}_{1}", "{0} {1}", "{0}: {1}", "{0}; {1}", "{1}", "{0} ({1}) filtered", "{1} {0}")
TIMES = ("{1} {0}", "{1}{0}", "{1}*{0}", "{0} × {1}", "{0}·{1}", "{0}x{1}")
SLIPS = st.sampled_from(["slip", "s", "d", "u_x", "Slip", "displacement", "x_1", "D2", "delta"])


@hypothesis.given(
    SLIPS,
    st.sampled_from([*LENGTHS, ""]),
    st.sampled_from([*POWERS, ""]),
    st.sampled_from(FORMS),
    st.sampled_from(TIMES),
    st.booleans(),
)
def test_any_head_is_read_with_its_factor_or_refused(name, unit, power, form, times, before):
    """`before` puts the power of ten with the name; otherwise it is with the unit."""
    before = before and "{0}" in form
    what = times.format(name, power) if power and before else name
    of = f"{power} {unit}".strip() if power and not before else unit
    head = form.format(what, of) if of else what
    try:
        read = unit_in(head, "m")
    except ValueError as error:
        assert len(str(error)) > 20
        return
    assert not power
    assert (LENGTHS[read] if read else 1.0) == (LENGTHS[unit] if unit else 1.0)


@hypothesis.given(
    st.sampled_from(["mu", "μ", "mu_k", "mu_2", "friction", "F_T", "tau", "f"]),
    st.sampled_from(["%", "‰", "N", "kN", "MPa", "mm", "ms", "10^3 N", "10-3", "per mille", "ppm"]),
    st.sampled_from(FORMS),
)
def test_a_friction_coefficient_has_no_unit_but_per_cent(name, unit, form):
    try:
        assert unit_in(form.format(name, unit), "") == unit == "%"
    except ValueError as error:
        assert len(str(error)) > 20


@pytest.mark.parametrize(
    ("name", "heads", "end"),
    [
        ("hold", "t (ms),gain", 8e-3),
        ("hold", "hold/h,gain", 8 * 3600.0),
        ("hold", "t_s,gain", 8.0),
        ("hold", "t_h,gain", None),  # t_h may be a hold time, or hours
        ("hold", "h,gain", None),
        ("speed", "v_mm/s,factor", 8e-3),
        ("speed", "v (mm s^-1),factor", 8e-3),
        ("speed", "v/(mm/s),factor", 8e-3),
        ("speed", "v/(mm s⁻¹),factor", 8e-3),
        ("speed", "v / mm s-1,factor", 8e-3),
        ("speed", "v_mm_s,factor", None),
    ],
)
def test_times_and_speeds(tmp_path, name, heads, end):
    values = rows(heads, ((0.0, 0.0), (8.0, 0.02)))
    if end is None:
        with pytest.raises(SceneError, match="is a unit"):
            table(tmp_path, values, name)
    else:
        law = table(tmp_path, values, name)
        assert (law.contact_time if name == "hold" else law.v) == (0.0, end)


@pytest.mark.parametrize(
    ("content", "name", "value", "texts"),
    [
        ("slip (um), mu\n0, 0.7\n1, x\n", "slide", None, ["row 3, column 2: not a number"]),
        ("0, 0.7\n2, 0.6\n2, 0.5\n", "slide", 2.0, ["row 3: not beyond", "than 2.0 m"]),
        ("1, 0.7\n2, 0.6\n", "slide", 1.0, ["row 1: tables start at 0"]),
        ("0, 0.7\n2, -0.6\n", "slide", -0.6, ["row 2, column 2: too small", "number >= 0"]),
        ("slip, um,mu\n0, 0.7\n", "slide", None, ["row 1: 3 columns", "two columns"]),
        ("0, 0\n\n2, inf\n", "hold", float("inf"), ["row 3, column 2: not a finite number"]),
        ("0, 0, 0\n", "hold", None, ["row 1: 3 columns", "two columns"]),
        ("t (ms), gain\n", "hold", 0, ["2 to 1000 rows"]),
        ("0, 0\n1, 0.2\n2, 0.1\n", "hold", 0.1, ["row 3: no gain of mu_s"]),
        pytest.param("0, 0\n" * 300_000, "hold", "path", ["too large"], id="too large"),
        ("0, 0.7\n1, 0.5\n", "slide", 0.453, ["interface.mu_k", "0.5, at", "row 2", "taken from"]),
        ("0,0.7\n3e-7,0.72\n1,0.453\n", "slide", 0.72, ["slip 300 nm", "row 2", "mu_s = 0.7"]),
    ],
)
def test_bad_tables_in_files_are_refused(tmp_path, content, name, value, texts):
    with pytest.raises(SceneError) as caught:
        table(tmp_path, content, name)
    path = str(tmp_path / "laws" / "friction.csv")
    assert caught.value.value == (path if value == "path" else value)
    for text in (path, *texts):
        assert text in str(caught.value)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("slip/um,mu\n0,0,0,7\n1,5,0,45\n", "semicolons or tabs where numbers have decimal commas"),
        ("slip,mu\num,-\n0,0.7\n1,0.45\n", "row 2, column 1: .*units, write them in the heads"),
        ("slip,mu\n[um],[1]\n0,0.7\n1,0.45\n", "write them in the heads, such as 'slip "),
        ("0,0,0.7\n1,1,0.45\n", "3 columns, separated by commas; keep those of slip"),
    ],
)
def test_the_cause_is_named(tmp_path, content, text):
    with pytest.raises(SceneError, match=text):
        table(tmp_path, content)


def test_what_is_no_file_of_numbers_is_refused_and_not_shown(tmp_path):
    secret = tmp_path / "secret"
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for content in (
        "user:hunter2:0\n",
        "a,hunter2\n1,hunter2\n",
        "a,b,hunter2\n",
        '"hunter2',
        "hunter2\0",
    ):
        secret.write_text(content)
        with pytest.raises(SceneError, match="row") as caught:
            laws.TabulatedLaw.of(slide=secret)
        assert "hunter2" not in str(caught.value)
    for name, text in (
        ("pipe", "regular"),
        ("loop", "symbolic"),
        ("none", "No such"),
        (".", "directory"),
    ):
        with pytest.raises(SceneError, match=text):
            laws.TabulatedLaw.of(slide=tmp_path / name)
    with pytest.raises(SceneError, match="regular"):
        Scene.from_toml(tmp_path / "pipe")


# --- measured curves -----------------------------------------------------------------------------

D_C, END = 1.5e-6, 8e-6


def true(slip):
    return 0.453 + 0.2 * np.exp(-slip / D_C)


def measured(folder, noise, n=4000, **how):
    rng = np.random.default_rng(3)
    slip = rng.uniform(0, END, n)  # in no order
    columns = [1e6 * slip + 40.0, true(slip) + noise * rng.standard_normal(n)]
    np.savetxt(folder / "m.csv", np.column_stack(columns), delimiter=",", header="slip_um,mu")
    return laws.TabulatedLaw.of(slide=laws.Measured(path=folder / "m.csv", **how)), slip, columns[1]


def test_a_noisy_curve_becomes_a_falling_one_of_the_same_area(tmp_path):
    law, slip, mu = measured(tmp_path, 0.01)
    assert len(law.mu) == 20
    assert (np.diff(law.mu) <= 0).all()
    fitted = np.interp(slip - slip.min(), law.slip, law.mu)
    assert np.mean(fitted) == pytest.approx(np.mean(mu), rel=1e-9)  # least squares
    at = np.linspace(0, law.slip[-1], 500)
    assert np.abs(np.interp(at, law.slip, law.mu) - true(at)).max() < 0.01
    assert law.mu[0] == pytest.approx(true(0), abs=0.005)
    assert law.mu[-1] == pytest.approx(true(END), abs=0.005)
    steepest = (np.diff(law.mu) / np.diff(law.slip)).min()
    assert 0.5 < steepest / (-0.2 / D_C) < 2


def test_without_noise_the_curve_is_followed(tmp_path):
    law, slip, _ = measured(tmp_path, 0.0, knots=60)
    at = np.linspace(0, law.slip[-1], 500)
    assert np.abs(np.interp(at, law.slip, law.mu) - true(at + slip.min())).max() < 2e-4
    along = np.array(law.slip) / law.slip[-1] - (np.array(law.mu) - law.mu[0]) / (
        law.mu[0] - law.mu[-1]
    )
    np.testing.assert_allclose(np.diff(along), 2 / 59, rtol=0.05)


def test_an_interface_takes_mu_from_the_ends_of_a_table(tmp_path):
    law, *_ = measured(tmp_path, 0.01)
    assert (Interface(law=law).mu_s, Interface(law=law).mu_k) == (law.mu[0], law.mu[-1])
    assert Interface(law=law, mu_s=0.7).mu_s == 0.7
    for given in ({"mu_s": 0.7}, {"mu_k": 0.4}, {}):
        with pytest.raises(SceneError, match="missing"):
            Interface(**given)
    text = chain(L=5e-3).to_toml().replace("mu_s = 0.7\n", "").replace("mu_k = 0.45\n", "")
    file = tmp_path / "scene.toml"
    for slide, knots in (('{measured = "m.csv"}', 20), ('{measured = "m.csv", knots = 9}', 9)):
        file.write_text(f'{text}\n[interface.law]\nkind = "table"\nslide = {slide}\n')
        scene = Scene.from_toml(file)
        assert len(scene.interface.law.mu) == knots
        assert Scene.from_toml(scene.to_toml()) == scene
    for slide in ('{measured = "m.csv", knot = 3}', '{measured = "m.csv", knots = 1}', "{}", "3"):
        file.write_text(f'{text}\n[interface.law]\nkind = "table"\nslide = {slide}\n')
        with pytest.raises(SceneError):
            Scene.from_toml(file)


def test_what_does_not_fall_is_no_weakening(tmp_path):
    (tmp_path / "up.csv").write_text("0,0.4\n1,0.5\n2,0.6\n")
    (tmp_path / "one.csv").write_text("1,0.4\n1,0.5\n")
    (tmp_path / "flat.csv").write_text("0,0.4\n1e-6,0.4\n2e-6,0.4\n")
    for name in ("up", "one", "flat"):
        with pytest.raises(SceneError, match="does not fall"):
            laws.TabulatedLaw.of(slide=laws.Measured(path=tmp_path / f"{name}.csv"))
    with pytest.raises(SceneError, match="measured mu is slide"):
        laws.TabulatedLaw.of(hold=laws.Measured(path=tmp_path / "up.csv"))
