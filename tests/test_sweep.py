"""Sweeps: varied fields, points, limits, results and means over seeds, files, the command."""

import dataclasses
import errno
import json
import math
import os
import subprocess
import sys
import tomllib

import h5py
import numpy as np
import pandas as pd
import pytest
import tomli_w
import xarray as xr
from click.testing import CliRunner
from helpers import refused, small
from hypothesis import given
from hypothesis import strategies as st

from pyfric.cli.commands import main
from pyfric.engines import Options, RunError
from pyfric.planning import simulate
from pyfric.record import Record, analysis
from pyfric.scene import Spread, laws, preset
from pyfric.sweeps import Job, Span, Sweep, runs, sweep
from pyfric.values import SceneError

OPTIONS = Options(fidelity="quasistatic")
RANDOM = small().replace({"interface.mu_s": Spread(mean=0.7, std=0.02)})


def swept(**changes):
    rest = {"over": {"interface.mu_k": [0.3, 0.4]}, "options": OPTIONS} | changes
    return Sweep(**{"scene": small(), "t_end": 1.2e-3} | rest)


FILE = """
scene = "scene.toml"
t_end = "1.2 ms"

[over]
mu_k = [0.3, 0.4]
driver.h = { from = "2.5 mm", to = "7.5 mm", step = "2.5 mm" }

[options]
fidelity = "quasistatic"
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "cache"))
    small().to_toml(tmp_path / "scene.toml")
    path = tmp_path / "sweep.toml"
    path.write_text(FILE)
    return path


def command(*arguments):
    return CliRunner().invoke(main, ["sweep", *map(str, arguments)])


# --- points --------------------------------------------------------------------------------------


def test_a_grid_takes_all_combinations():
    found = swept(over={"driver.h": [2.5e-3, 5e-3], "t_end": [1e-3, 2e-3, 3e-3]})
    expected = [(h, t) for h in (2.5e-3, 5e-3) for t in (1e-3, 2e-3, 3e-3)]
    assert list(found.rows.itertuples(index=False, name=None)) == expected
    assert [(job.scene.driver.h, job.t_end) for job in found.jobs] == expected


@pytest.mark.parametrize("name", ["fig1", "chain", "slow", "run1"])
def test_a_named_preset_is_made_at_each_point(name, tmp_path):
    """Values that a preset derives from l, L or k change with them; a scene's do not."""
    over = {"l": ["5 mm", 2.5e-3], "slider.L": [0.07]} | ({"k": [1e7]} if name == "slow" else {})
    grid = dataclasses.replace(swept(scene=name, over=over, options={}), t_end=1e-3)
    values = grid.rows.to_dict("records")
    assert [job.scene for job in grid.jobs] == [preset(name, row) for row in values]
    document = {"scene": name, "t_end": "1 ms", "over": {"l": ["5 mm", "2.5 mm"]}}
    (tmp_path / "sweep.toml").write_text(tomli_w.dumps(document))
    of_file = Sweep.from_toml(tmp_path / "sweep.toml")
    assert [job.scene for job in of_file.jobs] == [preset(name, l=l) for l in (5e-3, 2.5e-3)]
    as_it_is = swept(scene=preset(name), over=over, options={})
    assert [job.scene for job in as_it_is.jobs] == [preset(name).replace(row) for row in values]
    assert {job.key for job in grid.jobs}.isdisjoint(job.key for job in as_it_is.jobs)
    assert grid != as_it_is


def test_a_list_goes_through_all_fields_at_once_and_so_do_the_rows_of_a_frame():
    over = {"slider.L": [0.02, 0.04], "slider.l": [2.5e-3, 5e-3], "options.t_gap": [1e-3, 2e-3]}
    scene = small(H=0.01, h=5e-3)
    found = swept(points="list", over=over, scene=scene)
    jobs = [(job.scene.slider.L, job.scene.slider.l, job.options.t_gap) for job in found.jobs]
    assert jobs == [(0.02, 2.5e-3, 1e-3), (0.04, 5e-3, 2e-3)]
    assert all(job.options.fidelity == "quasistatic" for job in found.jobs)
    assert swept(over=pd.DataFrame(over), scene=scene).jobs == found.jobs
    with pytest.raises(SceneError, match="as many values"):
        swept(points="list", over={"driver.h": [5e-3], "t_end": [1.0, 2.0]})


def test_anything_that_a_scene_has_may_vary():
    """Seeds, random fields, lists, laws and sides may vary, as in a scene file or as objects."""
    over = {
        "interface.mu_s": [Spread(mean=0.7, std=0.01), 0.8, (0.7,) * 9],
        "interface.law": [
            laws.Ageing(B=0.01, t_c=1e-3),
            laws.LinearWeakening(),
            laws.Ageing(B=0.02, t_c=1e-3),
        ],
        "side": ["left", "right", "left"],
        "top": [small().top, small("free").top, small().top],
        "h": ["5 mm", 7.5e-3, np.float64(5e-3)],
        "driver.protocol": [(), ((1e-3, 0.4),), ()],
    }
    found = swept(points="list", over=over, t_end="1.2 ms", options=Options())
    assert found.t_end == 1.2e-3
    assert list(found.rows["driver.h"]) == [5e-3, 7.5e-3, 5e-3]
    names = ["interface.mu_s", "interface.law", "driver.side", "top", "driver.h", "driver.protocol"]
    assert list(found.over) == names
    for job, (_, row) in zip(found.jobs, found.rows.iterrows(), strict=True):
        assert isinstance(job, Job), job
        for name in names:
            part, _, field = name.partition(".")
            value = getattr(job.scene, part)
            assert (getattr(value, field) if field else value) == row[name]


def test_what_is_inside_a_field_may_vary():
    scene = RANDOM.replace({"interface.law": laws.Ageing(B=0.01, t_c=1e-3)})
    over = {"interface.mu_s.seed": np.arange(3), "interface.law.t_c": ["1 ms", 2e-3]}
    jobs = swept(scene=scene, over=over, options=Options()).jobs
    found = [(job.scene.interface.mu_s.seed, job.scene.interface.law.t_c) for job in jobs]
    assert found == [(seed, t_c) for seed in range(3) for t_c in (1e-3, 2e-3)]
    assert len({job.key for job in jobs}) == 6
    whole = {"interface.mu_s": [Spread(mean=0.6, std=0.01), 0.7], "interface.mu_s.seed": [4, 4]}
    first, second = swept(scene=scene, over=whole, points="list", options=Options()).jobs
    assert first.scene.interface.mu_s == Spread(mean=0.6, std=0.01, seed=4)
    assert "which has no seed" in str(second)


@pytest.mark.parametrize("kind", ["random", "sobol", "halton", "latin"])
def test_drawn_points_follow_their_seed_and_ranges(kind):
    over = {
        "driver.K": Span(start=1e5, stop=1e7, scale="log"),
        "driver.h": Span(start=2.5e-3, stop=1e-2, step=2.5e-3),
    }
    found = swept(points=kind, n=100, seed=3, over=over)
    rows = found.rows
    assert len(rows) == 100
    assert rows.equals(dataclasses.replace(found).rows)
    assert not rows.equals(dataclasses.replace(found, seed=4).rows)
    assert rows["driver.K"].between(1e5, 1e7).all()
    assert 0.3 < (rows["driver.K"] < 1e6).mean() < 0.7  # even in its logarithm
    assert set(rows["driver.h"]) == {2.5e-3, 5e-3, 7.5e-3, 1e-2}
    assert all(isinstance(job, Job) for job in found.jobs)
    if kind != "random":  # more even than random
        assert np.diff(np.sort(np.log10(rows["driver.K"].astype(float)))).max() < 3 * 2 / 100


def test_a_point_that_is_far_too_long_spoils_no_estimate():
    ends = swept(over={"t_end": [1e-3, 1e9]}, options={})
    one = swept(over={"t_end": [1e-3]}, options={})
    assert ends.estimate(cache=None).hours == pytest.approx(one.estimate(cache=None).hours, rel=0.5)


def test_numbers_of_points_are_whole():
    over = {"driver.h": Span(start=2.5e-3, stop=1e-2, n=np.int64(3))}
    assert len(swept(over=over).jobs) == 3
    assert len(swept(over=over, points="sobol", n=np.int64(2), seed=np.uint8(3)).jobs) == 2
    refused(lambda: swept(over=over, points="random", n=2.0), "n")
    refused(lambda: Sweep.from_toml(5), "sweep")


def test_ranges():
    assert Span(start=1.0, stop=100.0, n=3, scale="log").values("x") == [1.0, 10.0, 100.0]
    assert Span(start=2e-3, stop=1e-2, step=2e-3).values("x") == [2e-3, 4e-3, 6e-3, 8e-3, 1e-2]
    span = Span(start=1, stop=4, step=1)
    whole = [*span.values("x"), span.at(0.2), span.at(1.0)]
    assert whole == [1, 2, 3, 4, 2, 4]
    assert {type(number) for number in whole} == {int}
    assert Span(start=0, stop=10, step=6).at(1.0) == 6  # not 12, beyond the range
    seeds = {"interface.mu_s.seed": Span(start=1, stop=9, step=1)}
    jobs = swept(scene=RANDOM, over=seeds, points="random", n=4).jobs
    assert all(isinstance(job, Job) for job in jobs), jobs


@given(st.sampled_from(["linear", "log"]), st.floats(1e-9, 1e9), st.floats(1.001, 1e9))
def test_a_share_of_a_range_is_where_its_value_is(scale, start, ratio):
    span = Span(start=start, stop=start * ratio, scale=scale)
    for share in (0.0, 0.3, 1.0):
        assert span.share(span.at(share)) == pytest.approx(share, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("did you mean 'interface.mu_k'", {"over": {"interface.muk": [0.3]}}),
        ("each field once", {"over": {"interface.mu_k": [0.3], "mu_k": [0.3]}}),
        ("in several parts", {"over": {"protocol": [()]}}),
        ("interface.mu_s.seed: unknown|unknown", {"over": {"interface.mu_s.seed": [1]}}),
        ("over", {"over": {}}),
        ("over", {"over": "h"}),
        ("over", {"over": ["h"]}),
        ("over.5", {"over": {5: [1]}}),
        ("over.driver.h", {"over": {"driver.h": []}}),
        ("over.driver.h", {"over": {"driver.h": "5 mm"}}),
        ("over.driver.h", {"over": {"driver.h": 5e-3}}),
        ("how many", {"over": {"driver.h": Span(start=1.0, stop=2.0)}}),
        ("a range", {"points": "sobol", "n": 8}),
        ("n", {"points": "random", "over": {"driver.h": Span(start=1.0, stop=2.0)}}),
        ("points", {"points": "cube"}),
        ("n = 3: .*'grid' are not drawn", {"n": 3}),
        ("limits.max_GB", {"max_GB": 0.0}),
        ("at most", {"over": {"driver.h": Span(start=0.0, stop=1.0, step=1e-9)}}),
        ("at most", {"over": dict.fromkeys(("h", "K", "V"), Span(start=1.0, stop=2.0, n=1000))}),
    ],
)
def test_bad_sweeps_are_refused(text, changes):
    with pytest.raises(SceneError, match=text):
        swept(**changes)


@pytest.mark.parametrize(
    ("field", "changes"),
    [
        ("start", {"start": 2.0}),
        ("start", {"start": 0.0, "scale": "log"}),
        ("scale", {"scale": "cubic"}),
        ("step", {"step": 0.0}),
        ("n", {"n": 1}),
        ("n", {"n": 2.0}),
        ("n", {"n": 2, "step": 0.5}),
        ("scale", {"scale": "log", "step": 0.5}),
    ],
)
def test_bad_ranges_are_refused(field, changes):
    refused(lambda: Span(**{"start": 1.0, "stop": 2.0} | changes), field)


def test_ranges_of_text_have_the_unit_of_their_field():
    found = swept(over={"h": Span(start="2.5 mm", stop=5e-3, n=2)}).over
    assert found == {"driver.h": [2.5e-3, 5e-3]}
    by_steps = Span(start="2.5 mm", stop="7.5 mm", step="2.5 mm")
    assert swept(over={"h": by_steps}).over == {"driver.h": [2.5e-3, 5e-3, 7.5e-3]}
    for span, field in (
        (Span(start="2.5 N", stop=5e-3, n=2), "over.driver.h.start"),
        (Span(start="5 mm", stop=2e-3, n=2), "start"),
        (Span(start="0 mm", stop=2e-3, n=2, scale="log"), "start"),
    ):
        refused(lambda span=span: swept(over={"h": span}), field)


# --- runs ----------------------------------------------------------------------------------------


def test_results_are_those_of_simulate_with_units(tmp_path):
    found = swept(over={"interface.mu_k": [0.3, 0.4], "driver.h": [2.5e-3, 5e-3]}).run(
        tmp_path, workers=1, progress=False
    )
    assert set(found.table["status"]) == {"complete"}
    table, axes = found.table, found.to_xarray()
    record = simulate(small(mu_k=0.4, h=2.5e-3), 1.2e-3, OPTIONS, progress=False)
    (row,) = table.query("`interface.mu_k` == 0.4 and `driver.h` == 0.0025").to_dict("records")
    assert row["n_events"] == len(record.events) > 0
    assert row["F_max"] == record.curve["F_T"].max()
    assert row["n_precursors"] == len(analysis.precursor_lengths(record))
    assert (row["status"], row["engine"]) == ("complete", "quasistatic, linear")
    at = axes.sel({"interface.mu_k": 0.4, "driver.h": 2.5e-3})
    assert float(at["F_max"]) == row["F_max"]
    assert axes["F_max"].shape == (2, 2)
    assert axes["F_max"].attrs["units"] == "N"
    assert axes["driver.h"].attrs["units"] == "m"


def test_failed_and_refused_points_are_named_and_the_others_run(tmp_path, monkeypatch):
    run = runs.simulate

    def failing(scene, *arguments, **options):
        if scene.interface.mu_k == 0.35:
            raise RunError("the lattice folds", run(scene, 1e-5, OPTIONS))
        return run(scene, *arguments, **options)

    monkeypatch.setattr(runs, "simulate", failing)
    found = swept(over={"interface.mu_k": [0.3, 0.35, 0.9, 0.4]}).run(tmp_path, workers=1)
    assert list(found.table["status"]) == ["complete", "failed", "refused", "complete"]
    assert "the lattice folds" in found.failed["reason"][1]
    assert "mu_k" in found.failed["reason"][2]
    assert math.isnan(found.table["F_max"][1])
    later = found.sweep.status(tmp_path)
    assert list(later.table["status"]) == list(found.table["status"])
    assert list(later.failed["reason"]) == list(found.failed["reason"])
    assert found.sweep.estimate(tmp_path)[:3] == (4, 1, 2)
    monkeypatch.undo()
    assert list(found.sweep.run(tmp_path, workers=1).failed["status"]) == ["refused"]
    assert {path.suffix for path in tmp_path.iterdir()} == {".nc"}


def test_a_sweep_goes_on_where_it_stopped_with_large_lattices_first(tmp_path, monkeypatch):
    made, run = [], runs.simulate
    monkeypatch.setattr(runs, "simulate", lambda *a, **k: made.append(a[0]) or run(*a, **k))
    swept().run(tmp_path, workers=1)
    longer = swept(over={"interface.mu_k": [0.3, 0.35, 0.4]})
    assert list(longer.status(tmp_path).table["status"]) == ["complete", "waiting", "complete"]
    longer.run(tmp_path, workers=1)
    assert len(made) == 3
    lengths = swept(over={"slider.L": [0.02, 0.04, 0.03]}).run(tmp_path, workers=1)
    assert [scene.slider.L for scene in made[3:]] == [0.04, 0.03, 0.02]
    assert [record.scene.slider.L for record in lengths.outcomes] == [0.02, 0.04, 0.03]


def test_means_over_seeds_have_standard_errors(tmp_path):
    what = swept(scene=RANDOM, over={"mu_k": [0.3, 0.4], "interface.mu_s.seed": range(4)})
    assert what.status(tmp_path).mean("F_first")["n"].to_list() == [0, 0]
    found = what.run(tmp_path, workers=1)
    mean, table = found.mean("F_first"), found.table
    assert mean.columns.to_list() == ["interface.mu_k", "mean", "standard_error", "n"]
    for mu_k, rows in table.groupby("interface.mu_k"):
        values = rows["F_first"].to_numpy()
        (row,) = mean[mean["interface.mu_k"] == mu_k].itertuples(index=False)
        assert row.mean == pytest.approx(np.sum(values) / 4)
        error = np.sqrt(np.sum((values - values.mean()) ** 2) / 3 / 4)
        assert row.standard_error == pytest.approx(error)
        assert error > 0
        assert row.n == 4
    assert what.status(tmp_path).mean("F_first").equals(mean)
    refused(lambda: found.mean("F_frist"), "column", "did you mean 'F_first'")
    refused(lambda: swept().status(tmp_path).mean("F_first"), "over", "no field is a seed")


def test_limits_refuse_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "run_all", None)
    for limit in ({"max_hours": 1e-9}, {"max_GB": 1e-9}):
        with pytest.raises(SceneError, match=next(iter(limit))):
            swept(**limit).run(tmp_path)


def test_the_estimate_is_that_of_what_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "expected_cost", lambda scene, t_end, _: (3600 * t_end, 1e9))
    what = swept(over={"interface.mu_k": [0.3, 0.35, 0.9, 0.4]})
    found = what.estimate(tmp_path)
    assert found[:3] == (4, 1, 0)
    assert (found.hours, found.GB) == pytest.approx((3 * 1.2e-3, 3.0))
    what.run(tmp_path, workers=1)
    assert what.estimate(tmp_path) == (4, 1, 3, 0.0, 0.0)


def test_the_size_of_a_sweep_is_about_right(tmp_path):
    what = swept(scene=small("free"), over={"interface.mu_k": [0.3, 0.35, 0.4]}, t_end=2e-3)
    before = what.estimate(tmp_path)
    what.run(tmp_path, workers=1)
    size = sum(path.stat().st_size for path in tmp_path.glob("*.nc")) / 1e9
    assert size / 5 < before.GB < size * 5


# --- files and the command -----------------------------------------------------------------------


def test_a_file_says_the_same(file):
    what = Sweep.from_toml(file)
    assert what.scene == small()
    assert list(what.rows.itertuples(index=False, name=None)) == [
        (mu, h) for mu in (0.3, 0.4) for h in (2.5e-3, 5e-3, 7.5e-3)
    ]
    file.write_text('scene = "fig1"\nt_end = "1 s"\n[over]\noptions.dt = ["auto", "0.2 us"]')
    assert [job.options.dt for job in Sweep.from_toml(file).jobs] == ["auto", 2e-7]


def test_a_file_varies_anything_that_a_scene_file_has(file):
    (file.parent / "mu.csv").write_text("slip (um), mu\n0, 0.7\n8, 0.45\n")
    RANDOM.to_toml(file.parent / "scene.toml")
    file.write_text("""
scene = "scene.toml"
t_end = "1.2 ms"
points = "list"
[over]
"interface.mu_s.seed" = { from = 7, to = 9, step = 1 }
"interface.mu_s.std" = [0.01, 0.02, 0.03]
"interface.law" = [{ kind = "table", slide = "mu.csv" }, { kind = "linear" }, { kind = "linear" }]
"driver.protocol" = [[["1 ms", "0.4 m/s"]], [], []]
"interface.k_f" = ["1 MN/m", { mean = "2 MN/m", std = "0.1 MN/m", seed = 3 }, "1 MN/m"]
"options.tolerance" = [0.01, 0.02, 0.03]
""")
    jobs = Sweep.from_toml(file).jobs
    assert all(isinstance(job, Job) for job in jobs), jobs
    scenes = [job.scene for job in jobs]
    drawn = [(scene.interface.mu_s.seed, scene.interface.mu_s.std) for scene in scenes]
    assert drawn == [(7, 0.01), (8, 0.02), (9, 0.03)]
    assert scenes[0].interface.law.slip == (0.0, 8e-6)
    assert scenes[0].driver.protocol == ((1e-3, 0.4),)
    assert scenes[1].interface.k_f == Spread(mean=2e6, std=1e5, seed=3)
    assert [job.options.tolerance for job in jobs] == [0.01, 0.02, 0.03]


def test_a_scene_in_the_file_names_files_beside_it(file):
    (file.parent / "mu.csv").write_text("slip (um), mu\n0, 0.7\n8, 0.45\n")
    scene = tomllib.loads(small().to_toml())
    scene["interface"]["law"] = {"kind": "table", "slide": "mu.csv"}
    file.write_text(tomli_w.dumps({"scene": scene, "t_end": "1 ms", "over": {"h": ["5 mm"]}}))
    assert Sweep.from_toml(file).scene.interface.law.slip == (0.0, 8e-6)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('"2.5 mm", to', '"2.5", to', "missing unit"),
        ("0.3, 0.4", '"a"', "not a number"),
        ("[options]", "[option]", "did you mean 'options'"),
        ("fidelity", "fidelty", "fidelty"),
        ("step =", "stepp =", "did you mean 'step'"),
        ('"2.5 mm", to', '"9 mm", to', "over.driver.h.from"),
        ('"1.2 ms"', '"1.2"', "missing unit"),
        ("scene.toml", "nothing.toml", "cannot be read"),
        ("[over]", "[over", "not TOML"),
        ("[over]", "[over]\ninterface.mu_k = [0.3]", "each field once"),
        ("{ from", "5 # { from", "a list of values, or a range"),
        ('t_end = "1.2 ms"', "", "t_end: missing"),
        ("[options]", "[limits]\nmax_hour = 1\n[options]", "did you mean 'max_hours'"),
    ],
)
def test_mistakes_in_a_file_are_refused(file, old, new, text):
    file.write_text(FILE.replace(old, new))
    found = command(file)
    assert found.exit_code == 2, found.output
    assert text in found.output


NAMES = """
scene t_end points n over options limits mu_k driver.h top
interface.law options.dt from to step kind
"""
KEYS = st.sampled_from(NAMES.split())
VALUES = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(-3, 10**30),
        st.floats(),
        st.sampled_from(["fig1", "1 ms", "2.5 mm", "grid", "sobol", "auto", "", "table", "-1 N"]),
    ),
    lambda inside: st.lists(inside, max_size=3) | st.dictionaries(KEYS, inside, max_size=3),
    max_leaves=8,
)
GOOD = {"scene": "fig1", "t_end": "1 ms", "over": {"mu_k": [0.3]}}


@given(st.dictionaries(KEYS, VALUES, max_size=4), st.dictionaries(KEYS, VALUES, max_size=3))
def test_any_document_is_a_sweep_or_refused(tmp_path_factory, document, over):
    tomli_w = pytest.importorskip("tomli_w")
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text(tomli_w.dumps(GOOD | document | ({"over": over} if over else {})))
    try:
        found = Sweep.from_toml(path)
    except SceneError as error:
        assert str(error)
    else:
        assert len(found.over)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--dry-run", "--status"], "--dry-run excludes --status and --out"),
        (["--dry-run", "--out", "out"], "--dry-run excludes --status and --out"),
        (["--dry-run", "--workers", "1"], "--workers: --dry-run and --status run nothing"),
        (["--status", "--workers", "1"], "--workers: --dry-run and --status run nothing"),
    ],
)
def test_the_command_refuses_options_without_effect(words, text, file):
    found = command(file, *words)
    assert (found.exit_code, text in found.stderr) == (2, True), found.output


def test_the_command_runs_and_goes_on(file, tmp_path):
    dry = json.loads(command(file, "--dry-run", "--json").stdout)
    assert (dry["points"], dry["finished"], dry["failed"]) == (6, 0, {})
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
        assert axes["n_events"].shape == (2, 3)
    assert all((tmp_path / "cache" / f"{key}.nc").exists() for key in table["key"])
    assert "6 finished" in command(file, "--dry-run").stdout
    assert command(file, "--out", out, "--workers", 1).exit_code == 0  # the same folder again


WITHOUT_XARRAY = """
import sys
sys.modules["xarray"] = sys.modules["h5netcdf"] = None  # as if they were not installed
import pyfric
record = pyfric.simulate("scene.toml", 1.2e-3, fidelity="quasistatic", progress=False)
assert pyfric.load(record.save("a.nc")) == record
record.to_csv("tables"), record.to_html("a.html")
sweep = pyfric.Sweep.from_toml("sweep.toml")
print(*(path.name for path in sweep.run(cache=None, workers=1, progress=False).save("out")))
try:
    record.to_xarray()
except ImportError as error:
    print(error.name)
"""


@pytest.mark.slow
def test_without_xarray_all_else_works(file):
    """A new process runs this, so that imports of the tests are not changed."""
    file.write_text(FILE.replace("[0.3, 0.4]", "[0.3]").replace("7.5 mm", "5 mm"))
    command = [sys.executable, "-c", WITHOUT_XARRAY]
    done = subprocess.run(command, cwd=file.parent, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["sweep.csv", "sweep.parquet", "xarray"], done.stderr


def test_the_command_names_what_is_refused_and_ends_with_2_if_all_is(file):
    file.write_text(FILE.replace("0.3, 0.4", "0.3, 0.9"))
    dry = command(file, "--dry-run")
    assert dry.exit_code == 0, dry.output
    assert dry.stderr.count("mu_k exceeds mu_s") == 3
    assert len(json.loads(command(file, "--dry-run", "--json").stdout)["failed"]) == 3
    found = command(file, "--workers", 1)
    assert found.exit_code == 1
    assert found.stderr.count("refused") == 3
    assert "interface.mu_k = 0.9" in found.stderr
    file.write_text(FILE.replace("0.3, 0.4", "0.8, -0.9"))
    for words in (["--dry-run"], ["--status"], ["--workers", "1"]):
        found = command(file, *words)
        assert found.exit_code == 2
        assert found.stderr.count("refused: interface.mu_k") == 6


def test_tables_are_saved_where_hdf5_cannot_lock(file, tmp_path, monkeypatch):
    results, opened = Sweep.from_toml(file).status(cache=None), h5py.File.__init__

    def in_memory(self, name, *rest, **how):
        if isinstance(name, str | os.PathLike):
            raise OSError(errno.ENOLCK, "No locks available")
        opened(self, name, *rest, **how)

    with monkeypatch.context() as patch:
        patch.setattr(h5py.File, "__init__", in_memory)
        paths = results.save(tmp_path / "out")
    with xr.open_dataset(paths[1]) as read:
        assert list(read["status"].values.ravel()) == list(results.table["status"])


def test_objects_are_saved_as_text(tmp_path):
    over = {"interface.law": [laws.LinearWeakening(), laws.Ageing(B=0.01, t_c=1e-3)], "mu_k": [0.4]}
    found = swept(over=over, options=Options()).status(tmp_path)
    found.save(tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "sweep.csv", index_col="point")
    assert "Ageing(B=0.01" in table["interface.law"][1]
    assert pd.read_parquet(tmp_path / "out" / "sweep.parquet").shape == table.shape
    assert all(outcome is None for outcome in found.outcomes)


def test_ctrl_c_ends_the_command_with_its_code(file, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, "run_all", interrupted)
    assert command(file).exit_code == 130


def test_outcomes_are_records(tmp_path):
    assert all(isinstance(record, Record) for record in swept().run(tmp_path, workers=1).outcomes)


def test_points_that_the_engine_refuses_are_refused_before_any_run():
    over = {"law": [laws.LinearWeakening(), laws.Ageing(B=0.01, t_c=1e-3)]}
    points = Sweep(scene="fig1", t_end=0.1, over=over, options=Options(fidelity="quasistatic"))
    status = points.status(False)
    assert status.table["status"].tolist() == ["waiting", "refused"]
    assert "cannot follow friction that depends on time" in status.failed["reason"].iloc[0]
    assert points.estimate(False).refused == 1


def test_results_are_shown_as_their_table(tmp_path):
    found = Sweep(scene="fig1", t_end=0.01, over={"driver.h": [5e-3, 6e-3]}).run(
        cache=tmp_path, workers=1, progress=False
    )
    assert repr(found).splitlines()[0] == "Results of 2 points"
    assert len(repr(found).splitlines()) == 5  # two lines of head, two rows


def test_a_grid_has_each_value_once():
    for values in (["5 mm", 0.005], [0.005, 0.0025, 0.005]):
        with pytest.raises(SceneError, match=r"over\.driver\.h.*each value once in a grid"):
            Sweep(scene="setup1", t_end="10 us", over={"h": values})
    twice = Sweep(scene="setup1", t_end="10 us", over={"h": ["5 mm"] * 2}, points="list")
    assert len(twice.jobs) == 2
