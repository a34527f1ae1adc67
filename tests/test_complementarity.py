"""Tables of contact states, the next change, and static states, compared with dense solves."""

import dataclasses
import functools

import numpy as np
import pytest
from helpers import small_free, small_rod
from hypothesis import given, settings
from hypothesis import strategies as st

from pyfric.core import OPEN, STUCK
from pyfric.scene import CoulombLaw, Scene, chain, preset, setup2
from pyfric.statics import Contact, ContactProblem, StaticSolver, loaded_state
from pyfric.statics.contact import LEAST_DEFINITENESS, definiteness

SCENES = {
    "rod": small_rod(),
    "rod, right": small_rod(side="right", h=15e-3),
    "free": small_free(theta=0.833),
    "flat": setup2(L=6e-3, H=1e-3, h=1e-3),
    "chain": chain(L=0.02, k_top=3e6, tau=1.0),
}


@functools.cache
def interface(name: str) -> ContactProblem:
    return ContactProblem(SCENES[name])


def direct(i: ContactProblem, held: np.ndarray, X: float, slip: np.ndarray, closed: np.ndarray):
    """Return u_x, f, u_z, p and F_T from one dense solve; held blocks have the given u_x."""
    scene, s, N = i.scene, i.slider, i.scene.N_x
    mu, k_f = scene.interface.mu_k, scene.k_f
    A = s.S.copy()
    for b in range(N):
        A[N + b, N + b] += k_f * closed[b]
        A[b, N + b] -= slip[b] * mu * k_f * closed[b]
    w = [X, 1, scene.F_N, scene.top.T]
    g = s.G @ w
    stuck = closed & (slip == 0)
    unknown = np.concatenate([~stuck, np.ones(N, dtype=bool)])
    v = np.concatenate([np.where(stuck, held, 0.0), np.zeros(N)])
    rest = g - A @ v
    v[unknown] = np.linalg.solve(A[np.ix_(unknown, unknown)], rest[unknown])
    p = np.where(closed, -k_f * v[N:], 0.0)
    f = np.where(stuck, (s.S @ v - g)[:N], -slip * mu * p)
    return v[:N], f, v[N:], p, s.c @ w - s.G[:, 0] @ v


def assert_same(contact: Contact, expected, rtol: float = 1e-9) -> None:
    unit, k = contact.problem.unit, contact.problem.scene.slider.k
    force = rtol * max(unit, np.abs(expected[1]).max(), np.abs(expected[3]).max(), expected[4])
    length = rtol * max(unit / k, *(np.abs(expected[n]).max() for n in (0, 2)))
    now = contact.values()
    scale = (length, force, length, force, force)
    for name, value, wanted, atol in zip(now._fields, now, expected, scale, strict=True):
        np.testing.assert_allclose(value, wanted, rtol=0, atol=atol, err_msg=name)


steps = st.tuples(
    st.integers(0, 6), st.sampled_from(["slip+", "slip-", "hold", "back", "flip", "all", "drive"])
)


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=25)
@given(todo=st.lists(steps, max_size=25))
def test_tables_after_any_changes(name, todo):
    i = interface(name)
    N = i.scene.N_x
    contact = i.loaded()
    held, X = contact.values().u_x.copy(), contact.drive
    slip, closed = np.zeros(N, dtype=np.int8), np.ones(N, dtype=bool)
    for where, what in todo:
        b = where * (N - 1) // 6
        u_x = direct(i, held, X, slip, closed)[0]
        stuck = closed[b] and slip[b] == 0
        if what in ("slip+", "slip-") and stuck:
            slip[b] = 1 if what == "slip+" else -1
            contact.change(b, slip[b])
        elif what == "hold" and slip[b]:
            held[b], slip[b] = u_x[b], 0
            contact.change(b, STUCK)
        elif what == "back" and slip[b]:
            slip[b] = 0
            contact.put(np.array([b]), np.array([STUCK]), held[[b]])
        elif what == "flip" and i.scene.N_z > 1 and (closed.sum() > 3 or not closed[b]):
            closed[b] ^= True
            slip[b], held = 0, u_x
            contact.change(b, STUCK if closed[b] else OPEN)
        elif what == "all":
            held = u_x
            p = contact.values().p
            slip[p > contact.least] = 0
            contact.hold_all()
        elif what == "drive":
            X = contact.drive = contact.drive + 0.02 * i.scene.F_N / i.scene.driver.K
        np.testing.assert_array_equal(contact.slip, slip)
        np.testing.assert_array_equal(contact.closed, closed)
        np.testing.assert_array_equal(contact.stuck, closed & (slip == 0))
        assert contact.drive == X
        assert_same(contact, direct(i, held, X, slip, closed))


@pytest.mark.parametrize("name", SCENES)
def test_rates_are_differences(name):
    i = interface(name)
    contact = i.loaded()
    contact.change(0, 1)
    contact.change(1, -1)
    now, rate = contact.values(), contact.rates()
    step = 0.1 * i.scene.F_N / i.scene.driver.K
    contact.drive += step
    for value, slope, later in zip(now, rate, contact.values(), strict=True):
        size = max(np.abs(value).max(), np.abs(later).max())
        np.testing.assert_allclose(value + step * slope, later, rtol=0, atol=1e-12 * size)


def margins(contact: Contact) -> dict[int, np.ndarray]:
    """Return the gap functions, in N, by the kind of change at their zero."""
    now, inf = contact.values(), np.inf
    stuck, closed = contact.stuck, contact.closed
    gap = np.where(closed, now.p, contact.k_f * now.u_z)
    return {
        1: np.where(stuck, contact.law.margins(now.p, now.f)[0], inf),
        -1: np.where(stuck, contact.law.margins(now.p, now.f)[1], inf),
        OPEN: np.where(closed, gap, inf),
        STUCK: np.where(closed, inf, gap),
    }


@pytest.mark.parametrize("name", SCENES)
def test_the_next_change_is_the_first(name):
    """On a fine scan no condition is violated before the change, and one is just beyond it."""
    i = interface(name)
    contact, unit, seen = i.loaded(), i.unit, 0
    contact.law = CoulombLaw(*2 * [contact.law.mu_k])  # releases then do not change the state
    for n in range(12):
        X, b, what = contact.next_change()
        if not np.isfinite(X):
            break
        start = contact.drive
        assert X >= start
        for share in np.linspace(0, 1, 50):
            contact.drive = start + share * (X - start)
            for one in margins(contact).values():
                assert one.min() >= -1e-9 * unit
        assert margins(contact)[what][b] == pytest.approx(0, abs=1e-9 * unit)
        contact.drive = X + 1e-4 * i.scene.F_N / i.scene.driver.K
        assert margins(contact)[what][b] < 0
        contact.drive = X
        seen += 1
        contact.change(b, what)
        if abs(what) == 1 and n % 3 == 2:  # every third such block carries less
            contact.hold_all()
    assert seen >= 5


def test_nothing_changes_in_a_driver_that_cannot_pull_further():
    """If all blocks slip, forces stay the same, whatever the driver does."""
    contact = interface("rod").loaded()
    for b in range(contact.N_x):
        contact.change(b, 1)
    assert contact.next_change()[0] == np.inf
    assert contact.definiteness() > LEAST_DEFINITENESS


def test_the_slip_operator_loses_definiteness_near_mu_1():
    """In setup 1, it is positive definite for random slip at mu <= 0.7, but not at mu = 1.1."""
    rng, i = np.random.default_rng(0), ContactProblem(preset("fig1"))
    found = {0.45: 0, 0.7: 0, 1.1: 0, 2.0: 0}
    contact = i.loaded()
    alternating = np.resize(np.array([1, -1], dtype=np.int8), contact.N_x)
    patterns = [alternating, *(rng.choice([-1, 1], contact.N_x) for _ in range(10))]
    for mu in found:
        contact.law = CoulombLaw(mu, mu)
        for pattern in patterns:
            contact.enter(slice(None), pattern)
            contact.renew()
            found[mu] += contact.definiteness() < LEAST_DEFINITENESS
    assert found[0.45] == found[0.7] == 0
    assert 0 < found[2.0]


def test_definiteness_falls_linearly_with_friction():
    """Definiteness is 1 without friction; with fewer slipping blocks it is larger."""
    contact = interface("rod").loaded()
    found = []
    for mu in (0.0, 0.5, 1.0):
        contact.law = CoulombLaw(mu, mu)
        found.append(contact.definiteness_of_sliding())
        for number in range(contact.N_x + 1):
            slip = (np.arange(contact.N_x) < number).astype(np.int8)
            for way in (slip, -slip):
                assert definiteness(*contact.slip_operator(way)) >= found[-1] - 1e-12
    assert found[0] == pytest.approx(1, abs=1e-12)
    assert found[1] == pytest.approx((found[0] + found[2]) / 2, abs=1e-12)
    limit = 1 / (1 - found[2])
    for mu, definite in ((0.98 * limit, True), (0.995 * limit, False)):  # 0.99 limit: 0.01
        contact.law = CoulombLaw(mu, mu)
        assert (contact.definiteness_of_sliding() > LEAST_DEFINITENESS) == definite
        operators = [contact.slip_operator(np.full(contact.N_x, way)) for way in (1, -1)]
        assert all(definiteness(*one) > LEAST_DEFINITENESS for one in operators) == definite


@pytest.mark.parametrize("name", ["rod", "free"])
def test_the_slip_operator_is_the_inverse_of_the_table(name):
    """The operators agree with open blocks, too, which move freely."""
    contact = interface(name).loaded()
    for i in (0, 3):
        contact.change(i, OPEN)
    for i, way in ((1, 1), (2, -1), (5, 1)):
        contact.change(i, way)
    W, F = contact.slip_operator(contact.slip)
    i = np.flatnonzero(contact.slip)
    np.testing.assert_allclose(np.linalg.inv(W), contact.table[np.ix_(i, i)], rtol=1e-9)
    np.testing.assert_allclose(F, F.T, rtol=1e-9)


LOADED = {
    "rod": small_rod(),
    "rod, 0.2": small_rod(mu_s=0.2, mu_k=0.2),
    "rod, 0.2/0.1": small_rod(mu_s=0.2, mu_k=0.1),
    "free, 0.2": small_free(mu_s=0.2, mu_k=0.2, theta=0.833),
    "free, 0.2/0.15": small_free(mu_s=0.2, mu_k=0.15, theta=-0.833, side="right"),
    "free, no load at one end": small_free(theta=1.0),
    "free, no load at the other end": small_free(theta=-1.0, mu_s=0.3, mu_k=0.0),
    "no friction": small_free(mu_s=0.0, mu_k=0.0, theta=0.5),
    "chain": chain(L=0.02, k_top=3e6, tau=1.0),
}


@pytest.mark.parametrize("name", LOADED)
def test_the_loaded_state(name):
    """The state is that of `loaded_state`, also if blocks slip or lift off under F_N."""
    scene = LOADED[name]
    rest, i = loaded_state(scene), ContactProblem(scene)
    contact = i.loaded()
    now = contact.values()
    length = np.abs(rest.u).max()
    np.testing.assert_allclose(now.u_x, rest.u[0, 0], rtol=0, atol=1e-10 * length)
    np.testing.assert_allclose(now.u_z, rest.u[0, 1], rtol=0, atol=1e-10 * length)
    np.testing.assert_allclose(now.f, rest.f, rtol=0, atol=1e-10 * scene.F_N)
    np.testing.assert_allclose(now.p, rest.p, rtol=0, atol=1e-10 * scene.F_N)
    np.testing.assert_array_equal(contact.closed, ~rest.open)
    assert now.F_T == pytest.approx(0, abs=1e-10 * scene.F_N)
    assert contact.drive == pytest.approx(scene.d * rest.u_drv0, rel=1e-9, abs=1e-10 * length)
    assert rest.slipped.any() == ("0.2" in name or "friction" in name or "other" in name)


def compare(scene: Scene, u_x: np.ndarray, drive: float, free: np.ndarray, known: StaticSolver):
    i = ContactProblem(scene)
    here = i.solve(u_x, drive, free=free)
    there = known.solve(u_x, drive, free=free)
    atol = 1e-9 * max(scene.F_N, np.abs(there.tau).max(), abs(there.F_T))
    assert here.F_T == pytest.approx(there.F_T, rel=0, abs=atol)
    np.testing.assert_allclose(here.p, there.p, rtol=0, atol=atol)
    np.testing.assert_allclose(here.tau, there.tau, rtol=0, atol=atol)
    return there


@pytest.mark.parametrize("name", SCENES)
def test_static_states(name):
    """States are those of `StaticSolver`: random interfaces, open blocks, blocks lifting off."""
    scene = SCENES[name]
    known, rng = StaticSolver(scene, "linear"), np.random.default_rng(5)
    size, N = scene.F_N / scene.N_x / scene.slider.k, scene.N_x
    lifted = 0
    for n in range(24):
        free = rng.random(N) < (0.0, 0.2, 0.4)[n % 3]
        wave = np.cos(np.pi * np.arange(N) * rng.integers(1, 3) / N)
        u_x = known.loaded.u[0, 0] + (0.3, 3.0)[n % 2] * size * wave * rng.standard_normal()
        drive = scene.F_N / scene.driver.K * rng.random()
        lifted += compare(scene, u_x, drive, free, known).open.sum() > 0
    assert lifted or scene.N_z == 1


def test_a_scene_may_be_mirrored():
    scene = small_free(theta=0.833)
    driver = dataclasses.replace(scene.driver, side="right")
    one, two = (
        ContactProblem(scene).loaded(),
        ContactProblem(dataclasses.replace(scene, driver=driver)).loaded(),
    )
    a, b = one.next_change(), two.next_change()
    assert (a[1], a[2]) == (scene.N_x - 1 - b[1], -b[2])
    assert a[0] - one.drive == pytest.approx(b[0] - two.drive, rel=1e-10)
