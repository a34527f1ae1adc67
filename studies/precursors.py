"""When are there precursors? Their number and length over the nucleation length.

A precursor needs a patch that slips unstably and is smaller than the slider. If friction weakens
with slip, slip becomes unstable at the nucleation length L_c. So precursors should end at a fixed
ratio of L_c to the length L of the slider, and their number should be a function of L_c/L. Each
series of runs changes one parameter of the Fig. 1 scene (l = 5 mm), or the law, at the same values
of L_c/L.

This rule was fixed before the runs. Some counts were known before the rule: with linear weakening
11 precursors at 6 um and 0 at 8 um for l = 2.5 mm; 9, 2 and 0 at 8, 10 and 20 um for l = 5 mm; with
rate and state (l = 5 mm) 5 at 0.4 mm/s and 27 at 4 mm/s. Pilot runs measured times. Their counts
were read only for two seeds of four points of a slider of nine blocks.

Precursor  A finished event of at least four blocks, before the first event of all blocks. It
           includes the block at the trailing edge, and leaves out at least one other block. The
           count of a run is `n_precursors`. Events by contact, the default of pyfric, make the
           verdict. Events by slip faster than `FAST` are also counted, because stable slip joins
           only events by contact.
L_c        Slip weakening: 1.158 E d_c/((mu_s - mu_k) p), twice the half-length of Uenishi and Rice,
           with the slope at the first slip and mean p. Rate and state: twice the half-length of
           Rubin and Ampuero, 1.3774 L_b for a/b < 0.378, else L_b/(pi (1 - a/b)^2).
Series     `SERIES`. Only the laws, mu_s, L, H and h test L_c. In linear geometry F_N and V at one
           L_c/L are one parameter, V/F_N.
Disorder   mu_s (f* with rate and state) is a random field, the same function of x for each l. Its
           width is `WIDTH`, and its correlation length 20 mm. Points have `SEEDS` seeds, or `FEW`
           where runs are long. Error bars are standard errors.
Collapse   y = ln(1 + mean count) of a series at a value of L_c/L. The curve of a scale is the
           least-squares curve that never rises. The curve is linear in ln between its points and
           constant beyond them. Each series is left out in turn, and the curve through the other
           series predicts its y. The share of a scale is the predicted share of the variance of y.
           Scales are L_c/L; the nulls d_c alone, L_c alone, position of load (L_c/h) and size of
           the lattice (L_c/l); also L_c/H, and energies in place of slopes (L_G/L; exponential
           weakening takes twice the energy). All series of slip weakening count, with l = 5 and 2.5
           mm. L_c/L holds if its share is `ENOUGH` or more, and larger than that of each null in 95
           % or more of `DRAWS` draws of series with replacement. L_c/L is refuted if a null has the
           larger share in 95 % or more. Otherwise the data are inconclusive.
End        Precursors end where the mean count falls below 1/2 for good, interpolated in ln(L_c/L).
           Error bars are 16 to 84 % of draws of seeds. All series of a scale have one end if the
           ratio of the largest to the smallest is below `ONE`. Scales are ranked by the standard
           deviation of the ln of the end.
Lattice    The ends at l and l/2 are compared for precursors of at least four blocks of l, the same
           least size for both. The end does not depend on l if both agree within 20 %, and if X_c0
           has `RESOLVED` blocks or more at the end on the finer lattice.
Rate       Series of rate and state have a separate curve. The same criteria decide whether
           a/b = 2/3 and 1/3 agree, and whether their ends are those of slip weakening.
Engine     Hybrid, linear geometry, accuracy 1e-3. `checks` repeats some runs in full dynamics. The
           hybrid engine is good enough if counts are the same in all checks.

Deviations from the rule: three and `FEW` seeds were made instead of six. Exponential weakening with
l = 2.5 mm, rate and state with 4 mm/s and one check were left out for their time. `half` in
`precursors_found` was added when counts were known.

Source: K. Uenishi and J. R. Rice, J. Geophys. Res. 108, 2042 (2003); A. M. Rubin and J.-P. Ampuero,
J. Geophys. Res. 110, B11312 (2005).
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from sizes import size

from pyfric.laws import ExponentialWeakening
from pyfric.record import Outline, Record
from pyfric.record.zones import zone_at_rest
from pyfric.scene import Scene, Spread, preset
from pyfric.sweeps import Job, Sweep
from pyfric.values import write

__all__ = ["FAST", "SEEDS", "SERIES", "Series", "checks", "nucleation_length", "scene_at", "study"]

FAST = 10e-3
"""Slip rate of events by rate, m/s: 13 times the driver's speed, a hundredth of that of
ruptures."""
WIDTH = 0.03
"""Standard deviation of mu_s, divided by its mean."""
RATED_WIDTH = 0.01
"""Standard deviation of f*, divided by its mean; drops of f* are smaller."""
CORRELATION = 20e-3
"""Correlation length of mu_s and f*, m."""
SEEDS, FEW = size(3, 2), 2
"""Seeds of each point, and of points of series that take long or do not test L_c."""
AT = size((0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6), (0.05, 0.6))
"""Values of L_c/L for slip weakening; in the base series d_c = 0.8 to 25 um."""
AT_RATED = size((0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6), (0.6,))
"""Values of L_c/L for rate and state."""
NEAR = size((0.1, 0.15, 0.2, 0.25, 0.3), (0.05,))
"""Values of L_c/L on lattices of half the spacing."""
V = 0.7875e-3
"""Speed of the driver in the Fig. 1 scene, m/s."""
PUSHED = size(1.6e-3, 0.4e-3)
"""Largest displacement of the driver in a run, m."""
BASE = size({"l": 5e-3}, {"l": 5e-3, "L": 0.03, "H": 0.01, "F_N": 750.0})
"""Changes of the scene in all series."""
HOW = {
    "fidelity": "hybrid",
    "geometry": "linear",
    "verify": "none",
    "accuracy": 1e-3,
    "energies": False,
    "threshold": FAST,
    "stop_when": "system_size",
}
"""Options of `simulate` in all runs."""
TEXT = {"lengths": str, "lengths_by_rate": str}
"""Columns that are text: lengths in units of L, separated by blanks."""
SAMPLES = 2000
"""Number of points of the curve in a run."""
UENISHI_RICE, RUBIN_AMPUERO, SMALL_RATIO = 2 * 0.579, 1.3774, 0.378


class Series(NamedTuple):
    """A series of runs: its changes, its values of L_c/L, and its largest number of seeds.

    Series that take long, or do not test L_c, have fewer seeds.
    """

    changes: Mapping[str, Any] = {}
    at: Sequence[float] = AT
    preset: str = "fig1"
    seeds: int = SEEDS


_RATED: dict[str, Any] = {"preset": "rate_and_state", "at": AT_RATED}
SERIES = {
    "base": Series(),
    "exponential": Series({"law": ExponentialWeakening()}, seeds=FEW),
    "mu_s = 0.575": Series({"mu_s": 0.575}),
    "L = 70 mm": Series({"L": 0.07, "F_N": 1750.0}),
    "H = 35 mm": Series({"H": 0.035, "M": 0.0756 * 35 / 75}),
    "L = 70 mm, H = 35 mm": Series(
        {"L": 0.07, "F_N": 1750.0, "H": 0.035, "M": 0.0756 * 35 / 75 / 2}
    ),
    "h = 10 mm": Series({"h": 0.01}),
    "h = 20 mm": Series({"h": 0.02}),
    "F_N = 1750 N": Series({"F_N": 1750.0}, seeds=FEW),
    "V = 3.15 mm/s": Series({"V": 4 * V}, seeds=FEW),
    "V = 0.2 mm/s": Series({"V": V / 4}, seeds=FEW),
    "l = 2.5 mm": Series({"l": 2.5e-3}, NEAR, seeds=FEW),
    "rate and state": Series(**_RATED),
    "rate and state, a/b = 1/3": Series({"a": 0.005}, **_RATED),
    "rate and state, h = 20 mm": Series({"h": 0.02}, **_RATED, seeds=FEW),
    "rate and state, H = 35 mm": Series({"H": 0.035, "M": 0.0756 * 35 / 75}, **_RATED, seeds=FEW),
    "rate and state, F_N = 1750 N": Series({"F_N": 1750.0}, **_RATED, seeds=FEW),
    "rate and state, l = 2.5 mm": Series({"l": 2.5e-3}, **_RATED, seeds=FEW),
}
"""Name -> series of runs."""
SERIES = size(SERIES, {name: SERIES[name] for name in ("base", "l = 2.5 mm", "rate and state")})
CHECKED = size((("base", 0.05), ("base", 0.2), ("h = 20 mm", 0.2)), ())
"""Series and L_c/L at which the first seed also runs by full dynamics."""


# --- lengths -------------------------------------------------------------------------------------


def nucleation_length(scene: Scene) -> float:
    """Return L_c of a scene with mean values of its fields, m; see the module."""
    law, k, p = scene.interface.law, scene.slider.k, scene.F_N / scene.N_x
    if law.kind == "rate_and_state":
        ratio, L_b = law.a / law.b, 4 / 3 * k * law.D_c / (law.b * p)
        half = RUBIN_AMPUERO if ratio < SMALL_RATIO else 1 / (math.pi * (1 - ratio) ** 2)
        return 2 * half * L_b * scene.slider.l
    drop = (scene.interface.mu_s - scene.interface.mu_k) * p
    return UENISHI_RICE * 4 / 3 * k * scene.interface.d_c / drop * scene.slider.l


def scene_at(series: Series, share: float) -> Scene:
    """Return the scene of a series without disorder at a value of L_c/L."""
    name = "D_c" if series.preset == "rate_and_state" else "d_c"
    changes = {**BASE, **series.changes}
    trial = preset(series.preset, {**changes, name: 1e-6})
    return preset(
        series.preset, {**changes, name: 1e-6 * share * trial.slider.L / nucleation_length(trial)}
    )


def sweep_of(series: Series, share: float, seeds: Sequence[int]) -> Sweep:
    """Return the runs of some seeds of a series at a value of L_c/L."""
    scene = scene_at(series, share)
    rated = series.preset == "rate_and_state"
    field, width = ("f_star", RATED_WIDTH) if rated else ("mu_s", WIDTH)
    mean = scene.interface.law.f_star if rated else scene.interface.mu_s
    spread = {"mean": mean, "std": width * mean, "correlation_length": CORRELATION}
    t_end = PUSHED / scene.driver.V
    return Sweep(
        scene=scene,
        t_end=t_end,
        over={field: [Spread(**spread, seed=seed) for seed in seeds]},
        points="list",
        options=HOW | {"sample": t_end / SAMPLES},
    )


# --- runs ----------------------------------------------------------------------------------------


def counted(record: Record) -> dict[str, Any]:
    """Return the counts of a run: precursors by contact and by rate, and their lengths."""
    row: dict[str, Any] = {"status": record.status.partition(" (")[0]}
    for by, found in {"": record.with_events(), "_by_rate": record}.items():
        run = Outline.of_record(found)
        lengths = run.events["L_p_over_L"][run.precursors]
        row |= {
            f"n{by}": int(run["n_precursors"]),
            f"slides{by}": bool(len(run.sliding)),
            f"F_first{by}": run["F_precursor"] / record.scene.F_N,
            f"F_slide{by}": run["F_slide"] / record.scene.F_N,
            f"lengths{by}": " ".join(f"{length:.4f}" for length in lengths),
        }
    return row


def about(name: str, share: float) -> dict[str, Any]:
    """Return the description of a point: series, scales (m), and blocks in X_c0 at p = F_N/N_x."""
    scene = scene_at(SERIES[name], share)
    law, slider = scene.interface.law, scene.slider
    rated = law.kind == "rate_and_state"
    row: dict[str, Any] = {"series": name, "share": share, "law": law.kind}
    row |= {"d_c": law.D_c if rated else scene.interface.d_c, "L_c": nucleation_length(scene)}
    row |= {"L": slider.L, "H": slider.H, "l": slider.l, "h": scene.driver.h}
    p = scene.F_N / scene.N_x
    zone = scene.law.blocks_in_L_b(p, slider.k) if rated else zone_at_rest(scene, p)
    energy = 2.0 if law.kind == "exponential" else 1.0
    return row | {"zone": float(zone), "L_energy": energy * row["L_c"]}


def study(
    runs: Path,
    names: Sequence[str] = tuple(SERIES),
    seeds: int = SEEDS,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return one row for each run: columns of `about` and `counted`, seed, processor time (s).

    Args:
        runs: folder in which rows are kept; it is made if missing. Rows in it are not made again.
        names: series.
        seeds: number of seeds of each point, at most that of the series.
        say: called with the name of the next run.
    """
    runs.mkdir(parents=True, exist_ok=True)
    tables = []
    for name in names:
        count = min(seeds, SERIES[name].seeds)
        for share in SERIES[name].at:
            path = _file(runs, name, share)
            table = _kept(path, name, share, count, say)
            tables.append(table[table["seed"] < count])
    return pd.concat(tables, ignore_index=True)


def _file(runs: Path, name: str, share: float) -> Path:
    """Return the file of a point."""
    return runs / f"precursors_{re.sub(r'[^a-zA-Z0-9.]+', '_', name)}_{share:g}.csv"


def _kept(
    path: Path, name: str, share: float, seeds: int, say: Callable[[str], None]
) -> pd.DataFrame:
    """Return the runs of a point; those in its file are not made again."""
    rows = pd.read_csv(path, dtype=TEXT).to_dict("records") if path.is_file() else []
    missing = sorted(set(range(seeds)) - {row["seed"] for row in rows})
    if missing:
        say(f"{name}, L_c/L = {share:g}, seeds {missing[0]} to {missing[-1]}")
    for seed in missing:
        (job,) = sweep_of(SERIES[name], share, [seed]).jobs
        rows.append({**about(name, share), "seed": seed, **_made(job)})
        write(path, pd.DataFrame(rows).to_csv(index=False).encode())
    return pd.read_csv(path, dtype=TEXT).sort_values("seed")


def _made(job: Any) -> dict[str, Any]:
    if not isinstance(job, Job):  # refused
        raise job
    begun = time.process_time()
    row = counted(job.made(progress=False))
    return row | {"seconds": time.process_time() - begun}


def checks(runs: Path, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return counts of the points `CHECKED`, by full dynamics, for the first seed.

    Args:
        runs: folder in which rows are kept.
        say: called with the name of the next run.
    """
    runs.mkdir(parents=True, exist_ok=True)
    tables = []
    for name, share in CHECKED:
        path = _file(runs, f"{name} dynamic", share)
        if not path.is_file():
            say(f"full dynamics, {name}, L_c/L = {share:g}")
            (job,) = sweep_of(SERIES[name], share, [0]).jobs
            how = {**job.options.given(), "fidelity": "dynamic", "accuracy": None}
            row = {**about(name, share), "seed": 0, **_made(Job(job.scene, job.t_end, how))}
            write(path, pd.DataFrame([row]).to_csv(index=False).encode())
        tables.append(pd.read_csv(path, dtype=TEXT))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
