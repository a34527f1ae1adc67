"""Pushes, classes of rupture and phase diagrams of chains."""

import dataclasses
import functools
import shlex
import sys
import tomllib

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from helpers import refused, small

import pyfric
from pyfric import loaded_state, step_size
from pyfric.cli.commands import main
from pyfric.figures import phase_map, save_figure
from pyfric.record import creeps_to_rest
from pyfric.scene import Scene, chain, preset
from pyfric.sweeps import Job, chain_job, phase_diagram, phases
from pyfric.theory import chain_prestress, chain_speed


@functools.cache
def made(alpha, tau_bar, blocks=100, **options):
    job = chain_job(alpha, tau_bar, blocks)
    return pyfric.simulate(job.scene, job.t_end, dataclasses.replace(job.options, **options))


def over_c(record, speed):
    slider = record.scene.slider
    return speed / (slider.l * np.sqrt(slider.k / record.scene.m))


# --- pushes --------------------------------------------------------------------------------------


def pushed(*push, **changes):
    fields = {"L": 19 * 2.5e-3, "p": 60.0, "tau": 30.0, "K": 0.0, "V": 0.0, "push": push}
    return chain(**fields | changes)


def test_a_push_is_a_force_on_a_block():
    """In the core a permanent push equals the same force in tau, bit for bit."""
    push, there = pushed((1, 13.0), K=1e-3), [30.0] * 20
    there[0] = 43.0  # above mu_s p = 42 N, which tau may not exceed: mu_s is higher there
    strong = chain(L=19 * 2.5e-3, p=60.0, tau=there, K=1e-3, V=0.0, mu_s=0.72)
    np.testing.assert_array_equal(push.push_at(0.0)[0] + push.shear, strong.shear)
    assert (push.shear == 30.0).all()


def test_a_push_over_a_time_ends():
    scene = pushed((1, 13.0, 1e-6, 3e-6), (20, -80.0, 2e-6, 4e-6))
    assert scene.corners == (1e-6, 2e-6, 3e-6, 4e-6)
    for t, first, last in ((0.0, 0, 0), (1e-6, 13, 0), (2.5e-6, 13, -80), (3e-6, 0, -80)):
        added = scene.push_at(t)[0]
        assert (added[0], added[-1]) == (first, last)
    mirrored = scene.replace({"driver.side": "right"})
    np.testing.assert_array_equal(mirrored.push_at(2.5e-6), -scene.push_at(2.5e-6)[:, ::-1])
    assert Scene.from_toml(scene.to_toml()) == scene
    record = pyfric.simulate(scene, 2e-5, fidelity="dynamic")
    begins = record.episodes.groupby("n")["t_start"].first()
    assert begins[1] == pytest.approx(1e-6, rel=1e-9)
    assert begins[20] == pytest.approx(2e-6, rel=1e-9)


def test_energy_of_a_push():
    """With the work of the push among outer forces, the budget closes."""
    scene = pushed((1, 30.0, 0.0, 2e-5))
    record = pyfric.simulate(scene, 1e-4, fidelity="dynamic", energies=True)
    assert pyfric.record.budget_error(record.curve) < 1e-5
    assert record.curve["work_load"].max() > 0


def test_refused_pushes():
    for push, said in (
        ((1, 11.9), "does not let it slip"),
        ((21, 13.0), "outside the interface"),
        ((0, 13.0), "outside the interface"),
        ((1, 13.0, 2.0, 1.0), "ends before it begins"),
        ((1,), "not two to five numbers"),
        ((1, "13"), "push 1"),
        ((1, 0.0), "pushes nothing"),
        ((1, 0.0, 0.0, 1e-3, 1e4), "does not let it slip"),
    ):
        refused(lambda push=push: pushed(push), "top.push", said)
    for fidelity in ("hybrid", "quasistatic"):
        run = functools.partial(pyfric.simulate, pushed((1, 13.0)), 1e-3, fidelity=fidelity)
        refused(run, "top.push", "needs full dynamics")


# --- classes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("alpha", "tau_bar", "said"),
    [
        (0.3, 0.05, "arrested"),
        (1.0, 0.01, "arrested"),
        (0.5456, 0.1111, "alternating"),
        (0.01, 0.003, "sub-Rayleigh pulse"),
        (1.0, 0.2, "sub-Rayleigh crack"),
        (0.1, 0.5, "supershear crack"),
        (3.0, 0.05, "slow crack"),
    ],
)
def test_classes_of_the_chain(alpha, tau_bar, said):
    record = made(alpha, tau_bar)
    found = record.rupture_class()
    assert said in str(found)
    assert (found.reached == 100) == (said != "arrested")
    stop = "arrested" if said == "arrested" else "reached"
    assert record.status.startswith(f"ended by stop_when ({stop}")
    again = record.rupture_class(slow=0.999)
    assert (again.pace == "slow") == (found.pace in ("slow", "sub-Rayleigh"))


@pytest.mark.parametrize(("alpha", "tau_bar"), [(0.3, 0.5), (1.0, 0.3), (0.1, 0.7)])
def test_speeds_are_those_of_steady_fronts(alpha, tau_bar):
    record = made(alpha, tau_bar)
    v = over_c(record, record.rupture_class().speed)
    assert v == pytest.approx(float(chain_speed(tau_bar, alpha)), rel=1e-4)


def test_damaged_chains_are_noticed():
    """A chain without viscosity has another class; without its push it is refused or rests."""
    record = made(0.3, 0.05)
    loose = record.scene.replace({"interface.alpha": 0.0})
    t_end = record.curve["t"].iloc[-1]
    free = pyfric.simulate(loose, t_end, fidelity="dynamic", switching="step_end")
    assert free.rupture_class().reached > 2 * record.rupture_class().reached
    still = record.scene.replace({"top.push": ()})
    assert pyfric.simulate(still, t_end, fidelity="dynamic").events.empty


def test_other_interfaces_and_events():
    record = pyfric.simulate("fig1", 0.25, fidelity="hybrid", geometry="linear", verify="none")
    largest = int(record.events["n_blocks"].idxmax())
    assert record.rupture_class() == record.rupture_class(largest)
    assert record.rupture_class().kind == "arrested"
    refused(lambda: record.rupture_class(99), "event", value=99, within=(1, 3))
    refused(lambda: record.rupture_class(slow=2.0), "slow", value=2.0, within=(0, 1))
    slid = pyfric.simulate(small(), 3e-3, fidelity="dynamic", geometry="linear")
    found = slid.rupture_class()
    assert found.kind in ("alternating", "pulse", "crack")
    assert found.speed > 0


# --- diagrams ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_phase_diagram_of_the_chain(tmp_path):
    values = {"x": ("alpha", [0.3, 1.0]), "y": ("tau_bar", np.geomspace(0.134, 0.9, 3))}
    values |= {"label": {"fast": lambda record: record.rupture_class().pace == "supershear"}}
    found = phase_diagram(**values, cache=tmp_path, workers=1, progress=False)
    assert len(found.table) == 6
    assert set(found.table["fast"]) == {True, False}
    lines = found.lines
    assert lines["runs"].mean() <= 10
    exact = chain_prestress(1.0, 0.3), chain_prestress(1.0, 1.0)
    np.testing.assert_allclose(lines["tau_bar"], exact, rtol=5e-3)
    assert (np.log10(lines["high"] / lines["low"]) < 2.01e-3).all()
    again = phase_diagram(**values, cache=tmp_path, workers=1, progress=False)
    assert again.table.equals(found.table)
    assert again.lines.equals(found.lines)
    files = save_figure(phase_map(found), tmp_path / "phases")
    assert {path.name for path in files} >= {"phases.png", "phases_table.csv", "phases_lines.csv"}


def test_the_two_numbers_of_the_chain_go_by_their_names():
    """Names decide which number is alpha and which is tau_bar, in any order."""
    axes = ("tau_bar", [0.2, 0.3]), ("alpha", [2.0, 3.0])
    job, *_ = phases._jobs(None, *axes, None, None, None)
    assert job(0.2, 3.0).scene == chain_job(alpha=3.0, tau_bar=0.2).scene


def test_a_phase_diagram_of_any_scene(tmp_path):
    def length(record):
        return bool(len(record.events))

    found = phase_diagram(
        small(h=2.5e-3),
        x=("driver.V", [0.5, 0.55]),
        y=("mu_s", [0.6, 1.5]),
        label=length,
        t_end=1.2e-3,
        options={"fidelity": "quasistatic", "stop_when": "arrested"},
        tolerance=0.01,
        cache=tmp_path,
        workers=1,
    )
    assert set(found.table["label"]) == {True, False}
    assert (found.lines["high"] - found.lines["low"] <= 0.019).all()
    axes = phase_map(found).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("driver.V (m/s)", "mu_s")

    def job(mu_s, V):
        return Job(scene=small(mu_s=mu_s, V=V), t_end=1e-4, options={"fidelity": "quasistatic"})

    other = phase_diagram(
        job, x=("mu_s", [0.6, 0.7]), y=("V", [0.1, 0.2]), label=length, cache=None, workers=1
    )
    assert not other.table["label"].any()
    assert other.lines.empty


@pytest.mark.slow
def test_a_phase_diagram_of_a_named_preset(monkeypatch, tmp_path):
    """Each point is the preset with these values, in Python and by command: k follows from l."""
    asked = []
    monkeypatch.setattr(phases, "run_all", lambda jobs, **_: asked.append(jobs) or 1 / 0)
    values, given = [2.5e-3, 5e-3], {"mu_s": 0.6}
    axes = {"x": ("l", values), "y": ("L", [0.07, 0.14])}
    expected = [preset("chain", given, l=l, L=L) for l in values for L in (0.07, 0.14)]
    command = ["phase-diagram", "chain", "--set", "mu_s=0.6", "--t-end", "1 ms", "--x"]
    command += ["l=2.5e-3:5e-3:2", "--y", "L=0.07:0.14:2", "--out", str(tmp_path)]
    with pytest.raises(ZeroDivisionError):
        phase_diagram("chain", **axes, t_end=1e-3, changes=given)
    CliRunner().invoke(main, command)
    assert [[job.scene for job in jobs] for jobs in asked] == [expected, expected]
    done = CliRunner().invoke(main, [*command, "--set", "L=0.1"])
    assert (done.exit_code, "given twice" in done.output) == (2, True)
    refused(lambda: phase_diagram(changes=given), "changes", "their own")


@pytest.mark.usefixtures("coarse_curves")
def test_a_phase_diagram_with_points_at_which_nothing_slips(tmp_path):
    found = phase_diagram(
        small(h=2.5e-3),
        x=("driver.V", [0.5, 0.55]),
        y=("mu_s", [0.6, 2.5]),
        t_end=1.2e-3,
        options={"fidelity": "dynamic", "geometry": "linear", "stop_when": "arrested"},
        tolerance=0.1,
        cache=tmp_path,
        workers=1,
    )
    still = found.table["reached"] == 0
    assert sorted(still) == [False, False, True, True]
    assert ((found.table["kind"] == "nothing slipped") == still).all()
    assert ((found.table["pace"] == "nothing slipped") == still).all()
    assert not found.lines.empty
    nothing = pyfric.simulate(small(mu_s=2.5), 1e-4, fidelity="dynamic", progress=False)
    assert str(nothing.rupture_class()) == "nothing slipped"
    for speed in (1e-4, 30.0):  # beyond the range of colours
        table = found.table.assign(speed_over_c=speed)
        phase_map(dataclasses.replace(found, table=table)).canvas.draw()


def diagram(labels, alpha=(1.0, 20.0)):
    """Return a diagram with a number of labels over alpha and tau_bar, without runs or lines."""
    tau_bar = np.linspace(0.1, 0.9, labels)
    points = [(a, b, f"label {n:02}") for a in alpha for n, b in enumerate(tau_bar)]
    table = pd.DataFrame(points, columns=["alpha", "tau_bar", "kind"])
    table = table.assign(speed=1e3, speed_over_c=0.5, reached=100, status="complete")
    return phases.PhaseDiagram("alpha", "tau_bar", table, pd.DataFrame(columns=LINE))


LINE = ["label", "below", "above", "alpha", "tau_bar", "low", "high", "runs"]


def test_a_map_shows_all_labels_and_theory_as_far_as_it_goes():
    fig = phase_map(diagram(12))
    texts = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert texts == [*(f"label {n:02}" for n in range(12)), "v = c", "v = 0.1 c"]
    drawn = [line for line in fig.axes[0].get_lines() if line.get_label().startswith("label")]
    assert len({(line.get_marker(), line.get_color()) for line in drawn}) == 12
    theory = fig.axes[0].get_lines()[-1].get_xdata()
    assert (theory.min(), theory.max()) == pytest.approx((1.0, 10.0))
    assert "Black lines" not in fig.caption
    assert "Lines of constant v" in fig.caption
    assert "Lines of constant v" not in phase_map(diagram(2, alpha=(11.0, 20.0))).caption
    refused(lambda: phase_map(diagram(2), "pace"), "label", "unknown")


def test_a_line_of_one_point_is_seen():
    points = [("kind", "label 00", "label 01", 1.0, 0.5, 0.4, 0.6, 3)]
    one = dataclasses.replace(diagram(2), lines=pd.DataFrame(points, columns=LINE))
    drawn = [
        tuple(line.get_xydata()[0])
        for line in phase_map(one).axes[0].get_lines()
        if line.get_marker() == "_"
    ]
    assert drawn == [(1.0, 0.5)]


def test_refused_diagrams():
    refused(lambda: phase_diagram("fig1"), "x", "the name of a field")
    axes = {"x": ("driver.h", [2.5e-3, 5e-3]), "y": ("mu_s", [0.6, 0.7])}
    refused(lambda: phase_diagram("fig1", **axes), "t_end", "missing")
    taken = {"speed": lambda record: record.status}
    refused(lambda: phase_diagram("fig1", **axes, t_end=1e-3, label=taken), "label", "speed_over_c")
    refused(lambda: phase_diagram(y=("tau_bar", [0.5, 0.1])), "y", "rising")
    axes["y"] = axes["x"]
    refused(lambda: phase_diagram("fig1", **axes, t_end=1.0), "y", "another field")
    axes["y"] = ("h", [2.5e-3, 5e-3])
    refused(lambda: phase_diagram("fig1", **axes, t_end=1.0), "driver.h", "given twice")
    refused(lambda: phase_diagram("fig1", x=("h", 5), y=("mu_s", [0.6, 0.7])), "x", "not a list")
    refused(lambda: phase_diagram(x=("beta", [0.1, 0.5])), "x, y", "numbers of the chain")
    refused(lambda: phase_diagram(tolerance=-1.0), "tolerance", value=-1.0, within=(0, 0.5))
    refused(lambda: phase_diagram(t_end=1.0), "t_end", "their own")
    refused(lambda: phase_diagram(options={"dt": 1e-6}), "options", "their own")
    refused(lambda: chain_job(1.0, 0.5, blocks=20.5), "blocks", value=20.5, within=(20,))
    refused(lambda: chain_job(0.0, 0.5), "alpha", value=0.0, unit="sqrt(k m)", within=(0,))
    refused(lambda: chain_job(1.0, 1.0), "tau_bar", value=1.0, within=(0, 1))


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "cache"))
    command = ["phase-diagram", "--x", "alpha=0.3:1:2:log", "--y", "tau_bar=0.05:0.5:2:log"]
    command += ["--no-lines", "--workers", "1", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["bin/pyfric", *command])
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    about = tomllib.loads((tmp_path / "phases_provenance.toml").read_text(encoding="utf-8"))
    assert shlex.split(about["command"]) == ["pyfric", *command]
    assert (tmp_path / "phases.png").exists()
    for axis in ("alpha=3", "alpha=0.3:1:2:log:more"):
        done = CliRunner().invoke(main, ["phase-diagram", "--x", axis])
        assert done.exit_code == 2
        assert "FIELD=FROM:TO:N" in done.output
    for option in (("--set", "mu_s=3"), ("--t-end", "1"), ("--stop-when", "arrested")):
        done = CliRunner().invoke(main, ["phase-diagram", *option, "--out", tmp_path])
        assert done.exit_code == 2
        assert "need a SCENE" in done.output  # options without a SCENE would have no effect


@pytest.mark.parametrize(
    ("name", "known"), [("chain", True), ("slow", False), ("rate_and_state", False)]
)
def test_only_a_margin_that_is_a_force_says_that_slip_creeps_to_rest(name, known):
    scene = preset(name)
    state = loaded_state(scene).state(scene, step_size(scene))
    assert state.margin.min() > 0
    assert creeps_to_rest(scene, state, lambda: np.zeros((scene.N_z, 2, scene.N_x))) is known
