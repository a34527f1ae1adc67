"""Sweeps: their points, limits, results, and the command."""

import contextlib
import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from click.testing import CliRunner
from helpers import small

from pyfric.cli import main
from pyfric.engines import Options, RunError, expected, simulate
from pyfric.record import Record, analysis
from pyfric.scene import SceneError
from pyfric.sweeps import Span, Sweep, points, store, sweep

OPTIONS = Options(fidelity="quasistatic")


def one(**changes):
    rest = {"over": {"interface.mu_k": [0.3, 0.4]}, "options": OPTIONS} | changes
    return Sweep(**{"scene": small(), "t_end": 1.2e-3} | rest)


FILE = """
scene = "scene.toml"
t_end = "1.2 ms"

[over]
"interface.mu_k" = [0.3, 0.4]
driver.h = { from = "2.5 mm", to = "7.5 mm", step = "2.5 mm" }

[options]
fidelity = "quasistatic"
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv(store.CACHE_VARIABLE, str(tmp_path / "cache"))
    small().to_toml(tmp_path / "scene.toml")
    path = tmp_path / "sweep.toml"
    path.write_text(FILE)
    return path


def command(*arguments):
    return CliRunner().invoke(main, ["sweep", *map(str, arguments)])


# --- points --------------------------------------------------------------------------------------


def test_a_grid_takes_all_combinations():
    found = one(over={"driver.h": [2.5e-3, 5e-3], "t_end": [1e-3, 2e-3, 3e-3]})
    assert [tuple(at.values()) for at in found.at()] == [
        (h, t) for h in (2.5e-3, 5e-3) for t in (1e-3, 2e-3, 3e-3)
    ]
    assert [(job.scene.driver.h, job.t_end) for job in found.jobs()] == [
        tuple(at.values()) for at in found.at()
    ]


def test_a_list_goes_through_all_fields_at_once():
    over = {"slider.L": [0.02, 0.04], "slider.l": [2.5e-3, 5e-3], "options.t_gap": [1e-3, 2e-3]}
    scenes = one(points="list", over=over, scene=small(H=0.01, h=5e-3)).jobs()
    assert [(job.scene.slider.L, job.scene.slider.l) for job in scenes] == [
        (0.02, 2.5e-3),
        (0.04, 5e-3),
    ]
    assert [job.options.t_gap for job in scenes] == [1e-3, 2e-3]
    assert all(job.options.fidelity == "quasistatic" for job in scenes)
    with pytest.raises(SceneError, match="as many values"):
        one(points="list", over={"driver.h": [5e-3], "t_end": [1.0, 2.0]})


@pytest.mark.parametrize("kind", ["random", "sobol", "halton", "latin"])
def test_drawn_points_follow_their_seed_and_ranges(kind):
    over = {
        "driver.K": Span(start=1e5, stop=1e7, scale="log"),
        "driver.h": Span(start=2.5e-3, stop=1e-2, step=2.5e-3),
    }
    found = one(points=kind, n=100, seed=3, over=over)
    rows = pd.DataFrame(found.at())
    assert len(rows) == 100
    assert rows.equals(pd.DataFrame(found.at()))
    assert not rows.equals(pd.DataFrame(dataclasses.replace(found, seed=4).at()))
    assert rows["driver.K"].between(1e5, 1e7).all()
    assert 0.3 < (rows["driver.K"] < 1e6).mean() < 0.7  # even in the logarithm
    assert set(rows["driver.h"]) == {2.5e-3, 5e-3, 7.5e-3, 1e-2}
    assert all(isinstance(job, sweep.Job) for job in found.jobs())


def test_low_discrepancy_fills_better_than_chance():
    over = {"interface.mu_k": Span(start=0.1, stop=0.5)}
    for kind in ("sobol", "halton", "latin"):
        rows = np.sort([at["interface.mu_k"] for at in one(points=kind, n=64, over=over).at()])
        assert np.diff(rows).max() < 3 * 0.4 / 64


def test_ranges():
    assert Span(start=1.0, stop=100.0, n=3, scale="log").values("x") == [1.0, 10.0, 100.0]
    assert Span(start=2e-3, stop=1e-2, step=2e-3).values("x") == [2e-3, 4e-3, 6e-3, 8e-3, 1e-2]


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("did you mean 'interface.mu_k'", {"over": {"interface.muk": [0.3]}}),
        ("over", {"over": {}}),
        ("over.driver.h", {"over": {"driver.h": []}}),
        ("over.driver.h", {"over": {"driver.h": "5 mm"}}),
        ("how many", {"over": {"driver.h": Span(start=1.0, stop=2.0)}}),
        ("from < to", {"over": {"driver.h": Span(start=2.0, stop=1.0, n=2)}}),
        ("over.driver.h", {"over": {"driver.h": Span(start=0.0, stop=1.0, n=2, scale="log")}}),
        ("a range", {"points": "sobol", "n": 8}),
        ("n", {"points": "random", "over": {"driver.h": Span(start=1.0, stop=2.0)}}),
        ("points", {"points": "cube"}),
        ("limits.max_GB", {"max_GB": 0.0}),
        ("at most", {"over": {"driver.h": Span(start=0.0, stop=1.0, step=1e-9)}}),
    ],
)
def test_bad_sweeps_are_refused(name, changes):
    with pytest.raises(SceneError, match=name):
        one(**changes)


# --- runs ----------------------------------------------------------------------------------------


def test_results_are_those_of_simulate_with_units(tmp_path):
    found = one(over={"interface.mu_k": [0.3, 0.4], "driver.h": [2.5e-3, 5e-3]}).run(
        tmp_path, workers=1, progress=False
    )
    assert found.done
    table, axes = found.table, found.to_xarray()
    record = simulate(small(mu_k=0.4, h=2.5e-3), 1.2e-3, OPTIONS, progress=False)
    (row,) = table.query("`interface.mu_k` == 0.4 and `driver.h` == 0.0025").to_dict("records")
    assert row["events"] == len(record.events) > 0
    assert row["F_max"] == record.curve["F_T"].max()
    assert row["precursors"] == len(analysis.precursor_lengths(record))
    assert (row["status"], row["engine"]) == ("complete", "quasistatic, linear")
    at = axes.sel({"interface.mu_k": 0.4, "driver.h": 2.5e-3})
    assert float(at["F_max"]) == row["F_max"]
    assert axes["F_max"].shape == (2, 2)
    assert axes["F_max"].attrs["units"] == "N"
    assert axes["driver.h"].attrs["units"] == "m"


def test_failed_and_refused_points_are_named_and_the_others_run(tmp_path, monkeypatch):
    run = sweep.simulate

    def failing(scene, *arguments, **options):
        if scene.interface.mu_k == 0.35:
            raise RunError("the lattice folds", run(scene, 1e-5, OPTIONS))
        return run(scene, *arguments, **options)

    monkeypatch.setattr(sweep, "simulate", failing)
    found = one(over={"interface.mu_k": [0.3, 0.35, 0.9, 0.4]}).run(tmp_path, workers=1)
    assert list(found.table["status"]) == ["complete", "failed", "refused", "complete"]
    assert "the lattice folds" in found.failed["reason"][1]
    assert "mu_k" in found.failed["reason"][2]
    assert not found.done
    assert math.isnan(found.table["F_max"][1])
    later = found.sweep.status(tmp_path)
    assert list(later.table["status"]) == list(found.table["status"])
    assert list(later.failed["reason"]) == list(found.failed["reason"])
    assert found.sweep.estimate(tmp_path)[:3] == (4, 1, 2)
    monkeypatch.undo()
    assert list(found.sweep.run(tmp_path, workers=1).failed["status"]) == ["refused"]
    assert list(found.sweep.status(tmp_path).failed["status"]) == ["refused"]
    assert not list(tmp_path.glob(".*"))


def test_a_sweep_goes_on_where_it_stopped(tmp_path, monkeypatch):
    made, run = [], sweep.simulate
    monkeypatch.setattr(sweep, "simulate", lambda *a, **k: made.append(a) or run(*a, **k))
    one().run(tmp_path, workers=1)
    longer = one(over={"interface.mu_k": [0.3, 0.35, 0.4]})
    assert list(longer.status(tmp_path).table["status"]) == ["complete", "waiting", "complete"]
    longer.run(tmp_path, workers=1)
    assert len(made) == 3


def test_limits_refuse_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(points, "run_all", None)
    for limit in ({"max_hours": 1e-9}, {"max_GB": 1e-9}):
        with pytest.raises(SceneError, match=next(iter(limit))):
            one(**limit).run(tmp_path)


def test_the_estimate_is_about_right(tmp_path):
    what = one(scene=small("free"), over={"interface.mu_k": [0.3, 0.35, 0.4]}, t_end=4e-3)
    before = what.estimate(tmp_path)
    what.run(tmp_path, workers=1)
    size = sum(path.stat().st_size for path in tmp_path.glob("*.nc")) / 1e9
    assert before.points == 3
    assert size / 5 < before.GB < size * 5
    assert what.estimate(tmp_path) == (3, 0, 3, 0.0, 0.0)


def test_the_estimate_holds_what_measuring_errors_takes(monkeypatch):
    found = expected.plan(small(), t_end=1.2e-3)
    assert found.fidelity != "quasistatic"
    monkeypatch.setattr(expected, "plan", lambda *_, **__: found)
    hours = {
        verify: one(options=Options(verify=verify)).estimate(cache=False).hours
        for verify in ("none", None, "full")
    }
    assert hours["none"] == pytest.approx(2 * found.seconds / 3600)
    assert hours[None] == pytest.approx(2 * (found.seconds + found.price) / 3600)
    assert hours["full"] > hours["none"]


# --- files and the command -----------------------------------------------------------------------


def test_a_file_says_the_same(file):
    what = Sweep.from_toml(file)
    assert what.scene == small()
    assert what.at() == [
        {"interface.mu_k": mu, "driver.h": h} for mu in (0.3, 0.4) for h in (2.5e-3, 5e-3, 7.5e-3)
    ]
    file.write_text('scene = "fig1"\nt_end = "1 s"\n[over]\noptions.dt = ["auto", "0.2 us"]')
    assert [job.options.dt for job in Sweep.from_toml(file).jobs()] == ["auto", 2e-7]


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('"2.5 mm", to', "2.5, to", "missing unit"),
        ("0.3, 0.4", '"a"', "a number is needed"),
        ("[options]", "[option]", "did you mean 'options'"),
        ("fidelity", "fidelty", "fidelty"),
        ("step =", "stepp =", "did you mean 'step'"),
        ('"1.2 ms"', "1.2", "missing unit"),
        ("scene.toml", "nothing.toml", "cannot be read"),
        ("[over]", "[over", "not TOML"),
        ('t_end = "1.2 ms"', "", "t_end: missing"),
        ("[options]", "[limits]\nmax_hour = 1\n[options]", "did you mean 'max_hours'"),
    ],
)
def test_mistakes_in_a_file_are_refused(file, old, new, text):
    file.write_text(FILE.replace(old, new))
    found = command(file)
    assert found.exit_code == 2, found.output
    assert text in found.output


def test_the_command_runs_and_goes_on(file, tmp_path):
    dry = json.loads(command(file, "--dry-run", "--json").stdout)
    assert (dry["points"], dry["finished"]) == (6, 0)
    assert not list(tmp_path.glob("cache/*.nc"))
    assert json.loads(command(file, "--status", "--json").stdout)["status"] == {"waiting": 6}
    out = tmp_path / "out"
    found = command(file, "--out", out, "--workers", 1)
    assert found.exit_code == 0, found.output
    assert "6 complete" in found.stdout
    table = pd.read_csv(out / "sweep.csv")
    assert list(table["status"]) == 6 * ["complete"]
    assert pd.read_parquet(out / "sweep.parquet")["F_max"].to_list() == table["F_max"].to_list()
    with xr.open_dataset(out / "sweep.nc") as axes:
        assert axes["events"].shape == (2, 3)
    assert all((tmp_path / "cache" / f"{key}.nc").exists() for key in table["key"])
    assert "6 finished" in command(file, "--dry-run").stdout
    assert command(file, "--out", out, "--workers", 1).exit_code == 0  # the same folder again


def test_the_command_names_what_failed(file):
    file.write_text(FILE.replace("0.3, 0.4", "0.3, 0.9"))
    found = command(file, "--workers", 1)
    assert found.exit_code == 1
    assert found.stderr.count("refused") == 3
    assert "interface.mu_k = 0.9" in found.stderr


def test_ctrl_c_ends_the_command_with_its_code(file, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(points, "run_all", interrupted)
    assert command(file).exit_code == 130


@pytest.mark.slow
def test_ctrl_c_in_a_terminal_keeps_points_and_leaves_no_process(file, tmp_path):
    command(file, "--workers", 1)
    kept = tmp_path / "cache"
    before = sorted(kept.iterdir())
    file.write_text(FILE.replace("1.2 ms", "100 s").replace("quasistatic", "dynamic"))
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "pyfric.cli", "sweep", str(file), "--workers", "2"],
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    while process.poll() is None and not list(kept.glob(".*.running")):
        time.sleep(0.02)
    begin = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    stderr = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 130, stderr
    assert stderr.endswith("interrupted\n")
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() - begin < 30:  # three on idle processors
            os.killpg(process.pid, 0)
            time.sleep(0.02)
    assert time.monotonic() - begin < 30
    assert sorted(kept.iterdir()) == before


def test_a_record_of_a_sweep_is_a_record(tmp_path):
    found = one().run(tmp_path, workers=1)
    assert all(isinstance(record, Record) for record in found.outcomes)
