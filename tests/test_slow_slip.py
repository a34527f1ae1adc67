"""Slip without inertia: independent integrations, linear theory, the hand-over, cut runs."""

import functools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rated_spacing
import scipy.optimize
from helpers import bits, peer
from rate_state import EVOLUTIONS, LAW, OWN, RATES, coefficient, rated, row, slow
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import pyfric
from pyfric import core
from pyfric.engines.cost import work_so_far
from pyfric.engines.linearised import Linearised
from pyfric.engines.path import Outside
from pyfric.engines.slow_slip import SlowSlip, values_of
from pyfric.scene import chain, laws, setup1, setup2
from pyfric.statics import StaticSolver, loaded_state

STORED = Path(__file__).parents[1] / "reference_data" / "rated"


def condensed(known, u_x, closed, t):
    """Return the condensed slider about its static state at u_x (m) and t (s), and the state."""
    outside = Outside(known, t)
    at = known.solve(u_x, outside.drive, free=~closed)
    bends, q = 0.0, known.coordinates(at.u, at.rod)
    about = Linearised(known, closed, q if known.geometry == "finite" else None)
    if known.geometry == "finite":
        bends = known.bends(q, about.answer(outside.rates()[0]))
    return about.interface(values_of(at), outside, bends), about


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_condensed_loads_are_those_of_static_states(geometry):
    """Loads agree exactly in linear geometry, to second order in displacements in finite."""
    scene = setup1(L=0.03, H=0.015, h=0.005, l=0.0025, F_N=200.0, eta=0.0)
    scene = scene.replace({"interface": rated()})
    known = StaticSolver(scene, geometry)
    closed = ~known.loaded.open
    u_x = known.loaded.u[0, 0] + 1e-7 * np.sin(np.arange(scene.N_x))
    interface, _ = condensed(known, u_x, closed, 0.01)
    errors = []
    for size in (1e-6, 5e-7):
        moved, s = size * np.cos(np.arange(scene.N_x)), size / scene.driver.V
        load, p, force = interface.at(s, moved)
        there = known.solve(u_x + moved, scene.drive(0.01 + s), free=~closed)
        changed = np.abs(load - interface.load[0][:, 0]).max()
        error = max(np.abs(load + there.f).max(), np.abs(p - there.p).max())
        errors.append(max(error, abs(force - there.F_T)) / changed)
    if geometry == "linear":
        assert max(errors) < 1e-9
    else:
        assert errors[0] < 3e-4
        assert errors[0] == pytest.approx(2 * errors[1], rel=0.1)


def test_loads_bend_as_those_of_static_states():
    """If only the driver moves, loads in finite geometry agree to third order."""
    scene = setup1(L=0.03, H=0.015, h=0.005, l=0.0025, F_N=200.0, eta=0.0)
    scene = scene.replace({"interface": rated()})
    known = StaticSolver(scene, "finite")
    u_x, closed, errors = known.loaded.u[0, 0], ~known.loaded.open, []
    interface, _ = condensed(known, u_x, closed, 0.0)
    for t in (2e-2, 1e-2):
        there = known.solve(u_x, scene.drive(t), free=~closed)
        errors.append(np.abs(interface.at(t, 0 * u_x)[0] + there.f).max())
    assert errors[0] < 2e-3 * np.abs(there.f + interface.load[0][:, 0]).max()
    assert errors[0] == pytest.approx(8 * errors[1], rel=0.1)


@pytest.mark.parametrize("lifted", [True, False])
def test_condensed_loads_beside_blocks_that_do_not_touch(lifted):
    """Two blocks are lifted off by a high pull, or never touch."""
    size = {"L": 0.03, "H": 0.015, "h": 0.015, "l": 0.0025, "F_N": 200.0, "side": "top"}
    scene = setup1(size, eta=0.0).replace({"interface": rated()})
    if not lifted:
        scene = scene.replace({"interface.contact": [True] * 4 + [False] * 2 + [True] * 7})
    known = StaticSolver(scene, "linear")
    t, s = 0.04 if lifted else 0.0, 1e-3
    at = known.solve(known.loaded.u[0, 0], scene.drive(t), free=~scene.touches)
    closed = ~at.open
    interface, _ = condensed(known, at.u[0, 0], closed, t)
    moved = 1e-7 * np.cos(np.arange(scene.N_x)) * closed
    load, p, force = interface.at(s, moved)
    there = known.solve(at.u[0, 0] + moved, scene.drive(t + s), free=~closed)
    assert 0 < there.open.sum() < 4
    assert np.array_equal(there.open, ~closed)
    above = np.where(closed, there.p, -scene.k_f * there.u[0, 1])
    for found, expected in ((load, -there.f), (p, above), (force, there.F_T)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * there.p.max())
    u_x, v_x = interface.moving(s, moved, moved / s)
    np.testing.assert_allclose(u_x, there.u[0, 0], rtol=0, atol=1e-9 * np.ptp(u_x))
    np.testing.assert_allclose(v_x, (u_x - at.u[0, 0]) / s, rtol=0, atol=1e-9 * np.ptp(v_x))


def test_slow_slip_ends_where_a_block_comes_down():
    """The driver moves back after two blocks have lifted off."""
    size = {"L": 0.03, "H": 0.015, "h": 0.015, "l": 0.0025, "F_N": 200.0, "side": "top"}
    scene = setup1(size).replace({"interface": rated(f_star=3.0)})
    t, V, dt = 0.04, scene.driver.V, 1e-7
    scene = scene.replace({"driver.protocol": [(t, V), (t, -V), (2 * t, -V)]})
    known = StaticSolver(scene, "linear")
    at = known.solve(known.loaded.u[0, 0], scene.drive(t))
    interface, _ = condensed(known, at.u[0, 0], ~at.open, t)
    assert at.open.sum() == 2
    model = core.model(scene, "linear", loaded_state(scene).state(scene, dt).u_drv0)
    limits = core.SlowLimits(end=t, dt=dt, relative=1e-6, u=1e-12, log_theta=1e-6)
    start = np.full(scene.N_x, np.log(1e6))
    found = core.slow_slip(model, *interface[:2], start, limits, closed=~at.open)
    assert not found.goes_on
    for s, above in ((found.t, True), (found.t + 2 * dt, False)):
        assert (interface.at(s, found.u)[1][at.open] < 0).all() == above


def test_blocks_that_lift_off_and_come_down_move_as_in_full_dynamics():
    """Blocks agree within the accuracy, over slip of other blocks; so does u_x of open blocks."""
    size = {"L": 0.02, "H": 0.01, "h": 0.01, "l": 0.0025, "F_N": 200.0, "side": "top"}
    law, V = rated(a=0.02), 0.01
    scene = setup1(size).replace({"driver.K": 1e6, "driver.V": V, "interface": law})
    scene = scene.replace({"driver.protocol": [(0.012, V), (0.012, -V), (0.03, -V)]})
    how = {"sample": 1e-4, "geometry": "linear", "progress": False}
    full = pyfric.simulate(scene, 0.024, fidelity="dynamic", **how)
    run = pyfric.simulate(scene, 0.024, fidelity="hybrid", accuracy=1e-3, **how)
    lifted = (full.motion["f"] == 0).any(axis=1) & (full.curve["t"] > 0)
    assert 50 < lifted.sum() < 80
    assert run.counts["steps_spared"] > 0.6 * full.counts["steps"]
    assert np.abs(run.curve["F_T"] - full.curve["F_T"]).max() < 1e-3 * scene.F_N
    np.testing.assert_allclose(run.motion["u_x"], full.motion["u_x"], rtol=0, atol=1e-8)


def creep(**how):
    """Return slow slip of three blocks, each on its own spring, from 2 to 10 um/s."""
    scene = row(3, evolution=how.pop("evolution", "ageing"), D_c=1e-6)
    load = 20.0 * float(coefficient(scene.law.kind, 2e-6, 0.5)) + np.array([0.0, -0.01, 0.01])
    how = {"load_1": 6.0, "spring": 6e5, "times": np.array([0.1, 0.2, 1.0]), "end": 1.0} | how
    return scene, load, slow(scene, np.log(0.5), load, **how)


def by_radau(rates, start, times, atol):
    """Return a solution of SciPy's Radau, a row for each time."""
    how = {"method": "Radau", "rtol": 1e-10, "atol": atol}
    return solve_ivp(rates, (0, times[-1]), start, t_eval=times, **how).y.T


def by_cvode(rates, start, times, atol):
    """Return a solution of CVODE of SUNDIALS, a row for each time."""
    cvode = peer("sksundae.cvode")

    def into(t, y, yp):
        yp[:] = rates(t, y)

    solver = cvode.CVODE(into, rtol=1e-12, atol=0.01 * atol, max_num_steps=10**5)
    return solver.solve(np.append(0.0, times), start).y[1:]


VISCOUS = 1e3 * np.array(
    [
        [[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -1.0]],
        [[0.0, 1.0, 0.0], [-1.0, 0.5, 0.0], [0.2, 0.0, -0.3]],
    ]
)
"""Load and normal force per velocity, N s/m: up to 10 % of the direct effect at 10 um/s."""


@pytest.mark.parametrize("viscous", [0 * VISCOUS, VISCOUS])
@pytest.mark.parametrize("other", [by_radau, pytest.param(by_cvode, marks=pytest.mark.peers)])
@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_slow_slip_is_that_of_another_method(evolution, other, viscous):
    """Slip agrees with SciPy's Radau and CVODE; the error follows the tolerance."""
    how = {"evolution": evolution, "viscous": tuple(viscous)}
    scene, load, found = creep(**how)
    law = scene.interface.law

    stress = (law.c or 0.0) / law.b

    def balanced(t, y):
        """Return speeds and ln(theta) from u and ln(theta) + (c/b) mu."""
        v = np.zeros(3)
        for _ in range(30 if viscous.any() else 1):
            pushed, p = load + 6.0 * t - 6e5 * y[:3] + viscous[0] @ v, 20.0 + viscous[1] @ v
            x = y[3:] - stress * pushed / p
            psi = np.log(law.V_star / law.D_c) + x
            speed = 2 * law.V_star * np.exp(-(law.f_star + law.b * psi) / law.a)
            v = speed * np.sinh(pushed / (p * law.a))
        return v, x

    def rates(t, y):
        v, x = balanced(t, y)
        return np.concatenate([v, RATES[evolution](v * np.exp(x) / law.D_c) * np.exp(-x)])

    start = np.append(np.zeros(3), np.full(3, np.log(0.5)))
    if stress:  # mu at which speeds balance the load for this theta

        def off(given):
            return balanced(0.0, np.append(np.zeros(3), given))[1] - np.log(0.5)

        start[3:] = scipy.optimize.root(off, start[3:] + stress * load / 20.0, tol=1e-14).x
    atol = np.repeat([1e-16, 1e-10], 3)
    times = np.array([0.1, 0.2, 1.0])
    exact = other(rates, start, times, atol)
    for t, y in zip(times, exact, strict=True):
        y[3:] = balanced(t, y.copy())[1]

    def error(run):
        return np.abs(run.points[:, :2].reshape(3, 6) / exact - 1).max()

    loose = creep(**how, relative=1e-5, u=1e-13, log_theta=1e-5)[2]
    assert exact[-1, 0] > 3 * law.D_c
    assert error(found) < 1e-9
    assert 1e-6 < error(loose) < 1e-4
    assert loose.steps < found.steps / 5


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_slow_slip_has_the_same_bits_with_each_variant_and_after_a_cut(evolution):
    """A cut phase goes on with its last step."""
    first = creep(evolution=evolution)[2]
    for variant in (name for name, runs in core.variants().items() if runs):
        other = creep(evolution=evolution, variant=variant)[2]
        assert all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))
    cut = creep(evolution=evolution, steps=5)[2]
    assert cut.goes_on
    assert cut.t < first.t
    assert 0 < cut.h != 1e-7


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_steps_do_not_hang_on_how_far_slip_is_from_steady(evolution):
    """Derivatives are exact: with a wrong one there are twenty times as many steps."""
    for theta in (0.5, 50.0, 5e3):  # |v| theta/D_c from 5e-4 to 5
        scene = row(3, evolution=evolution, D_c=1e-6)
        load = 20.0 * float(coefficient(scene.law.kind, 1e-9, theta))
        limits = {"relative": 1e-8, "log_theta": 1e-8, "u": 1e-16}
        found = slow(scene, np.log(theta), load, load_1=0.6, spring=6e5, end=1.0, **limits)
        assert found.t == 1.0
        assert found.steps < 80


def test_no_slow_step_hangs_on_the_time_asked_for():
    first = creep()[2]
    asked = creep(last=0.2, times=np.array([0.1, 0.2]))[2]
    assert asked.goes_on
    assert asked.t == 0.2
    assert asked.steps < first.steps
    np.testing.assert_array_equal(asked.points, first.points[:2])
    np.testing.assert_array_equal([asked.u, asked.log_theta, asked.v], first.points[1])


def test_slow_slip_ends_at_a_limit():
    """Limits are a speed, a load by inertia, and loss of contact; ends are on the grid of steps."""
    for name, value in (("speed", 8e-6), ("inertia", 2.5e-10)):
        found = creep(inertial=(-1e-6 * np.eye(3), np.zeros((3, 3))), **{name: value})[2]
        assert not found.goes_on
        assert 0 < found.t < 1
        assert round(found.t / 1e-7) * 1e-7 == pytest.approx(found.t, rel=1e-12)
        assert found.v.max() < 8e-6 + 1e-12
    assert not creep(closed=np.array([True, False, True]))[2].v[1]


THRESHOLD = 4e-6  # m/s


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_passages_of_slow_slip_are_roots(evolution):
    """At the times of passages a second run with the same steps has the threshold as speed."""
    how = {"evolution": evolution, "threshold": THRESHOLD, "steps": 1000}
    found = creep(**how)[2]
    times = found.passed_at[:, 0]
    assert (np.diff(times) >= 0).all()
    assert {int(i) for i, _ in found.passed} == {0, 1, 2}
    again = creep(times=times, **how)[2]
    rows = np.arange(len(times))
    u, _, v = again.points.swapaxes(0, 1)
    np.testing.assert_allclose(v[rows, found.passed[:, 0]], THRESHOLD, rtol=1e-12)
    np.testing.assert_array_equal(found.passed_at[:, 1], 20.0)
    np.testing.assert_allclose(found.passed_at[:, 2:], u, rtol=1e-12)
    assert len(found.sums) == found.steps
    assert found.sums[-1].tolist() == [1.0, pytest.approx(found.v.sum(), rel=1e-12)]
    for i, v_end in enumerate(found.v):
        new = found.passed[found.passed[:, 0] == i, 1]
        assert (np.diff([0, *new]) != 0).all()
        assert new[-1] == (v_end > THRESHOLD)
    known = np.ones(3, dtype=np.int32)
    assert creep(fast=known, **how)[2].passed[0, 1] == 0
    plain = creep(evolution=evolution)[2]
    assert not len(plain.passed)
    np.testing.assert_array_equal(plain.u, found.u)


def test_slow_slip_goes_on_beside_a_block_without_contact():
    """No load on the open block moves any block, with viscosity of bonds, too."""
    closed = np.array([True, False, True])
    viscous = tuple(VISCOUS * np.outer(closed, closed))
    found = [
        creep(closed=closed, viscous=viscous, load_1=np.array([6.0, load, 6.0]))[2]
        for load in (0.0, 1e3)
    ]
    assert all(np.array_equal(a, b) for a, b in zip(*found, strict=True))
    for one in found:
        assert one.goes_on
        assert one.t == 1.0
        assert one.v[1] == 0 < one.v[0]


def test_slow_slip_ends_where_passages_have_no_more_room():
    """Slip oscillates about steady slip on springs a little stiffer than p (b - a)/D_c."""
    scene, V = row(3, D_c=1e-6), 2e-6
    law = scene.interface.law
    spring = 1.05 * 20.0 * (law.b - law.a) / law.D_c
    load = 20.0 * (law.f_star + (law.a - law.b) * np.log(V / law.V_star))
    how = {"load_1": spring * V, "spring": spring, "end": 60.0, "threshold": V, "steps": 10**4}
    found = slow(scene, np.log(law.D_c / V) + 0.01, load, **how, relative=1e-6)
    assert found.goes_on
    assert 0 < found.t < 60.0
    assert 4 * 3 - 3 < len(found.passed) <= 4 * 3


def test_slow_slip_has_the_same_steps_in_other_units():
    """1 m and 1 s are 2^10 and 2^20 units. Rounding of ln theta differs."""
    found = []
    for m, s in ((1.0, 1.0), (2.0**10, 2.0**20)):
        scene = row(3, D_c=1e-6 * m, V_star=1e-6 * m / s, v_slip=1e-2 * m / s)
        load = 20.0 * float(coefficient(scene.law.kind, 2e-6 * m / s, 0.5 * s))
        how = {"load_1": 6.0 / s, "spring": 6e5 / m, "end": s, "dt": 1e-7 * s, "u": 1e-13 * m}
        how |= {"relative": 1e-5, "log_theta": 1e-7, "threshold": THRESHOLD * m / s, "steps": 1000}
        run = slow(scene, np.log(0.5 * s), load, **how)
        found.append((run.u / m, run.passed_at[:, 0] / s, run.sums[:, 0] / s))
    for known, other in zip(*found, strict=True):
        np.testing.assert_allclose(other, known, rtol=1e-6)


def block_of(columns, rows, a, blocks_in_L_b):
    """Return a slider with p = 10 N on each block, and its condensed stiffness in N/m."""
    k, p, l = 13.5e6, 10.0, 1e-3
    D_c = blocks_in_L_b * 3 * LAW["b"] * p / (4 * k)
    law = {"a": a, "D_c": D_c, "theta_0": 1.0, "v_0": None, "f_star": 0.6}
    size = {"L": (columns - 1) * l, "H": rows * l, "l": l, "k": k, "F_N": p * columns}
    scene = setup2(V=0.0, K=1.0, **size).replace({"interface": rated(**law)})
    known = StaticSolver(scene, "linear")
    return scene, Linearised(known, ~known.loaded.open).by_u[0]


def slide(scene, elastic, start, load, **limits):
    """Return slip without inertia under this load and its rate (N, N/s), at p = 10 N."""
    none = np.zeros(scene.N_x)
    return core.slow_slip(
        core.model(scene, "linear", loaded_state(scene).state(scene, 1e-7).u_drv0),
        (np.column_stack([none + load[0], none + load[1], none]), elastic),
        (np.column_stack([none + 10.0, none, none]), 0 * elastic),
        start,
        core.SlowLimits(**limits),
    )


@pytest.mark.parametrize("evolution", EVOLUTIONS)
def test_perturbations_of_steady_slip_grow_as_in_linear_theory(evolution):
    """Each mode of the lattice with stiffness K: (p a/V) s^2 + (K - k_c) s + K V/D_c = 0.

    Modes with K < k_c = p (b - a)/D_c grow: the long ones, up to three half waves. With Nagata's
    law k_c is smaller by the factor 1 + c.
    """
    V, p, a, b = 1e-6, 10.0, LAW["a"], LAW["b"]
    scene, elastic = block_of(41, 20, a, 2.0)
    own = {"evolution": evolution} | OWN.get(evolution, {})
    scene = scene.replace({f"interface.law.{name}": value for name, value in own.items()})
    D_c, grew = scene.interface.law.D_c, []
    stiffness, modes = np.linalg.eigh(-elastic)
    law, c = laws.EVOLUTIONS[evolution], scene.law.c
    critical = p * (b - a) / (D_c * (1 + c))
    steady = p * (LAW["f_star"] + (a - b) * np.log(V / 1e-6) + b * np.log(law.steady))
    for n in (1, 2, 3, 4, 5, 7, 10, 20):
        K, shape = stiffness[n], modes[:, n]
        # d/dt of u and ln theta beyond steady slip: v = -(V/(p a)) (K u + p b y)
        rate = np.array([[-K, -p * b], [K / D_c, p * b / D_c - p * a / D_c]]) * V / (p * a)
        rate[1] += c * K / (b * p) * rate[0]  # with a rate of stress, -(c/b) (-K v/p)
        t = 0.3 * D_c / V
        small = 1e-5
        limits = {"end": t, "dt": 1e-9, "relative": 1e-11, "u": 1e-11 * D_c * small}
        limits["log_theta"] = 1e-11 * small
        start = np.log(law.steady * D_c / V) + small * shape
        found = slide(scene, elastic, start, (steady, 0.0), **limits)
        expected = expm(rate * t) @ [0.0, small]
        u, y = shape @ (found.u - V * t), shape @ (found.log_theta - np.log(law.steady * D_c / V))
        np.testing.assert_allclose([u, y], expected, rtol=0.01)
        roots = np.linalg.eigvals(rate)
        grew.append(roots.real.max() > 0)
        assert grew[-1] == (K < critical)
    assert grew == sorted(grew, reverse=True)
    assert grew.count(True) == (1 if c else 3)


def test_nucleation_is_wider_the_closer_a_is_to_b():
    """Half-width of nucleation over L_b (ageing law), with 8 blocks in L_b.

    The half-width is 1.3774 for a/b < 0.378, and tends to 1/(pi (1 - a/b)^2) above a/b = 0.5 (Rubin
    and Ampuero, J. Geophys. Res. 110, B11312, 2005), as far as it can grow up to 0.1 m/s. The width
    holds the blocks with v above 5 % of its largest value.
    """
    halves = []
    for ratio in (0.2, 0.35, 0.7, 0.8):
        scene, elastic = block_of(121, 50, ratio * LAW["b"], 8.0)
        law, V = scene.interface.law, 1e-9
        start = np.log(law.D_c / V) + np.zeros(121)
        start[57:64] += np.log(0.9)
        load = 10.0 * (law.f_star + (law.a - law.b) * np.log(V / law.V_star)), 0.01
        limits = {"end": 1e4, "dt": 1e-9, "relative": 1e-6, "u": 1e-6 * law.D_c, "log_theta": 1e-6}
        found = slide(scene, elastic, start, load, speed=0.1, **limits)
        assert found.v.max() > 0.09
        halves.append(np.count_nonzero(found.v > 0.05 * found.v.max()) / 2 / 8)
    assert halves[0] == pytest.approx(1.3774, rel=0.25)
    assert halves[1] == pytest.approx(halves[0], abs=1 / 16)
    assert 1.2 * halves[1] < halves[2] < halves[3]
    assert halves[3] > 1.5 * halves[0]


@pytest.mark.portable
def test_nucleation_does_not_depend_on_the_spacing():
    """The width is the same with 3 and 6 blocks in L_b; the stored table agrees."""
    stored = pd.read_csv(STORED / "spacing.csv")
    assert len(stored) == len(rated_spacing.BLOCKS) * len(rated_spacing.RATIOS)
    rows = stored.set_index(["a_over_b", "blocks_in_L_b"])
    coarse, fine = (np.array(rated_spacing.case(n, 0.5)) for n in (3, 6))
    for n, found in ((3, coarse), (6, fine)):
        np.testing.assert_allclose(found, rows.loc[0.5, n], rtol=1e-3)
    time, slip, width = np.abs(coarse - fine)
    assert time < 1e-3 * fine[0]
    assert slip < 0.04 * fine[1]
    assert width < 1 / 3


def cycles(accuracy, evolution="ageing"):
    return _cycles(accuracy, evolution)


@functools.cache
def _cycles(accuracy, evolution):
    """Return a run of some stick-slip cycles; accuracy 0 means full dynamics."""
    law, t_end = {"D_c": 1e-6, "v_0": 2e-3, "evolution": evolution}, 9e-2
    if evolution == "nagata":  # a/(1 + c) and b/(1 + c) act
        law, t_end = law | {"a": 3 * LAW["a"], "b": 3 * LAW["b"]}, 6e-2
    scene = chain(L=0.02, V=2e-3, K=1e6, p=20.0, tau=0.0, interface=rated(**law))
    how = {"accuracy": accuracy, "fidelity": "hybrid"} if accuracy else {"fidelity": "dynamic"}
    return pyfric.simulate(scene, t_end, sample=1e-3, progress=False, **how)


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("slip", "prz")]


@pytest.mark.parametrize("evolution", ["ageing", "nagata", *SLOW])
def test_moving_the_hand_over_changes_events_within_the_accuracy(evolution):
    exact = cycles(0, evolution).events
    spared = []
    for accuracy in (1e-3, 1e-4, 1e-5):
        run = cycles(accuracy, evolution)
        assert len(run.events) == len(exact)
        spared.append(run.counts["steps_spared"])
        F_N = run.scene.F_N
        for name in ("F_T_start", "F_T_arrest"):
            off = np.abs(run.events[name] - exact[name]).dropna() / F_N  # the last event goes on
            assert (off < accuracy).all()
    assert spared[0] > spared[1] > spared[2] > 0


@pytest.mark.parametrize("threshold", [2e-5, 1e-4])
def test_events_by_slip_rate_are_those_of_full_dynamics(threshold):
    """Most passages lie within slow slip, where events begin and end."""
    scene, found = cycles(0).scene, []
    for how in ({"fidelity": "dynamic"}, {"fidelity": "hybrid", "accuracy": 1e-4}):
        how |= {"threshold": threshold, "sample": 1e-3, "progress": False}
        found.append(pyfric.simulate(scene, 6e-2, **how))
    full, run = found
    orders = [np.lexsort((one.crossings["t"], one.crossings["block"])) for one in found]
    for name in ("block", "old", "new", "corner"):  # two blocks may pass the threshold in one step
        one, other = (log.crossings[name][n] for log, n in zip(found, orders, strict=True))
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(run.bursts["kind"], full.bursts["kind"])
    dt = run.method.dt
    steps = np.abs(run.crossings["step"] - np.ceil(run.crossings["t"] / dt))
    assert steps.max() <= 1
    np.testing.assert_allclose(run.crossings["t"], full.crossings["t"], rtol=0, atol=5 * dt)
    np.testing.assert_allclose(run.bursts["u_x"], full.bursts["u_x"], rtol=0, atol=1e-9)
    for name in ("potency", "potency_rate"):
        np.testing.assert_allclose(run.events[name], full.events[name], rtol=0.01)
    off = (run.events["F_T_start"] - full.events["F_T_start"]).abs() / scene.F_N
    assert off.max() < 1e-4


def plate(geometry, V=4e-3, t_end=0.12, **how):
    """Return a run of a slider of 13 x 7 blocks: slow events, then fast ones."""
    size = {"L": 0.06, "H": 0.03, "l": 5e-3, "h": 5e-3, "F_N": 1500.0}
    scene = pyfric.preset("rate_and_state", {**size, "D_c": 1e-6, "V": V})
    how = {"geometry": geometry, "progress": False, "sample": 1.2e-4} | how
    return pyfric.simulate(scene, t_end, **how)


def off(run, exact):
    """Return the largest error of forces at start and arrest of events, over F_N."""
    assert run.events["n_blocks"].to_list() == exact.events["n_blocks"].to_list()
    names = ["F_T_start", "F_T_arrest"]
    return (run.events[names] - exact.events[names]).abs().max().max() / run.scene.F_N


@pytest.mark.parametrize("geometry", ["linear", pytest.param("finite", marks=pytest.mark.slow)])
def test_events_of_a_slider_keep_the_accuracy(geometry):
    """Accuracies down to 1e-6 hold, at most at the cost of full dynamics."""
    exact = plate(geometry, fidelity="dynamic", energies=False)
    assert len(exact.events) == 6
    for accuracy in (1e-3, 1e-4, 1e-6):
        run = plate(geometry, fidelity="hybrid", accuracy=accuracy)
        assert off(run, exact) < accuracy
        assert work_so_far(run) <= work_so_far(exact)
        if geometry == "linear" or accuracy >= 1e-4:
            assert run.counts["steps_spared"] > 0.2 * exact.counts["steps"]


def test_phases_are_shorter_where_slip_bends_loads(monkeypatch):
    """With long phases errors of events in finite geometry exceed the accuracy."""
    exact = plate("finite", t_end=0.06, fidelity="dynamic", energies=False)
    how = {"t_end": 0.06, "fidelity": "hybrid", "accuracy": 1e-4}
    assert off(plate("finite", **how), exact) < 1e-4
    monkeypatch.setattr(SlowSlip, "bent", lambda *_: False)
    monkeypatch.setattr(SlowSlip, "straight", lambda *_: 10**9)
    wrong = plate("finite", **how).events["F_T_start"] - exact.events["F_T_start"]
    assert np.abs(wrong).max() > 1e-4 * exact.scene.F_N


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_a_driver_faster_than_slip_keeps_the_accuracy(geometry):
    """The driver has ten times `v_slip`: waves of its start last until the first event."""
    how = {"V": 1e-2, "t_end": 0.05}
    exact = plate(geometry, fidelity="dynamic", energies=False, **how)
    for accuracy in (1e-3, 1e-5):
        run = plate(geometry, fidelity="hybrid", accuracy=accuracy, **how)
        assert off(run, exact) < min(accuracy, 1e-4)
        assert run.counts["steps_spared"] > 0 or (geometry, accuracy) == ("finite", 1e-5)


def test_a_slider_has_no_waves_after_slow_slip():
    """The state handed over to full dynamics is static, with terms of viscosity and inertia."""
    run = plate("linear", t_end=0.02, fidelity="hybrid", accuracy=1e-5)
    state, scene = run.final_state, run.scene
    known, N_x = StaticSolver(scene, "linear"), scene.N_x
    assert state.since > 0
    at = known.coordinates(state.y[:, :2], state.rod[:3])
    v = known.coordinates(state.y[:, 2:], state.rod[3:])
    p = core.evaluate(core.model(scene, "linear", state.u_drv0), state, state.t).p
    about = Linearised(known, np.full(N_x, True))
    found = about.waves(at, v, Outside(known, state.t), p, scene.law)
    state.y[1:, 2:], state.rod[3:] = 0.0, 0.0  # a driver that has just begun to move
    v = known.coordinates(state.y[:, 2:], state.rod[3:])
    other = about.waves(at, v, Outside(known, state.t), p, scene.law)
    assert found.amplitude.sum() < 1e-3 * other.amplitude.sum()
    assert found.largest < 1e-6 * scene.F_N < other.largest


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_a_cut_run_of_a_slider_is_the_whole_run(geometry):
    """Cuts are in ring-down, in slow slip, and between two of its phases in finite geometry."""
    whole, record = plate(geometry, t_end=0.09, fidelity="hybrid", accuracy=1e-5), None
    for t in (0.02, 0.0371, 0.064, 0.0802):
        if record is None:
            record = plate(geometry, t_end=t, fidelity="hybrid", accuracy=1e-5)
        else:
            record = pyfric.simulate(whole.scene, t, initial=record, progress=False)
    rest = pyfric.simulate(whole.scene, 0.09, initial=record, progress=False)
    assert bits(rest.final_state) == bits(whole.final_state)
    assert rest.events.equals(whole.events)
    assert rest.curve.equals(whole.curve)


def test_a_run_that_goes_on_is_the_whole_run():
    """The first run ends in a rupture or between two ruptures."""
    whole = cycles(0)
    part = pyfric.simulate(whole.scene, 2e-2, sample=1e-3, fidelity="dynamic", progress=False)
    for t in (5.4e-2, 9e-2):
        part = pyfric.simulate(whole.scene, t, initial=part, progress=False)
    assert bits(part.final_state) == bits(whole.final_state)
    assert part.events.equals(whole.events)


@pytest.mark.parametrize("condition", ["main_events = 1", "arrested", "slow = 1 mm/s, 0.4 ms"])
def test_a_condition_ends_slow_slip_where_it_ends_full_dynamics(condition):
    """Both runs end at the same point of the curve, before the next event."""
    scene, found = cycles(0).scene, []
    for fidelity in ("dynamic", "hybrid"):
        how = {"accuracy": 1e-4} if fidelity == "hybrid" else {}
        how |= {"sample": 1e-3, "progress": False, "stop_when": condition}
        found.append(pyfric.simulate(scene, 9e-2, fidelity=fidelity, **how))
    assert found[0].status == found[1].status
    assert condition in found[0].status
    assert found[0].curve["t"].iloc[-1] == found[1].curve["t"].iloc[-1] < 9e-2
    assert found[1].counts["steps_spared"] > 0


def patch(V, **how):
    """Return a run of a weakening patch between strengthening ends."""
    a = [0.025] * 8 + [0.005] * 15 + [0.025] * 8
    law = rated(D_c=1e-7, v_0=V, a=a, v_slip=0.02)
    scene = chain(L=0.075, V=V, K=2e6, k=2e7, p=20.0, tau=0.0, interface=law)
    how = {"sample": 1e-7 / V, "progress": False} | how
    return pyfric.simulate(scene, 2.5e-4 / V, **how)


def faster_than_the_driver(record):
    """Return the largest speeds of blocks of the patch and of an end, over the driver's speed."""
    fastest = np.abs(record.motion["v_x"]).max(axis=0) / record.scene.driver.V
    return fastest[10:20].max(), fastest[-5:].max()


@pytest.mark.parametrize(
    ("accuracy", "share"), [(1e-3, 0.7), pytest.param(1e-5, 0.9, marks=pytest.mark.slow)]
)
def test_a_weakening_patch_between_strengthening_ends(accuracy, share):
    """Slip events of the patch are those of full dynamics."""
    full = patch(4e-3, fidelity="dynamic", energies=False)
    run = patch(4e-3, fidelity="hybrid", accuracy=accuracy)
    assert np.abs(run.curve["F_T"] - full.curve["F_T"]).max() < 1e-5 * full.scene.F_N
    assert run.counts["steps"] < share * full.counts["steps"]
    of_patch, of_end = faster_than_the_driver(full)
    assert of_patch > 2.5 > 2.0 > of_end


@pytest.mark.slow
def test_a_weakening_patch_at_a_hundredth_of_the_speed():
    slow = patch(4e-5, fidelity="hybrid", accuracy=1e-5, sample=2.5e-4)
    of_patch, of_end = faster_than_the_driver(slow)
    assert of_patch > 20.0 > 2.0 > of_end


@pytest.mark.parametrize("threshold", [None, 1e-4])
def test_a_run_that_was_cut_is_the_whole_run(threshold, tmp_path):
    """Cuts are twice in a phase of slow slip and twice in a rupture; runs go on from a file."""
    how = {"fidelity": "hybrid", "accuracy": 1e-4, "sample": 1e-3, "progress": False}
    how["threshold"] = threshold
    whole = pyfric.simulate(cycles(1e-4).scene, 9e-2, **how)
    start, arrest = cycles(1e-4).events[["t_start", "t_stop"]].iloc[1]
    record, slow = None, []
    for t in (1.2345e-2, 3e-2, start + 1e-4, 0.5 * (start + arrest)):
        again = how if record is None else {"initial": record, "progress": False}
        record = pyfric.simulate(whole.scene, t, **again)
        slow.append(record.final_state.since > 0)
        record = pyfric.load(record.save(tmp_path / f"{len(slow)}.nc"))
    rest = pyfric.simulate(whole.scene, 9e-2, initial=record, progress=False)
    assert bits(rest.final_state) == bits(whole.final_state)
    assert rest.curve.equals(whole.curve)
    assert rest.events.equals(whole.events)
    for log in ("motion", "crossings", "bursts"):
        found, known = getattr(rest, log), getattr(whole, log)
        assert found.keys() == known.keys()
        assert all(np.array_equal(found[name], known[name]) for name in known)
    assert rest.counts["steps_spared"] == whole.counts["steps_spared"]
    assert slow == [True, True, False, False]


def test_a_slow_phase_belongs_to_its_scene_and_step():
    """A state without its slow phase goes on as it is."""
    how = {"fidelity": "hybrid", "accuracy": 1e-4, "sample": 1e-3, "progress": False}
    scene = cycles(1e-4).scene
    state = pyfric.simulate(scene, 3e-2, **how).final_state
    assert state.since > 0 < np.abs(state.phase).max()
    for other in (state.under(scene), state.with_dt(0.5 * state.dt)):
        assert other.since == 0 == np.abs(other.phase).max()
    rest = pyfric.simulate(scene, 9e-2, initial=state, **how)
    whole = cycles(1e-4)
    assert rest.curve["t"].iloc[0] == state.t
    for name in ("F_T_start", "F_T_arrest"):
        off = np.abs(rest.events[name] - whole.events[name]).dropna() / scene.F_N
        assert (off < 1e-6).all()


def pulled(K=1e5 / 3, V=1e-6):
    """Return three equal blocks, each on a spring K (N/m) from a plate at V (m/s)."""
    law = rated(D_c=1e-6, v_0=None, theta_0=0.5)
    size = {"L": 5e-3, "l": 2.5e-3, "k": 1e7, "M": 2.7e-3, "K": 3 * K, "top.p": 20.0}
    return pyfric.preset("burridge_knopoff", {**size, "V": V, "interface": law})


def stick_slip(scene, push):
    """Return the equations of one such block, for u, v and ln theta, and their Jacobian."""
    law, p, K, V = scene.interface.law, 20.0, scene.driver.K / 3, scene.driver.V

    def strength(x):
        psi = x + np.log(law.V_star / law.D_c)
        return np.exp((law.f_star + law.b * psi) / law.a) / (2 * law.V_star)

    def rates(t, y):
        u, v, x = y
        friction = p * law.a * np.arcsinh(v * strength(x))
        return [v, (push + K * (V * t - u) - friction) / scene.m, np.exp(-x) - abs(v) / law.D_c]

    def slopes(t, y):
        _, v, x = y
        one = p * law.a * strength(x) / np.hypot(1, v * strength(x)) / scene.m
        evolves = [0, -np.sign(v) / law.D_c, -np.exp(-x)]
        return [[0, 1, 0], [-K / scene.m, -one, -one * v * law.b / law.a], evolves]

    return rates, slopes


def test_stick_slip_of_a_block_is_that_of_an_own_integration():
    """Start, arrest and force of two events, 80 s apart, agree with SciPy's Radau to 1e-6.

    F_T of events is taken at the end of a step, in which it changes by at most K v_slip dt.
    """
    scene, t_end, dt = pulled(), 100.0, 4e-7
    law, K, V = scene.interface.law, scene.driver.K / 3, scene.driver.V
    push = law.f_star * 20.0
    rates, slopes = stick_slip(scene, push)

    def passes(t, y):
        return abs(y[1]) - law.v_slip

    how = {"method": "Radau", "rtol": 1e-8, "atol": [1e-17, 1e-17, 1e-9], "events": passes}
    own = solve_ivp(rates, (0, t_end), [0.0, V, np.log(0.5)], jac=slopes, **how)
    t, u = own.t_events[0], own.y_events[0][:, 0]
    force = 3 * (push + K * (V * t - u))
    state = loaded_state(scene).state(scene, dt)
    state.y[0, 2], state.u_drv0 = V, state.u_drv0 * 0 + push / K
    how = {"fidelity": "hybrid", "accuracy": 1e-7, "dt": dt, "sample": 1.0, "progress": False}
    found = pyfric.simulate(scene, t_end, initial=state, **how).events
    assert len(found) == 2
    times = found[["t_start", "t_stop"]].to_numpy().ravel()
    forces = found[["F_T_start", "F_T_arrest"]].to_numpy().ravel()
    np.testing.assert_allclose(times, t, rtol=0, atol=1e-6 * t[2])
    np.testing.assert_allclose(forces, force, rtol=0, atol=1e-6 * scene.F_N)
    drops, own_drops = forces[::2] - forces[1::2], force[::2] - force[1::2]
    assert (own_drops > 0.05 * scene.F_N).all()
    np.testing.assert_allclose(drops, own_drops, rtol=1e-5)


@pytest.mark.peers
def test_cvode_finds_the_same_stick_slip():
    """At Radau's start and arrest of the first event, CVODE finds the same motion."""
    scene = pulled()
    law = scene.interface.law
    rates, slopes = stick_slip(scene, law.f_star * 20.0)

    def passes(t, y):
        return abs(y[1]) - law.v_slip

    start, atol = [0.0, scene.driver.V, np.log(0.5)], np.array([1e-17, 1e-17, 1e-9])
    how = {"method": "Radau", "rtol": 1e-9, "atol": atol, "events": passes}
    own = solve_ivp(rates, (0, 1.0), start, jac=slopes, **how)
    other = by_cvode(rates, np.array(start), own.t_events[0], atol)
    assert len(other) == 2
    np.testing.assert_allclose(other, own.y_events[0], rtol=1e-4)
    np.testing.assert_allclose(other[:, 0], own.y_events[0][:, 0], rtol=1e-6)


def test_a_run_has_no_note_of_junctions():
    assert not any("junction" in note for run in (cycles(0), cycles(1e-3)) for note in run.notes)


def test_plans_measure_their_errors():
    scene = cycles(0).scene
    run = pyfric.simulate(scene, 6e-2, tolerance=0.01, sample=1e-3, progress=False)
    assert run.method.engine == "hybrid"
    assert run.errors.holds is True
    exact = cycles(0).events["F_T_start"].iloc[0]
    assert abs(run.events["F_T_start"].iloc[0] - exact) < 1e-3 * scene.F_N
    assert "leaves out inertia between ruptures" in str(pyfric.plan(scene, t_end=6e-2))


def test_sweeps_know_the_law(tmp_path):
    """A larger direct effect raises the force before slip."""
    over, how = {"interface.law.a": [0.008, 0.01]}, {"fidelity": "hybrid", "accuracy": 1e-4}
    sweep = pyfric.Sweep(scene=cycles(1e-4).scene, over=over, t_end=6e-2, options=how)
    found = sweep.run(tmp_path / "sweep", workers=1).table
    assert (found["status"] == "complete").all()
    assert found["t_slide"].iloc[0] < 6e-2
