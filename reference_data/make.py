"""Make the reference data again: full dynamics of the paper's scenes, in both geometries.

    python reference_data/make.py [NAME ...]

NAME is a scene (`fig1`) or one set (`fig1_linear`); none means all, which takes about an hour
on one core. pyfric has to be installed. Every scene runs until 0.02 s after its first system-size
event (a main event with L_p = L), with the automatic step and contacts that switch inside steps:
the most accurate of the methods that can be afforded (`pyfric chart`). Each set is a folder:

    events.csv       all events: times (s), forces (N), extents; every digit
    curve.csv        F_T (N) over t (s), about every 2 ms; every digit
    stresses.csv     tau and p (N) at first slip and last stick of the main events, 10 digits;
                     event 0 is the loaded slider
    fronts.csv       fronts of the main events: rupture times (s), front speed v_c (m/s), tau/p just
                     before the event; every digit
    provenance.toml  the scene, how it was run and with what

Blocks n count from 1 at the trailing edge, events from 1.
"""

from __future__ import annotations

import datetime
import subprocess
import sys
import time
from io import StringIO
from itertools import count, product
from pathlib import Path

import numpy as np
import pandas as pd
import tomli_w

import pyfric
from pyfric.values import written

HERE = Path(__file__).resolve().parent
SCENES = ("fig1", "setup2", "setup2-", "run1", "run2", "run3", "run4", "setup2+")
GEOMETRIES = ("linear", "finite")
PIECE, AFTER, SAMPLE, MOST = 0.05, 0.02, 2e-3, 3.0
"""Times in s: of a piece of a run, after the first system-size event, between two points of the
curve, and at which a run without such an event is given up."""
EVENTS = (
    "t_start",
    "t_stop",
    "F_T_start",
    "F_T_arrest",
    "first_block",
    "last_block",
    "nucleation_block",
    "L_p_over_L",
    "n_blocks",
    "n_episodes",
    "n_front",
    "finished",
    "is_precursor",
    "is_main",
    "at_trailing_edge",
)


def say(text: str) -> None:
    print(text, flush=True)


def run(scene: pyfric.Scene, geometry: str, label: str) -> tuple[pyfric.Record, float]:
    """Return the record up to `AFTER` the first system-size event, and its wall time in s."""
    start, record = time.perf_counter(), None
    for piece in count(1):
        t_end = round(piece * PIECE, 9)
        record = pyfric.simulate(
            scene,
            t_end,
            fidelity="dynamic",
            geometry=geometry,
            switching="located",
            energies=False,
            sample=SAMPLE,
            threads=1,
            progress=False,
            initial=record,
        )
        wall = time.perf_counter() - start
        if record.status != "complete":
            raise SystemExit(f"{label}: {record.status} at t = {t_end:.3f} s, nothing written")
        events, force = record.events, record.curve["F_T"].iloc[-1] / scene.F_N
        whole = events[events["is_main"] & (events["L_p_over_L"] == 1)]
        say(f"{label}: {t_end:.2f} s, F_T/F_N {force:.3f}, {len(events)} events, {wall:.0f} s")
        if len(whole) and t_end >= whole["t_stop"].iloc[0] + AFTER:
            return record, wall
        if t_end > MOST:
            raise SystemExit(f"{label}: no system-size event before {MOST} s, nothing written")


def tables(record: pyfric.Record) -> dict[str, pd.DataFrame]:
    """Return the tables of a set."""
    main = np.flatnonzero(record.events["is_main"])
    n = np.asarray(record.scene.n_of_i)
    stresses = {"event": np.repeat([0, *main + 1], len(n)), "n": np.tile(n, len(main) + 1)}
    for name, first in (
        ("tau_before", record.tau_initial),
        ("p_before", record.p_initial),
        ("tau_after", np.full(len(n), np.nan)),
        ("p_after", np.full(len(n), np.nan)),
    ):
        values = np.concatenate([first, getattr(record, name)[main].ravel()])
        stresses[name] = [f"{value:.10g}" for value in values]
    row, i = np.nonzero(np.isfinite(record.rupture_times[main]))
    times = record.rupture_times[main]
    v_c = pyfric.front_speed(times, record.scene.slider.l, record.scene.d)
    with np.errstate(divide="ignore", invalid="ignore"):  # an open block has no tau/p
        ratio = record.tau_before[main] / record.p_before[main]
    fronts = {"event": main[row] + 1, "n": n[i]}
    fronts |= {"t": times[row, i], "v_c": v_c[row, i], "tau_over_p": ratio[row, i]}
    events = record.events[list(EVENTS)].reset_index()
    return {
        "events": events,
        "curve": record.curve,
        "stresses": pd.DataFrame(stresses),
        "fronts": pd.DataFrame(fronts),
    }


def commit() -> str:
    """Return the commit that last changed pyfric's sources in the checkout of this script."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=HERE.parent, capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    sources = ("--", "fortran", "pyfric", "meson.build")
    changed = " with uncommitted changes" if git("status", "--porcelain", *sources) else ""
    return (git("log", "-1", "--format=%H", *sources) or "unknown") + changed


def write(folder: Path, tables: dict[str, pd.DataFrame], about: dict) -> None:
    """Write a set; its provenance goes first and comes last, so that half a set has none."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "provenance.toml").unlink(missing_ok=True)
    for name, table in tables.items():
        text = StringIO()
        table.to_csv(text, index=False, lineterminator="\n")
        with written(folder / f"{name}.csv") as draft:
            draft.write_text(text.getvalue(), encoding="utf-8", newline="\n")
    with written(folder / "provenance.toml") as draft:
        text = tomli_w.dumps(about, multiline_strings=True)
        draft.write_text(text, encoding="utf-8", newline="\n")


def provenance(record: pyfric.Record, wall: float, made_from: str, command: str) -> dict:
    """Return the scene, how it was run and with what; the run took `wall` s."""
    method = record.method
    versions = dict(record.versions) | {"pandas": pd.__version__}
    return {
        "engine": method.engine,
        "geometry": method.geometry,
        "stepper": method.stepper,
        "switching": method.switching,
        "dt": method.dt,
        "steps": record.counts["steps"],
        "sample": method.sample,
        "t_gap": method.t_gap,
        "t_end": float(record.curve["t"].iloc[-1]),
        "threads": method.threads,
        "variant": method.variant,
        "command": f"python reference_data/{command}",
        "commit": made_from,
        "date": datetime.datetime.now(datetime.UTC).replace(microsecond=0),
        "wall_time": round(wall, 1),
        "scene": record.scene.to_toml(),
        "versions": versions,
    }


def main(names: list[str]) -> None:
    known = {
        f"{scene}_{geometry}": (scene, geometry) for geometry, scene in product(GEOMETRIES, SCENES)
    }
    wanted = [name for name in known if not names or {name, known[name][0]} & set(names)]
    unknown = set(names) - set(known) - set(SCENES)
    if unknown:
        raise SystemExit(
            f"unknown: {', '.join(sorted(unknown))}; known: {', '.join((*SCENES, *known))}"
        )
    made_from = commit()
    say(f"pyfric {pyfric.__version__} from {Path(pyfric.__file__).parent}, {len(wanted)} sets")
    for name in wanted:
        scene, geometry = known[name]
        record, wall = run(pyfric.preset(scene), geometry, name)
        about = provenance(record, wall, made_from, f"make.py {name}")
        write(HERE / name, tables(record), about)
        events = record.events
        say(f"{name}: done, {events['is_main'].sum()} main of {len(events)} events, {wall:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
