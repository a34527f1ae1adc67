"""Speed of the core: ns per block and force evaluation, beside other programs.

Variants of a table are timed in turns in one run, and the least time of each counts. Ratios thus
hold on a noisy machine. A step of RK4 has four force evaluations. "pyfric" is a fourth of a full
step: springs, dashpots, friction, boundaries, the stepper and switching. "forces only" leaves out
the stepper and switching. The other programs (`peers`) evaluate bond forces; LAMMPS with nve also
moves its atoms.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import peers
from sizes import size

from pyfric import core
from pyfric.core import State
from pyfric.scene import Geometry, preset, setup1
from pyfric.statics import loaded_state
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["LATTICES", "RIVAL", "kernel", "limit", "report", "scenes", "threads", "time_peer"]

LATTICES = size(((40, 25), (57, 31), (200, 50), (400, 250), (1000, 1000)), ((5, 4),))
"""Numbers of blocks along x and z; 57 x 31 is the paper's setup 1."""
RIVAL = "LAMMPS harmonic + nve"
"""The reference of ratios: a plain LAMMPS run, `bond_style harmonic`, `fix nve`."""
RIVAL_FORCES = "LAMMPS harmonic, forces only"
"""LAMMPS with fixed atoms, the reference for the force evaluation alone."""
SLIPPING = {"pyfric, all slip": 0.0, "pyfric, all weaken": 1e-3}
"""Rows in which all bottom blocks slip, and d_c (m) of each, for the cost of a table of the law."""
REPEATS, SECONDS, LEAST = size((5, 0.15, 40), (1, 1e-3, 4))
SCENES_END = size(0.25, 1e-3)
"""End of the runs of `scenes`, s."""

Timed = Callable[[int], None]
"""A function that makes n force evaluations."""


def kernel(*, quick: bool = False, progress: bool = False) -> pd.DataFrame:
    """Time the core and other programs on lattices from 10^3 to 10^6 blocks, on one thread.

    Args:
        quick: only the lattices up to 2000 blocks.
        progress: print on stderr what is being timed, if it is a terminal.

    Returns:
        Columns: N_x, N_z, what, geometry, variant, budget, ns (per block and force evaluation).
    """
    rows = []
    for N_x, N_z in LATTICES:
        if quick and N_x * N_z > 2000:
            continue
        scene = _scene(N_x, N_z)
        with ExitStack() as stack:
            timed = _core(scene, 1) | _laws(scene) | _peers(scene, stack)
            for key, seconds in _minima(timed, N_x * N_z, progress).items():
                rows.append((N_x, N_z, *key, 1e9 * seconds / (N_x * N_z)))
    return pd.DataFrame(rows, columns=["N_x", "N_z", "what", "geometry", "variant", "budget", "ns"])


def threads(*, quick: bool = False, progress: bool = False) -> pd.DataFrame:
    """Time the core on 1, 2, … threads, up to the number of processors.

    Args:
        quick: only the lattices up to 10^5 blocks.
        progress: print on stderr what is being timed, if it is a terminal.

    Returns:
        Columns: N_x, N_z, geometry, threads, ns (per block and force evaluation).
    """
    rows = []
    available = core.useful_threads(10**9)
    for N_x, N_z in LATTICES:
        if quick and N_x * N_z > 10**5:
            continue
        scene = _scene(N_x, N_z)
        timed: dict[tuple, Timed] = {}
        for n in range(1, available + 1):
            for (_, geometry, variant, budget), run in _core(scene, n).items():
                if variant == core.VARIANT and budget:
                    timed[geometry, n] = run
        for key, seconds in _minima(timed, N_x * N_z, progress).items():
            rows.append((N_x, N_z, *key, 1e9 * seconds / (N_x * N_z)))
    return pd.DataFrame(rows, columns=["N_x", "N_z", "geometry", "threads", "ns"])


def time_peer(scene: Scene) -> float:
    """Return the time of `RIVAL` per atom and step on the lattice of a scene, in s.

    Raises:
        ImportError: LAMMPS is not installed.
    """
    n_blocks = scene.N_x * scene.N_z
    with peers.lammps_bonds(scene, integrate=True, style="harmonic") as atoms:
        (least,) = _minima({(RIVAL,): atoms.run}, n_blocks, progress=False).values()
    return least / n_blocks


ADDITIONS = {"linear": 38, "finite": 84}
"""Additions, subtractions and comparisons per block in one force evaluation, in the loops of
fortran/lattice.f90 and finite.f90. Multiplications are fewer, and the processor has separate units
for them. Linear: 10 for the springs and 9 for the dashpots, in each direction. Finite: 12 for each
of the two straight springs, 14 for each of the two diagonal springs, 14 to sum their forces, 18 for
the dashpots."""
STEP_ADDITIONS = 4
"""Additions of the stepper in each stage."""
ALONE = ("additions",)
"""Key of the measurement of additions alone."""


def limit() -> pd.DataFrame:
    """Compare the core with the highest rate of additions of this processor, on the Fig. 1 lattice.

    Kernels and plain additions take turns, so changes in the processor's speed affect both. Fused
    multiply-adds would save additions, but the last bits of results would then depend on the
    processor.

    Returns:
        Columns: what, geometry, additions (per block and evaluation), limit (ns, if only additions
        took time), ns (measured), share (limit over ns). The attribute "peak" of the frame is
        additions per ns.
    """
    scene, n = _scene(57, 31), 10**4
    timed = {key: run for key, run in _core(scene, 1).items() if key[2:] == (core.VARIANT, False)}
    timed[ALONE] = lambda turns: core.additions(turns * n) and None
    found = _minima(timed, scene.N_x * scene.N_z, progress=False)
    peak = core.additions(n) / found.pop(ALONE) * 1e-9
    rows = []
    for (what, geometry, *_), seconds in found.items():
        count = ADDITIONS[geometry] + (STEP_ADDITIONS if what == "pyfric" else 0)
        ns = seconds / (scene.N_x * scene.N_z) * 1e9
        row = {"what": what, "geometry": geometry, "additions": count, "limit": count / peak}
        rows.append(row | {"ns": ns, "share": count / peak / ns})
    frame = pd.DataFrame(rows)
    frame.attrs["peak"] = peak
    return frame


def scenes(*, quick: bool = False, progress: bool = False) -> pd.DataFrame:
    """Time independent runs of full dynamics, one after another and side by side in processes.

    Args:
        quick: shorter runs.
        progress: print on stderr what is being timed.

    Returns:
        Columns: workers, runs, seconds (from the first job to the last record, start of the
        processes included), gain (over one worker).
    """
    t_end = min(SCENES_END, 0.01) if quick else SCENES_END
    heights = 2.5e-3 * np.arange(1, 5 if quick else 9)
    how = {"fidelity": "dynamic", "geometry": "linear", "energies": False}
    jobs = [Job(scene=preset("fig1", h=float(h)), t_end=t_end, options=how) for h in heights]
    most = core.useful_threads(10**9)
    rows = []
    for workers in sorted({1, most}):
        if progress:
            print(f"{len(jobs)} runs, {workers} at a time", file=sys.stderr, flush=True)
        start = time.perf_counter()
        run_all(jobs, workers=workers, cache=False, progress=False)
        seconds = time.perf_counter() - start
        rows.append({"workers": workers, "runs": len(jobs), "seconds": seconds})
    frame = pd.DataFrame(rows)
    return frame.assign(gain=frame["seconds"].iloc[0] / frame["seconds"])


def report(frame: pd.DataFrame) -> str:
    """Return a table of `kernel`, `threads` or `scenes` as text, with ratios."""
    if "additions" in frame:
        head = f"{core.VARIANT}: {frame.attrs['peak']:.1f} additions per ns at most; "
        head += "ns per block and force evaluation, 57 x 31 blocks\n\n"
        return head + frame.to_string(index=False, float_format="{:.2f}".format)
    if "workers" in frame:
        return frame.to_string(index=False, float_format="{:.2f}".format)
    frame = frame.assign(lattice=[f"{a} x {b}" for a, b in zip(frame.N_x, frame.N_z, strict=True)])
    lattices = list(dict.fromkeys(frame.lattice))
    head = f"pyfric {core.VARIANT}, {core.build_info()['compiler']}; "
    head += "ns per block and force evaluation\n\n"
    if "threads" in frame:
        table = frame.pivot(index=["geometry", "threads"], columns="lattice", values="ns")[lattices]
        one = table.xs(1, level="threads")
        gain = one.div(table, level="geometry")
        return (
            head
            + _text(table, "{:.2f}")
            + "\n\ntimes faster than one thread\n"
            + _text(gain, "{:.2f}")
        )
    index = ["what", "geometry", "variant", "budget"]
    table = frame.pivot(index=index, columns="lattice", values="ns")[lattices]
    text = head + _text(table, "{:.2f}")
    what = table.index.get_level_values("what")
    for mine, other in (("pyfric", RIVAL), ("pyfric, forces only", RIVAL_FORCES)):
        rival = table[what == other]
        if len(rival):
            gain = rival.iloc[0] / table[what == mine]
            text += f"\n\ntimes faster than {other}\n" + _text(gain, "{:.1f}")
    mu_k, weakens = (table[what == one] for one in SLIPPING)
    if len(mu_k):
        ratio = weakens.droplevel("what") / mu_k.droplevel("what")
        text += "\n\nweakening over d_c beside mu_k, all blocks slip\n" + _text(ratio, "{:.3f}")
    missing = [f"{k}: {v}" for k, v in peers.available().items() if v.startswith("missing")]
    return "\n".join([text, *missing])


def _text(table: pd.DataFrame, form: str) -> str:
    return table.sort_index().to_string(float_format=form.format, na_rep="-")


def _scene(N_x: int, N_z: int) -> Scene:
    l = 2.5e-3
    return setup1(L=(N_x - 1) * l, H=(N_z - 1) * l, l=l)


def _core(scene: Scene, n_threads: int) -> dict[tuple, Timed]:
    """Return functions that run the core, by (what, geometry, variant, budget)."""
    small = scene.N_x * scene.N_z <= 10**4
    found: dict[tuple, Timed] = {}
    for geometry in ("linear", "finite"):
        state = _state(scene, geometry, loaded=small)
        for variant, runs in core.variants().items():
            for budget in (False, True):
                if runs:
                    run = _run(scene, geometry, state, variant, budget, n_threads)
                    found["pyfric", geometry, variant, budget] = run
            if runs and n_threads == 1:
                forces = _forces(scene, geometry, state, variant)
                found["pyfric, forces only", geometry, variant, False] = forces
    return found


def _laws(scene: Scene) -> dict[tuple, Timed]:
    """Return runs in which all bottom blocks slip, with steps so short that no block stops."""
    found: dict[tuple, Timed] = {}
    if scene.N_x * scene.N_z > 10**4:
        return found
    for geometry in ("linear", "finite"):
        state = _state(scene, geometry, loaded=True).with_dt(1e-12)
        state.mode[:], state.y[:, 2], state.rod[3] = 1, 1.0, 1.0
        for what, d_c in SLIPPING.items():
            run = _run(scene.replace(d_c=d_c), geometry, state, core.VARIANT, True, 1)
            found[what, geometry, core.VARIANT, True] = run
    return found


def _state(scene: Scene, geometry: Geometry, *, loaded: bool) -> State:
    """Return the loaded state, or the unstrained state, in which large lattices are as fast."""
    if loaded:
        return loaded_state(scene, geometry).state(scene, 1e-7)
    N_x, N_z = scene.N_x, scene.N_z
    none, p = np.zeros(N_x), np.ones(N_x)
    margin, memory = scene.law.begin(0.0, none, p, none, scene.d)
    return State(
        y=np.zeros((N_z, 4, N_x)),
        rod=np.zeros(6),
        mode=np.zeros(N_x, dtype=np.int32),
        corner=np.zeros(N_x, dtype=np.int32),
        margin=margin,
        memory=memory,
        loss=np.zeros(N_x),
        dissipated=np.zeros(N_z),
        heat=np.zeros(N_x),
        work=np.zeros(2),
        step=0,
        t0=0.0,
        dt=1e-7,
        u_drv0=0.0,
        drive=0.0,
    )


def _run(
    scene: Scene, geometry: Geometry, state: State, variant: str, budget: bool, n_threads: int
) -> Timed:
    packed = core.model(scene, geometry, state.u_drv0)
    state, log = state.copy(), core.Log(scene.N_x)

    def run(n: int) -> None:
        core.advance(
            packed, state, log, max(1, n // 4), budget=budget, threads=n_threads, variant=variant
        )

    return run


def _forces(scene: Scene, geometry: Geometry, state: State, variant: str) -> Timed:
    packed = core.model(scene, geometry, state.u_drv0)
    return lambda n: core.evaluate(packed, state, 0.0, variant, n) and None


def _peers(scene: Scene, stack: ExitStack) -> dict[tuple, Timed]:
    """Return functions that run installed programs, by (what, geometry, variant, budget)."""
    rng = np.random.default_rng(0)
    y = 1e-6 * rng.standard_normal((scene.N_z, 4, scene.N_x))
    found: dict[tuple, Timed] = {}

    def repeated(forces: Callable[[np.ndarray], np.ndarray]) -> Timed:
        def run(n: int) -> None:
            for _ in range(n):
                forces(y)

        return run

    there = {k for k, v in peers.available().items() if not v.startswith("missing")}
    for name, make in (
        ("numpy", peers.numpy_forces),
        ("numba", peers.numba_forces),
    ):
        for geometry in ("linear", "finite"):
            if name in there:
                found[name, geometry, "", False] = repeated(make(scene, geometry))
    if "lammps" in there:
        for what, integrate, style in (
            (RIVAL, True, "harmonic"),
            (RIVAL_FORCES, False, "harmonic"),
            ("LAMMPS harmonic/omp, forces only", False, "harmonic/omp"),
        ):
            atoms = stack.enter_context(peers.lammps_bonds(scene, integrate=integrate, style=style))
            found[what, "finite", "", False] = atoms.run
    return found


def _minima(timed: dict[tuple, Timed], n_blocks: int, progress: bool) -> dict[tuple, float]:
    """Return the least time of one force evaluation of each function, s."""
    count = {}
    for key, run in timed.items():
        run(4)
        start = time.perf_counter()
        run(4)
        once = (time.perf_counter() - start) / 4
        least = LEAST if key[0] != "numpy" else 4
        count[key] = max(least, 4 * round(SECONDS / REPEATS / max(once, 1e-9) / 4))
    found = dict.fromkeys(timed, np.inf)
    progress = progress and sys.stderr.isatty()
    for repeat in range(REPEATS):
        for key, run in timed.items():
            if progress:
                note = f"{n_blocks} blocks, {repeat + 1}/{REPEATS}: {key}"
                print(f"\r{note[:78]:78}", end="", file=sys.stderr, flush=True)
            start = time.perf_counter()
            run(count[key])
            found[key] = min(found[key], (time.perf_counter() - start) / count[key])
    if progress:
        print("\r" + 78 * " " + "\r", end="", file=sys.stderr, flush=True)
    return found
