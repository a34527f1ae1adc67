"""The study of viscous slip in slabs: its lumped chain, and the chain's formula."""

import creeping
import numpy as np
import pytest

import pyfric
from pyfric.scene import slab
from pyfric.theory import Material, chain_prestress_overdamped


@pytest.mark.parametrize("rows", [3, 9])
def test_long_waves_of_a_slab_are_those_of_its_lumped_chain(rows):
    """For long waves a slab with free top and bottom is a rod: c^2 is E/rho."""
    scene = slab(p=60.0, L=0.1, H=(rows - 1) * 2.5e-3, l=2.5e-3)
    c, unit = creeping.lumped(scene)
    slider = scene.slider
    material = Material.of_lattice(slider.k, scene.m, slider.l, 1.0)
    assert c == pytest.approx(np.sqrt(material.E_prime / material.rho), rel=1e-9)
    assert unit == pytest.approx(c / slider.l * (rows - 0.5) * scene.m, rel=1e-12)


def test_the_formula_is_inverted():
    for tau_bar in (0.01, 0.3, 0.9):
        w = creeping.overdamped(tau_bar)
        assert float(chain_prestress_overdamped(w)) == pytest.approx(tau_bar, rel=1e-9)


@pytest.mark.slow
def test_twice_the_viscosity_is_half_the_speed():
    """Slab and formula agree in this for a slab of two rows at v << c."""
    speeds = []
    for alpha in (3.0, 6.0):
        job = creeping.slab_job(2, 0.4, alpha)
        record = pyfric.simulate(job.scene, job.t_end, job.options, progress=False)
        found = creeping.front(record)
        assert found["reached"] == creeping.BLOCKS
        speeds.append(alpha * found["v_over_c"])
    assert speeds[1] == pytest.approx(speeds[0], rel=0.15)  # 0.270 and 0.240: v is not yet << alpha
    assert speeds[1] < 0.6 * creeping.overdamped(0.4)  # slower than the chain
