"""Objects as a few lines of text and as notebook pictures; scenes with changed values."""

import base64
import html
import math
import re

import numpy as np
import pint
import pytest
from helpers import refused, small

import pyfric
from pyfric import theory
from pyfric.record import numbered
from pyfric.scene import Driver, Interface, PrescribedLoad, preset
from pyfric.values import SceneError

PRE = '<pre style="white-space: pre-wrap">'  # long notes stay inside the page


@pytest.fixture(scope="module")
def record():
    return pyfric.simulate(small(), 1.2e-3, fidelity="dynamic", geometry="linear", progress=False)


def drawing(shown):
    """Return the bytes of the picture, its alternative text, and the lines below it."""
    parts = r'<img alt="(.*?)" src="data:image/png;base64,(.*?)".*?><pre style=".*?">(.*)</pre>'
    alt, data, lines = re.fullmatch(parts, shown._repr_html_(), re.DOTALL).groups()
    return base64.b64decode(data), html.unescape(alt), html.unescape(lines)


def test_a_scene():
    scene = preset("fig1")
    lines = repr(scene).splitlines()
    assert lines[0] == "Scene fig1: 57 x 31 blocks"
    assert "h = 0.005 m" in lines[4]
    assert len(lines) == 6
    speeds = dict(re.findall(r"(c_\w) = (\S+) m/s", lines[2]))
    known = theory.Material.of_lattice(scene.slider.k, scene.m, scene.slider.l, 1.0)
    for name in ("c_P", "c_S"):
        assert float(speeds[name]) == pytest.approx(getattr(known, name), rel=1e-5)
    assert f"F_N/N_x = {scene.F_N / scene.N_x:.6g} N" in lines[2]
    picture, alt, text = drawing(scene)
    assert picture.startswith(b"\x89PNG")
    assert "L = 140 mm" in alt
    assert text == repr(scene)


def test_a_record(record):
    text = record.summary()
    assert text == repr(record)
    assert text.startswith("setup1: complete at t = 0.0012")
    assert f"events: {record.events['is_main'].sum()} main" in text
    assert [numbered(n, "micro-slip") for n in (0, 1)] == ["0 micro-slips", "1 micro-slip"]
    assert str(record.method) in text
    picture, alt, below = drawing(record)
    assert picture.startswith(b"\x89PNG")
    assert alt == pyfric.figures.figure_caption(record)
    assert below == text


def test_plan_state_sweep_and_figure(record):
    plan = pyfric.plan(small(), t_end=1e-3)
    assert repr(plan) == str(plan)
    assert plan._repr_html_() == f"{PRE}{html.escape(str(plan))}</pre>"
    assert repr(record.final_state).startswith("State of 9 x 6 blocks at t = 0.0012")
    assert record.final_state._repr_html_() == f"{PRE}{record.final_state!r}</pre>"
    sweep = pyfric.Sweep(scene=small(), t_end=1.0, over={"driver.h": [5e-3]})
    assert repr(sweep) == "Sweep of setup1 over driver.h: grid, t_end = 1 s"
    assert drawing(sweep)[2] == repr(sweep)
    assert pyfric.figures.sketch("fig1")._repr_png_().startswith(b"\x89PNG")


def test_a_scene_with_other_values():
    scene = preset("fig1")
    expected = preset("fig1", h=7.5e-3, mu_k=0.4, name="mine")
    for height in ("7.5 mm", 7.5e-3, pint.Quantity(7.5, "mm")):
        assert preset("fig1", h=height).driver == Driver(K=4e6, V=0.7875e-3, h=height)
        assert scene.replace({"driver.h": height}, mu_k=0.4, name="mine") == expected
    assert scene.replace(interface=Interface(mu_s=0.5, mu_k=0.2)).interface.mu_s == 0.5
    assert scene == preset("fig1")


def test_values_with_units():
    forces = pint.Quantity(np.linspace(0.1, 0.2, 5), "kN")
    load = PrescribedLoad(p=forces, tau=0.0, k_top="1 MN/m")
    assert load == PrescribedLoad(p=np.linspace(0.1, 0.2, 5) * 1e3, tau=0.0, k_top=1e6)
    assert preset("chain", L="0.14 m", l=pint.Quantity(2.5, "mm")) == preset("chain")
    assert preset("fig1").replace(mu_s=pint.Quantity(50, "percent")).interface.mu_s == 0.5
    refused(lambda: preset("fig1", h="0.005"), "driver.h", value="0.005", unit="m", within=(0,))


def test_laws_with_long_tables_are_a_line():
    law = pyfric.laws.TabulatedLaw.of(hold=(lambda a: 0.02 * math.log10(1 + a / 1e-3), 10.0))
    held = "contact time 0 to 10 s, 52 knots, gain 0.000 to 0.080"
    assert repr(law) == f"TabulatedLaw({held})"
    scene = preset("fig1").replace(law=law)
    assert f", law = {law!r}, " in repr(scene).splitlines()[-1]
    assert "hold=<table of 52 knots up to 10>, slide=None" in repr(scene.law)
    assert repr(pyfric.laws.Ageing(B=0.1, t_c=1.0)) == "Ageing(B=0.1, t_c=1.0)"


def test_states_of_rest_and_jobs_are_a_line():
    rest = pyfric.loaded_state("fig1")
    assert repr(rest).startswith("Equilibrium of 57 x 31 blocks: F_T = 0 N, p = 58.58 to 85 N, 0 o")
    assert repr(pyfric.StaticSolver("chain")) == "StaticSolver of chain, linear geometry"
    job = pyfric.Job(scene="fig1", t_end=0.1, options={"fidelity": "hybrid"})
    assert repr(job) == "Job: fig1 to t = 0.1 s, fidelity = hybrid"
    assert "\n" not in repr(rest)


@pytest.mark.parametrize(
    ("changes", "field", "text"),
    [
        ({"hh": 1.0}, "hh", "did you mean 'h'"),
        ({"protocol": ()}, "protocol", "top.protocol or driver.protocol"),
        ({"h": "5 kg"}, "driver.h", "wrong unit"),
        ({"h": "7.6 mm"}, "driver.h", "multiple of l"),
        ({"V": pint.Quantity(1.0, "mm")}, "driver.V", "Cannot convert"),
    ],
    ids=str,
)
def test_refused_values(changes, field, text):
    with pytest.raises(SceneError, match=text) as refusal:
        preset("fig1").replace(changes)
    assert refusal.value.field == field


def test_dir_is_complete():
    assert {name for name in dir(pyfric) if not name.startswith("__")} < set(pyfric.__all__)
    rooms = set(pyfric.ROOMS) - {"measured", "figures", "theory"}
    assert rooms.isdisjoint(dir(pyfric))
    for name in pyfric.__all__:
        assert getattr(pyfric, name) is not None


def test_a_scene_plots_itself_and_presets_are_listed():
    scene = preset("fig1")
    assert scene.plot().caption == pyfric.figures.sketch(scene).caption
    assert list(pyfric.presets()) == list(pyfric.PRESETS)
    assert all(pyfric.presets().values())
