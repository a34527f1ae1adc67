"""Simulations that are noted in a file, in processes that know no tests."""

import time

from pyfric.sweeps import sweep


def counted(log, function, *arguments):
    """Call a function of `run_all` in a process that notes each simulation in a file."""
    simulate = sweep.simulate

    def noting(scene, *rest, **options):
        with open(log, "a") as file:
            file.write(f"{scene.F_N}\n")
        record = simulate(scene, *rest, **options)
        time.sleep(0.3)
        return record

    sweep.simulate = noting
    try:
        return function(*arguments)
    finally:
        sweep.simulate = simulate
