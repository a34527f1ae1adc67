"""Cost of fine lattices: processor time, steps and memory of short runs, in this and other builds.

Each run is made on one thread in a separate process, whose peak memory is measured. The builds take
turns, and the least time of each run counts. Other builds are builds of commits. Each commit is
checked out into a temporary folder, installed there, and removed.

Steps are counted by spells. A spell is the time from a first slip until no block slips, and its
kind is the number of blocks that slip in it. If a run jumps over stable slip, the steps of a spell
are unknown, and steps are not counted by spells. Builds that do not count jumps over stable slip
give no steps by spells for runs with d_c.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from sizes import size

if TYPE_CHECKING:
    from pyfric.figures import DataFigure

__all__ = [
    *("CASES", "LATTICES", "LINES", "LONG", "QUICK", "USUAL", "Case"),
    *("built", "figure", "finer", "report", "spells"),
]


class Case(NamedTuple):
    """A call that is timed: arguments of `preset`, end in s, engine (or "plan") and options."""

    scene: str
    changes: dict[str, Any]
    t_end: float
    engine: str = "hybrid"
    geometry: str = "linear"
    accuracy: float | None = None
    dt: float | None = None
    """Step, s, in cases of this build only; None means the default."""


WEAK = {"d_c": 1e-6}
CASES = {
    "5 mm": Case("fig1", {"l": 5e-3}, 0.33),
    "2.5 mm": Case("fig1", {}, 0.33),
    "1.25 mm": Case("fig1", {"l": 1.25e-3}, 0.33),
    "1.25 mm, accuracy 1e-4": Case("fig1", {"l": 1.25e-3}, 0.33, accuracy=1e-4),
    "0.625 mm": Case("fig1", {"l": 0.625e-3}, 0.33),
    "0.625 mm, accuracy 1e-4": Case("fig1", {"l": 0.625e-3}, 0.33, accuracy=1e-4),
    "2.5 mm, finite": Case("fig1", {}, 0.33, geometry="finite"),
    "1.25 mm, finite": Case("fig1", {"l": 1.25e-3}, 0.33, geometry="finite"),
    "5 mm, d_c": Case("fig1", WEAK | {"l": 5e-3}, 0.25),
    "2.5 mm, d_c": Case("fig1", WEAK, 0.25),
    "1.25 mm, d_c": Case("fig1", WEAK | {"l": 1.25e-3}, 0.25),
    "0.625 mm, d_c": Case("fig1", WEAK | {"l": 0.625e-3}, 0.25),
    "2.5 mm, d_c, finite": Case("fig1", WEAK, 0.3, geometry="finite"),
    "1.25 mm, d_c, finite": Case("fig1", WEAK | {"l": 1.25e-3}, 0.25, geometry="finite"),
    "setup 2, theta = 0.833": Case("setup2", {"theta": 0.833}, 0.3, geometry="finite"),
    "561 x 301": Case("fig1", {"l": 0.25e-3}, 0.18),
    "whole curve": Case("fig1", {}, 0.9),
    "whole curve, finite": Case("fig1", {}, 0.9, geometry="finite"),
    "sequence": Case("fig1", {}, 0.9, "quasistatic"),
    "sequence, disorder": Case("fig1", {"disorder": 0.05}, 0.9, "quasistatic"),
    "plan": Case("fig1", {}, 0.9, "plan"),
    "561 x 301, to 0.33 s": Case("fig1", {"l": 0.25e-3}, 0.33),
    "0.625 mm, d_c, to 0.745 s": Case("fig1", WEAK | {"l": 0.625e-3}, 0.745),
}
"""Fig. 1 scene with blocks of l, without and with d_c = 1 um, in linear geometry unless named."""
LATTICES = size(("5 mm", "2.5 mm", "1.25 mm", "0.625 mm"), ("5 mm", "2.5 mm"))
LINES = {"d_c = 0": LATTICES}
LINES |= size({"d_c = 1 um": tuple(f"{name}, d_c" for name in LATTICES)}, {})
"""Cases of the chart of cost against l."""
SLOPES = {3: r"$\times$ 8", 4: r"$\times$ 16"}
"""Powers of 1/l in the chart: 3 for blocks times steps, 4 with waits in proportion to 1/l."""
BUILDS = (("-", "o"), (":", "s"), ("-.", "^"))
"""Line and marker of each build."""
QUICK = ("2.5 mm", "sequence", "plan")
LONG = ("561 x 301, to 0.33 s", "0.625 mm, d_c, to 0.745 s")
"""Cases that take minutes, which run only if they are named."""
USUAL = size(tuple(name for name in CASES if name not in LONG), LATTICES[:1])
REPEATS = size(2, 1)
SHORT, JUMPS = 0.25, 1e-8
"""Step (as a share of the stability limit) and accuracy of the reference runs for errors."""
LOADED = size(0.12, 0.01)
"""End of a small run that loads all modules before timing, s."""
SIZES = {"slip_1": (1, 1), "slip_2_3": (2, 3), "slip_4_10": (4, 10), "fronts": (11, 2**31)}
"""Kinds of spells, by the least and the largest number of blocks that slip."""

THERE = Path(__file__).resolve()


def finer(
    cases: Sequence[str] = USUAL,
    *,
    commits: Sequence[str] = (),
    repeats: int = REPEATS,
    errors: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Measure the cost of runs with this build and builds of commits, in turns.

    Args:
        cases: names in `CASES`.
        commits: of this repository.
        repeats: turns; the least time counts.
        errors: measure errors of forces, too.
        say: called with the name of each run.

    Returns:
        One row for each case and build: case, build, seconds (processor time), GB (peak memory),
        steps, attempts, refused, slides, modal_bases, main, events; steps within spells by the
        number of blocks (`SIZES`), and outside of spells (`at_rest`); `error` and `error_jumps`.
        Errors are the largest of the forces at which events start, over F_N, NaN if the number of
        events differs. The reference of `error` is a run of this build with accurate jumps and
        steps of `SHORT` of the stability limit of RK4. The reference of `error_jumps`, for this
        build only, is a run with accurate jumps and the same steps.
    """
    rows: list[dict[str, Any]] = []
    exact: dict[str, np.ndarray] = {}
    with contextlib.ExitStack() as stack:
        builds: dict[str, Path | None] = {"this": None}
        for commit in commits:
            say(f"building {commit}")
            builds[commit] = stack.enter_context(built(commit))
        for name in cases:
            case, only = CASES[name], ("this",) if CASES[name].accuracy else tuple(builds)
            found: dict[str, list[dict[str, Any]]] = {build: [] for build in only}
            for _ in range(repeats):
                for build in only:
                    say(f"{name}: {build}")
                    found[build].append(_alone(case, builds[build]))
            compares = errors and case.engine == "hybrid"
            for build, turns in found.items():
                least = min(turns, key=lambda turn: turn["seconds"])
                starts, dt = least.pop("starts", ()), least.pop("dt", None)
                if compares:
                    say(f"{name}: accurate runs")
                    own = case._replace(accuracy=JUMPS, dt=dt)
                    least["error"] = _error(starts, case._replace(accuracy=JUMPS, dt=0.0), exact)
                    if build == "this":
                        least["error_jumps"] = _error(starts, own, exact)
                rows.append({"case": name, "build": build, **least})
    return pd.DataFrame(rows)


def _error(starts: Sequence[float], than: Case, exact: dict[str, np.ndarray]) -> float:
    """Return the largest difference of forces from those of a reference run, which is made once."""
    key = json.dumps(than)
    if key not in exact:
        exact[key] = np.array(_alone(than, None)["starts"])
    known = exact[key]
    return float(np.abs(starts - known).max()) if len(starts) == len(known) else np.nan


@contextlib.contextmanager
def built(commit: str) -> Iterator[Path]:
    """Install the package as it was at a commit into a temporary folder.

    Raises:
        subprocess.CalledProcessError: there is no such commit, or the commit cannot be built.
    """
    git = ["git", "-C", str(THERE.parents[1])]
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "source"), Path(folder, "installed")
        subprocess.run([*git, "worktree", "add", "--quiet", "--detach", source, commit], check=True)
        try:
            pip = [sys.executable, "-I", "-m", "pip", "install", "--quiet", "--no-deps"]
            pip += ["--no-build-isolation", "--target", target, source]
            path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
            subprocess.run(pip, check=True, env=os.environ | {"PATH": path})
            yield target
        finally:
            subprocess.run([*git, "worktree", "remove", "--force", source], check=True)


def _alone(case: Case, folder: Path | None) -> dict[str, Any]:
    """Return the cost of a case with the package in a folder; None means the installed package."""
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"}
    found = [folder, THERE.parent] if folder is not None else [THERE.parent]
    env["PYTHONPATH"] = os.pathsep.join(map(str, found))
    run = [sys.executable, str(THERE), json.dumps(case)]
    done = subprocess.run(run, env=env, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def measured(case: Case) -> dict[str, Any]:
    """Return the cost of a case in this process, apart from loading modules."""
    import resource
    import time

    from pyfric.scene import Spread, preset, setup1

    changes = dict(case.changes)
    if width := changes.pop("disorder", None):
        mean = preset(case.scene).interface.mu_s
        changes["mu_s"] = Spread(mean=mean, range=np.sqrt(3) * width * mean, seed=1)
    scene = preset(case.scene, **changes)
    _run(case, setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3), LOADED)
    begin = time.process_time()
    record = _run(case, scene, case.t_end)
    seconds, most = time.process_time() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = {"seconds": seconds, "GB": most * 1024 / 1e9}
    return found if record is None else found | _counted(record, case)


def _run(case: Case, scene: Any, t_end: float) -> Any:
    """Make the run of a case; return its record, or None for a plan."""
    import pyfric

    if case.engine == "plan":
        pyfric.plan(scene, t_end=t_end)
        return None
    how: dict[str, Any] = {"fidelity": case.engine, "progress": False}
    if case.accuracy is not None:
        how["accuracy"] = case.accuracy
    if case.dt is not None:
        from pyfric.statics import stability_limit

        how["dt"] = case.dt or SHORT * stability_limit(scene)[0]
    if case.engine in ("hybrid", "dynamic"):  # older builds name this option "budget"
        names = ("energies", "budget")
        without = next(name for name in names if hasattr(pyfric.Options(), name))
        how |= {"geometry": case.geometry, "threads": 1, without: False}
    return pyfric.simulate(scene, t_end, **how)


def _counted(record: Any, case: Case) -> dict[str, Any]:
    counts = record.counts
    found: dict[str, Any] = {
        "main": int(record.events["is_main"].sum()),
        "events": len(record.events),
    }
    found["starts"] = (record.events["F_T_start"] / record.scene.F_N).tolist()
    found["dt"] = record.method.dt
    if case.engine != "hybrid":
        return found
    steps, jumps = counts["steps"], counts["jumps"]
    found |= {name: counts.get(name) for name in ("attempts", "slides", "modal_bases")}
    attempts = found["attempts"]
    found |= {"steps": steps, "refused": None if attempts is None else attempts - jumps}
    counted = found["slides"] is not None or "d_c" not in case.changes
    if counted and not found["slides"]:
        dt = case.t_end / (steps + counts["steps_spared"])
        lasts, blocks = spells(record.switches, case.t_end)
        for kind, (least, most) in SIZES.items():
            found[kind] = round(lasts[(blocks >= least) & (blocks <= most)].sum() / dt)
        found["at_rest"] = steps - sum(found[kind] for kind in SIZES)
    return found


def spells(switches: Any, t_end: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the durations of spells of slip until t_end (s), in s, and the blocks of each."""
    t, block, old, new = (np.asarray(switches[name]) for name in ("t", "block", "old", "new"))
    slips, before = np.cumsum((np.abs(new) == 1).astype(int) - (np.abs(old) == 1)), 0
    lasts, blocks, begin = [], [], 0
    for n, now in enumerate(slips):
        if before == 0:
            begin = n
        if (before or now) and (now == 0 or n == len(slips) - 1):
            lasts.append((t_end if now else t[n]) - t[begin])
            blocks.append(len(np.unique(block[begin : n + 1])))
        before = now
    return np.array(lasts), np.array(blocks, dtype=int)


def report(frame: pd.DataFrame) -> str:
    """Return a table of `finer` as text, with ratios of other builds' times to this build's."""
    text = frame.to_string(index=False, na_rep="-", float_format="{:.4g}".format)
    times = frame.pivot_table(index="case", columns="build", values="seconds", sort=False)
    others = [build for build in times.columns if build != "this"]
    for build in others:
        ratio = (times[build] / times["this"]).to_string(float_format="{:.2f}".format)
        text += f"\n\nprocessor time of {build} over this build's\n{ratio}"
    return text


def figure(frame: pd.DataFrame) -> DataFigure:
    """Draw processor time against l: full lines for this build, dashed lines for another build."""
    from pyfric.figures import DataFigure
    from pyfric.figures.style import style

    fig = DataFigure(figsize=(4.6, 3.4))
    axes = fig.subplots()
    style(axes)
    for (name, cases), colour in zip(LINES.items(), ("#0072B2", "#C00000"), strict=False):
        l = np.array([1e3 * CASES[case].changes.get("l", 2.5e-3) for case in cases])
        text = f"{name.replace('d_c', r'$d_{c}$')}, to {CASES[cases[0]].t_end:g} s"
        for build, part in frame.groupby("build", sort=False):
            seconds = part.set_index("case")["seconds"].reindex(cases).to_numpy()
            this = build == "this"
            ls, marker = BUILDS[list(frame["build"].unique()).index(build) % len(BUILDS)]
            how = {"ls": ls, "marker": marker, "ms": 4, "lw": 1.2 if this else 0.8}
            axes.loglog(l, seconds, color=colour, label=text if this else build, **how)
            if this and name == next(iter(LINES)):
                for power, said in SLOPES.items():
                    slope = seconds[1] * (l[1] / l) ** power / 4
                    axes.loglog(l, slope, "--", color="0.6", lw=0.7)
                    at = (l[-1], slope[-1])
                    look = {"color": "0.4", "fontsize": 7, "va": "center"}
                    axes.annotate(said, at, (3, 0), textcoords="offset points", **look)
    ticks = sorted({1e3 * CASES[case].changes.get("l", 2.5e-3) for case in LATTICES})
    axes.set_xticks(ticks, [f"{one:g}" for one in ticks])
    axes.minorticks_off()
    axes.set_xlim(6, 0.47)
    axes.set_xlabel("lattice constant $l$ (mm)")
    axes.set_ylabel("processor time (s)")
    axes.legend(fontsize=7, frameon=False, loc="upper left")
    fig.caption = (
        "Processor time of the hybrid engine on one thread, Fig. 1 scene, linear geometry. Dashed: "
        "growth by 8, which blocks times steps take, and by 16 per halving of l."
    )
    fig.tables = {"cost": frame}
    return fig


if __name__ == "__main__":
    print(json.dumps(measured(Case(*json.loads(sys.argv[1])))))
