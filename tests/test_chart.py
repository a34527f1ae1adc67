"""Error against cost, and stability, of any scene: methods that run, and reasons of refusals."""

import functools
import math

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import refused

import pyfric
from pyfric.checks import chart, stability
from pyfric.cli.commands import main
from pyfric.figures import save_figure
from pyfric.scene import chain, preset, setup1
from pyfric.statics import stability_limit


def small():
    """15 x 8 blocks, driven fast."""
    return setup1(L=0.07, H=0.035, l=5e-3, V=20e-3, F_N=1750.0, name="small")


@functools.cache
def table():
    return chart.chart(small(), budget=60.0)


def row(found, **wanted):
    for name, value in wanted.items():
        found = found[found[name] == value]
    (only,) = found.to_dict("records")
    return only


def test_errors_fall_with_the_step_and_geometry_shows():
    found = table()
    assert found["status"].iloc[0] == "reference"
    assert set(found["status"][1:]) == {"ok"}
    assert len(found) == 1 + len(chart.methods(small()))
    full = {"fidelity": "dynamic", "stepper": "rk4", "switching": "located"}
    coarse, fine = (row(found, **full, geometry="finite", share=share) for share in (0.9, 0.25))
    linear = row(found, **full, geometry="linear", share=0.9)
    assert 0 < fine["precursors"] < coarse["precursors"] < linear["precursors"]
    hybrid = row(found, fidelity="hybrid", geometry="finite", share=0.25)
    assert hybrid["precursors"] < 1e-4
    static = row(found, fidelity="quasistatic")
    assert static["precursors"] > 100 * hybrid["precursors"]
    assert math.isnan(static["front_speed"])


def test_what_a_run_lacks_is_its_error():
    """Errors are those of the reference changed by a known amount."""
    record = pyfric.simulate(small(), 0.02, fidelity="hybrid", progress=False)
    same = chart._errors(record, record, 0.02)
    assert same["precursors"] == same["loading_curve"] == same["stress"] == 0
    start = record.events["F_T_start"] + 0.01 * small().F_N
    other = record.replace(events=record.events.assign(F_T_start=start))
    assert chart._errors(other, record, 0.02)["precursors"] == pytest.approx(0.01)


def test_what_refuses_a_scene_says_why(tmp_path):
    """A prescribed interface has only rupture times, and only from full dynamics."""
    scene = preset("tpv3", l=1000.0)
    found = chart.chart(scene, 1.5, budget=30.0)
    other = found[found["fidelity"] != "dynamic"]
    assert other["status"].str.contains("full dynamics|linear|quasi-static").all()
    finite = found[(found["fidelity"] == "dynamic") & (found["geometry"] == "finite")]
    assert finite["status"].str.contains("geometry = 'finite'").all()
    ran = found[found["status"] == "ok"]
    assert np.isfinite(ran["precursors"]).all()
    assert ran["loading_curve"].isna().all()
    text = chart.report(found)
    assert "no answer: equilibrium" in text
    names = {path.name for path in save_figure(chart.figure(found), tmp_path / "chart")}
    assert names == {"chart.png", "chart.pdf", "chart.txt", "chart_points.csv"}


def test_what_does_not_fit_into_the_budget_is_said():
    found = chart.chart(small(), 2e-3, budget=1e-3)
    assert found["share"].iloc[0] == 0.5
    assert found["status"][1:].str.startswith("not run: ").all()
    assert len(chart.report(found).splitlines()) > 3


@pytest.mark.parametrize(
    "scene",
    [
        setup1(L=0.0175, H=0.01),
        chain(L=0.0475),
        preset("tpv3", l=1500.0, H=6e3),
    ],
    ids=["rod", "chain", "prescribed"],
)
def test_disturbances_grow_beyond_the_limit_only(scene):
    still = stability.at_rest(scene)
    for stepper in stability.LIMITED:
        limit = stability_limit(scene, stepper)[0]
        assert stability.growth(still, stepper, 0.98 * limit) <= 1e-3
        assert stability.growth(still, stepper, 1.2 * limit) > 0.05


def test_rk4_grows_as_its_polynomial_says():
    """The shortest wave of a free chain without dashpots has omega = 2 sqrt(k/m)."""
    scene = chain(L=63 * 2.5e-3, eta=0.0)
    dt = 1.1 * math.sqrt(2) * math.sqrt(scene.m / scene.slider.k)
    z = 2j * dt * math.sqrt(scene.slider.k / scene.m)
    known = math.log(abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24))
    assert stability.growth(stability.at_rest(scene), "rk4", dt) == pytest.approx(known, rel=0.02)


def test_a_table_of_limits(tmp_path):
    found = stability.stability(setup1(L=0.0175, H=0.01))
    np.testing.assert_allclose(found["ratio"], 1, atol=0.02)
    assert "verlet" in stability.report(found)
    names = {path.name for path in save_figure(stability.figure(found), tmp_path / "limits")}
    assert "limits_growth.csv" in names
    nothing = stability.stability(setup1(L=0.0175, H=0.01), budget=0.0)
    assert nothing["measured"].isna().all()


def test_the_end_of_a_chart_is_a_time():
    refused(lambda: chart.chart("fig1", "1 kg"), "t_end", value="1 kg", unit="s", within=(0,))


@pytest.mark.parametrize("command", ["chart", "stability"])
def test_commands_take_any_scene(command, tmp_path):
    small().to_toml(tmp_path / "scene.toml")
    options = ["--budget", "0.05 s", "--set", "mu_k=0.4", "--out", str(tmp_path)]
    options += ["--t-end", "1 ms"] if command == "chart" else []
    done = CliRunner().invoke(main, [command, str(tmp_path / "scene.toml"), *options])
    assert done.exit_code == 0, done.output
    assert "rk4" in done.output
    for end in (".png", "_provenance.toml"):
        assert (tmp_path / f"{command}{end}").is_file()
