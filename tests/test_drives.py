"""Drives of a whole row, and pulled sides: `driver.side`."""

import math

import numpy as np
import pytest
from helpers import budget_error, refused, small_free, small_rod

import pyfric
from pyfric.engines import pauses
from pyfric.scene import Scene, chain, setup2
from pyfric.statics import loaded_state

MU_S, MU_K, P, K_P, V = 0.5, 0.3, 20.0, 2e5, 1e-3


def spring_chain(**changes):
    """Return eleven blocks with negligible bonds, held by the driver's springs."""
    own = {"L": 0.01, "l": 1e-3, "p": P, "k": 1e-3, "eta": 0.0, "M": 11e-4, "side": "top"}
    return chain(**own, mu_s=MU_S, mu_k=MU_K, K=11 * K_P, V=V, **changes)


def test_a_single_block_sticks_and_slips_as_in_its_formula():
    """Slip is 2 (mu_s - mu_k) p/K in half a period, plus a part due to the driver's motion."""
    m, drop, omega = 1e-4, (MU_S - MU_K) * P, math.sqrt(K_P / 1e-4)
    record = pyfric.simulate(spring_chain(), 0.25, fidelity="hybrid", dt=5e-7)
    found = record.episodes[record.episodes["n"] == 6]
    begin = MU_S * P / (K_P * V)
    # m x'' = K (V t - x) - mu_k p from rest at the threshold: x = V t + A (1 - cos) - V/w sin
    A, lag = drop / K_P, V / omega
    last = 2 * (math.pi - math.atan(A / lag))  # phase at which x' is 0 again
    slip = V * last / omega + A * (1 - math.cos(last)) - lag * math.sin(last)
    assert found["t_start"].iloc[0] == pytest.approx(begin, rel=1e-9)
    assert (found["t_stop"] - found["t_start"]).iloc[0] == pytest.approx(last / omega, rel=1e-4)
    assert found["slip"].iloc[0] == pytest.approx(slip, rel=1e-6)
    period = slip / V
    assert np.diff(found["t_start"]) == pytest.approx(np.full(len(found) - 1, period), rel=1e-4)
    assert len(found) == 1 + int((0.25 - begin) / period)
    assert m * 11 == pytest.approx(record.scene.slider.M)


def burridge_knopoff(**changes):
    """Return twenty blocks of different strengths; the driver's springs have k/4."""
    own = {"L": 0.0475, "side": "top", "k": 5.4e8, "K": 20 * 1.35e8}
    mu_s = [0.5 + 0.02 * (n * 7 % 20) for n in range(20)]
    return chain(**own | {"V": 8e-6, "mu_s": mu_s, "mu_k": 0.4} | changes)


def test_jumps_make_the_events_of_full_dynamics():
    """The first thirty events agree block by block."""
    scene = burridge_knopoff(tau=0.499 * 3500 / 20, V=8e-5)
    runs = [
        pyfric.simulate(scene, 0.025, fidelity=fidelity, t_gap=1e-5, dt=4e-7, energies=False)
        for fidelity in ("dynamic", "hybrid")
    ]
    a, b = (run.events.iloc[:30] for run in runs)
    assert len(a) == len(b) == 30
    assert b["n_blocks"].max() > 3
    for name in ("first_block", "last_block", "nucleation_block", "n_blocks"):
        assert a[name].to_numpy() == pytest.approx(b[name].to_numpy(), nan_ok=True)
    starts = [events["F_T_start"].to_numpy() for events in (a, b)]
    assert starts[1] == pytest.approx(starts[0], abs=1e-6 * scene.F_N)
    counts = runs[1].counts
    assert counts["steps"] < 0.5 * (counts["steps"] + counts["steps_spared"])


@pytest.mark.parametrize(
    "scene",
    [
        small_free(side="top", h=6e-3, V=6e-3),
        small_rod(side="pull right", V=6e-3),
        small_free(side="pull left", V=6e-3, theta=0.3),
    ],
    ids=["top", "pulled", "pulled left"],
)
def test_engines_agree_on_other_drives(scene):
    full, jumps = (
        pyfric.simulate(scene, 0.06, fidelity=fidelity, geometry="linear")
        for fidelity in ("dynamic", "hybrid")
    )
    still = pyfric.simulate(scene, 0.06, fidelity="quasistatic")
    starts = [run.events["F_T_start"].to_numpy() for run in (full, jumps)]
    assert len(starts[0]) > 2
    assert starts[1] == pytest.approx(starts[0], abs=1e-5 * scene.F_N)
    peaks = [run.curve["F_T"].max() for run in (full, still)]
    assert peaks[0] == pytest.approx(peaks[1], abs=0.03 * scene.F_N)
    assert still.events["F_T_start"].iloc[0] == pytest.approx(starts[0][0], abs=1e-3 * scene.F_N)


def test_a_pulled_side_is_the_image_of_the_other():
    left, right = (
        pyfric.simulate(small_rod(side=f"pull {side}", V=0.02), 0.02, fidelity="hybrid")
        for side in ("left", "right")
    )
    starts = [run.events["F_T_start"].to_numpy() for run in (left, right)]
    assert starts[0] == pytest.approx(starts[1], rel=1e-9)
    assert left.scene.d == -1 and right.scene.d == 1  # noqa: PT018
    assert (left.scene.n_of_i == np.arange(1, left.scene.N_x + 1)).all()
    moved = [run.final_state.y[0, 0] for run in (left, right)]
    assert moved[0] == pytest.approx(-moved[1][::-1], rel=1e-6)


def test_forces_of_a_driven_top_add_up():
    scene = small_free(side="top", h=6e-3)
    rest = pyfric.StaticSolver(scene).solve(np.zeros(scene.N_x), 1e-5)
    loaded = loaded_state(scene)
    each = scene.driver.K / scene.N_x * (1e-5 - (rest.u[-1, 0] - loaded.u[-1, 0]))
    assert rest.F_T == pytest.approx(each.sum(), rel=1e-12)
    assert rest.tau.sum() == pytest.approx(rest.F_T, rel=1e-9)


def test_coarse_lattices_keep_their_drive():
    fine = setup2(l=2e-4, side="top", h=0.02)
    less = pauses.coarser(fine)
    assert less.N_x < fine.N_x
    assert less.driver.side == "top"
    assert less.j_h == less.N_z - 1
    assert Scene.from_toml(fine.to_toml()) == fine


def test_refusals():
    free = small_free()
    refused(lambda: free.replace({"driver.side": "top"}), "driver.h", value=0.002, within=(0.006,))
    top = free.replace({"driver.side": "top", "driver.h": 6e-3})
    refused(lambda: top.replace(h_top=6e-3), "driver.h_top", "None", "top is driven")
    refused(lambda: free.replace({"driver.side": "bottom"}), "driver.side", "'pull left'")
    refused(lambda: chain(side="top", h=1e-3), "driver.h", value=0.001, unit="m", within=(0,))


def test_a_moving_top_is_the_plate_of_a_driven_top():
    """Springs k_top to a plate move blocks like a driver on the top; their force is in T."""
    mu_s = [0.5 + 0.02 * (n * 7 % 20) for n in range(20)]
    own = {"L": 0.0475, "k": 5.4e8, "mu_s": mu_s, "mu_k": 0.4}
    by_driver = chain(side="top", K=20 * 1.35e8, V=1e-5, **own)
    by_top = chain(k_top=1.35e8, V_top=1e-5, K=1e-3, V=0.0, **own)
    for fidelity in ("dynamic", "hybrid", "quasistatic"):
        steps = {} if fidelity == "quasistatic" else {"dt": 1e-6}
        a, b = (
            pyfric.simulate(scene, 0.08, fidelity=fidelity, t_gap=1e-4, **steps)
            for scene in (by_driver, by_top)
        )
        assert len(a.events) >= 4
        for name in ("t_start", "first_block", "last_block"):
            first = [run.events[name].to_numpy()[:4] for run in (a, b)]
            assert first[1] == pytest.approx(first[0], rel=1e-6)


@pytest.mark.parametrize(
    "scene",
    [
        chain(L=0.05, k_top=2e6, V_top=2e-3, V=5e-4, tau=10.0, K=4e7),
        small_free(k_top=1e5, V_top=2e-3, V=2e-3, T=20.0, T_protocol=[(0.02, 60.0)]),
    ],
    ids=["chain", "slab"],
)
def test_two_drives_at_once(scene):
    full, jumps = (
        pyfric.simulate(scene, 0.05, fidelity=fidelity, geometry="linear", **how)
        for fidelity, how in (("dynamic", {"energies": True}), ("hybrid", {}))
    )
    still = pyfric.simulate(scene, 0.05, fidelity="quasistatic")
    starts = [run.events["F_T_start"].to_numpy() for run in (full, jumps, still)]
    assert len(starts[0]) > 2
    assert starts[1] == pytest.approx(starts[0], abs=1e-5 * scene.F_N)
    assert starts[2][0] == pytest.approx(starts[0][0], abs=1e-3 * scene.F_N)
    alone = pyfric.simulate(scene.replace(V_top=0.0), 0.3, fidelity="quasistatic")
    assert alone.events["t_start"].iloc[0] > still.events["t_start"].iloc[0]
    assert budget_error(full) < 1e-3


def test_a_top_that_moves_needs_springs():
    refused(lambda: small_free(V_top=1e-3), "top.V_top", value=0.001, unit="m/s", within=(0,))
    refused(lambda: chain(V_top=1e-3), "top.V_top", value=0.001, unit="m/s", within=(0,))
    refused(lambda: small_free(k_top=-1.0), "top.k_top", value=-1.0, unit="N/m", within=(0,))
    assert Scene.from_toml(small_free(k_top=1.0, V_top=-1.0).to_toml()).V_top == -1.0
    assert "k_top" not in small_free().to_toml()
