"""The engines beside each other on the Fig. 1 scene: wall time, work done, agreement.

The yardstick is what a plain compiled version of the paper's method would take: 4.5 million steps
of four force evaluations on 57 x 31 blocks, each at 0.45 of LAMMPS's time per atom and step
(`harmonic` bonds, `nve`), which is timed in the same run. Times hold everything from the scene to
the record, condensation and modes included; imports are not counted. Short runs are repeated, and
the least time counts.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from pyfric.checks import bench_peers
from pyfric.checks.bench import RIVAL, time_peer
from pyfric.engines import prediction_curve, simulate
from pyfric.scene import preset

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["Agreement", "aligned", "compare", "fidelity", "report"]

T_END = 0.9
PAPER_STEPS, EVALUATIONS, SHARE = 4_500_000, 4, 0.45
REPEATS = 5
LONG = 5.0
"""Runs longer than this are made once, s."""


class Agreement(NamedTuple):
    """Largest differences of main events from the trailing edge, in order.

    Attributes:
        events: events compared.
        missing: how many events one of the two has more.
        start, arrest: forces, over F_N.
        blocks: farthest block.
    """

    events: int
    missing: int
    start: float
    arrest: float
    blocks: int


def compare(record: Record, reference: Record) -> Agreement:
    """Compare the main events of two records that reach the trailing edge, in order.

    Where one has more of them, they are paired by their lengths (`aligned`).
    """
    a, b = (
        one.events[one.events["is_main"] & (one.events["L_p_over_L"] > 0) & one.events["finished"]]
        for one in (record, reference)
    )
    i, j = aligned(a["last_block"].to_numpy(), b["last_block"].to_numpy())
    F_N = reference.scene.F_N

    def largest(name: str, unit: float) -> float:
        apart = np.abs(a[name].to_numpy()[i] - b[name].to_numpy()[j])
        return float(np.max(apart, initial=0.0)) / unit

    return Agreement(
        events=len(i),
        missing=abs(len(a) - len(b)),
        start=largest("F_T_start", F_N),
        arrest=largest("F_T_arrest", F_N),
        blocks=int(largest("last_block", 1.0)),
    )


def aligned(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return indices into a and b that pair all of the shorter one, in order, with least |a - b|.

    An event of four blocks in one engine may have three in the other, where it is no main event.
    """
    if len(a) > len(b):
        return aligned(b, a)[::-1]
    n, spare = len(a), len(b) - len(a)
    cost = np.full((n + 1, spare + 1), np.inf)  # a[:i] paired, k of b passed over
    cost[0] = 0.0
    for i in range(n):
        paired = cost[i] + np.abs(float(a[i]) - b[i : i + spare + 1])
        cost[i + 1] = np.minimum.accumulate(paired)
    chosen, k = np.zeros(n, dtype=int), spare
    for i in range(n - 1, -1, -1):
        paired = cost[i, : k + 1] + np.abs(float(a[i]) - b[i : i + k + 1])
        k = int(np.argmin(paired))
        chosen[i] = i + k
    return np.arange(n), chosen


def fidelity(*, progress: bool = False) -> pd.DataFrame:
    """Time every engine on the Fig. 1 scene up to 0.9 s, and the prediction curves.

    Args:
        progress: say on stderr what is running.

    Returns:
        Columns: scene, engine, geometry, seconds, times_yardstick, times_dynamic, steps,
        block_evaluations, events, missing, start, arrest, blocks (see `Agreement`). times_yardstick
        is NaN where LAMMPS is not installed.
    """

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    scene = preset("fig1")
    say(f"{RIVAL} on {scene.N_x} x {scene.N_z} blocks")
    evaluations = PAPER_STEPS * EVALUATIONS * scene.N_x * scene.N_z
    lammps = not bench_peers.available()["lammps"].startswith("missing")
    yardstick = evaluations * SHARE * time_peer(scene) if lammps else np.nan

    rows, reference = [], {}
    for engine, geometry in (
        ("dynamic", "linear"),
        ("dynamic", "finite"),
        ("hybrid", "linear"),
        ("hybrid", "finite"),
        ("quasistatic", "linear"),
    ):
        say(f"{engine}, {geometry} geometry")
        which = geometry if engine != "quasistatic" else None
        record, seconds = _timed(
            lambda engine=engine, which=which: simulate(
                scene,
                T_END,
                fidelity=engine,
                geometry=which,
                budget=False,
                threads=1,
                progress=False,
            )
        )
        if engine == "dynamic":
            reference[geometry] = record, seconds
        long, slow = reference[geometry]
        rows.append(
            {
                "scene": scene.name,
                "engine": engine,
                "geometry": geometry,
                "seconds": seconds,
                "times_yardstick": yardstick / seconds,
                "times_dynamic": slow / seconds,
                "steps": record.counts.get("steps", 0),
                "block_evaluations": record.counts["block_evaluations"],
                **compare(record, long)._asdict(),
            }
        )
    for name in ("fig1", "setup2-", "setup2", "setup2+"):
        say(f"prediction curve, {name}")
        curve: Scene = preset(name)
        _, seconds = _timed(lambda curve=curve: prediction_curve(curve))
        rows.append(
            {
                "scene": name,
                "engine": "prediction",
                "geometry": "linear",
                "seconds": seconds,
                "times_yardstick": yardstick / seconds if name == "fig1" else np.nan,
                "block_evaluations": 0,
            }
        )
    frame = pd.DataFrame(rows)
    frame.attrs["yardstick"] = yardstick
    return frame


def _timed(run: Callable[[], Record]) -> tuple[Record, float]:
    least = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        record = run()
        least = min(least, time.perf_counter() - start)
        if least > LONG:
            break
    return record, least


def report(frame: pd.DataFrame) -> str:
    """Return the table of `fidelity` as text."""
    forms = {
        "seconds": "{:.3f}".format,
        "times_yardstick": "{:.0f}".format,
        "times_dynamic": "{:.1f}".format,
        "block_evaluations": "{:.2e}".format,
        "start": "{:.1e}".format,
        "arrest": "{:.1e}".format,
        **dict.fromkeys(("steps", "events", "missing", "blocks"), "{:.0f}".format),
    }
    table = frame.to_string(formatters=forms, index=False, na_rep="-").replace("nan", "  -")
    head = "Fig. 1 scene up to 0.9 s; start and arrest: largest differences from dynamics, over F_N"
    yardstick = frame.attrs.get("yardstick", np.nan)
    if np.isfinite(yardstick):
        note = f"yardstick: {yardstick:.0f} s, the paper's method at 0.45 of {RIVAL}"
    else:
        note = f"no yardstick: LAMMPS is missing ({bench_peers.INSTALL})"
    return f"{head}\n\n{table}\n\n{note}"
