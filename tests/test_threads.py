"""Delays of threads at barriers of the core (docs/threads.md) do not change a bit."""

import os
import shutil
import subprocess
import sys

import pytest

from pyfric import core
from pyfric.core.builds import SPINS

BARRIER = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <unistd.h>

/* libgomp's barrier: a thread comes to it late, or leaves it late; without WAIT there is none. */
void GOMP_barrier(void)
{
    static void (*barrier)(void);
    static _Thread_local unsigned seed;
    const char *wait = getenv("WAIT");
    if (!barrier) barrier = (void (*)(void))dlsym(RTLD_NEXT, "GOMP_barrier");
    if (!seed) seed = atoi(getenv("SEED")) + (unsigned)(size_t)&seed / 64;
    if (rand_r(&seed) % 8 == 0) usleep(rand_r(&seed) % 200);
    if (wait) barrier();
    if (rand_r(&seed) % 8 == 0) usleep(rand_r(&seed) % 200);
}
"""
"""Barriers of libgomp, with random delays."""

RUNS = """
import os
from test_core import random_state, wide
from helpers import advance, bits, log_bits

WAYS = [{}, {"stepper": "verlet"}]
if "WAIT" in os.environ:  # without barriers a search for a switch may never end
    WAYS += [{"switching": "located"}]
    WAYS += [{"stepper": "adaptive", "switching": "located", "rtol": 1e-3}]
for kind, geometry in (("rod", "finite"), ("free", "linear")):
    scene = wide(kind, 1e-6)
    start = random_state(scene, geometry)
    for how in WAYS:
        found = []
        for threads in (1, 2, scene.N_z):
            state = start.copy()
            log = advance(scene, geometry, state, 40, threads=threads, **how)
            found.append((bits(state), log_bits(log)))
        print("same" if found[1:] == found[:1] * 2 else "different", log.n_switch)
"""


@pytest.fixture(scope="module")
def barrier(tmp_path_factory):
    cc = os.environ.get("CC", "cc")
    if not (sys.platform == "linux" and shutil.which(cc) and core.build_info()["openmp"]):
        pytest.skip("needs Linux, a C compiler and OpenMP")
    folder = tmp_path_factory.mktemp("barrier")
    (folder / "barrier.c").write_text(BARRIER)
    words = [cc, "-shared", "-fPIC", "-O1", "-o", "barrier.so", "barrier.c", "-Wl,--no-as-needed"]
    env = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    words += ["-lgomp", "-ldl"]
    done = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no libgomp to link with: {done.stderr}")
    return folder / "barrier.so"


def run(library, **environment):
    """Return a checksum and the number of contact switches for each way of stepping."""
    preloaded = [os.environ.get("LD_PRELOAD", ""), str(library)]
    env = os.environ | {"LD_PRELOAD": " ".join(filter(None, preloaded))} | environment
    paths = [os.path.dirname(__file__), os.environ.get("PYTHONPATH", "")]
    env["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    words = [sys.executable, "-c", RUNS]
    done = subprocess.run(words, env=env, capture_output=True, text=True, timeout=300)
    return done.returncode, [line.split() for line in done.stdout.splitlines()], done.stderr


@pytest.mark.slow
def test_late_threads_do_not_change_a_bit(barrier):
    code, lines, stderr = run(barrier, WAIT="1", SEED="1")
    assert code == 0, stderr
    assert len(lines) == 8
    assert all(word == "same" and int(n) > 5 for word, n in lines), lines


def test_without_barriers_the_delays_show(barrier):
    code, lines, stderr = run(barrier, SEED="1")
    assert code < 0 or any(word == "different" for word, _ in lines), stderr


FORK = """
import multiprocessing, sys
from test_core import wide
import pyfric
from pyfric import core
from pyfric.core import builds

builds.BLOCKS_PER_THREAD = 1
builds.processors = lambda: 2
scene = wide("rod", 1e-6)


def run():
    record = pyfric.simulate(scene, 5e-6, fidelity="dynamic", progress=False)
    notes = [note for note in record.notes if "fork" in note]
    return record.method.threads, record.curve["F_T"].to_numpy().tobytes(), notes


here = run()
with multiprocessing.get_context("fork").Pool(1) as pool:
    there = pool.apply_async(run).get(timeout=60)
print(here[0], there[0], here[1] == there[1], here[2], *there[2])
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_child_made_by_fork_runs_on_one_thread_and_says_so():
    if not core.build_info()["openmp"]:
        pytest.skip("needs OpenMP")
    paths = [os.path.dirname(__file__), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", FORK],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout.startswith("2 1 True [] dynamic: it ran on one thread, because"), done


@pytest.mark.parametrize(("said", "looks"), [({}, SPINS), ({"GOMP_SPINCOUNT": "77"}, "77")])
def test_threads_at_a_barrier_sleep_soon_unless_the_environment_says_how_they_wait(said, looks):
    if not core.build_info()["openmp"]:
        pytest.skip("needs OpenMP")
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMP_", "GOMP_"))}
    code = "import os, pyfric.core; print(os.environ.get('GOMP_SPINCOUNT'))"
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env=kept | {"OMP_DISPLAY_ENV": "VERBOSE"} | said,
        capture_output=True,
        text=True,
        check=True,
    )
    if "libgomp" not in ran.stderr and "GOMP_SPINCOUNT" not in ran.stderr:
        pytest.skip("another OpenMP than libgomp")
    assert f"GOMP_SPINCOUNT = '{looks}'" in ran.stderr
    assert ran.stdout.strip() == said.get("GOMP_SPINCOUNT", "None")  # other settings stay
