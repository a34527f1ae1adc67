"""Blocks in the cohesive zone of fronts: compared with theory in Pa, and in records."""

import math
from collections import UserDict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from test_analysis import MU_K, MU_S, made_up

import pyfric
from pyfric import theory
from pyfric.record import analysis, front_speed, viscous_error, zone_notes, zone_of_scene
from pyfric.record.catalogue import share_X_c, share_X_c0
from pyfric.record.zones import can_rupture, zone_at_rest, zone_moving
from pyfric.scene import chain, preset, slab

CRACKS = Path(__file__).parents[1] / "reference_data" / "fronts" / "viscosity.csv"

B = 6e-3  # of the paper's slider


def test_the_zone_of_the_paper_s_slider():
    """The zone is 2.55 mm for each um of d_c, and agrees with theory at any speed below c_R."""
    scene = preset("fig1", d_c=1e-6)
    slider, p = scene.slider, np.array([0.0, np.nan, 30.0, 61.4])
    material = theory.Material.of_lattice(slider.k, scene.m, slider.l, B)
    assert material.E_prime == pytest.approx(3e9)
    even = scene.F_N / (slider.L * B) * (slider.l * B)  # over L B, as in a continuum
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
    for other in ("slow", "rate_and_state"):  # friction does not fall to mu_k p
        assert np.isnan(zone_at_rest(preset(other), p)).all()
        assert np.isnan(preset(other).law.fracture_energy(p)).all()


@pytest.mark.parametrize("v", [0.0, 0.6])
def test_the_zone_of_a_chain(v):
    """The oracle is k l^2 (1 - v^2/c^2) u'' = tau_s - tau_0 - f u/d_c, tau_0 = tau_k."""
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
    table = analysis.front(record, 1)
    assert (table["X_c0_over_l"].dropna() == 0).all()
    unit = 0.75 * np.pi * record.scene.slider.k / 2 / (MU_S - MU_K)
    p = record.p_before[0][np.argsort(record.scene.n_of_i)][:5]
    d_c = 6.3 / unit * p[3]  # 6.3 blocks at block 4, fewer than six at the next
    record = made_up(side, speed=150.0, d_c=d_c)
    table = analysis.front(record, 1)
    expected = np.divide(unit * d_c, p, out=np.full(5, np.nan), where=p > 0)
    np.testing.assert_allclose(table["X_c0_over_l"], expected)
    assert table["X_c_over_l"].notna().sum() == 0  # its only speed is at block 3, which is open
    table = analysis.front(record, 4)
    slower = table["X_c_over_l"] / table["X_c0_over_l"]
    assert slower.dropna().between(0.5, 0.99).all()
    assert slower.notna().sum() == 3
    known = UserDict(record.arrays)
    known.front_speed = front_speed(record.rupture_times, record.scene.slider.l, record.scene.d)
    at_rest, moving = share_X_c0(known), share_X_c(known)
    assert at_rest[0] == 3 / 4  # blocks 1, 2, 4 of 1, 2, 4, 5
    assert at_rest[3] == 3 / 7
    assert moving[3] == np.mean(table["X_c_over_l"].dropna() >= 6)
    assert np.isnan(moving[1])
    dataset = record.to_xarray()
    for name in ("X_c0_over_l", "X_c_over_l"):
        values = dataset[name].to_numpy()[3][np.argsort(record.scene.n_of_i)][:8]
        np.testing.assert_array_equal(values, table[name])


# --- notes ---------------------------------------------------------------------------------------


def noted(scene, at_rest, moving, speed=1.0):
    """Return the notes of one main event whose blocks have these zones; NaN means no speed."""
    times = np.arange(len(at_rest)) * scene.slider.l / speed
    known = {
        "rupture_times": times,
        "X_c0_over_l": at_rest,
        "X_c_over_l": moving,
        "p_before": times,
    }
    rows = {name: np.full((1, scene.N_x), np.nan) for name in known}
    for name, values in known.items():
        rows[name][0, : len(values)] = values

    class Known(dict):
        front_speed = front_speed(rows["rupture_times"], scene.slider.l, scene.d)

    return zone_notes(scene, "dynamic", Known(rows | {"is_main": np.array([True])}))


def test_one_note_says_what_sets_front_speeds():
    calm = preset("fig1", d_c=1e-6).replace(dashpots="along")
    calm = calm.replace(eta=0.01 * math.sqrt(calm.slider.k * calm.m))
    n = 9
    assert noted(calm, [20.0] * n, [12.0] * n) == ()
    (note,) = noted(calm, [5.0] * 4 + [20.0] * 5, [4.0] * 4 + [12.0] * 5)
    assert "40 % of blocks have X_c0/l below 6 (5 to 20)" in note  # of the five with a speed
    assert "40 % of blocks have X_c(v)/l below 6 (4 to 12)" in note
    assert "viscosity" not in note
    (note,) = noted(calm, [20.0] * n, [3.0] * n)
    assert "X_c0/l" not in note
    assert "100 % of blocks have X_c(v)/l below 6" in note
    (note,) = noted(preset("fig1", d_c=2e-5), [10.0] * n, [8.0] * n)
    assert note.endswith("of a continuum may differ: viscosity slows fronts by about 6 %")
    assert noted(preset("fig1", d_c=2e-5), [20.0] * n, [8.0] * n) == ()  # 4 %


def test_amontons_coulomb_takes_a_short_note():
    record = pyfric.simulate("fig1", 0.3, fidelity="hybrid", geometry="linear", progress=False)
    main = record.events["is_main"]
    assert main.any()
    assert any("d_c = 0: front speeds are set by the lattice" in one for one in record.notes)
    assert (record.events.loc[main, "share_X_c0"] == 0).all()


@pytest.mark.parametrize(("d_c", "said"), [(0.0, "set by the lattice"), (2e-6, "X_c(v)/l below 6")])
def test_pushed_fronts_have_a_note(d_c, said):
    """Static states of pushed fronts are unknown; the mean normal force replaces p."""
    scene = pyfric.setup2(L=0.06, H=0.02, l=0.002, F_N=200.0, V=0.0, d_c=d_c, push=((1, 80.0),))
    record = pyfric.simulate(scene, 2e-4, fidelity="dynamic", progress=False)
    assert np.isnan(record.p_before).all()
    assert any(said in note for note in record.notes)


def test_viscosity_slows_fronts_as_in_the_cracks_of_the_study():
    """The slowing agrees within a sixth, with the error of the lattice at low viscosity."""
    cracks = pd.read_csv(CRACKS)
    assert len(cracks) >= 16
    assert set(cracks["dashpots"]) == {"full", "along"}
    for row in cracks.itertuples():
        scene = preset("fig1").replace(dashpots=row.dashpots)
        scene = scene.replace(eta=math.sqrt(row.eta2 * scene.slider.k * scene.m))
        assert viscous_error(scene, row.blocks) == pytest.approx(-row.mean, rel=1 / 6)
    assert np.isnan(viscous_error(chain(L=0.1), 6.0))


# --- scenes --------------------------------------------------------------------------------------


def test_barriers_do_not_count():
    """Blocks beyond the fault of TPV3 have ten times p and a tenth of the zone."""
    scene = preset("tpv3")
    inside = can_rupture(scene)
    x = (np.arange(scene.N_x) + 0.5) * scene.slider.l
    np.testing.assert_array_equal(inside, x < 15e3)
    every = zone_at_rest(scene, np.full(scene.N_x, np.nan))
    assert every.min() == pytest.approx(zone_of_scene(scene) / 10)
    material = theory.Material.of_lattice(scene.slider.k, scene.m, scene.slider.l, 1.0)
    known = theory.cohesive_zone(material, 0.677, 0.525, 120e6, 0.2)
    assert zone_of_scene(scene) * scene.slider.l == pytest.approx(known)
    assert can_rupture(preset("fig1")).all()


def test_prescribed_loads_are_known_without_a_static_state():
    p = np.array([10.0, 20.0, 40.0, 80.0])
    scene = slab(p=p.tolist(), L=0.0075, H=0.005, l=2.5e-3, side="right", d_c=1e-6)
    known = 0.75 * np.pi / 2 * scene.slider.k * 1e-6 / (0.25 * p[::-1])
    np.testing.assert_allclose(zone_at_rest(scene, p[::-1]), known)
    np.testing.assert_allclose(zone_at_rest(scene, np.full(4, np.nan)), known)


def test_the_plan_of_front_speeds_names_the_lattice_and_its_price():
    """X_c0/l is 1.04 at l = 2.5 mm, d_c = 1 um. An error of 5 % needs 6 blocks, 2.5 % needs 12.

    With the paper's viscosity cracks are 7.6 % slower at 6 blocks. The slowing falls with the root
    of the number of blocks.
    """
    paper = preset("fig1", d_c=1e-6, L=0.07, H=0.0375)
    little = preset("fig1", d_c=1e-6, L=0.07, H=0.0375, damping=1e-5)
    blocks = float(zone_at_rest(paper, paper.F_N / paper.N_x))
    viscous = 6 * (0.136 * 0.1**0.25) ** 2
    needs = [(little, 0.05, 6), (little, 0.025, 12)]
    needs += [(paper, by, viscous / by**2) for by in (0.05, 0.025)]
    for scene, tolerance, need in needs:
        chosen = pyfric.plan(scene, "front_speed", tolerance, t_end=0.05)
        n = int(np.ceil(need / blocks))
        assert f"need {need:.2g}" in chosen.lattice
        assert f"l = {2.5 / n:.3g} mm, {n} times smaller" in chosen.lattice
        seconds = chosen.seconds[chosen.levels.index(chosen.alone)]
        assert f"about {seconds * n**3:.2g} s" in chosen.lattice
        assert f"({zone_of_scene(scene, 0.8):.2g} at 0.8 of the limiting speed)" in chosen.lattice
        assert ("with little viscosity" in chosen.lattice) == (scene is paper)
        assert chosen.lattice in str(chosen)
    material = theory.Material.of_lattice(paper.slider.k, paper.m, paper.slider.l, 1.0)
    shorter = theory.A_II(material, 0.8 * material.c_R)
    assert zone_of_scene(paper, 0.8) == pytest.approx(zone_of_scene(paper) / shorter)
    assert shorter > 1.4
    without = pyfric.plan(preset("fig1", L=0.07, H=0.0375), "front_speed", 0.05, t_end=0.05)
    assert "no l resolves" in without.lattice
    for d_c, damping, enough in ((2e-5, 1e-5, True), (2e-5, None, False), (3e-5, None, True)):
        scene = preset("fig1", d_c=d_c, L=0.07, H=0.0375, damping=damping)
        assert (not pyfric.plan(scene, "front_speed", 0.05, t_end=0.05).lattice) == enough
    assert pyfric.plan(paper, "stress", 0.05, t_end=0.05).lattice == ""


def test_zones_of_blocks_without_weakening_are_left_out_of_the_median():
    """With these blocks the median of X_c0 would be 0."""
    d_c = [0.0] * 10 + [1e-6] * 11
    scene = preset("setup2", l="5 mm", h="5 mm", d_c=d_c)
    record = pyfric.simulate(scene, 0.4, fidelity="hybrid", geometry="linear", progress=False)
    assert any("X_c0/l below" in note for note in record.notes)
