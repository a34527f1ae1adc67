"""The store of finished runs: damage is noticed, processes share it, `pyfric cache` prunes it."""

import dataclasses
import json
import os
import shutil
import subprocess
import sys
import threading
import time

import pytest
from click.testing import CliRunner
from damage import unnoticed
from helpers import small

import pyfric
from pyfric.cli.commands import main
from pyfric.sweeps import Job, Store, run_all, runs, store
from pyfric.sweeps.store import CACHE_VARIABLE, DAY, LOCK
from pyfric.values import SceneError

KEYS = ["0" * 40, "1" * 40, "a" * 40]


class Unwanted(Exception):
    pass


@pytest.fixture(autouse=True)
def _fresh_log():
    store.log.cache_clear()


@pytest.fixture(scope="module")
def record():
    return pyfric.simulate(small(), 1e-5, fidelity="dynamic", progress=False)


@pytest.fixture(scope="module")
def file(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("record") / "run.nc")


@pytest.fixture
def folder(tmp_path, file, monkeypatch):
    """Return a store with three runs, used 1, 2 and 3 days ago, and foreign files."""
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    for age, key in enumerate(KEYS, 1):
        shutil.copyfile(file, tmp_path / f"{key}.nc")
        used = time.time() - age * DAY
        os.utime(tmp_path / f"{key}.nc", (used, used))
    for name in ("mine.nc", "notes.txt"):
        (tmp_path / name).write_text("mine")
        os.utime(tmp_path / name, (0, 0))
    (tmp_path / ".pyfric-elsewhere-1-0123abcd.tmp").touch()
    os.utime(tmp_path / ".pyfric-elsewhere-1-0123abcd.tmp", (0, 0))
    return Store(tmp_path)


def keys(store):
    return [entry.path.stem for entry in store.entries()]


def damage(path):
    content, stat = path.read_bytes(), path.stat()
    path.write_bytes(content[: len(content) // 2])
    os.utime(path, (stat.st_atime, stat.st_mtime))


def pyf(*arguments):
    return CliRunner().invoke(main, ["cache", *arguments])


def job():
    return Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})


# --- runs ----------------------------------------------------------------------------------------


def test_a_run_is_found_again(folder, record):
    assert folder.load(KEYS[2], record.scene) == record
    assert keys(folder)[0] == KEYS[2]  # used just now
    assert folder.load("b" * 40, record.scene) is None
    assert folder.load(KEYS[0], small(F_N=3000.0)) is None
    renamed = dataclasses.replace(record.scene, name="another")
    assert folder.load(KEYS[0], renamed) == record


def test_every_damage_that_matters_is_noticed_with_a_line(folder, record, caplog):
    class Noticed(Exception):
        pass

    def load(path):
        caplog.clear()
        store.log.cache_clear()
        found = folder.load(path.stem, record.scene)
        assert found in (None, record)
        if found is None:
            assert "made again" in caplog.text
            raise Noticed

    kinds = {"flips": 100, "pages": 20, "cuts": 20}
    left = unnoticed(folder.folder / f"{KEYS[0]}.nc", load, Noticed, seed=5, **kinds)
    assert len(left) < 70, "titles and units take a part of a small file"


def test_a_run_that_cannot_be_kept_is_not_lost(tmp_path, caplog):
    (tmp_path / "file").touch()
    found = run_all([job(), dataclasses.replace(job(), t_end=2e-5)], 1, cache=tmp_path / "file")
    assert [made.status for made in found] == ["complete"] * 2
    assert caplog.text.count("finished runs are not kept in") == 1  # logged once


def test_a_read_only_store_is_used(folder, record, monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "utime", refuse)
    assert folder.load(KEYS[0], record.scene) == record


def test_what_names_a_store(monkeypatch, tmp_path):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "mine"))
    assert Store.at(True) == Store(tmp_path / "mine")
    monkeypatch.delenv(CACHE_VARIABLE)
    assert (Store.at(True).folder.name, Store.at(True).own) == ("pyfric", True)
    assert Store.at("runs") == Store.at(tmp_path.__class__("runs"))
    for none in (None, False):
        assert Store.at(none).prune(0) == ([], 0)
        assert Store.at(none).load(KEYS[0], small()) is None
    with pytest.raises(SceneError, match="cache"):
        Store.at(3)


# --- locks ---------------------------------------------------------------------------------------

HOLD = """
import sys, time
from pathlib import Path
from pyfric.sweeps import Store

with Store(Path(sys.argv[1])).reserved(sys.argv[2], "a run", lambda: None) as locked:
    print(locked, flush=True)
    time.sleep(1000)
"""


def look():
    pass


@pytest.fixture
def holder(tmp_path):
    """Start another process that holds the lock of a run."""
    call = [sys.executable, "-P", "-c", HOLD, str(tmp_path), KEYS[0]]
    process = subprocess.Popen(call, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "True\n"
    yield process
    process.kill()
    process.communicate()


def test_who_is_waited_for_is_said_and_a_lock_dies_with_its_owner(tmp_path, holder, caplog):
    shared, waits = Store(tmp_path), []

    def look():
        waits.append(1)
        if caplog.text:
            holder.kill()

    shared.prune(older_than=0.0)
    assert shared.lock_file(KEYS[0]).exists()  # another process holds it
    with shared.reserved(KEYS[0], "this run", look) as locked:
        assert locked
        assert len(waits) > 10
    assert f"waiting for process {holder.pid} of " in caplog.text
    assert caplog.text.count("which makes this run") == 1
    assert not list(tmp_path.iterdir())


def test_waiting_ends_where_the_run_is_not_wanted(tmp_path, holder):
    def look():
        raise Unwanted

    with pytest.raises(Unwanted), Store(tmp_path).reserved(KEYS[0], "a run", look):
        pass
    assert Store(tmp_path).lock_file(KEYS[0]).exists()


@pytest.mark.parametrize("age", [-3600.0, 0.0, 3600.0])
def test_a_file_that_nobody_holds_blocks_nothing_whatever_its_date(tmp_path, age):
    """The file may be from a killed process, or from a machine whose clock is ahead."""
    shared = Store(tmp_path)
    for key in KEYS[:2]:
        shared.lock_file(key).write_text("process 1 of elsewhere")
        os.utime(shared.lock_file(key), (time.time() - age,) * 2)
    with shared.reserved(KEYS[0], "a run", look) as locked:
        assert locked
    assert [path.name for path in tmp_path.iterdir()] == [f".{KEYS[1]}{LOCK}"]
    shared.prune()
    assert not list(tmp_path.iterdir())


def test_where_no_file_can_be_locked_the_run_is_ours(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    shared = Store(tmp_path)
    shared.lock_file(KEYS[1]).symlink_to(shared.lock_file(KEYS[1]))
    for place, key in ((Store(tmp_path / "file"), KEYS[0]), (shared, KEYS[1]), (Store(None), "")):
        with place.reserved(key, "a run", look) as locked:
            assert not locked


def test_a_full_disk_leaves_no_lock(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store.Path, "write_text", full)
    with Store(tmp_path).reserved(KEYS[0], "a run", look) as locked:
        assert locked
    assert not list(tmp_path.iterdir())


def test_many_threads_hold_one_after_another(tmp_path):
    inside, most = [], []

    def use():
        with Store(tmp_path).reserved(KEYS[0], "a run", look):
            inside.append(1)
            most.append(len(inside))
            time.sleep(0.002)
            inside.pop()

    threads = [threading.Thread(target=use) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 12
    assert not list(tmp_path.iterdir())


# --- what goes -----------------------------------------------------------------------------------


def test_records_used_least_recently_go(folder):
    size = folder.entries()[0].size
    gone, drafts = folder.prune(max_bytes=2 * size)
    assert [entry.path.stem for entry in gone] == [KEYS[2]]
    assert drafts == 1
    assert keys(folder) == KEYS[:2]
    assert (folder.folder / "mine.nc").exists()
    assert not list(folder.folder.glob(".*"))


def test_old_notes_of_failures_go(tmp_path):
    notes = Store(tmp_path)
    for key, age in ((KEYS[0], 40 * DAY), (KEYS[1], 0.0)):
        notes.note_failure(key, "why")
        os.utime(tmp_path / f"{key}{store.FAILED}", (time.time() - age,) * 2)
    notes.prune()
    assert [notes.failure(key) for key in KEYS] == ["", "why", ""]
    assert notes.entries() == []


def test_a_sweep_trims_its_own_folder_alone(folder, monkeypatch):
    size = folder.entries()[0].size
    monkeypatch.setattr(runs, "MAX_BYTES", int(2.2 * size))
    new = job()
    for cache in (folder.folder, True):  # the user named this folder
        run_all([new], cache=cache)
        assert keys(folder) == [new.key, *KEYS]
        (folder.folder / f"{new.key}.nc").unlink()
    monkeypatch.delenv(CACHE_VARIABLE)
    monkeypatch.setattr(store, "user_cache_path", lambda *_, **__: folder.folder)
    run_all([new])
    assert keys(folder) == [new.key, KEYS[0]]


def test_old_and_damaged_runs_go(folder):
    damage(folder.folder / f"{KEYS[0]}.nc")
    folder.prune(older_than=2.5)
    assert keys(folder) == KEYS[:2]
    folder.prune(damaged=True)
    assert keys(folder) == [KEYS[1]]
    folder.prune()
    assert keys(folder) == [KEYS[1]]


def test_a_run_that_is_used_meanwhile_stays(folder):
    listed = folder.entries()
    os.utime(listed[2].path)
    assert [entry.delete() for entry in listed] == [True, True, False]
    assert keys(folder) == [KEYS[2]]


USE = """
import sys
from pathlib import Path
import pyfric
from pyfric.sweeps import Store

store, key = Store(Path(sys.argv[1])), sys.argv[2]
made = pyfric.Record.load(sys.argv[3])
for n in range(3):
    store.save(key, made)
    found = store.load(key, made.scene)
    assert found is None or found == made
    if n % 2 == 0:
        store.prune(max_bytes=0)
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
    assert f"{folder.folder}: 3 runs" in pyf("size").stdout


def test_check_finds_damage_and_prune_removes_it(folder):
    assert pyf("check").exit_code == 0
    damage(folder.folder / f"{KEYS[1]}.nc")
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
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "none"))
    for command in ("list", "check", "size", "prune"):
        assert pyf(command).exit_code == 0
    assert not (tmp_path / "none").exists()
