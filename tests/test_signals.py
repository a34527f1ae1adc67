"""Signals: commands stop with a message, runs keep their records, loops end, files are complete."""

import contextlib
import fcntl
import os
import resource
import selectors
import signal
import subprocess
import sys
import termios
import threading
import weakref
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers import WATCHED, same_run, small

import pyfric
from pyfric.checks import regimes
from pyfric.cli.commands import main
from pyfric.engines.recorder import Recorder
from pyfric.signals import (
    SIGNALS,
    at_once,
    commanded,
    held_back,
    nothing_to_save,
    saved_first,
)
from pyfric.sweeps import runs
from pyfric.values import written

LONG = {"fidelity": "dynamic", "geometry": "linear", "threads": 1}


def press(*_):
    os.kill(os.getpid(), signal.SIGINT)


def interrupted(**changes):
    """Return a run that Ctrl-C ends."""
    return pyfric.simulate(small(**changes), 1e3, progress=press, **LONG)


# --- in Python -----------------------------------------------------------------------------------


def test_a_loop_ends_with_its_second_call():
    records = []
    loop = (records.append(interrupted(h=h)) for h in (5e-3, 7.5e-3, 10e-3))
    with pytest.raises(KeyboardInterrupt):
        list(loop)
    assert [record.status for record in records] == ["interrupted"]
    assert pyfric.simulate(small(), 1e-5, progress=False).status == "complete"  # reported once


@pytest.mark.parametrize(
    "call",
    [
        lambda: pyfric.plan(small()),
        lambda: pyfric.prediction_curve(small()),
        lambda: pyfric.run_all([]),
    ],
    ids=["plan", "prediction_curve", "run_all"],
)
def test_other_calls_end_a_loop_too(call):
    interrupted()
    with pytest.raises(KeyboardInterrupt):
        call()
    call()


def test_a_coarser_run_is_not_lost():
    """Ctrl-C comes in the second level: the first is complete, and is compared so far."""
    levels = []

    def progress(shown):
        levels.append(shown.t)
        if len(levels) > 1 and shown.t < levels[-2]:
            press()

    record = pyfric.simulate("fig1", 0.9, tolerance=0.1, progress=progress)
    assert record.status == "complete"
    assert record.method.engine == "quasistatic"
    assert record.errors is None or record.errors.holds is not True
    with pytest.raises(KeyboardInterrupt):
        pyfric.plan(small())


def test_an_interrupted_record_goes_on():
    record = interrupted()
    t_end = record.final_state.t + 1e-5
    more = pyfric.simulate(record.scene, t_end, initial=record, progress=False)
    assert more.status == "complete"


def test_another_cell_starts_afresh():
    names = {"interrupted": interrupted, "pyfric": pyfric, "small": small}
    exec(compile("record = interrupted()", "cell 1", "exec"), names)
    exec(compile("again = pyfric.simulate(small(), 1e-5, progress=False)", "2", "exec"), names)
    assert [names[one].status for one in ("record", "again")] == ["interrupted", "complete"]


def test_the_record_is_closed_whatever_is_pressed(monkeypatch, capfd):
    catalogue = Recorder.catalogue

    def pressing(self, state):
        press()
        press()
        return catalogue(self, state)

    monkeypatch.setattr(Recorder, "catalogue", pressing)
    assert interrupted().status == "interrupted"
    assert "saving, please wait" in capfd.readouterr().err
    with pytest.raises(KeyboardInterrupt):
        pyfric.plan(small())


@pytest.mark.parametrize("fidelity", ["quasistatic", "hybrid"])
def test_where_a_part_is_of_no_use_ctrl_c_raises(fidelity):
    with pytest.raises(KeyboardInterrupt), at_once():
        pyfric.simulate(small(), 1e3, fidelity=fidelity, progress=press)
    assert pyfric.simulate(small(), 1e-5, progress=False).status == "complete"


def test_ctrl_c_waits_until_a_file_is_written(tmp_path, capfd):
    path = tmp_path / "a.txt"

    def save():
        with written(path) as draft:
            draft.write_text("all")
            press()
            press()

    with pytest.raises(KeyboardInterrupt):
        save()
    assert path.read_text() == "all"
    assert "saving, please wait" in capfd.readouterr().err


def test_ctrl_c_after_a_block_goes_to_who_was_there_before():
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append("pressed"))
    try:
        with held_back():
            press()
            assert came == []
        assert came == ["pressed"]
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_record_is_saved_whatever_is_pressed(tmp_path, monkeypatch):
    record = pyfric.simulate(small(), 1e-5, progress=False)
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda *a: [press(), press(), replace(*a)])
    with pytest.raises(KeyboardInterrupt):
        record.save(tmp_path / "a.nc")
    assert pyfric.Record.load(tmp_path / "a.nc").status == "complete"


def then_press(simulate):
    def pressing(*arguments, **options):
        record = simulate(*arguments, **options)
        press()
        return record

    return pressing


def test_a_finished_point_is_kept_whatever_is_pressed(tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "simulate", then_press(runs.simulate))
    job = pyfric.Job(scene=small(), t_end=1e-5, options={"fidelity": "dynamic"})
    with pytest.raises(KeyboardInterrupt):
        pyfric.run_all([job], workers=1, cache=tmp_path, progress=False)
    assert pyfric.Record.load(tmp_path / f"{job.key}.nc").status == "complete"


def test_what_a_run_gives_is_saved_first_unless_it_is_of_no_use():
    passed = []

    def done(*calls):
        with saved_first():
            pyfric.simulate(small(), 1e-5, progress=False, fidelity="dynamic")
            press()
            for call in calls:
                call()
            passed.append(calls)

    with pytest.raises(KeyboardInterrupt):
        done()
    with pytest.raises(KeyboardInterrupt):
        done(nothing_to_save)
    assert passed == [()]
    nothing_to_save()


def test_outside_the_main_thread_nothing_is_heard():
    done = []

    def use():
        with at_once(), saved_first(), held_back(), commanded():
            nothing_to_save()
            done.append(pyfric.simulate(small(), 1e-5, progress=False).status)

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert done == ["complete"]
    assert signal.getsignal(signal.SIGINT) is before


# --- commands ------------------------------------------------------------------------------------


@contextlib.contextmanager
def started(*command):
    process = subprocess.Popen(
        [sys.executable, "-P", *map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(process, text):
    """Read the stderr of a process until it has a text."""
    shown = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stderr, selectors.EVENT_READ)
        while text not in shown:
            assert selector.select(120), shown
            piece = os.read(process.stderr.fileno(), 4096)
            assert piece, shown
            shown += piece


def children():
    """Return the processor time of all child processes that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def processor_time(number):
    words = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def check_stops(process, number=signal.SIGINT):
    """Send a signal; check that the process stops; return its stdout and stderr."""
    before = children() + processor_time(process.pid)
    process.send_signal(number)
    stdout, stderr = (text.decode() for text in process.communicate(timeout=60))
    seconds = children() - before
    assert process.returncode == 128 + number, stderr
    assert "interrupted" in stderr
    assert "Traceback" not in stderr
    assert "FAIL" not in stdout
    assert seconds < 2  # processor time, independent of other load
    return stdout, stderr


@pytest.mark.parametrize(
    ("command", "moment"),
    [("run fig1 --t-end 1", "click"), ("run fig1 --t-end 1", "numpy"), ("plan fig1", "pydantic")],
)
def test_the_first_moments_end_without_traceback(command, moment):
    with started("-X", "importtime", "-m", "pyfric", *command.split()) as process:
        wait_for(process, f" {moment}\n".encode())
        check_stops(process)


class Weak:
    pass


def test_a_signal_that_python_swallows_shows_no_traceback(capfd):
    """Python cannot raise an exception from the callback of a weak reference."""

    def callback(error):
        def raises(_):
            raise error

        return raises

    with commanded():
        for error in (KeyboardInterrupt(), ValueError("other")):
            one = Weak()
            reference = weakref.ref(one, callback(error))
            del one
            assert reference() is None
    shown = capfd.readouterr().err
    assert "KeyboardInterrupt" not in shown
    assert "ValueError: other" in shown


def test_checks_stop_and_fail_nothing(monkeypatch):
    """Verification, and runs of regimes that may fail, stop without failures."""
    with started("-c", WATCHED, "verify") as process:
        wait_for(process, b"\n")  # the first part is done
        stdout, _ = check_stops(process)
    assert stdout == ""
    run, runs = regimes._run, []

    def pressed(*arguments, **options):
        runs.append(arguments)
        os.kill(os.getpid(), signal.SIGTERM)
        return run(*arguments, **options)

    monkeypatch.setattr(regimes, "_run", pressed)
    result = CliRunner().invoke(main, ["regimes"])
    assert len(runs) == 1
    assert (result.exit_code, result.stdout) == (128 + signal.SIGTERM, "")
    assert "interrupted" in result.stderr


def test_a_run_is_saved_before_figures_are_imported(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyfric.figures", None)
    monkeypatch.delitem(vars(pyfric), "figures", raising=False)
    out, picture = tmp_path / "a.nc", tmp_path / "a"
    command = ["run", "fig1", "--set", "L=0.02", "--t-end", "1e-5", "--quiet", "--overwrite"]
    assert CliRunner().invoke(main, [*command, "--out", str(out)]).exit_code == 0
    out.unlink()
    result = CliRunner().invoke(main, [*command, "--out", str(out), "--figure", str(picture)])
    assert isinstance(result.exception, ImportError)
    assert pyfric.Record.load(out).status == "complete"


SMALL = ["run", "fig1", "--set", "L=0.02", "--set", "H=0.0125", "--set", "V=0.5"]


@pytest.mark.parametrize("number", SIGNALS)
def test_every_signal_saves_the_run_and_gives_its_code(tmp_path, monkeypatch, number):
    simulate, out = pyfric.simulate, tmp_path / "a.nc"

    def signalled(*arguments, progress, **options):
        return simulate(*arguments, progress=lambda _: os.kill(os.getpid(), number), **options)

    monkeypatch.setattr(pyfric, "simulate", signalled)
    before = [signal.getsignal(other) for other in SIGNALS]
    command = [*SMALL, "--fidelity", "dynamic", "--geometry", "linear"]
    command += ["--sample", "10 us", "--out", str(out)]
    result = CliRunner().invoke(main, [*command, "--t-end", "100"])
    assert result.exit_code == 128 + number
    assert "--resume" in result.stderr
    assert "interrupted at t" in result.stdout
    record = pyfric.Record.load(out)
    assert record.status == "interrupted"
    monkeypatch.undo()
    t_end = record.final_state.t + 1e-5
    again = CliRunner().invoke(main, [*command, "--t-end", str(t_end), "--resume"])
    assert again.exit_code == 0
    done = pyfric.Record.load(out)
    assert done.status == "complete"
    if number == signal.SIGINT:
        whole = simulate(record.scene, t_end, progress=False, sample=1e-5, **LONG)
        assert same_run(done, whole, versions={}, counts={})
    assert [signal.getsignal(other) for other in SIGNALS] == before


INSIDE = """
import os, signal
import pyfric
from pyfric.cli.commands import main
pyfric.simulate = lambda *_, **__: exec("os.kill(os.getpid(), signal.SIGUSR1)")
main(["run", "fig1", "--t-end", "1"])
"""


def test_a_signal_inside_a_text_that_is_executed_gives_its_code(tmp_path):
    (tmp_path / "inside.py").write_text(INSIDE)
    found = subprocess.run(
        [sys.executable, "-m", "inside"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (found.returncode, found.stderr) == (128 + signal.SIGUSR1, "interrupted\n")


def test_a_hangup_that_nohup_ignores_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with commanded():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_terminal_that_closes_leaves_a_record_that_continues(tmp_path):
    """A closing terminal sends SIGHUP, and can no longer be written to."""
    out, (ours, theirs) = tmp_path / "a.nc", os.openpty()
    termios.tcsetwinsize(theirs, (24, 120))
    command = [*SMALL, "--fidelity", "dynamic", "--t-end", "100", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", "from pyfric.cli import start; start()", *command],
        **dict.fromkeys(("stdin", "stdout", "stderr"), theirs),
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )
    os.close(theirs)
    try:
        shown = b""
        while b"events" not in shown:
            shown += os.read(ours, 4096)
        os.close(ours)
        assert process.wait(60) == 128 + signal.SIGHUP
    finally:
        process.kill()
        process.wait()
    assert pyfric.Record.load(out).status == "interrupted"


def test_a_run_at_its_end_is_saved_whatever_is_pressed(tmp_path, monkeypatch):
    monkeypatch.setattr(pyfric, "simulate", then_press(pyfric.simulate))
    out = tmp_path / "a.nc"
    command = ["run", "fig1", "--set", "L=0.02", "--t-end", "1e-5", "--quiet", "--out", str(out)]
    result = CliRunner().invoke(main, [*command, "--figure", str(tmp_path / "a")])
    assert (result.exit_code, str(out) in result.stderr) == (130, True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]
    assert pyfric.Record.load(out).status == "complete"


HELPED = """
import os, signal, sys
import numpy as np
from pyfric.engines import integration
{patch}
from pyfric.cli import start
sys.stderr.isatty = lambda: True  # which shows progress
sys.argv[0] = "pyfric"
start()
"""


def test_a_library_that_keeps_the_interpreter_waiting(tmp_path):
    """The factorisation of a large lattice is an example."""
    script = tmp_path / "script.py"
    script.write_text(
        HELPED.format(
            patch="""
def loaded(*arguments):
    matrix = np.random.default_rng(1).random((3500, 3500))
    print("set-up", file=sys.stderr, flush=True)
    np.linalg.eigvals(matrix)

integration.loaded_solver = loaded
"""
        )
    )
    with started(script, "run", "fig1", "--t-end", "1", "--fidelity", "dynamic") as process:
        wait_for(process, b"set-up")
        check_stops(process)


def test_no_ctrl_c_prevents_the_save_of_a_run(tmp_path):
    script, out = tmp_path / "script.py", tmp_path / "a.nc"
    script.write_text(
        HELPED.format(
            patch="""
def press(then):
    def pressed(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        return then(*arguments, **options)
    return pressed

Run = integration.Run
os.replace, Run.record = press(os.replace), press(Run.record)
"""
        )
    )
    small = ("--set", "L=0.02", "--set", "H=0.0125", "--set", "V=0.5", "--fidelity", "dynamic")
    with started(script, "run", "fig1", *small, "--t-end", "100", "--out", out) as process:
        wait_for(process, b"steps/s")
        _, stderr = check_stops(process)
    assert "saving, please wait" in stderr
    assert "--resume" in stderr
    assert pyfric.Record.load(out).status == "interrupted"
