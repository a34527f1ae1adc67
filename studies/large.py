"""One large lattice: seconds, memory and events of the hybrid engine on the Fig. 1 scene at fine l.

The run is made in a separate process, whose peak memory is measured.
"""

from __future__ import annotations

import multiprocessing
import resource
import time
from concurrent.futures import ProcessPoolExecutor

import pandas as pd
from sizes import size

from pyfric.planning import simulate
from pyfric.scene import preset
from pyfric.signals import at_once

__all__ = ["large", "report"]

FINE, T_END = size((0.25e-3, 0.33), (5e-3, 0.01))
"""Distance of blocks, m, for 561 x 301 blocks; end of the run past the third main precursor, s."""


@at_once()
def large(*, l: float = FINE, t_end: float = T_END, threads: int | None = None) -> pd.DataFrame:
    """Run the Fig. 1 scene in linear geometry on a fine lattice.

    Args:
        l: distance of blocks, in m.
        t_end: end of the run, in s; by default past the third main precursor.
        threads: threads of the core; None means the fastest number.

    Returns:
        One row: N_x, N_z, seconds, processor_seconds, stepping (s), GB (peak memory), steps,
        block_evaluations, jumps, events, main.
    """
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as alone:
        return pd.DataFrame([alone.submit(_measured, l, t_end, threads).result()])


def _measured(l: float, t_end: float, threads: int | None) -> dict[str, float]:
    scene = preset("fig1", l=l)
    start, begin = time.perf_counter(), time.process_time()
    record = simulate(
        scene,
        t_end,
        fidelity="hybrid",
        geometry="linear",
        energies=False,
        threads=threads,
        progress=False,
    )
    return {
        "N_x": scene.N_x,
        "N_z": scene.N_z,
        "seconds": time.perf_counter() - start,
        "processor_seconds": time.process_time() - begin,
        "stepping": record.timings["stepping"],
        "GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        **{name: record.counts[name] for name in ("steps", "block_evaluations", "jumps")},
        "events": len(record.events),
        "main": int(record.events["is_main"].sum()),
    }


def report(frame: pd.DataFrame) -> str:
    """Return the row of `large` as text."""
    row = frame.iloc[0]
    return (
        f"Fig. 1 scene on {row.N_x:.0f} x {row.N_z:.0f} blocks, hybrid, linear geometry: "
        f"{row.main:.0f} main events of {row.events:.0f}\n"
        f"{row.seconds:.1f} s ({row.processor_seconds:.1f} s of processors), at most {row.GB:.2f} "
        f"GB, {row.steps:.0f} steps, {row.block_evaluations:.2e} block evaluations, "
        f"{row.jumps:.0f} jumps"
    )
