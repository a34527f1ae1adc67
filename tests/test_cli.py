"""Command line: scenes and options, output, files, exit codes, Ctrl-C and SIGTERM."""

import dataclasses
import errno
import functools
import json
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import same_run, small

import pyfric
from pyfric import core
from pyfric.cli.commands import main
from pyfric.cli.shared import Exit, Tell, claimed
from pyfric.figures import FIGURES
from pyfric.paper.reproduction import mathematical
from pyfric.sweeps import runs

SMALL = ("--set", "L=20 mm", "--set", "H=12.5 mm", "--set", "V=500 mm/s")
"""Changes of fig1 with which it slips after 1.1 ms."""
DYNAMIC = ("--fidelity", "dynamic")

tiny = functools.partial(small, name="fig1")


def pyf(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


def run(*arguments, t_end="1.2 ms"):
    return pyf("run", "fig1", *SMALL, "--t-end", t_end, *arguments)


def dynamic(*arguments, **options):
    return run(*DYNAMIC, *arguments, **options)


def simulate(scene, t_end, *, fidelity="dynamic", **options):
    return pyfric.simulate(scene, t_end, fidelity=fidelity, progress=False, **options)


def refused(result, *texts):
    """Check that the command ended with code 2, a message with these texts, and no traceback."""
    assert result.exit_code == Exit.BAD_INPUT, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for text in texts:
        assert text in result.stderr
    return True


# --- help and info -------------------------------------------------------------------------------


def test_help_names_commands_and_exit_codes():
    shown = pyf("--help").stdout
    assert all(
        name in shown
        for name in ("run", "plan", "scene", "info", "reproduce", "draw", "movie", "verify")
    )
    for command in ("run", "reproduce"):
        shown = pyf(command, "--help").stdout
        assert all(f"{code.value}  " in shown for code in Exit)


def test_version():
    assert pyfric.__version__ in pyf("--version").stdout


def test_info():
    text = pyf("info").stdout
    assert core.VARIANT in text
    assert core.ENVIRONMENT in text
    found = json.loads(pyf("info", "--json").stdout)
    assert found["pyfric"] == pyfric.__version__
    assert found["variant"] == core.VARIANT
    assert found["variants"] == core.variants()
    assert found["openmp"] == core.build_info()["openmp"]
    assert found["lacks"] == core.lacks()
    assert found["processors"] >= 1
    assert found["numpy"] == np.__version__
    for key in ("compiler", "flags", "python"):
        assert found[key] in text


# --- scenes --------------------------------------------------------------------------------------


def test_scene_round_trip(tmp_path):
    file = tmp_path / "own.toml"
    result = pyf("scene", "setup2+", "--set", "h=3 mm", "--set", "side=right")
    expected = pyfric.preset("setup2+", h=3e-3, side="right")
    assert pyfric.Scene.from_toml(result.stdout) == expected
    assert (
        pyf("scene", "setup2+", "--set", "h=3e-3", "--set", "side=right", "--out", file).output
        == ""
    )
    assert pyfric.Scene.from_toml(file) == expected
    assert pyf("scene", file).stdout == result.stdout
    assert refused(pyf("scene", "fig1", "--out", file), "exists", "--overwrite")
    assert pyf("scene", "fig1", "--out", file, "--overwrite").exit_code == Exit.COMPLETE
    assert pyfric.Scene.from_toml(file) == pyfric.preset("fig1")


@pytest.mark.parametrize("name", pyfric.PRESETS)
def test_presets(name):
    assert pyfric.Scene.from_toml(pyf("scene", name).stdout) == pyfric.preset(name)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "fig1", "--t-end", "1e-5", "--out"),
        ("scene", "fig1", "--out"),
        ("scene", "fig1", "--overwrite", "--out"),
        ("draw", "fig1", "--out"),
        ("reproduce", "--out"),
    ],
)
def test_outputs_that_are_links_to_themselves_are_refused(tmp_path, words):
    for name in ("loop", "loop.nc", "loop.png"):
        (tmp_path / name).symlink_to(tmp_path / name)
    name = "loop.nc" if words[0] == "run" else "loop"
    assert refused(pyf(*words, tmp_path / name), "--out", "symbolic links")


def test_a_preset_wins_over_a_file_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("fig1", "own"):
        tiny(name="from a file").to_toml(name)
    assert 'name = "fig1"' in pyf("scene", "fig1").stdout
    assert 'name = "from a file"' in pyf("scene", "./fig1").stdout
    assert 'name = "from a file"' in pyf("scene", "own").stdout


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ("h=7.6 mm", ["driver.h = 0.0076 m", "multiple of l = 0.0025 m"]),
        ("h=7.5 kg", ["h = '7.5 kg'", "kg", "a finite number >= 0 m"]),
        ("h=high", ["h = 'high'", "1 m"]),
        ("F_N=-3 N", ["top.F_N = -3.0 N", "> 0 N"]),
        ("F_N=nan", ["F_N = nan N", "finite"]),
        ("mu_k=0.8", ["interface.mu_k = 0.8", "mu_s = 0.7"]),
        ("mu_k=low", ["interface.mu_k = 'low'", "not a number"]),
        ("side=up", ["driver.side = 'up'", "'left' or 'right'"]),
        ("theta=0.5", ["theta", "unknown"]),
        ("heigth=3 mm", ["heigth", "did you mean"]),
        ("name=" + "x" * 300, ["name = ", "at most 200 characters"]),
        ("h", ["KEY=VALUE"]),
        ("=3", ["KEY=VALUE"]),
        ("slider=3", ["slider = 3", "allowed: Slider"]),
    ],
)
def test_refused_changes(change, texts):
    assert refused(pyf("scene", "fig1", "--set", change), *texts)


def test_a_key_is_set_once():
    for twice in (("h=5e-3", "driver.h=7.5e-3"), ("h=5e-3", "h=7.5e-3")):
        options = [word for change in twice for word in ("--set", change)]
        assert refused(pyf("scene", "fig1", *options), "h = 0.0075", "given twice")


@pytest.mark.parametrize("text", [".005", "5.e-3", "+5E-03", "5e-3"])
def test_a_number_is_written_in_any_usual_way(text):
    shown = pyf("scene", "fig1", "--set", f"h={text}")
    assert pyfric.Scene.from_toml(shown.stdout).driver.h == 5e-3


@pytest.mark.parametrize("option", ["--most", "--older-than"])
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_what_is_pruned_has_a_finite_limit(option, value, monkeypatch, tmp_path):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path))
    assert refused(pyf("cache", "prune", option, value), f"{option} = {value}", "not a finite")


@pytest.mark.parametrize("command", [["info"], ["run", "fig1", "--t-end", "1 ms"]])
def test_a_core_that_is_not_there_is_bad_input(command):
    asked = os.environ | {"PYFRIC_VARIANT": "foo"}
    how = {"env": asked, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-P", "-m", "pyfric", *command], **how)
    assert done.returncode == Exit.BAD_INPUT
    assert done.stderr.startswith("Error: PYFRIC_VARIANT = 'foo': not installed")
    assert done.stderr.count("\n") == 1


def test_a_name_can_be_set():
    assert 'name = "x"' in pyf("scene", "fig1", "--set", "name=x").stdout


def test_refused_scenes(tmp_path):
    assert refused(pyf("scene", "fig"), "preset = 'fig'", "did you mean 'fig1'?")
    assert refused(pyf("scene", tmp_path / "none.toml"), "none.toml", "cannot be read")
    file = tmp_path / "broken.toml"
    file.write_text(tiny().to_toml().replace("driver", "diver"))
    assert refused(pyf("scene", file), "diver", "did you mean 'driver'?")
    file.write_text(tiny().to_toml())


@pytest.mark.parametrize(
    ("change", "value"),
    [
        ("h=5 mm", {"h": 5e-3}),
        ("driver.h=0.005", {"h": 5e-3}),
        ("interface.mu_k=0.4", {"mu_k": 0.4}),
        ("driver.protocol=[[1, 0.0], ['2 s', '1 mm/s']]", {"driver.protocol": ((1, 0), (2, 1e-3))}),
        ("mu_s={mean=0.7, std=0.01, seed=3}", {"mu_s": pyfric.Spread(mean=0.7, std=0.01, seed=3)}),
        ("name=5", {"name": "5"}),
    ],
)
def test_presets_and_files_take_the_same_names_and_values(tmp_path, change, value):
    file = tmp_path / "own.toml"
    pyfric.preset("fig1").to_toml(file)
    expected = pyfric.preset("fig1", value)
    for scene in ("fig1", file):
        shown = pyf("scene", scene, "--set", change)
        assert pyfric.Scene.from_toml(shown.stdout) == expected, shown.output


# --- run -----------------------------------------------------------------------------------------


def test_run_shows_progress_and_summary(tmp_path, monkeypatch):
    monkeypatch.setattr(Tell, "progress", True)  # as in a terminal
    out, stem, folder = tmp_path / "a.nc", tmp_path / "fig", tmp_path / "csv"
    result = dynamic("--out", out, "--figure", stem, "--csv", folder)
    assert result.exit_code == Exit.COMPLETE, result.output
    for text in ("set-up: static states and modes", "F_T/F_N", "events", "steps/s"):
        assert text in result.stderr
    for text in ("complete", "1 main", "0.001091", "ns", "stepping", str(out), "fig.png"):
        assert text in result.stdout
    for path in (out, tmp_path / "fig.png", tmp_path / "fig.pdf", folder / "events.csv"):
        assert path.stat().st_size > 0
    record = pyfric.Record.load(out)
    assert record.scene == tiny()
    assert same_run(record, simulate(tiny(), 1.2e-3), versions={})


def test_options_reach_the_run(tmp_path):
    out = tmp_path / "a.nc"
    how = "--geometry linear --dt 1us --sample 10us --t-gap 0.002 --threads 1 --no-energies --quiet"
    assert dynamic(*how.split(), "--out", out, t_end="0.0012").output == ""
    method = pyfric.Record.load(out).method
    assert (method.geometry, method.dt, method.sample) == ("linear", 1e-6, 10)
    assert (method.t_gap, method.threads, method.budget) == (2e-3, 1, False)
    assert method.engine == "dynamic"


def test_a_file_runs_like_its_preset(tmp_path):
    file = tmp_path / "own.toml"
    tiny().to_toml(file)
    result = pyf("run", file, "--t-end", "200 us", "--json")
    assert json.loads(result.stdout)["scene"] == "fig1"


def test_json(tmp_path):
    out = tmp_path / "a.nc"
    result = dynamic("--json", "--out", out)
    assert result.stderr == ""
    summary = json.loads(result.stdout)
    record = pyfric.Record.load(out)
    assert summary["status"] == "complete"
    assert summary["t"] == record.curve["t"].iloc[-1]
    assert summary["F_T_over_F_N"] == record.curve["F_T"].iloc[-1] / record.scene.F_N
    assert summary["events"] == {"all": 1, "main": 1, "precursors": 0, "micro": 0}
    (event,) = summary["main_events"]
    assert event["F_T_start_over_F_N"] == record.events["F_T_start"][1] / record.scene.F_N
    assert event["L_p_over_L"] == record.events["L_p_over_L"][1]
    assert event["t_stop"] is None  # slip goes on
    assert summary["timings"] == dict(record.timings)
    assert summary["files"] == [str(out)]


def test_quiet():
    assert run("--quiet", t_end="0.1 ms").output == ""


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (["--t-end", "3 kg"], ["t_end = '3 kg'", "does not convert to s"]),
        (["--t-end", "-1"], ["t_end = -1.0 s", ">= 0 s"]),
        (["--t-end", "nan"], ["t_end = nan s"]),
        (["--t-end", "1", "--dt", "1 s"], ["dt = 1.0 s", "stability limit"]),
        (["--t-end", "1", "--dt", "atuo"], ["dt = 'atuo'"]),
        (["--t-end", "1", "--sample", "0"], ["sample = 0.0 s", "> 0 s"]),
        (["--t-end", "1", "--sample", "2"], ["sample = 2.0 s", "at most 1 s"]),
        (["--t-end", "1", "--threads", "0"], ["--threads"]),
        (["--t-end", "1", "--geometry", "round"], ["--geometry", "finite", "linear"]),
        (["--t-end", "1", "--resume"], ["--resume", "--out"]),
        (["--t-end", "1", "--resume", "none.nc"], ["no record at none.nc"]),
        (["--t-end", "1", "--out", "none/a.nc"], ["--out none/a.nc", "No such file"]),
        (["--t-end", "1", "--out", "."], ["does not name a file"]),
        (["--t-end", "1", "--csv", "file/csv"], ["--csv"]),
        (["--t-end", "1", "--figure", "file/fig"], ["--figure"]),
        ([], ["--t-end"]),
    ],
)
def test_refused_runs(arguments, texts, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    monkeypatch.setattr(core, "advance", None)  # nothing may start
    assert refused(pyf("run", "fig1", *SMALL, *arguments), *texts)


def test_files_are_not_replaced(tmp_path):
    out = tmp_path / "a.nc"
    out.write_text("mine")
    assert refused(run("--out", out), "exists", "--overwrite")
    assert refused(run("--out", out, "--resume"), "not a pyfric record")
    assert out.read_text() == "mine"
    assert run("--out", out, "--overwrite").exit_code == Exit.COMPLETE
    assert refused(run("--out", out, "--resume", tmp_path / "other.nc"), "exists")


@pytest.fixture(scope="module")
def record_file(tmp_path_factory):
    """Return the record of `run`, which tests must not change."""
    out = tmp_path_factory.mktemp("record") / "a.nc"
    simulate(tiny(), 1.2e-3, sample=1e-5).save(out)
    return out


def test_resume(record_file, tmp_path):
    out, other = tmp_path / "a.nc", tmp_path / "b.nc"
    shutil.copy(record_file, out)
    arguments = ("--resume", record_file, "--out", other)
    assert run(*arguments, t_end="1.5 ms").exit_code == Exit.COMPLETE
    arguments = ("--resume", "--out", out, "--sample", "10 us")
    assert run(*arguments, t_end="1.5 ms").exit_code == Exit.COMPLETE
    whole = simulate(tiny(), 1.5e-3, sample=1e-5)
    assert same_run(pyfric.Record.load(out), whole, versions={})
    assert same_run(pyfric.Record.load(other), whole, versions={})


def test_resume_of_a_complete_run_does_nothing(record_file, monkeypatch):
    monkeypatch.setattr(core, "advance", None)
    result = run("--resume", record_file, "--json")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert json.loads(result.stdout)["timings"] == pyfric.Record.load(record_file).timings
    assert refused(run("--resume", record_file, t_end="0.2 ms"), "t_end")


@pytest.mark.parametrize(
    "option",
    [
        "--geometry=linear",
        "--dt=1 us",
        "--sample=1 ms",
        "--t-gap=2 ms",
        "--no-energies",
        "--stepper=verlet",
        "--switching=step_end",
        "--fidelity=hybrid",
    ],
)
def test_resume_keeps_the_method(option, record_file):
    name = option[2:].partition("=")[0].removeprefix("no-").replace("-", "_")
    assert refused(run("--resume", record_file, option), name, "cannot change")


@pytest.mark.parametrize("option", ["--tolerance=0.01", "--want=stress"])
@pytest.mark.parametrize("how", [("--resume",), ("--fidelity", "hybrid"), ("--method", "paper")])
def test_no_option_is_without_effect(how, option, record_file):
    how = (*how, record_file) if how == ("--resume",) else how
    name, value = option[2:].split("=")
    assert refused(run(*how, option), f"{name} = ", value, "has no effect; allowed: none")


def test_resume_needs_the_same_scene(record_file):
    assert refused(run("--resume", record_file, "--set", "mu_k=0.4"), "another scene")


def test_resume_may_have_another_speed(record_file, tmp_path):
    out = tmp_path / "slower.nc"
    slower = (*SMALL[:-1], "V=250 mm/s", "--t-end", "1.5 ms", "--out", out)
    assert pyf("run", "fig1", *slower, "--resume", record_file).exit_code == Exit.COMPLETE
    before, whole = pyfric.Record.load(record_file), pyfric.Record.load(out)
    t = float(before.curve["t"].iloc[-1])
    assert whole.scene.driver.protocol == ((t, 0.5), (t, 0.25))
    assert whole.curve[: len(before.curve) - 1].equals(before.curve[:-1])
    assert pyf("run", "fig1", *slower, "--resume").exit_code == Exit.COMPLETE


# --- fidelity and plan ---------------------------------------------------------------------------


@pytest.mark.parametrize("fidelity", ["quasistatic", "hybrid"])
def test_fidelity(fidelity, tmp_path):
    out = tmp_path / "a.nc"
    result = run("--fidelity", fidelity, "--out", out, "--figure", tmp_path / "fig")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert f"{fidelity} engine" in result.stdout
    assert ("dt = " in result.stdout) == (fidelity == "hybrid")
    too_fast = "note: quasistatic: while the slider relaxes"
    assert (too_fast in result.stdout) == (fidelity == "quasistatic")
    record = pyfric.Record.load(out)
    assert same_run(record, simulate(tiny(), 1.2e-3, fidelity=fidelity), versions={})
    assert (tmp_path / "fig.png").stat().st_size > 0
    longer = run("--resume", "--out", out, "--json", t_end="1.5 ms")
    assert json.loads(longer.stdout)["method"]["engine"] == fidelity
    assert pyfric.Record.load(out).curve["t"].iloc[-1] == pytest.approx(1.5e-3, abs=2e-6)


def test_auto_says_what_it_took():
    slow = ("run", "fig1", *SMALL[:-1], "V=0.5 mm/s", "--t-end", "1.2 s")
    result = pyf(*slow, "--want", "stress", "--tolerance", "0.1", "--json")
    summary = json.loads(result.stdout)
    assert summary["method"]["engine"] == "hybrid"
    levels = "for stress within 0.1: quasistatic, linear geometry, then hybrid, finite geometry"
    assert any(note.startswith(levels) for note in summary["notes"])
    single = pyf(*slow, "--tolerance", "0.1", "--verify", "none", "--json")
    assert json.loads(single.stdout)["counts"]["block_evaluations"] == 0
    text = run("--want", "motion").stdout
    assert "note: for motion within 0.01: dynamic, finite geometry" in text
    result = run("--tolerance", "0.1", "--energies", "--json")
    assert json.loads(result.stdout)["method"]["engine"] == "dynamic"


def test_the_method_is_always_named(tmp_path):
    out, ends = tmp_path / "a.nc", "stick-slip transitions at step ends, as in the paper"
    located = "stick-slip transitions located within time steps"
    result = run("--method", "paper", "--out", out, t_end="0.1 ms")
    assert f"dynamic engine, finite geometry, rk4, dt = 0.2 us, {ends}" in result.stdout
    for how in ((), ("--fidelity", "hybrid"), DYNAMIC):
        assert located in run(*how, t_end="0.1 ms").stdout
    method = json.loads(run("--json", "--verify", "none", t_end="0.1 ms").stdout)["method"]
    assert (method["stepper"], method["switching"]) == ("rk46", "located")
    again = ("--resume", "--out", out, "--method", "paper")
    assert ends in run(*again, t_end="0.11 ms").stdout
    simulate(tiny(), 1e-4).save(tmp_path / "b.nc")
    again = run("--resume", tmp_path / "b.nc", "--method", "paper")
    assert refused(again, "method = 'paper'", "cannot change")


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (["--fidelity", "fast"], ["--fidelity", "quasistatic", "hybrid", "dynamic"]),
        (["--method", "located"], ["--method", "paper"]),
        (["--method", "paper", "--dt", "1 us"], ["dt = 1e-06 s", "paper"]),
        (["--want", "speed"], ["--want", "front_speed"]),
        (["--tolerance", "0"], ["--tolerance = 0.0", "> 0 and <= 1"]),
        (["--tolerance", "nan"], ["tolerance = nan"]),
        (["--fidelity", "quasistatic", "--energies"], ["energies = True", "quasistatic"]),
        (["--fidelity", "quasistatic", "--dt", "1 us"], ["dt = 1e-06 s", "no time steps"]),
        (["--fidelity", "quasistatic", "--geometry", "finite"], ["geometry", "linear"]),
        (["--fidelity", "equilibrium", "--verify", "full"], ["verify = 'full'", "no event"]),
        (["--fidelity", "hybrid", "--accuracy", "2"], ["--accuracy = 2.0", "<= 1"]),
        (["--budget", "true"], ["--budget = True", "; --energies keeps"]),
        (["--budget", "0.5 x"], ["--budget", ">= 1"]),
    ],
)
def test_refused_fidelity(arguments, texts, monkeypatch):
    monkeypatch.setattr(core, "advance", None)
    assert refused(run(*arguments), *texts)


def test_plan():
    arguments = ("plan", "fig1", *SMALL, "--t-end", "5 ms", "--want", "stress")
    for tolerance in ("0.1", "0.01"):
        found = pyfric.plan(tiny(), "stress", float(tolerance), t_end=5e-3)
        result = pyf(*arguments, "--tolerance", tolerance)
        assert result.exit_code == Exit.COMPLETE
        lines = result.stdout.splitlines()
        assert len(lines) == len(str(found).splitlines())  # the lines hold measured times
        told = json.loads(pyf(*arguments, "--tolerance", tolerance, "--json").stdout)
        for name in ("want", "tolerance", "t_end", "lattice"):
            assert told[name] == getattr(found, name)
        for one, row in zip(found.levels, told["levels"], strict=True):
            assert row == dataclasses.asdict(one)
            assert any(one.cannot or str(one) in line for line in lines)


def test_plan_of_a_file_and_of_odd_scenes(tmp_path):
    tiny(eta=0.0).to_toml(tmp_path / "own.toml")
    told = json.loads(pyf("plan", tmp_path / "own.toml", "--json").stdout)
    assert [one["geometry"] for one in told["levels"]][:2] == ["linear", "finite"]
    assert {(one["engine"], one["stepper"]) for one in told["levels"]} == {("hybrid", "rk46_waves")}
    for change in ("V=0", "mu_k=0", "side=right", "K=1"):
        small = SMALL[:-2] if change.startswith("V") else SMALL
        end = () if change.startswith("V") else ("--t-end", "2 ms")
        command = ("plan", "fig1", *small, "--set", change, *end, "--tolerance", "0.5", "--json")
        result = pyf(*command)
        assert result.exit_code == Exit.COMPLETE, result.output
    told = json.loads(pyf("plan", "chain", "--t-end", "0", "--json").stdout)
    assert {one["engine"] for one in told["levels"][1:]} == {"dynamic"}


@pytest.mark.parametrize(
    ("arguments", "texts"),
    [
        (["fig"], ["preset = 'fig'"]),
        (["fig1", "--t-end", "-1"], ["t_end = -1.0 s"]),
        (["fig1", "--t-end", "3 kg"], ["t_end = '3 kg'"]),
        (["fig1", "--want", "all"], ["--want"]),
        (["fig1", "--tolerance", "2"], ["--tolerance"]),
        (["fig1", "--set", "h=7.6 mm"], ["driver.h"]),
    ],
)
def test_refused_plans(arguments, texts):
    assert refused(pyf("plan", *arguments), *texts)


def test_a_plan_without_a_loaded_state(monkeypatch):
    def fails(*arguments, **options):
        raise pyfric.EquilibriumError("no equilibrium", 1.0, 0.1, 9)

    monkeypatch.setattr(pyfric, "plan", fails)
    result = pyf("plan", "fig1")
    assert result.exit_code == Exit.FAILED
    assert "no equilibrium" in result.stderr


# --- failures ------------------------------------------------------------------------------------


@pytest.fixture
def broken(monkeypatch):
    """Make runs fail in their first event."""
    advance = core.advance

    def fails(model, state, *rest, **options):
        result = advance(model, state, *rest, **options)
        if state.t > 1.1e-3:
            state.y[:] = np.nan
        return result

    monkeypatch.setattr(core, "advance", fails)


@pytest.mark.usefixtures("broken")
def test_a_failed_run_is_saved(tmp_path):
    out = tmp_path / "a.nc"
    result = run("--out", out, "--json", "--csv", tmp_path / "csv")
    assert result.exit_code == Exit.FAILED
    assert "the motion is not finite" in result.stderr
    assert "Traceback" not in result.output
    assert json.loads(result.stdout)["status"].startswith("failed")
    assert pyfric.Record.load(out).status.startswith("failed")
    assert not (tmp_path / "csv").exists()


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (pyfric.EquilibriumError("no equilibrium", 1.0, 0.1, 9), Exit.FAILED, "no equilibrium"),
        (MemoryError(), Exit.FAILED, "out of memory"),
        (OSError(28, "No space left on device"), Exit.FAILED, "No space left"),
        (pyfric.StateError("no state"), Exit.BAD_INPUT, "no state"),
        (KeyboardInterrupt(), Exit.INTERRUPTED, "interrupted"),
    ],
)
def test_exit_codes(error, code, text, monkeypatch):
    def fails(*arguments, **options):
        raise error

    monkeypatch.setattr(pyfric, "simulate", fails)
    result = run()
    assert result.exit_code == code
    assert text in result.stderr
    assert "Traceback" not in result.output


def test_an_interrupted_run_without_out(monkeypatch):
    record = dataclasses.replace(simulate(tiny(), 1e-4), status="interrupted")
    monkeypatch.setattr(pyfric, "simulate", lambda *arguments, **options: record)
    result = run()
    assert result.exit_code == Exit.INTERRUPTED
    assert "nothing was saved" in result.stderr
    assert "interrupted at t" in result.stdout


# --- signals -------------------------------------------------------------------------------------


def test_sigterm_is_left_as_it_was():
    before = signal.getsignal(signal.SIGTERM)
    pyf("info")
    assert signal.getsignal(signal.SIGTERM) is before


# --- figures -------------------------------------------------------------------------------------


@pytest.fixture
def small_paper(monkeypatch):
    """Use one small run for every figure, and only figures for which one run is enough."""
    pyf("reproduce", "--help")  # the command asks for all figures when it is loaded
    job = pyfric.Job(scene=tiny(), t_end=1.2e-3, options={"fidelity": "hybrid"})
    monkeypatch.setattr("pyfric.paper.reproduction.RUNS", {"fig1": job, "fig4b": (job,)})
    for name in FIGURES.keys() - {"fig1b", "fig4b"}:
        monkeypatch.delitem(FIGURES, name)


@pytest.mark.usefixtures("small_paper")
def test_reproduce(tmp_path, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    out = tmp_path / "figures"
    result = pyf("reproduce", "--out", out)
    assert result.exit_code == Exit.COMPLETE, result.output
    written = {path.name for path in out.iterdir()}
    assert {"fig1b.png", "fig1b.pdf", "fig1b_curve.csv", "fig4b.png", "index.html"} <= written
    assert set(result.stdout.split()) == {str(out / name) for name in written}
    assert len(list((tmp_path / "kept").iterdir())) == 1

    monkeypatch.setattr(core, "advance", None)  # no new run
    result = pyf("reproduce", "fig1b", "--out", out, "--quiet")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert result.output == ""


@pytest.mark.usefixtures("small_paper")
def test_reproduce_without_cache(tmp_path, monkeypatch):
    monkeypatch.setattr("pyfric.paper.reproduction.save_figure", lambda *_: [])
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    result = pyf("reproduce", "all", "--no-cache", "--out", tmp_path / "out", "--workers", "1")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert not (tmp_path / "kept").exists()


@pytest.mark.usefixtures("small_paper", "broken")
def test_failed_reproduce(tmp_path):
    result = pyf("reproduce", "fig1b", "--no-cache", "--out", tmp_path)
    assert result.exit_code == Exit.FAILED
    assert "fig1 to t = 0.0012 s" in result.stderr
    assert "the motion is not finite" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.usefixtures("small_paper")
def test_interrupted_reproduce(tmp_path, monkeypatch):
    simulate = runs.simulate

    def stopped(*arguments, **options):
        return dataclasses.replace(simulate(*arguments, **options), status="interrupted")

    monkeypatch.setattr(runs, "simulate", stopped)
    result = pyf("reproduce", "fig1b", "--no-cache", "--out", tmp_path)
    assert result.exit_code == Exit.INTERRUPTED
    assert list(tmp_path.iterdir()) == []


def test_reproduce_names_are_those_of_the_figures():
    assert f"[{'|'.join(sorted(FIGURES))}|all]" in pyf("reproduce", "--help").stdout
    assert refused(pyf("reproduce", "fig2"), "'fig2' is not one of", "'fig2a'", "'all'")


def test_claims_are_added_to_the_page_of_figures(tmp_path):
    assert pyf("claims", "14", "--out", tmp_path).exit_code == Exit.COMPLETE
    page = tmp_path / "index.html"
    assert not page.exists()
    page.write_text("old", encoding="utf-8")
    result = pyf("claims", "14", "--out", tmp_path)
    assert str(page) in result.stdout
    rows = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))["claims"]
    assert all(mathematical(row["how"]) in page.read_text(encoding="utf-8") for row in rows)


def test_refused_reproduce(tmp_path):
    assert refused(pyf("reproduce", "fig2"), "fig2", "fig1b")
    (tmp_path / "file").touch()
    assert refused(pyf("reproduce", "--out", tmp_path / "file"), "--out")


def test_draw(tmp_path):
    result = pyf("draw", "setup2", "--set", "theta=0.5", "--out", tmp_path / "sketch")
    assert result.exit_code == Exit.COMPLETE, result.output
    names = ["sketch.png", "sketch.pdf", "sketch.txt", "sketch_columns.csv"]
    assert result.stdout.split() == [str(tmp_path / name) for name in names]
    assert "theta = 0.5" in (tmp_path / "sketch.txt").read_text(encoding="utf-8")
    file = tmp_path / "own.toml"
    tiny(name="own").to_toml(file)
    assert pyf("draw", file, "--out", tmp_path / "own", "--quiet").output == ""
    assert "Scene own" in (tmp_path / "own.txt").read_text(encoding="utf-8")
    assert refused(pyf("draw", "setup3"), "setup3")


@pytest.mark.slow
def test_movie(tmp_path, monkeypatch):
    stem = tmp_path / "event"
    result = pyf("movie", "fig1", *SMALL, "--t-end", "2 ms", "--event", 1, "--out", stem, "--quiet")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert result.output == ""
    assert {one.name for one in tmp_path.iterdir()} == {
        "event.png", "event.pdf", "event.txt", "event_interface.csv", "event_field.csv"
    }  # fmt: skip
    for name in ("new_field.csv", "new_interface.csv"):
        (tmp_path / name).touch()
        again = pyf("movie", "fig1", *SMALL, "--event", 1, "--out", tmp_path / "new")
        assert refused(again, f"{name}: the file exists")
        (tmp_path / name).unlink()
    record = simulate(tiny(), 2e-3, fidelity="hybrid")
    assert "Event 1 " in stem.with_suffix(".txt").read_text(encoding="utf-8")
    record.save(tmp_path / "run.nc")
    drawn = []
    monkeypatch.setattr(pyfric.figures, "save_figure", lambda fig, _: drawn.append(fig) or [])
    result = pyf("movie", tmp_path / "run.nc", "--event", 1, "--out", tmp_path / "again")
    assert result.exit_code == Exit.COMPLETE, result.output
    assert f"{record.method}; the event again" in result.stderr
    table = drawn[0].tables["field"].to_csv(index=False)
    assert stem.with_name("event_field.csv").read_bytes() == table.encode()
    assert refused(pyf("movie", tmp_path / "run.nc", "--event", 99), "event = 99", "1 to ")
    for scenes_only in (SMALL, ("--t-end", "1 s")):
        assert refused(pyf("movie", tmp_path / "run.nc", "--event", 1, *scenes_only), "--set and")
    assert refused(pyf("movie", "fig1"), "--event")
    new = tmp_path / "new"
    nothing = pyf("movie", "fig1", *SMALL, "--t-end", "0.1 ms", "--event", 1, "--out", new)
    assert refused(nothing, "event = 1", "nothing slipped")
    assert refused(pyf("movie", tmp_path / "none.nc", "--event", 1), "no record")


def test_help_waits_for_no_library():
    names = "{'numpy', 'pydantic', 'click'}"
    code = f"import sys; from pyfric.cli.commands import main; print(sys.modules.keys() & {names})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "{'click'}\n"


def test_public_names_are_there():
    assert all(pyfric.__getattr__(name) for name in [*pyfric.__all__, *pyfric.ROOMS])
    assert set(pyfric.__all__) <= set(dir(pyfric))
    with pytest.raises(AttributeError, match="pyfric has no 'engine'"):
        pyfric.engine  # noqa: B018


# --- outputs -------------------------------------------------------------------------------------

OUTPUTS = {
    "run": ("run", "fig1", *SMALL, "--t-end", "10 us"),
    "scene": ("scene", "fig1"),
    "regimes": ("regimes",),
    "draw": ("draw", "fig1"),
    "movie": ("movie", "fig1", "--event", "1"),
    "spacetime": ("spacetime", "fig1", "--event", "1"),
}
"""Commands whose --out is a file, or the stem of the names of files."""
ENDS = {"draw": ".png", "movie": ".png", "spacetime": ".png"}
FOLDERS = ("reproduce", "claims", "chart", "stability")
"""Commands whose --out is a folder."""


@pytest.mark.parametrize("name", OUTPUTS)
def test_one_rule_for_files(name, tmp_path):
    end = ENDS.get(name, "")
    (tmp_path / f"file{end}").write_text("mine")
    (tmp_path / f"folder{end}").mkdir()
    (tmp_path / f"device{end}").symlink_to("/dev/null")
    before = sorted(tmp_path.iterdir())

    def out(path, *more):
        return pyf(*OUTPUTS[name], "--out", path, *more)

    assert refused(out(tmp_path / "file"), "--out", "the file exists; --overwrite replaces it")
    for more in ((), ("--overwrite",)):
        assert refused(out(tmp_path / "none" / "a", *more), "--out", "No such file")
        assert refused(out(tmp_path / "file" / "a", *more) if not end else out("", *more), "--out")
        assert refused(out(tmp_path / "folder", *more), "--out", "Is a directory")
        assert refused(out(tmp_path / "device", *more), "--out", "Not a regular file")
        assert refused(out(f"{tmp_path}/new/", *more), "--out", "does not name a file")
        assert refused(out(".", *more), "--out", "does not name a file")
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / f"file{end}").read_text() == "mine"
    assert not os.path.isfile("/dev/null")


@pytest.mark.parametrize("name", FOLDERS)
def test_one_rule_for_folders(name, tmp_path):
    (tmp_path / "file").write_text("mine")
    scene = ["fig1"] if name in ("chart", "stability") else []
    assert refused(pyf(name, *scene, "--out", tmp_path / "file"), "--out", "Not a directory")
    assert refused(pyf(name, *scene, "--out", tmp_path / "none" / "a"), "--out", "No such file")
    assert refused(pyf(name, *scene, "--out", tmp_path / "file" / "a"), "--out", "Not a directory")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_is_read_is_never_replaced(tmp_path):
    path, link = tmp_path / "scene", tmp_path / "link"
    pyfric.preset("fig1").to_toml(path)
    link.symlink_to(path)
    text = path.read_text()
    for out in (path, link):
        for command in (("run", path, "--t-end", "10 us"), ("scene", path)):
            found = pyf(*command, "--out", out, "--overwrite")
            assert refused(found, "this file is read by the same command")
    assert path.read_text() == text


def test_another_record_that_is_read_is_not_replaced(record_file, tmp_path):
    link = tmp_path / "fig.png"
    os.link(record_file, link)
    found = run("--resume", link, "--figure", tmp_path / "fig", "--overwrite")
    assert refused(found, "--figure", "this file is read by the same command")


@pytest.mark.parametrize(
    ("command", "name", "text"),
    [
        ("run", "a.csv", "--out = 'a.csv': the file would be netCDF, not CSV; allowed: a name"),
        ("scene", "a.nc", "--out = 'a.nc': the file would be TOML, not netCDF"),
        ("show none.nc", "a.png", "--out = 'a.png': the file would be HTML, not PNG"),
        ("draw", "a.svg", "--out = 'a.svg': the file would be PNG, not SVG"),
        ("regimes", "a.nc", "--out = 'a.nc': the file would be CSV, not netCDF"),
    ],
)
def test_outputs_have_no_name_of_another_format(command, name, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert refused(pyf(*OUTPUTS.get(command, command.split()), "--out", name), text)
    assert list(tmp_path.iterdir()) == []


def test_a_figure_may_be_named_with_its_suffix(tmp_path):
    done = pyf(*OUTPUTS["run"], "--figure", tmp_path / "x.png")
    assert done.exit_code == 0, done.output
    names = {"x.png", "x.pdf", "x.txt", "x_curve.csv", "x_slip.csv"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert refused(pyf(*OUTPUTS["run"], "--figure", "x.csv"), "--figure = 'x.csv'", "not CSV")
    assert refused(pyf(*OUTPUTS["run"], "--figure", "none/x"), "--figure none/x", "No such file")


def test_all_files_of_a_figure_are_checked(tmp_path):
    done = pyf(*OUTPUTS["run"], "--figure", tmp_path / "a", "--csv", tmp_path / "d")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "d" / "curve.csv").exists()
    assert pyf("draw", "fig1", *SMALL, "--out", tmp_path / "b").exit_code == 0
    for path in sorted(tmp_path.glob("?[._]*")):
        folder = tmp_path / f"with {path.name}"
        folder.mkdir()
        (folder / path.name).write_text("mine")
        words = (*OUTPUTS["run"], "--figure") if path.name[0] == "a" else ("draw", "fig1", "--out")
        assert refused(pyf(*words, folder / path.name[0]), "the file exists"), path
        assert (folder / path.name).read_text() == "mine"


def test_overwrite_draws_again(tmp_path):
    for more in ((), ("--overwrite",)):
        assert pyf("draw", "fig1", *SMALL, "--out", tmp_path / "a", *more).exit_code == 0
    assert pyf("draw", "fig1", *SMALL, "--out", tmp_path / "a").exit_code == Exit.BAD_INPUT


def test_a_run_that_cannot_be_saved_is_kept_elsewhere(tmp_path, monkeypatch):
    save = pyfric.Record.save

    def full(record, path, **how):
        if path == tmp_path / "a.nc":
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return save(record, path, **how)

    monkeypatch.setattr(pyfric.Record, "save", full)
    (tmp_path / "other").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "other"))
    found = dynamic("--out", tmp_path / "a.nc", t_end="10 us")
    assert found.exit_code == Exit.FAILED
    (kept,) = (tmp_path / "other").iterdir()
    said = f"No space left on device: '{tmp_path / 'a.nc'}'; the record is in {kept}"
    assert said in found.stderr
    assert pyfric.Record.load(kept).status == "complete"


def test_a_run_that_cannot_be_saved_names_its_file(tmp_path, monkeypatch):
    def full(record, path, **how):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(pyfric.Record, "save", full)
    found = dynamic("--out", tmp_path / "a.nc", t_end="10 us")
    assert found.exit_code == Exit.FAILED
    assert f"No space left on device: '{tmp_path / 'a.nc'}'" in found.stderr


# --- two commands at once ------------------------------------------------------------------------


def test_an_output_that_another_command_makes_is_refused(tmp_path):
    file, out = tmp_path / "sweep.toml", tmp_path / "out"
    file.write_text('scene = "setup1"\nt_end = "10 us"\n[over]\nh = ["5 mm"]\n')
    sweep = ("sweep", file, "--out", out)
    with claimed(out, "another sweep"):
        assert refused(pyf(*sweep), f"--out {out}: process {os.getpid()}", "writes other results")
    with claimed(tmp_path / "a.nc", "another run"):
        assert refused(run("--out", tmp_path / "a.nc"), "a.nc: process")
    with claimed(out, "the claims of another process"):
        assert refused(pyf("reproduce", "fig1a", "--out", out), f"--out {out}: process")
        assert refused(pyf("claims", "E1", "--out", out), f"--out {out}: process")
    with claimed(file / "sweep.toml", "in no folder"):
        pass  # without locks nobody is refused
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.toml"}


def test_the_same_output_twice_is_made_twice(tmp_path):
    out = tmp_path / "out"
    with claimed(out, "this"), claimed(out, "this"):
        assert [path.name for path in tmp_path.iterdir()] == [".out.running"]
    assert not list(tmp_path.iterdir())
