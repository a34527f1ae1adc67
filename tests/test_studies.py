"""Commands of studies: their calls and files; they are not installed."""

import json
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import bench
import pandas as pd
import pytest
import sizes
import tpv3
from click.testing import CliRunner
from helpers import STUDIES

from pyfric.cli.shared import Exit


def study(*arguments):
    return CliRunner().invoke(STUDIES, [str(one) for one in arguments])


@pytest.mark.parametrize("name", ["kernel", "threads"])
def test_timings(name, monkeypatch):
    calls = []

    def measure(*, quick, progress):
        calls.append((quick, progress))
        return pd.DataFrame({"blocks": [1767], "ns": [1.5]})

    monkeypatch.setattr(bench, name, measure)
    monkeypatch.setattr(bench, "report", lambda frame: f"{len(frame)} rows")
    assert study(name).stdout == "1 rows\n"
    assert json.loads(study(name, "--json", "--quick").stdout) == [{"blocks": 1767, "ns": 1.5}]
    assert calls == [(False, False), (True, False)]  # without a terminal there is no progress


@pytest.mark.parametrize(
    "name", ["chart", "lattices", "methods", "resolution", "fronts", "disorder"]
)
def test_a_folder_that_cannot_be_written_is_refused_first(name, tmp_path):
    (tmp_path / "file").write_text("mine")
    result = study(name, "--out", tmp_path / "file")
    assert result.exit_code == Exit.BAD_INPUT, result.output
    assert "Not a directory" in result.stderr


def test_a_table_goes_beside_the_command_that_makes_it(tmp_path, monkeypatch):
    monkeypatch.setattr(tpv3, "tpv3", lambda **_: pd.DataFrame({"rms": [0.0012345678]}))
    monkeypatch.setattr(tpv3, "report", lambda frame: "told")
    out = tmp_path / "tpv3.csv"
    assert study("tpv3", "--out", out).stdout == "told\n"
    assert out.read_text() == "rms\n0.00123457\n"
    about = (tmp_path / "tpv3_provenance.toml").read_text()
    assert 'command = "python studies tpv3"' in about
    assert "--overwrite" in study("tpv3", "--out", out).stderr


def test_they_run_from_their_folder_beside_the_installed_package():
    """Called by folder, as in `make studies`, Python does not import pyfric from its source."""
    folder = STUDIES.callback.__code__.co_filename.rpartition("/")[0]
    run = [sys.executable, "-P", folder, "limit", "--json"]
    found = subprocess.run(run, capture_output=True, text=True, check=True)
    assert json.loads(found.stdout)[0]["ns"] > 0


def test_they_are_not_installed():
    files = {path.parts[0] for path in metadata.files("pyfric")}
    assert {"pyfric"} < files
    assert not files & {"studies", "fronts.py", "bench.py"}
    assert not any("studies" in path.parts for path in metadata.files("pyfric"))


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """Return results of all commands at tiny sizes, by name, and the folder of outputs."""
    folder = tmp_path_factory.mktemp("studies")
    own = Path(__file__)
    env = os.environ | {"PYTHONPATH": str(own.parents[1] / "studies"), "OMP_NUM_THREADS": "1"}
    env |= {"XDG_CACHE_HOME": str(folder / "cache")}
    run = [sys.executable, "-P", own.with_name("tiny_studies.py"), folder]
    done = subprocess.run(run, env=env, capture_output=True, text=True, check=True)
    return {row.pop("name"): row for row in json.loads(done.stdout)}, folder


@pytest.mark.tiny
@pytest.mark.parametrize("name", sorted(STUDIES.commands))
def test_every_command_works_at_tiny_sizes(name, tried):
    rows, folder = tried
    assert rows[name]["code"] == 0, rows[name]["said"]
    kinds = {one.name: one.metavar for one in STUDIES.commands[name].params}
    if kinds.get("out") == "DIR":
        about = [one.read_text() for one in (folder / name).glob("*provenance.toml")]
        assert about
        assert all(f"python studies --tiny {name}" in one for one in about)
    elif "out" in kinds:
        table = pd.read_csv(folder / f"{name}.csv")
        assert len(table)
    else:
        assert len(rows[name]["said"].splitlines()) > 1


def test_sizes_are_tiny_only_when_asked_for(monkeypatch):
    monkeypatch.delenv("PYFRIC_TINY", raising=False)
    assert sizes.size(2, 1) == 2
    monkeypatch.setenv("PYFRIC_TINY", "1")
    assert sizes.size(2, 1) == 1
