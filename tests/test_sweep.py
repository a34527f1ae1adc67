"""Runs side by side give what `simulate` gives, are kept by content, and stop when told to."""

import contextlib
import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from helpers import same_run, small

import pyfric
from pyfric.sweeps import Job, JobError, run_all, sweep

OPTIONS = {"fidelity": "hybrid", "geometry": "linear"}


def job(t_end=1.2e-3, options=OPTIONS, **changes):
    return Job(scene=small(**changes), t_end=t_end, options=options)


@pytest.fixture
def count(monkeypatch):
    """Number of runs that were made in this process."""
    made = []
    simulate = sweep.simulate
    monkeypatch.setattr(sweep, "simulate", lambda *a, **k: made.append(a) or simulate(*a, **k))
    return made


def test_finished_runs_are_used_again(tmp_path, count):
    (first,) = run_all([job()], cache=tmp_path)
    (again,) = run_all([job()], cache=tmp_path)
    assert first == again
    assert len(count) == 1
    run_all([job()], cache=False)
    assert len(count) == 2


def test_equal_jobs_run_once_and_keep_their_names(count, tmp_path):
    jobs = [job(name="one"), job(name="two"), job(name="one")]
    found = run_all(jobs, cache=tmp_path, progress=False)
    assert len(count) == 1
    assert [one.scene.name for one in found] == ["one", "two", "one"]


def test_key_holds_all_that_determines_a_run(monkeypatch):
    different = [
        job(),
        job(t_end=1.3e-3),
        job(mu_k=0.45 + 1e-16 + 1e-15),
        job(eta=1.0),
        job(side="right"),
        job(options={}),
        job(options=OPTIONS | {"t_gap": 2e-3}),
        job(options=OPTIONS | {"rtol": 1e-5, "stepper": "adaptive"}),
    ]
    assert len({one.key for one in different}) == len(different)
    assert job(name="a").key == job(name="b").key
    assert job(options=pyfric.Options(**OPTIONS)).key == job().key
    before = job().key
    monkeypatch.setattr(sweep, "code_version", lambda: "another code")
    assert job().key != before


def test_code_version_follows_the_installed_files(monkeypatch, tmp_path):
    def version():
        sweep.code_version.cache_clear()
        return sweep.code_version()

    real = version()
    monkeypatch.setattr(sweep, "__file__", str(tmp_path / "sweeps" / "sweep.py"))
    for room in (*sweep.ROOMS, "sweeps", "figures", "paper", "checks", "cli"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "a.py").write_text("a")
    one = version()
    for room in ("sweeps", "figures", "paper", "checks", "cli"):  # a caption voids no stored run
        (tmp_path / room / "a.py").write_text("b")
        assert version() == one
    for room in sweep.ROOMS:
        before = version()
        (tmp_path / room / "a.py").write_text("b")
        assert version() != before
    two = version()
    (tmp_path / "_core_v2.so").write_bytes(b"c")
    three = version()
    monkeypatch.setattr(sweep.scipy, "__version__", "0.0")
    assert len({real, one, two, three, version()}) == 5
    monkeypatch.undo()
    assert version() == real


def test_damaged_and_foreign_files_are_made_again(tmp_path, count):
    (first,) = run_all([job()], cache=tmp_path)
    (path,) = tmp_path.glob("*.nc")
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.warns(RuntimeWarning, match="made again"):
        (again,) = run_all([job()], cache=tmp_path)
    assert len(count) == 2
    assert same_run(first, again)
    assert pyfric.Record.load(path) == again
    dataclasses.replace(first, status="interrupted").save(path)
    run_all([job()], cache=tmp_path)
    dataclasses.replace(first, scene=small(F_N=3000.0)).save(path)
    run_all([job()], cache=tmp_path)
    assert len(count) == 4


def test_only_complete_runs_are_kept(tmp_path, monkeypatch):
    simulate = sweep.simulate
    monkeypatch.setattr(
        sweep,
        "simulate",
        lambda *a, **k: dataclasses.replace(simulate(*a, **k), status="interrupted"),
    )
    with pytest.raises(KeyboardInterrupt):
        run_all([job()], cache=tmp_path)
    assert not list(tmp_path.iterdir())


def test_runs_whose_trailing_edge_lifts_count_as_long():
    weights = [Job(scene=name, t_end=0.7).weight for name in ("setup2+", "setup2", "setup2-")]
    assert weights[0] > 5 * weights[1] > 5 * weights[2] > 0


@pytest.mark.parametrize("workers", [1, 2])
def test_error_names_its_job_and_others_are_kept(tmp_path, workers):
    bad = job(options=OPTIONS | {"dt": 1.0}, name="too coarse")
    good, endless = job(t_end=1e-5), job(t_end=1e3, options={"fidelity": "dynamic"})
    with pytest.raises(JobError, match=r"too coarse to t = 0.0012 s.*dt = 1\.0.*unstable") as error:
        run_all([good, bad, endless][: workers + 1], workers=workers, cache=tmp_path)
    assert error.value.job == bad
    assert isinstance(error.value.error, pyfric.SceneError)
    run_all([good], cache=tmp_path)
    assert (tmp_path / f"{good.key}.nc").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_records_and_errors_come_back_in_order(tmp_path, workers):
    """In this process and in others: what `simulate` gives, and an error in place of its record."""
    coarse = job(options=OPTIONS | {"dt": 1.0}, name="too coarse")
    dense = {"fidelity": "dynamic", "dt": 2e-6, "stepper": "rk4", "budget": False}
    heavy = job(t_end=2e-5, options=dense, F_N=9e6, name="folds")
    good = job(h=5e-3, options=OPTIONS | {"sample": 1e-5})
    jobs = [coarse, good, heavy, dataclasses.replace(coarse, scene=small(name="again"))]
    shown = []
    how = {"progress": lambda *now: shown.append(now), "errors": "return"}
    with sweep.side_by_side(jobs, workers) as pool:
        assert (pool is None) == (workers == 1)
        found = run_all(jobs, 1, tmp_path, executor=pool, **how)
        assert list(sweep.each(pool, divmod, [(7, 2), (9, 4)])) == [(3, 1), (2, 1)]
    assert shown == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert [type(one) for one in found] == [JobError, pyfric.Record, JobError, JobError]
    assert [one.job for one in found if isinstance(one, JobError)] == [jobs[0], *jobs[2:]]
    assert "unstable" in str(found[0])
    assert isinstance(found[2].error, pyfric.SceneError | pyfric.RunError)
    assert str(found[3]).startswith("again to t")
    alone = pyfric.simulate(good.scene, good.t_end, good.options, threads=1, progress=False)
    assert same_run(found[1], alone)
    assert found[1].timings["processor"] > 0
    assert len(found[1].events)


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
        (lambda: run_all([job()], workers=0), "workers"),
        (lambda: run_all([job()], workers=True), "workers"),
        (lambda: run_all([job()], errors="ignore"), "errors"),
    ],
)
def test_bad_input_is_refused(make, text):
    with pytest.raises(pyfric.SceneError, match=text):
        make()


def test_no_jobs_give_no_records():
    assert run_all([]) == []


# --- processes -----------------------------------------------------------------------------------

SCRIPT = """
import os
import sys
from pyfric import Job, run_all, setup1
from pyfric.sweeps import sweep

def tiny(h):
    return setup1(L=0.02, H=0.0125, V=0.5, h=h)

def noted(scene, t_end, *arguments, **options):
    print(f"running {os.getpid()}\\n", end="", flush=True)  # in one piece, buffered or not
    return simulate(scene, t_end, *arguments, **options)

simulate, sweep.simulate = sweep.simulate, noted  # in the workers too, which read this file

if __name__ == "__main__":
    endless = [
        Job(scene=tiny(h), t_end=1e3, options={"fidelity": "dynamic"}) for h in (5e-3, 7.5e-3)
    ]
    short = [Job(scene=tiny(h), t_end=1e-5, options=endless[0].options) for h in (2.5e-3, 10e-3)]
    run_all(short[:1], cache=sys.argv[1])
    for found in run_all([*endless, *short], 2, sys.argv[1], errors=sys.argv[2]):
        print("found", found.status if hasattr(found, "status") else found, flush=True)
"""


@pytest.fixture
def sweeping(tmp_path):
    """Start the script and wait until its workers run; it gives the script and their ids."""
    started = []

    def start(errors):
        script = tmp_path / "script.py"
        script.write_text(SCRIPT)
        script = subprocess.Popen(
            [sys.executable, "-P", str(script), str(tmp_path / "kept"), errors],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(script)
        in_script, *workers = (int(script.stdout.readline().split()[1]) for _ in range(3))
        assert in_script == script.pid
        return script, workers

    yield start
    for script in started:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(script.pid, signal.SIGKILL)
        script.communicate()


def alive(group):
    """Processes of a group that still run (those that nobody has waited for do not)."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True).stdout
    pairs = [line.split() for line in listed.splitlines()]
    return sum(pgid == str(group) and not stat.startswith("Z") for pgid, stat in pairs)


def seconds_until_dead(group):
    begin = time.monotonic()
    while alive(group):
        assert time.monotonic() - begin < 30
        time.sleep(0.05)
    return time.monotonic() - begin


needs_ps = pytest.mark.skipif(shutil.which("ps") is None, reason="needs ps and signals")


@needs_ps
def test_ctrl_c_stops_all_workers_and_keeps_what_is_finished(tmp_path, sweeping):
    """Where it reaches the script alone; test_sweep_file: all processes of a terminal."""
    script, _ = sweeping("return")
    os.kill(script.pid, signal.SIGINT)
    _, errors = script.communicate(timeout=30)
    assert script.returncode != 0
    assert errors.count("Traceback") == 1
    assert "KeyboardInterrupt" in errors
    assert seconds_until_dead(script.pid) < 2
    assert len(list((tmp_path / "kept").glob("*.nc"))) == 1


@needs_ps
def test_workers_end_with_their_parent(tmp_path, sweeping):
    script, _ = sweeping("return")
    script.kill()
    _, errors = script.communicate(timeout=30)  # the workers hold the other ends
    assert seconds_until_dead(script.pid) < 5
    assert errors == ""
    assert len(list((tmp_path / "kept").glob("*.nc"))) == 1


@needs_ps
def test_a_worker_that_dies_takes_only_its_job_along(sweeping):
    script, workers = sweeping("return")
    for worker in workers:
        os.kill(worker, signal.SIGKILL)
    shown, errors = script.communicate(timeout=60)
    assert script.returncode == 0, errors
    found = [line for line in shown.splitlines() if line.startswith("found")]
    assert all("ended by itself (exit code -9" in line for line in found[:2])
    assert found[2:] == ["found complete"] * 2
    assert errors == ""
    assert seconds_until_dead(script.pid) < 2
