"""The store of finished runs: damage is noticed, many may use it, `pyfric cache` looks after it."""

import dataclasses
import json
import os
import shutil
import subprocess
import sys
import time
import warnings

import pytest
from click.testing import CliRunner
from damage import unnoticed
from helpers import small

import pyfric
from pyfric.cli import main
from pyfric.sweeps import Job, run_all, store, sweep

KEYS = ["0" * 40, "1" * 40, "a" * 40]


@pytest.fixture(scope="module")
def record():
    return pyfric.simulate(small(), 1e-5, fidelity="dynamic", progress=False)


@pytest.fixture(scope="module")
def file(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("record") / "run.nc")


@pytest.fixture
def folder(tmp_path, file, monkeypatch):
    """A store with three runs, used 1, 2 and 3 days ago, and files that are not its own."""
    monkeypatch.setenv(store.CACHE_VARIABLE, str(tmp_path))
    for age, key in enumerate(KEYS, 1):
        shutil.copyfile(file, tmp_path / f"{key}.nc")
        used = time.time() - age * store.DAY
        os.utime(tmp_path / f"{key}.nc", (used, used))
    for name in ("mine.nc", "notes.txt"):
        (tmp_path / name).write_text("mine")
        os.utime(tmp_path / name, (0, 0))
    (tmp_path / ".pyfric-elsewhere-1-0123abcd.tmp").touch()
    os.utime(tmp_path / ".pyfric-elsewhere-1-0123abcd.tmp", (0, 0))
    return tmp_path


def keys(folder):
    return [entry.path.stem for entry in store.entries(folder)]


def damage(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    stat = path.stat()
    path.write_bytes(content)
    os.utime(path, (stat.st_atime, stat.st_mtime))


def pyf(*arguments):
    return CliRunner().invoke(main, ["cache", *arguments])


def test_a_run_is_found_again(folder, record):
    found = store.kept(folder, KEYS[2], record.scene)
    assert found == record
    assert keys(folder)[0] == KEYS[2]  # used just now
    assert store.kept(folder, "b" * 40, record.scene) is None
    assert store.kept(folder, KEYS[0], small(F_N=3000.0)) is None
    renamed = dataclasses.replace(record.scene, name="another")
    assert store.kept(folder, KEYS[0], renamed) == record


def test_every_damage_is_noticed_with_a_warning(folder, record):
    path = folder / f"{KEYS[0]}.nc"

    def load(path):
        found = store.kept(folder, path.stem, record.scene)
        assert found is None or found == record
        return found

    with warnings.catch_warnings(action="error"):
        kinds = {"flips": 100, "pages": 20, "cuts": 20}
        assert not unnoticed(path, load, RuntimeWarning, seed=5, **kinds)


def test_damaged_runs_are_made_again(tmp_path):
    job = Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})
    (first,) = run_all([job], cache=tmp_path)
    path = tmp_path / f"{job.key}.nc"
    damage(path)
    with pytest.warns(RuntimeWarning, match=rf"made again: {path}: damaged"):
        (again,) = run_all([job], cache=tmp_path)
    assert store.check(store.entries(tmp_path)[0]) == again
    assert first.final_state == again.final_state


def test_a_run_that_cannot_be_kept_is_not_lost(tmp_path):
    (tmp_path / "file").touch()
    job = Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})
    with pytest.warns(RuntimeWarning, match=r"not kept: .*file"):
        (found,) = run_all([job], cache=tmp_path / "file")
    assert found.status == "complete"


def test_a_read_only_store_is_used(folder, record, monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "utime", refuse)
    assert store.kept(folder, KEYS[0], record.scene) == record


def test_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv(store.CACHE_VARIABLE, str(tmp_path / "mine"))
    run_all([Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})])
    assert len(store.entries(tmp_path / "mine")) == 1
    monkeypatch.delenv(store.CACHE_VARIABLE)
    assert store.cache_folder().name == "pyfric"


# --- what goes -----------------------------------------------------------------------------------


def test_records_used_least_recently_go(folder):
    one = store.entries(folder)[0].size
    gone, drafts = store.prune(folder, most=2 * one)
    assert [entry.path.stem for entry in gone] == [KEYS[2]]
    assert drafts == 1
    assert keys(folder) == KEYS[:2]
    assert (folder / "mine.nc").exists()
    assert not list(folder.glob(".*"))


def test_old_notes_of_failures_go(tmp_path):
    for key, age in (("old", 40 * store.DAY), ("new", 0.0)):
        store.note_failure(tmp_path, key, "why")
        os.utime(tmp_path / f".{key}{store.FAILED}", (time.time() - age, time.time() - age))
    store.prune(tmp_path)
    assert store.failed_before(tmp_path, "old") == "why"
    store.prune(tmp_path, most=10**9)
    assert store.failed_before(tmp_path, "old") == ""
    assert store.failed_before(tmp_path, "new") == "why"


def test_a_sweep_prunes_its_own_folder_alone(folder, monkeypatch):
    one = store.entries(folder)[0].size
    monkeypatch.setattr(sweep, "MAX_BYTES", int(2.2 * one))
    job = Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})
    run_all([job], cache=folder)
    assert keys(folder) == [job.key, *KEYS]  # the user named this folder
    (folder / f"{job.key}.nc").unlink()
    monkeypatch.setattr(sweep, "cache_folder", lambda: folder)
    monkeypatch.setenv(store.CACHE_VARIABLE, str(folder))
    run_all([job])
    assert keys(folder) == [job.key, *KEYS]
    (folder / f"{job.key}.nc").unlink()
    monkeypatch.delenv(store.CACHE_VARIABLE)
    run_all([job])
    assert keys(folder) == [job.key, KEYS[0]]


def test_old_and_damaged_runs_go(folder):
    damage(folder / f"{KEYS[0]}.nc")
    store.prune(folder, older_than=2.5)
    assert keys(folder) == KEYS[:2]
    store.prune(folder, damaged=True)
    assert keys(folder) == [KEYS[1]]
    store.prune(folder)
    assert keys(folder) == [KEYS[1]]


def test_a_run_that_is_used_meanwhile_stays(folder, monkeypatch):
    listed = store.entries(folder)
    os.utime(listed[2].path)
    monkeypatch.setattr(store, "entries", lambda _: listed)
    gone, _ = store.prune(folder, older_than=0.5)
    assert [entry.path.stem for entry in gone] == KEYS[:2]
    monkeypatch.undo()
    assert keys(folder) == [KEYS[2]]


USE = """
import sys, warnings
from pathlib import Path
import pyfric
from pyfric.sweeps import store

warnings.simplefilter("error")
folder, key = Path(sys.argv[1]), sys.argv[2]
made = pyfric.Record.load(sys.argv[3])
for n in range(3):
    store.keep(folder, key, made)
    found = store.kept(folder, key, made.scene)
    assert found is None or found == made
    if n % 2 == 0:
        store.prune(folder, most=0)
"""


@pytest.mark.slow
def test_two_processes_share_a_store(tmp_path, record):
    path = record.save(tmp_path / "record")
    folder = tmp_path / "store"
    call = [sys.executable, "-P", "-c", USE, str(folder), KEYS[0], str(path)]
    both = [subprocess.Popen(call, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    assert [one.communicate()[1] for one in both] == ["", ""]
    assert [one.returncode for one in both] == [0, 0]
    assert not list(folder.glob(".*"))


# --- the command ---------------------------------------------------------------------------------


def test_list_and_size(folder, record):
    shown = pyf("list").stdout.splitlines()
    assert [line[:12] for line in shown] == [key[:12] for key in KEYS]
    assert "dynamic" in shown[0]
    listed = json.loads(pyf("list", "--json").stdout)
    assert [row["events"] for row in listed] == [len(record.events)] * 3
    found = json.loads(pyf("size", "--json").stdout)
    assert found["runs"] == 3
    assert found["bytes"] == sum(row["bytes"] for row in listed)
    assert f"{folder}: 3 runs" in pyf("size").stdout


def test_check_finds_damage_and_prune_removes_it(folder):
    assert pyf("check").exit_code == 0
    damage(folder / f"{KEYS[1]}.nc")
    found = pyf("check")
    assert found.exit_code == 1
    assert f"{KEYS[1][:12]} " in found.stdout
    assert "3 runs, 1 damaged" in found.stdout
    assert "deleted: 0 runs, 0.0 MB; 1 unfinished" in pyf("prune").stdout
    assert json.loads(pyf("prune", "--damaged", "--json").stdout)["runs"] == 1
    assert pyf("check").exit_code == 0
    assert json.loads(pyf("prune", "--most", "0", "--json").stdout)["runs"] == 2
    assert json.loads(pyf("size", "--json").stdout)["runs"] == 0


def test_a_store_that_is_not_there_is_empty(monkeypatch, tmp_path):
    monkeypatch.setenv(store.CACHE_VARIABLE, str(tmp_path / "none"))
    for command in ("list", "check", "size", "prune"):
        assert pyf(command).exit_code == 0
    assert not (tmp_path / "none").exists()
