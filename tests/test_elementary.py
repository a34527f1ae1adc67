"""exp and log of the core, compared with long double; their bits with each instruction set."""

import numpy as np
import pytest

from pyfric import core
from pyfric.core.builds import load_variant

VARIANTS = [name for name, runs in core.variants().items() if runs]
EXP, LOG, LOG_1 = range(3)
LN_2 = np.log(np.longdouble(2))
EXACT = np.finfo(np.longdouble).eps < 1e-18
needs_long_double = pytest.mark.skipif(not EXACT, reason="long double has no more digits here")


def of_core(which, x, variant=core.VARIANT):
    """Return a function of the core at numbers x."""
    values = np.array(x, dtype=float)
    load_variant(variant).elementary(which, values)
    return values


def exponents():
    """Return arguments of exp: all sizes, and on both sides of each join of two powers of 2."""
    rng = np.random.default_rng(1)
    joins = ((np.arange(-1009, 1010) + 0.5) * LN_2).astype(float)
    near = [np.nextafter(joins, side) for side in (-np.inf, np.inf)]
    small = 10.0 ** rng.uniform(-300, 0, 10_000)
    found = np.concatenate([rng.uniform(-700, 700, 200_000), joins, *near, small, -small])
    return np.append(found[np.abs(found) <= 700], [-700.0, 700.0, 0.0, -0.0])


def positive():
    """Return arguments of log: all normal sizes, and on both sides of each join and of 1."""
    rng = np.random.default_rng(2)
    joins = np.sqrt(0.5) * 2.0 ** np.arange(-1021, 1024)
    powers = 2.0 ** np.arange(-1022, 1024)
    near = [np.nextafter(at, side) for at in (joins, powers[1:]) for side in (0, np.inf)]
    about_1 = 1 + 10.0 ** rng.uniform(-16, -1, 10_000) * rng.choice([-1, 1], 10_000)
    random = 2.0 ** rng.uniform(-1022, 1024, 200_000)
    ends = [np.finfo(float).tiny, np.finfo(float).max]
    return np.concatenate([random, joins, powers, *near, about_1, ends])


@needs_long_double
def test_exp_has_its_error():
    x = exponents()
    exact = np.exp(x.astype(np.longdouble))
    assert np.abs(of_core(EXP, x) / exact - 1).max() < 2e-16


def test_exp_ends_at_its_limits():
    """exp is 0 below -700, so that no result is subnormal, and constant above 700."""
    smallest, largest = of_core(EXP, [-700.0, 700.0])
    beyond = [np.nextafter(-700, -np.inf), -701.0, -745.0, -1e300, -np.inf]
    assert smallest > np.finfo(float).tiny
    assert not of_core(EXP, beyond).any()
    above = [np.nextafter(700, np.inf), 710.0, 1e300, np.inf]
    assert (of_core(EXP, above) == largest).all()
    np.testing.assert_array_equal(of_core(EXP, [0.0, -0.0]), 1.0)


@needs_long_double
def test_log_has_its_error():
    x = positive()
    exact = np.log(x.astype(np.longdouble))
    found = of_core(LOG, x)
    assert (np.abs(found - exact) / (1 + np.abs(exact))).max() < 3e-16
    other = exact != 0
    assert np.abs(found[other] / exact[other] - 1).max() < 5e-16
    assert of_core(LOG, [1.0])[0] == 0


@needs_long_double
def test_log_of_1_plus_has_its_error():
    rng = np.random.default_rng(3)
    x = np.concatenate([rng.uniform(0, 0.62, 100_000), 10.0 ** rng.uniform(-300, -1, 10_000)])
    exact = np.log1p(x.astype(np.longdouble))
    assert np.abs(of_core(LOG_1, x) / exact - 1).max() < 5e-16
    assert of_core(LOG_1, [0.0]).tolist() == [0.0]


@pytest.mark.parametrize("which", [EXP, LOG])
def test_they_grow_across_their_joins(which):
    """Neighbours on both sides of a join differ by more than the errors."""
    if which == EXP:
        joins = ((np.arange(-1009, 1009) + 0.5) * LN_2).astype(float)
        joins = joins[np.abs(joins) < 699]
        step = 4e-16 * np.ones(len(joins))
    else:
        joins = np.sqrt(0.5) * 2.0 ** np.arange(-1021, 1024)
        step = 6e-16 * (1 + np.abs(np.log(joins))) * joins
    way = np.arange(-20, 21)[:, None] * np.maximum(step, np.spacing(np.abs(joins)))
    values = of_core(which, (joins + way).ravel()).reshape(way.shape)
    assert (np.diff(values, axis=0) >= 0).all()
    assert (values[-1] > values[0]).all()


@pytest.mark.parametrize("variant", VARIANTS)
def test_bits_depend_on_no_instruction_set_and_no_neighbours(variant):
    for which, x in ((EXP, exponents()), (LOG, positive()), (LOG_1, np.linspace(0, 0.62, 1001))):
        first = of_core(which, x)
        np.testing.assert_array_equal(of_core(which, x, variant), first)
        for n in (1, 2, 3, 5, 7, 9, 17):
            np.testing.assert_array_equal(of_core(which, x[:n], variant), first[:n])
