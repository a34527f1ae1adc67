"""Do plans keep their tolerance? Random scenes, wants and tolerances against full dynamics.

Each trial draws a small scene (setup 1, setup 2 or a chain, with random size, friction, viscosity,
stiffness, load and driver), a want and a tolerance. The planned run is compared with full dynamics
in finite geometry (linear for a chain), with steps of a twenty-fifth of the stability limit, below
those of all levels. Trial n of a seed is always the same. Rows are appended to a file as they are
made, and trials in the file are not repeated.

A plan promises its tolerance. The promise is kept if the true error of the want is within the
tolerance. The promise is honest if the true error is within the measured error of the run. A record
may say that single events are uncertain from a time on. Events after this time are left out, and
counted.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from sizes import size

from pyfric.checks import regression
from pyfric.engines import ENGINES, QuasistaticRun, RunError, default_stepper, step_size
from pyfric.engines.cost import full_work, machine_speed
from pyfric.planning import simulate
from pyfric.record import Errors, differences, fronts, paired
from pyfric.scene import Spread, chain, default_geometry, setup1, setup2, slab
from pyfric.scene.laws import Ageing, SpeedDependent
from pyfric.statics import EquilibriumError, stability_limit
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["QUANTITIES", "drawn", "drawn_wide", "run", "stored", "table", "trial"]

WORK = size(3e7, 1e5)
"""Largest number of block evaluations of full dynamics with steps of `WAY`."""
EVENTS = 10
"""Number of main events of a trial in the quasi-static sequence."""
FINE = size(0.04, 0.25)
"""Step of the reference run, as a share of the stability limit."""
WAY = 0.1
"""Step, as a share of the stability limit, with which `WORK` gives the length of a trial."""
ROUNDING = 1e-6
"""Size of the errors of the reference run, and the least measured error that counts."""
VISCOSITY = (0.1, 2.0)
"""Range of eta, in units of its default value."""
TRIALS = size(200, 1)
"""Number of trials of one call."""
WANTS = ("loading_curve", "precursors", "stress", "front_speed", "motion")
QUANTITIES = ("start", "arrest", "length", "stress", "speed_median", "speed_95", "speed_worst")


def drawn(
    seed: int, n: int, viscosity: tuple[float, float] = VISCOSITY
) -> tuple[Scene, float, str, float]:
    """Return scene, t_end (s), want and tolerance of trial n of a seed.

    Its eta lies between the two values of `viscosity`, in units of the default value.
    """
    rng = np.random.default_rng([seed, n])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mu_s = float(rng.uniform(0.4, 0.8))
    how: dict[str, Any] = {"mu_s": mu_s, "mu_k": mu_s * float(rng.uniform(0.5, 0.9))}
    how["K"] = between(0.5e6, 8e6)
    kind = ("rod", "free", "chain")[rng.integers(3)]
    N_x, N_z = int(rng.integers(12, 41)), int(rng.integers(4, 11))
    if kind == "chain":
        forces = rng.uniform(30.0, 90.0, N_x)
        tau = 0.6 * how["mu_k"] * forces * np.cos(np.linspace(0, rng.uniform(1, 6), N_x))
        how |= {"p": tuple(forces.tolist()), "tau": tuple(tau.tolist()), "L": (N_x - 1) * 2.5e-3}
        how |= {"k_top": between(1e6, 5e7)}
        make = chain
    else:
        l = 2.5e-3 if kind == "rod" else 1e-3
        how |= {"L": (N_x - 1) * l, "H": (N_z - 1) * l, "h": l * int(rng.integers(1, N_z // 2 + 1))}
        how |= {"F_N": N_x * between(20.0, 100.0) * l / 2.5e-3}
        make = setup1 if kind == "rod" else setup2
        if kind == "free":
            how["theta"] = float(rng.uniform(-0.8, 0.5))
    plain = make(**how)
    eta = plain.eta * between(*viscosity)
    dt = WAY * stability_limit(make(**how, eta=eta))[0]
    t_end = dt * WORK / (4 * plain.N_x * plain.N_z)
    V = _way(plain) / t_end
    want = WANTS[rng.integers(len(WANTS))]
    tolerance = between(0.02, 0.1) if want == "front_speed" else between(0.003, 0.06)
    return make(**how, eta=eta, V=V), t_end, want, tolerance


def drawn_wide(seed: int, n: int) -> tuple[Scene, float, str, float]:
    """Return scene, t_end (s), want and tolerance of trial n of a seed, from a wider range.

    Lattices have up to 60 x 35 blocks, 3 to 300 N a block, k_f/k from 0.03 to 30, L/H from 1 to 14,
    and eta from 0.05 to 2 of the default. Some scenes have d_c, ageing, friction that weakens with
    speed, disorder, a protocol, a prescribed interface, or an end inside an event. Tolerances are
    0.1 to 0.001.
    """
    rng = np.random.default_rng([seed, n, 2])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def happens(share: float) -> bool:
        return bool(rng.uniform() < share)

    kind = str(rng.choice(["rod", "free", "chain", "slab"], p=[0.4, 0.35, 0.15, 0.1]))
    mu_s = float(rng.uniform(0.4, 0.8))
    how: dict[str, Any] = {"mu_s": mu_s, "mu_k": mu_s * float(rng.uniform(0.0, 0.95))}
    N_x, ratio = round(between(8, 60)), between(1.0, 14.0)
    N_z = int(np.clip(round(N_x / ratio), 3, 35))
    load, l = between(3.0, 300.0), 1e-3 if kind == "free" else 2.5e-3
    how["L"], d_c = (N_x - 1) * l, between(2e-7, 3e-6) if happens(0.25) else 0.0
    want = WANTS[rng.integers(len(WANTS))]
    tolerance = between(0.005, 0.1) if want == "front_speed" else between(0.001, 0.1)
    if kind == "slab":
        p = load * np.ones(N_x)
        tau = np.where(np.arange(N_x) < 5, 1.02 * mu_s, rng.uniform(how["mu_k"], mu_s)) * load
        how |= {"p": p.tolist(), "tau": tau.tolist(), "H": (N_z - 1) * l, "l": l, "d_c": d_c}
        scene = slab(**how)
        c_S = l * math.sqrt(scene.slider.k / (2 * scene.m))
        return scene, between(0.7, 2.0) * how["L"] / c_S, want, tolerance
    if kind == "chain":
        how |= {"p": (load * rng.uniform(0.5, 1.5, N_x)).tolist(), "k_top": between(1e5, 5e7)}
        make = chain
    else:
        how |= {"H": (N_z - 1) * l, "h": l * int(rng.integers(1, max(N_z // 2, 1) + 1))}
        how |= {"F_N": N_x * load}
        make = setup1 if kind == "rod" else setup2
        how["k_f"] = make(**how).slider.k * between(0.03, 30.0)
        if kind == "free":
            how["theta"] = float(rng.uniform(-0.8, 0.8))
    plain = make(**how)
    how["K"] = plain.slider.k * between(0.02, 1.0) / max(N_z, 2) ** 0.5
    how["eta"] = plain.eta * between(0.05, 2.0)
    scene = make(**how)
    t_end = WAY * stability_limit(scene)[0] * WORK / (4 * scene.N_x * scene.N_z)
    way = _way(scene) * (between(0.6, 1.0) if happens(0.4) else 1.0)
    scene = scene.replace({"driver.V": way / t_end, "interface.d_c": d_c})
    if happens(0.1):
        law = Ageing(B=between(0.002, 0.02), t_c=between(1e-5, 1e-3))
        scene = scene.replace({"interface.law": law})
    elif happens(0.1) and kind != "chain":
        law = SpeedDependent(v=(0.0, 0.02, 0.2), factor=(1.0, float(rng.uniform(0.7, 0.95)), 0.9))
        scene = scene.replace({"interface.law": law})
    if happens(0.2) and how["mu_k"] < 0.75 * mu_s:
        scene = scene.replace({"interface.mu_s": Spread(mean=mu_s, std=0.05 * mu_s, seed=n)})
    if happens(0.15):
        V, parts = scene.driver.V, np.sort(rng.uniform(0.2, 0.9, 2)) * t_end
        corners = ((parts[0], V), (parts[0], 0.0), (parts[1], 0.0), (parts[1], 2 * V))
        scene = scene.replace({"driver.protocol": tuple((float(t), v) for t, v in corners)})
    if happens(0.25) and kind != "chain":  # inside an event of the quasi-static engine
        quiet = scene.replace(interface=scene.interface.coulomb())
        with contextlib.suppress(SceneError, EquilibriumError):
            events = simulate(quiet, t_end, fidelity="quasistatic", progress=False).events
            starts = events["t_start"][events["is_main"]]
            if len(starts):
                c_S = l * math.sqrt(scene.slider.k / (2 * scene.m))
                t_end = float(starts.iloc[-1]) + between(0.2, 2.0) * how["L"] / c_S
    return scene, t_end, want, tolerance


def _way(scene: Scene) -> float:
    """Return the driver's displacement up to `EVENTS` main events in quasi-static slip, in m."""
    one = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, V=1.0))
    most = 2 * scene.F_N * (1 / scene.driver.K + 1 / scene.slider.k)
    ladder = QuasistaticRun(one, t_gap=0.0)
    ladder.advance(most, lambda: ladder.events > 20 * EVENTS, lambda *_: None)
    events = ladder.record("complete").events
    starts = events["t_start"].to_numpy()[events["is_main"].to_numpy()]
    return float(1.02 * starts[: EVENTS + 1][-1]) if len(starts) else most


def trial(
    scene: Scene,
    t_end: float,
    want: str,
    tolerance: float,
    fine: float = FINE,
    verify: str | None = None,
    budget: float | None = None,
) -> dict[str, Any]:
    """Return the result of one trial, as a row of the table.

    Args:
        scene, t_end, want, tolerance: those of the plan.
        fine: step of the reference run, as a share of the stability limit.
        verify: how the run measures its errors; None means the default.
        budget: processor time (s) that the plan may take; None means the default.
    """
    how = {"want": want, "tolerance": tolerance, "verify": verify, "budget": budget}
    machine_speed.cache_clear()  # as in a new process
    start = time.process_time()
    made = simulate(scene, t_end, **how, progress=False)
    ran = time.process_time()
    truth = simulate(
        scene,
        t_end,
        fidelity="dynamic",
        dt=fine * stability_limit(scene)[0],
        switching="located",
        t_gap=made.method.t_gap,
        energies=False,
        progress=False,
    )
    end = time.process_time()
    row = {"want": want, "tolerance": tolerance, "N_x": scene.N_x, "N_z": scene.N_z, "t_end": t_end}
    row |= {"eta": scene.eta / math.sqrt(scene.slider.k * scene.m), "V": scene.driver.V}
    row |= {"engine": made.method.engine}
    row |= {"geometry": made.method.geometry, "dt": made.method.dt}
    row |= {"of_longest": of_longest(made)}
    row |= {"seconds_run": ran - start, "seconds_alone": alone(scene, t_end)}
    row |= {"full_work": full_seconds(scene, made, t_end), "seconds_reference": end - ran}
    levels = [n for n in made.notes if n.startswith(f"for {want} within")]
    row |= {"levels": levels[0].count(", then ") + 1}
    row |= {"not_made": any(n.startswith("not made") for n in made.notes)}
    return row | judged(made, truth)


def alone(scene: Scene, t_end: float) -> float:
    """Return the processor time (s) of a run in finite geometry without verification."""
    start = time.process_time()
    engine = "dynamic" if ENGINES["hybrid"].cannot(scene) else "hybrid"
    how = {"energies": False} if engine == "dynamic" else {}
    simulate(scene, t_end, fidelity=engine, progress=False, **how)
    return time.process_time() - start


def of_longest(made: Record) -> float | None:
    """Return the ratio of a record's step to the longest step of RK4 that resolves weakening."""
    scene, dt = made.scene, made.method.dt
    return dt and dt / min(stability_limit(scene)[0], scene.resolving_step)


def full_seconds(scene: Scene, made: Record, t_end: float) -> float:
    """Return the expected time of full dynamics at the step of a record, in s."""
    dt, stepper = made.method.dt or step_size(scene), made.method.stepper or default_stepper(scene)
    return full_work(scene, default_geometry(scene), dt, t_end, stepper) * machine_speed()


def judged(made: Record, truth: Record) -> dict[str, Any]:
    """Return the errors of a record, measured and true, and whether they keep the tolerance."""
    own = made.errors or Errors()
    until = math.inf
    if own.until is not None or own.partly:
        until = own.until if own.until is not None and own.holds is None else own.covered
    apart, trusted = differences(made, truth), differences(made, truth, until)
    real = Errors(want=own.want, tolerance=own.tolerance, **trusted.errors())
    row: dict[str, Any] = {"events": len(apart.events), "trusted": len(trusted.events)}
    row |= {"covered": own.covered, "by": "; ".join(map(str, own.by))}
    every = Errors(want=own.want, tolerance=own.tolerance, **apart.errors())
    row |= {"measured": own.measured(), "real": real.measured(), "real_of_all": every.measured()}
    unknown = own.holds is None and (own.until is None or own.measured() is None)
    row |= {"until": own.until, "said": own.holds is False or unknown}
    row |= {"beyond_tolerance": real.holds is False}
    row |= {"not_measured": unknown}
    speeds = sum(len(differences(one, one).speeds) for one in (made, truth))
    row |= {"no_front_speed": own.want == "front_speed" and not speeds}
    both = None not in (own.measured(), real.measured())
    row |= {"beyond_measured": both and real.measured() > max(own.measured(), ROUNDING)}
    for name in QUANTITIES:
        row |= {f"measured_{name}": getattr(own, name), f"real_{name}": getattr(real, name)}
    return row


def run(
    path: Path,
    numbers: Iterable[int],
    seed: int = 1,
    progress: bool = True,
    verify: str | None = None,
    viscosity: tuple[float, float] = VISCOSITY,
    wide: bool = False,
    weakening: bool = False,
) -> pd.DataFrame:
    """Make the trials that are missing in a file, append their rows, and return all rows.

    Args:
        path: CSV file, made if missing.
        numbers: numbers of the trials.
        seed: seed of the draws.
        progress: print one line for each trial.
        verify: as in `trial`.
        viscosity: as in `drawn`.
        wide: draw from `drawn_wide`.
        weakening: leave out scenes with d_c = 0.
    """
    done = set()
    if path.exists():
        rows = pd.read_csv(path)
        done = set(zip(rows["seed"], rows["n"], strict=True))
    for n in numbers:
        if (seed, n) in done:
            continue
        try:
            question = drawn_wide(seed, n) if wide else drawn(seed, n, viscosity)
            if weakening and not question[0].interface.d_c:
                continue
            found = trial(*question, verify=verify)
        except (RunError, SceneError, EquilibriumError) as error:
            print(f"{n}: no such scene: {error}", flush=True)  # refused, or a folded lattice
            continue
        row = {"seed": seed, "n": n, "kind": question[0].name} | found
        new = not path.exists()
        with path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(row), lineterminator="\n")
            if new:
                writer.writeheader()
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})
        if progress:
            kept = "kept" if not row["beyond_tolerance"] else "BROKEN"
            real = "not known" if row["real"] is None else f"{row['real']:.2g}"
            print(f"{n}: {row['want']} {row['tolerance']:.3g}: {real}, {kept}", flush=True)
    return pd.read_csv(path)


def table(rows: pd.DataFrame) -> pd.DataFrame:
    """Return how often promises were kept, in one row for each want and one row for all."""
    groups = [*rows.groupby("want"), ("all", rows)]
    return pd.DataFrame(
        [
            {
                "want": want,
                "trials": len(group),
                "beyond the tolerance": int(group["beyond_tolerance"].sum()),
                "of which the record says so": int(
                    (group["beyond_tolerance"] & group["said"]).sum()
                ),
                "beyond the measured error": int(group["beyond_measured"].sum()),
                "not measured": int(group["not_measured"].sum()),
                "no front has a speed": int(group["no_front_speed"].sum()),
                "beyond two levels": int((group["levels"] > 2).sum()),
                "moved on from single events": int(group["until"].notna().sum()),
                "events trusted": f"{group['trusted'].sum() / max(group['events'].sum(), 1):.1%}",
            }
            for want, group in groups
        ]
    )


def stored(name: str, folder: Path, tolerance: float = 0.05) -> dict[str, Any]:
    """Return a row that compares a planned run's front speeds with those of stored full dynamics.

    Args:
        name: a set of `pyfric.checks.regression`, such as "run4_finite".
        folder: folder of the set.
        tolerance: tolerance of the plan for front speeds.
    """
    known = regression.load(name, folder)
    t_end = float(known.whole["t_stop"]) + regression.AFTER
    made = simulate(known.scene, t_end, want="front_speed", tolerance=tolerance, progress=False)
    ours, events = fronts(made), made.events
    main = known.events[
        known.events["is_main"] & (known.events["t_start"] <= known.whole["t_start"])
    ]
    mine = events[events["is_main"]]
    off = []
    for i, j in zip(*paired(main, mine, known.scene), strict=True):
        a = known.fronts[known.fronts["event"] == main.index[i]].set_index("n")["v_c"]
        b = ours[ours["event"] == mine.index[j]].set_index("n")["v_c"]
        either = pd.concat([a, b], axis=1, keys=["a", "b"]).dropna(how="all")
        off += (either["b"] / either["a"] - 1).abs().fillna(1.0).tolist()
    own, apart = made.errors or Errors(), np.array(off)
    row = {"set": name, "tolerance": tolerance, "geometry": made.method.geometry}
    row |= {"dt": made.method.dt, "main_events": len(mine), "stored_main_events": len(main)}
    row |= {"blocks": len(apart), "beyond": float((apart > tolerance).mean()), "until": own.until}
    for label, real in (
        ("median", np.median(apart)),
        ("95", np.quantile(apart, 0.95)),
        ("worst", apart.max()),
    ):
        row |= {f"measured_{label}": getattr(own, f"speed_{label}"), f"real_{label}": float(real)}
    return row
