"""Stable slip as static states, compared with minima of the energy and closed forms."""

import numpy as np
import pytest

import pyfric
from pyfric.scene import chain, setup2
from pyfric.statics import ContactProblem, Creep

MU_S, MU_K, P, D_C, K_CHAIN = 0.7, 0.45, 60.0, 4e-6, 2e7
SLOPE = (MU_S - MU_K) * P / D_C  # 3.75 MN/m


def links(n, **changes):
    return chain(**{"L": n * 1e-3, "l": 1e-3, "p": P, "k": K_CHAIN, "d_c": D_C} | changes)


def at_rest(scene):
    """Return the slider with nothing slipping, and the drive at which F_T = 0."""
    problem = ContactProblem(scene)
    contact = problem.loaded()
    none = np.zeros(scene.N_x)
    return Creep(problem, none, none, contact.closed, none), contact.drive


def stiffness(scene):
    """Return the stiffness of a chain with its driver, in plain loops."""
    n, k, K = scene.N_x, scene.slider.k, scene.driver.K
    A = np.zeros((n, n))
    for i in range(n - 1):
        A[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    A[0, 0] += K
    return A


def settled(A, push, u, start):
    """Return the state of rest that slip from u, at rest since `start`, reaches.

    One block at a time moves forward to its nearest minimum of energy.
    """
    for _ in range(200_000):
        before = u.copy()
        for i in range(len(u)):
            s = u[i] - start[i]
            pull = push[i] - A[i] @ u  # at the present u
            while pull > (strength := P * (MU_S - (MU_S - MU_K) * min(s / D_C, 1.0))) + 1e-12:
                falls = SLOPE if s < D_C else 0.0
                room = D_C - s if s < D_C else np.inf
                by = (pull - strength) / (A[i, i] - falls) if A[i, i] > falls else np.inf
                by = min(by, room)
                u[i], s, pull = u[i] + by, s + by, pull - A[i, i] * by
                if by < room:
                    break
        if np.abs(u - before).max() < 1e-18:
            return u
    raise AssertionError("not settled")


@pytest.mark.parametrize("K", [1e6, 2.7e6, 2.8e6, 8e6])
def test_one_block_is_unstable_below_the_stiffness_of_its_weakening(K):
    """The condition is K + k < (mu_s - mu_k) p/d_c; neighbours with strength 10 p hold."""
    k, end = 1e6, 80e-6
    creep, drive = at_rest(links(2, K=K, k=k, mu_s=[MU_S, 10.0, 10.0], mu_k=[MU_K, 9.0, 9.0]))
    path, changes = creep.nucleate(drive, drive + end)
    assert [one.what for one in changes] == ["slip +", "end" if K + k > SLOPE else "unstable"]
    ways, forces = ([one.drive - drive for one in path], [one.F_T for one in path])
    first, knot = MU_S * P / K, (MU_K * P + (K + k) * D_C) / K
    last = K * (end - (K * end - MU_K * P) / (K + k))
    if K + k < SLOPE:
        np.testing.assert_allclose([ways[-1], forces[-1]], [first, MU_S * P], rtol=1e-8)
    else:
        known = [MU_S * P, MU_K * P + k * D_C, last]
        np.testing.assert_allclose(np.interp([first, knot, end], ways, forces), known, rtol=1e-8)


@pytest.mark.parametrize(("K", "k"), [(3e6, 2e6), (8e6, 8e6)])
def test_two_blocks_are_unstable_where_the_condensed_stiffness_says(K, k):
    """The first block is at mu_k when the second one starts to slip, at k u = mu_s p."""
    creep, drive = at_rest(links(2, K=K, k=k, mu_s=[MU_S, MU_S, 10.0], mu_k=[MU_K, MU_K, 9.0]))
    path, changes = creep.nucleate(drive, drive + 80e-6)
    stable = np.linalg.eigvalsh([[K + k, -k], [-k, 2 * k - SLOPE]])[0] > 0
    whats = ["slip +", "slip +", "end" if stable else "unstable"]
    assert [(one.what, one.block) for one in changes[:2]] == [("slip +", 0), ("slip +", 1)]
    assert [one.what for one in changes] == whats
    begins = (MU_K * P + (K + k) * MU_S * P / k) / K
    if not stable:
        np.testing.assert_allclose(path[-1].drive - drive, begins, rtol=1e-8)


@pytest.mark.parametrize("K", [1e8, 2e7])
def test_six_blocks_follow_minima_of_energy_until_one_vanishes(K):
    scene = links(5, K=K)
    creep, drive = at_rest(scene)
    path, changes = creep.nucleate(drive, drive + 100e-6)
    assert changes[-1].what == "unstable"
    end = path[-1].drive - drive
    A, u = stiffness(scene), np.zeros(6)
    at, u_x = np.array([one.drive - drive for one in path]), np.array([one.u_x for one in path])
    found = []
    for way in np.linspace(0.05, 0.999, 20) * end:
        push = np.zeros(6)
        push[0] = K * way
        u = settled(A, push, u, np.zeros(6))
        found.append([np.interp(way, at, one) for one in u_x.T])
        np.testing.assert_allclose(found[-1], u, rtol=0, atol=1e-11)
    push[0] = K * 1.001 * end
    jumped = settled(A, push, u.copy(), np.zeros(6))
    assert (jumped - u).max() > 3e-7


def test_the_length_of_nucleation_tends_to_that_of_a_weakening_crack():
    """A long patch is stable up to 2 h = 1.158 mu*/W for any load (Uenishi and Rice 2003).

    One body on a rigid plane under a constant load is half of a crack between two bodies: mu* =
    E'/2, W = (mu_s - mu_k) p/(2 d_c). With E B = 4 k/3, a patch of n blocks is stable up to a
    weakening of 1.158 (4/3) k/n, with an error of order 1/n.
    """
    n, l = 121, 1e-3
    scene = setup2(L=(n - 1) * l, H=60 * l, l=l, h=30 * l, k_f=1e3)
    table = ContactProblem(scene).base(np.ones(n, dtype=bool))
    F = table[n : 2 * n, :n]
    held = []
    for blocks in (13, 17):
        some = slice((n - blocks) // 2, (n + blocks) // 2)
        held.append(np.linalg.eigvalsh((F + F.T)[some, some] / 2)[0] * blocks / scene.slider.k)
    straight = (17 * held[1] - 13 * held[0]) / (17 - 13)
    assert straight == pytest.approx(1.158 * 4 / 3, rel=0.01)


def test_a_block_without_a_length_of_weakening_is_unstable_at_once():
    creep, drive = at_rest(links(2, K=8e6, k=8e6, d_c=D_C * np.array([1.0, 0.0, 1.0])))
    _, changes = creep.nucleate(drive, drive + 80e-6)
    assert [(one.what, one.block) for one in changes[:2]] == [("slip +", 0), ("slip +", 1)]
    assert changes[2].what == "unstable"


def test_a_margin_that_rounding_has_used_up_does_not_stop_a_path(monkeypatch):
    """The path must not go on in steps of the size of rounding."""
    p = (4.3, 1.0, 2.4, 24.3, 2.8, 4.5, 3.7, 4.8, 1.4, 2.9, 4.4, 2.1)
    how = {"mu_s": 0.28, "mu_k": 0.14, "d_c": 1.8e-9, "K": 1e5, "k_top": 6e4, "V": 8.75e-3}
    scene = chain(L=11 * 2.5e-3, p=p, eta=42.9, **how)
    steps, step = [], Creep._step
    monkeypatch.setattr(Creep, "_step", lambda *known: steps.append(step(*known)) or steps[-1])
    record = pyfric.simulate(scene, 0.018, fidelity="dynamic", progress=False)
    assert record.events["nucleation_length"].notna().any()
    assert len(steps) < 100 * len(record.events)
