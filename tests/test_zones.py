"""Blocks in the cohesive zone of fronts: against the theory in Pa, and in records."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_analysis import MU_K, MU_S, made_up

import pyfric
from pyfric import theory
from pyfric.record import analysis, zone_at_rest, zone_moving, zone_notes
from pyfric.record.rupture import front_speed, shares
from pyfric.scene import chain, preset, slab

B = 6e-3  # of the paper's slider


def weak(record, d_c):
    scene = record.scene
    interface = dataclasses.replace(scene.interface, d_c=d_c)
    return dataclasses.replace(record, scene=dataclasses.replace(scene, interface=interface))


def test_the_zone_of_the_paper_s_slider():
    """About 2.55 mm for each um of d_c, and the theory's in Pa at any speed below c_R."""
    scene = preset("fig1", d_c=1e-6)
    slider, p = scene.slider, np.array([0.0, np.nan, 30.0, 61.4])
    material = theory.Material.of_lattice(slider.k, scene.m, slider.l, B)
    assert material.E_prime == pytest.approx(3e9)
    even = scene.F_N / (slider.L * B) * (slider.l * B)  # over L B, as a continuum has it
    assert zone_at_rest(scene, even) * slider.l == pytest.approx(2.55e-3, rel=0.01)
    for share in (0.0, 0.5, 0.99):
        v = share * material.c_R
        known = theory.cohesive_zone(material, 0.7, 0.45, p[2:] / (slider.l * B), 1e-6, v)
        for way in (v, -v):
            np.testing.assert_allclose(zone_moving(scene, p, way)[2:] * slider.l, known, rtol=1e-12)
    assert np.isnan(zone_at_rest(scene, p)[:2]).all()
    assert np.isnan(zone_moving(scene, p, material.c_R)).all()
    assert np.isnan(zone_moving(scene, p, np.nan)).all()
    np.testing.assert_array_equal(zone_at_rest(preset("fig1"), p[2:]), 0.0)
    assert np.isnan(zone_at_rest(preset("fig1", mu_k=0.7), p)).all()


@pytest.mark.parametrize("v", [0.0, 0.6])
def test_the_zone_of_a_chain(v):
    """k l^2 (1 - v^2/c^2) u'' = tau_s - tau_0 - f u/d_c from rest at the tip, tau_0 = tau_k."""
    scene = chain(L=0.1, d_c=1e-5)
    f, d_c, k, c = (
        0.25 * 10.0,
        1e-5,
        scene.slider.k,
        scene.slider.l * np.sqrt(scene.slider.k / scene.m),
    )

    def end(_, y):
        return y[0] - d_c

    end.terminal = True
    found = solve_ivp(
        lambda _, y: [y[1], (f - f * y[0] / d_c) / (k * (1 - v**2))],
        (0, 1e3), [0.0, 0.0], events=end, rtol=1e-10, atol=1e-20, max_step=0.5,
    )  # fmt: skip
    assert zone_moving(scene, np.array([10.0]), v * c) == pytest.approx(found.t[-1], rel=1e-4)


@pytest.mark.parametrize("side", ["left", "right"])
def test_every_record_says_how_well_its_fronts_are_resolved(side, tmp_path):
    record = made_up(side, speed=150.0)
    table = analysis.front(record, 0)
    assert (table["X_c0_over_l"].dropna() == 0).all()
    unit = 0.75 * np.pi * record.scene.slider.k / 2 / (MU_S - MU_K)
    p = record.p_before[0][np.argsort(record.scene.n_of_i)][:5]
    d_c = 6.3 / unit * p[3]  # 6.3 blocks at block 4, fewer than six at the next
    record = weak(record, d_c)
    table = analysis.front(record, 0)
    expected = np.divide(unit * d_c, p, out=np.full(5, np.nan), where=p > 0)
    np.testing.assert_allclose(table["X_c0_over_l"], expected)
    assert table["X_c_over_l"].notna().sum() == 0  # its only speed is at block 3, which is open
    table = analysis.front(record, 3)
    slower = table["X_c_over_l"] / table["X_c0_over_l"]
    assert slower.dropna().between(0.5, 0.99).all()
    assert slower.notna().sum() == 3
    at_rest, moving = shares(record.scene, record.rupture_times, record.p_before)
    assert at_rest[0] == 3 / 4  # blocks 1, 2, 4 of 1, 2, 4, 5
    assert at_rest[3] == 3 / 7
    assert moving[3] == np.mean(table["X_c_over_l"].dropna() >= 6)
    dataset = record.to_xarray()
    for name in ("X_c0_over_l", "X_c_over_l"):
        values = dataset[name].to_numpy()[3][np.argsort(record.scene.n_of_i)][:8]
        np.testing.assert_array_equal(values, table[name])


def test_one_sentence_where_fronts_are_not_resolved():
    v = front_speed(made_up().rupture_times, 2.5e-3)
    assert np.isfinite(v).any()
    scene = preset("fig1", d_c=1e-6)
    assert zone_notes(scene, "dynamic", np.array([6.0, np.nan, 9.0])) == ()
    assert zone_notes(scene, "dynamic", np.array([])) == ()
    (note,) = zone_notes(scene, "dynamic", np.array([5.0, 6.0, np.nan, 9.0, 12.0]))
    assert "set by the lattice: 75 %" in note
    assert "X_c0/l = 5 to 12" in note
    record = pyfric.simulate("fig1", 0.3, fidelity="hybrid", geometry="linear", progress=False)
    main = record.events["is_main"]
    assert main.any()
    (note,) = (note for note in record.notes if "set by the lattice: 0 %" in note)
    assert note.startswith("hybrid: ")
    assert "d_c = 0" in note
    assert (record.events.loc[main, "share_X_c0"] == 0).all()


def test_prescribed_loads_are_known_without_a_static_state():
    p = np.array([10.0, 20.0, 40.0, 80.0])
    scene = slab(p=p.tolist(), L=0.0075, H=0.005, l=2.5e-3, side="right", d_c=1e-6)
    known = 0.75 * np.pi / 2 * scene.slider.k * 1e-6 / (0.25 * p[::-1])
    np.testing.assert_allclose(zone_at_rest(scene, p[::-1]), known)
    np.testing.assert_allclose(zone_at_rest(scene, np.full(4, np.nan)), known)


def test_the_plan_of_front_speeds_names_the_lattice_and_its_price():
    """X_c0/l is 1.04 at l = 2.5 mm, d_c = 1 um: 5 % takes 6 blocks, 2.5 % twice as many."""
    scene = preset("fig1", d_c=1e-6, L=0.07, H=0.0375)
    blocks = float(zone_at_rest(scene, scene.F_N / scene.N_x))
    for tolerance, need in ((0.05, 6), (0.025, 12)):
        chosen = pyfric.plan(scene, "front_speed", tolerance, t_end=0.1)
        n = int(np.ceil(need / blocks))
        assert f"need {need}: l = {2.5 / n:.3g} mm, {n} times smaller" in chosen.lattice
        assert f"about {chosen.seconds * n**3:.2g} s" in chosen.lattice
        assert chosen.lattice in str(chosen)
    without = pyfric.plan(preset("fig1", L=0.07, H=0.0375), "front_speed", 0.05, t_end=0.1)
    assert "no l resolves" in without.lattice
    enough = pyfric.plan(preset("fig1", d_c=2e-5, L=0.07, H=0.0375), "front_speed", 0.05, t_end=0.1)
    assert enough.lattice == ""
    assert pyfric.plan(scene, "stress", 0.05, t_end=0.1).lattice == ""
