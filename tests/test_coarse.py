"""The same slider with larger blocks."""

import numpy as np
import pytest

from pyfric.engines import pauses
from pyfric.engines.pauses import coarser
from pyfric.scene import chain, setup1, setup2
from pyfric.scene.laws import Junctions


@pytest.mark.parametrize(
    "scene",
    [
        setup1(l=0.25e-3),
        setup1(l=0.5e-3, side="right", h=0.01, eta=2.0),
        setup2(l=0.2e-3, damping=1e-3),
    ],
)
def test_coarser_keeps_the_slider(scene):
    less = coarser(scene)
    assert less.N_x * less.N_z <= pauses.BLOCKS
    for name in ("L", "H", "M", "k"):
        assert getattr(less.slider, name) == getattr(scene.slider, name)
    assert less.eta == scene.eta
    assert (less.driver, less.interface, less.top) == (scene.driver, scene.interface, scene.top)
    assert coarser(less) is less


def test_viscosity_of_slip_stays_per_length():
    scene = setup1(l=0.25e-3, alpha=2.0)
    less = coarser(scene)
    alpha = [one.field("alpha")[0] * (one.N_x - 1) for one in (scene, less)]
    assert alpha[0] == pytest.approx(alpha[1], rel=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_fields_of_the_friction_law_are_interpolated(side):
    """A list of values for each block fits the larger blocks, from the trailing edge on."""
    t_R = [1e-3 * (1 + n / 300) for n in range(301)]
    scene = setup2(L=0.3, H=0.004, side=side, law=Junctions(u_s=[1e-6] * 301, t_R=t_R))
    less = coarser(scene)
    assert less.N_x < scene.N_x
    assert less.interface.law.u_s == (1e-6,) * less.N_x
    np.testing.assert_allclose(less.interface.law.t_R, np.linspace(1e-3, 2e-3, less.N_x))


def test_coarser_takes_the_least_whole_factor_that_will_do():
    assert coarser(setup1(l=1.25e-3)).slider.l == 2.5e-3


def test_coarser_where_no_blocks_fit():
    scene = setup2(L=0.1009, H=0.0199, l=1e-4, h=7e-4)  # 1009 and 199 are primes
    less = coarser(scene)
    assert less.N_x * less.N_z <= pauses.BLOCKS
    assert (less.slider.L, less.eta) == (scene.slider.L, scene.eta)
    assert less.slider.H == pytest.approx(scene.slider.H, abs=less.slider.l)
    assert less.driver.h == pytest.approx(scene.driver.h, abs=less.slider.l)


@pytest.mark.parametrize("side", ["left", "right"])
def test_coarser_chain_is_the_same_rod(side):
    n = 2001
    p = tuple(np.linspace(0.5, 2.5, n))
    tau = tuple(0.7 * np.array(p) * np.linspace(-1, 1, n))
    scene = chain(L=0.2, l=1e-4, p=p, tau=tau, k_top=1e3, side=side, damping=0.01)
    less = coarser(scene)
    assert less.N_x == pauses.COLUMNS
    assert less.slider.L == scene.slider.L
    for make in (
        lambda s: s.slider.k * s.slider.l,
        lambda s: s.eta * s.slider.l,
        lambda s: s.top.k_top / s.slider.l,
        lambda s: s.F_N,
        lambda s: s.shear.sum(),
    ):
        assert make(less) == pytest.approx(make(scene), rel=0.01)
    assert np.sign(less.load[0] - less.load[-1]) == np.sign(scene.load[0] - scene.load[-1])
