"""Runs by any executor: nothing finished is lost, and nothing runs twice."""

import errno
import os
import signal
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from counted_runs import counted
from helpers import same_run, small

from pyfric.scene import SceneError
from pyfric.sweeps import Job, JobError, reservation, run_all, sweep

OPTIONS = {"fidelity": "quasistatic"}


def jobs(n=4):
    return [Job(scene=small(F_N=3000.0 + 10 * i), t_end=1.2e-3, options=OPTIONS) for i in range(n)]


@pytest.fixture
def made(monkeypatch):
    """Scenes that were simulated in this process, one after another."""
    found = []
    simulate = sweep.simulate

    def slow(scene, *arguments, **options):
        found.append(scene.F_N)
        time.sleep(0.05)
        return simulate(scene, *arguments, **options)

    monkeypatch.setattr(sweep, "simulate", slow)
    return found


def test_every_executor_gives_the_same_records_under_the_same_keys(tmp_path):
    todo, names = jobs(2), []
    alone = run_all(todo, workers=1, cache=tmp_path / "alone")
    for pool in (ThreadPoolExecutor(2), ProcessPoolExecutor(2)):
        folder = tmp_path / type(pool).__name__
        with pool:
            found = run_all(todo, cache=folder, executor=pool)
            assert pool.submit(int, "3").result() == 3  # still open
        assert all(same_run(one, other) for one, other in zip(found, alone, strict=True))
        names.append(sorted(path.name for path in folder.iterdir()))
    assert names == 2 * [sorted(f"{job.key}.nc" for job in todo)]


def test_two_sweeps_on_one_folder_make_each_run_once(tmp_path, made):
    found = []

    def one():
        with ThreadPoolExecutor(2) as pool:
            found.append(run_all(jobs(), cache=tmp_path, executor=pool))

    both = [threading.Thread(target=one) for _ in range(2)]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert sorted(made) == [3000.0, 3010.0, 3020.0, 3030.0]
    assert all(same_run(one, other) for one, other in zip(*found, strict=True))
    assert {path.suffix for path in tmp_path.iterdir()} == {".nc"}


class Lossy(ThreadPoolExecutor):
    """Does what it is given, but loses the answer of the first call, or of all."""

    def __init__(self, times):
        super().__init__(1)
        self.times = times

    def submit(self, function, /, *arguments):
        future = super().submit(function, *arguments)
        if self.times > 0:
            self.times -= 1
            future.result()
            future = Future()
            future.cancel()
        return future


def test_an_answer_that_got_lost_is_taken_from_the_folder(tmp_path, made):
    with Lossy(1) as pool:
        assert len(run_all(jobs(2), cache=tmp_path, executor=pool)) == 2
    assert len(made) == 2


def test_an_executor_that_loses_all_ends_in_an_error(tmp_path, made):
    with Lossy(1000) as pool, pytest.raises(JobError, match="CancelledError"):
        run_all(jobs(1), cache=tmp_path, executor=pool)
    assert len(made) == 1


def test_an_executor_needs_submit():
    with pytest.raises(SceneError, match="executor"):
        run_all(jobs(1), executor=3)


def another_machine(folder, key, age):
    path = folder / f".{key}{reservation.SUFFIX}"
    path.write_text("elsewhere 1 123")
    os.utime(path, (time.time() - age,) * 2)
    return path


def test_a_run_that_another_machine_makes_is_waited_for(tmp_path, made):
    (job,) = jobs(1)
    path = another_machine(tmp_path, job.key, 0.0)
    waiting = threading.Thread(target=run_all, args=([job], 1, tmp_path))
    waiting.start()
    time.sleep(0.3)
    assert not made
    path.unlink()
    waiting.join()
    assert len(made) == 1


@pytest.mark.parametrize("gone", ["expired", "dead"])
def test_the_reservation_of_somebody_gone_is_void(tmp_path, made, gone):
    job, other = jobs(2)
    for one in (job, other):
        path = another_machine(tmp_path, one.key, 2 * reservation.EXPIRY)
        if gone == "dead":
            machine = reservation._owner().rsplit(" ", 1)[0]
            path.write_text(f"{machine} {2**22 + 1}")  # beyond the largest number of a process
    run_all([job], workers=1, cache=tmp_path)
    assert len(made) == 1
    assert [path.name for path in tmp_path.iterdir()] == [f"{job.key}.nc"]


@pytest.mark.parametrize(("age", "ours"), [(0.0, False), (2 * reservation.EXPIRY, True)])
def test_a_reservation_without_a_name_yet_counts_until_it_expires(tmp_path, age, ours):
    path = another_machine(tmp_path, "a", age)
    path.write_text("")
    os.utime(path, (time.time() - age,) * 2)
    with reservation.reserved(tmp_path, "a") as found:
        assert found == ours


def test_a_full_disk_keeps_no_empty_reservation(tmp_path, monkeypatch):
    def full():
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(reservation, "_owner", full)
    with reservation.reserved(tmp_path, "a") as ours:
        assert ours
        assert not list(tmp_path.iterdir())


def test_where_there_can_be_no_folder_all_is_ours(tmp_path):
    (tmp_path / "file").touch()
    with reservation.reserved(tmp_path / "file", "a") as ours:
        assert ours


def test_a_reservation_is_touched_while_the_run_lasts(tmp_path, monkeypatch):
    monkeypatch.setattr(reservation, "BEAT", 0.01)
    with reservation.reserved(tmp_path, "a") as ours:
        assert ours
        (path,) = tmp_path.iterdir()
        os.utime(path, (1e9, 1e9))
        until = time.monotonic() + 30
        while path.stat().st_mtime < 1e9 + 1 and time.monotonic() < until:
            time.sleep(0.01)
        assert path.stat().st_mtime > 1e9 + 1
        with reservation.reserved(tmp_path, "a") as theirs:
            assert not theirs
    assert not list(tmp_path.iterdir())


def test_ctrl_c_ends_runs_of_a_foreign_executor(tmp_path):
    """They learn it from the folder; what is finished stays, and the next call goes on."""
    long = {"fidelity": "dynamic", "geometry": "linear"}
    todo = [Job(scene=small(), t_end=t_end, options=long) for t_end in (4.0, 5.0, 6.0)]
    todo += jobs(1)
    first = tmp_path / f"{todo[-1].key}.nc"

    def press():
        while not (first.exists() and any(tmp_path.glob(f".{todo[0].key}*"))):
            time.sleep(0.01)
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()
    with ThreadPoolExecutor(4) as pool, pytest.raises(KeyboardInterrupt):
        run_all(todo, cache=tmp_path, executor=pool, progress=False)
    assert [path.name for path in tmp_path.iterdir()] == [first.name]


def test_what_was_given_up_long_ago_goes(tmp_path):
    reservation.give_up(tmp_path, "old", lambda: True)
    assert not list(tmp_path.iterdir())
    for name, age in (("old", 100.0), ("new", 0.0)):
        path = tmp_path / f".{name}{reservation.GIVEN_UP}"
        path.touch()
        os.utime(path, (time.time() - age, time.time() - age))
    reservation.clear(tmp_path)
    assert not reservation.given_up(tmp_path, "old")
    assert reservation.given_up(tmp_path, "new")


# --- dask ----------------------------------------------------------------------------------------


class Counting:
    def __init__(self, client, log):
        self.client, self.log = client, log

    def submit(self, *call):
        return self.client.submit(counted, self.log, *call)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of distributed, about workers that die
@pytest.mark.parametrize("accident", ["none", "worker killed", "scheduler restarted"])
def test_dask_survives(tmp_path, accident):
    distributed = pytest.importorskip("distributed")
    todo, log, folder = jobs(8), tmp_path / "log", tmp_path / "runs"
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        finished = []

        def strike():
            while not finished:
                finished.extend(folder.glob("*.nc") if folder.exists() else ())
                time.sleep(0.02)
            if accident == "worker killed":
                os.kill(next(iter(client.run(os.getpid).values())), 9)
            if accident == "scheduler restarted":
                client.restart()

        striking = threading.Thread(target=strike)
        striking.start()
        found = run_all(todo, cache=folder, executor=Counting(client, log))
        striking.join()
        again = run_all(todo, cache=folder, executor=client.get_executor())
    assert [one.scene.F_N for one in found] == [job.scene.F_N for job in todo]
    assert found == again
    runs = [float(line) for line in log.read_text().splitlines()]
    assert set(runs) == {job.scene.F_N for job in todo}
    under_way = {"none": 0, "worker killed": 1, "scheduler restarted": 2}[accident]
    assert len(runs) <= len(todo) + under_way  # only what was cut off in the middle ran again
    done = {f"{job.key}.nc": job.scene.F_N for job in todo}
    assert all(runs.count(done[path.name]) == 1 for path in finished)
