"""Files are complete or absent: full disks, folders, devices, killed processes, damage."""

import dataclasses
import errno
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from damage import damaged, unnoticed
from helpers import small

import pyfric
from pyfric.core import State, StateError
from pyfric.statics import loaded_state
from pyfric.values import (
    SceneError,
    check_writable,
    clean_drafts,
    files,
    sealed,
    unsealed,
    write,
    written,
)

NOBODY = 4_000_000  # above the largest number that Linux gives a process


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def state():
    return loaded_state(small()).state(small(), 1e-7)


@pytest.mark.parametrize(
    ("save", "name", "text"),
    [
        ("save", "a.csv", "netCDF, not CSV; allowed: .* ends in .nc; to_csv, or --csv, writes"),
        ("save", "a.HTML", "netCDF, not HTML; allowed: a name that ends in .nc$"),
        ("to_html", "a.png", "HTML, not PNG; allowed: a name that ends in .html$"),
    ],
)
def test_names_of_other_formats_are_refused(save, name, text, tmp_path):
    record = pyfric.simulate(small(), 1e-5, fidelity="dynamic", progress=False)
    with pytest.raises(SceneError, match=rf"^path = '.*{name}': the file would be {text}"):
        getattr(record, save)(tmp_path / name)
    with pytest.raises(SceneError, match="TOML, not CSV"):
        record.scene.to_toml(tmp_path / "a.csv")
    with pytest.raises(SceneError, match=r"^checkpoint = 'a\.csv': the file would be netCDF"):
        pyfric.simulate(small(), 1e-5, fidelity="dynamic", checkpoint="a.csv", progress=False)
    assert names(tmp_path) == []
    assert record.save(tmp_path / "mu0.7").exists()


# --- what cannot be written ----------------------------------------------------------------------

FULL = """
import resource, sys
from pathlib import Path
import pyfric
from helpers import small
from pyfric.figures import fig1b, save_figure
from pyfric.values import write_all
from pyfric.statics import loaded_state

folder = Path(sys.argv[1])
record = pyfric.simulate(small(), 1e-5, fidelity="dynamic", progress=False)
state = loaded_state(small()).state(small(), 1e-7)
record.save(folder / "old")
figure = fig1b(record)
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
for save in (record.save, state.save):
    for path in (folder / "new", folder / "old"):
        try:
            save(path, overwrite=True)
        except OSError as error:
            assert str(path) in str(error), error
            assert error.strerror == "File too large", error
            print("noticed")
assert pyfric.Record.load(folder / "old") == record
for make in (
    lambda: save_figure(figure, folder / "drawn"),
    lambda: write_all({folder / "old": b"short", folder / "drawn.long": bytes(6000)}),
):
    try:
        make()
    except OSError as error:
        assert error.strerror == "File too large" and str(folder) in error.filename, error
        print("noticed", Path(error.filename).suffix)
assert pyfric.Record.load(folder / "old") == record
print("goes on")
"""


@pytest.mark.skipif(os.name != "posix", reason="needs limits of processes")
def test_a_full_disk_is_an_ordinary_error(tmp_path):
    made = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": os.path.dirname(__file__)},
    )
    assert made.returncode == 0, made.stderr
    assert made.stdout.split("\n") == [
        *["noticed"] * 4,
        *("noticed .png", "noticed .long", "goes on", ""),
    ]
    assert names(tmp_path) == ["old"]


def test_errors_name_path_and_reason(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    for name, kind in (
        ("missing/a", FileNotFoundError),
        ("folder", IsADirectoryError),
        ("file/a", NotADirectoryError),
    ):
        for attempt in (lambda path: write(path, b"a"), check_writable, state().save):
            with pytest.raises(kind) as error:
                attempt(tmp_path / name)
            assert error.value.filename == str(tmp_path / name)
            assert error.value.strerror
    assert names(tmp_path) == ["file", "folder"]


@pytest.mark.parametrize("device", ["/dev/null", "/dev/full"])
def test_devices_are_not_replaced(device):
    before = os.stat(device)
    for attempt in (lambda path: write(path, b"a"), check_writable):
        with pytest.raises(OSError, match=rf"Not a regular file: '{device}'"):
            attempt(device)
    assert os.stat(device).st_rdev == before.st_rdev


def test_an_error_about_another_file_keeps_its_name(tmp_path):
    with pytest.raises(FileNotFoundError, match="other"), written(tmp_path / "a"):
        (tmp_path / "other").read_bytes()


def test_no_space_is_said_before_the_start(tmp_path):
    with pytest.raises(OSError, match="bytes are free") as error:
        check_writable(tmp_path / "a.nc", 2**62)
    assert error.value.errno == errno.ENOSPC
    check_writable(tmp_path / "a.nc", 1000)
    assert names(tmp_path) == []


def test_links_are_followed(tmp_path):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


# --- drafts --------------------------------------------------------------------------------------


def test_drafts_of_killed_processes_go(tmp_path):
    kill = "import os, sys; from pyfric.values import written\n"
    kill += "with written(sys.argv[1]) as d: d.touch(); os.kill(os.getpid(), 9)"
    killed = subprocess.run([sys.executable, "-c", kill, str(tmp_path / "a")])
    assert killed.returncode == -signal.SIGKILL
    assert len(names(tmp_path)) == 1
    write(tmp_path / "b", b"")
    assert names(tmp_path) == ["b"]


def test_drafts_at_work_stay(tmp_path):
    with written(tmp_path / "a") as draft:
        draft.write_bytes(b"a")
        write(tmp_path / "b", b"b")
        assert clean_drafts(tmp_path) == 0
    assert names(tmp_path) == ["a", "b"]


def test_drafts_of_a_number_given_again_go_when_they_are_old(tmp_path):
    draft = files._draft(tmp_path)
    draft.touch()
    assert clean_drafts(tmp_path) == 0
    os.utime(draft, (0, 0))
    assert clean_drafts(tmp_path) == 1
    assert not draft.exists()


def test_drafts_of_other_machines_go_when_they_are_old(tmp_path):
    draft = tmp_path / f".pyfric-elsewhere-{NOBODY}-0123abcd.tmp"
    draft.touch()
    (tmp_path / ".mine.tmp").touch()
    assert clean_drafts(tmp_path) == 0
    yesterday = time.time() - 1.01 * files.OLD
    for path in tmp_path.iterdir():
        os.utime(path, (yesterday, yesterday))
    assert clean_drafts(tmp_path) == 1
    assert not draft.exists()


def test_what_cannot_be_deleted_keeps_no_other_draft(tmp_path):
    for number in range(4):  # for any order of the list
        (tmp_path / f".pyfric-{files._host()}-{NOBODY}-0000000{number}.tmp").touch()
        (tmp_path / f".pyfric-{files._host()}-{NOBODY}-1111111{number}.tmp").mkdir()
    assert clean_drafts(tmp_path) == 4
    assert all(path.is_dir() for path in tmp_path.iterdir())


# --- damage --------------------------------------------------------------------------------------


def test_seals_notice_every_bit():
    for content in (b"", b"a", bytes(100)):
        whole = sealed(content)
        assert unsealed(whole) == content
        for bit in range(8 * len(whole)):
            changed = bytearray(whole)
            changed[bit // 8] ^= 1 << bit % 8
            assert unsealed(bytes(changed)) is None
        for length in range(len(whole)):
            assert unsealed(whole[:length]) is None


def test_damages_are_reproducible_and_change_something():
    content = bytes(range(256)) * 64
    how = {"flips": 20, "pages": 5, "cuts": 5}
    found = list(damaged(content, seed=3, **how))
    assert found == list(damaged(content, seed=3, **how)) != list(damaged(content, seed=4, **how))
    assert len(found) == 30
    assert all(changed != content for _, changed in found)


def test_damaged_states_are_noticed(tmp_path):
    path = state().save(tmp_path / "a.npz")
    assert not unnoticed(path, State.load, StateError, seed=2, flips=200, pages=40, cuts=40)
    assert State.load(path) == state()


def test_another_file_is_no_state_and_gets_no_advice_to_load_it_unsafely(tmp_path):
    path = tmp_path / "a.nc"
    path.write_bytes(sealed(b"as a record has it"))
    with pytest.raises(StateError, match=r"a\.nc: damaged, or not a state") as caught:
        State.load(path)
    assert "pickle" not in str(caught.value)


@pytest.mark.skipif(os.name != "posix", reason="needs pipes")
def test_nobody_waits_for_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    code = "import sys, pyfric; pyfric.State.load(sys.argv[1])"
    command = [sys.executable, "-c", code, str(tmp_path / "pipe")]
    made = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert "Not a regular file" in made.stderr


def test_states_are_plain_archives(tmp_path):
    with np.load(state().save(tmp_path / "a.npz")) as archive:
        assert (archive["y"] == state().y).all()


def test_states_compare_by_value():
    one, other = state(), state()
    assert one == other == one.copy()
    other.y[1, 2, 3] += 1e-30 + abs(other.y[1, 2, 3]) * 1e-15
    assert one != other
    assert one != dataclasses.replace(one, step=one.step + 1)
    assert one != 3
