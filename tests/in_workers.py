"""Functions that tests call in other processes, which cannot import tests."""

import os
import signal
import threading
import time

from threadpoolctl import threadpool_info

from pyfric.sweeps import runs


def counted(log, function, *arguments):
    """Call a function of `run_all` in a process that logs each simulation in a file."""
    simulate = runs.simulate

    def noting(scene, *rest, **options):
        with open(log, "a") as file:
            file.write(f"{scene.F_N}\n")
        record = simulate(scene, *rest, **options)
        time.sleep(0.3)
        return record

    runs.simulate = noting
    try:
        return function(*arguments)
    finally:
        runs.simulate = simulate


def described():
    """Return the number of this process, its numbers of threads of BLAS, and blocked signals."""
    threads = {info["num_threads"] for info in threadpool_info() if info["user_api"] == "blas"}
    return os.getpid(), threads, signal.pthread_sigmask(signal.SIG_BLOCK, ())


def failing():
    raise OSError("on purpose")


def unpicklable():
    return threading.Lock()
