"""Convergence of methods: orders from theory, stored failures, agreement of other programs."""

import functools

import beside
import methods
import numpy as np
import pandas as pd
import peers
import pytest

from pyfric.figures import save_figure
from pyfric.scene import preset

SHARES = (2.0, 0.9, 0.5, 0.25, 0.125)


@functools.cache
def event():
    """Return the fourth main event of the Fig. 1 scene on a coarse lattice."""
    lines = (
        methods.Method("rk4", "step_end", "finite", SHARES),
        methods.Method("rk4", "located", "finite", SHARES),
        methods.Method("verlet", "located", "finite", SHARES),
        methods.Method("rk4", "located", "linear", SHARES[1:]),
    )
    points = methods.event_points(
        scene=preset("fig1", l=5e-3),
        event=6,
        methods=lines,
        reference_shares=(0.125, 0.0625, 0.03125),
        repeats=1,
    )
    return pd.DataFrame(points)


def order(stepper, switching, geometry, question="rupture"):
    table = methods.orders(event(), question).set_index(["stepper", "switching", "geometry"])
    return table.loc[(stepper, switching, geometry), "order"]


@pytest.mark.slow
def test_the_reference_has_converged():
    """Halving its steps divides its changes by 2^4."""
    for _, line in event()[event()["scene"] == "reference"].groupby("geometry"):
        for question in ("rupture", "stress"):
            first, second = line[question]
            assert 10 < first / second < 25


def test_located_switching_keeps_the_order_of_the_stepper():
    """The coarsest steps, nine tenths of the limit, are outside the range of the power law."""
    assert order("rk4", "located", "finite") > 3.2
    assert order("rk4", "located", "finite", "stress") > 3.2
    assert order("verlet", "located", "finite") == pytest.approx(2, abs=0.3)


def test_switching_at_step_ends_costs_it():
    for question in ("rupture", "stress"):
        assert order("rk4", "step_end", "finite", question) < 1.6
    done = event()[(event()["stepper"] == "rk4") & (event()["status"] == "ok")]
    done = done[(done["share"] == 0.5) & (done["geometry"] == "finite")].set_index("switching")
    assert done.loc["step_end", "rupture"] > 50 * done.loc["located", "rupture"]


def test_the_energy_budget_closes_with_the_order_of_the_stepper():
    assert order("rk4", "located", "finite", "energy") > 3.4


def test_linear_geometry_is_another_model():
    """Finer steps do not reduce its difference from the reference in finite geometry."""
    line = event()[(event()["geometry"] == "linear") & (event()["stepper"] == "rk4")]
    line = line[(line["scene"] == "event") & (line["share"] <= 0.5)]
    assert np.ptp(line["stress"]) < 0.01 * line["stress"].min()
    assert (line["own_stress"] < 1e-3 * line["stress"]).all()


def test_points_that_fail_are_kept_with_the_reason():
    table = event()
    failed = table[table["status"] != "ok"]
    assert set(zip(failed["stepper"], failed["share"], strict=True)) == {
        ("rk4", 2.0),
        ("verlet", 2.0),
        ("verlet", 0.9),
    }
    assert failed["status"].str.contains("stability limit").all()
    assert failed["rupture"].isna().all()


@functools.cache
def slider():
    return pd.DataFrame(beside.slider_points())


@pytest.mark.slow
def test_switch_times_of_the_small_slider():
    table = slider()
    ok = table[table["status"] == "ok"]
    finest = ok[ok["stepper"] == "rk4"].groupby("switching")["rupture"].min()
    assert finest["located"] < 1e-10
    assert finest["step_end"] > 1e-8
    peer = ok[ok["engine"].str.startswith("scipy")].sort_values("rtol")
    assert peer["rupture"].iloc[0] < 1e-12
    coarse = table[(table["switching"] == "step_end") & (table["share"] > 0.2)]
    assert coarse["status"].str.startswith("other switches").all()


def test_a_free_wave_is_that_of_lammps(monkeypatch):
    monkeypatch.setattr(beside, "REPEATS", 1)
    monkeypatch.setattr(beside, "preset", functools.partial(preset, l=5e-3))
    table = pd.DataFrame(beside.wave_points())
    ok = table[table["status"] == "ok"]
    for stepper, expected in (("rk4", 4), ("verlet", 2), ("symplectic_euler", 1)):
        line = ok[(ok["engine"] == "pyfric") & (ok["stepper"] == stepper)]
        slope = np.polyfit(np.log(line["dt"][-3:]), np.log(line["displacement"][-3:]), 1)[0]
        assert slope == pytest.approx(expected, abs=0.25)
    if peers.available()["lammps"].startswith("missing"):
        pytest.skip("LAMMPS is not installed")
    one, other = (
        ok[(ok["engine"] == engine) & (ok["stepper"] == "verlet")]["displacement"].to_numpy()
        for engine in ("pyfric", "LAMMPS")
    )
    np.testing.assert_allclose(one, other, rtol=1e-6)


@pytest.mark.slow
def test_the_figure_shows_every_question(tmp_path):
    table = pd.concat([event(), slider()], ignore_index=True)
    table["displacement"] = np.nan
    fig = methods.figure(table)
    assert len(fig.axes) == len(methods.PANELS)
    drawn = [len(axes.lines) for axes in fig.axes]
    assert min(drawn[:4]) >= 4
    assert drawn[5] >= 3
    names = {path.name for path in save_figure(fig, tmp_path / "methods")}
    assert names == {
        f"methods{end}" for end in (".png", ".pdf", ".txt", "_points.csv", "_orders.csv")
    }
