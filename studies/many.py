"""Costs of many quasi-static runs, in this and other builds: records, ensembles, diagrams, fits.

Each case runs in a separate process, which loads modules before timing. The builds take turns, and
the least time of each case counts. The table gives processor time, with that of worker processes,
and wall time, both per run. Other builds may make fewer runs of a case. The fit, which takes
minutes with other builds, is made once.

sequence
    The sequence of the Fig. 1 scene to 0.9 s as a record.
events
    The same sequence, with its table of events.
ensemble
    Sequences with 5 % disorder of mu_s as a table of numbers, on two cores, by `ensemble`. Builds
    without `ensemble` use a `Sweep` with two workers.
diagram
    `phase_diagram` of the Fig. 1 scene over mu_k and mu_s by quasi-static runs, in one process.
sensitivity
    `sensitivity` of the Fig. 1 scene to 0.9 s, 13 runs.
fit
    `fit` of mu_s and mu_k with quasi-static runs of the Fig. 1 scene to a curve of blocks of 5 mm.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from sizes import size

__all__ = ["CASES", "costs", "report"]

T_END = size(0.9, 0.45)
QUICK = {"sequence": 3, "events": 3, "ensemble": 50, "diagram": 2, "sensitivity": 1}
CASES = size(
    {
        "sequence": 20,
        "events": 20,
        "ensemble": 10_000,
        "diagram": 40,
        "sensitivity": 3,
        "fit": 1,
    },
    QUICK,
)
"""Repeats of a case, runs of the ensemble, and values on each axis of the diagram."""
FEWER = {"ensemble": 200, "diagram": 8}
"""Runs of the ensemble, and values on each axis, for builds without `ensemble`."""
ONCE = ("fit",)
"""Cases that are made once."""
WIDTH, CORES, REPEATS = 0.05, 2, size(3, 1)
THERE = Path(__file__).resolve()


def costs(
    cases: Sequence[str] = tuple(CASES),
    *,
    commits: Sequence[str] = (),
    repeats: int = REPEATS,
    quick: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Measure the cost of cases with this build and builds of commits, in turns.

    Args:
        cases: names in `CASES`.
        commits: of this repository.
        repeats: turns, of which the least time counts; cases in `ONCE` have one turn.
        quick: a few runs of each case only.
        say: called with the name of each run.

    Returns:
        One row for each case and build: case, build, runs; processor and wall, s for each run.
    """
    from fine import built

    rows: list[dict[str, Any]] = []
    with contextlib.ExitStack() as stack:
        builds: dict[str, Path | None] = {"this": None}
        for commit in commits:
            say(f"building {commit}")
            builds[commit] = stack.enter_context(built(commit))
        for name in cases:
            found: dict[str, list[dict[str, Any]]] = {build: [] for build in builds}
            for _ in range(1 if name in ONCE else repeats):
                for build, folder in builds.items():
                    say(f"{name}: {build}")
                    found[build].append(_alone(name, quick, folder))
            for build, turns in found.items():
                best = {key: min(turn[key] for turn in turns) for key in ("processor", "wall")}
                rows.append({"case": name, "build": build, "runs": turns[0]["runs"], **best})
    return pd.DataFrame(rows)


def _alone(name: str, quick: bool, folder: Path | None) -> dict[str, Any]:
    """Return the cost of a case with the package in a folder; None means the installed package."""
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"}
    found = [*([] if folder is None else [folder]), THERE.parent]
    env["PYTHONPATH"] = os.pathsep.join(map(str, found))
    run = [sys.executable, str(THERE), name, json.dumps(quick)]
    done = subprocess.run(run, env=env, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def measured(name: str, quick: bool) -> dict[str, Any]:
    """Return the cost of a case in this process: runs, and seconds for each run."""
    import pyfric

    own = hasattr(pyfric, "ensemble")
    times = QUICK[name] if quick else (CASES if own else CASES | FEWER)[name]
    make, runs = _prepared(name, times, own)
    begin, clock = _processor(), time.perf_counter()
    make()
    took = {"processor": _processor() - begin, "wall": time.perf_counter() - clock}
    return {"runs": runs} | {key: seconds / runs for key, seconds in took.items()}


def _processor() -> float:
    """Return the processor time of this process and of its children that have ended, in s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _prepared(name: str, times: int, own: bool) -> tuple[Callable[[], Any], int]:
    """Return a function that makes the runs of a case, and their number."""
    import numpy as np

    import pyfric
    from pyfric.measured import sampled

    how: dict[str, Any] = {"fidelity": "quasistatic", "progress": False}
    scene = pyfric.preset("fig1")
    field = pyfric.Spread(mean=0.7, std=WIDTH * 0.7)
    pyfric.simulate(scene, T_END, **how)  # loads modules

    def records(read: Callable[[Any], Any]) -> None:
        for _ in range(times):
            read(pyfric.simulate(scene, T_END, **how))

    def ensemble() -> Any:
        if own:
            vary = {"mu_s": field}
            return pyfric.ensemble(
                "fig1", vary, times, T_END, cache=False, threads=CORES, progress=False
            ).table
        over = {"interface.mu_s": [pyfric.Spread(**_plain(field, n)) for n in range(times)]}
        options = {"fidelity": "quasistatic"}
        sweep = pyfric.Sweep(scene=scene, t_end=T_END, over=over, points="list", options=options)
        return sweep.run(cache=False, workers=CORES, progress=False).table

    def diagram() -> Any:
        x, y = np.linspace(0.2, 0.6, times), np.linspace(0.62, 1.0, times)
        options = {"fidelity": "quasistatic"}
        axes = {"x": ("mu_k", x), "y": ("mu_s", y), "t_end": T_END, "options": options}
        rest = {"lines": False, "cache": False, "workers": 1, "progress": False}
        return pyfric.phase_diagram("fig1", **axes, **rest)

    def sensitivity() -> None:
        for _ in range(times):
            pyfric.sensitivity(scene, T_END)

    def fit() -> Any:
        truth = pyfric.preset("fig1", l="5 mm", mu_s=0.72, mu_k=0.44)
        record = pyfric.simulate(truth, 1.3, **how)
        curve = sampled(record, "0.5 ms", noise=1e-3, seed=1)
        bounds = {"mu_s": (0.55, 0.85), "mu_k": (0.3, 0.6)}
        return pyfric.fit(scene, curve, bounds, part="all", **how)

    return {
        "sequence": (lambda: records(lambda record: record.curve), times),
        "events": (lambda: records(lambda record: record.events), times),
        "ensemble": (ensemble, times),
        "diagram": (diagram, times**2),
        "sensitivity": (sensitivity, times),
        "fit": (fit, times),
    }[name]


def _plain(field: Any, seed: int) -> dict[str, Any]:
    return {"mean": field.mean, "std": field.std, "seed": seed}


def report(frame: pd.DataFrame) -> str:
    """Return a table of `costs` as text, with ratios of other builds' times to this build's."""
    shown = frame.assign(processor=1e3 * frame["processor"], wall=1e3 * frame["wall"])
    shown = shown.rename(columns={"processor": "processor (ms)", "wall": "wall (ms)"})
    text = shown.to_string(index=False, float_format="{:.4g}".format)
    for kind in ("processor", "wall"):
        times = frame.pivot_table(index="case", columns="build", values=kind, sort=False)
        for build in [name for name in times.columns if name != "this"]:
            ratio = (times[build] / times["this"]).to_string(float_format="{:.3g}".format)
            text += f"\n\n{kind} time of {build} over this build's\n{ratio}"
    return text


if __name__ == "__main__":
    print(json.dumps(measured(sys.argv[1], json.loads(sys.argv[2]))))
