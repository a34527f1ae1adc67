"""From a material to a slider: the paper's numbers, wave speeds, decay of waves, refusals."""

import dataclasses
import math

import numpy as np
import pytest
from helpers import refused

import pyfric
from pyfric import Slider
from pyfric.scene import MATERIALS, Material, Scene, setup1
from pyfric.statics.operators import dispersion
from pyfric.values import SceneError

SLAB = {"L": "140 mm", "H": "75 mm", "l": "2.5 mm"}
E, B, RHO = 3e9, 6e-3, 1200.0


def test_the_paper_is_a_slab_of_3_GPa():
    slider = Slider.of_material(E="3 GPa", width="6 mm", density="1200 kg/m^3", **SLAB)
    assert slider.k == setup1().slider.k
    assert slider.M == pytest.approx(setup1().slider.M, rel=1e-15)
    assert dataclasses.replace(slider, M=0.0756) == setup1().slider


@pytest.mark.parametrize("l", [2.5e-3, 1.25e-3])
def test_waves_are_those_of_plane_stress_with_a_third(l):
    """The speeds agree apart from the effect of whole blocks at the edges."""
    slider = Slider.of_material(E=E, width=B, density=RHO, L=0.14, H=0.075, l=l)
    c = l * math.sqrt(slider.k / slider.m)
    edges = math.sqrt((1 + l / 0.14) * (1 + l / 0.075))
    assert math.sqrt(1.5) * c == pytest.approx(edges * math.sqrt(9 * E / (8 * RHO)), rel=1e-12)
    assert math.sqrt(0.5) * c == pytest.approx(edges * math.sqrt(3 * E / (8 * RHO)), rel=1e-12)


@pytest.mark.parametrize("l", [2.5e-3, 1.25e-3])
def test_waves_are_those_of_plane_strain_with_a_quarter(l):
    """c_P^2 = E (1 - nu)/((1 + nu)(1 - 2 nu) rho), c_S^2 = E/(2 (1 + nu) rho)."""
    nu, edges = 0.25, math.sqrt((1 + l / 0.14) * (1 + l / 0.075))
    slider = Slider.of_material(E=E, width=B, density=RHO, L=0.14, H=0.075, l=l, plane="strain")
    c = l * math.sqrt(slider.k / slider.m) / edges
    c_P = math.sqrt(E * (1 - nu) / ((1 + nu) * (1 - 2 * nu) * RHO))
    assert math.sqrt(1.5) * c == pytest.approx(c_P, rel=1e-12)
    assert math.sqrt(0.5) * c == pytest.approx(math.sqrt(E / (2 * (1 + nu) * RHO)), rel=1e-12)
    refused(lambda: Slider.of_material(E=E, width=B, density=RHO, **SLAB, plane="stretch"),
            "slider.material.plane", "'stress' or 'strain'")  # fmt: skip


def test_a_bulk_viscosity_stays_and_the_paper_s_falls_with_l():
    """Waves decay at the rate viscosity q^2/(2 rho), with the density of the blocks."""
    viscosity, q = 5e3, 20.0
    found = []
    for given in (viscosity, None):
        for l in (2.5e-3, 1.25e-3):
            how = {"E": E, "width": B, "density": RHO, "viscosity": given}
            scene = setup1(slider=Slider.of_material(**how, L=0.14, H=0.075, l=l))
            rho = scene.m / (B * l**2)
            _, gamma = dispersion(scene, np.array([[q, 0.0], [0.0, q]]))
            found.append(gamma * rho / q**2)
            paper = 0.8216 * l * math.sqrt(E * rho)
            np.testing.assert_allclose(found[-1], given or paper, rtol=1e-3)
    np.testing.assert_allclose(found[2] / found[3], 2, rtol=0.02)


@pytest.mark.parametrize("l", [2.5e-3, 1.25e-3])
@pytest.mark.parametrize(
    ("dashpots", "at_0", "at_45"), [("full", (1, 1), (1, 1)), ("along", (1, 2), (0.5, 2.5))]
)
def test_long_waves_decay_as_a_material_says(dashpots, at_0, at_45, l):
    """Decay rates over viscosity q^2/(2 rho): shear and pressure waves at 0, 90 and 45 degrees."""
    viscosity, q = 5e3, 1e-3 / l
    how = {"E": E, "width": B, "density": RHO, "viscosity": viscosity, "dashpots": dashpots}
    scene = setup1(slider=Slider.of_material(**how, L=0.14, H=0.075, l=l))
    directions = np.array([[1, 0], [0, 1], [1, 1], [1, -1]])
    ways = q * directions / np.linalg.norm(directions, axis=1)[:, None]
    _, gamma = dispersion(scene, ways)
    gamma = np.broadcast_to(gamma.reshape(len(ways), -1), (len(ways), 2))  # slower wave first
    found = gamma * scene.m / (B * l**2) / (viscosity * q**2)
    np.testing.assert_allclose(found, [at_0, at_0, at_45, at_45], rtol=1e-6)


def test_a_scene_file_may_give_a_viscosity_along_bonds():
    given = 'material = {E = "3 GPa", width = "6 mm", density = "1200 kg/m^3", '
    given += 'viscosity = "4 kPa s"}'
    text = setup1(dashpots="along").to_toml()
    text = text.replace('k = "13500000.0 N/m"\nM = "0.0756 kg"', given)
    assert Scene.from_toml(text).eta == pytest.approx(24.0, rel=1e-15)


def test_damping_is_eta_in_units_of_k_and_m():
    scene = setup1(damping=0.4)
    assert scene.eta == pytest.approx(2 * setup1().eta, rel=1e-15)
    assert setup1(damping=0.1).eta == setup1().eta
    assert setup1(damping=0.0).eta == 0
    assert Scene.from_toml(scene.to_toml()) == scene
    assert "damping" not in setup1().to_toml()
    refused(lambda: setup1(damping=0.1, eta=1.0), "slider.damping", "eta is given")


def test_scene_files_say_the_material():
    given = 'material = {E = "3 GPa", width = "6 mm", density = "1200 kg/m^3", '
    given += 'viscosity = "4 kPa s"}'
    text = setup1().to_toml().replace('k = "13500000.0 N/m"\nM = "0.0756 kg"', given)
    scene = Scene.from_toml(text)
    assert (scene.slider.k, scene.eta) == (13.5e6, pytest.approx(8.0, rel=1e-15))
    assert Scene.from_toml(scene.to_toml()) == scene
    named = text.replace('E = "3 GPa"', 'name = "steel"').replace(', density = "1200 kg/m^3"', "")
    assert Scene.from_toml(named).slider.k == pytest.approx(0.75 * 210e9 * B)
    for old, new, field, word in (
        ('"3 GPa"', '"3 GP"', "slider.material.E", "does not convert to Pa"),
        ('"3 GPa"', '"3e9"', "slider.material.E", "missing unit"),
        ("density", "densty", "slider.material.densty", "did you mean 'density'?"),
        ("material =", 'k = "1 N/m"\nmaterial =', "slider.k", "given by the material"),
        ("material =", 'eta = "1 N s/m"\nmaterial =', "slider.eta", "given by the material"),
        (given, 'material = "steel"', "slider.material", "not a table"),
        ('width = "6 mm", ', "", "slider.material.width", "missing"),
    ):
        refused(lambda old=old, new=new: Scene.from_toml(text.replace(old, new)), field, word)


def test_refusals():
    slab = SLAB | {"width": B}
    refused(lambda: Slider.of_material("PMA", **slab), "slider.material.name", "'PMMA'")
    refused(lambda: Slider.of_material("PDMS 10:1", **slab), "slider.material.density", "not known")
    refused(lambda: Slider.of_material(E=E, **slab), "slider.material.density", "missing")
    refused(lambda: Slider.of_material("PMMA", **slab | {"H": 0.0}), "slider.H", "height")
    both = slab | {"viscosity": 1.0, "damping": 0.1}
    refused(lambda: Slider.of_material("PMMA", **both), "slider.damping", "eta is given")
    refused(lambda: Slider.of_material("PMMA", **slab, M=1.0), "slider.M", "given by the material")
    refused(lambda: Slider.of_material("PMMA", **slab, lenght=1.0), "slider.lenght", "unknown")
    refused(lambda: Slider.of_material("PMMA", **slab | {"L": "1 kg"}), "slider.L", "'1 kg'")


@pytest.mark.parametrize("name", MATERIALS)
def test_materials_have_sources_and_say_what_they_lack(name):
    known = MATERIALS[name]
    assert len(known.source) > 20
    material = Material(name=name, width=B, density=known.density or 1000.0)
    assert material.E == known.E
    slider = Slider.of_material(name, density=known.density or 1000.0, width=B, **SLAB)
    c_S = slider.l * math.sqrt(0.5 * slider.k / slider.m)
    assert 0.5 < c_S < 4000
    if known.density is None:
        with pytest.raises(SceneError, match="density"):
            pyfric.Material(name=name, width=B)


def test_a_material_may_be_named_by_keyword():
    slab = {"L": "60 mm", "H": "20 mm", "l": "5 mm", "width": "6 mm"}
    assert Slider.of_material(name="glass", **slab) == Slider.of_material("glass", **slab)
