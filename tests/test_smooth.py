"""Smooth shapes of a lattice and the modes in them, against sparse matrices and dense solutions."""

import numpy as np
import pytest
from scipy.linalg import eigh

from pyfric.engines.smooth import Smooth, slowest
from pyfric.scene import setup1, setup2
from pyfric.statics import StaticSolver, damping, mass


def rod(**changes):
    return setup1(**{"L": 0.04, "H": 0.02, "h": 5e-3} | changes)


SCENES = {
    "rod": rod(),
    "right": rod(side="right"),
    "rod's driver": rod(h=0.02),
    "foundation": rod(k_f=np.linspace(1e7, 3e7, 17)),
    "free": setup2(L=0.02, H=0.01, theta=0.3),
    "top driver": setup2(L=0.02, H=0.01, h=0.01),
    "along": setup2(L=0.02, H=0.01).replace(dashpots="along"),
    "two rows": rod(H=2.5e-3, h=2.5e-3),
    "three rows": rod(H=5e-3),
}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_sums_over_columns_and_rows_are_those_of_the_lattice(scene):
    """Stiffness, damping and mass between modes, and single coordinates of them."""
    smooth = Smooth(scene, 12)
    stuck = np.ones(scene.N_x, dtype=bool)
    K, _, free = StaticSolver(scene).tangent(stuck)
    y = np.random.default_rng(0).standard_normal(len(smooth.M))
    q = smooth.spread(y)
    assert (q[np.setdiff1d(np.arange(len(q)), free)] == 0).all()
    for whole, part in ((K, smooth.K), (damping(scene), smooth.C)):
        np.testing.assert_allclose(smooth.gather(whole @ q), part @ y, atol=1e-10 * part.max())
    np.testing.assert_allclose(smooth.gather(mass(scene) * q), smooth.M @ y, atol=1e-11)
    index = np.array([0, 3, scene.N_x + 2, len(q) - 3, len(q) - 2, len(q) - 1])
    np.testing.assert_allclose(smooth.at(index) @ y, q[index], atol=1e-12 * np.abs(q).max())


@pytest.mark.parametrize("name", ["rod", "foundation", "free"])
def test_frequencies_are_slightly_above_those_of_the_lattice(name):
    scene = SCENES[name]
    K, _, free = StaticSolver(scene).tangent(np.ones(scene.N_x, dtype=bool))
    squares = eigh(K[free][:, free].toarray(), np.diag(mass(scene)[free]), eigvals_only=True)
    omega, exact = Smooth(scene, 20).omega, np.sqrt(squares[:20])
    assert (omega >= exact * (1 - 1e-9)).all()
    np.testing.assert_allclose(omega, exact, rtol=1e-3)
    assert slowest(scene, 20) == pytest.approx(exact[-1], rel=0.25)
