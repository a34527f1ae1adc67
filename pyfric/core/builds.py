"""Builds of the core: installed builds, and the build in use.

The same Fortran sources are built for several instruction sets. At import the best build that this
processor can run is selected. The environment variable ``PYFRIC_VARIANT`` can name another build.
Results have the same bits with all builds.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
import platform
from typing import Any

import numpy as np

ENVIRONMENT = "PYFRIC_VARIANT"
BLOCKS_PER_THREAD = 5_000
"""Smallest number of blocks per thread with which threads save time. `python studies threads`
measures this number."""
SPINS = "1000"
"""Number of checks of a thread that waits at a barrier, before it sleeps. The checks take about
40 us. With the default of libgomp, 300 000, a thread wastes 13 ms if another thread waits for its
processor. This is up to 9 times the time of the work itself."""


def variants() -> dict[str, bool]:
    """Return installed variants -> whether this processor can run the variant, fastest first."""
    found = {"X86_V2"}
    simd = np.show_config(mode="dicts").get("SIMD Extensions", {})  # as NumPy finds at import
    for names in simd.values():
        if names is not simd.get("not found"):
            found.update(names)
    runs = {
        "v4": bool(found & {"X86_V4", "AVX512_SKX"}),
        "v3": bool(found & {"X86_V3"}) or {"AVX2", "FMA3"} <= found,
        "v2": True,
        "baseline": True,
    }
    installed = {
        name: importlib.util.find_spec(f"pyfric.core._core_{name}") is not None for name in runs
    }
    return {name: runs[name] for name in runs if installed[name]}


@functools.cache
def load_variant(name: str) -> Any:
    """Return the extension module of one variant.

    Raises:
        ImportError: the variant is not installed, or this processor cannot run it.
    """
    known = variants()
    if name not in known:
        listed = ", ".join(known) or "none"
        raise ImportError(f"{ENVIRONMENT} = {name!r}: not installed (installed: {listed})")
    if not known[name]:
        raise ImportError(f"{ENVIRONMENT} = {name!r}: this processor lacks its instructions")
    allowed = _allowed()
    short = not {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"} & set(os.environ)  # none set by the user
    if short:
        os.environ["GOMP_SPINCOUNT"] = SPINS  # libgomp reads this once, when it is loaded
    try:
        return importlib.import_module(f"pyfric.core._core_{name}")
    finally:
        if short:
            del os.environ["GOMP_SPINCOUNT"]
        # With OMP_PROC_BIND, libgomp binds this thread to one processor when it is loaded. All
        # processes that start later, such as workers of sweeps, would share this processor.
        if allowed and _allowed() != allowed:
            os.sched_setaffinity(0, allowed)


def _chosen() -> str:
    wanted = os.environ.get(ENVIRONMENT, "")
    if wanted:
        return wanted
    usable = [name for name, runs in variants().items() if runs]
    if not usable:
        raise ImportError("pyfric is not built: install it with `pip install .`")
    return usable[0]


VARIANT = _chosen()
"""Name of the variant in use."""


def build_info(name: str = VARIANT) -> dict[str, Any]:
    """Return "compiler", "flags" and "openmp" (bool: built with OpenMP) of a variant."""
    compiler, options, openmp = load_variant(name).build_info()
    flags = [
        f for f in options.decode().split() if f.startswith(("-O", "-m", "-f", "-std", "--param"))
    ]
    kept = [f for f in dict.fromkeys(flags) if not f.startswith(("-fpre-include", "-fdiagnostics"))]
    return {
        "compiler": compiler.decode().strip(),
        "flags": " ".join(kept),
        "openmp": bool(openmp),
    }


def lacks() -> list[str]:
    """Return a sentence for each feature that this build lacks."""
    said = []
    if not build_info()["openmp"]:
        said.append("built without OpenMP: every run takes one thread")
    if platform.machine() in ("x86_64", "AMD64") and not set(variants()) - {"baseline"}:
        said.append("built for one instruction set: newer ones of this processor are not used")
    return said


def processors() -> int:
    """Return the number of processors that this process may run on."""
    return len(_allowed()) or os.cpu_count() or 1


def _allowed() -> set[int]:
    """Return the processors that this process may run on, empty if the system has no such list."""
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()


class _Fork:
    """Whether fork made this process. Threads of the core would hang in such a process."""

    child = False

    @classmethod
    def happened(cls) -> None:
        cls.child = True


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_Fork.happened)


def forked() -> bool:
    """Return whether fork made this process. The core then runs on one thread.

    OpenMP in the child process would wait for threads that exist only in the parent process.
    """
    return _Fork.child


def fork_notes(n_blocks: int) -> tuple[str, ...]:
    """Return a note if a lattice of n_blocks runs on one thread because of a fork."""
    if not (forked() and saving_threads(n_blocks) > 1):
        return ()
    return ("it ran on one thread, because fork made its process; spawn makes those with threads",)


def saving_threads(n_blocks: int, threads: int | None = None) -> int:
    """Return the number of threads with which a lattice runs fastest, without a fork."""
    limit = processors() if threads is None else threads
    return max(1, min(limit, n_blocks // BLOCKS_PER_THREAD)) if build_info()["openmp"] else 1


def useful_threads(n_blocks: int, threads: int | None = None) -> int:
    """Return the number of threads with which a lattice of n_blocks runs fastest; 1 after a fork.

    Args:
        n_blocks: N_x N_z.
        threads: largest number to use; None means all processors that this process may run on.
    """
    return 1 if forked() else saving_threads(n_blocks, threads)


def additions(n: int, variant: str = VARIANT) -> int:
    """Make n additions to each of several sums in registers; return the number of additions."""
    width, total = load_variant(variant).additions(n)
    assert total == n * width * (width + 1) // 2
    return n * width
