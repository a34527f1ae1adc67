"""Full dynamics of short scenes away from the paper's, and how far the hybrid engine is from it.

    python reference_data/off_box.py [NAME ...]   make sets again; none: all, in three minutes
    python reference_data/off_box.py --ladder     make the quasi-static engine's events again
    python reference_data/off_box.py --table      how far the hybrid engine is from every set

A set is a folder in `off_box/` with what `reference_data/make.py` stores, without stresses. Its
`provenance.toml` says how far two other runs of full dynamics are from it: one with half the step,
and one with a driver faster by 1e-9. Neither changes an event, or a force by more than `HALF_STEP`
and `DRIVER`, so that every event is determined, and an engine that is 1e-6 F_N off is wrong. Sets
named `digest_...` are the runs of `scripts/digests` with located switching; they have the step of
those, and half of it may change more.

`ladder.csv` holds the events of the quasi-static engine, and `table.csv` what `--table` found last.
"""

from __future__ import annotations

import dataclasses
import runpy
import sys
import time
import tomllib
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from make import HERE, commit, provenance, say, tables, write

import pyfric

FOLDER = HERE / "off_box"
SAME_TIME = 1e-12
"""Difference of times that count as one, over that of the run."""
STORED = ("events", "curve", "fronts")
POINTS = 100
"""Points of the curve."""
HALF_STEP, DRIVER = 1e-6, 1e-7
"""Most that half the step, and a driver faster by `FASTER`, may change forces by, over F_N."""
FASTER = 1e-9
EXTENT = ("first_block", "last_block", "nucleation_block", "n_blocks", "n_episodes")
LADDER = ("F_T_start", "F_T_arrest", *EXTENT, "L_p_over_L", "is_main")
BOTH = ("linear", "finite")


class Case(NamedTuple):
    """A scene, the end of its run (s), geometries, step over the automatic one, t_gap (s)."""

    scene: pyfric.Scene
    t_end: float
    geometries: tuple[str, ...] = ("finite",)
    step: float = 0.25
    t_gap: float | None = None


def rod(**changes: Any) -> pyfric.Scene:
    """Setup 1 with 21 x 11 blocks, as much load on each as in the paper, and a faster driver."""
    known = {"L": 0.05, "H": 0.025, "h": 5e-3, "F_N": 1290.0, "V": 0.01}
    return pyfric.preset("setup1", **known | changes)


def free(**changes: Any) -> pyfric.Scene:
    """Setup 2 with 31 x 11 blocks, likewise."""
    known = {"L": 0.03, "H": 0.01, "h": 2e-3, "F_N": 123.0, "V": 5e-3}
    return pyfric.preset("setup2", **known | changes)


def viscous(share: float, **changes: Any) -> pyfric.Scene:
    """Setup 1 with 15 x 8 blocks, and a share of the default viscosity."""
    scene = rod(**{"L": 0.035, "H": 0.0175, "F_N": 921.0} | changes)
    return scene.replace({"slider.eta": share * scene.eta})


CORNERS = ((0.010, 0.01), (0.010, 0.0), (0.013, 0.0), (0.013, 0.02), (0.0185, 0.02))
CORNERS += ((0.0185, -0.03),)
"""The driver holds for 3 ms, goes on twice as fast, and turns back."""
DISORDER = {"interface.mu_s": pyfric.Spread(mean=0.7, std=0.035, seed=1)}
UNEVEN = tuple((60 + 25 * np.cos(1.3 * np.arange(21))).tolist())
k = 13.5e6
STIFF = {"K": 0.041 * k, "k_f": 19 * k, "F_N": 2060.0, "mu_s": 0.6, "mu_k": 0.44, "eta": 7.9}
CASES = {
    "light": Case(rod(F_N=129.0, V=1e-3), 0.03),
    "soft_foundation": Case(rod(k_f=k / 20), 0.031, BOTH),
    "slender": Case(rod(L=0.07, H=5e-3, h=2.5e-3, F_N=223.0, V=2e-3), 0.0395, BOTH, 0.125, 4.2e-4),
    "viscosity_10_light": Case(viscous(1 / 10, F_N=92.1, V=4e-4), 0.0435, BOTH, 0.1),
    "viscosity_20": Case(viscous(1 / 20, V=3e-3), 0.0545, BOTH, 0.1),
    "steep": Case(free(theta=-0.833, V=4.5e-3), 0.033, BOTH),
    "fine": Case(rod(L=0.03, H=0.015, l=1.25e-3, F_N=788.0, V=7.875e-3), 0.03),
    "no_kinetic": Case(free(mu_k=0.0), 0.03, BOTH),
    "chain": Case(pyfric.chain(L=0.05, p=UNEVEN, k_top=2e7, V=0.02), 0.0105, ("linear",)),
    "protocol": Case(rod().replace({"driver.protocol": CORNERS}), 0.034, BOTH, t_gap=2.5e-4),
    "weakening": Case(rod(d_c=1e-6).replace(DISORDER), 0.0291, t_gap=2.5e-4),
    "disorder": Case(free().replace(DISORDER), 0.0214, BOTH),
    "stiff_foundation": Case(rod(L=0.025, H=0.0175, h=2.5e-3, V=0.11, **STIFF), 0.03, t_gap=5e-5),
}


def cases() -> dict[str, Case]:
    """Return every set by name, each with one geometry."""
    found = {
        f"{name}_{geometry}": case._replace(geometries=(geometry,))
        for name, case in CASES.items()
        for geometry in case.geometries
    }
    digests = runpy.run_path(str(HERE.parent / "scripts" / "digests"), run_name="digests")
    for name, scene, t_end, geometry, switching in digests["runs"]():
        if switching == "located":
            found[f"digest_{name.split()[0]}_{geometry}"] = Case(scene, t_end, (geometry,), 1.0)
    return found


# --- runs and how far they are apart -------------------------------------------------------------


def run(scene: pyfric.Scene, t_end: float, engine: str, geometry: str, **how: Any) -> pyfric.Record:
    return pyfric.simulate(
        scene,
        t_end,
        fidelity=engine,
        geometry=geometry,
        switching="located",
        energies=False,
        threads=1,
        progress=False,
        **how,
    )


class Reference(NamedTuple):
    """One stored set."""

    name: str
    scene: pyfric.Scene
    about: dict[str, Any]
    tables: dict[str, pd.DataFrame]

    def hybrid(self, accuracy: float | None = None) -> pyfric.Record:
        """Return its run by the hybrid engine, with the same steps."""
        about = self.about
        how = {name: about[name] for name in ("stepper", "dt", "t_gap")} | {"accuracy": accuracy}
        how["sample"] = about["sample"] * about["dt"]
        return run(self.scene, about["t_end"], "hybrid", about["geometry"], **how)

    def apart(self, record: pyfric.Record) -> dict[str, float]:
        """Return how far a run is from the set."""
        return apart(self.tables, tables(record), self.scene.F_N)


def names() -> list[str]:
    return sorted(folder.name for folder in FOLDER.iterdir() if folder.is_dir())


def load(name: str) -> Reference:
    """Return a stored set."""
    about = tomllib.loads((FOLDER / name / "provenance.toml").read_text(encoding="utf-8"))
    stored = {table: pd.read_csv(FOLDER / name / f"{table}.csv") for table in STORED}
    return Reference(name, pyfric.Scene.from_toml(about["scene"]), about, stored)


def apart(a: dict[str, pd.DataFrame], b: dict[str, pd.DataFrame], F_N: float) -> dict[str, float]:
    """Return the largest differences of two runs, event by event in order.

    Events that one run has more, and blocks of events and fronts that differ, are counted; forces
    and F_T(t) are over F_N, times in s, rupture times since the start of their event.
    """
    n = min(len(a["events"]), len(b["events"]))
    first, second = (tables["events"].iloc[:n] for tables in (a, b))
    off = (second[[*EXTENT, "n_front"]] - first[[*EXTENT, "n_front"]]).abs().to_numpy()
    since = [
        tables["fronts"].set_index(["event", "n"])["t"]
        - tables["events"]
        .set_index("event")["t_start"]
        .reindex(tables["fronts"]["event"])
        .to_numpy()
        for tables in (a, b)
    ]
    ruptures = pd.concat(since, axis=1, keys=["a", "b"])
    rupture = (ruptures["b"] - ruptures["a"]).abs().dropna()
    return {
        "events": float(abs(len(a["events"]) - len(b["events"]))),
        "start": _largest(first["F_T_start"], second["F_T_start"]) / F_N,
        "arrest": _largest(first["F_T_arrest"], second["F_T_arrest"]) / F_N,
        "time": _largest(first["t_start"], second["t_start"]),
        "blocks": float(off.sum() + len(ruptures) - len(rupture)),
        "rupture_median": float(rupture.median()) if len(rupture) else 0.0,
        "rupture": float(rupture.max()) if len(rupture) else 0.0,
        "curve": _largest(a["curve"]["F_T"], _at_times(b["curve"], a["curve"]["t"])) / F_N,
    }


def _at_times(curve: pd.DataFrame, t: pd.Series) -> pd.Series:
    """Return F_T at the points of a curve at times t (s), NaN where it has none.

    A curve has more points at corners of protocols than the stored ones.
    """
    known = curve["t"].to_numpy()
    at = np.clip(np.searchsorted(known, t - SAME_TIME * known[-1]), 0, len(known) - 1)
    found = curve["F_T"].to_numpy()[at]
    return pd.Series(np.where(np.abs(known[at] - t) <= SAME_TIME * known[-1], found, np.nan))


def _largest(a: pd.Series, b: pd.Series) -> float:
    """Return the largest difference, inf where only one of two values exists."""
    off = np.abs(b.to_numpy() - a.to_numpy())
    off[a.isna().to_numpy() != b.isna().to_numpy()] = np.inf
    return float(np.nanmax(off, initial=0.0))


# --- sets, table, ladder -------------------------------------------------------------------------


def make(name: str, case: Case, made_from: str) -> None:
    """Write a set, or raise SystemExit where its events are not determined."""
    start, scene, (geometry,) = time.perf_counter(), case.scene, case.geometries
    dt = float(f"{case.step * pyfric.step_size(scene, stepper='rk4'):.2g}")
    record = run(
        scene,
        case.t_end,
        "dynamic",
        geometry,
        dt=dt,
        sample=case.t_end / POINTS,
        t_gap=case.t_gap,
    )
    about = provenance(record, time.perf_counter() - start, made_from, f"off_box.py {name}")
    known = {table: tables(record)[table] for table in STORED}
    how = {"sample": record.method.sample * dt, "t_gap": record.method.t_gap}
    for label, other, step, limit in (
        ("half_step", scene, dt / 2, np.inf if name.startswith("digest_") else HALF_STEP),
        ("driver", faster(scene), dt, DRIVER),
    ):
        made = run(other, case.t_end, "dynamic", geometry, dt=step, **how)
        off = about[label] = apart(known, tables(made), scene.F_N)
        say(f"{name}, {label}: start {off['start']:.1e}, arrest {off['arrest']:.1e}")
        if off["events"] or off["blocks"] or max(off["start"], off["arrest"]) > limit:
            raise SystemExit(f"{name}: not determined, nothing written: {off}")
    write(FOLDER / name, known, about)


def faster(scene: pyfric.Scene) -> pyfric.Scene:
    """Return the scene with a driver faster by `FASTER`, all along its protocol."""
    driver, factor = scene.driver, 1 + FASTER
    corners = tuple((t, factor * V) for t, V in driver.protocol)
    driver = dataclasses.replace(driver, V=factor * driver.V, protocol=corners)
    return dataclasses.replace(scene, driver=driver)


def table() -> pd.DataFrame:
    """Return how far the hybrid engine is from each set."""
    rows = []
    for known in map(load, names()):
        record, events = known.hybrid(), known.tables["events"]
        off = known.apart(record)
        row = {"set": known.name, "events": len(events), "main": int(events["is_main"].sum())}
        row |= {"missing": int(off["events"]), "blocks": int(off["blocks"])}
        sizes = ("start", "arrest", "curve", "rupture_median", "rupture")
        row |= {name: f"{off[name]:.1e}" for name in sizes}
        rows.append(row | {n: record.counts[n] for n in ("steps", "steps_spared", "jumps")})
    return pd.DataFrame(rows)


def ladder(known: Reference) -> pd.DataFrame:
    """Return the events of the quasi-static engine in the scene of a set."""
    how = {"fidelity": "quasistatic", "t_gap": known.about["t_gap"], "progress": False}
    return pyfric.simulate(known.scene, known.about["t_end"], **how).events[list(LADDER)]


def ladders() -> pd.DataFrame:
    """Return those of all scenes, in linear geometry, which is the engine's."""
    found = {
        name: ladder(load(f"{name}_{case.geometries[0]}"))
        for name, case in CASES.items()
        if not case.scene.interface.d_c
    }
    return pd.concat(found, names=["scene", "event"]).reset_index()


def main(arguments: list[str]) -> None:
    for option, found in (("--table", table), ("--ladder", ladders)):
        if arguments == [option]:
            rows = found()
            say(rows.to_string(index=False))
            rows.to_csv(FOLDER / f"{option[2:]}.csv", index=False, lineterminator="\n")
            return
    known = cases()
    unknown = set(arguments) - set(known)
    if unknown:
        raise SystemExit(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(known)}")
    made_from = commit()
    for name in arguments or known:
        make(name, known[name], made_from)


if __name__ == "__main__":
    main(sys.argv[1:])
