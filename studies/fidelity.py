"""The engines compared on the Fig. 1 scene: wall time, work done, agreement.

The yardstick is the expected time of a plain compiled version of the paper's method. This version
makes 4.5 million steps of four force evaluations on 57 x 31 blocks. Each evaluation takes 0.45 of
LAMMPS's time per atom and step (`harmonic` bonds, `nve`), which is timed in the same run. Times
include everything from the scene to the record, such as condensation and modes, but no imports.
Short runs are repeated, and the least time counts.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import peers
from bench import RIVAL, time_peer
from sizes import size

from pyfric.engines import prediction_curve
from pyfric.planning import simulate
from pyfric.record import differences
from pyfric.scene import preset
from pyfric.signals import at_once

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["fidelity", "report", "steps_per_switch"]

ROWS = (
    *(
        (engine, geometry, switching)
        for engine in ("dynamic", "hybrid")
        for geometry in ("linear", "finite")
        for switching in ("located", "step_end")
    ),
    ("quasistatic", "linear", "located"),
)
"""Engine, geometry, switching. The quasi-static sequence has no steps; it is compared with located
dynamics."""
T_END, SCENE = size((0.9, {}), (0.012, {"l": 5e-3, "V": 20e-3}))
PAPER_STEPS, EVALUATIONS, SHARE = 4_500_000, 4, 0.45
REPEATS = size(5, 1)
LONG = 5.0
"""Time above which runs are made once, s."""


@at_once()
def fidelity(*, progress: bool = False) -> pd.DataFrame:
    """Time every engine on the Fig. 1 scene up to 0.9 s, and the prediction curves.

    Args:
        progress: print on stderr what is running.

    Returns:
        Columns: scene, engine, geometry, switching, seconds, times_yardstick, times_dynamic, steps,
        block_evaluations, per_switch, events, missing, start, arrest, blocks (see
        `agreement`). times_yardstick is NaN where LAMMPS is not installed; per_switch is the result
        of `steps_per_switch`.
    """

    def say(text: str) -> None:
        if progress:
            print(text, file=sys.stderr, flush=True)

    scene = preset("fig1", **SCENE)
    say(f"{RIVAL} on {scene.N_x} x {scene.N_z} blocks")
    evaluations = PAPER_STEPS * EVALUATIONS * scene.N_x * scene.N_z
    lammps = not peers.available()["lammps"].startswith("missing")
    yardstick = evaluations * SHARE * time_peer(scene) if lammps else np.nan

    rows, reference = [], {}
    for engine, geometry, switching in ROWS:
        say(f"{engine}, {geometry} geometry, switching {switching}")
        asked = {"geometry": geometry, "switching": switching, "threads": 1}
        if engine == "quasistatic":
            asked = {"threads": 1}
        record, seconds = _timed(
            lambda engine=engine, asked=asked: simulate(
                scene, T_END, fidelity=engine, energies=False, progress=False, **asked
            )
        )
        if engine == "dynamic":
            reference[geometry, switching] = record, seconds
        long, slow = reference[geometry, switching]
        rows.append(
            {
                "scene": scene.name,
                "engine": engine,
                "geometry": geometry,
                "switching": switching if engine != "quasistatic" else "-",
                "seconds": seconds,
                "times_yardstick": yardstick / seconds,
                "times_dynamic": slow / seconds,
                "steps": record.counts.get("steps", 0),
                "block_evaluations": record.counts["block_evaluations"],
                "per_switch": steps_per_switch(record),
                **agreement(record, long),
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


def agreement(record: Record, reference: Record) -> dict[str, float]:
    """Return the numbers of main events, and their largest differences between two runs.

    The numbers are those of all events, and of events in only one of the runs. The differences are
    those of start and arrest forces over F_N, and of L_p in blocks.
    """
    found = differences(record, reference)
    most, alone = found.events[["start", "arrest", "length"]].max(), found.events["other"] == 0
    return {
        "events": found.errors()["events"],
        "missing": int(alone.sum()),
        "start": most["start"],
        "arrest": most["arrest"],
        "blocks": round(most["length"] * record.scene.N_x),
    }


def steps_per_switch(record: Record) -> float:
    """Return the cost of a switch, in steps of RK4 on the whole lattice, beyond the steps made.

    The cost is NaN for records without steps or switches.
    """
    steps, switches = record.counts.get("steps", 0), len(record.switches["t"])
    if not steps or not switches:
        return np.nan
    a_step = EVALUATIONS * record.scene.N_x * record.scene.N_z
    return (record.counts["block_evaluations"] / a_step - steps) / switches


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
        "per_switch": "{:.2f}".format,
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
        note = f"no yardstick: LAMMPS is missing ({peers.INSTALL})"
    return f"{head}\n\n{table}\n\n{note}"
