"""Parallel runs give the results of `simulate`, by any executor, and are stored by content."""

import dataclasses
import os
import signal
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from helpers import same_run, small
from in_workers import counted

import pyfric
from pyfric.sweeps import Job, JobError, Store, run_all, runs, side_by_side

HYBRID = {"fidelity": "hybrid", "geometry": "linear"}
QUICK = {"fidelity": "quasistatic"}


def job(t_end=1.2e-3, options=QUICK, **changes):
    return Job(scene=small(**changes), t_end=t_end, options=options)


def several(count):
    return [job(F_N=3000.0 + 10 * i) for i in range(count)]


@pytest.fixture
def made(monkeypatch):
    """Return normal forces of the scenes that are simulated in this process, in order."""
    found, simulate = [], runs.simulate

    def noted(scene, *arguments, **options):
        found.append(scene.F_N)
        time.sleep(0.02)
        return simulate(scene, *arguments, **options)

    monkeypatch.setattr(runs, "simulate", noted)
    return found


# --- jobs ----------------------------------------------------------------------------------------


def test_key_holds_all_that_determines_a_run(monkeypatch):
    different = [
        job(options=HYBRID),
        job(1.3e-3, HYBRID),
        job(options=HYBRID, mu_k=0.45 + 1e-16 + 1e-15),
        job(options=HYBRID, eta=1.0),
        job(options=HYBRID, side="right"),
        job(options={}),
        job(options=HYBRID | {"t_gap": 2e-3}),
        job(options=HYBRID | {"rtol": 1e-5, "stepper": "adaptive"}),
    ]
    assert len({each.key for each in different}) == len(different)
    assert job(name="a").key == job(name="b").key
    assert job(options=pyfric.Options(**QUICK)).key == job().key
    before = job().key
    monkeypatch.setattr(runs, "code_version", lambda: "another code")
    assert job().key != before


def test_code_version_follows_the_installed_files(monkeypatch, tmp_path):
    def version():
        runs.code_version.cache_clear()
        return runs.code_version()

    real = version()
    monkeypatch.setattr(runs, "__file__", str(tmp_path / "sweeps" / "runs.py"))
    for room in (*runs.ROOMS, "sweeps", "figures", "paper", "checks", "cli"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "a.py").write_text("a")
    found = {real, version()}
    for room in ("sweeps", "figures", "paper", "checks", "cli"):  # a caption voids no stored run
        (tmp_path / room / "a.py").write_text("b")
        assert version() in found
    for room in runs.ROOMS:
        (tmp_path / room / "a.py").write_text("b")
        assert version() not in found
        found.add(version())
    (tmp_path / "_core_v2.so").write_bytes(b"c")
    assert version() not in found
    found.add(version())
    monkeypatch.setattr(runs.scipy, "__version__", "0.0")
    assert version() not in found
    monkeypatch.undo()
    assert version() == real


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: job(t_end=-1.0), "t_end"),
        (lambda: job(options={"thread": 1}), "options.thread"),
        (lambda: job(options={"threads": 2}), "options.threads"),
        (lambda: job(options={"initial": None}), "options.initial"),
        (lambda: job(options={"dt": [1.0]}), "dt"),
        (lambda: job(options=pyfric.Options(threads=2)), "options.threads"),
        (lambda: job(options=3), "options"),
        (lambda: Job(scene="fig", t_end=1.0), "preset"),
        (lambda: run_all(["fig1"]), "jobs"),
        (lambda: run_all(job()), "jobs"),
        (lambda: run_all(None), "jobs"),
        (lambda: run_all([job()], workers=2.0), "workers"),
        (lambda: run_all([job()], workers=0), "workers"),
        (lambda: run_all([job()], workers=True), "workers"),
        (lambda: run_all([job()], errors="ignore"), "errors"),
        (lambda: run_all([job()], executor=3), "executor"),
        (lambda: run_all([job()], 1, executor=ThreadPoolExecutor(1)), "workers = 1"),
        (lambda: run_all([job()], cache=3), "cache"),
    ],
)
def test_bad_input_is_refused(make, text):
    with pytest.raises(pyfric.SceneError, match=text):
        make()


# --- what is kept --------------------------------------------------------------------------------


def test_finished_runs_are_used_again_and_equal_jobs_run_once(tmp_path, made):
    assert run_all([]) == []
    todo = [job(name="a"), job(name="b"), job(name="a")]
    found = run_all(todo, cache=tmp_path, progress=False)
    assert len(made) == 1
    assert [record.scene.name for record in found] == ["a", "b", "a"]
    assert run_all(todo, cache=tmp_path) == found
    assert len(made) == 1


@pytest.mark.parametrize("cache", [None, False])
def test_without_a_store_nothing_is_kept(tmp_path, monkeypatch, made, cache):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert run_all([job()], cache=cache)[0].status == "complete"
    assert len(made) == 2
    assert not list(tmp_path.iterdir())


def test_damaged_and_foreign_files_are_made_again(tmp_path, made, caplog):
    (first,) = run_all([job()], cache=tmp_path)
    (path,) = tmp_path.glob("*.nc")
    path.write_bytes(path.read_bytes()[:1000])
    (again,) = run_all([job()], cache=tmp_path)
    assert f"made again: {path}: damaged" in caplog.text
    assert len(made) == 2
    assert same_run(first, again)
    assert pyfric.Record.load(path) == again
    dataclasses.replace(first, status="interrupted").save(path, overwrite=True)
    run_all([job()], cache=tmp_path)
    dataclasses.replace(first, scene=small(F_N=3000.0)).save(path, overwrite=True)
    run_all([job()], cache=tmp_path)
    assert len(made) == 4


def test_only_complete_runs_are_kept(tmp_path, monkeypatch):
    def interrupted(*arguments, **options):
        return dataclasses.replace(pyfric.simulate(*arguments, **options), status="interrupted")

    monkeypatch.setattr(runs, "simulate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_all([job()], cache=tmp_path)
    assert not list(tmp_path.iterdir())


# --- side by side --------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_names_its_job_and_others_are_kept(tmp_path, workers):
    bad = job(options=HYBRID | {"dt": 1.0}, name="too coarse")
    good, endless = job(1e-5), job(1e3, {"fidelity": "dynamic"})
    with pytest.raises(JobError, match=r"too coarse to t = 0.0012 s.*dt = 1\.0.*unstable") as error:
        run_all([good, bad, endless][: workers + 1], workers=workers, cache=tmp_path)
    assert error.value.job == bad
    assert isinstance(error.value.error, pyfric.SceneError)
    run_all([good], cache=tmp_path)
    assert (tmp_path / f"{good.key}.nc").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_records_and_errors_come_back_in_order(tmp_path, workers):
    """In any process results are those of `simulate`, with an error in place of its record."""
    coarse = job(options=HYBRID | {"dt": 1.0}, name="too coarse")
    dense = {"fidelity": "dynamic", "dt": 2e-6, "stepper": "rk4", "energies": False}
    heavy = job(2e-5, dense, F_N=9e6, name="folds")
    good = job(options=HYBRID | {"sample": 1e-5}, h=5e-3)
    todo = [coarse, good, heavy, dataclasses.replace(coarse, scene=small(name="again"))]
    shown = []
    with side_by_side(todo, workers) as pool:
        how = {"progress": lambda *now: shown.append(now), "errors": "return"}
        found = run_all(todo, cache=tmp_path, executor=pool, **how)
        assert list(pool.map(divmod, [7, 9], [2, 4])) == [(3, 1), (2, 1)]
    assert shown == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert [type(outcome) for outcome in found] == [JobError, pyfric.Record, JobError, JobError]
    assert [outcome.job for outcome in (found[0], *found[2:])] == [todo[0], *todo[2:]]
    assert "unstable" in str(found[0])
    assert isinstance(found[2].error, pyfric.SceneError | pyfric.RunError)
    assert str(found[3]).startswith("again to t")
    alone = pyfric.simulate(good.scene, good.t_end, good.options, threads=1, progress=False)
    assert same_run(found[1], alone)
    assert found[1].timings["processor"] > 0
    assert len(found[1].events)
    assert Store(tmp_path).failure(heavy.key).startswith(type(found[2].error).__name__)


def test_every_executor_gives_the_same_records_under_the_same_keys(tmp_path):
    todo, names = several(2), []
    alone = run_all(todo, workers=1, cache=tmp_path / "alone")
    for pool in (ThreadPoolExecutor(2), ProcessPoolExecutor(2)):
        folder = tmp_path / type(pool).__name__
        with pool:
            found = run_all(todo, cache=folder, executor=pool)
            assert pool.submit(int, "3").result() == 3  # still open
        assert all(map(same_run, found, alone))
        names.append(sorted(path.name for path in folder.iterdir()))
    assert names == 2 * [sorted(f"{job.key}.nc" for job in todo)]


def test_two_sweeps_on_one_folder_make_each_run_once(tmp_path, made):
    found = []

    def sweep():
        with ThreadPoolExecutor(2) as pool:
            found.append(run_all(several(4), cache=tmp_path, executor=pool))

    both = [threading.Thread(target=sweep) for _ in range(2)]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert sorted(made) == [3000.0, 3010.0, 3020.0, 3030.0]
    assert all(map(same_run, *found))
    assert {path.suffix for path in tmp_path.iterdir()} == {".nc"}


class Lossy(ThreadPoolExecutor):
    """An executor that loses the results of its first calls."""

    def __init__(self, losses):
        super().__init__(1)
        self.losses = losses

    def submit(self, function, /, *arguments):
        future = super().submit(function, *arguments)
        if self.losses > 0:
            self.losses -= 1
            future.result()
            future = Future()
            future.cancel()
        return future


def test_answers_that_got_lost_are_taken_from_the_folder_unless_all_are(tmp_path, made):
    with Lossy(1) as pool:
        assert len(run_all(several(2), cache=tmp_path, executor=pool)) == 2
    with Lossy(1000) as pool, pytest.raises(JobError, match="CancelledError"):
        run_all([job(F_N=3500.0)], cache=tmp_path, executor=pool)
    assert made == [3000.0, 3010.0, 3500.0]


def test_ctrl_c_ends_runs_of_a_foreign_executor(tmp_path):
    """The folder tells them to stop; finished runs stay, and the next call goes on."""
    long = {"fidelity": "dynamic", "geometry": "linear"}
    todo = [*(job(t_end, long) for t_end in (4.0, 5.0, 6.0)), job()]
    finished = tmp_path / f"{todo[-1].key}.nc"

    def press():
        while not (finished.exists() and Store(tmp_path).lock_file(todo[0].key).exists()):
            time.sleep(0.01)
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()
    with ThreadPoolExecutor(4) as pool, pytest.raises(KeyboardInterrupt):
        run_all(todo, cache=tmp_path, executor=pool, progress=False)
    assert list(tmp_path.iterdir()) == [finished]


# --- dask ----------------------------------------------------------------------------------------


class Counting:
    def __init__(self, client, log):
        self.client, self.log = client, log

    def submit(self, *call):
        return self.client.submit(counted, self.log, *call)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # distributed warns of dead workers
@pytest.mark.parametrize("accident", ["none", "worker killed", "scheduler restarted"])
def test_dask_survives(tmp_path, accident):
    distributed = pytest.importorskip("distributed")
    todo, log, folder = several(8), tmp_path / "log", tmp_path / "runs"
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
    assert [record.scene.F_N for record in found] == [job.scene.F_N for job in todo]
    assert found == again
    noted = [float(line) for line in log.read_text().splitlines()]
    assert set(noted) == {job.scene.F_N for job in todo}
    under_way = {"none": 0, "worker killed": 1, "scheduler restarted": 2}[accident]
    assert len(noted) <= len(todo) + under_way  # only interrupted runs were repeated
    done = {f"{job.key}.nc": job.scene.F_N for job in todo}
    assert all(noted.count(done[path.name]) == 1 for path in finished)
