"""Worker processes: a dead worker loses only its job, and all end with the script."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from in_workers import described, failing, unpicklable

from pyfric.signals import SIGNALS
from pyfric.sweeps.workers import InThisProcess, Workers

pytestmark = pytest.mark.skipif(shutil.which("ps") is None, reason="needs ps")

NOTED = """
import os
from pyfric import Job

class Noted(Job):
    def made(self, progress):
        print(f"running {os.getpid()}\\n", end="", flush=True)  # in one piece, buffered or not
        return super().made(progress)
"""
SCRIPT = """
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from noted import Noted
from pyfric import run_all, setup1

def tiny(h):
    return setup1(L=0.02, H=0.0125, V=0.5, h=h)

endless = [
    Noted(scene=tiny(h), t_end=1e3, options={"fidelity": "dynamic"}) for h in (5e-3, 7.5e-3)
]
short = [Noted(scene=tiny(h), t_end=1e-5, options=endless[0].options) for h in (2.5e-3, 10e-3)]
run_all(short[:1], cache=sys.argv[1])
for found in run_all([*endless, *short], 2, sys.argv[1], errors="return"):
    print("found", found.status if hasattr(found, "status") else found, flush=True)
"""
PLAIN = """
import os
import sys

import pyfric

print("begins", flush=True)

class Noted(pyfric.Job):
    def made(self, progress):
        print("made", os.getpid() == own, flush=True)
        return super().made(progress)

own, tiny = os.getpid(), pyfric.setup1(L=0.02, H=0.0125, V=0.5)
if sys.argv[1] == "sweep":
    how = {"options": {"fidelity": "quasistatic"}}
    sweep = pyfric.Sweep(tiny, 1e-4, {"mu_s": [0.6, 0.65, 0.7]}, **how)
    print(sweep.run(workers=2, cache=False).table["status"].tolist())
else:
    jobs = [Noted(tiny.replace(mu_s=mu), 1e-4, {"fidelity": "quasistatic"}) for mu in (0.6, 0.7)]
    print([record.status for record in pyfric.run_all(jobs, workers=2, cache=False)])
"""


@pytest.mark.parametrize(
    ("what", "printed"),
    [
        ("sweep", ["begins", "['complete', 'complete', 'complete']"]),
        ("jobs", ["begins", "made True", "made True", "['complete', 'complete']"]),
    ],
)
def test_no_worker_runs_a_script_again_that_guards_nothing(what, printed, tmp_path):
    """Jobs with classes of the script run in its own process."""
    path = tmp_path / "plain.py"
    path.write_text(PLAIN)
    done = subprocess.run([sys.executable, "-P", path, what], capture_output=True, text=True)
    assert done.stdout.splitlines() == printed, done.stderr


@pytest.fixture
def sweeping(tmp_path):
    """Start a script that has kept one run and makes two endless runs; return it and worker ids."""
    path = tmp_path / "script.py"
    path.write_text(SCRIPT)
    (tmp_path / "noted.py").write_text(NOTED)
    script = subprocess.Popen(
        [sys.executable, "-P", str(path), str(tmp_path / "kept")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        in_script, *workers = (int(script.stdout.readline().split()[1]) for _ in range(3))
        assert in_script == script.pid
        yield script, workers
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(script.pid, signal.SIGKILL)
        script.communicate()


def alive(group):
    """Return the processes of a group that still run; ended ones do not count."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True).stdout
    pairs = [line.split() for line in listed.splitlines()]
    return sum(pgid == str(group) and not stat.startswith("Z") for pgid, stat in pairs)


def seconds_until_dead(group):
    begin = time.monotonic()
    while alive(group):
        assert time.monotonic() - begin < 30
        time.sleep(0.05)
    return time.monotonic() - begin


def test_ctrl_c_in_a_terminal_stops_all_and_keeps_what_is_finished(tmp_path, sweeping):
    """Ctrl-C reaches all processes; workers ignore it."""
    script, _ = sweeping
    os.killpg(script.pid, signal.SIGINT)
    _, errors = script.communicate(timeout=30)
    assert script.returncode != 0
    assert errors.count("Traceback") == 1
    assert "KeyboardInterrupt" in errors
    assert seconds_until_dead(script.pid) < 2
    assert [path.suffix for path in (tmp_path / "kept").iterdir()] == [".nc"]


def test_workers_end_with_a_script_that_is_killed(tmp_path, sweeping):
    script, _ = sweeping
    script.kill()
    _, errors = script.communicate(timeout=30)  # workers hold the other ends of pipes
    assert seconds_until_dead(script.pid) < 5
    assert not errors or "leaked semaphore objects to clean up" in errors  # Python cleans these up
    assert len(list((tmp_path / "kept").glob("*.nc"))) == 1


def test_a_worker_that_dies_takes_only_its_job_along(sweeping):
    script, workers = sweeping
    for worker in workers:
        os.kill(worker, signal.SIGKILL)
    shown, errors = script.communicate(timeout=60)
    assert script.returncode == 0, errors
    found = [line for line in shown.splitlines() if line.startswith("found")]
    assert all("ended by itself (exit code -9" in line for line in found[:2])
    assert found[2:] == ["found complete"] * 2
    assert errors == ""
    assert seconds_until_dead(script.pid) < 2


# --- in this process -----------------------------------------------------------------------------


def test_workers_have_one_thread_of_blas_and_hear_no_signals():
    with Workers(1) as pool:
        process, threads, blocked = pool.submit(described).result()
        assert process != os.getpid()
        assert threads == {1}
        assert set(SIGNALS) - blocked == {signal.SIGXCPU}
        for call, error in ((failing, OSError), (unpicklable, TypeError)):
            with pytest.raises(error):
                pool.submit(call).result()
        assert pool.submit(described).result()[0] == process  # errors end no worker
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()


def test_in_this_process_a_call_is_made_where_its_result_is_asked_for():
    made = []
    with InThisProcess() as pool:
        future = pool.submit(made.append, 1)
        assert (made, future.done()) == ([], True)
        future.result()
        assert made == [1]
        assert list(pool.map(divmod, [7, 9], [2, 4])) == [(3, 1), (2, 1)]
